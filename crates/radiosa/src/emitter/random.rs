//! Random points on emissive surfaces, for soft shadows without the steps that fixed points leave. Source: [Cook84].
//!
//! A surface is chosen by about what it gives at the place (`tree.rs`), a point on it by solid angle or area (`seen.rs`):
//! `E ≈ (1/n) Σ L_e cosθ / (P p_ω)`, `P` the probability of the surface and `p_ω` the density over directions there.

use super::Incident;
use super::area::EmissiveSurface;
use super::tree::{self, Tree};
use crate::math::Vec3;
use crate::sampling::sequence;

/// Draws points on emissive surfaces.
#[derive(Clone, Debug)]
pub struct PointSampler(Tree);

impl PointSampler {
    /// Of all surfaces that give light.
    pub fn new(surfaces: &[EmissiveSurface]) -> Self {
        Self(Tree::new(surfaces))
    }

    /// As a place with normal `n` sees them.
    pub fn seen_from(&self, p: Vec3, n: Vec3) -> Place<'_> {
        Place { tree: self.0.seen_from(p, n), p }
    }
}

/// Emissive surfaces as a place sees them.
pub struct Place<'a> {
    tree: tree::Place<'a>,
    p: Vec3,
}

impl Place<'_> {
    /// What point `i` of the set that `key` names brings, as one of `n_points`: the sum of so many is the light of all surfaces.
    pub fn incident(&self, i: u32, n_points: u32, key: u64) -> Option<Incident> {
        let [u, choice] = sequence::point_4d(i, key);
        let (seen, probability) = self.tree.choose(f64::from(choice.x))?;
        seen.incident(self.p, u, probability * n_points as f32)
    }
}
