//! The matrix of form factors, by rows and sparse.

use super::form_factor::Row;
use super::mesh::ElementMesh;

/// Form factors above zero, by rows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Matrix {
    /// Row `i` has the entries `starts[i]..starts[i + 1]`.
    starts: Vec<usize>,
    /// `j` of every entry, rising within a row.
    columns: Vec<u32>,
    /// `F_ij` of every entry.
    factors: Vec<f32>,
}

impl Matrix {
    /// From rows as they are.
    pub fn from_rows(rows: &[Row]) -> Self {
        let mut matrix = Self { starts: vec![0], ..Self::default() };
        for row in rows {
            matrix.columns.extend(row.iter().map(|&(j, _)| j));
            matrix.factors.extend(row.iter().map(|&(_, f)| f as f32));
            matrix.starts.push(matrix.columns.len());
        }
        matrix
    }

    /// From the exchange areas `A_i F_ij` with `j > i`: both rows get theirs.
    pub fn from_exchange_areas(upper: &[Vec<(u32, f64)>], mesh: &ElementMesh) -> Self {
        let n = upper.len();
        let mut starts = vec![0usize; n + 1];
        for (i, row) in upper.iter().enumerate() {
            starts[i + 1] += row.len();
            row.iter().for_each(|&(j, _)| starts[j as usize + 1] += 1);
        }
        (0..n).for_each(|i| starts[i + 1] += starts[i]);
        let mut next = starts.clone();
        let (mut columns, mut factors) = (vec![0u32; starts[n]], vec![0f32; starts[n]]);
        let area = |i: usize| mesh.elements()[i].area;
        // Rising j in every row: its entries below i come from earlier rows, in their order.
        for (i, row) in upper.iter().enumerate() {
            for &(j, exchange) in row {
                let at = next[i];
                (columns[at], factors[at]) = (j, (exchange / area(i)) as f32);
                next[i] += 1;
                let at = next[j as usize];
                (columns[at], factors[at]) = (i as u32, (exchange / area(j as usize)) as f32);
                next[j as usize] += 1;
            }
        }
        Self { starts, columns, factors }
    }

    /// Rows.
    pub fn n(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// Entries above zero.
    pub fn n_entries(&self) -> usize {
        self.columns.len()
    }

    /// `(j, F_ij)` by rising `j`.
    pub fn row(&self, i: usize) -> impl Iterator<Item = (usize, f64)> {
        let range = self.starts[i]..self.starts[i + 1];
        self.columns[range.clone()].iter().zip(&self.factors[range]).map(|(&j, &f)| (j as usize, f64::from(f)))
    }

    /// `Σ_j F_ij`: what arrives anywhere of what leaves `i`.
    pub fn row_sum(&self, i: usize) -> f64 {
        self.row(i).map(|(_, f)| f).sum()
    }
}
