//! Half-open rays.

use super::Vec3;

/// The points `origin + t·dir` with `0 < t < t_max`.
///
/// `dir` need not have unit length; `t` is measured in its length. Nothing keeps a minimum distance here: whoever starts
/// a ray on a surface moves the origin off it by the rounding error of that surface point (`transport::hit`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Start, excluded.
    pub origin: Vec3,
    /// Direction, of any finite length above zero.
    pub dir: Vec3,
    /// End, excluded; infinity for none.
    pub t_max: f32,
}

impl Ray {
    /// A ray without end.
    pub fn new(origin: Vec3, dir: Vec3) -> Self {
        Self { origin, dir, t_max: f32::INFINITY }
    }

    /// The point at parameter `t`.
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin + self.dir * t
    }
}
