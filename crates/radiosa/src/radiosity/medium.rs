//! A homogeneous medium between surfaces that absorbs and does not scatter.
//!
//! ```text
//! what arrives = e^(−σ r) of what leaves,   F_ij(σ) = 1/A_i ∫_i ∫_j V K e^(−σ r) dA_j dA_i = τ_ij F_ij
//! ```
//!
//! Factors stay those of geometry, and every link has its mean transmittance τ_ij = τ_ji by channel beside it: so what escapes is told from what the medium absorbs, and
//! three channels still share one geometry. The medium is where surfaces are: what leaves the scene has left it, and light from infinitely far arrives as it is given.
//! Source: [Rushmeier87], without the zones that a medium needs which scatters or shines.

use std::io;

use crate::math::function::exp_f64;
use crate::stream::{In, Out, wrong};

/// A medium by what it absorbs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Medium {
    /// σ by channel, 1/m; not negative.
    pub absorption: [f64; 3],
}

impl Medium {
    /// It absorbs nothing.
    pub fn is_clear(&self) -> bool {
        self.absorption == [0.0; 3]
    }

    /// What is left of light after `distance` metres, by channel.
    pub fn transmittance(&self, distance: f64) -> [f64; 3] {
        let [r, g, b] = self.absorption;
        let of = |sigma: f64| if sigma > 0.0 { exp_f64(-sigma * distance) } else { 1.0 };
        let red = of(r);
        if r == g && g == b { [red; 3] } else { [red, of(g), of(b)] }
    }

    /// Channels that differ.
    fn n_channels(&self) -> usize {
        let [r, g, b] = self.absorption;
        if self.is_clear() {
            0
        } else if r == g && g == b {
            1
        } else {
            3
        }
    }
}

/// Mean transmittances τ_ij of links, in their order: nothing is held where the medium is clear, one value a link where it is grey, three where it is colored.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Passing {
    n_channels: usize,
    values: Vec<f32>,
}

impl Passing {
    /// Of no links yet.
    pub fn new(medium: &Medium) -> Self {
        Self { n_channels: medium.n_channels(), values: Vec::new() }
    }

    /// Everything passes.
    pub fn is_clear(&self) -> bool {
        self.n_channels == 0
    }

    /// Of the next link.
    pub fn push(&mut self, tau: [f64; 3]) {
        self.values.extend(tau[..self.n_channels].iter().map(|&t| t as f32));
    }

    /// Of link `k`.
    pub fn at(&self, k: usize) -> [f64; 3] {
        match self.n_channels {
            0 => [1.0; 3],
            1 => [f64::from(self.values[k]); 3],
            n => std::array::from_fn(|c| f64::from(self.values[n * k + c])),
        }
    }

    /// No links, of the same medium.
    pub(super) fn clear(&mut self, medium: &Medium) {
        self.n_channels = medium.n_channels();
        self.values.clear();
    }

    pub(super) fn store(&self, out: &mut Out) -> io::Result<()> {
        out.array(&self.values)
    }

    /// The inverse of [`Self::store`], for `n` links in a medium.
    pub(super) fn restore(medium: &Medium, n: usize, from: &mut In) -> io::Result<Self> {
        let n_channels = medium.n_channels();
        let values: Vec<f32> = from.array(n_channels * n)?;
        if values.iter().any(|t| !(0.0..=1.0).contains(t)) {
            return Err(wrong("more than everything passes the medium"));
        }
        Ok(Self { n_channels, values })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_hold_as_many_values_as_the_medium_has_channels() {
        for (absorption, n) in [([0.0; 3], 0), ([0.5; 3], 1), ([0.5, 0.0, 2.0], 3)] {
            let medium = Medium { absorption };
            let mut passing = Passing::new(&medium);
            for k in 0..4 {
                passing.push(medium.transmittance(f64::from(k)));
            }
            assert_eq!(passing.values.len(), 4 * n);
            let truth = absorption.map(|s: f64| (-3.0 * s).exp());
            assert!(passing.at(3).iter().zip(truth).all(|(t, truth)| (t - truth).abs() < 1e-7));
        }
    }
}
