//! Contact lines: where one surface touches or pierces another.
//!
//! Light steps there (a D0 discontinuity): the two sides of a wall do not see each other, however thin it is, and the floor under it is dark. So no element may reach across.
//! Such lines belong in every mesh, whatever the light [Lischinski92]; those of shadows, which move with the lights, are cut into what contacts left, where they
//! are asked for ([`super::discontinuity`]).
//!
//! A contact counts when it is as long as half an element and the surface rises from it by a quarter of one: what is smaller is in the way of little light. Cells of a grid
//! are cut where it crosses them, each on its own, into quadrilaterals and triangles; a line that ends inside a cell is drawn on to the cell's border. Convex polygons are halved
//! by lines to which corners nearby are rounded, so every cell is covered once, whatever lines go through it.
//! Of surfaces that lie flat on others their outlines count: light hardly gets under them.

mod boxes;
mod coincident;

pub(super) use coincident::{coincident, holds};

use std::collections::BTreeMap;

use rayon::prelude::*;

use self::boxes::{Box3, Boxes};
use super::discontinuity::Line;
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
/// Corners of cells that are nearer to the border of a shadow lie on it, in lengths of an element's edge; and cells are not cut by it where one side of it would be a smaller part
/// of the cell.
const SNAP: f64 = 0.02;
const SLIVER: f64 = 0.02;

/// A line of contact on a patch.
#[derive(Clone, Copy, Debug)]
struct Contact {
    from: DVec3,
    to: DVec3,
    /// Of the surface that rises from it, m².
    area: f64,
}

/// By patch and cell: the pieces that contact lines and then `lines` cut it into, where they touch it; one alone where a contact line runs along its border. At most about
/// `most` pieces come from contacts.
pub(super) fn pieces(
    patches: &[Patch],
    kept: &[[bool; 2]],
    grids: &[[u32; 2]],
    size: f64,
    most: usize,
    lines: &[Line],
) -> Vec<BTreeMap<u32, Vec<Piece>>> {
    let mut contacts_of = vec![Vec::new(); patches.len()];
    let mut left = most as f64;
    for (p, contact) in if most > 0 { contacts(patches, kept, size, most) } else { Vec::new() } {
        left -= (contact.to - contact.from).length() / size + 1.0;
        if left < 0.0 {
            break;
        }
        contacts_of[p as usize].push(contact);
    }
    // The longest first: shorter ones end at them.
    let length = |c: &Contact| (c.to - c.from).length();
    contacts_of.iter_mut().for_each(|contacts| contacts.sort_by(|a, b| length(b).total_cmp(&length(a))));
    let mut lines_of = vec![Vec::new(); patches.len()];
    for line in lines {
        let [from, to] = line.ends;
        lines_of[line.patch as usize].push(Contact { from, to, area: 0.0 });
    }
    let of_patch = |p: usize| match (&contacts_of[p][..], &lines_of[p][..]) {
        ([], []) => BTreeMap::new(),
        (contacts, lines) => cut(&patches[p], grids[p], contacts, lines, size),
    };
    (0..patches.len()).into_par_iter().map(of_patch).collect()
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

/// The cells of a patch that contacts touch or lines cross, cut.
fn cut(patch: &Patch, n: [u32; 2], contacts: &[Contact], lines: &[Contact], size: f64) -> BTreeMap<u32, Vec<Piece>> {
    let normal = area_vector(patch.corners()).normalize_or_zero();
    let mut touched: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    let all = || contacts.iter().chain(lines);
    for (k, contact) in all().enumerate() {
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
    let all: Vec<&Contact> = all().collect();
    let of_cell = |(cell, of_cell): (u32, Vec<usize>)| {
        let (corners, n_corners) = corners_of_cell(patch, n, 1, cell);
        let mut polygons = vec![corners[..n_corners].to_vec()];
        let area = |polygon: &[DVec3]| area_vector(polygon).length();
        let least = SLIVER * area(&polygons[0]);
        let touches_contact = of_cell.first().is_some_and(|&k| k < contacts.len());
        for k in of_cell {
            let is_contact = k < contacts.len();
            let near = if is_contact { NEAR } else { SNAP } * size;
            for i in 0..polygons.len() {
                if polygons.len() < MAX_PIECES
                    && let Some([left, right]) = split(&polygons[i], all[k], normal, near)
                    && (is_contact || area(&left).min(area(&right)) >= least)
                {
                    polygons[i] = left;
                    polygons.push(right);
                }
            }
        }
        let is_cut = touches_contact || polygons.len() > 1;
        is_cut.then(|| (cell, polygons.iter().flat_map(|polygon| quadrilaterals(polygon)).collect()))
    };
    touched.into_iter().filter_map(of_cell).collect()
}

/// Both parts of a convex polygon that a contact goes through: on either side of the chord between two corners, or places of edges. Where several corners next to each other
/// are near the line, the nearest is an end of the chord.
fn split(polygon: &[DVec3], contact: &Contact, normal: DVec3, near: f64) -> Option<[Vec<DVec3>; 2]> {
    let n = polygon.len();
    let d = (contact.to - contact.from).normalize_or_zero();
    let across = normal.cross(d);
    let heights: Vec<f64> = polygon.iter().map(|p| (*p - contact.from).dot(across)).collect();
    let side = |k: usize| if heights[k % n].abs() <= near { 0.0 } else { heights[k % n].signum() };
    let first = (0..n).find(|&k| side(k) != 0.0)?;
    let mut parts = [Vec::new(), Vec::new()];
    let mut ends = Vec::new();
    let of = |side: f64| usize::from(side < 0.0);
    let mut k = first;
    while k < first + n {
        // A corner off the line, those on it that follow, and the next off it.
        parts[of(side(k))].push(polygon[k % n]);
        let next = (k + 1..=first + n).find(|&l| side(l) != 0.0)?;
        let between = k + 1..next;
        if side(k) == side(next) {
            parts[of(side(k))].extend(between.map(|l| polygon[l % n]));
        } else {
            let nearest = between.clone().min_by(|&a, &b| heights[a % n].abs().total_cmp(&heights[b % n].abs()));
            let (a, b) = (polygon[k % n], polygon[next % n]);
            let crossing = || a + (b - a) * (heights[k % n] / (heights[k % n] - heights[next % n]));
            let end = nearest.map_or_else(crossing, |l| polygon[l % n]);
            let corners = |of: std::ops::Range<usize>| of.map(|l| polygon[l % n]);
            parts[of(side(k))].extend(corners(k + 1..nearest.unwrap_or(k + 1)));
            parts.iter_mut().for_each(|part| part.push(end));
            parts[of(side(next))].extend(corners(nearest.map_or(next, |l| l + 1)..next));
            ends.push((end - contact.from).dot(d));
        }
        k = next;
    }
    let [a, b] = ends[..] else { return None };
    let (first, last) = (a.min(b), a.max(b));
    let inside = last.min((contact.to - contact.from).length()) - first.max(0.0);
    (inside > (INSIDE * (last - first)).max(near)).then_some(parts)
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
    fn polygons_are_halved_without_loss_wherever_the_line_runs() {
        let polygon = [[0.0, 0.0], [0.5, -0.01], [1.0, 0.0], [1.01, 0.5], [1.0, 1.0], [0.0, 1.0]];
        let polygon = polygon.map(|[x, y]| DVec3::new(x, y, 0.0));
        let whole = area_vector(&polygon).z;
        let mut n_split = 0;
        for k in 0..2000u32 {
            let number = |i: u32| f64::from(k.wrapping_mul(2_654_435_761).rotate_left(7 * i) >> 8) / f64::from(1 << 24);
            // Some along edges, or nearly.
            let [from, to] = match k % 3 {
                0 => [[-1.0, 0.02 * number(0)], [2.0, 0.02 * number(1)]],
                1 => [[1.0 + 0.02 * number(0), -1.0], [1.0 + 0.02 * number(1), 2.0]],
                _ => [[-1.0, 3.0 * number(0) - 1.0], [2.0, 3.0 * number(1) - 1.0]],
            };
            let contact = Contact { from: DVec3::new(from[0], from[1], 0.0), to: DVec3::new(to[0], to[1], 0.0), area: 1.0 };
            if let Some(parts) = split(&polygon, &contact, DVec3::Z, 0.02) {
                let areas = parts.each_ref().map(|part| area_vector(part).z);
                assert!(areas.iter().all(|a| *a > 0.0) && (areas[0] + areas[1] - whole).abs() < 1e-12, "{k}: {parts:?}");
                n_split += 1;
            }
        }
        assert!((400..1400).contains(&n_split), "{n_split}");
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
