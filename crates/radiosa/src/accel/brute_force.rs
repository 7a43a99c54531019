//! Every ray against every primitive in f64: the reference the production structure is tested against.

use super::{Geometry, Hit, Placed, Shape};
use crate::math::{Bounds, DVec3, Ray, Vec3};

/// Around everything placed.
pub fn bounds(geometry: &Geometry) -> Bounds {
    let mut all = Bounds::EMPTY;
    for placed in &geometry.placed {
        let to_world = |p: Vec3| placed.to_world.map_or(p, |m| m.transform_point3(p));
        all = match &geometry.shapes[placed.shape as usize] {
            Shape::Mesh { positions, triangles } => {
                triangles.iter().flatten().fold(all, |b, &i| b.with(to_world(positions[i as usize])))
            }
            shape => {
                let m = placed.to_world.unwrap_or_default();
                let y = if matches!(shape, Shape::Sphere) { m.matrix3.y_axis } else { Default::default() };
                let (x, z) = (m.matrix3.x_axis, m.matrix3.z_axis);
                let half = Vec3::from((x * x + y * y + z * z).to_array().map(f32::sqrt));
                let c = Vec3::from(m.translation);
                all.with(c - half).with(c + half)
            }
        };
    }
    all
}

/// The nearest hit of all.
pub fn closest(geometry: &Geometry, ray: &Ray) -> Option<Hit> {
    closest_where(geometry, ray, &mut |_| true)
}

/// The nearest hit `accept` agrees to.
pub fn closest_where(geometry: &Geometry, ray: &Ray, accept: &mut dyn FnMut(&Hit) -> bool) -> Option<Hit> {
    let mut best: Option<Hit> = None;
    for (instance, placed) in geometry.placed.iter().enumerate() {
        let instance = instance as u32;
        let mut offer = |t: f64, primitive: u32, u: f64, v: f64| {
            let hit = Hit { t: t as f32, instance, primitive, u: u as f32, v: v as f32 };
            if t > 0.0 && hit.t < best.map_or(ray.t_max, |b| b.t) && accept(&hit) {
                best = Some(hit);
            }
        };
        let (o, d) = local_ray(placed, ray);
        match &geometry.shapes[placed.shape as usize] {
            Shape::Mesh { positions, triangles } => {
                for (primitive, tri) in triangles.iter().enumerate() {
                    let p = tri.map(|i| positions[i as usize].as_dvec3());
                    if let Some((t, u, v)) = triangle(o, d, p) {
                        offer(t, primitive as u32, u, v);
                    }
                }
            }
            Shape::Sphere => {
                let (a, b, c) = (d.length_squared(), o.dot(d), o.length_squared() - 1.0);
                let root = (b * b - a * c).max(-1.0);
                if root >= 0.0 && a > 0.0 {
                    let q = -(b + root.sqrt().copysign(b));
                    let (t0, t1) = (c / q, q / a);
                    for t in [t0.min(t1), t0.max(t1)] {
                        offer(t, 0, 0.0, 0.0);
                    }
                }
            }
            Shape::Disc => {
                let t = -o.y / d.y;
                let p = o + d * t;
                if t.is_finite() && p.x * p.x + p.z * p.z <= 1.0 {
                    offer(t, 0, p.x, p.z);
                }
            }
        }
    }
    best
}

fn local_ray(placed: &Placed, ray: &Ray) -> (DVec3, DVec3) {
    let (o, d) = (ray.origin.as_dvec3(), ray.dir.as_dvec3());
    placed.to_world.map_or((o, d), |m| {
        let (matrix, translation) = (glam::Mat3::from(m.matrix3).as_dmat3(), Vec3::from(m.translation).as_dvec3());
        let inverse = matrix.inverse();
        (inverse * (o - translation), inverse * d)
    })
}

/// Möller–Trumbore in f64: ray parameter and barycentric weights of the second and third vertex. Edges belong to the triangle.
pub fn triangle(o: DVec3, d: DVec3, [a, b, c]: [DVec3; 3]) -> Option<(f64, f64, f64)> {
    let (e1, e2) = (b - a, c - a);
    let p = d.cross(e2);
    let det = e1.dot(p);
    let s = o - a;
    let (u, q) = (s.dot(p) / det, s.cross(e1));
    let v = d.dot(q) / det;
    // A determinant of zero makes every comparison with NaN or infinity fail.
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0).then(|| (e2.dot(q) / det, u, v)).filter(|(t, ..)| t.is_finite())
}
