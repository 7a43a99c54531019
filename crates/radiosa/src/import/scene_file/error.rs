//! Where in the text something went wrong, and which word was probably meant.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::import::{ImportError, Location};

/// The text of one scene file: turns byte ranges into places a person can find.
#[derive(Clone, Debug)]
pub(super) struct Text {
    pub(super) path: PathBuf,
    pub(super) text: Arc<str>,
}

impl Text {
    /// Checks that bytes are text.
    pub(super) fn new(path: &Path, bytes: &[u8]) -> Result<Self, ImportError> {
        let bytes = bytes.strip_prefix("\u{feff}".as_bytes()).unwrap_or(bytes);
        match std::str::from_utf8(bytes) {
            Ok(text) => Ok(Self { path: path.to_path_buf(), text: text.into() }),
            Err(e) => {
                let before = String::from_utf8_lossy(&bytes[..e.valid_up_to()]);
                let at = Location { line: Some(line_and_column(&before, before.len())), ..Location::file(path) };
                let help = "scene files are TOML in UTF-8: save it with that encoding";
                Err(ImportError::invalid_with_help(at, "the file is not UTF-8 text", help))
            }
        }
    }

    /// The place of some bytes.
    pub(super) fn at(&self, span: &Range<usize>) -> Location {
        let end = floor_boundary(&self.text, span.end);
        let start = floor_boundary(&self.text, span.start.min(end));
        // A table spans all its lines: its first line says enough.
        let first_line_end = self.text[start..end].find('\n').map_or(end, |i| start + i);
        let underlined = start..self.text[start..first_line_end].trim_end().len() + start;
        Location {
            line: Some(line_and_column(&self.text, start)),
            excerpt: Some((self.text.clone(), underlined)),
            ..Location::file(&self.path)
        }
    }

    /// Something wrong with some bytes.
    pub(super) fn error(&self, span: &Range<usize>, message: impl Into<String>, help: impl Into<String>) -> ImportError {
        ImportError::invalid_with_help(self.at(span), message, help)
    }

    /// A name that nothing has.
    pub(super) fn unknown<'a>(
        &self,
        name: &super::value::At<String>,
        what: &str,
        known: impl Iterator<Item = &'a str> + Clone,
    ) -> ImportError {
        self.error(&name.span, format!("there is no {what} {:?}", name.value), suggestion(&name.value, known))
    }

    /// What the TOML reader found wrong, in our words.
    pub(super) fn toml_error(&self, error: &toml::de::Error) -> ImportError {
        let span = error.span().unwrap_or(0..0);
        let message = error.message();
        for (start, what) in [("unknown field `", "key"), ("unknown variant `", "value")] {
            let Some((word, rest)) = message.strip_prefix(start).and_then(|m| m.split_once("`, ")) else { continue };
            // The known words stand between backquotes.
            let known = rest.split('`').skip(1).step_by(2);
            return self.error(&span, format!("unknown {what} {word:?}"), suggestion(word, known));
        }
        if let Some(field) = message.strip_prefix("missing field `").and_then(|m| m.strip_suffix('`')) {
            return self.error(&span, format!("the key {field:?} is missing here"), "");
        }
        if let Some((found, expected)) = message.strip_prefix("invalid type: ").and_then(|m| m.split_once(", expected ")) {
            // Of tables and lists the reader knows only our names for them, which mean nothing to whoever wrote the file.
            let expected = match expected {
                "a sequence" => "an array",
                e if e.starts_with("struct ") => "a table",
                e => e,
            };
            return self.error(&span, format!("expected {expected}, found {found}"), "");
        }
        if span.is_empty() && message.starts_with("string values must be quoted") {
            return self.error(&span, "a value is missing after `=`", "");
        }
        self.error(&span, message.to_owned(), "")
    }
}

/// Line and column of a byte, both from 1; columns count characters.
fn line_and_column(text: &str, byte: usize) -> (u32, u32) {
    let before = &text[..byte];
    let line = before.bytes().filter(|&b| b == b'\n').count() + 1;
    let column = before[before.rfind('\n').map_or(0, |i| i + 1)..].chars().count() + 1;
    (u32::try_from(line).unwrap_or(u32::MAX), u32::try_from(column).unwrap_or(u32::MAX))
}

fn floor_boundary(text: &str, byte: usize) -> usize {
    let mut byte = byte.min(text.len());
    while !text.is_char_boundary(byte) {
        byte -= 1;
    }
    byte
}

/// “did you mean …?” when a word is near, otherwise the list while it is short.
pub(crate) fn suggestion<'a>(word: &str, known: impl Iterator<Item = &'a str> + Clone) -> String {
    if let Some(near) = nearest(word, known.clone()) {
        return format!("did you mean {near:?}?");
    }
    let mut all: Vec<_> = known.collect();
    all.dedup();
    match all.len() {
        0 => String::new(),
        1..=16 => format!("known here: {}", all.join(", ")),
        n => format!("{n} are known here, among them {}", all[..12].join(", ")),
    }
}

/// The known word that `word` most probably was meant to be, when one is close: as many slips of the pen apart as a third of its letters.
pub fn nearest<'a>(word: &str, known: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    // Long names are not compared letter by letter: the cost is the product of the lengths.
    let fold =
        |w: &str| w.chars().take(64).map(|c| if c == '-' || c == ' ' { '_' } else { c.to_ascii_lowercase() }).collect::<Vec<_>>();
    let word = fold(word);
    known
        .take(4096)
        .map(|k| {
            let folded = fold(k);
            (slips(&word, &folded), folded.len().max(word.len()), k)
        })
        .filter(|&(distance, len, _)| distance <= (len / 3).max(1) && distance < len)
        .min_by_key(|&(distance, ..)| distance)
        .map(|(.., k)| k)
}

/// Number of letters added, dropped, changed or swapped with their neighbour that turn `a` into `b` (Damerau, Levenshtein; optimal string alignment).
fn slips(a: &[char], b: &[char]) -> usize {
    // d[i][j]: from the first i letters of `a` to the first j of `b`.
    let mut d = vec![vec![0; b.len() + 1]; a.len() + 1];
    d[0] = (0..=b.len()).collect();
    for i in 1..=a.len() {
        d[i][0] = i;
        for j in 1..=b.len() {
            let changed = usize::from(a[i - 1] != b[j - 1]);
            d[i][j] = (d[i - 1][j] + 1).min(d[i][j - 1] + 1).min(d[i - 1][j - 1] + changed);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                d[i][j] = d[i][j].min(d[i - 2][j - 2] + 1);
            }
        }
    }
    d[a.len()][b.len()]
}
