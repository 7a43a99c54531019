//! Random points on emissive surfaces, for soft shadows without the steps that fixed points leave. Source: [Cook84].
//!
//! A surface is chosen by its power, a point on it uniformly: `E ≈ (1/n) Σ L_e cosθ′ / (d² p)`, `p` the density over area. Each point is a
//! [`PointSample`] of area `1/(n p)`, so that it lights exactly like a fixed one.

use super::area::{EmissiveShape, EmissiveSurface, PointSample, normal_map};
use crate::math::{DVec3, Vec2, Vec3};
use crate::sampling::{sequence, warp};

/// Draws points on emissive surfaces by power.
#[derive(Clone, Debug)]
pub struct PointSampler {
    surfaces: Vec<EmissiveSurface>,
    /// Sums of the surfaces' powers up to and with each.
    cumulative: Vec<f64>,
}

impl PointSampler {
    /// Of all surfaces that give light.
    pub fn new(surfaces: &[EmissiveSurface]) -> Self {
        let mut sampler = Self { surfaces: Vec::new(), cumulative: Vec::new() };
        let mut sum = 0.0;
        for surface in surfaces {
            let sides = if surface.two_sided { 2.0 } else { 1.0 };
            let power = f64::from(surface.radiance.luminance()) * surface.shape.area() * sides;
            if power > 0.0 && power.is_finite() {
                sum += power;
                sampler.surfaces.push(*surface);
                sampler.cumulative.push(sum);
            }
        }
        sampler
    }

    /// Point `i` of a set of `n` that `key` names; together they are evenly spread.
    pub fn point(&self, i: u32, n: u32, key: u64) -> PointSample {
        let Some(&total) = self.cumulative.last() else { return PointSample::DARK };
        let jitter = sequence::point_2d(i, key ^ 0x7065_7261).x;
        let at = total * (f64::from(i) + f64::from(jitter)) / f64::from(n);
        let which = self.cumulative.partition_point(|&sum| sum <= at).min(self.surfaces.len() - 1);
        let power = self.cumulative[which] - if which == 0 { 0.0 } else { self.cumulative[which - 1] };
        let surface = &self.surfaces[which];
        // Area per point at this surface's density; exact shapes that are stretched are denser where the map squeezes them.
        let area = surface.shape.area() * total / (power * f64::from(n));
        let (position, normal, area) = on_shape(&surface.shape, sequence::point_2d(i, key), area);
        PointSample { position, normal, radiance: surface.radiance, area, two_sided: surface.two_sided }
    }
}

/// A point of a shape, its normal, and its part of `area`, the total over the number of points.
fn on_shape(shape: &EmissiveShape, u: Vec2, area: f64) -> (Vec3, Vec3, f32) {
    match shape {
        EmissiveShape::Triangle([a, b, c]) => {
            let [s, t, r] = warp::uniform_triangle(u);
            let normal = (b - a).as_dvec3().cross((c - a).as_dvec3()).normalize_or_zero().as_vec3();
            (*a * s + *b * t + *c * r, normal, area as f32)
        }
        EmissiveShape::Sphere(m) => {
            let local = warp::uniform_sphere(u);
            let map = normal_map(m);
            let scaled = map * local.as_dvec3();
            // dA of the image over the mean one: |N local| · 4π over the whole area.
            let stretch = scaled.length() * 4.0 * std::f64::consts::PI / shape.area();
            (m.transform_point3(local), scaled.normalize_or_zero().as_vec3(), (area * stretch) as f32)
        }
        EmissiveShape::Disc(m) => {
            let p = warp::uniform_disc(u);
            let normal = (normal_map(m) * DVec3::Y).normalize_or_zero().as_vec3();
            (m.transform_point3(Vec3::new(p.x, 0.0, p.y)), normal, area as f32)
        }
    }
}
