//! The scenes others made.

use std::time::{Duration, Instant};

use radiosa::import::{ImportError, Options, load};

use super::{documents, shared, warned};

/// Extensions that may refuse a file: they pack geometry or pictures.
const PACKING: [&str; 4] =
    ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression", "KHR_texture_basisu"];

#[test]
fn every_collected_scene_loads_or_names_the_extension_it_needs() {
    let Some(folder) = shared("scenes") else { return };
    let files = documents(&folder);
    assert!(files.len() > 100, "only {} files", files.len());
    let mut refused = Vec::new();
    for path in &files {
        match load(path, &Options::default()) {
            Ok(_) => {}
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
fn rows(index: &str) -> Vec<(String, u64, Option<[f64; 6]>)> {
    let mut rows = Vec::new();
    for line in index.lines().filter(|l| l.starts_with("| `")) {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        let path = cells[1].trim_matches('`').to_owned();
        let numbers: Vec<f64> = cells[4].replace("..", " ").split_whitespace().filter_map(|v| v.parse().ok()).collect();
        if let Ok(triangles) = cells[2].parse() {
            rows.push((path, triangles, numbers.try_into().ok()));
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
            corners = corners.map(|[a, b, c, ..]| [a, b, c, hi[0], hi[1], hi[2]]);
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
        let (Some(corners), Some((lo, hi))) = (corners, scene.bounds()) else {
            assert!(corners.is_none(), "{name}: no box");
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
fn the_largest_collected_scene_loads_quickly() {
    let Some(folder) = shared("scenes/country-kitchen") else { return };
    let start = Instant::now();
    let (scene, warnings) = load(&folder.join("kitchen.gltf"), &Options::default()).expect("it loads");
    let seconds = start.elapsed().as_secs_f64();
    eprintln!("{} triangles, {} instances in {seconds:.2} s; {warnings:?}", scene.n_primitives(), scene.instances.len());
    assert_eq!(scene.n_primitives(), 1_443_517);
    assert!(start.elapsed() < Duration::from_secs(15), "{seconds} s");
}

#[test]
fn features_of_the_collected_scenes_arrive() {
    let Some(folder) = shared("scenes") else { return };
    let open = |name: &str| load(&folder.join(name), &Options::default()).unwrap_or_else(|e| panic!("{name}: {e}"));

    let (house, _) = open("small-house/small-house.gltf");
    assert_eq!(house.lights.len(), 8);
    let (boxes, _) = open("gltf-features/lights-punctual/Lights.glb");
    assert_eq!((boxes.lights.len(), boxes.cameras.len()), (4, 1));
    let (ball, _) = open("shader-balls/shaderball.glb");
    let polygons = ball.meshes[0].polygons.as_ref().expect("n-gons are encoded");
    let n = polygons.offsets.len() - 1;
    assert!(n * 3 < ball.meshes[0].triangles.len() * 2, "{n} polygons: quads would be half of the triangles");
    let (names, warnings) = open("gltf-features/names/Unicode ❤♻ Test.gltf");
    assert_eq!((names.images.len(), warnings.len()), (1, 0), "{warnings:?}");
    for name in ["CubeImageUriSpaces.gltf", "CubeImageUriMultipleSpaces.gltf"] {
        let (names, warnings) = open(&format!("gltf-features/names-spaces/{name}"));
        assert_eq!((names.images.len(), warnings.len()), (1, 0), "{warnings:?}");
    }
    let (webp, warnings) = open("gltf-features/compressed/webp/box-textured-separate/box-textured-with-fallback.gltf");
    assert_eq!((webp.images.len(), warnings.len()), (1, 0), "{warnings:?}");
    let (modes, warnings) = open("gltf-features/primitive-modes/PrimitiveModeNormalsTest.glb");
    assert!(warned(&warnings, "ignored-points-and-lines") && modes.n_primitives() == 2562);
}
