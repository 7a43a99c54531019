//! Irradiances at places, interpolated between them with their gradients. Sources: [Ward88], [Ward92].
//!
//! A record made at `x_i` with normal `n_i` is used at `x, n` where its estimated relative error
//!
//! ```text
//! ε = |x − x_i|/R_i + √(1 − n·n_i)
//! ```
//!
//! is below the accuracy `a`, R_i the harmonic mean of the distances its rays went; with weight `(1 − ε/a)²` instead of the papers' `1/ε`, so that it fades
//! out where it ends. Several are averaged, each carried to `x` by its turning gradient and half by its own moving gradient, half by the mean of all:
//!
//! ```text
//! E = Σ w_i (E_i + (n_i × n)·∇_r,i + ½ (x − x_i)·(∇_i + ∇̄))      ∇̄ = Σ w_i ∇_i, Σ w_i = 1
//! ```
//!
//! By the trapezium rule that is exact for quadratic light where records lie evenly around `x`, while `E_i + (x − x_i)·∇_i` would be off by half its second
//! derivative times the mean square of their distances, and all in the same direction.

use rayon::prelude::*;

use super::gather::{Gathered, Shift};
use crate::math::{Bounds, Vec3};
use crate::sampling::rng;
use crate::spectrum::Spectrum;

/// An irradiance that holds around a place.
#[derive(Clone, Copy, Debug)]
struct Record {
    p: Vec3,
    n: Vec3,
    /// `R_i`.
    radius: f32,
    gathered: Gathered,
    /// The part of its translational gradient that counts.
    kept: f32,
    /// Of the numbers it was made by.
    shift: Shift,
}

/// What was gathered at a place, for whatever view.
#[derive(Clone, Copy, Debug)]
pub(super) struct Known {
    pub(super) p: Vec3,
    pub(super) n: Vec3,
    pub(super) gathered: Gathered,
    pub(super) shift: Shift,
}

/// Records, weighted.
#[derive(Default)]
struct Sum {
    weight: f32,
    /// Turned only.
    turned: Spectrum,
    /// What their own gradients add.
    moved: Spectrum,
    gradient: [Vec3; 3],
    /// From their places.
    way: Vec3,
}

impl Sum {
    #[inline(always)]
    fn add(&mut self, record: &Record, way: Vec3, turn: Vec3, weight: f32) {
        let Gathered { irradiance, translation, rotation, .. } = &record.gathered;
        let kept = weight * record.kept;
        self.weight += weight;
        self.turned += (*irradiance + Spectrum::from(rotation.map(|g| g.dot(turn)))) * weight;
        self.moved += Spectrum::from(translation.map(|g| g.dot(way))) * kept;
        self.gradient.iter_mut().zip(translation).for_each(|(sum, g)| *sum += *g * kept);
        self.way += way * weight;
    }

    fn mean(&self) -> Spectrum {
        let one = 1.0 / self.weight;
        let by_all = Spectrum::from(self.gradient.map(|g| g.dot(self.way * one)));
        ((self.turned + (self.moved + by_all) * 0.5) * one).map(|e| e.max(0.0))
    }
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
/// A record is doubted when it differs from the mean of those around it by more than so many times their standard deviation, and by more than this part of it; of fewer
/// than so many others nothing is said.
const ODD: f32 = 4.0;
const TELLS: f32 = 0.1;
const AROUND: u32 = 4;

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
    pub(super) fn insert(&mut self, known: Known, [least, most]: [f32; 2]) {
        let Known { p, n, gathered, shift } = known;
        let most = if most > 0.0 { most / self.accuracy } else { f32::INFINITY };
        let steep = steep(&gathered);
        let radius = gathered.distance.min(STEEP * steep).min(most).max(least / self.accuracy).min(2.0 * self.half);
        let index = self.records.len() as u32;
        self.records.push(Record { p, n, radius, gathered, kept: kept(steep, radius), shift });
        self.place(0, (self.middle, self.half), index, DEPTH);
    }

    /// The records from one on that say something else than all around them, by rising index: few rays that met something bright.
    pub(super) fn doubted(&self, from: usize, stretched: f32) -> Vec<usize> {
        let is_odd = |i: &usize| {
            let record = &self.records[*i];
            let (mut n, mut weights, mut sum, mut squares) = (0, 0.0, 0.0, 0.0);
            self.each(record.p, record.n, stretched, |j, other, weight| {
                if j as usize != *i {
                    let e = other.gathered.irradiance.luminance();
                    (n, weights, sum, squares) = (n + 1, weights + weight, sum + weight * e, squares + weight * e * e);
                }
            });
            let mean = sum / weights;
            let deviation = (squares / weights - mean * mean).max(0.0).sqrt();
            n >= AROUND && (record.gathered.irradiance.luminance() - mean).abs() > (ODD * deviation).max(TELLS * mean)
        };
        (from..self.records.len()).into_par_iter().filter(is_odd).collect()
    }

    /// The normal of a record, and the rays it was gathered by.
    pub(super) fn asked(&self, index: usize) -> (Vec3, u32) {
        let Record { n, gathered, .. } = &self.records[index];
        (*n, gathered.rays)
    }

    /// A record says something else from now on, as far as it did. What it said more or less before those around it take over, so that what is taken for a spot, and is
    /// rare light, is not lost but spread [Rushmeier94].
    pub(super) fn replace(&mut self, index: usize, gathered: Gathered, stretched: f32) {
        let Record { p, n, radius, gathered: before, .. } = self.records[index];
        let mut around = Vec::new();
        self.each(p, n, stretched, |j, _, weight| {
            if j as usize != index {
                around.push((j as usize, weight));
            }
        });
        let weights: f32 = around.iter().map(|(_, weight)| weight).sum();
        let excess = before.irradiance - gathered.irradiance;
        for (j, weight) in around {
            let said = &mut self.records[j].gathered.irradiance;
            *said = (*said + excess * (weight / weights)).map(|e| e.max(0.0));
        }
        self.records[index].kept = kept(steep(&gathered), radius);
        self.records[index].gathered = gathered;
    }

    /// What was gathered for its records, in their order.
    pub(super) fn known(&self) -> Vec<Known> {
        self.records.iter().map(|&Record { p, n, gathered, shift, .. }| Known { p, n, gathered, shift }).collect()
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
        self.each(p, n, stretched, |_, record, _| {
            sum += record.gathered.error_of_one();
            count += 1.0;
        });
        (count > 0.0).then(|| sum / count)
    }

    /// A shift that together with those of the records that reach a place, and of `others`, with weights, is spread as evenly as one of a few random ones can be:
    /// of least wrap-around L₂ discrepancy [Hickernell98].
    pub(super) fn shift(&self, p: Vec3, n: Vec3, stretched: f32, others: impl Iterator<Item = (f32, Shift)>, key: u64) -> Shift {
        const CANDIDATES: usize = 32;
        let shifts: [Shift; CANDIDATES] = std::array::from_fn(|i| {
            let [a, b] = [0, 1].map(|k| rng::nth(key, 2 * i as u64 + k));
            [(a >> 32) as u32, a as u32, (b >> 32) as u32, b as u32]
        });
        let mut costs = [0.0; CANDIDATES];
        let mut count = |weight: f32, other: &Shift| {
            for (cost, shift) in costs.iter_mut().zip(&shifts) {
                *cost += weight * shift.iter().zip(other).map(|(a, b)| closeness(a.wrapping_sub(*b))).product::<f32>();
            }
        };
        self.each(p, n, stretched, |_, record, weight| count(weight, &record.shift));
        others.for_each(|(weight, other)| count(weight, &other));
        let best = (0..CANDIDATES).min_by(|&i, &j| costs[i].total_cmp(&costs[j]));
        shifts[best.unwrap_or(0)]
    }

    /// Interpolated where some record reaches, each `stretched` as far as it does by itself.
    pub fn irradiance(&self, p: Vec3, n: Vec3, stretched: f32) -> Option<Spectrum> {
        let mut sum = Sum::default();
        self.each(p, n, stretched, |_, record, weight| sum.add(record, p - record.p, record.n.cross(n), weight));
        (sum.weight > 1e-6).then(|| sum.mean())
    }

    /// The records that reach a place, each `stretched` as far as it does by itself, with their weights and where they are.
    #[inline(always)]
    fn each(&self, p: Vec3, n: Vec3, stretched: f32, mut take: impl FnMut(u32, &Record, f32)) {
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
                take(index, record, (1.0 - error / accuracy).powi(2));
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

/// The way on which its gradient would change the light by its whole.
fn steep(gathered: &Gathered) -> f32 {
    let along = |axis: usize| Spectrum::from(gathered.translation.map(|g| g[axis])).luminance();
    let slope = Vec3::new(along(0), along(1), along(2)).length();
    if slope > 0.0 { gathered.irradiance.luminance() / slope } else { f32::INFINITY }
}

/// The part of a gradient that counts: over its whole reach a record may not change by more than itself.
fn kept(steep: f32, radius: f32) -> f32 {
    (steep / radius).min(1.0)
}

/// Of two numbers in a ring of 2³².
fn closeness(difference: u32) -> f32 {
    let x = rng::unit_f32(difference);
    1.5 - x * (1.0 - x)
}

fn child_of((middle, half): (Vec3, f32), child: usize) -> (Vec3, f32) {
    let half = 0.5 * half;
    let side = |axis: usize| if child >> axis & 1 == 1 { half } else { -half };
    (middle + Vec3::new(side(0), side(1), side(2)), half)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Records all over a square metre, of light that changes across it with a little noise; the one in the middle `times` as bright.
    fn cache(times: f32) -> Cache {
        let mut cache = Cache::new(Bounds { min: Vec3::ZERO, max: Vec3::ONE }, 0.2);
        for i in 0..121u64 {
            let [x, y] = [(i % 11) as f32 / 10.0, (i / 11) as f32 / 10.0];
            let noise = 0.02 * (rng::unit_f32(rng::mix(i) as u32) - 0.5);
            let e = (2.0 + x - 0.5 * y) * (1.0 + noise) * if i == 60 { times } else { 1.0 };
            let gathered = Gathered { irradiance: Spectrum::gray(e), distance: 1.0, rays: 64, ..Gathered::default() };
            cache.insert(Known { p: Vec3::new(x, y, 0.0), n: Vec3::Z, gathered, shift: Shift::default() }, [0.0, 0.0]);
        }
        cache
    }

    #[test]
    fn what_differs_from_all_around_it_is_doubted() {
        for times in [0.5, 1.5] {
            let mut cache = cache(times);
            assert_eq!(cache.doubted(0, 1.0), [60], "{times}");
            assert_eq!(cache.doubted(61, 1.0), [0; 0], "records of earlier views stay as they are");
            let all = |cache: &Cache| cache.records.iter().map(|record| record.gathered.irradiance.g).sum::<f32>();
            let before = all(&cache);
            let again = Gathered { irradiance: Spectrum::gray(2.25), ..cache.records[60].gathered };
            cache.replace(60, again, 1.0);
            assert_eq!(cache.doubted(0, 1.0), [0; 0]);
            assert_eq!(cache.records[60].gathered.irradiance.g, 2.25);
            // (Without what those around it take over it would be 0.4 % off.)
            assert!((all(&cache) / before - 1.0).abs() < 1e-5, "no light is lost: {} {before}", all(&cache));
        }
        // The twin: nothing is odd about light that changes smoothly.
        assert_eq!(cache(1.0).doubted(0, 1.0), [0; 0]);
    }
}
