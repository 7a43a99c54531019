//! A face that is seen in a tile, ready to be interpolated.
//!
//! Perspective-correct interpolation [Olano97]: with the vertices in homogeneous picture coordinates `V_i = (x_i, y_i, w_i)`, the functions
//! `e_i(x, y) = (V_j × V_k)·(x, y, 1)/det(V)` are linear over the picture, and the barycentric weights are `b_i = e_i/Σ e`. It works for vertices
//! behind the eye as well, so clipped faces need no new attributes.

use super::surfaces::{Faces, Surfaces};
use crate::math::{DVec3, Vec3};
use crate::raster::Projection;
use crate::scene::{Geometry, InstanceId, MaterialId};
use crate::transport::{Surface, World};

/// One face.
#[derive(Clone, Debug)]
pub(super) struct Facet {
    /// By vertex: `e = a x + b y + c`, x and y in pixels from the corner of the tile.
    weights: [[f32; 3]; 3],
    positions: [Vec3; 3],
    /// At the vertices, on the front side, of any common length; `None` where the face is flat.
    normals: Option<[Vec3; 3]>,
    /// Unit, front.
    ng: Vec3,
    instance: InstanceId,
    primitive: u32,
    is_exact_shape: bool,
    /// Of the face of a tessellation it is a part of.
    middle: Option<Vec3>,
    material: Option<MaterialId>,
    /// Number of the light at its first vertex, or of its only one, among all that was computed; `None` until then.
    pub(super) lit_as: Option<u32>,
}

/// Vertices of a source face whose mean is its middle: enough for every ordinary face, and few enough for odd ones of thousands.
const MEAN_OF: usize = 16;

impl Facet {
    /// Face number `face` of all; `corner` is the first pixel of the tile, from the middle of the picture.
    pub(super) fn new(world: &World, surfaces: &Surfaces, projection: &Projection, face: u32, corner: [f64; 2]) -> Self {
        let faces = surfaces.part_of(world, face);
        let own = face - faces.first;
        let tri = faces.triangles[own as usize];
        let primitive = if faces.is_exact_shape { 0 } else { own };
        let positions = tri.map(|i| faces.vertex(i));
        let instance = faces.instance;
        let wide = positions.map(|p| p.as_dvec3());
        let cross = (wide[1] - wide[0]).cross(wide[2] - wide[0]);
        let ng = if world.is_mirrored(instance) { -cross } else { cross };
        let ng = ng.try_normalize().unwrap_or(-projection.forward()).as_vec3();
        Self {
            weights: weights(projection, &positions, corner),
            positions,
            normals: vertex_normals(world, &faces, tri),
            ng,
            instance,
            primitive,
            is_exact_shape: faces.is_exact_shape,
            middle: surfaces.middle(&faces, own),
            material: world.scene().material_of(instance, primitive),
            lit_as: None,
        }
    }

    /// The barycentric weights of the point seen at `(x, y)`, pixels from the corner of the tile; of its rim, where rounding put it just outside.
    pub(super) fn at(&self, x: f32, y: f32) -> [f32; 3] {
        let e = self.weights.map(|[a, b, c]| (a * x + b * y + c).max(0.0));
        let sum = e[0] + e[1] + e[2];
        if sum > 0.0 && sum.is_finite() { e.map(|e| e / sum) } else { [1.0 / 3.0; 3] }
    }

    /// The point of those weights, with the normal interpolated from the vertices, or the face's own when `is_flat`.
    pub(super) fn surface(&self, world: &World, weights: [f32; 3], is_flat: bool) -> Surface {
        let mix = |v: &[Vec3; 3]| v[0] * weights[0] + v[1] * weights[1] + v[2] * weights[2];
        let p = mix(&self.positions);
        let n = match &self.normals {
            Some(normals) if !is_flat => {
                mix(normals).try_normalize().map_or(self.ng, |n| if n.dot(self.ng) < 0.0 { -n } else { n })
            }
            _ => self.ng,
        };
        let local = if self.is_exact_shape { self.exact_local(world, p) } else { Vec3::ZERO };
        let barycentric = if self.is_exact_shape { [0.0; 3] } else { weights };
        Surface {
            p,
            // Nothing starts from a point that was scan converted.
            p_error: Vec3::ZERO,
            ng: self.ng,
            n,
            instance: self.instance,
            primitive: self.primitive,
            weights: barycentric,
            local,
            material: self.material,
            width: 0.0,
        }
    }

    /// Where the one light of a face that is shaded flat is computed: the middle of the face it had in its source.
    pub(super) fn middle(&self, world: &World) -> Surface {
        let surface = self.surface(world, [1.0 / 3.0; 3], true);
        if let Some(p) = self.middle {
            return Surface { p, ..surface };
        }
        let Geometry::Mesh(mesh) = world.scene().instances[self.instance.index()].geometry else { return surface };
        let mesh = &world.scene().meshes[mesh.index()];
        let Some(polygons) = &mesh.polygons else { return surface };
        let face = polygons.of_triangle[self.primitive as usize] as usize;
        let vertices = &polygons.vertices[polygons.offsets[face] as usize..polygons.offsets[face + 1] as usize];
        let (placed, transform) = (vertices.iter().take(MEAN_OF), world.scene().instances[self.instance.index()].transform);
        let sum: DVec3 = placed.map(|&v| transform.transform_point3(mesh.positions[v as usize]) - world.origin()).sum();
        Surface { p: (sum / vertices.len().clamp(1, MEAN_OF) as f64).as_vec3(), ..surface }
    }

    /// The point of the exact shape that a point of its tessellation stands for, in its own coordinates: textures are mapped by it.
    fn exact_local(&self, world: &World, p: Vec3) -> Vec3 {
        let local = world.to_local(self.instance).transform_point3(p.as_dvec3());
        let is_sphere = world.scene().instances[self.instance.index()].geometry == Geometry::Sphere;
        let local = if is_sphere { local.try_normalize().unwrap_or(DVec3::Y) } else { DVec3::new(local.x, 0.0, local.z) };
        local.as_vec3()
    }
}

fn weights(projection: &Projection, positions: &[Vec3; 3], corner: [f64; 2]) -> [[f32; 3]; 3] {
    let v = positions.map(|p| projection.project(p).xyw());
    let cross = [v[1].cross(v[2]), v[2].cross(v[0]), v[0].cross(v[1])];
    let determinant = v[0].dot(cross[0]);
    cross.map(|c| {
        // Of any common length: only ratios count, so the sign is all that must be right.
        let c = if determinant == 0.0 { c } else { c / determinant };
        [c.x as f32, c.y as f32, (c.x * corner[0] + c.y * corner[1] + c.z) as f32]
    })
}

/// The vertex normals in world coordinates; `None` where there are none that are usable.
fn vertex_normals(world: &World, faces: &Faces<'_>, tri: [u32; 3]) -> Option<[Vec3; 3]> {
    let own: [Vec3; 3] = if faces.is_exact_shape {
        tri.map(|i| faces.exact_normal(i))
    } else {
        let Geometry::Mesh(mesh) = world.scene().instances[faces.instance.index()].geometry else { return None };
        let normals = world.scene().meshes[mesh.index()].normals.as_ref()?;
        tri.map(|i| normals[i as usize])
    };
    let moved = own.map(|n| world.normal_to_world(faces.instance, n.as_dvec3()));
    // One length for all three: the transform's own ratios between them are what interpolates as the surface does.
    let length = moved.iter().map(|n| n.length()).fold(0.0, f64::max);
    (length > 0.0 && length.is_finite()).then(|| moved.map(|n| (n / length).as_vec3()))
}
