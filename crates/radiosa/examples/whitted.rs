//! Recursive ray tracing of any scene by the public interface alone: `whitted [SCENE] [OUTPUT] [WIDTH] [HEIGHT] [SPP] [SAMPLES]`.

use std::path::Path;

use radiosa::export::image::{self, Options, Recipe};
use radiosa::film::{Filter, Layer};
use radiosa::import;
use radiosa::math::CpuPath;
use radiosa::raytrace::{Whitted, tiles, whitted};
use radiosa::transport::{Solver, Step, View, World, default_light, framing};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let word = |i: usize, absent: &str| words.get(i).map_or(absent, String::as_str).to_owned();
    let (name, output) = (word(0, "whitted"), word(1, "whitted.png"));
    let (width, height): (u32, u32) = (word(2, "640").parse()?, word(3, "480").parse()?);
    let (spp, samples): (u32, u32) = (word(4, "4").parse()?, word(5, "0").parse()?);

    let scene = match import::sample::load(&name) {
        Some(scene) => scene,
        None => import::load(Path::new(&name), &import::Options::default())?.0,
    };
    let world = World::prepare(scene, CpuPath::detect())?;
    let aspect = f64::from(width) / f64::from(height);
    let camera = world.scene().cameras.first().cloned().unwrap_or_else(|| framing::automatic(&world, aspect));
    let view = View::new(&camera, world.origin(), width, height);
    let extra_lights = if default_light::has_light(&world) { Vec::new() } else { default_light::lights(&camera) };
    let settings = whitted::Settings { samples, extra_lights, ..whitted::Settings::default() };
    let method = Whitted::new(&world, &settings, view.forward());

    let settings = tiles::Settings { width, height, spp, filter: Filter::Box, seed: 0, layers: vec![Layer::Color] };
    let mut render = tiles::TiledRender::new(&method, &view, settings)?;
    while let Step::Working { .. } = render.step(&world) {}
    let mut options = Options::default();
    if world.scene().quantity == radiosa::scene::Quantity::Photometric {
        options.tone_map.exposure = radiosa::film::tone_map::Exposure::Automatic;
    }
    image::write(render.solution(), Path::new(&output), &Recipe::new(), &options)?;
    Ok(())
}
