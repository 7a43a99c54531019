//! Light from one point in all directions.

use std::f64::consts::PI;

use super::Incident;
use crate::math::{DVec3, Vec3};
use crate::scene::{Attenuation, Light, PhotometricUnit};
use crate::spectrum::Spectrum;

/// How irradiance falls off with the distance `d`, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Falloff {
    /// `min(1/(c1 + c2 d + c3 d²), 1)`.
    Classic {
        /// Constant.
        c1: f32,
        /// Linear.
        c2: f32,
        /// Quadratic.
        c3: f32,
        /// `1/range`, zero for none: the same smooth end as below.
        inverse_range: f32,
    },
    /// `1/d²`, smoothly ended by glTF's `range`: `clamp(1 − (d/range)⁴, 0, 1)/d²` [KhrLights].
    InverseSquare {
        /// `1/range`, zero for none.
        inverse_range: f32,
    },
}

impl Falloff {
    /// The factor at distance `d > 0`.
    pub fn at(self, d: f32) -> f32 {
        match self {
            Self::Classic { c1, c2, c3, inverse_range } => {
                let denominator = c1 + d * (c2 + d * c3);
                // Also catches a denominator of zero or less, where the formula has no bound but the minimum.
                smooth_end(d * inverse_range) * if denominator > 1.0 { 1.0 / denominator } else { 1.0 }
            }
            Self::InverseSquare { inverse_range } => smooth_end(d * inverse_range) / (d * d),
        }
    }
}

/// `clamp(1 − x⁴, 0, 1)`: one at the light, nothing from the range on [KhrLights].
fn smooth_end(x: f32) -> f32 {
    let x2 = x * x;
    (1.0 - x2 * x2).clamp(0.0, 1.0)
}

/// A point light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// World coordinates.
    pub position: Vec3,
    /// `I_a`.
    pub ambient: Spectrum,
    /// `E_⊥` before falloff, for diffuse lobes: `π I_d` (classic) or `c` (physical).
    pub diffuse: Spectrum,
    /// The same for specular lobes.
    pub specular: Spectrum,
    /// With distance.
    pub falloff: Falloff,
}

impl Point {
    pub(super) fn new(light: &Light, position: DVec3, unit: PhotometricUnit, a: Attenuation, range: f64) -> Self {
        let falloff = match unit {
            PhotometricUnit::Classic => {
                Falloff::Classic { c1: a.c1 as f32, c2: a.c2 as f32, c3: a.c3 as f32, inverse_range: (1.0 / range) as f32 }
            }
            PhotometricUnit::Physical => Falloff::InverseSquare { inverse_range: (1.0 / range) as f32 },
        };
        let factor = irradiance_factor(unit);
        Self {
            position: position.as_vec3(),
            ambient: light.ambient,
            diffuse: light.diffuse * factor,
            specular: light.specular * factor,
            falloff,
        }
    }

    /// What arrives at `p`; nothing at the light itself, where the direction is undefined, and beyond its range.
    pub fn incident(&self, p: Vec3) -> Option<Incident> {
        let to_light = self.position - p;
        let distance = to_light.length();
        if distance.is_nan() || distance <= 0.0 {
            return None;
        }
        let falloff = self.falloff.at(distance);
        // A light within 1e-19 m of the point would overflow; nothing real is that near.
        (falloff > 0.0 && falloff.is_finite()).then(|| Incident {
            target: Some(self.position),
            wi: to_light / distance,
            distance,
            diffuse: self.diffuse * falloff,
            specular: self.specular * falloff,
            casts_shadow: true,
        })
    }
}

/// From a light's number to irradiance at normal incidence: `π` for classic intensities (the value white shows), one for physical
/// quantities.
pub(super) fn irradiance_factor(unit: PhotometricUnit) -> f32 {
    match unit {
        PhotometricUnit::Classic => PI as f32,
        PhotometricUnit::Physical => 1.0,
    }
}
