//! From faces to triangles on the grid: transform, reject, clip, round.

use std::ops::Range;

use super::Culling;
use super::surfaces::{Faces, Surfaces};
use crate::math::Vec3;
use crate::raster::scan::{Place, snap};
use crate::raster::{Grid, Homogeneous, Projection, Triangle, clip};
use crate::scene::InstanceId;
use crate::transport::World;

/// What turning faces into triangles depends on.
pub(super) struct SetUp<'a> {
    pub(super) world: &'a World,
    pub(super) surfaces: &'a Surfaces,
    pub(super) projection: &'a Projection,
    pub(super) culling: Culling,
    /// Half the picture and a margin for samples outside of their pixels: x to the left and right, y of the band's top and bottom, pixels.
    sides: [f64; 4],
}

/// A vertex as it appears.
#[derive(Clone, Copy)]
struct Vertex {
    seen: Homogeneous,
    place: Place,
    /// Planes it must be cut by, and above them, from bit 5, sides of the picture it lies outside of.
    outside: u32,
}

const SIDES: u32 = 5;
/// Outside of one of these together, and no part of a face is seen: the near plane and the sides of the picture.
const REJECT: u32 = 1 | 0b1111 << SIDES;
/// To be cut by: the near plane and the guard band.
const CLIP: u32 = 0b1_1111;

impl<'a> SetUp<'a> {
    pub(super) fn new(
        world: &'a World,
        surfaces: &'a Surfaces,
        projection: &'a Projection,
        culling: Culling,
        grid: &Grid,
    ) -> Self {
        let margin = 1.0 + f64::from(grid.spread) / f64::from(crate::raster::SUBPIXELS);
        let (half_x, half_y) = (0.5 * f64::from(grid.width), 0.5 * f64::from(grid.height));
        let top = f64::from(grid.first_row * crate::raster::TILE) - half_y;
        let bottom = (top + f64::from(grid.n_rows * crate::raster::TILE)).min(half_y);
        Self { world, surfaces, projection, culling, sides: [-half_x - margin, half_x + margin, top - margin, bottom + margin] }
    }

    /// The triangles of a range of faces, in order.
    pub(super) fn range(&self, range: Range<u32>, out: &mut Vec<Triangle>) {
        let mut scratch = Vec::new();
        for (faces, own) in self.surfaces.in_range(self.world, range) {
            if self.is_out_of_sight(&faces) {
                continue;
            }
            let triangles = &faces.triangles[own.start as usize..own.end as usize];
            // Neighbouring faces share vertices: where indices keep together, each is transformed once.
            let (lo, hi) = triangles.iter().flatten().fold((u32::MAX, 0), |(lo, hi), &i| (lo.min(i), hi.max(i)));
            if hi as usize >= faces.positions.len() {
                continue;
            }
            if ((hi - lo) as usize) < 2 * triangles.len() + 16 {
                scratch.clear();
                scratch.extend((lo..=hi).map(|i| self.vertex(faces.vertex(i))));
                let at = |i: u32| &scratch[(i - lo) as usize];
                for (k, t) in triangles.iter().enumerate() {
                    self.face(&faces, own.start + k as u32, [at(t[0]), at(t[1]), at(t[2])], out);
                }
            } else {
                for (k, t) in triangles.iter().enumerate() {
                    let [a, b, c] = t.map(|i| self.vertex(faces.vertex(i)));
                    self.face(&faces, own.start + k as u32, [&a, &b, &c], out);
                }
            }
        }
    }

    fn is_out_of_sight(&self, faces: &Faces<'_>) -> bool {
        let (lo, hi) = (faces.bounds.min, faces.bounds.max);
        let corner = |i: u32| {
            let pick = |bit: u32, lo: f32, hi: f32| if i >> bit & 1 == 0 { lo } else { hi };
            Vec3::new(pick(0, lo.x, hi.x), pick(1, lo.y, hi.y), pick(2, lo.z, hi.z))
        };
        (0..8).fold(REJECT, |all, i| all & self.outside(&self.projection.project(corner(i)))) != 0
    }

    #[inline]
    fn vertex(&self, p: Vec3) -> Vertex {
        let seen = self.projection.project(p);
        let outside = self.outside(&seen);
        Vertex { seen, place: if outside & CLIP == 0 { snap(&seen) } else { [0; 2] }, outside }
    }

    #[inline]
    fn outside(&self, v: &Homogeneous) -> u32 {
        let [left, right, top, bottom] = self.sides;
        let guard = crate::raster::GUARD * v.w;
        // Written so that what is not a number is outside of everything.
        let out = |inside: bool, bit: u32| u32::from(!inside) << bit;
        out(v.z >= self.projection.near(), 0)
            | out(v.x >= -guard, 1)
            | out(v.x <= guard, 2)
            | out(v.y >= -guard, 3)
            | out(v.y <= guard, 4)
            | out(v.x >= left * v.w, SIDES)
            | out(v.x <= right * v.w, SIDES + 1)
            | out(v.y >= top * v.w, SIDES + 2)
            | out(v.y <= bottom * v.w, SIDES + 3)
    }

    #[inline]
    fn face(&self, faces: &Faces<'_>, primitive: u32, v: [&Vertex; 3], out: &mut Vec<Triangle>) {
        if v[0].outside & v[1].outside & v[2].outside & REJECT != 0 {
            return;
        }
        let face = faces.first + primitive;
        if (v[0].outside | v[1].outside | v[2].outside) & CLIP == 0 {
            if let Some(t) = Triangle::new(v.map(|v| v.place), face) {
                self.push(faces, primitive, t, &v.map(|v| v.seen), out);
            }
            return;
        }
        let seen = v.map(|v| v.seen);
        let mut polygon = [seen[0]; clip::MAX_CORNERS];
        let n = clip::clip(self.projection, &seen, &mut polygon);
        let place = |i: usize| snap(&polygon[i]);
        for i in 2..n {
            if let Some(t) = Triangle::new([place(0), place(i - 1), place(i)], face) {
                self.push(faces, primitive, t, &seen, out);
            }
        }
    }

    #[inline]
    fn push(&self, faces: &Faces<'_>, primitive: u32, mut t: Triangle, seen: &[Homogeneous; 3], out: &mut Vec<Triangle>) {
        let instance: InstanceId = faces.instance;
        if self.culling == Culling::Back && t.is_counter_clockwise == self.world.is_mirrored(instance) {
            return;
        }
        let material = if faces.is_exact_shape {
            self.world.scene().material_of(instance, 0)
        } else {
            self.world.scene().material_of(instance, primitive)
        };
        t.kind = self.surfaces.kind(material) as u8;
        t.plane = self.projection.depth_plane(seen);
        let depths = seen.map(|v| self.projection.depth(&v) as f32);
        // A vertex behind the eye bounds nothing.
        let in_front = seen.iter().all(|v| v.z >= self.projection.near());
        if in_front {
            t.depth_range = [depths[0].min(depths[1]).min(depths[2]), depths[0].max(depths[1]).max(depths[2])];
        }
        out.push(t);
    }
}
