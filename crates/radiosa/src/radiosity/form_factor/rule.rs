//! Points and weights that integrate over an element.

use super::analytic::gauss_legendre;
use crate::math::DVec3;
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

/// The tensor rule of Gauss and Legendre with `n × n` points; a triangle is a quadrilateral with two corners in one place.
pub(super) fn gauss(element: &Element, n: usize, out: &mut Vec<Node>) {
    let c = element.corners();
    let [a, b, d] = [c[0], c[1], c[c.len() - 1]];
    let c = c[2];
    for &[t, wt] in &gauss_legendre(n) {
        for &[s, ws] in &gauss_legendre(n) {
            let p = (a * (1.0 - s) + b * s) * (1.0 - t) + (d * (1.0 - s) + c * s) * t;
            let along_s = (b - a) * (1.0 - t) + (c - d) * t;
            let along_t = (d - a) * (1.0 - s) + (c - b) * s;
            out.push(Node { p, area: ws * wt * along_s.cross(along_t).length() });
        }
    }
}
