//! The scene file: what it can say, what its errors say, and that the built-in scenes are what they claim to be.

use std::path::Path;

use radiosa::import::{self, ImportError, Options, Warning, sample};
use radiosa::math::{DAffine3, DVec3};
use radiosa::scene::{Geometry, Mesh, Model, Projection, Scene};
use radiosa::spectrum::Spectrum;

fn load(folder: &Path, toml: &str) -> Result<(Scene, Vec<Warning>), ImportError> {
    let path = folder.join("scene.toml");
    std::fs::write(&path, toml).expect("temporary file");
    import::load(&path, &Options::default())
}

/// `line:column: message [underlined text] (help)`.
fn error(toml: &str) -> String {
    let folder = tempfile::tempdir().expect("temporary folder");
    let error = load(folder.path(), toml).expect_err("this should not be accepted");
    let Some(at) = error.location() else { panic!("{error} has no place") };
    let (line, column) = at.line.expect("a line");
    let (text, range) = at.excerpt.clone().expect("an excerpt");
    let help = if error.help().is_empty() { String::new() } else { format!(" ({})", error.help()) };
    let message = error.to_string().replace(&folder.path().display().to_string(), "DIR");
    format!("{line}:{column}: {message} [{}]{help}", &text[range])
}

#[test]
fn every_built_in_scene_is_valid_named_and_described() {
    for s in sample::list() {
        let scene = sample::load(s.name).expect(s.name);
        scene.validate().expect(s.name);
        assert_eq!(scene.name, s.name);
        assert!(!scene.cameras.is_empty(), "{} has no camera", s.name);
        assert!(!s.about.is_empty() && !s.about.contains('\n'));
        assert!(s.toml.contains(&format!("about = \"{}\"", s.about)), "{}: file and list describe it differently", s.name);
    }
    assert!(sample::load("no-such-scene").is_none());
    assert_eq!(sample::nearest("cornel-box"), Some("cornell-box"));
    assert_eq!(sample::nearest("zzz"), None);
}

fn normal_of(mesh: &Mesh, triangle: usize) -> DVec3 {
    let [a, b, c] = mesh.triangles[triangle].map(|i| mesh.positions[i as usize]);
    (b - a).cross(c - a).normalize()
}

#[test]
fn the_cornell_box_is_the_measured_one() {
    let text = std::fs::read_to_string(radiosa_testkit::data_dir().join("cornell-box/scene.json")).expect("test data");
    let data: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let scene = sample::load("cornell-box").expect("built in");
    let point = |v: &serde_json::Value| DVec3::from_array(std::array::from_fn(|i| v[i].as_f64().expect("number") * 0.001));
    let color =
        |v: &serde_json::Value| Spectrum::from(std::array::from_fn::<f32, 3, _>(|i| v[i].as_f64().expect("number") as f32));
    let same = |a: DVec3, b: DVec3| (a - b).abs().max_element() < 1e-15;

    let camera = &scene.cameras[0];
    assert!(same(camera.position, point(&data["camera"]["position"])));
    assert!(same(camera.forward(), DVec3::Z));
    assert!(same(camera.basis.y_axis, DVec3::Y));
    let Projection::Perspective { fov_y } = camera.projection else { panic!("perspective") };
    assert_eq!(fov_y, data["camera"]["fov_deg"].as_f64().expect("number").to_radians());

    let surfaces = data["surfaces"].as_array().expect("surfaces");
    assert_eq!(scene.instances.len(), surfaces.len());
    for (instance, surface) in scene.instances.iter().zip(surfaces) {
        assert_eq!(instance.name, surface["name"]);
        assert_eq!(instance.transform, DAffine3::IDENTITY);
        let Geometry::Mesh(mesh) = instance.geometry else { panic!("mesh") };
        let mesh = &scene.meshes[mesh.index()];
        let polygons = mesh.polygons.as_ref().expect("polygons");
        let expected = surface["polygons"].as_array().expect("polygons");
        assert_eq!(polygons.offsets.len(), expected.len() + 1);
        for (i, corners) in expected.iter().enumerate() {
            let corners = corners.as_array().expect("corners");
            let vertices = &polygons.vertices[polygons.offsets[i] as usize..polygons.offsets[i + 1] as usize];
            assert_eq!(vertices.len(), corners.len());
            for (&v, corner) in vertices.iter().zip(corners) {
                assert!(same(mesh.positions[v as usize], point(corner)), "{}", instance.name);
            }
        }
        let material = &scene.materials[mesh.materials[0].expect("material").index()];
        assert_eq!(material.name, surface["material"]);
        let measured = &data["materials"][&material.name];
        let Model::Phong(p) = &material.model else { panic!("matt") };
        assert_eq!(p.diffuse.factor, color(&measured["reflectance"]));
        assert!(p.specular.factor.is_black() && p.mirror.is_black() && p.transmission.is_black());
        let emission = measured.get("emission").map_or(Spectrum::BLACK, color);
        assert_eq!(material.emission.factor, emission);
        assert!(!material.two_sided);
    }
    // The light shines downwards.
    let light = scene.instances.iter().find(|i| i.name == "light").expect("light");
    let Geometry::Mesh(mesh) = light.geometry else { panic!("mesh") };
    assert!(normal_of(&scene.meshes[mesh.index()], 0).y < -0.999);
}

#[test]
fn errors_point_at_the_word_and_suggest_the_nearest_one() {
    let check = |toml: &str, expected: &str| assert_eq!(error(toml), expected, "\nfor:\n{toml}");
    check("[materiel.white]\nlambert = 1", r#"1:2: unknown key "materiel" [materiel] (did you mean "material"?)"#);
    check("[material.white]\n  lamberd = 1", r#"2:3: unknown key "lamberd" [lamberd] (did you mean "lambert"?)"#);
    check(
        "[[shape]]\nmaterial = \"wite\"\nsphere = { radius = 1 }\n[material.white]\nlambert = 1",
        r#"2:12: there is no material "wite" ["wite"] (did you mean "white"?)"#,
    );
    check("quantity = \"photometrik\"", r#"1:12: unknown value "photometrik" ["photometrik"] (did you mean "photometric"?)"#);
    check(
        "[material.a]\ncook_torrance = { fresnel = \"gould\" }",
        r#"2:29: there is no metal "gould" ["gould"] (did you mean "gold"?)"#,
    );
    check("[[shape]]\nsphere = { radius = -1 }", "2:21: -1 is not a number above zero [-1]");
    check("[[shape]]\nsphere = { radius = nan }", "2:21: NaN is out of range: numbers must be finite and at most 1e18 [nan]");
    check("[[shape]]\nsphere = {}", "2:10: the key \"radius\" is missing here [{}]");
    check(
        "[[shape]]\nname = \"x\"",
        "1:1: this is not yet a shape [[[shape]]] (it needs one of: quad, polygons, box, disc, sphere, cylinder, cone, mesh)",
    );
    check(
        "[[shape]]\nsphere = { radius = 1 }\ndisc = { radius = 1 }",
        "1:1: a shape cannot have both `disc` and `sphere` [[[shape]]] (keep one of them)",
    );
    check("[material.a]\nlambert = \"red\"", "2:11: \"red\" is not a colour: a number, [r, g, b] or \"#rrggbb\" [\"red\"]");
    check("[material.a]\nlambert = [1, 2]", "2:11: expected three numbers [r, g, b], found 2 of them [[1, 2]]");
    check(
        "[material.a]\nlambert = true",
        "2:11: invalid type: boolean `true`, expected a colour: a number, [r, g, b] or \"#rrggbb\", or a table [true]",
    );
    check(
        "[[shape]]\nquad = [[0,0,0],[1,0,0],[1,1,0]]",
        "2:8: invalid length 3, expected an array of length 4 [[[0,0,0],[1,0,0],[1,1,0]]]",
    );
    check(
        "[[shape]]\nquad = [[0,0,0],[1,0,0],[2,0,0],[3,0,0]]",
        "2:8: this face has no area: its corners lie on one line or in one place [[[0,0,0],[1,0,0],[2,0,0],[3,0,0]]]",
    );
    check(
        "[[shape]]\nmesh = { positions = [[0,0,0],[1,0,0],[1,1,0]], faces = [[0, 1, 3]] }",
        "2:58: this face names vertex 3, but there are 3 positions, numbered from 0 [[0, 1, 3]]",
    );
    check(
        "[light.sun]\nintensity = 1",
        "1:8: the light \"sun\" does not say where it shines from [sun] (a light needs one of: point, spot, distant, hemispherical, discrete; or `ambient` alone)",
    );
    check(
        "[light.sun]\ndistant = { elevation = 40 }\nattenuation = [1, 0, 0]",
        "3:15: only `point` and `spot` lights are attenuated [[1, 0, 0]] (leave `attenuation` out)",
    );
    check(
        "[camera.a]\nposition = [1, 0, 0]\nlook_at = [1, 0, 0]",
        "1:9: `position` and `look_at` of the camera \"a\" are the same place [a]",
    );
    check(
        "[camera.a]\nposition = [1, 0, 0]\nlook_at = [0, 0, 0]\nfov_y = 180",
        "4:9: 180 is not an angle above 0 and below 180 degrees [180]",
    );
    check(
        "[material.a]\nlike = \"b\"\n[material.b]\nlike = \"a\"",
        "4:8: these materials are like each other in a circle [\"a\"]",
    );
    check("[material.a]\nlambert = { texture = \"wood\" }", "2:23: there is no texture \"wood\" [\"wood\"]");
    check(
        "include = \"room.glb\"",
        "1:11: cannot read DIR/room.glb: No such file or directory (os error 2) [\"room.glb\"] (file names are looked up from the folder of the scene file)",
    );
    check("name =\nup = \"y\"", "1:7: a value is missing after `=` []");
    check("name = room", "1:8: string values must be quoted, expected literal string [room]");
}
