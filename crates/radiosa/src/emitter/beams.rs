//! Where paths of light begin: rays from light sources towards the bodies that mirror or refract them ([Jensen95] calls the map of those directions a projection map).
//!
//! A source is chosen by about the light it sends to those bodies, a point on it by area, a body, and a direction in the cone around that body's bounding sphere. All that is
//! counted by its density over what is conserved along a ray,
//!
//! ```text
//! e = P p_A p_ω / cosθ        per m² sr, of the area across the ray times the solid angle
//! ```
//!
//! so that one ray of n stands for the light `L_e/(n e)`; the density of a direction counts all cones that hold it.

use std::collections::HashMap;
use std::f32::consts::{FRAC_1_PI, PI, TAU};

use super::area::{EmissiveShape, EmissiveSurface, normal_map};
use super::point::Falloff;
use super::{Emitter, Incident};
use crate::math::rounding::gamma;
use crate::math::{Frame, Ray, Vec2, Vec3, function};
use crate::sampling::warp;
use crate::spectrum::Spectrum;

/// Bodies beyond so many are taken together with their neighbours.
const MOST_TARGETS: usize = 16;

/// Something that light is sent to: the sphere around it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Target {
    pub(crate) centre: Vec3,
    pub(crate) radius: f32,
}

/// Draws rays from light sources.
#[derive(Debug)]
pub(crate) struct Beams {
    sources: Vec<Source>,
    /// Running sums of the probabilities of sources, ending at 1.
    cumulative: Vec<f64>,
    /// By instance and primitive: the source.
    surfaces: HashMap<(u32, u32), usize>,
    targets: Vec<Target>,
    /// From any target to outside of everything, m.
    far: f32,
}

/// What sends light.
#[derive(Debug)]
enum Source {
    Surface(EmissiveSurface),
    /// A point or a spot.
    Lamp(Emitter),
    /// Parallel light.
    Sun(Incident),
}

/// A ray that leaves a source.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Beam<'a> {
    pub(crate) ray: Ray,
    pub(crate) from: Origin<'a>,
}

/// What a ray carries.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Origin<'a> {
    /// The radiance of a point of a surface, of rays with the density `e`.
    Surface { surface: &'a EmissiveSurface, position: Vec3, density: f32 },
    /// What one ray alone stands for, in watts or lumens, as diffuse and as specular lobes are given it, and what becomes of a lamp's light with the distance.
    Delta { diffuse: Spectrum, specular: Spectrum, falloff: Option<Falloff> },
}

impl Beams {
    /// From `surfaces` and `lamps` to `targets`, from which it is at most `far` to outside of the scene; `None` where there is nothing to send, or nowhere to send it.
    pub(crate) fn new(
        surfaces: &[EmissiveSurface],
        lamps: impl Iterator<Item = Emitter>,
        targets: Vec<Target>,
        far: f32,
    ) -> Option<Self> {
        let targets = joined(targets);
        let mut sources: Vec<Source> = surfaces.iter().copied().map(Source::Surface).collect();
        for lamp in lamps {
            match &lamp {
                Emitter::Point(_) | Emitter::Spot(_) => sources.push(Source::Lamp(lamp)),
                Emitter::Distant(_) | Emitter::Discrete(_) => {
                    lamp.for_each_incident(Vec3::ZERO, &mut |incident| sources.push(Source::Sun(incident)));
                }
                _ => {}
            }
        }
        let weights: Vec<f64> = sources.iter().map(|source| source.sends(&targets)).collect();
        let sum: f64 = weights.iter().sum();
        if sum <= 0.0 || !sum.is_finite() {
            return None;
        }
        let mut reached = 0.0;
        let cumulative = weights.iter().map(|w| {
            reached += w / sum;
            reached
        });
        let cumulative = cumulative.collect();
        let of = |(k, source): (usize, &Source)| match source {
            Source::Surface(s) => Some(((s.instance.0, s.primitive), k)),
            _ => None,
        };
        let surfaces = sources.iter().enumerate().filter_map(of).collect();
        Some(Self { sources, cumulative, surfaces, targets, far })
    }

    /// The ray that five uniform numbers draw, `choice` the source; `None` where it would bring nothing.
    pub(crate) fn draw(&self, choice: f64, place: Vec2, towards: Vec2) -> Option<Beam<'_>> {
        let k = self.cumulative.partition_point(|&c| c <= choice).min(self.sources.len() - 1);
        let before = if k > 0 { self.cumulative[k - 1] } else { 0.0 };
        let probability = self.cumulative[k] - before;
        if probability <= 0.0 {
            return None;
        }
        let rest = ((choice - before) / probability).clamp(0.0, 1.0) as f32;
        let probability = probability as f32;
        // One number tells the target, and what is left of it the direction.
        let x = towards.x * self.targets.len() as f32;
        let target = self.targets[(x as usize).min(self.targets.len() - 1)];
        let towards = Vec2::new(x.fract(), towards.y);
        match &self.sources[k] {
            Source::Surface(surface) => {
                let position = point_on(&surface.shape, place);
                let mut n = surface.shape.normal_at(position);
                if surface.two_sided && rest < 0.5 {
                    n = -n;
                }
                let dir = target.direction(position, Some(n), towards);
                let density = probability * self.density_of(surface, position, n, dir);
                let origin = position + n * (position.abs().max_element() * gamma(16));
                let from = Origin::Surface { surface, position, density };
                (density > 0.0 && density.is_finite()).then(|| Beam { ray: Ray::new(origin, dir), from })
            }
            Source::Lamp(lamp) => {
                let (point, profile) = match lamp {
                    Emitter::Point(point) => (point, 1.0),
                    Emitter::Spot(spot) => (&spot.point, 0.0),
                    _ => return None,
                };
                let dir = target.direction(point.position, None, towards);
                let profile = if let Emitter::Spot(spot) = lamp { spot.profile.at(spot.axis, dir) } else { profile };
                let density = probability * self.directional(point.position, None, dir);
                let factor = profile / density;
                let (diffuse, specular) = (point.diffuse * factor, point.specular * factor);
                let from = Origin::Delta { diffuse, specular, falloff: Some(point.falloff) };
                (factor > 0.0 && factor.is_finite()).then(|| Beam { ray: Ray::new(point.position, dir), from })
            }
            Source::Sun(incident) => {
                // From a disc across the light.
                let frame = Frame::from_normal(incident.wi);
                let disc = warp::uniform_disc(place) * target.radius;
                let p = target.centre + frame.to_world(Vec3::new(disc.x, disc.y, 0.0));
                let across = |q: Vec3| q - incident.wi * q.dot(incident.wi);
                let holding = |t: &Target| {
                    let is_within = across(p - t.centre).length_squared() <= t.radius * t.radius;
                    if is_within { 1.0 / (PI * t.radius * t.radius) } else { 0.0 }
                };
                let density = probability * self.targets.iter().map(holding).sum::<f32>() / self.targets.len() as f32;
                let (diffuse, specular) = (incident.diffuse / density, incident.specular / density);
                let from = Origin::Delta { diffuse, specular, falloff: None };
                (density > 0.0).then(|| Beam { ray: Ray::new(p + incident.wi * self.far, -incident.wi), from })
            }
        }
    }

    /// `e` of a ray that leaves a point of an emissive primitive in the direction `dir`, with its unit normal `n` on that side; 0 where none is ever drawn.
    pub(crate) fn density(&self, (instance, primitive): (u32, u32), position: Vec3, n: Vec3, dir: Vec3) -> f32 {
        let Some(&k) = self.surfaces.get(&(instance, primitive)) else { return 0.0 };
        let Source::Surface(surface) = &self.sources[k] else { return 0.0 };
        let probability = self.cumulative[k] - if k > 0 { self.cumulative[k - 1] } else { 0.0 };
        probability as f32 * self.density_of(surface, position, n, dir)
    }

    /// The same, of rays from this surface alone.
    fn density_of(&self, surface: &EmissiveSurface, position: Vec3, n: Vec3, dir: Vec3) -> f32 {
        let cos = n.dot(dir);
        if cos <= 0.0 {
            return 0.0;
        }
        let side = if surface.two_sided { 0.5 } else { 1.0 };
        side * area_density(&surface.shape, position) * self.directional(position, Some(n), dir) / cos
    }

    /// The density of a direction from a place, 1/sr.
    fn directional(&self, p: Vec3, n: Option<Vec3>, dir: Vec3) -> f32 {
        self.targets.iter().map(|target| target.pdf(p, n, dir)).sum::<f32>() / self.targets.len() as f32
    }
}

impl Source {
    /// About the light it sends to all targets: its intensity times the solid angles of those.
    fn sends(&self, targets: &[Target]) -> f64 {
        let solid_angles = |p: Vec3| targets.iter().map(|t| f64::from(TAU * t.one_minus_cos(p).unwrap_or(1.0))).sum::<f64>();
        match self {
            Self::Surface(s) => f64::from(s.power()) * solid_angles(middle(&s.shape)),
            Self::Lamp(Emitter::Point(point)) => f64::from(point.diffuse.luminance()) * solid_angles(point.position),
            Self::Lamp(Emitter::Spot(spot)) => f64::from(spot.point.diffuse.luminance()) * solid_angles(spot.point.position),
            Self::Lamp(_) => 0.0,
            Self::Sun(i) => {
                f64::from(i.diffuse.luminance()) * targets.iter().map(|t| f64::from(PI * t.radius * t.radius)).sum::<f64>()
            }
        }
    }
}

impl Target {
    /// `1 − cos` of the half angle it is seen under from `p`; `None` from within.
    fn one_minus_cos(&self, p: Vec3) -> Option<f32> {
        let sin2 = self.radius * self.radius / (self.centre - p).length_squared();
        (sin2 < 1.0).then(|| sin2 / (1.0 + (1.0 - sin2).sqrt()))
    }

    /// A direction from `p`: in the cone around it; from within by the cosine to `n`, or any.
    fn direction(&self, p: Vec3, n: Option<Vec3>, u: Vec2) -> Vec3 {
        match (self.one_minus_cos(p), n) {
            (Some(one_minus_cos), _) => {
                let towards = Frame::from_normal((self.centre - p).normalize());
                // (1 − cos itself is drawn, which narrow cones would lose in the cosine.)
                let q = u.x * one_minus_cos;
                let (sin, phi) = ((q * (2.0 - q)).sqrt(), TAU * u.y);
                towards.to_world(Vec3::new(sin * function::cos(phi), sin * function::sin(phi), 1.0 - q)).normalize()
            }
            (None, Some(n)) => Frame::from_normal(n).to_world(warp::cosine_hemisphere(u)),
            (None, None) => warp::uniform_sphere(u),
        }
    }

    /// The density of that, 1/sr.
    fn pdf(&self, p: Vec3, n: Option<Vec3>, dir: Vec3) -> f32 {
        match (self.one_minus_cos(p), n) {
            (Some(one_minus_cos), _) => {
                // By |a − b|²/2 = 1 − cos, which narrow cones do not cancel in.
                let off = 0.5 * ((self.centre - p).normalize() - dir).length_squared();
                if off <= one_minus_cos { 1.0 / (TAU * one_minus_cos) } else { 0.0 }
            }
            (None, Some(n)) => n.dot(dir).max(0.0) * FRAC_1_PI,
            (None, None) => 0.25 * FRAC_1_PI,
        }
    }
}

/// Spheres around neighbours, where there are too many.
fn joined(mut targets: Vec<Target>) -> Vec<Target> {
    targets.retain(|t| t.radius > 0.0 && t.radius.is_finite() && t.centre.is_finite());
    if targets.len() <= MOST_TARGETS {
        return targets;
    }
    let mut groups = vec![targets];
    while groups.len() < MOST_TARGETS {
        // The group that spreads most is divided in its middle.
        let spread = |group: &[Target]| {
            let at = |axis: usize| group.iter().map(move |t| t.centre[axis]);
            let width = |axis: usize| at(axis).fold(f32::MIN, f32::max) - at(axis).fold(f32::MAX, f32::min);
            (0..3).map(|axis| (width(axis), axis)).max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or_default()
        };
        let widest = (0..groups.len()).max_by(|&a, &b| spread(&groups[a]).0.total_cmp(&spread(&groups[b]).0));
        let Some(mut group) = widest.map(|i| groups.swap_remove(i)) else { break };
        let (width, axis) = spread(&group);
        if width <= 0.0 {
            groups.push(group);
            break;
        }
        group.sort_by(|a, b| a.centre[axis].total_cmp(&b.centre[axis]));
        let half = group.split_off(group.len() / 2);
        groups.extend([group, half]);
    }
    let around = |group: &Vec<Target>| {
        let centre = group.iter().map(|t| t.centre).sum::<Vec3>() / group.len() as f32;
        let reach = |t: &Target| (t.centre - centre).length() + t.radius;
        Target { centre, radius: group.iter().map(reach).fold(0.0, f32::max) }
    };
    groups.iter().map(around).collect()
}

/// A point drawn by area (of the unit shape, for the exact ones).
fn point_on(shape: &EmissiveShape, u: Vec2) -> Vec3 {
    match shape {
        EmissiveShape::Triangle([a, b, c]) => {
            let [x, y, z] = warp::uniform_triangle(u);
            *a * x + *b * y + *c * z
        }
        EmissiveShape::Sphere(m) => m.transform_point3(warp::uniform_sphere(u)),
        EmissiveShape::Disc(m) => {
            let disc = warp::uniform_disc(u);
            m.transform_point3(Vec3::new(disc.x, 0.0, disc.y))
        }
    }
}

/// The density of that point, 1/m².
fn area_density(shape: &EmissiveShape, position: Vec3) -> f32 {
    match shape {
        EmissiveShape::Triangle(_) | EmissiveShape::Disc(_) => (1.0 / shape.area()) as f32,
        EmissiveShape::Sphere(m) => {
            let local = m.inverse().transform_point3(position).normalize_or(Vec3::Y);
            0.25 * FRAC_1_PI / normal_map(m).mul_vec3(local.as_dvec3()).length() as f32
        }
    }
}

/// Some middle of a shape.
fn middle(shape: &EmissiveShape) -> Vec3 {
    match shape {
        EmissiveShape::Triangle([a, b, c]) => (*a + *b + *c) / 3.0,
        EmissiveShape::Sphere(m) | EmissiveShape::Disc(m) => m.translation.into(),
    }
}
