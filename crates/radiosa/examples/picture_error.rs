//! `picture_error [--epsilon mean] REFERENCE MASK NOISE PICTURE…`: how far pictures are from a reference, over the white part of a mask; a line of JSON for each.
//!
//! `relMSE = mean (L − L_ref)²/(L_ref² + ε) − NOISE`, over pixels and channels, NOISE the reference's own; ε = 0.01 as usual for the Cornell box, or with
//! `--epsilon mean` half the square of the mean luminance of the whole reference; the errors of the means of each channel; the largest error of the mean of a 16×16 tile that lies wholly in the mask, and how many of them are beyond 1 %.

use std::error::Error;
use std::path::Path;

use radiosa::import::{self, Options};
use radiosa::scene::Pixels;
use radiosa::spectrum::luminance;

const EPSILON: f64 = 0.01;
const TILE: usize = 16;

struct Picture {
    width: usize,
    colors: Vec<[f64; 3]>,
}

impl Picture {
    fn mean_luminance(&self) -> f64 {
        self.colors.iter().map(|c| luminance(*c)).sum::<f64>() / self.colors.len() as f64
    }
}

fn read(path: &str) -> Result<Picture, Box<dyn Error>> {
    let image = import::load_picture(Path::new(path), &Options::default())?;
    let colors = match &image.pixels {
        Pixels::Rgba8(p) => p.chunks_exact(4).map(|p| [p[0], p[1], p[2]].map(|v| f64::from(v) / 255.0)).collect(),
        Pixels::Rgba16(p) => p.chunks_exact(4).map(|p| [p[0], p[1], p[2]].map(|v| f64::from(v) / 65535.0)).collect(),
        Pixels::Rgba32F(p) => p.chunks_exact(4).map(|p| [p[0], p[1], p[2]].map(f64::from)).collect(),
    };
    Ok(Picture { width: image.width as usize, colors })
}

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let (of_mean, args) = match &args[..] {
        [option, value, rest @ ..] if option == "--epsilon" && value == "mean" => (true, rest),
        rest => (false, rest),
    };
    let [reference, mask, noise, pictures @ ..] = args else {
        return Err("wanted: [--epsilon mean] REFERENCE MASK NOISE PICTURE…".into());
    };
    let (reference, mask, noise) = (read(reference)?, read(mask)?, noise.parse::<f64>()?);
    let epsilon = if of_mean { 0.5 * reference.mean_luminance().powi(2) } else { EPSILON };
    let is_in = |k: usize| mask.colors[k][0] > 0.5;
    for path in pictures {
        let picture = read(path)?;
        if picture.colors.len() != reference.colors.len() || mask.colors.len() != reference.colors.len() {
            return Err(format!("{path} is not of the reference's size").into());
        }
        let inside: Vec<usize> = (0..mask.colors.len()).filter(|&k| is_in(k)).collect();
        let off = |k: usize, c: usize| {
            let (v, r) = (picture.colors[k][c], reference.colors[k][c]);
            (v - r).powi(2) / (r * r + epsilon)
        };
        let sum: f64 = inside.iter().flat_map(|&k| (0..3).map(move |c| (k, c))).map(|(k, c)| off(k, c)).sum();
        let mean = |p: &Picture, c: usize, of: &[usize]| of.iter().map(|&k| p.colors[k][c]).sum::<f64>() / of.len() as f64;
        let off_mean = |of: &[usize]| -> [f64; 3] {
            std::array::from_fn(|c| mean(&picture, c, of) / mean(&reference, c, of).max(1e-12) - 1.0)
        };
        let (width, height) = (picture.width, picture.colors.len() / picture.width);
        let tiles = (0..height / TILE).flat_map(|j| (0..width / TILE).map(move |i| (i, j)));
        let tiles = tiles.map(|(i, j)| -> Vec<usize> {
            (0..TILE * TILE).map(|k| (j * TILE + k / TILE) * width + i * TILE + k % TILE).collect()
        });
        let of_tiles: Vec<f64> = tiles
            .filter(|tile| tile.iter().all(|&k| is_in(k)))
            .map(|tile| off_mean(&tile).into_iter().fold(0.0, |worst: f64, e| worst.max(e.abs())))
            .collect();
        println!(
            "{{\"relmse\":{:e},\"means\":{:?},\"worst_tile\":{},\"tiles_beyond\":{},\"tiles\":{}}}",
            sum / (3 * inside.len()) as f64 - noise,
            off_mean(&inside),
            of_tiles.iter().copied().fold(0.0, f64::max),
            of_tiles.iter().filter(|e| **e > 0.01).count(),
            of_tiles.len()
        );
    }
    Ok(())
}
