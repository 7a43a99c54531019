//! The options of `sheet`.

use std::path::PathBuf;

use clap::Args;

use super::{Picture, Work};

const AFTER: &str = "\
PARAM is what changes from row to row or from column to column:
  a value of the scene file by its path  light.sun.intensity=0.5,1,2
  an option of a picture                 method=raycast,whitted
  the layer that is shown                layer=ambient,diffuse,specular,color
  the scene                              scene=room,whitted
Values stand between commas; one that has commas itself stands in brackets:
  ambient=0,[0.1,0.1,0.3]

Every cell is what `radiosa render` makes of the same settings; --size is that of one cell
(256 pixels on the longer side when not given). One exposure and tone map holds for the whole
sheet, so that cells can be compared; --own-exposure gives each cell its own.

Examples:
  radiosa sheet --list
  radiosa sheet --figure diffuse-ambient
  radiosa sheet whitted --rows max-depth=1,2,6 --columns material.glass.blinn_phong.ior=1.1,1.5";

#[derive(Args, Debug)]
#[command(after_help = AFTER)]
pub(crate) struct Sheet {
    /// A built-in scene's name, or a .toml, .obj, .gltf or .glb file [default: cornell-box]
    pub(crate) scene: Option<String>,

    /// What changes from row to row
    #[arg(long, value_name = "PARAM=V1,V2,…")]
    pub(crate) rows: Option<String>,

    /// What changes from column to column
    #[arg(long, value_name = "PARAM=V1,V2,…")]
    pub(crate) columns: Option<String>,

    /// A figure that is built in, instead of a scene, rows and columns
    #[arg(long, value_name = "NAME", conflicts_with_all = ["scene", "rows", "columns"])]
    pub(crate) figure: Option<String>,

    /// List the built-in figures
    #[arg(long, conflicts_with_all = ["scene", "rows", "columns", "figure"])]
    pub(crate) list: bool,

    /// Where to write the sheet, a .png [default: the figure's name, or sheet.png]
    #[arg(short, long)]
    pub(crate) output: Option<PathBuf>,

    /// What stands above it all [default: the figure's own, or the scene and the parameters]
    #[arg(long, value_name = "TEXT")]
    pub(crate) title: Option<String>,

    /// Name of what the rows change, for their labels; `k_d` shows a subscript
    #[arg(long, value_name = "TEXT")]
    pub(crate) row_name: Option<String>,

    /// Name of what the columns change
    #[arg(long, value_name = "TEXT")]
    pub(crate) column_name: Option<String>,

    /// Expose and tone-map every cell by itself
    #[arg(long)]
    pub(crate) own_exposure: bool,

    #[command(flatten)]
    pub(crate) picture: Picture,

    #[command(flatten)]
    pub(crate) work: Work,

    /// The options that were given, by name: they count more than a figure's own.
    #[arg(skip)]
    pub(crate) given: Vec<String>,
}
