//! PNG: what a screen shows, 8 or 16 bits, sRGB.

use std::io::{self, BufRead, Seek, Write};

use png::{BitDepth, ColorType, Decoder, Encoder, EncodingError, Limits, SrgbRenderingIntent};

use super::recipe::{PREFIX, Recipe};
use super::{Options, PngDepth};
use crate::film::Film;

/// Writes the film's colour, tone-mapped.
pub(super) fn write(film: &Film, out: &mut impl Write, recipe: &Recipe, options: &Options) -> io::Result<()> {
    let shown = options.tone_map.prepare(film);
    let recipe = recipe.clone().with("exposure", shown.factor.to_string()).with("tone-map", options.tone_map.curve.to_string());

    let size = (film.width(), film.height());
    match options.png_depth {
        PngDepth::Eight => write_bytes(out, size, PngDepth::Eight, &shown.to_srgb8(film), &recipe),
        PngDepth::Sixteen => {
            let bytes: Vec<u8> = shown.to_srgb16(film).into_iter().flat_map(u16::to_be_bytes).collect();
            write_bytes(out, size, PngDepth::Sixteen, &bytes, &recipe)
        }
    }
}

/// Writes RGB values as they are in the file, with the recipe.
pub(super) fn write_bytes(
    out: &mut impl Write,
    (width, height): (u32, u32),
    depth: PngDepth,
    bytes: &[u8],
    recipe: &Recipe,
) -> io::Result<()> {
    let mut encoder = Encoder::new(out, width, height);
    encoder.set_color(ColorType::Rgb);
    encoder.set_depth(match depth {
        PngDepth::Eight => BitDepth::Eight,
        PngDepth::Sixteen => BitDepth::Sixteen,
    });
    encoder.set_source_srgb(SrgbRenderingIntent::Perceptual);
    encoder.add_text_chunk("Software".into(), concat!("Radiosa ", env!("CARGO_PKG_VERSION")).into()).map_err(to_io)?;
    // tEXt holds Latin-1 only. One kind for all entries keeps them in order.
    let plain = recipe.entries().iter().all(|(_, text)| text.is_ascii());
    for (key, text) in recipe.entries() {
        let keyword = format!("{PREFIX}{key}");
        if plain { encoder.add_text_chunk(keyword, text.clone()) } else { encoder.add_itxt_chunk(keyword, text.clone()) }
            .map_err(to_io)?;
    }

    let mut writer = encoder.write_header().map_err(to_io)?;
    writer.write_image_data(bytes).map_err(to_io)?;
    writer.finish().map_err(to_io)
}

fn to_io(error: EncodingError) -> io::Error {
    match error {
        EncodingError::IoError(e) => e,
        other => io::Error::other(other.to_string()),
    }
}

/// The entries in the text chunks before the pixels.
pub(super) fn read_recipe(file: impl BufRead + Seek) -> Result<Recipe, String> {
    let reader = Decoder::new_with_limits(file, Limits { bytes: 64 << 20 }).read_info().map_err(|e| e.to_string())?;
    let mut recipe = Recipe::new();
    let info = reader.info();
    for chunk in &info.uncompressed_latin1_text {
        if let Some(key) = chunk.keyword.strip_prefix(PREFIX) {
            recipe.set(key, &chunk.text);
        }
    }
    for chunk in &info.utf8_text {
        if let (Some(key), Ok(text)) = (chunk.keyword.strip_prefix(PREFIX), chunk.get_text()) {
            recipe.set(key, text);
        }
    }
    Ok(recipe)
}
