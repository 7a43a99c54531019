//! The irradiance at a point from a finished solution: one more gathering step, without elements at the receiving end.
//!
//! ```text
//! E(p) = D(p) + Σ_j B_j F_{dp→j} · Σ V K τ / Σ K
//! ```
//!
//! Where an element looks large, it is cut into pieces with radiosities interpolated between its corners: what is close must not be seen in steps.
//!
//! The factor from a point to an element is exact, and the rays that decide how much of it is seen are many where the element matters: shadows are as sharp
//! as at a camera ray, whatever the size of the elements.

mod near;
pub(super) mod shadows;

use self::near::Near;
use super::direct::DirectLight;
use super::display;
use super::form_factor::analytic;
use super::form_factor::visibility::Lines;
use super::mesh::Element;
use super::solution::Solution;
use crate::math::polygon::clip;
use crate::math::rounding::offset_origin;
use crate::math::{DVec3, Ray, Vec3};
use crate::sampling::{rng, sequence};
use crate::spectrum::{Spectrum, luminance};
use crate::transport::{Surface, World};

/// Rays of one sensor, about, beside one for each element; and at most to one element.
const RAYS: [f64; 2] = [2048.0, 512.0];

/// What arrives at a sensor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Arriving {
    /// W/m² or lux.
    pub irradiance: Spectrum,
    /// Standard error of its luminance, from the rays that decide about visibility and from what the solver left to chance.
    pub standard_error: f64,
}

/// A solution made ready for being asked at points.
#[derive(Debug)]
pub struct Gather<'a> {
    world: &'a World,
    solution: &'a Solution,
    direct: DirectLight<'a>,
    /// Radius of each element around its centre.
    bounds: Vec<(DVec3, f64)>,
    /// Irradiances at the corners of each element: they go on where the material changes, as radiosities do not.
    corners: Vec<[Spectrum; 4]>,
    near: Option<Near>,
    seed: u64,
}

/// A part of an element as a sensor sees it.
#[derive(Clone, Copy, Debug)]
struct Piece {
    element: u32,
    /// Its corner nearest to the first in the element's unit square, and its side there.
    place: [f64; 3],
    /// Unoccluded form factor.
    factor: f64,
    radiosity: [f64; 3],
    /// The part of it that nothing hides.
    seen: f64,
    /// The part of its light that arrives, by channel: less where there is a medium.
    arriving: [f64; 3],
    /// Rays that told so.
    n_rays: u32,
}

/// Pieces along a side for factors above these.
const CUTS: [(f64, u32); 3] = [(0.05, 8), (0.008, 4), (0.001, 2)];

/// What a thread keeps between sensors.
#[derive(Debug, Default)]
pub struct Scratch {
    polygon: Vec<DVec3>,
    pieces: Vec<Piece>,
    lines: Lines,
    kernel: Vec<f64>,
    /// Emission is left out.
    reflected_only: bool,
}

impl Scratch {
    /// `Σ B F V` over all pieces.
    fn arriving(&self) -> Spectrum {
        let mut sum = [0.0; 3];
        for piece in &self.pieces {
            (0..3).for_each(|c| sum[c] += piece.radiosity[c] * piece.factor * piece.arriving[c]);
        }
        Spectrum::from(sum.map(|s| s as f32))
    }
}

/// Bilinear between the corners of an element, and moved so that the element keeps its mean: what corners smooth away at the edge of a shadow must not light
/// the dark side of it.
fn around([a, b, c, d]: [Spectrum; 4], mean: Spectrum, at: [f64; 2]) -> Spectrum {
    let [u, v] = at.map(|x| x as f32);
    mean + (a * (1.0 - u) + b * u) * (1.0 - v) + (d * (1.0 - u) + c * u) * v - (a + b + c + d) * 0.25
}

impl<'a> Gather<'a> {
    /// Prepares the bounds of every element.
    pub fn new(world: &'a World, solution: &'a Solution, extra_lights: &[crate::scene::Light], seed: u64) -> Self {
        let bound = |e: &Element| {
            let centre = e.centre();
            (centre, e.corners().iter().map(|c| (*c - centre).length()).fold(0.0, f64::max))
        };
        let bounds = solution.mesh.elements().iter().map(bound).collect();
        let corners = display::corner_values(world, &solution.mesh, &solution.irradiance);
        let direct = DirectLight::new(world, extra_lights, seed).within(solution.system.medium);
        Self { world, solution, direct, bounds, corners, near: None, seed }
    }

    /// Looks closely at what is near sensors: at the edges of shadows within elements, and at elements that give much of what arrives. It costs as much
    /// as some thousand sensors do, and each sensor some ten times as much.
    pub fn with_details(mut self) -> Self {
        self.near = Near::new(&self);
        self
    }

    /// What arrives at a surface point on the side of the unit normal `n`; `sensor` keys its random streams.
    pub fn at(&self, surface: &Surface, n: Vec3, sensor: u64, scratch: &mut Scratch) -> Arriving {
        let key = rng::key(&[self.seed, sensor, 0x7365_6E73]);
        let start = offset_origin(surface.p, surface.p_error, surface.ng, n);
        self.collect(start.as_dvec3(), n.as_dvec3(), scratch);
        self.look(start, n.as_dvec3(), RAYS[0], key, scratch);
        let variance = |p: &Piece| (p.factor * luminance(p.radiosity)).powi(2) * p.seen * (1.0 - p.seen) / f64::from(p.n_rays);
        let visibility: f64 = scratch.pieces.iter().map(variance).sum();
        // What the solver left to chance arrives from every element, by its reflectance.
        let errors = &self.solution.irradiance_error;
        let solver = |pieces: &[Piece]| {
            let (j, rho) = (pieces[0].element as usize, self.solution.system.reflectance[pieces[0].element as usize]);
            let error = errors.get(j).map_or(0.0, |e| luminance(std::array::from_fn(|c| rho[c] * e[c])));
            (error * pieces.iter().map(|p| p.factor * p.seen).sum::<f64>()).powi(2)
        };
        let of_elements = scratch.pieces.chunk_by(|a, b| a.element == b.element);
        let direct = self.direct.at(surface, n, key);
        let variance = visibility + of_elements.map(solver).sum::<f64>() + direct.standard_error.powi(2);
        if let Some(near) = &self.near {
            near.look_again(self, scratch);
        }
        Arriving { irradiance: direct.irradiance + scratch.arriving(), standard_error: variance.max(0.0).sqrt() }
    }

    /// What a point could see: elements, those that look large in pieces.
    fn collect(&self, p: DVec3, normal: DVec3, scratch: &mut Scratch) {
        scratch.pieces.clear();
        for (j, element) in self.solution.mesh.elements().iter().enumerate() {
            let mut b = self.solution.radiosity[j];
            if scratch.reflected_only {
                (0..3).for_each(|c| b[c] -= self.solution.system.emission[j][c]);
            }
            let Some(factor) = self.whole(p, normal, j, b, scratch) else { continue };
            let cuts = CUTS.iter().find(|c| factor > c.0).map_or(1, |c| c.1);
            if cuts > 1 && element.corners().len() == 4 {
                scratch.pieces.pop();
                self.cut(p, normal, j, cuts, scratch);
            }
        }
    }

    /// What a point could see of emitting elements, with what they emit alone.
    fn collect_emitting(&self, p: DVec3, normal: DVec3, emitting: &[u32], scratch: &mut Scratch) {
        scratch.pieces.clear();
        for &j in emitting {
            self.whole(p, normal, j as usize, self.solution.system.emission[j as usize], scratch);
        }
    }

    /// Adds an element of radiosity `b` as one piece, where it faces the point: its unoccluded form factor.
    fn whole(&self, p: DVec3, normal: DVec3, j: usize, b: [f64; 3], scratch: &mut Scratch) -> Option<f64> {
        let element = &self.solution.mesh.elements()[j];
        let (centre, radius) = self.bounds[j];
        let d = centre - p;
        if b == [0.0; 3] || normal.dot(d) <= -radius || element.normal.dot(d) >= 0.0 {
            return None;
        }
        let factor = analytic::point_to_polygon(p, normal, element.corners(), &mut scratch.polygon);
        if factor <= 0.0 {
            return None;
        }
        scratch.pieces.push(Piece {
            element: j as u32,
            place: [0.0, 0.0, 1.0],
            factor,
            radiosity: b,
            seen: 0.0,
            arriving: [0.0; 3],
            n_rays: 0,
        });
        Some(factor)
    }

    /// Finds how much of each piece is seen, by about `rays` rays beside one for each.
    fn look(&self, start: Vec3, normal: DVec3, rays: f64, key: u64, scratch: &mut Scratch) {
        let weight = |piece: &Piece| piece.factor * luminance(piece.radiosity);
        let total: f64 = scratch.pieces.iter().map(weight).sum();
        for k in 0..scratch.pieces.len() {
            let piece = scratch.pieces[k];
            let n_rays = if total > 0.0 { (rays * weight(&piece) / total).ceil().clamp(1.0, RAYS[1]) as u32 } else { 1 };
            let (seen, arriving) = self.visible(start, normal, &piece, n_rays, rng::mix(key ^ k as u64), scratch);
            scratch.pieces[k] = Piece { seen, arriving, n_rays, ..piece };
        }
    }

    /// `E + ρ H` of an element.
    fn reflecting(&self, j: usize, h: Spectrum) -> [f64; 3] {
        let (e, rho, h) = (self.solution.system.emission[j], self.solution.system.reflectance[j], h.to_array().map(f64::from));
        std::array::from_fn(|c| e[c] + rho[c] * h[c].max(0.0))
    }

    /// Cuts a quadrilateral into `n × n` pieces.
    fn cut(&self, p: DVec3, normal: DVec3, j: usize, n: u32, scratch: &mut Scratch) {
        let element = &self.solution.mesh.elements()[j];
        let side = 1.0 / f64::from(n);
        for k in 0..n * n {
            let (s, t) = (f64::from(k % n) * side, f64::from(k / n) * side);
            let corners = [[s, t], [s + side, t], [s + side, t + side], [s, t + side]].map(|at| element.at(at));
            let factor = analytic::point_to_polygon(p, normal, &corners, &mut scratch.polygon);
            if factor <= 0.0 {
                continue;
            }
            let at = [s + 0.5 * side, t + 0.5 * side];
            let own = || around(self.corners[j], Spectrum::from(self.solution.irradiance[j].map(|h| h as f32)), at);
            let h = self.near.as_ref().and_then(|near| near.irradiance(j, at)).unwrap_or_else(own);
            let mut radiosity = self.reflecting(j, h);
            if scratch.reflected_only {
                (0..3).for_each(|c| radiosity[c] -= self.solution.system.emission[j][c]);
            }
            scratch.pieces.push(Piece {
                element: j as u32,
                place: [s, t, side],
                factor,
                radiosity,
                seen: 0.0,
                arriving: [0.0; 3],
                n_rays: 0,
            });
        }
    }

    /// `Σ V K / Σ K` over rays from a point to a piece of an element, and the same with what a medium lets through, by channel.
    fn visible(&self, from: Vec3, normal: DVec3, piece: &Piece, n_rays: u32, key: u64, scratch: &mut Scratch) -> (f64, [f64; 3]) {
        let element = &self.solution.mesh.elements()[piece.element as usize];
        let (en, lift) = (element.normal.as_vec3(), element.lift());
        scratch.lines.rays.clear();
        scratch.kernel.clear();
        let Scratch { lines, kernel: kernels, polygon, .. } = scratch;
        let mut add = |to: DVec3| {
            let d = lift.in_front(to) - from;
            let r2 = f64::from(d.length_squared());
            let kernel = normal.dot(d.as_dvec3()).max(0.0) * f64::from((-en.dot(d)).max(0.0)) / (r2 * r2);
            let counts = kernel > 0.0 && kernel.is_finite();
            if counts {
                lines.rays.push(Ray { origin: from, dir: d, t_max: 1.0 });
                kernels.push(kernel);
            }
            counts
        };
        let (spread, mut any) = (if n_rays > 1 { n_rays } else { 0 }, false);
        let [s, t, side] = piece.place;
        for k in 0..spread {
            let u = sequence::point_2d(k, key).to_array().map(f64::from);
            any |= add(element.at([s + side * u[0], t + side * u[1]]));
        }
        if !any {
            add(middle(element, piece.place, [from.as_dvec3(), normal], polygon));
        }
        scratch.lines.trace(self.world);
        let (mut seen, mut all) = (0.0, 0.0);
        let (medium, mut arriving) = (&self.solution.system.medium, [0.0; 3]);
        for ((kernel, passed), ray) in scratch.kernel.iter().zip(&scratch.lines.passed).zip(&scratch.lines.rays) {
            let visible = kernel * f64::from(*passed);
            seen += visible;
            all += kernel;
            if !medium.is_clear() {
                let tau = medium.transmittance(f64::from(ray.dir.length()));
                (0..3).for_each(|c| arriving[c] += visible * tau[c]);
            }
        }
        if all <= 0.0 {
            return (0.0, [0.0; 3]);
        }
        (seen / all, if medium.is_clear() { [seen / all; 3] } else { arriving.map(|a| a / all) })
    }
}

/// The middle of what of a piece of an element lies above the horizon of a point.
fn middle(element: &Element, [s, t, side]: [f64; 3], [p, normal]: [DVec3; 2], polygon: &mut Vec<DVec3>) -> DVec3 {
    let part = [[s, t], [s + side, t], [s + side, t + side], [s, t + side]].map(|at| element.at(at));
    let corners = if side < 1.0 { &part } else { element.corners() };
    if corners.iter().all(|c| (*c - p).dot(normal) >= 0.0) {
        return element.at([s + 0.5 * side, t + 0.5 * side]);
    }
    clip(corners, p, normal, 0.0, polygon);
    polygon.iter().sum::<DVec3>() / polygon.len().max(1) as f64
}
