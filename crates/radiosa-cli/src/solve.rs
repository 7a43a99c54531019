//! Radiosity solutions.

use radiosa::radiosity::{self, mesh, solve};
use radiosa::scene::Light;

use crate::args::{Radiosity, Solver};

/// What the options ask for.
pub(crate) fn settings(options: &Radiosity, seed: u64, extra_lights: &[Light]) -> radiosity::Settings {
    radiosity::Settings {
        mesh: mesh::Settings { elements: options.elements, size: options.element_size, sides: mesh::Sides::Lit },
        solver: match options.solver {
            Solver::Jacobi => solve::Solver::Jacobi,
            Solver::GaussSeidel => solve::Solver::GaussSeidel,
        },
        stop: solve::Stop { residual: options.residual, ..solve::Stop::default() },
        extra_lights: extra_lights.to_vec(),
        seed,
        ..radiosity::Settings::default()
    }
}
