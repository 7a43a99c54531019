//! Every option of the command, defined once; help and completions derive from it.

pub(crate) mod factors;
mod false_color;
mod measure;
mod picture;
mod radiosity;
mod sheet;
mod solve;
mod value;

pub(crate) use false_color::{FalseColor, Palette, ScaleKind};
pub(crate) use measure::{Measure, MeasureMethod};
pub(crate) use picture::{
    Cull, Filter, Fresnel, Highlights, Interpolation, Method, OnOff, Picture, SceneChanges, TextureFilter, ToneMap, Up, Viewer,
};
pub(crate) use radiosity::{Lamps, Order, Overlay, Radiosity, Show, Solver, Spread};
pub(crate) use sheet::Sheet;
pub(crate) use solve::Solve;
pub(crate) use value::{Emitters, Exposure, Size, parse_color};

use std::path::PathBuf;
use std::time::Duration;

use clap::parser::ValueSource;
use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand, ValueEnum};

/// One engine for light: a scene goes in; light comes out as pictures or numbers.
#[derive(Parser, Debug)]
#[command(name = "radiosa", disable_version_flag = true, max_term_width = 110)]
pub(crate) struct Arguments {
    /// Print the version (with --json: also commit, features and CPU path)
    #[arg(short = 'V', long)]
    pub(crate) version: bool,

    /// Print one JSON object about what was done on standard output, and nothing else there
    #[arg(long, global = true)]
    pub(crate) json: bool,

    #[command(subcommand)]
    pub(crate) verb: Option<Verb>,
}

impl Arguments {
    /// What was typed; ends the program where it is misuse or asks for help.
    pub(crate) fn read() -> Self {
        // A number below zero is a value that is refused with its range, not an option that nobody knows.
        let of_verb = |verb: clap::Command| {
            verb.mut_args(
                |a| if a.get_action().takes_values() && !a.is_positional() { a.allow_negative_numbers(true) } else { a },
            )
        };
        let matches = Self::command().mut_subcommands(of_verb).get_matches();
        let mut arguments = Self::from_arg_matches(&matches).unwrap_or_else(|e| e.exit());
        let given = match &mut arguments.verb {
            Some(Verb::Sheet(sheet)) => &mut sheet.given,
            Some(Verb::Render(render)) => &mut render.given,
            Some(Verb::Measure(measure)) => &mut measure.given,
            Some(Verb::Solve(solve)) => &mut solve.given,
            _ => return arguments,
        };
        if let Some((_, matches)) = matches.subcommand() {
            let typed = |id: &&clap::Id| matches.value_source(id.as_str()) == Some(ValueSource::CommandLine);
            *given = matches.ids().filter(typed).map(|id| id.as_str().replace('_', "-")).collect();
        }
        arguments
    }
}

#[derive(Subcommand, Debug)]
pub(crate) enum Verb {
    /// Make a picture of a scene
    Render(Box<Render>),
    /// Make a labelled sheet of pictures over any two parameters, or a built-in figure
    Sheet(Box<Sheet>),
    /// Solve for the light between diffuse surfaces: a solution for any camera, to look at, measure and export
    Solve(Box<Solve>),
    /// Measure irradiance or illuminance at points or on a grid
    Measure(Box<Measure>),
    /// Form factors (view factors) between named surfaces, materials or all faces of a scene
    Factors(Box<factors::Factors>),
    /// List the built-in scenes, or write one as files
    Scenes(Scenes),
    /// Show the recipe inside a picture or a solution: how it was made
    Info(Info),
}

#[derive(Args, Debug)]
pub(crate) struct Info {
    /// A file made by radiosa (.png, .exr, .hdr, .radiosa)
    pub(crate) file: PathBuf,
}

#[derive(Args, Debug)]
pub(crate) struct Scenes {
    #[command(subcommand)]
    pub(crate) action: Option<ScenesAction>,
}

#[derive(Subcommand, Debug)]
pub(crate) enum ScenesAction {
    /// Write a built-in scene as a scene file
    Export {
        /// Its name
        name: String,
        /// Where to; the scene's name with .toml in the current folder when left out
        #[arg(short, long)]
        output: Option<PathBuf>,
        /// Replace a file that exists
        #[arg(long)]
        force: bool,
    },
}

#[derive(Args, Debug)]
pub(crate) struct Render {
    /// A built-in scene's name, or a .toml, .obj, .gltf or .glb file
    #[arg(default_value = "cornell-box")]
    pub(crate) scene: String,

    /// Where to write: .png, .exr or .hdr (repeatable); the scene's name with .png when left out
    #[arg(short, long)]
    pub(crate) output: Vec<PathBuf>,

    #[command(flatten)]
    pub(crate) picture: Picture,

    #[command(flatten)]
    pub(crate) colors: FalseColor,

    /// Bits a channel of PNG files
    #[arg(long, value_enum, default_value_t = Bits::Eight)]
    pub(crate) bits: Bits,

    /// 16-bit instead of 32-bit floats in EXR files
    #[arg(long)]
    pub(crate) half: bool,

    /// Layers of EXR files: all, none, or a list of lobe, path, albedo, normal, depth, position, variance, object
    #[arg(long, value_delimiter = ',', default_value = "all")]
    pub(crate) layers: Vec<LayerChoice>,

    /// Go on from where it was interrupted, to the same picture as if it had not been (path tracing); begin where nothing was kept
    #[arg(long)]
    pub(crate) resume: bool,

    /// Keep what there is about this often, beside the first output, until the picture is done (path tracing)
    #[arg(long, value_name = "DURATION", default_value = "60s", value_parser = value::parse_duration)]
    pub(crate) save_every: Duration,

    #[command(flatten)]
    pub(crate) work: Work,

    /// The options that were given, by name.
    #[arg(skip)]
    pub(crate) given: Vec<String>,
}

/// What the work may touch and take; none of it changes a finished picture.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "The work")]
pub(crate) struct Work {
    /// Threads to use [default: one a processor]; the result does not depend on it
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,

    /// Stop after this long and write what there is, such as 30s or 2m
    #[arg(long, value_name = "DURATION", value_parser = value::parse_duration)]
    pub(crate) time: Option<Duration>,

    /// A folder outside its own that the scene may read from (repeatable)
    #[arg(long, value_name = "DIR")]
    pub(crate) allow_outside: Vec<PathBuf>,

    /// Most memory to use, such as 4G or 500M
    #[arg(long, value_name = "SIZE", default_value = "16G", value_parser = value::parse_memory)]
    pub(crate) max_memory: u64,

    /// Instruction set of the kernels
    #[arg(long, value_enum, default_value_t = CpuPath::Auto)]
    pub(crate) cpu_path: CpuPath,

    /// Say nothing but errors
    #[arg(short, long, conflicts_with = "verbose")]
    pub(crate) quiet: bool,

    /// Say more
    #[arg(short, long)]
    pub(crate) verbose: bool,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Bits {
    #[value(name = "8")]
    Eight,
    #[value(name = "16")]
    Sixteen,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum CpuPath {
    /// The best this processor has
    Auto,
    Avx2,
    /// The same bits on any x86-64
    Portable,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LayerChoice {
    All,
    None,
    Lobe,
    Path,
    Albedo,
    Normal,
    Depth,
    Position,
    /// Of each pixel's mean, and how many samples it is of
    Variance,
    Object,
}
