//! Ray queries against brute force in f64: agreement, watertightness, scales, and that nothing makes them panic.
//!
//! `RADIOSA_LONG_TESTS=1 cargo test --release -p radiosa --test ray_queries` fires ten times the rays.
#![allow(clippy::print_stderr, reason = "tests say what they skipped and how much they checked")]

use glam::{Affine3A, DVec3, Quat, Vec3};
use radiosa::accel::{Accel, Geometry, Hit, Occluder, Placed, Shape, brute_force};
use radiosa::math::{CpuPath, Ray};
use rayon::prelude::*;

/// A small generator of its own (SplitMix64), so that the rays are the same for ever.
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// In [0, 1).
    fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1u64 << 24) as f32
    }

    fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }

    /// In [-1, 1)³.
    fn cube(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }

    fn direction(&mut self) -> Vec3 {
        loop {
            let v = self.cube();
            if (0.01..1.0).contains(&v.length_squared()) {
                return v.normalize();
            }
        }
    }
}

/// How many times more rays a long run fires.
fn effort() -> usize {
    if std::env::var_os("RADIOSA_LONG_TESTS").is_some() { 10 } else { 1 }
}

type Mesh = (Vec<Vec3>, Vec<[u32; 3]>);

fn of_mesh((positions, triangles): Mesh) -> Geometry {
    Geometry { shapes: vec![Shape::Mesh { positions, triangles }], placed: vec![Placed { shape: 0, to_world: None }] }
}

fn torus(n: usize) -> Mesh {
    use std::f32::consts::TAU;
    let m = n / 2;
    let point = |i: usize| {
        let (a, b) = ((i / m) as f32 / n as f32 * TAU, (i % m) as f32 / m as f32 * TAU);
        let r = 1.0 + 0.4 * b.cos();
        Vec3::new(r * a.cos(), 0.4 * b.sin(), r * a.sin()) * 0.35
    };
    let at = |i: usize, j: usize| ((i % n) * m + j % m) as u32;
    let triangles = (0..n * m).map(|i| (i / m, i % m)).flat_map(|(i, j)| {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        [[a, b, c], [a, c, d]]
    });
    ((0..n * m).map(point).collect(), triangles.collect())
}

fn cube() -> Mesh {
    let positions = (0..8).map(|i| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32) - 0.5).collect();
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    (positions, faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect())
}

/// A cube with every triangle cut in four some times, vertices moved out to a radius.
fn ball(levels: usize, radius: impl Fn(Vec3) -> f32) -> Mesh {
    let (mut positions, mut triangles) = cube();
    for _ in 0..levels {
        let mut middles = std::collections::BTreeMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                positions.push((positions[a as usize] + positions[b as usize]) * 0.5);
                positions.len() as u32 - 1
            })
        };
        let cut = triangles.iter().flat_map(|&[a, b, c]| {
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        });
        triangles = cut.collect();
    }
    for p in &mut positions {
        *p = p.normalize() * radius(p.normalize());
    }
    (positions, triangles)
}

fn pebble(levels: usize) -> Mesh {
    ball(levels, |p| 0.5 + 0.1 * (5.0 * p.x).sin() * (4.0 * p.y).cos())
}

/// Triangles anywhere, of all sizes and slendernesses.
fn soup(n: usize, seed: u64) -> Mesh {
    let mut r = Random(seed);
    let mut positions = Vec::new();
    for _ in 0..n {
        let centre = r.cube();
        let size = 10f32.powf(-3.0 * r.unit());
        let squash = Vec3::new(1.0, r.unit() * r.unit(), 1.0);
        positions.extend((0..3).map(|_| centre + r.cube() * squash * size));
    }
    (positions, (0..n as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect())
}

/// Everything at once: a merged mesh, instances under uneven, sheared, mirrored and singular transforms, exact shapes.
fn menagerie() -> Geometry {
    let mesh = |(positions, triangles): Mesh| Shape::Mesh { positions, triangles };
    let shapes = vec![mesh(torus(24)), mesh(cube()), mesh(pebble(2)), Shape::Sphere, Shape::Disc];
    let mut r = Random(7);
    let mut placed = vec![Placed { shape: 0, to_world: None }, Placed { shape: 3, to_world: None }];
    for i in 0..60 {
        let scale = Vec3::new(0.1 + r.unit(), 0.1 + r.unit(), if i % 3 == 0 { -0.3 } else { 0.2 }) * 0.6;
        let turn = Quat::from_axis_angle(r.direction(), 6.0 * r.unit());
        let mut m = Affine3A::from_scale_rotation_translation(scale, turn, r.cube() * 3.0);
        m.matrix3.y_axis += m.matrix3.x_axis * r.unit();
        placed.push(Placed { shape: i % 5, to_world: Some(m) });
    }
    for shape in 0..5 {
        placed.push(Placed { shape, to_world: Some(Affine3A::from_scale(Vec3::new(1.0, 0.0, 1.0))) });
        placed.push(Placed { shape, to_world: Some(Affine3A::from_translation(Vec3::NAN)) });
    }
    Geometry { shapes, placed }
}

/// OBJ files of the collection.
fn collected(names: &[&str]) -> Vec<(String, Geometry)> {
    let Some(dir) = radiosa_testkit::shared_dir() else {
        eprintln!("skipped: {} collected meshes, there is no ../shared; procedural ones only", names.len());
        return Vec::new();
    };
    let load = |name: &&str| {
        let options = tobj::LoadOptions { triangulate: true, single_index: true, ..Default::default() };
        let (models, _) = tobj::load_obj(dir.join("scenes").join(name), &options).expect("the collection's file is readable");
        let mut geometry = Geometry::default();
        for (i, m) in models.iter().enumerate() {
            let positions = m.mesh.positions.chunks_exact(3).map(Vec3::from_slice).collect();
            let triangles = m.mesh.indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
            geometry.shapes.push(Shape::Mesh { positions, triangles });
            geometry.placed.push(Placed { shape: i as u32, to_world: None });
        }
        ((*name).to_owned(), geometry)
    };
    names.iter().map(load).collect()
}

fn scenes() -> Vec<(String, Geometry)> {
    let mut thrice = soup(40, 4);
    thrice.1 = thrice.1.repeat(3);
    let mut scenes = vec![
        ("torus".into(), of_mesh(torus(40))),
        ("cube".into(), of_mesh(cube())),
        ("pebble".into(), of_mesh(pebble(3))),
        ("soup".into(), of_mesh(soup(300, 1))),
        ("dense soup".into(), of_mesh(soup(4000, 2))),
        ("one triangle".into(), of_mesh(soup(1, 3))),
        ("each triangle thrice".into(), of_mesh(thrice)),
        ("menagerie".into(), menagerie()),
    ];
    scenes.extend(collected(&[
        "cornell-box-embree/cornell_box.obj",
        "cornell-box-mcguire-cc/cornell_box.obj",
        "cornell-box-mcguire/CornellBox-Original.obj",
        "cornell-box-mcguire/CornellBox-Sphere.obj",
        "cornell-box-mcguire/CornellBox-Water.obj",
        "cornell-box-suzanne/cornellbox_suzanne.obj",
        "dungeon-modules/room.obj",
        "dungeon-modules/crossjunction.obj",
        "dungeon-modules/upcorridor.obj",
        "obj-features/assimp/concave_polygon.obj",
        "obj-features/draco/cube_subd.obj",
        "obj-features/draco/test_sphere.obj",
        "obj-features/draco/test_nm.obj",
        "obj-features/tinyobjloader/map-bump.obj",
        "spot/spot.obj",
        "teapot-materialx/teapot.obj",
        "wicked-cornell/cornellbox.obj",
    ]));
    scenes
}

fn n_primitives(geometry: &Geometry) -> usize {
    let size = |p: &Placed| match geometry.shapes.get(p.shape as usize) {
        Some(Shape::Mesh { triangles, .. }) => triangles.len(),
        _ => 1,
    };
    geometry.placed.iter().map(size).sum()
}

/// Rays through a scene's neighbourhood: from inside and outside its box, some axis-parallel, some short, of any length of direction.
fn random_rays(accel: &Accel, n: usize, seed: u64) -> Vec<Ray> {
    let b = accel.bounds();
    let (centre, half) = (b.centre(), b.extent() * 0.5);
    let mut r = Random(seed);
    let ray = |_| {
        let reach = if r.below(2) == 0 { 1.0 } else { 2.5 };
        let origin = centre + r.cube() * half * reach;
        let mut dir = if r.below(2) == 0 { r.direction() } else { centre + r.cube() * half - origin };
        match r.below(32) {
            0 | 1 => dir[r.below(3)] = 0.0,
            2 => dir = [Vec3::X, -Vec3::Y, Vec3::Z][r.below(3)],
            _ => {}
        }
        dir *= 10f32.powi(r.below(7) as i32 - 3);
        let t_max = if r.below(4) == 0 { half.max_element() * r.unit() / dir.length().max(1e-6) } else { f32::INFINITY };
        Ray { origin, dir, t_max }
    };
    (0..n).map(ray).collect()
}

/// How far off in `t` a correct f32 answer may be: a few roundings of the largest coordinate, over the sine between ray and plane.
fn slack(geometry: &Geometry, accel: &Accel, ray: &Ray, hit: &Hit) -> f32 {
    let b = accel.bounds();
    let reach = (ray.origin - b.centre()).abs().max_element() + b.extent().max_element();
    let placed = &geometry.placed[hit.instance as usize];
    let m = placed.to_world.unwrap_or_default();
    let sine = match &geometry.shapes[placed.shape as usize] {
        Shape::Mesh { positions, triangles } => {
            let [a, b, c] = triangles[hit.primitive as usize].map(|i| m.transform_point3(positions[i as usize]).as_dvec3());
            (b - a).cross(c - a).normalize().dot(ray.dir.as_dvec3().normalize()).abs() as f32
        }
        _ => 1e-3,
    };
    // An instance's ray is rounded once more, in coordinates that the transform stretches.
    let stretch = if placed.to_world.is_some() { 30.0 } else { 1.0 };
    2e-6 * stretch * reach / ray.dir.length() / sine.max(1e-5)
}

/// True when rounding an instance's ray to f32 decides whether it passes the rim of the shape.
fn on_rim(geometry: &Geometry, hit: &Hit) -> bool {
    geometry.placed[hit.instance as usize].to_world.is_some() && hit.u.min(hit.v).min(1.0 - hit.u - hit.v) < 1e-3
}

fn disagreement(name: &str, geometry: &Geometry, accel: &Accel, ray: &Ray) -> Option<String> {
    let (want, have) = (brute_force::closest(geometry, ray), accel.closest(ray));
    let slack = |h: &Hit| slack(geometry, accel, ray, h);
    let agree = match (&want, &have) {
        (None, None) => true,
        // Possibly another primitive at the same distance, as far as f32 can tell.
        (Some(a), Some(b)) => (a.t - b.t).abs() <= slack(a).max(slack(b)) || on_rim(geometry, a) || on_rim(geometry, b),
        // At the very ends of the ray.
        (Some(a), None) | (None, Some(a)) => ray.t_max - a.t <= slack(a) || a.t <= slack(a) || on_rim(geometry, a),
    };
    let any = accel.occluded(ray);
    (!agree || any != have.is_some()).then(|| format!("{name}: want {want:?}, have {have:?}, occluded {any} on {ray:?}"))
}

#[test]
fn agrees_with_brute_force_on_random_rays() {
    let scenes = scenes();
    let (mut fired, mut same, mut hits) = (0, 0, 0);
    for (i, (name, geometry)) in scenes.iter().enumerate() {
        // Small scenes bear more rays.
        let n = (100_000_000 / n_primitives(geometry)).clamp(2_000, 60_000) * effort();
        fired += n;
        let accel = Accel::build(geometry.clone(), CpuPath::detect());
        let rays = random_rays(&accel, n, i as u64);
        let wrong: Vec<String> = rays.par_iter().filter_map(|ray| disagreement(name, geometry, &accel, ray)).collect();
        assert!(wrong.is_empty(), "{} of {n} rays disagree, the first: {}", wrong.len(), wrong[0]);
        // The lenient comparison above must rarely be needed.
        for ray in rays.iter().take(2_000) {
            if let (Some(a), Some(b)) = (brute_force::closest(geometry, ray), accel.closest(ray)) {
                hits += 1;
                let near = |x: f32, y: f32| (x - y).abs() < 1e-3;
                same += usize::from(a.primitive == b.primitive && a.instance == b.instance && near(a.u, b.u) && near(a.v, b.v));
            }
        }
    }
    eprintln!("{fired} rays over {} scenes; ids and weights the same in {same} of {hits} hits", scenes.len());
    assert!(hits > 300 * scenes.len() && same as f64 > 0.995 * hits as f64, "{same} of {hits}");
    assert!(radiosa_testkit::shared_dir().is_none() || (scenes.len() >= 20 && fired >= 1_000_000), "{fired} rays");
}

#[test]
fn no_ray_slips_between_the_triangles_of_a_closed_mesh() {
    let needle = |(p, t): Mesh| (p.iter().map(|p| *p * Vec3::new(1.0, 0.01, 0.03)).collect(), t);
    let meshes = [("cube", cube()), ("torus", torus(16)), ("pebble", pebble(2)), ("needle", needle(ball(1, |_| 0.5)))];
    let shifts = [0.0f32, 10.0, 1e3, 1e4];
    let per_case = 1_200_000 * effort() / (meshes.len() * shifts.len());
    let mut checked = 0;
    let cases = meshes.iter().flat_map(|m| shifts.iter().map(move |s| (m, *s)));
    for (case, ((name, (positions, triangles)), shift)) in cases.enumerate() {
        let offset = Vec3::new(1.0, -0.7, 0.4) * shift;
        // Rounded to f32 here, collapsed triangles dropped.
        let positions: Vec<Vec3> = positions.iter().map(|p| *p + offset).collect();
        let corners = |t: &[u32; 3]| t.map(|i| positions[i as usize].as_dvec3());
        let is_whole = |t: &&[u32; 3]| {
            let [a, b, c] = corners(t);
            (b - a).cross(c - a) != DVec3::ZERO
        };
        let triangles: Vec<[u32; 3]> = triangles.iter().filter(is_whole).copied().collect();
        let reference: Vec<[DVec3; 3]> = triangles.iter().map(corners).collect();
        let geometry = of_mesh((positions.clone(), triangles.clone()));
        let accels = [CpuPath::detect(), CpuPath::Portable].map(|path| Accel::build(geometry.clone(), path));
        let chunks = 64;
        let fire = |chunk: usize| {
            let mut r = Random((case * chunks + chunk) as u64);
            let (mut checked, mut missed) = (0, Vec::new());
            for i in 0..per_case / chunks {
                let t = triangles[r.below(triangles.len())];
                let (a, b) = (positions[t[0] as usize], positions[t[1] as usize]);
                let target = if r.below(2) == 0 { a } else { a.lerp(b, r.unit()) };
                let mut ray = Ray::new(offset + r.cube() * [0.01, 0.6, 3.0][r.below(3)], Vec3::ZERO);
                if r.below(8) == 0 {
                    // Straight at it along an axis.
                    let k = r.below(3);
                    ray.origin = target.with_x(ray.origin.x);
                    ray.origin =
                        [ray.origin, target + (ray.origin - target) * Vec3::Y, target + (ray.origin - target) * Vec3::Z][k];
                }
                ray.dir = target - ray.origin;
                let (o, d) = (ray.origin.as_dvec3(), ray.dir.as_dvec3());
                let hits = |c: &[DVec3; 3]| brute_force::triangle(o, d, *c).is_some_and(|(t, ..)| t as f32 > 0.0);
                if reference.iter().any(hits) {
                    checked += 1;
                    let accel = &accels[i % 2];
                    if accel.closest(&ray).is_none() || !accel.occluded(&ray) {
                        missed.push(ray);
                    }
                }
            }
            (checked, missed)
        };
        let results: Vec<(usize, Vec<Ray>)> = (0..chunks).into_par_iter().map(fire).collect();
        let missed: Vec<&Ray> = results.iter().flat_map(|r| &r.1).collect();
        assert!(missed.is_empty(), "{name} moved by {shift} times its size: {} misses, the first {:?}", missed.len(), missed[0]);
        checked += results.iter().map(|r| r.0).sum::<usize>();
    }
    eprintln!("{checked} rays at edges and vertices");
    assert!(checked >= 1_000_000 * effort(), "{checked} rays at edges and vertices");
}

#[test]
fn a_ray_that_leaves_a_wall_at_a_grazing_angle_does_not_hit_it() {
    // Origins exactly in the wall's plane: `t` is exactly 0, which is excluded.
    let wall = |z: f32| {
        let positions = [(3.6, 0.8), (3.6, 3.1), (0.9, 3.1), (0.9, 0.8)].map(|(x, y)| Vec3::new(x, y, z));
        of_mesh((positions.to_vec(), vec![[0, 1, 2], [0, 2, 3]]))
    };
    let mut r = Random(41);
    for z in [-2.469_248, 0.0, 1e4] {
        let accel = Accel::build(wall(z), CpuPath::detect());
        for _ in 0..20_000 {
            let origin = Vec3::new(0.9 + 2.7 * r.unit(), 0.8 + 2.3 * r.unit(), z);
            let (sin, cos) = (6.3 * r.unit()).sin_cos();
            // Less grazing, f32 may see a hit at a distance within its rounding of 0; who starts rays on surfaces moves them off.
            let slope = 10f32.powf(-7.0 - 9.0 * r.unit());
            let ray = Ray::new(origin, Vec3::new(cos, sin, slope));
            assert_eq!(accel.closest(&ray), None, "{ray:?}");
        }
    }
}

#[test]
fn hits_do_not_depend_on_the_scale_of_the_scene() {
    let (positions, triangles) = torus(40);
    let rays = random_rays(&Accel::build(of_mesh((positions.clone(), triangles.clone())), CpuPath::detect()), 20_000, 5);
    let hits = |scale: f32| -> Vec<Option<(u32, f32)>> {
        let accel = Accel::build(of_mesh((positions.iter().map(|p| *p * scale).collect(), triangles.clone())), CpuPath::detect());
        // Powers of two scale exactly; `t` stays.
        let scaled = rays.iter().map(|r| Ray { origin: r.origin * scale, dir: r.dir * scale, t_max: r.t_max });
        scaled.map(|r| accel.closest(&r).map(|h| (h.primitive, h.t))).collect()
    };
    let want = hits(1.0);
    assert!(want.iter().flatten().count() > 5_000);
    for exponent in [-40, -20, -7, 3, 20, 40] {
        let have = hits(2f32.powi(exponent));
        let different = want.iter().zip(&have).filter(|(a, b)| a != b).count();
        assert_eq!(different, 0, "scaled by 2^{exponent}");
    }
}

#[test]
fn both_processor_paths_give_the_same_hits() {
    for (i, (name, geometry)) in scenes().into_iter().enumerate() {
        let [a, b] = [CpuPath::Avx2, CpuPath::Portable].map(|path| Accel::build(geometry.clone(), path));
        for ray in random_rays(&a, 4_000, 100 + i as u64) {
            assert_eq!(a.closest(&ray), b.closest(&ray), "{name}: {ray:?}");
            assert_eq!(a.occluded(&ray), b.occluded(&ray), "{name}: {ray:?}");
        }
    }
}

#[test]
fn packets_give_the_hits_of_single_rays() {
    for (i, (name, geometry)) in scenes().into_iter().enumerate() {
        for path in [CpuPath::Avx2, CpuPath::Portable] {
            let accel = Accel::build(geometry.clone(), path);
            let mut rays = random_rays(&accel, 1_600, 200 + i as u64);
            let mut r = Random(i as u64);
            // Half of the packets are coherent: a common origin, or nearly, and directions close together.
            for packet in rays.chunks_exact_mut(8).step_by(2) {
                let first = packet[0];
                let spread = first.dir.length() * [0.0, 1e-3, 0.05, 0.3][r.below(4)];
                let moved = accel.bounds().extent() * [0.0, 0.0, 1e-3][r.below(3)];
                for ray in packet {
                    *ray = Ray { origin: first.origin + r.cube() * moved, dir: first.dir + r.cube() * spread, t_max: ray.t_max };
                }
            }
            for packet in rays.as_chunks::<8>().0 {
                let active = r.bits() as u8 | r.bits() as u8;
                let (hits, blocked) = (accel.closest8(packet, active), accel.occluded8(packet, active));
                for (i, ray) in packet.iter().enumerate() {
                    let want = if active >> i & 1 != 0 { accel.closest(ray) } else { None };
                    assert_eq!(hits[i], want, "{name}: ray {i} of {packet:?}");
                    assert_eq!(blocked >> i & 1 != 0, want.is_some(), "{name}: ray {i} of {packet:?}");
                }
            }
        }
    }
}

#[test]
fn pairs_of_patches_see_what_single_rays_see() {
    let (mut n_blocked, mut n_rays) = (0, 0);
    for (i, (name, geometry)) in scenes().into_iter().enumerate() {
        for path in [CpuPath::Avx2, CpuPath::Portable] {
            let accel = Accel::build(geometry.clone(), path);
            let b = accel.bounds();
            let mut r = Random(300 + i as u64);
            let (mut occluder, mut blocked) = (Occluder::default(), vec![true; 3]);
            for pair in 0..120 {
                let place = |r: &mut Random| b.centre() + r.cube() * b.extent() * 0.5;
                let (from, to) = (place(&mut r), place(&mut r));
                let size = b.extent() * [0.0, 0.01, 0.1][r.below(3)];
                let n = [0, 1, 7, 8, 16, 63, 64, 65, 200][pair % 9];
                let rays: Vec<Ray> = (0..n)
                    .map(|_| {
                        let (p, q) = (from + r.cube() * size, to + r.cube() * size);
                        let t_max = if r.below(200) == 0 { f32::INFINITY } else { 1.0 };
                        Ray { origin: p, dir: q - p, t_max }
                    })
                    .collect();
                accel.occluded_between(&rays, &mut occluder, &mut blocked);
                let want: Vec<bool> = rays.iter().map(|ray| accel.occluded(ray)).collect();
                assert_eq!(blocked, want, "{name}: {rays:?}");
                n_blocked += want.iter().filter(|b| **b).count();
                n_rays += n;
            }
        }
    }
    assert!(n_blocked > n_rays / 10 && n_blocked < n_rays * 9 / 10, "{n_blocked} of {n_rays}");
}

#[test]
fn the_tree_does_not_depend_on_the_number_of_threads() {
    // The order in which a filter that refuses everything is asked tells much of the tree.
    let geometry = of_mesh(soup(60_000, 11));
    let visited = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        let accel = pool.install(|| Accel::build(geometry.clone(), CpuPath::detect()));
        let mut order = Vec::new();
        for ray in random_rays(&accel, 20, 12) {
            let refuse = &mut |h: &Hit| {
                order.push((h.primitive, h.t.to_bits()));
                false
            };
            assert_eq!(accel.closest_where(&ray, refuse), None);
        }
        order
    };
    let one = visited(1);
    assert!(one.len() > 20);
    assert!([2, 3, 7].iter().all(|&n| visited(n) == one));
}

#[test]
fn a_filter_sees_through_what_it_refuses() {
    for (name, geometry) in scenes().iter().filter(|(_, g)| n_primitives(g) < 5_000) {
        let accel = Accel::build(geometry.clone(), CpuPath::detect());
        for ray in random_rays(&accel, 500, 21) {
            let mut odd = |h: &Hit| h.primitive % 2 == 1 || h.instance % 2 == 1;
            let want = brute_force::closest_where(geometry, &ray, &mut odd);
            let have = accel.closest_where(&ray, &mut odd);
            let slack = |h: &Hit| slack(geometry, &accel, &ray, h);
            let agree = match (&want, &have) {
                (None, None) => true,
                (Some(a), Some(b)) => (a.t - b.t).abs() <= slack(a).max(slack(b)) || on_rim(geometry, a) || on_rim(geometry, b),
                (Some(a), None) | (None, Some(a)) => ray.t_max - a.t <= slack(a) || a.t <= slack(a) || on_rim(geometry, a),
            };
            assert!(agree, "{name}: {want:?} {have:?} {ray:?}");
            assert_eq!(accel.occluded_where(&ray, &mut odd), have.is_some(), "{name}");
        }
    }
}

#[test]
fn odd_input_is_never_hit_and_never_panics() {
    let (nan, huge) = (Vec3::NAN, Vec3::splat(3e38));
    let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, nan, huge, -huge, Vec3::X * 2.0, Vec3::INFINITY];
    let triangles = vec![[0, 1, 3], [0, 1, 6], [0, 0, 1], [4, 5, 1], [0, 1, 99], [7, 1, 2], [1, 1, 1]];
    let far = Affine3A::from_translation(huge);
    let odd =
        [(0, None), (0, Some(Affine3A::IDENTITY)), (9, None), (1, Some(Affine3A::ZERO)), (1, Some(far * far)), (2, Some(far))];
    let odd = Geometry {
        shapes: vec![Shape::Mesh { positions, triangles }, Shape::Sphere, Shape::Disc],
        placed: odd.iter().map(|&(shape, to_world)| Placed { shape, to_world }).collect(),
    };
    let nothing = [true, true, true, false, false];
    let geometries = [Geometry::default(), odd, of_mesh((vec![], vec![])), menagerie(), of_mesh(cube())];
    let values = [0.0, -0.0, 1.0, f32::NAN, f32::INFINITY, f32::MIN_POSITIVE, 1e-45, 3e38, -1e30, 1e-30, 0.3];
    let mut r = Random(31);
    for (geometry, nothing) in geometries.into_iter().zip(nothing) {
        for path in [CpuPath::Avx2, CpuPath::Portable] {
            let accel = Accel::build(geometry.clone(), path);
            for _ in 0..20_000 {
                let mut any = || Vec3::from([0; 3].map(|_| values[r.below(values.len())]));
                let (origin, dir) = (any(), any());
                let ray = Ray { origin, dir, t_max: values[r.below(values.len())] };
                let hit = accel.closest(&ray);
                let sound = |h: Hit| h.t > 0.0 && h.t < ray.t_max && h.u.is_finite() && h.v.is_finite() && !nothing;
                assert!(hit.is_none_or(sound), "{hit:?} on {ray:?}");
                assert_eq!(accel.occluded(&ray), hit.is_some(), "{ray:?}");
                assert_eq!(accel.closest8(&[ray; 8], 0xFF), [hit; 8], "{ray:?}");
                let mut blocked = Vec::new();
                accel.occluded_between(&[ray; 3], &mut Occluder::default(), &mut blocked);
                assert_eq!(blocked, [hit.is_some(); 3], "{ray:?}");
            }
        }
    }
}
