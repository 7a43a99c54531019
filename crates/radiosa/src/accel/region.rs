//! The triangles that reach into a convex region: all there is to throw shadows between a point and a polygon.

use super::Accel;
use super::bvh::{BLOCK, Block, Node};
use super::dispatch::Kernels;
use super::traverse::Stack;
use crate::math::Vec3;
use crate::math::lanes::Lanes;

/// Leaves that a region may meet before the search is given up: in dense surroundings it meets more and more boxes.
const FEW_LEAVES: u32 = 32;

/// The half space `normal·x ≥ offset`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HalfSpace {
    /// Of any length.
    pub normal: Vec3,
    /// In units of `normal`'s length times metres.
    pub offset: f32,
}

/// A triangle of the scene.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Triangle {
    /// Index into [`Geometry::placed`](super::Geometry::placed).
    pub instance: u32,
    /// Within the instance's mesh.
    pub primitive: u32,
    /// World coordinates.
    pub corners: [Vec3; 3],
}

#[inline(always)]
pub(super) fn triangles_in<C: Kernels>(accel: &Accel, region: &[HalfSpace], found: &mut [Triangle]) -> Option<usize> {
    let tree = &accel.tree;
    let Some(mut node) = tree.nodes.first() else { return Some(0) };
    let (mut n, mut n_leaves) = (0, 0);
    let (mut stack, mut height) = Stack::<u32>::new();
    loop {
        let mut mask = boxes::<C::Wide>(region, node);
        while mask != 0 {
            let child = node.child(mask.trailing_zeros());
            mask &= mask - 1;
            if let Some(index) = child.as_node() {
                stack.push(&mut height, index as u32);
                continue;
            }
            n_leaves += 1;
            if child.as_object().is_some() || n_leaves > FEW_LEAVES {
                return None;
            }
            for block in &tree.blocks[child.as_blocks()] {
                let mut lanes = triangles::<C::Wide>(region, block);
                while lanes != 0 {
                    let lane = lanes.trailing_zeros() as usize & (BLOCK - 1);
                    lanes &= lanes - 1;
                    let corner = |i: usize| {
                        let [x, y, z] = &block.vertices;
                        Vec3::new(x[i][lane], y[i][lane], z[i][lane])
                    };
                    let corners = [corner(0), corner(1), corner(2)];
                    let (instance, primitive) = (block.instance[lane], block.primitive[lane]);
                    *found.get_mut(n)? = Triangle { instance, primitive, corners };
                    n += 1;
                }
            }
        }
        let Some(next) = stack.pop(&mut height) else { return Some(n) };
        node = &tree.nodes[next as usize];
    }
}

/// Children whose boxes are not outside of any one half space. (Empty boxes are outside of all.)
#[inline(always)]
fn boxes<L: Lanes>(region: &[HalfSpace], node: &Node) -> u32 {
    let mut inside = u32::MAX;
    for half in region {
        let n = half.normal;
        let far = |k: usize| L::load(&node.rows[if n[k] >= 0.0 { k + 3 } else { k }]).mul(L::splat(n[k]));
        let reach = far(0).add(far(1)).add(far(2));
        inside &= L::bits(L::splat(half.offset).le(reach));
    }
    inside
}

/// Triangles that are not outside of any one half space.
#[inline(always)]
fn triangles<L: Lanes>(region: &[HalfSpace], block: &Block) -> u32 {
    let mut inside = (1 << block.count) - 1;
    for half in region {
        let n = half.normal;
        let height = |i: usize| {
            let along = |k: usize| L::load(&block.vertices[k][i]).mul(L::splat(n[k]));
            along(0).add(along(1)).add(along(2))
        };
        let reach = height(0).max(height(1)).max(height(2));
        inside &= L::bits(L::splat(half.offset).le(reach));
    }
    inside
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::{Geometry, Placed, Shape};
    use crate::math::CpuPath;
    use crate::sampling::Stream;

    #[test]
    fn no_triangle_that_reaches_into_a_region_is_left_out() {
        let mut stream = Stream::new(9, 0, 0);
        let mut point = |size: f32| (Vec3::new(stream.next_f32(), stream.next_f32(), stream.next_f32()) * 2.0 - 1.0) * size;
        let positions: Vec<Vec3> = (0..400)
            .flat_map(|_| {
                let at = point(5.0);
                [at, at + point(0.4), at + point(0.4)]
            })
            .collect();
        let triangles: Vec<[u32; 3]> = (0..400).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let shapes = vec![Shape::Mesh { positions: positions.clone(), triangles }];
        let geometry = Geometry { shapes, placed: vec![Placed { shape: 0, to_world: None }] };
        let (mut answers, mut refused) = (0, 0);
        for path in [CpuPath::Portable, CpuPath::Avx2] {
            let accel = Accel::build(geometry.clone(), path);
            for _ in 0..200 {
                let at = point(4.0);
                let region: Vec<HalfSpace> = (0..5)
                    .map(|_| {
                        let normal = point(1.0);
                        HalfSpace { normal, offset: normal.dot(at) - 0.3 }
                    })
                    .collect();
                let mut found = [Triangle::default(); 60];
                let Some(n) = accel.triangles_in(&region, &mut found) else {
                    refused += 1;
                    continue;
                };
                let mut found: Vec<u32> = found[..n].iter().map(|t| t.primitive).collect();
                found.sort_unstable();
                let reaches = |i: &u32| {
                    let corners = &positions[3 * *i as usize..][..3];
                    region.iter().all(|half| corners.iter().any(|c| c.dot(half.normal) >= half.offset))
                };
                let expected: Vec<u32> = (0..400).filter(reaches).collect();
                assert_eq!(found, expected);
                answers += 1;
            }
        }
        assert!(answers > 100 && refused > 10, "{answers} answers, {refused} refusals");
    }
}
