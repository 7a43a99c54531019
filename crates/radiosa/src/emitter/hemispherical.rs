//! Sky above, ground below, nothing else: the hemispherical light.

use std::f32::consts::PI;

use crate::math::{DVec3, Vec3};
use crate::scene::Light;
use crate::spectrum::Spectrum;

/// Two radiances on either side of a horizon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hemispherical {
    /// Unit, up.
    pub axis: Vec3,
    /// `I_a`.
    pub ambient: Spectrum,
    /// `L_up`.
    pub up: Spectrum,
    /// `L_down`.
    pub down: Spectrum,
}

impl Hemispherical {
    pub(super) fn new(light: &Light, axis: DVec3, down: Spectrum) -> Self {
        Self { axis: axis.as_vec3(), ambient: light.ambient, up: light.diffuse, down }
    }

    /// `π [L_up (1 + n·a)/2 + L_down (1 − n·a)/2]`, the exact integral of the two half spheres.
    pub fn irradiance(&self, n: Vec3) -> Spectrum {
        let t = 0.5 * (1.0 + n.dot(self.axis).clamp(-1.0, 1.0));
        (self.up * t + self.down * (1.0 - t)) * PI
    }
}
