//! Form factors `F_ij`: the fraction of what leaves element *i* that arrives at element *j*.
//!
//! ```text
//! F_ij = 1/A_i ∫_i ∫_j V K dA_j dA_i,   K = cos θ cos θ′ / (π r²),   A_i F_ij = A_j F_ji
//! ```
//!
//! Each estimator is one file behind one contract: [`Factors::row`] gives the factors from one element to all others, in the order of the elements.
//! Every solver asks for nothing else, but that [`Factors::matrix`] takes the whole at once where pairs can be shared. In an absorbing medium every factor has its
//! mean transmittance beside it ([`super::medium`]).

pub mod absorbed;
pub mod analytic;
pub mod area;
mod cull;
pub mod hemicube;
pub mod hemisphere;
pub mod occluded;
pub mod pair;
mod rule;
pub mod visibility;

use rayon::prelude::*;

use super::matrix::Matrix;
use super::medium::{Medium, Passing};
use super::mesh::ElementMesh;
use crate::transport::World;

/// How form factors are estimated.
#[derive(Clone, Debug, PartialEq)]
pub enum Estimator {
    /// Exact factors of polygons times the visible fraction weighted by the kernel.
    Analytic(pair::Settings),
    /// Item buffers on half a cube around source points.
    Hemicube(hemicube::Settings),
    /// Rays over the hemisphere.
    Hemisphere(hemisphere::Settings),
    /// The double integral sampled.
    Area(area::Settings),
}

impl Default for Estimator {
    fn default() -> Self {
        Self::Analytic(pair::Settings::default())
    }
}

/// The factors of one element.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Row {
    /// `(j, F_ij)` with `F_ij` above zero, by rising `j`, as if the medium were clear.
    pub entries: Vec<(u32, f64)>,
    /// τ_ij of each.
    pub passing: Passing,
}

/// What two elements exchange.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exchange {
    /// `A_i F_ij`, m², as if the medium were clear.
    pub area: f64,
    /// Of its estimate.
    pub variance: f64,
    /// τ_ij by channel.
    pub passing: [f64; 3],
}

impl Exchange {
    /// They see nothing of each other.
    pub const NONE: Self = Self { area: 0.0, variance: 0.0, passing: [1.0; 3] };
}

/// Form factors between the elements of a world, by one estimator.
#[derive(Debug)]
pub struct Factors<'a> {
    mesh: &'a ElementMesh,
    medium: Medium,
    kind: Kind<'a>,
}

#[derive(Debug)]
enum Kind<'a> {
    Analytic(Box<pair::Pairs<'a>>),
    Hemicube(hemicube::Hemicube<'a>),
    Hemisphere(hemisphere::Hemisphere<'a>),
    Area(area::Area<'a>),
}

/// What a thread needs while it asks for rows.
#[derive(Debug, Default)]
pub struct Scratch {
    pair: pair::Scratch,
    area: visibility::Scratch,
    hemicube: hemicube::Scratch,
    sums: Sums,
    /// Of every entry of the row asked for last: the variance of its estimate, where estimates vary; sampled more evenly than by chance they vary less.
    pub variances: Vec<f64>,
    /// Rays traced so far.
    pub n_rays: u64,
}

/// A row while its parts come in, in any order.
#[derive(Debug, Default)]
struct Sums {
    /// By element: the sum of the parts and that of their squares.
    parts: Vec<[f64; 2]>,
    /// By element, where parts come through a medium: the sums of what is left of them.
    left: Vec<[f64; 3]>,
    touched: Vec<u32>,
}

impl Sums {
    fn add(&mut self, j: u32, part: f64) {
        if self.parts.len() <= j as usize {
            self.parts.resize(j as usize + 1, [0.0; 2]);
        }
        let sums = &mut self.parts[j as usize];
        if sums[0] == 0.0 {
            self.touched.push(j);
        }
        sums[0] += part;
        sums[1] += part * part;
    }

    /// A part that comes from `distance` metres away through a medium.
    fn add_through(&mut self, medium: &Medium, distance: f64, j: u32, part: f64) {
        self.add(j, part);
        if !medium.is_clear() {
            self.left.resize(self.parts.len(), [0.0; 3]);
            let tau = medium.transmittance(distance);
            (0..3).for_each(|c| self.left[j as usize][c] += part * tau[c]);
        }
    }

    /// Empties it into a row. The variance is that of independent parts: `Σ w² (1 − F)`, which is `F (1 − F)/n` for equal ones.
    fn drain(&mut self, row: &mut Row, variances: &mut Vec<f64>) {
        self.touched.sort_unstable();
        self.touched.dedup();
        for j in self.touched.drain(..) {
            let [factor, squares] = std::mem::take(&mut self.parts[j as usize]);
            let left = self.left.get_mut(j as usize).map_or([factor; 3], std::mem::take);
            if factor > 0.0 {
                row.entries.push((j, factor));
                row.passing.push(left.map(|left| (left / factor).min(1.0)));
                variances.push(squares * (1.0 - factor).max(0.0));
            }
        }
    }
}

impl<'a> Factors<'a> {
    /// Makes an estimator ready, in a clear medium.
    pub fn new(world: &'a World, mesh: &'a ElementMesh, estimator: &Estimator, seed: u64) -> Self {
        Self::in_medium(world, mesh, estimator, Medium::default(), seed)
    }

    /// Makes an estimator ready.
    pub fn in_medium(world: &'a World, mesh: &'a ElementMesh, estimator: &Estimator, medium: Medium, seed: u64) -> Self {
        let kind = match estimator {
            Estimator::Analytic(settings) => Kind::Analytic(Box::new(pair::Pairs::new(world, mesh, settings, medium))),
            Estimator::Hemicube(settings) => Kind::Hemicube(hemicube::Hemicube::new(world, mesh, settings, medium, seed)),
            Estimator::Hemisphere(settings) => Kind::Hemisphere(hemisphere::Hemisphere::new(world, mesh, settings, medium, seed)),
            Estimator::Area(settings) => Kind::Area(area::Area::new(world, mesh, settings, medium, seed)),
        };
        Self { mesh, medium, kind }
    }

    /// Exact factors for single pairs out of many elements, without what only pays when all pairs are asked for.
    pub(super) fn for_links(world: &'a World, mesh: &'a ElementMesh, estimator: &Estimator, medium: Medium) -> Self {
        let settings = match estimator {
            Estimator::Analytic(settings) => settings.clone(),
            _ => pair::Settings::default(),
        };
        Self { mesh, medium, kind: Kind::Analytic(Box::new(pair::Pairs::for_links(world, mesh, &settings, medium))) }
    }

    /// `Σ V K` and `Σ K` along `n` lines between two groups of elements, spread over both.
    pub(super) fn seen_between(&self, groups: [&[u32]; 2], n: usize, scratch: &mut Scratch) -> [f64; 2] {
        match &self.kind {
            Kind::Analytic(pairs) => pairs.seen_between(groups, n, &mut scratch.pair),
            _ => [1.0; 2],
        }
    }

    /// By element: of `n` rays over its hemisphere each meets an element. Nobody knows where surfaces are transparent.
    pub(super) fn closed(&self, n: u32) -> Vec<bool> {
        match &self.kind {
            Kind::Analytic(pairs) => {
                let is_closed = |i: usize| pairs.is_closed(self.mesh, i as u32, n);
                (0..self.mesh.elements().len()).into_par_iter().map(is_closed).collect()
            }
            _ => vec![false; self.mesh.elements().len()],
        }
    }

    /// Nothing can stand between any two elements.
    pub(super) fn is_convex(&self) -> bool {
        matches!(&self.kind, Kind::Analytic(pairs) if pairs.is_convex())
    }

    /// What is between them.
    pub fn medium(&self) -> &Medium {
        &self.medium
    }

    /// The elements.
    pub fn mesh(&self) -> &ElementMesh {
        self.mesh
    }

    /// The factors from element `i` to every other, with their variances in `scratch`.
    pub fn row(&self, i: u32, row: &mut Row, scratch: &mut Scratch) {
        row.entries.clear();
        row.passing.clear(&self.medium);
        scratch.variances.clear();
        let area = self.mesh.elements()[i as usize].area;
        match &self.kind {
            Kind::Analytic(_) | Kind::Area(_) if area <= 0.0 => {}
            Kind::Analytic(_) | Kind::Area(_) => {
                for j in (0..self.mesh.elements().len() as u32).filter(|&j| j != i) {
                    let exchange = self.exchange(i.min(j), i.max(j), scratch);
                    if exchange.area > 0.0 {
                        row.entries.push((j, exchange.area / area));
                        row.passing.push(exchange.passing);
                        scratch.variances.push(exchange.variance / (area * area));
                    }
                }
            }
            Kind::Hemicube(hemicube) => {
                hemicube.row(i, &mut scratch.sums, &mut scratch.hemicube);
                scratch.sums.drain(row, &mut scratch.variances);
            }
            Kind::Hemisphere(hemisphere) => {
                hemisphere.row(i, &mut scratch.sums, &mut scratch.n_rays);
                scratch.sums.drain(row, &mut scratch.variances);
            }
        }
    }

    /// What a pair with `i < j` exchanges, for estimators that see pairs.
    pub(super) fn exchange(&self, i: u32, j: u32, scratch: &mut Scratch) -> Exchange {
        match &self.kind {
            Kind::Analytic(pairs) => pairs.exchange(i, j, &mut scratch.pair),
            Kind::Area(area) => area.exchange(i, j, &mut scratch.area),
            Kind::Hemicube(_) | Kind::Hemisphere(_) => Exchange::NONE,
        }
    }

    /// Every pair is estimated once, so that `A_i F_ij = A_j F_ji` holds exactly; else rows are estimated each on its own.
    pub fn is_reciprocal(&self) -> bool {
        matches!(self.kind, Kind::Analytic(_) | Kind::Area(_))
    }

    /// Shadows are cut out of what pairs exchange, not sampled.
    pub fn is_clipping(&self) -> bool {
        matches!(&self.kind, Kind::Analytic(pairs) if pairs.is_clipping())
    }

    /// All rows as they are estimated. The same at any thread count.
    pub fn matrix(&self) -> Matrix {
        self.assemble(&self.part(0..self.mesh.elements().len() as u32))
    }

    /// Some elements' share of the matrix, which [`Self::assemble`] makes of the shares of all in their order: the exchange areas with later elements
    /// where pairs are estimated, else the rows.
    pub fn part(&self, of: std::ops::Range<u32>) -> Vec<Row> {
        if !self.is_reciprocal() {
            return self.rows(&of.collect::<Vec<_>>());
        }
        let n = self.mesh.elements().len() as u32;
        of.into_par_iter()
            .map_init(Scratch::default, |scratch, i| {
                let mut row = Row { passing: Passing::new(&self.medium), ..Row::default() };
                for j in i + 1..n {
                    let exchange = self.exchange(i, j, scratch);
                    if exchange.area > 0.0 {
                        row.entries.push((j, exchange.area));
                        row.passing.push(exchange.passing);
                    }
                }
                row
            })
            .collect()
    }

    /// The matrix from the shares of all elements.
    pub fn assemble(&self, parts: &[Row]) -> Matrix {
        if self.is_reciprocal() {
            Matrix::from_exchange_areas(parts, self.mesh, &self.medium)
        } else {
            Matrix::from_rows(parts, &self.medium)
        }
    }

    /// The rows of some elements, in their order. The same at any thread count.
    pub fn rows(&self, of: &[u32]) -> Vec<Row> {
        let row = |scratch: &mut Scratch, &i: &u32| {
            let mut row = Row::default();
            self.row(i, &mut row, scratch);
            row
        };
        of.par_iter().map_init(Scratch::default, row).collect()
    }
}
