//! Numbers to sample with: keyed random streams, low-discrepancy points, and maps from the square beside their densities.
//!
//! Nothing here has a state that threads could share: every number is a function of (seed, pixel, sample, dimension).

pub mod mis;
pub mod rng;
pub mod sequence;
pub mod warp;

pub use rng::Stream;
