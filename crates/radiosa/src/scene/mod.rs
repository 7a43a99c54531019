//! The scene: plain data and typed indices, the same for every method. It has no behaviour beyond [`Scene::validate`].
//!
//! Positions are f64 and in the scene's own units after the importer's `up` and `scale`; `transport::World` recentres them.
//! Every instance is one placed geometry: radiosities, lightmap regions and hits are keyed by [`InstanceId`].

mod camera;
mod light;
mod material;
mod medium;
mod mesh;
mod texture;
mod validate;

pub use camera::{Camera, Lens, Projection};
pub use light::{Attenuation, Cone, Directional, Environment, EnvironmentRadiance, Light, LightKind, PhotometricUnit};
pub use material::{
    Alpha, AlphaMode, Behind, ColorMap, CookTorrance, Distribution, Form, Fresnel, Material, Metal, MetallicRoughness, Model,
    NormalMap, Phong, PhongLobe, ScalarMap, Shadowing,
};
pub use medium::{Inside, Medium};
pub use mesh::{Mesh, MeshSource, Polygons};
pub use texture::{Filter, Image, Pixels, Sampler, Texture, TextureRef, TextureSource, UvTransform, Wrap};
pub use validate::SceneError;

use crate::math::{DAffine3, DMat3, DVec3};
use crate::spectrum::Spectrum;

macro_rules! ids {
    ($($(#[$doc:meta])* $name:ident),* $(,)?) => { $(
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub struct $name(pub u32);

        impl $name {
            /// As an index into the scene's vector of that kind.
            pub const fn index(self) -> usize {
                self.0 as usize
            }
        }
    )* };
}

ids! {
    /// Index into [`Scene::meshes`].
    MeshId,
    /// Index into [`Scene::instances`].
    InstanceId,
    /// Index into [`Scene::materials`].
    MaterialId,
    /// Index into [`Scene::textures`].
    TextureId,
    /// Index into [`Scene::images`].
    ImageId,
    /// Index into [`Scene::nodes`].
    NodeId,
}

/// Whether the numbers of a scene's lights are radiometric or photometric. The arithmetic is the same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Quantity {
    /// W, W/sr, W/m², W/(m² sr).
    #[default]
    Radiometric,
    /// lm, cd, lx, cd/m².
    Photometric,
}

/// Everything that is lit, everything that lights, and where to look from.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// For messages and recipes: the file's stem or the built-in name.
    pub name: String,
    /// The unit system of every light and emission.
    pub quantity: Quantity,
    /// The named hierarchy the instances came from (glTF nodes, OBJ objects and groups); informative, transforms are already in the instances.
    pub nodes: Vec<Node>,
    /// Geometry, shared by instances.
    pub meshes: Vec<Mesh>,
    /// Placed geometry, in the order of the source.
    pub instances: Vec<Instance>,
    /// What surfaces are made of. An instance or triangle without a material shows [`Material::default`].
    pub materials: Vec<Material>,
    /// Textures: a picture with its sampler, or a procedure.
    pub textures: Vec<Texture>,
    /// Decoded pictures.
    pub images: Vec<Image>,
    /// Lights that are not surfaces and not the environment.
    pub lights: Vec<Light>,
    /// What rays that leave the scene meet, when it gives light.
    pub environment: Option<Environment>,
    /// What the camera sees behind everything when there is no environment (or it is hidden from the camera). Not a light.
    pub background: Spectrum,
    /// Fills space outside of all bodies, without end: path tracing knows it.
    pub medium: Option<Medium>,
    /// Global ambient light `I_a`: adds `I_a k_a` in the local models, ray casting and Whitted only.
    pub ambient: Spectrum,
    /// View points, in the order of the source; empty means: frame the scene automatically.
    pub cameras: Vec<Camera>,
    /// The files the scene came from, kept so that a bake can write them back with what it does not understand untouched.
    pub sources: Vec<Source>,
    /// From input-file coordinates to scene coordinates (`up` and `scale`); sensors and outputs use the former.
    pub from_file: DAffine3,
}

/// One node of the source's hierarchy.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    /// Name in the source; may be empty, need not be unique.
    pub name: String,
    /// Parent in [`Scene::nodes`].
    pub parent: Option<NodeId>,
    /// Index into [`Scene::sources`] and of the node inside that file.
    pub source: Option<(u32, u32)>,
}

/// What an instance places.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Geometry {
    /// A triangle mesh.
    Mesh(MeshId),
    /// The exact unit sphere around the origin; outward normals; `u` = longitude from +x towards +z in turns, `v` = colatitude from +y in half turns.
    Sphere,
    /// The exact unit disc around the origin in the plane y = 0; its front normal is +y; uv = ((x + 1)/2, (z + 1)/2).
    Disc,
}

/// One placed geometry: the key of everything that is later stored per surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Instance {
    /// Name for reports: node, object or group name; may be empty, need not be unique.
    pub name: String,
    /// What is placed.
    pub geometry: Geometry,
    /// From the geometry's to scene coordinates. A negative determinant flips the winding, so that the front stays the front.
    pub transform: DAffine3,
    /// Replaces the material of every face.
    pub material: Option<MaterialId>,
    /// The node it hangs from.
    pub node: Option<NodeId>,
}

/// A source document, byte for byte.
#[derive(Clone, Debug, PartialEq)]
pub struct Source {
    /// Path as given.
    pub path: std::path::PathBuf,
    /// Its content.
    pub content: SourceContent,
}

/// What is kept of a source document.
#[derive(Clone, Debug, PartialEq)]
pub enum SourceContent {
    /// A glTF document: the JSON text as read and every buffer's bytes, in order.
    Gltf {
        /// JSON text, untouched.
        json: String,
        /// Buffers, resolved.
        buffers: Vec<std::sync::Arc<[u8]>>,
    },
    /// Another format: only the path is kept.
    Other,
}

impl Scene {
    /// An empty scene of some name.
    pub fn new(name: impl Into<String>) -> Self {
        Self { name: name.into(), ..Self::default() }
    }

    /// The material of a triangle (or of the whole of an exact shape, for which `primitive` is ignored).
    pub fn material_of(&self, instance: InstanceId, primitive: u32) -> Option<MaterialId> {
        let instance = &self.instances[instance.index()];
        instance.material.or_else(|| match instance.geometry {
            Geometry::Mesh(mesh) => self.meshes[mesh.index()].material_of(primitive),
            Geometry::Sphere | Geometry::Disc => None,
        })
    }

    /// Turns and scales the whole scene: `rotation` is orthonormal, `scale` above zero. Lengths that are part of a light (falloff, range) are
    /// scaled too; intensities and radiances keep their numbers.
    pub fn transform(&mut self, rotation: DMat3, scale: f64) {
        let map = DAffine3::from_mat3(rotation * scale);
        self.from_file = map * self.from_file;
        for instance in &mut self.instances {
            instance.transform = map * instance.transform;
        }
        for camera in &mut self.cameras {
            camera.position = map.transform_point3(camera.position);
            camera.basis = rotation * camera.basis;
            if let Projection::Orthographic { height } = &mut camera.projection {
                *height *= scale;
            }
            if let Some(lens) = &mut camera.lens {
                lens.aperture *= scale;
                lens.focus_distance *= scale;
            }
        }
        let stretch = |a: &mut Attenuation, range: &mut f64| {
            *range *= scale;
            a.c2 /= scale;
            a.c3 /= scale * scale;
        };
        for light in &mut self.lights {
            match &mut light.kind {
                LightKind::Ambient => {}
                LightKind::Point { position, attenuation, range, .. } => {
                    *position = map.transform_point3(*position);
                    stretch(attenuation, range);
                }
                LightKind::Spot { position, axis, attenuation, range, .. } => {
                    *position = map.transform_point3(*position);
                    *axis = rotation * *axis;
                    stretch(attenuation, range);
                }
                LightKind::Distant { to_light, .. } => *to_light = rotation * *to_light,
                LightKind::Hemispherical { axis, .. } => *axis = rotation * *axis,
                LightKind::Discrete { directions } => {
                    directions.iter_mut().for_each(|d| d.to_light = rotation * d.to_light);
                }
            }
        }
        for material in &mut self.materials {
            match &mut material.model {
                Model::Phong(m) => m.absorption = m.absorption / scale as f32,
                Model::MetallicRoughness(m) => m.absorption = m.absorption / scale as f32,
                Model::CookTorrance(m) => {
                    m.behind.iter_mut().for_each(|behind| behind.absorption = behind.absorption / scale as f32)
                }
            }
            material.inside.rescale(scale as f32);
        }
        self.medium.iter_mut().for_each(|medium| medium.rescale(scale as f32));
        if let Some(environment) = &mut self.environment {
            environment.rotation = crate::math::DQuat::from_mat3(&rotation) * environment.rotation;
        }
    }

    /// Somewhere light is scattered or emitted between surfaces, or the space around bodies takes some away: what path tracing alone knows.
    pub fn has_media(&self) -> bool {
        self.medium.is_some_and(|medium| !medium.is_clear())
            || self.materials.iter().any(|m| m.medium().is_some_and(|medium| medium.inside.is_seen()))
    }

    /// Sets how every texture is read between its texels, whatever its source says.
    pub fn set_texture_filter(&mut self, filter: Filter) {
        self.textures.iter_mut().for_each(|t| t.sampler.filter = filter);
    }

    /// Makes everything that light passes straight through opaque: blended alpha counts as whole, glass transmits nothing. Masks stay.
    pub fn remove_transparency(&mut self) {
        for material in &mut self.materials {
            if material.alpha.mode == AlphaMode::Blend {
                material.alpha.mode = AlphaMode::Opaque;
            }
            match &mut material.model {
                Model::Phong(m) => m.transmission = Spectrum::BLACK,
                Model::MetallicRoughness(m) => m.transmission.factor = 0.0,
                Model::CookTorrance(_) => {}
            }
        }
    }

    /// Number of triangles counting every placed mesh; exact shapes count one.
    pub fn n_primitives(&self) -> u64 {
        self.instances
            .iter()
            .map(|instance| match instance.geometry {
                Geometry::Mesh(mesh) => self.meshes[mesh.index()].triangles.len() as u64,
                Geometry::Sphere | Geometry::Disc => 1,
            })
            .sum()
    }

    /// Smallest and largest corner of everything placed, `None` when nothing finite is.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let mut bounds: Option<(DVec3, DVec3)> = None;
        let mut add = |p: DVec3| {
            if p.is_finite() {
                bounds = Some(bounds.map_or((p, p), |(lo, hi)| (lo.min(p), hi.max(p))));
            }
        };
        for instance in &self.instances {
            let t = &instance.transform;
            match instance.geometry {
                Geometry::Mesh(mesh) => {
                    let mesh = &self.meshes[mesh.index()];
                    // Only what faces use: stray vertices must not move the camera.
                    for &i in mesh.triangles.iter().flatten() {
                        add(t.transform_point3(mesh.positions[i as usize]));
                    }
                }
                Geometry::Sphere | Geometry::Disc => {
                    // Half extents of a transformed unit ball are the row lengths of the matrix; a disc has no y column.
                    let m = t.matrix3;
                    let y = if instance.geometry == Geometry::Sphere { m.y_axis } else { DVec3::ZERO };
                    let half = DVec3::from_array(std::array::from_fn(|i| {
                        (m.x_axis[i] * m.x_axis[i] + y[i] * y[i] + m.z_axis[i] * m.z_axis[i]).sqrt()
                    }));
                    add(t.translation - half);
                    add(t.translation + half);
                }
            }
        }
        bounds
    }
}
