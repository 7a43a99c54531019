//! What polygons exchange past others: the shadows that occluders throw from a point are cut out of what the point sees.
//!
//! ```text
//! A F = A F_unoccluded − ∫_a [F(p → b) − F(p → b without the shadows of the occluders)] dA
//! ```
//!
//! At a point the answer is exact: a convex polygon less the cone over another is at most as many convex polygons as the cone has sides. Over the polygon
//! the difference has kinks where shadows meet edges, so cells are divided where two rules disagree, the worst first. Occluders are opaque polygons,
//! seen from both sides.

use std::borrow::Cow;
use std::cmp::Ordering;
use std::collections::{BinaryHeap, HashMap};

use super::analytic::{self, gauss_legendre, point_to_visible_polygon};
use crate::math::DVec3;
use crate::math::polygon::{area_vector, bilinear, bilinear_area, clip};

/// Cells the outer polygon is divided into, at most.
const MAX_CELLS: usize = 4096;

/// Pieces a polygon may be cut into at one point; what is left beyond counts as seen.
const MAX_PIECES: usize = 512;

/// Where a kink passes two rules may agree and both be wrong: the changes asked for are smaller than the error wanted.
const SAFETY: f64 = 0.25;

/// Pairs that exchange less than this times what may be wrong take one rule.
const COARSE: f64 = 8.0;

/// Smaller than this in units of the lengths that make it, a side of a cone is none.
const TINY: f64 = 1e-12;

/// A value and how far it may be off.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// m² for exchange areas.
    pub value: f64,
    /// In the same unit; an estimate, mostly too large.
    pub error: f64,
}

/// Memory that is used again from pair to pair.
#[derive(Debug, Default)]
pub struct Scratch {
    whole: Vec<DVec3>,
    pieces: Vec<Vec<DVec3>>,
    next: Vec<Vec<DVec3>>,
    spare: Vec<Vec<DVec3>>,
    blocker: Vec<DVec3>,
    cut: Vec<DVec3>,
    sides: Vec<DVec3>,
}

/// `A_a F_ab = A_b F_ba` of two convex one-sided polygons past convex two-sided ones, m².
///
/// `tolerance` is the error wanted, relative to the smaller area; it is missed where more cells than there may be would be needed, and the estimate says so.
pub fn exchange_area(a: &[DVec3], b: &[DVec3], occluders: &[&[DVec3]], tolerance: f64, scratch: &mut Scratch) -> Estimate {
    if a.len() < 3 || b.len() < 3 {
        return Estimate::default();
    }
    let free = analytic::exchange_area(a, b, 1e-2 * tolerance.max(1e-12));
    let (of_a, of_b) = (Outline::new(a), Outline::new(b));
    let is_between = |o: &&[DVec3]| o.len() >= 3 && may_block(&of_a, &of_b, &Outline::new(*o));
    let between: Vec<&[DVec3]> = occluders.iter().copied().filter(is_between).collect();
    exchange_past(free, a, b, &between, tolerance, scratch)
}

/// The same when `free`, what they would exchange without occluders, is known.
pub(super) fn exchange_past(
    free: f64,
    a: &[DVec3],
    b: &[DVec3],
    occluders: &[&[DVec3]],
    tolerance: f64,
    scratch: &mut Scratch,
) -> Estimate {
    if free <= 0.0 || occluders.is_empty() {
        return Estimate { value: free, error: 0.0 };
    }
    // Over the smaller one: what it sees of the larger changes less from point to point.
    let (a, b) = if area_vector(a).length_squared() <= area_vector(b).length_squared() { (a, b) } else { (b, a) };
    let (normal, smaller) = (area_vector(a).normalize_or_zero(), area_vector(a).length());
    // A shadow that falls between the points of a cell is never looked for: the more is at stake, the smaller are the first cells.
    let halvings = if free > 0.02 * smaller { 2 } else { u32::from(free > 1e-3 * smaller) };
    let mut integrand = |p: DVec3| hidden_from_point(p, normal, b, occluders, scratch);
    if free < COARSE * tolerance * smaller {
        // So little is at stake that one rule does. How far off it is nobody knows: a tenth of what is doubtful, say.
        let corners = [a[0], a[1], a[2], a[a.len() - 1]];
        let hidden = if a.len() <= 4 {
            by_rule(&corners, 0, &mut integrand)
        } else {
            integrate(a, 0, f64::INFINITY, &mut integrand).value
        };
        return Estimate { value: (free - hidden).clamp(0.0, free), error: 0.1 * hidden.min(free - hidden).max(0.0) };
    }
    let hidden = integrate(a, halvings, SAFETY * tolerance * smaller, &mut integrand);
    Estimate { value: (free - hidden.value).clamp(0.0, free), error: hidden.error }
}

/// Joins coplanar convex polygons that share an edge to larger ones, as long as these are convex: the faces of a finely divided wall to the wall.
pub(super) fn merge(mut polygons: Vec<Vec<DVec3>>) -> Vec<Vec<DVec3>> {
    let key = |p: DVec3| (p + DVec3::ZERO).to_array().map(f64::to_bits);
    let mut by_edge: HashMap<[[u64; 3]; 2], usize> = HashMap::new();
    let edges = |polygon: &[DVec3]| -> Vec<[DVec3; 2]> {
        (0..polygon.len()).map(|i| [polygon[i], polygon[(i + 1) % polygon.len()]]).collect()
    };
    for (i, polygon) in polygons.iter().enumerate() {
        for [a, b] in edges(polygon) {
            by_edge.insert([key(a), key(b)], i);
        }
    }
    for i in (0..polygons.len()).chain(0..polygons.len()) {
        // As far as it goes; the second time rows of cells join to areas.
        'grow: loop {
            for [a, b] in edges(&polygons[i]) {
                let Some(&j) = by_edge.get(&[key(b), key(a)]).filter(|&&j| j != i && !polygons[j].is_empty()) else { continue };
                let Some(union) = union(&polygons[i], &polygons[j], [a, b]) else { continue };
                polygons[j].clear();
                polygons[i] = union;
                for [a, b] in edges(&polygons[i]) {
                    by_edge.insert([key(a), key(b)], i);
                }
                continue 'grow;
            }
            break;
        }
    }
    polygons.retain(|polygon| !polygon.is_empty());
    polygons
}

/// Two polygons that share the edge from `a` to `b`, the second the other way around, as one; `None` when that is not flat and convex.
fn union(first: &[DVec3], second: &[DVec3], [a, b]: [DVec3; 2]) -> Option<Vec<DVec3>> {
    let normal = area_vector(first).normalize_or_zero();
    if area_vector(second).normalize_or_zero().dot(normal) < 1.0 - 1e-12 {
        return None;
    }
    let from = |polygon: &[DVec3], start: DVec3| -> Option<Vec<DVec3>> {
        let at = polygon.iter().position(|&p| p == start)?;
        Some(polygon[at..].iter().chain(&polygon[..at]).copied().collect())
    };
    // The first from b on to before a, the second from a on to before b.
    let (mut ring, rest) = (from(first, b)?, from(second, a)?);
    ring.pop();
    ring.extend(&rest[..rest.len() - 1]);
    let n = ring.len();
    let turn = |i: usize| {
        let (before, here, after) = (ring[(i + n - 1) % n], ring[i], ring[(i + 1) % n]);
        (here - before).cross(after - here).dot(normal) / ((here - before).length() * (after - here).length())
    };
    let turns: Vec<f64> = (0..n).map(turn).collect();
    if !turns.iter().all(|&t| t > -1e-12) || ring.iter().any(|p| ((*p - a).dot(normal)).abs() > 1e-12 * (*p - a).length()) {
        return None;
    }
    // Corners that are none any more go.
    let corners: Vec<DVec3> = ring.iter().zip(&turns).filter(|(_, turn)| **turn > 1e-12).map(|(p, _)| *p).collect();
    (corners.len() >= 3).then_some(corners)
}

/// A convex polygon with what is asked of it for every pair.
#[derive(Clone, Debug)]
pub(super) struct Outline<'a> {
    pub(super) corners: Cow<'a, [DVec3]>,
    /// Unit, the front's; zero where it has no area.
    normal: DVec3,
    min: DVec3,
    max: DVec3,
}

impl<'a> Outline<'a> {
    pub(super) fn new(corners: impl Into<Cow<'a, [DVec3]>>) -> Self {
        let corners = corners.into();
        let normal = area_vector(&corners).normalize_or_zero();
        let around = |[l, h]: [DVec3; 2], p: &DVec3| [l.min(*p), h.max(*p)];
        let [min, max] = corners.iter().fold([DVec3::INFINITY, DVec3::NEG_INFINITY], around);
        Self { corners, normal, min, max }
    }

    /// Something of it lies more than `tiny` in front of another.
    fn reaches_before(&self, other: &Self, tiny: f64) -> bool {
        self.corners.iter().any(|p| (*p - other.corners[0]).dot(other.normal) > tiny)
    }
}

/// Something of `o` may lie between the fronts of `a` and `b`: false is certain.
pub(super) fn may_block(a: &Outline, b: &Outline, o: &Outline) -> bool {
    let tiny = 1e-9 * reach(a, b, o);
    crosses(a, b, o) && o.reaches_before(a, tiny) && o.reaches_before(b, tiny)
}

/// Something of `o` may lie between `a` and `b`, whichever sides of them: false is certain.
pub(super) fn crosses(a: &Outline, b: &Outline, o: &Outline) -> bool {
    // Outside of the box around both.
    if !(o.min.cmple(a.max.max(b.max)).all() && o.max.cmpge(a.min.min(b.min)).all()) {
        return false;
    }
    // Both on one side of it.
    let tiny = 1e-9 * reach(a, b, o);
    let (mut low, mut high) = (0.0f64, 0.0f64);
    for corners in [&a.corners, &b.corners] {
        for p in corners.iter() {
            let h = (*p - o.corners[0]).dot(o.normal);
            (low, high) = (low.min(h), high.max(h));
        }
    }
    low < -tiny && high > tiny
}

/// How far corners are from each other, about: what rounding is relative to.
fn reach(a: &Outline, b: &Outline, o: &Outline) -> f64 {
    let (min, max) = (a.min.min(b.min).min(o.min), a.max.max(b.max).max(o.max));
    (max - a.corners[0]).abs().max((min - a.corners[0]).abs()).max_element()
}

/// How much less of `polygon` a point sees for the occluders: a difference of factors from a differential area with unit normal `n`.
pub fn hidden_from_point(p: DVec3, n: DVec3, polygon: &[DVec3], occluders: &[&[DVec3]], scratch: &mut Scratch) -> f64 {
    let front = area_vector(polygon);
    if polygon.len() < 3 {
        return 0.0;
    }
    if (p - polygon[0]).dot(front) <= 0.0 {
        return 0.0;
    }
    let mut whole = std::mem::take(&mut scratch.whole);
    clip(polygon, p, n, 0.0, &mut whole);
    let hidden = if whole.len() < 3 {
        0.0
    } else {
        let all = point_to_visible_polygon(p, n, &whole);
        seen_past(p, n, &whole, front, occluders, scratch);
        all - scratch.pieces.iter().map(|piece| point_to_visible_polygon(p, n, piece)).sum::<f64>()
    };
    scratch.whole = whole;
    hidden.max(0.0)
}

/// Leaves the parts of `polygon` that are seen in `scratch.pieces`.
fn seen_past(p: DVec3, n: DVec3, polygon: &[DVec3], front: DVec3, occluders: &[&[DVec3]], scratch: &mut Scratch) {
    let Scratch { pieces, next, spare, blocker, cut, sides, .. } = scratch;
    spare.append(pieces);
    let copy = |from: &[DVec3], spare: &mut Vec<Vec<DVec3>>| {
        let mut to = spare.pop().unwrap_or_default();
        to.clear();
        to.extend_from_slice(from);
        to
    };
    pieces.push(copy(polygon, spare));
    for occluder in occluders {
        // What of it lies above the point's horizon and before the polygon.
        clip(occluder, p, n, 0.0, cut);
        clip(cut, polygon[0], front, TINY * front.length(), blocker);
        if blocker.len() < 3 {
            continue;
        }
        // Its cone: the inside of the planes through the point and its edges.
        sides.clear();
        let facing = (blocker[0] - p).dot(area_vector(blocker));
        let sign = if facing < 0.0 { -1.0 } else { 1.0 };
        for (i, corner) in blocker.iter().enumerate() {
            let (u, v) = (*corner - p, blocker[(i + 1) % blocker.len()] - p);
            let side = u.cross(v) * sign;
            let length = side.length();
            if length > TINY * u.length() * v.length() {
                sides.push(side / length);
            }
        }
        if sides.len() < 3 {
            continue;
        }
        for piece in pieces.drain(..) {
            let outside = |side: &DVec3| piece.iter().all(|q| (*q - p).dot(*side) <= TINY * (*q - p).length());
            if sides.iter().any(outside) || next.len() > MAX_PIECES {
                next.push(piece);
                continue;
            }
            let mut rest = piece;
            for side in sides.iter() {
                let mut away = spare.pop().unwrap_or_default();
                clip(&rest, p, -*side, 0.0, &mut away);
                if away.len() >= 3 {
                    next.push(away);
                } else {
                    spare.push(away);
                }
                clip(&rest, p, *side, 0.0, cut);
                rest.clear();
                rest.extend_from_slice(cut);
                if rest.len() < 3 {
                    break;
                }
            }
            spare.push(rest);
        }
        std::mem::swap(pieces, next);
        if pieces.is_empty() {
            return;
        }
    }
}

/// A part of the outer polygon, bilinear between four corners, and its integral by the coarse and the fine rule.
struct Cell {
    corners: [DVec3; 4],
    value: f64,
    /// What the fine rule changed.
    error: f64,
}

impl PartialEq for Cell {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Cell {}
impl PartialOrd for Cell {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Cell {
    fn cmp(&self, other: &Self) -> Ordering {
        self.error.total_cmp(&other.error)
    }
}

/// `∫ f dA` over a convex polygon, within about `tolerance`; every part of it is divided `halvings` times before anything is asked.
fn integrate(polygon: &[DVec3], halvings: u32, tolerance: f64, f: &mut impl FnMut(DVec3) -> f64) -> Estimate {
    let mut first: Vec<[DVec3; 4]> = match *polygon {
        [a, b, c, d] => vec![[a, b, c, d]],
        // A fan around the first corner, each triangle a quadrilateral whose last corners are one.
        _ => polygon[1..].windows(2).map(|edge| [polygon[0], edge[0], edge[1], edge[1]]).collect(),
    };
    for _ in 0..halvings {
        first = first.into_iter().flat_map(quarters).collect();
    }
    let mut cell = |corners: [DVec3; 4]| {
        let (coarse, value) = (by_rule(&corners, 0, f), by_rule(&corners, 1, f));
        Cell { corners, value, error: (value - coarse).abs() }
    };
    let mut cells: BinaryHeap<Cell> = first.into_iter().map(&mut cell).collect();
    let mut error: f64 = cells.iter().map(|c| c.error).sum();
    while error > tolerance && cells.len() < MAX_CELLS {
        let Some(worst) = cells.pop() else { break };
        error -= worst.error;
        for quarter in quarters(worst.corners).map(&mut cell) {
            error += quarter.error;
            cells.push(quarter);
        }
    }
    // Smallest first, for the sake of rounding.
    let cells = cells.into_sorted_vec();
    Estimate { value: cells.iter().map(|c| c.value).sum(), error: cells.iter().map(|c| c.error).sum() }
}

/// The four parts of a bilinear cell.
fn quarters([a, b, c, d]: [DVec3; 4]) -> [[DVec3; 4]; 4] {
    let (ab, bc, cd, da) = ((a + b) * 0.5, (b + c) * 0.5, (c + d) * 0.5, (d + a) * 0.5);
    let middle = (ab + cd) * 0.5;
    [[a, ab, middle, da], [ab, b, bc, middle], [middle, bc, c, cd], [da, middle, cd, d]]
}

/// Gauss and Legendre's tensor rule of `[3, 4]` points a side.
fn by_rule(corners: &[DVec3; 4], which: usize, f: &mut impl FnMut(DVec3) -> f64) -> f64 {
    let rule = &RULES[which];
    let mut sum = 0.0;
    for &[t, wt] in rule {
        for &[s, ws] in rule {
            sum += ws * wt * bilinear_area(*corners, [s, t]) * f(bilinear(*corners, [s, t]));
        }
    }
    sum
}

static RULES: std::sync::LazyLock<[Vec<[f64; 2]>; 2]> = std::sync::LazyLock::new(|| [3, 4].map(gauss_legendre));

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_divided_square_is_joined_and_what_is_not_convex_is_left_apart() {
        let cell = |i: u32, j: u32| {
            let corner = |i: u32, j: u32| DVec3::new(f64::from(i) * 0.25, f64::from(j) * 0.5, 1.0);
            vec![corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)]
        };
        let cells = |n: u32| (0..n * n).map(|k| cell(k % n, k / n)).collect::<Vec<_>>();
        let whole = merge(cells(5));
        assert_eq!(whole.len(), 1, "{whole:?}");
        assert_eq!(area_vector(&whole[0]), DVec3::Z * (1.25 * 2.5));
        // One cell missing at a corner: an L.
        let parts = merge(cells(5)[1..].to_vec());
        assert!((2..=3).contains(&parts.len()), "{parts:?}");
        assert!((parts.iter().map(|p| area_vector(p).z).sum::<f64>() - 24.0 * 0.125).abs() < 1e-12);
    }
}
