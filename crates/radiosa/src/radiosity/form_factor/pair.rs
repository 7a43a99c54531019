//! The analytic estimator: exchange areas of pairs of elements, exact but for a tolerance where nothing is between them, times the visible fraction.
//!
//! Which rule is exact enough is decided by the size of the pair against its distance, `q = (R_i + R_j)/d` (R: radius around the
//! centre): the product rule of Gauss with `n` points a side errs by about `q^(2n)`. Pairs too close for three points, and those that
//! cross each other's planes, take the contour integral ([`super::analytic::exchange_area`]).

use std::f64::consts::FRAC_1_PI;

use super::analytic;
use super::rule::{self, Node};
use super::visibility::{self, Visibility};
use crate::math::DVec3;
use crate::radiosity::mesh::{Element, ElementMesh};
use crate::transport::World;

/// How exact, and with how many rays.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Relative error of a factor without occluders.
    pub tolerance: f64,
    /// Rays between two elements, and in all when some of them are blocked; at most 64.
    pub rays: [usize; 2],
}

impl Default for Settings {
    fn default() -> Self {
        Self { tolerance: 1e-3, rays: [16, 64] }
    }
}

/// All pairs of a mesh.
#[derive(Debug)]
pub struct Pairs<'a> {
    elements: &'a [Element],
    visibility: Visibility<'a>,
    tolerance: f64,
    /// By element.
    bounds: Vec<Bound>,
    /// Four and nine points of each element.
    nodes: [Vec<Node>; 2],
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
}

impl<'a> Pairs<'a> {
    /// Prepares the points of every element.
    pub fn new(world: &'a World, mesh: &'a ElementMesh, settings: &Settings) -> Self {
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
        Self {
            elements,
            visibility: Visibility::new(world, mesh, settings.rays),
            tolerance: settings.tolerance,
            bounds: elements.iter().map(bound).collect(),
            nodes,
        }
    }

    /// `A_i F_ij = A_j F_ji`, m².
    pub fn exchange_area(&self, i: u32, j: u32, scratch: &mut Scratch) -> f64 {
        if self.elements[i as usize].area <= 0.0 || self.elements[j as usize].area <= 0.0 {
            // Covered as a whole.
            return 0.0;
        }
        let exact = self.unoccluded(i, j);
        if exact <= 0.0 {
            return 0.0;
        }
        let of = |i: u32| (i, &self.elements[i as usize]);
        exact * self.visibility.fraction(of(i), of(j), &mut scratch.visibility)
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
        let crosses = crosses_a || crosses_b;
        let rule = |n: f64| q < libm::pow(self.tolerance, 0.5 / n);
        if crosses || !rule(3.0) {
            return analytic::exchange_area(a.corners(), b.corners(), 0.01 * self.tolerance);
        }
        let (na, nb) = (a.normal, b.normal);
        if rule(1.0) {
            return kernel_sum(&[ba.centre], na, &[bb.centre], nb);
        }
        let n = if rule(2.0) { 0 } else { 1 };
        let of = |i: u32| &self.nodes[n][i as usize * SIZES[n]..][..SIZES[n]];
        kernel_sum(of(i), na, of(j), nb)
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
