//! The matrix of form factors, by rows and sparse.

use std::io;

use super::form_factor::Row;
use super::medium::{Medium, Passing};
use super::mesh::ElementMesh;
use crate::stream::{In, Out, wrong};

/// Form factors above zero, by rows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Matrix {
    /// Row `i` has the entries `starts[i]..starts[i + 1]`.
    starts: Vec<usize>,
    /// `(j, F_ij)` by rising `j` within a row.
    entries: Vec<(u32, f32)>,
    /// τ_ij of each.
    passing: Passing,
}

impl Matrix {
    /// From rows as they are.
    pub fn from_rows(rows: &[Row], medium: &Medium) -> Self {
        let mut matrix = Self { starts: vec![0], entries: Vec::new(), passing: Passing::new(medium) };
        for row in rows {
            matrix.entries.extend(row.entries.iter().map(|&(j, f)| (j, f as f32)));
            (0..row.entries.len()).for_each(|k| matrix.passing.push(row.passing.at(k)));
            matrix.starts.push(matrix.entries.len());
        }
        matrix
    }

    /// From the exchange areas `A_i F_ij` with `j > i`: both rows get theirs.
    pub fn from_exchange_areas(upper: &[Row], mesh: &ElementMesh, medium: &Medium) -> Self {
        let columns: Vec<&[(u32, f64)]> = upper.iter().map(|row| row.entries.as_slice()).collect();
        let factor = |i: u32, j: u32, _, entry: &(u32, f64)| (j, (entry.1 / mesh.elements()[i as usize].area) as f32);
        let (starts, entries) = mirrored(&columns, |entry| entry.0, factor);
        let mut passing = Passing::new(medium);
        if !medium.is_clear() {
            let (_, links) = mirrored(&columns, |entry| entry.0, |_, _, link, _| link);
            links.into_iter().for_each(|[row, k]| passing.push(upper[row as usize].passing.at(k as usize)));
        }
        Self { starts, entries, passing }
    }

    pub(super) fn store(&self, out: &mut Out) -> io::Result<()> {
        (0..self.n()).try_for_each(|i| store_entries(&self.entries[self.starts[i]..self.starts[i + 1]], out))?;
        self.passing.store(out)
    }

    /// The inverse of [`Self::store`], for `n` elements in a medium.
    pub(super) fn restore(n: usize, medium: &Medium, from: &mut In) -> io::Result<Self> {
        let mut matrix = Self { starts: vec![0], ..Self::default() };
        for _ in 0..n {
            matrix.entries.extend(restore_entries::<f32>(n, from)?);
            matrix.starts.push(matrix.entries.len());
        }
        matrix.passing = Passing::restore(medium, matrix.entries.len(), from)?;
        Ok(matrix)
    }

    /// Lets no element receive more than there is: rows that sum to more than `1 + Σ_j F_ij τ_j`, where τ_j is the part that passes `j` and is met behind it once more,
    /// are brought down to that, and what others have from them in proportion, so that `A_i F_ij = A_j F_ji` goes on to hold.
    ///
    /// The exposed area of an element that others cover nearly whole is found by points, what it exchanges by rays: where the quotient is too large, two such
    /// elements sent each other more in every sweep than they had got.
    pub fn limit(&mut self, tau: &dyn Fn(usize) -> f64) -> Limited {
        let scales: Vec<f64> = (0..self.n()).map(|i| share_of_row(self.row(i), tau)).collect();
        let mut limited = Limited { rows: scales.iter().filter(|s| **s < 1.0).count(), largest: 0.0 };
        (0..self.n()).for_each(|i| limited.largest = self.row_sum(i).max(limited.largest));
        for i in 0..self.n() {
            for (j, f) in &mut self.entries[self.starts[i]..self.starts[i + 1]] {
                *f = (f64::from(*f) * scales[i].min(scales[*j as usize])) as f32;
            }
        }
        limited
    }

    /// Rows.
    pub fn n(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// Entries above zero.
    pub fn n_entries(&self) -> usize {
        self.entries.len()
    }

    /// `(j, F_ij)` by rising `j`.
    pub fn row(&self, i: usize) -> impl Iterator<Item = (usize, f64)> {
        self.entries[self.starts[i]..self.starts[i + 1]].iter().map(|&(j, f)| (j as usize, f64::from(f)))
    }

    /// `(j, τ_ij F_ij)` by rising `j`: what arrives through the medium, by channel.
    pub fn arriving(&self, i: usize) -> impl Iterator<Item = (usize, [f64; 3])> {
        let links = self.starts[i]..self.starts[i + 1];
        self.row(i).zip(links).map(|((j, f), link)| (j, self.passing.at(link).map(|tau| tau * f)))
    }

    /// Everything passes the medium.
    pub fn is_clear(&self) -> bool {
        self.passing.is_clear()
    }

    /// `Σ_j F_ij`: what meets anything of what leaves `i`.
    pub fn row_sum(&self, i: usize) -> f64 {
        self.row(i).map(|(_, f)| f).sum()
    }

    /// `Σ_j τ_ij F_ij`: what arrives anywhere of it, by channel.
    pub fn arriving_sum(&self, i: usize) -> [f64; 3] {
        self.arriving(i).fold([0.0; 3], |sum, (_, f)| std::array::from_fn(|c| sum[c] + f[c]))
    }
}

/// Raw rows that summed to more than there is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Limited {
    /// How many were brought down.
    pub rows: usize,
    /// The largest sum of any row, before.
    pub largest: f64,
}

/// The part of a row `(j, F_ij)` that makes it sum to what there is, where it sums to more; else one.
pub(super) fn share_of_row(row: impl Iterator<Item = (usize, f64)>, tau: &dyn Fn(usize) -> f64) -> f64 {
    /// More than other errors of factors make of one.
    const EXCESS: f64 = 0.02;
    let [sum, passes] = row.fold([0.0; 2], |[sum, passes], (j, f)| [sum + f, passes + f * tau(j)]);
    if sum > 1.0 + passes + EXCESS { (1.0 + passes) / sum } else { 1.0 }
}

/// Columns and values of a row, one array each.
pub(super) fn store_entries<T: bytemuck::NoUninit>(entries: &[(u32, T)], out: &mut Out) -> io::Result<()> {
    let (columns, values): (Vec<u32>, Vec<T>) = entries.iter().copied().unzip();
    out.array(&columns)?;
    out.array(&values)
}

/// The inverse of [`store_entries`], with columns below `n`.
pub(super) fn restore_entries<T: bytemuck::Pod>(n: usize, from: &mut In) -> io::Result<Vec<(u32, T)>> {
    let columns = from.any_array::<u32>()?;
    let values = from.array::<T>(columns.len())?;
    if columns.iter().any(|&j| j as usize >= n) {
        return Err(wrong("a form factor is of an element that does not exist"));
    }
    Ok(columns.into_iter().zip(values).collect())
}

/// Sparse rows from those above the diagonal, each of whose entries stands for its mirror image too: where rows start, and `entry(i, j, …)` of both,
/// by rising `j`; given the row and the place in it of the one they stand for, and that itself.
pub(super) fn mirrored<E, R: AsRef<[E]>, T: Copy + Default>(
    upper: &[R],
    column: impl Fn(&E) -> u32,
    entry: impl Fn(u32, u32, [u32; 2], &E) -> T,
) -> (Vec<usize>, Vec<T>) {
    let n = upper.len();
    let mut starts = vec![0usize; n + 1];
    for (i, row) in upper.iter().enumerate() {
        let row = row.as_ref();
        starts[i + 1] += row.len();
        row.iter().for_each(|e| starts[column(e) as usize + 1] += 1);
    }
    (0..n).for_each(|i| starts[i + 1] += starts[i]);
    let mut next = starts.clone();
    let mut entries = vec![T::default(); starts[n]];
    let mut put = |i: u32, j: u32, link: [u32; 2], e: &E| {
        let at = &mut next[i as usize];
        entries[*at] = entry(i, j, link, e);
        *at += 1;
    };
    // Rising in every row: what lies below the diagonal comes from earlier rows, in their order.
    for (i, row) in upper.iter().enumerate() {
        for (k, e) in row.as_ref().iter().enumerate() {
            let link = [i as u32, k as u32];
            put(i as u32, column(e), link, e);
            put(column(e), i as u32, link, e);
        }
    }
    (starts, entries)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_covered_nearly_whole_does_not_make_light() {
        // E = 1 − ρ. Two slivers, found smaller than what they exchange, see each other twice; what is left of them sees a third element.
        let (rho, areas) = (0.9, [0.01, 0.01, 1.0]);
        let exchange = [vec![(1, 0.02), (2, 0.001)], vec![(2, 0.001)], vec![]];
        let rows: [Row; 3] = std::array::from_fn(|i| {
            let of = |j: usize| {
                exchange[i.min(j)].iter().find(|e| e.0 == i.max(j) as u32 && i != j).map(|e| (j as u32, e.1 / areas[i]))
            };
            Row { entries: (0..3).filter_map(of).collect(), ..Row::default() }
        });
        let after = |matrix: &Matrix| {
            let mut b = [1.0 - rho; 3];
            for _ in 0..500 {
                (0..3).for_each(|i| b[i] = 1.0 - rho + rho * matrix.row(i).map(|(j, f)| f * b[j]).sum::<f64>());
            }
            b
        };
        let mut matrix = Matrix::from_rows(&rows, &Medium::default());
        // The twin makes light.
        assert!(after(&matrix)[0] > 1e20);
        matrix.limit(&|_| 0.0);
        let b = after(&matrix);
        // Of what either sliver gets the part f comes from the third: b = 1 − ρ + ρ ((1 − f) b + f b₃).
        let f = 0.1 / 2.1;
        let truth = (1.0 - rho + rho * f * b[2]) / (1.0 - rho * (1.0 - f));
        assert!((b[0] - truth).abs() < 1e-5 && (b[1] - truth).abs() < 1e-5, "{b:?}, not {truth}");
        assert!((matrix.row_sum(0) - 1.0).abs() < 1e-6, "{}", matrix.row_sum(0));
        for (i, j) in [(0, 1), (0, 2), (1, 2)] {
            let of = |i: usize, j: usize| areas[i] * matrix.row(i).find(|e| e.0 == j).map_or(0.0, |e| e.1);
            assert!((of(i, j) / of(j, i) - 1.0).abs() < 1e-6, "{i} and {j} are not reciprocal");
        }
        // Rows behind a pane that lets all through may sum to two.
        let mut behind = Matrix::from_rows(&rows, &Medium::default());
        behind.limit(&|j| if j < 2 { 1.5 } else { 0.0 });
        assert_eq!(behind, Matrix::from_rows(&rows, &Medium::default()));
    }
}
