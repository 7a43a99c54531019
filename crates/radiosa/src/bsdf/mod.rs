//! Reflection models at a point: what a surface does with light, once its textures have been looked up.
//!
//! A [`Bsdf`] is made from a [`scene::Material`](crate::scene::Material) by [`Bsdf::resolve`] and then answers
//! [`evaluate`](Bsdf::evaluate), in 1/sr, for the two groups of lobes that a light treats apart: `I_d` lights
//! [`Lobes::diffuse`] and `I_s` lights [`Lobes::specular`]. Perfect mirrors and glass are not functions of two directions;
//! they come from [`Bsdf::specular_rays`]. What a rough boundary lets through from behind is [`Bsdf::refract_cos`].
//!
//! Conventions: `wo` points to the viewer, `wi` to the light, both away from the surface and of unit length; `n` is the
//! shading normal **on the viewer's side**, so a surface that reflects on both sides is asked with `−n` from behind. Every
//! lobe is zero where `n·wi ≤ 0`.
//!
//! What delta lights show is the light table of `docs/conventions.md`. Two historical lobes are neither reciprocal nor
//! energy-conserving and stay as their authors wrote them: [`phong`] and the `Lecture` form of [`cook_torrance`];
//! the 1982 form reflects up to four times the modern one; glTF's layering in [`metallic_roughness`] can exceed albedo one
//! at grazing angles. `tests/laws.rs` shows each of these exceptions to be one.

pub mod cook_torrance;
pub mod dielectric;
pub mod fresnel;
pub mod lambert;
pub mod metallic_roughness;
pub mod microfacet;
pub mod mirror;
pub mod multiple_scattering;
pub mod phase;
pub mod phong;
pub mod rough_dielectric;
pub mod scatter;
pub mod texture;

use crate::math::{Frame, Vec2, Vec3};
use crate::scene::{ColorMap, Distribution, Material, Model, ScalarMap};
use crate::spectrum::Spectrum;

use fresnel::Weighing;

pub use dielectric::{SpecularRays, Transmission};
pub use scatter::{Highlights, Scatter, Scattered, Way};

/// Reads textures and vertex colours at one point of a surface.
pub trait Lookup {
    /// The coefficient here: factor times texture.
    fn color(&self, map: &ColorMap) -> Spectrum;
    /// The coefficient here: factor times the chosen channel of the texture.
    fn scalar(&self, map: &ScalarMap) -> f32;
    /// Interpolated vertex colour, which multiplies the diffuse or base colour; white where there is none.
    fn vertex_color(&self) -> Spectrum {
        Spectrum::WHITE
    }
}

/// A [`Lookup`] without textures: every coefficient is its factor.
#[derive(Clone, Copy, Debug, Default)]
pub struct FactorsOnly;

impl Lookup for FactorsOnly {
    fn color(&self, map: &ColorMap) -> Spectrum {
        map.factor
    }
    fn scalar(&self, map: &ScalarMap) -> f32 {
        map.factor
    }
}

/// Ratios of indices nearer to one than this are one but for rounding.
const SAME_INDEX: f32 = 1e-6;

/// The value of a reflection function, by what lights it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lobes {
    /// Lit by `I_d`.
    pub diffuse: Spectrum,
    /// Lit by `I_s`.
    pub specular: Spectrum,
}

impl Lobes {
    /// Reflects nothing.
    pub const BLACK: Self = Self { diffuse: Spectrum::BLACK, specular: Spectrum::BLACK };

    /// Both groups together.
    pub fn sum(self) -> Spectrum {
        self.diffuse + self.specular
    }

    fn map(self, f: impl Fn(Spectrum) -> Spectrum) -> Self {
        Self { diffuse: f(self.diffuse), specular: f(self.specular) }
    }
}

impl std::ops::AddAssign for Lobes {
    fn add_assign(&mut self, other: Self) {
        self.diffuse += other.diffuse;
        self.specular += other.specular;
    }
}

/// A reflection function at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bsdf {
    /// Shows this colour whatever the light (`KHR_materials_unlit`); reflects nothing.
    Unlit(Spectrum),
    /// Lambert with a classic highlight, mirror and glass by constants.
    Phong(phong::Phong),
    /// Lambert with a Cook–Torrance highlight.
    CookTorrance(cook_torrance::CookTorrance),
    /// glTF's metallic–roughness.
    MetallicRoughness(metallic_roughness::MetallicRoughness),
}

impl Bsdf {
    /// The function of `material` at the point that `lookup` reads.
    pub fn resolve(material: &Material, lookup: &impl Lookup) -> Self {
        if material.unlit {
            return Self::Unlit(lookup.color(material.model.base_color()) * lookup.vertex_color());
        }
        match &material.model {
            Model::Phong(m) => Self::Phong(phong::Phong::resolve(m, lookup)),
            Model::CookTorrance(m) => {
                let rough = cook_torrance::CookTorrance::resolve(m, lookup);
                let smooth = rough.smooth().filter(|_| lookup.scalar(&m.alpha) < microfacet::MIN_ALPHA);
                smooth.map_or(Self::CookTorrance(rough), Self::Phong)
            }
            Model::MetallicRoughness(m) => Self::MetallicRoughness(metallic_roughness::MetallicRoughness::resolve(m, lookup)),
        }
    }

    /// A Lambertian surface of reflectance `rho`, which is also its ambient coefficient.
    pub fn lambert(rho: Spectrum) -> Self {
        Self::Phong(phong::Phong { ambient: rho, diffuse: rho, ..phong::Phong::default() })
    }

    /// The same with its diffuse or base colour, and the ambient coefficient with it, multiplied.
    pub(crate) fn tinted(mut self, tint: Spectrum) -> Self {
        match &mut self {
            Self::Unlit(color) => *color = *color * tint,
            Self::Phong(m) => (m.ambient, m.diffuse) = (m.ambient * tint, m.diffuse * tint),
            Self::CookTorrance(m) => (m.ambient, m.diffuse) = (m.ambient * tint, m.diffuse * tint),
            Self::MetallicRoughness(m) => m.base_color = m.base_color * tint,
        }
        self
    }

    /// `f(wo, wi)`, 1/sr. May be infinite at grazing light where the model is (Phong, V-cavities);
    /// [`evaluate_cos`](Self::evaluate_cos) is what lighting needs and stays finite there.
    pub fn evaluate(&self, n: Vec3, wo: Vec3, wi: Vec3) -> Lobes {
        let cos_i = n.dot(wi);
        if cos_i > 0.0 { self.evaluate_cos(n, wo, wi).map(|f| f / cos_i) } else { Lobes::BLACK }
    }

    /// `f(wo, wi) (n·wi)⁺`, 1/sr: times the irradiance `E_⊥` a light gives a surface facing it, it is the radiance shown.
    pub fn evaluate_cos(&self, n: Vec3, wo: Vec3, wi: Vec3) -> Lobes {
        debug_assert!((wo.length_squared() - 1.0).abs() < 1e-3 && (wi.length_squared() - 1.0).abs() < 1e-3);
        match self {
            Self::Unlit(_) => Lobes::BLACK,
            Self::Phong(m) => m.evaluate_cos(n, wo, wi),
            Self::CookTorrance(m) => m.evaluate_cos(n, wo, wi),
            Self::MetallicRoughness(m) => m.evaluate_cos(n, wo, wi),
        }
    }

    /// `f(wo, wi) |n·wi|` of light that a rough boundary refracts from behind, 1/sr; black where refraction is perfect or there is none. Of radiance over the
    /// square of the index ([`rough_dielectric`]).
    pub fn refract_cos(&self, n: Vec3, wo: Vec3, wi: Vec3) -> Spectrum {
        let Some((boundary, refraction)) = self.boundary().and_then(|b| Some((b, b.between(n, wo, wi)?))) else {
            return Spectrum::BLACK;
        };
        let f = self.passing(refraction.angles.v_h) * boundary.refract_cos(&refraction);
        if f.is_finite() { f } else { Spectrum::BLACK }
    }

    /// The boundary that refracts roughly, where it does.
    pub fn boundary(&self) -> Option<rough_dielectric::Boundary> {
        match self {
            Self::Unlit(_) | Self::Phong(_) => None,
            Self::CookTorrance(m) => m.boundary(),
            Self::MetallicRoughness(m) => m.boundary(),
        }
    }

    /// What a facet of a rough surface reflects under `cos = v·h`, and what it lets through.
    fn facet_and_passing(&self, cos: f32) -> [Spectrum; 2] {
        match self {
            Self::Unlit(_) | Self::Phong(_) => [Spectrum::BLACK; 2],
            Self::CookTorrance(m) => m.facet_and_passing(cos),
            Self::MetallicRoughness(m) => [m.facet(cos), m.passing(cos)],
        }
    }

    /// What a facet of a rough boundary lets through under `cos = v·h`.
    fn passing(&self, cos: f32) -> Spectrum {
        match self {
            Self::Unlit(_) | Self::Phong(_) => Spectrum::BLACK,
            Self::CookTorrance(m) => m.passing(cos),
            Self::MetallicRoughness(m) => m.passing(cos),
        }
    }

    /// `k_a`: what ambient light is multiplied by.
    pub fn ambient(&self) -> Spectrum {
        match self {
            Self::Unlit(_) => Spectrum::BLACK,
            Self::Phong(m) => m.ambient,
            Self::CookTorrance(m) => m.ambient,
            Self::MetallicRoughness(m) => m.ambient(),
        }
    }

    /// `k_d`: the reflectance of the Lambertian part, which radiosity uses and non-directional irradiance is multiplied by
    /// (`L = k_d E/π`).
    pub fn diffuse_reflectance(&self) -> Spectrum {
        match self {
            Self::Unlit(_) => Spectrum::BLACK,
            Self::Phong(m) => m.diffuse,
            Self::CookTorrance(m) => m.diffuse,
            Self::MetallicRoughness(m) => m.diffuse_reflectance(),
        }
    }

    /// Its diffuse lobe is `k_d/π`, whatever the directions.
    pub(crate) fn is_diffuse_lambertian(&self) -> bool {
        !matches!(self, Self::MetallicRoughness(_))
    }

    /// It has a highlight of light sources.
    pub(crate) fn has_highlight(&self) -> bool {
        match self {
            Self::Unlit(_) => false,
            Self::Phong(m) => !m.specular.is_black(),
            Self::CookTorrance(m) => !m.specular.is_black(),
            Self::MetallicRoughness(_) => true,
        }
    }

    /// The surface's own colour, for the albedo layer: `k_d`, or the base colour of glTF materials (metals included).
    pub fn albedo(&self) -> Spectrum {
        match self {
            Self::Unlit(color) => *color,
            Self::MetallicRoughness(m) => m.base_color,
            _ => self.diffuse_reflectance(),
        }
    }

    /// The colour an unlit material shows.
    pub fn unlit(&self) -> Option<Spectrum> {
        if let Self::Unlit(color) = self { Some(*color) } else { None }
    }

    /// `k_r`: perfect mirror reflection, before any Fresnel weight ([`Self::specular_rays`] applies it).
    pub fn mirror(&self) -> Spectrum {
        match self {
            Self::Unlit(_) | Self::CookTorrance(_) => Spectrum::BLACK,
            Self::Phong(m) => m.mirror,
            Self::MetallicRoughness(m) => m.mirror(),
        }
    }

    /// Perfect refraction, when there is some. Ray casting follows no refracted rays: there the transmitted part of the light
    /// is missing, and the surface covers what lies behind it unless its alpha says otherwise.
    pub fn transmission(&self) -> Option<Transmission> {
        match self {
            Self::Unlit(_) => None,
            Self::CookTorrance(m) => m.transmission,
            Self::Phong(m) => m.transmission,
            Self::MetallicRoughness(m) => m.transmission(),
        }
    }

    /// True when delta lights never show on it: a perfect mirror, clear glass, an unlit or a black surface.
    pub fn is_specular_only(&self) -> bool {
        match self {
            Self::Unlit(_) => true,
            Self::Phong(m) => m.diffuse.is_black() && m.specular.is_black(),
            Self::CookTorrance(m) => m.diffuse.is_black() && m.specular.is_black() && m.transmission.is_none(),
            Self::MetallicRoughness(m) => m.is_smooth() && m.diffuse_reflectance().is_black(),
        }
    }

    /// The perfectly reflected and refracted rays leaving a point seen from `wo`, with their weights: the recursion of
    /// Whitted's model. `n` is on the viewer's side; `entering` tells whether that side is the outside.
    pub fn specular_rays(&self, n: Vec3, wo: Vec3, entering: bool) -> SpecularRays {
        match self {
            Self::Unlit(_) => SpecularRays::default(),
            Self::CookTorrance(m) => m.specular_rays(n, wo, entering),
            Self::Phong(m) => dielectric::specular_rays(m.mirror_at(n.dot(wo)), m.fresnel, m.transmission, n, wo, entering),
            Self::MetallicRoughness(m) => m.specular_rays(n, wo, entering),
        }
    }

    /// The same surface with a medium of index `surroundings` instead of vacuum outside.
    pub fn within(mut self, surroundings: f32) -> Self {
        match &mut self {
            Self::Unlit(_) => {}
            Self::CookTorrance(m) => m.surround(surroundings),
            Self::Phong(m) => {
                m.transmission.iter_mut().for_each(|t| t.ior /= surroundings);
                m.fresnel.iter_mut().for_each(|ior| *ior /= surroundings);
            }
            Self::MetallicRoughness(m) => m.surround(surroundings),
        }
        self
    }

    /// How far a highlight has the base colour ([`MetallicRoughness::share_of_metal`]): not at all in the other models.
    pub fn share_of_metal(&self) -> Spectrum {
        if let Self::MetallicRoughness(m) = self { m.share_of_metal() } else { Spectrum::BLACK }
    }

    /// What passes straight through a surface seen from `wo`: `k_t`, less what its facets reflect where the material is weighed by them (constants
    /// are taken as they are). `n` as in [`Self::specular_rays`], `surroundings` the index of what is around the body.
    ///
    /// A straight ray cannot tell at which angle a refracted one would meet a face. It is taken to run through parallel layers, in which `n sin θ`
    /// is the same everywhere, with `wo` its direction in vacuum: `sin θ = sin(n, wo) / surroundings` around the body.
    pub fn straight_transmission(&self, n: Vec3, wo: Vec3, surroundings: f32) -> Spectrum {
        let of = |bsdf: &Self, cos: f32| match bsdf {
            Self::Phong(m) => m.straight_transmission(cos),
            bsdf => bsdf.passing(cos),
        };
        let cos = n.dot(wo).clamp(0.0, 1.0);
        if surroundings == 1.0 {
            return of(self, cos);
        }
        let sin2 = (1.0 - cos * cos) / (surroundings * surroundings);
        of(&self.within(surroundings), (1.0 - sin2).max(0.0).sqrt())
    }

    /// Weighs the constants `k_r`, `k_t` of something transparent by Fresnel's equations, or not. Metallic–roughness has no constants.
    pub fn weighed(mut self, by: Weighing) -> Self {
        if by != Weighing::Material
            && let Self::Phong(m) = &mut self
        {
            let is_weighed = by == Weighing::On;
            m.fresnel = match m.transmission {
                Some(t) => is_weighed.then_some(t.ior),
                None => m.fresnel.filter(|_| is_weighed),
            };
            m.schlick &= is_weighed;
        }
        self
    }

    /// The same as rays inside its body meet it, where it has an inside, for methods that refract as if by a smooth surface: what reflects perfectly there
    /// ([`Self::specular_rays`]) must not do so once more as a rough lobe or a highlight.
    pub fn smooth_from_inside(self) -> Self {
        match self {
            Self::CookTorrance(m) => m.smooth_from_inside().map_or(self, Self::Phong),
            Self::MetallicRoughness(m) => Self::MetallicRoughness(m.smooth_from_inside()),
            bsdf => bsdf,
        }
    }

    /// The same as rays inside its body meet it, where it has an inside.
    pub fn met_from_inside(self) -> Self {
        match self {
            _ if self.boundary().is_none() => self.smooth_from_inside(),
            Self::CookTorrance(m) => Self::CookTorrance(m.met_from_inside()),
            Self::MetallicRoughness(m) => Self::MetallicRoughness(m.met_from_inside()),
            bsdf => bsdf,
        }
    }

    /// The same with a lobe that gives back what its facets reflect more than once ([`multiple_scattering`]): of Cook–Torrance in its modern form and of rough
    /// metallic–roughness, unless they refract.
    pub fn compensated(mut self) -> Self {
        if self.boundary().is_some() {
            return self;
        }
        match &mut self {
            Self::Unlit(_) | Self::Phong(_) => {}
            Self::CookTorrance(m) => m.compensate(),
            Self::MetallicRoughness(m) => m.compensate(),
        }
        self
    }

    /// The part that the lobe for multiple scattering reflects of light at `cos` from the normal.
    fn reflected_again(&self, cos: f32) -> Spectrum {
        let of = match self {
            Self::Unlit(_) | Self::Phong(_) => None,
            Self::CookTorrance(m) => m.compensation.map(|c| m.specular * c.albedo(cos)),
            Self::MetallicRoughness(m) => m.compensation.map(|c| c.albedo(cos)),
        };
        of.unwrap_or(Spectrum::BLACK)
    }

    /// What passes a boundary between media of the same index that neither reflects nor scatters: there is no surface but for its tint. `None` of every other surface.
    pub fn unbent(&self) -> Option<Spectrum> {
        let transmission = match self {
            Self::Phong(m) if m.diffuse.is_black() && m.specular.is_black() && (m.mirror.is_black() || m.fresnel.is_some()) => {
                m.transmission
            }
            Self::CookTorrance(m) if m.diffuse.is_black() => m.transmission,
            _ => None,
        };
        transmission.filter(|t| !t.thin && (t.ior - 1.0).abs() < SAME_INDEX).map(|t| t.weight)
    }

    /// The same with lobes at least as rough as `alpha`: what a rough mirror shows of a sharp highlight is not sharp, and a few rays
    /// drawn from the rough one would find the sharp one by luck only.
    pub fn at_least_as_rough(mut self, alpha: f32) -> Self {
        match &mut self {
            Self::Unlit(_) | Self::Phong(_) => {}
            Self::CookTorrance(m) => m.alpha = m.alpha.max(alpha),
            Self::MetallicRoughness(m) if m.is_smooth() => {}
            Self::MetallicRoughness(m) => m.alpha = m.alpha.max(alpha),
        }
        self
    }

    /// Roughness α of the lobe that [`Self::sample_gloss`] samples; 0 without one.
    pub fn roughness(&self) -> f32 {
        match self {
            Self::Unlit(_) | Self::Phong(_) => 0.0,
            Self::CookTorrance(m) => m.alpha,
            Self::MetallicRoughness(m) => m.alpha,
        }
    }

    /// True when it has a rough mirror lobe worth following, which [`Self::sample_gloss`] samples. The coat of a dielectric rougher than
    /// [`metallic_roughness::BROAD_COAT`] is none: it is four percent of a blur, whose part from light sources the highlight shows.
    pub fn is_glossy(&self) -> bool {
        match self {
            Self::Unlit(_) | Self::Phong(_) => false,
            Self::CookTorrance(m) => !m.specular.is_black(),
            Self::MetallicRoughness(m) => !m.is_smooth() && (m.metallic > 0.0 || m.alpha < metallic_roughness::BROAD_COAT),
        }
    }

    /// A direction drawn from the rough mirror lobe by two uniform numbers, and the weight `f (n·wi)/pdf` of what arrives from there; `None`
    /// where it would leave through the surface. The classic highlights of Phong's model are none: they show light sources only.
    pub fn sample_gloss(&self, n: Vec3, wo: Vec3, u: Vec2) -> Option<(Vec3, Spectrum)> {
        let (distribution, alpha) = match self {
            Self::Unlit(_) | Self::Phong(_) => return None,
            Self::CookTorrance(m) => (m.distribution, m.alpha),
            Self::MetallicRoughness(m) => (Distribution::Ggx, m.alpha),
        };
        let h = Frame::from_normal(n).to_world(microfacet::sample_d(distribution, alpha, u));
        let wi = mirror::reflect(wo, h);
        let angles = microfacet::Angles::new(n, wo, wi)?;
        // Facets are drawn by D (n·h), directions by that over 4 (v·h).
        let pdf = microfacet::d(distribution, alpha, &angles) * angles.n_h / (4.0 * angles.v_h);
        let weight = self.evaluate_cos(n, wo, wi).specular / pdf;
        (pdf > 0.0 && weight.is_finite()).then_some((wi, weight))
    }
}
