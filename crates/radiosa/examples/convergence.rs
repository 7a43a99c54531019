//! How the radiosity solvers converge, over work and over time, drawn as a picture: `convergence [SCENE] [OUTPUT.svg] [ELEMENTS]`.

mod plot;

use std::fmt::Write;
use std::path::Path;
use std::time::Instant;

use plot::{Axes, Svg};
use radiosa::import;
use radiosa::math::CpuPath;
use radiosa::radiosity::solve::{Solver as Method, Stop, shooting, stochastic};
use radiosa::radiosity::{Division, Radiosity, Settings, Solution, mesh};
use radiosa::transport::{Solver, Step, World};

/// A solver's way: work in sweeps' worth of exchanges, seconds, and error.
struct Curve {
    name: &'static str,
    color: &'static str,
    points: Vec<[f64; 3]>,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let word = |i: usize, absent: &str| words.get(i).map_or(absent, String::as_str).to_owned();
    let (name, output, elements) = (word(0, "cornell-box"), word(1, "convergence.svg"), word(2, "1500").parse()?);
    let scene = match import::sample::load(&name) {
        Some(scene) => scene,
        None => import::load(Path::new(&name), &import::Options::default())?.0,
    };
    let world = World::prepare(scene, CpuPath::detect())?;
    let settings = |solver: Method, residual: f64, error: f64| Settings {
        mesh: mesh::Settings { elements, ..mesh::Settings::default() },
        solver,
        stop: Stop { residual, error, ..Stop::default() },
        ..Settings::default()
    };
    let converged = radiosa::radiosity::solve(&world, &settings(Method::GaussSeidel, 1e-12, 0.0));
    // What both kinds count: exchanges between two elements, in numbers of those of one sweep.
    let sweep = converged.n_factors as f64;
    let error = |radiosity: &[[f64; 3]]| {
        let (mut off, mut all) = (0.0, 0.0);
        for ((b, truth), area) in radiosity.iter().zip(&converged.radiosity).zip(&converged.system.area) {
            for c in 0..3 {
                off += area * (b[c] - truth[c]).powi(2);
                all += area * truth[c].powi(2);
            }
        }
        (off / all).sqrt()
    };
    let follow = |solver: Method, accuracy: f64, note: &mut dyn FnMut(f64, f64, &Solution)| {
        let settings = settings(solver, accuracy, 6e-3);
        let division = Division::new(&world, &settings);
        let mut radiosity = Radiosity::new(&world, &division, &settings);
        let mut spent = 0.0;
        loop {
            let start = Instant::now();
            let step = radiosity.step(&world);
            spent += start.elapsed().as_secs_f64();
            let solution = radiosity.solution();
            let work = solution.history.records.last().map_or(0.0, |r| (r.n_exchanges + r.n_rays) as f64 / sweep);
            note(work, spent, solution);
            if step == Step::Converged {
                break;
            }
        }
    };
    let mut curves = Vec::new();
    let shoot = Method::Shooting(shooting::Settings::default());
    let rays = Method::Stochastic(stochastic::Settings::default());
    for (name, color, solver, accuracy) in [
        ("Jacobi", "#0072b2", Method::Jacobi, 1e-8),
        ("Gauss–Seidel", "#009e73", Method::GaussSeidel, 1e-8),
        ("shooting", "#d55e00", shoot, 1e-6),
        ("stochastic", "#cc79a7", rays, 0.0),
    ] {
        let mut points = Vec::new();
        let mut ambient = Vec::new();
        follow(solver, accuracy, &mut |work, seconds, solution| {
            points.push([work, seconds, error(&solution.radiosity)]);
            if solver == shoot {
                ambient.push([work, seconds, error(&solution.with_ambient())]);
            }
        });
        let last = points[points.len() - 1];
        println!("{name}: {:.1} sweeps' worth, {:.2} s, error {:.1e}", last[0], last[1], last[2]);
        curves.push(Curve { name, color, points });
        if !ambient.is_empty() {
            curves.push(Curve { name: "shooting, shown with the ambient term", color: "#e69f00", points: ambient });
        }
    }
    std::fs::write(&output, picture(&name, converged.mesh.elements().len(), &curves))?;
    println!("{output}");
    Ok(())
}

/// Two plots side by side with logarithmic axes.
fn picture(scene: &str, n: usize, curves: &[Curve]) -> String {
    let mut svg = Svg::new(1000, 460);
    svg.add(format_args!(
        "<text x=\"60\" y=\"24\" font-size=\"16\">{scene}, {n} elements: error of radiosities (root mean square, relative)</text>"
    ));
    let floor = curves.iter().flat_map(|c| &c.points).map(|p| p[2]).filter(|e| *e > 0.0).fold(1.0, f64::min);
    let errors = [floor.max(1e-8).log10().floor() as i32, 0];
    let plots = [("work: exchanges between elements, or rays, in sweeps", 0, 60.0), ("time, seconds", 1, 540.0)];
    for (title, column, left) in plots {
        let reached = curves.iter().flat_map(|c| &c.points).map(|p| p[column]).filter(|v| *v > 0.0);
        let (low, high) = reached.fold((f64::INFINITY, 0.0f64), |(low, high), v| (low.min(v), high.max(v)));
        let decades = [(low.log10().floor() as i32).max(-3), high.log10().ceil() as i32];
        let axes = Axes { x: [left, left + 420.0], y: [40.0, 390.0], decades: [decades, errors] };
        svg.axes(&axes, title);
        for curve in curves {
            let inside = |p: &&[f64; 3]| p[column] >= 10f64.powi(decades[0]) && p[2] >= 10f64.powi(errors[0]);
            let mut points = String::new();
            let mut before = [f64::NEG_INFINITY; 2];
            for p in curve.points.iter().filter(inside) {
                let [x, y] = axes.at([p[column], p[2].min(1.0)]);
                // No more points than can be told apart.
                if (x - before[0]).hypot(y - before[1]) >= 1.0 || before[0].is_infinite() {
                    let _ = write!(points, "{x:.1},{y:.1} ");
                    before = [x, y];
                }
            }
            let color = curve.color;
            svg.add(format_args!(
                "<polyline points=\"{}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"2\"/>",
                points.trim_end()
            ));
        }
    }
    for (k, curve) in curves.iter().enumerate() {
        svg.legend(60.0 + [0.0, 90.0, 220.0, 320.0, 640.0][k.min(4)], 446.0, curve.color, curve.name);
    }
    svg.finish()
}
