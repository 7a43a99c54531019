//! How large the error of a picture is, and where samples would bring it down most.
//!
//! Samples of a pixel are evenly spread together ([`sequence`](crate::sampling::sequence)), so that the variance of their mean is less than that of independent ones,
//! `s²/n`, and the spread of the samples does not tell it. What tells it is that a scrambled sequence [Owen97] consists of halves, quarters, eighths, … that are
//! all alike: with A and B the means of the halves of 2n samples,
//!
//! ```text
//! V(2n) = Var((A + B)/2) = V(n) − D(n)      D(n) = E (A − B)²/4
//! ```
//!
//! since V(n) is the variance of A and of B, however they depend on each other. As V tends to zero, `V(n) = D(n) + D(2n) + D(4n) + …`, of which all but those to come
//! can be measured. They fall to a half from one to the next where light is rough, to an eighth where it is smooth. How they fell last, `q = D(n/2)/D(n)`, tells how
//! much of each there is:
//!
//! ```text
//! D(n) = R + S      D(n/2) = 2 R + 8 S      R/(R + S) = (8 − q)/6
//! V(2n) ≈ D(2n) + D(4n) + … = R (½ + ¼ + …) + S (1/8 + 1/64 + …) = R + S/7
//! ```
//!
//! Each D is the mean of many pixels, and q is one for the picture.

use super::block::{Block, SIDE};

/// Part of the mean error that every block is taken to have at least: what is rare may not have been seen yet.
const UNSEEN: f64 = 0.02;
/// Parts of the work so far that a batch of samples adds.
const BATCH: f64 = 0.125;

/// The error of a picture.
pub(super) struct Error {
    /// `R/(R + S)`: the part of differences that falls as if samples were independent.
    rough: f64,
}

impl Error {
    /// Of blocks that were measured.
    pub(super) fn of(blocks: &[Block]) -> Self {
        // A mean of parts, weighed by the root: few very bright samples must not decide alone, nor blocks that got more samples because they seemed to be noisy.
        let (mut now, mut before) = (0.0, 0.0);
        for [d, last] in blocks.iter().map(|b| b.error.change) {
            if last > 0.0 {
                let weight = (d + last).sqrt();
                now += weight * d / (d + last);
                before += weight * last / (d + last);
            }
        }
        let rough = if now > 0.0 && before > 0.0 { (8.0 - before / now) / 6.0 } else { 1.0 };
        Self { rough: rough.clamp(0.0, 1.0) }
    }

    /// `Σ Var/(L² + ε)` of a block, had it `factor` times the samples it was measured with.
    fn with(&self, block: &Block, factor: f64) -> f64 {
        block.error.change[0] * (self.rough / factor + (1.0 - self.rough) / 7.0 / factor.powi(3))
    }

    fn measured(&self, block: &Block) -> f64 {
        self.with(block, 1.0)
    }

    /// The same with the samples it has.
    fn now(&self, block: &Block) -> f64 {
        self.with(block, f64::from(block.n) / f64::from(block.error.n.max(1)))
    }

    /// `Σ Var/(L² + ε)` over all pixels and channels; `None` before two samples.
    pub(super) fn sum(&self, blocks: &[Block]) -> Option<f64> {
        let is_known = blocks.iter().all(|b| b.error.n > 0);
        is_known.then(|| blocks.iter().map(|b| self.now(b)).sum::<f64>())
    }

    /// For each block what its variance is of that of independent samples, from it and its neighbours.
    pub(super) fn factors(&self, blocks: &[Block], width: u32) -> Vec<f64> {
        let of = |block: &Block| [self.measured(block), block.error.independent];
        smoothed(&blocks.iter().map(of).collect::<Vec<_>>(), width)
            .into_iter()
            .map(|[variance, independent]| if independent > 0.0 { variance / independent } else { 1.0 })
            .collect()
    }

    /// Asks for twice the samples of the blocks where they bring the most; false where no block may have more than `most`.
    pub(super) fn ask(&self, blocks: &mut [Block], width: u32, most: u32) -> bool {
        // The variance of one sample, a pixel, and what it costs: a ray each, and something for the sample itself.
        let of_pixel = |b: &Block| [self.measured(b) * f64::from(b.n) / f64::from(b.n_pixels()), 0.0];
        let own: Vec<[f64; 2]> = blocks.iter().map(of_pixel).collect();
        let mean = own.iter().map(|v| v[0]).sum::<f64>() / own.len() as f64;
        let around = smoothed(&own, width);
        let cost = |b: &Block| b.n_rays as f64 + f64::from(b.n * b.n_pixels());
        let gain = |i: usize| {
            let b = &blocks[i];
            let variance = 0.5 * (own[i][0] + around[i][0]) + UNSEEN * mean;
            variance * f64::from(b.n_pixels()) / (f64::from(b.n) * cost(b))
        };
        let mut order: Vec<(f64, usize)> = (0..blocks.len()).filter(|&i| blocks[i].n <= most / 2).map(|i| (gain(i), i)).collect();
        order.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut left = BATCH * blocks.iter().map(cost).sum::<f64>();
        for (_, i) in &order {
            if left <= 0.0 {
                break;
            }
            left -= cost(&blocks[*i]);
            blocks[*i].target = 2 * blocks[*i].n;
        }
        !order.is_empty()
    }
}

/// Means over squares of three by three blocks, as far as they lie in the picture of `width` pixels.
fn smoothed(values: &[[f64; 2]], width: u32) -> Vec<[f64; 2]> {
    let across = width.div_ceil(SIDE) as usize;
    let down = values.len() / across.max(1);
    let around = |i: usize, end: usize| i.saturating_sub(1)..(i + 2).min(end);
    let at = |k: usize| {
        let cells = around(k / across, down).flat_map(|j| around(k % across, across).map(move |i| j * across + i));
        let (mut sum, mut n) = ([0.0; 2], 0.0);
        for cell in cells {
            sum = [sum[0] + values[cell][0], sum[1] + values[cell][1]];
            n += 1.0;
        }
        sum.map(|v| v / n)
    };
    (0..values.len()).map(at).collect()
}
