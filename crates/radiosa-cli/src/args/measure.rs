//! The verb `measure`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::value::parse_scale;
use super::{FalseColor, Radiosity, SceneChanges, Work};

#[derive(Args, Debug)]
pub(crate) struct Measure {
    /// A built-in scene's name, or a .toml, .obj, .gltf or .glb file
    #[arg(default_value = "cornell-box")]
    pub(crate) scene: String,

    /// Sensors, one a line: x y z nx ny nz, in the coordinates of the scene's file ("-" reads standard input)
    #[arg(long, value_name = "FILE", conflicts_with = "grid")]
    pub(crate) points: Option<PathBuf>,

    /// Sensors facing up on a horizontal grid with this spacing in metres, over the floor of the scene
    #[arg(long, value_name = "METRES", value_parser = parse_scale)]
    pub(crate) grid: Option<f64>,

    /// How far above the lowest point of the scene the grid lies, in metres
    #[arg(long, value_name = "METRES", default_value_t = 0.8, value_parser = parse_scale)]
    pub(crate) height: f64,

    /// By which method
    #[arg(short, long, value_enum, default_value_t = MeasureMethod::Radiosity)]
    pub(crate) method: MeasureMethod,

    /// Illuminance in lux and lm/m² also where the scene is radiometric: watts count as this many lumens [179 when no number is given]
    #[arg(long, value_name = "LM/W", num_args = 0..=1, default_missing_value = "179", value_parser = parse_scale)]
    pub(crate) lux: Option<f64>,

    /// Where to write: .csv, .json, or .png for a picture of a grid in false colours (repeatable); standard output, as CSV, when left out
    #[arg(short, long)]
    pub(crate) output: Vec<PathBuf>,

    /// N×N point lights for each emissive surface (method raycast)
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=64))]
    pub(crate) emitters: u32,

    /// Paths from each sensor (method path) [default: together about 16 million]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1 << 28))]
    pub(crate) spp: Option<u32>,

    /// Seed of every random stream
    #[arg(long, default_value_t = 0)]
    pub(crate) seed: u64,

    #[command(flatten)]
    pub(crate) colors: FalseColor,

    #[command(flatten)]
    pub(crate) changes: SceneChanges,

    #[command(flatten)]
    pub(crate) radiosity: Radiosity,

    /// Measure in this solution, made by `solve` of the same scene
    #[arg(long, value_name = "FILE", help_heading = "Radiosity")]
    pub(crate) solution: Option<PathBuf>,

    #[command(flatten)]
    pub(crate) work: Work,

    /// The options that were given, by name.
    #[arg(skip)]
    pub(crate) given: Vec<String>,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum MeasureMethod {
    /// Light that has gone from surface to surface any number of times
    Radiosity,
    /// The same, gathered once more at every sensor from what is around it by rays, with direct light by random points of lamps
    Hybrid,
    /// The same by random paths from every sensor, whatever the surfaces are
    Path,
    /// Light that comes from lamps directly
    Raycast,
}
