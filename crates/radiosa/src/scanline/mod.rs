//! Scan line: faces are projected onto the picture instead of rays being sent from it.
//!
//! Transform, clip, scan convert, keep what is nearest ([`crate::raster`]), and light what is seen by the local reflection model, without shadows:
//! the same lights, materials and film as ray casting, and so the same picture but for shadows. Visibility comes first and light second: a face is lit
//! where it is seen, once for each pixel, however many faces lie behind it.
//!
//! [`Interpolation`] says where the light is computed: once for each face, at its vertices [Gouraud71], or at every pixel from the interpolated
//! normal [Phong75]. With several samples a pixel, faces are tested at every sample and lit once for each pixel they are seen in (multisampling).
//!
//! Transparent faces (blended alpha, glass seen straight through) are collected for each sample and composited from front to back in exact order,
//! however they intersect; [`MAX_LAYERS`] of them hide what is behind.
//!
//! What it does not do: shadows, reflections, refraction, panoramic cameras.

mod facet;
mod light;
mod look;
mod set_up;
mod surfaces;
mod tile;

use rayon::prelude::*;
use thiserror::Error;

use crate::film::{Film, FilmError, Filter, FilterSample, Layer, Sampling};
use crate::raster::{Bins, Grid, Projection, SUBPIXELS, TILE};
use crate::sampling::sequence;
use crate::scene::{Light, MaterialId};
use crate::transport::{Footprint, LightSettings, Lights, Solver, Step, View, Viewer, World};
use facet::Eye;
use look::Look;
use set_up::SetUp;
use surfaces::Surfaces;

/// Nothing in front of the eye is nearer than this, metres; 1/z stays within f32.
const NEAREST: f64 = 1e-30;

/// Transparent faces composited at a sample at most, as many as other methods pass; the nearest ones are kept, and that many hide what is behind.
pub const MAX_LAYERS: usize = crate::transport::eye::BEHIND_MAX as usize;

/// Camera samples that are drawn together; more are drawn in several rounds.
const MAX_SAMPLES: u32 = 16;

/// Tiles a step, less what would begin another row of them; fewer with more samples than are drawn together.
const TILES_A_STEP: usize = 256;
/// About what the triangles and the list of a face take while it is drawn, bytes.
const BYTES_A_FACE: u64 = 110;

/// Where the light of a face is computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// At the middle of each face of the source, with its own normal: every face has one colour.
    Flat,
    /// At the vertices; the light is interpolated.
    Gouraud,
    /// At every pixel; the normal is interpolated.
    #[default]
    Phong,
}

/// Which faces are left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Culling {
    /// None: both sides of every face are drawn.
    #[default]
    None,
    /// Those seen from behind.
    Back,
}

/// What scan line can be asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Where light is computed.
    pub interpolation: Interpolation,
    /// Which faces are left out.
    pub culling: Culling,
    /// Rings a sphere is tessellated to, twice as many faces around; 64 keeps the outline of a sphere as high as the screen within half a pixel. 2 to 1024.
    pub segments: u32,
    /// How lights are prepared.
    pub lights: LightSettings,
    /// Where highlights are seen from.
    pub viewer: Viewer,
    /// Lights beside the scene's own (`transport::default_light`).
    pub extra_lights: Vec<Light>,
}

impl Settings {
    fn segments(&self) -> u32 {
        self.segments.clamp(2, 1024)
    }
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            interpolation: Interpolation::Phong,
            culling: Culling::None,
            segments: 64,
            lights: LightSettings::default(),
            viewer: Viewer::Local,
            extra_lights: Vec::new(),
        }
    }
}

/// Why a picture cannot be scan converted.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum ScanLineError {
    /// Faces stay straight only under linear projections.
    #[error("scan line cannot draw a panorama: its projection bends straight lines; use ray casting, or a perspective camera")]
    Panorama,
    /// More than 32 bits can number.
    #[error("scan line can draw 2³² faces at most")]
    TooManyFaces,
    /// The film cannot be had.
    #[error(transparent)]
    Film(#[from] FilmError),
}

/// A picture in the making: every step draws some tiles, the same at any thread count.
#[derive(Debug)]
pub struct ScanLine<'a> {
    view: &'a View,
    projection: Projection,
    surfaces: Surfaces,
    /// By material, and last for faces without one.
    looks: Vec<Look>,
    eye: Eye,
    lights: Lights,
    interpolation: Interpolation,
    culling: Culling,
    viewer: Viewer,
    has_backdrop: bool,
    /// Of a pixel, or of a sample where each is lit by itself.
    footprint: Footprint,
    sampling: Sampling,
    samples: Vec<FilterSample>,
    film: Film,
    bands: Vec<Grid>,
    /// The band being drawn: its triangles, and the next tile.
    band: usize,
    bins: Option<Bins>,
    next: usize,
    /// Those of the last step, to be used again.
    tiles: Vec<Film>,
    n_triangles: u64,
}

impl<'a> ScanLine<'a> {
    /// Nothing drawn yet.
    ///
    /// # Errors
    /// For panoramic cameras, scenes of too many faces, and when the film cannot be had.
    pub fn new(world: &World, view: &'a View, settings: &Settings, sampling: Sampling) -> Result<Self, ScanLineError> {
        // Rays see everything in front of the eye, but begin at its place rounded to f32: what is nearer than that rounding may lie on either side of it.
        let rounding = f64::from(view.eye().abs().max_element()) * f64::from(f32::EPSILON);
        let projection = view.projection(rounding.max(NEAREST)).ok_or(ScanLineError::Panorama)?;
        let surfaces = Surfaces::new(world, settings.segments()).ok_or(ScanLineError::TooManyFaces)?;
        let film = Film::new(sampling.width, sampling.height, &sampling.layers)?;
        let samples: Vec<FilterSample> = (0..sampling.spp.max(1))
            .map(|i| sampling.filter.sample(sequence::pixel_sample(sampling.seed, 0, i, sampling.spp)))
            .collect();
        let reach = samples.iter().map(|s| s.offset.abs().max_element()).fold(0.0, f32::max);
        let spread = (reach * SUBPIXELS as f32).ceil() as i32;
        let ids = (0..world.scene().materials.len()).map(|i| Some(MaterialId(i as u32))).chain([None]);
        Ok(Self {
            view,
            eye: Eye::new(&projection, settings.viewer == Viewer::Infinite),
            projection,
            looks: ids.map(|id| Look::new(world.material(id), surfaces.kind(id))).collect(),
            surfaces,
            lights: Lights::prepare(world, &settings.lights, &settings.extra_lights),
            interpolation: settings.interpolation,
            culling: settings.culling,
            viewer: settings.viewer,
            has_backdrop: crate::transport::default_light::has_backdrop(world, &settings.extra_lights),
            footprint: view.footprint(if sampling.filter == Filter::Box { 1 } else { sampling.spp }),
            bands: Grid::bands(sampling.width, sampling.height, spread).collect(),
            sampling,
            samples,
            film,
            band: 0,
            bins: None,
            next: 0,
            tiles: Vec::new(),
            n_triangles: 0,
        })
    }

    /// About what drawing a world takes beside the film, bytes: its triangles, and what exact shapes are tessellated to.
    pub fn memory(world: &World, settings: &Settings) -> u64 {
        let (n_faces, own) = Surfaces::size(world, settings.segments());
        n_faces * BYTES_A_FACE + own
    }

    /// The prepared lights.
    pub fn lights(&self) -> &Lights {
        &self.lights
    }

    /// Triangles scanned so far, after clipping and rejection.
    pub fn n_triangles(&self) -> u64 {
        self.n_triangles
    }

    /// The picture as it is.
    pub fn into_film(self) -> Film {
        self.film
    }

    /// Samples of one pixel are lit together where they belong to it alone.
    fn is_multisampled(&self) -> bool {
        self.sampling.filter == Filter::Box
    }

    /// One sample a pixel, and no layers but the colour.
    fn is_plain(&self) -> bool {
        self.samples.len() == 1 && self.film.layers().iter().all(|l| matches!(l, Layer::Color | Layer::Alpha))
    }

    fn look(&self, material: Option<MaterialId>) -> &Look {
        &self.looks[material.map_or(self.looks.len() - 1, MaterialId::index)]
    }

    /// Some layer is not light.
    fn wants_data(&self) -> bool {
        let data = [Layer::Albedo, Layer::Normal, Layer::Position, Layer::Depth, Layer::ObjectId];
        self.sampling.layers.iter().any(|l| data.contains(l))
    }
}

impl Solver for ScanLine<'_> {
    type Solution = Film;

    fn step(&mut self, world: &World) -> Step {
        let Some(&grid) = self.bands.get(self.band) else { return Step::Converged };
        if self.bins.is_none() {
            let set_up = SetUp::new(world, &self.surfaces, &self.projection, self.culling, &grid);
            let bins = Bins::build(&grid, self.surfaces.n_faces(), |range, out| set_up.range(range, out));
            self.n_triangles += bins.n_triangles() as u64;
            self.bins = Some(bins);
            self.next = 0;
        }
        let across = grid.columns() as usize;
        let rounds = self.samples.len().div_ceil(MAX_SAMPLES as usize).max(1);
        let a_step = (TILES_A_STEP / rounds).max(8);
        let row_end = self.next - self.next % across + across;
        // Whole rows, or parts of one.
        let end = if a_step < across {
            (self.next + a_step).min(row_end)
        } else {
            (self.next + across * (a_step / across)).min(grid.n_tiles())
        };
        if let Some(bins) = &self.bins {
            let mut tiles = std::mem::take(&mut self.tiles);
            let empty =
                || Film::new(TILE, TILE, &self.sampling.layers).expect("a tile is no larger than a picture that could be had");
            tiles.resize_with(end - self.next, empty);
            let this = &*self;
            tiles.par_iter_mut().enumerate().for_each_init(
                || tile::Scratch::new(this, world),
                |scratch, (i, film)| tile::draw(this, world, &grid, bins, this.next + i, scratch, film),
            );
            if a_step < across {
                let corners = (self.next..end).map(|i| grid.corner(i));
                corners.zip(&tiles).for_each(|((x, y), tile)| self.film.paste(x, y, tile));
            } else {
                self.film.paste_rows(grid.corner(self.next).1, &tiles, across);
            }
            self.tiles = tiles;
        }
        self.next = end;
        if end == grid.n_tiles() {
            self.bins = None;
            self.band += 1;
        }
        let rows_done = f64::from(grid.first_row) + f64::from(grid.n_rows) * end as f64 / grid.n_tiles() as f64;
        let all = self.bands.last().map_or(1, |last| last.first_row + last.n_rows);
        if self.band == self.bands.len() { Step::Converged } else { Step::Working { done: rows_done / f64::from(all) } }
    }

    fn solution(&self) -> &Film {
        &self.film
    }
}
