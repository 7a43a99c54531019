//! Methods that trace rays from the eye: [`ray_cast`], [`whitted`] and [`path`]; each is an [`Integrator`], and [`tiles`] turns any of them into a picture, [`adaptive`] with samples
//! where corners of pixels differ, and [`progressive`] in passes over all of it, to a number of samples or an error.

pub mod ray_cast;
pub mod whitted;

pub mod path;

pub mod adaptive;
pub mod progressive;
pub mod tiles;

pub use crate::transport::Integrator;
pub use path::PathTracer;
pub use ray_cast::RayCast;
pub use whitted::Whitted;
