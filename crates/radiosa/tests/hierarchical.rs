//! Links between groups of elements against the matrix of all pairs, and what must hold for any of them.

mod common;

use std::fmt::Write as _;

use common::{scene_of, world_of};
use radiosa::radiosity::hierarchical;
use radiosa::radiosity::solve::Solver as Method;
use radiosa::radiosity::{self, Solution};
use radiosa::transport::World;

fn solve(world: &World, elements: u32, solver: Method) -> Solution {
    let mut settings = radiosity::Settings { solver, ..Default::default() };
    (settings.mesh.elements, settings.refine.levels) = (elements, 0);
    radiosity::solve(world, &settings)
}

fn links(tolerance: f64) -> Method {
    Method::Hierarchical(hierarchical::Settings { tolerance, ..Default::default() })
}

/// A closed room with a lamp and boxes, some of which stand in each other.
fn room(boxes: &[[f64; 6]], reflectance: f64) -> String {
    let mut text = format!(
        "[material.a]\nlambert = {reflectance}\n[material.l]\nlambert = 0.3\nemission = 10\n\
         [[shape]]\nname = \"room\"\nmaterial = \"a\"\nbox = {{ min = [0, 0, 0], max = [4, 3, 5], inward = true }}\n\
         [[shape]]\nname = \"lamp\"\nmaterial = \"l\"\nquad = [[1.5, 2.9, 2], [2.5, 2.9, 2], [2.5, 2.9, 3], [1.5, 2.9, 3]]\n"
    );
    for [x, y, z, a, b, c] in boxes {
        let (x1, y1, z1) = (x + a, y + b, z + c);
        writeln!(text, "[[shape]]\nmaterial = \"a\"\nbox = {{ min = [{x}, {y}, {z}], max = [{x1}, {y1}, {z1}] }}")
            .expect("it is a string");
    }
    text
}

/// The root mean square over areas of irradiance's error, relative to the mean.
fn error(of: &Solution, truth: &Solution) -> f64 {
    let (mut squares, mut sum, mut area) = (0.0, 0.0, 0.0);
    for (i, a) in truth.system.area.iter().enumerate() {
        squares += a * (of.irradiance[i][1] - truth.irradiance[i][1]).powi(2);
        sum += a * truth.irradiance[i][1];
        area += a;
    }
    (squares / area).sqrt() / (sum / area)
}

#[test]
fn links_tend_to_the_matrix_with_fewer_of_them() {
    let world = world_of(scene_of(&room(&[[0.5, 0.0, 1.0, 1.0, 1.2, 1.0], [2.5, 0.0, 3.0, 0.8, 2.0, 0.9]], 0.7)));
    let truth = solve(&world, 2000, Method::GaussSeidel);
    let found = [1.0, 0.1, 0.01, 1e-3, 1e-4].map(|tolerance| {
        let solution = solve(&world, 2000, links(tolerance));
        let off = error(&solution, &truth);
        println!("{tolerance:e}: {off:.1e} by {:.3} of the links", solution.n_factors as f64 / truth.n_factors as f64);
        (off, solution.n_factors)
    });
    assert!(found.is_sorted_by(|a, b| a.0 > b.0 && a.1 < b.1), "{found:?}");
    assert!(found[2].0 < 0.03 && found[2].1 * 6 < truth.n_factors, "{found:?}");
    assert!(found[4].0 < 3e-3, "{found:?}");
    // The twin: a tolerance that lets everything pass.
    assert!(found[0].0 > 0.03, "{found:?}");
}

#[test]
fn no_room_makes_light_or_takes_it_or_has_less_than_none() {
    for seed in 0..12u64 {
        let number = |k: u64| {
            let mixed = (seed * 97 + k + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
            ((mixed ^ mixed >> 29).wrapping_mul(0xBF58_476D_1CE4_E5B9) >> 40) as f64 / f64::from(1 << 24)
        };
        let of = |b: u64| {
            let at = |k: u64| number(10 * b + k);
            [at(0) * 3.0, at(1) * 0.5 * f64::from(u32::from(b > 1)), at(2) * 4.0, 0.1 + at(3), 0.1 + at(4) * 2.0, 0.1 + at(5)]
        };
        let boxes: Vec<[f64; 6]> = (0..1 + seed % 5).map(of).collect();
        let world = world_of(scene_of(&room(&boxes, 0.5 + 0.45 * number(999))));
        let solution = solve(&world, 600, links([0.3, 0.03][seed as usize % 2]));
        let balance = solution.balance;
        assert!(balance.error() < 1e-3 && balance.unshot[0].abs() < 1e-4 * balance.emitted[0], "{seed}: {balance:?}");
        // Boxes stand out of the room here and there, and lamps have a dark back: little may escape.
        assert!(balance.escaped[0] > -1e-3 * balance.emitted[0], "{seed}: {balance:?}");
        for values in [&solution.radiosity, &solution.irradiance] {
            assert!(values.iter().flatten().all(|v| v.is_finite() && *v >= 0.0), "{seed}");
        }
    }
}

#[test]
fn the_same_bits_at_any_thread_count() {
    let world = world_of(scene_of(&room(&[[0.5, 0.0, 1.0, 1.0, 1.2, 1.0]], 0.7)));
    let of = |n: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("threads");
        pool.install(|| solve(&world, 800, links(0.03)))
    };
    let one = of(1);
    for n in [2, 3, 7] {
        let other = of(n);
        assert!(
            one.radiosity == other.radiosity && one.irradiance == other.irradiance && one.n_factors == other.n_factors,
            "{n}"
        );
    }
}

#[test]
fn few_links_raise_the_tolerance() {
    let world = world_of(scene_of(&room(&[], 0.7)));
    let of =
        |max_links| solve(&world, 2000, Method::Hierarchical(hierarchical::Settings { tolerance: 1e-3, max_links })).n_factors;
    let (all, few) = (of(usize::MAX), of(15_000));
    assert!(few < all / 2, "{few} of {all}");
}
