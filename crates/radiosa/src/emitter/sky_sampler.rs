//! Directions drawn from an environment map in proportion to its luminance: importance sampling of skies.
//!
//! The sphere is cut into cells of equal longitude and colatitude, each of one or more texels. A row is chosen by the light it holds, a cell by its share of the
//! row, a direction uniformly within the cell:
//!
//! ```text
//! p(ω) = L_c / Σ L Ω      L_c the mean luminance around cell c, Ω its solid angle
//! ```
//!
//! The mean is taken over a cell and its eight neighbours, so that what shines between two texels by interpolation is never left out.

use super::environment::{Map, RowIntegral, Sky};
use crate::math::{DQuat, DVec3, Vec2, Vec3, function};
use std::f64::consts::{PI, TAU};

/// Cells across at most; half as many down.
const ACROSS: u32 = 4096;

/// A sky ready to be sampled.
#[derive(Clone, Debug)]
pub struct SkySampler {
    to_map: DQuat,
    width: u32,
    height: u32,
    /// Probability of all rows up to and with each.
    rows: Vec<f64>,
    /// Row by row: within the row, of all cells up to and with each.
    columns: Vec<f32>,
}

impl SkySampler {
    /// `None` where nothing is to be gained: a sky that is the same everywhere, or black.
    pub fn new(sky: &Sky) -> Option<Self> {
        let (map, to_map) = sky.map()?;
        let (across, down) = map.size();
        let (width, height) = (across.min(ACROSS), down.min(ACROSS / 2));
        let means = means(map, width, height);
        let at = |x: i64, y: i64| {
            let (x, y) = (x.rem_euclid(i64::from(width)), y.clamp(0, i64::from(height) - 1));
            means[(y * i64::from(width) + x) as usize]
        };
        let (mut rows, mut columns) = (Vec::with_capacity(height as usize), Vec::with_capacity(means.len()));
        let mut total = 0.0;
        for y in 0..i64::from(height) {
            let first = columns.len();
            let mut sum = 0.0;
            for x in 0..i64::from(width) {
                sum += (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy))).map(|(dx, dy)| at(x + dx, y + dy)).sum::<f64>();
                columns.push(sum);
            }
            columns[first..].iter_mut().for_each(|c| *c = if sum > 0.0 { *c / sum } else { 0.0 });
            total += sum * RowIntegral::new(y as u32, height).sin;
            rows.push(total);
        }
        if !(total > 0.0 && total.is_finite()) {
            return None;
        }
        rows.iter_mut().for_each(|r| *r /= total);
        Some(Self { to_map, width, height, rows, columns: columns.into_iter().map(|c| c as f32).collect() })
    }

    /// The cells of a row.
    fn row(&self, y: usize) -> &[f32] {
        &self.columns[y * self.width as usize..][..self.width as usize]
    }

    /// Of a cell, 1/sr.
    fn density(&self, x: usize, y: usize) -> f32 {
        let share = |cumulative: f64, before: f64| (cumulative - before).max(0.0);
        let of_row = share(self.rows[y], if y > 0 { self.rows[y - 1] } else { 0.0 });
        let row = self.row(y);
        let of_cell = share(f64::from(row[x]), if x > 0 { f64::from(row[x - 1]) } else { 0.0 });
        (of_row * of_cell / RowIntegral::new(y as u32, self.height).solid_angle(self.width)) as f32
    }

    /// A direction (unit, scene coordinates) by two uniform numbers, and its density, 1/sr.
    pub fn sample(&self, u: Vec2) -> Option<(Vec3, f32)> {
        let v = f64::from(u.y);
        let y = self.rows.partition_point(|r| *r <= v).min(self.rows.len() - 1);
        let row = self.row(y);
        let x = row.partition_point(|c| *c <= u.x).min(row.len() - 1);
        let within = |u: f64, from: f64, to: f64| if to > from { ((u - from) / (to - from)).clamp(0.0, 1.0) } else { 0.5 };
        let s = within(f64::from(u.x), if x > 0 { f64::from(row[x - 1]) } else { 0.0 }, f64::from(row[x]));
        let t = within(v, if y > 0 { self.rows[y - 1] } else { 0.0 }, self.rows[y]);
        let phi = TAU * ((x as f64 + s) / f64::from(self.width) - 0.5);
        let cos_of = |y: usize| function::cos_f64(PI * y as f64 / f64::from(self.height));
        let cos = cos_of(y) + t * (cos_of(y + 1) - cos_of(y));
        let sin = ((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt();
        let local = DVec3::new(sin * function::sin_f64(phi), cos, -sin * function::cos_f64(phi));
        let pdf = self.density(x, y);
        (pdf > 0.0).then(|| ((self.to_map.inverse() * local).as_vec3().normalize(), pdf))
    }

    /// The density, 1/sr, with which a unit direction (scene coordinates) is drawn.
    pub fn pdf(&self, dir: Vec3) -> f32 {
        let d = self.to_map * dir.as_dvec3();
        let u = 0.5 + function::atan2_f64(d.x, -d.z) / TAU;
        let v = function::atan2_f64((d.x * d.x + d.z * d.z).sqrt(), d.y) / PI;
        let cell = |u: f64, n: u32| ((u * f64::from(n)).max(0.0) as usize).min(n as usize - 1);
        self.density(cell(u, self.width), cell(v, self.height))
    }
}

/// The mean luminance of each cell.
fn means(map: &Map, width: u32, height: u32) -> Vec<f64> {
    let (across, down) = map.size();
    let mut sums = vec![(0.0, 0u32); width as usize * height as usize];
    for y in 0..down {
        let j = u64::from(y) * u64::from(height) / u64::from(down);
        for x in 0..across {
            let i = u64::from(x) * u64::from(width) / u64::from(across);
            let (sum, n) = &mut sums[(j * u64::from(width) + i) as usize];
            *sum += f64::from(map.texel(x, y).luminance());
            *n += 1;
        }
    }
    sums.iter().map(|(sum, n)| sum / f64::from((*n).max(1))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::Stream;
    use crate::spectrum::Spectrum;

    fn sky() -> Sky {
        let texels = (0..32 * 16).map(|k| {
            let (x, y) = (k % 32, k / 32);
            // Half of it black, and a sun.
            Spectrum::gray(if (x, y) == (20, 4) {
                500.0
            } else if x < 12 {
                0.0
            } else {
                1.0 + (x * y % 7) as f32
            })
        });
        Sky::of_map(Map::new(32, 16, texels).expect("it has texels"))
    }

    /// χ² of drawn directions over equal cells of height and longitude against the integral of `pdf`, and how many cells count.
    fn chi_square(sampler: &SkySampler, pdf: impl Fn(Vec3) -> f32) -> (f64, usize) {
        const ROWS: usize = 16;
        const COLUMNS: usize = 32;
        const FINE: usize = 24;
        const N: u32 = 400_000;
        let dir = |z: f64, phi: f64| {
            let r = (1.0 - z * z).max(0.0).sqrt();
            DVec3::new(r * phi.sin(), z, -r * phi.cos()).as_vec3()
        };
        let mut expected = vec![0.0; ROWS * COLUMNS];
        for (k, e) in expected.iter_mut().enumerate() {
            for i in 0..FINE * FINE {
                let z = 1.0 - 2.0 * ((k / COLUMNS) as f64 + (i / FINE) as f64 / FINE as f64 + 0.5 / FINE as f64) / ROWS as f64;
                let phi = TAU * (((k % COLUMNS) as f64 + ((i % FINE) as f64 + 0.5) / FINE as f64) / COLUMNS as f64 - 0.5);
                *e += f64::from(pdf(dir(z, phi))) * 2.0 * TAU / (ROWS * COLUMNS * FINE * FINE) as f64 * f64::from(N);
            }
        }
        let mut count = vec![0.0; ROWS * COLUMNS];
        let mut stream = Stream::new(3, 0, 0);
        let mut n_other = 0;
        for _ in 0..N {
            let (d, p) = sampler.sample(stream.next_2d()).expect("there is light");
            n_other += u32::from((sampler.pdf(d) / p - 1.0).abs() > 1e-3);
            let row = ((1.0 - f64::from(d.y)) * 0.5 * ROWS as f64) as usize;
            let turn = f64::from(d.x).atan2(-f64::from(d.z)) / TAU + 0.5;
            count[row.min(ROWS - 1) * COLUMNS + ((turn * COLUMNS as f64) as usize).min(COLUMNS - 1)] += 1.0;
        }
        // On the very edge of a cell rounding may have it in the next.
        assert!(n_other < 20, "{n_other}");
        let cells = expected.iter().zip(&count).filter(|(e, _)| **e > 20.0);
        let terms: Vec<f64> = cells.map(|(e, c): (&f64, &f64)| (c - e).powi(2) / e).collect();
        (terms.iter().sum(), terms.len())
    }

    #[test]
    fn directions_follow_their_density() {
        let sampler = SkySampler::new(&sky()).expect("a map");
        let (chi, n) = chi_square(&sampler, |d| sampler.pdf(d));
        // Mean n, deviation √(2n); five of them, and a hundredth for the midpoint rule at edges of cells.
        let limit = n as f64 + 5.0 * (2.0 * n as f64).sqrt() + 0.2 * n as f64;
        assert!(n > 250 && chi < limit, "{chi} of {n}");
        // The twin claims the same everywhere.
        let (chi, _) = chi_square(&sampler, |_| 1.0 / (4.0 * PI) as f32);
        assert!(chi > 10.0 * limit);
    }

    #[test]
    fn what_shines_is_never_left_out() {
        let sampler = SkySampler::new(&sky()).expect("a map");
        let mut stream = Stream::new(4, 0, 0);
        let sky = sky();
        for _ in 0..100_000 {
            let d = crate::sampling::warp::uniform_sphere(stream.next_2d());
            assert!(sky.map().is_some_and(|(map, _)| map.radiance(d).is_black()) || sampler.pdf(d) > 0.0, "{d}");
        }
    }
}
