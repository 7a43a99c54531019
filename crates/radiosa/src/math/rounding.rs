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
    Vec3::from_array(std::array::from_fn(|i| {
        if offset[i] > 0.0 {
            moved[i].next_up()
        } else if offset[i] < 0.0 {
            moved[i].next_down()
        } else {
            moved[i]
        }
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

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
