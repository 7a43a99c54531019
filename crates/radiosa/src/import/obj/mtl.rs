//! The statements of an MTL file, as numbers and names. `material` says what they mean.

use std::path::Path;

use super::text::{Scanner, Tally, Word, number, shown};
use crate::import::Warnings;
use crate::spectrum::Spectrum;

/// One `newmtl`, as written; `None` is what the file does not say.
#[derive(Clone, Debug, Default)]
pub(super) struct Definition {
    pub name: String,
    pub ambient: Option<Spectrum>,
    pub diffuse: Option<Spectrum>,
    pub specular: Option<Spectrum>,
    pub emission: Option<Spectrum>,
    /// `Tf`, or `Kt` as some write it.
    pub transmission: Option<Spectrum>,
    /// `Ns`.
    pub exponent: Option<f32>,
    /// `Ni`.
    pub ior: Option<f32>,
    /// From `d` or `Tr`, whichever came last.
    pub opacity: Option<f32>,
    pub illum: Option<i32>,
    /// `Pr`.
    pub roughness: Option<f32>,
    /// `Pm`.
    pub metallic: Option<f32>,
    pub map_ambient: Option<Map>,
    pub map_diffuse: Option<Map>,
    pub map_specular: Option<Map>,
    pub map_emission: Option<Map>,
    pub map_exponent: Option<Map>,
    pub map_opacity: Option<Map>,
    pub map_roughness: Option<Map>,
    pub map_metallic: Option<Map>,
    /// Heights.
    pub map_bump: Option<Map>,
    /// Normals.
    pub map_normal: Option<Map>,
}

/// A picture and how it is applied.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Map {
    pub file: String,
    /// `-o`, in the file's sense (v upwards).
    pub offset: [f64; 2],
    /// `-s`.
    pub scale: [f64; 2],
    /// `-bm`.
    pub bump: f32,
    /// `-clamp on`.
    pub clamp: bool,
    /// `-imfchan`: 0 red … 3 alpha.
    pub channel: Option<u8>,
    /// `-colorspace`.
    pub is_srgb: Option<bool>,
}

/// Reads the materials of a text, in its order.
pub(super) fn parse(text: &[u8], path: &Path, warnings: &mut Warnings) -> Vec<Definition> {
    let mut reader = Reader { path, warnings, malformed: Tally::default(), contradiction: Tally::default(), last_opacity: None };
    let mut definitions: Vec<Definition> = Vec::new();
    let mut orphan = Tally::default();
    let mut scanner = Scanner::at(text, 0);
    while !scanner.is_done() {
        match scanner.word() {
            Some(word) if word.bytes[0] == b'#' => {
                scanner.next_line_after_comment();
                continue;
            }
            Some(word) if word.bytes.eq_ignore_ascii_case(b"newmtl") => {
                definitions.push(Definition { name: scanner.rest(), ..Definition::default() });
                reader.last_opacity = None;
            }
            Some(word) => match definitions.last_mut() {
                Some(definition) => reader.statement(definition, word, &mut scanner),
                None => orphan.add(word.at),
            },
            None => {}
        }
        scanner.next_line();
    }
    let Reader { malformed, contradiction, .. } = reader;
    for (name, tally, what) in [
        ("malformed-material", malformed, "a material statement that cannot be read is ignored"),
        ("contradictory-opacity", contradiction, "d and Tr (which is 1 − d) contradict each other: the later one is used"),
        ("statement-outside-material", orphan, "a statement before the first newmtl is ignored"),
    ] {
        tally.report(warnings, name, path, text, what);
    }
    definitions
}

struct Reader<'a> {
    path: &'a Path,
    warnings: &'a mut Warnings,
    malformed: Tally,
    contradiction: Tally,
    /// Opacity the current material already has, to notice contradictions.
    last_opacity: Option<f32>,
}

impl Reader<'_> {
    fn statement(&mut self, m: &mut Definition, keyword: Word<'_>, scanner: &mut Scanner<'_>) {
        let lower = keyword.bytes.to_ascii_lowercase();
        match lower.as_slice() {
            b"ka" => self.color(&mut m.ambient, keyword, scanner),
            b"kd" => self.color(&mut m.diffuse, keyword, scanner),
            b"ks" => self.color(&mut m.specular, keyword, scanner),
            b"ke" => self.color(&mut m.emission, keyword, scanner),
            b"tf" | b"kt" => self.color(&mut m.transmission, keyword, scanner),
            b"ns" => self.scalar(&mut m.exponent, keyword, scanner),
            b"ni" => self.scalar(&mut m.ior, keyword, scanner),
            b"pr" => self.scalar(&mut m.roughness, keyword, scanner),
            b"pm" => self.scalar(&mut m.metallic, keyword, scanner),
            b"illum" => {
                let mut value = None;
                self.scalar(&mut value, keyword, scanner);
                m.illum = value.map(|v| v as i32).or(m.illum);
            }
            b"d" | b"tr" => {
                let mut value = None;
                let start = scanner.clone();
                if scanner.word().is_some_and(|w| w.bytes.eq_ignore_ascii_case(b"-halo")) {
                    self.ignored("d -halo", "opacity that depends on the angle");
                } else {
                    *scanner = start;
                }
                self.scalar(&mut value, keyword, scanner);
                if let Some(value) = value {
                    let opacity = if lower == b"tr" { 1.0 - value } else { value }.clamp(0.0, 1.0);
                    if self.last_opacity.is_some_and(|last| (last - opacity).abs() > 1e-3) {
                        self.contradiction.add(keyword.at);
                    }
                    self.last_opacity = Some(opacity);
                    m.opacity = Some(opacity);
                }
            }
            b"map_ka" => self.map(&mut m.map_ambient, keyword, scanner),
            b"map_kd" => self.map(&mut m.map_diffuse, keyword, scanner),
            b"map_ks" => self.map(&mut m.map_specular, keyword, scanner),
            b"map_ke" => self.map(&mut m.map_emission, keyword, scanner),
            b"map_ns" => self.map(&mut m.map_exponent, keyword, scanner),
            b"map_d" => self.map(&mut m.map_opacity, keyword, scanner),
            b"map_pr" => self.map(&mut m.map_roughness, keyword, scanner),
            b"map_pm" => self.map(&mut m.map_metallic, keyword, scanner),
            b"map_bump" | b"bump" => self.map(&mut m.map_bump, keyword, scanner),
            b"norm" | b"map_kn" => self.map(&mut m.map_normal, keyword, scanner),
            b"map_tr" => self.ignored("map_Tr", "a map of transparency; map_d is read"),
            b"disp" | b"map_disp" => self.ignored("disp", "displacement"),
            b"decal" => self.ignored("decal", "a decal"),
            b"refl" | b"map_refl" => self.ignored("refl", "a reflection map; surroundings come from the scene"),
            b"ps" | b"map_ps" => self.ignored("Ps", "sheen"),
            b"pc" | b"pcr" => self.ignored("Pc", "clear coat"),
            b"aniso" | b"anisor" => self.ignored("aniso", "anisotropy"),
            // Hints for other renderers, of no meaning here.
            b"sharpness" | b"map_aat" | b"ao" | b"map_ao" => {}
            _ => {
                let message = format!("{:?} is no statement known in materials and is ignored", keyword.shown());
                self.warnings.add("unknown-material-statement", self.path, message);
            }
        }
    }

    fn ignored(&mut self, statement: &str, what: &str) {
        self.warnings.add("ignored-material-statement", self.path, format!("{statement} ({what}) is ignored"));
    }

    fn scalar(&mut self, slot: &mut Option<f32>, keyword: Word<'_>, scanner: &mut Scanner<'_>) {
        match scanner.word().and_then(|w| number(w.bytes)).map(|v| v as f32).filter(|v| v.is_finite()) {
            Some(value) => *slot = Some(value),
            None => self.malformed.add(keyword.at),
        }
    }

    /// `r`, `r g b`, `xyz x y z` (CIE, white D65) or `spectral file factor`, which is not read.
    fn color(&mut self, slot: &mut Option<Spectrum>, keyword: Word<'_>, scanner: &mut Scanner<'_>) {
        let mut first = scanner.word();
        let is = |word: Option<Word<'_>>, name: &[u8]| word.is_some_and(|w| w.bytes.eq_ignore_ascii_case(name));
        if is(first, b"spectral") {
            return self.ignored(&format!("{} spectral", keyword.shown()), "a spectral curve");
        }
        let is_xyz = is(first, b"xyz");
        if is_xyz {
            first = scanner.word();
        }
        let mut next = || scanner.word().filter(|w| w.bytes[0] != b'#').map(|w| number(w.bytes));
        let r = first.and_then(|w| number(w.bytes));
        // One number stands for all three.
        let (g, b) = (next().unwrap_or(r), next().unwrap_or(r));
        let color = match (r, g, b) {
            (Some(x), Some(y), Some(z)) if is_xyz => {
                let row = |a: f64, b: f64, c: f64| (a * x + b * y + c * z) as f32;
                // IEC 61966-2-1, from CIE XYZ to linear Rec. 709 primaries.
                Spectrum::new(row(3.2406, -1.5372, -0.4986), row(-0.9689, 1.8758, 0.0415), row(0.0557, -0.2040, 1.0570))
            }
            (Some(r), Some(g), Some(b)) => Spectrum::new(r as f32, g as f32, b as f32),
            _ => return self.malformed.add(keyword.at),
        };
        if !color.is_finite() {
            return self.malformed.add(keyword.at);
        }
        if [color.r, color.g, color.b].iter().any(|c| *c < 0.0) {
            let message = format!("{} has a channel below zero, taken as zero", keyword.shown());
            self.warnings.add("negative-colour", self.path, message);
        }
        *slot = Some(color.map(|c| c.max(0.0)));
    }

    /// Options, then the name of a file, which may hold blanks.
    fn map(&mut self, slot: &mut Option<Map>, keyword: Word<'_>, scanner: &mut Scanner<'_>) {
        let mut map =
            Map { file: String::new(), offset: [0.0; 2], scale: [1.0; 2], bump: 1.0, clamp: false, channel: None, is_srgb: None };
        loop {
            let before = scanner.clone();
            let Some(option) = scanner.word().filter(|w| w.bytes[0] == b'-' && w.bytes.len() > 1) else {
                *scanner = before;
                break;
            };
            match option.bytes.to_ascii_lowercase().as_slice() {
                b"-o" => triple(&mut map.offset, scanner),
                b"-s" => triple(&mut map.scale, scanner),
                b"-t" => {
                    let mut turbulence = [0.0; 2];
                    triple(&mut turbulence, scanner);
                    if turbulence != [0.0; 2] {
                        self.ignored("-t", "turbulence of a texture");
                    }
                }
                b"-mm" => {
                    let (base, gain) = (next_number(scanner), next_number(scanner));
                    if (base, gain) != (Some(0.0), Some(1.0)) {
                        self.ignored("-mm", "base and gain of a texture");
                    }
                }
                b"-bm" => map.bump = next_number(scanner).map_or(1.0, |v| v as f32),
                b"-clamp" => map.clamp = scanner.word().is_some_and(|w| w.bytes.eq_ignore_ascii_case(b"on")),
                b"-imfchan" => {
                    map.channel = match scanner.word().map(|w| w.bytes) {
                        Some(b"r" | b"l" | b"z") => Some(0),
                        Some(b"g") => Some(1),
                        Some(b"b") => Some(2),
                        Some(b"m") => Some(3),
                        _ => None,
                    };
                }
                b"-colorspace" => {
                    map.is_srgb = scanner.word().and_then(|w| match w.bytes.to_ascii_lowercase().as_slice() {
                        b"srgb" => Some(true),
                        b"linear" => Some(false),
                        _ => None,
                    });
                }
                // Filtering is our own affair; the type of a reflection map means nothing elsewhere.
                b"-blendu" | b"-blendv" | b"-cc" | b"-texres" | b"-boost" | b"-type" => drop(scanner.word()),
                _ => {
                    // A file may be called "-something.png".
                    *scanner = before;
                    break;
                }
            }
        }
        map.file = scanner.rest().trim_matches('"').to_owned();
        if map.file.is_empty() {
            return self.malformed.add(keyword.at);
        }
        if map.file.len() > 4096 {
            let message = format!("{:?}… is too long for the name of a file", shown(map.file.as_bytes()));
            return self.warnings.add("malformed-material", self.path, message);
        }
        *slot = Some(map);
    }
}

fn next_number(scanner: &mut Scanner<'_>) -> Option<f64> {
    let before = scanner.clone();
    let value = scanner.word().and_then(|w| number(w.bytes)).filter(|v| v.is_finite());
    if value.is_none() {
        *scanner = before;
    }
    value
}

/// One to three numbers u v w, of which the last does not concern pictures. A number that ends the line is the file's name.
fn triple(values: &mut [f64; 2], scanner: &mut Scanner<'_>) {
    for i in 0..3 {
        let before = scanner.clone();
        let Some(value) = next_number(scanner) else { return };
        if scanner.clone().word().is_none() {
            *scanner = before;
            return;
        }
        if let Some(slot) = values.get_mut(i) {
            *slot = value;
        }
    }
}
