//! Ray queries: what does a ray meet first, is a segment blocked, do two patches see each other.
//!
//! [`Geometry`] goes in, already in `World`'s f32 coordinates; [`Accel`] answers. [`brute_force`] is the slow reference.

pub mod brute_force;

use crate::math::{Affine3A, Bounds, CpuPath, Ray, Vec3};

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
}

impl Accel {
    /// Builds it; deterministic at any thread count.
    pub fn build(geometry: Geometry, _path: CpuPath) -> Self {
        let bounds = brute_force::bounds(&geometry);
        Self { geometry, bounds }
    }

    /// Around everything.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// What was built over.
    pub fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    /// The nearest hit.
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        brute_force::closest(&self.geometry, ray)
    }

    /// True when anything lies on the ray.
    pub fn occluded(&self, ray: &Ray) -> bool {
        self.closest(ray).is_some()
    }

    /// The nearest hit that `accept` agrees to (alpha masks); called in no particular order, possibly for hits behind the nearest.
    pub fn closest_where(&self, ray: &Ray, accept: &mut dyn FnMut(&Hit) -> bool) -> Option<Hit> {
        brute_force::closest_where(&self.geometry, ray, accept)
    }

    /// True when a hit that `accept` agrees to lies on the ray.
    pub fn occluded_where(&self, ray: &Ray, accept: &mut dyn FnMut(&Hit) -> bool) -> bool {
        self.closest_where(ray, accept).is_some()
    }
}
