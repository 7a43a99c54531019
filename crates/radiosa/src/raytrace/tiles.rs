//! From an [`Integrator`] to a picture, tile by tile.

use std::ops::Range;

use rayon::prelude::*;

pub use crate::film::Sampling as Settings;
use crate::film::{Accumulator, Film, FilmError, Pixel};
use crate::sampling::{Stream, sequence};
use crate::transport::{Integrator, Solver, Step, View, World};

/// Pixels a side of a tile, and tiles a step. A step is the unit of progress and of interruption, so with many samples a pixel that branch into many rays
/// both shrink; they depend on nothing else, so that what a step does never depends on the machine. Sixteen pixels are enough for neighbouring rays to share
/// caches.
const fn granularity(samples: u32) -> (u32, usize) {
    match samples {
        0..=1 => (16, 128),
        2..=16 => (16, 32),
        17..=64 => (16, 16),
        65..=512 => (8, 16),
        513..=4096 => (4, 16),
        _ => (2, 8),
    }
}

/// A picture in the making: every step finishes some tiles. The pixels of one tile do not depend on any other, so the picture is
/// the same at any thread count.
pub struct TiledRender<'a, I> {
    integrator: &'a I,
    view: &'a View,
    settings: Settings,
    progress: TileLoop,
}

impl<'a, I: Integrator> TiledRender<'a, I> {
    /// Nothing drawn yet.
    ///
    /// # Errors
    /// When the film cannot be had.
    pub fn new(integrator: &'a I, view: &'a View, settings: Settings) -> Result<Self, FilmError> {
        let film = Film::new(settings.width, settings.height, &settings.layers)?;
        let samples = settings.spp.saturating_mul(integrator.branching());
        Ok(Self { integrator, view, progress: TileLoop::new(film, granularity(samples)), settings })
    }

    /// Rays traced so far, of every kind.
    pub fn n_rays(&self) -> u64 {
        self.progress.n_rays
    }

    /// The picture as it is.
    pub fn into_film(self) -> Film {
        self.progress.film
    }
}

impl<I: Integrator> Solver for TiledRender<'_, I> {
    type Solution = Film;

    fn step(&mut self, world: &World) -> Step {
        let (s, integrator, view) = (&self.settings, self.integrator, self.view);
        self.progress.step(&|x, y, n_rays| {
            let pixel = y * s.width + x;
            let sample = |sample: u32, n_rays: &mut u64| {
                // The same pattern in every pixel: edges of very bright things come out even instead of dotted.
                let at = s.filter.sample(sequence::pixel_sample(s.seed, 0, sample, s.spp));
                let (px, py) = (f64::from(x) + 0.5 + f64::from(at.offset.x), f64::from(y) + 0.5 + f64::from(at.offset.y));
                let mut stream = Stream::new(s.seed, u64::from(pixel), u64::from(sample));
                let ray = view.sample_ray(px, py, &mut stream);
                (integrator.sample(world, &ray, &mut stream, n_rays), at)
            };
            if s.spp == 1 {
                // The mean of one is that one, whatever its weight.
                return sample(0, n_rays).0;
            }
            let mut mean = Accumulator::new();
            for i in 0..s.spp {
                let (pixel, at) = sample(i, n_rays);
                mean.add(&pixel, at);
            }
            mean.finish()
        })
    }

    fn solution(&self) -> &Film {
        &self.progress.film
    }
}

/// A film filled tile by tile, some tiles a step.
pub(super) struct TileLoop {
    pub(super) film: Film,
    pub(super) n_rays: u64,
    next: usize,
    side: u32,
    a_step: usize,
}

impl TileLoop {
    /// With tiles of `side` pixels, `a_step` of them in a step.
    pub(super) fn new(film: Film, (side, a_step): (u32, usize)) -> Self {
        Self { film, n_rays: 0, next: 0, side, a_step }
    }

    /// Fills the next tiles with what `pixel` gives for (x, y); it adds to the last argument the rays it took.
    pub(super) fn step(&mut self, pixel: &(impl Fn(u32, u32, &mut u64) -> Pixel + Sync)) -> Step {
        self.step_tiles(&|columns, rows, part, n_rays| {
            for (j, y) in rows.enumerate() {
                for (i, x) in columns.clone().enumerate() {
                    part.set_pixel(i as u32, j as u32, &pixel(x, y, n_rays));
                }
            }
        })
    }

    /// The same with whole tiles at once: `tile` fills a film of its columns and rows.
    pub(super) fn step_tiles(&mut self, tile: &(impl Fn(Range<u32>, Range<u32>, &mut Film, &mut u64) + Sync)) -> Step {
        let (side, width, height) = (self.side, self.film.width(), self.film.height());
        let across = width.div_ceil(side) as usize;
        let n_tiles = across * height.div_ceil(side) as usize;
        let range = |i: usize, end: u32| i as u32 * side..(i as u32 * side).saturating_add(side).min(end);
        let end = (self.next + self.a_step).min(n_tiles);
        let film = &self.film;
        let tiles: Vec<_> = (self.next..end)
            .into_par_iter()
            .map(|i| {
                let (columns, rows) = (range(i % across, width), range(i / across, height));
                let (mut part, mut n_rays) = (film.part(columns.len() as u32, rows.len() as u32), 0);
                tile(columns, rows, &mut part, &mut n_rays);
                (part, n_rays)
            })
            .collect();
        for (i, (part, n_rays)) in (self.next..end).zip(tiles) {
            self.film.paste(range(i % across, width).start, range(i / across, height).start, &part);
            self.n_rays += n_rays;
        }
        self.next = end;
        if end == n_tiles { Step::Converged } else { Step::Working { done: end as f64 / n_tiles as f64 } }
    }
}
