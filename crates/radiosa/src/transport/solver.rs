//! Computations that improve in short, visible steps.

use super::World;

/// What a step of a [`Solver`] achieved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Step {
    /// There is more to do; how much of the whole is done, in `[0, 1]`.
    Working {
        /// Fraction done.
        done: f64,
    },
    /// Nothing is left to do.
    Converged,
}

/// A computation that improves in short, visible steps: pictures, gathering, shooting, baking. The caller owns the loop and
/// the clock: progress bars, live pictures, checkpoints and cancellation (stop calling) need no further machinery.
pub trait Solver {
    /// What it works on.
    type Solution;

    /// Does a little more; the work done never depends on the number of threads.
    fn step(&mut self, world: &World) -> Step;

    /// Readable after every step.
    fn solution(&self) -> &Self::Solution;
}
