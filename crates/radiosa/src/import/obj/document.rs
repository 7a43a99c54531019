//! The statements of an OBJ file, as columns of numbers and names; nothing is interpreted beyond resolving indices.

use std::collections::HashMap;
use std::path::Path;

use super::text::{Scanner, Tally, Word, location, number};
use crate::import::{ImportError, Warnings};
use crate::math::{DVec3, Vec2, Vec3, Vec4, function};

/// Stands for an index that is not given.
pub(super) const NONE: u32 = u32::MAX;

/// Coordinates beyond this cannot be told from infinity later (their squares overflow f32 even after recentring a scene).
const LARGEST_COORDINATE: f64 = 1e18;

/// One corner of a face: indices from 0 into the columns; texture coordinate and normal may be [`NONE`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Corner {
    pub v: u32,
    pub vt: u32,
    pub vn: u32,
}

/// One face with at least three corners.
#[derive(Clone, Copy, Debug)]
pub(super) struct Face {
    /// Into [`Document::corners`].
    pub first: u32,
    /// One past the last corner.
    pub end: u32,
    /// Into [`Document::groups`].
    pub group: u32,
    /// Into [`Document::materials`], or [`NONE`].
    pub material: u32,
    /// Smoothing group; 0: none.
    pub smooth: u32,
    /// First byte of its line.
    pub at: u32,
}

/// An object and a group in it, whatever the order of the statements.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct Group {
    /// Name after `o`; `None` before the first.
    pub object: Option<String>,
    /// Name after `g`; `None` before the first.
    pub group: Option<String>,
}

/// A parsed file.
#[derive(Debug, Default)]
pub(super) struct Document {
    /// NaN where a line cannot be read.
    pub positions: Vec<DVec3>,
    /// As long as `positions`, or empty when no vertex has a colour; linear, white where a vertex has none.
    pub colors: Vec<Vec4>,
    /// As the file has them: v = 0 at the bottom.
    pub uvs: Vec<Vec2>,
    /// Unit length; zero where not usable.
    pub normals: Vec<Vec3>,
    pub corners: Vec<Corner>,
    pub faces: Vec<Face>,
    /// In order of first use by a face.
    pub groups: Vec<Group>,
    /// Names after `usemtl`, in order of first use.
    pub materials: Vec<String>,
    /// What follows each `mtllib`.
    pub libraries: Vec<String>,
}

/// What is odd in a file, by kind.
#[derive(Default)]
struct Oddities<'a> {
    malformed_number: Tally,
    short_face: Tally,
    missing_attribute: Tally,
    colour_range: Tally,
    smoothing: Tally,
    curves: Tally,
    lines: Tally,
    unknown: Tally,
    unknown_words: Vec<Word<'a>>,
}

/// Reads the statements of a text.
///
/// # Errors
/// A face that refers to a vertex that does not exist or holds something that is no index; a text without a single OBJ statement.
pub(super) fn parse(text: &[u8], path: &Path, warnings: &mut Warnings) -> Result<Document, ImportError> {
    let mut parser = Parser { text, path, document: Document::default(), odd: Oddities::default(), state: State::default() };
    let mut known = false;
    let mut scanner = Scanner::at(text, 0);
    while !scanner.is_done() {
        let start = scanner.position();
        match scanner.word() {
            Some(word) if word.bytes[0] == b'#' => {
                scanner.next_line_after_comment();
                continue;
            }
            Some(word) => known |= parser.statement(word, &mut scanner, start)?,
            None => {}
        }
        scanner.next_line();
    }
    if let (false, Some(word)) = (known, parser.odd.unknown_words.first()) {
        let message = format!("this is no OBJ file: it has no OBJ statement, and starts with {:?}", word.shown());
        return Err(ImportError::invalid_with_help(
            location(path, text, word.range()),
            message,
            "check that its ending is the right one",
        ));
    }
    parser.check_references()?;
    parser.report(warnings);
    Ok(parser.document)
}

/// What the statements so far have set for the next face.
#[derive(Default)]
struct State {
    object: Option<String>,
    group: Option<String>,
    /// Index of the current group, once a face has used it.
    current: Option<u32>,
    material: Option<u32>,
    smooth: u32,
    groups: HashMap<Group, u32>,
    materials: HashMap<String, u32>,
}

struct Parser<'a> {
    text: &'a [u8],
    path: &'a Path,
    document: Document,
    odd: Oddities<'a>,
    state: State,
}

impl<'a> Parser<'a> {
    /// One line; false when its keyword is not OBJ's.
    fn statement(&mut self, keyword: Word<'a>, scanner: &mut Scanner<'a>, start: usize) -> Result<bool, ImportError> {
        match keyword.bytes {
            b"v" => self.vertex(keyword, scanner),
            b"vt" => {
                let [u, v] = self.numbers(keyword, scanner, 1);
                self.document.uvs.push(Vec2::new(u as f32, v as f32));
            }
            b"vn" => {
                let n = DVec3::from(self.numbers(keyword, scanner, 3));
                self.document.normals.push(n.normalize_or_zero().as_vec3());
            }
            b"f" | b"fo" => self.face(keyword, scanner, start)?,
            b"o" => {
                self.state.object = Some(scanner.rest()).filter(|name| !name.is_empty());
                self.state.current = None;
            }
            b"g" => {
                // A statement may name several groups its faces belong to; together they are one name here.
                let names: Vec<_> = std::iter::from_fn(|| scanner.word()).map(|w| String::from_utf8_lossy(w.bytes)).collect();
                self.state.group = Some(names.join(" ")).filter(|name| !name.is_empty());
                self.state.current = None;
            }
            b"s" => {
                self.state.smooth = match scanner.word().map(|w| w.bytes) {
                    None | Some(b"off" | b"0" | b"null" | b"none") => 0,
                    Some(b"on") => 1,
                    Some(word) => std::str::from_utf8(word).ok().and_then(|w| w.parse().ok()).unwrap_or_else(|| {
                        self.odd.smoothing.add(start);
                        0
                    }),
                };
            }
            b"usemtl" => {
                let name = scanner.rest();
                let next = self.document.materials.len() as u32;
                let id = *self.state.materials.entry(name.clone()).or_insert(next);
                if id == next {
                    self.document.materials.push(name);
                }
                self.state.material = Some(id);
            }
            b"mtllib" => self.document.libraries.push(scanner.rest()),
            b"l" | b"p" => self.odd.lines.add(start),
            b"vp" | b"deg" | b"bmat" | b"step" | b"cstype" | b"curv" | b"curv2" | b"surf" | b"parm" | b"trim" | b"hole"
            | b"scrv" | b"sp" | b"end" | b"con" | b"ctech" | b"stech" | b"bsp" | b"bzp" | b"cdc" | b"cdp" | b"res" => {
                self.odd.curves.add(start)
            }
            // Hints for display, of no meaning here.
            b"mg" | b"bevel" | b"c_interp" | b"d_interp" | b"lod" | b"shadow_obj" | b"trace_obj" | b"usemap" | b"maplib" => {}
            _ => {
                self.odd.unknown.add(start);
                let words = &mut self.odd.unknown_words;
                if words.len() < 5 && words.iter().all(|w| w.bytes != keyword.bytes) {
                    words.push(keyword);
                }
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// The next N numbers of a line; those beyond the `needed` ones may be absent (0). NaN where one cannot be read.
    fn numbers<const N: usize>(&mut self, keyword: Word<'a>, scanner: &mut Scanner<'a>, needed: usize) -> [f64; N] {
        let mut good = true;
        let values = std::array::from_fn(|i| {
            let value = match scanner.word() {
                Some(word) => number(word.bytes),
                None => (i >= needed).then_some(0.0),
            };
            good &= value.is_some();
            value.unwrap_or(f64::NAN)
        });
        if !good {
            self.odd.malformed_number.add(keyword.at);
        }
        values
    }

    /// `v x y z`, then nothing, `w` (a weight for curves, not used), `r g b` or `r g b a`.
    fn vertex(&mut self, keyword: Word<'a>, scanner: &mut Scanner<'a>) {
        let [x, y, z] = self.numbers(keyword, scanner, 3);
        let p = DVec3::new(x, y, z);
        let usable = p.is_finite() && p.abs().max_element() <= LARGEST_COORDINATE;
        let n = self.document.positions.len();
        self.document.positions.push(if usable { p } else { DVec3::NAN });

        let mut extra = [1.0; 4];
        let mut n_extra = 0;
        while let Some(word) = scanner.word().filter(|w| w.bytes[0] != b'#' && n_extra < 4) {
            match number(word.bytes) {
                Some(value) => extra[n_extra] = value as f32,
                None => return self.odd.malformed_number.add(keyword.at),
            }
            n_extra += 1;
        }
        if n_extra >= 3 {
            let linear = |c: f32| {
                let c = if c.is_nan() { 1.0 } else { c.clamp(0.0, 1.0) };
                if c <= 0.04045 { c / 12.92 } else { function::pow((c + 0.055) / 1.055, 2.4) }
            };
            if extra.iter().any(|c| !(0.0..=1.0).contains(c)) {
                self.odd.colour_range.add(keyword.at);
            }
            let alpha = if extra[3].is_nan() { 1.0 } else { extra[3].clamp(0.0, 1.0) };
            self.document.colors.resize(n, Vec4::ONE);
            self.document.colors.push(Vec4::new(linear(extra[0]), linear(extra[1]), linear(extra[2]), alpha));
        } else if !self.document.colors.is_empty() {
            self.document.colors.push(Vec4::ONE);
        }
    }

    fn face(&mut self, keyword: Word<'a>, scanner: &mut Scanner<'a>, start: usize) -> Result<(), ImportError> {
        let first = self.document.corners.len();
        while let Some(word) = scanner.word().filter(|w| w.bytes[0] != b'#') {
            let corner = self.corner(word)?;
            self.document.corners.push(corner);
        }
        let end = self.document.corners.len();
        if end - first < 3 {
            self.document.corners.truncate(first);
            self.odd.short_face.add(keyword.at);
            return Ok(());
        }
        let group = self.group();
        self.document.faces.push(Face {
            first: first as u32,
            end: end as u32,
            group,
            material: self.state.material.unwrap_or(NONE),
            smooth: self.state.smooth,
            at: start as u32,
        });
        Ok(())
    }

    /// The group the next face belongs to.
    fn group(&mut self) -> u32 {
        if let Some(current) = self.state.current {
            return current;
        }
        let key = Group { object: self.state.object.clone(), group: self.state.group.clone() };
        let next = self.document.groups.len() as u32;
        let id = *self.state.groups.entry(key.clone()).or_insert(next);
        if id == next {
            self.document.groups.push(key);
        }
        self.state.current = Some(id);
        id
    }

    /// `v`, `v/vt`, `v//vn` or `v/vt/vn`; negative indices count back from the last vertex so far. Positive ones may
    /// point ahead: they are checked at the end of the file.
    fn corner(&mut self, word: Word<'a>) -> Result<Corner, ImportError> {
        let mut parts = word.bytes.split(|&b| b == b'/');
        let malformed = || {
            let message = format!("{:?} is no corner of a face", word.shown());
            let help = "a corner is one of v, v/vt, v//vn, v/vt/vn, where each is an index";
            ImportError::invalid_with_help(location(self.path, self.text, word.range()), message, help)
        };
        let mut part = |optional: bool| match parts.next() {
            None | Some([]) if optional => Ok(None),
            Some(bytes) => index(bytes).map(Some).ok_or_else(malformed),
            None => Err(malformed()),
        };
        let (v, vt, vn) = (part(false)?, part(true)?, part(true)?);
        if parts.next().is_some() {
            return Err(malformed());
        }
        let d = &self.document;
        let v = v.unwrap_or(0);
        let vertex = resolve(v, d.positions.len()).ok_or_else(|| self.no_vertex(word, v))?;
        let (n_uvs, n_normals) = (d.uvs.len(), d.normals.len());
        let mut attribute = |index: Option<i64>, count| match index {
            None => NONE,
            Some(index) => resolve(index, count).unwrap_or_else(|| {
                self.odd.missing_attribute.add(word.at);
                NONE
            }),
        };
        Ok(Corner { v: vertex, vt: attribute(vt, n_uvs), vn: attribute(vn, n_normals) })
    }

    fn no_vertex(&self, word: Word<'a>, index: i64) -> ImportError {
        let n = self.document.positions.len();
        let count = |n, tail| if n == 1 { format!("1 vertex {tail}") } else { format!("{n} vertices {tail}") };
        let message = match index {
            0 => "a face refers to vertex 0, but vertices count from 1".to_owned(),
            ..0 => format!("a face refers to vertex {index}, counting back, but there are only {}", count(n, "before it")),
            _ => format!("a face refers to vertex {index}, but there are only {}", count(n, "in the file")),
        };
        let help = "the file is damaged, cut off, or one part of several; export it again";
        ImportError::invalid_with_help(location(self.path, self.text, word.range()), message, help)
    }

    /// Positive indices may point ahead in the file; at its end everything must exist.
    fn check_references(&mut self) -> Result<(), ImportError> {
        let d = &self.document;
        let (n_positions, n_uvs, n_normals) = (d.positions.len() as u32, d.uvs.len() as u32, d.normals.len() as u32);
        for f in 0..self.document.faces.len() {
            let Face { first, end, at, .. } = self.document.faces[f];
            for c in first..end {
                let corner = &mut self.document.corners[c as usize];
                for (index, count) in [(&mut corner.vt, n_uvs), (&mut corner.vn, n_normals)] {
                    if *index != NONE && *index >= count {
                        self.odd.missing_attribute.add(at as usize);
                        *index = NONE;
                    }
                }
                let v = corner.v;
                if v >= n_positions {
                    // The place was not kept: walk the line again. The keyword is its first word.
                    let mut scanner = Scanner::at(self.text, at as usize);
                    let word = std::iter::from_fn(|| scanner.word()).nth((c - first) as usize + 1);
                    let word = word.unwrap_or(Word { at: at as usize, bytes: b"" });
                    return Err(self.no_vertex(word, i64::from(v) + 1));
                }
            }
        }
        Ok(())
    }

    fn report(&self, warnings: &mut Warnings) {
        let odd = &self.odd;
        let unknown: Vec<_> = odd.unknown_words.iter().map(|w| w.shown()).collect();
        let unknown = format!("statements that are not OBJ's are ignored: {}", unknown.join(", "));
        for (name, tally, what) in [
            (
                "malformed-number",
                odd.malformed_number,
                "a line with a number that cannot be read or is missing: what uses it is left out",
            ),
            ("short-face", odd.short_face, "a face with fewer than three corners is left out"),
            (
                "missing-attribute",
                odd.missing_attribute,
                "a face refers to texture coordinates or normals that do not exist: it goes without",
            ),
            ("colour-out-of-range", odd.colour_range, "a vertex colour outside 0 … 1 is clamped"),
            ("malformed-smoothing-group", odd.smoothing, "a smoothing group that is no number counts as off"),
            ("ignored-lines-and-points", odd.lines, "lines and points (l, p) have no area and are ignored"),
            ("ignored-curves", odd.curves, "free-form curves and surfaces are ignored: convert them to polygons"),
            ("unknown-statement", odd.unknown, &unknown),
        ] {
            tally.report(warnings, name, self.path, self.text, what);
        }
    }
}

/// A decimal integer with an optional sign; `None` when it is none. Absurdly large ones become the largest.
fn index(bytes: &[u8]) -> Option<i64> {
    let (negative, digits) = match bytes {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        _ => (false, bytes),
    };
    if digits.is_empty() {
        return None;
    }
    let mut value = 0i64;
    for &byte in digits {
        if !byte.is_ascii_digit() {
            return None;
        }
        value = value.saturating_mul(10).saturating_add(i64::from(byte - b'0'));
    }
    Some(if negative { -value } else { value })
}

/// From a file's index to one from 0, given how many there are so far; `None` when it cannot exist.
fn resolve(index: i64, count: usize) -> Option<u32> {
    let from_zero = if index > 0 { index - 1 } else { (index < 0).then(|| count as i64 + index)? };
    u32::try_from(from_zero).ok().filter(|&i| i != NONE)
}
