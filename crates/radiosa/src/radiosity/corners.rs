//! Values at the corners of elements that are no cells of a regular grid: those that contact lines cut, and those that refinement divides.
//!
//! ```text
//! at an edge     between the values on either side, by the distance of their centres; goes on from the opposite edge where nothing continues
//! at a corner    own value, and what both edges differ from it
//! ```
//!
//! Nothing is taken from across a contact line: elements are neighbours when nothing stands on the surface between them.

use super::mesh::{Element, ElementMesh};
use crate::math::{DVec3, Ray};
use crate::spectrum::Spectrum;
use crate::transport::World;

/// Two elements are looked at from each other this far from where they meet, as fractions of the way to their centres; and this high above the surface, as
/// a fraction of the distance.
const ASIDE: f64 = 0.25;
const HIGH: f64 = 0.05;

/// Corner values of the elements from `first` on, all on one side of a patch; neighbours still differ a little where they meet.
pub(super) fn extrapolate(world: &World, mesh: &ElementMesh, first: usize, values: &[[f64; 3]], out: &mut [[Spectrum; 4]]) {
    for (e, corners) in (first..).zip(out) {
        let (element, own) = (&mesh.elements()[e], values[e]);
        let (c, centre) = (element.corners(), element.centre());
        // By edge: how the value there differs from the element's own.
        let mut steps: [Option<[f64; 3]>; 4] = [None; 4];
        for (k, f) in mesh.neighbours(element).enumerate() {
            let (other, at) = (&mesh.elements()[f], (c[k] + c[(k + 1) % c.len()]) * 0.5);
            let is_known = mesh.is_at_contact(element) || mesh.is_at_contact(other);
            if f != e && other.exposed() > 0.5 && (!is_known || is_open(world, [element, other], at)) {
                let [near, far] = [centre, other.centre()].map(|c| (c - at).length());
                let share = near / (near + far).max(f64::MIN_POSITIVE);
                steps[k] = Some(std::array::from_fn(|i| share * (values[f][i] - own[i])));
            }
        }
        let step = |k: usize| {
            let opposite = || if c.len() == 4 { steps[(k + 2) % 4].map(|step| step.map(|s| -s)) } else { None };
            steps[k].or_else(opposite).unwrap_or([0.0; 3])
        };
        *corners = std::array::from_fn(|k| {
            let k = k.min(c.len() - 1);
            let (before, after) = (step((k + c.len() - 1) % c.len()), step(k));
            let value = |i: usize| (own[i] + before[i] + after[i]).clamp(0.5 * own[i], 2.0 * own[i].max(0.0));
            std::array::from_fn::<f32, 3, _>(|i| value(i) as f32).into()
        });
    }
}

/// Nothing stands on the surface between two elements where they meet.
pub(super) fn is_open(world: &World, elements: [&Element; 2], at: DVec3) -> bool {
    let [p, q] = elements.map(|e| at + (e.centre() - at) * ASIDE);
    let high = (q - p).length() * HIGH;
    let [p, q] = [(elements[0], p), (elements[1], q)].map(|(e, p)| e.lift().in_front(p + e.normal * high));
    !world.accel().occluded(&Ray { origin: p, dir: q - p, t_max: 1.0 })
}
