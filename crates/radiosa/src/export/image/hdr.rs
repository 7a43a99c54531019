//! Radiance HDR (RGBE), as Ward describes it: a text header, then scan lines with each channel run-length encoded.
//!
//! `value = mantissa · 2^(exponent − 136)`, the mantissas rounded to the nearest. Radiance itself adds a half to each
//! mantissa when it reads; most others do not, and neither does our own reader.

use std::io::{self, BufRead, Write};

use super::recipe::{PREFIX, Recipe, escape_line, unescape_line};
use crate::film::{Film, Layer};
use crate::spectrum::Spectrum;

/// Writes the film's colour.
pub(super) fn write(film: &Film, out: &mut impl Write, recipe: &Recipe) -> io::Result<()> {
    writeln!(out, "#?RADIANCE")?;
    writeln!(out, "SOFTWARE=Radiosa {}", env!("CARGO_PKG_VERSION"))?;
    for (key, text) in recipe.entries() {
        writeln!(out, "{PREFIX}{key}={}", escape_line(text))?;
    }
    if let Some(view) = recipe.get("view") {
        writeln!(out, "VIEW= {}", escape_line(view))?;
    }
    writeln!(out, "EXPOSURE=1")?;
    writeln!(out, "PRIMARIES=0.64 0.33 0.3 0.6 0.15 0.06 0.3127 0.329")?;
    writeln!(out, "FORMAT=32-bit_rle_rgbe\n")?;
    writeln!(out, "-Y {} +X {}", film.height(), film.width())?;

    let width = film.width() as usize;
    let color = film.triple(Layer::Color);
    let mut bytes = Vec::new();
    let mut planes: [Vec<u8>; 4] = std::array::from_fn(|_| vec![0; width]);
    for y in 0..film.height() as usize {
        for x in 0..width {
            let light = color.map_or(Spectrum::BLACK, |c| c.at(y * width + x));
            for (plane, byte) in planes.iter_mut().zip(to_rgbe(light)) {
                plane[x] = byte;
            }
        }
        bytes.clear();
        if (8..32_768).contains(&width) {
            bytes.extend_from_slice(&[2, 2, (width >> 8) as u8, (width & 255) as u8]);
            planes.iter().for_each(|plane| run_length_encode(plane, &mut bytes));
        } else {
            // Such widths have no run-length form.
            (0..width).for_each(|x| bytes.extend(planes.iter().map(|p| p[x])));
        }
        out.write_all(&bytes)?;
    }
    Ok(())
}

/// Mantissas and shared exponent of a colour. Negative light and NaN become 0, what is too bright becomes the largest.
fn to_rgbe(light: Spectrum) -> [u8; 4] {
    // The largest number the format has is 255 · 2^(255 − 136); f32 ends a little above, at 2^128.
    let light = light.map(|v| if v > 0.0 { v.min(1.69e38) } else { 0.0 });
    let largest = light.max_channel();
    if largest < 1e-32 {
        return [0; 4];
    }
    // `largest` is in [2^(e−1), 2^e), so that its mantissa is in [128, 256).
    let mut e = libm::ilogbf(largest) + 1;
    let mantissa = |v: f32, e: i32| libm::scalbnf(v, 8 - e).round();
    if mantissa(largest, e) > 255.0 {
        e += 1;
    }
    let [r, g, b] = light.to_array().map(|v| mantissa(v, e).min(255.0) as u8);
    [r, g, b, (e + 128).clamp(0, 255) as u8]
}

/// Runs of at least four equal bytes as (128 + length, byte), the rest as (length, bytes …).
fn run_length_encode(plane: &[u8], out: &mut Vec<u8>) {
    let run_at = |i: usize| plane[i..].iter().take(127).take_while(|&&b| b == plane[i]).count();
    let mut i = 0;
    while i < plane.len() {
        let run = run_at(i);
        if run >= 4 {
            out.extend_from_slice(&[128 + run as u8, plane[i]]);
            i += run;
            continue;
        }
        let start = i;
        while i < plane.len() && i - start < 128 && run_at(i) < 4 {
            i += 1;
        }
        out.push((i - start) as u8);
        out.extend_from_slice(&plane[start..i]);
    }
}

/// The entries in the header.
pub(super) fn read_recipe(file: impl BufRead) -> Result<Recipe, String> {
    let mut recipe = Recipe::new();
    let mut file = file.take(1 << 20);
    let mut line = Vec::new();
    for number in 0.. {
        line.clear();
        if file.read_until(b'\n', &mut line).map_err(|e| e.to_string())? == 0 {
            return Err("its header has no end".into());
        }
        if number == 0 && !line.starts_with(b"#?") {
            return Err("it is not a Radiance picture".into());
        }
        let text = String::from_utf8_lossy(&line);
        let text = text.trim_end_matches(['\n', '\r']);
        if text.is_empty() {
            break;
        }
        if let Some((key, value)) = text.strip_prefix(PREFIX).and_then(|rest| rest.split_once('=')) {
            recipe.set(key, unescape_line(value));
        }
    }
    Ok(recipe)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shared_exponent_has_the_values_of_the_format() {
        // 1 = 128 · 2^(129 − 136); 0.5 and 0.25 share that exponent.
        assert_eq!(to_rgbe(Spectrum::new(1.0, 0.5, 0.25)), [128, 64, 32, 129]);
        // Rounding up to 256 moves to the next exponent instead of overflowing.
        assert_eq!(to_rgbe(Spectrum::gray(0.999_9)), [128, 128, 128, 129]);
        assert_eq!(to_rgbe(Spectrum::new(-1.0, f32::NAN, 0.0)), [0; 4]);
        assert_eq!(to_rgbe(Spectrum::new(f32::INFINITY, 0.0, f32::MAX))[3], 255);
    }

    #[test]
    fn runs_are_coded_and_single_bytes_are_listed() {
        let mut out = Vec::new();
        run_length_encode(&[7, 7, 7, 7, 7, 1, 2, 3, 3], &mut out);
        assert_eq!(out, [133, 7, 4, 1, 2, 3, 3]);
        out.clear();
        run_length_encode(&[9; 300], &mut out);
        assert_eq!(out, [255, 9, 255, 9, 174, 9]);
    }
}
