//! Pictures: PNG for screens, OpenEXR with all layers, Radiance HDR; each with the recipe it was made by inside.
//!
//! The same film, recipe and options give the same bytes: no dates, no names of machines.

mod exr;
mod hdr;
mod png;
mod recipe;

pub use recipe::Recipe;

use std::fs::File;
use std::io::BufReader;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use super::target::{ExportError, check_writable, write_atomically};
use crate::film::Film;
use crate::film::tone_map::ToneMap;

/// A picture format that can be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// 8 or 16 bits a channel, sRGB, what a screen shows.
    Png,
    /// Linear floats, all layers.
    Exr,
    /// Radiance RGBE: linear colour with a shared exponent, about 1 % of precision.
    Hdr,
}

impl Format {
    /// The endings that are known.
    pub const ENDINGS: &'static [&'static str] = &["png", "exr", "hdr"];

    /// The format an output's ending asks for, whatever its case.
    ///
    /// # Errors
    /// When the ending is none of [`Self::ENDINGS`].
    pub fn of(path: &Path) -> Result<Self, ExportError> {
        match path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase).as_deref() {
            Some("png") => Ok(Self::Png),
            Some("exr") => Ok(Self::Exr),
            Some("hdr") => Ok(Self::Hdr),
            _ => Err(ExportError::UnknownEnding { path: path.to_path_buf(), known: Self::ENDINGS }),
        }
    }
}

/// What a picture file is to look like.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Options {
    /// How light becomes what a screen shows; PNG only.
    pub tone_map: ToneMap,
    /// Bits of a PNG's channels.
    pub png_depth: PngDepth,
    /// Bits of an EXR's channels.
    pub exr_depth: ExrDepth,
}

/// Bits of a channel in a PNG.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PngDepth {
    /// 8.
    #[default]
    Eight,
    /// 16.
    Sixteen,
}

/// Bits of a channel in an EXR.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ExrDepth {
    /// 32-bit floats.
    #[default]
    Single,
    /// 16-bit floats; depth and position stay at 32, where 16 would not do. Light above 65 504 is cut off there.
    Half,
}

/// Finds out, before anything is computed, whether a picture can be written to `path`: its ending is known, its folder is there
/// and lets us write.
///
/// # Errors
/// When one of these does not hold.
pub fn check_target(path: &Path) -> Result<Format, ExportError> {
    let format = Format::of(path)?;
    check_writable(path)?;
    Ok(format)
}

/// Writes a film to `path` in the format its ending names. `path` holds the whole file or what it held before.
///
/// PNG and HDR take the colour; EXR takes every layer. A PNG's recipe gains `exposure` (the factor that was used) and
/// `tone-map`. An HDR file's `VIEW=` line is the recipe's `view`, when it has one; its pixels are radiance as it is (`EXPOSURE=1`).
///
/// # Errors
/// When the ending is unknown or the file cannot be written.
pub fn write(film: &Film, path: &Path, recipe: &Recipe, options: &Options) -> Result<(), ExportError> {
    match Format::of(path)? {
        Format::Png => write_atomically(path, |file| png::write(film, file, recipe, options)),
        Format::Hdr => write_atomically(path, |file| hdr::write(film, file, recipe)),
        Format::Exr => write_atomically(path, |file| exr::write(film, file, recipe, options.exr_depth)),
    }
}

/// Writes a picture that is no film, such as a page of several, as an 8-bit PNG: sRGB bytes, three a pixel, row-major from the top left.
///
/// # Errors
/// When the file cannot be written.
///
/// # Panics
/// When there are not `3 · width · height` bytes, or no pixels.
pub fn write_rgb8(path: &Path, width: u32, height: u32, rgb: &[u8], recipe: &Recipe) -> Result<(), ExportError> {
    assert!(width > 0 && height > 0, "a picture has pixels");
    assert_eq!(rgb.len() as u64, 3 * u64::from(width) * u64::from(height), "three bytes a pixel");
    write_atomically(path, |file| png::write_bytes(file, (width, height), PngDepth::Eight, rgb, recipe))
}

/// The recipe inside a picture that [`write`] wrote; empty for pictures made by others.
///
/// # Errors
/// When the file cannot be read, or is not what its ending says.
pub fn read_recipe(path: &Path) -> Result<Recipe, ExportError> {
    let unreadable = |message: String| ExportError::Unreadable { path: path.to_path_buf(), message };
    let format = Format::of(path)?;
    let file = BufReader::new(File::open(path).map_err(|e| unreadable(e.to_string()))?);
    let read = move || match format {
        Format::Png => png::read_recipe(file),
        Format::Exr => exr::read_recipe(file),
        Format::Hdr => hdr::read_recipe(file),
    };
    // The file may be anything, and the decoders are made by others: should one panic, that is an error about the file.
    catch_unwind(AssertUnwindSafe(read)).unwrap_or_else(|_| Err("its decoder gave up on it".into())).map_err(unreadable)
}
