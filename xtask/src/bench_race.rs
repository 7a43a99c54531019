//! `cargo xtask bench race [--turns N]`: the Cornell box by `radiosa render --method hybrid` beside POV-Ray 3.7 with radiosity: processor and wall seconds of whole
//! processes at two threads, interleaved, medians; and how far each picture is from the reference (`crates/radiosa/examples/picture_error.rs`).

use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, bail};
use serde_json::Value;

use crate::bench_whitted::{Cost, median};

/// Options of the hybrid: a quick picture, the default, as it is and at four samples, and one that took its time.
const OURS: [(&str, &[&str]); 4] = [
    ("hybrid, quick", &["--spp", "1", "--elements", "500", "--cache", "0.8", "--gather", "128"]),
    ("hybrid", &["--spp", "1"]),
    ("hybrid, 4 samples", &["--spp", "4"]),
    ("hybrid, fine", &["--spp", "1", "--cache", "0.1", "--elements", "4000"]),
];
/// Count, error bound and lamps along a side of the luminaire.
const THEIRS: [(&str, [&str; 3]); 2] = [("POV-Ray, quick", ["100", "0.5", "4"]), ("POV-Ray, fine", ["600", "0.4", "9"])];

/// Runs both and prints the table.
pub(crate) fn run(args: &[String]) -> Result<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().context("xtask lies in the workspace")?;
    let turns = args.iter().position(|a| a == "--turns").and_then(|i| args.get(i + 1)).map_or("3", String::as_str);
    let turns: usize = turns.parse().context("--turns wants a number")?;
    if Command::new("povray").arg("--version").output().is_err() {
        bail!("this compares with POV-Ray 3.7, which is not installed; on Debian: apt-get install povray");
    }
    crate::run(crate::cargo().current_dir(root).args(["build", "--release", "--quiet", "--package", "radiosa-cli"]))?;
    let example = ["build", "--release", "--quiet", "--package", "radiosa", "--example", "picture_error"];
    crate::run(crate::cargo().current_dir(root).args(example))?;
    let pictures = root.join("target/bench-race");
    std::fs::create_dir_all(&pictures).context("cannot make a folder for the pictures")?;
    let file = |k: usize, ending: &str| pictures.join(format!("{k}.{ending}"));
    let mut commands: Vec<(&str, Command)> = Vec::new();
    for (k, (name, options)) in OURS.into_iter().enumerate() {
        let mut command = Command::new(root.join("target/release/radiosa"));
        command.args([
            "render",
            "cornell-box",
            "--method",
            "hybrid",
            "--size",
            "512x512",
            "--threads",
            "2",
            "--layers",
            "none",
            "-q",
        ]);
        command.args(options).arg("-o").arg(file(k, "exr"));
        commands.push((name, command));
    }
    for (k, (name, settings)) in (OURS.len()..).zip(THEIRS) {
        let mut write = Command::new("python3");
        write.arg(root.join("benches/race/cornell-box.py")).arg(file(k, "pov")).args(settings);
        if !write.status().context("cannot start python3")?.success() {
            bail!("the scene for POV-Ray cannot be written");
        }
        let mut command = Command::new("povray");
        command.arg(format!("+I{}", file(k, "pov").display())).arg(format!("+O{}", file(k, "exr").display()));
        command.args(["+FE", "+W512", "+H512", "-A", "-D", "+WT2"]);
        commands.push((name, command));
    }
    let mut costs: Vec<Vec<Cost>> = commands.iter().map(|_| Vec::new()).collect();
    for _ in 0..turns.max(1) {
        for ((_, command), costs) in commands.iter_mut().zip(&mut costs) {
            costs.push(Cost::of(command)?);
        }
    }
    let data = root.join("crates/radiosa-testkit/data/cornell-box");
    let mut measure = Command::new(root.join("target/release/examples/picture_error"));
    // (The reference's own noise stands in its README.)
    measure.arg(data.join("reference.exr")).arg(data.join("mask.png")).arg("2.1e-5");
    measure.args((0..commands.len()).map(|k| file(k, "exr")));
    let output = measure.output().context("cannot start picture_error")?;
    if !output.status.success() {
        bail!("{}", String::from_utf8_lossy(&output.stderr));
    }
    println!(
        "Cornell box 512x512, two threads, medians of {turns}: processor and wall seconds, relMSE, errors of the means of R, G, B, the worst"
    );
    println!("16x16 tile and the share of tiles beyond 1 %");
    let errors = String::from_utf8(output.stdout)?;
    for (((name, _), costs), line) in commands.iter().zip(&costs).zip(errors.lines()) {
        let error: Value = serde_json::from_str(line)?;
        let number = |v: &Value| v.as_f64().unwrap_or(f64::NAN);
        let means: Vec<String> = (0..3).map(|c| format!("{:+.2}", 100.0 * number(&error["means"][c]))).collect();
        println!(
            "{name:17} {:6.2} {:6.2}   {:.1e}   {} %   {:5.1} %   {:5.1} %",
            median(costs.iter().map(|c| c.processor)),
            median(costs.iter().map(|c| c.wall)),
            number(&error["relmse"]),
            means.join(" "),
            100.0 * number(&error["worst_tile"]),
            100.0 * number(&error["tiles_beyond"]) / number(&error["tiles"]),
        );
    }
    println!("pictures in {}", pictures.display());
    Ok(())
}
