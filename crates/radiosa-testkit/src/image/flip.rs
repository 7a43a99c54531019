//! ꟻLIP: the difference between two pictures as a person notices it who flips between them.
//!
//! Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström, Fairchild, *FLIP: A Difference Evaluator for Alternating Images*, Proc. ACM
//! Computer Graphics and Interactive Techniques 3(2), 2020. Low dynamic range, written from the paper; the constants are its own.
//! The difference is `ΔE = ΔE_c^(1 − ΔE_f)`, 0 for equal pixels and at most 1, of
//!
//! - colour: contrast-sensitivity filters in an opponent space, Hunt-adjusted CIELAB, HyAB distance, redistributed to [0, 1];
//! - features: edges and points found at the size the eye resolves.

/// Pixels per degree of a 3840-pixel display 0.7 m wide seen from 0.7 m, the paper's choice.
pub const PIXELS_PER_DEGREE: f64 = 67.020_643;

/// The difference of two pictures, pixel by pixel.
#[derive(Clone, Debug)]
pub struct Flip {
    /// Pixels across.
    pub width: usize,
    /// Row-major from the top left, each 0 to 1.
    pub values: Vec<f64>,
}

impl Flip {
    /// The mean.
    pub fn mean(&self) -> f64 {
        super::mean(self.values.iter().copied())
    }

    /// The value that `percent` of the pixels do not exceed; 100 is the largest.
    ///
    /// # Panics
    /// When `percent` is not between 0 and 100.
    pub fn percentile(&self, percent: f64) -> f64 {
        assert!((0.0..=100.0).contains(&percent), "{percent} is no percentage");
        let mut sorted = self.values.clone();
        sorted.sort_unstable_by(f64::total_cmp);
        let last = sorted.len() - 1;
        sorted[((percent / 100.0 * sorted.len() as f64) as usize).min(last)]
    }

    /// Where the difference is largest: x, y.
    pub fn worst_pixel(&self) -> (usize, usize) {
        let i = (0..self.values.len()).max_by(|&i, &j| self.values[i].total_cmp(&self.values[j])).unwrap_or(0);
        (i % self.width, i / self.width)
    }
}

/// Compares two pictures as a screen shows them: sRGB-encoded, three values a pixel, 0 to 1. `pixels_per_degree` is usually
/// [`PIXELS_PER_DEGREE`].
///
/// # Panics
/// When the sizes do not match, or there are no pixels.
pub fn flip(picture: &[f32], reference: &[f32], width: usize, pixels_per_degree: f64) -> Flip {
    assert_eq!(picture.len(), reference.len(), "pictures of different sizes");
    assert!(width > 0 && !picture.is_empty() && picture.len().is_multiple_of(3 * width), "{width} is not their width");
    let opponent = |p: &[f32]| Plane::new(width, super::pixels(p).iter().map(|c| opponent(c.map(decode))).collect());
    let (test, reference) = (opponent(picture), opponent(reference));
    let color = color_difference(&test, &reference, pixels_per_degree);
    let feature = feature_difference(&test, &reference, pixels_per_degree);
    let values = color.iter().zip(feature).map(|(c, f)| c.powf(1.0 - f)).collect();
    Flip { width, values }
}

/// A picture of three channels.
struct Plane {
    width: usize,
    height: usize,
    values: Vec<[f64; 3]>,
}

impl Plane {
    fn new(width: usize, values: Vec<[f64; 3]>) -> Self {
        Self { width, height: values.len() / width, values }
    }

    /// Sums over a square of side `2 radius + 1` around each pixel, pixels beyond the border being those on it; `term` gets the
    /// offset's index into a kernel, the pixel there and the sums.
    fn convolve<const N: usize>(&self, radius: usize, term: impl Fn(usize, [f64; 3], &mut [f64; N])) -> Vec<[f64; N]> {
        let clamp = |i: usize, d: usize, n: usize| (i + d).saturating_sub(radius).min(n - 1);
        let side = 2 * radius + 1;
        let pixel = |i: usize| {
            let (x, y) = (i % self.width, i / self.width);
            let mut sums = [0.0; N];
            for dy in 0..side {
                let row = clamp(y, dy, self.height) * self.width;
                for dx in 0..side {
                    term(dy * side + dx, self.values[row + clamp(x, dx, self.width)], &mut sums);
                }
            }
            sums
        };
        (0..self.values.len()).map(pixel).collect()
    }
}

/// `f` at the offsets of a square kernel, in pixels.
fn kernel(radius: usize, f: impl Fn(f64, f64) -> f64) -> Vec<f64> {
    let offset = |i: usize| i as f64 - radius as f64;
    let side = 2 * radius + 1;
    (0..side * side).map(|i| f(offset(i % side), offset(i / side))).collect()
}

// ---- Colour ----

/// Exponent that compresses the HyAB distance.
const Q_C: f64 = 0.7;
/// Below this share of the largest distance …
const P_C: f64 = 0.4;
/// … differences fill [0, this], and the rest the remainder.
const P_T: f64 = 0.95;

fn color_difference(test: &Plane, reference: &Plane, pixels_per_degree: f64) -> Vec<f64> {
    // Two Gaussians a channel: amplitudes and widths, for luminance, red–green and blue–yellow.
    const A: [[f64; 2]; 3] = [[1.0, 0.0], [1.0, 0.0], [34.1, 13.5]];
    const B: [[f64; 2]; 3] = [[0.0047, 1e-5], [0.0053, 1e-5], [0.04, 0.025]];
    use std::f64::consts::PI;
    let widest = (0.04 / (2.0 * PI * PI)).sqrt();
    let radius = (3.0 * widest * pixels_per_degree).ceil() as usize;
    let kernels: [Vec<f64>; 3] = std::array::from_fn(|c| {
        let k = kernel(radius, |x, y| {
            let d2 = (x * x + y * y) / (pixels_per_degree * pixels_per_degree);
            (0..2).map(|i| A[c][i] * (PI / B[c][i]).sqrt() * (-PI * PI * d2 / B[c][i]).exp()).sum()
        });
        let sum: f64 = k.iter().sum();
        k.into_iter().map(|v| v / sum).collect()
    });
    let seen = |picture: &Plane| -> Vec<[f64; 3]> {
        let filtered = picture.convolve(radius, |i, pixel, sums: &mut [f64; 3]| {
            for c in 0..3 {
                sums[c] += kernels[c][i] * pixel[c];
            }
        });
        filtered.into_iter().map(|p| hunt_lab(from_opponent(p).map(|v| v.clamp(0.0, 1.0)))).collect()
    };
    let largest = hyab(hunt_lab([0.0, 1.0, 0.0]), hunt_lab([0.0, 0.0, 1.0])).powf(Q_C);
    let redistribute = |error: f64| {
        let knee = P_C * largest;
        if error < knee { P_T / knee * error } else { P_T + (error - knee) / (largest - knee) * (1.0 - P_T) }
    };
    let (test, reference) = (seen(test), seen(reference));
    test.iter().zip(reference).map(|(a, b)| redistribute(hyab(*a, b).powf(Q_C)).min(1.0)).collect()
}

/// City-block in lightness, Euclidean in chroma.
fn hyab(a: [f64; 3], b: [f64; 3]) -> f64 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])
}

// ---- Features ----

/// Width of the eye's feature detectors, degrees.
const W: f64 = 0.082;
/// Exponent of the feature difference.
const Q_F: f64 = 0.5;

fn feature_difference(test: &Plane, reference: &Plane, pixels_per_degree: f64) -> Vec<f64> {
    let sd = 0.5 * W * pixels_per_degree;
    let radius = (3.0 * sd).ceil() as usize;
    let gauss = |x: f64, y: f64| (-(x * x + y * y) / (2.0 * sd * sd)).exp();
    // First and second derivative along x; positive and negative weights sum to 1 each.
    let edge = balanced(kernel(radius, |x, y| -x * gauss(x, y)));
    let point = balanced(kernel(radius, |x, y| (x * x / (sd * sd) - 1.0) * gauss(x, y)));
    let side = 2 * radius + 1;
    let features = |picture: &Plane| -> Vec<[f64; 2]> {
        let found = picture.convolve(radius, |i, pixel, sums: &mut [f64; 4]| {
            let y = (pixel[0] + 16.0) / 116.0;
            let turned = (i % side) * side + i / side;
            for (sum, weight) in sums.iter_mut().zip([edge[i], edge[turned], point[i], point[turned]]) {
                *sum += weight * y;
            }
        });
        found.into_iter().map(|[ex, ey, px, py]| [ex.hypot(ey), px.hypot(py)]).collect()
    };
    let (test, reference) = (features(test), features(reference));
    let difference = |(a, b): (&[f64; 2], [f64; 2])| (a[0] - b[0]).abs().max((a[1] - b[1]).abs());
    test.iter().zip(reference).map(|pair| (difference(pair) / std::f64::consts::SQRT_2).powf(Q_F)).collect()
}

fn balanced(kernel: Vec<f64>) -> Vec<f64> {
    let sum = |sign: f64| kernel.iter().map(|v| (v * sign).max(0.0)).sum::<f64>();
    let (positive, negative) = (sum(1.0), sum(-1.0));
    kernel.into_iter().map(|v| v / if v > 0.0 { positive } else { negative }).collect()
}

// ---- Colour spaces ----

/// From linear sRGB to CIE XYZ, D65.
const TO_XYZ: [[f64; 3]; 3] = [
    [10_135_552.0 / 24_577_794.0, 8_788_810.0 / 24_577_794.0, 4_435_075.0 / 24_577_794.0],
    [2_613_072.0 / 12_288_897.0, 8_788_810.0 / 12_288_897.0, 887_015.0 / 12_288_897.0],
    [1_425_312.0 / 73_733_382.0, 8_788_810.0 / 73_733_382.0, 70_074_185.0 / 73_733_382.0],
];

fn decode(v: f32) -> f64 {
    let v = f64::from(v).clamp(0.0, 1.0);
    if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

fn times(m: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// X, Y, Z as shares of the white point's.
fn xyz(linear: [f64; 3]) -> [f64; 3] {
    let (v, white) = (times(&TO_XYZ, linear), times(&TO_XYZ, [1.0; 3]));
    std::array::from_fn(|i| v[i] / white[i])
}

/// The linearised opponent space Y Cx Cz.
fn opponent(linear: [f64; 3]) -> [f64; 3] {
    let [x, y, z] = xyz(linear);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// The inverse of [`opponent`].
fn from_opponent([y, cx, cz]: [f64; 3]) -> [f64; 3] {
    let y = (y + 16.0) / 116.0;
    let white = times(&TO_XYZ, [1.0; 3]);
    let v = [(cx / 500.0 + y) * white[0], y * white[1], (y - cz / 200.0) * white[2]];
    // Cramer's rule: the matrix is small and fixed.
    let cross = |a: [f64; 3], b: [f64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let [r0, r1, r2] = TO_XYZ;
    let (c0, c1, c2) = (cross(r1, r2), cross(r2, r0), cross(r0, r1));
    let determinant = r0[0] * c0[0] + r0[1] * c0[1] + r0[2] * c0[2];
    std::array::from_fn(|i| (v[0] * c0[i] + v[1] * c1[i] + v[2] * c2[i]) / determinant)
}

/// CIELAB with chroma scaled by lightness (the Hunt effect: colours look stronger in brighter light).
fn hunt_lab(linear: [f64; 3]) -> [f64; 3] {
    let f = |t: f64| {
        let d: f64 = 6.0 / 29.0;
        if t > d * d * d { t.cbrt() } else { t / (3.0 * d * d) + 4.0 / 29.0 }
    };
    let [x, y, z] = xyz(linear).map(f);
    let l = 116.0 * y - 16.0;
    [l, 0.01 * l * 500.0 * (x - y), 0.01 * l * 200.0 * (y - z)]
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 48;
    const HEIGHT: usize = 40;

    fn picture(f: impl Fn(usize, usize, usize) -> u8) -> Vec<f32> {
        let channels = (0..WIDTH * HEIGHT * 3).map(|i| f(i / 3 % WIDTH, i / 3 / WIDTH, i % 3));
        channels.map(|v| f32::from(v) / 255.0).collect()
    }

    /// Gradients over a checkered blue.
    fn reference(x: usize, y: usize, c: usize) -> u8 {
        let blue = (x / 8 + y / 8) % 2 * 200 + 20;
        [x * 5 % 256, y * 6 % 256, blue][c] as u8
    }

    /// The same with scattered wrong channels and a bright square.
    fn damaged(x: usize, y: usize, c: usize) -> u8 {
        if (20..26).contains(&x) && (10..16).contains(&y) {
            return 250;
        }
        let hash = (x * 7919 + y * 104_729) % 97;
        let v = reference(x, y, c);
        if hash < 24 && hash % 3 == c { v.wrapping_add(40) } else { v }
    }

    #[test]
    fn the_authors_own_program_gives_the_same_numbers() {
        // Values of `flip-evaluator` (the authors' program, 2024) for this pair: mean, five pixels, median, 95th percentile.
        for (ppd, mean, points, median, high) in [
            (67.0, 0.228_866, [0.104_712, 0.990_393, 0.138_024, 0.822_391, 0.134_138], 0.193_183, 0.486_608),
            (20.0, 0.230_298, [0.187_313, 0.967_597, 0.041_022, 0.559_539, 0.031_474], 0.155_414, 0.685_767),
        ] {
            let result = flip(&picture(damaged), &picture(reference), WIDTH, ppd);
            assert!((result.mean() - mean).abs() < 2e-5, "{}", result.mean());
            for ((x, y), wanted) in [(0, 0), (22, 12), (47, 39), (19, 10), (30, 5)].into_iter().zip(points) {
                let value = result.values[y * WIDTH + x];
                assert!((value - wanted).abs() < 1e-4, "({x}, {y}) at {ppd}: {value}, not {wanted}");
            }
            assert!((result.percentile(50.0) - median).abs() < 1e-4);
            assert!((result.percentile(95.0) - high).abs() < 1e-4);
        }
    }

    #[test]
    fn single_colours_have_the_differences_the_program_gives() {
        let constant = |rgb: [u8; 3]| picture(|_, _, c| rgb[c]);
        let mean = |a, b| flip(&constant(a), &constant(b), WIDTH, 67.0).mean();
        // The program's 0.967401 has single-precision noise of its kernels in it, which the root of the feature term lifts to 2e-5.
        let white = mean([0; 3], [255; 3]);
        assert!((white - 0.967_401).abs() < 5e-5, "{white}");
        assert!((mean([0, 255, 0], [0, 0, 255]) - 1.0).abs() < 1e-6);
        assert_eq!(mean([30, 80, 200], [30, 80, 200]), 0.0);
    }

    #[test]
    fn a_small_wrong_region_shows_in_the_percentile_and_its_place() {
        let base = picture(|_, _, _| 100);
        let mut wrong = base.clone();
        for y in 30..34 {
            for x in 7..11 {
                wrong[3 * (y * WIDTH + x)] = 1.0;
            }
        }
        let result = flip(&wrong, &base, WIDTH, PIXELS_PER_DEGREE);
        assert!(result.mean() < 0.1 && result.percentile(99.9) > 0.5);
        let (x, y) = result.worst_pixel();
        assert!((6..12).contains(&x) && (29..35).contains(&y), "({x}, {y})");
    }
}
