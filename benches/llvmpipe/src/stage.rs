//! What both contestants are given: a scene without transparency, a view, and one list of lights.

use std::error::Error;
use std::path::{Path, PathBuf};

use radiosa::emitter::{Emitter, EnvironmentShadows, area};
use radiosa::film::{Film, Filter as PixelFilter, Layer, Sampling};
use radiosa::import;
use radiosa::math::CpuPath;
use radiosa::raytrace::{RayCast, ray_cast, tiles};
use radiosa::scanline::{self, Interpolation, ScanLine};
use radiosa::scene::{Camera, Filter, Light};
use radiosa::spectrum::Spectrum;
use radiosa::transport::{Emitters, LightSettings, Solver, Step, View, World, default_light, framing};

use crate::measure::{self, Time};

/// Points a side of each emissive surface, and in all: few, so that the picture is no contest of light loops alone.
const EMITTERS: (u32, u32) = (2, 64);

/// A scene ready to be drawn.
pub struct Stage {
    pub world: World,
    pub view: View,
    pub camera: Camera,
    pub size: (u32, u32),
    pub lights: Lights,
    pub filter: Filter,
    extra_lights: Vec<Light>,
}

/// The lights, as `transport::Lights` prepares them.
pub struct Lights {
    pub emitters: Vec<Emitter>,
    pub ambient: Spectrum,
}

/// A picture of ours, and how long it took.
pub struct Scanned {
    pub film: Film,
    pub preparing: Time,
    pub drawing: Time,
}

fn settings() -> LightSettings {
    LightSettings { emitters: Emitters::Points { n: EMITTERS.0, max: EMITTERS.1 }, ..LightSettings::default() }
}

fn finish<S: Solver<Solution = Film>>(solver: &mut S, world: &World) {
    while let Step::Working { .. } = solver.step(world) {}
}

impl Stage {
    /// Reads a scene; its first camera, or one that frames it.
    pub fn load(path: &Path, size: (u32, u32), filter: Filter) -> Result<Self, Box<dyn Error>> {
        let collection = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared"));
        let options = import::Options { allow_outside: vec![collection], ..Default::default() };
        let (mut scene, _) = import::load(path, &options)?;
        scene.remove_transparency();
        scene.set_texture_filter(filter);
        if scene.materials.iter().any(|m| m.normal_map.is_some()) {
            println!("note: normal maps are left out, on both sides");
            scene.materials.iter_mut().for_each(|m| m.normal_map = None);
        }
        let world = World::prepare(scene, CpuPath::detect())?;
        let aspect = f64::from(size.0) / f64::from(size.1);
        let camera = world.scene().cameras.first().cloned().unwrap_or_else(|| framing::automatic(&world, aspect));
        let view = View::new(&camera, world.origin(), size.0, size.1);
        let lights = Lights::prepare(&world, &[]);
        let mut stage = Self { world, view, camera, size, lights, filter, extra_lights: Vec::new() };
        let method = stage.ray_casting();
        if !default_light::survey(&stage.world, &stage.view, size, &method, || false).sees_light {
            println!("note: the scene's own lights reach nothing seen: both get the default light");
            stage.extra_lights = default_light::lights(&stage.camera);
            stage.lights = Lights::prepare(&stage.world, &stage.extra_lights);
        }
        Ok(stage)
    }

    pub fn n_triangles(&self) -> u64 {
        self.world.scene().n_primitives()
    }

    /// What is seen behind everything, if that is one colour.
    pub fn background(&self) -> Option<Spectrum> {
        let plain = self.world.sky().is_none() && !default_light::has_backdrop(&self.world, &self.extra_lights);
        plain.then_some(self.world.scene().background)
    }

    fn sampling(&self, layers: &[Layer]) -> Sampling {
        let (width, height) = self.size;
        Sampling { width, height, spp: 1, filter: PixelFilter::Box, seed: 0, layers: layers.to_vec() }
    }

    fn ray_casting(&self) -> RayCast {
        let settings = ray_cast::Settings {
            shadows: false,
            lights: settings(),
            extra_lights: self.extra_lights.clone(),
            footprint: self.view.footprint(1),
            ..Default::default()
        };
        RayCast::new(&self.world, &settings, self.view.forward())
    }

    /// The picture by ray casting without shadows.
    pub fn ray_cast(&self) -> Result<Film, Box<dyn Error>> {
        let method = self.ray_casting();
        let mut render = tiles::TiledRender::new(&method, &self.view, self.sampling(&[Layer::Color]))?;
        finish(&mut render, &self.world);
        Ok(render.into_film())
    }

    /// The picture by scan line.
    pub fn scan(&self, interpolation: Interpolation, layers: &[Layer]) -> Result<Scanned, Box<dyn Error>> {
        let settings = scanline::Settings {
            interpolation,
            lights: settings(),
            extra_lights: self.extra_lights.clone(),
            ..Default::default()
        };
        let (solver, preparing) = measure::time(|| ScanLine::new(&self.world, &self.view, &settings, self.sampling(layers)));
        let mut solver = solver?;
        let ((), drawing) = measure::time(|| finish(&mut solver, &self.world));
        Ok(Scanned { film: solver.into_film(), preparing, drawing })
    }
}

impl Lights {
    /// The list `transport::Lights::prepare` makes, which it keeps to itself.
    fn prepare(world: &World, extra: &[Light]) -> Self {
        let shadows = EnvironmentShadows::Off;
        let scene = world.scene();
        let all = scene.lights.iter().chain(extra);
        let mut emitters: Vec<Emitter> = all.map(|l| Emitter::prepare(l, world.origin(), shadows)).collect();
        emitters.extend(world.sky().map(|sky| sky.emitter(shadows)));
        emitters.push(Emitter::Area(area::sample_points(world.emissive(), EMITTERS.0, EMITTERS.1)));
        let ambient = scene.ambient + emitters.iter().map(Emitter::ambient).sum();
        Self { emitters, ambient }
    }

    /// How many of each kind.
    pub fn about(&self) -> String {
        let count = |f: fn(&Emitter) -> usize| self.emitters.iter().map(f).sum::<usize>();
        [
            ("point", count(|e| usize::from(matches!(e, Emitter::Point(_))))),
            ("spot", count(|e| usize::from(matches!(e, Emitter::Spot(_))))),
            ("distant", count(|e| usize::from(matches!(e, Emitter::Distant(_))))),
            ("hemispherical", count(|e| usize::from(matches!(e, Emitter::Hemispherical(_))))),
            ("emitter point", count(|e| if let Emitter::Area(points) = e { points.len() } else { 0 })),
        ]
        .iter()
        .filter(|(_, n)| *n > 0)
        .map(|(kind, n)| format!("{n} {kind}{}", if *n == 1 { "" } else { "s" }))
        .collect::<Vec<_>>()
        .join(", ")
    }
}
