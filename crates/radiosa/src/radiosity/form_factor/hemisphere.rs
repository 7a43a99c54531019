//! The hemisphere estimator: rays from an element in all directions, each carrying its share of what leaves.
//!
//! ```text
//! F_ij = 1/A_i ∫_i 1/π ∫ cos θ [the ray meets j] dω dA  ≈  Σ_rays w [it meets j]
//! ```
//!
//! | rule | directions | w |
//! |---|---|---|
//! | cells | centres of equal cells Δφ × Δθ | `(Δφ/2π) sin 2θ_c sin Δθ`: the cell's cosine-weighted solid angle over π, exactly; the sum is 1 |
//! | nodal | nodes `θ = 2π m/k`, `φ = 2π l/k` | `(2π/k²) sin 2θ`; the sum is `h cot h`, `h = 2π/k`, less than 1 |
//! | Nusselt | points of the unit disc, evenly spread, lifted to the hemisphere | 1/n |
//! | random | the same, independent points | 1/n |
//!
//! From the centre the answer is that of a point: off by as much as the factor varies over the element, however many rays there are. Averaging over source points
//! spread over the element removes that. The first two rules are turned about the normal by a random angle at every source point; the others give
//! every ray a source point of its own where there are as many points as rays, which fills all four dimensions evenly.
//!
//! The cost is that of the rays, whatever the number of elements; what is thinner than the distance of rays is missed or counted too much. Every surface
//! blocks, glass too; holes cut by alpha masks do not.

use std::f64::consts::PI;

use super::Sums;
use super::rule::{self, Turned};
use crate::math::function::{cos_f64, sin_f64};
use crate::math::{DVec3, Ray, Vec2, Vec3};
use crate::radiosity::medium::Medium;
use crate::radiosity::mesh::{Element, ElementMesh};
use crate::sampling::{rng, sequence, warp};
use crate::transport::World;

/// How directions and their weights are chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Rule {
    /// Equal cells of both angles with exact weights.
    #[default]
    Cells,
    /// The lecture's rule of nodes, without correction.
    Nodal,
    /// Points of the disc below, low discrepancy.
    Nusselt,
    /// Points of the disc below, independent.
    Random,
}

/// What rays are traced.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// How directions are chosen.
    pub rule: Rule,
    /// Rays of an element in all, about.
    pub rays: u32,
    /// Source points they start from; 1 is the centre.
    pub points: u32,
}

impl Default for Settings {
    fn default() -> Self {
        Self { rule: Rule::Nusselt, rays: 4096, points: 4096 }
    }
}

/// The estimator over a mesh.
#[derive(Debug)]
pub struct Hemisphere<'a> {
    world: &'a World,
    mesh: &'a ElementMesh,
    settings: Settings,
    medium: Medium,
    seed: u64,
    /// Directions around +z and their weights, where every source point has the same.
    pattern: Vec<(DVec3, f64)>,
}

impl<'a> Hemisphere<'a> {
    pub(super) fn new(world: &'a World, mesh: &'a ElementMesh, settings: &Settings, medium: Medium, seed: u64) -> Self {
        let settings =
            Settings { rule: settings.rule, rays: settings.rays.max(1), points: settings.points.clamp(1, settings.rays.max(1)) };
        // k azimuths for k/4 polar angles: cells as high as wide at the horizon.
        let quarter = (0.5 * f64::from(settings.rays / settings.points).sqrt()).round().max(1.0) as u32;
        let pattern = match settings.rule {
            Rule::Cells => cells(quarter),
            Rule::Nodal => nodes(4 * (quarter + 1)),
            Rule::Nusselt | Rule::Random => Vec::new(),
        };
        Self { world, mesh, settings, medium, seed, pattern }
    }

    pub(super) fn row(&self, i: u32, sums: &mut Sums, n_rays: &mut u64) {
        let element = &self.mesh.elements()[i as usize];
        let key = rng::key(&[self.seed, u64::from(i), 0x6865_6D69]);
        let n_points = self.settings.points;
        let mut rays = Rays { of: self, origin: Vec3::ZERO, share: 0.0, waiting: Vec::with_capacity(8), sums, n_rays };
        if !self.pattern.is_empty() {
            for p in 0..n_points {
                let turn = f64::from(rng::unit_f32((rng::mix(key ^ u64::from(p)) >> 32) as u32));
                let frame = Turned::new(element.normal, 2.0 * PI * turn);
                rays.start(element, sequence::point_2d(p, key), n_points);
                self.pattern.iter().for_each(|&(dir, weight)| rays.push(frame.to_world(dir), weight));
            }
            return rays.trace();
        }
        let frame = Turned::new(element.normal, 0.0);
        let mut stream = rng::Stream::new(key, 0, 0);
        let directions = self.settings.rays.div_ceil(n_points);
        for r in 0..directions * n_points {
            let p = r / directions;
            let [at, toward] = match self.settings.rule {
                Rule::Random => [free_point(key, p), stream.next_2d()],
                _ if directions == 1 => sequence::point_4d(r, key),
                _ => [sequence::point_2d(p, key), sequence::point_2d(r, key ^ 1)],
            };
            if r % directions == 0 {
                rays.start(element, at, n_points);
            }
            rays.push(frame.to_world(warp::cosine_hemisphere(toward).as_dvec3()), 1.0 / f64::from(directions));
        }
        rays.trace();
    }
}

/// An independent point of the square for each source point.
fn free_point(key: u64, p: u32) -> Vec2 {
    rng::Stream::new(key, 1, u64::from(p)).next_2d()
}

/// `4 quarter × quarter` cells: the directions of their centres and their weights.
fn cells(quarter: u32) -> Vec<(DVec3, f64)> {
    let step = 0.5 * PI / f64::from(quarter);
    let centre = |m: u32| (f64::from(m) + 0.5) * step;
    let weight = |theta: f64| step / (2.0 * PI) * sin_f64(2.0 * theta) * sin_f64(step);
    grid(4 * quarter, (0..quarter).map(|m| (centre(m), weight(centre(m)))))
}

/// The nodes `θ = 2π m/k` above the horizon, but for those of weight zero.
fn nodes(k: u32) -> Vec<(DVec3, f64)> {
    let step = 2.0 * PI / f64::from(k);
    let weight = |theta: f64| 2.0 * PI / (f64::from(k) * f64::from(k)) * sin_f64(2.0 * theta);
    grid(k, (1..k.div_ceil(4)).map(|m| f64::from(m) * step).map(|theta| (theta, weight(theta))))
}

/// The directions of `k` azimuths for each polar angle, with the weights of those.
fn grid(k: u32, rows: impl Iterator<Item = (f64, f64)>) -> Vec<(DVec3, f64)> {
    let step = 2.0 * PI / f64::from(k);
    let azimuths: Vec<[f64; 2]> = (0..k).map(|l| f64::from(l) * step).map(|phi| [cos_f64(phi), sin_f64(phi)]).collect();
    rows.flat_map(|(theta, weight)| {
        let (sin, cos) = (sin_f64(theta), cos_f64(theta));
        azimuths.iter().map(move |[x, y]| (DVec3::new(sin * x, sin * y, cos), weight)).collect::<Vec<_>>()
    })
    .collect()
}

/// Rays on their way, eight at a time.
struct Rays<'a, 'b> {
    of: &'b Hemisphere<'a>,
    /// Where those pushed next start.
    origin: Vec3,
    /// What the source point stands for.
    share: f64,
    waiting: Vec<(Ray, f64)>,
    sums: &'b mut Sums,
    n_rays: &'b mut u64,
}

impl Rays<'_, '_> {
    fn start(&mut self, element: &Element, at: Vec2, n_points: u32) {
        let source = rule::source_point(element, at, n_points);
        (self.origin, self.share) = (element.lift().in_front(source.p), source.area / (element.area * f64::from(n_points)));
    }

    fn push(&mut self, dir: DVec3, weight: f64) {
        self.waiting.push((Ray::new(self.origin, dir.as_vec3()), weight * self.share));
        if self.waiting.len() == 8 {
            self.trace();
        }
    }

    fn trace(&mut self) {
        let Hemisphere { world, mesh, medium, .. } = self.of;
        *self.n_rays += self.waiting.len() as u64;
        let n = self.waiting.len();
        let hits = if n < 8 || world.has_transparency() {
            std::array::from_fn(|k| world.closest_visible(&self.waiting.get(k)?.0).map(|(hit, _)| hit))
        } else {
            world.accel().closest8(&std::array::from_fn(|k| self.waiting[k].0), u8::MAX)
        };
        for ((ray, weight), hit) in self.waiting.iter().zip(hits) {
            let Some(hit) = hit else { continue };
            if let Some(j) = mesh.element_at(&hit, ray.origin + ray.dir * hit.t, ray.dir) {
                self.sums.add_through(medium, f64::from(hit.t), j, *weight);
            }
        }
        self.waiting.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_weights_of_cells_sum_to_one_and_those_of_nodes_to_less() {
        for n in [1, 2, 5, 30] {
            let sum = |pattern: &[(DVec3, f64)]| pattern.iter().map(|p| p.1).sum::<f64>();
            assert!((sum(&cells(n)) - 1.0).abs() < 1e-12);
            let h = 2.0 * PI / f64::from(4 * n + 4);
            assert!((sum(&nodes(4 * n + 4)) - h * cos_f64(h) / sin_f64(h)).abs() < 1e-12);
        }
    }
}
