//! The hybrid against closed forms, against references, and against itself.

mod common;

use common::{FURNACE, below, scene_of, world_of};
use radiosa::film::{Decomposition, Film, Filter, Layer, Sampling};
use radiosa::hybrid::{Filling, FinalGather, Hybrid, Settings};
use radiosa::math::Vec3;
use radiosa::radiosity::{self, Solution};
use radiosa::raytrace::{tiles::TiledRender, whitted};
use radiosa::spectrum::Spectrum;
use radiosa::transport::{Solver, Step, View, World, framing};
use serde_json::Value;

fn solved(world: &World, elements: u32) -> Solution {
    let mut settings = radiosity::Settings::default();
    (settings.mesh.elements, settings.refine.levels) = (elements, 0);
    radiosity::solve(world, &settings)
}

fn settings(rays: u32, cache: f32) -> Settings {
    Settings { whitted: whitted::Settings { samples: 4, ..whitted::Settings::default() }, rays, cache, seed: 0 }
}

const SIZE: u32 = 48;

fn picture(world: &World, solution: &Solution, settings: &Settings, layers: &[Layer]) -> Film {
    let camera = world.scene().cameras.first().cloned().unwrap_or_else(|| framing::automatic(world, 1.0));
    let view = View::new(&camera, world.origin(), SIZE, SIZE);
    let mut hybrid = Hybrid::new(world, world, solution, settings, view.forward(), &|| false);
    let mut filling = Filling::new(&mut hybrid, &view, (SIZE, SIZE));
    while let Step::Working { .. } = filling.step(world) {}
    assert!((settings.cache > 0.0) == (hybrid.n_records() > 0));
    let sampling = Sampling { width: SIZE, height: SIZE, spp: 4, filter: Filter::Box, seed: 0, layers: layers.to_vec() };
    let mut render = TiledRender::new(&hybrid, &view, sampling).expect("a film");
    while let Step::Working { .. } = render.step(world) {}
    render.into_film()
}

fn colors(film: &Film) -> impl Iterator<Item = f32> + '_ {
    film.planes().iter().filter(|p| p.layer == Layer::Color).flat_map(|p| p.values.iter().copied())
}

#[test]
fn a_furnace_shows_one_everywhere() {
    let world = world_of(scene_of(FURNACE));
    let solution = solved(&world, 600);
    for cache in [0.0, 0.2] {
        let film = picture(&world, &solution, &settings(128, cache), &[Layer::Color]);
        let values: Vec<f32> = colors(&film).collect();
        let mean = values.iter().sum::<f32>() / values.len() as f32;
        let worst = values.iter().map(|v| (v - 1.0).abs()).fold(0.0, f32::max);
        println!("cache {cache}: mean {mean}, worst {worst}");
        assert!((mean - 1.0).abs() < 4e-3 && worst < 0.3, "cache {cache}: mean {mean}, worst {worst}");
    }
    // The twin: the same solution where walls emit half as much.
    let dimmed = world_of(scene_of(&FURNACE.replace("emission = 0.4", "emission = 0.2")));
    let film = picture(&dimmed, &solution, &settings(128, 0.2), &[Layer::Color]);
    assert!(colors(&film).all(|v| v < 0.95));
}

#[test]
fn sensors_of_the_cornell_box_have_the_irradiances_of_its_reference() {
    let text =
        std::fs::read_to_string(radiosa_testkit::data_dir().join("cornell-box/reference.json")).expect("it is in the testkit");
    let reference: Value = serde_json::from_str(&text).expect("it is JSON");
    let world = world_of(radiosa::import::sample::load("cornell-box").expect("it is built in"));
    let solution = solved(&world, 500);
    let gather = FinalGather::new(&world, &solution, &[], 0).settled(1024, &|| false);
    let off = |gather: &FinalGather| {
        let (mut sum, mut signed, mut n, mut worst, mut pulls) = (0.0, 0.0, 0.0, 0.0f64, 0.0);
        for (k, point) in reference["points"].as_array().expect("points").iter().enumerate() {
            let v = |name: &str| Vec3::from_array(std::array::from_fn(|i| point[name][i].as_f64().expect("a number") as f32));
            let normal = v("normal");
            let surface = below(&world, v("position") * 0.001, normal);
            let arriving = gather.sensor(&surface, normal, [4096, 1024], k as u64);
            let e = arriving.irradiance;
            pulls += (arriving.standard_error / f64::from(e.luminance())).powi(2);
            for (c, value) in e.to_array().into_iter().enumerate() {
                let (truth, se) = (point["E"][c].as_f64().expect("a number"), point["E_stderr"][c].as_f64().expect("a number"));
                let off = (f64::from(value) - truth) / truth;
                (sum, signed, n) = (sum + off.abs(), signed + off, n + 1.0);
                worst = worst.max(off.abs() - 2.0 * se / truth);
            }
        }
        let noise = (pulls / n * 3.0).sqrt();
        println!(
            "mean {:.3} %, signed {:.3} %, worst {:.2} %, standard error {:.2} %",
            100.0 * sum / n,
            100.0 * signed / n,
            100.0 * worst,
            100.0 * noise
        );
        (sum / n, worst, noise)
    };
    let (mean, worst, noise) = off(&gather);
    assert!(mean < 0.008 && worst < 0.05 && noise < 0.02, "mean {mean}, worst {worst}");
}

#[test]
fn few_elements_gathered_again_lose_no_light_in_a_white_room() {
    // Boxes close to walls and to each other: elements reach from bright places into dark gaps, and light is reflected many times.
    let mut text =
        "[material.white]\nlambert = 0.88\n[material.lamp]\nlambert = 0\nemission = 10\n[[shape]]\nmaterial = \"white\"\n\
        box = { min = [0, 0, 0], max = [4, 3, 4], inward = true }\n[[shape]]\nmaterial = \"lamp\"\n\
        quad = [[1.5, 2.99, 1.5], [2.5, 2.99, 1.5], [2.5, 2.99, 2.5], [1.5, 2.99, 2.5]]\n"
            .to_owned();
    for (low, high) in
        [([0.1, 0.0, 0.1], [1.2, 1.5, 1.4]), ([1.3, 0.0, 0.2], [2.1, 1.0, 1.2]), ([2.6, 0.0, 2.3], [3.9, 1.8, 3.85])]
    {
        text += &format!("[[shape]]\nmaterial = \"white\"\nbox = {{ min = {low:?}, max = {high:?} }}\n");
    }
    let world = world_of(scene_of(&text));
    let places =
        [[2.0, 0.0, 2.0], [3.2, 0.0, 1.0], [0.8, 0.0, 2.6], [2.3, 0.0, 3.3], [1.5, 0.0, 3.4], [0.5, 1.5, 0.6], [3.0, 1.8, 3.0]];
    let mean = |gather: &FinalGather| -> f32 {
        let at = |(k, p): (usize, &[f32; 3])| {
            let p = Vec3::from_array(*p) - world.origin().as_vec3();
            gather.sensor(&below(&world, p, Vec3::Y), Vec3::Y, [16_384, 4096], k as u64).irradiance.g
        };
        places.iter().enumerate().map(at).sum()
    };
    let [few, many] = [200, 6000].map(|n| solved(&world, n));
    let of = |solution, settles| {
        let gather = FinalGather::new(&world, solution, &[], 0);
        mean(&if settles { gather.settled(1024, &|| false) } else { gather })
    };
    // Many elements say nearly the same as they are; the twin takes few as they are.
    let truth = of(&many, true);
    let [settled, many, twin] = [of(&few, true), of(&many, false), of(&few, false)].map(|sum| sum / truth - 1.0);
    println!("settled {settled:+.4}, as they are {twin:+.4}, many as they are {many:+.4}");
    assert!(settled.abs() < 0.01 && many.abs() < 0.01, "{settled}, many {many}");
    assert!(twin < -0.015, "{twin}");
}

#[test]
fn many_small_triangles_share_their_light_and_lose_none() {
    // A white room with a wavy rug of far more triangles than elements are wanted.
    const SIDE: usize = 52;
    let height = |x: f32, z: f32| 0.3 + 0.25 * (5.0 * x).sin() * (4.0 * z).cos();
    let positions: Vec<[f32; 3]> = (0..(SIDE + 1) * (SIDE + 1))
        .map(|k| [k % (SIDE + 1), k / (SIDE + 1)].map(|i| 0.5 + 3.0 * i as f32 / SIDE as f32))
        .map(|[x, z]| [x, height(x, z), z])
        .collect();
    let faces: Vec<[usize; 4]> =
        (0..SIDE * SIDE).map(|k| k % SIDE + k / SIDE * (SIDE + 1)).map(|k| [k, k + SIDE + 1, k + SIDE + 2, k + 1]).collect();
    let room = |reflectance: f32| {
        world_of(scene_of(&format!(
            "[material.white]\nlambert = 0.8\n[material.rug]\nlambert = {reflectance}\n[material.lamp]\nlambert = 0\nemission = 10\n\
             [[shape]]\nmaterial = \"white\"\nbox = {{ min = [0, 0, 0], max = [4, 3, 4], inward = true }}\n\
             [[shape]]\nmaterial = \"lamp\"\nquad = [[1.5, 2.99, 1.5], [2.5, 2.99, 1.5], [2.5, 2.99, 2.5], [1.5, 2.99, 2.5]]\n\
             [[shape]]\nmaterial = \"rug\"\nmesh = {{ positions = {positions:?}, faces = {faces:?} }}\n"
        )))
    };
    let places = [[0.4, 2.0], [1.0, 1.0], [2.0, 2.5], [3.1, 1.7], [3.7, 3.7]];
    let irradiances = |world: &World, gather: &FinalGather| -> Vec<f32> {
        let at = |(k, [x, z]): (usize, &[f32; 2])| {
            let p = Vec3::new(*x, 1.2, *z);
            gather.sensor(&below(world, p, Vec3::NEG_Y), Vec3::NEG_Y, [8192, 2048], k as u64).irradiance.g
        };
        places.iter().enumerate().map(at).collect()
    };
    let found = |world: &World, wanted: u32| {
        let mut settings = radiosity::Settings::default();
        (settings.mesh.elements, settings.refine.levels) = (wanted, 0);
        let division = radiosity::Division::new(world, &settings);
        let n = division.mesh().elements().len();
        assert!(n > 4000 && (wanted < 1000 || n < 4 * wanted as usize), "{n} elements");
        let solution = Solution::to_be_found(world, division, &settings);
        irradiances(world, &FinalGather::new(world, &solution, &[], 0).settled(256, &|| false))
    };
    let (white, dark) = (room(0.8), room(0.6));
    // Where 4000 are wanted each triangle stands for itself.
    let single = found(&white, 4000);
    let off = |values: &[f32]| values.iter().zip(&single).map(|(a, b)| (a / b - 1.0).abs()).fold(0.0, f32::max);
    let (pooled, twin) = (off(&found(&white, 200)), off(&found(&dark, 200)));
    println!("pools are off by {pooled}, those of a darker rug by {twin}");
    assert!(pooled < 0.01, "{pooled}");
    assert!(twin > 0.03, "{twin}");
}

#[test]
fn a_cache_shows_what_gathers_at_every_sample_show() {
    let world = world_of(radiosa::import::sample::load("cornell-box").expect("it is built in"));
    let solution = solved(&world, 600);
    // Of the indirect light alone: direct light is the same in both.
    let indirect = |rays, cache| -> Vec<f32> {
        let film = picture(&world, &solution, &settings(rays, cache), &[Layer::Color, Layer::Indirect]);
        film.planes().iter().filter(|p| p.layer == Layer::Indirect).flat_map(|p| p.values.iter().copied()).collect()
    };
    let truth = indirect(256, 0.0);
    let off = |values: &[f32]| {
        let sum: f32 = values.iter().zip(&truth).map(|(v, t)| (v - t).abs()).sum();
        sum / truth.iter().sum::<f32>()
    };
    let (fine, coarse) = (off(&indirect(1024, 0.15)), off(&indirect(1024, 1.0)));
    println!("fine {fine}, coarse {coarse}");
    assert!(fine < 0.04, "{fine}");
    // The twin interpolates too far.
    assert!(coarse > 1.5 * fine, "{coarse}, fine {fine}");
}

#[test]
fn gradients_are_the_differences_of_gathers() {
    // A bright wall at the side of a floor: the floor's irradiance falls with the distance, and turning its normal to the wall brings more.
    let world = world_of(scene_of(
        r#"
[material.black]
lambert = 0
[material.wall]
lambert = 0.5
[material.lamp]
lambert = 0
emission = 10
[[shape]]
name = "floor"
material = "black"
quad = [[-4, 0, 4], [4, 0, 4], [4, 0, -4], [-4, 0, -4]]
[[shape]]
name = "wall"
material = "wall"
quad = [[-2, 0, 3], [-2, 0, -3], [-2, 3, -3], [-2, 3, 3]]
[[shape]]
name = "lamp"
material = "lamp"
quad = [[3, 2, 1], [3, 4, 1], [3, 4, -1], [3, 2, -1]]
"#,
    ));
    let solution = solved(&world, 2000);
    let gather = FinalGather::new(&world, &solution, &[], 0);
    let at = |x: f32, n: Vec3| gather.gather(&below(&world, Vec3::new(x, 0.0, 0.0), Vec3::Y), n, 40_000, 7, &mut 0);
    let here = at(0.0, Vec3::Y);
    let by_place = (at(0.2, Vec3::Y).irradiance - at(-0.2, Vec3::Y).irradiance) * (1.0 / 0.4);
    let turned = |angle: f32| at(0.0, Vec3::new(-angle.sin(), angle.cos(), 0.0)).irradiance;
    let by_angle = (turned(0.1) - turned(-0.1)) * (1.0 / 0.2);
    // From n to n′ about n × n′: turning to −x from +y is about +z.
    let (along, about) = (here.translation[1].x, here.rotation[1].z);
    println!("place {along} for {}, angle {about} for {}", by_place.g, by_angle.g);
    assert!((along - by_place.g).abs() < 0.1 * by_place.g.abs(), "{along}, by differences {}", by_place.g);
    assert!((about - by_angle.g).abs() < 0.1 * by_angle.g.abs(), "{about}, by differences {}", by_angle.g);
    // (Twins of the other sign would be off by 200 %.)
    assert!(by_place.g < 0.0 && by_angle.g > 0.0);
}

#[test]
fn both_decompositions_sum_to_the_picture() {
    for name in ["room", "whitted"] {
        let scene = radiosa::import::sample::load(name).expect("it is built in");
        let exact = world_of(scene);
        let tessellated = radiosity::tessellated(&exact, 8).expect("it is valid");
        let in_it = tessellated.as_ref().unwrap_or(&exact);
        let solution = solved(in_it, 300);
        let view = View::new(&exact.scene().cameras[0].clone(), exact.origin(), SIZE, SIZE);
        let hybrid = Hybrid::new(&exact, in_it, &solution, &settings(16, 0.0), view.forward(), &|| false);
        let mut layers = vec![Layer::Color];
        for decomposition in [Decomposition::Lobe, Decomposition::Path] {
            layers.extend(decomposition.layers().iter().filter(|l| !layers.contains(l)).copied().collect::<Vec<_>>());
        }
        let sampling = Sampling { width: SIZE, height: SIZE, spp: 1, filter: Filter::Box, seed: 0, layers };
        let mut render = TiledRender::new(&hybrid, &view, sampling).expect("a film");
        while let Step::Working { .. } = render.step(&exact) {}
        let film = render.into_film();
        for decomposition in [Decomposition::Lobe, Decomposition::Path] {
            let error = film.decomposition_error(decomposition);
            assert!(error.is_some_and(|e| e < 1e-4), "{name}: {error:?}");
        }
        let indirect = film.planes().iter().filter(|p| p.layer == Layer::Indirect).flat_map(|p| &p.values).sum::<f32>();
        assert!(indirect > 0.0, "{name} has no indirect light");
    }
}

#[test]
fn a_picture_does_not_depend_on_the_number_of_threads() {
    let world = world_of(scene_of(FURNACE));
    let solution = solved(&world, 100);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| picture(&world, &solution, &settings(32, 0.3), &[Layer::Color]))
    };
    let one = with(1);
    assert!([2, 3, 7].into_iter().all(|threads| with(threads) == one));
}

#[test]
fn a_mirror_throws_light_on_a_wall() {
    // A lamp that shines away from a floor, at a mirror above it: all the floor's light comes by the mirror.
    let text = |mirror: &str| {
        r#"
[material.floor]
lambert = 0
[material.mirror]
phong = { diffuse = 0, mirror = MIRROR }
[material.lamp]
lambert = 0
emission = 10
[[shape]]
name = "floor"
material = "floor"
quad = [[-4, 0, 4], [4, 0, 4], [4, 0, -4], [-4, 0, -4]]
[[shape]]
name = "lamp"
material = "lamp"
quad = [[-0.5, 1, -0.5], [-0.5, 1, 0.5], [0.5, 1, 0.5], [0.5, 1, -0.5]]
[[shape]]
name = "mirror"
material = "mirror"
quad = [[-9, 2, -9], [9, 2, -9], [9, 2, 9], [-9, 2, 9]]
"#
        .replace("MIRROR", mirror)
    };
    let irradiance = |mirror: &str, x: f32| {
        let world = world_of(scene_of(&text(mirror)));
        let solution = solved(&world, 100);
        let gather = FinalGather::new(&world, &solution, &[], 0);
        gather.sensor(&below(&world, Vec3::new(x, 0.0, 0.0), Vec3::Y), Vec3::Y, [40_000, 64], 1)
    };
    // The lamp's image is a square of side 1 at a height of 3; two metres aside its light passes the lamp itself.
    let x = 2.0f64;
    let (n, mut truth) = (400, 0.0);
    for i in 0..n * n {
        let (u, v) = ((f64::from(i % n) + 0.5) / f64::from(n) - 0.5, (f64::from(i / n) + 0.5) / f64::from(n) - 0.5);
        let d2 = (u - x).powi(2) + v * v + 9.0;
        truth += 10.0 * 9.0 / (d2 * d2) / f64::from(n * n);
    }
    let seen = irradiance("1", 2.0);
    let (e, error) = (f64::from(seen.irradiance.g), seen.standard_error);
    println!("{e} ± {error} for {truth}");
    assert!((e - truth).abs() < 4.0 * error + 0.02 * truth && error < 0.1 * truth, "{e} ± {error} for {truth}");
    assert!(irradiance("0", 2.0).irradiance == Spectrum::BLACK);
}
