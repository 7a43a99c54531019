//! The shared ground of OBJ and MTL: lines of words. A backslash before the end of a line joins it with the next.

use std::borrow::Cow;
use std::ops::Range;
use std::path::Path;

use crate::import::{Location, Warnings};

/// The bytes in an encoding that agrees with ASCII: UTF-16 with a byte order mark becomes UTF-8, UTF-8 loses its mark, the rest stays.
pub(super) fn decode(bytes: &[u8]) -> Cow<'_, [u8]> {
    let utf16 = |bytes: &[u8], unit: fn([u8; 2]) -> u16| {
        let units = bytes.chunks_exact(2).map(|pair| unit([pair[0], pair[1]]));
        let text: String = char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect();
        Cow::Owned(text.into_bytes())
    };
    match bytes {
        [0xfe, 0xff, rest @ ..] => utf16(rest, u16::from_be_bytes),
        [0xff, 0xfe, rest @ ..] => utf16(rest, u16::from_le_bytes),
        [0xef, 0xbb, 0xbf, rest @ ..] => Cow::Borrowed(rest),
        _ => Cow::Borrowed(bytes),
    }
}

/// One word and where it starts in the text.
#[derive(Clone, Copy, Debug)]
pub(super) struct Word<'a> {
    pub at: usize,
    pub bytes: &'a [u8],
}

impl Word<'_> {
    pub(super) fn range(&self) -> Range<usize> {
        self.at..self.at + self.bytes.len()
    }

    /// For messages: at most forty characters of it, whatever its bytes.
    pub(super) fn shown(&self) -> String {
        shown(self.bytes)
    }
}

/// At most forty characters of some bytes, for messages.
pub(super) fn shown(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(160)]);
    let mut short: String = text.chars().take(40).map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect();
    if short.len() < text.len() || bytes.len() > 160 {
        short.push('…');
    }
    short
}

/// Walks through a text word by word, line by line.
#[derive(Clone, Debug)]
pub(super) struct Scanner<'a> {
    text: &'a [u8],
    at: usize,
}

const fn is_end(byte: u8) -> bool {
    byte == b'\n' || byte == b'\r'
}

impl<'a> Scanner<'a> {
    /// At some byte of a text.
    pub(super) fn at(text: &'a [u8], at: usize) -> Self {
        Self { text, at }
    }

    pub(super) fn position(&self) -> usize {
        self.at
    }

    pub(super) fn is_done(&self) -> bool {
        self.at >= self.text.len()
    }

    /// When a backslash at `at` joins this line with the next: where the next one starts.
    fn joined(&self, at: usize) -> Option<usize> {
        match self.text.get(at..)? {
            [b'\\', b'\r', b'\n', ..] => Some(at + 3),
            [b'\\', b'\r' | b'\n', ..] => Some(at + 2),
            _ => None,
        }
    }

    /// The next word of this line; `None` at its end. Control characters separate words as blanks do.
    pub(super) fn word(&mut self) -> Option<Word<'a>> {
        let text = self.text;
        let mut at = self.at;
        loop {
            match *text.get(at)? {
                b'\\' => match self.joined(at) {
                    Some(next) => at = next,
                    None => break,
                },
                byte if is_end(byte) => {
                    self.at = at;
                    return None;
                }
                byte if byte <= b' ' => at += 1,
                _ => break,
            }
        }
        let start = at;
        while let Some(&byte) = text.get(at) {
            if byte <= b' ' || (byte == b'\\' && self.joined(at).is_some()) {
                break;
            }
            at += 1;
        }
        self.at = at;
        Some(Word { at: start, bytes: &text[start..at] })
    }

    /// What is left of this line without blanks around it: a name, which may hold blanks.
    pub(super) fn rest(&mut self) -> String {
        let mut name = Vec::new();
        while let Some(&byte) = self.text.get(self.at) {
            if let Some(next) = self.joined(self.at) {
                name.push(b' ');
                self.at = next;
            } else if is_end(byte) {
                break;
            } else {
                name.push(byte);
                self.at += 1;
            }
        }
        String::from_utf8_lossy(&name).trim_matches(|c: char| c <= ' ').to_owned()
    }

    /// Leaves this line, joined ones included.
    pub(super) fn next_line(&mut self) {
        while let Some(&byte) = self.text.get(self.at) {
            if let Some(next) = self.joined(self.at) {
                self.at = next;
            } else if is_end(byte) {
                return self.leave_end();
            } else {
                self.at += 1;
            }
        }
    }

    /// Leaves a comment, which a backslash does not prolong: it may end in the name of a Windows folder.
    pub(super) fn next_line_after_comment(&mut self) {
        while self.text.get(self.at).is_some_and(|&byte| !is_end(byte)) {
            self.at += 1;
        }
        self.leave_end();
    }

    fn leave_end(&mut self) {
        let crlf = self.text.get(self.at..).is_some_and(|rest| rest.starts_with(b"\r\n"));
        self.at = (self.at + if crlf { 2 } else { 1 }).min(self.text.len());
    }
}

/// A decimal number as files write it: `1`, `+.5`, `2.`, `1e+10`, `inf`, `nan`, Windows' `1.#QNAN`.
pub(super) fn number(bytes: &[u8]) -> Option<f64> {
    // Most numbers have few digits and no exponent: mantissa and power of ten are exact in f64, so one division rounds correctly.
    const POWERS: [f64; 16] = [1., 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];
    let (negative, digits) = match bytes {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        _ => (false, bytes),
    };
    if digits.len() <= 16 && digits.iter().any(u8::is_ascii_digit) {
        let (mut mantissa, mut point, mut plain) = (0u64, None, true);
        for (i, &byte) in digits.iter().enumerate() {
            match byte {
                b'0'..=b'9' => mantissa = mantissa * 10 + u64::from(byte - b'0'),
                b'.' if point.is_none() => point = Some(i + 1),
                _ => plain = false,
            }
        }
        if plain && mantissa < 1 << 53 {
            let value = mantissa as f64 / POWERS[point.map_or(0, |p| digits.len() - p)];
            return Some(if negative { -value } else { value });
        }
    }
    let text = std::str::from_utf8(bytes).ok()?;
    text.parse().ok().or_else(|| (text.contains(".#") && digits[0].is_ascii_digit()).then_some(f64::NAN))
}

/// The line (from 1) a byte of the text is in.
pub(super) fn line_of(text: &[u8], at: usize) -> u32 {
    let before = &text[..at.min(text.len())];
    let ends = before.iter().enumerate().filter(|&(i, &b)| b == b'\n' || (b == b'\r' && text.get(i + 1) != Some(&b'\n')));
    ends.count() as u32 + 1
}

/// The place of some bytes of the text, with the lines around them as excerpt: the text as it is, but for the lines further up,
/// which are left empty so that line numbers can be counted in it, and for what of a very long line is far away.
pub(super) fn location(path: &Path, text: &[u8], range: Range<usize>) -> Location {
    /// What of a very long line is shown on each side.
    const AROUND: usize = 100;
    let range = range.start.min(text.len())..range.end.min(text.len());
    let start_of = |at: usize| text[..at].iter().rposition(|&b| is_end(b)).map_or(0, |i| i + 1);
    let end_of = |at: usize| text[at..].iter().position(|&b| is_end(b)).map_or(text.len(), |i| at + i);
    let lossy = |range: Range<usize>| String::from_utf8_lossy(&text[range]).into_owned();
    let (start, end) = (start_of(range.start), end_of(range.start));
    let line = line_of(text, range.start);
    let column = lossy(start..range.start).chars().count() as u32 + 1;

    let mut excerpt = "\n".repeat(line.saturating_sub(2) as usize);
    if line > 1 {
        let crlf = text[..start].ends_with(b"\r\n");
        let end_above = start - if crlf { 2 } else { 1 };
        let above = start_of(end_above);
        excerpt += &lossy(above..end_above.min(above + 2 * AROUND));
        excerpt.push('\n');
    }
    let shown_start = start.max(range.start.saturating_sub(AROUND));
    let shown_end = end.min(range.start + AROUND);
    let marked_end = range.end.min(shown_end);
    excerpt += &lossy(shown_start..range.start);
    let from = excerpt.len();
    excerpt += &lossy(range.start..marked_end);
    let to = excerpt.len();
    excerpt += &lossy(marked_end..shown_end);
    Location { line: Some((line, column)), excerpt: Some((excerpt.into(), from..to)), ..Location::file(path) }
}

/// Counts the places where the same thing is odd, to say it once.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Tally {
    count: u64,
    first: usize,
}

impl Tally {
    /// One more, at a byte of the text.
    pub(super) fn add(&mut self, at: usize) {
        if self.count == 0 {
            self.first = at;
        }
        self.count += 1;
    }

    /// Says it, if it occurred: `what` reads well after "12 × ", as in "12 × faces without area, left out (first in line 7)".
    pub(super) fn report(&self, warnings: &mut Warnings, name: &'static str, path: &Path, text: &[u8], what: &str) {
        if self.count > 0 {
            let line = line_of(text, self.first);
            let message = match self.count {
                1 => format!("{what} (line {line})"),
                n => format!("{what} ({n} times, first in line {line})"),
            };
            warnings.add(name, path, message);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(text: &str) -> Vec<Vec<String>> {
        let mut scanner = Scanner::at(text.as_bytes(), 0);
        let mut lines = Vec::new();
        while !scanner.is_done() {
            lines.push(std::iter::from_fn(|| scanner.word()).map(|w| w.shown()).collect());
            scanner.next_line();
        }
        lines
    }

    #[test]
    fn lines_end_in_every_style_and_backslashes_join_them() {
        assert_eq!(words("a b\r\nc\rd\n\ne"), [vec!["a", "b"], vec!["c"], vec!["d"], vec![], vec!["e"]]);
        assert_eq!(words("f 1\\\n2 \\\r\n 3\\x\ng"), [vec!["f", "1", "2", "3\\x"], vec!["g"]]);
        assert_eq!(words("a\\"), [vec!["a\\"]]);
    }

    #[test]
    fn names_keep_inner_blanks() {
        let mut scanner = Scanner::at(b"usemtl  many  spaces \t\r\nnext", 0);
        scanner.word();
        assert_eq!(scanner.rest(), "many  spaces");
    }

    #[test]
    fn utf16_is_decoded_in_both_orders() {
        assert_eq!(&*decode(b"\xfe\xff\0v\0 \x22\x1e"), "v \u{221e}".as_bytes());
        assert_eq!(&*decode(b"\xff\xfev\0 \0\x1e\x22\0"), "v \u{221e}".as_bytes());
        assert_eq!(&*decode(b"\xef\xbb\xbfv"), b"v");
    }

    #[test]
    fn numbers_agree_with_the_standard_library() {
        for text in [
            "0",
            "-0.0",
            "1",
            "+1",
            "2.",
            ".5",
            "-.5",
            "0.1",
            "3.14159265358979",
            "123456789012345678901234567890",
            "1e10",
            "1E-3",
            "-2.e1",
            "00012.500",
            "9007199254740993",
            "1.7976931348623157e308",
            "4.9e-324",
            "552.8",
            "-1.146",
            "0.000001",
            "123456789.0123456",
        ] {
            let expected: f64 = text.parse().unwrap();
            assert_eq!(number(text.as_bytes()).map(f64::to_bits), Some(expected.to_bits()), "{text}");
        }
        for text in ["nan", "-nan", "NaN", "1.#QNAN", "-1.#IND", "1.#INF"] {
            assert!(number(text.as_bytes()).is_some_and(f64::is_nan), "{text}");
        }
        assert_eq!(number(b"-Inf"), Some(f64::NEG_INFINITY));
        for text in ["", ".", "-", "+", "3.1+e2", "1e", "e5", "1..2", "0x10", "1,5", "--1", "\u{fffd}"] {
            assert_eq!(number(text.as_bytes()), None, "{text}");
        }
    }

    #[test]
    fn locations_count_lines_and_characters() {
        let text = "v 1\r\nf é 2\nx".as_bytes();
        let at = text.iter().position(|&b| b == b'2').unwrap();
        let location = location(Path::new("a.obj"), text, at..at + 1);
        assert_eq!(location.line, Some((2, 5)));
        let (excerpt, range) = location.excerpt.unwrap();
        assert_eq!((&*excerpt, &excerpt[range]), ("v 1\nf é 2", "2"));
    }
}
