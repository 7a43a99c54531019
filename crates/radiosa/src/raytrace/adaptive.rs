//! Adaptive pixel supersampling as in [Whitted80]: samples at the corners of pixels, shared by the four that meet there, and more where they differ.
//!
//! A square whose four corners agree shows their mean. Where they differ by more than a threshold, or where a pixel's corners see different
//! objects, it is cut into four, up to [`Settings::max_level`] times; a pixel is the mean of its squares by area. A thing so small that it
//! falls between the corners of a pixel is not found, which is this method's known flaw: more samples a pixel, by [`super::tiles`], find it sooner.

use std::ops::Range;

use super::tiles::{TileLoop, samples_a_step};
use crate::film::{Film, FilmError, Layer, Pixel};
use crate::sampling::Stream;
use crate::spectrum::Spectrum;
use crate::transport::{Integrator, Solver, Step, View, World};

/// The finest subdivision there is: 32 × 32 squares a pixel.
pub const LEVEL_LIMIT: u32 = 5;
/// Pixels a side of a tile, by how far a sample branches: all its corners come first. Those on the border of a tile are computed by both sides, to the same
/// bits.
const fn side(branching: u32) -> u32 {
    match branching {
        0..=4 => 32,
        5..=64 => 16,
        _ => 8,
    }
}
/// Tiles worked on together.
const TILES_AT_ONCE: usize = 16;

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
    progress: TileLoop<Tile>,
}

impl<'a, I: Integrator> AdaptiveRender<'a, I> {
    /// Nothing drawn yet.
    ///
    /// # Errors
    /// When the film cannot be had.
    pub fn new(integrator: &'a I, view: &'a View, settings: Settings) -> Result<Self, FilmError> {
        let film = Film::new(settings.width, settings.height, &settings.layers)?;
        let settings = Settings { max_level: settings.max_level.min(LEVEL_LIMIT), ..settings };
        let progress = TileLoop::new(film, side(integrator.branching()), TILES_AT_ONCE);
        Ok(Self { integrator, view, settings, progress })
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
        let begin = |columns, rows| Tile { columns, rows, corners: Vec::new(), pixel: 0, current: None };
        self.progress.step(begin, |tile, part, n_rays| {
            let left = samples_a_step(integrator.branching());
            Work { world, integrator, view, s, n_rays, left }.go_on(tile, part)
        })
    }

    fn solution(&self) -> &Film {
        &self.progress.film
    }
}

/// How far a tile is.
struct Tile {
    columns: Range<u32>,
    rows: Range<u32>,
    /// Samples at the corners of its pixels, row by row.
    corners: Vec<Pixel>,
    /// The pixel it is at, row by row.
    pixel: usize,
    current: Option<Lattice>,
}

/// A pixel in the making: the samples on its finest lattice, those that were taken, and what part of the pixel each stands for.
struct Lattice {
    samples: Vec<Option<(Pixel, f64)>>,
    side: usize,
    /// Squares to be looked at: where they begin, and their size.
    squares: Vec<(usize, usize, usize)>,
}

/// What a tile may do in a step.
struct Work<'a, I> {
    world: &'a World,
    integrator: &'a I,
    view: &'a View,
    s: &'a Settings,
    n_rays: &'a mut u64,
    /// Samples.
    left: u32,
}

impl<I: Integrator> Work<'_, I> {
    /// Goes on with a tile; how much of it is done.
    fn go_on(&mut self, tile: &mut Tile, part: &mut Film) -> f64 {
        let n = 1usize << self.s.max_level;
        let (columns, rows) = (tile.columns.len(), tile.rows.len());
        let (across, n_corners) = (columns + 1, (columns + 1) * (rows + 1));
        while tile.corners.len() < n_corners && self.left > 0 {
            let (i, j) = (tile.corners.len() % across, tile.corners.len() / across);
            let at = |start: u32, k: usize| (u64::from(start) + k as u64) * n as u64;
            let corner = self.sample(at(tile.columns.start, i), at(tile.rows.start, j));
            tile.corners.push(corner);
        }
        while tile.corners.len() == n_corners && tile.pixel < columns * rows {
            let (i, j) = (tile.pixel % columns, tile.pixel / columns);
            let lattice = tile.current.get_or_insert_with(|| {
                let k = j * across + i;
                Lattice::new(n, [k, k + 1, k + across, k + across + 1].map(|k| tile.corners[k]))
            });
            while let Some(square) = lattice.squares.pop() {
                if !self.look_at(lattice, (tile.columns.start + i as u32, tile.rows.start + j as u32), square) {
                    lattice.squares.push(square);
                    return (n_corners + tile.pixel) as f64 / (n_corners + columns * rows) as f64;
                }
            }
            part.set_pixel(i as u32, j as u32, &lattice.finish());
            tile.current = None;
            tile.pixel += 1;
        }
        (tile.corners.len() + tile.pixel) as f64 / (n_corners + columns * rows) as f64
    }

    /// The sample at a point of the lattice that covers the whole picture, the same for every pixel that uses it.
    fn sample(&mut self, i: u64, j: u64) -> Pixel {
        self.left -= 1;
        let n = f64::from(1u32 << self.s.max_level);
        let mut stream = Stream::new(self.s.seed, i, j);
        let ray = self.view.sample_ray(i as f64 / n, j as f64 / n, &mut stream);
        self.integrator.sample(self.world, &ray, &mut stream, self.n_rays)
    }

    /// Weighs the corners of a square, or puts its quarters on the list; false when no sample is left for one of them.
    fn look_at(&mut self, lattice: &mut Lattice, (x, y): (u32, u32), (i, j, size): (usize, usize, usize)) -> bool {
        let n = 1usize << self.s.max_level;
        let corners = [(i, j), (i + size, j), (i, j + size), (i + size, j + size)];
        for at in corners {
            if lattice.at(at).is_none() {
                if self.left == 0 {
                    return false;
                }
                let sample = self.sample(u64::from(x) * n as u64 + at.0 as u64, u64::from(y) * n as u64 + at.1 as u64);
                *lattice.at(at) = Some((sample, 0.0));
            }
        }
        if size > 1 && self.differ(corners.map(|at| lattice.at(at).map_or_else(Pixel::default, |s| s.0)), size == n) {
            let half = size / 2;
            lattice.squares.extend([(half, half), (0, half), (half, 0), (0, 0)].map(|(di, dj)| (i + di, j + dj, half)));
            return true;
        }
        let part = (size as f64 / n as f64).powi(2) / 4.0;
        for at in corners {
            lattice.at(at).iter_mut().for_each(|sample| sample.1 += part);
        }
        true
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
    /// With `n` squares a side, and the samples at the corners of the pixel.
    fn new(n: usize, corners: [Pixel; 4]) -> Self {
        let mut lattice = Self { samples: vec![None; (n + 1) * (n + 1)], side: n + 1, squares: vec![(0, 0, n)] };
        for (corner, at) in corners.into_iter().zip([(0, 0), (n, 0), (0, n), (n, n)]) {
            *lattice.at(at) = Some((corner, 0.0));
        }
        lattice
    }

    fn at(&mut self, (i, j): (usize, usize)) -> &mut Option<(Pixel, f64)> {
        &mut self.samples[j * self.side + i]
    }

    /// The mean by area; place and object are those of the sample nearest to the middle.
    fn finish(&self) -> Pixel {
        let weighed = || self.samples.iter().enumerate().filter_map(|(k, s)| s.as_ref().map(|s| (k, s)));
        let mut pixel = Pixel::blend(weighed().map(|(_, (sample, weight))| (sample, *weight)));
        pixel.samples = weighed().count() as f32;
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
