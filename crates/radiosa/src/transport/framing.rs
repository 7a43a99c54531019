//! A sensible view of a scene that brings no camera.
//!
//! Rays decide what kind of place it is: from the middle of a *room* most directions meet the front of something, so the
//! camera stands inside and looks across it; a *box* with one open side is looked into through that side; anything else is an *object*, seen from
//! outside, from the side that shows most fronts.

use super::{View, World};
use crate::math::{DVec3, Ray, Vec3};
use crate::scene::{Camera, Geometry, LightKind, Projection};

/// Fraction of directions that must meet a front for a point to count as inside a room.
const ENCLOSED: f64 = 0.7;

/// Enclosed points a place must have to count as a room.
const ROOMY: usize = 4;

/// Chooses a view for a picture `aspect` times as wide as high. Deterministic.
pub fn automatic(world: &World, aspect: f64) -> Camera {
    let bounds = world.accel().bounds();
    if bounds.is_empty() {
        return Camera::look_at("automatic", DVec3::Z * 5.0, DVec3::ZERO, DVec3::Y, perspective(45.0));
    }
    let size = bounds.extent().as_dvec3();
    let probes = probes(world, bounds.min.as_dvec3(), size);
    let rooms: Vec<&Probe> = probes.iter().filter(|probe| probe.fronts >= ENCLOSED).collect();
    // A hollow object is enclosed at its middle; a room nearly everywhere.
    let camera = if rooms.len() < ROOMY {
        object(world, aspect)
    } else if let Some(direction) = opening(&probes) {
        outside(world, direction, 40.0, aspect)
    } else {
        // Where a fifth of all directions leads out, it is a place among things rather than a room.
        let closed = |probe: &&&Probe| probe.open.len() as f64 <= 0.2 * f64::from(Probe::DIRECTIONS);
        let closed: Vec<&Probe> = rooms.iter().filter(closed).copied().collect();
        if closed.is_empty() { object(world, aspect) } else { inside(world, &closed, aspect) }
    };
    Camera { position: camera.position + world.origin(), ..camera }
}

fn perspective(degrees: f64) -> Projection {
    Projection::Perspective { fov_y: degrees.to_radians() }
}

/// What can be seen from one point.
struct Probe {
    position: DVec3,
    /// Fraction of directions that meet a front.
    fronts: f64,
    /// Directions that meet nothing.
    open: Vec<DVec3>,
}

impl Probe {
    const DIRECTIONS: u32 = 96;

    fn at(world: &World, position: DVec3) -> Self {
        let mut fronts = 0;
        let mut open = Vec::new();
        for dir in sphere_directions(Self::DIRECTIONS) {
            match look(world, position, dir) {
                Some((_, true)) => fronts += 1,
                Some((_, false)) => {}
                None => open.push(dir),
            }
        }
        Self { position, fronts: f64::from(fronts) / f64::from(Self::DIRECTIONS), open }
    }
}

/// Points of the unit sphere on a Fibonacci spiral.
fn sphere_directions(n: u32) -> impl Iterator<Item = DVec3> {
    const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;
    (0..n).map(move |i| {
        let y = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(n);
        let (s, c) = libm::sincos(GOLDEN_ANGLE * f64::from(i));
        let r = (1.0 - y * y).sqrt();
        DVec3::new(r * c, y, r * s)
    })
}

/// Distance to what lies in a direction, and whether it shows its front.
///
/// Only the winding counts: a closed object whose material shows on both sides is still no room.
fn look(world: &World, from: DVec3, dir: DVec3) -> Option<(f64, bool)> {
    let ray = Ray::new(from.as_vec3(), dir.as_vec3());
    let hit = world.accel().closest(&ray)?;
    Some((f64::from(hit.t), world.surface(&ray, &hit).is_front(-ray.dir)))
}

/// Points worth looking around from: a grid over the bounds, and the places of lamps, since where a lamp hangs people look from.
fn probes(world: &World, lo: DVec3, size: DVec3) -> Vec<Probe> {
    let grid = (0..27u32).map(|i| {
        let at = |k: u32| 0.25 + 0.25 * f64::from(i / 3u32.pow(k) % 3);
        lo + size * DVec3::new(at(0), at(1), at(2))
    });
    let lamps = world.scene().lights.iter().filter_map(|light| match light.kind {
        LightKind::Point { position, .. } | LightKind::Spot { position, .. } => Some(position - world.origin()),
        _ => None,
    });
    let inside = |p: &DVec3| (*p - lo).cmpge(DVec3::ZERO).all() && (*p - lo).cmple(size).all();
    grid.chain(lamps.filter(inside).take(64)).map(|p| Probe::at(world, p)).collect()
}

/// The direction of the open side of a box, if the ways out are many and all on one side.
fn opening(probes: &[Probe]) -> Option<DVec3> {
    // Probes that stand in something solid, or outside, say nothing.
    let inside: Vec<&Probe> = probes.iter().filter(|p| p.fronts >= 0.5).collect();
    let open: Vec<DVec3> = inside.iter().flat_map(|p| p.open.iter().copied()).collect();
    // A window is smaller than this, a missing wall larger.
    if (open.len() as f64) < 0.07 * f64::from(Probe::DIRECTIONS) * inside.len() as f64 {
        return None;
    }
    let mean = open.iter().sum::<DVec3>() / open.len() as f64;
    if mean.length() < 0.6 {
        return None;
    }
    let axis = mean.normalize();
    let snapped = DVec3::AXES.into_iter().flat_map(|a| [a, -a]).find(|a| a.dot(axis) > 0.9);
    // Looking straight up or down into something is no view of a room.
    snapped.or(Some(axis)).filter(|d| d.y.abs() < 0.7)
}

/// From outside, looking in the direction `-from`, with everything in the picture.
fn outside(world: &World, from: DVec3, degrees: f64, aspect: f64) -> Camera {
    let (lo, hi) = interesting_bounds(world);
    let centre = (lo + hi) * 0.5;
    let mut camera = Camera::look_at("automatic", centre + from, centre, DVec3::Y, perspective(degrees));
    // The nearest distance at which all eight corners of the bounds are inside the frustum, and a margin.
    let tan_y = libm::tan(degrees.to_radians() * 0.5) * 0.94;
    let tan_x = tan_y * aspect;
    let mut distance = (hi - lo).max_element() * 1e-3;
    for corner in 0..8u32 {
        let pick = |axis: u32| if corner >> axis & 1 == 0 { lo } else { hi };
        let p = DVec3::new(pick(0).x, pick(1).y, pick(2).z) - centre;
        let (x, y, z) = (p.dot(camera.basis.x_axis), p.dot(camera.basis.y_axis), p.dot(camera.basis.z_axis));
        distance = distance.max(z + x.abs() / tan_x).max(z + y.abs() / tan_y);
    }
    if distance == 0.0 {
        distance = 1.0;
    }
    camera.position = centre + camera.basis.z_axis * distance;
    camera
}

/// The bounds of everything; or, where most vertices crowd in a small part of them (things on a huge floor), of that part.
fn interesting_bounds(world: &World) -> (DVec3, DVec3) {
    let bounds = world.accel().bounds();
    let (lo, hi) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
    let mut vertices: [Vec<f64>; 3] = Default::default();
    for instance in &world.scene().instances {
        let Geometry::Mesh(id) = instance.geometry else { return (lo, hi) };
        let positions = &world.scene().meshes[id.index()].positions;
        // A few thousand a mesh are enough to know where most are.
        for p in positions.iter().step_by(positions.len() / 4096 + 1) {
            let p = instance.transform.transform_point3(*p) - world.origin();
            vertices.iter_mut().zip(p.to_array()).for_each(|(column, v)| column.push(v));
        }
    }
    let n = vertices[0].len();
    if n < 100 {
        return (lo, hi);
    }
    let mut trimmed = [[0.0; 2]; 3];
    for (range, column) in trimmed.iter_mut().zip(&mut vertices) {
        column.sort_unstable_by(f64::total_cmp);
        *range = [column[n / 50], column[n - 1 - n / 50]];
    }
    let corner = |k: usize| DVec3::new(trimmed[0][k], trimmed[1][k], trimmed[2][k]);
    let (a, b) = (corner(0), corner(1));
    if (b - a).max_element() < 0.15 * (hi - lo).max_element() { (a, b) } else { (lo, hi) }
}

/// The side of an object that shows most fronts, with a liking for the usual three-quarter view.
fn object(world: &World, aspect: f64) -> Camera {
    let mut best = (f64::NEG_INFINITY, None);
    for elevation in [22.0f64, -22.0] {
        for eighth in 0..8 {
            let azimuth = 30.0 + 45.0 * f64::from(eighth);
            let (sa, ca) = libm::sincos(azimuth.to_radians());
            let (se, ce) = libm::sincos(elevation.to_radians());
            let camera = outside(world, DVec3::new(ce * sa, se, ce * ca), 35.0, aspect);
            let (fronts, hits, _) = survey(world, &camera, aspect);
            let front_fraction = if hits > 0.0 { fronts / hits } else { 0.0 };
            // Every step away from the first candidate must show clearly more.
            let liking = if elevation > 0.0 { 0.15 } else { 0.0 } + if eighth == 0 { 0.1 } else { 0.0 };
            let score = front_fraction + 0.3 * hits + liking;
            if score > best.0 {
                best = (score, Some(camera));
            }
        }
    }
    best.1.expect("at least one candidate has a score above negative infinity")
}

/// Inside a room: stands near a wall at eye height and looks across, where most can be seen.
fn inside(world: &World, rooms: &[&Probe], aspect: f64) -> Camera {
    let mut best = (f64::NEG_INFINITY, None);
    for probe in rooms.iter().step_by(rooms.len() / 12 + 1) {
        let centre = probe.position;
        let reach = |dir: DVec3| look(world, centre, dir).map_or(0.0, |(t, _)| t);
        let (down, up) = (reach(-DVec3::Y), reach(DVec3::Y));
        let eye_height = if up > 0.0 && down > 0.0 { centre.y - down + 0.52 * (down + up) } else { centre.y };
        let middle = DVec3::new(centre.x, eye_height, centre.z);
        for sixteenth in 0..16 {
            let (s, c) = libm::sincos((f64::from(sixteenth) + 0.5) * std::f64::consts::TAU / 16.0);
            let towards_wall = DVec3::new(s, 0.0, c);
            let Some((distance, _)) = look(world, middle, towards_wall) else { continue };
            let eye = middle + towards_wall * (distance * 0.86);
            let target = middle - towards_wall * distance - DVec3::Y * (0.12 * distance);
            let camera = Camera::look_at("automatic", eye, target, DVec3::Y, perspective(60.0));
            let (fronts, hits, depth) = survey(world, &camera, aspect);
            let score = fronts + 0.25 * hits + depth;
            if score > best.0 {
                best = (score, Some(camera));
            }
        }
    }
    best.1.unwrap_or_else(|| object(world, aspect))
}

/// A coarse look through a camera: the fraction of fronts, the fraction of hits, and a measure of how deep the view is and how
/// different the directions of what it shows are (0 … 1).
fn survey(world: &World, camera: &Camera, aspect: f64) -> (f64, f64, f64) {
    const N: u32 = 20;
    let columns = ((f64::from(N) * aspect).round() as u32).clamp(4, 80);
    let view = View::new(camera, DVec3::ZERO, columns, N);
    let size = f64::from(world.accel().bounds().extent().max_element());
    let (mut fronts, mut hits, mut depth) = (0u32, 0u32, 0.0);
    let mut facing = [0u32; 6];
    for i in 0..columns * N {
        let ray = view.ray(f64::from(i % columns) + 0.5, f64::from(i / columns) + 0.5);
        let Some(hit) = world.accel().closest(&ray) else { continue };
        let surface = world.surface(&ray, &hit);
        hits += 1;
        if surface.is_front(-ray.dir) {
            fronts += 1;
            let n: Vec3 = surface.n;
            let axis = n.abs().max_position();
            facing[axis * 2 + usize::from(n[axis] < 0.0)] += 1;
            // A hit nearer than a fiftieth of the scene hides more than it shows.
            depth += (f64::from(hit.t) / size / 0.02).min(1.0) * (f64::from(hit.t) / size).min(1.0).sqrt();
        }
    }
    let total = f64::from(columns * N);
    let variety = facing.iter().filter(|&&n| f64::from(n) > 0.02 * total).count() as f64 / 6.0;
    (f64::from(fronts) / total, f64::from(hits) / total, 0.5 * (depth / total + variety))
}
