//! How irradiance changes within elements, from what their neighbours receive.
//!
//! ```text
//! E(x) = E_i + g_i · (x − c_i),    g_i = argmin Σ_j (g · (c_j − c_i) − (E_j − E_i))²
//! ```
//!
//! Least squares over the elements across their edges, as finite volumes reconstruct what they know means of. Each has its mean at the centre `c_i` of what that is a mean
//! of: where gathers found it, of the parts from which many rays go far.

use rayon::prelude::*;

use crate::math::{DVec2, DVec3, Frame, Vec3};
use crate::radiosity::mesh::{Element, ElementMesh};
use crate::radiosity::solve::pools::Pools;
use crate::spectrum::Spectrum;

/// Of one element.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Slope {
    /// Where it has its mean.
    pub(super) centre: Vec3,
    /// By channel: the change of irradiance, over π, per metre.
    change: [Vec3; 3],
}

impl Slope {
    /// What is added to the mean at a place.
    pub(super) fn at(&self, p: Vec3) -> Spectrum {
        let from = p - self.centre;
        Spectrum::from(self.change.map(|change| change.dot(from)))
    }
}

/// The centres of elements, by pool.
pub(super) fn centres(mesh: &ElementMesh, pools: &Pools) -> Vec<Vec3> {
    (0..pools.n()).map(|p| mesh.elements()[pools.members(p)[0] as usize].centre().as_vec3()).collect()
}

/// By pool, from the irradiance and the centre of each; none of those of several elements, nor of elements that others cover in part.
pub(super) fn slopes(mesh: &ElementMesh, pools: &Pools, irradiance: &[Spectrum], centres: &[Vec3]) -> Vec<Slope> {
    let of = |i: u32| {
        let p = pools.of_element(i as usize) as usize;
        (irradiance[p], centres[p].as_dvec3())
    };
    let slope = |p: usize| match *pools.members(p) {
        [i] if mesh.elements()[i as usize].exposed() == 1.0 => of_element(mesh, &mesh.elements()[i as usize], of(i), of),
        _ => Slope { centre: centres[p], ..Slope::default() },
    };
    (0..pools.n()).into_par_iter().map(slope).collect()
}

fn of_element(
    mesh: &ElementMesh,
    element: &Element,
    (own, centre): (Spectrum, DVec3),
    of: impl Fn(u32) -> (Spectrum, DVec3),
) -> Slope {
    let frame = Frame::from_normal(element.normal.as_vec3());
    let along = |v: DVec3| DVec2::new(frame.to_local(v.as_vec3()).x.into(), frame.to_local(v.as_vec3()).y.into());
    // The normal equations, A g = b of each channel.
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    let mut b = [DVec2::ZERO; 3];
    let mut most = [0.0f32; 3];
    for j in mesh.neighbours(element) {
        let (there, other) = of(j as u32);
        let (step, d) = (there - own, along(other - centre));
        (xx, xy, yy) = (xx + d.x * d.x, xy + d.x * d.y, yy + d.y * d.y);
        for (k, step) in step.to_array().into_iter().enumerate() {
            b[k] += d * f64::from(step);
            most[k] = most[k].max(step.abs());
        }
    }
    // (Where neighbours lie along one line, nothing is known across it.)
    let little = 1e-6 * (xx + yy);
    let (xx, yy) = (xx + little, yy + little);
    let determinant = xx * yy - xy * xy;
    if !(determinant > 0.0 && determinant.is_finite()) {
        return Slope { centre: centre.as_vec3(), ..Slope::default() };
    }
    let own = own.to_array();
    let change = std::array::from_fn(|k| {
        let g = DVec2::new(b[k].x * yy - b[k].y * xy, b[k].y * xx - b[k].x * xy) / determinant;
        // Nowhere on the element negative, nor more from its mean than a neighbour's.
        let reach = element.corners().iter().map(|c| g.dot(along(*c - centre)).abs()).fold(0.0, f64::max);
        let most = f64::from(most[k].min(own[k]));
        let g = if reach > most { g * (most / reach) } else { g };
        frame.to_world(Vec3::new(g.x as f32, g.y as f32, 0.0))
    });
    Slope { centre: centre.as_vec3(), change }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::CpuPath;
    use crate::radiosity::direct::DirectLight;
    use crate::radiosity::mesh::{Settings, Sides};
    use crate::transport::World;

    fn mesh(elements: u32) -> ElementMesh {
        let scene = crate::import::sample::load("cornell-box").expect("it is built in");
        let world = World::prepare(scene, CpuPath::detect()).expect("it is valid");
        let settings = Settings { elements, sides: Sides::Both, cuts_contacts: false, ..Settings::default() };
        ElementMesh::new(&world, &settings, &DirectLight::new(&world, &[], 0))
    }

    /// How far from a field elements are at their corners, root mean square over it, with and without slopes.
    fn errors(mesh: &ElementMesh, field: impl Fn(DVec3) -> f32) -> [f32; 2] {
        let pools = Pools::with(mesh, usize::MAX, 1.0);
        let irradiance: Vec<Spectrum> = mesh.elements().iter().map(|e| Spectrum::gray(field(e.centre()))).collect();
        let slopes = slopes(mesh, &pools, &irradiance, &centres(mesh, &pools));
        let (mut n, mut errors) = (0.0, [0.0; 2]);
        for (i, element) in mesh.elements().iter().enumerate() {
            assert_eq!(slopes[i].at(element.centre().as_vec3()), Spectrum::BLACK, "means are kept");
            for corner in element.corners() {
                let (own, truth) = (irradiance[i].g, field(*corner));
                let [with, without] = [own + slopes[i].at(corner.as_vec3()).g, own];
                assert!(with >= -1e-6, "{with}");
                errors[0] += (with / truth - 1.0).powi(2);
                errors[1] += (without / truth - 1.0).powi(2);
                n += 1.0;
            }
        }
        errors.map(|sum| (sum / n).sqrt())
    }

    #[test]
    fn what_changes_smoothly_is_known_within_elements() {
        let smooth = |p: DVec3| (2.0 + (4.0 * p.x).sin() * (3.0 * p.z).cos() + p.y) as f32;
        let [few, many] = [300, 4800].map(|n| errors(&mesh(n), smooth));
        assert!(few[0] < 0.5 * few[1] && many[0] < 0.3 * many[1], "{few:?} {many:?}");
        // The twin, elements of one value, halves its error where sides are divided by four.
        assert!(many[0] < 0.14 * few[0], "second order: {few:?} {many:?}");
        assert!((0.2..0.35).contains(&(many[1] / few[1])), "first order: {few:?} {many:?}");
    }

    #[test]
    fn shadows_do_not_make_light_negative() {
        // (Whether it is negative is asked within.)
        errors(&mesh(600), |p| if p.x + 0.4 * p.z < 0.3 { 1e-3 } else { 5.0 });
    }
}
