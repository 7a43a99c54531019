//! The scene made ready for light: recentred, in f32, with ray queries over it.

use std::collections::HashMap;

use super::Surface;
use crate::accel::{self, Accel, Placed, Shape};
use crate::bsdf::texture::Pyramid;
use crate::emitter::{area::EmissiveSurface, environment::Sky};
use crate::math::{Affine3A, CpuPath, DAffine3, DVec3, Vec3};
use crate::scene::{AlphaMode, Geometry, InstanceId, MaterialId, Scene, SceneError, TextureId};

/// Meshes placed more than once are copied into world coordinates while the scene stays below this many triangles: one
/// tree is faster than a tree of trees, and 8 M triangles cost about 1 GB.
const FLATTEN_LIMIT: u64 = 8_000_000;

/// Scenes wider than this are refused: products of three lengths would leave the range of f32.
const MAX_EXTENT: f64 = 1e12;

/// A scene prepared for light transport: immutable, shared by every thread and every method.
///
/// World coordinates are scene coordinates minus [`World::origin`], rounded to f32 once.
#[derive(Debug)]
pub struct World {
    scene: Scene,
    origin: DVec3,
    accel: Accel,
    instances: Vec<InstanceInfo>,
    cpu_path: CpuPath,
    default_material: crate::scene::Material,
    emissive: Vec<EmissiveSurface>,
    sky: Option<Sky>,
    has_masks: bool,
    /// By texture: its smaller copies, where its filter wants them.
    pyramids: Vec<Option<Pyramid>>,
    /// By material: light may pass it.
    transparent: Vec<bool>,
    has_transparency: bool,
    /// The file's coordinates are the scene's.
    in_file: bool,
}

#[derive(Debug)]
struct InstanceInfo {
    mirrored: bool,
    to_local: DAffine3,
    normal: glam::DMat3,
    /// `normal` keeps unit vectors unit.
    is_similarity: bool,
}

impl World {
    /// Recentres the scene and builds the ray queries.
    ///
    /// # Errors
    /// When the scene is not valid ([`Scene::validate`]).
    pub fn prepare(scene: Scene, cpu_path: CpuPath) -> Result<Self, SceneError> {
        Self::prepare_around(scene, cpu_path, None)
    }

    /// The same around the origin of another world, so that places are the same in both.
    ///
    /// # Errors
    /// When the scene is not valid ([`Scene::validate`]).
    pub fn prepare_around(scene: Scene, cpu_path: CpuPath, origin: Option<DVec3>) -> Result<Self, SceneError> {
        scene.validate()?;
        let (lo, hi) = scene.bounds().unwrap_or_default();
        let extent = (hi - lo).max_element();
        if extent.is_nan() || extent > MAX_EXTENT {
            return Err(SceneError::TooWide { extent, limit: MAX_EXTENT });
        }
        let origin = origin.unwrap_or_else(|| recentre(lo, hi));
        let mut placements: HashMap<u32, u64> = HashMap::new();
        for instance in &scene.instances {
            if let Geometry::Mesh(mesh) = instance.geometry {
                *placements.entry(mesh.0).or_default() += 1;
            }
        }
        let flatten_all = scene.n_primitives() <= FLATTEN_LIMIT;
        let mut geometry = accel::Geometry::default();
        let mut shared: HashMap<u32, u32> = HashMap::new();
        let mut exact = [None; 2];
        for instance in &scene.instances {
            let mut add = |shape: Shape| {
                geometry.shapes.push(shape);
                geometry.shapes.len() as u32 - 1
            };
            let in_world = |t: &DAffine3| {
                let moved = DAffine3::from_mat3_translation(t.matrix3, t.translation - origin);
                Affine3A::from_mat3_translation(moved.matrix3.as_mat3(), moved.translation.as_vec3())
            };
            let placed = match instance.geometry {
                Geometry::Mesh(id) => {
                    let mesh = &scene.meshes[id.index()];
                    if flatten_all || placements[&id.0] == 1 {
                        let to_world = |p: &DVec3| (instance.transform.transform_point3(*p) - origin).as_vec3();
                        let positions = mesh.positions.iter().map(to_world).collect();
                        Placed { shape: add(Shape::Mesh { positions, triangles: mesh.triangles.clone() }), to_world: None }
                    } else {
                        let shape = *shared.entry(id.0).or_insert_with(|| {
                            let positions = mesh.positions.iter().map(|p| p.as_vec3()).collect();
                            add(Shape::Mesh { positions, triangles: mesh.triangles.clone() })
                        });
                        Placed { shape, to_world: Some(in_world(&instance.transform)) }
                    }
                }
                Geometry::Sphere => {
                    let shape = *exact[0].get_or_insert_with(|| add(Shape::Sphere));
                    Placed { shape, to_world: Some(in_world(&instance.transform)) }
                }
                Geometry::Disc => {
                    let shape = *exact[1].get_or_insert_with(|| add(Shape::Disc));
                    Placed { shape, to_world: Some(in_world(&instance.transform)) }
                }
            };
            geometry.placed.push(placed);
        }
        let instances = scene
            .instances
            .iter()
            .map(|instance| {
                let t = DAffine3::from_mat3_translation(instance.transform.matrix3, instance.transform.translation - origin);
                let m = t.matrix3;
                // The cofactor matrix carries normals without dividing by the determinant, so flat transforms do no harm.
                let cofactor =
                    glam::DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis));
                let determinant = m.determinant();
                let mirrored = determinant < 0.0;
                // Of a similarity the cofactors are the scale's square times a rotation.
                let scale_2 = m.x_axis.length_squared();
                let rotation = cofactor * (1.0 / scale_2);
                let is_similarity = (rotation.transpose() * rotation).abs_diff_eq(glam::DMat3::IDENTITY, 1e-9);
                let cofactor = if is_similarity { rotation } else { cofactor };
                InstanceInfo {
                    mirrored,
                    is_similarity,
                    to_local: if determinant == 0.0 { DAffine3::IDENTITY } else { t.inverse() },
                    normal: if mirrored { cofactor * -1.0 } else { cofactor },
                }
            })
            .collect();
        let cpu_path = cpu_path.available();
        let accel = Accel::build(geometry, cpu_path);
        let has_masks = scene.materials.iter().any(|m| matches!(m.alpha.mode, AlphaMode::Mask { .. }));
        let transparent: Vec<bool> = scene.materials.iter().map(|m| m.transmits() || m.alpha.mode != AlphaMode::Opaque).collect();
        let pyramids = scene.textures.iter().map(|t| Pyramid::of_texture(t, &scene.images)).collect();
        let sky = scene.environment.as_ref().map(|e| Sky::new(e, &scene.images));
        let in_file = scene.from_file == DAffine3::IDENTITY;
        let mut world = Self {
            scene,
            origin,
            accel,
            instances,
            cpu_path,
            default_material: Default::default(),
            emissive: Vec::new(),
            sky,
            has_masks,
            pyramids,
            has_transparency: transparent.contains(&true),
            transparent,
            in_file,
        };
        world.emissive = world.collect_emissive();
        Ok(world)
    }

    /// The scene it was made from.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// What was subtracted from scene coordinates.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// A point and a unit direction of the world in the coordinates of the input file, and the length of its unit in metres. Everything written
    /// out is in these.
    pub fn to_file(&self, p: Vec3, n: Vec3) -> (Vec3, Vec3, f32) {
        if self.in_file {
            return ((p.as_dvec3() + self.origin).as_vec3(), n, 1.0);
        }
        let metres = libm::cbrt(self.scene.from_file.matrix3.determinant().abs());
        let inverse = self.scene.from_file.inverse();
        let position = inverse.transform_point3(p.as_dvec3() + self.origin).as_vec3();
        (position, (inverse.transform_vector3(n.as_dvec3()) * metres).as_vec3(), metres as f32)
    }

    /// The ray queries.
    pub fn accel(&self) -> &Accel {
        &self.accel
    }

    /// The code path of its kernels.
    pub fn cpu_path(&self) -> CpuPath {
        self.cpu_path
    }

    /// The material of a surface.
    pub fn material(&self, id: Option<MaterialId>) -> &crate::scene::Material {
        id.map_or(&self.default_material, |id| &self.scene.materials[id.index()])
    }

    /// The material of a point.
    pub fn material_at(&self, surface: &Surface) -> &crate::scene::Material {
        self.material(surface.material)
    }

    /// Every placed primitive that emits, in the order of the scene.
    pub fn emissive(&self) -> &[EmissiveSurface] {
        &self.emissive
    }

    /// The prepared environment.
    pub fn sky(&self) -> Option<&Sky> {
        self.sky.as_ref()
    }

    pub(crate) fn pyramid(&self, id: TextureId) -> Option<&Pyramid> {
        self.pyramids[id.index()].as_ref()
    }

    pub(crate) fn has_masks(&self) -> bool {
        self.has_masks
    }

    pub(crate) fn has_transparency(&self) -> bool {
        self.has_transparency
    }

    pub(crate) fn may_be_transparent(&self, id: Option<MaterialId>) -> bool {
        id.is_some_and(|id| self.transparent[id.index()])
    }

    pub(crate) fn is_mirrored(&self, id: InstanceId) -> bool {
        self.instances[id.index()].mirrored
    }

    pub(crate) fn to_local(&self, id: InstanceId) -> &DAffine3 {
        &self.instances[id.index()].to_local
    }

    /// A front normal, of any length, from an instance's to world coordinates.
    pub(crate) fn normal_to_world(&self, id: InstanceId, n: DVec3) -> DVec3 {
        self.instances[id.index()].normal * n
    }

    /// A unit front normal, from an instance's to world coordinates; +y where its transform leaves nothing of it.
    pub(crate) fn unit_normal_to_world(&self, id: InstanceId, n: DVec3) -> Vec3 {
        let info = &self.instances[id.index()];
        let n = info.normal * n;
        if info.is_similarity { n.as_vec3() } else { n.try_normalize().unwrap_or(DVec3::Y).as_vec3() }
    }

    /// The vertex normals of a triangle in world coordinates; `None` where the mesh has none, or they are those of the flat triangle.
    pub(super) fn vertex_normals(&self, id: InstanceId, tri: [u32; 3]) -> Option<[Vec3; 3]> {
        let Geometry::Mesh(mesh) = self.scene.instances[id.index()].geometry else { return None };
        let normals = self.scene.meshes[mesh.index()].normals.as_ref()?;
        let own = tri.map(|i| normals[i as usize]);
        if own[0] == own[1] && own[1] == own[2] {
            return None;
        }
        Some(own.map(|n| self.normal_to_world(id, n.as_dvec3()).normalize_or_zero().as_vec3()))
    }

    /// The vertex normals of a triangle, interpolated; `None` where the mesh has none that is usable.
    pub(super) fn interpolated_normal(&self, id: InstanceId, tri: [u32; 3], weights: [f32; 3]) -> Option<Vec3> {
        let Geometry::Mesh(mesh) = self.scene.instances[id.index()].geometry else { return None };
        let normals = self.scene.meshes[mesh.index()].normals.as_ref()?;
        let [a, b, c] = tri.map(|i| normals[i as usize]);
        let n = a * weights[0] + b * weights[1] + c * weights[2];
        self.normal_to_world(id, n.as_dvec3()).try_normalize().map(|n| n.as_vec3()).filter(|n| n.is_finite())
    }
}

/// The middle of the scene, rounded so that subtracting it is exact for most coordinates; zero when the scene is around the origin already.
fn recentre(lo: DVec3, hi: DVec3) -> DVec3 {
    let (centre, size) = ((lo + hi) * 0.5, (hi - lo).max_element());
    if !centre.is_finite() || size <= 0.0 || centre.abs().max_element() <= size {
        return DVec3::ZERO;
    }
    // To a power of two near a hundredth of the size: coordinates in metres stay short numbers.
    let grain = libm::exp2(libm::floor(libm::log2(size / 64.0)));
    (centre / grain).round() * grain
}
