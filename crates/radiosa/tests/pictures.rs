//! Pictures come back from files as they were written, by us and by others.

#![expect(clippy::print_stderr, reason = "a test says what it skips and what it measured")]

use std::path::{Path, PathBuf};

use radiosa::export::image::{self, ExrDepth, Format, Options, PngDepth, Recipe};
use radiosa::film::tone_map::{Curve, Exposure, ToneMap};
use radiosa::film::{Film, Layer, Pixel};
use radiosa::import::{Location, decode_picture};
use radiosa::math::Vec3;
use radiosa::scene::{Image, Pixels};
use radiosa::spectrum::Spectrum;
use radiosa_testkit::shared_dir;

const ALLOWED: u64 = 1 << 30;

fn recipe() -> Recipe {
    Recipe::new()
        .with("version", "0.1.0")
        .with("command", "radiosa render \"a b.glb\" \\ -o x.png\nsecond line")
        .with("scene", "Küche → room")
        .with("seed", "7")
        .with("view", "-vtv -vp 0 1 5 -vd 0 0 -1 -vu 0 1 0 -vh 40 -vv 40")
}

/// A picture whose every channel differs, with values from tiny to bright.
fn film(width: u32, height: u32) -> Film {
    let mut film = Film::new(width, height, &Layer::ALL).unwrap();
    for y in 0..height {
        for x in 0..width {
            let k = (y * width + x) as f32;
            let s = |i: f32| Spectrum::new(k * 0.01 + i, 0.5 / (k + 1.0), i * i * 20.0);
            let pixel = Pixel {
                color: s(1.0),
                alpha: (k / 50.0).fract(),
                ambient: s(2.0),
                diffuse: s(3.0),
                emission: s(4.0),
                albedo: s(0.5),
                normal: Vec3::new(0.0, 0.6, -0.8),
                position: Vec3::new(k, -k, 1e6 + k),
                depth: if x == 0 { f32::INFINITY } else { k + 0.125 },
                object: (x > 1).then_some(x * 70_001),
                ..Pixel::default()
            };
            film.set_pixel(x, y, &pixel);
        }
    }
    film
}

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }
}

fn write(film: &Film, path: &Path, options: Options) -> Vec<u8> {
    image::write(film, path, &recipe(), &options).unwrap();
    std::fs::read(path).unwrap()
}

fn decode(bytes: &[u8]) -> Image {
    decode_picture(bytes, &Location::default(), ALLOWED).unwrap()
}

#[test]
fn an_exr_holds_every_layer_exactly_under_its_usual_name() {
    let folder = Folder::new();
    let film = film(37, 21);
    let path = folder.path("all.exr");
    write(&film, &path, Options::default());
    let picture = exr::prelude::read_first_flat_layer_from_file(&path).unwrap();
    let channels = &picture.layer_data.channel_data.list;
    assert_eq!(channels.len(), film.planes().len() + 1);
    for channel in channels {
        let name = channel.name.to_string();
        let values: Vec<f32> = channel.sample_data.values_as_f32().collect();
        match film.plane(&name) {
            Some(plane) => assert_eq!(values, plane, "{name}"),
            None => {
                assert_eq!(name, "object.id");
                let ids: Vec<u32> = channel.sample_data.values().map(|s| s.to_u32()).collect();
                assert_eq!(ids, film.object_ids().unwrap());
            }
        }
    }
}

#[test]
fn an_exr_of_half_floats_is_half_as_precise_but_keeps_depth_and_position() {
    let folder = Folder::new();
    let film = film(9, 5);
    let path = folder.path("half.exr");
    write(&film, &path, Options { exr_depth: ExrDepth::Half, ..Options::default() });
    let picture = exr::prelude::read_first_flat_layer_from_file(&path).unwrap();
    for channel in &picture.layer_data.channel_data.list {
        let Some(plane) = film.plane(&channel.name.to_string()) else { continue };
        let exact = matches!(channel.name.to_string().split('.').next(), Some("depth" | "position"));
        for (a, b) in channel.sample_data.values_as_f32().zip(plane) {
            assert!(a == *b || !exact && (a - b).abs() <= b.abs() * 0.000_49, "{}: {a} {b}", channel.name);
        }
    }
}

#[test]
fn our_own_reader_gives_back_the_colour_and_alpha_of_an_exr() {
    let folder = Folder::new();
    let film = film(12, 7);
    let image = decode(&write(&film, &folder.path("x.exr"), Options::default()));
    assert_eq!((image.width, image.height), (12, 7));
    let Pixels::Rgba32F(values) = &image.pixels else { panic!("an EXR is linear floats") };
    for (i, rgba) in values.chunks_exact(4).enumerate() {
        let (x, y) = (i as u32 % 12, i as u32 / 12);
        assert_eq!(&rgba[..3], film.color(x, y).to_array());
        assert_eq!(rgba[3], film.plane("A").unwrap()[i]);
    }
}

#[test]
fn an_hdr_picture_is_within_half_a_step_of_the_shared_exponent() {
    // Widths below 8 have no run-length form; 300 needs runs of more than 127.
    for width in [1, 7, 8, 300] {
        let folder = Folder::new();
        let film = film(width, 3);
        let image = decode(&write(&film, &folder.path("x.hdr"), Options::default()));
        let Pixels::Rgba32F(values) = &image.pixels else { panic!("an HDR picture is linear floats") };
        assert_eq!((image.width, image.height), (width, 3));
        for (i, rgba) in values.chunks_exact(4).enumerate() {
            let wanted = film.color(i as u32 % width, i as u32 / width);
            for (a, b) in rgba[..3].iter().zip(wanted.to_array()) {
                assert!((a - b).abs() <= wanted.max_channel() / 256.0, "{a} {b}");
            }
            assert_eq!(rgba[3], 1.0);
        }
    }
}

proptest::proptest! {
    #![proptest_config(proptest::test_runner::Config::with_cases(48))]
    #[test]
    fn runs_of_any_length_survive_in_an_hdr_picture(runs in proptest::collection::vec((1u32..200, 0u8..5), 1..12)) {
        let row: Vec<u8> = runs.iter().flat_map(|&(n, v)| (0..n).map(move |i| if v == 4 { i as u8 } else { v })).collect();
        let mut film = Film::new(row.len() as u32, 1, &[Layer::Color]).unwrap();
        for (x, &v) in row.iter().enumerate() {
            // The constant blue keeps the exponent, so the others are exact.
            let color = Spectrum::new(v.into(), f32::from(v / 2), 255.0);
            film.set_pixel(x as u32, 0, &Pixel { color, ..Pixel::default() });
        }
        let folder = Folder::new();
        let image = decode(&write(&film, &folder.path("x.hdr"), Options::default()));
        let Pixels::Rgba32F(values) = &image.pixels else { panic!("floats") };
        for (x, rgba) in values.chunks_exact(4).enumerate() {
            assert_eq!(rgba[..3], film.color(x as u32, 0).to_array());
        }
    }
}

#[test]
fn a_png_holds_what_the_tone_map_shows() {
    let folder = Folder::new();
    let film = film(16, 9);
    let tone_map = ToneMap { exposure: Exposure::Stops(-2.0), curve: Curve::Reinhard { white: None } };
    let shown = tone_map.prepare(&film);

    let eight = decode(&write(&film, &folder.path("8.png"), Options { tone_map, ..Options::default() }));
    let Pixels::Rgba8(bytes) = &eight.pixels else { panic!("8 bits") };
    let rgb: Vec<u8> = bytes.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
    assert_eq!(rgb, shown.to_srgb8(&film));

    let options = Options { tone_map, png_depth: PngDepth::Sixteen, ..Options::default() };
    let sixteen = decode(&write(&film, &folder.path("16.png"), options));
    let Pixels::Rgba16(values) = &sixteen.pixels else { panic!("16 bits") };
    let rgb: Vec<u16> = values.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
    assert_eq!(rgb, shown.to_srgb16(&film));
}

#[test]
fn the_recipe_comes_back_from_every_format() {
    let folder = Folder::new();
    for ending in Format::ENDINGS {
        let path = folder.path(&format!("x.{ending}"));
        write(&film(8, 4), &path, Options::default());
        let read = image::read_recipe(&path).unwrap();
        let n = recipe().entries().len();
        assert_eq!(&read.entries()[..n], recipe().entries(), "{ending}");
        let exposure = read.get("exposure");
        assert_eq!(exposure, (*ending == "png").then_some("1"), "{ending}");
    }
}

#[test]
fn an_hdr_header_names_exposure_and_view() {
    let folder = Folder::new();
    let bytes = write(&film(8, 4), &folder.path("x.hdr"), Options::default());
    let header = String::from_utf8_lossy(&bytes);
    assert!(header.starts_with("#?RADIANCE\n"));
    assert!(header.contains("\nEXPOSURE=1\n"));
    assert!(header.contains("\nVIEW= -vtv -vp 0 1 5"));
    assert!(header.contains("\n-Y 4 +X 8\n"));
}

#[test]
fn the_same_film_gives_the_same_bytes_every_time_at_any_thread_count() {
    let folder = Folder::new();
    let film = film(64, 80);
    for ending in Format::ENDINGS {
        let path = folder.path(&format!("x.{ending}"));
        let first = write(&film, &path, Options::default());
        for n_threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
            let again = pool.install(|| write(&film, &path, Options::default()));
            assert!(first == again, "{ending} differs with {n_threads} threads");
        }
    }
}

#[test]
fn what_cannot_be_written_is_known_beforehand() {
    let folder = Folder::new();
    assert_eq!(image::check_target(&folder.path("a.PNG")).unwrap(), Format::Png);
    let ending = image::check_target(&folder.path("a.gif")).unwrap_err().to_string();
    assert!(ending.contains(".png, .exr, .hdr"), "{ending}");
    let missing = image::check_target(&folder.path("no/such/a.png")).unwrap_err().to_string();
    assert!(missing.contains("does not exist"), "{missing}");
    std::fs::create_dir(folder.path("dir.exr")).unwrap();
    assert!(image::check_target(&folder.path("dir.exr")).is_err());
    // Nothing was left behind.
    assert_eq!(std::fs::read_dir(folder.0.path()).unwrap().count(), 1);
}

#[test]
fn a_failed_write_leaves_the_old_file_and_no_other() {
    let folder = Folder::new();
    let path = folder.path("x.png");
    std::fs::write(&path, b"old").unwrap();
    let failed = radiosa::export::write_atomically(&path, |file| {
        use std::io::Write;
        file.write_all(b"half of the new")?;
        Err(std::io::Error::other("the disk is full"))
    });
    assert!(failed.unwrap_err().to_string().contains("the disk is full"));
    assert_eq!(std::fs::read(&path).unwrap(), b"old");
    assert_eq!(std::fs::read_dir(folder.0.path()).unwrap().count(), 1);
}

#[cfg(unix)]
#[test]
fn a_new_picture_has_the_permissions_any_new_file_has() {
    use std::os::unix::fs::PermissionsExt;
    let folder = Folder::new();
    let plain = folder.path("plain");
    std::fs::write(&plain, b"").unwrap();
    write(&film(2, 2), &folder.path("x.png"), Options::default());
    let mode = |p: &Path| std::fs::metadata(p).unwrap().permissions().mode() & 0o777;
    assert_eq!(mode(&folder.path("x.png")), mode(&plain));
}

// ---- Radiance pictures ----

fn floats(image: &Image) -> &[f32] {
    match &image.pixels {
        Pixels::Rgba32F(values) => values,
        other => panic!("{} should be floats, not {other:?}", image.name),
    }
}

/// Two columns, three rows, all different: the red mantissas 1 to 6 of exponent 136, so the values are 1 to 6.
fn small_hdr(header: &str, axes: &str) -> Vec<u8> {
    let mut bytes = format!("#?RADIANCE\n{header}\n{axes}\n").into_bytes();
    (1..=6).for_each(|i| bytes.extend([i, 0, 0, 136]));
    bytes
}

fn reds(bytes: &[u8]) -> (u32, u32, Vec<f32>) {
    let image = decode(bytes);
    (image.width, image.height, floats(&image).chunks_exact(4).map(|p| p[0]).collect())
}

#[test]
fn every_order_of_scan_lines_comes_out_upright() {
    let at = |axes: &str| reds(&small_hdr("FORMAT=32-bit_rle_rgbe\n", axes));
    // The file holds 1 2 / 3 4 / 5 6 in its own order.
    assert_eq!(at("-Y 3 +X 2"), (2, 3, vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
    assert_eq!(at("+Y 3 +X 2"), (2, 3, vec![5.0, 6.0, 3.0, 4.0, 1.0, 2.0]));
    assert_eq!(at("-Y 3 -X 2"), (2, 3, vec![2.0, 1.0, 4.0, 3.0, 6.0, 5.0]));
    assert_eq!(at("+Y 3 -X 2"), (2, 3, vec![6.0, 5.0, 4.0, 3.0, 2.0, 1.0]));
    // Columns first: three columns of two.
    assert_eq!(at("+X 3 -Y 2"), (3, 2, vec![1.0, 3.0, 5.0, 2.0, 4.0, 6.0]));
    assert_eq!(at("-X 3 -Y 2"), (3, 2, vec![5.0, 3.0, 1.0, 6.0, 4.0, 2.0]));
    assert_eq!(at("+X 3 +Y 2"), (3, 2, vec![2.0, 4.0, 6.0, 1.0, 3.0, 5.0]));
    assert_eq!(at("-X 3 +Y 2"), (3, 2, vec![6.0, 4.0, 2.0, 5.0, 3.0, 1.0]));
}

#[test]
fn exposures_and_colour_corrections_are_divided_out() {
    let header = "EXPOSURE=4\n EXPOSURE=100\nFORMAT=32-bit_rle_rgbe\nEXPOSURE= 0.5\nCOLORCORR=2 1 1\n";
    // 4 · 0.5 · 2 in red; the indented line tells of a picture this one was made from.
    assert_eq!(reds(&small_hdr(header, "-Y 3 +X 2")).2[3], 1.0);
    for bad in ["EXPOSURE=0\n", "EXPOSURE=-1\n", "EXPOSURE=nan\n", "EXPOSURE=x\n", "FORMAT=16-bit\n"] {
        assert!(decode_picture(&small_hdr(bad, "-Y 3 +X 2"), &Location::default(), ALLOWED).is_err(), "{bad}");
    }
}

#[test]
fn pixels_in_xyz_become_rgb_with_white_as_white() {
    let mut bytes = b"#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\n".to_vec();
    bytes.extend([128, 128, 128, 129]);
    let image = decode(&bytes);
    for c in &floats(&image)[..3] {
        assert!((c - 1.0).abs() < 1e-5, "{c}");
    }
}

#[test]
fn runs_of_the_old_kind_repeat_the_last_pixel_with_growing_counts() {
    let mut bytes = b"#?RADIANCE\n\n-Y 1 +X 300\n".to_vec();
    // One pixel, then 43 + 1 · 256 more.
    bytes.extend([9, 0, 0, 136, 1, 1, 1, 43, 1, 1, 1, 1]);
    assert_eq!(reds(&bytes).2, vec![9.0; 300]);
    // A run past the end of the line, and one with nothing before it.
    let last = bytes.len() - 1;
    bytes[last] = 2;
    assert!(decode_picture(&bytes, &Location::default(), ALLOWED).is_err());
    let nothing = [b"#?RADIANCE\n\n-Y 1 +X 300\n".as_slice(), &[1, 1, 1, 200]].concat();
    assert!(decode_picture(&nothing, &Location::default(), ALLOWED).is_err());
}

#[test]
fn radiance_pictures_of_others_agree_with_an_independent_reader() {
    let Some(shared) = shared_dir() else {
        eprintln!("skipped: the shared collection of pictures is not there");
        return;
    };
    let mut n = 0;
    for folder in ["environments", "environments/hdr-format"] {
        for entry in std::fs::read_dir(shared.join(folder)).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_none_or(|e| e != "hdr") {
                continue;
            }
            let bytes = std::fs::read(&path).unwrap();
            let ours = decode(&bytes);
            // The other reader leaves exposure in; the files say what it is.
            let head = String::from_utf8_lossy(&bytes[..bytes.len().min(1000)]).into_owned();
            let exposure: f32 = head
                .lines()
                .take_while(|l| !l.is_empty())
                .filter_map(|l| l.strip_prefix("EXPOSURE="))
                .map(|v| v.trim().parse::<f32>().unwrap())
                .product();
            let theirs = ::image::codecs::hdr::HdrDecoder::new(std::io::Cursor::new(&bytes)).unwrap();
            let theirs = ::image::DynamicImage::from_decoder(theirs).unwrap().into_rgb32f();
            assert_eq!((ours.width, ours.height), theirs.dimensions(), "{}", path.display());
            for (a, b) in floats(&ours).chunks_exact(4).zip(theirs.pixels()) {
                for (a, b) in a.iter().zip(b.0) {
                    assert!((a * exposure - b).abs() <= 1e-6 * b.abs(), "{}: {a} {b}", path.display());
                }
            }
            n += 1;
        }
    }
    assert!(n >= 20, "{n}");
}

// ---- OpenEXR pictures of others ----

fn shared_exr(name: &str) -> Option<Image> {
    let path = shared_dir()?.join("environments/exr").join(name);
    let bytes = std::fs::read(path).ok()?;
    Some(decode_picture(&bytes, &Location::file(name), ALLOWED).unwrap_or_else(|e| panic!("{name}: {e}")))
}

#[test]
fn cube_environments_match_the_same_scene_in_latitude_and_longitude() {
    for (cube, flat) in [("WavyLinesCube.exr", "WavyLinesLatLong.exr"), ("OrientationCube.exr", "OrientationLatLong.exr")] {
        let (Some(cube), Some(flat)) = (shared_exr(cube), shared_exr(flat)) else {
            eprintln!("skipped: {cube} is not there");
            continue;
        };
        let (a, b) = (floats(&cube), floats(&flat));
        let step = cube.width / flat.width;
        assert_eq!((cube.width, cube.height), (flat.width * step, flat.height * step));
        // Means over squares of 16 pixels of the flat picture: lines are drawn in both, but not sampled alike.
        let n = 16;
        let mean = |v: &[f32], width: u32, n: u32, x: u32, y: u32| -> f32 {
            let pixels = (y..y + n).flat_map(|y| (x..x + n).map(move |x| (4 * (y * width + x)) as usize));
            pixels.map(|i| v[i] + v[i + 1] + v[i + 2]).sum::<f32>() / (n * n) as f32
        };
        let difference = |place: &dyn Fn(u32, u32) -> (u32, u32)| {
            let (mut error, mut total) = (0.0, 0.0);
            for y in 0..flat.height / n {
                for x in 0..flat.width / n {
                    let m = mean(b, flat.width, n, x * n, y * n);
                    let (x, y) = place(x, y);
                    error += (mean(a, cube.width, n * step, x * n * step, y * n * step) - m).abs();
                    total += m;
                }
            }
            error / total
        };
        let (across, down) = (flat.width / n, flat.height / n);
        let right = difference(&|x, y| (x, y));
        // The twins that would pass if the faces were turned or mirrored.
        let mirrored = difference(&|x, y| (across - 1 - x, y));
        let turned = difference(&|x, y| ((x + across / 4) % across, y));
        let inverted = difference(&|x, y| (x, down - 1 - y));
        assert!(right < 0.05, "{}: {right}", cube.name);
        for wrong in [mirrored, turned, inverted] {
            assert!(wrong > 3.0 * right, "{}: {right}, but wrong ways {mirrored}, {turned}, {inverted}", cube.name);
        }
    }
}

#[test]
fn luminance_alone_is_grey_and_with_chroma_is_colour() {
    let Some(garden) = shared_exr("Garden.exr") else {
        eprintln!("skipped: Garden.exr is not there");
        return;
    };
    assert_eq!((garden.width, garden.height), (874, 493));
    assert!(floats(&garden).chunks_exact(4).all(|p| p[0] == p[1] && p[1] == p[2] && p[3] == 1.0));
    let chroma = shared_exr("Rec709_YC.exr").expect("beside the other");
    assert_eq!((chroma.width, chroma.height), (610, 406));
    // The picture shows flowers and leaves: much of it is clearly coloured, little of it is impossible.
    let values = floats(&chroma);
    let n = values.len() / 4;
    let coloured = values.chunks_exact(4).filter(|p| (p[0] - p[2]).abs() > 0.2 * p[1].abs()).count();
    let negative = values.chunks_exact(4).filter(|p| p[..3].iter().any(|&c| c < -0.02)).count();
    assert!(coloured > n / 10 && negative < n / 50, "{coloured} coloured and {negative} negative of {n}");
}

#[test]
fn the_display_window_is_what_is_shown() {
    let (Some(plain), Some(larger), Some(apart)) = (shared_exr("t01.exr"), shared_exr("t07.exr"), shared_exr("t12.exr")) else {
        eprintln!("skipped: t01.exr and its like are not there");
        return;
    };
    assert_eq!((plain.width, plain.height), (400, 300));
    // Forty pixels more on the left and top: nothing there, then the picture.
    assert_eq!((larger.width, larger.height), (481, 371));
    let (a, b) = (floats(&plain), floats(&larger));
    assert_eq!(b[..4], [0.0; 4]);
    let at = |x: usize, y: usize| 4 * ((y + 40) * 481 + x + 40);
    for (x, y) in [(0, 0), (399, 0), (123, 45), (399, 299)] {
        assert_eq!(a[4 * (y * 400 + x)..][..4], b[at(x, y)..][..4]);
    }
    // A display window beside the picture shows nothing of it, so the picture itself is taken.
    assert_eq!((apart.width, apart.height), (400, 300));
}

#[test]
fn environments_of_others_decode_to_plausible_light() {
    for (name, size) in [("sky.exr", (1024, 512)), ("studiolights.exr", (512, 256))] {
        let Some(image) = shared_exr(name) else {
            eprintln!("skipped: {name} is not there");
            continue;
        };
        assert_eq!((image.width, image.height), size);
        let values = floats(&image);
        assert!(values.iter().all(|v| v.is_finite()));
        assert!(values.chunks_exact(4).any(|p| p[1] > 0.5));
    }
}

/// Writes an EXR of the given channels with the crate directly, for what our own writer does not make.
fn foreign_exr(channels: &[(&str, f32)]) -> Vec<u8> {
    use exr::prelude::*;
    let list = channels.iter().map(|&(name, v)| AnyChannel::new(name, FlatSamples::F32(vec![v; 6]))).collect();
    let layer = Layer::new((3, 2), LayerAttributes::named(""), Encoding::FAST_LOSSLESS, AnyChannels::sort(list));
    let mut bytes = std::io::Cursor::new(Vec::new());
    Image::from_layer(layer).write().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

#[test]
fn the_first_usable_group_of_channels_is_taken() {
    let first = |channels: &[(&str, f32)]| floats(&decode(&foreign_exr(channels)))[..4].to_vec();
    assert_eq!(first(&[("R", 1.0), ("G", 2.0), ("B", 3.0), ("Z", 9.0), ("sun.R", 7.0)]), [1.0, 2.0, 3.0, 1.0]);
    assert_eq!(first(&[("view.R", 1.0), ("view.G", 2.0), ("view.B", 3.0), ("view.A", 0.5), ("Z", 9.0)]), [1.0, 2.0, 3.0, 0.5]);
    assert_eq!(first(&[("Y", 4.0)]), [4.0, 4.0, 4.0, 1.0]);
    assert_eq!(first(&[("R", f32::NAN), ("G", f32::INFINITY), ("B", -1.0)]), [0.0, 65_504.0, -1.0, 1.0]);
    let none = decode_picture(&foreign_exr(&[("Z", 1.0), ("id", 1.0)]), &Location::default(), ALLOWED).unwrap_err();
    assert!(none.to_string().contains("Z, id"), "{none}");
}

#[test]
fn every_compression_of_an_exr_is_read_even_where_little_stands_for_much() {
    use exr::prelude::*;
    let dwa = [Compression::DWAA(None), Compression::DWAB(None)];
    let others = [Compression::Uncompressed, Compression::RLE, Compression::ZIP1, Compression::ZIP16, Compression::PIZ];
    let lossy = [Compression::PXR24, Compression::B44, Compression::B44A];
    for compression in others.into_iter().chain(lossy).chain(dwa) {
        for is_constant in [true, false] {
            let (w, h) = (517, 300);
            let value = |i: usize, c: usize| if is_constant { 0.0 } else { 1.0 + (i % w) as f32 / 400.0 + c as f32 };
            let half = |c| FlatSamples::F16((0..w * h).map(|i| f16::from_f32(value(i, c))).collect());
            let list = ["R", "G", "B"].into_iter().zip(0..3).map(|(name, c)| AnyChannel::new(name, half(c))).collect();
            let encoding = Encoding { compression, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
            let layer = Layer::new((w, h), LayerAttributes::named(""), encoding, AnyChannels::sort(list));
            let mut bytes = std::io::Cursor::new(Vec::new());
            Image::from_layer(layer).write().to_buffered(&mut bytes).unwrap();
            let picture = decode(&bytes.into_inner());
            for (i, rgba) in floats(&picture).chunks_exact(4).enumerate() {
                for (c, v) in rgba[..3].iter().enumerate() {
                    assert!((v - value(i, c)).abs() <= 0.02 * value(i, c), "{compression:?} {i} {c}: {v}");
                }
            }
        }
    }
}

// ---- Limits and refusals ----

#[test]
fn a_picture_over_the_budget_is_refused_by_its_size() {
    let folder = Folder::new();
    let film = film(200, 100);
    for ending in Format::ENDINGS {
        let bytes = write(&film, &folder.path(&format!("x.{ending}")), Options::default());
        let refused = decode_picture(&bytes, &Location::file("x"), 100_000).unwrap_err().to_string();
        assert!(refused.contains("200x100"), "{refused}");
    }
}

#[test]
fn other_kinds_of_picture_are_named_in_the_refusal() {
    for (bytes, name) in [
        (b"BM\0\0".as_slice(), "BMP"),
        (b"DDS |\0\0\0", "DDS"),
        (b"\xabKTX 20\xbb\r\n", "KTX2"),
        (b"GIF89a", "GIF"),
        (b"II*\0", "TIFF"),
        (b"\0\0\x01\0", "ICO"),
        (b"version https://git-lfs.github.com/spec/v1", "Git LFS"),
        (b"", "empty"),
        (b"hello", "no picture of a known kind"),
    ] {
        let error = decode_picture(bytes, &Location::file("a.png"), ALLOWED).unwrap_err();
        assert!(error.to_string().contains(name), "{error}");
        assert!(error.help().contains("PNG, JPEG"), "{}", error.help());
    }
}

#[test]
fn known_pixels_of_the_png_suite_have_their_known_values() {
    let Some(folder) = shared_dir().map(|d| d.join("hostile/png/pngsuite-valid")) else {
        eprintln!("skipped: the shared collection of pictures is not there");
        return;
    };
    let first = |name: &str| -> Vec<u16> {
        match &decode(&std::fs::read(folder.join(name)).unwrap()).pixels {
            Pixels::Rgba8(v) => v[..4].iter().map(|&b| b.into()).collect(),
            Pixels::Rgba16(v) => v[..4].to_vec(),
            Pixels::Rgba32F(_) => panic!("{name}"),
        }
    };
    // As an inflated first row says by hand: 1 and 8 bits of grey, colour, alpha, 16 bits; gamma chunks change nothing.
    assert_eq!(first("basn0g01.png"), [255, 255, 255, 255]);
    assert_eq!(first("basn0g08.png"), [0, 0, 0, 255]);
    assert_eq!(first("basn2c08.png"), [255, 255, 255, 255]);
    assert_eq!(first("basn6a08.png"), [255, 0, 8, 0]);
    assert_eq!(first("basn2c16.png"), [65_535, 65_535, 0, 65_535]);
    assert_eq!(first("g03n2c08.png"), first("g07n2c08.png"));
    // A palette's transparent entry.
    assert_eq!(first("tbbn3p08.png")[3], 0);
}
