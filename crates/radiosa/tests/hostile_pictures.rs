//! No picture, however malformed, panics, takes long or takes much memory.
//!
//! A counting allocator measures the peak of each file; the decoder's panics would be caught inside the library, so a hook
//! counts them here.

#![expect(clippy::print_stderr, reason = "a test says what it skips and what it measured")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::time::{Duration, Instant};

use radiosa::film::{Film, Filter, Layer};
use radiosa::import::{Location, Options, decode_picture};
use radiosa::math::CpuPath;
use radiosa::raytrace::{RayCast, ray_cast, tiles};
use radiosa::scene::{Image, Pixels};
use radiosa::transport::{Solver, Step, View, World, default_light, framing};
use radiosa_testkit::shared_dir;

/// Longest time for one file.
const TIME: Duration = Duration::from_secs(2);
/// Most memory for one file, bytes.
const MEMORY: usize = 512 << 20;

/// Passes everything on to the system and counts the bytes that are out.
struct Counting;

static IN_USE: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

fn grow(n: usize) {
    PEAK.fetch_max(IN_USE.fetch_add(n, Relaxed) + n, Relaxed);
}

#[expect(unsafe_code, reason = "an allocator is unsafe by contract; this one only counts")]
// SAFETY: every call goes to `System` with the arguments it came with, so its contract is kept whenever ours is. The counters
// do not allocate.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        grow(layout.size());
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        grow(layout.size());
        // SAFETY: the caller keeps the contract of `alloc_zeroed`.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        IN_USE.fetch_sub(layout.size(), Relaxed);
        // SAFETY: `pointer` came from `System` through `alloc` with this layout.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, new_size: usize) -> *mut u8 {
        grow(new_size);
        IN_USE.fetch_sub(layout.size(), Relaxed);
        // SAFETY: `pointer` came from `System` through `alloc` with this layout.
        unsafe { System.realloc(pointer, layout, new_size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// The measurements are of the whole process, so tests take turns.
static TURN: Mutex<()> = Mutex::new(());

static N_PANICS: AtomicUsize = AtomicUsize::new(0);

/// What happened with a folder of files.
#[derive(Default)]
struct Tally {
    n_done: usize,
    n_refused: usize,
    slowest: Duration,
    largest: usize,
    faults: String,
}

impl Tally {
    /// Runs one file and notes what it took; true when it was accepted.
    fn run<T, E: std::fmt::Display>(&mut self, name: &Path, run: impl FnOnce() -> Result<T, E>) -> bool {
        let before = IN_USE.load(Relaxed);
        PEAK.store(before, Relaxed);
        let panics = N_PANICS.load(Relaxed);
        let start = Instant::now();
        let result = run();
        let took = start.elapsed();
        let peak = PEAK.load(Relaxed).saturating_sub(before);
        let n_panics = N_PANICS.load(Relaxed) - panics;
        if std::env::var_os("RADIOSA_VERBOSE").is_some() {
            let what = result.as_ref().map_or_else(ToString::to_string, |_| "ok".to_owned());
            eprintln!("{took:>10.1?} {:>5} MiB {n_panics} {}: {what}", peak >> 20, name.display());
        }
        if n_panics > 0 || took > TIME || peak > MEMORY {
            let _ = writeln!(self.faults, "{}: {took:?}, {} MiB, {n_panics} panics", name.display(), peak >> 20);
        }
        if let Err(e) = &result
            && e.to_string().len() < 10
        {
            let _ = writeln!(self.faults, "{}: a message that says nothing: {e}", name.display());
        }
        self.slowest = self.slowest.max(took);
        self.largest = self.largest.max(peak);
        *if result.is_ok() { &mut self.n_done } else { &mut self.n_refused } += 1;
        result.is_ok()
    }

    fn report(&self, what: &str) {
        let Self { n_done, n_refused, slowest, largest, faults } = self;
        eprintln!("{what}: {n_done} decoded, {n_refused} refused; slowest {slowest:.0?}, largest {} MiB", largest >> 20);
        assert!(faults.is_empty(), "{what}:\n{faults}");
    }
}

/// All regular files below a folder, sorted.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).unwrap().map(|e| e.unwrap().path()) {
            if entry.is_dir() {
                folders.push(entry);
            } else if !entry.ends_with("SOURCE.md") {
                found.push(entry);
            }
        }
    }
    found.sort();
    found
}

fn with_shared(test: impl FnOnce(&Path)) {
    let _turn = TURN.lock().unwrap_or_else(|e| e.into_inner());
    match shared_dir() {
        Some(shared) => test(&shared),
        None => eprintln!("skipped: the shared collection of pictures is not there"),
    }
}

fn count_panics() {
    static ONCE: std::sync::Once = std::sync::Once::new();
    ONCE.call_once(|| {
        let old = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            N_PANICS.fetch_add(1, Relaxed);
            old(info);
        }));
    });
}

fn decode(path: &Path, bytes: &[u8]) -> Result<Image, radiosa::import::ImportError> {
    decode_picture(bytes, &Location::file(path), Options::default().max_memory)
}

#[test]
fn no_hostile_picture_panics_or_takes_long_or_much_memory() {
    count_panics();
    with_shared(|shared| {
        for kind in ["bmp-ico", "exr", "png", "jpeg", "webp"] {
            let mut tally = Tally::default();
            for path in files(&shared.join("hostile").join(kind)) {
                let bytes = std::fs::read(&path).unwrap();
                let accepted = tally.run(&path, || decode(&path, &bytes));
                assert!(!(accepted && kind == "bmp-ico"), "{} is no picture we read", path.display());
            }
            tally.report(kind);
        }
    });
}

#[test]
fn a_picture_cut_off_or_bent_anywhere_is_an_error_or_a_picture() {
    count_panics();
    with_shared(|shared| {
        let mut tally = Tally::default();
        let env = shared.join("environments");
        let samples = [
            env.join("hdr-format/old-rle.hdr"),
            env.join("hdr-format/rgbr4x4.hdr"),
            env.join("hdr-format/scale.hdr"),
            env.join("exr/t01.exr"),
            env.join("exr/studiolights.exr"),
            shared.join("hostile/png/pngsuite-valid/basn6a16.png"),
        ];
        for path in samples.iter().filter(|p| p.exists()) {
            let good = std::fs::read(path).unwrap();
            for i in 0..40 {
                let cut = good.len() * i / 40;
                tally.run(path, || decode(path, &good[..cut]));
                // A byte of the header turned into something else, then one anywhere.
                for (k, span) in [(i * 7, good.len().min(400)), (i * 7919, good.len())] {
                    for value in [0, 0x7f, 0xff] {
                        let mut bent = good.clone();
                        bent[k % span] = value;
                        tally.run(path, || decode(path, &bent));
                    }
                }
            }
        }
        tally.report("cut off and bent");
    });
}

/// Small EXR files in every compression, in scan lines and in tiles.
fn exr_samples() -> Vec<(PathBuf, Vec<u8>)> {
    use exr::prelude::*;
    let mut samples = Vec::new();
    let compressions = [
        Compression::Uncompressed,
        Compression::RLE,
        Compression::ZIP1,
        Compression::ZIP16,
        Compression::PIZ,
        Compression::PXR24,
        Compression::B44,
        Compression::B44A,
        Compression::DWAA(None),
        Compression::DWAB(None),
    ];
    for compression in compressions {
        for blocks in [Blocks::ScanLines, Blocks::Tiles(Vec2(16, 16))] {
            let value = |i: usize, c: usize| ((i * (c + 3)) % 37) as f32 * 0.1;
            let halves = |c| FlatSamples::F16((0..45 * 35).map(|i| f16::from_f32(value(i, c))).collect());
            let channels =
                [("R", halves(0)), ("G", halves(1)), ("B", FlatSamples::F32((0..45 * 35).map(|i| value(i, 2)).collect()))];
            let list = channels.into_iter().map(|(name, samples)| AnyChannel::new(name, samples)).collect();
            let encoding = Encoding { compression, blocks, line_order: LineOrder::Increasing };
            let layer = Layer::new((45, 35), LayerAttributes::named(""), encoding, AnyChannels::sort(list));
            let mut bytes = std::io::Cursor::new(Vec::new());
            Image::from_layer(layer).write().to_buffered(&mut bytes).expect("the crate writes what it reads");
            samples.push((PathBuf::from(format!("{compression:?} in {blocks:?}")), bytes.into_inner()));
        }
    }
    samples
}

/// Small pictures of the other kinds.
fn raster_samples() -> Vec<(PathBuf, Vec<u8>)> {
    use image::{DynamicImage, ImageFormat, RgbImage};
    let picture = RgbImage::from_fn(45, 35, |x, y| image::Rgb([(x * 5) as u8, (y * 7) as u8, (x * y) as u8]));
    let picture = DynamicImage::ImageRgb8(picture);
    let encode = |picture: &DynamicImage, format: ImageFormat| {
        let mut bytes = std::io::Cursor::new(Vec::new());
        picture.write_to(&mut bytes, format).expect("the crate writes what it reads");
        (PathBuf::from(format!("{format:?} {:?}", picture.color())), bytes.into_inner())
    };
    let grey = DynamicImage::ImageLuma8(picture.to_luma8());
    let deep = DynamicImage::ImageRgba16(picture.to_rgba16());
    let floats = DynamicImage::ImageRgb32F(picture.to_rgb32f());
    vec![
        encode(&picture, ImageFormat::Jpeg),
        encode(&grey, ImageFormat::Jpeg),
        encode(&picture, ImageFormat::WebP),
        encode(&picture, ImageFormat::Png),
        encode(&deep, ImageFormat::Png),
        encode(&floats, ImageFormat::Hdr),
    ]
}

#[test]
fn a_picture_of_any_kind_and_compression_may_be_bent_anywhere() {
    let _turn = TURN.lock().unwrap_or_else(|e| e.into_inner());
    count_panics();
    // More for a longer hunt.
    let n: u32 = std::env::var("RADIOSA_MUTATIONS").ok().and_then(|n| n.parse().ok()).unwrap_or(60);
    let mut tally = Tally::default();
    for (name, good) in exr_samples().into_iter().chain(raster_samples()) {
        assert!(tally.run(&name, || decode(&name, &good)), "{} should decode", name.display());
        let mut state = 0x9e37_79b9_7f4a_7c15u64;
        let mut random = |n: usize| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as usize % n
        };
        for _ in 0..n {
            let mut bent = good.clone();
            for _ in 0..=random(4) {
                // Half of the changes hit the header and the table, half the pixels.
                let at = if random(2) == 0 { random(bent.len().min(500)) } else { random(bent.len()) };
                bent[at] = [0, 1, 0x7f, 0x80, 0xff, random(256) as u8][random(6)];
            }
            tally.run(&name, || decode(&name, &bent));
        }
    }
    tally.report("bent pictures");
}

#[test]
fn every_valid_png_of_the_suite_decodes_to_its_size() {
    with_shared(|shared| {
        let folder = shared.join("hostile/png/pngsuite-valid");
        for path in files(&folder) {
            let bytes = std::fs::read(&path).unwrap();
            let image = decode(&path, &bytes).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
            let side = |at: usize| u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap());
            assert_eq!((image.width, image.height), (side(16), side(20)), "{}", path.display());
            let is_deep = bytes[24] == 16;
            assert_eq!(matches!(image.pixels, Pixels::Rgba16(_)), is_deep, "{}", path.display());
        }
    });
}

// ---- The same pictures where scenes use them ----

/// A glTF document of one textured square whose picture lies beside it.
fn textured_square() -> String {
    use base64::Engine as _;
    let corners = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let uvs = [[0.0f32, 1.0], [3.0, 1.0], [3.0, -2.0], [0.0, -2.0]];
    let mut bytes: Vec<u8> = corners.as_flattened().iter().flat_map(|v| v.to_le_bytes()).collect();
    bytes.extend(uvs.as_flattened().iter().flat_map(|v| v.to_le_bytes()));
    bytes.extend([0u16, 1, 2, 0, 2, 3].iter().flat_map(|v| v.to_le_bytes()));
    let data = base64::engine::general_purpose::STANDARD.encode(&bytes);
    let json = serde_json::json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0, "TEXCOORD_0": 1 }, "indices": 2, "material": 0 }] }],
        "materials": [{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } }, "alphaMode": "MASK" }],
        "textures": [{ "source": 0 }],
        "images": [{ "uri": "picture" }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0] },
            { "bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2" },
            { "bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR" }
        ],
        "bufferViews": [
            { "buffer": 0, "byteOffset": 0, "byteLength": 48 },
            { "buffer": 0, "byteOffset": 48, "byteLength": 32 },
            { "buffer": 0, "byteOffset": 80, "byteLength": 12 }
        ],
        "buffers": [{ "byteLength": bytes.len(), "uri": format!("data:application/octet-stream;base64,{data}") }]
    });
    json.to_string()
}

/// A scene file of one disc under the picture as environment.
const UNDER_A_SKY: &str = r#"
[environment]
map = "picture"

[material.plain]
lambert = 0.5

[[shape]]
name = "floor"
material = "plain"
quad = [[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]]
"#;

/// Loads a scene and makes a small picture of it.
fn load_and_render(path: &Path) -> Result<Film, radiosa::import::ImportError> {
    let (scene, _) = radiosa::import::load(path, &Options::default())?;
    let world = World::prepare(scene, CpuPath::detect()).expect("what loads is valid");
    let camera = framing::automatic(&world, 1.0);
    let view = View::new(&camera, world.origin(), 8, 8);
    let extra_lights = default_light::lights(&camera);
    let method = RayCast::new(&world, &ray_cast::Settings { extra_lights, ..Default::default() }, view.forward());
    let settings = tiles::Settings { width: 8, height: 8, spp: 1, filter: Filter::Box, seed: 1, layers: vec![Layer::Color] };
    let mut render = tiles::TiledRender::new(&method, &view, settings).expect("the film is small");
    while let Step::Working { .. } = render.step(&world) {}
    Ok(render.into_film())
}

#[test]
fn hostile_pictures_are_as_harmless_as_textures_and_as_environments() {
    count_panics();
    with_shared(|shared| {
        let folder = tempfile::tempdir().unwrap();
        let (texture, sky, picture) =
            (folder.path().join("square.gltf"), folder.path().join("sky.toml"), folder.path().join("picture"));
        std::fs::write(&texture, textured_square()).unwrap();
        std::fs::write(&sky, UNDER_A_SKY).unwrap();
        for (use_, scene) in [("as textures", &texture), ("as environments", &sky)] {
            let mut tally = Tally::default();
            for kind in ["bmp-ico", "exr", "png", "jpeg", "webp"] {
                for path in files(&shared.join("hostile").join(kind)) {
                    std::fs::write(&picture, std::fs::read(&path).unwrap()).unwrap();
                    tally.run(&path, || {
                        let film = load_and_render(scene)?;
                        let finite = film.planes().iter().all(|p| p.values.iter().all(|v| v.is_finite()));
                        assert!(finite, "{}: light that is not finite", path.display());
                        Ok::<_, radiosa::import::ImportError>(())
                    });
                }
            }
            tally.report(use_);
        }
    });
}
