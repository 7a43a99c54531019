//! Pictures that get better for as long as one likes: passes to a number of samples, an error or a time, saved on the way.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use radiosa::export::checkpoint;
use radiosa::film;
use radiosa::raytrace::PathTracer;
use radiosa::raytrace::progressive::{MAX_SAMPLES, ProgressiveRender, Settings};
use radiosa::transport::{Solver as _, Step};

use super::method::{Drawing, Watch};
use super::output::tell;
use super::plan::Stage;
use crate::args::Picture;
use crate::error::Error;
use crate::interrupt;

/// Where work is kept on the way, and how often.
pub(crate) struct Save {
    pub(crate) path: PathBuf,
    pub(crate) every: Duration,
    /// Go on from what is there.
    pub(crate) resume: bool,
}

/// How a picture came to its samples.
pub(crate) struct Sampled {
    /// Camera samples a pixel: their mean, the fewest and the most.
    pub(crate) mean: f64,
    pub(crate) range: [u32; 2],
    /// The estimated error; `None` before there are two samples in every pixel.
    pub(crate) noise: Option<f64>,
    /// The options that give these bits again; `None` where there are none, since it was cut off between two samples.
    pub(crate) repeat: Option<String>,
    /// Samples of the state it went on from.
    pub(crate) resumed: Option<u64>,
    /// From the prepared scene to the first picture; `None` where it went on from one.
    pub(crate) first: Option<Duration>,
    /// Where the state is, to go on from.
    pub(crate) checkpoint: Option<PathBuf>,
}

impl Sampled {
    /// In words.
    pub(crate) fn samples(&self) -> String {
        match self.range {
            [low, high] if low == high => low.to_string(),
            [low, high] => format!("{:.1} ({low} to {high})", self.mean),
        }
    }
}

/// Samples of a pixel at most: as many as it takes, where something else ends the picture. (The cells of a sheet share their time.)
fn most(picture: &Picture, watch: &Watch, is_alone: bool) -> u32 {
    match picture.spp {
        None if picture.noise.is_some() || (is_alone && watch.work().time.is_some()) => MAX_SAMPLES,
        _ => picture.samples_a_pixel(),
    }
}

/// What drawing takes beside the film, bytes.
pub(crate) fn memory(sampling: &film::Sampling) -> u64 {
    ProgressiveRender::<PathTracer>::memory(sampling)
}

/// Draws to the samples or the error asked for, until time is up or somebody interrupts.
///
/// # Errors
/// When the film cannot be had, or the state cannot be read or written.
pub(crate) fn draw(
    method: &PathTracer,
    words: &str,
    stage: &Stage,
    picture: &Picture,
    sampling: film::Sampling,
    (watch, save): (&Watch, Option<&Save>),
) -> Result<Drawing, Error> {
    let (world, work) = (&stage.world, watch.work());
    let sampling = film::Sampling { spp: most(picture, watch, save.is_some()), ..sampling };
    // All that decides about the bits but when to stop; with an error asked for, the most samples decide, too.
    let even = film::Sampling { spp: if picture.noise.is_some() { sampling.spp } else { 0 }, ..sampling.clone() };
    let mode = if picture.noise.is_some() { "noise" } else { "passes" };
    let words = format!("{mode}, {even:?}, {:?}, {:?}, {words}, {}", picture.blue_noise, stage.camera, world.cpu_path());
    let n_pixels = f64::from(sampling.width) * f64::from(sampling.height);
    let mut render =
        ProgressiveRender::new(method, &stage.view, Settings { sampling, noise: picture.noise, blue_noise: picture.blue_noise })?;
    let resumed = save.filter(|save| save.resume && save.path.exists());
    if let Some(save) = resumed {
        checkpoint::resume(&save.path, world.scene(), &words, &mut render, work.max_memory)?;
    } else if let Some(save) = save.filter(|save| save.path.exists() && !work.quiet) {
        tell(&format!("warning[replaced]: {} is replaced; --resume would go on with it", save.path.display()));
    }
    let resumed = resumed.map(|_| render.n_samples());
    let write = |render: &ProgressiveRender<'_, PathTracer>, path: &Path| checkpoint::write(path, world.scene(), &words, render);

    let (began, n_before, rays_before) = (Instant::now(), render.n_samples(), render.n_rays());
    let (mut first, mut last_save, mut is_saved) = (None, (Instant::now(), Duration::ZERO), resumed.is_some());
    let mut done = 1.0;
    while let Step::Working { done: part } = render.step(world) {
        if resumed.is_none() {
            first.get_or_insert_with(|| began.elapsed());
        }
        let of_time = work.time.map_or(0.0, |limit| watch.elapsed().as_secs_f64() / limit.as_secs_f64().max(1e-9));
        watch.update(part.max(of_time.min(1.0)), render.n_rays());
        // A pass that would not be over in time is not begun; the first one is left where it is, since it is whole at any moment.
        let taken = (render.n_samples() - n_before).max(1);
        let next = began.elapsed().mul_f64(render.n_wanted() as f64 / taken as f64);
        let is_over = |limit: Duration| {
            if render.is_whole() { render.is_even() && watch.elapsed() + next > limit } else { watch.elapsed() >= limit }
        };
        if interrupt::asked() || work.time.is_some_and(is_over) {
            done = part;
            break;
        }
        if let Some(save) = save
            // Saving takes a tenth of the time at most.
            && last_save.0.elapsed() >= save.every.max(9 * last_save.1)
        {
            let start = Instant::now();
            write(&render, &save.path)?;
            (last_save, is_saved) = ((Instant::now(), start.elapsed()), true);
        }
    }
    let is_time_all = save.is_some() && picture.spp.is_none() && picture.noise.is_none();
    if done < 1.0 && !interrupt::asked() && is_time_all && render.is_whole() {
        // Time was all that was to end it.
        done = 1.0;
    }
    let mut checkpoint = None;
    if let Some(save) = save {
        if done < 1.0 {
            write(&render, &save.path)?;
            checkpoint = Some(save.path.clone());
        } else if is_saved {
            // What is done needs no state; where it cannot be removed it does no harm.
            let _ = std::fs::remove_file(&save.path);
        }
    }
    let (range, noise, is_even) = (render.samples_a_pixel(), render.noise(), render.is_even());
    let repeat = match (picture.noise, noise) {
        _ if !is_even => None,
        (None, _) => Some(format!("--spp {}", range[0])),
        // What it asked for decides where samples went, too.
        (Some(asked), Some(noise)) if noise <= asked => {
            Some(picture.spp.map_or_else(String::new, |spp| format!("--spp {spp} ")) + &format!("--noise {asked}"))
        }
        (Some(_), _) => None,
    };
    let mean = render.n_samples() as f64 / n_pixels;
    let sampled = Sampled { mean, range, noise, repeat, resumed, first, checkpoint };
    Ok(Drawing { done, count: render.n_rays() - rays_before, film: render.into_film(), lines: None, sampled: Some(sampled) })
}
