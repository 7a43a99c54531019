//! What happens to a path between surfaces: a homogeneous medium takes light away, emits it and scatters it.
//!
//! ```text
//! L(x, ω) = T(d) L(x_d, ω) + ∫₀^d T(t) [σ_s ∫ p(ω, ω′) L(x_t, ω′) dω′ + ε] dt,      T(t) = exp(−σ_t t)
//! ```
//!
//! How far a ray goes before it is scattered is drawn by the extinction of one channel, chosen by how much of its light would be seen, with the density
//! `p(t) = Σ_c P_c σ_t,c T_c(t)` of all channels together (one sample of the balance heuristic [Wilkie14]): a weight `σ_s T/p` is then no more than the albedo over the
//! shares, however different the channels are. What the medium emits up to the next surface is known without that, `ε (1 − T(d))/σ_t`.
//!
//! From where it is scattered, light is looked for as from surfaces, by next-event estimation and along the direction that the phase function draws, weighed by the
//! power heuristic. Lamps with a place are also looked at from places of each way that are drawn by where they are: that is where thin fog shows them, and no path comes too
//! near to them by chance.

use std::f32::consts::FRAC_PI_2;

use super::walk::{Between, Last, Onward, Walk};
use crate::bsdf::phase::Phase;
use crate::emitter::{EVERYWHERE, Incident};
use crate::film::Pixel;
use crate::math::{Ray, Vec2, Vec3, function};
use crate::sampling::mis::power_heuristic;
use crate::scene;
use crate::spectrum::Spectrum;
use crate::transport::media::{self, Medium};
use crate::transport::{Glass, Passage, Surface};

/// Where a medium scatters light.
#[derive(Clone, Copy, Debug)]
pub(super) struct Collision {
    p: Vec3,
    /// Unit, to where the path came from.
    wo: Vec3,
    phase: Phase,
    /// From the eye.
    travelled: f32,
    /// The way on which it was drawn, and its density there, 1/m.
    segment: Segment,
    density: f32,
}

/// A way through a medium.
#[derive(Clone, Copy, Debug)]
struct Segment {
    origin: Vec3,
    /// Unit.
    dir: Vec3,
    /// Metres.
    length: f32,
    sigma_t: Spectrum,
    /// How often each channel draws a distance.
    shares: Spectrum,
}

impl Segment {
    /// What is left of light after so many metres, and the probability of all channels together of going so far; times that of ending there, 1/m.
    fn at(&self, metres: f32) -> (Spectrum, f32, f32) {
        let left = media::transmittance(self.sigma_t, metres);
        let sum = |s: Spectrum| s.to_array().iter().sum::<f32>();
        (left, sum(self.shares * left), sum(self.shares * self.sigma_t * left))
    }

    /// How a lamp sees it; `None` where so much is between that places drawn by where the lamp is would not tell.
    fn seen_by(&self, lamp: Vec3) -> Option<FromLamp> {
        let to_lamp = lamp - self.origin;
        let nearest = to_lamp.dot(self.dir);
        let height = (to_lamp - self.dir * nearest).length().max(LEAST_HEIGHT);
        let way = nearest.clamp(0.0, self.length) + height.hypot(nearest - nearest.clamp(0.0, self.length));
        if self.sigma_t.max_channel() * way > MOST_BETWEEN_LAMPS {
            return None;
        }
        let angle = |t: f32| function::atan2(t, height);
        let from = angle(-nearest);
        let to = if self.length.is_finite() { angle(self.length - nearest) } else { FRAC_PI_2 };
        (to > from).then_some(FromLamp { nearest, height, from, to })
    }
}

/// A lamp and a way through a medium: places on it drawn uniformly by the angle under which the lamp sees them, with the density `h/((b − a)(h² + (t − t₀)²))` that the inverse
/// square of the lamp's light cancels [Kulla12].
#[derive(Clone, Copy, Debug)]
struct FromLamp {
    /// Where the way is nearest to the lamp, metres along it.
    nearest: f32,
    height: f32,
    from: f32,
    to: f32,
}

impl FromLamp {
    fn draw(&self, u: f32) -> f32 {
        self.nearest + self.height * function::tan(self.from + (self.to - self.from) * u)
    }

    /// 1/m.
    fn pdf(&self, t: f32) -> f32 {
        let off = t - self.nearest;
        self.height / ((self.to - self.from) * (self.height * self.height + off * off))
    }
}

/// Ways nearer to a lamp than this count as so far away, metres: the density stays finite.
const LEAST_HEIGHT: f32 = 1e-4;
/// Optical depths to the eye and the lamp beyond which lamps are looked at from where light is scattered alone.
const MOST_BETWEEN_LAMPS: f32 = 4.0;

impl Walk<'_> {
    /// Goes up to `distance` metres along a ray in a body, or around them, unless it is scattered before. `seen` is what of light from its beginning reaches the eye.
    pub(super) fn go_through(
        &mut self,
        body: Option<&Medium>,
        onward: &Onward,
        distance: f32,
        seen: Spectrum,
        between: &mut Between,
    ) -> Option<Collision> {
        if !self.method.has_media {
            between.open = between.open * media::transmittance_of(body, distance);
            return None;
        }
        let scene::Medium { absorption, inside } = media::filling(self.world, body)?;
        let sigma_t = absorption + inside.scattering;
        let open = between.open;
        if !inside.emission.is_black() {
            between.glow += open * inside.emission * length_seen(sigma_t, distance);
        }
        if inside.scattering.is_black() {
            between.open = open * media::transmittance(sigma_t, distance);
            return None;
        }
        let Ray { origin, dir, .. } = onward.ray;
        let phase = Phase { asymmetry: inside.asymmetry };
        let segment = Segment { origin, dir, length: distance, sigma_t, shares: shares(seen * open) };
        if self.method.has_lamps {
            between.lit += open * inside.scattering * self.beside_lamps(&segment, phase);
        }
        let u = self.next_4d()[0];
        let t = draw_distance(sigma_t, segment.shares, u.x, u.y);
        let over = |light: Spectrum, pdf: f32| if pdf > 0.0 { light / pdf } else { Spectrum::BLACK };
        if t >= distance {
            let (left, passes, _) = segment.at(distance);
            between.open = open * over(left, passes);
            return None;
        }
        let (left, _, density) = segment.at(t);
        between.open = open * over(inside.scattering * left, density);
        Some(Collision { p: origin + dir * t, wo: -dir, phase, travelled: onward.travelled + t, segment, density })
    }

    /// What is scattered of the light of lamps with a place along a way, over σ_s, from one place for each of them, weighed against its being found from where the path is
    /// scattered (the balance heuristic). Of many lamps nothing.
    fn beside_lamps(&mut self, segment: &Segment, phase: Phase) -> Spectrum {
        let mut lit = Spectrum::BLACK;
        let method = self.method;
        for (place, lamp) in method.lamps.placed() {
            let Some(from_lamp) = segment.seen_by(place) else { continue };
            let t = from_lamp.draw(self.next_4d()[0].x);
            if !(t > 0.0 && t < segment.length) {
                continue;
            }
            let p = segment.origin + segment.dir * t;
            let Some(incident) = lamp.incident(p) else { continue };
            let (left, _, density) = segment.at(t);
            let weight = phase.evaluate(-segment.dir, incident.wi) / (density + from_lamp.pdf(t));
            lit += left * method.lamps.passed(self.world, p, &incident, &self.media, self.n_rays) * weight;
        }
        lit
    }

    /// A camera sample whose ray is scattered first.
    pub(super) fn scattered_between(mut self, pixel: &mut Pixel, collision: &Collision, open: Spectrum) {
        pixel.alpha = 1.0;
        if self.method.settings.max_depth == Some(0) {
            pixel.color = pixel.emission;
            return;
        }
        pixel.direct += open * self.next_event_between(collision);
        let n_branches = self.method.settings.branches.max(1);
        let weight = open / n_branches as f32;
        let sides = self.media;
        for stream in self.stream.branches(n_branches) {
            (self.stream, self.media, self.depth) = (stream, sides, 0);
            let onward = self.go_on_between(collision);
            let [once, more] = self.arriving(onward, open);
            pixel.direct += weight * once;
            pixel.indirect += weight * more;
        }
        // It comes from all around, as what is reflected diffusely.
        pixel.diffuse = pixel.direct + pixel.indirect;
        pixel.color = pixel.emission + pixel.diffuse;
    }

    /// Light that comes straight from sources to where it is scattered, as far as directions to them are drawn.
    pub(super) fn next_event_between(&mut self, collision: &Collision) -> Spectrum {
        let method = self.method;
        let Collision { p, wo, phase, .. } = *collision;
        let mut light = Spectrum::BLACK;
        if method.has_lamps {
            let u = if method.lamps.are_drawn() { self.next_4d()[0] } else { Vec2::ZERO };
            let Collision { segment, density, .. } = collision;
            let is_beside = method.lamps.placed().next().is_some();
            let weighed = |incident: &Incident| {
                let from_lamp = incident.target.filter(|_| is_beside).and_then(|lamp| segment.seen_by(lamp));
                let beside = from_lamp.map_or(0.0, |from_lamp| from_lamp.pdf((p - segment.origin).dot(segment.dir)));
                phase.evaluate(wo, incident.wi) * density / (density + beside)
            };
            light += method.lamps.scattered(self.world, p, weighed, (&self.media, u), self.n_rays);
        }
        if !method.emissive.is_empty() {
            let [u, choice] = self.next_4d();
            if let Some(drawn) = method.emissive.draw(p, EVERYWHERE, u, choice.x) {
                let ray = Surface::in_space(p, Vec3::ZERO, drawn.wi).shadow_ray(drawn.target);
                let world = self.world;
                let radiance = || world.emission_from(drawn.surface, drawn.position);
                light += self.look_between(collision, (drawn.wi, drawn.pdf), &ray, radiance);
            }
        }
        if let (Some(sampler), Some(sky)) = (&method.sky, self.world.sky()) {
            let [u, _] = self.next_4d();
            if let Some((wi, pdf)) = sampler.sample(u) {
                light += self.look_between(collision, (wi, pdf), &Ray::new(p, wi), || sky.radiance(wi));
            }
        }
        light
    }

    /// What a direction drawn with a density brings, weighed against its being drawn by the phase function.
    fn look_between(
        &mut self,
        collision: &Collision,
        (wi, pdf): (Vec3, f32),
        ray: &Ray,
        radiance: impl Fn() -> Spectrum,
    ) -> Spectrum {
        let phase = collision.phase.evaluate(collision.wo, wi);
        let passage = Passage { glass: Glass::Sheets, media: &self.media, loss: self.method.loss };
        let passed = self.world.transmittance(ray, passage, self.n_rays);
        if passed.is_black() {
            return Spectrum::BLACK;
        }
        radiance() * passed * (phase * power_heuristic(pdf, phase) / pdf)
    }

    /// Draws where a path goes on from where it is scattered: it weighs one.
    pub(super) fn go_on_between(&mut self, collision: &Collision) -> Onward {
        let Collision { p, wo, phase, travelled, .. } = *collision;
        let [u, _] = self.next_4d();
        let wi = phase.sample(wo, u);
        Onward {
            ray: Ray::new(p, wi),
            last: Some(Last { p, n: EVERYWHERE, pdf: phase.evaluate(wo, wi), share: 1.0 }),
            travelled,
            is_thrown: false,
        }
    }
}

/// How often each channel is to draw a distance, by what of it would be seen.
fn shares(seen: Spectrum) -> Spectrum {
    let sum: f32 = seen.to_array().iter().sum();
    if sum > 0.0 && sum.is_finite() { seen / sum } else { Spectrum::gray(1.0 / 3.0) }
}

/// A distance drawn by the extinction of the channel that `choice` chooses; infinite where that channel is clear.
fn draw_distance(sigma_t: Spectrum, shares: Spectrum, u: f32, choice: f32) -> f32 {
    let sigma = if choice < shares.r {
        sigma_t.r
    } else if choice < shares.r + shares.g || shares.b <= 0.0 {
        sigma_t.g
    } else {
        sigma_t.b
    };
    if sigma > 0.0 { -function::ln(1.0 - u) / sigma } else { f32::INFINITY }
}

/// `(1 − exp(−σ d))/σ` by channel: how long a way through a medium is to who looks along it, metres. What is clear and endless counts nothing.
fn length_seen(sigma_t: Spectrum, distance: f32) -> Spectrum {
    sigma_t.map(|sigma| match sigma * distance {
        depth if depth > 1e-3 => (1.0 - function::exp(-depth)) / sigma,
        // To the third term where the difference would cancel.
        depth if distance.is_finite() => distance * (1.0 - depth * (0.5 - depth / 6.0)),
        _ => 0.0,
    })
}
