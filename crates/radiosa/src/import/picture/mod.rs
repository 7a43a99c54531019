//! Pictures: PNG, JPEG, WebP, Radiance HDR and OpenEXR, told apart by their first bytes.
//!
//! Before anything is reserved, the size in the header is held against the memory allowed and against what a file of that
//! many bytes can hold at best, so that a small file cannot ask for much. Decoders made by others are given only what passes,
//! and run inside a net: should one panic all the same, that is an error about the file.

mod exr;
mod hdr;
mod kind;
mod primaries;
mod raster;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use super::{ImportError, Location};
use crate::scene::{Image, Pixels};
use kind::Kind;

/// Decodes a picture from its bytes, whatever its format.
///
/// PNG, JPEG and WebP keep their encoded values (8 bits, or 16 where a PNG has them); gamma and colour profiles in the file
/// are ignored, as glTF asks. HDR and EXR become linear Rec. 709 floats: an HDR's exposure is divided out, an EXR shows what
/// its display window shows, luminance and chroma become RGB, and a cube environment becomes a latitude-longitude one.
///
/// `at` names it in errors. `max_memory` bounds what decoding may allocate, in bytes.
///
/// # Errors
/// When the bytes are no picture of a known format, are damaged, or would take too much memory.
pub fn decode(bytes: &[u8], at: &Location, max_memory: u64) -> Result<Image, ImportError> {
    let source = Source { bytes, at, max_memory };
    let kind = Kind::of(bytes);
    let read: fn(&Source) -> Result<Picture, ImportError> = match kind {
        Kind::Png | Kind::Jpeg | Kind::WebP => raster::read,
        Kind::Hdr => hdr::read,
        Kind::Exr => exr::read,
        Kind::Other(what) => {
            return Err(ImportError::Unsupported {
                path: at.path.clone(),
                feature: format!("a reader for {what}"),
                help: kind::HELP.into(),
            });
        }
        Kind::Unknown => {
            let what = if bytes.is_empty() { "the picture is empty" } else { "this is no picture of a known kind" };
            return Err(ImportError::invalid_with_help(at.clone(), what, kind::HELP));
        }
    };
    let picture =
        catch_unwind(AssertUnwindSafe(|| read(&source))).unwrap_or_else(|_| Err(source.damaged("its decoder gave up on it")))?;
    Ok(Image { name: at.to_string(), width: picture.width, height: picture.height, pixels: picture.pixels })
}

/// A decoded picture without its name.
struct Picture {
    width: u32,
    height: u32,
    pixels: Pixels,
}

/// The bytes of a picture, and what is allowed.
struct Source<'a> {
    bytes: &'a [u8],
    at: &'a Location,
    max_memory: u64,
}

impl Source<'_> {
    /// The error for a picture that is not what its format demands.
    fn damaged(&self, what: impl std::fmt::Display) -> ImportError {
        let help = "open it in an image editor and save it again";
        ImportError::invalid_with_help(self.at.clone(), format!("the {} cannot be read: {what}", Kind::of(self.bytes)), help)
    }

    /// The error for something valid that we cannot read.
    fn unsupported(&self, feature: impl Into<String>, help: &str) -> ImportError {
        ImportError::Unsupported { path: self.at.path.clone(), feature: feature.into(), help: help.into() }
    }

    /// Holds a size against the memory allowed, at `bytes_per_pixel` of everything that decoding it takes, and against
    /// `pixels_per_byte`, the most pixels a byte of such a file can stand for. The size as u32 comes back.
    fn check_size(&self, width: u64, height: u64, bytes_per_pixel: u64, pixels_per_byte: u64) -> Result<(u32, u32), ImportError> {
        let (Ok(w), Ok(h)) = (u32::try_from(width), u32::try_from(height)) else {
            return Err(self.damaged(format_args!("its header claims {width}x{height} pixels")));
        };
        if w == 0 || h == 0 {
            return Err(self.damaged("it has no pixels"));
        }
        let needed = (width * height).saturating_mul(bytes_per_pixel);
        if needed > self.max_memory {
            let what = format!("the {width}x{height} picture {}", self.at);
            return Err(ImportError::TooLarge { what, needed, allowed: self.max_memory });
        }
        // The constant is for headers, which stand for no pixels but bring a small file its first few.
        if width * height > (self.bytes.len() as u64 + 64).saturating_mul(pixels_per_byte) {
            let len = self.bytes.len();
            return Err(self.damaged(format_args!("its header claims {width}x{height} pixels, which {len} bytes cannot hold")));
        }
        Ok((w, h))
    }
}

/// `n` floats, all zero, to be filled through [`Arc::get_mut`]: making the shared slice first saves a copy of the picture.
fn zeroed(n: usize) -> Arc<[f32]> {
    std::iter::repeat_n(0.0, n).collect()
}

/// Light that is not a number becomes none, and infinite light the largest a half float holds: a single such value would
/// spoil every sum it enters.
fn finite(value: f32) -> f32 {
    const LARGEST: f32 = 65_504.0;
    if value.is_finite() {
        value
    } else if value.is_nan() {
        0.0
    } else {
        LARGEST.copysign(value)
    }
}
