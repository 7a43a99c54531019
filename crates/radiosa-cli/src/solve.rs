//! Radiosity solutions.

use radiosa::radiosity::{self, mesh, solve};
use radiosa::scene::Light;

use crate::args::{Order, Radiosity, Solver};

/// What the options ask for.
pub(crate) fn settings(options: &Radiosity, seed: u64, extra_lights: &[Light]) -> radiosity::Settings {
    radiosity::Settings {
        mesh: mesh::Settings { elements: options.elements, size: options.element_size, ..mesh::Settings::default() },
        solver: match options.solver {
            Solver::Auto => solve::Solver::Auto,
            Solver::Jacobi => solve::Solver::Jacobi,
            Solver::GaussSeidel => solve::Solver::GaussSeidel,
            Solver::Shooting => solve::Solver::Shooting(solve::shooting::Settings {
                order: match options.order {
                    Order::Power => solve::shooting::Order::Power,
                    Order::Radiosity => solve::shooting::Order::Radiosity,
                    Order::Cyclic => solve::shooting::Order::Cyclic,
                },
                block: options.block,
                ..solve::shooting::Settings::default()
            }),
            Solver::Stochastic => solve::Solver::Stochastic(solve::stochastic::Settings {
                rays: options.rays,
                ..solve::stochastic::Settings::default()
            }),
        },
        stop: solve::Stop {
            residual: options.residual,
            unshot: options.unshot.unwrap_or(0.0),
            error: options.error,
            ..solve::Stop::default()
        },
        extra_lights: extra_lights.to_vec(),
        seed,
        ..radiosity::Settings::default()
    }
}
