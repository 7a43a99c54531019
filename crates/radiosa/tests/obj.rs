//! OBJ and MTL files become the scenes they mean.
#![expect(clippy::print_stderr, reason = "tests say what they skip")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use proptest::prelude::*;
use radiosa::import::{ImportError, Options, Warning, load, load_bytes};
use radiosa::math::{DVec3, Vec2, Vec3};
use radiosa::scene::{AlphaMode, Geometry, Material, Mesh, Model, Phong, PhongLobe, Scene, Wrap};
use radiosa::spectrum::Spectrum;
use radiosa_testkit::{data_dir, shared_dir};

/// Loads text as `main.obj` beside other files in a fresh folder.
fn try_load(obj: impl AsRef<[u8]>, beside: &[(&str, &[u8])]) -> Result<(Scene, Vec<Warning>), ImportError> {
    let folder = tempfile::tempdir().unwrap();
    for (name, content) in beside {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, content).unwrap();
    }
    let main = folder.path().join("main.obj");
    std::fs::write(&main, obj).unwrap();
    load(&main, &Options::default())
}

fn scene(obj: impl AsRef<[u8]>) -> (Scene, Vec<&'static str>) {
    let (scene, warnings) = try_load(obj, &[]).unwrap();
    (scene, warnings.iter().map(|w| w.name).collect())
}

/// The one material of an MTL text, and the names of the warnings about it.
fn material(mtl: &str, beside: &[(&str, &[u8])]) -> (Material, Scene, Vec<&'static str>) {
    let mut files = vec![("m.mtl", mtl.as_bytes())];
    files.extend_from_slice(beside);
    let obj = "mtllib m.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n";
    let (scene, warnings) = try_load(obj, &files).unwrap();
    assert_eq!(scene.materials.len(), 1);
    (scene.materials[0].clone(), scene, warnings.iter().map(|w| w.name).collect())
}

fn phong(mtl: &str) -> Phong {
    match material(&format!("newmtl m\n{mtl}"), &[]).0.model {
        Model::Phong(phong) => phong,
        other => panic!("{other:?}"),
    }
}

/// Twice the area vector of a triangle.
fn cross(mesh: &Mesh, t: &[u32; 3]) -> DVec3 {
    let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
    (b - a).cross(c - a)
}

fn area_vector(mesh: &Mesh) -> DVec3 {
    mesh.triangles.iter().map(|t| cross(mesh, t) * 0.5).sum()
}

fn area(mesh: &Mesh) -> f64 {
    mesh.triangles.iter().map(|t| cross(mesh, t).length() * 0.5).sum()
}

// Geometry.

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

#[test]
fn every_form_of_a_face_is_understood() {
    for face in [
        "f 1 2 3 4",
        "f 1/1 2/2 3/3 4/4",
        "f 1//1 2//1 3//1 4//1",
        "f 1/1/1 2/2/1 3/3/1 4/4/1",
        "f -4 -3 -2 -1",
        "f -4/-4/-1 -3/-3/-1 -2/-2/-1 -1/-1/-1",
        "  f\t1/ 2/ 3// 4 # a comment",
        "f 1 2 \\\n 3 4",
        "f 1 2 \\\r\n 3 4\r\n",
    ] {
        let (scene, warnings) = scene(format!("{SQUARE}vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\n{face}"));
        assert_eq!(warnings, [""; 0], "{face}");
        let mesh = &scene.meshes[0];
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]], "{face}");
        let polygons = mesh.polygons.as_ref().unwrap();
        assert_eq!(
            (&*polygons.offsets, &*polygons.vertices, &*polygons.of_triangle),
            (&[0, 4][..], &[0, 1, 2, 3][..], &[0, 0][..])
        );
        let has_slashes = |n| face.split_whitespace().nth(1).unwrap().split('/').nth(n).is_some_and(|p| !p.is_empty());
        assert_eq!(!mesh.uvs.is_empty(), has_slashes(1), "{face}");
        assert_eq!(mesh.normals.is_some(), has_slashes(2), "{face}");
    }
}

#[test]
fn faces_may_come_before_their_vertices() {
    let (scene, warnings) = scene(format!("f 1 2 3\n{SQUARE}"));
    assert_eq!((scene.n_primitives(), warnings.len()), (1, 0));
}

#[test]
fn texture_coordinates_are_turned_to_the_top_left() {
    let (scene, _) = scene(format!("{SQUARE}vt 0.25 0.125\nvt 1 0\nvt 1 1 0\nf 1/1 2/2 3/3\n"));
    assert_eq!(scene.meshes[0].uvs, [[Vec2::new(0.25, 0.875), Vec2::new(1.0, 1.0), Vec2::new(1.0, 0.0)]]);
}

#[test]
fn corners_are_shared_only_where_everything_agrees() {
    let (scene, _) = scene(format!("{SQUARE}vt 0 0\nvt 1 1\nf 1/1 2/1 3/1\nf 1/1 3/2 4/1\n"));
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 3, 4]]);
    assert_eq!(mesh.positions[2], mesh.positions[3]);
    assert!(mesh.polygons.is_none(), "triangles need no list of polygons");
}

#[test]
fn a_keyholed_polygon_has_its_holes_open() {
    let Some(shared) = shared_dir() else { return eprintln!("skipped: no collection of scenes beside the checkout") };
    let (scene, _) = load(&shared.join("scenes/obj-features/assimp/concave_polygon.obj"), &Options::default()).unwrap();
    let mesh = &scene.meshes[0];
    let polygons = mesh.polygons.as_ref().unwrap();
    let p: Vec<_> = polygons.vertices.iter().map(|&v| mesh.positions[v as usize]).collect();
    assert_eq!((polygons.offsets.len(), p.len()), (2, 66));
    let signed: DVec3 = (0..p.len()).map(|i| (p[i] - p[0]).cross(p[(i + 1) % p.len()] - p[0]) * 0.5).sum();
    // No triangle is turned over or covers another: the sum of areas is the length of the sum of area vectors.
    assert!((area(mesh) - signed.length()).abs() < 1e-9 * signed.length(), "{} {}", area(mesh), signed.length());
    assert!(area_vector(mesh).dot(signed) > 0.0);
}

#[test]
fn a_concave_polygon_in_any_plane_keeps_its_area_and_winding() {
    let l = [[0., 0.], [3., 0.], [3., 1.], [1., 1.], [1., 2.], [0., 2.]];
    for (u, v) in
        [(DVec3::X, DVec3::Y), (DVec3::Y, DVec3::X), (DVec3::new(1., 1., 0.), DVec3::new(0., 1., 1.)), (DVec3::NEG_Z, DVec3::Y)]
    {
        let mut text = String::new();
        for [a, b] in l {
            let p = u * a + v * b;
            text += &format!("v {} {} {}\n", p.x, p.y, p.z);
        }
        let (scene, warnings) = scene(text + "f 1 2 3 4 5 6");
        assert!(warnings.is_empty());
        let expected = u.cross(v) * 4.0;
        let mesh = &scene.meshes[0];
        assert!((area_vector(mesh) - expected).length() < 1e-12, "{:?} {expected:?}", area_vector(mesh));
        assert!((area(mesh) - expected.length()).abs() < 1e-12);
    }
}

#[test]
fn faces_that_cannot_be_seen_are_left_out_with_a_warning() {
    let (scene, warnings) =
        scene(format!("{SQUARE}v nan 0 0\nv 1e400 0 0\nv 1 x 2\nf 1 2\nf 1 1 2\nf 1 2 5\nf 1 2 6\nf 1 2 7\nf 1 2 3\n"));
    assert_eq!(scene.n_primitives(), 1);
    assert_eq!(warnings, ["malformed-number", "short-face", "non-finite-vertex", "degenerate-face"]);
}

#[test]
fn what_is_not_read_is_said_once() {
    let (_, warnings) = scene(format!("{SQUARE}f 1 2 3\nl 1 2\nl 2 3\np 1\ncstype bezier\ncurv 0 1 1 2\nend\nsomething else\n"));
    assert_eq!(warnings, ["ignored-lines-and-points", "ignored-curves", "unknown-statement"]);
}

#[test]
fn vertex_colours_are_decoded_and_default_to_white() {
    let (scene, _) = scene("v 0 0 0\nv 1 0 0 0.5 0 1\nv 0 1 0\nf 1 2 3\n");
    let colors = scene.meshes[0].colors.as_ref().unwrap();
    assert_eq!(colors[0].to_array(), [1.0; 4]);
    assert!((colors[1].x - 0.214_041).abs() < 1e-5, "sRGB 0.5 is 0.214 in linear light: {}", colors[1].x);
    assert_eq!((colors[1].y, colors[1].z, colors[1].w), (0.0, 1.0, 1.0));
}

#[test]
fn utf16_and_utf8_read_the_same() {
    let text = format!("o 1\n{SQUARE}f 1 2 3 4\n");
    let (plain, _) = scene(&text);
    let utf16 = |to: fn(u16) -> [u8; 2]| "\u{feff}".encode_utf16().chain(text.encode_utf16()).flat_map(to).collect::<Vec<u8>>();
    for bytes in [utf16(u16::to_be_bytes), utf16(u16::to_le_bytes), [b"\xef\xbb\xbf", text.as_bytes()].concat()] {
        assert_eq!(scene(bytes).0.meshes, plain.meshes);
    }
}

// Smoothing.

/// Two squares folded along the edge x = 1 at a right angle; the second has two thirds of a turn less there.
const FOLD: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 1 0 -1\nv 1 1 -1\n";

#[test]
fn a_smoothing_group_averages_normals_by_angle() {
    let (scene, _) = scene(format!("{FOLD}s 1\nf 1 2 3 4\nf 2 5 6\nf 2 6 3\n"));
    let mesh = &scene.meshes[0];
    let normals = mesh.normals.as_ref().unwrap();
    let at = |p: DVec3| {
        let all: Vec<Vec3> = (0..mesh.positions.len()).filter(|&i| mesh.positions[i] == p).map(|i| normals[i]).collect();
        assert_eq!(all.len(), 1, "one normal around {p}");
        all[0]
    };
    // Cutting the second square in two triangles must not count it twice: angles, not faces, weigh.
    let both = Vec3::new(1.0, 0.0, 1.0).normalize();
    for (p, n) in [(DVec3::ZERO, Vec3::Z), (DVec3::X, both), (DVec3::new(1., 1., 0.), both), (DVec3::new(1., 0., -1.), Vec3::X)] {
        assert!((at(p) - n).length() < 1e-6, "at {p}: {} instead of {n}", at(p));
    }
}

#[test]
fn normals_break_where_smoothing_groups_meet_and_where_it_is_off() {
    for (first, second, has_normals) in
        [("s 1", "s 2", true), ("s 1", "s off", true), ("s 0", "s 1", true), ("s off", "s 0", false), ("", "", false)]
    {
        let (scene, _) = scene(format!("{FOLD}{first}\nf 1 2 3 4\n{second}\nf 2 5 6 3\n"));
        let mesh = &scene.meshes[0];
        assert_eq!(mesh.normals.is_some(), has_normals, "{first} {second}");
        if let Some(normals) = &mesh.normals {
            assert_eq!(normals.len(), 8, "the edge has two normals at each end");
            for (i, n) in normals.iter().enumerate() {
                let expected = if i < 4 { Vec3::Z } else { Vec3::X };
                assert!((*n - expected).length() < 1e-6);
            }
        }
    }
}

#[test]
fn given_normals_win_over_smoothing_and_the_rest_is_filled_in() {
    let (scene, _) = scene(format!("{FOLD}vn 0 3 4\nvn 0 0 0\nf 1//1 2//1 3//1 4//2\nf 2 5 6 3\n"));
    let normals = scene.meshes[0].normals.as_ref().unwrap();
    let expected = [
        Vec3::new(0.0, 0.6, 0.8),
        Vec3::new(0.0, 0.6, 0.8),
        Vec3::new(0.0, 0.6, 0.8),
        Vec3::Z,
        Vec3::X,
        Vec3::X,
        Vec3::X,
        Vec3::X,
    ];
    assert_eq!(normals.len(), expected.len());
    for (n, e) in normals.iter().zip(expected) {
        assert!((*n - e).length() < 1e-6, "{n} instead of {e}");
    }
}

// Names.

#[test]
fn instances_are_named_by_object_or_group() {
    let names = |text: &str| -> Vec<String> {
        let (scene, _) = scene(format!("{SQUARE}{}", text.replace('F', "f 1 2 3")));
        scene.instances.into_iter().map(|i| i.name).collect()
    };
    assert_eq!(names("F"), ["default"]);
    assert_eq!(names("o a\nF\no b\nF\no a\nF\n"), ["a", "b"], "a name that comes again goes on with its group");
    assert_eq!(names("g front cube\nF\ng back  cube \nF"), ["front cube", "back cube"]);
    assert_eq!(names("o cube\ng cube_material\nF\no sphere\ng sphere_material\nF"), ["cube", "sphere"]);
    assert_eq!(names("o room\ng floor\nF\ng ceiling\nF"), ["room/floor", "room/ceiling"]);
    assert_eq!(names("g nothing\no nothing\ng some\nF\no"), ["nothing"]);
}

#[test]
fn objects_are_parents_of_their_groups() {
    let (scene, _) = scene(format!("{SQUARE}o room\ng floor\nf 1 2 3\ng wall\nf 1 3 4\n"));
    let nodes: Vec<_> = scene.nodes.iter().map(|n| (n.name.as_str(), n.parent.map(|p| p.0))).collect();
    assert_eq!(nodes, [("room", None), ("floor", Some(0)), ("wall", Some(0))]);
    assert_eq!(scene.instances.iter().map(|i| i.node.unwrap().0).collect::<Vec<_>>(), [1, 2]);
}

// Errors.

#[test]
fn errors_say_where_and_show_it() {
    let check = |text: &str, line: (u32, u32), underlined: &str, words: &str| {
        let error = try_load(text, &[]).unwrap_err();
        assert!(error.to_string().contains(words), "{error}");
        assert!(!error.help().is_empty());
        let at = error.location().unwrap();
        assert_eq!(at.line, Some(line), "{text:?}");
        let (excerpt, range) = at.excerpt.clone().unwrap();
        assert_eq!(&excerpt[range.clone()], underlined);
        assert_eq!(excerpt[..range.start].matches('\n').count() as u32 + 1, line.0, "lines can be counted in the excerpt");
        assert!(at.path.ends_with("main.obj"));
    };
    check("v 0 0 0\n\nf 1 0 1\n", (3, 5), "0", "vertex 0");
    check("v 0 0 0\r\n\r\nf 1/1 1 -2/5\r\n", (3, 9), "-2/5", "-2");
    check("v 0 0 0\n# ä\n  f 1 1 \\\n 12//3 1\n", (4, 2), "12//3", "only 1 vertex");
    check("f 1 2 3\n", (1, 3), "1", "vertex 1");
    check("v 0 0 0\nf 1 1 1/a\n", (2, 7), "1/a", "no corner");
    check("v 0 0 0\nf 1 1 1/1/1/1\n", (2, 7), "1/1/1/1", "no corner");
    check("v 0 0 0\nf 1 1 1.5\n", (2, 7), "1.5", "no corner");
    check("\u{fffd}PNG\r\n\u{1a}\n", (1, 1), "\u{fffd}PNG", "no OBJ file");
}

#[test]
fn long_lines_are_shown_in_part() {
    let text = format!("v 0 0 0\nf {} 7 {}", "1 ".repeat(5000), "1 ".repeat(5000));
    let error = try_load(text, &[]).unwrap_err();
    let (excerpt, range) = error.location().unwrap().excerpt.clone().unwrap();
    assert!(excerpt.len() < 400);
    assert_eq!(&excerpt[range], "7");
}

// Materials.

#[test]
fn coefficients_are_read_as_written() {
    let p = phong("Ka 1 1 1\nKd 0.1 0.2 0.3\nKs 0.5\nNs 96\nNi 1.3\nillum 2\n");
    assert_eq!(p.ambient.unwrap().factor, Spectrum::WHITE);
    assert_eq!(p.diffuse.factor, Spectrum::new(0.1, 0.2, 0.3));
    assert_eq!(p.specular.factor, Spectrum::gray(0.5));
    assert_eq!((p.exponent.factor, p.ior, p.lobe), (96.0, 1.3, PhongLobe::BlinnPhong));
    assert_eq!((p.mirror, p.transmission), (Spectrum::BLACK, Spectrum::BLACK));
}

#[test]
fn illumination_models_mean_what_the_format_says() {
    let base = "Kd 0.1 0.1 0.1\nKs 0.25 0.25 0.25\nTf 0.5 1 0.5\nNi 1.5\n";
    let ks = Spectrum::gray(0.25);
    let (through, whole) = (Spectrum::new(0.375, 0.75, 0.375), Spectrum::new(0.5, 1.0, 0.5));
    //                illum  highlight         mirror           transmission     fresnel thin
    for (illum, specular, mirror, transmission, fresnel, thin) in [
        (1, Spectrum::BLACK, Spectrum::BLACK, Spectrum::BLACK, false, false),
        (2, ks, Spectrum::BLACK, Spectrum::BLACK, false, false),
        (3, ks, ks, Spectrum::BLACK, false, false),
        (4, ks, ks, through, false, true),
        (5, ks, ks, Spectrum::BLACK, false, false),
        (6, ks, ks, through, false, false),
        (7, ks, ks, whole, true, false),
        (8, ks, Spectrum::BLACK, Spectrum::BLACK, false, false),
        (9, ks, Spectrum::BLACK, through, false, true),
    ] {
        let p = phong(&format!("{base}illum {illum}\n"));
        assert_eq!((p.specular.factor, p.mirror, p.transmission), (specular, mirror, transmission), "illum {illum}");
        assert_eq!((p.fresnel, p.thin), (fresnel, thin), "illum {illum}");
        assert_eq!(p.schlick, illum == 5, "illum {illum}");
    }
    assert!(material("newmtl m\nKd 1 0 0\nillum 0\n", &[]).0.unlit);
    assert_eq!(phong("Ks 0.5 0.5 0.5\n").specular.factor, Spectrum::gray(0.5), "without illum a highlight counts");
    assert_eq!(phong("Kd 1 1 1\nNs 10\n").specular.factor, Spectrum::BLACK);
}

#[test]
fn what_exporters_write_for_opaque_is_not_taken_for_air() {
    let (m, _, warnings) = material("newmtl m\nillum 4\nKd 0.5 0.5 0.5\nTf 1.00 1.00 1.00\nNi 1.00\n", &[]);
    assert!(matches!(m.model, Model::Phong(p) if p.transmission == Spectrum::BLACK && p.diffuse.factor == Spectrum::gray(0.5)));
    assert_eq!(warnings, ["clear-as-air"]);
}

#[test]
fn opacity_is_coverage_unless_the_material_is_glass() {
    let (m, ..) = material("newmtl m\nd 0.25\n", &[]);
    assert_eq!((m.alpha.mode, m.alpha.value.factor), (AlphaMode::Blend, 0.25));
    let (m, ..) = material("newmtl m\nTr 0.25\n", &[]);
    assert_eq!((m.alpha.mode, m.alpha.value.factor), (AlphaMode::Blend, 0.75));
    let (m, ..) = material("newmtl m\nd 1\nTr 0\n", &[]);
    assert_eq!(m.alpha.mode, AlphaMode::Opaque);
    let (m, _, warnings) = material("newmtl m\nd 0.75\nTr 0.5\n", &[]);
    assert_eq!((m.alpha.value.factor, warnings), (0.5, vec!["contradictory-opacity"]));
    let (m, ..) = material("newmtl m\nd 0.25\nillum 6\n", &[]);
    assert_eq!(m.alpha.mode, AlphaMode::Opaque);
    assert!(matches!(m.model, Model::Phong(p) if p.transmission == Spectrum::gray(0.75)));
}

#[test]
fn odd_values_are_mended_and_said() {
    let (m, _, warnings) =
        material("newmtl m\nKd 2 0.5 -1\nNs -3\nNi 0\nKs a b c\nKe 20 20 20\nillum 12\nfoo 1\nrefl x.png\nPs 1\n", &[]);
    let Model::Phong(p) = m.model else { panic!() };
    assert_eq!(p.diffuse.factor, Spectrum::new(1.0, 0.5, 0.0));
    assert_eq!((p.exponent.factor, p.ior), (1.0, 1.5));
    assert_eq!(m.emission.factor, Spectrum::gray(20.0), "radiance has no upper bound");
    let expected = [
        "negative-colour",
        "unknown-material-statement",
        "ignored-material-statement",
        "malformed-material",
        "unsupported-illum",
        "reflectance-above-one",
        "index-out-of-range",
    ];
    for name in expected {
        assert!(warnings.contains(&name), "{name} is missing in {warnings:?}");
    }
}

#[test]
fn cie_colours_are_converted() {
    let white = phong("Kd xyz 0.9505 1.0 1.089\n").diffuse.factor;
    assert!((white.r - 1.0).abs() < 1e-3 && (white.g - 1.0).abs() < 1e-3 && (white.b - 1.0).abs() < 1e-3, "{white:?}");
    let (m, _, warnings) = material("newmtl m\nKd spectral file.rfl 1\n", &[]);
    assert!(matches!(m.model, Model::Phong(p) if p.diffuse.factor == Spectrum::gray(0.8)));
    assert_eq!(warnings, ["ignored-material-statement"]);
}

#[test]
fn the_physically_based_extension_is_metallic_roughness() {
    let (m, ..) = material("newmtl m\nKd 0.5 0.5 0.5\nPm 0.25\nPr 0.75\n", &[]);
    let Model::MetallicRoughness(p) = m.model else { panic!("{:?}", m.model) };
    assert_eq!((p.base_color.factor, p.metallic.factor, p.roughness.factor), (Spectrum::gray(0.5), 0.25, 0.75));
}

/// An 8-bit RGBA picture of one colour, as PNG.
fn png(color: [u8; 4]) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image::RgbaImage::from_pixel(2, 2, image::Rgba(color)).write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

#[test]
fn pictures_are_read_once_and_used_in_the_right_encoding() {
    let grey = png([128, 128, 128, 255]);
    let mtl = "newmtl m\nKd 1 1 1\nmap_Kd tex/my picture.png\nmap_Ns tex\\my picture.png\nmap_Bump -bm 2 tex/my picture.png\n";
    let (m, scene, warnings) = material(mtl, &[("tex/my picture.png", &grey)]);
    assert_eq!(warnings, [""; 0]);
    assert_eq!((scene.images.len(), scene.textures.len()), (1, 2));
    let Model::Phong(p) = &m.model else { panic!() };
    let texture = |t: radiosa::scene::TextureRef| &scene.textures[t.texture.index()];
    assert!(texture(p.diffuse.texture.unwrap()).is_srgb);
    assert!(!texture(p.exponent.texture.unwrap()).is_srgb);
    let bump = m.normal_map.unwrap();
    assert!(!texture(bump.texture).is_srgb);
    assert_eq!((bump.scale, bump.is_height), (2.0, true));
}

#[test]
fn maps_of_normals_are_told_from_heights() {
    let blue = png([128, 128, 255, 255]);
    let (m, _, warnings) = material("newmtl m\nmap_Bump n.png\n", &[("n.png", &blue)]);
    assert!(!m.normal_map.unwrap().is_height);
    assert_eq!(warnings, ["bump-map-of-normals"]);
    let (m, _, warnings) = material("newmtl m\nnorm n.png\n", &[("n.png", &blue)]);
    assert!(!m.normal_map.unwrap().is_height);
    assert_eq!(warnings, [""; 0]);
}

#[test]
fn texture_options_place_the_picture() {
    let mtl = "newmtl m\nmap_Kd -s 2 4 1 -o 0.5 0.25 -clamp on -blendu off a.png\nmap_d -imfchan g a.png\n";
    let (m, scene, warnings) = material(mtl, &[("a.png", &png([1, 2, 3, 255]))]);
    assert_eq!(warnings, [""; 0]);
    let Model::Phong(p) = &m.model else { panic!() };
    let reference = p.diffuse.texture.unwrap();
    assert_eq!(scene.textures[reference.texture.index()].sampler.wrap_u, Wrap::Clamp);
    // In the file's sense (0.1, 0.2) goes to (2 × 0.1 + 0.5, 4 × 0.2 + 0.25), upwards.
    let uv = reference.transform.unwrap().apply(Vec2::new(0.1, 1.0 - 0.2));
    assert!((uv - Vec2::new(0.7, 1.0 - 1.05)).length() < 1e-6, "{uv}");
    assert_eq!((m.alpha.mode, m.alpha.value.channel), (AlphaMode::Blend, 1));
}

#[test]
fn a_map_of_opacity_uses_the_alpha_channel_where_there_is_one() {
    for (picture, channel) in [(png([9, 9, 9, 255]), 0), (png([9, 9, 9, 100]), 3)] {
        let (m, ..) = material("newmtl m\nmap_d a.png\n", &[("a.png", &picture)]);
        assert_eq!((m.alpha.mode, m.alpha.value.channel), (AlphaMode::Blend, channel));
    }
}

#[test]
fn missing_pictures_leave_the_factor() {
    let (m, _, warnings) =
        material("newmtl m\nmap_Kd none.png\nmap_Ke gone.png\nmap_Ks broken.png\n", &[("broken.png", b"no picture")]);
    let Model::Phong(p) = m.model else { panic!() };
    assert_eq!((p.diffuse.factor, p.diffuse.texture), (Spectrum::gray(0.8), None));
    assert_eq!(m.emission.factor, Spectrum::BLACK, "what is missing does not glow");
    assert_eq!(warnings, ["picture-missing"]);
    let (_, _, warnings) = material("newmtl m\nmap_Kd broken.png\nmap_Ka ../x.png\n", &[("broken.png", b"no picture")]);
    assert_eq!(warnings, ["picture-unreadable", "picture-outside"]);
}

#[test]
fn libraries_are_found_under_odd_names() {
    let mtl = |name: &str| format!("newmtl {name}\nKd 0 0 0\n").into_bytes();
    let obj = |lib: &str, used: &str| format!("mtllib {lib}\nusemtl {used}\n{SQUARE}f 1 2 3\n");
    for (lib, file) in [
        ("a.mtl", "a.mtl"),
        ("my lib.mtl", "my lib.mtl"),
        ("other.mtl my lib.mtl", "my lib.mtl"),
        ("my\\ lib.mtl", "my lib.mtl"),
        ("sub\\a.mtl", "sub/a.mtl"),
        ("/home/someone/a.mtl", "a.mtl"),
        ("renamed.mtl", "main.mtl"),
    ] {
        let (scene, _) = try_load(obj(lib, "red  one"), &[(file, &mtl("red  one"))]).unwrap();
        let Model::Phong(p) = &scene.materials[0].model else { panic!() };
        assert_eq!((scene.materials.len(), p.diffuse.factor), (1, Spectrum::BLACK), "{lib}");
    }
    let (scene, warnings) = try_load(obj("none.mtl", "red"), &[]).unwrap();
    assert_eq!(scene.materials[0], Material { name: "red".into(), ..Material::default() });
    let names: Vec<_> = warnings.iter().map(|w| w.name).collect();
    assert_eq!(names, ["material-library-missing", "unknown-material"]);
}

#[test]
fn triangles_carry_their_materials() {
    let mtl = b"newmtl a\nnewmtl b\nKe 1 2 3\n";
    let obj = format!("mtllib m.mtl\n{SQUARE}f 1 2 3\nusemtl b\nf 1 2 3 4\nusemtl a\nf 1 3 4\n");
    let (scene, _) = try_load(obj, &[("m.mtl", mtl)]).unwrap();
    let materials: Vec<_> = (0..4).map(|t| scene.meshes[0].material_of(t).map(|m| m.0)).collect();
    assert_eq!(materials, [None, Some(1), Some(1), Some(0)]);
    assert_eq!(scene.materials[1].emission.factor, Spectrum::new(1.0, 2.0, 3.0));
}

// Whole files.

#[test]
fn the_cornell_box_has_its_sixteen_surfaces() {
    let folder = data_dir().join("cornell-box");
    let (scene, warnings) = load(&folder.join("cornell-box.obj"), &Options::default()).unwrap();
    assert_eq!(warnings, []);
    let text = std::fs::read_to_string(folder.join("scene.json")).unwrap();
    let truth: serde_json::Value = serde_json::from_str(&text).unwrap();
    let surfaces = truth["surfaces"].as_array().unwrap();
    assert_eq!((surfaces.len(), scene.instances.len()), (16, 16));
    let point = |v: &serde_json::Value| DVec3::from_array(std::array::from_fn(|i| v[i].as_f64().unwrap()));
    for (surface, instance) in surfaces.iter().zip(&scene.instances) {
        assert_eq!(surface["name"], instance.name);
        let (mut expected, mut expected_area) = (DVec3::ZERO, 0.0);
        for polygon in surface["polygons"].as_array().unwrap() {
            let p: Vec<_> = polygon.as_array().unwrap().iter().map(point).collect();
            let vector = (1..p.len() - 1).map(|i| (p[i] - p[0]).cross(p[i + 1] - p[0]) * 0.5).sum::<DVec3>();
            expected += vector;
            expected_area += vector.length();
        }
        let Geometry::Mesh(mesh) = instance.geometry else { panic!() };
        let mesh = &scene.meshes[mesh.index()];
        assert!((area_vector(mesh) - expected).length() < 1e-9 * expected.length(), "{}", instance.name);
        assert!((area(mesh) - expected_area).abs() < 1e-9 * expected_area, "{}", instance.name);
        assert_eq!(mesh.normals, None);
        let material = &scene.materials[mesh.material_of(0).unwrap().index()];
        assert_eq!(surface["material"], material.name);
        let truth = &truth["materials"][&material.name];
        let channels = |v: &serde_json::Value| Spectrum::from(std::array::from_fn(|i| v[i].as_f64().unwrap_or(0.0) as f32));
        assert!(matches!(&material.model, Model::Phong(p) if p.diffuse.factor == channels(&truth["reflectance"])));
        assert_eq!(material.emission.factor, channels(&truth["emission"]));
    }
}

/// Every OBJ of the collection with its row of the index: triangles (fans) and bounding box.
fn collection() -> Option<Vec<(PathBuf, u64, Vec<f64>)>> {
    let Some(shared) = shared_dir() else {
        eprintln!("skipped: no collection of scenes beside the checkout");
        return None;
    };
    let scenes = shared.join("scenes");
    let index = std::fs::read_to_string(scenes.join("INDEX.md")).unwrap();
    let rows = index.lines().filter(|line| line.contains(".obj`")).map(|line| {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        let bounds = cells[4].split_whitespace().filter_map(|w| w.parse().ok()).collect();
        (scenes.join(cells[1].trim_matches('`')), cells[2].parse().unwrap(), bounds)
    });
    Some(rows.collect())
}

fn file_name(path: &Path) -> &str {
    path.file_name().unwrap().to_str().unwrap()
}

#[test]
fn the_collection_loads_with_the_triangles_and_bounds_of_its_index() {
    let Some(files) = collection() else { return };
    assert!(files.len() > 120);
    // Where the index counts otherwise: faces without area or with vertices that are no numbers are left out.
    let left_out: BTreeMap<&str, u64> = [
        ("pandora.obj", 116),
        ("deg_faces.obj", 1),
        ("degenerate_mesh.obj", 1),
        ("inf_nan.obj", 1),
        ("number_formats.obj", 1), // its only face is a line
        ("box_longline.obj", 466), // two faces go around a square a hundred times
    ]
    .into();
    // Faces that refer to vertices that do not exist.
    let refused = ["issue-140-zero-face-idx.obj", "invalid-relative-texture-index.obj", "invalid-relative-vertex-index.obj"];
    let mut n_refused = 0;
    for (path, triangles, bounds) in files {
        let name = file_name(&path);
        match load(&path, &Options::default()) {
            Ok((scene, _)) => {
                let dropped = left_out.get(name).copied().unwrap_or(0);
                assert_eq!(scene.n_primitives() + dropped, triangles, "{name}");
                let Some((lo, hi)) = scene.bounds().filter(|_| dropped == 0 && bounds.len() == 6) else { continue };
                for (ours, theirs) in lo.to_array().into_iter().chain(hi.to_array()).zip(bounds) {
                    // The index has three digits, and counts vertices that no face uses.
                    let unused = ["octagon_preserved.obj", "test_nm.obj", "test_nm_trans.obj"].contains(&name);
                    assert!(unused || (ours - theirs).abs() <= 0.006 * theirs.abs() + 1e-5, "{name}: {ours} {theirs}");
                }
            }
            Err(error) => {
                assert!(refused.contains(&name), "{name}: {error}");
                assert!(error.location().unwrap().line.is_some());
                n_refused += 1;
            }
        }
    }
    assert_eq!(n_refused, refused.len());
}

#[test]
fn tobj_reads_the_same_triangles() {
    let Some(files) = collection() else { return };
    // Concave or self-retracing polygons, of which tobj makes fans that cover too much.
    let concave =
        ["concave_polygon.obj", "space_in_material_name.obj", "box_longline.obj", "octagon.obj", "octagon_preserved.obj"];
    // tobj takes the fourth number of a vertex for the first of the next, and lines for polygons.
    let misread = ["cube-vertex-w-component.obj", "line-prim.obj", "test_lines.obj"];
    let mut n_compared = 0;
    for (path, ..) in files {
        let name = file_name(&path);
        let options = tobj::LoadOptions { triangulate: true, single_index: false, ..Default::default() };
        let Ok((models, _)) = tobj::load_obj(&path, &options) else { continue };
        let Ok((scene, _)) = load(&path, &Options::default()) else { continue };
        let sort = |mut triangles: Vec<[u32; 9]>| {
            triangles.sort_unstable();
            triangles
        };
        let mut theirs = Vec::new();
        for model in &models {
            let p = |i: u32| DVec3::from_array(std::array::from_fn(|k| f64::from(model.mesh.positions[3 * i as usize + k])));
            for t in model.mesh.indices.chunks_exact(3) {
                theirs.push([p(t[0]), p(t[1]), p(t[2])]);
            }
        }
        let mut ours = Vec::new();
        for mesh in &scene.meshes {
            ours.extend(mesh.triangles.iter().map(|t| t.map(|i| mesh.positions[i as usize].as_vec3().as_dvec3())));
        }
        let area = |t: &[DVec3; 3]| (t[1] - t[0]).cross(t[2] - t[0]).length() * 0.5;
        let total = |list: &[[DVec3; 3]]| list.iter().map(area).sum::<f64>();
        if concave.contains(&name) || misread.contains(&name) || theirs.iter().flatten().any(|p| !p.is_finite()) {
            continue;
        }
        assert!((total(&ours) - total(&theirs)).abs() <= 1e-5 * total(&theirs), "{name}: {} {}", total(&ours), total(&theirs));
        if ours.len() == theirs.len() {
            let bits = |list: &[[DVec3; 3]]| {
                sort(list.iter().map(|t| std::array::from_fn(|i| (t[i / 3][i % 3] as f32 + 0.0).to_bits())).collect())
            };
            let (ours, theirs) = (bits(&ours), bits(&theirs));
            let equal = ours.iter().zip(&theirs).filter(|(a, b)| a == b).count();
            if equal == ours.len() {
                n_compared += 1;
            } else {
                eprintln!("{name}: the same area in other triangles");
            }
        }
    }
    assert!(n_compared > 80, "only {n_compared} files were compared triangle by triangle");
}

#[test]
fn hostile_files_load_or_say_why_in_bounded_time() {
    let Some(shared) = shared_dir() else { return eprintln!("skipped: no collection of malformed files beside the checkout") };
    let mut n = 0;
    for entry in std::fs::read_dir(shared.join("hostile/obj")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|e| e == "md") {
            continue;
        }
        let start = std::time::Instant::now();
        if let Err(error) = try_load(std::fs::read(&path).unwrap(), &[]) {
            assert!(error.location().is_some(), "{error}");
        }
        assert!(start.elapsed().as_secs() < 2, "{}", path.display());
        n += 1;
    }
    assert!(n >= 10);
}

#[test]
fn sizes_an_attacker_chooses_do_not_cost_more_than_they_give() {
    let start = std::time::Instant::now();
    let square_again_and_again = format!("{SQUARE}f {}", "1 2 3 4 ".repeat(50_000));
    let crossing: String = (0..3000u64).map(|i| format!("v {} {} 0\n", i * 7919 % 3001, i * 104_729 % 2999)).collect();
    let crossing_often =
        format!("{crossing}{}", format!("f {}\n", (1..=3000).map(|i| format!("{i} ")).collect::<String>()).repeat(20));
    let names: String = (0..100_000).map(|i| format!("g {i}\nf 1 2 3\n")).collect();
    let libraries = format!("{SQUARE}f 1 2 3\nmtllib {}\n", "a ".repeat(500_000));
    let more_libraries = format!("{SQUARE}f 1 2 3\n{}", "mtllib b.mtl c.mtl d e f\n".repeat(20_000));
    let materials = format!("{SQUARE}{}", (0..50_000).map(|i| format!("usemtl {i}\nf 1 2 3\n")).collect::<String>());
    for text in [square_again_and_again, crossing_often, format!("{SQUARE}o x\n{names}"), libraries, more_libraries, materials] {
        scene(text);
    }
    let many: String = (0..50_000).map(|i| format!("newmtl {i}\nmap_Kd {i}.png\nmap_d a.png\nmap_Bump a.png\n")).collect();
    let mut big = std::io::Cursor::new(Vec::new());
    image::RgbaImage::new(2000, 2000).write_to(&mut big, image::ImageFormat::Png).unwrap();
    try_load("mtllib a.mtl\n", &[("a.mtl", many.as_bytes()), ("a.png", &big.into_inner())]).unwrap();
    assert!(start.elapsed().as_secs() < 20, "{:?}", start.elapsed());
}

#[test]
fn files_larger_than_the_memory_allowed_are_refused() {
    let text = SQUARE.repeat(100);
    let options = Options { max_memory: 16_000, ..Options::default() };
    let error = load_bytes(text.as_bytes(), Path::new("nowhere/main.obj"), &options).unwrap_err();
    assert!(matches!(error, ImportError::TooLarge { .. }), "{error}");
    assert!(error.help().contains("--max-memory"));
}

#[test]
fn a_map_of_sixty_thousand_triangles_loads_at_once() {
    let Some(shared) = shared_dir() else { return eprintln!("skipped: no collection of scenes beside the checkout") };
    let path = shared.join("scenes/sauerbraten-pandora/pandora.obj");
    let fastest = (0..3).map(|_| {
        let start = std::time::Instant::now();
        load(&path, &Options::default()).unwrap();
        start.elapsed().as_secs_f64()
    });
    let fastest = fastest.fold(f64::INFINITY, f64::min);
    assert!(fastest < 0.3, "{fastest} s");
}

/// A text that uses everything, to be damaged.
const EVERYTHING: &str = "mtllib m.mtl\no a\nv 0 0 0 1 0 0\nv 1 0 0\nv 1 1 0.5 1\nv 0 1 -1e2\nvt .5 1\nvn 0 0 1\ns 1\nusemtl m\n\
    f 1/1/1 2//1 3/1 4\ng b\nf -4 -3 -2\nl 1 2\nf 1 2 3 4 1 \\\n2 3\ns off\nf 4 3 1\n";
const EVERY_MATERIAL: &str = "newmtl m\nKa 1 1 1\nKd .5 .5 .5\nKs xyz 1 1 1\nTf 1\nNs 10\nNi 1.5\nd -halo 0.5\nTr 0.5\nillum 7\n\
    map_Kd -s 1 2 3 -o 1 -clamp on a b.png\nbump -bm 2 x.png\nmap_d -imfchan m x.png\nPr 0.5\n";

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]

    #[test]
    fn damaged_files_never_panic(
        flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..12),
        cut in any::<prop::sample::Index>(),
        in_material in any::<bool>(),
    ) {
        let damage = |text: &str| {
            let mut bytes = text.as_bytes().to_vec();
            for (at, byte) in &flips {
                let i = at.index(bytes.len());
                bytes[i] = *byte;
            }
            bytes.truncate(cut.index(2 * bytes.len()));
            bytes
        };
        let (obj, mtl) = if in_material {
            (EVERYTHING.as_bytes().to_vec(), damage(EVERY_MATERIAL))
        } else {
            (damage(EVERYTHING), EVERY_MATERIAL.as_bytes().to_vec())
        };
        // What loads has passed the scene's own validation.
        if let Err(error) = try_load(obj, &[("m.mtl", &mtl), ("x.png", &png([1, 2, 3, 4]))]) {
            prop_assert!(error.location().is_some(), "{error}");
            prop_assert!(!error.to_string().is_empty());
        }
    }

    #[test]
    fn any_polygon_is_cut_inside_its_corners(points in prop::collection::vec((-4i32..4, -4i32..4, -1i32..1), 3..12)) {
        let mut text: String = points.iter().map(|(x, y, z)| format!("v {x} {y} {z}\n")).collect();
        text += "f";
        for i in 1..=points.len() {
            text += &format!(" {i}");
        }
        let (scene, _) = try_load(text, &[]).unwrap();
        for mesh in &scene.meshes {
            prop_assert!(mesh.triangles.len() <= points.len() - 2);
            prop_assert!(mesh.triangles.iter().all(|t| cross(mesh, t) != DVec3::ZERO));
        }
    }
}
