//! The mesh of a solution as lines over a picture.

use rayon::prelude::*;

use super::mesh::ElementMesh;
use crate::transport::{View, World};

/// Places a pixel is looked at, along each side.
const PLACES: u32 = 2;

/// How much of each pixel the borders of elements cover, 0 to 1, row by row from the top left of a picture of `width × height` pixels: elements are looked for at 2×2
/// places a pixel, and those whose right or lower neighbour shows another element are border. Lines are half a pixel wide wherever they run.
pub fn borders(world: &World, mesh: &ElementMesh, view: &View, [width, height]: [u32; 2]) -> Vec<f32> {
    let element = |x: u32, y: u32| {
        let at = |k: u32| (f64::from(k) + 0.5) / f64::from(PLACES);
        let ray = view.ray(at(x), at(y));
        let (hit, surface) = world.closest_visible(&ray)?;
        mesh.weights_at(&hit, surface.p, ray.dir).map(|(element, _)| element)
    };
    // One place more than the picture has, so that the last have neighbours.
    let row = |y: u32| -> Vec<Option<u32>> { (0..=width * PLACES).map(|x| element(x, y)).collect() };
    let of_pixels = |y: u32| -> Vec<f32> {
        let rows: Vec<_> = (y * PLACES..=(y + 1) * PLACES).map(row).collect();
        let is_border = |x: usize, y: usize| rows[y][x] != rows[y][x + 1] || rows[y][x] != rows[y + 1][x];
        let places = PLACES as usize;
        let covered = |x: usize| (0..places * places).filter(|k| is_border(x * places + k % places, k / places)).count();
        (0..width as usize).map(|x| covered(x) as f32 / (places * places) as f32).collect()
    };
    (0..height).into_par_iter().flat_map_iter(of_pixels).collect()
}
