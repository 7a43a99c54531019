//! Path tracing: the whole rendering equation [Kajiya86] by random paths from the eye, with next-event estimation and multiple importance sampling.
//!
//! ```text
//! L(x, ωo) = L_e(x, ωo) + ∫ f(x, ωo, ωi) L(x, ωi) (n·ωi)⁺ dωi
//! ```
//!
//! At every surface of a path light is looked for twice: towards a point drawn on an emissive surface or a direction drawn from the sky (`emitter::random`,
//! `emitter::environment`), and in a direction drawn from what the surface reflects ([`Scatter`](crate::bsdf::Scatter)), in which the path goes on. What both can find is
//! weighed by the power heuristic [Veach95], so that each counts where it is the better way and the sum is right. Delta lights are looked at
//! one and all, of many some (`emitter::lamps`).
//! Paths end by Russian roulette when little of what they bring would be seen.
//!
//! Mirrors and glass are followed one ray at a time, chosen by chance; which body a ray is in, and what it absorbs, is as in [`whitted`](super::whitted). Light from
//! emissive surfaces and skies comes through glass and off mirrors to diffuse surfaces (caustics), by the paths that happen to hit the source: rightly, but
//! with much noise where the source is small, and from delta lights not at all. Paths that begin at the sources (`from_light.rs`) find both where the eye sees the lit surface itself. Sheets
//! let light pass straight. Ambient light is ignored, since this is what it stands for. Nothing is clamped. Homogeneous media scatter light between surfaces (`medium.rs`).

mod from_light;
mod medium;
mod walk;

use rayon::prelude::*;

use crate::bsdf::Highlights;
use crate::bsdf::fresnel::Weighing;
use crate::emitter::EnvironmentShadows;
use crate::emitter::area::{EmissiveShape, EmissiveSurface};
use crate::emitter::random::PointSampler;
use crate::emitter::sky_sampler::SkySampler;
use crate::film::Pixel;
use crate::math::{Ray, Vec3};
use crate::sampling::Stream;
use crate::scene::{Light, LightKind};
use crate::spectrum::Spectrum;
use crate::transport::media::{Loss, Media};
use crate::transport::{
    Emitters, FEW_LAMPS, Footprint, Glass, Integrator, LightSettings, Lights, Splat, Surface, World, default_light,
};

pub use from_light::FromLight;
use from_light::LightPaths;
use walk::Walk;

/// What path tracing can be asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// How often light is scattered between its source and the eye, at most: 1 is direct light. Without a limit Russian roulette alone ends paths.
    pub max_depth: Option<u32>,
    /// Paths that go on from what the eye sees, for each camera sample, at least 1: what is lit straight needs fewer samples than what is lit by other surfaces.
    pub branches: u32,
    /// Where there are more than eight points and spots, so many of them are looked at from each place, drawn by what they give, and so many lights from infinitely far where
    /// there are more than eight directions; up to eight. `None`: all of them.
    pub drawn_lamps: Option<u32>,
    /// What the highlights of Phong's model do with light that does not come from delta lights.
    pub highlights: Highlights,
    /// Gives back the light that the facets of rough surfaces reflect more than once ([`multiple_scattering`](crate::bsdf::multiple_scattering)).
    pub multiple_scattering: bool,
    /// How the constants of mirrors and glass are weighed.
    pub fresnel: Weighing,
    /// Lights beside the scene's own, as for ray casting.
    pub extra_lights: Vec<Light>,
    /// How wide a pixel is, as for ray casting; it goes on growing along the path.
    pub footprint: Footprint,
    /// The eye point, as for Whitted's method.
    pub eye: Option<Vec3>,
    /// Light that mirrors and glass throw is looked for from its sources, too, and weighed against what paths from the eye find of it. Only for pictures that add it
    /// ([`Integrator::splats`]); not where media scatter, nor where the eye or a light source is within a body.
    pub from_light: Option<FromLight>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            max_depth: None,
            branches: 4,
            drawn_lamps: Some(2),
            highlights: Highlights::default(),
            multiple_scattering: false,
            fresnel: Weighing::Material,
            extra_lights: Vec::new(),
            footprint: Footprint::default(),
            eye: None,
            from_light: None,
        }
    }
}

/// Path tracing, ready to be asked.
#[derive(Debug)]
pub struct PathTracer {
    settings: Settings,
    /// Those with a place or a direction.
    lamps: Lights,
    has_lamps: bool,
    emissive: PointSampler,
    /// Of an environment map.
    sky: Option<SkySampler>,
    /// Axis and radiance from above and below of each hemispherical light.
    hemispheres: Vec<(Vec3, Spectrum, Spectrum)>,
    has_backdrop: bool,
    /// Something transparent has an inside.
    has_bodies: bool,
    /// A light source is within one.
    has_light_in_bodies: bool,
    /// Somewhere light is scattered or emitted between surfaces, or space around bodies absorbs.
    has_media: bool,
    /// What takes light away from shadow rays.
    loss: Loss,
    /// The bodies the eye is in.
    around_eye: Media,
    from_light: Option<LightPaths>,
}

impl PathTracer {
    /// Prepares the lights of a world.
    pub fn new(world: &World, settings: &Settings) -> Self {
        let light_settings = LightSettings { emitters: Emitters::Ignore, environment_shadows: EnvironmentShadows::On };
        let has_media = world.scene().has_media();
        let loss = if has_media { Loss::Extinction } else { Loss::Absorption };
        let lamps = Lights::prepare_without_skies(world, &light_settings, &settings.extra_lights);
        let mut lamps = lamps.with_glass(Glass::Sheets).with_loss(loss);
        let has_lamps = lamps.n_lamps() > 0;
        if let Some(n) = settings.drawn_lamps {
            lamps = lamps.drawing(n, FEW_LAMPS);
        }
        let all = || world.scene().lights.iter().chain(&settings.extra_lights);
        let hemispheres = all().filter_map(|light| match light.kind {
            LightKind::Hemispherical { axis, down } => Some((axis.as_vec3().normalize_or(Vec3::Y), light.diffuse, down)),
            _ => None,
        });
        let has_bodies = world.scene().materials.iter().any(|m| m.transmits() && m.has_inside());
        let has_light_in_bodies = has_bodies && has_light_in_bodies(world, &settings.extra_lights);
        let around_eye = settings.eye.filter(|_| has_bodies).map_or(Media::VACUUM, |eye| Media::around(world, eye));
        // Within bodies light counts by the square of their index, which paths from the light do not know.
        let is_in_bodies = has_light_in_bodies || around_eye.current().is_some();
        let from_light = settings.from_light.as_ref().filter(|_| !has_media && !is_in_bodies);
        Self {
            from_light: from_light.and_then(|asked| LightPaths::new(world, asked, &settings.extra_lights)),
            has_lamps,
            lamps,
            emissive: PointSampler::new(world.emissive()),
            sky: world.sky().and_then(SkySampler::new),
            hemispheres: hemispheres.collect(),
            has_backdrop: default_light::has_backdrop(world, &settings.extra_lights),
            has_bodies,
            has_light_in_bodies,
            has_media,
            loss,
            around_eye,
            settings: settings.clone(),
        }
    }

    /// The irradiance of a place on the side of the unit normal `n`, W/m² or lux, by about `samples` paths, and the standard error of its luminance from
    /// [`SETS`] independent sets of them. `key` names the random numbers.
    pub fn irradiance(&self, world: &World, surface: &Surface, n: Vec3, samples: u32, key: u64) -> (Spectrum, f64) {
        let around = if self.has_media && self.has_bodies { Media::around(world, surface.p) } else { Media::VACUUM };
        let each = samples.div_ceil(SETS * self.settings.branches.max(1)).max(1);
        let of_set = |set: u32| {
            let mut sum = [0.0f64; 3];
            for i in 0..each {
                let stream = Stream::new(key, u64::from(set), u64::from(i));
                let light = Walk::new(self, world, stream, &mut 0).irradiance_of(surface, n, around);
                sum.iter_mut().zip(light.to_array()).for_each(|(sum, v)| *sum += f64::from(v));
            }
            sum.map(|v| v / f64::from(each))
        };
        let sets: Vec<[f64; 3]> = (0..SETS).map(of_set).collect();
        let mean: [f64; 3] = std::array::from_fn(|c| sets.iter().map(|e| e[c]).sum::<f64>() / f64::from(SETS));
        let off = |e: &[f64; 3]| (crate::spectrum::luminance(*e) - crate::spectrum::luminance(mean)).powi(2);
        let variance = sets.iter().map(off).sum::<f64>() / f64::from(SETS * (SETS - 1));
        (Spectrum::from(mean.map(|v| v as f32)), variance.sqrt())
    }

    /// The radiance of hemispherical lights from a direction.
    fn hemispheres(&self, dir: Vec3) -> Spectrum {
        self.hemispheres
            .iter()
            .fold(Spectrum::BLACK, |sum, (axis, up, down)| sum + if axis.dot(dir) >= 0.0 { *up } else { *down })
    }
}

/// Whether a light source is within a body: a corner or the centre of something emissive, or a lamp with a place.
fn has_light_in_bodies(world: &World, extra_lights: &[Light]) -> bool {
    let bodies = from_light::spheres_around(world, |material| material.transmits() && material.has_inside());
    let is_within = |p: Vec3| {
        bodies.iter().any(|body| (p - body.centre).length() <= body.radius * (1.0 + 1e-4))
            && Media::around(world, p).current().is_some()
    };
    let of_surface = |surface: &EmissiveSurface| match surface.shape {
        EmissiveShape::Triangle(corners) => corners.into_iter().chain([corners.iter().sum::<Vec3>() / 3.0]).any(is_within),
        shape => is_within(shape.bounds().centre()),
    };
    let of_lamp = |light: &Light| match light.kind {
        LightKind::Point { position, .. } | LightKind::Spot { position, .. } => is_within((position - world.origin()).as_vec3()),
        _ => false,
    };
    world.scene().lights.iter().chain(extra_lights).any(of_lamp) || world.emissive().par_iter().any(of_surface)
}

/// Independent sets of paths at a sensor.
const SETS: u32 = 32;

impl Integrator for PathTracer {
    fn sample(&self, world: &World, ray: &Ray, stream: &mut Stream, n_rays: &mut u64) -> Pixel {
        Walk::new(self, world, stream.clone(), n_rays).of_camera_ray(ray)
    }

    fn branching(&self) -> u32 {
        self.settings.branches.max(1).saturating_mul(2)
    }

    fn has_splats(&self) -> bool {
        self.from_light.is_some()
    }

    fn splats(&self, world: &World, seed: u64, pass: u32, n_rays: &mut u64) -> Vec<Splat> {
        self.splats_of_pass(world, seed, pass, n_rays)
    }
}
