//! `radiosa factors`: files in, factors out.

mod common;

use std::path::Path;

use common::{radiosa, text};
use serde_json::Value;

/// A line of the output: from, to, and area, factor and standard error.
type Line = (String, String, [f64; 3]);

/// Runs `factors` to its end.
fn factors(dir: &Path, args: &[&str]) -> Vec<Line> {
    let output = radiosa(dir, &[&["factors", "-o", "out.csv", "-q"], args].concat());
    assert!(output.status.success(), "{}", text(&output.stderr));
    let csv = std::fs::read_to_string(dir.join("out.csv")).expect("it is written");
    let mut lines = csv.lines();
    assert_eq!(lines.next(), Some("from,to,area_from,factor,stderr"));
    let line = |line: &str| {
        let words: Vec<&str> = line.split(',').collect();
        let numbers = [2, 3, 4].map(|k| words[k].parse().expect("a number"));
        (words[0].to_owned(), words[1].to_owned(), numbers)
    };
    lines.map(line).collect()
}

fn factor(all: &[Line], from: &str, to: &str) -> f64 {
    all.iter().find(|(f, t, _)| f == from && t == to).map_or(0.0, |(_, _, numbers)| numbers[1])
}

/// Two unit squares opposed at distance 1.
const SQUARES: &str = "T two squares\n! C11\nF 3
V 1 0 0 0\nV 2 1 0 0\nV 3 1 1 0\nV 4 0 1 0\nV 5 0 0 1\nV 6 0 1 1\nV 7 1 1 1\nV 8 1 0 1
S 1 1 2 3 4 0 0 0.9 floor\nS 2 5 6 7 8 0 0 0.5 lid\nE\n";

#[test]
fn surfaces_of_view3d_and_stl_exchange_what_the_catalogue_says() {
    let dir = tempfile::tempdir().expect("temporary folders can be made");
    std::fs::write(dir.path().join("squares.vs3"), SQUARES).expect("it can be written");
    let truth = radiosa_testkit::form_factor::opposed_rectangles(1.0, 1.0, 1.0);
    let all = factors(dir.path(), &["squares.vs3"]);
    assert_eq!(all.len(), 2);
    for (from, to) in [("floor", "lid"), ("lid", "floor")] {
        assert!((factor(&all, from, to) - truth).abs() < 1e-6, "{all:?}");
    }
    // The same as triangles, each pair of which is one patch; and cut into elements.
    let corners = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [0, 1, 1], [1, 1, 1], [1, 0, 1]];
    let facet = |t: [usize; 3]| {
        let vertex = |k: usize| format!("vertex {} {} {}\n", corners[k][0], corners[k][1], corners[k][2]);
        format!("facet normal 0 0 0\nouter loop\n{}endloop\nendfacet\n", t.map(vertex).concat())
    };
    let solid =
        |name: &str, k: usize| format!("solid {name}\n{}{}endsolid\n", facet([k, k + 1, k + 2]), facet([k, k + 2, k + 3]));
    std::fs::write(dir.path().join("squares.stl"), solid("floor", 0) + &solid("lid", 4)).expect("it can be written");
    let by_patch = factors(dir.path(), &["squares.stl", "--by", "patch"]);
    assert_eq!(by_patch.len(), 2);
    assert!((factor(&by_patch, "0", "1") - truth).abs() < 1e-6, "{by_patch:?}");
    let divided = factors(dir.path(), &["squares.stl", "--elements", "30"]);
    assert!((factor(&divided, "lid", "floor") - truth).abs() < 1e-6, "{divided:?}");
    let two_sided = factors(dir.path(), &["squares.stl", "--two-sided"]);
    assert!((factor(&two_sided, "lid", "floor") - 0.5 * truth).abs() < 1e-6, "{two_sided:?}");
}

#[test]
fn every_occluded_pair_of_the_reference_is_within_1e_4_as_an_obj_file() {
    let path = radiosa_testkit::data_dir().join("form-factors.json");
    let data: Value = serde_json::from_str(&std::fs::read_to_string(path).expect("it is there")).expect("it is JSON");
    let dir = tempfile::tempdir().expect("temporary folders can be made");
    let mut worst: f64 = 0.0;
    for c in data["configurations"].as_array().expect("a list").iter().filter(|c| c["kind"] == "polygon-polygon-occluded") {
        let mut obj = String::new();
        let between = c["occluders"].as_array().expect("a list");
        let surfaces = [("from", &c["surface1"]), ("to", &c["surface2"])].into_iter();
        for (name, surface) in surfaces.chain(between.iter().map(|o| ("blocker", o))) {
            let vertices = surface["vertices"].as_array().expect("vertices");
            obj += &format!("o {name}\n");
            vertices.iter().for_each(|v| obj += &format!("v {} {} {}\n", v[0], v[1], v[2]));
            let corners: Vec<String> = (1..=vertices.len()).rev().map(|k| format!("-{k}")).collect();
            obj += &format!("f {}\n", corners.join(" "));
        }
        std::fs::write(dir.path().join("pair.obj"), obj).expect("it can be written");
        let all = factors(dir.path(), &["pair.obj"]);
        for (from, to, truth) in [("from", "to", &c["F12"]), ("to", "from", &c["F21"])] {
            let error = (factor(&all, from, to) - truth.as_f64().expect("a number")).abs();
            assert!(error < 1e-4, "{}: off by {error:e}", c["id"]);
            worst = worst.max(error);
        }
    }
    println!("worst {worst:.1e}");
}

#[test]
fn every_estimator_closes_a_closed_box_and_says_how_well() {
    let dir = tempfile::tempdir().expect("temporary folders can be made");
    let mut obj = String::new();
    for k in 0..8 {
        obj += &format!("v {} {} {}\n", k & 1, k >> 1 & 1, k >> 2 & 1);
    }
    for (name, face) in ["1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4"].iter().enumerate() {
        obj += &format!("o side{name}\nf {face}\n");
    }
    std::fs::write(dir.path().join("box.obj"), obj).expect("it can be written");
    for (estimator, bound) in [("analytic", 1e-6), ("hemicube", 1e-4), ("hemisphere", 1e-5), ("area", 0.3)] {
        let args = ["factors", "box.obj", "--estimator", estimator, "--json", "-o", "box.npz", "-o", "box.mtx"];
        let output = radiosa(dir.path(), &args);
        assert!(output.status.success(), "{}", text(&output.stderr));
        let report: Value = serde_json::from_slice(&output.stdout).expect("standard output is JSON alone");
        for which in ["least", "mean", "greatest"] {
            let sum = report["raw_row_sums"][which].as_f64().expect("a number");
            assert!((sum - 1.0).abs() < bound, "{estimator}: {which} {sum}");
        }
        assert!(text(&output.stderr).contains("reciprocity"));
        assert_eq!(report["factors"], 30, "{estimator}");
    }
    let mtx = std::fs::read_to_string(dir.path().join("box.mtx")).expect("it is written");
    assert!(mtx.starts_with("%%MatrixMarket matrix coordinate real general\n") && mtx.contains("\n6 6 30\n"), "{mtx}");
    let npz = std::fs::read(dir.path().join("box.npz")).expect("it is written");
    assert!(npz.starts_with(b"PK\x03\x04") && npz.windows(9).any(|w| w == b"data.npy\x01"));
}

#[test]
fn what_cannot_be_written_or_read_is_said_before_anything_is_done() {
    let dir = tempfile::tempdir().expect("temporary folders can be made");
    let output = radiosa(dir.path(), &["factors", "cornell-box", "-o", "a.txt"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains(".csv"), "{}", text(&output.stderr));
    for (file, content, says) in [
        ("a.vs3", "F 3\nV 1 0 0 0\nS 1 1 2 3 0 0 0 1 a\n", "vertex 2"),
        ("b.vs3", "F 2\n", "two dimensions"),
        ("c.stl", "solid\nvertex 0 0\n", "three numbers"),
        ("d.stl", "binary", "too few"),
    ] {
        std::fs::write(dir.path().join(file), content).expect("it can be written");
        let output = radiosa(dir.path(), &["factors", file]);
        assert_eq!(output.status.code(), Some(1));
        assert!(text(&output.stderr).contains(says), "{file}: {}", text(&output.stderr));
    }
}

#[test]
fn the_help_is_as_it_was_reviewed() {
    let dir = tempfile::tempdir().expect("temporary folders can be made");
    insta::assert_snapshot!("factors-help", text(&radiosa(dir.path(), &["factors", "--help"]).stdout));
}

#[test]
fn spheres_and_discs_are_divided_and_converge_at_second_order() {
    use radiosa_testkit::form_factor as closed;
    let dir = tempfile::tempdir().expect("temporary folders can be made");
    let ball = "[[shape]]\nname = \"ball\"\nsphere = { radius = 0.5 }\n";
    let disc = "[[shape]]\nname = \"disc\"\ndisc = { radius = 1, center = [0, 1, 0], normal = [0, -1, 0] }\n";
    let quad = "[[shape]]\nname = \"quad\"\nquad = [[0, -1, 0], [0, -1, 1], [1, -1, 1], [1, -1, 0]]\n";
    std::fs::write(dir.path().join("ball.toml"), format!("{ball}{disc}{quad}")).expect("it can be written");
    let error = |rings: &str| {
        let all = factors(dir.path(), &["ball.toml", "--sphere-rings", rings, "--sampled-shadows"]);
        // A convex thing sees nothing of itself.
        assert_eq!(factor(&all, "ball", "ball"), 0.0, "{rings}");
        let truths = [("disc", closed::sphere_to_disc(1.0, 1.0)), ("quad", closed::sphere_to_rectangle(1.0, 1.0, 1.0))];
        truths.map(|(to, truth)| (factor(&all, "ball", to) / truth - 1.0).abs())
    };
    let (coarse, fine) = (error("8"), error("32"));
    for k in 0..2 {
        let order = (coarse[k] / fine[k]).log2() / 2.0;
        println!("errors {:.1e} {:.1e}, order {order:.2}", coarse[k], fine[k]);
        assert!(order > 1.8 && fine[k] < 0.01, "{coarse:?} {fine:?}");
    }
    // Said once.
    let output = radiosa(dir.path(), &["factors", "ball.toml", "-o", "out.csv"]);
    assert_eq!(text(&output.stderr).matches("--sphere-rings").count(), 1, "{}", text(&output.stderr));
}

#[test]
fn a_medium_takes_its_part_of_what_squares_exchange() {
    let dir = tempfile::tempdir().expect("temporary folders can be made");
    std::fs::write(dir.path().join("squares.vs3"), SQUARES).expect("it can be written");
    let truth = radiosa_testkit::form_factor::opposed_squares_through(1.0, 0.7);
    for (estimator, bound) in [("analytic", 1e-5), ("hemisphere", 5e-3)] {
        let all = factors(dir.path(), &["squares.vs3", "--absorption", "0.7", "--estimator", estimator]);
        assert!((factor(&all, "floor", "lid") - truth).abs() < bound, "{estimator}: {all:?} not {truth}");
    }
    let output = radiosa(dir.path(), &["factors", "squares.vs3", "--absorption", "0.7", "--correct", "closure"]);
    assert_eq!(output.status.code(), Some(2), "{}", text(&output.stderr));
    // What the scene takes is held against what is allowed.
    let output = radiosa(dir.path(), &["factors", "cornell-box", "--max-memory", "1K"]);
    assert!(text(&output.stderr).contains("the scene takes"), "{}", text(&output.stderr));
}
