//! `cargo xtask bench scanline [OPTIONS…]`: builds and runs `benches/llvmpipe`, which is no member of the workspace since it needs Mesa's software OpenGL.

use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, bail};

/// The scenes measured, from the project's root.
const SCENES: [&str; 3] = [
    "scenes/rooms/sauerbraten-zdm2.toml",
    "../shared/scenes/small-house/small-house.gltf",
    "../shared/scenes/country-kitchen/kitchen.gltf",
];

/// Threads llvmpipe draws pixels with, as many as the benchmark gives ours; vertices are its caller's work, a thread more.
const THREADS: &str = "2";

/// Builds the benchmark and runs it; options are handed on.
pub(crate) fn run(args: &[String]) -> Result<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().context("xtask lies in the workspace")?;
    if !root.join(SCENES[1]).exists() {
        bail!("this measures scenes of the collection, which is not beside the checkout");
    }
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let status = Command::new(cargo)
        .current_dir(root)
        .args(["run", "--release", "--quiet", "--manifest-path", "benches/llvmpipe/Cargo.toml", "--target-dir", "target", "--"])
        .args(SCENES)
        .args(args)
        .env("LP_NUM_THREADS", THREADS)
        .status()
        .context("cannot start cargo")?;
    if status.success() {
        Ok(())
    } else {
        bail!("the benchmark ended with {status}; it needs Debian's libegl1 and libgl1-mesa-dri")
    }
}
