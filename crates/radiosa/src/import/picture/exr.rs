//! OpenEXR, block by block, so that memory stays bounded and only the channels of a picture are kept.
//!
//! Reads R, G, B with or without A; Y alone; Y with RY and BY (luminance and chroma, which may be stored at a lower resolution); the
//! first part and the first group of channels that has one of these. Of several resolutions the largest. What is outside the data
//! window but inside the display window is black and transparent. A cube environment comes out in latitude and longitude, as
//! OpenEXR defines both. Primaries other than Rec. 709 are converted. Deep pictures are refused.

use std::io::Cursor;
use std::sync::Arc;

use exr::block::chunk::Chunk;
use exr::block::reader::Reader;
use exr::block::{BlockIndex, UncompressedBlock};
use exr::meta::attribute::{Chromaticities, Compression, EnvironmentMap, SampleType};
use exr::meta::header::Header;
use exr::meta::{BlockDescription, MetaData};
use exr::prelude::{Vec2, f16};
use rayon::prelude::*;

use super::primaries::{Conversion, Primaries};
use super::{Picture, Source, finite, zeroed};
use crate::import::ImportError;
use crate::math::Vec3;
use crate::scene::Pixels;
use crate::spectrum::Spectrum;

/// The most uncompressed bytes that a byte of a compressed file can stand for. Deflate ends at 1032; Huffman codes over runs (PIZ)
/// come to about half of that; the transforms of DWA keep one number of a block of 64 and deflate it.
const fn bytes_per_byte(compression: Compression) -> u64 {
    match compression {
        Compression::Uncompressed => 1,
        Compression::RLE | Compression::B44 | Compression::B44A => 64,
        Compression::DWAA(_) | Compression::DWAB(_) => 65_536,
        _ => 2048,
    }
}

/// Blocks that are decompressed together, in parallel.
const N_BLOCKS_AT_ONCE: usize = 64;

/// What a channel holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Role {
    Red,
    Green,
    Blue,
    Alpha,
    /// Y.
    Luminance,
    /// RY = (R − Y)/Y.
    RedChroma,
    /// BY = (B − Y)/Y.
    BlueChroma,
}

/// Which channels of which part make the picture.
struct Selection {
    /// Index of the part.
    part: usize,
    /// For each channel of the part, what it is for.
    roles: Vec<Option<Role>>,
}

/// A rectangle of pixels in the coordinates of the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Window {
    x: i64,
    y: i64,
    width: usize,
    height: usize,
}

/// Reads one.
pub(super) fn read(source: &Source) -> Result<Picture, ImportError> {
    let damaged = |e: exr::error::Error| source.damaged(e);
    let meta = MetaData::read_from_buffered(source.bytes, true).map_err(damaged)?;
    let selection = select(source, &meta.headers)?;
    let header = meta.headers[selection.part].clone();
    let data = Window {
        x: header.own_attributes.layer_position.x().into(),
        y: header.own_attributes.layer_position.y().into(),
        width: header.layer_size.width(),
        height: header.layer_size.height(),
    };
    let view = check(source, &meta.headers, &header, data)?;
    let is_subsampled = header.channels.list.iter().any(|c| c.sampling != Vec2(1, 1));
    let chunks = if is_subsampled { subsampled::chunks(source, &meta)? } else { chunks(source, selection.part)? };

    chunks.iter().try_for_each(|chunk| check_dwa(chunk, &header)).map_err(damaged)?;

    let mut picture = Planes::new(data, &header, &selection.roles);
    for batch in chunks.chunks(N_BLOCKS_AT_ONCE) {
        let blocks: Vec<_> = batch
            .par_iter()
            .map(|chunk| if is_subsampled { subsampled::decompress(chunk, &header) } else { decompress(chunk, &meta) })
            .collect::<Result<_, _>>()
            .map_err(damaged)?;
        for block in &blocks {
            picture.insert(block, &header).ok_or_else(|| source.damaged("a block lies outside the picture"))?;
        }
    }

    let primaries = header.shared_attributes.chromaticities.map_or(Primaries::REC_709, primaries);
    let rgba = picture.to_rgba(view, primaries);
    drop(picture);
    if header.own_attributes.environment_map == Some(EnvironmentMap::Cube) && rgba.height == 6 * rgba.width {
        return Ok(cube::to_latitude_longitude(&rgba));
    }
    Ok(rgba.into_picture())
}

fn primaries(c: Chromaticities) -> Primaries {
    let xy = |v: Vec2<f32>| [f64::from(v.x()), f64::from(v.y())];
    Primaries { red: xy(c.red), green: xy(c.green), blue: xy(c.blue), white: xy(c.white) }
}

/// Finds the first part and group of channels that make a picture.
fn select(source: &Source, headers: &[Header]) -> Result<Selection, ImportError> {
    let mut seen = Vec::new();
    let mut is_deep = false;
    for (part, header) in headers.iter().enumerate() {
        if header.deep {
            is_deep = true;
            continue;
        }
        let names: Vec<String> = header.channels.list.iter().map(|c| c.name.to_string()).collect();
        let group = |name: &str| name.rsplit_once('.').map_or(String::new(), |(group, _)| group.to_owned());
        // The group without a name goes first; the others as they come.
        let mut groups: Vec<String> = names.iter().map(|n| group(n)).collect();
        groups.insert(0, String::new());
        for wanted in groups {
            let roles: Vec<Option<Role>> = names
                .iter()
                .map(|name| if group(name) == wanted { role(name.rsplit('.').next().unwrap_or(name)) } else { None })
                .collect();
            let has = |role| roles.contains(&Some(role));
            if has(Role::Red) && has(Role::Green) && has(Role::Blue) {
                let is_light = |r: Role| matches!(r, Role::Red | Role::Green | Role::Blue | Role::Alpha);
                return Ok(Selection { part, roles: roles.into_iter().map(|r| r.filter(|&r| is_light(r))).collect() });
            }
            if has(Role::Luminance) {
                let is_light = |r: Role| !matches!(r, Role::Red | Role::Green | Role::Blue);
                return Ok(Selection { part, roles: roles.into_iter().map(|r| r.filter(|&r| is_light(r))).collect() });
            }
        }
        seen.extend(names);
    }
    if is_deep && seen.is_empty() {
        return Err(source.unsupported("deep OpenEXR data (several samples a pixel)", "flatten the picture and save it again"));
    }
    seen.truncate(20);
    Err(source.damaged(format_args!("it has no channels R, G, B or Y; it has {}", seen.join(", "))))
}

fn role(name: &str) -> Option<Role> {
    Some(match name {
        "R" | "r" => Role::Red,
        "G" | "g" => Role::Green,
        "B" | "b" => Role::Blue,
        "A" | "a" => Role::Alpha,
        "Y" | "y" => Role::Luminance,
        "RY" => Role::RedChroma,
        "BY" => Role::BlueChroma,
        _ => return None,
    })
}

/// Holds what the header claims against the memory allowed and the bytes there are; the window to show comes back.
fn check(source: &Source, headers: &[Header], header: &Header, data: Window) -> Result<Window, ImportError> {
    let len = source.bytes.len() as u64;
    let n_chunks = headers.iter().fold(0u64, |sum, h| sum.saturating_add(h.chunk_count as u64));
    if n_chunks.saturating_mul(8) > len {
        return Err(source.damaged(format_args!("its header claims {n_chunks} blocks, which {len} bytes cannot hold")));
    }
    let is_cube = header.own_attributes.environment_map == Some(EnvironmentMap::Cube);
    // Four floats a pixel as they are decoded, and four more as the picture. From a cube, eight pixels are made of six.
    let memory = if is_cube { 54 } else { 32 };
    let pixel = (header.channels.bytes_per_pixel as u64).max(1);
    let ratio = bytes_per_byte(header.compression);
    source.check_size(data.width as u64, data.height as u64, memory, (ratio / pixel).max(2))?;
    // A block may be larger than the picture it is cut to; its memory is what counts.
    let block = match header.blocks {
        BlockDescription::ScanLines => (data.width, header.compression.scan_lines_per_block()),
        BlockDescription::Tiles(tiles) => (tiles.tile_size.width(), tiles.tile_size.height()),
    };
    let block_bytes = (block.0 as u64).saturating_mul(block.1 as u64).saturating_mul(pixel);
    if block_bytes > (64 << 20u64).max(len.saturating_mul(ratio)) || block_bytes > source.max_memory {
        return Err(source.damaged(format_args!("its blocks of {}x{} pixels are too large for {len} bytes", block.0, block.1)));
    }

    let shown = header.shared_attributes.display_window;
    let view = Window {
        x: shown.position.x().into(),
        y: shown.position.y().into(),
        width: shown.size.width(),
        height: shown.size.height(),
    };
    // A display window without pixels, or far larger than the picture, or beside it, is a mistake: what there is will do.
    let is_small =
        (view.width as u64).saturating_mul(view.height as u64) <= (data.width as u64 * data.height as u64).saturating_mul(64);
    if view.width == 0 || view.height == 0 || !is_small || is_cube || !data.overlaps(view) {
        return Ok(data);
    }
    source.check_size(view.width as u64, view.height as u64, 32, u64::MAX)?;
    Ok(view)
}

impl Window {
    fn overlaps(self, other: Self) -> bool {
        let meets = |a: i64, n: usize, b: i64, m: usize| a < b + m as i64 && b < a + n as i64;
        meets(self.x, self.width, other.x, other.width) && meets(self.y, self.height, other.y, other.height)
    }
}

/// Reads the compressed blocks of a part at its largest resolution.
fn chunks(source: &Source, part: usize) -> Result<Vec<Chunk>, ImportError> {
    let damaged = |e: exr::error::Error| source.damaged(e);
    let reader = Reader::read_from_buffered(Cursor::new(source.bytes), false).map_err(damaged)?;
    let wanted = |_: &MetaData, _, block: BlockIndex| block.layer == part && block.level == Vec2(0, 0);
    let blocks = reader.filter_chunks(false, wanted).map_err(damaged)?;
    bounded(source, part, blocks)
}

/// Takes blocks until they come to more than the file: a table that names the same block again and again could make a small
/// file take long.
fn bounded(
    source: &Source,
    part: usize,
    blocks: impl Iterator<Item = exr::error::Result<Chunk>>,
) -> Result<Vec<Chunk>, ImportError> {
    let mut chunks = Vec::new();
    let mut total = 0;
    for chunk in blocks {
        let chunk = chunk.map_err(|e| source.damaged(e))?;
        total += size_of_data(&chunk);
        if total > source.bytes.len() || chunk.layer_index != part {
            return Err(source.damaged("its table of blocks is wrong"));
        }
        chunks.push(chunk);
    }
    Ok(chunks)
}

fn size_of_data(chunk: &Chunk) -> usize {
    data(chunk).map_or(0, <[u8]>::len)
}

/// A block's compressed bytes.
fn data(chunk: &Chunk) -> Option<&[u8]> {
    use exr::block::chunk::CompressedBlock::{ScanLine, Tile};
    match &chunk.compressed_block {
        ScanLine(block) => Some(&block.compressed_pixels_le),
        Tile(block) => Some(&block.compressed_pixels_le),
        _ => None,
    }
}

/// A decompressed block: lines of samples, channel after channel.
struct Block {
    x: usize,
    y: usize,
    width: usize,
    height: usize,
    data: Vec<u8>,
}

fn decompress(chunk: &Chunk, meta: &MetaData) -> exr::error::Result<Block> {
    let block = UncompressedBlock::decompress_chunk(chunk.clone(), meta, false)?;
    let (position, size) = (block.index.pixel_position, block.index.pixel_size);
    Ok(Block { x: position.x(), y: position.y(), width: size.width(), height: size.height(), data: block.data })
}

/// Holds the sizes that a DWA block claims for its parts against what its pixels need and its bytes can hold: the decoder reserves
/// them unseen, and the format can stand for so many pixels a byte that the size of the file says little.
fn check_dwa(chunk: &Chunk, header: &Header) -> exr::error::Result<()> {
    if !matches!(header.compression, Compression::DWAA(_) | Compression::DWAB(_)) {
        return Ok(());
    }
    let Some(data) = data(chunk) else { return Ok(()) };
    let place = header.get_block_data_indices(&chunk.compressed_block)?;
    let size = header.get_absolute_block_pixel_coordinates(place)?.size;
    let bytes = (size.area() * header.channels.bytes_per_pixel) as u64;
    if data.len() as u64 == bytes {
        return Ok(()); // stored as it is
    }
    let wrong = || exr::error::Error::Invalid("DWA block sizes".into());
    let (counters, _) = data.as_chunks::<8>();
    let counters: [u64; 11] = std::array::from_fn(|i| counters.get(i).map_or(u64::MAX, |c| u64::from_le_bytes(*c)));
    let [_, other, other_packed, _, dc_packed, rle_packed, rle_tokens, rle, ac, dc, _] = counters;
    // All are for whole squares of 8 x 8. Runs that do not pay make the bytes a little more than those they stand for.
    let squares = (size.width().div_ceil(8) * size.height().div_ceil(8) * header.channels.list.len()) as u64;
    let most = 2 * 4 * 64 * squares + 4096;
    if [other, rle_tokens, rle, ac, dc].iter().any(|&n| n > most) {
        return Err(wrong());
    }
    // Each square has one mean, of two bytes; the rest of the channels is stored byte by byte. Deflate ends at 1032 to one.
    let inflates = |n: u64, packed: u64| n <= 1032 * packed.saturating_add(16).min(data.len() as u64);
    let held = 128 * dc + other + rle;
    if held < bytes / 4 || !inflates(2 * dc, dc_packed) || !inflates(other, other_packed) || !inflates(rle_tokens, rle_packed) {
        return Err(wrong());
    }
    Ok(())
}

/// The channels of a picture as they are stored, in floats.
struct Planes {
    data: Window,
    planes: Vec<Plane>,
}

struct Plane {
    role: Role,
    /// Index of the channel.
    channel: usize,
    /// Every how many pixels there is a sample, across and down.
    sampling: (usize, usize),
    /// Samples across.
    width: usize,
    values: Vec<f32>,
}

/// How many multiples of `step` lie in `start..start + n`.
fn n_samples(start: i64, n: usize, step: usize) -> usize {
    let step = step.max(1) as i64;
    let before = |x: i64| (x + step - 1).div_euclid(step);
    (before(start + n as i64) - before(start)) as usize
}

impl Planes {
    fn new(data: Window, header: &Header, roles: &[Option<Role>]) -> Self {
        let planes = roles
            .iter()
            .enumerate()
            .filter_map(|(channel, role)| {
                let sampling = header.channels.list[channel].sampling;
                let width = n_samples(data.x, data.width, sampling.x());
                let height = n_samples(data.y, data.height, sampling.y());
                let values = vec![0.0; width * height];
                role.map(|role| Plane { role, channel, sampling: (sampling.x(), sampling.y()), width, values })
            })
            .collect();
        Self { data, planes }
    }

    /// Copies the samples of a block; `None` when it leaves the picture.
    fn insert(&mut self, block: &Block, header: &Header) -> Option<()> {
        let mut rest = block.data.as_slice();
        for y in block.y..block.y + block.height {
            let row = self.data.y + y as i64;
            for (channel, description) in header.channels.list.iter().enumerate() {
                let (step_x, step_y) = (description.sampling.x(), description.sampling.y());
                if row.rem_euclid(step_y.max(1) as i64) != 0 {
                    continue;
                }
                let start = n_samples(self.data.x, block.x, step_x);
                let n = n_samples(self.data.x + block.x as i64, block.width, step_x);
                let (line, after) = rest.split_at_checked(n * description.sample_type.bytes_per_sample())?;
                rest = after;
                let Some(plane) = self.planes.iter_mut().find(|p| p.channel == channel) else { continue };
                let first = n_samples(self.data.y, y, step_y) * plane.width + start;
                let out = plane.values.get_mut(first..first + n)?;
                match description.sample_type {
                    SampleType::F16 => fill(out, line, |b| f16::from_ne_bytes(b).to_f32()),
                    SampleType::F32 => fill(out, line, f32::from_ne_bytes),
                    SampleType::U32 => fill(out, line, |b| u32::from_ne_bytes(b) as f32),
                }
            }
        }
        Some(())
    }

    fn get(&self, role: Role) -> Option<&Plane> {
        self.planes.iter().find(|p| p.role == role)
    }

    /// The part of the picture that `view` shows, in Rec. 709.
    fn to_rgba(&self, view: Window, primaries: Primaries) -> Rgba {
        let mut pixels = zeroed(4 * view.width * view.height);
        let out = Arc::get_mut(&mut pixels).unwrap_or_default(); // not shared yet
        let conversion = primaries.to_rec_709();
        let weights = primaries.luminance_weights().unwrap_or([0.2126, 0.7152, 0.0722]);
        out.par_chunks_mut(4 * view.width).enumerate().for_each(|(j, row)| {
            let y = view.y + j as i64 - self.data.y;
            if !(0..self.data.height as i64).contains(&y) {
                return;
            }
            for (i, rgba) in row.chunks_exact_mut(4).enumerate() {
                let x = view.x + i as i64 - self.data.x;
                if (0..self.data.width as i64).contains(&x) {
                    rgba.copy_from_slice(&self.pixel(x as usize, y as usize, weights, conversion));
                }
            }
        });
        Rgba { width: view.width, height: view.height, pixels }
    }

    fn pixel(&self, x: usize, y: usize, weights: [f32; 3], conversion: Option<Conversion>) -> [f32; 4] {
        let value = |role: Role| self.get(role).map(|p| finite(self.at(p, x, y)));
        let mut color = match value(Role::Luminance) {
            Some(luminance) => {
                let red = (value(Role::RedChroma).unwrap_or(0.0) + 1.0) * luminance;
                let blue = (value(Role::BlueChroma).unwrap_or(0.0) + 1.0) * luminance;
                let green = (luminance - weights[0] * red - weights[2] * blue) / weights[1];
                // Without chroma this is grey already; the division must not tint it.
                if self.planes.iter().any(|p| p.role == Role::RedChroma || p.role == Role::BlueChroma) {
                    Spectrum::new(red, green, blue)
                } else {
                    Spectrum::gray(luminance)
                }
            }
            None => {
                let light = |role| value(role).unwrap_or(0.0);
                Spectrum::new(light(Role::Red), light(Role::Green), light(Role::Blue))
            }
        };
        if let Some(conversion) = conversion {
            color = conversion.apply(color);
        }
        let [r, g, b] = color.map(finite).to_array();
        [r, g, b, value(Role::Alpha).unwrap_or(1.0)]
    }

    /// A plane's value at a pixel of the data window, between samples by linear interpolation.
    fn at(&self, plane: &Plane, x: usize, y: usize) -> f32 {
        if plane.sampling == (1, 1) {
            return plane.values[y * plane.width + x];
        }
        let height = plane.values.len() / plane.width.max(1);
        if height == 0 || plane.width == 0 {
            return 0.0;
        }
        // Samples lie at the multiples of the step, in the coordinates of the file.
        let place = |start: i64, x: usize, step: usize, n: usize| {
            let step = step as i64;
            let at = start + x as i64;
            let first = (start + step - 1).div_euclid(step);
            let below = at.div_euclid(step) - first;
            let t = at.rem_euclid(step) as f32 / step as f32;
            let clamp = |i: i64| i.clamp(0, n as i64 - 1) as usize;
            (clamp(below), clamp(below + 1), t)
        };
        let (x0, x1, s) = place(self.data.x, x, plane.sampling.0, plane.width);
        let (y0, y1, t) = place(self.data.y, y, plane.sampling.1, height);
        let row = |y: usize| {
            let (a, b) = (plane.values[y * plane.width + x0], plane.values[y * plane.width + x1]);
            a + s * (b - a)
        };
        let (a, b) = (row(y0), row(y1));
        a + t * (b - a)
    }
}

fn fill<const N: usize>(out: &mut [f32], bytes: &[u8], value: impl Fn([u8; N]) -> f32) {
    for (out, bytes) in out.iter_mut().zip(bytes.as_chunks::<N>().0) {
        *out = value(*bytes);
    }
}

/// A finished picture.
struct Rgba {
    width: usize,
    height: usize,
    pixels: Arc<[f32]>,
}

impl Rgba {
    fn into_picture(self) -> Picture {
        // `check` has seen to it that sides fit.
        Picture { width: self.width as u32, height: self.height as u32, pixels: Pixels::Rgba32F(self.pixels) }
    }
}

/// Pictures whose channels have fewer samples than the picture has pixels. The crate decodes their blocks but refuses the files, so
/// finding the blocks is done here; one part of scan lines only.
mod subsampled {
    use super::{Block, Chunk, Header, ImportError, MetaData, Source, bounded, n_samples};
    use exr::block::chunk::CompressedBlock;
    use exr::error::{Error, Result};
    use exr::meta::BlockDescription;
    use exr::meta::attribute::IntegerBounds;
    use exr::prelude::Vec2;

    /// Reads the compressed blocks.
    pub(super) fn chunks(source: &Source, meta: &MetaData) -> std::result::Result<Vec<Chunk>, ImportError> {
        let [header] = meta.headers.as_slice() else {
            return Err(source.unsupported("channels of several resolutions beside other parts", HELP));
        };
        if header.blocks != BlockDescription::ScanLines {
            return Err(source.unsupported("tiles with channels of several resolutions", HELP));
        }
        // What the crate would check if it did not refuse.
        let (position, size) = (header.own_attributes.layer_position, header.layer_size);
        for channel in &header.channels.list {
            let Vec2(x, y) = channel.sampling;
            let divides = |step: usize, at: i32, n: usize| step > 0 && i64::from(at) % step as i64 == 0 && n.is_multiple_of(step);
            if !divides(x, position.x(), size.width()) || !divides(y, position.y(), size.height()) {
                return Err(source.damaged("its channels have resolutions that do not divide its size"));
            }
        }
        let table = end_of_header(source.bytes)
            .and_then(|at| source.bytes.get(at..))
            .and_then(|rest| rest.as_chunks::<8>().0.get(..header.chunk_count))
            .ok_or_else(|| source.damaged("its table of blocks is cut off"))?;
        let blocks = table.iter().map(|offset| {
            let at = usize::try_from(u64::from_le_bytes(*offset)).unwrap_or(usize::MAX);
            let mut rest = source.bytes.get(at..).ok_or_else(|| Error::Invalid("block position".into()))?;
            Chunk::read(&mut rest, meta)
        });
        bounded(source, 0, blocks)
    }

    const HELP: &str = "save the picture as R, G, B";

    /// Where the attributes of a file of one part end: each is a name, a type, both ending in zero, a size and that many bytes; an
    /// empty name ends the list.
    fn end_of_header(bytes: &[u8]) -> Option<usize> {
        let mut at = 8;
        loop {
            let name = bytes.get(at..)?.iter().position(|&b| b == 0)?;
            at += name + 1;
            if name == 0 {
                return Some(at);
            }
            at += bytes.get(at..)?.iter().position(|&b| b == 0)? + 1;
            let size = u32::from_le_bytes(*bytes.get(at..)?.first_chunk()?);
            at = at.checked_add(4)?.checked_add(usize::try_from(size).ok()?)?;
        }
    }

    /// Decompresses a block of scan lines. The decoder takes a block to hold `bytes_per_pixel` for each of its pixels; telling it the
    /// mean over the pixels of this block makes that true.
    pub(super) fn decompress(chunk: &Chunk, header: &Header) -> Result<Block> {
        let CompressedBlock::ScanLine(block) = &chunk.compressed_block else {
            return Err(Error::NotSupported("tiles with channels of several resolutions".into()));
        };
        let (left, top) = (header.own_attributes.layer_position.x(), header.own_attributes.layer_position.y());
        let (width, lines) = (header.layer_size.width(), header.compression.scan_lines_per_block());
        let y = usize::try_from(i64::from(block.y_coordinate) - i64::from(top))
            .map_err(|_| Error::Invalid("block position".into()))?;
        if y % lines != 0 || y >= header.layer_size.height() {
            return Err(Error::Invalid("block position".into()));
        }
        let height = lines.min(header.layer_size.height() - y);
        let bytes: usize = header
            .channels
            .list
            .iter()
            .map(|c| {
                let across = n_samples(left.into(), width, c.sampling.x());
                let down = n_samples(i64::from(block.y_coordinate), height, c.sampling.y());
                across * down * c.sample_type.bytes_per_sample()
            })
            .sum();
        if !bytes.is_multiple_of(width * height) {
            return Err(Error::NotSupported("channels of several resolutions in a picture of odd size".into()));
        }
        let mut header = header.clone();
        header.channels.bytes_per_pixel = bytes / (width * height);
        let section = IntegerBounds::new(Vec2(left, block.y_coordinate), Vec2(width, height));
        let compressed = block.compressed_pixels_le.clone();
        let data = header.compression.decompress_image_section_from_le(&header, compressed, section, false)?;
        Ok(Block { x: 0, y, width, height, data })
    }
}

/// Cube environments.
///
/// Six square faces lie below each other: +X, −X, +Y, −Y, +Z, −Z. In latitude and longitude the top is +Y, the middle of the
/// picture is +Z and a quarter from the left is +X. The outermost samples of a face lie on its edges.
mod cube {
    use super::{Arc, Picture, Pixels, Rgba, Vec3, zeroed};
    use crate::math::function;
    use rayon::prelude::*;
    use std::f32::consts::PI;

    /// The same environment in latitude and longitude, as many pixels around as around the cube.
    pub(super) fn to_latitude_longitude(cube: &Rgba) -> Picture {
        let (width, height) = (4 * cube.width, 2 * cube.width);
        let mut pixels = zeroed(4 * width * height);
        let out = Arc::get_mut(&mut pixels).unwrap_or_default(); // not shared yet
        out.par_chunks_mut(4 * width).enumerate().for_each(|(y, row)| {
            let latitude = PI * (0.5 - (y as f32 + 0.5) / height as f32);
            for (x, rgba) in row.chunks_exact_mut(4).enumerate() {
                let longitude = PI * (1.0 - 2.0 * (x as f32 + 0.5) / width as f32);
                let c = function::cos(latitude);
                let direction = Vec3::new(function::sin(longitude) * c, function::sin(latitude), function::cos(longitude) * c);
                rgba.copy_from_slice(&sample(cube, direction));
            }
        });
        Picture { width: width as u32, height: height as u32, pixels: Pixels::Rgba32F(pixels) }
    }

    /// The colour in a direction, between samples of one face by linear interpolation.
    fn sample(cube: &Rgba, d: Vec3) -> [f32; 4] {
        let a = d.abs();
        // Which face, and where in it from the left and from the top, −1 to 1.
        let (face, s, t) = if a.x >= a.y && a.x >= a.z {
            if d.x > 0.0 { (0, d.y / a.x, -d.z / a.x) } else { (1, -d.y / a.x, -d.z / a.x) }
        } else if a.y >= a.z {
            if d.y > 0.0 { (2, d.x / a.y, -d.z / a.y) } else { (3, d.x / a.y, d.z / a.y) }
        } else if d.z > 0.0 {
            (4, -d.x / a.z, -d.y / a.z)
        } else {
            (5, d.x / a.z, -d.y / a.z)
        };
        let n = cube.width;
        let place = |v: f32| {
            let v = ((v + 1.0) * 0.5 * (n as f32 - 1.0)).clamp(0.0, n as f32 - 1.0);
            let i = (v as usize).min(n.saturating_sub(2));
            (i, (i + 1).min(n - 1), v - i as f32)
        };
        let ((x0, x1, fx), (y0, y1, fy)) = (place(s), place(t));
        let at = |x: usize, y: usize, c: usize| cube.pixels[4 * ((face * n + y) * n + x) + c];
        std::array::from_fn(|c| {
            let top = at(x0, y0, c) + fx * (at(x1, y0, c) - at(x0, y0, c));
            let bottom = at(x0, y1, c) + fx * (at(x1, y1, c) - at(x0, y1, c));
            top + fy * (bottom - top)
        })
    }
}
