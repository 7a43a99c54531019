//! Radiosa: one engine for light.
//!
//! A scene goes in; light comes out as pictures, as numbers in SI quantities, or baked into the scene itself.
//!
//! ```text
//! scene file, glTF, OBJ, or builder code
//!   │  import::load               may fail, naming file, line and value
//! scene::Scene                    plain data and indices, positions in f64, no behaviour
//!   │  World::prepare             recentres, builds ray queries and light tables
//! transport::World                immutable, shared by every thread and every method
//!   │  an illumination method     raytrace::ray_cast, …
//! film::Film                      linear light, named planes
//!   │  film::tone_map, export::*
//! png, exr, hdr
//! ```
//!
//! Modules are layered: one may use those above it in this list and its own layer's vocabulary, never those below
//! (`tests/architecture.rs` reads the `use crate::` lines and holds the rule).

#![deny(clippy::print_stdout, clippy::print_stderr)]

pub mod math;

pub mod radiometry;
pub mod spectrum;

pub mod sampling;

pub mod scene;

pub mod film;
pub mod import;

pub mod accel;
pub mod bsdf;
pub mod emitter;

pub mod transport;

pub mod raytrace;

pub mod export;
