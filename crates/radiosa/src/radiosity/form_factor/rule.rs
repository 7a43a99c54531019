//! Points and weights that integrate over an element.

use super::analytic::gauss_legendre;
use crate::math::function::{cos_f64, sin_f64};
use crate::math::{DVec3, Vec2, polygon};
use crate::radiosity::mesh::Element;

/// A point of an element and the area it stands for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    pub(super) p: DVec3,
    pub(super) area: f64,
}

/// The centre of area, which stands for the whole.
pub(super) fn centroid(element: &Element) -> Node {
    let c = element.corners();
    let (mut sum, mut whole) = (DVec3::ZERO, 0.0);
    for e in c[1..].windows(2) {
        let area = (e[0] - c[0]).cross(e[1] - c[0]).dot(element.normal);
        sum += (c[0] + e[0] + e[1]) * (area / 3.0);
        whole += area;
    }
    Node { p: if whole > 0.0 { sum / whole } else { element.centre() }, area: element.whole_area }
}

/// The tensor rule of Gauss and Legendre with `n × n` points.
pub(super) fn gauss(element: &Element, n: usize, out: &mut Vec<Node>) {
    let rule = gauss_legendre(n);
    for &[t, wt] in &rule {
        for &[s, ws] in &rule {
            let node = bilinear(element, [s, t]);
            out.push(Node { area: ws * wt * node.area, ..node });
        }
    }
}

/// The point of parameters `(s, t)` and the area for one of the unit square there; a triangle is a quadrilateral with two corners in one place.
pub(super) fn bilinear(element: &Element, [s, t]: [f64; 2]) -> Node {
    let c = element.corners();
    let corners = [c[0], c[1], c[2], c[c.len() - 1]];
    Node { p: polygon::bilinear(corners, [s, t]), area: polygon::bilinear_area(corners, [s, t]) }
}

/// A point of an element from which its factors are estimated, and the area it stands for: one of `n`, the centre when there is only one.
pub(super) fn source_point(element: &Element, u: Vec2, n: u32) -> Node {
    if n <= 1 { centroid(element) } else { spread_point(element, u) }
}

/// The point of an element that a point of the unit square stands for, and the area with it.
///
/// Even points of the square are not even on a quadrilateral that is no parallelogram; the area says how they differ.
pub(super) fn spread_point(element: &Element, u: Vec2) -> Node {
    let at = [f64::from(u.x), f64::from(u.y)];
    if element.corners().len() == 4 { bilinear(element, at) } else { Node { p: element.at(at), area: element.whole_area } }
}

/// An orthonormal frame around a normal, turned about it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Turned {
    pub(super) s: DVec3,
    pub(super) t: DVec3,
    pub(super) n: DVec3,
}

impl Turned {
    /// By an angle in radians.
    pub(super) fn new(n: DVec3, angle: f64) -> Self {
        let (s, t) = n.any_orthonormal_pair();
        // (right-handed whatever the pair's order)
        let t = if s.cross(t).dot(n) < 0.0 { -t } else { t };
        let (sin, cos) = (sin_f64(angle), cos_f64(angle));
        Self { s: s * cos + t * sin, t: t * cos - s * sin, n }
    }

    pub(super) fn to_world(self, v: DVec3) -> DVec3 {
        self.s * v.x + self.t * v.y + self.n * v.z
    }
}
