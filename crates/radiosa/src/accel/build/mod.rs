//! Building a tree: references, a binary tree by the surface-area heuristic, polish, collapse to eight-wide.
//!
//! Every step is a function of its input alone, so the tree does not depend on the number of threads. Beside the source, building takes
//! about 200 bytes for a triangle while it runs; the tree itself keeps about 100.

mod binary;
mod collapse;
mod reinsert;

use super::bvh::{Bvh, LARGEST};
use crate::math::{Bounds, Vec3};

/// What the tree is built over: triangles first, then objects.
pub(super) trait Source: Sync {
    /// How many triangles there are.
    fn triangles(&self) -> usize;
    /// Vertices of a triangle.
    fn vertices(&self, triangle: usize) -> [Vec3; 3];
    /// Instance and primitive of a triangle.
    fn ids(&self, triangle: usize) -> (u32, u32);
    /// Boxes around the objects.
    fn objects(&self) -> &[Bounds];
}

/// A box to sort into the tree and what is inside.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reference {
    min: Vec3,
    /// Triangle, or object plus the number of triangles.
    id: u32,
    max: Vec3,
    _pad: u32,
}

impl Reference {
    fn new(bounds: Bounds, id: u32) -> Self {
        Self { min: bounds.min, id, max: bounds.max, _pad: 0 }
    }

    fn bounds(&self) -> Bounds {
        Bounds { min: self.min, max: self.max }
    }

    /// Twice the centre.
    fn centre2(&self) -> Vec3 {
        self.min + self.max
    }
}

/// Builds the tree.
pub(super) fn build(source: &dyn Source) -> Bvh {
    let references = references(source);
    let bounds = references.iter().fold(Bounds::EMPTY, |all, r| all.union(r.bounds()));
    if references.is_empty() {
        return Bvh { nodes: Vec::new(), blocks: Vec::new(), bounds };
    }
    let mut tree = binary::build(references, binary::Split::Heuristic);
    reinsert::optimise(&mut tree);
    collapse::collapse(&tree, source, bounds)
        // Only a tree shaped by malice is so deep; halving by count bounds the depth.
        .or_else(|| collapse::collapse(&binary::build(self::references(source), binary::Split::Count), source, bounds))
        .expect("a tree halved by count is as deep as the logarithm of its size")
}

fn references(source: &dyn Source) -> Vec<Reference> {
    use rayon::prelude::*;
    let n = source.triangles();
    let usable = |b: &Bounds| b.min.cmple(b.max).all() && b.min.min(-b.max).cmpge(Vec3::splat(-LARGEST)).all();
    let triangles = (0..n).into_par_iter().filter_map(|i| {
        let vertices = source.vertices(i);
        let bounds = Bounds::of(vertices);
        // `Bounds` passes over NaN, so the vertices are asked themselves.
        (vertices.iter().all(|v| v.is_finite()) && usable(&bounds) && !is_degenerate(vertices))
            .then(|| Reference::new(bounds, i as u32))
    });
    let objects = source.objects().par_iter().enumerate();
    let objects = objects.filter_map(|(i, b)| usable(b).then(|| Reference::new(*b, (n + i) as u32)));
    triangles.chain(objects).collect()
}

/// True when the vertices lie on a line; exact, since differences and products of f32 are exact in f64 wherever they could cancel.
fn is_degenerate([a, b, c]: [Vec3; 3]) -> bool {
    let (a, b, c) = (a.as_dvec3(), b.as_dvec3(), c.as_dvec3());
    (b - a).cross(c - a) == crate::math::DVec3::ZERO
}
