//! The tree: nodes of eight boxes, leaves of triangle blocks or of one object.

use crate::math::Bounds;

/// Boxes in a node.
pub(super) const WIDTH: usize = 8;

/// Triangles in a block. Blocks of four cost a few percent more time and no less memory: leaves of five to eight triangles are frequent.
pub(super) const BLOCK: usize = 8;

/// Products of coordinates beyond this overflow; nothing there is ever hit, and no ray from there hits.
pub(super) const LARGEST: f32 = 1e18;

/// Each plane of a box is moved out by this part of its distance from 0: the rounding of `plane·inv` in the slab test and of the reciprocal
/// itself, see `prepared`.
pub(super) const PLANE_SLACK: f32 = 4.0 * 0.5 * f32::EPSILON;

/// Eight children: four cache lines.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(super) struct Node {
    /// Rows 0..3: smallest x, y, z of the children's boxes; rows 3..6: largest; row 6: the children, as bits. Row 7 is spare: with eight rows
    /// an index masked by 7 needs no check. A lane without child has an empty box.
    pub rows: [[f32; WIDTH]; 8],
}

const _: () = assert!(size_of::<Node>() == 256);

/// Row of [`Node::rows`] with the children.
const CHILDREN: usize = 6;

impl Node {
    /// No children yet.
    pub(super) const EMPTY: Self = {
        let (lo, hi, zero) = ([f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH], [0.0; WIDTH]);
        Self { rows: [lo, lo, lo, hi, hi, hi, zero, zero] }
    };

    /// Child in a lane.
    #[inline(always)]
    pub(super) fn child(&self, lane: u32) -> Child {
        Child(self.rows[CHILDREN][lane as usize & 7].to_bits())
    }

    /// Puts a child with its box, moved out by its slack, into a lane.
    pub(super) fn set(&mut self, lane: usize, child: Child, bounds: &Bounds, margin: f32) {
        for k in 0..3 {
            let (lo, hi) = (bounds.min[k], bounds.max[k]);
            self.rows[k][lane] = lo - (lo.abs() * PLANE_SLACK + margin);
            self.rows[k + 3][lane] = hi + (hi.abs() * PLANE_SLACK + margin);
        }
        self.rows[CHILDREN][lane] = f32::from_bits(child.0);
    }
}

/// What a node's lane leads to: a node; some blocks of triangles; an object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Child(pub u32);

impl Child {
    const LEAF: u32 = 1 << 31;
    const OBJECT: u32 = 1 << 30;
    /// Where the number of blocks less one stands.
    const COUNT_SHIFT: u32 = 28;

    /// Blocks in a leaf, at most.
    pub(super) const MAX_BLOCKS: usize = 4;
    /// Blocks in a tree, at most.
    pub(super) const MAX_TOTAL_BLOCKS: usize = 1 << Self::COUNT_SHIFT;

    pub(super) fn node(index: usize) -> Self {
        Self(index as u32)
    }

    pub(super) fn blocks(first: usize, count: usize) -> Self {
        debug_assert!((1..=Self::MAX_BLOCKS).contains(&count) && first < Self::MAX_TOTAL_BLOCKS);
        Self(Self::LEAF | (count as u32 - 1) << Self::COUNT_SHIFT | first as u32)
    }

    pub(super) fn object(index: usize) -> Self {
        Self(Self::LEAF | Self::OBJECT | index as u32)
    }

    /// Index of the node.
    #[inline(always)]
    pub(super) fn as_node(self) -> Option<usize> {
        (self.0 & Self::LEAF == 0).then_some(self.0 as usize)
    }

    /// Index of the object, for a leaf.
    #[inline(always)]
    pub(super) fn as_object(self) -> Option<usize> {
        (self.0 & Self::OBJECT != 0).then_some((self.0 & (Self::OBJECT - 1)) as usize)
    }

    /// Range of blocks, for a leaf that is no object.
    #[inline(always)]
    pub(super) fn as_blocks(self) -> std::ops::Range<usize> {
        let first = (self.0 & ((1 << Self::COUNT_SHIFT) - 1)) as usize;
        first..first + (self.0 >> Self::COUNT_SHIFT & 3) as usize + 1
    }
}

/// Triangles side by side.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(super) struct Block {
    /// By axis, vertex, lane; NaN in lanes without triangle, which every comparison rejects.
    pub vertices: [[[f32; BLOCK]; 3]; 3],
    /// Index into `Geometry::placed`; 0 within a shape that is shared.
    pub instance: [u32; BLOCK],
    /// Triangle within its mesh.
    pub primitive: [u32; BLOCK],
    /// Twice the largest extent of any of the triangles in any axis.
    pub extent: f32,
    /// Lanes with a triangle: the first ones.
    pub count: u32,
}

impl Block {
    pub(super) const EMPTY: Self = Self {
        vertices: [[[f32::NAN; BLOCK]; 3]; 3],
        instance: [u32::MAX; BLOCK],
        primitive: [u32::MAX; BLOCK],
        extent: 0.0,
        count: 0,
    };
}

/// A tree over triangles and objects.
#[derive(Debug)]
pub(super) struct Bvh {
    /// The root is the first; none when there is nothing.
    pub nodes: Vec<Node>,
    pub blocks: Vec<Block>,
    /// Around everything.
    pub bounds: Bounds,
}

/// Entries a traversal's stack can hold; the builder sees to it that no tree needs more.
pub(super) const STACK: usize = 256;

/// Nodes on the longest way down, at most: each but the last leaves seven siblings on the stack.
pub(super) const MAX_DEPTH: usize = (STACK - WIDTH) / (WIDTH - 1);
