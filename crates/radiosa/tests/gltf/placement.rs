//! Containers, nodes, instances, lights and cameras.

use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2};

use radiosa::import::{ImportError, Options, load};
use radiosa::math::{DMat3, DVec3};
use radiosa::scene::{Cone, Geometry, LightKind, MeshId, NodeId, PhotometricUnit, Projection, Quantity, SourceContent};
use radiosa::spectrum::Spectrum;
use serde_json::{Value, json};

use super::document::{Document, F32, I16, glb, is_unsupported, load_bytes};
use super::warned;

fn close(a: DVec3, b: DVec3) -> bool {
    (a - b).length() < 1e-12 * (1.0 + b.length())
}

#[test]
fn a_glb_reads_like_its_text_twin() {
    let document = Document::triangle();
    let (text, _) = document.load();
    let (binary, warnings) = load_bytes("glb", &document.glb()).expect("it loads");
    assert_eq!(text.meshes, binary.meshes);
    assert!(warnings.is_empty(), "{warnings:?}");
    // The first bytes decide, not the ending.
    assert_eq!(load_bytes("gltf", &document.glb()).expect("it loads").0.meshes, text.meshes);

    let mut longer = document.glb();
    longer.extend_from_slice(b"after the end");
    assert!(warned(&load_bytes("glb", &longer).expect("it loads").1, "trailing-bytes"));
    for n in [0, 3, 4, 11, 12, 19, 20, 100, document.glb().len() - 1] {
        assert!(load_bytes("glb", &document.glb()[..n]).is_err(), "cut to {n} bytes it loads");
    }
}

#[test]
fn malformed_text_is_located() {
    let e = load_bytes("gltf", b"{\"asset\": {\"version\": \"2.0\"},\n \"nodes\": [}").expect_err("it is malformed");
    assert_eq!(e.location().and_then(|l| l.line), Some((2, 12)), "{e}");
    let e = load_bytes("glb", &glb(b"{}", None)).expect_err("no asset");
    assert!(e.to_string().contains("asset") && !e.help().is_empty());
    let mut old = Document::triangle();
    old.json["asset"]["version"] = "1.0".into();
    assert!(is_unsupported(&old.try_load(), "1.0"));
}

#[test]
fn required_extensions_are_honoured_or_named() {
    let mut document = Document::triangle();
    for name in ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_texture_basisu", "VENDOR_new_geometry"] {
        document.json["extensionsRequired"] = json!([name]);
        let result = document.try_load();
        assert!(is_unsupported(&result, name));
        assert!(!result.expect_err("it is refused").help().is_empty());
    }
    document.json["extensionsRequired"] = json!(["KHR_texture_transform", "KHR_materials_unlit", "KHR_materials_variants"]);
    document.json["extensionsUsed"] = json!(["KHR_texture_transform", "KHR_materials_variants", "KHR_materials_variants"]);
    let (_, warnings) = document.load();
    assert_eq!(warnings.len(), 1, "once: {warnings:?}");
}

#[test]
fn files_are_found_by_their_decoded_names() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let document = Document::triangle();
    std::fs::create_dir(folder.path().join("a folder")).expect("a folder");
    std::fs::write(folder.path().join("a folder/ünï 100% code.bin"), &document.bytes).expect("a file");
    let path = folder.path().join("scene.gltf");
    for uri in ["a%20folder/%C3%BCn%C3%AF%20100%25%20code.bin", "a folder/ünï 100% code.bin", "a folder\\ünï 100% code.bin"] {
        let mut json = document.json.clone();
        json["buffers"] = json!([{"byteLength": document.bytes.len(), "uri": uri}]);
        std::fs::write(&path, json.to_string()).expect("a file");
        let (scene, _) = load(&path, &Options::default()).unwrap_or_else(|e| panic!("{uri}: {e}"));
        assert_eq!(scene.n_primitives(), 1);
    }
    for uri in ["../outside.bin", "/etc/hostname", "https://example.org/a.bin", "file:///etc/hostname"] {
        let mut json = document.json.clone();
        json["buffers"] = json!([{"byteLength": 4, "uri": uri}]);
        std::fs::write(&path, json.to_string()).expect("a file");
        let result = load(&path, &Options::default());
        assert!(matches!(result, Err(ImportError::Unsupported { .. })), "{uri}: {result:?}");
    }
}

#[test]
fn the_source_is_kept_byte_for_byte() {
    let mut document = Document::triangle();
    document.json["extras"] = json!({"kept": ["as", {"it": "is"}]});
    let (scene, _) = document.load();
    let SourceContent::Gltf { json, buffers } = &scene.sources[0].content else { panic!("no glTF source") };
    assert_eq!(*json, document.text());
    assert_eq!(buffers.iter().map(|b| b.to_vec()).collect::<Vec<_>>(), [document.bytes.clone()]);
    assert_eq!(scene.quantity, Quantity::Photometric);
}

#[test]
fn transforms_compose_from_the_root_down() {
    let mut document = Document::triangle();
    document.json["nodes"] = json!([
        {"name": "leaf", "mesh": 0, "translation": [1.0, 2.0, 3.0]},
        // A quarter turn about z after a scale.
        {"name": "turned", "rotation": [0.0, 0.0, FRAC_1_SQRT_2, FRAC_1_SQRT_2], "scale": [2.0, 3.0, 4.0], "children": [0]},
        {"name": "root", "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 100, 0, 0, 1], "children": [1]},
    ]);
    let (scene, _) = document.load();
    let transform = scene.instances[0].transform;
    // (1,2,3) scaled is (2,6,12), turned (−6,2,12), moved by 100.
    assert!(close(transform.transform_point3(DVec3::ZERO), DVec3::new(94.0, 2.0, 12.0)));
    assert!(close(transform.transform_point3(DVec3::X), DVec3::new(94.0, 4.0, 12.0)));
    assert_eq!(scene.nodes.iter().map(|n| n.parent).collect::<Vec<_>>(), [Some(NodeId(1)), Some(NodeId(2)), None]);
    assert_eq!(scene.nodes[1].source, Some((0, 1)));
    assert_eq!((scene.instances[0].name.as_str(), scene.instances[0].node), ("leaf", Some(NodeId(0))));
}

#[test]
fn quaternions_need_no_unit_length_and_mirrors_keep_their_sign() {
    let mut document = Document::triangle();
    document.json["nodes"] = json!([
        {"mesh": 0, "rotation": [0.0, 0.0, 1e-170, 1e-170]},
        {"mesh": 0, "rotation": [0.0, 0.0, 0.0, 0.0]},
        {"mesh": 0, "scale": [-1.0, 2.0, 2.0]},
    ]);
    let (scene, _) = document.load();
    let at = |i: usize| scene.instances[i].transform;
    assert!(close(at(0).transform_vector3(DVec3::X), DVec3::Y));
    assert!(close(at(1).transform_vector3(DVec3::X), DVec3::X));
    assert!(at(2).matrix3.determinant() < 0.0, "the sign tells the front");
    assert_eq!(scene.meshes.len(), 1, "instances share their mesh");
    assert!(scene.instances.iter().all(|i| i.geometry == Geometry::Mesh(MeshId(0))));
}

#[test]
fn cycles_are_refused_and_chains_may_be_long() {
    let mut document = Document::triangle();
    document.json["nodes"] = json!([{"children": [1]}, {"children": [2]}, {"children": [0]}]);
    assert_eq!(document.refusal().0, "/nodes/2/children");
    document.json["nodes"] = json!([{"children": [0]}]);
    assert_eq!(document.refusal().0, "/nodes/0/children");

    let n = 100_000;
    let chain =
        (0..n).map(|i| if i + 1 < n { json!({"children": [i + 1], "translation": [1, 0, 0]}) } else { json!({"mesh": 0}) });
    document.json["nodes"] = chain.collect();
    let (scene, _) = document.load();
    assert_eq!(scene.instances[0].transform.translation.x, f64::from(n - 1));
}

#[test]
fn nodes_with_several_parents_are_placed_under_each_within_reason() {
    let mut document = Document::triangle();
    document.json["nodes"] = json!([
        {"children": [2]}, {"children": [2], "translation": [5, 0, 0]}, {"mesh": 0},
    ]);
    let (scene, warnings) = document.load();
    assert_eq!(scene.instances.len(), 2);
    assert!(warned(&warnings, "shared-node"));
    // Thirty doublings on top of each other.
    let doubling = |i: usize| if i < 30 { json!({"children": [i + 1, i + 1]}) } else { json!({"mesh": 0}) };
    document.json["nodes"] = (0..31).map(doubling).collect();
    assert!(document.refusal().1.contains("several parents"));
}

#[test]
fn the_default_scene_is_what_is_placed() {
    let mut document = Document::triangle();
    document.json["nodes"] =
        json!([{"mesh": 0, "name": "a"}, {"mesh": 0, "name": "b"}, {"mesh": 0, "name": "c", "children": [1]}]);
    let names = |document: &Document| document.load().0.instances.iter().map(|i| i.name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&document), ["a", "c", "b"], "all roots where there is no scene");
    document.json["scenes"] = json!([{"nodes": [0]}, {"nodes": [2]}]);
    assert_eq!(names(&document), ["a"]);
    document.json["scene"] = 1.into();
    assert_eq!(names(&document), ["c", "b"]);
    assert!(warned(&document.load().1, "other-scenes"));
    document.json["nodes"][1]["extensions"] = json!({"KHR_node_visibility": {"visible": false}});
    assert_eq!(names(&document), ["c"]);
    document.json["scene"] = 2.into();
    assert_eq!(document.refusal().0, "/scene");
}

#[test]
fn instancing_multiplies_a_node() {
    let mut document = Document::triangle();
    let translations = document.floats("VEC3", &[0.0, 0.0, 0.0, 0.0, 7.0, 0.0]);
    let rotations: Vec<u8> = [0i16, 0, 0, 32767, 0, 0, 23170, 23170].iter().flat_map(|v| v.to_le_bytes()).collect();
    let rotations = document.accessor(I16, "VEC4", 2, &rotations);
    document.json["accessors"][rotations]["normalized"] = true.into();
    document.json["nodes"][0]["scale"] = json!([2, 2, 2]);
    document.json["nodes"][0]["extensions"] =
        json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": translations, "ROTATION": rotations}}});
    let (scene, _) = document.load();
    assert_eq!((scene.meshes.len(), scene.instances.len()), (1, 2));
    assert!(close(scene.instances[1].transform.transform_point3(DVec3::X), DVec3::new(0.0, 16.0, 0.0)));
    document.json["accessors"][rotations]["count"] = 1.into();
    assert!(document.refusal().0.starts_with("/nodes/0/extensions/EXT_mesh_gpu_instancing"));
}

fn with_light(light: Value, node: Value) -> Document {
    let mut document = Document::new();
    document.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [light]}});
    document.push("nodes", node);
    document.json["nodes"][0]["extensions"] = json!({"KHR_lights_punctual": {"light": 0}});
    document
}

#[test]
fn lights_shine_down_the_negative_z_axis_of_their_node() {
    // A quarter turn about x: −z to −… (0,0,−1) to (0,1,0).
    let turned = json!({"rotation": [FRAC_1_SQRT_2, 0.0, 0.0, FRAC_1_SQRT_2], "translation": [1, 2, 3], "scale": [3, 3, 3]});
    let (scene, _) =
        with_light(json!({"type": "directional", "intensity": 3.0, "color": [1.0, 0.5, 0.0]}), turned.clone()).load();
    assert_eq!(scene.lights[0].diffuse, Spectrum::new(3.0, 1.5, 0.0));
    assert_eq!(scene.lights[0].specular, scene.lights[0].diffuse);
    let LightKind::Distant { to_light, unit } = scene.lights[0].kind else { panic!("{:?}", scene.lights) };
    assert!(close(to_light, -DVec3::Y) && unit == PhotometricUnit::Physical, "{to_light}");

    let spot = json!({"type": "spot", "spot": {"innerConeAngle": 0.25, "outerConeAngle": 0.5}, "range": 9.0});
    let (scene, _) = with_light(spot, turned.clone()).load();
    let LightKind::Spot { position, axis, cone, unit, range, .. } = scene.lights[0].kind else { panic!("{:?}", scene.lights) };
    assert!(close(position, DVec3::new(1.0, 2.0, 3.0)) && close(axis, DVec3::Y));
    assert_eq!((cone, unit, range), (Cone::Gltf { inner: 0.25, outer: 0.5 }, PhotometricUnit::Physical, 9.0));

    let (scene, _) = with_light(json!({"type": "point", "name": "lamp"}), turned).load();
    assert_eq!((scene.lights[0].name.as_str(), scene.lights[0].diffuse), ("lamp", Spectrum::WHITE));
    let LightKind::Point { position, range, .. } = scene.lights[0].kind else { panic!("{:?}", scene.lights) };
    assert!(close(position, DVec3::new(1.0, 2.0, 3.0)) && range == f64::INFINITY);
}

#[test]
fn odd_lights_are_mended_or_left_out_and_said() {
    let (scene, warnings) =
        with_light(json!({"type": "spot", "spot": {"innerConeAngle": 1.0, "outerConeAngle": 0.5}}), json!({})).load();
    assert!(matches!(scene.lights[0].kind, LightKind::Spot { cone: Cone::Gltf { inner, outer }, .. } if inner <= outer));
    assert!(warned(&warnings, "value-out-of-range"));
    for (light, node) in [
        (json!({"type": "laser"}), json!({})),
        (json!({"type": "point", "intensity": -1.0}), json!({})),
        (json!({"type": "directional"}), json!({"scale": [0, 0, 0]})),
    ] {
        let (scene, warnings) = with_light(light, node).load();
        assert!(scene.lights.is_empty() && warned(&warnings, "ignored-light"));
    }
}

#[test]
fn cameras_stay_orthonormal_whatever_their_node_does() {
    let mut document = Document::triangle();
    document.push("cameras", json!({"type": "perspective", "perspective": {"yfov": 0.7, "aspectRatio": 1.5, "znear": 0.1}}));
    document.push("cameras", json!({"type": "orthographic", "orthographic": {"xmag": 4, "ymag": 2, "zfar": 9, "znear": 0}}));
    document.push("cameras", json!({"type": "perspective", "perspective": {"yfov": 4.0, "znear": 0.1}}));
    document.push("nodes", json!({"camera": 0, "scale": [-2.0, 3.0, 0.5], "translation": [1, 2, 3]}));
    document.push("nodes", json!({"camera": 1, "rotation": [0.0, FRAC_1_SQRT_2, 0.0, FRAC_1_SQRT_2], "name": "side"}));
    document.push("nodes", json!({"camera": 1, "scale": [0, 0, 0]}));
    document.push("nodes", json!({"camera": 2}));
    let (scene, warnings) = document.load();
    assert_eq!(scene.cameras.len(), 3);
    assert!(warned(&warnings, "ignored-camera"));
    for camera in &scene.cameras {
        let gram = camera.basis.transpose() * camera.basis;
        assert!((gram - DMat3::IDENTITY).to_cols_array().iter().all(|v| v.abs() < 1e-12));
        assert!(camera.basis.determinant() > 0.0);
    }
    let [first, second, _] = scene.cameras.as_slice() else { unreachable!() };
    assert!(
        close(first.forward(), -DVec3::Z)
            && close(first.basis.y_axis, DVec3::Y)
            && close(first.position, DVec3::new(1.0, 2.0, 3.0))
    );
    assert_eq!((first.projection, first.aspect), (Projection::Perspective { fov_y: 0.7 }, Some(1.5)));
    // A quarter turn about y takes −z to −x.
    assert!(close(second.forward(), -DVec3::X) && second.name == "side");
    assert_eq!((second.projection, second.aspect), (Projection::Orthographic { height: 4.0 }, Some(2.0)));
    assert!(matches!(first.projection, Projection::Perspective { fov_y } if fov_y < FRAC_PI_2));
}

#[test]
fn views_without_bytes_say_what_is_missing() {
    let mut document = Document::triangle();
    document.json["buffers"] = json!([]);
    document.json["bufferViews"][0]["buffer"] = 1.into();
    assert_eq!(document.refusal().0, "/bufferViews/0/buffer");
    let accessor = json!({"bufferView": 0, "componentType": F32, "type": "VEC3", "count": 3});
    let json = json!({
        "asset": {"version": "2.0"}, "accessors": [accessor], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "buffers": [{"byteLength": 36}], "bufferViews": [{"buffer": 0, "byteLength": 36}],
    });
    let e = load_bytes("gltf", json.to_string().as_bytes()).expect_err("no bytes");
    assert_eq!(e.location().and_then(|l| l.pointer.as_deref()), Some("/buffers/0"));
    let mut packed = json;
    packed["bufferViews"][0]["extensions"] = json!({"EXT_meshopt_compression": {"buffer": 0}});
    assert!(is_unsupported(&load_bytes("gltf", packed.to_string().as_bytes()), "EXT_meshopt_compression"));
}
