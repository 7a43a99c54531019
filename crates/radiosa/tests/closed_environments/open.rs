//! What is open or endless: plates and grooves; and which entries of the reference are tested where.

use radiosa::radiosity::form_factor::Row;
use radiosa::radiosity::medium::Medium;

use super::*;

#[test]
fn every_environment_of_the_reference_is_of_a_kind_that_is_tested() {
    let tested = [
        ("furnace", 1),
        ("furnace-rgb", 1),
        ("furnace-nonuniform", 1),
        // A task for Monte Carlo methods.
        ("white-furnace-object", 1),
        ("integrating-sphere", 3),
        ("integrating-sphere-source", 1),
        ("box", 6),
        ("infinite-parallel-plates", 4),
        ("patch-system", 5),
        ("infinite-v-groove", 3),
        ("manufactured", 1),
    ];
    let all = environments();
    for (kind, n) in tested {
        assert_eq!(all.iter().filter(|e| e["kind"] == kind).count(), n, "{kind}");
    }
    assert_eq!(all.len(), tested.iter().map(|(_, n)| n).sum::<usize>());
}

#[test]
fn endless_plates_exchange_everything() {
    // Each sees nothing but the other.
    let rows = [1, 0].map(|j| Row { entries: vec![(j, 1.0)], ..Row::default() });
    let matrix = Matrix::from_rows(&rows, &Medium::default());
    for e in environments().iter().filter(|e| e["kind"] == "infinite-parallel-plates") {
        let (emission, reflectance, truth) = (numbers(&e["emission"]), numbers(&e["reflectance"]), numbers(&e["B"]));
        let off = |sweep, wrong: f64| {
            let system = System {
                area: vec![1.0; 2],
                emission: emission.iter().map(|&e| [e; 3]).collect(),
                reflectance: reflectance.iter().map(|&r| [r * wrong; 3]).collect(),
                direct: vec![[0.0; 3]; 2],
                ..System::default()
            };
            let mut columns = [vec![[0.0; 3]; 2], vec![[0.0; 3]; 2], vec![[0.0; 3]; 2]];
            let [radiosity, irradiance, unshot] = &mut columns;
            let mut unknowns = Unknowns { radiosity, irradiance, unshot };
            unknowns.start(&system);
            for _ in 0..4000 {
                gathering::step(&system, &matrix, sweep, &mut unknowns);
            }
            let scale = truth.iter().fold(0.0f64, |m, &b| m.max(b));
            unknowns.radiosity.iter().zip(&truth).map(|(b, t)| (b[0] - t).abs() / scale).fold(0.0, f64::max)
        };
        for sweep in [gathering::Sweep::Jacobi, gathering::Sweep::GaussSeidel] {
            assert!(off(sweep, 1.0) < 1e-6, "{} by {sweep:?} is off by {:e}", e["id"], off(sweep, 1.0));
            // The twin: reflectances wrong by 2 %.
            assert!(off(sweep, 0.98) > 1e-3, "{}", e["id"]);
        }
    }
}

/// Two plates of width 1 with an angle of `angle` radians between them, in strips of equal width, as long as to seem endless.
fn groove(angle: f64, n: usize, reflectance: f64) -> Vec<Face> {
    const LENGTH: f64 = 1e4;
    let end = DVec3::Y * LENGTH;
    let mut faces = Vec::new();
    for (along, is_upper) in [(DVec3::X, false), (DVec3::new(angle.cos(), 0.0, angle.sin()), true)] {
        for k in 0..n {
            let [a, b] = [k, k + 1].map(|k| along * (k as f64 / n as f64));
            let mut corners = vec![a, b, b + end, a + end];
            if is_upper {
                corners.reverse();
            }
            faces.push(Face::grey(corners, 1.0, reflectance));
        }
    }
    faces
}

#[test]
fn grooves_approach_their_continuous_solutions() {
    for (e, degrees) in environments().iter().filter(|e| e["kind"] == "infinite-v-groove").zip([60.0f64, 90.0, 120.0]) {
        assert!(e["description"].as_str().expect("a text").contains(&format!("dihedral {degrees} degrees")));
        let reflectance = match e["id"].as_str().expect("a name") {
            "VGR-01" => 0.5,
            "VGR-02" => 0.8,
            _ => 0.9,
        };
        let mean = |n: usize, wrong: f64| {
            let world = world(&groove(degrees.to_radians(), n, reflectance), Vec::new());
            let twin = |s: &mut System| s.reflectance.iter_mut().flatten().for_each(|r| *r *= wrong);
            let solution = solve(&world, &settings(Method::GaussSeidel, None, 1e-7), twin);
            let area: f64 = solution.system.area.iter().sum();
            solution.radiosity.iter().zip(&solution.system.area).map(|(b, a)| b[0] * a).sum::<f64>() / area
        };
        // One strip a plate; the ends of the groove are open.
        let two = number(&e["two_patch"]["B"]);
        assert!((mean(1, 1.0) / two - 1.0).abs() < 2e-4, "{}: {} is not {two}", e["id"], mean(1, 1.0));
        let truth = number(&e["continuous"]["mean_B"]);
        let errors = [4, 8, 16].map(|n| (mean(n, 1.0) / truth - 1.0).abs());
        let order = (errors[0] / errors[2]).log2() / 2.0;
        let twin = (mean(16, 0.98) / truth - 1.0).abs();
        println!("{}: {}, order {order:.2}; twin {twin:.1e}", e["id"], list(&errors));
        assert!(order >= 0.9 && errors[2] < 1e-3 && twin > 2e-3, "{}: {errors:?}, twin {twin}", e["id"]);
    }
}
