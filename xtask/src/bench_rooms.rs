//! `cargo xtask bench rooms [METHOD…]`: rooms of diffuse surfaces by `radiosa measure`, at default settings and two threads, beside path-traced references of 100 sensors each
//! (`benches/rooms/rooms.py`, which makes them with Mitsuba 3 where they are missing).

use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, bail};

use crate::bench_whitted::Cost;

const ROOMS: [&str; 7] = ["partitions", "boxes", "boxes-white", "crooked", "maze", "l-shaped", "office"];

/// Measures every room by every method and prints how far they are off and what they took.
pub(crate) fn run(methods: &[String]) -> Result<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().context("xtask lies in the workspace")?;
    let folder = root.join("target/bench-rooms");
    std::fs::create_dir_all(&folder)?;
    let script = root.join("benches/rooms/rooms.py");
    crate::run(Command::new("python3").arg(&script).arg("make").arg(&folder).args(ROOMS))?;
    crate::run(crate::cargo().current_dir(root).args(["build", "--release", "--quiet", "--package", "radiosa-cli"]))?;
    let methods = if methods.is_empty() { vec!["radiosity".to_owned(), "hybrid".to_owned()] } else { methods.to_vec() };
    for room in ROOMS {
        for method in &methods {
            let out = folder.join(format!("{room}-{method}.csv"));
            let mut command = Command::new(root.join("target/release/radiosa"));
            command
                .arg("measure")
                .arg(folder.join(format!("{room}.obj")))
                .arg("--points")
                .arg(folder.join(format!("{room}.pts")));
            command.args(["--method", method, "--threads", "2", "-q", "-o"]).arg(&out);
            let Cost { processor: cpu, wall, .. } = Cost::of(&mut command)?;
            let said =
                Command::new("python3").arg(&script).arg("error").arg(folder.join(format!("{room}.csv"))).arg(&out).output()?;
            if !said.status.success() {
                bail!("{}", String::from_utf8_lossy(&said.stderr));
            }
            println!("{room:12} {method:10} {cpu:7.1} {wall:7.1} s   {}", String::from_utf8_lossy(&said.stdout).trim());
        }
    }
    Ok(())
}
