//! The light a scene without any gets, so that nobody is shown a black picture.

use super::World;
use crate::math::DVec3;
use crate::scene::{Attenuation, Camera, Light, LightKind, PhotometricUnit};
use crate::spectrum::Spectrum;

/// A headlight at the eye point and a soft hemisphere, when the scene has no light of its own; nothing otherwise.
///
/// Both are classic lights, so a white surface shows about 1. The headlight is at the eye point because everything visible is
/// then lit, whatever walls stand around.
pub fn for_dark_scene(world: &World, camera: &Camera) -> Vec<Light> {
    let scene = world.scene();
    let lit = !scene.ambient.is_black()
        || scene.lights.iter().any(gives_light)
        || scene.environment.as_ref().is_some_and(|e| !e.scale.is_black())
        || !world.emissive().is_empty();
    if lit {
        return Vec::new();
    }
    let headlight = LightKind::Point {
        position: camera.position,
        unit: PhotometricUnit::Classic,
        attenuation: Attenuation::default(),
        range: f64::INFINITY,
    };
    let sky = LightKind::Hemispherical { axis: DVec3::Y, down: Spectrum::gray(0.15) };
    vec![Light::new("default headlight", Spectrum::gray(0.65), headlight), Light::new("default sky", Spectrum::gray(0.35), sky)]
}

fn gives_light(light: &Light) -> bool {
    let discrete = |directions: &[crate::scene::Directional]| directions.iter().any(|d| !d.intensity.is_black());
    match &light.kind {
        LightKind::Ambient => !light.ambient.is_black(),
        LightKind::Discrete { directions } => discrete(directions) && !light.diffuse.is_black(),
        LightKind::Hemispherical { down, .. } => !light.diffuse.is_black() || !down.is_black(),
        _ => !light.diffuse.is_black() || !light.specular.is_black(),
    }
}
