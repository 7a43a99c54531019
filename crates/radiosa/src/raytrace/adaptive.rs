//! Adaptive pixel supersampling as in [Whitted80]: samples at the corners of pixels, shared by the four that meet there, and more where they differ.
//!
//! A square whose four corners agree shows their mean. Where they differ by more than a threshold, or where a pixel's corners see different
//! objects, it is cut into four, up to [`Settings::max_level`] times; a pixel is the mean of its squares by area. A thing so small that it
//! falls between the corners of a pixel is not found, which is this method's known flaw: more samples a pixel, by [`super::tiles`], find it sooner.

use std::ops::Range;

use super::tiles::TileLoop;
use crate::film::{Film, FilmError, Layer, Pixel};
use crate::sampling::Stream;
use crate::spectrum::Spectrum;
use crate::transport::{Integrator, Solver, Step, View, World};

/// The finest subdivision there is: 32 × 32 squares a pixel.
pub const LEVEL_LIMIT: u32 = 5;
/// Pixels a side of a tile, and tiles a step, by how far a sample branches. Corners on the border of a tile are computed by both sides, to the same bits.
const fn granularity(branching: u32) -> (u32, usize) {
    match branching {
        0..=4 => (32, 8),
        5..=64 => (16, 8),
        _ => (4, 16),
    }
}

/// How a picture is sampled.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// A square is cut when a channel differs by more than this between two corners, in parts of `white`.
    pub threshold: f32,
    /// The radiance that shows as white; what is brighter counts as that.
    pub white: f32,
    /// A pixel is cut into at most `2^max_level` squares a side; at most [`LEVEL_LIMIT`].
    pub max_level: u32,
    /// Key of every random stream.
    pub seed: u64,
    /// What the film keeps.
    pub layers: Vec<Layer>,
}

/// A picture in the making.
pub struct AdaptiveRender<'a, I> {
    integrator: &'a I,
    view: &'a View,
    settings: Settings,
    progress: TileLoop,
}

impl<'a, I: Integrator> AdaptiveRender<'a, I> {
    /// Nothing drawn yet.
    ///
    /// # Errors
    /// When the film cannot be had.
    pub fn new(integrator: &'a I, view: &'a View, settings: Settings) -> Result<Self, FilmError> {
        let film = Film::new(settings.width, settings.height, &settings.layers)?;
        let settings = Settings { max_level: settings.max_level.min(LEVEL_LIMIT), ..settings };
        Ok(Self { integrator, view, settings, progress: TileLoop::new(film, granularity(integrator.branching())) })
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

impl<I: Integrator> Solver for AdaptiveRender<'_, I> {
    type Solution = Film;

    fn step(&mut self, world: &World) -> Step {
        let (s, integrator, view) = (&self.settings, self.integrator, self.view);
        self.progress
            .step_tiles(&|columns, rows, part, n_rays| Tile { world, integrator, view, s, n_rays }.fill(columns, rows, part))
    }

    fn solution(&self) -> &Film {
        &self.progress.film
    }
}

struct Tile<'a, I> {
    world: &'a World,
    integrator: &'a I,
    view: &'a View,
    s: &'a Settings,
    n_rays: &'a mut u64,
}

/// The samples of one pixel on the finest lattice, those that were taken, and what part of the pixel each stands for.
struct Lattice {
    samples: Vec<Option<(Pixel, f64)>>,
    side: usize,
}

impl<I: Integrator> Tile<'_, I> {
    fn fill(&mut self, columns: Range<u32>, rows: Range<u32>, part: &mut Film) {
        let n = 1 << self.s.max_level;
        let mut lattice = Lattice { samples: vec![None; (n + 1) * (n + 1)], side: n + 1 };
        let across = columns.len() + 1;
        let mut corners = Vec::with_capacity(across * (rows.len() + 1));
        for y in rows.start..=rows.end {
            for x in columns.start..=columns.end {
                corners.push(self.sample(u64::from(x) * n as u64, u64::from(y) * n as u64));
            }
        }
        for (j, y) in rows.enumerate() {
            for (i, x) in columns.clone().enumerate() {
                let k = j * across + i;
                lattice.samples.fill(None);
                for (corner, at) in [(k, (0, 0)), (k + 1, (n, 0)), (k + across, (0, n)), (k + across + 1, (n, n))] {
                    *lattice.at(at) = Some((corners[corner], 0.0));
                }
                self.cut(&mut lattice, (x, y), (0, 0), n);
                part.set_pixel(i as u32, j as u32, &lattice.finish());
            }
        }
    }

    /// The sample at a point of the lattice that covers the whole picture, the same for every pixel that uses it.
    fn sample(&mut self, i: u64, j: u64) -> Pixel {
        let n = f64::from(1u32 << self.s.max_level);
        let mut stream = Stream::new(self.s.seed, i, j);
        let ray = self.view.sample_ray(i as f64 / n, j as f64 / n, &mut stream);
        self.integrator.sample(self.world, &ray, &mut stream, self.n_rays)
    }

    /// Weighs the corners of a square of `size`, or of its quarters.
    fn cut(&mut self, lattice: &mut Lattice, (x, y): (u32, u32), (i, j): (usize, usize), size: usize) {
        let n = 1usize << self.s.max_level;
        let corners = [(i, j), (i + size, j), (i, j + size), (i + size, j + size)];
        for at in corners {
            if lattice.at(at).is_none() {
                let sample = self.sample(u64::from(x) * n as u64 + at.0 as u64, u64::from(y) * n as u64 + at.1 as u64);
                *lattice.at(at) = Some((sample, 0.0));
            }
        }
        if size > 1 && self.differ(corners.map(|at| lattice.at(at).map_or_else(Pixel::default, |s| s.0)), size == n) {
            let half = size / 2;
            for (di, dj) in [(0, 0), (half, 0), (0, half), (half, half)] {
                self.cut(lattice, (x, y), (i + di, j + dj), half);
            }
            return;
        }
        let part = (size as f64 / n as f64).powi(2) / 4.0;
        for at in corners {
            lattice.at(at).iter_mut().for_each(|sample| sample.1 += part);
        }
    }

    fn differ(&self, corners: [Pixel; 4], is_whole: bool) -> bool {
        if is_whole && corners.iter().any(|c| c.object != corners[0].object) {
            return true;
        }
        let shown = |c: &Pixel| c.color.map(|v| (v / self.s.white).min(1.0));
        let (mut lo, mut hi) = (shown(&corners[0]), shown(&corners[0]));
        for c in corners.iter().skip(1).map(shown) {
            lo = Spectrum::new(lo.r.min(c.r), lo.g.min(c.g), lo.b.min(c.b));
            hi = Spectrum::new(hi.r.max(c.r), hi.g.max(c.g), hi.b.max(c.b));
        }
        (hi - lo).max_channel() > self.s.threshold
    }
}

impl Lattice {
    fn at(&mut self, (i, j): (usize, usize)) -> &mut Option<(Pixel, f64)> {
        &mut self.samples[j * self.side + i]
    }

    /// The mean by area; place and object are those of the sample nearest to the middle.
    fn finish(&self) -> Pixel {
        let weighed = || self.samples.iter().enumerate().filter_map(|(k, s)| s.as_ref().map(|s| (k, s)));
        let mut pixel = Pixel::blend(weighed().map(|(_, (sample, weight))| (sample, *weight)));
        let middle = (self.side - 1) as i64;
        let distance = |k: usize| {
            let (i, j) = (2 * (k % self.side) as i64 - middle, 2 * (k / self.side) as i64 - middle);
            i * i + j * j
        };
        if let Some((_, (nearest, _))) = weighed().min_by_key(|(k, _)| distance(*k)) {
            (pixel.position, pixel.depth, pixel.object) = (nearest.position, nearest.depth, nearest.object);
        }
        pixel
    }
}
