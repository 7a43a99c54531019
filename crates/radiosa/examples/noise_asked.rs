//! `noise_asked SIDE NOISE RUNS REFERENCE SCENE…`: whether path tracing ends at the noise asked for. Each scene is drawn RUNS times, at SIDE² pixels, with
//! different random numbers; a line of JSON says the noise the runs believed to have, and what they had: by how they differ from each other, and, where REFERENCE is
//! above zero, from the mean of two pictures with so many times less noise.
//!
//! `noise = sqrt(mean (L − L_ref)²/(L_ref² + ε))`, ε half the square of the reference's mean luminance, the reference's own taken off.

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use radiosa::film::{Film, Filter, Layer, Sampling};
use radiosa::import::{self, Options};
use radiosa::math::CpuPath;
use radiosa::raytrace::path::{self, PathTracer};
use radiosa::raytrace::progressive::{MAX_SAMPLES, ProgressiveRender, Settings};
use radiosa::scene::Scene;
use radiosa::transport::{Solver, Step, View, World, framing};

/// A picture, the noise it believes to have, and samples a pixel.
struct Run {
    film: Film,
    noise: f64,
    spp: f64,
    range: [u32; 2],
}

fn draw(world: &World, side: u32, noise: f64, seed: u64) -> Result<Run, Box<dyn Error>> {
    let camera = world.scene().cameras.first().cloned().unwrap_or_else(|| framing::automatic(world, 1.0));
    let view = View::new(&camera, world.origin(), side, side);
    let from_light = Some(path::FromLight { view: view.clone(), n: (side * side).max(1 << 12) });
    let settings =
        path::Settings { footprint: view.footprint(64), eye: Some(view.eye()), from_light, ..path::Settings::default() };
    let method = PathTracer::new(world, &settings);
    let layers = vec![Layer::Color, Layer::Variance];
    let sampling = Sampling { width: side, height: side, spp: MAX_SAMPLES, filter: Filter::Box, seed, layers };
    // Below zero: so many samples in every pixel.
    let (spp, noise) = if noise < 0.0 { (-noise as u32, None) } else { (MAX_SAMPLES, Some(noise)) };
    let mut render =
        ProgressiveRender::new(&method, &view, Settings { sampling: Sampling { spp, ..sampling }, noise, blue_noise: None })?;
    while let Step::Working { .. } = render.step(world) {}
    let (spp, range) = (render.n_samples() as f64 / f64::from(side * side), render.samples_a_pixel());
    let noise = render.noise().unwrap_or(f64::NAN);
    Ok(Run { film: render.into_film(), noise, spp, range })
}

fn load(name: &str) -> Result<Scene, Box<dyn Error>> {
    match import::sample::load(name) {
        Some(scene) => Ok(scene),
        None => Ok(import::load(Path::new(name), &Options { allow_outside: vec!["/".into()], ..Options::default() })?.0),
    }
}

/// All channels of colour, one after the other.
fn channels(film: &Film, names: [&str; 3]) -> Vec<f64> {
    names.iter().flat_map(|name| film.plane(name).unwrap_or_default()).map(|v| f64::from(*v)).collect()
}

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [side, noise, runs, reference, scenes @ ..] = &args[..] else {
        return Err("wanted: SIDE NOISE RUNS REFERENCE SCENE…".into());
    };
    let (side, noise, n_runs, reference) =
        (side.parse()?, noise.parse::<f64>()?, runs.parse::<u64>()?, reference.parse::<f64>()?);
    for name in scenes {
        let world = World::prepare(load(name)?, CpuPath::detect())?;
        let began = Instant::now();
        let runs: Vec<Run> = (0..n_runs).map(|seed| draw(&world, side, noise, seed)).collect::<Result<_, _>>()?;
        let seconds = began.elapsed().as_secs_f64() / n_runs as f64;
        let of = |f: fn(&Run) -> f64| runs.iter().map(f).sum::<f64>() / n_runs as f64;
        let colors: Vec<Vec<f64>> = runs.iter().map(|run| channels(&run.film, ["R", "G", "B"])).collect();
        let n = colors[0].len();
        let mean: Vec<f64> = (0..n).map(|i| colors.iter().map(|c| c[i]).sum::<f64>() / n_runs as f64).collect();
        let relative = |truth: &[f64], square: &dyn Fn(usize) -> f64| {
            let k = n / 3;
            let channel = |c: usize| truth[c * k..(c + 1) * k].iter().sum::<f64>() / k as f64;
            let epsilon = 0.5 * radiosa::spectrum::luminance([channel(0), channel(1), channel(2)]).powi(2);
            (0..n).map(|i| square(i) / (truth[i].powi(2) + epsilon)).sum::<f64>() / n as f64
        };
        let between =
            relative(&mean, &|i| colors.iter().map(|c| (c[i] - mean[i]).powi(2)).sum::<f64>() / (n_runs as f64 - 1.0).max(1.0));
        let variances: Vec<Vec<f64>> =
            runs.iter().map(|run| channels(&run.film, ["variance.R", "variance.G", "variance.B"])).collect();
        let layer = relative(&mean, &|i| variances.iter().map(|v| v[i]).sum::<f64>() / n_runs as f64);
        let beside = if reference > 0.0 {
            let pair = [1000, 1001].map(|seed| draw(&world, side, noise / reference, seed));
            let [a, b] = pair.map(|run| run.map(|run| channels(&run.film, ["R", "G", "B"])));
            let (a, b) = (a?, b?);
            let truth: Vec<f64> = a.iter().zip(&b).map(|(a, b)| 0.5 * (a + b)).collect();
            let own = relative(&truth, &|i| (a[i] - b[i]).powi(2) / 4.0);
            let off = relative(&truth, &|i| colors.iter().map(|c| (c[i] - truth[i]).powi(2)).sum::<f64>() / n_runs as f64);
            Some((off - own).max(0.0).sqrt())
        } else {
            None
        };
        let name = Path::new(name).file_stem().unwrap_or_default().to_string_lossy();
        println!(
            "{{\"scene\":{name:?},\"believed\":{:.5},\"between\":{:.5},\"ratio\":{:.3},\"layer\":{:.5},\"reference\":{},\"spp\":{:.1},\"range\":{:?},\"seconds\":{seconds:.1}}}",
            of(|r| r.noise),
            between.sqrt(),
            between.sqrt() / of(|r| r.noise),
            layer.sqrt(),
            beside.map_or("null".to_owned(), |v| format!("{v:.5}")),
            of(|r| r.spp),
            runs[0].range,
        );
    }
    Ok(())
}
