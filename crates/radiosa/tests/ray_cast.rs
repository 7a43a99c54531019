//! What ray casting promises as a whole: the same bits at any thread count, the same picture at any scale and place, layers that sum to the
//! picture, and nothing black that should be lit.

use radiosa::film::{Decomposition, Film, Filter, Layer, tone_map};
use radiosa::import::sample;
use radiosa::math::{CpuPath, DAffine3, DMat3, DVec3};
use radiosa::raytrace::{RayCast, ray_cast, tiles};
use radiosa::scene::{
    Alpha, AlphaMode, ColorMap, Geometry, Instance, Material, MaterialId, Mesh, Model, Phong, ScalarMap, Scene,
};
use radiosa::spectrum::Spectrum;
use radiosa::transport::{Solver, Step, View, World, default_light, framing};
use radiosa_testkit::image::rel_mse;

const SIZE: u32 = 96;

fn built_in(name: &str) -> Scene {
    sample::load(name).unwrap_or_else(|| panic!("{name} is built in"))
}

fn render(scene: Scene, spp: u32, path: CpuPath) -> Film {
    let world = World::prepare(scene, path).expect("the scene is valid");
    let camera = world.scene().cameras.first().cloned().unwrap_or_else(|| framing::automatic(&world, 1.0));
    let view = View::new(&camera, world.origin(), SIZE, SIZE);
    let extra_lights = if default_light::has_light(&world) { Vec::new() } else { default_light::lights(&camera) };
    let settings = ray_cast::Settings { extra_lights, ..ray_cast::Settings::default() };
    let method = RayCast::new(&world, &settings, view.forward());
    let settings = tiles::Settings { width: SIZE, height: SIZE, spp, filter: Filter::Box, seed: 7, layers: Layer::ALL.to_vec() };
    let mut render = tiles::TiledRender::new(&method, &view, settings).expect("the film is small");
    while let Step::Working { .. } = render.step(&world) {}
    render.into_film()
}

fn colors(film: &Film) -> Vec<f32> {
    (0..SIZE * SIZE).flat_map(|i| film.color(i % SIZE, i / SIZE).to_array()).collect()
}

#[test]
fn the_bits_do_not_depend_on_the_number_of_threads() {
    let with = |n: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("threads can be had");
        pool.install(|| render(built_in("room"), 2, CpuPath::detect()))
    };
    let one = with(1);
    for n in [2, 3, 7] {
        let other = with(n);
        for (a, b) in one.planes().iter().zip(other.planes()) {
            let same = a.values.iter().zip(&b.values).all(|(x, y)| x.to_bits() == y.to_bits());
            assert!(same, "{} differs between 1 and {n} threads", a.name);
        }
    }
}

#[test]
fn a_box_scaled_by_a_million_either_way_shows_the_same_picture() {
    let reference = colors(&render(built_in("cornell-box"), 1, CpuPath::detect()));
    for exponent in [-6, -3, -1, 1, 3, 6] {
        let scale = 10f64.powi(exponent);
        let mut scene = built_in("cornell-box");
        scene.transform(DMat3::IDENTITY, scale);
        let error = rel_mse(&colors(&render(scene, 1, CpuPath::detect())), &reference);
        assert!(error < 1e-4, "scaled by {scale}: relMSE {error}");
    }
}

#[test]
fn a_box_far_from_the_origin_shows_the_same_picture() {
    let reference = colors(&render(built_in("cornell-box"), 1, CpuPath::detect()));
    let mut scene = built_in("cornell-box");
    let far = DVec3::new(4e5, -7e4, 2e6);
    for instance in &mut scene.instances {
        instance.transform = DAffine3::from_translation(far) * instance.transform;
    }
    for camera in &mut scene.cameras {
        camera.position += far;
    }
    let error = rel_mse(&colors(&render(scene, 1, CpuPath::detect())), &reference);
    assert!(error < 1e-4, "relMSE {error}");
}

#[test]
fn the_portable_path_shows_the_same_picture_as_the_fast_one() {
    let fast = colors(&render(built_in("room"), 1, CpuPath::detect()));
    let error = rel_mse(&colors(&render(built_in("room"), 1, CpuPath::Portable)), &fast);
    assert!(error < 1e-4, "relMSE {error}");
}

#[test]
fn both_decompositions_sum_to_the_picture_in_every_built_in_scene() {
    for scene in sample::list() {
        let film = render(built_in(scene.name), 2, CpuPath::detect());
        for kind in [Decomposition::Lobe, Decomposition::Path] {
            let error = film.decomposition_error(kind).expect("all layers are kept");
            assert!(error < 1e-5, "{} by {kind:?}: {error}", scene.name);
        }
    }
}

/// Two parallel squares seen head-on; the nearer one's material is `front`, what lies behind glows with radiance 2.
fn before_a_glow(front: Material) -> Scene {
    let mut scene = Scene::new("squares");
    let glow = Material { emission: ColorMap::constant(Spectrum::gray(2.0)), ..Material::lambert("glow", Spectrum::BLACK) };
    scene.materials = vec![front, glow];
    let corner = |x, y| DVec3::new(x, y, 0.0);
    scene.meshes.push(Mesh {
        positions: vec![corner(-9.0, -9.0), corner(9.0, -9.0), corner(9.0, 9.0), corner(-9.0, 9.0)],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    });
    for (material, z) in [(0, 0.0), (1, -3.0)] {
        scene.instances.push(Instance {
            name: String::new(),
            geometry: Geometry::Mesh(radiosa::scene::MeshId(0)),
            transform: DAffine3::from_translation(DVec3::Z * z),
            material: Some(MaterialId(material)),
            node: None,
        });
    }
    scene
}

fn centre_of(scene: Scene) -> Spectrum {
    let mut scene = scene;
    let ahead = radiosa::scene::Projection::Perspective { fov_y: 0.5 };
    scene.cameras.push(radiosa::scene::Camera::look_at("main", DVec3::Z * 5.0, DVec3::ZERO, DVec3::Y, ahead));
    render(scene, 1, CpuPath::detect()).color(SIZE / 2, SIZE / 2)
}

#[test]
fn alpha_covers_the_fraction_it_says_and_masks_cut() {
    let with = |mode, value| {
        let alpha = Alpha { mode, value: ScalarMap::constant(value) };
        centre_of(before_a_glow(Material { alpha, ..Material::lambert("front", Spectrum::BLACK) })).g
    };
    assert!((with(AlphaMode::Blend, 0.25) - 1.5).abs() < 1e-5);
    assert!((with(AlphaMode::Blend, 0.0) - 2.0).abs() < 1e-5);
    assert_eq!(with(AlphaMode::Opaque, 0.25), 0.0);
    assert_eq!(with(AlphaMode::Mask { cutoff: 0.5 }, 0.6), 0.0);
    assert_eq!(with(AlphaMode::Mask { cutoff: 0.5 }, 0.4), 2.0);
}

#[test]
fn transmission_filters_what_lies_behind() {
    let model = Model::Phong(Phong {
        diffuse: ColorMap::constant(Spectrum::BLACK),
        transmission: Spectrum::new(0.5, 0.25, 0.0),
        // Of index 1 nothing is reflected.
        ior: 1.0,
        ..Phong::default()
    });
    let seen = centre_of(before_a_glow(Material { model, ..Material::default() }));
    assert!((seen.r - 1.0).abs() < 1e-5 && (seen.g - 0.5).abs() < 1e-5 && seen.b == 0.0, "{seen:?}");
}

/// The colours of the near and the far plate of each pair, as a screen shows them: bytes.
fn plates() -> [[[u8; 3]; 2]; 2] {
    let film = render(built_in("parallel-plates"), 1, CpuPath::detect());
    let shown = tone_map::ToneMap::default().prepare(&film).to_srgb8(&film);
    // The picture is a square of 4.8 units; `x`, `y` in the units of the scene.
    let pixel = |x: f64, y: f64| {
        let at = |v: f64| ((v / 4.8 + 0.5) * f64::from(SIZE)) as usize;
        let i = 3 * (at(-y) * SIZE as usize + at(x));
        [shown[i], shown[i + 1], shown[i + 2]]
    };
    [[pixel(-2.0, -0.5), pixel(-1.6, 0.5)], [pixel(1.7, -0.5), pixel(2.2, 0.5)]]
}

#[test]
fn parallel_plates_merge_without_attenuation_and_separate_with_it() {
    let differ = |pair: [[u8; 3]; 2]| (0..3).map(|c| pair[0][c].abs_diff(pair[1][c])).max();
    let [left, right] = plates();
    assert!(left[0][0] > 150 && differ(left) <= Some(1), "{left:?}");
    // Half the light is about a quarter less on a screen; this pair is the broken twin of the first.
    assert!(differ(right) > Some(40), "{right:?}");
}

#[test]
fn a_scene_without_light_is_never_black() {
    let mut scene = before_a_glow(Material::lambert("front", Spectrum::gray(0.5)));
    scene.materials[1] = Material::lambert("back", Spectrum::gray(0.5));
    let seen = centre_of(scene);
    assert!(seen.g > 0.2 && seen.g < 1.0, "{seen:?}");
}

/// A round mesh of `n` rings with smooth normals, or the exact sphere.
fn ball(n: Option<u32>) -> Scene {
    let mut scene = Scene::new("ball");
    let geometry = match n {
        None => Geometry::Sphere,
        Some(n) => {
            let columns = 2 * n;
            let mut mesh = Mesh::default();
            for i in 0..=n {
                for j in 0..=columns {
                    let (theta, phi) =
                        (f64::from(i) * std::f64::consts::PI / f64::from(n), f64::from(j) * std::f64::consts::PI / f64::from(n));
                    mesh.positions.push(DVec3::new(theta.sin() * phi.cos(), theta.cos(), -theta.sin() * phi.sin()));
                }
            }
            let at = |i: u32, j: u32| i * (columns + 1) + j;
            for i in 0..n {
                for j in 0..columns {
                    mesh.triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
                    mesh.triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
                }
            }
            mesh.normals = Some(mesh.positions.iter().map(|p| p.as_vec3()).collect());
            scene.meshes.push(mesh);
            Geometry::Mesh(radiosa::scene::MeshId(0))
        }
    };
    scene.materials.push(Material::lambert("white", Spectrum::WHITE));
    scene.instances.push(Instance {
        name: String::new(),
        geometry,
        transform: DAffine3::IDENTITY,
        material: Some(MaterialId(0)),
        node: None,
    });
    let sun = radiosa::scene::LightKind::Distant { to_light: DVec3::new(1.0, 0.4, 0.1).normalize(), unit: Default::default() };
    scene.lights.push(radiosa::scene::Light::new("sun", Spectrum::WHITE, sun));
    let parallel = radiosa::scene::Projection::Orthographic { height: 1.2 };
    scene.cameras.push(radiosa::scene::Camera::look_at("main", DVec3::Z * 4.0, DVec3::ZERO, DVec3::Y, parallel));
    scene
}

#[test]
fn a_coarse_round_mesh_has_no_steps_at_the_terminator() {
    let exact = colors(&render(ball(None), 1, CpuPath::detect()));
    let coarse = colors(&render(ball(Some(12)), 1, CpuPath::detect()));
    let worst = exact.iter().zip(&coarse).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    // Interpolated normals differ from the sphere's by this much; a facet shadowing itself is off by 0.09.
    let at = exact.iter().zip(&coarse).position(|(a, b)| (a - b).abs() == worst).unwrap_or(0);
    let (x, y) = (at as u32 / 3 % SIZE, at as u32 / 3 / SIZE);
    assert!(worst < 0.04, "off by {worst} at ({x}, {y}): {} instead of {}", coarse[at], exact[at]);
}

/// A white floor of radiance `k` under a classic light that hangs in the very plane of a ceiling: every pixel is lit.
#[test]
fn a_lamp_in_the_plane_of_a_ceiling_is_not_hidden_by_it() {
    for (tilt, height) in [(0.0, 3.0), (0.0, 2.7), (0.3, 3.0)] {
        let mut scene = before_a_glow(Material::lambert("white", Spectrum::gray(0.5)));
        scene.materials[1] = scene.materials[0].clone();
        scene.instances[1].transform =
            DAffine3::from_translation(DVec3::Z * height) * DAffine3::from_rotation_x(std::f64::consts::PI + tilt);
        let position = DVec3::new(0.1, 0.0, height);
        let kind = radiosa::scene::LightKind::Point {
            position,
            unit: Default::default(),
            attenuation: Default::default(),
            range: f64::INFINITY,
        };
        scene.lights.push(radiosa::scene::Light::new("lamp", Spectrum::WHITE, kind));
        let ahead = radiosa::scene::Projection::Perspective { fov_y: 1.0 };
        let eye = DVec3::new(0.0, 0.5, height - 1.0);
        scene.cameras.push(radiosa::scene::Camera::look_at("main", eye, DVec3::ZERO, DVec3::Y, ahead));
        let film = render(scene, 1, CpuPath::detect());
        let dark = (0..SIZE * SIZE).filter(|i| film.color(i % SIZE, i / SIZE).is_black()).count();
        assert_eq!(dark, 0, "tilt {tilt}, height {height}");
    }
}

#[test]
fn an_emitter_lights_by_what_is_there_of_it() {
    let seen = |mode, value| {
        let mut scene = before_a_glow(Material::lambert("white", Spectrum::gray(0.5)));
        // The glowing square stands beside the camera's view, facing the white one.
        scene.instances[1].transform =
            DAffine3::from_translation(DVec3::new(0.0, 0.0, 30.0)) * DAffine3::from_rotation_x(std::f64::consts::PI);
        scene.materials[1].alpha = Alpha { mode, value: ScalarMap::constant(value) };
        // Next to nothing, so that the scene is never without light and given one.
        scene.ambient = Spectrum::gray(1e-9);
        centre_of(scene).g
    };
    let whole = seen(AlphaMode::Opaque, 1.0);
    assert!(whole > 0.01);
    assert!((seen(AlphaMode::Blend, 0.25) / whole - 0.25).abs() < 1e-4);
    assert!(seen(AlphaMode::Mask { cutoff: 0.5 }, 0.4) < 1e-8);
    assert!((seen(AlphaMode::Mask { cutoff: 0.5 }, 0.6) / whole - 1.0).abs() < 1e-4);
}

#[test]
fn a_constant_environment_shows_its_radiance_times_the_reflectance() {
    let mut scene = before_a_glow(Material::lambert("white", Spectrum::gray(0.8)));
    scene.instances.truncate(1);
    scene.environment = Some(radiosa::scene::Environment { scale: Spectrum::gray(0.7), ..Default::default() });
    let seen = centre_of(scene).g;
    assert!((seen - 0.56).abs() < 1e-4, "{seen}");
}
