//! What methods share about the ray from the eye: its first surface, what lies straight behind it, and behind everything.

use super::media::transmittance;
use super::{Footprint, LocalLight, Shading, Surface, World, default_light};
use crate::accel::Hit;
use crate::film::Pixel;
use crate::math::{Ray, Vec3};
use crate::spectrum::Spectrum;

/// A ray is followed behind transparent surfaces until this is left of it: less no longer changes an 8-bit picture.
pub(crate) const NEGLIGIBLE: f32 = 1.0 / 1024.0;
/// Transparent surfaces a ray passes at most; a pile of this many hides what is behind, as if it covered it.
pub(crate) const BEHIND_MAX: u32 = 256;

/// The ray from the eye, straight through what is partly transparent, by alpha or by transmission.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Straight {
    /// The default light's backdrop stands behind everything.
    pub(crate) has_backdrop: bool,
    /// How wide a camera sample is.
    pub(crate) footprint: Footprint,
    /// Of the medium it passes, 1/m.
    pub(crate) absorption: Spectrum,
}

impl Straight {
    /// One camera sample; `light` says what a surface reflects, and which part of the diffuse light went from surface to surface before. `n_rays` grows by the rays traced.
    pub(crate) fn sample(
        &self,
        world: &World,
        ray: &Ray,
        n_rays: &mut u64,
        mut light: impl FnMut(&Hit, &Surface, Shading, &mut u64) -> (LocalLight, Spectrum),
    ) -> Pixel {
        let mut pixel = Pixel::default();
        let mut ray = *ray;
        let mut travelled = 0.0;
        // What still comes through, and how much of that came through glass rather than through holes.
        let mut open = Spectrum::WHITE;
        let mut through_glass = false;
        for layer in 0..=BEHIND_MAX {
            if layer == BEHIND_MAX {
                open = Spectrum::BLACK;
                break;
            }
            *n_rays += 1;
            let Some((hit, mut surface)) = world.closest_visible(&ray) else {
                let seen = open * behind(world, ray.dir, self.has_backdrop, layer == 0);
                if through_glass {
                    pixel.refraction += seen;
                    pixel.direct += seen;
                } else {
                    pixel.background += seen;
                }
                pixel.color += seen;
                break;
            };
            let wo = -ray.dir;
            travelled += hit.t;
            open = open * transmittance(self.absorption, hit.t);
            surface.width = self.footprint.width(travelled, surface.ng.dot(wo));
            let shading = world.shading(&surface, wo);
            record(&mut pixel, world, &surface, &shading, travelled);
            let (glass, coverage) = (shading.straight_transmission(), shading.coverage);
            let weight = open * coverage;
            let emission = weight * shading.shown();
            let (light, indirect) = light(&hit, &surface, shading, n_rays);
            let (ambient, diffuse, specular) = (weight * light.ambient, weight * light.diffuse, weight * light.specular);
            if through_glass {
                pixel.refraction += ambient + diffuse + specular + emission;
                pixel.direct += emission;
            } else {
                pixel.ambient += ambient;
                pixel.diffuse += diffuse;
                pixel.specular += specular;
                pixel.emission += emission;
            }
            let indirect = weight * indirect;
            pixel.direct += (diffuse - indirect) + specular;
            // Ambient light stands for what was reflected before.
            pixel.indirect += ambient + indirect;
            pixel.color += ambient + diffuse + specular + emission;

            through_glass |= !glass.is_black();
            open = open * (Spectrum::gray(1.0 - coverage) + glass * coverage);
            if open.max_channel() < NEGLIGIBLE {
                open = Spectrum::BLACK;
                break;
            }
            ray = surface.ray(ray.dir);
        }
        pixel.alpha = 1.0 - open.luminance().clamp(0.0, 1.0);
        pixel
    }
}

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
