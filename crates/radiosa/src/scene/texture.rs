//! Pictures and how surfaces look them up.

use std::sync::Arc;

use super::{ImageId, TextureId};
use crate::math::{DVec2, Vec2};
use crate::spectrum::Spectrum;

/// A decoded picture, row-major from the top left.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Path, or its name inside the source, for messages.
    pub name: String,
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// The values.
    pub pixels: Pixels,
}

/// Pixel storage.
#[derive(Clone, Debug, PartialEq)]
pub enum Pixels {
    /// RGBA bytes as stored in the file, not decoded: how to read them is the texture's [`Texture::is_srgb`].
    Rgba8(Arc<[u8]>),
    /// RGBA 16 bit, likewise.
    Rgba16(Arc<[u16]>),
    /// Linear RGBA.
    Rgba32F(Arc<[f32]>),
}

/// What a surface reads.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// Where its values come from.
    pub source: TextureSource,
    /// How it continues outside and between its texels.
    pub sampler: Sampler,
    /// RGB is sRGB-encoded (colours); otherwise it is used as it is (normals, roughness). Alpha is always linear.
    pub is_srgb: bool,
}

/// Where a texture's values come from.
#[derive(Clone, Debug, PartialEq)]
pub enum TextureSource {
    /// A picture.
    Image(ImageId),
    /// Squares of two colours, alternating, `1/scale` wide in uv.
    Checker {
        /// Colour of the square at the origin.
        even: Spectrum,
        /// The other one.
        odd: Spectrum,
        /// Squares per unit of u and v.
        scale: Vec2,
    },
}

/// Lookup rules.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sampler {
    /// Across.
    pub wrap_u: Wrap,
    /// Down.
    pub wrap_v: Wrap,
    /// Between texels.
    pub filter: Filter,
}

impl Default for Sampler {
    fn default() -> Self {
        Self { wrap_u: Wrap::Repeat, wrap_v: Wrap::Repeat, filter: Filter::Bilinear }
    }
}

/// What lies outside `[0, 1]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrap {
    /// Tiles.
    Repeat,
    /// Tiles, every other one mirrored.
    Mirror,
    /// The border texel.
    Clamp,
}

/// Between texels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Filter {
    /// The nearest texel.
    Nearest,
    /// Linear in both directions.
    Bilinear,
    /// Linear in both directions and between ever smaller copies of the picture, by the size of a pixel where it is seen (trilinear).
    Mipmap,
}

/// A texture as one material uses it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureRef {
    /// Which.
    pub texture: TextureId,
    /// Which set of texture coordinates.
    pub uv_set: u32,
    /// `KHR_texture_transform`: uv′ = offset + rotation (scale uv).
    pub transform: Option<UvTransform>,
}

/// An affine map of texture coordinates: `(u′, v′) = (a·(u, v, 1), b·(u, v, 1))`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UvTransform {
    /// First row.
    pub a: [f32; 3],
    /// Second row.
    pub b: [f32; 3],
}

impl UvTransform {
    /// Scale, then rotation (radians, as glTF's extension turns), then offset.
    pub fn new(offset: DVec2, rotation: f64, scale: DVec2) -> Self {
        let (s, c) = (libm::sin(rotation), libm::cos(rotation));
        Self {
            a: [(c * scale.x) as f32, (s * scale.y) as f32, offset.x as f32],
            b: [(-s * scale.x) as f32, (c * scale.y) as f32, offset.y as f32],
        }
    }

    /// The mapped coordinates.
    pub fn apply(&self, uv: Vec2) -> Vec2 {
        let row = |r: [f32; 3]| r[0] * uv.x + r[1] * uv.y + r[2];
        Vec2::new(row(self.a), row(self.b))
    }
}

impl TextureRef {
    /// The first set of coordinates, untransformed.
    pub const fn new(texture: TextureId) -> Self {
        Self { texture, uv_set: 0, transform: None }
    }
}
