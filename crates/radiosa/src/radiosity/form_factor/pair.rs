//! The analytic estimator: exchange areas of pairs of elements, exact but for a tolerance where nothing is between them, times the visible fraction.
//!
//! Which rule is exact enough is decided by the size of the pair against its distance, `q = (R_i + R_j)/d` (R: radius around the
//! centre): the product rule of Gauss with `n` points a side errs by about `q^(2n)`. Pairs too close for eight points, and those that
//! cross each other's planes, take the contour integral ([`super::analytic::exchange_area`]).

use std::f64::consts::FRAC_1_PI;

use rayon::prelude::*;

use super::Exchange;
use super::absorbed::absorbed;
use super::analytic;
use super::cull::Blocks;
use super::occluded::{self, Estimate, Outline};
use super::rule::{self, Node};
use super::visibility::{self, Visibility};
use crate::math::lanes::{Cpu, for_each_cpu};
use crate::math::polygon::area_vector;
use crate::math::{CpuPath, DVec3};
use crate::radiosity::medium::Medium;
use crate::radiosity::mesh::{Element, ElementMesh};
use crate::radiosity::patch::Patch;
use crate::scene::Geometry;
use crate::transport::World;

/// More occluders than this are not tried one by one for every pair.
const MAX_OCCLUDERS: usize = 1024;

/// The same where shadows are sampled: a few rays take as long as so many tests.
const FEW_OCCLUDERS: usize = 32;

/// With more patches than this nobody asks which of them are occluders.
const MAX_PATCHES: usize = 8192;

/// Up to as many patches, what may lie between each two of them is found once.
const FEW_PATCHES: usize = 256;

/// How exact, and with how many rays.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Relative error of a factor without occluders.
    pub tolerance: f64,
    /// Rays between two elements, and in all when some of them are blocked; at most 64.
    pub rays: [usize; 2],
    /// Cuts the shadows of what stands between two elements out of what they exchange, until the factor is about this exact, in place of rays;
    /// where nothing but opaque polygons blocks, and no more than 1024 of them.
    pub clip: Option<f64>,
}

impl Default for Settings {
    fn default() -> Self {
        Self { tolerance: 1e-3, rays: [16, 64], clip: None }
    }
}

/// All pairs of a mesh.
#[derive(Debug)]
pub struct Pairs<'a> {
    elements: &'a [Element],
    visibility: Visibility<'a>,
    medium: Medium,
    tolerance: f64,
    path: CpuPath,
    /// The greatest q for which the rule of 1, 2, 3, 4, 6 and 8 points a side is exact enough.
    reach: [f64; 6],
    /// By element.
    bounds: Vec<Bound>,
    /// Four and nine points of each element.
    nodes: [Vec<Node>; 2],
    clip: Option<f64>,
    occluders: Option<Occluders<'a>>,
    blocks: Option<Blocks>,
}

/// What may stand between elements.
#[derive(Debug)]
struct Occluders<'a> {
    polygons: Vec<Outline<'static>>,
    /// By element.
    elements: Vec<Outline<'a>>,
    n_patches: usize,
    /// For each pair of patches, the lower first: the polygons that may stand between them. Empty when there are too many pairs.
    between: Vec<Vec<u32>>,
}

/// Where an element is and how large.
#[derive(Clone, Copy, Debug)]
struct Bound {
    centre: Node,
    radius: f64,
}

/// What a thread keeps between pairs.
#[derive(Debug, Default)]
pub struct Scratch {
    visibility: visibility::Scratch,
    occluded: occluded::Scratch,
}

impl<'a> Pairs<'a> {
    /// Prepares the points of every element.
    pub fn new(world: &'a World, mesh: &'a ElementMesh, settings: &Settings, medium: Medium) -> Self {
        let pairs = Self::for_links(world, mesh, settings, medium);
        let blocks = if pairs.occluders.is_none() { Blocks::new(pairs.elements, &pairs.visibility) } else { None };
        Self { blocks, ..pairs }
    }

    /// The same without knowing which blocks of elements see each other: for who asks for few of the pairs.
    pub(in crate::radiosity) fn for_links(world: &'a World, mesh: &'a ElementMesh, settings: &Settings, medium: Medium) -> Self {
        let elements = mesh.elements();
        let bound = |e: &Element| {
            let centre = rule::centroid(e);
            Bound { centre, radius: e.corners().iter().map(|c| (*c - centre.p).length()).fold(0.0, f64::max) }
        };
        let nodes = [2, 3].map(|n| {
            let mut nodes = Vec::with_capacity(elements.len() * n * n);
            elements.iter().for_each(|e| rule::gauss(e, n, &mut nodes));
            nodes
        });
        let visibility = Visibility::new(world, mesh, settings.rays, medium);
        let most = if settings.clip.is_some() { MAX_OCCLUDERS } else { FEW_OCCLUDERS };
        let occluders = if is_opaque(world, mesh) { Occluders::new(mesh, most) } else { None };
        Self {
            elements,
            clip: settings.clip,
            blocks: None,
            occluders,
            visibility,
            medium,
            tolerance: settings.tolerance,
            path: world.cpu_path(),
            reach: [1.0, 2.0, 3.0, 4.0, 6.0, 8.0].map(|n: f64| libm::pow(settings.tolerance.clamp(1e-12, 0.5), 0.5 / n)),
            bounds: elements.iter().map(bound).collect(),
            nodes,
        }
    }

    /// Nothing can stand between any two elements.
    pub(in crate::radiosity) fn is_convex(&self) -> bool {
        self.occluders.as_ref().is_some_and(|occluders| occluders.polygons.is_empty())
    }

    /// `Σ V K` and `Σ K` along `n` lines between two groups of elements, spread over both.
    pub(in crate::radiosity) fn seen_between(&self, groups: [&[u32]; 2], n: usize, scratch: &mut Scratch) -> [f64; 2] {
        if self.is_convex() {
            return [1.0; 2];
        }
        self.visibility.seen_between(self.elements, groups, n, &mut scratch.visibility)
    }

    /// Of `n` rays over the hemisphere of an element each meets an element.
    pub(in crate::radiosity) fn is_closed(&self, mesh: &ElementMesh, i: u32, n: u32) -> bool {
        self.elements[i as usize].area > 0.0 && self.visibility.is_closed(mesh, i, n)
    }

    /// Shadows are cut out, not sampled.
    pub fn is_clipping(&self) -> bool {
        self.clip.is_some() && self.occluders.is_some()
    }

    /// What a pair exchanges; the error is that of the visible fraction, one standard deviation of independent rays.
    pub fn exchange(&self, i: u32, j: u32, scratch: &mut Scratch) -> Exchange {
        if self.elements[i as usize].area <= 0.0 || self.elements[j as usize].area <= 0.0 {
            // Covered as a whole.
            return Exchange::NONE;
        }
        if self.blocks.as_ref().is_some_and(|blocks| !blocks.may_see(i, j)) {
            return Exchange::NONE;
        }
        let exact = self.unoccluded(i, j);
        if exact <= 0.0 {
            return Exchange::NONE;
        }
        let (a, b) = (&self.elements[i as usize], &self.elements[j as usize]);
        let passing = self.passing(a, b, exact);
        let exchange = |Estimate { value, error }, passing| Exchange { area: value, variance: error * error, passing };
        if let Some(occluders) = &self.occluders {
            let [oa, ob] = [i, j].map(|i| &occluders.elements[i as usize]);
            let is_between = |o: &&Outline| occluded::may_block(oa, ob, o);
            let between: Vec<&[DVec3]> = occluders.of(a.patch, b.patch).filter(is_between).map(|o| o.corners.as_ref()).collect();
            if between.is_empty() {
                return exchange(Estimate { value: exact, error: 0.0 }, passing);
            }
            if let Some(tolerance) = self.clip {
                let estimate =
                    occluded::exchange_past(exact, a.corners(), b.corners(), &between, tolerance, &mut scratch.occluded);
                if self.medium.is_clear() || estimate.value == exact {
                    return exchange(estimate, passing);
                }
                // What is seen is known, how far it is, rays say.
                let seen = self.visibility.seen((i, a), (j, b), &mut scratch.visibility);
                return exchange(estimate, shifted(passing, seen.passing));
            }
        }
        let seen = self.visibility.seen((i, a), (j, b), &mut scratch.visibility);
        exchange(Estimate { value: exact * seen.fraction, error: exact * seen.error }, shifted(passing, seen.passing))
    }

    /// τ of a pair that exchanges `exact` without occluders.
    fn passing(&self, a: &Element, b: &Element, exact: f64) -> [f64; 3] {
        if self.medium.is_clear() {
            return [1.0; 3];
        }
        absorbed(a.corners(), b.corners(), exact, &self.medium, self.tolerance).map(|lost| (1.0 - lost / exact).clamp(0.0, 1.0))
    }

    /// The same without occluders.
    pub fn unoccluded(&self, i: u32, j: u32) -> f64 {
        let (a, b) = (&self.elements[i as usize], &self.elements[j as usize]);
        let (ba, bb) = (&self.bounds[i as usize], &self.bounds[j as usize]);
        let d = bb.centre.p - ba.centre.p;
        // Cheap and final for most pairs: one lies behind the other's plane as a whole.
        let (ha, hb) = (a.normal.dot(d), -b.normal.dot(d));
        if ha <= -bb.radius || hb <= -ba.radius {
            return 0.0;
        }
        let distance = d.length();
        let tiny = 1e-9 * (distance + ba.radius + bb.radius);
        let [above_a, crosses_a] = position(a, b, tiny);
        let [above_b, crosses_b] = position(b, a, tiny);
        if !above_a || !above_b {
            return 0.0;
        }
        let q = (ba.radius + bb.radius) / distance;
        let (na, nb) = (a.normal, b.normal);
        let of = |n: usize, i: u32| &self.nodes[n][i as usize * SIZES[n]..][..SIZES[n]];
        match self.reach.iter().position(|&reach| q < reach) {
            _ if crosses_a || crosses_b => analytic::exchange_area(a.corners(), b.corners(), 0.01 * self.tolerance),
            None => analytic::exchange_area(a.corners(), b.corners(), 0.01 * self.tolerance),
            Some(0) => kernel_sum(&[ba.centre], na, &[bb.centre], nb),
            Some(n @ 1..=2) => kernel_sum(of(n - 1, i), na, of(n - 1, j), nb),
            Some(n) => {
                let (mut x, mut y) = (Columns::ZERO, Columns::ZERO);
                x.fill(a, n - 3);
                y.fill(b, n - 3);
                kernel_sum_of_columns(self.path, &x, na, &y, nb)
            }
        }
    }
}

/// τ of a whole pair as that of what is seen of it.
fn shifted(tau: [f64; 3], by: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|c| (tau[c] * by[c]).min(1.0))
}

/// Everything that blocks is an opaque polygon, and there are not too many.
fn is_opaque(world: &World, mesh: &ElementMesh) -> bool {
    let meshes_only = world.scene().instances.iter().all(|i| matches!(i.geometry, Geometry::Mesh(_)));
    meshes_only && !world.has_transparency() && mesh.patches().len() <= MAX_PATCHES
}

impl<'a> Occluders<'a> {
    /// `None` when there are more than `most`.
    fn new(mesh: &'a ElementMesh, most: usize) -> Option<Self> {
        let patches = mesh.patches();
        let corners = || patches.iter().flat_map(Patch::corners);
        // What has everything on one side, as the walls of a convex room have, is in nobody's way.
        let is_outermost = |patch: &&Patch| {
            let (origin, normal) = (patch.corners()[0], area_vector(patch.corners()).normalize_or_zero());
            let (mut low, mut high, mut reach) = (0.0f64, 0.0f64, 0.0f64);
            for d in corners().map(|c| *c - origin) {
                let h = d.dot(normal);
                (low, high, reach) = (low.min(h), high.max(h), reach.max(d.abs().max_element()));
            }
            low >= -1e-9 * reach || high <= 1e-9 * reach
        };
        let polygons: Vec<Vec<DVec3>> =
            patches.par_iter().filter(|patch| !is_outermost(patch)).map(|patch| patch.corners().to_vec()).collect();
        let polygons: Vec<Outline> = occluded::merge(polygons).into_iter().map(Outline::new).collect();
        if polygons.len() > most {
            return None;
        }
        let n = patches.len();
        let between = if n <= FEW_PATCHES && polygons.len() > 8 {
            let outlines: Vec<Outline> = patches.iter().map(|patch| Outline::new(patch.corners())).collect();
            let pair = |k: usize| {
                let crosses = |&o: &u32| occluded::crosses(&outlines[k / n], &outlines[k % n], &polygons[o as usize]);
                if k / n <= k % n { (0..polygons.len() as u32).filter(crosses).collect() } else { Vec::new() }
            };
            (0..n * n).into_par_iter().map(pair).collect()
        } else {
            Vec::new()
        };
        let elements = mesh.elements().iter().map(|e| Outline::new(e.corners())).collect();
        Some(Self { polygons, elements, n_patches: n, between })
    }

    fn of(&self, a: u32, b: u32) -> impl Iterator<Item = &Outline<'static>> {
        let list = self.between.get(a.min(b) as usize * self.n_patches + a.max(b) as usize);
        let all = list.is_none().then_some(0..self.polygons.len() as u32);
        list.into_iter().flatten().copied().chain(all.into_iter().flatten()).map(|o| &self.polygons[o as usize])
    }
}

/// Points of the rules in [`Pairs::nodes`].
const SIZES: [usize; 2] = [4, 9];

/// Some of `b` lies in front of `a`'s plane; and some of it behind as well.
fn position(a: &Element, b: &Element, tiny: f64) -> [bool; 2] {
    let origin = a.corners()[0];
    let (mut above, mut below) = (false, false);
    for c in b.corners() {
        let h = (*c - origin).dot(a.normal);
        above |= h > tiny;
        below |= h < -tiny;
    }
    [above, above && below]
}

/// `Σ Σ K A A′`, m².
fn kernel_sum(a: &[Node], na: DVec3, b: &[Node], nb: DVec3) -> f64 {
    let mut sum = 0.0;
    for x in a {
        let mut inner = 0.0;
        for y in b {
            let d = y.p - x.p;
            let r2 = d.length_squared();
            inner -= na.dot(d) * nb.dot(d) / (r2 * r2) * y.area;
        }
        sum += inner * x.area;
    }
    (sum * FRAC_1_PI).max(0.0)
}

/// Points a side of the rules that are made for each pair.
const FINE: [usize; 3] = [4, 6, 8];

/// The rules of [`FINE`] on the unit square: s, t and weight.
static RULES: std::sync::LazyLock<[Vec<[f64; 3]>; 3]> = std::sync::LazyLock::new(|| {
    FINE.map(|n| {
        let rule = analytic::gauss_legendre(n);
        rule.iter().flat_map(|&[t, wt]| rule.iter().map(move |&[s, ws]| [s, t, ws * wt])).collect()
    })
});

/// Points of an element, in columns; a multiple of four of them.
struct Columns {
    n: usize,
    p: [[f64; 64]; 3],
    area: [f64; 64],
}

impl Columns {
    const ZERO: Self = Self { n: 0, p: [[0.0; 64]; 3], area: [0.0; 64] };

    /// The tensor rule of `FINE[rule]` points a side.
    fn fill(&mut self, element: &Element, rule: usize) {
        let rule = &RULES[rule];
        self.n = rule.len();
        for (k, &[s, t, weight]) in rule.iter().enumerate() {
            let node = rule::bilinear(element, [s, t]);
            (self.p[0][k], self.p[1][k], self.p[2][k]) = (node.p.x, node.p.y, node.p.z);
            self.area[k] = weight * node.area;
        }
    }
}

for_each_cpu! {
    /// `Σ Σ K A A′`, m²: the same bits whatever it is compiled for, since nothing is fused and four sums are kept apart.
    fn kernel_sum_of_columns(a: &Columns, na: DVec3, b: &Columns, nb: DVec3) -> f64 = kernel_sum_on;
}

#[inline(always)]
fn kernel_sum_on<C: Cpu>(a: &Columns, na: DVec3, b: &Columns, nb: DVec3) -> f64 {
    let mut sums = [0.0f64; 4];
    for i in 0..a.n {
        let (px, py, pz, area) = (a.p[0][i], a.p[1][i], a.p[2][i], a.area[i]);
        let mut inner = [0.0f64; 4];
        let (columns, areas) = (b.p.each_ref().map(|c| c[..b.n].as_chunks::<4>().0), b.area[..b.n].as_chunks::<4>().0);
        for k in 0..areas.len() {
            let (x, y, z) = (&columns[0][k], &columns[1][k], &columns[2][k]);
            for lane in 0..4 {
                let (dx, dy, dz) = (x[lane] - px, y[lane] - py, z[lane] - pz);
                let r2 = dx * dx + dy * dy + dz * dz;
                let (ca, cb) = (na.x * dx + na.y * dy + na.z * dz, nb.x * dx + nb.y * dy + nb.z * dz);
                inner[lane] -= ca * cb / (r2 * r2) * areas[k][lane];
            }
        }
        for lane in 0..4 {
            sums[lane] += inner[lane] * area;
        }
    }
    ((sums[0] + sums[1] + (sums[2] + sums[3])) * FRAC_1_PI).max(0.0)
}
