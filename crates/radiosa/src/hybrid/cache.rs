//! Irradiances at places, interpolated between them with their gradients. Sources: [Ward88], [Ward92].
//!
//! A record made at `x_i` with normal `n_i` is used at `x, n` where its estimated relative error
//!
//! ```text
//! ε = |x − x_i|/R_i + √(1 − n·n_i)
//! ```
//!
//! is below the accuracy `a`, R_i the harmonic mean of the distances its rays went; with weight `(1 − ε/a)²` instead of the papers' `1/ε`, so that it fades
//! out where it ends, and
//! value `E_i + (n_i × n)·∇_r + (x − x_i)·∇_t`.

use super::gather::Gathered;
use crate::math::{Bounds, Vec3};
use crate::spectrum::Spectrum;

/// An irradiance that holds around a place.
#[derive(Clone, Copy, Debug)]
struct Record {
    p: Vec3,
    n: Vec3,
    /// `R_i`.
    radius: f32,
    gathered: Gathered,
}

/// A cube of the octree.
#[derive(Clone, Debug, Default)]
struct Node {
    /// The first of eight; 0 where there are none.
    children: u32,
    records: Vec<u32>,
}

/// Records in an octree: each stands in the cubes about as large as it reaches.
#[derive(Clone, Debug)]
pub struct Cache {
    records: Vec<Record>,
    nodes: Vec<Node>,
    middle: Vec3,
    half: f32,
    accuracy: f32,
}

/// Halvings of the whole at most.
const DEPTH: u32 = 16;
/// A radius is so much of the way on which the gradient would change the light by its whole, at most: what is steep bends, too.
const STEEP: f32 = 0.3;
/// How far below the tangent plane of a record it still counts, by its radius: what lies there may see less.
const BELOW: f32 = 0.02;

impl Cache {
    /// Empty, for what lies in `bounds`.
    pub fn new(bounds: Bounds, accuracy: f32) -> Self {
        let half = 0.5 * bounds.extent().max_element();
        let half = if half.is_finite() && half > 0.0 { half * 1.001 } else { 1.0 };
        Self { records: Vec::new(), nodes: vec![Node::default()], middle: bounds.centre(), half, accuracy }
    }

    /// Records.
    pub fn len(&self) -> usize {
        self.records.len()
    }

    /// Nothing is known.
    pub fn is_empty(&self) -> bool {
        self.records.is_empty()
    }

    /// Keeps what was gathered at a place. It reaches at least and at most so far, and not much farther than light varies.
    /// (Zero: where it is not known how wide a pixel is, nothing limits it.)
    pub(super) fn insert(&mut self, p: Vec3, n: Vec3, mut gathered: Gathered, [least, most]: [f32; 2]) {
        let most = if most > 0.0 { most / self.accuracy } else { f32::INFINITY };
        let e = gathered.irradiance.luminance();
        let along = |axis: usize| Spectrum::from(gathered.translation.map(|g| g[axis])).luminance();
        let slope = Vec3::new(along(0), along(1), along(2)).length();
        let steep = if slope > 0.0 { STEEP * e / slope } else { f32::INFINITY };
        let radius = gathered.distance.min(steep).min(most).max(least / self.accuracy).min(2.0 * self.half);
        let whole = steep / STEEP;
        if radius > whole {
            // Over its whole reach it may not change by more than itself.
            gathered.translation = gathered.translation.map(|g| g * (whole / radius));
        }
        let index = self.records.len() as u32;
        self.records.push(Record { p, n, radius, gathered });
        self.place(0, (self.middle, self.half), index, DEPTH);
    }

    fn place(&mut self, node: usize, (middle, half): (Vec3, f32), index: u32, depth: u32) {
        let record = &self.records[index as usize];
        let (p, reach) = (record.p, record.radius * self.accuracy * super::STRETCHED);
        if depth == 0 || half < 2.0 * reach {
            self.nodes[node].records.push(index);
            return;
        }
        if self.nodes[node].children == 0 {
            self.nodes[node].children = self.nodes.len() as u32;
            self.nodes.resize(self.nodes.len() + 8, Node::default());
        }
        let first = self.nodes[node].children as usize;
        for child in 0..8 {
            let at = child_of((middle, half), child);
            if (p - at.0).abs().max_element() <= at.1 + reach {
                self.place(first + child, at, index, depth - 1);
            }
        }
    }

    /// How noisy gathers are around a place: the mean error of those whose records reach there, each `stretched` as far as it does by itself, as if they had one ray.
    pub(super) fn noise(&self, p: Vec3, n: Vec3, stretched: f32) -> Option<f32> {
        let (mut sum, mut count) = (0.0, 0.0);
        self.each(p, n, stretched, |record, _| {
            sum += record.gathered.error_of_one();
            count += 1.0;
        });
        (count > 0.0).then(|| sum / count)
    }

    /// Interpolated where some record reaches, each `stretched` as far as it does by itself.
    pub fn irradiance(&self, p: Vec3, n: Vec3, stretched: f32) -> Option<Spectrum> {
        let (mut sum, mut weights) = (Spectrum::BLACK, 0.0);
        self.each(p, n, stretched, |record, weight| {
            sum += record.gathered.at(p - record.p, record.n.cross(n)) * weight;
            weights += weight;
        });
        (weights > 1e-6).then(|| sum * (1.0 / weights))
    }

    /// The records that reach a place, each `stretched` as far as it does by itself, with their weights.
    #[inline(always)]
    fn each(&self, p: Vec3, n: Vec3, stretched: f32, mut take: impl FnMut(&Record, f32)) {
        let accuracy = self.accuracy * stretched;
        let (mut node, mut cube) = (0, (self.middle, self.half));
        loop {
            for &index in &self.nodes[node].records {
                let record = &self.records[index as usize];
                let from = p - record.p;
                let reach = record.radius * accuracy;
                let d2 = from.length_squared();
                if d2 >= reach * reach {
                    continue;
                }
                let error = d2.sqrt() / record.radius + (1.0 - n.dot(record.n)).max(0.0).sqrt();
                if error >= accuracy || from.dot(n + record.n) < -2.0 * BELOW * record.radius {
                    continue;
                }
                take(record, (1.0 - error / accuracy).powi(2));
            }
            let first = self.nodes[node].children;
            if first == 0 {
                break;
            }
            let child = p.cmpge(cube.0).bitmask() as usize;
            cube = child_of(cube, child);
            node = first as usize + child;
        }
    }
}

fn child_of((middle, half): (Vec3, f32), child: usize) -> (Vec3, f32) {
    let half = 0.5 * half;
    let side = |axis: usize| if child >> axis & 1 == 1 { half } else { -half };
    (middle + Vec3::new(side(0), side(1), side(2)), half)
}
