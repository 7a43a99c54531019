//! A map of radiance as a few directions: `π L_i = ∫_cell L dω` for cells of the map that matter equally.
//!
//! The whole map is one cell at first; then, until there are n, the cell that costs most is cut in two halves of equal energy across its
//! longer side (median cut, [Debevec05]). The cost of a cell is its energy times the square of its extent: what irradiance loses
//! when the cell is replaced by one direction, so that a sun of a few texels is not cut any further while the sky around it is. A cell's
//! direction is its energy centroid, which makes the error of a cell seen in full second order in its extent.

use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::f64::consts::PI;

use super::environment::{Map, RowIntegral};
use crate::math::{DVec3, function};
use crate::scene::Directional;
use crate::spectrum::Spectrum;

/// A rectangle of texels: columns `x0..x1`, rows `y0..y1`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Cell {
    x: (u32, u32),
    y: (u32, u32),
    cost: f64,
    /// Breaks ties, so that the result never depends on the heap's inside.
    order: u32,
}

impl Eq for Cell {}

impl PartialOrd for Cell {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Cell {
    fn cmp(&self, other: &Self) -> Ordering {
        self.cost.total_cmp(&other.cost).then(other.order.cmp(&self.order))
    }
}

/// Sums of luminance times solid angle over rectangles.
struct EnergyTable {
    width: usize,
    /// `(w + 1) × (h + 1)` running sums.
    sums: Vec<f64>,
}

impl EnergyTable {
    fn new(map: &Map) -> Self {
        let (w, h) = map.size();
        let width = w as usize + 1;
        let mut sums = vec![0.0; width * (h as usize + 1)];
        for y in 0..h {
            let solid_angle = RowIntegral::new(y, h).solid_angle(w);
            let mut row = 0.0;
            for x in 0..w {
                row += f64::from(map.texel(x, y).luminance()) * solid_angle;
                let at = (y as usize + 1) * width + x as usize + 1;
                sums[at] = sums[at - width] + row;
            }
        }
        Self { width, sums }
    }

    fn energy(&self, x: (u32, u32), y: (u32, u32)) -> f64 {
        let at = |x: u32, y: u32| self.sums[y as usize * self.width + x as usize];
        (at(x.1, y.1) - at(x.0, y.1)) - (at(x.1, y.0) - at(x.0, y.0))
    }
}

/// At most `n` directions (fewer when the map has fewer texels that shine), in map coordinates; each intensity is `∫_cell L dω/π`.
/// The sum over all is exact. Takes memory for one f64 a texel.
pub(super) fn reduce(map: &Map, n: usize) -> Vec<Directional> {
    let (w, h) = map.size();
    let energy = EnergyTable::new(map);
    let cell = |x, y, order| {
        let (across, down) = extent(x, y, w, h);
        let single = x == (x.0, x.0 + 1) && y == (y.0, y.0 + 1);
        let cost = if single { 0.0 } else { energy.energy(x, y).max(0.0) * (across * across + down * down) };
        Cell { x, y, cost, order }
    };
    let mut heap = BinaryHeap::from([cell((0, w), (0, h), 0)]);
    let mut order = 0;
    while heap.len() < n.max(1) {
        let Some(worst) = heap.pop_if_positive() else { break };
        let (x, y) = (worst.x, worst.y);
        let (across, down) = extent(x, y, w, h);
        let total = energy.energy(x, y);
        let cut_x = if y.1 - y.0 == 1 { true } else { x.1 - x.0 > 1 && across >= down };
        let halves = if cut_x {
            let m = median(x, |m| energy.energy((x.0, m), y), total);
            [((x.0, m), y), ((m, x.1), y)]
        } else {
            let m = median(y, |m| energy.energy(x, (y.0, m)), total);
            [(x, (y.0, m)), (x, (m, y.1))]
        };
        for (x, y) in halves {
            order += 1;
            heap.push(cell(x, y, order));
        }
    }
    let mut cells = heap.into_vec();
    cells.sort_by_key(|cell| cell.order);
    let columns = map.column_integrals();
    cells.iter().filter_map(|cell| direction(map, &columns, cell)).collect()
}

trait PopIfPositive {
    fn pop_if_positive(&mut self) -> Option<Cell>;
}

impl PopIfPositive for BinaryHeap<Cell> {
    /// The most costly cell, unless nothing is left to cut.
    fn pop_if_positive(&mut self) -> Option<Cell> {
        if self.peek().is_some_and(|cell| cell.cost > 0.0) { self.pop() } else { None }
    }
}

/// Angular width (at its widest row) and height of a cell, radians.
fn extent(x: (u32, u32), y: (u32, u32), w: u32, h: u32) -> (f64, f64) {
    let theta = |y: u32| PI * f64::from(y) / f64::from(h);
    let widest = (0.5 * PI).clamp(theta(y.0), theta(y.1));
    (2.0 * PI * f64::from(x.1 - x.0) / f64::from(w) * function::sin_f64(widest), theta(y.1) - theta(y.0))
}

/// The cut strictly inside `range` that parts `total` most evenly; `below(m)` grows with `m`.
fn median(range: (u32, u32), below: impl Fn(u32) -> f64, total: f64) -> u32 {
    let (mut lo, mut hi) = (range.0 + 1, range.1 - 1);
    while lo < hi {
        let m = lo + (hi - lo) / 2;
        if below(m) < 0.5 * total { lo = m + 1 } else { hi = m }
    }
    // The first cut past the half, or the one before it, whichever is nearer.
    if lo > range.0 + 1 && (0.5 * total - below(lo - 1)) < (below(lo) - 0.5 * total) { lo - 1 } else { lo }
}

fn direction(map: &Map, columns: &[[f64; 3]], cell: &Cell) -> Option<Directional> {
    let (w, h) = map.size();
    let mut energy = [0.0; 3];
    let mut centroid = DVec3::ZERO;
    let mut middle = DVec3::ZERO;
    for y in cell.y.0..cell.y.1 {
        let row = RowIntegral::new(y, h);
        let solid_angle = row.solid_angle(w);
        for x in cell.x.0..cell.x.1 {
            let texel = map.texel(x, y);
            let vector = row.vector(columns[x as usize]);
            centroid += vector * f64::from(texel.luminance());
            middle += vector;
            for (e, l) in energy.iter_mut().zip(texel.to_array()) {
                *e += f64::from(l) * solid_angle;
            }
        }
    }
    let intensity = Spectrum::from(energy.map(|e| (e / PI) as f32));
    // A cell around the whole sphere may have no centroid; any direction serves.
    let to_light = centroid.try_normalize().or(middle.try_normalize()).unwrap_or(DVec3::Y);
    (!intensity.is_black()).then_some(Directional { to_light, intensity })
}
