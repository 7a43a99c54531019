//! What a medium absorbs of what two elements exchange.
//!
//! ```text
//! A F (1 − τ) = ∫_a ∫_b K (1 − e^(−σ r)) dA dA′,   K = cos θ cos θ′ / (π r²)
//! ```
//!
//! The integrand grows like 1/r only where elements touch, one power less than K: the product rule of Gauss takes it, over pairs of parts that are divided
//! until they are small against their distance, or too small to matter.

use std::f64::consts::FRAC_1_PI;

use super::analytic::gauss_legendre;
use crate::math::DVec3;
use crate::math::polygon::{area_vector, bilinear, bilinear_area, clip};
use crate::radiosity::medium::Medium;

/// Points a side, and the greatest extent against distance for which they do: about `q^2n` is missed.
const RULES: [usize; 4] = [1, 2, 3, 4];

/// Of what the medium may absorb between two parts, a rule that is too coarse for them misses about this.
const MISSED: f64 = 0.3;

/// Which rule is taken for parts too small to matter.
const COARSE: usize = 1;

/// Divisions at most.
const MAX_DEPTH: u32 = 8;

/// `A_a F_ab (1 − τ)` of two convex one-sided polygons, m² by channel, each cut by the other's plane, which exchange `exact` in a clear medium; within
/// about `tolerance` of the smaller area.
pub fn absorbed(a: &[DVec3], b: &[DVec3], exact: f64, medium: &Medium, tolerance: f64) -> [f64; 3] {
    let (na, nb) = (area_vector(a), area_vector(b));
    let smaller = na.length().min(nb.length());
    if medium.is_clear() || smaller <= 0.0 {
        return [0.0; 3];
    }
    let reach = a.iter().chain(b).map(|p| (*p - a[0]).length()).fold(0.0, f64::max);
    let (mut a_cut, mut b_cut) = (Vec::with_capacity(8), Vec::with_capacity(8));
    clip(b, a[0], na.normalize_or_zero(), 1e-12 * reach, &mut b_cut);
    clip(a, b[0], nb.normalize_or_zero(), 1e-12 * reach, &mut a_cut);
    let sigma = medium.absorption.iter().fold(0.0, |m: f64, &s| m.max(s));
    let factor = (exact / smaller).min(1.0);
    let integral = Integral { medium, factor, normals: [na, nb].map(DVec3::normalize_or_zero), sigma, smaller, tolerance };
    let mut sum = [0.0; 3];
    for a in parts(&a_cut) {
        for b in parts(&b_cut) {
            integral.add([&a, &b], 0, &mut sum);
        }
    }
    sum
}

/// A convex polygon as quadrilaterals; those of more than four corners around the first, with two corners in one place.
fn parts(polygon: &[DVec3]) -> Vec<Part> {
    match *polygon {
        [a, b, c, d] => vec![Part::new([a, b, c, d])],
        [first, ref rest @ ..] => rest.windows(2).map(|e| Part::new([first, e[0], e[1], e[1]])).collect(),
        [] => Vec::new(),
    }
}

/// A part of a polygon, with the ball around it.
struct Part {
    corners: [DVec3; 4],
    centre: DVec3,
    radius: f64,
    area: f64,
}

impl Part {
    fn new(corners: [DVec3; 4]) -> Self {
        let centre = corners.iter().sum::<DVec3>() * 0.25;
        let radius = corners.iter().map(|c| (*c - centre).length()).fold(0.0, f64::max);
        Self { corners, centre, radius, area: area_vector(&corners).length() }
    }

    fn quarters(&self) -> [Self; 4] {
        let [a, b, c, d] = self.corners;
        let (ab, bc, cd, da) = ((a + b) * 0.5, (b + c) * 0.5, (c + d) * 0.5, (d + a) * 0.5);
        let middle = (ab + cd) * 0.5;
        [[a, ab, middle, da], [ab, b, bc, middle], [middle, bc, c, cd], [da, middle, cd, d]].map(Self::new)
    }
}

struct Integral<'a> {
    medium: &'a Medium,
    normals: [DVec3; 2],
    /// Of the smaller one to the larger one; parts that touch have about the same, since they are to each other as the whole is.
    factor: f64,
    /// The largest σ.
    sigma: f64,
    smaller: f64,
    tolerance: f64,
}

impl Integral<'_> {
    /// Adds what a pair of parts contributes.
    fn add(&self, [a, b]: [&Part; 2], depth: u32, sum: &mut [f64; 3]) {
        let distance = (a.centre - b.centre).length();
        let q = (a.radius + b.radius) / distance;
        let fits = |n: usize| q < libm::pow(self.tolerance.clamp(1e-12, 0.5), 0.5 / n as f64);
        // As many such pairs as the smaller one has parts along an edge may be wrong alike.
        let at_stake = self.factor * a.area.min(b.area) * (self.sigma * (distance + a.radius + b.radius)).min(1.0);
        let parts = (self.smaller / a.area.min(b.area)).sqrt();
        let finest = depth >= MAX_DEPTH || MISSED * at_stake * parts < self.tolerance * self.smaller;
        match RULES.iter().position(|&n| fits(n)) {
            Some(rule) => self.by_rule([a, b], rule, sum),
            None if finest => self.by_rule([a, b], COARSE, sum),
            // The larger one alone, as long as it is much larger.
            None if a.radius > 2.0 * b.radius => a.quarters().iter().for_each(|a| self.add([a, b], depth + 1, sum)),
            None if b.radius > 2.0 * a.radius => b.quarters().iter().for_each(|b| self.add([a, b], depth + 1, sum)),
            None => {
                let (a, b) = (a.quarters(), b.quarters());
                a.iter().for_each(|a| b.iter().for_each(|b| self.add([a, b], depth + 1, sum)));
            }
        }
    }

    fn by_rule(&self, [a, b]: [&Part; 2], rule: usize, sum: &mut [f64; 3]) {
        let nodes = |part: &Part, out: &mut [(DVec3, f64); 16]| {
            let points = NODES[rule].iter().zip(out);
            points
                .map(|(&[s, t, w], out)| *out = (bilinear(part.corners, [s, t]), w * bilinear_area(part.corners, [s, t])))
                .count()
        };
        let (mut x, mut y) = ([(DVec3::ZERO, 0.0); 16], [(DVec3::ZERO, 0.0); 16]);
        let n = nodes(a, &mut x).min(nodes(b, &mut y));
        for (p, wp) in &x[..n] {
            for (q, wq) in &y[..n] {
                let d = *q - *p;
                let r2 = d.length_squared();
                let kernel = self.normals[0].dot(d).max(0.0) * (-self.normals[1].dot(d)).max(0.0) / (r2 * r2) * FRAC_1_PI;
                if kernel > 0.0 && kernel.is_finite() {
                    let tau = self.medium.transmittance(r2.sqrt());
                    (0..3).for_each(|c| sum[c] += kernel * wp * wq * (1.0 - tau[c]));
                }
            }
        }
    }
}

/// The tensor rules of [`RULES`] on the unit square: s, t and weight.
static NODES: std::sync::LazyLock<[Vec<[f64; 3]>; 4]> = std::sync::LazyLock::new(|| {
    RULES.map(|n| {
        let rule = gauss_legendre(n);
        rule.iter().flat_map(|&[t, wt]| rule.iter().map(move |&[s, ws]| [s, t, ws * wt])).collect()
    })
});
