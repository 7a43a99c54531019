//! The solution gathered again onto its own elements, until it no longer changes.
//!
//! ```text
//! H_i = D_i + Σ_j T_ij ρ_j H_j      T: the rays of final gathers from points all over element i
//! ```
//!
//! Elements of one value each lose light where surfaces meet, since what is close to an edge gets more from across it than the mean of an element tells; every
//! reflection loses it again. A final gather looks closely at what is near, so that its rays know; each of them ends at one element after another and is kept
//! with what it passed on the way. What they say of all elements together is a system of equations again, and its solution has the mean that many reflections
//! of such gathers lead to. Of an element that is partly hidden the rest of a room sees the brighter parts: irradiance counts more where more rays go far.
//! (It is the deferred correction of a coarse solver by a finer operator, and the iterated Galerkin method of [Sloan76] carried to
//! its fixed point.) Rows are estimated by chance, each with rays of its own: nothing is made or lost.

use rayon::prelude::*;

use super::gather::{FinalGather, Reach, Sink, near};
use crate::math::Frame;
use crate::radiosity::mesh::{self, POINTS};
use crate::sampling::{Stream, rng, sequence, warp};
use crate::spectrum::Spectrum;
use crate::transport::Shading;
use crate::transport::media::Media;

/// Rays of all elements, about, and of one at least and at most.
const BUDGET: usize = 1 << 21;
const RAYS: [usize; 2] = [64, 1024];
/// Places on an element from which they start, at most.
const PLACES: usize = 16;
/// Of the rays, one in so many is also a point of emissive surfaces.
const DIRECT: usize = 4;
/// Sweeps at most, and the relative change after which there is none.
const SWEEPS: u32 = 200;
const CHANGE: f32 = 2e-5;

/// What an element receives.
#[derive(Clone, Debug, Default)]
struct Row {
    /// Whatever the light of elements is, over π.
    constant: Spectrum,
    /// By element: the part of its irradiance that arrives here, by rising element.
    links: Vec<(u32, Spectrum)>,
}

impl FinalGather<'_> {
    /// Elements of which light can be found without a solution of another solver.
    pub const MOST_ELEMENTS: usize = 1 << 18;

    /// Gathers again onto the elements, with `rays` rays of each, about, and about two million in all, as far as 64 of each allow. Beyond [`Self::MOST_ELEMENTS`] the solution
    /// stays as it is. Where `is_over` says so it ends at once, with light that is of no use.
    pub fn settled(mut self, rays: u32, is_over: &(dyn Fn() -> bool + Sync)) -> Self {
        let n = self.irradiance.len();
        if n == 0 || n > Self::MOST_ELEMENTS {
            return self;
        }
        if self.irradiance.iter().all(|e| e.is_black()) {
            // Nothing is solved: a first look, to know how near elements may be taken as a whole.
            self.settle(RAYS[0], is_over);
            self.near = near(self.mesh, &self.irradiance);
        }
        self.settle((BUDGET / n).min(rays as usize).clamp(RAYS[0], RAYS[1]), is_over);
        self
    }

    /// Finds the light of all elements by `rays` rays of each.
    fn settle(&mut self, rays: usize, is_over: &(dyn Fn() -> bool + Sync)) {
        let n = self.irradiance.len() as u32;
        let row = |i| if is_over() { Row::default() } else { self.row(i, rays) };
        let rows: Vec<Row> = (0..n).into_par_iter().map(row).collect();
        for _ in 0..SWEEPS {
            let mut change = 0.0f32;
            for (i, row) in rows.iter().enumerate() {
                let Some(e) = row.asks(&self.irradiance) else { continue };
                let old = self.irradiance[i];
                change = change.max((e - old).map(f32::abs).max_channel() / e.max_channel().max(f32::MIN_POSITIVE));
                self.irradiance[i] = e;
            }
            if change <= CHANGE || is_over() {
                break;
            }
        }
    }

    /// What rays from all over an element bring: from each of some points two sets of rays, each weighed by how much of the other one went far.
    fn row(&self, i: u32, rays: usize) -> Row {
        let element = &self.mesh.elements()[i as usize];
        let n = element.normal.as_vec3();
        let exposed: Vec<u32> = (0..POINTS as u32).filter(|&k| element.exposes(k as usize)).take(PLACES).collect();
        if exposed.is_empty() || !n.is_finite() || element.area <= 0.0 {
            return Row::default();
        }
        let key = rng::key(&[self.seed, u64::from(i), 0x7365_7474_6C65]);
        let (frame, white, near) = (Frame::from_normal(n), Shading::white(n), self.near[i as usize]);
        let of_set = (rays / (2 * PLACES)).max(2) as u32;
        let n_points = (rays / (DIRECT * PLACES)).max(1) as u32;
        let (mut sets, mut n_rays) = (Vec::with_capacity(2 * exposed.len()), 0);
        for (place, &k) in (0..).zip(&exposed) {
            let surface = self.mesh.surface(self.world, element, mesh::point(i, k));
            // (One low-discrepancy set of points on emissive surfaces for the whole element.)
            let mut stream = Stream::new(key, 0, place);
            let lit = (n_points, &mut stream);
            let direct = self.lights.at_random(self.world, &surface, &white, Some(&Media::VACUUM), lit, &mut n_rays).diffuse;
            for half in 0..2 {
                let (sink, mut light, mut far) = (Sink::default(), Spectrum::BLACK, 0u32);
                for ray in 0..of_set {
                    let index = (2 * place as u32 + half) * of_set + ray;
                    let [u, bounce] = sequence::point_4d(index, key);
                    let dir = frame.to_world(warp::cosine_hemisphere(u));
                    let reach = Reach::noting(rng::mix(key ^ u64::from(index)), bounce, &sink);
                    let (arriving, distance) = self.arriving(&surface.ray(dir), reach, &mut n_rays);
                    light += arriving;
                    far += u32::from(distance >= near);
                }
                let light = direct + light * (1.0 / of_set as f32);
                sets.push(Set { light, noted: sink.into_inner(), far: far as f32 });
            }
        }
        let other = |k: usize| sets[k ^ 1].far;
        let all: f32 = sets.iter().map(|set| set.far).sum();
        // Where nothing is far, nothing far asks.
        let weight = |k: usize| if all > 0.0 { other(k) / all } else { 1.0 / sets.len() as f32 };
        let constant = sets.iter().enumerate().map(|(k, set)| set.light * weight(k)).sum();
        let mut links = Vec::with_capacity(sets.iter().map(|set| set.noted.len()).sum());
        for (k, set) in sets.iter().enumerate() {
            let share = weight(k) / of_set as f32;
            links.extend(set.noted.iter().filter(|_| share > 0.0).map(|&(j, through)| (j, through * share)));
        }
        links.sort_by_key(|link| link.0);
        links.dedup_by(|next, link| {
            let same = next.0 == link.0;
            if same {
                link.1 += next.1;
            }
            same
        });
        links.shrink_to_fit();
        Row { constant, links }
    }
}

/// What a set of rays from one place brings.
struct Set {
    /// Whatever the light of elements is, over π, direct light with it.
    light: Spectrum,
    /// Where rays ended, with what is left of the light there.
    noted: Vec<(u32, Spectrum)>,
    /// Rays that met nothing near.
    far: f32,
}

impl Row {
    /// The irradiance over π that it asks for; none where nothing is known.
    fn asks(&self, irradiance: &[Spectrum]) -> Option<Spectrum> {
        let sum = self.links.iter().map(|&(j, weight)| weight * irradiance[j as usize]).sum::<Spectrum>();
        let e = self.constant + sum;
        (e.to_array().iter().all(|v| v.is_finite())).then_some(e)
    }
}
