//! The verb `solve`, and what other verbs need of radiosity solutions.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use radiosa::export::image::Recipe;
use radiosa::export::{mesh as lit_mesh, solution as file};
use radiosa::hybrid::FinalGather;
use radiosa::import::Warning;
use radiosa::radiosity::form_factor::{self, Factors, Row, Scratch};
use radiosa::radiosity::hierarchical::Hierarchical;
use radiosa::radiosity::medium::Medium;
use radiosa::radiosity::mesh::{self, ElementMesh};
use radiosa::radiosity::patch::Patch;
use radiosa::radiosity::system::Balance;
use radiosa::radiosity::{self, Division, Progress, Settings, Solution, refine, solve};
use radiosa::scene::Light;
use radiosa::transport::{Solver as _, Step, World, default_light};
use serde_json::json;

use crate::args::{Exposure, Order, Radiosity, Solve, Solver, Work, factors::By, factors::Estimator};
use crate::error::Error;
use crate::factors::groups;
use crate::interrupt;
use crate::progress;
use crate::render::method::about_media;
use crate::render::output::{self, tell};
use crate::render::{plan, with_threads};

/// What the options ask for when a hybrid gathers from the solution: where they say nothing elements are not divided again, as none is ever seen.
pub(crate) fn settings_to_gather_from(options: &Radiosity, seed: u64, extra_lights: &[Light]) -> Settings {
    settings(&Radiosity { refine: options.refine.or(Some(0)), ..options.clone() }, seed, extra_lights)
}

/// What the options ask for.
pub(crate) fn settings(options: &Radiosity, seed: u64, extra_lights: &[Light]) -> Settings {
    Settings {
        mesh: mesh::Settings {
            elements: options.elements.unwrap_or(4000),
            size: options.element_size,
            discontinuities: options.discontinuities,
            ..mesh::Settings::default()
        },
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
            Solver::Hierarchical => solve::Solver::Hierarchical(radiosity::hierarchical::Settings {
                tolerance: options.tolerance,
                ..radiosity::hierarchical::Settings::default()
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
            change: options.change.unwrap_or(0.0),
            steps: options.steps,
        },
        estimator: match options.estimator {
            Estimator::Analytic => form_factor::Estimator::default(),
            Estimator::Hemicube => form_factor::Estimator::Hemicube(form_factor::hemicube::Settings::default()),
            Estimator::Hemisphere => form_factor::Estimator::Hemisphere(form_factor::hemisphere::Settings::default()),
            Estimator::Area => form_factor::Estimator::Area(form_factor::area::Settings::default()),
        },
        refine: refine::Settings {
            levels: options.refine.unwrap_or(1),
            threshold: options.refine_step,
            ..refine::Settings::default()
        },
        medium: Medium { absorption: options.absorption.unwrap_or_default().map(f64::from) },
        extra_lights: extra_lights.to_vec(),
        seed,
    }
}

/// Rings of spheres: those of a solution that was saved, where there is one.
///
/// # Errors
/// When the solution cannot be read.
pub(crate) fn rings(options: &Radiosity, solution: Option<&Path>) -> Result<u32, Error> {
    let Some(path) = solution else { return Ok(options.sphere_rings) };
    let saved = file::open(path, file::HEAD)?;
    Ok(saved.recipe().get(SPHERE_RINGS).and_then(|rings| rings.parse().ok()).unwrap_or(options.sphere_rings))
}

/// A solution that was saved, or a new one.
pub(crate) struct Found {
    pub(crate) solution: Solution,
    /// The fraction that is done.
    pub(crate) done: f64,
    /// Of a new one that was found by links.
    pub(crate) links: Option<Box<Hierarchical>>,
}

/// A solution that was saved, or a new one.
///
/// # Errors
/// When the file is damaged or of another scene, or solving takes too much memory.
pub(crate) fn saved_or_solved(
    world: &World,
    settings: &Settings,
    solution: Option<&Path>,
    work: &Work,
    bar: &progress::Progress,
) -> Result<Found, Error> {
    match solution {
        Some(path) => {
            let saved = file::open(path, work.max_memory)?;
            if !work.quiet
                && let Some(unfinished) = saved.recipe().get(UNFINISHED)
            {
                tell(&format!("warning[unfinished]: {}: {unfinished}", path.display()));
            }
            Ok(Found { solution: saved.into_solution(world)?, done: 1.0, links: None })
        }
        None => newly_solved(world, settings, State::Nothing, work, bar),
    }
}

/// A new solution.
///
/// # Errors
/// When solving takes too much memory.
fn newly_solved(world: &World, settings: &Settings, state: State, work: &Work, bar: &progress::Progress) -> Result<Found, Error> {
    let solved = solved(world, &within_memory(settings, work), state, work, bar, None)?;
    if !work.quiet {
        solved.warnings.iter().for_each(|(name, message)| tell(&format!("warning[{name}]: {message}")));
    }
    let links = match solved.progress {
        Some(Progress::Hierarchical(links)) => Some(links),
        _ => None,
    };
    Ok(Found { solution: solved.solution, done: solved.done, links })
}

/// A new solution for a hybrid, which finds the light of elements by itself: nothing is solved before unless a solver is asked for, or elements are too many for that.
///
/// # Errors
/// When the mesh or solving takes too much memory.
pub(crate) fn to_gather_from(world: &World, settings: &Settings, work: &Work, bar: &progress::Progress) -> Result<Found, Error> {
    if matches!(settings.solver, solve::Solver::Auto) && settings.refine.levels == 0 {
        elements_within_memory(world, settings, work)?;
        let division = Division::new(world, settings);
        if !FinalGather::finds_light_on(division.mesh()) {
            return newly_solved(world, settings, State::Divided(Box::new(division)), work, bar);
        }
        return Ok(Found { solution: Solution::to_be_found(world, division, settings), done: 1.0, links: None });
    }
    saved_or_solved(world, settings, None, work, bar)
}

/// The mesh can be held, as far as that can be told before it is made.
///
/// # Errors
/// When it cannot.
fn elements_within_memory(world: &World, settings: &Settings, work: &Work) -> Result<(), Error> {
    let n = ElementMesh::estimate(world, &settings.mesh);
    plan::within_memory_or(
        &format!("a mesh of about {n} elements"),
        n.saturating_mul(file::BYTES_AN_ELEMENT),
        work,
        "ask for fewer --elements, a larger --element-size, or a larger --max-memory",
    )
}

/// What progress is counted in.
pub(crate) const UNIT: &str = "pairs and rays";

/// The key in recipes of solutions: spheres have to be divided in the same way when they are read.
const SPHERE_RINGS: &str = "sphere-rings";

/// The key in recipes of solutions that were not solved to their end.
const UNFINISHED: &str = "unfinished";

/// Where a solve is saved, and how often.
struct Save<'a> {
    path: &'a Path,
    recipe: &'a Recipe,
    every: Duration,
}

/// What is there when a solve begins.
enum State {
    Nothing,
    Divided(Box<Division>),
    /// A solve that is gone on with.
    Begun(Box<(Division, Solution, Option<Progress>)>),
}

/// A solution, whole or as far as it came.
struct Solved {
    solution: Solution,
    /// What a solver needs to go on; `None` for a matrix that is not needed any more.
    progress: Option<Progress>,
    /// The fraction that is done.
    done: f64,
    /// The solver that was taken.
    solver: &'static str,
    /// What should be said: the name of the warning, and the words.
    warnings: Vec<(&'static str, String)>,
    /// Making the elements took this long, and solving over them.
    mesh_time: Duration,
    solve_time: Duration,
}

/// A solution over divided elements says more than the one before once its residual is this small.
const SAYS_MORE: f64 = 1e-3;

/// The same with no more links than memory allows.
fn within_memory(settings: &Settings, work: &Work) -> Settings {
    let mut settings = settings.clone();
    if let solve::Solver::Hierarchical(of) = &mut settings.solver {
        of.max_links = usize::try_from(work.max_memory / radiosity::hierarchical::BYTES_A_LINK).unwrap_or(usize::MAX).max(1);
    }
    settings
}

/// Solves until it is done, time is up or somebody interrupts; goes on from `state`. What was solved before elements were divided again is given
/// back where that ends before the new mesh says more.
///
/// # Errors
/// When it would take too much memory, or cannot be saved.
fn solved(
    world: &World,
    settings: &Settings,
    state: State,
    work: &Work,
    bar: &progress::Progress,
    save: Option<&Save>,
) -> Result<Solved, Error> {
    let start = Instant::now();
    elements_within_memory(world, settings, work)?;
    let (mut division, mut before) = match state {
        State::Nothing => (Division::new(world, settings), None),
        State::Divided(division) => (*division, None),
        State::Begun(begun) => {
            let (division, solution, progress) = *begun;
            (division, Some((solution, progress)))
        }
    };
    let mesh_time = start.elapsed();
    let mut warnings = Vec::new();
    let mut coincident = division.mesh().coincident();
    if let n @ 1.. = coincident.len()
        && let Some((of, first)) = coincident.next()
    {
        let name = |patch: &Patch| format!("\"{}\"", world.scene().instances[patch.instance.index()].name);
        let (of, first) = (name(of), name(first));
        warnings.push((
            "coincident",
            format!(
                "{n} surfaces lie in the plane of others, such as {of} in that of {first}: where they do, the first is there"
            ),
        ));
    }
    drop(coincident);
    if let n @ 1.. = division.mesh().n_coarser() {
        let most = radiosa::radiosity::mesh::MAX_CELLS;
        warnings.push((
            "element-size",
            format!("elements of {n} of the surfaces are longer than --element-size: an edge has {most} of them at most; divide larger surfaces in the scene"),
        ));
    }
    if let n @ 1.. = division.mesh().record().shadows.n_left_out {
        let taken = division.mesh().record().shadows.lines.len();
        warnings.push((
            "discontinuities",
            format!("{taken} borders of shadows are cut into elements; {n} weaker lines and shorter edges are left out: more --elements take more of them"),
        ));
    }
    let mut last_save = (Instant::now(), Duration::ZERO);
    let mut coarse: Option<Solution> = None;
    loop {
        let mut radiosity = match before.take() {
            Some((solution, progress)) => radiosity::Radiosity::resume(world, &division, settings, solution, progress),
            None => radiosity::Radiosity::new(world, &division, settings),
        };
        if let Some(factors) = radiosity.factors_to_hold() {
            factors_within_memory(factors, work)?;
        }
        let mut ended = None;
        while let Step::Working { done } = radiosity.step(world) {
            let last = radiosity.solution().history.records.last();
            bar.update(done, last.map_or(0, |r| r.n_pairs + r.n_rays));
            if interrupt::asked() || work.time.is_some_and(|limit| start.elapsed() >= limit) {
                ended = Some(done);
                break;
            }
            if let Some(save) = save
                // Saving takes a tenth of the time at most.
                && last_save.0.elapsed() >= save.every.max(9 * last_save.1)
            {
                let began = Instant::now();
                let state = file::State { solution: radiosity.solution(), progress: Some(radiosity.progress()) };
                file::write(save.path, save.recipe, world, settings, state)?;
                last_save = (Instant::now(), began.elapsed());
            }
        }
        let solver = radiosity.progress().name();
        let limited = radiosity.limited();
        // Of the last mesh alone.
        warnings.retain(|(name, _)| !matches!(*name, "factors" | "tolerance"));
        if limited.rows > 0 {
            let (rows, n, largest) = (limited.rows, radiosity.solution().system.n(), limited.largest);
            warnings.push(("factors", format!("form factors of {rows} of {n} elements summed to more than there is, up to {largest:.3}, and were brought down")));
        }
        if let (Progress::Hierarchical(found), solve::Solver::Hierarchical(asked)) = (radiosity.progress(), &settings.solver)
            && found.tolerance() > asked.tolerance
        {
            let (n, reached) = (found.n_links(), found.tolerance());
            warnings.push((
                "tolerance",
                format!("--max-memory allows {n} links: the tolerance is {reached:.2e} in place of {:.2e}", asked.tolerance),
            ));
        }
        let (solution, progress) = radiosity.into_parts();
        let finished = |done, solution, progress, warnings| {
            let solve_time = start.elapsed() - mesh_time;
            Solved { solution, progress, done, solver, warnings, mesh_time, solve_time }
        };
        if let Some(done) = ended {
            let last = solution.history.records.last();
            let says_more =
                last.is_some_and(|last| last.residual <= SAYS_MORE && last.error.is_none_or(|e| e <= settings.stop.error));
            if let Some(coarse) = coarse.filter(|_| !says_more) {
                warnings.push((
                    "not-refined",
                    "there was no time to solve over the divided elements: this is the solution before".into(),
                ));
                return Ok(finished(done, coarse, None, warnings));
            }
            return Ok(finished(done, solution, Some(progress), warnings));
        }
        match refine::next(world, &solution, settings) {
            Some(mesh) => {
                division = Division::of(mesh, &settings.solver);
                coarse = Some(solution);
            }
            None => {
                if let Some(last) = solution.history.records.last().filter(|last| !settings.stop.is_satisfied(last)) {
                    let (steps, residual) = (last.step, last.residual);
                    warnings.push((
                        "not-converged",
                        format!("after {steps} steps the residual is still {residual:.1e}: does anything absorb the light?"),
                    ));
                }
                let needed = !matches!(progress, Progress::Factors(..) | Progress::Gathering(..));
                return Ok(finished(1.0, solution, Some(progress).filter(|_| needed), warnings));
            }
        }
    }
}

/// An error when the factors of all elements would take more than is allowed, judged by a few rows.
pub(crate) fn factors_within_memory(factors: &Factors, work: &Work) -> Result<(), Error> {
    const ROWS: usize = 8;
    /// A factor takes 16 bytes, and half as much again while rows are put together.
    const BYTES: u64 = 24;
    let n = factors.mesh().elements().len();
    if (n as u64).pow(2) * BYTES <= work.max_memory || n == 0 {
        return Ok(());
    }
    let (mut row, mut scratch, mut entries) = (Row::default(), Scratch::default(), 0);
    for k in 0..ROWS {
        factors.row((n * (2 * k + 1) / (2 * ROWS)) as u32, &mut row, &mut scratch);
        entries += row.entries.len();
    }
    let needed = (entries as u64 * n as u64 / ROWS as u64) * BYTES;
    plan::within_memory_or(
        "the form factors",
        needed,
        work,
        "ask for fewer --elements, another --solver, or a larger --max-memory",
    )
}

pub(crate) fn run(args: &Solve, json: bool) -> Result<ExitCode, Error> {
    with_threads(&args.work, || run_solve(args, json))
}

fn run_solve(args: &Solve, json: bool) -> Result<ExitCode, Error> {
    interrupt::listen();
    let start = Instant::now();
    let work = &args.work;
    args.output.as_deref().map_or(Ok(()), file::check_target)?;
    args.export.iter().try_for_each(|path| lit_mesh::check_target(path).map(drop))?;
    let mut warnings = Vec::new();
    let mut scene = plan::load(&args.scene, &args.changes, work, &mut warnings)?;
    let output = args.output.clone().unwrap_or_else(|| output::default_output(&scene).with_extension("radiosa"));
    file::check_target(&output)?;
    radiosity::tessellate(&mut scene, args.radiosity.sphere_rings);
    let load_time = start.elapsed();
    let world = plan::prepare(scene, work)?;
    let build_time = start.elapsed() - load_time;
    if world.scene().n_primitives() == 0 || !default_light::has_light(&world) {
        let what = if world.scene().n_primitives() == 0 { "has no surface" } else { "has no light: nothing emits" };
        warnings.push(Warning { name: "dark", path: PathBuf::from(&args.scene), message: format!("the scene {what}") });
    }
    if let Some((name, message)) = about_media(world.scene(), "solve", false) {
        warnings.push(Warning { name, path: PathBuf::from(&args.scene), message });
    }
    if !args.resume && output.exists() {
        let message = format!("{} is replaced; --resume would go on with it", output.display());
        warnings.push(Warning { name: "replaced", path: output.clone(), message });
    }
    if !work.quiet {
        output::say_warnings(&warnings);
    }
    let settings = within_memory(&settings(&args.radiosity, args.seed, &[]), work);
    let recipe = Recipe::new()
        .with("version", env!("CARGO_PKG_VERSION"))
        .with("command", output::command_line())
        .with("scene", &args.scene)
        .with(SPHERE_RINGS, args.radiosity.sphere_rings.to_string())
        .with("quantity", output::quantity_name(world.scene().quantity))
        .with("cpu-path", world.cpu_path().to_string());
    let state = if args.resume && output.exists() {
        State::Begun(Box::new(file::open(&output, work.max_memory)?.to_resume(&world, &settings)?))
    } else {
        State::Nothing
    };
    let resumed = match &state {
        State::Begun(begun) => Some(begun.1.history.records.len()),
        State::Nothing | State::Divided(_) => None,
    };
    let on_the_way = recipe.clone().with(UNFINISHED, "saved on the way; solve with --resume goes on with it");
    let save = Save { path: &output, recipe: &on_the_way, every: args.save_every };
    let bar = progress::Progress::new("solve", UNIT, work.quiet);
    let solved = solved(&world, &settings, state, work, &bar, Some(&save))?;
    bar.finish();
    let named =
        |(name, message): &(&'static str, String)| Warning { name, path: PathBuf::from(&args.scene), message: message.clone() };
    let without_effect = args.given.iter().filter(|option| !concerns(option, solved.solver)).map(|option| {
        let message = format!("--{option} changes nothing with the solver {}", solved.solver);
        Warning { name: "no-effect", path: PathBuf::from(&args.scene), message }
    });
    let late: Vec<Warning> = solved.warnings.iter().map(named).chain(without_effect).collect();
    if !work.quiet {
        output::say_warnings(&late);
    }
    warnings.extend(late);
    let began = Instant::now();
    let written = file::State { solution: &solved.solution, progress: solved.progress.as_ref() };
    let recipe = if solved.done < 1.0 { &on_the_way } else { &recipe };
    file::write(&output, recipe, &world, &settings, written)?;
    let exposure = match args.exposure {
        Exposure::Auto => None,
        Exposure::Factor(f) => Some(f),
    };
    for path in &args.export {
        lit_mesh::write(&lit_mesh::LitMesh::new(&world, &solved.solution, exposure), path)?;
    }
    let outputs: Vec<&PathBuf> = std::iter::once(&output).chain(&args.export).collect();

    let solution = &solved.solution;
    let balance = &solution.balance;
    let last = solution.history.records.last();
    if !work.quiet {
        // Parts of what is emitted, by channel.
        let part = |v: [f64; 3]| {
            let of = |c: usize| if balance.emitted[c] > 0.0 { v[c] / balance.emitted[c] * 100.0 } else { 0.0 };
            (0..3).map(|c| format!("{:.4}", of(c))).collect::<Vec<_>>().join(" ") + " %"
        };
        let power = balance.emitted.map(significant).join(" ");
        let mut lines = vec![
            format!("surfaces    {} elements of {} patches", solution.mesh.elements().len(), solution.mesh.patches().len()),
            format!("solver      {}, {} steps", solved.solver, solution.history.records.len()),
        ];
        if let Some(steps) = resumed {
            lines.push(format!("resumed     after {steps} steps"));
        }
        if let Some(last) = last {
            lines.push(match last.error {
                Some(error) => format!("error       {error:.2e} (relative standard error of irradiances)"),
                None => format!("residual    {:.2e}", last.residual),
            });
        }
        lines.extend([format!("emitted     {power} {}", power_unit(&world)), format!("absorbed    {}", part(balance.absorbed))]);
        if !solution.system.medium.is_clear() {
            lines.push(format!("in medium   {}", part(balance.in_medium)));
        }
        lines.extend([format!("escaped     {}", part(balance.escaped)), format!("unshot      {}", part(balance.unshot))]);
        if solved.done < 1.0 {
            let done = solved.done * 100.0;
            lines.push(format!("unfinished  {done:.1} % is done; run it again with --resume to go on"));
        }
        let times = [load_time, build_time, solved.mesh_time, solved.solve_time, began.elapsed()].map(|t| t.as_secs_f64());
        let [load, build, mesh, solve, write] = times;
        lines.push(format!(
            "time        load {load:.2} s, build {build:.2} s, mesh {mesh:.2} s, solve {solve:.2} s, write {write:.2} s"
        ));
        lines.extend(outputs.iter().map(|o| format!("wrote       {}", o.display())));
        tell(&lines.join("\n"));
    }
    if json {
        let report = json!({
            "scene": world.scene().name,
            "solver": solved.solver,
            "quantity": output::quantity_name(world.scene().quantity),
            "elements": solution.mesh.elements().len(),
            "patches": solution.mesh.patches().len(),
            "links": solution.n_factors,
            "steps": solution.history.records.len(),
            "residual": last.map(|r| r.residual),
            "error": last.and_then(|r| r.error),
            "pairs": last.map(|r| r.n_pairs),
            "rays": last.map(|r| r.n_rays),
            "balance": balance_json(balance),
            "history": history(solution),
            "surfaces": surfaces(&world, solution),
            "seconds": {
                "load": load_time.as_secs_f64(), "build": build_time.as_secs_f64(), "mesh": solved.mesh_time.as_secs_f64(),
                "solve": solved.solve_time.as_secs_f64(), "write": began.elapsed().as_secs_f64(), "total": start.elapsed().as_secs_f64(),
            },
            "resumed_after": resumed,
            "done": solved.done,
            "warnings": output::warnings_json(&warnings),
            "outputs": outputs,
        });
        crate::version::say(&report.to_string());
    }
    Ok(if interrupt::asked() { ExitCode::from(130) } else { ExitCode::SUCCESS })
}

/// Where the power is, by channel.
fn balance_json(balance: &Balance) -> serde_json::Value {
    json!({
        "emitted": balance.emitted, "absorbed": balance.absorbed, "in_medium": balance.in_medium, "escaped": balance.escaped, "unshot": balance.unshot,
        "error": balance.error(),
    })
}

/// Steps, some of them where there are many.
fn history(solution: &Solution) -> Vec<serde_json::Value> {
    const LISTED: usize = 500;
    let records = &solution.history.records;
    let every = records.len().div_ceil(LISTED).max(1);
    let of = |(k, r): (usize, &solve::Record)| {
        let is_listed = k % every == 0 || k + 1 == records.len();
        is_listed.then(|| {
            json!({
                "step": r.step, "residual": r.residual, "change": r.change, "error": r.error, "pairs": r.n_pairs, "exchanges": r.n_exchanges, "rays": r.n_rays,
                "balance": balance_json(&r.balance),
            })
        })
    };
    records.iter().enumerate().filter_map(of).collect()
}

/// An option means something to a solver.
fn concerns(option: &str, solver: &str) -> bool {
    match option {
        "block" | "order" | "unshot" => solver == "shooting",
        "error" | "rays" => solver == "stochastic",
        "tolerance" => solver == "hierarchical",
        "estimator" => !matches!(solver, "hierarchical" | "stochastic"),
        "residual" | "change" => solver != "stochastic",
        _ => true,
    }
}

/// A number with four digits that say something.
fn significant(v: f64) -> String {
    let digits = if v == 0.0 { 0.0 } else { 3.0 - v.abs().log10().floor() };
    format!("{v:.*}", digits.clamp(0.0, 12.0) as usize)
}

fn power_unit(world: &World) -> &'static str {
    match world.scene().quantity {
        radiosa::scene::Quantity::Radiometric => "W",
        radiosa::scene::Quantity::Photometric => "lm",
    }
}

/// By named surface: its area that light can reach, and means over it.
fn surfaces(world: &World, solution: &Solution) -> Vec<serde_json::Value> {
    let (group_of, names) = groups(world, &solution.mesh, By::Object);
    let mut sums = vec![(0.0, [0.0; 3], [0.0; 3]); names.len()];
    for (i, &group) in group_of.iter().enumerate() {
        let (area, h, b) = &mut sums[group as usize];
        let a = solution.system.area[i];
        *area += a;
        for c in 0..3 {
            h[c] += a * solution.irradiance[i][c];
            b[c] += a * solution.radiosity[i][c];
        }
    }
    names
        .iter()
        .zip(sums)
        .map(|(name, (area, h, b))| {
            let mean = |sum: [f64; 3]| sum.map(|s| if area > 0.0 { s / area } else { 0.0 });
            json!({ "name": name, "area": area, "irradiance": mean(h), "radiosity": mean(b) })
        })
        .collect()
}
