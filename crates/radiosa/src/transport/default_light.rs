//! The light a scene without any gets, so that nobody is shown a black picture.

use super::{Integrator, View, World};
use crate::math::{DVec3, Vec3};
use crate::sampling::Stream;
use crate::scene::{Attenuation, Camera, Light, LightKind, PhotometricUnit};
use crate::spectrum::Spectrum;

/// A headlight at the eye point and a soft hemisphere.
///
/// Both are classic lights, so a white surface shows about 1. The headlight is at the eye point because everything visible is
/// then lit, whatever walls stand around.
pub fn lights(camera: &Camera) -> Vec<Light> {
    let headlight = LightKind::Point {
        position: camera.position,
        unit: PhotometricUnit::Classic,
        attenuation: Attenuation::default(),
        range: f64::INFINITY,
    };
    let sky = LightKind::Hemispherical { axis: DVec3::Y, down: Spectrum::gray(0.15) };
    vec![Light::new("default headlight", Spectrum::gray(0.65), headlight), Light::new("default sky", Spectrum::gray(0.35), sky)]
}

/// What is seen behind a scene that is lit by [`lights`]: dim enough to set off what is bright, light enough for what is black.
pub fn backdrop(dir: Vec3) -> Spectrum {
    Spectrum::gray(0.03).lerp(Spectrum::new(0.10, 0.11, 0.13), 0.5 + 0.5 * dir.y.clamp(-1.0, 1.0))
}

/// True when a scene has something that gives light, whatever it reaches.
pub fn has_light(world: &World) -> bool {
    let scene = world.scene();
    !scene.ambient.is_black()
        || scene.lights.iter().any(gives_light)
        || scene.environment.as_ref().is_some_and(|e| !e.scale.is_black())
        || !world.emissive().is_empty()
}

/// What a coarse look through a camera finds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Survey {
    /// Some sample meets a surface.
    pub sees_surface: bool,
    /// Some sample shows any light at all, reflected, emitted or behind.
    pub sees_light: bool,
}

/// Looks through a camera with `method`, coarsely, until it has seen both a surface and light, or `is_over` says that there is no more time.
pub fn survey(
    world: &World,
    view: &View,
    (width, height): (u32, u32),
    method: &impl Integrator,
    is_over: impl Fn() -> bool,
) -> Survey {
    const COLUMNS: u32 = 32;
    const ROWS: u32 = 24;
    let mut survey = Survey::default();
    for i in 0..COLUMNS * ROWS {
        if survey.sees_surface && survey.sees_light || is_over() {
            break;
        }
        let x = (f64::from(i % COLUMNS) + 0.5) * f64::from(width) / f64::from(COLUMNS);
        let y = (f64::from(i / COLUMNS) + 0.5) * f64::from(height) / f64::from(ROWS);
        let pixel = method.sample(world, &view.ray(x, y), &mut Stream::new(0, u64::from(i), 0), &mut 0);
        survey.sees_surface |= pixel.object.is_some();
        survey.sees_light |= !pixel.color.is_black();
    }
    survey
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

/// True when the backdrop of these lights stands behind a scene: they are there, and it has no background of its own.
pub fn has_backdrop(world: &World, extra_lights: &[Light]) -> bool {
    !extra_lights.is_empty() && world.scene().background.is_black() && world.scene().environment.is_none()
}
