//! χ² of drawn directions against their density.

use std::f64::consts::TAU;

use radiosa::math::Vec3;
use radiosa::sampling::Stream;

/// χ² of counts that were expected, as a normal number (Wilson and Hilferty), and how many cells count.
pub(crate) fn chi_square(expected: &[f64], count: &[f64]) -> (f64, f64) {
    let cells = expected.iter().zip(count).filter(|(e, _)| **e > 10.0);
    let terms: Vec<f64> = cells.map(|(e, c): (&f64, &f64)| (c - e).powi(2) / e).collect();
    let n = terms.len() as f64;
    (((terms.iter().sum::<f64>() / n).cbrt() - (1.0 - 2.0 / (9.0 * n))) / (2.0 / (9.0 * n)).sqrt(), n)
}

/// Cells of height and longitude on the unit sphere.
#[derive(Clone, Copy)]
pub(crate) struct Cells {
    /// Heights from here to 1: 0 for the upper hemisphere, −1 for the sphere.
    pub(crate) lowest: f64,
    pub(crate) rows: usize,
    pub(crate) columns: usize,
    /// Points along either side of a cell by which densities are integrated.
    pub(crate) fine: usize,
}

impl Cells {
    /// χ² of `n` directions, as [`chi_square`] has it; where nothing is drawn, nothing counts.
    pub(crate) fn chi_square(
        self,
        n: u32,
        mut draw: impl FnMut(&mut Stream) -> Option<Vec3>,
        pdf: impl Fn(Vec3) -> f32,
    ) -> (f64, f64) {
        let Self { lowest, rows, columns, fine } = self;
        let height = 1.0 - lowest;
        let expected: Vec<f64> = (0..rows * columns)
            .map(|k| {
                let within = (0..fine * fine).map(|i| {
                    let z = lowest + height * ((k / columns) as f64 + ((i / fine) as f64 + 0.5) / fine as f64) / rows as f64;
                    let phi = TAU * ((k % columns) as f64 + ((i % fine) as f64 + 0.5) / fine as f64) / columns as f64;
                    let r = (1.0 - z * z).max(0.0).sqrt();
                    f64::from(pdf(Vec3::new((r * phi.cos()) as f32, (r * phi.sin()) as f32, z as f32)))
                });
                within.sum::<f64>() * height * TAU / (rows * columns * fine * fine) as f64 * f64::from(n)
            })
            .collect();
        let mut count = vec![0.0; rows * columns];
        let mut stream = Stream::new(5, 6, 7);
        for _ in 0..n {
            let Some(w) = draw(&mut stream) else { continue };
            let turn = f64::from(w.y).atan2(f64::from(w.x)).rem_euclid(TAU) / TAU;
            let row = (((f64::from(w.z) - lowest) / height * rows as f64) as usize).min(rows - 1);
            count[row * columns + ((turn * columns as f64) as usize).min(columns - 1)] += 1.0;
        }
        chi_square(&expected, &count)
    }
}
