//! `radiosa sheet`: what its cells show, what its labels leave alone, what it says when something is wrong.

mod common;

use std::path::Path;

use common::{radiosa, text};
use serde_json::Value;

/// A sheet's report.
fn sheet(dir: &Path, args: &[&str]) -> Value {
    let output = radiosa(dir, &[&["sheet"], args, &["--json", "-q"]].concat());
    assert_eq!(output.status.code(), Some(0), "{args:?}: {}", text(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("standard output is JSON alone")
}

/// The pixels of a PNG: width, height, RGB bytes.
fn pixels(path: &Path) -> (usize, usize, Vec<u8>) {
    let file = std::io::BufReader::new(std::fs::File::open(path).expect("it was written"));
    let mut reader = png::Decoder::new(file).read_info().expect("it is a PNG");
    let mut bytes = vec![0; reader.output_buffer_size().expect("it is small")];
    let info = reader.next_frame(&mut bytes).expect("it is whole");
    assert_eq!(info.color_type, png::ColorType::Rgb);
    (info.width as usize, info.height as usize, bytes)
}

/// The pixels of a cell on a page.
fn cut((width, _, rgb): &(usize, usize, Vec<u8>), cell: &Value, size: (usize, usize)) -> Vec<u8> {
    let at = |i: usize| cell["at"][i].as_u64().expect("a place") as usize;
    (0..size.1).flat_map(|y| &rgb[3 * ((at(1) + y) * width + at(0))..][..3 * size.0]).copied().collect()
}

#[test]
fn every_cell_is_the_picture_that_render_makes_of_the_same_settings() {
    let dir = tempfile::tempdir().expect("temporary folders can be made");
    let common = ["--size", "41x30", "--spp", "2"];
    let report = sheet(
        dir.path(),
        &[
            &["whitted", "--rows", "method=scanline,whitted", "--columns", "light.sun.intensity=0.4,[1,0.5,0.2]", "-o", "s.png"],
            &common[..],
        ]
        .concat(),
    );
    let page = pixels(&dir.path().join("s.png"));
    let cells = report["cells"].as_array().expect("a list");
    assert_eq!(cells.len(), 4);
    let mut pictures = Vec::new();
    for (method, light) in [("scanline", "0.4"), ("scanline", "[1,0.5,0.2]"), ("whitted", "0.4"), ("whitted", "[1,0.5,0.2]")] {
        let set = format!("light.sun.intensity={light}");
        let args = ["render", "whitted", "-q", "-o", "r.png", "--method", method, "--set", &set];
        assert!(radiosa(dir.path(), &[&args, &common[..]].concat()).status.success());
        pictures.push(pixels(&dir.path().join("r.png")).2);
    }
    for (i, cell) in cells.iter().enumerate() {
        let shown = cut(&page, cell, (41, 30));
        assert!(shown == pictures[i], "{cell}");
        // The broken twin: the picture of another cell is another one.
        assert!(shown != pictures[(i + 1) % 4], "{cell}");
    }
    assert_eq!(cells[3]["row"], "whitted");
    assert_eq!(cells[3]["column"], "intensity = [1,0.5,0.2]");
}

#[test]
fn labels_are_written_beside_the_cells_only() {
    let dir = tempfile::tempdir().expect("temporary folders can be made");
    let common = ["furnace", "--columns", "spp=1,2", "--size", "60x40", "-o", "s.png"];
    let short = sheet(dir.path(), &[&common[..], &["--title", "", "--column-name", "n"]].concat());
    let one = pixels(&dir.path().join("s.png"));
    let long =
        sheet(dir.path(), &[&common[..], &["--title", "k_d × I_a", "--column-name", "a name that needs several lines"]].concat());
    let other = pixels(&dir.path().join("s.png"));
    assert!(other.1 > one.1, "the longer labels take more room");
    for i in 0..2 {
        assert!(cut(&one, &short["cells"][i], (60, 40)) == cut(&other, &long["cells"][i], (60, 40)));
    }
    // Ink above the cells, and none on the margin of the page.
    let top = long["cells"][0]["at"][1].as_u64().expect("a place") as usize;
    let dark = |y: usize| other.2[3 * y * other.0..3 * (y + 1) * other.0].iter().any(|&v| v < 128);
    assert!((0..top).any(dark));
    assert!(!(0..4).any(dark) && !dark(other.1 - 1));
}

#[test]
fn every_figure_works_and_has_the_cells_it_says() {
    let dir = tempfile::tempdir().expect("temporary folders can be made");
    let list: Value = serde_json::from_slice(&radiosa(dir.path(), &["sheet", "--list", "--json"]).stdout).expect("JSON");
    let expected = [
        ("diffuse-ambient", 9),
        ("specular-exponent", 9),
        ("components", 10),
        ("phong-cook-torrance", 15),
        ("light-types", 16),
        ("methods", 3),
        ("interpolation", 9),
    ];
    assert_eq!(list["figures"].as_array().map(Vec::len), Some(expected.len()));
    for (name, n) in expected {
        let report = sheet(dir.path(), &["--figure", name, "--size", "24x24"]);
        let cells = report["cells"].as_array().expect("a list");
        assert_eq!(cells.len(), n, "{name}");
        assert!(dir.path().join(format!("{name}.png")).exists(), "{name}");
        for cell in cells {
            let lit = cell["mean_radiance"][1].as_f64().is_some_and(|v| v > 1e-3);
            // All but the specular layer of a rough plastic are more than specks.
            assert!(lit || cell["column"] == "specular", "{name}: {cell}");
        }
    }
    // What is given on the command line counts more than what the figure says.
    sheet(dir.path(), &["--figure", "components", "--size", "24x24", "--spp", "3"]);
    let recipe = text(&radiosa(dir.path(), &["info", "components.png"]).stdout);
    assert!(recipe.contains("spp: 3\n"), "{recipe}");
    assert!(recipe.contains("figure: components") && recipe.contains("command: radiosa sheet"), "{recipe}");
}

#[test]
fn the_components_of_the_figure_sum_to_its_last_column() {
    let dir = tempfile::tempdir().expect("temporary folders can be made");
    let report = sheet(dir.path(), &["--figure", "components", "--size", "40x40"]);
    for row in report["cells"].as_array().expect("a list").chunks(5) {
        let mean = |i: usize| row[i]["mean_radiance"][0].as_f64().expect("a number");
        let sum: f64 = (0..4).map(mean).sum();
        assert!((sum / mean(4) - 1.0).abs() < 1e-5, "{sum} {}", mean(4));
        // The broken twin: three of the four are not the sum.
        assert!((sum - mean(2)) / mean(4) < 0.999);
    }
}

#[test]
fn one_exposure_holds_for_all_cells_unless_each_is_to_have_its_own() {
    let dir = tempfile::tempdir().expect("temporary folders can be made");
    let args = ["phong-spheres", "--rows", "light.lamp.intensity=0.5,1", "--size", "32x24", "--tone-map", "renormalise"];
    let factors = |report: &Value| [0, 1].map(|i| report["cells"][i]["exposure"].as_f64().expect("a number"));
    let [a, b] = factors(&sheet(dir.path(), &args));
    assert_eq!(a, b);
    let [a, own] = factors(&sheet(dir.path(), &[&args[..], &["--own-exposure"]].concat()));
    assert!(a > own && own == b, "{a} {own} {b}");
}

#[test]
fn what_cannot_be_made_is_said_before_anything_is_drawn() {
    let dir = tempfile::tempdir().expect("temporary folders can be made");
    let many: Vec<String> = (0..30).map(|i| i.to_string()).collect();
    let (rows, columns) = (format!("seed={}", many.join(",")), format!("spp={}", many[1..].join(",")));
    for (args, code, said) in [
        (&["room", "--rows", &rows, "--columns", &columns][..], 1, "400"),
        (&["room", "--rows", "seed=1", "-o", "s.exr"], 1, ".png"),
        (&["room"], 2, "--rows"),
        (&["room", "--rows", "spp=1,2", "--columns", "spp=4,8"], 2, "both change \"spp\""),
        (&["room", "--rows", "ambient=0,[0.1,0.1"], 2, "opens '[' and does not close it"),
        (&["room", "--rows", "ambient=[0.1"], 2, "opens '['"),
        (&["room", "--rows", "methd=raycast"], 1, "\"method\""),
        (&["room", "--rows", "method=raycats"], 1, "raycast"),
        (&["whitted", "--rows", "light.suun.intensity=1"], 1, "light.sun.intensity"),
        (&["--figure", "diffuse-ambiant"], 1, "diffuse-ambient"),
        (&["room", "--rows", "seed=1,2", "--size", "40000x40000"], 1, "larger"),
        (&["room", "--rows", "seed=1,2", "--size", "20000x20000", "--max-memory", "1G"], 1, "--max-memory"),
    ] {
        let output = radiosa(dir.path(), &[&["sheet"], args].concat());
        assert_eq!(output.status.code(), Some(code), "{args:?}: {}", text(&output.stderr));
        assert!(text(&output.stderr).contains(said), "{args:?}: {}", text(&output.stderr));
    }
}

#[test]
fn a_parameter_that_no_cell_looks_at_is_said() {
    let dir = tempfile::tempdir().expect("temporary folders can be made");
    let said = |args: &[&str]| {
        let output = radiosa(dir.path(), &[&["sheet", "whitted", "--size", "8x6", "-o", "s.png"], args].concat());
        assert!(output.status.success(), "{}", text(&output.stderr));
        text(&output.stderr).lines().filter(|l| l.starts_with("warning[no-effect]")).count()
    };
    assert_eq!(said(&["--method", "whitted", "--columns", "interpolation=flat,gouraud"]), 1);
    assert_eq!(
        said(&["--columns", "interpolation=flat,gouraud", "--rows", "method=scanline,whitted"]),
        0,
        "scan line looks at it"
    );
    assert_eq!(said(&["--method", "whitted", "--columns", "spp=1,2", "--cull", "back"]), 1);
}

#[test]
fn a_title_names_the_scene_unless_that_is_what_changes() {
    let dir = tempfile::tempdir().expect("temporary folders can be made");
    let title = |args: &[&str]| sheet(dir.path(), &[args, &["--size", "8x6", "-o", "s.png"]].concat())["title"].clone();
    assert_eq!(title(&["--rows", "scene=furnace,cornell-box", "--columns", "spp=1,2"]), "scene × spp");
    assert_eq!(title(&["furnace", "--columns", "spp=1,2"]), "furnace: spp");
}

#[test]
fn the_help_is_as_it_was_reviewed_and_its_examples_work() {
    let dir = tempfile::tempdir().expect("temporary folders can be made");
    let help = text(&radiosa(dir.path(), &["sheet", "--help"]).stdout);
    let examples: Vec<&str> = help.lines().filter_map(|l| l.strip_prefix("  radiosa ")).collect();
    assert_eq!(examples.len(), 3);
    for example in examples {
        let args: Vec<&str> = example.split(' ').chain(["--size", "16x12"]).collect();
        let output = radiosa(dir.path(), &args);
        assert!(output.status.success(), "{example}: {}", text(&output.stderr));
    }
    insta::assert_snapshot!("sheet-help", help);
}
