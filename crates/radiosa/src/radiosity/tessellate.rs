//! Exact shapes as meshes: radiosity needs planar patches.

use std::f64::consts::{PI, TAU};

use crate::math::polygon::area_vector;
use crate::math::{DVec3, Vec2, function};
use crate::scene::{Geometry, Mesh, MeshId, Polygons, Scene, SceneError};
use crate::transport::World;

/// Replaces every exact sphere by `segments` rings of twice as many quadrilaterals, every disc by a fan around rings of quadrilaterals. Vertices lie on the
/// shape, or, where it emits, so far outside that a round shape keeps its area and with it its power; normals and texture coordinates are the shape's own.
pub fn tessellate(scene: &mut Scene, segments: u32) {
    let segments = segments.clamp(2, 1024);
    let mut ids: [[Option<MeshId>; 2]; 2] = Default::default();
    for i in 0..scene.instances.len() {
        let (which, make, area): (usize, fn(u32) -> Mesh, f64) = match scene.instances[i].geometry {
            Geometry::Mesh(_) => continue,
            Geometry::Sphere => (0, sphere, 4.0 * PI),
            Geometry::Disc => (1, disc, PI),
        };
        let material = scene.instances[i].material.and_then(|id| scene.materials.get(id.index()));
        let emits = material.is_some_and(|material| material.is_emissive());
        let id = *ids[which][usize::from(emits)].get_or_insert_with(|| {
            let mut mesh = make(segments);
            if emits {
                let scale = (area / area_of(&mesh)).sqrt();
                mesh.positions.iter_mut().for_each(|p| *p *= scale);
            }
            scene.meshes.push(mesh);
            MeshId(scene.meshes.len() as u32 - 1)
        });
        scene.instances[i].geometry = Geometry::Mesh(id);
    }
}

/// Of all triangles.
fn area_of(mesh: &Mesh) -> f64 {
    mesh.triangles.iter().map(|t| area_vector(&t.map(|v| mesh.positions[v as usize])).length()).sum()
}

/// A world without exact shapes, where places are the same as in the one given; `None` when that has none itself.
///
/// # Errors
/// When the scene that comes out is not valid.
pub fn tessellated(world: &World, segments: u32) -> Result<Option<World>, SceneError> {
    if world.scene().instances.iter().all(|instance| matches!(instance.geometry, Geometry::Mesh(_))) {
        return Ok(None);
    }
    let mut scene = world.scene().clone();
    tessellate(&mut scene, segments);
    World::prepare_around(scene, world.cpu_path(), Some(world.origin())).map(Some)
}

/// A mesh that is filled face by face.
#[derive(Default)]
struct Builder {
    mesh: Mesh,
    uv: Vec<Vec2>,
    polygons: Polygons,
}

impl Builder {
    fn new() -> Self {
        let mut builder = Self::default();
        builder.mesh.normals = Some(Vec::new());
        builder.polygons.offsets.push(0);
        builder
    }

    fn vertex(&mut self, p: DVec3, n: DVec3, uv: [f64; 2]) -> u32 {
        self.mesh.positions.push(p);
        self.mesh.normals.get_or_insert_default().push(n.as_vec3());
        self.uv.push(Vec2::new(uv[0] as f32, uv[1] as f32));
        self.mesh.positions.len() as u32 - 1
    }

    /// Three or four corners, counter-clockwise.
    fn face(&mut self, corners: &[u32]) {
        let polygon = self.polygons.offsets.len() as u32 - 1;
        self.polygons.vertices.extend_from_slice(corners);
        self.polygons.offsets.push(self.polygons.vertices.len() as u32);
        for k in 2..corners.len() {
            self.mesh.triangles.push([corners[0], corners[k - 1], corners[k]]);
            self.polygons.of_triangle.push(polygon);
        }
    }

    fn finish(mut self, name: &str) -> Mesh {
        self.mesh.name = name.to_owned();
        self.mesh.uvs = vec![self.uv];
        self.mesh.polygons = Some(self.polygons);
        self.mesh
    }
}

/// The unit sphere; `u` is the longitude from +x towards +z, `v` the colatitude.
fn sphere(rings: u32) -> Mesh {
    let around = 2 * rings;
    let mut b = Builder::new();
    for ring in 0..=rings {
        let theta = PI * f64::from(ring) / f64::from(rings);
        let (y, r) = match ring {
            0 => (1.0, 0.0),
            _ if ring == rings => (-1.0, 0.0),
            _ => (function::cos_f64(theta), function::sin_f64(theta)),
        };
        for k in 0..=around {
            // The seam has two columns of vertices in one place.
            let phi = TAU * f64::from(k % around) / f64::from(around);
            let p = DVec3::new(r * function::cos_f64(phi), y, r * function::sin_f64(phi));
            let u = if r == 0.0 { f64::from(k) + 0.5 } else { f64::from(k) };
            b.vertex(p, p, [u / f64::from(around), f64::from(ring) / f64::from(rings)]);
        }
    }
    let at = |ring: u32, k: u32| ring * (around + 1) + k;
    for ring in 0..rings {
        for k in 0..around {
            let [a, c, d, e] = [at(ring, k), at(ring, k + 1), at(ring + 1, k + 1), at(ring + 1, k)];
            if ring == 0 {
                b.face(&[a, d, e]);
            } else if ring + 1 == rings {
                b.face(&[a, c, d]);
            } else {
                b.face(&[a, c, d, e]);
            }
        }
    }
    b.finish("sphere")
}

/// The unit disc in y = 0, facing +y.
fn disc(segments: u32) -> Mesh {
    let (around, rings) = (2 * segments, (segments / 2).max(1));
    let mut b = Builder::new();
    let uv = |p: DVec3| [(p.x + 1.0) * 0.5, (p.z + 1.0) * 0.5];
    b.vertex(DVec3::ZERO, DVec3::Y, uv(DVec3::ZERO));
    for ring in 1..=rings {
        let r = f64::from(ring) / f64::from(rings);
        for k in 0..around {
            let phi = TAU * f64::from(k) / f64::from(around);
            let p = DVec3::new(r * function::cos_f64(phi), 0.0, r * function::sin_f64(phi));
            b.vertex(p, DVec3::Y, uv(p));
        }
    }
    let at = |ring: u32, k: u32| 1 + (ring - 1) * around + k % around;
    for k in 0..around {
        b.face(&[0, at(1, k + 1), at(1, k)]);
        for ring in 1..rings {
            b.face(&[at(ring, k), at(ring, k + 1), at(ring + 1, k + 1), at(ring + 1, k)]);
        }
    }
    b.finish("disc")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_look_outwards_and_their_area_converges_at_second_order() {
        let area = |mesh: &Mesh, outward: fn(DVec3) -> DVec3| -> f64 {
            let faces = mesh.triangles.iter().map(|t| {
                let c = t.map(|v| mesh.positions[v as usize]);
                let a = area_vector(&c);
                assert!(a.dot(outward((c[0] + c[1] + c[2]) / 3.0)) > 0.0);
                a.length()
            });
            faces.sum()
        };
        for (make, truth, outward) in
            [(sphere as fn(u32) -> Mesh, 4.0 * PI, (|p| p) as fn(DVec3) -> DVec3), (disc, PI, |_| DVec3::Y)]
        {
            let error = |n| truth - area(&make(n), outward);
            let ratio = error(16) / error(32);
            assert!((3.9..4.1).contains(&ratio), "{ratio}");
        }
    }
}
