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
