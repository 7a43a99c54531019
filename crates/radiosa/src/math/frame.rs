//! Orthonormal frames around a normal.

use super::Vec3;

/// An orthonormal basis `(s, t, n)`, right-handed, with `n` as its local +z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// First tangent.
    pub s: Vec3,
    /// Second tangent.
    pub t: Vec3,
    /// Normal.
    pub n: Vec3,
}

impl Frame {
    /// A frame around a unit normal, continuous but for one seam. Source: [Duff17].
    pub fn from_normal(n: Vec3) -> Self {
        debug_assert!((n.length_squared() - 1.0).abs() < 1e-3, "the normal must have unit length");
        let sign = 1f32.copysign(n.z);
        let a = -1.0 / (sign + n.z);
        let b = n.x * n.y * a;
        Self { s: Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), t: Vec3::new(b, sign + n.y * n.y * a, -n.y), n }
    }

    /// From world to local coordinates.
    pub fn to_local(&self, v: Vec3) -> Vec3 {
        Vec3::new(v.dot(self.s), v.dot(self.t), v.dot(self.n))
    }

    /// From local to world coordinates.
    pub fn to_world(&self, v: Vec3) -> Vec3 {
        self.s * v.x + self.t * v.y + self.n * v.z
    }
}
