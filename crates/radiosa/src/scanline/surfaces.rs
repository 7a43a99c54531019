//! Everything that can be drawn, as triangles: meshes as they are, exact shapes tessellated.

use std::f32::consts::{PI, TAU};

use crate::accel::Shape;
use crate::math::{Affine3A, Bounds, Vec3, function};
use crate::scene::{AlphaMode, InstanceId, MaterialId};
use crate::transport::World;

/// How a face is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// It hides what lies behind.
    Opaque,
    /// There or not, sample by sample.
    Masked,
    /// Something shows through: blended alpha or glass.
    Transparent,
}

/// The drawn surfaces of a world; does not depend on the view.
#[derive(Debug)]
pub(super) struct Surfaces {
    parts: Vec<Part>,
    shapes: [Tessellation; 2],
    n_faces: u32,
    /// By material, and last for faces without one.
    kinds: Vec<Kind>,
}

/// One placed geometry.
#[derive(Debug)]
struct Part {
    instance: InstanceId,
    first_face: u32,
    source: Source,
    to_world: Option<Affine3A>,
    bounds: Bounds,
}

#[derive(Clone, Copy, Debug)]
enum Source {
    Mesh(u32),
    Sphere,
    Disc,
}

/// A shape in its own coordinates; on the unit sphere, and on the disc but for its normal, positions are normals too.
#[derive(Debug, Default)]
struct Tessellation {
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    /// The middle of the four-cornered face each triangle is a half of, or of the triangle.
    middles: Vec<Vec3>,
}

impl Tessellation {
    /// A face of three or four corners, in order.
    fn add(&mut self, corners: &[u32]) {
        let middle = corners.iter().map(|&i| self.positions[i as usize]).sum::<Vec3>() / corners.len() as f32;
        for i in 2..corners.len() {
            self.triangles.push([corners[0], corners[i - 1], corners[i]]);
            self.middles.push(middle);
        }
    }
}

/// The triangles of one placed geometry.
#[derive(Clone, Copy, Debug)]
pub(super) struct Faces<'a> {
    pub(super) instance: InstanceId,
    /// Number of its first face among all.
    pub(super) first: u32,
    pub(super) positions: &'a [Vec3],
    pub(super) triangles: &'a [[u32; 3]],
    pub(super) to_world: Option<Affine3A>,
    pub(super) bounds: Bounds,
    /// Its triangles stand for an exact shape.
    pub(super) is_exact_shape: bool,
    source: Source,
}

impl Faces<'_> {
    /// A vertex in world coordinates.
    pub(super) fn vertex(&self, i: u32) -> Vec3 {
        let p = self.positions[i as usize];
        self.to_world.map_or(p, |m| m.transform_point3(p))
    }

    /// The exact front normal at a vertex of an exact shape, in its own coordinates.
    pub(super) fn exact_normal(&self, i: u32) -> Vec3 {
        if matches!(self.source, Source::Disc) { Vec3::Y } else { self.positions[i as usize] }
    }
}

impl Surfaces {
    /// Lists what a world holds. Spheres become `segments` rings of twice as many faces; `None` when there are more faces than can be numbered.
    pub(super) fn new(world: &World, segments: u32) -> Option<Self> {
        let geometry = world.accel().geometry();
        let any = |is: fn(&Shape) -> bool| geometry.shapes.iter().any(is);
        let shapes = [
            if any(|s| matches!(s, Shape::Sphere)) { sphere(segments) } else { Tessellation::default() },
            if any(|s| matches!(s, Shape::Disc)) { disc(2 * segments) } else { Tessellation::default() },
        ];
        let mut parts = Vec::with_capacity(geometry.placed.len());
        let mut n_faces = 0u32;
        for (i, placed) in geometry.placed.iter().enumerate() {
            let (source, n, bounds) = match &geometry.shapes[placed.shape as usize] {
                Shape::Mesh { positions, triangles } => {
                    let used = triangles.iter().flatten().filter_map(|&v| positions.get(v as usize));
                    (Source::Mesh(placed.shape), triangles.len(), around(used, placed.to_world))
                }
                Shape::Sphere => (Source::Sphere, shapes[0].triangles.len(), around(shapes[0].positions.iter(), placed.to_world)),
                Shape::Disc => (Source::Disc, shapes[1].triangles.len(), around(shapes[1].positions.iter(), placed.to_world)),
            };
            let first_face = n_faces;
            n_faces = n_faces.checked_add(u32::try_from(n).ok()?)?;
            parts.push(Part { instance: InstanceId(i as u32), first_face, source, to_world: placed.to_world, bounds });
        }
        let kinds = world.scene().materials.iter().map(|m| {
            if matches!(m.alpha.mode, AlphaMode::Mask { .. }) && !m.transmits() {
                Kind::Masked
            } else if m.alpha.mode != AlphaMode::Opaque || m.transmits() {
                Kind::Transparent
            } else {
                Kind::Opaque
            }
        });
        Some(Self { parts, shapes, n_faces, kinds: kinds.chain([Kind::Opaque]).collect() })
    }

    /// How many faces [`Self::new`] would list, and what it would allocate, bytes.
    pub(super) fn size(world: &World, segments: u32) -> (u64, u64) {
        let geometry = world.accel().geometry();
        let rings = u64::from(segments);
        let faces_of = |shape: &Shape| match shape {
            Shape::Mesh { triangles, .. } => triangles.len() as u64,
            Shape::Sphere => 4 * rings * (rings - 1),
            Shape::Disc => 2 * rings,
        };
        let tessellated = geometry.shapes.iter().filter(|shape| !matches!(shape, Shape::Mesh { .. })).map(faces_of).max();
        // A triangle with its middle, and half a vertex.
        let bytes = tessellated.unwrap_or(0) * (12 + 12 + 6) + (geometry.placed.len() * size_of::<Part>()) as u64;
        (geometry.placed.iter().map(|placed| faces_of(&geometry.shapes[placed.shape as usize])).sum(), bytes)
    }

    /// Faces in all.
    pub(super) fn n_faces(&self) -> u32 {
        self.n_faces
    }

    /// How a face of this material is drawn.
    pub(super) fn kind(&self, material: Option<MaterialId>) -> Kind {
        self.kinds[material.map_or(self.kinds.len() - 1, MaterialId::index)]
    }

    /// The middle of the face of a tessellation that a triangle is a part of, world coordinates; `None` for meshes.
    pub(super) fn middle(&self, faces: &Faces<'_>, own: u32) -> Option<Vec3> {
        let shape = match faces.source {
            Source::Mesh(_) => return None,
            Source::Sphere => &self.shapes[0],
            Source::Disc => &self.shapes[1],
        };
        let p = shape.middles[own as usize];
        Some(faces.to_world.map_or(p, |m| m.transform_point3(p)))
    }

    /// The parts that have faces in a range of numbers, with those of their own triangles that fall into it.
    pub(super) fn in_range<'a>(
        &'a self,
        world: &'a World,
        range: std::ops::Range<u32>,
    ) -> impl Iterator<Item = (Faces<'a>, std::ops::Range<u32>)> {
        let first = self.parts.partition_point(|p| p.first_face <= range.start).saturating_sub(1);
        let end = range.end;
        self.parts[first..].iter().take_while(move |p| p.first_face < end).filter_map(move |part| {
            let faces = self.faces(world, part);
            let own = range.start.saturating_sub(part.first_face)..(end - part.first_face).min(faces.triangles.len() as u32);
            (own.start < own.end).then_some((faces, own))
        })
    }

    /// The part a face belongs to.
    pub(super) fn part_of<'a>(&'a self, world: &'a World, face: u32) -> Faces<'a> {
        self.faces(world, &self.parts[self.parts.partition_point(|p| p.first_face <= face) - 1])
    }

    fn faces<'a>(&'a self, world: &'a World, part: &Part) -> Faces<'a> {
        let (positions, triangles): (&[Vec3], &[[u32; 3]]) = match part.source {
            Source::Mesh(shape) => match &world.accel().geometry().shapes[shape as usize] {
                Shape::Mesh { positions, triangles } => (positions, triangles),
                _ => (&[], &[]),
            },
            Source::Sphere => (&self.shapes[0].positions, &self.shapes[0].triangles),
            Source::Disc => (&self.shapes[1].positions, &self.shapes[1].triangles),
        };
        Faces {
            instance: part.instance,
            first: part.first_face,
            positions,
            triangles,
            to_world: part.to_world,
            bounds: part.bounds,
            is_exact_shape: !matches!(part.source, Source::Mesh(_)),
            source: part.source,
        }
    }
}

fn around<'a>(points: impl Iterator<Item = &'a Vec3>, to_world: Option<Affine3A>) -> Bounds {
    Bounds::of(points.map(|p| to_world.map_or(*p, |m| m.transform_point3(*p))))
}

/// The unit sphere: rings from pole to pole, front outside.
fn sphere(rings: u32) -> Tessellation {
    let around = 2 * rings;
    let mut t = Tessellation::default();
    t.positions.push(Vec3::Y);
    for i in 1..rings {
        let theta = PI * i as f32 / rings as f32;
        for j in 0..around {
            let phi = TAU * j as f32 / around as f32;
            let s = function::sin(theta);
            t.positions.push(Vec3::new(s * function::cos(phi), function::cos(theta), s * function::sin(phi)));
        }
    }
    t.positions.push(Vec3::NEG_Y);
    let at = |i: u32, j: u32| 1 + (i - 1) * around + j % around;
    let south = t.positions.len() as u32 - 1;
    for j in 0..around {
        t.add(&[0, at(1, j + 1), at(1, j)]);
        for i in 1..rings - 1 {
            t.add(&[at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)]);
        }
        t.add(&[at(rings - 1, j), at(rings - 1, j + 1), south]);
    }
    t
}

/// The unit disc in the plane y = 0, front +y.
fn disc(segments: u32) -> Tessellation {
    let mut t = Tessellation { positions: vec![Vec3::ZERO], ..Tessellation::default() };
    for j in 0..segments {
        let phi = TAU * j as f32 / segments as f32;
        t.positions.push(Vec3::new(function::cos(phi), 0.0, function::sin(phi)));
    }
    for j in 0..segments {
        t.add(&[0, 1 + (j + 1) % segments, 1 + j]);
    }
    t
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tessellations_are_closed_and_face_outwards() {
        for rings in [2, 3, 16] {
            let t = sphere(rings);
            let mut edges = std::collections::HashMap::new();
            for tri in &t.triangles {
                let p = tri.map(|i| t.positions[i as usize]);
                assert!((p[1] - p[0]).cross(p[2] - p[0]).dot(p[0] + p[1] + p[2]) > 0.0);
                for i in 0..3 {
                    *edges.entry((tri[i], tri[(i + 1) % 3])).or_insert(0) += 1;
                }
            }
            assert!(edges.iter().all(|(&(a, b), &n)| n == 1 && edges.contains_key(&(b, a))));
        }
        let d = disc(8);
        let up = |tri: &[u32; 3]| {
            let p = tri.map(|i| d.positions[i as usize]);
            (p[1] - p[0]).cross(p[2] - p[0]).y > 0.0
        };
        assert!(d.triangles.len() == 8 && d.triangles.iter().all(up));
    }
}
