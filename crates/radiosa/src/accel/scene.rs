//! From a scene's geometry to its trees: one over everything in world coordinates, one for each mesh that stands under transforms.

use super::build::{self, Source};
use super::bvh::Bvh;
use super::object::Object;
use super::{Geometry, Shape};
use crate::math::{Bounds, Vec3};

/// What `Accel` keeps beside the geometry.
pub(super) struct Trees {
    pub tree: Bvh,
    pub objects: Vec<Object>,
    pub shape_trees: Vec<Option<Bvh>>,
    pub bounds: Bounds,
}

/// Builds all trees.
pub(super) fn build(geometry: &Geometry) -> Trees {
    let mut is_shared = vec![false; geometry.shapes.len()];
    for placed in geometry.placed.iter().filter(|p| p.to_world.is_some()) {
        if let Some(shared) = is_shared.get_mut(placed.shape as usize) {
            *shared = true;
        }
    }
    let shape_trees: Vec<Option<Bvh>> = geometry
        .shapes
        .iter()
        .zip(&is_shared)
        .map(|(shape, &shared)| match shape {
            Shape::Mesh { positions, triangles } if shared => {
                let mut alone = Triangles::default();
                alone.push(Mesh::new(0, positions, triangles));
                Some(build::build(&alone))
            }
            _ => None,
        })
        .collect();
    let mut world = Triangles::default();
    let mut objects = Vec::new();
    for (instance, placed) in geometry.placed.iter().enumerate() {
        let Some(shape) = geometry.shapes.get(placed.shape as usize) else { continue };
        let unit = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
        let local = match (shape, placed.to_world) {
            (Shape::Mesh { positions, triangles }, None) => {
                world.push(Mesh::new(instance as u32, positions, triangles));
                continue;
            }
            (Shape::Mesh { .. }, Some(_)) => shape_trees[placed.shape as usize].as_ref().map_or(Bounds::EMPTY, |t| t.bounds),
            (Shape::Sphere, _) => unit,
            (Shape::Disc, _) => Bounds { min: unit.min.with_y(0.0), max: unit.max.with_y(0.0) },
        };
        if let Some((object, bounds)) = Object::new(instance as u32, placed, shape, &local) {
            objects.push(object);
            world.objects.push(bounds);
        }
    }
    let tree = build::build(&world);
    Trees { bounds: tree.bounds, tree, objects, shape_trees }
}

/// A mesh's part of a tree.
struct Mesh<'a> {
    instance: u32,
    positions: &'a [Vec3],
    triangles: &'a [[u32; 3]],
}

impl<'a> Mesh<'a> {
    fn new(instance: u32, positions: &'a [Vec3], triangles: &'a [[u32; 3]]) -> Self {
        Self { instance, positions, triangles }
    }
}

/// Meshes one after the other.
#[derive(Default)]
struct Triangles<'a> {
    meshes: Vec<Mesh<'a>>,
    /// Triangles before each mesh.
    first: Vec<usize>,
    total: usize,
    objects: Vec<Bounds>,
}

impl<'a> Triangles<'a> {
    fn push(&mut self, mesh: Mesh<'a>) {
        self.first.push(self.total);
        self.total += mesh.triangles.len();
        self.meshes.push(mesh);
    }

    fn find(&self, triangle: usize) -> (&Mesh<'a>, usize) {
        let i = self.first.partition_point(|&f| f <= triangle) - 1;
        (&self.meshes[i], triangle - self.first[i])
    }
}

impl Source for Triangles<'_> {
    fn triangles(&self) -> usize {
        self.total
    }

    fn vertices(&self, triangle: usize) -> [Vec3; 3] {
        let (mesh, i) = self.find(triangle);
        // NaN for a vertex that is not there: such a triangle is left out.
        mesh.triangles[i].map(|v| mesh.positions.get(v as usize).copied().unwrap_or(Vec3::NAN))
    }

    fn ids(&self, triangle: usize) -> (u32, u32) {
        let (mesh, i) = self.find(triangle);
        (mesh.instance, i as u32)
    }

    fn objects(&self) -> &[Bounds] {
        &self.objects
    }
}
