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
    fn every_byte_survives_the_round_trip() {
        for i in 0..=255u8 {
            assert_eq!((encode(decode_u8(i)) * 255.0).round() as u8, i);
            assert!((decode(f32::from(i) / 255.0) - decode_u8(i)).abs() < 2e-7);
        }
    }
}
