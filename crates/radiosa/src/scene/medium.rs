//! What fills space between surfaces.

use super::{Material, Model};
use crate::spectrum::Spectrum;

/// A homogeneous participating medium: the same everywhere it is. Along a ray through it
///
/// ```text
/// dL/dt = −(σ_a + σ_s) L + σ_s ∫ p(ω, ω′) L(ω′) dω′ + ε
/// ```
///
/// with Henyey and Greenstein's phase function `p` (`bsdf::phase`).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Medium {
    /// σ_a, 1/m: absorbed.
    pub absorption: Spectrum,
    /// What else it does.
    pub inside: Inside,
}

/// What a medium does beside absorbing: kept apart, since most methods know absorption alone.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Inside {
    /// σ_s, 1/m: scattered.
    pub scattering: Spectrum,
    /// g, the mean cosine of the angle by which light is scattered: 1 forward, 0 alike in all directions, −1 back.
    pub asymmetry: f32,
    /// ε, radiance emitted per metre, W/(m² sr m) or cd/m³.
    pub emission: Spectrum,
}

impl Medium {
    /// σ_t = σ_a + σ_s, 1/m: what takes light out of its direction.
    pub fn extinction(&self) -> Spectrum {
        self.absorption + self.inside.scattering
    }

    /// There is nothing.
    pub fn is_clear(&self) -> bool {
        self.absorption.is_black() && !self.inside.is_seen()
    }

    /// Measured in a length `scale` times as long.
    pub(super) fn rescale(&mut self, scale: f32) {
        self.absorption = self.absorption / scale;
        self.inside.rescale(scale);
    }
}

impl Inside {
    /// It scatters or emits.
    pub fn is_seen(&self) -> bool {
        !self.scattering.is_black() || !self.emission.is_black()
    }

    /// As [`Medium::rescale`].
    pub(super) fn rescale(&mut self, scale: f32) {
        self.scattering = self.scattering / scale;
        self.emission = self.emission / scale;
    }
}

impl Material {
    /// What fills a body of it, where it bounds one that light enters.
    pub fn medium(&self) -> Option<Medium> {
        if !self.transmits() || !self.has_inside() {
            return None;
        }
        let absorption = match &self.model {
            Model::Phong(m) => m.absorption,
            Model::CookTorrance(m) => m.behind.map_or(Spectrum::BLACK, |behind| behind.absorption),
            Model::MetallicRoughness(m) => m.absorption,
        };
        Some(Medium { absorption, inside: self.inside })
    }
}
