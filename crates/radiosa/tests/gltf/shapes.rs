//! Accessors, primitives and deformation.

use radiosa::math::{DVec3, Vec3, Vec4};
use radiosa::scene::{Mesh, MeshSource};
use serde_json::{Value, json};

use super::document::{Document, F32, I8, I16, U8, U16, U32, is_unsupported};
use super::warned;

const QUAD: [f32; 12] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0];

fn bytes<T: bytemuck::NoUninit>(values: &[T]) -> &[u8] {
    bytemuck::cast_slice(values)
}

/// The only mesh of a document with one primitive.
fn mesh(document: &Document) -> Mesh {
    let (scene, _) = document.load();
    assert_eq!(scene.meshes.len(), 1);
    scene.meshes[0].clone()
}

/// A document whose one primitive has these positions and whatever `change` adds.
fn primitive(positions: &[f32], change: impl FnOnce(&mut Document, &mut Value)) -> Document {
    let mut document = Document::new();
    let positions = document.floats("VEC3", positions);
    let mut primitive = json!({"attributes": {"POSITION": positions}});
    change(&mut document, &mut primitive);
    let mesh = document.mesh(primitive);
    document.push("nodes", json!({"mesh": mesh}));
    document
}

#[test]
fn every_index_type_reads_alike() {
    let expected = vec![[0, 1, 2], [0, 2, 3]];
    let kinds: [(u32, &[u8]); 3] =
        [(U8, bytes(&[0u8, 1, 2, 0, 2, 3])), (U16, bytes(&[0u16, 1, 2, 0, 2, 3])), (U32, bytes(&[0u32, 1, 2, 0, 2, 3]))];
    for (kind, data) in kinds {
        let document = primitive(&QUAD, |d, p| p["indices"] = d.accessor(kind, "SCALAR", 6, data).into());
        assert_eq!(mesh(&document).triangles, expected, "component type {kind}");
    }
    let signed = primitive(&QUAD, |d, p| p["indices"] = d.accessor(I16, "SCALAR", 6, bytes(&[0i16, 1, 2, 0, 2, 3])).into());
    assert_eq!(signed.refusal().0, "/accessors/1");
    assert_eq!(mesh(&Document::triangle()).triangles, [[0, 1, 2]]);
}

#[test]
fn quantised_positions_mean_what_the_specification_says() {
    let third = |v: i32, max: i32| f64::from(v) / f64::from(max);
    // (component type, bytes, normalised, the first vertex)
    let cases: [(u32, &[u8], bool, [f64; 3]); 8] = [
        (I8, bytes(&[-128i8, 127, 64, 1, 0, 0, 0, 1, 0]), true, [-1.0, 1.0, third(64, 127)]),
        (I8, bytes(&[-128i8, 127, 64, 1, 0, 0, 0, 1, 0]), false, [-128.0, 127.0, 64.0]),
        (U8, bytes(&[255u8, 0, 51, 1, 0, 0, 0, 1, 0]), true, [1.0, 0.0, 0.2]),
        (U8, bytes(&[255u8, 0, 51, 1, 0, 0, 0, 1, 0]), false, [255.0, 0.0, 51.0]),
        (I16, bytes(&[-32768i16, 32767, 1, 1, 0, 0, 0, 1, 0]), true, [-1.0, 1.0, third(1, 32767)]),
        (I16, bytes(&[-32768i16, 32767, 1, 1, 0, 0, 0, 1, 0]), false, [-32768.0, 32767.0, 1.0]),
        (U16, bytes(&[65535u16, 0, 13107, 1, 0, 0, 0, 1, 0]), true, [1.0, 0.0, 0.2]),
        (U16, bytes(&[65535u16, 0, 13107, 1, 0, 0, 0, 1, 0]), false, [65535.0, 0.0, 13107.0]),
    ];
    for (kind, data, normalized, expected) in cases {
        let mut document = Document::new();
        document.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
        let positions = document.accessor(kind, "VEC3", 3, data);
        document.json["accessors"][positions]["normalized"] = normalized.into();
        let number = document.mesh(json!({"attributes": {"POSITION": positions}}));
        document.push("nodes", json!({"mesh": number}));
        let found = mesh(&document).positions[0];
        assert!((found - DVec3::from(expected)).length() < 1e-15, "{kind} normalised {normalized}: {found}");
    }
}

#[test]
fn interleaved_columns_are_told_apart() {
    let mut data: Vec<f32> = Vec::new();
    for corner in QUAD.chunks(3) {
        data.extend([7.0]);
        data.extend(corner);
        data.extend([0.0, 0.0, 2.0]);
    }
    let mut document = Document::new();
    let view = document.view(bytes(&data));
    document.json["bufferViews"][view]["byteStride"] = 28.into();
    let positions = document
        .push("accessors", json!({"bufferView": view, "byteOffset": 4, "componentType": F32, "type": "VEC3", "count": 4}));
    let normals = document
        .push("accessors", json!({"bufferView": view, "byteOffset": 16, "componentType": F32, "type": "VEC3", "count": 4}));
    let number = document.mesh(json!({"attributes": {"POSITION": positions, "NORMAL": normals}, "mode": 6}));
    document.push("nodes", json!({"mesh": number}));
    let found = mesh(&document);
    assert_eq!(found.positions[2], DVec3::new(1.0, 1.0, 0.0));
    assert_eq!(found.normals.expect("it has normals"), [Vec3::Z; 4], "normals come to unit length");

    // One element further, the last one leaves the view.
    document.json["accessors"][normals]["byteOffset"] = 20.into();
    assert_eq!(document.refusal().0, "/accessors/1");
}

#[test]
fn sparse_values_replace_the_base_or_zeros() {
    for base in [true, false] {
        let mut document = Document::triangle();
        let indices = document.view(bytes(&[1u16]));
        let values = document.view(bytes(&[5.0f32, 6.0, 7.0]));
        let accessor = &mut document.json["accessors"][0];
        if !base {
            accessor.as_object_mut().expect("an object").remove("bufferView");
        }
        accessor["sparse"] = json!({
            "count": 1, "indices": {"bufferView": indices, "componentType": U16}, "values": {"bufferView": values},
        });
        let expected = if base { DVec3::Y } else { DVec3::ZERO };
        assert_eq!(mesh(&document).positions, [DVec3::ZERO, DVec3::new(5.0, 6.0, 7.0), expected]);
        document.json["accessors"][0]["count"] = 1.into();
        assert_eq!(document.refusal().0, "/accessors/0/sparse/indices");
    }
}

#[test]
fn strips_and_fans_keep_their_front() {
    let strip = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 2.0, 0.0];
    let fan = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0, -1.0, 1.0, 0.0];
    for (mode, positions) in [(5, &strip), (6, &fan)] {
        let found = mesh(&primitive(positions, |_, p| p["mode"] = mode.into()));
        assert_eq!(found.triangles.len(), 3);
        for triangle in found.triangles {
            let [a, b, c] = triangle.map(|i| found.positions[i as usize]);
            assert!((b - a).cross(c - a).z > 0.0, "mode {mode}: {triangle:?} turned");
        }
    }
}

#[test]
fn points_and_lines_are_left_out_and_said() {
    for mode in 0..4 {
        let (scene, warnings) = primitive(&QUAD, |_, p| p["mode"] = mode.into()).load();
        assert!(scene.instances.is_empty() && warned(&warnings, "ignored-points-and-lines"));
    }
    assert_eq!(primitive(&QUAD, |_, p| p["mode"] = 7.into()).refusal().0, "/meshes/0/primitives/0");
}

#[test]
fn faces_without_normals_are_flat_and_columns_arrive_in_order() {
    let bare = mesh(&Document::triangle());
    assert!(bare.normals.is_none() && bare.tangents.is_none() && bare.uvs.is_empty() && bare.colors.is_none());
    assert_eq!(bare.source, Some(MeshSource { file: 0, mesh: 0, primitive: 0 }));

    let document = primitive(&QUAD, |d, p| {
        p["attributes"]["NORMAL"] = d.floats("VEC3", &[0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 3.0, 0.0, f32::NAN, 0.0, 0.0]).into();
        let tangents = [1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -1.0, 2.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0, 0.5];
        p["attributes"]["TANGENT"] = d.floats("VEC4", &tangents).into();
        p["attributes"]["TEXCOORD_0"] = d.floats("VEC2", &[0.0, 0.0, 1.0, 0.0, 1.0, 1.0, f32::INFINITY, 1.0]).into();
        let uv = d.accessor(U8, "VEC2", 4, &[0, 0, 255, 0, 255, 255, 0, 255]);
        d.json["accessors"][uv]["normalized"] = true.into();
        p["attributes"]["TEXCOORD_2"] = uv.into();
        let colors = d.accessor(U16, "VEC3", 4, bytes(&[65535u16, 0, 0, 0, 65535, 0, 0, 0, 65535, 0, 0, 0]));
        d.json["accessors"][colors]["normalized"] = true.into();
        p["attributes"]["COLOR_0"] = colors.into();
    });
    let found = mesh(&document);
    assert_eq!(found.normals, Some(vec![Vec3::Z, Vec3::ZERO, Vec3::Y, Vec3::ZERO]));
    let tangents = found.tangents.expect("it has tangents");
    assert!(tangents.iter().all(|t| (t.truncate().length() - 1.0).abs() < 1e-6 && t.w.abs() == 1.0), "{tangents:?}");
    assert_eq!((tangents[0], tangents[2]), (Vec4::new(1.0, 0.0, 0.0, 1.0), Vec4::new(1.0, 0.0, 0.0, -1.0)));
    assert_eq!(found.uvs.len(), 3, "the missing set keeps its number");
    assert!(found.uvs.iter().flatten().all(|uv| uv.is_finite()));
    assert_eq!(found.uvs[2][2].to_array(), [1.0, 1.0]);
    assert_eq!(found.colors.expect("it has colours")[1], Vec4::new(0.0, 1.0, 0.0, 1.0));
}

#[test]
fn broken_vertices_take_only_their_own_triangles() {
    let mut positions = QUAD.to_vec();
    positions[9] = f32::NAN;
    let document = primitive(&positions, |d, p| p["indices"] = d.accessor(U8, "SCALAR", 6, &[0, 1, 2, 0, 2, 3]).into());
    let (scene, warnings) = document.load();
    assert_eq!(scene.meshes[0].triangles, [[0, 1, 2]]);
    assert!(warned(&warnings, "broken-vertex"));
}

#[test]
fn what_points_outside_is_refused_by_its_pointer() {
    let beyond = primitive(&QUAD, |d, p| p["indices"] = d.accessor(U8, "SCALAR", 3, &[0, 1, 4]).into());
    let (pointer, message) = beyond.refusal();
    assert_eq!(pointer, "/meshes/0/primitives/0/indices");
    assert!(message.contains('4'), "{message}");

    let missing = primitive(&QUAD, |_, p| p["attributes"]["NORMAL"] = 9.into());
    assert_eq!(missing.refusal().0, "/meshes/0/primitives/0/attributes/NORMAL");
    let unequal = primitive(&QUAD, |d, p| p["attributes"]["NORMAL"] = d.floats("VEC3", &[0.0; 9]).into());
    assert_eq!(unequal.refusal().0, "/meshes/0/primitives/0/attributes/NORMAL");

    for (key, value) in [("count", 4u64), ("count", u64::MAX), ("byteOffset", 4), ("byteOffset", u64::MAX)] {
        let mut document = Document::triangle();
        document.json["accessors"][0][key] = value.into();
        assert_eq!(document.refusal().0.split("/count").next(), Some("/accessors/0"), "{key} {value}");
    }
    for (key, value) in [("byteLength", 1u64 << 40), ("byteOffset", u64::MAX)] {
        let mut document = Document::triangle();
        document.json["bufferViews"][0][key] = value.into();
        assert!(document.refusal().0.starts_with("/bufferViews/0"), "{key} {value}");
    }
}

#[test]
fn zeros_without_bytes_are_bounded() {
    let mut document = Document::triangle();
    document.json["accessors"][0].as_object_mut().expect("an object").remove("bufferView");
    document.json["accessors"][0]["count"] = 3000.into();
    assert_eq!(mesh(&document).triangles.len(), 1000);
    document.json["accessors"][0]["count"] = 4_000_000_000u64.into();
    assert_eq!(document.refusal().0, "/accessors/0/count");
}

#[test]
fn compressed_primitives_without_a_fallback_name_the_extension() {
    let mut document = Document::triangle();
    document.json["meshes"][0]["primitives"][0]["extensions"] = json!({"KHR_draco_mesh_compression": {"bufferView": 0}});
    document.json["extensionsUsed"] = json!(["KHR_draco_mesh_compression"]);
    let (scene, warnings) = document.load();
    assert!(scene.n_primitives() == 1 && warned(&warnings, "ignored-extension"), "the fallback is used");
    document.json["accessors"][0].as_object_mut().expect("an object").remove("bufferView");
    assert!(is_unsupported(&document.try_load(), "KHR_draco_mesh_compression"));
}

#[test]
fn encoded_polygons_are_found() {
    // A quad, a pentagon that starts elsewhere, a triangle.
    let indices = [0u8, 1, 2, 0, 2, 3, 1, 2, 3, 1, 3, 4, 1, 4, 5, 0, 4, 5];
    let document = primitive(&[0.5; 18], |d, p| {
        p["indices"] = d.accessor(U8, "SCALAR", 18, &indices).into();
        p["extensions"] = json!({"FB_ngon_encoding": {}});
    });
    let polygons = mesh(&document).polygons.expect("it has polygons");
    assert_eq!(polygons.offsets, [0, 4, 9, 12]);
    assert_eq!(polygons.vertices, [0, 1, 2, 3, 1, 2, 3, 4, 5, 0, 4, 5]);
    assert_eq!(polygons.of_triangle, [0, 0, 1, 1, 1, 2]);
}

#[test]
fn morph_targets_apply_at_their_default_weights() {
    let morphing = |mesh_weights: Value, node_weights: Value| {
        let mut document = primitive(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0], |d, p| {
            let up = d.floats("VEC3", &[0.0, 0.0, 2.0, 0.0, 0.0, 2.0, 0.0, 0.0, 2.0]);
            let right = d.floats("VEC3", &[4.0, 0.0, 0.0, 4.0, 0.0, 0.0, 4.0, 0.0, 0.0]);
            p["targets"] = json!([{"POSITION": up}, {"POSITION": right}]);
        });
        for (table, weights) in [("meshes", mesh_weights), ("nodes", node_weights)] {
            if !weights.is_null() {
                document.json[table][0]["weights"] = weights;
            }
        }
        document
    };
    let first = |document: Document| mesh(&document).positions[0];
    assert_eq!(first(morphing(Value::Null, Value::Null)), DVec3::ZERO);
    assert_eq!(first(morphing(json!([0.5, 0.25]), Value::Null)), DVec3::new(1.0, 0.0, 1.0));
    assert_eq!(first(morphing(json!([0.5, 0.25]), json!([1.0, 0.0]))), DVec3::new(0.0, 0.0, 2.0));

    // Two nodes, one with weights of its own: two shapes of the same source primitive.
    let mut two = morphing(json!([1.0, 0.0]), Value::Null);
    two.push("nodes", json!({"mesh": 0, "weights": [0.0, 1.0]}));
    two.push("nodes", json!({"mesh": 0}));
    let (scene, _) = two.load();
    assert_eq!((scene.meshes.len(), scene.instances.len()), (2, 3));
    assert_eq!(scene.instances[0].geometry, scene.instances[2].geometry);
    assert_eq!(scene.meshes[0].source, scene.meshes[1].source);
}

#[test]
fn skins_stand_as_their_joints_do() {
    let mut document = primitive(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0], |d, p| {
        p["attributes"]["JOINTS_0"] = d.accessor(U8, "VEC4", 3, &[0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0]).into();
        p["attributes"]["WEIGHTS_0"] = d.floats("VEC4", &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.5, 0.5, 0.0, 0.0]).into();
        p["attributes"]["NORMAL"] = d.floats("VEC3", &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]).into();
    });
    // The node's own translation must not count; the joints hang below a node that is lifted by 10.
    document.json["nodes"][0]["skin"] = 0.into();
    document.json["nodes"][0]["translation"] = json!([100.0, 0.0, 0.0]);
    document.push("nodes", json!({"translation": [0.0, 10.0, 0.0], "children": [2, 3]}));
    document.push("nodes", json!({}));
    // A quarter turn about y: x to −z, z to x.
    let h = std::f64::consts::FRAC_1_SQRT_2;
    document.push("nodes", json!({"rotation": [0.0, h, 0.0, h]}));
    let (mut a, mut b) = ([0.0f32; 16], [0.0f32; 16]);
    for i in 0..4 {
        (a[5 * i], b[5 * i]) = (1.0, 1.0);
    }
    b[12] = -1.0;
    b[13] = 1.0;
    let inverse = document.floats("MAT4", &[a, b].concat());
    document.push("skins", json!({"joints": [2, 3], "inverseBindMatrices": inverse}));
    let (scene, _) = document.load();
    let found = &scene.meshes[0];
    assert_eq!(scene.instances[0].transform, radiosa::math::DAffine3::IDENTITY);
    let expected = [
        DVec3::new(0.0, 10.0, 0.0),
        // (1,0,0) − (1,−1,0) = (0,1,0), turned: the same, lifted.
        DVec3::new(0.0, 11.0, 0.0),
        // Half of (0,11,0) and half of ((0,1,0) + (−1,1,0) turned = (0,2,1), lifted).
        DVec3::new(0.0, 11.5, 0.5),
    ];
    for (found, expected) in found.positions.iter().zip(expected) {
        assert!((*found - expected).length() < 1e-6, "{found} instead of {expected}");
    }
    assert!((found.normals.as_ref().expect("it has normals")[1] - Vec3::X).length() < 1e-6);

    document.json["skins"][0]["joints"] = json!([2]);
    assert_eq!(document.refusal().0, "/meshes/0/primitives/0/attributes/JOINTS_0");
}
