//! Ray casting: one ray a camera sample, the local reflection model where it hits, shadow rays to the lights.
//!
//! `L = L_e + I_a k_a + Σ_lights V f(wo, wi) E⊥ (n·wi)⁺`, with the rows and lobes of the light table (`docs/conventions.md`). Nothing is
//! interreflected: mirrors show only their highlights. A surface that is partly transparent, by alpha or by transmission, lets the
//! same straight ray go on behind it, and shadow rays likewise; nothing is bent.

use crate::film::Pixel;
use crate::math::{Ray, Vec3};
use crate::sampling::Stream;
use crate::scene::Light;
use crate::spectrum::Spectrum;
use crate::transport::eye::Straight;
use crate::transport::{Footprint, Integrator, LightSettings, Lights, Viewer, World, default_light};

/// What ray casting can be asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Shadow rays.
    pub shadows: bool,
    /// How lights are prepared.
    pub lights: LightSettings,
    /// Where highlights are seen from.
    pub viewer: Viewer,
    /// Lights beside the scene's own (`transport::default_light`); when there are some, their backdrop stands behind a scene without a
    /// background of its own.
    pub extra_lights: Vec<Light>,
    /// How wide a pixel is ([`View::footprint`](crate::transport::View::footprint)), for textures with smaller copies.
    pub footprint: Footprint,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            shadows: true,
            lights: LightSettings::default(),
            viewer: Viewer::Local,
            extra_lights: Vec::new(),
            footprint: Footprint::default(),
        }
    }
}

/// Ray casting, ready to be asked.
#[derive(Debug)]
pub struct RayCast {
    shadows: bool,
    viewer: Viewer,
    lights: Lights,
    /// Unit, to an infinitely distant viewer.
    to_viewer: Vec3,
    straight: Straight,
}

impl RayCast {
    /// Prepares the lights of a world. `forward` is the direction the camera looks in, for viewers at infinity.
    pub fn new(world: &World, settings: &Settings, forward: Vec3) -> Self {
        Self {
            shadows: settings.shadows,
            viewer: settings.viewer,
            lights: Lights::prepare(world, &settings.lights, &settings.extra_lights),
            to_viewer: -forward,
            straight: Straight {
                has_backdrop: default_light::has_backdrop(world, &settings.extra_lights),
                footprint: settings.footprint,
                absorption: Spectrum::BLACK,
            },
        }
    }

    /// The prepared lights.
    pub fn lights(&self) -> &Lights {
        &self.lights
    }
}

impl Integrator for RayCast {
    fn sample(&self, world: &World, ray: &Ray, _stream: &mut Stream, n_rays: &mut u64) -> Pixel {
        self.straight.sample(world, ray, n_rays, |_, surface, mut shading, n_rays| {
            if self.viewer == Viewer::Infinite {
                shading.wo = self.to_viewer;
            }
            (self.lights.at(world, surface, &shading, self.shadows, n_rays), Spectrum::BLACK)
        })
    }
}
