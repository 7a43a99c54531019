//! Direct light at a surface from everything that is not traced further: the sum over lights that ray casting, Whitted's method and
//! radiosity's displayed direct part share.

use super::media::{self, Loss, Media};
use super::polygons::{Brought, Care, PolygonLights};
use super::{Glass, Passage, Shading, Surface, World};
use crate::bsdf::Lobes;
use crate::bsdf::fresnel::Weighing;
use crate::emitter::area;
use crate::emitter::environment::Sky;
use crate::emitter::lamps::{Choice, Lamps};
use crate::emitter::polygon::Receiver;
use crate::emitter::random::PointSampler;
use crate::emitter::{EVERYWHERE, Emitter, EnvironmentShadows, Incident};
use crate::math::rounding;
use crate::math::{Bounds, Frame, Ray, Vec2, Vec3};
use crate::radiometry::lambertian_radiance;
use crate::sampling::{Stream, rng, sequence, warp};
use crate::scene::Light;
use crate::spectrum::Spectrum;

/// A highlight that reflects less than this part of the light (1/sr) is not seen beside anything: its shadow ray need not be traced.
const DARK: f32 = 1e-9;

/// Lamps drawn at a place, of either kind, at most.
pub(crate) const DRAWN_MAX: usize = 8;

/// So many lamps and no more are all looked at, where each place counts: a shadow ray each costs less than the noise of drawing.
pub(crate) const FEW_LAMPS: usize = 8;

/// Highlights less rough than this are drawn by their own value,
const BLUNT: f32 = 0.3;
/// of so many lights at most: each of them is asked.
const TOLD_APART: usize = 1024;

/// Random points on emissive surfaces held at once.
const POINTS_AT_ONCE: usize = 32;

/// Whether emissive surfaces light others in the local methods.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Emitters {
    /// They glow but light nothing: the strict local model.
    Ignore,
    /// `n × n` cosine point sources for each connected coplanar emitter.
    Points {
        /// Points a side.
        n: u32,
        /// Most points in all; the weakest emitters lose theirs first.
        max: u32,
    },
}

/// How the lights of a scene are prepared for a local method.
#[derive(Clone, Debug, PartialEq)]
pub struct LightSettings {
    /// Emissive surfaces.
    pub emitters: Emitters,
    /// Whether environments and discrete environments cast shadows.
    pub environment_shadows: EnvironmentShadows,
}

impl Default for LightSettings {
    fn default() -> Self {
        Self { emitters: Emitters::Points { n: 5, max: 4096 }, environment_shadows: EnvironmentShadows::Off }
    }
}

/// From where highlights are seen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Viewer {
    /// From the eye point: `v` changes over the picture.
    #[default]
    Local,
    /// From infinitely far away: `v` is constant, as the classic scan-line renderers had it.
    Infinite,
}

/// The lights of a world, prepared for a local method.
#[derive(Debug)]
pub struct Lights {
    emitters: Vec<Emitter>,
    ambient: Spectrum,
    n_points: usize,
    /// Where there would be more without the limit.
    n_wanted: Option<usize>,
    /// So few shadow rays leave a point that each is traced alone.
    few: bool,
    /// What shadow rays do at transparent things.
    glass: Glass,
    /// What takes their light away between surfaces.
    loss: Loss,
    /// Too many to be looked at one and all, and how many of them are.
    many: Option<(Lamps, u32)>,
    /// Draws points on emissive surfaces, instead of the fixed ones.
    random_points: Option<PointSampler>,
    /// Of those the ones whose diffuse light is known without.
    polygons: Option<PolygonLights>,
    /// Of the medium that lights with a place shine through, 1/m.
    absorption: Spectrum,
}

/// What the lights do at a point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LocalLight {
    /// `I_a k_a` of the global ambient light and of every light's own.
    pub ambient: Spectrum,
    /// Diffusely reflected.
    pub diffuse: Spectrum,
    /// Highlights.
    pub specular: Spectrum,
}

/// What lights a surface.
struct Sources<'a> {
    emitters: &'a [Emitter],
    points: &'a [Option<Incident>],
    side: Side,
}

impl<'a> Sources<'a> {
    fn in_front(emitters: &'a [Emitter]) -> Self {
        Self { emitters, points: &[], side: Side::Front }
    }
}

/// The side of a surface from which it is lit: the viewer's, or the other.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Side {
    Front,
    Behind,
}

impl Lights {
    /// Prepares every light of a world, and `extra` ones beside them.
    pub fn prepare(world: &World, settings: &LightSettings, extra: &[Light]) -> Self {
        Self::with_sky(world, settings, extra, world.sky())
    }

    /// The same without environments and hemispherical lights: for methods that trace rays to the sky.
    pub(crate) fn prepare_without_skies(world: &World, settings: &LightSettings, extra: &[Light]) -> Self {
        let mut lights = Self::with_sky(world, settings, extra, None);
        lights.emitters.retain(|emitter| !matches!(emitter, Emitter::Hemispherical(_)));
        lights
    }

    fn with_sky(world: &World, settings: &LightSettings, extra: &[Light], sky: Option<&Sky>) -> Self {
        let scene = world.scene();
        let lights = || scene.lights.iter().chain(extra);
        let mut emitters: Vec<Emitter> =
            lights().map(|light| Emitter::prepare(light, world.origin(), settings.environment_shadows)).collect();
        emitters.extend(sky.map(|sky| sky.emitter(settings.environment_shadows)));
        let (mut n_points, mut n_wanted) = (0, None);
        if let Emitters::Points { n, max } = settings.emitters {
            let points = area::sample_points(world.emissive(), n, max);
            (n_points, n_wanted) = (points.len(), points.n_wanted);
            emitters.push(Emitter::Area(points));
        }
        let ambient = scene.ambient + emitters.iter().map(Emitter::ambient).sum();
        let few = emitters.iter().map(Emitter::n_directions).sum::<usize>() <= World::FEW_SEGMENTS;
        let glass = Glass::Clear(Weighing::Material);
        Self {
            emitters,
            ambient,
            n_points,
            n_wanted,
            few,
            glass,
            loss: Loss::Absorption,
            many: None,
            random_points: None,
            polygons: None,
            absorption: Spectrum::BLACK,
        }
    }

    /// Light with a place shines through a medium that absorbs this, 1/m.
    pub fn within(mut self, absorption: Spectrum) -> Self {
        self.absorption = absorption;
        self
    }

    /// Shadow rays do this at transparent things.
    pub fn with_glass(mut self, glass: Glass) -> Self {
        self.glass = glass;
        self
    }

    /// This takes light away between surfaces.
    pub(crate) fn with_loss(mut self, loss: Loss) -> Self {
        self.loss = loss;
        self
    }

    /// Of lamps that are more than `few` only `n` of those with a place and `n` of those infinitely far light a place at a time, drawn by what they give ([`Self::at_some`],
    /// [`Self::at_random`]); not more than [`DRAWN_MAX`].
    pub(crate) fn drawing(mut self, n: u32, few: usize) -> Self {
        let n = n.clamp(1, DRAWN_MAX as u32);
        self.many = Lamps::take_from(&mut self.emitters, few).map(|lamps| (lamps, n));
        let n_drawn = self.many.as_ref().map_or(0, |_| 2 * n as usize);
        self.few = self.emitters.iter().map(Emitter::n_directions).sum::<usize>() + n_drawn <= World::FEW_SEGMENTS;
        self
    }

    /// Some lamps are drawn.
    pub(crate) fn are_drawn(&self) -> bool {
        self.many.is_some()
    }

    /// Emissive surfaces light others from random points instead of fixed ones ([`Self::at_random`]), unless they light nothing.
    pub fn with_random_points(mut self, world: &World) -> Self {
        if self.n_points > 0 {
            self.emitters.retain(|emitter| !matches!(emitter, Emitter::Area(_)));
            self.random_points = Some(PointSampler::new(world.emissive()));
            self.few = false;
            self.n_points = 0;
        }
        self
    }

    /// As [`Self::with_random_points`], but the diffuse light of what is large and flat comes in closed form, where its shadows can be cut out.
    pub(crate) fn in_closed_form(self, world: &World, care: Care) -> Self {
        let mut lights = self.with_random_points(world);
        lights.polygons = lights.random_points.as_ref().and_then(|_| PolygonLights::new(world.emissive(), care));
        lights
    }

    /// One polygon in closed form is all that emits.
    pub(crate) fn is_one_polygon(&self) -> bool {
        self.polygons.as_ref().is_some_and(|polygons| polygons.all().len() == 1 && polygons.rest().is_none())
    }

    /// Lights with a place or a direction, about.
    pub(crate) fn n_lamps(&self) -> u32 {
        self.emitters
            .iter()
            .filter(|e| matches!(e, Emitter::Point(_) | Emitter::Spot(_) | Emitter::Distant(_) | Emitter::Discrete(_)))
            .count() as u32
    }

    /// Rays that go where the light of lamps goes, about `n` for each, so that what is lit can be found however narrow the light is: from points in all
    /// directions of their cones, from suns through everything in `bounds`.
    pub(crate) fn rays(&self, bounds: Bounds, n: u32, key: u64) -> Vec<Ray> {
        let mut rays = Vec::new();
        let (centre, radius) = (bounds.centre(), 0.5 * bounds.extent().length());
        let mut through = |to_light: Vec3, n: u32, key: u64| {
            let frame = Frame::from_normal(to_light);
            rays.extend((0..n).map(|i| {
                let at = warp::uniform_disc(sequence::point_2d(i, key)) * radius;
                Ray::new(centre + frame.to_world(Vec3::new(at.x, at.y, radius)), -to_light)
            }));
        };
        for (k, emitter) in self.emitters.iter().enumerate() {
            let key = rng::key(&[key, k as u64]);
            match emitter {
                Emitter::Distant(sun) => through(sun.to_light, n, key),
                Emitter::Discrete(suns) => {
                    let each = n / (suns.incidents.len() as u32).max(1);
                    suns.incidents.iter().enumerate().for_each(|(i, sun)| through(sun.wi, each, rng::mix(key ^ i as u64)));
                }
                _ => {}
            }
        }
        for (k, emitter) in self.emitters.iter().enumerate() {
            let (position, axis, cos) = match emitter {
                Emitter::Point(point) => (point.position, Vec3::Z, -1.0),
                Emitter::Spot(spot) => (spot.point.position, spot.axis, spot.profile.cos_cutoff()),
                _ => continue,
            };
            let (frame, key) = (Frame::from_normal(axis), rng::key(&[key, k as u64]));
            let dir = |i: u32| frame.to_world(warp::uniform_cone(sequence::point_2d(i, key), cos));
            rays.extend((0..n).map(|i| Ray::new(position, dir(i))));
        }
        rays
    }

    /// Point sources the emissive surfaces became.
    pub fn n_points(&self) -> usize {
        self.n_points
    }

    /// Prepared, in the order of the scene.
    pub(super) fn emitters(&self) -> &[Emitter] {
        &self.emitters
    }

    /// `I_a` of the scene and of every light.
    pub(super) fn ambient(&self) -> Spectrum {
        self.ambient
    }

    /// What a person should know about how the lights were prepared.
    pub fn note(&self) -> Option<String> {
        let n = self.n_points;
        (n > 0).then(|| {
            let capped = self.n_wanted.map(|n| format!(" (the limit; {n} were asked for)")).unwrap_or_default();
            format!("emissive surfaces light others as {n} point sources{capped}")
        })
    }

    /// What every light does at a surface in vacuum; `n_rays` grows by the shadow rays traced (none when `shadows` is off).
    pub fn at(&self, world: &World, surface: &Surface, shading: &Shading, shadows: bool, n_rays: &mut u64) -> LocalLight {
        let passage = shadows.then_some(self.passage(&Media::VACUUM));
        self.gather(world, surface, shading, passage, Sources::in_front(&self.emitters), n_rays)
    }

    /// How its shadow rays pass, from within some bodies.
    fn passage<'a>(&self, media: &'a Media) -> Passage<'a> {
        Passage { glass: self.glass, media, loss: self.loss }
    }

    /// What a medium scatters of every light with a place or a direction at `p`, within some bodies: `phase` is its function of the direction to the light, 1/sr.
    pub(crate) fn scattered(
        &self,
        world: &World,
        p: Vec3,
        phase: impl Fn(&Incident) -> f32,
        (media, u): (&Media, Vec2),
        n_rays: &mut u64,
    ) -> Spectrum {
        let mut sum = Spectrum::BLACK;
        let mut scatter = |incident: Incident| {
            let weight = phase(&incident);
            sum += self.passed(world, p, &incident, media, n_rays) * weight;
        };
        self.emitters.iter().for_each(|emitter| emitter.for_each_incident(p, &mut scatter));
        if let Some((lamps, n)) = &self.many {
            Self::drawn(lamps, *n, p, EVERYWHERE, u).into_iter().flatten().for_each(scatter);
        }
        sum
    }

    /// What reaches a point in a medium of a light, within some bodies.
    pub(crate) fn passed(&self, world: &World, p: Vec3, incident: &Incident, media: &Media, n_rays: &mut u64) -> Spectrum {
        let ray = incident.target.map_or(Ray::new(p, incident.wi), |target| super::surface::shadow_ray(p, target));
        incident.diffuse * world.transmittance(&ray, self.passage(media), n_rays)
    }

    /// Lights with a place that are not drawn, and the places.
    pub(crate) fn placed(&self) -> impl Iterator<Item = (Vec3, &Emitter)> {
        self.emitters.iter().filter_map(|emitter| match emitter {
            Emitter::Point(point) => Some((point.position, emitter)),
            Emitter::Spot(spot) => Some((spot.point.position, emitter)),
            _ => None,
        })
    }

    /// As [`Self::at`] within some bodies, of those lamps that `u` draws where they are drawn.
    pub(crate) fn at_some(
        &self,
        world: &World,
        (surface, shading): (&Surface, &Shading),
        (media, u): (&Media, Vec2),
        n_rays: &mut u64,
    ) -> LocalLight {
        self.gather_some(world, (surface, shading), Side::Front, (media, u), n_rays)
    }

    /// What a rough boundary refracts of the lights behind it, within the bodies that are there, of those lamps that `u` draws.
    pub(crate) fn refracted(
        &self,
        world: &World,
        (surface, shading): (&Surface, &Shading),
        (behind, u): (&Media, Vec2),
        n_rays: &mut u64,
    ) -> Spectrum {
        self.gather_some(world, (surface, shading), Side::Behind, (behind, u), n_rays).specular
    }

    fn gather_some(
        &self,
        world: &World,
        (surface, shading): (&Surface, &Shading),
        side: Side,
        (media, u): (&Media, Vec2),
        n_rays: &mut u64,
    ) -> LocalLight {
        let n = if side == Side::Front { shading.n } else { -shading.n };
        let passage = Some(self.passage(media));
        let Some((lamps, k)) = &self.many else {
            let sources = Sources { emitters: &self.emitters, points: &[], side };
            return self.gather(world, surface, shading, passage, sources, n_rays);
        };
        // Which of many lights a sharp highlight shows only its own value tells.
        let is_sharp = side == Side::Behind || (shading.bsdf.has_highlight() && shading.bsdf.roughness() < BLUNT);
        let points = if is_sharp && lamps.len() <= TOLD_APART {
            let mut choices: [Choice; DRAWN_MAX] = std::array::from_fn(|i| Choice::new(stratum(u.x, i, *k)));
            lamps.for_each_incident(surface.p, |incident| {
                let lobes = lobes_of(side, shading, n, incident.wi);
                let weight = f64::from((lobes.diffuse * incident.diffuse + lobes.specular * incident.specular).luminance());
                choices.iter_mut().take(*k as usize).for_each(|choice| choice.offer(incident, weight));
            });
            let mut points = [None; 2 * DRAWN_MAX];
            for (point, choice) in points.iter_mut().zip(choices).take(*k as usize) {
                *point = choice.drawn(f64::from(*k));
            }
            points
        } else {
            Self::drawn(lamps, *k, surface.p, n, u)
        };
        let sources = Sources { emitters: &self.emitters, points: &points, side };
        self.gather(world, surface, shading, passage, sources, n_rays)
    }

    /// `k` lamps with a place and `k` infinitely far, each over how often it is drawn.
    fn drawn(lamps: &Lamps, k: u32, p: Vec3, n: Vec3, u: Vec2) -> [Option<Incident>; 2 * DRAWN_MAX] {
        let share = |incident: Incident| Incident {
            diffuse: incident.diffuse / k as f32,
            specular: incident.specular / k as f32,
            ..incident
        };
        let mut points = [None; 2 * DRAWN_MAX];
        for i in 0..k as usize {
            points[i] = lamps.draw_lamp(p, n, stratum(u.x, i, k)).map(share);
            points[DRAWN_MAX + i] = lamps.draw_sun(n, stratum(u.y, i, k)).map(share);
        }
        points
    }

    /// The irradiance of a surface from the side of `n` (unit), W/m² or lux, with shadows: π times the radiance of a white one.
    pub fn irradiance(&self, world: &World, surface: &Surface, n: Vec3) -> Spectrum {
        self.at(world, surface, &Shading::white(n), true, &mut 0).diffuse * std::f32::consts::PI
    }

    /// As [`Self::at`] within some bodies (`None` without shadows), with `n` points drawn on the emissive surfaces, when
    /// [`Self::with_random_points`] asks for that, and of many lamps those that are drawn.
    pub(crate) fn at_random(
        &self,
        world: &World,
        surface: &Surface,
        shading: &Shading,
        shadows_in: Option<&Media>,
        (n, stream): (u32, &mut Stream),
        n_rays: &mut u64,
    ) -> LocalLight {
        let passage = shadows_in.map(|media| self.passage(media));
        let mut light = self.at_points(world, (surface, shading), passage, (n, stream), n_rays);
        if let Some((lamps, k)) = &self.many {
            let points = Self::drawn(lamps, *k, surface.p, shading.n, stream.next_2d());
            let sources = Sources { emitters: &[], points: &points, side: Side::Front };
            let part = self.gather(world, surface, shading, passage, sources, n_rays);
            light.diffuse += part.diffuse;
            light.specular += part.specular;
        }
        light
    }

    /// The same without lamps that are drawn.
    fn at_points(
        &self,
        world: &World,
        (surface, shading): (&Surface, &Shading),
        passage: Option<Passage<'_>>,
        (n, stream): (u32, &mut Stream),
        n_rays: &mut u64,
    ) -> LocalLight {
        let Some(sampler) = &self.random_points else {
            return self.gather(world, surface, shading, passage, Sources::in_front(&self.emitters), n_rays);
        };
        let set = stream.next_set(n);
        let is_known = |passage: &Passage<'_>| passage.media.current().is_none() && self.absorption.is_black();
        let Some((polygons, passage)) =
            self.polygons.as_ref().zip(passage.filter(is_known)).filter(|_| shading.bsdf.is_diffuse_lambertian())
        else {
            return self.gather_points(world, (surface, shading), passage, &self.emitters, (sampler, n, set), n_rays);
        };
        let mut light = self.gather(world, surface, shading, Some(passage), Sources::in_front(&self.emitters), n_rays);
        let mut by_points = |sampler: &PointSampler, passage| {
            self.gather_points(world, (surface, shading), passage, &[], (sampler, n, set), n_rays)
        };
        if let Some(rest) = polygons.rest() {
            light.diffuse += by_points(rest, Some(passage)).diffuse;
        }
        if shading.bsdf.has_highlight() {
            light.specular += by_points(sampler, Some(passage)).specular;
        }
        let diffuse = shading.bsdf.diffuse_reflectance();
        if diffuse.is_black() {
            return light;
        }
        let side = if surface.ng.dot(shading.n) >= 0.0 { surface.ng } else { -surface.ng };
        let p = rounding::offset_origin(world.shadow_origin(surface, shading.n), surface.p_error, surface.ng, side);
        let receiver = Receiver { p, n: shading.n, side };
        polygons.each(world, &receiver, n, n_rays, |polygon, brought, n_rays| {
            light.diffuse += match brought {
                Brought::Exactly(e) => lambertian_radiance(diffuse, e),
                Brought::Partly { free, points } => {
                    let points = (&polygon.sampler, points, set);
                    let mut reach = |passage| self.gather_points(world, (surface, shading), passage, &[], points, n_rays).diffuse;
                    let some = reach(Some(passage));
                    match free.filter(|_| !some.is_black()) {
                        Some(free) => lambertian_radiance(diffuse, free) * share(some, reach(None)),
                        None => some,
                    }
                }
            };
        });
        light
    }

    /// What some emitters do, and `n` points drawn on emissive surfaces.
    fn gather_points(
        &self,
        world: &World,
        (surface, shading): (&Surface, &Shading),
        passage: Option<Passage<'_>>,
        emitters: &[Emitter],
        (sampler, n, (key, start)): (&PointSampler, u32, (u64, u32)),
        n_rays: &mut u64,
    ) -> LocalLight {
        // A few at a time, so that nothing is allocated.
        let mut light = LocalLight::default();
        let place = sampler.seen_from(surface.p, shading.n);
        let mut points = [None; POINTS_AT_ONCE];
        for first in (0..n).step_by(POINTS_AT_ONCE) {
            let here = (n - first).min(POINTS_AT_ONCE as u32);
            for (i, point) in points.iter_mut().take(here as usize).enumerate() {
                *point = place.incident(start.wrapping_add(first + i as u32), n, key);
            }
            let emitters = if first == 0 { emitters } else { &[] };
            let sources = Sources { emitters, points: &points[..here as usize], side: Side::Front };
            let part = self.gather(world, surface, shading, passage, sources, n_rays);
            light.diffuse += part.diffuse;
            light.specular += part.specular;
            light.ambient = part.ambient;
        }
        light
    }

    /// What some emitters and points do, and the ambient light of all; without shadows where there is no `passage`.
    fn gather(
        &self,
        world: &World,
        surface: &Surface,
        shading: &Shading,
        passage: Option<Passage<'_>>,
        Sources { emitters, points, side }: Sources<'_>,
        n_rays: &mut u64,
    ) -> LocalLight {
        let mut light = LocalLight { ambient: shading.bsdf.ambient() * self.ambient, ..LocalLight::default() };
        if shading.bsdf.is_specular_only() {
            return light;
        }
        let mut batch: Option<Batch> = None;
        // On the side the light comes from.
        let n = if side == Side::Front { shading.n } else { -shading.n };
        let p = if passage.is_some() { world.shadow_origin(surface, n) } else { surface.p };
        // Where shadow rays leave to either side: the same for every light.
        let mut origins: [Option<Vec3>; 2] = [None; 2];
        let mut shadow_ray = |incident: &Incident| {
            let is_above = surface.ng.dot(incident.wi) >= 0.0;
            let side = if is_above { surface.ng } else { -surface.ng };
            let offset = || rounding::offset_origin(p, surface.p_error, surface.ng, side);
            let origin = *origins[usize::from(is_above)].get_or_insert_with(offset);
            incident.target.map_or(Ray::new(origin, incident.wi), |target| super::surface::shadow_ray(origin, target))
        };
        let mut reflect = |incident: Incident, light: &mut LocalLight| {
            if n.dot(incident.wi) <= 0.0 {
                return;
            }
            let lobes = lobes_of(side, shading, n, incident.wi);
            let (mut diffuse, mut specular) = (lobes.diffuse * incident.diffuse, lobes.specular * incident.specular);
            if !self.absorption.is_black() && incident.distance.is_finite() {
                let left = media::transmittance(self.absorption, incident.distance);
                (diffuse, specular) = (diffuse * left, specular * left);
            }
            if diffuse.is_black() && (specular.is_black() || lobes.specular.max_channel() < DARK) {
                return;
            }
            let mut passed = Spectrum::WHITE;
            if let Some(passage) = passage
                && incident.casts_shadow
            {
                let ray = shadow_ray(&incident);
                if !self.few {
                    let batch = batch.get_or_insert_with(|| Batch::new(passage));
                    batch.push(ray, diffuse, specular);
                    if batch.n == 8 {
                        batch.flush(world, light, n_rays);
                    }
                    return;
                }
                passed = world.transmittance(&ray, passage, n_rays);
            }
            light.diffuse += diffuse * passed;
            light.specular += specular * passed;
        };
        for emitter in emitters {
            if let Emitter::Point(point) = emitter {
                if let Some(incident) = point.incident(surface.p) {
                    reflect(incident, &mut light);
                }
                continue;
            }
            // Light from everywhere at once: the diffuse lobe under its irradiance, no highlight.
            if side == Side::Front {
                light.diffuse += lambertian_radiance(shading.bsdf.diffuse_reflectance(), emitter.irradiance(shading.n));
            }
            emitter.for_each_incident(surface.p, &mut |incident| reflect(incident, &mut light));
        }
        for incident in points.iter().copied().flatten() {
            reflect(incident, &mut light);
        }
        if let Some(mut batch) = batch {
            batch.flush(world, &mut light, n_rays);
        }
        light
    }
}

/// Number `i` of `n` that one uniform number becomes, one in each of as many equal parts.
fn stratum(u: f32, i: usize, n: u32) -> f64 {
    (i as f64 + f64::from(u)) / f64::from(n)
}

/// What a surface makes of light from `wi`, on one side of it or from behind; `n` is on the side of the light.
fn lobes_of(side: Side, shading: &Shading, n: Vec3, wi: Vec3) -> Lobes {
    match side {
        _ if n.dot(wi) <= 0.0 => Lobes::BLACK,
        Side::Front => shading.bsdf.evaluate_cos(shading.n, shading.wo, wi),
        Side::Behind => Lobes { specular: shading.bsdf.refract_cos(shading.n, shading.wo, wi), ..Lobes::BLACK },
    }
}

/// By channel, what `some` is of `all`.
fn share(some: Spectrum, all: Spectrum) -> Spectrum {
    let of = |some: f32, all: f32| if all > 0.0 { some / all } else { 0.0 };
    Spectrum::new(of(some.r, all.r), of(some.g, all.g), of(some.b, all.b))
}

/// Shadow rays of one point, asked eight at a time: towards an emitter's points they keep together, which packets like.
struct Batch<'a> {
    rays: [Ray; 8],
    light: [(Spectrum, Spectrum); 8],
    n: usize,
    /// How they pass what is transparent.
    passage: Passage<'a>,
}

impl<'a> Batch<'a> {
    fn new(passage: Passage<'a>) -> Self {
        Self { rays: [Ray::new(Vec3::ZERO, Vec3::Y); 8], light: [Default::default(); 8], n: 0, passage }
    }

    fn push(&mut self, ray: Ray, diffuse: Spectrum, specular: Spectrum) {
        self.rays[self.n] = ray;
        self.light[self.n] = (diffuse, specular);
        self.n += 1;
    }

    /// Adds what arrives of the collected light, in the order it was collected.
    fn flush(&mut self, world: &World, sum: &mut LocalLight, n_rays: &mut u64) {
        let passed = world.transmittances(&self.rays, self.n, self.passage, n_rays);
        for ((diffuse, specular), passed) in self.light.iter().zip(passed).take(self.n) {
            sum.diffuse += *diffuse * passed;
            sum.specular += *specular * passed;
        }
        self.n = 0;
    }
}
