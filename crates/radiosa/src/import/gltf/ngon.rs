//! `FB_ngon_encoding`: runs of triangles around one first vertex are the fans of n-gons.

use crate::scene::Polygons;

/// Finds the n-gons in an encoded triangle list. Runs end where the first vertex changes or the fan does not go on.
pub(super) fn polygons(triangles: &[[u32; 3]]) -> Polygons {
    let mut out = Polygons { offsets: vec![0], vertices: Vec::new(), of_triangle: Vec::with_capacity(triangles.len()) };
    let mut previous: Option<[u32; 3]> = None;
    for &triangle in triangles {
        let [first, second, third] = triangle;
        match previous {
            Some(p) if p[0] == first && p[2] == second => out.vertices.push(third),
            _ => {
                if previous.is_some() {
                    out.offsets.push(out.vertices.len() as u32);
                }
                out.vertices.extend(triangle);
            }
        }
        out.of_triangle.push(out.offsets.len() as u32 - 1);
        previous = Some(triangle);
    }
    if previous.is_some() {
        out.offsets.push(out.vertices.len() as u32);
    }
    out
}
