//! Values at the corners of elements that are no cells of a grid: those that contact lines cut, and those that refinement divides.
//!
//! ```text
//! value at a corner = own value + slope · (corner − centre),   slope: least squares over the neighbours across edges, near ones first
//! ```
//!
//! Nothing is taken from across a contact line: elements are neighbours when nothing stands on the surface between them.

use super::mesh::{Element, ElementMesh};
use crate::math::{DVec3, Ray};
use crate::spectrum::Spectrum;
use crate::transport::World;

/// Added to the normal equations, as a fraction of their trace: a slope that neighbours on one line say nothing of is none.
const RIDGE: f64 = 1e-3;
/// Two elements are looked at from each other this far from where they meet, as fractions of the way to their centres; and this high above the surface, as
/// a fraction of the distance.
const ASIDE: f64 = 0.25;
const HIGH: f64 = 0.05;

/// Corner values of the elements from `first` on, all on one side of a patch.
pub(super) fn extrapolate(world: &World, mesh: &ElementMesh, first: usize, values: &[[f64; 3]], out: &mut [[Spectrum; 4]]) {
    for (e, corners) in (first..).zip(out) {
        let (element, own) = (&mesh.elements()[e], values[e]);
        let centre = element.centre();
        let s = (element.corners()[1] - element.corners()[0]).normalize_or_zero();
        let t = element.normal.cross(s);
        // Σ w d dᵀ and Σ w d Δ, w = 1/d²
        let (mut a, mut b) = ([0.0; 3], [[0.0; 2]; 3]);
        for f in mesh.neighbours(element).filter(|&f| f != e) {
            let other = &mesh.elements()[f];
            let d = other.centre() - centre;
            if other.exposed() <= 0.5 || element.exposed() <= 0.5 || !is_open(world, mesh, [element, other], centre + d * 0.5) {
                continue;
            }
            let (x, y) = (d.dot(s), d.dot(t));
            let w = 1.0 / (x * x + y * y).max(f64::MIN_POSITIVE);
            [x * x, x * y, y * y].into_iter().zip(&mut a).for_each(|(v, a)| *a += w * v);
            for (c, b) in b.iter_mut().enumerate() {
                let step = values[f][c] - own[c];
                *b = [b[0] + w * x * step, b[1] + w * y * step];
            }
        }
        let ridge = RIDGE * (a[0] + a[2]);
        let (xx, xy, yy) = (a[0] + ridge, a[1], a[2] + ridge);
        let det = xx * yy - xy * xy;
        let slope = b.map(|[x, y]| if det > 0.0 { [(yy * x - xy * y) / det, (xx * y - xy * x) / det] } else { [0.0; 2] });
        *corners = std::array::from_fn(|k| {
            let d = element.corners()[k.min(element.corners().len() - 1)] - centre;
            let (x, y) = (d.dot(s), d.dot(t));
            let value = |c: usize| (own[c] + slope[c][0] * x + slope[c][1] * y).clamp(0.5 * own[c], 2.0 * own[c].max(0.0));
            std::array::from_fn::<f32, 3, _>(|c| value(c) as f32).into()
        });
    }
}

/// Nothing stands on the surface between two elements where they meet, as far as contact lines are known there.
pub(super) fn is_open(world: &World, mesh: &ElementMesh, elements: [&Element; 2], at: DVec3) -> bool {
    if !elements.iter().any(|e| mesh.is_at_contact(e)) {
        return true;
    }
    let [p, q] = elements.map(|e| at + (e.centre() - at) * ASIDE);
    let high = (q - p).length() * HIGH;
    let [p, q] = [(elements[0], p), (elements[1], q)].map(|(e, p)| e.lift().in_front(p + e.normal * high));
    !world.accel().occluded(&Ray { origin: p, dir: q - p, t_max: 1.0 })
}
