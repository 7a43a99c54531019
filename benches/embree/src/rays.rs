//! The rays of the benchmark: what pictures and radiosity send through a room.

use glam::{Mat3, Vec3};
use radiosa::accel::{Accel, Shape};
use radiosa::math::Ray;

/// Rays in eights that are as coherent as their kind allows.
pub struct Rays {
    /// From an eye point inside, by tiles of 4 × 2 pixels.
    pub primary: Vec<[Ray; 8]>,
    /// Cosine-distributed from where the rays before hit, twice over.
    pub bounce: Vec<[Ray; 8]>,
    /// Between patches that face each other, 64 a pair.
    pub segments: Vec<[Ray; 64]>,
}

/// Pixels across and down.
const SIZE: usize = 448;
const N_PAIRS: usize = 3000;

/// SplitMix64.
pub struct Random(pub u64);

impl Random {
    pub fn unit(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 40) as f32 / (1u64 << 24) as f32
    }
}

/// Makes all rays for a scene; `eye` looks at `target`, or both are found.
pub fn make(accel: &Accel, view: Option<(Vec3, Vec3)>, reach: f32) -> Rays {
    let mut random = Random(1);
    let (eye, target) = view.unwrap_or_else(|| find_view(accel, &mut random));
    let primary = primary(eye, target);
    let first = bounce(accel, &primary, &mut random);
    let bounce = bounce(accel, &first, &mut random);
    let segments = segments(accel, &mut random, reach);
    Rays { primary, bounce, segments }
}

/// The view, of some, that sees farthest without seeing nothing.
fn find_view(accel: &Accel, random: &mut Random) -> (Vec3, Vec3) {
    let b = accel.bounds();
    let mut best = (-1.0, (b.centre(), b.centre() + Vec3::X));
    for _ in 0..400 {
        let at = |r: &mut Random| b.min + b.extent() * (Vec3::new(r.unit(), r.unit(), r.unit()) * 0.8 + 0.1);
        let (eye, target) = (at(random), at(random));
        let rays = primary_grid(eye, target, 8);
        let (mut n_hits, mut nearest, mut sum) = (0, f32::INFINITY, 0.0);
        for ray in &rays {
            if let Some(hit) = accel.closest(ray) {
                n_hits += 1;
                nearest = nearest.min(hit.t);
                sum += hit.t.sqrt();
            }
        }
        let score = if n_hits * 10 >= rays.len() * 9 && nearest > 0.01 * b.extent().length() { sum } else { 0.0 };
        if score > best.0 {
            best = (score, (eye, target));
        }
    }
    best.1
}

fn frame(eye: Vec3, target: Vec3) -> Mat3 {
    let forward = (target - eye).normalize();
    let right = forward.cross(Vec3::Y).try_normalize().unwrap_or(Vec3::X);
    Mat3::from_cols(right, right.cross(forward), forward)
}

fn pixel(m: &Mat3, eye: Vec3, x: f32, y: f32) -> Ray {
    // 75 degrees across.
    Ray::new(eye, *m * Vec3::new(0.77 * x, 0.77 * y, 1.0).normalize())
}

fn primary_grid(eye: Vec3, target: Vec3, n: usize) -> Vec<Ray> {
    let m = frame(eye, target);
    let at = |i: usize| 2.0 * (i as f32 + 0.5) / n as f32 - 1.0;
    (0..n * n).map(|i| pixel(&m, eye, at(i % n), at(i / n))).collect()
}

fn primary(eye: Vec3, target: Vec3) -> Vec<[Ray; 8]> {
    let m = frame(eye, target);
    let at = |i: usize| 2.0 * (i as f32 + 0.5) / SIZE as f32 - 1.0;
    let tiles = (0..SIZE / 2).flat_map(|y| (0..SIZE / 4).map(move |x| (x, y)));
    tiles.map(|(x, y)| std::array::from_fn(|i| pixel(&m, eye, at(4 * x + i % 4), at(2 * y + i / 4)))).collect()
}

fn corners(accel: &Accel, instance: u32, primitive: u32) -> [Vec3; 3] {
    let g = accel.geometry();
    match &g.shapes[g.placed[instance as usize].shape as usize] {
        Shape::Mesh { positions, triangles } => triangles[primitive as usize].map(|i| positions[i as usize]),
        _ => [Vec3::ZERO; 3],
    }
}

fn bounce(accel: &Accel, rays: &[[Ray; 8]], random: &mut Random) -> Vec<[Ray; 8]> {
    let mut out = Vec::new();
    for ray in rays.iter().flatten() {
        let Some(hit) = accel.closest(ray) else { continue };
        let [a, b, c] = corners(accel, hit.instance, hit.primitive);
        let n = (b - a).cross(c - a).normalize();
        let n = if n.dot(ray.dir) > 0.0 { -n } else { n };
        let p = a + (b - a) * hit.u + (c - a) * hit.v;
        let (phi, r2) = (std::f32::consts::TAU * random.unit(), random.unit());
        let t = n.any_orthonormal_vector();
        let dir = (t * phi.cos() + n.cross(t) * phi.sin()) * r2.sqrt() + n * (1.0 - r2).sqrt();
        out.push(Ray::new(p + n * (1e-5 * (1.0 + p.abs().max_element())), dir));
    }
    out.chunks_exact(8).map(|c| std::array::from_fn(|i| c[i])).collect()
}

/// A piece of a triangle.
struct Patch {
    origin: Vec3,
    edges: [Vec3; 2],
    normal: Vec3,
}

impl Patch {
    fn sample(&self, random: &mut Random) -> Vec3 {
        let (u, v) = (random.unit(), random.unit());
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        self.origin + self.edges[0] * u + self.edges[1] * v
    }
}

fn segments(accel: &Accel, random: &mut Random, reach: f32) -> Vec<[Ray; 64]> {
    let g = accel.geometry();
    let mut areas = Vec::new();
    let mut total = 0.0;
    for (i, placed) in g.placed.iter().enumerate() {
        if let Shape::Mesh { triangles, .. } = &g.shapes[placed.shape as usize] {
            for t in 0..triangles.len() {
                let [a, b, c] = corners(accel, i as u32, t as u32);
                total += f64::from((b - a).cross(c - a).length());
                areas.push((total, i as u32, t as u32));
            }
        }
    }
    // At most a tenth of the reach in size, around a point anywhere on the surfaces.
    let patch = |random: &mut Random| {
        let x = f64::from(random.unit()) * total;
        let (_, i, t) = areas[areas.partition_point(|a| a.0 < x).min(areas.len() - 1)];
        let [a, b, c] = corners(accel, i, t);
        let whole = Patch { origin: a, edges: [b - a, c - a], normal: (b - a).cross(c - a).normalize_or_zero() };
        let size = (b - a).length().max((c - a).length());
        let shrink = (0.1 * reach / size).min(1.0);
        let p = whole.sample(random);
        Patch { origin: a.lerp(p, 1.0 - shrink), edges: whole.edges.map(|e| e * shrink), ..whole }
    };
    let mut out = Vec::new();
    for _ in 0..200 * N_PAIRS {
        if out.len() == N_PAIRS {
            break;
        }
        let (a, b) = (patch(random), patch(random));
        let d = b.origin - a.origin;
        if d.length() < reach && a.normal.dot(d) > 0.0 && b.normal.dot(d) < 0.0 {
            out.push(std::array::from_fn(|_| {
                let (p, q) = (a.sample(random), b.sample(random));
                // A thousandth of the way off both ends.
                Ray { origin: p.lerp(q, 1e-3), dir: q - p, t_max: 0.998 }
            }));
        }
    }
    out
}
