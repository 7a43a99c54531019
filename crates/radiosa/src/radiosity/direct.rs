//! Light that is not on a surface: what points, spots, suns and skies bring to each element.
//!
//! It enters the system as `E_i += ρ_i H_i`, H_i the visible irradiance averaged over the element: over a few points first, over more where they disagree, as
//! they do at the edge of a shadow, and where rays from lamps land between them.

use rayon::prelude::*;

use super::discontinuity::Apex;
use super::medium::Medium;
use super::mesh::{Element, ElementMesh};
use crate::accel::Hit;
use crate::emitter::EnvironmentShadows;
use crate::math::{DVec3, Frame, Ray, Vec3};
use crate::sampling::{rng, sequence, warp};
use crate::scene::LightKind;
use crate::spectrum::Spectrum;
use crate::transport::{Emitters, LightSettings, Lights, Passage, Surface, World};

/// Points of an element at first, and where they disagree.
const POINTS: [u32; 2] = [4, 64];

/// Rays to the sky from each element, or from each sensor.
const SKY_RAYS: u32 = 256;

/// The lights of a world that are not surfaces.
#[derive(Debug)]
pub struct DirectLight<'a> {
    world: &'a World,
    lights: Lights,
    has_lights: bool,
    /// Radiance from above and below, with the axis, of each hemispherical light.
    hemispheres: Vec<(Vec3, Spectrum, Spectrum)>,
    /// Where lamps are, or where their light comes from.
    apexes: Vec<Apex>,
    medium: Medium,
    seed: u64,
}

impl<'a> DirectLight<'a> {
    /// Prepares the lights of a world and `extra` ones.
    pub fn new(world: &'a World, extra: &[crate::scene::Light], seed: u64) -> Self {
        let settings = LightSettings { emitters: Emitters::Ignore, environment_shadows: EnvironmentShadows::On };
        let all = || world.scene().lights.iter().chain(extra);
        let hemispheres = all().filter_map(|light| match light.kind {
            LightKind::Hemispherical { axis, down } => Some((axis.as_vec3().normalize_or(Vec3::Y), light.diffuse, down)),
            _ => None,
        });
        let place = |p: DVec3| Apex { p: p - world.origin(), w: 1.0 };
        let direction = |p: DVec3| Apex { p, w: 0.0 };
        let apexes = all().flat_map(|light| match &light.kind {
            LightKind::Point { position, .. } | LightKind::Spot { position, .. } => vec![place(*position)],
            LightKind::Distant { to_light, .. } => vec![direction(*to_light)],
            LightKind::Discrete { directions } => directions.iter().map(|d| direction(d.to_light)).collect(),
            LightKind::Ambient | LightKind::Hemispherical { .. } => Vec::new(),
        });
        Self {
            world,
            apexes: apexes.collect(),
            has_lights: all().any(|l| !matches!(l.kind, LightKind::Hemispherical { .. } | LightKind::Ambient)),
            hemispheres: hemispheres.collect(),
            lights: Lights::prepare_without_skies(world, &settings, extra),
            medium: Medium::default(),
            seed,
        }
    }

    /// Lamps shine through a medium; suns and skies are what they are where they arrive.
    pub fn within(mut self, medium: Medium) -> Self {
        self.lights = self.lights.within(Spectrum::from(medium.absorption.map(|s| s as f32)));
        self.medium = medium;
        self
    }

    /// What is between lamps and surfaces.
    pub fn medium(&self) -> Medium {
        self.medium
    }

    /// Where lamps are, or where their light comes from.
    pub(super) fn apexes(&self) -> &[Apex] {
        &self.apexes
    }

    /// Nothing but surfaces gives light.
    pub fn is_empty(&self) -> bool {
        !self.has_lights && !self.has_sky()
    }

    /// Rays that leave the scene meet light.
    pub fn has_sky(&self) -> bool {
        self.world.sky().is_some() || !self.hemispheres.is_empty()
    }

    /// Mean irradiance of the exposed part of every element, W/m² or lux: from all lights, and the part that comes from lamps, which have a place or a
    /// direction.
    pub fn irradiance(&self, mesh: &ElementMesh) -> [Vec<[f64; 3]>; 2] {
        if self.is_empty() {
            return [(); 2].map(|()| vec![[0.0; 3]; mesh.elements().len()]);
        }
        let mut is_lit = vec![false; mesh.elements().len()];
        for (hit, surface, dir) in self.landings() {
            if let Some(element) = mesh.element_at(&hit, surface.p, dir) {
                is_lit[element as usize] = true;
            }
        }
        let elements = mesh.elements().par_iter().enumerate();
        let (all, lamps) = elements.map(|(i, element)| self.of_element(mesh, i as u64, element, is_lit[i])).unzip();
        [all, lamps]
    }

    /// `is_lit`: some lamp lights a part of it, be it between its first points.
    fn of_element(&self, mesh: &ElementMesh, i: u64, element: &Element, is_lit: bool) -> ([f64; 3], [f64; 3]) {
        let key = rng::key(&[self.seed, i, 0x6469_7265]);
        let surface = |k: u32| {
            let u = sequence::point_2d(k, key);
            mesh.surface(self.world, element, [f64::from(u.x), f64::from(u.y)])
        };
        let n = element.normal.as_vec3();
        let mut lamps = [0.0f64; 3];
        if self.has_lights {
            let (mut low, mut high) = (f32::INFINITY, 0.0f32);
            let mut taken = 0;
            for n_points in POINTS {
                for k in taken..n_points {
                    let h = self.of_lamps(&surface(k), n);
                    (low, high) = (low.min(h.luminance()), high.max(h.luminance()));
                    [h.r, h.g, h.b].into_iter().zip(&mut lamps).for_each(|(h, s)| *s += f64::from(h));
                }
                taken = n_points;
                if high - low <= 0.1 * high && (high > 0.0 || !is_lit) {
                    break;
                }
            }
            lamps = lamps.map(|s| s / f64::from(taken));
        }
        let mut all = lamps;
        if self.has_sky() {
            let sky = (0..SKY_RAYS).map(|k| self.of_sky(&surface(k), n, k, key)).sum::<Spectrum>() * (1.0 / SKY_RAYS as f32);
            [sky.r, sky.g, sky.b].into_iter().zip(&mut all).for_each(|(h, s)| *s += f64::from(h));
        }
        let exposed = element.exposed().max(1e-6);
        (all.map(|s| s / exposed), lamps.map(|s| s / exposed))
    }

    /// The irradiance at a point, seen from the side of `n` (unit); `key` names the sensor.
    pub fn at(&self, surface: &Surface, n: Vec3, key: u64) -> Spectrum {
        let lamps = if self.has_lights { self.of_lamps(surface, n) } else { Spectrum::BLACK };
        lamps + self.of_skies(surface, n, key)
    }

    /// The part of [`Self::at`] that comes from skies.
    pub fn of_skies(&self, surface: &Surface, n: Vec3, key: u64) -> Spectrum {
        if !self.has_sky() {
            return Spectrum::BLACK;
        }
        let rays = 4 * SKY_RAYS;
        (0..rays).map(|k| self.of_sky(surface, n, k, key)).sum::<Spectrum>() * (1.0 / rays as f32)
    }

    /// Some light with a place or a direction sees a point on the side of `n` (unit).
    pub fn reaches(&self, surface: &Surface, n: Vec3) -> bool {
        self.has_lights && !self.of_lamps(surface, n).is_black()
    }

    /// The irradiance at a point from lamps alone, seen from the side of `n` (unit).
    pub fn of_lamps(&self, surface: &Surface, n: Vec3) -> Spectrum {
        self.lights.irradiance(self.world, surface, n)
    }

    /// Where rays from lamps go first, and on through what is transparent: the light finds what rays from surfaces would miss.
    pub fn landings(&self) -> Vec<(Hit, Surface, Vec3)> {
        /// Rays of all lamps, about, and of one at most; transparent surfaces each goes through.
        const RAYS: u32 = 1 << 18;
        const OF_ONE: u32 = 1 << 14;
        const LAYERS: u32 = 16;
        if !self.has_lights {
            return Vec::new();
        }
        let world = self.world;
        let n = (RAYS / self.lights.n_lamps().max(1)).clamp(1, OF_ONE);
        let follow = |ray: &Ray| {
            let (mut ray, mut met) = (*ray, Vec::new());
            for _ in 0..LAYERS {
                let Some((hit, surface)) = world.closest_visible(&ray) else { break };
                met.push((hit, surface, ray.dir));
                if !world.may_be_transparent(surface.material) {
                    break;
                }
                ray = surface.ray(ray.dir);
            }
            met
        };
        let rays = self.lights.rays(world.accel().bounds(), n, rng::key(&[self.seed, 0x6C61_6E64]));
        rays.par_iter().flat_map_iter(follow).collect()
    }

    /// Some lights are lamps.
    pub fn has_lamps(&self) -> bool {
        self.has_lights
    }

    /// One ray of a cosine-weighted set: `E = π · mean L`.
    fn of_sky(&self, surface: &Surface, n: Vec3, k: u32, key: u64) -> Spectrum {
        let dir = Frame::from_normal(n).to_world(warp::cosine_hemisphere(sequence::point_2d(k, key ^ 0x0073_6B79)));
        let radiance = self.sky_radiance(dir);
        if radiance.is_black() {
            return radiance;
        }
        radiance * self.world.transmittances(&[surface.ray(dir); 8], 1, Passage::STRAIGHT, &mut 0)[0] * std::f32::consts::PI
    }

    /// Radiance from where no surface is.
    pub fn sky_radiance(&self, dir: Vec3) -> Spectrum {
        let sky = self.world.sky().map_or(Spectrum::BLACK, |sky| sky.radiance(dir));
        self.hemispheres.iter().fold(sky, |sum, (axis, up, down)| sum + if axis.dot(dir) >= 0.0 { *up } else { *down })
    }
}
