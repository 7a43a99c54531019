//! Form factors of polygons in closed form: from a point by a sum over edges, from a polygon by a double integral over edges.
//!
//! Nothing here knows of occluders; `visibility` does.

use std::f64::consts::{FRAC_1_PI, PI};

use crate::math::function::{atan_f64, ln_f64};
use crate::math::polygon::{area_vector, clip};
use crate::math::{DVec3, function};

/// Form factor from a differential area to a polygon seen in full, by summing signed edge contributions.
///
/// | code    | paper | meaning                                                                   |
/// |---------|-------|---------------------------------------------------------------------------|
/// | `n`     | N_i   | unit normal at the point                                                  |
/// | `gamma` | Γ_g   | unit normal of the wedge (point, edge g), scaled by its angle, in radians |
///
/// Dimensionless, in `[0, 1]`; zero where the polygon turns its back. The polygon must lie above the point's horizon: [`point_to_polygon`]
/// clips first. Source: [Baum89], the edge-sum form.
pub fn point_to_visible_polygon(p: DVec3, n: DVec3, polygon: &[DVec3]) -> f64 {
    let mut sum = 0.0;
    let Some(&last) = polygon.last() else { return 0.0 };
    let mut a = last - p;
    for &corner in polygon {
        let b = corner - p;
        let wedge = a.cross(b);
        let sine = wedge.length();
        if sine > 0.0 {
            let angle = libm::atan2(sine, a.dot(b));
            let gamma = wedge * (angle / sine);
            sum += n.dot(gamma);
        }
        a = b;
    }
    // Counter-clockwise seen from the polygon's front is clockwise seen from a point before it.
    (-sum * (0.5 * FRAC_1_PI)).max(0.0)
}

/// Form factor from a differential area of unit normal `n` to a convex polygon, cut off at the horizon; `scratch` is overwritten.
///
/// Zero for points behind the polygon or in its plane.
pub fn point_to_polygon(p: DVec3, n: DVec3, polygon: &[DVec3], scratch: &mut Vec<DVec3>) -> f64 {
    let front = area_vector(polygon);
    let Some(&corner) = polygon.first() else { return 0.0 };
    if (p - corner).dot(front) <= 0.0 {
        return 0.0;
    }
    let heights = polygon.iter().map(|&v| (v - p).dot(n));
    let (below, above) = heights.fold((false, false), |(below, above), h| (below || h < 0.0, above || h > 0.0));
    match (below, above) {
        (_, false) => 0.0,
        (false, true) => point_to_visible_polygon(p, n, polygon),
        (true, true) => {
            clip(polygon, p, n, 0.0, scratch);
            point_to_visible_polygon(p, n, scratch)
        }
    }
}

/// What leaves polygon `a` for polygon `b`: the exchange area `A_a F_ab = A_b F_ba`, m², without occluders.
///
/// Both are convex, one-sided, counter-clockwise seen from their fronts. Each is first cut by the other's plane. `tolerance` is the error asked
/// for, relative to the smaller area; the rule is refined until two of its orders agree that well, or to its highest order.
///
/// # The formula
///
/// ```text
/// A F = 1/(2π) ∮_a ∮_b ln r  dx·dy  =  1/(2π) Σ_edges cos(e, f) ∫_e ∫_f ln r dt ds
/// ```
///
/// The inner integral is closed, `∫ ln √(y² + h²) dy = y ln √(y² + h²) − y + h atan(y/h)`. The outer one is split where the edge is nearest to the other
/// and to its ends, and graded towards every split, so that edges that touch, where `ln r` has no bound, converge like the others.
/// Source: [Goral84].
pub fn exchange_area(a: &[DVec3], b: &[DVec3], tolerance: f64) -> f64 {
    let (na, nb) = (area_vector(a), area_vector(b));
    let (area_a, area_b) = (na.length(), nb.length());
    if area_a <= 0.0 || area_b <= 0.0 {
        return 0.0;
    }
    let (na, nb) = (na / area_a, nb / area_b);
    // Rounding of coordinates, relative to the larger polygon and its distance: corners that close to a plane lie in it.
    let reach = a.iter().chain(b).map(|p| (*p - a[0]).length()).fold(0.0, f64::max);
    let tiny = 1e-12 * reach;
    let (mut a_cut, mut b_cut) = (Vec::with_capacity(8), Vec::with_capacity(8));
    clip(b, a[0], na, tiny, &mut b_cut);
    if b_cut.len() < 3 {
        return 0.0;
    }
    clip(a, b[0], nb, tiny, &mut a_cut);
    if a_cut.len() < 3 {
        return 0.0;
    }
    let smaller = area_a.min(area_b);
    let mut value = contour(&a_cut, &b_cut, &RULES[0]);
    for rule in &RULES[1..] {
        let better = contour(&a_cut, &b_cut, rule);
        let change = (better - value).abs();
        value = better;
        if change <= tolerance * smaller {
            break;
        }
    }
    value.clamp(0.0, smaller)
}

/// The double sum over edges by one rule.
fn contour(a: &[DVec3], b: &[DVec3], rule: &[[f64; 2]]) -> f64 {
    let mut sum = 0.0;
    for (i, &a0) in a.iter().enumerate() {
        let e = a[(i + 1) % a.len()] - a0;
        for (j, &b0) in b.iter().enumerate() {
            let f = b[(j + 1) % b.len()] - b0;
            let cosine = e.dot(f);
            // (times both lengths)
            if cosine.abs() > 1e-15 * e.length() * f.length() {
                sum += cosine / (e.length() * f.length()) * edge_pair([a0, e], [b0, f], rule);
            }
        }
    }
    sum / (2.0 * PI)
}

/// `∫_e ∫_f ln r dt ds` for two edges given as start and vector.
fn edge_pair([a0, e]: [DVec3; 2], [b0, f]: [DVec3; 2], rule: &[[f64; 2]]) -> f64 {
    let (le, lf) = (e.length(), f.length());
    if le <= 0.0 || lf <= 0.0 {
        return 0.0;
    }
    let (u, v) = (e / le, f / lf);
    // Where on e it is nearest to either end of f, and to f's line.
    let w = b0 - a0;
    let c = u.dot(v);
    let mut splits = [0.0, w.dot(u), (w + f).dot(u), 0.0, le];
    let parallel = 1.0 - c * c;
    if parallel > 1e-12 {
        splits[3] = (w.dot(u) - c * w.dot(v)) / parallel;
    }
    for s in &mut splits {
        *s = s.clamp(0.0, le);
    }
    splits.sort_by(f64::total_cmp);
    let mut sum = 0.0;
    for ends in splits.windows(2) {
        let length = ends[1] - ends[0];
        if length <= 1e-14 * le {
            continue;
        }
        for [s, weight] in rule {
            let x = a0 + u * (ends[0] + s * length) - b0;
            let t0 = x.dot(v);
            let h = (x - v * t0).length();
            sum += weight * length * (log_integral(lf - t0, h) - log_integral(-t0, h));
        }
    }
    sum
}

/// `∫_0^y ln √(z² + h²) dz`.
fn log_integral(y: f64, h: f64) -> f64 {
    let r2 = y * y + h * h;
    if r2 <= 0.0 {
        return 0.0;
    }
    let around = if h > 0.0 { h * atan_f64(y / h) } else { 0.0 };
    y * (0.5 * ln_f64(r2) - 1.0) + around
}

/// Gauss–Legendre rules on `[0, 1]` graded towards both ends by `s = t³ (10 − 15 t + 6 t²)`: pairs of place and weight.
static RULES: std::sync::LazyLock<[Vec<[f64; 2]>; 4]> =
    std::sync::LazyLock::new(|| [8, 14, 28, 64].map(|n| gauss_legendre(n).into_iter().map(graded).collect()));

fn graded([t, w]: [f64; 2]) -> [f64; 2] {
    let s = t * t * t * (10.0 + t * (6.0 * t - 15.0));
    [s, w * 30.0 * (t * (1.0 - t)).powi(2)]
}

/// Places and weights of the Gauss–Legendre rule of `n` points on `[0, 1]`, by Newton's method on the Legendre polynomial.
pub(super) fn gauss_legendre(n: usize) -> Vec<[f64; 2]> {
    (0..n)
        .map(|i| {
            let mut x = function::cos_f64(PI * (n as f64 - 0.25 - i as f64) / (n as f64 + 0.5));
            let mut slope = 1.0;
            for _ in 0..100 {
                let (mut p, mut before) = (1.0, 0.0);
                for k in 1..=n {
                    let k = k as f64;
                    (p, before) = (((2.0 * k - 1.0) * x * p - (k - 1.0) * before) / k, p);
                }
                slope = n as f64 * (x * p - before) / (x * x - 1.0);
                let step = p / slope;
                x -= step;
                if step.abs() < 1e-16 {
                    break;
                }
            }
            [0.5 * (1.0 + x), 1.0 / ((1.0 - x * x) * slope * slope)]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gauss_legendre_integrates_polynomials_of_its_degree() {
        for n in [1, 2, 3, 8, 28] {
            let rule = gauss_legendre(n);
            for degree in 0..2 * n {
                let sum: f64 = rule.iter().map(|[x, w]| w * x.powi(degree as i32)).sum();
                assert!((sum - 1.0 / (degree as f64 + 1.0)).abs() < 1e-14, "{n} points, degree {degree}: {sum}");
            }
        }
    }

    #[test]
    fn the_inner_integral_is_that_of_a_logarithm() {
        // ∫_0^1 ln √(z² + 1) dz = ln √2 − 1 + π/4.
        assert!((log_integral(1.0, 1.0) - (0.5 * ln_f64(2.0) - 1.0 + PI / 4.0)).abs() < 1e-15);
        assert_eq!(log_integral(0.0, 0.0), 0.0);
    }
}
