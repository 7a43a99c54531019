//! Stochastic Jacobi: rays instead of form factors, for scenes whose matrix cannot be held. Source: [Bekaert99].
//!
//! ```text
//! repeat: of N rays, every element j sends out N_j in proportion to its unshot power A_j U_j, from places all over it, by the cosine
//!         the element i that a ray meets:  H_i += A_j U_j / (N_j A_i);  its ρ_i-th part is unshot power of the next iteration
//! ```
//!
//! An iteration sends out what the one before has brought, with rays of the same power throughout, so they become fewer; a round ends when less than one ray
//! is left. Rounds are solutions of their own, and their mean is the result.
//!
//! - The paper goes on with iterations that send out everything again. Those feed on each other's noise, so that their spread understates the error; rounds share
//!   nothing but the order of their samples. So the spread of rounds is the error, or more than it, since each element goes on in its own low-discrepancy sequence.
//! - In scenes of very many triangles small neighbours are pooled ([`Pools`]): where it says element, read pool. The light of lamps stays with each element.
//! - Streams are keyed by (seed, element) and go on by sample; hits are added up in the order of rays. So nothing depends on the number of threads.
//! - Where no light gets lost and surfaces reflect most of it, rounds after the first subtract a constant from all radiosities ([`Stochastic::control`]): what it stands
//!   for is known without rays, and rays only carry what differs from it.
//! - An element that gets less than one ray gets one with that probability, and it carries what it would have carried: right on average. Else its rays carry its power, exactly.
//! - What lies behind a transparent surface is reached by rays that pass it, with the probability that it lets light through. As in rows of form factors, which then
//!   sum to more than one, what is met behind counts beside the surface; what passed is not absorbed by it.
//! - In an absorbing medium a ray brings what is left of its power after its length.

use std::io;

use rayon::prelude::*;

use super::super::medium::Medium;
use super::super::mesh::{self, Element, ElementMesh, Lift};
use super::super::system::{Sums, System, Unknowns};
use super::pools::Pools;
use crate::math::{DVec3, Frame, Ray, Vec2};
use crate::sampling::{rng, sequence, warp};
use crate::stream::{In, Out};
use crate::transport::World;

/// How to shoot rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Rays of the first iteration of a round; zero: 8 for each element, between 2^16 and 2^22.
    pub rays: u32,
    /// Rounds at least, before their spread is believed.
    pub rounds: u32,
    /// Subtract a constant where that is known to be right, and pays ([`Stochastic`]).
    pub has_control: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self { rays: 0, rounds: 8, has_control: true }
    }
}

/// Rays of one piece of work: never dependent on the number of threads.
const PIECE: u64 = 4096;
/// Pieces whose hits are held at once.
const PIECES: usize = 256;
/// Subtracting a constant pays where light is reflected as many times as this.
const WORTH: f64 = 4.0;
/// Transparent surfaces a ray passes at most.
const MAX_LAYERS: u32 = 64;
/// In place of an element: a ray met none; once for every meeting after its first; and once for a ray that passed what it met and met no more.
const NOTHING: u32 = u32::MAX;
const AGAIN: u32 = u32::MAX - 1;
const OUT: u32 = u32::MAX - 2;

/// What is known of every pool before anything is sent out.
#[derive(Clone, Debug, Default)]
struct Pooled {
    area: Vec<f64>,
    reflectance: Vec<[f64; 3]>,
    /// `E + ρ D`.
    initial: Vec<[f64; 3]>,
    direct: Vec<[f64; 3]>,
    medium: Medium,
}

impl Pooled {
    fn new(system: &System, pools: &Pools) -> Self {
        let area = |p: usize| pools.members(p).iter().map(|&i| system.area[i as usize]).sum();
        Self {
            area: (0..pools.n()).map(area).collect(),
            reflectance: pools.means(&system.area, |i| system.reflectance[i]),
            initial: pools.means(&system.area, |i| system.initial(i)),
            direct: pools.means(&system.area, |i| system.direct[i]),
            medium: system.medium,
        }
    }
}

/// Rounds so far, and the one on its way. Columns are by pool.
#[derive(Clone, Debug)]
pub struct Stochastic {
    pools: Pools,
    pooled: Pooled,
    seed: u64,
    settings: Settings,
    /// Power of one ray: the first iteration's unshot power over its rays, all channels together.
    quantum: f64,
    /// Samples each element has used.
    used: Vec<u32>,
    /// Iterations so far, the key of what is drawn once for each.
    iteration: u64,
    /// H − D and U of the round.
    irradiance: Vec<[f64; 3]>,
    unshot: Vec<[f64; 3]>,
    /// β of the round, by channel: `H − D − β` and U are what is solved for. Zero: nothing is subtracted.
    control: [f64; 3],
    /// Elements with something to send, rising.
    active: Vec<u32>,
    /// Power on its way; nothing between iterations.
    arriving: Vec<[f64; 3]>,
    /// Rounds that are finished, and over them the sums of H − D, its square, and U.
    rounds: u32,
    sum: Vec<[f64; 3]>,
    squares: Vec<[f64; 3]>,
    left: Vec<[f64; 3]>,
    /// Of every element: rays that left the scene, less meetings behind transparent surfaces, in all rounds.
    escaped_rays: Vec<i64>,
    /// Power that left the scene, in this round and in those before.
    escaped: [[f64; 3]; 2],
    /// The same of power that passed transparent surfaces, once for each.
    passed: [[f64; 3]; 2],
    /// Power that the medium absorbed, likewise.
    in_medium: [[f64; 3]; 2],
    /// Rays that carried light.
    pub n_rays: u64,
}

impl Stochastic {
    /// Nothing has been sent out.
    pub fn new(system: &System, pools: Pools, settings: Settings, seed: u64) -> Self {
        let n = pools.n();
        let pooled = Pooled::new(system, &pools);
        let zero = || vec![[0.0; 3]; n];
        let rays = if settings.rays == 0 { (8 * n as u64).clamp(1 << 16, 1 << 22) } else { u64::from(settings.rays) };
        let mut stochastic = Self {
            pools,
            pooled: Pooled::default(),
            seed: rng::key(&[seed, 0x7374_6F63]),
            settings,
            quantum: 0.0,
            used: vec![0; n],
            iteration: 0,
            irradiance: zero(),
            unshot: zero(),
            control: [0.0; 3],
            active: Vec::new(),
            arriving: zero(),
            rounds: 0,
            sum: zero(),
            squares: zero(),
            left: zero(),
            escaped_rays: vec![0; n],
            escaped: [[0.0; 3]; 2],
            passed: [[0.0; 3]; 2],
            in_medium: [[0.0; 3]; 2],
            n_rays: 0,
        };
        stochastic.begin(&pooled);
        stochastic.quantum = (0..n).map(|p| stochastic.weight(&pooled, p)).sum::<f64>() / rays as f64;
        stochastic.pooled = pooled;
        stochastic
    }

    pub(in super::super) fn store(&self, out: &mut Out) -> io::Result<()> {
        for number in [self.quantum.to_bits(), self.iteration, u64::from(self.rounds), self.n_rays] {
            out.number(number)?;
        }
        out.array(&self.used)?;
        for column in [&self.irradiance, &self.unshot, &self.sum, &self.squares, &self.left] {
            out.array(column)?;
        }
        out.array(&self.escaped_rays)?;
        out.array(&self.escaped)?;
        out.array(&self.passed)?;
        out.array(&self.in_medium)?;
        out.array(&[self.control])
    }

    /// Goes on where [`Self::store`] was called, by the same system, settings and seed.
    pub(in super::super) fn restore(&mut self, from: &mut In) -> io::Result<()> {
        let n = self.used.len();
        self.quantum = f64::from_bits(from.number()?);
        self.iteration = from.number()?;
        self.rounds = from.number()? as u32;
        self.n_rays = from.number()?;
        self.used = from.array(n)?;
        for column in [&mut self.irradiance, &mut self.unshot, &mut self.sum, &mut self.squares, &mut self.left] {
            *column = from.array(n)?;
        }
        self.escaped_rays = from.array(n)?;
        self.escaped.copy_from_slice(&from.array(2)?);
        self.passed.copy_from_slice(&from.array(2)?);
        self.in_medium.copy_from_slice(&from.array(2)?);
        self.control.copy_from_slice(&from.array::<[f64; 3]>(1)?[0]);
        self.find_active();
        Ok(())
    }

    /// A new round.
    fn begin(&mut self, pooled: &Pooled) {
        self.irradiance.fill([0.0; 3]);
        let beta = self.control;
        for ((unshot, initial), rho) in self.unshot.iter_mut().zip(&pooled.initial).zip(&pooled.reflectance) {
            *unshot = std::array::from_fn(|c| initial[c] - (1.0 - rho[c]) * beta[c]);
        }
        for [now, _] in [&mut self.escaped, &mut self.passed, &mut self.in_medium] {
            *now = [0.0; 3];
        }
        self.find_active();
    }

    fn find_active(&mut self) {
        self.active = (0..self.unshot.len() as u32).filter(|&i| self.unshot[i as usize] != [0.0; 3]).collect();
    }

    /// `A U`, channels together: what decides about the number of rays.
    fn weight(&self, pooled: &Pooled, i: usize) -> f64 {
        pooled.area[i] * self.unshot[i].iter().map(|u| u.abs()).sum::<f64>()
    }

    /// Iterations with about a ray for every element together, or to the end of the round: the last ones of a round have few rays. The unknowns become the mean of
    /// the finished rounds, or what is known of the first.
    pub fn step(&mut self, world: &World, mesh: &ElementMesh, system: &System, unknowns: &mut Unknowns, sums: &mut Sums) {
        let pooled = std::mem::take(&mut self.pooled);
        let mut sent = 0;
        loop {
            sent += self.iterate(world, mesh, &pooled);
            self.give_up_control(&pooled);
            // Less than one ray is left: the round is over.
            let left: f64 = self.active.iter().map(|&i| self.weight(&pooled, i as usize)).sum();
            if left <= self.quantum {
                self.finish(&pooled);
                break;
            }
            if sent >= self.pools.n() as u64 {
                break;
            }
        }
        self.pooled = pooled;
        self.read(system, unknowns, sums);
    }

    /// One iteration; the number of its rays. What it takes depends on who has anything to send, and on what is met.
    fn iterate(&mut self, world: &World, mesh: &ElementMesh, system: &Pooled) -> u64 {
        self.iteration += 1;
        let active = std::mem::take(&mut self.active);
        let rays = self.distribute(system, &active);
        let of = |(&j, &rays): (&u32, &u32)| {
            let expected = self.weight(system, j as usize) / self.quantum;
            let share = if rays == 0 { 0.0 } else { 1.0 / if expected < 1.0 { expected } else { f64::from(rays) } };
            self.unshot[j as usize].map(|u| u * system.area[j as usize] * share)
        };
        let power: Vec<[f64; 3]> = active.iter().zip(&rays).map(of).collect();
        let mut starts = vec![0u64; active.len() + 1];
        rays.iter().enumerate().for_each(|(k, &n)| starts[k + 1] = starts[k] + u64::from(n));
        let total = starts[active.len()];
        self.n_rays += total;
        let mut touched = Vec::new();
        let pieces: Vec<u64> = (0..total.div_ceil(PIECE)).collect();
        for pieces in pieces.chunks(PIECES) {
            let met: Vec<Vec<([u32; 2], f32)>> = pieces
                .par_iter()
                .map(|piece| self.trace(world, mesh, (&active, &starts), piece * PIECE..((piece + 1) * PIECE).min(total)))
                .collect();
            for ([from, to], distance) in met.into_iter().flatten() {
                let carried = power[from as usize];
                if to >= OUT {
                    self.escaped_rays[active[from as usize] as usize] += i64::from(to == NOTHING) - i64::from(to == AGAIN);
                    // What leaves the scene has left the medium; what passes a surface has come as far as that.
                    let tau = if to == NOTHING { [1.0; 3] } else { system.medium.transmittance(f64::from(distance)) };
                    for c in 0..3 {
                        let power = carried[c] * tau[c];
                        if to != AGAIN {
                            self.escaped[0][c] += power;
                        } else {
                            // It goes on to where its whole way counts.
                            self.in_medium[0][c] -= carried[c] - power;
                        }
                        if to != NOTHING {
                            self.passed[0][c] += power;
                        }
                    }
                } else {
                    let sum = &mut self.arriving[to as usize];
                    if *sum == [0.0; 3] {
                        touched.push(to);
                    }
                    let tau = system.medium.transmittance(f64::from(distance));
                    for c in 0..3 {
                        sum[c] += carried[c] * tau[c];
                        self.in_medium[0][c] += carried[c] * (1.0 - tau[c]);
                    }
                }
            }
        }
        for (&j, rays) in active.iter().zip(rays) {
            self.used[j as usize] = self.used[j as usize].wrapping_add(rays);
            self.unshot[j as usize] = [0.0; 3];
        }
        touched.sort_unstable();
        touched.dedup();
        for &j in &touched {
            let j = j as usize;
            for (c, power) in std::mem::take(&mut self.arriving[j]).into_iter().enumerate() {
                let arriving = if system.area[j] > 0.0 { power / system.area[j] } else { 0.0 };
                self.irradiance[j][c] += arriving;
                self.unshot[j][c] = system.reflectance[j][c] * arriving;
            }
        }
        self.active = touched;
        total
    }

    /// Whole numbers of rays in proportion to unshot power, one stroke for every quantum of it: every element of `active` gets its number rounded up or down.
    fn distribute(&self, system: &Pooled, active: &[u32]) -> Vec<u32> {
        let offset = f64::from(rng::unit_f32((rng::key(&[self.seed, self.iteration]) >> 32) as u32));
        let (mut sum, mut before) = (offset, 0.0);
        let rays = active.iter().map(|&i| {
            if self.quantum > 0.0 {
                sum += self.weight(system, i as usize) / self.quantum;
            }
            let n = sum.floor() - before;
            before = sum.floor();
            n as u32
        });
        rays.collect()
    }

    /// Traces rays of a range: the place in `active` of the element each starts from, the element it meets and how far away, in order.
    fn trace(
        &self,
        world: &World,
        mesh: &ElementMesh,
        (active, starts): (&[u32], &[u64]),
        range: std::ops::Range<u64>,
    ) -> Vec<([u32; 2], f32)> {
        let mut met = Vec::with_capacity((range.end - range.start) as usize);
        let mut at = starts.partition_point(|&s| s <= range.start) - 1;
        let source = |at: usize| Source::new(mesh, &self.pools, active[at] as usize, self.seed);
        let mut element = source(at);
        for k in range {
            if starts[at + 1] <= k {
                while starts[at + 1] <= k {
                    at += 1;
                }
                element = source(at);
            }
            let sample = self.used[active[at] as usize].wrapping_add((k - starts[at]) as u32);
            follow(world, mesh, element.ray(sample), rng::key(&[element.key, u64::from(sample)]), |to, distance| {
                let pool = if to < OUT { self.pools.of_element(to as usize) } else { to };
                met.push(([at as u32, pool], distance));
            });
        }
        met
    }

    fn finish(&mut self, pooled: &Pooled) {
        self.rounds += 1;
        for i in 0..self.pools.n() {
            for c in 0..3 {
                let h = self.control[c] + self.irradiance[i][c];
                self.sum[i][c] += h;
                self.squares[i][c] += h * h;
                self.left[i][c] += self.unshot[i][c];
            }
        }
        for [now, all] in [&mut self.escaped, &mut self.passed, &mut self.in_medium] {
            (0..3).for_each(|c| all[c] += now[c]);
        }
        if self.rounds == 1 && self.settings.has_control {
            self.control = self.control(pooled);
        }
        self.begin(pooled);
    }

    /// The constant to subtract from all radiosities, by channel. Where every row of form factors sums to one, the rest `B′ = B − β` obeys
    ///
    /// ```text
    /// B′ = E′ + ρ F B′,   E′ = E + ρ D − (1 − ρ) β,   H = D + β + F B′,   β = Σ A (E + ρ D)/Σ A (1 − ρ)
    /// ```
    ///
    /// with that β, for which emission and absorption are in balance, `Σ A E′ = 0`. Rays then carry at most twice what is emitted, of both signs, and what comes back
    /// cancels out; without it they carry `1/(1 − ρ)` times the emitted. So zero while that is less than [`WORTH`], where rays have left the scene or
    /// passed a surface, and in media: rows do not sum to one; and where an element is dark, of which nobody knows. Source: [Bekaert99].
    fn control(&self, pooled: &Pooled) -> [f64; 3] {
        let is_dark = |p: usize| pooled.area[p] > 0.0 && self.irradiance[p] == [0.0; 3] && pooled.initial[p] == [0.0; 3];
        if self.loses(pooled) || (0..self.pools.n()).any(is_dark) {
            return [0.0; 3];
        }
        let all: f64 = pooled.area.iter().sum();
        std::array::from_fn(|c| {
            let power = pooled.area.iter().zip(&pooled.initial).map(|(a, e)| a * e[c]).sum::<f64>();
            let absorbing = pooled.area.iter().zip(&pooled.reflectance).map(|(a, rho)| a * (1.0 - rho[c])).sum::<f64>();
            if absorbing * WORTH < all { power / absorbing } else { 0.0 }
        })
    }

    /// Rows of form factors do not sum to one, as far as rays have met: more of them left the scene than slip through between surfaces that touch.
    fn loses(&self, pooled: &Pooled) -> bool {
        const OF_ALL: u64 = 10_000;
        const OF_ONE: u64 = 50;
        let escaped = || self.escaped_rays.iter().map(|n| n.unsigned_abs());
        !pooled.medium.is_clear()
            || self.passed != [[0.0; 3]; 2]
            || escaped().sum::<u64>() * OF_ALL > self.n_rays
            || escaped().zip(&self.used).any(|(n, &used)| n * OF_ONE > u64::from(used))
    }

    /// Where rays leave a scene that seemed closed, nothing that was found by subtracting a constant counts.
    fn give_up_control(&mut self, pooled: &Pooled) {
        if self.control == [0.0; 3] || !self.loses(pooled) {
            return;
        }
        self.control = [0.0; 3];
        // (The first round is without.)
        if self.rounds > 1 {
            self.rounds = 0;
            for column in [&mut self.sum, &mut self.squares, &mut self.left] {
                column.fill([0.0; 3]);
            }
            for [_, all] in [&mut self.escaped, &mut self.passed, &mut self.in_medium] {
                *all = [0.0; 3];
            }
        }
        self.begin(pooled);
    }

    fn read(&self, system: &System, unknowns: &mut Unknowns, sums: &mut Sums) {
        let of = |sum: [f64; 3], now: [f64; 3]| {
            if self.rounds > 0 { sum.map(|s| s / f64::from(self.rounds)) } else { now }
        };
        for (i, row_sum) in sums.met.iter_mut().enumerate() {
            let p = self.pools.of_element(i) as usize;
            let now = std::array::from_fn(|c| self.control[c] + self.irradiance[p][c]);
            let indirect = of(self.sum[p], now);
            let h: [f64; 3] = std::array::from_fn(|c| system.direct[i][c] + indirect[c]);
            unknowns.irradiance[i] = h;
            unknowns.radiosity[i] = std::array::from_fn(|c| system.emission[i][c] + system.reflectance[i][c] * h[c]);
            unknowns.unshot[i] = of(self.left[p], self.unshot[p]);
            *row_sum = 1.0 - self.escaped_rays[p] as f64 / f64::from(self.used[p]);
        }
    }

    /// Rounds that are finished.
    pub fn rounds(&self) -> u32 {
        self.rounds
    }

    /// Power that left the scene, by the rays that carried it.
    pub fn escaped(&self) -> [f64; 3] {
        self.mean(self.escaped)
    }

    /// Power that the medium absorbed, likewise.
    pub fn in_medium(&self) -> [f64; 3] {
        self.mean(self.in_medium)
    }

    /// Power that passed transparent surfaces, by the rays that carried it, once for each surface.
    pub fn passed(&self) -> [f64; 3] {
        self.mean(self.passed)
    }

    /// Of finished rounds, or what is known of the first.
    fn mean(&self, [now, all]: [[f64; 3]; 2]) -> [f64; 3] {
        if self.rounds > 0 { all.map(|e| e / f64::from(self.rounds)) } else { now }
    }

    /// Standard error of every element's irradiance, W/m² or lux, from the spread of the rounds; infinite until there are two.
    pub fn standard_errors(&self) -> Vec<[f64; 3]> {
        let of_pools = self.errors();
        (0..self.pools.n_elements()).map(|i| of_pools[self.pools.of_element(i) as usize]).collect()
    }

    /// The same by pool.
    fn errors(&self) -> Vec<[f64; 3]> {
        let rounds = f64::from(self.rounds);
        let of = |sum: f64, squares: f64| {
            if self.rounds < 2 {
                f64::INFINITY
            } else {
                ((squares / rounds - (sum / rounds).powi(2)).max(0.0) / (rounds - 1.0)).sqrt()
            }
        };
        self.sum.iter().zip(&self.squares).map(|(s, q)| std::array::from_fn(|c| of(s[c], q[c]))).collect()
    }

    /// Relative, `√(Σ A σ²/Σ A H²)` over everything and all channels; infinite until enough rounds are finished.
    pub fn error(&self) -> f64 {
        if self.rounds < self.settings.rounds.max(2) {
            return f64::INFINITY;
        }
        let rounds = f64::from(self.rounds);
        let (mut variance, mut all) = (0.0, 0.0);
        for (p, error) in self.errors().iter().enumerate() {
            for (c, error) in error.iter().enumerate() {
                variance += self.pooled.area[p] * error.powi(2);
                all += self.pooled.area[p] * (self.pooled.direct[p][c] + self.sum[p][c] / rounds).powi(2);
            }
        }
        if all > 0.0 { (variance / all).sqrt() } else { 0.0 }
    }
}

/// A pool as a source of rays.
struct Source<'a> {
    mesh: &'a ElementMesh,
    pools: &'a Pools,
    pool: usize,
    /// The only element.
    only: Option<Sender<'a>>,
    key: u64,
}

impl<'a> Source<'a> {
    fn new(mesh: &'a ElementMesh, pools: &'a Pools, pool: usize, seed: u64) -> Self {
        let only = match pools.members(pool) {
            [only] => Some(Sender::new(mesh, *only)),
            _ => None,
        };
        Self { mesh, pools, pool, only, key: rng::key(&[seed, pool as u64]) }
    }

    /// From a point uniform over it, in a direction by the cosine: two dimensions each of a sequence.
    fn ray(&self, sample: u32) -> Ray {
        let [u, v] = sequence::point_2d(sample, self.key).to_array().map(f64::from);
        let direction = sequence::point_2d(sample, self.key ^ 0x6469_7265);
        if let Some(only) = &self.only {
            return only.ray([u, v], direction);
        }
        // What is left of the first number tells where on the element it chose.
        let (element, u) = self.pools.at(self.pool, u);
        Sender::new(self.mesh, element).ray([u, v], direction)
    }
}

/// An element that sends rays out.
struct Sender<'a> {
    element: &'a Element,
    frame: Frame,
    lift: Lift,
    /// The points that light can reach, where it cannot reach all.
    exposed: Vec<[f64; 2]>,
}

impl<'a> Sender<'a> {
    fn new(mesh: &'a ElementMesh, i: u32) -> Self {
        let element = &mesh.elements()[i as usize];
        let is_whole = (0..mesh::POINTS).all(|k| element.exposes(k));
        let points = (0..mesh::POINTS).filter(|&k| !is_whole && element.exposes(k));
        let exposed = points.map(|k| mesh::point(i, k as u32)).collect();
        Self { element, frame: Frame::from_normal(element.normal.as_vec3()), lift: element.lift(), exposed }
    }

    fn ray(&self, [u, v]: [f64; 2], direction: Vec2) -> Ray {
        let p = match self.exposed.as_slice() {
            [] => uniform(self.element, [u, v]),
            // Light leaves the part in the open alone.
            points => self.element.at(points[(u * points.len() as f64) as usize]),
        };
        let dir = self.frame.to_world(warp::cosine_hemisphere(direction));
        Ray::new(self.lift.in_front(p), dir)
    }
}

/// A point uniform over an element: the bilinear map, whose Jacobian is linear in either parameter, with that taken out.
fn uniform(element: &Element, [u, v]: [f64; 2]) -> DVec3 {
    let c = element.corners();
    if c.len() != 4 {
        return element.at([u, v]);
    }
    let corner = |i: usize| (c[(i + 1) % 4] - c[i]).cross(c[(i + 3) % 4] - c[i]).dot(element.normal).max(0.0);
    let [a, b, d, e] = [0, 1, 3, 2].map(corner);
    let t = linear(v, a + b, d + e);
    element.at([linear(u, a + (d - a) * t, b + (e - b) * t), t])
}

/// The number in `[0, 1]` below which the fraction `u` of a density lies that runs from `a` to `b`.
fn linear(u: f64, a: f64, b: f64) -> f64 {
    let root = (a * a + (b * b - a * a) * u).max(0.0).sqrt();
    if a + root > 0.0 { u * (a + b) / (a + root) } else { u }
}

/// What a ray meets first, and what lies behind that where it is transparent, as far as chance lets it go.
fn follow(world: &World, mesh: &ElementMesh, mut ray: Ray, key: u64, mut meet: impl FnMut(u32, f32)) {
    // How far it has come, and where it met the last element.
    let (mut distance, mut last) = (0.0, None);
    for layer in 0..MAX_LAYERS {
        let Some((hit, surface)) = world.closest_visible(&ray) else { break };
        distance += hit.t;
        let element = mesh.element_at(&hit, surface.p, ray.dir);
        if let Some(element) = element {
            meet(element, distance);
            if let Some(last) = last {
                meet(AGAIN, last);
            }
            last = Some(distance);
        }
        let passes = || {
            let shading = world.shading(&surface, -ray.dir);
            let through = shading.straight_transmission();
            1.0 - shading.coverage * (1.0 - (through.r + through.g + through.b) / 3.0)
        };
        let is_end = !world.has_transparency() || rng::unit_f32((rng::key(&[key, u64::from(layer)]) >> 32) as u32) >= passes();
        if is_end && element.is_some() {
            return;
        }
        if is_end {
            break;
        }
        ray = surface.ray(ray.dir);
    }
    // On no element: out of the scene, or on a side that takes no part.
    match last {
        Some(last) => meet(OUT, last),
        None => meet(NOTHING, distance),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_linear_density_is_inverted() {
        for (a, b) in [(1.0, 1.0), (0.0, 2.0), (2.0, 0.0), (1.0, 3.0)] {
            for k in 0..=8 {
                let u = f64::from(k) / 8.0;
                let x = linear(u, a, b);
                assert!((x * a + 0.5 * x * x * (b - a) - u * 0.5 * (a + b)).abs() < 1e-14, "{u} of {a} to {b} is at {x}");
            }
        }
    }
}
