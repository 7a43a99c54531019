//! Solvers of the radiosity equation.

pub mod gathering;

/// The solvers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Solver {
    /// Gathering from the sweep before.
    Jacobi,
    /// Gathering from the newest.
    #[default]
    GaussSeidel,
}

/// When a solver stops.
#[derive(Clone, Debug, PartialEq)]
pub struct Stop {
    /// Largest residual `|E + ρ H − B|` relative to the largest radiosity.
    pub residual: f64,
    /// Steps at most.
    pub steps: u32,
}

impl Default for Stop {
    fn default() -> Self {
        Self { residual: 1e-6, steps: 1000 }
    }
}

/// One step of a solve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Record {
    /// From 1.
    pub step: u32,
    /// Largest change of a radiosity relative to the largest radiosity.
    pub residual: f64,
}

/// How a solve went.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct History {
    /// In order.
    pub records: Vec<Record>,
}
