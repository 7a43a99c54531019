//! From bytes to JSON text and the binary chunk: plain `.gltf` and the GLB container, told apart by their first bytes.

use std::path::Path;

use serde_json::Value;

use super::super::{ImportError, Location, Warnings};

/// The two parts of a file.
#[derive(Debug)]
pub(super) struct Container<'a> {
    /// The JSON text, without a byte-order mark.
    pub json: &'a str,
    /// The binary chunk of a GLB.
    pub binary: Option<&'a [u8]>,
}

const MAGIC: &[u8] = b"glTF";
const JSON_CHUNK: u32 = u32::from_le_bytes(*b"JSON");
const BINARY_CHUNK: u32 = u32::from_le_bytes(*b"BIN\0");

/// Splits a file.
pub(super) fn split<'a>(bytes: &'a [u8], path: &Path, warnings: &mut Warnings) -> Result<Container<'a>, ImportError> {
    let (json, binary) = if bytes.starts_with(MAGIC) { split_glb(bytes, path, warnings)? } else { (bytes, None) };
    let json = std::str::from_utf8(json).map_err(|e| {
        let message = format!("byte {} of the JSON text is not UTF-8", e.valid_up_to());
        ImportError::invalid_with_help(Location::file(path), message, "a glTF file is JSON text in UTF-8, or a GLB container")
    })?;
    Ok(Container { json: json.trim_start_matches('\u{feff}'), binary })
}

fn split_glb<'a>(bytes: &'a [u8], path: &Path, warnings: &mut Warnings) -> Result<(&'a [u8], Option<&'a [u8]>), ImportError> {
    let invalid = |message: String| {
        let help = "the file may be truncated or damaged; fetch or export it again";
        ImportError::invalid_with_help(Location::file(path), message, help)
    };
    let word = |at: usize| -> Option<u32> { Some(u32::from_le_bytes(bytes.get(at..at.checked_add(4)?)?.try_into().ok()?)) };
    let (Some(version), Some(length)) = (word(4), word(8)) else {
        return Err(invalid(format!("a GLB header takes 12 bytes, but the file has only {}", bytes.len())));
    };
    if version != 2 {
        return Err(super::other_version(path, &format!("GLB version {version}")));
    }
    let length = length as usize;
    if length > bytes.len() {
        return Err(invalid(format!("the GLB header announces {length} bytes, but the file has only {}", bytes.len())));
    }
    if length < bytes.len() {
        warnings.add("trailing-bytes", path, format!("{} bytes after the end of the GLB are ignored", bytes.len() - length));
    }
    let (mut json, mut binary) = (None, None);
    let mut at = 12;
    while at < length {
        let (Some(size), Some(kind)) = (word(at), word(at + 4)) else {
            return Err(invalid(format!("the chunk header at byte {at} is cut off")));
        };
        let start = at + 8;
        let end = start.checked_add(size as usize).filter(|&end| end <= length);
        let Some(chunk) = end.and_then(|end| bytes.get(start..end)) else {
            let left = length.saturating_sub(start);
            return Err(invalid(format!("the chunk at byte {at} announces {size} bytes, but only {left} are left")));
        };
        match kind {
            JSON_CHUNK if json.is_none() && at == 12 => json = Some(chunk),
            BINARY_CHUNK if json.is_some() && binary.is_none() => binary = Some(chunk),
            _ => warnings.add("ignored-chunk", path, format!("the GLB chunk of type {kind:#010x} at byte {at} is ignored")),
        }
        // The size need not be a multiple of four in files that are slightly wrong; the next chunk starts where this one ends.
        at = start + size as usize;
    }
    let json = json.ok_or_else(|| invalid("its first chunk is not JSON".into()))?;
    Ok((json, binary))
}

/// Parses the JSON text.
pub(super) fn parse(json: &str, path: &Path) -> Result<Value, ImportError> {
    serde_json::from_str(json).map_err(|e| {
        let mut at = Location::file(path);
        let narrow = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
        at.line = (e.line() > 0).then(|| (narrow(e.line()), narrow(e.column()).max(1)));
        // The position is in the location; the parser's own text repeats it at the end.
        let text = e.to_string();
        let what = text.split(" at line ").next().unwrap_or(&text);
        ImportError::invalid_with_help(at, format!("the JSON text is malformed: {what}"), "export the file again")
    })
}
