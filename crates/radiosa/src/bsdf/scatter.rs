//! Where light goes on from a surface: directions drawn in about the proportion in which it reflects them, with their density.
//!
//! A [`Scatter`] is a [`Bsdf`] as methods that integrate over all directions have it: `f = f_diffuse + f_gloss` and two perfect rays. What the light table
//! (`docs/conventions.md`) gives delta lights alone is replaced: the highlights of Phong's model by normalised lobes ([`Highlights`]), the `Lecture` form of
//! Cook–Torrance by the modern one.
//!
//! One of the lobes is chosen by about how much it reflects, a direction by that lobe; the density counts all lobes that could have drawn it,
//!
//! ```text
//! p(wi) = P_d (n·wi)/π + P_g p_g(wi)
//! ```
//!
//! with `p_g` of [`microfacet`]'s visible normals or of the powers of a cosine that [`phong`] has. A facet of a rough boundary
//! ([`rough_dielectric`](super::rough_dielectric)) reflects or refracts by chance, as it does with light.

use std::f32::consts::{FRAC_1_PI, PI, TAU};

use super::microfacet::{self, Angles};
use super::rough_dielectric::Boundary;
use super::{Bsdf, Lobes, SpecularRays, lambert, mirror, phong};
use crate::math::{Frame, Vec2, Vec3, function};
use crate::sampling::warp;
use crate::scene::{Distribution, Form, PhongLobe};
use crate::spectrum::Spectrum;

/// What the classic highlights do with light that does not come from delta lights.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Highlights {
    /// Reflect it by a normalised lobe of the same exponent, `k_s` no more than what the other coefficients leave of 1.
    #[default]
    Lobe,
    /// Nothing: they are pictures of delta lights alone.
    None,
}

/// A reflection function ready to be sampled, seen from somewhere.
#[derive(Clone, Copy, Debug)]
pub struct Scatter {
    bsdf: Bsdf,
    n: Vec3,
    wo: Vec3,
    gloss: Gloss,
    /// Of the facets, where they refract.
    boundary: Option<Boundary>,
    rays: SpecularRays,
    /// How often a rough lobe sends a direction through.
    through: f32,
    /// Of drawing the diffuse lobe, the glossy one, the reflected and the refracted ray.
    p: [f32; 4],
}

/// The lobe that is neither diffuse nor perfect.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Gloss {
    None,
    /// A power of a cosine: about the mirror direction or the halfway vector, with the factor that normalises it.
    Power {
        about: PhongLobe,
        exponent: f32,
        k_s: Spectrum,
    },
    Facets {
        distribution: Distribution,
        alpha: f32,
        /// `G₁/(n·v)`: a facet normal is drawn with the density `D_v = D (v·h) G₁/(n·v)`.
        visible: f32,
    },
}

/// How a direction was drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Way {
    /// By the rough lobes, with this density, 1/sr. It goes through the surface where `n·wi < 0`.
    Rough {
        /// Of all rough lobes together.
        pdf: f32,
    },
    /// The perfectly reflected ray.
    Reflected,
    /// The perfectly refracted ray, or the one that passes a clear sheet.
    Refracted,
}

/// A direction drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scattered {
    /// Unit, away from the surface.
    pub wi: Vec3,
    /// How.
    pub way: Way,
    /// `f (n·wi)/p`: what the radiance from there is multiplied by. Perfect rays count as specular.
    pub weight: Lobes,
}

impl Scatter {
    /// Of a surface seen along `wo` (unit, to the viewer) whose shading normal on that side is `n`; `entering` tells whether that side is the outside. From inside
    /// a body it has to be [`Bsdf::met_from_inside`].
    pub fn new(mut bsdf: Bsdf, n: Vec3, wo: Vec3, entering: bool, highlights: Highlights) -> Self {
        let boundary = bsdf.boundary();
        let rays = if boundary.is_some() { SpecularRays::default() } else { bsdf.specular_rays(n, wo, entering) };
        let cos_o = n.dot(wo).clamp(0.0, 1.0);
        let mut reflects = Spectrum::BLACK;
        let facets = |distribution: Distribution, alpha: f32| {
            let visible = if cos_o > 0.0 { microfacet::g1_over_cosine(distribution, alpha, cos_o) } else { 0.0 };
            Gloss::Facets { distribution, alpha, visible }
        };
        let gloss = match &mut bsdf {
            Bsdf::Unlit(_) => Gloss::None,
            Bsdf::Phong(m) => {
                let left = Spectrum::WHITE - m.diffuse - m.mirror - m.transmission.map_or(Spectrum::BLACK, |t| t.weight);
                let k_s = Spectrum::new(m.specular.r.min(left.r), m.specular.g.min(left.g), m.specular.b.min(left.b));
                reflects = k_s.map(|k| k.max(0.0));
                if highlights == Highlights::None || reflects.is_black() || cos_o <= 0.0 {
                    Gloss::None
                } else {
                    let (about, exponent) = (m.lobe, m.exponent);
                    Gloss::Power { about, exponent, k_s: reflects * phong::normalisation(about, exponent) }
                }
            }
            Bsdf::CookTorrance(m) => {
                if m.form == Form::Lecture {
                    m.form = Form::Modern;
                }
                let strength = if m.form == Form::Modern { 1.0 } else { 4.0 };
                reflects = m.specular * m.facet(cos_o) * strength;
                if m.specular.is_black() && boundary.is_none() { Gloss::None } else { facets(m.distribution, m.alpha) }
            }
            Bsdf::MetallicRoughness(m) => {
                reflects = m.facet(cos_o);
                if m.is_smooth() { Gloss::None } else { facets(Distribution::Ggx, m.alpha) }
            }
        };
        let mut through = 0.0;
        if boundary.is_some() {
            let of = OfFacet::new(&bsdf, cos_o);
            reflects += of.passing;
            through = 1.0 - of.reflecting;
        }
        let ray = |ray: Option<(Vec3, Spectrum)>| ray.map_or(0.0, |(_, weight)| weight.luminance().max(0.0));
        // Both are drawn by the cosine.
        let diffuse = bsdf.diffuse_reflectance().luminance() + bsdf.reflected_again(cos_o).luminance();
        let glossy = if gloss == Gloss::None || cos_o <= 0.0 { 0.0 } else { reflects.luminance().max(LEAST * diffuse).max(1e-6) };
        let of = [diffuse, glossy, ray(rays.reflected), ray(rays.refracted)];
        let sum: f32 = of.iter().sum();
        let p = if sum > 0.0 && sum.is_finite() { of.map(|w| w / sum) } else { [0.0; 4] };
        let through =
            if boundary.is_some() && p[1] > 0.0 { (p[1] * through / (p[0] + p[1])).clamp(LEAST, 1.0 - LEAST) } else { 0.0 };
        Self { bsdf, n, wo, gloss, boundary, rays, through, p }
    }

    /// Nothing but perfect rays goes on: no direction can be looked in.
    pub fn is_perfect(&self) -> bool {
        self.p[0] + self.p[1] <= 0.0
    }

    /// How often, about, a rough lobe sends a direction through the surface: 0 where none does, else neither never nor always.
    pub fn share_through(&self) -> f32 {
        self.through
    }

    /// How often a facet under `cos = v·h` is taken to reflect.
    fn reflecting(&self, cos: f32) -> f32 {
        if self.boundary.is_some() { OfFacet::new(&self.bsdf, cos).reflecting } else { 1.0 }
    }

    /// `f(wo, wi) |n·wi|`, from behind of rough refraction, and the density with which [`Self::sample`] draws `wi` by the rough lobes.
    pub fn evaluate(&self, wi: Vec3) -> (Lobes, f32) {
        let cos_i = self.n.dot(wi);
        if cos_i <= 0.0 {
            return self.through(wi);
        }
        let pdf = self.p[0] * cos_i * FRAC_1_PI;
        match (&self.bsdf, self.gloss) {
            (Bsdf::Phong(m), Gloss::None) => {
                (Lobes { diffuse: lambert::f_cos(m.diffuse, self.n, wi), specular: Spectrum::BLACK }, pdf)
            }
            (bsdf, _) => match Angles::new(self.n, self.wo, wi) {
                Some(angles) => {
                    (self.lobes(wi, &angles), pdf + if self.p[1] > 0.0 { self.p[1] * self.gloss_pdf(wi, &angles) } else { 0.0 })
                }
                // The viewer is behind a shading normal: there is no gloss.
                None => (bsdf.evaluate_cos(self.n, self.wo, wi), pdf),
            },
        }
    }

    /// `f (n·wi)` of light and viewer in front.
    fn lobes(&self, wi: Vec3, angles: &Angles) -> Lobes {
        match &self.bsdf {
            Bsdf::Unlit(_) => Lobes::BLACK,
            Bsdf::Phong(m) => Lobes { diffuse: lambert::f_cos(m.diffuse, self.n, wi), specular: self.power(wi) * angles.n_l },
            Bsdf::CookTorrance(m) => m.evaluate_at(angles),
            Bsdf::MetallicRoughness(m) => m.evaluate_at(angles),
        }
    }

    /// What is refracted from `wi`, behind the surface, and its density.
    fn through(&self, wi: Vec3) -> (Lobes, f32) {
        let nothing = (Lobes::BLACK, 0.0);
        let Some(boundary) = self.boundary.filter(|_| self.p[1] > 0.0) else { return nothing };
        let Some(refraction) = boundary.between(self.n, self.wo, wi) else { return nothing };
        let cos = refraction.angles.v_h;
        let of = OfFacet::new(&self.bsdf, cos);
        let f = of.passing * boundary.refract_cos(&refraction);
        let pdf = self.p[1] * (1.0 - of.reflecting) * boundary.pdf(&refraction);
        if f.is_finite() && pdf.is_finite() { (Lobes { diffuse: Spectrum::BLACK, specular: f }, pdf) } else { nothing }
    }

    /// The value of a power of a cosine, 1/sr.
    fn power(&self, wi: Vec3) -> Spectrum {
        match self.gloss {
            Gloss::Power { about: PhongLobe::Phong, exponent, k_s } => k_s * phong::phong_lobe(self.n, self.wo, wi, exponent),
            Gloss::Power { about: PhongLobe::BlinnPhong, exponent, k_s } => {
                k_s * phong::blinn_lobe(self.n, self.wo, wi, exponent)
            }
            _ => Spectrum::BLACK,
        }
    }

    /// The density of the glossy lobe alone, 1/sr.
    fn gloss_pdf(&self, wi: Vec3, angles: &Angles) -> f32 {
        match self.gloss {
            Gloss::None => 0.0,
            Gloss::Power { about: PhongLobe::Phong, exponent, .. } => {
                (exponent + 1.0) / TAU * phong::phong_lobe(self.n, self.wo, wi, exponent)
            }
            Gloss::Power { about: PhongLobe::BlinnPhong, exponent, .. } => {
                if angles.v_h > 0.0 {
                    (exponent + 1.0) / (4.0 * TAU * angles.v_h) * phong::blinn_lobe(self.n, self.wo, wi, exponent)
                } else {
                    0.0
                }
            }
            // D_v over 4 (v·h).
            Gloss::Facets { distribution, alpha, visible } => {
                self.reflecting(angles.v_h) * microfacet::d(distribution, alpha, angles) * 0.25 * visible
            }
        }
    }

    /// A direction by two uniform numbers, of the lobe that `choice` in `[0, 1)` chooses; `None` where nothing is reflected, or it would leave on the side where
    /// its lobe is not.
    pub fn sample(&self, u: Vec2, choice: f32) -> Option<Scattered> {
        let [diffuse, gloss, reflected, _] = self.p;
        let wi = if choice < diffuse {
            Frame::from_normal(self.n).to_world(warp::cosine_hemisphere(u))
        } else if choice < diffuse + gloss {
            self.sample_gloss(u, (choice - diffuse) / gloss)?
        } else {
            let is_reflected = choice < diffuse + gloss + reflected || self.p[3] <= 0.0;
            let (ray, p, way) = if is_reflected {
                (self.rays.reflected, reflected, Way::Reflected)
            } else {
                (self.rays.refracted, self.p[3], Way::Refracted)
            };
            let (wi, weight) = ray.filter(|_| p > 0.0)?;
            return Some(Scattered { wi, way, weight: Lobes { diffuse: Spectrum::BLACK, specular: weight / p } });
        };
        let (lobes, pdf) = self.evaluate(wi);
        let weight = Lobes { diffuse: lobes.diffuse / pdf, specular: lobes.specular / pdf };
        (pdf > 0.0 && weight.sum().is_finite()).then_some(Scattered { wi, way: Way::Rough { pdf }, weight })
    }

    /// A direction of the glossy lobe; `choice` in `[0, 1)` tells whether a facet reflects.
    fn sample_gloss(&self, u: Vec2, choice: f32) -> Option<Vec3> {
        // Around +z by cosⁿ: the density is (n + 1)/(2π) cosⁿ.
        let power = |exponent: f32| {
            let cos = function::pow(1.0 - u.x, 1.0 / (exponent + 1.0));
            let sin = ((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt();
            let phi = 2.0 * PI * u.y;
            Vec3::new(sin * function::cos(phi), sin * function::sin(phi), cos)
        };
        match self.gloss {
            Gloss::None => None,
            Gloss::Power { about: PhongLobe::Phong, exponent, .. } => {
                Some(Frame::from_normal(mirror::reflect(self.wo, self.n)).to_world(power(exponent)))
            }
            Gloss::Power { about: PhongLobe::BlinnPhong, exponent, .. } => {
                let h = Frame::from_normal(self.n).to_world(power(exponent));
                (self.wo.dot(h) > 0.0).then(|| mirror::reflect(self.wo, h))
            }
            Gloss::Facets { distribution, alpha, .. } => {
                let frame = Frame::from_normal(self.n);
                let h = frame.to_world(microfacet::sample_visible(distribution, alpha, frame.to_local(self.wo), u));
                match self.boundary.filter(|_| choice >= self.reflecting(self.wo.dot(h).clamp(0.0, 1.0))) {
                    None => Some(mirror::reflect(self.wo, h)).filter(|wi| self.n.dot(*wi) > 0.0),
                    Some(boundary) => boundary.refract(self.n, self.wo, h).filter(|wi| self.n.dot(*wi) < 0.0),
                }
            }
        }
    }
}

/// What a facet of a rough boundary does.
struct OfFacet {
    /// What it lets through.
    passing: Spectrum,
    /// How often it is taken to reflect.
    reflecting: f32,
}

impl OfFacet {
    /// Under `cos = v·h`.
    fn new(bsdf: &Bsdf, cos: f32) -> Self {
        let [facet, passing] = bsdf.facet_and_passing(cos);
        let (reflected, passed) = (facet.luminance(), passing.luminance());
        Self { passing, reflecting: if passed > 0.0 { reflected / (reflected + passed) } else { 1.0 } }
    }
}

/// A glossy lobe is drawn at least this part as often as the diffuse one: towards grazing angles it reflects more than the estimate has. And light is looked for at
/// least as often on each side of a rough sheet.
const LEAST: f32 = 0.1;
