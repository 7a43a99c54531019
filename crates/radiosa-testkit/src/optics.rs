//! Geometrical optics in closed form: plane-parallel slabs, the critical angle, the ball lens, and how much light each interface reflects.

/// Sideways shift of a ray that passes a slab of thickness `t` and index `n` in vacuum: `t sinθ (1 − cosθ/√(n² − sin²θ))`.
pub fn slab_shift(t: f64, n: f64, theta: f64) -> f64 {
    let (s, c) = theta.sin_cos();
    t * s * (1.0 - c / (n * n - s * s).sqrt())
}

/// How far along the layers a ray moves while it crosses a pile of them, each (thickness, index): `Σ t tanθ_i`, `n_i sinθ_i = sinθ`.
pub fn run_through_layers(layers: &[(f64, f64)], theta: f64) -> f64 {
    layers.iter().map(|(t, n)| t * (theta.sin() / n).asin().tan()).sum()
}

/// The angle beyond which light inside index `n` is totally reflected.
pub fn critical_angle(n: f64) -> f64 {
    (1.0 / n).asin()
}

/// Reflectance of an interface for unpolarised light, from index 1 to index `n`, by the sines and tangents of the two angles.
pub fn interface_reflectance(theta: f64, n: f64) -> f64 {
    if theta.sin() >= n {
        return 1.0;
    }
    if theta < 1e-6 {
        return ((n - 1.0) / (n + 1.0)).powi(2);
    }
    let inside = (theta.sin() / n).asin();
    let (minus, plus) = (theta - inside, theta + inside);
    0.5 * ((minus.sin() / plus.sin()).powi(2) + (minus.tan() / plus.tan()).powi(2))
}

/// Reflectance and transmittance of a slab of two such interfaces with all bounces between them: `2R/(1 + R)`, `(1 − R)/(1 + R)`.
pub fn slab_energy(r: f64) -> (f64, f64) {
    (2.0 * r / (1.0 + r), (1.0 - r) / (1.0 + r))
}

/// Where a ray parallel to the axis at height `h` crosses it behind a ball of radius `radius` and index `n`, from the centre: it is deviated by
/// `D = 2 (asin(h/R) − asin(h/nR))` and, by symmetry, leaves at the same distance `h` from the centre, so `h / sin D`.
pub fn ball_crossing(radius: f64, n: f64, h: f64) -> f64 {
    let deviation = 2.0 * ((h / radius).asin() - (h / (n * radius)).asin());
    h / deviation.sin()
}

/// The limit of [`ball_crossing`] near the axis, the effective focal length: `n R / (2 (n − 1))`.
pub fn ball_focal_length(radius: f64, n: f64) -> f64 {
    n * radius / (2.0 * (n - 1.0))
}

/// What is left of light after a slab of thickness `t` and index `n` that absorbs σ: `exp(−σ t / cosθ_inside)`.
pub fn slab_absorption(sigma: f64, t: f64, n: f64, theta: f64) -> f64 {
    (-sigma * t / (theta.sin() / n).asin().cos()).exp()
}
