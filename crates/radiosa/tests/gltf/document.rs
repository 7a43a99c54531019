//! Small documents, written down and read.

use base64::Engine;
use radiosa::import::{ImportError, Options, Warning, load};
use radiosa::scene::Scene;
use serde_json::{Value, json};

use super::Loaded;

pub(super) const I8: u32 = 5120;
pub(super) const U8: u32 = 5121;
pub(super) const I16: u32 = 5122;
pub(super) const U16: u32 = 5123;
pub(super) const U32: u32 = 5125;
pub(super) const F32: u32 = 5126;

/// A document in the making: JSON and one buffer.
#[derive(Clone)]
pub(super) struct Document {
    pub(super) json: Value,
    pub(super) bytes: Vec<u8>,
}

impl Document {
    pub(super) fn new() -> Self {
        Self { json: json!({"asset": {"version": "2.0"}}), bytes: Vec::new() }
    }

    /// Appends to one of the top-level arrays; returns the index.
    pub(super) fn push(&mut self, table: &str, item: Value) -> usize {
        let table = &mut self.json[table];
        if table.is_null() {
            *table = json!([]);
        }
        let array = table.as_array_mut().expect("an array");
        array.push(item);
        array.len() - 1
    }

    pub(super) fn view(&mut self, bytes: &[u8]) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let offset = self.bytes.len();
        self.bytes.extend_from_slice(bytes);
        self.push("bufferViews", json!({"buffer": 0, "byteOffset": offset, "byteLength": bytes.len()}))
    }

    pub(super) fn accessor(&mut self, component: u32, kind: &str, count: usize, bytes: &[u8]) -> usize {
        let view = self.view(bytes);
        self.push("accessors", json!({"bufferView": view, "componentType": component, "type": kind, "count": count}))
    }

    pub(super) fn floats(&mut self, kind: &str, values: &[f32]) -> usize {
        let width = match kind {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(F32, kind, values.len() / width, &bytes)
    }

    /// A mesh of one primitive.
    pub(super) fn mesh(&mut self, primitive: Value) -> usize {
        self.push("meshes", json!({"primitives": [primitive]}))
    }

    /// A mesh of one primitive with these positions, and a node that places it.
    pub(super) fn triangles(&mut self, positions: &[f32]) -> &mut Self {
        let positions = self.floats("VEC3", positions);
        let mesh = self.mesh(json!({"attributes": {"POSITION": positions}}));
        self.push("nodes", json!({"mesh": mesh}));
        self
    }

    /// One triangle in the plane z = 0, facing +z.
    pub(super) fn triangle() -> Self {
        let mut document = Self::new();
        document.triangles(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        document
    }

    fn with_buffer(&self, uri: Option<String>) -> Value {
        let mut json = self.json.clone();
        if !self.bytes.is_empty() {
            json["buffers"] = json!([{"byteLength": self.bytes.len()}]);
            if let Some(uri) = uri {
                json["buffers"][0]["uri"] = uri.into();
            }
        }
        json
    }

    /// As `.gltf` with its buffer embedded.
    pub(super) fn text(&self) -> String {
        let data = base64::engine::general_purpose::STANDARD.encode(&self.bytes);
        self.with_buffer(Some(format!("data:application/octet-stream;base64,{data}"))).to_string()
    }

    /// As `.glb`.
    pub(super) fn glb(&self) -> Vec<u8> {
        glb(self.with_buffer(None).to_string().as_bytes(), Some(&self.bytes))
    }

    pub(super) fn try_load(&self) -> Loaded {
        load_bytes("gltf", self.text().as_bytes())
    }

    pub(super) fn load(&self) -> (Scene, Vec<Warning>) {
        self.try_load().unwrap_or_else(|e| panic!("{e} ({:?})", e.location()))
    }

    /// The pointer and the message of the error.
    pub(super) fn refusal(&self) -> (String, String) {
        match self.try_load() {
            Ok(_) => panic!("it loads"),
            Err(e) => (e.location().and_then(|l| l.pointer.clone()).unwrap_or_default(), e.to_string()),
        }
    }
}

/// A GLB container.
pub(super) fn glb(json: &[u8], binary: Option<&[u8]>) -> Vec<u8> {
    let mut json = json.to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut chunks = Vec::new();
    let mut add = |kind: &[u8; 4], bytes: &[u8]| {
        chunks.extend_from_slice(&(bytes.len() as u32).to_le_bytes());
        chunks.extend_from_slice(kind);
        chunks.extend_from_slice(bytes);
    };
    add(b"JSON", &json);
    if let Some(binary) = binary {
        let mut binary = binary.to_vec();
        binary.resize(binary.len().next_multiple_of(4), 0);
        add(b"BIN\0", &binary);
    }
    let mut out = b"glTF".to_vec();
    out.extend_from_slice(&2u32.to_le_bytes());
    out.extend_from_slice(&(chunks.len() as u32 + 12).to_le_bytes());
    out.extend_from_slice(&chunks);
    out
}

pub(super) fn load_bytes(ending: &str, bytes: &[u8]) -> Loaded {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join(format!("document.{ending}"));
    std::fs::write(&path, bytes).expect("it can be written");
    load(&path, &Options { max_memory: 512 << 20, ..Options::default() })
}

/// Whether an error is a refusal for an unsupported feature of this name.
pub(super) fn is_unsupported(result: &Loaded, name: &str) -> bool {
    matches!(result, Err(ImportError::Unsupported { feature, .. }) if feature.contains(name))
}
