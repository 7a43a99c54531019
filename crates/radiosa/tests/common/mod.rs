//! Scenes written out as text, and what several suites ask of them.
#![allow(dead_code, reason = "every suite is a program of its own, and none asks for all of it")]

pub(crate) mod chi_square;

use std::path::Path;

use radiosa::math::{CpuPath, Ray, Vec3};
use radiosa::scene::Scene;
use radiosa::transport::{Surface, World};

/// The scene of a scene file's text.
pub(crate) fn scene_of(text: &str) -> Scene {
    radiosa::import::load_bytes(text.as_bytes(), Path::new("room.toml"), &Default::default()).expect("it is a scene").0
}

pub(crate) fn world_of(scene: Scene) -> World {
    World::prepare(scene, CpuPath::detect()).expect("it is valid")
}

/// The surface below a point, and which way is up.
pub(crate) fn below(world: &World, p: Vec3, n: Vec3) -> Surface {
    let ray = Ray::new(p - world.origin().as_vec3() + n * 1e-3, -n);
    world.closest_visible(&ray).expect("a surface").1
}

/// All surfaces emit `1 − ρ` and reflect ρ: light of radiance 1 is everywhere.
pub(crate) const FURNACE: &str = r#"
[camera.c]
position = [0.8, 0.7, 0.9]
look_at = [-0.3, -0.5, -0.6]
[material.a]
lambert = 0.6
emission = 0.4
[[shape]]
name = "room"
material = "a"
box = { min = [-1, -1, -1], max = [1, 1, 1], inward = true }
[[shape]]
name = "block"
material = "a"
box = { min = [-0.6, -1, -0.7], max = [0.1, -0.2, 0] }
"#;
