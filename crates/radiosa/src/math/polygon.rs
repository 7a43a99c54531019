//! Planar polygons in f64: area vectors and cutting by a plane.

use super::DVec3;

/// The area vector: its length is the area, its direction the normal of the side from which the corners run counter-clockwise.
///
/// Taken around the first corner, so that polygons far from the origin lose nothing.
pub fn area_vector(corners: &[DVec3]) -> DVec3 {
    let Some((&first, rest)) = corners.split_first() else { return DVec3::ZERO };
    rest.windows(2).map(|e| (e[0] - first).cross(e[1] - first)).sum::<DVec3>() * 0.5
}

/// The bilinear map of the unit square: corners at (0, 0), (1, 0), (1, 1), (0, 1).
pub fn bilinear([a, b, c, d]: [DVec3; 4], [s, t]: [f64; 2]) -> DVec3 {
    (a * (1.0 - s) + b * s) * (1.0 - t) + (d * (1.0 - s) + c * s) * t
}

/// What of its image's area belongs to one of the unit square at a point.
pub fn bilinear_area([a, b, c, d]: [DVec3; 4], [s, t]: [f64; 2]) -> f64 {
    let along_s = (b - a) * (1.0 - t) + (c - d) * t;
    let along_t = (d - a) * (1.0 - s) + (c - b) * s;
    along_s.cross(along_t).length()
}

/// The part of a convex polygon on the side of the plane through `origin` that `normal` points to, appended to `out` (cleared first).
///
/// Corners nearer to the plane than `tolerance` (in units of `normal`'s length times metres) count as lying in it: polygons that touch the plane
/// along an edge stay as they are. Source: [Sutherland74].
pub fn clip(corners: &[DVec3], origin: DVec3, normal: DVec3, tolerance: f64, out: &mut Vec<DVec3>) {
    out.clear();
    let height = |p: DVec3| {
        let h = (p - origin).dot(normal);
        if h.abs() <= tolerance { 0.0 } else { h }
    };
    for (i, &a) in corners.iter().enumerate() {
        let b = corners[(i + 1) % corners.len()];
        let (ha, hb) = (height(a), height(b));
        if ha >= 0.0 {
            out.push(a);
        }
        if (ha < 0.0 && hb > 0.0) || (ha > 0.0 && hb < 0.0) {
            out.push(a + (b - a) * (ha / (ha - hb)));
        }
    }
    // What only touches has no area.
    if corners.iter().all(|&p| height(p) <= 0.0) {
        out.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_square_is_cut_in_half_and_a_touching_one_is_left_whole() {
        let square = [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y];
        assert_eq!(area_vector(&square), DVec3::Z);
        let mut part = Vec::new();
        clip(&square, DVec3::splat(0.25), DVec3::X, 0.0, &mut part);
        assert!((area_vector(&part) - DVec3::Z * 0.75).length() < 1e-15);
        clip(&square, DVec3::ZERO, DVec3::X, 1e-12, &mut part);
        assert_eq!(part, square);
        clip(&square, DVec3::ZERO, -DVec3::X, 1e-12, &mut part);
        assert!(part.is_empty());
    }
}
