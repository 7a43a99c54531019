//! A ray against a block of triangles, so that nothing slips between two that share an edge.
//!
//! The test is that of [Woop13] (Woop, Benthin, Wald 2013, *Watertight Ray/Triangle Intersection*): move the origin of
//! space to the ray's, permute the axes so that the ray's longest component is z, shear so that the ray *is* the z axis, and ask on
//! which side of each projected edge the origin lies:
//!
//! | code | paper | meaning |
//! |---|---|---|
//! | `kx`, `ky`, `kz` | the same | permuted axes; `kz` is the ray's longest |
//! | `sx`, `sy` | S_x, S_y | shear, at most 1 in size |
//! | `u`, `v`, `w` | U, V, W | scaled barycentric weights of the vertices a, b, c |
//!
//! Both triangles at an edge compute its function from the same two sheared vertices with the same roundings, up to the sign, hence
//! no products are fused here: a fused one would round the two differently.
//!
//! Where we depart: the paper repeats the test in f64 when an edge function is *exactly* zero, which keeps closed surfaces closed, yet
//! at a silhouette f32 may still decide against a hit that exact arithmetic sees. Here the test is repeated whenever a
//! function is within its own rounding-error bound of zero, and [`precise`] counts what is within *its* bound as inside. What
//! a reference in f64 hits is therefore hit. The bound costs nothing where it matters: for a ray that does meet the
//! triangle, the sheared vertices are no farther away than the triangle is large, so one number a block is enough to let
//! every true hit through the first test; lanes that pass get their own.

use super::bvh::Block;
use super::prepared::Prepared;
use crate::math::DVec3;
use crate::math::lanes::{Lanes, xyz};

/// Half a unit in the last place of 1.
const EPSILON: f32 = f32::EPSILON * 0.5;

/// Error of an edge function is below `EDGE_ERROR · e · (z + e)`, where `e` bounds the sheared vertices of a triangle that is hit (twice
/// its longest extent, `Block::extent`, plus their own error) and `z` their depth. Each sheared coordinate is off by at most ε(6z + 2e):
/// one rounding of the difference in x, one in z, two of the slope, the product's, the final one. The function has four of them,
/// each multiplied by at most `e`, and three roundings of its own: ε·e·(24z + 12e).
const EDGE_ERROR: f32 = 25.0 * EPSILON;

/// Added to `e` for a vertex's own error, in parts of the distance.
pub(super) const VERTEX_ERROR: f32 = 8.0 * EPSILON;

/// Lanes of a block that the ray may hit.
pub(super) struct Found<L> {
    /// Lanes that are hit, within the range of `t`.
    pub sure: u32,
    /// Lanes for [`precise`] to decide.
    pub unsure: u32,
    /// Ray parameter where `sure`.
    pub t: L,
    /// Weight of the second vertex where `sure`.
    pub u: L,
    /// Weight of the third vertex where `sure`.
    pub v: L,
}

/// Tests one ray against a block; `t` in `(0, t_max]`. `None` when no lane can be hit, by far the most frequent answer.
#[inline(always)]
pub(super) fn test<L: Lanes>(ray: &Prepared, block: &Block, t_max: f32) -> Option<Found<L>> {
    let [kx, ky, kz] = ray.axes;
    let o = |k: usize| L::splat(ray.o[k]);
    let relative = |k: usize, vertex: usize| L::load(&block.vertices[k][vertex]).sub(o(k));
    let (sx, sy) = (L::splat(ray.shear[0]), L::splat(ray.shear[1]));
    let z: [L; 3] = xyz!(i => relative(kz, i));
    let x: [L; 3] = xyz!(i => relative(kx, i).sub(sx.mul(z[i])));
    let y: [L; 3] = xyz!(i => relative(ky, i).sub(sy.mul(z[i])));
    let extent = block.extent + ray.vertex_error;
    resolve(x, y, z, L::splat(extent), L::splat(ray.reach), L::splat(ray.inv_z), L::splat(t_max))
}

/// The part of the test that is the same for one ray and many triangles, and for many rays and one triangle.
#[inline(always)]
pub(super) fn resolve<L: Lanes>(x: [L; 3], y: [L; 3], z: [L; 3], extent: L, reach: L, inv_z: L, t_max: L) -> Option<Found<L>> {
    let u = x[2].mul(y[1]).sub(y[2].mul(x[1]));
    let v = x[0].mul(y[2]).sub(y[0].mul(x[2]));
    let w = x[1].mul(y[0]).sub(y[1].mul(x[0]));
    let (lo, hi) = (u.min(v).min(w), u.max(v).max(w));
    // `reach` is at least every `z`.
    let extent_error = extent.mul(L::splat(EDGE_ERROR));
    let e = extent_error.mul(reach.add(extent));
    let candidates = L::either(e.neg().le(lo), hi.le(e));
    if L::bits(candidates) == 0 {
        return None;
    }
    let depth = z[0].abs().max(z[1].abs()).max(z[2].abs());
    let e = extent_error.mul(depth.add(extent));
    let inside = L::either(e.lt(lo), hi.lt(e.neg()));
    let outside = L::both(lo.lt(e.neg()), e.lt(hi));
    let det = u.add(v).add(w);
    // A triangle seen so nearly edge-on that the weights are mostly rounding error is left to f64 too.
    let steep = e.mul(L::splat(8.0)).lt(det.abs());
    let sure = L::both(inside, steep);
    let inv = L::splat(1.0).div(det);
    let (u, v, w) = (u.mul(inv), v.mul(inv), w.mul(inv));
    let t = u.mul(z[0]).add(v.mul(z[1])).add(w.mul(z[2])).mul(inv_z);
    let in_range = L::both(L::splat(0.0).lt(t), t.le(t_max));
    let (candidates, outside, sure_bits) = (L::bits(candidates), L::bits(outside), L::bits(sure));
    Some(Found { sure: sure_bits & L::bits(in_range), unsure: candidates & !outside & !sure_bits, t, u: v, v: w })
}

/// The same test in f64, for vertices relative to the ray's origin (exact differences of f32, as good as always): ray parameter
/// and weights of the second and third vertex. Edges belong to the triangle, with all that rounding cannot tell from them.
#[cold]
#[inline(never)]
pub(super) fn precise(d: DVec3, [a, b, c]: [DVec3; 3]) -> Option<(f32, f32, f32)> {
    let (u, v, w) = (d.dot(c.cross(b)), d.dot(a.cross(c)), d.dot(b.cross(a)));
    // Each is a sum of six products of three factors: seven roundings of at most 6·|d|·m² in size, as much again for whoever compares.
    let m = a.abs().max(b.abs()).max(c.abs()).max_element();
    let error = 128.0 * f64::EPSILON * d.abs().max_element() * m * m;
    let (lo, hi) = (u.min(v).min(w), u.max(v).max(w));
    let det = u + v + w;
    if !(lo >= -error || hi <= error) || det.abs() <= 3.0 * error {
        return None;
    }
    let weight = |x: f64| (x / det).clamp(0.0, 1.0);
    let (v, w) = (weight(v), weight(w));
    let w = w.min(1.0 - v);
    // From the plane, which gives exactly 0 for an origin in it; but not beyond the vertices' depths, in the ray's largest axis.
    let k = if d.x.abs() >= d.y.abs().max(d.z.abs()) {
        0
    } else if d.y.abs() >= d.z.abs() {
        1
    } else {
        2
    };
    let depths = [a[k] / d[k], b[k] / d[k], c[k] / d[k]];
    let (first, last) = depths.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), &t| (t.min(lo), t.max(hi)));
    let n = (b - a).cross(c - a);
    let t = (a.dot(n) / d.dot(n)).max(first).min(last);
    Some((t as f32, v as f32, w as f32))
}
