//! Perfect reflection.

use crate::math::Vec3;

/// The mirror image of `w` about the unit normal `n`: `2 n (n·w) − w`, both pointing away from the surface.
pub fn reflect(w: Vec3, n: Vec3) -> Vec3 {
    n * (2.0 * n.dot(w)) - w
}
