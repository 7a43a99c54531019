//! How a radiosity solution is made.

use clap::{Args, ValueEnum};

use super::factors::Estimator;
use super::value::{parse_color, parse_scale};

/// Everything that decides about a radiosity solution.
#[derive(Args, Clone, Debug, PartialEq)]
#[command(next_help_heading = "Radiosity")]
pub(crate) struct Radiosity {
    /// About how many elements surfaces are divided into, beyond one for each side of a surface [default: 4000]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=50_000_000))]
    pub(crate) elements: Option<u32>,

    /// The longest edge of an element in metres, instead of --elements
    #[arg(long, value_name = "METRES", value_parser = parse_scale, conflicts_with = "elements")]
    pub(crate) element_size: Option<f64>,

    /// Cut elements along the borders of umbra and penumbra of so many lamps and emissive surfaces, the most powerful first (discontinuity meshing); up to about
    /// twice as many elements
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u32).range(0..=1024))]
    pub(crate) discontinuities: u32,

    /// What a medium between surfaces absorbs, per metre: one number, or three for its channels
    #[arg(long, value_name = "SIGMA", value_parser = parse_color)]
    pub(crate) absorption: Option<[f32; 3]>,

    /// How the radiosity equation is solved
    #[arg(long, value_enum, default_value_t = Solver::Auto)]
    pub(crate) solver: Solver,

    /// Stop when the residual is this part of all radiosity (gathering, shooting)
    #[arg(long, value_name = "X", default_value_t = 1e-6, value_parser = parse_scale)]
    pub(crate) residual: f64,

    /// Stop when no radiosity changes by more than this in a step, W/m² or lm/m² (gathering, shooting) [default: never]
    #[arg(long, value_name = "X", value_parser = parse_scale)]
    pub(crate) change: Option<f64>,

    /// Stop after so many steps: sweeps, batches of shots, iterations of rays
    #[arg(long, value_name = "N", default_value_t = 100_000, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) steps: u32,

    /// How form factors are estimated, where the solver needs any
    #[arg(long, value_enum, default_value_t = Estimator::Analytic)]
    pub(crate) estimator: Estimator,

    /// Stop when this part of the emitted power is left unshot (shooting) [default: never]
    #[arg(long, value_name = "X", value_parser = parse_scale)]
    pub(crate) unshot: Option<f64>,

    /// Stop at this relative standard error of irradiances (stochastic)
    #[arg(long, value_name = "X", default_value_t = 0.03, value_parser = parse_scale)]
    pub(crate) error: f64,

    /// Who shoots next
    #[arg(long, value_enum, default_value_t = Order::Power)]
    pub(crate) order: Order,

    /// Elements shoot in blocks of N×N (substructuring)
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=64))]
    pub(crate) block: u32,

    /// Rays of the first iteration of the stochastic solver [default: by the number of elements]
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    pub(crate) rays: u32,

    /// The power that one link between groups of elements may misplace, relative to that of a mean element (hierarchical)
    #[arg(long, value_name = "X", default_value_t = 0.01, value_parser = parse_scale)]
    pub(crate) tolerance: f64,

    /// Rings of quadrilaterals made of a sphere
    #[arg(long, value_name = "N", default_value_t = 12, value_parser = clap::value_parser!(u32).range(2..=256))]
    pub(crate) sphere_rings: u32,

    /// Times that elements are divided into four where light varies most, after a first solve, up to about 11 000 elements [default: 1, for
    /// the hybrid 0]
    #[arg(long, value_name = "TIMES", value_parser = clap::value_parser!(u32).range(0..=8))]
    pub(crate) refine: Option<u32>,

    /// The largest step of reflected light between elements that --refine leaves, relative to the mean of all surfaces
    #[arg(long, value_name = "X", default_value_t = 0.1, value_parser = parse_scale)]
    pub(crate) refine_step: f64,

    /// How radiosity is spread over elements in pictures
    #[arg(long, value_enum, default_value_t = Spread::Gouraud)]
    pub(crate) spread: Spread,
}

impl Radiosity {
    /// Their names.
    pub(crate) fn options() -> Vec<String> {
        let command = Self::augment_args(clap::Command::new("radiosity"));
        command.get_arguments().filter_map(|a| a.get_long().map(str::to_owned)).collect()
    }
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Lamps {
    /// Computed at every sample of a picture, with shadow rays
    Sharp,
    /// From the elements, as all other light
    Elements,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Overlay {
    /// The borders of elements
    Mesh,
    /// The links of one element, with --solver hierarchical: see --links-of
    Links,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Show {
    /// What a camera sees
    Radiance,
    /// What arrives at surfaces, in W/m² or lux
    Irradiance,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Solver {
    /// Gauss-Seidel up to 12 000 elements, stochastic beyond
    Auto,
    /// Gathering, from the sweep before
    Jacobi,
    /// Gathering, from the newest values
    GaussSeidel,
    /// Progressive refinement: what has most to give gives first
    Shooting,
    /// Links between groups of elements, as coarse as --tolerance allows
    Hierarchical,
    /// Rays instead of form factors
    Stochastic,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Order {
    /// The most unshot power first
    Power,
    /// The largest unshot radiosity first
    Radiosity,
    /// One after the other
    Cyclic,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Spread {
    /// One value an element
    Flat,
    /// Between the corners of elements
    Gouraud,
}
