//! The verb `solve`.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;

use super::value::{self, Exposure};
use super::{Radiosity, SceneChanges, Work};

#[derive(Args, Debug)]
pub(crate) struct Solve {
    /// A built-in scene's name, or a .toml, .obj, .gltf or .glb file
    #[arg(default_value = "cornell-box")]
    pub(crate) scene: String,

    /// Where the solution goes: a .radiosa file; the scene's name with that ending when left out
    #[arg(short, long)]
    pub(crate) output: Option<PathBuf>,

    /// Also write the elements with their light at the vertices: .glb, .gltf or .ply (repeatable)
    #[arg(long, value_name = "FILE")]
    pub(crate) export: Vec<PathBuf>,

    /// Colours of exported vertices are radiances times this factor, or "auto"
    #[arg(long, value_name = "FACTOR", default_value = "auto")]
    pub(crate) exposure: Exposure,

    /// Go on from the solution that is there, to the same result as if nothing had been interrupted; begin where there is none
    #[arg(long)]
    pub(crate) resume: bool,

    /// Save what there is about this often
    #[arg(long, value_name = "DURATION", default_value = "60s", value_parser = value::parse_duration)]
    pub(crate) save_every: Duration,

    /// Seed of every random stream
    #[arg(long, default_value_t = 0)]
    pub(crate) seed: u64,

    #[command(flatten)]
    pub(crate) changes: SceneChanges,

    #[command(flatten)]
    pub(crate) radiosity: Radiosity,

    #[command(flatten)]
    pub(crate) work: Work,

    /// The options that were given, by name.
    #[arg(skip)]
    pub(crate) given: Vec<String>,
}
