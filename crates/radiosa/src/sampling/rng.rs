//! Random numbers as a function of their place: counter-based streams.
//!
//! A stream is a key, hashed from (seed, pixel, sample), and a counter, the dimension. The k-th number is a 64-bit mixing of
//! `key + k γ`: the generator SplitMix64 [Steele14], whose streams here start at hashed, unrelated points. So a number never
//! depends on which thread asks for it or on what was drawn elsewhere, and any dimension can be had without the ones before.

use crate::math::Vec2;

/// The golden ratio in 64 bits, odd: steps of the counter.
const GAMMA: u64 = 0x9E37_79B9_7F4A_7C15;

/// Mixes 64 bits so that each output bit depends on every input bit; a bijection (the finaliser "Mix13" of [Stafford11]).
pub fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// The bits of number `n` of the stream that `key` names.
pub fn nth(key: u64, n: u64) -> u64 {
    mix(key.wrapping_add(n.wrapping_mul(GAMMA)))
}

/// One key from several numbers; their order matters.
pub fn key(parts: &[u64]) -> u64 {
    parts.iter().fold(GAMMA, |key, part| mix(key ^ mix(part.wrapping_add(GAMMA))).wrapping_add(GAMMA))
}

/// The top 24 bits as a number in `[0, 1)`: every result is exact, and one never appears.
pub fn unit_f32(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// The random numbers of one camera sample.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stream {
    key: u64,
    dimension: u64,
    /// Of the pixel, the same for all its samples.
    pixel: u64,
    sample: u32,
}

impl Stream {
    /// From the start.
    pub fn new(seed: u64, pixel: u64, sample: u64) -> Self {
        Self { key: key(&[seed, pixel, sample]), dimension: 0, pixel: key(&[seed, pixel]), sample: sample as u32 }
    }

    /// Of a pixel that stands at `place` of a curve through all pixels (`sequence::along_curve`), whose sets of low-discrepancy points continue those of the pixels before it, `1 << bits` samples
    /// in each: the errors of neighbours cancel, as far as their light is alike. Source: [Ahmed20].
    pub fn along_curve(seed: u64, pixel: u64, sample: u64, place: u64, bits: u32) -> Self {
        let within = sample & ((1 << bits) - 1);
        // Samples beyond are of other sets.
        let set = key(&[seed, u64::MAX, sample >> bits]);
        Self { key: key(&[seed, pixel, sample]), dimension: 0, pixel: set, sample: (place << bits | within) as u32 }
    }

    /// The next `n` points of a low-discrepancy set that all samples of the pixel share, so that together they are even, too: the key of the set and
    /// the first of the points, for [`sequence`](super::sequence).
    pub fn next_set(&mut self, n: u32) -> (u64, u32) {
        let key = nth(self.pixel, self.dimension);
        self.dimension += 1;
        (key, self.sample.wrapping_mul(n))
    }

    /// The streams of the `n` parts into which a sample branches: together they are those of `n` times as many samples.
    pub fn branches(&mut self, n: u32) -> impl Iterator<Item = Self> + use<> {
        let (pixel, start) = self.next_set(n);
        (0..n).map(move |i| {
            let sample = start.wrapping_add(i);
            Self { key: key(&[pixel, u64::from(sample)]), dimension: 0, pixel, sample }
        })
    }

    /// The bits of any dimension.
    pub fn bits(&self, dimension: u64) -> u64 {
        nth(self.key, dimension)
    }

    /// The next 32 bits.
    pub fn next_u32(&mut self) -> u32 {
        let bits = self.bits(self.dimension);
        self.dimension += 1;
        (bits >> 32) as u32
    }

    /// The next number, uniform in `[0, 1)`.
    pub fn next_f32(&mut self) -> f32 {
        unit_f32(self.next_u32())
    }

    /// The next point of the unit square.
    pub fn next_2d(&mut self) -> Vec2 {
        let bits = self.bits(self.dimension);
        self.dimension += 1;
        Vec2::new(unit_f32((bits >> 32) as u32), unit_f32(bits as u32))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_never_appears() {
        assert!(unit_f32(u32::MAX) < 1.0);
        assert_eq!(unit_f32(0), 0.0);
    }

    #[test]
    fn a_number_depends_on_seed_pixel_sample_and_dimension_alone() {
        let mut a = Stream::new(1, 2, 3);
        let first: Vec<u32> = (0..8).map(|_| a.next_u32()).collect();
        let b = Stream::new(1, 2, 3);
        assert!((0..8).all(|k| (b.bits(k) >> 32) as u32 == first[k as usize]));
        for other in [Stream::new(2, 2, 3), Stream::new(1, 3, 2), Stream::new(1, 3, 3), Stream::new(1, 2, 4)] {
            assert_ne!(other.bits(0), b.bits(0));
        }
    }

    #[test]
    fn samples_of_a_pixel_share_their_sets() {
        let sets = |pixel: u64, sample: u64| {
            let mut stream = Stream::new(1, pixel, sample);
            [stream.next_set(8), stream.next_set(3)]
        };
        let (a, b) = (sets(5, 0), sets(5, 2));
        assert_eq!([a[0].0, a[1].0], [b[0].0, b[1].0]);
        assert_eq!([a[0].1, a[1].1, b[0].1, b[1].1], [0, 0, 16, 6]);
        assert_ne!(a[0].0, a[1].0);
        assert_ne!(a[0].0, sets(6, 0)[0].0);
    }

    #[test]
    fn branches_of_a_pixels_samples_share_one_set() {
        let of = |sample: u64| -> Vec<(u64, u32)> {
            Stream::new(1, 5, sample).branches(3).map(|mut branch| branch.next_set(1)).collect()
        };
        let (a, b) = (of(0), of(2));
        assert!(a.iter().chain(&b).all(|(key, _)| *key == a[0].0));
        assert_eq!(a.iter().chain(&b).map(|set| set.1).collect::<Vec<_>>(), [0, 1, 2, 6, 7, 8]);
        let first: Vec<u64> = Stream::new(1, 5, 0).branches(3).map(|branch| branch.bits(0)).collect();
        assert!(first[0] != first[1] && first[1] != first[2]);
    }

    #[test]
    fn neighbouring_streams_are_uncorrelated() {
        // The first numbers of adjacent pixels: their correlation over 2¹⁶ pairs is within 4 sigma of zero (false alarm 6e-5).
        let n = 1 << 16;
        let x: Vec<f64> = (0..n + 1).map(|p| f64::from(Stream::new(7, p, 0).next_f32()) - 0.5).collect();
        let correlation = 12.0 * x.windows(2).map(|w| w[0] * w[1]).sum::<f64>() / n as f64;
        assert!(correlation.abs() < 4.0 / (n as f64).sqrt(), "{correlation}");
        let mean = x.iter().sum::<f64>() / n as f64;
        assert!(mean.abs() < 4.0 / (12.0 * n as f64).sqrt(), "{mean}");
    }
}
