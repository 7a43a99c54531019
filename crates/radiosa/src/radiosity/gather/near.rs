//! What surfaces near a sensor look like in more detail than a solution has: the edges of shadows within an element, and what another gathering finds on it.
//!
//! ```text
//! H(x) = D(x) + I(x)
//! ```
//!
//! D is the light of emitting surfaces and of lamps, gathered at many points of each element that the edge of a shadow crosses. I, all other light, is smoother:
//! it is interpolated between the corners of elements, or gathered once more on elements that give a sensor much of what arrives there. So what a shadow
//! within an element does to its surroundings is right to the second reflection before the sensor; farther away only the mean of an element counts.

use std::sync::OnceLock;

use rayon::prelude::*;

use super::super::display;
use super::super::mesh::Element;
use super::{Gather, Scratch};
use crate::sampling::rng;
use crate::spectrum::{Spectrum, luminance};

/// Places along a side of an element where direct light is gathered: at first, and where it changes within the element.
const DIRECT: [usize; 2] = [2, 8];
/// It changes when the places differ by more than this part of what arrives there in all.
const CHANGE: f64 = 0.05;
/// Rays to emitters from each of these places, about.
const DIRECT_RAYS: f64 = 32.0;
/// Elements at most, and elements times emitting ones: larger meshes have smaller elements, and it would take long.
const MOST: [usize; 2] = [1 << 14, 1 << 22];

/// Places along a side of an element where light is gathered again, and rays of each, about.
const AGAIN: usize = 4;
const AGAIN_RAYS: f64 = 256.0;
/// Elements that give a sensor more than this part of what arrives are looked at again.
const SHARE: f64 = 0.03;

/// Details of the light on elements.
#[derive(Debug)]
pub(super) struct Near {
    /// D by element, `DIRECT[1]` rows of as many; of those without the edge of a shadow none.
    direct: Vec<Option<Box<[Spectrum]>>>,
    /// I at the corners of each element.
    corners: Vec<[Spectrum; 4]>,
    /// H − D of each element.
    indirect: Vec<Spectrum>,
    /// I where there is D, else H, gathered again, `AGAIN` rows of as many: whoever needs it first finds it, always the same.
    again: Vec<OnceLock<Box<[Spectrum]>>>,
}

/// A table over the unit square, `side` rows of as many, between the middles of its cells.
fn interpolated(table: &[Spectrum], side: usize, at: [f64; 2]) -> Spectrum {
    let [s, t] = at.map(|x| (x * side as f64 - 0.5).clamp(0.0, (side - 1) as f64));
    let [i, j] = [s, t].map(|x| (x as usize).min(side.saturating_sub(2)));
    let [u, v] = [(s - i as f64) as f32, (t - j as f64) as f32];
    let row = |j: usize| table[j * side + i] * (1.0 - u) + table[j * side + (i + 1).min(side - 1)] * u;
    row(j) * (1.0 - v) + row((j + 1).min(side - 1)) * v
}

/// The middles of `side × side` cells of the unit square.
fn places(side: usize) -> impl Iterator<Item = [f64; 2]> {
    (0..side * side).map(move |k| [k % side, k / side].map(|i| (i as f64 + 0.5) / side as f64))
}

impl Near {
    /// Gathers direct light on all elements; `None` where nothing emits, and where it would take long.
    pub(super) fn new(gather: &Gather) -> Option<Self> {
        let system = &gather.solution.system;
        let elements = gather.solution.mesh.elements();
        let emitting: Vec<u32> = (0..elements.len() as u32).filter(|&j| system.emission[j as usize] != [0.0; 3]).collect();
        let is_dark = emitting.is_empty() && !gather.direct.has_lamps();
        if is_dark || elements.len() > MOST[0] || elements.len() * emitting.len() > MOST[1] {
            return None;
        }
        let (means, direct): (Vec<Spectrum>, Vec<_>) = elements
            .par_iter()
            .enumerate()
            .map_init(Scratch::default, |scratch, (i, element)| {
                if element.exposed() < 1.0 || system.reflectance[i] == [0.0; 3] {
                    return (Spectrum::BLACK, None);
                }
                let mut of = |side: usize| -> Vec<Spectrum> {
                    places(side).map(|at| gather.direct_on(i, element, at, &emitting, DIRECT_RAYS, scratch)).collect()
                };
                let mean = |values: &[Spectrum]| values.iter().copied().sum::<Spectrum>() * (1.0 / values.len() as f32);
                let few = of(DIRECT[0]);
                let ends =
                    few.iter().map(|d| f64::from(d.luminance())).fold([f64::INFINITY, 0.0], |[a, b], d| [a.min(d), b.max(d)]);
                if element.corners().len() != 4 || ends[1] - ends[0] <= CHANGE * luminance(gather.solution.irradiance[i]) {
                    return (mean(&few), None);
                }
                let many = of(DIRECT[1]);
                (mean(&many), Some(many.into_boxed_slice()))
            })
            .unzip();
        let indirect = gather.solution.irradiance.iter().zip(&means).map(|(h, d)| Spectrum::from(h.map(|h| h as f32)) - *d);
        let indirect: Vec<Spectrum> = indirect.collect();
        let values: Vec<[f64; 3]> = indirect.iter().map(|i| i.to_array().map(f64::from)).collect();
        let corners = display::corner_values(gather.world, &gather.solution.mesh, &values);
        Some(Self { direct, corners, indirect, again: elements.iter().map(|_| OnceLock::new()).collect() })
    }

    /// H at a place of an element that the edge of a shadow crosses; its mean is that of the solution.
    pub(super) fn irradiance(&self, j: usize, at: [f64; 2]) -> Option<Spectrum> {
        let direct = self.direct[j].as_ref()?;
        Some(interpolated(direct, DIRECT[1], at) + super::around(self.corners[j], self.indirect[j], at))
    }

    /// H at a place of an element, gathered again.
    fn irradiance_again(&self, gather: &Gather, j: usize, at: [f64; 2]) -> Spectrum {
        let direct = self.direct[j].as_ref();
        let again = self.again[j].get_or_init(|| {
            let element = &gather.solution.mesh.elements()[j];
            let mut scratch = Scratch { reflected_only: direct.is_some(), ..Scratch::default() };
            places(AGAIN).map(|at| gather.once_more(j, element, at, AGAIN_RAYS, &mut scratch)).collect()
        });
        interpolated(again, AGAIN, at) + direct.map_or(Spectrum::BLACK, |d| interpolated(d, DIRECT[1], at))
    }

    /// Gathers again on elements that give much of what arrives, with visibilities already known.
    pub(super) fn look_again(&self, gather: &Gather, scratch: &mut Scratch) {
        let Gather { solution, .. } = gather;
        let light = |p: &super::Piece| p.factor * p.seen * luminance(p.radiosity);
        let total: f64 = scratch.pieces.iter().map(light).sum();
        for pieces in scratch.pieces.chunk_by_mut(|a, b| a.element == b.element) {
            let j = pieces[0].element as usize;
            let (element, rho) = (&solution.mesh.elements()[j], solution.system.reflectance[j]);
            let is_cut = pieces[0].place[2] < 1.0 && element.exposed() == 1.0 && rho != [0.0; 3];
            if !is_cut || pieces.iter().map(light).sum::<f64>() <= SHARE * total {
                continue;
            }
            for piece in pieces {
                let [s, t, side] = piece.place;
                let h = self.irradiance_again(gather, j, [s + 0.5 * side, t + 0.5 * side]);
                piece.radiosity = gather.reflecting(j, h);
            }
        }
    }
}

impl Gather<'_> {
    /// The light of emitting elements and of lamps at a place of an element.
    fn direct_on(
        &self,
        i: usize,
        element: &Element,
        at: [f64; 2],
        emitting: &[u32],
        rays: f64,
        scratch: &mut Scratch,
    ) -> Spectrum {
        let (n, start) = (element.normal, element.lift().in_front(element.at(at)));
        self.collect_emitting(start.as_dvec3(), n, emitting, scratch);
        self.look(start, n, rays, key_of(self.seed, i, at), scratch);
        let lamps = || self.direct.of_lamps(&self.solution.mesh.surface(self.world, element, at), n.as_vec3());
        scratch.arriving() + if self.direct.has_lamps() { lamps() } else { Spectrum::BLACK }
    }

    /// All light, or what is reflected ([`Scratch::reflected_only`]) and the sky's, at a place of an element.
    fn once_more(&self, i: usize, element: &Element, at: [f64; 2], rays: f64, scratch: &mut Scratch) -> Spectrum {
        let (n, start) = (element.normal, element.lift().in_front(element.at(at)));
        let key = key_of(self.seed, i, at);
        self.collect(start.as_dvec3(), n, scratch);
        self.look(start, n, rays, key, scratch);
        let surface = self.solution.mesh.surface(self.world, element, at);
        let lights = if scratch.reflected_only {
            self.direct.of_skies(&surface, n.as_vec3(), key)
        } else {
            self.direct.at(&surface, n.as_vec3(), key)
        };
        scratch.arriving() + lights.irradiance
    }
}

/// The key of random streams at a place of an element.
fn key_of(seed: u64, i: usize, at: [f64; 2]) -> u64 {
    rng::key(&[seed, i as u64, at[0].to_bits(), at[1].to_bits(), 0x6E65_6172])
}
