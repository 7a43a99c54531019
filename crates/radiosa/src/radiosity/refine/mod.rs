//! Adaptive refinement: elements are divided where the light on them varies more than one value can say, and the world is solved again. Source: [Cohen86].
//!
//! An element is divided
//!
//! - where the step to a neighbour on the same patch is large: `ρ |H_i − H_j| > threshold · mean of ρ H`;
//! - where the step is not, but near it, and the irradiance gathered at its centre ([`super::gather`]) disagrees by as much with the element's own, as it does where
//!   a shadow falls between elements.
//!
//! Irradiances decide, not radiosities, so that pictures on walls are no reason. All cells of a patch stay similar to it, each divided on its own: neighbours of different
//! size leave T-vertices.

use rayon::prelude::*;

use super::gather::{Gather, Scratch};
use super::mesh::{Element, ElementMesh};
use super::solution::{Settings as Solve, Solution};
use crate::spectrum::{Spectrum, luminance};
use crate::transport::World;

/// Where and how often.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// The largest step of reflected light that is left, relative to its mean over all surfaces.
    pub threshold: f64,
    /// Times that elements are divided into four; zero: never.
    pub levels: u32,
    /// Elements at most; the largest steps go first. The default stays below where [`super::solve::Solver::Auto`] turns to rays.
    pub elements: usize,
    /// Gathers again where steps alone do not decide.
    pub gather: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self { threshold: 0.1, levels: 0, elements: 11_000, gather: true }
    }
}

/// The mesh to solve over next; `None` when the last one is good enough, or may not be divided any more.
pub fn next(world: &World, solution: &Solution, settings: &Solve) -> Option<ElementMesh> {
    if solution.mesh.record().refined.len() >= settings.refine.levels as usize {
        return None;
    }
    let marked = marked(world, solution, settings);
    let direct = settings.direct(world);
    marked.contains(&true).then(|| solution.mesh.refined(world, &direct, &marked))
}

/// By element: its cell is to be divided.
pub fn marked(world: &World, solution: &Solution, settings: &Solve) -> Vec<bool> {
    let refine = &settings.refine;
    let (steps, scale) = (steps(solution), scale(solution));
    let gather = Gather::new(world, solution, &settings.extra_lights, settings.seed);
    let wanted: Vec<Option<f64>> = solution
        .mesh
        .elements()
        .par_iter()
        .enumerate()
        .map_init(Scratch::default, |scratch, (i, element)| {
            let step = steps[i];
            if step > refine.threshold {
                return Some(step);
            }
            if !refine.gather || step < 0.25 * refine.threshold {
                return None;
            }
            let surface = solution.mesh.surface(world, element, [0.5; 2]);
            let at = gather.at(&surface, element.normal.as_vec3(), i as u64, scratch);
            let own = Spectrum::from(solution.irradiance[i].map(|h| h as f32));
            let off = f64::from((at.irradiance - own).luminance().abs()) - 2.0 * at.standard_error;
            let off = off * luminance(solution.system.reflectance[i]) / scale;
            (off > refine.threshold).then_some(off)
        })
        .collect();
    // The largest first, by the light they misplace; four elements for one, on either side that takes part.
    let mut order: Vec<(f64, usize)> =
        wanted.iter().enumerate().filter_map(|(i, w)| w.map(|w| (w * solution.system.area[i], i))).collect();
    order.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let room = refine.elements.saturating_sub(steps.len()) / 6;
    let mut marked = vec![false; steps.len()];
    order.into_iter().take(room).for_each(|(_, i)| marked[i] = true);
    marked
}

/// Of every element the largest step of reflected light to a neighbour on the same patch, relative to the mean of all; what chance may have made of it (three
/// standard errors) is taken off.
pub fn steps(solution: &Solution) -> Vec<f64> {
    let scale = scale(solution);
    let light = |i: usize| luminance(solution.irradiance[i]);
    let error = |i: usize| solution.irradiance_error.get(i).map_or(0.0, |e| luminance(*e));
    let elements = solution.mesh.elements().par_iter().enumerate();
    let step = |(i, element): (usize, &Element)| {
        // What is covered is dark, and that is no step.
        let is_open = |j: &usize| solution.system.area[i] > 0.0 && solution.system.area[*j] > 0.0;
        let by_chance = |j: usize| 3.0 * (error(i).powi(2) + error(j).powi(2)).sqrt();
        let steps = solution.mesh.neighbours(element).filter(is_open);
        let steps = steps.map(|j| ((light(i) - light(j)).abs() - by_chance(j)).max(0.0));
        steps.fold(0.0, f64::max) * luminance(solution.system.reflectance[i]) / scale
    };
    elements.map(step).collect()
}

/// Mean luminance of `ρ H` over all surfaces.
fn scale(solution: &Solution) -> f64 {
    let (mut sum, mut area) = (0.0, 0.0);
    for ((h, rho), a) in solution.irradiance.iter().zip(&solution.system.reflectance).zip(&solution.system.area) {
        sum += a * luminance(std::array::from_fn(|c| rho[c] * h[c]));
        area += a;
    }
    if sum > 0.0 { sum / area } else { 1.0 }
}
