//! Solving a world: the steps from surfaces to radiosities, and what comes out.

use rayon::prelude::*;

use super::direct::DirectLight;
use super::form_factor::{Estimator, Factors, Row, Scratch};
use super::matrix::Matrix;
use super::mesh::{self, ElementMesh};
use super::solve::gathering::{Gathering, Sweep};
use super::solve::{History, Record, Solver as Method, Stop};
use super::system::{Balance, System};
use crate::scene::Light;
use crate::spectrum::Spectrum;
use crate::transport::World;

/// How a world is solved.
#[derive(Clone, Debug, Default)]
pub struct Settings {
    /// How surfaces are divided.
    pub mesh: mesh::Settings,
    /// How form factors are estimated.
    pub estimator: Estimator,
    /// How the system is solved.
    pub solver: Method,
    /// When it is solved.
    pub stop: Stop,
    /// Lights beside the scene's own.
    pub extra_lights: Vec<Light>,
    /// Of every random stream.
    pub seed: u64,
}

/// The light of a scene, independent of any camera.
#[derive(Clone, Debug)]
pub struct Solution {
    /// What carries it.
    pub mesh: ElementMesh,
    /// What it was solved from.
    pub system: System,
    /// B_i, W/m² or lm/m², by element.
    pub radiosity: Vec<[f64; 3]>,
    /// H_i, W/m² or lux, by element, light of every origin.
    pub irradiance: Vec<[f64; 3]>,
    /// `Σ_j F_ij` as estimated, by element.
    pub row_sums: Vec<f64>,
    /// Form factors above zero.
    pub n_factors: usize,
    /// Where the power went.
    pub balance: Balance,
    /// How it came to be.
    pub history: History,
}

/// What the surfaces of a world are, over a mesh.
pub fn system(world: &World, mesh: &ElementMesh, direct: &DirectLight) -> System {
    let rgb = |s: Spectrum| [s.r, s.g, s.b].map(f64::from);
    let matter: Vec<_> = mesh.elements().par_iter().map(|e| mesh.matter(world, e)).collect();
    System {
        area: mesh.elements().iter().map(|e| e.area).collect(),
        // Beyond one nothing would converge.
        reflectance: matter.iter().map(|m| rgb(m.reflectance).map(|r| r.clamp(0.0, 1.0))).collect(),
        emission: matter.iter().map(|m| rgb(m.emission)).collect(),
        direct: direct.irradiance(mesh),
    }
}

/// Solves a world at once.
pub fn solve(world: &World, settings: &Settings) -> Solution {
    let direct = DirectLight::new(world, &settings.extra_lights, settings.seed);
    let mesh = ElementMesh::new(world, &settings.mesh, &direct);
    let system = system(world, &mesh, &direct);
    let factors = Factors::new(world, &mesh, &settings.estimator, settings.seed);
    let matrix = factors.matrix();
    let row_sums: Vec<f64> = (0..system.n()).into_par_iter().map(|i| matrix.row_sum(i)).collect();
    let sweep = match settings.solver {
        Method::Jacobi => Sweep::Jacobi,
        Method::GaussSeidel => Sweep::GaussSeidel,
    };
    let mut gathering = Gathering::new(&system, &matrix, sweep);
    let mut history = History::default();
    for step in 1..=settings.stop.steps {
        let residual = gathering.step();
        history.records.push(Record { step, residual });
        if residual <= settings.stop.residual {
            break;
        }
    }
    let (radiosity, irradiance) = (gathering.radiosity().to_vec(), gathering.irradiance());
    let unshot: Vec<[f64; 3]> = vec![[0.0; 3]; system.n()];
    let balance = system.balance(&row_sums, &irradiance, &radiosity, &unshot);
    Solution { n_factors: matrix.n_entries(), mesh, radiosity, irradiance, row_sums, balance, history, system }
}

/// Rows as estimated one by one, for what wants no symmetry.
pub fn rows(factors: &Factors) -> Matrix {
    let rows: Vec<Row> = (0..factors.mesh().elements().len() as u32)
        .into_par_iter()
        .map_init(Scratch::default, |scratch, i| {
            let mut row = Row::new();
            factors.row(i, &mut row, scratch);
            row
        })
        .collect();
    Matrix::from_rows(&rows)
}
