//! Contact lines: where one surface touches or pierces another.
//!
//! Light steps there (a D0 discontinuity): the two sides of a wall do not see each other, however thin it is, and the floor under it is dark. So no element may reach across.
//! Such lines belong in every mesh, whatever the light [Lischinski92]; those of shadows do not, which move with the lights.
//!
//! A contact counts when it is as long as half an element and the surface rises from it by a quarter of one: what is smaller is in the way of little light. Cells of a grid
//! are cut where it crosses them, each on its own, into quadrilaterals and triangles; a line that ends inside a cell is drawn on to the cell's border.
//! Of surfaces that lie flat on others their outlines count: light hardly gets under them.

mod boxes;
mod coincident;

pub(super) use coincident::{coincident, holds};

use std::collections::BTreeMap;

use rayon::prelude::*;

use self::boxes::{Box3, Boxes};
use super::mesh::{Piece, cell_at, corners_of_cell};
use super::patch::Patch;
use crate::math::DVec3;
use crate::math::polygon::area_vector;

/// What is nearer than this touches, in lengths of an element's edge.
const NEAR: f64 = 1e-3;
/// What is nearer than this and parallel lies flat on another surface, in the same.
const FLAT: f64 = 0.02;
/// A contact is at least so long, and what touches rises from it at least so high, in the same.
const LONG: f64 = 0.5;
const HIGH: f64 = 0.25;
/// Sine of the smallest angle between surfaces whose contact counts: smooth ones continue each other.
const STEEP: f64 = 0.1;
/// Pieces of a cell at most, before they are made quadrilaterals.
const MAX_PIECES: usize = 32;
/// Steps along a contact in which the cells are looked for, and how many.
const STEP: f64 = 1.0 / 16.0;
const MAX_STEPS: f64 = 1e5;
/// Pairs of patches that are tried, about, but so many of each patch at least; and patches whose contacts are looked for before the smallest go.
const TESTS: usize = 1 << 26;
const MIN_TESTS: usize = 1 << 14;
const CHUNK: usize = 1024;
/// A cell is cut by a line that has no less than this fraction of its way through it.
const INSIDE: f64 = 0.05;

/// A line of contact on a patch.
#[derive(Clone, Copy, Debug)]
struct Contact {
    from: DVec3,
    to: DVec3,
    /// Of the surface that rises from it, m².
    area: f64,
}

/// By patch and cell: the pieces that contact lines cut it into, where they touch it; one alone where they run along its border.
pub(super) fn pieces(
    patches: &[Patch],
    kept: &[[bool; 2]],
    grids: &[[u32; 2]],
    size: f64,
    most: usize,
) -> Vec<BTreeMap<u32, Vec<Piece>>> {
    let mut contacts_of = vec![Vec::new(); patches.len()];
    let mut left = most as f64;
    for (p, contact) in contacts(patches, kept, size, most) {
        left -= (contact.to - contact.from).length() / size + 1.0;
        if left < 0.0 {
            break;
        }
        contacts_of[p as usize].push(contact);
    }
    // The longest first: shorter ones end at them.
    let length = |c: &Contact| (c.to - c.from).length();
    contacts_of.iter_mut().for_each(|contacts| contacts.sort_by(|a, b| length(b).total_cmp(&length(a))));
    let of_patch = |p: usize| match &contacts_of[p][..] {
        [] => BTreeMap::new(),
        contacts => cut(&patches[p], grids[p], contacts, size),
    };
    (0..patches.len()).into_par_iter().map(of_patch).collect()
}

/// Which of the pieces of a cell a point lies in; the nearest, about, where it is in none.
pub(super) fn piece_at(pieces: &[Piece], p: DVec3) -> usize {
    let inside = |(corners, n): &Piece| {
        let normal = area_vector(&corners[..*n]);
        let of_edge = |k: usize| normal.cross(corners[(k + 1) % n] - corners[k]).normalize_or_zero().dot(p - corners[k]);
        (0..*n).map(of_edge).fold(f64::INFINITY, f64::min)
    };
    let inside: Vec<f64> = pieces.iter().map(inside).collect();
    (0..pieces.len()).max_by(|&a, &b| inside[a].total_cmp(&inside[b]).then(b.cmp(&a))).unwrap_or(0)
}

/// The boxes around patches, and those that are not much smaller than an element.
fn large_of(patches: &[Patch], size: f64) -> (Vec<Box3>, Vec<u32>) {
    let bounds: Vec<Box3> = patches.iter().map(|patch| Box3::of(patch.corners())).collect();
    let is_large = |p: &u32| bounds[*p as usize].diagonal() >= LONG * size && bounds[*p as usize].is_finite();
    let large = (0..patches.len() as u32).filter(is_large).collect();
    (bounds, large)
}

/// How many others each of so many patches is tried with at most.
fn tests_of_each(n: usize) -> usize {
    MIN_TESTS.max(TESTS / n.max(1))
}

/// The contacts that count with their patches, at most `most`: the larger the surface that rises from them, the earlier.
fn contacts(patches: &[Patch], kept: &[[bool; 2]], size: f64, most: usize) -> Vec<(u32, Contact)> {
    let (bounds, large) = large_of(patches, size);
    let boxes = Boxes::new(&bounds, large.clone());
    let tests = tests_of_each(large.len());
    let of_patch = |&p: &u32| {
        let mut found = Vec::new();
        if kept[p as usize] != [false; 2] {
            boxes.touching(&bounds[p as usize].grown(FLAT * size), tests, |q| {
                if q != p {
                    let [p_corners, q_corners] = [p, q].map(|i| patches[i as usize].corners());
                    found.extend(contact(p_corners, q_corners, size).map(|contact| (p, contact)));
                    found.extend(outline(p_corners, q_corners, size).into_iter().flatten().map(|contact| (p, contact)));
                }
            });
        }
        found
    };
    let mut all: Vec<(u32, Contact)> = Vec::new();
    // Some at a time, so that surfaces that all pierce each other need no more memory than there is.
    for large in large.chunks(CHUNK) {
        all.extend(large.par_iter().flat_map_iter(of_patch).collect::<Vec<_>>());
        all.sort_by(|(_, a), (_, b)| b.area.total_cmp(&a.area));
        all.truncate(most);
    }
    all
}

/// Where the polygon `q` touches or pierces the polygon `p`, if that counts.
fn contact(p: &[DVec3], q: &[DVec3], size: f64) -> Option<Contact> {
    let (normal, of_q) = (area_vector(p).normalize_or_zero(), area_vector(q));
    let near = NEAR * size;
    let mut heights = [0.0; 4];
    for (h, c) in heights.iter_mut().zip(q) {
        let height = (*c - p[0]).dot(normal);
        *h = if height.abs() <= near { 0.0 } else { height };
    }
    let heights = &heights[..q.len()];
    let (low, high) = heights.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &x| (x.min(l), x.max(h)));
    let along = normal.cross(of_q.normalize_or_zero());
    if low > 0.0 || high < 0.0 || high.max(-low) < HIGH * size || along.length() < STEEP {
        return None;
    }
    let along = along.normalize_or_zero();
    let mut ends: Option<[DVec3; 2]> = None;
    let mut add = |x: DVec3| {
        let [a, b] = ends.unwrap_or([x; 2]);
        ends = Some([if x.dot(along) < a.dot(along) { x } else { a }, if x.dot(along) > b.dot(along) { x } else { b }]);
    };
    for k in 0..q.len() {
        let (l, a, b) = ((k + 1) % q.len(), q[k], q[(k + 1) % q.len()]);
        if heights[k] == 0.0 {
            add(a - normal * (a - p[0]).dot(normal));
        } else if heights[k] * heights[l] < 0.0 {
            add(a + (b - a) * (heights[k] / (heights[k] - heights[l])));
        }
    }
    let [from, to] = within(p, normal, ends?, near)?;
    let counts = (to - from).length() >= LONG * size;
    counts.then(|| Contact { from, to, area: of_q.length() })
}

/// The edges of the polygon `q` where it lies flat on the polygon `p`, if they count.
fn outline(p: &[DVec3], q: &[DVec3], size: f64) -> [Option<Contact>; 4] {
    let (normal, of_q) = (area_vector(p).normalize_or_zero(), area_vector(q));
    let height = |c: DVec3| (c - p[0]).dot(normal);
    if of_q.length() < (LONG * size).powi(2) || q.iter().any(|c| height(*c).abs() > FLAT * size) {
        return [None; 4];
    }
    std::array::from_fn(|k| {
        let ends = [*q.get(k)?, q[(k + 1) % q.len()]].map(|c| c - normal * height(c));
        let [from, to] = within(p, normal, ends, NEAR * size)?;
        let counts = (to - from).length() >= LONG * size;
        counts.then(|| Contact { from, to, area: of_q.length() })
    })
}

/// What of a line lies within the polygon `p`, and not on its border.
fn within(p: &[DVec3], normal: DVec3, [from, to]: [DVec3; 2], near: f64) -> Option<[DVec3; 2]> {
    let (mut t0, mut t1) = (0.0f64, 1.0f64);
    for k in 0..p.len() {
        let inwards = normal.cross(p[(k + 1) % p.len()] - p[k]).normalize_or_zero();
        let [a, b] = [from, to].map(|x| (x - p[k]).dot(inwards) - near);
        if a < 0.0 && b < 0.0 {
            return None;
        }
        if a < 0.0 {
            t0 = t0.max(a / (a - b));
        } else if b < 0.0 {
            t1 = t1.min(a / (a - b));
        }
    }
    (t1 > t0).then(|| [t0, t1].map(|t| from + (to - from) * t))
}

/// The cells of a patch that contacts touch, cut.
fn cut(patch: &Patch, n: [u32; 2], contacts: &[Contact], size: f64) -> BTreeMap<u32, Vec<Piece>> {
    let normal = area_vector(patch.corners()).normalize_or_zero();
    let mut touched: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (k, contact) in contacts.iter().enumerate() {
        let d = contact.to - contact.from;
        let aside = normal.cross(d).normalize_or_zero() * (2.0 * NEAR * size);
        let steps = (d.length() / (STEP * size)).ceil().clamp(1.0, MAX_STEPS);
        for i in 0..=steps as u32 {
            let p = contact.from + d * (f64::from(i) / steps);
            for p in [p + aside, p - aside] {
                let of_cell = touched.entry(cell_at(patch.is_quad(), n, patch.parameters(p)).0).or_default();
                if of_cell.last() != Some(&k) {
                    of_cell.push(k);
                }
            }
        }
    }
    let of_cell = |(cell, of_cell): (u32, Vec<usize>)| {
        let (corners, n_corners) = corners_of_cell(patch, n, 1, cell);
        let mut polygons = vec![corners[..n_corners].to_vec()];
        for k in of_cell {
            for i in 0..polygons.len() {
                if polygons.len() < MAX_PIECES
                    && let Some([left, right]) = split(&polygons[i], &contacts[k], normal, NEAR * size)
                {
                    polygons[i] = left;
                    polygons.push(right);
                }
            }
        }
        (cell, polygons.iter().flat_map(|polygon| quadrilaterals(polygon)).collect())
    };
    touched.into_iter().map(of_cell).collect()
}

/// Both parts of a convex polygon that a contact goes through.
fn split(polygon: &[DVec3], contact: &Contact, normal: DVec3, near: f64) -> Option<[Vec<DVec3>; 2]> {
    let d = (contact.to - contact.from).normalize_or_zero();
    let across = normal.cross(d);
    let height = |p: DVec3| {
        let h = (p - contact.from).dot(across);
        if h.abs() <= near { 0.0 } else { h }
    };
    let mut parts = [Vec::new(), Vec::new()];
    let (mut first, mut last) = (f64::INFINITY, f64::NEG_INFINITY);
    for (k, &a) in polygon.iter().enumerate() {
        let b = polygon[(k + 1) % polygon.len()];
        let (ha, hb) = (height(a), height(b));
        let mut on_line = |p: DVec3| {
            let t = (p - contact.from).dot(d);
            (first, last) = (first.min(t), last.max(t));
        };
        if ha >= 0.0 {
            parts[0].push(a);
        }
        if ha <= 0.0 {
            parts[1].push(a);
        }
        if ha == 0.0 {
            on_line(a);
        } else if ha * hb < 0.0 {
            let p = a + (b - a) * (ha / (ha - hb));
            on_line(p);
            parts.iter_mut().for_each(|part| part.push(p));
        }
    }
    let crosses = polygon.iter().any(|p| height(*p) > 0.0) && polygon.iter().any(|p| height(*p) < 0.0);
    let inside = last.min((contact.to - contact.from).length()) - first.max(0.0);
    (crosses && inside > (INSIDE * (last - first)).max(near)).then_some(parts)
}

/// A convex polygon as quadrilaterals and at most one triangle, around the corner that leaves the largest smallest of them.
fn quadrilaterals(polygon: &[DVec3]) -> Vec<Piece> {
    let n = polygon.len();
    let around = |first: usize| -> Vec<Piece> {
        let corner = |k: usize| polygon[(first + k) % n];
        let of = |k: usize| {
            let n_corners = (n - k + 1).min(4);
            ([corner(0), corner(k), corner(k + 1), corner(if n_corners == 4 { k + 2 } else { k + 1 })], n_corners)
        };
        (1..n - 1).step_by(2).map(of).collect()
    };
    let smallest = |pieces: &[Piece]| {
        let area = |(corners, n): &Piece| area_vector(&corners[..*n]).length();
        pieces.iter().map(area).fold(f64::INFINITY, f64::min)
    };
    if n <= 4 {
        return around(0);
    }
    (0..n).map(around).max_by(|a, b| smallest(a).total_cmp(&smallest(b))).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polygons_are_divided_into_quadrilaterals_that_cover_them_once() {
        for n in 3..12usize {
            let corner = |k: usize| {
                let angle = std::f64::consts::TAU * k as f64 / n as f64;
                DVec3::new(libm::cos(angle), libm::sin(angle), 0.0)
            };
            let polygon: Vec<DVec3> = (0..n).map(corner).collect();
            let pieces = quadrilaterals(&polygon);
            assert_eq!(pieces.len(), (n - 1) / 2);
            let area: f64 = pieces.iter().map(|(c, n)| area_vector(&c[..*n]).z).sum();
            assert!((area - area_vector(&polygon).z).abs() < 1e-12, "{n} corners");
        }
    }

    #[test]
    fn a_contact_is_what_of_a_wall_stands_on_a_floor() {
        let floor = [[0.0, 0.0, 0.0], [0.0, 0.0, 4.0], [4.0, 0.0, 4.0], [4.0, 0.0, 0.0]].map(DVec3::from_array);
        let wall = |x: f64, z: [f64; 2], y: [f64; 2]| {
            [[x, y[0], z[0]], [x, y[0], z[1]], [x, y[1], z[1]], [x, y[1], z[0]]].map(DVec3::from_array)
        };
        let ends = |wall: [DVec3; 4]| contact(&floor, &wall, 1.0).map(|c| [c.from.z.min(c.to.z), c.from.z.max(c.to.z)]);
        let near = |found: Option<[f64; 2]>, truth: [f64; 2]| {
            assert!(
                found.is_some_and(|f| (f[0] - truth[0]).abs() < 2e-3 && (f[1] - truth[1]).abs() < 2e-3),
                "{found:?} is not {truth:?}"
            );
        };
        near(ends(wall(2.0, [1.0, 3.0], [0.0, 2.0])), [1.0, 3.0]);
        // Through the floor, hovering a little, and longer than the floor.
        near(ends(wall(2.0, [1.0, 3.0], [-1.0, 2.0])), [1.0, 3.0]);
        near(ends(wall(2.0, [1.0, 3.0], [5e-4, 2.0])), [1.0, 3.0]);
        near(ends(wall(2.0, [-1.0, 9.0], [0.0, 2.0])), [0.0, 4.0]);
        // Above it, on its border, too low, too short.
        for wall in [
            wall(2.0, [1.0, 3.0], [0.1, 2.0]),
            wall(4.0, [1.0, 3.0], [0.0, 2.0]),
            wall(2.0, [1.0, 3.0], [0.0, 0.1]),
            wall(2.0, [1.0, 1.2], [0.0, 2.0]),
        ] {
            assert_eq!(ends(wall), None);
        }
    }
}
