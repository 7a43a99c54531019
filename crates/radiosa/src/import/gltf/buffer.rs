//! Buffers and buffer views: where the bytes are.

use std::borrow::Cow;
use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

use base64::Engine;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};

use super::super::{ImportError, Resolver};
use super::budget::Budget;
use super::json::{Item, Table};

/// Extensions whose buffers may be placeholders for what the extension unpacks.
const PLACEHOLDER: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

/// Every buffer of a document and the views into them.
#[derive(Debug)]
pub(super) struct Buffers<'a> {
    table: Table<'a>,
    views: Table<'a>,
    /// One for each buffer; `None` for one without any bytes (a placeholder).
    bytes: Vec<Option<Arc<[u8]>>>,
}

/// A range of bytes and the stride of the view it came from.
#[derive(Clone, Copy, Debug)]
pub(super) struct View<'b> {
    /// The bytes.
    pub bytes: &'b [u8],
    /// Distance between elements; `None` when they follow each other.
    pub stride: Option<u64>,
}

impl<'a> Buffers<'a> {
    /// Fetches every buffer.
    pub(super) fn load(
        root: &Item<'a>,
        binary: Option<&[u8]>,
        resolver: &Resolver,
        budget: &mut Budget,
    ) -> Result<Self, ImportError> {
        let table = Table::new(root, "buffers", "buffer")?;
        let views = Table::new(root, "bufferViews", "buffer view")?;
        let mut bytes = Vec::new();
        // Many buffers may name one file; its bytes are kept once.
        let mut files: HashMap<&str, Arc<[u8]>> = HashMap::new();
        for (i, buffer) in table.iter().enumerate() {
            let found = match (buffer.get("uri")?, binary) {
                (Some(uri), _) => {
                    let text = uri.as_text()?;
                    let found = match files.get(text) {
                        Some(bytes) => bytes.clone(),
                        None => {
                            let fetched = fetch(&uri, resolver)?;
                            budget.reserve(&|| format!("buffer {i}"), fetched.len() as u64)?;
                            files.entry(text).or_insert(fetched.into()).clone()
                        }
                    };
                    Some(found)
                }
                (None, Some(chunk)) if i == 0 => {
                    budget.reserve(&|| "the binary chunk".into(), chunk.len() as u64)?;
                    Some(chunk.into())
                }
                (None, _) => None,
            };
            if let (Some(found), Some(declared)) = (&found, buffer.count("byteLength")?)
                && (found.len() as u64) < declared
            {
                return Err(buffer.error_with_help(
                    format!("the buffer has {} bytes where byteLength says {declared}", found.len()),
                    "the file it comes from may be truncated; fetch or export it again",
                ));
            }
            bytes.push(found);
        }
        Ok(Self { table, views, bytes })
    }

    /// Every buffer's bytes, in order, for a later writer; empty for placeholders.
    pub(super) fn to_vec(&self) -> Vec<Arc<[u8]>> {
        self.bytes.iter().map(|b| b.clone().unwrap_or_else(|| Arc::from([]))).collect()
    }

    /// Bytes of all buffers together: a measure of how much a file can hold.
    pub(super) fn total(&self) -> u64 {
        self.bytes.iter().flatten().map(|b| b.len() as u64).sum()
    }

    /// The bytes that a reference to a buffer view means.
    pub(super) fn view(&self, reference: &Item<'a>) -> Result<View<'_>, ImportError> {
        let (_, view) = self.views.resolve(reference)?;
        let (index, buffer) = self.table.resolve(&view.require("buffer")?)?;
        let Some(bytes) = &self.bytes[index] else {
            for name in PLACEHOLDER {
                if view.extension(name)?.is_some() {
                    return Err(super::extension::unsupported(view.file(), name));
                }
            }
            return Err(buffer.error("the buffer has neither a `uri` nor a binary chunk to be in"));
        };
        let offset = view.count("byteOffset")?.unwrap_or(0);
        let length = view.require("byteLength")?.as_count()?;
        let range = range(offset, length, bytes.len()).ok_or_else(|| {
            view.error(format!("its {length} bytes from byte {offset} leave buffer {index} of {}", bytes.len()))
        })?;
        Ok(View { bytes: &bytes[range], stride: view.count("byteStride")? })
    }
}

/// A byte range, when it lies inside.
fn range(offset: u64, length: u64, available: usize) -> Option<Range<usize>> {
    let end = offset.checked_add(length)?;
    (end <= available as u64).then_some(offset as usize..end as usize)
}

/// The bytes a `uri` names: embedded in it, or in a file next to the document.
pub(super) fn fetch(uri: &Item<'_>, resolver: &Resolver) -> Result<Vec<u8>, ImportError> {
    let text = uri.as_text()?;
    if let Some(rest) = text.strip_prefix("data:") {
        return data_uri(uri, rest);
    }
    let scheme = text.split_once(':').map(|(scheme, _)| scheme);
    if let Some(scheme) = scheme.filter(|s| s.len() > 1 && s.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))) {
        return Err(ImportError::Unsupported {
            path: uri.file().into(),
            feature: format!("`{scheme}:` addresses (at {})", uri.pointer()),
            help: "fetch the file, put it next to the document and refer to it by name".into(),
        });
    }
    let decoded: Cow<'_, str> = percent_encoding::percent_decode_str(text).decode_utf8_lossy();
    let result = match resolver.read(&decoded) {
        // Some exporters write names with a literal percent sign unescaped.
        Err(first) if decoded != text => resolver.read(text).map_err(|_| first),
        result => result,
    };
    result.map_err(|e| match e {
        ImportError::Io { path, source } => uri.error_with_help(
            format!("cannot read {}: {source}", path.display()),
            "the document consists of several files; keep them together, named as in the document",
        ),
        other => other,
    })
}

fn data_uri(uri: &Item<'_>, rest: &str) -> Result<Vec<u8>, ImportError> {
    // Padding is often forgotten and carries nothing.
    const LENIENT: GeneralPurposeConfig = GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
        .with_decode_allow_trailing_bits(true);
    let (media, data) = rest.split_once(',').ok_or_else(|| uri.error("the data URI has no comma before its data"))?;
    if !media.ends_with(";base64") {
        return Ok(percent_encoding::percent_decode_str(data).collect());
    }
    GeneralPurpose::new(&base64::alphabet::STANDARD, LENIENT)
        .decode(data)
        .map_err(|e| uri.error(format!("the data URI is not valid base64: {e}")))
}
