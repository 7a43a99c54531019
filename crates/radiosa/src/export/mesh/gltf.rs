//! glTF 2.0: one mesh and node a surface, one unlit material, one buffer.

use std::io::{self, Write};

use base64::Engine;
use serde_json::{Value, json};

use super::LitMesh;

const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const VERTICES: u32 = 34962;
const INDICES: u32 = 34963;

/// The document and its buffer, in pieces that follow each other.
#[derive(Default)]
struct Document {
    views: Vec<Value>,
    accessors: Vec<Value>,
    bytes: Vec<u8>,
}

impl Document {
    /// Adds an array as a view and an accessor; the accessor's index.
    fn add(&mut self, bytes: &[u8], target: u32, accessor: Value) -> usize {
        self.views.push(json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len(), "target": target }));
        let mut accessor = accessor;
        accessor["bufferView"] = (self.views.len() - 1).into();
        self.accessors.push(accessor);
        self.bytes.extend_from_slice(bytes);
        self.accessors.len() - 1
    }

    fn vectors(&mut self, values: &[[f32; 3]], with_bounds: bool) -> usize {
        let mut accessor = json!({ "componentType": FLOAT, "count": values.len(), "type": "VEC3" });
        if with_bounds {
            let bound =
                |f: fn(f32, f32) -> f32, from: f32| [0, 1, 2].map(|c| f64::from(values.iter().map(|v| v[c]).fold(from, f)));
            accessor["min"] = json!(bound(f32::min, f32::INFINITY));
            accessor["max"] = json!(bound(f32::max, f32::NEG_INFINITY));
        }
        self.add(bytemuck::cast_slice(values), VERTICES, accessor)
    }
}

/// Everything but where the buffer is.
fn document(mesh: &LitMesh) -> (Value, Vec<u8>) {
    let mut doc = Document::default();
    let (mut meshes, mut nodes) = (Vec::new(), Vec::new());
    for surface in &mesh.surfaces {
        let column = |f: &dyn Fn(&super::Vertex) -> [f32; 3]| surface.vertices.iter().map(f).collect::<Vec<_>>();
        let position = doc.vectors(&column(&|v| v.position.as_vec3().to_array()), true);
        let normal = doc.vectors(&column(&|v| v.normal.to_array()), false);
        let color = doc.vectors(&column(&|v| mesh.color(v).to_array().map(|c| c.clamp(0.0, 1.0))), false);
        let irradiance = doc.vectors(&column(&|v| v.irradiance.to_array()), false);
        let radiosity = doc.vectors(&column(&|v| v.radiosity.to_array()), false);
        let indices: &[u32] = surface.triangles.as_flattened();
        let accessor = json!({ "componentType": UNSIGNED_INT, "count": indices.len(), "type": "SCALAR" });
        let indices = doc.add(bytemuck::cast_slice(indices), INDICES, accessor);
        let attributes = json!({
            "POSITION": position, "NORMAL": normal, "COLOR_0": color, "_IRRADIANCE": irradiance, "_RADIOSITY": radiosity,
        });
        meshes.push(
            json!({ "name": surface.name, "primitives": [{ "attributes": attributes, "indices": indices, "material": 0 }] }),
        );
        nodes.push(json!({ "name": surface.name, "mesh": meshes.len() - 1 }));
    }
    let mut json = json!({
        "asset": { "version": "2.0", "generator": concat!("Radiosa ", env!("CARGO_PKG_VERSION")) },
        "extensionsUsed": ["KHR_materials_unlit"],
        "scene": 0,
        "scenes": [{ "name": mesh.world.scene().name, "extras": { "exposure": mesh.exposure } }],
        "materials": [{
            "name": "light at vertices",
            "pbrMetallicRoughness": { "baseColorFactor": [1.0, 1.0, 1.0, 1.0], "metallicFactor": 0.0, "roughnessFactor": 1.0 },
            "extensions": { "KHR_materials_unlit": {} },
        }],
    });
    // Empty arrays are not allowed.
    if !nodes.is_empty() {
        json["scenes"][0]["nodes"] = (0..nodes.len()).collect();
        json["nodes"] = nodes.into();
        json["meshes"] = meshes.into();
        json["accessors"] = doc.accessors.into();
        json["bufferViews"] = doc.views.into();
        json["buffers"] = json!([{ "byteLength": doc.bytes.len() }]);
    }
    (json, doc.bytes)
}

pub(super) fn write_gltf(mesh: &LitMesh, out: &mut impl Write) -> io::Result<()> {
    let (mut json, bytes) = document(mesh);
    if !bytes.is_empty() {
        let encoded = base64::engine::general_purpose::STANDARD.encode(&bytes);
        json["buffers"][0]["uri"] = format!("data:application/octet-stream;base64,{encoded}").into();
    }
    serde_json::to_writer(&mut *out, &json)?;
    out.write_all(b"\n")
}

pub(super) fn write_glb(mesh: &LitMesh, out: &mut impl Write) -> io::Result<()> {
    let (json, bytes) = document(mesh);
    let mut json = json.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    // Every array is of 32-bit numbers, so the buffer needs no padding.
    let chunk = |n: usize| if n > 0 { 8 + n } else { 0 };
    let length = 12 + chunk(json.len()) + chunk(bytes.len());
    let length =
        u32::try_from(length).map_err(|_| io::Error::other("more than 4 GiB do not fit into a .glb: write .gltf or .ply"))?;
    out.write_all(b"glTF")?;
    for number in [2, length, json.len() as u32] {
        out.write_all(&number.to_le_bytes())?;
    }
    out.write_all(b"JSON")?;
    out.write_all(&json)?;
    if !bytes.is_empty() {
        out.write_all(&(bytes.len() as u32).to_le_bytes())?;
        out.write_all(b"BIN\0")?;
        out.write_all(&bytes)?;
    }
    Ok(())
}
