//! The radiosity equation over elements, and its energy.
//!
//! ```text
//! B_i = E_i + ρ_i H_i,   H_i = D_i + Σ_j τ_ij F_ij B_j
//! ```
//!
//! B radiosity, E emission, ρ reflectance, H irradiance, D the irradiance from lights that are not surfaces; three channels are three systems of one
//! geometry; τ what an absorbing medium lets through, 1 where it is clear ([`super::medium`]). Source: [Goral84].
//!
//! While it is being solved, some of B has not been sent out yet: the unshot part U. Every solver keeps
//!
//! ```text
//! B = E + ρ H,   H = D + τF (B − U)
//! ```
//!
//! so that U is the residual, and emitted = absorbed by surfaces and by the medium + escaped + unshot holds at every step.

use rayon::prelude::*;

use super::matrix::Matrix;
use super::medium::Medium;

/// What is known before anything is solved. All columns have the same length, one value an element.
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
    /// The part of D_i from lamps, which have a place or a direction: pictures may have it sharper. Empty where there are none.
    pub lamps: Vec<[f64; 3]>,
    /// τ_i: what passes straight through a surface, of light that arrives from everywhere alike. Empty where nothing is transparent.
    pub transmittance: Vec<[f64; 3]>,
    /// What is between the elements.
    pub medium: Medium,
}

/// What becomes of that which each element sends out: columns of the length of the system's, not numbers while unknown.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sums {
    /// `Σ_j F_ij`: what is met; the rest escapes.
    pub met: Vec<f64>,
    /// `Σ_j τ_ij F_ij`: what arrives, by channel; the rest of what is met the medium absorbs. Empty where it is clear.
    pub arriving: Vec<[f64; 3]>,
}

impl Sums {
    /// Nothing is known.
    pub fn unknown(system: &System) -> Self {
        let n = system.n();
        let arriving = if system.medium.is_clear() { Vec::new() } else { vec![[f64::NAN; 3]; n] };
        Self { met: vec![f64::NAN; n], arriving }
    }

    /// Of every row.
    pub fn of(matrix: &Matrix) -> Self {
        let rows = || (0..matrix.n()).into_par_iter();
        let arriving = if matrix.is_clear() { Vec::new() } else { rows().map(|i| matrix.arriving_sum(i)).collect() };
        Self { met: rows().map(|i| matrix.row_sum(i)).collect(), arriving }
    }
}

/// Power by where it goes, W or lm, by channel: emitted = absorbed + in the medium + escaped + unshot, once every part is measured.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Balance {
    /// By surfaces, and what arrives on them from other lights: what passes one of them counts where it ends.
    pub emitted: [f64; 3],
    /// By surfaces.
    pub absorbed: [f64; 3],
    /// By the medium between them.
    pub in_medium: [f64; 3],
    /// Left the scene: what rows of factors fall short of one.
    pub escaped: [f64; 3],
    /// Not yet on its way.
    pub unshot: [f64; 3],
}

/// What a solver works on: columns of the length of the system's.
#[derive(Debug)]
pub struct Unknowns<'a> {
    /// B_i, W/m² or lm/m².
    pub radiosity: &'a mut [[f64; 3]],
    /// H_i, W/m² or lux.
    pub irradiance: &'a mut [[f64; 3]],
    /// U_i: the part of B_i that has not been sent out.
    pub unshot: &'a mut [[f64; 3]],
}

impl Unknowns<'_> {
    /// Nothing has been sent out: `H = D, B = U = E + ρ D`.
    pub fn start(&mut self, system: &System) {
        self.irradiance.copy_from_slice(&system.direct);
        for i in 0..system.n() {
            self.radiosity[i] = system.initial(i);
            self.unshot[i] = self.radiosity[i];
        }
    }

    /// How far `E + ρ (D + F B)` still is from B, by power: `Σ A |U| / Σ A |B|`, the channel where it is largest.
    pub fn residual(&self, system: &System) -> f64 {
        let power = |b: &[[f64; 3]], c: usize| b.iter().zip(&system.area).map(|(b, a)| a * b[c].abs()).sum::<f64>();
        let of = |c: usize| {
            let all = power(self.radiosity, c);
            if all > 0.0 { power(self.unshot, c) / all } else { all }
        };
        // (What is no number is no residual, and no end.)
        (0..3).map(of).fold(0.0, |worst, r| if r.is_nan() || r > worst { r } else { worst })
    }
}

impl Balance {
    /// `(emitted − absorbed − in the medium − escaped − unshot)/emitted`, the channel where it is worst; zero when nothing is emitted.
    pub fn error(&self) -> f64 {
        let of = |c: usize| self.emitted[c] - self.absorbed[c] - self.in_medium[c] - self.escaped[c] - self.unshot[c];
        let emitted = self.emitted.iter().fold(0.0f64, |a, &b| a.max(b));
        if emitted > 0.0 { (0..3).map(|c| of(c).abs() / emitted).fold(0.0, f64::max) } else { 0.0 }
    }
}

impl System {
    /// Elements.
    pub fn n(&self) -> usize {
        self.area.len()
    }

    /// The part of light that passes an element, with one for all channels, as form factors have it.
    pub fn passes(&self, i: usize) -> f64 {
        self.transmittance.get(i).map_or(0.0, |t| (t[0] + t[1] + t[2]) / 3.0)
    }

    /// `E_i + ρ_i D_i`: what leaves an element before any light has gone from surface to surface.
    pub fn initial(&self, i: usize) -> [f64; 3] {
        std::array::from_fn(|c| self.emission[i][c] + self.reflectance[i][c] * self.direct[i][c])
    }

    /// `Σ_j τ_ij F_ij B_j`.
    pub fn gather(matrix: &Matrix, i: usize, b: &[[f64; 3]]) -> [f64; 3] {
        let mut sum = [0.0; 3];
        if !matrix.is_clear() {
            for (j, f) in matrix.arriving(i) {
                (0..3).for_each(|c| sum[c] += f[c] * b[j][c]);
            }
            return sum;
        }
        for (j, f) in matrix.row(i) {
            (0..3).for_each(|c| sum[c] += f * b[j][c]);
        }
        sum
    }

    /// Where the power is; every part from what it is defined by.
    ///
    /// What is absorbed is `A_i (1 − ρ_i) H_i` but for what passes; what escapes is measured by the row sums of the factors in use, `A_i (B_i − U_i) (1 − Σ_j F_ij)`, what the
    /// medium absorbs by `A_i (B_i − U_i) Σ_j (1 − τ_ij) F_ij`: the sums of elements that have sent out nothing need not be known. What passes a surface is met
    /// once more behind it, and rows sum to more than one by as much; so it is added to what escapes ([`Self::passed`]).
    pub fn balance(&self, sums: &Sums, irradiance: &[[f64; 3]], radiosity: &[[f64; 3]], unshot: &[[f64; 3]]) -> Balance {
        let passed = self.passed(irradiance);
        let mut balance = Balance { absorbed: passed.map(|p| -p), escaped: passed, ..Balance::default() };
        for i in 0..self.n() {
            let area = self.area[i];
            for c in 0..3 {
                let shot = radiosity[i][c] - unshot[i][c];
                let lights_passed = self.transmittance.get(i).map_or(0.0, |t| t[c]) * self.direct[i][c];
                balance.emitted[c] += area * (self.emission[i][c] + self.direct[i][c] - lights_passed);
                balance.absorbed[c] += area * ((1.0 - self.reflectance[i][c]) * irradiance[i][c] - lights_passed);
                if shot != 0.0 {
                    balance.escaped[c] += area * shot * (1.0 - sums.met[i]);
                    balance.in_medium[c] +=
                        sums.arriving.get(i).map_or(0.0, |arriving| area * shot * (sums.met[i] - arriving[c]));
                }
                balance.unshot[c] += area * unshot[i][c];
            }
        }
        balance
    }

    /// Power of surfaces that passes others: `Σ A_i τ_i (H_i − D_i)`, with one τ for all channels, as form factors have it.
    pub fn passed(&self, irradiance: &[[f64; 3]]) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for (i, tau) in self.transmittance.iter().enumerate() {
            let passes = self.area[i] * (tau[0] + tau[1] + tau[2]) / 3.0;
            (0..3).for_each(|c| sum[c] += passes * (irradiance[i][c] - self.direct[i][c]));
        }
        sum
    }

    /// The share of ambient light in every channel: what the unshot power would bring to every surface if it were spread evenly, with all its
    /// reflections. For display only. Source: [Cohen88].
    ///
    /// ```text
    /// Amb = (Σ A U / Σ A) / (1 − ρ̄),   ρ̄ = Σ A ρ / Σ A
    /// ```
    pub fn ambient(&self, unshot: &[[f64; 3]]) -> [f64; 3] {
        let area: f64 = self.area.iter().sum();
        std::array::from_fn(|c| {
            let mean = |v: &[[f64; 3]]| v.iter().zip(&self.area).map(|(v, a)| v[c] * a).sum::<f64>() / area;
            let ambient = mean(unshot) / (1.0 - mean(&self.reflectance)).max(1e-3);
            if ambient.is_finite() { ambient } else { 0.0 }
        })
    }
}
