//! The edges and vertices of opaque surfaces that can bound what they hide.
//!
//! An edge is a silhouette from a place when all surfaces at it lie on one side of the plane through both; a vertex is one for an edge of an emitter when all edges at it
//! lie on one side of the plane through that. What lies within the plane, up to a small part of an element, is on neither side.

use super::Apex;
use crate::math::DVec3;
use crate::radiosity::patch::Patch;
use crate::transport::World;

/// Edges shorter than this hide little and are not kept, in lengths of an element's edge.
const SHORT: f64 = 0.1;
/// What is nearer to a plane than this lies in it, in the same.
const NEAR: f64 = 1e-4;

/// Bits of a place.
type Key = [u64; 3];

fn key(p: DVec3) -> Key {
    (p + DVec3::ZERO).to_array().map(f64::to_bits)
}

/// An edge with the surfaces at it.
#[derive(Clone, Debug)]
struct Edge {
    ends: [DVec3; 2],
    patches: Vec<u32>,
}

/// A vertex with the other ends of the edges at it.
#[derive(Clone, Debug)]
struct Vertex {
    p: DVec3,
    others: Vec<DVec3>,
}

/// What can cast the borders of shadows.
#[derive(Debug)]
pub(super) struct Silhouettes {
    edges: Vec<Edge>,
    vertices: Vec<Vertex>,
    /// By patch: the mean of its corners, and its unit normal.
    middles: Vec<[DVec3; 2]>,
    size: f64,
}

impl Silhouettes {
    /// Of all opaque patches, for elements of a size.
    pub(super) fn new(world: &World, patches: &[Patch], size: f64) -> Self {
        let mut sides: Vec<([Key; 2], u32, [DVec3; 2])> = Vec::new();
        let opaque = (0u32..).zip(patches).filter(|(_, patch)| !world.may_be_transparent(patch.material));
        for (index, patch) in opaque {
            let c = patch.corners();
            for (k, &a) in c.iter().enumerate() {
                let b = c[(k + 1) % c.len()];
                // (Of finely divided meshes that is nearly all there is.)
                if (b - a).length() >= SHORT * size && (b - a).is_finite() {
                    let ends = if key(a) <= key(b) { [a, b] } else { [b, a] };
                    sides.push((ends.map(key), index, ends));
                }
            }
        }
        sides.sort_unstable_by_key(|(keys, index, _)| (*keys, *index));
        let edges: Vec<Edge> = sides
            .chunk_by(|a, b| a.0 == b.0)
            .map(|same| Edge { ends: same[0].2, patches: same.iter().map(|side| side.1).collect() })
            .collect();
        let mut ends: Vec<(Key, Key, DVec3, DVec3)> = Vec::with_capacity(2 * edges.len());
        for Edge { ends: [a, b], .. } in &edges {
            ends.extend([(key(*a), key(*b), *a, *b), (key(*b), key(*a), *b, *a)]);
        }
        ends.sort_unstable_by_key(|end| (end.0, end.1));
        let vertices = ends
            .chunk_by(|a, b| a.0 == b.0)
            .map(|same| Vertex { p: same[0].2, others: same.iter().map(|end| end.3).collect() })
            .collect();
        let middle = |patch: &Patch| {
            let c = patch.corners();
            [c.iter().sum::<DVec3>() / c.len() as f64, crate::math::polygon::area_vector(c).normalize_or_zero()]
        };
        Self { edges, vertices, middles: patches.iter().map(middle).collect(), size }
    }

    /// A patch goes on in its plane beyond an edge of it.
    pub(super) fn is_inner(&self, ends: [DVec3; 2], patch: u32) -> bool {
        let keys = ends.map(key);
        let sorted = if keys[0] <= keys[1] { keys } else { [keys[1], keys[0]] };
        let Ok(at) = self.edges.binary_search_by(|edge| edge.ends.map(key).cmp(&sorted)) else { return false };
        let normal = self.middles[patch as usize][1];
        let goes_on = |other: u32| other != patch && self.middles[other as usize][1].dot(normal).abs() > 1.0 - 1e-9;
        self.edges[at].patches.iter().any(|&other| goes_on(other))
    }

    /// On which side of a plane through `p` everything lies: −1 or 1; `None` where it lies on both, or within.
    fn side(&self, p: DVec3, normal: DVec3, points: impl Iterator<Item = DVec3>) -> Option<f64> {
        let mut side = 0.0;
        for point in points {
            let height = (point - p).dot(normal);
            if height.abs() <= NEAR * self.size {
                continue;
            }
            if height * side < 0.0 {
                return None;
            }
            side = height.signum();
        }
        (side != 0.0).then_some(side)
    }

    /// The edges that are silhouettes from a place or direction, each with the unit vector off its wedge to where nothing is; at most `most`, those that look longest, and
    /// how many more there are.
    pub(super) fn edges(&self, from: Apex, most: usize) -> (Vec<([DVec3; 2], DVec3)>, u64) {
        let of = |edge: &Edge| {
            let [a, b] = edge.ends;
            let normal = (b - a).cross(from.to(a)).normalize_or_zero();
            if normal == DVec3::ZERO {
                return None;
            }
            let side = self.side(a, normal, edge.patches.iter().map(|&p| self.middles[p as usize][0]))?;
            Some((looks([a, b], from), (edge.ends, normal * -side)))
        };
        largest(self.edges.iter().filter_map(of).collect(), most)
    }

    /// The vertices that are silhouettes as seen from an edge of an emitter, as [`Self::edges`]; only those that `is_above`.
    pub(super) fn vertices(
        &self,
        [a, b]: [DVec3; 2],
        is_above: &dyn Fn(DVec3) -> bool,
        most: usize,
    ) -> (Vec<(DVec3, DVec3)>, u64) {
        let of = |vertex: &Vertex| {
            let normal = (b - a).cross(vertex.p - a).normalize_or_zero();
            if !is_above(vertex.p) || normal == DVec3::ZERO {
                return None;
            }
            let side = self.side(vertex.p, normal, vertex.others.iter().copied())?;
            let longest = vertex.others.iter().map(|o| (*o - vertex.p).length()).fold(0.0, f64::max);
            let far = (vertex.p - a).length().max(f64::MIN_POSITIVE);
            Some((longest / far, (vertex.p, normal * -side)))
        };
        largest(self.vertices.iter().filter_map(of).collect(), most)
    }
}

/// How long an edge looks: its length over its distance; from infinitely far away its length.
fn looks([a, b]: [DVec3; 2], from: Apex) -> f64 {
    let far = if from.w > 0.0 { ((a + b) * 0.5 - from.p).length() } else { 1.0 };
    (b - a).length() / far.max(f64::MIN_POSITIVE)
}

/// The `most` of the largest keys, of equal ones the first, in their order; and how many others there are.
fn largest<T>(mut all: Vec<(f64, T)>, most: usize) -> (Vec<T>, u64) {
    let left = all.len().saturating_sub(most);
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    all.truncate(most);
    (all.into_iter().map(|(_, of)| of).collect(), left as u64)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::math::CpuPath;
    use crate::radiosity::patch::Patches;

    #[test]
    fn a_box_has_the_silhouette_it_has() {
        let text = "[material.a]\nlambert = 0.5\n[[shape]]\nmaterial = \"a\"\nbox = { min = [-1, -1, -1], max = [1, 1, 1] }\n";
        let scene =
            crate::import::load_bytes(text.as_bytes(), Path::new("box.toml"), &Default::default()).expect("it is a scene").0;
        let world = World::prepare(scene, CpuPath::detect()).expect("it is valid");
        let patches = Patches::new(&world).patches;
        let all = Silhouettes::new(&world, &patches, 0.1);
        let n = |p: [f64; 3], w: f64| all.edges(Apex { p: DVec3::from_array(p), w }, 100).0.len();
        // One, two, three faces show.
        assert_eq!([n([0.0, 0.0, 9.0], 1.0), n([0.0, 7.0, 9.0], 1.0), n([5.0, 7.0, 9.0], 1.0)], [4, 6, 6]);
        assert_eq!(n([0.48, 0.6, 0.64], 0.0), 6);
        // Faces seen edge-on begin and end at silhouettes, whichever are counted.
        assert_eq!(n([0.0, 0.6, 0.8], 0.0), 10);
        // The largest first, and the others counted.
        let (some, left) = all.edges(Apex { p: DVec3::new(5.0, 7.0, 9.0), w: 1.0 }, 2);
        assert_eq!((some.len(), left), (2, 4));
        // Vertices on one side of the plane through an edge above.
        let (found, _) = all.vertices([DVec3::new(-0.5, 4.0, 0.0), DVec3::new(0.5, 4.0, 0.0)], &|p| p.y < 3.0, 100);
        assert_eq!(found.len(), 4, "{found:?}");
        assert!(found.iter().all(|(p, outwards)| p.y > 0.0 && outwards.z * p.z > 0.0), "{found:?}");
    }
}
