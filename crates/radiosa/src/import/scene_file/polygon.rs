//! Polygons into triangles, without forgetting the polygons.

use thiserror::Error;

use crate::math::{DVec3, Vec2, Vec3};
use crate::scene::{Mesh, Polygons};

/// Cutting a concave polygon may take the square of its corners in time.
const MOST_CORNERS: usize = 4096;

/// Why a face cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub(super) enum Unusable {
    #[error("a face needs at least three corners")]
    TooFew,
    #[error("a face may have at most {MOST_CORNERS} corners")]
    TooMany,
    #[error("this face has no area: its corners lie on one line or in one place")]
    NoArea,
}

/// A mesh while its faces are added.
#[derive(Clone, Debug, Default)]
pub(super) struct Builder {
    pub(super) positions: Vec<DVec3>,
    pub(super) normals: Option<Vec<Vec3>>,
    /// Empty, or one for each position.
    pub(super) uvs: Vec<Vec2>,
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) offsets: Vec<u32>,
    pub(super) vertices: Vec<u32>,
    pub(super) of_triangle: Vec<u32>,
}

impl Builder {
    /// Adds one face; its indices must be inside `positions`.
    pub(super) fn face(&mut self, corners: &[u32]) -> Result<(), Unusable> {
        if corners.len() < 3 {
            return Err(Unusable::TooFew);
        }
        if corners.len() > MOST_CORNERS {
            return Err(Unusable::TooMany);
        }
        let points: Vec<DVec3> = corners.iter().map(|&i| self.positions[i as usize]).collect();
        let area = area_vector(&points);
        let extent = points.iter().fold(0.0f64, |m, &p| m.max((p - points[0]).length_squared()));
        if area.length() <= 1e-12 * extent {
            return Err(Unusable::NoArea);
        }
        let polygon = self.offsets.len() as u32;
        self.offsets.push(self.vertices.len() as u32);
        self.vertices.extend(corners);
        let mut add = |[a, b, c]: [usize; 3]| {
            self.triangles.push([corners[a], corners[b], corners[c]]);
            self.of_triangle.push(polygon);
        };
        if is_convex(&points, area) {
            (1..corners.len() - 1).for_each(|i| add([0, i, i + 1]));
        } else {
            // In the coordinate plane the face covers best, mirrored where that plane sees its back: then the cut keeps the winding.
            let axis = area.abs().max_position();
            let (u, v) = if area[axis] > 0.0 { ((axis + 1) % 3, (axis + 2) % 3) } else { ((axis + 2) % 3, (axis + 1) % 3) };
            let flat = points.iter().map(|p| [p[u], p[v]]);
            let mut cut: Vec<u32> = Vec::new();
            earcut::Earcut::new().earcut(flat, &[], &mut cut);
            for t in cut.chunks_exact(3) {
                let [a, b, c] = [t[0] as usize, t[1] as usize, t[2] as usize];
                let turned = (points[b] - points[a]).cross(points[c] - points[a]).dot(area) < 0.0;
                add(if turned { [a, c, b] } else { [a, b, c] });
            }
        }
        Ok(())
    }

    /// The mesh.
    pub(super) fn finish(mut self) -> Mesh {
        self.offsets.push(self.vertices.len() as u32);
        Mesh {
            positions: self.positions,
            normals: self.normals,
            uvs: if self.uvs.is_empty() { Vec::new() } else { vec![self.uvs] },
            triangles: self.triangles,
            polygons: Some(Polygons { offsets: self.offsets, vertices: self.vertices, of_triangle: self.of_triangle }),
            ..Mesh::default()
        }
    }
}

/// Twice the area of a closed polygon along its normal (Newell): counter-clockwise seen from its tip.
pub(super) fn area_vector(points: &[DVec3]) -> DVec3 {
    let origin = points.first().copied().unwrap_or_default();
    let next = points.iter().cycle().skip(1);
    points.iter().zip(next).map(|(&a, &b)| (a - origin).cross(b - origin)).sum()
}

/// True when every fan triangle from the first corner and every turn has the orientation of the whole.
fn is_convex(points: &[DVec3], area: DVec3) -> bool {
    let n = points.len();
    let slack = -1e-12 * area.length_squared();
    let turn = |a: DVec3, b: DVec3, c: DVec3| (b - a).cross(c - b).dot(area) >= slack;
    (0..n).all(|i| turn(points[i], points[(i + 1) % n], points[(i + 2) % n]))
        && (1..n - 1).all(|i| turn(points[0], points[i], points[i + 1]))
}
