//! Pictures in linear light, as named planes.
//!
//! A method delivers a [`Pixel`] per camera sample; an [`Accumulator`] turns the samples of one pixel into its mean; a
//! [`Film`] keeps the means of a whole picture, one plane per channel, in the layers that were asked for. Nothing is
//! encoded or clipped here: that is [`tone_map`], which maps a film to what a screen shows, and [`srgb`].
//!
//! The colour has two decompositions, by lobe and by path. Each sums to the colour: that is the duty of the method that
//! fills the pixels, and [`Film::decomposition_error`] checks it.
//!
//! No pixel ever writes into another ([`filter`] importance-samples the reconstruction filter instead of splatting), so
//! that a film does not depend on the order in which its pixels are made.

pub mod false_color;
pub mod filter;
mod layer;
mod pixel;
pub mod srgb;
pub mod tone_map;

pub use filter::{Filter, FilterSample};
pub use layer::{Decomposition, Layer};
pub use pixel::{Accumulator, Pixel};

use rayon::prelude::*;
use thiserror::Error;

use crate::spectrum::Spectrum;

/// How a picture is sampled, whatever the method.
#[derive(Clone, Debug, PartialEq)]
pub struct Sampling {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Camera samples a pixel, at least 1; with one, it is the pixel's centre when the filter is the box.
    pub spp: u32,
    /// Reconstruction filter.
    pub filter: Filter,
    /// Key of every random stream.
    pub seed: u64,
    /// What the film keeps.
    pub layers: Vec<Layer>,
}

/// A picture in linear light.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    width: u32,
    height: u32,
    planes: Vec<Plane>,
    object_ids: Option<Vec<u32>>,
}

/// One channel of a film.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane {
    /// The layer it belongs to.
    pub layer: Layer,
    /// Its name in files, such as `R` or `normal.X`.
    pub name: &'static str,
    /// Row-major from the top left, one value a pixel.
    pub values: Vec<f32>,
}

/// Why a film cannot be made.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum FilmError {
    /// No pixels, or more than a picture file can address.
    #[error("a picture of {width}x{height} pixels cannot be made: each side must be between 1 and {}", Film::MAX_SIDE)]
    Size {
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
    },
    /// Not enough memory.
    #[error("a picture of {width}x{height} pixels with these layers takes {} MiB, which this machine does not give; ask for fewer layers or pixels", bytes >> 20)]
    Memory {
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
        /// What it would take, bytes.
        bytes: u64,
    },
}

impl Film {
    /// The longest side a film may have, pixels.
    pub const MAX_SIDE: u32 = 65_536;

    /// A black film with these layers (each once, in the order of [`Layer::ALL`], whatever order is given).
    ///
    /// # Errors
    /// When a side is 0 or above [`Self::MAX_SIDE`], or memory cannot be had.
    pub fn new(width: u32, height: u32, layers: &[Layer]) -> Result<Self, FilmError> {
        if width == 0 || height == 0 || width > Self::MAX_SIDE || height > Self::MAX_SIDE {
            return Err(FilmError::Size { width, height });
        }
        let memory = || FilmError::Memory { width, height, bytes: Self::memory(width, height, layers) };
        let n = usize::try_from(u64::from(width) * u64::from(height)).map_err(|_| memory())?;
        let mut film = Self { width, height, planes: Vec::new(), object_ids: None };
        for layer in Layer::ALL.into_iter().filter(|l| layers.contains(l)) {
            if layer == Layer::ObjectId {
                let mut ids = Vec::new();
                ids.try_reserve_exact(n).map_err(|_| memory())?;
                ids.resize(n, 0);
                film.object_ids = Some(ids);
                continue;
            }
            for &name in layer.channels() {
                let mut values = Vec::new();
                values.try_reserve_exact(n).map_err(|_| memory())?;
                values.resize(n, 0.0);
                film.planes.push(Plane { layer, name, values });
            }
        }
        Ok(film)
    }

    /// What a film of this size and these layers takes, bytes.
    pub fn memory(width: u32, height: u32, layers: &[Layer]) -> u64 {
        let channels: usize = Layer::ALL.into_iter().filter(|l| layers.contains(l)).map(|l| l.channels().len()).sum();
        4 * u64::from(width) * u64::from(height) * channels as u64
    }

    /// Pixels across.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Pixels down.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// The number of pixels.
    pub fn n_pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// The layers it keeps, in the order of [`Layer::ALL`].
    pub fn layers(&self) -> Vec<Layer> {
        Layer::ALL.into_iter().filter(|&l| self.has(l)).collect()
    }

    /// True when it keeps this layer.
    pub fn has(&self, layer: Layer) -> bool {
        if layer == Layer::ObjectId { self.object_ids.is_some() } else { self.planes.iter().any(|p| p.layer == layer) }
    }

    /// All float channels, in the order of [`Layer::ALL`].
    pub fn planes(&self) -> &[Plane] {
        &self.planes
    }

    /// One float channel by its name in files, such as `R` or `depth.Z`.
    pub fn plane(&self, name: &str) -> Option<&[f32]> {
        self.planes.iter().find(|p| p.name == name).map(|p| p.values.as_slice())
    }

    /// The object a pixel shows, 0 for none, otherwise the index given in [`Pixel::object`] plus one.
    pub fn object_ids(&self) -> Option<&[u32]> {
        self.object_ids.as_deref()
    }

    /// Stores a finished pixel; layers the film does not keep are dropped.
    ///
    /// # Panics
    /// When the pixel lies outside.
    pub fn set_pixel(&mut self, x: u32, y: u32, pixel: &Pixel) {
        assert!(x < self.width && y < self.height, "pixel ({x}, {y}) lies outside a film of {}x{}", self.width, self.height);
        let i = y as usize * self.width as usize + x as usize;
        let mut p = 0;
        while p < self.planes.len() {
            let layer = self.planes[p].layer;
            let values = pixel.layer(layer);
            for value in values.iter().take(layer.channels().len()) {
                self.planes[p].values[i] = *value;
                p += 1;
            }
        }
        if let Some(ids) = &mut self.object_ids {
            ids[i] = pixel.object.map_or(0, |id| id.saturating_add(1));
        }
    }

    /// Hands out the planes of colour, as 0 to 2, and alpha, as 3.
    pub(crate) fn fill(&mut self, mut f: impl FnMut(usize, &mut [f32])) {
        let (mut color, mut alpha) = (0, 3);
        for plane in &mut self.planes {
            let next = match plane.layer {
                Layer::Color => &mut color,
                Layer::Alpha => &mut alpha,
                _ => continue,
            };
            f(*next, &mut plane.values);
            *next += 1;
        }
    }

    /// Fills every channel: `value` is given the layer, which of its channels, and the pixel (x, y); `object` the pixel. In parallel.
    pub(crate) fn compose(
        &mut self,
        value: impl Fn(Layer, usize, [u32; 2]) -> f32 + Sync,
        object: impl Fn([u32; 2]) -> Option<u32> + Sync,
    ) {
        let width = self.width as usize;
        for layer in self.layers() {
            let planes = self.planes.iter_mut().filter(|plane| plane.layer == layer).enumerate();
            let rows = planes.flat_map(|(c, plane)| plane.values.chunks_mut(width).enumerate().map(move |(y, row)| (c, y, row)));
            rows.collect::<Vec<_>>().into_par_iter().for_each(|(c, y, row)| {
                row.iter_mut().enumerate().for_each(|(x, v)| *v = value(layer, c, [x as u32, y as u32]));
            });
        }
        for (i, id) in self.object_ids.iter_mut().flatten().enumerate() {
            *id = object([(i % width) as u32, (i / width) as u32]).map_or(0, |id| id.saturating_add(1));
        }
    }

    /// A black film of the same layers and another size, for a part of the picture.
    pub(crate) fn part(&self, width: u32, height: u32) -> Self {
        let n = width as usize * height as usize;
        let planes = self.planes.iter().map(|p| Plane { layer: p.layer, name: p.name, values: vec![0.0; n] }).collect();
        Self { width, height, planes, object_ids: self.object_ids.as_ref().map(|_| vec![0; n]) }
    }

    /// Copies a film of the same layers to where its first pixel is `(x, y)`.
    ///
    /// # Panics
    /// When it does not fit, or its layers differ.
    pub fn paste(&mut self, x: u32, y: u32, part: &Self) {
        assert!(x + part.width <= self.width && y + part.height <= self.height, "the part does not fit");
        assert!(self.layers() == part.layers(), "the layers differ");
        let (from, to, across) = (part.width as usize, self.width as usize, x as usize + y as usize * self.width as usize);
        for row in 0..part.height as usize {
            let (source, target) = (row * from..(row + 1) * from, across + row * to..across + row * to + from);
            for (plane, own) in part.planes.iter().zip(&mut self.planes) {
                own.values[target.clone()].copy_from_slice(&plane.values[source.clone()]);
            }
            if let (Some(own), Some(ids)) = (&mut self.object_ids, &part.object_ids) {
                own[target].copy_from_slice(&ids[source]);
            }
        }
    }

    /// Copies films of the same layers side by side: rows of `across` parts, those of a row equally high, from row `y` of the picture on. In parallel.
    ///
    /// # Panics
    /// When they do not fit, or their layers differ.
    pub(crate) fn paste_rows(&mut self, y: u32, parts: &[Self], across: usize) {
        let Some(first) = parts.first() else { return };
        assert!(parts.iter().all(|part| part.layers() == self.layers()), "the layers differ");
        let width = self.width as usize;
        let (start, rows) = (y as usize * width, first.height as usize * width);
        let floats = self.planes.iter_mut().enumerate().flat_map(|(k, plane)| {
            let bands = plane.values[start..].chunks_mut(rows).zip(parts.chunks(across));
            bands.map(move |(band, parts)| (band, parts, k))
        });
        let copy = |(band, parts, k): (&mut [f32], &[Self], usize)| {
            side_by_side(band, width, parts.iter().map(|part| (&part.planes[k].values[..], part.width as usize)));
        };
        floats.collect::<Vec<_>>().into_par_iter().for_each(copy);
        if let Some(ids) = &mut self.object_ids {
            for (band, parts) in ids[start..].chunks_mut(rows).zip(parts.chunks(across)) {
                let ids = parts.iter().map(|part| (part.object_ids.as_deref().unwrap_or_default(), part.width as usize));
                side_by_side(band, width, ids);
            }
        }
    }

    /// The three channels of a layer of light at a pixel; black when the film does not keep that layer.
    ///
    /// # Panics
    /// When the pixel lies outside.
    pub fn spectrum(&self, layer: Layer, x: u32, y: u32) -> Spectrum {
        assert!(x < self.width && y < self.height, "pixel ({x}, {y}) lies outside a film of {}x{}", self.width, self.height);
        self.triple(layer).map_or(Spectrum::BLACK, |t| t.at(y as usize * self.width as usize + x as usize))
    }

    /// The colour of a pixel; black when the film has no colour.
    ///
    /// # Panics
    /// When the pixel lies outside.
    pub fn color(&self, x: u32, y: u32) -> Spectrum {
        self.spectrum(Layer::Color, x, y)
    }

    /// Every value of a layer of three channels, in pixel order.
    pub(crate) fn triple(&self, layer: Layer) -> Option<Triple<'_>> {
        let first = self.planes.iter().position(|p| p.layer == layer)?;
        match self.planes.get(first..first + 3)? {
            [r, g, b] if b.layer == layer => Some(Triple { r: &r.values, g: &g.values, b: &b.values }),
            _ => None,
        }
    }

    /// How far a decomposition is from its sum: the largest `|RGB − Σ layers|` over pixels and channels, relative to the
    /// largest colour channel of the picture. `None` when the film lacks a layer it needs. 0 for a black picture.
    pub fn decomposition_error(&self, kind: Decomposition) -> Option<f32> {
        let color = self.triple(Layer::Color)?;
        let parts: Vec<_> = kind.layers().iter().map(|&l| self.triple(l)).collect::<Option<_>>()?;
        let (mut error, mut largest) = (0f32, 0f32);
        for i in 0..self.n_pixels() {
            let sum: Spectrum = parts.iter().map(|p| p.at(i)).sum();
            let difference = (color.at(i) - sum).map(f32::abs);
            // A NaN must not pass for agreement.
            error = if difference.is_finite() { error.max(difference.max_channel()) } else { f32::INFINITY };
            largest = largest.max(color.at(i).map(f32::abs).max_channel());
        }
        Some(if error > 0.0 { error / largest.max(f32::MIN_POSITIVE) } else { 0.0 })
    }
}

/// Copies pictures of known widths into one of `width`, from left to right.
fn side_by_side<'a, T: Copy + 'a>(to: &mut [T], width: usize, parts: impl Iterator<Item = (&'a [T], usize)>) {
    let mut x = 0;
    for (part, across) in parts {
        for (row, from) in to.chunks_mut(width).zip(part.chunks(across)) {
            row[x..x + across].copy_from_slice(from);
        }
        x += across;
    }
}

/// Three planes read together.
#[derive(Clone, Copy)]
pub(crate) struct Triple<'a> {
    r: &'a [f32],
    g: &'a [f32],
    b: &'a [f32],
}

impl Triple<'_> {
    /// The channels of pixel `i`.
    pub(crate) fn at(&self, i: usize) -> Spectrum {
        Spectrum::new(self.r[i], self.g[i], self.b[i])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_film_refuses_sizes_it_cannot_hold() {
        assert!(matches!(Film::new(0, 4, &[Layer::Color]), Err(FilmError::Size { .. })));
        assert!(matches!(Film::new(4, 70_000, &[Layer::Color]), Err(FilmError::Size { .. })));
        assert_eq!(Film::memory(10, 10, &[Layer::Color, Layer::Depth, Layer::ObjectId]), 5 * 400);
    }

    #[test]
    fn a_pixel_comes_back_from_the_layers_the_film_keeps_and_no_others() {
        let mut film = Film::new(3, 2, &[Layer::ObjectId, Layer::Diffuse, Layer::Color, Layer::Depth]).unwrap();
        let pixel = Pixel {
            color: Spectrum::new(1.0, 2.0, 3.0),
            diffuse: Spectrum::new(4.0, 5.0, 6.0),
            depth: 7.0,
            object: Some(8),
            ..Pixel::default()
        };
        film.set_pixel(2, 1, &pixel);
        assert_eq!(film.layers(), [Layer::Color, Layer::Diffuse, Layer::Depth, Layer::ObjectId]);
        assert_eq!(film.color(2, 1), pixel.color);
        assert_eq!(film.spectrum(Layer::Diffuse, 2, 1), pixel.diffuse);
        assert_eq!(film.plane("depth.Z").unwrap(), [0.0, 0.0, 0.0, 0.0, 0.0, 7.0]);
        assert_eq!(film.object_ids().unwrap(), [0, 0, 0, 0, 0, 9]);
        assert_eq!(film.plane("normal.X"), None);
    }

    #[test]
    fn the_decomposition_error_sees_a_missing_lobe_and_a_nan() {
        let layers = [&[Layer::Color][..], Decomposition::Lobe.layers()].concat();
        let mut film = Film::new(2, 1, &layers).unwrap();
        let sum = Spectrum::new(0.5, 1.0, 2.0);
        let pixel = Pixel { color: sum + sum, diffuse: sum, background: sum, ..Pixel::default() };
        film.set_pixel(0, 0, &pixel);
        assert_eq!(film.decomposition_error(Decomposition::Lobe), Some(0.0));
        assert_eq!(film.decomposition_error(Decomposition::Path), None);
        film.set_pixel(1, 0, &Pixel { diffuse: Spectrum::BLACK, ..pixel });
        assert_eq!(film.decomposition_error(Decomposition::Lobe), Some(0.5));
        film.set_pixel(1, 0, &Pixel { diffuse: Spectrum::gray(f32::NAN), ..pixel });
        assert_eq!(film.decomposition_error(Decomposition::Lobe), Some(f32::INFINITY));
    }
}
