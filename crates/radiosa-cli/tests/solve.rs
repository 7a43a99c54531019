//! `radiosa solve`: solutions that are kept, gone on with, shown, measured and exported.

mod common;

use std::path::Path;
use std::process::{Command as Process, Stdio};
use std::time::{Duration, Instant};

use common::{radiosa, text};
use serde_json::Value;

fn ok(dir: &Path, args: &[&str]) -> Value {
    let output = radiosa(dir, &[args, &["--json", "-q"]].concat());
    assert!(output.status.success(), "{args:?}: {}", text(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("one object")
}

/// What fails says so, and how.
fn refused(dir: &Path, args: &[&str], why: &str) {
    let output = radiosa(dir, args);
    let said = text(&output.stderr).split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(output.status.code() == Some(1) && said.contains(why), "{args:?}: {said}");
}

/// A closed box of one reflectance that emits everywhere: B = E/(1 − ρ) on all of it.
const FURNACE: &str = r#"
[material.all]
lambert = [0.5, 0.25, 0.8]
emission = [1.0, 2.0, 0.5]
[[shape]]
name = "walls"
material = "all"
box = { min = [0, 0, 0], max = [2, 1, 1.5], inward = true }
"#;

fn read(path: &Path) -> Vec<u8> {
    std::fs::read(path).expect("it was written")
}

#[test]
fn after_kill_9_the_same_command_goes_on_to_the_same_bytes() {
    let dir = tempfile::tempdir().expect("a folder");
    let solvers: [&[&str]; 5] = [
        &["--solver", "gauss-seidel", "--elements", "500", "--refine", "1"],
        &["--solver", "shooting", "--elements", "300", "--residual", "1e-4"],
        &["--solver", "shooting", "--block", "4", "--order", "cyclic", "--elements", "300", "--residual", "1e-3"],
        &["--solver", "stochastic", "--elements", "800", "--error", "0.05"],
        &["--solver", "hierarchical", "--elements", "4000"],
    ];
    for (k, options) in solvers.into_iter().enumerate() {
        let (whole, killed) = (format!("whole{k}/room.radiosa"), format!("killed{k}/room.radiosa"));
        for folder in [&whole, &killed] {
            std::fs::create_dir_all(dir.path().join(folder).parent().expect("a folder")).expect("it can be made");
        }
        let run = |folder: &str, more: &[&str]| {
            let at = dir.path().join(folder).parent().expect("a folder").to_path_buf();
            let args = [&["solve", "cornell-box", "-o", "room.radiosa", "--save-every", "1ms"], options, more].concat();
            (at, args.into_iter().map(str::to_owned).collect::<Vec<_>>())
        };
        let (at, args) = run(&whole, &["--threads", "1"]);
        ok(&at, &args.iter().map(String::as_str).collect::<Vec<_>>());
        // Killed as soon as something was saved, three times; then to the end.
        let (at, args) = run(&killed, &["--resume", "--threads", "3", "-q"]);
        let file = at.join("room.radiosa");
        let mut n_killed = 0;
        for _ in 0..3 {
            let before = std::fs::read(&file).ok();
            let mut child = Process::new(assert_cmd::cargo::cargo_bin("radiosa"))
                .current_dir(&at)
                .args(&args)
                .stdout(Stdio::null())
                .spawn()
                .expect("it starts");
            let begun = Instant::now();
            while begun.elapsed() < Duration::from_secs(60) && std::fs::read(&file).ok() == before {
                if child.try_wait().expect("it can be asked").is_some() {
                    break;
                }
                std::thread::sleep(Duration::from_millis(1));
            }
            // (One that has ended can be killed, too.)
            n_killed += usize::from(child.try_wait().expect("it can be asked").is_none() && child.kill().is_ok());
            child.wait().expect("it ends");
        }
        assert_eq!(n_killed, 3);
        let (at, args) = run(&killed, &["--resume"]);
        let report = ok(&at, &args.iter().map(String::as_str).collect::<Vec<_>>());
        assert!(report["resumed_after"].is_u64() && report["done"] == 1.0, "{report}");
        assert!(read(&dir.path().join(&whole)) == read(&file), "{options:?}: other bytes");
    }
}

#[test]
fn what_is_kept_is_what_is_shown_and_measured() {
    let dir = tempfile::tempdir().expect("a folder");
    let at = dir.path();
    let few = ["--elements", "300"];
    ok(at, &[&["solve", "cornell-box", "-o", "a.radiosa"], &few[..]].concat());
    let grid = ["measure", "cornell-box", "--grid", "0.1", "--height", "0.05"];
    ok(at, &[&grid[..], &few, &["-o", "anew.csv"]].concat());
    ok(at, &[&grid[..], &["--solution", "a.radiosa", "-o", "kept.csv"]].concat());
    assert_eq!(text(&read(&at.join("anew.csv"))), text(&read(&at.join("kept.csv"))));
    let picture = ["render", "cornell-box", "--size", "40x40", "--spp", "1"];
    let anew = ok(at, &[&picture[..], &few, &["--method", "radiosity", "-o", "anew.png"]].concat());
    let kept = ok(at, &[&picture[..], &["--solution", "a.radiosa", "-o", "kept.png"]].concat());
    assert_eq!(anew["mean_radiance"], kept["mean_radiance"]);
    assert_eq!(kept["method"], "radiosity");
    let output = radiosa(at, &["info", "a.radiosa", "--json"]);
    let info: Value = serde_json::from_slice(&output.stdout).expect("one object");
    assert!(info["command"].as_str().is_some_and(|c| c.starts_with("radiosa solve cornell-box")), "{info}");
}

/// The light of lamps is in pictures once, wherever it comes from, and its share is the direct layer.
#[test]
fn lamps_are_as_bright_at_samples_as_on_elements() {
    let dir = tempfile::tempdir().expect("a folder");
    let at = dir.path();
    let scene = r#"
[material.white]
lambert = 0.6
[[shape]]
name = "walls"
material = "white"
box = { min = [0, 0, 0], max = [2, 2, 2], inward = true }
[light.lamp]
point = [1, 1.6, 1]
[camera.main]
position = [1, 1, 1]
look_at = [1, 1, 0]
panoramic = true
"#;
    std::fs::write(at.join("room.toml"), scene).expect("it can be written");
    ok(at, &["solve", "room.toml", "-o", "a.radiosa", "--elements", "2000"]);
    let show = ["render", "room.toml", "--solution", "a.radiosa", "--size", "64x32", "-o", "x.exr"];
    let mean = |more: &[&str]| {
        let report = ok(at, &[&show[..], more].concat());
        report["mean_radiance"][0].as_f64().expect("a number")
    };
    let (sharp, elements) = (mean(&[]), mean(&["--lamps", "elements"]));
    // Adding the lamp twice, or leaving it out, is off by tens of percents.
    assert!((sharp / elements - 1.0).abs() < 0.01, "{sharp} and {elements}");
    let by_ray_casting = ok(at, &["render", "room.toml", "--method", "raycast", "--size", "64x32", "-o", "y.exr"]);
    let direct = by_ray_casting["mean_radiance"][0].as_f64().expect("a number");
    assert!(sharp > 1.5 * direct, "light that goes on from wall to wall is missing: {sharp}, {direct}");
}

#[test]
fn further_views_begin_with_what_others_gathered() {
    let dir = tempfile::tempdir().expect("a folder");
    let at = dir.path();
    std::fs::write(at.join("furnace.toml"), FURNACE).expect("it can be written");
    let view = |scene: &str, seed: &str, more: &[&str]| {
        let args = ["render", scene, "--method", "hybrid", "--size", "48x48", "--spp", "1", "--elements", "200", "--seed", seed];
        ok(at, &[&args[..], more].concat())
    };
    let alone = view("cornell-box", "0", &["-o", "alone.exr"]);
    let first = view("cornell-box", "0", &["-o", "first.exr", "--gathers", "a.gathers"]);
    assert_eq!(alone["rays"], first["rays"]);
    let again = view("cornell-box", "0", &["-o", "again.exr", "--gathers", "a.gathers"]);
    // (What adds nothing changes nothing.)
    let kept = read(&at.join("a.gathers"));
    view("cornell-box", "0", &["-o", "again.exr", "--gathers", "a.gathers"]);
    assert!(kept == read(&at.join("a.gathers")));
    let rays = |of: &Value| of["rays"].as_f64().expect("a number");
    assert!(rays(&again) < rays(&first) / 3.0, "{again}");
    for c in 0..3 {
        let [a, b] = [&first, &again].map(|of| of["mean_radiance"][c].as_f64().expect("a number"));
        assert!((a / b - 1.0).abs() < 1e-3, "{a} {b}");
    }
    let with = |scene: &'static str, options: &[&'static str]| {
        let args = ["render", scene, "--method", "hybrid", "--elements", "200", "-o", "x.png", "--gathers"];
        [&args[..], options].concat()
    };
    refused(at, &with("cornell-box", &["a.gathers", "--gather", "64"]), "made with other options");
    refused(at, &with("cornell-box", &["a.gathers", "--background", "1,1,1"]), "made with other options");
    refused(at, &with("furnace.toml", &["a.gathers"]), "it is of another scene");
    refused(at, &with("cornell-box", &["a.radiosa"]), "the ending must be one of .gathers");
    let whole = read(&at.join("a.gathers"));
    for n in [0, 7, 11, 12, whole.len() / 2, whole.len() - 1] {
        std::fs::write(at.join("b.gathers"), &whole[..n]).expect("it can be written");
        refused(at, &with("cornell-box", &["b.gathers"]), "cannot read b.gathers");
    }
    for k in (0..whole.len()).step_by(whole.len() / 20) {
        let mut damaged = whole.clone();
        damaged[k] ^= 0x5A;
        std::fs::write(at.join("b.gathers"), &damaged).expect("it can be written");
        refused(at, &with("cornell-box", &["b.gathers"]), "cannot read b.gathers");
    }
}

#[test]
fn a_file_that_does_not_fit_is_refused() {
    let dir = tempfile::tempdir().expect("a folder");
    let at = dir.path();
    std::fs::write(at.join("furnace.toml"), FURNACE).expect("it can be written");
    let few = ["--elements", "50"];
    ok(at, &[&["solve", "furnace.toml", "-o", "a.radiosa"], &few[..]].concat());
    let whole = read(&at.join("a.radiosa"));
    refused(at, &["render", "cornell-box", "--solution", "a.radiosa", "-o", "x.png"], "it is of another scene");
    let other = ["solve", "furnace.toml", "-o", "a.radiosa", "--resume", "--elements", "51"];
    refused(at, &other, "it was solved with other settings");
    // (A tighter end is no other setting.)
    ok(at, &[&["solve", "furnace.toml", "-o", "a.radiosa", "--resume", "--residual", "1e-9"], &few[..]].concat());
    let show = ["measure", "furnace.toml", "--grid", "0.5", "--solution", "b.radiosa", "-o", "x.csv"];
    for n in [0, 7, 11, 12, 40, whole.len() / 2, whole.len() - 1] {
        std::fs::write(at.join("b.radiosa"), &whole[..n]).expect("it can be written");
        refused(at, &show, "cannot read b.radiosa");
    }
    for k in (0..whole.len()).step_by(whole.len() / 60) {
        let mut damaged = whole.clone();
        damaged[k] ^= 0x5A;
        std::fs::write(at.join("b.radiosa"), &damaged).expect("it can be written");
        refused(at, &show, "cannot read b.radiosa");
    }
    refused(at, &["render", "furnace.toml", "--solution", "none.radiosa"], "cannot read none.radiosa");
    let output = radiosa(at, &["render", "furnace.toml", "--solution", "a.radiosa", "--method", "raycast"]);
    assert_eq!(output.status.code(), Some(2));
    refused(at, &["solve", "furnace.toml", "--elements", "50000000", "--max-memory", "1G"], "more than the 1024 MiB allowed");
    refused(at, &["solve", "furnace.toml", "--export", "x.obj"], "the ending must be one of .glb, .gltf, .ply");
}

/// The values of an attribute in a `.glb`.
fn attribute(glb: &[u8], name: &str) -> Vec<[f32; 3]> {
    let length = u32::from_le_bytes(glb[12..16].try_into().expect("four bytes")) as usize;
    let json: Value = serde_json::from_slice(&glb[20..20 + length]).expect("JSON");
    let bytes = &glb[28 + length..];
    let index = &json["meshes"][0]["primitives"][0]["attributes"][name];
    let accessor = &json["accessors"][index.as_u64().expect("an index") as usize];
    let view = &json["bufferViews"][accessor["bufferView"].as_u64().expect("an index") as usize];
    let [start, n] = ["byteOffset", "byteLength"].map(|key| view[key].as_u64().expect("a number") as usize);
    let number = |b: &[u8]| f32::from_le_bytes(b.try_into().expect("four bytes"));
    bytes[start..start + n].chunks(12).map(|v| [number(&v[..4]), number(&v[4..8]), number(&v[8..])]).collect()
}

#[test]
fn the_light_of_a_furnace_is_exported_and_reported() {
    let dir = tempfile::tempdir().expect("a folder");
    let at = dir.path();
    std::fs::write(at.join("furnace.toml"), FURNACE).expect("it can be written");
    let exports = ["--export", "a.glb", "--export", "a.gltf", "--export", "a.ply"];
    let report = ok(at, &[&["solve", "furnace.toml", "--elements", "50", "--exposure", "0.1"], &exports[..]].concat());
    // L_e is emission/π in no unit here: E = π L_e.
    let expected = [(1.0, 0.5), (2.0, 0.25), (0.5, 0.8)].map(|(e, rho)| std::f64::consts::PI * e / (1.0 - rho));
    let surface = &report["surfaces"][0];
    assert_eq!(surface["name"], "walls");
    assert!((surface["area"].as_f64().expect("a number") - 13.0).abs() < 1e-9, "{surface}");
    let glb = read(&at.join("a.glb"));
    let (radiosity, color) = (attribute(&glb, "_RADIOSITY"), attribute(&glb, "COLOR_0"));
    for (c, b) in expected.into_iter().enumerate() {
        let mean = surface["radiosity"][c].as_f64().expect("a number");
        assert!((mean / b - 1.0).abs() < 1e-5, "{mean} is not {b}");
        assert!(radiosity.iter().all(|v| (f64::from(v[c]) / b - 1.0).abs() < 1e-5));
        let shown = (0.1 * b / std::f64::consts::PI).min(1.0);
        assert!(color.iter().all(|v| (f64::from(v[c]) - shown).abs() < 1e-5));
    }
    // Both glTF files read back as the box.
    for file in ["a.glb", "a.gltf"] {
        let (scene, warnings) = radiosa::import::load(&at.join(file), &radiosa::import::Options::default()).expect("it is read");
        assert!(warnings.is_empty(), "{warnings:?}");
        let (low, high) = scene.bounds().expect("it has faces");
        assert!(
            low.abs_diff_eq(radiosa::math::DVec3::ZERO, 1e-6)
                && (high - radiosa::math::DVec3::new(2.0, 1.0, 1.5)).length() < 1e-6
        );
    }
    let ply = read(&at.join("a.ply"));
    let end = b"end_header\n";
    let head = ply.windows(end.len()).position(|w| w == end).expect("a header") + end.len();
    let count = |what: &str| {
        let head = text(&ply[..head]);
        let line = head.lines().find_map(|l| l.strip_prefix(what)).expect("it is said").trim().to_owned();
        line.parse::<usize>().expect("a number")
    };
    let (vertices, faces) = (count("element vertex"), count("element face"));
    assert_eq!(vertices, radiosity.len());
    assert_eq!(ply.len(), head + vertices * 15 * 4 + faces * 13);
}

/// Size and RGB bytes of an 8-bit PNG.
fn png(path: &Path) -> (u32, u32, Vec<u8>) {
    let decoder = png::Decoder::new(std::io::BufReader::new(std::fs::File::open(path).expect("it was written")));
    let mut reader = decoder.read_info().expect("a PNG");
    let mut bytes = vec![0; reader.output_buffer_size().expect("it is small")];
    let info = reader.next_frame(&mut bytes).expect("a picture");
    (info.width, info.height, bytes)
}

#[test]
fn false_colours_say_how_much_light_there_is() {
    use radiosa::film::false_color::{Palette, Scale};
    let dir = tempfile::tempdir().expect("a folder");
    let at = dir.path();
    std::fs::write(at.join("furnace.toml"), FURNACE).expect("it can be written");
    ok(at, &["solve", "furnace.toml", "-o", "a.radiosa", "--elements", "50"]);
    // What arrives is what leaves: B = E/(1 − ρ), by luminance.
    let b = |e: f64, rho: f64| std::f64::consts::PI * e / (1.0 - rho);
    let expected = 0.2126 * b(1.0, 0.5) + 0.7152 * b(2.0, 0.25) + 0.0722 * b(0.5, 0.8);
    let shown = ["--solution", "a.radiosa", "--false-color", "cividis", "--color-range", "1,100", "--color-scale", "log"];
    let scale = Scale { low: 1.0, high: 100.0, is_logarithmic: true };
    let wanted = Palette::Cividis.color(scale.position(expected));
    let wrong = Palette::Cividis.color(scale.position(1.05 * expected));
    ok(at, &[&["measure", "furnace.toml", "--grid", "0.25", "--height", "0.4", "-o", "grid.png"], &shown[..]].concat());
    let picture = ["render", "furnace.toml", "--show", "irradiance", "--size", "40x30", "--spp", "1", "-o", "seen.png"];
    ok(at, &[&picture[..], &shown].concat());
    for (file, least) in [("grid.png", 300), ("seen.png", 40)] {
        let (width, height, rgb) = png(&at.join(file));
        assert!(width > least && height > 160, "{file}: {width} × {height}, a legend beside it");
        // Some way in from the corner, where the margin is over.
        let pixel = 3 * ((20 * width + 20) as usize);
        let seen = &rgb[pixel..pixel + 3];
        let off = |color: [u8; 3]| seen.iter().zip(color).map(|(a, b)| a.abs_diff(b)).max().expect("three");
        assert!(off(wanted) <= 1 && off(wrong) > 1, "{file}: {seen:?}, wanted {wanted:?}");
    }
    let output = radiosa(at, &["measure", "furnace.toml", "--points", "-", "-o", "x.png"]);
    assert_eq!(output.status.code(), Some(2), "{}", text(&output.stderr));
}

#[test]
fn the_mesh_can_be_drawn_over_a_picture() {
    let dir = tempfile::tempdir().expect("a folder");
    let at = dir.path();
    // A square seen head-on that fills the picture: what is between its elements is straight lines, half a pixel wide.
    let square = "[material.a]\nlambert = 0.5\n[[shape]]\nmaterial = \"a\"\nquad = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]\n\
        [camera.ahead]\nposition = [0, 0, 1]\nlook_at = [0, 0, 0]\northographic_height = 1.9\n[light.sun]\ndistant = { to_light = [0, 0, 1] }\nintensity = 0.5\n";
    std::fs::write(at.join("square.toml"), square).expect("it can be written");
    let picture = ["render", "square.toml", "--method", "radiosity", "--size", "80x80", "--element-size", "0.5"];
    let light = ok(at, &[&picture[..], &["-o", "plain.png"]].concat());
    let with_lines = ok(at, &[&picture[..], &["--overlay", "mesh", "-o", "mesh.png"]].concat());
    let ((width, _, plain), (_, _, mesh)) = (png(&at.join("plain.png")), png(&at.join("mesh.png")));
    let differs = |x: u32, y: u32| {
        let pixel = 3 * (y * width + x) as usize;
        plain[pixel..pixel + 3] != mesh[pixel..pixel + 3]
    };
    // Four by four elements of 21 pixels: a row through the middle of some meets three lines, as does a column.
    let lines = |along: &dyn Fn(u32) -> bool| (0..80).filter(|&k| along(k)).collect::<Vec<u32>>();
    for found in [lines(&|x| differs(x, 10)), lines(&|y| differs(30, y))] {
        assert!(found.len() == 3 && found.iter().zip([18, 39, 60]).all(|(k, edge)| k.abs_diff(edge) <= 1), "{found:?}");
    }
    assert_eq!(light["mean_radiance"], with_lines["mean_radiance"], "lines are no light");
    let output = radiosa(at, &[&picture[..], &["--overlay", "mesh", "--bits", "16"]].concat());
    assert!(output.status.code() == Some(2) && text(&output.stderr).contains("8 bits"));
    assert!(!differs(10, 10));
}

#[test]
fn links_and_borders_of_shadows_can_be_drawn_over_a_picture() {
    let dir = tempfile::tempdir().expect("a folder");
    let at = dir.path();
    let picture = ["render", "shadow", "--camera", "above", "--method", "radiosity", "--size", "80x80", "--elements", "200"];
    let drawn = |more: &[&str]| {
        ok(at, &[&picture[..], &["--refine", "0", "--spp", "1", "-o", "a.png"], more].concat());
        png(&at.join("a.png")).2
    };
    let linked = ["--solver", "hierarchical", "--overlay", "links"];
    let (plain, links) = (drawn(&linked[..2]), drawn(&[&linked[..], &["--links-of", "70,10"]].concat()));
    let differs = |a: &[u8], b: &[u8], x: usize, y: usize| a[3 * (80 * y + x)] != b[3 * (80 * y + x)];
    // From near the pixel that was named to the light in the middle, of which little is seen from anywhere else.
    let along = |from: usize, to: usize| (from..to).filter(|k| (0..3).any(|d| differs(&plain, &links, k + d, 80 - k))).count();
    assert!(along(50, 68) > 8, "{}", along(50, 68));
    assert!((0..30).all(|x| !differs(&plain, &links, x, 60)), "nothing where no link is");
    assert_ne!(drawn(&linked), links, "another element");
    let with = |overlay: &str| drawn(&[&linked[..3], &[overlay, "--links-of", "70,10"]].concat());
    assert!(with("mesh,links") != links && with("mesh,links") != with("mesh"));
    for wrong in [&["--overlay", "links"][..], &["--solver", "hierarchical", "--overlay", "links", "--links-of", "80,3"]] {
        let output = radiosa(at, &[&picture[..], wrong].concat());
        assert!(!output.status.success() && text(&output.stderr).contains("links"), "{}", text(&output.stderr));
    }
    // Borders of shadows: more elements, all of the floor's area, and in the file.
    let solve = |more: &[&str]| ok(at, &[&["solve", "shadow", "--refine", "0", "-o", "s.radiosa"], more].concat());
    let (without, with) = (solve(&["--elements", "400"]), solve(&["--elements", "400", "--discontinuities", "1"]));
    assert!(with["elements"].as_u64() > without["elements"].as_u64(), "{with}");
    let area = |report: &serde_json::Value| report["surfaces"][0]["area"].as_f64().expect("a number");
    assert!((area(&with) - area(&without)).abs() < 1e-6);
    let seen = ok(at, &["render", "shadow", "--solution", "s.radiosa", "--size", "40x40", "--overlay", "mesh", "-o", "s.png"]);
    assert!(seen["mean_radiance"][1].as_f64().is_some_and(|mean| mean > 0.0));
    let few = solve(&["--discontinuities", "1", "--elements", "8"]);
    assert!(few["warnings"].as_array().is_some_and(|all| all.iter().any(|w| w["name"] == "discontinuities")), "{few}");
}

#[test]
fn what_is_unfinished_or_without_effect_is_said() {
    let dir = tempfile::tempdir().expect("a folder");
    let at = dir.path();
    let report = ok(at, &["solve", "room", "-o", "a.radiosa", "--time", "1ms", "--order", "cyclic"]);
    assert!(report["done"].as_f64().is_some_and(|done| done < 1.0), "{report}");
    let named = |name: &str| report["warnings"].as_array().expect("a list").iter().any(|w| w["name"] == name);
    assert!(named("no-effect") && !named("unfinished"), "{report}");
    let info = Process::new(assert_cmd::cargo::cargo_bin("radiosa")).current_dir(at).args(["info", "a.radiosa"]).output();
    assert!(String::from_utf8_lossy(&info.expect("it starts").stdout).contains("unfinished"));
    let measure = ["measure", "room", "--grid", "2", "--solution", "a.radiosa", "-o", "a.csv"];
    let measured = Process::new(assert_cmd::cargo::cargo_bin("radiosa")).current_dir(at).args(measure).output();
    let said = String::from_utf8_lossy(&measured.expect("it starts").stderr).into_owned();
    assert!(said.contains("warning[unfinished]"), "{said}");
}

#[test]
fn meshes_that_cannot_be_held_are_refused_before_they_are_made() {
    let dir = tempfile::tempdir().expect("a directory");
    let options = ["--element-size", "1e-5", "--max-memory", "200M", "--size", "32x32", "-o", "x.png"];
    for method in ["radiosity", "hybrid"] {
        let output = radiosa(dir.path(), &[&["render", "cornell-box", "--method", method][..], &options].concat());
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(
            !output.status.success() && error.contains("a mesh of about") && error.contains("--element-size"),
            "{method}: {error}"
        );
    }
}
