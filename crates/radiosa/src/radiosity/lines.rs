//! The mesh of a solution, and the links of one of its elements, as lines over a picture.

use rayon::prelude::*;

use super::hierarchical::Hierarchical;
use super::mesh::ElementMesh;
use super::solution::Solution;
use crate::math::DVec3;
use crate::spectrum::luminance;
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

/// Steps in which a link is followed through a picture, which need not show it straight.
const STEPS: u32 = 64;

/// The element that a pixel of a picture shows; `None` where it shows none that takes part.
pub fn element_under(world: &World, mesh: &ElementMesh, view: &View, [x, y]: [u32; 2]) -> Option<u32> {
    let ray = view.ray(f64::from(x) + 0.5, f64::from(y) + 0.5);
    let (hit, surface) = world.closest_visible(&ray)?;
    mesh.element_at(&hit, surface.p, ray.dir)
}

/// The element that receives most of those that do not emit.
pub fn brightest_receiver(solution: &Solution) -> Option<u32> {
    let system = &solution.system;
    let receives = |i: usize| system.area[i] * luminance(solution.irradiance[i]);
    let dark = (0..system.n()).filter(|&i| system.emission[i] == [0.0; 3] && receives(i) > 0.0);
    dark.max_by(|&i, &j| receives(i).total_cmp(&receives(j)).then(j.cmp(&i))).map(|i| i as u32)
}

/// How much of each pixel the links of an element cover, as [`borders`]: lines a pixel wide from its centre to the middles of what it is linked with, itself or in a group,
/// whatever is in front of them, and a dot where each ends.
pub fn links(mesh: &ElementMesh, of: &Hierarchical, element: u32, view: &View, [width, height]: [u32; 2]) -> Vec<f32> {
    let mut covered = vec![0.0f32; width as usize * height as usize];
    let from = mesh.elements()[element as usize].centre();
    let mut segment = |[a, b]: [[f64; 2]; 2], half: f64| {
        let range = |i: usize, n: u32| {
            let clamped = |x: f64| x.clamp(0.0, f64::from(n)) as u32;
            clamped((a[i].min(b[i]) - half - 1.0).floor())..clamped((a[i].max(b[i]) + half + 1.0).ceil())
        };
        let d = [b[0] - a[0], b[1] - a[1]];
        let squared = d[0] * d[0] + d[1] * d[1];
        for y in range(1, height) {
            for x in range(0, width) {
                let p = [f64::from(x) + 0.5 - a[0], f64::from(y) + 0.5 - a[1]];
                let t = if squared > 0.0 { ((p[0] * d[0] + p[1] * d[1]) / squared).clamp(0.0, 1.0) } else { 0.0 };
                let distance = (p[0] - t * d[0]).hypot(p[1] - t * d[1]);
                let share = (half + 0.5 - distance).clamp(0.0, 1.0) as f32;
                let pixel = &mut covered[(y * width + x) as usize];
                *pixel = pixel.max(share);
            }
        }
    };
    let place = |p: DVec3| view.place_of(p).filter(|p| p.iter().all(|x| x.abs() < 1e6));
    for link in of.links_of(element) {
        let at = |k: u32| place(from.lerp(link.other, f64::from(k) / f64::from(STEPS)));
        for k in 0..STEPS {
            // (Where a panorama is cut open, lines leave on one side and come in on the other.)
            if let (Some(a), Some(b)) = (at(k), at(k + 1))
                && (a[0] - b[0]).abs() < 0.5 * f64::from(width)
            {
                segment([a, b], 0.5);
            }
        }
        if let Some(end) = place(link.other) {
            segment([end; 2], 1.5);
        }
    }
    covered
}
