//! `radiosa render --method path` beside Mitsuba 3.9.1 on the scenes of `benches/mitsuba`, each made for both from one scene file:
//! `cargo xtask bench ztest [SCENE…]` compares their pictures pixel by pixel (`ztest.py` says what has to hold), `cargo xtask bench race-path [--seconds N] [--turns N]
//! [PROGRAM…] [SCENE…]` what they, Cycles and LuxCore take for the same error (`race.py`).

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result};

/// Compares pictures.
pub(crate) fn run(scenes: &[String]) -> Result<()> {
    let Prepared { folder, radiosa, scripts } = Prepared::new()?;
    crate::run(python(&scripts, "ztest.py").arg(radiosa).arg(folder).args(scenes))
}

/// Compares what the same error takes.
pub(crate) fn race(args: &[String]) -> Result<()> {
    let (mut settings, mut names) = ([("--seconds", "10".to_owned()), ("--turns", "4".to_owned())], Vec::new());
    let mut args = args.iter();
    while let Some(arg) = args.next() {
        match settings.iter_mut().find(|(name, _)| name == arg) {
            Some((_, value)) => args.next().with_context(|| format!("{arg} wants a number"))?.clone_into(value),
            None => names.push(arg),
        }
    }
    let Prepared { folder, radiosa, scripts } = Prepared::new()?;
    crate::run(python(&scripts, "race.py").arg(radiosa).arg(folder).args(settings.map(|(_, value)| value)).args(names))
}

/// The command, and the scenes with what they refer to.
struct Prepared {
    folder: PathBuf,
    radiosa: PathBuf,
    scripts: PathBuf,
}

impl Prepared {
    fn new() -> Result<Self> {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().context("xtask lies in the workspace")?;
        let (folder, scripts) = (root.join("target/bench-mitsuba"), root.join("benches/mitsuba"));
        std::fs::create_dir_all(&folder)?;
        crate::run(crate::cargo().current_dir(root).args(["build", "--release", "--quiet", "--package", "radiosa-cli"]))?;
        crate::run(python(&scripts, "make.py").arg(&folder))?;
        Ok(Self { folder, radiosa: root.join("target/release/radiosa"), scripts })
    }
}

fn python(scripts: &Path, name: &str) -> Command {
    let mut command = Command::new("python3");
    command.arg(scripts.join(name));
    command
}
