//! One triangle on the grid.
//!
//! With vertices on whole grid points, the edge function of the edge from `v_i` to `v_j` is `E(p) = a p_x + b p_y + c`, `a = y_i − y_j`, `b = x_j − x_i`: twice the
//! area of `(v_i, v_j, p)` [Pineda88]. A sample is covered when all three are above zero, or zero on an edge that is a top or left one. Stepping
//! a pixel changes E by 256 a, so `⌊E/256⌋` changes by `a` exactly and has the same sign: within a tile 32 bits suffice.

use super::{Homogeneous, SUBPIXELS, TILE};
use crate::math::lanes::{Cpu, Ints, Lanes, for_each_cpu};

/// A triangle ready to be scanned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle {
    a: [i32; 3],
    b: [i32; 3],
    /// The rest of the edge function; less one where the edge is neither a top nor a left one.
    c: [i64; 3],
    /// Least x and y, greatest x and y, steps of the grid.
    bounds: [i32; 4],
    /// Depth over the picture as `[a, b, c]` of `a x + b y + c`, pixels from the middle.
    pub plane: [f64; 3],
    /// Bounds of the depth: where rounding lets a sample fall just outside of the face, its plane may be anywhere.
    pub depth_range: [f32; 2],
    /// The face it is a part of.
    pub face: u32,
    /// The vertices came counter-clockwise as seen in the picture.
    pub is_counter_clockwise: bool,
    /// A word of the caller's.
    pub kind: u8,
}

/// A place on the grid, steps from the middle of the picture.
pub type Place = [i32; 2];

/// Where a vertex that is inside the guard band falls on the grid.
pub fn snap(v: &Homogeneous) -> Place {
    let scale = f64::from(SUBPIXELS) / v.w;
    [(v.x * scale).round_ties_even() as i32, (v.y * scale).round_ties_even() as i32]
}

impl Triangle {
    /// From vertices in either order; `None` when it has no area on the grid.
    pub fn new(v: [Place; 3], face: u32) -> Option<Self> {
        let wide = v.map(|p| p.map(i64::from));
        let area = (wide[1][0] - wide[0][0]) * (wide[2][1] - wide[0][1]) - (wide[1][1] - wide[0][1]) * (wide[2][0] - wide[0][0]);
        if area == 0 {
            return None;
        }
        // With y down, a positive area runs clockwise.
        let v = if area > 0 { v } else { [v[0], v[2], v[1]] };
        let (mut a, mut b, mut c) = ([0; 3], [0; 3], [0; 3]);
        for i in 0..3 {
            let (from, to) = (v[i], v[(i + 1) % 3]);
            (a[i], b[i]) = (from[1] - to[1], to[0] - from[0]);
            let is_top_or_left = a[i] > 0 || (a[i] == 0 && b[i] > 0);
            c[i] = -(i64::from(a[i]) * i64::from(from[0]) + i64::from(b[i]) * i64::from(from[1])) - i64::from(!is_top_or_left);
        }
        let least = |k: usize| v[0][k].min(v[1][k]).min(v[2][k]);
        let greatest = |k: usize| v[0][k].max(v[1][k]).max(v[2][k]);
        Some(Self {
            a,
            b,
            c,
            bounds: [least(0), least(1), greatest(0), greatest(1)],
            plane: [0.0; 3],
            depth_range: [f32::NEG_INFINITY, f32::INFINITY],
            face,
            is_counter_clockwise: area < 0,
            kind: 0,
        })
    }

    /// The pixels whose samples may be covered, as least x and y and greatest x and y, not limited to the picture; `None` when there are none. `first` is
    /// where the sample of pixel (0, 0) lies; all offsets of samples from it are within `spread` steps.
    pub fn pixels(&self, first: Place, spread: i32) -> Option<[i32; 4]> {
        let low =
            |v: i32, o: i32| (v - o - spread).div_euclid(SUBPIXELS) + i32::from((v - o - spread).rem_euclid(SUBPIXELS) != 0);
        let high = |v: i32, o: i32| (v - o + spread).div_euclid(SUBPIXELS);
        let range = [
            low(self.bounds[0], first[0]),
            low(self.bounds[1], first[1]),
            high(self.bounds[2], first[0]),
            high(self.bounds[3], first[1]),
        ];
        (range[0] <= range[2] && range[1] <= range[3]).then_some(range)
    }

    /// Writes its depth and `item` wherever the triangle is nearer than what the planes hold.
    pub fn draw(&self, path: crate::math::CpuPath, tile: &Tile, item: u32, depth: &mut Plane<f32>, items: &mut Plane<u32>) {
        draw(path, self, tile, item, depth, items);
    }

    /// Adds every sample covered, row by row, with its depth.
    pub fn samples(&self, path: crate::math::CpuPath, tile: &Tile, out: &mut Vec<Sample>) {
        samples(path, self, tile, out);
    }
}

/// A value for each sample of a tile, row by row.
pub type Plane<T> = [T; (TILE * TILE) as usize];

/// One sample of each pixel of a square of the grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tile {
    /// Where the sample of its first pixel lies, steps from the middle of the picture.
    pub first: Place,
}

/// A sample that a triangle covers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Row times [`TILE`] plus column, within the tile.
    pub index: u16,
    /// Depth there.
    pub depth: f32,
}

/// A triangle in a tile: edge functions at the first sample and their steps, and the rows and columns it may cover.
struct InTile {
    e: [i32; 3],
    a: [i32; 3],
    b: [i32; 3],
    rows: [u32; 2],
    columns: [u32; 2],
    /// Depth at the first sample and its steps.
    depth: [f32; 3],
}

impl InTile {
    #[inline(always)]
    fn new(t: &Triangle, tile: &Tile) -> Option<Self> {
        const LAST: i32 = TILE as i32 - 1;
        let [x0, y0, x1, y1] = t.pixels(tile.first, 0)?;
        let (columns, rows) = ([x0.max(0), x1.min(LAST)], [y0.max(0), y1.min(LAST)]);
        if columns[0] > columns[1] || rows[0] > rows[1] {
            return None;
        }
        let (mut e, mut a, mut b) = ([0; 3], [0; 3], [0; 3]);
        for i in 0..3 {
            let (wide_a, wide_b) = (i64::from(t.a[i]), i64::from(t.b[i]));
            let here = (wide_a * i64::from(tile.first[0]) + wide_b * i64::from(tile.first[1]) + t.c[i]) >> 8;
            let (across, down) = (wide_a * i64::from(LAST), wide_b * i64::from(LAST));
            if here + across.max(0) + down.max(0) < 0 {
                return None;
            }
            // An edge with the whole tile inside needs no test, and its value may be beyond 32 bits.
            if here + across.min(0) + down.min(0) < 0 {
                (e[i], a[i], b[i]) = (here as i32, t.a[i], t.b[i]);
            }
        }
        let pixel = 1.0 / f64::from(SUBPIXELS);
        let [da, db, dc] = t.plane;
        let depth = da * f64::from(tile.first[0]) * pixel + db * f64::from(tile.first[1]) * pixel + dc;
        Some(Self {
            e,
            a,
            b,
            rows: [rows[0] as u32, rows[1] as u32],
            columns: [columns[0] as u32, columns[1] as u32],
            depth: [da as f32, db as f32, depth as f32],
        })
    }
}

/// Calls `$body` with the row-major index of eight neighbouring samples, the mask of those covered, and their depths.
macro_rules! for_each_eight {
    ($C:ident, $t:expr, $tile:expr, |$index:ident, $covered:ident, $depth:ident| $body:block) => {
        let Some(inside) = InTile::new($t, $tile) else { return };
        type L<C> = <C as Cpu>::Wide;
        type I<C> = <L<C> as Lanes>::Int;
        let lane: [i32; 8] = [0, 1, 2, 3, 4, 5, 6, 7];
        let first_group = inside.columns[0] / 8;
        let last_group = inside.columns[1] / 8;
        let ramp = |k: usize| {
            let a = inside.a[k];
            let mut ramp = [0; 8];
            for (r, l) in ramp.iter_mut().zip(lane) {
                *r = a * (l + 8 * first_group as i32);
            }
            I::<$C>::load(&ramp)
        };
        let ramps = [ramp(0), ramp(1), ramp(2)];
        let steps = [I::<$C>::splat(inside.a[0] * 8), I::<$C>::splat(inside.a[1] * 8), I::<$C>::splat(inside.a[2] * 8)];
        let [dx, dy, d0] = inside.depth;
        let mut ramp = [0.0; 8];
        for (r, l) in ramp.iter_mut().zip(lane) {
            *r = dx * (l + 8 * first_group as i32) as f32;
        }
        let depth_ramp = L::<$C>::load(&ramp);
        let depth_step = L::<$C>::splat(dx * 8.0);
        let (least, greatest) = (L::<$C>::splat($t.depth_range[0]), L::<$C>::splat($t.depth_range[1]));
        for row in inside.rows[0]..=inside.rows[1] {
            let start = |k: usize| ramps[k].add(I::<$C>::splat(inside.e[k] + inside.b[k] * row as i32));
            let mut e = [start(0), start(1), start(2)];
            let mut d = depth_ramp.add(L::<$C>::splat(d0 + dy * row as f32));
            for group in first_group..=last_group {
                let $covered = e[0].or(e[1]).or(e[2]).is_non_negative();
                if L::<$C>::bits($covered) != 0 {
                    let $index = (row * TILE + group * 8) as usize;
                    let $depth = d.max(least).min(greatest);
                    $body
                }
                e = [e[0].add(steps[0]), e[1].add(steps[1]), e[2].add(steps[2])];
                d = d.add(depth_step);
            }
        }
    };
}

for_each_cpu! {
    fn draw(t: &Triangle, tile: &Tile, item: u32, depth: &mut Plane<f32>, items: &mut Plane<u32>) = draw_on;
    fn samples(t: &Triangle, tile: &Tile, out: &mut Vec<Sample>) = samples_on;
}

#[inline(always)]
fn draw_on<C: Cpu>(t: &Triangle, tile: &Tile, item: u32, depth: &mut Plane<f32>, items: &mut Plane<u32>) {
    for_each_eight!(C, t, tile, |index, covered, d| {
        let (Some(depths), Some(items)) = (depth[index..].first_chunk_mut::<8>(), items[index..].first_chunk_mut::<8>()) else {
            return;
        };
        let old = C::Wide::load(depths);
        let nearer = C::Wide::both(covered, old.lt(d));
        *depths = C::Wide::select(nearer, d, old).store();
        let mut bits = C::Wide::bits(nearer);
        if bits == 0xFF {
            items.fill(item);
        } else {
            while bits != 0 {
                items[bits.trailing_zeros() as usize] = item;
                bits &= bits - 1;
            }
        }
    });
}

#[inline(always)]
fn samples_on<C: Cpu>(t: &Triangle, tile: &Tile, out: &mut Vec<Sample>) {
    for_each_eight!(C, t, tile, |index, covered, d| {
        let depths = d.store();
        let mut bits = C::Wide::bits(covered);
        while bits != 0 {
            let lane = bits.trailing_zeros() as usize;
            bits &= bits - 1;
            out.push(Sample { index: (index + lane) as u16, depth: depths[lane] });
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::CpuPath;

    fn covered(path: CpuPath, v: [Place; 3], first: Place) -> Vec<u16> {
        let mut out = Vec::new();
        if let Some(t) = Triangle::new(v, 0) {
            t.samples(path, &Tile { first }, &mut out);
        }
        out.into_iter().map(|s| s.index).collect()
    }

    #[test]
    fn a_square_of_two_triangles_covers_its_pixels_once_on_both_paths() {
        // From pixel centre (2, 3) to centre (6, 5): the right and bottom sides belong to the neighbours.
        for path in [CpuPath::Portable, CpuPath::detect()] {
            let s = |x: i32, y: i32| [x * 256, y * 256];
            let mut all = covered(path, [s(2, 3), s(6, 3), s(6, 5)], [0, 0]);
            all.extend(covered(path, [s(2, 3), s(2, 5), s(6, 5)], [0, 0]));
            all.sort_unstable();
            let expected: Vec<u16> = (3..5).flat_map(|y| (2..6).map(move |x| y * 32 + x)).collect();
            assert_eq!(all, expected);
        }
    }

    #[test]
    fn the_largest_coordinates_do_not_overflow() {
        let far = 1 << 23;
        for path in [CpuPath::Portable, CpuPath::detect()] {
            let all = covered(path, [[-far, -far], [far, -far], [-far, far]], [-20_000, -20_000]);
            assert_eq!(all.len(), 1024, "the tile lies inside");
            // The diagonal x + y = 0 passes through the tile: it is a right edge, so its samples are out.
            assert_eq!(covered(path, [[-far, -far], [far, -far], [-far, far]], [-256 * 16, -256 * 15]).len(), 31 * 32 / 2);
        }
    }
}
