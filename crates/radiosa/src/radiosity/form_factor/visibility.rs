//! How much of one element another sees, weighted by the kernel.
//!
//! ```text
//! visible factor = exact factor × Σ V K / Σ K,   K = cos θ cos θ′ / (π r²)
//! ```
//!
//! over rays between points of both. The plain visible fraction `Σ V / N` in place of the weighted one does not converge to the truth: what is close counts
//! more than what is far.

use crate::accel::Occluder;
use crate::math::polygon::clip;
use crate::math::{DVec3, Frame, Ray, Vec3};
use crate::radiosity::medium::Medium;
use crate::radiosity::mesh::{self, Element, ElementMesh};
use crate::sampling::{rng, sequence, warp};
use crate::transport::{Passage, World};

pub(super) use crate::radiosity::mesh::POINTS;

/// Rays traced together.
const BATCH: usize = 64;

/// Points of elements from which rays to other elements start, just in front of the surface.
#[derive(Debug)]
pub struct Visibility<'a> {
    world: &'a World,
    medium: Medium,
    /// [`POINTS`] for each element.
    points: Vec<Vec3>,
    n: [usize; 2],
}

/// Rays traced together; kept between pairs.
#[derive(Debug, Default)]
pub(in crate::radiosity) struct Lines {
    pub(in crate::radiosity) rays: Vec<Ray>,
    blocked: Vec<bool>,
    /// What passes of each ray.
    pub(in crate::radiosity) passed: Vec<f32>,
    occluder: Occluder,
    /// Rays traced so far.
    n_rays: u64,
}

impl Lines {
    /// Traces the rays: what passes of each.
    pub(in crate::radiosity) fn trace(&mut self, world: &World) {
        self.n_rays += self.rays.len() as u64;
        self.passed.clear();
        if world.has_transparency() {
            for rays in self.rays.chunks(8) {
                let eight = std::array::from_fn(|i| rays[i.min(rays.len() - 1)]);
                let passed = world.transmittances(&eight, rays.len(), Passage::STRAIGHT, &mut self.n_rays);
                self.passed.extend(passed[..rays.len()].iter().map(|v| (v.r + v.g + v.b) / 3.0));
            }
        } else {
            world.accel().occluded_between(&self.rays, &mut self.occluder, &mut self.blocked);
            self.passed.extend(self.blocked.iter().map(|&blocked| if blocked { 0.0 } else { 1.0 }));
        }
    }
}

/// What a thread keeps between pairs.
#[derive(Debug, Default)]
pub struct Scratch {
    lines: Lines,
    kernel: Vec<f32>,
}

impl<'a> Visibility<'a> {
    /// `rays` between two elements at first, `more` in all when some but not all of them are blocked: at most [`POINTS`] both.
    pub(super) fn new(world: &'a World, mesh: &ElementMesh, [rays, more]: [usize; 2], medium: Medium) -> Self {
        let mut points = Vec::with_capacity(mesh.elements().len() * POINTS);
        for (i, element) in mesh.elements().iter().enumerate() {
            let lift = element.lift();
            let of_point = |k: u32| lift.in_front(element.at(mesh::point(i as u32, k)));
            points.extend((0..POINTS as u32).map(of_point));
        }
        Self { world, medium, points, n: [rays.clamp(1, POINTS), more.clamp(rays.clamp(1, POINTS), POINTS)] }
    }

    /// For [`Self::visible_sums`] alone.
    pub(super) fn without_points(world: &'a World, medium: Medium) -> Self {
        Self { world, medium, points: Vec::new(), n: [0; 2] }
    }

    /// Anything passes along `n` lines between two groups of elements, spread over both.
    pub(super) fn any_between(&self, elements: &[Element], [a, b]: [&[u32]; 2], n: usize, scratch: &mut Scratch) -> bool {
        let turn = (rng::mix(u64::from(a[0]) << 32 | u64::from(b[0])) >> 33) as usize;
        for first in (0..n).step_by(BATCH) {
            scratch.lines.rays.clear();
            for k in first..n.min(first + BATCH) {
                // Every line from another element as long as there are some, to one that does not go along with it.
                let (i, j) = (a[k % a.len()], b[(k * 7 + k / b.len() + turn) % b.len()]);
                let (p, q) = (self.of(i)[k % POINTS], self.of(j)[(k ^ turn) % POINTS]);
                let d = q - p;
                let faces = |i: u32, sign: f32| elements[i as usize].normal.as_vec3().dot(d) * sign > 0.0;
                if faces(i, 1.0) && faces(j, -1.0) {
                    scratch.lines.rays.push(Ray { origin: p, dir: d, t_max: 1.0 });
                }
            }
            if !scratch.lines.rays.is_empty() {
                scratch.lines.trace(self.world);
                if scratch.lines.passed.iter().any(|&passed| passed > 0.0) {
                    return true;
                }
            }
        }
        false
    }

    /// Of `n` rays over the hemisphere of an element each meets an element, and one behind that where it is transparent.
    pub(super) fn is_closed(&self, mesh: &ElementMesh, i: u32, n: u32) -> bool {
        let element = &mesh.elements()[i as usize];
        if !element.normal.is_finite() {
            return false;
        }
        let frame = Frame::from_normal(element.normal.as_vec3());
        let key = rng::key(&[u64::from(i), 0x636C_6F73_6564]);
        let mut of = (0..n).filter(|&k| element.exposes(k as usize % POINTS)).peekable();
        of.peek().is_some()
            && of.all(|k| {
                let dir = frame.to_world(warp::cosine_hemisphere(sequence::point_2d(k, key)));
                let ray = Ray { origin: self.of(i)[k as usize % POINTS], dir, t_max: f32::INFINITY };
                self.ends_on_element(mesh, ray)
            })
    }

    /// A ray meets nothing but elements that light can reach as far as it goes through transparent ones, and then an opaque one.
    fn ends_on_element(&self, mesh: &ElementMesh, ray: Ray) -> bool {
        let mut all = true;
        let leaves = self.world.each_met(&ray, |hit, surface| {
            let element = mesh.element_at(hit, surface.p, ray.dir);
            all &= element.is_some_and(|e| mesh.elements()[e as usize].exposed() > 0.0);
        });
        all && !leaves
    }

    /// `Σ V K` and `Σ K` along `n` lines between two groups of elements, spread over both; K with the areas of the elements at the ends.
    pub(super) fn seen_between(&self, elements: &[Element], [a, b]: [&[u32]; 2], n: usize, scratch: &mut Scratch) -> [f64; 2] {
        let turn = (rng::mix(u64::from(a[0]) << 32 | u64::from(b[0])) >> 33) as usize;
        scratch.lines.rays.clear();
        scratch.kernel.clear();
        for k in 0..n {
            // Strata of either group, those of the second in another order.
            let (s, t) = (k, (k * 7 + turn) % n);
            let (i, j) = (a[(2 * s + 1) * a.len() / (2 * n)], b[(2 * t + 1) * b.len() / (2 * n)]);
            let (s, t) = (k % POINTS, (k ^ turn) % POINTS);
            let (from, to) = (&elements[i as usize], &elements[j as usize]);
            let (p, q) = (self.of(i)[s], self.of(j)[t]);
            let d = q - p;
            let r2 = d.length_squared();
            let cosines = from.normal.as_vec3().dot(d).max(0.0) * (-to.normal.as_vec3().dot(d)).max(0.0);
            let kernel = cosines / (r2 * r2) * (from.area * to.area) as f32;
            if kernel > 0.0 && kernel.is_finite() && from.exposes(s) && to.exposes(t) {
                scratch.lines.rays.push(Ray { origin: p, dir: d, t_max: 1.0 });
                scratch.kernel.push(kernel);
            }
        }
        scratch.lines.trace(self.world);
        scratch
            .kernel
            .iter()
            .zip(&scratch.lines.passed)
            .fold([0.0; 2], |[seen, all], (kernel, passed)| [seen + f64::from(*kernel * *passed), all + f64::from(*kernel)])
    }

    /// `Σ V K` and `Σ (V K)²` over pairs of points of two elements with their kernels, and `Σ V K e^(−σ r) / Σ V K`.
    pub(super) fn visible_sums<'e>(
        &self,
        pairs: impl Iterator<Item = ([(&'e Element, DVec3); 2], f64)>,
        scratch: &mut Scratch,
    ) -> ([f64; 2], [f64; 3]) {
        let (mut sums, mut left) = ([0.0; 2], [0.0; 3]);
        let mut pairs = pairs.filter(|(_, kernel)| *kernel > 0.0 && kernel.is_finite()).peekable();
        let mut kernels = Vec::with_capacity(BATCH);
        while pairs.peek().is_some() {
            scratch.lines.rays.clear();
            kernels.clear();
            for ([p, q], kernel) in pairs.by_ref().take(BATCH) {
                let [p, q] = [p, q].map(|(element, p)| element.lift().in_front(p));
                scratch.lines.rays.push(Ray { origin: p, dir: q - p, t_max: 1.0 });
                kernels.push(kernel);
            }
            scratch.lines.trace(self.world);
            for ((kernel, passed), ray) in kernels.iter().zip(&scratch.lines.passed).zip(&scratch.lines.rays) {
                let visible = kernel * f64::from(*passed);
                sums[0] += visible;
                sums[1] += visible * visible;
                if !self.medium.is_clear() {
                    let tau = self.medium.transmittance(f64::from(ray.dir.length()));
                    (0..3).for_each(|c| left[c] += visible * tau[c]);
                }
            }
        }
        let is_clear = self.medium.is_clear() || sums[0] <= 0.0;
        (sums, if is_clear { [1.0; 3] } else { left.map(|left| left / sums[0]) })
    }

    /// What of that which `i` and `j` would exchange nothing between them takes away.
    pub(super) fn seen(&self, (i, a): (u32, &Element), (j, b): (u32, &Element), scratch: &mut Scratch) -> Seen {
        // Every pair connects the points in another order; both sets stay well spread.
        let turn = (rng::mix(u64::from(i) << 32 | u64::from(j)) >> 32) as usize;
        let [few, many] = self.n;
        let first = self.trace((i, a), (j, b), turn, 0..few, scratch);
        let is_known = first.all > 0.0 && (first.seen == 0.0 || first.seen == first.all);
        let sums = if many == few || is_known { first } else { first.plus(self.trace((i, a), (j, b), turn, few..many, scratch)) };
        // Where only a little of them lies in front of each other, it may be that no ray says anything.
        if sums.all > 0.0 { sums.ratio() } else { self.seen_by_middles(a, b, scratch) }
    }

    /// One ray between the middles of what lies in front of each other.
    fn seen_by_middles(&self, a: &Element, b: &Element, scratch: &mut Scratch) -> Seen {
        let middle = |of: &Element, before: &Element| {
            let mut part = Vec::with_capacity(8);
            clip(of.corners(), before.corners()[0], before.normal, 0.0, &mut part);
            (part.len() >= 3).then(|| of.lift().in_front(part.iter().sum::<DVec3>() / part.len() as f64))
        };
        let mut fraction = 0.0;
        if let (Some(p), Some(q)) = (middle(a, b), middle(b, a)) {
            scratch.lines.rays.clear();
            scratch.lines.rays.push(Ray { origin: p, dir: q - p, t_max: 1.0 });
            scratch.lines.trace(self.world);
            fraction = f64::from(scratch.lines.passed[0]);
        }
        // (One ray says little.)
        Seen { fraction, error: 0.5, passing: [1.0; 3] }
    }

    /// Sums over some of the rays.
    fn trace(
        &self,
        (i, a): (u32, &Element),
        (j, b): (u32, &Element),
        turn: usize,
        which: std::ops::Range<usize>,
        scratch: &mut Scratch,
    ) -> Sums {
        let (from, to) = (self.of(i), self.of(j));
        let (na, nb) = (a.normal.as_vec3(), b.normal.as_vec3());
        scratch.lines.rays.clear();
        scratch.kernel.clear();
        // Within a power of two, so that the first few points meet the first few.
        let mut sums = Sums::default();
        let tau = |d: Vec3| self.medium.transmittance(f64::from(d.length()));
        let mask = self.n[0].next_power_of_two() - 1;
        for k in which {
            let l = k ^ (turn & mask);
            let (p, q) = (from[k], to[l]);
            let d = q - p;
            let r2 = d.length_squared();
            let kernel = na.dot(d).max(0.0) * (-nb.dot(d)).max(0.0) / (r2 * r2);
            if !(a.exposes(k) && b.exposes(l)) {
                let kernel = f64::from(if kernel.is_finite() { kernel } else { 0.0 });
                sums.all += kernel;
                if !self.medium.is_clear() {
                    add(&mut sums.all_left, kernel, tau(d));
                }
            } else if kernel > 0.0 && kernel.is_finite() {
                scratch.lines.rays.push(Ray { origin: p, dir: d, t_max: 1.0 });
                scratch.kernel.push(kernel);
            }
        }
        scratch.lines.trace(self.world);
        for ((kernel, passed), ray) in scratch.kernel.iter().zip(&scratch.lines.passed).zip(&scratch.lines.rays) {
            let (kernel, passed) = (f64::from(*kernel), f64::from(*passed));
            sums.seen += kernel * passed;
            sums.all += kernel;
            sums.squares += kernel * kernel;
            if !self.medium.is_clear() {
                let tau = tau(ray.dir);
                add(&mut sums.all_left, kernel, tau);
                add(&mut sums.seen_left, kernel * passed, tau);
            }
        }
        sums
    }

    /// Points in front of an element.
    pub(super) fn of(&self, i: u32) -> &[Vec3] {
        &self.points[i as usize * POINTS..][..POINTS]
    }
}

/// How much two elements see of each other.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    /// `p = Σ V K / Σ K`.
    pub(super) fraction: f64,
    /// `√(p (1 − p) Σ K²) / Σ K`: its standard deviation if rays were independent.
    pub(super) error: f64,
    /// How much more of what is seen a medium lets through than of all: `(Σ V K τ / Σ V K) / (Σ K τ / Σ K)`.
    pub(super) passing: [f64; 3],
}

/// Sums over rays between two elements.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    /// `Σ V K`, `Σ K` and `Σ K²`.
    seen: f64,
    all: f64,
    squares: f64,
    /// The first two with the transmittance of the medium, where it is not clear.
    seen_left: [f64; 3],
    all_left: [f64; 3],
}

impl Sums {
    fn plus(self, other: Self) -> Self {
        let plus = |a: [f64; 3], b: [f64; 3]| std::array::from_fn(|c| a[c] + b[c]);
        Self {
            seen: self.seen + other.seen,
            all: self.all + other.all,
            squares: self.squares + other.squares,
            seen_left: plus(self.seen_left, other.seen_left),
            all_left: plus(self.all_left, other.all_left),
        }
    }

    /// Of rays some of which count.
    fn ratio(self) -> Seen {
        let p = self.seen / self.all;
        let passing = |c: usize| {
            let [seen, all] = [self.seen_left[c], p * self.all_left[c]];
            if all > 0.0 { seen / all } else { 1.0 }
        };
        Seen {
            fraction: p,
            error: (p * (1.0 - p).max(0.0) * self.squares).sqrt() / self.all,
            passing: std::array::from_fn(passing),
        }
    }
}

fn add(sum: &mut [f64; 3], kernel: f64, tau: [f64; 3]) {
    (0..3).for_each(|c| sum[c] += kernel * tau[c]);
}
