//! From an [`Integrator`] to a picture that is whole from the first moment and gets better: pass after pass over all of it.
//!
//! The first pass begins with a sample for every square of some pixels, and divides the squares until each pixel has its own. Every further pass adds one sample a
//! pixel, until there are as many as asked for; sample k of a pixel is the same whatever their number will be, so that a picture that was stopped after N
//! passes is the picture of N samples. Where an error is asked for instead, after a few passes samples go where they bring it down most ([`error`]), in batches
//! that blocks of pixels decide about together: samples of a pixel never decide about that pixel alone, which would make it too dark.
//!
//! Where paths begin at light sources as well, each round of camera samples is followed by as many passes of those as make up for it ([`light`]).
//!
//! A state can be written and read, to go on to the same bits.

mod block;
mod error;
mod light;

use std::io;

use rayon::prelude::*;

use crate::film::{Film, FilmError, FilterSample, Layer, Pixel, Sampling};
use crate::sampling::{Stream, sequence};
use crate::stream::{In, Out, wrong};
use crate::transport::{Integrator, Solver, Step, View, World};

use block::{Block, Layout, PIXELS, SIDE};
use error::Error;
use light::LightImage;

/// Samples a pixel has at most.
pub const MAX_SAMPLES: u32 = 1 << 16;
/// Rays of the first picture, about, by the count of [`Integrator::branching`].
const FIRST: u64 = 1 << 15;
/// Rays of a step, about: what is done between two looks at the clock.
const A_STEP: u64 = 1 << 16;
/// Samples of a block in a step, a pixel: a step is shared by threads in blocks.
const AT_ONCE: u32 = 16;
/// Samples every pixel has before blocks differ: at least and at most, powers of two, and how many there are for an error. An edge that none of n samples has met, as may be in all
/// pixels along it, is an error of up to 1/n in those pixels.
const EVEN: [u32; 2] = [4, 32];
const EVEN_FOR_NOISE: f64 = 0.4;
/// The film is composed again after this part of new samples; while pixels have not all their first one, after this.
const REFRESH: f64 = 1.0 / 16.0;
const REFRESH_FIRST: f64 = 1.0;

/// What is wanted of a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Size, filter, seed, layers; and samples of a pixel at most.
    pub sampling: Sampling,
    /// The error to stop at, `sqrt(mean of Var/(L² + ε))` over pixels and channels, ε half the square of the picture's mean luminance; samples
    /// then go where they are needed. `None` for as many samples in every pixel.
    pub noise: Option<f64>,
    /// Errors of neighbouring pixels cancel as far as may be, which makes fine grain of noise, the best at this many samples a pixel. The errors of pixels alone are the same.
    pub blue_noise: Option<u32>,
}

/// A picture in the making.
pub struct ProgressiveRender<'a, I> {
    integrator: &'a I,
    view: &'a View,
    settings: Settings,
    layout: Layout,
    blocks: Vec<Block>,
    film: Film,
    /// What paths from the light add.
    light: Option<LightImage>,
    /// Passes of those that are wanted.
    light_target: u32,
    /// Pixels a side of the squares that the first pass is at; 0 behind it.
    cell: u32,
    /// The block that is next.
    next: usize,
    /// Samples taken when the film was composed.
    shown: u64,
    noise: Option<f64>,
    /// All of what was wanted has been done, and nothing of what is wanted next.
    is_even: bool,
    /// Nothing is wanted any more.
    is_done: bool,
}

impl<'a, I: Integrator> ProgressiveRender<'a, I> {
    /// Nothing drawn yet.
    ///
    /// # Errors
    /// When the film cannot be had.
    pub fn new(integrator: &'a I, view: &'a View, settings: Settings) -> Result<Self, FilmError> {
        let s = &settings.sampling;
        let film = Film::new(s.width, s.height, &s.layers)?;
        let layout = Layout::new(&s.layers, s.filter);
        let blocks = block::blocks(&film, &layout);
        let (mut cell, first) = (1u32, (FIRST / u64::from(integrator.branching().max(1))).max(1));
        while u64::from(s.width.div_ceil(cell)) * u64::from(s.height.div_ceil(cell)) > first {
            cell *= 2;
        }
        let (noise, is_even, is_done) = (None, false, false);
        let light = integrator.has_splats().then(|| LightImage::new(&film, s.filter));
        let (next, shown, light_target) = (0, 0, 1);
        Ok(Self {
            integrator,
            view,
            layout,
            blocks,
            film,
            light,
            light_target,
            cell,
            next,
            shown,
            noise,
            is_even,
            is_done,
            settings,
        })
    }

    /// What a picture in the making takes beside its film, bytes.
    pub fn memory(sampling: &Sampling) -> u64 {
        let pixels = |side: u32| u64::from(side.div_ceil(SIDE) * SIDE);
        let bytes = Layout::new(&sampling.layers, sampling.filter).bytes_a_pixel() + size_of::<Block>() as u64 / PIXELS as u64;
        let bytes = bytes + LightImage::BYTES_A_PIXEL;
        pixels(sampling.width) * pixels(sampling.height) * bytes
    }

    /// Rays traced so far, of every kind.
    pub fn n_rays(&self) -> u64 {
        self.blocks.iter().map(|b| b.n_rays).sum::<u64>() + self.light.as_ref().map_or(0, |light| light.n_rays)
    }

    /// Camera samples taken so far.
    pub fn n_samples(&self) -> u64 {
        self.blocks.iter().map(|b| if b.n == 0 { u64::from(b.begun.count_ones()) } else { u64::from(b.n * b.n_pixels()) }).sum()
    }

    /// The fewest samples of a pixel, and the most.
    pub fn samples_a_pixel(&self) -> [u32; 2] {
        let n = || self.blocks.iter().map(|b| b.n);
        [n().min().unwrap_or(0), n().max().unwrap_or(0)]
    }

    /// Camera samples still to be taken before it is decided what is wanted next.
    pub fn n_wanted(&self) -> u64 {
        let wanted: u64 = self.blocks.iter().map(|b| u64::from(b.target - b.n) * u64::from(b.n_pixels())).sum();
        if self.cell > 0 { wanted.saturating_sub(self.n_samples()) } else { wanted }
    }

    /// Every pixel has at least one sample.
    pub fn is_whole(&self) -> bool {
        self.cell == 0
    }

    /// A state that the same work always passes through: all of what was wanted has been done.
    pub fn is_even(&self) -> bool {
        self.is_even
    }

    /// The estimated error, see [`Settings::noise`]; `None` before there are two samples in every pixel.
    pub fn noise(&self) -> Option<f64> {
        self.noise
    }

    /// The picture as it is.
    pub fn into_film(mut self) -> Film {
        self.show();
        self.film
    }

    /// Composes the film.
    fn show(&mut self) {
        self.shown = self.n_samples();
        let (blocks, layout, light) = (&self.blocks, &self.layout, self.light.as_ref());
        let (width, across) = (self.settings.sampling.width, self.settings.sampling.width.div_ceil(SIDE));
        let factors = if self.film.has(Layer::Variance) { Error::of(blocks).factors(blocks, width) } else { Vec::new() };
        // Where the first pass has not been: what stands for the smallest square that has a sample.
        let at = |[x, y]: [u32; 2], cell: u32| {
            let pixel = [x & !(cell - 1), y & !(cell - 1)];
            ((pixel[1] / SIDE * across + pixel[0] / SIDE) as usize, Block::local(pixel))
        };
        let standing_for = |i: u32| {
            let pixel = [i % width, i / width];
            let has = |cell: &u32| {
                let (i, k) = at(pixel, *cell);
                blocks[i].n > 0 || blocks[i].begun >> k & 1 == 1
            };
            (0..16u8).find(|k| has(&(1 << k))).unwrap_or(0)
        };
        let n_pixels = self.film.n_pixels() as u32;
        let cells: Vec<u8> = if self.cell > 0 { (0..n_pixels).into_par_iter().map(standing_for).collect() } else { Vec::new() };
        let place = |pixel: [u32; 2]| at(pixel, 1 << cells.get((pixel[1] * width + pixel[0]) as usize).unwrap_or(&0));
        self.film.compose(
            |layer, c, pixel| {
                let (i, k) = place(pixel);
                let value = blocks[i].value(layout, layer, c, k, factors.get(i).copied().unwrap_or(1.0));
                value + light.map_or(0.0, |light| light.value(layer, c, pixel))
            },
            |pixel| {
                let (i, k) = place(pixel);
                blocks[i].object(k)
            },
        );
    }

    /// Does some of what is wanted; false when there is nothing left of it.
    fn work(&mut self, world: &World) -> bool {
        let is_wanting = self.cell > 0 || self.blocks.iter().any(|b| b.n < b.target);
        if let Some(light) = self.light.as_mut().filter(|light| !is_wanting && light.n < self.light_target) {
            self.is_even = false;
            let splats = self.integrator.splats(world, self.settings.sampling.seed, light.n, &mut light.n_rays);
            light.add(&splats);
            return light.n < self.light_target;
        }
        let (s, integrator, view, layout, cell) = (&self.settings.sampling, self.integrator, self.view, &self.layout, self.cell);
        let bits = self.settings.blue_noise.map(|n| n.clamp(1, MAX_SAMPLES).next_power_of_two().trailing_zeros());
        // The same pattern in every pixel, as for fixed samples; the first ones of it do not depend on how many there will be.
        let at = |k: u32| s.filter.sample(sequence::pixel_sample(s.seed, 0, k, MAX_SAMPLES));
        let draw = |at: FilterSample, [x, y]: [u32; 2], k: u32, n_rays: &mut u64| -> Pixel {
            let (px, py) = (f64::from(x) + 0.5 + f64::from(at.offset.x), f64::from(y) + 0.5 + f64::from(at.offset.y));
            let pixel = u64::from(y) * u64::from(s.width) + u64::from(x);
            let mut stream = match bits {
                None => Stream::new(s.seed, pixel, u64::from(k)),
                Some(bits) => Stream::along_curve(s.seed, pixel, u64::from(k), sequence::along_curve(x, y), bits),
            };
            let ray = view.sample_ray(px, py, &mut stream);
            integrator.sample(world, &ray, &mut stream, n_rays)
        };
        let is_mosaic = self.shown == 0;
        let wanted = |b: &Block| {
            if cell > 0 { b.wanting(cell).count() as u64 } else { u64::from((b.target - b.n).min(AT_ONCE) * b.n_pixels()) }
        };
        let (start, mut end, mut left) = (self.next, self.next, A_STEP / u64::from(integrator.branching().max(1)));
        while end < self.blocks.len() && (left > 0 || is_mosaic) {
            left = left.saturating_sub(wanted(&self.blocks[end]));
            end += 1;
        }
        self.blocks[start..end].par_iter_mut().for_each(|block| {
            if cell > 0 {
                let first = at(0);
                block.begin(layout, cell, first, |pixel, k, n_rays| draw(first, pixel, k, n_rays));
                return;
            }
            for _ in 0..(block.target - block.n).min(AT_ONCE) {
                let next = at(block.n);
                block.go_on(layout, next, |pixel, k, n_rays| draw(next, pixel, k, n_rays));
            }
        });
        self.is_even = false;
        self.next = if end < self.blocks.len() { end } else { 0 };
        if self.next > 0 {
            return true;
        }
        self.cell /= 2;
        self.cell > 0
            || self.blocks.iter().any(|b| b.n < b.target)
            || self.light.as_ref().is_some_and(|light| light.n < self.light_target)
    }

    /// Decides what is wanted next, after all that was is done.
    fn decide(&mut self) {
        self.is_even = true;
        let (layout, light) = (&self.layout, self.light.as_ref());
        let beside = |pixel: [u32; 2]| light.map_or([0.0; 3], |light| light.color(pixel));
        let colors: Vec<[f64; 3]> = self
            .blocks
            .par_iter()
            .map(|b| {
                let (mut sum, pixels) = ([0.0; 3], b.rows.clone().flat_map(|y| b.columns.clone().map(move |x| [x, y])));
                pixels.for_each(|p| {
                    let colors = b.color(layout, Block::local(p)).into_iter().zip(beside(p));
                    sum.iter_mut().zip(colors).for_each(|(sum, (v, beside))| *sum += v + beside);
                });
                sum
            })
            .collect();
        let n_pixels = self.film.n_pixels() as f64;
        let mean: [f64; 3] = std::array::from_fn(|c| colors.iter().map(|v| v[c]).sum::<f64>() / n_pixels);
        let epsilon = 0.5 * crate::spectrum::luminance(mean).powi(2);
        self.blocks.par_iter_mut().for_each(|b| b.measure(layout, epsilon, beside));
        let error = Error::of(&self.blocks);
        let [from_eye, from_light] = [error.sum(&self.blocks), light.map(|light| light.error(&self.blocks, layout, epsilon))];
        let is_known = light.is_none_or(|light| light.n >= 2);
        self.noise = from_eye.filter(|_| is_known).map(|sum| ((sum + from_light.unwrap_or(0.0)) / (3.0 * n_pixels)).sqrt());
        let (n, most) = (self.samples_a_pixel()[0], self.settings.sampling.spp.clamp(1, MAX_SAMPLES));
        let even =
            self.settings.noise.map(|wanted| ((EVEN_FOR_NOISE / wanted) as u32).clamp(EVEN[0], EVEN[1]).next_power_of_two());
        let may_differ = even.is_some_and(|even| n >= even);
        let is_good = may_differ && self.settings.noise.zip(self.noise).is_some_and(|(wanted, noise)| noise <= wanted);
        self.is_done = is_good
            || if may_differ {
                !error.ask(&mut self.blocks, self.film.width(), most)
            } else {
                self.blocks.iter_mut().for_each(|b| b.target = (n + 1).min(most));
                n >= most
            };
        if let Some(light) = &self.light {
            let mean = self.blocks.iter().map(|b| u64::from(b.target * b.n_pixels())).sum::<u64>() as f64 / n_pixels;
            // Where samples go where they are needed, these are needed where most of the error is theirs.
            let is_noisy = may_differ && from_light > from_eye;
            let more = if is_noisy { light.n + light.n.div_ceil(4) } else { light.n };
            self.light_target = more.max(mean as u32).min(most);
        }
    }

    /// The part that is done: of samples, or of those an error that falls with their root would take.
    fn done(&self) -> f64 {
        let all = self.film.n_pixels() as f64 * f64::from(self.settings.sampling.spp);
        let of_samples = self.n_samples() as f64 / all;
        let of_noise = self.settings.noise.zip(self.noise).map_or(0.0, |(wanted, noise)| (wanted / noise).powi(2));
        of_samples.max(of_noise).min(0.999_999)
    }

    /// Writes how far it is.
    ///
    /// # Errors
    /// When the stream cannot take it.
    pub fn store(&self, out: &mut Out) -> io::Result<()> {
        let flags = u64::from(self.is_done) | u64::from(self.is_even) << 1 | u64::from(self.noise.is_some()) << 2;
        for number in [u64::from(self.cell), self.next as u64, flags] {
            out.number(number)?;
        }
        out.array(&[self.noise.unwrap_or(0.0)])?;
        if let Some(light) = &self.light {
            out.number(u64::from(self.light_target))?;
            light.store(out)?;
        }
        self.blocks.iter().try_for_each(|b| b.store(out))
    }

    /// Goes on from what [`Self::store`] wrote of the same picture: of the same size, filter, seed and layers, and asked for an error or not.
    ///
    /// # Errors
    /// When the stream ends, or holds something else or more samples than are wanted.
    pub fn restore(&mut self, from: &mut In) -> io::Result<()> {
        let (cell, next, flags) = (from.number()?, from.number()?, from.number()?);
        let noise: Vec<f64> = from.array(1)?;
        let is_possible = cell == 0 || (cell.is_power_of_two() && cell <= u64::from(Film::MAX_SIDE));
        if !is_possible || next >= self.blocks.len() as u64 {
            return Err(wrong("it is nowhere in the picture"));
        }
        (self.cell, self.next, self.noise) = (cell as u32, next as usize, (flags & 4 > 0).then_some(noise[0]));
        self.is_even = flags & 2 > 0;
        if let Some(light) = &mut self.light {
            self.light_target = u32::try_from(from.number()?).map_err(|_| wrong("it wants too many passes"))?.min(MAX_SAMPLES);
            light.restore(from)?;
        }
        self.blocks.iter_mut().try_for_each(|b| b.restore(from))?;
        if self.cell > 0 && self.blocks.iter().any(|b| b.n > 1) {
            return Err(wrong("its first pass is not the first"));
        }
        let most = self.settings.sampling.spp.clamp(1, MAX_SAMPLES);
        if self.samples_a_pixel()[1] > most {
            return Err(wrong("it has more samples than --spp asks for"));
        }
        if self.settings.noise.is_none() {
            self.blocks.iter_mut().for_each(|b| b.target = b.target.min(most));
            self.light_target = self.light_target.min(most);
            if self.light.as_ref().is_some_and(|light| light.n > most) {
                return Err(wrong("it has more passes from the light than --spp asks for"));
            }
        }
        // Whoever wants more samples or less noise than before goes on.
        if flags & 1 > 0 {
            self.decide();
        }
        self.show();
        Ok(())
    }
}

impl<I: Integrator> Solver for ProgressiveRender<'_, I> {
    type Solution = Film;

    fn step(&mut self, world: &World) -> Step {
        if self.is_done {
            return Step::Converged;
        }
        if !self.work(world) {
            self.decide();
        }
        // Composing takes time for all pixels, however few samples are new.
        let new = (self.n_samples() - self.shown) as f64 / self.shown as f64;
        if self.is_done || (self.cell > 0 && new >= REFRESH_FIRST) || (self.is_even() && new >= REFRESH) {
            self.show();
        }
        if self.is_done { Step::Converged } else { Step::Working { done: self.done() } }
    }

    /// As it was after the last pass, or a little before.
    fn solution(&self) -> &Film {
        &self.film
    }
}
