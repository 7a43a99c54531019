//! Solving a world: the steps from surfaces to radiosities, and what comes out.

use rayon::prelude::*;

use super::direct::DirectLight;
use super::form_factor::{Estimator, Factors, Row};
use super::hierarchical::Hierarchical;
use super::matrix::{Limited, Matrix};
use super::medium::Medium;
use super::mesh::{self, Blocks, ElementMesh};
use super::refine;
use super::solve::gathering::{self, Sweep};
use super::solve::pools::Pools;
use super::solve::shooting::Shooting;
use super::solve::stochastic::Stochastic;
use super::solve::{History, Record, Solver as Method, Stop};
use super::system::{Balance, Sums, System, Unknowns};
use crate::scene::Light;
use crate::spectrum::Spectrum;
use crate::transport::{Solver, Step, World};

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
    /// How elements are divided again.
    pub refine: refine::Settings,
    /// What is between surfaces.
    pub medium: Medium,
    /// Lights beside the scene's own.
    pub extra_lights: Vec<Light>,
    /// Of every random stream.
    pub seed: u64,
}

impl Settings {
    /// The light of what is not a surface.
    pub(super) fn direct<'a>(&self, world: &'a World) -> DirectLight<'a> {
        DirectLight::new(world, &self.extra_lights, self.seed).within(self.medium)
    }
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
    /// The part of B_i that has not been sent out yet.
    pub unshot: Vec<[f64; 3]>,
    /// Standard errors of H_i, by element, for solvers that leave something to chance; else empty. Those of B_i are ρ_i times as large.
    pub irradiance_error: Vec<[f64; 3]>,
    /// Sums of form factors as they are used: estimated, and brought down where an element would receive more than there is ([`Radiosity::limited`]).
    pub sums: Sums,
    /// Form factors above zero in the matrix.
    pub n_factors: usize,
    /// Where the power went.
    pub balance: Balance,
    /// How it came to be.
    pub history: History,
}

impl Solution {
    /// Irradiance of every surface by the light that has not been sent out yet, were it spread evenly ([`System::ambient`]).
    pub fn ambient(&self) -> [f64; 3] {
        self.system.ambient(&self.unshot)
    }

    /// Without any light.
    fn unsolved(mesh: ElementMesh, system: System) -> Self {
        let n = system.n();
        Self {
            mesh,
            radiosity: vec![[0.0; 3]; n],
            irradiance: vec![[0.0; 3]; n],
            unshot: vec![[0.0; 3]; n],
            irradiance_error: Vec::new(),
            sums: Sums::unknown(&system),
            n_factors: 0,
            balance: Balance::default(),
            history: History::default(),
            system,
        }
    }

    /// The elements of a divided world without any light, for who finds it otherwise.
    pub fn to_be_found(world: &World, division: Division, settings: &Settings) -> Self {
        let dark = || vec![[0.0; 3]; division.mesh.elements().len()];
        let system = with_direct(world, &division.mesh, &settings.direct(world), [dark(), dark()]);
        Self::unsolved(division.mesh, system)
    }

    /// Radiosities with the [`Self::ambient`] light added, for pictures of solutions on their way: `B_i + ρ_i Amb`.
    pub fn with_ambient(&self) -> Vec<[f64; 3]> {
        let ambient = self.ambient();
        let shown = |(b, rho): (&[f64; 3], &[f64; 3])| std::array::from_fn(|c| b[c] + rho[c] * ambient[c]);
        self.radiosity.iter().zip(&self.system.reflectance).map(shown).collect()
    }
}

/// What the surfaces of a world are, over a mesh.
pub fn system(world: &World, mesh: &ElementMesh, direct: &DirectLight) -> System {
    with_direct(world, mesh, direct, direct.irradiance(mesh))
}

/// The same with this direct light, of all and of lamps.
fn with_direct(world: &World, mesh: &ElementMesh, direct: &DirectLight, [all, lamps]: [Vec<[f64; 3]>; 2]) -> System {
    let rgb = |s: Spectrum| [s.r, s.g, s.b].map(f64::from);
    let matter: Vec<_> = mesh.elements().par_iter().map(|e| mesh.matter(world, e)).collect();
    let mut system = System {
        area: mesh.elements().iter().map(|e| e.area).collect(),
        // Beyond one nothing would converge.
        reflectance: matter.iter().map(|m| rgb(m.reflectance).map(|r| r.clamp(0.0, 1.0))).collect(),
        emission: matter.iter().map(|m| rgb(m.emission)).collect(),
        direct: all,
        lamps: if direct.has_lamps() { lamps } else { Vec::new() },
        transmittance: if world.has_transparency() { matter.iter().map(|m| rgb(m.transmittance)).collect() } else { Vec::new() },
        medium: direct.medium(),
    };
    // Slivers of no area have no normal, and nothing that depends on one.
    for (i, element) in mesh.elements().iter().enumerate() {
        let values = [&mut system.reflectance[i], &mut system.emission[i], &mut system.direct[i]];
        if !element.normal.is_finite() || values.iter().any(|v| v.iter().any(|v| !v.is_finite())) {
            let more = [&mut system.lamps, &mut system.transmittance].map(|column| column.get_mut(i));
            values.into_iter().chain(more.into_iter().flatten()).for_each(|v| *v = [0.0; 3]);
        }
    }
    system
}

/// Solves a world at once; of refined meshes the last one.
pub fn solve(world: &World, settings: &Settings) -> Solution {
    let mut division = Division::new(world, settings);
    loop {
        let mut radiosity = Radiosity::new(world, &division, settings);
        while let Step::Working { .. } = radiosity.step(world) {}
        let solution = radiosity.into_solution();
        match refine::next(world, &solution, settings) {
            Some(mesh) => division = Division::of(mesh, &settings.solver),
            None => return solution,
        }
    }
}

/// The elements of a world, and the blocks of them that shoot.
#[derive(Debug)]
pub struct Division {
    mesh: ElementMesh,
    /// The mesh with blocks as elements behind the others, where they are more than single elements.
    with_blocks: Option<(ElementMesh, Blocks)>,
}

impl Division {
    /// Divides the surfaces of a world.
    pub fn new(world: &World, settings: &Settings) -> Self {
        let direct = settings.direct(world);
        Self::of(ElementMesh::new(world, &settings.mesh, &direct), &settings.solver)
    }

    /// Of a mesh as it is.
    pub fn of(mesh: ElementMesh, solver: &Method) -> Self {
        let with_blocks = match solver {
            Method::Shooting(s) if s.block > 1 => Some(mesh.with_blocks(s.block)),
            _ => None,
        };
        Self { mesh, with_blocks }
    }

    /// The elements.
    pub fn mesh(&self) -> &ElementMesh {
        &self.mesh
    }
}

/// Pairs of elements in the first rows of an upper triangle of `n`.
fn pairs_of(rows: usize, n: usize) -> u64 {
    (0..rows).map(|i| (n - 1 - i) as u64).sum()
}

/// Rows of the matrix found in one step.
const ROWS: usize = 64;

/// A world on its way to its solution: a step is some rows of the matrix, a sweep, a batch of shots or an iteration of rays.
///
/// What is known so far can be read after every step, and nothing depends on the number of threads.
#[derive(Debug)]
pub struct Radiosity<'a> {
    /// None for solvers that trace rays.
    factors: Option<Factors<'a>>,
    stop: Stop,
    progress: Progress,
    n_pairs: u64,
    n_exchanges: u64,
    has_converged: bool,
    limited: Limited,
    solution: Solution,
}

/// What a solver needs beside the solution so far, to go on.
#[derive(Clone, Debug)]
pub enum Progress {
    /// Shares of the matrix, of the first elements ([`Factors::part`]).
    Factors(Vec<Row>, Sweep),
    /// The matrix.
    Gathering(Matrix, Sweep),
    /// Whose turn it is, and rows that may be needed again.
    Shooting(Shooting),
    /// Rounds so far.
    Stochastic(Box<Stochastic>),
    /// Links so far.
    Hierarchical(Box<Hierarchical>),
}

impl Progress {
    /// Nothing is known yet.
    pub(super) fn new(division: &Division, settings: &Settings, system: &System) -> Self {
        match settings.solver.for_elements(system.n()) {
            Method::Jacobi => Self::Factors(Vec::new(), Sweep::Jacobi),
            Method::Auto | Method::GaussSeidel => Self::Factors(Vec::new(), Sweep::GaussSeidel),
            Method::Shooting(settings) => {
                let blocks = division.with_blocks.as_ref().map(|(_, blocks)| blocks.clone());
                Self::Shooting(Shooting::new(settings, blocks.unwrap_or_else(|| Blocks::single(system.n()))))
            }
            Method::Hierarchical(of) => Self::Hierarchical(Box::new(Hierarchical::new(of, &division.mesh))),
            Method::Stochastic(of) => {
                Self::Stochastic(Box::new(Stochastic::new(system, Pools::new(&division.mesh), of, settings.seed)))
            }
        }
    }
}

impl<'a> Radiosity<'a> {
    /// Nothing is solved yet: what surfaces are and what other lights bring them.
    pub fn new(world: &'a World, division: &'a Division, settings: &Settings) -> Self {
        let direct = settings.direct(world);
        Self::with_system(world, division, system(world, &division.mesh, &direct), settings)
    }

    /// With reflectances and emissions other than the world's, over the elements of `division`.
    pub fn with_system(world: &'a World, division: &'a Division, system: System, settings: &Settings) -> Self {
        let mesh = division.with_blocks.as_ref().map_or(&division.mesh, |(mesh, _)| mesh);
        let progress = Progress::new(division, settings, &system);
        let mut solution = Solution::unsolved(division.mesh.clone(), system);
        let Solution { system, radiosity, irradiance, unshot, sums, .. } = &mut solution;
        Unknowns { radiosity, irradiance, unshot }.start(system);
        let balance = system.balance(sums, irradiance, radiosity, unshot);
        let medium = system.medium;
        solution.balance = balance;
        let factors = match progress {
            Progress::Stochastic(_) => None,
            Progress::Hierarchical(_) => Some(Factors::for_links(world, mesh, &settings.estimator, medium)),
            _ => Some(Factors::in_medium(world, mesh, &settings.estimator, medium, settings.seed)),
        };
        Self {
            factors,
            stop: settings.stop,
            progress,
            n_pairs: 0,
            n_exchanges: 0,
            has_converged: false,
            limited: Limited::default(),
            solution,
        }
    }

    /// Goes on where another one was left, of the same world, division and settings, to the same result bit for bit. Without its progress: from the light it
    /// had found, with a new matrix.
    pub fn resume(
        world: &'a World,
        division: &'a Division,
        settings: &Settings,
        solution: Solution,
        progress: Option<Progress>,
    ) -> Self {
        let mut radiosity = Self::with_system(world, division, solution.system.clone(), settings);
        let n = solution.system.n();
        let progress = progress.unwrap_or_else(|| Progress::new(division, settings, &solution.system));
        if let Some(last) = solution.history.records.last() {
            (radiosity.n_pairs, radiosity.n_exchanges) = (last.n_pairs, last.n_exchanges);
            radiosity.has_converged = settings.stop.is_reached(last) && progress.is_whole();
        } else if let Progress::Gathering(..) = &progress {
            radiosity.n_pairs = pairs_of(n, n);
        }
        // (A matrix that is made once more counts once more.)
        if let Progress::Factors(parts, _) = &progress {
            radiosity.n_pairs += pairs_of(parts.len(), n);
        }
        (radiosity.solution, radiosity.progress) = (solution, progress);
        radiosity
    }

    /// Factors are being found for a matrix, all of which has to be held.
    pub fn factors_to_hold(&self) -> Option<&Factors<'a>> {
        self.factors.as_ref().filter(|_| matches!(self.progress, Progress::Factors(..)))
    }

    /// What of the matrix, as it was estimated, was brought down when it was put together.
    pub fn limited(&self) -> Limited {
        self.limited
    }

    /// What [`Self::resume`] wants beside the solution.
    pub fn progress(&self) -> &Progress {
        &self.progress
    }

    /// What has become of it.
    pub fn into_solution(self) -> Solution {
        self.solution
    }

    /// The same with its progress.
    pub fn into_parts(self) -> (Solution, Progress) {
        (self.solution, self.progress)
    }

    /// The matrix of form factors, once it is whole and while it is needed.
    pub fn matrix(&self) -> Option<&Matrix> {
        match &self.progress {
            Progress::Gathering(matrix, _) => Some(matrix),
            _ => None,
        }
    }

    /// Some more rows of the matrix, or the whole when all are there. Returns the fraction that is done, by pairs.
    fn make_matrix(&mut self) -> Option<f64> {
        let (Progress::Factors(parts, sweep), Some(factors)) = (&mut self.progress, &self.factors) else { return None };
        let n = self.solution.system.n();
        if parts.len() < n {
            let of = parts.len()..(parts.len() + ROWS).min(n);
            self.n_pairs += pairs_of(of.end, n) - pairs_of(of.start, n);
            parts.extend(factors.part(of.start as u32..of.end as u32));
            return Some(pairs_of(of.end, n) as f64 / pairs_of(n, n).max(1) as f64);
        }
        let mut matrix = factors.assemble(parts);
        let system = &self.solution.system;
        self.limited = matrix.limit(&|j| system.passes(j));
        self.solution.sums = Sums::of(&matrix);
        self.solution.n_factors = matrix.n_entries();
        self.progress = Progress::Gathering(matrix, *sweep);
        Some(1.0)
    }

    /// One step of the solver itself, and its record.
    fn advance(&mut self, world: &World) -> Record {
        let before = self.solution.radiosity.clone();
        let mut error = None;
        let mut n_rays = 0;
        let mut by_rays = None;
        let Solution { mesh, system, radiosity, irradiance, unshot, sums, irradiance_error, n_factors, .. } = &mut self.solution;
        let mut unknowns = Unknowns { radiosity, irradiance, unshot };
        match (&mut self.progress, &self.factors) {
            (Progress::Gathering(matrix, sweep), _) => {
                gathering::step(system, matrix, *sweep, &mut unknowns);
                self.n_exchanges += matrix.n_entries() as u64 * if *sweep == Sweep::Jacobi { 1 } else { 2 };
            }
            (Progress::Shooting(shooting), Some(factors)) => {
                let work = shooting.step(system, factors, &mut unknowns, sums);
                self.n_pairs += work.rows * (system.n() as u64).saturating_sub(1);
                self.n_exchanges += work.exchanges;
            }
            (Progress::Hierarchical(hierarchical), Some(factors)) => {
                let taken = hierarchical.step(system, factors, &mut unknowns, sums);
                self.n_pairs += taken.pairs;
                self.n_exchanges += taken.exchanges;
                *n_factors = 2 * hierarchical.n_links();
            }
            (Progress::Stochastic(stochastic), _) => {
                stochastic.step(world, mesh, system, &mut unknowns, sums);
                error = Some(stochastic.error());
                n_rays = stochastic.n_rays;
                by_rays = Some([stochastic.escaped(), stochastic.in_medium(), stochastic.passed()]);
                *irradiance_error = stochastic.standard_errors();
            }
            _ => unreachable!("matrices are made before, and shooters have factors"),
        }
        let mut balance = system.balance(sums, unknowns.irradiance, unknowns.radiosity, unknowns.unshot);
        if let Some([escaped, in_medium, passed]) = by_rays {
            let estimated = system.passed(unknowns.irradiance);
            (0..3).for_each(|c| balance.absorbed[c] += estimated[c] - passed[c]);
            (balance.escaped, balance.in_medium) = (escaped, in_medium);
        }
        let change = before.iter().zip(unknowns.radiosity.iter()).flat_map(|(a, b)| (0..3).map(move |c| (a[c] - b[c]).abs()));
        let (change, residual) = (change.fold(0.0, f64::max), unknowns.residual(system));
        let step = self.solution.history.records.len() as u32 + 1;
        Record { step, residual, change, balance, error, n_pairs: self.n_pairs, n_exchanges: self.n_exchanges, n_rays }
    }
}

/// Of the whole, what making the matrix takes.
const MATRIX: f64 = 0.95;

impl Solver for Radiosity<'_> {
    type Solution = Solution;

    fn step(&mut self, world: &World) -> Step {
        if self.has_converged {
            return Step::Converged;
        }
        if let Some(done) = self.make_matrix() {
            return Step::Working { done: MATRIX * done };
        }
        let record = self.advance(world);
        self.solution.balance = record.balance;
        self.solution.history.records.push(record);
        self.has_converged =
            self.stop.is_reached(&record) && (self.progress.is_whole() || record.step >= self.stop.steps || record.diverges());
        if self.has_converged {
            return Step::Converged;
        }
        let first = &self.solution.history.records[0];
        let way = |from: f64, now: f64, to: f64| {
            let done = libm::log(from / now) / libm::log(from / to);
            if done.is_finite() { done.clamp(0.0, 1.0) } else { 0.0 }
        };
        let done = match record.error {
            Some(error) => (self.stop.error / error).powi(2).min(1.0),
            None => way(first.residual, record.residual, self.stop.residual)
                .max(way(first.change, record.change, self.stop.change))
                .max(way(first.unshot(), record.unshot(), self.stop.unshot)),
        };
        let matrix = if matches!(self.progress, Progress::Gathering(..)) { MATRIX } else { 0.0 };
        Step::Working { done: matrix + (1.0 - matrix) * done }
    }

    fn solution(&self) -> &Solution {
        &self.solution
    }
}
