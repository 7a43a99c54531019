//! Light from infinitely far away: a constant, or an equirectangular map.
//!
//! Maps have +y in the top row, −z in the middle column, and turn towards +x from left to right: with `(u, v)` in `[0, 1]²` from the top
//! left, `θ = π v` from +y and `φ = 2π (u − ½)`, a texel lies at `(sin θ sin φ, cos θ, −sin θ cos φ)`. Its solid angle is exact:
//! `Δφ (cos θ₁ − cos θ₂)`, and so is its vector `∫ ω dω`, so that a map's irradiance has no error but at the horizon.

use std::borrow::Cow;
use std::f64::consts::PI;

use rayon::prelude::*;

use super::discrete::Discrete;
use super::{Emitter, EnvironmentShadows, reduce};
use crate::film::srgb;
use crate::math::{DQuat, DVec3, Vec3, function};
use crate::scene::{Directional, Environment, EnvironmentRadiance, Image, Pixels};
use crate::spectrum::Spectrum;

/// An environment ready for look-ups.
#[derive(Clone, Debug, PartialEq)]
pub struct Sky {
    radiance: Radiance,
    /// From scene to map coordinates.
    to_map: DQuat,
    n_directions: u32,
}

#[derive(Clone, Debug, PartialEq)]
enum Radiance {
    Constant(Spectrum),
    Map(Map),
}

impl Sky {
    /// `images` are the scene's. An environment whose picture is missing or empty is constant.
    pub fn new(environment: &Environment, images: &[Image]) -> Self {
        let map = match environment.radiance {
            EnvironmentRadiance::Constant => None,
            EnvironmentRadiance::Map(id) => images.get(id.index()).and_then(|image| Map::from_image(image, environment.scale)),
        };
        Self {
            radiance: map.map_or(Radiance::Constant(environment.scale), Radiance::Map),
            to_map: environment.rotation.inverse(),
            n_directions: environment.n_directions,
        }
    }

    /// A map in scene coordinates, as it is.
    pub fn of_map(map: Map) -> Self {
        Self { radiance: Radiance::Map(map), to_map: DQuat::IDENTITY, n_directions: 0 }
    }

    /// Its map and the way there from scene coordinates, where it is not the same everywhere.
    pub(super) fn map(&self) -> Option<(&Map, DQuat)> {
        if let Radiance::Map(map) = &self.radiance { Some((map, self.to_map)) } else { None }
    }

    /// Radiance arriving from the unit direction `dir` (scene coordinates), bilinear between texels.
    pub fn radiance(&self, dir: Vec3) -> Spectrum {
        match &self.radiance {
            Radiance::Constant(l) => *l,
            Radiance::Map(map) => map.radiance((self.to_map * dir.as_dvec3()).as_vec3()),
        }
    }

    /// The irradiance integral `∫ L (n·ω)⁺ dω` for a surface of unit normal `n`, summed over every texel in f64: the slow reference for
    /// [`IrradianceTable`] and [`reduce`](Self::reduce).
    pub fn irradiance(&self, n: DVec3) -> [f64; 3] {
        match &self.radiance {
            Radiance::Constant(l) => l.to_array().map(|l| PI * f64::from(l)),
            Radiance::Map(map) => map.refined().irradiance(self.to_map * n),
        }
    }

    /// The environment as at most `n` directions of equal importance, `π L_i = ∫_cell L dω`: see [`mod@reduce`].
    pub fn reduce(&self, n: usize) -> Vec<Directional> {
        let to_scene = self.to_map.inverse();
        let map = match &self.radiance {
            Radiance::Map(map) => map.refined(),
            Radiance::Constant(l) => {
                let height = 2 * (n.clamp(1, 1 << 16) as f64).sqrt().ceil() as u32;
                Cow::Owned(Map::constant(2 * height, height, *l))
            }
        };
        let mut directions = reduce::reduce(&map, n);
        for d in &mut directions {
            d.to_light = (to_scene * d.to_light).normalize();
        }
        directions
    }

    /// As a light of the local models: the scene's number of directions, or the irradiance integral when that is zero (no highlight,
    /// no shadow).
    pub fn emitter(&self, shadows: EnvironmentShadows) -> Emitter {
        // The same radiance from everywhere needs no directions: its irradiance is exact.
        let is_constant = matches!(self.radiance, Radiance::Constant(_));
        if self.n_directions == 0 || (is_constant && shadows == EnvironmentShadows::Off) {
            Emitter::Environment(IrradianceTable::new(self))
        } else {
            Emitter::Discrete(Discrete::of_environment(&self.reduce(self.n_directions as usize), shadows))
        }
    }
}

/// An equirectangular map of radiance, in its own coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    width: u32,
    height: u32,
    /// Row-major from the top left; finite, not negative.
    texels: Vec<Spectrum>,
}

impl Map {
    /// From rows of texels, top left first. `None` unless there are `width × height` of them and at least one. Values that are negative or not
    /// a number count as black, infinite ones as the largest half float.
    pub fn new(width: u32, height: u32, texels: impl IntoIterator<Item = Spectrum>) -> Option<Self> {
        // min with infinity maps both to a finite value; NaN fails the comparison.
        let usable = |v: f32| if v > 0.0 { v.min(if v.is_infinite() { 65504.0 } else { f32::MAX }) } else { 0.0 };
        let texels: Vec<_> = texels.into_iter().map(|t| t.map(usable)).collect();
        (!texels.is_empty() && texels.len() as u64 == u64::from(width) * u64::from(height)).then_some(Self {
            width,
            height,
            texels,
        })
    }

    fn constant(width: u32, height: u32, l: Spectrum) -> Self {
        Self { width, height, texels: vec![l; width as usize * height as usize] }
    }

    /// From a decoded picture; bytes and 16-bit values are taken as sRGB.
    pub fn from_image(image: &Image, scale: Spectrum) -> Option<Self> {
        let rgb = |c: &[f32]| Spectrum::new(c[0], c[1], c[2]) * scale;
        let (w, h) = (image.width, image.height);
        match &image.pixels {
            Pixels::Rgba32F(p) => Self::new(w, h, p.chunks_exact(4).map(rgb)),
            Pixels::Rgba8(p) => {
                let linear = |v: u8| srgb::decode_u8(v);
                Self::new(w, h, p.chunks_exact(4).map(|c| rgb(&[linear(c[0]), linear(c[1]), linear(c[2])])))
            }
            Pixels::Rgba16(p) => {
                let linear = |v: u16| srgb::decode(f32::from(v) / 65535.0);
                Self::new(w, h, p.chunks_exact(4).map(|c| rgb(&[linear(c[0]), linear(c[1]), linear(c[2])])))
            }
        }
    }

    /// Texels across and down.
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// One texel.
    pub fn texel(&self, x: u32, y: u32) -> Spectrum {
        self.texels[y as usize * self.width as usize + x as usize]
    }

    /// Bilinear in a unit direction; the poles continue the outermost rows.
    pub fn radiance(&self, dir: Vec3) -> Spectrum {
        let [(i, s), (j, t)] = self.bilinear(dir);
        let row = |y: u32| self.texel(i[0], y).lerp(self.texel(i[1], y), s);
        row(j[0]).lerp(row(j[1]), t)
    }

    /// The two columns and the two rows around a direction, with the weight of the second.
    fn bilinear(&self, dir: Vec3) -> [([u32; 2], f32); 2] {
        let u = 0.5 + function::atan2(dir.x, -dir.z) * (0.5 / PI as f32);
        let v = function::atan2((dir.x * dir.x + dir.z * dir.z).sqrt(), dir.y) * (1.0 / PI as f32);
        let (w, h) = (self.width, self.height);
        let (x, y) = (u * w as f32 - 0.5, (v * h as f32 - 0.5).clamp(0.0, (h - 1) as f32));
        let (x0, y0) = (x.floor(), y.floor());
        let column = |x: f32| x.rem_euclid(w as f32) as u32 % w;
        let j = (y0 as u32).min(h - 1);
        [([column(x0), column(x0 + 1.0)], x - x0), ([j, (j + 1).min(h - 1)], y - y0)]
    }

    /// The same light in texels of at most about 1.4°: integrals take a texel for small, which those of a coarse map are not.
    pub(super) fn refined(&self) -> Cow<'_, Self> {
        let (across, down) = (256u32.div_ceil(self.width), 128u32.div_ceil(self.height));
        if across == 1 && down == 1 {
            return Cow::Borrowed(self);
        }
        let (width, height) = (self.width * across, self.height * down);
        let texels = (0..height).flat_map(|y| (0..width).map(move |x| self.texel(x / across, y / down))).collect();
        Cow::Owned(Self { width, height, texels })
    }

    fn irradiance(&self, n: DVec3) -> [f64; 3] {
        let columns = self.column_integrals();
        let mut e = [0.0; 3];
        for y in 0..self.height {
            let row = RowIntegral::new(y, self.height);
            for (x, column) in columns.iter().enumerate() {
                let cos = row.vector(*column).dot(n).max(0.0);
                for (e, l) in e.iter_mut().zip(self.texel(x as u32, y).to_array()) {
                    *e += f64::from(l) * cos;
                }
            }
        }
        e
    }

    /// `∫ sin φ dφ`, `∫ cos φ dφ` and `∫ dφ` over each column.
    pub(super) fn column_integrals(&self) -> Vec<[f64; 3]> {
        let d_phi = 2.0 * PI / f64::from(self.width);
        let edge = |x: u32| {
            let phi = f64::from(x) * d_phi - PI;
            (function::sin_f64(phi), function::cos_f64(phi))
        };
        (0..self.width).map(|x| (edge(x), edge(x + 1))).map(|(a, b)| [a.1 - b.1, b.0 - a.0, d_phi]).collect()
    }
}

/// Integrals over the colatitude of one row of texels.
#[derive(Clone, Copy, Debug)]
pub(super) struct RowIntegral {
    /// `∫ sin θ dθ`.
    pub(super) sin: f64,
    /// `∫ sin² θ dθ`.
    sin2: f64,
    /// `∫ sin θ cos θ dθ`.
    sin_cos: f64,
}

impl RowIntegral {
    pub(super) fn new(y: u32, height: u32) -> Self {
        let a = PI * f64::from(y) / f64::from(height);
        let b = PI * f64::from(y + 1) / f64::from(height);
        let (sa, ca, sb, cb) = (function::sin_f64(a), function::cos_f64(a), function::sin_f64(b), function::cos_f64(b));
        Self { sin: ca - cb, sin2: 0.5 * (b - a) - 0.5 * (sb * cb - sa * ca), sin_cos: 0.5 * (sb * sb - sa * sa) }
    }

    /// Solid angle of one of `n_columns` texels.
    pub(super) fn solid_angle(&self, n_columns: u32) -> f64 {
        self.sin * 2.0 * PI / f64::from(n_columns)
    }

    /// `∫ ω dω` over the texel in a column.
    pub(super) fn vector(&self, [sin_phi, cos_phi, d_phi]: [f64; 3]) -> DVec3 {
        DVec3::new(self.sin2 * sin_phi, self.sin_cos * d_phi, -self.sin2 * cos_phi)
    }
}

/// Irradiance by normal, tabulated: what a shading point can afford.
///
/// Nodes every 180°/64, bilinear between. Against the exact sum it is within 0.1 % for smooth skies; where a sun outshines the rest the kink at
/// its terminator is off by up to a hundredth of its irradiance.
#[derive(Clone, Debug, PartialEq)]
pub struct IrradianceTable {
    to_map: DQuat,
    /// `(ROWS + 1) × 2 ROWS` nodes, or one for a constant environment.
    nodes: Vec<Spectrum>,
}

impl IrradianceTable {
    const ROWS: usize = 64;

    /// Fills the table; in parallel, each node on its own, so the bits do not depend on the number of threads.
    pub fn new(sky: &Sky) -> Self {
        let nodes = match &sky.radiance {
            Radiance::Constant(l) => vec![*l * PI as f32],
            Radiance::Map(map) => {
                let blocks = blocks(&map.refined());
                let node = |i: usize| {
                    let theta = PI * (i / (2 * Self::ROWS)) as f64 / Self::ROWS as f64;
                    let phi = PI * (i % (2 * Self::ROWS)) as f64 / Self::ROWS as f64 - PI;
                    let s = function::sin_f64(theta);
                    let n =
                        DVec3::new(s * function::sin_f64(phi), function::cos_f64(theta), -s * function::cos_f64(phi)).as_vec3();
                    let mut e = [0.0; 3];
                    for block in &blocks {
                        for (e, v) in e.iter_mut().zip(block) {
                            *e += f64::from(v.dot(n).max(0.0));
                        }
                    }
                    Spectrum::from(e.map(|e| e as f32))
                };
                (0..2 * Self::ROWS * (Self::ROWS + 1)).into_par_iter().map(node).collect()
            }
        };
        Self { to_map: sky.to_map, nodes }
    }

    /// Irradiance of a surface of unit normal `n` (scene coordinates).
    pub fn irradiance(&self, n: Vec3) -> Spectrum {
        if let [e] = self.nodes[..] {
            return e;
        }
        let n = (self.to_map * n.as_dvec3()).as_vec3();
        let step = Self::ROWS as f32 / PI as f32;
        let x = (function::atan2(n.x, -n.z) * step + Self::ROWS as f32).max(0.0);
        let y = (function::atan2((n.x * n.x + n.z * n.z).sqrt(), n.y) * step).max(0.0);
        let (i, j) = (x as usize, (y as usize).min(Self::ROWS - 1));
        let (s, t) = (x - i as f32, y - j as f32);
        let node = |i: usize, j: usize| self.nodes[j * 2 * Self::ROWS + i % (2 * Self::ROWS)];
        node(i, j).lerp(node(i + 1, j), s).lerp(node(i, j + 1).lerp(node(i + 1, j + 1), s), t)
    }
}

/// The map's `∫ L ω dω`, channel by channel, over at most 64 × 32 blocks of texels: irradiance seen in full depends on nothing else.
fn blocks(map: &Map) -> Vec<[Vec3; 3]> {
    let (across, down) = (map.width.min(64), map.height.min(32));
    let mut sums = vec![[DVec3::ZERO; 3]; (across * down) as usize];
    let columns = map.column_integrals();
    for y in 0..map.height {
        let row = RowIntegral::new(y, map.height);
        let j = u64::from(y) * u64::from(down) / u64::from(map.height);
        for (x, column) in columns.iter().enumerate() {
            let i = x as u64 * u64::from(across) / u64::from(map.width);
            let vector = row.vector(*column);
            let sum = &mut sums[(j * u64::from(across) + i) as usize];
            for (sum, l) in sum.iter_mut().zip(map.texel(x as u32, y).to_array()) {
                *sum += vector * f64::from(l);
            }
        }
    }
    sums.iter().map(|block| block.map(|v| v.as_vec3())).collect()
}
