//! What recursive ray tracing promises, against closed forms: refraction, total reflection, energy at interfaces, absorption, nested bodies,
//! mirrors, limits; and as a whole: the same bits at any thread count, layers that sum to the picture, no input that hangs.

use radiosa::emitter::random::PointSampler;
use radiosa::film::{Decomposition, Film, Filter, Layer, Pixel};
use radiosa::import::sample;
use radiosa::math::{CpuPath, DAffine3, DVec3, Ray, Vec3, Vec4};
use radiosa::raytrace::whitted::{DEPTH_LIMIT, Fresnel, Settings};
use radiosa::raytrace::{Whitted, adaptive, tiles};
use radiosa::sampling::Stream;
use radiosa::scene::{
    ColorMap, CookTorrance, Geometry, Instance, Lens, Light, LightKind, Material, MaterialId, Mesh, MeshId, MetallicRoughness,
    Model, Phong, PhotometricUnit, ScalarMap, Scene,
};
use radiosa::spectrum::Spectrum;
use radiosa::transport::{Integrator, Solver, Step, View, World, default_light, framing};
use radiosa_testkit::{brdf, optics};

// ------------------------------------------------------------------------------------------------ scenes

/// Half the side of slabs and screens.
const WIDE: f64 = 50.0;

fn glass(ior: f64) -> Phong {
    Phong { diffuse: ColorMap::constant(Spectrum::BLACK), transmission: Spectrum::WHITE, ior: ior as f32, ..Phong::default() }
}

fn fresnel_glass(ior: f64) -> Phong {
    Phong { mirror: Spectrum::WHITE, fresnel: true, ..glass(ior) }
}

fn add(scene: &mut Scene, mesh: Mesh, material: Material) {
    scene.meshes.push(mesh);
    scene.materials.push(material);
    place(scene, Geometry::Mesh(MeshId(scene.meshes.len() as u32 - 1)), DAffine3::IDENTITY);
}

/// An instance of the last material.
fn place(scene: &mut Scene, geometry: Geometry, transform: DAffine3) {
    let material = Some(MaterialId(scene.materials.len() as u32 - 1));
    scene.instances.push(Instance { name: String::new(), geometry, transform, material, node: None });
}

fn model(model: Phong) -> Material {
    Material { model: Model::Phong(model), ..Material::default() }
}

/// A box of `z` from `lo` to `hi`, as wide as everything.
fn slab(lo: f64, hi: f64) -> Mesh {
    let corner = |i: usize| {
        let side = |bit: usize| if i >> bit & 1 == 1 { WIDE } else { -WIDE };
        DVec3::new(side(0), side(1), if i >> 2 & 1 == 1 { hi } else { lo })
    };
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    Mesh {
        positions: (0..8).map(corner).collect(),
        triangles: faces.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect(),
        ..Mesh::default()
    }
}

/// A square in the plane z that shows where it is met: red is x, green is y, over its width, from 0 to 1.
fn screen(scene: &mut Scene, z: f64) {
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    let mesh = Mesh {
        positions: corners.iter().map(|(x, y)| DVec3::new(x * WIDE, y * WIDE, z)).collect(),
        colors: Some(corners.iter().map(|(x, y)| Vec4::new(0.5 + 0.5 * *x as f32, 0.5 + 0.5 * *y as f32, 0.0, 1.0)).collect()),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    };
    add(scene, mesh, Material { unlit: true, ..Material::lambert("screen", Spectrum::WHITE) });
}

/// A plane z that shows one colour.
fn glow(scene: &mut Scene, z: f64, color: Spectrum) {
    screen(scene, z);
    scene.meshes.last_mut().expect("just added").colors = None;
    *scene.materials.last_mut().expect("just added") = Material { unlit: true, ..Material::lambert("glow", color) };
}

fn exact() -> Settings {
    Settings { min_weight: 0.0, max_depth: 40, ..Settings::default() }
}

fn pixel(scene: Scene, settings: &Settings, origin: DVec3, dir: DVec3) -> Pixel {
    pixel_seen_from(scene, settings, Some(origin), origin, dir)
}

/// The same with an eye elsewhere than where the ray begins, or nowhere.
fn pixel_seen_from(scene: Scene, settings: &Settings, eye: Option<DVec3>, origin: DVec3, dir: DVec3) -> Pixel {
    let world = World::prepare(scene, CpuPath::detect()).expect("a valid scene");
    let in_world = |p: DVec3| (p - world.origin()).as_vec3();
    let settings = Settings { eye: eye.map(in_world), ..settings.clone() };
    let method = Whitted::new(&world, &settings, Vec3::NEG_Z);
    let ray = Ray::new(in_world(origin), dir.normalize().as_vec3());
    method.sample(&world, &ray, &mut Stream::new(1, 2, 3), &mut 0)
}

/// Down along −z, turned by `theta` towards +x.
fn down(theta: f64) -> DVec3 {
    DVec3::new(theta.sin(), 0.0, -theta.cos())
}

/// Where on the x axis of the screen at `z = −10` a ray from (0, 0, 5) ends up.
fn lands(mut scene: Scene, settings: &Settings, theta: f64) -> f64 {
    screen(&mut scene, -10.0);
    (f64::from(pixel(scene, settings, DVec3::Z * 5.0, down(theta)).color.r) - 0.5) * 2.0 * WIDE
}

// ------------------------------------------------------------------------------------------------ refraction

#[test]
fn a_slab_shifts_a_ray_as_snell_says() {
    for (n, t) in [(1.5, 1.0), (1.33, 2.5), (2.4, 0.3), (0.8, 1.0)] {
        for degrees in [5.0f64, 20.0, 35.0, 50.0] {
            let theta = degrees.to_radians();
            let mut scene = Scene::new("slab");
            add(&mut scene, slab(-t, 0.0), model(glass(n)));
            let shift = (15.0 * theta.tan() - lands(scene, &exact(), theta)) * theta.cos();
            let expected = optics::slab_shift(t, n, theta);
            assert!((shift - expected).abs() < 1e-4, "n {n}, {degrees}°: {shift} instead of {expected}");
            // The twin: an index a hundredth off is caught.
            assert!(degrees < 20.0 || (shift - optics::slab_shift(t, n + 0.01, theta)).abs() > 1e-4);
        }
    }
}

#[test]
fn a_sheet_shifts_nothing() {
    let mut scene = Scene::new("sheet");
    add(&mut scene, slab(-1.0, 0.0), model(Phong { thin: true, ..glass(1.5) }));
    assert!((lands(scene, &exact(), 0.7) - 15.0 * 0.7f64.tan()).abs() < 1e-4);
}

#[test]
fn light_leaves_up_to_the_critical_angle_and_no_further() {
    for n in [1.1, 1.33, 1.5, 2.4] {
        let leaves = |theta: f64| {
            let mut scene = Scene::new("block");
            add(&mut scene, slab(-1.0, 0.0), model(glass(n)));
            scene.background = Spectrum::WHITE;
            // Upwards, from inside; once, before a reflected ray can find another face.
            let up = DVec3::new(theta.sin(), 0.0, theta.cos());
            let once = Settings { max_depth: 1, ..exact() };
            !pixel(scene, &once, DVec3::new(0.0, 0.0, -0.5), up).color.is_black()
        };
        let (mut lo, mut hi) = (0.0, 1.57);
        assert!(leaves(0.01) && !leaves(1.5));
        for _ in 0..20 {
            let middle = 0.5 * (lo + hi);
            *(if leaves(middle) { &mut lo } else { &mut hi }) = middle;
        }
        let expected = optics::critical_angle(n);
        assert!((lo - expected).abs() < 1e-4, "{n}: {lo} instead of {expected}");
        assert!((lo - optics::critical_angle(n + 0.01)).abs() > 1e-3, "a wrong index is caught");
    }
}

#[test]
fn a_ball_focuses_where_its_closed_form_says() {
    for n in [1.33, 1.5, 1.9] {
        let crossing = |h: f64| {
            let at = |z: f64| {
                let mut scene = Scene::new("ball");
                scene.materials.push(model(glass(n)));
                place(&mut scene, Geometry::Sphere, DAffine3::IDENTITY);
                screen(&mut scene, z);
                let color = pixel(scene, &exact(), DVec3::new(h, 0.0, 5.0), DVec3::NEG_Z).color;
                (f64::from(color.r) - 0.5) * 2.0 * WIDE
            };
            // The line through its points on two screens.
            let (a, b) = (at(-1.5), at(-20.0));
            1.5 + a / (a - b) * 18.5
        };
        for h in [0.1, 0.3, 0.6, 0.85] {
            let (found, expected) = (crossing(h), optics::ball_crossing(1.0, n, h));
            assert!((found - expected).abs() < 2e-3 * expected, "n {n}, h {h}: {found} instead of {expected}");
        }
        let focus = optics::ball_focal_length(1.0, n);
        assert!((crossing(0.05) - focus).abs() < 5e-3 * focus, "near the axis");
        assert!((crossing(0.6) - focus).abs() > 0.05 * focus, "away from it the ball is no perfect lens");
    }
}

// ------------------------------------------------------------------------------------------------ energy

#[test]
fn at_every_interface_reflected_and_refracted_light_sum_to_one() {
    for n in [1.33, 1.5, 2.4] {
        for degrees in [0.0f64, 30.0, 56.0, 80.0] {
            for from_inside in [false, true] {
                let theta = degrees.to_radians();
                let mut scene = Scene::new("interface");
                scene.background = Spectrum::WHITE;
                let mut mesh = slab(-1.0, 0.0);
                // Its upper face alone, from either side.
                mesh.triangles.retain(|t| t.iter().all(|v| *v >= 4));
                if from_inside {
                    mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
                }
                add(&mut scene, mesh, model(fresnel_glass(n)));
                let seen = pixel(scene, &exact(), DVec3::Z, down(theta));
                let (r, t) = (f64::from(seen.reflection.g), f64::from(seen.refraction.g));
                assert!((r + t - 1.0).abs() < 1e-5, "{r} + {t}");
                let expected = optics::interface_reflectance(theta, if from_inside { 1.0 / n } else { n });
                assert!((r - expected).abs() < 1e-4, "n {n}, {degrees}°: {r} instead of {expected}");
            }
        }
    }
}

#[test]
fn an_opaque_mirror_reflects_as_much_from_behind() {
    for n in [1.33, 1.5, 2.4] {
        for degrees in [0.0f64, 45.0, 75.0] {
            let theta = degrees.to_radians();
            let seen = |phong: Phong, from_behind: bool| {
                let mut mesh = slab(-1.0, 0.0);
                mesh.triangles.retain(|t| t.iter().all(|v| *v >= 4));
                if from_behind {
                    mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
                }
                let mut scene = Scene::new("mirror");
                scene.background = Spectrum::WHITE;
                add(&mut scene, mesh, model(phong));
                f64::from(pixel(scene, &exact(), DVec3::Z, down(theta)).reflection.g)
            };
            let opaque = Phong { transmission: Spectrum::BLACK, ..fresnel_glass(n) };
            let expected = optics::interface_reflectance(theta, n);
            for from_behind in [false, true] {
                let found = seen(opaque.clone(), from_behind);
                assert!((found - expected).abs() < 1e-4, "n {n}, {degrees}°: {found} instead of {expected}");
            }
            // The twin: behind what transmits there is its inside, with total reflection.
            assert!(degrees == 0.0 || (seen(fresnel_glass(n), true) - expected).abs() > 1e-2);
        }
    }
}

fn gltf_glass(roughness: f32) -> Material {
    let glass = MetallicRoughness {
        metallic: ScalarMap::constant(0.0),
        roughness: ScalarMap::constant(roughness),
        transmission: ScalarMap::constant(1.0),
        thick: true,
        ..MetallicRoughness::default()
    };
    Material { model: Model::MetallicRoughness(glass), ..Material::default() }
}

#[test]
fn a_slab_of_slightly_rough_glass_makes_no_light() {
    for roughness in [0.0, 0.05, 0.2, 0.3] {
        let mut scene = Scene::new("slab");
        scene.background = Spectrum::WHITE;
        add(&mut scene, slab(-1.0, 0.0), gltf_glass(roughness));
        let seen = f64::from(pixel(scene, &Settings { samples: 256, ..exact() }, DVec3::Z, DVec3::NEG_Z).color.g);
        assert!((seen - 1.0).abs() < 2e-3, "roughness {roughness}: {seen}");
        // The twin, whose inside reflects twice: I = (1 − R) + 2 R I.
        let r = optics::interface_reflectance(0.0, 1.5);
        assert!((seen - (r + (1.0 - r).powi(2) / (1.0 - 2.0 * r))).abs() > 0.03);
    }
}

#[test]
fn rough_glass_reflects_a_lamp_inside_it_once() {
    let seen = |roughness: f32| {
        let mut scene = Scene::new("lamp in glass");
        add(&mut scene, slab(-1.0, 3.0), gltf_glass(roughness));
        let mut lamp = slab(2.0, 2.5);
        lamp.positions.iter_mut().for_each(|p| (p.x, p.y) = (p.x / WIDE, p.y / WIDE));
        let black = Phong { diffuse: ColorMap::constant(Spectrum::BLACK), ..Phong::default() };
        add(&mut scene, lamp, Material { emission: ColorMap::constant(Spectrum::WHITE), ..model(black) });
        let settings = Settings { samples: 512, ..exact() };
        f64::from(pixel(scene, &settings, DVec3::ZERO, DVec3::NEG_Z).color.g)
    };
    let expected = optics::interface_reflectance(0.0, 1.5);
    for roughness in [0.0, 0.2, 0.3, 0.6] {
        assert!((seen(roughness) - expected).abs() < 1e-4, "roughness {roughness}: {} instead of {expected}", seen(roughness));
    }
}

#[test]
fn a_slab_reflects_and_transmits_what_all_its_bounces_sum_to() {
    for degrees in [0.0f64, 40.0, 70.0] {
        let theta = degrees.to_radians();
        let seen = |max_depth| {
            let mut scene = Scene::new("slab");
            add(&mut scene, slab(-0.05, 0.0), model(fresnel_glass(1.5)));
            glow(&mut scene, 3.0, Spectrum::new(1.0, 0.0, 0.0));
            glow(&mut scene, -3.0, Spectrum::new(0.0, 1.0, 0.0));
            pixel(scene, &Settings { max_depth, ..exact() }, DVec3::Z, down(theta)).color
        };
        let (r, t) = optics::slab_energy(optics::interface_reflectance(theta, 1.5));
        let all = seen(40);
        assert!((f64::from(all.r) - r).abs() < 1e-4 && (f64::from(all.g) - t).abs() < 1e-4, "{all:?}, not {r}, {t}");
        // Two interfaces are two steps: with one nothing comes through.
        assert!(seen(1).g == 0.0 && seen(1).r > 0.0 && seen(2).g > 0.5 * all.g);
    }
}

#[test]
fn a_fresnel_ball_in_uniform_light_vanishes() {
    let mut scene = Scene::new("ball");
    scene.background = Spectrum::WHITE;
    scene.materials.push(model(fresnel_glass(1.5)));
    place(&mut scene, Geometry::Sphere, DAffine3::IDENTITY);
    for x in [0.0, 0.4, 0.8, 0.95] {
        let seen = pixel(scene.clone(), &exact(), DVec3::new(x, 0.0, 5.0), DVec3::NEG_Z).color.g;
        assert!((seen - 1.0).abs() < 1e-4, "{seen} at {x}");
    }
    let bad = Settings { fresnel: Fresnel::Off, ..exact() };
    assert!(pixel(scene, &bad, DVec3::Z * 5.0, DVec3::NEG_Z).color.g > 1.5, "constants k_r = k_t = 1 make light");
}

#[test]
fn absorption_follows_the_way_through_the_slab() {
    for theta in [0.0, 0.5, 1.0] {
        let mut scene = Scene::new("slab");
        let sigma = [0.3, 1.0, 2.0];
        add(&mut scene, slab(-0.7, 0.0), model(Phong { absorption: Spectrum::from(sigma.map(|s| s as f32)), ..glass(1.5) }));
        scene.background = Spectrum::WHITE;
        let seen = pixel(scene, &exact(), DVec3::Z, down(theta)).color.to_array();
        for (value, sigma) in seen.into_iter().zip(sigma) {
            let expected = optics::slab_absorption(sigma, 0.7, 1.5, theta);
            assert!((f64::from(value) - expected).abs() < 5e-5, "{value} instead of {expected}");
            // The twin: the thickness for the way.
            assert!(theta == 0.0 || (f64::from(value) - (-sigma * 0.7).exp()).abs() > 1e-3);
        }
    }
}

#[test]
fn a_ray_from_inside_is_absorbed_as_well() {
    let mut scene = Scene::new("slab");
    add(&mut scene, slab(-1.0, 0.0), model(Phong { absorption: Spectrum::WHITE, ..glass(1.5) }));
    scene.background = Spectrum::WHITE;
    let seen = pixel(scene, &exact(), DVec3::new(0.0, 0.0, -0.25), DVec3::NEG_Z).color.g;
    assert!((seen - (-0.75f32).exp()).abs() < 1e-5, "{seen}");
}

// ------------------------------------------------------------------------------------------------ an eye inside of something

/// Water all around the origin, as far as its slab goes, seen from the origin along −z; `more` stands in it.
fn seen_in_water(sigma: f64, settings: &Settings, eye: Option<DVec3>, more: impl FnOnce(&mut Scene)) -> Pixel {
    let mut scene = Scene::new("water");
    add(&mut scene, slab(-9.0, 9.0), model(Phong { absorption: Spectrum::gray(sigma as f32), ..fresnel_glass(WATER) }));
    more(&mut scene);
    pixel_seen_from(scene, settings, eye, DVec3::ZERO, DVec3::NEG_Z)
}

#[test]
fn what_an_eye_in_water_sees_has_come_through_water() {
    let sigma = 0.5f64;
    let lamp = |scene: &mut Scene| glow(scene, -4.0, Spectrum::WHITE);
    let seen = |eye: Option<DVec3>| f64::from(seen_in_water(sigma, &exact(), eye, lamp).color.g);
    assert!((seen(Some(DVec3::ZERO)) - (-4.0 * sigma).exp()).abs() < 1e-5, "{}", seen(Some(DVec3::ZERO)));
    // A ray that begins elsewhere than at the eye, as through a lens.
    assert!((seen(Some(DVec3::Z * 20.0)) - (-4.0 * sigma).exp()).abs() < 1e-5, "{}", seen(Some(DVec3::Z * 20.0)));
    assert_eq!(seen(None), 1.0, "the twin: it begins in vacuum");
}

#[test]
fn what_an_eye_in_water_meets_lies_in_water() {
    let glass_and_lamp = |scene: &mut Scene| {
        add(scene, slab(-2.0, -1.0), model(Phong { priority: 1, ..fresnel_glass(1.5) }));
        glow(scene, 2.0, Spectrum::WHITE);
    };
    // What the face of the glass reflects of the lamp behind the eye.
    let once = Settings { max_depth: 1, ..exact() };
    let seen = |eye| f64::from(seen_in_water(0.0, &once, eye, glass_and_lamp).reflection.g);
    let of = |n: f64| optics::interface_reflectance(0.0, n);
    assert!((seen(Some(DVec3::ZERO)) - of(1.5 / WATER)).abs() < 1e-5, "{}", seen(Some(DVec3::ZERO)));
    assert!((seen(None) - of(1.5)).abs() < 1e-5, "the twin: glass as if it lay in air");
}

#[test]
fn shadow_rays_begin_in_the_water_an_eye_is_in() {
    let (sigma, theta) = (0.3f64, 0.6f64);
    let mut scene = Scene::new("pool");
    add(&mut scene, slab(-1.5, 2.0), model(Phong { absorption: Spectrum::gray(sigma as f32), ..fresnel_glass(WATER) }));
    // The floor, a quarter of a metre below the eye, is three metres under water.
    let [_, found, _] = floor_in_the_sun(scene, &exact(), -1.0, theta);
    let open = 1.0 - optics::interface_reflectance(theta, WATER);
    let expected = theta.cos() * open * (-sigma * (3.0 / theta.cos() + 0.25)).exp();
    assert!((found - expected).abs() < 1e-4, "{found} instead of {expected}");
    assert!((found - expected * (sigma * 0.25).exp()).abs() > 1e-2, "the twin: the eye's ray is not absorbed");
}

#[test]
fn an_eye_in_a_hollow_is_not_in_what_surrounds_it() {
    let dark = |n| model(Phong { absorption: Spectrum::WHITE, ..fresnel_glass(n) });
    let lamp_in = |mut scene: Scene| {
        glow(&mut scene, -0.4, Spectrum::WHITE);
        pixel(scene, &exact(), DVec3::ZERO, DVec3::NEG_Z).color.g
    };
    // A bubble of its own, entered last; and walls with an inner face, whose front is the hollow's.
    let mut bubble = Scene::new("bubble");
    add(&mut bubble, slab(-9.0, 9.0), dark(WATER));
    add(&mut bubble, slab(-0.5, 0.5), model(fresnel_glass(1.0)));
    let mut bottle = Scene::new("bottle");
    let (mut walls, mut inner) = (slab(-9.0, 9.0), slab(-0.5, 0.5));
    inner.positions.iter_mut().for_each(|p| (p.x, p.y) = (0.5 * p.x, 0.5 * p.y));
    walls.triangles.extend(inner.triangles.iter().map(|t| [t[0] + 8, t[2] + 8, t[1] + 8]));
    walls.positions.append(&mut inner.positions);
    add(&mut bottle, walls.clone(), dark(1.5));
    assert_eq!((lamp_in(bubble), lamp_in(bottle)), (1.0, 1.0));
    // A pane is no body, though rays leave through it what they never entered.
    let mut pane = Scene::new("pane");
    walls.triangles.truncate(2);
    add(&mut pane, walls, dark(1.5));
    assert_eq!(lamp_in(pane), 1.0);
    // The twin: with neither there is glass all around.
    let mut block = Scene::new("block");
    add(&mut block, slab(-9.0, 9.0), dark(1.5));
    assert!((lamp_in(block) - (-0.4f32).exp()).abs() < 1e-5);
}

// ------------------------------------------------------------------------------------------------ nested bodies

#[test]
fn the_shadow_of_a_slab_is_coloured_by_its_absorption_and_dimmed_at_both_its_faces() {
    // Straight through: the factor is (1 − F)² exp(−σ t/cos θ), whatever refraction would do.
    let sigma = [0.2f32, 0.7, 1.5];
    let (t, theta) = (1.2f64, 0.5f64);
    let mut scene = Scene::new("shadow");
    let absorption = Spectrum::new(sigma[0], sigma[1], sigma[2]);
    add(&mut scene, slab(0.0, t), model(Phong { absorption, ..fresnel_glass(1.5) }));
    screen(&mut scene, -1.0);
    scene.meshes.last_mut().expect("just added").colors = None;
    *scene.materials.last_mut().expect("just added") = Material::lambert("floor", Spectrum::WHITE);
    let to_light = DVec3::new(theta.sin(), 0.0, theta.cos());
    let kind = LightKind::Distant { to_light, unit: PhotometricUnit::Classic };
    scene.lights.push(Light::new("sun", Spectrum::WHITE, kind));
    // From below the slab, so that only the shadow ray passes it.
    let seen = |scene: &Scene| pixel(scene.clone(), &exact(), DVec3::new(0.3, 0.1, -0.5), DVec3::NEG_Z).color;
    let lit = seen(&scene);
    let open = 1.0 - brdf::fresnel_dielectric(theta.cos(), 1.0, 1.5);
    for (channel, sigma) in lit.to_array().into_iter().zip(sigma) {
        let expected = theta.cos() * open * open * (-f64::from(sigma) * t / theta.cos()).exp();
        assert!((f64::from(channel) - expected).abs() < 1e-4, "{channel} instead of {expected}");
        // The twin: without absorption, or without Fresnel, it would be brighter.
        assert!((f64::from(channel) - theta.cos() * open * open).abs() > 1e-2);
    }
}

/// A white floor at `z` under a sun of unit light in the direction `theta` from the zenith, seen from just above it.
fn floor_in_the_sun(mut scene: Scene, settings: &Settings, z: f64, theta: f64) -> [f64; 3] {
    glow(&mut scene, z, Spectrum::WHITE);
    *scene.materials.last_mut().expect("just added") = Material::lambert("floor", Spectrum::WHITE);
    let kind = LightKind::Distant { to_light: DVec3::new(theta.sin(), 0.0, theta.cos()), unit: PhotometricUnit::Classic };
    scene.lights.push(Light::new("sun", Spectrum::WHITE, kind));
    pixel(scene, settings, DVec3::new(0.3, 0.1, z + 0.25), DVec3::NEG_Z).color.to_array().map(f64::from)
}

#[test]
fn shadow_rays_pass_ice_in_water_as_light_does() {
    let sigma = 0.2f64;
    for theta in [0.0f64, 0.6, 1.2] {
        let (water, ice, dry_ice) = reflectances(theta);
        // Straight through: two metres of water, one of ice.
        let way = (-sigma * 2.0 / theta.cos()).exp();
        let shadow = |ice: f64| theta.cos() * ((1.0 - water) * (1.0 - ice)).powi(2) * way;
        let [_, found, _] = floor_in_the_sun(ice_in_water(Spectrum::gray(sigma as f32)), &exact(), -1.0, theta);
        assert!((found - shadow(ice)).abs() < 1e-4, "{found} instead of {} at {theta}", shadow(ice));
        // The twin: ice as if it lay in air.
        assert!((found - shadow(dry_ice)).abs() > 2e-3);
    }
}

#[test]
fn a_shadow_ray_from_inside_a_body_knows_where_it_starts() {
    // The floor lies under the ice, in half a metre of water seen from inside it: the shadow ray enters the ice out of water.
    let (sigma, theta) = (0.2f64, 0.9f64);
    let (water, ice, dry_ice) = reflectances(theta);
    let from_above = |scene: Scene| {
        // The eye is in the air, so its ray knows the bodies it is in when it meets the floor.
        let mut scene = scene;
        glow(&mut scene, 0.5, Spectrum::WHITE);
        *scene.materials.last_mut().expect("just added") = Material::lambert("floor", Spectrum::WHITE);
        let kind = LightKind::Distant { to_light: DVec3::new(theta.sin(), 0.0, theta.cos()), unit: PhotometricUnit::Classic };
        scene.lights.push(Light::new("sun", Spectrum::WHITE, kind));
        // What the first way down shows, without what is reflected at the faces on the way.
        f64::from(pixel(scene, &Settings { max_depth: 3, ..exact() }, DVec3::new(0.3, 0.1, 4.0), DVec3::NEG_Z).color.g)
    };
    let found = from_above(ice_in_water(Spectrum::gray(sigma as f32)));
    let (eye_water, eye_ice, _) = reflectances(0.0);
    let eye = (1.0 - eye_water) * (1.0 - eye_ice).powi(2) * (-sigma * 1.5).exp();
    let shadow = |ice: f64| theta.cos() * (1.0 - water) * (1.0 - ice).powi(2) * (-sigma * 1.5 / theta.cos()).exp();
    assert!((found - eye * shadow(ice)).abs() < 1e-4, "{found} instead of {}", eye * shadow(ice));
    assert!((found - eye * shadow(dry_ice)).abs() > 2e-3, "the twin: ice as if it lay in air");
}

#[test]
fn a_lamp_in_water_reaches_its_floor_through_water() {
    let (sigma, height) = (0.7f64, 2.0f64);
    let mut scene = Scene::new("pool");
    add(&mut scene, slab(-1.0, 5.0), model(Phong { absorption: Spectrum::gray(sigma as f32), ..fresnel_glass(WATER) }));
    glow(&mut scene, 0.0, Spectrum::WHITE);
    *scene.materials.last_mut().expect("just added") = Material::lambert("floor", Spectrum::WHITE);
    let kind = LightKind::Point {
        position: DVec3::new(0.0, 0.0, height),
        unit: PhotometricUnit::Classic,
        attenuation: Default::default(),
        range: f64::INFINITY,
    };
    scene.lights.push(Light::new("lamp", Spectrum::WHITE, kind));
    let found = f64::from(pixel(scene, &Settings { max_depth: 1, ..exact() }, DVec3::Z * 6.0, DVec3::NEG_Z).color.g);
    let (eye, way) = (1.0 - optics::interface_reflectance(0.0, WATER), 5.0 + height);
    assert!((found - eye * (-sigma * way).exp()).abs() < 1e-4, "{found}");
    assert!((found - eye * (-sigma * 5.0).exp()).abs() > 1e-3, "the twin: only the eye's ray is absorbed");
}

#[test]
fn shadow_rays_weigh_glass_like_the_rays_of_the_eye() {
    let theta = 1.1f64;
    let r = optics::interface_reflectance(theta, 1.5);
    let shadow = |phong: Phong, fresnel| {
        let mut scene = Scene::new("pane");
        add(&mut scene, slab(0.0, 1.0), model(phong));
        floor_in_the_sun(scene, &Settings { fresnel, ..exact() }, -1.0, theta)[1] / theta.cos()
    };
    let thin = |phong: Phong| Phong { thin: true, ..phong };
    let k_t = |phong: Phong| Phong { transmission: Spectrum::gray(0.5), ..phong };
    let of_body = (1.0 - r).powi(2);
    // A slab of two sheets: each passes all that bounces inside it.
    let of_sheets = optics::slab_energy(r).1.powi(2);
    for (what, phong, fresnel, expected) in [
        ("a body as its material says", fresnel_glass(1.5), Fresnel::Material, of_body),
        ("constants as their material says", k_t(glass(1.5)), Fresnel::Material, 0.25),
        ("constants weighed", k_t(glass(1.5)), Fresnel::On, 0.25 * of_body),
        ("Fresnel's glass as constants", fresnel_glass(1.5), Fresnel::Off, 1.0),
        ("sheets", thin(fresnel_glass(1.5)), Fresnel::Material, of_sheets),
        ("sheets of constants weighed", thin(k_t(glass(1.5))), Fresnel::On, 0.25 * of_sheets),
    ] {
        let found = shadow(phong, fresnel);
        assert!((found - expected).abs() < 1e-4, "{what}: {found} instead of {expected}");
    }
    assert!((of_body - of_sheets).abs() > 1e-2, "the twin: sheets whose light does not bounce inside");
}

#[test]
fn overlapping_bodies_refract_by_priority_like_exactly_touching_ones() {
    let (theta, glass_n, water_n) = (0.6, 1.5, 1.33);
    let run = |glass_first: i32, water_first: i32| {
        let mut scene = Scene::new("glass of water");
        add(&mut scene, slab(-1.0, 0.0), model(Phong { priority: glass_first, ..glass(glass_n) }));
        add(&mut scene, slab(-2.5, -0.4), model(Phong { priority: water_first, ..glass(water_n) }));
        lands(scene, &exact(), theta)
    };
    let expected = |t_glass: f64, t_water: f64| {
        optics::run_through_layers(&[(t_glass, glass_n), (t_water, water_n), (15.0 - t_glass - t_water, 1.0)], theta)
    };
    // Glass down to −1 and water from there; the other way round water from −0.4.
    assert!((run(2, 1) - expected(1.0, 1.5)).abs() < 1e-4);
    assert!((run(1, 2) - expected(0.4, 2.1)).abs() < 1e-4);
    assert!((run(2, 1) - run(1, 2)).abs() > 1e-2, "the priority decides");
}

#[test]
fn ice_in_water_bends_by_the_ratio_of_both() {
    let theta = 0.8;
    let mut scene = Scene::new("ice");
    add(&mut scene, slab(-3.0, 0.0), model(glass(1.33)));
    add(&mut scene, slab(-2.0, -1.0), model(glass(1.31)));
    let expected = optics::run_through_layers(&[(2.0, 1.33), (1.0, 1.31), (12.0, 1.0)], theta);
    assert!((lands(scene.clone(), &exact(), theta) - expected).abs() < 1e-4);
    let wrong = optics::run_through_layers(&[(2.0, 1.33), (1.0, 1.31 * 1.33), (12.0, 1.0)], theta);
    assert!((wrong - expected).abs() > 1e-2, "an index taken relative to the surroundings is caught");
}

/// A slab of ice in the middle of one of water, from 0 to 3, both with Fresnel's weights; the water absorbs.
fn ice_in_water(absorption: Spectrum) -> Scene {
    let mut scene = Scene::new("ice");
    add(&mut scene, slab(0.0, 3.0), model(Phong { absorption, ..fresnel_glass(WATER) }));
    add(&mut scene, slab(1.0, 2.0), model(fresnel_glass(ICE)));
    scene
}

const WATER: f64 = 1.33;
const ICE: f64 = 1.31;

/// The reflectances of water's and of ice's surface for a ray that runs under `theta` outside, and the wrong one of ice in vacuum.
fn reflectances(theta: f64) -> (f64, f64, f64) {
    let in_water = (theta.sin() / WATER).asin();
    let of = optics::interface_reflectance;
    (of(theta, WATER), of(in_water, ICE / WATER), of(theta, ICE))
}

#[test]
fn ice_in_water_passes_what_all_bounces_between_its_four_faces_sum_to() {
    // Layers of reflectances R pass T with (1 − T)/T = Σ R/(1 − R), the slab's (1 − R)/(1 + R) being the case of two.
    let pile = |all: [f64; 4]| 1.0 / (1.0 + all.iter().map(|r| r / (1.0 - r)).sum::<f64>());
    for theta in [0.0, 0.6, 1.2] {
        let mut scene = ice_in_water(Spectrum::BLACK);
        glow(&mut scene, 8.0, Spectrum::new(1.0, 0.0, 0.0));
        glow(&mut scene, -2.0, Spectrum::new(0.0, 1.0, 0.0));
        let settings = Settings { min_weight: 1e-7, ..exact() };
        let seen = pixel(scene, &settings, DVec3::Z * 4.0, down(theta)).color;
        let (water, ice, dry_ice) = reflectances(theta);
        let passed = pile([water, ice, ice, water]);
        let found = [f64::from(seen.r), f64::from(seen.g)];
        assert!((found[1] - passed).abs() < 1e-4, "{} instead of {passed} at {theta}", found[1]);
        assert!((found[0] - (1.0 - passed)).abs() < 1e-4, "the rest is reflected: {} at {theta}", found[0]);
        // The twin: ice as if it lay in air.
        assert!((found[1] - pile([water, dry_ice, dry_ice, water])).abs() > 1e-2);
    }
}

// ------------------------------------------------------------------------------------------------ mirrors and limits

#[test]
fn a_corridor_of_mirrors_fades_by_their_reflectance_up_to_the_depth_limit() {
    let k_r = 0.8f32;
    let seen = |max_depth| {
        let mut scene = Scene::new("corridor");
        scene.ambient = Spectrum::WHITE;
        let mirror = Phong {
            diffuse: ColorMap::constant(Spectrum::BLACK),
            ambient: Some(ColorMap::constant(Spectrum::gray(0.5))),
            mirror: Spectrum::gray(k_r),
            ..Phong::default()
        };
        add(&mut scene, slab(-1.0, 0.0), model(mirror.clone()));
        add(&mut scene, slab(2.0, 3.0), model(mirror));
        pixel(scene, &Settings { max_depth, ..exact() }, DVec3::Z, DVec3::NEG_Z).color.g
    };
    for depth in [0, 1, 2, 7, 33, DEPTH_LIMIT] {
        let expected = 0.5 * (1.0 - k_r.powi(depth as i32 + 1)) / (1.0 - k_r);
        assert!((seen(depth) - expected).abs() < 1e-5, "depth {depth}: {} instead of {expected}", seen(depth));
    }
    assert_eq!(seen(DEPTH_LIMIT), seen(u32::MAX), "the limit holds whatever is asked");
}

#[test]
fn a_mirror_of_illum_5_rises_to_white_at_grazing_angles() {
    let seen = |schlick: bool, theta: f64| {
        let mut scene = Scene::new("mirror");
        scene.background = Spectrum::WHITE;
        let diffuse = ColorMap::constant(Spectrum::BLACK);
        let mirror = Phong { diffuse, mirror: Spectrum::new(0.04, 0.5, 1.0), schlick, ..Phong::default() };
        add(&mut scene, slab(-1.0, 0.0), model(mirror));
        pixel(scene, &exact(), DVec3::Z * 0.1, down(theta)).reflection
    };
    for theta in [0.0f64, 0.7, 1.4] {
        let expected = |k: f64| k + (1.0 - k) * (1.0 - theta.cos()).powi(5);
        for (value, k) in seen(true, theta).to_array().into_iter().zip([0.04, 0.5, 1.0]) {
            assert!((f64::from(value) - expected(k)).abs() < 1e-5, "{value} at {theta}");
        }
        assert_eq!(seen(false, theta), Spectrum::new(0.04, 0.5, 1.0), "a constant is constant");
    }
}

#[test]
fn the_weight_limit_does_not_change_an_eight_bit_picture() {
    // The mirrors of the room reflect much: what shows there is a limit above that.
    for (name, coarse) in [("whitted", 0.2), ("room", 0.9)] {
        let with = |min_weight| render(built_in(name), &Settings { min_weight, max_depth: 20, ..Settings::default() }, 1);
        let (all, usual) = (with(0.0), with(Settings::default().min_weight));
        let worst = differences(&all, &usual).fold(0.0, f32::max);
        assert!(worst < 1.0 / 255.0, "{name}: {worst}");
        // The twin: a coarse limit shows.
        assert!(differences(&all, &with(coarse)).fold(0.0, f32::max) > 1.0 / 255.0, "{name}");
    }
}

#[test]
fn a_light_ends_the_recursion() {
    let mut scene = Scene::new("lamp with a mirror in front");
    let lamp = Material {
        emission: ColorMap::constant(Spectrum::gray(0.25)),
        ..model(Phong { diffuse: ColorMap::constant(Spectrum::BLACK), mirror: Spectrum::WHITE, ..Phong::default() })
    };
    scene.background = Spectrum::WHITE;
    add(&mut scene, slab(-1.0, 0.0), lamp);
    assert_eq!(pixel(scene, &exact(), DVec3::Z, DVec3::NEG_Z).color, Spectrum::gray(0.25));
}

// ------------------------------------------------------------------------------------------------ distribution

#[test]
fn random_points_light_a_place_as_the_emitter_does() {
    // A square of side 2 one above the point: E = 4 F L π with the closed form of a corner rectangle, F = (2/2π) (1/√2) atan(1/√2).
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let factor = 4.0 * half * half.atan() / std::f64::consts::PI;
    let mut scene = Scene::new("lamp");
    let mesh = Mesh {
        positions: [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| DVec3::new(x, y, 1.0)).to_vec(),
        triangles: vec![[0, 2, 1], [0, 3, 2]],
        ..Mesh::default()
    };
    add(&mut scene, mesh, Material { emission: ColorMap::constant(Spectrum::WHITE), ..Material::default() });
    let world = World::prepare(scene, CpuPath::detect()).expect("a valid scene");
    let sampler = PointSampler::new(world.emissive());
    let mean = |n: u32| {
        let irradiance = |key: u64| {
            (0..n)
                .filter_map(|i| sampler.seen_from(Vec3::ZERO, Vec3::Z).incident(i, n, key))
                .map(|incident| f64::from(incident.diffuse.g * incident.wi.z))
                .sum::<f64>()
        };
        (0..400).map(irradiance).sum::<f64>() / 400.0
    };
    let expected = std::f64::consts::PI * factor;
    for n in [1, 4, 16] {
        assert!((mean(n) - expected).abs() < 0.03 * expected, "{n} points: {} instead of {expected}", mean(n));
    }
}

/// The albedo of white GGX facets with correlated Smith shadowing, by quadrature over the hemisphere.
fn ggx_albedo(alpha: f64, theta: f64) -> f64 {
    const N: usize = 400;
    let v = [theta.sin(), 0.0, theta.cos()];
    let term = |i: usize, j: usize| {
        let z = (i as f64 + 0.5) / N as f64;
        let phi = (j as f64 + 0.5) / N as f64 * std::f64::consts::TAU;
        let r = (1.0 - z * z).sqrt();
        let l = [r * phi.cos(), r * phi.sin(), z];
        let (d, g) = (brdf::Distribution::Ggx, brdf::Shadowing::SmithCorrelated);
        brdf::cook_torrance(d, g, alpha, 1.0, [0.0, 0.0, 1.0], l, v) * z
    };
    let sum: f64 = (0..N * N).map(|k| term(k / N, k % N)).sum();
    sum * std::f64::consts::TAU / (N * N) as f64
}

#[test]
fn a_rough_metal_in_uniform_light_shows_its_albedo() {
    for roughness in [0.4f32, 0.7, 1.0] {
        let metal = MetallicRoughness { roughness: ScalarMap::constant(roughness), ..MetallicRoughness::default() };
        let mut scene = Scene::new("metal");
        scene.background = Spectrum::WHITE;
        add(&mut scene, slab(-1.0, 0.0), Material { model: Model::MetallicRoughness(metal), ..Material::default() });
        let settings = Settings { samples: 4000, ..exact() };
        let seen = f64::from(pixel(scene, &settings, DVec3::Z * 2.0, down(0.3)).reflection.g);
        let expected = ggx_albedo(f64::from(roughness * roughness), 0.3);
        assert!((seen - expected).abs() < 0.02, "roughness {roughness}: {seen} instead of {expected}");
    }
}

#[test]
fn rough_metal_shows_a_lamp_behind_glass_once() {
    // A lamp above rough metal, seen by the highlight's shadow rays and by the rays of the rough mirror; a pane of k_t = ½ between them.
    let k_t = 0.5f32;
    let seen = |has_pane: bool, transparent_shadows: bool| {
        let mut scene = Scene::new("lamp over metal");
        let metal = MetallicRoughness { roughness: ScalarMap::constant(0.6), ..MetallicRoughness::default() };
        add(&mut scene, slab(-1.0, 0.0), Material { model: Model::MetallicRoughness(metal), ..Material::default() });
        let mut lamp = slab(3.0, 3.5);
        lamp.positions.iter_mut().for_each(|p| (p.x, p.y) = (p.x / WIDE, p.y / WIDE));
        let black = Phong { diffuse: ColorMap::constant(Spectrum::BLACK), ..Phong::default() };
        add(&mut scene, lamp, Material { emission: ColorMap::constant(Spectrum::gray(5.0)), ..model(black) });
        if has_pane {
            let mut pane = slab(2.0, 2.1);
            pane.triangles.retain(|t| t.iter().all(|v| *v >= 4));
            add(&mut scene, pane, model(Phong { thin: true, transmission: Spectrum::gray(k_t), ..glass(1.5) }));
        }
        let settings = Settings { samples: 2000, transparent_shadows, ..exact() };
        pixel(scene, &settings, DVec3::new(-1.0, 0.0, 1.5), DVec3::new(0.7, 0.1, -1.5)).color.g
    };
    let (alone, behind) = (seen(false, true), seen(true, true));
    assert!(alone > 0.1 && (behind - k_t * alone).abs() < 0.02 * alone, "{behind} behind glass, {alone} without");
    // Where glass casts full shadows the rays of the rough mirror are all that finds the lamp, and find as much.
    let by_rays = seen(true, false);
    assert!((by_rays - behind).abs() < 0.1 * behind, "{by_rays} instead of {behind}");
}

#[test]
fn a_nearly_smooth_lobe_reflects_like_a_mirror() {
    let seen = |alpha: f32| {
        let rough = CookTorrance {
            diffuse: ColorMap::constant(Spectrum::BLACK),
            alpha: ScalarMap::constant(alpha),
            fresnel: radiosa::scene::Fresnel::One,
            ..CookTorrance::default()
        };
        let mut scene = Scene::new("rough");
        add(&mut scene, slab(-1.0, 0.0), Material { model: Model::CookTorrance(rough), ..Material::default() });
        screen(&mut scene, 8.0);
        let color = pixel(scene, &Settings { samples: 256, ..exact() }, DVec3::Z, down(0.5)).color;
        (f64::from(color.r) - 0.5) * 2.0 * WIDE
    };
    assert!((seen(1e-3) - 9.0 * 0.5f64.tan()).abs() < 0.02, "{}", seen(1e-3));
}

// ------------------------------------------------------------------------------------------------ as a whole

const SIZE: u32 = 64;

fn built_in(name: &str) -> Scene {
    sample::load(name).unwrap_or_else(|| panic!("{name} is built in"))
}

fn render(scene: Scene, settings: &Settings, spp: u32) -> Film {
    let world = World::prepare(scene, CpuPath::detect()).expect("the scene is valid");
    let camera = world.scene().cameras.first().cloned().unwrap_or_else(|| framing::automatic(&world, 1.0));
    let view = View::new(&camera, world.origin(), SIZE, SIZE);
    let extra_lights = if default_light::has_light(&world) { Vec::new() } else { default_light::lights(&camera) };
    let method = Whitted::new(&world, &Settings { extra_lights, ..settings.clone() }, view.forward());
    let settings = tiles::Settings { width: SIZE, height: SIZE, spp, filter: Filter::Box, seed: 7, layers: Layer::ALL.to_vec() };
    let mut render = tiles::TiledRender::new(&method, &view, settings).expect("the film is small");
    while let Step::Working { .. } = render.step(&world) {}
    render.into_film()
}

fn differences<'a>(a: &'a Film, b: &'a Film) -> impl Iterator<Item = f32> + 'a {
    let values = |film: &'a Film| ["R", "G", "B"].into_iter().flat_map(|name| film.plane(name).expect("it has colour"));
    values(a).zip(values(b)).map(|(x, y)| (x.min(1.0) - y.min(1.0)).abs())
}

fn assert_same_bits(a: &Film, b: &Film) {
    for (a, b) in a.planes().iter().zip(b.planes()) {
        assert!(a.values.iter().zip(&b.values).all(|(x, y)| x.to_bits() == y.to_bits()), "{} differs", a.name);
    }
}

fn with_threads<R: Send>(n: usize, f: impl FnOnce() -> R + Send) -> R {
    rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("threads can be had").install(f)
}

#[test]
fn the_bits_do_not_depend_on_the_number_of_threads() {
    for samples in [0, 3] {
        let settings = Settings { samples, ..Settings::default() };
        let with = |n| with_threads(n, || render(built_in("whitted"), &settings, 2));
        assert_same_bits(&with(1), &with(3));
    }
}

#[test]
fn both_decompositions_sum_to_the_picture_in_every_built_in_scene() {
    for scene in sample::list() {
        for samples in [0, 2] {
            let film = render(built_in(scene.name), &Settings { samples, ..Settings::default() }, 1);
            for kind in [Decomposition::Lobe, Decomposition::Path] {
                let error = film.decomposition_error(kind).expect("all layers are kept");
                assert!(error < 1e-5, "{} by {kind:?}: {error}", scene.name);
            }
        }
    }
}

fn render_adaptively(scene: Scene, threshold: f32, max_level: u32) -> (Film, u64) {
    let world = World::prepare(scene, CpuPath::detect()).expect("the scene is valid");
    let view = View::new(&world.scene().cameras[0], world.origin(), SIZE, SIZE);
    let method = Whitted::new(&world, &Settings::default(), view.forward());
    let layers = Layer::ALL.to_vec();
    let settings = adaptive::Settings { width: SIZE, height: SIZE, threshold, white: 1.0, max_level, seed: 7, layers };
    let mut render = adaptive::AdaptiveRender::new(&method, &view, settings).expect("the film is small");
    while let Step::Working { .. } = render.step(&world) {}
    let n_rays = render.n_rays();
    (render.into_film(), n_rays)
}

fn rms(a: &Film, b: &Film) -> f32 {
    let (sum, n) = differences(a, b).fold((0.0, 0.0), |(sum, n), d| (sum + d * d, n + 1.0));
    f32::sqrt(sum / n)
}

#[test]
fn adaptive_samples_smooth_the_edges_and_leave_the_sky_alone() {
    // A scene whose edges are all wider apart than a pixel: what is finer falls between the corners, as the chequers of the scene `whitted`
    // do near its horizon (there the error is about 0.03 at this size).
    let reference = render(built_in("cornell-box"), &Settings::default(), 64);
    let (film, n_rays) = render_adaptively(built_in("cornell-box"), 0.05, 3);
    let (coarse, n_coarse) = render_adaptively(built_in("cornell-box"), 2.0, 0);
    // Within what 64 samples a pixel show, at a fraction of their rays; without subdivision the edges are ragged.
    assert!(rms(&film, &reference) < 0.02, "{}", rms(&film, &reference));
    assert!(rms(&coarse, &reference) > 2.0 * rms(&film, &reference), "{}", rms(&coarse, &reference));
    assert!(n_rays < 32 * n_coarse, "{n_rays} rays, {n_coarse} without");

    let mut empty = Scene::new("sky");
    empty.background = Spectrum::gray(0.5);
    empty.cameras = built_in("whitted").cameras;
    let (sky, n) = render_adaptively(empty, 0.05, 3);
    assert!(n <= 2 * u64::from(SIZE * SIZE), "{n} rays for a plain sky");
    assert!(sky.plane("R").expect("it has colour").iter().all(|v| (v - 0.5).abs() < 1e-6));
}

#[test]
fn adaptive_pictures_have_the_same_bits_at_any_thread_count_and_layers_that_sum() {
    let with = |n| with_threads(n, || render_adaptively(built_in("whitted"), 0.05, 2).0);
    let film = with(1);
    assert_same_bits(&film, &with(3));
    for kind in [Decomposition::Lobe, Decomposition::Path] {
        assert!(film.decomposition_error(kind).expect("all layers are kept") < 1e-5);
    }
}

#[test]
fn a_lens_is_sharp_at_its_focal_distance_and_blurs_in_proportion_elsewhere() {
    let mut camera = built_in("whitted").cameras.remove(0);
    camera.lens = Some(Lens { aperture: 0.2, focus_distance: 4.0 });
    let view = View::new(&camera, DVec3::ZERO, 64, 48);
    // Where the rays of one picture point cross a plane at some depth: how far apart, at most.
    let spread = |depth: f64| {
        let mut stream = Stream::new(3, 1, 4);
        let points: Vec<DVec3> = (0..500)
            .map(|_| {
                let ray = view.sample_ray(10.0, 30.0, &mut stream);
                let (o, d) = (ray.origin.as_dvec3() - camera.position, ray.dir.as_dvec3());
                o + d * ((depth - o.dot(camera.forward())) / d.dot(camera.forward()))
            })
            .collect();
        points.iter().map(|p| (*p - points[0]).length()).fold(0.0, f64::max)
    };
    assert!(spread(4.0) < 1e-5, "{}", spread(4.0));
    // Similar triangles: diameter A |z − f|/f; the largest distance from one point is between its half and the whole.
    for depth in [2.0, 8.0, 12.0] {
        let blur = 0.2 * (depth - 4.0f64).abs() / 4.0;
        assert!((0.5 * blur..1.001 * blur).contains(&spread(depth)), "{depth}: {} of {blur}", spread(depth));
    }
}

#[test]
fn what_a_mirror_shows_is_direct_once_and_indirect_beyond() {
    let mut scene = Scene::new("mirror");
    let mirror = Phong { diffuse: ColorMap::constant(Spectrum::BLACK), mirror: Spectrum::gray(0.5), ..Phong::default() };
    add(&mut scene, slab(-1.0, 0.0), model(mirror.clone()));
    scene.background = Spectrum::WHITE;
    let once = pixel(scene.clone(), &exact(), DVec3::Z, down(0.3));
    assert_eq!((once.direct.g, once.indirect.g, once.reflection.g, once.background.g), (0.5, 0.0, 0.5, 0.0));
    // A mirror opposite, above half of it only: met on the way up at x = 0.62.
    let mut above = slab(2.0, 3.0);
    above.positions.iter_mut().for_each(|p| p.x = p.x.min(1.0));
    add(&mut scene, above, model(mirror));
    let more = pixel(scene, &exact(), DVec3::Z, down(0.3));
    assert!(more.direct.g == 0.0 && more.indirect.g > 0.0 && more.reflection == more.indirect, "{more:?}");
}

#[test]
fn glass_casts_a_filtered_shadow_or_a_full_one() {
    // Tinted, weighed and absorbing: k_t² (1 − F)² exp(−σ t/cos θ) by channel, or nothing at all.
    let (k_t, sigma, theta, t) = ([0.9f64, 0.6, 0.3], [0.1f64, 0.4, 0.9], 0.7f64, 1.5f64);
    let color = |c: [f64; 3]| Spectrum::from(c.map(|v| v as f32));
    let shadow = |transparent_shadows| {
        let mut scene = Scene::new("tinted glass");
        let tinted = Phong { transmission: color(k_t), absorption: color(sigma), ..fresnel_glass(1.5) };
        add(&mut scene, slab(0.0, t), model(tinted));
        floor_in_the_sun(scene, &Settings { transparent_shadows, ..exact() }, -1.0, theta)
    };
    let open = 1.0 - optics::interface_reflectance(theta, 1.5);
    for ((found, k), sigma) in shadow(true).into_iter().zip(k_t).zip(sigma) {
        let expected = theta.cos() * (k * open).powi(2) * (-sigma * t / theta.cos()).exp();
        assert!((found - expected).abs() < 1e-4, "{found} instead of {expected}");
        // The twins: filtered once for both faces, or absorbed over the thickness alone.
        assert!((found - expected / (k * open)).abs() > 1e-3 && (found - expected * (sigma * t).exp()).abs() > 1e-3);
    }
    assert_eq!(shadow(false), [0.0; 3]);
}

#[test]
fn nothing_makes_it_hang_or_panic() {
    // Constants that double the rays at every depth, in a closed hall of glass balls; inside-out, mirrored and flat bodies.
    let mut scene = Scene::new("hostile");
    scene.background = Spectrum::WHITE;
    scene.materials.push(model(Phong { mirror: Spectrum::WHITE, ..glass(1.5) }));
    for (i, scale) in [DVec3::ONE, DVec3::NEG_ONE, DVec3::new(1.0, 0.0, 1.0), DVec3::splat(1e-30), DVec3::new(-3.0, 1.0, 1.0)]
        .into_iter()
        .enumerate()
    {
        let at = DVec3::new(0.7 * i as f64 - 1.5, 0.2, 0.0);
        place(&mut scene, Geometry::Sphere, DAffine3::from_scale_rotation_translation(scale, Default::default(), at));
    }
    let mut inside_out = slab(-9.0, 9.0);
    inside_out.triangles.iter_mut().for_each(|t| t.swap(0, 1));
    inside_out.triangles.push([0, 0, 0]);
    add(&mut scene, inside_out, model(Phong { mirror: Spectrum::WHITE, absorption: Spectrum::gray(1e30), ..glass(0.1) }));
    let settings = Settings { max_depth: u32::MAX, min_weight: f32::NAN, samples: u32::MAX, ..Settings::default() };
    for i in 0..6 {
        let seen = pixel(scene.clone(), &settings, DVec3::new(0.3 * f64::from(i) - 0.9, 0.1, 5.0), DVec3::NEG_Z);
        assert!(seen.color.is_finite(), "{:?}", seen.color);
    }
}
