//! The verb `render`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use radiosa::emitter::EnvironmentShadows;
use radiosa::export::image::{self, ExrDepth, PngDepth, Recipe};
use radiosa::film::{self, Film, Layer, tone_map};
use radiosa::import::{self, Warning};
use radiosa::math::{CpuPath, DMat3};
use radiosa::raytrace::{RayCast, ray_cast, tiles};
use radiosa::scene::{Camera, Environment, EnvironmentRadiance, Projection, Quantity, Scene};
use radiosa::spectrum::Spectrum;
use radiosa::transport::{self, Solver, Step, View, World, default_light, framing};
use serde_json::json;

use crate::args::{self, Exposure, Method, OnOff, Render, Size};
use crate::error::Error;
use crate::interrupt;
use crate::progress::Progress;

/// Everything known before the first ray.
struct Plan {
    outputs: Vec<PathBuf>,
    layers: Vec<Layer>,
    size: Size,
    camera: Camera,
}

pub(crate) fn run(args: Render, json: bool) -> Result<ExitCode, Error> {
    interrupt::listen();
    let threads = args.threads.map_or(0, usize::from);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|e| Error::failed(format!("cannot start {threads} threads: {e}"), "ask for fewer with --threads"))?;
    pool.install(|| render(&args, json))
}

fn render(args: &Render, json: bool) -> Result<ExitCode, Error> {
    let start = Instant::now();
    let cpu_path = cpu_path(args.cpu_path)?;
    for output in &args.output {
        image::check_target(output)?;
    }
    let mut warnings = Vec::new();
    let scene = load(args, &mut warnings)?;
    let outputs = if args.output.is_empty() { vec![default_output(&scene)] } else { args.output.clone() };
    for output in &outputs {
        image::check_target(output)?;
    }
    let load_time = start.elapsed();

    let n_primitives = scene.n_primitives();
    // About what the prepared world takes a primitive, and the pictures.
    let prepared = n_primitives * 230 + scene.images.iter().map(image_bytes).sum::<u64>();
    within_memory("the scene", prepared, args)?;
    if interrupt::asked() {
        return Ok(ExitCode::from(130));
    }
    let built = Instant::now();
    let world = World::prepare(scene, cpu_path)?;
    let build_time = built.elapsed();
    let (camera, size) = camera_and_size(&world, args)?;
    let mut warn = |name, message: String| warnings.push(Warning { name, path: PathBuf::from(&args.scene), message });
    let plan = Plan { layers: layers(args, &outputs), outputs, size, camera };
    let film = Film::memory(plan.size.width, plan.size.height, &plan.layers);
    // Encoding holds a copy of what it writes.
    within_memory(&format!("a picture of {}x{} with its scene", plan.size.width, plan.size.height), prepared + 2 * film, args)?;

    let why = "ray casting is the only method so far";
    let method = match args.method {
        Method::Auto | Method::Raycast => "raycast",
    };
    let mut settings = ray_cast::Settings {
        shadows: args.shadows == OnOff::On,
        lights: transport::LightSettings {
            emitters: match args.emitters {
                args::Emitters::Ignore => transport::Emitters::Ignore,
                args::Emitters::Sample(n) => transport::Emitters::Points { n, max: 4096 },
            },
            environment_shadows: match args.environment_shadows {
                OnOff::On => EnvironmentShadows::On,
                OnOff::Off => EnvironmentShadows::Off,
            },
        },
        viewer: match args.viewer {
            args::Viewer::Local => transport::Viewer::Local,
            args::Viewer::Infinite => transport::Viewer::Infinite,
        },
        extra_lights: Vec::new(),
    };
    let view = View::new(&plan.camera, world.origin(), plan.size.width, plan.size.height);
    let mut ray_cast = RayCast::new(&world, &settings, view.forward());
    // Nobody wants a black picture: where the scene's own lights reach nothing the camera sees, it is given one.
    let mut default_lit = false;
    let shape = (plan.size.width, plan.size.height);
    // (`--emitters ignore` asks for just that where emitters are all there is.)
    let wanted = args.emitters == args::Emitters::Ignore && default_light::has_light(&world);
    let seen = default_light::survey(&world, &view, shape, &ray_cast);
    if seen.surfaces == 0 {
        warn("nothing-to-see", "the camera sees no surface".to_owned());
    }
    if args.default_light == OnOff::On && !wanted && seen.surfaces > 0 && seen.visible == 0 {
        settings.extra_lights = default_light::lights(&plan.camera);
        let helped = RayCast::new(&world, &settings, view.forward());
        if default_light::survey(&world, &view, shape, &helped).visible > 0 {
            let names: Vec<String> = settings.extra_lights.iter().map(|l| format!("\"{}\"", l.name)).collect();
            let why = if default_light::has_light(&world) {
                "the scene's own lights reach nothing the camera sees"
            } else {
                "the scene has no light"
            };
            warn("default-light", format!("{why}: it gets {}", names.join(" and ")));
            ray_cast = helped;
            default_lit = !default_light::has_light(&world);
        }
    }
    if let Some(said) = ray_cast.lights().note() {
        warn("emitters", said);
    }
    if !args.quiet {
        say_warnings(&warnings);
    }
    let traced = Instant::now();
    let (film, done, n_rays) = trace(args, &plan, &world, &view, &ray_cast)?;
    let trace_time = traced.elapsed();

    let options = image::Options {
        tone_map: tone_map(args, &world, default_lit),
        png_depth: if args.bits == args::Bits::Sixteen { PngDepth::Sixteen } else { PngDepth::Eight },
        exr_depth: if args.half { ExrDepth::Half } else { ExrDepth::Single },
    };
    let exposure = options.tone_map.prepare(&film).factor;
    let recipe = recipe(args, &world, &plan, &view, method, done);
    for output in &plan.outputs {
        image::write(&film, output, &recipe, &options)?;
    }

    let mrays = n_rays as f64 * 1e-6 / trace_time.as_secs_f64().max(1e-9);
    if !args.quiet {
        let seconds = |d: Duration| format!("{:.2} s", d.as_secs_f64());
        let mut lines = Vec::new();
        if args.method == Method::Auto {
            lines.push(format!("method      {method} ({why})"));
        }
        lines.push(format!("scene       {} primitives, {} instances", n_primitives, world.scene().instances.len()));
        lines.push(format!(
            "camera      {:?}, {}x{}, {} samples a pixel",
            plan.camera.name, plan.size.width, plan.size.height, args.spp
        ));
        lines.push(format!("exposure    {}", exposure));
        lines.push(format!(
            "time        load {}, build {}, trace {} ({mrays:.2} Mrays/s, {} kernels)",
            seconds(load_time),
            seconds(build_time),
            seconds(trace_time),
            world.cpu_path()
        ));
        if done < 1.0 {
            lines.push(format!("unfinished  {:.1} % of the picture is done; run it again to have all of it", done * 100.0));
        }
        for output in &plan.outputs {
            lines.push(format!("wrote       {}", output.display()));
        }
        tell(&lines.join("\n"));
    }
    if json {
        let report = json!({
            "scene": world.scene().name,
            "method": method,
            "why": (args.method == Method::Auto).then_some(why),
            "camera": plan.camera.name,
            "size": [plan.size.width, plan.size.height],
            "spp": args.spp,
            "seed": args.seed,
            "cpu_path": world.cpu_path().to_string(),
            "quantity": quantity_name(world.scene().quantity),
            "primitives": n_primitives,
            "instances": world.scene().instances.len(),
            "rays": n_rays,
            "mrays_per_second": mrays,
            "seconds": {
                "load": load_time.as_secs_f64(), "build": build_time.as_secs_f64(), "trace": trace_time.as_secs_f64(),
                "total": start.elapsed().as_secs_f64(),
            },
            "exposure": exposure,
            "mean_radiance": mean(&film),
            "done": done,
            "warnings": warnings.iter().map(|w| json!({ "name": w.name, "file": w.path, "message": w.message })).collect::<Vec<_>>(),
            "outputs": plan.outputs,
        });
        crate::version::say(&report.to_string());
    }
    Ok(if interrupt::asked() { ExitCode::from(130) } else { ExitCode::SUCCESS })
}

/// Traces until it is done, time is up or somebody interrupts; the film, the fraction done, and the rays it took.
fn trace(args: &Render, plan: &Plan, world: &World, view: &View, ray_cast: &RayCast) -> Result<(Film, f64, u64), Error> {
    let settings = tiles::Settings {
        width: plan.size.width,
        height: plan.size.height,
        spp: args.spp,
        filter: match args.filter {
            args::Filter::Box => film::Filter::Box,
            args::Filter::Tent => film::Filter::Tent,
            args::Filter::Gaussian => film::Filter::Gaussian,
            args::Filter::Mitchell => film::Filter::Mitchell,
            args::Filter::BlackmanHarris => film::Filter::BlackmanHarris,
        },
        seed: args.seed,
        layers: plan.layers.clone(),
    };
    let start = Instant::now();
    let progress = Progress::new("render", args.quiet);
    let mut render = tiles::TiledRender::new(ray_cast, view, settings)?;
    let mut done = 0.0;
    while let Step::Working { done: now } = render.step(world) {
        done = now;
        progress.update(now, render.n_rays());
        if interrupt::asked() || args.time.is_some_and(|limit| start.elapsed() >= limit) {
            progress.finish();
            let n_rays = render.n_rays();
            return Ok((render.into_film(), done, n_rays));
        }
    }
    let _ = done;
    progress.finish();
    let n_rays = render.n_rays();
    Ok((render.into_film(), 1.0, n_rays))
}

/// An error when something of a known size is more than what is allowed.
fn within_memory(what: &str, needed: u64, args: &Render) -> Result<(), Error> {
    if needed <= args.max_memory {
        return Ok(());
    }
    let mib = |bytes: u64| bytes.div_ceil(1 << 20);
    Err(Error::failed(
        format!("{what} takes about {} MiB, more than the {} MiB allowed", mib(needed), mib(args.max_memory)),
        "ask for a smaller --size, fewer --layers, or a larger --max-memory",
    ))
}

fn image_bytes(image: &radiosa::scene::Image) -> u64 {
    use radiosa::scene::Pixels;
    match &image.pixels {
        Pixels::Rgba8(p) => p.len() as u64,
        Pixels::Rgba16(p) => 2 * p.len() as u64,
        Pixels::Rgba32F(p) => 4 * p.len() as u64,
    }
}

fn cpu_path(choice: args::CpuPath) -> Result<CpuPath, Error> {
    let best = CpuPath::detect();
    match choice {
        args::CpuPath::Auto => Ok(best),
        args::CpuPath::Portable => Ok(CpuPath::Portable),
        args::CpuPath::Avx2 if best == CpuPath::Avx2 => Ok(best),
        args::CpuPath::Avx2 => Err(Error::failed("this processor has no AVX2 with FMA", "use --cpu-path portable")),
    }
}

/// The scene, built in or from a file, with what the command line changes.
fn load(args: &Render, warnings: &mut Vec<Warning>) -> Result<Scene, Error> {
    let options = import::Options { allow_outside: args.allow_outside.clone(), max_memory: args.max_memory };
    let path = Path::new(&args.scene);
    let mut scene = if let Some(scene) = import::sample::load(&args.scene) {
        scene
    } else if path.exists() || path.extension().is_some() {
        let (scene, found) = import::load(path, &options)?;
        warnings.extend(found);
        scene
    } else {
        return Err(crate::scenes::unknown(&args.scene));
    };
    if args.up.is_some() || args.scale.is_some() {
        let up = match args.up {
            // Turns +z up into +y up.
            Some(args::Up::Z) => DMat3::from_rotation_x(-std::f64::consts::FRAC_PI_2),
            _ => DMat3::IDENTITY,
        };
        scene.transform(up, args.scale.unwrap_or(1.0));
    }
    if let Some(ambient) = args.ambient {
        scene.ambient = ambient.into();
    }
    if let Some(background) = args.background {
        scene.background = background.into();
    }
    match args.environment.as_deref() {
        None => {}
        Some("none") => scene.environment = None,
        Some(text) => scene.environment = Some(environment(text, &mut scene, &options)?),
    }
    Ok(scene)
}

fn environment(text: &str, scene: &mut Scene, options: &import::Options) -> Result<Environment, Error> {
    let constant = args::parse_color(text).ok().filter(|_| !Path::new(text).exists());
    let (radiance, scale) = match constant {
        Some(radiance) => (EnvironmentRadiance::Constant, radiance.into()),
        None => {
            let id = radiosa::scene::ImageId(scene.images.len() as u32);
            scene.images.push(import::load_picture(Path::new(text), options)?);
            (EnvironmentRadiance::Map(id), Spectrum::WHITE)
        }
    };
    Ok(Environment { radiance, scale, ..Environment::default() })
}

/// `NAME.png` in the current folder.
fn default_output(scene: &Scene) -> PathBuf {
    let clean: String = scene.name.chars().map(|c| if c.is_alphanumeric() || "-_. ".contains(c) { c } else { '-' }).collect();
    PathBuf::from(format!("{}.png", if clean.trim().is_empty() { "picture" } else { clean.trim() }))
}

fn camera_and_size(world: &World, args: &Render) -> Result<(Camera, Size), Error> {
    let cameras = &world.scene().cameras;
    let chosen = match args.camera.as_deref() {
        None => cameras.first(),
        Some("auto") => None,
        Some(name) => Some(
            cameras
                .iter()
                .find(|c| c.name == name)
                .or_else(|| name.parse::<usize>().ok().and_then(|i| cameras.get(i)))
                .ok_or_else(|| no_camera(name, cameras))?,
        ),
    };
    let aspect = match chosen {
        Some(Camera { projection: Projection::Panoramic, .. }) => 2.0,
        Some(camera) => camera.aspect.filter(|a| (0.05..=20.0).contains(a)).unwrap_or(16.0 / 9.0),
        None => 4.0 / 3.0,
    };
    let size = args.size.unwrap_or_else(|| {
        let long = 800.0;
        let (w, h) = if aspect >= 1.0 { (long, long / aspect) } else { (long * aspect, long) };
        Size { width: (w.round() as u32).max(1), height: (h.round() as u32).max(1) }
    });
    let camera = chosen.cloned().unwrap_or_else(|| framing::automatic(world, f64::from(size.width) / f64::from(size.height)));
    Ok((camera, size))
}

fn no_camera(name: &str, cameras: &[Camera]) -> Error {
    let help = if cameras.is_empty() {
        "the scene has none: leave --camera away, or use \"auto\"".to_owned()
    } else {
        let names: Vec<String> = cameras.iter().enumerate().map(|(i, c)| format!("{i} {:?}", c.name)).collect();
        format!("it has {}", names.join(", "))
    };
    Error::failed(format!("the scene has no camera {name:?}"), help)
}

/// What the film keeps: everything asked for when a file with layers is written, the colour alone otherwise.
fn layers(args: &Render, outputs: &[PathBuf]) -> Vec<Layer> {
    let mut layers = vec![Layer::Color, Layer::Alpha];
    let wants_layers = outputs.iter().any(|o| o.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr")));
    if !wants_layers {
        return layers;
    }
    for choice in &args.layers {
        use args::LayerChoice as C;
        layers.extend_from_slice(match choice {
            C::All => &Layer::ALL,
            C::None => &[],
            C::Lobe => film::Decomposition::Lobe.layers(),
            C::Path => film::Decomposition::Path.layers(),
            C::Albedo => &[Layer::Albedo],
            C::Normal => &[Layer::Normal],
            C::Depth => &[Layer::Depth],
            C::Position => &[Layer::Position],
            C::Object => &[Layer::ObjectId],
        });
    }
    layers
}

fn tone_map(args: &Render, world: &World, default_lit: bool) -> tone_map::ToneMap {
    // The default lights are classic ones, whatever the unit of the scene's own.
    let quantity = if default_lit { Quantity::Radiometric } else { world.scene().quantity };
    let exposure = match (args.exposure, quantity) {
        (Some(Exposure::Auto), _) | (None, Quantity::Photometric) => tone_map::Exposure::Automatic,
        (Some(Exposure::Factor(f)), _) => tone_map::Exposure::Factor(f),
        (None, Quantity::Radiometric) => tone_map::Exposure::Factor(1.0),
    };
    let curve = match args.tone_map {
        args::ToneMap::Clamp => tone_map::Curve::Clamp,
        args::ToneMap::Renormalise => tone_map::Curve::Renormalise,
        args::ToneMap::Reinhard => tone_map::Curve::Reinhard { white: None },
    };
    tone_map::ToneMap { exposure, curve }
}

fn quantity_name(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::Radiometric => "radiometric, W/(m² sr)",
        Quantity::Photometric => "photometric, cd/m²",
    }
}

fn recipe(args: &Render, world: &World, plan: &Plan, view: &View, method: &str, done: f64) -> Recipe {
    // The number of threads changes nothing, so it is no part of the recipe and the files are the same.
    let mut words = std::env::args().skip(1);
    let mut command = Vec::new();
    while let Some(word) = words.next() {
        if word == "--threads" {
            words.next();
        } else if !word.starts_with("--threads=") {
            command.push(shell_word(&word));
        }
    }
    let recipe = Recipe::new()
        .with("version", env!("CARGO_PKG_VERSION"))
        .with("command", format!("radiosa {}", command.join(" ")))
        .with("scene", &args.scene)
        .with("method", method)
        .with("camera", &plan.camera.name)
        .with("view", view.radiance_view())
        .with("size", format!("{}x{}", plan.size.width, plan.size.height))
        .with("spp", args.spp.to_string())
        .with("seed", args.seed.to_string())
        .with("quantity", quantity_name(world.scene().quantity))
        .with("cpu-path", world.cpu_path().to_string());
    if done < 1.0 { recipe.with("unfinished", format!("{:.1} % done", done * 100.0)) } else { recipe }
}

/// A word of a command line, quoted where a shell would split it.
fn shell_word(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_./:=,+%@".contains(c);
    if !word.is_empty() && word.chars().all(plain) { word.to_owned() } else { format!("'{}'", word.replace('\'', "'\\''")) }
}

fn mean(film: &Film) -> [f64; 3] {
    ["R", "G", "B"].map(|channel| {
        let values = film.plane(channel).unwrap_or_default();
        values.iter().map(|v| f64::from(*v)).sum::<f64>() / values.len().max(1) as f64
    })
}

fn say_warnings(warnings: &[Warning]) {
    for w in warnings {
        tell(&format!("warning[{}]: {}", w.name, w.message));
    }
}

/// A line on standard error; nobody there is no error of ours.
fn tell(text: &str) {
    use std::io::Write;
    let _ = writeln!(std::io::stderr(), "{text}");
}
