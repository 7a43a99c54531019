//! Lights as the local models ask them: what arrives at a point, and from where.
//!
//! An [`Emitter`] is a [`scene::Light`](crate::scene::Light) made ready for shading: positions relative to the world's
//! origin, in f32, every constant folded. It speaks one quantity, the irradiance `E_⊥` of a surface that faces the light, so
//! that the radiance shown is
//!
//! ```text
//! L = I_a k_a  +  Σ_incident  f_d (n·l)⁺ E_⊥,d + f_s (n·l)⁺ E_⊥,s  +  (k_d/π) Σ irradiance(n)
//! ```
//!
//! with `f (n·l)⁺` from [`Bsdf::evaluate_cos`](crate::bsdf::Bsdf::evaluate_cos). Lights that arrive from one or a few
//! directions answer [`Emitter::for_each_incident`]; those without direction answer [`Emitter::irradiance`] instead and have neither
//! highlight nor shadow. Every row follows the light table of `docs/conventions.md`.

pub mod area;
pub(crate) mod beams;
pub mod discrete;
pub mod distant;
pub mod environment;
pub mod hemispherical;
pub(crate) mod lamps;
mod piece;
pub mod point;
pub(crate) mod polygon;
pub mod random;
pub mod reduce;
mod seen;
pub mod sky_sampler;
pub mod spot;
mod tree;

pub(crate) use seen::EVERYWHERE;

use crate::math::{DVec3, Vec3};
use crate::scene::{Light, LightKind};
use crate::spectrum::Spectrum;

/// Light arriving at a point from one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Incident {
    /// Unit, from the point to the light.
    pub wi: Vec3,
    /// How far the light is, metres; infinite for parallel light.
    pub distance: f32,
    /// Where a shadow ray ends: the light's position, for a point of a surface just in front of it; `None` for parallel light.
    pub target: Option<Vec3>,
    /// `E_⊥` for diffuse lobes, W/m² or lux: irradiance at normal incidence.
    pub diffuse: Spectrum,
    /// `E_⊥` for specular lobes, likewise.
    pub specular: Spectrum,
    /// Whether something between takes it away.
    pub casts_shadow: bool,
}

/// A light ready for shading.
#[derive(Clone, Debug, PartialEq)]
pub enum Emitter {
    /// `I_a` alone.
    Ambient(Spectrum),
    /// From one point in all directions.
    Point(point::Point),
    /// From one point in a cone.
    Spot(spot::Spot),
    /// Parallel.
    Distant(distant::Distant),
    /// Two radiances, above and below.
    Hemispherical(hemispherical::Hemispherical),
    /// From n constant directions; also environments reduced to them.
    Discrete(discrete::Discrete),
    /// Emissive surfaces as point samples.
    Area(area::PointSamples),
    /// The irradiance integral of an environment.
    Environment(environment::IrradianceTable),
}

/// Whether the lights whose shadows the light table leaves open cast them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EnvironmentShadows {
    /// Environments reach every point.
    #[default]
    Off,
    /// Each of their directions can be blocked.
    On,
}

impl Emitter {
    /// `light`, seen from `origin` (scene coordinates of the world's zero). `shadows` concerns discrete environments only.
    pub fn prepare(light: &Light, origin: DVec3, shadows: EnvironmentShadows) -> Self {
        match &light.kind {
            LightKind::Ambient => Self::Ambient(light.ambient),
            LightKind::Point { position, unit, attenuation, range } => {
                Self::Point(point::Point::new(light, *position - origin, *unit, *attenuation, *range))
            }
            LightKind::Spot { position, axis, cone, unit, attenuation, range } => Self::Spot(spot::Spot::new(
                point::Point::new(light, *position - origin, *unit, *attenuation, *range),
                *axis,
                *cone,
            )),
            LightKind::Distant { to_light, unit } => Self::Distant(distant::Distant::new(light, *to_light, *unit)),
            LightKind::Hemispherical { axis, down } => {
                Self::Hemispherical(hemispherical::Hemispherical::new(light, *axis, *down))
            }
            LightKind::Discrete { directions } => Self::Discrete(discrete::Discrete::new(light, directions, shadows)),
        }
    }

    /// `I_a`, the light's own ambient part: add `I_a k_a`, whatever the distance, the cone and the shadow.
    pub fn ambient(&self) -> Spectrum {
        match self {
            Self::Ambient(ambient) => *ambient,
            Self::Point(l) => l.ambient,
            Self::Spot(l) => l.point.ambient,
            Self::Distant(l) => l.ambient,
            Self::Hemispherical(l) => l.ambient,
            Self::Discrete(l) => l.ambient,
            Self::Area(_) | Self::Environment(_) => Spectrum::BLACK,
        }
    }

    /// Everything that arrives at `p` (world coordinates) from a direction, in an order that never changes.
    pub fn for_each_incident(&self, p: Vec3, f: &mut dyn FnMut(Incident)) {
        match self {
            Self::Ambient(_) | Self::Hemispherical(_) | Self::Environment(_) => {}
            Self::Point(l) => l.incident(p).into_iter().for_each(f),
            Self::Spot(l) => l.incident(p).into_iter().for_each(f),
            Self::Distant(l) => f(l.incident()),
            Self::Discrete(l) => l.incidents.iter().copied().for_each(f),
            Self::Area(l) => l.samples.iter().filter_map(|s| s.incident(p)).for_each(f),
        }
    }

    /// Directions that light arrives from at a point, at most.
    pub fn n_directions(&self) -> usize {
        match self {
            Self::Ambient(_) | Self::Hemispherical(_) | Self::Environment(_) => 0,
            Self::Point(_) | Self::Spot(_) | Self::Distant(_) => 1,
            Self::Discrete(l) => l.incidents.len(),
            Self::Area(l) => l.len(),
        }
    }

    /// What arrives at `p` from a light of one direction; `None` for the others, and where nothing arrives.
    pub fn incident(&self, p: Vec3) -> Option<Incident> {
        match self {
            Self::Point(l) => l.incident(p),
            Self::Spot(l) => l.incident(p),
            Self::Distant(l) => Some(l.incident()),
            _ => None,
        }
    }

    /// Irradiance without a direction on a surface of normal `n`, W/m² or lux: diffuse only, no highlight, no shadow.
    pub fn irradiance(&self, n: Vec3) -> Spectrum {
        match self {
            Self::Hemispherical(l) => l.irradiance(n),
            Self::Environment(l) => l.irradiance(n),
            _ => Spectrum::BLACK,
        }
    }
}
