//! Light as numbers that can be read off a picture.

use clap::{Args, ValueEnum};

use super::value::parse_range;

/// False colours instead of a photograph.
#[derive(Args, Clone, Debug, PartialEq)]
#[command(next_help_heading = "False colour")]
pub(crate) struct FalseColor {
    /// Show luminance or illuminance by a scale of colours with a legend, in .png files [viridis when no palette is given]
    #[arg(long, value_enum, value_name = "PALETTE", num_args = 0..=1, default_missing_value = "viridis")]
    pub(crate) false_color: Option<Palette>,

    /// Equal steps of colour are equal differences, or equal ratios
    #[arg(long, value_enum, default_value_t = ScaleKind::Linear)]
    pub(crate) color_scale: ScaleKind,

    /// Values of the first and the last colour [default: by what is seen]
    #[arg(long, value_name = "LOW,HIGH", value_parser = parse_range)]
    pub(crate) color_range: Option<(f64, f64)>,

    /// Lines between so many equal bands of the scale
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true, value_parser = clap::value_parser!(u32).range(0..=100))]
    pub(crate) contours: u32,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Palette {
    /// Violet, green, yellow
    Viridis,
    /// Blue, grey, yellow: much the same to everybody's eyes
    Cividis,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ScaleKind {
    Linear,
    Log,
}
