//! Form factors between groups of elements: named surfaces, materials, patches.
//!
//! ```text
//! F_IJ = 1/A_I Σ_{i ∈ I} Σ_{j ∈ J} A_i F_ij
//! ```
//!
//! What the estimator gives is kept as it is; how far rows are from one and pairs from reciprocity says how good it was. Both can be enforced afterwards,
//! which makes a matrix that conserves energy out of one that nearly does, and hides how good it was.

use rayon::prelude::*;

use super::form_factor::{Factors, Row, Scratch};
use super::matrix::mirrored;
use super::mesh::ElementMesh;

/// One factor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Entry {
    /// Where to.
    pub to: u32,
    /// Standard error of `exchange`, m²: of estimators that sample, as if samples were independent.
    pub stderr: f32,
    /// `A_I F_IJ`, m².
    pub exchange: f64,
}

/// Sparse rows of exchange areas between groups.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Between {
    /// A_I, m²; both sides where both take part.
    pub areas: Vec<f64>,
    /// Row `I` has the entries `starts[I]..starts[I + 1]`.
    starts: Vec<usize>,
    entries: Vec<Entry>,
}

/// How far a matrix is from what it should be.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Report {
    /// The least, the mean by area and the greatest `Σ_J F_IJ`: 1 in a closed scene.
    pub row_sums: [f64; 3],
    /// `Σ |A_I F_IJ − A_J F_JI| / Σ (A_I F_IJ + A_J F_JI)`: 0 when every pair is reciprocal.
    pub reciprocity: f64,
}

/// What is enforced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Correction {
    /// `A_I F_IJ = A_J F_JI`, by their mean.
    Reciprocity,
    /// That, and rows that sum to one: for closed scenes only.
    Closure,
}

impl Between {
    /// Factors between the groups that `group_of` gives every element; there are `n` of them. In a medium they are of what arrives through it, in the first channel.
    pub fn new(factors: &Factors, group_of: &[u32], n: usize) -> Self {
        let elements = Self::of_elements(factors);
        let mut members = vec![Vec::new(); n];
        group_of.iter().enumerate().for_each(|(i, &group)| members[group as usize].push(i));
        if members.iter().all(|m| m.len() == 1) && group_of.iter().enumerate().all(|(i, &g)| i == g as usize) {
            return elements;
        }
        let rows: Vec<Vec<Entry>> = members
            .par_iter()
            .map_init(
                || vec![[0.0; 2]; n],
                |sums, members| {
                    let mut touched = Vec::new();
                    for entry in members.iter().flat_map(|&i| elements.row(i)) {
                        let sum = &mut sums[group_of[entry.to as usize] as usize];
                        if sum[0] == 0.0 {
                            touched.push(group_of[entry.to as usize]);
                        }
                        sum[0] += entry.exchange;
                        sum[1] += f64::from(entry.stderr).powi(2);
                    }
                    touched.sort_unstable();
                    let entry = |to: u32| {
                        let [exchange, variance] = std::mem::take(&mut sums[to as usize]);
                        Entry { to, stderr: variance.sqrt() as f32, exchange }
                    };
                    touched.into_iter().map(entry).collect()
                },
            )
            .collect();
        let mut areas = vec![0.0; n];
        group_of.iter().zip(&elements.areas).for_each(|(&group, area)| areas[group as usize] += area);
        Self::from_rows(areas, rows)
    }

    /// Every element a group of its own.
    fn of_elements(factors: &Factors) -> Self {
        let mesh: &ElementMesh = factors.mesh();
        let areas: Vec<f64> = mesh.elements().iter().map(|e| e.area).collect();
        let n = areas.len() as u32;
        let entry = |to: u32, [exchange, variance]: [f64; 2]| Entry { to, stderr: variance.max(0.0).sqrt() as f32, exchange };
        if factors.is_reciprocal() {
            let upper: Vec<Vec<Entry>> = (0..n)
                .into_par_iter()
                .map_init(Scratch::default, |scratch, i| {
                    let exchange = |j| {
                        let exchange = factors.exchange(i, j, scratch);
                        let tau = exchange.passing[0];
                        entry(j, [tau * exchange.area, tau * tau * exchange.variance])
                    };
                    (i + 1..n).map(exchange).filter(|e| e.exchange > 0.0).collect()
                })
                .collect();
            let (starts, entries) = mirrored(&upper, |e| e.to, |_, to, _, e| Entry { to, ..*e });
            return Self { areas, starts, entries };
        }
        let rows: Vec<Vec<Entry>> = (0..n)
            .into_par_iter()
            .map_init(
                || (Row::default(), Scratch::default()),
                |(row, scratch), i| {
                    factors.row(i, row, scratch);
                    let area = areas[i as usize];
                    let exchange = |k: usize| {
                        let ((j, f), arriving) = (row.entries[k], row.passing.at(k)[0] * area);
                        entry(j, [f * arriving, scratch.variances[k] * arriving * arriving])
                    };
                    (0..row.entries.len()).map(exchange).collect()
                },
            )
            .collect();
        Self::from_rows(areas, rows)
    }

    fn from_rows(areas: Vec<f64>, rows: Vec<Vec<Entry>>) -> Self {
        let mut starts = vec![0];
        let mut entries = Vec::with_capacity(rows.iter().map(Vec::len).sum());
        for row in rows {
            entries.extend_from_slice(&row);
            starts.push(entries.len());
        }
        Self { areas, starts, entries }
    }

    /// Groups.
    pub fn n(&self) -> usize {
        self.areas.len()
    }

    /// Factors above zero.
    pub fn n_entries(&self) -> usize {
        self.entries.len()
    }

    /// The entries of row `i`, by rising `to`.
    pub fn row(&self, i: usize) -> &[Entry] {
        &self.entries[self.starts[i]..self.starts[i + 1]]
    }

    /// Where rows start among all entries, and where the last ends.
    pub fn starts(&self) -> &[usize] {
        &self.starts
    }

    /// `F_IJ` and its standard error, for an entry of row `i`.
    pub fn factor(&self, i: usize, entry: &Entry) -> [f64; 2] {
        let area = self.areas[i];
        if area > 0.0 { [entry.exchange / area, f64::from(entry.stderr) / area] } else { [0.0; 2] }
    }

    /// `Σ_J F_IJ`.
    pub fn row_sum(&self, i: usize) -> f64 {
        self.row(i).iter().map(|e| self.factor(i, e)[0]).sum()
    }

    /// `A_J F_JI` of the entry that mirrors one from `i` to `to`; zero when there is none.
    fn mirrored(&self, i: usize, to: u32) -> f64 {
        let row = self.row(to as usize);
        row.binary_search_by_key(&(i as u32), |e| e.to).map_or(0.0, |k| row[k].exchange)
    }

    /// Closure and reciprocity.
    pub fn report(&self) -> Report {
        let sums: Vec<f64> = (0..self.n()).into_par_iter().map(|i| self.row_sum(i)).collect();
        let whole: f64 = self.areas.iter().sum();
        let mean = sums.iter().zip(&self.areas).map(|(s, a)| s * a).sum::<f64>() / whole;
        let differences: Vec<[f64; 2]> = (0..self.n())
            .into_par_iter()
            .map(|i| {
                self.row(i).iter().fold([0.0; 2], |[difference, sum], e| {
                    let mirrored = self.mirrored(i, e.to);
                    // An entry without a mirror image is met once, others twice.
                    let twice = if mirrored == 0.0 { 2.0 } else { 1.0 };
                    [difference + twice * (e.exchange - mirrored).abs(), sum + twice * (e.exchange + mirrored)]
                })
            })
            .collect();
        let [difference, sum] = differences.iter().fold([0.0; 2], |[a, b], [c, d]| [a + c, b + d]);
        Report {
            row_sums: [
                sums.iter().copied().reduce(f64::min).unwrap_or(0.0),
                if whole > 0.0 { mean } else { 0.0 },
                sums.iter().copied().fold(0.0, f64::max),
            ],
            reciprocity: if sum > 0.0 { difference / sum } else { 0.0 },
        }
    }

    /// Enforces reciprocity, and closure if asked for.
    ///
    /// Reciprocity by `S = (A_I F_IJ + A_J F_JI)/2`; closure by factors `d_I` with `d_I Σ_J S_IJ d_J = A_I`, found by Sinkhorn's iteration
    /// `d_I ← √(d_I A_I / Σ_J S_IJ d_J)`, which keeps the symmetry; rows without any entry stay empty.
    pub fn correct(&mut self, correction: Correction) {
        // Entries with a mirror image stand for half of the mean, the others give the other half away.
        let mut missing: Vec<Vec<Entry>> = vec![Vec::new(); self.n()];
        for i in 0..self.n() {
            for e in self.row(i) {
                if e.to as usize != i && self.mirrored(i, e.to) == 0.0 {
                    missing[e.to as usize].push(Entry { to: i as u32, stderr: 0.5 * e.stderr, exchange: 0.5 * e.exchange });
                }
            }
        }
        let rows = (0..self.n()).into_par_iter().map(|i| {
            let mean = |e: &Entry| Entry { exchange: 0.5 * (e.exchange + self.mirrored(i, e.to)), ..*e };
            let mut row: Vec<Entry> = self.row(i).iter().map(mean).chain(missing[i].iter().copied()).collect();
            row.sort_by_key(|e| e.to);
            row
        });
        *self = Self::from_rows(self.areas.clone(), rows.collect());
        if correction == Correction::Reciprocity {
            return;
        }
        let mut d = vec![1.0f64; self.n()];
        for _ in 0..200 {
            let next: Vec<f64> = (0..self.n())
                .into_par_iter()
                .map(|i| {
                    let sum: f64 = self.row(i).iter().map(|e| e.exchange * d[e.to as usize]).sum();
                    if sum > 0.0 { (d[i] * self.areas[i] / sum).sqrt() } else { d[i] }
                })
                .collect();
            let change = next.iter().zip(&d).map(|(new, old)| (new / old - 1.0).abs()).fold(0.0, f64::max);
            d = next;
            if change < 1e-13 {
                break;
            }
        }
        for i in 0..self.n() {
            for e in &mut self.entries[self.starts[i]..self.starts[i + 1]] {
                e.exchange *= d[i] * d[e.to as usize];
            }
        }
    }
}
