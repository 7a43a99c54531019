//! A point light with a cone.

use super::Incident;
use super::point::Point;
use crate::math::{DVec3, Vec3, function};
use crate::scene::Cone;

/// The cone with its constants folded. Angles are compared through `q = 1 − cos θ = |s − s′|²/2`, which keeps the precision that
/// cosines of narrow cones lose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Profile {
    /// `((s·s′)⁺)^exponent` inside the cutoff.
    Classic {
        /// `k`.
        exponent: f32,
        /// `1 − cos cutoff`.
        q_cutoff: f32,
    },
    /// `clamp((cos θ − cos outer)/max(0.001, cos inner − cos outer), 0, 1)²` [KhrLights].
    Gltf {
        /// `1 − cos outer`.
        q_outer: f32,
        /// `1/max(0.001, cos inner − cos outer)`.
        scale: f32,
    },
}

impl Profile {
    /// From the scene's angles.
    pub fn new(cone: Cone) -> Self {
        // 1 − cos x = 2 sin²(x/2).
        let q = |angle: f64| {
            let s = function::sin_f64(0.5 * angle);
            2.0 * s * s
        };
        match cone {
            Cone::Classic { exponent, cutoff } => Self::Classic { exponent: exponent as f32, q_cutoff: q(cutoff) as f32 },
            Cone::Gltf { inner, outer } => {
                Self::Gltf { q_outer: q(outer) as f32, scale: (1.0 / (q(outer) - q(inner)).max(0.001)) as f32 }
            }
        }
    }

    /// Cosine of the angle from the axis beyond which it is dark.
    pub fn cos_cutoff(self) -> f32 {
        let (Self::Classic { q_cutoff: q, .. } | Self::Gltf { q_outer: q, .. }) = self;
        1.0 - q
    }

    /// The factor towards the unit direction `to_point`, away from a light of unit `axis`.
    pub fn at(self, axis: Vec3, to_point: Vec3) -> f32 {
        let q = 0.5 * (axis - to_point).length_squared();
        match self {
            Self::Classic { exponent, q_cutoff } => {
                // Without an exponent the cone is uniform, beyond the right angle too.
                if q > q_cutoff { 0.0 } else { function::pow((1.0 - q).max(0.0), exponent) }
            }
            Self::Gltf { q_outer, scale } => {
                let a = ((q_outer - q) * scale).clamp(0.0, 1.0);
                a * a
            }
        }
    }
}

/// A spot light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// Without the cone.
    pub point: Point,
    /// Unit, the direction it shines in.
    pub axis: Vec3,
    /// With the angle from the axis.
    pub profile: Profile,
}

impl Spot {
    pub(super) fn new(point: Point, axis: DVec3, cone: Cone) -> Self {
        Self { point, axis: axis.as_vec3(), profile: Profile::new(cone) }
    }

    /// What arrives at `p`; nothing outside the cone.
    pub fn incident(&self, p: Vec3) -> Option<Incident> {
        let incident = self.point.incident(p)?;
        let factor = self.profile.at(self.axis, -incident.wi);
        (factor > 0.0).then(|| Incident { diffuse: incident.diffuse * factor, specular: incident.specular * factor, ..incident })
    }
}
