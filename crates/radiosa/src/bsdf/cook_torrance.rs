//! A rough mirror of microfacets: `f = D G F/(4 (n·l)(n·v))`, and the two older ways of writing it.
//!
//! | form     | `f`                                    | remark                                                     |
//! |----------|----------------------------------------|------------------------------------------------------------|
//! | modern   | `k_s D G F/(4 n·l n·v)`                | reflects no more than it receives                          |
//! | 1982     | `k_s D₀ G F/(π n·l n·v)`, `D₀ = π D`   | four times the modern form: the distribution of [Cook82] is not normalised |
//! | lecture  | the 1982 form times `n·l`              | not reciprocal                                             |

use super::microfacet::{self, Angles, MIN_ALPHA};
use super::{Lobes, Lookup, fresnel, lambert};
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
    /// `F`.
    pub fresnel: Fresnel,
    /// Normalisation.
    pub form: Form,
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
        }
    }

    /// `(k_d/π)(n·wi)` and the highlight times `n·wi`; the highlight is zero when the viewer is behind `n`.
    pub fn evaluate_cos(&self, n: Vec3, wo: Vec3, wi: Vec3) -> Lobes {
        let diffuse = lambert::f_cos(self.diffuse, n, wi);
        let specular = Angles::new(n, wo, wi).map_or(Spectrum::BLACK, |angles| self.specular_f(&angles) * angles.n_l);
        Lobes { diffuse, specular }
    }

    /// The highlight's reflection function, 1/sr.
    pub fn specular_f(&self, angles: &Angles) -> Spectrum {
        let d = microfacet::d(self.distribution, self.alpha, angles);
        let g = microfacet::g_over_cosines(self.shadowing, self.distribution, self.alpha, angles);
        let f = fresnel::facet(&self.fresnel, angles.v_h);
        let form = match self.form {
            Form::Modern => 0.25,
            Form::Paper1982 => 1.0, // D₀/π = D
            Form::Lecture => angles.n_l,
        };
        self.specular * f * (d * g * form)
    }
}
