//! The verb `render`, and what other verbs need to draw a picture: `plan` prepares a scene, `method` draws it, `output` says how it looks and
//! was made.

mod auto;
pub(crate) mod method;
pub(crate) mod output;
pub(crate) mod plan;
pub(crate) mod progressive;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use radiosa::export::checkpoint;
use radiosa::export::image::{self, ExrDepth, PngDepth};
use radiosa::import::Warning;
use serde_json::json;

use crate::args::{self, Render, Work};
use crate::error::Error;
use crate::false_color;
use crate::interrupt;
use method::Watch;
use output::tell;
use plan::Stage;

/// Does something with as many threads as were asked for.
pub(crate) fn with_threads<T: Send>(work: &Work, what: impl FnOnce() -> Result<T, Error> + Send) -> Result<T, Error> {
    let threads = work.threads.map_or(0, usize::from);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|e| Error::failed(format!("cannot start {threads} threads: {e}"), "ask for fewer with --threads"))?;
    pool.install(what)
}

pub(crate) fn run(args: &Render, json: bool) -> Result<ExitCode, Error> {
    with_threads(&args.work, || render(args, json))
}

fn render(args: &Render, json: bool) -> Result<ExitCode, Error> {
    interrupt::listen();
    let start = Instant::now();
    let (picture, work) = (&args.picture, &args.work);
    plan::cpu_path(work.cpu_path)?;
    for output in &args.output {
        image::check_target(output)?;
    }
    if !picture.overlay.is_empty() && args.bits == args::Bits::Sixteen {
        return Err(Error::Misuse("--overlay draws into pictures of 8 bits; leave out --bits 16".into()));
    }
    let mut warnings = Vec::new();
    let scene = plan::load(&args.scene, &picture.scene, work, &mut warnings)?;
    let outputs = if args.output.is_empty() { vec![output::default_output(&scene)] } else { args.output.clone() };
    for output in &outputs {
        image::check_target(output)?;
    }
    let load_time = start.elapsed();
    if interrupt::asked() {
        return Ok(ExitCode::from(130));
    }
    let n_primitives = scene.n_primitives();
    let stage = Stage::new(scene, picture, &args.given, work)?;
    let layers = plan::layers(&args.layers, &outputs);
    let choice = method::choose(picture, &stage, work.time, &args.given)?;
    let picture = &choice.settle(picture, &args.given);
    let what = format!("a picture of {}x{} with its scene", stage.size.width, stage.size.height);
    plan::within_memory(&what, stage.memory_with(&layers) + choice.memory(&stage, picture, &layers), work)?;
    let begun = Instant::now();
    let lighting = method::light(&stage, picture, choice, &|| method::is_over(begun, work));
    let said = choice.misfits(picture, &stage, &args.given).into_iter().chain(lighting.warnings.iter().cloned());
    warnings.extend(said.map(|(name, message)| Warning { name, path: PathBuf::from(&args.scene), message }));
    if !work.quiet {
        output::say_warnings(&warnings);
    }
    let watch = Watch::new("render", choice, work, begun);
    let save = progressive::Save { path: checkpoint::path_of(&outputs[0]), every: args.save_every, resume: args.resume };
    let drawing = method::draw(&stage, picture, choice, &lighting, &layers, (&watch, Some(&save)))?;
    let trace_time = watch.finish();

    let options = image::Options {
        tone_map: output::tone_map(picture, stage.world.scene(), lighting.is_default),
        png_depth: if args.bits == args::Bits::Sixteen { PngDepth::Sixteen } else { PngDepth::Eight },
        exr_depth: if args.half { ExrDepth::Half } else { ExrDepth::Single },
    };
    let exposure = options.tone_map.prepare(&drawing.film).factor;
    let recipe = output::recipe(&args.scene, picture, &stage, choice, &drawing);
    for output in &outputs {
        let is_png = image::Format::of(output)? == image::Format::Png;
        match &drawing.lines {
            lines if is_png && args.colors.false_color.is_some() => {
                let values = false_color::Values::of(&drawing.film, output::unit_of_pixels(picture, stage.world.scene()));
                false_color::write(&false_color::Values { lines: lines.clone(), ..values }, &args.colors, output, &recipe)?;
            }
            Some(lines) if is_png => {
                let mut rgb = options.tone_map.prepare(&drawing.film).to_srgb8(&drawing.film);
                output::draw_lines(&mut rgb, lines);
                let recipe =
                    recipe.clone().with("exposure", exposure.to_string()).with("tone-map", options.tone_map.curve.to_string());
                image::write_rgb8(output, stage.size.width, stage.size.height, &rgb, &recipe)?;
            }
            _ => image::write(&drawing.film, output, &recipe, &options)?,
        }
    }

    let (world, unit) = (&stage.world, choice.unit());
    let rate = drawing.count as f64 * 1e-6 / trace_time.as_secs_f64().max(1e-9);
    if !work.quiet {
        let seconds = |d: Duration| format!("{:.2} s", d.as_secs_f64());
        let mut lines = Vec::new();
        if let Some(why) = choice.why {
            lines.push(format!("method      {} ({why})", choice.name()));
        }
        lines.push(format!("scene       {} primitives, {} instances", n_primitives, world.scene().instances.len()));
        lines.push(format!(
            "camera      {:?}, {}x{}, {} samples a pixel",
            stage.camera.name,
            stage.size.width,
            stage.size.height,
            drawing.samples(picture, choice)
        ));
        lines.push(format!("exposure    {exposure}"));
        lines.push(format!(
            "time        load {}, build {}, trace {} ({rate:.2} M{unit}/s, {} kernels)",
            seconds(load_time),
            seconds(stage.build_time),
            seconds(trace_time),
            world.cpu_path()
        ));
        let sampled = drawing.sampled.as_ref();
        if let Some(noise) = sampled.and_then(|s| s.noise) {
            let again = sampled.and_then(|s| s.repeat.as_ref()).map(|options| format!("; the same bits again: {options}"));
            lines.push(format!("noise       {noise:.2e}{}", again.unwrap_or_default()));
        }
        if drawing.done < 1.0 {
            let done = drawing.done * 100.0;
            lines.push(match sampled.and_then(|s| s.checkpoint.as_ref()) {
                Some(path) => {
                    format!("unfinished  {done:.1} % is done and kept in {}; run it again with --resume to go on", path.display())
                }
                None => format!("unfinished  {done:.1} % of the picture is done; run it again to have all of it"),
            });
        }
        for output in &outputs {
            lines.push(format!("wrote       {}", output.display()));
        }
        tell(&lines.join("\n"));
    }
    if json {
        let mut report = json!({
            "scene": world.scene().name,
            "method": choice.name(),
            "why": choice.why,
            "camera": stage.camera.name,
            "size": [stage.size.width, stage.size.height],
            "spp": choice.adaptive(picture).is_none().then_some(picture.samples_a_pixel()),
            "adaptive": choice.adaptive(picture),
            "seed": picture.seed,
            "cpu_path": world.cpu_path().to_string(),
            "quantity": output::quantity_name(world.scene().quantity),
            "primitives": n_primitives,
            "instances": world.scene().instances.len(),
            "seconds": {
                "load": load_time.as_secs_f64(), "build": stage.build_time.as_secs_f64(), "trace": trace_time.as_secs_f64(),
                "total": start.elapsed().as_secs_f64(),
            },
            "exposure": exposure,
            "mean_radiance": output::mean(&drawing.film),
            "done": drawing.done,
            "warnings": output::warnings_json(&warnings),
            "outputs": outputs,
        });
        if let Some(sampled) = &drawing.sampled {
            report["spp"] = json!(sampled.mean);
            report["spp_range"] = json!(sampled.range);
            report["noise"] = json!(sampled.noise);
            report["repeat"] = json!(sampled.repeat);
            report["resumed_after"] = json!(sampled.resumed);
            report["checkpoint"] = json!(sampled.checkpoint);
            report["seconds"]["first_picture"] = json!(sampled.first.map(|first| first.as_secs_f64()));
        }
        report[unit] = drawing.count.into();
        report[format!("m{unit}_per_second")] = rate.into();
        crate::version::say(&report.to_string());
    }
    Ok(if interrupt::asked() { ExitCode::from(130) } else { ExitCode::SUCCESS })
}
