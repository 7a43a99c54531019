//! The sRGB transfer function (IEC 61966-2-1), both ways.
//!
//! `encode(x) = 12.92 x` for `x ≤ 0.0031308`, otherwise `1.055 x^(1/2.4) − 0.055`; `decode` is its inverse with the
//! standard's rounded threshold 0.04045.

use std::sync::LazyLock;

use crate::math::function;

/// From linear light to the encoded value, both nominally 0 to 1. Values outside are not clipped; negative ones mirror.
pub fn encode(x: f32) -> f32 {
    let a = x.abs();
    let y = if a <= 0.003_130_8 { 12.92 * a } else { 1.055 * function::pow(a, 1.0 / 2.4) - 0.055 };
    y.copysign(x)
}

/// From the encoded value to linear light, both nominally 0 to 1. Values outside are not clipped; negative ones mirror.
pub fn decode(y: f32) -> f32 {
    let a = y.abs();
    let x = if a <= 0.040_45 { a / 12.92 } else { function::pow((a + 0.055) / 1.055, 2.4) };
    x.copysign(y)
}

/// The nearest byte to the encoded value, `⌊255 encode(x) + 1/2⌋`, for `x` in `[0, 1]`: from a table of where each byte begins.
pub fn encode_u8(x: f32) -> u8 {
    ENCODED.at(x)
}

fn encode_u8_by_formula(x: f32) -> u8 {
    (encode(x) * 255.0 + 0.5) as u8
}

static ENCODED: LazyLock<Encoded> = LazyLock::new(Encoded::new);

/// Where each byte begins. An octave of floats is cut into 256 pieces, so short that at most one byte begins in each.
struct Encoded {
    /// Byte at the lower end of each piece.
    bytes: Vec<u8>,
    /// The least float that becomes this byte, as bits, which order floats above zero; none becomes 256.
    first: [u32; 257],
}

impl Encoded {
    /// Floats of one piece have these low bits of their own.
    const SHIFT: u32 = 15;
    /// 2⁻¹³, below which everything is 0.
    const SMALLEST: u32 = 114 << 23;

    fn new() -> Self {
        let one = 1f32.to_bits();
        let mut first = [u32::MAX; 257];
        first[0] = 0;
        for (byte, first) in (1..=255u8).zip(&mut first[1..]) {
            let (mut below, mut from) = (Self::SMALLEST, one);
            while from - below > 1 {
                let middle = below + (from - below) / 2;
                *if encode_u8_by_formula(f32::from_bits(middle)) < byte { &mut below } else { &mut from } = middle;
            }
            *first = from;
        }
        let pieces = (Self::SMALLEST..=one).step_by(1 << Self::SHIFT);
        Self { bytes: pieces.map(|bits| encode_u8_by_formula(f32::from_bits(bits))).collect(), first }
    }

    fn at(&self, x: f32) -> u8 {
        if x.is_nan() || x < f32::from_bits(Self::SMALLEST) {
            return 0;
        }
        let bits = x.min(1.0).to_bits();
        let byte = self.bytes[((bits - Self::SMALLEST) >> Self::SHIFT) as usize];
        byte + u8::from(bits >= self.first[usize::from(byte) + 1])
    }
}

/// Linear light for each encoded byte.
static BYTES: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|i| {
        let y = i as f64 / 255.0;
        (if y <= 0.040_45 { y / 12.92 } else { function::pow_f64((y + 0.055) / 1.055, 2.4) }) as f32
    })
});

/// Linear light of an encoded byte, from a table.
pub fn decode_u8(byte: u8) -> f32 {
    BYTES[usize::from(byte)]
}

/// The table behind [`decode_u8`], for loops that look up many.
pub fn byte_table() -> &'static [f32; 256] {
    &BYTES
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_values_of_the_standard_come_out() {
        // Middle grey: 0.5 encoded is 0.2140411 linear; 0.18 linear is 0.4613561 encoded.
        assert!((decode(0.5) - 0.214_041_1).abs() < 1e-6);
        assert!((encode(0.18) - 0.461_356_1).abs() < 1e-6);
        assert_eq!((encode(0.0), encode(-0.0).to_bits()), (0.0, (-0.0f32).to_bits()));
        assert!((encode(1.0) - 1.0).abs() < 1e-6 && (decode(1.0) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn the_table_of_bytes_says_what_the_formula_says() {
        // Around where each byte begins, the ends of all pieces, and a sweep.
        let around = |bits: u32| bits.saturating_sub(64)..=bits + 64;
        let beginnings = ENCODED.first[1..256].iter().copied().flat_map(around);
        let pieces = (0..=1f32.to_bits()).step_by(1 << Encoded::SHIFT).flat_map(|bits| [bits.saturating_sub(1), bits]);
        let sweep = (0..=1f32.to_bits()).step_by(997);
        for x in beginnings.chain(pieces).chain(sweep).map(f32::from_bits).filter(|&x| x <= 1.0) {
            assert_eq!(encode_u8(x), encode_u8_by_formula(x), "{x}");
        }
        assert_eq!([-0.0, f32::NAN, 0.0].map(encode_u8), [0; 3]);
    }

    #[test]
    fn every_byte_survives_the_round_trip() {
        for i in 0..=255u8 {
            assert_eq!((encode(decode_u8(i)) * 255.0).round() as u8, i);
            assert!((decode(f32::from(i) / 255.0) - decode_u8(i)).abs() < 2e-7);
        }
    }
}
