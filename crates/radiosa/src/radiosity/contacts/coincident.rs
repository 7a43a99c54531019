//! Surfaces that lie in one another: of two that share a plane and a part of it, the first is there and the other is not.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::boxes::Boxes;
use super::{large_of, tests_of_each};
use crate::math::DVec3;
use crate::math::polygon::{area_vector, clip};
use crate::radiosity::patch::Patch;

/// What is nearer than this is in the same plane, in parts of the largest coordinate: what rounding to f32 leaves.
const NEAR: f64 = 1e-6;
/// Less than this part of the smaller one in common is a common edge.
const PART: f64 = 1e-3;

/// By patch: the patches before it that share its plane and a part of it, in their order. `counts` tells which hide others; patches much smaller than
/// `size`, an element's edge, are not looked at.
pub(in super::super) fn coincident(
    patches: &[Patch],
    counts: impl Fn(&Patch) -> bool + Sync,
    size: f64,
) -> BTreeMap<u32, Vec<u32>> {
    let (bounds, large) = large_of(patches, size);
    let boxes = Boxes::new(&bounds, large.clone());
    let tests = tests_of_each(large.len());
    let of_patch = |&p: &u32| {
        let of_p = patches[p as usize].corners();
        let near = NEAR * of_p.iter().map(|c| c.abs().max_element()).fold(0.0, f64::max);
        let mut before = Vec::new();
        boxes.touching(&bounds[p as usize].grown(near), tests, |q| {
            let other = &patches[q as usize];
            if q < p && counts(other) && share(of_p, other.corners(), near) {
                before.push(q);
            }
        });
        before.sort_unstable();
        (!before.is_empty()).then_some((p, before))
    };
    large.par_iter().filter_map(of_patch).collect::<Vec<_>>().into_iter().collect()
}

/// Both lie in one plane and have a part of it in common.
fn share(p: &[DVec3], q: &[DVec3], near: f64) -> bool {
    let [of_p, of_q] = [p, q].map(area_vector);
    let normal = of_p.normalize_or_zero();
    if q.iter().any(|c| (*c - p[0]).dot(normal).abs() > near) || normal == DVec3::ZERO {
        return false;
    }
    let (mut common, mut rest) = (q.to_vec(), Vec::new());
    for k in 0..p.len() {
        let inwards = normal.cross(p[(k + 1) % p.len()] - p[k]).normalize_or_zero();
        clip(&common, p[k], inwards, near, &mut rest);
        std::mem::swap(&mut common, &mut rest);
    }
    area_vector(&common).length() > PART * of_p.length().min(of_q.length())
}

/// A point of its plane lies within a convex polygon, or on its border.
pub(in super::super) fn holds(polygon: &[DVec3], p: DVec3) -> bool {
    let normal = area_vector(polygon);
    (0..polygon.len()).all(|k| normal.cross(polygon[(k + 1) % polygon.len()] - polygon[k]).dot(p - polygon[k]) >= 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_shares_a_plane_and_a_part_of_it_is_found() {
        let square =
            |x: f64, z: f64, y: f64| [[x, y, z], [x, y, z + 1.0], [x + 1.0, y, z + 1.0], [x + 1.0, y, z]].map(DVec3::from_array);
        let floor = square(0.0, 0.0, 0.0);
        assert!(share(&floor, &square(0.5, 0.5, 0.0), 1e-6) && share(&floor, &floor, 1e-6));
        let mut turned = square(0.2, 0.2, 0.0);
        turned.reverse();
        assert!(share(&floor, &turned, 1e-6));
        // Above, beside, and touching along an edge.
        for other in [square(0.0, 0.0, 1e-3), square(2.0, 0.0, 0.0), square(1.0, 0.0, 0.0), square(1.0 - 1e-7, 0.0, 0.0)] {
            assert!(!share(&floor, &other, 1e-6), "{other:?}");
        }
        assert!(holds(&floor, DVec3::new(0.5, 0.0, 0.5)) && !holds(&floor, DVec3::new(1.5, 0.0, 0.5)));
    }
}
