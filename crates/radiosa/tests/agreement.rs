//! Radiosity, the hybrid and path tracing know nothing of each other's errors: in rooms of diffuse surfaces they have to find the same light.
//!
//! Each method says how far off it may be. Of path tracing that is three standard errors; of the other two as much, and what is left after elements have become half as wide: in
//! proportion to what that changed at the sensor or, where that is more, in the root mean square over the room, since two solutions may be near each other by chance.
//! `RADIOSA_LONG_TESTS=1` asks for smaller errors.
#![expect(clippy::print_stdout, reason = "tests say what they measured")]

mod common;

use std::fmt::Write as _;

use common::{scene_of, world_of};
use radiosa::hybrid::FinalGather;
use radiosa::math::{Ray, Vec3};
use radiosa::radiosity::gather::{Gather, Scratch};
use radiosa::radiosity::{self, Division, Solution};
use radiosa::raytrace::path::{PathTracer, Settings};
use radiosa::sampling::{rng, sequence, warp};
use radiosa::scene::{Model, Scene};
use radiosa::transport::{Surface, World};
use rayon::prelude::*;

/// What the quick and the long suite spend.
struct Effort {
    /// Elements of the coarser solution, of radiosity and of the hybrid.
    elements: [u32; 2],
    /// Times that a sensor gathers the light of elements.
    gathers: u32,
    /// Rays and points of a sensor of the hybrid.
    rays: [u32; 2],
    paths: u32,
    /// Of the twin.
    paths_of_twin: u32,
    /// Root mean square over the sensors of a room that the relative error of radiosity, the hybrid and paths may have.
    error: [f64; 3],
}

const QUICK: Effort = Effort {
    elements: [300, 150],
    gathers: 2,
    rays: [1 << 13, 1 << 11],
    paths: 1 << 14,
    paths_of_twin: 1 << 14,
    error: [0.025; 3],
};
const LONG: Effort = Effort {
    elements: [2500, 600],
    gathers: 64,
    rays: [1 << 16, 1 << 14],
    paths: 1 << 19,
    paths_of_twin: 1 << 16,
    error: [0.005; 3],
};
const N_SENSORS: usize = 20;

/// What is left of an error over what changed when elements became half as wide: `q/(1 − q)` where errors fall to q of themselves each time. Of radiosity they do to about 0.6, which is
/// measured: from 1500 elements to 6000 to 0.5 to 0.65 in these rooms, beside paths. In gathers of the hybrid no element is seen, and what errs by the width itself falls to a half.
const LEFT: [f64; 2] = [1.5, 1.0];

/// A room, written as a scene file.
#[derive(Default)]
struct Room {
    text: String,
}

impl Room {
    fn of(materials: &[(&str, [f32; 3])]) -> Self {
        let mut text = "[material.lamp]\nlambert = 0\nemission = [13, 12, 10]\n".to_owned();
        for (name, reflectance) in materials {
            writeln!(text, "[material.{name}]\nlambert = {reflectance:?}").expect("a string");
        }
        Self { text }
    }

    fn shape(mut self, material: &str, what: &str) -> Self {
        writeln!(self.text, "[[shape]]\nmaterial = \"{material}\"\n{what}").expect("a string");
        self
    }

    fn inside(self, material: &str, max: [f32; 3]) -> Self {
        self.shape(material, &format!("box = {{ min = [0, 0, 0], max = {max:?}, inward = true }}"))
    }

    fn block(self, material: &str, min: [f32; 3], max: [f32; 3]) -> Self {
        self.shape(material, &format!("box = {{ min = {min:?}, max = {max:?} }}"))
    }

    fn quad(self, material: &str, corners: [[f32; 3]; 4]) -> Self {
        self.shape(material, &format!("quad = {corners:?}"))
    }

    /// A lamp that shines down.
    fn lamp(self, [x, y, z]: [f32; 3], [width, depth]: [f32; 2]) -> Self {
        let (a, b) = (width / 2.0, depth / 2.0);
        self.quad("lamp", [[x - a, y, z - b], [x + a, y, z - b], [x + a, y, z + b], [x - a, y, z + b]])
    }

    fn scene(self) -> Scene {
        scene_of(&self.text)
    }
}

type Make = fn() -> Scene;

fn partitions() -> Scene {
    Room::of(&[("walls", [0.6, 0.5, 0.7]), ("sheets", [0.5, 0.7, 0.6])])
        .inside("walls", [6.0, 3.0, 4.0])
        .block("sheets", [2.0, 0.0, 0.0], [2.12, 3.0, 2.6])
        .block("sheets", [4.0, 0.0, 1.4], [4.12, 2.2, 4.0])
        .lamp([1.0, 2.98, 2.0], [0.8, 0.8])
        .lamp([5.0, 2.98, 1.5], [0.8, 0.6])
        .scene()
}

fn boxes() -> Scene {
    Room::of(&[("walls", [0.7, 0.7, 0.6]), ("red", [0.7, 0.3, 0.3]), ("blue", [0.3, 0.4, 0.7])])
        .inside("walls", [5.0, 3.0, 4.0])
        .block("red", [0.7, 0.0, 0.6], [1.7, 0.8, 1.5])
        .block("blue", [2.6, 0.0, 2.2], [3.3, 1.6, 3.1])
        .block("red", [3.6, 0.5, 0.5], [4.4, 1.0, 1.4])
        .block("blue", [1.0, 1.2, 2.6], [1.8, 1.7, 3.3])
        .lamp([2.5, 2.98, 1.8], [1.2, 0.8])
        .scene()
}

fn l_shaped() -> Scene {
    let (a, b) = ("floors", "walls");
    let mut room = Room::of(&[(a, [0.5, 0.45, 0.4]), (b, [0.75, 0.75, 0.7])]);
    for [x0, z0, x1, z1] in [[0.0, 0.0, 5.0, 2.5], [0.0, 2.5, 2.5, 6.0]] {
        room = room.quad(a, [[x0, 0.0, z0], [x0, 0.0, z1], [x1, 0.0, z1], [x1, 0.0, z0]]);
        room = room.quad(b, [[x0, 2.7, z0], [x1, 2.7, z0], [x1, 2.7, z1], [x0, 2.7, z1]]);
    }
    let ring = [[0.0, 0.0], [5.0, 0.0], [5.0, 2.5], [2.5, 2.5], [2.5, 6.0], [0.0, 6.0]];
    for (k, [x0, z0]) in ring.into_iter().enumerate() {
        let [x1, z1] = ring[(k + 1) % ring.len()];
        room = room.quad(b, [[x0, 0.0, z0], [x1, 0.0, z1], [x1, 2.7, z1], [x0, 2.7, z0]]);
    }
    room.lamp([3.8, 2.68, 1.2], [0.9, 0.5]).scene()
}

fn office() -> Scene {
    let mut room = Room::of(&[("walls", [0.65, 0.65, 0.6]), ("wood", [0.5, 0.35, 0.2]), ("white", [0.8, 0.8, 0.8])])
        .inside("walls", [5.0, 2.8, 4.0]);
    for x in [0.8f32, 2.8] {
        room = room.block("wood", [x, 0.7, 1.2], [x + 1.4, 0.74, 2.0]);
        for foot in [x + 0.05, x + 1.3] {
            room = room.block("white", [foot, 0.0, 1.25], [foot + 0.05, 0.7, 1.95]);
        }
        // A cabinet at the wall, on the floor.
        room = room.block("white", [x, 0.0, 3.5], [x + 0.9, 1.3, 4.0]);
    }
    room.lamp([1.5, 2.79, 1.6], [1.2, 0.3]).lamp([3.5, 2.79, 1.6], [1.2, 0.3]).scene()
}

fn cornell_box() -> Scene {
    radiosa::import::sample::load("cornell-box").expect("it is built in")
}

/// Sensors on what is seen from places inside a room. Lamps have none, and none is nearer to an edge than a thirtieth of the room: most light comes from what is next to it there, which
/// few elements do not tell.
fn sensors(world: &World) -> Vec<(Surface, Vec3)> {
    let bounds = world.accel().bounds();
    let (extent, key) = (bounds.extent(), 7);
    let mut found = Vec::new();
    for k in 0.. {
        let [u, v] = [0, 1].map(|d| sequence::point_2d(2 * k + d, key));
        let at = bounds.min + extent * (Vec3::new(u.x, u.y, v.x) * 0.8 + 0.1);
        let dir = warp::uniform_sphere(sequence::point_2d(k, key + 1));
        let Some((_, surface)) = world.closest_visible(&Ray::new(at, dir)) else { continue };
        let n = surface.ng;
        // (What is outside of the room or inside of a block sees backs.)
        if !surface.is_front(-dir) || !world.material_at(&surface).emission.factor.is_black() {
            continue;
        }
        let margin = extent.max_element() / 30.0;
        let is_free = (0..8).all(|i| {
            let (sin, cos) = (i as f32 * std::f32::consts::FRAC_PI_4).sin_cos();
            let along = n.any_orthonormal_vector();
            let aside = (along * cos + n.cross(along) * sin) * margin;
            let down = world.closest_visible(&Ray::new(surface.p + aside + n * margin, -n));
            down.is_some_and(|(hit, below)| (hit.t - margin).abs() < 0.01 * margin && below.ng.dot(n).abs() > 0.99)
        });
        if is_free {
            found.push((surface, n));
        }
        if found.len() == N_SENSORS {
            break;
        }
    }
    found
}

/// What a method says of the sensors: irradiances, luminance, and by how much each may be off, relative.
struct Said {
    values: Vec<f64>,
    errors: Vec<f64>,
}

impl Said {
    fn mean_error(&self) -> f64 {
        (self.errors.iter().map(|e| e * e).sum::<f64>() / self.errors.len() as f64).sqrt()
    }

    /// Sensors at which two methods differ by more than both say they may be off, the largest difference as a multiple of that, and the mean difference.
    fn against(&self, other: &Self) -> (usize, f64, f64) {
        let pairs = || self.values.iter().zip(&other.values).zip(self.errors.iter().zip(&other.errors));
        let ratios: Vec<f64> = pairs().map(|((a, b), (e, f))| (a / b - 1.0).abs() / (e + f)).collect();
        let mean = pairs().map(|((a, b), _)| a / b - 1.0).sum::<f64>() / ratios.len() as f64;
        (ratios.iter().filter(|r| **r > 1.0).count(), ratios.into_iter().fold(0.0, f64::max), mean)
    }
}

/// From readings and their standard errors, by a coarse and a fine solution.
fn of_two_solutions(read: impl Fn(u32) -> Vec<(f64, f64)>, elements: u32, left: f64) -> Said {
    let (coarse, fine) = (read(elements), read(4 * elements));
    let changes: Vec<f64> = coarse.iter().zip(&fine).map(|((c, _), (f, _))| (c / f - 1.0).abs()).collect();
    let usual = (changes.iter().map(|c| c * c).sum::<f64>() / changes.len() as f64).sqrt();
    let errors = fine.iter().zip(&changes).map(|((f, error), change)| left * change.max(usual) + 3.0 * error / f).collect();
    Said { values: fine.into_iter().map(|(f, _)| f).collect(), errors }
}

fn by_paths(world: &World, sensors: &[(Surface, Vec3)], paths: u32) -> Said {
    let method = PathTracer::new(world, &Settings::default());
    let read = |(k, (surface, n)): (usize, &(Surface, Vec3))| {
        let (e, error) = method.irradiance(world, surface, *n, paths, rng::key(&[k as u64]));
        (f64::from(e.luminance()), 3.0 * error / f64::from(e.luminance()))
    };
    let (values, errors) = sensors.par_iter().enumerate().map(read).unzip();
    Said { values, errors }
}

fn by_radiosity(world: &World, sensors: &[(Surface, Vec3)], effort: &Effort) -> Said {
    let read = |elements: u32| {
        let mut settings = radiosity::Settings::default();
        (settings.mesh.elements, settings.refine.levels) = (elements, 0);
        let solution = radiosity::solve(world, &settings);
        let gather = Gather::new(world, &solution, &[], 0).with_details();
        // Nothing in the solution itself is left to chance, so gathers differ by all there is.
        assert!(solution.irradiance_error.iter().flatten().all(|e| *e == 0.0));
        let at = |scratch: &mut Scratch, (k, (surface, n)): (usize, &(Surface, Vec3))| {
            let (mut mean, mut variance, times) = (0.0, 0.0, f64::from(effort.gathers));
            for i in 0..effort.gathers {
                let arriving = gather.at(surface, *n, rng::key(&[k as u64, u64::from(i)]), scratch);
                mean += f64::from(arriving.irradiance.luminance()) / times;
                variance += (arriving.standard_error / times).powi(2);
            }
            (mean, variance.sqrt())
        };
        sensors.par_iter().enumerate().map_init(Scratch::default, at).collect()
    };
    of_two_solutions(read, effort.elements[0], LEFT[0])
}

fn by_hybrid(world: &World, sensors: &[(Surface, Vec3)], effort: &Effort) -> Said {
    let read = |elements: u32| {
        let mut settings = radiosity::Settings::default();
        settings.mesh.elements = elements;
        let solution = Solution::to_be_found(world, Division::new(world, &settings), &settings);
        let gather = FinalGather::new(world, &solution, &[], 0).settled(1024, &|| false);
        let at = |(k, (surface, n)): (usize, &(Surface, Vec3))| {
            let arriving = gather.sensor(surface, *n, effort.rays, rng::key(&[k as u64, u64::from(elements)]));
            (f64::from(arriving.irradiance.luminance()), arriving.standard_error)
        };
        sensors.par_iter().enumerate().map(at).collect()
    };
    of_two_solutions(read, effort.elements[1], LEFT[1])
}

/// The same room, of which everything reflects 2 % more.
fn twin(mut scene: Scene) -> World {
    for material in &mut scene.materials {
        if let Model::Phong(m) = &mut material.model {
            m.diffuse.factor *= 1.02;
        }
    }
    world_of(scene)
}

#[test]
fn radiosity_the_hybrid_and_paths_find_the_same_light() {
    let effort = if std::env::var_os("RADIOSA_LONG_TESTS").is_some() { LONG } else { QUICK };
    let rooms: [(&str, Make); 5] =
        [("cornell-box", cornell_box), ("partitions", partitions), ("boxes", boxes), ("l-shaped", l_shaped), ("office", office)];
    let mut wrong = Vec::new();
    for (name, room) in rooms {
        let world = world_of(room());
        let sensors = sensors(&world);
        let said = [
            ("radiosity", by_radiosity(&world, &sensors, &effort)),
            ("hybrid", by_hybrid(&world, &sensors, &effort)),
            ("path", by_paths(&world, &sensors, effort.paths)),
        ];
        let twin = by_paths(&twin(room()), &sensors, effort.paths_of_twin);
        for (method, of) in &said {
            println!("{name}: {method} may be off by {:.2} %", 100.0 * of.mean_error());
        }
        for (k, (a, of_a)) in said.iter().enumerate() {
            for (b, of_b) in &said[k + 1..] {
                let (n_beyond, worst, mean) = of_a.against(of_b);
                println!("{name}: {a} and {b}: {worst:.2} of what they may differ, mean {:+.2} %", 100.0 * mean);
                if n_beyond > 0 {
                    wrong.push(format!("{name}: {a} and {b} differ at {n_beyond} sensors"));
                }
            }
        }
        for ((method, of), most) in said.iter().zip(effort.error) {
            if of.mean_error() > most {
                wrong.push(format!("{name}: {method} may be off by {:.2} %", 100.0 * of.mean_error()));
            }
            let (n_beyond, worst, mean) = of.against(&twin);
            println!("{name}: {method} and the twin: {worst:.2} of what they may differ, mean {:+.2} %", 100.0 * mean);
            if n_beyond == 0 {
                wrong.push(format!("{name}: {method} does not notice a twin that reflects 2 % more"));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
