//! Everything before the first ray: the scene, the camera, the size of the picture, the layers, the memory.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use radiosa::film::{self, Film, Layer};
use radiosa::import::{self, Override, Warning};
use radiosa::math::{CpuPath, DMat3};
use radiosa::scene::{Camera, Environment, EnvironmentRadiance, Filter, Projection, Scene};
use radiosa::spectrum::Spectrum;
use radiosa::transport::{View, World, framing};

use super::auto;
use crate::args::{self, Method, OnOff, Picture, SceneChanges, Size, TextureFilter, Work};
use crate::error::Error;
use crate::solve;

/// A scene ready to be drawn, from one camera at one size.
pub(crate) struct Stage {
    pub(crate) world: World,
    pub(crate) camera: Camera,
    pub(crate) size: Size,
    pub(crate) view: View,
    /// About what the prepared scene takes, bytes.
    pub(crate) memory: u64,
    /// Preparing the world took this long.
    pub(crate) build_time: Duration,
}

impl Stage {
    /// Prepares a scene for the method that is asked for, or that the `given` options, those that were typed, are for.
    ///
    /// # Errors
    /// When it takes too much memory, is wrong, or has no such camera.
    pub(crate) fn new(mut scene: Scene, picture: &Picture, given: &[String], work: &Work) -> Result<Self, Error> {
        let cpu_path = cpu_path(work.cpu_path)?;
        // (The hybrid shows shapes as they are, and has those of its solution beside them.)
        let method = auto::by_options(picture, given).map(|choice| choice.method);
        if method == Some(Method::Radiosity) || (picture.solution.is_some() && method != Some(Method::Hybrid)) {
            radiosa::radiosity::tessellate(&mut scene, solve::rings(&picture.radiosity, picture.solution.as_deref())?);
        }
        let memory = scene_memory(&scene);
        within_memory_or("the scene", memory, work, OF_SCENES)?;
        let start = Instant::now();
        let world = World::prepare(scene, cpu_path)?;
        let build_time = start.elapsed();
        let (camera, size) = camera_and_size(&world, picture)?;
        let view = View::new(&camera, world.origin(), size.width, size.height);
        Ok(Self { world, camera, size, view, memory, build_time })
    }

    /// What the scene and a film with these layers take, bytes; writing holds a copy of the film.
    pub(crate) fn memory_with(&self, layers: &[Layer]) -> u64 {
        self.memory + 2 * Film::memory(self.size.width, self.size.height, layers)
    }
}

/// A scene prepared without a camera.
///
/// # Errors
/// When it takes too much memory or is wrong.
pub(crate) fn prepare(scene: Scene, work: &Work) -> Result<World, Error> {
    let cpu_path = cpu_path(work.cpu_path)?;
    within_memory_or("the scene", scene_memory(&scene), work, OF_SCENES)?;
    Ok(World::prepare(scene, cpu_path)?)
}

/// What helps where a scene takes too much.
const OF_SCENES: &str = "ask for a larger --max-memory, or leave parts of the scene out";

/// About what a prepared world takes, bytes: so much a primitive, and the pictures.
fn scene_memory(scene: &Scene) -> u64 {
    scene.n_primitives() * 230 + scene.images.iter().map(image_bytes).sum::<u64>()
}

/// An error when something of a known size is more than what is allowed.
pub(crate) fn within_memory(what: &str, needed: u64, work: &Work) -> Result<(), Error> {
    within_memory_or(what, needed, work, "ask for a smaller --size, fewer --layers, or a larger --max-memory")
}

/// The same with other advice.
pub(crate) fn within_memory_or(what: &str, needed: u64, work: &Work, advice: &str) -> Result<(), Error> {
    if needed <= work.max_memory {
        return Ok(());
    }
    // Both in one unit in which they differ.
    let (unit, name) = if work.max_memory < 10 << 20 { (1 << 10, "KiB") } else { (1 << 20, "MiB") };
    let (needed, allowed) = (needed.div_ceil(unit), work.max_memory / unit);
    Err(Error::failed(format!("{what} takes about {needed} {name}, more than the {allowed} {name} allowed"), advice))
}

fn image_bytes(image: &radiosa::scene::Image) -> u64 {
    use radiosa::scene::Pixels;
    match &image.pixels {
        Pixels::Rgba8(p) => p.len() as u64,
        Pixels::Rgba16(p) => 2 * p.len() as u64,
        Pixels::Rgba32F(p) => 4 * p.len() as u64,
    }
}

/// The instruction set asked for.
///
/// # Errors
/// When this processor lacks it.
pub(crate) fn cpu_path(choice: args::CpuPath) -> Result<CpuPath, Error> {
    let best = CpuPath::detect();
    match choice {
        args::CpuPath::Auto => Ok(best),
        args::CpuPath::Portable => Ok(CpuPath::Portable),
        args::CpuPath::Avx2 if best == CpuPath::Avx2 => Ok(best),
        args::CpuPath::Avx2 => Err(Error::failed("this processor has no AVX2 with FMA", "use --cpu-path portable")),
    }
}

/// The scene, built in or from a file, with what the command line changes.
pub(crate) fn load(name: &str, changes: &SceneChanges, work: &Work, warnings: &mut Vec<Warning>) -> Result<Scene, Error> {
    adjust(read(name, &changes.set, work, warnings)?, changes, work)
}

/// The scene, built in or from a file, with some of its values replaced.
pub(crate) fn read(name: &str, set: &[Override], work: &Work, warnings: &mut Vec<Warning>) -> Result<Scene, Error> {
    let path = Path::new(name);
    if let Some(scene) = import::sample::load_with(name, set) {
        return Ok(scene?);
    }
    if !path.exists() && path.extension().is_none() {
        return Err(crate::scenes::unknown(name));
    }
    let (scene, found) = import::load_with(path, set, &import_options(work))?;
    warnings.extend(found);
    Ok(scene)
}

fn import_options(work: &Work) -> import::Options {
    import::Options { allow_outside: work.allow_outside.clone(), max_memory: work.max_memory }
}

/// A scene with what the command line changes in it.
///
/// # Errors
/// When an environment cannot be read.
pub(crate) fn adjust(mut scene: Scene, changes: &SceneChanges, work: &Work) -> Result<Scene, Error> {
    if changes.up.is_some() || changes.scale.is_some() {
        let up = match changes.up {
            // Turns +z up into +y up.
            Some(args::Up::Z) => DMat3::from_rotation_x(-std::f64::consts::FRAC_PI_2),
            _ => DMat3::IDENTITY,
        };
        scene.transform(up, changes.scale.unwrap_or(1.0));
    }
    if let Some(ambient) = changes.ambient {
        scene.ambient = ambient.into();
    }
    if let Some(background) = changes.background {
        scene.background = background.into();
    }
    match changes.environment.as_deref() {
        None => {}
        Some("none") => scene.environment = None,
        Some(text) => scene.environment = Some(environment(text, &mut scene, work)?),
    }
    match changes.texture_filter {
        TextureFilter::Scene => {}
        TextureFilter::Nearest => scene.set_texture_filter(Filter::Nearest),
        TextureFilter::Bilinear => scene.set_texture_filter(Filter::Bilinear),
        TextureFilter::Mipmap => scene.set_texture_filter(Filter::Mipmap),
    }
    if changes.blending == OnOff::Off {
        scene.remove_transparency();
    }
    Ok(scene)
}

fn environment(text: &str, scene: &mut Scene, work: &Work) -> Result<Environment, Error> {
    let constant = args::parse_color(text).ok().filter(|_| !Path::new(text).exists());
    let (radiance, scale) = match constant {
        Some(radiance) => (EnvironmentRadiance::Constant, radiance.into()),
        None => {
            let id = radiosa::scene::ImageId(scene.images.len() as u32);
            scene.images.push(import::load_picture(Path::new(text), &import_options(work))?);
            (EnvironmentRadiance::Map(id), Spectrum::WHITE)
        }
    };
    Ok(Environment { radiance, scale, ..Environment::default() })
}

fn camera_and_size(world: &World, picture: &Picture) -> Result<(Camera, Size), Error> {
    let cameras = &world.scene().cameras;
    let chosen = match picture.camera.as_deref() {
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
    let size = picture.size.unwrap_or_else(|| {
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
pub(crate) fn layers(choices: &[args::LayerChoice], outputs: &[PathBuf]) -> Vec<Layer> {
    let mut layers = vec![Layer::Color, Layer::Alpha];
    let wants_layers = outputs.iter().any(|o| o.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr")));
    if !wants_layers {
        return layers;
    }
    for choice in choices {
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
            C::Variance => &[Layer::Variance, Layer::Samples],
            C::Object => &[Layer::ObjectId],
        });
    }
    layers
}
