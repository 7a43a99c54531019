//! What one pixel holds, and how its samples become one value.

use super::{FilterSample, Layer};
use crate::math::{Vec2, Vec3};
use crate::spectrum::Spectrum;

/// What one camera sample, or the finished mean of a pixel's samples, delivers. Light is radiance; the fields of the two
/// decompositions must sum to `color` (see [`super::Decomposition`]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pixel {
    /// All the light.
    pub color: Spectrum,
    /// 1 where the ray met a surface, 0 where it left the scene.
    pub alpha: f32,
    /// What ambient light adds.
    pub ambient: Spectrum,
    /// Diffuse reflection.
    pub diffuse: Spectrum,
    /// Glossy highlights of lights.
    pub specular: Spectrum,
    /// What mirrors show.
    pub reflection: Spectrum,
    /// What is seen through glass.
    pub refraction: Spectrum,
    /// What surfaces emit towards the viewer.
    pub emission: Spectrum,
    /// What a ray that leaves the scene sees.
    pub background: Spectrum,
    /// Light scattered once.
    pub direct: Spectrum,
    /// Light scattered more than once.
    pub indirect: Spectrum,
    /// Reflectance of the first surface.
    pub albedo: Spectrum,
    /// Shading normal of the first surface; zero without one.
    pub normal: Vec3,
    /// Where the first surface was met; zero without one.
    pub position: Vec3,
    /// How far that is from the eye point; infinite without one.
    pub depth: f32,
    /// Variance of the mean colour, per channel; filled by [`Accumulator::finish`], zero in a sample.
    pub variance: Spectrum,
    /// Samples it is the mean of.
    pub samples: f32,
    /// Index of the first object met.
    pub object: Option<u32>,
}

impl Default for Pixel {
    fn default() -> Self {
        Self {
            color: Spectrum::BLACK,
            alpha: 0.0,
            ambient: Spectrum::BLACK,
            diffuse: Spectrum::BLACK,
            specular: Spectrum::BLACK,
            reflection: Spectrum::BLACK,
            refraction: Spectrum::BLACK,
            emission: Spectrum::BLACK,
            background: Spectrum::BLACK,
            direct: Spectrum::BLACK,
            indirect: Spectrum::BLACK,
            albedo: Spectrum::BLACK,
            normal: Vec3::ZERO,
            position: Vec3::ZERO,
            depth: f32::INFINITY,
            variance: Spectrum::BLACK,
            samples: 1.0,
            object: None,
        }
    }
}

impl Pixel {
    /// The values of a layer; layers of one channel use the first only, [`Layer::ObjectId`] none.
    pub fn layer(&self, layer: Layer) -> [f32; 3] {
        match layer {
            Layer::Color => self.color.to_array(),
            Layer::Alpha => [self.alpha, 0.0, 0.0],
            Layer::Ambient => self.ambient.to_array(),
            Layer::Diffuse => self.diffuse.to_array(),
            Layer::Specular => self.specular.to_array(),
            Layer::Reflection => self.reflection.to_array(),
            Layer::Refraction => self.refraction.to_array(),
            Layer::Emission => self.emission.to_array(),
            Layer::Background => self.background.to_array(),
            Layer::Direct => self.direct.to_array(),
            Layer::Indirect => self.indirect.to_array(),
            Layer::Albedo => self.albedo.to_array(),
            Layer::Normal => self.normal.to_array(),
            Layer::Position => self.position.to_array(),
            Layer::Depth => [self.depth, 0.0, 0.0],
            Layer::Variance => self.variance.to_array(),
            Layer::Samples => [self.samples, 0.0, 0.0],
            Layer::ObjectId => [0.0; 3],
        }
    }

    /// The fields that are averaged, in a fixed order; [`Self::from_means`] is its inverse.
    fn means(&self) -> [f32; N_MEANS] {
        let mut values = [0.0; N_MEANS];
        let spectra = [
            self.color,
            self.ambient,
            self.diffuse,
            self.specular,
            self.reflection,
            self.refraction,
            self.emission,
            self.background,
            self.direct,
            self.indirect,
            self.albedo,
            Spectrum::from(self.normal.to_array()),
        ];
        for (chunk, s) in values.chunks_exact_mut(3).zip(spectra) {
            chunk.copy_from_slice(&s.to_array());
        }
        values[N_MEANS - 1] = self.alpha;
        values
    }

    /// The weighted sum of samples, their weights summing to 1: of everything that is averaged; position, depth and object stay empty.
    pub(crate) fn blend<'a>(samples: impl IntoIterator<Item = (&'a Self, f64)>) -> Self {
        let mut sum = [0.0; N_MEANS];
        for (sample, weight) in samples {
            sum.iter_mut().zip(sample.means()).for_each(|(sum, v)| *sum += weight * f64::from(v));
        }
        Self::from_means(&sum.map(|v| v as f32))
    }

    fn from_means(values: &[f32; N_MEANS]) -> Self {
        let s = |i: usize| Spectrum::new(values[3 * i], values[3 * i + 1], values[3 * i + 2]);
        Self {
            color: s(0),
            ambient: s(1),
            diffuse: s(2),
            specular: s(3),
            reflection: s(4),
            refraction: s(5),
            emission: s(6),
            background: s(7),
            direct: s(8),
            indirect: s(9),
            albedo: s(10),
            normal: Vec3::from_array(s(11).to_array()),
            alpha: values[N_MEANS - 1],
            ..Self::default()
        }
    }
}

/// Twelve triples and the alpha.
const N_MEANS: usize = 37;

/// Turns the samples of one pixel into their filtered mean.
///
/// With samples `L_i` drawn from the filter and weights `w_i` whose expectation is 1 (see [`FilterSample`]), the mean is
/// `m + (1/n) Σ (w_i − 1)(L_i − m)`, where `m` is the plain mean of the `L_i`. That is the filter-importance-sampling
/// estimate `(1/n) Σ w_i L_i` with `m` as a control variate: it gives exactly `m` for filters without negative lobes, keeps
/// constant pictures exactly constant with them, and never divides by a sum of weights that may be near zero.
///
/// Depth, position and object are those of the sample nearest to the pixel's centre, since an average of them is a point
/// where nothing is. Sums are in f64.
#[derive(Clone, Debug)]
pub struct Accumulator {
    sum: [f64; N_MEANS],
    excess: [f64; N_MEANS],
    excess_weight: f64,
    /// Σ (colour − shift)², with the first sample as shift so that nothing cancels.
    squares: [f64; 3],
    shift: [f64; 3],
    n: u32,
    nearest: Pixel,
    nearest_distance: f32,
}

impl Default for Accumulator {
    fn default() -> Self {
        Self {
            sum: [0.0; N_MEANS],
            excess: [0.0; N_MEANS],
            excess_weight: 0.0,
            squares: [0.0; 3],
            shift: [0.0; 3],
            n: 0,
            nearest: Pixel::default(),
            nearest_distance: f32::INFINITY,
        }
    }
}

impl Accumulator {
    /// With no samples yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a sample that was taken where the filter said.
    pub fn add(&mut self, sample: &Pixel, at: FilterSample) {
        let values = sample.means();
        for (sum, v) in self.sum.iter_mut().zip(values) {
            *sum += f64::from(v);
        }
        if at.weight != 1.0 {
            let w = f64::from(at.weight) - 1.0;
            self.excess_weight += w;
            for (sum, v) in self.excess.iter_mut().zip(values) {
                *sum += w * f64::from(v);
            }
        }
        if self.n == 0 {
            self.shift = [values[0], values[1], values[2]].map(f64::from);
        }
        for ((square, v), shift) in self.squares.iter_mut().zip(values).zip(self.shift) {
            *square += (f64::from(v) - shift) * (f64::from(v) - shift);
        }
        self.n += 1;
        let distance = at.offset.length_squared();
        if self.n == 1 || distance < self.nearest_distance {
            self.nearest = *sample;
            self.nearest_distance = distance;
        }
    }

    /// Samples so far.
    pub fn n_samples(&self) -> u32 {
        self.n
    }

    /// The filtered mean, with the variance of that mean (of the plain mean, where weights differ); black without samples.
    pub fn finish(&self) -> Pixel {
        if self.n == 0 {
            return Pixel::default();
        }
        let n = f64::from(self.n);
        let mut means = [0.0; N_MEANS];
        for (i, mean) in means.iter_mut().enumerate() {
            let m = self.sum[i] / n;
            *mean = (m + (self.excess[i] - m * self.excess_weight) / n) as f32;
        }
        // Var(mean) = (Σ (x − s)² − n (x̄ − s)²) / (n (n − 1)).
        let variance = |c: usize| {
            let d = self.sum[c] / n - self.shift[c];
            ((self.squares[c] - n * d * d) / (n * (n - 1.0))).max(0.0) as f32
        };
        let mut pixel = Pixel::from_means(&means);
        pixel.variance = if self.n > 1 { Spectrum::new(variance(0), variance(1), variance(2)) } else { Spectrum::gray(0.0) };
        pixel.samples = self.n as f32;
        pixel.position = self.nearest.position;
        pixel.depth = self.nearest.depth;
        pixel.object = self.nearest.object;
        pixel
    }
}

impl FilterSample {
    /// The centre of the pixel.
    pub const CENTER: Self = Self { offset: Vec2::ZERO, weight: 1.0 };
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Filter;

    fn numbered() -> Pixel {
        let s = |k: f32| Spectrum::new(k, k + 0.25, k + 0.5);
        Pixel {
            color: s(1.0),
            alpha: 0.5,
            ambient: s(2.0),
            diffuse: s(3.0),
            specular: s(4.0),
            reflection: s(5.0),
            refraction: s(6.0),
            emission: s(7.0),
            background: s(8.0),
            direct: s(9.0),
            indirect: s(10.0),
            albedo: s(11.0),
            normal: Vec3::new(12.0, 13.0, 14.0),
            position: Vec3::new(15.0, 16.0, 17.0),
            depth: 18.0,
            variance: Spectrum::BLACK,
            samples: 1.0,
            object: Some(19),
        }
    }

    #[test]
    fn one_sample_comes_back_as_it_is_in_every_layer() {
        let mut a = Accumulator::new();
        a.add(&numbered(), FilterSample::CENTER);
        let pixel = a.finish();
        for layer in Layer::ALL {
            assert_eq!(pixel.layer(layer), numbered().layer(layer), "{layer}");
        }
        assert_eq!(pixel, numbered());
    }

    #[test]
    fn a_constant_picture_stays_constant_through_every_filter() {
        for filter in Filter::ALL {
            let mut a = Accumulator::new();
            for i in 0..7u32 {
                let u = Vec2::new((i as f32 + 0.5) / 7.0, (i * 3 % 7) as f32 / 7.0);
                a.add(&numbered(), filter.sample(u));
            }
            let pixel = a.finish();
            assert_eq!(pixel.color, numbered().color, "{filter:?}");
            assert_eq!(pixel.albedo, numbered().albedo, "{filter:?}");
            assert_eq!(pixel.variance, Spectrum::BLACK, "{filter:?}");
        }
    }

    #[test]
    fn the_variance_is_that_of_the_mean() {
        // Samples 1, 2, 3, 4 (offset by a large constant): variance 5/3, of the mean 5/12.
        let mut a = Accumulator::new();
        for k in 1..=4u8 {
            a.add(&Pixel { color: Spectrum::gray(1000.0 + f32::from(k)), ..Pixel::default() }, FilterSample::CENTER);
        }
        assert!((a.finish().variance.g - 5.0 / 12.0).abs() < 1e-6);
        assert_eq!(a.finish().color.r, 1002.5);
        assert_eq!(Accumulator::new().finish(), Pixel::default());
    }

    #[test]
    fn depth_and_object_come_from_the_sample_nearest_the_centre() {
        let mut a = Accumulator::new();
        for (x, depth) in [(0.4, 1.0), (-0.1, 2.0), (0.3, 3.0)] {
            let at = FilterSample { offset: Vec2::new(x, 0.0), weight: 1.0 };
            a.add(&Pixel { depth, object: Some(depth as u32), ..Pixel::default() }, at);
        }
        assert_eq!((a.finish().depth, a.finish().object), (2.0, Some(2)));
    }
}
