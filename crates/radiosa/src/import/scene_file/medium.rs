//! What fills space: fog, smoke.

use schemars::JsonSchema;
use serde::Deserialize;

use super::Reading;
use super::value::{Asymmetry, Color};
use crate::scene::{Inside, Medium};

/// A homogeneous medium that absorbs, scatters and emits.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct MediumTable {
    /// σ_a, absorbed per unit of length of the file; 0 when not given.
    absorption: Option<Color>,
    /// σ_s, scattered per unit of length of the file; 0 when not given.
    scattering: Option<Color>,
    /// g, the mean cosine of the angle by which light is scattered (Henyey and Greenstein): above 0 forward, below 0 back; 0 when not given.
    asymmetry: Option<Asymmetry>,
    /// Radiance it emits per unit of length of the file; 0 when not given.
    emission: Option<Color>,
}

impl MediumTable {
    pub(super) fn build(&self, r: &Reading<'_>) -> Medium {
        Medium {
            absorption: r.per_metre(self.absorption),
            inside: Inside {
                scattering: r.per_metre(self.scattering),
                asymmetry: self.asymmetry.map_or(0.0, |a| a.0 as f32),
                emission: r.per_metre(self.emission),
            },
        }
    }
}
