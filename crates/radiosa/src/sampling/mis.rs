//! Multiple importance sampling: one integral by several ways of drawing, each direction weighed by how likely each way draws it. Source: [Veach95].
//!
//! The weights of all ways sum to 1 at every direction, whatever the densities, which is all that a right mean needs.

/// The power heuristic with β = 2 for one sample by each of two ways: `p²/(p² + q²)`, `p` the density of the way that drew the direction. An infinite `p` wins.
pub fn power_heuristic(p: f32, q: f32) -> f32 {
    // By the quotient, so that nothing overflows.
    if p > q {
        let r = q / p;
        1.0 / (1.0 + r * r)
    } else if q > 0.0 {
        let r = p / q;
        r * r / (1.0 + r * r)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_sum_to_one() {
        for (p, q) in [(1.0, 2.0), (1e30, 1e-30), (3e38, 3e38), (1e-40, 1.0), (f32::INFINITY, 5.0)] {
            assert!((power_heuristic(p, q) + power_heuristic(q, p) - 1.0).abs() < 1e-6, "{p} {q}");
        }
        assert!((power_heuristic(1.0, 2.0) - 0.2).abs() < 1e-7);
        assert_eq!(power_heuristic(0.0, 0.0), 0.0);
    }
}
