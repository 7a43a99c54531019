//! `llvmpipe-bench SCENES… [--turns N] [--size WxH] [--texture-filter bilinear|mipmap] [--pictures DIR]`: frames a second of scan line beside
//! Mesa's software OpenGL, llvmpipe, on the same triangles, materials and lights. `cargo xtask bench scanline` runs it.
//!
//! Both draw one opaque picture, one sample a pixel, without shadows, into linear light (ours 32-bit floats, theirs 16-bit), and light at the same places:
//! once a face, at the vertices, or at every pixel. Glass and blended alpha count as opaque for both. Not in the times: loading, ours making the
//! world and the method ([`radiosa::scanline::ScanLine::new`], printed beside), theirs uploading and compiling. In the times: everything a new camera needs.
//!
//! What OpenGL's side does to be fast: triangles sorted by material and placed object, objects outside the view left out by their bounds, one shader for
//! each kind of material, and for light at every pixel a pass for depth alone first where that is faster (tried for each scene, and said). What it cannot do: it lights the
//! vertices of all faces drawn, seen or not, where ours lights those that are seen.
//!
//! That the contest is fair is shown by the pictures: the share of pixels within 2/255 of ours is printed, and for light at every pixel that of ray casting.

mod gl;
mod measure;
mod mesh;
mod shader;
mod stage;

use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use radiosa::film::tone_map::{Curve, Exposure, Prepared, ToneMap};
use radiosa::film::{Film, Layer};
use radiosa::scanline::Interpolation;
use radiosa::scene::{Filter, Quantity};

use gl::{Gl, Passes};
use measure::Times;
use stage::Stage;

/// What was asked for.
struct Options {
    turns: usize,
    size: (u32, u32),
    filter: Filter,
    pictures: Option<PathBuf>,
    scenes: Vec<PathBuf>,
}

fn options() -> Option<Options> {
    let mut options = Options { turns: 7, size: (1920, 1080), filter: Filter::Bilinear, pictures: None, scenes: Vec::new() };
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        match word.as_str() {
            "--turns" => options.turns = words.next()?.parse().ok().filter(|n| *n > 0)?,
            "--size" => {
                let size = words.next()?;
                let (width, height) = size.split_once('x')?;
                options.size = (width.parse().ok()?, height.parse().ok()?);
            }
            "--texture-filter" => {
                options.filter = match words.next()?.as_str() {
                    "bilinear" => Filter::Bilinear,
                    "mipmap" => Filter::Mipmap,
                    _ => return None,
                }
            }
            "--pictures" => options.pictures = Some(words.next()?.into()),
            word if word.starts_with("--") => return None,
            scene => options.scenes.push(scene.into()),
        }
    }
    Some(options)
}

fn main() -> ExitCode {
    let Some(options) = options() else {
        eprintln!("usage: llvmpipe-bench SCENES… [--turns N] [--size WxH] [--texture-filter bilinear|mipmap] [--pictures DIR]");
        return ExitCode::from(2);
    };
    match run(&options) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(options: &Options) -> Result<(), Box<dyn Error>> {
    rayon::ThreadPoolBuilder::new().num_threads(2).build_global()?;
    let gl = Gl::new(options.size)?;
    println!("{}", gl.about());
    if !gl.about().contains("llvmpipe") {
        return Err("this is not llvmpipe; set LIBGL_ALWAYS_SOFTWARE=1 and GALLIUM_DRIVER=llvmpipe".into());
    }
    println!(
        "ours: 2 threads, {} kernels; theirs: {} threads for pixels and one for vertices",
        radiosa::math::CpuPath::detect(),
        std::env::var("LP_NUM_THREADS").unwrap_or_else(|_| "all".into()),
    );
    println!(
        "{}x{}, medians of {} turns; milliseconds a frame, wall / processor; the ratio is theirs/ours: above 1 we are faster",
        options.size.0, options.size.1, options.turns
    );
    if let Some(folder) = &options.pictures {
        std::fs::create_dir_all(folder)?;
    }
    for scene in &options.scenes {
        contest(&gl, scene, options).map_err(|e| format!("{}: {e}", scene.display()))?;
    }
    Ok(())
}

/// Prints a scene's rows.
fn contest(gl: &Gl, path: &Path, options: &Options) -> Result<(), Box<dyn Error>> {
    let stage = Stage::load(path, options.size, options.filter)?;
    let name = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    println!("\n{name}: {} triangles, {}", stage.n_triangles(), stage.lights.about());
    let cast = stage.ray_cast()?;
    let quantity = stage.world.scene().quantity;
    let exposure = if quantity == Quantity::Photometric { Exposure::Automatic } else { Exposure::NONE };
    let tone = ToneMap { exposure, curve: Curve::Clamp }.prepare(&cast);
    let save = |film: &Film, whose: &str| -> Result<(), Box<dyn Error>> {
        let Some(folder) = &options.pictures else { return Ok(()) };
        let file = folder.join(format!("{name}-{whose}.png"));
        radiosa::export::image::write_rgb8(&file, film.width(), film.height(), &tone.to_srgb8(film), &Default::default())?;
        Ok(())
    };
    save(&cast, "ray-casting")?;
    for (interpolation, word) in
        [(Interpolation::Flat, "flat"), (Interpolation::Gouraud, "gouraud"), (Interpolation::Phong, "phong")]
    {
        let upload = gl.upload(&stage, interpolation)?;
        let passes = gl.faster(&upload, &stage);
        let ours = stage.scan(interpolation, &[Layer::Color])?.film;
        gl.draw(&upload, &stage, passes);
        let theirs = gl.read(&stage)?;
        save(&ours, &format!("{word}-radiosa"))?;
        save(&theirs, &format!("{word}-llvmpipe"))?;

        let (mut a, mut b, mut preparing) = (Times::default(), Times::default(), Times::default());
        for _ in 0..options.turns {
            let scanned = stage.scan(interpolation, &[Layer::Color])?;
            a.push(scanned.drawing);
            preparing.push(scanned.preparing);
            b.push(measure::time(|| gl.draw(&upload, &stage, passes)).1);
        }
        let (a, b, preparing) = (a.median(), b.median(), preparing.median());
        println!(
            "  {word:8} ours {:6.1} / {:6.1} ({:5.1} fps)   theirs {:6.1} / {:6.1} ({:5.1} fps)   ratio {:4.2} / {:4.2}   before: {:5.1}   {}   alike {:.3} %{}",
            a.wall,
            a.processor,
            1000.0 / a.wall,
            b.wall,
            b.processor,
            1000.0 / b.wall,
            b.wall / a.wall,
            b.processor / a.processor,
            preparing.wall,
            if passes == Passes::DepthFirst { "depth first" } else { "one pass   " },
            100.0 * alike(&ours, &theirs, &tone),
            if interpolation == Interpolation::Phong {
                format!(", to ray casting {:.3} %", 100.0 * alike(&cast, &theirs, &tone))
            } else {
                String::new()
            }
        );
    }
    let mut all = Times::default();
    for _ in 0..options.turns.min(3) {
        all.push(stage.scan(Interpolation::Phong, &Layer::ALL)?.drawing);
    }
    let all = all.median();
    println!("  phong with every layer of the film: {:.1} / {:.1}", all.wall, all.processor);
    Ok(())
}

/// The share of pixels that differ by 2/255 at most on screen, in every channel.
fn alike(a: &Film, b: &Film, tone: &Prepared) -> f64 {
    let (a, b) = (tone.to_srgb8(a), tone.to_srgb8(b));
    let pixels = a.chunks_exact(3).zip(b.chunks_exact(3));
    let same = pixels.filter(|(a, b)| a.iter().zip(*b).all(|(a, b)| a.abs_diff(*b) <= 2)).count();
    same as f64 / (a.len() / 3) as f64
}
