//! How many links hierarchical radiosity needs to be as far from the truth as the full matrix over the same elements: `links_error [ELEMENTS…]`.
//!
//! Both are off mainly because there are only so many elements, each of one value. Links may add 5 % to that error. The truth is found over the same elements
//! divided again, by many links.

mod link_scenes;

use radiosa::math::CpuPath;
use radiosa::radiosity::direct::DirectLight;
use radiosa::radiosity::form_factor::{Estimator, pair};
use radiosa::radiosity::mesh::ElementMesh;
use radiosa::radiosity::solve::Solver;
use radiosa::radiosity::{Division, Radiosity, Settings, Solution, hierarchical, mesh, refine};
use radiosa::transport::{Solver as _, Step, World};

/// How much larger than that of the matrix an error may be.
const ALLOWED: f64 = 1.05;

/// Tried until both errors are small enough.
const TOLERANCES: [f64; 11] = [0.32, 0.16, 0.08, 0.04, 0.02, 0.01, 0.005, 0.0025, 0.00125, 0.0006, 0.0003];

/// Of links for the truth, over 4 or 16 times as many elements.
const TRUTH: f64 = 0.0005;

/// Up to so many elements are divided twice for the truth.
const FEW: u32 = 5000;

/// Up to so many elements the truth is compared with another one.
const COMPARED: u32 = 1500;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let words: Vec<u32> = std::env::args().skip(1).map(|word| word.parse()).collect::<Result<_, _>>()?;
    let sizes = if words.is_empty() { vec![1000, 3000, 10_000] } else { words };
    println!("errors of irradiance, % of its root mean square: at points, one value an element; of the means of elements");
    for (name, _, scene) in link_scenes::scenes()? {
        let world = World::prepare(scene, CpuPath::detect())?;
        for &size in &sizes {
            compare(name, &world, size);
        }
    }
    Ok(())
}

/// One scene over about so many elements.
fn compare(name: &str, world: &World, size: u32) {
    let mesh = Division::new(world, &settings(size, Solver::GaussSeidel)).mesh().clone();
    let levels = if size <= FEW { 2 } else { 1 };
    let truth = solve_over(world, divided(world, &mesh, levels), &settings(size, links(TRUTH)));
    let truth = Truth::new(&mesh, &truth);
    if size <= COMPARED {
        // Over fewer elements, by a matrix whose shadows are cut out instead of sampled.
        let clipped = Estimator::Analytic(pair::Settings { clip: Some(1e-3), ..pair::Settings::default() });
        let other = Settings { estimator: clipped, ..settings(size, Solver::GaussSeidel) };
        let other = Truth::new(&mesh, &solve_over(world, divided(world, &mesh, levels - 1), &other));
        println!(
            "{name}: another truth, by a matrix over a fourth of the elements: means differ by {:.3} %",
            100.0 * other.off(&truth.means)[1]
        );
    }
    let matrix = solve_over(world, mesh.clone(), &settings(size, Solver::GaussSeidel));
    let of_matrix = truth.errors(&matrix);
    let print = |what: &str, n: usize, [points, means]: [f64; 2]| {
        let [points, means] = [points, means].map(|e| 100.0 * e);
        println!(
            "{name}, {} elements, {what}: {n} factors or links, points {points:.3} %, means {means:.3} %",
            mesh.elements().len()
        );
    };
    print("matrix", matrix.n_factors, of_matrix);
    let mut enough = [None; 2];
    for tolerance in TOLERANCES {
        let solution = solve_over(world, mesh.clone(), &settings(size, links(tolerance)));
        let errors = truth.errors(&solution);
        print(&format!("tolerance {tolerance}"), solution.n_factors, errors);
        for (enough, (error, matrix)) in enough.iter_mut().zip(errors.into_iter().zip(of_matrix)) {
            if enough.is_none() && error <= ALLOWED * matrix {
                *enough = Some(solution.n_factors);
            }
        }
        if enough.iter().all(Option::is_some) {
            break;
        }
    }
    for (what, enough) in ["points", "means"].into_iter().zip(enough) {
        let fewer = enough.map(|n| format!("{n} links, {:.1} times fewer", matrix.n_factors as f64 / n as f64));
        println!("{name}, {} elements: equal error of {what}: {}", mesh.elements().len(), fewer.as_deref().unwrap_or("never"));
    }
}

fn links(tolerance: f64) -> Solver {
    Solver::Hierarchical(hierarchical::Settings { tolerance, ..hierarchical::Settings::default() })
}

fn settings(elements: u32, solver: Solver) -> Settings {
    Settings {
        mesh: mesh::Settings { elements, ..mesh::Settings::default() },
        refine: refine::Settings { levels: 0, ..refine::Settings::default() },
        solver,
        ..Settings::default()
    }
}

/// Each element in four, so many times.
fn divided(world: &World, mesh: &ElementMesh, levels: u32) -> ElementMesh {
    let direct = DirectLight::new(world, &[], 0);
    (0..levels).fold(mesh.clone(), |mesh, _| mesh.refined(world, &direct, &vec![true; mesh.elements().len()]))
}

fn solve_over(world: &World, mesh: ElementMesh, settings: &Settings) -> Solution {
    let division = Division::of(mesh, &settings.solver);
    let mut radiosity = Radiosity::new(world, &division, settings);
    while let Step::Working { .. } = radiosity.step(world) {}
    radiosity.into_solution()
}

/// Irradiances over elements much smaller than those that are judged.
struct Truth {
    /// By small element: the one it is a part of, its area, its irradiance.
    parts: Vec<(usize, f64, f64)>,
    /// By element: the area of its parts, and their mean.
    areas: Vec<f64>,
    means: Vec<f64>,
}

impl Truth {
    fn new(mesh: &ElementMesh, fine: &Solution) -> Self {
        let n = mesh.elements().len();
        let part = |(i, e): (usize, &mesh::Element)| {
            let whole = mesh.element_on(e.patch, e.side, e.centre())?;
            Some((whole as usize, e.area, fine.irradiance[i][1]))
        };
        let parts: Vec<_> = fine.mesh.elements().iter().enumerate().filter_map(part).collect();
        let (mut areas, mut means) = (vec![0.0; n], vec![0.0; n]);
        for &(i, area, light) in &parts {
            areas[i] += area;
            means[i] += area * light;
        }
        means.iter_mut().zip(&areas).filter(|(_, area)| **area > 0.0).for_each(|(mean, area)| *mean /= area);
        Self { parts, areas, means }
    }

    /// Relative errors of a solution over the larger elements: at points, of means.
    fn errors(&self, of: &Solution) -> [f64; 2] {
        self.off(&of.irradiance.iter().map(|h| h[1]).collect::<Vec<_>>())
    }

    /// The same of irradiances by element.
    fn off(&self, light: &[f64]) -> [f64; 2] {
        let points = relative(self.parts.iter().map(|&(i, area, truth)| (area, light[i], truth)));
        let means = (0..light.len()).map(|i| (self.areas[i], light[i], self.means[i]));
        [points, relative(means)]
    }
}

/// `√(Σ A (H − T)² / Σ A T²)` over areas, found and true irradiances.
fn relative(of: impl Iterator<Item = (f64, f64, f64)>) -> f64 {
    let [off, all] =
        of.fold([0.0; 2], |[off, all], (area, found, truth)| [off + area * (found - truth).powi(2), all + area * truth * truth]);
    (off / all).sqrt()
}
