//! Solvers of the radiosity equation, and what they have in common: when to stop, and how it went.

pub mod gathering;
pub mod pools;
pub mod shooting;
pub mod stochastic;

use super::system::Balance;

/// The solvers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Solver {
    /// Gauss–Seidel while the matrix is small ([`Solver::for_elements`]), stochastic beyond.
    #[default]
    Auto,
    /// Gathering from the sweep before.
    Jacobi,
    /// Gathering from the newest.
    GaussSeidel,
    /// Progressive refinement.
    Shooting(shooting::Settings),
    /// Links between groups of elements, as coarse as a tolerance allows.
    Hierarchical(super::hierarchical::Settings),
    /// Rays instead of form factors.
    Stochastic(stochastic::Settings),
}

impl Solver {
    /// What [`Solver::Auto`] stands for: up to 12 000 elements (72 million pairs: a few minutes on one core; at most 1.2 GB, twice that while
    /// it is put together) the matrix is made.
    pub fn for_elements(self, n: usize) -> Self {
        const MATRIX: usize = 12_000;
        match self {
            Self::Auto if n <= MATRIX => Self::GaussSeidel,
            Self::Auto => Self::Stochastic(stochastic::Settings::default()),
            chosen => chosen,
        }
    }
}

/// When a solver stops: as soon as one of them is reached. Time is the caller's: whoever wants to stop stops asking for steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stop {
    /// The residual `|E + ρ (D + F B) − B|`, by power relative to that of B.
    pub residual: f64,
    /// The largest change of a radiosity in a step, W/m² or lm/m²; zero: never.
    pub change: f64,
    /// Unshot power as a fraction of what is emitted; zero: never.
    pub unshot: f64,
    /// The relative standard error of irradiances, root mean square over areas: for the stochastic solver, whose residual says little.
    pub error: f64,
    /// Steps at most.
    pub steps: u32,
}

impl Default for Stop {
    fn default() -> Self {
        Self { residual: 1e-6, change: 0.0, unshot: 0.0, error: 0.03, steps: 100_000 }
    }
}

impl Stop {
    /// A step was good enough to be the last, or there have been too many.
    pub fn is_reached(&self, record: &Record) -> bool {
        self.is_satisfied(record) || record.step >= self.steps || record.diverges()
    }

    /// A step was good enough to be the last.
    pub fn is_satisfied(&self, record: &Record) -> bool {
        match record.error {
            Some(error) => error <= self.error,
            // (A shot that meets nothing but black changes no radiosity.)
            None => {
                let has_settled = self.change > 0.0 && record.change <= self.change;
                record.residual <= self.residual || has_settled || record.unshot() <= self.unshot
            }
        }
    }
}

/// One step of a solve: a sweep, a batch of shots, an iteration of rays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Record {
    /// From 1.
    pub step: u32,
    /// `|E + ρ (D + F B) − B|`, by power relative to that of B.
    pub residual: f64,
    /// Largest change of a radiosity in this step, W/m² or lm/m².
    pub change: f64,
    /// Where the power is.
    pub balance: Balance,
    /// Of irradiances, as in [`Stop::error`]; infinite until it can be told, `None` for solvers without chance.
    pub error: Option<f64>,
    /// Pairs of elements whose form factors have been estimated so far.
    pub n_pairs: u64,
    /// Multiplications by a form factor so far.
    pub n_exchanges: u64,
    /// Rays that carried light so far.
    pub n_rays: u64,
}

impl Record {
    /// More is left to send out than any room could have been given: its surfaces reflect more than they receive.
    pub fn diverges(&self) -> bool {
        const DIVERGED: f64 = 1e6;
        let unshot = self.unshot();
        unshot.is_nan() || unshot > DIVERGED
    }

    /// Unshot power as a fraction of the emitted, the channel where it is largest.
    pub fn unshot(&self) -> f64 {
        // (What is no number stays so: it must not pass for nothing.)
        let largest = |v: [f64; 3]| v.into_iter().fold(0.0f64, |a, b| if b.is_nan() || b.abs() > a { b.abs() } else { a });
        let (emitted, unshot) = (largest(self.balance.emitted), largest(self.balance.unshot));
        if emitted > 0.0 { unshot / emitted } else { 0.0 }
    }
}

/// How a solve went.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct History {
    /// In order.
    pub records: Vec<Record>,
}
