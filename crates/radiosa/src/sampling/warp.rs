//! Maps from the unit square, each beside its density.
//!
//! Local directions have the normal as +z. Densities are per steradian unless said otherwise.

use std::f32::consts::{FRAC_1_PI, FRAC_PI_4, PI, TAU};

use crate::math::{Vec2, Vec3, function};

/// The square onto the unit disc, concentric squares to concentric circles, so that neighbours stay neighbours. Uniform: `1/π` per unit
/// area. [Shirley97]
pub fn uniform_disc(u: Vec2) -> Vec2 {
    let p = u * 2.0 - Vec2::ONE;
    if p == Vec2::ZERO {
        return Vec2::ZERO;
    }
    let (r, phi) =
        if p.x.abs() > p.y.abs() { (p.x, FRAC_PI_4 * (p.y / p.x)) } else { (p.y, 2.0 * FRAC_PI_4 - FRAC_PI_4 * (p.x / p.y)) };
    Vec2::new(r * function::cos(phi), r * function::sin(phi))
}

/// Directions of the hemisphere in proportion to the cosine: points of the disc, lifted.
pub fn cosine_hemisphere(u: Vec2) -> Vec3 {
    let d = uniform_disc(u);
    Vec3::new(d.x, d.y, (1.0 - d.length_squared()).max(0.0).sqrt())
}

/// Density of [`cosine_hemisphere`]: `cos θ/π`.
pub fn cosine_hemisphere_pdf(w: Vec3) -> f32 {
    w.z.max(0.0) * FRAC_1_PI
}

/// All directions of the hemisphere alike.
pub fn uniform_hemisphere(u: Vec2) -> Vec3 {
    at_height(1.0 - u.x, u.y)
}

/// Density of [`uniform_hemisphere`].
pub fn uniform_hemisphere_pdf(w: Vec3) -> f32 {
    if w.z >= 0.0 { 1.0 / TAU } else { 0.0 }
}

/// All directions alike; density `1/(4π)`.
pub fn uniform_sphere(u: Vec2) -> Vec3 {
    at_height(1.0 - 2.0 * u.x, u.y)
}

/// Directions within `cos_max` of +z alike.
pub fn uniform_cone(u: Vec2, cos_max: f32) -> Vec3 {
    at_height(1.0 - u.x * (1.0 - cos_max), u.y)
}

/// Density of [`uniform_cone`].
pub fn uniform_cone_pdf(w: Vec3, cos_max: f32) -> f32 {
    if w.z >= cos_max { 1.0 / (TAU * (1.0 - cos_max)) } else { 0.0 }
}

/// Barycentric weights uniform over a triangle; density one over its area. The square is folded, not squeezed: [Heitz19].
pub fn uniform_triangle(u: Vec2) -> [f32; 3] {
    let (a, b) = if u.y > u.x { (0.5 * u.x, u.y - 0.5 * u.x) } else { (u.x - 0.5 * u.y, 0.5 * u.y) };
    [a, b, (1.0 - a - b).max(0.0)]
}

/// The square in proportion to the bilinear function with these values, not negative, at its corners (0,0), (1,0), (0,1), (1,1); the point and its
/// density.
pub fn bilinear([a, b, c, d]: [f32; 4], u: Vec2) -> (Vec2, f32) {
    let between = |t: f32, from: f32, to: f32| from + t * (to - from);
    // Inverts t ↦ ∫₀ᵗ (f + s (g − f)) ds / ((f + g)/2).
    let linear = |u: f32, f: f32, g: f32| {
        let root = between(u, f * f, g * g).max(0.0).sqrt();
        if f + root > 0.0 { (u * (f + g) / (f + root)).min(ONE_BELOW) } else { u }
    };
    let y = linear(u.y, a + b, c + d);
    let (left, right) = (between(y, a, c), between(y, b, d));
    let x = linear(u.x, left, right);
    let sum = a + b + c + d;
    (Vec2::new(x, y), if sum > 0.0 { 4.0 * between(x, left, right) / sum } else { 1.0 })
}

/// Density of [`bilinear`] at a point.
pub fn bilinear_pdf([a, b, c, d]: [f32; 4], p: Vec2) -> f32 {
    let between = |t: f32, from: f32, to: f32| from + t * (to - from);
    let sum = a + b + c + d;
    if sum > 0.0 { 4.0 * between(p.x, between(p.y, a, c), between(p.y, b, d)) / sum } else { 1.0 }
}

/// The largest number below one.
const ONE_BELOW: f32 = 1.0 - f32::EPSILON / 2.0;

fn at_height(z: f32, turn: f32) -> Vec3 {
    let r = ((1.0 - z) * (1.0 + z)).max(0.0).sqrt();
    let phi = 2.0 * PI * turn;
    Vec3::new(r * function::cos(phi), r * function::sin(phi), z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::Stream;

    /// χ² of samples over 8 × 16 cells of (height, longitude) against expected fractions by height band; 127 degrees of freedom.
    fn chi_square(sample: impl Fn(Vec2) -> Vec3, fraction_below: impl Fn(f64) -> f64) -> f64 {
        const BANDS: usize = 8;
        const SECTORS: usize = 16;
        const N: u32 = 200_000;
        let mut stream = Stream::new(11, 0, 0);
        let mut count = [0.0; BANDS * SECTORS];
        for _ in 0..N {
            let w = sample(stream.next_2d());
            let band = ((w.z * BANDS as f32) as usize).min(BANDS - 1);
            let turn = function::atan2(w.y, w.x) / TAU + 0.5;
            count[band * SECTORS + ((turn * SECTORS as f32) as usize).min(SECTORS - 1)] += 1.0;
        }
        let mut sum = 0.0;
        for band in 0..BANDS {
            let z = |b: usize| b as f64 / BANDS as f64;
            let expected = f64::from(N) * (fraction_below(z(band + 1)) - fraction_below(z(band))) / SECTORS as f64;
            sum += count[band * SECTORS..][..SECTORS].iter().map(|c: &f64| (c - expected).powi(2) / expected).sum::<f64>();
        }
        sum
    }

    /// With 127 degrees of freedom χ² exceeds this once in 10⁶ runs (Wilson–Hilferty); the seed is fixed.
    const LIMIT: f64 = 211.0;

    #[test]
    fn directions_follow_their_densities() {
        assert!(chi_square(cosine_hemisphere, |z| z * z) < LIMIT);
        assert!(chi_square(uniform_hemisphere, |z| z) < LIMIT);
        assert!(chi_square(|u| uniform_cone(u, 0.0), |z| z) < LIMIT);
        let upper = |u: Vec2| uniform_sphere(u) * Vec3::new(1.0, 1.0, if uniform_sphere(u).z < 0.0 { -1.0 } else { 1.0 });
        assert!(chi_square(upper, |z| z) < LIMIT);
        // Wrong twins: a cosine lobe where a uniform one is claimed, and a disc whose radius forgot the root.
        assert!(chi_square(cosine_hemisphere, |z| z) > 10.0 * LIMIT);
        let clumped = |u: Vec2| Vec3::new(u.x * (TAU * u.y).cos(), u.x * (TAU * u.y).sin(), (1.0 - u.x * u.x).sqrt());
        assert!(chi_square(clumped, |z| z * z) > 10.0 * LIMIT);
    }

    #[test]
    fn densities_integrate_to_one() {
        let n = 200;
        let integral = |pdf: &dyn Fn(Vec3) -> f32| {
            // Over the whole sphere, midpoint rule in height.
            (0..2 * n)
                .map(|i| (f64::from(i) + 0.5) / f64::from(n) - 1.0)
                .map(|z| f64::from(pdf(Vec3::new(0.0, 0.0, z as f32))))
                .sum::<f64>()
                * std::f64::consts::TAU
                / f64::from(n)
        };
        assert!((integral(&cosine_hemisphere_pdf) - 1.0).abs() < 1e-5);
        assert!((integral(&uniform_hemisphere_pdf) - 1.0).abs() < 1e-5);
        assert!((integral(&|w| uniform_cone_pdf(w, 0.75)) - 1.0).abs() < 1e-5);
    }

    #[test]
    fn bilinear_points_follow_their_density() {
        for corners in [[1.0f32, 1.0, 1.0, 1.0], [0.1, 1.0, 0.3, 2.0], [0.0, 0.0, 1.0, 3.0], [1.0, 0.0, 0.0, 0.0]] {
            let mut stream = Stream::new(9, 0, 0);
            const CELLS: usize = 8;
            let (mut count, mut inverse) = ([0.0; CELLS * CELLS], 0.0);
            let n = 200_000;
            for _ in 0..n {
                let (p, pdf) = bilinear(corners, stream.next_2d());
                assert!(p.cmpge(Vec2::ZERO).all() && p.cmplt(Vec2::ONE).all() && pdf > 0.0);
                assert!((pdf - bilinear_pdf(corners, p)).abs() <= 1e-5 * pdf);
                count[(p.y * CELLS as f32) as usize * CELLS + (p.x * CELLS as f32) as usize] += 1.0;
                inverse += f64::from(1.0 / pdf) / f64::from(n);
            }
            // A bilinear function's mean over a cell is its value in the middle.
            let value = |x: f64, y: f64| {
                let [a, b, c, d] = corners.map(f64::from);
                (1.0 - y) * ((1.0 - x) * a + x * b) + y * ((1.0 - x) * c + x * d)
            };
            let middle = |i: usize| (i as f64 + 0.5) / CELLS as f64;
            let sum = corners.iter().map(|c| f64::from(*c)).sum::<f64>() / 4.0;
            let expected = |k: usize| f64::from(n) * value(middle(k % CELLS), middle(k / CELLS)) / sum / (CELLS * CELLS) as f64;
            let chi_square: f64 = (0..CELLS * CELLS).map(|k| (count[k] - expected(k)).powi(2) / expected(k)).sum();
            // 63 degrees of freedom: once in 10⁶ runs.
            assert!(chi_square < 126.0, "{corners:?}: {chi_square}");
            // ∫ 1/p · p = 1 where p is nowhere 0.
            assert!(corners.contains(&0.0) || (inverse - 1.0).abs() < 0.03, "{corners:?}: {inverse}");
        }
    }

    #[test]
    fn triangle_points_have_the_moments_of_a_uniform_triangle() {
        let mut stream = Stream::new(5, 0, 0);
        let n = 100_000;
        let (mut mean, mut product) = ([0.0; 3], 0.0);
        for _ in 0..n {
            let b = uniform_triangle(stream.next_2d());
            assert!(b.iter().all(|&b| b >= 0.0) && (b.iter().sum::<f32>() - 1.0).abs() < 1e-6);
            mean.iter_mut().zip(b).for_each(|(m, b)| *m += f64::from(b) / f64::from(n));
            product += f64::from(b[0] * b[1]) / f64::from(n);
        }
        // E[b] = 1/3 with standard deviation 0.2357, E[b₀ b₁] = 1/12 with 0.0656; five sigma each.
        assert!(mean.iter().all(|m| (m - 1.0 / 3.0).abs() < 5.0 * 0.2357 / f64::from(n).sqrt()), "{mean:?}");
        assert!((product - 1.0 / 12.0).abs() < 5.0 * 0.0656 / f64::from(n).sqrt(), "{product}");
    }
}
