//! How much of one element another sees, weighted by the kernel.
//!
//! ```text
//! visible factor = exact factor × Σ V K / Σ K,   K = cos θ cos θ′ / (π r²)
//! ```
//!
//! over rays between points of both. The plain visible fraction `Σ V / N` in place of the weighted one does not converge to the truth: what is close counts
//! more than what is far.

use crate::accel::Occluder;
use crate::math::rounding::{gamma, offset_origin};
use crate::math::{Ray, Vec3};
use crate::radiosity::mesh::{self, Element, ElementMesh};
use crate::sampling::rng;
use crate::transport::World;

pub(super) use crate::radiosity::mesh::POINTS;

/// Points of elements from which rays to other elements start, just in front of the surface.
#[derive(Debug)]
pub struct Visibility<'a> {
    world: &'a World,
    /// [`POINTS`] for each element.
    points: Vec<Vec3>,
    n: [usize; 2],
}

/// What a thread keeps between pairs.
#[derive(Debug, Default)]
pub struct Scratch {
    rays: Vec<Ray>,
    kernel: Vec<f32>,
    blocked: Vec<bool>,
    occluder: Occluder,
    /// Rays traced so far.
    pub n_rays: u64,
}

impl<'a> Visibility<'a> {
    /// `rays` between two elements at first, `more` in all when some but not all of them are blocked: at most [`POINTS`] both.
    pub(super) fn new(world: &'a World, mesh: &ElementMesh, [rays, more]: [usize; 2]) -> Self {
        let mut points = Vec::with_capacity(mesh.elements().len() * POINTS);
        for (i, element) in mesh.elements().iter().enumerate() {
            let of_point = |k: u32| in_front(element, element.at(mesh::point(i as u32, k)).as_vec3());
            points.extend((0..POINTS as u32).map(of_point));
        }
        Self { world, points, n: [rays.clamp(1, POINTS), more.clamp(rays.clamp(1, POINTS), POINTS)] }
    }

    /// The fraction of what `i` and `j` would exchange that nothing between them takes away.
    pub(super) fn fraction(&self, (i, a): (u32, &Element), (j, b): (u32, &Element), scratch: &mut Scratch) -> f64 {
        // Every pair connects the points in another order; both sets stay well spread.
        let turn = (rng::mix(u64::from(i) << 32 | u64::from(j)) >> 32) as usize;
        let [few, many] = self.n;
        let first = self.trace((i, a), (j, b), turn, 0..few, scratch);
        if many == few || first[0] == 0.0 || first[0] == first[1] {
            return ratio(first);
        }
        let rest = self.trace((i, a), (j, b), turn, few..many, scratch);
        ratio([first[0] + rest[0], first[1] + rest[1]])
    }

    /// `Σ V K` and `Σ K` over some of the rays.
    fn trace(
        &self,
        (i, a): (u32, &Element),
        (j, b): (u32, &Element),
        turn: usize,
        which: std::ops::Range<usize>,
        scratch: &mut Scratch,
    ) -> [f64; 2] {
        let (from, to) = (self.of(i), self.of(j));
        let (na, nb) = (a.normal.as_vec3(), b.normal.as_vec3());
        scratch.rays.clear();
        scratch.kernel.clear();
        // Within a power of two, so that the first few points meet the first few.
        let mut covered = 0.0;
        let mask = self.n[0].next_power_of_two() - 1;
        for k in which {
            let l = k ^ (turn & mask);
            let (p, q) = (from[k], to[l]);
            let d = q - p;
            let r2 = d.length_squared();
            let kernel = na.dot(d).max(0.0) * (-nb.dot(d)).max(0.0) / (r2 * r2);
            if !(a.exposes(k) && b.exposes(l)) {
                covered += f64::from(if kernel.is_finite() { kernel } else { 0.0 });
            } else if kernel > 0.0 && kernel.is_finite() {
                scratch.rays.push(Ray { origin: p, dir: d, t_max: 1.0 });
                scratch.kernel.push(kernel);
            }
        }
        scratch.n_rays += scratch.rays.len() as u64;
        let mut sum = [0.0, covered];
        if self.world.has_transparency() {
            for (rays, kernel) in scratch.rays.chunks(8).zip(scratch.kernel.chunks(8)) {
                let eight = std::array::from_fn(|i| rays[i.min(rays.len() - 1)]);
                let passed = self.world.transmittances(&eight, rays.len(), true, &mut scratch.n_rays);
                for (k, v) in kernel.iter().zip(passed) {
                    sum[0] += f64::from(*k) * f64::from(v.r + v.g + v.b) / 3.0;
                    sum[1] += f64::from(*k);
                }
            }
        } else {
            self.world.accel().occluded_between(&scratch.rays, &mut scratch.occluder, &mut scratch.blocked);
            for (k, blocked) in scratch.kernel.iter().zip(&scratch.blocked) {
                sum[0] += if *blocked { 0.0 } else { f64::from(*k) };
                sum[1] += f64::from(*k);
            }
        }
        sum
    }

    /// Points in front of an element.
    pub(super) fn of(&self, i: u32) -> &[Vec3] {
        &self.points[i as usize * POINTS..][..POINTS]
    }
}

fn ratio([seen, all]: [f64; 2]) -> f64 {
    if all > 0.0 { seen / all } else { 0.0 }
}

/// A point of an element moved off its surface, to where rays may start and end: the bound of its rounding error is that of a hit (`transport::Surface`).
pub(super) fn in_front(element: &Element, p: Vec3) -> Vec3 {
    let largest = element.corners().iter().map(|c| c.abs().max_element()).fold(0.0, f64::max) as f32;
    let normal = element.normal.as_vec3();
    offset_origin(p, Vec3::splat(largest * gamma(16)), normal, normal)
}
