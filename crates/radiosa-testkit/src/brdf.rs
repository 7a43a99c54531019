//! The local reflection models and lights as formulas in f64, written from their sources and in other forms than the engine's where
//! there are several, so that the two check each other. Directions point away from the surface; the normal is `n`.

use std::f64::consts::PI;

/// A vector in space.
pub type V = [f64; 3];

/// Scalar product.
pub fn dot(a: V, b: V) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `a + k b`.
pub fn add(a: V, k: f64, b: V) -> V {
    std::array::from_fn(|i| a[i] + k * b[i])
}

/// To unit length.
pub fn unit(a: V) -> V {
    let length = dot(a, a).sqrt();
    a.map(|x| x / length)
}

/// The unit halfway vector.
pub fn half(l: V, v: V) -> V {
    unit(add(l, 1.0, v))
}

/// `((r·v)⁺)^e`, `r·v = 2 (n·l)(n·v) − l·v`. B. T. Phong 1975.
pub fn phong(n: V, l: V, v: V, e: f64) -> f64 {
    (2.0 * dot(n, l) * dot(n, v) - dot(l, v)).max(0.0).powf(e)
}

/// `((n·h)⁺)^e`. J. F. Blinn 1977.
pub fn blinn(n: V, l: V, v: V, e: f64) -> f64 {
    ((dot(n, l) + dot(n, v)) / (2.0 + 2.0 * dot(l, v)).sqrt()).max(0.0).powf(e)
}

/// `(e + 2)/(2π) (r·v)^e`. E. P. Lafortune and Y. D. Willems 1994.
pub fn lafortune(n: V, l: V, v: V, e: f64) -> f64 {
    (e + 2.0) / (2.0 * PI) * phong(n, l, v, e)
}

/// Distributions of microfacet normals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Distribution {
    /// Beckmann and Spizzichino 1963.
    Beckmann,
    /// Trowbridge and Reitz 1975; Walter et al. 2007.
    Ggx,
}

/// Shadowing and masking.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shadowing {
    /// Torrance and Sparrow 1967.
    VCavity,
    /// Smith 1967, both directions independent.
    Smith,
    /// Smith, correlated by height.
    SmithCorrelated,
}

/// `D`, normalised: `∫ D (n·h) dω = 1`.
pub fn d(distribution: Distribution, alpha: f64, n_h: f64) -> f64 {
    let theta = n_h.min(1.0).acos();
    let (cos, tan) = (theta.cos(), theta.tan());
    match distribution {
        Distribution::Beckmann => (-(tan / alpha).powi(2)).exp() / (PI * alpha * alpha * cos.powi(4)),
        Distribution::Ggx => 1.0 / (PI * alpha * alpha * cos.powi(4) * (1.0 + (tan / alpha).powi(2)).powi(2)),
    }
}

/// The distribution of Cook and Torrance's paper, without its 1/π.
pub fn d_1982(distribution: Distribution, alpha: f64, n_h: f64) -> f64 {
    PI * d(distribution, alpha, n_h)
}

/// Smith's masking of one direction.
pub fn g1(distribution: Distribution, alpha: f64, cos: f64) -> f64 {
    1.0 / (1.0 + lambda(distribution, alpha, cos))
}

pub(crate) fn lambda(distribution: Distribution, alpha: f64, cos: f64) -> f64 {
    if cos >= 1.0 {
        return 0.0;
    }
    let tan = (1.0 - cos * cos).sqrt() / cos;
    match distribution {
        Distribution::Ggx => ((1.0 + (alpha * tan).powi(2)).sqrt() - 1.0) / 2.0,
        Distribution::Beckmann => {
            let a = 1.0 / (alpha * tan);
            (-a * a).exp() / (2.0 * a * PI.sqrt()) - erfc(a) / 2.0
        }
    }
}

/// The rational fit of Beckmann's masking in Walter et al. 2007.
pub fn g1_beckmann_fit(alpha: f64, cos: f64) -> f64 {
    let c = cos / (alpha * (1.0 - cos * cos).sqrt());
    if c < 1.6 { (3.535 * c + 2.181 * c * c) / (1.0 + 2.276 * c + 2.577 * c * c) } else { 1.0 }
}

/// `G`.
pub fn g(shadowing: Shadowing, distribution: Distribution, alpha: f64, n: V, l: V, v: V) -> f64 {
    let h = half(l, v);
    let (n_l, n_v, n_h, v_h) = (dot(n, l), dot(n, v), dot(n, h), dot(v, h));
    match shadowing {
        Shadowing::VCavity => 1f64.min(2.0 * n_h * n_v / v_h).min(2.0 * n_h * n_l / v_h),
        Shadowing::Smith => g1(distribution, alpha, n_l) * g1(distribution, alpha, n_v),
        Shadowing::SmithCorrelated => 1.0 / (1.0 + lambda(distribution, alpha, n_l) + lambda(distribution, alpha, n_v)),
    }
}

/// `D G F/(4 n·l n·v)`.
pub fn cook_torrance(distribution: Distribution, shadowing: Shadowing, alpha: f64, fresnel: f64, n: V, l: V, v: V) -> f64 {
    d(distribution, alpha, dot(n, half(l, v))) * g(shadowing, distribution, alpha, n, l, v) * fresnel
        / (4.0 * dot(n, l) * dot(n, v))
}

/// `D₀ G F/(π n·l n·v)` with the distribution of the 1982 paper.
pub fn cook_torrance_1982(distribution: Distribution, shadowing: Shadowing, alpha: f64, fresnel: f64, n: V, l: V, v: V) -> f64 {
    d_1982(distribution, alpha, dot(n, half(l, v))) * g(shadowing, distribution, alpha, n, l, v) * fresnel
        / (PI * dot(n, l) * dot(n, v))
}

/// Fresnel's equations between two indices by Snell's angle: the mean of the squared amplitudes. `cos` on the side of `n1`.
pub fn fresnel_dielectric(cos: f64, n1: f64, n2: f64) -> f64 {
    let sin_t = n1 / n2 * (1.0 - cos * cos).max(0.0).sqrt();
    if sin_t >= 1.0 {
        return 1.0;
    }
    let cos_t = (1.0 - sin_t * sin_t).sqrt();
    let s = (n1 * cos - n2 * cos_t) / (n1 * cos + n2 * cos_t);
    let p = (n2 * cos - n1 * cos_t) / (n2 * cos + n1 * cos_t);
    0.5 * (s * s + p * p)
}

/// The same for a complex index `n + ik` seen from vacuum, in complex arithmetic.
pub fn fresnel_conductor(cos: f64, n: f64, k: f64) -> f64 {
    // m = n + ik; q = √(m² − sin²); s = (cos − q)/(cos + q); p = (m² cos − q)/(m² cos + q).
    let m2 = (n * n - k * k, 2.0 * n * k);
    let q = complex_sqrt((m2.0 - (1.0 - cos * cos), m2.1));
    let quotient =
        |a: (f64, f64), b: (f64, f64)| ((a.0 - b.0).powi(2) + (a.1 - b.1).powi(2)) / ((a.0 + b.0).powi(2) + (a.1 + b.1).powi(2));
    0.5 * (quotient((cos, 0.0), q) + quotient((m2.0 * cos, m2.1 * cos), q))
}

fn complex_sqrt((re, im): (f64, f64)) -> (f64, f64) {
    let (r, phi) = (re.hypot(im).sqrt(), 0.5 * im.atan2(re));
    (r * phi.cos(), r * phi.sin())
}

/// C. Schlick 1994.
pub fn schlick(cos: f64, f0: f64) -> f64 {
    f0 + (1.0 - f0) * (1.0 - cos).powi(5)
}

/// Reflection of an incoming direction `d` (towards the surface).
pub fn reflect(d: V, n: V) -> V {
    add(d, -2.0 * dot(d, n), n)
}

/// Snell's refraction of an incoming direction `d`, `n` against it; `None` under total internal reflection.
pub fn refract(d: V, n: V, n1: f64, n2: f64) -> Option<V> {
    let (c, eta) = (-dot(d, n), n1 / n2);
    let radicand = 1.0 - eta * eta * (1.0 - c * c);
    (radicand >= 0.0).then(|| add(d.map(|x| eta * x), eta * c - radicand.sqrt(), n))
}

/// `min(1/(c1 + c2 d + c3 d²), 1)`.
pub fn attenuation(c1: f64, c2: f64, c3: f64, d: f64) -> f64 {
    (1.0 / (c1 + c2 * d + c3 * d * d)).min(1.0)
}

/// `(cos angle)^k` inside the cutoff, angles in radians.
pub fn spotlight(k: f64, cutoff: f64, angle: f64) -> f64 {
    if angle <= cutoff { angle.cos().max(0.0).powf(k) } else { 0.0 }
}

/// Flux of a classic spot light of intensity one: `2π (1 − cos^(k+1) cutoff)/(k + 1)`.
pub fn spotlight_flux(k: f64, cutoff: f64) -> f64 {
    2.0 * PI * (1.0 - cutoff.cos().powf(k + 1.0)) / (k + 1.0)
}

/// `KHR_lights_punctual`: `clamp((cos − cos outer)/max(0.001, cos inner − cos outer))²`, angles in radians.
pub fn gltf_cone(inner: f64, outer: f64, angle: f64) -> f64 {
    let t = (angle.cos() - outer.cos()) / (inner.cos() - outer.cos()).max(0.001);
    t.clamp(0.0, 1.0).powi(2)
}

/// `KHR_lights_punctual`: `max(min(1 − (d/range)⁴, 1), 0)/d²`.
pub fn gltf_falloff(range: f64, d: f64) -> f64 {
    (1.0 - (d / range).powi(4)).clamp(0.0, 1.0) / (d * d)
}

/// Irradiance of a surface tilted by `tilt` radians under two uniform half spheres.
pub fn hemisphere(tilt: f64, up: f64, down: f64) -> f64 {
    PI * (up * (1.0 + tilt.cos()) / 2.0 + down * (1.0 - tilt.cos()) / 2.0)
}

/// The complementary error function: Taylor's series of erf below 2.5, Lentz's continued fraction above; 1e-14 relative to one.
pub fn erfc(x: f64) -> f64 {
    if x < 2.5 {
        let (mut term, mut sum, mut k) = (x, x, 0.0);
        while f64::abs(term) > 1e-18 {
            k += 1.0;
            term *= -x * x / k;
            sum += term / (2.0 * k + 1.0);
        }
        return 1.0 - 2.0 / PI.sqrt() * sum;
    }
    // erfc x = exp(−x²)/√π · 1/(x + (1/2)/(x + 1/(x + (3/2)/(x + …))))
    let tail = (1..200).rev().fold(x, |tail, k| x + 0.5 * f64::from(k) / tail);
    (-x * x).exp() / (PI.sqrt() * tail)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn erfc_has_its_tabulated_values() {
        // Abramowitz and Stegun, table 7.1.
        for (x, erf) in [(0.5, 0.520_499_877_8), (1.0, 0.842_700_792_9), (2.0, 0.995_322_265_0)] {
            assert!((1.0 - erfc(x) - erf).abs() < 1e-10, "{x}");
        }
        // The two branches meet.
        assert!((erfc(2.5 - 1e-12) / erfc(2.5) - 1.0).abs() < 1e-10);
    }
}
