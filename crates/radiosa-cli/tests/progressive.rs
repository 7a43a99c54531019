//! `radiosa render --method path`: pictures that end by samples, noise or time, are kept on the way and gone on with.

mod common;

use std::path::Path;
use std::process::{Child, Command as Process, Stdio};
use std::time::{Duration, Instant};

use common::{radiosa, text};
use serde_json::Value;

fn ok(dir: &Path, args: &[&str]) -> Value {
    let output = radiosa(dir, &[args, &["--json", "-q"]].concat());
    assert!(output.status.success(), "{args:?}: {}", text(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("one object")
}

fn start(dir: &Path, args: &[&str]) -> Child {
    Process::new(assert_cmd::cargo::cargo_bin("radiosa"))
        .current_dir(dir)
        .args(args)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("it starts")
}

/// Waits until something is true, or a minute is over, or the child has ended.
fn wait_until(child: &mut Child, is_so: impl Fn() -> bool) {
    let begun = Instant::now();
    while !is_so() && begun.elapsed() < Duration::from_secs(60) && child.try_wait().expect("it can be asked").is_none() {
        std::thread::sleep(Duration::from_millis(1));
    }
}

fn read(path: &Path) -> Vec<u8> {
    std::fs::read(path).expect("it was written")
}

fn samples(report: &Value) -> f64 {
    report["spp"].as_f64().expect("a number")
}

#[test]
fn after_kill_9_the_same_command_goes_on_to_the_same_bytes_without_doing_it_all_again() {
    let dir = tempfile::tempdir().expect("a folder");
    for (k, options) in [&["--spp", "24", "-o", "room.exr"][..], &["--noise", "0.05", "-o", "room.png"]].into_iter().enumerate() {
        let folders = ["whole", "killed"].map(|name| dir.path().join(format!("{name}{k}")));
        folders.iter().for_each(|folder| std::fs::create_dir(folder).expect("it can be made"));
        let args = [&["render", "cornell-box", "--method", "path", "--size", "96x96", "--save-every", "1ms"], options].concat();
        let whole = ok(&folders[0], &[&args[..], &["--threads", "1"]].concat());
        let (at, file) = (&folders[1], options[3]);
        let kept = at.join(format!("{file}.checkpoint"));
        let killed = [&args[..], &["--resume", "--threads", "3", "-q"]].concat();
        for _ in 0..3 {
            let before = std::fs::read(&kept).ok();
            let mut child = start(at, &killed);
            wait_until(&mut child, || std::fs::read(&kept).ok() != before);
            assert!(child.try_wait().expect("it can be asked").is_none(), "it ended before it could be killed");
            child.kill().expect("it can be killed");
            child.wait().expect("it ends");
        }
        assert!(!at.join(file).exists());
        let report = ok(at, &[&args[..], &["--resume"]].concat());
        let resumed = report["resumed_after"].as_f64().expect("it went on from something") / f64::from(96 * 96);
        assert!(resumed > 0.0 && resumed < samples(&whole) && report["done"] == 1.0, "{report}");
        assert!(read(&folders[0].join(file)) == read(&at.join(file)), "{options:?}: other bytes");
        assert!(!kept.exists() && !folders[0].join(format!("{file}.checkpoint")).exists(), "what is done needs no state");
    }
}

#[cfg(unix)]
#[test]
fn ctrl_c_leaves_a_whole_picture_and_says_how_to_go_on() {
    let dir = tempfile::tempdir().expect("a folder");
    let at = dir.path();
    let args = ["render", "room", "--method", "path", "--size", "160x120", "--spp", "64", "-o", "a.png", "--save-every", "1ms"];
    let mut child = start(at, &args);
    wait_until(&mut child, || at.join("a.png.checkpoint").exists());
    let interrupted = Process::new("kill").args(["-INT", &child.id().to_string()]).status().expect("it can be sent");
    assert!(interrupted.success());
    let output = child.wait_with_output().expect("it ends");
    let said = text(&output.stderr);
    assert!(output.status.code() == Some(130) && said.contains("--resume") && said.contains("a.png.checkpoint"), "{said}");
    assert!(at.join("a.png").exists());
    let report = ok(at, &[&args[..], &["--resume"]].concat());
    assert!(report["resumed_after"].is_u64() && report["done"] == 1.0 && samples(&report) == 64.0, "{report}");
    // The same as in one go, but for the command that made it.
    let whole = ok(at, &[&args[..8], &["-o", "b.png"]].concat());
    assert_eq!(whole["mean_radiance"], report["mean_radiance"]);
}

#[test]
fn a_time_is_a_budget_for_a_whole_picture_that_can_be_had_again() {
    let dir = tempfile::tempdir().expect("a folder");
    let at = dir.path();
    let picture = ["render", "cornell-box", "--method", "path", "--size", "64x64", "-o", "a.exr"];
    let begun = Instant::now();
    let report = ok(at, &[&picture[..], &["--time", "2s"]].concat());
    let trace = report["seconds"]["trace"].as_f64().expect("a number");
    assert!(begun.elapsed() < Duration::from_secs(20) && trace < 4.0, "{report}");
    assert!(samples(&report) >= 2.0 && report["done"] == 1.0 && report["noise"].is_f64(), "{report}");
    let repeat = report["repeat"].as_str().expect("how to have it again").to_owned();
    let again = ok(at, &[&picture[..], &repeat.split(' ').collect::<Vec<_>>()].concat());
    assert_eq!(again["mean_radiance"], report["mean_radiance"], "{repeat}");
    // No time at all still is a whole picture, and not a black one.
    let none = ok(at, &[&picture[..], &["--time", "1ms"]].concat());
    let mean = |report: &Value| report["mean_radiance"][1].as_f64().expect("a number");
    assert!((mean(&none) / mean(&again) - 1.0).abs() < 0.2, "{none}");
    // More samples than there is time for are unfinished, and kept.
    let cut = ok(at, &[&picture[..], &["--time", "500ms", "--spp", "60000"]].concat());
    assert!(cut["done"].as_f64().is_some_and(|done| done < 1.0) && at.join("a.exr.checkpoint").exists(), "{cut}");
}

#[test]
fn noise_is_asked_for_reported_and_written() {
    let dir = tempfile::tempdir().expect("a folder");
    let at = dir.path();
    let picture = ["render", "room", "--method", "path", "--size", "64x48", "--layers", "variance", "-o", "a.exr"];
    let coarse = ok(at, &[&picture[..], &["--noise", "0.1"]].concat());
    let fine = ok(at, &[&picture[..], &["--noise", "0.05"]].concat());
    let noise = |report: &Value| report["noise"].as_f64().expect("a number");
    assert!(noise(&coarse) <= 0.1 && noise(&fine) <= 0.05 && samples(&fine) > 2.0 * samples(&coarse), "{coarse} {fine}");
    let exr = String::from_utf8_lossy(&read(&at.join("a.exr"))).into_owned();
    assert!(exr.contains("variance.R") && exr.contains("samples.N"));
    let info: Value = serde_json::from_slice(&radiosa(at, &["info", "a.exr", "--json"]).stdout).expect("one object");
    assert!(info["noise"].as_str().is_some_and(|n| n.starts_with("0.04")) && info["repeat"].is_string(), "{info}");
    let output = radiosa(at, &["render", "room", "--method", "path", "--noise", "0"]);
    assert_eq!(output.status.code(), Some(2));
    let ignored =
        ok(at, &["render", "room", "--method", "whitted", "--size", "16x12", "--spp", "1", "--noise", "0.1", "--resume"]);
    let n_ignored = ignored["warnings"].as_array().expect("a list").iter().filter(|w| w["name"] == "no-effect").count();
    assert_eq!(n_ignored, 2, "{ignored}");
}

#[test]
fn a_state_that_does_not_fit_is_refused() {
    let dir = tempfile::tempdir().expect("a folder");
    let at = dir.path();
    let args = ["render", "cornell-box", "--method", "path", "--size", "40x40", "-o", "a.png", "--resume"];
    let begin = [&args[..], &["--spp", "60000", "--time", "300ms"]].concat();
    ok(at, &begin);
    let kept = read(&at.join("a.png.checkpoint"));
    let refused = |args: &[&str], why: &str| {
        let output = radiosa(at, args);
        let said = text(&output.stderr).split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(output.status.code() == Some(1) && said.contains(why), "{args:?}: {said}");
    };
    refused(&[&args[..], &["--seed", "1"]].concat(), "other settings");
    refused(&[&args[..], &["--noise", "0.1"]].concat(), "other settings");
    refused(&[&args[..], &["--spp", "1"]].concat(), "more samples than --spp asks for");
    refused(&[&args[..], &["--set", "material.white.lambert=0.1"]].concat(), "another scene");
    for n in [0, 7, 11, 40, kept.len() / 2, kept.len() - 1] {
        std::fs::write(at.join("a.png.checkpoint"), &kept[..n]).expect("it can be written");
        refused(&begin, "cannot read a.png.checkpoint");
    }
    for k in (0..kept.len()).step_by(kept.len() / 20) {
        let mut damaged = kept.clone();
        damaged[k] ^= 0x5A;
        std::fs::write(at.join("a.png.checkpoint"), &damaged).expect("it can be written");
        refused(&begin, "cannot read a.png.checkpoint");
    }
}
