//! A rough mirror of microfacets: `f = D G F/(4 (n·l)(n·v))`, and the two older ways of writing it.
//!
//! | form     | `f`                                    | remark                                                     |
//! |----------|----------------------------------------|------------------------------------------------------------|
//! | modern   | `k_s D G F/(4 n·l n·v)`                | reflects no more than it receives                          |
//! | 1982     | `k_s D₀ G F/(π n·l n·v)`, `D₀ = π D`   | four times the modern form: the distribution of [Cook82] is not normalised |
//! | lecture  | the 1982 form times `n·l`              | not reciprocal                                             |
//!
//! A dielectric may let through what its facets do not reflect ([`rough_dielectric`](super::rough_dielectric)): rough glass.

use std::f32::consts::FRAC_1_PI;

use super::microfacet::{self, Angles, MIN_ALPHA};
use super::multiple_scattering::Compensation;
use super::rough_dielectric::Boundary;
use super::{Lobes, Lookup, SpecularRays, Transmission, dielectric, fresnel, lambert, phong};
use crate::math::Vec3;
use crate::scene::{self, Distribution, Form, Fresnel, Shadowing};
use crate::spectrum::Spectrum;

/// Coefficients at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CookTorrance {
    /// `k_a`.
    pub ambient: Spectrum,
    /// `k_d`.
    pub diffuse: Spectrum,
    /// `k_s`.
    pub specular: Spectrum,
    /// `α`, at least [`MIN_ALPHA`].
    pub alpha: f32,
    /// `D`.
    pub distribution: Distribution,
    /// `G`.
    pub shadowing: Shadowing,
    /// `F`, of a dielectric by its index on the far side over that on the viewer's.
    pub fresnel: Fresnel,
    /// Normalisation.
    pub form: Form,
    /// What lies behind a dielectric that lets light through; its index is that seen from outside.
    pub transmission: Option<Transmission>,
    /// What is reflected more than once, where that is asked for.
    pub compensation: Option<Compensation>,
}

impl CookTorrance {
    pub(super) fn resolve(m: &scene::CookTorrance, lookup: &impl Lookup) -> Self {
        let vertex = lookup.vertex_color();
        let diffuse = lookup.color(&m.diffuse) * vertex;
        Self {
            ambient: m.ambient.as_ref().map_or(diffuse, |map| lookup.color(map) * vertex),
            diffuse,
            specular: lookup.color(&m.specular),
            alpha: lookup.scalar(&m.alpha).max(MIN_ALPHA),
            distribution: m.distribution,
            shadowing: m.shadowing,
            fresnel: m.fresnel,
            form: m.form,
            transmission: m.refraction().map(|(ior, behind)| Transmission {
                weight: behind.weight,
                ior,
                thin: behind.thin,
                absorption: behind.absorption,
                priority: behind.priority,
            }),
            compensation: None,
        }
    }

    /// Gives back what facets reflect more than once, in the modern form.
    pub(super) fn compensate(&mut self) {
        if self.form == Form::Modern && !self.specular.is_black() {
            let mean = fresnel::mean(|cos| self.facet(cos));
            self.compensation = Compensation::new(self.distribution, self.shadowing, self.alpha, mean);
        }
    }

    /// Reflectance of a facet under `cos_h = v·h`: of one face, or of both of a sheet.
    pub(super) fn facet(&self, cos_h: f32) -> Spectrum {
        let reflected = fresnel::facet(&self.fresnel, cos_h);
        if self.is_sheet() { reflected.map(dielectric::of_sheet) } else { reflected }
    }

    fn is_sheet(&self) -> bool {
        self.transmission.is_some_and(|t| t.thin)
    }

    /// What a facet lets through under `cos_h`.
    pub(super) fn passing(&self, cos_h: f32) -> Spectrum {
        self.facet_and_passing(cos_h)[1]
    }

    /// What a facet reflects under `cos_h`, and what it lets through.
    pub(super) fn facet_and_passing(&self, cos_h: f32) -> [Spectrum; 2] {
        let facet = self.facet(cos_h);
        let passing = self.transmission.map_or(Spectrum::BLACK, |t| t.weight * (Spectrum::WHITE - facet));
        [self.specular * facet, passing]
    }

    /// The boundary where it refracts.
    pub(super) fn boundary(&self) -> Option<Boundary> {
        let t = self.transmission?;
        let Fresnel::Dielectric { ior } = self.fresnel else { return None };
        Boundary::new(self.distribution, self.shadowing, self.alpha, (!t.thin).then_some(ior))
    }

    /// Puts a medium of index `surroundings` where vacuum was outside.
    pub(super) fn surround(&mut self, surroundings: f32) {
        if let (Some(t), Fresnel::Dielectric { ior }) = (&mut self.transmission, &mut self.fresnel) {
            *ior /= surroundings;
            t.ior /= surroundings;
        }
    }

    /// As rays inside its body meet it.
    pub(super) fn met_from_inside(mut self) -> Self {
        if let (Some(Transmission { thin: false, .. }), Fresnel::Dielectric { ior }) = (self.transmission, &mut self.fresnel) {
            *ior = 1.0 / *ior;
        }
        self
    }

    /// The same glass without roughness.
    pub(super) fn smooth(&self) -> Option<phong::Phong> {
        let t = self.transmission?;
        let (ambient, diffuse, mirror) = (self.ambient, self.diffuse, self.specular);
        Some(phong::Phong { ambient, diffuse, mirror, transmission: Some(t), fresnel: Some(t.ior), ..phong::Phong::default() })
    }

    /// As rays inside its body meet it where nothing is rough.
    pub(super) fn smooth_from_inside(&self) -> Option<phong::Phong> {
        self.smooth().filter(|_| !self.is_sheet())
    }

    /// The ray that is refracted as if by a smooth surface; what is reflected is the highlight.
    pub(super) fn specular_rays(&self, n: Vec3, wo: Vec3, entering: bool) -> SpecularRays {
        self.transmission.map_or(SpecularRays::default(), |t| {
            dielectric::specular_rays(Spectrum::BLACK, Some(t.ior), self.transmission, n, wo, entering)
        })
    }

    /// `(k_d/π)(n·wi)` and the highlight times `n·wi`; the highlight is zero when the viewer is behind `n`.
    pub fn evaluate_cos(&self, n: Vec3, wo: Vec3, wi: Vec3) -> Lobes {
        let behind = || Lobes { diffuse: lambert::f_cos(self.diffuse, n, wi), specular: Spectrum::BLACK };
        Angles::new(n, wo, wi).map_or_else(behind, |angles| self.evaluate_at(&angles))
    }

    /// The same of light and viewer in front.
    pub(super) fn evaluate_at(&self, angles: &Angles) -> Lobes {
        let again = self.compensation.map_or(Spectrum::BLACK, |c| self.specular * c.f_cos(angles.n_v, angles.n_l));
        Lobes { diffuse: self.diffuse * (FRAC_1_PI * angles.n_l), specular: self.specular_f(angles) * angles.n_l + again }
    }

    /// The highlight's reflection function, 1/sr.
    pub fn specular_f(&self, angles: &Angles) -> Spectrum {
        let d = microfacet::d(self.distribution, self.alpha, angles);
        let g = microfacet::g_over_cosines(self.shadowing, self.distribution, self.alpha, angles);
        let f = self.facet(angles.v_h);
        let form = match self.form {
            Form::Modern => 0.25,
            Form::Paper1982 => 1.0, // D₀/π = D
            Form::Lecture => angles.n_l,
        };
        self.specular * f * (d * g * form)
    }
}
