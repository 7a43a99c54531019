//! Vectors, rays and frames, and the conventions everything else keeps.
//!
//! Right-handed, +Y up, cameras look down −Z, metres, radians. Scenes keep positions in f64 ([`DVec3`]);
//! `transport::World` recentres them and works in f32 ([`Vec3`]). Images are row-major from the top left, pixel
//! centres at half integers. Directions named `wo`, `wi` point away from the surface; `n` is the shading normal, `ng` the geometric one.

mod bounds;
mod cpu;
mod frame;
pub mod function;
pub(crate) mod lanes;
pub mod polygon;
mod ray;
pub mod rounding;

pub use bounds::Bounds;
pub use cpu::CpuPath;
pub use frame::Frame;
pub use glam::{Affine3A, DAffine3, DMat3, DMat4, DQuat, DVec2, DVec3, Mat3, Vec2, Vec3, Vec3A, Vec4};
pub use ray::Ray;
