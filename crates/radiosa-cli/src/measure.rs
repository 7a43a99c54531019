//! The verb `measure`: irradiance at sensors, as a table.

use std::fmt::Write as _;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use radiosa::export::image::Recipe;
use radiosa::export::{self, ExportError};
use radiosa::hybrid::FinalGather;
use radiosa::import::Warning;
use radiosa::measure::{self, Grid, Reading, Sensor, Summary};
use radiosa::radiosity::{self, gather};
use radiosa::raytrace::{PathTracer, path};
use radiosa::sampling::rng;
use radiosa::scene::Quantity;
use radiosa::transport::World;
use rayon::prelude::*;
use serde_json::json;

use crate::args::{Measure, MeasureMethod, Radiosity};
use crate::error::Error;
use crate::false_color::{self, Values};
use crate::progress::Progress;
use crate::render::method::about_media;
use crate::render::output::{self, tell};
use crate::render::{plan, with_threads};
use crate::solve;

/// Endings of tables.
const ENDINGS: &[&str] = &["csv", "json", "png"];

pub(crate) fn run(args: &Measure, json: bool) -> Result<ExitCode, Error> {
    with_threads(&args.work, || measure(args, json))
}

fn measure(args: &Measure, json: bool) -> Result<ExitCode, Error> {
    let start = Instant::now();
    for output in &args.output {
        check(output)?;
        if args.grid.is_none() && has_ending(output, "png") {
            return Err(Error::Misuse("a .png shows a grid: measure with --grid METRES".into()));
        }
    }
    let mut warnings = Vec::new();
    let mut scene = plan::load(&args.scene, &args.changes, &args.work, &mut warnings)?;
    let without_effect = |option: &&String| match args.method {
        MeasureMethod::Raycast => matches!(option.as_str(), "solution" | "spp") || Radiosity::options().contains(option),
        MeasureMethod::Path => matches!(option.as_str(), "solution" | "emitters") || Radiosity::options().contains(option),
        MeasureMethod::Radiosity | MeasureMethod::Hybrid => matches!(option.as_str(), "emitters" | "spp"),
    };
    warnings.extend(args.given.iter().filter(without_effect).map(|option| Warning {
        name: "no-effect",
        path: PathBuf::from(&args.scene),
        message: format!("--{option} changes nothing with --method {}", method_name(args.method)),
    }));
    if args.method == MeasureMethod::Radiosity {
        radiosity::tessellate(&mut scene, solve::rings(&args.radiosity, args.solution.as_deref())?);
    }
    let by = format!("--method {}", method_name(args.method));
    warnings.extend(about_media(&scene, &by, args.method == MeasureMethod::Path).map(|(name, message)| Warning {
        name,
        path: PathBuf::from(&args.scene),
        message,
    }));
    let world = plan::prepare(scene, &args.work)?;
    let (sensors, grid) = sensors(args, &world)?;
    let prepared = start.elapsed();
    if sensors.is_empty() {
        return Err(Error::failed(
            "there are no sensors",
            "measure on a finer --grid, at another --height, or at --points; a grid stands over surfaces that face up",
        ));
    }
    if !args.work.quiet {
        output::say_warnings(&warnings);
    }
    let readings = match args.method {
        MeasureMethod::Radiosity | MeasureMethod::Hybrid => by_radiosity(args, &world, &sensors)?,
        MeasureMethod::Path => by_paths(args, &world, &sensors),
        MeasureMethod::Raycast => {
            let direct = measure::Direct::new(&world, args.emitters);
            sensors.par_iter().map(|sensor| direct.at(&world, sensor)).collect()
        }
    };
    let quantity = world.scene().quantity;
    // What a unit of luminance counts in the column of illuminances.
    let efficacy = if quantity == Quantity::Radiometric { args.lux.unwrap_or(1.0) } else { 1.0 };
    let illuminance = |r: &Reading| f64::from(r.irradiance.luminance()) * efficacy;
    let table = csv(&sensors, &readings, efficacy);
    let summary = Summary::of(readings.iter().map(illuminance));
    let unit = match (quantity, args.lux) {
        (Quantity::Radiometric, None) => "W/m²",
        _ => "lx",
    };
    let mut report = json!({
        "scene": world.scene().name,
        "method": method_name(args.method),
        "quantity": output::quantity_name(quantity),
        "sensors": sensors.len(),
        "unit": unit,
        "seconds": { "prepare": prepared.as_secs_f64(), "total": start.elapsed().as_secs_f64() },
        "warnings": output::warnings_json(&warnings),
        "outputs": args.output,
    });
    if let Some(s) = &summary {
        report["illuminance"] =
            json!({ "min": s.min, "mean": s.mean, "max": s.max, "uniformity": s.uniformity(), "min_to_max": s.diversity() });
    }
    for path in &args.output {
        if let Some(grid) = grid.as_ref().filter(|_| has_ending(path, "png")) {
            let recipe = Recipe::new().with("version", env!("CARGO_PKG_VERSION")).with("command", output::command_line());
            let shown = picture(grid, &readings, illuminance, unit);
            false_color::write(&shown, &args.colors, path, &recipe)?;
            continue;
        }
        let text = if has_ending(path, "json") { table_json(&report, &sensors, &readings, efficacy) } else { table.clone() };
        export::write_atomically(path, |file| std::io::Write::write_all(file, text.as_bytes()))?;
    }
    if args.output.is_empty() && !json {
        crate::version::say(table.trim_end());
    }
    if let Some(s) = summary.filter(|_| !args.work.quiet) {
        let uniformity = s.uniformity();
        if s.max <= 0.0 {
            tell("warning[dark]: no light reaches any sensor: look whether the scene has lights, and which way sensors face");
        }
        tell(&format!(
            "sensors     {}\nilluminance min {:.4} mean {:.4} max {:.4} {unit}, uniformity {uniformity:.3}",
            sensors.len(),
            s.min,
            s.mean,
            s.max
        ));
        tell(&format!("time        {:.2} s", start.elapsed().as_secs_f64()));
        args.output.iter().for_each(|o| tell(&format!("wrote       {}", o.display())));
    }
    if json && args.output.is_empty() {
        crate::version::say(table_json(&report, &sensors, &readings, efficacy).trim_end());
    } else if json {
        crate::version::say(&report.to_string());
    }
    Ok(ExitCode::SUCCESS)
}

fn method_name(method: MeasureMethod) -> &'static str {
    match method {
        MeasureMethod::Radiosity => "radiosity",
        MeasureMethod::Hybrid => "hybrid",
        MeasureMethod::Path => "path",
        MeasureMethod::Raycast => "raycast",
    }
}

fn has_ending(path: &Path, ending: &str) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case(ending))
}

/// A grid seen from above, −z up; readings take some pixels each.
fn picture(grid: &Grid, readings: &[Reading], value: impl Fn(&Reading) -> f64, unit: &str) -> Values {
    /// Pixels along the longer side, about.
    const SIDE: u32 = 600;
    let [width, height] = grid.n;
    let mut values = vec![f64::NAN; width as usize * height as usize];
    for (place, reading) in grid.places.iter().zip(readings) {
        values[*place as usize] = value(reading);
    }
    Values { values, width, height, zoom: (SIDE / width.max(height).max(1)).clamp(1, 64), unit: unit.to_owned(), lines: None }
}

fn check(path: &Path) -> Result<(), Error> {
    if !ENDINGS.iter().any(|ending| has_ending(path, ending)) {
        return Err(ExportError::UnknownEnding { path: path.to_path_buf(), known: ENDINGS }.into());
    }
    Ok(export::check_writable(path)?)
}

fn sensors(args: &Measure, world: &World) -> Result<(Vec<Sensor>, Option<Grid>), Error> {
    let wrong = |e: &dyn std::fmt::Display, path: &Path| {
        Error::failed(format!("{}: {e}", path.display()), "write a sensor a line: its position and the direction it faces")
    };
    match (&args.points, args.grid) {
        (Some(path), _) => {
            let mut text = String::new();
            let read = if path.as_os_str() == "-" {
                std::io::stdin().lock().take(args.work.max_memory).read_to_string(&mut text).map(drop)
            } else {
                std::fs::File::open(path).and_then(|f| f.take(args.work.max_memory).read_to_string(&mut text)).map(drop)
            };
            read.map_err(|e| wrong(&e, path))?;
            measure::parse_sensors(&text).map_err(|e| wrong(&e, path)).map(|sensors| (sensors, None))
        }
        (None, Some(spacing)) => measure::grid(world, spacing, args.height)
            .map(|grid| (grid.sensors.clone(), Some(grid)))
            .map_err(|e| Error::failed(e.to_string(), "ask for a wider --grid, or look at the --scale of the scene")),
        (None, None) => Err(Error::Misuse("say where to measure: --points FILE or --grid METRES".into())),
    }
}

/// Rays of all sensors that gather by rays, about, and of one at least and at most; a quarter as many points of emissive surfaces.
const RAYS: u32 = 1 << 24;
const OF_ONE: [u32; 2] = [4096, 1 << 16];

/// Sensors up to which each looks closely at what is near.
const DETAILED: usize = 256;

/// Sensors of whose hemisphere more than this is nearer than elements are large follow rays out of their narrow place.
const NARROW: f32 = 0.4;

/// Paths of all sensors, about, and of one at most.
const PATHS: u32 = 1 << 24;
const PATHS_OF_ONE: u32 = 1 << 18;

fn by_paths(args: &Measure, world: &World, sensors: &[Sensor]) -> Vec<Reading> {
    let method = PathTracer::new(world, &path::Settings::default());
    let paths = args.spp.unwrap_or((PATHS / sensors.len() as u32).clamp(1, PATHS_OF_ONE));
    let at = |(k, sensor): (usize, &Sensor)| {
        let (surface, n) = sensor.place(world);
        let (irradiance, standard_error) = method.irradiance(world, &surface, n, paths, rng::key(&[args.seed, k as u64]));
        Reading { irradiance, standard_error }
    };
    sensors.par_iter().enumerate().map(at).collect()
}

/// Rays by which the hybrid finds the light of an element.
const SETTLING: u32 = 1024;

fn by_radiosity(args: &Measure, world: &World, sensors: &[Sensor]) -> Result<Vec<Reading>, Error> {
    let settings = match args.method {
        MeasureMethod::Hybrid => solve::settings_to_gather_from(&args.radiosity, args.seed, &[]),
        _ => solve::settings(&args.radiosity, args.seed, &[]),
    };
    let bar = Progress::new("solve", solve::UNIT, args.work.quiet);
    let saved = args.solution.as_deref();
    // (Of radiosity's it is the same.)
    let tessellated = radiosity::tessellated(world, solve::rings(&args.radiosity, saved)?)?;
    let (shown, world) = (world, tessellated.as_ref().unwrap_or(world));
    let solve::Found { solution, done, .. } = if args.method == MeasureMethod::Hybrid && saved.is_none() {
        solve::to_gather_from(world, &settings, &args.work, &bar)?
    } else {
        solve::saved_or_solved(world, &settings, saved, &args.work, &bar)?
    };
    bar.finish();
    if done < 1.0 {
        tell(&format!("warning[unfinished]: {:.1} % of the light is solved for", done * 100.0));
    }
    let placed: Vec<_> = sensors.iter().map(|sensor| sensor.place(world)).collect();
    let key = |k: usize| rng::key(&[args.seed, k as u64]);
    let reading =
        |arriving: gather::Arriving| Reading { irradiance: arriving.irradiance, standard_error: arriving.standard_error };
    let by_rays = |gather: &FinalGather<'_>, of: &[usize]| -> Vec<Reading> {
        let rays = (RAYS / of.len().max(1) as u32).clamp(OF_ONE[0], OF_ONE[1]);
        let at = |&k: &usize| reading(gather.sensor(&placed[k].0, placed[k].1, [rays, rays / 4], key(k)));
        of.par_iter().map(at).collect()
    };
    let final_gather = FinalGather::new(world, &solution, &[], args.seed);
    let final_gather = if tessellated.is_some() { final_gather.with_direct_light_of(shown) } else { final_gather };
    if args.method == MeasureMethod::Hybrid {
        return Ok(by_rays(&final_gather.settled(SETTLING, &|| false), &(0..sensors.len()).collect::<Vec<_>>()));
    }
    let is_narrow = |&k: &usize| final_gather.nearness(&placed[k].0, placed[k].1, key(k)) > NARROW;
    let narrow: Vec<usize> = match solution.system.medium.is_clear() {
        true => (0..sensors.len()).into_par_iter().filter(is_narrow).collect(),
        false => Vec::new(),
    };
    let gather = gather::Gather::new(world, &solution, &[], args.seed);
    let gather = if sensors.len() <= DETAILED { gather.with_details() } else { gather };
    let at = |scratch: &mut gather::Scratch, k: usize| match narrow.binary_search(&k) {
        Ok(_) => Reading::default(),
        Err(_) => reading(gather.at(&placed[k].0, placed[k].1, k as u64, scratch)),
    };
    let mut readings: Vec<Reading> = (0..sensors.len()).into_par_iter().map_init(gather::Scratch::default, at).collect();
    for (k, reading) in narrow.iter().zip(by_rays(&final_gather, &narrow)) {
        readings[*k] = reading;
    }
    Ok(readings)
}

/// The table, in the order of the sensors.
fn csv(sensors: &[Sensor], readings: &[Reading], efficacy: f64) -> String {
    let mut text = "x,y,z,nx,ny,nz,irradiance_r,irradiance_g,irradiance_b,illuminance,stderr\n".to_owned();
    for (s, r) in sensors.iter().zip(readings) {
        let (p, n, e) = (s.position, s.normal, r.irradiance);
        let y = f64::from(e.luminance()) * efficacy;
        let error = r.standard_error * efficacy;
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{},{},{},{},{},{},{},{},{},{y},{error}", p.x, p.y, p.z, n.x, n.y, n.z, e.r, e.g, e.b);
    }
    text
}

fn table_json(report: &serde_json::Value, sensors: &[Sensor], readings: &[Reading], efficacy: f64) -> String {
    let rows: Vec<_> = sensors
        .iter()
        .zip(readings)
        .map(|(s, r)| {
            json!({
                "position": s.position.to_array(), "normal": s.normal.to_array(), "irradiance": r.irradiance.to_array(),
                "illuminance": f64::from(r.irradiance.luminance()) * efficacy, "stderr": r.standard_error * efficacy,
            })
        })
        .collect();
    let mut whole = report.clone();
    whole["readings"] = rows.into();
    whole.to_string() + "\n"
}
