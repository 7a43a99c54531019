//! What goes wrong, and what is merely odd, in files.

use std::fmt;
use std::path::{Path, PathBuf};

use thiserror::Error;

/// Why a file cannot be used. Every variant says what, where, and where it can what to try.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ImportError {
    /// The file cannot be read at all.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// Which file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Something in it is wrong.
    #[error("{message}")]
    Invalid {
        /// Where.
        at: Box<Location>,
        /// What is wrong, with the offending value.
        message: String,
        /// What to try; empty when there is nothing to say.
        help: String,
    },
    /// It is a valid file that needs something Radiosa does not have.
    #[error("{} needs {feature}, which Radiosa does not support", path.display())]
    Unsupported {
        /// Which file.
        path: PathBuf,
        /// What it needs.
        feature: String,
        /// What to try.
        help: String,
    },
    /// Decoding it would take more memory than allowed.
    #[error("{what} would take {} MiB, more than the {} MiB allowed", needed >> 20, allowed >> 20)]
    TooLarge {
        /// What.
        what: String,
        /// Bytes needed.
        needed: u64,
        /// Bytes allowed.
        allowed: u64,
    },
}

/// A place in a document.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Location {
    /// The file; empty for bytes without one.
    pub path: PathBuf,
    /// Line and column, from 1, in text formats.
    pub line: Option<(u32, u32)>,
    /// The path inside the document in structured formats, such as `/meshes/3/primitives/0`.
    pub pointer: Option<String>,
    /// The text and the byte range in it to underline, for formats read as text.
    pub excerpt: Option<(std::sync::Arc<str>, std::ops::Range<usize>)>,
}

impl Location {
    /// A whole file.
    pub fn file(path: impl Into<PathBuf>) -> Self {
        Self { path: path.into(), ..Self::default() }
    }

    /// A place inside a structured document.
    pub fn inside(path: impl Into<PathBuf>, pointer: impl Into<String>) -> Self {
        Self { pointer: Some(pointer.into()), ..Self::file(path) }
    }
}

impl fmt::Display for Location {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.path.display())?;
        if let Some((line, column)) = self.line {
            write!(f, ":{line}:{column}")?;
        }
        if let Some(pointer) = &self.pointer {
            write!(f, " at {pointer}")?;
        }
        Ok(())
    }
}

impl ImportError {
    /// Something wrong at a place, without advice.
    pub fn invalid(at: Location, message: impl Into<String>) -> Self {
        Self::Invalid { at: Box::new(at), message: message.into(), help: String::new() }
    }

    /// Something wrong at a place, with what to try.
    pub fn invalid_with_help(at: Location, message: impl Into<String>, help: impl Into<String>) -> Self {
        Self::Invalid { at: Box::new(at), message: message.into(), help: help.into() }
    }

    /// The place, where one is known.
    pub fn location(&self) -> Option<&Location> {
        match self {
            Self::Invalid { at, .. } => Some(at),
            _ => None,
        }
    }

    /// What to try; empty when there is nothing to say.
    pub fn help(&self) -> &str {
        match self {
            Self::Invalid { help, .. } | Self::Unsupported { help, .. } => help,
            Self::TooLarge { .. } => "raise --max-memory, or use a smaller file",
            Self::Io { .. } => "",
        }
    }
}

/// Something odd but usable.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Warning {
    /// A short stable name, such as `ignored-extension`: the same oddity is said once.
    pub name: &'static str,
    /// Which file.
    pub path: PathBuf,
    /// What, for a person.
    pub message: String,
}

/// Collects warnings, each (name, message) once, in order of first appearance.
#[derive(Clone, Debug, Default)]
pub struct Warnings {
    list: Vec<Warning>,
    seen: std::collections::HashSet<(&'static str, PathBuf, String)>,
}

impl Warnings {
    /// How many different ones are kept; a file with more is cut off with a last word about it.
    const LIMIT: usize = 200;

    /// Adds one unless it was said before.
    pub fn add(&mut self, name: &'static str, path: &Path, message: impl Into<String>) {
        let message = message.into();
        if self.list.len() < Self::LIMIT && self.seen.insert((name, path.to_path_buf(), message.clone())) {
            self.list.push(Warning { name, path: path.to_path_buf(), message });
            if self.list.len() == Self::LIMIT {
                let message = format!("more than {} warnings: the rest is not listed", Self::LIMIT);
                self.list.push(Warning { name: "too-many-warnings", path: path.to_path_buf(), message });
            }
        }
    }

    /// In order of first appearance.
    pub fn into_vec(self) -> Vec<Warning> {
        self.list
    }

    /// In order of first appearance.
    pub fn as_slice(&self) -> &[Warning] {
        &self.list
    }
}
