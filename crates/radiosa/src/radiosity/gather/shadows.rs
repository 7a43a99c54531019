//! Irradiance at the corners of elements whose borders are those of shadows.
//!
//! ```text
//! H(x) = D(x) + I(x)
//! ```
//!
//! D, the light of emitting surfaces, is gathered at the corners: elements end where it has its kinks, so that between corners it is nearly linear, but a thin
//! penumbra cannot be told from the means of elements around. I, all other light, has no such edges: it is what the solution has beyond the mean of D, and is interpolated as everywhere.

use rayon::prelude::*;

use super::{Gather, Scratch};
use crate::math::DVec3;
use crate::radiosity::direct::DirectLight;
use crate::radiosity::display;
use crate::radiosity::mesh::Element;
use crate::radiosity::solution::Solution;
use crate::sampling::rng;
use crate::scene::Light;
use crate::spectrum::Spectrum;
use crate::transport::World;

/// Corners are looked at from so far within the element, as a part of the way to its centre: what stands on its border has two sides.
const INSET: f64 = 0.01;
/// Rays to emitters from a corner beside one for each, at first, and where they see parts of them.
const RAYS: [f64; 2] = [64.0, 512.0];
/// Corners times emitting elements: larger meshes have smaller elements, and it would take long.
const MOST: usize = 1 << 24;

/// [`display::corner_values`] of `irradiance`, which is a solution's, or that without the light of lamps. Where it has that, `lamps` are given.
pub(in crate::radiosity) fn corner_values(
    world: &World,
    solution: &Solution,
    extra_lights: &[Light],
    irradiance: &[[f64; 3]],
    lamps: Option<&DirectLight>,
) -> Vec<[Spectrum; 4]> {
    let Solution { mesh, system, .. } = solution;
    let elements = mesh.elements();
    let emitting: Vec<u32> = (0..elements.len() as u32).filter(|&j| system.emission[j as usize] != [0.0; 3]).collect();
    let has_shadows = mesh.has_shadows();
    let is_at = |e: &Element| has_shadows[e.patch as usize] && e.area > 0.0;
    let n_corners = 5 * elements.iter().filter(|e| is_at(e)).count();
    if n_corners == 0 || n_corners.saturating_mul(emitting.len()) > MOST {
        return display::corner_values(world, mesh, irradiance);
    }
    let gather = Gather::new(world, solution, extra_lights, 0);
    // (At the corners, and the mean.)
    let direct: Vec<Option<([Spectrum; 4], Spectrum)>> = elements
        .par_iter()
        .map_init(Scratch::default, |scratch, element| {
            if !is_at(element) {
                return None;
            }
            let (c, centre) = (element.corners(), element.centre());
            let mut at = |p: DVec3| gather.emitted_at(element, p, &emitting, lamps, scratch);
            let corners: [Spectrum; 4] = std::array::from_fn(|k| if k < c.len() { at(c[k]) } else { Spectrum::BLACK });
            let mean = corners.iter().copied().sum::<Spectrum>() * (1.0 / c.len() as f32);
            // (Right for what is quadratic.)
            let (weight, all) = if c.len() == 4 { (2.0, 3.0) } else { (3.0, 4.0) };
            let mean = (at(centre) * weight + mean) * (1.0 / all);
            let corners = if c.len() == 4 { corners } else { [corners[0], corners[1], corners[2], corners[2]] };
            // (The solution's is over what light can reach.)
            Some((corners, mean * (1.0 / element.exposed().max(1e-6) as f32)))
        })
        .collect();
    let rest = |(h, d): (&[f64; 3], &Option<([Spectrum; 4], Spectrum)>)| {
        let d = d.map_or([0.0; 3], |(_, mean)| mean.to_array().map(f64::from));
        std::array::from_fn(|c| h[c] - d[c])
    };
    let rest: Vec<[f64; 3]> = irradiance.iter().zip(&direct).map(rest).collect();
    let mut corners = display::corner_values(world, mesh, &rest);
    for (corners, direct) in corners.iter_mut().zip(&direct) {
        let Some((direct, _)) = direct else { continue };
        corners.iter_mut().zip(direct).for_each(|(corner, d)| *corner = (*corner + *d).map(|h| h.max(0.0)));
    }
    corners
}

impl Gather<'_> {
    /// The light of emitting elements, and of lamps, at a corner of an element.
    fn emitted_at(
        &self,
        element: &Element,
        corner: DVec3,
        emitting: &[u32],
        lamps: Option<&DirectLight>,
        scratch: &mut Scratch,
    ) -> Spectrum {
        // Elements that meet in a corner look from there by the same rays.
        let grain = 1e-3 * self.world.accel().bounds().extent().length() as f64 * INSET;
        let place = (corner / grain.max(f64::MIN_POSITIVE)).to_array().map(|x| x.round() as i64 as u64);
        let key = rng::key(&[self.seed, place[0], place[1], place[2], 0x7368_6164]);
        let (p, n) = (corner.lerp(element.centre(), INSET), element.normal);
        let start = element.lift().in_front(p);
        self.collect_emitting(start.as_dvec3(), n, emitting, scratch);
        for rays in RAYS {
            self.look(start, n, rays, key, scratch);
            if scratch.pieces.iter().all(|piece| piece.seen <= 0.0) || scratch.pieces.iter().all(|piece| piece.seen >= 1.0) {
                break;
            }
        }
        let of_lamps = |lamps: &DirectLight| {
            let patch = &self.solution.mesh.patches()[element.patch as usize];
            lamps.of_lamps(&crate::radiosity::mesh::surface_of(self.world, patch, p, n), n.as_vec3())
        };
        scratch.arriving() + lamps.filter(|lamps| lamps.has_lamps()).map_or(Spectrum::BLACK, of_lamps)
    }
}
