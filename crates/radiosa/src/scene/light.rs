//! Lights that are not surfaces: the rows of the light table in `docs/conventions.md`.
//!
//! A *classic* light has an intensity `I`: the value a white diffuse surface shows when lit head-on, so its irradiance is
//! `π I f (n·l)⁺`. A *physical* one is given in W/sr or cd (point, spot), W/m² or lux (distant).

use super::ImageId;
use crate::math::{DQuat, DVec3};
use crate::spectrum::Spectrum;

/// One light.
#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    /// For messages and reports.
    pub name: String,
    /// `I_a`: this light's own ambient part, added as `I_a k_a` by the local models, never attenuated, coned or shadowed.
    pub ambient: Spectrum,
    /// `I_d`: lights diffuse lobes; classic intensity, or the physical quantity of `kind`.
    pub diffuse: Spectrum,
    /// `I_s`: lights specular lobes, in the unit of `diffuse`.
    pub specular: Spectrum,
    /// Where it is and how it spreads.
    pub kind: LightKind,
}

impl Light {
    /// A light whose diffuse and specular parts are the same, without an ambient part.
    pub fn new(name: impl Into<String>, intensity: Spectrum, kind: LightKind) -> Self {
        Self { name: name.into(), ambient: Spectrum::BLACK, diffuse: intensity, specular: intensity, kind }
    }
}

/// The unit of a point, spot or distant light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PhotometricUnit {
    /// Intensity `I`: what white shows when lit head-on.
    #[default]
    Classic,
    /// W/sr or cd for point and spot; W/m² or lux for distant.
    Physical,
}

/// `f = min(1/(c1 + c2 d + c3 d²), 1)`, the falloff of classic lights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attenuation {
    /// Constant.
    pub c1: f64,
    /// Linear, 1/m.
    pub c2: f64,
    /// Quadratic, 1/m².
    pub c3: f64,
}

impl Default for Attenuation {
    /// None: `f = 1`.
    fn default() -> Self {
        Self { c1: 1.0, c2: 0.0, c3: 0.0 }
    }
}

/// Light from one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Directional {
    /// Unit, towards the light.
    pub to_light: DVec3,
    /// Classic intensity `L_i`.
    pub intensity: Spectrum,
}

/// How a spot light falls off with the angle from its axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cone {
    /// `((s·s′)⁺)^exponent` inside `cutoff` radians from the axis, 0 outside.
    Classic {
        /// `k`.
        exponent: f64,
        /// Half angle, radians, in `(0, π]`.
        cutoff: f64,
    },
    /// `KHR_lights_punctual`: smooth between the inner and outer half angles, radians.
    Gltf {
        /// Full intensity inside.
        inner: f64,
        /// Nothing outside.
        outer: f64,
    },
}

/// The kinds of light.
#[derive(Clone, Debug, PartialEq)]
pub enum LightKind {
    /// Only its `ambient` part.
    Ambient,
    /// From one point in all directions. Physical: `c (n·l)⁺/d²`; classic: `π I f (n·l)⁺`.
    Point {
        /// Scene coordinates.
        position: DVec3,
        /// Unit of the intensities.
        unit: PhotometricUnit,
        /// Classic falloff; ignored when physical.
        attenuation: Attenuation,
        /// `KHR_lights_punctual` range: no light farther than this, smoothly; infinity for none.
        range: f64,
    },
    /// A point light with a cone.
    Spot {
        /// Scene coordinates.
        position: DVec3,
        /// Unit, the direction it shines in.
        axis: DVec3,
        /// Falloff with angle.
        cone: Cone,
        /// Unit of the intensities.
        unit: PhotometricUnit,
        /// Classic falloff; ignored when physical.
        attenuation: Attenuation,
        /// As for point lights.
        range: f64,
    },
    /// Parallel light.
    Distant {
        /// Unit, towards the light.
        to_light: DVec3,
        /// Unit of the intensities.
        unit: PhotometricUnit,
    },
    /// Two radiances, above and below a horizon: `π [L_up (1 + n·a)/2 + L_down (1 − n·a)/2]`; no specular term, no shadow in the
    /// local models. The light's `diffuse` is `L_up`.
    Hemispherical {
        /// Unit, up.
        axis: DVec3,
        /// `L_down`.
        down: Spectrum,
    },
    /// Light from n constant directions, the same everywhere: `Σ π L_i (n·ω_i)⁺`. Scaled by `diffuse` and `specular`.
    Discrete {
        /// Directions and intensities.
        directions: Vec<Directional>,
    },
}

/// Light from infinitely far away in every direction.
#[derive(Clone, Debug, PartialEq)]
pub struct Environment {
    /// Its radiance.
    pub radiance: EnvironmentRadiance,
    /// Multiplies the radiance.
    pub scale: Spectrum,
    /// From the map's to scene coordinates.
    pub rotation: DQuat,
    /// Rays from the camera see it.
    pub visible: bool,
    /// In the local models and ray casting: the number of directions it is reduced to.
    pub n_directions: u32,
}

impl Default for Environment {
    /// White, radiance 1 in every direction, seen by the camera, reduced to 64 directions.
    fn default() -> Self {
        Self {
            radiance: EnvironmentRadiance::Constant,
            scale: Spectrum::WHITE,
            rotation: DQuat::IDENTITY,
            visible: true,
            n_directions: 64,
        }
    }
}

/// What an environment shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum EnvironmentRadiance {
    /// The same in every direction.
    Constant,
    /// An equirectangular map: the top row is +y, the middle column looks along −z, columns go to the right (towards +x).
    Map(ImageId),
}
