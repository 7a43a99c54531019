//! Rough surfaces as many small mirrors: the distribution `D` of their normals and the part `G` of them that is neither in
//! shadow nor hidden.
//!
//! `D` is normalised so that `∫ D(h)(n·h) dω = 1`; the roughness `α` is Beckmann's root mean square slope `m` and GGX's
//! width, not squared again. All angles are taken from one [`Angles`], whose sines come from cross products: `1 − cos²` would
//! lose the width of a sharp highlight to rounding.

use std::f32::consts::{FRAC_1_PI, PI};

use crate::math::{Vec2, Vec3, function};
use crate::scene::{Distribution, Shadowing};

/// The smallest roughness that is evaluated as a lobe: below it the highlight is a hundredth of a degree wide and single
/// precision directions no longer resolve it.
pub const MIN_ALPHA: f32 = 1e-3;

/// The angles between normal, light, viewer and halfway vector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Angles {
    /// `n·l`, above zero.
    pub n_l: f32,
    /// `n·v`, above zero.
    pub n_v: f32,
    /// `n·h`.
    pub n_h: f32,
    /// `v·h = l·h`.
    pub v_h: f32,
    /// `tan²` of the angle between `n` and `h`.
    pub tan2_h: f32,
}

impl Angles {
    /// `None` when light or viewer are not in front of `n`.
    pub fn new(n: Vec3, wo: Vec3, wi: Vec3) -> Option<Self> {
        let (n_l, n_v) = (n.dot(wi), n.dot(wo));
        if n_l <= 0.0 || n_v <= 0.0 {
            return None;
        }
        let h = (wo + wi).normalize();
        let n_h = n.dot(h).min(1.0);
        Some(Self { n_l, n_v, n_h, v_h: wo.dot(h).clamp(0.0, 1.0), tan2_h: n.cross(h).length_squared() / (n_h * n_h) })
    }
}

/// `D(h)`, 1/sr. Beckmann: `exp(−tan²/α²)/(π α² cos⁴)` [Cook82]; GGX: `α²/(π cos⁴ (α² + tan²)²)` [Walter07].
pub fn d(distribution: Distribution, alpha: f32, angles: &Angles) -> f32 {
    let a2 = alpha * alpha;
    let cos2 = angles.n_h * angles.n_h;
    match distribution {
        Distribution::Beckmann => function::exp(-angles.tan2_h / a2) / (PI * a2 * cos2 * cos2),
        Distribution::Ggx => {
            let s = a2 + angles.tan2_h;
            a2 * FRAC_1_PI / ((cos2 * s) * (cos2 * s))
        }
    }
}

/// Smith's `Λ` for a direction at `cos` from the normal: `G1 = 1/(1 + Λ)`. [Heitz14]
///
/// GGX: `(√(1 + α² tan²) − 1)/2`; Beckmann, with `a = 1/(α tan)`: `(erf a − 1)/2 + exp(−a²)/(2a√π)`, exact rather than the
/// rational fit of [Walter07].
pub fn lambda(distribution: Distribution, alpha: f32, cos: f32) -> f32 {
    let tan2 = ((1.0 - cos) * (1.0 + cos)).max(0.0) / (cos * cos);
    let slope2 = alpha * alpha * tan2;
    match distribution {
        // The difference from one, written without cancellation.
        Distribution::Ggx => 0.5 * slope2 / ((1.0 + slope2).sqrt() + 1.0),
        Distribution::Beckmann => {
            let a = 1.0 / slope2.sqrt();
            // From here on Λ < 1e-9, nothing against one (and a may be infinite).
            if a > 4.0 {
                return 0.0;
            }
            let root_pi = 1.772_453_9;
            (0.5 * (function::exp(-a * a) / (a * root_pi) - libm::erfcf(a))).max(0.0)
        }
    }
}

/// Smith's masking of one direction, `1/(1 + Λ)`.
pub fn g1(distribution: Distribution, alpha: f32, cos: f32) -> f32 {
    1.0 / (1.0 + lambda(distribution, alpha, cos))
}

/// A facet normal around +z, by `D(h)(n·h)`, from two uniform numbers: `tan² = α² u/(1 − u)` for GGX, `−α² ln(1 − u)` for Beckmann. [Walter07]
pub fn sample_d(distribution: Distribution, alpha: f32, u: Vec2) -> Vec3 {
    let tan2 = alpha
        * alpha
        * match distribution {
            Distribution::Ggx => u.x / (1.0 - u.x),
            Distribution::Beckmann => -function::ln(1.0 - u.x),
        };
    let cos = 1.0 / (1.0 + tan2).sqrt();
    let sin = tan2.sqrt() * cos;
    let phi = 2.0 * PI * u.y;
    Vec3::new(sin * function::cos(phi), sin * function::sin(phi), cos)
}

/// A facet normal around +z by how much of it a viewer in the local direction `wo` (`wo.z > 0`) sees: by `D_v`, those normals that Smith's masking leaves
/// visible. The density is [`sample_visible_pdf`].
///
/// GGX as caps of a sphere [Dupuy23], Beckmann by its slopes ([`visible_slope`]).
pub fn sample_visible(distribution: Distribution, alpha: f32, wo: Vec3, u: Vec2) -> Vec3 {
    // Seen in the space where the roughness is one.
    let v = Vec3::new(alpha * wo.x, alpha * wo.y, wo.z).normalize();
    if distribution == Distribution::Beckmann {
        let sin = (v.x * v.x + v.y * v.y).sqrt();
        let (cos_phi, sin_phi) = if sin > 0.0 { (v.x / sin, v.y / sin) } else { (1.0, 0.0) };
        // Slopes towards the viewer and across.
        let (x, y) = (visible_slope(sin / v.z, u.x), gaussian_slope(u.y));
        let slope = Vec2::new(cos_phi * x - sin_phi * y, sin_phi * x + cos_phi * y) * alpha;
        return Vec3::new(-slope.x, -slope.y, 1.0).normalize();
    }
    let phi = 2.0 * PI * u.x;
    // (1 − u)(1 + v_z) − v_z, and 1 − z² without cancellation near the pole.
    let down = u.y * (1.0 + v.z);
    let (z, sin) = (1.0 - down, (down * (2.0 - down)).max(0.0).sqrt());
    let h = Vec3::new(sin * function::cos(phi), sin * function::sin(phi), z) + v;
    Vec3::new(alpha * h.x, alpha * h.y, h.z.max(0.0)).normalize_or(Vec3::Z)
}

/// The density of [`sample_visible`], 1/sr of the facet normal: `D_v = G₁ D (v·h)/(n·v)`. [HeitzEon14]
pub fn sample_visible_pdf(distribution: Distribution, alpha: f32, angles: &Angles) -> f32 {
    d(distribution, alpha, angles) * angles.v_h * g1_over_cosine(distribution, alpha, angles.n_v)
}

/// `G₁/(n·v)`.
pub fn g1_over_cosine(distribution: Distribution, alpha: f32, n_v: f32) -> f32 {
    match distribution {
        Distribution::Beckmann => g1(distribution, alpha, n_v) / n_v,
        // 2/(n·v + √(α² + (1 − α²)(n·v)²)).
        Distribution::Ggx => 2.0 / (n_v + (n_v * n_v + alpha * alpha * ((1.0 - n_v) * (1.0 + n_v)).max(0.0)).sqrt()),
    }
}

/// The slope of Beckmann's facets of roughness one, in the direction of a viewer at `tan` from the normal: visible slopes `s < 1/tan` have the density
/// `∝ (1 − s tan) exp(−s²)/√π`.
///
/// With `v = (1 + erf s)/2`, which is uniform where everything is visible, their distribution function is `F(v) ∝ v + tan exp(−s²)/(2√π)`, to be solved for
/// `F(v) = u F_max` [Jakob14]. It is concave: its chord starts beyond the solution, every tangent lies above it, and so Newton's method comes up from below
/// after its first step, without a bracket.
fn visible_slope(tan: f32, u: f32) -> f32 {
    let below = |s: f32| 0.5 * libm::erfcf(-s);
    let across = tan * (0.5 * FRAC_1_PI.sqrt());
    // Beyond ±4 there is less of a Gaussian than single precision numbers tell.
    let last = (1.0 / tan).min(4.0);
    let most = below(last);
    let target = u * (most + across * function::exp(-last * last));
    let mut v = (u * most).max(LEAST_SHARE);
    let mut s = gaussian_slope(v).min(last);
    for _ in 0..NEWTON_STEPS {
        let error = v + across * function::exp(-s * s) - target;
        let slope = 1.0 - s * tan;
        if slope <= 0.0 {
            break;
        }
        v = (v - error / slope).clamp(LEAST_SHARE, most);
        s = gaussian_slope(v).min(last);
        // Squared by the step that was just made.
        if error.abs() <= 1e-4 * target {
            break;
        }
    }
    s
}

/// Newton's steps at most; three or four are usual.
const NEWTON_STEPS: u32 = 16;
/// The smallest share of a distribution that is told from none.
const LEAST_SHARE: f32 = 1e-8;

/// The slope `s` with `(1 + erf s)/2 = u`, by Winitzki's estimate, good to 2e-3, and a step of Halley's method (which cubes that) on `erfc`, which keeps its precision
/// in the tails.
fn gaussian_slope(u: f32) -> f32 {
    // By the nearer tail.
    let tail = 2.0 * u.min(1.0 - u).max(LEAST_SHARE);
    let log = function::ln(tail * (2.0 - tail));
    let (a, b) = (0.147, 2.0 / (PI * 0.147) + 0.5 * log);
    let estimate = ((b * b - log / a).sqrt() - b).max(0.0).sqrt();
    let step = (libm::erfcf(estimate) - tail) * (0.5 / FRAC_1_PI.sqrt()) * function::exp(estimate * estimate);
    let s = estimate + step / (1.0 - estimate * step);
    if u < 0.5 { -s } else { s }
}

/// `G/((n·l)(n·v))`: shadowing and masking together with the cosines they tame, finite wherever the quotient is.
pub fn g_over_cosines(shadowing: Shadowing, distribution: Distribution, alpha: f32, angles: &Angles) -> f32 {
    let Angles { n_l, n_v, n_h, v_h, .. } = *angles;
    if shadowing == Shadowing::VCavity {
        // Each case of the minimum divided by n·l n·v, the smaller cosine cancelling. v·h = 0 only for grazing opposite directions.
        let valley = 2.0 * n_h * n_l.min(n_v);
        return if valley < v_h { 2.0 * n_h / (v_h * n_l.max(n_v)) } else { 1.0 / (n_l * n_v) };
    }
    if distribution == Distribution::Ggx {
        // 1 + Λ = (1 + r)/2 with r = √(1 + α² tan²); cos·(1 + r) is free of the division by the cosine.
        let a2 = alpha * alpha;
        let scaled = |cos: f32| (cos * cos + a2 * ((1.0 - cos) * (1.0 + cos)).max(0.0)).sqrt();
        let (s_l, s_v) = (scaled(n_l), scaled(n_v));
        return match shadowing {
            Shadowing::SmithCorrelated => 2.0 / (n_l * s_v + n_v * s_l),
            _ => 4.0 / ((n_l + s_l) * (n_v + s_v)),
        };
    }
    g(shadowing, distribution, alpha, angles) / (n_l * n_v)
}

/// `G`: the fraction of facets of normal `h` that both light and viewer reach. [Cook82], [Walter07], [Heitz14]
pub fn g(shadowing: Shadowing, distribution: Distribution, alpha: f32, angles: &Angles) -> f32 {
    let Angles { n_l, n_v, n_h, v_h, .. } = *angles;
    match shadowing {
        Shadowing::VCavity => {
            let valley = 2.0 * n_h * n_l.min(n_v);
            if valley < v_h { valley / v_h } else { 1.0 }
        }
        Shadowing::Smith => g1(distribution, alpha, n_l) * g1(distribution, alpha, n_v),
        Shadowing::SmithCorrelated => 1.0 / (1.0 + lambda(distribution, alpha, n_l) + lambda(distribution, alpha, n_v)),
    }
}

/// The rational fit of Beckmann's `G1` in [Walter07], accurate to 0.4 %; kept beside the exact one for comparison.
pub fn g1_beckmann_fit(alpha: f32, cos: f32) -> f32 {
    let tan = ((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt() / cos;
    let c = 1.0 / (alpha * tan);
    if c >= 1.6 { 1.0 } else { (3.535 * c + 2.181 * c * c) / (1.0 + 2.276 * c + 2.577 * c * c) }
}
