//! The built-in scenes: the files in the folder `scenes`, carried inside the library.

use std::path::Path;

use super::{ImportError, Options, Override, Resolver, Warnings, scene_file};
use crate::scene::Scene;

/// A scene that needs no file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sample {
    /// What it is called.
    pub name: &'static str,
    /// What it shows, in one line.
    pub about: &'static str,
    /// Its scene file.
    pub toml: &'static str,
}

macro_rules! samples {
    ($($name:literal: $about:literal,)*) => {
        const SAMPLES: &[Sample] = &[$(Sample {
            name: $name,
            about: $about,
            toml: include_str!(concat!("../../../../scenes/", $name, ".toml")),
        }),*];
    };
}

samples! {
    "cornell-box": "The measured Cornell box: what every method can be checked on.",
    "room": "A furnished room with a luminaire, a floor lamp and a window, for every method.",
    "whitted": "A glass and a mirror sphere over a checkered floor, after the picture of 1980.",
    "phong-spheres": "Phong's highlight: the exponent grows to the right, its strength upwards.",
    "light-types": "The kinds of light side by side: ambient, point, attenuated, spot, distant, hemispherical.",
    "parallel-plates": "Two plates at different distances: they merge without attenuation and separate with it.",
    "shadow": "A square light, a blocker turned by 25 degrees, a floor: umbra and penumbra.",
    "fog": "Shafts of light in fog, a ball of milk, a ball of smoke: media, by path tracing.",
    "furnace": "A closed room that glows evenly: with all interreflection it shows 1 everywhere.",
}

/// All of them, the most used one first.
pub const fn list() -> &'static [Sample] {
    SAMPLES
}

/// The one of that name.
pub fn get(name: &str) -> Option<&'static Sample> {
    SAMPLES.iter().find(|s| s.name == name)
}

/// The scene file of that name, `None` when there is none.
pub fn text(name: &str) -> Option<&'static str> {
    get(name).map(|s| s.toml)
}

/// The scene of that name, `None` when there is none.
///
/// # Panics
/// Never: a test reads and checks every built-in scene.
pub fn load(name: &str) -> Option<Scene> {
    let sample = get(name)?;
    let resolver = Resolver::new(Path::new(&format!("{name}.toml")), &Options::default());
    let mut scene = scene_file::read(sample.toml.as_bytes(), &resolver, &mut Warnings::default())
        .expect("the built-in scenes are right: a test reads every one");
    name.clone_into(&mut scene.name);
    Some(scene)
}

/// The scene of that name with values of its scene file replaced, `None` when there is none.
///
/// # Errors
/// When a path leads nowhere or a value does not fit.
pub fn load_with(name: &str, overrides: &[Override]) -> Option<Result<Scene, ImportError>> {
    let path = format!("{name}.toml");
    let read = |sample: &Sample| {
        let (mut scene, _) = super::load_bytes_with(sample.toml.as_bytes(), Path::new(&path), overrides, &Options::default())?;
        name.clone_into(&mut scene.name);
        Ok(scene)
    };
    get(name).map(read)
}

/// The name that was probably meant, when one is close.
pub fn nearest(name: &str) -> Option<&'static str> {
    scene_file::nearest(name, SAMPLES.iter().map(|s| s.name))
}
