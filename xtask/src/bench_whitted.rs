//! `cargo xtask bench whitted [--turns N] [--size WxH]`: processor time of `radiosa render --method whitted` beside POV-Ray 3.7, on the scenes of `benches/povray`,
//! each written for both. Two threads each, whole processes, interleaved, medians; the pictures are left in a folder to be looked at.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};

const SCENES: [&str; 3] = ["spheres", "mirrors", "glass"];

/// Runs both on every scene and prints the ratios.
pub(crate) fn run(args: &[String]) -> Result<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().context("xtask lies in the workspace")?;
    let value = |name: &str, default: &str| {
        args.iter().position(|a| a == name).and_then(|i| args.get(i + 1)).cloned().unwrap_or_else(|| default.to_owned())
    };
    let turns: usize = value("--turns", "5").parse().context("--turns wants a number")?;
    let size = value("--size", "1600x1200");
    let (width, height) = size.split_once('x').context("--size wants WIDTHxHEIGHT")?;
    if Command::new("povray").arg("--version").output().is_err() {
        bail!("this compares with POV-Ray 3.7, which is not installed; on Debian: apt-get install povray");
    }
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let built =
        Command::new(cargo).current_dir(root).args(["build", "--release", "--quiet", "--package", "radiosa-cli"]).status()?;
    if !built.success() {
        bail!("the command cannot be built");
    }
    let pictures: PathBuf = root.join("target/bench-whitted");
    std::fs::create_dir_all(&pictures).context("cannot make a folder for the pictures")?;
    println!(
        "{size}, one sample a pixel, two threads, medians of {turns}: seconds of processor time, ours / POV-Ray's, and the ratio"
    );
    for scene in SCENES {
        let file = |ending: &str| root.join(format!("benches/povray/{scene}.{ending}"));
        let picture = |whose: &str| pictures.join(format!("{scene}-{whose}.png"));
        let ours = || {
            let mut command = Command::new(root.join("target/release/radiosa"));
            command.arg("render").arg(file("toml")).args(["--method", "whitted", "--spp", "1", "--threads", "2", "--quiet"]);
            command.args(["--size", &size, "--output"]).arg(picture("radiosa"));
            command
        };
        let theirs = || {
            let mut command = Command::new("povray");
            command.arg(format!("+I{}", file("pov").display())).arg(format!("+O{}", picture("povray").display()));
            command.args([&format!("+W{width}"), &format!("+H{height}"), "-A", "-D", "+WT2", "File_Gamma=srgb"]);
            command
        };
        let (mut a, mut b) = (Vec::new(), Vec::new());
        for _ in 0..turns.max(1) {
            a.push(processor_time(&mut ours())?);
            b.push(processor_time(&mut theirs())?);
        }
        let (a, b) = (median(a), median(b));
        println!("{scene:10} {a:6.2} {b:6.2}   {:.2}", a / b);
    }
    println!("pictures in {}", pictures.display());
    Ok(())
}

/// Seconds of processor time, user and system, a command took, whole.
fn processor_time(command: &mut Command) -> Result<f64> {
    let before = children_time()?;
    let output = command.output().with_context(|| format!("cannot start {command:?}"))?;
    if !output.status.success() {
        bail!("{command:?}: {}", String::from_utf8_lossy(&output.stderr));
    }
    Ok(children_time()? - before)
}

/// User and system time of the children that have ended: fields 16 and 17 of `/proc/self/stat`, in hundredths of a second.
fn children_time() -> Result<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat").context("this needs Linux's /proc")?;
    let after_name = stat.rsplit(')').next().unwrap_or_default();
    let fields: Vec<f64> = after_name.split_whitespace().skip(13).take(2).filter_map(|f| f.parse().ok()).collect();
    Ok(fields.iter().sum::<f64>() / 100.0)
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}
