//! From an [`Integrator`] to a picture, tile by tile.

use std::ops::Range;

use rayon::prelude::*;

pub use crate::film::Sampling as Settings;
use crate::film::{Accumulator, Film, FilmError, Pixel};
use crate::sampling::{Stream, sequence};
use crate::transport::{Integrator, Solver, Step, View, World};

/// Rays a tile may send in a step, by the count of [`Integrator::branching`]. A step is the unit of progress and of interruption: a tile that wants more goes
/// on in the next one, from where it was, even within a pixel.
const RAYS_A_STEP: u32 = 1024;
/// Pixels a side of a tile, by the rays a pixel sends at once: 16 are enough for neighbouring rays to share caches, and fewer let small pictures of many rays use
/// all threads.
const fn side(samples: u32) -> u32 {
    match samples {
        0..=64 => 16,
        65..=512 => 8,
        _ => 4,
    }
}

/// Camera samples a tile may take in a step.
pub(super) fn samples_a_step(branching: u32) -> u32 {
    (RAYS_A_STEP / branching.max(1)).max(1)
}

/// Tiles worked on together. They depend on nothing but what is asked for, so that what a step does never depends on the machine.
const fn tiles_at_once(samples: u32, branching: u32) -> usize {
    if branching > RAYS_A_STEP {
        8
    } else if samples > 1 || branching > 1 {
        32
    } else {
        128
    }
}

/// A picture in the making: every step takes some samples. The pixels of one tile do not depend on any other, so the picture is
/// the same at any thread count.
pub struct TiledRender<'a, I> {
    integrator: &'a I,
    view: &'a View,
    settings: Settings,
    progress: TileLoop<Tile>,
}

impl<'a, I: Integrator> TiledRender<'a, I> {
    /// Nothing drawn yet.
    ///
    /// # Errors
    /// When the film cannot be had.
    pub fn new(integrator: &'a I, view: &'a View, settings: Settings) -> Result<Self, FilmError> {
        let film = Film::new(settings.width, settings.height, &settings.layers)?;
        let branching = integrator.branching();
        let side = side(settings.spp.saturating_mul(branching));
        let progress = TileLoop::new(film, side, tiles_at_once(settings.spp, branching));
        Ok(Self { integrator, view, progress, settings })
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

/// How far a tile is.
struct Tile {
    columns: Range<u32>,
    rows: Range<u32>,
    /// The pixel it is at, row by row.
    pixel: u32,
    /// Samples of it that were taken, and their mean.
    sample: u32,
    mean: Accumulator,
}

impl<I: Integrator> Solver for TiledRender<'_, I> {
    type Solution = Film;

    fn step(&mut self, world: &World) -> Step {
        let (s, integrator, view) = (&self.settings, self.integrator, self.view);
        let sample = |x: u32, y: u32, sample: u32, n_rays: &mut u64| {
            // The same pattern in every pixel: edges of very bright things come out even instead of dotted.
            let at = s.filter.sample(sequence::pixel_sample(s.seed, 0, sample, s.spp));
            let (px, py) = (f64::from(x) + 0.5 + f64::from(at.offset.x), f64::from(y) + 0.5 + f64::from(at.offset.y));
            let mut stream = Stream::new(s.seed, u64::from(y * s.width + x), u64::from(sample));
            let ray = view.sample_ray(px, py, &mut stream);
            (integrator.sample(world, &ray, &mut stream, n_rays), at)
        };
        let begin = |columns, rows| Tile { columns, rows, pixel: 0, sample: 0, mean: Accumulator::new() };
        self.progress.step(begin, |tile, part, n_rays| {
            let across = tile.columns.len() as u32;
            let n_pixels = across * tile.rows.len() as u32;
            let mut left = samples_a_step(integrator.branching());
            while tile.pixel < n_pixels && left > 0 {
                let (i, j) = (tile.pixel % across, tile.pixel / across);
                let (x, y) = (tile.columns.start + i, tile.rows.start + j);
                let pixel: Pixel = if s.spp <= 1 {
                    // The mean of one is that one, whatever its weight.
                    left -= 1;
                    sample(x, y, 0, n_rays).0
                } else {
                    while tile.sample < s.spp && left > 0 {
                        let (pixel, at) = sample(x, y, tile.sample, n_rays);
                        tile.mean.add(&pixel, at);
                        tile.sample += 1;
                        left -= 1;
                    }
                    if tile.sample < s.spp {
                        break;
                    }
                    tile.sample = 0;
                    std::mem::replace(&mut tile.mean, Accumulator::new()).finish()
                };
                part.set_pixel(i, j, &pixel);
                tile.pixel += 1;
            }
            let spp = f64::from(s.spp.max(1));
            (f64::from(tile.pixel) * spp + f64::from(tile.sample)) / (f64::from(n_pixels) * spp)
        })
    }

    fn solution(&self) -> &Film {
        &self.progress.film
    }
}

/// A film filled tile by tile, some of them at a time; each is shown as far as it is.
pub(super) struct TileLoop<T> {
    pub(super) film: Film,
    pub(super) n_rays: u64,
    side: u32,
    at_once: usize,
    /// The first tile that was not begun.
    next: usize,
    active: Vec<Active<T>>,
}

/// A tile that was begun.
struct Active<T> {
    corner: (u32, u32),
    state: T,
    part: Film,
    n_rays: u64,
    done: f64,
}

impl<T: Send> TileLoop<T> {
    /// With tiles of `side` pixels, `at_once` of them at a time.
    pub(super) fn new(film: Film, side: u32, at_once: usize) -> Self {
        Self { film, n_rays: 0, side, at_once, next: 0, active: Vec::new() }
    }

    /// Goes on with the tiles at hand, and begins others in place of finished ones. `begin` is given columns and rows; `go_on` draws more of a tile into
    /// a film of its own, adds the rays that took to its last argument, and says how much of the tile is done: 1 when all of it is.
    pub(super) fn step(
        &mut self,
        begin: impl Fn(Range<u32>, Range<u32>) -> T + Sync,
        go_on: impl Fn(&mut T, &mut Film, &mut u64) -> f64 + Sync,
    ) -> Step {
        let (side, width, height) = (self.side, self.film.width(), self.film.height());
        let across = width.div_ceil(side) as usize;
        let n_tiles = across * height.div_ceil(side) as usize;
        let range = |i: usize, end: u32| i as u32 * side..(i as u32 * side).saturating_add(side).min(end);
        while self.active.len() < self.at_once && self.next < n_tiles {
            let (columns, rows) = (range(self.next % across, width), range(self.next / across, height));
            let part = self.film.part(columns.len() as u32, rows.len() as u32);
            let corner = (columns.start, rows.start);
            self.active.push(Active { corner, state: begin(columns, rows), part, n_rays: 0, done: 0.0 });
            self.next += 1;
        }
        self.active.par_iter_mut().for_each(|a| a.done = go_on(&mut a.state, &mut a.part, &mut a.n_rays));
        for a in &mut self.active {
            self.film.paste(a.corner.0, a.corner.1, &a.part);
            self.n_rays += std::mem::take(&mut a.n_rays);
        }
        self.active.retain(|a| a.done < 1.0);
        if self.active.is_empty() && self.next == n_tiles {
            return Step::Converged;
        }
        let begun: f64 = self.active.iter().map(|a| a.done).sum();
        Step::Working { done: ((self.next - self.active.len()) as f64 + begun) / n_tiles as f64 }
    }
}
