//! Participating media against closed forms and against independent numeric answers, each with a twin that is wrong and caught.
#![expect(clippy::print_stdout, reason = "tests say what they measured")]

mod common;

use std::f64::consts::{PI, TAU};

use common::chi_square::Cells;
use common::{scene_of, world_of};
use radiosa::bsdf::phase::Phase;
use radiosa::film::{Decomposition, Filter, Layer, Sampling};
use radiosa::math::{Ray, Vec3};
use radiosa::raytrace::path::{PathTracer, Settings};
use radiosa::raytrace::tiles::TiledRender;
use radiosa::sampling::Stream;
use radiosa::transport::{Integrator, Solver, Step, View, World};
use rayon::prelude::*;

/// Mean radiance by channel along a ray, and its standard error from independent sets of samples.
fn radiance(world: &World, ray: &Ray, spp: u32, max_depth: Option<u32>) -> [(f64, f64); 3] {
    const SETS: u64 = 32;
    let ray = &Ray { origin: ray.origin - world.origin().as_vec3(), ..*ray };
    let settings = Settings { eye: Some(ray.origin), max_depth, branches: 1, ..Settings::default() };
    let method = PathTracer::new(world, &settings);
    let of_set = |set: u64| {
        let mut sum = [0.0; 3];
        for sample in 0..spp {
            let mut stream = Stream::new(11, set, u64::from(sample));
            let color = method.sample(world, ray, &mut stream, &mut 0).color.to_array();
            sum.iter_mut().zip(color).for_each(|(sum, c)| *sum += f64::from(c));
        }
        sum.map(|s: f64| s / f64::from(spp))
    };
    let sets: Vec<[f64; 3]> = (0..SETS).into_par_iter().map(of_set).collect();
    std::array::from_fn(|c| {
        let n = SETS as f64;
        let mean = sets.iter().map(|s| s[c]).sum::<f64>() / n;
        let spread = sets.iter().map(|s| (s[c] - mean).powi(2)).sum::<f64>() / (n * (n - 1.0));
        (mean, spread.sqrt())
    })
}

/// Within four and a half standard errors (of 31 degrees of freedom: one false alarm in ten thousand), which must themselves be below a part of the truth.
fn agrees((mean, error): (f64, f64), truth: f64, precision: f64) -> bool {
    (mean - truth).abs() < 4.5 * error + 1e-5 * truth && error < precision * truth
}

fn henyey_greenstein(g: f64, cos: f64) -> f64 {
    (1.0 - g * g) / (4.0 * PI * (1.0 + g * g - 2.0 * g * cos).powf(1.5))
}

/// A glowing wall at z = −3 seen from z = 2, and what is between.
fn before_a_wall(between: &str) -> World {
    world_of(scene_of(&format!(
        r#"
[material.wall]
lambert = 0
emission = [2, 3, 5]
[[shape]]
material = "wall"
quad = [[-50, -50, -3], [50, -50, -3], [50, 50, -3], [-50, 50, -3]]
{between}
"#
    )))
}

const AHEAD: Ray = Ray { origin: Vec3::new(0.1, 0.2, 2.0), dir: Vec3::NEG_Z, t_max: f32::INFINITY };

/// A slab from z = −1 to 1.5 of a material.
fn slab(material: &str) -> String {
    format!(
        r#"
[material.slab]
{material}
[[shape]]
material = "slab"
box = {{ min = [-5, -5, -1], max = [5, 5, 1.5] }}
"#
    )
}

#[test]
fn light_is_weakened_exponentially() {
    let sigma = [0.3, 0.8, 0.1f64];
    let emitted = [2.0, 3.0, 5.0];
    let fog = "[medium]\nabsorption = [0.3, 0.8, 0.1]\n";
    let body = slab("medium = { absorption = [0.3, 0.8, 0.1] }");
    for (between, distance) in [(fog, 5.0), (body.as_str(), 2.5)] {
        let found = radiance(&before_a_wall(between), &AHEAD, 1, None);
        for c in 0..3 {
            let truth = emitted[c] * (-sigma[c] * distance).exp();
            assert!((found[c].0 - truth).abs() < 2e-6 * truth, "{} for {truth}", found[c].0);
        }
        // The twin is half a per cent longer.
        assert!((found[0].0 - emitted[0] * (-sigma[0] * distance * 1.005_f64).exp()).abs() > 1e-3 * found[0].0);
    }
    // What is scattered is lost to its direction as well: with no scattering followed, that is all.
    let fog = "[medium]\nabsorption = [0.1, 0.2, 0]\nscattering = [0.2, 0.6, 0.1]\n";
    let body = slab("medium = { absorption = [0.1, 0.2, 0], scattering = [0.2, 0.6, 0.1] }");
    for (between, distance) in [(fog, 5.0), (body.as_str(), 2.5)] {
        let found = radiance(&before_a_wall(between), &AHEAD, 2000, Some(0));
        for c in 0..3 {
            let truth = emitted[c] * (-sigma[c] * distance).exp();
            assert!(agrees(found[c], truth, 0.02), "{:?} for {truth}", found[c]);
        }
        assert!(!agrees(found[1], emitted[1] * (-0.6_f64 * distance).exp(), 0.02), "a twin without absorption is not caught");
    }
}

#[test]
fn a_medium_glows_as_long_as_one_looks_through_it() {
    let (sigma, glow) = ([0.4, 0.8, 0.0], [0.5, 0.2, 0.3]);
    let body = slab("medium = { absorption = [0.4, 0.8, 0], emission = [0.5, 0.2, 0.3] }");
    let found = radiance(&before_a_wall(&body), &AHEAD, 1, None);
    for c in 0..3 {
        let (s, d): (f64, f64) = (sigma[c], 2.5);
        let own = if s > 0.0 { glow[c] * (1.0 - (-s * d).exp()) / s } else { glow[c] * d };
        let truth = [2.0, 3.0, 5.0][c] * (-s * d).exp() + own;
        assert!((found[c].0 - truth).abs() < 3e-6 * truth, "{} for {truth}", found[c].0);
    }
    // A glowing ball around the place of a sensor: E = π ε (1 − exp(−σ r))/σ, through a medium that also scatters without loss the same as without.
    let world = world_of(scene_of(
        r#"
[material.a]
medium = { absorption = 0.7, emission = 1.5 }
[[shape]]
material = "a"
sphere = { radius = 2 }
"#,
    ));
    let method = PathTracer::new(&world, &Settings::default());
    let place = radiosa::transport::Surface::in_space(Vec3::ZERO, Vec3::ZERO, Vec3::Y);
    let (e, _) = method.irradiance(&world, &place, Vec3::Y, 256, 3);
    let truth = PI * 1.5 * (1.0 - (-1.4f64).exp()) / 0.7;
    assert!((f64::from(e.g) - truth).abs() < 1e-3 * truth, "{} for {truth}", e.g);
}

/// How far along a ray a lamp stands, and how far from it.
const AT: f64 = 4.0;
const HEIGHT: f64 = 1.5;

/// Simpson's rule.
fn integral(from: f64, to: f64, n: u32, f: impl Fn(f64) -> f64) -> f64 {
    let h = (to - from) / f64::from(n);
    let weight = |i: u32| match i {
        0 => 1.0,
        i if i == n => 1.0,
        i => 2.0 + 2.0 * f64::from(i % 2),
    };
    (0..=n).map(|i| weight(i) * f(from + h * f64::from(i))).sum::<f64>() * h / 3.0
}

/// Light of a point source of 1 W/sr that is scattered once on the way from `end` metres away: the integral of Sun and others (A Practical Analytic Single Scattering
/// Model for Real Time Rendering, 2005), by quadrature over the angle under which the source is seen, along which the inverse square cancels. `g` may be wrong, and
/// the way from the lamp left out, for twins.
fn airlight([sigma_s, sigma_t, g]: [f64; 3], end: f64, on_both_ways: bool) -> f64 {
    let of = |angle: f64| {
        let (t, r) = (AT + HEIGHT * angle.tan(), HEIGHT / angle.cos());
        let way = if on_both_ways { t + r } else { t };
        henyey_greenstein(g, (AT - t) / r) * (-sigma_t * way).exp() / HEIGHT
    };
    sigma_s * integral((-AT / HEIGHT).atan(), ((end - AT) / HEIGHT).atan(), 20_000, of)
}

/// Along −z, a lamp of some kind `HEIGHT` above the ray after `AT` metres.
fn beside_a_lamp(lamp: &str, medium: &str, rest: &str) -> (World, Ray) {
    let text = format!("{medium}\n{}\n{rest}", lamp.replace("HERE", &format!("[0.3, {}, {}]", 0.2 + HEIGHT, 2.0 - AT)));
    (world_of(scene_of(&text)), Ray::new(Vec3::new(0.3, 0.2, 2.0), Vec3::NEG_Z))
}

#[test]
fn fog_around_a_lamp_is_as_bright_as_single_scattering_says() {
    let lamp = "[light.a]\npoint = HERE\nintensity = 1\nunit = \"physical\"\n";
    let (absorption, scattering) = ([0.02, 0.0, 0.3], [0.05, 0.2, 0.1]);
    for g in [0.0, 0.6, -0.4] {
        let medium = format!("absorption = {absorption:?}\nscattering = {scattering:?}\nasymmetry = {g}\n");
        let fog = format!("[medium]\n{medium}");
        let wall = "[material.wall]\nlambert = 0\n[[shape]]\nmaterial = \"wall\"\nquad = [[-9, -9, -5], [9, -9, -5], [9, 9, -5], [-9, 9, -5]]\n";
        let inline = medium.trim().replace('\n', ", ");
        let body = format!(
            "[material.a]\nmedium = {{ {inline} }}\n[[shape]]\nmaterial = \"a\"\nbox = {{ min = [-99, -99, -5], max = [99, 99, 50] }}\n"
        );
        for (medium, rest, end) in [(fog.as_str(), "", 1e6), (fog.as_str(), wall, 7.0), ("", body.as_str(), 7.0)] {
            let (world, ray) = beside_a_lamp(lamp, medium, rest);
            let found = radiance(&world, &ray, 500, Some(1));
            for c in 0..3 {
                let [s, t] = [scattering[c], scattering[c] + absorption[c]];
                let truth = airlight([s, t, g], end, true);
                assert!(agrees(found[c], truth, 0.03), "g {g}, channel {c}: {:?} for {truth}", found[c]);
                assert!(
                    !agrees(found[c], airlight([s, t, g], end, false), 0.03),
                    "a twin without loss from the lamp on is not caught"
                );
                assert!(
                    !agrees(found[c], airlight([s, t, g + 0.15], end, true), 0.03),
                    "a twin of another asymmetry is not caught"
                );
            }
        }
    }
}

#[test]
fn fog_below_a_glowing_square_is_as_bright_as_single_scattering_says() {
    // Found by points on the square and by scattered rays together.
    let (a, emitted, sigma_s, sigma_t) = (0.8, 2.0, 0.15, 0.2);
    let (y, z) = (0.2 + HEIGHT, 2.0 - AT);
    for g in [0.0, 0.8] {
        let lamp = format!(
            "[material.a]\nlambert = 0\nemission = {emitted}\n[[shape]]\nmaterial = \"a\"\nquad = [[{}, {y}, {}], [{}, {y}, {}], [{}, {y}, {}], [{}, {y}, {}]]\n",
            0.3 - a,
            z - a,
            0.3 + a,
            z - a,
            0.3 + a,
            z + a,
            0.3 - a,
            z + a
        );
        let medium = format!("[medium]\nabsorption = 0.05\nscattering = {sigma_s}\nasymmetry = {g}\n");
        let (world, ray) = beside_a_lamp(&lamp, &medium, "");
        let at = |t: f64| {
            let of = |across: f64, along: f64| {
                let r = (across * across + along * along + HEIGHT * HEIGHT).sqrt();
                henyey_greenstein(g, along / r) * (-sigma_t * (t + r)).exp() * HEIGHT / r.powi(3)
            };
            integral(-a, a, 16, |across| integral(AT - t - a, AT - t + a, 16, |along| of(across, along)))
        };
        let truth = emitted * sigma_s * (integral(0.0, 12.0, 600, at) + integral(12.0, 80.0, 300, at));
        let found = radiance(&world, &ray, 3000, Some(1))[1];
        println!("g {g}: {found:?} for {truth}");
        assert!(agrees(found, truth, 0.02), "{found:?} for {truth}");
        assert!(!agrees(found, truth * 1.05, 0.02), "a twin of 5 % is not caught");
    }
}

/// A ball of some material in surroundings of radiance 1.
fn ball_in_the_furnace(material: &str) -> radiosa::scene::Scene {
    scene_of(&format!(
        "[environment]\nradiance = 1\n[material.a]\n{material}\n[[shape]]\nmaterial = \"a\"\nsphere = {{ radius = 1 }}\n"
    ))
}

#[test]
fn what_absorbs_nothing_is_unseen_in_uniform_light() {
    let ray = Ray::new(Vec3::new(0.3, 0.2, 2.0), Vec3::NEG_Z);
    let lossless = [
        "medium = { scattering = [4, 1, 0.2], asymmetry = 0.5 }",
        "medium = { scattering = [0, 8, 1], asymmetry = -0.7 }",
        "glass = { ior = 1.5, scattering = [3, 1, 0.5] }",
        "glass = { ior = 1.3, alpha = 0.05, scattering = 1, asymmetry = 0.8 }",
    ];
    for (k, material) in lossless.into_iter().enumerate() {
        let found = radiance(&world_of(ball_in_the_furnace(material)), &ray, 400, None);
        println!("{material}: {found:?}");
        // Facets lose what shadows them twice.
        let loss = if k == 3 { 0.01 } else { 0.0 };
        for (mean, error) in found {
            assert!((mean - 1.0).abs() < 4.5 * error + 1e-4 + loss && error < 0.02, "{material}: {mean} ± {error}");
        }
    }
    // Surroundings that are a picture, to be drawn from.
    let mut scene = ball_in_the_furnace(lossless[0]);
    let pixels = radiosa::scene::Pixels::Rgba32F(vec![1.0; 4 * 32 * 16].into());
    scene.images.push(radiosa::scene::Image { name: String::new(), width: 32, height: 16, pixels });
    let environment = scene.environment.as_mut().expect("it has one");
    environment.radiance = radiosa::scene::EnvironmentRadiance::Map(radiosa::scene::ImageId(0));
    for (mean, error) in radiance(&world_of(scene), &ray, 400, None) {
        assert!((mean - 1.0).abs() < 4.5 * error + 1e-3 && error < 0.02, "before a map: {mean} ± {error}");
    }
    // The twin absorbs one part in two hundred.
    let lossy = "medium = { absorption = 0.02, scattering = 4, asymmetry = 0.5 }";
    let (mean, error) = radiance(&world_of(ball_in_the_furnace(lossy)), &ray, 400, None)[0];
    assert!(mean < 1.0 - 6.0 * error - 1e-3, "{mean} ± {error}");
}

#[test]
fn a_room_in_equilibrium_shows_one_through_any_fog() {
    // Kirchhoff: what absorbs σ_a emits σ_a times the radiance around it.
    for (medium, truth) in [
        ("scattering = [0.7, 0.1, 2]\nasymmetry = 0.4\n", 1.0),
        ("absorption = [0.4, 0.1, 1]\nscattering = [0.6, 2, 0]\nemission = [0.4, 0.1, 1]\n", 1.0),
        // The twin glows half as much.
        ("absorption = 0.4\nscattering = 0.6\nemission = 0.2\n", 0.8),
    ] {
        let world = world_of(scene_of(&format!("[medium]\n{medium}{}", common::FURNACE)));
        let ray = Ray::new(Vec3::new(0.8, 0.7, 0.9), Vec3::new(-0.6, -0.64, -0.48));
        for (mean, error) in radiance(&world, &ray, 1000, None) {
            let is_one = (mean - 1.0).abs() < 4.5 * error + 1e-5 && error < 8e-3;
            assert!(is_one == (truth == 1.0), "{medium}: {mean} ± {error}");
        }
        if truth == 1.0 {
            let floor = common::below(&world, Vec3::new(0.5, -1.0, 0.5), Vec3::Y);
            let (e, error) = PathTracer::new(&world, &Settings::default()).irradiance(&world, &floor, Vec3::Y, 1 << 14, 5);
            let e = f64::from(e.luminance());
            assert!((e - PI).abs() < 4.5 * error && error < 0.02, "{e} ± {error}");
        }
    }
}

#[test]
fn directions_follow_the_phase_function_and_it_is_normalised() {
    let wo = Vec3::new(0.36, -0.48, 0.8);
    for g in [-0.9, -0.4, 0.0, 0.3, 0.7, 0.95] {
        let phase = Phase { asymmetry: g as f32 };
        // Along a great circle through wo: over all turns about it.
        let across = wo.cross(Vec3::X).normalize();
        let of = |cos: f64| f64::from(phase.evaluate(wo, -wo * cos as f32 + across * (1.0 - cos * cos).max(0.0).sqrt() as f32));
        let whole = TAU * integral(-1.0, 1.0, 200_000, of);
        let mean = TAU * integral(-1.0, 1.0, 200_000, |cos| cos * of(cos));
        assert!((whole - 1.0).abs() < 1e-4 && (mean - g).abs() < 1e-4, "{g}: {whole}, {mean}");
        let cells = Cells { lowest: -1.0, rows: 24, columns: 24, fine: 12 };
        let chi = |as_if: Phase| {
            cells.chi_square(400_000, |stream| Some(phase.sample(wo, stream.next_2d())), |wi| as_if.evaluate(wo, wi))
        };
        let (z, n) = chi(phase);
        let (twin, _) = chi(Phase { asymmetry: (g * 0.96 + 0.05) as f32 });
        println!("g {g}: χ² of {n} cells, z {z:.2}, of the twin {twin:.1}");
        assert!(z < 5.0 && n > 60.0 && twin > 8.0);
    }
}

/// A slab of `depth` below y = 0 and what lights it, seen under the cosine `mu`, from the side of x or from the side of z.
fn on_a_slab(material: &str, depth: f64, light: &str) -> World {
    world_of(scene_of(&format!(
        "{light}\n[material.a]\n{material}\n[[shape]]\nmaterial = \"a\"\nbox = {{ min = [-300, -{depth}, -300], max = [300, 0, 300] }}\n"
    )))
}

fn to_the_slab(mu: f64, phi: f64) -> Ray {
    let towards = towards(mu, phi);
    Ray::new(towards * 3.0, -towards)
}

/// Unit, up from the slab.
fn towards(mu: f64, phi: f64) -> Vec3 {
    let sin = (1.0 - mu * mu).sqrt();
    Vec3::new((sin * phi.cos()) as f32, mu as f32, (sin * phi.sin()) as f32).normalize()
}

fn sun(mu: f64, phi: f64) -> String {
    let d = towards(mu, phi);
    format!("[light.sun]\ndistant = {{ to_light = [{}, {}, {}] }}\nintensity = 1\nunit = \"physical\"\n", d.x, d.y, d.z)
}

#[test]
fn slabs_reflect_alike_both_ways() {
    let [a, b] = [(0.9, 0.3), (0.35, 2.0)];
    for material in [
        "medium = { absorption = [0.1, 0.5, 1], scattering = [1, 2, 0.8], asymmetry = 0.6 }",
        "glass = { ior = 1.4, alpha = 0.4, absorption = [0.02, 0.1, 0.2], scattering = 3, asymmetry = 0.3 }",
    ] {
        let seen = |from: (f64, f64), lit: (f64, f64)| {
            let world = on_a_slab(material, 3.0, &sun(lit.0, lit.1));
            radiance(&world, &to_the_slab(from.0, from.1), 2500, None).map(|(mean, error)| (mean / lit.0, error / lit.0))
        };
        let (there, back) = (seen(a, b), seen(b, a));
        println!("{there:?}\n{back:?}");
        for ((x, dx), (y, dy)) in there.into_iter().zip(back) {
            assert!((x - y).abs() < 4.5 * dx.hypot(dy) && dx.hypot(dy) < 0.05 * x, "{material}: {x} ± {dx}, {y} ± {dy}");
            // The twin forgets which cosine belongs to which.
            assert!((x * b.0 - y * a.0).abs() > 4.5 * dx.hypot(dy), "{material}: the twin is not caught");
        }
    }
}

/// Chandrasekhar's H-function of isotropic scattering of albedo ω (Radiative Transfer, 1950, §33), on the nodes of Gauss's rule over `[0, 1]` and anywhere else:
/// `1/H(μ) = √(1 − ω) + ω/2 ∫₀¹ μ′ H(μ′)/(μ + μ′) dμ′`.
struct HFunction {
    albedo: f64,
    nodes: Vec<(f64, f64, f64)>,
}

impl HFunction {
    fn new(albedo: f64) -> Self {
        let n = 64;
        let node = |k: usize| {
            let mut x = (PI * (k as f64 + 0.75) / (n as f64 + 0.5)).cos();
            let mut slope = 1.0;
            for _ in 0..50 {
                let (mut p0, mut p1) = (1.0, x);
                for j in 2..=n {
                    let j = j as f64;
                    (p0, p1) = (p1, ((2.0 * j - 1.0) * x * p1 - (j - 1.0) * p0) / j);
                }
                slope = n as f64 * (x * p1 - p0) / (x * x - 1.0);
                x -= p1 / slope;
            }
            (0.5 * (1.0 + x), 1.0 / ((1.0 - x * x) * slope * slope), 1.0)
        };
        let mut h = Self { albedo, nodes: (0..n).map(node).collect() };
        for _ in 0..2000 {
            let next: Vec<f64> = h.nodes.iter().map(|node| 0.5 * (node.2 + h.at(node.0))).collect();
            h.nodes.iter_mut().zip(next).for_each(|(node, value)| node.2 = value);
        }
        h
    }

    fn at(&self, mu: f64) -> f64 {
        let sum: f64 = self.nodes.iter().map(|(x, weight, h)| weight * x * h / (mu + x)).sum();
        1.0 / ((1.0 - self.albedo).sqrt() + 0.5 * self.albedo * sum)
    }
}

#[test]
fn a_half_space_reflects_as_chandrasekhars_h_function_says() {
    // H(1) of a conservative medium is 2.9078 (his table XI), and ∫ H dμ = 2 (1 − √(1 − ω))/ω of every medium.
    assert!((HFunction::new(1.0).at(1.0) - 2.9078).abs() < 2e-3);
    let h = HFunction::new(0.9);
    let mean: f64 = h.nodes.iter().map(|(_, weight, h)| weight * h).sum();
    assert!((mean - 2.0 * (1.0 - 0.1_f64.sqrt()) / 0.9).abs() < 1e-9, "{mean}");
    let albedos = [0.5, 0.8, 0.95];
    let functions = albedos.map(HFunction::new);
    let material = "medium = { absorption = [0.5, 0.2, 0.05], scattering = [0.5, 0.8, 0.95] }";
    for (mu, mu0) in [(1.0, 0.6), (0.4, 0.8), (0.2, 0.3)] {
        let found = radiance(&on_a_slab(material, 60.0, &sun(mu0, 2.0)), &to_the_slab(mu, 0.5), 2500, None);
        for c in 0..3 {
            let of = |albedo: f64| albedo / (4.0 * PI) * mu0 / (mu + mu0) * functions[c].at(mu) * functions[c].at(mu0);
            let truth = of(albedos[c]);
            println!("ω {}, μ {mu}, μ₀ {mu0}: {:?} for {truth}", albedos[c], found[c]);
            assert!(agrees(found[c], truth, 0.02), "{:?} for {truth}", found[c]);
            assert!(!agrees(found[c], of((albedos[c] * 1.08).min(1.0)), 0.02), "a twin of 8 % is not caught");
        }
    }
    // Lit by a sky from above: the plane albedo, 1 − H(μ) √(1 − ω).
    let sky = "[light.sky]\nhemispherical = { down = 0 }\nintensity = 1\n";
    let found = radiance(&on_a_slab(material, 60.0, sky), &to_the_slab(0.7, 0.5), 3000, None);
    for c in 0..3 {
        let truth = 1.0 - functions[c].at(0.7) * (1.0 - albedos[c]).sqrt();
        assert!(agrees(found[c], truth, 0.02), "plane albedo: {:?} for {truth}", found[c]);
    }
}

/// Fractions of light entering a slab of optical depth `depth` under the cosine `mu` that come back and go through: a plain random walk in f64 with its own
/// numbers and a table of the phase function's distribution.
fn by_random_walk(depth: f64, albedo: f64, g: f64, mu: f64, n: u32) -> [f64; 2] {
    const STEPS: usize = 20_000;
    let mut table = vec![0.0; STEPS + 1];
    for i in 0..STEPS {
        let cos = -1.0 + 2.0 * (i as f64 + 0.5) / STEPS as f64;
        table[i + 1] = table[i] + henyey_greenstein(g, cos) * TAU * 2.0 / STEPS as f64;
    }
    let whole = table[STEPS];
    let mut out = [0.0; 2];
    let mut stream = Stream::new(101, 1, 0);
    let mut uniform = || f64::from(stream.next_u32()) / 4_294_967_296.0;
    for _ in 0..n {
        let (mut z, mut mu, mut weight) = (0.0, mu, 1.0);
        loop {
            z -= mu * (1.0 - uniform()).ln();
            if z < 0.0 || z > depth {
                out[usize::from(z > depth)] += weight / f64::from(n);
                break;
            }
            weight *= albedo;
            let at = uniform() * whole;
            let k = table.partition_point(|t| *t <= at).clamp(1, STEPS);
            let within = (at - table[k - 1]) / (table[k] - table[k - 1]);
            let cos = -1.0 + 2.0 * (k as f64 - 1.0 + within) / STEPS as f64;
            let phi = TAU * uniform();
            mu = (mu * cos + ((1.0 - mu * mu) * (1.0 - cos * cos)).max(0.0).sqrt() * phi.cos()).clamp(-1.0, 1.0);
        }
    }
    out
}

#[test]
fn slabs_reflect_and_pass_as_a_plain_random_walk_does() {
    let (sigma_s, sigma_a, g) = (0.9, 0.1, 0.7);
    let material = format!("medium = {{ absorption = {sigma_a}, scattering = {sigma_s}, asymmetry = {g} }}");
    for mu in [0.9, 0.3] {
        let mut truth = by_random_walk(2.0, 0.9, g, mu, 2_000_000);
        // The eye itself sees no hemispherical light straight through the slab.
        let straight = (-2.0 / mu).exp();
        truth[1] -= straight;
        for (k, sky) in ["down = 0 }\nintensity = 1", "down = 1 }\nintensity = 0"].into_iter().enumerate() {
            let world = on_a_slab(&material, 2.0, &format!("[light.sky]\nhemispherical = {{ {sky}\n"));
            let found = radiance(&world, &to_the_slab(mu, 0.2), 4000, None)[1];
            println!("μ {mu}: {found:?} for {}", truth[k]);
            // The walk's own standard error is below 4e-4.
            assert!(
                (found.0 - truth[k]).abs() < 4.5 * found.1.hypot(4e-4) && found.1 < 0.01 * truth[k],
                "{found:?} for {}",
                truth[k]
            );
            let twin = by_random_walk(2.0, 0.9, g - 0.1, mu, 400_000)[k] - [0.0, straight][k];
            assert!((found.0 - twin).abs() > 4.5 * found.1.hypot(8e-4), "a twin of another asymmetry is not caught: {twin}");
        }
    }
}

#[test]
fn a_boundary_that_does_nothing_is_not_seen() {
    let scene = |body: &str| {
        format!(
            r#"
[material.floor]
lambert = 0.5
[[shape]]
material = "floor"
quad = [[-3, 0, 3], [3, 0, 3], [3, 0, -3], [-3, 0, -3]]
[material.lamp]
lambert = 0
emission = 3
[[shape]]
material = "lamp"
quad = [[-0.3, 2, -0.3], [0.3, 2, -0.3], [0.3, 2, 0.3], [-0.3, 2, 0.3]]
[light.a]
point = [1, 3, 1]
intensity = 4
[material.nothing]
{body}
[[shape]]
material = "nothing"
sphere = {{ center = [0, 1, 0], radius = 0.8 }}
"#
        )
    };
    let ray = Ray::new(Vec3::new(0.0, 1.5, 2.5), Vec3::new(0.0, -1.5, -2.5).normalize());
    let of = |body: &str| radiance(&world_of(scene_of(&scene(body))), &ray, 40, None);
    let (without, with) = (of("opacity = 0"), of("medium = { asymmetry = 0.5 }"));
    for c in 0..3 {
        let ((x, dx), (y, dy)) = (without[c], with[c]);
        assert!((x - y).abs() < 4.5 * dx.hypot(dy) + 1e-6 && dx < 0.02 * x, "{x} ± {dx}, {y} ± {dy}");
    }
    // The twin is tinted glass.
    assert!((of("glass = { ior = 1, transmission = 0.9 }")[0].0 - without[0].0).abs() > 0.05 * without[0].0);
}

/// A lamp behind slats in fog, and a glass of milk.
const SHAFTS: &str = r#"
[medium]
scattering = 0.15
asymmetry = 0.5
[camera.c]
position = [0, 1, 4]
look_at = [0, 1, 0]
[light.lamp]
spot = { position = [0, 3.5, -2], look_at = [0, 0, 0.5], cutoff = 50 }
intensity = 30
[material.slats]
lambert = 0.3
[[shape]]
material = "slats"
box = [
  { min = [-2, 2.4, -2], max = [-0.6, 2.5, 2] },
  { min = [-0.4, 2.4, -2], max = [0.4, 2.5, 2] },
  { min = [0.6, 2.4, -2], max = [2, 2.5, 2] },
]
[[shape]]
material = "slats"
quad = [[-4, 0, 4], [4, 0, 4], [4, 0, -4], [-4, 0, -4]]
[material.milk]
glass = { ior = 1.34, scattering = [6, 7, 8], absorption = [0.1, 0.2, 0.6], asymmetry = 0.6 }
[[shape]]
material = "milk"
sphere = { center = [0.5, 0.6, 0.5], radius = 0.5 }
"#;

fn picture(world: &World, layers: &[Layer]) -> radiosa::film::Film {
    let view = View::new(&world.scene().cameras[0], world.origin(), 40, 40);
    let method = PathTracer::new(world, &Settings { eye: Some(view.eye()), ..Settings::default() });
    let sampling = Sampling { width: 40, height: 40, spp: 3, filter: Filter::Box, seed: 0, layers: layers.to_vec() };
    let mut render = TiledRender::new(&method, &view, sampling).expect("a film");
    while let Step::Working { .. } = render.step(world) {}
    render.into_film()
}

#[test]
fn fog_has_the_same_bits_at_any_number_of_threads_and_its_layers_sum_to_it() {
    let world = world_of(scene_of(SHAFTS));
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| picture(&world, &[Layer::Color]))
    };
    let one = with(1);
    assert!([2, 3].into_iter().all(|threads| with(threads) == one));
    let clear = world_of(scene_of(&SHAFTS.replace("scattering = 0.15", "scattering = 0.16")));
    assert!(picture(&clear, &[Layer::Color]) != one);
    let mut layers = vec![Layer::Color];
    for decomposition in [Decomposition::Lobe, Decomposition::Path] {
        layers.extend(decomposition.layers().iter().filter(|l| !layers.contains(l)).copied().collect::<Vec<_>>());
    }
    let film = picture(&world, &layers);
    for decomposition in [Decomposition::Lobe, Decomposition::Path] {
        let error = film.decomposition_error(decomposition);
        assert!(error.is_some_and(|e| e < 1e-4), "{error:?}");
    }
}

#[test]
fn scene_files_give_media_by_their_own_unit() {
    let text = r#"
scale = 0.01
[medium]
absorption = 0.002
scattering = [0.01, 0.02, 0.03]
asymmetry = -0.3
[material.smoke]
medium = { emission = 0.5, scattering = 1 }
[material.milk]
glass = { absorption = 0.1, scattering = 2, asymmetry = 0.9 }
[material.like-milk]
like = "milk"
two_sided = true
[material.matt]
like = "milk"
lambert = 0.5
"#;
    let scene = scene_of(text);
    let near =
        |a: radiosa::spectrum::Spectrum, b: [f32; 3]| a.to_array().iter().zip(b).all(|(a, b)| (a - b).abs() <= 1e-5 * b.abs());
    let fog = scene.medium.expect("it has one");
    assert!(near(fog.absorption, [0.2; 3]) && near(fog.inside.scattering, [1.0, 2.0, 3.0]) && fog.inside.asymmetry == -0.3);
    assert!(near(fog.extinction(), [1.2, 2.2, 3.2]));
    let [smoke, milk, like, matt] = [0, 1, 2, 3].map(|i| scene.materials[i].medium());
    assert!(smoke.is_some_and(|m| near(m.inside.emission, [50.0; 3]) && near(m.extinction(), [100.0; 3])));
    assert!(milk.is_some_and(|m| near(m.absorption, [10.0; 3]) && m.inside.asymmetry == 0.9) && like == milk && matt.is_none());
    assert!(scene.has_media() && !scene_of("[material.a]\nglass = { absorption = 3 }").has_media());
    let mut larger = scene;
    larger.transform(radiosa::math::DMat3::IDENTITY, 2.0);
    assert!(larger.medium.is_some_and(|m| near(m.extinction(), [0.6, 1.1, 1.6])));
    let read = |text: &str| radiosa::import::load_bytes(text.as_bytes(), std::path::Path::new("a.toml"), &Default::default());
    for (wrong, said) in [
        ("[medium]\nscatering = 1\n", "unknown key"),
        ("[medium]\nasymmetry = 1\n", "a number from -0.99 to 0.99"),
        ("[material.a]\nthin_glass = { scattering = 1 }\n", "no inside"),
        ("[material.a]\nmedium = { scattering = 1 }\nglass = {}\n", "both"),
    ] {
        let error = read(wrong).err().map(|e| e.to_string()).unwrap_or_default();
        assert!(error.contains(said), "{wrong}: {error}");
    }
}
