//! Links and time of hierarchical radiosity against the number of elements, on three scenes over a factor of 100: `links [OUTPUT.svg] [MOST]`.

mod link_scenes;
mod plot;

use std::fmt::Write;
use std::time::Instant;

use plot::{Axes, Svg};
use radiosa::math::CpuPath;
use radiosa::radiosity::solve::Solver;
use radiosa::radiosity::{Settings, hierarchical, mesh, refine, solve};
use radiosa::transport::World;

/// Elements, links, seconds.
type Run = [f64; 3];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let output = words.first().map_or("links.svg", String::as_str);
    let most: f64 = words.get(1).map_or("100000", String::as_str).parse()?;
    let mut curves = Vec::new();
    for (name, color, scene) in link_scenes::scenes()? {
        let world = World::prepare(scene, CpuPath::detect())?;
        let mut runs: Vec<Run> = Vec::new();
        for k in 0..5 {
            let elements = (most * 10f64.powf(0.5 * f64::from(k) - 2.0)) as u32;
            let start = processor_seconds();
            let solution = solve(
                &world,
                &Settings {
                    mesh: mesh::Settings { elements, ..mesh::Settings::default() },
                    refine: refine::Settings { levels: 0, ..refine::Settings::default() },
                    solver: Solver::Hierarchical(hierarchical::Settings::default()),
                    ..Settings::default()
                },
            );
            let run = [solution.mesh.elements().len() as f64, solution.n_factors as f64, processor_seconds() - start];
            println!("{name}: {} elements, {} links, {:.2} s", run[0], run[1], run[2]);
            runs.push(run);
        }
        let powers = [1, 2].map(|column| slope(&runs, column));
        println!("{name}: links grow with the power {:.2} of elements, time with {:.2}", powers[0], powers[1]);
        curves.push((name, color, runs, powers));
    }
    std::fs::write(output, picture(&curves))?;
    println!("{output}");
    Ok(())
}

/// The power of elements with which a column grows: least squares of logarithms.
fn slope(runs: &[Run], column: usize) -> f64 {
    let n = runs.len() as f64;
    let mean = |i: usize| runs.iter().map(|run| run[i].ln()).sum::<f64>() / n;
    let (x, y) = (mean(0), mean(column));
    let products = runs.iter().map(|run| (run[0].ln() - x) * (run[column].ln() - y)).sum::<f64>();
    products / runs.iter().map(|run| (run[0].ln() - x).powi(2)).sum::<f64>()
}

/// What all threads of this process have taken, in seconds; on other systems than Linux the time that has passed.
fn processor_seconds() -> f64 {
    static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    let start = START.get_or_init(Instant::now);
    // (Ticks of a hundredth of a second in user and in system mode, the 14th and 15th field; the second may have blanks, but ends with a bracket.)
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<&str> = stat.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
    let ticks = |k: usize| fields.get(k).and_then(|field| field.parse::<f64>().ok());
    match (ticks(11), ticks(12)) {
        (Some(user), Some(system)) => (user + system) / 100.0,
        _ => start.elapsed().as_secs_f64(),
    }
}

/// Two plots side by side.
fn picture(curves: &[(&str, &str, Vec<Run>, [f64; 2])]) -> String {
    let mut svg = Svg::new(1000, 490);
    svg.add(format_args!("<text x=\"60\" y=\"24\" font-size=\"16\">Hierarchical radiosity at the default tolerance</text>"));
    let range = |column: usize| {
        let all = || curves.iter().flat_map(|(_, _, runs, _)| runs).map(|run| run[column]).filter(|v| *v > 0.0);
        let (low, high) = (all().fold(f64::INFINITY, f64::min), all().fold(0.0f64, f64::max));
        [low.log10().floor() as i32, high.log10().ceil() as i32]
    };
    for (title, column, left) in [("links against elements", 1, 60.0), ("processor seconds against elements", 2, 560.0)] {
        let axes = Axes { x: [left, left + 400.0], y: [40.0, 390.0], decades: [range(0), range(column)] };
        svg.axes(&axes, title);
        let mut polyline = |points: &mut dyn Iterator<Item = [f64; 2]>, style: &str| {
            let mut text = String::new();
            for point in points {
                let [x, y] = axes.at(point);
                let _ = write!(text, "{x:.1},{y:.1} ");
            }
            svg.add(format_args!("<polyline points=\"{}\" fill=\"none\" {style}/>", text.trim_end()));
        };
        for (_, color, runs, _) in curves {
            polyline(&mut runs.iter().map(|run| [run[0], run[column]]), &format!("stroke=\"{color}\" stroke-width=\"2\""));
        }
        if column == 1 {
            // As many as there are pairs, as far as the plot goes.
            let most = 10f64.powi(axes.decades[1][1]).sqrt();
            let first = 10f64.powi(axes.decades[0][0]);
            let pairs = [first, most.max(first)].map(|n| [n, n * n]);
            polyline(&mut pairs.into_iter(), "stroke=\"#888\" stroke-dasharray=\"4 4\"");
        }
    }
    for (k, (name, color, _, [links, time])) in curves.iter().enumerate() {
        let name = format!("{name}: powers {links:.2}, {time:.2}");
        svg.legend(60.0 + 320.0 * k as f64, 456.0, color, &name);
    }
    svg.legend(60.0, 476.0, "#888", "all pairs");
    svg.finish()
}
