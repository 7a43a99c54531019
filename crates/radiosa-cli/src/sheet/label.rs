//! Text on a page, anti-aliased, from glyphs of Noto Sans Mono that are part of the command: Latin letters, digits, punctuation, × ² · °.
//! After a single letter, `_` sets what follows as a subscript: `k_d`.

use noto_sans_mono_bitmap::{FontWeight, RasterHeight, RasterizedChar, get_raster, get_raster_width};

use super::page::Page;

/// How letters look.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Style {
    size: RasterHeight,
    weight: FontWeight,
}

impl Style {
    /// Letters that suit cells of this width.
    pub(crate) fn for_cells(width: u32) -> Self {
        let size = match width {
            0..=139 => RasterHeight::Size16,
            140..=299 => RasterHeight::Size20,
            _ => RasterHeight::Size24,
        };
        Self { size, weight: FontWeight::Regular }
    }

    /// The same in bold.
    pub(crate) fn bold(self) -> Self {
        Self { weight: FontWeight::Bold, ..self }
    }

    /// From one line to the next, pixels.
    pub(crate) fn line_height(self) -> u32 {
        self.size.val() as u32 + 2
    }

    fn letter_width(self) -> u32 {
        get_raster_width(self.weight, self.size) as u32
    }

    fn subscript(self) -> Self {
        Self { size: RasterHeight::Size16, ..self }
    }
}

/// A letter as it is set.
struct Letter {
    glyph: RasterizedChar,
    x: u32,
    y: u32,
}

/// The letters of a line and its width, pixels.
fn set(text: &str, style: Style) -> (Vec<Letter>, u32) {
    let (mut letters, mut x) = (Vec::new(), 0);
    let chars: Vec<char> = text.chars().collect();
    let is_word = |c: char| c.is_alphanumeric();
    let mut sub = false;
    for (i, &c) in chars.iter().enumerate() {
        // Signs outside Latin-1 that look much like one inside.
        let c = if matches!(c, '–' | '—' | '−') { '-' } else { c };
        let starts = c == '_'
            && i > 0
            && is_word(chars[i - 1])
            && (i < 2 || !is_word(chars[i - 2]) && chars[i - 2] != '_')
            && chars.get(i + 1).is_some_and(|&n| is_word(n));
        if starts {
            sub = true;
            continue;
        }
        sub &= is_word(c);
        let own = if sub { style.subscript() } else { style };
        let glyph = get_raster(c, own.weight, own.size).or_else(|| get_raster('?', own.weight, own.size));
        if let Some(glyph) = glyph {
            // The foot of the smaller letter stands a little below the line.
            let y = if sub { style.size.val() as u32 + 2 - own.size.val() as u32 } else { 0 };
            letters.push(Letter { glyph, x, y });
        }
        x += own.letter_width();
    }
    (letters, x)
}

/// The width of a line, pixels.
pub(crate) fn width(text: &str, style: Style) -> u32 {
    set(text, style).1
}

/// Breaks a text between words, and within words where there is no other way, so that no line is wider than `most`; at most `n` lines,
/// the last ending with two dots when something is left out.
pub(crate) fn wrap(text: &str, style: Style, most: u32, n: usize) -> Vec<String> {
    let fits = |line: &str| width(line, style) <= most;
    let mut lines: Vec<String> = Vec::new();
    let mut line = String::new();
    for word in text.split_whitespace() {
        let joined = if line.is_empty() { word.to_owned() } else { format!("{line} {word}") };
        if fits(&joined) {
            line = joined;
            continue;
        }
        if !line.is_empty() {
            lines.push(std::mem::take(&mut line));
        }
        for c in word.chars() {
            if !line.is_empty() && !fits(&format!("{line}{c}")) {
                lines.push(std::mem::take(&mut line));
            }
            line.push(c);
        }
        if lines.len() > n {
            break;
        }
    }
    if !line.is_empty() {
        lines.push(line);
    }
    if lines.len() > n {
        lines.truncate(n);
        if let Some(last) = lines.last_mut() {
            while !last.is_empty() && !fits(&format!("{last}..")) {
                last.pop();
            }
            last.push_str("..");
        }
    }
    lines
}

/// Writes a line with its upper left corner there.
pub(crate) fn draw(page: &mut Page, text: &str, style: Style, x: u32, y: u32) {
    for letter in set(text, style).0 {
        for (dy, row) in letter.glyph.rows().enumerate() {
            for (dx, &ink) in row.iter().enumerate() {
                page.ink(x + letter.x + dx as u32, y + letter.y + dy as u32, ink);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_underscore_after_a_single_letter_makes_a_subscript_and_others_stay() {
        let style = Style::for_cells(200);
        let (normal, small) = (style.letter_width(), style.subscript().letter_width());
        assert!(small < normal);
        assert_eq!(width("k_d = 1", style), 5 * normal + small);
        assert_eq!(width("fov_y", style), 5 * normal);
        assert_eq!(width("I_a", style), normal + small);
        assert_eq!(width("_", style), normal);
    }

    #[test]
    fn no_line_is_wider_than_allowed_and_what_is_left_out_shows() {
        let style = Style::for_cells(200);
        for text in ["", "a", "two words", "unbreakablylongwordwithoutanyspaces", "many words one after the other until it ends"]
        {
            let lines = wrap(text, style, 100, 3);
            assert!(lines.len() <= 3 && lines.iter().all(|l| width(l, style) <= 100), "{lines:?}");
        }
        assert!(wrap("many words one after the other until it ends", style, 100, 3)[2].ends_with(".."));
        assert_eq!(wrap("two words", style, 1000, 3), ["two words"]);
    }

    #[test]
    fn every_sign_a_label_needs_has_a_glyph() {
        for c in "abcXYZ0189.,:;=+-[](){}'\"/×²·°".chars() {
            assert!(get_raster(c, FontWeight::Regular, RasterHeight::Size20).is_some(), "{c}");
        }
    }
}
