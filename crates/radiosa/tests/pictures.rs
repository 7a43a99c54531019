//! Pictures come back from files as they were written.

use std::path::{Path, PathBuf};

use radiosa::export::image::{self, ExrDepth, Format, Options, PngDepth, Recipe};
use radiosa::film::tone_map::{Curve, Exposure, ToneMap};
use radiosa::film::{Film, Layer, Pixel};
use radiosa::import::{Location, decode_picture};
use radiosa::math::Vec3;
use radiosa::scene::{Image, Pixels};
use radiosa::spectrum::Spectrum;

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
