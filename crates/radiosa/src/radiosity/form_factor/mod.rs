//! Form factors `F_ij`: the fraction of what leaves element *i* that arrives at element *j*.
//!
//! ```text
//! F_ij = 1/A_i ∫_i ∫_j V K dA_j dA_i,   K = cos θ cos θ′ / (π r²),   A_i F_ij = A_j F_ji
//! ```
//!
//! Each estimator is one file behind one contract: [`Factors::row`] gives the factors from one element to all others, in the order of the elements.
//! Every solver asks for nothing else, but that [`Factors::matrix`] takes the whole at once where pairs can be shared.

pub mod analytic;
pub mod pair;
mod rule;
pub mod visibility;

use rayon::prelude::*;

use super::matrix::Matrix;
use super::mesh::ElementMesh;
use crate::transport::World;

/// How form factors are estimated.
#[derive(Clone, Debug, PartialEq)]
pub enum Estimator {
    /// Exact factors of polygons times the visible fraction weighted by the kernel.
    Analytic(pair::Settings),
}

impl Default for Estimator {
    fn default() -> Self {
        Self::Analytic(pair::Settings::default())
    }
}

/// The factors of one element: `(j, F_ij)` with `F_ij` above zero, by rising `j`.
pub type Row = Vec<(u32, f64)>;

/// Form factors between the elements of a world, by one estimator.
#[derive(Debug)]
pub struct Factors<'a> {
    mesh: &'a ElementMesh,
    kind: Kind<'a>,
}

#[derive(Debug)]
enum Kind<'a> {
    Analytic(pair::Pairs<'a>),
}

/// What a thread needs while it asks for rows.
#[derive(Debug, Default)]
pub struct Scratch {
    pair: pair::Scratch,
}

impl<'a> Factors<'a> {
    /// Makes an estimator ready.
    pub fn new(world: &'a World, mesh: &'a ElementMesh, estimator: &Estimator, _seed: u64) -> Self {
        let kind = match estimator {
            Estimator::Analytic(settings) => Kind::Analytic(pair::Pairs::new(world, mesh, settings)),
        };
        Self { mesh, kind }
    }

    /// The elements.
    pub fn mesh(&self) -> &ElementMesh {
        self.mesh
    }

    /// The factors from element `i` to every other. Rays traced are counted in `scratch`.
    pub fn row(&self, i: u32, row: &mut Row, scratch: &mut Scratch) {
        row.clear();
        match &self.kind {
            Kind::Analytic(pairs) => {
                let area = self.mesh.elements()[i as usize].area;
                if area <= 0.0 {
                    return;
                }
                for j in (0..self.mesh.elements().len() as u32).filter(|&j| j != i) {
                    let exchange = pairs.exchange_area(i.min(j), i.max(j), &mut scratch.pair);
                    if exchange > 0.0 {
                        row.push((j, exchange / area));
                    }
                }
            }
        }
    }

    /// All rows. The same at any thread count.
    pub fn matrix(&self) -> Matrix {
        self.assemble(&self.part(0..self.mesh.elements().len() as u32))
    }

    /// Some elements' share of the matrix, which [`Self::assemble`] makes of the shares of all in their order: for the analytic estimator, the exchange
    /// areas with later elements.
    pub fn part(&self, of: std::ops::Range<u32>) -> Vec<Row> {
        let n = self.mesh.elements().len() as u32;
        match &self.kind {
            Kind::Analytic(pairs) => of
                .into_par_iter()
                .map_init(Scratch::default, |scratch, i| {
                    let exchange = |j| (j, pairs.exchange_area(i, j, &mut scratch.pair));
                    (i + 1..n).map(exchange).filter(|&(_, e)| e > 0.0).collect()
                })
                .collect(),
        }
    }

    /// The matrix from the shares of all elements.
    pub fn assemble(&self, parts: &[Row]) -> Matrix {
        match &self.kind {
            Kind::Analytic(_) => Matrix::from_exchange_areas(parts, self.mesh),
        }
    }

    /// The rows of some elements, in their order. The same at any thread count.
    pub fn rows(&self, of: &[u32]) -> Vec<Row> {
        let row = |scratch: &mut Scratch, &i: &u32| {
            let mut row = Row::new();
            self.row(i, &mut row, scratch);
            row
        };
        of.par_iter().map_init(Scratch::default, row).collect()
    }
}
