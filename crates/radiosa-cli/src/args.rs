//! Every option of the command, defined once; help and completions derive from it.

use std::path::PathBuf;
use std::str::FromStr;
use std::time::Duration;

use clap::{Args, Parser, Subcommand, ValueEnum};

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

#[derive(Subcommand, Debug)]
pub(crate) enum Verb {
    /// Make a picture of a scene
    Render(Box<Render>),
    /// List the built-in scenes, or write one as files
    Scenes(Scenes),
    /// Show the recipe inside a picture: how it was made
    Info(Info),
}

#[derive(Args, Debug)]
pub(crate) struct Info {
    /// A picture made by radiosa (.png, .exr, .hdr)
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

    /// How to light it
    #[arg(short, long, value_enum, default_value_t = Method::Auto)]
    pub(crate) method: Method,

    /// Where to write: .png, .exr or .hdr (repeatable); the scene's name with .png when left out
    #[arg(short, long)]
    pub(crate) output: Vec<PathBuf>,

    /// Picture size in pixels [default: the camera's shape, 800 pixels on the longer side]
    #[arg(long, value_name = "WxH")]
    pub(crate) size: Option<Size>,

    /// A camera of the scene by name or index from 0, or "auto" to frame the scene [default: the first, or auto]
    #[arg(long, value_name = "NAME|INDEX")]
    pub(crate) camera: Option<String>,

    /// Samples a pixel
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=65536))]
    pub(crate) spp: u32,

    /// Reconstruction filter
    #[arg(long, value_enum, default_value_t = Filter::Box)]
    pub(crate) filter: Filter,

    /// Seed of every random stream
    #[arg(long, default_value_t = 0)]
    pub(crate) seed: u64,

    /// Threads to use [default: one a processor]; the result does not depend on it
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,

    /// Stop after this long and write what there is, such as 30s or 2m
    #[arg(long, value_name = "DURATION", value_parser = parse_duration)]
    pub(crate) time: Option<Duration>,

    /// Shadow rays
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

    /// Light the scene with an environment map (.hdr, .exr), "none" to remove the scene's own, or a constant radiance r,g,b
    #[arg(long, value_name = "FILE|none|R,G,B")]
    pub(crate) environment: Option<String>,

    /// Global ambient light I_a (the local models' k_a I_a)
    #[arg(long, value_name = "R,G,B", value_parser = parse_color)]
    pub(crate) ambient: Option<[f32; 3]>,

    /// What the camera sees behind everything
    #[arg(long, value_name = "R,G,B", value_parser = parse_color)]
    pub(crate) background: Option<[f32; 3]>,

    /// Brightness of the picture: a factor, or "auto" [default: 1 for radiometric scenes, auto for photometric ones]
    #[arg(long, value_name = "FACTOR|auto")]
    pub(crate) exposure: Option<Exposure>,

    /// How light becomes display values
    #[arg(long, value_enum, default_value_t = ToneMap::Clamp)]
    pub(crate) tone_map: ToneMap,

    /// Bits a channel of PNG files
    #[arg(long, value_enum, default_value_t = Bits::Eight)]
    pub(crate) bits: Bits,

    /// 16-bit instead of 32-bit floats in EXR files
    #[arg(long)]
    pub(crate) half: bool,

    /// Layers of EXR files: all, none, or a list of lobe, path, albedo, normal, depth, position, object
    #[arg(long, value_delimiter = ',', default_value = "all")]
    pub(crate) layers: Vec<LayerChoice>,

    /// Which axis of the input file points up [default: y]
    #[arg(long, value_enum)]
    pub(crate) up: Option<Up>,

    /// Metres per unit of the input file [default: 1]
    #[arg(long, value_name = "FACTOR", value_parser = parse_scale)]
    pub(crate) scale: Option<f64>,

    /// A folder outside its own that the scene may read from (repeatable)
    #[arg(long, value_name = "DIR")]
    pub(crate) allow_outside: Vec<PathBuf>,

    /// Most memory to use, such as 4G or 500M
    #[arg(long, value_name = "SIZE", default_value = "16G", value_parser = parse_memory)]
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
pub(crate) enum Method {
    /// The best for the scene; says which and why
    Auto,
    /// One ray a pixel sample, local reflection models, shadow rays
    Raycast,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum OnOff {
    On,
    Off,
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
pub(crate) enum Bits {
    #[value(name = "8")]
    Eight,
    #[value(name = "16")]
    Sixteen,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Up {
    Y,
    Z,
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
    Object,
}

/// Picture size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Size {
    pub(crate) width: u32,
    pub(crate) height: u32,
}

impl FromStr for Size {
    type Err = String;
    fn from_str(s: &str) -> Result<Self, String> {
        let (w, h) = s.split_once(['x', 'X', '×']).ok_or("write it as WIDTHxHEIGHT, such as 800x600")?;
        let side = |t: &str| match t.trim().parse::<u32>() {
            Ok(n @ 1..=65536) => Ok(n),
            _ => Err(format!("{t:?} is not a number of pixels from 1 to 65536")),
        };
        Ok(Self { width: side(w)?, height: side(h)? })
    }
}

/// `--emitters`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Emitters {
    Ignore,
    Sample(u32),
}

impl FromStr for Emitters {
    type Err = String;
    fn from_str(s: &str) -> Result<Self, String> {
        match (s, s.parse::<u32>()) {
            ("ignore", _) => Ok(Self::Ignore),
            (_, Ok(n @ 1..=64)) => Ok(Self::Sample(n)),
            _ => Err("give a number from 1 to 64, or \"ignore\"".into()),
        }
    }
}

/// `--exposure`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Exposure {
    Auto,
    Factor(f32),
}

impl FromStr for Exposure {
    type Err = String;
    fn from_str(s: &str) -> Result<Self, String> {
        match (s, s.parse::<f32>()) {
            ("auto", _) => Ok(Self::Auto),
            (_, Ok(f)) if f.is_finite() && f > 0.0 => Ok(Self::Factor(f)),
            _ => Err("give a factor above zero, or \"auto\"".into()),
        }
    }
}

pub(crate) fn parse_color(s: &str) -> Result<[f32; 3], String> {
    let values: Vec<f32> = s
        .split(',')
        .map(|t| t.trim().parse::<f32>().ok().filter(|v| v.is_finite() && *v >= 0.0))
        .collect::<Option<_>>()
        .ok_or("give one number, or three separated by commas, none negative")?;
    match values[..] {
        [v] => Ok([v; 3]),
        [r, g, b] => Ok([r, g, b]),
        _ => Err("give one number, or three separated by commas".into()),
    }
}

fn parse_scale(s: &str) -> Result<f64, String> {
    s.parse::<f64>().ok().filter(|v| v.is_finite() && *v > 0.0).ok_or_else(|| "give a number above zero".into())
}

fn parse_duration(s: &str) -> Result<Duration, String> {
    let advice = || "give a duration such as 30s, 2m or 1h".to_owned();
    let split = s.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(s.len());
    let factor = match &s[split..] {
        "" | "s" => 1.0,
        "ms" => 1e-3,
        "m" | "min" => 60.0,
        "h" => 3600.0,
        _ => return Err(advice()),
    };
    let value: f64 = s[..split].parse().map_err(|_| advice())?;
    Duration::try_from_secs_f64(value * factor).map_err(|_| advice())
}

fn parse_memory(s: &str) -> Result<u64, String> {
    let advice = || "give a size such as 500M or 4G".to_owned();
    let split = s.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(s.len());
    let shift = match s[split..].to_ascii_uppercase().trim_end_matches("IB").trim_end_matches('B') {
        "" => 0,
        "K" => 10,
        "M" => 20,
        "G" => 30,
        "T" => 40,
        _ => return Err(advice()),
    };
    let value: f64 = s[..split].parse().map_err(|_| advice())?;
    if value.is_finite() && value > 0.0 { Ok((value * (1u64 << shift) as f64) as u64) } else { Err(advice()) }
}
