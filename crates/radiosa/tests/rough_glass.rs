//! Rough boundaries between media: what they reflect and let through, which way, and what is seen through them.
#![expect(clippy::print_stdout, reason = "tests say what they measured")]

mod common;

use std::f64::consts::{PI, TAU};

use common::chi_square::Cells;
use common::{scene_of, world_of};
use radiosa::bsdf::{Bsdf, FactorsOnly, Highlights, Scatter, Way};
use radiosa::math::{DVec3, Ray, Vec3};
use radiosa::raytrace::path::{PathTracer, Settings};
use radiosa::sampling::{Stream, warp};
use radiosa::scene::{
    Behind, ColorMap, CookTorrance, Distribution, Fresnel, Material, MetallicRoughness, Model, ScalarMap, Shadowing,
};
use radiosa::spectrum::Spectrum;
use radiosa::transport::{Integrator, World};
use radiosa_testkit::brdf;
use radiosa_testkit::rough_glass::directional_albedo;

const INDICES: [f32; 2] = [1.5, 2.2];

fn resolve(model: Model) -> Bsdf {
    Bsdf::resolve(&Material { model, ..Material::default() }, &FactorsOnly)
}

/// Lossless glass.
fn glass(distribution: Distribution, shadowing: Shadowing, alpha: f32, ior: f32, thin: bool) -> Bsdf {
    resolve(Model::CookTorrance(CookTorrance {
        diffuse: ColorMap::constant(Spectrum::BLACK),
        alpha: ScalarMap::constant(alpha),
        distribution,
        shadowing,
        fresnel: Fresnel::Dielectric { ior },
        behind: Some(Behind { weight: Spectrum::WHITE, absorption: Spectrum::BLACK, thin, priority: 0 }),
        ..CookTorrance::default()
    }))
}

/// glTF's.
fn gltf_glass(roughness: f32, ior: f32) -> Bsdf {
    resolve(Model::MetallicRoughness(MetallicRoughness {
        metallic: ScalarMap::constant(0.0),
        roughness: ScalarMap::constant(roughness),
        transmission: ScalarMap::constant(1.0),
        ior,
        thick: true,
        ..MetallicRoughness::default()
    }))
}

fn viewer(theta: f64) -> Vec3 {
    Vec3::new(theta.sin() as f32, 0.0, theta.cos() as f32)
}

/// Seen from outside or from inside, from above in any case.
fn seen(bsdf: Bsdf, theta: f64, inside: bool) -> Scatter {
    let bsdf = if inside { bsdf.met_from_inside() } else { bsdf };
    Scatter::new(bsdf, Vec3::Z, viewer(theta), !inside, Highlights::Lobe)
}

/// Mean weight of the directions above and below, and the standard errors.
fn albedos(scatter: &Scatter, n: u32) -> [(f64, f64); 2] {
    let mut stream = Stream::new(1, 2, 3);
    let mut sums = [[0.0f64; 2]; 2];
    for _ in 0..n {
        if let Some(drawn) = scatter.sample(stream.next_2d(), stream.next_f32()) {
            let weight = f64::from(drawn.weight.sum().g);
            let sums = &mut sums[usize::from(drawn.wi.z < 0.0)];
            sums[0] += weight;
            sums[1] += weight * weight;
        }
    }
    let n = f64::from(n);
    sums.map(|[sum, squares]| (sum / n, ((squares / n - (sum / n).powi(2)).max(0.0) / n).sqrt()))
}

fn exact(distribution: Distribution, shadowing: Shadowing) -> (brdf::Distribution, brdf::Shadowing) {
    let distribution = match distribution {
        Distribution::Ggx => brdf::Distribution::Ggx,
        Distribution::Beckmann => brdf::Distribution::Beckmann,
    };
    let shadowing = match shadowing {
        Shadowing::VCavity => brdf::Shadowing::VCavity,
        Shadowing::Smith => brdf::Shadowing::Smith,
        Shadowing::SmithCorrelated => brdf::Shadowing::SmithCorrelated,
    };
    (distribution, shadowing)
}

#[test]
fn mean_weights_are_what_facets_reflect_and_let_through() {
    let (mut n, mut worst, mut lossless, mut by_radiance) = (0, 0.0f64, 0, 0);
    for distribution in [Distribution::Ggx, Distribution::Beckmann] {
        for shadowing in [Shadowing::SmithCorrelated, Shadowing::Smith, Shadowing::VCavity] {
            for (alpha, ior) in [(0.1f32, 1.5f32), (0.4, 1.5), (0.9, 2.2)] {
                for inside in [false, true] {
                    for degrees in [0.0f64, 40.0, 80.0] {
                        let theta = degrees.to_radians();
                        let eta = if inside { 1.0 / f64::from(ior) } else { f64::from(ior) };
                        let (d, g) = exact(distribution, shadowing);
                        let facet = |cos| {
                            let r = brdf::fresnel_dielectric(cos, 1.0, eta);
                            (r, 1.0 - r)
                        };
                        let (r, t) = directional_albedo((d, g, f64::from(alpha)), eta, theta, facet);
                        let scatter = seen(glass(distribution, shadowing, alpha, ior, false), theta, inside);
                        let found = albedos(&scatter, 40_000);
                        for ((mean, error), expected) in found.into_iter().zip([r, t]) {
                            let z = (mean - expected).abs() / (error + 3e-4);
                            worst = worst.max(z);
                            let what = format!("{distribution:?} {shadowing:?} α {alpha} ior {ior} inside {inside} {degrees}°");
                            assert!(z < 4.5, "{what}: {mean} ± {error} for {expected}");
                        }
                        let (mean, error) = found[1];
                        n += 1;
                        // The twins: one loses nothing between facets, one transports radiance without the index.
                        lossless += u32::from((found[0].0 + mean - 1.0).abs() > 4.5 * (error + found[0].1));
                        by_radiance += u32::from((mean / (eta * eta) - t).abs() > 4.5 * error);
                    }
                }
            }
        }
    }
    println!("{n} pairs of albedos, largest |z| {worst:.2}; caught: {lossless} lossless twins, {by_radiance} without the index");
    assert!(lossless * 2 > n && by_radiance * 10 > n * 9);
}

#[test]
fn a_sheet_lets_through_by_the_lobe_it_reflects() {
    for distribution in [Distribution::Ggx, Distribution::Beckmann] {
        for theta in [0.2f64, 1.2] {
            let (d, g) = exact(distribution, Shadowing::Smith);
            // Both faces with all the light between them.
            let facet = |cos| {
                let r = brdf::fresnel_dielectric(cos, 1.0, 1.5);
                (2.0 * r / (1.0 + r), 0.0)
            };
            let (r, _) = directional_albedo((d, g, 0.4), 1.5, theta, facet);
            let (all, _) = directional_albedo((d, g, 0.4), 1.5, theta, |_| (1.0, 0.0));
            let found = albedos(&seen(glass(distribution, Shadowing::Smith, 0.4, 1.5, true), theta, false), 60_000);
            for ((mean, error), expected) in found.into_iter().zip([r, all - r]) {
                assert!(
                    (mean - expected).abs() < 4.5 * (error + 2e-4),
                    "{distribution:?} {theta}: {mean} ± {error} for {expected}"
                );
            }
        }
    }
}

#[test]
fn between_media_that_are_alike_nothing_is_rough() {
    // Glass in glass: what goes through goes straight on, from outside and from inside.
    for inside in [false, true] {
        let bsdf = glass(Distribution::Ggx, Shadowing::Smith, 0.4, 1.5, false).within(1.5);
        assert!(bsdf.boundary().is_none());
        let scatter = seen(bsdf, 0.7, inside);
        let mut stream = Stream::new(2, 2, 2);
        for _ in 0..100 {
            let drawn = scatter.sample(stream.next_2d(), stream.next_f32()).expect("it goes through");
            assert!((drawn.wi + viewer(0.7)).length() < 1e-4 && (drawn.weight.sum().g - 1.0).abs() < 1e-4);
        }
    }
}

#[test]
fn gltf_glass_shows_its_directional_albedo() {
    for (roughness, inside) in [(0.3f32, false), (0.7, false), (0.3, true), (0.7, true)] {
        for theta in [0.2f64, 1.2] {
            let eta = if inside { 1.0 / 1.5 } else { 1.5 };
            // Schlick's approximation by the angle outside.
            let facet = |cos: f64| {
                let sin2 = if inside { 2.25 * (1.0 - cos * cos) } else { 1.0 - cos * cos };
                let r = if sin2 >= 1.0 { 1.0 } else { brdf::schlick((1.0 - sin2).sqrt(), 0.04) };
                (r, 1.0 - r)
            };
            let alpha = f64::from(roughness * roughness);
            let lobe = (brdf::Distribution::Ggx, brdf::Shadowing::SmithCorrelated, alpha);
            let (r, t) = directional_albedo(lobe, eta, theta, facet);
            for ((mean, error), expected) in
                albedos(&seen(gltf_glass(roughness, 1.5), theta, inside), 60_000).into_iter().zip([r, t])
            {
                assert!(
                    (mean - expected).abs() < 4.5 * (error + 2e-4),
                    "{roughness} {inside} {theta}: {mean} ± {error} for {expected}"
                );
            }
        }
    }
}

/// χ² of drawn directions over cells of the whole sphere against the integral of a density, as a normal number.
fn chi_square(scatter: &Scatter, pdf: impl Fn(Vec3) -> f32) -> f64 {
    let draw = |stream: &mut Stream| {
        let drawn = scatter.sample(stream.next_2d(), stream.next_f32())?;
        let Way::Rough { pdf } = drawn.way else { panic!("nothing is perfect") };
        let (lobes, again) = scatter.evaluate(drawn.wi);
        assert!((again / pdf - 1.0).abs() < 1e-4 && (lobes.sum().g / pdf - drawn.weight.sum().g).abs() < 1e-3);
        Some(drawn.wi)
    };
    Cells { lowest: -1.0, rows: 24, columns: 24, fine: 48 }.chi_square(100_000, draw, pdf).0
}

#[test]
fn directions_on_both_sides_follow_their_density() {
    let (mut worst, mut n, mut n_caught) = (0.0f64, 0, 0);
    for distribution in [Distribution::Ggx, Distribution::Beckmann] {
        for (alpha, thin) in [(0.3f32, false), (0.7, false), (0.4, true)] {
            for inside in [false, true] {
                for theta in [0.1, 0.8, 1.4] {
                    let of = |alpha: f32| glass(distribution, Shadowing::Smith, alpha, 1.5, thin);
                    let scatter = seen(of(alpha), theta, inside);
                    let z = chi_square(&scatter, |wi| scatter.evaluate(wi).1);
                    worst = worst.max(z);
                    assert!(z < 6.0, "{distribution:?} α {alpha} thin {thin} inside {inside} at {theta}: z {z}");
                    // The twin claims the density of a tenth more roughness.
                    let other = seen(of(alpha * 1.1), theta, inside);
                    n_caught += u32::from(chi_square(&scatter, |wi| other.evaluate(wi).1) > 6.0);
                    n += 1;
                }
            }
        }
    }
    println!("largest z {worst:.2}; of {n} twins {n_caught} are caught");
    assert_eq!(n_caught, n);
}

#[test]
fn light_finds_its_way_back() {
    let boundaries = [Distribution::Ggx, Distribution::Beckmann].into_iter().flat_map(|d| {
        [Shadowing::VCavity, Shadowing::Smith, Shadowing::SmithCorrelated]
            .into_iter()
            .flat_map(move |g| INDICES.map(|ior| (glass(d, g, 0.5, ior, false), f64::from(ior))))
    });
    let (mut n, mut n_caught) = (0, 0);
    for (bsdf, ior) in boundaries.chain([(gltf_glass(0.6, 1.5), 1.5)]) {
        for i in 0..400 {
            let mut stream = Stream::new(9, i, 0);
            let (o, below) = (warp::uniform_hemisphere(stream.next_2d()), -warp::uniform_hemisphere(stream.next_2d()));
            if o.z < 0.05 || below.z > -0.05 {
                continue;
            }
            // Of radiance over the square of the index.
            let there = f64::from(bsdf.refract_cos(Vec3::Z, o, below).g / -below.z);
            let back = f64::from(bsdf.met_from_inside().refract_cos(Vec3::NEG_Z, below, o).g / o.z);
            // Of radiance itself: f(i, o)/η_o² = f(o, i)/η_i².
            let (out, into) = (there / (ior * ior), back * (ior * ior));
            // Near the critical angle what is let through falls like a root, and single precision with it.
            assert!((out - into / (ior * ior)).abs() <= 2e-3 * out + 1e-4, "{out} and {into} with {ior}");
            if there > 1e-3 {
                n += 1;
                n_caught += u32::from((there - back).abs() > 2e-3 * there + 1e-4);
            }
        }
    }
    println!("{n} pairs of directions, {n_caught} twins without the index caught");
    assert!(n > 1000 && n_caught == n);
}

#[test]
fn with_less_and_less_roughness_it_is_smooth_glass() {
    for inside in [false, true] {
        for theta in [0.3f64, 0.6, 1.2] {
            for bsdf in
                [|a: f32| glass(Distribution::Ggx, Shadowing::SmithCorrelated, a, 1.5, false), |a: f32| gltf_glass(a.sqrt(), 1.5)]
            {
                let smooth = seen(bsdf(1e-4), theta, inside);
                let rough = seen(bsdf(2e-3), theta, inside);
                assert!(smooth.is_perfect() && !rough.is_perfect());
                let (expected, found) = (albedos(&smooth, 100_000), albedos(&rough, 100_000));
                for (a, b) in expected.iter().zip(found) {
                    assert!((a.0 - b.0).abs() < 4.5 * (a.1 + b.1) + 2e-3, "{inside} {theta}: {a:?} {b:?}");
                }
                let down = |scatter: &Scatter| {
                    let mut stream = Stream::new(4, 4, 4);
                    let drawn =
                        (0..2000).filter_map(|_| scatter.sample(stream.next_2d(), stream.next_f32())).filter(|s| s.wi.z < 0.0);
                    drawn.map(|s| s.wi.as_dvec3()).sum::<DVec3>().normalize_or_zero()
                };
                assert!((down(&smooth) - down(&rough)).length() < 5e-3, "{inside} {theta}");
            }
        }
    }
}

// ------------------------------------------------------------------------------------------------ in scenes

/// Mean radiance of many paths along one ray, and its standard error.
fn look(world: &World, eye: DVec3, dir: DVec3, n: u64) -> (f64, f64) {
    let origin = (eye - world.origin()).as_vec3();
    let method = PathTracer::new(world, &Settings { eye: Some(origin), max_depth: Some(1), ..Settings::default() });
    let ray = Ray::new(origin, dir.normalize().as_vec3());
    let (mut sum, mut squares) = (0.0, 0.0);
    for i in 0..n {
        let v = f64::from(method.sample(world, &ray, &mut Stream::new(11, i, 0), &mut 0).color.g);
        sum += v;
        squares += v * v;
    }
    let n = n as f64;
    (sum / n, ((squares / n - (sum / n).powi(2)).max(0.0) / n).sqrt())
}

/// The top of a block of glass at z = 0, seen from below or from above.
fn block(light: &str, model: &str) -> World {
    world_of(scene_of(&format!(
        "[material.glass]\n{model}\n[[shape]]\nmaterial = \"glass\"\nbox = {{ min = [-50, -50, -100], max = [50, 50, 0] }}\n{light}"
    )))
}

/// ∫ f |n·i| L dω over the directions in which a disc above the origin, at `height` and `x` to the side, is seen.
fn through_disc(bsdf: &Bsdf, n: Vec3, wo: Vec3, (x, height, radius): (f64, f64, f64)) -> f64 {
    const N: usize = 400;
    let mut sum = 0.0;
    for k in 0..N * N {
        let (r, phi) = (radius * ((k / N) as f64 + 0.5) / N as f64, TAU * ((k % N) as f64 + 0.5) / N as f64);
        let to = DVec3::new(x + r * phi.cos(), r * phi.sin(), height);
        let (wi, d2) = (to.normalize(), to.length_squared());
        sum += f64::from(bsdf.refract_cos(n, wo, wi.as_vec3()).g) * r * wi.z / d2;
    }
    sum * radius / N as f64 * TAU / N as f64
}

#[test]
fn light_of_lamps_discs_and_skies_comes_through_one_rough_face() {
    let model = "glass = { alpha = 0.3 }";
    let bsdf = glass(Distribution::Ggx, Shadowing::SmithCorrelated, 0.3, 1.5, false).met_from_inside();
    let (eye, dir) = (DVec3::new(0.5, 0.0, -2.0), DVec3::new(-0.5, 0.0, 2.0));
    let (n, wo) = (Vec3::NEG_Z, (-dir).normalize().as_vec3());
    // A lamp: exact.
    let lamp = "[light.lamp]\npoint = [-1, 0.2, 3]\nintensity = 7\n";
    let to = DVec3::new(-1.0, 0.2, 3.0);
    let f = f64::from(bsdf.refract_cos(n, wo, to.normalize().as_vec3()).g);
    let world = block(lamp, model);
    let (seen, _) = look(&world, eye, dir, 4);
    // A classic light of intensity I gives π I (n·l) f with f = 1/d² cut at 1, or of the file's own attenuation: measured on a matt surface in its place.
    let matt = block(lamp, "lambert = 1");
    let (white, _) = look(&matt, DVec3::new(0.5, 0.0, 2.0), DVec3::new(-0.5, 0.0, -2.0), 4);
    let expected = white * PI / to.normalize().z * f;
    assert!((seen / expected - 1.0).abs() < 1e-4, "{seen} for {expected}");
    // A disc, small and large, straight ahead and to the side.
    for disc in [(-0.9, 4.0, 0.3), (-0.9, 4.0, 3.0), (0.4, 3.0, 0.5)] {
        let (x, height, radius) = disc;
        let light = format!(
            "[material.light]\nlambert = 0\nemission = 1\n[[shape]]\nmaterial = \"light\"\ndisc = {{ center = [{x}, 0, {height}], normal = [0, 0, -1], radius = {radius} }}\n"
        );
        let world = block(&light, model);
        let (mean, error) = look(&world, eye, dir, 20_000);
        let expected = through_disc(&bsdf, n, wo, disc);
        println!("disc of radius {radius}: {mean} ± {error} for {expected}");
        assert!(
            (mean - expected).abs() < 4.5 * error + 1e-3 * expected && error < 0.02 * expected,
            "{disc:?}: {mean} ± {error} for {expected}"
        );
        // The twin: smooth glass would show the disc, or nothing.
        assert!((mean - 0.96).abs() > 4.5 * error);
    }
    // A sky: what is let through of all directions, and the reflection sees nothing but glass.
    let (mean, error) = look(&block("[environment]\nradiance = 1\n", model), eye, dir, 40_000);
    let facet = |cos| {
        let r = brdf::fresnel_dielectric(cos, 1.5, 1.0);
        (r, 1.0 - r)
    };
    let lobe = (brdf::Distribution::Ggx, brdf::Shadowing::SmithCorrelated, 0.3);
    let (_, t) = directional_albedo(lobe, 1.0 / 1.5, (0.25f64).atan(), facet);
    assert!((mean - t).abs() < 4.5 * error + 3e-4, "{mean} ± {error} for {t}");
}
