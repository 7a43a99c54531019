//! What surfaces scatter, drawn by chance: the mean of the weights is the directional albedo of the table (`brdf.json`), and directions follow their density (χ²).
//! Each with a wrong twin that is caught.
#![expect(clippy::print_stdout, reason = "tests say what they measured")]

mod common;

use std::f64::consts::TAU;

use common::chi_square::Cells;
use radiosa::bsdf::{Bsdf, FactorsOnly, Highlights, Scatter, Way};
use radiosa::math::Vec3;
use radiosa::sampling::Stream;
use radiosa::scene::{
    ColorMap, CookTorrance, Distribution, Form, Fresnel, Material, MetallicRoughness, Model, Phong, PhongLobe, ScalarMap,
    Shadowing,
};
use radiosa::spectrum::Spectrum;
use serde_json::Value;

fn resolve(model: Model) -> Bsdf {
    Bsdf::resolve(&Material { model, ..Material::default() }, &FactorsOnly)
}

fn cook(distribution: Distribution, shadowing: Shadowing, fresnel: Fresnel, alpha: f32, k_d: f32) -> Bsdf {
    resolve(Model::CookTorrance(CookTorrance {
        ambient: None,
        diffuse: ColorMap::constant(Spectrum::gray(k_d)),
        specular: ColorMap::constant(Spectrum::WHITE),
        alpha: ScalarMap::constant(alpha),
        distribution,
        shadowing,
        fresnel,
        form: Form::Modern,
        behind: None,
    }))
}

fn phong(lobe: PhongLobe, exponent: f32, k_d: f32, k_s: f32) -> Bsdf {
    resolve(Model::Phong(Phong {
        diffuse: ColorMap::constant(Spectrum::gray(k_d)),
        specular: ColorMap::constant(Spectrum::gray(k_s)),
        exponent: ScalarMap::constant(exponent),
        lobe,
        ..Phong::default()
    }))
}

fn gltf(metallic: f32, roughness: f32) -> Bsdf {
    resolve(Model::MetallicRoughness(MetallicRoughness {
        base_color: ColorMap::constant(Spectrum::gray(0.6)),
        metallic: ScalarMap::constant(metallic),
        roughness: ScalarMap::constant(roughness),
        ..MetallicRoughness::default()
    }))
}

fn viewer(theta: f64) -> Vec3 {
    Vec3::new(theta.sin() as f32, 0.0, theta.cos() as f32)
}

fn seen(bsdf: Bsdf, theta: f64) -> Scatter {
    Scatter::new(bsdf, Vec3::Z, viewer(theta), true, Highlights::Lobe)
}

/// Mean weight of many directions, of one channel, and its standard error.
fn albedo(scatter: &Scatter, n: u32) -> (f64, f64) {
    let mut stream = Stream::new(1, 2, 3);
    let (mut sum, mut squares) = (0.0, 0.0);
    for _ in 0..n {
        let weight = scatter.sample(stream.next_2d(), stream.next_f32()).map_or(0.0, |s| f64::from(s.weight.sum().g));
        sum += weight;
        squares += weight * weight;
    }
    let mean = sum / f64::from(n);
    (mean, ((squares / f64::from(n) - mean * mean).max(0.0) / f64::from(n)).sqrt())
}

/// The rows of directional albedos of the table.
fn rows() -> Vec<Value> {
    let path = radiosa_testkit::data_dir().join("brdf.json");
    let data: Value = serde_json::from_str(&std::fs::read_to_string(path).expect("it is in the testkit")).expect("it is JSON");
    data["directional_albedo"]["values"].as_array().expect("a list").clone()
}

fn numbers(list: &Value) -> Vec<f64> {
    list.as_array().expect("a list").iter().map(|v| v.as_f64().expect("a number")).collect()
}

/// What a row is about, and its albedos.
fn reflecting(row: &Value) -> Option<(Bsdf, Vec<f64>)> {
    let number = |name: &str| row[name].as_f64().expect("a number") as f32;
    let (bsdf, values) = match row["model"].as_str()? {
        "cook-torrance" => {
            let distribution = if row["D"] == "ggx" { Distribution::Ggx } else { Distribution::Beckmann };
            let shadowing = match row["G"].as_str()? {
                "vcavity" => Shadowing::VCavity,
                "smith" => Shadowing::Smith,
                _ => Shadowing::SmithCorrelated,
            };
            let gold = |n, k| Fresnel::Conductor { n: Spectrum::gray(n), k: Spectrum::gray(k) };
            let fresnel = match row["fresnel"].as_str()? {
                "F=1" => Fresnel::One,
                "dielectric n=1.5" => Fresnel::Dielectric { ior: 1.5 },
                "schlick F0=0.04" => Fresnel::Schlick { f0: Spectrum::gray(0.04) },
                "Au at 0.6595 um" => gold(0.14, 3.697),
                "Au at 0.5486 um" => gold(0.43, 2.455),
                _ => gold(1.38, 1.914),
            };
            (cook(distribution, shadowing, fresnel, number("alpha"), 0.0), &row["value"])
        }
        name if name.starts_with("phong") => (phong(PhongLobe::Phong, number("exponent"), 0.0, 1.0), &row["times_normalisation"]),
        _ => (phong(PhongLobe::BlinnPhong, number("exponent"), 0.0, 1.0), &row["times_exact_normalisation"]),
    };
    Some((bsdf, numbers(values)))
}

#[test]
fn mean_weights_are_the_directional_albedos_of_the_table() {
    let (mut n, mut worst, mut n_caught) = (0, 0.0f64, 0);
    for row in rows() {
        let (bsdf, values) = reflecting(&row).expect("it is of a known model");
        for (theta, expected) in numbers(&row["theta"]).into_iter().zip(values) {
            let (mean, error) = albedo(&seen(bsdf, theta.to_radians()), 40_000);
            let z = (mean - expected).abs() / (error + 2e-4 * expected);
            n += 1;
            worst = worst.max(z);
            assert!(z < 4.5, "{row} at {theta}: {mean} ± {error} for {expected}");
            // The twin knows nothing of the share that is lost.
            n_caught += u32::from((mean - 1.0).abs() > 4.5 * error + 2e-4);
        }
    }
    // Lambert's is its reflectance, from everywhere.
    for rho in [0.18f32, 1.0] {
        for theta in [0.0, 1.0, 1.5] {
            let (mean, error) = albedo(&seen(phong(PhongLobe::Phong, 1.0, rho, 0.0), theta), 1000);
            assert!((mean - f64::from(rho)).abs() < 4.5 * error + 1e-5, "{mean} at {theta}");
        }
    }
    println!("{n} albedos, largest |z| {worst:.2}; of a twin that is lossless {n_caught} are caught");
    assert!(n > 400 && n_caught > 300);
}

/// χ² of drawn directions over cells of height and longitude against the integral of the density `pdf` gives, with the cells that count.
fn chi_square(scatter: &Scatter, pdf: impl Fn(Vec3) -> f32) -> (f64, f64) {
    let draw = |stream: &mut Stream| {
        let drawn = scatter.sample(stream.next_2d(), stream.next_f32())?;
        let Way::Rough { pdf } = drawn.way else { return None };
        assert!((scatter.evaluate(drawn.wi).1 / pdf - 1.0).abs() < 1e-4);
        Some(drawn.wi)
    };
    Cells { lowest: 0.0, rows: 12, columns: 24, fine: 24 }.chi_square(100_000, draw, pdf)
}

/// Every model that is sampled, in its variants; rough glass is in `rough_glass.rs`.
fn members() -> Vec<(String, Bsdf)> {
    let mut members = vec![("Lambert".to_owned(), phong(PhongLobe::Phong, 1.0, 0.7, 0.0))];
    let mut add = |name: &str, bsdf: Bsdf| members.push((name.to_owned(), bsdf));
    add("Phong", phong(PhongLobe::Phong, 12.0, 0.3, 0.6));
    add("Phong alone", phong(PhongLobe::Phong, 30.0, 0.0, 0.8));
    add("Blinn–Phong", phong(PhongLobe::BlinnPhong, 20.0, 0.3, 0.6));
    add("Blinn–Phong alone", phong(PhongLobe::BlinnPhong, 3.0, 0.0, 0.8));
    let metal = Fresnel::Conductor { n: Spectrum::gray(0.43), k: Spectrum::gray(2.455) };
    for distribution in [Distribution::Ggx, Distribution::Beckmann] {
        for shadowing in [Shadowing::VCavity, Shadowing::Smith, Shadowing::SmithCorrelated] {
            for (fresnel, alpha, k_d) in [
                (Fresnel::One, 0.3, 0.0),
                (metal, 0.9, 0.0),
                (Fresnel::Dielectric { ior: 1.5 }, 0.5, 0.5),
                (Fresnel::Schlick { f0: Spectrum::gray(0.04) }, 0.4, 0.2),
            ] {
                add(&format!("{distribution:?} {shadowing:?} {fresnel:?}"), cook(distribution, shadowing, fresnel, alpha, k_d));
            }
            add("compensated", cook(distribution, shadowing, metal, 0.7, 0.0).compensated());
        }
        for form in [Form::Paper1982, Form::Lecture] {
            let model = Model::CookTorrance(CookTorrance {
                diffuse: ColorMap::constant(Spectrum::gray(0.2)),
                specular: ColorMap::constant(Spectrum::gray(0.2)),
                distribution,
                alpha: ScalarMap::constant(0.4),
                form,
                ..CookTorrance::default()
            });
            add(&format!("{distribution:?} {form:?}"), resolve(model));
        }
    }
    for (metallic, roughness) in [(0.0, 0.6), (1.0, 0.6), (0.5, 0.9), (1.0, 1.0)] {
        add(&format!("metallic {metallic} roughness {roughness}"), gltf(metallic, roughness));
    }
    add("glTF, compensated", gltf(0.5, 0.9).compensated());
    members
}

const ANGLES: [f64; 3] = [0.1, 0.8, 1.35];

#[test]
fn directions_follow_their_density() {
    let (mut worst, mut n_caught, mut n) = (0.0f64, 0, 0);
    for (name, bsdf) in members() {
        for theta in ANGLES {
            let scatter = seen(bsdf, theta);
            let (z, cells) = chi_square(&scatter, |wi| scatter.evaluate(wi).1);
            worst = worst.max(z);
            // Once in 10⁶ for all of them; the midpoint rule takes its part at the sharpest lobes.
            assert!(z < 6.0, "{name} at {theta}: z {z} over {cells} cells");
            if theta != ANGLES[1] {
                continue;
            }
            // The twin claims the density of another lobe.
            let other = seen(cook(Distribution::Ggx, Shadowing::SmithCorrelated, Fresnel::One, 0.65, 0.5), theta);
            n_caught += u32::from(chi_square(&scatter, |wi| other.evaluate(wi).1).0 > 6.0);
            n += 1;
        }
    }
    println!("largest z {worst:.2}; of {n} twins {n_caught} are caught");
    assert_eq!(n_caught, n);
}

/// ∫ f (n·wi) dωi by the midpoint rule.
fn by_quadrature(scatter: &Scatter) -> f64 {
    const ROWS: usize = 400;
    const COLUMNS: usize = 400;
    let mut sum = 0.0;
    for k in 0..ROWS * COLUMNS {
        let (z, phi) = (((k / COLUMNS) as f64 + 0.5) / ROWS as f64, TAU * ((k % COLUMNS) as f64 + 0.5) / COLUMNS as f64);
        let r = (1.0 - z * z).sqrt();
        sum += f64::from(scatter.evaluate(Vec3::new((r * phi.cos()) as f32, (r * phi.sin()) as f32, z as f32)).0.sum().g);
    }
    sum * TAU / (ROWS * COLUMNS) as f64
}

#[test]
fn mean_weights_are_what_the_function_reflects() {
    let (mut worst, mut n_caught, mut n) = (0.0f64, 0, 0);
    for (name, bsdf) in members() {
        for theta in ANGLES {
            let scatter = seen(bsdf, theta);
            let (expected, (mean, error)) = (by_quadrature(&scatter), albedo(&scatter, 40_000));
            let z = (mean - expected).abs() / (error + 3e-4 * expected);
            worst = worst.max(z);
            assert!(z < 4.8, "{name} at {theta}: {mean} ± {error} for {expected}");
            // The twin reflects a twentieth more.
            n_caught += u32::from((mean - 1.05 * expected).abs() > 4.8 * (error + 3e-4 * expected));
            n += 1;
        }
    }
    println!("{n} furnaces, largest |z| {worst:.2}; {n_caught} twins are caught");
    assert!(n_caught == n);
}

#[test]
fn what_is_sampled_is_reciprocal() {
    let (mut n, mut n_caught) = (0, 0);
    for (name, bsdf) in members() {
        let mut stream = Stream::new(6, 1, 0);
        for _ in 0..200 {
            let [a, b] = [(); 2].map(|()| radiosa::sampling::warp::uniform_hemisphere(stream.next_2d()));
            if a.z < 0.02 || b.z < 0.02 {
                continue;
            }
            let f = |o: Vec3, i: Vec3| {
                let scatter = Scatter::new(bsdf, Vec3::Z, o, true, Highlights::Lobe);
                f64::from(scatter.evaluate(i).0.sum().g / i.z)
            };
            let (there, back) = (f(a, b), f(b, a));
            assert!((there - back).abs() <= 1e-4 * there.max(back) + 1e-7, "{name}: {there} and {back}");
            // The twin counts the cosine of the light as well.
            n += 1;
            n_caught += u32::from((there * f64::from(b.z) - back * f64::from(a.z)).abs() > 1e-4 * there.max(back) + 1e-7);
        }
    }
    println!("{n} pairs of directions, {n_caught} twins caught");
    assert!(n_caught * 10 > n * 9);
}

#[test]
fn rough_reflections_of_whitteds_method_have_the_albedos_of_the_table() {
    let (mut n, mut worst, mut n_caught) = (0, 0.0f64, 0);
    for row in rows() {
        let Some((bsdf, values)) = reflecting(&row).filter(|_| row["model"] == "cook-torrance") else { continue };
        for (theta, expected) in numbers(&row["theta"]).into_iter().zip(values) {
            let mut stream = Stream::new(1, 2, 3);
            let (wo, count) = (viewer(theta.to_radians()), 40_000);
            let (mut sum, mut squares) = (0.0, 0.0);
            for _ in 0..count {
                let weight = bsdf.sample_gloss(Vec3::Z, wo, stream.next_2d()).map_or(0.0, |(_, weight)| f64::from(weight.g));
                sum += weight;
                squares += weight * weight;
            }
            let mean = sum / f64::from(count);
            let error = ((squares / f64::from(count) - mean * mean).max(0.0) / f64::from(count)).sqrt();
            let z = (mean - expected).abs() / (error + 1e-3 * expected);
            worst = worst.max(z);
            assert!(z < 4.5, "{row} at {theta}: {mean} ± {error} for {expected}");
            n += 1;
            n_caught += u32::from((mean - 1.0).abs() > 4.5 * (error + 1e-3));
        }
    }
    println!("{n} albedos, largest |z| {worst:.2}; of a twin that is lossless {n_caught} are caught");
    assert!(n > 300 && n_caught * 4 > n * 3);
}

#[test]
fn lobes_reflect_no_more_than_all_and_perfect_rays_are_chosen_by_their_weight() {
    // k_d + k_s = 1.4: the highlight takes what the diffuse lobe leaves.
    for theta in [0.0, 0.7, 1.4] {
        let (mean, error) = albedo(&seen(phong(PhongLobe::Phong, 9.0, 0.7, 0.7), theta), 20_000);
        assert!(mean < 1.0 + 4.0 * error, "{mean} at {theta}");
    }
    let model = Model::Phong(Phong {
        diffuse: ColorMap::constant(Spectrum::gray(0.2)),
        mirror: Spectrum::gray(0.3),
        transmission: Spectrum::gray(0.4),
        ..Phong::default()
    });
    let scatter = seen(resolve(model), 0.5);
    let mut stream = Stream::new(8, 0, 0);
    let mut counts = [0.0f64; 3];
    for _ in 0..20_000 {
        let drawn = scatter.sample(stream.next_2d(), stream.next_f32()).expect("something is reflected");
        let k = match drawn.way {
            Way::Rough { .. } => 0,
            Way::Reflected => 1,
            Way::Refracted => 2,
        };
        counts[k] += 1.0 / 20_000.0;
        assert!((f64::from(drawn.weight.sum().g) - 0.9).abs() < 1e-4, "every way weighs the same");
    }
    for (count, share) in counts.iter().zip([2.0 / 9.0, 3.0 / 9.0, 4.0 / 9.0]) {
        assert!((count - share).abs() < 0.02, "{counts:?}");
    }
}

#[test]
fn what_facets_reflect_more_than_once_is_given_back() {
    let furnace = |bsdf: Bsdf, theta: f64| albedo(&seen(bsdf, theta), 40_000);
    let (mut worst, mut least, mut n_caught, mut n) = (0.0f64, 1.0f64, 0, 0);
    for distribution in [Distribution::Ggx, Distribution::Beckmann] {
        for shadowing in [Shadowing::SmithCorrelated, Shadowing::Smith, Shadowing::VCavity] {
            for alpha in [2e-3f32, 0.02, 0.1, 0.25, 0.5, 0.8, 1.0] {
                for theta in [0.0f64, 0.7, 1.2, 1.5] {
                    let white = cook(distribution, shadowing, Fresnel::One, alpha, 0.0);
                    let (mean, error) = furnace(white.compensated(), theta);
                    worst = worst.max((mean - 1.0).abs() - 2.0 * error);
                    assert!(
                        (mean - 1.0).abs() < 1e-2 + 4.5 * error,
                        "{distribution:?} {shadowing:?} {alpha} at {theta}: {mean} ± {error}"
                    );
                    // The twin: nothing is given back.
                    let (bare, error) = furnace(white, theta);
                    least = least.min(bare);
                    n_caught += u32::from((bare - 1.0).abs() > 1e-2 + 4.5 * error);
                    n += 1;
                }
            }
        }
    }
    println!(
        "white metals: at most {worst:.4} off beyond two standard errors, without it down to {least:.3}; {n_caught} of {n} twins are caught"
    );
    assert!(n_caught * 2 > n);
    // Coloured metals get the series of all reflections but the first, Σ ρ^k (1 − E)^(k − 1) E from k = 2 on, ρ and E the means over the hemisphere.
    let (alpha, thetas) = (0.8f32, (0..64).map(|i| ((i as f64 + 0.5) / 64.0).sqrt().acos()));
    let metal = |f0: f32| {
        let fresnel = Fresnel::Schlick { f0: Spectrum::gray(f0) };
        cook(Distribution::Ggx, Shadowing::SmithCorrelated, fresnel, alpha, 0.0)
    };
    let e = |theta: f64| furnace(metal(1.0), theta).0;
    let e_mean = thetas.map(e).sum::<f64>() / 64.0;
    for (f0, rho) in [(0.2f32, 0.2 + 0.8 / 21.0), (0.8, 0.8 + 0.2 / 21.0)] {
        for theta in [0.3, 1.3] {
            let series: f64 = (2..200).map(|k| f64::powi(rho, k) * f64::powi(1.0 - e_mean, k - 1) * e_mean).sum();
            let expected = furnace(metal(f0), theta).0 + series * (1.0 - e(theta)) / (1.0 - e_mean);
            let (mean, error) = furnace(metal(f0).compensated(), theta);
            assert!((mean - expected).abs() < 5e-3 + 4.5 * error, "F₀ {f0} at {theta}: {mean} ± {error} for {expected}");
        }
    }
}
