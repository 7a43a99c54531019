//! A rough boundary between two media: facets that reflect the part `F` of what meets them and refract the rest. [Walter07]
//!
//! With `η` the index on the far side over that on the viewer's, `o` to the viewer, `i` to the light behind the boundary and the facet normal `h` halfway
//! between them in the sense of Snell's law,
//!
//! ```text
//! h = ±(o + η i)/|o + η i|                                              on the viewer's side
//! f(o, i) |n·i| = η² (1 − F) D G |o·h| |i·h| / (|n·o| |o + η i|²)
//! dω_h/dω_i = η² |i·h|/|o + η i|²
//! ```
//!
//! What is transported is radiance over the square of the index, as the smooth boundary ([`dielectric`](super::dielectric)) has it: it stays as it is along
//! refracted rays, `η²` above stands for the light's side. Radiance itself has the viewer's side there, the factor `1/η²` that light takes on when it enters a
//! denser body and gives back when it leaves. So `f(o, i) = η² f(i, o)`, and drawn by visible normals a direction weighs `(1 − F) G/G₁`, no more than one.
//!
//! A rough sheet refracts twice, which turns light back into where it came from but for the roughness: its lobe is the reflected one on the other side.

use super::microfacet::{self, Angles};
use crate::math::{Vec3, function};
use crate::scene::{Distribution, Shadowing};

use super::{dielectric, mirror};

/// Media nearer to each other than this (in the ratio of their indices) bend light less than single precision directions tell: there is no rough boundary
/// between them.
const LEAST_BENDING: f32 = 1e-3;
/// Cosines below which Smith's Λ leaves single precision.
const GRAZING: f32 = 1e-6;

/// A rough boundary seen from one side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Boundary {
    /// `D`.
    pub distribution: Distribution,
    /// `G`.
    pub shadowing: Shadowing,
    /// `α`.
    pub alpha: f32,
    /// `η`: index on the far side over index on the viewer's; `None` for a sheet.
    pub eta: Option<f32>,
}

impl Boundary {
    /// `None` where nothing is bent.
    pub(super) fn new(distribution: Distribution, shadowing: Shadowing, alpha: f32, eta: Option<f32>) -> Option<Self> {
        let is_bent = eta.is_none_or(|eta| (eta - 1.0).abs() > LEAST_BENDING);
        is_bent.then_some(Self { distribution, shadowing, alpha, eta })
    }

    /// Where a facet of normal `h` sends what is seen from `wo` on the other side; `None` under total internal reflection.
    pub(super) fn refract(&self, n: Vec3, wo: Vec3, h: Vec3) -> Option<Vec3> {
        match self.eta {
            Some(eta) => dielectric::refract(wo, h, 1.0 / eta),
            None => Some(-mirror::reflect(mirror::reflect(wo, h), n)),
        }
    }

    /// The facet that refracts light from `wi`, behind, to `wo`.
    pub fn between(&self, n: Vec3, wo: Vec3, wi: Vec3) -> Option<Refraction> {
        let Some(eta) = self.eta else {
            let angles = Angles::new(n, wo, -mirror::reflect(wi, n))?;
            return Some(Refraction { angles, l_h: angles.v_h, jacobian: 0.25 / angles.v_h });
        };
        let (n_l, n_v) = (-n.dot(wi), n.dot(wo));
        if n_l <= GRAZING || n_v <= GRAZING {
            return None;
        }
        let sum = wo + wi * eta;
        let length2 = sum.length_squared();
        let h = sum * (if n.dot(sum) < 0.0 { -1.0 } else { 1.0 } / length2.sqrt());
        // A facet seen from behind, by the viewer or the light, refracts nothing.
        let (n_h, v_h, l_h) = (n.dot(h).min(1.0), wo.dot(h), -wi.dot(h));
        if !(n_h > 0.0 && v_h > 0.0 && l_h > 0.0) {
            return None;
        }
        let angles = Angles { n_l, n_v, n_h, v_h: v_h.min(1.0), tan2_h: n.cross(h).length_squared() / (n_h * n_h) };
        Some(Refraction { angles, l_h, jacobian: eta * eta * l_h / length2 })
    }

    /// `f |n·i|` where `F = 0`, 1/sr.
    pub fn refract_cos(&self, refraction: &Refraction) -> f32 {
        let Refraction { angles, l_h, jacobian } = *refraction;
        let d = microfacet::d(self.distribution, self.alpha, &angles);
        d * self.g_over_cosine(&angles, l_h) * angles.v_h * jacobian
    }

    /// The density of a refracted direction, 1/sr, when every facet refracts.
    pub fn pdf(&self, refraction: &Refraction) -> f32 {
        microfacet::sample_visible_pdf(self.distribution, self.alpha, &refraction.angles) * refraction.jacobian
    }

    /// `G/|n·o|`, `G` the fraction of facets that the viewer sees and light behind them reaches. Smith's is a product, or correlated by height: what is low is
    /// hidden from one side and open to the other, `G = B(1 + Λ_o, 1 + Λ_i)` with Euler's beta function [Heitz14]; V-cavities leave `(G₁(o) + G₁(i) − 1)⁺`
    /// [HeitzEon14]. Both ways through a sheet are on one side of it.
    fn g_over_cosine(&self, angles: &Angles, l_h: f32) -> f32 {
        let Self { distribution, shadowing, alpha, .. } = *self;
        let Angles { n_l, n_v, n_h, v_h, .. } = *angles;
        if self.eta.is_none() {
            return microfacet::g_over_cosines(shadowing, distribution, alpha, angles) * n_l;
        }
        let below = |cos| 1.0 + microfacet::lambda(distribution, alpha, cos);
        let g = match shadowing {
            Shadowing::VCavity => {
                let g1 = |cos: f32, facet: f32| (2.0 * n_h * cos / facet).min(1.0);
                (g1(n_v, v_h) + g1(n_l, l_h) - 1.0).max(0.0)
            }
            Shadowing::Smith => 1.0 / (below(n_l) * below(n_v)),
            Shadowing::SmithCorrelated => beta(below(n_v), below(n_l)),
        };
        g / n_v
    }
}

/// A facet that refracts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refraction {
    /// `n_l = |n·i|`, `v_h = o·h`.
    pub angles: Angles,
    /// `|i·h|`.
    pub l_h: f32,
    /// `dω_h/dω_i`.
    pub jacobian: f32,
}

/// Euler's beta function, `Γ(a) Γ(b)/Γ(a + b)`. The logarithms are large and nearly equal: in f64.
fn beta(a: f32, b: f32) -> f32 {
    let (a, b) = (f64::from(a), f64::from(b));
    function::exp_f64(libm::lgamma(a) + libm::lgamma(b) - libm::lgamma(a + b)) as f32
}
