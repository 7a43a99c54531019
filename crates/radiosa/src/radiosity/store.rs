//! Solutions to and from streams: what they stand on, what they are, and what a solver needs to go on.
//!
//! Elements are not stored but made again from the surfaces and what is recorded about the mesh ([`mesh::Record`]); their areas are, and tell whether that worked.

use std::io;

use super::discontinuity::{Line, Lines};
use super::form_factor::Row;
use super::matrix::{Matrix, restore_entries, store_entries};
use super::medium::{Medium, Passing};
use super::mesh::{self, ElementMesh, Sides};
use super::solution::{Division, Progress, Settings, Solution};
use super::solve::gathering::Sweep;
use super::solve::{History, Record};
use super::system::{Balance, Sums, System};
use crate::math::DVec3;
use crate::stream::{In, Out, wrong};
use crate::transport::World;

/// A way of dividing surfaces: changes whenever the same settings give other elements.
const MESHING: u64 = 3;

/// Refinements at most.
const MAX_LEVELS: u64 = 16;

impl mesh::Record {
    /// Writes it.
    ///
    /// # Errors
    /// When the stream cannot take it.
    pub fn store(&self, out: &mut Out) -> io::Result<()> {
        let Self { settings, kept, refined, exposed, shadows } = self;
        let sides = match settings.sides {
            Sides::Lit => 0,
            Sides::Both => 1,
            Sides::Front => 2,
        };
        let size = settings.size.unwrap_or(f64::NAN).to_bits();
        for number in [
            MESHING,
            u64::from(settings.elements),
            size,
            sides,
            u64::from(settings.cuts_contacts),
            u64::from(settings.discontinuities),
        ] {
            out.number(number)?;
        }
        out.array(&kept.iter().map(|k| u8::from(k[0]) | u8::from(k[1]) << 1).collect::<Vec<u8>>())?;
        out.number(refined.len() as u64)?;
        for marked in refined {
            out.array(&marked.iter().map(|&m| u8::from(m)).collect::<Vec<u8>>())?;
        }
        out.array(exposed)?;
        out.array(&shadows.lines.iter().map(|line| line.patch).collect::<Vec<u32>>())?;
        let numbers = |line: &Line| [line.ends[0].to_array(), line.ends[1].to_array(), [line.strength, 0.0, 0.0]];
        out.array(&shadows.lines.iter().flat_map(numbers).collect::<Vec<[f64; 3]>>())?;
        out.number(shadows.n_left_out)
    }

    /// Reads what [`Self::store`] wrote.
    ///
    /// # Errors
    /// When the stream ends, or holds something else.
    pub fn restore(from: &mut In) -> io::Result<Self> {
        if from.number()? != MESHING {
            return Err(wrong("its elements were made in another way, by another version"));
        }
        let elements = u32::try_from(from.number()?).map_err(|_| wrong("too many elements"))?;
        let size = f64::from_bits(from.number()?);
        let size = if size.is_nan() { None } else { Some(size) };
        if size.is_some_and(|s| s <= 0.0) {
            return Err(wrong("its elements have no size"));
        }
        let sides = match from.number()? {
            0 => Sides::Lit,
            1 => Sides::Both,
            2 => Sides::Front,
            _ => return Err(wrong("it names sides that do not exist")),
        };
        let cuts_contacts = from.number()? != 0;
        let discontinuities = u32::try_from(from.number()?).map_err(|_| wrong("too many emitters"))?;
        let kept = from.any_array::<u8>()?.into_iter().map(|k| [k & 1 == 1, k & 2 == 2]).collect();
        let mut refined = Vec::new();
        let levels = from.number()?;
        if levels > MAX_LEVELS {
            return Err(wrong("it was refined too often"));
        }
        for _ in 0..levels {
            refined.push(from.any_array::<u8>()?.into_iter().map(|m| m != 0).collect());
        }
        let exposed = from.any_array()?;
        let of: Vec<u32> = from.any_array()?;
        let numbers: Vec<[f64; 3]> = from.array(3 * of.len())?;
        if numbers.iter().flatten().any(|x| !x.is_finite()) {
            return Err(wrong("its shadows end nowhere"));
        }
        let line = |(patch, n): (u32, &[[f64; 3]])| Line { patch, ends: [n[0], n[1]].map(DVec3::from_array), strength: n[2][0] };
        let lines = of.into_iter().zip(numbers.chunks_exact(3)).map(line).collect();
        let shadows = Lines { lines, n_left_out: from.number()? };
        let settings = mesh::Settings { elements, size, sides, cuts_contacts, discontinuities };
        Ok(Self { settings, kept, refined, exposed, shadows })
    }
}

impl Solution {
    /// Writes it, with the record of its mesh.
    ///
    /// # Errors
    /// When the stream cannot take it.
    pub fn store(&self, out: &mut Out) -> io::Result<()> {
        self.mesh.record().store(out)?;
        let System { area, reflectance, emission, direct, lamps, transmittance, medium } = &self.system;
        out.array(&medium.absorption)?;
        out.array(area)?;
        let ours = [&self.radiosity, &self.irradiance, &self.unshot, &self.irradiance_error];
        for column in [reflectance, emission, direct].into_iter().chain(ours).chain([lamps, transmittance]) {
            out.array(column)?;
        }
        out.array(&self.sums.met)?;
        out.array(&self.sums.arriving)?;
        out.number(self.n_factors as u64)?;
        out.array(&flat(&self.balance))?;
        out.number(self.history.records.len() as u64)?;
        for r in &self.history.records {
            let mut numbers = vec![r.residual, r.change, r.error.unwrap_or(f64::NAN)];
            numbers.extend(flat(&r.balance));
            out.array(&numbers)?;
            out.array(&[u64::from(r.step), u64::from(r.error.is_some()), r.n_pairs, r.n_exchanges, r.n_rays])?;
        }
        Ok(())
    }

    /// Reads what [`Self::store`] wrote, of the same surfaces and not more than about `max_elements`.
    ///
    /// # Errors
    /// When the stream ends, holds something else or too many elements, or is of other surfaces.
    pub fn restore(world: &World, max_elements: u64, from: &mut In) -> io::Result<Self> {
        let record = mesh::Record::restore(from)?;
        if ElementMesh::estimate(world, &record.settings) > max_elements {
            return Err(wrong("it has more elements than --max-memory allows"));
        }
        let mesh = ElementMesh::again(world, &record).ok_or_else(|| wrong("it is of other surfaces"))?;
        let n = mesh.elements().len();
        let mut medium = Medium::default();
        medium.absorption.copy_from_slice(&from.array(3)?);
        if !medium.absorption.iter().all(|s| s.is_finite() && *s >= 0.0) {
            return Err(wrong("its medium absorbs an impossible amount"));
        }
        let area: Vec<f64> = from.array(n)?;
        if area.iter().zip(mesh.elements()).any(|(a, e)| a.to_bits() != e.area.to_bits()) {
            return Err(wrong("its elements have other areas"));
        }
        let mut columns: [Vec<[f64; 3]>; 6] = Default::default();
        for column in &mut columns {
            *column = from.array(n)?;
        }
        let mut or_none = || {
            let column: Vec<[f64; 3]> = from.any_array()?;
            let fits = column.is_empty() || column.len() == n;
            if fits { Ok(column) } else { Err(wrong("an array has another length than it should")) }
        };
        let (irradiance_error, lamps, transmittance) = (or_none()?, or_none()?, or_none()?);
        let [reflectance, emission, direct, radiosity, irradiance, unshot] = columns;
        let sums = Sums { met: from.array(n)?, arriving: from.array(if medium.is_clear() { 0 } else { n })? };
        let n_factors = from.number()? as usize;
        let balance = round(&from.array(15)?);
        let mut history = History::default();
        for _ in 0..from.number()? {
            let numbers: Vec<f64> = from.array(18)?;
            let counts: Vec<u64> = from.array(5)?;
            history.records.push(Record {
                step: counts[0] as u32,
                residual: numbers[0],
                change: numbers[1],
                error: (counts[1] != 0).then_some(numbers[2]),
                balance: round(&numbers[3..]),
                n_pairs: counts[2],
                n_exchanges: counts[3],
                n_rays: counts[4],
            });
        }
        let system = System { area, reflectance, emission, direct, lamps, transmittance, medium };
        Ok(Self { mesh, system, radiosity, irradiance, unshot, irradiance_error, sums, n_factors, balance, history })
    }
}

/// A balance as numbers.
fn flat(b: &Balance) -> Vec<f64> {
    [b.emitted, b.absorbed, b.in_medium, b.escaped, b.unshot].concat()
}

/// The inverse of [`flat`].
fn round(numbers: &[f64]) -> Balance {
    let at = |k: usize| [numbers[3 * k], numbers[3 * k + 1], numbers[3 * k + 2]];
    Balance { emitted: at(0), absorbed: at(1), in_medium: at(2), escaped: at(3), unshot: at(4) }
}

impl Progress {
    /// Writes it.
    ///
    /// # Errors
    /// When the stream cannot take it.
    pub fn store(&self, out: &mut Out) -> io::Result<()> {
        match self {
            Self::Factors(rows, _) => {
                out.number(1)?;
                out.number(rows.len() as u64)?;
                rows.iter().try_for_each(|row| {
                    store_entries(&row.entries, out)?;
                    row.passing.store(out)
                })
            }
            Self::Gathering(matrix, _) => {
                out.number(2)?;
                matrix.store(out)
            }
            Self::Shooting(shooting) => {
                out.number(3)?;
                shooting.store(out)
            }
            Self::Stochastic(stochastic) => {
                out.number(4)?;
                stochastic.store(out)
            }
            Self::Hierarchical(hierarchical) => {
                out.number(5)?;
                hierarchical.store(out)
            }
        }
    }

    /// Reads what [`Self::store`] wrote, of a solve over `division` by the same settings.
    ///
    /// # Errors
    /// When the stream ends, or is of another solver.
    pub fn restore(division: &Division, settings: &Settings, system: &System, from: &mut In) -> io::Result<Self> {
        let n = system.n();
        let fresh = Self::new(division, settings, system);
        Ok(match (from.number()?, fresh) {
            (1, Self::Factors(_, sweep)) => {
                let n_rows = from.number()?;
                if n_rows > n as u64 {
                    return Err(wrong("it has more rows than elements"));
                }
                let row = |_| {
                    let entries: Vec<(u32, f64)> = restore_entries(n, from)?;
                    Ok(Row { passing: Passing::restore(&system.medium, entries.len(), from)?, entries })
                };
                let rows: io::Result<Vec<Row>> = (0..n_rows).map(row).collect();
                Self::Factors(rows?, sweep)
            }
            (2, Self::Factors(_, sweep)) => Self::Gathering(Matrix::restore(n, &system.medium, from)?, sweep),
            (3, Self::Shooting(mut shooting)) => {
                shooting.restore(from)?;
                Self::Shooting(shooting)
            }
            (4, Self::Stochastic(mut stochastic)) => {
                stochastic.restore(from)?;
                Self::Stochastic(stochastic)
            }
            (5, Self::Hierarchical(mut hierarchical)) => {
                hierarchical.restore(system, from)?;
                Self::Hierarchical(hierarchical)
            }
            _ => return Err(wrong("it was being solved by another solver")),
        })
    }

    /// The solver's name on the command line.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Factors(_, Sweep::Jacobi) | Self::Gathering(_, Sweep::Jacobi) => "jacobi",
            Self::Factors(_, Sweep::GaussSeidel) | Self::Gathering(_, Sweep::GaussSeidel) => "gauss-seidel",
            Self::Shooting(_) => "shooting",
            Self::Stochastic(_) => "stochastic",
            Self::Hierarchical(_) => "hierarchical",
        }
    }

    /// The equation is the one to be solved, not a coarser one on the way to it.
    pub(super) fn is_whole(&self) -> bool {
        !matches!(self, Self::Hierarchical(hierarchical) if !hierarchical.is_final())
    }
}
