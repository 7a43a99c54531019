//! The methods: which one, its settings, and running it. To add one: a variant in `args::Method`, an arm in `choose` and one in `draw`.

use std::time::{Duration, Instant};

use radiosa::bsdf::Highlights;
use radiosa::emitter::EnvironmentShadows;
use radiosa::export::gathers;
use radiosa::film::{self, Film, Layer, Pixel};
use radiosa::hybrid::{self, Hybrid};
use radiosa::math::Ray;
use radiosa::radiosity::display::{self, Display};
use radiosa::radiosity::lines;
use radiosa::raytrace::{PathTracer, RayCast, Whitted, adaptive, path, ray_cast, tiles, whitted};
use radiosa::sampling::Stream;
use radiosa::scanline::{self, ScanLine};
use radiosa::scene::{Light, LightKind, Model, Scene};
use radiosa::transport::{self, Integrator, Solver, Step, View, World, default_light};

use super::plan::Stage;
use super::progressive::{self, Sampled, Save};
use super::{auto, output};
use crate::args::{self, Method, OnOff, Picture, Work};
use crate::error::Error;
use crate::interrupt;
use crate::progress::Progress;
use crate::solve;

/// The method taken, and why where it was not asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Choice {
    /// Never [`Method::Auto`].
    pub(crate) method: Method,
    pub(crate) why: Option<&'static str>,
    /// Settings of the hybrid that nobody typed are those of a quick picture.
    pub(crate) is_quick: bool,
}

/// Decides about `auto`, with the `time` there is and the options that were typed.
///
/// # Errors
/// When options do not go with the method asked for.
pub(crate) fn choose(picture: &Picture, stage: &Stage, time: Option<Duration>, given: &[String]) -> Result<Choice, Error> {
    picture.gathers.as_deref().map_or(Ok(()), gathers::check_target)?;
    let is_new = picture.solution.is_none() && picture.gathers.is_none();
    let has_links = picture.radiosity.solver == args::Solver::Hierarchical && is_new;
    if picture.overlay.contains(&args::Overlay::Links) && !has_links {
        return Err(Error::Misuse("--overlay links wants --solver hierarchical, and a solution made on the spot".into()));
    }
    if let Some([x, y]) = picture.links_of.filter(|[x, y]| *x >= stage.size.width || *y >= stage.size.height) {
        let (width, height) = (stage.size.width, stage.size.height);
        return Err(Error::Misuse(format!(
            "--links-of {x},{y} lies outside the picture: name a pixel from 0,0 to {},{}",
            width - 1,
            height - 1
        )));
    }
    let choice = auto::by_options(picture, given).unwrap_or_else(|| auto::by_scene(picture, stage, time, given));
    let shows = match choice.method {
        Method::Radiosity => true,
        Method::Hybrid => picture.show == args::Show::Radiance,
        _ => picture.solution.is_none() && picture.show == args::Show::Radiance,
    };
    if !shows {
        return Err(Error::Misuse("--solution goes with --method radiosity and hybrid, --show irradiance with radiosity".into()));
    }
    Ok(choice)
}

/// What should be said of the media of a scene, by a method or a verb of some name: the name of the warning, and the words.
pub(crate) fn about_media(scene: &Scene, by: &str, knows_media: bool) -> Option<(&'static str, String)> {
    if !knows_media {
        let text = format!("{by} knows no media that scatter or emit, and no fog: bodies only absorb; --method path knows them");
        return scene.has_media().then_some(("no-media", text));
    }
    let ends = |light: &Light| {
        !matches!(light.kind, LightKind::Distant { .. } | LightKind::Hemispherical { .. } | LightKind::Discrete { .. })
    };
    let is_endless = scene.medium.is_some_and(|medium| !medium.extinction().is_black());
    let is_lit = scene.environment.is_some() || !scene.lights.iter().all(ends);
    (is_endless && is_lit).then(|| {
        let text = "no light comes from infinitely far through a medium without end: \
                    put it into a box, as the medium of the box's material";
        ("endless-medium", text.to_owned())
    })
}

impl Choice {
    /// For this reason; for none where it was asked for.
    pub(crate) fn of(method: Method, why: Option<&'static str>) -> Self {
        Self { method, why, is_quick: false }
    }

    /// The picture by this choice; `given` are the options that were typed.
    pub(crate) fn settle(self, picture: &Picture, given: &[String]) -> Picture {
        let picture = Picture { method: self.method, ..picture.clone() };
        if self.is_quick { auto::quick(&picture, given) } else { picture }
    }

    /// Its name on the command line.
    pub(crate) fn name(self) -> &'static str {
        match self.method {
            Method::Auto | Method::Raycast => "raycast",
            Method::Whitted => "whitted",
            Method::Scanline => "scanline",
            Method::Radiosity => "radiosity",
            Method::Hybrid => "hybrid",
            Method::Path => "path",
        }
    }

    /// It knows the light between surfaces.
    pub(crate) fn solves(self) -> bool {
        matches!(self.method, Method::Radiosity | Method::Hybrid | Method::Path)
    }

    /// What its work is counted in.
    pub(crate) fn unit(self) -> &'static str {
        match self.method {
            Method::Auto | Method::Raycast | Method::Whitted | Method::Radiosity | Method::Hybrid | Method::Path => "rays",
            Method::Scanline => "triangles",
        }
    }

    /// The threshold of adaptive samples, where a picture has them.
    pub(crate) fn adaptive(self, picture: &Picture) -> Option<f32> {
        picture.adaptive.filter(|_| !matches!(self.method, Method::Scanline | Method::Path))
    }

    /// What drawing takes beside the prepared scene and the film, bytes.
    pub(crate) fn memory(self, stage: &Stage, picture: &Picture, layers: &[Layer]) -> u64 {
        let (world, sampling) = (&stage.world, sampling(stage, picture, layers));
        match self.method {
            Method::Scanline => ScanLine::memory(world, &scanline_settings(picture, &[])),
            Method::Path => progressive::memory(&sampling),
            _ => 0,
        }
    }

    /// What should be said of the picture asked for: the name of the warning, and the words. `given` are the options that were typed.
    pub(crate) fn misfits(self, picture: &Picture, stage: &Stage, given: &[String]) -> Vec<(&'static str, String)> {
        let mut said = Vec::new();
        if self.method == Method::Scanline && stage.camera.lens.is_some_and(|lens| lens.aperture > 0.0) {
            said.push(("no-lens", "scan line draws without the camera's lens: everything is in focus".to_owned()));
        }
        if let Some((name, sum)) = self.unweighed(picture, &stage.world) {
            let text = format!(
                "--fresnel off takes the constants of material \"{name}\" as they are, k_r + k_t = {sum}: it shows more light than it receives"
            );
            said.push(("makes-light", text));
        }
        said.extend(about_media(stage.world.scene(), &format!("--method {}", self.name()), self.method == Method::Path));
        said.extend(given.iter().filter_map(|option| self.why_ignored(option, picture)).map(|text| ("no-effect", text)));
        said
    }

    /// Why an option has no effect, if so.
    pub(crate) fn why_ignored(self, option: &str, picture: &Picture) -> Option<String> {
        if let Some(methods) = methods_of(option).filter(|methods| !methods.contains(&self.method)) {
            let names: Vec<&str> = methods.iter().map(|&method| Self::of(method, None).name()).collect();
            return Some(format!("--{option} changes nothing with --method {}; it is for {}", self.name(), names.join(", ")));
        }
        (self.adaptive(picture).is_some() && matches!(option, "spp" | "filter"))
            .then(|| format!("--{option} changes nothing with --adaptive, which has samples of its own"))
    }

    /// A material that `--fresnel off` makes reflect and pass more than it receives, and its `k_r + k_t`.
    fn unweighed(self, picture: &Picture, world: &World) -> Option<(String, f32)> {
        if picture.fresnel != args::Fresnel::Off || !matches!(self.method, Method::Whitted | Method::Hybrid | Method::Path) {
            return None;
        }
        world.scene().materials.iter().find_map(|material| match &material.model {
            Model::Phong(m) if !material.unlit => {
                let sum = (m.mirror + m.transmission).max_channel();
                (sum > 1.0 + 1e-4).then(|| (material.name.clone(), sum))
            }
            _ => None,
        })
    }
}

/// The methods that look at an option, where that is not all of them.
pub(crate) fn methods_of(option: &str) -> Option<&'static [Method]> {
    use Method::{Hybrid, Path, Radiosity, Raycast, Scanline, Whitted};
    Some(match option {
        "interpolation" | "cull" | "tessellation" => &[Scanline],
        "max-depth" | "fresnel" | "samples" => &[Whitted, Hybrid, Path],
        "min-weight" | "transparent-shadows" => &[Whitted, Hybrid],
        "phong" | "multiple-scattering" | "light-tracing" | "blue-noise" | "noise" | "resume" | "save-every" => &[Path],
        "adaptive" | "adaptive-level" => &[Raycast, Whitted, Radiosity, Hybrid],
        "shadows" => &[Raycast, Whitted, Hybrid],
        "environment-shadows" => &[Raycast, Whitted],
        "emitters" => &[Raycast, Whitted, Scanline],
        "viewer" => &[Raycast, Whitted, Scanline, Hybrid],
        "gather" | "cache" | "gathers" => &[Hybrid],
        "lamps" | "show" | "spread" | "ambient-term" => &[Radiosity],
        "solution" | "overlay" | "links-of" => &[Radiosity, Hybrid],
        _ if args::Radiosity::options().iter().any(|own| own == option) => &[Radiosity, Hybrid],
        _ => return None,
    })
}

/// Where the light comes from: the scene's own lights, and those it is given where nothing would be seen.
pub(crate) struct Lighting {
    /// Lights beside the scene's own.
    extra_lights: Vec<Light>,
    /// A method that traces rays, by these lights: the one asked for, or ray casting in its place.
    traced: Traced,
    /// The same for a coarse look, where the one asked for branches into many rays.
    coarse: Option<Traced>,
    /// The scene has no light of its own and was given some.
    pub(crate) is_default: bool,
    /// What should be said: the name of the warning, and the words.
    pub(crate) warnings: Vec<(&'static str, String)>,
}

/// Ray casting or recursive ray tracing.
enum Traced {
    RayCast(Box<RayCast>),
    Whitted(Box<Whitted>),
}

impl Traced {
    fn new(stage: &Stage, picture: &Picture, choice: Choice, extra_lights: &[Light]) -> Self {
        let (world, forward) = (&stage.world, stage.view.forward());
        if choice.method == Method::Whitted {
            return Self::Whitted(Box::new(Whitted::new(world, &whitted_settings(stage, picture, extra_lights), forward)));
        }
        let settings = ray_cast::Settings {
            shadows: picture.shadows == OnOff::On && choice.method != Method::Scanline,
            lights: light_settings(picture),
            viewer: viewer(picture),
            extra_lights: extra_lights.to_vec(),
            footprint: footprint(stage, picture),
        };
        Self::RayCast(Box::new(RayCast::new(world, &settings, forward)))
    }

    fn lights(&self) -> &transport::Lights {
        match self {
            Self::RayCast(method) => method.lights(),
            Self::Whitted(method) => method.lights(),
        }
    }
}

impl Integrator for Traced {
    fn sample(&self, world: &World, ray: &Ray, stream: &mut Stream, n_rays: &mut u64) -> Pixel {
        match self {
            Self::RayCast(method) => method.sample(world, ray, stream, n_rays),
            Self::Whitted(method) => method.sample(world, ray, stream, n_rays),
        }
    }

    fn branching(&self) -> u32 {
        match self {
            Self::RayCast(method) => method.branching(),
            Self::Whitted(method) => method.branching(),
        }
    }
}

impl Lighting {
    fn new(stage: &Stage, picture: &Picture, choice: Choice, extra_lights: Vec<Light>) -> Self {
        let traced = Traced::new(stage, picture, choice, &extra_lights);
        let coarse = (traced.branching() > 1 || picture.max_depth.is_some_and(|depth| depth > COARSE_DEPTH)).then(|| {
            let coarse =
                Picture { samples: None, max_depth: picture.max_depth.map(|depth| depth.min(COARSE_DEPTH)), ..picture.clone() };
            Traced::new(stage, &coarse, choice, &extra_lights)
        });
        Self { extra_lights, traced, coarse, is_default: false, warnings: Vec::new() }
    }

    /// What a coarse look is taken with.
    fn coarse(&self) -> &Traced {
        self.coarse.as_ref().unwrap_or(&self.traced)
    }
}

/// Mirrors and glass in a row that a coarse look follows: more can take very long, and seldom bring the only light.
const COARSE_DEPTH: u32 = 12;

/// Nobody wants a black picture: where the scene's own lights reach nothing the camera sees, it is given one. When `is_over` says that time is up nothing
/// is looked for.
pub(crate) fn light(stage: &Stage, picture: &Picture, choice: Choice, is_over: &dyn Fn() -> bool) -> Lighting {
    let (world, view) = (&stage.world, &stage.view);
    let mut lighting = Lighting::new(stage, picture, choice, Vec::new());
    // (`--emitters ignore` asks for just that where emitters are all there is.)
    let has_light = default_light::has_light(world);
    let wanted = has_light && picture.emitters == args::Emitters::Ignore;
    let shape = (stage.size.width, stage.size.height);
    let seen = default_light::survey(world, view, shape, lighting.coarse(), is_over);
    let is_known = !is_over();
    if is_known && !seen.sees_surface {
        lighting.warnings.push(("nothing-to-see", "the camera sees no surface".to_owned()));
    }
    // Radiosity shows light that comes around corners, which nothing cheap finds.
    let is_dark = is_known && !seen.sees_light && !(has_light && choice.solves());
    if picture.default_light == OnOff::On && !wanted && seen.sees_surface && is_dark {
        let helped = Lighting::new(stage, picture, choice, default_light::lights(&stage.camera));
        if default_light::survey(world, view, shape, helped.coarse(), is_over).sees_light {
            let names: Vec<String> = helped.extra_lights.iter().map(|l| format!("\"{}\"", l.name)).collect();
            let why = if has_light { "the scene's own lights reach nothing the camera sees" } else { "the scene has no light" };
            lighting.warnings.push(("default-light", format!("{why}: it gets {}", names.join(" and "))));
            lighting = Lighting { is_default: !has_light, warnings: lighting.warnings, ..helped };
        }
    }
    if !choice.solves()
        && let Some(said) = lighting.traced.lights().note()
    {
        lighting.warnings.push(("emitters", said));
    }
    lighting
}

/// A picture, whole or as far as it came.
pub(crate) struct Drawing {
    pub(crate) film: Film,
    /// The fraction of it that is done.
    pub(crate) done: f64,
    /// How much work it was, in the method's own unit.
    pub(crate) count: u64,
    /// How much of each pixel the lines of an overlay cover, where one is asked for.
    pub(crate) lines: Option<Vec<f32>>,
    /// How it came to its samples, where that is not known before.
    pub(crate) sampled: Option<Sampled>,
}

impl Drawing {
    /// How many samples a pixel has, in words.
    pub(crate) fn samples(&self, picture: &Picture, choice: Choice) -> String {
        self.sampled.as_ref().map_or_else(|| output::samples(picture, choice), Sampled::samples)
    }
}

/// Draws until it is done, time is up or somebody interrupts.
///
/// # Errors
/// When the film cannot be had, or the method cannot draw such a scene.
pub(crate) fn draw(
    stage: &Stage,
    picture: &Picture,
    choice: Choice,
    lighting: &Lighting,
    layers: &[Layer],
    (watch, save): (&Watch, Option<&Save>),
) -> Result<Drawing, Error> {
    let (world, view) = (&stage.world, &stage.view);
    let sampling = sampling(stage, picture, layers);
    match choice.method {
        Method::Auto | Method::Raycast | Method::Whitted => trace(&lighting.traced, stage, picture, lighting, sampling, watch),
        Method::Radiosity => {
            let settings = crate::solve::settings(&picture.radiosity, picture.seed, &lighting.extra_lights);
            let found = solve::saved_or_solved(world, &settings, picture.solution.as_deref(), &watch.work, &watch.progress)?;
            let solution = &found.solution;
            let display = display::Settings {
                interpolation: match picture.radiosity.spread {
                    args::Spread::Flat => display::Interpolation::Flat,
                    args::Spread::Gouraud => display::Interpolation::Gouraud,
                },
                lamps: match picture.lamps {
                    args::Lamps::Sharp => display::Lamps::Sharp,
                    args::Lamps::Elements => display::Lamps::Elements,
                },
                shown: match picture.show {
                    args::Show::Radiance => display::Shown::Radiance,
                    args::Show::Irradiance => display::Shown::Irradiance,
                },
                has_ambient: picture.ambient_term,
            };
            let display = Display::new(world, solution, &lighting.extra_lights, display, footprint(stage, picture))
                .with_backdrop(default_light::has_backdrop(world, &lighting.extra_lights));
            let drawing = trace(&display, stage, picture, lighting, sampling, watch)?;
            let lines = overlay(stage, picture, world, &found)?;
            Ok(Drawing { done: drawing.done.min(found.done), lines, ..drawing })
        }
        Method::Hybrid => hybrid(stage, picture, lighting, sampling, watch),
        Method::Path => {
            let settings = path_settings(stage, picture, (sampling.width, sampling.height), &lighting.extra_lights);
            let method = PathTracer::new(world, &settings);
            progressive::draw(&method, &format!("{settings:?}"), stage, picture, sampling, (watch, save))
        }
        Method::Scanline => {
            let settings = scanline_settings(picture, &lighting.extra_lights);
            let mut render = ScanLine::new(world, view, &settings, sampling)?;
            let done = watch.run(&mut render, world, ScanLine::n_triangles);
            Ok(Drawing { done, count: render.n_triangles(), film: render.into_film(), lines: None, sampled: None })
        }
    }
}

/// The same by the hybrid, from what is kept of earlier views where there is any.
///
/// # Errors
/// When what is kept is of other light or cannot be read or written, or solving takes too much memory.
fn hybrid(
    stage: &Stage,
    picture: &Picture,
    lighting: &Lighting,
    sampling: film::Sampling,
    watch: &Watch,
) -> Result<Drawing, Error> {
    let (world, view, saved) = (&stage.world, &stage.view, picture.solution.as_deref());
    let rings = solve::rings(&picture.radiosity, saved)?;
    let tessellated = radiosa::radiosity::tessellated(world, rings)?;
    let solved_in = tessellated.as_ref().unwrap_or(world);
    let radiosity = solve::settings_to_gather_from(&picture.radiosity, picture.seed, &lighting.extra_lights);
    let settings = hybrid_settings(stage, picture, lighting);
    let by = gathers::MadeBy { radiosity: &radiosity, hybrid: &settings };
    let before = picture.gathers.as_deref().filter(|path| path.exists());
    let (found, kept) = if let Some(path) = before {
        let (solution, kept) = gathers::read(path, solved_in, by, watch.work.max_memory)?;
        (solve::Found { solution, done: 1.0, links: None }, Some(kept))
    } else if saved.is_none() && !picture.overlay.contains(&args::Overlay::Links) {
        (solve::to_gather_from(solved_in, &radiosity, &watch.work, &watch.progress)?, None)
    } else {
        (solve::saved_or_solved(solved_in, &radiosity, saved, &watch.work, &watch.progress)?, None)
    };
    let n_before = kept.as_ref().map(hybrid::Kept::n_records);
    let is_over = || is_over(watch.start, &watch.work);
    let mut hybrid = match kept {
        None => Hybrid::new(world, solved_in, &found.solution, &settings, view.forward(), &is_over),
        Some(kept) => Hybrid::again(world, solved_in, &found.solution, &settings, view.forward(), kept)
            .ok_or_else(|| Error::failed("--gathers names a file of another mesh", "remove it, or name another file"))?,
    };
    let mut filling = hybrid::Filling::new(&mut hybrid, view, (sampling.width, sampling.height));
    let filled = watch.run(&mut filling, world, hybrid::Filling::n_rays);
    let n_rays = filling.n_rays();
    if let Some(path) = &picture.gathers
        && filled.min(found.done) >= 1.0
        && n_before != Some(hybrid.n_records())
    {
        gathers::write(path, solved_in, by, &found.solution, &hybrid.kept())?;
    }
    let drawing = trace(&hybrid, stage, picture, lighting, sampling, watch)?;
    let lines = overlay(stage, picture, solved_in, &found)?;
    Ok(Drawing { done: drawing.done.min(found.done).min(filled), count: drawing.count + n_rays, lines, ..drawing })
}

/// The lines asked for over a picture of a solution in the world it was made in.
///
/// # Errors
/// When there is no element whose links are asked for.
fn overlay(stage: &Stage, picture: &Picture, solved_in: &World, found: &solve::Found) -> Result<Option<Vec<f32>>, Error> {
    let size = [stage.size.width, stage.size.height];
    let (mesh, view) = (&found.solution.mesh, &stage.view);
    let mut drawn: Option<Vec<f32>> = None;
    for overlay in &picture.overlay {
        let lines = match (overlay, &found.links) {
            (args::Overlay::Mesh, _) => lines::borders(solved_in, mesh, view, size),
            (args::Overlay::Links, None) => continue,
            (args::Overlay::Links, Some(links)) => {
                let element = match picture.links_of {
                    Some(pixel) if pixel[0] < size[0] && pixel[1] < size[1] => lines::element_under(solved_in, mesh, view, pixel),
                    Some(_) => None,
                    None => lines::brightest_receiver(&found.solution),
                };
                let Some(element) = element else {
                    let what = picture.links_of.map_or("no element receives light".to_owned(), |[x, y]| {
                        format!("pixel {x},{y} of {} × {} shows no element", size[0], size[1])
                    });
                    return Err(Error::failed(what, "choose another pixel with --links-of X,Y"));
                };
                lines::links(mesh, links, element, view, size)
            }
        };
        drawn = Some(match drawn {
            Some(others) => others.into_iter().zip(lines).map(|(a, b)| a.max(b)).collect(),
            None => lines,
        });
    }
    Ok(drawn)
}

/// Draws by rays with a fixed number of samples a pixel.
fn tiled(method: &impl Integrator, stage: &Stage, sampling: film::Sampling, watch: &Watch) -> Result<Drawing, Error> {
    let mut render = tiles::TiledRender::new(method, &stage.view, sampling)?;
    let done = watch.run(&mut render, &stage.world, tiles::TiledRender::n_rays);
    Ok(Drawing { done, count: render.n_rays(), film: render.into_film(), lines: None, sampled: None })
}

/// Draws by rays: a fixed number of samples a pixel, or more where they differ.
fn trace(
    method: &impl Integrator,
    stage: &Stage,
    picture: &Picture,
    lighting: &Lighting,
    sampling: film::Sampling,
    watch: &Watch,
) -> Result<Drawing, Error> {
    let (world, view) = (&stage.world, &stage.view);
    let Some(threshold) = picture.adaptive else {
        return tiled(method, stage, sampling, watch);
    };
    let settings = adaptive::Settings {
        width: sampling.width,
        height: sampling.height,
        threshold,
        white: white(stage, picture, lighting, watch)?,
        max_level: picture.adaptive_level,
        seed: sampling.seed,
        layers: sampling.layers,
    };
    let mut render = adaptive::AdaptiveRender::new(method, view, settings)?;
    let done = watch.run(&mut render, world, adaptive::AdaptiveRender::n_rays);
    Ok(Drawing { done, count: render.n_rays(), film: render.into_film(), lines: None, sampled: None })
}

/// The radiance that will show as white, by a small and coarse picture: the exposure may depend on what is seen.
fn white(stage: &Stage, picture: &Picture, lighting: &Lighting, watch: &Watch) -> Result<f32, Error> {
    let (width, height) = (stage.size.width.min(96), stage.size.height.min(72));
    let view = View::new(&stage.camera, stage.world.origin(), width, height);
    let sampling = film::Sampling { width, height, spp: 1, filter: film::Filter::Box, seed: 0, layers: vec![Layer::Color] };
    let mut render = tiles::TiledRender::new(lighting.coarse(), &view, sampling)?;
    watch.run(&mut render, &stage.world, tiles::TiledRender::n_rays);
    let tone_map = output::tone_map(picture, stage.world.scene(), lighting.is_default);
    Ok(1.0 / tone_map.prepare(render.solution()).factor.max(f32::MIN_POSITIVE))
}

/// Who waits for a picture: shows how far it is, and ends it early.
pub(crate) struct Watch {
    start: Instant,
    work: Work,
    progress: Progress,
}

/// Somebody interrupted, or the time since `start` is up.
pub(crate) fn is_over(start: Instant, work: &Work) -> bool {
    interrupt::asked() || work.time.is_some_and(|limit| start.elapsed() >= limit)
}

impl Watch {
    /// Since the clock was started.
    pub(crate) fn new(what: &str, choice: Choice, work: &Work, start: Instant) -> Self {
        Self { start, work: work.clone(), progress: Progress::new(what, choice.unit(), work.quiet) }
    }

    /// Runs to the end or until it is to stop; the fraction done.
    fn run<S: Solver>(&self, solver: &mut S, world: &World, count: impl Fn(&S) -> u64) -> f64 {
        while let Step::Working { done } = solver.step(world) {
            self.progress.update(done, count(solver));
            if is_over(self.start, &self.work) {
                return done;
            }
        }
        1.0
    }

    /// What may be taken.
    pub(super) fn work(&self) -> &Work {
        &self.work
    }

    /// Since the clock was started.
    pub(super) fn elapsed(&self) -> Duration {
        self.start.elapsed()
    }

    /// Shows how far it is.
    pub(super) fn update(&self, done: f64, count: u64) {
        self.progress.update(done, count);
    }

    /// Takes the bar away; how long it took.
    pub(crate) fn finish(self) -> Duration {
        let time = self.start.elapsed();
        self.progress.finish();
        time
    }
}

fn sampling(stage: &Stage, picture: &Picture, layers: &[Layer]) -> film::Sampling {
    film::Sampling {
        width: stage.size.width,
        height: stage.size.height,
        spp: picture.samples_a_pixel(),
        filter: match picture.filter {
            args::Filter::Box => film::Filter::Box,
            args::Filter::Tent => film::Filter::Tent,
            args::Filter::Gaussian => film::Filter::Gaussian,
            args::Filter::Mitchell => film::Filter::Mitchell,
            args::Filter::BlackmanHarris => film::Filter::BlackmanHarris,
        },
        seed: picture.seed,
        layers: layers.to_vec(),
    }
}

fn whitted_settings(stage: &Stage, picture: &Picture, extra_lights: &[Light]) -> whitted::Settings {
    whitted::Settings {
        shadows: picture.shadows == OnOff::On,
        transparent_shadows: picture.transparent_shadows == OnOff::On,
        max_depth: picture.max_depth.unwrap_or(whitted::Settings::default().max_depth),
        min_weight: picture.min_weight,
        fresnel: weighing(picture),
        samples: picture.samples.unwrap_or(0),
        lights: light_settings(picture),
        viewer: viewer(picture),
        extra_lights: extra_lights.to_vec(),
        footprint: footprint(stage, picture),
        eye: Some(stage.view.eye()),
    }
}

fn path_settings(stage: &Stage, picture: &Picture, (width, height): (u32, u32), extra_lights: &[Light]) -> path::Settings {
    let n_pixels = u64::from(width) * u64::from(height);
    let n = n_pixels.clamp(u64::from(FROM_LIGHT[0]), u64::from(FROM_LIGHT[1])) as u32;
    path::Settings {
        max_depth: picture.max_depth,
        branches: picture.samples.unwrap_or(path::Settings::default().branches),
        drawn_lamps: path::Settings::default().drawn_lamps,
        highlights: match picture.phong {
            args::Highlights::Lobe => Highlights::Lobe,
            args::Highlights::None => Highlights::None,
        },
        multiple_scattering: picture.multiple_scattering == OnOff::On,
        fresnel: weighing(picture),
        extra_lights: extra_lights.to_vec(),
        footprint: stage.view.footprint(PATH_FOOTPRINT),
        eye: Some(stage.view.eye()),
        from_light: (picture.light_tracing == OnOff::On).then(|| path::FromLight { view: stage.view.clone(), n }),
    }
}

/// Paths from the light in a pass: one a pixel, but at least and at most so many.
const FROM_LIGHT: [u32; 2] = [1 << 12, 1 << 18];

/// Samples a pixel that textures are read for by path tracing, however many there will be: one does not know, and a sample is the same in any case.
const PATH_FOOTPRINT: u32 = 64;

fn weighing(picture: &Picture) -> whitted::Fresnel {
    match picture.fresnel {
        args::Fresnel::Material => whitted::Fresnel::Material,
        args::Fresnel::On => whitted::Fresnel::On,
        args::Fresnel::Off => whitted::Fresnel::Off,
    }
}

fn hybrid_settings(stage: &Stage, picture: &Picture, lighting: &Lighting) -> hybrid::Settings {
    let mut whitted = whitted_settings(stage, picture, &lighting.extra_lights);
    whitted.samples = picture.samples.unwrap_or(4);
    whitted.lights.environment_shadows = EnvironmentShadows::On;
    hybrid::Settings { whitted, rays: picture.gather, cache: picture.cache, seed: picture.seed }
}

fn scanline_settings(picture: &Picture, extra_lights: &[Light]) -> scanline::Settings {
    scanline::Settings {
        interpolation: match picture.interpolation {
            args::Interpolation::Flat => scanline::Interpolation::Flat,
            args::Interpolation::Gouraud => scanline::Interpolation::Gouraud,
            args::Interpolation::Phong => scanline::Interpolation::Phong,
        },
        culling: match picture.cull {
            args::Cull::None => scanline::Culling::None,
            args::Cull::Back => scanline::Culling::Back,
        },
        segments: picture.tessellation,
        lights: light_settings(picture),
        viewer: viewer(picture),
        extra_lights: extra_lights.to_vec(),
    }
}

/// How wide a camera sample is; corners of pixels, when sampled adaptively, are as wide as pixels.
fn footprint(stage: &Stage, picture: &Picture) -> transport::Footprint {
    stage.view.footprint(if picture.adaptive.is_some() { 1 } else { picture.samples_a_pixel() })
}

fn light_settings(picture: &Picture) -> transport::LightSettings {
    transport::LightSettings {
        emitters: match picture.emitters {
            args::Emitters::Ignore => transport::Emitters::Ignore,
            args::Emitters::Sample(n) => transport::Emitters::Points { n, max: 4096 },
        },
        environment_shadows: match picture.environment_shadows {
            OnOff::On => EnvironmentShadows::On,
            OnOff::Off => EnvironmentShadows::Off,
        },
    }
}

fn viewer(picture: &Picture) -> transport::Viewer {
    match picture.viewer {
        args::Viewer::Local => transport::Viewer::Local,
        args::Viewer::Infinite => transport::Viewer::Infinite,
    }
}
