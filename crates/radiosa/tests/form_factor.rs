//! Form factors against closed forms (`form-factors.json`).

use radiosa::math::DVec3;
use radiosa::math::polygon::area_vector;
use radiosa::radiosity::form_factor::analytic;
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
}
