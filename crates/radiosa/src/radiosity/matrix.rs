//! The matrix of form factors, by rows and sparse.

use std::io;

use super::form_factor::Row;
use super::medium::{Medium, Passing};
use super::mesh::ElementMesh;
use super::stream::{In, Out, wrong};

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
