//! Methods that trace rays from the eye: [`ray_cast`] here; each is an [`Integrator`], and [`tiles`] turns any of them into a picture.

pub mod ray_cast;
pub mod tiles;

pub use crate::transport::Integrator;
pub use ray_cast::RayCast;
