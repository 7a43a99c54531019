//! Gathering: every element collects what the others send it, again and again.
//!
//! ```text
//! Jacobi        B_i ← E_i + ρ_i (D_i + Σ_j F_ij B_j)   with the radiosities of the sweep before
//! Gauss–Seidel  the same with the newest ones
//! ```
//!
//! The matrix is strictly diagonally dominant while reflectances are below one, so both converge, the error shrinking by about the mean reflectance a
//! sweep (Gauss–Seidel by about its square). Sums are in f64. Source: [Goral84].

use rayon::prelude::*;

use super::super::matrix::Matrix;
use super::super::system::System;

/// Which radiosities a sweep reads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sweep {
    /// Those of the sweep before.
    Jacobi,
    /// The newest.
    #[default]
    GaussSeidel,
}

/// Radiosities on their way.
#[derive(Debug)]
pub struct Gathering<'a> {
    system: &'a System,
    matrix: &'a Matrix,
    sweep: Sweep,
    b: Vec<[f64; 3]>,
}

impl<'a> Gathering<'a> {
    /// Starts from what leaves the elements first.
    pub fn new(system: &'a System, matrix: &'a Matrix, sweep: Sweep) -> Self {
        Self { b: (0..system.n()).map(|i| system.initial(i)).collect(), system, matrix, sweep }
    }

    /// B_i, W/m² or lm/m².
    pub fn radiosity(&self) -> &[[f64; 3]] {
        &self.b
    }

    /// One sweep over all elements. Returns the largest change of a radiosity relative to the largest radiosity.
    pub fn step(&mut self) -> f64 {
        let (mut change, mut largest) = (0.0f64, 0.0f64);
        let mut note = |old: [f64; 3], new: [f64; 3]| {
            for c in 0..3 {
                change = change.max((new[c] - old[c]).abs());
                largest = largest.max(new[c].abs());
            }
        };
        match self.sweep {
            Sweep::Jacobi => {
                let next: Vec<_> = (0..self.b.len()).into_par_iter().map(|i| self.updated(i)).collect();
                self.b.iter().zip(&next).for_each(|(old, new)| note(*old, *new));
                self.b = next;
            }
            Sweep::GaussSeidel => {
                for i in 0..self.b.len() {
                    let new = self.updated(i);
                    note(self.b[i], new);
                    self.b[i] = new;
                }
            }
        }
        if largest > 0.0 { change / largest } else { 0.0 }
    }

    fn updated(&self, i: usize) -> [f64; 3] {
        let first = self.system.initial(i);
        if self.system.reflectance[i] == [0.0; 3] {
            return first;
        }
        let gathered = System::gather(self.matrix, i, &self.b);
        std::array::from_fn(|c| first[c] + self.system.reflectance[i][c] * gathered[c])
    }

    /// H_i = D_i + Σ_j F_ij B_j, W/m² or lux.
    pub fn irradiance(&self) -> Vec<[f64; 3]> {
        let of = |i: usize| {
            let gathered = System::gather(self.matrix, i, &self.b);
            std::array::from_fn(|c| self.system.direct[i][c] + gathered[c])
        };
        (0..self.b.len()).into_par_iter().map(of).collect()
    }
}
