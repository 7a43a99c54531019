//! PNG, JPEG and WebP: encoded integers, kept as they are.

use std::io::Cursor;

use image::{ColorType, DynamicImage, ImageDecoder, ImageError, Limits};

use super::kind::Kind;
use super::{Picture, Source};
use crate::import::ImportError;
use crate::scene::Pixels;

/// The most pixels a byte can stand for. Deflate repeats at most 258 bytes with two bits, so a byte holds 1032 of them. A JPEG spends
/// at least a bit on a block of 64 pixels in each scan; twice that, for chroma at a quarter of the size and restarts. A WebP of one
/// colour spends next to nothing on a pixel, but cannot be larger than 16 383 squared.
fn pixels_per_byte(bytes: &[u8]) -> u64 {
    match Kind::of(bytes) {
        Kind::Png => (8 * 1032 / png_bits_per_pixel(bytes)).max(1),
        Kind::Jpeg => 1024,
        _ => u64::MAX,
    }
}

/// What the header of a PNG says a pixel takes; 1 where it says nothing sensible, which its decoder will find out.
fn png_bits_per_pixel(bytes: &[u8]) -> u64 {
    let (Some(&depth), Some(&color)) = (bytes.get(24), bytes.get(25)) else { return 1 };
    let channels = match color {
        2 => 3,
        4 => 2,
        6 => 4,
        _ => 1,
    };
    (u64::from(depth) * channels).max(1)
}

/// Reads one.
pub(super) fn read(source: &Source) -> Result<Picture, ImportError> {
    let bytes = Cursor::new(source.bytes);
    let fail = |e: ImageError| match e {
        ImageError::Limits(_) => source.damaged("it needs more memory to decode than a picture of its size should"),
        ImageError::Unsupported(e) => source.damaged(e),
        other => source.damaged(other),
    };
    match Kind::of(source.bytes) {
        Kind::Png => {
            let limits = limits(source);
            decode(source, image::codecs::png::PngDecoder::with_limits(bytes, limits).map_err(fail)?)
        }
        Kind::Jpeg => decode(source, image::codecs::jpeg::JpegDecoder::new(bytes).map_err(fail)?),
        _ => decode(source, image::codecs::webp::WebPDecoder::new(bytes).map_err(fail)?),
    }
    .map_err(|e| match e {
        Failure::Import(e) => e,
        Failure::Decoder(e) => fail(e),
    })
}

enum Failure {
    Import(ImportError),
    Decoder(ImageError),
}

fn limits(source: &Source) -> Limits {
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(source.max_memory);
    limits
}

fn decode(source: &Source, mut decoder: impl ImageDecoder) -> Result<Picture, Failure> {
    let (width, height) = decoder.dimensions();
    // The decoder's buffers (a JPEG's coefficients, a WebP's planes) are about as large as the picture; then there are the
    // decoded picture and its RGBA form, and that once more where it becomes shared.
    let decoded = u64::from(decoder.color_type().bytes_per_pixel());
    let kept = if is_deep(decoder.color_type()) { 8 } else { 4 };
    source
        .check_size(width.into(), height.into(), 2 * decoded + 2 * kept, pixels_per_byte(source.bytes))
        .map_err(Failure::Import)?;
    decoder.set_limits(limits(source)).map_err(Failure::Decoder)?;
    let deep = is_deep(decoder.color_type());
    let picture = DynamicImage::from_decoder(decoder).map_err(Failure::Decoder)?;
    let pixels = if deep {
        Pixels::Rgba16(picture.into_rgba16().into_raw().into())
    } else {
        Pixels::Rgba8(picture.into_rgba8().into_raw().into())
    };
    Ok(Picture { width, height, pixels })
}

/// True for more than 8 bits a channel.
fn is_deep(color: ColorType) -> bool {
    color.bytes_per_pixel() / color.channel_count() > 1
}
