//! The verb `factors`: form factors between the surfaces of a scene.

use std::collections::HashMap;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use radiosa::export::matrix;
use radiosa::import::Warning;
use radiosa::radiosity::between::{Between, Correction};
use radiosa::radiosity::form_factor::{self as form_factor, Factors, area, hemicube, hemisphere, pair};
use radiosa::radiosity::medium::Medium;
use radiosa::radiosity::mesh::{self, ElementMesh, Sides};
use radiosa::scene::Geometry;
use radiosa::transport::World;
use serde_json::json;

use crate::args::factors::{By, Correct, Estimator, Factors as Args, Kernel, Rule};
use crate::error::Error;
use crate::render::output::{say_warnings, tell, warnings_json};
use crate::render::{plan, with_threads};
use crate::solve::factors_within_memory;

/// Error of an unoccluded factor beside the one that is asked for where shadows fall.
const UNOCCLUDED: f64 = 1e-2;

/// Elements at most: factors are found by their numbers.
const MAX_ELEMENTS: usize = 1 << 24;
/// Of the mesh, and of what estimators keep of elements, about.
const BYTES_AN_ELEMENT: u64 = 1500;
/// Rows of a closed scene sum to this at least, in the mean.
const CLOSED: f64 = 0.97;

pub(crate) fn run(args: &Args, json: bool) -> Result<ExitCode, Error> {
    with_threads(&args.work, || factors(args, json))
}

fn factors(args: &Args, json: bool) -> Result<ExitCode, Error> {
    let start = Instant::now();
    for output in &args.output {
        matrix::check_target(output)?;
    }
    if args.absorption > 0.0 && args.correct == Correct::Closure {
        let message = "--correct closure makes rows sum to one, and with --absorption they do not";
        return Err(Error::Misuse(message.into()));
    }
    let mut warnings = Vec::new();
    let mut scene = plan::read(&args.scene, &[], &args.work, &mut warnings)?;
    let outputs =
        if args.output.is_empty() { vec![PathBuf::from(format!("{}-factors.csv", scene.name))] } else { args.output.clone() };
    for output in &outputs {
        matrix::check_target(output)?;
    }
    let exact_shapes = scene.instances.iter().filter(|i| !matches!(i.geometry, Geometry::Mesh(_))).count();
    if exact_shapes > 0 {
        let rings = args.sphere_rings;
        let message = format!(
            "{exact_shapes} spheres and discs are taken as {rings} rings of {} faces: errors fall with the square of --sphere-rings",
            2 * rings
        );
        warnings.push(Warning { name: "exact-shapes", path: PathBuf::from(&args.scene), message });
        radiosa::radiosity::tessellate(&mut scene, rings);
    }
    let world = plan::prepare(scene, &args.work)?;
    let settings = mesh::Settings {
        elements: args.elements.unwrap_or(0),
        size: args.size,
        sides: if args.two_sided { Sides::Both } else { Sides::Front },
        // Rows are of whole patches or cells.
        cuts_contacts: false,
        discontinuities: 0,
    };
    let n = ElementMesh::estimate(&world, &settings);
    if n > MAX_ELEMENTS as u64 {
        let message = format!("the surfaces make about {n} elements, more than {MAX_ELEMENTS}");
        return Err(Error::failed(message, "ask for a larger --size, or fewer --elements"));
    }
    plan::within_memory_or(
        &format!("a mesh of about {n} elements"),
        n * BYTES_AN_ELEMENT,
        &args.work,
        "ask for a larger --size, fewer --elements, or a larger --max-memory",
    )?;
    let mesh = ElementMesh::new(&world, &settings, &radiosa::radiosity::direct::DirectLight::new(&world, &[], 0));
    let (group_of, names) = groups(&world, &mesh, args.by);
    let medium = Medium { absorption: [args.absorption; 3] };
    let factors = Factors::in_medium(&world, &mesh, &estimator(args), medium, args.seed);
    factors_within_memory(&factors, &args.work)?;
    if !args.work.quiet {
        say_warnings(&warnings);
    }
    let prepared = start.elapsed();
    let mut between = Between::new(&factors, &group_of, names.len());
    let raw = between.report();
    if args.correct == Correct::Closure && raw.row_sums[1] < CLOSED {
        let message = format!(
            "rows sum to {:.3} in the mean, so the scene is open: --correct closure makes up factors for what leaves it",
            raw.row_sums[1]
        );
        let open = Warning { name: "open", path: PathBuf::from(&args.scene), message };
        if !args.work.quiet {
            say_warnings(std::slice::from_ref(&open));
        }
        warnings.push(open);
    }
    match args.correct {
        Correct::None => {}
        Correct::Reciprocity => between.correct(Correction::Reciprocity),
        Correct::Closure => between.correct(Correction::Closure),
    }
    let estimated = start.elapsed();
    for output in &outputs {
        matrix::write(&between, &names, output)?;
    }

    let [least, mean, greatest] = raw.row_sums;
    if !args.work.quiet {
        let mut lines = vec![
            format!("surfaces    {} elements of {} patches, {} rows", mesh.elements().len(), mesh.patches().len(), names.len()),
            format!("factors     {} above zero", between.n_entries()),
            format!("closure     raw row sums {least:.6} to {greatest:.6}, mean {mean:.6}"),
            format!("reciprocity {:.1e} of what is exchanged", raw.reciprocity),
        ];
        if args.estimator == Estimator::Analytic {
            let how = if factors.is_clipping() { "cut out" } else { "sampled by rays" };
            lines.push(format!("shadows     {how}"));
        }
        if args.correct != Correct::None {
            let corrected = between.report();
            let [least, _, greatest] = corrected.row_sums;
            let reciprocity = corrected.reciprocity;
            lines.push(format!("corrected   row sums {least:.6} to {greatest:.6}, reciprocity {reciprocity:.1e}"));
        }
        lines.push(format!("time        {:.2} s", start.elapsed().as_secs_f64()));
        lines.extend(outputs.iter().map(|output| format!("wrote       {}", output.display())));
        tell(&lines.join("\n"));
    }
    if json {
        // Rows for a person to look through; the files have them all.
        const LISTED: usize = 1000;
        let rows: Vec<_> = (0..between.n().min(LISTED))
            .map(|i| json!({ "name": names[i], "area": between.areas[i], "row_sum": between.row_sum(i) }))
            .collect();
        let report = json!({
            "scene": world.scene().name,
            "by": format!("{:?}", args.by).to_lowercase(),
            "estimator": format!("{:?}", args.estimator).to_lowercase(),
            "shadows_cut_out": factors.is_clipping(),
            "elements": mesh.elements().len(),
            "patches": mesh.patches().len(),
            "rows": names.len(),
            "factors": between.n_entries(),
            "raw_row_sums": { "least": least, "mean": mean, "greatest": greatest },
            "reciprocity": raw.reciprocity,
            "corrected": args.correct != Correct::None,
            "surfaces": rows,
            "seconds": {
                "prepare": prepared.as_secs_f64(), "estimate": (estimated - prepared).as_secs_f64(),
                "total": start.elapsed().as_secs_f64(),
            },
            "warnings": warnings_json(&warnings),
            "outputs": outputs,
        });
        crate::version::say(&report.to_string());
    }
    Ok(ExitCode::SUCCESS)
}

fn estimator(args: &Args) -> form_factor::Estimator {
    match args.estimator {
        Estimator::Analytic => form_factor::Estimator::Analytic(pair::Settings {
            tolerance: UNOCCLUDED * args.tolerance,
            // A quarter of them first; the rest where some are blocked.
            rays: [args.rays.map_or(16, |n| n.div_ceil(4)), args.rays.unwrap_or(64)].map(|n| n as usize),
            clip: (!args.sampled_shadows).then_some(args.tolerance),
        }),
        Estimator::Hemicube => form_factor::Estimator::Hemicube(hemicube::Settings {
            resolution: args.resolution,
            points: args.points.unwrap_or(hemicube::Settings::default().points),
        }),
        Estimator::Hemisphere => {
            let rays = args.rays.unwrap_or(hemisphere::Settings::default().rays);
            let rule = match args.rule {
                Rule::Cells => hemisphere::Rule::Cells,
                Rule::Nodal => hemisphere::Rule::Nodal,
                Rule::Nusselt => hemisphere::Rule::Nusselt,
                Rule::Random => hemisphere::Rule::Random,
            };
            // Patterns need some directions each.
            let patterned = matches!(args.rule, Rule::Cells | Rule::Nodal);
            let points = args.points.unwrap_or(if patterned { rays.div_ceil(256) } else { rays });
            form_factor::Estimator::Hemisphere(hemisphere::Settings { rule, rays, points })
        }
        Estimator::Area => form_factor::Estimator::Area(area::Settings {
            samples: args.rays.unwrap_or(area::Settings::default().samples),
            spread: area::Samples::Even,
            kernel: if args.kernel == Kernel::Disc { area::Kernel::Disc } else { area::Kernel::Point },
        }),
    }
}

/// The group of each element, and what groups are called.
pub(crate) fn groups(world: &World, mesh: &ElementMesh, by: By) -> (Vec<u32>, Vec<String>) {
    let scene = world.scene();
    if by == By::Patch {
        // The sides of a cell belong together, whichever elements they are.
        let mut first = Vec::new();
        let mut n = 0u32;
        for grid in mesh.grids() {
            first.push(n);
            n += grid.n[0] * grid.n[1];
        }
        let group_of = mesh.elements().iter().map(|e| first[e.patch as usize] + e.cell).collect();
        return (group_of, (0..n).map(|i| i.to_string()).collect());
    }
    let (mut names, mut known): (Vec<String>, HashMap<String, u32>) = Default::default();
    let mut number_of = |name: String| {
        *known.entry(name.clone()).or_insert_with(|| {
            names.push(name);
            names.len() as u32 - 1
        })
    };
    let of_patch: Vec<u32> = mesh
        .patches()
        .iter()
        .map(|patch| {
            let instance = &scene.instances[patch.instance.index()];
            let node = instance.node.map(|node| scene.nodes[node.index()].name.as_str()).filter(|name| !name.is_empty());
            number_of(match by {
                By::Material => patch.material.map_or("default", |m| &scene.materials[m.index()].name).to_owned(),
                _ if !instance.name.is_empty() => instance.name.clone(),
                _ => node.map_or_else(|| format!("instance {}", patch.instance.index()), str::to_owned),
            })
        })
        .collect();
    (mesh.elements().iter().map(|e| of_patch[e.patch as usize]).collect(), names)
}
