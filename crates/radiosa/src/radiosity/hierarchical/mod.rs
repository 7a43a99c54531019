//! Hierarchical radiosity: groups of elements exchange light with groups, as coarsely as the light they carry allows. Sources: [Hanrahan91], [Smits94].
//!
//! ```text
//! tree      elements in groups of groups: blocks of walls, clusters of surfaces
//! links     pairs of nodes with Σ A_i F_ij, each pair of elements in exactly one
//! oracle    a link is divided while  error · max(ρ_I B_J, ρ_J B_I) > tolerance · Σ A B / n
//! sweep     pull: B of nodes are means of their parts;  gather: H_c = u_c Σ G_IJ Σ v_d B_d / A_c;  push: H of parts add that of the whole
//! ```
//!
//! A link shares what it carries among four cells of either node, `G_cd = u_c v_d G_IJ`: as the kernel between samples of both does, as far as that is a product.
//!
//! The error of a link is bounded from the exact kernel between samples of both nodes (by how much it differs within cells, and between cells from the product, and by
//! how much a coarser rule differs), and from lines between them, of which some but not all are blocked. Single elements close to each other exchange what every other solver's do.
//! Radiosities, which the oracle wants, come from coarser links before: the tolerance falls in stages (multi-gridding).
//!
//! What is linked is exchanged both ways alike, so that no power is made or lost, however coarse. Elements have a factor d each, and exchange `d_i G_ij d_j`: it
//! makes the rows of elements from which no ray escapes sum to one, and keeps others from receiving more than there is.

mod links;
mod tree;

use std::io;

use rayon::prelude::*;

use self::links::{Decision, Link, Oracle, Shares, Work};
use self::tree::Tree;
use super::form_factor::Factors;
use super::mesh::ElementMesh;
use super::system::{Sums, System, Unknowns};
use crate::math::DVec3;
use crate::stream::{In, Out, wrong};

/// How exact, and with how many links.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// The power that a link may misplace, relative to that of a mean element.
    pub tolerance: f64,
    /// Links at most, about; with more the tolerance is raised.
    pub max_links: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self { tolerance: 0.01, max_links: 100_000_000 }
    }
}

/// Bytes a link takes while links are being found.
pub const BYTES_A_LINK: u64 = 384;

/// Each stage has so many times the tolerance of the next.
const STAGES: [f64; 3] = [16.0, 4.0, 1.0];

/// What a stage leaves unshot before the next.
const SETTLED: f64 = 0.02;

/// Rays from an element that tell whether any escapes.
const CLOSED_RAYS: u32 = 128;

/// Rounds of Sinkhorn's iteration.
const ROUNDS: usize = 20;

/// The largest d, and the inverse of the smallest.
const MOST_SCALE: f64 = 4.0;

/// Where a link leads, seen from either end.
#[derive(Clone, Copy, Debug, Default)]
struct End {
    node: u32,
    /// `Σ A_i F_ij`, m².
    area: f64,
    /// As [`Link::error`].
    error: f64,
    passing: [f64; 3],
    /// By cell: shares at this end, and at the other.
    own: Shares,
    other: Shares,
}

/// Links so far, and which stage they are of.
#[derive(Clone, Debug)]
pub struct Hierarchical {
    settings: Settings,
    tree: Tree,
    /// Sorted by their nodes.
    links: Vec<Link>,
    /// Stages whose links are found.
    stages: usize,
    /// What the tolerance had to be multiplied with.
    raised: f64,
    /// The last stage has settled: the next one's turn.
    has_settled: bool,
    /// The ends of links by node: those of node k are `ends[starts[k]..starts[k + 1]]`. Made of the links.
    starts: Vec<usize>,
    ends: Vec<End>,
    /// By element: d.
    scale: Vec<f64>,
    /// By element: no ray from it escapes. Not known before the first links, and then empty.
    is_closed: Vec<bool>,
}

/// A link of an element, or of a group it belongs to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkOf {
    /// The middle of what it leads to.
    pub other: DVec3,
    /// Elements at this end, and at the other.
    pub n_own: usize,
    /// See `n_own`.
    pub n_other: usize,
    /// What the groups exchange: `Σ A_i F_ij`, m².
    pub area: f64,
}

/// What a step took.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Taken {
    pub(super) pairs: u64,
    pub(super) exchanges: u64,
}

impl Hierarchical {
    /// No links yet.
    pub(super) fn new(settings: Settings, mesh: &ElementMesh) -> Self {
        Self {
            settings,
            tree: Tree::new(mesh.elements()),
            links: Vec::new(),
            stages: 0,
            raised: 1.0,
            has_settled: true,
            starts: Vec::new(),
            ends: Vec::new(),
            scale: Vec::new(),
            is_closed: Vec::new(),
        }
    }

    /// Pairs of nodes that are linked.
    pub fn n_links(&self) -> usize {
        self.links.len()
    }

    /// The links of an element, those of the groups it belongs to included; what no light can reach has none.
    pub fn links_of(&self, element: u32) -> Vec<LinkOf> {
        let mut links = Vec::new();
        for node in self.tree.path_to(element) {
            let ends = &self.ends[self.starts[node as usize]..self.starts[node as usize + 1]];
            links.extend(ends.iter().map(|end| LinkOf {
                other: self.tree.nodes[end.node as usize].centre,
                n_own: self.tree.members(node).len(),
                n_other: self.tree.members(end.node).len(),
                area: end.area,
            }));
        }
        links
    }

    /// The tolerance the links have in the end, which is larger than asked for where there would be too many of them.
    pub fn tolerance(&self) -> f64 {
        self.settings.tolerance * self.raised
    }

    /// All links are found.
    pub fn is_final(&self) -> bool {
        self.stages == STAGES.len()
    }

    /// The links of the next stage where this one has settled, and a sweep over all.
    pub(super) fn step(&mut self, system: &System, factors: &Factors, unknowns: &mut Unknowns, sums: &mut Sums) -> Taken {
        let mut taken = Taken::default();
        if self.has_settled && !self.is_final() {
            taken.pairs = self.refine(system, factors, unknowns.radiosity);
            if self.is_closed.is_empty() {
                self.is_closed = factors.closed(CLOSED_RAYS);
            }
            self.make_ends();
            self.make_scale(system);
            self.sum_up(system, sums);
        }
        taken.exchanges = self.ends.len() as u64;
        self.sweep(system, unknowns);
        self.has_settled = unknowns.residual(system) <= SETTLED;
        taken
    }

    /// Finds the links of the next stage. Returns how many pairs were asked.
    fn refine(&mut self, system: &System, factors: &Factors, radiosity: &[[f64; 3]]) -> u64 {
        let light = self.light(system, radiosity);
        let power = light.first().map_or(0.0, |root| root[0]) * self.tree.nodes.first().map_or(0.0, |root| root.area);
        let allowed = self.settings.tolerance * STAGES[self.stages] * power / self.tree.n_elements().max(1) as f64;
        let mut oracle = Oracle { tree: &self.tree, factors, light: &light, power: allowed * self.raised };
        let mut pairs: Vec<[u32; 2]> = Vec::new();
        let mut links = Vec::new();
        if self.stages == 0 {
            pairs.extend((!self.tree.nodes.is_empty()).then_some([0, 0]));
        }
        for link in std::mem::take(&mut self.links) {
            if oracle.is_too_coarse(link.nodes, link.error) {
                pairs.extend(oracle.parts(link.nodes));
            } else {
                links.push(link);
            }
        }
        let mut asked = 0;
        while !pairs.is_empty() {
            asked += pairs.len() as u64;
            let decided: Vec<Decision> =
                pairs.par_iter().with_min_len(16).map_init(Work::default, |work, &pair| oracle.decide(pair, work)).collect();
            let mut next = Vec::new();
            for (decision, pair) in decided.into_iter().zip(&pairs) {
                match decision {
                    Decision::Nothing => {}
                    Decision::Divide => next.extend(oracle.parts(*pair)),
                    Decision::Link(link) => links.push(link),
                }
            }
            pairs = next;
            if links.len() + pairs.len() > self.settings.max_links && self.raised < 1e12 {
                self.raised *= 2.0;
                oracle.power = allowed * self.raised;
            }
        }
        links.par_sort_unstable_by_key(|link| link.nodes);
        self.links = links;
        self.stages += 1;
        asked
    }

    /// By node: radiosity and reflectance, each the largest of the channels.
    fn light(&self, system: &System, radiosity: &[[f64; 3]]) -> Vec<[f64; 2]> {
        let largest = |v: &[f64; 3]| v.iter().fold(0.0f64, |a, &b| a.max(b));
        let of: Vec<[f64; 3]> =
            radiosity.iter().zip(&system.reflectance).map(|(b, rho)| [largest(b), largest(rho), 0.0]).collect();
        self.pull(&of).into_iter().map(|[b, rho, _]| [b, rho]).collect()
    }

    /// What each element sends out is met and arrives.
    fn sum_up(&self, system: &System, sums: &mut Sums) {
        let sent = self.pull(&self.scaled(|_| [1.0; 3]));
        let met = self.push(&|end: &End| self.at_other(&sent, end).map(|d| end.area * d));
        sums.met = self.received(&met).into_iter().map(|m| m[0]).collect();
        if !system.medium.is_clear() {
            let through = |end: &End| {
                let sent = self.at_other(&sent, end);
                std::array::from_fn(|c| end.area * end.passing[c] * sent[c])
            };
            sums.arriving = self.received(&self.push(&through));
        }
    }

    /// The ends of all links.
    fn make_ends(&mut self) {
        let n = self.tree.nodes.len();
        let mut starts = vec![0usize; n + 1];
        self.links.iter().flat_map(|link| link.nodes).for_each(|k| starts[k as usize + 1] += 1);
        (0..n).for_each(|k| starts[k + 1] += starts[k]);
        let mut next = starts.clone();
        let mut ends = vec![End::default(); starts[n]];
        for link in &self.links {
            for (i, j) in [(0, 1), (1, 0)] {
                let (at, node) = (&mut next[link.nodes[i] as usize], link.nodes[j]);
                let [own, other] = [i, j].map(|k| link.shares[k]);
                ends[*at] = End { node, area: link.area, error: link.error, passing: link.passing, own, other };
                *at += 1;
            }
        }
        (self.starts, self.ends) = (starts, ends);
    }

    /// Finds d by Sinkhorn's iteration `d_i ← √(d_i / Σ_j F_ij d_j)`, which keeps the symmetry; at most one where rays escape.
    ///
    /// What passes an element is met once more behind it: rows may sum to one and what passes.
    fn make_scale(&mut self, system: &System) {
        let n = system.n();
        self.scale = vec![1.0; n];
        let row = |this: &Self| -> Vec<f64> {
            // The sum of a row by what it may be.
            let sent = this.pull(&this.scaled(|_| [1.0; 3]));
            let passing = this.pull(&this.scaled(|i| [system.passes(i); 3]));
            let of = |end: &End| {
                let [sent, passing] = [&sent, &passing].map(|of| this.at_other(of, end)[0]);
                [end.area * sent, end.area * passing, 0.0]
            };
            this.received(&this.push(&of)).into_iter().map(|[sum, passes, _]| sum / (1.0 + passes)).collect()
        };
        // Nothing goes up by more than its links may be wrong: what is exact stays, and rays that miss a small opening close nothing.
        let wrong = self.received(&self.push(&|end: &End| [end.error; 3]));
        for _ in 0..ROUNDS {
            for (i, sum) in row(self).into_iter().enumerate() {
                let d = (self.scale[i] * self.scale[i] / sum).sqrt();
                let most = if self.is_closed[i] { (1.0 + wrong[i][0]).min(MOST_SCALE) } else { 1.0 };
                self.scale[i] = if d.is_finite() { d.clamp(1.0 / MOST_SCALE, most) } else { 1.0 };
            }
        }
        // What is still above comes down; nothing goes up by that.
        row(self).into_iter().enumerate().for_each(|(i, sum)| self.scale[i] /= sum.max(1.0));
    }

    /// Columns times d.
    fn scaled(&self, of: impl Fn(usize) -> [f64; 3]) -> Vec<[f64; 3]> {
        self.scale.iter().enumerate().map(|(i, d)| of(i).map(|v| d * v)).collect()
    }

    /// `B_I = Σ A_i B_i / Σ A_i`, by node.
    fn pull(&self, of: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let nodes = &self.tree.nodes;
        let mut means = vec![[0.0; 3]; nodes.len()];
        for (k, node) in nodes.iter().enumerate().rev() {
            means[k] = match node.children {
                Some(children) => {
                    let [a, b] = children.map(|c| (nodes[c as usize].area, means[c as usize]));
                    std::array::from_fn(|c| (a.0 * a.1[c] + b.0 * b.1[c]) / (a.0 + b.0))
                }
                None => of[self.tree.element(node)],
            };
        }
        means
    }

    /// The mean over the other end of a link, by its shares.
    fn at_other(&self, means: &[[f64; 3]], end: &End) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for (share, cell) in end.other.iter().zip(self.tree.cells(end.node)) {
            let mean = &means[cell as usize];
            (0..3).for_each(|c| sum[c] += f64::from(*share) * mean[c]);
        }
        sum
    }

    /// `u_c Σ / A_c` over the ends of nodes a node is a cell of, and of all it is a part of, by node.
    fn push(&self, of: &(impl Fn(&End) -> [f64; 3] + Sync)) -> Vec<[f64; 3]> {
        let nodes = &self.tree.nodes;
        let gathered = |k: usize| {
            let mut sums = [[0.0; 3]; 4];
            for end in &self.ends[self.starts[k]..self.starts[k + 1]] {
                let v = of(end);
                for (share, sum) in end.own.iter().zip(&mut sums) {
                    (0..3).for_each(|c| sum[c] += f64::from(*share) * v[c]);
                }
            }
            sums
        };
        let of_cells: Vec<[[f64; 3]; 4]> = (0..nodes.len()).into_par_iter().map(gathered).collect();
        let mut sums = vec![[0.0; 3]; nodes.len()];
        for (gathered, node) in of_cells.iter().zip(0..) {
            for (sum, cell) in gathered.iter().zip(self.tree.cells(node).map(|cell| cell as usize)) {
                (0..3).for_each(|c| sums[cell][c] += sum[c] / nodes[cell].area);
            }
        }
        for (k, node) in nodes.iter().enumerate() {
            for child in node.children.into_iter().flatten() {
                (0..3).for_each(|c| sums[child as usize][c] += sums[k][c]);
            }
        }
        sums
    }

    /// What single elements among nodes have, times d; zero for those that are in no tree.
    fn received(&self, of: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let mut values = vec![[0.0; 3]; self.scale.len()];
        let single = self.tree.nodes.iter().zip(of).filter(|(node, _)| node.children.is_none());
        single.for_each(|(node, v)| {
            let i = self.tree.element(node);
            values[i] = v.map(|v| self.scale[i] * v);
        });
        values
    }

    /// Everything that is there is sent out once more, from the radiosities of the sweep before.
    fn sweep(&self, system: &System, unknowns: &mut Unknowns) {
        let Unknowns { radiosity, irradiance, unshot } = unknowns;
        let b = self.pull(&self.scaled(|i| radiosity[i]));
        let arriving = self.push(&|end: &End| {
            let b = self.at_other(&b, end);
            std::array::from_fn(|c| end.area * end.passing[c] * b[c])
        });
        for (i, gathered) in self.received(&arriving).into_iter().enumerate() {
            irradiance[i] = std::array::from_fn(|c| system.direct[i][c] + gathered[c]);
            let shot = radiosity[i];
            radiosity[i] = std::array::from_fn(|c| system.emission[i][c] + system.reflectance[i][c] * irradiance[i][c]);
            unshot[i] = std::array::from_fn(|c| radiosity[i][c] - shot[c]);
        }
    }

    /// Writes what cannot be made of the elements alone.
    ///
    /// # Errors
    /// When the stream cannot take it.
    pub fn store(&self, out: &mut Out) -> io::Result<()> {
        for number in [self.stages as u64, u64::from(self.has_settled), self.raised.to_bits()] {
            out.number(number)?;
        }
        out.array(&self.links.iter().map(|link| link.nodes).collect::<Vec<_>>())?;
        let numbers = |link: &Link| [link.area, link.error, link.passing[0], link.passing[1], link.passing[2]];
        out.array(&self.links.iter().map(numbers).collect::<Vec<_>>())?;
        out.array(&self.links.iter().map(|link| link.shares).collect::<Vec<_>>())?;
        out.array(&self.scale)?;
        out.array(&self.is_closed.iter().map(|&c| u8::from(c)).collect::<Vec<_>>())
    }

    /// Reads what [`Self::store`] wrote.
    ///
    /// # Errors
    /// When the stream ends, or is of other elements.
    pub fn restore(&mut self, system: &System, from: &mut In) -> io::Result<()> {
        let (stages, has_settled, raised) = (from.number()?, from.number()? != 0, f64::from_bits(from.number()?));
        let nodes = from.any_array::<[u32; 2]>()?;
        let numbers = from.array::<[f64; 5]>(nodes.len())?;
        let shares = from.array::<[Shares; 2]>(nodes.len())?;
        let (scale, is_closed) = (from.any_array::<f64>()?, from.any_array::<u8>()?);
        let n = self.tree.nodes.len() as u32;
        let is_whole = [scale.len(), is_closed.len()].iter().all(|&m| m == if stages == 0 { 0 } else { system.n() });
        let is_whole = is_whole && scale.iter().all(|d| (0.0..=MOST_SCALE).contains(d));
        // (What is no number is not in the range either.)
        let are_shares = shares.iter().flatten().flatten().all(|s| (0.0..=1.001).contains(s));
        let is_known = nodes.iter().flatten().all(|&k| k < n) && numbers.iter().flatten().all(|v| (0.0..1e300).contains(v));
        if stages > STAGES.len() as u64 || !is_known || !is_whole || !are_shares || !(1.0..1e13).contains(&raised) {
            return Err(wrong("its links are of other elements"));
        }
        let link = |((nodes, [area, error, r, g, b]), shares): (([u32; 2], [f64; 5]), [Shares; 2])| Link {
            nodes,
            area,
            error,
            passing: [r, g, b],
            shares,
        };
        self.links = nodes.into_iter().zip(numbers).zip(shares).map(link).collect();
        (self.stages, self.has_settled, self.raised) = (stages as usize, has_settled, raised);
        (self.scale, self.is_closed) = (scale, is_closed.into_iter().map(|c| c != 0).collect());
        self.make_ends();
        Ok(())
    }
}
