//! Environments filled with a medium that absorbs, against closed forms.
//!
//! In a sphere every place sees every other by the same factor, so the mean transmittance has a closed form and radiosities are even: `B = E/(1 − ρ τ̄)`.
//! In any convex room the mean chord is `4V/S` long (Cauchy), so a thin medium absorbs `4 σ V/S` of what crosses it.

use radiosa::film::Pixel;
use radiosa::math::{Ray, Vec3};
use radiosa::radiosity::display;
use radiosa::radiosity::form_factor::{area, hemicube, hemisphere};
use radiosa::radiosity::gather;
use radiosa::radiosity::medium::Medium;
use radiosa::sampling::{Stream, sequence};
use radiosa::transport::{Footprint, Integrator, Surface};
use radiosa_testkit::form_factor as closed;

use super::*;

const COLORED: [f64; 3] = [0.2, 0.7, 1.5];

fn grey(sigma: f64) -> Medium {
    Medium { absorption: [sigma; 3] }
}

fn elements(world: &World, size: Option<f64>) -> mesh::ElementMesh {
    let settings = settings(Method::Jacobi, size, 1e-3).mesh;
    mesh::ElementMesh::new(world, &settings, &radiosa::radiosity::direct::DirectLight::new(world, &[], 0))
}

/// `Σ A_i Σ_j τ_ij F_ij / Σ A_i` by channel, and the same for what is met.
fn mean_passing(world: &World, mesh: &mesh::ElementMesh, estimator: &Estimator, medium: Medium) -> ([f64; 3], f64) {
    let matrix = Factors::in_medium(world, mesh, estimator, medium, 0).matrix();
    let (mut arriving, mut met, mut all) = ([0.0; 3], 0.0, 0.0);
    for (i, e) in mesh.elements().iter().enumerate() {
        let sum = matrix.arriving_sum(i);
        (0..3).for_each(|c| arriving[c] += e.area * sum[c]);
        met += e.area * matrix.row_sum(i);
        all += e.area;
    }
    (arriving.map(|a| a / all), met / all)
}

#[test]
fn a_thin_medium_absorbs_by_the_mean_chord_of_a_room() {
    let tetrahedron = systems().pop().expect("the last one").faces;
    // Of edge √(4/√3).
    let edge = (4.0 / 3f64.sqrt()).sqrt();
    let shapes = [
        ("cube", box_faces(DVec3::ONE, &[0.0; 6], &[0.0; 6]), 4.0 / 6.0),
        ("flat box", box_faces(DVec3::new(2.0, 1.0, 0.5), &[0.0; 6], &[0.0; 6]), 4.0 / 7.0),
        ("tetrahedron", tetrahedron, 4.0 * edge.powi(3) / (6.0 * 2f64.sqrt()) / 4.0),
    ];
    for (name, faces, chord) in shapes {
        let world = world(&faces, Vec::new());
        let bound = 1e-2;
        for size in [None, Some(0.5)] {
            let mesh = elements(&world, size);
            // The slope at zero, from two small σ.
            let absorbed = |sigma: f64| {
                let (arriving, met) = mean_passing(&world, &mesh, &exact(1e-4), grey(sigma));
                met - arriving[0]
            };
            let slope = 2.0 * absorbed(0.05) / 0.05 - absorbed(0.1) / 0.1;
            println!("{name}, {} elements: mean chord {slope:.5} of {chord:.5}", mesh.elements().len());
            assert!((slope / chord - 1.0).abs() < bound, "{name}: {slope} is not {chord}");
            // The twin: what passes the distance between centres, which finer meshes mend.
            let (mut by_centres, mut all) = (0.0, 0.0);
            let matrix = Factors::new(&world, &mesh, &exact(1e-5), 0).matrix();
            for (i, e) in mesh.elements().iter().enumerate() {
                let distance = |j: usize| (mesh.elements()[j].centre() - e.centre()).length();
                by_centres += e.area * matrix.row(i).map(|(j, f)| f * distance(j)).sum::<f64>();
                all += e.area;
            }
            assert!(size.is_some() || (by_centres / all / chord - 1.0).abs() > 2.0 * bound, "{name}: {}", by_centres / all);
        }
    }
}

#[test]
fn every_estimator_attenuates_what_squares_exchange() {
    let cube = box_faces(DVec3::ONE, &[0.0; 6], &[0.0; 6]);
    let world = world(&cube[4..], Vec::new());
    let mesh = elements(&world, None);
    let truth = COLORED.map(|sigma| closed::opposed_squares_through(1.0, sigma));
    let rays = hemisphere::Settings { rule: hemisphere::Rule::Nusselt, rays: 1 << 16, points: 1 << 16 };
    let samples = area::Settings { samples: 1 << 14, ..area::Settings::default() };
    let estimators = [
        ("analytic", exact(1e-8), 1e-6),
        ("hemicube", Estimator::Hemicube(hemicube::Settings { resolution: 128, points: 256 }), 1e-3),
        ("hemisphere", Estimator::Hemisphere(rays), 1e-3),
        ("area", Estimator::Area(samples), 1e-3),
    ];
    let off = |found: [f64; 3]| (0..3).map(|c| (found[c] - truth[c]).abs()).fold(0.0, f64::max);
    for (name, estimator, bound) in estimators {
        let of = |absorption| mean_passing(&world, &mesh, &estimator, Medium { absorption });
        let (found, met) = of(COLORED);
        println!("{name}: off by {:.1e}", off(found));
        assert!(off(found) < bound, "{name}: {found:?} is not {truth:?}");
        // Where all channels are alike they are as if each were alone.
        let (alone, _) = of([COLORED[1]; 3]);
        assert!((alone[0] - found[1]).abs() < 1e-7, "{name}: {alone:?} {found:?}");
        // The twins: a grey medium of the mean σ, and the whole as far away as the centres.
        let (mean, _) = of([COLORED.iter().sum::<f64>() / 3.0; 3]);
        assert!(off(mean) > 10.0 * bound, "{name}");
        assert!(off(COLORED.map(|sigma| met * (-sigma).exp())) > 2.0 * bound, "{name}");
    }
}

#[test]
fn what_is_seen_past_something_is_as_far_as_it_is() {
    // Two squares with a common edge and a board across it: what they still see of each other is farther away than the rest.
    let cube = box_faces(DVec3::ONE, &[0.0; 6], &[0.0; 6]);
    let mut faces = vec![cube[0].clone(), cube[4].clone()];
    let board = [[0.45, 0.0, 0.05], [0.45, 1.0, 0.05], [0.05, 1.0, 0.45], [0.05, 0.0, 0.45]].map(DVec3::from_array);
    faces.push(Face::grey(board.to_vec(), 0.0, 0.0));
    let world = world(&faces, Vec::new());
    let mesh = elements(&world, None);
    let medium = Medium { absorption: COLORED };
    let [a, b] = [0, 1].map(|i| mesh.elements()[i]);
    let mut sums = [[0.0; 4]; 2];
    for k in 0..1 << 16 {
        let [u, v] = sequence::point_4d(k, 9).map(|u| [f64::from(u.x), f64::from(u.y)]);
        let (p, q) = (a.at(u) + a.normal * 1e-5, b.at(v) + b.normal * 1e-5);
        let d = q - p;
        let kernel = (a.normal.dot(d) * -b.normal.dot(d)).max(0.0) / d.length_squared().powi(2);
        let tau = medium.transmittance(d.length());
        let terms = [kernel, kernel * tau[0], kernel * tau[1], kernel * tau[2]];
        let seen = !world.accel().occluded(&Ray { origin: p.as_vec3(), dir: d.as_vec3(), t_max: 1.0 });
        for (sum, counts) in sums.iter_mut().zip([seen, true]) {
            (0..4).filter(|_| counts).for_each(|k| sum[k] += terms[k]);
        }
    }
    let tau = |[all, r, g, b]: [f64; 4]| [r / all, g / all, b / all];
    let [truth, twin] = sums.map(tau);
    for clip in [None, Some(1e-5)] {
        let estimator = Estimator::Analytic(pair::Settings { tolerance: 1e-4, rays: [64, 64], clip });
        let matrix = Factors::in_medium(&world, &mesh, &estimator, medium, 0).matrix();
        let f = matrix.row(0).find(|e| e.0 == 1).expect("something is seen").1;
        let found = matrix.arriving(0).find(|e| e.0 == 1).expect("something is seen").1.map(|a| a / f);
        let off = |tau: [f64; 3]| (0..3).map(|c| (tau[c] / truth[c] - 1.0).abs()).fold(0.0, f64::max);
        println!("clip {clip:?}: τ off by {:.1e}, the whole pair's by {:.1e}", off(found), off(twin));
        assert!(off(found) < 0.04, "{found:?} is not {truth:?}");
        // The twin: τ of the whole pair.
        assert!(off(twin) > 0.08, "{twin:?}");
    }
}

/// Facets of a sphere of radius 1 with emission E and reflectance ρ, and what its inside must show in a medium: τ̄ and B.
fn globe(n: usize, emission: f64, reflectance: f64) -> (World, [[f64; 3]; 2]) {
    let tau = COLORED.map(|sigma| closed::sphere_transmittance(2.0 * sigma));
    let world = world(&sphere(1.0, &[(1.0, emission, reflectance)], n), Vec::new());
    (world, [tau, tau.map(|tau| emission / (1.0 - reflectance * tau))])
}

fn in_medium(method: Method, tolerance: f64, absorption: [f64; 3]) -> radiosity::Settings {
    radiosity::Settings { medium: Medium { absorption }, ..settings(method, None, tolerance) }
}

#[test]
fn spheres_full_of_a_medium_converge_to_their_closed_form() {
    let mean = |solution: &Solution| -> [f64; 3] {
        let all: f64 = solution.system.area.iter().sum();
        std::array::from_fn(|c| solution.radiosity.iter().zip(&solution.system.area).map(|(b, a)| b[c] * a).sum::<f64>() / all)
    };
    let off = |found: [f64; 3], truth: [f64; 3]| (0..3).map(|c| (found[c] / truth[c] - 1.0).abs()).fold(0.0, f64::max);
    for (name, method) in deterministic() {
        let errors = [8, 16].map(|n| {
            let (world, [tau, b]) = globe(n, 1.0, 0.8);
            let solution = solve(&world, &in_medium(method, 1e-3, COLORED), |_| ());
            let balance = solution.balance;
            // What arrives of what all send is τ̄ of it; the rest the medium has absorbed.
            let area: f64 = solution.system.area.iter().sum();
            let sent = b.map(|b| area * b);
            let in_medium = std::array::from_fn(|c| balance.in_medium[c] / sent[c]);
            let lost = off(in_medium, tau.map(|t| 1.0 - t));
            assert!(n < 16 || lost < 0.08, "{name}: {in_medium:?}, off by {lost}");
            off(mean(&solution), b)
        });
        let order = (errors[0] / errors[1]).log2();
        println!("{name}: {}, order {order:.2}", list(&errors));
        assert!(order > 1.7 && errors[1] < 0.02, "{name}: {errors:?}");
    }
    // By rays, within their errors and those of the facets.
    let (world, [_, b]) = globe(24, 1.0, 0.8);
    let rays = Method::Stochastic(stochastic::Settings { rays: 1 << 14, rounds: 8, ..stochastic::Settings::default() });
    let solution = solve(&world, &in_medium(rays, 1e-3, COLORED), |_| ());
    println!("rays: {:.1e}, balance {:.1e}", off(mean(&solution), b), solution.balance.error());
    assert!(off(mean(&solution), b) < 0.02);
    // The twin: one σ for all channels.
    let twin = solve(&world, &in_medium(rays, 1e-3, [COLORED.iter().sum::<f64>() / 3.0; 3]), |_| ());
    assert!(off(mean(&twin), b) > 0.05);
}

#[test]
fn lamps_sensors_and_eyes_look_through_the_medium() {
    let lamp = LightKind::Point {
        position: DVec3::ZERO,
        unit: PhotometricUnit::Physical,
        attenuation: Attenuation::default(),
        range: f64::INFINITY,
    };
    let lamp = Light::new("lamp", Spectrum::WHITE * (100.0 / (4.0 * PI)) as f32, lamp);
    let settings = in_medium(Method::GaussSeidel, 1e-3, COLORED);
    let direct = COLORED.map(|sigma| 100.0 / (4.0 * PI) * (-sigma).exp());
    let truth: [f64; 3] = std::array::from_fn(|c| direct[c] / (1.0 - 0.8 * closed::sphere_transmittance(2.0 * COLORED[c])));
    // The eye in the middle sees what is left of the wall's radiance.
    let radiance: [f64; 3] = std::array::from_fn(|c| 0.8 * truth[c] / PI * (-COLORED[c]).exp());
    let off = |found: [f32; 3], truth: [f64; 3]| (0..3).map(|c| (f64::from(found[c]) / truth[c] - 1.0).abs()).fold(0.0, f64::max);
    let errors = [16, 32].map(|n| {
        let world = world(&sphere(1.0, &[(1.0, 0.0, 0.8)], n), vec![lamp.clone()]);
        let solution = solve(&world, &settings, |_| ());
        let gather = gather::Gather::new(&world, &solution, &[], 0);
        let display = display::Display::new(&world, &solution, &[], display::Settings::default(), Footprint::default());
        let (mut scratch, mut stream) = (gather::Scratch::default(), Stream::new(0, 0, 0));
        let mut errors = [0.0; 2];
        let n_looks = 64;
        for k in 0..n_looks {
            let dir = radiosa::sampling::warp::uniform_sphere(sequence::point_2d(k, 3));
            let ray = Ray::new(-world.origin().as_vec3(), dir);
            let hit = world.accel().closest(&ray).expect("a wall");
            let surface: Surface = world.surface(&ray, &hit);
            let towards: Vec3 = if surface.ng.dot(dir) < 0.0 { surface.ng } else { -surface.ng };
            let found = gather.at(&surface, towards, u64::from(k), &mut scratch).irradiance;
            let seen: Pixel = display.sample(&world, &ray, &mut stream, &mut 0);
            for (error, (found, truth)) in errors.iter_mut().zip([(found, truth), (seen.color, radiance)]) {
                *error += off(found.to_array(), truth) / f64::from(n_looks);
            }
        }
        errors
    });
    for (k, who) in ["sensors", "eyes"].into_iter().enumerate() {
        let order = (errors[0][k] / errors[1][k]).log2();
        println!("{who} off by {:.1e} and {:.1e} in the mean, order {order:.2}", errors[0][k], errors[1][k]);
        assert!(order > 1.5 && errors[1][k] < 0.03, "{who}: {errors:?}");
    }
    // The twins: a sensor's light, and the eye's, without the medium on the last part of the way.
    assert!(off(radiance.map(|l| l as f32), truth.map(|h| 0.8 * h / PI)) > 0.1);
}

#[test]
fn a_solve_in_a_medium_goes_on_after_an_interruption() {
    let world = globe(8, 1.0, 0.8).0;
    let blocks = Method::Shooting(shooting::Settings { batch: 3, ..shooting::Settings::default() });
    let rays = Method::Stochastic(stochastic::Settings { rays: 20_000, rounds: 2, ..stochastic::Settings::default() });
    for method in [Method::Jacobi, Method::GaussSeidel, blocks, rays] {
        let mut settings = in_medium(method, 1e-3, COLORED);
        settings.stop = Stop { residual: 1e-3, error: 1.0, ..settings.stop };
        let whole = solve(&world, &settings, |_| ());
        let division = Division::new(&world, &settings);
        for steps in [1, 3] {
            let mut first = Radiosity::new(&world, &division, &settings);
            for _ in 0..steps {
                first.step(&world);
            }
            // Through a file.
            let mut bytes = Vec::new();
            let mut out = radiosa::stream::Out(&mut bytes);
            first.solution().store(&mut out).expect("memory takes it");
            first.progress().store(&mut out).expect("memory takes it");
            let mut from = bytes.as_slice();
            let mut from = radiosa::stream::In(&mut from);
            let solution = Solution::restore(&world, 1 << 20, &mut from).expect("it is whole");
            let progress = radiosity::Progress::restore(&division, &settings, &solution.system, &mut from).expect("it is whole");
            let mut second = Radiosity::resume(&world, &division, &settings, solution, Some(progress));
            while let Step::Working { .. } = second.step(&world) {}
            assert_eq!(whole.radiosity, second.solution().radiosity, "{method:?}");
            assert_eq!(whole.balance, second.solution().balance, "{method:?}");
        }
    }
}
