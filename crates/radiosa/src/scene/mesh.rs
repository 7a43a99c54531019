//! Triangle meshes that remember the faces they came from.

use super::MaterialId;
use crate::math::{DVec3, Vec2, Vec3, Vec4};

/// Triangles over shared vertices, in columns. All per-vertex columns that are present have the length of `positions`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Name in the source.
    pub name: String,
    /// Vertex positions.
    pub positions: Vec<DVec3>,
    /// Vertex normals, unit length (zero where the source gave none that is usable); `None`: faces are flat.
    pub normals: Option<Vec<Vec3>>,
    /// Vertex tangents: xyz unit, w = ±1 the sign of the bitangent `w (n × t)`.
    pub tangents: Option<Vec<Vec4>>,
    /// Texture coordinate sets, `v` as in the source's own convention turned to: (0, 0) is the top left of the picture.
    pub uvs: Vec<Vec<Vec2>>,
    /// Vertex colours, linear RGBA; multiply the diffuse or base colour.
    pub colors: Option<Vec<Vec4>>,
    /// Vertex indices, counter-clockwise seen from the front, in the order of the source.
    pub triangles: Vec<[u32; 3]>,
    /// Material of each triangle: empty (none has one), one entry (all share it), or one for each triangle.
    pub materials: Vec<Option<MaterialId>>,
    /// The source's n-gons; `None` when each triangle is a face of its own.
    pub polygons: Option<Polygons>,
    /// Where in the source it was.
    pub source: Option<MeshSource>,
}

/// The faces a mesh had before triangulation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Polygons {
    /// Polygon `i` has the vertices `vertices[offsets[i]..offsets[i + 1]]`; starts with 0.
    pub offsets: Vec<u32>,
    /// Vertex indices of all polygons in the order of the source; keyholes (repeated vertices) are kept.
    pub vertices: Vec<u32>,
    /// Polygon of each triangle.
    pub of_triangle: Vec<u32>,
}

/// Position of a mesh in its source file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MeshSource {
    /// Index into [`super::Scene::sources`].
    pub file: u32,
    /// glTF mesh, or ordinal of the OBJ object/group.
    pub mesh: u32,
    /// glTF primitive within it; 0 otherwise.
    pub primitive: u32,
}

impl Mesh {
    /// The material of triangle `primitive`, if it has one.
    pub fn material_of(&self, primitive: u32) -> Option<MaterialId> {
        match self.materials.as_slice() {
            [] => None,
            [one] => *one,
            many => many[primitive as usize],
        }
    }

    /// The source face triangle `primitive` belongs to.
    pub fn polygon_of(&self, primitive: u32) -> u32 {
        self.polygons.as_ref().map_or(primitive, |p| p.of_triangle[primitive as usize])
    }
}
