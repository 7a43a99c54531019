//! The picture that paths from the light make, pass by pass: it is added to the means of camera samples.

use std::io;

use super::block::Block;
use crate::film::{Film, Filter, Layer};
use crate::stream::{In, Out, wrong};
use crate::transport::Splat;

/// Sums of passes.
pub(super) struct LightImage {
    filter: Filter,
    width: u32,
    height: u32,
    /// Passes so far.
    pub(super) n: u32,
    pub(super) n_rays: u64,
    /// Σ of the diffuse lobe and of the others, by channel.
    sums: Vec<[f64; 6]>,
    /// Σ of the squares of both together.
    squares: Vec<[f64; 3]>,
}

impl LightImage {
    /// What a pixel takes, bytes: its sums, and those of a pass.
    pub(super) const BYTES_A_PIXEL: u64 = 8 * (6 + 3) + 4 * 6;

    pub(super) fn new(film: &Film, filter: Filter) -> Self {
        let n = film.n_pixels();
        let (width, height) = (film.width(), film.height());
        Self { filter, width, height, n: 0, n_rays: 0, sums: vec![[0.0; 6]; n], squares: vec![[0.0; 3]; n] }
    }

    /// Adds a pass: every splat to the pixels whose filter reaches it.
    pub(super) fn add(&mut self, splats: &[Splat]) {
        let mut pass = vec![[0.0f32; 6]; self.sums.len()];
        let radius = self.filter.radius();
        for splat in splats {
            let [x, y] = splat.place;
            let light = [splat.diffuse.to_array(), splat.specular.to_array()].concat();
            let reached = |v: f32, end: u32| {
                let [first, last] = [v - radius - 0.5, v + radius - 0.5].map(|v| (v.floor() + 1.0).clamp(0.0, end as f32) as u32);
                first..last
            };
            let weight = |v: f32, pixel: u32| self.filter.weight(v - pixel as f32 - 0.5);
            for j in reached(y, self.height) {
                for i in reached(x, self.width) {
                    let weight = weight(x, i) * weight(y, j);
                    let sum = &mut pass[(j * self.width + i) as usize];
                    sum.iter_mut().zip(&light).for_each(|(sum, v)| *sum += weight * v);
                }
            }
        }
        for ((pass, sum), squares) in pass.iter().zip(&mut self.sums).zip(&mut self.squares) {
            sum.iter_mut().zip(pass).for_each(|(sum, v)| *sum += f64::from(*v));
            for (c, square) in squares.iter_mut().enumerate() {
                *square += f64::from(pass[c] + pass[c + 3]).powi(2);
            }
        }
        self.n += 1;
    }

    /// The mean of the diffuse lobe and of the others.
    fn lobes(&self, [x, y]: [u32; 2]) -> [f64; 6] {
        self.sums[(y * self.width + x) as usize].map(|v| v / f64::from(self.n.max(1)))
    }

    /// The mean of the colour.
    pub(super) fn color(&self, pixel: [u32; 2]) -> [f64; 3] {
        let lobes = self.lobes(pixel);
        std::array::from_fn(|c| lobes[c] + lobes[c + 3])
    }

    /// The variance of that mean, by channel; nothing before two passes.
    pub(super) fn variance(&self, [x, y]: [u32; 2], c: usize) -> f64 {
        if self.n < 2 {
            return 0.0;
        }
        let (at, n) = ((y * self.width + x) as usize, f64::from(self.n));
        let sum = self.sums[at][c] + self.sums[at][c + 3];
        ((self.squares[at][c] - sum * sum / n) / (n * (n - 1.0))).max(0.0)
    }

    /// What it adds to a channel of a layer.
    pub(super) fn value(&self, layer: Layer, c: usize, pixel: [u32; 2]) -> f32 {
        let value = match layer {
            Layer::Color | Layer::Indirect => self.color(pixel)[c],
            Layer::Diffuse => self.lobes(pixel)[c],
            Layer::Specular => self.lobes(pixel)[c + 3],
            Layer::Variance => self.variance(pixel, c),
            _ => 0.0,
        };
        value as f32
    }

    /// `Σ Var/(L² + ε)` over all pixels and channels.
    pub(super) fn error(&self, blocks: &[Block], layout: &super::Layout, epsilon: f64) -> f64 {
        let of = |block: &Block, pixel: [u32; 2]| {
            let (from_eye, from_light) = (block.color(layout, Block::local(pixel)), self.color(pixel));
            (0..3)
                .map(|c| self.variance(pixel, c) / ((from_eye[c] + from_light[c]).powi(2) + epsilon).max(f64::MIN_POSITIVE))
                .sum::<f64>()
        };
        blocks.iter().flat_map(|block| block.pixels().map(move |pixel| of(block, pixel))).sum()
    }

    /// Writes it.
    pub(super) fn store(&self, out: &mut Out) -> io::Result<()> {
        out.number(u64::from(self.n))?;
        out.number(self.n_rays)?;
        out.array(&self.sums)?;
        out.array(&self.squares)
    }

    /// Reads what [`Self::store`] wrote.
    pub(super) fn restore(&mut self, from: &mut In) -> io::Result<()> {
        self.n = u32::try_from(from.number()?).map_err(|_| wrong("it has too many passes from the light"))?;
        self.n_rays = from.number()?;
        self.sums = from.array(self.sums.len())?;
        self.squares = from.array(self.squares.len())?;
        Ok(())
    }
}
