//! `--method auto`: which method suits the options, the scene and the time there is.

use std::time::Duration;

use radiosa::hybrid::FinalGather;
use radiosa::radiosity::mesh::ElementMesh;
use radiosa::scene::{Light, LightKind, Material, Model, PhotometricUnit};
use radiosa::transport::World;

use super::method::{Choice, methods_of};
use super::plan::Stage;
use crate::args::{self, Method, Picture};
use crate::solve;

/// All methods, the ones that know most of light first.
const ALL: [Method; 6] = [Method::Hybrid, Method::Path, Method::Radiosity, Method::Whitted, Method::Raycast, Method::Scanline];

/// The methods that look at every option that was typed; all of them where none does.
fn methods_for(given: &[String]) -> Vec<Method> {
    let looks = |method: &&Method| given.iter().filter_map(|option| methods_of(option)).all(|methods| methods.contains(*method));
    let methods: Vec<Method> = ALL.iter().filter(looks).copied().collect();
    if methods.is_empty() { ALL.to_vec() } else { methods }
}

/// The method, where the options alone decide: before a scene is prepared, since radiosity wants it otherwise.
pub(crate) fn by_options(picture: &Picture, given: &[String]) -> Option<Choice> {
    if picture.method != Method::Auto {
        return Some(Choice::of(picture.method, None));
    }
    if picture.solution.is_some() || picture.show == args::Show::Irradiance {
        return Some(Choice::of(Method::Radiosity, Some("it is asked for what radiosity knows")));
    }
    match methods_for(given)[..] {
        [method] => Some(Choice::of(method, Some("the options are for it alone"))),
        _ => None,
    }
}

/// The method for a scene, and for the `time` there is.
pub(crate) fn by_scene(picture: &Picture, stage: &Stage, time: Option<Duration>, given: &[String]) -> Choice {
    let (world, methods) = (&stage.world, methods_for(given));
    let choice = |wanted: &[Method], why| {
        let method = wanted.iter().chain(&ALL).copied().find(|method| methods.contains(method));
        Choice::of(method.unwrap_or(Method::Raycast), Some(why))
    };
    let local = |glossy, dull| {
        let has_mirrors = world.scene().materials.iter().any(reflects_or_refracts);
        if has_mirrors {
            choice(&[Method::Whitted, Method::Raycast], glossy)
        } else {
            choice(&[Method::Raycast, Method::Whitted], dull)
        }
    };
    if world.scene().has_media() {
        return choice(&[Method::Path], "light is scattered between surfaces");
    }
    if !has_units(world) {
        return local(
            "its lights are classic, and it has mirrors or glass",
            "its lights are classic, and it has neither mirrors nor glass",
        );
    }
    if !methods.iter().any(|&method| Choice::of(method, None).solves()) {
        let why = "the options are for local models";
        return local(why, why);
    }
    if elements_of(picture, world).0 > MANY {
        return choice(&[Method::Path], "it has so many surfaces that the hybrid would take long before it began");
    }
    if let Some(time) = time
        && expected(picture, stage) > time.as_secs_f64()
    {
        if methods.contains(&Method::Hybrid) && expected(&quick(picture, given), stage) <= time.as_secs_f64() {
            return Choice { is_quick: true, ..choice(&[Method::Hybrid], WHY_QUICK) };
        }
        return choice(&[Method::Path], "the hybrid would hardly be done in time");
    }
    choice(&[Method::Hybrid], "its light is physical, and goes from surface to surface")
}

/// True when light is given in physical units and nowhere by classic intensities that fall off as one likes: then what surfaces give each other is worth
/// finding. The ambient light of other scenes stands for it.
fn has_units(world: &World) -> bool {
    let scene = world.scene();
    let unit = |light: &Light| match light.kind {
        LightKind::Point { unit, .. } | LightKind::Spot { unit, .. } | LightKind::Distant { unit, .. } => Some(unit),
        _ => None,
    };
    let is_local = |light: &Light| {
        matches!(light.kind, LightKind::Point { .. } | LightKind::Spot { .. }) && unit(light) == Some(PhotometricUnit::Classic)
    };
    let has_source = !world.emissive().is_empty()
        || scene.environment.as_ref().is_some_and(|e| !e.scale.is_black())
        || scene.lights.iter().any(|light| unit(light) == Some(PhotometricUnit::Physical));
    has_source && !scene.lights.iter().any(is_local)
}

/// True for mirrors, glass, and metals that are nearly mirrors.
fn reflects_or_refracts(material: &Material) -> bool {
    material.transmits()
        || match &material.model {
            Model::Phong(m) => !m.mirror.is_black(),
            Model::CookTorrance(_) => false,
            Model::MetallicRoughness(m) => m.metallic.factor > 0.5 && m.roughness.factor < 0.2 && !material.unlit,
        }
}

/// Elements from which on the hybrid is not taken unasked.
const MANY: u64 = 1 << 18;
/// What the hybrid takes of processor time, seconds: for an element's place in the mesh, for a ray of one, for a camera sample, and for a ray of the gathers a pixel needs
/// in the mean. A sample takes 3 µs in Cornell's box and 20 µs in the furnished room, whose window has bars: this is between both.
const AN_ELEMENT: f64 = 4e-5;
const AN_ELEMENTS_RAY: f64 = 2e-6;
const A_SAMPLE: f64 = 1.5e-5;
const A_PIXELS_RAY: f64 = 3e-7;

/// The same picture by the hybrid where there is little time, as far as nobody typed something else: good to about 2 % of a pixel in ordinary rooms
/// (`docs/methods/hybrid.md`).
pub(crate) fn quick(picture: &Picture, given: &[String]) -> Picture {
    let is_free = |option: &str| given.iter().all(|given| given != option);
    let mut quick = picture.clone();
    if is_free("elements") && is_free("element-size") {
        quick.radiosity.elements = Some(500);
    }
    if is_free("cache") {
        quick.cache = 0.8;
    }
    if is_free("gather") {
        quick.gather = 32;
    }
    if is_free("samples") {
        quick.samples = Some(1);
    }
    if is_free("spp") {
        quick.spp = Some(1);
    }
    quick
}

const WHY_QUICK: &str =
    "there is little time for it, so it takes --spp 1 --elements 500 --cache 0.8 --gather 32 --samples 1 where nothing was typed";

/// Elements that the hybrid would make for a picture, and that are wanted.
fn elements_of(picture: &Picture, world: &World) -> (u64, u32) {
    let mesh = solve::settings_to_gather_from(&picture.radiosity, picture.seed, &[]).mesh;
    (ElementMesh::estimate(world, &mesh), mesh.elements)
}

/// About how long the hybrid takes on two threads, seconds: by what it took for ordinary rooms, and not by this machine's speed or threads, so that the same
/// options choose the same method everywhere.
fn expected(picture: &Picture, stage: &Stage) -> f64 {
    let (elements, wanted) = elements_of(picture, &stage.world);
    let pixels = f64::from(stage.size.width) * f64::from(stage.size.height);
    let lit = elements.min(u64::from(FinalGather::POOLED) * u64::from(wanted));
    let light = elements as f64 * AN_ELEMENT + lit as f64 * f64::from(picture.gather) * AN_ELEMENTS_RAY;
    let samples = pixels * f64::from(picture.samples_a_pixel()) * A_SAMPLE;
    let records = pixels * f64::from(picture.gather) * A_PIXELS_RAY;
    (light + samples + records) / 2.0
}
