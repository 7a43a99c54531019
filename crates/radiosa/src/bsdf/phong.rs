//! The classic highlight, by reflection vector [Phong75] and by halfway vector [Blinn77], with the mirror and glass constants
//! of [Whitted80]: the model of OBJ's materials.
//!
//! Both authors add the highlight to the picture without the cosine of the light's angle, `k_s (r·v)^n` or `k_s (n·h)^n`
//! times the light's intensity. Written as a reflection function that is `(k_s/π)(r·v)^n/(n·l)`: not reciprocal, not
//! energy-conserving, infinite at grazing light, and kept so for delta lights. [`lafortune`] is the normalised lobe that
//! replaces it where light is integrated.

use std::f32::consts::{FRAC_1_PI, PI};

use super::{Lobes, Lookup, Transmission, dielectric, fresnel, lambert, mirror};
use crate::math::{Vec3, function};
use crate::scene::{self, PhongLobe};
use crate::spectrum::Spectrum;

/// Coefficients at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Phong {
    /// `k_a`.
    pub ambient: Spectrum,
    /// `k_d`.
    pub diffuse: Spectrum,
    /// `k_s`.
    pub specular: Spectrum,
    /// `n`.
    pub exponent: f32,
    /// Which vector the highlight measures.
    pub lobe: PhongLobe,
    /// `k_r`.
    pub mirror: Spectrum,
    /// `k_t` and the medium behind.
    pub transmission: Option<Transmission>,
    /// Fresnel's equations weigh `k_r` and `k_t`: the material's index of refraction, whether it transmits or not.
    pub fresnel: Option<f32>,
    /// Without transmission, `k_r` rises to 1 at grazing angles by Schlick's approximation.
    pub schlick: bool,
}

impl Default for Phong {
    /// Black.
    fn default() -> Self {
        Self {
            ambient: Spectrum::BLACK,
            diffuse: Spectrum::BLACK,
            specular: Spectrum::BLACK,
            exponent: 1.0,
            lobe: PhongLobe::Phong,
            mirror: Spectrum::BLACK,
            transmission: None,
            fresnel: None,
            schlick: false,
        }
    }
}

impl Phong {
    pub(super) fn resolve(m: &scene::Phong, lookup: &impl Lookup) -> Self {
        let vertex = lookup.vertex_color();
        let diffuse = lookup.color(&m.diffuse) * vertex;
        Self {
            ambient: m.ambient.as_ref().map_or(diffuse, |map| lookup.color(map) * vertex),
            diffuse,
            specular: lookup.color(&m.specular),
            exponent: lookup.scalar(&m.exponent).max(0.0),
            lobe: m.lobe,
            mirror: m.mirror,
            transmission: (!m.transmission.is_black()).then_some(Transmission {
                weight: m.transmission,
                ior: m.ior,
                thin: m.thin,
                absorption: m.absorption,
                priority: m.priority,
            }),
            fresnel: m.fresnel.then_some(m.ior),
            schlick: m.schlick,
        }
    }

    /// `k_r` before Fresnel's equations, seen under `cos_o`; what reflects nothing head-on is no mirror at grazing angles either.
    pub(super) fn mirror_at(&self, cos_o: f32) -> Spectrum {
        if self.schlick && self.transmission.is_none() && !self.mirror.is_black() {
            fresnel::schlick(cos_o, self.mirror)
        } else {
            self.mirror
        }
    }

    /// `k_t`, less what the surface reflects under `cos_o` from outside: one face of a body, or both of a sheet.
    pub(super) fn straight_transmission(&self, cos_o: f32) -> Spectrum {
        self.transmission.map_or(Spectrum::BLACK, |t| {
            let facet = self.fresnel.map_or(0.0, |ior| fresnel::dielectric(cos_o, ior));
            t.weight * (1.0 - if t.thin { dielectric::of_sheet(facet) } else { facet })
        })
    }

    /// `(k_d/π)(n·wi)` and `(k_s/π)(r·wo)^n` or `(k_s/π)(n·h)^n`, zero when `n·wi ≤ 0`.
    pub fn evaluate_cos(&self, n: Vec3, wo: Vec3, wi: Vec3) -> Lobes {
        if n.dot(wi) <= 0.0 {
            return Lobes::BLACK;
        }
        let specular = if self.specular.is_black() {
            Spectrum::BLACK
        } else {
            let lobe = match self.lobe {
                PhongLobe::Phong => phong_lobe(n, wo, wi, self.exponent),
                PhongLobe::BlinnPhong => blinn_lobe(n, wo, wi, self.exponent),
            };
            self.specular * (lobe * FRAC_1_PI)
        };
        Lobes { diffuse: lambert::f_cos(self.diffuse, n, wi), specular }
    }
}

/// −ln of the smallest number of f32 that is held to its full precision, about.
const NOTHING: f32 = 87.0;

/// `((r·wo)⁺)^exponent`, `r` the mirror image of `wi` about `n`. [Phong75]
pub fn phong_lobe(n: Vec3, wo: Vec3, wi: Vec3, exponent: f32) -> f32 {
    power(mirror::reflect(wi, n).dot(wo), exponent)
}

/// `((n·h)⁺)^exponent`, `h` halfway between `wo` and `wi`. [Blinn77]
pub fn blinn_lobe(n: Vec3, wo: Vec3, wi: Vec3, exponent: f32) -> f32 {
    power(n.dot((wo + wi).normalize_or_zero()), exponent)
}

/// The Phong lobe as a reflection function that keeps the laws: `f = k_s (n + 2)/(2π) ((r·wo)⁺)^n`, reciprocal, with albedo
/// `k_s` at normal incidence and less elsewhere. [Lafortune94]
pub fn lafortune(k_s: Spectrum, n: Vec3, wo: Vec3, wi: Vec3, exponent: f32) -> Spectrum {
    if n.dot(wi) <= 0.0 || n.dot(wo) <= 0.0 {
        return Spectrum::BLACK;
    }
    k_s * (normalisation(PhongLobe::Phong, exponent) * phong_lobe(n, wo, wi, exponent))
}

/// What a lobe is multiplied by so that it reflects all light of normal incidence, and less of other: `(n + 2)/(2π)` about the mirror direction
/// [Lafortune94], `(n + 2)(n + 4)/(8π (2^(−n/2) + n))` about the halfway vector.
pub fn normalisation(lobe: PhongLobe, exponent: f32) -> f32 {
    match lobe {
        PhongLobe::Phong => (exponent + 2.0) / (2.0 * PI),
        PhongLobe::BlinnPhong => {
            let below = 8.0 * PI * (function::pow(2.0, -0.5 * exponent) + exponent);
            (exponent + 2.0) * (exponent + 4.0) / below
        }
    }
}

/// `x^exponent`, zero for `x ≤ 0` even when the exponent is zero.
fn power(x: f32, exponent: f32) -> f32 {
    // x^n ≤ exp(−n (1 − x)): far from the highlight there is nothing that f32 could hold.
    if x <= 0.0 || exponent * (1.0 - x) > NOTHING {
        return 0.0;
    }
    // Rounding may carry a cosine a little past one, which an exponent in the thousands would show.
    function::pow(x.min(1.0), exponent)
}
