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

/// It is looked along elements from so far to so far beyond where they meet, as fractions of the way to their centres; and this high above the surface, as
/// a fraction of the distance.
const ASIDE: f64 = 0.25;
const BEYOND: f64 = 0.03;
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
            // (What is no number stays none.)
            let value = |i: usize| (own[i] + before[i] + after[i]).max(0.5 * own[i]).min(2.0 * own[i].max(0.0));
            std::array::from_fn::<f32, 3, _>(|i| value(i) as f32).into()
        });
    }
}

/// Nothing stands on the surface between two elements where they meet, or lies on one of them: from each of them the way is free upwards, and on to where they
/// meet and a little beyond. (From one to the other it would lead through the surface itself where that is curved outwards.)
pub(super) fn is_open(world: &World, elements: [&Element; 2], at: DVec3) -> bool {
    let high = elements.iter().map(|e| (e.centre() - at).length() * ASIDE * HIGH).sum::<f64>();
    elements.iter().all(|e| {
        let way = [(ASIDE, 0.0), (ASIDE, high), (-BEYOND, high)];
        let way = way.map(|(part, high)| e.lift().in_front(at + (e.centre() - at) * part + e.normal * high));
        way.windows(2).all(|w| !world.accel().occluded(&Ray { origin: w[0], dir: w[1] - w[0], t_max: 1.0 }))
    })
}
