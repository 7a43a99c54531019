//! `cargo xtask bench factors [--large]`: form factors beside pyviewfactor 1.1 in one run, two threads each, on the empty unit box and on the box with a centred
//! cube of half its size. Times are of the whole estimate; Python's compiling and starting is left out, ours (reading, writing) is in. Errors are against our own
//! at tolerance 1e-7 for the empty box (contour integrals agree with closed forms to 1e-13, `tests/form_factor.rs`), and 1e-6 for the other; with thousands
//! of faces 1e-4, which would take hours otherwise.
//! pyviewfactor is installed into `target/`; nothing else needs it.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};

use crate::bench_whitted::Cost;

/// A scene: its name, cells along an edge of the room, and those along an edge of the cube.
type Room = (&'static str, u32, Option<u32>);

/// Runs both on every scene and prints what they took and how far they are off.
pub(crate) fn run(args: &[String]) -> Result<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().context("xtask lies in the workspace")?;
    let folder = root.join("target/bench-factors");
    std::fs::create_dir_all(&folder)?;
    let python = install(&folder)?;
    let script = root.join("benches/pyviewfactor/factors.py");
    crate::run(crate::cargo().current_dir(root).args(["build", "--release", "--quiet", "--package", "radiosa-cli"]))?;
    let mut rooms: Vec<Room> = vec![("empty", 10, None), ("cube", 10, Some(5)), ("empty", 16, None), ("cube", 14, Some(7))];
    if args.iter().any(|a| a == "--large") {
        rooms.extend([("empty", 31, None), ("cube", 28, Some(14))]);
    }
    println!("                         seconds, processor and wall             largest error   mean error of a row   closure");
    for (name, n, inner) in rooms {
        let scene = folder.join(format!("{name}-{n}.obj"));
        let n_faces = write_room(&scene, n, inner)?;
        let path = |whose: &str| folder.join(format!("{name}-{n}-{whose}"));
        let ours = |tolerance: &str, more: &[&str], out: &Path| -> Result<[f64; 2]> {
            let mut command = Command::new(root.join("target/release/radiosa"));
            command.arg("factors").arg(&scene).args(["--by", "patch", "--tolerance", tolerance, "--threads", "2", "--quiet"]);
            let Cost { processor, wall, .. } = Cost::of(command.args(more).arg("-o").arg(out))?;
            Ok([processor, wall])
        };
        let reference = path("reference.npz");
        let is_large = n_faces > 2000;
        let strict = match (inner.is_some(), is_large) {
            (false, _) => "1e-7",
            (true, false) => "1e-6",
            (true, true) => "1e-4",
        };
        ours(strict, &[], &reference)?;
        let (exact, coarse, sampled, theirs) = (path("cut.npz"), path("coarse.npz"), path("rays.npz"), path("pyviewfactor.npy"));
        let cost = [
            ours("1e-4", &[], &exact)?,
            ours("1e-3", &[], &coarse)?,
            // (What rays leave open is more than what this tolerance does.)
            ours("1e-2", &["--sampled-shadows", "--rays", "16"], &sampled)?,
            theirs_timed(&python, &script, &scene, &theirs)?,
        ];
        let said =
            Command::new(&python).arg(&script).arg("errors").args([&reference, &exact, &coarse, &sampled, &theirs]).output()?;
        let said = String::from_utf8_lossy(&said.stdout).into_owned();
        let whose = ["tolerance 1e-4", "tolerance 1e-3", "16 rays a pair", "pyviewfactor"];
        for ((whose, [cpu, wall]), errors) in whose.iter().zip(cost).zip(said.lines()) {
            let [theirs_cpu, theirs_wall] = cost[3];
            let ratio = format!("{:.1}× {:.1}×", theirs_cpu / cpu, theirs_wall / wall);
            println!("{name:6}{n_faces:5}  {whose:16} {cpu:8.2} {wall:8.2}  {ratio:16}  {errors}");
        }
    }
    Ok(())
}

/// A Python with pyviewfactor.
fn install(folder: &Path) -> Result<PathBuf> {
    let python = folder.join("venv/bin/python");
    if !python.exists() {
        crate::run(Command::new("python3").args(["-m", "venv"]).arg(folder.join("venv")))?;
    }
    crate::run(Command::new(&python).args(["-m", "pip", "install", "--quiet", "pyviewfactor==1.1.0"]))?;
    Ok(python)
}

/// Seconds of processor and wall, as pyviewfactor's own process measures them.
fn theirs_timed(python: &Path, script: &Path, scene: &Path, out: &Path) -> Result<[f64; 2]> {
    let output = Command::new(python).arg(script).arg("compute").args([scene, out]).env("NUMBA_NUM_THREADS", "2").output()?;
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    let words: Vec<&str> = said.split_whitespace().collect();
    let ["cpu", cpu, "wall", wall] = words[..] else { bail!("pyviewfactor: {}", String::from_utf8_lossy(&output.stderr)) };
    Ok([cpu.parse()?, wall.parse()?])
}

/// The inside of a unit box of `n × n` faces a side, with the outside of a cube of `inner × inner` faces a side in its middle.
fn write_room(path: &Path, n: u32, inner: Option<u32>) -> Result<u32> {
    let mut text = String::new();
    let mut n_vertices = 0;
    let mut n_faces = 0;
    let mut cube = |n: u32, low: f64, high: f64, inwards: bool| -> Result<()> {
        for side in 0..6u32 {
            let (axis, upper) = (side as usize % 3, side / 3);
            for cell in 0..n * n {
                let corner = |di: u32, dj: u32| {
                    let at = |k: u32| low + (high - low) * f64::from(k) / f64::from(n);
                    let mut p = [0.0; 3];
                    p[axis] = if upper == 1 { high } else { low };
                    p[(axis + 1) % 3] = at(cell % n + di);
                    p[(axis + 2) % 3] = at(cell / n + dj);
                    p
                };
                // Counter-clockwise around the axis, so the front is where the axis points.
                let mut corners = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
                if (upper == 1) == inwards {
                    corners.reverse();
                }
                for [x, y, z] in corners {
                    writeln!(text, "v {x} {y} {z}")?;
                }
                let first = n_vertices + 1;
                writeln!(text, "f {first} {} {} {}", first + 1, first + 2, first + 3)?;
                n_vertices += 4;
                n_faces += 1;
            }
        }
        Ok(())
    };
    cube(n, 0.0, 1.0, true)?;
    if let Some(inner) = inner {
        cube(inner, 0.25, 0.75, false)?;
    }
    std::fs::write(path, text)?;
    Ok(n_faces)
}
