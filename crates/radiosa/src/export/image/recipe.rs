//! How an output was made, kept inside it.

/// What a file says about how to make it again: pairs of a short key and a text, in order.
///
/// In files the keys stand behind `radiosa.`: PNG text chunks, EXR string attributes, HDR header lines.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Recipe {
    entries: Vec<(String, String)>,
}

impl Recipe {
    /// Without entries.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds an entry, or replaces the one with the same key. Characters no format can hold are changed: in keys all but ASCII
    /// letters, digits, `-`, `_` and `.` become `-` (and at most 60 are kept), in texts NUL becomes a space.
    pub fn set(&mut self, key: &str, text: impl AsRef<str>) {
        let key: String = key
            .chars()
            .take(60)
            .map(|c| if c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.') { c } else { '-' })
            .collect();
        let text = text.as_ref().replace('\0', " ");
        match self.entries.iter_mut().find(|(k, _)| *k == key) {
            Some((_, old)) => *old = text,
            None => self.entries.push((key, text)),
        }
    }

    /// The same, for chaining.
    #[must_use]
    pub fn with(mut self, key: &str, text: impl AsRef<str>) -> Self {
        self.set(key, text);
        self
    }

    /// The text of a key.
    pub fn get(&self, key: &str) -> Option<&str> {
        self.entries.iter().find(|(k, _)| k == key).map(|(_, text)| text.as_str())
    }

    /// All of it, in order.
    pub fn entries(&self) -> &[(String, String)] {
        &self.entries
    }

    /// True without entries.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }
}

/// What stands before every key in files.
pub(super) const PREFIX: &str = "radiosa.";

/// A text on one line: line breaks and backslashes become escapes.
pub(super) fn escape_line(text: &str) -> String {
    text.replace('\\', "\\\\").replace('\n', "\\n").replace('\r', "\\r")
}

/// The inverse of [`escape_line`].
pub(super) fn unescape_line(line: &str) -> String {
    let mut text = String::with_capacity(line.len());
    let mut chars = line.chars();
    while let Some(c) = chars.next() {
        match c {
            '\\' => match chars.next() {
                Some('n') => text.push('\n'),
                Some('r') => text.push('\r'),
                Some(other) => text.push(other),
                None => text.push('\\'),
            },
            _ => text.push(c),
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_is_kept_once_and_in_its_first_place() {
        let recipe = Recipe::new().with("seed", "1").with("tone map", "clamp").with("seed", "2");
        assert_eq!(recipe.entries(), [("seed".into(), "2".into()), ("tone-map".into(), "clamp".to_owned())]);
        assert_eq!(recipe.get("seed"), Some("2"));
    }

    #[test]
    fn any_text_survives_being_put_on_one_line() {
        for text in ["", "plain", "two\nlines\r\n", "back\\slash\\n", "\\", "é → ∞"] {
            assert!(!escape_line(text).contains(['\n', '\r']));
            assert_eq!(unescape_line(&escape_line(text)), text);
        }
    }
}
