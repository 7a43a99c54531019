//! Gathering: every element collects what the others send it, again and again.
//!
//! ```text
//! Jacobi        B_i ← E_i + ρ_i (D_i + Σ_j F_ij B_j)   with the radiosities of the sweep before
//! Gauss–Seidel  the same with the newest ones
//! ```
//!
//! The matrix is strictly diagonally dominant while reflectances are below one, so both converge, the error shrinking by about the mean reflectance a
//! sweep (Gauss–Seidel by about its square). Sums are in f64. Source: [Goral84].
//!
//! A step of Gauss–Seidel ends with one of Jacobi: it measures the residual, which the change of a sweep is not, and improves the result as well.

use rayon::prelude::*;

use super::super::matrix::Matrix;
use super::super::system::{System, Unknowns};

/// Which radiosities a sweep reads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sweep {
    /// Those of the sweep before.
    Jacobi,
    /// The newest.
    #[default]
    GaussSeidel,
}

/// One step over all elements.
pub fn step(system: &System, matrix: &Matrix, sweep: Sweep, unknowns: &mut Unknowns) {
    let Unknowns { radiosity, irradiance, unshot } = unknowns;
    let arriving = |i: usize, b: &[[f64; 3]]| {
        let gathered = System::gather(matrix, i, b);
        std::array::from_fn(|c| system.direct[i][c] + gathered[c])
    };
    let leaving = |i: usize, h: [f64; 3]| std::array::from_fn(|c| system.emission[i][c] + system.reflectance[i][c] * h[c]);
    if sweep == Sweep::GaussSeidel {
        for i in (0..system.n()).filter(|&i| system.reflectance[i] != [0.0; 3]) {
            radiosity[i] = leaving(i, arriving(i, radiosity));
        }
    }
    // All of it goes out.
    irradiance.par_iter_mut().enumerate().for_each(|(i, h)| *h = arriving(i, radiosity));
    for i in 0..system.n() {
        let shot = radiosity[i];
        radiosity[i] = leaving(i, irradiance[i]);
        unshot[i] = std::array::from_fn(|c| radiosity[i][c] - shot[c]);
    }
}
