//! What is done with a finished picture: tone map, recipe, report.

use std::path::PathBuf;

use radiosa::export::image::Recipe;
use radiosa::film::{Film, tone_map};
use radiosa::import::Warning;
use radiosa::scene::{Quantity, Scene};

use super::method::{Choice, Drawing};
use super::plan::Stage;
use crate::args::{self, Exposure, Picture};

/// `NAME.png` in the current folder.
pub(crate) fn default_output(scene: &Scene) -> PathBuf {
    let clean: String = scene.name.chars().map(|c| if c.is_alphanumeric() || "-_. ".contains(c) { c } else { '-' }).collect();
    PathBuf::from(format!("{}.png", if clean.trim().is_empty() { "picture" } else { clean.trim() }))
}

/// How light becomes display values. The default lights are classic ones, whatever the unit of the scene's own.
pub(crate) fn tone_map(picture: &Picture, scene: &Scene, default_lit: bool) -> tone_map::ToneMap {
    let quantity = if default_lit { Quantity::Radiometric } else { scene.quantity };
    let exposure = match (picture.exposure, quantity) {
        (Some(Exposure::Auto), _) | (None, Quantity::Photometric) => tone_map::Exposure::Automatic,
        (Some(Exposure::Factor(f)), _) => tone_map::Exposure::Factor(f),
        (None, Quantity::Radiometric) => tone_map::Exposure::Factor(1.0),
    };
    let curve = match picture.tone_map {
        args::ToneMap::Clamp => tone_map::Curve::Clamp,
        args::ToneMap::Renormalise => tone_map::Curve::Renormalise,
        args::ToneMap::Reinhard => tone_map::Curve::Reinhard { white: None },
    };
    tone_map::ToneMap { exposure, curve }
}

pub(crate) fn quantity_name(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::Radiometric => "radiometric, W/(m² sr)",
        Quantity::Photometric => "photometric, cd/m²",
    }
}

/// What the luminance of a pixel is counted in.
pub(crate) fn unit_of_pixels(picture: &Picture, scene: &Scene) -> String {
    match (scene.quantity, picture.show) {
        (Quantity::Radiometric, args::Show::Radiance) => "W/(m²sr)",
        (Quantity::Radiometric, args::Show::Irradiance) => "W/m²",
        (Quantity::Photometric, args::Show::Radiance) => "cd/m²",
        (Quantity::Photometric, args::Show::Irradiance) => "lx",
    }
    .to_owned()
}

/// The command line as one would type it again, without the number of threads and whether it goes on from before: they change nothing, so the files are
/// the same.
pub(crate) fn command_line() -> String {
    let mut words = std::env::args().skip(1);
    let mut command = Vec::new();
    while let Some(word) = words.next() {
        if word == "--threads" {
            words.next();
        } else if !word.starts_with("--threads=") && word != "--resume" {
            command.push(shell_word(&word));
        }
    }
    format!("radiosa {}", command.join(" "))
}

/// How a picture was made.
pub(crate) fn recipe(scene: &str, picture: &Picture, stage: &Stage, choice: Choice, drawing: &Drawing) -> Recipe {
    let mut recipe = Recipe::new()
        .with("version", env!("CARGO_PKG_VERSION"))
        .with("command", command_line())
        .with("scene", scene)
        .with("method", choice.name())
        .with("camera", &stage.camera.name)
        .with("view", stage.view.radiance_view())
        .with("size", format!("{}x{}", stage.size.width, stage.size.height))
        .with("spp", drawing.samples(picture, choice))
        .with("seed", picture.seed.to_string())
        .with("quantity", quantity_name(stage.world.scene().quantity))
        .with("cpu-path", stage.world.cpu_path().to_string());
    if let Some(sampled) = &drawing.sampled {
        if let Some(noise) = sampled.noise {
            recipe.set("noise", format!("{noise:.5}"));
        }
        if let Some(options) = &sampled.repeat {
            recipe.set("repeat", options);
        }
    }
    let done = drawing.done;
    if done < 1.0 { recipe.with("unfinished", format!("{:.1} % done", done * 100.0)) } else { recipe }
}

/// How many samples a pixel has, in words.
pub(crate) fn samples(picture: &Picture, choice: Choice) -> String {
    choice.adaptive(picture).map_or_else(|| picture.samples_a_pixel().to_string(), |threshold| format!("adaptive ({threshold})"))
}

/// A word of a command line, quoted where a shell would split it.
fn shell_word(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_./:=,+%@".contains(c);
    if !word.is_empty() && word.chars().all(plain) { word.to_owned() } else { format!("'{}'", word.replace('\'', "'\\''")) }
}

/// How opaque lines over pictures are.
const INK: f32 = 0.65;

/// Draws lines over a picture of sRGB bytes, given how much of each pixel they cover: dark ones where most of the picture is light, light ones else.
pub(crate) fn draw_lines(rgb: &mut [u8], lines: &[f32]) {
    const LIGHT: usize = 90;
    let n_light = rgb.chunks_exact(3).filter(|p| p.iter().map(|v| usize::from(*v)).sum::<usize>() > 3 * LIGHT).count();
    let ink = if 6 * n_light > rgb.len() { 0.0 } else { 255.0 };
    for (pixel, covered) in rgb.chunks_exact_mut(3).zip(lines) {
        let share = INK * covered;
        pixel.iter_mut().for_each(|v| *v = (f32::from(*v) * (1.0 - share) + ink * share).round() as u8);
    }
}

/// The mean of each colour channel.
pub(crate) fn mean(film: &Film) -> [f64; 3] {
    ["R", "G", "B"].map(|channel| {
        let values = film.plane(channel).unwrap_or_default();
        values.iter().map(|v| f64::from(*v)).sum::<f64>() / values.len().max(1) as f64
    })
}

/// Warnings for a person.
pub(crate) fn say_warnings(warnings: &[Warning]) {
    for w in warnings {
        tell(&format!("warning[{}]: {}", w.name, w.message));
    }
}

/// Warnings for a program.
pub(crate) fn warnings_json(warnings: &[Warning]) -> Vec<serde_json::Value> {
    warnings.iter().map(|w| serde_json::json!({ "name": w.name, "file": w.path, "message": w.message })).collect()
}

/// A line on standard error; nobody there is no error of ours.
pub(crate) fn tell(text: &str) {
    use std::io::Write;
    let _ = writeln!(std::io::stderr(), "{text}");
}
