//! The matrix of form factors, by rows and sparse.

use std::io;

use super::form_factor::Row;
use super::mesh::ElementMesh;
use super::stream::{In, Out, wrong};

/// Form factors above zero, by rows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Matrix {
    /// Row `i` has the entries `starts[i]..starts[i + 1]`.
    starts: Vec<usize>,
    /// `(j, F_ij)` by rising `j` within a row.
    entries: Vec<(u32, f32)>,
}

impl Matrix {
    /// From rows as they are.
    pub fn from_rows(rows: &[Row]) -> Self {
        let mut matrix = Self { starts: vec![0], ..Self::default() };
        for row in rows {
            matrix.entries.extend(row.iter().map(|&(j, f)| (j, f as f32)));
            matrix.starts.push(matrix.entries.len());
        }
        matrix
    }

    /// From the exchange areas `A_i F_ij` with `j > i`: both rows get theirs.
    pub fn from_exchange_areas(upper: &[Vec<(u32, f64)>], mesh: &ElementMesh) -> Self {
        let factor = |i: u32, j: u32, entry: &(u32, f64)| (j, (entry.1 / mesh.elements()[i as usize].area) as f32);
        let (starts, entries) = mirrored(upper, |entry| entry.0, factor);
        Self { starts, entries }
    }

    pub(super) fn store(&self, out: &mut Out) -> io::Result<()> {
        (0..self.n()).try_for_each(|i| store_entries(&self.entries[self.starts[i]..self.starts[i + 1]], out))
    }

    /// The inverse of [`Self::store`], for `n` elements.
    pub(super) fn restore(n: usize, from: &mut In) -> io::Result<Self> {
        let mut matrix = Self { starts: vec![0], ..Self::default() };
        for _ in 0..n {
            matrix.entries.extend(restore_entries::<f32>(n, from)?);
            matrix.starts.push(matrix.entries.len());
        }
        Ok(matrix)
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

    /// `Σ_j F_ij`: what arrives anywhere of what leaves `i`.
    pub fn row_sum(&self, i: usize) -> f64 {
        self.row(i).map(|(_, f)| f).sum()
    }
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
/// by rising `j`.
pub(super) fn mirrored<E, T: Copy + Default>(
    upper: &[Vec<E>],
    column: impl Fn(&E) -> u32,
    entry: impl Fn(u32, u32, &E) -> T,
) -> (Vec<usize>, Vec<T>) {
    let n = upper.len();
    let mut starts = vec![0usize; n + 1];
    for (i, row) in upper.iter().enumerate() {
        starts[i + 1] += row.len();
        row.iter().for_each(|e| starts[column(e) as usize + 1] += 1);
    }
    (0..n).for_each(|i| starts[i + 1] += starts[i]);
    let mut next = starts.clone();
    let mut entries = vec![T::default(); starts[n]];
    let mut put = |i: u32, j: u32, e: &E| {
        let at = &mut next[i as usize];
        entries[*at] = entry(i, j, e);
        *at += 1;
    };
    // Rising in every row: what lies below the diagonal comes from earlier rows, in their order.
    for (i, row) in upper.iter().enumerate() {
        for e in row {
            put(i as u32, column(e), e);
            put(column(e), i as u32, e);
        }
    }
    (starts, entries)
}
