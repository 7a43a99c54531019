//! Polishing a binary tree: subtrees are taken out and put back where they cost less.
//!
//! [Bittner13] (*Fast Insertion-Based Optimization of Bounding Volume Hierarchies*), in rounds as [Meister18] (*Parallel Reinsertion for Bounding
//! Volume Hierarchy Optimization*): the best place of many large subtrees is searched for at once in the tree as it is, then those that do
//! not disturb each other are moved, most profitable first. Cost is the sum of the areas of the inner nodes.
//!
//! Taking out node `l` removes its parent `p`: the sibling moves up, and the ancestors shrink. Putting it in at `x` makes a new
//! node over both, and grows the nodes from there up to where the two paths meet.

use std::collections::BinaryHeap;

use rayon::prelude::*;

use super::binary::Node2;
use crate::math::{Bounds, Vec3};

/// Rounds, and the part of all nodes tried in each. Twelve rounds of 0.15 gained one percent more.
const ROUNDS: usize = 5;
const PART: f32 = 0.08;

/// Places looked at for one subtree, at most: what is best is found early, proving it takes long.
const MAX_VISITS: usize = 400;

/// Moves subtrees while it pays.
pub(super) fn optimise(tree: &mut [Node2]) {
    if tree.len() < 8 {
        return;
    }
    let longest = (tree[0].max - tree[0].min).max_element();
    let scale = if longest > 0.0 { 1.0 / longest } else { return };
    let mut links = Links::of(tree, scale);
    let n_tried = ((tree.len() as f32 * PART) as usize).max(tree.len().min(2000));
    for _ in 0..ROUNDS {
        let mut by_area: Vec<(f32, u32)> = (1..tree.len() as u32).map(|n| (links.area(&tree[n as usize]), n)).collect();
        let order = |a: &(f32, u32), b: &(f32, u32)| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1));
        if n_tried < by_area.len() {
            by_area.select_nth_unstable_by(n_tried, order);
            by_area.truncate(n_tried);
        }
        let mut moves: Vec<Move> = by_area.par_iter().filter_map(|&(_, n)| links.best_place(tree, n)).collect();
        moves.sort_unstable_by(|a, b| b.gain.total_cmp(&a.gain).then(a.node.cmp(&b.node)));
        let mut touched = vec![false; tree.len()];
        let mut n_moved = 0;
        for m in &moves {
            n_moved += usize::from(links.apply(tree, m, &mut touched));
        }
        if n_moved == 0 {
            break;
        }
    }
}

struct Move {
    gain: f32,
    node: u32,
    to: u32,
}

/// Parents, which the tree does not store.
struct Links {
    parent: Vec<u32>,
    scale: f32,
}

/// A place to look at: the gain there if putting the node in cost nothing more, ordered by it.
#[derive(PartialEq)]
struct Place(f32, u32);

impl Eq for Place {}

impl PartialOrd for Place {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Place {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0).then(other.1.cmp(&self.1))
    }
}

impl Links {
    fn of(tree: &[Node2], scale: f32) -> Self {
        let mut parent = vec![0; tree.len()];
        for (i, node) in tree.iter().enumerate().filter(|(_, n)| !n.is_leaf()) {
            parent[node.left as usize] = i as u32;
            parent[node.right as usize] = i as u32;
        }
        Self { parent, scale }
    }

    fn area(&self, node: &Node2) -> f32 {
        self.area_of(node.min, node.max)
    }

    fn area_of(&self, min: Vec3, max: Vec3) -> f32 {
        let e = (max - min) * self.scale;
        e.x * e.y + e.y * e.z + e.z * e.x
    }

    fn sibling(&self, tree: &[Node2], n: u32) -> u32 {
        let p = &tree[self.parent[n as usize] as usize];
        if p.left == n { p.right } else { p.left }
    }

    /// Where a node costs least, if anywhere less than where it is.
    fn best_place(&self, tree: &[Node2], n: u32) -> Option<Move> {
        let node = &tree[n as usize];
        let parent = self.parent[n as usize];
        if parent == 0 {
            return None;
        }
        let (own, least_gain) = (self.area(node), 1e-7);
        let mut best = Move { gain: least_gain, node: n, to: 0 };
        // What is saved by taking it out, up to the ancestor that stays as it is.
        let mut saved = self.area(&tree[parent as usize]);
        let mut pivot = parent;
        let mut without = tree[self.sibling(tree, n) as usize].bounds();
        let mut visits = 0;
        let mut places = BinaryHeap::new();
        loop {
            let beside = self.sibling(tree, pivot);
            places.push(Place(saved, beside));
            // Most promising first; no place is better than its bound less the node's own area.
            while let Some(Place(bound, x)) = places.pop() {
                if bound - own <= best.gain || visits > MAX_VISITS {
                    break;
                }
                visits += 1;
                let at = &tree[x as usize];
                let merged = self.area_of(at.min.min(node.min), at.max.max(node.max));
                if bound - merged > best.gain {
                    best = Move { gain: bound - merged, node: n, to: x };
                }
                if !at.is_leaf() {
                    let below = bound - (merged - self.area(at));
                    if below - own > best.gain {
                        places.push(Place(below, at.left));
                        places.push(Place(below, at.right));
                    }
                }
            }
            places.clear();
            without = without.union(tree[beside as usize].bounds());
            pivot = self.parent[pivot as usize];
            if pivot == 0 {
                break;
            }
            saved += self.area(&tree[pivot as usize]) - self.area_of(without.min, without.max);
        }
        (best.gain > least_gain).then_some(best)
    }

    /// Moves a node unless something near has been moved in this round.
    fn apply(&mut self, tree: &mut [Node2], m: &Move, touched: &mut [bool]) -> bool {
        let (n, x) = (m.node, m.to);
        let p = self.parent[n as usize];
        let g = self.parent[p as usize];
        let s = self.sibling(tree, n);
        let above = self.parent[x as usize];
        let near = [n, p, s, g, x, above];
        if p == 0 || x == p || x == s || above == p || near.iter().any(|&i| touched[i as usize]) {
            return false;
        }
        // Another move may have brought the place below the node.
        let mut up = x;
        while up != 0 {
            if up == n {
                return false;
            }
            up = self.parent[up as usize];
        }
        near.iter().for_each(|&i| touched[i as usize] = true);
        self.replace(tree, g, p, s);
        self.replace(tree, above, x, p);
        (tree[p as usize].left, tree[p as usize].right) = (n, x);
        self.parent[x as usize] = p;
        self.refit(tree, g);
        self.refit(tree, p);
        true
    }

    fn replace(&mut self, tree: &mut [Node2], parent: u32, old: u32, new: u32) {
        let node = &mut tree[parent as usize];
        *(if node.left == old { &mut node.left } else { &mut node.right }) = new;
        self.parent[new as usize] = parent;
    }

    /// Boxes from a node up to the root.
    fn refit(&self, tree: &mut [Node2], mut n: u32) {
        loop {
            let node = tree[n as usize];
            let Bounds { min, max } = tree[node.left as usize].bounds().union(tree[node.right as usize].bounds());
            (tree[n as usize].min, tree[n as usize].max) = (min, max);
            if n == 0 {
                return;
            }
            n = self.parent[n as usize];
        }
    }
}
