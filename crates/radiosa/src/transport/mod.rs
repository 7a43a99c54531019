//! The words all methods share: the prepared [`World`], what a ray hit ([`Surface`]), where camera rays start ([`View`]), and the two
//! verbs [`Integrator`] and [`Solver`].

pub mod default_light;
mod direct;
mod emissive;
pub(crate) mod eye;
pub(crate) mod footprint;
pub mod framing;
mod integrator;
pub(crate) mod media;
mod polygons;
mod shading;
mod solver;
mod surface;
mod unshadowed;
mod view;
mod world;

pub(crate) use direct::FEW_LAMPS;
pub use direct::{Emitters, LightSettings, Lights, LocalLight, Viewer};
pub use footprint::Footprint;
pub use integrator::{Integrator, Splat};
pub(crate) use polygons::Care;
pub use shading::{Glass, Passage, Shading, Textures};
pub use solver::{Solver, Step};
pub use surface::Surface;
pub use unshadowed::{LightColumns, Unshadowed};
pub(crate) use unshadowed::{Points, Tinted};
pub use view::View;
pub use world::World;
