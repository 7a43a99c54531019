//! The triangles of a world as OpenGL wants them: one list of vertices, indices sorted by material and placed object.

use std::collections::HashMap;
use std::error::Error;
use std::ops::Range;

use radiosa::accel::Shape;
use radiosa::math::{Bounds, DMat3, DVec3, Vec2, Vec3};
use radiosa::scanline::Interpolation;
use radiosa::scene::{Geometry, InstanceId, MaterialId, Mesh, Model, TextureRef};
use radiosa::transport::World;

/// Numbers a vertex has: position, normal, texture coordinates, and, shaded flat, the point where it is lit.
pub fn stride(interpolation: Interpolation) -> usize {
    if interpolation == Interpolation::Flat { 11 } else { 8 }
}

/// What is uploaded.
#[derive(Default)]
pub struct Buffers {
    /// [`stride`] numbers each, world coordinates.
    pub vertices: Vec<f32>,
    pub n_vertices: u32,
    pub indices: Vec<u32>,
    /// Sorted by material.
    pub batches: Vec<Batch>,
}

/// Triangles of one material and one placed object.
pub struct Batch {
    pub material: Option<MaterialId>,
    /// Of the indices.
    pub range: Range<usize>,
    pub bounds: Bounds,
}

/// The texture of the diffuse or base colour, the only one that is drawn.
pub fn texture_of(world: &World, material: Option<MaterialId>) -> Option<TextureRef> {
    match &world.material(material).model {
        Model::Phong(m) => m.diffuse.texture,
        Model::CookTorrance(m) => m.diffuse.texture,
        Model::MetallicRoughness(m) => m.base_color.texture,
    }
}

impl Buffers {
    /// All triangles of a world. Shaded flat, every triangle has a last vertex of its own, which holds its normal and middle; otherwise vertices are shared
    /// wherever they are in the source.
    pub fn new(world: &World, interpolation: Interpolation) -> Result<Self, Box<dyn Error>> {
        let mut sorted: Vec<(Option<MaterialId>, usize, Vec<u32>)> = Vec::new();
        let mut buffers = Self::default();
        let stride = stride(interpolation);
        let geometry = world.accel().geometry();
        for (i, placed) in geometry.placed.iter().enumerate() {
            let id = InstanceId(i as u32);
            let instance = &world.scene().instances[i];
            let (Shape::Mesh { positions, triangles }, Geometry::Mesh(mesh)) =
                (&geometry.shapes[placed.shape as usize], instance.geometry)
            else {
                return Err("exact spheres and discs are not drawn here".into());
            };
            let mesh = &world.scene().meshes[mesh.index()];
            if mesh.colors.is_some() || (mesh.polygons.is_some() && interpolation == Interpolation::Flat) {
                return Err("vertex colours, and flat faces of several triangles, are not drawn here".into());
            }
            let positions: Vec<Vec3> = positions.iter().map(|p| placed.to_world.map_or(*p, |m| m.transform_point3(*p))).collect();
            let mut by_material: HashMap<Option<MaterialId>, Vec<u32>> = HashMap::new();
            for primitive in 0..triangles.len() as u32 {
                by_material.entry(world.scene().material_of(id, primitive)).or_default().push(primitive);
            }
            for (material, primitives) in by_material {
                let part = Part {
                    mesh,
                    positions: &positions,
                    triangles,
                    normals: Normals::of(instance.transform.matrix3),
                    map: texture_of(world, material),
                };
                let mut indices = Vec::with_capacity(3 * primitives.len());
                if interpolation == Interpolation::Flat {
                    part.flat(&primitives, &mut buffers, &mut indices);
                } else {
                    part.smooth(&primitives, &mut buffers, &mut indices);
                }
                sorted.push((material, i, indices));
            }
        }
        sorted.sort_by_key(|(material, instance, _)| (*material, *instance));
        for (material, _, indices) in sorted {
            let first = buffers.indices.len();
            let at = |&i: &u32| Vec3::from_slice(&buffers.vertices[stride * i as usize..]);
            let bounds = Bounds::of(indices.iter().map(at));
            buffers.indices.extend(indices);
            buffers.batches.push(Batch { material, range: first..buffers.indices.len(), bounds });
        }
        Ok(buffers)
    }
}

/// Carries normals of an object to world coordinates.
struct Normals {
    map: DMat3,
    is_mirrored: bool,
}

impl Normals {
    fn of(m: DMat3) -> Self {
        let cofactor = DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis));
        let is_mirrored = m.determinant() < 0.0;
        Self { map: if is_mirrored { cofactor * -1.0 } else { cofactor }, is_mirrored }
    }
}

/// The triangles of one object that have one material.
struct Part<'a> {
    mesh: &'a Mesh,
    /// World coordinates.
    positions: &'a [Vec3],
    triangles: &'a [[u32; 3]],
    normals: Normals,
    map: Option<TextureRef>,
}

impl Part<'_> {
    /// Counter-clockwise seen from the front.
    fn corners(&self, primitive: u32) -> [u32; 3] {
        let [a, b, c] = self.triangles[primitive as usize];
        if self.normals.is_mirrored { [a, c, b] } else { [a, b, c] }
    }

    fn face_normal(&self, corners: [u32; 3]) -> Option<Vec3> {
        let [a, b, c]: [DVec3; 3] = corners.map(|i| self.positions[i as usize].as_dvec3());
        (b - a).cross(c - a).try_normalize().map(|n| n.as_vec3())
    }

    fn uv(&self, i: u32) -> Vec2 {
        self.map.map_or(Vec2::ZERO, |map| {
            let uv = self.mesh.uvs.get(map.uv_set as usize).map_or(Vec2::ZERO, |uvs| uvs[i as usize]);
            map.transform.map_or(uv, |t| t.apply(uv))
        })
    }

    fn push(&self, i: u32, n: Vec3, lit_at: Option<Vec3>, buffers: &mut Buffers) -> u32 {
        let (p, uv) = (self.positions[i as usize], self.uv(i));
        buffers.vertices.extend([p.x, p.y, p.z, n.x, n.y, n.z, uv.x, uv.y]);
        buffers.vertices.extend(lit_at.iter().flat_map(|p| p.to_array()));
        buffers.n_vertices += 1;
        buffers.n_vertices - 1
    }

    /// Vertex normals on the side of the face, as our surfaces have them. A vertex is used again for every face that wants the same of it.
    fn smooth(&self, primitives: &[u32], buffers: &mut Buffers, indices: &mut Vec<u32>) {
        let mut known: HashMap<(u32, [u32; 3]), u32> = HashMap::new();
        for &primitive in primitives {
            let corners = self.corners(primitive);
            let Some(ng) = self.face_normal(corners) else { continue };
            let own = |i: u32| {
                let n = self.mesh.normals.as_ref()?[i as usize];
                (self.normals.map * n.as_dvec3()).try_normalize().map(|n| n.as_vec3())
            };
            let normals = corners.map(|i| own(i).unwrap_or(ng));
            let against = normals.iter().sum::<Vec3>().dot(ng) < 0.0;
            for (i, n) in corners.into_iter().zip(normals) {
                let n = if against { -n } else { n };
                let key = (i, n.to_array().map(f32::to_bits));
                let vertex = *known.entry(key).or_insert_with(|| self.push(i, n, None, buffers));
                indices.push(vertex);
            }
        }
    }

    /// The last vertex of each face speaks for it. The other two may be the last ones of other faces, so that no more vertices are lit than there are faces
    /// or vertices.
    fn flat(&self, primitives: &[u32], buffers: &mut Buffers, indices: &mut Vec<u32>) {
        let mut known: HashMap<u32, u32> = HashMap::new();
        let faces = || {
            primitives.iter().filter_map(|&primitive| {
                let corners = self.corners(primitive);
                Some((corners, self.face_normal(corners)?))
            })
        };
        // The face's own vertex at the corner that no face has spoken for yet, so that most corners are somebody's.
        let mut turned = Vec::new();
        for (corners, ng) in faces() {
            let k = (0..3).find(|&k| !known.contains_key(&corners[k])).unwrap_or(0);
            let corners = [corners[(k + 1) % 3], corners[(k + 2) % 3], corners[k]];
            let middle = corners.map(|i| self.positions[i as usize]).iter().sum::<Vec3>() / 3.0;
            let own = self.push(corners[2], ng, Some(middle), buffers);
            known.insert(corners[2], own);
            turned.push((corners, ng, middle, own));
        }
        for (corners, ng, middle, own) in turned {
            for i in [corners[0], corners[1]] {
                let vertex = *known.entry(i).or_insert_with(|| self.push(i, ng, Some(middle), buffers));
                indices.push(vertex);
            }
            indices.push(own);
        }
    }
}
