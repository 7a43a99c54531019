//! Many lights without size: those that are drawn bring what all of them bring, in less time.
#![expect(clippy::print_stdout, reason = "tests say what they measured")]

mod common;

use std::fmt::Write as _;

use common::{scene_of, world_of};
use radiosa::math::{Ray, Vec3};
use radiosa::raytrace::path::{PathTracer, Settings};
use radiosa::sampling::Stream;
use radiosa::scene::Scene;
use radiosa::transport::{Integrator, World};
use rayon::prelude::*;

/// A floor with a box, a shiny, a metal and a rough glass ball on it.
const THINGS: &str = r#"
[material.floor]
lambert = [0.6, 0.5, 0.4]
[material.shiny]
phong = { diffuse = 0.3, specular = 0.5, exponent = 80 }
[material.metal]
cook_torrance = { fresnel = "gold", alpha = 0.15 }
[material.glass]
glass = { alpha = 0.3 }
[[shape]]
material = "floor"
quad = [[-5, 0, 5], [5, 0, 5], [5, 0, -5], [-5, 0, -5]]
[[shape]]
material = "floor"
box = { min = [-0.6, 0, -0.7], max = [0.4, 1.1, 0.3] }
[[shape]]
material = "shiny"
sphere = { center = [1.5, 0.7, 0.5], radius = 0.7 }
[[shape]]
material = "metal"
sphere = { center = [-1.7, 0.7, 0.5], radius = 0.7 }
[[shape]]
material = "glass"
sphere = { center = [0.1, 0.5, 1.6], radius = 0.5 }
"#;

/// Points with and without a range, physical and classic, spots of both kinds, and suns.
fn lit(n_points: usize, n_spots: usize, n_suns: usize) -> Scene {
    let mut text = THINGS.to_owned();
    let mut stream = Stream::new(77, 0, 0);
    let mut number = |from: f32, to: f32| from + (to - from) * stream.next_f32();
    for i in 0..n_points {
        let (x, y, z, i_r, i_b) = (number(-4.0, 4.0), number(1.6, 3.5), number(-4.0, 4.0), number(0.1, 2.0), number(0.1, 2.0));
        let kind = match i % 3 {
            0 => "unit = \"physical\"".to_owned(),
            1 => format!("unit = \"physical\"\nrange = {}", number(1.0, 6.0)),
            _ => "attenuation = [0.3, 0.2, 1.0]".to_owned(),
        };
        writeln!(text, "[light.p{i}]\npoint = [{x}, {y}, {z}]\nintensity = [{i_r}, 0.5, {i_b}]\n{kind}").expect("text");
    }
    for i in 0..n_spots {
        let (x, z, tx, tz, cutoff) =
            (number(-4.0, 4.0), number(-4.0, 4.0), number(-2.0, 2.0), number(-2.0, 2.0), number(10.0, 60.0));
        writeln!(
            text,
            "[light.s{i}]\nspot = {{ position = [{x}, 3, {z}], look_at = [{tx}, 0, {tz}], cutoff = {cutoff} }}\nintensity = 1"
        )
        .expect("text");
    }
    for i in 0..n_suns {
        let (x, z) = (number(-2.0, 2.0), number(-2.0, 2.0));
        writeln!(text, "[light.d{i}]\ndistant = {{ to_light = [{x}, 1, {z}] }}\nintensity = {}", number(0.0, 0.2)).expect("text");
    }
    scene_of(&text)
}

fn rays() -> Vec<Ray> {
    let eye = Vec3::new(0.0, 2.5, 6.0);
    let at = |i: i32, j: i32| {
        let target = Vec3::new(i as f32 * 0.55 + 0.1, 0.4 + 0.2 * j as f32, 1.0 - j as f32);
        Ray::new(eye, (target - eye).normalize())
    };
    (-4..=4).flat_map(|i| (0..3).map(move |j| at(i, j))).collect()
}

/// Mean luminance of a ray, the standard error of it, and the shadow rays and others it took.
fn mean(world: &World, ray: &Ray, settings: &Settings, spp: u32) -> (f64, f64, u64) {
    const SETS: u64 = 24;
    let method = PathTracer::new(world, settings);
    let mut n_rays = 0;
    let mut of_set = |set: u64| {
        let mut of = |sample| {
            let mut stream = Stream::new(5, set, u64::from(sample));
            f64::from(method.sample(world, ray, &mut stream, &mut n_rays).color.luminance())
        };
        (0..spp).map(&mut of).sum::<f64>() / f64::from(spp)
    };
    let sets: Vec<f64> = (0..SETS).map(&mut of_set).collect();
    let n = SETS as f64;
    let mean = sets.iter().sum::<f64>() / n;
    (mean, (sets.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / (n * (n - 1.0))).sqrt(), n_rays)
}

/// The largest |z| of all rays between lamps drawn in one scene and all of them in another.
fn largest_z(drawn_in: Scene, all_in: Scene, n: u32, spp: u32) -> f64 {
    let (drawn_in, all_in) = (world_of(drawn_in), world_of(all_in));
    let direct = |drawn_lamps| Settings { max_depth: Some(1), branches: 1, drawn_lamps, ..Settings::default() };
    let z = |ray: &Ray| {
        let (some, error, _) = mean(&drawn_in, ray, &direct(Some(n)), spp);
        // Without noise but where a rough boundary lets light through.
        let (all, own, _) = mean(&all_in, ray, &direct(None), 8);
        if all == 0.0 {
            return if some == 0.0 { 0.0 } else { f64::INFINITY };
        }
        assert!(error < 0.1 * all, "{some} ± {error} for {all}");
        (some - all).abs() / (error.hypot(own) + 1e-6 * all)
    };
    rays().par_iter().map(z).reduce(|| 0.0, f64::max)
}

#[test]
fn lamps_that_are_drawn_bring_what_all_bring() {
    for (k, (points, spots, suns)) in [(60, 20, 12), (9, 0, 0), (0, 40, 3), (3, 2, 30)].into_iter().enumerate() {
        let z = largest_z(lit(points, spots, suns), lit(points, spots, suns), 1 + k as u32, 600);
        println!("{points} points, {spots} spots, {suns} suns: |z| ≤ {z:.2}");
        // Of 23 degrees of freedom: one false alarm in a thousand for 27 rays.
        assert!(z < 4.8);
    }
    // The twin has lost one of ninety lamps.
    let mut less = lit(60, 20, 12);
    less.lights.remove(2);
    let z = largest_z(less, lit(60, 20, 12), 2, 600);
    assert!(z > 8.0, "a twin without one lamp is not caught: {z}");
}

#[test]
fn in_fog_as_well() {
    let fog = |scene: Scene| {
        let medium = scene_of("[medium]\nscattering = 0.3\nasymmetry = 0.3\n").medium;
        world_of(Scene { medium, ..scene })
    };
    let world = fog(lit(30, 10, 0));
    let settings = |drawn_lamps| Settings { max_depth: Some(1), branches: 1, drawn_lamps, ..Settings::default() };
    for ray in rays().iter().step_by(9) {
        let (some, error, _) = mean(&world, ray, &settings(Some(2)), 1500);
        let (all, own, _) = mean(&world, ray, &settings(None), 500);
        assert!((some - all).abs() < 4.8 * error.hypot(own) && error.hypot(own) < 0.03 * all, "{some} ± {error}, {all} ± {own}");
        assert!((some * 0.85 - all).abs() > 4.8 * error.hypot(own), "a twin of 15 % is not caught");
    }
}

#[test]
fn drawing_from_two_hundred_lamps_pays() {
    let world = world_of(lit(200, 0, 0));
    let cost = |drawn_lamps| {
        let settings = Settings { drawn_lamps, ..Settings::default() };
        let of = |ray: &Ray| {
            let (mean, error, n_rays) = mean(&world, ray, &settings, 4);
            (error / mean).powi(2) * n_rays as f64
        };
        rays().par_iter().map(of).sum::<f64>()
    };
    let all = cost(None);
    for n in [1, 2, 4, 8] {
        let gain = all / cost(Some(n));
        println!("{n} drawn: rays × variance {gain:.1} times smaller than of all 200");
        assert!(n != 2 || gain > 3.0);
    }
}
