//! Whatever stands under a transform of its own: instances of meshes, exact spheres and discs.
//!
//! The ray goes into the shape's coordinates, computed in f64; its direction is not made a unit vector there, so `t` is the world ray's.

use super::{Hit, Placed, Shape};
use crate::math::{Affine3A, Bounds, DAffine3, DVec3, Ray, Vec3};

/// A placed shape under a transform.
#[derive(Clone, Debug)]
pub(super) struct Object {
    /// Index into `Geometry::placed`.
    pub instance: u32,
    pub to_local: DAffine3,
    pub kind: Kind,
    around: Ball,
}

/// Around a sphere's image; infinite around everything else, which has only its box.
#[derive(Clone, Copy, Debug)]
struct Ball {
    centre: Vec3,
    radius_2: f32,
}

/// What it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    /// The mesh of this shape, which has a tree of its own.
    Mesh(u32),
    Sphere,
    Disc,
}

impl Object {
    /// The object and a box around it; `None` when it is never hit: under a transform without inverse, or around nothing.
    pub(super) fn new(instance: u32, placed: &Placed, shape: &Shape, local: &Bounds) -> Option<(Self, Bounds)> {
        let kind = match shape {
            Shape::Mesh { .. } => Kind::Mesh(placed.shape),
            Shape::Sphere => Kind::Sphere,
            Shape::Disc => Kind::Disc,
        };
        let to_world = in_f64(&placed.to_world.unwrap_or_default());
        let to_local = to_world.inverse();
        let invertible = to_world.is_finite() && to_world.matrix3.determinant() != 0.0 && to_local.is_finite();
        if !invertible || local.is_empty() {
            return None;
        }
        let c = (local.min.as_dvec3() + local.max.as_dvec3()) * 0.5;
        let half = (local.max.as_dvec3() - local.min.as_dvec3()) * 0.5;
        let m = to_world.matrix3;
        let centre = to_world.transform_point3(c);
        let reach = match kind {
            // The image of a unit ball reaches as far as each row of the matrix is long; of a disc, without the row's part in y.
            Kind::Sphere => (m.x_axis * m.x_axis + m.y_axis * m.y_axis + m.z_axis * m.z_axis).map(f64::sqrt),
            Kind::Disc => (m.x_axis * m.x_axis + m.z_axis * m.z_axis).map(f64::sqrt),
            Kind::Mesh(_) => m.x_axis.abs() * half.x + m.y_axis.abs() * half.y + m.z_axis.abs() * half.z,
        };
        // Rays enter in coordinates rounded to f32 on both sides of the transform.
        let local_size = local.min.abs().max(local.max.abs()).as_dvec3();
        let size = m.x_axis.abs() * local_size.x + m.y_axis.abs() * local_size.y + m.z_axis.abs() * local_size.z;
        let slack = (size + to_world.translation.abs()) * (4.0 * f64::from(f32::EPSILON)) + f64::from(f32::MIN_POSITIVE);
        let bounds = Bounds { min: (centre - reach - slack).as_vec3(), max: (centre + reach + slack).as_vec3() };
        let around = match kind {
            Kind::Sphere => Ball::around_sphere(&to_world),
            Kind::Disc | Kind::Mesh(_) => Ball { centre: Vec3::ZERO, radius_2: f32::INFINITY },
        };
        bounds.max.is_finite().then_some((Self { instance, to_local, kind, around }, bounds))
    }

    /// The ray in the shape's coordinates, ending at `t_max`.
    pub(super) fn local_ray(&self, ray: &Ray, t_max: f32) -> Ray {
        let (o, d) = self.local(ray);
        Ray { origin: o.as_vec3(), dir: d.as_vec3(), t_max }
    }

    fn local(&self, ray: &Ray) -> (DVec3, DVec3) {
        (self.to_local.transform_point3(ray.origin.as_dvec3()), self.to_local.transform_vector3(ray.dir.as_dvec3()))
    }

    /// Hits of an exact shape, front to back; those that are not have `t` NaN.
    pub(super) fn exact_hits(&self, ray: &Ray) -> [Hit; 2] {
        if self.around.is_missed_by(ray) {
            return [Hit { t: f32::NAN, instance: self.instance, primitive: 0, u: 0.0, v: 0.0 }; 2];
        }
        let (o, d) = self.local(ray);
        let hit = |t: f64, u: f64, v: f64| Hit { t: t as f32, instance: self.instance, primitive: 0, u: u as f32, v: v as f32 };
        match self.kind {
            Kind::Mesh(_) => [hit(f64::NAN, 0.0, 0.0); 2],
            Kind::Sphere => sphere(o, d).map(|t| hit(t, 0.0, 0.0)),
            Kind::Disc => {
                let (t, u, v) = disc(o, d);
                [hit(t, u, v), hit(f64::NAN, 0.0, 0.0)]
            }
        }
    }
}

impl Ball {
    fn around_sphere(to_world: &DAffine3) -> Self {
        // No direction is stretched by more than the largest sum of a row of MᵀM (Gershgorin), which for a round sphere is its radius squared.
        let m = to_world.matrix3;
        let square = m.transpose() * m;
        let largest = (square.x_axis.abs() + square.y_axis.abs() + square.z_axis.abs()).max_element();
        // The centre is rounded to f32.
        let radius = largest.sqrt() + to_world.translation.length() * f64::from(f32::EPSILON);
        Self { centre: to_world.translation.as_vec3(), radius_2: (radius * radius * 1.000_01) as f32 }
    }

    /// True only when the ray misses it for certain: about a third of those that meet the box around it.
    #[inline(always)]
    fn is_missed_by(&self, ray: &Ray) -> bool {
        let o = ray.origin - self.centre;
        let (a, b, c) = (ray.dir.length_squared(), o.dot(ray.dir), o.length_squared());
        // Distance² of the line from the centre, times a: ca − b². A few roundings of ca and b² lie in it; where ca is about to underflow nothing is
        // certain, and what overflows compares false.
        let beside = c * a - b * b > a * self.radius_2 + c * a * (16.0 * f32::EPSILON) && c * a > 1e-30;
        beside || (b > 0.0 && c > self.radius_2 && c > 1e-30)
    }
}

fn in_f64(m: &Affine3A) -> DAffine3 {
    let column = |v: glam::Vec3A| Vec3::from(v).as_dvec3();
    DAffine3 {
        matrix3: glam::DMat3::from_cols(column(m.matrix3.x_axis), column(m.matrix3.y_axis), column(m.matrix3.z_axis)),
        translation: column(m.translation),
    }
}

/// Both roots of `|o + t·d|² = 1`; NaN for none. The one farther from zero first in the making, the other from the product of the roots, so that
/// nothing cancels; the discriminant as the distance of the line from the centre, for the same reason.
fn sphere(o: DVec3, d: DVec3) -> [f64; 2] {
    let (a, b) = (d.length_squared(), o.dot(d));
    let inv_a = 1.0 / a;
    let nearest = o - d * (b * inv_a);
    let rest = 1.0 - nearest.length_squared();
    if !(a > 0.0 && rest >= 0.0) {
        return [f64::NAN; 2];
    }
    let q = -(b + (a * rest).sqrt().copysign(b));
    let (t0, t1) = (q * inv_a, (o.length_squared() - 1.0) / q);
    // From the middle of a grazed or centred sphere q may be 0.
    let t1 = if t1.is_finite() { t1 } else { t0 };
    [t0.min(t1), t0.max(t1)]
}

fn disc(o: DVec3, d: DVec3) -> (f64, f64, f64) {
    let t = -o.y / d.y;
    let p = o + d * t;
    let hit = t.is_finite() && p.x * p.x + p.z * p.z <= 1.0;
    (if hit { t } else { f64::NAN }, p.x, p.z)
}
