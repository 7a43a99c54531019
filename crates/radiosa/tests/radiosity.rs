//! Radiosity against closed environments and references.

mod common;

use common::scene_of;
use radiosa::math::{CpuPath, DAffine3, DVec3, Ray, Vec3};
use radiosa::radiosity::form_factor::analytic;
use radiosa::radiosity::solve::{Solver as Method, shooting, stochastic};
use radiosa::radiosity::{self, gather, hierarchical, mesh};
use radiosa::scene::{
    AlphaMode, Geometry, Instance, Light, LightKind, Material, MaterialId, Mesh, MeshId, PhotometricUnit, Polygons, Scene,
};
use radiosa::spectrum::Spectrum;
use radiosa::transport::{Surface, World};
use serde_json::Value;

#[test]
fn the_cornell_box_has_the_irradiances_of_its_reference() {
    let text =
        std::fs::read_to_string(radiosa_testkit::data_dir().join("cornell-box/reference.json")).expect("it is in the testkit");
    let reference: Value = serde_json::from_str(&text).expect("it is JSON");
    let scene = || radiosa::import::sample::load("cornell-box").expect("it is built in");
    let start = std::time::Instant::now();
    let (mean, worst) = off_reference(scene(), &radiosity::Settings::default(), &reference);
    println!("mean {:.3} %, worst {:.2} % ({}) in {:?}", 100.0 * mean, 100.0 * worst.0, worst.1, start.elapsed());
    assert!(mean < 0.01, "mean {mean}");
    assert!(worst.0 < 0.05, "{} off: {}", worst.0, worst.1);
    // The twin: reflectances 2 % too large, over elements that would do.
    let mut coarse = radiosity::Settings::default();
    (coarse.mesh.elements, coarse.refine.levels) = (1000, 0);
    let (mean, _) = off_reference(scene(), &coarse, &reference);
    let mut bright = scene();
    for material in &mut bright.materials {
        if let radiosa::scene::Model::Phong(model) = &mut material.model {
            model.diffuse.factor *= 1.02;
        }
    }
    let (of_twin, _) = off_reference(bright, &coarse, &reference);
    assert!(mean < 0.01 && of_twin > 0.01, "mean {mean}, of the twin {of_twin}");
}

/// The mean of the relative errors at the reference's points, all counted positive, and the largest beyond two of its standard errors.
fn off_reference(scene: Scene, settings: &radiosity::Settings, reference: &Value) -> (f64, (f64, String)) {
    let world = World::prepare(scene, CpuPath::detect()).expect("it is valid");
    let solution = radiosity::solve(&world, settings);
    let gather = gather::Gather::new(&world, &solution, &[], 0);
    let mut scratch = gather::Scratch::default();
    let (mut sum, mut n, mut worst) = (0.0, 0, (0.0f64, String::new()));
    for (k, point) in reference["points"].as_array().expect("points").iter().enumerate() {
        let v = |name: &str| Vec3::from_array(std::array::from_fn(|i| point[name][i].as_f64().expect("a number") as f32));
        let (p, normal) = (v("position") * 0.001 - world.origin().as_vec3(), v("normal"));
        let ray = Ray::new(p + normal * 1e-3, -normal);
        let hit = world.accel().closest(&ray).expect("a surface");
        let surface = world.surface(&ray, &hit);
        let e = gather.at(&surface, normal, k as u64, &mut scratch);
        for (c, value) in [e.irradiance.r, e.irradiance.g, e.irradiance.b].into_iter().enumerate() {
            let (truth, se) = (point["E"][c].as_f64().expect("a number"), point["E_stderr"][c].as_f64().expect("a number"));
            let off = (f64::from(value) - truth).abs() / truth;
            sum += off;
            n += 1;
            let excess = (off - 2.0 * se / truth).max(0.0);
            if excess > worst.0 {
                worst = (excess, format!("{} channel {c}: {value} for {truth}", point["id"]));
            }
        }
    }
    (sum / f64::from(n), worst)
}

/// A grey material that emits.
fn furnace(reflectance: f32, emission: f32) -> Material {
    let mut material = Material::lambert("grey", Spectrum::gray(reflectance));
    material.emission.factor = Spectrum::gray(emission / std::f32::consts::PI);
    material
}

/// Adds a mesh of quadrilaterals with a material each.
fn add_quads(scene: &mut Scene, positions: Vec<DVec3>, faces: &[([u32; 4], u32)]) {
    let mut mesh = Mesh { positions, ..Mesh::default() };
    let mut polygons = Polygons { offsets: vec![0], ..Polygons::default() };
    for (f, &(face, material)) in faces.iter().enumerate() {
        polygons.vertices.extend(face);
        polygons.offsets.push(4 * (f as u32 + 1));
        polygons.of_triangle.extend([f as u32; 2]);
        mesh.triangles.extend([[face[0], face[1], face[2]], [face[0], face[2], face[3]]]);
        mesh.materials.extend([Some(MaterialId(material)); 2]);
    }
    mesh.polygons = Some(polygons);
    scene.meshes.push(mesh);
    let geometry = Geometry::Mesh(MeshId(scene.meshes.len() as u32 - 1));
    scene.instances.push(Instance { name: String::new(), geometry, transform: DAffine3::IDENTITY, material: None, node: None });
}

/// The corners of a box, and its faces: those of x, y and z, low before high, looking outwards.
fn corners_of_box(lo: [f64; 3], hi: [f64; 3]) -> Vec<DVec3> {
    (0..8).map(|k| DVec3::from_array(std::array::from_fn(|a| if k >> a & 1 == 1 { hi[a] } else { lo[a] }))).collect()
}
const FACES: [[u32; 4]; 6] = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];

fn inwards(mut face: [u32; 4]) -> [u32; 4] {
    face.reverse();
    face
}

/// A closed room of 2 × 2 × 2 m with a box that stands on its floor, away from the lines of the mesh; the floor reflects everything and emits nothing.
fn room_with_a_box(reflectance: f32, emission: f32) -> Scene {
    let mut scene = Scene::new("box in a box");
    scene.materials = vec![furnace(reflectance, emission), Material::lambert("floor", Spectrum::WHITE)];
    // (The third face is that of y = lo.)
    let room: [_; 6] = std::array::from_fn(|f| (inwards(FACES[f]), u32::from(f == 2)));
    add_quads(&mut scene, corners_of_box([0.0; 3], [2.0; 3]), &room);
    add_quads(&mut scene, corners_of_box([0.33, 0.0, 0.41], [1.03, 0.9, 1.27]), &FACES.map(|face| (face, 0)));
    scene
}

#[test]
fn what_a_box_covers_of_the_floor_does_not_darken_the_rest() {
    // A furnace: E = 1 − ρ, so that B = 1 on everything in the open. Within the box nothing emits: its walls do so on their fronts only, and the floor not at all.
    let world = World::prepare(room_with_a_box(0.5, 0.5), CpuPath::detect()).expect("it is valid");
    // [mean error, worst error, elements partly in the open]
    let of = |cuts_contacts: bool| {
        let mesh = mesh::Settings { elements: 1200, cuts_contacts, ..Default::default() };
        let solution = radiosity::solve(&world, &radiosity::Settings { mesh, ..Default::default() });
        let elements = solution.mesh.elements();
        let crossed = elements.iter().filter(|e| e.exposed() > 0.0 && e.exposed() < 1.0).count();
        let (mut mean, mut area, mut worst) = (0.0, 0.0, 0.0f64);
        // (The bottom of the box lies in the plane of the floor and sees nothing.)
        let counts = |e: &mesh::Element| e.area > 0.0 && !(e.normal.y < -0.5 && e.centre().y < 1.0);
        for (element, b) in elements.iter().zip(&solution.radiosity).filter(|(e, _)| counts(e)) {
            mean += (b[0] - 1.0) * element.area;
            area += element.area;
            worst = worst.max((b[0] - 1.0).abs());
        }
        println!("{} elements, {crossed} crossed, mean {:.2e}, worst {worst:.2e}", elements.len(), mean / area);
        (mean / area, worst, crossed)
    };
    let (mean, worst, crossed) = of(false);
    assert!(crossed > 10, "{crossed} elements are crossed by the lines of contact");
    assert!(mean.abs() < 2e-3 && worst < 0.1, "mean {mean}, worst {worst}");
    let (mean, worst, crossed) = of(true);
    assert!(crossed == 0, "{crossed} elements are crossed by the lines of contact");
    assert!(mean.abs() < 1e-3 && worst < 0.02, "mean {mean}, worst {worst}");
}

/// Two furnaces in one box of 4 × 2 × 2 m, and what divides them: a wall of two centimetres that stands askew, from just the floor to the ceiling or through both.
fn two_furnaces(through: f64) -> (World, [f64; 2]) {
    let (reflectance, emissions) = (0.5, [1.0, 0.05]);
    let mut scene = Scene::new("two furnaces");
    // What both rooms have a part of reflects everything and emits nothing.
    scene.materials = vec![furnace(reflectance, emissions[0]), furnace(reflectance, emissions[1]), furnace(1.0, 0.0)];
    let of_face = |f: usize| if f < 2 { f as u32 } else { 2 };
    let room: [_; 6] = std::array::from_fn(|f| (inwards(FACES[f]), of_face(f)));
    add_quads(&mut scene, corners_of_box([0.0; 3], [4.0, 2.0, 2.0]), &room);
    // (It leans by 0.6 m over 2, and goes on as far outside.)
    let mut wall = corners_of_box([1.7, -through, -through], [1.72, 2.0 + through, 2.0 + through]);
    wall.iter_mut().for_each(|p| p.x += 0.3 * p.z);
    add_quads(&mut scene, wall, &[(FACES[0], 0), (FACES[1], 1)]);
    let truth = emissions.map(|e| f64::from(e) / (1.0 - f64::from(reflectance)));
    (World::prepare(scene, CpuPath::detect()).expect("it is valid"), truth)
}

/// Which room of [`two_furnaces`] a point is in.
fn room_at(p: DVec3) -> Option<usize> {
    let is_inside = p.cmpgt(DVec3::ZERO).all() && p.cmplt(DVec3::new(4.0, 2.0, 2.0)).all();
    let x = p.x - 0.3 * p.z;
    if !is_inside || (1.7..1.72).contains(&x) { None } else { Some(usize::from(x > 1.71)) }
}

#[test]
fn no_light_leaks_under_a_thin_wall_on_a_floor_of_two_rooms() {
    for through in [0.0, 0.1] {
        let (world, truth) = two_furnaces(through);
        // The largest errors in either room: of elements, and of irradiances two centimetres above the floor and from the wall.
        let of = |cuts_contacts: bool| {
            let mesh = mesh::Settings { elements: 1000, cuts_contacts, ..Default::default() };
            let solution = radiosity::solve(&world, &radiosity::Settings { mesh, ..Default::default() });
            let mut errors = [[0.0f64; 2]; 2];
            for (element, b) in solution.mesh.elements().iter().zip(&solution.radiosity).filter(|(e, _)| e.area > 0.0) {
                let Some(room) = room_at(element.centre() + world.origin() + element.normal * 1e-3) else { continue };
                errors[room][0] = errors[room][0].max((b[0] / truth[room] - 1.0).abs());
            }
            let gather = gather::Gather::new(&world, &solution, &[], 0);
            let mut scratch = gather::Scratch::default();
            for k in 0..16u32 {
                let z = 0.2 + 0.1 * f64::from(k);
                let room = k as usize % 2;
                let p = DVec3::new(1.7 + 0.3 * z + [-0.021, 0.041][room], 0.02, z) - world.origin();
                for n in [Vec3::Y, [Vec3::X, Vec3::NEG_X][room], Vec3::NEG_Y] {
                    let surface = radiosa::transport::Surface::in_space(p.as_vec3(), Vec3::splat(1e-6), n);
                    let arriving = gather.at(&surface, n, u64::from(k), &mut scratch);
                    errors[room][1] = errors[room][1].max((f64::from(arriving.irradiance.g) / truth[room] - 1.0).abs());
                }
            }
            println!("through {through}: {} elements, errors {errors:?}", solution.mesh.elements().len());
            errors
        };
        let errors = of(true);
        assert!(errors.as_flattened().iter().all(|e| *e < 1e-3), "{errors:?}");
        // Elements that reach into both rooms light the dark one.
        let leaking = of(false);
        assert!(leaking[1].iter().all(|e| *e > 0.2), "{leaking:?}");
    }
}

#[test]
fn walls_that_go_on_behind_a_ceiling_are_shown_as_bright_as_they_are() {
    // A furnace under a dim one. The walls of both are coplanar and end where the ceiling between them stands, so nothing is cut there.
    let mut scene = Scene::new("one above the other");
    scene.materials = vec![furnace(0.5, 0.5), furnace(0.5, 0.005)];
    let room = |all: &[usize], material: u32| all.iter().map(|&f| (inwards(FACES[f]), material)).collect::<Vec<_>>();
    add_quads(&mut scene, corners_of_box([0.0; 3], [2.0; 3]), &room(&[0, 1, 2, 4, 5], 0));
    add_quads(&mut scene, corners_of_box([0.0, 2.0, 0.0], [2.0, 3.0, 2.0]), &room(&[0, 1, 3, 4, 5], 1));
    add_quads(&mut scene, corners_of_box([0.0, 2.0, 0.0], [2.0, 3.0, 2.0]), &[(FACES[2], 0)]);
    let world = World::prepare(scene, CpuPath::detect()).expect("it is valid");
    let mesh = mesh::Settings { elements: 1000, ..Default::default() };
    let solution = radiosity::solve(&world, &radiosity::Settings { mesh, ..Default::default() });
    let corners = radiosity::display::corner_values(&world, &solution.mesh, &solution.radiosity);
    let mut n = [0; 2];
    for (element, corners) in solution.mesh.elements().iter().zip(&corners).filter(|(e, _)| e.area > 0.0 && e.normal.y == 0.0) {
        let is_above = (element.centre() + world.origin()).y > 2.0;
        n[usize::from(is_above)] += 1;
        for corner in corners {
            // The twin is what a mean over both sides of the ceiling would be: half.
            let off = (corner.g - if is_above { 0.01 } else { 1.0 }).abs();
            assert!(off < 0.01, "{corner:?} at {:?}", element.centre() + world.origin());
        }
    }
    assert!(n[0] > 100 && n[1] > 50, "{n:?}");
}

#[test]
fn elements_cut_along_contact_lines_cover_their_patches_once() {
    for (name, (world, _)) in [("on", two_furnaces(0.0)), ("through", two_furnaces(0.1))] {
        let direct = &radiosa::radiosity::direct::DirectLight::new(&world, &[], 0);
        let settings = mesh::Settings { elements: 300, sides: mesh::Sides::Both, ..Default::default() };
        let mut cut = mesh::ElementMesh::new(&world, &settings, direct);
        let uncut = mesh::Settings { cuts_contacts: false, ..settings };
        assert!(cut.elements().len() > mesh::ElementMesh::new(&world, &uncut, direct).elements().len() + 20);
        for level in 0..3u64 {
            let mut areas = vec![[0.0; 2]; cut.patches().len()];
            for (i, e) in cut.elements().iter().enumerate() {
                assert_eq!(cut.element_on(e.patch, e.side, e.centre()), Some(i as u32), "{name}, level {level}");
                areas[e.patch as usize][e.side as usize] += e.area;
            }
            for (patch, areas) in cut.patches().iter().zip(areas) {
                assert!(areas.iter().all(|a| (a / patch.area() - 1.0).abs() < 1e-12), "{name}, level {level}");
            }
            let marked: Vec<bool> =
                (0..cut.elements().len() as u64).map(|i| radiosa::sampling::rng::key(&[level, i]).is_multiple_of(5)).collect();
            cut = cut.refined(&world, direct, &marked);
        }
    }
}

/// A sun straight above a floor of 1 × 1 m with a wall at x = 0, and a black plate far up that shades the floor up to x = `edge`.
fn shaded_floor([floor, wall]: [f32; 2], edge: f64) -> World {
    let mut scene = Scene::new("shaded floor");
    scene.materials = [floor, wall, 0.0].map(|rho| Material::lambert("grey", Spectrum::gray(rho))).to_vec();
    let v = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
    let quads = [
        ([v(0.0, 0.0, 0.0), v(0.0, 0.0, 1.0), v(1.0, 0.0, 1.0), v(1.0, 0.0, 0.0)], 0),
        ([v(0.0, 0.0, 0.0), v(0.0, 1.0, 0.0), v(0.0, 1.0, 1.0), v(0.0, 0.0, 1.0)], 1),
        ([v(-1.0, 9.0, -1.0), v(edge, 9.0, -1.0), v(edge, 9.0, 2.0), v(-1.0, 9.0, 2.0)], 2),
    ];
    let faces: Vec<_> = quads.iter().enumerate().map(|(k, q)| (std::array::from_fn(|i| (4 * k + i) as u32), q.1)).collect();
    add_quads(&mut scene, quads.iter().flat_map(|q| q.0).collect(), &faces);
    let kind = LightKind::Distant { to_light: DVec3::Y, unit: PhotometricUnit::Physical };
    scene.lights.push(Light::new("sun", Spectrum::WHITE, kind));
    World::prepare(scene, CpuPath::detect()).expect("it is valid")
}

/// What sensors gather in the world of [`shaded_floor`] over elements of `size`: with details, and without.
fn gathered(world: &World, sensors: &[(DVec3, Vec3)], size: f64) -> [Vec<f64>; 2] {
    let mesh = mesh::Settings { size: Some(size), ..Default::default() };
    let solution = radiosity::solve(world, &radiosity::Settings { mesh, ..Default::default() });
    [true, false].map(|has_details| {
        let gather = gather::Gather::new(world, &solution, &[], 0);
        let gather = if has_details { gather.with_details() } else { gather };
        let of = |(k, (p, n)): (usize, &(DVec3, Vec3))| {
            let surface = Surface::in_space((*p - world.origin()).as_vec3(), Vec3::splat(1e-6), *n);
            f64::from(gather.at(&surface, *n, k as u64, &mut gather::Scratch::default()).irradiance.g)
        };
        sensors.iter().enumerate().map(of).collect()
    })
}

#[test]
fn sensors_see_the_edges_of_shadows_within_elements() {
    // The edge halves elements.
    let (rho, edge) = (0.5, 0.25);
    let world = shaded_floor([rho, 0.0], edge);
    let sensors: Vec<_> = (0..8).map(|k| (DVec3::new(0.05 + 0.05 * f64::from(k), 0.1, 0.5), Vec3::NEG_Y)).collect();
    let lit = [[edge, 0.0], [edge, 1.0], [1.0, 1.0], [1.0, 0.0]].map(|[x, z]| DVec3::new(x, 0.0, z));
    let seen = |p: DVec3, n: DVec3| analytic::point_to_polygon(p, n, &lit, &mut Vec::new());
    let off = gathered(&world, &sensors, 0.5).map(|values| {
        let each = sensors.iter().zip(values).map(|((p, _), e)| (e - f64::from(rho) * seen(*p, DVec3::NEG_Y)).abs());
        each.fold(0.0, f64::max) / f64::from(rho)
    });
    println!("looking down: off by {off:?} of what the lit floor sends");
    assert!(off[0] < 0.06, "{off:?}");
    assert!(off[1] > 0.2, "the twin without details: {off:?}");

    // The wall takes its light from the floor alone: sensors that look up at its foot see the shadow there.
    let (rho, edge) = ([0.5, 0.01], 0.3125);
    let world = shaded_floor(rho, edge);
    let lit = [[edge, 0.0], [edge, 1.0], [1.0, 1.0], [1.0, 0.0]].map(|[x, z]| DVec3::new(x, 0.0, z));
    let sensors: Vec<_> = [0.04, 0.08, 0.12].map(|x| (DVec3::new(x, 0.01, 0.5), Vec3::Y)).to_vec();
    let truth = |p: DVec3| {
        const N: u32 = 200;
        // Graded towards the sensor: y = t², where the kernel is large.
        let strips = (0..N * N).map(|k| {
            let [t, z] = [k % N, k / N].map(|i| (f64::from(i) + 0.5) / f64::from(N));
            let q = DVec3::new(0.0, t * t, z);
            let d = q - p;
            let kernel = d.y.max(0.0) * d.x.abs() / (d.length_squared().powi(2) * std::f64::consts::PI);
            let lit = analytic::point_to_polygon(q, DVec3::X, &lit, &mut Vec::new());
            kernel * f64::from(rho[0] * rho[1]) * lit * 2.0 * t / f64::from(N * N)
        });
        strips.sum::<f64>()
    };
    let off = gathered(&world, &sensors, 0.25).map(|values| {
        let each = sensors.iter().zip(values).map(|((p, _), e)| (e / truth(*p) - 1.0).abs());
        each.fold(0.0, f64::max)
    });
    println!("looking up at the wall: off by {off:?}");
    assert!(off[0] < 0.15, "{off:?}");
    assert!(off[1] > 0.3, "the twin without details: {off:?}");
}

/// Covers a part of what lies behind.
fn pane(coverage: f32, reflectance: f32, emission: f32) -> Material {
    let mut material = furnace(reflectance, emission);
    (material.alpha.mode, material.alpha.value.factor) = (AlphaMode::Blend, coverage);
    material.two_sided = true;
    material
}

/// Balances by every kind of solver: absorbed and escaped by what is emitted.
fn balances(scene: &Scene) -> Vec<(radiosity::Solution, [f64; 2])> {
    let world = World::prepare(scene.clone(), CpuPath::detect()).expect("it is valid");
    let rays = stochastic::Settings { rays: 100_000, rounds: 4, ..stochastic::Settings::default() };
    let methods = [
        Method::GaussSeidel,
        Method::Shooting(shooting::Settings::default()),
        Method::Stochastic(rays),
        Method::Hierarchical(hierarchical::Settings::default()),
    ];
    let of = |solver| {
        let mesh = mesh::Settings { size: Some(0.26), ..Default::default() };
        let solution = radiosity::solve(&world, &radiosity::Settings { mesh, solver, ..Default::default() });
        let most = if matches!(solver, Method::Stochastic(_)) { 1e-3 } else { 1e-6 };
        assert!(solution.balance.error() < most, "{:?}", solution.balance);
        let b = solution.balance;
        let parts = [b.absorbed[0] / b.emitted[0], b.escaped[0] / b.emitted[0]];
        println!("absorbed, escaped {parts:?}");
        (solution, parts)
    };
    methods.into_iter().map(of).collect()
}

/// A closed room of 4 × 3 × 7 m of one reflectance with a lamp under its ceiling.
const CLOSED_ROOM: &str = r#"
[material.a]
lambert = 0.8
[material.l]
lambert = 0
emission = 10
[[shape]]
name = "room"
material = "a"
box = { min = [-2, 0, -2], max = [2, 3, 5], inward = true }
[[shape]]
name = "lamp"
material = "l"
quad = [[-0.5, 2.99, -0.5], [0.5, 2.99, -0.5], [0.5, 2.99, 0.5], [-0.5, 2.99, 0.5]]
"#;

#[test]
fn a_sheet_in_the_plane_of_a_floor_or_just_above_changes_nothing() {
    let of = |sheet: Option<f64>, solver| {
        let quad = |y: f64| {
            format!(
                "[[shape]]\nname = \"sheet\"\nmaterial = \"a\"\nquad = [[-1, {y}, 1], [1, {y}, 1], [1, {y}, -1], [-1, {y}, -1]]\n"
            )
        };
        let world = World::prepare(scene_of(&(CLOSED_ROOM.to_owned() + &sheet.map(quad).unwrap_or_default())), CpuPath::detect());
        let mut settings = radiosity::Settings { solver, ..Default::default() };
        (settings.mesh.elements, settings.refine.levels) = (1200, 0);
        let solution = radiosity::solve(&world.expect("it is valid"), &settings);
        let escaped = solution.balance.escaped[0] / solution.balance.emitted[0];
        let walls = solution.mesh.elements().iter().zip(&solution.irradiance).filter(|(e, _)| e.normal.y.abs() < 0.5);
        let (power, area) = walls.fold((0.0, 0.0), |(p, a), (e, h)| (p + e.area * h[0], a + e.area));
        (escaped, power / area, solution.mesh.coincident().len())
    };
    let rays = stochastic::Settings { rays: 200_000, rounds: 4, ..stochastic::Settings::default() };
    for solver in [Method::GaussSeidel, Method::Shooting(shooting::Settings::default()), Method::Stochastic(rays)] {
        let (_, truth, none) = of(None, solver);
        assert_eq!(none, 0);
        for (height, n_coincident) in [(0.0, 1), (1e-5, 0), (1e-3, 0)] {
            let (escaped, mean, n) = of(Some(height), solver);
            println!("{solver:?} {height}: escaped {escaped:.1e}, walls {:.4}", mean / truth);
            assert_eq!(n, n_coincident);
            assert!(escaped.abs() < 3e-3 && (mean / truth - 1.0).abs() < 0.01, "{solver:?} {height}: {escaped} {mean} {truth}");
        }
    }
}

#[test]
fn a_narrow_spot_lights_a_room() {
    for cutoff in [2.0f64, 5.0, 10.0] {
        let room = CLOSED_ROOM.replace("emission = 10", "emission = 0");
        let spot = "[light.s]\nspot = { position = [0.3, 2.8, 0.2], direction = [0, -1, 0], cutoff = CUTOFF }\nunit = \"physical\"\nintensity = 100\n";
        let scene = scene_of(&(room + &spot.replace("CUTOFF", &cutoff.to_string())));
        let world = World::prepare(scene, CpuPath::detect()).expect("it is valid");
        let mut settings = radiosity::Settings::default();
        (settings.mesh.elements, settings.refine.levels) = (1200, 0);
        let solution = radiosity::solve(&world, &settings);
        let truth = 100.0 * std::f64::consts::TAU * (1.0 - cutoff.to_radians().cos());
        let emitted = solution.balance.emitted[0];
        println!("{cutoff}: {emitted} for {truth}");
        assert!((emitted / truth - 1.0).abs() < 0.2, "{cutoff}: {emitted} W instead of {truth} W");
        // All of it is absorbed in the end, by all walls.
        let dark = solution.irradiance.iter().filter(|h| h[0] <= 0.0).count();
        assert_eq!(dark, 0);
    }
}

#[test]
fn what_passes_a_pane_is_not_absorbed_by_it() {
    let unit = |y: f64| [[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]].map(|[x, z]| DVec3::new(x, y, z)).to_vec();
    // A furnace with a pane that covers half of what is behind it, one too: B = 1 on walls, and one half on either side of the pane. Nothing escapes.
    let mut scene = Scene::new("furnace with a pane");
    scene.materials = vec![furnace(0.5, 0.5), pane(0.5, 0.5, 0.5)];
    add_quads(&mut scene, corners_of_box([0.0; 3], [1.0; 3]), &FACES.map(|face| (inwards(face), 0)));
    add_quads(&mut scene, unit(0.5), &[([0, 1, 2, 3], 1)]);
    for (solution, [absorbed, escaped]) in balances(&scene) {
        for (element, b) in solution.mesh.elements().iter().zip(&solution.radiosity) {
            let is_pane = solution.mesh.patches()[element.patch as usize].material == Some(MaterialId(1));
            let truth = if is_pane { 0.5 } else { 1.0 };
            assert!((b[0] - truth).abs() < 0.05, "{b:?}, not {truth}");
        }
        assert!(escaped.abs() < 3e-3 && (absorbed - 1.0).abs() < 3e-3, "absorbed {absorbed}, escaped {escaped}");
        twin(&solution, escaped, 0.25);
    }
    // A black box with a window that takes a quarter: of 5 of 6 sides, which emit one each, the window gets 1.
    let mut scene = Scene::new("window");
    scene.materials = vec![furnace(0.0, 1.0), pane(0.25, 0.0, 0.0)];
    add_quads(
        &mut scene,
        corners_of_box([0.0; 3], [1.0; 3]),
        &std::array::from_fn::<_, 6, _>(|f| (inwards(FACES[f]), u32::from(f == 3))),
    );
    for (solution, [absorbed, escaped]) in balances(&scene) {
        assert!((escaped - 0.15).abs() < 1e-3 && (absorbed - 0.85).abs() < 1e-3, "absorbed {absorbed}, escaped {escaped}");
        twin(&solution, escaped, 0.1);
    }
    // The sun through it: what the window and the floor below absorb, and no more.
    let mut scene = Scene::new("pane in the sun");
    scene.materials = vec![furnace(0.0, 0.0), pane(0.25, 0.0, 0.0)];
    add_quads(&mut scene, unit(0.0), &[([0, 1, 2, 3], 0)]);
    add_quads(&mut scene, unit(0.5), &[([0, 1, 2, 3], 1)]);
    let kind = LightKind::Distant { to_light: DVec3::Y, unit: PhotometricUnit::Physical };
    scene.lights.push(Light::new("sun", Spectrum::WHITE, kind));
    for (solution, [absorbed, escaped]) in balances(&scene) {
        let emitted = solution.balance.emitted[0];
        assert!((emitted - 1.0).abs() < 1e-3 && (absorbed - 1.0).abs() < 1e-3 && escaped.abs() < 1e-3, "{:?}", solution.balance);
    }
}

/// The twin: without transmittances what passed is taken off what escapes.
fn twin(solution: &radiosity::Solution, escaped: f64, least: f64) {
    let radiosity::Solution { sums, irradiance, radiosity, unshot, .. } = solution;
    let system = radiosity::system::System { transmittance: Vec::new(), ..solution.system.clone() };
    let balance = system.balance(sums, irradiance, radiosity, unshot);
    let off = (balance.escaped[0] / balance.emitted[0] - escaped).abs();
    assert!(off > least, "the twin is off by {off}");
}

/// Standard error, rays and mean irradiance of a closed white room with a lamp, by rays.
fn by_rays(world: &World, has_control: bool) -> (f64, f64, radiosity::Solution) {
    let rays = stochastic::Settings { rays: 1 << 16, rounds: 16, has_control };
    let mut settings = radiosity::Settings { solver: Method::Stochastic(rays), ..Default::default() };
    (settings.mesh.elements, settings.stop.error) = (1000, 1.0);
    let solution = radiosity::solve(world, &settings);
    let area = &solution.system.area;
    let all: f64 = solution.irradiance_error.iter().zip(area).map(|(e, a)| a * e[0].powi(2)).sum();
    let (error, n) = ((all / area.iter().sum::<f64>()).sqrt(), solution.history.records.last().expect("a step").n_rays);
    (error, n as f64, solution)
}

#[test]
fn a_constant_taken_from_all_radiosities_saves_rays_in_bright_rooms() {
    let mut scene = room_with_a_box(0.9, 0.0);
    let y = 1.9;
    scene.materials.push(furnace(0.0, 1.0));
    let lamp = [[0.3, y, 0.3], [0.7, y, 0.3], [0.7, y, 0.7], [0.3, y, 0.7]].map(DVec3::from_array).to_vec();
    let material = scene.materials.len() as u32 - 1;
    add_quads(&mut scene, lamp, &[([0, 1, 2, 3], material)]);
    let world = World::prepare(scene, CpuPath::detect()).expect("it is valid");
    let (error, rays, with) = by_rays(&world, true);
    let (plain_error, plain_rays, without) = by_rays(&world, false);
    // Costs that the same error would have.
    let gain = plain_rays * plain_error.powi(2) / (rays * error.powi(2));
    println!("standard error {error:.4} with {rays} rays, {plain_error:.4} with {plain_rays} without: {gain:.1} times as many");
    assert!(gain > 2.0, "{gain}");
    // Both are right, by Gauss–Seidel over the same elements.
    let mut settings = radiosity::Settings { solver: Method::GaussSeidel, ..Default::default() };
    settings.mesh.elements = 1000;
    let truth = radiosity::solve(&world, &settings);
    for (solution, error) in [(with, error), (without, plain_error)] {
        let off: f64 =
            (0..truth.system.n()).map(|i| truth.system.area[i] * (solution.irradiance[i][0] - truth.irradiance[i][0])).sum();
        let off = off / truth.system.area.iter().sum::<f64>();
        assert!(off.abs() < 2.0 * error, "{off} off in the mean, standard error of one {error}");
        assert!(solution.balance.error() < 1e-3, "{:?}", solution.balance);
    }
}

#[test]
fn a_bright_house_on_open_ground_keeps_its_light() {
    // Its floor goes on outside, where no light is, and from where rays leave the scene.
    let mut scene = Scene::new("house");
    scene.materials = vec![furnace(0.9, 0.0), furnace(0.0, 1.0)];
    let house = corners_of_box([-1.0, 0.0, -1.0], [1.0, 2.0, 1.0]);
    add_quads(&mut scene, house, &[0, 1, 3, 4, 5].map(|f| (inwards(FACES[f]), 0)));
    add_quads(&mut scene, corners_of_box([-4.0, -1.0, -4.0], [4.0, 0.0, 4.0]), &[(FACES[3], 0)]);
    let lamp = [[-0.3, 1.9, -0.3], [0.3, 1.9, -0.3], [0.3, 1.9, 0.3], [-0.3, 1.9, 0.3]].map(DVec3::from_array).to_vec();
    add_quads(&mut scene, lamp, &[([0, 1, 2, 3], 1)]);
    let world = World::prepare(scene, CpuPath::detect()).expect("it is valid");
    let (_, _, solution) = by_rays(&world, true);
    let b = solution.balance;
    assert!((b.absorbed[0] / b.emitted[0] - 1.0).abs() < 1e-3 && (b.escaped[0] / b.emitted[0]).abs() < 1e-3, "{b:?}");
    let outside = |p: DVec3| p.x.abs() > 1.01 || p.z.abs() > 1.01;
    let mut n = 0;
    for (element, h) in solution.mesh.elements().iter().zip(&solution.irradiance) {
        if outside(element.centre() + world.origin()) {
            n += 1;
            assert!(h[0] == 0.0, "{h:?} at {:?}", element.centre() + world.origin());
        }
    }
    assert!(n > 0, "nothing outside takes part");
}

#[test]
fn what_is_lit_through_a_pane_alone_is_lit() {
    // A room cut in two by a pane flush with its walls, which takes nothing away: as if it were not there.
    let room = |has_pane: bool| {
        let mut scene = Scene::new("pane");
        scene.materials = vec![furnace(0.5, 0.0), furnace(0.0, 1.0), pane(0.0, 0.0, 0.0)];
        add_quads(&mut scene, corners_of_box([0.0; 3], [4.0, 2.0, 2.0]), &FACES.map(|face| (inwards(face), 0)));
        let lamp = [[0.5, 1.9, 0.5], [1.0, 1.9, 0.5], [1.0, 1.9, 1.5], [0.5, 1.9, 1.5]].map(DVec3::from_array).to_vec();
        add_quads(&mut scene, lamp, &[([0, 1, 2, 3], 1)]);
        if has_pane {
            let across = [[2.0, 0.0, 0.0], [2.0, 2.0, 0.0], [2.0, 2.0, 2.0], [2.0, 0.0, 2.0]].map(DVec3::from_array).to_vec();
            add_quads(&mut scene, across, &[([0, 1, 2, 3], 2)]);
        }
        scene
    };
    // Mean irradiances of the walls in either half.
    let means = |solution: &radiosity::Solution| {
        let mut sums = [[0.0; 2]; 2];
        for (element, h) in solution.mesh.elements().iter().zip(&solution.irradiance) {
            let material = solution.mesh.patches()[element.patch as usize].material;
            if material == Some(MaterialId(0)) {
                let x = element.centre().x
                    + solution.mesh.patches().iter().map(|p| p.corners()[0].x).fold(f64::INFINITY, f64::min).abs();
                let sum = &mut sums[usize::from(x > 2.0)];
                (sum[0], sum[1]) = (sum[0] + element.area * h[0], sum[1] + element.area);
            }
        }
        sums.map(|[h, area]| h / area)
    };
    let truth = means(&balances(&room(false))[0].0);
    for (solution, _) in balances(&room(true)) {
        let found = means(&solution);
        println!("{found:?} with a pane, {truth:?} without");
        assert!((0..2).all(|k| (found[k] / truth[k] - 1.0).abs() < 0.02), "{found:?}, not {truth:?}");
    }
}
