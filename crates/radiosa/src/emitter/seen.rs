//! An emissive surface as a place sees it, and points drawn on it from there: uniformly over the solid angle of triangles [Arvo95], of spheres over
//! their cone, by area where the surface is small or the shape has no such map.

use std::f32::consts::{PI, TAU};

use super::Incident;
use super::area::{EmissiveShape, EmissiveSurface, normal_map};
use crate::math::rounding::gamma;
use crate::math::{Affine3A, DVec3, Frame, Vec2, Vec3, function};
use crate::sampling::warp;

/// The normal of a place that light reaches from all around, as in a medium: its cosines count as one.
pub(crate) const EVERYWHERE: Vec3 = Vec3::ZERO;

/// Triangles smaller than this (sr) are drawn by area, which is as good there and cheaper.
const SMALL: f32 = 0.02;
/// Triangles larger than this are seen from within rounding of their plane.
const LARGE: f32 = 6.2;
/// Cosines at the corners of a triangle count at least this much: in between they can be larger.
const LEAST_COS: f32 = 0.1;

/// An emissive surface seen from a place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen<'a> {
    pub(super) surface: &'a EmissiveSurface,
    /// About the irradiance it gives without anything between; 0 only where it gives none.
    pub(super) importance: f32,
    how: How,
}

/// How points on it are drawn.
#[derive(Clone, Copy, Debug)]
enum How {
    /// Uniformly over the surface.
    Area,
    /// Over the triangle's solid angle, weighted by the cosines at its corners.
    Triangle { solid_angle: f32, cos: [f32; 3] },
    /// Over the cone around a sphere.
    Sphere { to_centre: Vec3, distance2: f32, radius: f32, one_minus_cos: f32 },
}

impl<'a> Seen<'a> {
    /// From `p` with normal `n`, or [`EVERYWHERE`]; `None` when nothing of it can arrive there.
    #[inline(always)]
    pub(super) fn new(surface: &'a EmissiveSurface, p: Vec3, n: Vec3) -> Option<Self> {
        let radiance = surface.radiance.luminance();
        let is_everywhere = n == EVERYWHERE;
        let (share, how) = match &surface.shape {
            EmissiveShape::Triangle(corners) => {
                let [a, b, c] = corners.map(|corner| corner - p);
                let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
                // Six times the volume of the tetrahedron, positive in front. The area's vector is exact where the directions would cancel.
                let volume = -a.dot(normal);
                if volume == 0.0 || (volume < 0.0 && !surface.two_sided) {
                    return None;
                }
                let [la, lb, lc] = [a, b, c].map(Vec3::length);
                let cosines = if is_everywhere { [1.0; 3] } else { [n.dot(a) / la, n.dot(b) / lb, n.dot(c) / lc] };
                if cosines.iter().all(|cos| *cos <= 0.0) {
                    return None;
                }
                let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
                let solid_angle = 2.0 * function::atan2(volume.abs(), below);
                let middle = (a / la + b / lb + c / lc).normalize_or_zero();
                let cos = cosines.map(|cos| cos.max(0.0));
                let mean = if is_everywhere { 1.0 } else { 0.25 * (cos.iter().sum::<f32>() + n.dot(middle).max(0.0)) };
                let is_large = (SMALL..LARGE).contains(&solid_angle);
                let how =
                    if is_large { How::Triangle { solid_angle, cos: cos.map(|cos| cos.max(LEAST_COS)) } } else { How::Area };
                (solid_angle * mean, how)
            }
            EmissiveShape::Sphere(m) => {
                let (centre, radius, is_round) = sphere(m);
                let to_centre = centre - p;
                let distance2 = to_centre.length_squared();
                let sin2 = radius * radius / distance2;
                if sin2 >= 1.0 {
                    // Within a round one only its inside is seen; within the ball around an ellipsoid anything may be.
                    return (surface.two_sided || !is_round).then_some(Self {
                        surface,
                        importance: radiance * PI,
                        how: How::Area,
                    });
                }
                let cos_cone = (1.0 - sin2).sqrt();
                let one_minus_cos = sin2 / (1.0 + cos_cone);
                let cos = if is_everywhere { 1.0 } else { n.dot(to_centre) / distance2.sqrt() };
                // The cosine of where it is highest.
                let highest = if cos >= cos_cone { 1.0 } else { cos * cos_cone + ((1.0 - cos * cos) * sin2).max(0.0).sqrt() };
                if highest <= 0.0 {
                    return None;
                }
                let how = if is_round { How::Sphere { to_centre, distance2, radius, one_minus_cos } } else { How::Area };
                (TAU * one_minus_cos * 0.5 * (highest + cos.max(0.0)), how)
            }
            EmissiveShape::Disc(m) => {
                let (centre, radius, _) = sphere(m);
                let normal = (normal_map(m) * DVec3::Y).as_vec3();
                let to_centre = centre - p;
                let distance2 = to_centre.length_squared();
                let height = -normal.dot(to_centre);
                if height == 0.0 || (height < 0.0 && !surface.two_sided) {
                    return None;
                }
                let reach2 = distance2 + radius * radius;
                let above = if is_everywhere { reach2.sqrt() } else { n.dot(to_centre) + radius };
                if above <= 0.0 {
                    return None;
                }
                // π r² cosθ′/(d² + r²), exact on the axis; the normal's length is the area over π.
                let share = PI * height.abs() / distance2.sqrt() / reach2;
                (share * (above / reach2.sqrt()).min(1.0), How::Area)
            }
        };
        let importance = radiance * share;
        (importance > 0.0 && importance.is_finite()).then_some(Self { surface, importance, how })
    }

    /// What a point drawn by `u` brings to `p` where each point stands for `1/density` of them: `E_⊥` such that its mean is the irradiance.
    pub(super) fn incident(&self, p: Vec3, u: Vec2, density: f32) -> Option<Incident> {
        let drawn = self.draw(p, u)?;
        let irradiance = self.surface.radiance * (drawn.share / density);
        irradiance.is_finite().then_some(Incident {
            wi: drawn.wi,
            distance: drawn.distance,
            target: Some(drawn.target),
            diffuse: irradiance,
            specular: irradiance,
            casts_shadow: true,
        })
    }

    /// The point drawn by `u`.
    pub(super) fn draw(&self, p: Vec3, u: Vec2) -> Option<Drawn> {
        let (position, normal, wi, distance, share) = match (&self.how, &self.surface.shape) {
            (How::Triangle { solid_angle, cos }, EmissiveShape::Triangle(corners)) => {
                let (u, pdf) = warp::bilinear(bilinear_corners(cos), u);
                let (wi, distance) = on_spherical_triangle(corners, p, *solid_angle, u)?;
                let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or_zero();
                (p + wi * distance, normal, wi, distance, solid_angle / pdf)
            }
            (How::Sphere { to_centre, distance2, radius, one_minus_cos }, _) => {
                // By 1 − cosα of the angle to the axis.
                let down = u.x * one_minus_cos;
                let sin2 = (down * (2.0 - down)).max(0.0);
                let (r, phi) = (sin2.sqrt(), TAU * u.y);
                let local = Vec3::new(r * function::cos(phi), r * function::sin(phi), 1.0 - down);
                let wi = Frame::from_normal(to_centre.normalize_or_zero()).to_world(local);
                // The nearer end of the chord, d cosα − √(r² − d² sin²α), where nothing large cancels; at the rim rounding may leave none.
                let half_chord2 = (radius * radius - distance2 * sin2).max(0.0);
                let distance = distance2.sqrt() * (1.0 - down) - half_chord2.sqrt();
                let position = p + wi * distance;
                let normal = (wi * distance - *to_centre).normalize_or_zero();
                (position, normal, wi, distance, TAU * one_minus_cos)
            }
            (_, shape) => {
                let (position, normal, area) = on_shape(shape, u);
                let to_light = position - p;
                let distance = to_light.length();
                let wi = to_light / distance;
                (position, normal, wi, distance, self.share_by_area(normal, area, wi, distance)?)
            }
        };
        // A few roundings lead to the point from the surface's vertices or along the direction; the ray's end stays clear of them.
        let clear = normal * (position.abs().max_element().max(distance) * gamma(16));
        let target = if normal.dot(wi) < 0.0 { position + clear } else { position - clear };
        share.is_finite().then_some(Drawn { position, target, wi, distance, share })
    }

    /// Solid angle over density of a point drawn by area: `A cosθ′/d²`; `None` where it shines away.
    fn share_by_area(&self, normal: Vec3, area: f32, wi: Vec3, distance: f32) -> Option<f32> {
        let cos = -normal.dot(wi);
        let cos = if self.surface.two_sided { cos.abs() } else { cos };
        (cos > 0.0).then(|| area * cos / distance / distance)
    }

    /// The density, 1/sr, with which [`Self::draw`] draws the direction `wi` from `p`, which meets the surface after `distance`, at `local` of its own
    /// coordinates where it is a sphere.
    pub(super) fn pdf(&self, p: Vec3, wi: Vec3, distance: f32, local: Vec3) -> f32 {
        match (&self.how, &self.surface.shape) {
            (How::Triangle { solid_angle, cos }, EmissiveShape::Triangle(corners)) => {
                let u = of_spherical_triangle(corners, p, f64::from(*solid_angle), wi);
                warp::bilinear_pdf(bilinear_corners(cos), u) / solid_angle
            }
            (How::Sphere { one_minus_cos, .. }, _) => 1.0 / (TAU * one_minus_cos),
            (_, shape) => {
                let (normal, area) = match shape {
                    EmissiveShape::Triangle(_) | EmissiveShape::Disc(_) => {
                        let (_, normal, area) = on_shape(shape, Vec2::splat(0.5));
                        (normal, area)
                    }
                    EmissiveShape::Sphere(m) => at_local(m, local),
                };
                self.share_by_area(normal, area, wi, distance).map_or(0.0, |share| 1.0 / share)
            }
        }
    }
}

/// A point on an emissive surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Drawn {
    pub(super) position: Vec3,
    /// Where a shadow ray ends: just in front of it.
    pub(super) target: Vec3,
    /// Unit, to the point.
    pub(super) wi: Vec3,
    pub(super) distance: f32,
    /// `1/p_ω`, sr.
    pub(super) share: f32,
}

/// The cosines at the corners of a triangle as the corners of the square that [`on_spherical_triangle`] maps onto it.
fn bilinear_corners(cos: &[f32; 3]) -> [f32; 4] {
    [cos[1], cos[1], cos[0], cos[2]]
}

/// Centre, radius of the ball around it, and whether it is round.
fn sphere(m: &Affine3A) -> (Vec3, f32, bool) {
    let m3 = m.matrix3;
    let lengths = [m3.x_axis, m3.y_axis, m3.z_axis].map(|axis| axis.length());
    let longest = lengths.into_iter().fold(0.0, f32::max);
    let skew = m3.x_axis.dot(m3.y_axis).abs() + m3.y_axis.dot(m3.z_axis).abs() + m3.z_axis.dot(m3.x_axis).abs();
    let is_round = skew <= 1e-5 * longest * longest && lengths.iter().all(|l| (l - longest).abs() <= 1e-5 * longest);
    // Skewed axes reach farther than the longest of them.
    let radius = if is_round { longest } else { lengths.iter().map(|l| l * l).sum::<f32>().sqrt() };
    (m.translation.into(), radius, is_round)
}

/// Direction and distance of a point of a triangle, uniform over the solid angle seen from `p` [Arvo95]: a plane through the first corner cuts off the
/// part `u.x` of it, and the point lies on the arc from the second corner to where that plane meets the far edge.
///
/// The triangle cut off has the excess `E = u.x Ω`, the angle `α` at A and the side `c` to B; with the tangents of half its sides Napier's form of the excess,
/// `cot(E/2) sin α = cot(b/2) cot(c/2) + cos α`, says how far along AC the arc ends:
///
/// ```text
/// tan(b/2) = sin(E/2) / (tan(c/2) sin(α − E/2))
/// ```
///
/// where, unlike in the cosine of `b`, nothing cancels: single precision tells. How far the triangle's plane is along the direction is for double precision: near the plane, in single
/// precision, points of large triangles would lie off it, and in their own shadow.
fn on_spherical_triangle(corners: &[Vec3; 3], p: Vec3, solid_angle: f32, u: Vec2) -> Option<(Vec3, f32)> {
    let to_corner = corners[0] - p;
    let [a, b, c] = [to_corner, corners[1] - p, corners[2] - p].map(Vec3::normalize);
    // The planes through AB and AC, and the angle between them.
    let across = a.cross(b);
    let sin_c = across.length();
    let (ab, ac) = (across / sin_c, a.cross(c).normalize_or_zero());
    let (sin_alpha, cos_alpha) = (ab.cross(ac).length(), ab.dot(ac));
    let (sin_half, cos_half) = function::sin_cos(0.5 * u.x * solid_angle);
    let (over, under) = (sin_half * (1.0 + a.dot(b)), sin_c * (sin_alpha * cos_half - cos_alpha * sin_half));
    // From tan(b/2) = over/under.
    let scale = 1.0 / (under * under + over * over);
    let end = a * ((under * under - over * over) * scale) + ac.cross(a) * (2.0 * under * over * scale);
    // By 1 − cosine of the arc from B: that to its end is half the chord's square.
    let chord = end - b;
    let far = 0.5 * chord.length_squared();
    let down = u.y * far;
    let wi = b * (1.0 - down) + (chord + b * far).normalize_or_zero() * (down * (2.0 - down)).max(0.0).sqrt();
    let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    let normal = normal.as_dvec3();
    let distance = ((corners[0].as_dvec3() - p.as_dvec3()).dot(normal) / wi.as_dvec3().dot(normal)) as f32;
    (distance > 0.0 && distance.is_finite()).then_some((wi, distance))
}

/// The inverse of [`on_spherical_triangle`] for a direction that meets the triangle.
fn of_spherical_triangle(corners: &[Vec3; 3], p: Vec3, solid_angle: f64, wi: Vec3) -> Vec2 {
    let [a, b, c] = corners.map(|corner| (corner.as_dvec3() - p.as_dvec3()).normalize());
    let w = wi.as_dvec3();
    // Where the arc from the second corner through the direction meets the far edge.
    let end = b.cross(w).cross(c.cross(a)).normalize_or_zero();
    let end = if end.dot(a + c) < 0.0 { -end } else { end };
    let part = 2.0 * function::atan2_f64(a.dot(b.cross(end)).abs(), 1.0 + a.dot(b) + b.dot(end) + a.dot(end));
    let along = (1.0 - w.dot(b)) / (1.0 - end.dot(b));
    let unit = |x: f64| if x.is_finite() { x.clamp(0.0, 1.0) as f32 } else { 0.0 };
    Vec2::new(unit(part / solid_angle), unit(along))
}

/// A point of a shape, its normal, and the area over its density.
fn on_shape(shape: &EmissiveShape, u: Vec2) -> (Vec3, Vec3, f32) {
    match shape {
        EmissiveShape::Triangle([a, b, c]) => {
            let [s, t, r] = warp::uniform_triangle(u);
            let vector = (b - a).as_dvec3().cross((c - a).as_dvec3());
            (*a * s + *b * t + *c * r, vector.normalize_or_zero().as_vec3(), (0.5 * vector.length()) as f32)
        }
        EmissiveShape::Sphere(m) => {
            let local = warp::uniform_sphere(u);
            let (normal, area) = at_local(m, local);
            (m.transform_point3(local), normal, area)
        }
        EmissiveShape::Disc(m) => {
            let p = warp::uniform_disc(u);
            let scaled = normal_map(m) * DVec3::Y;
            let area = std::f64::consts::PI * scaled.length();
            (m.transform_point3(Vec3::new(p.x, 0.0, p.y)), scaled.normalize_or_zero().as_vec3(), area as f32)
        }
    }
}

/// The normal of a sphere's image at a local point, and the area over the density of uniform points there.
fn at_local(m: &Affine3A, local: Vec3) -> (Vec3, f32) {
    // dA of the image is |N local| dA of the unit sphere.
    let scaled = normal_map(m) * local.as_dvec3();
    (scaled.normalize_or_zero().as_vec3(), (4.0 * std::f64::consts::PI * scaled.length()) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Mat3;
    use crate::sampling::sequence;
    use crate::scene::InstanceId;
    use crate::spectrum::Spectrum;

    fn surface(shape: EmissiveShape, two_sided: bool) -> EmissiveSurface {
        EmissiveSurface { shape, radiance: Spectrum::gray(2.0), two_sided, instance: InstanceId(0), primitive: 0 }
    }

    /// One of each kind, about a metre and a half above the origin.
    fn shapes() -> [EmissiveShape; 4] {
        let triangle = EmissiveShape::Triangle([Vec3::new(-1.0, -0.5, 1.0), Vec3::new(0.3, 1.5, 1.2), Vec3::new(1.0, -0.8, 0.9)]);
        let ball = EmissiveShape::Sphere(Affine3A::from_mat3_translation(
            Mat3::from_diagonal(Vec3::splat(0.7)),
            Vec3::new(0.2, -0.1, 1.5),
        ));
        let egg = EmissiveShape::Sphere(Affine3A::from_mat3_translation(
            Mat3::from_diagonal(Vec3::new(0.3, 0.9, 0.5)),
            Vec3::new(0.2, -0.1, 1.5),
        ));
        let disc = EmissiveShape::Disc(Affine3A::from_mat3_translation(
            Mat3::from_cols(Vec3::new(0.8, 0.0, 0.2), Vec3::new(-0.2, 0.0, -1.0), Vec3::new(0.0, -0.9, 0.1)),
            Vec3::new(0.2, -0.1, 1.5),
        ));
        [triangle, ball, egg, disc]
    }

    /// The irradiance of `p` by the midpoint rule over the surface, L = 2; a twin may leave out the receiver's horizon.
    fn by_quadrature(s: &EmissiveSurface, p: Vec3, n: Vec3, with_horizon: bool) -> f64 {
        const N: u32 = 600;
        let mut sum = 0.0;
        for i in 0..N * N {
            let u = Vec2::new(((i % N) as f32 + 0.5) / N as f32, ((i / N) as f32 + 0.5) / N as f32);
            let (position, normal, area) = on_shape(&s.shape, u);
            let d = (position - p).as_dvec3();
            let cos_out = -d.dot(normal.as_dvec3());
            let cos_out = if s.two_sided { cos_out.abs() } else { cos_out.max(0.0) };
            let cos_in = d.dot(n.as_dvec3());
            let cos_in = if with_horizon { cos_in.max(0.0) } else { cos_in };
            sum += 2.0 * f64::from(area) * cos_out * cos_in / d.length_squared().powi(2);
        }
        sum / f64::from(N * N)
    }

    /// The mean over random points and its standard error.
    fn by_points(s: &EmissiveSurface, p: Vec3, n: Vec3) -> (f64, f64) {
        const RUNS: u64 = 64;
        const POINTS: u32 = 256;
        let run = |key: u64| {
            let Some(seen) = Seen::new(s, p, n) else { return 0.0 };
            (0..POINTS)
                .filter_map(|i| seen.incident(p, sequence::point_2d(i, key), POINTS as f32))
                .map(|incident| f64::from(incident.diffuse.g) * f64::from(incident.wi.dot(n).max(0.0)))
                .sum::<f64>()
        };
        let runs: Vec<f64> = (0..RUNS).map(run).collect();
        let mean = runs.iter().sum::<f64>() / RUNS as f64;
        let variance = runs.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / (RUNS - 1) as f64;
        (mean, (variance / RUNS as f64).sqrt())
    }

    #[test]
    fn points_on_every_shape_bring_its_light() {
        let [triangle, ball, egg, disc] = shapes();
        let flat = EmissiveShape::Triangle([Vec3::new(-3.0, -2.0, 0.05), Vec3::new(3.0, -2.0, 0.05), Vec3::new(0.0, 4.0, 0.05)]);
        let far = EmissiveShape::Triangle([Vec3::new(30.0, 0.0, 20.0), Vec3::new(30.0, 0.1, 20.0), Vec3::new(30.0, 0.0, 20.1)]);
        let mut beyond_the_horizon = 0;
        for (name, shape) in [("triangle", triangle), ("ball", ball), ("egg", egg), ("disc", disc), ("flat", flat), ("far", far)]
        {
            for n in [Vec3::Z, Vec3::new(0.8, 0.0, 0.6), Vec3::new(0.0, -0.9, -0.435_889_9), Vec3::NEG_Z] {
                // The far half of a closed shape is hidden by the near one.
                let s = surface(shape, !matches!(shape, EmissiveShape::Sphere(_)));
                let (mean, error) = by_points(&s, Vec3::ZERO, n);
                let expected = by_quadrature(&s, Vec3::ZERO, n, true);
                let bound = 4.5 * error + 2e-3 * expected + 1e-6;
                assert!((mean - expected).abs() < bound, "{name}, {n}: {mean} ± {error} instead of {expected}");
                let without = by_quadrature(&s, Vec3::ZERO, n, false);
                beyond_the_horizon += u32::from((mean - without).abs() > bound);
                // Nearly all the noise of what is above the horizon is gone.
                assert!(error < 0.02 * expected + 1e-6 || n.z < 1.0, "{name}: {mean} ± {error}");
            }
        }
        assert!(beyond_the_horizon >= 6, "the twin without a horizon is caught {beyond_the_horizon} times");
    }

    /// `∫ p(ω) dω` over the directions that meet the surface from `p`, by the midpoint rule over the surface, and how far `p` is from what points were drawn by.
    fn density_integral(s: &EmissiveSurface, p: Vec3, n: Vec3) -> (f64, f64) {
        const N: u32 = 400;
        let Some(seen) = Seen::new(s, p, n) else { return (1.0, 0.0) };
        let (mut sum, mut off) = (0.0, 0.0f64);
        let local = |position: Vec3| match &s.shape {
            EmissiveShape::Sphere(m) => m.inverse().transform_point3(position).normalize(),
            _ => Vec3::ZERO,
        };
        for i in 0..N * N {
            let u = Vec2::new(((i % N) as f32 + 0.5) / N as f32, ((i / N) as f32 + 0.5) / N as f32);
            let (position, normal, area) = on_shape(&s.shape, u);
            let d = (position - p).as_dvec3();
            let cos_out = -d.dot(normal.as_dvec3()) / d.length();
            let cos_out = if s.two_sided { cos_out.abs() } else { cos_out.max(0.0) };
            if cos_out > 0.0 {
                let pdf = seen.pdf(p, d.normalize().as_vec3(), d.length() as f32, local(position));
                sum += f64::from(pdf) * f64::from(area) * cos_out / d.length_squared() / f64::from(N * N);
            }
            if let Some(drawn) = seen.draw(p, u).filter(|_| i % 97 == 0) {
                let pdf = seen.pdf(p, drawn.wi, drawn.distance, local(drawn.position));
                off = off.max((f64::from(pdf) * f64::from(drawn.share) - 1.0).abs());
            }
        }
        (sum, off)
    }

    #[test]
    fn densities_are_those_points_are_drawn_with_and_integrate_to_one() {
        let [triangle, ball, egg, disc] = shapes();
        for (name, shape, two_sided) in
            [("triangle", triangle, true), ("ball", ball, false), ("egg", egg, true), ("disc", disc, true)]
        {
            for n in [Vec3::Z, Vec3::new(0.8, 0.0, 0.6)] {
                let (integral, off) = density_integral(&surface(shape, two_sided), Vec3::ZERO, n);
                assert!((integral - 1.0).abs() < 5e-3 && off < 2e-3, "{name}, {n}: {integral}, off by {off}");
                // The twin: half as large a surface has not the same density.
                let EmissiveShape::Triangle(corners) = shape else { continue };
                let half = surface(EmissiveShape::Triangle([corners[0], corners[1], corners[2].midpoint(corners[0])]), two_sided);
                let seen = Seen::new(&half, Vec3::ZERO, n).expect("it is seen");
                let wi = (corners[0] + corners[1]).normalize();
                let own =
                    Seen::new(&surface(shape, two_sided), Vec3::ZERO, n).map_or(0.0, |s| s.pdf(Vec3::ZERO, wi, 1.0, Vec3::ZERO));
                assert!((seen.pdf(Vec3::ZERO, wi, 1.0, Vec3::ZERO) / own - 1.0).abs() > 0.3);
            }
        }
    }

    #[test]
    fn the_inside_of_a_ball_is_dark_unless_it_emits_to_both_sides() {
        let ball = EmissiveShape::Sphere(Affine3A::IDENTITY);
        let p = Vec3::new(0.1, 0.2, -0.3);
        assert!(Seen::new(&surface(ball, false), p, Vec3::Z).is_none());
        let (mean, error) = by_points(&surface(ball, true), p, Vec3::Z);
        let expected = 2.0 * std::f64::consts::PI;
        assert!((mean - expected).abs() < 4.5 * error + 1e-3, "{mean} ± {error}");
    }

    #[test]
    fn one_sided_shapes_give_nothing_behind() {
        let triangle = EmissiveShape::Triangle([Vec3::new(-1.0, -1.0, 1.0), Vec3::new(1.0, -1.0, 1.0), Vec3::new(0.0, 1.0, 1.0)]);
        assert!(Seen::new(&surface(triangle, false), Vec3::ZERO, Vec3::Z).is_none());
        assert!(Seen::new(&surface(triangle, true), Vec3::ZERO, Vec3::Z).is_some());
        assert!(Seen::new(&surface(triangle, false), Vec3::Z * 2.0, Vec3::NEG_Z).is_some());
    }

    #[test]
    fn a_large_triangle_does_not_hide_its_own_points() {
        for (side, height) in [(5.0f32, 0.01f32), (50.0, 0.02), (0.5, 0.3)] {
            // Above the origin, slanting.
            let corners = [[-0.4, -0.3], [0.6, -0.2], [-0.1, 0.7]]
                .map(|[x, y]: [f32; 2]| Vec3::new(x * side, y * side, height + 0.3 * height * x));
            let panel = surface(EmissiveShape::Triangle(corners), true);
            let p = Vec3::new(0.31, -0.17, 0.0);
            let seen = Seen::new(&panel, p, Vec3::Z).expect("it shines there");
            let [a, b, c] = corners.map(|corner| corner.as_dvec3());
            let normal = (b - a).cross(c - a);
            let side_of = |q: Vec3| (q.as_dvec3() - a).dot(normal) * (p.as_dvec3() - a).dot(normal);
            let drawn: Vec<_> = (0..20_000).filter_map(|i| seen.draw(p, sequence::point_2d(i, 7))).collect();
            assert!(drawn.len() > 19_000);
            assert!(drawn.iter().all(|d| side_of(d.target) > 0.0), "side {side}, height {height}");
            // The twin's rays end on the panel itself, to rounding.
            assert!(drawn.iter().any(|d| side_of(d.position) <= 0.0));
        }
    }

    /// Whether a ray from `p` to a point ends before it meets a ball around the origin.
    fn is_free(p: Vec3, target: Vec3, radius: f64) -> bool {
        let (o, d) = (p.as_dvec3(), (target - p).as_dvec3());
        let (a, b) = (d.length_squared(), o.dot(d));
        let rest = radius * radius - (o - d * (b / a)).length_squared();
        rest < 0.0 || (-b - (a * rest).sqrt()) / a >= 1.0
    }

    #[test]
    fn a_ball_does_not_hide_its_own_points() {
        let radius = 0.9f32;
        let ball = surface(EmissiveShape::Sphere(Affine3A::from_scale(Vec3::splat(radius))), false);
        for p in [Vec3::new(0.3, -4.2, 0.7), Vec3::new(-40.0, 3.0, 11.0), Vec3::new(0.2, 0.95, 0.1)] {
            let seen = Seen::new(&ball, p, -p.normalize()).expect("it shines there");
            let drawn = (0..20_000).filter_map(|i| seen.draw(p, sequence::point_2d(i, 7))).collect::<Vec<_>>();
            let hidden = |of: fn(&Drawn) -> Vec3| drawn.iter().filter(|d| !is_free(p, of(d), f64::from(radius))).count();
            assert_eq!(hidden(|d| d.target), 0, "from {p}");
            // The twin's rays end on the ball itself.
            assert!(hidden(|d| d.position) > 1000, "from {p}");
        }
    }
}
