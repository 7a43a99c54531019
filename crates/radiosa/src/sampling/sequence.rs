//! Points that fill the square more evenly than chance: the (0,2)-sequence of Sobol, Owen-scrambled by hashing [Burley20].
//!
//! The first 2^k points put exactly one in every elementary interval of area 2^−k; scrambling keeps that, makes every point uniform
//! and sets of different keys independent. Estimates of smooth integrands err by n^(−3/2) rather than n^(−1/2).

use super::rng::{self, unit_f32};
use crate::math::Vec2;

/// Direction numbers of one dimension of Sobol's sequence, as 32-bit fractions: bit k of an index adds the k-th.
type Directions = [u32; 32];

/// `v_k = v_(k−1) ⊕ v_(k−1)/2`: the second dimension.
const SECOND: Directions = directions(&[1 << 31], &[1]);
/// Primitive polynomials x² + x + 1 and x³ + x + 1, initial numbers 1, 3 and 1, 3, 1 [Joe08]:
/// `v_k = v_(k−1) ⊕ v_(k−2) ⊕ v_(k−2)/4`, and `v_k = v_(k−2) ⊕ v_(k−3) ⊕ v_(k−3)/8`.
const THIRD: Directions = directions(&[1 << 31, 3 << 30], &[1, 2]);
const FOURTH: Directions = directions(&[1 << 31, 3 << 30, 1 << 29], &[2, 3]);

/// From the first of them and the terms of the recurrence: how far each reaches back. The longest comes once more, shifted by itself.
const fn directions(first: &[u32], back: &[usize]) -> Directions {
    let mut v = [0; 32];
    let mut k = 0;
    while k < 32 {
        if k < first.len() {
            v[k] = first[k];
        } else {
            let longest = first.len();
            v[k] = v[k - longest] >> longest;
            let mut term = 0;
            while term < back.len() {
                v[k] ^= v[k - back[term]];
                term += 1;
            }
        }
        k += 1;
    }
    v
}

/// What the four bytes of an index add, its last bit first.
static BYTES: [[[u32; 256]; 4]; 3] = [by_byte(SECOND), by_byte(THIRD), by_byte(FOURTH)];

const fn by_byte(v: Directions) -> [[u32; 256]; 4] {
    let mut table = [[0; 256]; 4];
    let mut k = 0;
    while k < 4 * 256 {
        let (byte, value) = (k / 256, k % 256);
        let mut bit = 0;
        while bit < 8 {
            if value >> bit & 1 == 1 {
                table[byte][value] ^= v[8 * byte + bit].reverse_bits();
            }
            bit += 1;
        }
        k += 1;
    }
    table
}

/// One of the dimensions behind the first, from 0, its last bit first.
fn dimension(which: usize, index: u32) -> u32 {
    index.to_le_bytes().iter().zip(&BYTES[which]).fold(0, |sum, (byte, table)| sum ^ table[*byte as usize])
}

/// The first two dimensions of Sobol's sequence, as 32-bit fractions whose last bit comes first: so they are scrambled.
fn sobol(index: u32) -> [u32; 2] {
    [index, dimension(0, index)]
}

/// The third and fourth dimension.
fn sobol_more(index: u32) -> [u32; 2] {
    [dimension(1, index), dimension(2, index)]
}

/// Nested uniform (Owen) scrambling of a 32-bit fraction whose last bit comes first: flips each bit by a hash of the bits above it. Returns it the right way round.
fn scramble(reversed: u32, seed: u32) -> u32 {
    let mut x = reversed.wrapping_add(seed);
    for multiplier in [0x6C50_B47C_u32, 0xB82F_1E52, 0xC7AF_E638, 0x8D22_F6E6] {
        x ^= x.wrapping_mul(multiplier);
    }
    x.reverse_bits()
}

/// Point `index` of the two-dimensional set that `key` names. Sets of different keys are independent, in their order too, so they can be
/// padded to any number of dimensions.
pub fn point_2d(index: u32, key: u64) -> Vec2 {
    let order = (rng::mix(key) >> 32) as u32;
    let seeds = rng::mix(key ^ 0x5851_F42D_4C95_7F2D);
    let [x, y] = sobol(scramble(index.reverse_bits(), order));
    Vec2::new(unit_f32(scramble(x, (seeds >> 32) as u32)), unit_f32(scramble(y, seeds as u32)))
}

/// Point `index` of the four-dimensional set that `key` names: what a ray from somewhere of a surface to somewhere needs. The first two dimensions
/// are as even as those of [`point_2d`], and so are, nearly, the last two and all four together.
pub fn point_4d(index: u32, key: u64) -> [Vec2; 2] {
    let index = scramble(index.reverse_bits(), (rng::mix(key) >> 32) as u32);
    let seeds = [0x5851_F42D_4C95_7F2D, 0x1405_7B7E_F767_814F].map(|word| rng::mix(key ^ word));
    let pair =
        |[x, y]: [u32; 2], seed: u64| Vec2::new(unit_f32(scramble(x, (seed >> 32) as u32)), unit_f32(scramble(y, seed as u32)));
    [pair(sobol(index), seeds[0]), pair(sobol_more(index), seeds[1])]
}

/// Where sample `sample` of `n_samples` falls in its pixel, in `[0, 1)²`: the centre when there is only one, else well distributed over the
/// pixel, differently in each.
pub fn pixel_sample(seed: u64, pixel: u32, sample: u32, n_samples: u32) -> Vec2 {
    if n_samples <= 1 {
        return Vec2::splat(0.5);
    }
    point_2d(sample, rng::key(&[seed, u64::from(pixel), 0x0070_6978_656C]))
}

/// The place of a pixel on Morton's curve, which goes through every square of `2^k × 2^k` pixels before the next.
pub fn along_curve(x: u32, y: u32) -> u64 {
    // Room for a zero behind each bit.
    let spread = |v: u32| {
        let mut v = u64::from(v);
        for (shift, mask) in [
            (16, 0x0000_FFFF_0000_FFFF),
            (8, 0x00FF_00FF_00FF_00FF),
            (4, 0x0F0F_0F0F_0F0F_0F0F),
            (2, 0x3333_3333_3333_3333),
            (1, 0x5555_5555_5555_5555),
        ] {
            v = (v | v << shift) & mask;
        }
        v
    };
    spread(x) | spread(y) << 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_goes_through_every_square_before_the_next() {
        let places = |side: u32| (0..side * side).map(move |i| along_curve(i % side, i / side)).max();
        for k in 0..7 {
            assert_eq!(places(1 << k), Some((1 << (2 * k)) - 1));
        }
        assert_eq!((along_curve(3, 5), along_curve(u32::MAX, u32::MAX)), (0b10_0111, u64::MAX));
    }

    #[test]
    fn the_sequence_is_as_tabulated() {
        // The first points of the four dimensions [Joe08], in the order of their indices' binary digits.
        let half = |x: f64| (x * 4_294_967_296.0) as u32;
        let expected = [
            [0.0, 0.0, 0.0, 0.0],
            [0.5, 0.5, 0.5, 0.5],
            [0.25, 0.75, 0.75, 0.75],
            [0.75, 0.25, 0.25, 0.25],
            [0.125, 0.625, 0.375, 0.125],
            [0.625, 0.125, 0.875, 0.625],
        ];
        for (index, expected) in expected.iter().enumerate() {
            let [a, b] = sobol(index as u32);
            let [c, d] = sobol_more(index as u32);
            assert_eq!([a, b, c, d].map(u32::reverse_bits), expected.map(half), "index {index}");
        }
        // Beyond what tables of one byte hold, against the recurrence itself.
        let slow = |index: u32| (0..32).filter(|k| index >> k & 1 == 1).fold(0, |sum, k| sum ^ FOURTH[k]);
        assert!([257, 65_536, 0xDEAD_BEEF].iter().all(|&index| sobol_more(index)[1].reverse_bits() == slow(index)));
    }

    /// The number of elementary intervals of area 1/n that do not hold exactly one of n points.
    fn violations(points: &[Vec2]) -> usize {
        let n = points.len();
        let k = n.trailing_zeros();
        (0..=k)
            .map(|a| {
                let (across, down) = (1 << a, 1 << (k - a));
                let mut count = vec![0; n];
                for p in points {
                    count[(p.y * down as f32) as usize * across + (p.x * across as f32) as usize] += 1;
                }
                count.iter().filter(|&&c| c != 1).count()
            })
            .sum()
    }

    #[test]
    fn every_elementary_interval_holds_one_point() {
        for key in 0..20 {
            let points: Vec<_> = (0..256).map(|i| point_2d(i, key)).collect();
            assert_eq!(violations(&points), 0, "key {key}");
        }
        // The twin: independent random points are caught.
        let mut stream = rng::Stream::new(1, 2, 3);
        let random: Vec<_> = (0..256).map(|_| stream.next_2d()).collect();
        assert!(violations(&random) > 100);
    }

    #[test]
    fn all_dimensions_of_four_are_stratified_and_products_of_them_converge_faster_than_chance() {
        for key in 0..20 {
            let points: Vec<_> = (0..256).map(|i| point_4d(i, key)).collect();
            assert_eq!(violations(&points.iter().map(|p| p[0]).collect::<Vec<_>>()), 0, "key {key}");
            for axis in [|p: &[Vec2; 2]| p[1].x, |p: &[Vec2; 2]| p[1].y] {
                let mut cells: Vec<u32> = points.iter().map(|p| (axis(p) * 256.0) as u32).collect();
                cells.sort_unstable();
                assert!(cells.iter().enumerate().all(|(i, &c)| c == i as u32), "key {key}");
            }
        }
        // ∫ Π (x_k + ½) = 1 over the four dimensions, which no sum over fewer of them is.
        let rms = |n: u32| {
            let squares = (0..64).map(|key| {
                let product = |p: [Vec2; 2]| f64::from((p[0] + 0.5).element_product() * (p[1] + 0.5).element_product());
                ((0..n).map(|i| product(point_4d(i, key))).sum::<f64>() / f64::from(n) - 1.0).powi(2)
            });
            (squares.sum::<f64>() / 64.0).sqrt()
        };
        let slope = (rms(4096) / rms(64)).ln() / 64f64.ln();
        assert!(slope < -1.0, "slope {slope}");
    }

    #[test]
    fn the_error_of_a_smooth_integral_falls_faster_than_chance() {
        // ∫∫ x² y dx dy = 1/6; root mean square error over 64 keys at two sizes, slope of log error by log n.
        let rms = |n: u32| {
            let squares = (0..64).map(|key| {
                let mean = (0..n).map(|i| point_2d(i, key)).map(|p| f64::from(p.x * p.x * p.y)).sum::<f64>() / f64::from(n);
                (mean - 1.0 / 6.0).powi(2)
            });
            (squares.sum::<f64>() / 64.0).sqrt()
        };
        let slope = (rms(1024) / rms(16)).ln() / 64f64.ln();
        assert!((-1.7..-1.3).contains(&slope), "slope {slope}");
    }
}
