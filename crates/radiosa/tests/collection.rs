//! Every scene of the collection is rendered, or refused with an error that says why; no picture is one colour without a reason.

use std::path::{Path, PathBuf};

use radiosa::film::{Decomposition, Film, Filter, Layer};
use radiosa::import::{ImportError, Options, load};
use radiosa::math::CpuPath;
use radiosa::raytrace::{RayCast, Whitted, ray_cast, tiles, whitted};
use radiosa::scanline::{self, Interpolation, ScanLine};
use radiosa::scene::Scene;
use radiosa::transport::{Emitters, Integrator, LightSettings, Solver, Step, View, World, default_light, framing};

const SIZE: (u32, u32) = (64, 48);

/// Files that hold nothing to see: no faces with area, nothing opaque, or a face two million kilometres wide.
const NOTHING_TO_SEE: [&str; 14] = [
    "image-ktx-astc.glb",
    "image-ktx-compressed-no-extension.glb",
    "image-ktx-compressed.glb",
    "image-ktx-no-extension.glb",
    "image-ktx.glb",
    "ZeroLengthBufferView.gltf",
    "number_formats.obj",
    "degenerate_mesh.obj",
    "inf_nan.obj",
    "test_lines.obj",
    "box-transparent.obj",
    "invalid-face-definition.obj",
    "line-prim.obj",
    "points-prim.obj",
];

/// OBJ files whose faces name vertices that do not exist.
const MALFORMED: [&str; 3] =
    ["invalid-relative-texture-index.obj", "invalid-relative-vertex-index.obj", "issue-140-zero-face-idx.obj"];

fn scenes(dir: &Path, out: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(dir).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() {
            scenes(&path, out);
        } else if path.extension().is_some_and(|e| e == "gltf" || e == "glb" || e == "obj") {
            out.push(path);
        }
    }
}

/// A scene as the command prepares it, small: the default light where nothing would be seen.
struct Stage {
    world: World,
    view: View,
    ray_cast: ray_cast::Settings,
}

impl Stage {
    fn new(scene: Scene) -> Self {
        let world = World::prepare(scene, CpuPath::detect()).expect("what loads can be prepared");
        let aspect = f64::from(SIZE.0) / f64::from(SIZE.1);
        let camera = world.scene().cameras.first().cloned().unwrap_or_else(|| framing::automatic(&world, aspect));
        let view = View::new(&camera, world.origin(), SIZE.0, SIZE.1);
        let lights = LightSettings { emitters: Emitters::Points { n: 1, max: 64 }, ..LightSettings::default() };
        let mut ray_cast = ray_cast::Settings { lights, ..ray_cast::Settings::default() };
        let method = RayCast::new(&world, &ray_cast, view.forward());
        if !default_light::survey(&world, &view, SIZE, &method, || false).sees_light {
            ray_cast.extra_lights = default_light::lights(&camera);
        }
        Self { world, view, ray_cast }
    }

    fn cast(&self, layers: &[Layer]) -> Film {
        self.trace(&RayCast::new(&self.world, &self.ray_cast, self.view.forward()), layers)
    }

    fn trace(&self, method: &impl Integrator, layers: &[Layer]) -> Film {
        let mut render = tiles::TiledRender::new(method, &self.view, sampling(layers)).expect("the film is small");
        while let Step::Working { .. } = render.step(&self.world) {}
        render.into_film()
    }
}

fn sampling(layers: &[Layer]) -> tiles::Settings {
    tiles::Settings { width: SIZE.0, height: SIZE.1, spp: 1, filter: Filter::Box, seed: 0, layers: layers.to_vec() }
}

/// The backdrop of the default light has a gradient; a thing in front of it, or anything lit, breaks the rows.
fn shows_something(film: &Film) -> bool {
    (0..SIZE.1).any(|y| (1..SIZE.0).any(|x| (film.color(x, y) - film.color(0, y)).map(f32::abs).max_channel() > 1e-3))
}

#[test]
fn every_scene_of_the_collection_is_rendered_or_refused_with_a_reason() {
    let Some(shared) = radiosa_testkit::shared_dir() else {
        eprintln!("skipped: the collection of scenes is not beside the checkout");
        return;
    };
    let mut files = Vec::new();
    scenes(&shared.join("scenes"), &mut files);
    files.sort();
    assert!(files.len() > 200, "only {} files found", files.len());
    let (mut refused, mut wrong) = (Vec::new(), Vec::new());
    for file in &files {
        let name = file.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        match load(file, &Options::default()) {
            Ok((scene, _)) => {
                if !shows_something(&Stage::new(scene).cast(&[Layer::Color])) && !NOTHING_TO_SEE.contains(&name.as_str()) {
                    wrong.push(format!("{name} shows nothing"));
                }
            }
            Err(ImportError::Unsupported { feature, help, .. }) => {
                assert!(feature.contains("extension") && !help.is_empty(), "{name}: {feature}");
                refused.push(name);
            }
            Err(error) if MALFORMED.contains(&name.as_str()) => assert!(error.location().is_some(), "{name}: {error}"),
            Err(error) => wrong.push(format!("{name}: {error}")),
        }
    }
    eprintln!("{} files, refused for required extensions: {}", files.len(), refused.join(", "));
    assert!(refused.len() <= 14, "{refused:?}");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Files of every kind of material, light and transparency.
const OF_EVERY_KIND: [&str; 14] = [
    "small-house/small-house.gltf",
    "country-kitchen/kitchen.gltf",
    "coffee-maker/coffee.gltf",
    "cornell-box-mcguire/CornellBox-Water.obj",
    "cornell-box-mcguire/CornellBox-Sphere.obj",
    "mixed-lighting/MixedLightingExample.gltf",
    "shader-balls/shaderball.glb",
    "utah-teapot-tea/teapot-full.gltf",
    "tonemapping-test/TonemappingTest.gltf",
    "suzanne/glTF/Suzanne.gltf",
    "spot/spot.obj",
    "game-room/tile-game-room6.glb",
    "living-room/living_room.glb",
    "glass-table/glass-table.glb",
];

#[test]
fn both_decompositions_sum_to_the_picture_by_every_local_method() {
    let Some(shared) = radiosa_testkit::shared_dir() else {
        eprintln!("skipped: the collection of scenes is not beside the checkout");
        return;
    };
    for name in OF_EVERY_KIND {
        let options = Options { allow_outside: vec![shared.clone()], ..Options::default() };
        let (scene, _) = load(&shared.join("scenes").join(name), &options).unwrap_or_else(|e| panic!("{name}: {e}"));
        let stage = Stage::new(scene);
        let ray_cast::Settings { lights, extra_lights, .. } = stage.ray_cast.clone();
        let check = |what: &str, film: &Film| {
            for kind in [Decomposition::Lobe, Decomposition::Path] {
                let error = film.decomposition_error(kind).expect("all layers are kept");
                assert!(error < 1e-5, "{name} {what} by {kind:?}: {error}");
            }
        };
        check("ray casting", &stage.cast(&Layer::ALL));
        let settings = whitted::Settings { lights: lights.clone(), extra_lights: extra_lights.clone(), ..Default::default() };
        check("whitted", &stage.trace(&Whitted::new(&stage.world, &settings, stage.view.forward()), &Layer::ALL));
        for interpolation in [Interpolation::Flat, Interpolation::Gouraud, Interpolation::Phong] {
            let (lights, extra_lights) = (lights.clone(), extra_lights.clone());
            let settings = scanline::Settings { interpolation, lights, extra_lights, ..Default::default() };
            let mut render = ScanLine::new(&stage.world, &stage.view, &settings, sampling(&Layer::ALL)).expect("it can be drawn");
            while let Step::Working { .. } = render.step(&stage.world) {}
            check("scan line", render.solution());
        }
    }
}
