//! Radiosity: the light between diffuse surfaces, for the scene and not for a camera.
//!
//! ```text
//! World                        its surfaces
//!   │  patch, sides, mesh      planar patches, the sides light can reach, divided into elements
//!   │  contacts                which no other surface stands on or goes through
//!   │  discontinuity           nor the border of a shadow, where that is asked for
//!   │  form_factor, matrix     how much of what leaves one element arrives at another
//!   │  direct, system          what elements are made of, and what lights that are not surfaces bring them
//!   │  solve                   B = E + ρ F B
//!   │  hierarchical            the same between groups of elements, without a matrix
//! Solution                     radiosity and irradiance of every element
//!   │  refine                  elements divided where that light varies, and again
//!   │  gather, display         at a point; as a picture
//! ```
//!
//! Only diffuse reflection takes part: other lobes are left to methods that trace rays.

pub mod between;
mod contacts;
mod corners;
pub mod direct;
pub mod discontinuity;
pub mod display;
mod exposure;
pub mod form_factor;
pub mod gather;
mod groups;
mod halve;
pub mod hierarchical;
pub mod lines;
pub mod matrix;
pub mod medium;
pub mod mesh;
pub mod patch;
pub mod refine;
mod sides;
pub mod solution;
pub mod solve;
mod store;
pub mod system;
mod tessellate;

pub use sides::Side;
pub use solution::{Division, Progress, Radiosity, Settings, Solution, solve};
pub use tessellate::{tessellate, tessellated};
