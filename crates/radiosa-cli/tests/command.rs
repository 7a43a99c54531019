//! What somebody who types commands sees: exit codes, messages, files.

mod common;

use std::process::Output;

use common::{radiosa, text};

fn in_folder(args: &[&str]) -> (tempfile::TempDir, Output) {
    let dir = tempfile::tempdir().expect("temporary folders can be made");
    let output = radiosa(dir.path(), args);
    (dir, output)
}

#[test]
fn render_alone_makes_a_picture_of_the_cornell_box_and_says_where() {
    let (dir, output) = in_folder(&["render", "--size", "64x64", "--spp", "1"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(text(&output.stderr).contains("cornell-box.png"));
    assert!(output.stdout.is_empty());
    let bytes = std::fs::read(dir.path().join("cornell-box.png")).expect("the picture is there");
    assert!(bytes.starts_with(b"\x89PNG"));
}

#[test]
fn json_is_one_object_on_standard_output() {
    let (_dir, output) =
        in_folder(&["render", "whitted", "--size", "32x24", "--spp", "1", "--json", "-o", "w.exr", "-o", "w.hdr"]);
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("standard output is JSON alone");
    assert_eq!(report["method"], "whitted", "the best for a scene of mirrors and glass");
    assert_eq!(report["size"], serde_json::json!([32, 24]));
    assert_eq!(report["outputs"], serde_json::json!(["w.exr", "w.hdr"]));
    assert!(report["rays"].as_u64() >= Some(32 * 24));
    let (_dir, output) = in_folder(&["render", "no-such-scene", "--json"]);
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("errors are JSON too");
    assert!(report["error"]["message"].as_str().is_some_and(|m| m.contains("no-such-scene")));
}

#[test]
fn misuse_ends_with_2_and_names_the_nearest_option() {
    let (_dir, output) = in_folder(&["render", "--emiters", "3"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("--emitters"));
    let (_dir, output) = in_folder(&["render", "--method", "raycats"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("raycast"));
    let (_dir, output) = in_folder(&[]);
    assert!(output.status.code() == Some(2) && text(&output.stderr).starts_with("One engine for light"));
    let gathers = &["sheet", "room", "-m", "hybrid", "--rows", "spp=1,2", "--gathers", "a.gathers"];
    for args in [&["sheet", "room"][..], &["sheet", "room", "--rows", "spp"], gathers, &["measure", "room"]] {
        let (_dir, output) = in_folder(args);
        assert_eq!((output.status.code(), text(&output.stderr).matches("error:").count()), (Some(2), 1), "{args:?}");
    }
}

#[test]
fn what_changes_nothing_is_said() {
    let said = |args: &[&str]| {
        let (_dir, output) = in_folder(&[&["render", "--size", "16x12", "--spp", "1"], args].concat());
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        text(&output.stderr)
    };
    let no_effect = |text: &str| text.lines().filter(|l| l.starts_with("warning[no-effect]")).count();
    let words = said(&["room", "-m", "raycast", "--interpolation", "flat", "--fresnel", "on", "--elements", "100"]);
    assert!(no_effect(&words) == 3 && words.contains("--interpolation changes nothing with --method raycast"), "{words}");
    let words = said(&["room", "-m", "scanline", "--interpolation", "flat", "--shadows", "on", "--adaptive", "--emitters", "2"]);
    assert!(no_effect(&words) == 2 && words.contains("1 samples a pixel"), "{words}");
    let words = said(&["room", "-m", "whitted", "--adaptive", "0.2", "--fresnel", "on"]);
    assert!(no_effect(&words) == 1 && words.contains("adaptive (0.2) samples a pixel"), "{words}");
    // The lamp is one of 5×5 points: nothing was left out.
    assert!(!said(&["cornell-box", "-m", "raycast"]).contains("the limit"));
}

#[test]
fn a_lens_that_is_not_drawn_is_said() {
    let dir = tempfile::tempdir().expect("temporary folders can be made");
    let with_lens = ["--set", "camera.main.aperture=0.1"];
    let draw = |method: &str| {
        let args = ["render", "cornell-box", "--size", "16x16", "--spp", "1", "-m", method];
        let output = radiosa(dir.path(), &[&args[..], &with_lens].concat());
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        text(&output.stderr)
    };
    assert!(draw("scanline").contains("warning[no-lens]"));
    assert!(!draw("raycast").contains("no-lens"));
}

const MIRROR_BEFORE_A_SKY: &str = r#"
background = 1

[camera.main]
position = [0, 0, 1]
look_at = [0, 0, 0]

[material.mirror]
phong = { diffuse = 0.3, specular = 0, mirror = 0.7 }

[[shape]]
name = "mirror"
material = "mirror"
quad = [[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]]
"#;

#[test]
fn a_mirror_that_shows_the_background_needs_no_default_light() {
    // All the camera sees is a mirror, in which there is a background.
    let dir = tempfile::tempdir().expect("temporary folders can be made");
    std::fs::write(dir.path().join("mirror.toml"), MIRROR_BEFORE_A_SKY).expect("a file can be written");
    let said = |method: &str| {
        let output = radiosa(dir.path(), &["render", "mirror.toml", "--size", "16x16", "--spp", "1", "-m", method]);
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        text(&output.stderr)
    };
    assert!(!said("whitted").contains("default-light"), "{}", said("whitted"));
    assert!(said("raycast").contains("default-light"), "the twin: ray casting sees a black mirror");
}

#[test]
fn negative_numbers_are_refused_as_numbers() {
    for args in [["--min-weight", "-1"], ["--adaptive", "-0.5"], ["--scale", "-2"]] {
        let (_dir, output) = in_folder(&[&["render"], &args[..]].concat());
        let words = text(&output.stderr);
        assert!(output.status.code() == Some(2) && words.contains("give a"), "{args:?}: {words}");
    }
    for (args, range) in [
        (["render", "--samples", "-1"], "0..=4096"),
        (["render", "--spp", "-4"], "1..=65536"),
        (["render", "--emitters", "-3"], "from 1 to 64"),
        (["render", "--threads", "-2"], "1..=1024"),
        (["sheet", "--max-depth", "-1"], "0..=64"),
        (["solve", "--elements", "-5"], ""),
    ] {
        let (_dir, output) = in_folder(&args);
        let words = text(&output.stderr);
        let is_value = words.contains("invalid value") && words.contains(args[1]) && words.contains(range);
        assert!(output.status.code() == Some(2) && is_value, "{args:?}: {words}");
    }
}

#[test]
fn glass_that_makes_light_is_said() {
    let said = |fresnel: &str| {
        let args = ["render", "whitted", "--size", "16x12", "--spp", "1", "-m", "whitted", "--fresnel", fresnel];
        text(&in_folder(&args).1.stderr)
    };
    let words = said("off");
    assert!(
        words.contains("warning[makes-light]") && words.contains("\"glass\"") && words.contains("k_r + k_t = 1.985"),
        "{words}"
    );
    assert!(!said("material").contains("makes-light"));
}

const A_HALL_OF_ROUGH_METAL: &str = r#"
[material.metal]
metallic_roughness = { base_color = 1, metallic = 1, roughness = 0.3 }

[material.lamp]
lambert = 0
emission = 10

[material.glass]
glass = { ior = 1.5 }

[[shape]]
material = "metal"
box = { min = [-5, -5, -5], max = [5, 5, 5], inward = true }

[[shape]]
material = "glass"
sphere = { radius = 1 }

[[shape]]
material = "lamp"
quad = [[-1, 4.9, -1], [1, 4.9, -1], [1, 4.9, 1], [-1, 4.9, 1]]

[camera.main]
position = [0, 0, 4]
look_at = [0, 0, 0]
"#;

#[test]
fn time_ends_what_would_take_hours() {
    let dir = tempfile::tempdir().expect("temporary folders can be made");
    std::fs::write(dir.path().join("hall.toml"), A_HALL_OF_ROUGH_METAL).expect("a file can be written");
    for more in
        [&["--samples", "1024", "--spp", "16"][..], &["--samples", "4096", "--spp", "64"], &["--samples", "256", "--adaptive"]]
    {
        let args =
            ["render", "hall.toml", "-m", "whitted", "--size", "640x480", "--time", "500ms", "--json", "-q", "-o", "h.png"];
        let output = radiosa(dir.path(), &[&args[..], more].concat());
        let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("standard output is JSON alone");
        // Far more than it takes here, far less than one row of tiles would.
        let total = report["seconds"]["total"].as_f64().expect("a number");
        assert!(total < 15.0, "{more:?}: {total} s");
        assert!(report["done"].as_f64().is_some_and(|done| done < 1.0), "{more:?}");
    }
}

#[test]
fn an_unknown_scene_names_the_nearest_built_in_one() {
    let (_dir, output) = in_folder(&["render", "cornel-box"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("cornell-box"), "{}", text(&output.stderr));
}

#[test]
fn what_can_be_known_to_fail_fails_before_the_first_ray() {
    let (_dir, output) = in_folder(&["render", "-o", "missing/folder/a.png"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("does not exist"), "{}", text(&output.stderr));
    let (_dir, output) = in_folder(&["render", "-o", "a.jpg"]);
    assert!(text(&output.stderr).contains(".png"), "{}", text(&output.stderr));
    let faces = ["render", "phong-spheres", "-m", "scanline", "--tessellation", "1024", "--size", "8x8"];
    for too_much in
        [&["render", "--size", "60000x60000", "--max-memory", "1G"][..], &[&faces[..], &["--max-memory", "200M"]].concat()]
    {
        let (_dir, output) = in_folder(too_much);
        assert_eq!(output.status.code(), Some(1));
        assert!(text(&output.stderr).contains("--max-memory"), "{}", text(&output.stderr));
    }
}

#[test]
fn an_error_in_a_scene_file_shows_the_line_with_a_caret_and_the_nearest_key() {
    let dir = tempfile::tempdir().expect("temporary folders can be made");
    std::fs::write(dir.path().join("a.toml"), "[camera.main]\nposition = [0, 0, 5]\nlook_att = [0, 0, 0]\n").expect("writable");
    let output = radiosa(dir.path(), &["render", "a.toml"]);
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1));
    assert!(message.contains("look_att") && message.contains("look_at") && message.contains("a.toml:3"), "{message}");
}

#[test]
fn the_recipe_inside_a_picture_can_be_read_back() {
    let dir = tempfile::tempdir().expect("temporary folders can be made");
    for name in ["a.png", "a.exr", "a.hdr"] {
        radiosa(dir.path(), &["render", "--size", "16x16", "--seed", "42", "--spp", "1", "-o", name]);
        let output = radiosa(dir.path(), &["info", name]);
        let recipe = text(&output.stdout);
        assert!(recipe.contains("seed: 42") && recipe.contains("command: radiosa render"), "{name}: {recipe}");
    }
}

#[test]
fn the_same_command_writes_the_same_bytes_with_any_number_of_threads() {
    let dir = tempfile::tempdir().expect("temporary folders can be made");
    let render = |threads: &str| {
        radiosa(dir.path(), &["render", "whitted", "--size", "80x60", "--threads", threads, "-o", "w.exr"]);
        std::fs::read(dir.path().join("w.exr")).expect("written")
    };
    let one = render("1");
    for n in ["2", "3", "7"] {
        assert!(render(n) == one, "{n} threads");
    }
}

#[test]
fn every_built_in_scene_can_be_listed_exported_and_rendered() {
    let (dir, output) = in_folder(&["scenes", "--json"]);
    let list: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let scenes = list["scenes"].as_array().expect("a list");
    assert!(scenes.len() >= 7, "{list}");
    for scene in scenes {
        let name = scene["name"].as_str().expect("a name");
        assert!(radiosa(dir.path(), &["scenes", "export", name]).status.success(), "{name}");
        let file = format!("{name}.toml");
        let output = radiosa(dir.path(), &["render", &file, "--size", "24x18", "--spp", "1", "--emitters", "1", "-o", "x.png"]);
        assert!(output.status.success(), "{name}: {}", text(&output.stderr));
    }
}

#[test]
fn a_time_budget_leaves_a_picture_and_says_how_much_is_done() {
    let (dir, output) = in_folder(&["render", "room", "--time", "0.2s", "--size", "2000x1500", "--json", "-q", "-o", "r.png"]);
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert!(report["done"].as_f64().is_some_and(|d| d > 0.0 && d < 1.0), "{report}");
    assert!(dir.path().join("r.png").exists());
}

#[cfg(unix)]
#[test]
fn an_interrupt_writes_what_there_is_and_ends_with_130() {
    let dir = tempfile::tempdir().expect("temporary folders can be made");
    let child = std::process::Command::new(assert_cmd::cargo::cargo_bin("radiosa"))
        .current_dir(dir.path())
        .args(["render", "room", "--size", "3000x2000", "--spp", "64", "-o", "r.png"])
        .stderr(std::process::Stdio::null())
        .spawn()
        .expect("it starts");
    std::thread::sleep(std::time::Duration::from_millis(1500));
    let kill = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("kill runs");
    assert!(kill.success());
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(130));
    assert!(std::fs::read(dir.path().join("r.png")).is_ok_and(|b| b.starts_with(b"\x89PNG")));
}

#[test]
fn version_as_json_names_the_cpu_path() {
    let (_dir, output) = in_folder(&["--version", "--json"]);
    let version: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(version["version"], env!("CARGO_PKG_VERSION"));
    assert!(version["cpu_path"].is_string());
}

#[test]
fn a_time_budget_holds_for_small_pictures_of_many_samples_too() {
    let start = std::time::Instant::now();
    let (dir, output) =
        in_folder(&["render", "--size", "100x100", "--spp", "8192", "--time", "0.5s", "--json", "-q", "-o", "r.png"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(start.elapsed().as_secs() < 20);
    assert!(dir.path().join("r.png").exists());
}

#[test]
fn exporting_a_scene_does_not_replace_a_file() {
    let dir = tempfile::tempdir().expect("temporary folders can be made");
    std::fs::write(dir.path().join("room.toml"), "mine").expect("writable");
    let output = radiosa(dir.path(), &["scenes", "export", "room"]);
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(std::fs::read(dir.path().join("room.toml")).expect("there"), b"mine");
    assert!(radiosa(dir.path(), &["scenes", "export", "room", "--force"]).status.success());
}

#[test]
fn scan_line_draws_what_ray_casting_without_shadows_draws_and_cannot_draw_panoramas() {
    let dir = tempfile::tempdir().expect("temporary folders can be made");
    let common =
        ["--size", "60x45", "--spp", "1", "--emitters", "2", "--blending", "off", "--texture-filter", "bilinear", "--json", "-q"];
    let mean = |args: &[&str]| {
        let output = radiosa(dir.path(), &[&["render", "room", "-o", "r.png"], args, &common[..]].concat());
        let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
        (report["mean_radiance"][1].as_f64().expect("a number"), report)
    };
    let (scan_line, report) = mean(&["--method", "scanline"]);
    assert_eq!(report["method"], "scanline");
    assert!(report["triangles"].as_u64() > Some(100), "{report}");
    let (ray_cast, _) = mean(&["--method", "raycast", "--shadows", "off"]);
    assert!((scan_line / ray_cast - 1.0).abs() < 0.02, "{scan_line} {ray_cast}");
    // The broken twin: with shadows they are not the same picture.
    let (shadowed, _) = mean(&["--method", "raycast"]);
    assert!((scan_line / shadowed - 1.0).abs() > 0.02, "{scan_line} {shadowed}");

    std::fs::write(dir.path().join("p.toml"), "[camera.main]\nposition = [0, 0, 0]\nlook_at = [0, 0, -1]\npanoramic = true\n")
        .expect("writable");
    let output = radiosa(dir.path(), &["render", "p.toml", "--method", "scanline"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("panorama"), "{}", text(&output.stderr));
}

#[test]
fn a_value_of_the_scene_can_be_set_and_the_recipe_keeps_it() {
    let dir = tempfile::tempdir().expect("temporary folders can be made");
    let mean = |args: &[&str]| {
        let output =
            radiosa(dir.path(), &[&["render", "furnace", "--size", "16x16", "--json", "-q", "-o", "f.png"], args].concat());
        let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
        report["mean_radiance"][1].as_f64().unwrap_or_else(|| panic!("{report}"))
    };
    assert!(mean(&["--set", "background=5", "--set", "material.glowing.emission=2"]) > 1.5 * mean(&[]));
    let recipe = text(&radiosa(dir.path(), &["info", "f.png"]).stdout);
    assert!(!recipe.contains("--set"));
    mean(&["--set", "material.glowing.emission=2"]);
    let recipe = text(&radiosa(dir.path(), &["info", "f.png"]).stdout);
    assert!(recipe.contains("--set material.glowing.emission=2"), "{recipe}");
    for (set, said) in [
        ("material.glowin.emission=2", "material.glowing.emission"),
        ("material.glowing.emision=2", "emission"),
        ("material.glowing.emission=red", "material.glowing.emission"),
    ] {
        let output = radiosa(dir.path(), &["render", "furnace", "--set", set]);
        assert_eq!(output.status.code(), Some(1), "{set}");
        assert!(
            text(&output.stderr).contains(said) && text(&output.stderr).contains(set.split('=').next().unwrap()),
            "{}",
            text(&output.stderr)
        );
    }
}

#[test]
fn values_of_a_model_can_be_set_as_an_include_changes_them() {
    let dir = tempfile::tempdir().expect("temporary folders can be made");
    std::fs::write(dir.path().join("a.mtl"), "newmtl red\nKd 1 0 0\n").expect("writable");
    let obj = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nusemtl red\nf 1 2 3 4\n";
    std::fs::write(dir.path().join("a.obj"), obj).expect("writable");
    let mean = |args: &[&str]| {
        let output =
            radiosa(dir.path(), &[&["render", "a.obj", "--size", "16x16", "--json", "-q", "-o", "f.png"], args].concat());
        let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
        ["0", "1"]
            .map(|i| report["mean_radiance"][i.parse::<usize>().expect("a digit")].as_f64().unwrap_or_else(|| panic!("{report}")))
    };
    let (red, green) = (mean(&[]), mean(&["--set", "material.red.lambert=[0,1,0]"]));
    assert!(red[0] > red[1] && green[1] > green[0], "{red:?} {green:?}");
    assert_eq!(mean(&["--set", "name=other"]), red);
}

#[test]
fn auto_takes_the_method_that_suits_options_scene_and_time() {
    let cases: [(&[&str], &str); 14] = [
        (&["shadow"], "hybrid"),
        (&["phong-spheres"], "raycast"),
        (&["whitted"], "whitted"),
        (&["whitted", "--environment", "1,1,1"], "hybrid"),
        (&["shadow", "--time", "20ms", "--size", "640x480"], "path"),
        // (By quick settings; the twin has time for its own.)
        (&["shadow", "--time", "1s", "--size", "120x90"], "hybrid"),
        (&["shadow", "--time", "30s", "--size", "120x90"], "hybrid"),
        (&["shadow", "--noise", "0.2"], "path"),
        (&["shadow", "--interpolation", "flat"], "scanline"),
        (&["shadow", "--emitters", "2"], "raycast"),
        (&["shadow", "--spread", "flat", "--elements", "100", "--refine", "0"], "radiosity"),
        (&["shadow", "--show", "irradiance", "--elements", "100", "--refine", "0"], "radiosity"),
        // Options that no method looks at together decide nothing.
        (&["phong-spheres", "--interpolation", "flat", "--cache", "0"], "raycast"),
        (&["shadow", "--method", "raycast", "--noise", "0.2"], "raycast"),
    ];
    let dir = tempfile::tempdir().expect("a folder");
    for (args, method) in cases {
        let common = ["--size", "24x18", "--spp", "1", "--json", "-q", "-o", "a.png"];
        let common = if args.contains(&"--size") { &common[2..] } else { &common[..] };
        let output = radiosa(dir.path(), &[&["render"], args, common].concat());
        let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
        assert_eq!(report["method"], method, "{args:?}: {report}");
        assert_eq!(report["why"].is_string(), !args.contains(&"--method"), "{report}");
        let is_quick = report["why"].as_str().is_some_and(|why| why.contains("--gather 32"));
        assert_eq!(is_quick, args.contains(&"1s"), "{report}");
    }
}
