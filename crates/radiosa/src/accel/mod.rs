//! Ray queries: what does a ray meet first, is a segment blocked, do two patches see each other.
//!
//! [`Geometry`] goes in, already in `World`'s f32 coordinates; [`Accel`] answers. [`brute_force`] is the slow reference.
//!
//! # What is inside
//!
//! ```text
//! scene       one tree over all meshes in world coordinates and over the boxes of what stands under a transform (object);
//!             a tree of its own for each mesh that does
//! build       binary tree by binned surface-area heuristic, polished by reinsertion, collapsed to eight-wide by the cheapest cut
//! bvh         nodes of eight boxes, leaves of blocks of up to eight triangles, or of one object
//! prepared, triangle, traverse       a ray's constants; the watertight test; one ray down a tree
//! packet, collect, pair              eight rays together; many rays between two patches
//! region                             triangles that reach into a convex region
//! dispatch                           each query compiled for both processors (`math::lanes`)
//! ```
//!
//! # What is promised
//!
//! - No ray slips between triangles that share an edge or a vertex, and what a test in f64 hits is hit (`triangle`); boxes are
//!   tested with bounds on all rounding (`prepared`, `bvh::PLANE_SLACK`). There is no constant epsilon.
//! - The answer does not depend on the order of traversal: of hits at the same distance the lowest ids win. Single rays, packets and pairs give the
//!   same hits, on both processor paths, with any number of threads.
//! - Scaling a scene by a power of two from 2⁻⁴⁰ to 2⁴⁰ changes no bit of `t`; coordinates may be up to 1e18 in size, directions of any length above zero.
//! - Nothing panics: indices that lead nowhere, degenerate or non-finite triangles and singular transforms are never hit.
//!
//! Instances are as watertight as their mesh, for a ray that is rounded once more in the shape's coordinates; hence brute
//! force in f64 may differ at their silhouettes.
//!
//! # What was tried
//!
//! Ratios are million rays a second against Embree 3.13's `rtcIntersect1` or `rtcOccluded1` as it is by default (not watertight; it uses AVX-512
//! where there is), medians of turns, one thread, AVX2: `cargo xtask bench rays`.
//!
//! | step | effect |
//! |---|---|
//! | binned tree alone | 0.71–0.90 closest, 0.49–0.86 any |
//! | reinsertion, and for any-hit the most promising child first (`build::collapse`) | closest 0.73–1.09, any 0.73–1.09; the kitchen's bounce rays, any: 0.49 → 1.06 |
//! | any-hit near child first instead | bounce rays 1.13 → 0.73, 0.93 → 0.64, 0.80 → 0.60; segments a little slower too: dropped |
//! | one or two children without the stack | bounce rays +4 to 10 % |
//! | children sorted by a vector network instead of scalars | primary rays 1.02 → 0.76, bounce rays the same: dropped |
//! | blocks of eight triangles for four | +2 to 4 % |
//! | 32 bins for 16 | +3 to 6 % |
//! | the stack's height outside of the stack, in a register | +3 % on bounce rays |
//! | cutting the boxes of oblique triangles before building (10 to 100 % more) | bounce rays 15 to 30 % slower, perhaps since many fall on walls whose boxes are flat already; dropped |
//! | prefetching one or two cache lines of a child instead of four | bounce rays 4 to 7 % slower: dropped |
//! | shafts between patches limited to 6 leaves and 12 triangles, then 24 and 32 | 3.1 → 4.1 in `sauerbraten-zdm2` |
//!
//! Where it stands, one thread, ratios to Embree as it is by default / with `RTC_SCENE_FLAG_ROBUST`, on `small-house`, `sauerbraten-zdm2`,
//! `country-kitchen`, `shader-balls`:
//!
//! | rays | single to single | packet to packet |
//! |---|---|---|
//! | primary, closest | 1.06 1.20 1.02 0.90 / 1.38 1.56 1.23 1.10 | 0.94 1.06 0.85 0.95 / 1.04 1.22 0.90 0.95 |
//! | primary, any | 0.97 1.00 1.07 0.76 / 1.29 1.38 1.40 0.96 | 0.94 0.96 0.98 0.73 / 1.09 1.17 1.14 0.82 |
//! | bounce, closest | 1.04 1.16 0.97 0.86 / 1.23 1.37 1.13 1.09 | 0.89 0.99 0.78 0.81 / 1.11 1.19 0.92 1.07 |
//! | bounce, any | 0.89 1.13 1.04 0.82 / 1.13 1.41 1.28 1.02 | 0.71 0.83 0.65 0.72 / 0.84 1.06 0.83 0.94 |
//! | between patches, any | 0.94 0.96 0.92 0.79 / 1.20 1.30 1.10 1.06 | pair form to single: 1.97 3.60 1.64 1.84 / 2.52 4.58 2.00 2.44 |
//!
//! It loses to the default mode on dense, round objects seen whole, and with packets of incoherent rays: trace those alone. Of the rays between patches on
//! which any two disagreed (98 and 225 in the two rooms looked at), Embree's default was right in 94 and all, its robust mode in none, and
//! this in all: the judge is brute force in f64.

pub mod brute_force;

mod build;
mod bvh;
mod collect;
mod dispatch;
mod object;
mod packet;
mod pair;
mod prepared;
mod region;
mod scene;
mod traverse;
mod triangle;

use crate::math::{Affine3A, Bounds, CpuPath, Ray, Vec3};
use bvh::Bvh;
use dispatch::Kernels;
use object::Object;
pub use pair::Occluder;
pub use region::{HalfSpace, Triangle};
use traverse::{Always, Ask};

/// What a ray met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Ray parameter, in `(0, t_max)`.
    pub t: f32,
    /// Index into [`Geometry::placed`].
    pub instance: u32,
    /// Triangle within the instance's mesh; 0 for exact shapes.
    pub primitive: u32,
    /// Barycentric weight of the triangle's second vertex; for exact shapes see [`Shape`].
    pub u: f32,
    /// Barycentric weight of the triangle's third vertex.
    pub v: f32,
}

/// A shape in its own coordinates.
#[derive(Clone, Debug)]
pub enum Shape {
    /// Triangles; those that are degenerate in f32 are never hit.
    Mesh {
        /// Vertices.
        positions: Vec<Vec3>,
        /// Indices into `positions`.
        triangles: Vec<[u32; 3]>,
    },
    /// The unit sphere around the origin; `u`, `v` of a hit are 0: its local point says all.
    Sphere,
    /// The unit disc around the origin in the plane y = 0; `u`, `v` of a hit are its local x and z.
    Disc,
}

/// A shape and where it stands.
#[derive(Clone, Debug)]
pub struct Placed {
    /// Index into [`Geometry::shapes`].
    pub shape: u32,
    /// From the shape's to world coordinates; `None` when the vertices already are in world coordinates.
    pub to_world: Option<Affine3A>,
}

/// Everything rays can meet.
#[derive(Clone, Debug, Default)]
pub struct Geometry {
    /// Shapes, shared by the placed ones.
    pub shapes: Vec<Shape>,
    /// In the order of the scene's instances.
    pub placed: Vec<Placed>,
}

/// The structure that answers ray queries.
#[derive(Debug)]
pub struct Accel {
    geometry: Geometry,
    bounds: Bounds,
    path: CpuPath,
    /// Over all meshes in world coordinates, and `objects`.
    tree: Bvh,
    /// Shapes under transforms of their own.
    objects: Vec<Object>,
    /// A tree for each shape that is a mesh under a transform, in its own coordinates.
    shape_trees: Vec<Option<Bvh>>,
}

/// Runs a query compiled for the path.
macro_rules! on {
    ($path:expr, $query:ident($($arg:expr),*)) => {
        match $path {
            #[cfg(target_arch = "x86_64")]
            CpuPath::Avx2 => crate::math::lanes::Avx2::$query($($arg),*),
            _ => crate::math::lanes::Portable::$query($($arg),*),
        }
    };
}

impl Accel {
    /// Builds it; the same at any thread count. `CpuPath::Avx2` on a processor without it is taken as `Portable`.
    ///
    /// Indices that lead nowhere, triangles that are degenerate or not finite and shapes under a transform without inverse are never hit.
    pub fn build(geometry: Geometry, path: CpuPath) -> Self {
        let path = path.available();
        let scene::Trees { tree, objects, shape_trees, bounds } = scene::build(&geometry);
        Self { geometry, bounds, path, tree, objects, shape_trees }
    }

    /// Around everything.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// What was built over.
    pub fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    /// The nearest hit; of several at the same distance, the one with the lowest instance, then primitive.
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        on!(self.path, closest(self, ray, &mut Always))
    }

    /// True when anything lies on the ray.
    pub fn occluded(&self, ray: &Ray) -> bool {
        on!(self.path, occluded(self, ray, &mut Always))
    }

    /// The nearest hit that `accept` agrees to (alpha masks); called in no particular order, possibly for hits behind the nearest.
    pub fn closest_where(&self, ray: &Ray, accept: &mut dyn FnMut(&Hit) -> bool) -> Option<Hit> {
        on!(self.path, closest(self, ray, &mut Ask(accept)))
    }

    /// True when a hit that `accept` agrees to lies on the ray.
    pub fn occluded_where(&self, ray: &Ray, accept: &mut dyn FnMut(&Hit) -> bool) -> bool {
        on!(self.path, occluded(self, ray, &mut Ask(accept)))
    }

    /// The nearest hits of eight rays at once, those whose bits in `active` are set; the same hits as one by one, sooner when the rays go
    /// much the same way.
    pub fn closest8(&self, rays: &[Ray; 8], active: u8) -> [Option<Hit>; 8] {
        on!(self.path, closest8(self, rays, active))
    }

    /// Which of eight rays hit anything, as bits; `active` as in [`Self::closest8`].
    pub fn occluded8(&self, rays: &[Ray; 8], active: u8) -> u8 {
        on!(self.path, occluded8(self, rays, active))
    }

    /// The triangles that may reach into the intersection of half spaces (none that does is left out), put into `found` from its beginning: how many they are.
    /// `None` where there are more than it holds, where they stand in many places, or where something else than a triangle in world coordinates may be.
    pub fn triangles_in(&self, region: &[HalfSpace], found: &mut [Triangle]) -> Option<usize> {
        on!(self.path, triangles_in(self, region, found))
    }

    /// Which of the rays between two patches are blocked: the answers of [`Self::occluded`], in their order, sooner when all rays begin close
    /// to each other and end close to each other.
    ///
    /// `occluder` remembers what blocked last and is tried first: pass the same one for pairs that are likely to share occluders, such as one
    /// patch against all others. It never changes an answer.
    pub fn occluded_between(&self, rays: &[Ray], occluder: &mut Occluder, blocked: &mut Vec<bool>) {
        on!(self.path, occluded_between(self, rays, occluder, blocked));
    }
}
