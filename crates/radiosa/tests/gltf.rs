//! glTF and GLB: the collected scenes load with the triangles and boxes they are known to have, and no bytes make the reader panic.

#![expect(clippy::print_stderr, reason = "tests say what they skip and what was refused")]

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use radiosa::import::{ImportError, Options, Warning, load};
use radiosa::scene::Scene;
use radiosa_testkit::shared_dir;

/// Extensions that may refuse a file: they pack geometry or pictures.
const PACKING: [&str; 4] =
    ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression", "KHR_texture_basisu"];

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

fn shared(folder: &str) -> Option<PathBuf> {
    let found = shared_dir().map(|d| d.join(folder)).filter(|d| d.is_dir());
    if found.is_none() {
        eprintln!("skipped: the collection ../shared/{folder} is not here");
    }
    found
}

/// What hostile files may take.
fn tight() -> Options {
    Options { max_memory: 512 << 20, ..Options::default() }
}

type Loaded = Result<(Scene, Vec<Warning>), ImportError>;

/// Loads a file; a panic, a hang or an empty message fails the test.
fn load_safely(path: &Path) -> Loaded {
    let start = Instant::now();
    let result = catch_unwind(AssertUnwindSafe(|| load(path, &tight())));
    let seconds = start.elapsed().as_secs_f64();
    let result = result.unwrap_or_else(|_| panic!("{} makes the reader panic", path.display()));
    assert!(seconds <= 2.0, "{} takes {seconds} s", path.display());
    if let Err(e) = &result {
        assert!(e.to_string().len() > 10, "{} is refused with {e:?}, which says nothing", path.display());
    }
    result
}

#[test]
fn every_collected_scene_loads_or_names_the_extension_it_needs() {
    let Some(folder) = shared("scenes") else { return };
    let files = documents(&folder);
    assert!(files.len() > 100, "only {} files", files.len());
    let mut refused = Vec::new();
    for path in &files {
        match load(path, &Options::default()) {
            Ok((_, warnings)) => {
                if std::env::var_os("RADIOSA_TEST_VERBOSE").is_some() {
                    warnings.iter().for_each(|w| eprintln!("{}: {}: {}", path.display(), w.name, w.message));
                }
            }
            Err(ImportError::Unsupported { feature, help, .. }) if PACKING.iter().any(|e| feature.contains(e)) => {
                assert!(!help.is_empty());
                refused.push(format!("{}: {feature}", path.strip_prefix(&folder).unwrap_or(path).display()));
            }
            Err(e) => panic!("{} does not load: {e} ({:?})", path.display(), e.location()),
        }
    }
    eprintln!("{} of {} refused:\n  {}", refused.len(), files.len(), refused.join("\n  "));
    assert!(refused.len() <= 14, "{} files are refused", refused.len());
}

/// Files whose row in the index leaves out what the format says: default morph weights, sparse values, instancing by extension.
/// (name, triangles, largest corner), from the documents themselves.
const CORRECTED: [(&str, u64, [f64; 3]); 3] = [
    ("SimpleMorph.gltf", 1, [1.0, 1.5, 0.0]),
    ("SimpleSparseAccessor.gltf", 12, [6.0, 4.0, 0.0]),
    ("24_gpu_instancing.gltf", 7_656_770, [339.4, 13.3, 339.4]),
];

/// A row of the collection's index: path, triangles, corners of the box.
fn rows(index: &str) -> Vec<(String, u64, [f64; 6])> {
    let mut rows = Vec::new();
    for line in index.lines().filter(|l| l.starts_with("| `")) {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        let path = cells[1].trim_matches('`').to_owned();
        let numbers: Vec<f64> = cells[4].replace("..", " ").split_whitespace().filter_map(|v| v.parse().ok()).collect();
        if let (Ok(triangles), Ok(corners)) = (cells[2].parse(), <[f64; 6]>::try_from(numbers)) {
            rows.push((path, triangles, corners));
        }
    }
    rows
}

#[test]
fn collected_scenes_have_the_triangles_and_boxes_of_the_index() {
    let Some(folder) = shared("scenes") else { return };
    let index = std::fs::read_to_string(folder.join("INDEX.md")).expect("the index is readable");
    let mut compared = 0;
    let mut wrong = Vec::new();
    for (name, mut triangles, mut corners) in rows(&index).into_iter().filter(|(name, ..)| !name.ends_with(".obj")) {
        if let Some((_, n, hi)) = CORRECTED.iter().find(|(file, ..)| name.ends_with(file)) {
            triangles = *n;
            corners[3..].copy_from_slice(hi);
        }
        let (scene, _) = match load(&folder.join(&name), &Options::default()) {
            Ok(loaded) => loaded,
            Err(ImportError::Unsupported { .. }) => continue,
            Err(e) => panic!("{name}: {e}"),
        };
        compared += 1;
        if scene.n_primitives() != triangles {
            wrong.push(format!("{name}: {} triangles, the index has {triangles}", scene.n_primitives()));
        }
        let Some((lo, hi)) = scene.bounds() else {
            wrong.push(format!("{name}: no box"));
            continue;
        };
        let found = [lo.x, lo.y, lo.z, hi.x, hi.y, hi.z];
        // The index prints three digits; what is tiny beside the whole is rounding there.
        let noise = 1e-6 * (hi - lo).max_element();
        if found.iter().zip(&corners).any(|(f, c)| (f - c).abs() > 0.00501 * c.abs() + noise) {
            wrong.push(format!("{name}: box {found:?}, the index has {corners:?}"));
        }
    }
    eprintln!("{compared} files compared");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(compared >= 90, "only {compared} files compared");
}

#[test]
fn no_hostile_file_makes_the_reader_panic_and_valid_ones_load() {
    let Some(folder) = shared("hostile/gltf") else { return };
    let files = documents(&folder);
    assert!(files.len() > 200, "only {} files", files.len());
    let (mut loaded, mut wrong) = (0, Vec::new());
    for path in &files {
        let result = load_safely(path);
        loaded += usize::from(result.is_ok());
        let stem = path.file_stem().and_then(|s| s.to_str()).unwrap_or_default();
        let is_valid = stem.split('_').next() == Some("valid");
        if let Err(e) = &result {
            if is_valid {
                wrong.push(format!("{} is valid and refused: {e} ({:?})", path.display(), e.location()));
            } else if std::env::var_os("RADIOSA_TEST_VERBOSE").is_some() {
                eprintln!("{}: {e} {:?} {}", path.display(), e.location().map(ToString::to_string), e.help());
            }
        } else if std::env::var_os("RADIOSA_TEST_VERBOSE").is_some() {
            eprintln!("{}: loads; {:?}", path.display(), result.map(|r| r.1));
        }
    }
    eprintln!("{loaded} of {} hostile files load", files.len());
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_largest_collected_scene_loads_quickly() {
    let Some(folder) = shared("scenes/country-kitchen") else { return };
    let start = Instant::now();
    let (scene, warnings) = load(&folder.join("kitchen.gltf"), &Options::default()).expect("it loads");
    let seconds = start.elapsed().as_secs_f64();
    eprintln!("{} triangles, {} instances in {seconds:.2} s; {warnings:?}", scene.n_primitives(), scene.instances.len());
    assert_eq!(scene.n_primitives(), 1_443_517);
    assert!(start.elapsed() < Duration::from_secs(15), "{seconds} s");
}
