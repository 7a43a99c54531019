//! The light of a polygon past another one at a point, in closed form.

use std::f64::consts::FRAC_1_PI;

/// A point or direction.
pub type V = [f64; 3];

fn sub(a: V, b: V) -> V {
    std::array::from_fn(|i| a[i] - b[i])
}

fn dot(a: V, b: V) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: V, b: V) -> V {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The form factor from a point with unit normal `n` to a polygon that lies above it, seen from either side: Lambert's sum `1/2π |Σ γ_k · n|` over edges, γ_k as long as the angle
/// an edge is seen under.
pub fn point_to_polygon(p: V, n: V, polygon: &[V]) -> f64 {
    let mut sum = 0.0;
    for (k, &a) in polygon.iter().enumerate() {
        let [a, b] = [a, polygon[(k + 1) % polygon.len()]].map(|c| sub(c, p));
        let wedge = cross(a, b);
        let length = dot(wedge, wedge).sqrt();
        if length > 0.0 {
            sum += length.atan2(dot(a, b)) * dot(wedge, n) / length;
        }
    }
    0.5 * FRAC_1_PI * sum.abs()
}

/// The part of a convex polygon on the side of the plane through `p` that `normal` points to.
fn clipped(polygon: &[V], p: V, normal: V) -> Vec<V> {
    let mut out = Vec::new();
    for (k, &a) in polygon.iter().enumerate() {
        let b = polygon[(k + 1) % polygon.len()];
        let [ha, hb] = [a, b].map(|c| dot(sub(c, p), normal));
        if ha >= 0.0 {
            out.push(a);
        }
        if ha * hb < 0.0 {
            let t = ha / (ha - hb);
            out.push(std::array::from_fn(|i| a[i] + t * (b[i] - a[i])));
        }
    }
    out
}

/// The same past a convex blocker that lies wholly between: the polygon less what of it lies in the cone over the blocker.
pub fn point_to_polygon_past(p: V, n: V, polygon: &[V], blocker: &[V]) -> f64 {
    let sum = |i: usize| blocker.iter().map(|c| c[i]).sum::<f64>() / blocker.len() as f64;
    let middle = sub([sum(0), sum(1), sum(2)], p);
    let mut hidden = polygon.to_vec();
    for (k, &a) in blocker.iter().enumerate() {
        let normal = cross(sub(a, p), sub(blocker[(k + 1) % blocker.len()], p));
        let inwards = if dot(normal, middle) >= 0.0 { normal } else { normal.map(|x| -x) };
        hidden = clipped(&hidden, p, inwards);
    }
    point_to_polygon(p, n, polygon) - if hidden.len() >= 3 { point_to_polygon(p, n, &hidden) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(y: f64, side: f64, x: f64) -> [V; 4] {
        let h = 0.5 * side;
        [[x - h, y, -h], [x - h, y, h], [x + h, y, h], [x + h, y, -h]]
    }

    #[test]
    fn blockers_hide_what_they_cover() {
        let (p, n, light) = ([0.0; 3], [0.0, 1.0, 0.0], square(2.0, 1.0, 0.0));
        let all = point_to_polygon(p, n, &light);
        // The factor to a rectangle over its corner (C-4), four times.
        let x = 0.25f64;
        let quarter = 2.0 * 0.5 * FRAC_1_PI * x / (1.0 + x * x).sqrt() * (x / (1.0 + x * x).sqrt()).atan();
        assert!((all - 4.0 * quarter).abs() < 1e-14);
        // From p the blocker's shadow on the light is twice as large: half the light, all of it, nothing of it.
        assert!((point_to_polygon_past(p, n, &light, &square(1.0, 0.5, 0.25)) - 0.5 * all).abs() < 1e-14);
        assert!(point_to_polygon_past(p, n, &light, &square(1.0, 0.6, 0.0)).abs() < 1e-14);
        assert!((point_to_polygon_past(p, n, &light, &square(1.0, 0.5, 3.0)) - all).abs() < 1e-14);
        // A hole's worth.
        let hidden = point_to_polygon(p, n, &square(2.0, 0.4, 0.1));
        assert!((point_to_polygon_past(p, n, &light, &square(1.0, 0.2, 0.05)) - (all - hidden)).abs() < 1e-14);
    }
}
