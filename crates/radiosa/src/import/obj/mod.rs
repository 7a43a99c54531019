//! (to come)

use super::{ImportError, Resolver, Warnings};
use crate::scene::Scene;

/// Reads a document.
///
/// # Errors
/// When it is malformed.
pub(super) fn read(_bytes: &[u8], resolver: &Resolver, _warnings: &mut Warnings) -> Result<Scene, ImportError> {
    Err(ImportError::Unsupported { path: resolver.path().into(), feature: "this format".into(), help: String::new() })
}
