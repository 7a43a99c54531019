//! A solution seen from somewhere: irradiance interpolated between the corners of elements, times what the surface reflects there.
//!
//! ```text
//! L = L_e + ρ(x)/π · (D(x) + Σ_corners w_k (H_k − D_k))
//! ```
//!
//! D is the light of lamps (points, spots, suns), whose shadows are sharper than elements are small: it is computed for every picture sample, or taken from the elements
//! too ([`Lamps`]). In an absorbing medium the eye sees what is left of L on its way.
//!
//! Irradiance and not radiosity is interpolated, so that textures keep their own detail. Corner values are extrapolated from the elements around: across a
//! patch by its rows and columns, and averaged with those of neighbours that continue the surface, but not across creases. A side that takes no part in the
//! solution is black. Where elements end at the borders of shadows, the light of emitting surfaces is gathered at their corners ([`super::gather`]).

use std::borrow::Cow;
use std::collections::HashMap;

use rayon::prelude::*;

use super::corners;
use super::direct::DirectLight;
use super::gather::shadows;
use super::mesh::{Element, ElementMesh};
use super::sides::Side;
use super::solution::Solution;
use crate::accel::Hit;
use crate::film::Pixel;
use crate::math::{DVec3, Ray, Vec3};
use crate::radiometry::lambertian_radiance;
use crate::sampling::Stream;
use crate::scene::{Geometry, Light};
use crate::spectrum::Spectrum;
use crate::transport::eye::Straight;
use crate::transport::{Footprint, Integrator, LocalLight, World};

/// Cosine of the angle up to which faces of a mesh with vertex normals are one smooth surface.
const SMOOTH: f64 = 0.7;
/// The same for faces without: they must lie in one plane.
const COPLANAR: f64 = 1.0 - 1e-6;

/// How values are spread over elements.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// One value an element.
    Flat,
    /// Between its corners.
    #[default]
    Gouraud,
}

/// Where pictures have the light of lamps from, which have a place or a direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Lamps {
    /// Computed at every sample, with shadow rays.
    #[default]
    Sharp,
    /// From the elements, as all other light.
    Elements,
}

/// How a solution is displayed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Settings {
    /// How values are spread over elements.
    pub interpolation: Interpolation,
    /// Where the light of lamps comes from.
    pub lamps: Lamps,
    /// What pictures hold.
    pub shown: Shown,
    /// What an unfinished solution has not sent out yet is spread evenly over all surfaces ([`Solution::ambient`]).
    pub has_ambient: bool,
}

/// What a picture of a solution holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Shown {
    /// Radiance, as a camera sees it.
    #[default]
    Radiance,
    /// The irradiance of surfaces, without what they are made of.
    Irradiance,
}

/// A solution ready to be looked at.
#[derive(Debug)]
pub struct Display<'a> {
    mesh: &'a ElementMesh,
    /// Irradiance at the corners of each element, in their order, but for what comes from `lamps`.
    corners: Vec<[Spectrum; 4]>,
    lamps: Option<DirectLight<'a>>,
    straight: Straight,
    shown: Shown,
}

impl<'a> Display<'a> {
    /// Spreads the irradiance of a solution over its elements. `extra_lights` are those it was solved with beside the scene's own.
    pub fn new(
        world: &'a World,
        solution: &'a Solution,
        extra_lights: &[Light],
        settings: Settings,
        footprint: Footprint,
    ) -> Self {
        let mesh = &solution.mesh;
        let lamps = DirectLight::new(world, extra_lights, 0).within(solution.system.medium);
        let of_lamps = &solution.system.lamps;
        let is_sharp = settings.lamps == Lamps::Sharp && lamps.has_lamps() && !of_lamps.is_empty();
        let ambient = if settings.has_ambient { solution.ambient() } else { [0.0; 3] };
        let without = |(h, d): (&[f64; 3], &[f64; 3])| std::array::from_fn(|c| (h[c] - d[c]).max(0.0) + ambient[c]);
        let irradiance: Cow<[[f64; 3]]> = if is_sharp {
            solution.irradiance.iter().zip(of_lamps).map(without).collect()
        } else if settings.has_ambient {
            solution.irradiance.iter().map(|h| without((h, &[0.0; 3]))).collect()
        } else {
            Cow::Borrowed(&solution.irradiance)
        };
        let corners = match settings.interpolation {
            Interpolation::Flat => irradiance.iter().map(|h| [spectrum(*h); 4]).collect(),
            Interpolation::Gouraud => {
                shadows::corner_values(world, solution, extra_lights, &irradiance, (!is_sharp).then_some(&lamps))
            }
        };
        let absorption = Spectrum::from(solution.system.medium.absorption.map(|s| s as f32));
        let straight = Straight { has_backdrop: false, footprint, absorption };
        Self { mesh, corners, lamps: is_sharp.then_some(lamps), straight, shown: settings.shown }
    }

    /// The default light's backdrop stands behind everything.
    pub fn with_backdrop(mut self, has_backdrop: bool) -> Self {
        self.straight.has_backdrop = has_backdrop;
        self
    }

    /// H where a ray of direction `dir` met the surface at `p`, interpolated; `None` on a side that takes no part. Without the light of lamps where that
    /// is computed for every sample.
    pub fn irradiance_at(&self, hit: &Hit, p: Vec3, dir: Vec3) -> Option<Spectrum> {
        let (element, weights) = self.mesh.weights_at(hit, p, dir)?;
        Some(self.corners[element as usize].iter().zip(weights).map(|(h, w)| *h * w).sum())
    }
}

impl Integrator for Display<'_> {
    fn sample(&self, world: &World, ray: &Ray, _stream: &mut Stream, n_rays: &mut u64) -> Pixel {
        if self.shown == Shown::Irradiance {
            *n_rays += 1;
            let Some((hit, surface)) = world.closest_visible(ray) else { return Pixel::default() };
            let n = world.shading(&surface, -ray.dir).n;
            let indirect = self.irradiance_at(&hit, surface.p, ray.dir).unwrap_or(Spectrum::BLACK);
            let direct = self.lamps.as_ref().map_or(Spectrum::BLACK, |lamps| lamps.of_lamps(&surface, n));
            let h = direct + indirect;
            return Pixel { color: h, diffuse: h, direct, indirect, alpha: 1.0, ..Pixel::default() };
        }
        self.straight.sample(world, ray, n_rays, |hit, surface, shading, n_rays| {
            let reflected = |irradiance| lambertian_radiance(shading.bsdf.diffuse_reflectance(), irradiance);
            let indirect = reflected(self.irradiance_at(hit, surface.p, ray.dir).unwrap_or(Spectrum::BLACK));
            let direct = self.lamps.as_ref().map_or(Spectrum::BLACK, |lamps| {
                *n_rays += 1;
                reflected(lamps.of_lamps(surface, shading.n))
            });
            (LocalLight { diffuse: direct + indirect, ..LocalLight::default() }, indirect)
        })
    }
}

fn spectrum(v: [f64; 3]) -> Spectrum {
    v.map(|x| x as f32).into()
}

/// A value at the corners of every element, in their order, from one value each (of triangles the last is there twice).
pub fn corner_values(world: &World, mesh: &ElementMesh, values: &[[f64; 3]]) -> Vec<[Spectrum; 4]> {
    let mut corners = vec![[Spectrum::BLACK; 4]; values.len()];
    for (patch_index, (patch, grid)) in mesh.patches().iter().zip(mesh.grids()).enumerate() {
        for side in [Side::Front, Side::Back] {
            let Some(first) = grid.first[side as usize] else { continue };
            let n = grid.n.map(|n| n as usize);
            let range = first as usize..first as usize + mesh.n_on_side(patch_index);
            let weighed = values[range.clone()].iter().zip(&mesh.elements()[range.clone()]);
            let cells: Vec<Cell> = weighed.map(|(value, e)| Cell { value: *value, weight: e.exposed() }).collect();
            let out = &mut corners[range];
            if mesh.is_split(patch_index) {
                corners::extrapolate(world, mesh, first as usize, values, out);
            } else if patch.is_quad() {
                of_quad(n, &cells, side, out);
            } else {
                of_triangle(n[0], &cells, side, out);
            }
        }
    }
    join(world, mesh, &mut corners);
    corners
}

/// A value and how much it counts: that of a cell, by the fraction of it that is exposed, or that of a node between cells.
#[derive(Clone, Copy, Debug, Default)]
struct Cell {
    value: [f64; 3],
    weight: f64,
}

/// Values at the nodes of a row from those of its cells: weighted means inside, extrapolated at the ends but neither below half nor above twice the end's own.
fn nodes(cells: impl Fn(usize) -> Cell, n: usize, out: &mut Vec<Cell>) {
    out.clear();
    let end = |end: usize, next: Option<usize>| {
        let end = cells(end);
        let Some(next) = next.map(&cells).filter(|next| next.weight > 0.5 && end.weight > 0.5) else { return end };
        let towards =
            |c: usize| (1.5 * end.value[c] - 0.5 * next.value[c]).max(0.5 * end.value[c]).min(2.0 * end.value[c].max(0.0));
        Cell { value: std::array::from_fn(towards), weight: end.weight }
    };
    out.push(end(0, (n > 1).then_some(1)));
    out.extend((1..n).map(|k| {
        let (a, b) = (cells(k - 1), cells(k));
        let weight = a.weight + b.weight;
        let share = if weight > 0.0 { a.weight / weight } else { 0.5 };
        Cell { value: std::array::from_fn(|c| share * a.value[c] + (1.0 - share) * b.value[c]), weight: 0.5 * weight }
    }));
    out.push(end(n - 1, n.checked_sub(2)));
}

/// A regular grid: rows first, then columns.
fn of_quad([n, m]: [usize; 2], cells: &[Cell], side: Side, out: &mut [[Spectrum; 4]]) {
    let mut row = Vec::new();
    let mut half = Vec::with_capacity((n + 1) * m);
    for j in 0..m {
        nodes(|i| cells[j * n + i], n, &mut row);
        half.extend_from_slice(&row);
    }
    let mut grid = vec![[0.0; 3]; (n + 1) * (m + 1)];
    for i in 0..=n {
        nodes(|j| half[j * (n + 1) + i], m, &mut row);
        row.iter().enumerate().for_each(|(j, v)| grid[j * (n + 1) + i] = v.value);
    }
    for (k, corners) in out.iter_mut().enumerate() {
        let (i, j) = (k % n, k / n);
        *corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)].map(|(i, j)| spectrum(grid[j * (n + 1) + i]));
        if side == Side::Back {
            corners.reverse();
        }
    }
}

/// A triangle's lattice: means of the cells around.
fn of_triangle(n: usize, cells: &[Cell], side: Side, out: &mut [[Spectrum; 4]]) {
    let node = |i: usize, j: usize| j * (n + 1) + i;
    let mut sums = vec![([0.0; 3], 0.0); (n + 1) * (n + 1)];
    let of_cell = |k: usize| {
        let (i, j, upper) = super::mesh::triangle_cell(n as u32, k as u32);
        let (i, j) = (i as usize, j as usize);
        if upper { [node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)] } else { [node(i, j), node(i + 1, j), node(i, j + 1)] }
    };
    for (k, cell) in cells.iter().enumerate() {
        for at in of_cell(k) {
            (0..3).for_each(|c| sums[at].0[c] += cell.value[c] * cell.weight);
            sums[at].1 += cell.weight;
        }
    }
    for (k, corners) in out.iter_mut().enumerate() {
        let mut three = of_cell(k).map(|at| spectrum(sums[at].0.map(|s| if sums[at].1 > 0.0 { s / sums[at].1 } else { 0.0 })));
        if side == Side::Back {
            three.reverse();
        }
        *corners = [three[0], three[1], three[2], three[2]];
    }
}

/// Something may stand between two elements where they meet: a contact line is known there, or their light steps. Where a surface ends just where another
/// stands on it, no element was cut.
fn may_be_parted(mesh: &ElementMesh, [a, b]: [&Element; 2], [u, v]: [Spectrum; 2]) -> bool {
    const STEP: f32 = 0.1;
    mesh.is_at_contact(a)
        || mesh.is_at_contact(b)
        || (u - v).map(f32::abs).max_channel() > STEP * u.max_channel().max(v.max_channel())
}

/// Whether what meets at `at` is one smooth surface, of which nothing stands between.
struct Together<'a> {
    world: &'a World,
    mesh: &'a ElementMesh,
    /// By instance: it has vertex normals.
    smooth: Vec<bool>,
}

impl<'a> Together<'a> {
    fn new(world: &'a World, mesh: &'a ElementMesh) -> Self {
        let scene = world.scene();
        let has_normals = |g: &Geometry| matches!(g, Geometry::Mesh(id) if scene.meshes[id.index()].normals.is_some());
        Self { world, mesh, smooth: scene.instances.iter().map(|i| has_normals(&i.geometry)).collect() }
    }

    /// The cosine of the angle up to which two elements are one surface.
    fn least_cosine(&self, a: &Element, b: &Element) -> f64 {
        let instance = |e: &Element| self.mesh.patches()[e.patch as usize].instance;
        if self.smooth[instance(a).index()] && instance(a) == instance(b) { SMOOTH } else { COPLANAR }
    }

    /// For elements `a` and `b` with those values there.
    fn are(&self, [a, b]: [&Element; 2], values: [Spectrum; 2], at: DVec3) -> bool {
        b.exposed() > 0.0
            && a.normal.dot(b.normal) > self.least_cosine(a, b)
            && (!may_be_parted(self.mesh, [a, b], values) || corners::is_open(self.world, [a, b], at))
    }
}

/// Corners that hang on others that hang on others.
const MOST_TURNS: usize = 16;

/// Where more corners than that meet, as at the tip of a cone or in what is too small to be told apart, each keeps its own value.
const MOST_CORNERS: usize = 256;

/// An element and which of its corners.
type Corner = (u32, u8);

/// The corners on borders of patches, and in patches with divided cells, by where they are. (Others have the same value as their neighbours already.)
fn places(world: &World, mesh: &ElementMesh) -> Vec<Vec<Corner>> {
    let extent = f64::from(world.accel().bounds().extent().max_element()).max(f64::MIN_POSITIVE);
    let edge = |e: &Element| e.corners().windows(2).map(|c| (c[1] - c[0]).length()).fold(f64::INFINITY, f64::min);
    let shortest = mesh.elements().iter().map(edge).fold(f64::INFINITY, f64::min);
    // Finer than elements, but not than the rounding of files.
    let grain = (1e-2 * shortest).clamp(1e-6 * extent, 1e-5 * extent);
    let mut at: HashMap<[i64; 3], Vec<Corner>> = HashMap::new();
    for (e, element) in mesh.elements().iter().enumerate() {
        let inner = mesh.is_inner(element);
        for (k, corner) in element.corners().iter().enumerate() {
            if !inner {
                let cell = (*corner / grain + DVec3::splat(0.317)).to_array().map(|x| x.round() as i64);
                at.entry(cell).or_default().push((e as u32, k as u8));
            }
        }
    }
    let mut places: Vec<_> = at.into_values().filter(|place| place.len() <= MOST_CORNERS).collect();
    places.sort_unstable();
    places
}

fn set(mesh: &ElementMesh, corners: &mut [[Spectrum; 4]], (e, k): Corner, value: Spectrum) {
    corners[e as usize][usize::from(k)] = value;
    if k == 2 && mesh.elements()[e as usize].corners().len() == 3 {
        corners[e as usize][3] = value;
    }
}

/// Averages what meets in one place and belongs to one smooth surface, then lets corners in the middle of another element's edge have what is there.
fn join(world: &World, mesh: &ElementMesh, corners: &mut [[Spectrum; 4]]) {
    let (elements, together, places) = (mesh.elements(), Together::new(world, mesh), places(world, mesh));
    for place in places.iter().filter(|place| place.len() > 1) {
        let old: Vec<Spectrum> = place.iter().map(|&(e, k)| corners[e as usize][usize::from(k)]).collect();
        for (own, &(e, k)) in place.iter().enumerate() {
            let a = &elements[e as usize];
            let (mut sum, mut n) = (Spectrum::BLACK, 0.0);
            for (other, &(f, _)) in place.iter().enumerate() {
                if other == own || together.are([a, &elements[f as usize]], [old[own], old[other]], a.corners()[usize::from(k)]) {
                    sum += old[other];
                    n += 1.0;
                }
            }
            set(mesh, corners, (e, k), sum * (1.0 / n));
        }
    }
    let mut hanging: Vec<(u32, Corner)> = places.par_iter().flat_map_iter(|place| hanging(&together, place)).collect();
    // Of several edges that a corner is on the one of the largest element counts.
    let area = |e: u32| elements[e as usize].whole_area;
    hanging.sort_by(|(a, at), (b, other)| at.cmp(other).then(area(*b).total_cmp(&area(*a))).then(a.cmp(b)));
    let place = |(e, k): Corner| elements[e as usize].corners()[usize::from(k)];
    let there = |corners: &[[Spectrum; 4]], on: u32, corner: Corner| -> Spectrum {
        corners[on as usize].iter().zip(elements[on as usize].weights(place(corner))).map(|(h, w)| *h * w).sum()
    };
    hanging.retain(|&(on, corner)| {
        let values = [corners[corner.0 as usize][usize::from(corner.1)], there(corners, on, corner)];
        let pair = [&elements[corner.0 as usize], &elements[on as usize]];
        together.are(pair, values, beside(pair, usize::from(corner.1)))
    });
    hanging.dedup_by_key(|(_, corner)| *corner);
    // Ends of such edges may hang on others in their turn.
    for _ in 0..MOST_TURNS {
        let mut has_changed = false;
        for &(on, corner) in &hanging {
            let (old, new) = (corners[corner.0 as usize][usize::from(corner.1)], there(corners, on, corner));
            has_changed |= (old - new).map(f32::abs).max_channel() > 1e-5 * new.max_channel();
            set(mesh, corners, corner, new);
        }
        if !has_changed {
            break;
        }
    }
}

/// Where two elements meet close to a corner `k` of the first that lies on an edge of the second. (In the corner of a room itself its walls would be in the way.)
fn beside([a, on]: [&Element; 2], k: usize) -> DVec3 {
    const ALONG: f64 = 0.1;
    let c = a.corners();
    let along = |next: usize| c[k] + (c[next] - c[k]) * ALONG;
    let beside = [(k + 1) % c.len(), (k + c.len() - 1) % c.len()].map(along);
    beside.into_iter().find(|&p| is_on_edge(on, p)).unwrap_or(c[k])
}

/// A point lies on an edge of an element, or close to it.
fn is_on_edge(element: &Element, p: DVec3) -> bool {
    const CLOSE: f64 = 1e-5;
    let c = element.corners();
    (0..c.len()).any(|i| {
        let (start, along) = (c[i], c[(i + 1) % c.len()] - c[i]);
        let t = ((p - start).dot(along) / along.length_squared()).clamp(0.0, 1.0);
        (start + along * t - p).length() < CLOSE * element.whole_area.sqrt()
    })
}

/// Of the corners in one place those in the middle of an element's edge, each with that element: Gouraud's values would jump along it.
///
/// Where elements close up around a place there is none. Elsewhere it is looked across both edges of each of them, close to the place.
fn hanging(together: &Together, place: &[Corner]) -> Vec<(u32, Corner)> {
    const ASIDE: f64 = 1e-2;
    let (world, mesh) = (together.world, together.mesh);
    let elements = mesh.elements();
    let angle = |&(e, k): &Corner| {
        let c = elements[e as usize].corners();
        let (k, n) = (usize::from(k), c.len());
        (c[(k + 1) % n] - c[k]).angle_between(c[(k + n - 1) % n] - c[k])
    };
    let mut found = Vec::new();
    for &(e, k) in place {
        let a = &elements[e as usize];
        let around = place.iter().filter(|&&(f, _)| {
            let b = &elements[f as usize];
            f == e || a.normal.dot(b.normal) > together.least_cosine(a, b)
        });
        if around.map(angle).sum::<f64>() > 1.9 * std::f64::consts::PI {
            continue;
        }
        let (c, k) = (a.corners(), usize::from(k));
        for next in [(k + 1) % c.len(), (k + c.len() - 1) % c.len()] {
            let along = c[next] - c[k];
            let outwards = if next == (k + 1) % c.len() { along.cross(a.normal) } else { a.normal.cross(along) };
            let p = c[k] + (along + outwards) * ASIDE;
            let high = a.normal * (ASIDE * along.length());
            let ray = Ray { origin: a.lift().in_front(p + high), dir: (high * -2.0).as_vec3(), t_max: 1.0 };
            let Some((hit, surface)) = world.closest_visible(&ray) else { continue };
            if let Some(on) = mesh.element_at(&hit, surface.p, ray.dir)
                && place.iter().all(|&(f, _)| f != on)
                && is_on_edge(&elements[on as usize], c[k])
            {
                found.extend(place.iter().map(|&corner| (on, corner)));
            }
        }
    }
    found.sort_unstable();
    found.dedup();
    found
}

#[cfg(test)]
mod tests {
    use super::super::{mesh, refine, solution};
    use super::*;
    use crate::math::CpuPath;

    /// Edges where a smaller element ends: the difference between values on both sides relative to the mean of all, rising. Without those above which something may stand.
    fn jumps(together: &Together, corners: &[[Spectrum; 4]]) -> Vec<f32> {
        let (mesh, elements) = (together.mesh, together.mesh.elements());
        let at = |e: usize, p: DVec3| -> Spectrum { corners[e].iter().zip(elements[e].weights(p)).map(|(h, w)| *h * w).sum() };
        let mean = corners.iter().map(|c| c[0].g).sum::<f32>() / corners.len() as f32;
        let mut jumps = Vec::new();
        for (e, element) in elements.iter().enumerate().filter(|(_, e)| !mesh.is_at_contact(e)) {
            let c = element.corners();
            for (k, f) in mesh.neighbours(element).enumerate() {
                let other = &elements[f];
                if element.whole_area < 0.9 * other.whole_area && !mesh.is_at_contact(other) {
                    let along = |share: f64| c[k] * (1.0 - share) + c[(k + 1) % c.len()] * share;
                    let jump = |p| (at(e, p) - at(f, p)).map(f32::abs).max_channel() / mean;
                    jumps.push([0.0, 0.3, 0.8, 1.0].map(along).map(jump).into_iter().fold(0.0, f32::max));
                }
            }
        }
        jumps.sort_unstable_by(f32::total_cmp);
        jumps
    }

    #[test]
    fn shading_does_not_jump_where_a_corner_lies_in_the_middle_of_an_edge() {
        let scene = crate::import::sample::load("cornell-box").expect("it is built in");
        let world = World::prepare(scene, CpuPath::detect()).expect("it is valid");
        let settings = solution::Settings {
            mesh: mesh::Settings { elements: 600, ..Default::default() },
            refine: refine::Settings { levels: 2, threshold: 0.2, ..Default::default() },
            ..Default::default()
        };
        let solution = solution::solve(&world, &settings);
        let together = Together::new(&world, &solution.mesh);
        let corners = corner_values(&world, &solution.mesh, &solution.irradiance);
        let found = jumps(&together, &corners);
        let at = |part: f64| found[(part * (found.len() - 1) as f64) as usize];
        assert!(at(0.9) < 1e-4 && at(0.98) < 5e-3 && found.len() > 100, "jumps of {} and {}", at(0.9), at(0.98));
        // The twin: every element's own extrapolation.
        let mut apart = corners;
        for (patch, grid) in solution.mesh.grids().iter().enumerate().filter(|(p, _)| solution.mesh.is_split(*p)) {
            for first in grid.first.into_iter().flatten() {
                let range = first as usize..first as usize + solution.mesh.n_on_side(patch);
                corners::extrapolate(&world, &solution.mesh, range.start, &solution.irradiance, &mut apart[range]);
            }
        }
        let of_twin = jumps(&together, &apart);
        assert!(of_twin[of_twin.len() / 2] > 0.01, "the twin's are as small as {}", of_twin[of_twin.len() / 2]);
    }

    #[test]
    fn what_is_unshot_may_be_shown_as_spread_over_all_surfaces() {
        let scene = crate::import::sample::load("cornell-box").expect("it is built in");
        let world = World::prepare(scene, CpuPath::detect()).expect("it is valid");
        let mut settings = solution::Settings {
            mesh: mesh::Settings { elements: 300, ..Default::default() },
            solver: super::super::solve::Solver::Shooting(Default::default()),
            ..Default::default()
        };
        let truth = solution::solve(&world, &settings);
        settings.stop.steps = 2;
        let early = solution::solve(&world, &settings);
        let mean = |solution: &Solution, has_ambient| {
            let shown = Settings { interpolation: Interpolation::Flat, has_ambient, ..Settings::default() };
            let display = Display::new(&world, solution, &[], shown, Footprint::default());
            display.corners.iter().map(|c| f64::from(c[0].g)).sum::<f64>() / display.corners.len() as f64
        };
        let (before, with, converged) = (mean(&early, false), mean(&early, true), mean(&truth, true));
        assert!((converged / mean(&truth, false) - 1.0).abs() < 1e-5, "nothing is left to spread");
        assert!((with - before - early.ambient()[1]).abs() < 1e-6, "{before} without, {with} with");
        assert!((with - converged).abs() < (before - converged).abs(), "{before} without, {with} with, {converged} in the end");
    }
}
