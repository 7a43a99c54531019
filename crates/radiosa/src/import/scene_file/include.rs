//! Other files inside a scene file: read by their own importers, changed by name, put into place.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::Deserialize;

use super::error::suggestion;
use super::light::turned;
use super::material::MaterialTable;
use super::transform::{TransformTable, Up, to_affine, unit_length};
use super::value::{At, Named, OneOrMany, OrTable, Unit};
use super::{Nesting, Reading};
use crate::import::{ImportError, Resolver};
use crate::math::{DAffine3, DMat3, DQuat};
use crate::scene::{
    Attenuation, Geometry, Image, ImageId, Instance, LightKind, MaterialId, MeshId, MeshSource, NodeId, Pixels, Projection,
    Scene, TextureId, TextureSource,
};

/// A file to include: its name, or a table.
pub(super) type Include = OrTable<String, IncludeTable>;

/// A glTF, OBJ or scene file, found from the folder of this file, and what is changed in it. It is first brought to metres with y up
/// (glTF is so already), then moved by `transform`, which is in this file's coordinates.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct IncludeTable {
    /// The file.
    file: At<String>,
    /// The axis that points up in it; `"y"` when not given.
    #[serde(default)]
    up: Up,
    /// The length of its unit in metres; 1 when not given.
    scale: Option<Unit>,
    /// Moves it into place.
    #[serde(default)]
    transform: OneOrMany<TransformTable>,
    /// Material of this file for surfaces that have none.
    default_material: Option<At<String>>,
    /// Keeps its lights; true when not given.
    lights: Option<bool>,
    /// Keeps its cameras; true when not given.
    cameras: Option<bool>,
    /// Changes materials by name (`*` stands for any letters): what a table gives replaces what the material had, the rest stays.
    #[serde(default)]
    material: Named<MaterialTable>,
    /// Changes objects by the name of the instance or of a node above it (`*` stands for any letters).
    #[serde(default)]
    object: Named<ObjectTable>,
}

/// What is changed in an object.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct ObjectTable {
    /// Leaves it out.
    hidden: bool,
    /// Name of a material of this file for all of it.
    material: Option<At<String>>,
}

/// Reads an included file, changes it, and adds it to the scene.
pub(super) fn include(include: &At<Include>, r: &mut Reading<'_>, nesting: &mut Nesting) -> Result<(), ImportError> {
    let (file, table) = match &include.value {
        OrTable::Plain(file) => (At { value: file.clone(), span: include.span.clone() }, None),
        OrTable::Table(table) => (table.file.clone(), Some(table)),
    };
    let mut other = read(&file, r, nesting)?;
    nesting.charge(&other, &file.value)?;
    let up = table.map_or(Up::Y, |t| t.up);
    let metres = up.to_scene(table.and_then(|t| t.scale).map_or(1.0, |s| s.0));
    let placed = match table {
        Some(t) => to_affine(&t.transform, &r.text, r.up)?,
        None => DAffine3::IDENTITY,
    };
    // The transform is meant in this file's coordinates; its own up and scale stand around it.
    let from_file = r.scene.from_file;
    let into = from_file * placed * from_file.inverse() * metres;
    if let Some(table) = table {
        if table.lights == Some(false) {
            other.lights.clear();
        }
        if table.cameras == Some(false) {
            other.cameras.clear();
        }
    }
    r.included_quantities.push((file.value.clone(), other.quantity, has_light(&other)));
    let base = append(&mut r.scene, other, into);
    if let Some(table) = table {
        change(table, &file, &base, r)?;
    }
    Ok(())
}

fn read(file: &At<String>, r: &mut Reading<'_>, nesting: &mut Nesting) -> Result<Scene, ImportError> {
    let path = r.find(file)?;
    let ending = path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase).unwrap_or_default();
    let resolver = Resolver::new(&path, r.resolver.options());
    let bytes = || resolver.read_main().map_err(|e| r.at_reference(file, e));
    match ending.as_str() {
        "gltf" | "glb" => crate::import::gltf::read(&bytes()?, &resolver, r.warnings),
        "obj" => crate::import::obj::read(&bytes()?, &resolver, r.warnings),
        "toml" => {
            nesting
                .enter(&path)
                .map_err(|why| r.text.error(&file.span, why, "scene files may include each other, but not in a circle"))?;
            let scene = super::read_nested(&bytes()?, &resolver, r.warnings, nesting);
            nesting.leave();
            scene
        }
        _ => {
            let help = "files that can be included end in .toml, .obj, .gltf, .glb".to_owned();
            Err(r.text.error(&file.span, format!("{:?} is not a scene of a known format", file.value), help))
        }
    }
}

fn has_light(scene: &Scene) -> bool {
    !scene.lights.is_empty() || scene.environment.is_some() || scene.materials.iter().any(|m| !m.emission.factor.is_black())
}

/// Bytes a scene takes, roughly: what grows with its size.
pub(super) fn memory(scene: &Scene) -> u64 {
    let meshes: usize = scene
        .meshes
        .iter()
        .map(|m| {
            let per_vertex =
                24 + 12 * usize::from(m.normals.is_some()) + 16 * usize::from(m.tangents.is_some()) + 8 * m.uvs.len();
            let polygons = m.polygons.as_ref().map_or(0, |p| 4 * (p.offsets.len() + p.vertices.len() + p.of_triangle.len()));
            m.positions.len() * per_vertex + m.triangles.len() * 12 + m.materials.len() * 8 + polygons
        })
        .sum();
    let images: u64 = scene.images.iter().map(picture_memory).sum();
    let rest = scene.instances.len() * size_of::<Instance>() + scene.nodes.len() * 64 + scene.materials.len() * 512;
    (meshes + rest) as u64 + images
}

/// Bytes of a decoded picture.
pub(super) fn picture_memory(image: &Image) -> u64 {
    let bytes = match &image.pixels {
        Pixels::Rgba8(p) => p.len(),
        Pixels::Rgba16(p) => 2 * p.len(),
        Pixels::Rgba32F(p) => 4 * p.len(),
    };
    bytes as u64
}

/// Where the parts of an appended scene begin.
struct Base {
    materials: usize,
    meshes: usize,
    instances: usize,
}

/// Adds everything of `other`, mapped by `into`. Its environment, background, medium and ambient light count where `scene` has none.
fn append(scene: &mut Scene, other: Scene, into: DAffine3) -> Base {
    let base = Base { materials: scene.materials.len(), meshes: scene.meshes.len(), instances: scene.instances.len() };
    let (images, textures) = (scene.images.len() as u32, scene.textures.len() as u32);
    let (nodes, sources) = (scene.nodes.len() as u32, scene.sources.len() as u32);
    let (materials, meshes) = (base.materials as u32, base.meshes as u32);
    scene.images.extend(other.images);
    scene.textures.extend(other.textures.into_iter().map(|mut t| {
        if let TextureSource::Image(ImageId(i)) = &mut t.source {
            *i += images;
        }
        t
    }));
    scene.materials.extend(other.materials.into_iter().map(|mut m| {
        m.for_each_texture(&mut |TextureId(t)| *t += textures);
        m
    }));
    let shift = |m: Option<MaterialId>| m.map(|m| MaterialId(m.0 + materials));
    scene.meshes.extend(other.meshes.into_iter().map(|mut mesh| {
        mesh.materials.iter_mut().for_each(|m| *m = shift(*m));
        mesh.source = mesh.source.map(|s| MeshSource { file: s.file + sources, ..s });
        mesh
    }));
    scene.nodes.extend(other.nodes.into_iter().map(|mut node| {
        node.parent = node.parent.map(|p| NodeId(p.0 + nodes));
        node.source = node.source.map(|(file, n)| (file + sources, n));
        node
    }));
    scene.instances.extend(other.instances.into_iter().map(|i| Instance {
        geometry: match i.geometry {
            Geometry::Mesh(mesh) => Geometry::Mesh(MeshId(mesh.0 + meshes)),
            exact => exact,
        },
        transform: into * i.transform,
        material: shift(i.material),
        node: i.node.map(|n| NodeId(n.0 + nodes)),
        name: i.name,
    }));
    scene.sources.extend(other.sources);
    let length = unit_length(&into);
    scene.lights.extend(other.lights.into_iter().map(|mut light| {
        place_light(&mut light.kind, &into, length);
        light
    }));
    scene.cameras.extend(other.cameras.into_iter().map(|mut camera| {
        camera.position = into.transform_point3(camera.position);
        camera.basis = turned(camera.basis, into.matrix3);
        if let Projection::Orthographic { height } = &mut camera.projection {
            *height *= length;
        }
        if let Some(lens) = &mut camera.lens {
            lens.aperture *= length;
            lens.focus_distance *= length;
        }
        camera
    }));
    if scene.environment.is_none() {
        scene.environment = other.environment.map(|mut e| {
            if let crate::scene::EnvironmentRadiance::Map(ImageId(i)) = &mut e.radiance {
                *i += images;
            }
            e.rotation = rotation(into.matrix3) * e.rotation;
            e
        });
    }
    if scene.background.is_black() {
        scene.background = other.background;
    }
    scene.medium = scene.medium.or(other.medium);
    if scene.ambient.is_black() {
        scene.ambient = other.ambient;
    }
    base
}

/// The rotation in a map.
fn rotation(m: DMat3) -> DQuat {
    let x = m.x_axis.normalize();
    let y = (m.y_axis - x * m.y_axis.dot(x)).normalize();
    DQuat::from_mat3(&DMat3::from_cols(x, y, x.cross(y)))
}

fn place_light(kind: &mut LightKind, into: &DAffine3, length: f64) {
    let direction = |d: crate::math::DVec3| into.transform_vector3(d).normalize();
    let fall_off = |a: &mut Attenuation| {
        a.c2 /= length;
        a.c3 /= length * length;
    };
    match kind {
        LightKind::Ambient => {}
        LightKind::Point { position, attenuation, range, .. } => {
            *position = into.transform_point3(*position);
            fall_off(attenuation);
            *range *= length;
        }
        LightKind::Spot { position, axis, attenuation, range, .. } => {
            *position = into.transform_point3(*position);
            *axis = direction(*axis);
            fall_off(attenuation);
            *range *= length;
        }
        LightKind::Distant { to_light, .. } => *to_light = direction(*to_light),
        LightKind::Hemispherical { axis, .. } => *axis = direction(*axis),
        LightKind::Discrete { directions } => directions.iter_mut().for_each(|d| d.to_light = direction(d.to_light)),
    }
}

/// True when `name` is what `pattern` says; `*` stands for any letters.
fn matches(pattern: &str, name: &str) -> bool {
    let mut parts = pattern.split('*');
    let Some(mut rest) = name.strip_prefix(parts.next().unwrap_or_default()) else { return false };
    let mut parts: Vec<&str> = parts.collect();
    let Some(last) = parts.pop() else { return rest.is_empty() };
    for part in parts {
        let Some(at) = rest.find(part) else { return false };
        rest = &rest[at + part.len()..];
    }
    rest.len() >= last.len() && rest.ends_with(last)
}

/// Applies the overrides of an include to what it added.
fn change(table: &IncludeTable, file: &At<String>, base: &Base, r: &mut Reading<'_>) -> Result<(), ImportError> {
    for (name, changed) in &table.material.0 {
        let mut found = false;
        for i in base.materials..r.scene.materials.len() {
            if matches(&name.value, &r.scene.materials[i].name) {
                found = true;
                let old = r.scene.materials[i].clone();
                let mut start = match &changed.like {
                    Some(like) => r.scene.materials[r.material(like)?.index()].clone(),
                    None => old.clone(),
                };
                start.name = old.name;
                let new = changed.apply(start, &name.span, r)?;
                r.scene.materials[i] = new;
            }
        }
        if !found {
            let known = r.scene.materials[base.materials..].iter().map(|m| m.name.as_str());
            let message = format!("{:?} has no material {:?}", file.value, name.value);
            return Err(r.text.error(&name.span, message, suggestion(&name.value, known)));
        }
    }
    let mut hidden = vec![false; r.scene.instances.len()];
    for (name, changed) in &table.object.0 {
        let material = changed.material.as_ref().map(|m| r.material(m)).transpose()?;
        let mut found = false;
        for (i, hidden) in hidden.iter_mut().enumerate().skip(base.instances) {
            if !is_named(&r.scene, i, &name.value) {
                continue;
            }
            found = true;
            *hidden |= changed.hidden;
            if material.is_some() {
                r.scene.instances[i].material = material;
            }
        }
        if !found {
            let instances = r.scene.instances[base.instances..].iter().map(|i| i.name.as_str());
            let names = instances.chain(r.scene.nodes.iter().map(|n| n.name.as_str())).filter(|n| !n.is_empty());
            let message = format!("{:?} has no object {:?}", file.value, name.value);
            return Err(r.text.error(&name.span, message, suggestion(&name.value, names)));
        }
    }
    if let Some(name) = &table.default_material {
        let material = r.material(name)?;
        for mesh in &mut r.scene.meshes[base.meshes..] {
            if mesh.materials.is_empty() {
                mesh.materials.push(None);
            }
            mesh.materials.iter_mut().for_each(|m| *m = m.or(Some(material)));
        }
        for instance in &mut r.scene.instances[base.instances..] {
            if !matches!(instance.geometry, Geometry::Mesh(_)) {
                instance.material = instance.material.or(Some(material));
            }
        }
    }
    let mut keep = hidden.iter().map(|h| !h);
    r.scene.instances.retain(|_| keep.next().unwrap_or(true));
    Ok(())
}

/// True when the instance or a node above it has the name.
fn is_named(scene: &Scene, instance: usize, pattern: &str) -> bool {
    let instance = &scene.instances[instance];
    if matches(pattern, &instance.name) {
        return true;
    }
    let mut node = instance.node;
    // A hierarchy cannot be deeper than it has nodes, even if an importer let a circle through.
    for _ in 0..scene.nodes.len() {
        let Some(n) = node else { return false };
        let n = &scene.nodes[n.index()];
        if matches(pattern, &n.name) {
            return true;
        }
        node = n.parent;
    }
    false
}

impl Nesting {
    /// Notes what an included file took.
    fn charge(&mut self, scene: &Scene, file: &str) -> Result<(), ImportError> {
        self.memory = self.memory.saturating_add(memory(scene));
        if self.memory > self.max_memory {
            let what = format!("this scene with {file:?}");
            return Err(ImportError::TooLarge { what, needed: self.memory, allowed: self.max_memory });
        }
        Ok(())
    }

    /// Goes into another scene file.
    fn enter(&mut self, path: &std::path::Path) -> Result<(), String> {
        let real = path.canonicalize().unwrap_or_else(|_| path.to_path_buf());
        if self.open.contains(&real) {
            return Err(format!("{} includes itself", path.display()));
        }
        if self.open.len() >= Nesting::DEPTH {
            return Err(format!("scene files are included more than {} deep", Nesting::DEPTH));
        }
        self.files += 1;
        if self.files > Nesting::FILES {
            return Err(format!("more than {} scene files are included", Nesting::FILES));
        }
        self.open.push(real);
        Ok(())
    }

    fn leave(&mut self) {
        self.open.pop();
    }
}

/// The path as it is kept on the stack of open files.
pub(super) fn real(path: &std::path::Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_path_buf())
}
