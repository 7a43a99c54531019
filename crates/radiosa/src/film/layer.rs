//! What a film may keep, by name.

use std::fmt;
use std::str::FromStr;

use thiserror::Error;

/// A logical layer of a film: one or more channels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Layer {
    /// Radiance, all of it: channels `R`, `G`, `B`.
    Color,
    /// How much of the pixel is covered by surfaces, 0 to 1: channel `A`.
    Alpha,
    /// By lobe: what ambient light adds.
    Ambient,
    /// By lobe: diffuse reflection.
    Diffuse,
    /// By lobe: glossy highlights of lights.
    Specular,
    /// By lobe: what mirrors show.
    Reflection,
    /// By lobe: what is seen through glass.
    Refraction,
    /// By lobe and by path: what surfaces emit towards the viewer.
    Emission,
    /// By lobe and by path: what rays that leave the scene see.
    Background,
    /// By path: light that was scattered once.
    Direct,
    /// By path: light that was scattered more than once.
    Indirect,
    /// Reflectance of the first surface.
    Albedo,
    /// Shading normal of the first surface, in the world: `normal.X`, `.Y`, `.Z`.
    Normal,
    /// Where the pixel's ray meets the first surface: `position.X`, `.Y`, `.Z`.
    Position,
    /// How far away that is: `depth.Z`; infinite where there is nothing.
    Depth,
    /// Variance of the colour's mean, per channel.
    Variance,
    /// How many samples the pixel is the mean of: `samples.N`.
    Samples,
    /// Which object: `object.id`, 0 for none.
    ObjectId,
}

impl Layer {
    /// All of them, in the order files list them.
    pub const ALL: [Self; 18] = [
        Self::Color,
        Self::Alpha,
        Self::Ambient,
        Self::Diffuse,
        Self::Specular,
        Self::Reflection,
        Self::Refraction,
        Self::Emission,
        Self::Background,
        Self::Direct,
        Self::Indirect,
        Self::Albedo,
        Self::Normal,
        Self::Position,
        Self::Depth,
        Self::Variance,
        Self::Samples,
        Self::ObjectId,
    ];

    /// Its name on the command line and as the prefix of its channels.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Color => "color",
            Self::Alpha => "alpha",
            Self::Ambient => "ambient",
            Self::Diffuse => "diffuse",
            Self::Specular => "specular",
            Self::Reflection => "reflection",
            Self::Refraction => "refraction",
            Self::Emission => "emission",
            Self::Background => "background",
            Self::Direct => "direct",
            Self::Indirect => "indirect",
            Self::Albedo => "albedo",
            Self::Normal => "normal",
            Self::Position => "position",
            Self::Depth => "depth",
            Self::Variance => "variance",
            Self::Samples => "samples",
            Self::ObjectId => "object",
        }
    }

    /// The names of its channels in files.
    pub const fn channels(self) -> &'static [&'static str] {
        match self {
            Self::Color => &["R", "G", "B"],
            Self::Alpha => &["A"],
            Self::Ambient => &["ambient.R", "ambient.G", "ambient.B"],
            Self::Diffuse => &["diffuse.R", "diffuse.G", "diffuse.B"],
            Self::Specular => &["specular.R", "specular.G", "specular.B"],
            Self::Reflection => &["reflection.R", "reflection.G", "reflection.B"],
            Self::Refraction => &["refraction.R", "refraction.G", "refraction.B"],
            Self::Emission => &["emission.R", "emission.G", "emission.B"],
            Self::Background => &["background.R", "background.G", "background.B"],
            Self::Direct => &["direct.R", "direct.G", "direct.B"],
            Self::Indirect => &["indirect.R", "indirect.G", "indirect.B"],
            Self::Albedo => &["albedo.R", "albedo.G", "albedo.B"],
            Self::Normal => &["normal.X", "normal.Y", "normal.Z"],
            Self::Position => &["position.X", "position.Y", "position.Z"],
            Self::Depth => &["depth.Z"],
            Self::Variance => &["variance.R", "variance.G", "variance.B"],
            Self::Samples => &["samples.N"],
            Self::ObjectId => &["object.id"],
        }
    }
}

/// A way to split the colour into parts that sum to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decomposition {
    /// By what the first surface does with the light.
    Lobe,
    /// By how often the light was scattered.
    Path,
}

impl Decomposition {
    /// The layers that sum to [`Layer::Color`].
    pub const fn layers(self) -> &'static [Layer] {
        use Layer::{Ambient, Background, Diffuse, Direct, Emission, Indirect, Reflection, Refraction, Specular};
        match self {
            Self::Lobe => &[Ambient, Diffuse, Specular, Reflection, Refraction, Emission, Background],
            Self::Path => &[Direct, Indirect, Emission, Background],
        }
    }
}

impl fmt::Display for Layer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A name that is no layer's.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("there is no layer {name:?}; the layers are {}", Layer::ALL.map(Layer::name).join(", "))]
pub struct UnknownLayer {
    /// The name.
    pub name: String,
}

impl FromStr for Layer {
    type Err = UnknownLayer;
    fn from_str(name: &str) -> Result<Self, UnknownLayer> {
        Self::ALL.into_iter().find(|l| l.name().eq_ignore_ascii_case(name)).ok_or_else(|| UnknownLayer { name: name.to_owned() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_layer_is_found_by_its_name_and_no_channel_has_two_owners() {
        let mut names: Vec<&str> = Layer::ALL.iter().flat_map(|l| l.channels()).copied().collect();
        for layer in Layer::ALL {
            assert_eq!(layer.name().parse(), Ok(layer));
        }
        let n = names.len();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), n);
        assert!("glow".parse::<Layer>().unwrap_err().to_string().contains("ambient, diffuse"));
    }
}
