//! Groups of elements that are close and face much the same way, by halving.

use super::mesh::Element;
use crate::math::DVec3;

/// Sorts some elements along the axis of place or normal in which they differ most, so that halves of them belong together. A normal counts for its components times
/// `turn`, m; equal ones go by index.
pub(super) fn sort_for_halving(elements: &[Element], members: &mut [u32], turn: f64) {
    let key = |i: u32| {
        let element = &elements[i as usize];
        let (place, normal) = (element.centre(), element.normal);
        [place.x, place.y, place.z, turn * normal.x, turn * normal.y, turn * normal.z]
    };
    let mut keyed: Vec<([f64; 6], u32)> = members.iter().map(|&i| (key(i), i)).collect();
    let extent = |axis: usize| {
        let range = keyed.iter().map(|(key, _)| key[axis]);
        let (low, high) = range.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
        high - low
    };
    let extents: [f64; 6] = std::array::from_fn(extent);
    let axis = (0..6).max_by(|&a, &b| extents[a].total_cmp(&extents[b]).then(b.cmp(&a))).unwrap_or(0);
    keyed.sort_by(|a, b| a.0[axis].total_cmp(&b.0[axis]).then(a.1.cmp(&b.1)));
    members.iter_mut().zip(keyed).for_each(|(to, (_, i))| *to = i);
}

/// The diagonal of the box around the centres of some elements, m.
pub(super) fn extent(elements: &[Element], members: impl Iterator<Item = u32>) -> f64 {
    let places = members.map(|i| elements[i as usize].centre());
    let (low, high) = places.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
    (high - low).length()
}
