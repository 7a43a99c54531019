//! Scan line against ray casting: the same faces, the same light, two ways of finding what is seen.

use std::path::Path;

use radiosa::film::tone_map::{Curve, Exposure, ToneMap};
use radiosa::film::{Decomposition, Film, Filter, Layer, Sampling};
use radiosa::import::{Options, load, sample};
use radiosa::math::{CpuPath, DAffine3, DVec3, Vec2};
use radiosa::raytrace::{RayCast, Whitted, ray_cast, tiles, whitted};
use radiosa::scanline::{self, ScanLine};
use radiosa::scene::{self, ColorMap, Model, Quantity, Sampler, ScalarMap, Scene, Texture, TextureId, TextureRef, TextureSource};
use radiosa::spectrum::Spectrum;
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
        let survey = default_light::survey(&setting.world, &setting.view, size, &setting.ray_cast(), || false);
        if !survey.sees_light {
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

const INTERPOLATIONS: [scanline::Interpolation; 3] =
    [scanline::Interpolation::Flat, scanline::Interpolation::Gouraud, scanline::Interpolation::Phong];

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
        for interpolation in INTERPOLATIONS {
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

/// The front half of a unit sphere of few faces under parallel light from the front, slightly aside, seen in parallel from far away: the light depends on the
/// normal alone.
const RINGS: u32 = 9;
const EXPONENT: f32 = 120.0;

fn sphere_setting() -> Setting {
    let mut scene = Scene::new("sphere");
    let model = scene::Phong {
        diffuse: scene::ColorMap::constant(Spectrum::BLACK),
        specular: scene::ColorMap::constant(Spectrum::WHITE),
        exponent: scene::ScalarMap::constant(EXPONENT),
        ..scene::Phong::default()
    };
    scene.materials.push(scene::Material { model: scene::Model::Phong(model), ..scene::Material::default() });
    scene.instances.push(scene::Instance {
        name: "sphere".into(),
        geometry: scene::Geometry::Sphere,
        transform: DAffine3::IDENTITY,
        material: Some(scene::MaterialId(0)),
        node: None,
    });
    let kind = scene::LightKind::Distant { to_light: to_light(), unit: scene::PhotometricUnit::Classic };
    scene.lights.push(scene::Light::new("sun", Spectrum::WHITE, kind));
    let projection = scene::Projection::Orthographic { height: 2.2 };
    scene.cameras.push(scene::Camera::look_at("camera", DVec3::Z * 5.0, DVec3::ZERO, DVec3::Y, projection));
    Setting::new(scene, 0, (201, 201), 1)
}

fn to_light() -> DVec3 {
    DVec3::new(0.3, 0.45, 1.0).normalize()
}

/// `(r·v)^n` of a normal, with the viewer towards +z.
fn highlight(n: DVec3) -> f64 {
    let l = to_light();
    let r_v = 2.0 * n.dot(l) * n.z - l.z;
    if n.dot(l) > 0.0 && r_v > 0.0 { r_v.powf(f64::from(EXPONENT)) } else { 0.0 }
}

/// The vertices that scan line's tessellation has: rings of colatitude from +y.
fn vertices() -> impl Iterator<Item = DVec3> {
    (0..=RINGS).flat_map(|i| {
        let (s, c) = (std::f64::consts::PI * f64::from(i) / f64::from(RINGS)).sin_cos();
        (0..2 * RINGS).map(move |j| {
            let (sin, cos) = (std::f64::consts::PI * f64::from(j) / f64::from(RINGS)).sin_cos();
            DVec3::new(s * cos, c, s * sin)
        })
    })
}

#[test]
fn gouraud_misses_a_highlight_between_vertices_flat_has_one_value_a_face_and_phong_finds_it() {
    let setting = sphere_setting();
    let draw =
        |interpolation| setting.scan(scanline::Settings { interpolation, segments: RINGS, ..Default::default() }, 1, &LAYERS);
    let greatest = |film: &Film| film.plane("G").unwrap().iter().fold(0f32, |a, b| a.max(*b));
    // Phong: the interpolated normal passes through the halfway vector somewhere, and the light there is 1.
    let phong = draw(scanline::Interpolation::Phong);
    assert!((0.98..1.001).contains(&greatest(&phong)), "{}", greatest(&phong));
    // Gouraud: nothing between vertices is brighter than the brightest of them, which the pixel next to it nearly shows.
    let gouraud = draw(scanline::Interpolation::Gouraud);
    let brightest = vertices().filter(|v| v.z > 0.0).map(highlight).fold(0.0, f64::max) as f32;
    assert!(brightest < 0.7, "the highlight must lie between vertices for this to tell something: {brightest}");
    assert!(
        greatest(&gouraud) <= brightest * 1.0001 && greatest(&gouraud) > brightest * 0.95,
        "{} {brightest}",
        greatest(&gouraud)
    );
    // Flat: as many values as faces that face the viewer, at most; and no more than the brightest face normal gives.
    let flat = draw(scanline::Interpolation::Flat);
    let mut values: Vec<u32> = flat.plane("G").unwrap().iter().map(|v| v.to_bits()).collect();
    values.sort_unstable();
    values.dedup();
    let front_faces = (2 * RINGS * (RINGS - 1)) as usize;
    assert!(values.len() > 4 && values.len() <= front_faces + 1, "{} values", values.len());
    let mut smooth: Vec<u32> = phong.plane("G").unwrap().iter().map(|v| v.to_bits()).collect();
    smooth.sort_unstable();
    smooth.dedup();
    assert!(smooth.len() > 10 * front_faces, "the twin: Phong is no flat shading: {} values", smooth.len());
}

#[test]
fn the_three_interpolations_agree_where_the_faces_are_small() {
    let setting = sphere_setting();
    let draw =
        |interpolation| setting.scan(scanline::Settings { interpolation, segments: 700, ..Default::default() }, 1, &LAYERS);
    let phong = draw(scanline::Interpolation::Phong);
    for (interpolation, bound) in [(scanline::Interpolation::Gouraud, 0.003), (scanline::Interpolation::Flat, 0.03)] {
        let other = draw(interpolation);
        let error = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f32>() / a.len() as f32;
        let error = error(phong.plane("G").unwrap(), other.plane("G").unwrap());
        assert!(error < bound, "{interpolation:?}: {error}");
    }
}

/// Materials whose every map is a texture of one colour, and the same as constants.
fn evenly_textured(scene: &mut Scene) -> [(Model, Model); 3] {
    const COLOR: [f32; 3] = [0.5, 0.25, 0.75];
    let color = Spectrum::from(COLOR);
    let source = TextureSource::Checker { even: color, odd: color, scale: Vec2::ONE };
    scene.textures.push(Texture { source, sampler: Sampler::default(), is_srgb: false });
    let texture = TextureRef { texture: TextureId(0), uv_set: 0, transform: None };
    let map = |factor: f32| ColorMap { factor: Spectrum::gray(factor), texture: Some(texture) };
    let value = |factor: f32| ScalarMap { factor, texture: Some(texture), channel: 2 };
    let plain = |factor: f32| ColorMap::constant(color * factor);
    let scalar = |factor: f32| ScalarMap::constant(factor * COLOR[2]);
    let phong = |map: &dyn Fn(f32) -> ColorMap, value: &dyn Fn(f32) -> ScalarMap| {
        let (ambient, diffuse, specular, exponent) = (Some(map(0.3)), map(0.8), map(0.6), value(20.0));
        Model::Phong(scene::Phong { ambient, diffuse, specular, exponent, ..Default::default() })
    };
    let cook_torrance = |map: &dyn Fn(f32) -> ColorMap, value: &dyn Fn(f32) -> ScalarMap| {
        let (ambient, diffuse, specular, alpha) = (Some(map(0.9)), map(0.5), map(0.7), value(0.4));
        Model::CookTorrance(scene::CookTorrance { ambient, diffuse, specular, alpha, ..Default::default() })
    };
    let metallic_roughness = |map: &dyn Fn(f32) -> ColorMap, value: &dyn Fn(f32) -> ScalarMap| {
        let (base_color, metallic, roughness) = (map(0.9), value(0.8), value(0.5));
        let occlusion = Some((value(0.7), 1.0));
        Model::MetallicRoughness(scene::MetallicRoughness { base_color, metallic, roughness, occlusion, ..Default::default() })
    };
    [
        (phong(&map, &value), phong(&plain, &scalar)),
        (cook_torrance(&map, &value), cook_torrance(&plain, &scalar)),
        (metallic_roughness(&map, &value), metallic_roughness(&plain, &scalar)),
    ]
}

#[test]
fn textures_of_one_colour_are_constants_at_every_interpolation() {
    let with = |model: &Model, textures: Vec<Texture>| {
        let mut scene = sphere_setting().world.scene().clone();
        scene.materials[0] = scene::Material { model: model.clone(), ..scene::Material::default() };
        (scene.textures, scene.ambient) = (textures, Spectrum::gray(0.2));
        Setting::new(scene, 0, (61, 61), 1)
    };
    let mut textured = Scene::new("textures");
    for (of_textures, of_constants) in evenly_textured(&mut textured) {
        let factors_only = without_textures(&of_textures);
        let [a, b, twin] = [&of_textures, &of_constants, &factors_only].map(|model| with(model, textured.textures.clone()));
        for interpolation in INTERPOLATIONS {
            for layers in [&Layer::ALL[..], &[Layer::Color]] {
                let draw = |s: &Setting| s.scan(scanline::Settings { interpolation, ..Default::default() }, 1, layers);
                let apart = |a: &Film, b: &Film| {
                    let pairs = a.plane("G").unwrap().iter().zip(b.plane("G").unwrap());
                    pairs.map(|(a, b)| (a - b).abs() / (1.0 + a)).fold(0f32, f32::max)
                };
                let (textures, constants) = (draw(&a), draw(&b));
                // A metal's reflectance under grazing light does not scale with its base colour, over which textures are laid.
                let is_laid_over_metal = matches!(of_textures, Model::MetallicRoughness(_)) && interpolation != INTERPOLATIONS[2];
                let bound = if is_laid_over_metal { 0.03 } else { 1e-4 };
                let error = apart(&textures, &constants);
                assert!(error < bound, "{interpolation:?} {of_textures:?}: {error}");
                assert!(apart(&textures, &draw(&twin)) > 5.0 * bound, "the twin: textures are not ignored");
            }
        }
    }
}

/// The factors of a model's maps.
fn without_textures(model: &Model) -> Model {
    let mut model = model.clone();
    let color = |map: &mut ColorMap| map.texture = None;
    let scalar = |map: &mut ScalarMap| map.texture = None;
    match &mut model {
        Model::Phong(m) => {
            m.ambient.iter_mut().chain([&mut m.diffuse, &mut m.specular]).for_each(color);
            scalar(&mut m.exponent);
        }
        Model::CookTorrance(m) => {
            m.ambient.iter_mut().chain([&mut m.diffuse, &mut m.specular]).for_each(color);
            scalar(&mut m.alpha);
        }
        Model::MetallicRoughness(m) => {
            color(&mut m.base_color);
            m.occlusion.iter_mut().map(|o| &mut o.0).chain([&mut m.metallic, &mut m.roughness]).for_each(scalar);
        }
    }
    model
}

#[test]
fn scan_line_gives_the_same_bits_at_any_thread_count() {
    let setting = Setting::new(sample::load("room").expect("it is built in"), 0, (161, 97), 2);
    let with = |n: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("threads can be had");
        pool.install(|| setting.scan(scanline::Settings::default(), 4, &Layer::ALL))
    };
    let bits = |film: &Film| film.planes().iter().flat_map(|p| p.values.iter().map(|v| v.to_bits())).collect::<Vec<_>>();
    let one = bits(&with(1));
    for n in [2, 3, 7] {
        assert!(bits(&with(n)) == one, "{n} threads");
    }
}

#[test]
fn scan_line_gives_the_same_picture_on_both_processor_paths() {
    for interpolation in INTERPOLATIONS {
        let film = |path| {
            let mut setting = Setting::new(sample::load("light-types").expect("it is built in"), 0, (161, 97), 2);
            setting.world = World::prepare(setting.world.scene().clone(), path).expect("the scene is valid");
            setting.scan(scanline::Settings { interpolation, ..Default::default() }, 1, &[Layer::Color])
        };
        assert!(film(CpuPath::Portable) == film(CpuPath::detect()), "{interpolation:?}");
    }
}

#[test]
fn layers_and_samples_do_not_change_what_is_seen() {
    for interpolation in INTERPOLATIONS {
        let setting = Setting::new(sample::load("whitted").expect("it is built in"), 0, (96, 72), 1);
        let draw = |spp, layers: &[Layer]| setting.scan(scanline::Settings { interpolation, ..Default::default() }, spp, layers);
        let all = draw(1, &Layer::ALL);
        // With all layers, every place is lit by itself; with colour alone, a face at once.
        let color = draw(1, &[Layer::Color]);
        for name in ["R", "G", "B"] {
            let (a, b) = (all.plane(name).unwrap(), color.plane(name).unwrap());
            assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 1e-4 * (1.0 + a)), "{interpolation:?} {name}");
        }
        assert!(all.plane("A") == draw(1, &[Layer::Alpha]).plane("A"), "{interpolation:?}");
        // More samples than are drawn in one round.
        let mean = |film: &Film| film.plane("G").unwrap().iter().sum::<f32>();
        let (one, many) = (mean(&draw(16, &[Layer::Color])), mean(&draw(40, &[Layer::Color])));
        assert!((one / many - 1.0).abs() < 0.01, "{interpolation:?} {one} {many}");
    }
}

#[test]
fn multisampled_edges_are_those_of_ray_casting_with_as_many_samples() {
    for name in ["parallel-plates", "phong-spheres"] {
        let setting = Setting::new(prepared(sample::load(name).expect("it is built in")), 0, (160, 90), 1);
        let (cast, scan) = (
            setting.cast(16, &[Layer::Color, Layer::Alpha]),
            setting.scan(Default::default(), 16, &[Layer::Color, Layer::Alpha]),
        );
        let (a, b) = (cast.plane("A").unwrap(), scan.plane("A").unwrap());
        // A sample in a hundred may fall on the other side of an edge that passes within 1/512 pixel, or of a sphere's facets.
        let off: f32 = a.iter().zip(b).map(|(a, b)| (a - b).abs() * 16.0).sum();
        let edges = a.iter().filter(|a| **a > 0.0 && **a < 1.0).count().max(1) as f32 * 16.0;
        assert!(off <= 0.02 * edges, "{name}: {off} of {edges} samples");
        let color = |f: &Film| f.plane("G").unwrap().iter().map(|v| f64::from(*v)).sum::<f64>();
        assert!((color(&cast) / color(&scan) - 1.0).abs() < 2e-3, "{name}: {} {}", color(&cast), color(&scan));
    }
}

/// Panes behind each other, seen from straight above, that cover a part and glow.
fn pile(n: i32, cover: f64, glow: Spectrum) -> Scene {
    let mut scene = Scene::new("pile");
    let alpha = scene::Alpha { mode: scene::AlphaMode::Blend, value: ScalarMap::constant(cover as f32) };
    let emission = ColorMap::constant(glow);
    scene.materials.push(scene::Material { alpha, emission, ..scene::Material::lambert("pane", Spectrum::BLACK) });
    for i in 0..n {
        scene.instances.push(scene::Instance {
            name: format!("pane {i}"),
            geometry: scene::Geometry::Disc,
            transform: DAffine3::from_translation(DVec3::Y * f64::from(i) * 0.01),
            material: Some(scene::MaterialId(0)),
            node: None,
        });
    }
    let projection = scene::Projection::Orthographic { height: 1.0 };
    scene.cameras.push(scene::Camera::look_at("camera", DVec3::Y * 5.0, DVec3::ZERO, DVec3::Z, projection));
    scene
}

#[test]
fn a_pile_of_transparent_faces_lets_through_what_all_of_them_do() {
    // A hundred panes that glow with 1 where they are, and cover 2 % each.
    let (n, cover) = (100, 0.02f64);
    let setting = Setting::new(pile(n, cover, Spectrum::WHITE), 0, (8, 8), 1);
    let expected = 1.0 - (1.0 - cover).powi(n);
    for film in [setting.scan(scanline::Settings::default(), 16, &LAYERS), setting.cast(1, &LAYERS)] {
        let seen = f64::from(film.color(4, 4).g);
        assert!((seen - expected).abs() < 1e-4, "{seen} instead of {expected}");
        assert!((seen - 1.0 + (1.0 - cover).powi(32)).abs() > 0.1, "the twin: only 32 of them");
    }
}

#[test]
fn a_pile_too_high_hides_what_is_behind_in_every_method() {
    // Dark panes before a white sky: 255 are passed, of more the sky behind is not seen.
    for (n, seen) in [(255, 0.99f64.powi(255)), (256, 0.0), (400, 0.0)] {
        let mut scene = pile(n, 0.01, Spectrum::BLACK);
        scene.background = Spectrum::WHITE;
        let setting = Setting::new(scene, 0, (8, 8), 1);
        let whitted = Whitted::new(&setting.world, &whitted::Settings::default(), setting.view.forward());
        let layers = [Layer::Color, Layer::Alpha];
        let traced = tiles::TiledRender::new(&whitted, &setting.view, sampling(setting.size, 1, &layers));
        let pictures = [
            setting.scan(scanline::Settings::default(), 1, &layers),
            setting.scan(scanline::Settings::default(), 4, &layers),
            setting.cast(1, &layers),
            finish(traced.expect("the film is small"), &setting.world),
        ];
        for (i, film) in pictures.iter().enumerate() {
            let (color, alpha) = (f64::from(film.color(4, 4).g), f64::from(film.plane("A").expect("it is kept")[0]));
            assert!((color - seen).abs() < 1e-4 && (alpha - (1.0 - seen)).abs() < 1e-4, "{n} panes, {i}: {color}, alpha {alpha}");
        }
    }
}

#[test]
fn what_is_far_away_takes_nothing_from_what_is_near() {
    // A speck a millimetre away and a ball at three metres, under a sky so wide.
    for radius in [10.0, 1e4, 1e8] {
        let mut scene = Scene::new("sky");
        let mut ball = |size: f64, z: f64, color: Spectrum| {
            let emission = ColorMap::constant(color);
            scene.materials.push(scene::Material { emission, two_sided: true, ..scene::Material::lambert("", Spectrum::BLACK) });
            scene.instances.push(scene::Instance {
                name: String::new(),
                geometry: scene::Geometry::Sphere,
                transform: DAffine3::from_scale_rotation_translation(DVec3::splat(size), Default::default(), DVec3::Z * z),
                material: Some(scene::MaterialId(scene.materials.len() as u32 - 1)),
                node: None,
            });
        };
        ball(radius, 0.0, Spectrum::new(0.0, 0.0, 0.5));
        ball(1.0, -4.0, Spectrum::new(0.5, 0.0, 0.0));
        ball(1e-4, -1e-3, Spectrum::new(0.0, 0.5, 0.0));
        let projection = scene::Projection::Perspective { fov_y: 1.0 };
        scene.cameras.push(scene::Camera::look_at("camera", DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, projection));
        let setting = Setting::new(scene, 0, (64, 64), 1);
        let (scan, cast) = (setting.scan(scanline::Settings::default(), 1, &LAYERS), setting.cast(1, &LAYERS));
        for (x, color) in [(32, [0.0, 0.5, 0.0]), (42, [0.5, 0.0, 0.0]), (60, [0.0, 0.0, 0.5])] {
            assert_eq!((scan.color(x, 32).to_array(), cast.color(x, 32).to_array()), (color, color), "radius {radius}, x {x}");
        }
    }
}

#[test]
fn culling_leaves_out_what_is_seen_from_behind() {
    let setting = Setting::new(sample::load("furnace").expect("it is built in"), 0, (64, 48), 1);
    let draw = |culling| setting.scan(scanline::Settings { culling, ..Default::default() }, 1, &LAYERS);
    let seen = |film: &Film| film.object_ids().unwrap().iter().filter(|id| **id > 0).count();
    let all = seen(&draw(scanline::Culling::None));
    let culled = seen(&draw(scanline::Culling::Back));
    // A room is made of fronts; turned over, of backs (what stands in it is round and has no triangles to turn).
    let mut turned = sample::load("furnace").expect("it is built in");
    turned.meshes.iter_mut().for_each(|m| m.triangles.iter_mut().for_each(|t| t.swap(1, 2)));
    let turned = Setting::new(turned, 0, (64, 48), 1);
    let other = seen(&turned.scan(scanline::Settings { culling: scanline::Culling::Back, ..Default::default() }, 1, &LAYERS));
    assert_eq!((all, culled), (64 * 48, 64 * 48));
    assert!(other * 8 < all, "{other} of {all}");
}
