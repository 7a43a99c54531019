//! From an [`Integrator`] to a picture, tile by tile.

use rayon::prelude::*;

use crate::film::{Accumulator, Film, FilmError, Filter, Layer, Pixel};
use crate::sampling::{Stream, sequence};
use crate::transport::{Integrator, Solver, Step, View, World};

/// Pixels a side of a tile: large enough that neighbouring rays share caches, small enough to spread over threads.
const TILE: u32 = 16;
/// Tiles a step: the unit of progress and of interruption. Fixed, so that what a step does never depends on the machine.
const TILES_PER_STEP: usize = 32;

/// How a picture is sampled.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Camera samples a pixel, at least 1; with one, it is the pixel's centre when the filter is the box.
    pub spp: u32,
    /// Reconstruction filter.
    pub filter: Filter,
    /// Key of every random stream.
    pub seed: u64,
    /// What the film keeps.
    pub layers: Vec<Layer>,
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
        self.settings.width.div_ceil(TILE) as usize * self.settings.height.div_ceil(TILE) as usize
    }

    /// The pixels of a tile, row by row, and the rays they took.
    fn tile(&self, world: &World, x0: u32, y0: u32) -> (Vec<Pixel>, u64) {
        let s = &self.settings;
        let mut n_rays = 0;
        let mut pixels = Vec::with_capacity((TILE * TILE) as usize);
        for y in y0..(y0 + TILE).min(s.height) {
            for x in x0..(x0 + TILE).min(s.width) {
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
        let columns = self.settings.width.div_ceil(TILE) as usize;
        let corner = |tile: usize| ((tile % columns) as u32 * TILE, (tile / columns) as u32 * TILE);
        let end = (self.next + TILES_PER_STEP).min(self.n_tiles());
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
            let across = TILE.min(self.settings.width - x0);
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
