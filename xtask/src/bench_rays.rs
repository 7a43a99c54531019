//! `cargo xtask bench rays [--turns N] [SCENES…]`: builds and runs `benches/embree`, which is no member of the workspace since it links Embree.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};

/// The scenes measured when none are named, in the collection beside the checkout.
const SCENES: [&str; 4] =
    ["small-house/small-house.gltf", "sauerbraten-zdm2/zdm2.glb", "country-kitchen/kitchen.gltf", "shader-balls/shaderball.glb"];

/// Builds the benchmark and runs it.
pub(crate) fn run(args: &[String]) -> Result<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().context("xtask lies in the workspace")?;
    if !Path::new("/usr/include/embree3/rtcore.h").exists() {
        bail!("this compares with Embree 3.13, which is not installed; on Debian: apt-get install libembree-dev");
    }
    let mut options = Vec::new();
    let mut scenes: Vec<PathBuf> = Vec::new();
    let mut words = args.iter();
    while let Some(word) = words.next() {
        if word == "--turns" {
            options.extend([word.clone(), words.next().context("--turns wants a number")?.clone()]);
        } else {
            scenes.push(word.into());
        }
    }
    if scenes.is_empty() {
        let collection = root.join("../shared/scenes");
        if !collection.is_dir() {
            bail!("there is no {}: name the scenes to measure", collection.display());
        }
        scenes.extend(SCENES.map(|s| collection.join(s)));
    }
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    // The workspace's target folder: what it has compiled already is not compiled again.
    let status = Command::new(cargo)
        .args(["run", "--release", "--quiet", "--manifest-path"])
        .arg(root.join("benches/embree/Cargo.toml"))
        .arg("--target-dir")
        .arg(root.join("target"))
        .arg("--")
        .args(&options)
        .args(&scenes)
        .status()
        .context("cannot start cargo")?;
    if status.success() { Ok(()) } else { bail!("the benchmark ended with {status}") }
}
