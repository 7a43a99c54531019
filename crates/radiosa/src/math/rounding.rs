//! Bounds of rounding errors, and how to leave a surface by just more than one. Source: [Pharr23], chapter 6.8.

use super::Vec3;

/// Bound of the relative error of `n` roundings in sequence: `n ε / (1 − n ε)`, ε half the machine epsilon.
pub const fn gamma(n: u32) -> f32 {
    let ne = n as f32 * (f32::EPSILON * 0.5);
    ne / (1.0 - ne)
}

/// `p`, known up to `p_error` in each coordinate, moved off its surface to the side `towards` points to, just beyond that error.
/// `normal` is the surface's unit normal, either one.
pub fn offset_origin(p: Vec3, p_error: Vec3, normal: Vec3, towards: Vec3) -> Vec3 {
    let distance = normal.abs().dot(p_error);
    let offset = if normal.dot(towards) < 0.0 { -normal * distance } else { normal * distance };
    let moved = p + offset;
    // The sum rounds too: away from the surface in every coordinate.
    Vec3::new(onward(moved.x, offset.x), onward(moved.y, offset.y), onward(moved.z, offset.z))
}

/// The next float after `x` in the direction of `way`; `x` when that is zero.
#[inline(always)]
fn onward(x: f32, way: f32) -> f32 {
    // The bits of a float count up as its size does; without branches, since signs are as good as random. From zero it is one step to either side.
    let same_side = x == 0.0 || (x.to_bits() ^ way.to_bits()) >> 31 == 0;
    let start = if x == 0.0 { way.to_bits() & 1 << 31 } else { x.to_bits() };
    let next = f32::from_bits(if same_side { start.wrapping_add(1) } else { start.wrapping_sub(1) });
    if way == 0.0 || !x.is_finite() { x } else { next }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn onward_is_the_next_float_on_that_side() {
        for x in [0.0, -0.0, f32::MIN_POSITIVE, 1.0, -1.0, 3.5e-42, -1e30, f32::MAX, f32::MIN] {
            assert_eq!((onward(x, 0.5), onward(x, -2.0)), (x.next_up(), x.next_down()));
            assert_eq!((onward(x, 0.0).to_bits(), onward(x, -0.0).to_bits()), (x.to_bits(), x.to_bits()));
        }
    }

    #[test]
    fn the_offset_point_lies_beyond_the_error_on_the_side_asked_for() {
        let n = Vec3::new(1.0, -2.0, 0.5).normalize();
        for scale in [1e-6f32, 1.0, 1e6] {
            let p = Vec3::new(3.0, 0.1, -7.0) * scale;
            let error = p.abs() * gamma(7);
            for side in [1.0, -1.0] {
                let moved = offset_origin(p, error, n, n * side);
                let along = (moved.as_dvec3() - p.as_dvec3()).dot(n.as_dvec3()) * f64::from(side);
                let bound = n.abs().as_dvec3().dot(error.as_dvec3());
                assert!(along >= bound * 0.999 && along <= bound * 1.5, "{along} against {bound}");
            }
        }
    }
}
