//! The cells of a patch: how many, which one a point is in, and their corners.

use crate::math::DVec3;
use crate::math::polygon::area_vector;
use crate::radiosity::patch::Patch;

/// Cells along one edge of a patch at most.
pub const MAX_CELLS: u32 = 1024;

/// A convex polygon of three or four corners, counter-clockwise seen from the front; the last repeats the third in a triangle.
pub(in crate::radiosity) type Piece = ([DVec3; 4], usize);

/// A piece of a cell, and how far inside of its edges points are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cut {
    pub(super) piece: Piece,
    /// Unit, inwards in its plane, and what it is along them.
    edges: [(DVec3, f64); 4],
}

impl Cut {
    pub(super) fn new(piece: Piece) -> Self {
        let (corners, n) = piece;
        let normal = area_vector(&corners[..n]);
        let edge = |k: usize| {
            let inwards = normal.cross(corners[(k + 1) % n] - corners[k]).normalize_or_zero();
            (inwards, inwards.dot(corners[k]))
        };
        // (Of a triangle the last once more.)
        Self { piece, edges: [0, 1, 2, n - 1].map(edge) }
    }

    /// How far a point is inside; less than zero outside.
    fn depth(&self, p: DVec3) -> f64 {
        self.edges.iter().map(|(inwards, at)| inwards.dot(p) - at).fold(f64::INFINITY, f64::min)
    }
}

/// Which of the pieces of a cell a point lies in; the nearest, about, where it is in none.
pub(super) fn piece_at(cuts: &[Cut], p: DVec3) -> usize {
    let mut best = (f64::NEG_INFINITY, 0);
    if cuts.len() > 1 {
        for (k, cut) in cuts.iter().enumerate() {
            let depth = cut.depth(p);
            if depth > best.0 {
                best = (depth, k);
            }
        }
    }
    best.1
}

/// Cells along the edges for elements no longer than `size`.
pub(super) fn cells(patch: &Patch, size: f64) -> [u32; 2] {
    lengths(patch).map(|length| limited(length, size))
}

/// The same without a limit.
pub(super) fn wanted(patch: &Patch, size: f64) -> [u32; 2] {
    lengths(patch).map(|length| along(length, size))
}

/// Elements no longer than `size` along a length.
fn along(length: f64, size: f64) -> u32 {
    (length / size - 1e-6).ceil().max(1.0) as u32
}

/// The same, with a limit.
fn limited(length: f64, size: f64) -> u32 {
    along(length, size).min(MAX_CELLS)
}

/// How long a patch is along its two edges, where it is divided.
fn lengths(patch: &Patch) -> [f64; 2] {
    let c = patch.corners();
    let edge = |i: usize| (c[(i + 1) % c.len()] - c[i]).length();
    if patch.is_quad() {
        [edge(0).max(edge(2)), edge(1).max(edge(3))]
    } else {
        // As large as a square of that edge, about: two triangles to a cell.
        [(2.0 * patch.area()).sqrt().max(0.5 * edge(0).max(edge(1)).max(edge(2))); 2]
    }
}

/// The longest edge with which there are about `wanted` elements beyond one for each kept side.
pub(super) fn size_for(patches: &[Patch], kept: &[[bool; 2]], wanted: u32) -> f64 {
    let n_sides = |k: &[bool; 2]| u64::from(k[0]) + u64::from(k[1]);
    let sides: u64 = kept.iter().map(n_sides).sum();
    let target = sides + u64::from(wanted);
    let area: f64 = patches.iter().zip(kept).map(|(p, k)| p.area() * n_sides(k) as f64).sum();
    if area <= 0.0 || wanted == 0 {
        return f64::INFINITY;
    }
    let long: Vec<([f64; 2], u64)> = patches.iter().zip(kept).map(|(p, k)| (lengths(p), n_sides(k))).collect();
    let total = |size: f64| -> u64 {
        let count = |lengths: [f64; 2]| lengths.map(|length| u64::from(limited(length, size))).iter().product::<u64>();
        long.iter().map(|&(lengths, n)| count(lengths) * n).sum()
    };
    // Halving the logarithm: the count falls with the size.
    let (mut low, mut high) = ((area / target as f64).sqrt() * 0.25, area.sqrt().max(1e-300) * 8.0);
    for _ in 0..40 {
        let middle = (low * high).sqrt();
        if total(middle) > target {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

/// The corners of a cell of the grid, or of the one of every `step`-th line, as seen from the front.
pub(in crate::radiosity) fn corners_of_cell(patch: &Patch, n: [u32; 2], step: u32, cell: u32) -> Piece {
    let line = |i: u32, n: u32| f64::from((i * step).min(n)) / f64::from(n);
    cell_corners(patch.is_quad(), n.map(|n| n.div_ceil(step)), cell, |i, j| patch.at([line(i, n[0]), line(j, n[1])]))
}

/// The corners of a cell of an `n[0] × n[1]` grid: a square; in a triangle every other one is turned around.
pub(super) fn cell_corners(is_quad: bool, n: [u32; 2], cell: u32, corner: impl Fn(u32, u32) -> DVec3) -> Piece {
    if is_quad {
        let (i, j) = (cell % n[0], cell / n[0]);
        return ([corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)], 4);
    }
    let (i, j, upper) = triangle_cell(n[0], cell);
    let c = if upper {
        [corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)]
    } else {
        [corner(i, j), corner(i + 1, j), corner(i, j + 1)]
    };
    ([c[0], c[1], c[2], c[2]], 3)
}

/// The row `j`, the column `i` and the kind of a cell of a triangle with `n` cells along each edge. Row `j` has `2 (n − j) − 1` cells.
pub(in crate::radiosity) fn triangle_cell(n: u32, cell: u32) -> (u32, u32, bool) {
    // Rows before row j hold j (2 n − j) cells.
    let mut j = n - f64::from(n * n - cell).sqrt().ceil() as u32;
    while (j + 1) * (2 * n - j - 1) <= cell {
        j += 1;
    }
    while j * (2 * n - j) > cell {
        j -= 1;
    }
    let k = cell - j * (2 * n - j);
    (k / 2, j, k % 2 == 1)
}

/// The cell that parameters fall into, and the parameters within it.
pub(in crate::radiosity) fn cell_at(is_quad: bool, n: [u32; 2], [s, t]: [f64; 2]) -> (u32, [f64; 2]) {
    let (x, y) = (s * f64::from(n[0]), t * f64::from(n[1]));
    let (i, j) = ((x as u32).min(n[0] - 1), (y as u32).min(n[1] - 1));
    if is_quad {
        return (j * n[0] + i, [x - f64::from(i), y - f64::from(j)]);
    }
    let n = n[0];
    let i = i.min(n - 1 - j);
    let (fx, fy) = (x - f64::from(i), y - f64::from(j));
    let upper = fx + fy > 1.0 && i + j + 1 < n;
    // The one turned around starts at its corner (1, 0), with edges to (1, 1) and (0, 1).
    let [a, b] = if upper { [fx + fy - 1.0, 1.0 - fx] } else { [fx, fy] };
    let over = (a.max(0.0) + b.max(0.0)).max(1.0);
    (j * (2 * n - j) + 2 * i + u32::from(upper), [a, b].map(|v| v.max(0.0) / over))
}

/// Parameters of a cell, for its corners in reverse order.
pub(super) fn reversed(is_quad: bool, [s, t]: [f64; 2]) -> [f64; 2] {
    // a b c d becomes d c b a, and a b c becomes c b a.
    if is_quad { [s, 1.0 - t] } else { [s, (1.0 - s - t).max(0.0)] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cells_of_a_triangle_are_numbered_row_by_row() {
        for n in [1, 2, 3, 7, 64, 1024] {
            let mut cell = 0;
            for j in 0..n {
                for i in 0..n - j {
                    assert_eq!(triangle_cell(n, cell), (i, j, false));
                    cell += 1;
                    if i + 1 < n - j {
                        assert_eq!(triangle_cell(n, cell), (i, j, true));
                        cell += 1;
                    }
                }
            }
            assert_eq!(cell, n * n);
        }
    }
}
