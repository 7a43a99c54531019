//! Radiosity against closed environments and references.

use radiosa::math::{CpuPath, DAffine3, DVec3, Ray, Vec3};
use radiosa::radiosity::{self, gather, mesh};
use radiosa::scene::{Geometry, Instance, Material, MaterialId, Mesh, MeshId, Polygons, Scene};
use radiosa::spectrum::Spectrum;
use radiosa::transport::World;
use serde_json::Value;

#[test]
fn the_cornell_box_has_the_irradiances_of_its_reference() {
    let text =
        std::fs::read_to_string(radiosa_testkit::data_dir().join("cornell-box/reference.json")).expect("it is in the testkit");
    let reference: Value = serde_json::from_str(&text).expect("it is JSON");
    let scene = radiosa::import::sample::load("cornell-box").expect("it is built in");
    let world = World::prepare(scene, CpuPath::detect()).expect("it is valid");
    let start = std::time::Instant::now();
    let settings = radiosity::Settings::default();
    let solution = radiosity::solve(&world, &settings);
    println!(
        "{} elements, {} factors, {} sweeps, {:?}",
        solution.mesh.elements().len(),
        solution.n_factors,
        solution.history.records.len(),
        start.elapsed()
    );
    println!("{:?} error {:e}", solution.balance, solution.balance.error());
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
            let off = (f64::from(value) - truth) / truth;
            sum += off;
            n += 1;
            let excess = (off.abs() - 2.0 * se / truth).max(0.0);
            if excess > worst.0 {
                worst = (excess, format!("{} channel {c}: {value} for {truth}", point["id"]));
            }
        }
    }
    assert!((sum / f64::from(n)).abs() < 0.01, "mean {}", sum / f64::from(n));
    assert!(worst.0 < 0.05, "{} off: {}", worst.0, worst.1);
    println!("mean {:.3} %, worst {:.2} % ({}) in {:?}", 100.0 * sum / f64::from(n), 100.0 * worst.0, worst.1, start.elapsed());
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
