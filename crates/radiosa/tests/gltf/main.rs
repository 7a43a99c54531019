//! glTF and GLB: what small documents mean, that the collected scenes load with the triangles and boxes they are known to have, and
//! that no bytes make the reader panic, hang or swell.

#![expect(clippy::print_stderr, reason = "tests say what they skip and what was refused")]

mod collection;
mod document;
mod hostile;
mod materials;
mod placement;
mod shapes;

use std::path::{Path, PathBuf};

use radiosa::import::{ImportError, Warning};
use radiosa::scene::Scene;
use radiosa_testkit::shared_dir;

/// What loading gives.
type Loaded = Result<(Scene, Vec<Warning>), ImportError>;

/// Every document below a folder, sorted.
fn documents(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut open = vec![folder.to_path_buf()];
    while let Some(folder) = open.pop() {
        for entry in std::fs::read_dir(&folder).expect("the folder is readable").flatten() {
            let path = entry.path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|e| e == "gltf" || e == "glb") {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

/// A folder of the collection beside the checkout.
fn shared(folder: &str) -> Option<PathBuf> {
    let found = shared_dir().map(|d| d.join(folder)).filter(|d| d.is_dir());
    if found.is_none() {
        eprintln!("skipped: the collection ../shared/{folder} is not here");
    }
    found
}

/// Whether a warning of this name was given.
fn warned(warnings: &[Warning], name: &str) -> bool {
    warnings.iter().any(|w| w.name == name)
}
