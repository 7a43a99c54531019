//! `embree-bench SCENES… [--turns N]`: ray queries of Radiosa beside Embree's, on the same meshes and rays. `cargo xtask bench rays` runs it.
//!
//! Rates are million rays per second of CPU time of a thread, medians over turns in which the contestants alternate; in brackets
//! the ratio to Embree's call of the same kind as it is by default, and with `RTC_SCENE_FLAG_ROBUST`. Unequal hit counts are all printed: Embree's
//! default loses rays at edges.

mod bench;
mod embree;
mod rays;

use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

use embree::{Embree, Mode};
use radiosa::accel::{Accel, Geometry, Placed, Shape};
use radiosa::math::{CpuPath, Vec3};
use radiosa::transport::World;

fn main() -> ExitCode {
    let mut turns = 7;
    let mut scenes = Vec::new();
    let mut args = std::env::args().skip(1);
    while let Some(arg) = args.next() {
        if arg == "--turns" {
            turns = args.next().and_then(|n| n.parse().ok()).unwrap_or(turns);
        } else {
            scenes.push(arg);
        }
    }
    for path in &scenes {
        if let Err(error) = run(Path::new(path), turns) {
            eprintln!("error: {path}: {error}");
            return ExitCode::FAILURE;
        }
    }
    ExitCode::SUCCESS
}

fn run(path: &Path, turns: usize) -> Result<(), Box<dyn std::error::Error>> {
    let (scene, _) = radiosa::import::load(path, &Default::default())?;
    let camera = scene.cameras.first().map(|c| (c.position, c.position + c.forward()));
    let world = World::prepare(scene, CpuPath::detect())?;
    let geometry = flatten(world.accel().geometry());
    let view = camera.map(|(eye, target)| ((eye - world.origin()).as_vec3(), (target - world.origin()).as_vec3()));
    drop(world);
    measure(&path.display().to_string(), geometry, view, turns);
    Ok(())
}

/// Prints a scene's table.
fn measure(name: &str, geometry: Geometry, view: Option<(Vec3, Vec3)>, turns: usize) {
    let n: usize = geometry.shapes.iter().map(|s| if let Shape::Mesh { triangles, .. } = s { triangles.len() } else { 0 }).sum();
    let start = Instant::now();
    let fast = Embree::build(&geometry, Mode::Fast);
    let embree_seconds = start.elapsed().as_secs_f64();
    let robust = Embree::build(&geometry, Mode::Robust);
    let start = Instant::now();
    let ours = Accel::build(geometry, CpuPath::detect());
    println!("{name}: {n} triangles; build: embree {embree_seconds:.2} s, radiosa {:.2} s", start.elapsed().as_secs_f64());
    let reach = 5f32.min(0.5 * ours.bounds().extent().length());
    let rays = rays::make(&ours, view, reach);
    for threads in [1, 2] {
        println!(" {threads} thread{}", if threads == 1 { "" } else { "s" });
        for row in bench::rows(&ours, &fast, &robust, &rays) {
            println!("{}", bench::measure(&row, threads, turns));
        }
    }
}

/// All meshes in world coordinates.
fn flatten(geometry: &Geometry) -> Geometry {
    let mut flat = Geometry::default();
    for placed in &geometry.placed {
        if let Shape::Mesh { positions, triangles } = &geometry.shapes[placed.shape as usize] {
            let m = placed.to_world.unwrap_or_default();
            let positions =
                positions.iter().map(|p| if placed.to_world.is_some() { m.transform_point3(*p) } else { *p }).collect();
            flat.placed.push(Placed { shape: flat.shapes.len() as u32, to_world: None });
            flat.shapes.push(Shape::Mesh { positions, triangles: triangles.clone() });
        }
    }
    flat
}
