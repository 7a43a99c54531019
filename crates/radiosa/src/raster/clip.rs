//! Cutting polygons in homogeneous coordinates, before the division by w.
//!
//! A polygon is cut by one plane after the other [Sutherland74]: the near plane, behind which division would turn the picture over, and the four
//! sides of a guard band far outside the picture, so that vertices stay within the range of the grid. What lies outside the picture but
//! within the guard band is not cut, only not scanned. There is no far plane.

use super::{GUARD, Homogeneous, Projection};

/// Corners of a triangle after five cuts, each of which adds at most one.
pub const MAX_CORNERS: usize = 8;

/// How far inside of a plane a vertex lies; zero and above is inside, what is not a number is outside.
fn inside(plane: u32, near: f64, v: &Homogeneous) -> f64 {
    match plane {
        0 => v.z - near,
        1 => GUARD * v.w + v.x,
        2 => GUARD * v.w - v.x,
        3 => GUARD * v.w + v.y,
        _ => GUARD * v.w - v.y,
    }
}

/// The part of a triangle inside of all planes: a convex polygon, in order; its number of corners is returned, 0 when nothing is left.
///
/// The point where an edge is cut is computed from the inner to the outer vertex: the same for both triangles that share the edge.
pub fn clip(projection: &Projection, triangle: &[Homogeneous; 3], out: &mut [Homogeneous; MAX_CORNERS]) -> usize {
    let mut n = 3;
    out[..3].copy_from_slice(triangle);
    for plane in 0..5 {
        let polygon = *out;
        let at = |i: usize| inside(plane, projection.near(), &polygon[i]);
        let mut kept = 0;
        for i in 0..n {
            let j = (i + 1) % n;
            let (di, dj) = (at(i), at(j));
            let (i_is_in, j_is_in) = (di >= 0.0, dj >= 0.0);
            let mut keep = |v: Homogeneous| {
                if kept < MAX_CORNERS {
                    out[kept] = v;
                    kept += 1;
                }
            };
            if i_is_in {
                keep(polygon[i]);
                if !j_is_in {
                    keep(between(&polygon[i], &polygon[j], di, dj));
                }
            } else if j_is_in {
                keep(between(&polygon[j], &polygon[i], dj, di));
            }
        }
        n = kept;
        if n < 3 {
            return 0;
        }
    }
    n
}

/// The point of the segment from `a`, inside by `da`, to `b`, outside by `db`, on the plane.
fn between(a: &Homogeneous, b: &Homogeneous, da: f64, db: f64) -> Homogeneous {
    let t = da / (da - db);
    let mix = |a: f64, b: f64| a + (b - a) * t;
    Homogeneous { x: mix(a.x, b.x), y: mix(a.y, b.y), w: mix(a.w, b.w), z: mix(a.z, b.z) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{DMat3, DVec3, Vec3};

    #[test]
    fn what_is_left_lies_inside_and_what_is_inside_is_left_alone() {
        let projection = Projection::perspective(DVec3::ZERO, &DMat3::IDENTITY, 1.0, 100.0, 0.5);
        let mut out = [projection.project(Vec3::ZERO); MAX_CORNERS];
        let mut cut = |p: [[f32; 3]; 3]| {
            let triangle = p.map(|p| projection.project(Vec3::from_array(p)));
            let n = clip(&projection, &triangle, &mut out);
            for v in &out[..n] {
                for plane in 0..5 {
                    assert!(inside(plane, 0.5, v) >= -1e-6 * v.w.abs().max(1.0) * GUARD, "plane {plane}: {v:?}");
                }
            }
            (n, n == 3 && out[..3] == triangle)
        };
        assert_eq!(cut([[0.0, 0.0, -1.0], [1.0, 0.0, -1.0], [0.0, 1.0, -2.0]]), (3, true));
        assert_eq!(cut([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 2.0]]).0, 0);
        assert_eq!(cut([[0.0, 0.0, -1.0], [1.0, 0.0, -1.0], [0.0, 1.0, 2.0]]).0, 4);
        assert_eq!(cut([[0.0, 0.0, -1.0], [1.0, 0.0, 3.0], [0.0, 1.0, 2.0]]).0, 3);
        // So large that all sides of the guard band cut it.
        assert!(cut([[-3e6, -2e6, -2.0], [3e6, -2e6, -2.0], [0.0, 4e6, -2.0]]).0 >= 4);
    }
}
