//! From the world to the picture.

use crate::math::{DMat3, DVec3, Vec3};

/// A point in homogeneous picture coordinates: it appears at `(x/w, y/w)`, pixels from the middle of the picture, x right and y down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Homogeneous {
    /// Pixels times `w`.
    pub x: f64,
    /// Pixels times `w`.
    pub y: f64,
    /// The distance along the view direction for perspective, 1 for parallel projection.
    pub w: f64,
    /// The distance along the view direction.
    pub z: f64,
}

impl Homogeneous {
    /// As a vector `(x, y, w)`.
    pub fn xyw(&self) -> DVec3 {
        DVec3::new(self.x, self.y, self.w)
    }
}

/// A linear map from world to homogeneous picture coordinates, with the size of the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projection {
    eye: DVec3,
    /// Rows that give x, y and z of a point relative to the eye.
    x: DVec3,
    y: DVec3,
    z: DVec3,
    is_perspective: bool,
    /// What lies nearer than this is not drawn.
    near: f64,
}

impl Projection {
    /// Perspective: `fov_y` is the full vertical angle, radians; `basis` has the columns right, up and back; `height` in pixels.
    ///
    /// `near` must be above zero: it may be very small, since depth is kept as 1/z.
    pub fn perspective(eye: DVec3, basis: &DMat3, fov_y: f64, height: f64, near: f64) -> Self {
        debug_assert!(near > 0.0);
        let scale = 0.5 * height / libm::tan(0.5 * fov_y);
        Self { eye, x: basis.x_axis * scale, y: -basis.y_axis * scale, z: -basis.z_axis, is_perspective: true, near }
    }

    /// Parallel: `extent` is the full height of the view in world units, `height` in pixels. Everything in front of the eye is drawn.
    pub fn orthographic(eye: DVec3, basis: &DMat3, extent: f64, height: f64) -> Self {
        let scale = height / extent;
        Self { eye, x: basis.x_axis * scale, y: -basis.y_axis * scale, z: -basis.z_axis, is_perspective: false, near: 0.0 }
    }

    /// Where a point of the world appears.
    pub fn project(&self, p: Vec3) -> Homogeneous {
        let p = p.as_dvec3() - self.eye;
        let z = self.z.dot(p);
        Homogeneous { x: self.x.dot(p), y: self.y.dot(p), w: if self.is_perspective { z } else { 1.0 }, z }
    }

    /// The eye point.
    pub fn eye(&self) -> DVec3 {
        self.eye
    }

    /// Unit, the direction it looks in.
    pub fn forward(&self) -> DVec3 {
        self.z
    }

    /// False for parallel projection.
    pub fn is_perspective(&self) -> bool {
        self.is_perspective
    }

    /// The distance along the view direction from which on things are drawn.
    pub fn near(&self) -> f64 {
        self.near
    }

    /// Depth as a linear function of the picture, `d = a x + b y + c` as `[a, b, c]`, x and y in pixels from the middle; greater is nearer.
    ///
    /// Perspective: `d = 1/z`. With the vertices `V_i = (x_i, y_i, w_i)` it is the vector whose product with each vertex is 1, which is the plane
    /// through them: `N/(V_0·N)`, `N = (V_1 − V_0) × (V_2 − V_0)` [Olano97]. Parallel: `d = −z`. Seen edge-on, the nearest vertex everywhere.
    pub fn depth_plane(&self, v: &[Homogeneous; 3]) -> [f64; 3] {
        let plane = if self.is_perspective {
            let [a, b, c] = v.map(|v| v.xyw());
            let n = (b - a).cross(c - a);
            n / a.dot(n)
        } else {
            let edge = |i: usize| DVec3::new(v[i].x - v[0].x, v[i].y - v[0].y, v[0].z - v[i].z);
            let n = edge(1).cross(edge(2));
            let (a, b) = (-n.x / n.z, -n.y / n.z);
            DVec3::new(a, b, -v[0].z - a * v[0].x - b * v[0].y)
        };
        if plane.is_finite() {
            return plane.to_array();
        }
        [0.0, 0.0, v.iter().map(|v| self.depth(v)).fold(f64::NEG_INFINITY, f64::max)]
    }

    /// The depth of a vertex.
    pub fn depth(&self, v: &Homogeneous) -> f64 {
        if self.is_perspective { 1.0 / v.z } else { -v.z }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_is_linear_over_the_picture_and_right_at_the_vertices() {
        let basis = DMat3::IDENTITY;
        for projection in [
            Projection::perspective(DVec3::ZERO, &basis, 1.0, 100.0, 1e-6),
            Projection::orthographic(DVec3::ZERO, &basis, 4.0, 100.0),
        ] {
            let v = [[-1.0, 0.3, -2.0], [1.5, -0.2, -3.0], [0.2, 1.0, -7.0]].map(|p| projection.project(Vec3::from_array(p)));
            let [a, b, c] = projection.depth_plane(&v);
            for v in &v {
                let d = a * v.x / v.w + b * v.y / v.w + c;
                assert!((d - projection.depth(v)).abs() < 1e-12, "{d}");
            }
            let p = projection.project(Vec3::new(0.0, 0.0, -2.0));
            assert_eq!((p.x, p.y, p.z), (0.0, 0.0, 2.0));
        }
    }
}
