//! `cargo xtask …`: the chores of the project.

mod bench_factors;
mod bench_race;
mod bench_rays;
mod bench_rooms;
mod bench_scanline;
mod bench_whitted;
mod bench_ztest;
mod race_room;

use std::process::{Command, ExitCode};

use anyhow::{Context, Result, bail};

const HELP: &str = "\
cargo xtask test [FILTER…]   install what tests need, then run every test
cargo xtask bench rays       ray queries beside Embree (Debian's libembree-dev)
cargo xtask bench factors    form factors beside pyviewfactor (from PyPI, into target/)
cargo xtask bench scanline   scan line beside software OpenGL (Debian's libegl1, libgl1-mesa-dri)
cargo xtask bench rooms      measured rooms beside Mitsuba 3 (from PyPI; Debian's libllvm19)
cargo xtask bench race [ROOM…]   the hybrid beside POV-Ray with radiosity (Debian's povray) and Mitsuba 3 (from PyPI; Debian's libllvm19)
cargo xtask bench race-path [PROGRAM…] [SCENE…]   path tracing beside Mitsuba 3, Cycles and LuxCore: what the same error takes (from PyPI, with scipy; Debian's libllvm19)
cargo xtask bench whitted    Whitted ray tracing beside POV-Ray (Debian's povray)
cargo xtask bench ztest [SCENE…]   path tracing beside Mitsuba 3, pixel by pixel (from PyPI, with scipy; Debian's libllvm19)
cargo xtask bench shadow [SIZE…]   errors with and without discontinuity meshing, against a closed form; elements of these sizes in metres
cargo xtask figure convergence [SCENE] [OUTPUT.svg] [ELEMENTS]   how the radiosity solvers converge over work and time
cargo xtask figure links [OUTPUT.svg] [MOST]   links and time of hierarchical radiosity against elements, up to MOST of them
cargo xtask pictures         render the pictures of the README and the book again
";

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = args.iter().map(String::as_str).collect();
    let done = match words.as_slice() {
        ["test", rest @ ..] => test(rest),
        ["bench", "rays", ..] => bench_rays::run(&args[2..]),
        ["bench", "factors", ..] => bench_factors::run(&args[2..]),
        ["bench", "rooms", ..] => bench_rooms::run(&args[2..]),
        ["bench", "scanline", ..] => bench_scanline::run(&args[2..]),
        ["bench", "race-path", ..] => bench_ztest::race(&args[2..]),
        ["bench", "race", ..] => bench_race::run(&args[2..]),
        ["bench", "whitted", ..] => bench_whitted::run(&args[2..]),
        ["bench", "ztest", ..] => bench_ztest::run(&args[2..]),
        ["bench", "shadow", rest @ ..] => example("shadow", rest),
        ["figure", "convergence", rest @ ..] => example("convergence", rest),
        ["figure", "links", rest @ ..] => example("links", rest),
        ["pictures"] => pictures(),
        _ => {
            say(HELP);
            return ExitCode::from(u8::from(!words.is_empty()) * 2);
        }
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            warn(&format!("error: {error:#}"));
            ExitCode::FAILURE
        }
    }
}

fn say(text: &str) {
    println!("{text}");
}

fn warn(text: &str) {
    eprintln!("{text}");
}

/// Runs a command to its end; anything but success is an error.
fn run(command: &mut Command) -> Result<()> {
    let status = command.status().with_context(|| format!("cannot start {command:?}"))?;
    if status.success() { Ok(()) } else { bail!("{command:?} ended with {status}") }
}

fn cargo() -> Command {
    Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
}

/// All tests, in the one optimised profile.
fn test(filter: &[&str]) -> Result<()> {
    install_page_tools();
    run(cargo().args(["test", "--release", "--workspace"]).args(filter))
}

/// Pages are tested in Debian's Chromium. No page exists yet that needs it, so failing to install it is no failure.
fn install_page_tools() {
    let missing: Vec<&str> = [("chromium", "chromium"), ("node", "nodejs")]
        .into_iter()
        .filter(|(program, _)| Command::new(program).arg("--version").output().is_err())
        .map(|(_, package)| package)
        .collect();
    if missing.is_empty() {
        return;
    }
    let quietly = |args: &[&str]| {
        Command::new("apt-get").args(args).env("DEBIAN_FRONTEND", "noninteractive").output().is_ok_and(|o| o.status.success())
    };
    let install = [&["install", "-y", "--no-install-recommends"], missing.as_slice()].concat();
    if !(quietly(&["update"]) && quietly(&install)) {
        warn(&format!("note: could not install {} (needed by page tests only; none yet)", missing.join(", ")));
    }
}

/// Runs an example of the library, which measures or draws something.
fn example(name: &str, rest: &[&str]) -> Result<()> {
    run(cargo().args(["run", "--release", "--quiet", "--package", "radiosa", "--example", name, "--"]).args(rest))
}

/// The pictures of the README and the book: each made again by the command beside it.
fn pictures() -> Result<()> {
    let shadow =
        ["shadow", "--method", "radiosity", "--refine", "0", "--elements", "600", "--discontinuities", "1", "--size", "480x340"];
    let pictures: [(&str, &[&str]); 9] = [
        ("docs/pictures/cornell-box.png", &["cornell-box", "--size", "480x480"]),
        ("docs/pictures/room.png", &["room", "--size", "480x360"]),
        ("docs/pictures/whitted.png", &["whitted", "--size", "480x360"]),
        ("docs/pictures/phong-spheres.png", &["phong-spheres", "--size", "480x360"]),
        ("docs/pictures/light-types.png", &["light-types", "--size", "480x360"]),
        ("docs/pictures/parallel-plates.png", &["parallel-plates", "--size", "480x240"]),
        ("docs/pictures/shadow.png", &shadow),
        ("docs/pictures/shadow-mesh.png", &[&shadow[..], &["--overlay", "mesh"]].concat()),
        (
            "docs/pictures/hierarchical-links.png",
            &[
                "cornell-box",
                "--method",
                "radiosity",
                "--solver",
                "hierarchical",
                "--refine",
                "0",
                "--elements",
                "1000",
                "--size",
                "400x400",
                "--overlay",
                "mesh,links",
                "--links-of",
                "231,238",
            ],
        ),
    ];
    for (path, args) in pictures {
        say(path);
        run(cargo().args(["run", "--release", "--quiet", "--", "render"]).args(args).args(["--quiet", "--output", path]))?;
    }
    // The figures at sizes that keep each file below 120 kB.
    let figures = [
        ("diffuse-ambient", "160x160"),
        ("specular-exponent", "160x160"),
        ("components", "160x160"),
        ("phong-cook-torrance", "140x140"),
        ("light-types", "140x140"),
        ("methods", "280x210"),
        ("interpolation", "160x160"),
    ];
    for (figure, size) in figures {
        let path = format!("docs/pictures/sheet-{figure}.png");
        say(&path);
        let args =
            ["run", "--release", "--quiet", "--", "sheet", "--figure", figure, "--size", size, "--quiet", "--output", &path];
        run(cargo().args(args))?;
    }
    Ok(())
}
