//! What a picture is to look like: the options `render` and `sheet` share, and that a sheet may vary from cell to cell.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use radiosa::import::Override;
use radiosa::raytrace::adaptive::LEVEL_LIMIT;

use super::value::{Emitters, Exposure, Size, parse_color, parse_fraction, parse_noise, parse_pixel, parse_scale};
use super::{Lamps, Overlay, Radiosity, Show};

/// Everything that decides about the light in a picture, whatever is done with it.
#[derive(Args, Clone, Debug, PartialEq)]
#[command(next_help_heading = "The picture")]
pub(crate) struct Picture {
    /// How to light it
    #[arg(short, long, value_enum, default_value_t = Method::Auto)]
    pub(crate) method: Method,

    /// Picture size in pixels [default: the camera's shape, 800 pixels on the longer side]
    #[arg(long, value_name = "WxH")]
    pub(crate) size: Option<Size>,

    /// A camera of the scene by name or index from 0, or "auto" to frame the scene [default: the first, or auto]
    #[arg(long, value_name = "NAME|INDEX")]
    pub(crate) camera: Option<String>,

    /// Samples a pixel [default: 4, for path tracing 16, or as many as --noise and --time take]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=65536))]
    pub(crate) spp: Option<u32>,

    /// Stop at this relative error, the root of the mean of Var/(L² + ε), and send samples where they bring it down most (path tracing); --spp is then the most
    /// a pixel may have
    #[arg(long, value_name = "X", value_parser = parse_noise)]
    pub(crate) noise: Option<f64>,

    /// Reconstruction filter
    #[arg(long, value_enum, default_value_t = Filter::Box)]
    pub(crate) filter: Filter,

    /// Seed of every random stream
    #[arg(long, default_value_t = 0)]
    pub(crate) seed: u64,

    /// Where scan line computes light: once a face, at its vertices, or at every pixel
    #[arg(long, value_enum, default_value_t = Interpolation::Phong)]
    pub(crate) interpolation: Interpolation,

    /// Faces scan line leaves out
    #[arg(long, value_enum, default_value_t = Cull::None)]
    pub(crate) cull: Cull,

    /// Rings of the faces scan line makes of a sphere
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(2..=1024))]
    pub(crate) tessellation: u32,

    /// Mirrors and glass Whitted ray tracing follows in a row; for path tracing how often light is scattered on its way, of any surface [default: 12, for path
    /// tracing no limit]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=64))]
    pub(crate) max_depth: Option<u32>,

    /// What the classic highlights of Phong's model do with light that does not come from point, spot or distant lights (path tracing)
    #[arg(long, value_enum, default_value_t = Highlights::Lobe)]
    pub(crate) phong: Highlights,

    /// Give back the light that facets of rough metals and coats reflect more than once, which the microfacet models lose (path tracing)
    #[arg(long, value_enum, default_value_t = OnOff::Off)]
    pub(crate) multiple_scattering: OnOff,

    /// Look for the light that mirrors and glass throw (caustics) from its sources as well (path tracing): off lamps without size it is found in no other way
    #[arg(long, value_enum, default_value_t = OnOff::On)]
    pub(crate) light_tracing: OnOff,

    /// Let the errors of neighbouring pixels cancel, so that noise looks like fine grain, at best with this many samples a pixel (path tracing)
    #[arg(long, value_name = "SPP", value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub(crate) blue_noise: Option<u32>,

    /// Whitted ray tracing leaves out a ray of which less than this would reach the picture [default: 1/1024]
    #[arg(long, value_name = "X", default_value_t = 1.0 / 1024.0, value_parser = parse_fraction, hide_default_value = true)]
    pub(crate) min_weight: f32,

    /// Whether Fresnel's equations weigh the constants k_r and k_t of mirrors and glass; off: they are taken as they are, and glass with k_r + k_t above 1
    /// makes light
    #[arg(long, value_enum, default_value_t = Fresnel::Material)]
    pub(crate) fresnel: Fresnel,

    /// Light passes transparent things straight on its way from a lamp (Whitted ray tracing); off: they cast full shadows, as in 1980
    #[arg(long, value_enum, default_value_t = OnOff::On)]
    pub(crate) transparent_shadows: OnOff,

    /// Rays of each rough reflection and random points of emissive surfaces (Whitted ray tracing, hybrid); 0: fixed points, one ray. For path tracing the paths
    /// that go on from what each camera sample sees [default: 0, for the hybrid and path tracing 4]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=4096))]
    pub(crate) samples: Option<u32>,

    /// Sample the corners of pixels, and more where they differ by more than this part of white, instead of --spp (ray casting and Whitted
    /// ray tracing) [0.1 when no number is given]
    #[arg(long, value_name = "THRESHOLD", num_args = 0..=1, default_missing_value = "0.1", value_parser = parse_fraction)]
    pub(crate) adaptive: Option<f32>,

    /// How often --adaptive halves a pixel: into 2^N squares a side at most
    #[arg(long, value_name = "N", default_value_t = 4, requires = "adaptive", value_parser = clap::value_parser!(u32).range(0..=i64::from(LEVEL_LIMIT)))]
    pub(crate) adaptive_level: u32,

    /// Shadow rays (scan line has none)
    #[arg(long, value_enum, default_value_t = OnOff::On)]
    pub(crate) shadows: OnOff,

    /// Light emissive surfaces give: N point lights a side of each (N×N), or "ignore": they glow but light nothing
    #[arg(long, value_name = "N|ignore", default_value = "5")]
    pub(crate) emitters: Emitters,

    /// Shadows of environments and discrete environments
    #[arg(long, value_enum, default_value_t = OnOff::Off)]
    pub(crate) environment_shadows: OnOff,

    /// Where highlights are seen from: the eye point, or infinitely far away
    #[arg(long, value_enum, default_value_t = Viewer::Local)]
    pub(crate) viewer: Viewer,

    /// Give a scene of which nothing would be seen a headlight and a soft sky (said when it happens)
    #[arg(long, value_enum, default_value_t = OnOff::On)]
    pub(crate) default_light: OnOff,

    /// Brightness of the picture: a factor, or "auto" [default: 1 for radiometric scenes, auto for photometric ones]
    #[arg(long, value_name = "FACTOR|auto")]
    pub(crate) exposure: Option<Exposure>,

    /// How light becomes display values
    #[arg(long, value_enum, default_value_t = ToneMap::Clamp)]
    pub(crate) tone_map: ToneMap,

    #[command(flatten)]
    pub(crate) scene: SceneChanges,

    #[command(flatten)]
    pub(crate) radiosity: Radiosity,

    /// Show this solution, made by `solve` of the same scene
    #[arg(long, value_name = "FILE", help_heading = "Radiosity")]
    pub(crate) solution: Option<PathBuf>,

    /// Where pictures of radiosity have the light of points, spots and suns from
    #[arg(long, value_enum, default_value_t = Lamps::Sharp, help_heading = "Radiosity")]
    pub(crate) lamps: Lamps,

    /// Which quantity of a radiosity solution the picture holds
    #[arg(long, value_enum, default_value_t = Show::Radiance, help_heading = "Radiosity")]
    pub(crate) show: Show,

    /// Spread what an unfinished solution has not sent out yet evenly over all surfaces, in the picture only (the ambient term of progressive refinement)
    #[arg(long, help_heading = "Radiosity")]
    pub(crate) ambient_term: bool,

    /// Lines drawn over the picture, in .png files (several separated by commas)
    #[arg(long, value_enum, value_name = "WHAT", value_delimiter = ',', help_heading = "Radiosity")]
    pub(crate) overlay: Vec<Overlay>,

    /// The pixel that shows the element whose links --overlay links draws, from the top left [default: the element that receives most]
    #[arg(long, value_name = "X,Y", value_parser = parse_pixel, help_heading = "Radiosity")]
    pub(crate) links_of: Option<[u32; 2]>,

    /// Rays of a final gather, at least: where they are noisy the cache takes up to six times as many
    #[arg(long, value_name = "N", default_value_t = 256, value_parser = clap::value_parser!(u32).range(1..=1_000_000), help_heading = "Hybrid")]
    pub(crate) gather: u32,

    /// How far gathers are interpolated: about the relative error allowed to the irradiance cache; 0: a gather at every camera sample
    #[arg(long, value_name = "X", default_value_t = 0.2, value_parser = parse_fraction, help_heading = "Hybrid")]
    pub(crate) cache: f32,

    /// Keep what was gathered in this file (.gathers), and begin with what it holds: further views of the same scene take less
    #[arg(long, value_name = "FILE", conflicts_with = "solution", help_heading = "Hybrid")]
    pub(crate) gathers: Option<PathBuf>,
}

impl Picture {
    /// How many samples a pixel has, where their number is fixed.
    pub(crate) fn samples_a_pixel(&self) -> u32 {
        self.spp.unwrap_or(if self.method == Method::Path { 16 } else { 4 })
    }
}

/// What is changed in a scene, whatever is then done with it.
#[derive(Args, Clone, Debug, PartialEq)]
#[command(next_help_heading = "The scene")]
pub(crate) struct SceneChanges {
    /// Light the scene with an environment map (.hdr, .exr), "none" to remove the scene's own, or a constant radiance r,g,b
    #[arg(long, value_name = "FILE|none|R,G,B")]
    pub(crate) environment: Option<String>,

    /// Global ambient light I_a (the local models' k_a I_a)
    #[arg(long, value_name = "R,G,B", value_parser = parse_color)]
    pub(crate) ambient: Option<[f32; 3]>,

    /// What the camera sees behind everything
    #[arg(long, value_name = "R,G,B", value_parser = parse_color)]
    pub(crate) background: Option<[f32; 3]>,

    /// Give a value of the scene file another, such as material.ball.phong.diffuse=0.3 (repeatable; VALUE is TOML, bare words are strings)
    #[arg(long, value_name = "PATH=VALUE")]
    pub(crate) set: Vec<Override>,

    /// How textures are read between their texels: as the scene says, or all of them one way
    #[arg(long, value_enum, default_value_t = TextureFilter::Scene)]
    pub(crate) texture_filter: TextureFilter,

    /// See through transparent things; off makes them opaque (holes cut by masks stay)
    #[arg(long, value_enum, default_value_t = OnOff::On)]
    pub(crate) blending: OnOff,

    /// Which axis of the input file points up [default: y]
    #[arg(long, value_enum)]
    pub(crate) up: Option<Up>,

    /// Metres per unit of the input file [default: 1]
    #[arg(long, value_name = "FACTOR", value_parser = parse_scale)]
    pub(crate) scale: Option<f64>,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Method {
    /// The best for the scene; says which and why
    Auto,
    /// One ray a pixel sample, local reflection models, shadow rays
    Raycast,
    /// Ray casting that follows mirrors and glass
    Whitted,
    /// Light from surface to surface, solved for the whole scene before it is looked at
    Radiosity,
    /// Radiosity gathered once more at every pixel; direct light, mirrors and glass by ray tracing
    Hybrid,
    /// The whole rendering equation by random paths: right for everything, with noise that --spp lowers
    Path,
    /// Faces projected, scan converted and z-buffered; local reflection models, no shadows
    Scanline,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Fresnel {
    /// Where the material says so
    Material,
    On,
    Off,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Highlights {
    /// Reflect it by a normalised lobe of the same exponent
    Lobe,
    /// Nothing
    None,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum OnOff {
    On,
    Off,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Interpolation {
    /// One colour a face
    Flat,
    /// Light at the vertices, interpolated
    Gouraud,
    /// The normal interpolated, light at every pixel
    Phong,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Cull {
    /// Both sides of every face are drawn
    None,
    /// Faces seen from behind
    Back,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TextureFilter {
    /// As the scene says
    Scene,
    Nearest,
    Bilinear,
    /// From smaller copies of the pictures, by the size of a pixel
    Mipmap,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Viewer {
    Local,
    Infinite,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Filter {
    Box,
    Tent,
    Gaussian,
    Mitchell,
    BlackmanHarris,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ToneMap {
    /// Values above 1 become 1
    Clamp,
    /// Divide by the largest value of the picture
    #[value(alias = "renormalize")]
    Renormalise,
    /// Compress highlights (Reinhard et al. 2002)
    Reinhard,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Up {
    Y,
    Z,
}
