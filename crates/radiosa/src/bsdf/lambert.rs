//! Perfectly diffuse reflection: `f = ρ/π`, the same in every direction [Lambert60].
//!
//! Under a classic light of intensity `I`, whose irradiance at normal incidence is `π I`, it shows `ρ I (n·l)`: the diffuse
//! term of every local model.

use std::f32::consts::FRAC_1_PI;

use crate::math::Vec3;
use crate::spectrum::Spectrum;

/// `ρ/π`, 1/sr.
pub fn f(rho: Spectrum) -> Spectrum {
    rho * FRAC_1_PI
}

/// `(ρ/π)(n·wi)⁺`, 1/sr.
pub fn f_cos(rho: Spectrum, n: Vec3, wi: Vec3) -> Spectrum {
    f(rho) * n.dot(wi).max(0.0)
}
