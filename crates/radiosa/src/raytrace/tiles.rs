//! From an [`Integrator`] to a picture, tile by tile.

use rayon::prelude::*;

pub use crate::film::Sampling as Settings;
use crate::film::{Accumulator, Film, FilmError, Pixel};
use crate::sampling::{Stream, sequence};
use crate::transport::{Integrator, Solver, Step, View, World};

/// Pixels a side of a tile, and tiles a step. A step is the unit of progress and of interruption, so with many samples a pixel both shrink; they depend on
/// nothing else, so that what a step does never depends on the machine. Sixteen pixels are enough for neighbouring rays to share caches.
const fn granularity(spp: u32) -> (u32, usize) {
    match spp {
        0..=16 => (16, 32),
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
    film: Film,
    next: usize,
    n_rays: u64,
}

impl<'a, I: Integrator> TiledRender<'a, I> {
    /// Nothing drawn yet.
    ///
    /// # Errors
    /// When the film cannot be had.
    pub fn new(integrator: &'a I, view: &'a View, settings: Settings) -> Result<Self, FilmError> {
        let film = Film::new(settings.width, settings.height, &settings.layers)?;
        Ok(Self { integrator, view, settings, film, next: 0, n_rays: 0 })
    }

    /// Rays traced so far, of every kind.
    pub fn n_rays(&self) -> u64 {
        self.n_rays
    }

    /// The picture as it is.
    pub fn into_film(self) -> Film {
        self.film
    }

    fn n_tiles(&self) -> usize {
        let (side, _) = granularity(self.settings.spp);
        self.settings.width.div_ceil(side) as usize * self.settings.height.div_ceil(side) as usize
    }

    /// The pixels of a tile, row by row, and the rays they took.
    fn tile(&self, world: &World, x0: u32, y0: u32) -> (Vec<Pixel>, u64) {
        let s = &self.settings;
        let (side, _) = granularity(s.spp);
        let mut n_rays = 0;
        let mut pixels = Vec::with_capacity((side * side) as usize);
        for y in y0..(y0 + side).min(s.height) {
            for x in x0..(x0 + side).min(s.width) {
                let pixel = y * s.width + x;
                let mut mean = Accumulator::new();
                for sample in 0..s.spp {
                    // The same pattern in every pixel: edges of very bright things come out even instead of dotted.
                    let at = s.filter.sample(sequence::pixel_sample(s.seed, 0, sample, s.spp));
                    let (px, py) = (f64::from(x) + 0.5 + f64::from(at.offset.x), f64::from(y) + 0.5 + f64::from(at.offset.y));
                    let mut stream = Stream::new(s.seed, u64::from(pixel), u64::from(sample));
                    mean.add(&self.integrator.sample(world, &self.view.ray(px, py), &mut stream, &mut n_rays), at);
                }
                pixels.push(mean.finish());
            }
        }
        (pixels, n_rays)
    }
}

impl<I: Integrator> Solver for TiledRender<'_, I> {
    type Solution = Film;

    fn step(&mut self, world: &World) -> Step {
        let (side, _) = granularity(self.settings.spp);
        let columns = self.settings.width.div_ceil(side) as usize;
        let corner = |tile: usize| ((tile % columns) as u32 * side, (tile / columns) as u32 * side);
        let end = (self.next + granularity(self.settings.spp).1).min(self.n_tiles());
        let this = &*self;
        let tiles: Vec<_> = (self.next..end)
            .into_par_iter()
            .map(|tile| {
                let (x0, y0) = corner(tile);
                this.tile(world, x0, y0)
            })
            .collect();
        for (tile, (pixels, n_rays)) in (self.next..end).zip(tiles) {
            let (x0, y0) = corner(tile);
            let across = side.min(self.settings.width - x0);
            for (i, pixel) in pixels.iter().enumerate() {
                self.film.set_pixel(x0 + i as u32 % across, y0 + i as u32 / across, pixel);
            }
            self.n_rays += n_rays;
        }
        self.next = end;
        match self.n_tiles() {
            n if end == n => Step::Converged,
            n => Step::Working { done: end as f64 / n as f64 },
        }
    }

    fn solution(&self) -> &Film {
        &self.film
    }
}
