//! `cargo xtask bench race [--turns N] [ROOM…]`: rooms of matt surfaces by `radiosa render --method hybrid` beside POV-Ray 3.7 with radiosity and Mitsuba 3.9.1: processor
//! and wall seconds of whole processes at two threads, interleaved, medians; and how far each picture is from a reference (`crates/radiosa/examples/picture_error.rs`).
//! `race_room.rs` makes the rooms.

use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, bail};
use serde_json::Value;

use crate::bench_whitted::{Cost, median};
use crate::race_room::{Prepared, ROOMS, Room};

/// The errors at which programs are compared.
const TARGETS: [f64; 2] = [1e-3, 1.8e-4];
/// Options of the hybrid: three quick pictures, one with more samples where neighbouring pixels differ, the default, as it is and at four samples, and one that took its time.
const OURS: [(&str, &[&str]); 7] = [
    ("hybrid, quickest", &["--spp", "1", "--elements", "500", "--cache", "0.8", "--gather", "32", "--samples", "1"]),
    ("hybrid, quick", &["--spp", "1", "--elements", "500", "--cache", "0.8", "--gather", "128"]),
    ("hybrid, quick, 4", &["--spp", "4", "--elements", "500", "--cache", "0.8", "--gather", "32", "--samples", "1"]),
    (
        "hybrid, at edges",
        &[
            "--adaptive",
            "0.6",
            "--adaptive-level",
            "2",
            "--elements",
            "2000",
            "--cache",
            "0.8",
            "--gather",
            "64",
            "--samples",
            "1",
        ],
    ),
    ("hybrid", &["--spp", "1"]),
    ("hybrid, 4 samples", &["--spp", "4"]),
    ("hybrid, fine", &["--spp", "1", "--elements", "16000", "--cache", "0.15", "--gather", "512"]),
];

/// Runs all programs on each room and prints the tables.
pub(crate) fn run(args: &[String]) -> Result<()> {
    let (mut turns, mut names) = (3, Vec::new());
    let mut args = args.iter();
    while let Some(arg) = args.next() {
        match arg.as_str() {
            "--turns" => turns = args.next().and_then(|n| n.parse().ok()).context("--turns wants a number")?,
            name => names.push(name),
        }
    }
    if let Some(name) = names.iter().find(|name| ROOMS.iter().all(|room| room.name != **name)) {
        bail!("there is no room {name:?}: {}", ROOMS.map(|room| room.name).join(", "));
    }
    if Command::new("povray").arg("--version").output().is_err() {
        bail!("this compares with POV-Ray 3.7, which is not installed; on Debian: apt-get install povray");
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().context("xtask lies in the workspace")?;
    crate::run(crate::cargo().current_dir(root).args(["build", "--release", "--quiet", "--package", "radiosa-cli"]))?;
    let examples = ["--example", "picture_error", "--example", "diffuse_room"];
    crate::run(crate::cargo().current_dir(root).args(["build", "--release", "--quiet", "--package", "radiosa"]).args(examples))?;
    for room in ROOMS.iter().filter(|room| names.is_empty() || names.contains(&room.name)) {
        race(&Prepared::new(root, room)?, turns)?;
    }
    Ok(())
}

/// A way to draw a room.
struct Row {
    name: String,
    command: Command,
    /// Samples a pixel of a program whose error falls with their number.
    samples: Option<u32>,
}

/// What a row took, and how far its picture is from the reference.
struct Outcome {
    processor: f64,
    wall: f64,
    error: Value,
}

impl Outcome {
    fn number(&self, key: &str) -> f64 {
        self.error[key].as_f64().unwrap_or(f64::NAN)
    }
}

fn race(room: &Prepared, turns: usize) -> Result<()> {
    let mut rows = rows(room)?;
    let mut costs: Vec<Vec<Cost>> = rows.iter().map(|_| Vec::new()).collect();
    for _ in 0..turns.max(1) {
        for (row, costs) in rows.iter_mut().zip(&mut costs) {
            costs.push(Cost::of(&mut row.command)?);
        }
    }
    let errors = room.errors(rows.len())?;
    let outcomes = costs.iter().zip(errors).map(|(costs, error)| Outcome {
        processor: median(costs.iter().map(|c| c.processor)),
        wall: median(costs.iter().map(|c| c.wall)),
        error,
    });
    print(room.room, turns, &rows, &outcomes.collect::<Vec<_>>());
    println!("pictures in {}\n", room.folder.display());
    Ok(())
}

fn rows(room: &Prepared) -> Result<Vec<Row>> {
    let mut rows = Vec::new();
    for (name, options) in OURS {
        let command = room.hybrid(options, &room.picture(rows.len()));
        rows.push(Row { name: name.to_owned(), command, samples: None });
    }
    let further = room.further_view(&["--spp", "1"], &room.picture(rows.len()))?;
    rows.push(Row { name: "further view".to_owned(), command: further, samples: None });
    for (name, settings) in ["POV-Ray, quick", "POV-Ray, fine"].into_iter().zip(room.room.povray) {
        let command = room.povray(settings, &room.picture(rows.len()))?;
        rows.push(Row { name: name.to_owned(), command, samples: None });
    }
    for samples in room.room.samples {
        let command = room.paths(samples, &room.picture(rows.len()));
        rows.push(Row { name: format!("Mitsuba, {samples}"), command, samples: Some(samples) });
    }
    Ok(rows)
}

fn print(room: &Room, turns: usize, rows: &[Row], outcomes: &[Outcome]) {
    println!(
        "{} {}, two threads, medians of {turns}: processor and wall seconds, relMSE, errors of the means of R, G, B, the worst 16x16",
        room.name, room.size
    );
    println!("tile and the share of tiles beyond 1 %");
    for (row, outcome) in rows.iter().zip(outcomes) {
        let means: Vec<String> =
            (0..3).filter_map(|c| outcome.error["means"][c].as_f64()).map(|v| format!("{:+.2}", 100.0 * v)).collect();
        println!(
            "{:17} {:7.2} {:7.2}   {:.1e}   {} %   {:5.1} %   {:5.1} %",
            row.name,
            outcome.processor,
            outcome.wall,
            outcome.number("relmse"),
            means.join(" "),
            100.0 * outcome.number("worst_tile"),
            100.0 * outcome.number("tiles_beyond") / outcome.number("tiles"),
        );
    }
    for target in TARGETS {
        println!("processor seconds to a relMSE of {target:e}: {}", at_target(target, rows, outcomes).join("; "));
    }
}

/// What each program takes for a target: the cheapest row that reaches it; for paths, whose error is inverse to their number, a line through two numbers of samples.
fn at_target(target: f64, rows: &[Row], outcomes: &[Outcome]) -> Vec<String> {
    let cheapest = |start: &str| {
        let all =
            rows.iter().zip(outcomes).filter(|(row, outcome)| row.name.starts_with(start) && outcome.number("relmse") <= target);
        let least = all.map(|(_, outcome)| outcome.processor).fold(f64::INFINITY, f64::min);
        if least.is_finite() { format!("{start} at most {least:.1}") } else { format!("{start} not reached") }
    };
    let paths: Vec<(f64, &Outcome)> =
        rows.iter().zip(outcomes).filter_map(|(row, outcome)| Some((f64::from(row.samples?), outcome))).collect();
    let mut said = vec![cheapest("hybrid"), cheapest("POV-Ray")];
    if let [(few, a), (many, b)] = paths[..] {
        let a_sample = (b.processor - a.processor) / (many - few);
        let wanted = many * b.number("relmse") / target;
        said.push(format!("Mitsuba {:.0} by extrapolation", a.processor + a_sample * (wanted - few)));
    }
    said
}
