//! The scene file: TOML that stands alone or adds lights, cameras and materials to glTF, OBJ and scene files it includes.
//!
//! `docs/scene-file.md` is the guide and `docs/scene-file.schema.json` the schema for editors. The shapes of the file are the `…Table` types in
//! this folder, one file for each idea; their doc comments are the schema's descriptions. Values check themselves while they are read
//! (`value`), so that every error has the line and column of what is wrong; unknown keys are errors with the nearest known one.
//!
//! ```toml
//! [material.white]
//! lambert = 0.7
//!
//! [[shape]]
//! material = "white"
//! quad = [[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]]
//!
//! [light.lamp]
//! point = [0, 2, 0]
//! ```

mod error;
mod include;
mod light;
mod material;
mod medium;
mod polygon;
mod replace;
mod shape;
mod transform;
mod value;

pub use error::nearest;
pub(super) use replace::replace;
pub use replace::{Override, OverrideError};

use std::collections::HashMap;
use std::ops::Range;
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::Deserialize;

use self::error::Text;
use self::include::Include;
use self::light::{CameraTable, EnvironmentTable, LightTable};
use self::material::{MaterialTable, TextureTable, Use};
use self::medium::MediumTable;
use self::shape::{BuiltGeometry, ShapeTable};
use self::transform::Up;
use self::value::{At, Color, Named, OneOrMany, Unit};
use super::{ImportError, Location, Resolver, Warnings};
use crate::math::{DAffine3, DVec3};
use crate::scene::{
    Geometry, ImageId, Instance, Material, MaterialId, MeshId, Quantity, Scene, Source, SourceContent, TextureId,
};
use crate::spectrum::Spectrum;

/// A Radiosa scene file.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct SceneFile {
    /// Where the schema is, for editors.
    #[serde(rename = "$schema")]
    #[allow(dead_code, reason = "read by editors only")]
    schema: Option<String>,
    /// Name of the scene; the file's name when not given.
    name: Option<String>,
    /// What the scene is for, for people.
    #[allow(dead_code, reason = "read by people only")]
    about: Option<String>,
    /// Whether light is given in watts or in lumens; that of the included files, otherwise `"radiometric"`, when not given.
    quantity: Option<At<QuantityKind>>,
    /// The axis that points up in this file; `"y"` when not given.
    up: Up,
    /// The length of this file's unit in metres; 1 when not given.
    scale: Option<Unit>,
    /// What the camera sees behind everything; gives no light; black when not given.
    background: Option<Color>,
    /// Fills all space outside of bodies: fog. Path tracing.
    medium: Option<MediumTable>,
    /// Global ambient light `I_a` of the local models; black when not given.
    ambient: Option<Color>,
    /// Other files to include: a name, a table, or an array of them.
    include: OneOrMany<Include>,
    /// Textures by name.
    texture: Named<TextureTable>,
    /// Materials by name.
    material: Named<MaterialTable>,
    /// Shapes.
    shape: Vec<At<ShapeTable>>,
    /// Lights by name.
    light: Named<LightTable>,
    /// Light from infinitely far away.
    environment: Option<At<EnvironmentTable>>,
    /// Cameras by name; the first is the one used when none is asked for.
    camera: Named<CameraTable>,
}

/// Watts or lumens.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
enum QuantityKind {
    /// W, W/sr, W/m², W/(m² sr).
    Radiometric,
    /// lm, cd, lx, cd/m².
    Photometric,
}

/// The JSON Schema of scene files, for editors and for checks outside Radiosa.
pub fn schema() -> serde_json::Value {
    let mut schema = schemars::schema_for!(SceneFile).to_value();
    if let Some(object) = schema.as_object_mut() {
        object.insert("title".into(), "Radiosa scene file".into());
    }
    schema
}

/// What is open and used up while scene files include each other.
struct Nesting {
    /// The scene files from the outermost to the one being read.
    open: Vec<PathBuf>,
    files: usize,
    memory: u64,
    max_memory: u64,
}

impl Nesting {
    const DEPTH: usize = 8;
    const FILES: usize = 1000;
}

/// What reading one byte of a file may take: `[0,0,0],` becomes an array of three values with their places.
const MEMORY_PER_BYTE: u64 = 64;

/// Everything needed while one file becomes a scene.
struct Reading<'a> {
    text: Text,
    resolver: Resolver,
    warnings: &'a mut Warnings,
    up: Up,
    scene: Scene,
    textures: HashMap<String, TextureTable>,
    built_textures: HashMap<(String, Use), TextureId>,
    images: HashMap<PathBuf, ImageId>,
    materials: HashMap<String, MaterialId>,
    /// Bytes of the pictures this file itself names.
    pictures: u64,
    /// Of each included file: its name, what its light is in, whether it has any.
    included_quantities: Vec<(String, Quantity, bool)>,
}

/// Reads a scene file.
///
/// # Errors
/// When it is no TOML, has keys or values that mean nothing, refers to names it does not define, or to files that cannot be read.
pub(super) fn read(bytes: &[u8], resolver: &Resolver, warnings: &mut Warnings) -> Result<Scene, ImportError> {
    let max_memory = resolver.options().max_memory;
    let mut nesting = Nesting { open: vec![include::real(resolver.path())], files: 1, memory: 0, max_memory };
    read_nested(bytes, resolver, warnings, &mut nesting)
}

fn read_nested(bytes: &[u8], resolver: &Resolver, warnings: &mut Warnings, nesting: &mut Nesting) -> Result<Scene, ImportError> {
    let (needed, allowed) = ((bytes.len() as u64).saturating_mul(MEMORY_PER_BYTE), resolver.options().max_memory);
    if needed > allowed {
        return Err(ImportError::TooLarge { what: format!("reading {}", resolver.path().display()), needed, allowed });
    }
    let text = Text::new(resolver.path(), bytes)?;
    let mut file: SceneFile = toml::from_str(&text.text).map_err(|e| text.toml_error(&e))?;
    let mut scene = Scene::new(file.name.take().unwrap_or_default());
    scene.from_file = file.up.to_scene(file.scale.map_or(1.0, |s| s.0));
    scene.background = file.background.map_or(Spectrum::BLACK, |c| c.0);
    scene.ambient = file.ambient.map_or(Spectrum::BLACK, |c| c.0);
    scene.sources.push(Source { path: resolver.path().to_path_buf(), content: SourceContent::Other });
    let mut r = Reading {
        text,
        // The scene file is the user's own: it may name any regular file.
        resolver: resolver.clone().unconfined(),
        warnings,
        up: file.up,
        scene,
        textures: HashMap::new(),
        built_textures: HashMap::new(),
        images: HashMap::new(),
        materials: HashMap::new(),
        pictures: 0,
        included_quantities: Vec::new(),
    };
    let texture_names: Vec<At<String>> = file.texture.0.iter().map(|(name, _)| name.clone()).collect();
    r.textures = file.texture.0.into_iter().map(|(name, table)| (name.value, table)).collect();
    r.scene.medium = file.medium.as_ref().map(|medium| medium.build(&r));
    r.add_materials(&file.material.0)?;
    // A texture nobody uses must still be right.
    for name in &texture_names {
        if ![Use::Color, Use::Numbers].iter().any(|&used| r.built_textures.contains_key(&(name.value.clone(), used))) {
            r.texture(name, Use::Color)?;
        }
    }
    // The file's own environment goes before those of what it includes, its own cameras and lights as well.
    r.scene.environment = file.environment.as_ref().map(|e| EnvironmentTable::build(e, &mut r)).transpose()?;
    for (name, camera) in &file.camera.0 {
        let camera = camera.build(name, &r)?;
        r.scene.cameras.push(camera);
    }
    for (name, light) in &file.light.0 {
        let light = light.build(name, &mut r)?;
        r.scene.lights.push(light);
    }
    for (i, shape) in file.shape.iter().enumerate() {
        r.add_shape(i, shape, nesting)?;
    }
    for one in &file.include.0 {
        include::include(one, &mut r, nesting)?;
    }
    r.settle_quantity(file.quantity.as_ref())?;
    r.check_range()?;
    Ok(r.scene)
}

impl Reading<'_> {
    /// A place of the file in scene coordinates.
    fn point(&self, p: DVec3) -> DVec3 {
        self.scene.from_file.transform_point3(p)
    }

    /// A direction of the file in scene coordinates.
    fn direction(&self, d: DVec3) -> DVec3 {
        self.scene.from_file.transform_vector3(d).normalize()
    }

    /// What a medium absorbs, scatters or emits per unit of the file as that per metre.
    fn per_metre(&self, of_unit: Option<Color>) -> Spectrum {
        #[expect(clippy::cast_possible_truncation, reason = "colours are kept in single precision")]
        of_unit.map_or(Spectrum::BLACK, |of_unit| of_unit.0 / transform::unit_length(&self.scene.from_file) as f32)
    }

    /// The path of a file this one names.
    fn find(&self, name: &At<String>) -> Result<PathBuf, ImportError> {
        self.resolver.find(&name.value).map_err(|e| self.at_reference(name, e))
    }

    /// What went wrong with a file that is named here, with the place where it is named.
    fn at_reference(&self, name: &At<String>, error: ImportError) -> ImportError {
        match error {
            ImportError::Io { .. } => {
                let help = "file names are looked up from the folder of the scene file";
                self.text.error(&name.span, error.to_string(), help)
            }
            other => other,
        }
    }

    /// The picture in a file; decoded once.
    fn image(&mut self, name: &At<String>) -> Result<ImageId, ImportError> {
        let path = self.find(name)?;
        if let Some(&id) = self.images.get(&path) {
            return Ok(id);
        }
        let bytes = self.resolver.read(&name.value).map_err(|e| self.at_reference(name, e))?;
        // What other pictures take is no longer there for this one.
        let left = self.resolver.options().max_memory.saturating_sub(self.pictures);
        let image = super::decode_picture(&bytes, &Location::file(&path), left)?;
        self.pictures += include::picture_memory(&image);
        let id = ImageId(self.scene.images.len() as u32);
        self.scene.images.push(image);
        self.images.insert(path, id);
        Ok(id)
    }

    /// A texture of this file by name, for one use.
    fn texture(&mut self, name: &At<String>, used: Use) -> Result<TextureId, ImportError> {
        let key = (name.value.clone(), used);
        if let Some(&id) = self.built_textures.get(&key) {
            return Ok(id);
        }
        let Some(table) = self.textures.get(&name.value).cloned() else {
            return Err(self.text.unknown(name, "texture", sorted(&self.textures).into_iter()));
        };
        let texture = table.build(name, used, self)?;
        let id = TextureId(self.scene.textures.len() as u32);
        self.scene.textures.push(texture);
        self.built_textures.insert(key, id);
        Ok(id)
    }

    /// A material of this file by name.
    fn material(&self, name: &At<String>) -> Result<MaterialId, ImportError> {
        let unknown = || self.text.unknown(name, "material", sorted(&self.materials).into_iter());
        self.materials.get(&name.value).copied().ok_or_else(unknown)
    }

    /// All materials of the file, in its order; those that are `like` another after it.
    fn add_materials(&mut self, tables: &[(At<String>, MaterialTable)]) -> Result<(), ImportError> {
        let place: HashMap<&str, usize> = tables.iter().enumerate().map(|(i, (name, _))| (name.value.as_str(), i)).collect();
        let mut built: Vec<Option<Material>> = vec![None; tables.len()];
        for first in 0..tables.len() {
            // From a material to the one it is like, until one stands on its own or is known.
            let mut chain = vec![first];
            while let (None, Some(like)) = (&built[chain[chain.len() - 1]], &tables[chain[chain.len() - 1]].1.like) {
                let Some(&next) = place.get(like.value.as_str()) else {
                    return Err(self.text.unknown(like, "material", tables.iter().map(|(name, _)| name.value.as_str())));
                };
                if chain.contains(&next) {
                    return Err(self.text.error(&like.span, "these materials are like each other in a circle", ""));
                }
                if chain.len() > 64 {
                    return Err(self.text.error(&like.span, "more than 64 materials are like one another", ""));
                }
                chain.push(next);
            }
            for i in chain.into_iter().rev() {
                if built[i].is_none() {
                    let (name, table) = &tables[i];
                    let like = table.like.as_ref().and_then(|l| built[place[l.value.as_str()]].clone());
                    let base = Material { name: name.value.clone(), ..like.unwrap_or_default() };
                    built[i] = Some(table.apply(base, &name.span, self)?);
                }
            }
        }
        for (built, (name, _)) in built.into_iter().flatten().zip(tables) {
            self.materials.insert(name.value.clone(), MaterialId(self.scene.materials.len() as u32));
            self.scene.materials.push(built);
        }
        Ok(())
    }

    fn add_shape(&mut self, i: usize, shape: &At<ShapeTable>, nesting: &mut Nesting) -> Result<(), ImportError> {
        let material = shape.value.material.as_ref().map(|m| self.material(m)).transpose()?;
        let placed = transform::to_affine(&shape.value.transform, &self.text, self.up)?;
        let built = shape::build(shape, &self.text, self.up.axis())?;
        let name = shape.value.name.clone().unwrap_or_else(|| format!("{} {}", built.kind, i + 1));
        let (geometry, unit) = match built.geometry {
            BuiltGeometry::Exact(geometry, unit) => (geometry, unit),
            BuiltGeometry::Mesh(mut mesh) => {
                nesting.memory += (mesh.positions.len() * 48 + mesh.triangles.len() * 32) as u64;
                if nesting.memory > nesting.max_memory {
                    let (needed, allowed) = (nesting.memory, nesting.max_memory);
                    return Err(ImportError::TooLarge { what: "this scene".into(), needed, allowed });
                }
                mesh.name.clone_from(&name);
                mesh.materials = vec![material];
                self.scene.meshes.push(mesh);
                (Geometry::Mesh(MeshId(self.scene.meshes.len() as u32 - 1)), DAffine3::IDENTITY)
            }
        };
        // On the mesh a material could be shared; exact shapes have nowhere else to keep it.
        let material = if matches!(geometry, Geometry::Mesh(_)) { None } else { material };
        let mut place = |name: String, last: DAffine3| {
            let transform = self.scene.from_file * last * placed * unit;
            self.scene.instances.push(Instance { name, geometry, transform, material, node: None });
        };
        if shape.value.copies.is_empty() {
            place(name, DAffine3::IDENTITY);
        } else {
            for (n, copy) in shape.value.copies.iter().enumerate() {
                place(format!("{name} {}", n + 1), transform::to_affine(copy, &self.text, self.up)?);
            }
        }
        Ok(())
    }

    /// The file says what its light is measured in, or what it includes does.
    fn settle_quantity(&mut self, said: Option<&At<QuantityKind>>) -> Result<(), ImportError> {
        let said = said.map(|at| match at.value {
            QuantityKind::Radiometric => Quantity::Radiometric,
            QuantityKind::Photometric => Quantity::Photometric,
        });
        let included = self.included_quantities.iter().find(|q| q.2).or(self.included_quantities.first()).map(|q| q.1);
        self.scene.quantity = said.or(included).unwrap_or_default();
        for (file, quantity, has_light) in &self.included_quantities {
            if *has_light && *quantity != self.scene.quantity {
                let word = |q| if q == Quantity::Photometric { "photometric" } else { "radiometric" };
                let message = format!(
                    "the light in {file:?} is {}, this scene is {}: its numbers are used as they are",
                    word(*quantity),
                    word(self.scene.quantity)
                );
                self.warnings.add("mixed-quantities", &self.text.path, message);
            }
        }
        Ok(())
    }

    /// Transforms of transforms may leave what single precision holds.
    fn check_range(&self) -> Result<(), ImportError> {
        let largest = |values: &[f64]| values.iter().fold(0.0f64, |m, v| if v.is_nan() { f64::INFINITY } else { m.max(v.abs()) });
        let mut extent = 0.0f64;
        for i in &self.scene.instances {
            extent = extent.max(largest(&i.transform.to_cols_array()));
        }
        if let Some((lo, hi)) = self.scene.bounds() {
            extent = extent.max(largest(&[lo.x, lo.y, lo.z, hi.x, hi.y, hi.z]));
        }
        for camera in &self.scene.cameras {
            extent = extent.max(largest(&camera.position.to_array()));
        }
        if extent > 1e18 {
            let message = "the scene reaches farther than 1e18 metres";
            return Err(ImportError::invalid_with_help(
                Location::file(&self.text.path),
                message,
                "check `scale` and the transforms",
            ));
        }
        Ok(())
    }
}

fn sorted<T>(map: &HashMap<String, T>) -> Vec<&str> {
    let mut names: Vec<&str> = map.keys().map(String::as_str).collect();
    names.sort_unstable();
    names
}

/// The one key that is present of those that exclude each other, if any.
fn at_most_one(
    text: &Text,
    span: &Range<usize>,
    what: &str,
    keys: &[(&'static str, bool)],
) -> Result<Option<&'static str>, ImportError> {
    let mut present = keys.iter().filter(|k| k.1).map(|k| k.0);
    match (present.next(), present.next()) {
        (Some(first), Some(second)) => {
            Err(text.error(span, format!("{what} cannot have both `{first}` and `{second}`"), "keep one of them"))
        }
        (first, _) => Ok(first),
    }
}

/// The one key that is present of those that exclude each other.
fn exactly_one(text: &Text, span: &Range<usize>, what: &str, keys: &[(&'static str, bool)]) -> Result<&'static str, ImportError> {
    at_most_one(text, span, what, keys)?.ok_or_else(|| {
        let all: Vec<_> = keys.iter().map(|k| k.0).collect();
        text.error(span, format!("this is not yet {what}"), format!("it needs one of: {}", all.join(", ")))
    })
}
