//! How much of a surface a pixel sees: which of a texture's smaller copies to read.
//!
//! A pixel is a cone around its ray [Akenine21]; where it meets a surface at an angle it is longer by 1/cos. The level of the copy is
//! `log₂(width × texels per metre)`, 0 for the picture itself, as graphics hardware chooses it (by the longer side, so that nothing flickers
//! and oblique surfaces blur). Between levels it is linear.

use super::{Surface, World};
use crate::accel::Shape;
use crate::bsdf::texture;
use crate::math::Vec3;
use crate::scene::{Geometry, TextureRef, TextureSource};

/// The width of a pixel as it grows with distance; zero: every texture is read at its finest.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Footprint {
    /// At the eye, world units.
    pub at_eye: f32,
    /// More for each unit of distance.
    pub growth: f32,
}

/// Steeper than this (cosine) a footprint grows no longer.
const MIN_COS: f32 = 1.0 / 16.0;

impl Footprint {
    /// The longer side of a pixel on a surface that far away, seen at `cos` from its normal.
    pub fn width(self, distance: f32, cos: f32) -> f32 {
        (self.at_eye + self.growth * distance) / cos.abs().clamp(MIN_COS, 1.0)
    }
}

/// The level of the copy to read where a pixel is `width` wide and a square metre holds `texels_per_metre` squared.
pub(crate) fn level(width: f32, texels_per_metre: f32) -> f32 {
    libm::log2f((width * texels_per_metre).max(1e-9))
}

impl World {
    /// A texture's red, green, blue and alpha at a surface, from the copy that fits [`Surface::width`].
    pub(super) fn texel(&self, surface: &Surface, map: &TextureRef) -> [f32; 4] {
        let uv = surface.uv(self, map.uv_set);
        match self.pyramid(map.texture) {
            Some(pyramid) if surface.width > 0.0 => {
                let level = level(surface.width, self.texels_per_metre(surface, map));
                texture::sample_level(self.scene(), map, pyramid, uv, level)
            }
            _ => texture::sample(self.scene(), map, uv),
        }
    }

    /// The root of how many texels lie on a square metre.
    pub(crate) fn texels_per_metre(&self, surface: &Surface, map: &TextureRef) -> f32 {
        let scene = self.scene();
        let TextureSource::Image(image) = scene.textures[map.texture.index()].source else { return 0.0 };
        let image = &scene.images[image.index()];
        let n_texels = image.width as f32 * image.height as f32;
        let stretch = map.transform.map_or(1.0, |t| (t.a[0] * t.b[1] - t.a[1] * t.b[0]).abs());
        let instance = &scene.instances[surface.instance.index()];
        let turns = match instance.geometry {
            Geometry::Mesh(mesh) => {
                let mesh = &scene.meshes[mesh.index()];
                let Some(uvs) = mesh.uvs.get(map.uv_set as usize) else { return 0.0 };
                let tri = mesh.triangles[surface.primitive as usize];
                let [a, b, c] = tri.map(|i| uvs[i as usize]);
                let in_texture = (b - a).perp_dot(c - a).abs();
                let geometry = self.accel().geometry();
                let placed = &geometry.placed[surface.instance.index()];
                let Shape::Mesh { positions, .. } = &geometry.shapes[placed.shape as usize] else { return 0.0 };
                let [a, b, c]: [Vec3; 3] =
                    tri.map(|i| placed.to_world.map_or(positions[i as usize], |m| m.transform_point3(positions[i as usize])));
                in_texture / (b - a).cross(c - a).length()
            }
            // The whole picture lies around a sphere, and on the square around a disc; their size by the transform's volume.
            shape => {
                let radius = libm::cbrt(instance.transform.matrix3.determinant().abs()) as f32;
                1.0 / (radius * radius * if shape == Geometry::Sphere { 4.0 * std::f32::consts::PI } else { 4.0 })
            }
        };
        let density = (turns * stretch * n_texels).sqrt();
        if density.is_finite() { density } else { 0.0 }
    }
}
