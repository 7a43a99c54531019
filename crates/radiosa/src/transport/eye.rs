//! What methods share about the ray from the eye: its first surface, and what lies behind everything.

use super::{Shading, Surface, World, default_light};
use crate::film::Pixel;
use crate::math::Vec3;
use crate::spectrum::Spectrum;

/// A ray is followed behind transparent surfaces until this is left of it: less no longer changes an 8-bit picture.
pub(crate) const NEGLIGIBLE: f32 = 1.0 / 1024.0;
/// Transparent surfaces a ray passes at most; a pile of this many hides the rest.
pub(crate) const BEHIND_MAX: u32 = 256;

/// What a ray that leaves the scene sees.
pub(crate) fn behind(world: &World, dir: Vec3, has_backdrop: bool, from_eye: bool) -> Spectrum {
    if has_backdrop { default_light::backdrop(dir) } else { world.background(dir, from_eye) }
}

/// Notes the first surface that is there; `distance` from the eye in world units.
pub(crate) fn record(pixel: &mut Pixel, world: &World, surface: &Surface, shading: &Shading, distance: f32) {
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
