//! How a radiosity solution is made.

use clap::{Args, ValueEnum};

use super::value::parse_scale;

/// Everything that decides about a radiosity solution.
#[derive(Args, Clone, Debug, PartialEq)]
#[command(next_help_heading = "Radiosity")]
pub(crate) struct Radiosity {
    /// About how many elements surfaces are divided into, beyond one for each side of a surface
    #[arg(long, value_name = "N", default_value_t = 4000, value_parser = clap::value_parser!(u32).range(0..=50_000_000))]
    pub(crate) elements: u32,

    /// The longest edge of an element in metres, instead of --elements
    #[arg(long, value_name = "METRES", value_parser = parse_scale)]
    pub(crate) element_size: Option<f64>,

    /// How the radiosity equation is solved
    #[arg(long, value_enum, default_value_t = Solver::GaussSeidel)]
    pub(crate) solver: Solver,

    /// Stop when no radiosity changes by more than this part of the largest
    #[arg(long, value_name = "X", default_value_t = 1e-6, value_parser = parse_scale)]
    pub(crate) residual: f64,

    /// Rings of quadrilaterals made of a sphere
    #[arg(long, value_name = "N", default_value_t = 12, value_parser = clap::value_parser!(u32).range(2..=256))]
    pub(crate) sphere_rings: u32,

    /// How radiosity is spread over elements in pictures
    #[arg(long, value_enum, default_value_t = Spread::Gouraud)]
    pub(crate) spread: Spread,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Solver {
    /// Gathering, from the sweep before
    Jacobi,
    /// Gathering, from the newest values
    GaussSeidel,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Spread {
    /// One value an element
    Flat,
    /// Between the corners of elements
    Gouraud,
}
