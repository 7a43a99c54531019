//! Queries of a whole scene, compiled once for each processor.

use std::marker::PhantomData;

use super::bvh::Bvh;
use super::collect::{Any, Nearest};
use super::object::Kind;
use super::packet::{self, Columns};
use super::pair::{Occluder, occluded_between};
use super::prepared::Prepared;
use super::region::{HalfSpace, Triangle, triangles_in};
use super::traverse::{self, Accept, Always, Best, Visit};
use super::{Accel, Hit};
use crate::math::Ray;
use crate::math::lanes::{Cpu, Portable};

#[cfg(target_arch = "x86_64")]
use crate::math::lanes::Avx2;

/// Kernels by processor: for each, the generic function it is an instance of.
macro_rules! kernels {
    ($($(#[$doc:meta])* fn $name:ident$(<$accept:ident>)?($($arg:ident: $ty:ty),*) $(-> $ret:ty)? = $generic:ident;)*) => {
        /// What can be asked of a scene, on a processor.
        pub(super) trait Kernels: Cpu {
            $($(#[$doc])* fn $name$(<$accept: Accept>)?($($arg: $ty),*) $(-> $ret)?;)*
        }

        impl Kernels for Portable {
            $(fn $name$(<$accept: Accept>)?($($arg: $ty),*) $(-> $ret)? {
                $generic::<Self, $($accept)?>($($arg),*)
            })*
        }

        #[cfg(target_arch = "x86_64")]
        impl Kernels for Avx2 {
            $(fn $name$(<$accept: Accept>)?($($arg: $ty),*) $(-> $ret)? {
                #[target_feature(enable = "avx2,fma")]
                fn compiled$(<$accept: Accept>)?($($arg: $ty),*) $(-> $ret)? {
                    $generic::<Avx2, $($accept)?>($($arg),*)
                }
                #[expect(unsafe_code, reason = "calling code compiled for more than the baseline")]
                // SAFETY: an `Accel` has the path `Avx2` only after `CpuPath::available` saw that the processor has both features, and
                // only `Accel`'s methods lead here.
                unsafe {
                    compiled$(::<$accept>)?($($arg),*)
                }
            })*
        }
    };
}
kernels! {
    /// The nearest hit in the scene.
    fn closest<A>(accel: &Accel, ray: &Ray, accept: &mut A) -> Option<Hit> = closest_in_scene;
    /// Whether the ray hits anything in the scene.
    fn occluded<A>(accel: &Accel, ray: &Ray, accept: &mut A) -> bool = occluded_in_scene;
    /// The nearest hits of those of eight rays whose bits are set.
    fn closest8(accel: &Accel, rays: &[Ray; 8], active: u8) -> [Option<Hit>; 8] = closest8_in_scene;
    /// Those of eight rays that hit anything.
    fn occluded8(accel: &Accel, rays: &[Ray; 8], active: u8) -> u8 = occluded8_in_scene;
    /// Whether each of some rays between two patches hits anything.
    fn occluded_between(accel: &Accel, rays: &[Ray], occluder: &mut Occluder, blocked: &mut Vec<bool>) = occluded_between;
    /// The triangles that may reach into a convex region.
    fn triangles_in(accel: &Accel, region: &[HalfSpace], found: &mut [Triangle]) -> Option<usize> = triangles_in;
    /// Offers the nearest hit of a shared shape.
    fn closest_in_shape<A>(bvh: &Bvh, ray: &Ray, visit: &mut InShape<'_, A>, best: &mut Best) = closest_in_tree;
    /// Whether the ray hits anything of a shared shape.
    fn occluded_in_shape<A>(bvh: &Bvh, ray: &Ray, visit: &mut InShape<'_, A>) -> bool = occluded_in_tree;
}

#[inline(always)]
fn closest_in_scene<C: Kernels, A: Accept>(accel: &Accel, ray: &Ray, accept: &mut A) -> Option<Hit> {
    let prepared = Prepared::new(ray, &accel.tree.bounds)?;
    let mut best = Best::until(ray.t_max);
    traverse::closest::<C, _>(&accel.tree, &prepared, &mut InScene::<C, A>::new(accel, ray, accept), &mut best);
    best.get()
}

#[inline(always)]
fn occluded_in_scene<C: Kernels, A: Accept>(accel: &Accel, ray: &Ray, accept: &mut A) -> bool {
    let Some(prepared) = Prepared::new(ray, &accel.tree.bounds) else { return false };
    traverse::occluded::<C, _>(&accel.tree, &prepared, &mut InScene::<C, A>::new(accel, ray, accept), ray.t_max)
}

#[inline(always)]
fn closest8_in_scene<C: Kernels>(accel: &Accel, rays: &[Ray; 8], active: u8) -> [Option<Hit>; 8] {
    let columns = Columns::<C::Wide>::new(rays, &accel.tree.bounds);
    let mut nearest = Nearest::<C>::new(accel, rays, columns.t_max);
    let together = packet::trace::<C, _>(&accel.tree, &columns, u32::from(active), &mut nearest);
    let mut hits = nearest.hits();
    let mut alone = u32::from(active) & !together;
    while alone != 0 {
        let i = alone.trailing_zeros() as usize;
        alone &= alone - 1;
        hits[i] = C::closest(accel, &rays[i], &mut Always);
    }
    hits
}

#[inline(always)]
fn occluded8_in_scene<C: Kernels>(accel: &Accel, rays: &[Ray; 8], active: u8) -> u8 {
    let columns = Columns::<C::Wide>::new(rays, &accel.tree.bounds);
    let mut any = Any::<C>::new(accel, rays, columns.t_max);
    let together = packet::trace::<C, _>(&accel.tree, &columns, u32::from(active), &mut any);
    let mut blocked = any.blocked;
    let mut alone = u32::from(active) & !together;
    while alone != 0 {
        let i = alone.trailing_zeros() as usize;
        alone &= alone - 1;
        blocked |= u32::from(C::occluded(accel, &rays[i], &mut Always)) << i;
    }
    blocked as u8
}

#[inline(always)]
fn closest_in_tree<C: Cpu, A: Accept>(bvh: &Bvh, ray: &Ray, visit: &mut InShape<'_, A>, best: &mut Best) {
    if let Some(prepared) = Prepared::new(ray, &bvh.bounds) {
        traverse::closest::<C, _>(bvh, &prepared, visit, best);
    }
}

#[inline(always)]
fn occluded_in_tree<C: Cpu, A: Accept>(bvh: &Bvh, ray: &Ray, visit: &mut InShape<'_, A>) -> bool {
    Prepared::new(ray, &bvh.bounds).is_some_and(|prepared| traverse::occluded::<C, _>(bvh, &prepared, visit, ray.t_max))
}

/// At the leaves of a scene's tree: triangles in world coordinates, and objects.
pub(super) struct InScene<'a, C, A> {
    accel: &'a Accel,
    ray: &'a Ray,
    accept: &'a mut A,
    processor: PhantomData<C>,
}

impl<'a, C, A> InScene<'a, C, A> {
    pub(super) fn new(accel: &'a Accel, ray: &'a Ray, accept: &'a mut A) -> Self {
        Self { accel, ray, accept, processor: PhantomData }
    }
}

impl<C: Kernels, A: Accept> Visit for InScene<'_, C, A> {
    type Accept = A;

    #[inline(always)]
    fn accept(&mut self) -> &mut A {
        self.accept
    }

    #[inline(always)]
    fn instance(&self) -> u32 {
        0
    }

    fn closest(&mut self, object: usize, best: &mut Best) {
        let object = &self.accel.objects[object];
        if let Kind::Mesh(shape) = object.kind {
            if let Some(bvh) = &self.accel.shape_trees[shape as usize] {
                let ray = object.local_ray(self.ray, best.hit.t);
                let mut visit = InShape { instance: object.instance, accept: &mut *self.accept };
                C::closest_in_shape(bvh, &ray, &mut visit, best);
            }
        } else {
            for hit in object.exact_hits(self.ray) {
                best.offer(hit, self.accept);
            }
        }
    }

    fn occluded(&mut self, object: usize, t_max: f32) -> bool {
        let object = &self.accel.objects[object];
        if let Kind::Mesh(shape) = object.kind {
            let Some(bvh) = &self.accel.shape_trees[shape as usize] else { return false };
            let ray = object.local_ray(self.ray, t_max);
            C::occluded_in_shape(bvh, &ray, &mut InShape { instance: object.instance, accept: &mut *self.accept })
        } else {
            let mut best = Best::until(t_max);
            object.exact_hits(self.ray).into_iter().for_each(|hit| best.offer(hit, self.accept));
            best.get().is_some()
        }
    }
}

/// At the leaves of a shared shape's tree: triangles only.
pub(super) struct InShape<'a, A> {
    instance: u32,
    accept: &'a mut A,
}

impl<A: Accept> Visit for InShape<'_, A> {
    type Accept = A;

    #[inline(always)]
    fn accept(&mut self) -> &mut A {
        self.accept
    }

    #[inline(always)]
    fn instance(&self) -> u32 {
        self.instance
    }

    fn closest(&mut self, _object: usize, _best: &mut Best) {}

    fn occluded(&mut self, _object: usize, _t_max: f32) -> bool {
        false
    }
}
