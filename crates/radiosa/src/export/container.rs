//! Files that work is kept in, to be gone on with.
//!
//! ```text
//! magic  version (u32)                           little-endian, as everything
//! zstd frame with checksum: numbers              crate::stream
//! ```

use std::fs::File;
use std::io::{self, BufReader, Read, Write};
use std::path::Path;

use super::target::{ExportError, write_atomically};
use crate::stream::{In, Out};

/// Fast, and good enough for floating-point numbers.
const LEVEL: i32 = 1;
/// Bytes of a text at most.
const MAX_TEXT: u64 = 1 << 20;

/// A kind of file.
pub(super) struct Kind {
    /// Its first bytes.
    pub(super) magic: &'static [u8; 8],
    /// Of what is inside: others are not read.
    pub(super) version: u32,
    /// What it is, for a person.
    pub(super) name: &'static str,
}

/// Writes a file, whole or not at all.
pub(super) fn write(path: &Path, kind: &Kind, fill: impl FnOnce(&mut Out) -> io::Result<()>) -> Result<(), ExportError> {
    write_atomically(path, |file| {
        file.write_all(kind.magic)?;
        file.write_all(&kind.version.to_le_bytes())?;
        let mut encoder = zstd::stream::write::Encoder::new(file, LEVEL)?;
        encoder.include_checksum(true)?;
        fill(&mut Out(&mut encoder))?;
        encoder.finish().map(drop)
    })
}

/// What is inside a file, at most `max_memory` bytes of it.
pub(super) fn open(path: &Path, kind: &Kind, max_memory: u64) -> Result<Box<dyn Read>, ExportError> {
    let io = |source| ExportError::Read { path: path.to_path_buf(), source };
    let mut file = BufReader::new(File::open(path).map_err(io)?);
    let mut head = [0u8; 12];
    let is_ours = file.read_exact(&mut head).is_ok() && head[..8] == *kind.magic;
    if !is_ours {
        return Err(unreadable(path, &format!("it is no {}", kind.name)));
    }
    let version = u32::from_le_bytes([head[8], head[9], head[10], head[11]]);
    if version != kind.version {
        return Err(unreadable(path, &format!("it is of version {version}, this program reads version {}", kind.version)));
    }
    let body = zstd::stream::read::Decoder::with_buffer(file).map_err(io)?;
    Ok(Box::new(BufReader::new(Limited { body, left: max_memory })))
}

/// A text.
pub(super) fn text(input: &mut In) -> io::Result<String> {
    let bytes = input.bytes(MAX_TEXT)?;
    String::from_utf8(bytes).map_err(|e| io::Error::new(io::ErrorKind::InvalidData, e))
}

/// Writes what a file is of: the hash of a scene, and the settings that decide about what is inside.
pub(super) fn write_origin(out: &mut Out, scene: u128, settings: &str) -> io::Result<()> {
    out.array(&scene.to_le_bytes())?;
    out.array(settings.as_bytes())
}

/// Reads what [`write_origin`] wrote; an error that says `others` where it is of another scene, or of other settings.
pub(super) fn check_origin(
    input: &mut In,
    path: &Path,
    (scene, settings): (u128, &str),
    others: [&str; 2],
) -> Result<(), ExportError> {
    let origin: io::Result<_> = input.array::<u8>(16).and_then(|scene| Ok((scene, text(input)?)));
    let (of_scene, of_settings) = origin.map_err(|e| damaged(path, &e))?;
    if of_scene != scene.to_le_bytes() {
        return Err(unreadable(path, others[0]));
    }
    if of_settings != settings {
        return Err(unreadable(path, others[1]));
    }
    Ok(())
}

/// A stream that fails, rather than ends, when there is more than was allowed.
struct Limited<R> {
    body: R,
    left: u64,
}

impl<R: Read> Read for Limited<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let n = self.body.read(buffer)?;
        self.left = self
            .left
            .checked_sub(n as u64)
            .ok_or_else(|| io::Error::new(io::ErrorKind::InvalidData, "it holds more than --max-memory allows"))?;
        Ok(n)
    }
}

pub(super) fn unreadable(path: &Path, why: &str) -> ExportError {
    ExportError::Unreadable { path: path.to_path_buf(), message: why.to_owned() }
}

pub(super) fn damaged(path: &Path, error: &io::Error) -> ExportError {
    let message = match error.kind() {
        io::ErrorKind::UnexpectedEof => "it ends too early".to_owned(),
        io::ErrorKind::InvalidData => error.to_string(),
        _ => format!("it is damaged: {error}"),
    };
    unreadable(path, &message)
}
