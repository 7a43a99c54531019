//! Ray queries: what does a ray meet first, is a segment blocked, do two patches see each other.
//!
//! [`Geometry`] goes in, already in `World`'s f32 coordinates; [`Accel`] answers. [`brute_force`] is the slow reference.

pub mod brute_force;

mod build;
mod bvh;
mod collect;
mod dispatch;
mod lanes;
mod object;
mod packet;
mod pair;
mod prepared;
mod scene;
mod traverse;
mod triangle;

use crate::math::{Affine3A, Bounds, CpuPath, Ray, Vec3};
use bvh::Bvh;
use dispatch::Kernels;
use object::Object;
pub use pair::Occluder;
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
            CpuPath::Avx2 => lanes::Avx2::$query($($arg),*),
            _ => lanes::Portable::$query($($arg),*),
        }
    };
}

impl Accel {
    /// Builds it; the same at any thread count. `CpuPath::Avx2` on a processor without it is taken as `Portable`.
    ///
    /// Indices that lead nowhere, triangles that are degenerate or not finite and shapes under a transform without inverse are never hit.
    pub fn build(geometry: Geometry, path: CpuPath) -> Self {
        let path = if CpuPath::detect() == CpuPath::Portable { CpuPath::Portable } else { path };
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

    /// Which of the rays between two patches are blocked: the answers of [`Self::occluded`], in their order, sooner when all rays begin close
    /// to each other and end close to each other.
    ///
    /// `occluder` remembers what blocked last and is tried first: pass the same one for pairs that are likely to share occluders, such as one
    /// patch against all others. It never changes an answer.
    pub fn occluded_between(&self, rays: &[Ray], occluder: &mut Occluder, blocked: &mut Vec<bool>) {
        on!(self.path, occluded_between(self, rays, occluder, blocked));
    }
}
