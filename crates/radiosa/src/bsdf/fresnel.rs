//! How much of the light one smooth facet reflects, as a function of the angle: Fresnel's equations for unpolarised light
//! and Schlick's approximation of them.

use crate::scene;
use crate::spectrum::Spectrum;

/// How the constants `k_r`, `k_t` of mirrors and glass are weighed. Metallic–roughness materials are Fresnel's by definition.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Weighing {
    /// As the material says.
    #[default]
    Material,
    /// Everything transparent by Fresnel's equations: `k_r F`, `k_t (1 − F)`.
    On,
    /// The constants as they are, as in 1980.
    Off,
}

/// Exact reflectance of an interface without absorption.
///
/// `cos_i` in `[0, 1]` on the side the light comes from, `eta` = index on the other side over index on this one; 1 under total
/// internal reflection. The form of [Cook82]: `F = ½ ((g−c)/(g+c))² [1 + ((c(g+c)−1)/(c(g−c)+1))²]`, `g² = η² + c² − 1`.
pub fn dielectric(cos_i: f32, eta: f32) -> f32 {
    let c = cos_i.clamp(0.0, 1.0);
    let g2 = eta * eta - 1.0 + c * c;
    if g2 <= 0.0 {
        return 1.0;
    }
    let g = g2.sqrt();
    let perpendicular = (g - c) / (g + c);
    let parallel = (c * (g + c) - 1.0) / (c * (g - c) + 1.0);
    0.5 * perpendicular * perpendicular * (1.0 + parallel * parallel)
}

/// Exact reflectance of an absorbing medium of complex index `n + ik`, seen from vacuum. [BornWolf99], §14.2
///
/// | code   | meaning                                          |
/// |--------|--------------------------------------------------|
/// | `a2b2` | a² + b² = |√(η² − sin²)|², with η = n + ik        |
/// | `a`    | its real part                                    |
pub fn conductor(cos_i: f32, n: f32, k: f32) -> f32 {
    let c = cos_i.clamp(0.0, 1.0);
    let c2 = c * c;
    let s2 = 1.0 - c2;
    let t = n * n - k * k - s2;
    let a2b2 = (t * t + 4.0 * n * n * k * k).sqrt();
    let a = (0.5 * (a2b2 + t)).max(0.0).sqrt();
    let perpendicular = ratio(a2b2 + c2, 2.0 * a * c);
    let parallel = perpendicular * ratio(c2 * a2b2 + s2 * s2, 2.0 * a * c * s2);
    0.5 * (perpendicular + parallel)
}

/// `(p − q)/(p + q)`, one when both vanish (grazing incidence).
fn ratio(p: f32, q: f32) -> f32 {
    if p + q > 0.0 { (p - q) / (p + q) } else { 1.0 }
}

/// `F₀ + (1 − F₀)(1 − cos)⁵`. [Schlick94]
pub fn schlick(cos_i: f32, f0: Spectrum) -> Spectrum {
    f0 + (Spectrum::WHITE - f0) * schlick_weight(cos_i)
}

/// `(1 − cos)⁵`.
pub fn schlick_weight(cos_i: f32) -> f32 {
    let m = (1.0 - cos_i).clamp(0.0, 1.0);
    let m2 = m * m;
    m2 * m2 * m
}

/// Reflectance at normal incidence of an interface of relative index `eta`.
pub fn f0_of_ior(eta: f32) -> f32 {
    let r = (eta - 1.0) / (eta + 1.0);
    r * r
}

/// `F_avg = 2 ∫ F(μ) μ dμ`, by Simpson's rule.
pub fn mean(of: impl Fn(f32) -> Spectrum) -> Spectrum {
    const N: u32 = 16;
    let mut sum = Spectrum::BLACK;
    for i in 0..=N {
        let cos = i as f32 / N as f32;
        let weight = if i == N {
            1.0
        } else if i % 2 == 1 {
            4.0
        } else {
            2.0
        };
        sum += of(cos) * (2.0 * cos * weight / (3 * N) as f32);
    }
    sum
}

/// Reflectance of one facet under `cos_i = wo·h`, by channel.
pub fn facet(fresnel: &scene::Fresnel, cos_i: f32) -> Spectrum {
    match *fresnel {
        scene::Fresnel::One => Spectrum::WHITE,
        scene::Fresnel::Dielectric { ior } => Spectrum::gray(dielectric(cos_i, ior)),
        scene::Fresnel::Conductor { n, k } => {
            Spectrum::new(conductor(cos_i, n.r, k.r), conductor(cos_i, n.g, k.g), conductor(cos_i, n.b, k.b))
        }
        scene::Fresnel::Schlick { f0 } => schlick(cos_i, f0),
    }
}
