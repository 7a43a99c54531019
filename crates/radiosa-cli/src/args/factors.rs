//! The options of `factors`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::Work;

const AFTER: &str = "\
The factor from I to J is the fraction of what leaves I, evenly and in all directions alike, that
arrives at J without detours. What stands between them blocks, whatever it is made of. A surface
emits and receives on the side on which its corners run counter-clockwise; with --two-sided on both,
and its area counts twice.

The output has one line for each ordered pair with a factor above zero:
  .csv  from,to,area_from,factor,stderr
  .mtx  MatrixMarket     .npz  NumPy and SciPy (scipy.sparse.load_npz)

Examples:
  radiosa factors cornell-box --by object
  radiosa factors room --by material --estimator hemisphere --rays 65536 -o room.csv
  radiosa factors cornell-box --by patch --elements 500 -o cornell-box.npz";

#[derive(Args, Debug)]
#[command(after_help = AFTER)]
pub(crate) struct Factors {
    /// A built-in scene's name, or a .toml, .obj, .gltf, .glb, .stl or .vs3 file
    pub(crate) scene: String,

    /// Where to write: .csv, .mtx or .npz (repeatable); the scene's name with -factors.csv when left out
    #[arg(short, long)]
    pub(crate) output: Vec<PathBuf>,

    /// What factors are between: objects (OBJ objects and groups, glTF nodes) by name, materials by name, or the scene's faces by number from 0
    /// (triangles that make a quadrilateral together count as one; the cells of a divided face as one each)
    #[arg(long, value_enum, default_value_t = By::Object)]
    pub(crate) by: By,

    /// How factors are estimated
    #[arg(long, value_enum, default_value_t = Estimator::Analytic)]
    pub(crate) estimator: Estimator,

    /// Surfaces emit and receive on both sides
    #[arg(long)]
    pub(crate) two_sided: bool,

    /// Rings of quadrilaterals made of a sphere, twice as many around; discs have as many around, and half as many rings
    #[arg(long, value_name = "N", default_value_t = 12, value_parser = clap::value_parser!(u32).range(2..=256))]
    pub(crate) sphere_rings: u32,

    /// Divide surfaces into elements with edges no longer than this, metres
    #[arg(long, value_name = "METRES", value_parser = parse_positive, conflicts_with = "elements")]
    pub(crate) size: Option<f64>,

    /// Divide surfaces into about this many elements beyond one each
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=10_000_000))]
    pub(crate) elements: Option<u32>,

    /// Error wanted of a factor (analytic): shadows are cut out exactly where no more than 1024 polygons are in the way, and sampled by rays where there are more
    #[arg(long, value_name = "X", default_value_t = 3e-5, value_parser = parse_positive)]
    pub(crate) tolerance: f64,

    /// Sample shadows by rays even where they could be cut out (analytic): less exact, sooner
    #[arg(long)]
    pub(crate) sampled_shadows: bool,

    /// Rays of an element (hemisphere); pairs of points of two elements (area), or rays between them, at most 64 (analytic with sampled shadows)
    /// [default: 4096; 64; 64]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1 << 28))]
    pub(crate) rays: Option<u32>,

    /// Source points of an element: 1 is its centre (hemicube, hemisphere) [default: 16; one for each ray]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1 << 28))]
    pub(crate) points: Option<u32>,

    /// Pixels across a face (hemicube)
    #[arg(long, value_name = "N", default_value_t = 128, value_parser = clap::value_parser!(u32).range(2..=4096))]
    pub(crate) resolution: u32,

    /// Directions and their weights (hemisphere): equal cells of both angles, the lecture's nodes, points of the disc below, or independent ones
    #[arg(long, value_enum, default_value_t = Rule::Nusselt)]
    pub(crate) rule: Rule,

    /// What the area estimator sums: the kernel between points, or that of discs around them
    #[arg(long, value_enum, default_value_t = Kernel::Point)]
    pub(crate) kernel: Kernel,

    /// Enforce afterwards that factors are reciprocal, or also that rows sum to one (closed scenes)
    #[arg(long, value_enum, default_value_t = Correct::None)]
    pub(crate) correct: Correct,

    /// What a medium between surfaces absorbs, per metre: factors are of what arrives through it, and rows sum to less
    #[arg(long, value_name = "SIGMA", default_value_t = 0.0, value_parser = parse_not_negative)]
    pub(crate) absorption: f64,

    /// Seed of every random stream
    #[arg(long, default_value_t = 0)]
    pub(crate) seed: u64,

    #[command(flatten)]
    pub(crate) work: Work,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum By {
    Object,
    Material,
    Patch,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Estimator {
    /// Exact factors of polygons, less what is in shadow
    Analytic,
    /// Drawing what an element sees on half a cube
    Hemicube,
    /// Rays in all directions
    Hemisphere,
    /// The double integral over both areas, sampled
    Area,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Rule {
    Cells,
    Nodal,
    Nusselt,
    Random,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kernel {
    Point,
    Disc,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Correct {
    None,
    Reciprocity,
    Closure,
}

fn parse_not_negative(s: &str) -> Result<f64, String> {
    s.parse::<f64>().ok().filter(|x| x.is_finite() && *x >= 0.0).ok_or_else(|| "give a number that is not negative".into())
}

fn parse_positive(s: &str) -> Result<f64, String> {
    match s.parse::<f64>() {
        Ok(x) if x.is_finite() && x > 0.0 => Ok(x),
        _ => Err("give a number above zero".into()),
    }
}
