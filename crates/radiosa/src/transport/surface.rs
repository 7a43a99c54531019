//! A point on a surface, with what its position is known to.
//!
//! The position of a hit is computed from the surface (barycentric weights, or the projected local point of an exact shape), not
//! from the ray, and comes with a bound of its rounding error. Rays that leave it start outside that bound, so nothing hits
//! its own surface and no constant epsilon is needed. Source: [Pharr23], chapter 6.8.

use super::World;
use crate::accel::{Hit, Shape};
use crate::math::rounding::{gamma, offset_origin};
use crate::math::{Ray, Vec2, Vec3, Vec4};
use crate::scene::{Geometry, InstanceId, MaterialId, Mesh};

/// A point on a surface as seen along a ray.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// Position, world coordinates.
    pub p: Vec3,
    /// Absolute bound of the rounding error of `p`.
    pub p_error: Vec3,
    /// Unit geometric normal of the front.
    pub ng: Vec3,
    /// Unit interpolated normal, on the side of `ng`; the geometric one where the mesh has none.
    pub n: Vec3,
    /// Which instance.
    pub instance: InstanceId,
    /// Which triangle of its mesh.
    pub primitive: u32,
    /// Barycentric weights of the three vertices; zero for exact shapes.
    pub weights: [f32; 3],
    /// Local coordinates of a point on an exact shape.
    pub local: Vec3,
    /// What it is made of.
    pub material: Option<MaterialId>,
    /// How wide a pixel is here, world units (`transport::Footprint`); zero reads textures at their finest.
    pub width: f32,
}

impl World {
    /// The surface a ray hit.
    pub fn surface(&self, ray: &Ray, hit: &Hit) -> Surface {
        let geometry = self.accel().geometry();
        let placed = &geometry.placed[hit.instance as usize];
        let instance = InstanceId(hit.instance);
        let flip = if self.is_mirrored(instance) { -1.0 } else { 1.0 };
        let material = self.scene().material_of(instance, hit.primitive);
        match &geometry.shapes[placed.shape as usize] {
            Shape::Mesh { positions, triangles } => {
                let tri = triangles[hit.primitive as usize];
                let v = tri.map(|i| positions[i as usize]);
                let weights = [1.0 - hit.u - hit.v, hit.u, hit.v];
                let (local, local_error) = combine(v, weights);
                let (mut p, mut p_error) = (local, local_error);
                let mut ng = (v[1] - v[0]).as_dvec3().cross((v[2] - v[0]).as_dvec3());
                if let Some(m) = &placed.to_world {
                    (p, p_error) = transform_point(m, local, local_error);
                    ng = self.normal_to_world(instance, ng);
                } else {
                    ng *= flip;
                }
                let ng = ng.try_normalize().map_or(-ray.dir.normalize_or_zero(), |n| n.as_vec3());
                let n = self.interpolated_normal(instance, tri, weights).map_or(ng, |n| if n.dot(ng) < 0.0 { -n } else { n });
                Surface { p, p_error, ng, n, instance, primitive: hit.primitive, weights, local, material, width: 0.0 }
            }
            shape => {
                let m = placed.to_world.unwrap_or_default();
                let (mut local, normal) = if matches!(shape, Shape::Sphere) {
                    // In f64: far from a small sphere the ray's own arithmetic would leave the surface.
                    let p = ray.origin.as_dvec3() + ray.dir.as_dvec3() * f64::from(hit.t);
                    let local = self.to_local(instance).transform_point3(p).try_normalize().unwrap_or(glam::DVec3::Y);
                    (local.as_vec3(), local)
                } else {
                    (Vec3::new(hit.u, 0.0, hit.v), glam::DVec3::Y)
                };
                if !local.is_finite() {
                    local = Vec3::Y;
                }
                let (p, p_error) = transform_point(&m, local, local.abs() * gamma(3));
                let ng = self.unit_normal_to_world(instance, normal);
                Surface { p, p_error, ng, n: ng, instance, primitive: 0, weights: [0.0; 3], local, material, width: 0.0 }
            }
        }
    }
}

/// `Σ w v` and a bound of its error. Seven roundings lie in the sum; and since the ray–triangle test shears coordinates into each other, what it may get
/// wrong about the plane is relative to the largest coordinate of the triangle, in every axis. (With the bound of each axis alone, a wall in the plane
/// x = 0 had none and shadowed itself.)
fn combine(v: [Vec3; 3], w: [f32; 3]) -> (Vec3, Vec3) {
    let p = v[0] * w[0] + v[1] * w[1] + v[2] * w[2];
    let largest = v[0].abs().max(v[1].abs()).max(v[2].abs()).max_element();
    (p, Vec3::splat(largest * gamma(8)))
}

/// An affine map of a point with an error, and the error of the result.
fn transform_point(m: &crate::math::Affine3A, p: Vec3, error: Vec3) -> (Vec3, Vec3) {
    let abs = glam::Mat3A::from_cols(m.matrix3.x_axis.abs(), m.matrix3.y_axis.abs(), m.matrix3.z_axis.abs());
    let moved = Vec3::from(m.transform_point3a(p.into()));
    let magnitude = Vec3::from(abs * p.abs().to_vec3a() + m.translation.abs());
    let carried = Vec3::from(abs * error.to_vec3a());
    // In every axis alike, for the same reason as above.
    (moved, Vec3::splat((magnitude * gamma(6) + carried * (1.0 + gamma(4))).max_element()))
}

impl World {
    /// The point for shadow rays, lifted from a facet towards the smooth surface its vertex normals stand for.
    ///
    /// Without it, the facets of a coarse round mesh shadow themselves in steps near the terminator, where the smooth surface still sees the light.
    /// The lift is the weighted mean of the point's distances below the vertices' tangent planes, on the side of `n`: zero on flat and concave
    /// places. Source: [Hanika21].
    pub fn shadow_origin(&self, surface: &Surface, n: Vec3) -> Vec3 {
        let geometry = self.accel().geometry();
        let Some(placed) = geometry.placed.get(surface.instance.index()) else { return surface.p };
        let Shape::Mesh { positions, triangles } = &geometry.shapes[placed.shape as usize] else { return surface.p };
        let tri = triangles[surface.primitive as usize];
        let Some(normals) = self.vertex_normals(surface.instance, tri) else { return surface.p };
        let mut lift = Vec3::ZERO;
        for ((v, normal), weight) in tri.into_iter().zip(normals).zip(surface.weights) {
            let vertex = positions[v as usize];
            let vertex = placed.to_world.map_or(vertex, |m| m.transform_point3(vertex));
            let normal = if normal.dot(n) < 0.0 { -normal } else { normal };
            lift -= normal * ((surface.p - vertex).dot(normal).min(0.0) * weight);
        }
        surface.p + lift
    }
}

/// From an origin to just before a target.
pub(super) fn shadow_ray(origin: Vec3, target: Vec3) -> Ray {
    let dir = target - origin;
    let error = gamma(16) * (target.abs().max_element() + origin.abs().max_element());
    Ray { origin, dir, t_max: 1.0 - (error / dir.abs().max_element()).min(0.5) }
}

impl Surface {
    /// A point that lies on nothing, with the normal `n` (unit); it belongs to no instance.
    pub fn in_space(p: Vec3, p_error: Vec3, n: Vec3) -> Self {
        Self {
            p,
            p_error,
            ng: n,
            n,
            instance: InstanceId(u32::MAX),
            primitive: 0,
            weights: [0.0; 3],
            local: Vec3::ZERO,
            material: None,
            width: 0.0,
        }
    }

    /// An endless ray that leaves the surface in the direction `dir`.
    pub fn ray(&self, dir: Vec3) -> Ray {
        Ray::new(offset_origin(self.p, self.p_error, self.ng, dir), dir)
    }

    /// The segment from the surface to a point in space; `t` runs from 0 to 1.
    pub fn segment_to(&self, target: Vec3) -> Ray {
        let origin = offset_origin(self.p, self.p_error, self.ng, target - self.p);
        Ray { origin, dir: target - origin, t_max: 1.0 }
    }

    /// The segment from the surface to just before a point near another surface, clear of the rounding of both ends: a lamp may hang in the very plane of a
    /// ceiling.
    pub(crate) fn shadow_ray(&self, target: Vec3) -> Ray {
        shadow_ray(offset_origin(self.p, self.p_error, self.ng, target - self.p), target)
    }

    /// The front faces along `wo`.
    pub fn is_front(&self, wo: Vec3) -> bool {
        self.ng.dot(wo) >= 0.0
    }

    /// The texture coordinates of one set; zero where there are none.
    pub fn uv(&self, world: &World, set: u32) -> Vec2 {
        let scene = world.scene();
        match scene.instances[self.instance.index()].geometry {
            Geometry::Mesh(mesh) => {
                let mesh: &Mesh = &scene.meshes[mesh.index()];
                let Some(uvs) = mesh.uvs.get(set as usize) else { return Vec2::ZERO };
                let [a, b, c] = mesh.triangles[self.primitive as usize].map(|i| uvs[i as usize]);
                a * self.weights[0] + b * self.weights[1] + c * self.weights[2]
            }
            Geometry::Sphere => {
                let turn = 1.0 / std::f32::consts::TAU;
                let u = crate::math::function::atan2(self.local.z, self.local.x) * turn;
                let v = crate::math::function::acos(self.local.y.clamp(-1.0, 1.0)) * (2.0 * turn);
                Vec2::new(if u < 0.0 { u + 1.0 } else { u }, v)
            }
            Geometry::Disc => Vec2::new((self.local.x + 1.0) * 0.5, (self.local.z + 1.0) * 0.5),
        }
    }

    /// The interpolated vertex colour; white where there is none.
    pub fn vertex_color(&self, world: &World) -> Vec4 {
        let scene = world.scene();
        let Geometry::Mesh(mesh) = scene.instances[self.instance.index()].geometry else { return Vec4::ONE };
        let mesh = &scene.meshes[mesh.index()];
        let Some(colors) = &mesh.colors else { return Vec4::ONE };
        let [a, b, c] = mesh.triangles[self.primitive as usize].map(|i| colors[i as usize]);
        a * self.weights[0] + b * self.weights[1] + c * self.weights[2]
    }
}
