//! The solution gathered again onto its own elements, or pools of small ones, until it no longer changes.
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

use std::ops::Range;

use rayon::prelude::*;

use super::gather::{FinalGather, Reach, Sink};
use super::near::{near, pools};
use super::slope::slopes;
use crate::math::{Frame, Vec3};
use crate::radiosity::mesh::{self, ElementMesh, POINTS};
use crate::sampling::{Stream, rng, sequence, warp};
use crate::spectrum::Spectrum;
use crate::transport::Shading;
use crate::transport::media::Media;

/// Pools at most.
pub(super) const MOST: usize = 1 << 18;
/// Rays of all elements, about, of one at least and at most, and for its first look.
const BUDGET: usize = 1 << 21;
const RAYS: [usize; 2] = [32, 1024];
const FIRST: usize = 16;
/// Places on an element from which they start at most, and how many rays of each there are at least.
const PLACES: usize = 16;
const OF_PLACE: usize = 4;
/// Of the rays, one in so many is also a point of emissive surfaces.
const DIRECT: usize = 4;
/// Sweeps at most, and the relative change after which there is none.
const SWEEPS: u32 = 200;
const CHANGE: f32 = 2e-5;
/// What a row may pass on: as much as the brightest surface reflects, within these limits.
const REFLECTED: [f32; 2] = [0.99, 0.9999];

/// What a pool receives.
#[derive(Clone, Debug, Default)]
struct Row {
    /// Whatever the light of pools is, over π.
    constant: Spectrum,
    /// The mean of the places, weighed like what they receive; none of a pool without places.
    centre: Option<Vec3>,
    /// By pool: the part of its irradiance that arrives here, by rising pool.
    links: Vec<(u32, Spectrum)>,
}

impl FinalGather<'_> {
    /// Light can be found on a mesh without a solution of another solver: small elements are pooled, and the others are not too many.
    pub fn finds_light_on(mesh: &ElementMesh) -> bool {
        mesh.elements().len() <= MOST || pools(mesh).n() <= MOST
    }

    /// Gathers again onto the elements, or pools of them, with `rays` rays of each, about, and about two million in all, as far as 32 of each allow. Beyond 2¹⁸ pools the solution
    /// stays as it is. Where `is_over` says so it ends at once, with light that is of no use.
    pub fn settled(mut self, rays: u32, is_over: &(dyn Fn() -> bool + Sync)) -> Self {
        let n = self.irradiance.len();
        if n == 0 || n > MOST {
            return self;
        }
        let rays = (BUDGET / n).min(rays as usize).clamp(RAYS[0], RAYS[1]);
        let mut rows;
        if self.irradiance.iter().any(|e| !e.is_black()) {
            rows = self.rows(0..rays, is_over);
        } else {
            // Nothing is solved: a first look, to know how near elements may be taken as a whole.
            let first = self.rows(0..FIRST, is_over);
            self.settle(&first, is_over);
            self.near = near(self.mesh, &self.pools, &self.narrow, &self.irradiance);
            rows = self.rows(FIRST..rays, is_over);
            let share = FIRST as f32 / rays as f32;
            rows = first.into_iter().zip(rows).map(|(first, more)| first.mixed(share, more)).collect();
        }
        self.settle(&rows, is_over);
        self.near = near(self.mesh, &self.pools, &self.narrow, &self.irradiance);
        let centres: Vec<Vec3> = rows.iter().zip(&self.slopes).map(|(row, old)| row.centre.unwrap_or(old.centre)).collect();
        self.slopes = slopes(self.mesh, &self.pools, &self.irradiance, &centres);
        self
    }

    /// With irradiances, over π, that were found before, and what they are around. `None` where they are not as many as pools.
    pub(super) fn knowing(mut self, irradiance: Vec<Spectrum>, centres: &[Vec3]) -> Option<Self> {
        if irradiance.len() != self.irradiance.len() || centres.len() != irradiance.len() {
            return None;
        }
        self.irradiance = irradiance;
        self.slopes = slopes(self.mesh, &self.pools, &self.irradiance, centres);
        self.near = near(self.mesh, &self.pools, &self.narrow, &self.irradiance);
        Some(self)
    }

    /// What some rays of each pool say it receives.
    fn rows(&self, rays: Range<usize>, is_over: &(dyn Fn() -> bool + Sync)) -> Vec<Row> {
        let n = self.irradiance.len() as u32;
        let row = |i| if is_over() { Row::default() } else { self.row(i, rays.clone()) };
        (0..n).into_par_iter().map(row).collect()
    }

    /// Finds the light of all pools.
    fn settle(&mut self, rows: &[Row], is_over: &(dyn Fn() -> bool + Sync)) {
        let most = self.reflectance.iter().map(|rho| rho.max_channel()).fold(REFLECTED[0], f32::max).min(REFLECTED[1]);
        let passed: Vec<Spectrum> = rows.iter().map(|row| row.passed(most)).collect();
        for _ in 0..SWEEPS {
            let mut change = 0.0f32;
            for (i, (row, passed)) in rows.iter().zip(&passed).enumerate() {
                let Some(e) = row.asks(&self.irradiance, *passed) else { continue };
                let old = self.irradiance[i];
                change = change.max((e - old).map(f32::abs).max_channel() / e.max_channel().max(f32::MIN_POSITIVE));
                self.irradiance[i] = e;
            }
            if change <= CHANGE || is_over() {
                break;
            }
        }
    }

    /// About as many places on a pool from which rays go out: an element, and which of its points. Others are those of other ranges.
    fn places(&self, p: usize, places: Range<usize>, key: u64) -> Vec<(u32, u32)> {
        let n = places.len();
        let elements = self.mesh.elements();
        let is_exposed = |i: u32, k: u32| elements[i as usize].exposes(k as usize);
        let is_sound = |i: u32| elements[i as usize].normal.is_finite() && elements[i as usize].area > 0.0;
        if let [only] = self.pools.members(p) {
            let exposed = (0..POINTS as u32).filter(|&k| is_sound(*only) && is_exposed(*only, k));
            return exposed.skip(places.start).take(n).map(|k| (*only, k)).collect();
        }
        // One in each of equal parts of its area.
        let place = |part: usize| {
            let place = (places.start + part) as u32;
            let within = f64::from(rng::unit_f32((rng::nth(key, u64::from(place)) >> 32) as u32));
            let (i, _) = self.pools.at(p, (part as f64 + within) / n as f64);
            let k = (0..POINTS as u32).map(|k| (k + place) % POINTS as u32).find(|&k| is_sound(i) && is_exposed(i, k))?;
            Some((i, k))
        };
        (0..n).filter_map(place).collect()
    }

    /// What rays from all over a pool bring: from each of some points two sets of rays, each weighed by how much of the other one went far.
    fn row(&self, p: u32, rays: Range<usize>) -> Row {
        let key = rng::key(&[self.seed, u64::from(p), 0x7365_7474_6C65]);
        let near = self.near[p as usize];
        let n_places = (rays.len() / OF_PLACE).clamp(1, PLACES);
        let of_set = (rays.len() / (2 * n_places)).max(1) as u32;
        let n_points = (rays.len() / (DIRECT * n_places)).max(1) as u32;
        let first = (rays.start / OF_PLACE).min(PLACES);
        let places = self.places(p as usize, first..first + n_places, key);
        let (mut sets, mut n_rays) = (Vec::with_capacity(2 * places.len()), 0);
        for (place, (i, k)) in (0u32..).zip(places) {
            let element = &self.mesh.elements()[i as usize];
            let n = element.normal.as_vec3();
            let (frame, white) = (Frame::from_normal(n), Shading::white(n));
            let surface = self.mesh.surface(self.world, element, mesh::point(i, k));
            // (One low-discrepancy set of points on emissive surfaces for the whole pool.)
            let mut stream = Stream::new(key, 0, first as u64 + u64::from(place));
            let lit = (n_points, &mut stream);
            let direct = self.lights.at_random(self.world, &surface, &white, Some(&Media::VACUUM), lit, &mut n_rays).diffuse;
            for half in 0..2 {
                let (sink, mut light, mut far) = (Sink::default(), Spectrum::BLACK, 0u32);
                for ray in 0..of_set {
                    let index = rays.start as u32 + (2 * place + half) * of_set + ray;
                    let [u, bounce] = sequence::point_4d(index, key);
                    let dir = frame.to_world(warp::cosine_hemisphere(u));
                    let reach = Reach::noting(rng::mix(key ^ u64::from(index)), bounce, self.within, &sink);
                    let (arriving, distance) = self.arriving(&surface.ray(dir), reach, &mut n_rays);
                    light += arriving;
                    far += u32::from(distance >= near);
                }
                let light = direct + light * (1.0 / of_set as f32);
                sets.push(Set { light, p: surface.p, noted: sink.into_inner(), far: far as f32 });
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
        let centre = (!sets.is_empty()).then(|| sets.iter().enumerate().map(|(k, set)| set.p * weight(k)).sum());
        Row { constant, centre, links: by_pool(links) }
    }
}

/// What a set of rays from one place brings.
struct Set {
    /// Whatever the light of pools is, over π, direct light with it.
    light: Spectrum,
    /// Where it is.
    p: Vec3,
    /// Where rays ended, with what is left of the light there.
    noted: Vec<(u32, Spectrum)>,
    /// Rays that met nothing near.
    far: f32,
}

/// Rising and each pool once.
fn by_pool(mut links: Vec<(u32, Spectrum)>) -> Vec<(u32, Spectrum)> {
    links.sort_by_key(|link| link.0);
    links.dedup_by(|next, link| {
        let same = next.0 == link.0;
        if same {
            link.1 += next.1;
        }
        same
    });
    links.shrink_to_fit();
    links
}

impl Row {
    /// A share of it, and the rest of another; all of it where that has no places.
    fn mixed(self, share: f32, other: Self) -> Self {
        if other.centre.is_none() {
            return self;
        }
        let part = |row: Self, share: f32| row.links.into_iter().map(move |(j, weight)| (j, weight * share));
        let constant = self.constant * share + other.constant * (1.0 - share);
        let centre = self.centre.zip(other.centre).map(|(a, b)| a * share + b * (1.0 - share)).or(other.centre);
        Self { constant, centre, links: by_pool(part(self, share).chain(part(other, 1.0 - share)).collect()) }
    }

    /// The part that is passed on of what its links say: no surface reflects more than it receives, and what chance made more, for few rays, would grow without end from
    /// pool to pool.
    fn passed(&self, most: f32) -> Spectrum {
        let sum = self.links.iter().map(|link| link.1).sum::<Spectrum>();
        sum.map(|sum| if sum > most { most / sum } else { 1.0 })
    }

    /// The irradiance over π that it asks for, where such a part is passed on; none where that is not finite.
    fn asks(&self, irradiance: &[Spectrum], passed: Spectrum) -> Option<Spectrum> {
        let sum = self.links.iter().map(|&(j, weight)| weight * irradiance[j as usize]).sum::<Spectrum>();
        let e = self.constant + passed * sum;
        (e.to_array().iter().all(|v| v.is_finite())).then_some(e)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_look_from_nowhere_takes_nothing_away() {
        let row =
            |e: f32, centre: Option<Vec3>| Row { constant: Spectrum::gray(e), centre, links: vec![(3, Spectrum::gray(0.5 * e))] };
        let nowhere = row(1.0, Some(Vec3::X)).mixed(0.25, Row::default());
        assert_eq!((nowhere.constant.g, nowhere.links[0].1.g, nowhere.centre), (1.0, 0.5, Some(Vec3::X)));
        let both = row(1.0, Some(Vec3::X)).mixed(0.25, row(3.0, Some(-Vec3::X)));
        assert_eq!((both.constant.g, both.links[0].1.g, both.centre), (2.5, 1.25, Some(-0.5 * Vec3::X)));
        assert_eq!(row(1.0, None).mixed(0.25, row(3.0, Some(Vec3::Y))).centre, Some(Vec3::Y));
    }
}
