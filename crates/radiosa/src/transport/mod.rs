//! The words all methods share: the prepared [`World`], what a ray hit ([`Surface`]), where camera rays start ([`View`]), and the two
//! verbs [`Integrator`] and [`Solver`].

pub mod framing;
mod solver;
mod surface;
mod view;
mod world;

pub use solver::{Solver, Step};
pub use surface::{Surface, offset_origin};
pub use view::View;
pub use world::World;
