//! The irradiance at a point from a finished solution: one more gathering step, without elements at the receiving end.
//!
//! ```text
//! E(p) = D(p) + Σ_j B_j F_{dp→j} · Σ V K / Σ K
//! ```
//!
//! The factor from a point to an element is exact, and the rays that decide how much of it is seen are many where the element matters: shadows are as sharp
//! as at a camera ray, whatever the size of the elements.

use super::direct::DirectLight;
use super::form_factor::analytic;
use super::solution::Solution;
use crate::accel::Occluder;
use crate::math::rounding::{gamma, offset_origin};
use crate::math::{DVec3, Ray, Vec3};
use crate::sampling::{rng, sequence};
use crate::spectrum::Spectrum;
use crate::transport::{Surface, World};

/// Rays of one sensor, about, beside one for each element; and at most to one element.
const RAYS: [f64; 2] = [2048.0, 512.0];

/// What arrives at a sensor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Arriving {
    /// W/m² or lux.
    pub irradiance: Spectrum,
    /// Standard error of its luminance, from the rays that decide about visibility.
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
    seed: u64,
}

/// What a thread keeps between sensors.
#[derive(Debug, Default)]
pub struct Scratch {
    polygon: Vec<DVec3>,
    found: Vec<(u32, f64, f64)>,
    rays: Vec<Ray>,
    kernel: Vec<f64>,
    blocked: Vec<bool>,
    occluder: Occluder,
}

impl<'a> Gather<'a> {
    /// Prepares the bounds of every element.
    pub fn new(world: &'a World, solution: &'a Solution, extra_lights: &[crate::scene::Light], seed: u64) -> Self {
        let bound = |e: &super::mesh::Element| {
            let centre = e.centre();
            (centre, e.corners().iter().map(|c| (*c - centre).length()).fold(0.0, f64::max))
        };
        let bounds = solution.mesh.elements().iter().map(bound).collect();
        Self { world, solution, direct: DirectLight::new(world, extra_lights, seed), bounds, seed }
    }

    /// What arrives at a surface point on the side of the unit normal `n`; `sensor` keys its random streams.
    pub fn at(&self, surface: &Surface, n: Vec3, sensor: u64, scratch: &mut Scratch) -> Arriving {
        let key = rng::key(&[self.seed, sensor, 0x7365_6E73]);
        let start = offset_origin(surface.p, surface.p_error, surface.ng, n);
        let (p, normal) = (start.as_dvec3(), n.as_dvec3());
        let elements = self.solution.mesh.elements();
        scratch.found.clear();
        let mut total = 0.0;
        for (j, element) in elements.iter().enumerate() {
            let b = luminance(self.solution.radiosity[j]);
            let (centre, radius) = self.bounds[j];
            let d = centre - p;
            if b <= 0.0 || normal.dot(d) <= -radius || element.normal.dot(d) >= 0.0 {
                continue;
            }
            let factor = analytic::point_to_polygon(p, normal, element.corners(), &mut scratch.polygon);
            if factor > 0.0 {
                total += factor * b;
                scratch.found.push((j as u32, factor, b));
            }
        }
        let mut sum = [0.0; 3];
        let mut variance = 0.0;
        for k in 0..scratch.found.len() {
            let (j, factor, b) = scratch.found[k];
            let n_rays = (RAYS[0] * factor * b / total).ceil().clamp(1.0, RAYS[1]) as u32;
            let seen = self.visible(start, normal, j, n_rays, rng::mix(key ^ u64::from(j)), scratch);
            let b_j = self.solution.radiosity[j as usize];
            (0..3).for_each(|c| sum[c] += b_j[c] * factor * seen);
            variance += (factor * b).powi(2) * seen * (1.0 - seen) / f64::from(n_rays);
        }
        let irradiance = self.direct.at(surface, n, key) + Spectrum::from(sum.map(|s| s as f32));
        Arriving { irradiance, standard_error: variance.sqrt() }
    }

    /// `Σ V K / Σ K` over rays from a point to an element.
    fn visible(&self, from: Vec3, normal: DVec3, j: u32, n_rays: u32, key: u64, scratch: &mut Scratch) -> f64 {
        let element = &self.solution.mesh.elements()[j as usize];
        let en = element.normal.as_vec3();
        let error = Vec3::splat(element.corners().iter().map(|c| c.abs().max_element()).fold(0.0, f64::max) as f32 * gamma(16));
        scratch.rays.clear();
        scratch.kernel.clear();
        for k in 0..n_rays {
            let u = if n_rays == 1 { [0.5; 2] } else { sequence::point_2d(k, key).to_array().map(f64::from) };
            let target = offset_origin(element.at(u).as_vec3(), error, en, en);
            let d = target - from;
            let r2 = f64::from(d.length_squared());
            let kernel = normal.dot(d.as_dvec3()).max(0.0) * f64::from((-en.dot(d)).max(0.0)) / (r2 * r2);
            if kernel > 0.0 && kernel.is_finite() {
                scratch.rays.push(Ray { origin: from, dir: d, t_max: 1.0 });
                scratch.kernel.push(kernel);
            }
        }
        let (mut seen, mut all) = (0.0, 0.0);
        if self.world.has_transparency() {
            for (rays, kernel) in scratch.rays.chunks(8).zip(scratch.kernel.chunks(8)) {
                let eight = std::array::from_fn(|i| rays[i.min(rays.len() - 1)]);
                let passed = self.world.transmittances(&eight, rays.len(), true, &mut 0);
                for (k, v) in kernel.iter().zip(passed) {
                    seen += k * f64::from(v.r + v.g + v.b) / 3.0;
                    all += k;
                }
            }
        } else {
            self.world.accel().occluded_between(&scratch.rays, &mut scratch.occluder, &mut scratch.blocked);
            for (k, blocked) in scratch.kernel.iter().zip(&scratch.blocked) {
                seen += if *blocked { 0.0 } else { *k };
                all += k;
            }
        }
        if all > 0.0 { seen / all } else { 0.0 }
    }
}

/// Y of linear RGB, in f64.
fn luminance([r, g, b]: [f64; 3]) -> f64 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}
