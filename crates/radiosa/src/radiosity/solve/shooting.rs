//! Shooting: the element with the most to give sends it out, again and again. Source: [Cohen88].
//!
//! ```text
//! repeat: i with the largest unshot power A_i U_i
//!         for every j:  H_j += τ_ij F_ij A_i U_i / A_j;  B_j += ρ_j ΔH_j;  U_j += ρ_j ΔH_j      (F_ji = F_ij A_i / A_j)
//!         U_i = 0
//! ```
//!
//! One row of form factors at a time: the first picture needs a few rows, and no matrix has to be held. Rows are kept while there is room, since the same elements shoot
//! again.
//!
//! - A step is a fixed number of shooters, chosen together, whose rows are found side by side; they shoot one after the other. So nothing depends on the number of
//!   threads.
//! - *Substructuring*: shooters may be blocks of elements of one patch, which send out their mean, while every element receives: a row costs as much, but there are
//!   fewer ([`super::super::mesh::ElementMesh::with_blocks`]). Source: [Cohen86].

use std::io;

use super::super::form_factor::{Factors, Row};
use super::super::matrix;
use super::super::medium::Passing;
use super::super::mesh::Blocks;
use super::super::system::{Sums, System, Unknowns};
use crate::stream::{In, Out};

/// Who is next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Order {
    /// The largest unshot power.
    #[default]
    Power,
    /// The largest unshot radiosity.
    Radiosity,
    /// The next one, in the order of elements.
    Cyclic,
}

/// How to shoot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Who is next.
    pub order: Order,
    /// Shooters in a step.
    pub batch: usize,
    /// Elements shoot in blocks of this many along either edge of their patch; 1: each for itself.
    pub block: u32,
    /// Form factors kept at most, 8 bytes each.
    pub keep: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self { order: Order::Power, batch: 16, block: 1, keep: 1 << 26 }
    }
}

/// What a step took.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Work {
    /// Rows of form factors estimated.
    pub rows: u64,
    /// Form factors light went by.
    pub exchanges: u64,
}

/// A row without its entries to blocks.
#[derive(Clone, Debug)]
struct KeptRow {
    /// `(j, F_ij)` by rising `j`.
    entries: Box<[(u32, f32)]>,
    /// τ_ij of each.
    passing: Passing,
}

impl KeptRow {
    /// Of the elements of a system; where it would send out more than there is, brought down to that ([`matrix::share_of_row`]).
    fn new(row: &Row, system: &System) -> Self {
        let kept = || row.entries.iter().enumerate().filter(|(_, (j, _))| (*j as usize) < system.n());
        let mut passing = Passing::new(&system.medium);
        kept().for_each(|(k, _)| passing.push(row.passing.at(k)));
        let share = matrix::share_of_row(kept().map(|(_, &(j, f))| (j as usize, f)), &|j| system.passes(j));
        Self { entries: kept().map(|(_, &(j, f))| (j, (f * share) as f32)).collect(), passing }
    }

    /// `(j, F_ij, τ_ij)`.
    fn links(&self) -> impl Iterator<Item = (u32, f64, [f64; 3])> {
        self.entries.iter().enumerate().map(|(k, &(j, f))| (j, f64::from(f), self.passing.at(k)))
    }
}

/// Shooters and the rows they have used.
#[derive(Clone, Debug)]
pub struct Shooting {
    settings: Settings,
    /// The elements of each shooter; those of one are its own block.
    blocks: Blocks,
    kept: Vec<Option<KeptRow>>,
    /// Rows that were kept when the work was interrupted: they are found again when they are needed, and not counted again.
    forgotten: Vec<bool>,
    /// Form factors that are or would be kept.
    n_kept: usize,
    /// Next shooter in cyclic order.
    next: usize,
}

impl Shooting {
    /// Of the shooters of `blocks`.
    pub fn new(settings: Settings, blocks: Blocks) -> Self {
        let kept = (0..blocks.n()).map(|_| None).collect();
        let forgotten = vec![false; blocks.n()];
        Self { settings, blocks, kept, forgotten, n_kept: 0, next: 0 }
    }

    pub(in super::super) fn store(&self, out: &mut Out) -> io::Result<()> {
        let known: Vec<u8> = self.kept.iter().zip(&self.forgotten).map(|(kept, &f)| u8::from(kept.is_some() || f)).collect();
        out.array(&known)?;
        out.number(self.n_kept as u64)?;
        out.number(self.next as u64)
    }

    /// Goes on where [`Self::store`] was called, by the same settings and blocks.
    pub(in super::super) fn restore(&mut self, from: &mut In) -> io::Result<()> {
        let known: Vec<u8> = from.array(self.blocks.n())?;
        self.forgotten = known.into_iter().map(|known| known != 0).collect();
        self.n_kept = from.number()? as usize;
        self.next = from.number()? as usize % self.blocks.n().max(1);
        Ok(())
    }

    /// A batch of shots. `factors` are those of the mesh with its blocks.
    pub fn step(&mut self, system: &System, factors: &Factors, unknowns: &mut Unknowns, sums: &mut Sums) -> Work {
        let shooters = self.chosen(system, unknowns.unshot);
        let missing: Vec<u32> = shooters.iter().copied().filter(|&s| self.kept[s as usize].is_none()).collect();
        let asked: Vec<u32> = missing.iter().map(|&s| self.blocks.element(s)).collect();
        let mut found = factors.rows(&asked).into_iter();
        let new_rows = missing.iter().filter(|&&s| !self.forgotten[s as usize]).count();
        let mut work = Work { rows: new_rows as u64, exchanges: 0 };
        for s in shooters {
            let kept = self.kept[s as usize].take();
            let is_new = kept.is_none() && !std::mem::take(&mut self.forgotten[s as usize]);
            let row = kept.unwrap_or_else(|| KeptRow::new(&found.next().unwrap_or_default(), system));
            let n = row.entries.len();
            work.exchanges += n as u64;
            self.shoot(s, row.links(), system, unknowns, sums);
            if !is_new || self.n_kept + n <= self.settings.keep {
                self.n_kept += if is_new { n } else { 0 };
                self.kept[s as usize] = Some(row);
            }
        }
        work
    }

    /// The shooters of the next step, in their order; those with nothing to give are left out.
    fn chosen(&mut self, system: &System, unshot: &[[f64; 3]]) -> Vec<u32> {
        let n = self.blocks.n();
        let weight = |s: usize| -> f64 {
            let power: f64 =
                self.blocks.members(s).map(|i| system.area[i] * unshot[i].iter().map(|u| u.abs()).sum::<f64>()).sum();
            match self.settings.order {
                Order::Radiosity => power / self.blocks.members(s).map(|i| system.area[i]).sum::<f64>(),
                Order::Power | Order::Cyclic => power,
            }
        };
        if self.settings.order == Order::Cyclic {
            let from = self.next;
            let in_turn = (0..n).map(|k| (from + k) % n).filter(|&s| weight(s) > 0.0);
            let chosen: Vec<u32> = in_turn.take(self.settings.batch).map(|s| s as u32).collect();
            self.next = chosen.last().map_or(0, |&s| s as usize + 1);
            return chosen;
        }
        let mut candidates: Vec<(f64, u32)> = (0..n).map(|s| (weight(s), s as u32)).filter(|&(w, _)| w > 0.0).collect();
        let best_first = |a: &(f64, u32), b: &(f64, u32)| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1));
        if candidates.len() > self.settings.batch {
            candidates.select_nth_unstable_by(self.settings.batch, best_first);
            candidates.truncate(self.settings.batch);
        }
        candidates.sort_unstable_by(best_first);
        candidates.into_iter().map(|(_, s)| s).collect()
    }

    /// One shooter sends out all it has by its row of form factors.
    fn shoot(
        &self,
        s: u32,
        row: impl Iterator<Item = (u32, f64, [f64; 3])>,
        system: &System,
        unknowns: &mut Unknowns,
        sums: &mut Sums,
    ) {
        let mut power = [0.0; 3];
        for i in self.blocks.members(s as usize) {
            (0..3).for_each(|c| power[c] += system.area[i] * unknowns.unshot[i][c]);
            unknowns.unshot[i] = [0.0; 3];
        }
        let (mut met, mut arriving_sum) = (0.0, [0.0; 3]);
        for (j, factor, tau) in row {
            met += factor;
            let j = j as usize;
            for (c, power) in power.iter().enumerate() {
                arriving_sum[c] += tau[c] * factor;
                let arriving = tau[c] * factor * power / system.area[j];
                let leaving = system.reflectance[j][c] * arriving;
                unknowns.irradiance[j][c] += arriving;
                unknowns.radiosity[j][c] += leaving;
                unknowns.unshot[j][c] += leaving;
            }
        }
        for i in self.blocks.members(s as usize) {
            sums.met[i] = met;
            if let Some(sum) = sums.arriving.get_mut(i) {
                *sum = arriving_sum;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::medium::Medium;
    use super::*;

    /// Three squares of a closed room, so to speak: rows sum to one and areas times factors are symmetric.
    fn room(absorption: [f64; 3]) -> (System, [[f64; 3]; 3]) {
        let system = System {
            area: vec![1.0, 2.0, 4.0],
            reflectance: vec![[0.2, 0.5, 0.9], [0.7; 3], [0.0, 0.4, 0.6]],
            emission: vec![[3.0, 1.0, 0.0], [0.0; 3], [0.0, 0.0, 2.0]],
            direct: vec![[0.0; 3], [0.5, 0.0, 0.25], [0.0; 3]],
            medium: Medium { absorption },
            ..System::default()
        };
        (system, [[0.0, 0.4, 0.5], [0.2, 0.0, 0.8], [0.125, 0.4, 0.0]])
    }

    /// The balance after every shot of 12, with `F_01` or what of it passes the medium multiplied by something as it arrives.
    fn worst_balance(absorption: [f64; 3], [wrong, wrong_passing]: [f64; 2]) -> f64 {
        let (system, factors) = room(absorption);
        let shooting = Shooting::new(Settings::default(), Blocks::single(3));
        let mut columns = [vec![[0.0; 3]; 3], vec![[0.0; 3]; 3], vec![[0.0; 3]; 3]];
        let [radiosity, irradiance, unshot] = &mut columns;
        let mut unknowns = Unknowns { radiosity, irradiance, unshot };
        unknowns.start(&system);
        let mut sums = Sums::unknown(&system);
        // (Elements that are as far from each other as their numbers.)
        let tau = |s: usize, j: u32| system.medium.transmittance((s as f64 - f64::from(j)).abs());
        let mut worst = 0.0f64;
        for shot in 0..12 {
            let s = shot % 3;
            let here = |j: u32, by: f64| if (s, j) == (0, 1) { by } else { 1.0 };
            let passing = |j: u32| tau(s, j).map(|t| t * here(j, wrong_passing));
            let row = (0..3u32).map(|j| (j, factors[s][j as usize] * here(j, wrong), passing(j)));
            shooting.shoot(s as u32, row, &system, &mut unknowns, &mut sums);
            // Sums are those of the factors as they were estimated.
            sums.met[s] = factors[s].iter().sum();
            if let Some(arriving) = sums.arriving.get_mut(s) {
                *arriving = std::array::from_fn(|c| (0..3).map(|j| factors[s][j] * tau(s, j as u32)[c]).sum());
            }
            worst = worst.max(system.balance(&sums, unknowns.irradiance, unknowns.radiosity, unknowns.unshot).error());
        }
        worst
    }

    #[test]
    fn power_is_accounted_for_after_every_shot() {
        for absorption in [[0.0; 3], [0.3; 3], [0.1, 0.7, 0.0]] {
            assert!(worst_balance(absorption, [1.0; 2]) < 1e-12);
            // The twins: one factor of nine off by a thousandth, or what of it passes the medium.
            assert!(worst_balance(absorption, [1.001, 1.0]) > 1e-5);
            assert!(worst_balance(absorption, [1.0, 1.001]) > 1e-5);
        }
    }
}
