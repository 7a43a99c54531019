//! Reconstruction filters, sampled instead of splatted.
//!
//! The value of a pixel is `∫ f(x, y) L(x, y) dx dy / ∫ f`, with `f` the filter around the pixel's centre. Filter importance
//! sampling [Ernst06] draws the offset from `|f|` and gives the sample the weight `sign(f) ∫|f| / ∫f`, whose expectation is
//! 1. No sample ever contributes to another pixel, so pixels can be made in any order and on any thread with the same bits.
//!
//! All filters are products of one function of x and the same function of y. Gaussian, Mitchell and Blackman–Harris are
//! tabulated as 1024 linear pieces, and that table is what is sampled and integrated, exactly.
//!
//! [Ernst06] Ernst, Stamminger, Greiner, *Filter Importance Sampling*, IEEE Symposium on Interactive Ray Tracing 2006.

use std::fmt;
use std::str::FromStr;
use std::sync::LazyLock;

use thiserror::Error;

use crate::math::{Vec2, function};

/// A reconstruction filter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Filter {
    /// The mean over the pixel's square.
    Box,
    /// Linear to zero at the neighbours' centres.
    Tent,
    /// `exp(−x²/2σ²)` with σ = 0.5 pixel, cut off at 1.5 pixels.
    Gaussian,
    /// Mitchell and Netravali's cubic with B = C = 1/3, radius 2 pixels. Sharp; its negative lobes can ring at edges.
    Mitchell,
    /// The four-term Blackman–Harris window, radius 1.5 pixels.
    #[default]
    BlackmanHarris,
}

/// Where in the pixel to sample, and how much the sample counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilterSample {
    /// From the pixel's centre, in pixels: x to the right, y down.
    pub offset: Vec2,
    /// Its expectation over all samples is 1. Exactly 1 for filters without negative lobes.
    pub weight: f32,
}

impl Filter {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Box, Self::Tent, Self::Gaussian, Self::Mitchell, Self::BlackmanHarris];

    /// Its name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Box => "box",
            Self::Tent => "tent",
            Self::Gaussian => "gaussian",
            Self::Mitchell => "mitchell",
            Self::BlackmanHarris => "blackman-harris",
        }
    }

    /// Half its width, pixels.
    pub const fn radius(self) -> f32 {
        match self {
            Self::Box => 0.5,
            Self::Tent => 1.0,
            Self::Gaussian | Self::BlackmanHarris => 1.5,
            Self::Mitchell => 2.0,
        }
    }

    /// The one-dimensional filter at `x` pixels from the centre, not normalised.
    pub fn evaluate(self, x: f32) -> f32 {
        let a = f64::from(x.abs());
        if a > f64::from(self.radius()) {
            return 0.0;
        }
        let value = match self {
            Self::Box => 1.0,
            Self::Tent => 1.0 - a,
            Self::Gaussian => function::exp_f64(-2.0 * a * a),
            Self::Mitchell if a < 1.0 => (7.0 * a * a * a - 12.0 * a * a + 16.0 / 3.0) / 6.0,
            Self::Mitchell => (-7.0 / 3.0 * a * a * a + 12.0 * a * a - 20.0 * a + 32.0 / 3.0) / 6.0,
            Self::BlackmanHarris => {
                // The window's coefficients (Harris 1978, minimum four-term), its maximum at x = 0.
                let t = std::f64::consts::PI * a / 1.5;
                let cos = function::cos_f64;
                0.358_75 + 0.488_29 * cos(t) + 0.141_28 * cos(2.0 * t) + 0.011_68 * cos(3.0 * t)
            }
        };
        value as f32
    }

    /// The one-dimensional filter at `x` pixels from the centre, its integral 1, as it is sampled.
    pub fn weight(self, x: f32) -> f32 {
        match self {
            Self::Box | Self::Tent => self.evaluate(x),
            Self::Gaussian => GAUSSIAN.at(x),
            Self::Mitchell => MITCHELL.at(x),
            Self::BlackmanHarris => BLACKMAN_HARRIS.at(x),
        }
    }

    /// Maps a point of `[0, 1)²` to where to sample. The centre (0.5, 0.5) maps to the pixel's centre.
    pub fn sample(self, u: Vec2) -> FilterSample {
        let table = match self {
            Self::Box => return FilterSample { offset: u - 0.5, weight: 1.0 },
            Self::Tent => {
                let tent = |u: f32| if u < 0.5 { (2.0 * u).sqrt() - 1.0 } else { 1.0 - (2.0 - 2.0 * u).max(0.0).sqrt() };
                return FilterSample { offset: Vec2::new(tent(u.x), tent(u.y)), weight: 1.0 };
            }
            Self::Gaussian => &GAUSSIAN,
            Self::Mitchell => &MITCHELL,
            Self::BlackmanHarris => &BLACKMAN_HARRIS,
        };
        let ((x, wx), (y, wy)) = (table.sample(u.x), table.sample(u.y));
        FilterSample { offset: Vec2::new(x, y), weight: wx * wy }
    }
}

static GAUSSIAN: LazyLock<Table> = LazyLock::new(|| Table::new(Filter::Gaussian));
static MITCHELL: LazyLock<Table> = LazyLock::new(|| Table::new(Filter::Mitchell));
static BLACKMAN_HARRIS: LazyLock<Table> = LazyLock::new(|| Table::new(Filter::BlackmanHarris));

/// Linear pieces over half of a filter (the other half is its mirror image).
const N_PIECES: usize = 512;

/// One half of a filter, `[0, radius]`, ready to be sampled.
struct Table {
    radius: f64,
    /// `|f|` at the ends of the pieces.
    density: Vec<f64>,
    /// Running integral of `density`, normalised to end at 1.
    cumulative: Vec<f64>,
    /// +1 or −1 for each piece.
    sign: Vec<f32>,
    /// `∫|f| / ∫f`.
    weight: f32,
    /// `∫f`, of both halves.
    integral: f64,
}

impl Table {
    fn new(filter: Filter) -> Self {
        let radius = f64::from(filter.radius());
        let at = |i: f64| f64::from(filter.evaluate((i * radius / N_PIECES as f64) as f32));
        let density: Vec<f64> = (0..=N_PIECES).map(|i| at(i as f64).abs()).collect();
        let sign: Vec<f32> = (0..N_PIECES).map(|i| if at(i as f64 + 0.5) < 0.0 { -1.0 } else { 1.0 }).collect();
        let mut cumulative = vec![0.0];
        let (mut absolute, mut signed) = (0.0, 0.0);
        for (piece, s) in density.windows(2).zip(&sign) {
            let area = 0.5 * (piece[0] + piece[1]);
            absolute += area;
            signed += area * f64::from(*s);
            cumulative.push(absolute);
        }
        cumulative.iter_mut().for_each(|c| *c /= absolute);
        let weight = if signed == absolute { 1.0 } else { (absolute / signed) as f32 };
        let integral = 2.0 * signed * radius / N_PIECES as f64;
        Self { radius, density, cumulative, sign, weight, integral }
    }

    /// The value at `x` over the integral.
    fn at(&self, x: f32) -> f32 {
        let place = f64::from(x.abs()) / self.radius * N_PIECES as f64;
        let i = place as usize;
        if i >= N_PIECES {
            return 0.0;
        }
        let t = place - i as f64;
        let value = self.density[i] * (1.0 - t) + self.density[i + 1] * t;
        (value / self.integral) as f32 * self.sign[i]
    }

    /// Offset and signed weight for `u` in `[0, 1)`, rising with `u`.
    fn sample(&self, u: f32) -> (f32, f32) {
        let v = 2.0 * f64::from(u) - 1.0;
        let target = v.abs().min(1.0);
        let i = self.cumulative.partition_point(|&c| c <= target).saturating_sub(1).min(N_PIECES - 1);
        let (start, end) = (self.cumulative[i], self.cumulative[i + 1]);
        let share = if end > start { (target - start) / (end - start) } else { 0.0 };
        // Invert a t + (b − a) t²/2 = share (a + b)/2 for t, in the form that does not cancel.
        let (a, b) = (self.density[i], self.density[i + 1]);
        let root = (a * a + share * (b * b - a * a)).max(0.0).sqrt();
        let t = if a + root > 0.0 { share * (a + b) / (a + root) } else { 0.0 };
        let x = (i as f64 + t.min(1.0)) * self.radius / N_PIECES as f64;
        ((x * v.signum()) as f32 + 0.0, self.weight * self.sign[i])
    }
}

impl fmt::Display for Filter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A name that is no filter's.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("there is no filter {name:?}; the filters are {}", Filter::ALL.map(Filter::name).join(", "))]
pub struct UnknownFilter {
    /// The name.
    pub name: String,
}

impl FromStr for Filter {
    type Err = UnknownFilter;
    fn from_str(name: &str) -> Result<Self, UnknownFilter> {
        Self::ALL.into_iter().find(|f| f.name().eq_ignore_ascii_case(name)).ok_or_else(|| UnknownFilter { name: name.to_owned() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Midpoints of `n` equal cells of `[0, 1)`.
    fn midpoints(n: u32) -> impl Iterator<Item = f32> {
        (0..n).map(move |i| (i as f32 + 0.5) / n as f32)
    }

    /// `∫ x^k f(x) dx / ∫ f(x) dx` by quadrature of [`Filter::evaluate`].
    fn moment(filter: Filter, k: i32) -> f64 {
        let r = filter.radius();
        let (mut sum, mut total) = (0.0, 0.0);
        for u in midpoints(20_000) {
            let x = (2.0 * u - 1.0) * r;
            let f = f64::from(filter.evaluate(x));
            sum += f * f64::from(x).powi(k);
            total += f;
        }
        sum / total
    }

    #[test]
    fn weights_integrate_to_one_and_samples_have_the_moments_of_the_filter() {
        for filter in Filter::ALL {
            let (mut total, mut second, mut fourth) = (0.0, 0.0, 0.0);
            let n = 20_000;
            for u in midpoints(n) {
                let s = filter.sample(Vec2::new(u, 0.5));
                // The weight is a product, and that of y is the root of the weight at the centre.
                let w = f64::from(s.weight / filter.sample(Vec2::splat(0.5)).weight.sqrt());
                let x = f64::from(s.offset.x);
                assert!(x.abs() <= f64::from(filter.radius()));
                total += w;
                second += w * x * x;
                fourth += w * x.powi(4);
            }
            let n = f64::from(n);
            assert!((total / n - 1.0).abs() < 1e-3, "{filter}: {}", total / n);
            assert!((second / n - moment(filter, 2)).abs() < 1e-3, "{filter}: {} {}", second / n, moment(filter, 2));
            assert!((fourth / n - moment(filter, 4)).abs() < 2e-3, "{filter}: {} {}", fourth / n, moment(filter, 4));
        }
    }

    #[test]
    fn normalised_filters_are_the_filters_and_integrate_to_one() {
        for filter in Filter::ALL {
            let r = filter.radius();
            let n = 20_000;
            let sum: f64 = midpoints(n).map(|u| f64::from(filter.weight((2.0 * u - 1.0) * r))).sum::<f64>() / f64::from(n);
            assert!((sum * 2.0 * f64::from(r) - 1.0).abs() < 1e-4, "{filter}: {sum}");
            let share = filter.weight(0.3) / filter.weight(0.0);
            assert!((share - filter.evaluate(0.3) / filter.evaluate(0.0)).abs() < 1e-4, "{filter}");
        }
    }

    #[test]
    fn the_mean_weight_over_the_square_is_one() {
        for filter in Filter::ALL {
            let mut total = 0.0;
            // The share of negative samples is resolved to one in n along each axis.
            let n = 1500;
            for v in midpoints(n) {
                total += midpoints(n).map(|u| f64::from(filter.sample(Vec2::new(u, v)).weight)).sum::<f64>();
            }
            let mean = total / f64::from(n * n);
            assert!((mean - 1.0).abs() < 5e-3, "{filter}: {mean}");
        }
    }

    #[test]
    fn only_mitchell_has_weights_other_than_one() {
        for filter in Filter::ALL {
            let all_one = midpoints(300).all(|u| filter.sample(Vec2::new(u, u)).weight == 1.0);
            assert_eq!(all_one, filter != Filter::Mitchell);
        }
        assert!(midpoints(300).any(|u| Filter::Mitchell.sample(Vec2::new(u, 0.5)).weight < 0.0));
    }

    #[test]
    fn the_centre_stays_the_centre_and_the_ends_stay_inside() {
        for filter in Filter::ALL {
            assert_eq!(filter.sample(Vec2::splat(0.5)).offset, Vec2::ZERO);
            for u in [0.0, 1.0 - f32::EPSILON / 2.0, 1.0] {
                let x = filter.sample(Vec2::splat(u)).offset.x;
                assert!(x.is_finite() && x.abs() <= filter.radius(), "{filter} {u} {x}");
            }
            assert_eq!(filter.name().parse(), Ok(filter));
        }
    }

    #[test]
    fn known_values_of_the_filters_come_out() {
        // Mitchell and Netravali: (6 − 2B)/6 = 8/9 at 0, B/6 = 1/18 at 1, zero at 8/7 and 2.
        assert!((Filter::Mitchell.evaluate(0.0) - 8.0 / 9.0).abs() < 1e-6);
        assert!((Filter::Mitchell.evaluate(1.0) - 1.0 / 18.0).abs() < 1e-6);
        assert!(Filter::Mitchell.evaluate(8.0 / 7.0).abs() < 1e-6);
        assert!((Filter::BlackmanHarris.evaluate(0.0) - 1.0).abs() < 1e-6);
        assert!(Filter::BlackmanHarris.evaluate(1.5) < 1e-4);
        assert_eq!(Filter::Tent.evaluate(0.25), 0.75);
    }
}
