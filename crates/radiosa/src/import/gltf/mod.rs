//! glTF 2.0 and GLB.
//!
//! The document is read through `serde_json` values and an own cursor ([`json::Item`]) rather than the `gltf` crate: that crate panics
//! on malformed files, refuses files that require `KHR_mesh_quantization`, and its schema types (`gltf-json`) refuse a whole file for a
//! wrong value in a part that is never looked at, without saying where. Here only what is used is checked, and every error carries a
//! JSON pointer. Nothing is recursive, nothing is indexed unchecked, and nothing is allocated before the bytes it is decoded from (or a
//! fixed limit, and [`super::Options::max_memory`]) are known to suffice.
//!
//! A document becomes: one [`crate::scene::Mesh`] for each primitive that is placed, shared by every node that places it; one instance for each
//! (node, primitive); materials and nodes in the order of the document, so that their indices are the document's own; cameras and
//! lights in the order in which the default scene's nodes are met. Light is photometric: candela, lux and cd/m², as the extensions define.

mod accessor;
mod budget;
mod buffer;
mod camera;
mod container;
mod deform;
mod extension;
mod instancing;
mod json;
mod light;
mod material;
mod mesh;
mod ngon;
mod node;
mod tally;
mod texture;

use std::collections::{HashMap, HashSet};
use std::path::Path;
use std::rc::Rc;

use self::accessor::Accessors;
use self::budget::Budget;
use self::buffer::Buffers;
use self::deform::Deform;
use self::json::{Item, Table};
use self::node::Hierarchy;
use self::tally::Tally;
use self::texture::Textures;
use super::{ImportError, Resolver, Warnings};
use crate::math::DAffine3;
use crate::scene::{
    Geometry, Instance, Material, MaterialId, MeshId, MeshSource, Node, NodeId, Quantity, Scene, Source, SourceContent,
};

/// Reads a document, `.gltf` or `.glb`, told apart by its first bytes.
///
/// # Errors
/// When it is malformed where it is used, a file it needs is missing, or it requires an extension that is not supported.
pub(super) fn read(bytes: &[u8], resolver: &Resolver, warnings: &mut Warnings) -> Result<Scene, ImportError> {
    let path = resolver.path();
    let container = container::split(bytes, path, warnings)?;
    let value = container::parse(container.json, path)?;
    let root = Item::root(&value, path);
    check_version(&root)?;
    extension::check(&root, warnings)?;
    if root.array("animations")?.len() > 0 {
        warnings.add("ignored-animation", path, "the file has animations; the scene is read as it stands without them");
    }

    let mut budget = Budget::new(resolver.options().max_memory);
    let mut tally = Tally::default();
    let buffers = Buffers::load(&root, container.binary, resolver, &mut budget)?;
    let mut textures = Textures::load(&root, &buffers, resolver, &mut budget, warnings)?;
    let mut materials = Vec::new();
    let material_table = Table::new(&root, "materials", "material")?;
    budget.reserve(&|| "the materials".into(), (material_table.len() * size_of::<Material>()) as u64)?;
    for item in material_table.iter() {
        materials.push(material::read(&item, &mut textures, warnings)?);
    }
    let hierarchy = Hierarchy::read(&root, &mut budget, &mut tally)?;
    let placements = hierarchy.placements(&root, warnings)?;

    let mut placer = Placer {
        meshes: Table::new(&root, "meshes", "mesh")?,
        skins: Table::new(&root, "skins", "skin")?,
        cameras: Table::new(&root, "cameras", "camera")?,
        lights: match root.extension("KHR_lights_punctual")? {
            Some(extension) => Some(Table::new(&extension, "lights", "light")?),
            None => None,
        },
        materials: material_table,
        accessors: Accessors::new(&root, buffers)?,
        globals: if root.has("skins") { hierarchy.globals() } else { Vec::new() },
        hierarchy: &hierarchy,
        loaded: HashMap::new(),
        joints: HashMap::new(),
        posed: HashSet::new(),
        copied: 0,
        copies_allowed: FREE_COPIES + 4 * container.json.len() as u64,
        budget,
        tally,
        warnings,
        scene: Scene { quantity: Quantity::Photometric, ..Scene::default() },
    };
    for (node, transform) in placements {
        placer.place(node, &transform)?;
    }
    let Placer { accessors, tally, mut scene, .. } = placer;
    tally.report(path, warnings);
    if scene.instances.is_empty() && scene.lights.is_empty() {
        warnings.add("empty-scene", path, "the default scene places nothing that can be seen");
    }
    scene.nodes = nodes(&hierarchy);
    scene.materials = materials;
    scene.textures = textures.made;
    scene.images = textures.decoded;
    let content = SourceContent::Gltf { json: container.json.to_owned(), buffers: accessors.buffers().to_vec() };
    scene.sources = vec![Source { path: path.into(), content }];
    Ok(scene)
}

/// Primitives that may be read whatever the length of the document, counting each time one is read.
const FREE_COPIES: u64 = 1 << 20;

/// The error for documents of another version.
fn other_version(path: &Path, what: &str) -> ImportError {
    ImportError::Unsupported {
        path: path.into(),
        feature: format!("a reader for {what}"),
        help: "export it as glTF 2.0; version 1.0 can be converted with gltf-pipeline 3".into(),
    }
}

fn check_version(root: &Item<'_>) -> Result<(), ImportError> {
    let help = "every glTF 2.0 file has \"asset\": {\"version\": \"2.0\"}; is this another kind of JSON file?";
    let Some(asset) = root.object("asset")? else {
        return Err(root.error_with_help("this is not a glTF document: `asset` is missing", help));
    };
    let version = asset.require("version")?;
    let text = version.as_text()?;
    let parts = |text: &str| -> Option<(u32, u32)> {
        let (major, minor) = text.split_once('.')?;
        Some((major.parse().ok()?, minor.parse().ok()?))
    };
    let Some((major, _)) = parts(text) else {
        return Err(version.error_with_help(format!("{text:?} is not a version number"), help));
    };
    if major != 2 {
        return Err(other_version(root.file(), &format!("glTF {text}")));
    }
    match asset.text("minVersion")?.map(|text| (text, parts(text))) {
        Some((text, Some(min))) if min > (2, 0) => Err(other_version(root.file(), &format!("glTF {text}"))),
        _ => Ok(()),
    }
}

fn nodes(hierarchy: &Hierarchy<'_>) -> Vec<Node> {
    let node = |(i, item): (usize, Item<'_>)| Node {
        name: item.name(),
        parent: hierarchy.parents[i].map(NodeId),
        source: Some((0, i as u32)),
    };
    hierarchy.table.iter().enumerate().map(node).collect()
}

/// Which of a mesh's shapes: the one shared by all nodes, or a node's own because of its skin or weights.
type MeshKey = (usize, Option<u32>);

/// Turns placed nodes into instances, lights and cameras.
struct Placer<'p, 'a> {
    meshes: Table<'a>,
    skins: Table<'a>,
    cameras: Table<'a>,
    lights: Option<Table<'a>>,
    materials: Table<'a>,
    accessors: Accessors<'a>,
    hierarchy: &'p Hierarchy<'a>,
    /// World transforms of all nodes, when there are skins.
    globals: Vec<DAffine3>,
    loaded: HashMap<MeshKey, Vec<(MeshId, bool)>>,
    joints: HashMap<usize, Rc<[DAffine3]>>,
    /// Nodes whose skinned shape stands in the world already.
    posed: HashSet<u32>,
    /// Primitives and weights read so far, counting each time, and how many may be.
    copied: u64,
    copies_allowed: u64,
    budget: Budget,
    tally: Tally,
    warnings: &'p mut Warnings,
    scene: Scene,
}

impl<'a> Placer<'_, 'a> {
    fn place(&mut self, node: u32, transform: &DAffine3) -> Result<(), ImportError> {
        let Some(item) = self.hierarchy.table.get(node as usize) else { return Ok(()) };
        let uses = ["mesh", "camera", "extensions"].iter().any(|key| item.has(key));
        if !uses {
            return Ok(());
        }
        if !transform.is_finite() {
            return Err(item.error("the node's transform, with those above it, overflows to infinity"));
        }
        let name = item.name();
        if let Some((_, camera)) = self.cameras.resolve_in(&item, "camera")? {
            let name = if name.is_empty() { camera.name() } else { name.clone() };
            self.scene.cameras.extend(camera::read(&camera, name, transform, self.warnings)?);
        }
        if let Some(extension) = item.extension("KHR_lights_punctual")?
            && let Some(reference) = extension.get("light")?
        {
            let Some(lights) = &self.lights else {
                return Err(reference.error("it refers to a light, but the file declares none"));
            };
            let (_, light) = lights.resolve(&reference)?;
            let name = if name.is_empty() { light.name() } else { name.clone() };
            self.scene.lights.extend(light::read(&light, name, transform, self.warnings)?);
        }
        if let Some((index, mesh)) = self.meshes.resolve_in(&item, "mesh")? {
            let primitives = self.shape(node, &item, index, &mesh)?;
            let transforms = match item.extension("EXT_mesh_gpu_instancing")? {
                Some(extension) => instancing::read(&extension, transform, &self.accessors, &mut self.budget)?,
                None => vec![*transform],
            };
            let name = if name.is_empty() { mesh.name() } else { name };
            let first_time = self.posed.insert(node);
            for (mesh, is_posed) in primitives {
                let transforms: &[DAffine3] = match (is_posed, first_time) {
                    (false, _) => &transforms,
                    (true, true) => &[DAffine3::IDENTITY],
                    (true, false) => &[],
                };
                let bytes = (size_of::<Instance>() + name.len()) as u64 * transforms.len() as u64;
                self.budget.reserve(&|| format!("the instances of {}", item.pointer()), bytes)?;
                self.scene.instances.extend(transforms.iter().map(|&transform| Instance {
                    name: name.clone(),
                    geometry: Geometry::Mesh(mesh),
                    transform,
                    material: None,
                    node: Some(NodeId(node)),
                }));
            }
        }
        Ok(())
    }

    /// The meshes of a node's mesh, read when first met, and whether each stands in world coordinates.
    fn shape(&mut self, node: u32, item: &Item<'a>, index: usize, mesh: &Item<'a>) -> Result<Vec<(MeshId, bool)>, ImportError> {
        let skin = self.skins.resolve_in(item, "skin")?;
        let is_own = skin.is_some() || item.has("weights");
        let key = (index, is_own.then_some(node));
        if let Some(loaded) = self.loaded.get(&key) {
            return Ok(loaded.clone());
        }
        let joints = match skin {
            None => None,
            Some((number, skin)) => Some(match self.joints.get(&number) {
                Some(joints) => joints.clone(),
                None => {
                    let nodes = &self.hierarchy.table;
                    let joints: Rc<[DAffine3]> =
                        deform::joints(&skin, nodes, &self.globals, &self.accessors, &mut self.budget)?.into();
                    self.joints.insert(number, joints.clone());
                    joints
                }
            }),
        };
        let weights = deform::weights(if item.has("weights") { item } else { mesh })?;
        let deform = Deform { weights, joints };
        let primitives = mesh.array("primitives")?;
        // Nodes times primitives (or weights) is a square of the file's length: a copy for each node must stay the exception.
        self.copied += (1 + primitives.len() + deform.weights.len()) as u64;
        if self.copied > self.copies_allowed {
            return Err(item.error_with_help(
                "too many nodes bend a mesh of their own (by skins or morph weights)",
                "apply skins and morph targets before exporting, or split the file",
            ));
        }
        let mesh_name = mesh.name();
        let mut ids = Vec::new();
        for (p, primitive) in primitives.iter().enumerate() {
            let material = match primitive.get("material")? {
                Some(reference) => Some(MaterialId(self.materials.index(&reference)? as u32)),
                None => None,
            };
            let source = MeshSource { file: 0, mesh: index as u32, primitive: p as u32 };
            let mut context = mesh::Context { accessors: &self.accessors, budget: &mut self.budget, tally: &mut self.tally };
            if let Some(read) = mesh::read(&primitive, &mesh_name, material, source, &deform, &mut context)? {
                ids.push((MeshId(self.scene.meshes.len() as u32), read.is_posed));
                self.scene.meshes.push(read.mesh);
            }
        }
        self.loaded.insert(key, ids.clone());
        Ok(ids)
    }
}
