//! Pictures in passes: whole at once, the same bits however they come about, and with errors that are what they say.
#![expect(clippy::print_stdout, reason = "tests say what they measured")]

mod common;

use common::{FURNACE, scene_of, world_of};
use radiosa::film::{Film, Filter, Layer, Sampling};
use radiosa::raytrace::path::{PathTracer, Settings as PathSettings};
use radiosa::raytrace::progressive::{ProgressiveRender, Settings};
use radiosa::raytrace::tiles::TiledRender;
use radiosa::stream::{In, Out};
use radiosa::transport::{Solver, Step, View, World, framing};

/// A scene and a camera.
struct Stage {
    world: World,
    view: View,
    method: PathTracer,
}

impl Stage {
    fn new(world: World, (width, height): (u32, u32)) -> Self {
        let aspect = f64::from(width) / f64::from(height);
        let camera = world.scene().cameras.first().cloned().unwrap_or_else(|| framing::automatic(&world, aspect));
        let view = View::new(&camera, world.origin(), width, height);
        let method = PathTracer::new(&world, &PathSettings { eye: Some(view.eye()), ..PathSettings::default() });
        Self { world, view, method }
    }

    fn of(name: &str, size: (u32, u32)) -> Self {
        Self::new(world_of(radiosa::import::sample::load(name).expect("it is built in")), size)
    }

    fn begin(&self, settings: Settings) -> ProgressiveRender<'_, PathTracer> {
        ProgressiveRender::new(&self.method, &self.view, settings).expect("a film")
    }

    fn finish(&self, mut render: ProgressiveRender<'_, PathTracer>) -> (Film, f64) {
        while let Step::Working { .. } = render.step(&self.world) {}
        let noise = render.noise().unwrap_or(f64::NAN);
        (render.into_film(), noise)
    }

    fn draw(&self, settings: Settings) -> (Film, f64) {
        self.finish(self.begin(settings))
    }
}

fn passes((width, height): (u32, u32), spp: u32) -> Settings {
    let sampling = Sampling { width, height, spp, filter: Filter::Box, seed: 0, layers: Layer::ALL.to_vec() };
    Settings { sampling, noise: None, blue_noise: None }
}

fn to_noise(size: (u32, u32), noise: f64, seed: u64) -> Settings {
    let Settings { sampling, .. } = passes(size, 1 << 14);
    Settings {
        sampling: Sampling { seed, layers: vec![Layer::Color, Layer::Samples], ..sampling },
        noise: Some(noise),
        blue_noise: None,
    }
}

/// Whatever means the same to the bit; NaN (there is none) would not.
fn without(film: &Film, layers: &[Layer]) -> Vec<(&'static str, Vec<f32>)> {
    film.planes().iter().filter(|p| !layers.contains(&p.layer)).map(|p| (p.name, p.values.clone())).collect()
}

#[test]
fn passes_end_in_the_picture_of_fixed_samples() {
    let size = (45, 37);
    let stage = Stage::of("whitted", size);
    for filter in [Filter::Box, Filter::Mitchell] {
        let mut settings = passes(size, 6);
        settings.sampling.filter = filter;
        let (film, _) = stage.draw(settings.clone());
        let mut tiled = TiledRender::new(&stage.method, &stage.view, settings.sampling).expect("a film");
        while let Step::Working { .. } = tiled.step(&stage.world) {}
        let tiled = tiled.into_film();
        assert!(without(&film, &[Layer::Variance]) == without(&tiled, &[Layer::Variance]), "{filter}");
        assert_eq!(film.object_ids(), tiled.object_ids());
    }
}

#[test]
fn a_picture_that_is_stopped_is_the_picture_of_its_samples_at_any_thread_count() {
    let size = (70, 50);
    let stage = Stage::of("room", size);
    let with = |threads: usize, asked: u32, stop: u32| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| {
            let mut render = stage.begin(passes(size, asked));
            while let Step::Working { .. } = render.step(&stage.world) {
                if render.is_even() && render.samples_a_pixel() == [stop; 2] {
                    break;
                }
            }
            render.into_film()
        })
    };
    let wanted = with(1, 3, 3);
    assert!(with(3, 100, 3) == wanted && with(7, 8, 3) == wanted);
    assert!(with(1, 4, 4) != wanted);
}

#[test]
fn the_first_picture_is_whole_and_comes_at_once() {
    // Large enough for squares of several pixels to share a sample.
    let size = (403, 211);
    let stage = Stage::new(world_of(scene_of(FURNACE)), size);
    let mut render = stage.begin(passes(size, 1));
    assert!(matches!(render.step(&stage.world), Step::Working { .. }));
    let n_first = render.n_samples();
    println!("{n_first} samples");
    assert!(n_first <= 4096 && !render.is_whole());
    let dark = |film: &Film| film.plane("R").expect("red").iter().filter(|v| **v < 0.3).count();
    assert_eq!(dark(render.solution()), 0);
    assert!(render.solution().plane("samples.N").expect("counts").iter().all(|n| *n == 1.0));
    while let Step::Working { .. } = render.step(&stage.world) {}
    assert_eq!((dark(render.solution()), render.n_samples()), (0, u64::from(size.0 * size.1)));
    // The twin: a picture in tiles is dark where no tile was.
    let mut tiled = TiledRender::new(&stage.method, &stage.view, passes(size, 1).sampling).expect("a film");
    tiled.step(&stage.world);
    assert!(dark(tiled.solution()) > 1000);
}

#[test]
fn a_state_goes_on_to_the_same_bits() {
    let size = (52, 41);
    let stage = Stage::of("cornell-box", size);
    for settings in [passes(size, 5), to_noise(size, 0.12, 3)] {
        let whole = stage.draw(settings.clone());
        for n_steps in [1, 2, 7] {
            let mut render = stage.begin(settings.clone());
            for _ in 0..n_steps {
                render.step(&stage.world);
            }
            let mut bytes = Vec::new();
            render.store(&mut Out(&mut bytes)).expect("memory takes everything");
            let mut again = stage.begin(settings.clone());
            again.restore(&mut In(&mut &bytes[..])).expect("it was just written");
            let again = stage.finish(again);
            assert!(again.0 == whole.0 && again.1.to_bits() == whole.1.to_bits(), "after {n_steps} steps");
            // Cut off or of another size it is refused.
            assert!(stage.begin(settings.clone()).restore(&mut In(&mut &bytes[..bytes.len() - 1])).is_err());
            let mut other = settings.clone();
            other.sampling.width += 8;
            assert!(stage.begin(other).restore(&mut In(&mut &bytes[..])).is_err());
        }
    }
}

/// The noise pictures say they have, the one they have by how they differ, and the one they would have if their samples were independent.
fn noises(stage: &Stage, settings: &[Settings]) -> [f64; 3] {
    let runs: Vec<(Film, f64)> = settings.iter().map(|s| stage.draw(s.clone())).collect();
    let n = runs.len() as f64;
    let channels = |film: &Film, layer: Layer| -> Vec<f64> {
        film.planes().iter().filter(|p| p.layer == layer).flat_map(|p| &p.values).map(|v| f64::from(*v)).collect()
    };
    let colors: Vec<Vec<f64>> = runs.iter().map(|run| channels(&run.0, Layer::Color)).collect();
    let n_values = colors[0].len();
    let mean: Vec<f64> = (0..n_values).map(|i| colors.iter().map(|c| c[i]).sum::<f64>() / n).collect();
    let channel = |c: usize| mean[c * n_values / 3..(c + 1) * n_values / 3].iter().sum::<f64>() * 3.0 / n_values as f64;
    let epsilon = 0.5 * radiosa::spectrum::luminance([channel(0), channel(1), channel(2)]).powi(2);
    let relative = |variance: &dyn Fn(usize) -> f64| {
        ((0..n_values).map(|i| variance(i) / (mean[i].powi(2) + epsilon)).sum::<f64>() / n_values as f64).sqrt()
    };
    let between = relative(&|i| colors.iter().map(|c| (c[i] - mean[i]).powi(2)).sum::<f64>() / (n - 1.0));
    let layers: Vec<Vec<f64>> = runs.iter().map(|run| channels(&run.0, Layer::Variance)).collect();
    let layer = if layers[0].is_empty() { f64::NAN } else { relative(&|i| layers.iter().map(|v| v[i]).sum::<f64>() / n) };
    [runs.iter().map(|run| run.1).sum::<f64>() / n, between, layer]
}

#[test]
fn the_noise_and_the_variance_layer_are_those_between_pictures_of_different_random_numbers() {
    let size = (48, 48);
    let stage = Stage::of("room", size);
    for spp in [8, 24, 64] {
        let settings: Vec<Settings> = (0..6)
            .map(|seed| {
                let mut settings = passes(size, spp);
                (settings.sampling.seed, settings.sampling.layers) = (seed, vec![Layer::Color, Layer::Variance]);
                settings
            })
            .collect();
        let [said, is, layer] = noises(&stage, &settings);
        println!("{spp} samples: said {said:.4}, is {is:.4}, layer {layer:.4}");
        assert!((said / is - 1.0).abs() < 0.15 && (layer / is - 1.0).abs() < 0.15, "{spp}: {said}, {layer}, {is}");
    }
}

#[test]
fn evenly_spread_samples_have_less_noise_than_independent_ones_and_that_is_said() {
    // One lamp of some size over a floor: smooth light.
    let size = (32, 32);
    let stage = Stage::new(
        world_of(scene_of(
            r#"
[camera.c]
position = [0, 3, 0.01]
look_at = [0, 0, 0]
[material.floor]
lambert = 0.5
[material.lamp]
lambert = 0
emission = 10
[[shape]]
material = "floor"
quad = [[-9, 0, 9], [9, 0, 9], [9, 0, -9], [-9, 0, -9]]
[[shape]]
material = "lamp"
quad = [[-1, 4, -1], [1, 4, -1], [1, 4, 1], [-1, 4, 1]]
"#,
        )),
        size,
    );
    let settings: Vec<Settings> = (0..8)
        .map(|seed| {
            let mut settings = passes(size, 64);
            (settings.sampling.seed, settings.sampling.layers) = (seed, vec![Layer::Color, Layer::Variance]);
            settings
        })
        .collect();
    let [said, is, layer] = noises(&stage, &settings);
    // The twin: the spread of the samples.
    let mut tiled = TiledRender::new(&stage.method, &stage.view, settings[0].sampling.clone()).expect("a film");
    while let Step::Working { .. } = tiled.step(&stage.world) {}
    let tiled = tiled.into_film();
    let mean = |name: &str| tiled.plane(name).expect("it is kept").iter().map(|v| f64::from(*v)).sum::<f64>() / 1024.0;
    let twin = (mean("variance.G") / (1.5 * mean("G").powi(2))).sqrt();
    println!("said {said:.5}, is {is:.5}, layer {layer:.5}, as if independent {twin:.5}");
    // Where the error falls faster than it is taken to, it is said to be larger than it is.
    let is_right = |noise: f64| (0.8..1.8).contains(&(noise / is));
    assert!(is_right(said) && is_right(layer), "{said}, {layer}, {is}");
    assert!(!is_right(twin), "the twin is not caught");
}

#[test]
fn pictures_end_at_the_noise_asked_for() {
    let size = (48, 48);
    for (name, asked) in [("cornell-box", 0.06), ("room", 0.04), ("light-types", 0.02)] {
        let stage = Stage::of(name, size);
        let settings: Vec<Settings> = (0..6).map(|seed| to_noise(size, asked, seed)).collect();
        let [said, is, _] = noises(&stage, &settings);
        println!("{name}: asked {asked}, said {said:.4}, is {is:.4}");
        assert!(said <= asked && (is / asked - 1.0).abs() < 0.2, "{name}: {is} in place of {asked}");
    }
}

#[test]
fn samples_go_where_they_are_needed_and_leave_the_mean_alone() {
    // The edges of the bright luminaire are noisy, walls are not.
    let size = (64, 64);
    let stage = Stage::of("cornell-box", size);
    let (film, _) = stage.draw(to_noise(size, 0.05, 0));
    let counts = film.plane("samples.N").expect("counts");
    let (low, high) = counts.iter().fold((f32::MAX, 0f32), |(low, high), n| (low.min(*n), high.max(*n)));
    println!("{low} to {high} samples");
    assert!(high >= 4.0 * low);
    // Samples that decide by themselves make pictures too dark.
    let stage = Stage::of("room", size);
    let mean = |film: &Film| film.plane("G").expect("green").iter().map(|v| f64::from(*v)).sum::<f64>();
    let (even, _) = stage.draw(passes(size, 64));
    let adaptive: f64 = (0..4).map(|seed| mean(&stage.draw(to_noise(size, 0.1, seed)).0)).sum::<f64>() / 4.0;
    println!("mean {:.5}", adaptive / mean(&even));
    assert!((adaptive / mean(&even) - 1.0).abs() < 4e-3);
}

/// The mean square of the errors of a channel beside `truth`, of pixels and of means over squares of four by four.
fn errors(film: &Film, truth: &Film, (width, height): (u32, u32)) -> [f64; 2] {
    let green = |film: &Film| film.planes().iter().filter(|p| p.layer == Layer::Color).nth(1).expect("green").values.clone();
    let off: Vec<f64> = green(film).iter().zip(green(truth)).map(|(a, b)| f64::from(a - b)).collect();
    let mean_of = |side: u32| {
        let square = |i: u32, j: u32| {
            let at = |k: u32| off[((j * side + k / side) * width + i * side + k % side) as usize];
            (0..side * side).map(at).sum::<f64>() / f64::from(side * side)
        };
        let squares = (0..height / side).flat_map(|j| (0..width / side).map(move |i| (i, j)));
        squares.map(|(i, j)| square(i, j).powi(2)).sum::<f64>() * f64::from(side * side) / f64::from(width * height)
    };
    [mean_of(1), mean_of(4)]
}

#[test]
fn blue_noise_is_as_strong_in_pixels_and_weaker_in_squares_of_them() {
    let size = (64, 64);
    // A floor and a wall that shadows some of it from a large lamp; no edge is in the picture.
    let scene = r#"
[camera.main]
position = [0, 2, 0]
look_at = [0, 0, 0]
up = [0, 0, -1]
fov_y = 40
[material.matt]
lambert = 0.5
[material.lamp]
lambert = 0
emission = 5
[[shape]]
material = "matt"
quad = [[-4, 0, 4], [4, 0, 4], [4, 0, -4], [-4, 0, -4]]
[[shape]]
material = "matt"
quad = [[1, 0, 2], [1, 1, 2], [1, 1, -2], [1, 0, -2]]
[[shape]]
material = "lamp"
quad = [[3, 1, -1], [3, 1, 1], [3, 3, 1], [3, 3, -1]]
"#;
    let stage = Stage::new(world_of(scene_of(scene)), size);
    let draw = |spp: u32, seed: u64, blue_noise: Option<u32>| {
        let Settings { sampling, .. } = passes(size, spp);
        let sampling = Sampling { seed, layers: vec![Layer::Color], ..sampling };
        stage.draw(Settings { sampling, noise: None, blue_noise }).0
    };
    let truth = draw(1024, 9, None);
    let [white, blue] = [None, Some(4)].map(|blue_noise| {
        let all: Vec<[f64; 2]> = (0..4).map(|seed| errors(&draw(4, seed, blue_noise), &truth, size)).collect();
        [0, 1].map(|k| all.iter().map(|e| e[k]).sum::<f64>() / 4.0)
    });
    println!("variance of pixels {:.3} of that of white noise, of squares {:.3}", blue[0] / white[0], blue[1] / white[1]);
    assert!((0.8..1.25).contains(&(blue[0] / white[0])), "{blue:?} {white:?}");
    assert!(blue[1] < 0.6 * white[1], "{blue:?} {white:?}");
}
