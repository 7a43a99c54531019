//! The z-buffer of a tile, which remembers what is seen: an item buffer.

use super::scan::{Plane, Tile, Triangle};
use super::{SUBPIXELS, TILE};
use crate::math::CpuPath;

/// No item.
pub const NOTHING: u32 = u32::MAX;

/// The nearest item at every sample of a tile.
#[derive(Clone, Debug)]
pub struct ItemBuffer {
    depth: Box<Plane<f32>>,
    items: Box<Plane<u32>>,
}

impl Default for ItemBuffer {
    fn default() -> Self {
        let size = (TILE * TILE) as usize;
        let depth = vec![f32::NEG_INFINITY; size].into_boxed_slice().try_into();
        let items = vec![NOTHING; size].into_boxed_slice().try_into();
        Self { depth: depth.expect("it has this size"), items: items.expect("it has this size") }
    }
}

impl ItemBuffer {
    /// Nothing is seen anywhere.
    pub fn clear(&mut self) {
        self.depth.fill(f32::NEG_INFINITY);
        self.items.fill(NOTHING);
    }

    /// Draws a triangle as `item` where it is nearer than what is there.
    pub fn draw(&mut self, path: CpuPath, triangle: &Triangle, tile: &Tile, item: u32) {
        triangle.draw(path, tile, item, &mut self.depth, &mut self.items);
    }

    /// Sets one sample when it is nearer: for faces that decide themselves where they are.
    pub fn set(&mut self, index: u16, depth: f32, item: u32) {
        let i = usize::from(index);
        if depth > self.depth[i] {
            (self.depth[i], self.items[i]) = (depth, item);
        }
    }

    /// Depths, row by row; greater is nearer, minus infinity where nothing is.
    pub fn depth(&self) -> &Plane<f32> {
        &self.depth
    }

    /// Items, row by row; [`NOTHING`] where nothing is.
    pub fn items(&self) -> &Plane<u32> {
        &self.items
    }
}

impl Tile {
    /// The tile whose first pixel is `(x, y)` of a picture of `width × height`, for the sample `offset` (pixels, rounded to the grid) from pixel centres.
    pub fn of_picture(x: u32, y: u32, width: u32, height: u32, offset: [f32; 2]) -> Self {
        let place = |pixel: u32, size: u32, offset: f32| {
            let steps =
                i64::from(SUBPIXELS) * i64::from(pixel) + i64::from(SUBPIXELS / 2) - i64::from(SUBPIXELS / 2) * i64::from(size);
            steps as i32 + (offset * SUBPIXELS as f32).round_ties_even() as i32
        };
        Self { first: [place(x, width, offset[0]), place(y, height, offset[1])] }
    }
}
