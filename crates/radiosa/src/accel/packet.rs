//! Eight rays down a tree together, a ray a lane.
//!
//! A node's boxes are first tested against all rays at once, as intervals of origins and reciprocal directions: one box a lane. Only
//! the children that remain are tested against each ray: one ray a lane. Triangles are taken one at a time, against all rays. The
//! hits are those of single rays, bit for bit: the arithmetic is the same.
//!
//! Rays that do not go the way of most (signs of their directions, longest axis) are traced alone.

use super::bvh::{Block, Bvh, Child, LARGEST, Node, WIDTH};
use super::prepared::{ORIGIN_SLACK, SMALLEST_SLOPE};
use super::traverse::{Stack, prefetch};
use super::triangle::{self, Found, VERTEX_ERROR};
use crate::math::lanes::{Cpu, Lanes, xyz};
use crate::math::{Bounds, DVec3, Ray, Vec3};

/// Fewer rays than this on one way are traced alone.
const FEW: u32 = 4;

/// Rays in columns.
pub(super) struct Columns<L> {
    pub o: [L; 3],
    pub d: [L; 3],
    pub t_max: L,
    /// As in `Prepared`.
    pub reach: L,
    pub vertex_error: L,
    /// Rays that can be traced here at all: finite, with directions of sane length.
    pub usable: u32,
}

impl<L: Lanes> Columns<L> {
    #[inline(always)]
    pub(super) fn new(rays: &[Ray; 8], bounds: &Bounds) -> Self {
        let mut columns = [[0.0; 8]; 7];
        for (i, r) in rays.iter().enumerate() {
            for k in 0..3 {
                columns[k][i] = r.origin[k];
                columns[k + 3][i] = r.dir[k];
            }
            columns[6][i] = r.t_max;
        }
        let o = xyz!(k => L::load(&columns[k]));
        let d = xyz!(k => L::load(&columns[k + 3]));
        let t_max = L::load(&columns[6]);
        let size = xyz!(k => d[k].abs());
        // Powers of two scale exactly, so that within this range nothing differs from `Prepared`'s scaled direction.
        let (short, long) = (L::splat(2f32.powi(-40)), L::splat(2f32.powi(40)));
        let each = |x: L, limit: L| L::bits(x.le(limit));
        let sane = each(size[0], long) & each(size[1], long) & each(size[2], long) & L::bits(short.le(longest(size)));
        let near = xyz!(k => each(o[k].abs(), L::splat(LARGEST)));
        let far = |k: usize| L::splat(bounds.max[k]).sub(o[k]).max(o[k].sub(L::splat(bounds.min[k])));
        let reach = far(0).max(far(1)).max(far(2));
        let vertex_error = reach.mul(L::splat(VERTEX_ERROR));
        Self { o, d, t_max, reach, vertex_error, usable: sane & near[0] & near[1] & near[2] }
    }

    /// Rays by their longest axis.
    #[inline(always)]
    pub(super) fn by_axis(&self) -> [u32; 3] {
        let size = xyz!(k => self.d[k].abs());
        let x = L::bits(size[1].max(size[2]).le(size[0]));
        let y = L::bits(size[2].le(size[1])) & !x;
        [x & self.usable, y & self.usable, !(x | y) & self.usable]
    }
}

#[inline(always)]
fn longest<L: Lanes>(size: [L; 3]) -> L {
    size[0].max(size[1]).max(size[2])
}

/// What the triangle test needs of rays with a common longest axis.
pub(super) struct Sheared<L> {
    axes: [usize; 3],
    shear: [L; 2],
    inv_z: L,
}

impl<L: Lanes> Sheared<L> {
    #[inline(always)]
    pub(super) fn new(rays: &Columns<L>, kz: usize) -> Self {
        let axes = [[1, 2, 0], [2, 0, 1], [0, 1, 2]][kz];
        let [x, y, z] = axes.map(|k| rays.d[k]);
        let inv_z = L::splat(1.0).div(z);
        Self { axes, shear: [x.mul(inv_z), y.mul(inv_z)], inv_z }
    }

    /// All rays against one triangle of a block; those it misses by far are `None` together.
    #[inline(always)]
    pub(super) fn test(&self, rays: &Columns<L>, block: &Block, lane: usize, t_max: L) -> Option<Found<L>> {
        let [kx, ky, kz] = self.axes;
        let relative = |k: usize, vertex: usize| L::splat(block.vertices[k][vertex][lane]).sub(rays.o[k]);
        let z: [L; 3] = xyz!(i => relative(kz, i));
        let x: [L; 3] = xyz!(i => relative(kx, i).sub(self.shear[0].mul(z[i])));
        let y: [L; 3] = xyz!(i => relative(ky, i).sub(self.shear[1].mul(z[i])));
        let extent = L::splat(block.extent).add(rays.vertex_error);
        triangle::resolve(x, y, z, extent, rays.reach, self.inv_z, t_max)
    }
}

/// One ray and one triangle in f64.
pub(super) fn precise(ray: &Ray, block: &Block, lane: usize) -> Option<(f32, f32, f32)> {
    let o = ray.origin.as_dvec3();
    let vertex = |i: usize| Vec3::from(block.vertices.map(|axis| axis[i][lane])).as_dvec3() - o;
    let vertices: [DVec3; 3] = [vertex(0), vertex(1), vertex(2)];
    triangle::precise(ray.dir.as_dvec3(), vertices)
}

/// Rays on one way: the same signs of direction, the same longest axis.
struct Way<L> {
    near_row: [usize; 3],
    far_row: [usize; 3],
    inv: [L; 3],
    near: [L; 3],
    far: [L; 3],
    /// Bounds of `inv`, and of the constants of the near and far planes for each of the two.
    lo: [Interval; 3],
    hi: [Interval; 3],
}

#[derive(Clone, Copy)]
struct Interval {
    inv: f32,
    near: f32,
    far: f32,
}

impl Interval {
    /// The constants for the least and the greatest of the `active` rays' reciprocals, with the origin that makes the near plane nearest and the one that
    /// makes the far plane farthest, each moved on by its slack.
    #[inline(always)]
    fn of_both<L: Lanes>(o: L, inv: L, negative: bool, active: L::Mask) -> (Self, Self) {
        let range = |x: L| {
            let least = L::select(active, x, L::splat(f32::INFINITY)).least();
            (least, L::select(active, x, L::splat(f32::NEG_INFINITY)).greatest())
        };
        let (o_range, inv_range) = (range(o), range(inv));
        let (below, above) = (o_range.0 - o_range.0.abs() * ORIGIN_SLACK, o_range.1 + o_range.1.abs() * ORIGIN_SLACK);
        let (near, far) = if negative { (below, above) } else { (above, below) };
        let with = |inv: f32| Self { inv, near: -(near * inv), far: -(far * inv) };
        (with(inv_range.0), with(inv_range.1))
    }
}

impl<L: Lanes> Way<L> {
    /// The way of most of the `active` rays, and which they are.
    #[inline(always)]
    fn of_most(rays: &Columns<L>, active: u32) -> (Self, Sheared<L>, u32) {
        let by_axis = rays.by_axis();
        let kz = (0..3).max_by_key(|&k| (by_axis[k] & active).count_ones()).unwrap_or(0);
        let mut active = active & by_axis[kz];
        let zero = L::splat(0.0);
        let mut negative = [false; 3];
        for (d, negative) in rays.d.iter().zip(&mut negative) {
            let below = L::bits(d.lt(zero)) & active;
            *negative = 2 * below.count_ones() > active.count_ones();
            active &= if *negative { below } else { !below };
        }
        let size = xyz!(k => rays.d[k].abs());
        let least = longest(size).mul(L::splat(SMALLEST_SLOPE));
        let one = xyz!(k => L::splat(if negative[k] { -1.0 } else { 1.0 }));
        let inv = xyz!(k => one[k].div(size[k].max(least)));
        let middle = xyz!(k => rays.o[k].mul(inv[k]).neg());
        let slack = xyz!(k => middle[k].abs().mul(L::splat(ORIGIN_SLACK)));
        let lanes = L::mask(active);
        let intervals = xyz!(k => Interval::of_both(rays.o[k], inv[k], negative[k], lanes));
        let way = Self {
            near_row: xyz!(k => if negative[k] { k + 3 } else { k }),
            far_row: xyz!(k => if negative[k] { k } else { k + 3 }),
            inv,
            near: xyz!(k => middle[k].sub(slack[k])),
            far: xyz!(k => middle[k].add(slack[k])),
            lo: intervals.map(|i| i.0),
            hi: intervals.map(|i| i.1),
        };
        (way, Sheared::new(rays, kz), active)
    }

    /// Children that any ray may meet before `t_max`, and where at the earliest: a box a lane.
    #[inline(always)]
    fn test_all(&self, node: &Node, t_max: f32) -> (u32, L) {
        let (mut enter, mut leave) = (L::splat(0.0), L::splat(t_max));
        for k in 0..3 {
            let (a, b) = (&self.lo[k], &self.hi[k]);
            let near = L::load(&node.rows[self.near_row[k] & 7]);
            let far = L::load(&node.rows[self.far_row[k] & 7]);
            let at = |plane: L, inv: f32, c: f32| plane.mul_add(L::splat(inv), L::splat(c));
            enter = at(near, a.inv, a.near).min(at(near, b.inv, b.near)).max(enter);
            leave = at(far, a.inv, a.far).max(at(far, b.inv, b.far)).min(leave);
        }
        (L::bits(enter.le(leave)), enter)
    }

    /// Rays that may meet one child: a ray a lane.
    #[inline(always)]
    fn test_each(&self, node: &Node, lane: u32, t_max: L) -> u32 {
        let plane = |row: usize| L::splat(node.rows[row & 7][lane as usize & 7]);
        let near = |k: usize| plane(self.near_row[k]).mul_add(self.inv[k], self.near[k]);
        let far = |k: usize| plane(self.far_row[k]).mul_add(self.inv[k], self.far[k]);
        let enter = near(0).max(near(1)).max(near(2).max(L::splat(0.0)));
        let leave = far(0).min(far(1)).min(far(2).min(t_max));
        L::bits(enter.le(leave))
    }
}

/// A child to visit.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Entry {
    /// Distance, then child.
    key: u64,
    active: u32,
}

/// What a packet does with what it finds.
pub(super) trait Collect<L: Lanes> {
    /// Whether hits shorten rays, so that the nearest boxes should come first.
    const NEAREST: bool;
    /// Takes a triangle's hits. The found lanes may include rays that are not asked about.
    fn triangle(&mut self, block: &Block, lane: usize, found: &Found<L>, active: u32);
    /// Tests an object.
    fn object(&mut self, object: usize, active: u32);
    /// Ends of the rays by now.
    fn t_max(&self) -> L;
    /// Rays still looked for.
    fn active(&self) -> u32;
}

/// Traces what rays of a packet go one way; returns which those were. The others are the caller's.
#[inline(always)]
pub(super) fn trace<C: Cpu, S: Collect<C::Wide>>(bvh: &Bvh, rays: &Columns<C::Wide>, asked: u32, collect: &mut S) -> u32 {
    let Some(mut node) = bvh.nodes.first() else { return asked };
    let asked = asked & rays.usable;
    if asked.count_ones() < FEW {
        return 0;
    }
    let (way, sheared, together) = Way::of_most(rays, asked);
    if together.count_ones() < FEW {
        return 0;
    }
    let (mut stack, mut height) = Stack::<Entry>::new();
    let mut active = together;
    let lanes = C::Wide::mask(together);
    let nowhere = C::Wide::splat(f32::NEG_INFINITY);
    let mut t_max = collect.t_max();
    let mut last = C::Wide::select(lanes, t_max, nowhere).greatest();
    loop {
        let (mut mask, enter) = way.test_all(node, last);
        let mut n = 0;
        let enter = enter.store();
        while mask != 0 {
            // The builder put first what most likely ends rays that only ask whether they are blocked: it goes on top.
            let lane = if S::NEAREST { mask.trailing_zeros() } else { 31 - mask.leading_zeros() };
            mask ^= 1 << lane;
            let active = way.test_each(node, lane, t_max) & active;
            if active != 0 {
                let child = node.child(lane);
                prefetch::<C>(bvh, child);
                let key = u64::from(enter[lane as usize & 7].to_bits()) << 32 | u64::from(child.0);
                stack.push(&mut height, Entry { key, active });
                n += 1;
            }
        }
        if S::NEAREST && n > 1 {
            stack.sort_last(&height, n);
        }
        loop {
            let Some(entry) = stack.pop(&mut height) else { return together };
            active = entry.active & collect.active();
            if active == 0 || f32::from_bits((entry.key >> 32) as u32) > last {
                continue;
            }
            let child = Child(entry.key as u32);
            if let Some(index) = child.as_node() {
                node = &bvh.nodes[index];
                break;
            }
            if let Some(object) = child.as_object() {
                collect.object(object, active);
            } else {
                for block in &bvh.blocks[child.as_blocks()] {
                    for lane in 0..block.count as usize {
                        if let Some(found) = sheared.test(rays, block, lane, t_max)
                            && (found.sure | found.unsure) & active != 0
                        {
                            collect.triangle(block, lane, &found, active);
                            if S::NEAREST {
                                t_max = collect.t_max();
                            }
                        }
                    }
                }
            }
            if S::NEAREST {
                t_max = collect.t_max();
                last = C::Wide::select(lanes, t_max, nowhere).greatest();
            }
        }
    }
}

const _: () = assert!(WIDTH == 8, "packets and nodes share their lanes");
