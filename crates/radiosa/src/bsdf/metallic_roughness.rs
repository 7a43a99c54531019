//! glTF's metallic–roughness material with `KHR_materials_ior`, `_specular` and `_transmission` [GLTF20].
//!
//! A mix of a metal, `F = base + (1 − base)(1 − v·h)⁵`, and a dielectric: a diffuse base under a coat of
//! `F = F₀ + (1 − F₀)(1 − v·h)⁵`, `F₀ = min(((ior − 1)/(ior + 1))² specular colour, 1)`, that takes `w max(F)` from what reaches the
//! base, `w` the specular strength. Both highlights are GGX with correlated Smith shadowing and `α = roughness²`.
//!
//! The specification's way of layering is reciprocal but reflects more than it receives where a smooth coat meets a bright
//! base at grazing angles; it is kept, so that materials look as their makers saw them.
//!
//! The part `transmission` of the base lets light through instead of reflecting it diffusely: rough where paths are drawn by chance
//! ([`rough_dielectric`](super::rough_dielectric)), elsewhere refracted, and inside a body reflected, as if by a smooth surface.
//!
//! From inside a body the coat reflects what it does from outside under the angle that Snell's law gives, and all beyond the critical angle, so that light finds its
//! way back as it came.

use std::f32::consts::FRAC_1_PI;

use super::microfacet::{self, Angles, MIN_ALPHA};
use super::multiple_scattering::Compensation;
use super::rough_dielectric::Boundary;
use super::{Lobes, Lookup, SpecularRays, Transmission, dielectric, fresnel, lambert, mirror};
use crate::math::Vec3;
use crate::scene::{self, Distribution, Shadowing};
use crate::spectrum::Spectrum;

/// The α from which on the reflections of a dielectric's coat are left to its highlight: glTF roughness 0.32.
pub const BROAD_COAT: f32 = 0.1;

/// Coefficients at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MetallicRoughness {
    /// Base colour.
    pub base_color: Spectrum,
    /// 0 dielectric … 1 metal.
    pub metallic: f32,
    /// `α = roughness²`, not limited from below: see [`Self::is_smooth`].
    pub alpha: f32,
    /// Index of refraction.
    pub ior: f32,
    /// Specular strength `w`.
    pub specular: f32,
    /// `F₀` of the dielectric.
    pub f0: Spectrum,
    /// Part of the base that transmits.
    pub transmission: f32,
    /// What is left of ambient light.
    pub occlusion: f32,
    /// Absorption inside, 1/m.
    pub absorption: Spectrum,
    /// Has an inside; otherwise it is a sheet.
    pub thick: bool,
    /// The viewer is inside.
    pub inside: bool,
    /// What is reflected more than once, where that is asked for.
    pub compensation: Option<Compensation>,
}

impl MetallicRoughness {
    pub(super) fn resolve(m: &scene::MetallicRoughness, lookup: &impl Lookup) -> Self {
        let unit = |map| lookup.scalar(map).clamp(0.0, 1.0);
        let roughness = unit(&m.roughness);
        Self {
            base_color: lookup.color(&m.base_color) * lookup.vertex_color(),
            metallic: unit(&m.metallic),
            alpha: roughness * roughness,
            ior: m.ior,
            specular: unit(&m.specular),
            f0: (lookup.color(&m.specular_color) * fresnel::f0_of_ior(m.ior)).map(|f0| f0.min(1.0)),
            transmission: unit(&m.transmission),
            // glTF: 1 + strength (occlusion − 1).
            occlusion: m.occlusion.as_ref().map_or(1.0, |(map, strength)| 1.0 + strength * (unit(map) - 1.0)),
            absorption: m.absorption,
            thick: m.thick,
            inside: false,
            compensation: None,
        }
    }

    /// Gives back what facets reflect more than once.
    pub(super) fn compensate(&mut self) {
        if !self.is_smooth() {
            let mean = fresnel::mean(|cos| self.facet(cos));
            self.compensation = Compensation::new(Distribution::Ggx, Shadowing::SmithCorrelated, self.alpha, mean);
        }
    }

    /// True when it is a perfect mirror rather than a lobe ([`MIN_ALPHA`]): delta lights leave no highlight on it, and
    /// [`Self::specular_rays`] reflects.
    pub fn is_smooth(&self) -> bool {
        self.alpha < MIN_ALPHA
    }

    /// Light passes into a body behind it.
    fn has_inside(&self) -> bool {
        self.thick && self.transmission().is_some()
    }

    /// As rays inside its body meet it where nothing is rough: without highlight or rough lobe ([`Self::specular_rays`]).
    pub(super) fn smooth_from_inside(self) -> Self {
        if self.has_inside() { Self { alpha: 0.0, ..self } } else { self }
    }

    /// As rays inside its body meet it.
    pub(super) fn met_from_inside(self) -> Self {
        Self { inside: self.has_inside(), ..self }
    }

    /// The boundary where it refracts roughly.
    pub(super) fn boundary(&self) -> Option<Boundary> {
        self.transmission().filter(|_| !self.is_smooth())?;
        let eta = if self.inside { 1.0 / self.ior } else { self.ior };
        Boundary::new(Distribution::Ggx, Shadowing::SmithCorrelated, self.alpha, self.thick.then_some(eta))
    }

    /// The base colour as ambient light shows it, metals included, under the occlusion map.
    pub fn ambient(&self) -> Spectrum {
        self.base_color * ((1.0 - (1.0 - self.metallic) * self.transmission) * self.occlusion)
    }

    /// Reflectance of the diffuse base as a coat at normal incidence leaves it.
    pub fn diffuse_reflectance(&self) -> Spectrum {
        self.base_color * (self.base_weight() * (1.0 - self.specular * self.f0.max_channel()))
    }

    /// How far the highlight at normal incidence is the metal's, and so has the base colour: `m base / ((1 − m) w F₀ + m base)`, 0 where there is none.
    pub fn share_of_metal(&self) -> Spectrum {
        let (metal, coat) = (self.base_color * self.metallic, self.f0 * ((1.0 - self.metallic) * self.specular));
        let share = |metal: f32, coat: f32| if metal > 0.0 { metal / (metal + coat) } else { 0.0 };
        Spectrum::new(share(metal.r, coat.r), share(metal.g, coat.g), share(metal.b, coat.b))
    }

    /// The part that reflects diffusely, before the coat.
    fn base_weight(&self) -> f32 {
        (1.0 - self.metallic) * (1.0 - self.transmission)
    }

    /// The coat's and the metal's reflectance together under `cos_h = v·h`.
    pub(super) fn facet(&self, cos_h: f32) -> Spectrum {
        let coat = if self.inside || (self.ior < 1.0 && self.transmission > 0.0) {
            self.coat(cos_h) * (1.0 - self.metallic)
        } else {
            fresnel::schlick(cos_h, self.f0) * ((1.0 - self.metallic) * self.specular)
        };
        coat + fresnel::schlick(cos_h, self.base_color) * self.metallic
    }

    /// What a facet lets through under `cos_h`.
    pub(super) fn passing(&self, cos_h: f32) -> Spectrum {
        self.transmission().map_or(Spectrum::BLACK, |t| t.weight * (1.0 - self.coat(cos_h).max_channel()))
    }

    /// Both lobes times `n·wi`.
    pub fn evaluate_cos(&self, n: Vec3, wo: Vec3, wi: Vec3) -> Lobes {
        // The viewer is behind a shading normal: the base is still lit.
        let behind = || Lobes { diffuse: lambert::f_cos(self.diffuse_reflectance(), n, wi), specular: Spectrum::BLACK };
        Angles::new(n, wo, wi).map_or_else(behind, |angles| self.evaluate_at(&angles))
    }

    /// The same of light and viewer in front.
    pub(super) fn evaluate_at(&self, angles: &Angles) -> Lobes {
        let coat = fresnel::schlick(angles.v_h, self.f0).max_channel() * self.specular;
        let diffuse = self.base_color * (self.base_weight() * (1.0 - coat) * FRAC_1_PI * angles.n_l);
        let specular = if self.is_smooth() {
            Spectrum::BLACK
        } else {
            let d = microfacet::d(Distribution::Ggx, self.alpha, angles);
            let g = microfacet::g_over_cosines(Shadowing::SmithCorrelated, Distribution::Ggx, self.alpha, angles);
            let again = self.compensation.map_or(Spectrum::BLACK, |c| c.f_cos(angles.n_v, angles.n_l));
            self.facet(angles.v_h) * (0.25 * d * g * angles.n_l) + again
        };
        Lobes { diffuse, specular }
    }

    /// Mirror reflectance at normal incidence when smooth, black when rough.
    pub fn mirror(&self) -> Spectrum {
        if self.is_smooth() { self.facet(1.0) } else { Spectrum::BLACK }
    }

    /// The transmitting part of the base.
    pub fn transmission(&self) -> Option<Transmission> {
        let weight = self.base_color * ((1.0 - self.metallic) * self.transmission);
        (!weight.is_black()).then_some(Transmission {
            weight,
            ior: self.ior,
            thin: !self.thick,
            absorption: self.absorption,
            priority: 0,
        })
    }

    /// What the coat reflects under `cos` on the viewer's side. Into something thinner there is a critical angle from outside, too, which Schlick's approximation
    /// does not know.
    fn coat(&self, cos: f32) -> Spectrum {
        let outside = if self.inside {
            let sin2 = self.ior * self.ior * ((1.0 - cos) * (1.0 + cos)).max(0.0);
            if sin2 >= 1.0 {
                return Spectrum::WHITE;
            }
            (1.0 - sin2).sqrt()
        } else {
            cos
        };
        if self.ior < 1.0 {
            Spectrum::gray(fresnel::dielectric(outside, self.ior))
        } else {
            fresnel::schlick(outside, self.f0) * self.specular
        }
    }

    /// The rays of a smooth coat or metal, and through the transmitting part, also where it is rough: the reflected one only from inside a body then.
    pub fn specular_rays(&self, n: Vec3, wo: Vec3, entering: bool) -> SpecularRays {
        let cos_o = n.dot(wo).clamp(0.0, 1.0);
        let from_inside = !entering && self.has_inside();
        let here = Self { inside: from_inside, ..*self };
        let mut rays = SpecularRays::default();
        if self.is_smooth() || from_inside {
            let weight = here.coat(cos_o) * (1.0 - self.metallic) + fresnel::schlick(cos_o, self.base_color) * self.metallic;
            rays.reflected = Some((mirror::reflect(wo, n), weight)).filter(|ray| !ray.1.is_black());
        }
        if let Some(t) = self.transmission() {
            let eta = if entering { 1.0 / t.ior } else { t.ior };
            let direction = if t.thin { Some(-wo) } else { dielectric::refract(wo, n, eta) };
            rays.refracted = direction.map(|d| (d, here.passing(cos_o)));
        }
        rays
    }

    /// Puts a medium of index `surroundings` where vacuum was outside.
    pub(super) fn surround(&mut self, surroundings: f32) {
        let (alone, relative) = (fresnel::f0_of_ior(self.ior), fresnel::f0_of_ior(self.ior / surroundings));
        self.ior /= surroundings;
        self.f0 = if alone > 0.0 { self.f0 * (relative / alone) } else { Spectrum::gray(relative) }.map(|f0| f0.min(1.0));
    }
}
