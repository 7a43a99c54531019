//! A binary tree by binned surface-area heuristic [Wald07] (*On fast construction of SAH-based bounding volume hierarchies*).

use rayon::prelude::*;

use super::Reference;
use crate::math::{Bounds, Vec3};

/// How a set of references is halved.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Split {
    /// By the surface-area heuristic.
    Heuristic,
    /// By number, along the longest axis: a balanced tree.
    Count,
}

/// A node of a binary tree.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node2 {
    pub min: Vec3,
    /// Left child; [`Node2::LEAF`] for a leaf.
    pub left: u32,
    pub max: Vec3,
    /// Right child; for a leaf, what it holds: see [`Reference`].
    pub right: u32,
}

impl Node2 {
    pub(super) const LEAF: u32 = u32::MAX;

    pub(super) fn bounds(&self) -> Bounds {
        Bounds { min: self.min, max: self.max }
    }

    pub(super) fn is_leaf(&self) -> bool {
        self.left == Self::LEAF
    }
}

/// Bins an axis. With 16 rays were 3 to 6 % slower, with 64 no faster.
const BINS: usize = 32;

/// Below this many references a subtree is built by one thread; each of the larger ones is a task.
const SEQUENTIAL: usize = 2048;

/// References a task looks at together; fixed, so that the result is too.
const CHUNK: usize = 16 * 1024;

/// Levels after which the heuristic gives way to halving by number.
const MAX_HEURISTIC_DEPTH: usize = 64;

/// The tree, root first, one reference a leaf; a left child follows its parent. Not for an empty set.
pub(super) fn build(mut references: Vec<Reference>, split: Split) -> Vec<Node2> {
    let nothing = Node2 { min: Vec3::ZERO, left: 0, max: Vec3::ZERO, right: 0 };
    let mut nodes = vec![nothing; 2 * references.len() - 1];
    let all = Extents::of(&references);
    // Areas are compared relative to the whole, so that no scale over- or underflows.
    let longest = all.bounds.extent().max_element();
    let scale = if longest > 0.0 { 1.0 / longest } else { 0.0 };
    subtree(&mut references, &mut nodes, 0, all, &Context { split, scale }, 0);
    nodes
}

struct Context {
    split: Split,
    scale: f32,
}

/// Boxes around some references and around their centres (times two).
#[derive(Clone, Copy)]
struct Extents {
    bounds: Bounds,
    centres: Bounds,
}

impl Extents {
    const EMPTY: Self = Self { bounds: Bounds::EMPTY, centres: Bounds::EMPTY };

    fn with(self, r: &Reference) -> Self {
        Self { bounds: self.bounds.union(r.bounds()), centres: self.centres.with(r.centre2()) }
    }

    fn union(self, other: Self) -> Self {
        Self { bounds: self.bounds.union(other.bounds), centres: self.centres.union(other.centres) }
    }

    fn of(references: &[Reference]) -> Self {
        if references.len() < 2 * CHUNK {
            return references.iter().fold(Self::EMPTY, Self::with);
        }
        references.par_chunks(CHUNK).map(|c| c.iter().fold(Self::EMPTY, Self::with)).reduce(|| Self::EMPTY, Self::union)
    }
}

/// Builds the subtree over `references` into `nodes`, whose first has the index `at` in the whole.
fn subtree(references: &mut [Reference], nodes: &mut [Node2], at: usize, extents: Extents, context: &Context, depth: usize) {
    let n = references.len();
    debug_assert_eq!(nodes.len(), 2 * n - 1);
    let Bounds { min, max } = extents.bounds;
    if n == 1 {
        nodes[0] = Node2 { min, left: Node2::LEAF, max, right: references[0].id };
        return;
    }
    let middle = if context.split == Split::Heuristic && depth < MAX_HEURISTIC_DEPTH {
        partition(references, &extents, context.scale)
    } else {
        None
    };
    let middle = middle.unwrap_or_else(|| halve(references, &extents));
    let n_left = 2 * middle - 1;
    nodes[0] = Node2 { min, left: (at + 1) as u32, max, right: (at + 1 + n_left) as u32 };
    let (left, right) = references.split_at_mut(middle);
    let (left_nodes, right_nodes) = nodes[1..].split_at_mut(n_left);
    let mut go_left = || {
        let e = Extents::of(left);
        subtree(left, left_nodes, at + 1, e, context, depth + 1);
    };
    let mut go_right = || {
        let e = Extents::of(right);
        subtree(right, right_nodes, at + 1 + n_left, e, context, depth + 1);
    };
    if n > SEQUENTIAL {
        rayon::join(go_left, go_right);
    } else {
        go_left();
        go_right();
    }
}

/// Puts the smaller half, by centre along the longest axis, first.
fn halve(references: &mut [Reference], extents: &Extents) -> usize {
    let e = extents.centres.extent();
    let axis = e.max_position();
    let middle = references.len() / 2;
    // Ids make the order total, hence the halves unique.
    references.select_nth_unstable_by(middle, |a, b| a.centre2()[axis].total_cmp(&b.centre2()[axis]).then(a.id.cmp(&b.id)));
    middle
}

#[derive(Clone, Copy)]
struct Bin {
    bounds: Bounds,
    count: u32,
}

type Bins = [[Bin; BINS]; 3];

const NO_BINS: Bins = [[Bin { bounds: Bounds::EMPTY, count: 0 }; BINS]; 3];

/// Splits where the binned heuristic is least; `None` when no plane separates the centres.
fn partition(references: &mut [Reference], extents: &Extents, scale: f32) -> Option<usize> {
    let n = references.len();
    let origin = extents.centres.min;
    let spread = extents.centres.extent();
    let to_bin = Vec3::from(spread.to_array().map(|e| if e > 0.0 { BINS as f32 * 0.9999 / e } else { 0.0 }));
    if !to_bin.is_finite() || to_bin == Vec3::ZERO {
        return None;
    }
    // A cast saturates, the masked index cannot leave the bins.
    let bin_of = |r: &Reference| ((r.centre2() - origin) * to_bin).to_array().map(|x| (x as usize) & (BINS - 1));
    let fill = |mut bins: Bins, chunk: &[Reference]| {
        for r in chunk {
            let index = bin_of(r);
            for k in 0..3 {
                let bin = &mut bins[k][index[k]];
                bin.bounds = bin.bounds.union(r.bounds());
                bin.count += 1;
            }
        }
        bins
    };
    let merge = |mut a: Bins, b: Bins| {
        for (a, b) in a.iter_mut().flatten().zip(b.iter().flatten()) {
            a.bounds = a.bounds.union(b.bounds);
            a.count += b.count;
        }
        a
    };
    let bins = if n < 2 * CHUNK {
        fill(NO_BINS, references)
    } else {
        references.par_chunks(CHUNK).map(|c| fill(NO_BINS, c)).reduce(|| NO_BINS, merge)
    };
    // Cost of a split: area times number, both sides.
    let area = |b: &Bounds| Bounds { min: b.min * scale, max: b.max * scale }.half_area();
    let mut best = (f32::INFINITY, 0, 0);
    for (k, bins) in bins.iter().enumerate() {
        if to_bin[k] == 0.0 {
            continue;
        }
        let mut right_cost = [0.0; BINS];
        let (mut bounds, mut count) = (Bounds::EMPTY, 0);
        for i in (1..BINS).rev() {
            bounds = bounds.union(bins[i].bounds);
            count += bins[i].count;
            right_cost[i] = if count == 0 { f32::INFINITY } else { area(&bounds) * count as f32 };
        }
        let (mut bounds, mut count) = (Bounds::EMPTY, 0);
        for i in 1..BINS {
            bounds = bounds.union(bins[i - 1].bounds);
            count += bins[i - 1].count;
            let cost = area(&bounds) * count as f32 + right_cost[i];
            if count > 0 && cost < best.0 {
                best = (cost, k, i);
            }
        }
    }
    let (cost, axis, first_right) = best;
    if cost == f32::INFINITY {
        return None;
    }
    // From both ends inwards.
    let (mut i, mut j) = (0, n);
    while i < j {
        if bin_of(&references[i])[axis] < first_right {
            i += 1;
        } else {
            j -= 1;
            references.swap(i, j);
        }
    }
    (i > 0 && i < n).then_some(i)
}
