//! Parallel light.

use super::Incident;
use super::point::irradiance_factor;
use crate::math::{DVec3, Vec3};
use crate::scene::{Light, PhotometricUnit};
use crate::spectrum::Spectrum;

/// A distant light: `E_⊥ = π I` (classic) or `E₀` (lux, W/m²), the same everywhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distant {
    /// Unit, towards the light.
    pub to_light: Vec3,
    /// `I_a`.
    pub ambient: Spectrum,
    /// `E_⊥` for diffuse lobes.
    pub diffuse: Spectrum,
    /// `E_⊥` for specular lobes.
    pub specular: Spectrum,
}

impl Distant {
    pub(super) fn new(light: &Light, to_light: DVec3, unit: PhotometricUnit) -> Self {
        let factor = irradiance_factor(unit);
        Self {
            to_light: to_light.as_vec3(),
            ambient: light.ambient,
            diffuse: light.diffuse * factor,
            specular: light.specular * factor,
        }
    }

    /// What arrives anywhere.
    pub fn incident(&self) -> Incident {
        Incident {
            target: None,
            wi: self.to_light,
            distance: f32::INFINITY,
            diffuse: self.diffuse,
            specular: self.specular,
            casts_shadow: true,
        }
    }
}
