//! One ray down a tree.

use std::mem::MaybeUninit;

use super::Hit;
use super::bvh::{Block, Bvh, Child, Node, STACK};
use super::prepared::Prepared;
use super::triangle::{self, Found};
use crate::math::lanes::{Cpu, Lanes};
use crate::math::{DVec3, Vec3};

/// The nearest hit so far.
#[derive(Clone, Copy)]
pub(super) struct Best {
    /// Valid when `found`; until then `t` is the ray's end.
    pub hit: Hit,
    pub found: bool,
}

impl Best {
    pub(super) fn until(t_max: f32) -> Self {
        Self { hit: Hit { t: t_max, instance: u32::MAX, primitive: u32::MAX, u: 0.0, v: 0.0 }, found: false }
    }

    pub(super) fn get(&self) -> Option<Hit> {
        self.found.then_some(self.hit)
    }

    /// Takes a hit if it is nearer; of two at the same distance the one with the lower ids, so that the answer does not depend on the order
    /// of traversal.
    #[inline(always)]
    pub(super) fn offer(&mut self, hit: Hit, accept: &mut impl Accept) {
        let best = &self.hit;
        let nearer =
            hit.t < best.t || (hit.t == best.t && self.found && (hit.instance, hit.primitive) < (best.instance, best.primitive));
        if nearer && hit.t > 0.0 && accept.accept(&hit) {
            *self = Self { hit, found: true };
        }
    }
}

/// Whether a hit counts.
pub(super) trait Accept {
    fn accept(&mut self, hit: &Hit) -> bool;
}

/// All do.
pub(super) struct Always;

impl Accept for Always {
    #[inline(always)]
    fn accept(&mut self, _: &Hit) -> bool {
        true
    }
}

/// The caller says.
pub(super) struct Ask<'a>(pub &'a mut dyn FnMut(&Hit) -> bool);

impl Accept for Ask<'_> {
    fn accept(&mut self, hit: &Hit) -> bool {
        (self.0)(hit)
    }
}

/// What is done at leaves.
pub(super) trait Visit {
    type Accept: Accept;
    fn accept(&mut self) -> &mut Self::Accept;
    /// Offers an object's hits to `best`.
    fn closest(&mut self, object: usize, best: &mut Best);
    /// True when an object is hit before `t_max`.
    fn occluded(&mut self, object: usize, t_max: f32) -> bool;
    /// Added to a block's instance ids.
    fn instance(&self) -> u32;
    /// Told which block of the tree blocked a ray.
    #[inline(always)]
    fn blocked_by(&mut self, _block: usize) {}
}

/// A stack without start-up cost. Its height is a variable beside it, not within: the compiler keeps the one in a register, the other in memory
/// along with the slots.
pub(super) struct Stack<T>([MaybeUninit<T>; STACK]);

/// How many slots of a [`Stack`] are in use.
#[derive(Default)]
pub(super) struct Height(usize);

impl<T: Copy> Stack<T> {
    #[inline(always)]
    pub(super) fn new() -> (Self, Height) {
        (Self([const { MaybeUninit::uninit() }; STACK]), Height(0))
    }

    /// Panics when full, which the builder rules out (`bvh::MAX_DEPTH`).
    #[inline(always)]
    pub(super) fn push(&mut self, height: &mut Height, x: T) {
        self.0[height.0].write(x);
        height.0 += 1;
    }

    #[inline(always)]
    pub(super) fn pop(&mut self, height: &mut Height) -> Option<T> {
        height.0 = height.0.checked_sub(1)?;
        Some(self.get(height.0))
    }

    /// Puts the last `n` in descending order, by insertion: there are at most eight. A vectorised sorting network was 20 % slower on coherent rays, whose
    /// branches are predicted, and no faster on others.
    #[inline(always)]
    pub(super) fn sort_last(&mut self, height: &Height, n: usize)
    where
        T: Ord,
    {
        let first = height.0 - n;
        for i in first + 1..height.0 {
            let x = self.get(i);
            let mut j = i;
            while j > first && self.get(j - 1) < x {
                self.0[j] = self.0[j - 1];
                j -= 1;
            }
            self.0[j].write(x);
        }
    }

    #[inline(always)]
    fn get(&self, i: usize) -> T {
        #[expect(unsafe_code, reason = "clearing 2 kB for every ray costs as much as ten nodes")]
        // SAFETY: callers ask for slots below the height of this very stack, and only `push` raises it, after writing the slot.
        unsafe {
            self.0[i].assume_init()
        }
    }
}

/// A ray's constants in registers.
pub(super) struct Slabs<L> {
    inv: [L; 3],
    near: [L; 3],
    far: [L; 3],
    near_row: [usize; 3],
    far_row: [usize; 3],
}

impl<L: Lanes> Slabs<L> {
    #[inline(always)]
    pub(super) fn new(ray: &Prepared) -> Self {
        Self {
            inv: ray.inv.map(L::splat),
            near: ray.near.map(L::splat),
            far: ray.far.map(L::splat),
            near_row: ray.near_row,
            far_row: ray.far_row,
        }
    }

    /// Children whose boxes the ray may meet before `t_max`, and where.
    #[inline(always)]
    pub(super) fn test(&self, node: &Node, t_max: L) -> (u32, L) {
        let near = |k: usize| L::load(&node.rows[self.near_row[k] & 7]).mul_add(self.inv[k], self.near[k]);
        let far = |k: usize| L::load(&node.rows[self.far_row[k] & 7]).mul_add(self.inv[k], self.far[k]);
        let enter = near(0).max(near(1)).max(near(2).max(L::splat(0.0)));
        let leave = far(0).min(far(1)).min(far(2).min(t_max));
        (L::bits(enter.le(leave)), enter)
    }
}

/// A child to visit: distance in the upper half, so that keys compare by distance.
#[inline(always)]
fn key(t: f32, child: Child) -> u64 {
    u64::from(t.to_bits()) << 32 | u64::from(child.0)
}

/// The nearest entry of the stack that is not behind `t_max`.
#[inline(always)]
fn pop(stack: &mut Stack<u64>, height: &mut Height, t_max: f32) -> Option<Child> {
    loop {
        let k = stack.pop(height)?;
        if f32::from_bits((k >> 32) as u32) <= t_max {
            return Some(Child(k as u32));
        }
    }
}

/// Offers the nearest hit of a tree to `best`.
#[inline(always)]
pub(super) fn closest<C: Cpu, V: Visit>(bvh: &Bvh, ray: &Prepared, visit: &mut V, best: &mut Best) {
    let Some(mut node) = bvh.nodes.first() else { return };
    let slabs = Slabs::<C::Wide>::new(ray);
    let (mut stack, mut height) = Stack::<u64>::new();
    let mut t_max = best.hit.t * ray.inv_scale;
    loop {
        let (mut mask, enter) = slabs.test(node, C::Wide::splat(t_max));
        let mut next = None;
        if mask != 0 {
            let lane = mask.trailing_zeros();
            mask &= mask - 1;
            let first = node.child(lane);
            prefetch::<C>(bvh, first);
            if mask == 0 {
                next = Some(first);
            } else {
                let enter = enter.store();
                let other = mask.trailing_zeros();
                mask &= mask - 1;
                let (mut near, mut far) =
                    (key(enter[lane as usize & 7], first), key(enter[other as usize & 7], node.child(other)));
                prefetch::<C>(bvh, Child(far as u32));
                if far < near {
                    (near, far) = (far, near);
                }
                if mask == 0 {
                    stack.push(&mut height, far);
                    next = Some(Child(near as u32));
                } else {
                    stack.push(&mut height, far);
                    stack.push(&mut height, near);
                    let mut n = 2;
                    while mask != 0 {
                        let lane = mask.trailing_zeros();
                        mask &= mask - 1;
                        let child = node.child(lane);
                        prefetch::<C>(bvh, child);
                        stack.push(&mut height, key(enter[lane as usize & 7], child));
                        n += 1;
                    }
                    stack.sort_last(&height, n);
                    next = stack.pop(&mut height).map(|k| Child(k as u32));
                }
            }
        } else {
            next = pop(&mut stack, &mut height, t_max).or(next);
        }
        // Leaves until there is a node again.
        loop {
            let Some(child) = next else { return };
            if let Some(index) = child.as_node() {
                node = &bvh.nodes[index];
                break;
            }
            if let Some(object) = child.as_object() {
                visit.closest(object, best);
            } else {
                for block in &bvh.blocks[child.as_blocks()] {
                    leaf_closest::<C, V>(block, ray, visit, best, t_max);
                    t_max = best.hit.t * ray.inv_scale;
                }
            }
            t_max = best.hit.t * ray.inv_scale;
            next = pop(&mut stack, &mut height, t_max);
        }
    }
}

/// Asks for what a child leads to; of an object anything, which does no harm.
#[inline(always)]
pub(super) fn prefetch<C: Cpu>(bvh: &Bvh, child: Child) {
    C::prefetch(match child.as_node() {
        Some(node) => bvh.nodes.as_ptr().wrapping_add(node).cast(),
        None => bvh.blocks.as_ptr().wrapping_add(child.as_blocks().start).cast(),
    });
}

#[inline(always)]
fn leaf_closest<C: Cpu, V: Visit>(block: &Block, ray: &Prepared, visit: &mut V, best: &mut Best, t_max: f32) {
    if let Some(found) = triangle::test::<C::Wide>(ray, block, t_max)
        && found.sure | found.unsure != 0
    {
        take(block, ray, visit, best, &found);
    }
}

/// Offers the lanes that passed the test.
#[inline(always)]
fn take<L: Lanes, V: Visit>(block: &Block, ray: &Prepared, visit: &mut V, best: &mut Best, found: &Found<L>) {
    let (t, u, v) = (found.t.store(), found.u.store(), found.v.store());
    let base = visit.instance();
    let mut lanes = found.sure | found.unsure;
    while lanes != 0 {
        let lane = lanes.trailing_zeros() as usize;
        lanes &= lanes - 1;
        let (mut hit_t, mut hit_u, mut hit_v) = (t[lane], u[lane], v[lane]);
        if found.unsure >> lane & 1 != 0 {
            match precise(block, lane, ray) {
                Some(hit) => (hit_t, hit_u, hit_v) = hit,
                None => continue,
            }
        }
        let instance = block.instance[lane] + base;
        let hit = Hit { t: hit_t * ray.scale, instance, primitive: block.primitive[lane], u: hit_u, v: hit_v };
        best.offer(hit, visit.accept());
    }
}

/// One lane in f64.
pub(super) fn precise(block: &Block, lane: usize, ray: &Prepared) -> Option<(f32, f32, f32)> {
    let (o, d) = ray.exact();
    let vertex = |i: usize| Vec3::from(block.vertices.map(|axis| axis[i][lane])).as_dvec3() - o;
    let vertices: [DVec3; 3] = [vertex(0), vertex(1), vertex(2)];
    triangle::precise(d, vertices)
}

/// True when anything in a tree is hit before `t_max`, in the caller's parameter.
#[inline(always)]
pub(super) fn occluded<C: Cpu, V: Visit>(bvh: &Bvh, ray: &Prepared, visit: &mut V, t_max: f32) -> bool {
    let Some(mut node) = bvh.nodes.first() else { return false };
    let slabs = Slabs::<C::Wide>::new(ray);
    let (mut stack, mut height) = Stack::<Child>::new();
    let end = C::Wide::splat(t_max * ray.inv_scale);
    loop {
        let (mut mask, _) = slabs.test(node, end);
        let mut next = None;
        if mask != 0 {
            // The builder put the most promising child first.
            let first = mask.trailing_zeros();
            mask &= mask - 1;
            while mask != 0 {
                let lane = 31 - mask.leading_zeros();
                mask ^= 1 << lane;
                let child = node.child(lane);
                prefetch::<C>(bvh, child);
                stack.push(&mut height, child);
            }
            next = Some(node.child(first));
        }
        loop {
            let Some(child) = next.take().or_else(|| stack.pop(&mut height)) else { return false };
            if let Some(index) = child.as_node() {
                node = &bvh.nodes[index];
                break;
            }
            if let Some(object) = child.as_object() {
                if visit.occluded(object, t_max) {
                    return true;
                }
            } else {
                let range = child.as_blocks();
                for (i, block) in bvh.blocks[range.clone()].iter().enumerate() {
                    if leaf_occluded::<C, V>(block, ray, visit, t_max) {
                        visit.blocked_by(range.start + i);
                        return true;
                    }
                }
            }
        }
    }
}

#[inline(always)]
pub(super) fn leaf_occluded<C: Cpu, V: Visit>(block: &Block, ray: &Prepared, visit: &mut V, t_max: f32) -> bool {
    let Some(found) = triangle::test::<C::Wide>(ray, block, t_max * ray.inv_scale) else { return false };
    if found.sure | found.unsure == 0 {
        return false;
    }
    // The end itself is excluded.
    let mut best = Best::until(t_max);
    take(block, ray, visit, &mut best, &found);
    best.found
}
