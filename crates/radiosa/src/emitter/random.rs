//! Random points on emissive surfaces, for soft shadows without the steps that fixed points leave. Source: [Cook84].
//!
//! A surface is chosen by about what it gives at the place (`tree.rs`), a point on it by solid angle or area (`seen.rs`):
//! `E ≈ (1/n) Σ L_e cosθ / (P p_ω)`, `P` the probability of the surface and `p_ω` the density over directions there.

use super::Incident;
use super::area::EmissiveSurface;
use super::tree::{self, Tree};
use crate::math::{Vec2, Vec3};
use crate::sampling::sequence;

/// Draws points on emissive surfaces.
#[derive(Clone, Debug)]
pub struct PointSampler {
    tree: Tree,
    /// Of each instance, where in `places` its first primitive stands, and how many do.
    instances: Vec<(u32, u32)>,
    /// By primitive: its surface in the tree; [`NOWHERE`] for those that give no light.
    places: Vec<u32>,
}

const NOWHERE: u32 = u32::MAX;

/// A point drawn on an emissive surface.
#[derive(Clone, Copy, Debug)]
pub struct Drawn<'a> {
    /// What it lies on.
    pub surface: &'a EmissiveSurface,
    /// World coordinates.
    pub position: Vec3,
    /// Where a shadow ray ends: just in front of it.
    pub target: Vec3,
    /// Unit, to the point.
    pub wi: Vec3,
    /// Metres.
    pub distance: f32,
    /// Probability density of the direction, 1/sr, the choice of the surface included.
    pub pdf: f32,
}

/// Where a ray from a place met an emissive surface.
#[derive(Clone, Copy, Debug)]
pub struct Met {
    /// Of the surface.
    pub instance: u32,
    /// Of the instance.
    pub primitive: u32,
    /// Unit, from the place.
    pub wi: Vec3,
    /// Metres.
    pub distance: f32,
    /// In the coordinates of an exact shape.
    pub local: Vec3,
}

impl PointSampler {
    /// Of all surfaces that give light.
    pub fn new(surfaces: &[EmissiveSurface]) -> Self {
        let tree = Tree::new(surfaces);
        let n_instances = surfaces.iter().map(|s| s.instance.index() + 1).max().unwrap_or(0);
        let mut instances = vec![(0, 0); n_instances];
        for surface in tree.surfaces() {
            let (_, count) = &mut instances[surface.instance.index()];
            *count = (*count).max(surface.primitive + 1);
        }
        let mut n = 0;
        for (first, count) in &mut instances {
            *first = n;
            n += *count;
        }
        let mut places = vec![NOWHERE; n as usize];
        for (k, surface) in tree.surfaces().iter().enumerate() {
            places[(instances[surface.instance.index()].0 + surface.primitive) as usize] = k as u32;
        }
        Self { tree, instances, places }
    }

    /// Nothing gives light.
    pub fn is_empty(&self) -> bool {
        self.tree.surfaces().is_empty()
    }

    /// As a place with normal `n` sees them; with the normal zero as a point of a medium does, which light reaches from all around.
    pub fn seen_from(&self, p: Vec3, n: Vec3) -> Place<'_> {
        Place { tree: self.tree.seen_from(p, n), p }
    }

    /// The point that `u` draws on the surface that `choice` in `[0, 1)` chooses for a place `p` with normal `n`.
    pub fn draw(&self, p: Vec3, n: Vec3, u: Vec2, choice: f32) -> Option<Drawn<'_>> {
        let (seen, probability) = self.tree.choose(p, n, f64::from(choice))?;
        let drawn = seen.draw(p, u)?;
        let pdf = probability / drawn.share;
        let (position, target, wi, distance) = (drawn.position, drawn.target, drawn.wi, drawn.distance);
        (pdf > 0.0 && pdf.is_finite()).then_some(Drawn { surface: seen.surface, position, target, wi, distance, pdf })
    }

    /// The density, 1/sr, with which [`Self::draw`] draws a direction from `p` with normal `n` that met a surface; 0 where it never does.
    pub fn pdf(&self, p: Vec3, n: Vec3, met: &Met) -> f32 {
        let Some((first, count)) = self.instances.get(met.instance as usize) else { return 0.0 };
        if met.primitive >= *count {
            return 0.0;
        }
        let k = self.places[(first + met.primitive) as usize];
        if k == NOWHERE {
            return 0.0;
        }
        let seen = self.tree.probability(k as usize, p, n);
        seen.map_or(0.0, |(seen, probability)| probability * seen.pdf(p, met.wi, met.distance, met.local))
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
