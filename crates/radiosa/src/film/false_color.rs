//! False colour: one quantity as a scale of colours, so that numbers can be read off a picture.
//!
//! ```text
//! linear:       t = (v − lo)/(hi − lo)
//! logarithmic:  t = ln(v/lo)/ln(hi/lo)
//! ```

use crate::math::function;

/// A scale of colours whose lightness rises evenly, also to eyes that do not tell all colours apart.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Palette {
    /// Dark violet over green to yellow.
    #[default]
    Viridis,
    /// Dark blue over grey to yellow: looks much the same to everybody. Source: [Nunez18].
    Cividis,
}

impl Palette {
    /// The sRGB bytes at `t` in `[0, 1]`.
    pub fn color(self, t: f64) -> [u8; 3] {
        let map = match self {
            Self::Viridis => colorous::VIRIDIS,
            Self::Cividis => colorous::CIVIDIS,
        };
        map.eval_continuous(if t.is_nan() { 0.0 } else { t.clamp(0.0, 1.0) }).as_array()
    }
}

/// What is shown as the first and the last colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// The value of the first colour, and of all below it.
    pub low: f64,
    /// The value of the last colour, and of all above it; greater than `low`.
    pub high: f64,
    /// Equal ratios are equal steps; `low` is above zero.
    pub is_logarithmic: bool,
}

/// Of the values these parts may lie beyond a scale that is chosen: lamps, fireflies.
const BEYOND: usize = 200;
/// Factor from the first colour of a logarithmic scale that is chosen to its last, at most.
const DECADES: f64 = 1e3;

impl Scale {
    /// From zero to about the greatest of `values`, or over as much as three decades below it.
    pub fn of(values: impl Iterator<Item = f64>, is_logarithmic: bool) -> Self {
        let mut values: Vec<f64> = values.filter(|v| *v > 0.0 && v.is_finite()).collect();
        values.sort_unstable_by(f64::total_cmp);
        let last = values.len().saturating_sub(1 + values.len() / BEYOND);
        let high = values.get(last).map_or(1.0, |v| round_up(*v));
        let low = values.get(values.len() / BEYOND).map_or(high / DECADES, |v| 1.0 / round_up(1.0 / v));
        let low = if is_logarithmic { low.clamp(high / DECADES, high / 10.0) } else { 0.0 };
        Self { low, high, is_logarithmic }
    }

    /// Where a value lies on the scale, in `[0, 1]`; what is no number at the low end.
    pub fn position(&self, value: f64) -> f64 {
        let t = if self.is_logarithmic {
            function::ln_f64(value.max(f64::MIN_POSITIVE) / self.low) / function::ln_f64(self.high / self.low)
        } else {
            (value - self.low) / (self.high - self.low)
        };
        if t.is_nan() { 0.0 } else { t.clamp(0.0, 1.0) }
    }

    /// Round values to write beside a legend, rising.
    pub fn ticks(&self) -> Vec<f64> {
        let inside = |v: &f64| *v >= self.low * (1.0 - 1e-9) && *v <= self.high * (1.0 + 1e-9);
        if self.is_logarithmic {
            let first = self.low.log10().floor() as i32;
            let last = self.high.log10().ceil() as i32;
            let decades = (first..=last).flat_map(|d| [1.0, 2.0, 5.0].map(|m| m * 10f64.powi(d)));
            return decades.filter(inside).collect();
        }
        let step = round_up((self.high - self.low) / 6.0);
        let first = (self.low / step).ceil() as i64;
        (first..first + 12).map(|k| k as f64 * step).filter(inside).collect()
    }

    /// The band of a value, of `n` equal ones.
    pub fn band(&self, value: f64, n: u32) -> u32 {
        ((self.position(value) * f64::from(n)) as u32).min(n.saturating_sub(1))
    }

    /// The values as sRGB bytes, three each, `width` in a row; with `contours` above one, dark lines part so many equal bands. NaN is left grey.
    pub fn paint(&self, values: &[f64], width: usize, palette: Palette, contours: u32) -> Vec<u8> {
        const NOTHING: [u8; 3] = [190; 3];
        const LINE: [u8; 3] = [20; 3];
        let is_line = |i: usize| {
            let other = |j: usize| values.get(j).is_some_and(|v| self.band(*v, contours) != self.band(values[i], contours));
            contours > 1 && (i % width + 1 < width && other(i + 1) || other(i + width))
        };
        let color = |i: usize| match values[i] {
            v if v.is_nan() => NOTHING,
            _ if is_line(i) => LINE,
            v => palette.color(self.position(v)),
        };
        (0..values.len()).flat_map(color).collect()
    }
}

/// The least of 1, 2, 5 times a power of ten that is not below `v`.
fn round_up(v: f64) -> f64 {
    let decade = 10f64.powi(v.log10().floor() as i32);
    let rounded = [1.0, 2.0, 5.0, 10.0].map(|m| m * decade).into_iter().find(|r| *r >= v * (1.0 - 1e-9)).unwrap_or(v);
    if rounded.is_finite() && rounded > 0.0 { rounded } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scale_has_its_ends_and_its_middle() {
        let linear = Scale { low: 0.0, high: 500.0, is_logarithmic: false };
        let log = Scale { low: 1.0, high: 100.0, is_logarithmic: true };
        for (scale, values) in [(linear, [0.0, 250.0, 500.0]), (log, [1.0, 10.0, 100.0])] {
            for (value, t) in values.into_iter().zip([0.0, 0.5, 1.0]) {
                assert!((scale.position(value) - t).abs() < 1e-12, "{scale:?} {value}");
            }
            assert_eq!([f64::NAN, -1.0, 1e9].map(|v| scale.position(v)), [0.0, 0.0, 1.0]);
        }
        assert_eq!(linear.ticks(), [0.0, 100.0, 200.0, 300.0, 400.0, 500.0]);
        assert_eq!(log.ticks(), [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0]);
    }

    #[test]
    fn chosen_scales_are_round_and_leave_out_fireflies() {
        let values = || (1..1000).map(f64::from).chain([1e9, f64::NAN, -3.0, f64::INFINITY]);
        assert_eq!(Scale::of(values(), false), Scale { low: 0.0, high: 1000.0, is_logarithmic: false });
        assert_eq!(Scale::of(values(), true), Scale { low: 5.0, high: 1000.0, is_logarithmic: true });
        assert_eq!(Scale::of(std::iter::empty(), false).high, 1.0);
        for v in [1e-320, 1e308, 3.0] {
            assert!(round_up(v) > 0.0 && round_up(v).is_finite(), "{v}");
        }
    }

    #[test]
    fn lightness_rises_along_palettes() {
        for palette in [Palette::Viridis, Palette::Cividis] {
            let light = |t: f64| palette.color(t).iter().zip([2, 7, 1]).map(|(c, w)| u32::from(*c) * w).sum::<u32>();
            assert!((0..20).all(|k| light(f64::from(k) / 20.0) < light(f64::from(k + 1) / 20.0)), "{palette:?}");
        }
    }

    #[test]
    fn contours_part_bands() {
        let values: Vec<f64> = (0..8).map(f64::from).chain((0..8).map(f64::from)).collect();
        let scale = Scale { low: 0.0, high: 8.0, is_logarithmic: false };
        let painted = scale.paint(&values, 8, Palette::Viridis, 2);
        let lines: Vec<usize> = (0..16).filter(|i| painted[3 * i] == 20 && painted[3 * i + 1] == 20).collect();
        assert_eq!(lines, [3, 11]);
    }
}
