//! Light that mirrors and glass throw, by paths from its sources: images of lamps in closed form, and the same light as paths from the eye find by luck. Twins have to fail.
#![expect(clippy::print_stdout, reason = "tests say what they measured")]

mod common;

use std::f64::consts::PI;

use common::{scene_of, world_of};
use radiosa::film::{Film, Filter, Layer, Sampling};
use radiosa::math::DVec3;
use radiosa::raytrace::path::{FromLight, PathTracer, Settings as PathSettings};
use radiosa::raytrace::progressive::{ProgressiveRender, Settings};
use radiosa::spectrum::Spectrum;
use radiosa::stream::{In, Out};
use radiosa::transport::{Integrator, Solver, Step, View, World};

const SIZE: (u32, u32) = (48, 36);

/// A layer of a pixel.
fn layer(film: &Film, layer: Layer, (x, y): (u32, u32)) -> Spectrum {
    let at = (y * SIZE.0 + x) as usize;
    let mut channels = film.planes().iter().filter(|p| p.layer == layer).map(|p| p.values[at]);
    let mut next = || channels.next().expect("three channels");
    Spectrum::new(next(), next(), next())
}

struct Stage {
    world: World,
    view: View,
}

impl Stage {
    fn new(scene: &str) -> Self {
        let world = world_of(scene_of(scene));
        let view = View::new(&world.scene().cameras[0], world.origin(), SIZE.0, SIZE.1);
        Self { world, view }
    }

    /// `n` paths from the light in a pass; with none, those from the eye alone.
    fn method(&self, n: u32) -> PathTracer {
        self.method_to(n, None)
    }

    fn method_to(&self, n: u32, max_depth: Option<u32>) -> PathTracer {
        let from_light = (n > 0).then(|| FromLight { view: self.view.clone(), n });
        PathTracer::new(
            &self.world,
            &PathSettings { eye: Some(self.view.eye()), from_light, max_depth, ..PathSettings::default() },
        )
    }

    fn draw(&self, method: &PathTracer, filter: Filter, spp: u32, seed: u64) -> Film {
        let layers = [Layer::Color, Layer::Diffuse, Layer::Specular, Layer::Direct, Layer::Indirect, Layer::Emission].to_vec();
        let sampling = Sampling { width: SIZE.0, height: SIZE.1, spp, filter, seed, layers };
        let mut render =
            ProgressiveRender::new(method, &self.view, Settings { sampling, noise: None, blue_noise: None }).expect("a film");
        while let Step::Working { .. } = render.step(&self.world) {}
        render.into_film()
    }

    /// The radiance over three by three pixels about a point of the floor, and the mean of `expected` over the places on the floor that those see.
    fn about(&self, film: &Film, p: DVec3, expected: impl Fn(DVec3) -> f64) -> [f64; 2] {
        let [x, y] = self.view.place_of(p - self.world.origin()).expect("before the eye");
        let [x, y] = [x as u32 - 1, y as u32 - 1];
        let at = |i: u32| (i % 3, i / 3);
        let found = (0..9).map(at).map(|(i, j)| f64::from(layer(film, Layer::Color, (x + i, y + j)).g)).sum::<f64>() / 9.0;
        const SIDE: u32 = 24;
        let place = |i: u32| {
            let [u, v] = [i % SIDE, i / SIDE].map(|v| (f64::from(v) + 0.5) * 3.0 / f64::from(SIDE));
            let ray = self.view.ray(f64::from(x) + u, f64::from(y) + v);
            let (origin, dir) = (ray.origin.as_dvec3() + self.world.origin(), ray.dir.as_dvec3());
            origin - dir * (origin.y / dir.y)
        };
        [found, (0..SIDE * SIDE).map(|i| expected(place(i))).sum::<f64>() / f64::from(SIDE * SIDE)]
    }
}

/// A floor of reflectance ½ seen from straight above, a mirror that stands on it along x = 1, and what lights them. The edge of the mirror is all the eye sees of it.
fn mirror(lights: &str) -> Stage {
    Stage::new(&format!(
        r#"
[camera.main]
position = [0, 6, 0]
look_at = [0, 0, 0]
up = [0, 0, -1]
fov_y = 20
[material.floor]
lambert = 0.5
[material.mirror]
mirror = 0.8
[[shape]]
material = "floor"
quad = [[-3, 0, 3], [3, 0, 3], [3, 0, -3], [-3, 0, -3]]
[[shape]]
material = "mirror"
quad = [[1.6, 0, 1.2], [1.6, 2, 1.2], [1.6, 2, -1.2], [1.6, 0, -1.2]]
{lights}
"#
    ))
}

const HALF: f64 = 0.5;
/// Of the mirror.
const KEPT: f64 = 0.8;
const MIRROR_X: f64 = 1.6;

/// Where the floor is looked at.
const PLACES: [DVec3; 3] = [DVec3::new(0.7, 0.0, 0.3), DVec3::new(0.0, 0.0, -0.5), DVec3::new(-0.8, 0.0, 0.2)];

/// The largest error beside `expected`, relative; the twin, from the eye alone, has to be off by three hundredths.
fn check(stage: &Stage, name: &str, expected: impl Fn(DVec3) -> f64) {
    let worst = |n: u32| {
        let film = stage.draw(&stage.method(n), Filter::Box, 64, 3);
        let off = |p: &DVec3| {
            let [found, expected] = stage.about(&film, *p, &expected);
            (found / expected - 1.0).abs()
        };
        PLACES.iter().map(off).fold(0.0, f64::max)
    };
    let (found, twin) = (worst(1 << 16), worst(0));
    println!("{name}: off by {found:.4}, without paths from the light by {twin:.4}");
    assert!(found < 0.01, "{name}: {found}");
    assert!(twin > 0.03, "{name}: the twin passes, {twin}");
}

#[test]
fn lamps_without_size_are_seen_in_mirrors_as_images_of_themselves() {
    let lamp = DVec3::new(-0.5, 1.2, 0.4);
    let image = DVec3::new(2.0 * MIRROR_X - lamp.x, lamp.y, lamp.z);
    // L = ρ/π (E + k E′), E = I cosθ/d².
    let given = |from: DVec3, p: DVec3| {
        let d = from - p;
        d.y / d.length().powi(3)
    };
    let at = "point = [-0.5, 1.2, 0.4]";
    let stage = mirror(&format!("[light.lamp]\n{at}\nunit = \"physical\"\nintensity = 7\n"));
    check(&stage, "point", |p| HALF / PI * 7.0 * (given(lamp, p) + KEPT * given(image, p)));
    // A classic light of π (value) over 1 + d/2.
    let stage = mirror(&format!("[light.lamp]\n{at}\nintensity = 3\nattenuation = [1, 0.5, 0]\n"));
    let classic = |from: DVec3, p: DVec3| {
        let d = from - p;
        3.0 * PI * d.y / d.length() / (1.0 + 0.5 * d.length())
    };
    check(&stage, "classic falloff", |p| HALF / PI * (classic(lamp, p) + KEPT * classic(image, p)));
    // The sun comes down to the right: all of what the places are looked at see of it by the mirror is there.
    let to_sun = DVec3::new(-2.0, 1.5, 0.3).normalize();
    let stage = mirror("[light.sun]\ndistant = { to_light = [-2, 1.5, 0.3] }\nunit = \"physical\"\nintensity = 5\n");
    check(&stage, "sun", |_| HALF / PI * 5.0 * to_sun.y * (1.0 + KEPT));
}

#[test]
fn lamps_without_size_shine_through_plates_of_glass() {
    let (thick, ior) = (0.1, 1.5f64);
    let stage = Stage::new(
        r#"
[camera.main]
position = [0, 0.8, 0]
look_at = [0, 0, 0]
up = [0, 0, -1]
fov_y = 12
[material.floor]
lambert = 0.5
[material.glass]
blinn_phong = { diffuse = 0, specular = 0, exponent = 400, mirror = 1, transmission = 1, ior = 1.5, fresnel = true }
[[shape]]
material = "floor"
quad = [[-3, 0, 3], [3, 0, 3], [3, 0, -3], [-3, 0, -3]]
[[shape]]
material = "glass"
box = { min = [-1, 1, -1], max = [1, 1.1, 1] }
[light.lamp]
point = [0, 3, 0]
unit = "physical"
intensity = 7
"#,
    );
    // Head-on: of every face R is reflected, so that (1 − R)/(1 + R) comes through in all, and the lamp seems nearer by t (1 − 1/n). Light that floor and plate throw
    // back and forth adds a little.
    let r = ((ior - 1.0) / (ior + 1.0)).powi(2);
    let passes = (1.0 - r) / (1.0 + r);
    let away = 3.0 - thick * (1.0 - 1.0 / ior);
    let direct = HALF / PI * 7.0 * passes / (away * away);
    let at = |n: u32, spp: u32| stage.about(&stage.draw(&stage.method(n), Filter::Box, spp, 1), DVec3::ZERO, |_| direct)[0];
    let (found, twin) = (at(1 << 14, 64), at(0, 64));
    println!("through a plate {found:.5}, at once {direct:.5}; without paths from the light {twin:.5}");
    assert!(found / direct > 0.99 && found / direct < 1.05, "{found} {direct}");
    assert!(twin < 0.2 * direct, "{twin}");
}

/// A ball of glass, smooth or rough, and a mirror in a matt box under a lamp.
fn caustics(glass: &str, lamp: &str, camera: &str) -> Stage {
    Stage::new(&format!(
        r#"
[camera.main]
position = [0, 1.3, 2.8]
look_at = [0, 0.5, 0]
{camera}
[material.walls]
lambert = [0.7, 0.6, 0.5]
[material.lamp]
lambert = 0
emission = 20
[material.glass]
{glass}
[material.mirror]
mirror = 0.9
[[shape]]
material = "walls"
box = {{ min = [-1.5, 0, -1.5], max = [1.5, 2, 3], inward = true }}
[[shape]]
material = "glass"
sphere = {{ center = [0.3, 0.6, 0], radius = 0.35 }}
[[shape]]
material = "mirror"
quad = [[-1.3, 0.1, -0.8], [-0.5, 0.1, -1.3], [-0.5, 1.2, -1.3], [-1.3, 1.2, -0.8]]
[[shape]]
material = "lamp"
{lamp}
"#
    ))
}

const SMOOTH: &str =
    "blinn_phong = { diffuse = 0, specular = 0, exponent = 400, mirror = 1, transmission = 1, ior = 1.5, fresnel = true }";
const ROUGH: &str = "glass = { ior = 1.5, alpha = 0.2, shadowing = \"smith\" }";
const QUAD: &str = "quad = [[-0.6, 1.95, -0.3], [-0.2, 1.95, -0.3], [-0.2, 1.95, 0.1], [-0.6, 1.95, 0.1]]";
const BALL: &str = "sphere = { center = [-0.4, 1.5, 0], radius = 0.2 }";

/// Means of blocks of twelve by twelve pixels, brightest channel first of all three.
fn blocks(film: &Film) -> Vec<f64> {
    let mut sums = vec![0.0; (SIZE.0 / 12 * (SIZE.1 / 12)) as usize];
    for y in 0..SIZE.1 {
        for x in 0..SIZE.0 {
            sums[(y / 12 * (SIZE.0 / 12) + x / 12) as usize] += f64::from(layer(film, Layer::Color, (x, y)).luminance()) / 144.0;
        }
    }
    sums
}

/// Means and the variances of those over `n` pictures.
fn statistics(pictures: &[Vec<f64>]) -> Vec<(f64, f64)> {
    let n = pictures.len() as f64;
    let of = |k: usize| {
        let mean = pictures.iter().map(|p| p[k]).sum::<f64>() / n;
        (mean, pictures.iter().map(|p| (p[k] - mean).powi(2)).sum::<f64>() / (n * (n - 1.0)))
    };
    (0..pictures[0].len()).map(of).collect()
}

/// The root mean square of differences over what both say they may be off, and what variances are of those from the eye alone.
fn compared(stage: &Stage, filter: Filter, scaled: f64) -> (f64, f64) {
    const N: u64 = 12;
    let (with, without) = (stage.method(1 << 12), stage.method(0));
    let pictures = |method: &PathTracer, first: u64| -> Vec<Vec<f64>> {
        (first..first + N).map(|seed| blocks(&stage.draw(method, filter, 8, seed))).collect()
    };
    let (a, b) = (statistics(&pictures(&with, 1)), statistics(&pictures(&without, 1000)));
    let z: f64 = a.iter().zip(&b).map(|(a, b)| (a.0 * scaled - b.0).powi(2) / (a.1 + b.1)).sum::<f64>() / a.len() as f64;
    let share = a.iter().map(|a| a.1).sum::<f64>() / b.iter().map(|b| b.1).sum::<f64>();
    (z.sqrt(), share)
}

#[test]
fn the_same_light_is_found_from_either_end() {
    let square = [
        ("smooth glass", SMOOTH, "fov_y = 50", Filter::Box, 0.5),
        ("rough glass", ROUGH, "fov_y = 50", Filter::BlackmanHarris, 0.5),
        ("parallel view", SMOOTH, "orthographic_height = 2.4", Filter::Mitchell, 0.8),
        ("panorama", SMOOTH, "panoramic = true", Filter::Box, f64::INFINITY),
    ];
    // A large lamp is found from the eye as well, and rare bright samples decide about variances.
    let ball = [("smooth glass, ball", SMOOTH, "fov_y = 50", Filter::Gaussian, f64::INFINITY)];
    for ((name, glass, camera, filter, most), lamp) in
        square.map(|case| (case, QUAD)).into_iter().chain(ball.map(|case| (case, BALL)))
    {
        let (z, share) = compared(&caustics(glass, lamp, camera), filter, 1.0);
        println!("{name}: rms z {z:.2}, variance {share:.3} of that of paths from the eye");
        assert!(z < 1.9, "{name}: {z}");
        assert!(share < most, "{name}: {share}");
    }
    // The twin: all of it 2 % brighter.
    let (z, _) = compared(&caustics(SMOOTH, QUAD, "fov_y = 50"), Filter::Box, 1.02);
    println!("twin: rms z {z:.2}");
    assert!(z > 1.9, "the twin passes, {z}");
}

/// Points drawn on the lamp, directions that meet it and paths from it all find what comes through rough glass from a large lamp.
#[test]
fn three_ways_to_the_same_light_count_it_once() {
    let stage = Stage::new(
        r#"
[camera.main]
position = [0, 1.3, 1.9]
look_at = [0, 0.75, -0.5]
fov_y = 60
[material.walls]
lambert = 0.5
[material.lamp]
lambert = 0
emission = 8
[material.ball]
glass = { ior = 1.5, alpha = 0.3, shadowing = "smith" }
[[shape]]
material = "walls"
box = { min = [-2, 0, -2], max = [2, 3, 2], inward = true }
[[shape]]
material = "lamp"
quad = [[-1, 2.98, -1], [1, 2.98, -1], [1, 2.98, 1], [-1, 2.98, 1]]
[[shape]]
material = "ball"
sphere = { center = [-0.7, 0.65, -0.4], radius = 0.6 }
"#,
    );
    // Through both faces and off the floor, which the lower rows show.
    let of_floor = |n: u32, seed: u64| {
        let method = stage.method_to(n, Some(3));
        let film = stage.draw(&method, Filter::Box, 64, seed);
        let pixels = || (27..33).flat_map(|y| (0..SIZE.0).map(move |x| (x, y)));
        pixels().map(|at| f64::from(layer(&film, Layer::Color, at).g)).sum::<f64>() / pixels().count() as f64
    };
    let pictures = |n: u32, first: u64| (first..first + 6).map(|seed| vec![of_floor(n, seed)]).collect::<Vec<_>>();
    let [(with, a), (without, b)] = [(1 << 12, 1), (0, 100)].map(|(n, first)| statistics(&pictures(n, first))[0]);
    let (off, error) = (with / without - 1.0, (a + b).sqrt() / without);
    println!("off by {:.3} ± {:.3} %", 100.0 * off, 100.0 * error);
    // (Weights that left points on the lamp out made it 0.4 % too bright.)
    assert!(error < 1e-3, "{error}");
    assert!(off.abs() < 3.5 * error, "{off} {error}");
}

#[test]
fn bodies_around_light_or_eye_leave_all_to_the_eye() {
    // Within a body light counts by the square of its index.
    let within = "sphere = { center = [0.3, 0.6, 0], radius = 0.1 }";
    let reaching_in = "quad = [[0.3, 0.8, 0], [0.3, 1.5, 0], [0.4, 1.5, 0], [0.4, 0.8, 0]]";
    let water = "fov_y = 50\n[[shape]]\nmaterial = \"glass\"\nbox = { min = [-1.4, 0.1, -1.4], max = [1.4, 1.9, 2.9] }";
    let point = "sphere = { center = [0, 1.8, 0], radius = 0.1 }\n[light.point]\npoint = [0.3, 0.6, 0.1]\nintensity = 1";
    for (lamp, camera) in [(within, "fov_y = 50"), (reaching_in, "fov_y = 50"), (point, "fov_y = 50"), (QUAD, water)] {
        assert!(!caustics(SMOOTH, lamp, camera).method(1 << 12).has_splats(), "{lamp}, {camera}");
    }
    assert!(caustics(SMOOTH, QUAD, "fov_y = 50").method(1 << 12).has_splats());
    // A lamp in a ball of glass gives the same with and without, to the bit.
    let stage = caustics(SMOOTH, within, "fov_y = 50");
    let draw = |n: u32| stage.draw(&stage.method(n), Filter::Box, 2, 3);
    assert!(draw(1 << 12).planes().iter().zip(draw(0).planes()).all(|(a, b)| a.values == b.values));
}

#[test]
fn a_state_that_wanted_more_ends_where_it_is_asked_to() {
    let stage = caustics(SMOOTH, QUAD, "fov_y = 50");
    let method = stage.method(1 << 12);
    let begin = |spp: u32| {
        let sampling = Sampling { width: SIZE.0, height: SIZE.1, spp, filter: Filter::Box, seed: 5, layers: vec![Layer::Color] };
        ProgressiveRender::new(&method, &stage.view, Settings { sampling, noise: None, blue_noise: None }).expect("a film")
    };
    let mut render = begin(9);
    while !(render.samples_a_pixel() == [3, 3] && render.is_even()) {
        render.step(&stage.world);
    }
    let mut bytes = Vec::new();
    render.store(&mut Out(&mut bytes)).expect("memory takes everything");
    let finish = |mut render: ProgressiveRender<'_, PathTracer>| {
        while let Step::Working { .. } = render.step(&stage.world) {}
        render.into_film()
    };
    let values = |film: &Film| film.planes().iter().flat_map(|plane| plane.values.clone()).collect::<Vec<f32>>();
    for spp in [3, 4] {
        let mut again = begin(spp);
        again.restore(&mut In(&mut &bytes[..])).expect("it was just written");
        assert!(values(&finish(again)) == values(&finish(begin(spp))), "{spp} samples");
    }
    assert!(values(&finish(begin(3))) != values(&finish(begin(4))));
}

#[test]
fn layers_add_up_and_threads_change_nothing() {
    let stage = caustics(SMOOTH, QUAD, "fov_y = 50");
    let method = stage.method(1 << 13);
    let draw = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| stage.draw(&method, Filter::Gaussian, 4, 7))
    };
    let film = draw(1);
    assert!(film.planes().iter().zip(draw(3).planes()).all(|(a, b)| a.values == b.values));
    let mut largest = 0.0f32;
    for y in 0..SIZE.1 {
        for x in 0..SIZE.0 {
            let of = |of: Layer| layer(&film, of, (x, y));
            let (color, sum) = (of(Layer::Color), of(Layer::Direct) + of(Layer::Indirect) + of(Layer::Emission));
            // (Mirrors and glass themselves have layers that are not asked for here.)
            largest = largest.max((sum - color).map(f32::abs).max_channel() / color.max_channel().max(1e-3));
        }
    }
    assert!(largest < 1e-3, "{largest}");
}
