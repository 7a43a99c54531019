//! The scene file: what it can say, what its errors say, and that the built-in scenes are what they claim to be.

use std::path::Path;

use radiosa::import::{self, ImportError, Options, Warning, sample};
use radiosa::math::{CpuPath, DAffine3, DVec3, Ray, Vec2, Vec3};
use radiosa::scene::{
    AlphaMode, Behind, Cone, Distribution, EnvironmentRadiance, Filter, Form, Fresnel, Geometry, InstanceId, LightKind, Material,
    Mesh, Metal, Model, PhongLobe, PhotometricUnit, Projection, Quantity, Scene, Shadowing, TextureSource, Wrap,
};
use radiosa::spectrum::Spectrum;
use radiosa::transport::World;

fn load(folder: &Path, toml: &str) -> Result<(Scene, Vec<Warning>), ImportError> {
    let path = folder.join("scene.toml");
    std::fs::write(&path, toml).expect("temporary file");
    import::load(&path, &Options::default())
}

fn read(toml: &str) -> Scene {
    let folder = tempfile::tempdir().expect("temporary folder");
    match load(folder.path(), toml) {
        Ok((scene, _)) => scene,
        Err(e) => panic!("{} {e} {}", e.location().map(ToString::to_string).unwrap_or_default(), e.help()),
    }
}

fn the_mesh(scene: &Scene) -> &Mesh {
    let [mesh] = scene.meshes.as_slice() else { panic!("one mesh") };
    mesh
}

fn close(a: DVec3, b: DVec3) -> bool {
    (a - b).length() <= 1e-12 * (1.0 + b.length())
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
fn the_closed_built_in_scenes_let_no_ray_out_and_show_their_fronts_inside() {
    for (name, seen_from_behind) in [("room", ["lamp shade"].as_slice()), ("furnace", &[])] {
        let scene = sample::load(name).expect("built in");
        let world = World::prepare(scene, CpuPath::Portable).expect("valid");
        for camera in &world.scene().cameras {
            let eye = (camera.position - world.origin()).as_vec3();
            let n = 20_000;
            for i in 0..n {
                // Directions of a Fibonacci spiral.
                let y = 1.0 - 2.0 * (i as f32 + 0.5) / n as f32;
                let (r, phi) = ((1.0 - y * y).sqrt(), i as f32 * 2.399_963_2);
                let ray = Ray::new(eye, Vec3::new(r * phi.cos(), y, r * phi.sin()));
                let Some(hit) = world.accel().closest(&ray) else {
                    panic!("{name}: a way out from {} along {}", camera.name, ray.dir)
                };
                let surface = world.surface(&ray, &hit);
                let instance = &world.scene().instances[surface.instance.index()].name;
                let is_front = surface.is_front(-ray.dir);
                assert!(
                    is_front || seen_from_behind.contains(&instance.as_str()),
                    "{name}: {instance} from behind, from {}",
                    camera.name
                );
            }
        }
    }
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
        "2:11: expected a colour: a number, [r, g, b] or \"#rrggbb\", or a table, found boolean `true` [true]",
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
    check("environment = 3", "1:15: expected a table, found integer `3` [3]");
    check("[material]\nlambert = 1", "2:11: expected a table, found integer `1` [1]");
    check("[material.a]\nlambert = { texure = \"x\" }", "2:13: unknown key \"texure\" [texure] (did you mean \"texture\"?)");
    check("name =\nup = \"y\"", "1:7: a value is missing after `=` []");
    check("name = room", "1:8: string values must be quoted, expected literal string [room]");
}

#[test]
fn shapes_are_what_their_names_say() {
    // A unit-less check of orientation and closedness: the signed volume of what has an inside, by the divergence theorem.
    let volume = |mesh: &Mesh| -> f64 {
        mesh.triangles.iter().map(|t| t.map(|i| mesh.positions[i as usize])).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
    };
    let area = |mesh: &Mesh| -> f64 {
        mesh.triangles
            .iter()
            .map(|t| t.map(|i| mesh.positions[i as usize]))
            .map(|[a, b, c]| (b - a).cross(c - a).length() / 2.0)
            .sum()
    };
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-9 * b.abs().max(1.0), "{a} instead of {b}");
    let n_polygons = |mesh: &Mesh| mesh.polygons.as_ref().expect("polygons").offsets.len() - 1;

    let scene = read("[[shape]]\nbox = { min = [1, 2, 3], max = [2, 4, 6] }");
    near(volume(the_mesh(&scene)), 6.0);
    assert_eq!((the_mesh(&scene).triangles.len(), n_polygons(the_mesh(&scene))), (12, 6));
    assert_eq!(scene.instances[0].name, "box 1");
    near(volume(the_mesh(&read("[[shape]]\nbox = { min = [1, 2, 3], max = [2, 4, 6], inward = true }"))), -6.0);
    let several = "[[shape]]\nbox = [{ min = [0, 0, 0], max = [1, 1, 1] }, { min = [2, 0, 0], max = [3, 1, 1] }]";
    near(volume(the_mesh(&read(several))), 2.0);

    // A prism over a regular polygon of 64 sides.
    let side = |n: f64| n / 2.0 * (std::f64::consts::TAU / n).sin();
    let scene = read("[[shape]]\ncylinder = { from = [0, 1, 0], to = [0, 1, 3], radius = 2, segments = 64 }");
    near(volume(the_mesh(&scene)), 3.0 * 4.0 * side(64.0));
    assert_eq!(n_polygons(the_mesh(&scene)), 66);
    let normals = the_mesh(&scene).normals.as_ref().expect("smooth");
    for (p, n) in the_mesh(&scene).positions.iter().zip(normals).take(64 * 4) {
        let out = (*p - DVec3::Y) * DVec3::new(1.0, 1.0, 0.0);
        assert!(out.normalize().as_vec3().dot(*n) > 0.999_99);
    }
    let open = "[[shape]]\ncylinder = { from = [0, 0, 0], to = [0, 5, 0], radius = 1, segments = 3, caps = false }";
    near(area(the_mesh(&read(open))), 3.0 * 3f64.sqrt() * 5.0);
    let cone = read("[[shape]]\ncone = { from = [0, 0, 0], to = [3, 0, 0], radius = 2, segments = 100 }");
    near(volume(the_mesh(&cone)), 4.0 * side(100.0));
    let frustum = read("[[shape]]\ncone = { from = [0, 0, 0], to = [0, 3, 0], radius = 2, top_radius = 1, segments = 8 }");
    near(volume(the_mesh(&frustum)), side(8.0) * (4.0 + 2.0 + 1.0));

    // Exact shapes stay exact.
    let scene = read("[[shape]]\nsphere = { center = [1, 2, 3], radius = 0.5 }");
    assert_eq!(scene.instances[0].geometry, Geometry::Sphere);
    let t = scene.instances[0].transform;
    assert!(close(t.transform_point3(DVec3::X), DVec3::new(1.5, 2.0, 3.0)));
    let scene = read("[[shape]]\ndisc = { center = [1, 2, 3], normal = [0, 0, -2], radius = 4 }");
    assert_eq!(scene.instances[0].geometry, Geometry::Disc);
    let t = scene.instances[0].transform;
    assert!(close(t.transform_vector3(DVec3::Y), DVec3::new(0.0, 0.0, -4.0)));
    assert!((t.matrix3.determinant() - 64.0).abs() < 1e-9);

    // Concave polygons are cut right and stay one face.
    let scene = read("[[shape]]\npolygons = [[[0,0,0],[2,0,0],[2,2,0],[1,0.5,0],[0,2,0]]]");
    near(area(the_mesh(&scene)), 2.5);
    assert_eq!((the_mesh(&scene).triangles.len(), n_polygons(the_mesh(&scene))), (3, 1));
    assert!((0..3).all(|t| normal_of(the_mesh(&scene), t).z > 0.99));

    let scene = read(
        "[[shape]]\nname = \"roof\"\n[shape.mesh]\npositions = [[0,0,0],[1,0,0],[1,1,0],[0,1,0],[0.5,0.5,1]]\n\
         faces = [[0,1,4],[1,2,4],[2,3,4],[3,0,4],[3,2,1,0]]\nnormals = [[0,0,2],[0,0,2],[0,0,2],[0,0,2],[0,0,2]]\n\
         uvs = [[0,0],[1,0],[1,1],[0,1],[0.5,0.5]]",
    );
    near(volume(the_mesh(&scene)), 1.0 / 3.0);
    assert_eq!((n_polygons(the_mesh(&scene)), scene.instances[0].name.as_str()), (5, "roof"));
    assert_eq!(the_mesh(&scene).normals.as_ref().expect("given")[0], Vec3::Z);
    assert_eq!(the_mesh(&scene).uvs[0][4], Vec2::splat(0.5));
}

#[test]
fn a_quad_shows_its_picture_upright() {
    let scene = read("[[shape]]\nquad = [[0,0,0],[2,0,0],[2,1,0],[0,1,0]]");
    assert_eq!(the_mesh(&scene).uvs[0], [Vec2::new(0.0, 1.0), Vec2::ONE, Vec2::new(1.0, 0.0), Vec2::ZERO]);
    assert!(normal_of(the_mesh(&scene), 0).z > 0.99);
}

#[test]
fn transforms_are_done_in_order() {
    let placed = |transform: &str, p: DVec3| {
        let scene = read(&format!("[[shape]]\nquad = [[0,0,0],[1,0,0],[1,1,0],[0,1,0]]\ntransform = {transform}"));
        scene.instances[0].transform.transform_point3(p)
    };
    let p = DVec3::new(1.0, 2.0, 3.0);
    assert!(close(placed("{ translate = [10, 0, 0] }", p), DVec3::new(11.0, 2.0, 3.0)));
    assert!(close(placed("{ scale = 2, translate = [10, 0, 0] }", p), DVec3::new(12.0, 4.0, 6.0)));
    assert!(close(placed("[{ translate = [10, 0, 0] }, { scale = [2, 1, 1] }]", p), DVec3::new(22.0, 2.0, 3.0)));
    assert!(close(placed("{ rotate = { axis = [0, 0, 5], degrees = 90 } }", p), DVec3::new(-2.0, 1.0, 3.0)));
    // Around x first, then y, then z.
    assert!(close(placed("{ rotate = [90, 90, 0] }", p), DVec3::new(2.0, -3.0, -1.0)));
    assert!(close(placed("{ matrix = [[0, 1, 0, 5], [1, 0, 0, 6], [0, 0, 1, 7]] }", p), DVec3::new(7.0, 7.0, 10.0)));
    assert!(close(placed("{ look_at = { from = [0, 5, 0], to = [4, 5, 0] } }", DVec3::NEG_Z), DVec3::new(1.0, 5.0, 0.0)));

    let scene = read(
        "[[shape]]\nname = \"chair\"\nquad = [[0,0,0],[1,0,0],[1,1,0],[0,1,0]]\ntransform = { scale = 2 }\n\
         copies = [{ translate = [1, 0, 0] }, [{ translate = [0, 1, 0] }, { scale = 3 }]]",
    );
    assert_eq!(scene.meshes.len(), 1);
    let names: Vec<_> = scene.instances.iter().map(|i| i.name.as_str()).collect();
    assert_eq!(names, ["chair 1", "chair 2"]);
    assert!(close(scene.instances[0].transform.transform_point3(p), DVec3::new(3.0, 4.0, 6.0)));
    assert!(close(scene.instances[1].transform.transform_point3(p), DVec3::new(6.0, 15.0, 18.0)));
}

#[test]
fn up_and_scale_turn_everything_the_file_says() {
    let scene = read(
        r#"
        up = "z"
        scale = 0.01
        [camera.main]
        position = [100, 200, 300]
        direction = [0, 1, 0]
        orthographic_height = 250
        [light.lamp]
        point = [0, 100, 300]
        attenuation = [1, 0.02, 0.0003]
        range = 500
        [light.sun]
        distant = { azimuth = 90, elevation = 0 }
        [light.sky]
        hemispherical = {}
        [[shape]]
        disc = { radius = 100 }
        [[shape]]
        quad = [[0,0,0],[100,0,0],[100,0,200],[0,0,200]]
        "#,
    );
    // x stays east, y was north and is −z, z was up and is y.
    assert!(close(scene.cameras[0].position, DVec3::new(1.0, 3.0, -2.0)));
    assert!(close(scene.cameras[0].forward(), DVec3::NEG_Z));
    assert!(close(scene.cameras[0].basis.y_axis, DVec3::Y));
    let Projection::Orthographic { height } = scene.cameras[0].projection else { panic!("orthographic") };
    assert!((height - 2.5).abs() < 1e-12);
    let LightKind::Point { position, attenuation, range, .. } = scene.lights[0].kind else { panic!("point") };
    assert!(close(position, DVec3::new(0.0, 3.0, -1.0)));
    assert!((attenuation.c1 - 1.0).abs() < 1e-12 && (attenuation.c2 - 2.0).abs() < 1e-9 && (attenuation.c3 - 3.0).abs() < 1e-9);
    assert!((range - 5.0).abs() < 1e-12);
    assert!(matches!(scene.lights[1].kind, LightKind::Distant { to_light, .. } if close(to_light, DVec3::X)));
    assert!(matches!(scene.lights[2].kind, LightKind::Hemispherical { axis, .. } if close(axis, DVec3::Y)));
    assert!(close(scene.instances[0].transform.transform_vector3(DVec3::Y).normalize(), DVec3::Y));
    assert!(close(scene.instances[1].transform.transform_point3(DVec3::new(100.0, 0.0, 200.0)), DVec3::new(1.0, 2.0, 0.0)));
    assert!(close(scene.from_file.transform_point3(DVec3::new(0.0, 100.0, 0.0)), DVec3::NEG_Z));
}

fn material(body: &str) -> Material {
    let scene = read(&format!("[material.m]\n{body}"));
    scene.materials[0].clone()
}

#[test]
fn materials_become_what_they_say() {
    let phong = |body: &str| match material(body).model {
        Model::Phong(p) => p,
        other => panic!("{other:?}"),
    };
    assert_eq!(phong("").diffuse.factor, Spectrum::gray(0.8));
    assert_eq!(phong("lambert = 0.5").diffuse.factor, Spectrum::gray(0.5));
    assert_eq!(phong("lambert = [0.1, 0.2, 0.3]").diffuse.factor, Spectrum::new(0.1, 0.2, 0.3));
    let hex = phong("lambert = \"#ff8000\"").diffuse.factor;
    assert!((hex.r - 1.0).abs() < 1e-6 && (hex.g - 0.215_860_5).abs() < 1e-6 && hex.b == 0.0, "{hex:?}");

    let p = phong(
        "blinn_phong = { ambient = 0.1, diffuse = 0.2, specular = 0.3, exponent = 40, mirror = 0.4, transmission = 0.5, ior = 1.3, \
         fresnel = true, absorption = 0.6, thin = true, priority = 2 }",
    );
    assert_eq!(p.ambient.expect("given").factor, Spectrum::gray(0.1));
    assert_eq!((p.diffuse.factor, p.specular.factor), (Spectrum::gray(0.2), Spectrum::gray(0.3)));
    assert_eq!((p.exponent.factor, p.lobe, p.mirror), (40.0, PhongLobe::BlinnPhong, Spectrum::gray(0.4)));
    assert_eq!((p.transmission, p.ior, p.fresnel, p.thin, p.priority), (Spectrum::gray(0.5), 1.3, true, true, 2));
    assert_eq!(p.absorption, Spectrum::gray(0.6));
    assert_eq!(phong("phong = {}").lobe, PhongLobe::Phong);
    assert_eq!(phong("mirror = 0.9").mirror, Spectrum::gray(0.9));
    assert!(phong("mirror = 0.9").diffuse.factor.is_black());
    let glass = phong("glass = { ior = 1.33, absorption = [1, 2, 3] }");
    assert!(glass.fresnel && !glass.thin && glass.diffuse.factor.is_black());
    assert_eq!((glass.mirror, glass.transmission, glass.ior), (Spectrum::WHITE, Spectrum::WHITE, 1.33));
    assert!(phong("thin_glass = { transmission = 0.9 }").thin);
    let Model::CookTorrance(rough) = material(
        "glass = { ior = 1.4, alpha = 0.2, distribution = \"beckmann\", shadowing = \"smith\", absorption = 3, priority = 2 }",
    )
    .model
    else {
        panic!("rough glass has facets")
    };
    assert_eq!((rough.distribution, rough.shadowing, rough.alpha.factor), (Distribution::Beckmann, Shadowing::Smith, 0.2));
    let behind = Behind { weight: Spectrum::WHITE, absorption: Spectrum::gray(3.0), thin: false, priority: 2 };
    assert_eq!(rough.refraction(), Some((1.4, behind)));
    assert!(rough.diffuse.factor.is_black());

    let cook_torrance = |body: &str| match material(&format!("cook_torrance = {body}")).model {
        Model::CookTorrance(c) => c,
        other => panic!("{other:?}"),
    };
    for (name, metal) in
        [("gold", Metal::Gold), ("copper", Metal::Copper), ("aluminium", Metal::Aluminium), ("silver", Metal::Silver)]
    {
        let c = cook_torrance(&format!("{{ fresnel = \"{name}\" }}"));
        let (n, k) = metal.indices();
        assert_eq!(c.fresnel, Fresnel::Conductor { n, k });
        assert!(c.diffuse.factor.is_black(), "metals have no diffuse part");
    }
    let c = cook_torrance(
        r#"{ diffuse = 0.1, specular = 0.2, alpha = 0.4, distribution = "beckmann", shadowing = "v-cavity", form = "1982" }"#,
    );
    assert_eq!((c.diffuse.factor, c.specular.factor, c.alpha.factor), (Spectrum::gray(0.1), Spectrum::gray(0.2), 0.4));
    assert_eq!((c.distribution, c.shadowing, c.form), (Distribution::Beckmann, Shadowing::VCavity, Form::Paper1982));
    assert_eq!(c.fresnel, Fresnel::Dielectric { ior: 1.5 });
    let c = cook_torrance(r#"{ shadowing = "smith", form = "lecture", fresnel = { f0 = [0.9, 0.8, 0.7] } }"#);
    assert_eq!((c.shadowing, c.form), (Shadowing::Smith, Form::Lecture));
    assert_eq!(c.fresnel, Fresnel::Schlick { f0: Spectrum::new(0.9, 0.8, 0.7) });
    assert_eq!(cook_torrance("{ fresnel = \"none\" }").fresnel, Fresnel::One);
    assert_eq!(cook_torrance("{ fresnel = { ior = 2 } }").fresnel, Fresnel::Dielectric { ior: 2.0 });
    let conductor = cook_torrance("{ fresnel = { n = 0.2, k = 3 } }").fresnel;
    assert_eq!(conductor, Fresnel::Conductor { n: Spectrum::gray(0.2), k: Spectrum::gray(3.0) });

    let Model::MetallicRoughness(m) = material(
        "metallic_roughness = { base_color = 0.5, metallic = 0.1, roughness = 0.2, ior = 1.4, specular = 0.3, specular_color = 0.4, \
         transmission = 0.6, absorption = 0.7, thick = true }",
    )
    .model
    else {
        panic!("metallic-roughness")
    };
    assert_eq!((m.base_color.factor, m.metallic.factor, m.roughness.factor), (Spectrum::gray(0.5), 0.1, 0.2));
    assert_eq!((m.ior, m.specular.factor, m.specular_color.factor), (1.4, 0.3, Spectrum::gray(0.4)));
    assert_eq!((m.transmission.factor, m.absorption, m.thick), (0.6, Spectrum::gray(0.7), true));

    let m = material("emission = [17, 12, 4]\ntwo_sided = true\nopacity = 0.25\nunlit = true");
    assert_eq!(m.emission.factor, Spectrum::new(17.0, 12.0, 4.0));
    assert!(m.two_sided && m.unlit);
    assert_eq!((m.alpha.mode, m.alpha.value.factor), (AlphaMode::Blend, 0.25));
    let m = material("opacity = 0.25\nalpha = \"mask\"\nalpha_cutoff = 0.2");
    assert_eq!(m.alpha.mode, AlphaMode::Mask { cutoff: 0.2 });

    // A material like another, given before it is defined, and in the order of the file.
    let scene = read("[material.b]\nlike = \"a\"\nemission = 1\n[material.a]\nlambert = 0.3\ntwo_sided = true");
    let names: Vec<_> = scene.materials.iter().map(|m| m.name.as_str()).collect();
    assert_eq!(names, ["b", "a"]);
    assert_eq!(scene.materials[0].model, scene.materials[1].model);
    assert!(scene.materials[0].two_sided && scene.materials[1].emission.factor.is_black());
}

#[test]
fn textures_are_colours_or_numbers_by_their_use() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let mut png = Vec::new();
    {
        let mut encoder = png::Encoder::new(&mut png, 2, 1);
        encoder.set_color(png::ColorType::Rgb);
        encoder.write_header().expect("header").write_image_data(&[255, 0, 0, 0, 0, 255]).expect("data");
    }
    std::fs::write(folder.path().join("t.png"), png).expect("temporary file");
    let toml = r#"
        [texture.t]
        file = "t.png"
        wrap = "clamp"
        filter = "nearest"
        [texture.c]
        checker = { even = 0.1, odd = [0.2, 0.3, 0.4], squares = [8, 4] }
        [material.a]
        lambert = { texture = "t", color = 0.5, uv_set = 1, uv_scale = [2, 3], uv_offset = [0.25, 0] }
        opacity = { texture = "t" }
        normal_map = { texture = "t", scale = 0.5, height = true }
        [material.b]
        metallic_roughness = { roughness = { texture = "t", value = 0.7 }, metallic = { texture = "t", channel = "alpha" } }
        emission = { texture = "c", color = 10 }
    "#;
    let (scene, warnings) = load(folder.path(), toml).expect("right");
    assert!(warnings.is_empty());
    assert_eq!(scene.images.len(), 1);
    let Model::Phong(p) = &scene.materials[0].model else { panic!("matt") };
    let diffuse = p.diffuse.texture.expect("textured");
    assert_eq!((p.diffuse.factor, diffuse.uv_set), (Spectrum::gray(0.5), 1));
    assert_eq!(diffuse.transform.expect("transformed").apply(Vec2::ONE), Vec2::new(2.25, 3.0));
    let color = &scene.textures[diffuse.texture.index()];
    assert!(color.is_srgb && color.sampler.wrap_u == Wrap::Clamp && color.sampler.filter == Filter::Nearest);
    let opacity = scene.materials[0].alpha.value;
    assert_eq!((opacity.factor, opacity.channel), (1.0, 3));
    assert!(!scene.textures[opacity.texture.expect("textured").texture.index()].is_srgb);
    let normal = scene.materials[0].normal_map.expect("normal map");
    assert!(normal.is_height && normal.scale == 0.5 && normal.texture.texture == opacity.texture.expect("textured").texture);
    let Model::MetallicRoughness(m) = &scene.materials[1].model else { panic!("metallic-roughness") };
    assert_eq!((m.roughness.factor, m.roughness.channel, m.metallic.channel), (0.7, 1, 3));
    let checker = &scene.textures[scene.materials[1].emission.texture.expect("textured").texture.index()];
    assert_eq!(
        checker.source,
        TextureSource::Checker { even: Spectrum::gray(0.1), odd: Spectrum::new(0.2, 0.3, 0.4), scale: Vec2::new(8.0, 4.0) }
    );
    assert_eq!(scene.materials[1].emission.factor, Spectrum::gray(10.0));

    let map = "[environment]\nmap = \"t.png\"\nscale = 2\nrotation = 90\nvisible = false\nn_directions = 16";
    let (scene, _) = load(folder.path(), map).expect("right");
    let e = scene.environment.expect("environment");
    assert!(matches!(e.radiance, EnvironmentRadiance::Map(_)));
    assert_eq!((e.scale, e.visible, e.n_directions), (Spectrum::gray(2.0), false, 16));
    assert!(close(e.rotation * DVec3::NEG_Z, DVec3::NEG_X), "counter-clockwise seen from above");
}

#[test]
fn lights_and_cameras_become_what_they_say() {
    let scene = read(
        r#"
        quantity = "photometric"
        background = [0.1, 0.2, 0.3]
        ambient = 0.25
        [environment]
        radiance = 3
        scale = [1, 2, 3]
        [light.fill]
        ambient = 0.1
        [light.bulb]
        point = [1, 2, 3]
        diffuse = 2
        specular = 3
        ambient = 4
        attenuation = [1, 2, 3]
        [light.lamp]
        point = [1, 2, 3]
        unit = "physical"
        intensity = 100
        range = 7
        [light.classic-spot]
        spot = { position = [0, 2, 0], look_at = [0, 0, 0], cutoff = 30, exponent = 5 }
        [light.smooth-spot]
        spot = { position = [0, 2, 0], direction = [0, -3, 0], inner = 10, outer = 45 }
        [light.sun]
        distant = { to_light = [0, 2, 0] }
        unit = "physical"
        intensity = 1e5
        [light.south]
        distant = { azimuth = 180, elevation = 30 }
        [light.sky]
        hemispherical = { axis = [1, 0, 0], down = 0.1 }
        intensity = 0.7
        [light.set]
        discrete = [{ to_light = [0, 0, 2], intensity = 0.5 }, { to_light = [1, 0, 0] }]
        [camera.main]
        position = [0, 1, 5]
        look_at = [0, 1, 0]
        fov_y = 60
        aspect = 1.5
        [camera.default]
        position = [0, 1, 5]
        direction = [1, 0, 0]
        up = [0, 0, 1]
        [camera.round]
        position = [0, 1, 5]
        direction = [1, 0, 0]
        panoramic = true
        "#,
    );
    assert_eq!(scene.quantity, Quantity::Photometric);
    assert_eq!((scene.background, scene.ambient), (Spectrum::new(0.1, 0.2, 0.3), Spectrum::gray(0.25)));
    assert_eq!(scene.environment.as_ref().expect("given").scale, Spectrum::new(3.0, 6.0, 9.0));
    let names: Vec<_> = scene.lights.iter().map(|l| l.name.as_str()).collect();
    assert_eq!(
        names,
        ["fill", "bulb", "lamp", "classic-spot", "smooth-spot", "sun", "south", "sky", "set"],
        "in the file's order"
    );
    let [fill, bulb, lamp, classic, smooth, sun, south, sky, set] = scene.lights.as_slice() else { panic!("nine") };
    assert!(fill.kind == LightKind::Ambient && fill.ambient == Spectrum::gray(0.1) && fill.diffuse.is_black());
    assert_eq!((bulb.ambient, bulb.diffuse, bulb.specular), (Spectrum::gray(4.0), Spectrum::gray(2.0), Spectrum::gray(3.0)));
    let LightKind::Point { unit: PhotometricUnit::Classic, attenuation, range, .. } = bulb.kind else { panic!("{bulb:?}") };
    assert_eq!((attenuation.c1, attenuation.c2, attenuation.c3, range), (1.0, 2.0, 3.0, f64::INFINITY));
    assert!(matches!(lamp.kind, LightKind::Point { unit: PhotometricUnit::Physical, range: 7.0, .. }));
    assert_eq!(lamp.specular, Spectrum::gray(100.0));
    let LightKind::Spot { axis, cone, .. } = classic.kind else { panic!("{classic:?}") };
    assert!(close(axis, DVec3::NEG_Y));
    assert_eq!(cone, Cone::Classic { exponent: 5.0, cutoff: 30f64.to_radians() });
    let LightKind::Spot { cone, .. } = smooth.kind else { panic!("{smooth:?}") };
    assert_eq!(cone, Cone::Gltf { inner: 10f64.to_radians(), outer: 45f64.to_radians() });
    assert!(matches!(sun.kind, LightKind::Distant { to_light, unit: PhotometricUnit::Physical } if to_light == DVec3::Y));
    let LightKind::Distant { to_light, .. } = south.kind else { panic!("{south:?}") };
    assert!(close(to_light, DVec3::new(0.0, 0.5, 0.75f64.sqrt())), "south is +z");
    assert!(matches!(sky.kind, LightKind::Hemispherical { axis, down } if axis == DVec3::X && down == Spectrum::gray(0.1)));
    assert_eq!(sky.diffuse, Spectrum::gray(0.7));
    let LightKind::Discrete { directions } = &set.kind else { panic!("{set:?}") };
    assert_eq!(
        (directions[0].to_light, directions[0].intensity, directions[1].intensity),
        (DVec3::Z, Spectrum::gray(0.5), Spectrum::WHITE)
    );

    let [main, default, round] = scene.cameras.as_slice() else { panic!("three") };
    assert_eq!((main.projection, main.aspect), (Projection::Perspective { fov_y: 60f64.to_radians() }, Some(1.5)));
    assert!(close(main.forward(), DVec3::NEG_Z));
    assert_eq!(default.projection, Projection::Perspective { fov_y: 45f64.to_radians() });
    assert!(close(default.basis.y_axis, DVec3::Z));
    assert_eq!(round.projection, Projection::Panoramic);
}

#[test]
fn included_files_are_placed_changed_and_kept_apart() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("temporary file");
    write(
        "part.toml",
        r#"
        [material.wood]
        lambert = 0.4
        [material.steel]
        lambert = 0.6
        [[shape]]
        name = "top"
        material = "wood"
        quad = [[0,0,0],[1,0,0],[1,1,0],[0,1,0]]
        [[shape]]
        name = "leg left"
        material = "steel"
        sphere = { radius = 1 }
        [[shape]]
        name = "leg right"
        quad = [[0,0,0],[1,0,0],[1,1,0],[0,1,0]]
        [light.lamp]
        point = [0, 1, 0]
        attenuation = [1, 1, 0]
        [camera.view]
        position = [0, 0, 5]
        look_at = [0, 0, 0]
        "#,
    );
    write("part.obj", "o one\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let toml = r#"
        scale = 0.5
        [material.red]
        lambert = [1, 0, 0]
        [material.plain]
        lambert = 0.1
        [[include]]
        file = "part.toml"
        transform = { scale = 2, translate = [4, 0, 0] }
        default_material = "plain"
        [include.material]
        "wood" = { like = "red" }
        "st*" = { emission = 5 }
        [include.object."leg left"]
        hidden = true
        [[include]]
        file = "part.obj"
        up = "z"
        scale = 0.1
        [[include]]
        file = "part.toml"
        lights = false
        cameras = false
        [include.object."leg*"]
        material = "red"
    "#;
    let (scene, _) = load(folder.path(), toml).expect("right");
    let names: Vec<_> = scene.instances.iter().map(|i| i.name.as_str()).collect();
    assert_eq!(names, ["top", "leg right", "one", "top", "leg left", "leg right"]);
    let of = |i: u32| &scene.materials[scene.material_of(InstanceId(i), 0).expect("a material").index()];
    let diffuse = |m: &Material| match &m.model {
        Model::Phong(p) => p.diffuse.factor,
        _ => panic!("matt"),
    };
    assert_eq!((of(0).name.as_str(), diffuse(of(0))), ("wood", Spectrum::new(1.0, 0.0, 0.0)));
    assert_eq!(of(1).name, "plain");
    assert_eq!((of(3).name.as_str(), diffuse(of(3))), ("wood", Spectrum::gray(0.4)), "the second time it is untouched");
    assert_eq!((of(4).name.as_str(), of(5).name.as_str()), ("red", "red"));
    let steel: Vec<_> = scene.materials.iter().filter(|m| m.name == "steel").map(|m| m.emission.factor).collect();
    assert_eq!(steel, [Spectrum::gray(5.0), Spectrum::BLACK]);

    // Metres come in as metres; the transform is in this file's half metres.
    assert!(close(scene.instances[0].transform.transform_point3(DVec3::ONE), DVec3::new(4.0, 2.0, 2.0)));
    assert!(close(scene.instances[3].transform.transform_point3(DVec3::ONE), DVec3::ONE));
    assert!(close(scene.instances[2].transform.transform_point3(DVec3::new(0.0, 1.0, 0.0)), DVec3::new(0.0, 0.0, -0.1)));
    assert_eq!((scene.lights.len(), scene.cameras.len()), (1, 1));
    let LightKind::Point { position, attenuation, .. } = scene.lights[0].kind else { panic!("point") };
    assert!(close(position, DVec3::new(2.0, 2.0, 0.0)));
    assert!((attenuation.c2 - 0.5).abs() < 1e-12, "twice the size, half the falloff per metre");
    assert!(close(scene.cameras[0].position, DVec3::new(2.0, 0.0, 10.0)));
    assert_eq!(scene.sources.len(), 4);

    // Shorter forms.
    assert_eq!(load(folder.path(), "include = \"part.obj\"").expect("right").0.instances.len(), 1);
    assert_eq!(load(folder.path(), "include = [\"part.obj\", { file = \"part.obj\" }]").expect("right").0.instances.len(), 2);

    let fails = |toml: &str| {
        let e = load(folder.path(), toml).expect_err("wrong");
        format!("{} {e} ({})", e.location().and_then(|l| l.line).map_or(0, |l| l.0), e.help())
    };
    let e = fails("[[include]]\nfile = \"part.toml\"\n[include.material.wod]\nlambert = 1");
    assert_eq!(e, "3 \"part.toml\" has no material \"wod\" (did you mean \"wood\"?)");
    let e = fails("[[include]]\nfile = \"part.toml\"\n[include.object.\"leg lift\"]\nhidden = true");
    assert_eq!(e, "3 \"part.toml\" has no object \"leg lift\" (did you mean \"leg left\"?)");
    write("part.xyz", "");
    let e = fails("include = \"part.xyz\"");
    assert_eq!(e, "1 \"part.xyz\" is not a scene of a known format (files that can be included end in .toml, .obj, .gltf, .glb)");
}

#[test]
fn scene_files_that_include_each_other_in_a_circle_or_without_end_are_refused() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let fails = |toml: &str| load(folder.path(), toml).expect_err("wrong").to_string();
    assert!(fails("include = \"scene.toml\"").contains("includes itself"));
    std::fs::write(folder.path().join("a.toml"), "include = \"./b.toml\"").expect("temporary file");
    std::fs::write(folder.path().join("b.toml"), "include = \"a.toml\"").expect("temporary file");
    assert!(fails("include = \"a.toml\"").contains("includes itself"));
    for i in 0..12 {
        std::fs::write(folder.path().join(format!("d{i}.toml")), format!("include = \"d{}.toml\"", i + 1))
            .expect("temporary file");
    }
    assert!(fails("include = \"d0.toml\"").contains("deep"));
    // Ten includes of ten includes of … would be a million files.
    for i in 0..6 {
        let text = format!("include = [{}]", vec![format!("\"w{}.toml\"", i + 1); 10].join(", "));
        std::fs::write(folder.path().join(format!("w{i}.toml")), text).expect("temporary file");
    }
    std::fs::write(folder.path().join("w6.toml"), "").expect("temporary file");
    assert!(fails("include = \"w0.toml\"").contains("more than 1000 scene files"));
}

#[test]
fn files_and_what_they_include_stay_within_the_memory_allowed() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let fails = |toml: &str, max_memory: u64| {
        let path = folder.path().join("scene.toml");
        std::fs::write(&path, toml).expect("temporary file");
        import::load(&path, &Options { max_memory, ..Options::default() }).err().map(|e| e.to_string())
    };
    let round = "[[shape]]\ncylinder = { from = [0,0,0], to = [0,1,0], radius = 1, segments = 1024 }\n";
    assert_eq!(fails(round, 1 << 20), None);
    let many = fails(&round.repeat(40), 4 << 20).expect("too much");
    assert!(many.contains("more than the 4 MiB allowed"), "{many}");
    let long = fails(&format!("about = \"{}\"", "x".repeat(100_000)), 1 << 20).expect("too long");
    assert!(long.contains("reading"), "{long}");
    std::fs::write(folder.path().join("part.toml"), round).expect("temporary file");
    let included = fails(&format!("include = [{}]", vec!["\"part.toml\""; 40].join(",")), 4 << 20).expect("too much");
    assert!(included.contains("more than the 4 MiB allowed"), "{included}");
}

#[test]
fn light_in_two_quantities_is_a_warning_and_unsaid_quantity_is_that_of_what_is_included() {
    let folder = tempfile::tempdir().expect("temporary folder");
    std::fs::write(folder.path().join("lamp.toml"), "quantity = \"photometric\"\n[light.a]\npoint = [0, 1, 0]")
        .expect("temporary file");
    let (scene, warnings) = load(folder.path(), "include = \"lamp.toml\"").expect("right");
    assert_eq!(scene.quantity, Quantity::Photometric);
    assert!(warnings.is_empty());
    let (scene, warnings) = load(folder.path(), "quantity = \"radiometric\"\ninclude = \"lamp.toml\"").expect("right");
    assert_eq!(scene.quantity, Quantity::Radiometric);
    assert_eq!(warnings.iter().map(|w| w.name).collect::<Vec<_>>(), ["mixed-quantities"]);
}

#[test]
fn hostile_files_are_refused_or_read_but_nothing_worse() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let nested = |open: &str, close: &str| format!("name = {}1{}", open.repeat(100_000), close.repeat(100_000));
    let mut hostile = vec![
        nested("[", "]"),
        nested("{ a = ", "}"),
        format!("{}x = 1", "a.".repeat(100_000)),
        format!("[{}a]", "a.".repeat(100_000)),
        "[[shape]]\n".repeat(50_000),
        format!("[[shape]]\nquad = {}", "[".repeat(1000)),
        "scale = 1e308".into(),
        "scale = 9999999999999999999999999999999999999999".into(),
        "[[shape]]\nsphere = { radius = 1e18 }\ntransform = [{ scale = 1e9 }, { scale = 1e9 }, { scale = 1e9 }]".into(),
        "[[shape]]\ncylinder = { from = [0,0,0], to = [0,1,0], radius = 1, segments = 1e15 }".into(),
        "[[shape]]\nmesh = { positions = [], faces = [[4294967295, 0, 1]] }".into(),
        "[[shape]]\nmesh = { positions = [[0,0,0]], faces = [[-1, 0, 1]] }".into(),
        "[[shape]]\nmesh = { positions = [[0,0,0]], faces = [[0, 0, 0]] }".into(),
        "[camera.a]\nposition = [nan, 0, 0]\nlook_at = [inf, 0, 0]".into(),
        "[material.a]\nlambert = 1979-05-27T07:32:00Z".into(),
        "include = \"/dev/zero\"".into(),
        "include = \".\"".into(),
        "include = \"\"".into(),
        "\u{0}".into(),
        "name = \"\\uD800\"".into(),
        String::new(),
        "\u{feff}name = \"bom\"".into(),
    ];
    hostile.push(format!(
        "[[shape]]\npolygons = [[{}]]",
        (0..5000).map(|i| format!("[{i}, {}, 0]", i % 7)).collect::<Vec<_>>().join(",")
    ));
    let comb = (0..2000).map(|i| format!("[{}, {}, 0]", i, if i % 2 == 0 { 0 } else { 100 }));
    hostile.push(format!("[[shape]]\npolygons = [[[2000, -1, 0], [0, -1, 0], {}]]", comb.collect::<Vec<_>>().join(",")));
    let started = std::time::Instant::now();
    for toml in &hostile {
        let start: String = toml.chars().take(60).collect();
        match load(folder.path(), toml) {
            Ok((scene, _)) => scene.validate().expect("what is read is right"),
            Err(e) => assert!(!e.to_string().is_empty(), "{start}"),
        }
    }
    assert!(load(folder.path(), &hostile[hostile.len() - 3]).is_ok(), "a byte order mark is no error");
    std::fs::write(folder.path().join("latin.toml"), b"name = \"caf\xe9\"").expect("temporary file");
    let e = import::load(&folder.path().join("latin.toml"), &Options::default()).expect_err("not UTF-8");
    assert_eq!(e.location().and_then(|l| l.line), Some((1, 12)));
    // Every one takes milliseconds; this says only that none of them hangs.
    assert!(started.elapsed().as_secs() < 60);

    // Cutting a right file anywhere, or breaking one byte of it, never does worse than an error.
    let whole = sample::get("whitted").expect("built in").toml;
    for end in (0..whole.len()).filter(|&i| whole.is_char_boundary(i)).step_by(17) {
        let _ = load(folder.path(), &whole[..end]);
    }
    for i in (0..whole.len()).step_by(13) {
        let mut bytes = whole.as_bytes().to_vec();
        bytes[i] = b"[]{}=,\".#\n9"[i % 11];
        std::fs::write(folder.path().join("broken.toml"), bytes).expect("temporary file");
        if let Ok((scene, _)) = import::load(&folder.path().join("broken.toml"), &Options::default()) {
            scene.validate().expect("what is read is right");
        }
    }
}

/// Write the file anew with `RADIOSA_UPDATE_SCHEMA=1 cargo test --release -p radiosa --test scene_file schema`.
#[test]
fn the_schema_in_the_book_is_the_one_of_the_reader() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/scene-file.schema.json");
    let schema = serde_json::to_string_pretty(&import::scene_file_schema()).expect("JSON") + "\n";
    if std::env::var_os("RADIOSA_UPDATE_SCHEMA").is_some() {
        std::fs::write(&path, &schema).expect("docs/scene-file.schema.json");
    }
    let kept = std::fs::read_to_string(&path).expect("docs/scene-file.schema.json");
    assert!(kept == schema, "docs/scene-file.schema.json is out of date: run this test with RADIOSA_UPDATE_SCHEMA=1");
}

/// Every key of every table of the schema.
fn keys(value: &serde_json::Value, found: &mut std::collections::BTreeMap<String, bool>) {
    if let Some(object) = value.as_object() {
        if let Some(properties) = object.get("properties").and_then(|p| p.as_object()) {
            for (name, property) in properties {
                *found.entry(name.clone()).or_insert(true) &= property.get("description").is_some();
            }
        }
        object.values().for_each(|v| keys(v, found));
    } else if let Some(array) = value.as_array() {
        array.iter().for_each(|v| keys(v, found));
    }
}

#[test]
fn every_key_is_described_in_the_schema_and_in_the_book() {
    let book = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/scene-file.md")).expect("the book");
    let mut found = std::collections::BTreeMap::new();
    keys(&import::scene_file_schema(), &mut found);
    assert!(found.len() > 80, "{}", found.len());
    for (key, described) in found {
        assert!(described, "{key} has no description");
        assert!(key == "$schema" || book.contains(&format!("`{key}`")), "docs/scene-file.md does not mention `{key}`");
    }
}

#[test]
fn every_example_in_the_book_is_right() {
    let book = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/scene-file.md")).expect("the book");
    let examples: Vec<&str> = book.split("```toml\n").skip(1).filter_map(|rest| rest.split("```").next()).collect();
    assert!(examples.len() >= 5);
    let folder = tempfile::tempdir().expect("temporary folder");
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("temporary file");
    write("room.obj", "mtllib room.mtl\no Lamp\nusemtl Wall\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    write("room.mtl", "newmtl Wall\nKd 0.5 0.5 0.5\n");
    let mut png = Vec::new();
    {
        let mut encoder = png::Encoder::new(&mut png, 1, 1);
        encoder.set_color(png::ColorType::Rgb);
        encoder.write_header().expect("header").write_image_data(&[255, 0, 0]).expect("data");
    }
    for name in ["wood.png", "bumps.png", "sky.hdr"] {
        std::fs::write(folder.path().join(name), &png).expect("temporary file");
    }
    for example in examples {
        if let Err(e) = load(folder.path(), example) {
            panic!("{e} at {} in:\n{example}", e.location().map(ToString::to_string).unwrap_or_default());
        }
    }
}

#[test]
fn every_room_loads_with_light_and_cameras_inside_its_bounds() {
    if radiosa_testkit::shared_dir().is_none() {
        #[expect(clippy::print_stderr, reason = "a test says what it skips")]
        {
            eprintln!("skipped: the collected scenes are not beside the checkout");
        }
        return;
    }
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/rooms");
    let mut n = 0;
    for entry in std::fs::read_dir(folder).expect("scenes/rooms") {
        let path = entry.expect("a file").path();
        let (scene, _) = import::load(&path, &Options::default()).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        let emits = scene.materials.iter().any(|m| !m.emission.factor.is_black());
        assert!(emits || !scene.lights.is_empty() || scene.environment.is_some(), "{} has no light", path.display());
        assert!((2..=3).contains(&scene.cameras.len()), "{} has {} cameras", path.display(), scene.cameras.len());
        let (lo, hi) = scene.bounds().expect("something to see");
        for camera in &scene.cameras {
            let p = camera.position;
            assert!(
                p.cmpge(lo).all() && p.cmple(hi).all() || path.ends_with("house-lightmap.toml"),
                "{}: {}",
                path.display(),
                camera.name
            );
        }
        n += 1;
    }
    assert_eq!(n, 8);
}
