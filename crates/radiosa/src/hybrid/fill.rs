//! Filling the irradiance cache for a view: coarse lattices of pixels first, then finer ones, each asking for gathers where the cache does not reach yet.
//!
//! Gathers of one pass are made in parallel, from a cache that does not change meanwhile, and kept in the order of their pixels: the cache does not depend on
//! the number of threads.

use std::cell::RefCell;

use rayon::prelude::*;

use super::Hybrid;
use super::cache::Known;
use super::gather::{Gathered, Numbers, Shift};
use crate::math::Vec3;
use crate::raytrace::whitted::{Asked, Indirect};
use crate::sampling::{Stream, rng};
use crate::spectrum::Spectrum;
use crate::transport::{Solver, Step, Surface, View, World};

/// Pixels between neighbours of the first lattice.
const FIRST: u32 = 64;
/// Pixels between neighbours of the last lattice.
const LAST: u32 = 2;
/// Gathers made at once: later ones of a pass know the earlier ones.
const AT_ONCE: usize = 256;
/// Of the error allowed to the cache, the part that the noise of gathers may have; where those around have more they get more rays, up to so many times as many.
const NOISE: f32 = 0.06;
const MORE: f32 = 6.0;
/// What says something else than all around it is gathered again by so many times the rays, and by no more than so many where it had fewer.
const AGAIN: u32 = 8;
const MOST_AGAIN: u32 = 1 << 16;
/// Records reach this many pixels at least.
const LEAST: f32 = 3.0;
/// And this part of the picture's longer side at most: where light changes little, many records with few rays each are as quiet as few with many, and bend less.
const MOST: f32 = 1.0 / 100.0;

/// Fills the cache of a hybrid for a view: a step is a quarter of a lattice.
#[derive(Debug)]
pub struct Filling<'a, 'b> {
    hybrid: &'b mut Hybrid<'a>,
    view: &'b View,
    size: (u32, u32),
    /// Its width, in that of a camera sample.
    pixel: f32,
    stride: u32,
    /// Of the four parts of a lattice that the one before did not have.
    part: u32,
    /// Rays so far.
    n_rays: u64,
    /// Where the records that it made are: the last ones of the cache.
    made: Vec<Surface>,
}

/// How many pixels a record reaches at least and at most, in a picture of some size.
fn reach(size: (u32, u32)) -> [f32; 2] {
    [LEAST, (MOST * size.0.max(size.1) as f32).max(LEAST)]
}

/// The root of what a pixel covers, where its longer side is so wide, by 1/cos.
fn across(width: f32, cos: f32) -> f32 {
    width * cos.clamp(1.0 / 16.0, 1.0).sqrt()
}

impl<'a, 'b> Filling<'a, 'b> {
    /// Nothing is gathered yet but for what earlier views found.
    pub fn new(hybrid: &'b mut Hybrid<'a>, view: &'b View, size: (u32, u32)) -> Self {
        // Surfaces are as wide as camera samples, which are narrower where pixels have several.
        let (pixel, sample) = (view.footprint(1), hybrid.settings.whitted.footprint);
        let ratio = |of_pixel: f32, of_sample: f32| if of_sample > 0.0 { of_pixel / of_sample } else { 1.0 };
        let widths = ratio(pixel.growth, sample.growth).max(ratio(pixel.at_eye, sample.at_eye));
        for known in std::mem::take(&mut hybrid.known) {
            let way = known.p - view.eye();
            let (distance, cos) = (way.length(), known.n.dot(way.normalize_or_zero()).abs());
            let reach = reach(size).map(|pixels| pixels * across(pixel.width(distance, cos), cos));
            hybrid.cache.insert(known, reach);
        }
        Self { pixel: widths, hybrid, view, size, stride: FIRST, part: 0, n_rays: 0, made: Vec::new() }
    }

    /// Rays traced so far.
    pub fn n_rays(&self) -> u64 {
        self.n_rays
    }

    /// Gathers once more where few rays that met something bright have made a spot.
    fn doubt(&mut self) {
        let before = self.hybrid.cache.len() - self.made.len();
        let doubted = self.hybrid.cache.doubted(before, super::STRETCHED);
        let hybrid = &*self.hybrid;
        let again = |&i: &usize| {
            let (n, rays) = hybrid.cache.asked(i);
            let (key, mut n_rays) = (rng::key(&[hybrid.settings.seed, i as u64, 0x6461_696E_6165]), 0);
            let rays = (AGAIN * rays).min(rays.max(MOST_AGAIN));
            (hybrid.gather.gather(&self.made[i - before], n, rays, key, &mut n_rays), n_rays)
        };
        let gathered: Vec<_> = doubted.par_iter().map(again).collect();
        for (i, (gathered, n_rays)) in doubted.into_iter().zip(gathered) {
            self.n_rays += n_rays;
            self.hybrid.cache.replace(i, gathered, super::STRETCHED);
        }
    }

    /// The pixels of this step.
    fn pixels(&self) -> Vec<(u32, u32)> {
        let s = self.stride;
        // The first lattice whole, of others what is new: between in x and y, in x, in y.
        let (x0, y0, step) = match (s == FIRST, self.part) {
            (true, _) => (0, 0, s),
            (false, 0) => (s, s, 2 * s),
            (false, 1) => (s, 0, 2 * s),
            (false, _) => (0, s, 2 * s),
        };
        let (width, height) = self.size;
        (y0..height).step_by(step as usize).flat_map(|y| (x0..width).step_by(step as usize).map(move |x| (x, y))).collect()
    }
}

impl<'a> Solver for Filling<'a, '_> {
    type Solution = Hybrid<'a>;

    fn step(&mut self, world: &World) -> Step {
        if self.hybrid.settings.cache <= 0.0 || self.stride < LAST {
            return Step::Converged;
        }
        let pixels = self.pixels();
        let hybrid = &*self.hybrid;
        let asked = |&(x, y): &(u32, u32)| {
            let pixel = u64::from(y) * u64::from(self.size.0) + u64::from(x);
            let mut stream = Stream::new(hybrid.settings.seed, pixel, 0);
            let ray = self.view.sample_ray(f64::from(x) + 0.5, f64::from(y) + 0.5, &mut stream);
            let (wanting, mut n_rays) = (Wanting { hybrid, found: RefCell::default() }, 0);
            hybrid.whitted.trace(world, &ray, &mut stream, &mut n_rays, Some(&wanting));
            (wanting.found.into_inner(), n_rays)
        };
        let found: Vec<_> = pixels.par_iter().map(asked).collect();
        self.n_rays += found.iter().map(|(_, n)| n).sum::<u64>();
        let pixel = self.pixel;
        let [least, most] = reach(self.size);
        let wanted: Vec<Wanted> = found.into_iter().flat_map(|(wanted, _)| wanted).collect();
        for some in wanted.chunks(AT_ONCE) {
            let hybrid = &*self.hybrid;
            let allowed = NOISE * hybrid.settings.cache;
            let unknown: Vec<&Wanted> =
                some.iter().filter(|w| hybrid.cache.irradiance(w.surface.p, w.n, 1.0).is_none()).collect();
            let shifts = hybrid.shifts(&unknown, most * pixel);
            let first = hybrid.cache.len() as u64;
            let pattern = rng::key(&[hybrid.settings.seed, 0x7061_7474_6572_6E73]);
            let gather = |(i, w): (usize, &&Wanted)| {
                let key = rng::key(&[hybrid.settings.seed, first + i as u64, 0x6761_7468_6572]);
                let mut n_rays = 0;
                // (Its own error may not decide: what is bright by chance has a large one, too, and would count for less.)
                let known = hybrid.cache.noise(w.surface.p, w.n, super::STRETCHED).unwrap_or_else(|| {
                    let look = hybrid.gather.gather(&w.surface, w.n, hybrid.settings.rays, rng::mix(key), &mut n_rays);
                    look.error_of_one()
                });
                let times = Gathered::rays_for(allowed, known) / hybrid.settings.rays as f32;
                // (In whole steps: only gathers of as many cells have cells in common.)
                let rays = hybrid.settings.rays * times.clamp(1.0, MORE) as u32;
                let numbers = Numbers { key, pattern, shift: shifts[i] };
                let gathered = hybrid.gather.gather_shifted(&w.surface, w.n, rays, numbers, &mut n_rays);
                (gathered, n_rays)
            };
            let gathered: Vec<_> = unknown.par_iter().enumerate().map(gather).collect();
            let unknown: Vec<Wanted> = unknown.into_iter().copied().collect();
            for ((w, shift), (gathered, n_rays)) in unknown.iter().zip(shifts).zip(gathered) {
                self.n_rays += n_rays;
                let reach = [least, most].map(|pixels| pixels * pixel * w.width);
                self.hybrid.cache.insert(Known { p: w.surface.p, n: w.n, gathered, shift }, reach);
                self.made.push(w.surface);
            }
        }
        let is_last_part = self.stride == FIRST || self.part == 2;
        (self.stride, self.part) = if is_last_part { (self.stride / 2, 0) } else { (self.stride, self.part + 1) };
        if self.stride < LAST {
            self.doubt();
            return Step::Converged;
        }
        let stages = f64::from(FIRST.ilog2() - LAST.ilog2() + 1);
        Step::Working { done: f64::from(FIRST.ilog2() - self.stride.ilog2()) / stages }
    }

    fn solution(&self) -> &Hybrid<'a> {
        self.hybrid
    }
}

impl Hybrid<'_> {
    /// Shifts for gathers at some places, that fit those of records and of one another; `width` is how far apart they are at most, in widths of camera samples.
    fn shifts(&self, places: &[&Wanted], width: f32) -> Vec<Shift> {
        let mut shifts: Vec<Shift> = Vec::with_capacity(places.len());
        for (i, w) in places.iter().enumerate() {
            let reach = super::STRETCHED * width * w.width;
            let weight = |other: &Wanted| {
                let near = 1.0 - w.surface.p.distance(other.surface.p) / reach;
                if near > 0.0 && w.n.dot(other.n) > 0.99 { near * near } else { 0.0 }
            };
            let others = places.iter().zip(&shifts).map(|(other, shift)| (weight(other), *shift)).filter(|other| other.0 > 0.0);
            let key = rng::key(&[self.settings.seed, (self.cache.len() + i) as u64, 0x7368_6966_7473]);
            let shift = self.cache.shift(w.surface.p, w.n, super::STRETCHED, others, key);
            shifts.push(shift);
        }
        shifts
    }
}

/// A place whose irradiance is asked for.
#[derive(Clone, Copy)]
struct Wanted {
    surface: Surface,
    n: Vec3,
    /// Of a camera sample there: the root of what it covers, metres.
    width: f32,
}

/// Notes where the cache does not reach.
struct Wanting<'a> {
    hybrid: &'a Hybrid<'a>,
    found: RefCell<Vec<Wanted>>,
}

impl Indirect for Wanting<'_> {
    fn irradiance(&self, at: &Asked<'_>, _: &mut Stream, _: &mut u64) -> Spectrum {
        if self.hybrid.cache.irradiance(at.surface.p, at.n, 1.0).is_none() {
            let width = across(at.surface.width, at.cos.abs());
            self.found.borrow_mut().push(Wanted { surface: *at.surface, n: at.n, width });
        }
        Spectrum::BLACK
    }

    fn wants_light(&self) -> bool {
        false
    }
}
