//! Estimating what a camera ray sees.

use super::World;
use crate::film::Pixel;
use crate::math::Ray;
use crate::sampling::Stream;

/// Estimates the radiance arriving along a camera ray, with the layers it is made of.
pub trait Integrator: Sync {
    /// One sample. `stream` is this camera sample's own: keyed by seed, pixel and sample, so that the result depends on nothing else.
    /// `n_rays` grows by the rays traced.
    fn sample(&self, world: &World, ray: &Ray, stream: &mut Stream, n_rays: &mut u64) -> Pixel;

    /// About how many rays one sample sends where it branches at once: progress and interruption come in steps of so much work.
    fn branching(&self) -> u32 {
        1
    }
}
