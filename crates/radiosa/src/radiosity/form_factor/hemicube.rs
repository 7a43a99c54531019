//! The hemicube estimator: what an element sees, drawn on the five faces of half a cube around it.
//!
//! ```text
//! F_ij ≈ Σ ΔF over the pixels that show j
//! top    ΔF = ΔA / (π (x² + y² + 1)²)
//! sides  ΔF = z ΔA / (π (y² + z² + 1)²)
//! ```
//!
//! The faces are item buffers of the scan converter. ΔF is integrated over each pixel, not taken at its centre: the sum over all is 1, of which 0.554 belong to the top [Cohen85].
//!
//! **Cost**: drawing every patch above the horizon five times, and 3 R² pixels of resolution R, for each source point; no rays.
//!
//! **Error**, from three sources that more of one setting does not help against each other:
//! - *proximity*: the centre stands for the element. Relative error about (size/distance)², whatever the resolution; averaging over source points removes it;
//! - *visibility*: what the centre sees is taken for all of it; the same remedy;
//! - *aliasing*: pixels show one patch each, so a patch of solid angle ω has an error of about the pixels on its outline. Every source point has its
//!   cube turned by another random angle, which makes noise of the regular beats.
//!
//! Every mesh blocks, glass too; holes cut by alpha masks do not, and exact spheres and discs are not drawn.

use std::f64::consts::{FRAC_1_PI, PI};

use super::Sums;
use super::rule::{self, Turned};
use crate::accel::Hit;
use crate::math::function::atan_f64;
use crate::math::polygon::area_vector;
use crate::math::{DMat3, DVec3};
use crate::radiosity::medium::Medium;
use crate::radiosity::mesh::ElementMesh;
use crate::raster::{self, ItemBuffer, Projection, TILE, Tile, Triangle};
use crate::sampling::{rng, sequence};
use crate::transport::World;

/// Pixels across a face, at most.
const MAX_RESOLUTION: u32 = 4096;

/// Nearer than this fraction of the scene's size nothing is drawn.
const NEAR: f64 = 1e-7;

/// What is drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Pixels across a face, even; at most 4096.
    pub resolution: u32,
    /// Source points; 1 is the centre.
    pub points: u32,
}

impl Default for Settings {
    fn default() -> Self {
        Self { resolution: 128, points: 16 }
    }
}

/// The estimator over a mesh.
#[derive(Debug)]
pub struct Hemicube<'a> {
    world: &'a World,
    mesh: &'a ElementMesh,
    settings: Settings,
    medium: Medium,
    seed: u64,
    near: f64,
    /// ΔF of the top's pixels, row by row, and of the upper half of a side's.
    delta: [Vec<f64>; 2],
}

/// What a thread keeps between rows.
#[derive(Debug, Default)]
pub struct Scratch {
    buffer: ItemBuffer,
    /// With the pixels they may cover: least x and y, greatest x and y.
    triangles: Vec<(Triangle, [i32; 4])>,
}

impl<'a> Hemicube<'a> {
    pub(super) fn new(world: &'a World, mesh: &'a ElementMesh, settings: &Settings, medium: Medium, seed: u64) -> Self {
        let resolution = settings.resolution.clamp(2, MAX_RESOLUTION).next_multiple_of(2);
        let bounds = world.accel().bounds();
        let size = f64::from((bounds.max - bounds.min).length());
        Self {
            world,
            mesh,
            settings: Settings { resolution, points: settings.points.max(1) },
            medium,
            seed,
            near: if size > 0.0 && size.is_finite() { NEAR * size } else { NEAR },
            delta: [delta(resolution, resolution, of_top), delta(resolution, resolution / 2, of_side)],
        }
    }

    pub(super) fn row(&self, i: u32, sums: &mut Sums, scratch: &mut Scratch) {
        let element = &self.mesh.elements()[i as usize];
        let key = rng::key(&[self.seed, u64::from(i), 0x6375_6265]);
        let n = self.settings.points;
        for p in 0..n {
            let source = rule::source_point(element, sequence::point_2d(p, key), n);
            let turn = f64::from(rng::unit_f32((rng::mix(key ^ u64::from(p)) >> 32) as u32));
            let frame = Turned::new(element.normal, 2.0 * PI * turn);
            let share = source.area / (element.area * f64::from(n));
            let up = element.normal;
            // (forward × up is to the right)
            self.face(element.patch, source.p, up, [up, frame.s], &self.delta[0], share, sums, scratch);
            for forward in [frame.s, frame.t, -frame.s, -frame.t] {
                self.face(element.patch, source.p, up, [forward, up], &self.delta[1], share, sums, scratch);
            }
        }
    }

    /// Draws what is above the horizon at `eye` on one face and adds up its pixels; `delta` says how many of its rows count.
    #[allow(clippy::too_many_arguments)]
    fn face(
        &self,
        own: u32,
        eye: DVec3,
        normal: DVec3,
        [forward, up]: [DVec3; 2],
        delta: &[f64],
        share: f64,
        sums: &mut Sums,
        scratch: &mut Scratch,
    ) {
        let resolution = self.settings.resolution;
        let n_rows = delta.len() as u32 / resolution;
        let right = forward.cross(up);
        let basis = DMat3::from_cols(right, up, -forward);
        let projection = Projection::perspective(eye, &basis, 0.5 * PI, f64::from(resolution), self.near);
        self.set_up(own, &projection, normal, n_rows, &mut scratch.triangles);
        let half = 0.5 * f64::from(resolution);
        let path = self.world.cpu_path();
        for y0 in (0..n_rows).step_by(TILE as usize) {
            for x0 in (0..resolution).step_by(TILE as usize) {
                let (x1, y1) = ((x0 + TILE).min(resolution), (y0 + TILE).min(n_rows));
                let tile = Tile::of_picture(x0, y0, resolution, resolution, [0.0; 2]);
                scratch.buffer.clear();
                for (triangle, [left, top, right, bottom]) in &scratch.triangles {
                    if *left < x1 as i32 && *right >= x0 as i32 && *top < y1 as i32 && *bottom >= y0 as i32 {
                        scratch.buffer.draw(path, triangle, &tile, triangle.face);
                    }
                }
                for y in y0..y1 {
                    let row = &scratch.buffer.items()[((y - y0) * TILE) as usize..][..(x1 - x0) as usize];
                    for (x, &patch) in (x0..x1).zip(row).filter(|(_, patch)| **patch != raster::depth::NOTHING) {
                        let [u, v] = [x, y].map(|k| (f64::from(k) + 0.5) / half - 1.0);
                        if let Some((j, distance)) = self.element_seen(patch, eye, forward + right * u - up * v) {
                            sums.add_through(&self.medium, distance, j, delta[(y * resolution + x) as usize] * share);
                        }
                    }
                }
            }
        }
    }

    /// The triangles of every patch above the horizon.
    fn set_up(&self, own: u32, projection: &Projection, normal: DVec3, n_rows: u32, out: &mut Vec<(Triangle, [i32; 4])>) {
        out.clear();
        let resolution = self.settings.resolution;
        let first = Tile::of_picture(0, 0, resolution, resolution, [0.0; 2]).first;
        for (index, patch) in self.mesh.patches().iter().enumerate().filter(|&(index, _)| index != own as usize) {
            let corners = patch.corners();
            if corners.iter().all(|c| (*c - projection.eye()).dot(normal) <= self.near) {
                continue;
            }
            let corners = corners.iter().map(|c| projection.project(c.as_vec3()));
            let mut seen = [projection.project(patch.corners()[0].as_vec3()); 4];
            let n = corners.zip(&mut seen).map(|(from, to)| *to = from).count();
            let mut polygon = [seen[0]; raster::clip::MAX_CORNERS];
            for k in 2..n {
                let face = [seen[0], seen[k - 1], seen[k]];
                let plane = projection.depth_plane(&face);
                let n = raster::clip(projection, &face, &mut polygon);
                let place = |i: usize| raster::scan::snap(&polygon[i]);
                for k in 2..n {
                    let Some(mut triangle) = Triangle::new([place(0), place(k - 1), place(k)], index as u32) else { continue };
                    let Some(pixels) = triangle.pixels(first, 0) else { continue };
                    let [left, top, right, bottom] = pixels;
                    if right < 0 || bottom < 0 || left >= resolution as i32 || top >= n_rows as i32 {
                        continue;
                    }
                    triangle.plane = plane;
                    if face.iter().all(|v| v.z >= projection.near()) {
                        let depths = face.map(|v| projection.depth(&v) as f32);
                        triangle.depth_range = [depths[0].min(depths[1]).min(depths[2]), depths[0].max(depths[1]).max(depths[2])];
                    }
                    out.push((triangle, pixels));
                }
            }
        }
    }

    /// The cell of a patch that a ray meets, and how far away, where that is asked for; `None` where it meets a side that takes no part.
    fn element_seen(&self, patch: u32, eye: DVec3, dir: DVec3) -> Option<(u32, f64)> {
        let n_elements = self.mesh.n_on_side(patch as usize);
        let patch = &self.mesh.patches()[patch as usize];
        let mut p = DVec3::ZERO;
        if n_elements > 1 || !self.medium.is_clear() {
            let n = area_vector(patch.corners());
            p = eye + dir * ((patch.corners()[0] - eye).dot(n) / dir.dot(n));
        }
        let hit = Hit { t: 0.0, instance: patch.instance.0, primitive: patch.triangles[0], u: 0.0, v: 0.0 };
        self.mesh.element_at(&hit, p.as_vec3(), dir.as_vec3()).map(|j| (j, (p - eye).length()))
    }
}

/// ΔF of the pixels of a face of `width` pixels across, its upper `height` rows: `corner` is the integral over the rectangle from the face's middle to `(x, y)`, y up.
fn delta(width: u32, height: u32, corner: fn(f64, f64) -> f64) -> Vec<f64> {
    let half = 0.5 * f64::from(width);
    let edge = |k: u32| f64::from(k) / half - 1.0;
    let pixel = |x: u32, y: u32| {
        let (x0, x1, y0, y1) = (edge(x), edge(x + 1), -edge(y + 1), -edge(y));
        corner(x1, y1) - corner(x0, y1) - corner(x1, y0) + corner(x0, y0)
    };
    (0..width * height).map(|k| pixel(k % width, k / width)).collect()
}

/// `∫_0^x ∫_0^y 1/(π (x² + y² + 1)²)`: the factor from a point to a rectangle above it with one corner on its normal.
fn of_top(x: f64, y: f64) -> f64 {
    let (a, b) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
    0.5 * FRAC_1_PI * (x / a * atan_f64(y / a) + y / b * atan_f64(x / b))
}

/// `−∫_0^y ∫_z^∞ z/(π (y² + z² + 1)²)`: the same for a rectangle that stands upright.
fn of_side(y: f64, z: f64) -> f64 {
    let a = (1.0 + z * z).sqrt();
    -0.5 * FRAC_1_PI * atan_f64(y / a) / a
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn delta_factors_sum_to_one_and_are_close_to_those_of_pixel_centres() {
        for n in [2, 50, 100] {
            let [top, side] = [delta(n, n, of_top), delta(n, n / 2, of_side)];
            let sum = |delta: &[f64]| delta.iter().sum::<f64>();
            assert!((sum(&top) - 0.554_126_424).abs() < 1e-8 && (sum(&side) - 0.111_468_394).abs() < 1e-8, "{n}");
            let centre = |k: u32| (f64::from(k) + 0.5) * 2.0 / f64::from(n) - 1.0;
            let area = 4.0 / f64::from(n * n);
            let at = |k: usize| (centre(k as u32 % n), -centre(k as u32 / n));
            let of_centre = |(x, y): (f64, f64), z: f64| z * area * FRAC_1_PI / (x * x + y * y + 1.0).powi(2);
            let all: f64 = (0..top.len()).map(|k| of_centre(at(k), 1.0)).sum::<f64>()
                + 4.0 * (0..side.len()).map(|k| of_centre(at(k), at(k).1)).sum::<f64>();
            let known = match n {
                50 => 1.000_217,
                100 => 1.000_054,
                _ => continue,
            };
            assert!((all - known).abs() < 1e-6, "{n}: {all}");
            for (k, delta) in side.iter().enumerate() {
                assert!((delta / of_centre(at(k), at(k).1) - 1.0).abs() < 5.0 / f64::from(n), "{k}");
            }
        }
    }
}
