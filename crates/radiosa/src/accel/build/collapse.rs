//! From a binary tree to one of width eight, by the cheapest cut.
//!
//! Dynamic programming over the binary tree [Ylitie17] (*Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs*, §3):
//! `c(n, i)` is the least cost of representing the subtree of `n` as at most `i` children of a wide node,
//!
//! ```text
//! c(n, 1) = min(as a leaf, as a wide node: A(n)·NODE_COST + d(n, 8))
//! c(n, i) = min(d(n, i), c(n, i − 1))            d(n, j) = min over k of c(left, k) + c(right, j − k)
//! ```
//!
//! with leaves allowed where all are triangles and not too many.

use super::Source;
use super::binary::Node2;
use crate::accel::bvh::{BLOCK, Block, Bvh, Child, MAX_DEPTH, Node, WIDTH};
use crate::math::{Bounds, Vec3};

/// Cost of visiting a node; of a block of triangles; of an object, which is mostly another tree.
const NODE_COST: f32 = 1.0;
const BLOCK_COST: f32 = 0.9;
const OBJECT_COST: f32 = 4.0;

/// Margin of all boxes, in parts of the tree's largest extent, for directions so oblique that the slab test takes another slope.
const MARGIN: f32 = 1e-12;

/// What is known of every subtree.
struct Costs {
    /// As at most 1, 2, … 8 children.
    at_most: Vec<[f32; WIDTH]>,
    /// Triangles in it if it is to be a leaf, else 0.
    triangles: Vec<u32>,
    /// How soon a ray that only asks whether it is blocked should look here: the chance to be blocked by a unit of work.
    promise: Vec<f32>,
}

/// `None` when the tree is too deep for the traversal stack.
pub(super) fn collapse(tree: &[Node2], source: &dyn Source, bounds: Bounds) -> Option<Bvh> {
    let costs = costs(tree, source, bounds);
    let longest = bounds.extent().max_element();
    let mut wide = Wide {
        tree,
        source,
        costs,
        margin: longest * MARGIN + f32::MIN_POSITIVE,
        bvh: Bvh { nodes: vec![Node::EMPTY], blocks: Vec::new(), bounds },
    };
    // Depth first, so that a node's blocks lie together. A root that is best as a leaf still gets its node.
    let mut todo: Vec<(u32, usize, usize)> = vec![(0, 0, 1)];
    let mut children = Vec::with_capacity(WIDTH);
    while let Some((n, place, depth)) = todo.pop() {
        if depth > MAX_DEPTH {
            return None;
        }
        children.clear();
        if wide.is_leaf(n) {
            children.push(n);
        } else {
            wide.distribute(n, WIDTH, &mut children);
        }
        children.sort_by(|&a, &b| wide.costs.promise[b as usize].total_cmp(&wide.costs.promise[a as usize]).then(a.cmp(&b)));
        let first_todo = todo.len();
        for (lane, &c) in children.iter().enumerate() {
            let child = if wide.is_leaf(c) {
                wide.leaf(c)
            } else {
                let index = wide.bvh.nodes.len();
                wide.bvh.nodes.push(Node::EMPTY);
                todo.push((c, index, depth + 1));
                Child::node(index)
            };
            let (bounds, margin) = (tree[c as usize].bounds(), wide.margin);
            wide.bvh.nodes[place].set(lane, child, &bounds, margin);
        }
        todo[first_todo..].reverse();
    }
    Some(wide.bvh)
}

fn costs(tree: &[Node2], source: &dyn Source, bounds: Bounds) -> Costs {
    let longest = bounds.extent().max_element();
    let scale = if longest > 0.0 { 1.0 / longest } else { 0.0 };
    let n_triangles = source.triangles() as u32;
    let mut costs =
        Costs { at_most: vec![[0.0; WIDTH]; tree.len()], triangles: vec![0; tree.len()], promise: vec![0.0; tree.len()] };
    for &n in top_down(tree).iter().rev() {
        let n = n as usize;
        let node = &tree[n];
        let area = Bounds { min: node.min * scale, max: node.max * scale }.half_area();
        if node.is_leaf() {
            let is_triangle = node.right < n_triangles;
            costs.triangles[n] = u32::from(is_triangle);
            costs.at_most[n] = [area * if is_triangle { BLOCK_COST } else { OBJECT_COST }; WIDTH];
            // The surface, for now.
            costs.promise[n] = if is_triangle {
                let [a, b, c] = source.vertices(node.right as usize).map(|p| p * scale);
                0.5 * (b - a).cross(c - a).length()
            } else {
                area
            };
            continue;
        }
        let (l, r) = (node.left as usize, node.right as usize);
        let (tl, tr) = (costs.triangles[l], costs.triangles[r]);
        let triangles = if tl > 0 && tr > 0 { tl.saturating_add(tr) } else { 0 };
        let (cl, cr) = (costs.at_most[l], costs.at_most[r]);
        costs.promise[n] = costs.promise[l] + costs.promise[r];
        // d[j − 1] for j ≥ 2.
        let mut d = [f32::INFINITY; WIDTH];
        for j in 2..=WIDTH {
            for k in 1..j {
                d[j - 1] = d[j - 1].min(cl[k - 1] + cr[j - k - 1]);
            }
        }
        let mut c = [0.0; WIDTH];
        let as_leaf =
            if fits_leaf(triangles) { area * BLOCK_COST * triangles.div_ceil(BLOCK as u32) as f32 } else { f32::INFINITY };
        c[0] = as_leaf.min(area * NODE_COST + d[WIDTH - 1]);
        for i in 1..WIDTH {
            c[i] = d[i].min(c[i - 1]);
        }
        costs.at_most[n] = c;
        // A subtree that is cheaper as a node is never part of a larger leaf.
        costs.triangles[n] = if as_leaf <= c[0] { triangles } else { 0 };
    }
    for (promise, (node, at_most)) in costs.promise.iter_mut().zip(tree.iter().zip(&costs.at_most)) {
        // A line through the box meets a surface of this size with this chance, and costs c / A: the area cancels unless the chance is 1.
        let area = Bounds { min: node.min * scale, max: node.max * scale }.half_area();
        *promise = promise.min(area) / at_most[0].max(f32::MIN_POSITIVE);
    }
    costs
}

fn fits_leaf(triangles: u32) -> bool {
    (1..=(BLOCK * Child::MAX_BLOCKS) as u32).contains(&triangles)
}

/// All nodes, parents before children.
fn top_down(tree: &[Node2]) -> Vec<u32> {
    let mut order = Vec::with_capacity(tree.len());
    order.push(0);
    let mut i = 0;
    while let Some(&n) = order.get(i) {
        let node = &tree[n as usize];
        if !node.is_leaf() {
            order.extend([node.left, node.right]);
        }
        i += 1;
    }
    order
}

struct Wide<'a> {
    tree: &'a [Node2],
    source: &'a dyn Source,
    costs: Costs,
    margin: f32,
    bvh: Bvh,
}

impl Wide<'_> {
    fn is_leaf(&self, n: u32) -> bool {
        self.tree[n as usize].is_leaf() || self.costs.triangles[n as usize] > 0
    }

    /// Subtrees that together make `n`, at the cost `d(n, slots)`.
    fn distribute(&self, n: u32, slots: usize, out: &mut Vec<u32>) {
        let node = &self.tree[n as usize];
        let (cl, cr) = (&self.costs.at_most[node.left as usize], &self.costs.at_most[node.right as usize]);
        let cost = |k: &usize| cl[k - 1] + cr[slots - k - 1];
        let k = (1..slots).min_by(|a, b| cost(a).total_cmp(&cost(b))).expect("two slots at least");
        self.forest(node.left, k, out);
        self.forest(node.right, slots - k, out);
    }

    /// Subtrees that together make `n`, at the cost `c(n, slots)`.
    fn forest(&self, n: u32, mut slots: usize, out: &mut Vec<u32>) {
        let c = &self.costs.at_most[n as usize];
        while slots > 1 && c[slots - 2] <= c[slots - 1] {
            slots -= 1;
        }
        if slots == 1 || self.tree[n as usize].is_leaf() {
            out.push(n);
        } else {
            self.distribute(n, slots, out);
        }
    }

    fn leaf(&mut self, n: u32) -> Child {
        let node = &self.tree[n as usize];
        let n_triangles = self.source.triangles();
        if node.is_leaf() && node.right as usize >= n_triangles {
            return Child::object(node.right as usize - n_triangles);
        }
        let (mut ids, mut todo) = (Vec::with_capacity(BLOCK * Child::MAX_BLOCKS), vec![n]);
        while let Some(n) = todo.pop() {
            let node = &self.tree[n as usize];
            if node.is_leaf() {
                ids.push(node.right);
            } else {
                todo.extend([node.right, node.left]);
            }
        }
        // The same triangle twice: parts of one that was split.
        ids.sort_unstable();
        ids.dedup();
        let first = self.bvh.blocks.len();
        for ids in ids.chunks(BLOCK) {
            let mut block = Block { count: ids.len() as u32, ..Block::EMPTY };
            for (lane, &id) in ids.iter().enumerate() {
                let vertices: [Vec3; 3] = self.source.vertices(id as usize);
                for (vertex, p) in vertices.iter().enumerate() {
                    for k in 0..3 {
                        block.vertices[k][vertex][lane] = p[k];
                    }
                }
                (block.instance[lane], block.primitive[lane]) = self.source.ids(id as usize);
                block.extent = block.extent.max(2.0 * Bounds::of(vertices).extent().max_element());
            }
            self.bvh.blocks.push(block);
        }
        Child::blocks(first, self.bvh.blocks.len() - first)
    }
}
