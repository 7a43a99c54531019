//! The radiosity equation over elements, and its energy.
//!
//! ```text
//! B_i = E_i + ρ_i H_i,   H_i = D_i + Σ_j F_ij B_j
//! ```
//!
//! B radiosity, E emission, ρ reflectance, H irradiance, D the irradiance from lights that are not surfaces; three channels are three systems of one
//! geometry. Source: [Goral84].

use super::matrix::Matrix;

/// What is known of every element before anything is solved. All columns have the same length.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct System {
    /// A_i, m².
    pub area: Vec<f64>,
    /// ρ_i, by channel, in `[0, 1]`.
    pub reflectance: Vec<[f64; 3]>,
    /// E_i, W/m² or lm/m².
    pub emission: Vec<[f64; 3]>,
    /// D_i: irradiance from lights that are not surfaces.
    pub direct: Vec<[f64; 3]>,
}

/// Power by where it goes, W or lm, by channel: emitted = absorbed + escaped + unshot, once every part is measured.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Balance {
    /// By surfaces, and what arrives on them from other lights.
    pub emitted: [f64; 3],
    /// By surfaces.
    pub absorbed: [f64; 3],
    /// Left the scene: what rows of factors fall short of one.
    pub escaped: [f64; 3],
    /// Not yet on its way.
    pub unshot: [f64; 3],
}

impl Balance {
    /// `(emitted − absorbed − escaped − unshot)/emitted`, the channel where it is worst; zero when nothing is emitted.
    pub fn error(&self) -> f64 {
        let of = |c: usize| self.emitted[c] - self.absorbed[c] - self.escaped[c] - self.unshot[c];
        let emitted = self.emitted.iter().fold(0.0f64, |a, &b| a.max(b));
        if emitted > 0.0 { (0..3).map(|c| of(c).abs() / emitted).fold(0.0, f64::max) } else { 0.0 }
    }
}

impl System {
    /// Elements.
    pub fn n(&self) -> usize {
        self.area.len()
    }

    /// `E_i + ρ_i D_i`: what leaves an element before any light has gone from surface to surface.
    pub fn initial(&self, i: usize) -> [f64; 3] {
        std::array::from_fn(|c| self.emission[i][c] + self.reflectance[i][c] * self.direct[i][c])
    }

    /// `Σ_j F_ij B_j`.
    pub fn gather(matrix: &Matrix, i: usize, b: &[[f64; 3]]) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for (j, f) in matrix.row(i) {
            (0..3).for_each(|c| sum[c] += f * b[j][c]);
        }
        sum
    }

    /// Where the power is, when `b` has been sent out and `unshot` of it has not; every part from what it is defined by.
    ///
    /// What is absorbed is `A_i (1 − ρ_i) H_i` with the irradiance that the shot radiosities cause; what escapes is measured by the raw row sums.
    pub fn balance(&self, row_sums: &[f64], irradiance: &[[f64; 3]], b: &[[f64; 3]], unshot: &[[f64; 3]]) -> Balance {
        let mut balance = Balance::default();
        for i in 0..self.n() {
            let area = self.area[i];
            for c in 0..3 {
                balance.emitted[c] += area * (self.emission[i][c] + self.direct[i][c]);
                balance.absorbed[c] += area * (1.0 - self.reflectance[i][c]) * irradiance[i][c];
                balance.escaped[c] += area * (b[i][c] - unshot[i][c]) * (1.0 - row_sums[i]);
                balance.unshot[c] += area * unshot[i][c];
            }
        }
        balance
    }
}
