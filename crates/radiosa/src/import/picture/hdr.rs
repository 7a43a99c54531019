//! Radiance HDR, as its author describes it (Ward, *Real Pixels*, Graphics Gems II, and the file-format page of Radiance).
//!
//! A text header of lines up to an empty one, a line with the two axes, then scan lines of four bytes a pixel: flat, or with runs
//! in the old form (1, 1, 1, count), or with each channel's runs apart. `value = mantissa · 2^(exponent − 136)`.
//!
//! What `EXPOSURE=` and `COLORCORR=` lines say was multiplied in is divided out again, so that the values are the scene's. As in most
//! other readers no half is added to the mantissas (see the writer).

use std::sync::Arc;

use super::primaries::Primaries;
use super::{Picture, Source, finite, zeroed};
use crate::import::ImportError;
use crate::scene::Pixels;
use crate::spectrum::Spectrum;

/// The most pixels a byte can stand for in a picture made in earnest: one of a single colour in the old form takes three or
/// four counts a line, whatever the line's length.
const PIXELS_PER_BYTE: u64 = 4096;

/// What the header says.
struct Header {
    /// Multiply by these to have the scene's values.
    scale: Spectrum,
    is_xyz: bool,
    axes: Axes,
    /// Where the scan lines start.
    pixels: usize,
}

/// How scan lines lie in the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Axes {
    /// Scan lines are columns.
    transposed: bool,
    /// x grows to the left along the file's order.
    flip_x: bool,
    /// y grows upwards along the file's order.
    flip_y: bool,
    width: u64,
    height: u64,
}

/// Reads one.
pub(super) fn read(source: &Source) -> Result<Picture, ImportError> {
    let header = header(source)?;
    let axes = header.axes;
    let (width, height) = source.check_size(axes.width, axes.height, 16, PIXELS_PER_BYTE)?;
    let (n_lines, length) = if axes.transposed { (width, height) } else { (height, width) };

    let conversion = if header.is_xyz { Primaries::XYZ.to_rec_709() } else { None };
    let mut pixels = zeroed(4 * width as usize * height as usize);
    let out = Arc::get_mut(&mut pixels).unwrap_or_default(); // not shared yet
    let mut line = vec![[0u8; 4]; length as usize];
    let mut bytes = &source.bytes[header.pixels..];
    for i in 0..n_lines as usize {
        read_line(&mut bytes, &mut line)
            .ok_or_else(|| source.damaged(format_args!("it ends or breaks in scan line {} of {n_lines}", i + 1)))?;
        for (j, &rgbe) in line.iter().enumerate() {
            let (x, y) = if axes.transposed { (i, j) } else { (j, i) };
            let x = if axes.flip_x { width as usize - 1 - x } else { x };
            let y = if axes.flip_y { height as usize - 1 - y } else { y };
            let mut light = from_rgbe(rgbe);
            if let Some(conversion) = conversion {
                light = conversion.apply(light);
            }
            let [r, g, b] = (light * header.scale).map(finite).to_array();
            out[4 * (y * width as usize + x)..][..4].copy_from_slice(&[r, g, b, 1.0]);
        }
    }
    Ok(Picture { width, height, pixels: Pixels::Rgba32F(pixels) })
}

fn header(source: &Source) -> Result<Header, ImportError> {
    let mut at = 0;
    let mut next_line = || -> Option<String> {
        let rest = source.bytes.get(at..)?;
        // No line of a header is this long; a file that is no picture should not be searched to its end.
        let end = rest.iter().take(1 << 16).position(|&b| b == b'\n')?;
        at += end + 1;
        Some(String::from_utf8_lossy(&rest[..end]).trim_end_matches('\r').to_owned())
    };
    let unended = || source.damaged("its header has no end");

    let mut scale = Spectrum::WHITE;
    let mut is_xyz = false;
    loop {
        let line = next_line().ok_or_else(unended)?;
        if line.is_empty() {
            break;
        }
        // Lines that begin with a blank are remarks of programs that the picture went through, each with its own header.
        let Some((name, value)) = line.split_once('=') else { continue };
        let positive = |v: &str| v.parse::<f32>().ok().filter(|v| *v > 0.0 && v.is_finite());
        match name {
            "FORMAT" => match value.trim() {
                "32-bit_rle_rgbe" => is_xyz = false,
                "32-bit_rle_xyze" => is_xyz = true,
                other => return Err(source.damaged(format_args!("its FORMAT is {other:?}"))),
            },
            "EXPOSURE" => {
                let exposure = positive(value.trim())
                    .ok_or_else(|| source.damaged(format_args!("its EXPOSURE is {:?}, not a number above 0", value.trim())))?;
                scale = scale / exposure;
            }
            "COLORCORR" => {
                let factors: Option<Vec<f32>> = value.split_whitespace().map(positive).collect();
                if let Some([r, g, b]) = factors.as_deref() {
                    scale = Spectrum::new(scale.r / r, scale.g / g, scale.b / b);
                }
            }
            _ => {}
        }
    }
    let line = next_line().ok_or_else(unended)?;
    let axes = axes(&line).ok_or_else(|| source.damaged(format_args!("its size {line:?} is not of the form -Y 512 +X 1024")))?;
    Ok(Header { scale, is_xyz, axes, pixels: at })
}

/// `-Y height +X width` is the usual order, rows from the top and pixels from the left; the first axis is that of scan lines.
fn axes(line: &str) -> Option<Axes> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let [first, n_first, second, n_second] = words[..] else { return None };
    let (n_first, n_second) = (n_first.parse().ok()?, n_second.parse().ok()?);
    let flip_x = [first, second].contains(&"-X");
    let flip_y = [first, second].contains(&"+Y");
    match (first, second) {
        ("-Y" | "+Y", "-X" | "+X") => Some(Axes { transposed: false, flip_x, flip_y, width: n_second, height: n_first }),
        ("-X" | "+X", "-Y" | "+Y") => Some(Axes { transposed: true, flip_x, flip_y, width: n_first, height: n_second }),
        _ => None,
    }
}

/// Takes `n` bytes off the front.
fn take<'a>(bytes: &mut &'a [u8], n: usize) -> Option<&'a [u8]> {
    let (head, rest) = bytes.split_at_checked(n)?;
    *bytes = rest;
    Some(head)
}

/// Fills one scan line; `None` when the bytes end or a run leaves the line.
fn read_line(bytes: &mut &[u8], line: &mut [[u8; 4]]) -> Option<()> {
    let length = line.len();
    match bytes.get(..4)? {
        &[2, 2, hi, lo] if hi < 128 && (8..32_768).contains(&length) => {
            if usize::from(hi) << 8 | usize::from(lo) != length {
                return None;
            }
            take(bytes, 4)?;
            (0..4).try_for_each(|channel| read_channel(bytes, line, channel))
        }
        _ => read_flat_or_old(bytes, line),
    }
}

/// One channel of a scan line in the new form.
fn read_channel(bytes: &mut &[u8], line: &mut [[u8; 4]], channel: usize) -> Option<()> {
    let mut x = 0;
    while x < line.len() {
        let count = usize::from(take(bytes, 1)?[0]);
        if count > 128 {
            let value = take(bytes, 1)?[0];
            line.get_mut(x..x + count - 128)?.iter_mut().for_each(|p| p[channel] = value);
            x += count - 128;
        } else {
            let values = take(bytes, count)?;
            // A count of zero says nothing; the byte it takes keeps this loop finite.
            line.get_mut(x..x + count)?.iter_mut().zip(values).for_each(|(p, v)| p[channel] = *v);
            x += count;
        }
    }
    Some(())
}

/// A scan line of plain pixels, in which (1, 1, 1, n) repeats the last pixel n times; several of those in a row are the digits, lowest
/// first, of a count to the base 256.
fn read_flat_or_old(bytes: &mut &[u8], line: &mut [[u8; 4]]) -> Option<()> {
    let mut x = 0;
    let mut shift = 0;
    while x < line.len() {
        let &[r, g, b, e] = take(bytes, 4)? else { return None };
        if (r, g, b) == (1, 1, 1) {
            let count = usize::from(e).checked_shl(shift).filter(|_| shift < 32)?;
            let last = *line.get(x.checked_sub(1)?)?;
            line.get_mut(x..x.checked_add(count)?)?.fill(last);
            x += count;
            shift += 8;
        } else {
            line[x] = [r, g, b, e];
            x += 1;
            shift = 0;
        }
    }
    Some(())
}

fn from_rgbe([r, g, b, e]: [u8; 4]) -> Spectrum {
    if e == 0 {
        return Spectrum::BLACK;
    }
    Spectrum::new(r.into(), g.into(), b.into()).map(|m| libm::scalbnf(m, i32::from(e) - 136))
}
