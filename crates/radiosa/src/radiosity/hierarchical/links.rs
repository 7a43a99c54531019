//! Links: what two nodes of the tree exchange, and by how much that may be wrong.

use std::f64::consts::FRAC_1_PI;

use super::tree::{Node, Tree};
use crate::math::DVec3;
use crate::radiosity::form_factor::{Factors, Scratch};
use crate::radiosity::mesh::Element;

/// Nodes whose radii sum to more than this part of their distance are not linked but divided.
const NEAR: f64 = 0.6;

/// Halvings of a node to its samples: 16 of them, and four for an estimate of the error.
const LEVELS: [u32; 2] = [4, 2];

/// Lines between two nodes.
const LINES: usize = 16;

/// Lines that must all be blocked before nodes of many elements are taken to see nothing of each other.
const MANY_LINES: usize = 96;

/// What two nodes exchange.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Link {
    pub(super) nodes: [u32; 2],
    /// `Σ A_i F_ij` over pairs of their elements, m².
    pub(super) area: f64,
    /// A bound of what of this may be with the wrong elements, m²; zero between single elements.
    pub(super) error: f64,
    /// τ by channel.
    pub(super) passing: [f64; 3],
}

/// What becomes of a pair of nodes.
pub(super) enum Decision {
    /// They see nothing of each other.
    Nothing,
    /// Their parts are asked.
    Divide,
    /// They are linked.
    Link(Link),
}

/// A point of a node: where, and its part of the area with its normal.
type Sample = (DVec3, DVec3);

/// Decides about pairs of nodes.
pub(super) struct Oracle<'a> {
    pub(super) tree: &'a Tree,
    pub(super) factors: &'a Factors<'a>,
    /// By node: its radiosity and its reflectance, the largest of the channels.
    pub(super) light: &'a [[f64; 2]],
    /// The most power that a link may misplace, W or lm.
    pub(super) power: f64,
}

/// What a thread needs.
#[derive(Default)]
pub(super) struct Work {
    samples: [Vec<Sample>; 2],
    factors: Scratch,
}

impl Oracle<'_> {
    /// The error of a link is more than the power it carries allows.
    pub(super) fn is_too_coarse(&self, [a, b]: [u32; 2], error: f64) -> bool {
        let [x, y] = [a, b].map(|k| self.light[k as usize]);
        error * (x[0] * y[1]).max(y[0] * x[1]) > self.power
    }

    /// The two pairs that take the place of one, or three of a node with itself.
    pub(super) fn parts(&self, [a, b]: [u32; 2]) -> impl Iterator<Item = [u32; 2]> + use<> {
        let [x, y] = [a, b].map(|k| &self.tree.nodes[k as usize]);
        let (first, rest) = match (x.children, y.children) {
            (Some([c, d]), _) if a == b => ([[c, c], [c, d]], Some([d, d])),
            (Some([c, d]), other) if other.is_none() || x.radius >= y.radius => ([[c, b], [d, b]], None),
            (_, Some([c, d])) => ([[a, c], [a, d]], None),
            _ => unreachable!("single elements are not divided"),
        };
        first.into_iter().chain(rest)
    }

    /// What becomes of a pair.
    pub(super) fn decide(&self, [a, b]: [u32; 2], work: &mut Work) -> Decision {
        let [x, y] = [a, b].map(|k| &self.tree.nodes[k as usize]);
        if a == b {
            return if x.is_flat() { Decision::Nothing } else { Decision::Divide };
        }
        if x.is_turned_away(y) {
            return Decision::Nothing;
        }
        if x.children.is_none() && y.children.is_none() {
            let [i, j] = [x, y].map(|node| self.tree.element(node) as u32);
            let exchange = self.factors.exchange(i.min(j), i.max(j), &mut work.factors);
            let link = Link { nodes: [a, b], area: exchange.area, error: 0.0, passing: exchange.passing };
            return if link.area > 0.0 { Decision::Link(link) } else { Decision::Nothing };
        }
        if x.radius + y.radius >= NEAR * (x.centre - y.centre).length() {
            return Decision::Divide;
        }
        self.link([a, b], work)
    }

    /// The same for two nodes far enough from each other for samples.
    fn link(&self, [a, b]: [u32; 2], work: &mut Work) -> Decision {
        let [x, y] = [a, b].map(|k| &self.tree.nodes[k as usize]);
        let [fine, coarse] = LEVELS.map(|level| {
            work.samples.iter_mut().zip([a, b]).for_each(|(samples, node)| {
                samples.clear();
                self.sample(node, level, samples);
            });
            exchange(&work.samples, [x, y])
        });
        // The midpoint rule errs by the square of the distance between samples, of which there are half as many a side.
        let rule = (fine.area - coarse.area) / 3.0;
        let unoccluded = (fine.area + rule).clamp(0.0, x.area.min(y.area));
        let error = fine.spread + rule.abs();
        let [of_a, of_b] = [a, b].map(|k| self.tree.members(k));
        if self.is_too_coarse([a, b], error) {
            let are_many = of_a.len().min(of_b.len()) >= 8;
            let is_blocked = are_many && self.factors.seen_between([of_a, of_b], MANY_LINES, &mut work.factors)[0] <= 0.0;
            return if is_blocked { Decision::Nothing } else { Decision::Divide };
        }
        let [mut seen, mut all] = self.factors.seen_between([of_a, of_b], LINES, &mut work.factors);
        if seen <= 0.0 {
            [seen, all] = self.factors.seen_between([of_a, of_b], MANY_LINES, &mut work.factors);
        }
        if seen <= 0.0 || unoccluded <= 0.0 {
            // What no sample sees may still be seen past an edge: it is asked if that could matter.
            let most = x.area * y.area * FRAC_1_PI / (x.centre - y.centre).length_squared();
            let is_blocked = all > 0.0 || !self.is_too_coarse([a, b], most / LINES as f64);
            return if is_blocked { Decision::Nothing } else { Decision::Divide };
        }
        let visible = (seen / all).min(1.0);
        // Lines that agree still leave something to be unknown.
        let unknown = if self.factors.is_convex() { 0.0 } else { 0.25 / LINES as f64 };
        let error = error + unoccluded * (visible * (1.0 - visible)).sqrt().max(unknown);
        if self.is_too_coarse([a, b], error) {
            return Decision::Divide;
        }
        let passing = self.factors.medium().transmittance((x.centre - y.centre).length());
        Decision::Link(Link { nodes: [a, b], area: unoccluded * visible, error, passing })
    }

    /// Points of a node with their shares of its area: about `2^level`.
    fn sample(&self, node: u32, level: u32, out: &mut Vec<Sample>) {
        let of = &self.tree.nodes[node as usize];
        match of.children {
            Some(children) if level > 0 => children.into_iter().for_each(|child| self.sample(child, level - 1, out)),
            // Elements that face elsewhere than each other do not stand for each other: one of them does, by its own normal.
            Some(_) if of.vector_area.length() < 0.98 * of.area => {
                let members = self.tree.members(node);
                let element = &self.elements()[members[members.len() / 2] as usize];
                out.push((element.centre(), element.normal * of.area));
            }
            Some(_) => out.push((of.centre, of.vector_area)),
            None => {
                let element = &self.elements()[self.tree.element(of)];
                let n = [level / 2, level - level / 2].map(|l| 1u32 << l);
                let share = element.normal * (of.area / f64::from(n[0] * n[1]));
                let at = |k: u32, n: u32| (f64::from(k) + 0.5) / f64::from(n);
                out.extend((0..n[0] * n[1]).map(|k| (element.at([at(k % n[0], n[0]), at(k / n[0], n[1])]), share)));
            }
        }
    }

    fn elements(&self) -> &[Element] {
        self.factors.mesh().elements()
    }
}

/// What samples of two nodes exchange, and how differently.
struct Exchanged {
    /// m².
    area: f64,
    /// `A_I max |F_aJ − F_IJ| + A_J max |F_bI − F_JI|` over samples *a* and *b*, m².
    spread: f64,
}

fn exchange([from, to]: &[Vec<Sample>; 2], [x, y]: [&Node; 2]) -> Exchanged {
    let mut area = 0.0;
    let mut range = [f64::INFINITY, f64::NEG_INFINITY];
    let widen = |range: &mut [f64; 2], f: f64| *range = [range[0].min(f), range[1].max(f)];
    let mut back = [0.0; 64];
    for (p, na) in from {
        let mut sum = 0.0;
        for ((q, nb), back) in to.iter().zip(&mut back) {
            let d = *q - *p;
            let r2 = d.length_squared();
            let kernel = na.dot(d).max(0.0) * (-nb.dot(d)).max(0.0) * FRAC_1_PI / (r2 * r2);
            sum += kernel;
            *back += kernel;
        }
        area += sum;
        widen(&mut range, sum / na.length());
    }
    let mut range_back = [f64::INFINITY, f64::NEG_INFINITY];
    to.iter().zip(back).for_each(|((_, nb), back)| widen(&mut range_back, back / nb.length()));
    let off = |[low, high]: [f64; 2], of: &Node| {
        let mean = area / of.area;
        of.area * (high - mean).max(mean - low)
    };
    Exchanged { area, spread: off(range, x) + off(range_back, y) }
}
