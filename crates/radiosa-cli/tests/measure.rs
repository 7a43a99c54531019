//! `radiosa measure`: sensors by every method.

mod common;

use std::path::Path;

use common::{radiosa, text};

/// Two blocks 4 cm apart under a lamp, in a closed room.
const GAP: &str = r#"
[material.white]
lambert = 0.8
[material.lamp]
lambert = 0
emission = 10
[[shape]]
material = "white"
box = { min = [0, 0, 0], max = [4, 3, 4], inward = true }
[[shape]]
material = "lamp"
quad = [[1.5, 2.99, 1.5], [2.5, 2.99, 1.5], [2.5, 2.99, 2.5], [1.5, 2.99, 2.5]]
[[shape]]
material = "white"
box = { min = [0.5, 0, 1], max = [1.98, 1.5, 3] }
[[shape]]
material = "white"
box = { min = [2.02, 0, 1], max = [3.5, 1.5, 3] }
"#;

/// On a side of the gap, at 2 to 25 cm from its upper end; and one in the open.
const SENSORS: &str = "1.98 1.48 2 1 0 0\n1.98 1.44 1.7 1 0 0\n2.02 1.4 2.2 -1 0 0\n1.98 1.25 2 1 0 0\n3.8 0 2 0 1 0\n";

/// A ball of radius 0.2 m and radiance 10 W/m²sr, 1 m above a black floor.
const BALL: &str = r#"
[material.black]
lambert = 0
[material.lamp]
lambert = 0
emission = 10
[[shape]]
material = "black"
quad = [[-2, 0, -2], [-2, 0, 2], [2, 0, 2], [2, 0, -2]]
[[shape]]
material = "lamp"
sphere = { center = [0, 1, 0], radius = 0.2 }
"#;

/// A closed body of twelve flat faces with smooth normals, beneath a lamp to its side.
const BODY: &str = r#"
[material.white]
lambert = 0.7
[material.lamp]
lambert = 0
emission = 20
[[shape]]
material = "white"
box = { min = [0, 0, 0], max = [4, 2.5, 4], inward = true }
[[shape]]
material = "lamp"
quad = [[0.5, 2.49, 0.5], [1, 2.49, 0.5], [1, 2.49, 1], [0.5, 2.49, 1]]
[[shape]]
material = "white"
cylinder = { from = [2.5, 0.2, 1.5], to = [2.5, 1.2, 1.5], radius = 0.5, segments = 12 }
"#;

/// Irradiances at points of a scene, and their standard errors.
fn measured(dir: &Path, [scene, points]: [&str; 2], options: &[&str]) -> Vec<[f64; 2]> {
    std::fs::write(dir.join("scene.toml"), scene).expect("it can be written");
    std::fs::write(dir.join("sensors.pts"), points).expect("it can be written");
    let files = ["measure", "scene.toml", "--points", "sensors.pts", "-q", "-o", "measured.csv"];
    let output = radiosa(dir, &[&files, options].concat());
    assert!(output.status.success(), "{options:?}: {}", text(&output.stderr));
    let table = std::fs::read_to_string(dir.join("measured.csv")).expect("it was written");
    let row = |line: &str| {
        let numbers: Vec<f64> = line.split(',').map(|v| v.parse().expect("a number")).collect();
        [numbers[9], numbers[10]]
    };
    table.lines().skip(1).map(row).collect()
}

#[test]
fn radiosity_reads_narrow_gaps_between_large_elements() {
    let dir = tempfile::tempdir().expect("a folder");
    // Elements of half a metre and more: their means say nothing of the gap. The twin takes them as they are, as sensors in a medium do.
    let elements = ["--method", "radiosity", "--elements", "400", "--refine", "0"];
    let radiosity = measured(dir.path(), [GAP, SENSORS], &elements);
    let twin = measured(dir.path(), [GAP, SENSORS], &[&elements[..], &["--absorption", "1e-9"]].concat());
    let path = measured(dir.path(), [GAP, SENSORS], &["--method", "path", "--spp", "65536"]);
    for (k, ((r, t), p)) in radiosity.iter().zip(&twin).zip(&path).enumerate() {
        println!("{k}: {:.4} ± {:.4}, paths {:.4} ± {:.4}, twin {:.4}", r[0], r[1], p[0], p[1], t[0]);
        let bound = 0.04 * p[0] + 4.0 * (r[1].powi(2) + p[1].powi(2)).sqrt();
        assert!((r[0] - p[0]).abs() <= bound, "sensor {k}: {r:?}, by paths {p:?}");
        let is_in_gap = k < 4;
        assert!(!is_in_gap || (t[0] - p[0]).abs() > bound, "sensor {k} of the twin: {t:?}, by paths {p:?}");
    }
}

#[test]
fn balls_that_emit_are_round_to_sensors_of_the_hybrid() {
    let dir = tempfile::tempdir().expect("a folder");
    let places: [f64; 2] = [0.0, 0.7];
    let points: String = places.iter().map(|x| format!("{x} 0 0 0 1 0\n")).collect();
    let by = |method: &str| measured(dir.path(), [BALL, &points], &["--method", method, "--sphere-rings", "4"]);
    let (hybrid, twin) = (by("hybrid"), by("radiosity"));
    for (k, x) in places.iter().enumerate() {
        // E = π L (r/d)² cos θ
        let d2 = 1.0 + x * x;
        let truth = std::f64::consts::PI * 10.0 * 0.04 / d2 / d2.sqrt();
        let off = |readings: &[[f64; 2]]| readings[k][0] / truth - 1.0;
        println!("{x} m: {truth:.4}, hybrid {:+.5}, twin {:+.5}", off(&hybrid), off(&twin));
        assert!(off(&hybrid).abs() < 1e-3, "{x}: {:?}, not {truth}", hybrid[k]);
        // The twin sees a polyhedron of the same area.
        assert!(off(&twin).abs() > 2e-3, "{x}: {:?}, {truth}", twin[k]);
    }
}

#[test]
fn no_light_comes_into_closed_bodies_with_smooth_normals() {
    let dir = tempfile::tempdir().expect("a folder");
    // Within, and on the floor beneath.
    let points = "2.8 0.5 1.5 0 1 0\n2.5 0.5 1.5 1 0 0\n2.5 0 1.5 0 1 0\n";
    let readings = measured(dir.path(), [BODY, points], &["--method", "hybrid"]);
    // (Light behind a facet that its smooth normals face came through: 1e-3 with twelve facets.)
    assert!(readings[..2].iter().all(|[e, _]| *e < 1e-9), "{readings:?}");
    assert!(readings[2][0] > 0.01, "{readings:?}");
}
