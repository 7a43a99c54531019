//! The area estimator: the double integral of a factor, sampled.
//!
//! ```text
//! A_i F_ij = ∫_i ∫_j V K dA_j dA_i  ≈  A_i A_j / n Σ V K,   K = cos θ cos θ′ / (π r²)
//! ```
//!
//! Pairs of points fill all four dimensions evenly, differently for every pair of elements. K has no bound where elements touch, and the variance of the sum none either; the disc
//! kernel `cos θ cos θ′ / (π r² + A_j/n)` puts a disc of the sample's area, facing the other point, in its place [Wallace89]: bounded, with a bias
//! that goes with the size of the samples. The cost is `n` rays for each pair.

use std::f64::consts::PI;

use super::Exchange;
use super::rule;
use super::visibility::Visibility;
use crate::math::{DVec3, Vec2};
use crate::radiosity::medium::Medium;
use crate::radiosity::mesh::{Element, ElementMesh};
use crate::sampling::{rng, sequence};
use crate::transport::World;

/// What is integrated where elements are close.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Kernel {
    /// K as it is.
    #[default]
    Point,
    /// A disc around every sample of the receiving element.
    Disc,
}

/// Where samples are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Samples {
    /// Low discrepancy.
    #[default]
    Even,
    /// Independent.
    Random,
}

/// What is sampled.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Pairs of points for each pair of elements.
    pub samples: u32,
    /// How they are spread.
    pub spread: Samples,
    /// What is summed over them.
    pub kernel: Kernel,
}

impl Default for Settings {
    fn default() -> Self {
        Self { samples: 64, spread: Samples::Even, kernel: Kernel::Point }
    }
}

/// The estimator over a mesh.
#[derive(Debug)]
pub struct Area<'a> {
    elements: &'a [Element],
    visibility: Visibility<'a>,
    settings: Settings,
    seed: u64,
}

impl<'a> Area<'a> {
    pub(super) fn new(world: &'a World, mesh: &'a ElementMesh, settings: &Settings, medium: Medium, seed: u64) -> Self {
        let settings = Settings { samples: settings.samples.max(1), ..settings.clone() };
        Self { elements: mesh.elements(), visibility: Visibility::without_points(world, medium), settings, seed }
    }

    /// What a pair exchanges.
    pub(super) fn exchange(&self, i: u32, j: u32, scratch: &mut super::visibility::Scratch) -> Exchange {
        let (a, b) = (&self.elements[i as usize], &self.elements[j as usize]);
        if faces_away(a, b) || faces_away(b, a) {
            return Exchange::NONE;
        }
        let n = self.settings.samples;
        let disc = if self.settings.kernel == Kernel::Disc { b.area / f64::from(n) } else { 0.0 };
        let key = rng::key(&[self.seed, u64::from(i), u64::from(j), 0x6172_6561]);
        let mut stream = rng::Stream::new(key, 0, 0);
        let pairs = (0..n).map(|k| {
            let [u, v]: [Vec2; 2] = match self.settings.spread {
                Samples::Even => sequence::point_4d(k, key),
                Samples::Random => [stream.next_2d(), stream.next_2d()],
            };
            let (x, y) = (rule::spread_point(a, u), rule::spread_point(b, v));
            let d = y.p - x.p;
            let r2 = d.length_squared();
            let cosines = a.normal.dot(d).max(0.0) * (-b.normal.dot(d)).max(0.0) / r2;
            let kernel = if cosines > 0.0 { cosines / (PI * r2 + disc) * x.area * y.area } else { 0.0 };
            ([(a, x.p), (b, y.p)], kernel)
        });
        let ([sum, squares], passing) = self.visibility.visible_sums(pairs, scratch);
        let n = f64::from(n);
        let mean = sum / n;
        Exchange { area: mean, variance: (squares / n - mean * mean).max(0.0) / n, passing }
    }
}

/// All of `b` lies behind the plane of `a`, or in it.
fn faces_away(a: &Element, b: &Element) -> bool {
    let tiny = 1e-9 * (b.corners()[0] - a.corners()[0]).length();
    let height = |p: &DVec3| (*p - a.corners()[0]).dot(a.normal);
    b.corners().iter().all(|p| height(p) <= tiny)
}
