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
    println!("mean {:.3} %, worst {:.2} % ({}) in {:?}", 100.0 * sum / f64::from(n), 100.0 * worst.0, worst.1, start.elapsed());
}
