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
//! A picture of a built-in scene, in a dozen lines:
//!
//! ```
//! use radiosa::film::{Filter, Layer};
//! use radiosa::math::CpuPath;
//! use radiosa::raytrace::{RayCast, ray_cast, tiles};
//! use radiosa::transport::{Solver, Step, View, World};
//!
//! let scene = radiosa::import::sample::load("parallel-plates").expect("it is built in");
//! let world = World::prepare(scene, CpuPath::detect())?;
//! let view = View::new(&world.scene().cameras[0], world.origin(), 32, 24);
//! let method = RayCast::new(&world, &ray_cast::Settings::default(), view.forward());
//! let settings =
//!     tiles::Settings { width: 32, height: 24, spp: 1, filter: Filter::Box, seed: 0, layers: vec![Layer::Color] };
//! let mut render = tiles::TiledRender::new(&method, &view, settings)?;
//! while let Step::Working { .. } = render.step(&world) {}
//! assert!(render.solution().plane("R").is_some_and(|red| red.iter().any(|&v| v > 0.5)));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! What a light means: a classic light of intensity 1 shows white as 1 where it falls head-on, and so gives the irradiance π.
//!
//! ```
//! use radiosa::emitter::{Emitter, EnvironmentShadows};
//! use radiosa::math::{DVec3, Vec3};
//! use radiosa::radiometry::lambertian_radiance;
//! use radiosa::scene::{Light, LightKind, PhotometricUnit};
//! use radiosa::spectrum::Spectrum;
//!
//! let sun = LightKind::Distant { to_light: DVec3::Y, unit: PhotometricUnit::Classic };
//! let sun = Emitter::prepare(&Light::new("sun", Spectrum::WHITE, sun), DVec3::ZERO, EnvironmentShadows::Off);
//! let arriving = sun.incident(Vec3::ZERO).expect("the sun reaches everywhere");
//! assert!((lambertian_radiance(Spectrum::WHITE, arriving.diffuse).g - 1.0).abs() < 1e-6);
//! ```
//!
//! Ray queries alone, without a scene:
//!
//! ```
//! use radiosa::accel::{Accel, Geometry, Placed, Shape};
//! use radiosa::math::{CpuPath, Ray, Vec3};
//!
//! let shape = Shape::Mesh { positions: vec![Vec3::X, Vec3::Y, Vec3::ZERO], triangles: vec![[0, 1, 2]] };
//! let geometry = Geometry { shapes: vec![shape], placed: vec![Placed { shape: 0, to_world: None }] };
//! let accel = Accel::build(geometry, CpuPath::detect());
//! let hit = accel.closest(&Ray::new(Vec3::new(0.25, 0.25, 2.0), Vec3::NEG_Z)).expect("it points at the triangle");
//! assert_eq!((hit.t, hit.u), (2.0, 0.25));
//! ```
//!
//! Modules are layered: one may use those above it in this list and its own layer's vocabulary, never those below
//! (`tests/architecture.rs` reads the `use crate::` lines and holds the rule).

#![deny(clippy::print_stdout, clippy::print_stderr)]

pub mod math;

pub mod radiometry;
pub mod spectrum;

pub mod sampling;

pub mod stream;

pub mod scene;

pub mod film;
pub mod import;

pub mod accel;
pub mod bsdf;
pub mod emitter;
pub mod raster;

pub mod transport;

pub mod scanline;

pub mod raytrace;

pub mod radiosity;

pub mod hybrid;

pub mod measure;

pub mod export;
