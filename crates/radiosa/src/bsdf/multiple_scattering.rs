//! Light that the facets of a rough surface reflect more than once, which `f = D G F/(4 n·l n·v)` loses: compensated by a lobe that gives it back. [Kulla17]
//!
//! With `E(μ)` the part that facets of `F = 1` reflect once of light at `μ = n·i`, and `E_avg = 2 ∫ E(μ) μ dμ`, a second lobe
//!
//! ```text
//! f_ms(o, i) = F_ms (1 − E(o)) (1 − E(i)) / (π (1 − E_avg))
//! ```
//!
//! is reciprocal and reflects `F_ms (1 − E)`, all that was lost where `F_ms = 1`. What is reflected k times meets k facets and is lost to further ones k − 1 times:
//! `Σ_{k ≥ 2} F_avg^k (1 − E_avg)^(k−1) E_avg` is to be `F_ms (1 − E_avg)`, hence
//!
//! ```text
//! F_ms = F_avg² E_avg / (1 − F_avg (1 − E_avg)),    F_avg = 2 ∫ F(μ) μ dμ
//! ```
//!
//! The tables of `E` are made when first asked for. Roughness above α = 1 counts as 1 in them. Rough boundaries that refract are not compensated.

use std::f32::consts::PI;
use std::sync::OnceLock;

use rayon::prelude::*;

use super::microfacet::{self, Angles};
use super::mirror;
use crate::math::Vec3;
use crate::sampling::sequence;
use crate::scene::{Distribution, Shadowing};
use crate::spectrum::Spectrum;

/// Roughnesses and cosines in a table.
const SIDE: usize = 32;
/// Facets drawn for each of its entries.
const FACETS: u32 = 1 << 10;
/// Where less than this is lost nothing is given back.
const LOST: f32 = 1e-4;

/// `E(μ)` by roughness.
#[derive(Debug, PartialEq)]
pub struct Table {
    /// `√α = k/(SIDE − 1)`, then `√μ = j/(SIDE − 1)`: near a mirror and at grazing angles it changes fastest.
    albedos: Vec<[f32; SIDE]>,
    /// `E_avg` by roughness.
    means: Vec<f32>,
}

/// What is given back, ready to be evaluated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Compensation {
    table: &'static Table,
    alpha: f32,
    /// `F_ms`.
    strength: Spectrum,
    /// `1 − E_avg`.
    lost: f32,
}

impl Compensation {
    /// For facets of a mean reflectance `F_avg`; `None` where nothing is lost.
    pub(super) fn new(distribution: Distribution, shadowing: Shadowing, alpha: f32, mean: Spectrum) -> Option<Self> {
        let table = Table::of(distribution, shadowing);
        let e = table.mean(alpha);
        let strength = mean.map(|f| f * f * e / (1.0 - f * (1.0 - e)));
        (1.0 - e > LOST).then_some(Self { table, alpha, strength, lost: 1.0 - e })
    }

    /// `f_ms (n·i)`, 1/sr.
    pub(super) fn f_cos(&self, n_v: f32, n_l: f32) -> Spectrum {
        let lost = |cos: f32| 1.0 - self.table.albedo(self.alpha, cos);
        self.strength * (lost(n_v) * lost(n_l) * n_l / (PI * self.lost))
    }

    /// The part it reflects of light at `n_v`.
    pub(super) fn albedo(&self, n_v: f32) -> Spectrum {
        self.strength * (1.0 - self.table.albedo(self.alpha, n_v))
    }
}

/// Where a number in [0, 1] stands in a table: the entry before it and the share of the next.
fn place(x: f32) -> (usize, f32) {
    let x = x.clamp(0.0, 1.0) * (SIDE - 1) as f32;
    let k = (x as usize).min(SIDE - 2);
    (k, x - k as f32)
}

impl Table {
    /// The table of facets, made when first asked for.
    pub fn of(distribution: Distribution, shadowing: Shadowing) -> &'static Self {
        static TABLES: [OnceLock<Table>; 6] = [const { OnceLock::new() }; 6];
        TABLES[distribution as usize * 3 + shadowing as usize].get_or_init(|| Self::new(distribution, shadowing))
    }

    fn new(distribution: Distribution, shadowing: Shadowing) -> Self {
        let entry = |k: usize, j: usize| {
            let [alpha, cos] = [k, j].map(|i| (i as f32 / (SIDE - 1) as f32).powi(2));
            // Nothing is lost by a mirror. The last facets are seen a little above the horizon.
            if k == 0 { 1.0 } else { albedo(distribution, shadowing, alpha, cos.max(1e-4)) }
        };
        let albedos: Vec<[f32; SIDE]> = (0..SIDE).into_par_iter().map(|k| std::array::from_fn(|j| entry(k, j))).collect();
        let means = albedos.iter().map(mean).collect();
        Self { albedos, means }
    }

    /// `E(μ)`.
    pub fn albedo(&self, alpha: f32, cos: f32) -> f32 {
        let ((k, a), (j, b)) = (place(alpha.sqrt()), place(cos.max(0.0).sqrt()));
        let of = |row: &[f32; SIDE]| row[j] + (row[j + 1] - row[j]) * b;
        let (low, high) = (of(&self.albedos[k]), of(&self.albedos[k + 1]));
        low + (high - low) * a
    }

    /// `E_avg`.
    pub fn mean(&self, alpha: f32) -> f32 {
        let (k, a) = place(alpha.sqrt());
        self.means[k] + (self.means[k + 1] - self.means[k]) * a
    }
}

/// `2 ∫ E μ dμ` of a row, which is linear in `t = √μ` between its entries: `∫ E 4 t³ dt`, exactly.
fn mean(row: &[f32; SIDE]) -> f32 {
    let h = 1.0 / (SIDE - 1) as f64;
    let mut sum = 0.0;
    for (j, pair) in row.windows(2).enumerate() {
        let (t0, t1) = (j as f64 * h, (j + 1) as f64 * h);
        let (e0, e1) = (f64::from(pair[0]), f64::from(pair[1]));
        let slope = (e1 - e0) / h;
        // ∫ (e0 + slope (t − t0)) 4 t³ dt.
        sum += (e0 - slope * t0) * (t1.powi(4) - t0.powi(4)) + slope * 0.8 * (t1.powi(5) - t0.powi(5));
    }
    sum as f32
}

/// The part that facets of `F = 1` reflect once of light at `cos` from the normal: the mean of `G/G₁` over visible normals.
fn albedo(distribution: Distribution, shadowing: Shadowing, alpha: f32, cos: f32) -> f32 {
    let wo = Vec3::new(((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt(), 0.0, cos);
    let weight = |i: u32| {
        let h = microfacet::sample_visible(distribution, alpha, wo, sequence::point_2d(i, 0));
        let angles = Angles::new(Vec3::Z, wo, mirror::reflect(wo, h))?;
        let pdf = microfacet::sample_visible_pdf(distribution, alpha, &angles) / angles.v_h;
        let f = microfacet::d(distribution, alpha, &angles)
            * microfacet::g_over_cosines(shadowing, distribution, alpha, &angles)
            * angles.n_l;
        (pdf > 0.0).then(|| f64::from(f / pdf)).filter(|weight| weight.is_finite())
    };
    let sum: f64 = (0..FACETS).filter_map(weight).sum();
    ((sum / f64::from(FACETS)) as f32).min(1.0)
}
