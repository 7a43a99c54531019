//! Triangles sorted into tiles.

use rayon::prelude::*;

use super::scan::Triangle;
use super::{TILE, Tile};

/// Items that are set up together: enough to be worth a task, few enough that what they need stays in a cache.
const CHUNK: u32 = 2048;
/// Triangles over more tiles than this are kept in a list that every tile looks through, so that memory is bounded by the number of triangles.
const LARGE: u32 = 64;

/// A band of a picture, in tiles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grid {
    /// Pixels across the picture.
    pub width: u32,
    /// Pixels down the picture.
    pub height: u32,
    /// How far samples may lie from the centres of their pixels, steps of 1/256 pixel.
    pub spread: i32,
    /// The first row of tiles of the band.
    pub first_row: u32,
    /// Its rows of tiles.
    pub n_rows: u32,
}

impl Grid {
    /// Tiles of a band at most: what is kept for each tile must not grow with the picture.
    const MAX_TILES: u32 = 8192;

    /// The bands of a picture, from the top; one for pictures of up to eight million pixels.
    pub fn bands(width: u32, height: u32, spread: i32) -> impl Iterator<Item = Self> {
        let rows = height.div_ceil(TILE);
        let n_rows = (Self::MAX_TILES / width.div_ceil(TILE)).clamp(1, rows);
        (0..rows).step_by(n_rows as usize).map(move |first_row| Self {
            width,
            height,
            spread,
            first_row,
            n_rows: n_rows.min(rows - first_row),
        })
    }

    /// Tiles across.
    pub fn columns(&self) -> u32 {
        self.width.div_ceil(TILE)
    }

    /// Tiles of the band.
    pub fn n_tiles(&self) -> usize {
        (self.columns() * self.n_rows) as usize
    }

    /// The first pixel of a tile.
    pub fn corner(&self, tile: usize) -> (u32, u32) {
        let (x, y) = (tile as u32 % self.columns(), tile as u32 / self.columns());
        (x * TILE, (self.first_row + y) * TILE)
    }

    /// The tiles of the band a triangle may touch.
    fn touched(&self, t: &Triangle) -> Option<Tiles> {
        let first = Tile::of_picture(0, 0, self.width, self.height, [0.0; 2]).first;
        let [x0, y0, x1, y1] = t.pixels(first, self.spread)?;
        let top = (self.first_row * TILE) as i32;
        let last_x = self.width as i32 - 1;
        let last_y = (self.height.min((self.first_row + self.n_rows) * TILE)) as i32 - 1;
        if x1 < 0 || y1 < top || x0 > last_x || y0 > last_y {
            return None;
        }
        let column = |x: i32| x.clamp(0, last_x) as u32 / TILE;
        let row = |y: i32| (y.clamp(top, last_y) - top) as u32 / TILE;
        Some(Tiles { x: [column(x0), column(x1)], y: [row(y0), row(y1)] })
    }
}

/// A rectangle of tiles of a band: first and last column and row.
#[derive(Clone, Copy, Debug)]
struct Tiles {
    x: [u32; 2],
    y: [u32; 2],
}

impl Tiles {
    const NONE: Self = Self { x: [u32::MAX, 0], y: [u32::MAX, 0] };

    fn width(&self) -> u32 {
        (self.x[1] + 1).saturating_sub(self.x[0])
    }

    fn n(&self) -> u32 {
        self.width() * (self.y[1] + 1).saturating_sub(self.y[0])
    }

    fn contains(&self, column: u32, row: u32) -> bool {
        (self.x[0]..=self.x[1]).contains(&column) && (self.y[0]..=self.y[1]).contains(&row)
    }

    fn with(self, other: &Self) -> Self {
        Self {
            x: [self.x[0].min(other.x[0]), self.x[1].max(other.x[1])],
            y: [self.y[0].min(other.y[0]), self.y[1].max(other.y[1])],
        }
    }

    /// The place of a tile among those of this rectangle.
    fn index(&self, column: u32, row: u32) -> usize {
        ((row - self.y[0]) * self.width() + column - self.x[0]) as usize
    }
}

/// Triangles by tile, in the order of their items.
#[derive(Debug)]
pub struct Bins {
    chunks: Vec<Chunk>,
}

#[derive(Debug)]
struct Chunk {
    triangles: Vec<Triangle>,
    /// The tiles its small triangles touch.
    tiles: Tiles,
    /// Small triangles of tile `i` of these are `entries[offsets[i]..offsets[i + 1]]`, ascending.
    offsets: Vec<u32>,
    entries: Vec<u32>,
    /// Those over many tiles.
    large: Vec<(u32, Tiles)>,
}

impl Bins {
    /// Sorts what `set_up` makes of a range of items (in their order) into the tiles of a picture. In parallel; the result depends on nothing but the items.
    pub fn build(grid: &Grid, n_items: u32, set_up: impl Fn(std::ops::Range<u32>, &mut Vec<Triangle>) + Sync) -> Self {
        let chunks = (0..n_items.div_ceil(CHUNK))
            .into_par_iter()
            .map(|i| {
                let mut triangles = Vec::new();
                set_up(i * CHUNK..n_items.min((i + 1).saturating_mul(CHUNK)), &mut triangles);
                Chunk::new(grid, triangles)
            })
            .collect::<Vec<_>>();
        Self { chunks: chunks.into_iter().filter(|c| !c.triangles.is_empty()).collect() }
    }

    /// The triangles that may touch a tile, in the order of their items.
    pub fn of_tile(&self, grid: &Grid, tile: usize) -> Vec<&Triangle> {
        let (column, row) = (tile as u32 % grid.columns(), tile as u32 / grid.columns());
        let mut all = Vec::new();
        self.chunks.iter().for_each(|chunk| chunk.of_tile(column, row, &mut all));
        all
    }

    /// Triangles that were not dropped.
    pub fn n_triangles(&self) -> usize {
        self.chunks.iter().map(|c| c.triangles.len()).sum()
    }
}

impl Chunk {
    fn new(grid: &Grid, mut triangles: Vec<Triangle>) -> Self {
        let mut touched = Vec::with_capacity(triangles.len());
        triangles.retain(|t| match grid.touched(t) {
            Some(tiles) => {
                touched.push(tiles);
                true
            }
            None => false,
        });
        triangles.shrink_to_fit();
        let (mut tiles, mut large) = (Tiles::NONE, Vec::new());
        for (i, t) in touched.iter().enumerate() {
            if t.n() > LARGE {
                large.push((i as u32, *t));
            } else {
                tiles = tiles.with(t);
            }
        }
        // Counting sort: how many in each tile, where each tile's begin, then one after the other.
        let small = || touched.iter().enumerate().filter(|(_, t)| t.n() <= LARGE);
        let each = |t: &Tiles, f: &mut dyn FnMut(usize)| {
            (t.y[0]..=t.y[1]).for_each(|y| (t.x[0]..=t.x[1]).for_each(|x| f(tiles.index(x, y))))
        };
        let mut offsets = vec![0; tiles.n() as usize + 2];
        small().for_each(|(_, t)| each(t, &mut |tile| offsets[tile + 2] += 1));
        for i in 2..offsets.len() {
            offsets[i] += offsets[i - 1];
        }
        // Two ahead, so that the same array counts up to where each tile's end.
        let mut entries = vec![0; offsets[offsets.len() - 1] as usize];
        for (i, t) in small() {
            each(t, &mut |tile| {
                entries[offsets[tile + 1] as usize] = i as u32;
                offsets[tile + 1] += 1;
            });
        }
        Self { triangles, tiles, offsets, entries, large }
    }

    fn of_tile<'a>(&'a self, column: u32, row: u32, all: &mut Vec<&'a Triangle>) {
        let mut small = if self.tiles.contains(column, row) {
            let tile = self.tiles.index(column, row);
            &self.entries[self.offsets[tile] as usize..self.offsets[tile + 1] as usize]
        } else {
            &[]
        };
        // Two ascending lists, merged.
        for (large, _) in self.large.iter().filter(|(_, tiles)| tiles.contains(column, row)) {
            let (before, after) = small.split_at(small.partition_point(|s| s < large));
            all.extend(before.iter().chain([large]).map(|i| &self.triangles[*i as usize]));
            small = after;
        }
        all.extend(small.iter().map(|i| &self.triangles[*i as usize]));
    }
}
