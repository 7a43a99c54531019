//! The figures that are built in: the files in `scenes/figures`, carried inside the command.

use radiosa::import::{self, ImportError, Override};
use radiosa::scene::Scene;
use serde::Deserialize;

use super::axis::{Axis, Change, Entry};
use crate::args::Size;
use crate::error::Error;

macro_rules! files {
    ($($name:literal),*) => {
        &[$(($name, include_str!(concat!("../../../../scenes/figures/", $name, ".toml")))),*]
    };
}

/// The figures by name.
const FIGURES: &[(&str, &str)] = files![
    "diffuse-ambient",
    "specular-exponent",
    "components",
    "phong-cook-torrance",
    "light-types",
    "methods",
    "interpolation"
];

/// Scenes made for figures only.
const SCENES: &[(&str, &str)] = files!["ball", "still-life"];

/// A figure: which scene, and what changes in it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FigureTable {
    about: String,
    title: String,
    scene: String,
    /// The size of a cell.
    size: [u32; 2],
    /// Parameters all cells share.
    #[serde(default)]
    with: toml::Table,
    #[serde(default)]
    own_exposure: bool,
    #[serde(default)]
    rows: AxisTable,
    #[serde(default)]
    columns: AxisTable,
}

/// One parameter with values, or entries that change several.
#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct AxisTable {
    name: Option<String>,
    parameter: Option<String>,
    values: Vec<toml::Value>,
    entry: Vec<EntryTable>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct EntryTable {
    label: String,
    with: toml::Table,
}

/// A figure, ready to be drawn.
pub(crate) struct Figure {
    pub(crate) about: String,
    pub(crate) title: String,
    pub(crate) scene: String,
    pub(crate) size: Size,
    pub(crate) with: Vec<Change>,
    pub(crate) own_exposure: bool,
    pub(crate) rows: Axis,
    pub(crate) columns: Axis,
}

/// Names and what they show.
pub(crate) fn list() -> Result<Vec<(&'static str, String)>, Error> {
    FIGURES.iter().map(|(name, _)| Ok((*name, get(name)?.about))).collect()
}

/// The figure of that name.
///
/// # Errors
/// When there is none.
pub(crate) fn get(name: &str) -> Result<Figure, Error> {
    let names = || FIGURES.iter().map(|(n, _)| *n);
    let (_, text) = FIGURES.iter().find(|(n, _)| *n == name).ok_or_else(|| {
        let near = import::nearest(name, names()).map(|n| format!("did you mean {n:?}? ")).unwrap_or_default();
        Error::failed(
            format!("there is no figure {name:?}"),
            format!("{near}Built-in figures are {}", names().collect::<Vec<_>>().join(", ")),
        )
    })?;
    let table: FigureTable =
        toml::from_str(text).map_err(|e| Error::failed(format!("the figure {name:?} is wrong: {e}"), "this is a bug"))?;
    Ok(Figure {
        about: table.about,
        title: table.title,
        scene: table.scene,
        size: Size { width: table.size[0], height: table.size[1] },
        with: changes(&table.with)?,
        own_exposure: table.own_exposure,
        rows: axis(table.rows)?,
        columns: axis(table.columns)?,
    })
}

/// The scene of that name made for figures, `None` when there is none.
pub(crate) fn scene(name: &str, overrides: &[Override]) -> Option<Result<Scene, ImportError>> {
    let (_, text) = SCENES.iter().find(|(n, _)| *n == name)?;
    let path = format!("{name}.toml");
    let read = import::load_bytes_with(text.as_bytes(), path.as_ref(), overrides, &import::Options::default());
    Some(read.map(|(scene, _)| scene))
}

fn axis(table: AxisTable) -> Result<Axis, Error> {
    if let Some(parameter) = &table.parameter {
        let values: Vec<String> = table.values.iter().map(written).collect();
        return Axis::new(parameter, table.name.as_deref(), &values);
    }
    if table.entry.is_empty() {
        return Ok(Axis::none());
    }
    let entries = table.entry.into_iter().map(|e| Ok(Entry { changes: changes(&e.with)?, label: e.label }));
    Ok(Axis { what: table.name.unwrap_or_default(), entries: entries.collect::<Result<_, Error>>()? })
}

fn changes(table: &toml::Table) -> Result<Vec<Change>, Error> {
    table.iter().map(|(parameter, value)| Change::new(parameter, &written(value))).collect()
}

/// A value as one would write it on the command line.
fn written(value: &toml::Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_figure_is_well_formed_and_says_what_it_shows() {
        for (name, about) in list().expect("all are well formed") {
            let figure = get(name).expect("it is there");
            assert!(
                !about.is_empty() && !figure.title.is_empty() && figure.rows.entries.len() * figure.columns.entries.len() >= 3,
                "{name}"
            );
        }
    }
}
