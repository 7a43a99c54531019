//! Environment maps: look-ups keep the map's orientation, and fewer directions or a table light like the map they stand for.
#![expect(clippy::print_stderr, reason = "tests say what they skip and what they measured")]

use std::f64::consts::PI;

use radiosa::emitter::environment::{IrradianceTable, Map, Sky};
use radiosa::emitter::{Emitter, EnvironmentShadows};
use radiosa::import;
use radiosa::math::{DQuat, DVec3, Vec3};
use radiosa::scene::{Directional, Environment, EnvironmentRadiance, Image, ImageId, Pixels};
use radiosa::spectrum::Spectrum;

/// A direction by the map's convention, from fractions of its width and height.
fn direction(u: f64, v: f64) -> DVec3 {
    let (theta, phi) = (PI * v, 2.0 * PI * (u - 0.5));
    DVec3::new(theta.sin() * phi.sin(), theta.cos(), -theta.sin() * phi.cos())
}

/// A sky with a horizon glow, dark ground, and a small sun three thousand times as bright.
fn synthetic(width: u32, height: u32) -> Map {
    let sun = DVec3::new(0.5, 0.6, -0.4).normalize();
    let texel = move |i: u32| {
        let (x, y) = (i % width, i / width);
        let w = direction((f64::from(x) + 0.5) / f64::from(width), (f64::from(y) + 0.5) / f64::from(height));
        let sky = if w.y > 0.0 { 0.3 + 0.7 * (1.0 - w.y).powi(4) } else { 0.1 };
        let sun = if w.dot(sun) > 0.05f64.cos() { 3000.0 } else { 0.0 };
        Spectrum::new((sky * 0.6 + sun) as f32, (sky * 0.8 + sun * 0.9) as f32, (sky + sun * 0.7) as f32)
    };
    Map::new(width, height, (0..width * height).map(texel)).expect("a whole map")
}

/// Normals all over the sphere (a spherical Fibonacci lattice).
fn normals(n: u32) -> Vec<DVec3> {
    let golden = PI * (3.0 - 5f64.sqrt());
    (0..n)
        .map(|i| {
            let z = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(n);
            let (r, phi) = ((1.0 - z * z).sqrt(), f64::from(i) * golden);
            DVec3::new(r * phi.cos(), z, r * phi.sin())
        })
        .collect()
}

fn reduced_irradiance(directions: &[Directional], n: DVec3) -> [f64; 3] {
    std::array::from_fn(|c| {
        directions.iter().map(|d| PI * f64::from(d.intensity.to_array()[c]) * n.dot(d.to_light).max(0.0)).sum()
    })
}

/// The exact irradiance of a sky for some normals, once.
fn truth(sky: &Sky) -> Vec<(DVec3, [f64; 3])> {
    normals(48).into_iter().map(|n| (n, sky.irradiance(n))).collect()
}

/// Root mean square over normals and channels of the difference, relative to the mean irradiance.
fn error(truth: &[(DVec3, [f64; 3])], of: impl Fn(DVec3) -> [f64; 3]) -> f64 {
    let (mut squares, mut sum) = (0.0, 0.0);
    for (normal, exact) in truth {
        for (exact, approximate) in exact.iter().zip(of(*normal)) {
            squares += (exact - approximate).powi(2);
            sum += exact;
        }
    }
    let n = 3.0 * truth.len() as f64;
    (squares / n).sqrt() / (sum / n)
}

/// The synthetic map, and those of the collection where it is present.
fn skies() -> Vec<(String, Sky)> {
    let mut skies = vec![("synthetic".to_owned(), Sky::of_map(synthetic(256, 128)))];
    let Some(shared) = radiosa_testkit::shared_dir() else {
        eprintln!("skipped: the collected environment maps, which are not beside this checkout");
        return skies;
    };
    for name in ["leadenhall_market_1k.hdr", "studio_small_05_1k.hdr", "aristea_wreck_puresky_1k.hdr"] {
        let image = import::load_picture(&shared.join("environments").join(name), &import::Options::default());
        let map = Map::from_image(&image.expect("a collected map can be read"), Spectrum::WHITE).expect("it has pixels");
        skies.push((name.to_owned(), Sky::of_map(map)));
    }
    skies
}

#[test]
fn the_irradiance_of_a_reduced_map_converges_to_the_maps() {
    for (name, sky) in skies() {
        let truth = truth(&sky);
        let errors = [4, 16, 64, 256, 1024].map(|n| {
            let directions = sky.reduce(n);
            assert!(directions.len() <= n);
            (n, error(&truth, |normal| reduced_irradiance(&directions, normal)))
        });
        eprintln!("{name}: {errors:.4?}");
        let slope = (errors[4].1 / errors[0].1).ln() / 256f64.ln();
        assert!(slope < -0.5, "{name}: error falls only as n^{slope:.2}: {errors:?}");
        assert!(errors[4].1 < 0.01, "{name}: {errors:?}");
        // The twin: directions that forget the cell's energy do not converge.
        let mut wrong = sky.reduce(1024);
        let mean = wrong.iter().map(|d| d.intensity).sum::<Spectrum>() / wrong.len() as f32;
        wrong.iter_mut().for_each(|d| d.intensity = mean);
        assert!(error(&truth, |normal| reduced_irradiance(&wrong, normal)) > 0.05, "{name}");
    }
}

#[test]
fn no_energy_is_lost_by_reduction() {
    let (w, h) = (96, 48);
    let map = synthetic(w, h);
    // Exact solid angles, row by row.
    let total: f64 = (0..h)
        .map(|y| {
            let edge = |y: u32| (PI * f64::from(y) / f64::from(h)).cos();
            let row: f64 = (0..w).map(|x| f64::from(map.texel(x, y).g)).sum();
            row * (edge(y) - edge(y + 1)) * 2.0 * PI / f64::from(w)
        })
        .sum();
    let sky = Sky::of_map(map);
    for n in [1, 2, 7, 100, 5000] {
        let sum: f64 = sky.reduce(n).iter().map(|d| PI * f64::from(d.intensity.g)).sum();
        assert!((sum / total - 1.0).abs() < 1e-6, "{n}: {sum} of {total}");
    }
}

#[test]
fn the_table_of_irradiances_agrees_with_the_sum_over_texels() {
    for (name, sky) in skies() {
        let table = IrradianceTable::new(&sky);
        let off = error(&truth(&sky), |n| table.irradiance(n.as_vec3()).to_array().map(f64::from));
        eprintln!("{name}: {off:.1e}");
        assert!(off < 3e-3, "{name}: {off}");
    }
    // A uniform sky, tabulated or not, gives π L.
    let uniform = Sky::of_map(Map::new(8, 4, [Spectrum::gray(2.0); 32]).expect("a whole map"));
    for n in normals(50) {
        let e = IrradianceTable::new(&uniform).irradiance(n.as_vec3()).g;
        assert!((f64::from(e) / (2.0 * PI) - 1.0).abs() < 1e-3, "{e}");
        assert!((uniform.irradiance(n)[1] / (2.0 * PI) - 1.0).abs() < 3e-4, "however coarse the map");
    }
}

#[test]
fn a_constant_environment_reduces_to_directions_that_light_alike() {
    let radiance = Environment { radiance: EnvironmentRadiance::Constant, ..environment(DQuat::IDENTITY, 256) };
    let sky = Sky::new(&radiance, &[]);
    let directions = sky.reduce(256);
    assert_eq!(directions.len(), 256);
    let truth = truth(&sky);
    assert!(truth.iter().all(|(_, e)| (e[0] - 2.0 * PI).abs() < 1e-12 && (e[1] - PI).abs() < 1e-12));
    let off = error(&truth, |n| reduced_irradiance(&directions, n));
    assert!(off < 0.01, "{off}");
}

/// A map of 8 × 4 distinct texels.
fn numbered() -> Image {
    let pixels: Vec<f32> = (0..32).flat_map(|i| [i as f32, 1.0, 2.0, 1.0]).collect();
    Image { name: "numbered".into(), width: 8, height: 4, pixels: Pixels::Rgba32F(pixels.into()) }
}

fn environment(rotation: DQuat, n_directions: u32) -> Environment {
    Environment {
        radiance: EnvironmentRadiance::Map(ImageId(0)),
        scale: Spectrum::new(2.0, 1.0, 1.0),
        rotation,
        visible: true,
        n_directions,
    }
}

#[test]
fn a_look_up_finds_the_texel_where_the_convention_puts_it() {
    let sky = Sky::new(&environment(DQuat::IDENTITY, 0), &[numbered()]);
    for y in 0..4 {
        for x in 0..8 {
            let at = direction((f64::from(x) + 0.5) / 8.0, (f64::from(y) + 0.5) / 4.0);
            let l = sky.radiance(at.as_vec3());
            assert!((l.r - 2.0 * (8 * y + x) as f32).abs() < 1e-4 && (l.g - 1.0).abs() < 1e-6, "{x} {y}: {l:?}");
        }
    }
    // Words of the convention: the middle column looks along −z, to the right is +x, the top is +y.
    let near = |a: Vec3, expected: f32| assert!((sky.radiance(a).r - expected).abs() < 1e-3, "{a}: {:?}", sky.radiance(a));
    // Between columns 3 and 4, rows 1 and 2: 11, 12, 19, 20.
    near(Vec3::NEG_Z, 2.0 * 15.5);
    // Between columns 5 and 6.
    near(Vec3::X, 2.0 * 17.5);
    // Across the seam: columns 7 and 0.
    near(Vec3::Z, 2.0 * (15.0 + 8.0 + 23.0 + 16.0) / 4.0);
}

#[test]
fn turning_the_environment_turns_all_it_does() {
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, -2.0, 0.5).normalize(), 1.1);
    let (still, turned) =
        (Sky::new(&environment(DQuat::IDENTITY, 16), &[numbered()]), Sky::new(&environment(turn, 16), &[numbered()]));
    for w in normals(40) {
        let (a, b) = (still.radiance(w.as_vec3()).r, turned.radiance((turn * w).as_vec3()).r);
        assert!((a - b).abs() < 1e-3 * a.max(1.0), "{a} {b}");
        assert!((still.irradiance(w)[0] / turned.irradiance(turn * w)[0] - 1.0).abs() < 1e-9);
    }
    for (a, b) in still.reduce(16).iter().zip(turned.reduce(16)) {
        assert!((turn * a.to_light - b.to_light).length() < 1e-9 && a.intensity == b.intensity);
    }
    let (Emitter::Discrete(light), 16) = (turned.emitter(EnvironmentShadows::On), turned.reduce(16).len()) else {
        panic!("an environment of some directions is a discrete light")
    };
    assert!(light.incidents.iter().all(|i| i.casts_shadow && i.distance.is_infinite()));
}

#[test]
fn maps_that_make_no_sense_are_dark_or_constant_but_never_harmful() {
    let bad = [f32::NAN, f32::INFINITY, -1.0, 1e38];
    let map = Map::new(2, 2, bad.map(Spectrum::gray)).expect("four texels");
    let sky = Sky::of_map(map);
    assert!(sky.irradiance(DVec3::Y).iter().all(|e| e.is_finite()));
    assert!(sky.reduce(100).iter().all(|d| d.intensity.is_finite() && d.to_light.is_normalized()));
    assert!(Map::new(0, 0, []).is_none() && Map::new(3, 2, [Spectrum::WHITE; 5]).is_none());
    // Without its picture an environment is its scale in every direction.
    let sky = Sky::new(&environment(DQuat::IDENTITY, 8), &[]);
    assert_eq!(sky.radiance(Vec3::X), Spectrum::new(2.0, 1.0, 1.0));
    let black = Sky::of_map(Map::new(4, 2, [Spectrum::BLACK; 8]).expect("a whole map"));
    assert!(black.reduce(64).is_empty());
}
