//! Radiosity against closed environments and references.

use radiosa::math::{CpuPath, Ray, Vec3};
use radiosa::radiosity::{self, gather};
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

/// A closed room of 2 × 2 × 2 m with a box that stands on its floor, away from the lines of the mesh; the floor reflects everything and emits nothing.
fn room_with_a_box(reflectance: f32, emission: f32) -> radiosa::scene::Scene {
    use radiosa::math::{DAffine3, DVec3};
    use radiosa::scene::{Geometry, Instance, Material, MaterialId, Mesh, MeshId, Polygons, Scene};
    use radiosa::spectrum::Spectrum;
    let mut scene = Scene::new("box in a box");
    let mut material = Material::lambert("grey", Spectrum::gray(reflectance));
    material.emission.factor = Spectrum::gray(emission / std::f32::consts::PI);
    scene.materials.push(material);
    scene.materials.push(Material::lambert("floor", Spectrum::WHITE));
    let mut add = |lo: [f64; 3], hi: [f64; 3], inwards: bool| {
        let corner = |k: usize| DVec3::from_array(std::array::from_fn(|a| if k >> a & 1 == 1 { hi[a] } else { lo[a] }));
        let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let mut mesh = Mesh { positions: (0..8).map(corner).collect(), ..Mesh::default() };
        let mut polygons = Polygons { offsets: vec![0], ..Polygons::default() };
        for (f, mut face) in faces.into_iter().enumerate() {
            if inwards {
                face.reverse();
            }
            polygons.vertices.extend(face);
            polygons.offsets.push(4 * (f as u32 + 1));
            polygons.of_triangle.extend([f as u32; 2]);
            mesh.triangles.extend([[face[0], face[1], face[2]], [face[0], face[2], face[3]]]);
        }
        mesh.polygons = Some(polygons);
        // (The third face is that of y = lo.)
        mesh.materials = (0..12).map(|t| Some(MaterialId(u32::from(inwards && t / 2 == 2)))).collect();
        scene.meshes.push(mesh);
        let geometry = Geometry::Mesh(MeshId(scene.meshes.len() as u32 - 1));
        scene.instances.push(Instance {
            name: String::new(),
            geometry,
            transform: DAffine3::IDENTITY,
            material: None,
            node: None,
        });
    };
    add([0.0; 3], [2.0; 3], true);
    add([0.33, 0.0, 0.41], [1.03, 0.9, 1.27], false);
    scene
}

#[test]
fn what_a_box_covers_of_the_floor_does_not_darken_the_rest() {
    // A furnace: E = 1 − ρ, so that B = 1 on everything in the open. Within the box nothing emits: its walls do so on their fronts only, and the floor not at all.
    let world = World::prepare(room_with_a_box(0.5, 0.5), CpuPath::detect()).expect("it is valid");
    let solution = radiosity::solve(
        &world,
        &radiosity::Settings { mesh: radiosity::mesh::Settings { elements: 1200, ..Default::default() }, ..Default::default() },
    );
    let elements = solution.mesh.elements();
    let crossed = elements.iter().filter(|e| e.exposed() > 0.0 && e.exposed() < 1.0).count();
    assert!(crossed > 10, "{crossed} elements are crossed by the lines of contact");
    let (mut mean, mut area, mut worst) = (0.0, 0.0, 0.0f64);
    // (The bottom of the box lies in the plane of the floor and sees nothing.)
    let counts = |e: &radiosity::mesh::Element| e.area > 0.0 && !(e.normal.y < -0.5 && e.centre().y < 1.0);
    for (element, b) in elements.iter().zip(&solution.radiosity).filter(|(e, _)| counts(e)) {
        mean += (b[0] - 1.0) * element.area;
        area += element.area;
        worst = worst.max((b[0] - 1.0).abs());
    }
    println!("{} elements, {crossed} crossed, mean {:.2e}, worst {worst:.2e}", elements.len(), mean / area);
    assert!((mean / area).abs() < 2e-3, "{}", mean / area);
    assert!(worst < 0.1, "{worst}");
}
