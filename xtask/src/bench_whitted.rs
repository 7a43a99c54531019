//! `cargo xtask bench whitted [--turns N] [--size WxH]`: processor time of `radiosa render --method whitted` beside POV-Ray 3.7, on the scenes of `benches/povray`,
//! each written for both. Two threads each, whole processes, interleaved, medians. Ours, theirs and four times the difference are left side by
//! side in a folder to be looked at; `benches/povray/README.md` explains what differs.

use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

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
    crate::run(crate::cargo().current_dir(root).args(["build", "--release", "--quiet", "--package", "radiosa-cli"]))?;
    let pictures: PathBuf = root.join("target/bench-whitted");
    std::fs::create_dir_all(&pictures).context("cannot make a folder for the pictures")?;
    println!(
        "{size}, one sample a pixel, two threads, medians of {turns}: seconds, ours, POV-Ray's and the ratio; pixels within 2/255; mean difference"
    );
    println!("scene         processor            wall                 POV-Ray's tracing   within   mean/255");
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
            a.push(Cost::of(&mut ours())?);
            b.push(Cost::of(&mut theirs())?);
        }
        let medians = |cost: fn(&Cost) -> f64| (median(a.iter().map(cost)), median(b.iter().map(cost)));
        let ((ours_cpu, theirs_cpu), (ours_wall, theirs_wall)) = (medians(|c| c.processor), medians(|c| c.wall));
        let tracing = median(b.iter().filter_map(|c| c.tracing));
        let (within, mean) = compare(&picture("radiosa"), &picture("povray"), &picture("beside"))?;
        let (cpu, wall) = (ours_cpu / theirs_cpu, ours_wall / theirs_wall);
        println!(
            "{scene:10} {ours_cpu:6.2} {theirs_cpu:6.2} {cpu:5.2}  {ours_wall:6.2} {theirs_wall:6.2} {wall:5.2}  {tracing:17.2}  {:6.2} %  {mean:8.3}",
            within * 100.0
        );
    }
    println!("pictures in {}", pictures.display());
    Ok(())
}

/// What a command took, whole, in seconds.
pub(crate) struct Cost {
    /// User and system time.
    pub(crate) processor: f64,
    pub(crate) wall: f64,
    /// What POV-Ray says it spent between parsing and writing.
    tracing: Option<f64>,
}

impl Cost {
    pub(crate) fn of(command: &mut Command) -> Result<Self> {
        let (before, start) = (children_time()?, Instant::now());
        let output = command.output().with_context(|| format!("cannot start {command:?}"))?;
        let (processor, wall) = (children_time()? - before, start.elapsed().as_secs_f64());
        let said = String::from_utf8_lossy(&output.stderr);
        if !output.status.success() {
            bail!("{command:?}: {said}");
        }
        // "Trace Time: 0 hours 0 minutes 0 seconds (0.119 seconds)"
        let line = said.lines().find(|line| line.contains("Trace Time:"));
        let tracing = line.and_then(|line| line.split('(').nth(1)?.split(' ').next()?.parse().ok());
        Ok(Self { processor, wall, tracing })
    }
}

/// User and system time of the children that have ended: fields 16 and 17 of `/proc/self/stat`, in hundredths of a second.
fn children_time() -> Result<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat").context("this needs Linux's /proc")?;
    let after_name = stat.rsplit(')').next().unwrap_or_default();
    let fields: Vec<f64> = after_name.split_whitespace().skip(13).take(2).filter_map(|f| f.parse().ok()).collect();
    Ok(fields.iter().sum::<f64>() / 100.0)
}

pub(crate) fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// The share of pixels that differ by 2/255 at most in every channel, and the mean difference in 255ths, of two 8-bit sRGB pictures. Writes
/// both and four times their difference side by side.
fn compare(ours: &Path, theirs: &Path, beside: &Path) -> Result<(f64, f64)> {
    let ((a, width), (b, other_width)) = (pixels(ours)?, pixels(theirs)?);
    if width != other_width || a.len() != b.len() || a.is_empty() {
        bail!("{} and {} are not of one size", ours.display(), theirs.display());
    }
    let difference: Vec<[u8; 3]> =
        a.iter().zip(&b).map(|(a, b)| std::array::from_fn(|channel| a[channel].abs_diff(b[channel]))).collect();
    let near = difference.iter().filter(|d| d.iter().all(|&channel| channel <= 2)).count();
    let sum: u64 = difference.iter().flatten().map(|&channel| u64::from(channel)).sum();
    let shown: Vec<[u8; 3]> = difference.iter().map(|d| d.map(|channel| channel.saturating_mul(4))).collect();
    let rows = a.chunks(width).zip(b.chunks(width)).zip(shown.chunks(width));
    let bytes: Vec<u8> = rows.flat_map(|((a, b), d)| [a, b, d].concat()).flatten().collect();
    let file = std::fs::File::create(beside).with_context(|| format!("cannot write {}", beside.display()))?;
    let mut encoder = png::Encoder::new(file, u32::try_from(3 * width)?, u32::try_from(a.len() / width)?);
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header()?.write_image_data(&bytes)?;
    Ok((near as f64 / a.len() as f64, sum as f64 / (3 * a.len()) as f64))
}

/// The colours of a PNG, row by row, and its width.
fn pixels(path: &Path) -> Result<(Vec<[u8; 3]>, usize)> {
    let file = std::fs::File::open(path).with_context(|| format!("cannot read {}", path.display()))?;
    let mut reader = png::Decoder::new(BufReader::new(file)).read_info()?;
    let mut bytes = vec![0; reader.output_buffer_size().context("the picture is too large")?];
    let frame = reader.next_frame(&mut bytes)?;
    let channels = frame.color_type.samples();
    if frame.bit_depth != png::BitDepth::Eight || channels < 3 {
        bail!("{} is no 8-bit picture in colour", path.display());
    }
    bytes.truncate(frame.buffer_size());
    Ok((bytes.chunks_exact(channels).map(|c| [c[0], c[1], c[2]]).collect(), frame.width as usize))
}
