//! Perfect refraction: Snell's law, total internal reflection and the weights of the two rays of [Whitted80].
//!
//! Radiance along the refracted ray is not scaled by `(n₂/n₁)²`: as in Whitted's model, the factor that entering a medium
//! brings is undone on leaving it.

use super::{fresnel, mirror};
use crate::math::Vec3;
use crate::spectrum::Spectrum;

/// What lies behind a transmitting surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transmission {
    /// `k_t`, before any Fresnel weight.
    pub weight: Spectrum,
    /// Index of refraction inside, relative to outside.
    pub ior: f32,
    /// A sheet: rays pass without bending.
    pub thin: bool,
    /// Absorption inside (Beer), 1/m.
    pub absorption: Spectrum,
    /// Of two overlapping media the higher priority wins.
    pub priority: i32,
}

/// The rays that leave a smooth surface, and what their radiance is multiplied by.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SpecularRays {
    /// Unit direction and weight of the reflected ray.
    pub reflected: Option<(Vec3, Spectrum)>,
    /// Unit direction and weight of the refracted ray.
    pub refracted: Option<(Vec3, Spectrum)>,
}

/// The refracted direction of light arriving from `w`, by Snell's law; `None` under total internal reflection.
///
/// `w` and the result point away from the surface, `n` is unit and on the side of `w`, `eta` = index on the side of `w` over
/// index on the other: `t = −η w + (η c − √(1 − η²(1 − c²))) n`, `c = n·w`.
pub fn refract(w: Vec3, n: Vec3, eta: f32) -> Option<Vec3> {
    // The part of w along the surface rather than 1 − c²: exact where the two would cancel.
    let c = n.dot(w);
    let tangent = w - n * c;
    let sin2_t = eta * eta * tangent.length_squared();
    (sin2_t < 1.0).then(|| (tangent * -eta - n * (1.0 - sin2_t).sqrt()).normalize())
}

/// What a sheet reflects whose two faces reflect `r` each, with all the light that bounces inside: R + T²R/(1 − R²) = 2R/(1 + R). The rest passes.
pub(super) fn of_sheet(r: f32) -> f32 {
    2.0 * r / (1.0 + r)
}

/// Reflected and refracted ray with constants `k_r`, `k_t`, weighed by Fresnel for the index `fresnel_ior` when given.
/// What cannot be refracted is reflected.
pub(super) fn specular_rays(
    k_r: Spectrum,
    fresnel_ior: Option<f32>,
    transmission: Option<Transmission>,
    n: Vec3,
    wo: Vec3,
    entering: bool,
) -> SpecularRays {
    if k_r.is_black() && transmission.is_none() {
        return SpecularRays::default();
    }
    let cos_o = n.dot(wo).clamp(0.0, 1.0);
    // A sheet has its outside on both sides, and so has what is opaque.
    let relative = |ior: f32| if entering || transmission.is_none_or(|t| t.thin) { ior } else { 1.0 / ior };
    let facet = fresnel_ior.map(|ior| fresnel::dielectric(cos_o, relative(ior)));
    let facet = facet.map(|r| if transmission.is_some_and(|t| t.thin) { of_sheet(r) } else { r });
    let mut reflect = k_r * facet.unwrap_or(1.0);
    let refracted = transmission.and_then(|t| {
        let direction = if t.thin { Some(-wo) } else { refract(wo, n, 1.0 / relative(t.ior)) };
        if direction.is_none() && facet.is_none() {
            reflect += t.weight;
        }
        direction.map(|d| (d, t.weight * (1.0 - facet.unwrap_or(0.0))))
    });
    let visible = |ray: &(Vec3, Spectrum)| !ray.1.is_black();
    SpecularRays { reflected: Some((mirror::reflect(wo, n), reflect)).filter(visible), refracted: refracted.filter(visible) }
}
