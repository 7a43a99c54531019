//! Scan line against ray casting: the same faces, the same light, two ways of finding what is seen.

use std::path::Path;

use radiosa::film::tone_map::{Curve, Exposure, ToneMap};
use radiosa::film::{Decomposition, Film, Filter, Layer, Sampling};
use radiosa::import::{Options, load, sample};
use radiosa::math::CpuPath;
use radiosa::raytrace::{RayCast, ray_cast, tiles};
use radiosa::scanline::{self, ScanLine};
use radiosa::scene::{self, Quantity, Scene};
use radiosa::transport::{Emitters, LightSettings, Solver, Step, View, World, default_light, framing};

fn sampling(size: (u32, u32), spp: u32, layers: &[Layer]) -> Sampling {
    Sampling { width: size.0, height: size.1, spp, filter: Filter::Box, seed: 0, layers: layers.to_vec() }
}

fn finish<S: Solver<Solution = Film>>(mut solver: S, world: &World) -> Film {
    while let Step::Working { .. } = solver.step(world) {}
    solver.solution().clone()
}

/// Everything two methods share.
struct Setting {
    world: World,
    view: View,
    lights: LightSettings,
    extra_lights: Vec<scene::Light>,
    size: (u32, u32),
}

impl Setting {
    fn new(scene: Scene, camera: usize, size: (u32, u32), emitters: u32) -> Self {
        let world = World::prepare(scene, CpuPath::detect()).expect("the scene is valid");
        let aspect = f64::from(size.0) / f64::from(size.1);
        let camera = world.scene().cameras.get(camera).cloned().unwrap_or_else(|| framing::automatic(&world, aspect));
        let view = View::new(&camera, world.origin(), size.0, size.1);
        let lights = LightSettings { emitters: Emitters::Points { n: emitters, max: 256 }, ..LightSettings::default() };
        let mut setting = Self { world, view, lights, extra_lights: Vec::new(), size };
        let survey = default_light::survey(&setting.world, &setting.view, size, &setting.ray_cast());
        if survey.visible == 0 {
            setting.extra_lights = default_light::lights(&camera);
        }
        setting
    }

    fn ray_cast(&self) -> RayCast {
        let settings = ray_cast::Settings {
            shadows: false,
            lights: self.lights.clone(),
            extra_lights: self.extra_lights.clone(),
            ..ray_cast::Settings::default()
        };
        RayCast::new(&self.world, &settings, self.view.forward())
    }

    fn cast(&self, spp: u32, layers: &[Layer]) -> Film {
        let method = self.ray_cast();
        finish(
            tiles::TiledRender::new(&method, &self.view, sampling(self.size, spp, layers)).expect("the film is small"),
            &self.world,
        )
    }

    fn scan(&self, settings: scanline::Settings, spp: u32, layers: &[Layer]) -> Film {
        let settings = scanline::Settings { lights: self.lights.clone(), extra_lights: self.extra_lights.clone(), ..settings };
        let solver =
            ScanLine::new(&self.world, &self.view, &settings, sampling(self.size, spp, layers)).expect("it can be drawn");
        finish(solver, &self.world)
    }
}

/// How two pictures of one view differ.
#[derive(Debug)]
struct Agreement {
    /// The share of those within 1/255 on screen.
    alike: f64,
    /// Pixels whose object is in no neighbour of the other picture.
    far_silhouettes: usize,
    /// The share of pixels away from silhouettes.
    share: f64,
}

fn compare(a: &Film, b: &Film, quantity: Quantity) -> Agreement {
    let exposure = if quantity == Quantity::Photometric { Exposure::Automatic } else { Exposure::Factor(1.0) };
    let tone = ToneMap { exposure, curve: Curve::Clamp }.prepare(a);
    let (w, h) = (a.width() as i64, a.height() as i64);
    let at = |x: i64, y: i64| (y * w + x) as usize;
    let (ids_a, ids_b) = (a.object_ids().unwrap(), b.object_ids().unwrap());
    let (depth, normals) = (a.plane("depth.Z").unwrap(), ["normal.X", "normal.Y", "normal.Z"].map(|n| a.plane(n).unwrap()));
    let around = |x: i64, y: i64| {
        (-1..=1)
            .flat_map(move |j| (-1..=1).map(move |i| (x + i, y + j)))
            .filter(move |(x, y)| (0..w).contains(x) && (0..h).contains(y))
    };
    let (mut inner, mut alike, mut far) = (0, 0, 0);
    for y in 0..h {
        for x in 0..w {
            let i = at(x, y);
            if ids_a[i] != ids_b[i] && !around(x, y).any(|(x, y)| ids_b[at(x, y)] == ids_a[i]) {
                far += 1;
            }
            // A silhouette: another object, a jump in depth, or a crease next door, in either direction.
            let smooth = around(x, y).all(|(x, y)| {
                let j = at(x, y);
                let turned: f32 = normals.iter().map(|n| n[i] * n[j]).sum();
                ids_a[j] == ids_a[i] && (depth[i] == depth[j] || ((depth[i] - depth[j]).abs() < 0.05 * depth[i] && turned > 0.8))
            });
            if !smooth {
                continue;
            }
            inner += 1;
            let shown = |f: &Film| tone.apply(f.color(x as u32, y as u32)).map(radiosa::film::srgb::encode);
            let difference = (shown(a) - shown(b)).map(f32::abs).max_channel();
            alike += usize::from(difference <= 1.0 / 255.0);
        }
    }
    Agreement { alike: alike as f64 / inner.max(1) as f64, far_silhouettes: far, share: inner as f64 / (w * h) as f64 }
}

const LAYERS: [Layer; 4] = [Layer::Color, Layer::Normal, Layer::Depth, Layer::ObjectId];

fn prepared(mut scene: Scene) -> Scene {
    scene.remove_transparency();
    scene.set_texture_filter(scene::Filter::Bilinear);
    scene
}

fn check_agreement(name: &str, scene: Scene, camera: usize) -> Option<String> {
    let setting = Setting::new(prepared(scene), camera, (320, 240), 2);
    let (cast, scan) = (setting.cast(1, &LAYERS), setting.scan(scanline::Settings::default(), 1, &LAYERS));
    let agreement = compare(&cast, &scan, setting.world.scene().quantity);
    eprintln!("{name:40} {agreement:?}");
    let n = (setting.size.0 * setting.size.1) as usize;
    let fine = agreement.alike >= 0.995 && agreement.far_silhouettes * 2000 <= n && agreement.share > 0.5;
    (!fine).then(|| format!("{name}: {agreement:?}"))
}

#[test]
fn phong_interpolation_shows_what_ray_casting_without_shadows_shows() {
    let mut wrong = Vec::new();
    for sample in sample::list() {
        let scene = sample::load(sample.name).expect("it is built in");
        wrong.extend(check_agreement(sample.name, scene, 0));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_same_holds_on_the_rooms_and_models_of_the_collection() {
    let Some(shared) = radiosa_testkit::shared_dir() else {
        eprintln!("skipped: the collection of scenes is not beside the checkout");
        return;
    };
    let rooms = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/rooms");
    let options = Options { allow_outside: vec![shared.clone()], ..Options::default() };
    let files = [
        (rooms.join("game-room.toml"), 0),
        (rooms.join("house-lightmap.toml"), 0),
        (rooms.join("living-room.toml"), 0),
        (rooms.join("occlusion-room.toml"), 0),
        (rooms.join("sauerbraten-pandora.toml"), 0),
        (rooms.join("sauerbraten-zdm2.toml"), 0),
        (rooms.join("sauerbraten-zdm2.toml"), 1),
        (rooms.join("simple-room.toml"), 0),
        (shared.join("scenes/small-house/small-house.gltf"), 0),
        (shared.join("scenes/country-kitchen/kitchen.gltf"), 0),
        (shared.join("scenes/coffee-maker/coffee.gltf"), 0),
        (shared.join("scenes/cornell-box-mcguire/CornellBox-Water.obj"), 0),
        (shared.join("scenes/suzanne/glTF/Suzanne.gltf"), 0),
        (shared.join("scenes/spot/spot.obj"), 0),
        (shared.join("scenes/mixed-lighting/MixedLightingExample.gltf"), 0),
        (shared.join("scenes/shader-balls/shaderball.glb"), 0),
        (shared.join("scenes/utah-teapot-tea/teapot-full.gltf"), 0),
        (shared.join("scenes/tonemapping-test/TonemappingTest.gltf"), 0),
    ];
    let mut wrong = Vec::new();
    for (file, camera) in files {
        let (scene, _) = load(&file, &options).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
        let name = format!("{} {camera}", file.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default());
        wrong.extend(check_agreement(&name, scene, camera));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn both_decompositions_sum_to_the_picture_at_every_interpolation() {
    for name in ["room", "whitted", "light-types", "phong-spheres"] {
        let setting = Setting::new(sample::load(name).expect("it is built in"), 0, (96, 72), 2);
        for interpolation in [scanline::Interpolation::Flat, scanline::Interpolation::Gouraud, scanline::Interpolation::Phong] {
            for spp in [1, 4] {
                let film = setting.scan(scanline::Settings { interpolation, ..Default::default() }, spp, &Layer::ALL);
                for kind in [Decomposition::Lobe, Decomposition::Path] {
                    let error = film.decomposition_error(kind).expect("it has all layers");
                    assert!(error < 1e-5, "{name} {interpolation:?} {spp}: {kind:?} {error}");
                }
            }
        }
    }
}
