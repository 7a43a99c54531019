//! The verb `sheet`: a labelled grid of pictures over any two parameters.
//!
//! Every cell is drawn by the same calls as `render` draws a picture, so it is the same picture. What differs in the layer only is drawn once.

mod axis;
mod figure;
pub(crate) mod label;
pub(crate) mod page;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use radiosa::export::image::{self, Format, Recipe};
use radiosa::film::tone_map::{Prepared, ToneMap};
use radiosa::film::{Film, Layer, Pixel};
use radiosa::import::Warning;
use serde_json::json;

use crate::args::{Picture, Sheet, Size, Work};
use crate::error::Error;
use crate::interrupt;
use crate::render::method::{self, Watch};
use crate::render::output::{self, tell};
use crate::render::plan::{self, Stage};
use axis::{Axis, Cell};
use page::Layout;

/// Cells a sheet has at most.
const MAX_CELLS: usize = 400;
/// Pixels of the longer side of a cell when no size is asked for.
const CELL: f64 = 256.0;

/// What is to be drawn.
struct Plan {
    title: String,
    rows: Axis,
    columns: Axis,
    own_exposure: bool,
    /// Row by row.
    cells: Vec<Cell>,
    output: PathBuf,
}

impl Plan {
    /// The options that change from row to row or from column to column.
    fn options(&self) -> impl Iterator<Item = String> {
        let entries = self.rows.entries.iter().chain(&self.columns.entries);
        entries.flat_map(|entry| &entry.changes).filter_map(|change| change.option().map(str::to_owned))
    }
}

/// A finished cell.
struct Drawn {
    /// What it shows, as colour.
    film: Film,
    method: &'static str,
    samples: String,
    tone_map: ToneMap,
    done: f64,
    /// How much of each pixel lines over it cover.
    lines: Option<Vec<f32>>,
}

pub(crate) fn run(args: &Sheet, json: bool) -> Result<ExitCode, Error> {
    if args.list {
        list(json)?;
        return Ok(ExitCode::SUCCESS);
    }
    crate::render::with_threads(&args.work, || sheet(args, json))
}

fn list(json: bool) -> Result<(), Error> {
    let figures = figure::list()?;
    if json {
        let list: Vec<_> = figures.iter().map(|(name, about)| json!({ "name": name, "about": about })).collect();
        crate::version::say(&json!({ "figures": list }).to_string());
    } else {
        figures.iter().for_each(|(name, about)| crate::version::say(&format!("{name:<20} {about}")));
    }
    Ok(())
}

fn sheet(args: &Sheet, json: bool) -> Result<ExitCode, Error> {
    crate::interrupt::listen();
    let start = Instant::now();
    let mut plan = plan_sheet(args)?;
    check_output(&plan.output)?;
    if plan.cells.iter().any(|cell| cell.picture.gathers.is_some()) {
        let why = "--gathers is not for sheets: their cells differ in what they are made by; leave it out";
        return Err(Error::Misuse(why.to_owned()));
    }
    let work = &args.work;
    let mut warnings = Vec::new();
    let size = cell_size(&plan.cells[0], work, &mut warnings)?;
    plan.cells.iter_mut().for_each(|c| c.picture.size = Some(size));
    let layout = Layout::new(&plan.title, &plan.rows, &plan.columns, size).ok_or_else(|| {
        Error::failed("the sheet would be larger than a picture can be", "ask for a smaller --size, or fewer values")
    })?;
    // The cells and all of them together in linear light, the page and its copies in bytes.
    let pixels = u64::from(layout.width) * u64::from(layout.height);
    plan::within_memory(&format!("a sheet of {}x{}", layout.width, layout.height), 36 * pixels, work)?;

    let options: Vec<String> = plan.options().chain(args.given.iter().cloned()).collect();
    let drawn = draw_all(&plan.cells, &options, work, &mut warnings)?;
    warnings.sort();
    warnings.dedup();
    if !work.quiet {
        output::say_warnings(&warnings);
    }
    let n_columns = plan.columns.entries.len();
    let shown = tone_maps(&drawn, plan.own_exposure, n_columns, size)?;
    let mut page = layout.page();
    for (i, (cell, shown)) in drawn.iter().zip(&shown).enumerate() {
        if let (Some(cell), Some(shown)) = (cell, shown) {
            let mut rgb = shown.to_srgb8(&cell.film);
            if let Some(lines) = &cell.lines {
                output::draw_lines(&mut rgb, lines);
            }
            page.paste(layout.corner(i / n_columns, i % n_columns), size.width, &rgb);
        }
    }
    let recipe = recipe(args, &plan, size, &drawn, &shown);
    image::write_rgb8(&plan.output, page.width, page.height, &page.rgb, &recipe)?;

    let n_done = drawn.iter().flatten().filter(|d| d.done >= 1.0).count();
    if !work.quiet {
        let mut lines = vec![format!("cells       {n_done} of {}, {}x{} each", plan.cells.len(), size.width, size.height)];
        if n_done < plan.cells.len() {
            lines.push("unfinished  run it again to have all of it".into());
        }
        lines.push(format!("time        {:.2} s", start.elapsed().as_secs_f64()));
        lines.push(format!("wrote       {}", plan.output.display()));
        tell(&lines.join("\n"));
    }
    if json {
        let label = |axis: &Axis, i: usize| axis.entries[i].label.clone();
        let cell = |i: usize| {
            let (x, y) = layout.corner(i / n_columns, i % n_columns);
            json!({
                "row": label(&plan.rows, i / n_columns),
                "column": label(&plan.columns, i % n_columns),
                "scene": plan.cells[i].scene,
                "layer": plan.cells[i].layer.name(),
                "method": drawn[i].as_ref().map(|d| d.method),
                "set": plan.cells[i].picture.scene.set.iter().map(ToString::to_string).collect::<Vec<_>>(),
                "mean_radiance": drawn[i].as_ref().map(|d| output::mean(&d.film)),
                "done": drawn[i].as_ref().map_or(0.0, |d| d.done),
                "exposure": shown[i].map(|s| s.factor),
                "at": [x, y],
            })
        };
        let report = json!({
            "title": plan.title,
            "figure": args.figure,
            "rows": plan.rows.what,
            "columns": plan.columns.what,
            "size": [layout.width, layout.height],
            "cell_size": [size.width, size.height],
            "cells": (0..plan.cells.len()).map(cell).collect::<Vec<_>>(),
            "own_exposure": plan.own_exposure,
            "seconds": { "total": start.elapsed().as_secs_f64() },
            "warnings": output::warnings_json(&warnings),
            "outputs": [plan.output],
        });
        crate::version::say(&report.to_string());
    }
    Ok(if interrupt::asked() { ExitCode::from(130) } else { ExitCode::SUCCESS })
}

/// What the command line or a figure asks for.
fn plan_sheet(args: &Sheet) -> Result<Plan, Error> {
    let mut base = Cell {
        scene: args.scene.clone().unwrap_or_else(|| "cornell-box".into()),
        layer: Layer::Color,
        picture: args.picture.clone(),
    };
    let side = |text: &Option<String>, name: &Option<String>| {
        text.as_ref().map_or_else(|| Ok(Axis::none()), |text| Axis::parse(text, name.as_deref()))
    };
    let (rows, columns, title, own, name) = match &args.figure {
        Some(name) => {
            let figure = figure::get(name)?;
            base.scene = figure.scene;
            // What stands on the command line counts more than what stands in the figure.
            let given = std::mem::take(&mut base.picture.scene.set);
            figure.with.iter().filter(|c| !c.is_one_of(&args.given)).try_for_each(|change| change.apply(&mut base))?;
            base.picture.scene.set.extend(given);
            base.picture.size = base.picture.size.or(Some(figure.size));
            (figure.rows, figure.columns, figure.title, figure.own_exposure, name.as_str())
        }
        None => {
            let (rows, columns) = (side(&args.rows, &args.row_name)?, side(&args.columns, &args.column_name)?);
            if args.rows.is_none() && args.columns.is_none() {
                let help = "say what changes with --rows and --columns, or name a --figure (--list shows them)";
                return Err(Error::Misuse(help.into()));
            }
            if rows.what == columns.what {
                return Err(Error::Misuse(format!(
                    "--rows and --columns both change {:?}: the columns would undo the rows; give them different parameters",
                    rows.what
                )));
            }
            let what: Vec<&str> = [&rows, &columns].iter().map(|a| a.what.as_str()).filter(|w| !w.is_empty()).collect();
            let title = match what.contains(&"scene") {
                true => what.join(" × "),
                false => format!("{}: {}", base.scene, what.join(" × ")),
            };
            (rows, columns, title, false, "sheet")
        }
    };
    let n = rows.entries.len().saturating_mul(columns.entries.len());
    if n > MAX_CELLS {
        return Err(Error::failed(format!("a sheet of {n} cells is more than the {MAX_CELLS} allowed"), "give fewer values"));
    }
    let mut cells = Vec::with_capacity(n);
    for row in &rows.entries {
        for column in &columns.entries {
            let mut cell = base.clone();
            row.changes.iter().chain(&column.changes).try_for_each(|change| change.apply(&mut cell))?;
            cells.push(cell);
        }
    }
    Ok(Plan {
        title: args.title.clone().unwrap_or(title),
        rows,
        columns,
        own_exposure: own || args.own_exposure,
        cells,
        output: args.output.clone().unwrap_or_else(|| PathBuf::from(format!("{name}.png"))),
    })
}

fn check_output(output: &std::path::Path) -> Result<(), Error> {
    if image::check_target(output)? == Format::Png {
        return Ok(());
    }
    Err(Error::failed(
        format!("a sheet cannot be written as {}", output.display()),
        "it is a picture for a screen: give it the ending .png",
    ))
}

/// The size asked for, or the shape of the first cell's camera.
fn cell_size(cell: &Cell, work: &Work, warnings: &mut Vec<Warning>) -> Result<Size, Error> {
    if let Some(size) = cell.picture.size {
        return Ok(size);
    }
    let Size { width, height } = stage(cell, &[], work, warnings)?.size;
    let scaled = |side: u32| ((f64::from(side) * CELL / f64::from(width.max(height))).round() as u32).max(1);
    Ok(Size { width: scaled(width), height: scaled(height) })
}

fn stage(cell: &Cell, options: &[String], work: &Work, warnings: &mut Vec<Warning>) -> Result<Stage, Error> {
    let scene = match figure::scene(&cell.scene, &cell.picture.scene.set) {
        Some(scene) => plan::adjust(scene?, &cell.picture.scene, work)?,
        None => plan::load(&cell.scene, &cell.picture.scene, work, warnings)?,
    };
    Stage::new(scene, &cell.picture, options, work)
}

/// Draws what there is time for; cells that differ in their layer only share a drawing. Of the `options`, those that have no effect in any cell are said.
fn draw_all(cells: &[Cell], options: &[String], work: &Work, warnings: &mut Vec<Warning>) -> Result<Vec<Option<Drawn>>, Error> {
    let start = Instant::now();
    // What has no effect in one cell may have in another.
    let mut ignored: Vec<Vec<Option<String>>> = options.iter().map(|_| Vec::new()).collect();
    let mut all: Vec<Option<Drawn>> = cells.iter().map(|_| None).collect();
    for i in 0..cells.len() {
        let left = work.time.map(|limit| limit.saturating_sub(start.elapsed()));
        if interrupt::asked() || left.is_some_and(|t| t.is_zero()) {
            break;
        }
        if all[i].is_some() {
            continue;
        }
        let same = |other: &Cell| other.scene == cells[i].scene && other.picture == cells[i].picture;
        let group: Vec<usize> = (i..cells.len()).filter(|&j| same(&cells[j])).collect();
        let mut layers: Vec<Layer> = group.iter().map(|&j| cells[j].layer).collect();
        layers.extend([Layer::Color, Layer::Alpha]);
        let picture: &Picture = &cells[i].picture;
        let stage = stage(&cells[i], options, work, warnings)?;
        let choice = method::choose(picture, &stage, left, options)?;
        let picture = &choice.settle(picture, options);
        plan::within_memory("a cell with its scene", stage.memory_with(&layers) + choice.memory(&stage, picture, &layers), work)?;
        let begun = Instant::now();
        let work = Work { time: left, ..work.clone() };
        let lighting = method::light(&stage, picture, choice, &|| method::is_over(begun, &work));
        options.iter().zip(&mut ignored).for_each(|(option, whys)| whys.push(choice.why_ignored(option, picture)));
        let said = choice.misfits(picture, &stage, &[]).into_iter().chain(lighting.warnings.iter().cloned());
        warnings.extend(said.map(|(name, message)| Warning { name, path: PathBuf::from(&cells[i].scene), message }));
        let watch = Watch::new(&format!("cell {} of {}", i + 1, cells.len()), choice, &work, begun);
        let drawing = method::draw(&stage, picture, choice, &lighting, &layers, (&watch, None))?;
        watch.finish();
        let tone_map = output::tone_map(picture, stage.world.scene(), lighting.is_default);
        for j in group {
            let film = layer_as_color(&drawing.film, cells[j].layer)?;
            let samples = drawing.samples(picture, choice);
            all[j] =
                Some(Drawn { film, method: choice.name(), samples, tone_map, done: drawing.done, lines: drawing.lines.clone() });
        }
    }
    if all.iter().all(Option::is_some) {
        let everywhere = ignored.into_iter().filter_map(|whys| whys.into_iter().collect::<Option<Vec<String>>>());
        let path = PathBuf::from(&cells[0].scene);
        warnings.extend(everywhere.flatten().map(|message| Warning { name: "no-effect", path: path.clone(), message }));
    }
    Ok(all)
}

/// A film that shows one layer of another.
fn layer_as_color(film: &Film, layer: Layer) -> Result<Film, Error> {
    let mut shown = Film::new(film.width(), film.height(), &[Layer::Color])?;
    for y in 0..film.height() {
        for x in 0..film.width() {
            shown.set_pixel(x, y, &Pixel { color: film.spectrum(layer, x, y), ..Pixel::default() });
        }
    }
    Ok(shown)
}

/// How each cell is shown: all by one decision about all of them, or, when asked for or when they do not want the same, each by its own.
fn tone_maps(drawn: &[Option<Drawn>], own: bool, n_columns: usize, cell: Size) -> Result<Vec<Option<Prepared>>, Error> {
    let mut wanted = drawn.iter().flatten().map(|d| d.tone_map);
    let first = wanted.next();
    let common = first.filter(|f| !own && wanted.all(|w| w == *f));
    let Some(common) = common else {
        return Ok(drawn.iter().map(|d| d.as_ref().map(|d| d.tone_map.prepare(&d.film))).collect());
    };
    let n_rows = drawn.len().div_ceil(n_columns) as u32;
    let mut together = Film::new(cell.width * n_columns as u32, cell.height * n_rows, &[Layer::Color])?;
    for (i, d) in drawn.iter().enumerate() {
        if let Some(d) = d {
            together.paste((i % n_columns) as u32 * cell.width, (i / n_columns) as u32 * cell.height, &d.film);
        }
    }
    let prepared = common.prepare(&together);
    Ok(drawn.iter().map(|d| d.as_ref().map(|_| prepared)).collect())
}

fn recipe(args: &Sheet, plan: &Plan, size: Size, drawn: &[Option<Drawn>], shown: &[Option<Prepared>]) -> Recipe {
    let labels = |axis: &Axis| {
        let labels: Vec<&str> = axis.entries.iter().map(|e| e.label.as_str()).collect();
        format!("{}: {}", axis.what, labels.join(" | "))
    };
    let distinct = |words: Vec<String>| {
        let mut words = words;
        words.sort();
        words.dedup();
        words.join(", ")
    };
    let first = &plan.cells[0].picture;
    let mut recipe = Recipe::new()
        .with("version", env!("CARGO_PKG_VERSION"))
        .with("command", output::command_line())
        .with("scene", distinct(plan.cells.iter().map(|c| c.scene.clone()).collect()))
        .with("method", distinct(drawn.iter().flatten().map(|d| d.method.to_owned()).collect()))
        .with("rows", labels(&plan.rows))
        .with("columns", labels(&plan.columns))
        .with("size", format!("{}x{}", size.width, size.height))
        .with("spp", distinct(drawn.iter().flatten().map(|d| d.samples.clone()).collect()))
        .with("seed", first.seed.to_string())
        .with("exposure", distinct(shown.iter().flatten().map(|s| s.factor.to_string()).collect()))
        .with("tone-map", distinct(drawn.iter().flatten().map(|d| d.tone_map.curve.to_string()).collect()));
    if let Some(figure) = &args.figure {
        recipe.set("figure", figure);
    }
    if drawn.iter().any(|d| d.as_ref().is_none_or(|d| d.done < 1.0)) {
        recipe.set("unfinished", "not all of its cells are done");
    }
    recipe
}
