//! Light from n constant directions, the same at every point: `Σ π L_i (n·ω_i)⁺`.

use std::f32::consts::PI;

use super::{EnvironmentShadows, Incident};
use crate::scene::{Directional, Light};
use crate::spectrum::Spectrum;

/// A discrete environment.
#[derive(Clone, Debug, PartialEq)]
pub struct Discrete {
    /// `I_a`.
    pub ambient: Spectrum,
    /// What arrives anywhere.
    pub incidents: Vec<Incident>,
}

impl Discrete {
    pub(super) fn new(light: &Light, directions: &[Directional], shadows: EnvironmentShadows) -> Self {
        Self { ambient: light.ambient, incidents: incidents(directions, light.diffuse, light.specular, shadows) }
    }

    /// The directions an environment was reduced to.
    pub fn of_environment(directions: &[Directional], shadows: EnvironmentShadows) -> Self {
        Self { ambient: Spectrum::BLACK, incidents: incidents(directions, Spectrum::WHITE, Spectrum::WHITE, shadows) }
    }
}

fn incidents(directions: &[Directional], diffuse: Spectrum, specular: Spectrum, shadows: EnvironmentShadows) -> Vec<Incident> {
    directions
        .iter()
        .map(|d| Incident {
            target: None,
            wi: d.to_light.as_vec3(),
            distance: f32::INFINITY,
            diffuse: d.intensity * diffuse * PI,
            specular: d.intensity * specular * PI,
            casts_shadow: shadows == EnvironmentShadows::On,
        })
        .collect()
}
