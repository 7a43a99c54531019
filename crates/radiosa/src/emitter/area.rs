//! Emissive surfaces as the local models see them: a number of cosine point sources.
//!
//! A piece of area `A_k` and radiance `L_e` at distance `d` gives `L_e A_k cos θ cos θ′/d²`, θ at the receiver and θ′ at the piece: the
//! one-point rule for its irradiance, good where the piece is small against `d`.
//!
//! [`sample_points`] divides what emits: triangles that share an edge and a plane are one emitter (a quad, a polygon with holes) and are
//! cut by an N×N grid along their own edges, each cell becoming a point at its centroid with the cell's exact area; so a
//! parallelogram becomes a regular grid. Exact discs and spheres are cut in polar cells. A curved mesh is many small planar emitters: each connected
//! one gets no more points than the six faces of a box would, its facets merged. Whatever is merged, the areas add up to the surface's.

use std::collections::HashMap;

use super::Incident;
use crate::math::rounding::gamma;
use crate::math::{Affine3A, Bounds, DMat3, DVec2, DVec3, Vec3, Vec3A, function};
use crate::scene::InstanceId;
use crate::spectrum::Spectrum;

/// One piece of an emissive surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointSample {
    /// World coordinates.
    pub position: Vec3,
    /// Unit, the front.
    pub normal: Vec3,
    /// `L_e`, W/(m² sr) or cd/m².
    pub radiance: Spectrum,
    /// `A_k`, m².
    pub area: f32,
    /// Emits from the back as well.
    pub two_sided: bool,
}

impl PointSample {
    /// What arrives at `p`; nothing behind a one-sided piece, in its plane, or on the very point.
    pub fn incident(&self, p: Vec3) -> Option<Incident> {
        let to_light = self.position - p;
        let distance = to_light.length();
        if distance.is_nan() || distance <= 0.0 {
            return None;
        }
        let wi = to_light / distance;
        let cos = -self.normal.dot(wi);
        let cos = if self.two_sided { cos.abs() } else { cos };
        let factor = self.area * cos / distance / distance;
        (cos > 0.0 && factor.is_finite()).then(|| {
            let irradiance = self.radiance * factor;
            // A few roundings lead from the surface's vertices to the point; the ray's end stays clear of them. An end a rounding off the
            // exact offset does no harm, so nothing is rounded outwards here.
            let clear = self.normal * (self.position.abs().max_element() * gamma(16));
            let target = if self.normal.dot(wi) < 0.0 { self.position + clear } else { self.position - clear };
            Incident { wi, distance, target: Some(target), diffuse: irradiance, specular: irradiance, casts_shadow: true }
        })
    }

    /// Emitted power over π, the measure of what a point is worth.
    fn weight(&self) -> f64 {
        f64::from(self.radiance.luminance()) * f64::from(self.area) * if self.two_sided { 2.0 } else { 1.0 }
    }
}

/// The pieces of all emissive surfaces of a scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointSamples {
    /// In the order of the surfaces, unless they had to be merged to obey the limit.
    pub samples: Vec<PointSample>,
    /// How many there would be without the limit on the total, where that is met.
    pub n_wanted: Option<usize>,
}

impl PointSamples {
    /// How many there are.
    pub fn len(&self) -> usize {
        self.samples.len()
    }

    /// True when nothing emits.
    pub fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }
}

/// What emits, in world coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum EmissiveShape {
    /// Counter-clockwise seen from the front.
    Triangle([Vec3; 3]),
    /// The image of the unit sphere; its outside is the front.
    Sphere(Affine3A),
    /// The image of the unit disc in y = 0; the front is +y's side, whatever the sign of the determinant.
    Disc(Affine3A),
}

/// One primitive that emits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmissiveSurface {
    /// Where.
    pub shape: EmissiveShape,
    /// Mean emitted radiance `L_e` over the primitive, W/(m² sr) or cd/m².
    pub radiance: Spectrum,
    /// Emits from both sides.
    pub two_sided: bool,
    /// The instance it belongs to; triangles of different instances are never joined.
    pub instance: InstanceId,
    /// Its triangle there.
    pub primitive: u32,
}

impl EmissiveSurface {
    /// `L_e A` in luminance, twice that where both sides emit: emitted power over π.
    pub(crate) fn power(&self) -> f32 {
        let sides = if self.two_sided { 2.0 } else { 1.0 };
        (f64::from(self.radiance.luminance()) * self.shape.area() * sides) as f32
    }
}

/// Normals within this of each other (1 − cos, about 0.08°) count as the same plane: more than rounding leaves, less than modelling means.
const COPLANAR: f64 = 1e-6;
/// A connected curved emitter gets at most this many times N×N points: as many as a box.
const FACES_OF_A_BOX: usize = 6;

/// Divides emissive surfaces into points: about `n × n` (at least one) for each connected coplanar emitter, not more than `max` (at least
/// two) in all. When that does not suffice, points go to the strongest emitters first, and at last neighbouring pieces are merged.
///
/// Time and memory grow with the number of primitives and of points, nothing else.
pub fn sample_points(surfaces: &[EmissiveSurface], n: u32, max: u32) -> PointSamples {
    let n = n.clamp(1, 1024);
    let max = max.max(2) as usize;
    let emitters = emitters(surfaces);

    // Within each connected mesh first, then over everything.
    let mut sides: Vec<u32> = vec![n; emitters.len()];
    let mut members: Vec<Vec<usize>> = Vec::new();
    for (i, emitter) in emitters.iter().enumerate() {
        if members.len() <= emitter.mesh {
            members.resize(emitter.mesh + 1, Vec::new());
        }
        members[emitter.mesh].push(i);
    }
    let budget = FACES_OF_A_BOX * (n * n) as usize;
    for mesh in &members {
        allot(&emitters, mesh, &mut sides, budget);
    }
    let n_wanted: usize =
        members.iter().map(|mesh| mesh.iter().map(|&i| emitters[i].count(sides[i])).sum::<usize>().min(budget.max(1))).sum();
    if n_wanted > max {
        allot(&emitters, &(0..emitters.len()).collect::<Vec<_>>(), &mut sides, max);
    }

    let mut samples = Vec::new();
    for mesh in &members {
        let mut own = Vec::new();
        for &i in mesh {
            emitters[i].sample(surfaces, sides[i], &mut own);
        }
        samples.extend(merge(own, budget));
    }
    PointSamples { samples: merge(samples, max), n_wanted: (n_wanted > max).then_some(n_wanted) }
}

/// A connected coplanar set of triangles, or one exact shape.
struct PlanarEmitter {
    /// Indices of its surfaces.
    surfaces: Vec<usize>,
    /// Which connected mesh it belongs to.
    mesh: usize,
    /// Power over π.
    weight: f64,
    is_sphere: bool,
}

/// An edge of an instance's mesh, by the bits of its end points; sides that emit differently do not join.
type Edge = (u32, bool, [[u32; 3]; 2]);

/// Groups surfaces, in the order of their first member.
fn emitters(surfaces: &[EmissiveSurface]) -> Vec<PlanarEmitter> {
    // Two partitions of the surfaces: by connection alone, and by connection within a plane.
    let mut connected = Partition::new(surfaces.len());
    let mut coplanar = Partition::new(surfaces.len());
    let mut edges: HashMap<Edge, Vec<usize>> = HashMap::new();
    for (i, surface) in surfaces.iter().enumerate() {
        let EmissiveShape::Triangle(p) = surface.shape else { continue };
        // Adding zero makes the two zeros one.
        let bits = p.map(|p| p.to_array().map(|x| (x + 0.0).to_bits()));
        for k in 0..3 {
            let (a, b) = (bits[k], bits[(k + 1) % 3]);
            let key = (surface.instance.0, surface.two_sided, if a < b { [a, b] } else { [b, a] });
            let sharing = edges.entry(key).or_default();
            for &j in sharing.iter() {
                connected.join(i, j);
                if are_coplanar(&surfaces[j], surface) {
                    coplanar.join(i, j);
                }
            }
            // An edge of more than a few faces is no honest mesh; joining each to the first ones connects them all the same.
            if sharing.len() < 4 {
                sharing.push(i);
            }
        }
    }
    let mut emitters: Vec<PlanarEmitter> = Vec::new();
    let (mut emitter_of, mut mesh_of) = (HashMap::new(), HashMap::new());
    for (i, surface) in surfaces.iter().enumerate() {
        let n_meshes = mesh_of.len();
        let mesh = *mesh_of.entry(connected.root(i)).or_insert(n_meshes);
        let at = *emitter_of.entry(coplanar.root(i)).or_insert(emitters.len());
        if at == emitters.len() {
            let is_sphere = matches!(surface.shape, EmissiveShape::Sphere(_));
            emitters.push(PlanarEmitter { surfaces: Vec::new(), mesh, weight: 0.0, is_sphere });
        }
        emitters[at].surfaces.push(i);
        let sides = if surface.two_sided { 2.0 } else { 1.0 };
        emitters[at].weight += surface.shape.area() * f64::from(surface.radiance.luminance()) * sides;
    }
    emitters
}

fn are_coplanar(a: &EmissiveSurface, b: &EmissiveSurface) -> bool {
    let normal = |s: &EmissiveSurface| match s.shape {
        EmissiveShape::Triangle(p) => triangle_vector(p).try_normalize(),
        _ => None,
    };
    matches!((normal(a), normal(b)), (Some(a), Some(b)) if 1.0 - a.dot(b) < COPLANAR)
}

/// Twice the area along the front normal.
fn triangle_vector(p: [Vec3; 3]) -> DVec3 {
    let [a, b, c] = p.map(|p| p.as_dvec3());
    (b - a).cross(c - a)
}

/// Union–find over indices; the root is always the smallest member.
struct Partition(Vec<usize>);

impl Partition {
    fn new(n: usize) -> Self {
        Self((0..n).collect())
    }

    fn root(&mut self, mut i: usize) -> usize {
        while self.0[i] != i {
            self.0[i] = self.0[self.0[i]];
            i = self.0[i];
        }
        i
    }

    fn join(&mut self, i: usize, j: usize) {
        let (i, j) = (self.root(i), self.root(j));
        self.0[i.max(j)] = i.min(j);
    }
}

/// Lowers `sides` of the emitters named until their points number at most `budget`, in proportion to power; each keeps at least one.
fn allot(emitters: &[PlanarEmitter], which: &[usize], sides: &mut [u32], budget: usize) {
    let total = |sides: &dyn Fn(usize) -> u32| which.iter().map(|&i| emitters[i].count(sides(i))).sum::<usize>();
    if total(&|i| sides[i]) <= budget {
        return;
    }
    let weight: f64 = which.iter().map(|&i| emitters[i].weight).sum();
    let side = |i: usize, scale: f64| {
        let share = if weight > 0.0 { emitters[i].weight / weight } else { 0.0 };
        ((scale * share).sqrt() as u32).clamp(1, sides[i])
    };
    // The largest scale that obeys the budget, to a thousandth.
    let (mut lo, mut hi) = (0.0, 4.0 * budget as f64 + 4.0);
    for _ in 0..10 {
        let mid = 0.5 * (lo + hi);
        if total(&|i| side(i, mid)) <= budget { lo = mid } else { hi = mid }
    }
    let chosen: Vec<u32> = which.iter().map(|&i| side(i, lo)).collect();
    for (&i, side) in which.iter().zip(chosen) {
        sides[i] = side;
    }
}

impl EmissiveShape {
    /// The box around it.
    pub fn bounds(&self) -> Bounds {
        // A sphere's image reaches as far along each axis as the length of that row of the map; a disc lacks the middle column.
        let around = |m: &Affine3A, columns: [Vec3A; 3]| {
            let reach = columns.iter().fold(Vec3A::ZERO, |sum, c| sum + *c * *c).to_array().map(f32::sqrt);
            let (centre, reach) = (Vec3::from(m.translation), Vec3::from_array(reach));
            Bounds::of([centre - reach, centre + reach])
        };
        match self {
            Self::Triangle(p) => Bounds::of(*p),
            Self::Sphere(m) => around(m, [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis]),
            Self::Disc(m) => around(m, [m.matrix3.x_axis, Vec3A::ZERO, m.matrix3.z_axis]),
        }
    }

    /// The front, as long as the area; zero for spheres, whose fronts are everywhere.
    pub fn area_vector(&self) -> Vec3 {
        match self {
            Self::Triangle(p) => (triangle_vector(*p) * 0.5).as_vec3(),
            Self::Sphere(_) => Vec3::ZERO,
            Self::Disc(m) => (normal_map(m) * DVec3::Y * std::f64::consts::PI).as_vec3(),
        }
    }

    /// The unit normal of the front at a point of it.
    pub(crate) fn normal_at(&self, p: Vec3) -> Vec3 {
        match self {
            Self::Triangle(corners) => triangle_vector(*corners).normalize_or_zero().as_vec3(),
            Self::Disc(m) => normal_map(m).mul_vec3(DVec3::Y).normalize_or_zero().as_vec3(),
            Self::Sphere(m) => {
                let local = m.inverse().transform_point3(p);
                normal_map(m).mul_vec3(local.as_dvec3()).normalize_or_zero().as_vec3()
            }
        }
    }

    /// m².
    pub fn area(&self) -> f64 {
        match self {
            Self::Triangle(p) => 0.5 * triangle_vector(*p).length(),
            Self::Disc(m) => std::f64::consts::PI * normal_map(m).mul_vec3(DVec3::Y).length(),
            Self::Sphere(m) => {
                let map = normal_map(m);
                sphere_cells(16).map(|cell| cell.area(&map)).sum()
            }
        }
    }
}

/// Carries normals, their length growing as areas do; the front stays the front under mirrors.
pub(super) fn normal_map(m: &Affine3A) -> DMat3 {
    let m = DMat3::from_cols(m.matrix3.x_axis.as_dvec3(), m.matrix3.y_axis.as_dvec3(), m.matrix3.z_axis.as_dvec3());
    let cofactor = DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis));
    if m.determinant() < 0.0 { cofactor * -1.0 } else { cofactor }
}

impl PlanarEmitter {
    /// How many points `side` makes, at most.
    fn count(&self, side: u32) -> usize {
        let square = side as usize * side as usize;
        if self.is_sphere { 2 * square } else { square }
    }

    fn sample(&self, surfaces: &[EmissiveSurface], n: u32, out: &mut Vec<PointSample>) {
        let surface = &surfaces[self.surfaces[0]];
        let mut push = |position: DVec3, normal: DVec3, area: f64| {
            out.extend(normal.try_normalize().map(|normal| PointSample {
                position: position.as_vec3(),
                normal: normal.as_vec3(),
                radiance: surface.radiance,
                area: area as f32,
                two_sided: surface.two_sided,
            }));
        };
        match &surface.shape {
            EmissiveShape::Triangle(_) => sample_polygon(surfaces, &self.surfaces, n, out),
            EmissiveShape::Sphere(m) => {
                let map = normal_map(m);
                for cell in sphere_cells(n) {
                    let direction = cell.middle();
                    let position = m.transform_point3(direction.as_vec3()).as_dvec3();
                    push(position, map * direction, cell.area(&map));
                }
            }
            EmissiveShape::Disc(m) => {
                let normal = normal_map(m) * DVec3::Y;
                let cells = f64::from(n);
                let half_angle = std::f64::consts::PI / cells;
                // The centroid of an annular sector lies on its bisector.
                let chord = if n == 1 { 0.0 } else { function::sin_f64(half_angle) / half_angle };
                for i in 0..n {
                    let (inner, outer) = ((f64::from(i) / cells).sqrt(), (f64::from(i + 1) / cells).sqrt());
                    let radius = 2.0 / 3.0 * (outer.powi(3) - inner.powi(3)) * cells * chord;
                    for j in 0..n {
                        let phi = (2.0 * f64::from(j) + 1.0) * half_angle;
                        let local = DVec3::new(radius * function::cos_f64(phi), 0.0, radius * function::sin_f64(phi));
                        let area = std::f64::consts::PI * normal.length() / (cells * cells);
                        push(m.transform_point3(local.as_vec3()).as_dvec3(), normal, area);
                    }
                }
            }
        }
    }
}

/// A cell of the unit sphere between two heights and two longitudes.
struct SphereCell {
    z: (f64, f64),
    phi: (f64, f64),
}

/// `n × 2n` cells of equal area.
fn sphere_cells(n: u32) -> impl Iterator<Item = SphereCell> {
    let step = |i: u32, n: u32, size: f64| (size * f64::from(i) / f64::from(n), size * f64::from(i + 1) / f64::from(n));
    (0..n).flat_map(move |i| {
        let (a, b) = step(i, n, 2.0);
        (0..2 * n).map(move |j| SphereCell { z: (a - 1.0, b - 1.0), phi: step(j, 2 * n, std::f64::consts::TAU) })
    })
}

impl SphereCell {
    fn direction(&self, s: f64, t: f64) -> DVec3 {
        let z = self.z.0 + s * (self.z.1 - self.z.0);
        let phi = self.phi.0 + t * (self.phi.1 - self.phi.0);
        let r = (1.0 - z * z).max(0.0).sqrt();
        DVec3::new(r * function::cos_f64(phi), z, r * function::sin_f64(phi))
    }

    fn middle(&self) -> DVec3 {
        self.direction(0.5, 0.5)
    }

    /// Of its image under a map with these normals; exact when that is a sphere, by quadrature for ellipsoids.
    fn area(&self, map: &DMat3) -> f64 {
        const SIDE: u32 = 8;
        let solid_angle = (self.z.1 - self.z.0) * (self.phi.1 - self.phi.0);
        let at = |i: u32| (f64::from(i) + 0.5) / f64::from(SIDE);
        let lengths = (0..SIDE * SIDE).map(|k| (*map * self.direction(at(k / SIDE), at(k % SIDE))).length());
        solid_angle * lengths.sum::<f64>() / f64::from(SIDE * SIDE)
    }
}

/// Cuts coplanar triangles by an n×n grid and makes each cell that holds some of them one point.
fn sample_polygon(surfaces: &[EmissiveSurface], which: &[usize], n: u32, out: &mut Vec<PointSample>) {
    let triangle = |i: usize| match surfaces[i].shape {
        EmissiveShape::Triangle(p) => p.map(|p| p.as_dvec3()),
        _ => unreachable!("exact shapes are emitters of their own"),
    };
    let normal: DVec3 = which.iter().map(|&i| triangle(i)).map(|[a, b, c]| (b - a).cross(c - a)).sum();
    let Some(normal) = normal.try_normalize() else { return };

    // Coordinates along two edges of the first triangle: the sides of a parallelogram are then lines of the grid. Its longest edge is
    // left out, since in a quad that is the diagonal.
    let corners = triangle(which[0]);
    let length2 = |k: usize| corners[k].distance_squared(corners[(k + 1) % 3]);
    let longest = (0..3).fold(0, |best, k| if length2(k) > length2(best) { k } else { best });
    let origin = corners[(longest + 2) % 3];
    let (e1, e2) = (corners[longest] - origin, corners[(longest + 1) % 3] - origin);
    // Dual basis within the plane: f1·e1 = 1, f1·e2 = 0.
    let (f1, f2) = (e2.cross(normal), normal.cross(e1));
    let (d1, d2) = (f1.dot(e1), f2.dot(e2));
    if d1 == 0.0 || d2 == 0.0 {
        return;
    }
    let to_plane = |p: DVec3| DVec2::new((p - origin).dot(f1) / d1, (p - origin).dot(f2) / d2);
    let cell_area = e1.cross(e2).length();

    let flat: Vec<[DVec2; 3]> = which.iter().map(|&i| triangle(i).map(to_plane)).collect();
    let (mut lo, mut hi) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for p in flat.iter().flatten() {
        (lo, hi) = (lo.min(*p), hi.max(*p));
    }
    let step = (hi - lo) / f64::from(n);

    // Area, first moment and power of each cell.
    let mut cells = vec![(0.0, DVec2::ZERO, DVec3::ZERO); (n * n) as usize];
    let index = |x: f64, lo: f64, step: f64| ((x - lo) / step).clamp(0.0, f64::from(n - 1)) as u32;
    for (triangle, &i) in flat.iter().zip(which) {
        let radiance = DVec3::from_array(surfaces[i].radiance.to_array().map(f64::from));
        let (a, b) = triangle.iter().fold((triangle[0], triangle[0]), |(a, b), p| (a.min(*p), b.max(*p)));
        for y in index(a.y, lo.y, step.y)..=index(b.y, lo.y, step.y) {
            for x in index(a.x, lo.x, step.x)..=index(b.x, lo.x, step.x) {
                // Outer cells reach past the rim, so that rounding there loses nothing.
                let from = |k: u32, lo: f64, step: f64| if k == 0 { f64::NEG_INFINITY } else { lo + f64::from(k) * step };
                let to = |k: u32, lo: f64, step: f64| if k + 1 == n { f64::INFINITY } else { lo + f64::from(k + 1) * step };
                let mut polygon = triangle.to_vec();
                clip(&mut polygon, |p| p.x - from(x, lo.x, step.x));
                clip(&mut polygon, |p| to(x, lo.x, step.x) - p.x);
                clip(&mut polygon, |p| p.y - from(y, lo.y, step.y));
                clip(&mut polygon, |p| to(y, lo.y, step.y) - p.y);
                let cell = &mut cells[(y * n + x) as usize];
                for k in 1..polygon.len().max(1) - 1 {
                    let (p, q, r) = (polygon[0], polygon[k], polygon[k + 1]);
                    let area = 0.5 * (q - p).perp_dot(r - p).abs() * cell_area;
                    cell.0 += area;
                    cell.1 += (p + q + r) * (area / 3.0);
                    cell.2 += radiance * area;
                }
            }
        }
    }
    for (area, moment, power) in cells {
        // Slivers that rounding leaves in neighbouring cells are not worth a shadow ray, and weigh nothing.
        if area <= 1e-12 * cell_area {
            continue;
        }
        let at = moment / area;
        let radiance = (power / area).to_array().map(|l| l as f32);
        out.push(PointSample {
            position: (origin + e1 * at.x + e2 * at.y).as_vec3(),
            normal: normal.as_vec3(),
            radiance: radiance.into(),
            area: area as f32,
            two_sided: surfaces[which[0]].two_sided,
        });
    }
}

/// Keeps the part of a convex polygon where `inside` (linear) is not negative. An infinite bound cuts nothing.
fn clip(polygon: &mut Vec<DVec2>, inside: impl Fn(DVec2) -> f64) {
    if polygon.iter().all(|&p| inside(p) >= 0.0) {
        return;
    }
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (k, &p) in polygon.iter().enumerate() {
        let q = polygon[(k + 1) % polygon.len()];
        let (a, b) = (inside(p), inside(q));
        if a >= 0.0 {
            kept.push(p);
        }
        if (a >= 0.0) != (b >= 0.0) {
            kept.push(p + (q - p) * (a / (a - b)));
        }
    }
    *polygon = kept;
}

/// Joins neighbouring points of similar normal until at most `budget` are left. A joined point stands on one of its members, so that the surface
/// it belongs to does not hide it, and has their total area and power.
fn merge(samples: Vec<PointSample>, budget: usize) -> Vec<PointSample> {
    let budget = budget.max(2);
    if samples.len() <= budget {
        return samples;
    }
    let bounds = crate::math::Bounds::of(samples.iter().map(|s| s.position));
    let scale = bounds.extent().max(Vec3::splat(f32::MIN_POSITIVE));
    // Near each other in space, facing the same octant: the order of the buckets, then of a space-filling curve.
    let octant = |n: Vec3| n.to_array().iter().fold(0, |key, x| 2 * key + u8::from(*x < 0.0));
    let place = |p: Vec3| morton(((p - bounds.min) / scale * 1023.0).as_uvec3().to_array());
    let few = budget < 32;
    let bucket = |s: &PointSample| (s.two_sided, if few { 0 } else { octant(s.normal) });
    let mut keyed: Vec<_> = samples.into_iter().map(|s| (bucket(&s), place(s.position), s)).collect();
    keyed.sort_by_key(|(bucket, place, _)| (*bucket, *place));

    // Runs of equal power within each bucket; one run is reserved for each so that none can exceed the budget.
    let n_buckets = 1 + keyed.windows(2).filter(|w| w[0].0 != w[1].0).count();
    let total: f64 = keyed.iter().map(|k| k.2.weight()).sum();
    let quantum = total / (budget - n_buckets).max(1) as f64;
    let mut merged = Vec::with_capacity(budget);
    let (mut start, mut weight) = (0, 0.0);
    for i in 0..keyed.len() {
        weight += keyed[i].2.weight();
        let ends_bucket = keyed.get(i + 1).is_none_or(|next| next.0 != keyed[i].0);
        let full = weight >= quantum && merged.len() + n_buckets < budget;
        if ends_bucket || full {
            merged.extend(joined(keyed[start..=i].iter().map(|k| &k.2)));
            (start, weight) = (i + 1, 0.0);
        }
    }
    merged
}

fn joined<'a>(run: impl Iterator<Item = &'a PointSample> + Clone) -> Option<PointSample> {
    let (mut area, mut power, mut normal, mut centre) = (0.0, DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
    for s in run.clone() {
        let a = f64::from(s.area);
        area += a;
        power += DVec3::from_array(s.radiance.to_array().map(f64::from)) * a;
        normal += s.normal.as_dvec3() * a;
        centre += s.position.as_dvec3() * a;
    }
    let centre = (centre / area).as_vec3();
    let distance = |s: &PointSample| s.position.distance_squared(centre);
    let nearest = run.min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
    Some(PointSample {
        normal: normal.try_normalize().map_or(nearest.normal, |n| n.as_vec3()),
        radiance: (power / area).to_array().map(|l| l as f32).into(),
        area: area as f32,
        ..*nearest
    })
}

/// Ten bits of each coordinate, interleaved.
fn morton(p: [u32; 3]) -> u32 {
    (0..10).fold(0, |key, bit| (0..3).fold(key, |key, axis| key | ((p[axis] >> bit) & 1) << (3 * bit + axis)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle(p: [[f32; 3]; 3], primitive: u32) -> EmissiveSurface {
        EmissiveSurface {
            shape: EmissiveShape::Triangle(p.map(Vec3::from)),
            radiance: Spectrum::WHITE,
            two_sided: false,
            instance: InstanceId(0),
            primitive,
        }
    }

    fn quad() -> [EmissiveSurface; 2] {
        // A skewed parallelogram 4 m² facing down.
        let (a, b, c, d) = ([0.0, 2.0, 0.0], [2.0, 2.0, 0.0], [2.5, 2.0, 2.0], [0.5, 2.0, 2.0]);
        [triangle([a, b, c], 0), triangle([a, c, d], 1)]
    }

    fn total_area(points: &PointSamples) -> f64 {
        points.samples.iter().map(|s| f64::from(s.area)).sum()
    }

    #[test]
    fn a_parallelogram_becomes_a_regular_grid() {
        let points = sample_points(&quad(), 5, 100);
        assert_eq!((points.len(), points.n_wanted), (25, None));
        for s in &points.samples {
            assert!((s.area - 4.0 / 25.0).abs() < 1e-6, "{}", s.area);
            assert!((s.normal - Vec3::NEG_Y).length() < 1e-6);
            // Grid coordinates are half integers.
            let (v, u) = (s.position.z / 2.0, (s.position.x - s.position.z / 4.0) / 2.0);
            for x in [u, v] {
                assert!(((x * 5.0).fract() - 0.5).abs() < 1e-5, "{x}");
            }
        }
    }

    /// A tessellated sphere of radius 1.
    fn ball(n: u32) -> Vec<EmissiveSurface> {
        let point = |i: u32, j: u32| {
            let (theta, phi) = (
                std::f64::consts::PI * f64::from(i) / f64::from(n),
                std::f64::consts::PI * f64::from(j % (2 * n)) / f64::from(n),
            );
            [(theta.sin() * phi.cos()) as f32, theta.cos() as f32, (theta.sin() * phi.sin()) as f32]
        };
        let mut out = Vec::new();
        for i in 0..n {
            for j in 0..2 * n {
                let (a, b, c, d) = (point(i, j), point(i, j + 1), point(i + 1, j + 1), point(i + 1, j));
                if i > 0 {
                    out.push(triangle([a, b, c], 0));
                }
                if i + 1 < n {
                    out.push(triangle([a, c, d], 0));
                }
            }
        }
        out
    }

    #[test]
    fn areas_add_up_however_points_are_limited() {
        let mut surfaces = ball(24);
        let exact: f64 = surfaces.iter().map(|s| s.shape.area()).sum();
        for max in [2, 3, 17, 40, 200, 100_000] {
            let points = sample_points(&surfaces, 4, max);
            assert!(points.len() <= max as usize && points.len() <= 6 * 16, "{} of {max}", points.len());
            assert!((total_area(&points) / exact - 1.0).abs() < 1e-6, "{max}");
        }
        surfaces.extend(quad().map(|s| EmissiveSurface { instance: InstanceId(1), two_sided: true, ..s }));
        let points = sample_points(&surfaces, 4, 8);
        assert!(points.len() <= 8 && (total_area(&points) / (exact + 4.0) - 1.0).abs() < 1e-6);
        let sides: f64 = points.samples.iter().filter(|s| s.two_sided).map(|s| f64::from(s.area)).sum();
        assert!((sides - 4.0).abs() < 1e-5);
    }

    #[test]
    fn any_triangles_keep_their_area_within_the_limit() {
        use crate::sampling::Stream;
        for seed in 0..300 {
            let mut stream = Stream::new(seed, 0, 0);
            // Few distinct coordinates, so that triangles collapse, coincide, share edges with many others and lie in one plane.
            let mut corner = || {
                let mut x = || (stream.next_u32() % 3) as f32;
                [x(), x(), if seed % 3 == 0 { 0.0 } else { x() }]
            };
            let surfaces: Vec<_> = (0..30).map(|i| triangle([corner(), corner(), corner()], i)).collect();
            let exact: f64 = surfaces.iter().map(|s| s.shape.area()).sum();
            for (n, max) in [(1, 2), (3, 20), (4, 1000)] {
                let points = sample_points(&surfaces, n, max);
                assert!(points.len() <= max as usize, "{seed}: {} of {max}", points.len());
                assert!(points.samples.iter().all(|s| s.position.is_finite() && s.normal.is_normalized()), "{seed}");
                assert!((total_area(&points) / exact - 1.0).abs() < 1e-5, "{seed}: {} of {exact}", total_area(&points));
            }
        }
    }

    #[test]
    fn a_polygon_with_a_hole_keeps_its_area_and_its_centre() {
        // A square ring of width 1 around a 1 m² hole, as eight triangles between two squares.
        let outer = [[0.0, 0.0], [3.0, 0.0], [3.0, 3.0], [0.0, 3.0]];
        let inner = [[1.0, 1.0], [2.0, 1.0], [2.0, 2.0], [1.0, 2.0]];
        let at = |p: [f32; 2]| [p[0], p[1], 0.0];
        let ring: Vec<_> = (0..4)
            .flat_map(|k| {
                let (a, b, c, d) = (at(outer[k]), at(outer[(k + 1) % 4]), at(inner[(k + 1) % 4]), at(inner[k]));
                [triangle([a, b, c], 0), triangle([a, c, d], 0)]
            })
            .collect();
        let points = sample_points(&ring, 6, 1000);
        assert!((total_area(&points) - 8.0).abs() < 1e-5);
        let centre: DVec3 = points.samples.iter().map(|s| s.position.as_dvec3() * f64::from(s.area)).sum::<DVec3>() / 8.0;
        assert!((centre - DVec3::new(1.5, 1.5, 0.0)).length() < 1e-5, "{centre}");
    }

    #[test]
    fn the_irradiance_of_quad_disc_and_sphere_converges_to_the_closed_form() {
        let at = |shape, n, p: Vec3, normal: Vec3| {
            let surface = EmissiveSurface { shape, ..triangle([[0.0; 3]; 3], 0) };
            let points = sample_points(&[surface], n, 1 << 20);
            points
                .samples
                .iter()
                .filter_map(|s| s.incident(p))
                .map(|i| f64::from(i.diffuse.r * normal.dot(i.wi).max(0.0)))
                .sum::<f64>()
        };
        let pi = std::f64::consts::PI;
        let place = |scale: Vec3, t: Vec3| Affine3A::from_mat3_translation(crate::math::Mat3::from_diagonal(scale), t);
        // A disc of radius 1 facing down, 2 above: π L r²/(r² + d²). The mirrored scale must not turn its front.
        let disc = |n| at(EmissiveShape::Disc(place(Vec3::ONE, Vec3::ZERO)), n, Vec3::Y * 2.0, Vec3::NEG_Y);
        // A sphere of radius 1 at distance 3, from outside: π L (r/d)².
        let sphere = |n| at(EmissiveShape::Sphere(place(Vec3::ONE, Vec3::ZERO)), n, Vec3::X * 3.0, Vec3::NEG_X);
        for (value, exact) in [(&disc as &dyn Fn(u32) -> f64, pi / 5.0), (&sphere, pi / 9.0)] {
            let (coarse, fine) = ((value(6) / exact - 1.0).abs(), (value(48) / exact - 1.0).abs());
            assert!(coarse < 0.03 && fine < 5e-4, "{coarse} {fine}");
        }
        let ellipsoid = EmissiveShape::Sphere(place(Vec3::new(1.0, 1.0, -2.0), Vec3::ZERO));
        // Prolate: 2π a² (1 + c/(a e) asin e), e² = 3/4.
        let e = 0.75f64.sqrt();
        assert!((ellipsoid.area() / (2.0 * pi * (1.0 + 2.0 / e * e.asin())) - 1.0).abs() < 1e-4);
    }
}
