//! Links: what two nodes of the tree exchange, and by how much that may be wrong.

use std::f64::consts::FRAC_1_PI;

use super::tree::Tree;
use crate::math::DVec3;
use crate::radiosity::form_factor::{Factors, Scratch};
use crate::radiosity::mesh::Element;

/// Nodes whose radii sum to more than this part of their distance are not linked but divided.
const NEAR: f64 = 0.9;

/// Halvings of a node to its samples: four of them for an estimate of the error, then 16.
const LEVELS: [u32; 2] = [2, 4];

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
    /// By end and by cell of its node ([`Tree::cells`]): the cell's part of what is exchanged.
    pub(super) shares: [Shares; 2],
}

/// Parts of a whole, which sum to one.
pub(super) type Shares = [f32; 4];

/// Of a node that is a cell of its own.
const WHOLE: Shares = [1.0, 0.0, 0.0, 0.0];

/// What becomes of a pair of nodes.
pub(super) enum Decision {
    /// They see nothing of each other.
    Nothing,
    /// Their parts are asked.
    Divide,
    /// They are linked.
    Link(Link),
}

/// A point of a node.
struct Sample {
    p: DVec3,
    /// Its part of the node's area, times the normal.
    area: DVec3,
    /// Which cell of the node it is of.
    cell: usize,
}

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
            let link = Link { nodes: [a, b], area: exchange.area, error: 0.0, passing: exchange.passing, shares: [WHOLE; 2] };
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
        let [coarse, fine] = LEVELS.map(|level| {
            work.samples.iter_mut().zip([a, b]).for_each(|(samples, node)| {
                samples.clear();
                self.sample_cells(node, level, samples);
            });
            exchange(&work.samples)
        });
        // The midpoint rule errs by the square of the distance between samples, of which there are half as many a side.
        let rule = (fine.area - coarse.area) / 3.0;
        let unoccluded = (fine.area + rule).clamp(0.0, x.area.min(y.area));
        let error = self.spread([a, b], &fine, &work.samples) + rule.abs();
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
        Decision::Link(Link { nodes: [a, b], area: unoccluded * visible, error, passing, shares: fine.shares })
    }

    /// Points of a node, cell by cell: about `2^level`.
    fn sample_cells(&self, node: u32, level: u32, out: &mut Vec<Sample>) {
        let Some(children) = self.tree.nodes[node as usize].children else { return self.sample(node, level, 0, out) };
        for (k, cell) in self.tree.cells(node).into_iter().enumerate().filter(|(_, cell)| *cell != node) {
            let depth = if children.contains(&cell) { 1 } else { 2 };
            self.sample(cell, level - depth, k, out);
        }
    }

    /// Points of a part of a node, which lies in one of its cells.
    fn sample(&self, part: u32, level: u32, cell: usize, out: &mut Vec<Sample>) {
        let of = &self.tree.nodes[part as usize];
        match of.children {
            Some(children) if level > 0 => children.into_iter().for_each(|child| self.sample(child, level - 1, cell, out)),
            // Elements that face elsewhere than each other do not stand for each other: one of them does, by its own normal.
            Some(_) if of.vector_area.length() < 0.98 * of.area => {
                let members = self.tree.members(part);
                let element = &self.elements()[members[members.len() / 2] as usize];
                out.push(Sample { p: element.centre(), area: element.normal * of.area, cell });
            }
            Some(_) => out.push(Sample { p: of.centre, area: of.vector_area, cell }),
            None => {
                let element = &self.elements()[self.tree.element(of)];
                let n = [level / 2, level - level / 2].map(|l| 1u32 << l);
                let area = element.normal * (of.area / f64::from(n[0] * n[1]));
                let at = |k: u32, n: u32| (f64::from(k) + 0.5) / f64::from(n);
                let p = |k: u32| element.at([at(k % n[0], n[0]), at(k / n[0], n[1])]);
                out.extend((0..n[0] * n[1]).map(|k| Sample { p: p(k), area, cell }));
            }
        }
    }

    /// What is exchanged with the wrong elements, m², at most about, when each cell has its share and exchanges it evenly with all the others do.
    ///
    /// ```text
    /// A_I max |F_aJ − F_cJ| + A_J max |F_bI − F_dI| + Σ |K_cd − u_c v_d Σ K|        over samples a in cells c, b in d
    /// ```
    fn spread(&self, nodes: [u32; 2], of: &Exchanged, samples: &[Vec<Sample>; 2]) -> f64 {
        let [u, v] = &of.shares;
        let product = |k: usize| f64::from(u[k / 4]) * f64::from(v[k % 4]) * of.area;
        let crossing: f64 = (0..16).map(|k| (of.by_cells[k / 4][k % 4] - product(k)).abs()).sum();
        let within = |end: usize| self.within_cells(nodes[end], &samples[end], &of.by_sample[end]);
        crossing + within(0) + within(1)
    }

    /// `A_I max |F_aJ − F_cJ|` over samples *a* in cells *c*, of what each sample exchanges; within a single element all light is the same.
    fn within_cells(&self, node: u32, samples: &[Sample], exchanged: &[f64]) -> f64 {
        let cells = self.tree.cells(node);
        let mut sums = [[0.0; 2]; 4];
        for (a, k) in samples.iter().zip(exchanged) {
            sums[a.cell][0] += k;
            sums[a.cell][1] += a.area.length();
        }
        let is_divided = |a: &Sample| self.tree.nodes[cells[a.cell] as usize].children.is_some();
        let off = |(a, k): (&Sample, &f64)| (k / a.area.length() - sums[a.cell][0] / sums[a.cell][1]).abs();
        let most = samples.iter().zip(exchanged).filter(|(a, _)| is_divided(a)).map(off).fold(0.0, f64::max);
        self.tree.nodes[node as usize].area * most
    }

    fn elements(&self) -> &[Element] {
        self.factors.mesh().elements()
    }
}

/// Samples of a node at most: those of 16 parts.
const MOST_SAMPLES: usize = 16;

/// What samples of two nodes exchange, m².
struct Exchanged {
    area: f64,
    by_cells: [[f64; 4]; 4],
    /// By end: what each sample exchanges with all of the other.
    by_sample: [[f64; MOST_SAMPLES]; 2],
    /// As [`Link::shares`].
    shares: [Shares; 2],
}

/// `K_ab = A_a A_b cos θ_a cos θ_b / (π r²)` between samples, summed up by cells c and d: `u_c = Σ_d K_cd / Σ K`, `v_d = Σ_c K_cd / Σ K`.
fn exchange([from, to]: &[Vec<Sample>; 2]) -> Exchanged {
    let mut by_cells = [[0.0; 4]; 4];
    let [mut of_from, mut of_to] = [[0.0; MOST_SAMPLES]; 2];
    for (a, sum) in from.iter().zip(&mut of_from) {
        for (b, back) in to.iter().zip(&mut of_to) {
            let d = b.p - a.p;
            let r2 = d.length_squared();
            let kernel = a.area.dot(d).max(0.0) * (-b.area.dot(d)).max(0.0) * FRAC_1_PI / (r2 * r2);
            by_cells[a.cell][b.cell] += kernel;
            *sum += kernel;
            *back += kernel;
        }
    }
    let area: f64 = by_cells.iter().flatten().sum();
    let row = |c: usize| by_cells[c].iter().sum::<f64>();
    let column = |d: usize| by_cells.iter().map(|row| row[d]).sum::<f64>();
    let share = |sum: f64| if area > 0.0 { (sum / area) as f32 } else { 0.0 };
    let shares = [std::array::from_fn(|c| share(row(c))), std::array::from_fn(|d| share(column(d)))];
    Exchanged { area, by_cells, by_sample: [of_from, of_to], shares }
}
