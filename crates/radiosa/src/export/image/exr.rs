//! OpenEXR: every layer as linear floats, ZIP-compressed scan lines.

use std::fs::File;
use std::io::{self, BufRead, Read, Seek, SeekFrom, Write};

use exr::block::writer::ChunksWriter;
use exr::block::{UncompressedBlock, enumerate_ordered_header_block_indices};
use exr::meta::BlockDescription;
use exr::meta::attribute::{AttributeValue, ChannelDescription, Chromaticities, Compression, LineOrder, SampleType, Text};
use exr::meta::header::{Header, LayerAttributes};
use exr::prelude::{SmallVec, Vec2, f16};
use rayon::prelude::*;

use super::ExrDepth;
use super::recipe::{PREFIX, Recipe};
use crate::film::{Film, Layer};

/// One channel of the file.
enum Source<'a> {
    Single(&'a [f32]),
    /// Written as 16-bit floats.
    Half(&'a [f32]),
    Ids(&'a [u32]),
}

/// Scan-line blocks that are compressed together, in parallel.
const N_BLOCKS_AT_ONCE: usize = 64;

/// Writes all layers of the film.
pub(super) fn write(film: &Film, out: &mut io::BufWriter<&mut File>, recipe: &Recipe, depth: ExrDepth) -> io::Result<()> {
    // The format wants channels sorted by name.
    let mut channels: Vec<(&str, Source)> = film
        .planes()
        .iter()
        .map(|p| {
            let half = depth == ExrDepth::Half && !matches!(p.layer, Layer::Depth | Layer::Position);
            (p.name, if half { Source::Half(&p.values) } else { Source::Single(&p.values) })
        })
        .chain(film.object_ids().map(|ids| (Layer::ObjectId.channels()[0], Source::Ids(ids))))
        .collect();
    channels.sort_by_key(|(name, _)| *name);

    let header = header(film, &channels, recipe);
    let width = film.width() as usize;
    exr::block::write(&mut *out, SmallVec::from_vec(vec![header]), true, |meta, writer| {
        let blocks: Vec<_> = enumerate_ordered_header_block_indices(&meta.headers).collect();
        for batch in blocks.chunks(N_BLOCKS_AT_ONCE) {
            let chunks: Vec<_> = batch
                .par_iter()
                .map(|&(i, index)| {
                    let block = UncompressedBlock::from_lines(&meta.headers[0].channels, index, |line| {
                        let start = line.location.position.y() * width + line.location.position.x();
                        let range = start..start + line.location.sample_count;
                        // Writing to memory of the right size, which `from_lines` provides, cannot fail.
                        let _ = match channels[line.location.channel].1 {
                            Source::Single(values) => line.write_samples_from_slice(&values[range]),
                            Source::Half(values) => line.write_samples(|x| to_half(values[start + x])),
                            Source::Ids(values) => line.write_samples_from_slice(&values[range]),
                        };
                    });
                    block.compress_to_chunk(&meta.headers).map(|chunk| (i, chunk))
                })
                .collect::<Result<_, _>>()?;
            for (i, chunk) in chunks {
                writer.write_chunk(i, chunk)?;
            }
        }
        Ok(())
    })
    .map_err(to_io)?;
    out.flush()?;
    sort_attributes(out.get_mut())
}

/// To 16 bits; what is finite stays finite.
fn to_half(value: f32) -> f16 {
    let limit = f16::MAX.to_f32();
    f16::from_f32(if value.is_finite() { value.clamp(-limit, limit) } else { value })
}

fn header(film: &Film, channels: &[(&str, Source)], recipe: &Recipe) -> Header {
    let list = channels
        .iter()
        .map(|(name, source)| {
            let sample_type = match source {
                Source::Single(_) => SampleType::F32,
                Source::Half(_) => SampleType::F16,
                Source::Ids(_) => SampleType::U32,
            };
            ChannelDescription::new(*name, sample_type, false)
        })
        .collect();
    let size = Vec2(film.width() as usize, film.height() as usize);
    let mut header =
        Header::new(text(""), size, list).with_encoding(Compression::ZIP16, BlockDescription::ScanLines, LineOrder::Increasing);
    let mut attributes = LayerAttributes {
        layer_name: None,
        software_name: Some(text(concat!("Radiosa ", env!("CARGO_PKG_VERSION")))),
        ..LayerAttributes::default()
    };
    for (i, (key, value)) in recipe.entries().iter().enumerate() {
        // Attributes have no order of their own; the number keeps the recipe's.
        attributes.other.insert(text(&format!("{PREFIX}{i:02}.{key}")), AttributeValue::Text(text(value)));
    }
    header.own_attributes = attributes;
    header.shared_attributes.chromaticities = Some(Chromaticities {
        red: Vec2(0.64, 0.33),
        green: Vec2(0.30, 0.60),
        blue: Vec2(0.15, 0.06),
        white: Vec2(0.3127, 0.3290),
    });
    header
}

/// UTF-8 as it is; a recipe holds no NUL.
fn text(value: &str) -> Text {
    Text::from_bytes_unchecked(SmallVec::from_slice(value.as_bytes()))
}

fn to_io(error: exr::error::Error) -> io::Error {
    match error {
        exr::error::Error::Io(e) => e,
        other => io::Error::other(other.to_string()),
    }
}

/// Sorts the header's attributes by name, in place: the encoder takes them from a hash map, whose order differs from run to
/// run. Nothing moves outside the list of attributes.
fn sort_attributes(file: &mut File) -> io::Result<()> {
    // The magic number and the version come first, eight bytes.
    file.seek(SeekFrom::Start(8))?;
    let mut reader = io::BufReader::new(&mut *file);
    let mut attributes: Vec<Vec<u8>> = Vec::new();
    loop {
        let mut attribute = Vec::new();
        if reader.read_until(0, &mut attribute)? <= 1 {
            break; // an empty name ends the list
        }
        reader.read_until(0, &mut attribute)?; // the type
        let mut size = [0; 4];
        reader.read_exact(&mut size)?;
        attribute.extend_from_slice(&size);
        let start = attribute.len();
        attribute.resize(start + u32::from_le_bytes(size) as usize, 0);
        reader.read_exact(&mut attribute[start..])?;
        attributes.push(attribute);
    }
    attributes.sort();
    file.seek(SeekFrom::Start(8))?;
    file.write_all(&attributes.concat())
}

/// The entries among the attributes.
pub(super) fn read_recipe(file: impl BufRead + Seek) -> Result<Recipe, String> {
    let meta = exr::meta::MetaData::read_from_buffered(file, false).map_err(|e| e.to_string())?;
    let mut entries: Vec<(String, String)> = meta
        .headers
        .iter()
        .flat_map(|h| &h.own_attributes.other)
        .filter_map(|(name, value)| match value {
            AttributeValue::Text(text) => Some((utf8(name), utf8(text))),
            _ => None,
        })
        .collect();
    entries.sort();
    let mut recipe = Recipe::new();
    for (name, value) in entries {
        if let Some((_, key)) = name.strip_prefix(PREFIX).and_then(|rest| rest.split_once('.')) {
            recipe.set(key, value);
        }
    }
    Ok(recipe)
}

fn utf8(text: &Text) -> String {
    String::from_utf8_lossy(text.as_slice()).into_owned()
}
