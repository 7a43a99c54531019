//! Where a medium scatters light to: the phase function of [Henyey41], what a reflection function is to a surface.
//!
//! ```text
//! p(cos θ) = (1 − g²) / (4π (1 + g² − 2g cos θ)^(3/2))      1/sr,   ∫ p dω = 1,   ∫ p cos θ dω = g
//! ```
//!
//! θ is the angle by which light is turned. Directions point away from the place as everywhere in this module, `wo` to the viewer and `wi` to the light, so that
//! `cos θ = −wo·wi`. It is the same both ways.

use std::f32::consts::{FRAC_1_PI, TAU};

use crate::math::{Frame, Vec2, Vec3, function};

/// Henyey and Greenstein's phase function.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Phase {
    /// g, in (−1, 1).
    pub asymmetry: f32,
}

impl Phase {
    /// `p`, 1/sr: also the density with which [`Self::sample`] draws `wi`.
    pub fn evaluate(self, wo: Vec3, wi: Vec3) -> f32 {
        let g = self.asymmetry;
        // 1 + g² − 2g cos θ without cancellation where it is small: θ near 0 for g > 0, near π for g < 0.
        let towards = if g < 0.0 { wi } else { -wi };
        let one_minus_cos = 0.5 * (wo - towards).length_squared();
        let root = 1.0 - g.abs();
        let d = root * root + 2.0 * g.abs() * one_minus_cos;
        0.25 * FRAC_1_PI * (1.0 - g * g) / (d * d.sqrt())
    }

    /// Draws `wi`.
    pub fn sample(self, wo: Vec3, u: Vec2) -> Vec3 {
        let g = self.asymmetry;
        // The inverse of the distribution function, (1 + g² − ((1 − g²)/(1 + g ζ))²)/(2g), multiplied out so that nothing is divided by g.
        let zeta = 1.0 - 2.0 * u.x;
        let z2 = zeta * zeta;
        let numerator = zeta + 0.5 * g * (3.0 + z2) + g * g * zeta + 0.5 * g * g * g * (z2 - 1.0);
        let below = 1.0 + g * zeta;
        let cos = (numerator / (below * below)).clamp(-1.0, 1.0);
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        let phi = TAU * u.y;
        Frame::from_normal(-wo).to_world(Vec3::new(sin * function::cos(phi), sin * function::sin(phi), cos))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_as_written_and_isotropic_without_asymmetry() {
        let wo = Vec3::new(0.36, 0.48, 0.8);
        for g in [-0.99f64, -0.5, 0.0, 0.3, 0.9, 0.99] {
            for wi in [Vec3::X, Vec3::Y, Vec3::new(-0.6, 0.0, 0.8), Vec3::new(0.48, -0.6, 0.64)] {
                let cos = -f64::from(wo.dot(wi));
                let truth = (1.0 - g * g) / (4.0 * std::f64::consts::PI * (1.0 + g * g - 2.0 * g * cos).powf(1.5));
                let p = f64::from(Phase { asymmetry: g as f32 }.evaluate(wo, wi));
                assert!((p / truth - 1.0).abs() < 1e-5, "{g}: {p} for {truth}");
            }
        }
    }
}
