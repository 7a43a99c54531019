//! Files made to break readers, and files broken here.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::time::{Duration, Instant};

use radiosa::import::{Options, load};
use serde_json::{Value, json};

use super::{Loaded, documents, shared};

/// What one hostile file may take.
const SECONDS: f64 = 2.0;

/// How often each file is broken at random.
const ROUNDS: usize = 1500;

/// Loads a file; a panic, a hang or an empty message fails the test.
fn load_safely(path: &Path, what: &str) -> Loaded {
    let start = Instant::now();
    let options = Options { max_memory: 512 << 20, ..Options::default() };
    let result = catch_unwind(AssertUnwindSafe(|| load(path, &options)));
    let seconds = start.elapsed().as_secs_f64();
    let result = result.unwrap_or_else(|_| panic!("{what} makes the reader panic"));
    assert!(seconds <= SECONDS, "{what} takes {seconds} s");
    if let Err(e) = &result {
        assert!(e.to_string().len() > 10, "{what} is refused with {e:?}, which says nothing");
    }
    result
}

/// The most memory this process ever had, bytes, where the system tells.
fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<u64>().ok()? << 10)
}

#[test]
fn no_hostile_file_makes_the_reader_panic_and_valid_ones_load() {
    let Some(folder) = shared("hostile/gltf") else { return };
    let files = documents(&folder);
    assert!(files.len() > 200, "only {} files", files.len());
    let (mut loaded, mut wrong) = (0, Vec::new());
    for path in &files {
        let result = load_safely(path, &path.display().to_string());
        loaded += usize::from(result.is_ok());
        let stem = path.file_stem().and_then(|s| s.to_str()).unwrap_or_default();
        if let Err(e) = result
            && stem.split('_').next() == Some("valid")
        {
            wrong.push(format!("{} is valid and refused: {e} ({:?})", path.display(), e.location()));
        }
    }
    eprintln!("{loaded} of {} hostile files load; peak of the whole process so far {:?} bytes", files.len(), peak_memory());
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The JSON of a document, when it is well-formed, and the binary chunk.
fn parts(bytes: &[u8]) -> Option<(Value, Option<Vec<u8>>)> {
    if !bytes.starts_with(b"glTF") {
        return Some((serde_json::from_slice(bytes).ok()?, None));
    }
    let word = |at: usize| Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?) as usize);
    let n = word(12)?;
    let json = serde_json::from_slice(bytes.get(20..20 + n)?).ok()?;
    let binary = word(20 + n).and_then(|m| bytes.get(28 + n..28 + n + m)).map(<[u8]>::to_vec);
    Some((json, binary))
}

/// Most of those files declare meshes, skins and cameras without placing any. Placed, they reach the rest of the reader.
#[test]
fn hostile_files_stay_harmless_when_everything_in_them_is_placed() {
    let Some(folder) = shared("hostile/gltf") else { return };
    let (mut tried, mut refused) = (0, 0);
    for path in documents(&folder) {
        let Some((mut json, binary)) = std::fs::read(&path).ok().and_then(|b| parts(&b)) else { continue };
        let count = |json: &Value, key: &str| json[key].as_array().map_or(0, Vec::len);
        let (n_meshes, n_cameras, n_skins) = (count(&json, "meshes"), count(&json, "cameras"), count(&json, "skins"));
        let lights = json["extensions"]["KHR_lights_punctual"]["lights"].as_array().map_or(0, Vec::len);
        if n_meshes + n_cameras + lights == 0 || !json.is_object() {
            continue;
        }
        let mut nodes = json["nodes"].as_array().cloned().unwrap_or_default();
        for mesh in 0..n_meshes {
            nodes.push(json!({"mesh": mesh}));
            nodes.extend((0..n_skins).map(|skin| json!({"mesh": mesh, "skin": skin})));
            nodes.push(json!({"mesh": mesh, "weights": [0.5, 0.25, 1.0]}));
        }
        nodes.extend((0..n_cameras).map(|camera| json!({"camera": camera})));
        nodes.extend((0..lights).map(|light| json!({"extensions": {"KHR_lights_punctual": {"light": light}}})));
        json["nodes"] = nodes.into();
        for key in ["scene", "scenes"] {
            json.as_object_mut().expect("an object").remove(key);
        }
        let copy = tempfile::tempdir().expect("a temporary folder");
        for entry in std::fs::read_dir(path.parent().expect("a folder")).expect("it is readable").flatten() {
            let name = entry.path();
            if name.extension().is_some_and(|e| ["bin", "png", "jpg", "webp"].iter().any(|k| e == *k)) {
                std::fs::write(copy.path().join(entry.file_name()), std::fs::read(name).expect("a file")).expect("a copy");
            }
        }
        // Again with storage behind every accessor that has none, so that counts and types are what is wrong.
        for with_storage in [false, true] {
            let mut json = json.clone();
            if with_storage {
                let buffer = count(&json, "buffers");
                let view = count(&json, "bufferViews");
                let zeros = format!("data:application/octet-stream;base64,{}", "A".repeat(1 << 14));
                if buffer > 0 {
                    json["buffers"].as_array_mut().expect("an array").push(json!({"byteLength": 4096, "uri": zeros}));
                } else {
                    json["buffers"] = json!([{"byteLength": 4096, "uri": zeros}]);
                }
                let new_view = json!({"buffer": buffer, "byteLength": 4096});
                if view > 0 {
                    json["bufferViews"].as_array_mut().expect("an array").push(new_view);
                } else {
                    json["bufferViews"] = json!([new_view]);
                }
                for accessor in json["accessors"].as_array_mut().into_iter().flatten() {
                    if accessor.is_object() && accessor.get("bufferView").is_none() {
                        accessor["bufferView"] = view.into();
                    }
                }
            }
            let (name, bytes) = match &binary {
                Some(binary) => ("placed.glb", super::document::glb(json.to_string().as_bytes(), Some(binary))),
                None => ("placed.gltf", json.to_string().into_bytes()),
            };
            let placed = copy.path().join(name);
            std::fs::write(&placed, bytes).expect("a file");
            tried += 1;
            refused += usize::from(load_safely(&placed, &format!("{} with everything placed", path.display())).is_err());
        }
    }
    eprintln!("{tried} documents tried, {refused} refused");
    assert!(tried > 60, "only {tried}");
}

/// One document with a bit of everything the reader knows.
fn everything() -> Vec<u8> {
    use super::document::{Document, U8};
    let mut d = Document::new();
    let positions = d.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0]);
    let normals = d.floats("VEC3", &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    let tangents = d.floats("VEC4", &[1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0]);
    let uvs = d.floats("VEC2", &[0.0; 8]);
    let colors = d.accessor(U8, "VEC4", 4, &[255; 16]);
    let joints = d.accessor(U8, "VEC4", 4, &[0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 1, 1, 0, 0]);
    let weights = d.floats("VEC4", &[0.5, 0.5, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
    let indices = d.accessor(U8, "SCALAR", 6, &[0, 1, 2, 0, 2, 3]);
    let matrices = d.floats("MAT4", &[0.5; 32]);
    let places = d.floats("VEC3", &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
    let sparse = d.push(
        "accessors",
        json!({"componentType": 5126, "type": "VEC3", "count": 4, "sparse": {
            "count": 1, "indices": {"bufferView": indices, "componentType": 5121}, "values": {"bufferView": positions},
        }}),
    );
    d.push("meshes", json!({"weights": [0.5, 0.25], "primitives": [{
        "attributes": {"POSITION": positions, "NORMAL": normals, "TANGENT": tangents, "TEXCOORD_0": uvs, "TEXCOORD_1": uvs,
            "COLOR_0": colors, "JOINTS_0": joints, "WEIGHTS_0": weights},
        "indices": indices, "material": 0, "targets": [{"POSITION": sparse, "NORMAL": normals}, {"POSITION": positions}],
        "extensions": {"FB_ngon_encoding": {}},
    }, {"attributes": {"POSITION": positions}, "mode": 5, "indices": indices}, {"attributes": {"POSITION": positions}, "mode": 6}]}));
    d.push("skins", json!({"joints": [1, 2], "inverseBindMatrices": matrices}));
    d.push("cameras", json!({"type": "perspective", "perspective": {"yfov": 0.5, "aspectRatio": 2}}));
    d.push("images", json!({"bufferView": 1}));
    d.push("samplers", json!({"wrapS": 33071, "magFilter": 9728}));
    d.push("textures", json!({"source": 0, "sampler": 0}));
    let texture = json!({"index": 0, "texCoord": 1, "extensions": {"KHR_texture_transform": {"offset": [1, 2], "rotation": 3}}});
    d.push("materials", json!({
        "pbrMetallicRoughness": {"baseColorTexture": texture, "roughnessFactor": 0.5}, "normalTexture": texture, "alphaMode": "MASK",
        "extensions": {"KHR_materials_volume": {"thicknessFactor": 1, "attenuationDistance": 2, "attenuationColor": [0.1, 0.2, 0.3]},
            "KHR_materials_ior": {"ior": 1.4}, "KHR_materials_specular": {"specularColorFactor": [1, 2, 3]}},
    }));
    d.json["extensions"] =
        json!({"KHR_lights_punctual": {"lights": [{"type": "spot", "spot": {"outerConeAngle": 0.5}, "range": 3}]}});
    let instances = json!({"attributes": {"TRANSLATION": places, "SCALE": places}});
    d.push("nodes", json!({"mesh": 0, "skin": 0, "weights": [0.125, 1]}));
    d.push("nodes", json!({"children": [0, 2, 3, 4], "rotation": [0, 0, 1, 1], "scale": [1, 2, -3]}));
    d.push("nodes", json!({"matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1], "camera": 0}));
    d.push("nodes", json!({"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": instances}}));
    d.push("nodes", json!({"extensions": {"KHR_lights_punctual": {"light": 0}}}));
    d.push("scenes", json!({"nodes": [1]}));
    d.glb()
}

/// A small generator of reproducible numbers (Steele, Lea and Flood's SplitMix64).
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % n as u64) as usize
    }
}

#[test]
fn truncated_and_flipped_files_are_refused_or_read() {
    let names = [
        "BoxInterleaved/glTF-Binary/BoxInterleaved.glb",
        "lights-punctual/Lights.glb",
        "sparse-morph/singleBlendshapeCube_sparse.glb",
        "SimpleSparseAccessor/glTF-Embedded/SimpleSparseAccessor.gltf",
        "SimpleMorph/glTF-Embedded/SimpleMorph.gltf",
        "Cameras/glTF-Embedded/Cameras.gltf",
    ];
    let mut files = vec![("a document with everything.glb", everything())];
    if let Some(folder) = shared("scenes/gltf-features") {
        files.extend(names.map(|name| (name, std::fs::read(folder.join(name)).unwrap_or_else(|e| panic!("{name}: {e}")))));
    }
    let temporary = tempfile::tempdir().expect("a temporary folder");
    let start = Instant::now();
    let (mut tried, mut refused) = (0, 0);
    for (name, bytes) in files {
        let path = temporary.path().join(if name.ends_with("glb") { "broken.glb" } else { "broken.gltf" });
        std::fs::write(&path, &bytes).expect("a file");
        let whole = load_safely(&path, name).map(|(scene, _)| scene.n_primitives());
        assert!(whole.is_ok_and(|n| n > 0), "{name} must load before it is broken");
        let mut numbers = Numbers(bytes.len() as u64);
        let mut attempt = |broken: &[u8], what: &str| {
            // A new file each time: overwriting one makes some file systems wait for the disk.
            let _ = std::fs::remove_file(&path);
            std::fs::write(&path, broken).expect("a file");
            tried += 1;
            refused += usize::from(load_safely(&path, &format!("{name} {what}")).is_err());
        };
        for _ in 0..100 {
            let n = numbers.below(bytes.len());
            attempt(&bytes[..n], &format!("cut to {n}"));
        }
        let digits: Vec<usize> = (0..bytes.len().min(8000)).filter(|&i| bytes[i].is_ascii_digit()).collect();
        for round in 0..ROUNDS {
            let mut broken = bytes.clone();
            for _ in 0..1 + round % 4 {
                match round % 3 {
                    // Another number: the JSON stays well-formed and means something else.
                    0 => broken[digits[numbers.below(digits.len())]] = b'0' + numbers.below(10) as u8,
                    1 => broken[numbers.below(bytes.len())] ^= 1 << numbers.below(8),
                    _ => broken[numbers.below(bytes.len().min(4000))] = b"9-.,e[]{}\""[numbers.below(10)],
                }
            }
            attempt(&broken, &format!("flipped, round {round}"));
        }
    }
    eprintln!(
        "{tried} broken files in {:.1} s, {refused} refused; peak {:?} bytes",
        start.elapsed().as_secs_f64(),
        peak_memory()
    );
    assert!(start.elapsed() < Duration::from_secs(30));
    assert!(
        refused * 4 > tried && refused < tried,
        "{refused} of {tried} refused: damage must matter, and not be all that is met"
    );
}
