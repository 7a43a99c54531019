//! One path, from the eye or a sensor on.

use super::PathTracer;
use super::medium::Collision;
use crate::bsdf::{Lobes, Scatter, Scattered, Way};
use crate::emitter::random::Met;
use crate::film::Pixel;
use crate::math::{Ray, Vec2, Vec3};
use crate::sampling::mis::power_heuristic;
use crate::sampling::{Stream, sequence};
use crate::spectrum::Spectrum;
use crate::transport::eye::{self, BEHIND_MAX};
use crate::transport::media::{Media, Medium};
use crate::transport::{Glass, Passage, Shading, Surface, World};

use crate::raytrace::whitted::kept_above;

/// Scatterings after which a path ends whatever it would bring: lossless rooms.
const DEPTH_LIMIT: u32 = 1 << 12;
/// Paths go on with at most this probability,
const MOST: f32 = 0.95;
/// or this from one scattering in a medium to the next, of which light goes through many,
const MOST_BETWEEN: f32 = 0.99;
/// and end only when less of what they bring would be seen than this. Ending the Cornell box's at once where it is below 1 saves a third of the time and doubles
/// the variance: by then a path has cost most of what it will.
const DIM: f32 = 1.0 / 3.0;
/// From this many scatterings on numbers are drawn by chance: evenly spread ones no longer tell, and take a twentieth of the time.
const SPREAD: u32 = 2;

/// A path in the making.
pub(super) struct Walk<'a> {
    pub(super) method: &'a PathTracer,
    pub(super) world: &'a World,
    pub(super) stream: Stream,
    pub(super) n_rays: &'a mut u64,
    /// The bodies it is in.
    pub(super) media: Media,
    /// Those on the other side of the last surface it met, where that bounds a body.
    behind: Media,
    /// Scatterings so far.
    pub(super) depth: u32,
    /// How likely paths from the light are to begin as this one does, over how likely it is to begin so; 0 where they never do (`from_light.rs`).
    pub(super) rivalry: f32,
}

/// A ray, and how it came to be.
pub(super) struct Onward {
    pub(super) ray: Ray,
    /// What drew its direction from a lobe; `None` where light sources cannot have been found in any other way.
    pub(super) last: Option<Last>,
    /// From the eye to its start.
    pub(super) travelled: f32,
    /// What drew its direction mirrors or refracts.
    pub(super) is_thrown: bool,
}

/// A place that drew a direction.
#[derive(Clone, Copy)]
pub(super) struct Last {
    pub(super) p: Vec3,
    /// On the side to which the direction goes; zero in a medium.
    pub(super) n: Vec3,
    /// 1/sr.
    pub(super) pdf: f32,
    /// How often points of emissive surfaces are looked for on that side.
    pub(super) share: f32,
}

/// Light that comes straight from sources.
#[derive(Clone, Copy, Default)]
struct Found {
    reflected: Lobes,
    /// By a rough boundary.
    refracted: Spectrum,
}

impl Found {
    fn sum(self) -> Spectrum {
        self.reflected.sum() + self.refracted
    }
}

/// How a ray ends.
pub(super) enum End {
    Surface(Vertex),
    /// It is scattered between surfaces.
    Medium(Collision),
    /// It leaves the scene.
    Nowhere,
}

/// What there was on the way of a ray.
#[derive(Clone, Copy)]
pub(super) struct Between {
    /// What is left of light from the end.
    pub(super) open: Spectrum,
    /// What media emit,
    pub(super) glow: Spectrum,
    /// and scatter of the light of lamps, as far as places are drawn by where those are.
    pub(super) lit: Spectrum,
}

impl Between {
    pub(super) const NOTHING: Self = Self { open: Spectrum::WHITE, glow: Spectrum::BLACK, lit: Spectrum::BLACK };
}

/// A surface that scatters.
pub(super) struct Vertex {
    pub(super) surface: Surface,
    pub(super) shading: Shading,
    /// Seen from the outside.
    pub(super) entering: bool,
    /// It bounds a body.
    is_boundary: bool,
    pub(super) travelled: f32,
}

impl<'a> Walk<'a> {
    pub(super) fn new(method: &'a PathTracer, world: &'a World, stream: Stream, n_rays: &'a mut u64) -> Self {
        Self { method, world, stream, n_rays, media: method.around_eye, behind: Media::VACUUM, depth: 0, rivalry: 0.0 }
    }

    /// A camera sample.
    pub(super) fn of_camera_ray(mut self, ray: &Ray) -> Pixel {
        let mut pixel = Pixel::default();
        if let Some(eye) = self.method.settings.eye.filter(|eye| self.method.has_bodies && *eye != ray.origin) {
            // Through a lens and in parallel projection rays begin beside the eye.
            *self.n_rays += 1;
            self.media.go(self.world, eye, ray.origin);
        }
        let mut onward = Onward { ray: *ray, last: None, travelled: 0.0, is_thrown: false };
        let begins = onward.ray.origin;
        let mut between = Between::NOTHING;
        let end = self.meet(&mut onward, Spectrum::WHITE, &mut between);
        let Between { open, glow, lit } = between;
        pixel.emission = glow;
        // What lamps give the media on the way counts as scattered once, in the lobe that comes from all around.
        let lit = if self.method.settings.max_depth == Some(0) { Spectrum::BLACK } else { lit };
        (pixel.diffuse, pixel.direct) = (lit, lit);
        let vertex = match &end {
            End::Surface(vertex) => vertex,
            End::Medium(collision) => {
                self.scattered_between(&mut pixel, collision, open);
                return pixel;
            }
            End::Nowhere => {
                let is_first = onward.ray.origin == begins;
                pixel.background = open * eye::behind(self.world, ray.dir, self.method.has_backdrop, is_first);
                pixel.color = pixel.background + pixel.emission + lit;
                return pixel;
            }
        };
        pixel.alpha = 1.0;
        eye::record(&mut pixel, self.world, &vertex.surface, &vertex.shading, vertex.travelled);
        pixel.emission += open * vertex.shading.shown();
        pixel.color = pixel.emission;
        if self.method.settings.max_depth == Some(0) {
            return pixel;
        }
        let scatter = self.scatter_at(vertex);
        let Found { reflected, refracted } = self.next_event(vertex, &scatter);
        (pixel.diffuse, pixel.specular, pixel.refraction) =
            (lit + open * reflected.diffuse, open * reflected.specular, open * refracted);
        pixel.direct = pixel.diffuse + pixel.specular + pixel.refraction;
        let n_branches = self.method.settings.branches.max(1);
        let open = open / n_branches as f32;
        let p_e = self.pixels_at(vertex, &scatter);
        let sides = self.method.has_bodies.then_some((self.media, self.behind));
        for stream in self.stream.branches(n_branches) {
            self.stream = stream;
            self.depth = 0;
            if let Some(sides) = sides {
                (self.media, self.behind) = sides;
            }
            let Some((scattered, onward)) = self.go_on(vertex, &scatter, None) else { continue };
            let weight = Lobes { diffuse: open * scattered.weight.diffuse, specular: open * scattered.weight.specular };
            self.rivalry = self.rivalry_of(vertex, &scattered, p_e);
            let [once, more] = self.arriving(onward, weight.sum() * n_branches as f32);
            self.rivalry = 0.0;
            let all = once + more;
            pixel.diffuse += weight.diffuse * all;
            let lobe = match scattered.way {
                Way::Rough { .. } if goes_through(vertex, &scattered) => &mut pixel.refraction,
                Way::Rough { .. } => &mut pixel.specular,
                Way::Reflected => &mut pixel.reflection,
                Way::Refracted => &mut pixel.refraction,
            };
            *lobe += weight.specular * all;
            pixel.direct += weight.sum() * once;
            pixel.indirect += weight.sum() * more;
        }
        pixel.color += pixel.diffuse + pixel.specular + pixel.reflection + pixel.refraction;
        pixel
    }

    /// The irradiance of a place on the side of `n`, within the bodies around it: π times what a white surface would reflect.
    pub(super) fn irradiance_of(mut self, surface: &Surface, n: Vec3, around: Media) -> Spectrum {
        self.media = around;
        let vertex = Vertex {
            surface: *surface,
            shading: Shading::white(n),
            entering: surface.is_front(n),
            is_boundary: false,
            travelled: 0.0,
        };
        let scatter = self.scatter_at(&vertex);
        let mut light = self.next_event(&vertex, &scatter).sum();
        let n_branches = self.method.settings.branches.max(1);
        for stream in self.stream.branches(n_branches) {
            self.stream = stream;
            (self.media, self.depth) = (around, 0);
            let Some((scattered, onward)) = self.go_on(&vertex, &scatter, None) else { continue };
            let weight = scattered.weight.sum();
            let [once, more] = self.arriving(onward, weight);
            light += weight * (once + more) / n_branches as f32;
        }
        light * std::f32::consts::PI
    }

    /// What a scattered ray brings: straight from a source, and scattered before. `seen` is what of it reaches the eye.
    pub(super) fn arriving(&mut self, mut onward: Onward, seen: Spectrum) -> [Spectrum; 2] {
        let (mut once, mut more) = (Spectrum::BLACK, Spectrum::BLACK);
        let max_depth = self.method.settings.max_depth.unwrap_or(DEPTH_LIMIT).min(DEPTH_LIMIT);
        // What of the light at the end of the path arrives.
        let mut throughput = Spectrum::WHITE;
        for depth in 1..=max_depth {
            let found = if depth == 1 { &mut once } else { &mut more };
            self.depth = depth;
            let mut between = Between::NOTHING;
            let end = self.meet(&mut onward, seen * throughput, &mut between);
            if self.method.has_media {
                *found += throughput * between.glow;
                if depth < max_depth {
                    more += throughput * between.lit;
                }
            }
            throughput = throughput * between.open;
            let found = if depth == 1 { &mut once } else { &mut more };
            let (next, most) = match &end {
                End::Surface(vertex) => {
                    *found += throughput * self.emission(vertex, &onward);
                    if depth == max_depth {
                        break;
                    }
                    let scatter = self.scatter_at(vertex);
                    more += throughput * self.next_event(vertex, &scatter).sum();
                    let Some((scattered, next)) = self.go_on(vertex, &scatter, onward.last) else { break };
                    throughput = throughput * scattered.weight.sum();
                    (next, MOST)
                }
                End::Medium(collision) => {
                    if depth == max_depth {
                        break;
                    }
                    more += throughput * self.next_event_between(collision);
                    (self.go_on_between(collision), MOST_BETWEEN)
                }
                End::Nowhere => {
                    *found += throughput * self.beyond(&onward);
                    break;
                }
            };
            let survival = ((seen * throughput).max_channel() / DIM).min(most);
            if survival.is_nan() || self.stream.next_f32() >= survival {
                break;
            }
            throughput *= 1.0 / survival;
            onward = next;
        }
        [once, more]
    }

    /// Follows a ray to the next surface that is there, through holes, or to where a medium scatters it. `seen` is what of light from its start reaches the eye.
    pub(super) fn meet(&mut self, onward: &mut Onward, seen: Spectrum, between: &mut Between) -> End {
        let world = self.world;
        for _ in 0..BEHIND_MAX {
            *self.n_rays += 1;
            let Some((hit, mut surface)) = world.closest_visible(&onward.ray) else {
                let through = self.media.current().copied();
                let scattered = self.go_through(through.as_ref(), onward, f32::INFINITY, seen, between);
                let end = scattered.map_or(End::Nowhere, End::Medium);
                return end;
            };
            let wo = -onward.ray.dir;
            // Without bodies nothing at the surface tells what the ray came through.
            if self.method.has_media
                && !self.method.has_bodies
                && let Some(collision) = self.go_through(None, onward, hit.t, seen, between)
            {
                return End::Medium(collision);
            }
            let travelled = onward.travelled + hit.t;
            surface.width = self.method.settings.footprint.width(travelled, surface.ng.dot(wo));
            let mut shading = world.shading(&surface, wo);
            let entering = surface.is_front(wo);
            let mut is_boundary = false;
            if self.method.has_bodies {
                let mut surroundings = self.media.ior();
                let mut through = self.media.current().copied();
                let mut is_hidden = false;
                if let Some(t) = shading.bsdf.transmission().filter(|t| !t.thin) {
                    self.behind = self.media;
                    is_boundary = true;
                    let boundary = self.behind.pass(Medium::of(&surface, &t), entering);
                    through = boundary.began_in.or(through);
                    surroundings = boundary.surroundings.unwrap_or(1.0);
                    // In a body of higher priority there is no surface here.
                    is_hidden = boundary.surroundings.is_none();
                }
                if let Some(collision) = self.go_through(through.as_ref(), onward, hit.t, seen, between) {
                    return End::Medium(collision);
                }
                if surroundings != 1.0 && !is_hidden {
                    shading.bsdf = shading.bsdf.within(surroundings);
                }
                let passes = match is_hidden {
                    true => Some(Spectrum::WHITE),
                    // Nor is one where light passes as it came.
                    false if is_boundary && shading.emission.is_black() => shading.bsdf.unbent(),
                    false => None,
                };
                if let Some(tint) = passes {
                    let there = if is_hidden { 0.0 } else { shading.coverage };
                    between.open = between.open * (Spectrum::gray(1.0 - there) + tint * there);
                    self.media = self.behind;
                    onward.travelled = travelled;
                    onward.ray = surface.ray(onward.ray.dir);
                    continue;
                }
                if !entering {
                    shading.bsdf = shading.bsdf.met_from_inside();
                }
            }
            onward.travelled = travelled;
            if self.method.settings.multiple_scattering {
                shading.bsdf = shading.bsdf.compensated();
            }
            if shading.coverage < 1.0 && self.stream.next_f32() >= shading.coverage {
                // A hole in the wall of a body lets into the body.
                if is_boundary {
                    self.media = self.behind;
                }
                onward.ray = surface.ray(onward.ray.dir);
                continue;
            }
            return End::Surface(Vertex { surface, shading, entering, is_boundary, travelled });
        }
        between.open = Spectrum::BLACK;
        End::Nowhere
    }

    /// What a scattered ray sees where no surface is.
    fn beyond(&self, onward: &Onward) -> Spectrum {
        let dir = onward.ray.dir;
        if onward.last.is_none() && self.world.sky().is_none() && self.method.hemispheres.is_empty() {
            // What stands behind the scene is seen in mirrors, but lights nothing.
            return eye::behind(self.world, dir, self.method.has_backdrop, false);
        }
        let weight = match (onward.last, &self.method.sky) {
            (Some(last), Some(sampler)) => power_heuristic(last.pdf, sampler.pdf(dir)),
            _ => 1.0,
        };
        self.world.sky().map_or(Spectrum::BLACK, |sky| sky.radiance(dir)) * weight + self.method.hemispheres(dir)
    }

    /// What a surface emits towards a scattered ray, weighed where it could have been found from the surface before as well.
    fn emission(&self, vertex: &Vertex, onward: &Onward) -> Spectrum {
        let Vertex { surface, shading, .. } = vertex;
        let rival = match &self.method.from_light {
            Some(paths) if self.rivalry > 0.0 && onward.is_thrown && !shading.emission.is_black() => {
                let n = if vertex.entering { surface.ng } else { -surface.ng };
                self.rivalry * paths.density((surface.instance.0, surface.primitive), surface.p, n, -onward.ray.dir)
            }
            _ => 0.0,
        };
        let Some(last) = onward.last else {
            return shading.shown() - shading.emission * (1.0 - left_by(rival));
        };
        if shading.emission.is_black() {
            return Spectrum::BLACK;
        }
        let met = Met {
            instance: surface.instance.0,
            primitive: surface.primitive,
            wi: onward.ray.dir,
            distance: (surface.p - last.p).length(),
            local: surface.local,
        };
        shading.emission * power_heuristic(last.pdf, last.share * self.method.emissive.pdf(last.p, last.n, &met)) * left_by(rival)
    }

    /// Four numbers: of a set that all samples of the pixel share, as long as that still tells.
    pub(super) fn next_4d(&mut self) -> [Vec2; 2] {
        if self.depth < SPREAD {
            let (key, i) = self.stream.next_set(1);
            sequence::point_4d(i, key)
        } else {
            [self.stream.next_2d(), self.stream.next_2d()]
        }
    }

    /// What a surface does with light.
    pub(super) fn scatter_at(&self, vertex: &Vertex) -> Scatter {
        self.scatter_of(&vertex.shading, vertex.entering)
    }

    /// The same of how it is seen.
    pub(super) fn scatter_of(&self, shading: &Shading, entering: bool) -> Scatter {
        let settings = &self.method.settings;
        Scatter::new(shading.bsdf.weighed(settings.fresnel), shading.n, shading.wo, entering, settings.highlights)
    }

    /// Draws where a path goes on from a surface.
    pub(super) fn go_on(&mut self, vertex: &Vertex, scatter: &Scatter, last: Option<Last>) -> Option<(Scattered, Onward)> {
        let Vertex { surface, shading, entering, .. } = vertex;
        let side = if *entering { surface.ng } else { -surface.ng };
        let [u, choice] = self.next_4d();
        let mut scattered = scatter.sample(u, choice.x)?;
        let is_thrown = throws(vertex, scatter, &scattered);
        let last = match scattered.way {
            Way::Rough { pdf } => {
                let share = self.looked_for_behind(vertex, scatter);
                let (side, n, share) =
                    if goes_through(vertex, &scattered) { (-side, -shading.n, share) } else { (side, shading.n, 1.0 - share) };
                if scattered.wi.dot(side) <= 0.0 {
                    return None;
                }
                if vertex.is_boundary && n != shading.n {
                    self.media = self.behind;
                }
                Some(Last { p: surface.p, n, pdf, share })
            }
            Way::Reflected => {
                scattered.wi = kept_above(scattered.wi, side);
                None
            }
            Way::Refracted => {
                if vertex.is_boundary {
                    self.media = self.behind;
                }
                scattered.wi = kept_above(scattered.wi, -side);
                // Light comes straight through a sheet, to be found from the surface before it as well.
                if shading.bsdf.transmission().is_some_and(|t| t.thin) { last } else { None }
            }
        };
        let onward = Onward { ray: surface.ray(scattered.wi), last, travelled: vertex.travelled, is_thrown };
        Some((scattered, onward))
    }

    /// How often points of emissive surfaces are looked for behind a surface: by how much it refracts, but never within a body of rough glass where none are, since
    /// what is outside is not seen straight from there.
    fn looked_for_behind(&self, vertex: &Vertex, scatter: &Scatter) -> f32 {
        let share = scatter.share_through();
        if share <= 0.0 || !vertex.is_boundary || self.method.has_light_in_bodies {
            return share;
        }
        if vertex.entering { 0.0 } else { 1.0 }
    }

    /// Light that comes straight from a source, as far as directions to it are drawn.
    fn next_event(&mut self, vertex: &Vertex, scatter: &Scatter) -> Found {
        let mut light = Found::default();
        let method = self.method;
        let Vertex { surface, shading, .. } = vertex;
        if scatter.is_perfect() {
            return light;
        }
        if method.has_lamps {
            let u = if method.lamps.are_drawn() { self.next_4d()[0] } else { Vec2::ZERO };
            let lamps = method.lamps.at_some(self.world, (surface, shading), (&self.media, u), self.n_rays);
            light.reflected = Lobes { diffuse: lamps.diffuse, specular: lamps.specular };
            if scatter.share_through() > 0.0 {
                let behind = if vertex.is_boundary { &self.behind } else { &self.media };
                light.refracted = method.lamps.refracted(self.world, (surface, shading), (behind, u), self.n_rays);
            }
        }
        if !method.emissive.is_empty() {
            let [u, choice] = self.next_4d();
            // On one side of a rough boundary.
            let share = self.looked_for_behind(vertex, scatter);
            let (n, share) = if choice.y < share { (-shading.n, share) } else { (shading.n, 1.0 - share) };
            if let Some(drawn) = method.emissive.draw(surface.p, n, u, choice.x)
                && drawn.wi.dot(n) > 0.0
            {
                let ray = surface.shadow_ray(drawn.target);
                let world = self.world;
                let radiance = || world.emission_from(drawn.surface, drawn.position);
                let rival = match &method.from_light {
                    Some(paths) if self.rivalry > 0.0 && throws_roughly(vertex, scatter) => {
                        self.rivalry * paths.density_of_drawn(&drawn)
                    }
                    _ => 0.0,
                };
                self.look(vertex, scatter, (drawn.wi, drawn.pdf * share, rival), ray, radiance, &mut light);
            }
        }
        if let (Some(sampler), Some(sky)) = (&method.sky, self.world.sky()) {
            let [u, _] = self.next_4d();
            if let Some((wi, pdf)) = sampler.sample(u) {
                self.look(vertex, scatter, (wi, pdf, 0.0), surface.ray(wi), || sky.radiance(wi), &mut light);
            }
        }
        light
    }

    /// Adds what a direction drawn with a density brings, weighed against its being drawn by the surface, and `rival` times as often from the light.
    fn look(
        &mut self,
        vertex: &Vertex,
        scatter: &Scatter,
        (wi, pdf, rival): (Vec3, f32, f32),
        ray: Ray,
        radiance: impl Fn() -> Spectrum,
        light: &mut Found,
    ) {
        let Vertex { surface, shading, .. } = vertex;
        let (lobes, pdf_of_surface) = scatter.evaluate(wi);
        let goes_through = shading.n.dot(wi) < 0.0;
        let beside = surface.ng.dot(wi) * surface.ng.dot(shading.wo);
        if lobes.sum().is_black() || beside == 0.0 || (beside < 0.0) != goes_through {
            return;
        }
        let media = if goes_through && vertex.is_boundary { &self.behind } else { &self.media };
        let passage = Passage { glass: Glass::Sheets, media, loss: self.method.loss };
        let passed = self.world.transmittance(&ray, passage, self.n_rays);
        if passed.is_black() {
            return;
        }
        let incident = radiance() * passed * (power_heuristic(pdf, pdf_of_surface) * left_by(rival) / pdf);
        if goes_through {
            light.refracted += lobes.specular * incident;
        } else {
            light.reflected += Lobes { diffuse: lobes.diffuse * incident, specular: lobes.specular * incident };
        }
    }
}

/// A direction drawn leaves a surface on the other side than the viewer's.
fn goes_through(vertex: &Vertex, scattered: &Scattered) -> bool {
    vertex.shading.n.dot(scattered.wi) < 0.0
}

/// What paths from the light leave to those from the eye, `1/(1 + r²)`.
fn left_by(rival: f32) -> f32 {
    power_heuristic(1.0, rival)
}

/// Whether light drawn so comes from a body that mirrors or refracts it.
pub(super) fn throws(vertex: &Vertex, scatter: &Scatter, scattered: &Scattered) -> bool {
    match scattered.way {
        Way::Rough { .. } => throws_roughly(vertex, scatter),
        Way::Reflected | Way::Refracted => !is_sheet(vertex),
    }
}

fn throws_roughly(vertex: &Vertex, scatter: &Scatter) -> bool {
    scatter.share_through() > 0.0 && !is_sheet(vertex)
}

fn is_sheet(vertex: &Vertex) -> bool {
    vertex.shading.bsdf.transmission().is_some_and(|t| t.thin)
}
