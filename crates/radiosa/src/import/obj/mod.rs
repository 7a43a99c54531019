//! Wavefront OBJ and its material library, MTL.
//!
//! Our own parser, because light wants more than triangles: polygons stay polygons ([`crate::scene::Polygons`]), smoothing
//! groups become normals, concave and keyholed faces are cut as they are meant.
//!
//! | file | does |
//! |---|---|
//! | `text` | lines, words, numbers, places for messages |
//! | `document` | statements into columns, indices resolved |
//! | `polygon` | faces into triangles |
//! | `mesh` | columns into one mesh for each object or group; smoothing groups |
//! | `mtl`, `material`, `picture` | material libraries, what they mean, their pictures |
//!
//! What is wrong in one place spoils that place only: a face with a vertex that is no number is left out with a warning.
//! A face that refers to a vertex that does not exist means a damaged file and is an error. Curves, surfaces, lines and points are not read.

mod document;
mod material;
mod mesh;
mod mtl;
mod picture;
mod polygon;
mod text;

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use self::document::{Document, Group};
use super::{ImportError, Resolver, Warnings};
use crate::math::DAffine3;
use crate::scene::{Geometry, Instance, Material, MaterialId, MeshId, Node, NodeId, Quantity, Scene, Source, SourceContent};

/// Bytes of memory that a byte of OBJ text turns into: about ten in ordinary files, more where faces are many and lines short.
const OBJ_GROWTH: u64 = 16;

/// The same of MTL text, in which a material may take ten bytes.
const MTL_GROWTH: u64 = 128;

/// Names after `mtllib` that are looked for, over the whole file: each may cost a look at the disk.
const MAX_LIBRARY_NAMES: usize = 1000;

/// Reads a document and the material libraries and pictures it names.
///
/// # Errors
/// When a face refers to a vertex that does not exist, holds something that is no index, or the text is not OBJ at all.
pub(super) fn read(bytes: &[u8], resolver: &Resolver, warnings: &mut Warnings) -> Result<Scene, ImportError> {
    let path = resolver.path();
    let text = text::decode(bytes);
    if u32::try_from(text.len()).is_err() {
        let help = "split it, or convert it to glTF".into();
        return Err(ImportError::Unsupported { path: path.into(), feature: "more than 4 GiB of OBJ text".into(), help });
    }
    check_memory(path, text.len(), OBJ_GROWTH, resolver)?;
    let mut document = document::parse(&text, path, warnings)?;
    let mut scene = Scene { quantity: Quantity::Radiometric, ..Scene::default() };
    scene.sources.push(Source { path: path.into(), content: SourceContent::Other });
    let materials = read_materials(&document, resolver, &mut scene, warnings);
    let meshes = mesh::meshes(&document, &materials, &text, path, warnings);
    if meshes.is_empty() {
        warnings.add("no-faces", path, "the file has no face with area: there is nothing to see");
    }
    let mut tree = Tree { groups: std::mem::take(&mut document.groups), nodes: Vec::new(), objects: HashMap::new() };
    for (group, mesh) in meshes {
        scene.instances.push(Instance {
            name: mesh.name.clone(),
            geometry: Geometry::Mesh(MeshId(scene.meshes.len() as u32)),
            transform: DAffine3::IDENTITY,
            material: None,
            node: tree.node(group),
        });
        scene.meshes.push(mesh);
    }
    scene.nodes = tree.nodes;
    Ok(scene)
}

/// Refuses a text whose content would not fit.
fn check_memory(path: &Path, len: usize, growth: u64, resolver: &Resolver) -> Result<(), ImportError> {
    let (needed, allowed) = (len as u64 * growth, resolver.options().max_memory);
    if needed > allowed {
        return Err(ImportError::TooLarge { what: format!("the content of {}", path.display()), needed, allowed });
    }
    Ok(())
}

/// Objects, and groups below them.
struct Tree {
    groups: Vec<Group>,
    nodes: Vec<Node>,
    objects: HashMap<String, NodeId>,
}

impl Tree {
    fn node(&mut self, group: u32) -> Option<NodeId> {
        let Group { object, group: name } = self.groups[group as usize].clone();
        let object = object.map(|object| {
            let next = NodeId(self.nodes.len() as u32);
            let id = *self.objects.entry(object.clone()).or_insert(next);
            if id == next {
                self.nodes.push(Node { name: object, parent: None, source: Some((0, id.0)) });
            }
            id
        });
        let Some(name) = name else { return object };
        let id = NodeId(self.nodes.len() as u32);
        self.nodes.push(Node { name, parent: object, source: Some((0, id.0)) });
        Some(id)
    }
}

/// Fills the scene's materials, textures and images; returns the material of each name in the document.
fn read_materials(document: &Document, resolver: &Resolver, scene: &mut Scene, warnings: &mut Warnings) -> Vec<MaterialId> {
    let main = resolver.path();
    let mut pictures = picture::Pictures::new(resolver);
    let mut by_name: HashMap<String, MaterialId> = HashMap::new();
    for (path, folder) in find_libraries(document, resolver, warnings) {
        let read = resolver.read_found(&path);
        let bytes = match read.and_then(|bytes| check_memory(&path, bytes.len(), MTL_GROWTH, resolver).map(|()| bytes)) {
            Ok(bytes) => bytes,
            Err(error) => {
                warnings.add("material-library-unreadable", main, error.to_string());
                continue;
            }
        };
        for definition in mtl::parse(&text::decode(&bytes), &path, warnings) {
            let id = MaterialId(scene.materials.len() as u32);
            if *by_name.entry(definition.name.clone()).or_insert(id) != id {
                let message = format!(
                    "the material {:?} is defined again; the first definition is used",
                    text::shown(definition.name.as_bytes())
                );
                warnings.add("duplicate-material", &path, message);
                continue;
            }
            scene.materials.push(material::convert(&definition, &path, &folder, &mut pictures, warnings));
        }
    }
    pictures.report(warnings);
    scene.images = pictures.images;
    scene.textures = pictures.textures;

    let of_name = |name: &String| {
        *by_name.entry(name.clone()).or_insert_with(|| {
            let message =
                format!("the material {:?} is not defined: grey of reflectance 0.8 is used", text::shown(name.as_bytes()));
            warnings.add("unknown-material", main, message);
            scene.materials.push(Material { name: name.clone(), ..Material::default() });
            MaterialId(scene.materials.len() as u32 - 1)
        })
    };
    document.materials.iter().map(of_name).collect()
}

/// The libraries a document names that exist, each once: (path, its folder relative to the document's).
fn find_libraries(document: &Document, resolver: &Resolver, warnings: &mut Warnings) -> Vec<(PathBuf, String)> {
    let main = resolver.path();
    let mut search = Search { resolver, found: Vec::new(), seen: HashSet::new(), n_names: 0 };
    let mut missing = Vec::new();
    for statement in document.libraries.iter().filter(|s| !s.is_empty()) {
        // One name with blanks, or several names, each of which may have blanks: then they end in ".mtl".
        if search.accept(statement).is_ok() {
            continue;
        }
        let mut refuse = |name: &str, reason| missing.push((text::shown(name.as_bytes()), reason));
        let mut name = String::new();
        for word in statement.split_ascii_whitespace() {
            name.push_str(if name.is_empty() { "" } else { " " });
            name.push_str(word);
            if word.to_ascii_lowercase().ends_with(".mtl") {
                // Some write a backslash before each blank.
                let _ = search.accept(&name).or_else(|_| search.accept(&name.replace("\\ ", " "))).map_err(|e| refuse(&name, e));
                name.clear();
            }
        }
        for word in name.split_ascii_whitespace() {
            let _ = search.accept(word).map_err(|reason| refuse(word, reason));
        }
        if search.n_names > MAX_LIBRARY_NAMES {
            break;
        }
    }
    // A library that was renamed with its document is found by its name.
    let twin = main.with_extension("mtl").file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    for (name, reason) in missing {
        let why = match reason {
            ImportError::Unsupported { .. } => "lies outside the scene's folder: allow it with --allow-outside DIR",
            _ => "is missing",
        };
        let n = search.found.len();
        let instead = if search.accept(&twin).is_ok() && search.found.len() > n {
            format!("; {twin} is used instead")
        } else {
            String::new()
        };
        warnings.add("material-library-missing", main, format!("the material library {name:?} {why}{instead}"));
    }
    search.found
}

/// Looks for material libraries.
struct Search<'a> {
    resolver: &'a Resolver,
    found: Vec<(PathBuf, String)>,
    seen: HashSet<PathBuf>,
    n_names: usize,
}

impl Search<'_> {
    /// Takes the file of that name, unless it was taken before.
    fn accept(&mut self, name: &str) -> Result<(), ImportError> {
        self.n_names += 1;
        if self.n_names > MAX_LIBRARY_NAMES || name.len() > 4096 {
            return Err(ImportError::Io { path: name.into(), source: std::io::ErrorKind::NotFound.into() });
        }
        let (path, moved) = picture::find(self.resolver, name, "")?;
        let name = name.replace('\\', "/");
        let folder = if moved { "" } else { name.rsplit_once('/').map_or("", |(folder, _)| folder) };
        if self.seen.insert(path.clone()) {
            self.found.push((path, folder.to_owned()));
        }
        Ok(())
    }
}
