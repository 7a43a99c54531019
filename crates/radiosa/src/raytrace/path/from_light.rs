//! Paths from the light: what mirrors and bodies of glass throw (caustics), which paths from the eye find by luck, and off lamps without size never. Source: [Veach97], chapters 8 to 10.
//!
//! A ray leaves a source towards what mirrors or refracts ([`Beams`]); if it does so there, the path goes on as one from the eye would, and from every rough surface behind is
//! connected to the eye. With the flux Φ that a path still stands for,
//!
//! ```text
//! L ← Φ f(ωl, ωe) |n·ωl|/|ng·ωl| · p_e w/n        p_e = |ng·ωe| dA_pixels/dA
//! ```
//!
//! is added where the surface is seen; p_e counts pixels a square metre of it. Shading normals count by Veach's correction, since light and importance meet them differently.
//!
//! Paths from the eye can find the same light, where its source has a size, by their last direction or by a point drawn on the source: together they are weighed against paths from the light by the power heuristic. Over the area of the first surface times the solid angles of all
//! directions from there on, a path from the eye (of b that a camera sample sends on) has the density `b p_e Π p_i`. The product of area across a ray and solid angle is the same everywhere along it, at mirrors and,
//! with light and eye outside of bodies, through glass too, so that in the same measure one of n paths from the light has `n e Π |ng·ω_i| Π p′_i/|ng·ω′_i|`. Inner surfaces reflect about alike both ways, `p_i/|ng·ω_i| ≈ p′_i/|ng·ω′_i|`, and their factors are left
//! out; what is left is the rivalry
//!
//! ```text
//! r = n e |ng·ω_1| / (b p_1 p_e)        w = r²/(1 + r²)
//! ```
//!
//! which either side computes from what it has. Any weights that sum to one leave the mean right.

use rayon::prelude::*;

use super::PathTracer;
use super::walk::{Between, End, Onward, Vertex, Walk, throws};
use crate::accel::Shape;
use crate::bsdf::microfacet::MIN_ALPHA;
use crate::bsdf::{Scatter, Scattered, Way};
use crate::emitter::beams::{Beam, Beams, Origin, Target};
use crate::emitter::random::Drawn;
use crate::emitter::{Emitter, EnvironmentShadows};
use crate::math::{Bounds, Vec3};
use crate::sampling::mis::power_heuristic;
use crate::sampling::{Stream, rng, sequence};
use crate::scene::{Light, Material, Model};
use crate::spectrum::Spectrum;
use crate::transport::media::Media;
use crate::transport::{Glass, Passage, Splat, View, World};

/// Paths that the numbers of a batch are dealt out in.
const CHUNK: u32 = 1 << 12;
/// Paths go on with at most this probability.
const MOST: f32 = 0.95;
/// Pixels beside the picture that filters reach.
const MARGIN: f64 = 2.0;

/// What is asked of paths from the light.
#[derive(Clone, Debug, PartialEq)]
pub struct FromLight {
    /// The picture they go to.
    pub view: View,
    /// How many there are in a pass.
    pub n: u32,
}

/// Paths from the light, ready to be sent.
#[derive(Debug)]
pub(super) struct LightPaths {
    beams: Beams,
    view: View,
    n: u32,
}

impl LightPaths {
    /// `None` where nothing mirrors or refracts, the camera has a lens, or nothing shines on it that can be drawn from.
    pub(super) fn new(world: &World, settings: &FromLight, extra_lights: &[Light]) -> Option<Self> {
        let targets = spheres_around(world, throws_light);
        if targets.is_empty() || settings.n == 0 || !settings.view.shows_points_once() {
            return None;
        }
        let origin = world.origin();
        let lights = world.scene().lights.iter().chain(extra_lights);
        let lamps = lights.map(|light| Emitter::prepare(light, origin, EnvironmentShadows::On));
        let beams = Beams::new(world.emissive(), lamps, targets, world.accel().bounds().extent().length())?;
        Some(Self { beams, view: settings.view.clone(), n: settings.n })
    }

    /// `e` of the light that leaves a point of an emissive surface towards `dir`; `n` is the unit normal there on that side.
    pub(super) fn density(&self, surface: (u32, u32), p: Vec3, n: Vec3, dir: Vec3) -> f32 {
        self.beams.density(surface, p, n, dir)
    }

    /// The same of a point that was drawn.
    pub(super) fn density_of_drawn(&self, drawn: &Drawn<'_>) -> f32 {
        let surface = drawn.surface;
        let n = surface.shape.normal_at(drawn.position);
        let n = if n.dot(drawn.wi) > 0.0 { -n } else { n };
        self.beams.density((surface.instance.0, surface.primitive), drawn.position, n, -drawn.wi)
    }
}

impl PathTracer {
    /// One pass of paths from the light.
    pub(super) fn splats_of_pass(&self, world: &World, seed: u64, pass: u32, n_rays: &mut u64) -> Vec<Splat> {
        let Some(paths) = &self.from_light else { return Vec::new() };
        // Another set of numbers than any pixel's.
        let seed = rng::mix(seed ^ u64::from_le_bytes(*b"fromlght"));
        let of_chunk = |chunk: u32| {
            let (mut splats, mut n_rays) = (Vec::new(), 0);
            for i in chunk * CHUNK..((chunk + 1) * CHUNK).min(paths.n) {
                let mut stream = Stream::new(seed, u64::from(pass), u64::from(i));
                let (key, i) = stream.next_set(1);
                let [place, towards] = sequence::point_4d(i, key);
                // (Of many sources 24 bits do not tell.)
                let fine = f64::from(stream.next_f32()) / f64::from(1 << 24);
                let choice = f64::from(sequence::point_2d(i, rng::nth(key, 1)).x) + fine;
                if let Some(beam) = paths.beams.draw(choice, place, towards) {
                    Walk::new(self, world, stream, &mut n_rays).of_beam(paths, &beam, &mut splats);
                }
            }
            (splats, n_rays)
        };
        let chunks: Vec<_> = (0..paths.n.div_ceil(CHUNK)).into_par_iter().map(of_chunk).collect();
        *n_rays += chunks.iter().map(|(_, n)| n).sum::<u64>();
        chunks.into_iter().flat_map(|(splats, _)| splats).collect()
    }
}

impl Walk<'_> {
    /// `p_e` of a surface that the eye sees; 0 where paths from the light do not end.
    pub(super) fn pixels_at(&self, vertex: &Vertex, scatter: &Scatter) -> f32 {
        match &self.method.from_light {
            Some(paths) if scatter.share_through() <= 0.0 => {
                let density = paths.view.sight(vertex.surface.p, MARGIN).map_or(0.0, |sight| sight.density);
                density * vertex.surface.ng.dot(vertex.shading.wo)
            }
            _ => 0.0,
        }
    }

    /// How likely paths from the light are to end as one from the eye begins, over how likely that is, but for the density of their begin: `r/e`.
    pub(super) fn rivalry_of(&self, vertex: &Vertex, scattered: &Scattered, p_e: f32) -> f32 {
        match (&self.method.from_light, scattered.way) {
            (Some(paths), Way::Rough { pdf }) => self.rivalry(paths, vertex.surface.ng.dot(scattered.wi), pdf, p_e),
            _ => 0.0,
        }
    }

    fn rivalry(&self, paths: &LightPaths, cos: f32, pdf: f32, p_e: f32) -> f32 {
        let b = self.method.settings.branches.max(1) as f32;
        let r = paths.n as f32 * cos.abs() / (b * pdf * p_e.abs());
        if r.is_finite() { r } else { 0.0 }
    }

    /// Follows a path from the light, and adds what it shows.
    fn of_beam(mut self, paths: &LightPaths, beam: &Beam<'_>, splats: &mut Vec<Splat>) {
        self.media = Media::VACUUM;
        let is_delta = matches!(beam.from, Origin::Delta { .. });
        let mut onward = Onward { ray: beam.ray, last: None, travelled: 0.0, is_thrown: false };
        let mut flux = Spectrum::WHITE;
        let max_depth = self.method.settings.max_depth.unwrap_or(u32::MAX);
        for depth in 1..=max_depth {
            self.depth = depth;
            let mut between = Between::NOTHING;
            let End::Surface(vertex) = self.meet(&mut onward, Spectrum::WHITE, &mut between) else { return };
            flux = flux * between.open;
            let scatter = self.scatter_at(&vertex);
            if depth > 1 && !scatter.is_perfect() {
                splats.extend(self.shown(paths, &vertex, flux, beam));
            }
            let Some((scattered, next)) = self.go_on(&vertex, &scatter, None) else { return };
            // Light that comes in any other way is found from the eye, that of delta lights through rough faces as well.
            let is_found = !throws(&vertex, &scatter, &scattered) || (is_delta && matches!(scattered.way, Way::Rough { .. }));
            if depth == 1 && is_found {
                return;
            }
            let (n, ng) = (vertex.shading.n, vertex.surface.ng);
            let [from, to] = [vertex.shading.wo, scattered.wi];
            let shading = n.dot(from) * ng.dot(to) / (ng.dot(from) * n.dot(to));
            flux = flux * scattered.weight.sum() * shading.abs();
            let survival = flux.max_channel().min(MOST);
            if survival.is_nan() || self.stream.next_f32() >= survival {
                return;
            }
            flux *= 1.0 / survival;
            onward = next;
        }
    }

    /// What the eye sees of light that arrived at a surface.
    fn shown(&mut self, paths: &LightPaths, vertex: &Vertex, flux: Spectrum, beam: &Beam<'_>) -> Option<Splat> {
        let surface = &vertex.surface;
        let sight = paths.view.sight(surface.p, MARGIN)?;
        let (ng, to_light) = (surface.ng, vertex.shading.wo);
        let (cos_light, cos_eye) = (ng.dot(to_light), ng.dot(sight.to_eye));
        if cos_light * cos_eye <= 0.0 {
            return None;
        }
        // As the eye sees it.
        let settings = &self.method.settings;
        let mut shading = self.world.shading(surface, sight.to_eye);
        if !vertex.entering {
            shading.bsdf = shading.bsdf.met_from_inside();
        }
        if settings.multiple_scattering {
            shading.bsdf = shading.bsdf.compensated();
        }
        let scatter = self.scatter_of(&shading, vertex.entering);
        if scatter.is_perfect() || scatter.share_through() > 0.0 {
            return None;
        }
        let (lobes, pdf) = scatter.evaluate(to_light);
        if lobes.sum().is_black() {
            return None;
        }
        let p_e = sight.density * cos_eye.abs();
        let rivalry = self.rivalry(paths, cos_light, pdf, p_e);
        let (diffuse, specular) = match beam.from {
            Origin::Surface { surface, position, density } => {
                let radiance = self.world.emission_from(surface, position);
                let light = radiance * (power_heuristic(rivalry * density, 1.0) / density);
                (light, light)
            }
            Origin::Delta { diffuse, specular, falloff } => {
                // In place of 1/d², which spreading light has by itself.
                let d = vertex.travelled;
                let by = falloff.map_or(1.0, |falloff| falloff.at(d) * d * d);
                (diffuse * by, specular * by)
            }
        };
        let passage = Passage { glass: Glass::Opaque, media: &self.method.around_eye, loss: self.method.loss };
        let passed = self.world.transmittance(&surface.shadow_ray(sight.from), passage, self.n_rays);
        let factor = flux * passed * (p_e / (cos_light.abs() * paths.n as f32));
        let splat = Splat {
            place: sight.place.map(|v| v as f32),
            diffuse: lobes.diffuse * diffuse * factor,
            specular: lobes.specular * specular * factor,
        };
        let sum = (splat.diffuse + splat.specular).max_channel();
        (sum > 0.0 && sum.is_finite()).then_some(splat)
    }
}

/// The spheres around all that is of such materials, by instance.
pub(super) fn spheres_around(world: &World, is_wanted: impl Fn(&Material) -> bool) -> Vec<Target> {
    let mut targets = Vec::new();
    let (geometry, scene) = (world.accel().geometry(), world.scene());
    for (placed, id) in geometry.placed.iter().zip(0u32..) {
        let is_target = |primitive: u32| is_wanted(world.material(scene.material_of(crate::scene::InstanceId(id), primitive)));
        match &geometry.shapes[placed.shape as usize] {
            Shape::Mesh { positions, triangles } => {
                let corners = || {
                    let of_target = triangles.iter().zip(0u32..).filter(|(_, primitive)| is_target(*primitive));
                    of_target.flat_map(|(triangle, _)| *triangle).map(|i| {
                        let p = positions[i as usize];
                        placed.to_world.map_or(p, |m| m.transform_point3(p))
                    })
                };
                let bounds = Bounds::of(corners());
                if !bounds.is_empty() {
                    let centre = bounds.min + bounds.extent() * 0.5;
                    targets.push(Target { centre, radius: corners().map(|p| (p - centre).length()).fold(0.0, f32::max) });
                }
            }
            Shape::Sphere | Shape::Disc if is_target(0) => {
                let m = placed.to_world.unwrap_or_default();
                let axes = [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis].map(|axis| axis.length_squared());
                let even = axes[0] == axes[1] && axes[1] == axes[2];
                // Of a map that is no similarity the axes bound the longest half axis.
                let radius = if even { axes[0] } else { axes.iter().sum() }.sqrt();
                targets.push(Target { centre: m.translation.into(), radius: radius * (1.0 + 1e-5) });
            }
            _ => {}
        }
    }
    targets
}

/// A surface of it may mirror perfectly, or bounds a body that light passes.
fn throws_light(material: &Material) -> bool {
    let transmits = material.transmits() && material.has_inside();
    match &material.model {
        Model::Phong(m) => transmits || !m.mirror.is_black(),
        Model::CookTorrance(_) => transmits,
        Model::MetallicRoughness(m) => transmits || m.roughness.factor * m.roughness.factor < MIN_ALPHA,
    }
}
