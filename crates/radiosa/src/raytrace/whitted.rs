//! Recursive ray tracing after [Whitted80]: the local model, shadow rays, and what perfect mirrors and glass bring.
//!
//! ```text
//! I = L_e + I_a k_a + Σ_lights V I f (k_d (n·l) + k_s lobe) + k_r I_r + k_t I_t
//! ```
//!
//! `I_r` and `I_t` are what the reflected ray and the ray refracted by Snell's law see, by the same formula. A ray ends where it leaves the
//! scene, where it meets a light (an emissive surface shows its emission and its local light), at [`Settings::max_depth`], or when less than
//! [`Settings::min_weight`] of what it brings would reach the picture. Inside a body light is absorbed by Beer's law; where bodies overlap the
//! one of higher priority counts (`transport::media`). Nothing is interreflected diffusely.
//!
//! Rough mirrors (Cook–Torrance, rough metallic–roughness) are not in the paper of 1980. Their reflected ray is drawn from the lobe, as in
//! [Cook84]: one, or [`Settings::samples`] at what the eye sees. Light sources it meets are left out where the highlight shows them already.

use crate::bsdf::{Bsdf, SpecularRays};
use crate::emitter::EnvironmentShadows;
use crate::film::Pixel;
use crate::math::{Ray, Vec3};
use crate::radiometry::lambertian_radiance;
use crate::sampling::{Stream, sequence};
use crate::scene::Light;
use crate::spectrum::Spectrum;
use crate::transport::eye::{self, BEHIND_MAX, NEGLIGIBLE};
use crate::transport::media::{self, Media, Medium};
use crate::transport::{
    Care, Emitters, Footprint, Glass, Integrator, LightSettings, Lights, LocalLight, Shading, Surface, Viewer, World,
    default_light,
};

/// The deepest recursion there is, whatever is asked for: the machine's stack is finite.
pub const DEPTH_LIMIT: u32 = 64;
/// Surfaces one camera sample meets at most: constants `k_r = k_t = 1` would otherwise double the rays at every depth.
const MAX_SURFACES: u32 = 1 << 15;

pub use crate::bsdf::fresnel::Weighing as Fresnel;

/// What recursive ray tracing can be asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Shadow rays.
    pub shadows: bool,
    /// Light passes transparent things on its way from a lamp, straight and filtered; otherwise they cast full shadows, as in 1980.
    pub transparent_shadows: bool,
    /// Reflections and refractions in a row, at most [`DEPTH_LIMIT`]; 0 is ray casting without transparency.
    pub max_depth: u32,
    /// A ray of which less than this would reach the picture is not traced. With 1/1024 an 8-bit picture hardly changes (`tests/whitted.rs`).
    pub min_weight: f32,
    /// How constants are weighed.
    pub fresnel: Fresnel,
    /// Rays of each rough reflection and random points on emissive surfaces, where the eye's ray hits; beyond, one of each. 0 or 1 is
    /// the classic method: emissive surfaces as fixed points, one ray for each rough lobe.
    pub samples: u32,
    /// How lights are prepared.
    pub lights: LightSettings,
    /// Where highlights are seen from.
    pub viewer: Viewer,
    /// Lights beside the scene's own, as for ray casting.
    pub extra_lights: Vec<Light>,
    /// How wide a pixel is, as for ray casting; it goes on growing behind mirrors and glass as if they were flat.
    pub footprint: Footprint,
    /// The eye point, world coordinates ([`View::eye`](crate::transport::View::eye)): rays begin in the closed bodies around it. Without it they
    /// begin in vacuum, and one from inside a body is taken to be in it from the surface on where it leaves it.
    pub eye: Option<Vec3>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            shadows: true,
            transparent_shadows: true,
            max_depth: 12,
            min_weight: 1.0 / 1024.0,
            fresnel: Fresnel::Material,
            samples: 0,
            lights: LightSettings::default(),
            viewer: Viewer::Local,
            extra_lights: Vec::new(),
            footprint: Footprint::default(),
            eye: None,
        }
    }
}

/// Diffuse light beside what lamps and emissive surfaces bring straight, for methods that know it.
pub(crate) trait Indirect {
    /// The irradiance it brings to a surface, W/m² or lux; `n_rays` grows by the rays that took.
    fn irradiance(&self, at: &Asked<'_>, stream: &mut Stream, n_rays: &mut u64) -> Spectrum;

    /// False when only the questions matter and no picture comes of it.
    fn wants_light(&self) -> bool {
        true
    }
}

/// Where indirect light is asked for.
pub(crate) struct Asked<'a> {
    pub(crate) surface: &'a Surface,
    /// The side that is seen, shading normal.
    pub(crate) n: Vec3,
    /// Reflections and refractions between it and the eye.
    pub(crate) depth: u32,
    /// Between the geometric normal and the direction it is seen from.
    pub(crate) cos: f32,
}

/// Recursive ray tracing, ready to be asked.
#[derive(Debug)]
pub struct Whitted {
    settings: Settings,
    lights: Lights,
    /// The lights hold what the sky brings.
    sky_is_light: bool,
    /// Unit, to an infinitely distant viewer.
    to_viewer: Vec3,
    has_backdrop: bool,
    /// Something transparent has an inside.
    has_bodies: bool,
    /// The bodies the eye is in.
    around_eye: Media,
}

impl Whitted {
    /// Prepares the lights of a world. `forward` is the direction the camera looks in, for viewers at infinity.
    pub fn new(world: &World, settings: &Settings, forward: Vec3) -> Self {
        let glass = if settings.transparent_shadows { Glass::Clear(settings.fresnel) } else { Glass::Opaque };
        let mut lights = Lights::prepare(world, &settings.lights, &settings.extra_lights).with_glass(glass);
        if settings.samples > 1 {
            lights = lights.with_random_points(world);
        }
        let sky_is_light = settings.lights.environment_shadows == EnvironmentShadows::On && world.sky().is_some();
        Self::with_lights(world, settings, forward, lights, sky_is_light)
    }

    /// For a method that knows indirect light and the light of skies: emissive surfaces by random points, no ambient light.
    pub(crate) fn with_indirect(world: &World, settings: &Settings, forward: Vec3) -> Self {
        let glass = if settings.transparent_shadows { Glass::Clear(settings.fresnel) } else { Glass::Opaque };
        let lights = Lights::prepare_without_skies(world, &settings.lights, &settings.extra_lights);
        Self::with_lights(world, settings, forward, lights.with_glass(glass).in_closed_form(world, Care::OfPictures), false)
    }

    fn with_lights(world: &World, settings: &Settings, forward: Vec3, lights: Lights, sky_is_light: bool) -> Self {
        let settings = Settings {
            max_depth: settings.max_depth.min(DEPTH_LIMIT),
            min_weight: settings.min_weight.max(0.0),
            samples: settings.samples.clamp(1, 4096),
            ..settings.clone()
        };
        let has_backdrop = default_light::has_backdrop(world, &settings.extra_lights);
        let has_bodies = world.scene().materials.iter().any(|m| m.transmits() && m.has_inside());
        let around_eye = settings.eye.filter(|_| has_bodies).map_or(Media::VACUUM, |eye| Media::around(world, eye));
        Self { settings, lights, sky_is_light, to_viewer: -forward, has_backdrop, has_bodies, around_eye }
    }

    /// One camera sample, with diffuse light that `indirect` knows.
    pub(crate) fn trace(
        &self,
        world: &World,
        ray: &Ray,
        stream: &mut Stream,
        n_rays: &mut u64,
        indirect: Option<&dyn Indirect>,
    ) -> Pixel {
        let mut pixel = Pixel::default();
        let mut media = self.around_eye;
        // Through a lens and in parallel projection rays begin beside the eye.
        if let Some(eye) = self.settings.eye.filter(|eye| self.has_bodies && *eye != ray.origin) {
            *n_rays += 1;
            media.go(world, eye, ray.origin);
        }
        let mut tracer = Tracer { method: self, world, stream, n_rays, n_surfaces: 0, indirect };
        let left = tracer.follow(ray, &media, Reach::of_the_eye(), &mut pixel);
        pixel.alpha = 1.0 - left;
        pixel
    }

    /// The prepared lights.
    pub fn lights(&self) -> &Lights {
        &self.lights
    }
}

impl Integrator for Whitted {
    fn sample(&self, world: &World, ray: &Ray, stream: &mut Stream, n_rays: &mut u64) -> Pixel {
        self.trace(world, ray, stream, n_rays, None)
    }

    fn branching(&self) -> u32 {
        self.settings.samples
    }
}

/// What a ray brings, by how often the light was scattered before the ray picks it up.
#[derive(Clone, Copy, Debug, Default)]
struct Arriving {
    /// Straight from a source: emission and background.
    straight: Spectrum,
    /// Scattered once.
    once: Spectrum,
    /// Scattered more than once, and ambient light, which stands for that.
    more: Spectrum,
}

impl Arriving {
    fn sum(self) -> Spectrum {
        self.straight + self.once + self.more
    }

    fn add(&mut self, weight: Spectrum, other: Self) {
        self.straight += weight * other.straight;
        self.once += weight * other.once;
        self.more += weight * other.more;
    }
}

/// The light that leaves a surface towards the ray.
struct Leaving {
    local: LocalLight,
    /// The part of the local diffuse light that other surfaces reflected before.
    indirect: Spectrum,
    emission: Spectrum,
    reflected: Arriving,
    refracted: Arriving,
}

/// Where what a ray meets goes to: the layers of a pixel, or the three sums of a secondary ray.
trait Sink {
    fn meet(&mut self, world: &World, surface: &Surface, shading: &Shading, distance: f32);
    fn surface(&mut self, weight: Spectrum, light: &Leaving);
    fn background(&mut self, light: Spectrum);
}

impl Sink for Pixel {
    fn meet(&mut self, world: &World, surface: &Surface, shading: &Shading, distance: f32) {
        eye::record(self, world, surface, shading, distance);
    }

    fn surface(&mut self, weight: Spectrum, light: &Leaving) {
        let (ambient, diffuse, specular) =
            (weight * light.local.ambient, weight * light.local.diffuse, weight * light.local.specular);
        let (reflection, refraction) = (weight * light.reflected.sum(), weight * light.refracted.sum());
        let emission = weight * light.emission;
        self.ambient += ambient;
        self.diffuse += diffuse;
        self.specular += specular;
        self.reflection += reflection;
        self.refraction += refraction;
        self.emission += emission;
        let indirect = weight * light.indirect;
        self.direct += (diffuse - indirect) + specular + weight * (light.reflected.straight + light.refracted.straight);
        let twice = |a: &Arriving| a.once + a.more;
        self.indirect += ambient + indirect + weight * (twice(&light.reflected) + twice(&light.refracted));
        self.color += ambient + diffuse + specular + reflection + refraction + emission;
    }

    fn background(&mut self, light: Spectrum) {
        self.background += light;
        self.color += light;
    }
}

impl Sink for Arriving {
    fn meet(&mut self, _: &World, _: &Surface, _: &Shading, _: f32) {}

    fn surface(&mut self, weight: Spectrum, light: &Leaving) {
        self.straight += weight * light.emission;
        let local = (light.local.diffuse - light.indirect) + light.local.specular;
        self.once += weight * (local + light.reflected.straight + light.refracted.straight);
        let twice = |a: &Arriving| a.once + a.more;
        self.more += weight * (light.local.ambient + light.indirect + twice(&light.reflected) + twice(&light.refracted));
    }

    fn background(&mut self, light: Spectrum) {
        self.straight += light;
    }
}

/// How far a ray has come.
#[derive(Clone, Copy, Debug)]
struct Reach {
    /// Reflections and refractions behind it.
    depth: u32,
    /// The largest part of what it brings that can reach the picture.
    weight: f32,
    /// Above 0 it samples a lobe of that roughness, whose highlight shows the light sources already.
    roughness: f32,
    /// Its way from the eye to where it starts.
    travelled: f32,
}

impl Reach {
    const fn of_the_eye() -> Self {
        Self { depth: 0, weight: 1.0, roughness: 0.0, travelled: 0.0 }
    }
}

struct Tracer<'a> {
    method: &'a Whitted,
    world: &'a World,
    stream: &'a mut Stream,
    n_rays: &'a mut u64,
    n_surfaces: u32,
    indirect: Option<&'a dyn Indirect>,
}

impl Tracer<'_> {
    /// Follows a ray to what it meets, through holes; gives `sink` what arrives and returns how much of the ray leaves the scene.
    fn follow(&mut self, ray: &Ray, media_at_start: &Media, reach: Reach, sink: &mut impl Sink) -> f32 {
        let world = self.world;
        let mut ray = *ray;
        // A list of bodies is copied only where the ray goes on into another.
        let (mut media, mut media_behind);
        media = media_at_start;
        let mut distance = 0.0;
        // What still comes through, and the part of it that absorption did not decide.
        let mut open = Spectrum::WHITE;
        let mut uncovered = 1.0;
        for layer in 0..BEHIND_MAX {
            *self.n_rays += 1;
            let Some((hit, mut surface)) = world.closest_visible(&ray) else {
                open = open * media::transmittance_of(media.current(), f32::INFINITY);
                sink.background(open * self.behind(ray.dir, reach, layer == 0));
                return uncovered;
            };
            self.n_surfaces += 1;
            distance += hit.t;
            let wo = -ray.dir;
            let travelled = reach.travelled + distance;
            surface.width = self.method.settings.footprint.width(travelled, surface.ng.dot(wo));
            let mut shading = world.shading(&surface, wo);
            let transmission = shading.bsdf.transmission();
            let entering = surface.is_front(wo);
            let mut surroundings = media.ior();
            let mut other_side;
            let mut behind = media;
            let mut through = media.current().copied();
            if let Some(t) = transmission.filter(|t| !t.thin) {
                other_side = *media;
                let boundary = other_side.pass(Medium::of(&surface, &t), entering);
                through = boundary.began_in.or(through);
                open = open * media::transmittance_of(through.as_ref(), hit.t);
                let Some(ior) = boundary.surroundings else {
                    // Hidden in a body of higher priority: there is no surface here.
                    media_behind = other_side;
                    media = &media_behind;
                    ray = surface.ray(ray.dir);
                    continue;
                };
                (surroundings, behind) = (ior, &other_side);
            } else {
                open = open * media::transmittance_of(through.as_ref(), hit.t);
            }
            sink.meet(world, &surface, &shading, distance);
            let weight = open * shading.coverage;
            if shading.coverage > 0.0 {
                if surroundings != 1.0 {
                    shading.bsdf = shading.bsdf.within(surroundings);
                }
                let light = self.leaving(
                    &surface,
                    &mut shading,
                    entering,
                    (media, behind),
                    Reach { travelled, ..reach },
                    weight.max_channel(),
                );
                sink.surface(weight, &light);
            }
            uncovered *= 1.0 - shading.coverage;
            open *= 1.0 - shading.coverage;
            if open.max_channel() * reach.weight < NEGLIGIBLE || self.n_surfaces >= MAX_SURFACES {
                return uncovered * f32::from(u8::from(uncovered >= NEGLIGIBLE));
            }
            // A hole in the wall of a body lets into the body.
            media_behind = *behind;
            media = &media_behind;
            ray = surface.ray(ray.dir);
        }
        0.0
    }

    /// What a ray that leaves the scene sees.
    fn behind(&self, dir: Vec3, reach: Reach, first: bool) -> Spectrum {
        let from_eye = reach.depth == 0 && first;
        if reach.roughness > 0.0 && self.method.sky_is_light {
            return Spectrum::BLACK;
        }
        eye::behind(self.world, dir, self.method.has_backdrop, from_eye)
    }

    /// The light that leaves a surface towards `shading.wo`. `weight` is what of it the ray brings on, and `media` are this side and the other.
    fn leaving(
        &mut self,
        surface: &Surface,
        shading: &mut Shading,
        entering: bool,
        media: (&Media, &Media),
        reach: Reach,
        weight: f32,
    ) -> Leaving {
        let settings = &self.method.settings;
        let wo = shading.wo;
        if reach.roughness > 0.0 {
            shading.bsdf = shading.bsdf.at_least_as_rough(reach.roughness);
        }
        if !entering {
            shading.bsdf = shading.bsdf.smooth_from_inside();
        }
        if settings.viewer == Viewer::Infinite {
            shading.wo = self.method.to_viewer;
        }
        let n_points = if reach.depth == 0 { settings.samples } else { 1 };
        let random = (n_points, &mut *self.stream);
        let (lights, in_media) = (&self.method.lights, settings.shadows.then_some(media.0));
        let mut indirect = Spectrum::BLACK;
        let local = match self.indirect {
            None => lights.at_random(self.world, surface, shading, in_media, random, self.n_rays),
            Some(source) => {
                let mut local = LocalLight::default();
                if source.wants_light() {
                    local = lights.at_random(self.world, surface, shading, in_media, random, self.n_rays);
                    local.ambient = Spectrum::BLACK;
                }
                let diffuse = shading.bsdf.diffuse_reflectance();
                if !diffuse.is_black() {
                    let asked = Asked { surface, n: shading.n, depth: reach.depth, cos: surface.ng.dot(wo) };
                    indirect = lambertian_radiance(diffuse, source.irradiance(&asked, self.stream, self.n_rays));
                    local.diffuse += indirect;
                }
                local
            }
        };
        let shown = shading.bsdf.unlit().unwrap_or(Spectrum::BLACK);
        let is_counted = reach.roughness > 0.0 && settings.lights.emitters != Emitters::Ignore;
        let emission = if is_counted { shown } else { shading.emission + shown };
        let mut light = Leaving { local, indirect, emission, reflected: Arriving::default(), refracted: Arriving::default() };
        if !shading.emission.is_black() || reach.depth >= settings.max_depth {
            return light;
        }
        let here = Reach { weight: reach.weight * weight, ..reach };
        let reweighed;
        let bsdf = match settings.fresnel {
            Fresnel::Material => &shading.bsdf,
            Fresnel::On | Fresnel::Off => {
                reweighed = shading.bsdf.weighed(settings.fresnel);
                &reweighed
            }
        };
        let rays = bsdf.specular_rays(shading.n, wo, entering);
        let ng = if entering { surface.ng } else { -surface.ng };
        self.perfect(surface, ng, &rays, media, here, &mut light);
        self.gloss(surface, ng, (bsdf, shading.n, wo), media.0, here, &mut light);
        light
    }

    fn perfect(
        &mut self,
        surface: &Surface,
        ng: Vec3,
        rays: &SpecularRays,
        (this_side, other_side): (&Media, &Media),
        reach: Reach,
        light: &mut Leaving,
    ) {
        if let Some((dir, k_r)) = rays.reflected {
            light.reflected.add(k_r, self.beyond(surface, kept_above(dir, ng), this_side, reach, k_r, 0.0));
        }
        if let Some((dir, k_t)) = rays.refracted {
            // Where shadow rays pass transparent things, too, the highlight shows the light sources behind them already.
            let settings = &self.method.settings;
            let roughness = if settings.shadows && !settings.transparent_shadows { 0.0 } else { reach.roughness };
            light.refracted.add(k_t, self.beyond(surface, kept_above(dir, -ng), other_side, reach, k_t, roughness));
        }
    }

    /// What a rough lobe reflects, from directions drawn from it.
    fn gloss(
        &mut self,
        surface: &Surface,
        ng: Vec3,
        (bsdf, n, wo): (&Bsdf, Vec3, Vec3),
        media: &Media,
        reach: Reach,
        light: &mut Leaving,
    ) {
        if !bsdf.is_glossy() {
            return;
        }
        let n_samples = if reach.depth == 0 { self.method.settings.samples } else { 1 };
        let (key, start) = self.stream.next_set(n_samples);
        for i in 0..n_samples {
            let u = sequence::point_2d(start.wrapping_add(i), key);
            let Some((dir, weight)) = bsdf.sample_gloss(n, wo, u) else { continue };
            if dir.dot(ng) <= 0.0 {
                continue;
            }
            let arriving = self.beyond(surface, dir, media, reach, weight, bsdf.roughness());
            light.reflected.add(weight / n_samples as f32, arriving);
        }
    }

    /// What the next ray brings; nothing when too little of it would be seen.
    fn beyond(
        &mut self,
        surface: &Surface,
        dir: Vec3,
        media: &Media,
        reach: Reach,
        weight: Spectrum,
        roughness: f32,
    ) -> Arriving {
        let mut arriving = Arriving::default();
        let weight = reach.weight * weight.max_channel();
        // Not `<`: what is no number ends here, too.
        if weight > 0.0 && weight >= self.method.settings.min_weight && self.n_surfaces < MAX_SURFACES {
            let reach = Reach { depth: reach.depth + 1, weight, roughness, travelled: reach.travelled };
            self.follow(&surface.ray(dir), media, reach, &mut arriving);
        }
        arriving
    }
}

/// A direction that a shading normal sent through its own surface, brought back to just above it; `ng` is unit.
pub(super) fn kept_above(dir: Vec3, ng: Vec3) -> Vec3 {
    const JUST_ABOVE: f32 = 1e-3;
    let height = dir.dot(ng);
    if height > 0.0 { dir } else { (dir + ng * (JUST_ABOVE - height)).normalize() }
}
