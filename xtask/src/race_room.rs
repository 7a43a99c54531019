//! The rooms of `bench race`: made matt by `crates/radiosa/examples/diffuse_room.rs`, and written for each program; references and masks are made once and
//! kept in `target/bench-race`.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};
use serde_json::Value;

/// A room, and how it is drawn.
pub(crate) struct Room {
    pub(crate) name: &'static str,
    /// From the project's folder.
    scene: &'static str,
    /// Where the eye is for another view, some steps aside.
    aside: &'static str,
    /// Multiplies its light: POV-Ray's thresholds want a mean luminance of about 0.2.
    light: &'static str,
    /// Replaced in the scene.
    changes: &'static [&'static str],
    pub(crate) size: &'static str,
    /// Samples a pixel of Mitsuba.
    pub(crate) samples: [u32; 2],
    /// Count, error bound and lamps along a side of a luminaire, quick and fine.
    pub(crate) povray: [[&'static str; 3]; 2],
    /// POV-Ray's antialiasing, for hard shadows.
    antialiasing: &'static [&'static str],
}

/// Up to 16 samples where pixels differ by more than 0.1.
const AT_EDGES: [&str; 4] = ["+A0.1", "+AM2", "+R2", "-J"];

/// What rooms have in common.
const ROOM: Room = Room {
    name: "",
    scene: "",
    aside: "",
    light: "1",
    changes: &[],
    size: "320x240",
    samples: [64, 256],
    povray: [["50", "0.6", "4"], ["200", "0.4", "4"]],
    antialiasing: &AT_EDGES,
};

pub(crate) const ROOMS: [Room; 4] = [
    Room {
        name: "cornell-box",
        scene: "scenes/cornell-box.toml",
        aside: "0.08,0.273,-0.8",
        size: "512x512",
        samples: [32, 128],
        povray: [["100", "0.5", "4"], ["600", "0.4", "9"]],
        antialiasing: &["-A"],
        ..ROOM
    },
    Room {
        name: "room",
        scene: "scenes/room.toml",
        aside: "4.65,1.55,3.87",
        light: "0.002",
        // (Sides of a cone are no parallelograms.)
        changes: &["shape.\"lamp shade\".cone.top_radius=0.22"],
        antialiasing: &["-A"],
        ..ROOM
    },
    Room { name: "living-room", scene: "scenes/rooms/living-room.toml", aside: "2.51,2.45,-1.93", light: "0.002", ..ROOM },
    Room { name: "small-house", scene: "benches/race/small-house.toml", aside: "-1.66,1.6,-0.88", light: "0.1", ..ROOM },
];

/// The noise that references may have, relMSE.
const NOISE: f64 = 5e-5;

/// A room with all files that the programs want.
pub(crate) struct Prepared<'a> {
    pub(crate) room: &'a Room,
    pub(crate) folder: PathBuf,
    root: &'a Path,
    reference: PathBuf,
    mask: PathBuf,
    noise: f64,
}

impl<'a> Prepared<'a> {
    pub(crate) fn new(root: &'a Path, room: &'a Room) -> Result<Self> {
        let folder = root.join("target/bench-race").join(room.name);
        fs::create_dir_all(&folder).context("cannot make a folder for the pictures")?;
        let plain = folder.join("room.toml");
        let mut convert = Command::new(root.join("target/release/examples/diffuse_room"));
        crate::run(convert.arg(root.join(room.scene)).arg(&plain).arg(room.light).args(room.changes))?;
        crate::run(python(root, "paths.py").arg("prepare").arg(plain).arg(folder.join("room.json")))?;
        let (reference, mask) = (folder.join("reference.exr"), folder.join("mask.png"));
        let mut prepared = Self { room, folder, root, reference, mask, noise: 0.0 };
        prepared.refer()?;
        Ok(prepared)
    }

    /// Finds the reference and the mask, or makes them.
    fn refer(&mut self) -> Result<()> {
        if self.room.name == "cornell-box" {
            let data = self.root.join("crates/radiosa-testkit/data/cornell-box");
            (self.reference, self.mask) = (data.join("reference.exr"), data.join("mask.png"));
            // (It stands in their README.)
            self.noise = 2.1e-5;
            return Ok(());
        }
        let kept = self.folder.join("noise.txt");
        if !kept.exists() {
            println!("{}: making the reference, which takes a while", self.room.name);
            let ask = |what: &str, room: &str| {
                let mut command = python(self.root, "paths.py");
                command.arg(what).arg(self.folder.join(room)).arg(self.room.size);
                command
            };
            crate::run(ask("mask", "room.json").arg(&self.mask))?;
            let mut draw = ask("reference", "room.toml");
            draw.arg(NOISE.to_string()).args([&self.mask, &self.reference]).arg(self.root.join("target/release/radiosa"));
            let said = said(&mut draw)?;
            let noise = said.lines().last().context("the reference's noise is not known")?;
            fs::write(&kept, noise)?;
        }
        self.noise = fs::read_to_string(&kept)?.trim().parse().with_context(|| format!("{} holds no number", kept.display()))?;
        Ok(())
    }

    /// Where picture `k` goes.
    pub(crate) fn picture(&self, k: usize) -> PathBuf {
        self.folder.join(format!("{k}.exr"))
    }

    pub(crate) fn hybrid(&self, options: &[&str], picture: &Path) -> Command {
        let mut command = Command::new(self.root.join("target/release/radiosa"));
        command.arg("render").arg(self.folder.join("room.toml")).args(["--method", "hybrid", "--size", self.room.size]);
        command.args(["--threads", "2", "--layers", "none", "-q"]).args(options).arg("-o").arg(picture);
        command
    }

    /// The same view once more from what another one has gathered, which is seen from a few steps aside.
    pub(crate) fn further_view(&self, options: &[&str], picture: &Path) -> Result<Command> {
        let [before, kept] = ["before", "kept"].map(|name| self.folder.join(name).with_extension("gathers"));
        if before.exists() {
            fs::remove_file(&before)?;
        }
        let mut aside = self.hybrid(options, &self.folder.join("aside.exr"));
        crate::run(aside.arg("--set").arg(format!("camera.main.position=[{}]", self.room.aside)).arg("--gathers").arg(&before))?;
        // (Each view adds its gathers to the file.)
        let mut command = Command::new("sh");
        command.args(["-c", "cp \"$1\" \"$2\" && shift 2 && exec \"$@\"", "sh"]).args([&before, &kept]);
        let drawing = self.hybrid(options, picture);
        command.arg(drawing.get_program()).args(drawing.get_args()).arg("--gathers").arg(&kept);
        Ok(command)
    }

    /// Writes the scene for POV-Ray as well.
    pub(crate) fn povray(&self, settings: [&str; 3], picture: &Path) -> Result<Command> {
        let (width, height) = self.room.size.split_once('x').context("a size is WIDTHxHEIGHT")?;
        let aspect = width.parse::<f64>()? / height.parse::<f64>()?;
        let scene = picture.with_extension("pov");
        let mut write = python(self.root, "povray.py");
        crate::run(write.arg(self.folder.join("room.toml")).arg(&scene).arg(aspect.to_string()).args(settings))?;
        let mut command = Command::new("povray");
        command.arg(format!("+I{}", scene.display())).arg(format!("+O{}", picture.display()));
        command.args([&format!("+W{width}"), &format!("+H{height}"), "+FE", "-D", "+WT2"]).args(self.room.antialiasing);
        Ok(command)
    }

    pub(crate) fn paths(&self, samples: u32, picture: &Path) -> Command {
        let mut command = python(self.root, "paths.py");
        command.arg("draw").arg(self.folder.join("room.json")).args([self.room.size, &samples.to_string(), "1"]).arg(picture);
        command
    }

    /// What `picture_error` says about the first `n` pictures.
    pub(crate) fn errors(&self, n: usize) -> Result<Vec<Value>> {
        let mut measure = Command::new(self.root.join("target/release/examples/picture_error"));
        if self.room.name != "cornell-box" {
            measure.args(["--epsilon", "mean"]);
        }
        measure.args([&self.reference, &self.mask]).arg(self.noise.to_string()).args((0..n).map(|k| self.picture(k)));
        said(&mut measure)?.lines().map(|line| Ok(serde_json::from_str(line)?)).collect()
    }
}

/// What a command prints.
fn said(command: &mut Command) -> Result<String> {
    let output = command.output().with_context(|| format!("cannot start {command:?}"))?;
    if !output.status.success() {
        bail!("{}", String::from_utf8_lossy(&output.stderr));
    }
    Ok(String::from_utf8(output.stdout)?)
}

fn python(root: &Path, script: &str) -> Command {
    let mut command = Command::new("python3");
    command.arg(root.join("benches/race").join(script));
    command
}
