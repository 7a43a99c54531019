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
        let without = |(h, d): (&[f64; 3], &[f64; 3])| std::array::from_fn(|c| (h[c] - d[c]).max(0.0));
        let irradiance: Cow<[[f64; 3]]> = if is_sharp {
            solution.irradiance.iter().zip(of_lamps).map(without).collect()
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

/// Averages what meets in one place and belongs to one smooth surface.
fn join(world: &World, mesh: &ElementMesh, corners: &mut [[Spectrum; 4]]) {
    let elements = mesh.elements();
    let bounds = world.accel().bounds();
    let grain = f64::from(bounds.extent().max_element()).max(f64::MIN_POSITIVE) * 1e-5;
    let scene = world.scene();
    let smooth: Vec<bool> = scene
        .instances
        .iter()
        .map(|i| matches!(i.geometry, Geometry::Mesh(id) if scene.meshes[id.index()].normals.is_some()))
        .collect();
    // Only corners on the border of a patch can meet others; inner ones have their value already.
    let mut at: HashMap<[i64; 3], Vec<(u32, u8)>> = HashMap::new();
    for (e, element) in elements.iter().enumerate() {
        let inner = mesh.is_inner(element);
        for (k, corner) in element.corners().iter().enumerate() {
            if !inner {
                let cell = (*corner / grain + DVec3::splat(0.317)).to_array().map(|x| x.round() as i64);
                at.entry(cell).or_default().push((e as u32, k as u8));
            }
        }
    }
    let mut places: Vec<_> = at.into_values().filter(|all| all.len() > 1).collect();
    places.sort_unstable();
    for place in places {
        let old: Vec<Spectrum> = place.iter().map(|&(e, k)| corners[e as usize][usize::from(k)]).collect();
        for (own, &(e, k)) in place.iter().enumerate() {
            let a = &elements[e as usize];
            let instance = mesh.patches()[a.patch as usize].instance;
            let (mut sum, mut n) = (Spectrum::BLACK, 0.0);
            for (other, &(f, _)) in place.iter().enumerate() {
                let b = &elements[f as usize];
                let together = other == own
                    || b.exposed() > 0.0
                        && {
                            let same = mesh.patches()[b.patch as usize].instance == instance;
                            a.normal.dot(b.normal) > if smooth[instance.index()] && same { SMOOTH } else { COPLANAR }
                        }
                        && (!may_be_parted(mesh, [a, b], [old[own], old[other]])
                            || corners::is_open(world, [a, b], a.corners()[usize::from(k)]));
                if together {
                    sum += old[other];
                    n += 1.0;
                }
            }
            let value = sum * (1.0 / n);
            corners[e as usize][usize::from(k)] = value;
            if k == 2 && a.corners().len() == 3 {
                corners[e as usize][3] = value;
            }
        }
    }
}
