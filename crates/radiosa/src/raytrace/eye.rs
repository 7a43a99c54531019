//! What the methods of this folder share about the ray from the eye: its first surface, and what lies behind everything.

use crate::film::Pixel;
use crate::math::Vec3;
use crate::spectrum::Spectrum;
use crate::transport::{Shading, Surface, World, default_light};

/// A ray is followed behind transparent surfaces until this is left of it: less no longer changes an 8-bit picture.
pub(super) const NEGLIGIBLE: f32 = 1.0 / 1024.0;
/// Transparent surfaces a ray passes at most; a pile of this many hides the rest.
pub(super) const BEHIND_MAX: u32 = 256;

/// What a ray that leaves the scene sees.
pub(super) fn behind(world: &World, dir: Vec3, has_backdrop: bool, from_eye: bool) -> Spectrum {
    if has_backdrop { default_light::backdrop(dir) } else { world.background(dir, from_eye) }
}

/// Notes the first surface that is there; `distance` from the eye in world units.
pub(super) fn record(pixel: &mut Pixel, world: &World, surface: &Surface, shading: &Shading, distance: f32) {
    if pixel.object.is_some() || shading.coverage <= 0.0 {
        return;
    }
    let (position, normal, metres) = world.to_file(surface.p, shading.n);
    pixel.albedo = shading.bsdf.albedo();
    pixel.normal = normal;
    pixel.position = position;
    pixel.depth = distance / metres;
    pixel.object = Some(surface.instance.0);
}
