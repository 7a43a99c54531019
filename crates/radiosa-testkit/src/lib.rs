//! Closed-form answers, statistics and image comparison for Radiosa's tests. It knows no Radiosa types, so that nothing here can
//! agree with the engine by sharing its mistakes.

pub mod brdf;
pub mod form_factor;
pub mod image;
pub mod optics;
pub mod rough_glass;
pub mod shadow;

use std::path::{Path, PathBuf};

/// The collection of scenes, pictures and malformed files made by others, when it lies beside the checkout.
///
/// Tests that use it must pass without it, and say what they skipped.
pub fn shared_dir() -> Option<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2)?;
    let dir = root.parent()?.join("shared");
    dir.is_dir().then_some(dir)
}

/// The reference data that this crate contains (`data/`).
pub fn data_dir() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data")
}
