//! Form factors against closed forms (`form-factors.json`).

use radiosa::math::polygon::area_vector;
use radiosa::math::{CpuPath, DAffine3, DVec3, Ray};
use radiosa::radiosity::form_factor::{Estimator, Factors, Row, Scratch, analytic, area, hemicube, hemisphere, occluded};
use radiosa::radiosity::mesh::{self, ElementMesh, Sides};
use radiosa::scene::{Geometry, Instance, Mesh, MeshId, Scene};
use radiosa::transport::World;
use radiosa_testkit::form_factor as closed;
use serde_json::Value;

fn configurations() -> Vec<Value> {
    let text = std::fs::read_to_string(radiosa_testkit::data_dir().join("form-factors.json")).expect("it is in the testkit");
    let mut data: Value = serde_json::from_str(&text).expect("it is JSON");
    std::mem::take(data["configurations"].as_array_mut().expect("a list"))
}

fn vector(v: &Value) -> DVec3 {
    DVec3::from_array(std::array::from_fn(|i| v[i].as_f64().expect("a number")))
}

fn polygon(v: &Value) -> Vec<DVec3> {
    v["vertices"].as_array().expect("corners").iter().map(vector).collect()
}

fn of_kind<'a>(all: &'a [Value], kind: &str) -> Vec<&'a Value> {
    all.iter().filter(|c| c["kind"] == kind).collect()
}

/// Everything between two polygons that see each other in full.
fn polygon_errors(factor: impl Fn(&[DVec3], &[DVec3]) -> f64) -> Vec<(String, f64)> {
    let all = configurations();
    let mut errors = Vec::new();
    for c in of_kind(&all, "polygon-polygon") {
        let (a, b) = (polygon(&c["surface1"]), polygon(&c["surface2"]));
        for (from, to, truth) in [(&a, &b, &c["F12"]), (&b, &a, &c["F21"])] {
            let f = factor(from, to);
            errors.push((c["id"].to_string(), (f - truth.as_f64().expect("a number")).abs()));
        }
    }
    for c in of_kind(&all, "enclosure-matrix") {
        let faces: Vec<Vec<DVec3>> = c["faces"].as_array().expect("faces").iter().map(polygon).collect();
        for (i, a) in faces.iter().enumerate() {
            for (j, b) in faces.iter().enumerate().filter(|&(j, _)| j != i) {
                let f = factor(a, b);
                errors.push((format!("{} {i}{j}", c["id"]), (f - c["F"][i][j].as_f64().expect("a number")).abs()));
            }
        }
    }
    errors
}

fn worst(errors: &[(String, f64)]) -> (&str, f64) {
    let worst = errors.iter().max_by(|a, b| a.1.total_cmp(&b.1)).expect("there are some");
    (&worst.0, worst.1)
}

#[test]
fn polygons_exchange_what_their_closed_forms_say() {
    for (tolerance, bound) in [(1e-6, 1e-6), (1e-10, 1e-9)] {
        let errors = polygon_errors(|a, b| analytic::exchange_area(a, b, tolerance) / area_vector(a).length());
        let (id, error) = worst(&errors);
        println!("tolerance {tolerance:e}: {} factors, worst {error:.1e} ({id})", errors.len());
        assert!(error <= bound, "{id} is off by {error:e} at tolerance {tolerance:e}");
    }
    // The twin: without 1/2 of the 1/(2π).
    let errors = polygon_errors(|a, b| 2.0 * analytic::exchange_area(a, b, 1e-6) / area_vector(a).length());
    assert!(worst(&errors).1 > 0.1);
}

#[test]
fn points_see_the_fraction_their_closed_forms_say() {
    let all = configurations();
    let mut scratch = Vec::new();
    let mut worst: f64 = 0.0;
    for c in of_kind(&all, "element-polygon") {
        let (p, n) = (vector(&c["surface1"]["point"]), vector(&c["surface1"]["normal"]));
        let f = analytic::point_to_polygon(p, n, &polygon(&c["surface2"]), &mut scratch);
        let error = (f - c["F12"].as_f64().expect("a number")).abs();
        assert!(error < 1e-14, "{}: {f}, off by {error:e}", c["id"]);
        worst = worst.max(error);
    }
    println!("worst {worst:.1e}");
    // The twin: without 1/π.
    let twin = of_kind(&all, "element-polygon").into_iter().map(|c| {
        let (p, n) = (vector(&c["surface1"]["point"]), vector(&c["surface1"]["normal"]));
        std::f64::consts::PI * analytic::point_to_polygon(p, n, &polygon(&c["surface2"]), &mut scratch) - number(&c["F12"])
    });
    assert!(twin.fold(0.0, |worst: f64, off| worst.max(off.abs())) > 0.1);
}

#[test]
fn every_entry_of_the_reference_is_of_a_kind_that_is_tested() {
    // By test: polygons_exchange…, points_see…, closed_forms… and tessellated…, polygons_with_something_between_them….
    let tested = [
        ("polygon-polygon", 42),
        ("enclosure-matrix", 3),
        ("element-polygon", 8),
        ("disc-disc", 7),
        ("element-disc", 6),
        ("element-sphere", 5),
        ("sphere-disc", 2),
        ("sphere-rectangle", 2),
        ("sphere-sphere", 1),
        ("polygon-polygon-occluded", 12),
    ];
    let all = configurations();
    for (kind, n) in tested {
        assert_eq!(of_kind(&all, kind).len(), n, "{kind}");
    }
    assert_eq!(all.len(), tested.iter().map(|(_, n)| n).sum::<usize>());
}

fn number(v: &Value) -> f64 {
    v.as_f64().expect("a number")
}

/// A regular polygon of `n` corners inscribed in a disc.
fn disc(v: &Value, n: usize) -> Vec<DVec3> {
    let (centre, normal, radius) = (vector(&v["center"]), vector(&v["normal"]).normalize(), number(&v["radius"]));
    let s = normal.any_orthonormal_vector();
    let t = normal.cross(s);
    let at = |i: usize| (i as f64 + 0.3) * 2.0 * std::f64::consts::PI / n as f64;
    (0..n).map(|i| centre + (s * at(i).cos() + t * at(i).sin()) * radius).collect()
}

/// Facets of a sphere, `n` rings of `2 n`.
fn sphere(v: &Value, n: usize) -> Vec<Vec<DVec3>> {
    let (centre, radius) = (vector(&v["center"]), number(&v["radius"]));
    let at = |i: usize, j: usize| {
        let (theta, phi) = (i as f64 * std::f64::consts::PI / n as f64, (j as f64 + 0.3) * std::f64::consts::PI / n as f64);
        centre + DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()) * radius
    };
    let facet = |i: usize, j: usize| match i {
        0 => vec![at(0, 0), at(1, j), at(1, j + 1)],
        _ if i == n - 1 => vec![at(i, j), at(n, 0), at(i, j + 1)],
        _ => vec![at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)],
    };
    (0..n).flat_map(|i| (0..2 * n).map(move |j| facet(i, j))).collect()
}

/// The polygons that stand for a surface at a fineness.
fn tessellated(v: &Value, n: usize) -> Vec<Vec<DVec3>> {
    match v["type"].as_str().expect("a type") {
        "disc" => vec![disc(v, n)],
        "sphere" => sphere(v, n / 2),
        _ => vec![polygon(v)],
    }
}

#[test]
fn closed_forms_of_discs_and_spheres_agree_with_the_reference() {
    let all = configurations();
    let mut checked = 0;
    let mut check = |id: &Value, truth: &Value, f: f64| {
        assert!((f - number(truth)).abs() < 1e-13, "{id}: {f} is not {truth}");
        checked += 1;
    };
    let axial = |c: &Value| vector(&c["surface2"]["center"]);
    for c in &all {
        let (a, b, id, truth) = (&c["surface1"], &c["surface2"], &c["id"], &c["F12"]);
        match c["kind"].as_str().expect("a kind") {
            "disc-disc" if axial(c).truncate().length() == 0.0 => {
                check(id, truth, closed::coaxial_discs(number(&a["radius"]), number(&b["radius"]), axial(c).z));
            }
            "element-disc" => {
                let (to, r) = (axial(c), number(&b["radius"]));
                let parallel = vector(&a["normal"]).z.abs() > 0.5;
                let f = if parallel { closed::element_to_parallel_disc } else { closed::element_to_perpendicular_disc };
                check(id, truth, f(r, to.z, to.x));
            }
            "element-sphere" => {
                let to = axial(c);
                let theta = to.cross(vector(&a["normal"])).length().atan2(to.dot(vector(&a["normal"])));
                check(id, truth, closed::element_to_sphere(number(&b["radius"]), to.length(), theta));
            }
            "sphere-disc" => check(id, truth, closed::sphere_to_disc(number(&b["radius"]), axial(c).z)),
            "sphere-rectangle" => {
                let p = polygon(b);
                let (low, high) = p.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(*p), h.max(*p)));
                check(id, truth, closed::sphere_to_rectangle(high.x - low.x, high.y - low.y, low.z));
            }
            _ => {}
        }
    }
    assert_eq!(checked, 5 + 6 + 5 + 2 + 2);
    assert!((closed::opposed_rectangles(1.0, 1.0, 1.0) - 0.199_824_895_698_387_38).abs() < 1e-14);
}

#[test]
fn tessellated_discs_and_spheres_converge_at_second_order() {
    let all = configurations();
    let factor = |c: &Value, n: usize| {
        let (a, b) = (&c["surface1"], &c["surface2"]);
        let to = tessellated(b, n);
        if a["type"] == "element" {
            let (p, normal, mut scratch) = (vector(&a["point"]), vector(&a["normal"]), Vec::new());
            return to.iter().map(|q| analytic::point_to_polygon(p, normal, q, &mut scratch)).sum::<f64>();
        }
        let from = tessellated(a, n);
        let area: f64 = from.iter().map(|p| area_vector(p).length()).sum();
        from.iter().flat_map(|p| to.iter().map(|q| analytic::exchange_area(p, q, 1e-7))).sum::<f64>() / area
    };
    let kinds = ["disc-disc", "element-disc", "element-sphere", "sphere-disc", "sphere-rectangle", "sphere-sphere"];
    for c in all.iter().filter(|c| kinds.contains(&c["kind"].as_str().expect("a kind"))) {
        let sizes = match c["kind"].as_str().expect("a kind") {
            "sphere-sphere" => [8, 16],
            "element-sphere" => [16, 256],
            _ => [16, 64],
        };
        let [coarse, fine] = sizes.map(|n| (factor(c, n) / number(&c["F12"]) - 1.0).abs());
        let order = (coarse / fine).ln() / (sizes[1] as f64 / sizes[0] as f64).ln();
        println!("{:8} relative error {coarse:.1e} {fine:.1e}, order {order:.2}", c["id"]);
        // The outline of a sphere of facets comes closer unevenly.
        assert!(order > if c["kind"] == "element-sphere" { 1.6 } else { 1.9 }, "{}: order {order}", c["id"]);
        // The twin: twice as much, as without 1/2.
        let twin = sizes.map(|n| (2.0 * factor(c, n) / number(&c["F12"]) - 1.0).abs());
        assert!((twin[0] / twin[1]).ln() / (sizes[1] as f64 / sizes[0] as f64).ln() < 1.0, "{}", c["id"]);
    }
}

/// Everything between two polygons with something between them.
fn occluded_errors(factor: impl Fn(&[DVec3], &[DVec3], &[&[DVec3]]) -> f64) -> Vec<(String, f64)> {
    let all = configurations();
    let mut errors = Vec::new();
    for c in of_kind(&all, "polygon-polygon-occluded") {
        let (a, b) = (polygon(&c["surface1"]), polygon(&c["surface2"]));
        let between: Vec<Vec<DVec3>> = c["occluders"].as_array().expect("a list").iter().map(polygon).collect();
        let between: Vec<&[DVec3]> = between.iter().map(Vec::as_slice).collect();
        for (from, to, truth) in [(&a, &b, &c["F12"]), (&b, &a, &c["F21"])] {
            errors.push((c["id"].to_string(), (factor(from, to, &between) - number(truth)).abs()));
        }
    }
    errors
}

#[test]
fn polygons_with_something_between_them_exchange_what_the_reference_says() {
    for (tolerance, bound) in [(1e-4, 1e-4), (1e-5, 1e-5)] {
        let start = std::time::Instant::now();
        let mut scratch = occluded::Scratch::default();
        let scratch = std::cell::RefCell::new(&mut scratch);
        let errors = occluded_errors(|a, b, between| {
            let estimate = occluded::exchange_area(a, b, between, tolerance, &mut scratch.borrow_mut());
            estimate.value / area_vector(a).length()
        });
        let (id, error) = worst(&errors);
        println!("tolerance {tolerance:e}: worst {error:.1e} ({id}), {:?} for {}", start.elapsed(), errors.len());
        assert!(error <= bound, "{id} is off by {error:e} at tolerance {tolerance:e}");
    }
    // The twin: nothing between them.
    let errors = occluded_errors(|a, b, _| analytic::exchange_area(a, b, 1e-6) / area_vector(a).length());
    assert!(errors.iter().all(|(_, error)| *error > 1e-3), "{errors:?}");
}

/// A world of one-sided polygons, each an instance of its own.
fn world_of(polygons: &[Vec<DVec3>]) -> World {
    let objects: Vec<_> = polygons.iter().map(|polygon| vec![polygon.clone()]).collect();
    World::prepare(scene_of(&objects), CpuPath::detect()).expect("the scene is valid")
}

/// Objects of polygons.
fn scene_of(objects: &[Vec<Vec<DVec3>>]) -> Scene {
    let mut scene = Scene::new("polygons");
    for polygons in objects {
        let mut mesh = Mesh::default();
        for polygon in polygons {
            let first = mesh.positions.len() as u32;
            mesh.positions.extend(polygon);
            mesh.triangles.extend((2..polygon.len() as u32).map(|i| [first, first + i - 1, first + i]));
        }
        scene.instances.push(Instance {
            name: String::new(),
            geometry: Geometry::Mesh(MeshId(scene.meshes.len() as u32)),
            transform: DAffine3::IDENTITY,
            material: None,
            node: None,
        });
        scene.meshes.push(mesh);
    }
    scene
}

/// One element a polygon, seen from the front alone.
fn whole(world: &World) -> ElementMesh {
    let settings = mesh::Settings { sides: Sides::Front, size: Some(f64::INFINITY), ..mesh::Settings::default() };
    ElementMesh::new(world, &settings, &radiosa::radiosity::direct::DirectLight::new(world, &[], 0))
}

/// Factors of one row by any estimator.
fn row(world: &World, mesh: &ElementMesh, estimator: &Estimator, seed: u64, i: u32) -> Row {
    let mut row = Row::default();
    Factors::new(world, mesh, estimator, seed).row(i, &mut row, &mut Scratch::default());
    row
}

fn entry(row: &Row, j: u32) -> f64 {
    row.entries.iter().find(|e| e.0 == j).map_or(0.0, |e| e.1)
}

/// A room of the reference: the six faces of a box, and the factors between them.
fn room(id: &str) -> (World, Value) {
    let all = configurations();
    let c = all.iter().find(|c| c["id"] == id).expect("it is there").clone();
    let faces: Vec<Vec<DVec3>> = c["faces"].as_array().expect("faces").iter().map(polygon).collect();
    (world_of(&faces), c["F"].clone())
}

/// The largest error of the first row.
fn row_error(row: &Row, truth: &Value) -> f64 {
    let n = truth.as_array().expect("rows").len();
    (0..n).map(|j| (entry(row, j as u32) - number(&truth[0][j])).abs()).fold(0.0, f64::max)
}

fn rays(rule: hemisphere::Rule, rays: u32, points: u32) -> Estimator {
    Estimator::Hemisphere(hemisphere::Settings { rule, rays, points })
}

#[test]
fn hemicubes_and_hemispheres_averaged_over_source_points_converge_to_the_truth() {
    let (world, truth) = room("BOX-01");
    let mesh = whole(&world);
    let points = [1, 4, 16, 64, 256];
    let cube = |resolution| move |points| Estimator::Hemicube(hemicube::Settings { resolution, points });
    let sphere = |rule, directions| move |points| rays(rule, directions * points, points);
    println!("largest error of a row of the unit box; source points: {points:?}");
    // From one point the error is that of its place, whatever the resolution: 0.04 here. From many it is gone, and rows sum to one.
    let converges = |name: &str, estimator: &dyn Fn(u32) -> Estimator| {
        let rows = points.map(|n| row(&world, &mesh, &estimator(n), 1, 0));
        let errors = rows.each_ref().map(|row| row_error(row, &truth));
        let sum: f64 = rows[4].entries.iter().map(|e| e.1).sum();
        println!("{name:16} {}   row sum {sum:.6}", errors.map(|e| format!("{e:9.1e}")).join(" "));
        errors[0] > 0.03 && errors[4] < 1e-3 && (sum - 1.0).abs() < 1e-6
    };
    for resolution in [16, 64] {
        converges(&format!("hemicube {resolution}"), &cube(resolution));
    }
    assert!(converges("hemicube 128", &cube(128)));
    for (name, rule) in [("cells", hemisphere::Rule::Cells), ("Nusselt", hemisphere::Rule::Nusselt)] {
        for directions in [256, 1024] {
            converges(&format!("{name} {directions}"), &sphere(rule, directions));
        }
        assert!(converges(&format!("{name} 4096"), &sphere(rule, 4096)));
    }
    // The twin: nodes whose weights do not sum to one.
    assert!(!converges("nodal 4096", &sphere(hemisphere::Rule::Nodal, 4096)));
}

/// Slope of the logarithm of the root mean square error over the logarithm of the number of samples.
fn rate(sizes: [u32; 2], estimate: impl Fn(u32, u64) -> f64, truth: f64) -> f64 {
    let rms = |n: u32| {
        let squares: f64 = (0..48).map(|seed| (estimate(n, seed) - truth).powi(2)).sum();
        (squares / 48.0).sqrt()
    };
    (rms(sizes[1]) / rms(sizes[0])).ln() / (f64::from(sizes[1]) / f64::from(sizes[0])).ln()
}

#[test]
fn sampled_factors_converge_at_their_rates() {
    let (world, truth) = room("BOX-01");
    let mesh = whole(&world);
    let opposite = (0..6).find(|&j| (number(&truth[0][j]) - 0.199_824_9).abs() < 1e-6).expect("one face is opposite") as u32;
    let whole_truth = number(&truth[0][opposite as usize]);
    let [from, to] = [0, opposite].map(|i| mesh.elements()[i as usize]);
    let of_centre = analytic::point_to_polygon(from.centre(), from.normal, to.corners(), &mut Vec::new());
    let of = |truth: f64, estimator: &dyn Fn(u32) -> Estimator| {
        rate([64, 4096], |n, seed| entry(&row(&world, &mesh, &estimator(n), seed, 0), opposite), truth)
    };
    let sampled = |spread| move |samples| Estimator::Area(area::Settings { samples, spread, kernel: area::Kernel::Point });
    // What is seen or not is a step, of which even points in d dimensions find the size at n^(−(d + 1)/2d): −3/4 from one point, −5/8 from all of a face.
    let slopes = [
        ("hemisphere, random", of(whole_truth, &|n| rays(hemisphere::Rule::Random, n, n)), -0.6..=-0.4),
        ("hemisphere, low discrepancy", of(whole_truth, &|n| rays(hemisphere::Rule::Nusselt, n, n)), -1.0..=-0.58),
        ("the same from one point", of(of_centre, &|n| rays(hemisphere::Rule::Nusselt, n, 1)), -1.0..=-0.7),
        ("area, random", of(whole_truth, &sampled(area::Samples::Random)), -0.6..=-0.4),
        ("area, low discrepancy", of(whole_truth, &sampled(area::Samples::Even)), -2.0..=-0.7),
    ];
    for (name, slope, expected) in slopes {
        println!("{name:28} {slope:.2}");
        assert!(expected.contains(&slope), "{name}: {slope}");
    }
    // The twin: samples without 1/π approach something else, and their error does not fall.
    let without_pi =
        |n, seed| std::f64::consts::PI * entry(&row(&world, &mesh, &sampled(area::Samples::Random)(n), seed, 0), opposite);
    assert!(rate([64, 4096], without_pi, whole_truth) > -0.1);
}

/// A pair of polygons and what stands between them, as a world: its first two elements are the pair.
fn occluded_world(c: &Value) -> World {
    let between = c["occluders"].as_array().expect("a list").iter().map(polygon);
    world_of(&[polygon(&c["surface1"]), polygon(&c["surface2"])].into_iter().chain(between).collect::<Vec<_>>())
}

#[test]
fn the_visible_fraction_must_be_weighted_by_the_kernel() {
    use radiosa::radiosity::form_factor::pair;
    let all = configurations();
    let (mut cut, mut sampled, mut weighted, mut plain): (f64, f64, f64, f64) = Default::default();
    for c in of_kind(&all, "polygon-polygon-occluded") {
        let (world, truth) = (occluded_world(c), number(&c["F12"]));
        let mesh = whole(&world);
        let analytic = |clip| Estimator::Analytic(pair::Settings { tolerance: 1e-7, rays: [64, 64], clip });
        let f = |estimator: &Estimator| entry(&row(&world, &mesh, estimator, 0, 0), 1);
        cut = cut.max((f(&analytic(Some(1e-5))) - truth).abs());
        sampled = sampled.max((f(&analytic(None)) - truth).abs());
        // Many lines between the two: each weighted by the kernel, and the twin, each counted alike.
        let [a, b] = [0, 1].map(|i| mesh.elements()[i]);
        let mut sums = [0.0; 4];
        for k in 0..1 << 15 {
            let [u, v] = radiosa::sampling::sequence::point_4d(k, 5).map(|u| [f64::from(u.x), f64::from(u.y)]);
            let (p, q) = (a.at(u) + a.normal * 1e-5, b.at(v) + b.normal * 1e-5);
            let d = q - p;
            let kernel = (a.normal.dot(d) * -b.normal.dot(d)).max(0.0) / d.length_squared().powi(2);
            let blocked = world.accel().occluded(&Ray { origin: p.as_vec3(), dir: d.as_vec3(), t_max: 1.0 });
            let v = if blocked { 0.0 } else { 1.0 };
            sums.iter_mut().zip([v * kernel, kernel, v, 1.0]).for_each(|(sum, term)| *sum += term);
        }
        let free = analytic::exchange_area(a.corners(), b.corners(), 1e-7) / a.area;
        weighted = weighted.max((free * sums[0] / sums[1] - truth).abs());
        plain = plain.max((free * sums[2] / sums[3] - truth).abs());
    }
    println!(
        "worst of the occluded pairs: cut out {cut:.1e}, 64 weighted rays {sampled:.1e}, 32768 {weighted:.1e}, unweighted {plain:.1e}"
    );
    assert!(cut < 1e-4, "{cut}");
    assert!(sampled < 2e-2 && weighted < 2e-3, "{sampled} {weighted}");
    assert!(plain > 2e-2, "{plain}");
}

#[test]
fn a_matrix_can_be_made_reciprocal_and_closed() {
    use radiosa::radiosity::between::{Between, Correction};
    let (world, truth) = room("BOX-01");
    let mesh = whole(&world);
    let of = |correction: Option<Correction>| {
        let factors = Factors::new(&world, &mesh, &rays(hemisphere::Rule::Random, 2000, 2000), 3);
        let mut between = Between::new(&factors, &[0, 1, 2, 3, 4, 5], 6);
        correction.into_iter().for_each(|correction| between.correct(correction));
        let error = between.row(0).iter().map(|e| (e.exchange - number(&truth[0][e.to as usize])).abs()).fold(0.0, f64::max);
        (between.report(), error)
    };
    let (raw, error) = of(None);
    assert!(raw.reciprocity > 1e-3, "{raw:?}");
    let (reciprocal, _) = of(Some(Correction::Reciprocity));
    assert!(reciprocal.reciprocity < 1e-15, "{reciprocal:?}");
    let (closed, corrected_error) = of(Some(Correction::Closure));
    assert!(closed.reciprocity < 1e-12, "{closed:?}");
    assert!(closed.row_sums.iter().all(|sum| (sum - 1.0).abs() < 1e-9), "{closed:?}");
    println!("error {error:.1e} before, {corrected_error:.1e} after");
    assert!(corrected_error < 1.5 * error);
}

/// `n × n` rooms of 4 × 3 × 4 m seen from inside, with doors between neighbours through walls of 0.2 m: floors of `cells × cells` faces, `cells` a multiple
/// of 12.
fn building(n: u32, cells: u32) -> Vec<Vec<DVec3>> {
    let (h, high) = (4.0 / f64::from(cells), 3 * cells / 4);
    let is_door = |i: u32, y: u32| (5 * cells / 12..7 * cells / 12).contains(&i) && y < cells / 2;
    let mut faces = Vec::new();
    let mut quad = |origin: DVec3, u: DVec3, v: DVec3| faces.push(vec![origin, origin + u, origin + u + v, origin + v]);
    let (x, y, z) = (DVec3::X * h, DVec3::Y * h, DVec3::Z * h);
    for room in 0..n * n {
        let (column, row) = (room % n, room / n);
        let corner = DVec3::new(f64::from(column), 0.0, f64::from(row)) * 4.2;
        for k in 0..cells * cells {
            let at = corner + x * f64::from(k % cells) + z * f64::from(k / cells);
            quad(at, z, x);
            quad(at + y * f64::from(high), x, z);
        }
        for k in 0..cells * high {
            let (i, up) = (k % cells, k / cells);
            let (along, up_by) = (f64::from(i), y * f64::from(up));
            let far = f64::from(cells);
            let door = is_door(i, up);
            // Each wall has a door where there is a neighbour.
            if !(door && row > 0) {
                quad(corner + x * along + up_by, x, y);
            }
            if !(door && row + 1 < n) {
                quad(corner + x * along + up_by + z * far, y, x);
            }
            if !(door && column > 0) {
                quad(corner + z * along + up_by, y, z);
            }
            if !(door && column + 1 < n) {
                quad(corner + z * along + up_by + x * far, z, y);
            }
        }
        // The insides of the doors to the next column and the next row.
        let (first, width, height) = (5.0 / 12.0 * 4.0, 2.0 / 12.0 * 4.0, y * f64::from(cells / 2));
        for (there, across, through) in [(column + 1 < n, DVec3::Z, DVec3::X), (row + 1 < n, DVec3::X, DVec3::Z)] {
            if there {
                let (low, across, through) = (corner + through * 4.0 + across * first, across * width, through * 0.2);
                let facing = |u: DVec3, v: DVec3, n: DVec3| if u.cross(v).dot(n) > 0.0 { [u, v] } else { [v, u] };
                for (origin, u, v, normal) in [
                    (low, through, height, across),
                    (low + across, through, height, -across),
                    (low, through, across, height),
                    (low + height, through, across, -height),
                ] {
                    let [u, v] = facing(u, v, normal);
                    quad(origin, u, v);
                }
            }
        }
    }
    faces
}

#[test]
fn rooms_are_told_apart_without_losing_what_doors_let_through() {
    let long = std::env::var_os("RADIOSA_LONG_TESTS").is_some();
    let (faces, n_rows, n_rays) = if long { (building(6, 24), 100, 256) } else { (building(3, 12), 8, 128) };
    let scene = scene_of(&[faces]);
    let world = World::prepare(scene, CpuPath::detect()).expect("the scene is valid");
    let mesh = whole(&world);
    let (n, elements) = (mesh.elements().len(), mesh.elements());
    let start = std::time::Instant::now();
    let factors = Factors::new(&world, &mesh, &Estimator::default(), 0);
    let prepared = start.elapsed();
    if long {
        let matrix = factors.matrix();
        let entries = matrix.n_entries();
        println!("{n} elements, {entries} factors, {:.1} GB, {:.0?}", entries as f64 * 8e-9, start.elapsed());
    }
    let (mut worst, mut through, mut mean): (f64, f64, f64) = Default::default();
    let (mut of_row, mut scratch) = (Row::default(), Scratch::default());
    for k in 0..n_rows {
        let i = (radiosa::sampling::rng::key(&[k]) % n as u64) as u32;
        factors.row(i, &mut of_row, &mut scratch);
        let mut dense = vec![0.0; n];
        of_row.entries.iter().for_each(|&(j, f)| dense[j as usize] = f);
        let a = &elements[i as usize];
        let room = |p: DVec3| [(p.x / 4.2).floor(), (p.z / 4.2).floor()];
        let (mut error, mut elsewhere) = (0.0, 0.0);
        for (j, b) in elements.iter().enumerate().filter(|&(j, _)| j != i as usize) {
            let truth = factor_by_rays(&world, a, b, n_rays) / a.area;
            error += (truth - dense[j]).abs();
            elsewhere += if room(a.centre()) == room(b.centre()) { 0.0 } else { truth };
        }
        (worst, through, mean) = (worst.max(error), through.max(elsewhere), mean + error / n_rows as f64);
    }
    println!(
        "{n} elements, prepared in {prepared:.1?}: Σ |F − F_ref| of {n_rows} rows {worst:.1e} at worst, {mean:.1e} in the mean; up to {through:.2} through doors"
    );
    assert!(through > 0.02, "rows that see nothing of other rooms say nothing: {through}");
    assert!(worst < 1e-2, "{worst}");
}

/// The exchange area of two elements: exact without occluders, times the weighted visible fraction of `n` lines.
fn factor_by_rays(world: &World, a: &mesh::Element, b: &mesh::Element, n: u32) -> f64 {
    let faces = |a: &mesh::Element, b: &mesh::Element| b.corners().iter().any(|p| (*p - a.corners()[0]).dot(a.normal) > 1e-9);
    if !faces(a, b) || !faces(b, a) {
        return 0.0;
    }
    let mut sums = [0.0; 2];
    for k in 0..n {
        let [u, v] = radiosa::sampling::sequence::point_4d(k, 77).map(|u| [f64::from(u.x), f64::from(u.y)]);
        let (p, q) = (a.at(u) + a.normal * 1e-5, b.at(v) + b.normal * 1e-5);
        let d = q - p;
        let kernel = a.normal.dot(d).max(0.0) * (-b.normal.dot(d)).max(0.0) / d.length_squared().powi(2);
        if kernel > 0.0 {
            let blocked = world.accel().occluded(&Ray { origin: p.as_vec3(), dir: d.as_vec3(), t_max: 1.0 });
            sums[0] += if blocked { 0.0 } else { kernel };
            sums[1] += kernel;
        }
        // Most pairs have a wall between them.
        if k == 15 && sums[0] == 0.0 && (a.centre() - b.centre()).length() > 6.0 {
            return 0.0;
        }
    }
    if sums[0] > 0.0 { analytic::exchange_area(a.corners(), b.corners(), 1e-5) * sums[0] / sums[1] } else { 0.0 }
}
