//! Many rays between two patches: how much of one does the other see?
//!
//! Most pairs of patches see each other fully or not at all, and neighbours in a list of pairs have neighbouring answers. So:
//!
//! 1. What blocked last, and one probe ray: if it is blocked, the block of triangles that did it is tried against all rays, eight at a
//!    time.
//! 2. If the probe is clear, the shaft of all rays is taken through the tree. If it meets at most [`FEW_LEAVES`] leaves and [`FEW_TRIANGLES`]
//!    of their triangles' boxes, those are all there is to test; none is the most frequent number. Else the search is given up: in dense
//!    surroundings the shaft meets more and more boxes.
//! 3. What is left is traced in packets.
//!
//! The shaft from a box *A* to a box *B* at `s` of the way is the box *(1 − s) A + s B*; the union over `s` in [0, 1] is all segments between
//! them, no more. Whether it meets a box of the tree is a question of intervals of `s`, as for a ray: one per plane.

use super::bvh::{Block, Bvh, LARGEST, Node};
use super::collect::{Any, blocked_by};
use super::dispatch::{InScene, Kernels};
use super::packet::{self, Columns, Sheared};
use super::prepared::Prepared;
use super::traverse::{self, Always, Best, Stack, Visit, leaf_occluded};
use super::{Accel, Ray};
use crate::math::lanes::Lanes;
use crate::math::{Bounds, Vec3};

/// Leaves that a shaft may meet before it is given up.
const FEW_LEAVES: usize = 24;

/// Triangles in them that it may meet.
const FEW_TRIANGLES: u32 = 32;

/// Rays taken together.
const BATCH: usize = 64;

/// What blocked last; see [`Accel::occluded_between`].
#[derive(Clone, Copy, Debug, Default)]
pub struct Occluder {
    /// One of the tree's blocks.
    block: Option<u32>,
}

/// Whether each of the rays hits anything.
#[inline(always)]
pub(super) fn occluded_between<C: Kernels>(accel: &Accel, rays: &[Ray], occluder: &mut Occluder, blocked: &mut Vec<bool>) {
    blocked.clear();
    for batch in rays.chunks(BATCH) {
        let bits = of_batch::<C>(accel, batch, occluder);
        blocked.extend((0..batch.len()).map(|i| bits >> i & 1 != 0));
    }
}

/// Eight rays of a batch.
struct Group<L> {
    rays: [Ray; 8],
    columns: Columns<L>,
    by_axis: [u32; 3],
}

/// The rays of a batch, each group made ready when it is first asked for.
struct Groups<'a, L> {
    rays: &'a [Ray],
    bounds: &'a Bounds,
    groups: [Option<Group<L>>; BATCH / 8],
}

impl<'a, L: Lanes> Groups<'a, L> {
    #[inline(always)]
    fn get(&mut self, g: usize) -> &Group<L> {
        // Not `get_or_insert_with`: its closure would not be compiled for the processor.
        if self.groups[g].is_none() {
            let rays: [Ray; 8] = std::array::from_fn(|i| self.rays[(8 * g + i).min(self.rays.len() - 1)]);
            let columns = Columns::new(&rays, self.bounds);
            self.groups[g] = Some(Group { by_axis: columns.by_axis(), columns, rays });
        }
        self.groups[g].as_ref().expect("made above")
    }

    /// Those of the rays in `todo` that some triangles of a block, by lane, block.
    #[inline(always)]
    fn blocked_by(&mut self, block: &Block, lanes: u32, todo: u64) -> u64 {
        let mut bits = 0;
        for g in 0..BATCH / 8 {
            let todo = (todo >> (8 * g) & 0xFF) as u32;
            if todo == 0 {
                continue;
            }
            let group = self.get(g);
            let mut blocked = 0;
            for kz in 0..3 {
                let active = todo & group.by_axis[kz];
                if active == 0 {
                    continue;
                }
                let sheared = Sheared::new(&group.columns, kz);
                let mut lanes = lanes;
                while lanes != 0 && active & !blocked != 0 {
                    let lane = lanes.trailing_zeros() as usize;
                    lanes &= lanes - 1;
                    if let Some(found) = sheared.test(&group.columns, block, lane, group.columns.t_max) {
                        blocked |= blocked_by(&group.rays, block, lane, &found, group.columns.t_max, active & !blocked);
                    }
                }
            }
            bits |= u64::from(blocked) << (8 * g);
        }
        bits
    }
}

/// Bits of the blocked ones of at most 64 rays.
#[inline(always)]
fn of_batch<C: Kernels>(accel: &Accel, rays: &[Ray], occluder: &mut Occluder) -> u64 {
    let tree = &accel.tree;
    let all = u64::MAX >> (BATCH - rays.len());
    let mut groups = Groups::<C::Wide> { rays, bounds: &tree.bounds, groups: [const { None }; BATCH / 8] };
    let mut blocked = 0;

    let probe = rays.len() / 2;
    let hit = occluder.block.filter(|&b| tree.blocks.get(b as usize).is_some_and(|b| blocks::<C>(accel, b, &rays[probe])));
    let hit = hit.map(|b| Blocked::By(b as usize)).unwrap_or_else(|| alone::<C>(accel, &rays[probe]));
    let mut todo = all & !(1 << probe);
    match hit {
        Blocked::By(b) => {
            occluder.block = Some(b as u32);
            blocked = 1 << probe | groups.blocked_by(&tree.blocks[b], every_lane(&tree.blocks[b]), todo);
        }
        Blocked::ByObject => blocked = 1 << probe,
        Blocked::No => {
            if let Some(found) = Shaft::around(rays).and_then(|shaft| shaft.triangles::<C::Wide>(tree)) {
                // Rays that cannot be tested eight at a time are left for later.
                todo &= !usable(&mut groups, todo);
                let asked = all & !todo & !(1 << probe);
                for (b, lanes) in found.into_iter().flatten() {
                    let by = groups.blocked_by(&tree.blocks[b as usize], lanes, asked & !blocked);
                    if by != 0 {
                        occluder.block = Some(b);
                    }
                    blocked |= by;
                }
            }
        }
    }
    todo &= !blocked;

    for g in 0..BATCH / 8 {
        let active = (todo >> (8 * g) & 0xFF) as u32;
        if active == 0 {
            continue;
        }
        let group = groups.get(g);
        let mut any = Any::<C>::new(accel, &group.rays, group.columns.t_max);
        let together = packet::trace::<C, _>(tree, &group.columns, active, &mut any);
        let mut bits = any.blocked;
        let mut single = active & !together;
        while single != 0 {
            let i = single.trailing_zeros();
            single &= single - 1;
            bits |= u32::from(C::occluded(accel, &group.rays[i as usize & 7], &mut Always)) << i;
        }
        blocked |= u64::from(bits) << (8 * g);
    }
    blocked
}

fn every_lane(block: &Block) -> u32 {
    (1 << block.count) - 1
}

#[inline(always)]
fn usable<L: Lanes>(groups: &mut Groups<'_, L>, rays: u64) -> u64 {
    let n = groups.rays.len().div_ceil(8);
    (0..n).fold(0, |bits, g| bits | u64::from(groups.get(g).columns.usable) << (8 * g)) & rays
}

/// What blocks a ray.
enum Blocked {
    No,
    /// A block of triangles.
    By(usize),
    ByObject,
}

/// True when a block of triangles blocks a ray.
#[inline(always)]
fn blocks<C: Kernels>(accel: &Accel, block: &Block, ray: &Ray) -> bool {
    let mut all = Always;
    let visit = &mut Remember::<C> { scene: InScene::new(accel, ray, &mut all), block: None };
    Prepared::new(ray, &accel.tree.bounds).is_some_and(|p| leaf_occluded::<C, _>(block, &p, visit, ray.t_max))
}

#[inline(always)]
fn alone<C: Kernels>(accel: &Accel, ray: &Ray) -> Blocked {
    let Some(prepared) = Prepared::new(ray, &accel.tree.bounds) else { return Blocked::No };
    let mut all = Always;
    let mut visit = Remember::<C> { scene: InScene::new(accel, ray, &mut all), block: None };
    match traverse::occluded::<C, _>(&accel.tree, &prepared, &mut visit, ray.t_max) {
        false => Blocked::No,
        true => visit.block.map_or(Blocked::ByObject, Blocked::By),
    }
}

/// At the leaves of a scene's tree, remembering which block was hit.
struct Remember<'a, C> {
    scene: InScene<'a, C, Always>,
    block: Option<usize>,
}

impl<C: Kernels> Visit for Remember<'_, C> {
    type Accept = Always;
    #[inline(always)]
    fn accept(&mut self) -> &mut Always {
        self.scene.accept()
    }
    #[inline(always)]
    fn instance(&self) -> u32 {
        0
    }
    fn closest(&mut self, object: usize, best: &mut Best) {
        self.scene.closest(object, best);
    }
    fn occluded(&mut self, object: usize, t_max: f32) -> bool {
        self.scene.occluded(object, t_max)
    }
    #[inline(always)]
    fn blocked_by(&mut self, block: usize) {
        self.block = Some(block);
    }
}

/// All segments from one box to another.
struct Shaft {
    /// For each axis the lower and the upper border.
    borders: [Border; 6],
}

/// A plane of a box bounds the part of the way: `s = plane·inv + c`, from above or from below.
#[derive(Clone, Copy)]
struct Border {
    row: usize,
    inv: f32,
    c: f32,
    is_upper: bool,
}

impl Shaft {
    /// Around segments; `None` when one has no finite end.
    #[inline(always)]
    fn around(rays: &[Ray]) -> Option<Self> {
        let (mut a, mut b) = (Bounds::EMPTY, Bounds::EMPTY);
        for ray in rays {
            a = a.with(ray.origin);
            b = b.with(ray.at(ray.t_max));
        }
        let size = a.min.abs().max(a.max.abs()).max(b.min.abs()).max(b.max.abs());
        // `Bounds` passes over NaN: a sum does not.
        let sum: Vec3 = rays.iter().map(|r| r.origin + r.at(r.t_max)).sum();
        if !(sum.is_finite() && size.max_element() <= LARGEST) {
            return None;
        }
        // Rounding of the ends, of the slopes and of the test itself.
        let slack = size * (8.0 * f32::EPSILON) + f32::MIN_POSITIVE;
        let tiny = size.max_element() * 1e-15 + f32::MIN_POSITIVE;
        let border = |i: usize| {
            let k = i / 2;
            let (row, from, to) = if i.is_multiple_of(2) {
                // The lower border must pass below the box's upper plane,
                (k + 3, a.min[k] - slack[k], b.min[k] - slack[k])
            } else {
                // and the upper border above its lower plane.
                (k, a.max[k] + slack[k], b.max[k] + slack[k])
            };
            let slope = to - from;
            let slope = if slope.abs() < tiny { tiny } else { slope };
            let inv = 1.0 / slope;
            Border { row, inv, c: -from * inv, is_upper: i.is_multiple_of(2) == (slope > 0.0) }
        };
        Some(Self { borders: std::array::from_fn(border) })
    }

    /// Children whose boxes the shaft may meet.
    #[inline(always)]
    fn test<L: Lanes>(&self, node: &Node) -> u32 {
        let (mut first, mut last) = (L::splat(0.0), L::splat(1.0));
        for b in &self.borders {
            let s = L::load(&node.rows[b.row & 7]).mul_add(L::splat(b.inv), L::splat(b.c));
            if b.is_upper {
                last = s.min(last);
            } else {
                first = s.max(first);
            }
        }
        L::bits(first.le(last))
    }

    /// Triangles of a block whose boxes the shaft may meet.
    #[inline(always)]
    fn test_triangles<L: Lanes>(&self, block: &Block) -> u32 {
        let (mut first, mut last) = (L::splat(0.0), L::splat(1.0));
        for (i, b) in self.borders.iter().enumerate() {
            let [p, q, r] = &block.vertices[i / 2];
            let (p, q, r) = (L::load(p), L::load(q), L::load(r));
            let plane = if b.row < 3 { p.min(q).min(r) } else { p.max(q).max(r) };
            let s = plane.mul_add(L::splat(b.inv), L::splat(b.c));
            if b.is_upper {
                last = s.min(last);
            } else {
                first = s.max(first);
            }
        }
        L::bits(first.le(last)) & every_lane(block)
    }

    /// The triangles it meets, by block and lane; `None` when they or their leaves are many, or there is an object.
    #[inline(always)]
    fn triangles<L: Lanes>(&self, tree: &Bvh) -> Option<[Option<(u32, u32)>; FEW_LEAVES]> {
        let mut found = [None; FEW_LEAVES];
        let (mut n, mut n_triangles, mut n_leaves) = (0, 0, 0);
        let (mut stack, mut height) = Stack::<u32>::new();
        let mut node = tree.nodes.first()?;
        loop {
            let mut mask = self.test::<L>(node);
            while mask != 0 {
                let child = node.child(mask.trailing_zeros());
                mask &= mask - 1;
                if let Some(index) = child.as_node() {
                    stack.push(&mut height, index as u32);
                    continue;
                }
                n_leaves += 1;
                if child.as_object().is_some() || n_leaves > FEW_LEAVES {
                    return None;
                }
                for b in child.as_blocks() {
                    let lanes = self.test_triangles::<L>(&tree.blocks[b]);
                    if lanes != 0 {
                        n_triangles += lanes.count_ones();
                        if n == FEW_LEAVES || n_triangles > FEW_TRIANGLES {
                            return None;
                        }
                        found[n] = Some((b as u32, lanes));
                        n += 1;
                    }
                }
            }
            let Some(next) = stack.pop(&mut height) else { return Some(found) };
            node = &tree.nodes[next as usize];
        }
    }
}
