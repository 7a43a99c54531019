//! Estimating what a camera ray sees.

use super::World;
use crate::film::Pixel;
use crate::math::Ray;
use crate::sampling::Stream;
use crate::spectrum::Spectrum;

/// Estimates the radiance arriving along a camera ray, with the layers it is made of.
pub trait Integrator: Sync {
    /// One sample. `stream` is this camera sample's own: keyed by seed, pixel and sample, so that the result depends on nothing else.
    /// `n_rays` grows by the rays traced.
    fn sample(&self, world: &World, ray: &Ray, stream: &mut Stream, n_rays: &mut u64) -> Pixel;

    /// About how many rays one sample sends where it branches at once: progress and interruption come in steps of so much work.
    fn branching(&self) -> u32 {
        1
    }

    /// Part of the light comes by paths that begin at its sources, and to pixels they do not choose: [`Self::splats`].
    fn has_splats(&self) -> bool {
        false
    }

    /// What that brings in one pass, to be added to the mean of samples; of `pass` and `seed` alone, in an order that never changes.
    fn splats(&self, _world: &World, _seed: u64, _pass: u32, _n_rays: &mut u64) -> Vec<Splat> {
        Vec::new()
    }
}

/// Light that arrived at some place of the picture, of the first surface there.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Splat {
    /// Pixels from the top left.
    pub place: [f32; 2],
    /// Radiance times pixels, by its diffuse lobe,
    pub diffuse: Spectrum,
    /// and by the others.
    pub specular: Spectrum,
}
