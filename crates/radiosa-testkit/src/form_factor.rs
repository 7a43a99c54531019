//! Form factors in closed form, from the catalogue of configuration factors: discs, spheres, rectangles.

use std::f64::consts::{FRAC_1_PI, PI};

/// Between discs of radii `r1` and `r2`, parallel on one axis, `h` apart: the factor from the first (C-41).
pub fn coaxial_discs(r1: f64, r2: f64, h: f64) -> f64 {
    let (a, b) = (r1 / h, r2 / h);
    let x = 1.0 + (1.0 + b * b) / (a * a);
    0.5 * (x - (x * x - 4.0 * (b / a).powi(2)).sqrt())
}

/// From an element to a disc of radius `r` in a plane parallel to it, `h` above, whose axis is `l` aside.
pub fn element_to_parallel_disc(r: f64, h: f64, l: f64) -> f64 {
    if l == 0.0 {
        return r * r / (h * h + r * r);
    }
    let (h, r) = (h / l, r / l);
    let z = 1.0 + h * h + r * r;
    0.5 * (1.0 - (1.0 + h * h - r * r) / (z * z - 4.0 * r * r).sqrt())
}

/// From an element that faces the axis, `l` away, of a disc of radius `r`, whose plane is perpendicular to the element's, `h` along the axis.
pub fn element_to_perpendicular_disc(r: f64, h: f64, l: f64) -> f64 {
    let (h, r) = (h / l, r / l);
    let z = 1.0 + h * h + r * r;
    0.5 * h * (z / (z * z - 4.0 * r * r).sqrt() - 1.0)
}

/// From an element to a sphere of radius `r` whose centre is `d` away, `theta` from the element's normal.
pub fn element_to_sphere(r: f64, d: f64, theta: f64) -> f64 {
    let h = d / r;
    let (s, c) = theta.sin_cos();
    if theta <= (1.0 / h).acos() {
        return c / (h * h);
    }
    if theta >= PI - (1.0 / h).acos() {
        return 0.0;
    }
    let k = (h * h - 1.0).sqrt();
    0.5 - FRAC_1_PI * (k / (h * s)).asin()
        + FRAC_1_PI / (h * h) * (c * (-k * c / s).acos() - k * (1.0 - (h * c).powi(2)).max(0.0).sqrt())
}

/// From a sphere to a disc of radius `r` on an axis through its centre, `d` away from it.
pub fn sphere_to_disc(r: f64, d: f64) -> f64 {
    0.5 * (1.0 - 1.0 / (1.0 + (r / d).powi(2)).sqrt())
}

/// From a sphere to a rectangle of sides `a` and `b` with one corner on the perpendicular through the centre, `d` away from it.
pub fn sphere_to_rectangle(a: f64, b: f64, d: f64) -> f64 {
    0.25 * FRAC_1_PI * (a * b / (d * (a * a + b * b + d * d).sqrt())).atan()
}

/// Between equal rectangles `a × b`, opposed, `c` apart (C-11).
pub fn opposed_rectangles(a: f64, b: f64, c: f64) -> f64 {
    let (x, y) = (a / c, b / c);
    let (p, q) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
    2.0 * FRAC_1_PI / (x * y)
        * ((p * p * q * q / (1.0 + x * x + y * y)).sqrt().ln() + x * q * (x / q).atan() + y * p * (y / p).atan()
            - x * x.atan()
            - y * y.atan())
}

/// Mean transmittance between points of a sphere whose diameter has the optical depth `tau`: `2/τ² (1 − (1 + τ) e^(−τ))`, the chords of a sphere being spread
/// evenly over the squares of their lengths.
pub fn sphere_transmittance(tau: f64) -> f64 {
    if tau < 1e-3 {
        // (The closed form loses its digits.)
        return 1.0 - 2.0 / 3.0 * tau + 0.25 * tau * tau - tau * tau * tau / 15.0;
    }
    2.0 / (tau * tau) * (1.0 - (1.0 + tau) * (-tau).exp())
}

/// Between opposed unit squares `d` apart through a medium that absorbs `sigma` a metre: the double integral over both is one over the shift between their points,
/// `4 ∫∫ (1 − x)(1 − y) d²/(π r⁴) e^(−σ r) dx dy`, here by Simpson's rule.
pub fn opposed_squares_through(d: f64, sigma: f64) -> f64 {
    const N: usize = 400;
    let weight = |k: usize| match k {
        0 | N => 1.0,
        k if k % 2 == 1 => 4.0,
        _ => 2.0,
    };
    let mut sum = 0.0;
    for i in 0..=N {
        for j in 0..=N {
            let (x, y) = (i as f64 / N as f64, j as f64 / N as f64);
            let r2 = x * x + y * y + d * d;
            sum += weight(i) * weight(j) * (1.0 - x) * (1.0 - y) * d * d / (PI * r2 * r2) * (-sigma * r2.sqrt()).exp();
        }
    }
    4.0 * sum / (9.0 * (N * N) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_absorbed_is_the_factor_of_a_clear_medium() {
        assert!((opposed_squares_through(1.0, 0.0) - opposed_rectangles(1.0, 1.0, 1.0)).abs() < 1e-10);
        assert!((sphere_transmittance(1e-3) - sphere_transmittance(0.000_999_999)).abs() < 1e-8);
    }
}
