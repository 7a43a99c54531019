//! What the gathers of a view found, to and from streams: the light of elements, and every gather, for other views of the same scene.

use std::io;

use super::cache::Known;
use super::gather::Gathered;
use crate::math::Vec3;
use crate::spectrum::Spectrum;
use crate::stream::{In, Out, wrong};

/// What further views begin with.
#[derive(Clone, Debug)]
pub struct Kept {
    /// Of pools, over π.
    pub(super) irradiance: Vec<Spectrum>,
    /// The places that it is the mean around.
    pub(super) centres: Vec<Vec3>,
    /// Every gather, in the order they were made in.
    pub(super) known: Vec<Known>,
}

/// Numbers of a gather.
const FLOATS: usize = 29;
/// And those that are whole: rays, and the shift.
const WHOLE: usize = 5;

impl Kept {
    /// Gathers.
    pub fn n_records(&self) -> usize {
        self.known.len()
    }

    /// Writes it.
    ///
    /// # Errors
    /// When the stream cannot take it.
    pub fn store(&self, out: &mut Out) -> io::Result<()> {
        out.array(&self.irradiance.iter().flat_map(|e| e.to_array()).collect::<Vec<f32>>())?;
        out.array(&self.centres.iter().flat_map(|c| c.to_array()).collect::<Vec<f32>>())?;
        out.array(&self.known.iter().flat_map(floats).collect::<Vec<f32>>())?;
        let whole = |known: &Known| {
            let [a, b, c, d] = known.shift;
            [known.gathered.rays, a, b, c, d]
        };
        out.array(&self.known.iter().flat_map(whole).collect::<Vec<u32>>())
    }

    /// Reads what [`Self::store`] wrote, not more than `most` gathers.
    ///
    /// # Errors
    /// When the stream ends, or holds something else or too much.
    pub fn restore(most: u64, from: &mut In) -> io::Result<Self> {
        let irradiance: Vec<f32> = from.any_array()?;
        let centres: Vec<f32> = from.any_array()?;
        let known: Vec<f32> = from.any_array()?;
        let whole: Vec<u32> = from.any_array()?;
        let are_whole = irradiance.len().is_multiple_of(3)
            && centres.len() == irradiance.len()
            && known.len().is_multiple_of(FLOATS)
            && whole.len().is_multiple_of(WHOLE);
        if !are_whole {
            return Err(wrong("an array has another length than it should"));
        }
        let (known, whole) = (known.chunks_exact(FLOATS), whole.chunks_exact(WHOLE));
        if known.len() != whole.len() {
            return Err(wrong("its gathers are not as many as their rays"));
        }
        if known.len() as u64 > most {
            return Err(wrong("it holds more gathers than --max-memory allows"));
        }
        let is_sound = |e: &[f32]| e.iter().all(|e| e.is_finite());
        // (Where nothing is around the mean distance is infinite.)
        if !is_sound(&irradiance)
            || !is_sound(&centres)
            || !known.clone().all(|k| is_sound(&k[..FLOATS - 2]) && k[FLOATS - 2] > 0.0 && k[FLOATS - 1] >= 0.0)
        {
            return Err(wrong("its light is not finite"));
        }
        let is_unit = |n: &[f32]| (Vec3::from_slice(n).length_squared() - 1.0).abs() < 1e-3;
        if irradiance.iter().any(|e| *e < 0.0) || !known.clone().all(|k| is_unit(&k[3..6]) && k[6..9].iter().all(|e| *e >= 0.0)) {
            return Err(wrong("it holds negative light, or normals that are not of unit length"));
        }
        let irradiance = irradiance.chunks_exact(3).map(|e| Spectrum::new(e[0], e[1], e[2])).collect();
        let centres = centres.chunks_exact(3).map(Vec3::from_slice).collect();
        Ok(Self { irradiance, centres, known: known.zip(whole).map(|(f, w)| of(f, w)).collect() })
    }
}

fn floats(known: &Known) -> [f32; FLOATS] {
    let Known { p, n, gathered, .. } = known;
    let Gathered { irradiance, translation, rotation, distance, error, .. } = gathered;
    let vectors = [*p, *n, Vec3::from(irradiance.to_array())].into_iter().chain(*translation).chain(*rotation);
    let mut all = vectors.flat_map(|v| v.to_array()).chain([*distance, *error]);
    std::array::from_fn(|_| all.next().unwrap_or_default())
}

fn of(f: &[f32], whole: &[u32]) -> Known {
    let vector = |k: usize| Vec3::new(f[3 * k], f[3 * k + 1], f[3 * k + 2]);
    let gathered = Gathered {
        irradiance: Spectrum::from(vector(2).to_array()),
        translation: [3, 4, 5].map(vector),
        rotation: [6, 7, 8].map(vector),
        distance: f[FLOATS - 2],
        error: f[FLOATS - 1],
        rays: whole[0],
    };
    Known { p: vector(0), n: vector(1), gathered, shift: [whole[1], whole[2], whole[3], whole[4]] }
}
