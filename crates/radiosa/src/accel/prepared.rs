//! What traversal wants to know of a ray, computed once.

use super::bvh::LARGEST;
use super::triangle::VERTEX_ERROR;
use crate::math::{Bounds, DVec3, Ray, Vec3};

/// A direction component smaller than this part of the longest is taken as this part in the slab test, so that no reciprocal is infinite.
pub(super) const SMALLEST_SLOPE: f32 = 1.0 / (1u64 << 60) as f32;

/// Rounding error of `plane·inv − o·inv`, in parts of `|o·inv|`: one each for the product and for adding the slack, two for what the
/// reciprocal and the sum do to the part of the distance that is the origin's; the plane's part is in the boxes (`bvh::PLANE_SLACK`), as
/// [Ize13] (*Robust BVH Ray Traversal*) puts all of it in the far distance.
pub(super) const ORIGIN_SLACK: f32 = 8.0 * 0.5 * f32::EPSILON;

/// A ray made ready for one [`Bvh`](super::bvh::Bvh).
#[derive(Clone, Copy)]
pub(super) struct Prepared {
    /// Origin.
    pub o: [f32; 3],
    /// Direction, scaled by a power of two so that its longest component is in [1, 2): nothing over- or underflows at any length.
    pub d: [f32; 3],
    /// Ray parameter of the caller's direction = parameter of `d` × `scale`, exactly.
    pub scale: f32,
    /// `1 / scale`.
    pub inv_scale: f32,
    /// Reciprocal direction, finite.
    pub inv: [f32; 3],
    /// `−o·inv`, less its error: added to `plane·inv` it bounds the entry distance from below.
    pub near: [f32; 3],
    /// `−o·inv` and its error: bounds the exit distance from above.
    pub far: [f32; 3],
    /// Row of a node's plane that is entered first, an axis each.
    pub near_row: [usize; 3],
    /// Row of the plane that is left last.
    pub far_row: [usize; 3],
    /// The permuted axes of the triangle test.
    pub axes: [usize; 3],
    /// Slopes of the ray in the first two permuted axes against the third.
    pub shear: [f32; 2],
    /// Reciprocal of the direction's longest component.
    pub inv_z: f32,
    /// No vertex is farther away in any axis.
    pub reach: f32,
    /// Absolute error of sheared vertices.
    pub vertex_error: f32,
}

impl Prepared {
    /// `None` when the direction is zero or not finite or the origin is beyond [`LARGEST`]: such a ray meets nothing. With what remains, no
    /// product of the slab test overflows, so that an empty box's infinities never meet to make a NaN.
    #[inline(always)]
    pub(super) fn new(ray: &Ray, bounds: &Bounds) -> Option<Self> {
        let longest = ray.dir.abs().max_element();
        let far = ray.origin.abs().max_element();
        if !(longest > 0.0 && longest < f32::INFINITY && far <= LARGEST) || ray.dir.is_nan() || ray.origin.is_nan() {
            return None;
        }
        let exponent = longest.to_bits() >> 23;
        let exponent = (254 - exponent).clamp(1, 253);
        let (scale, inv_scale) = (f32::from_bits(exponent << 23), f32::from_bits((254 - exponent) << 23));
        let (d, o) = (ray.dir * scale, ray.origin);
        let (d, o) = (d.to_array(), o.to_array());
        let size = d.map(f32::abs);
        let kz = if size[0] >= size[1].max(size[2]) {
            0
        } else if size[1] >= size[2] {
            1
        } else {
            2
        };
        let axes = [[1, 2, 0], [2, 0, 1], [0, 1, 2]][kz];
        let inv: [f32; 3] =
            std::array::from_fn(|k| 1.0 / if size[k] < SMALLEST_SLOPE { SMALLEST_SLOPE.copysign(d[k]) } else { d[k] });
        // The longest is never replaced.
        let inv_z = inv[kz];
        let middle: [f32; 3] = std::array::from_fn(|k| -(o[k] * inv[k]));
        let reach = (bounds.max - ray.origin).max(ray.origin - bounds.min).max_element();
        Some(Self {
            o,
            d,
            scale,
            inv_scale,
            inv,
            near: middle.map(|m| m - m.abs() * ORIGIN_SLACK),
            far: middle.map(|m| m + m.abs() * ORIGIN_SLACK),
            near_row: std::array::from_fn(|k| if inv[k] < 0.0 { k + 3 } else { k }),
            far_row: std::array::from_fn(|k| if inv[k] < 0.0 { k } else { k + 3 }),
            axes,
            shear: [d[axes[0]] * inv_z, d[axes[1]] * inv_z],
            inv_z,
            reach,
            vertex_error: reach * VERTEX_ERROR,
        })
    }

    /// Origin and scaled direction in f64.
    pub(super) fn exact(&self) -> (DVec3, DVec3) {
        (Vec3::from(self.o).as_dvec3(), Vec3::from(self.d).as_dvec3())
    }
}
