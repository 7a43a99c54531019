//! Light that is not on a surface: what points, spots, suns and skies bring to each element.
//!
//! It enters the system as `E_i += ρ_i H_i`, H_i the visible irradiance averaged over the element: over a few points first, over more where they disagree, as
//! they do at the edge of a shadow, and where rays from lamps land between them.

use std::f32::consts::PI;
use std::sync::OnceLock;

use rayon::prelude::*;

use super::discontinuity::Apex;
use super::gather::Arriving;
use super::medium::Medium;
use super::mesh::{Element, ElementMesh};
use crate::accel::Hit;
use crate::emitter::EnvironmentShadows;
use crate::emitter::sky_sampler::SkySampler;
use crate::math::{DVec3, Frame, Ray, Vec3};
use crate::sampling::{rng, sequence, warp};
use crate::scene::LightKind;
use crate::spectrum::Spectrum;
use crate::transport::{Emitters, LightSettings, Lights, Passage, Surface, World};

/// Points of an element at first, and where they disagree; at first fewer in meshes of more elements than this.
const POINTS: [u32; 2] = [16, 64];
const FEW_POINTS: u32 = 4;
const MANY_ELEMENTS: usize = 1 << 17;

/// Rays to the sky from each element; four times as many from each sensor. Half of them by the cosine, half by the light of an environment map, where there is one.
const SKY_RAYS: u32 = 256;
/// Sets of a sensor's rays whose spread tells their standard error.
const SKY_SETS: usize = 16;

/// The lights of a world that are not surfaces.
#[derive(Debug)]
pub struct DirectLight<'a> {
    world: &'a World,
    lights: Lights,
    has_lights: bool,
    /// Radiance from above and below, with the axis, of each hemispherical light.
    hemispheres: Vec<(Vec3, Spectrum, Spectrum)>,
    /// Of an environment map, made when first asked: many who look at lamps or along rays never do.
    sky: OnceLock<Option<SkySampler>>,
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
            sky: OnceLock::new(),
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
        let at = |k: u32| sequence::point_2d(k, key).to_array().map(f64::from);
        let surface = |k: u32| mesh.surface(self.world, element, at(k));
        // A mean over the area, whatever the shape of the element: Σ w h / Σ w.
        let weight = |k: u32| element.density(at(k));
        let mean = |sum: [f64; 3], weights: f64| sum.map(|s| if weights > 0.0 { s / weights } else { 0.0 });
        let n = element.normal.as_vec3();
        let mut lamps = [0.0f64; 3];
        if self.has_lights {
            let (mut low, mut high) = (f32::INFINITY, 0.0f32);
            let (mut taken, mut weights) = (0, 0.0);
            let first = if mesh.elements().len() > MANY_ELEMENTS { FEW_POINTS } else { POINTS[0] };
            for n_points in [first, POINTS[1]] {
                for k in taken..n_points {
                    let h = self.of_lamps(&surface(k), n);
                    (low, high) = (low.min(h.luminance()), high.max(h.luminance()));
                    weights += weight(k);
                    [h.r, h.g, h.b].into_iter().zip(&mut lamps).for_each(|(h, s)| *s += weight(k) * f64::from(h));
                }
                taken = n_points;
                if high - low <= 0.1 * high && (high > 0.0 || !is_lit) {
                    break;
                }
            }
            lamps = mean(lamps, weights);
        }
        let mut all = lamps;
        if self.has_sky() {
            let (mut sky, mut weights) = ([0.0; 3], 0.0);
            for k in 0..SKY_RAYS {
                let h = self.of_sky(&surface(k), n, k, key);
                weights += weight(k);
                [h.r, h.g, h.b].into_iter().zip(&mut sky).for_each(|(h, s)| *s += weight(k) * f64::from(h));
            }
            mean(sky, weights).into_iter().zip(&mut all).for_each(|(h, s)| *s += h);
        }
        let exposed = element.exposed().max(1e-6);
        (all.map(|s| s / exposed), lamps.map(|s| s / exposed))
    }

    /// The irradiance at a point, seen from the side of `n` (unit); `key` names the sensor.
    pub fn at(&self, surface: &Surface, n: Vec3, key: u64) -> Arriving {
        let lamps = if self.has_lights { self.of_lamps(surface, n) } else { Spectrum::BLACK };
        let skies = self.of_skies(surface, n, key);
        Arriving { irradiance: lamps + skies.irradiance, ..skies }
    }

    /// The part of [`Self::at`] that comes from skies, with the standard error that its rays would have if they were independent.
    pub fn of_skies(&self, surface: &Surface, n: Vec3, key: u64) -> Arriving {
        if !self.has_sky() {
            return Arriving::default();
        }
        let mut sets = [Spectrum::BLACK; SKY_SETS];
        let rays = 4 * SKY_RAYS;
        // (Rays in a row are spread evenly, and are of both ways of drawing them.)
        (0..rays).for_each(|k| sets[k as usize * SKY_SETS / rays as usize] += self.of_sky(surface, n, k, key));
        let sets = sets.map(|sum| sum * (SKY_SETS as f32 / rays as f32));
        let irradiance = sets.into_iter().sum::<Spectrum>() * (1.0 / SKY_SETS as f32);
        let squares: f64 = sets.iter().map(|set| f64::from((*set - irradiance).luminance()).powi(2)).sum();
        Arriving { irradiance, standard_error: (squares / (SKY_SETS * (SKY_SETS - 1)) as f64).sqrt() }
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

    /// One ray, `E = mean of L cos θ/p`: from a cosine-weighted set, `p = cos θ/π`; under an environment map the even ones, and the odd ones are drawn from the map, so
    /// that `p` is the mean of both densities (the balance heuristic [Veach95]).
    fn of_sky(&self, surface: &Surface, n: Vec3, k: u32, key: u64) -> Spectrum {
        let by_cosine = |k: u32| {
            let u = sequence::point_2d(k, key ^ 0x0073_6B79);
            Frame::from_normal(n).to_world(warp::cosine_hemisphere(u))
        };
        let (dir, weight) = match self.sky.get_or_init(|| self.world.sky().and_then(SkySampler::new)) {
            None => (by_cosine(k), PI),
            Some(sky) => {
                let of_map = || sky.sample(sequence::point_2d(k / 2, key ^ 0x006D_6170));
                let Some((dir, of_sky)) = (if k.is_multiple_of(2) {
                    let dir = by_cosine(k / 2);
                    Some((dir, sky.pdf(dir)))
                } else {
                    of_map()
                }) else {
                    return Spectrum::BLACK;
                };
                let cos = n.dot(dir).max(0.0);
                (dir, cos / (0.5 * (cos / PI + of_sky)).max(f32::MIN_POSITIVE))
            }
        };
        if weight <= 0.0 {
            return Spectrum::BLACK;
        }
        let radiance = self.sky_radiance(dir);
        if radiance.is_black() {
            return radiance;
        }
        radiance * self.world.transmittances(&[surface.ray(dir); 8], 1, Passage::STRAIGHT, &mut 0)[0] * weight
    }

    /// Radiance from where no surface is.
    pub fn sky_radiance(&self, dir: Vec3) -> Spectrum {
        let sky = self.world.sky().map_or(Spectrum::BLACK, |sky| sky.radiance(dir));
        self.hemispheres.iter().fold(sky, |sum, (axis, up, down)| sum + if axis.dot(dir) >= 0.0 { *up } else { *down })
    }
}
