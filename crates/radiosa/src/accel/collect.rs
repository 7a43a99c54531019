//! What packets of rays make of the hits they are shown: the nearest of each, or that there is one.

use super::Hit;
use super::bvh::Block;
use super::dispatch::{InScene, Kernels};
use super::packet::{Collect, precise};
use super::traverse::{Always, Best, Visit};
use super::triangle::Found;
use super::{Accel, Ray};
use crate::math::lanes::Lanes;

/// The nearest hits.
pub(super) struct Nearest<'a, C: Kernels> {
    accel: &'a Accel,
    rays: &'a [Ray; 8],
    t: C::Wide,
    u: C::Wide,
    v: C::Wide,
    /// Ids, as bits.
    instance: C::Wide,
    primitive: C::Wide,
    found: u32,
}

impl<'a, C: Kernels> Nearest<'a, C> {
    #[inline(always)]
    pub(super) fn new(accel: &'a Accel, rays: &'a [Ray; 8], t_max: C::Wide) -> Self {
        let (zero, none) = (C::Wide::splat(0.0), C::Wide::splat(f32::from_bits(u32::MAX)));
        Self { accel, rays, t: t_max, u: zero, v: zero, instance: none, primitive: none, found: 0 }
    }

    /// The hits so far.
    #[inline(always)]
    pub(super) fn hits(&self) -> [Option<Hit>; 8] {
        let (t, u, v) = (self.t.store(), self.u.store(), self.v.store());
        let (instance, primitive) = (self.instance.store(), self.primitive.store());
        std::array::from_fn(|i| {
            let hit = || Hit { t: t[i], instance: instance[i].to_bits(), primitive: primitive[i].to_bits(), u: u[i], v: v[i] };
            (self.found >> i & 1 != 0).then(hit)
        })
    }

    #[inline(always)]
    fn best(&self, i: usize) -> Best {
        let mut best = Best::until(self.t.store()[i]);
        if let Some(hit) = self.hits()[i] {
            best = Best { hit, found: true };
        }
        best
    }

    #[inline(always)]
    fn set(&mut self, i: usize, best: &Best) {
        let put = |lanes: &mut C::Wide, x: f32| *lanes = C::Wide::select(C::Wide::mask(1 << i), C::Wide::splat(x), *lanes);
        let hit = &best.hit;
        put(&mut self.t, hit.t);
        put(&mut self.u, hit.u);
        put(&mut self.v, hit.v);
        put(&mut self.instance, f32::from_bits(hit.instance));
        put(&mut self.primitive, f32::from_bits(hit.primitive));
        self.found |= u32::from(best.found) << i;
    }
}

impl<C: Kernels> Collect<C::Wide> for Nearest<'_, C> {
    const NEAREST: bool = true;

    #[inline(always)]
    fn triangle(&mut self, block: &Block, lane: usize, found: &Found<C::Wide>, active: u32) {
        type L<C> = <C as crate::math::lanes::Cpu>::Wide;
        let nearer = L::<C>::bits(found.t.lt(self.t)) & found.sure & active;
        let mask = L::<C>::mask(nearer);
        let take = |new: L<C>, old: L<C>| L::<C>::select(mask, new, old);
        let id = |bits: u32| L::<C>::splat(f32::from_bits(bits));
        // Ties, and what f64 must decide.
        let mut rest = active & (found.sure & !nearer | found.unsure);
        let t_before = self.t;
        self.t = take(found.t, self.t);
        self.u = take(found.u, self.u);
        self.v = take(found.v, self.v);
        self.instance = take(id(block.instance[lane]), self.instance);
        self.primitive = take(id(block.primitive[lane]), self.primitive);
        self.found |= nearer;
        if rest == 0 {
            return;
        }
        let (t, u, v) = (found.t.store(), found.u.store(), found.v.store());
        let before = t_before.store();
        while rest != 0 {
            let i = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            let mut hit = Hit { t: t[i], instance: block.instance[lane], primitive: block.primitive[lane], u: u[i], v: v[i] };
            if found.unsure >> i & 1 != 0 {
                match precise(&self.rays[i], block, lane) {
                    Some((t, u, v)) => hit = Hit { t, u, v, ..hit },
                    None => continue,
                }
            } else if t[i] > before[i] {
                continue;
            }
            let mut best = self.best(i);
            best.offer(hit, &mut Always);
            self.set(i, &best);
        }
    }

    #[inline(always)]
    fn object(&mut self, object: usize, active: u32) {
        for i in (0..8).filter(|i| active >> i & 1 != 0) {
            let mut best = self.best(i);
            InScene::<C, Always>::new(self.accel, &self.rays[i], &mut Always).closest(object, &mut best);
            self.set(i, &best);
        }
    }

    #[inline(always)]
    fn t_max(&self) -> C::Wide {
        self.t
    }

    #[inline(always)]
    fn active(&self) -> u32 {
        0xFF
    }
}

/// Rays that a triangle blocks, of those asked about; `t_max` is excluded.
#[inline(always)]
pub(super) fn blocked_by<L: Lanes>(rays: &[Ray; 8], block: &Block, lane: usize, found: &Found<L>, t_max: L, active: u32) -> u32 {
    let mut blocked = found.sure & active & L::bits(found.t.lt(t_max));
    let mut unsure = found.unsure & active;
    while unsure != 0 {
        let i = unsure.trailing_zeros();
        unsure &= unsure - 1;
        let ray = &rays[i as usize & 7];
        if precise(ray, block, lane).is_some_and(|(t, ..)| t > 0.0 && t < ray.t_max) {
            blocked |= 1 << i;
        }
    }
    blocked
}

/// Whether there is any hit.
pub(super) struct Any<'a, C: Kernels> {
    accel: &'a Accel,
    rays: &'a [Ray; 8],
    t_max: C::Wide,
    /// Rays that hit something.
    pub blocked: u32,
}

impl<'a, C: Kernels> Any<'a, C> {
    #[inline(always)]
    pub(super) fn new(accel: &'a Accel, rays: &'a [Ray; 8], t_max: C::Wide) -> Self {
        Self { accel, rays, t_max, blocked: 0 }
    }
}

impl<C: Kernels> Collect<C::Wide> for Any<'_, C> {
    const NEAREST: bool = false;

    #[inline(always)]
    fn triangle(&mut self, block: &Block, lane: usize, found: &Found<C::Wide>, active: u32) {
        self.blocked |= blocked_by(self.rays, block, lane, found, self.t_max, active & !self.blocked);
    }

    #[inline(always)]
    fn object(&mut self, object: usize, active: u32) {
        for i in (0..8).filter(|i| active >> i & 1 != 0) {
            let ray = &self.rays[i];
            if InScene::<C, Always>::new(self.accel, ray, &mut Always).occluded(object, ray.t_max) {
                self.blocked |= 1 << i;
            }
        }
    }

    #[inline(always)]
    fn t_max(&self) -> C::Wide {
        self.t_max
    }

    #[inline(always)]
    fn active(&self) -> u32 {
        !self.blocked
    }
}
