//! What a rough boundary between two media reflects and lets through, integrated over the facets in f64: no density of directions and no Jacobian is involved.

use std::f64::consts::PI;

use crate::brdf::{Distribution, Shadowing, V, dot, lambda, reflect, refract};

/// Facets along a side of the square over which is integrated.
const N: usize = 250;

/// The parts that a viewer at `theta` from the normal sees reflected and refracted of light of radiance 1 (over the square of the index) that comes from
/// everywhere; `eta` is the index behind over that in front, `facet` gives the parts of one facet by the cosine to the viewer.
pub fn directional_albedo(
    (distribution, shadowing, alpha): (Distribution, Shadowing, f64),
    eta: f64,
    theta: f64,
    facet: impl Fn(f64) -> (f64, f64),
) -> (f64, f64) {
    let n: V = [0.0, 0.0, 1.0];
    let o: V = [theta.sin(), 0.0, theta.cos()];
    let (mut reflected, mut refracted) = (0.0, 0.0);
    for k in 0..N * N {
        // Evenly spread in D (n·h) dω_h, u its distribution function, but for denser points in the tail: few facets lie flat, but they are seen most.
        let w = ((k / N) as f64 + 0.5) / N as f64;
        let (u, density) = (1.0 - (1.0 - w).powi(3), 3.0 * (1.0 - w).powi(2));
        let phi = PI * ((k % N) as f64 + 0.5) / N as f64;
        let tan = alpha
            * match distribution {
                Distribution::Ggx => (u / (1.0 - u)).sqrt(),
                Distribution::Beckmann => (-(1.0 - u).ln()).sqrt(),
            };
        let n_h = 1.0 / (1.0 + tan * tan).sqrt();
        let h: V = [tan * n_h * phi.cos(), tan * n_h * phi.sin(), n_h];
        let v_h = dot(o, h);
        if v_h <= 0.0 {
            continue;
        }
        let share = density * v_h / (o[2] * n_h * (N * N) as f64);
        let (r, t) = facet(v_h);
        let towards = o.map(|x| -x);
        let i = reflect(towards, h);
        if i[2] > 0.0 {
            reflected += r * share * g((distribution, shadowing, alpha), n, h, o, i);
        }
        if let Some(i) = refract(towards, h, 1.0, eta)
            && i[2] < 0.0
        {
            refracted += t * share * g((distribution, shadowing, alpha), n, h, o, i);
        }
    }
    (reflected, refracted)
}

/// The fraction of the facets of normal `h` that are open to `o`, in front, and to `i`, in front or behind. E. Heitz 2014; E. Heitz and E. d'Eon 2014.
fn g((distribution, shadowing, alpha): (Distribution, Shadowing, f64), n: V, h: V, o: V, i: V) -> f64 {
    let lambda = |w: V| lambda(distribution, alpha, dot(n, w).abs());
    let is_behind = dot(n, i) < 0.0;
    match shadowing {
        Shadowing::VCavity => {
            let g1 = |w: V| (2.0 * dot(n, h) * dot(n, w) / dot(w, h)).min(1.0);
            if is_behind { (g1(o) + g1(i) - 1.0).max(0.0) } else { g1(o).min(g1(i)) }
        }
        Shadowing::Smith => 1.0 / ((1.0 + lambda(o)) * (1.0 + lambda(i))),
        Shadowing::SmithCorrelated if is_behind => {
            let (a, b) = (1.0 + lambda(o), 1.0 + lambda(i));
            (ln_gamma(a) + ln_gamma(b) - ln_gamma(a + b)).exp()
        }
        Shadowing::SmithCorrelated => 1.0 / (1.0 + lambda(o) + lambda(i)),
    }
}

/// Logarithm of the gamma function for `x ≥ 1`: Stirling's series after `Γ(x + 1) = x Γ(x)` has brought it beyond 10.
fn ln_gamma(x: f64) -> f64 {
    let (mut x, mut below) = (x, 0.0);
    while x < 10.0 {
        below += x.ln();
        x += 1.0;
    }
    let y = 1.0 / (x * x);
    (x - 0.5) * x.ln() - x + 0.5 * (2.0 * PI).ln() + (1.0 / 12.0 - y * (1.0 / 360.0 - y * (1.0 / 1260.0 - y / 1680.0))) / x
        - below
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gamma_of_whole_numbers_is_the_factorial() {
        for (n, factorial) in [(1.0, 1.0), (2.0, 1.0), (5.0, 24.0), (11.0, 3_628_800.0f64)] {
            assert!((ln_gamma(n) - factorial.ln()).abs() < 1e-10, "{n}");
        }
    }
}
