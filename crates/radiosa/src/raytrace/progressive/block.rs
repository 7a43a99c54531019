//! A square of pixels, and the sums of their samples.

use std::io;
use std::ops::Range;

use crate::film::{Film, Filter, FilterSample, Layer, Pixel};
use crate::stream::{In, Out, wrong};

/// Pixels a side of a block: enough of them for a mean of their errors, few enough to follow what is noisy.
pub(super) const SIDE: u32 = 8;
/// Pixels of a block, whether or not all of them lie in the picture.
pub(super) const PIXELS: usize = (SIDE * SIDE) as usize;

/// What is summed for each pixel: the channels of the layers that are averaged, colour first.
pub(super) struct Layout {
    layers: Vec<Layer>,
    /// Where the channels of a layer begin, by its place in [`Layer::ALL`].
    start: [usize; Layer::ALL.len()],
    /// Numbers a pixel.
    n: usize,
    /// The filter has negative lobes: samples have weights.
    is_weighed: bool,
    /// The film keeps what a single sample saw: depth, position, object.
    keeps_place: bool,
}

impl Layout {
    pub(super) fn new(layers: &[Layer], filter: Filter) -> Self {
        let is_place = |layer: Layer| matches!(layer, Layer::Position | Layer::Depth | Layer::ObjectId);
        let is_averaged = |layer: Layer| !is_place(layer) && !matches!(layer, Layer::Variance | Layer::Samples);
        let averaged = |layer: &Layer| *layer == Layer::Color || (layers.contains(layer) && is_averaged(*layer));
        let mut layout = Self {
            layers: Layer::ALL.into_iter().filter(averaged).collect(),
            start: [0; Layer::ALL.len()],
            n: 0,
            is_weighed: filter == Filter::Mitchell,
            keeps_place: layers.iter().any(|layer| is_place(*layer)),
        };
        for layer in &layout.layers {
            layout.start[*layer as usize] = layout.n;
            layout.n += layer.channels().len();
        }
        layout
    }

    /// What a pixel takes, bytes.
    pub(super) fn bytes_a_pixel(&self) -> u64 {
        let sums = 8 * self.n as u64 * if self.is_weighed { 2 } else { 1 };
        sums + 3 * 3 * 8 + if self.keeps_place { 20 } else { 0 }
    }
}

/// A square of pixels.
///
/// Per pixel, row by row: `Σ L` of all channels, `Σ (w − 1) L` where the filter has weights `w`, `Σ L²` of the colour.
pub(super) struct Block {
    pub(super) columns: Range<u32>,
    pub(super) rows: Range<u32>,
    /// Samples all of its pixels have, and are to have next.
    pub(super) n: u32,
    pub(super) target: u32,
    /// Pixels that have their first sample, a bit each.
    pub(super) begun: u64,
    /// Rays traced for it.
    pub(super) n_rays: u64,
    sums: Vec<f64>,
    excess: Vec<f64>,
    /// `Σ (w − 1)`.
    excess_weight: f64,
    squares: Vec<[f64; 3]>,
    half: Half,
    /// Of the sample nearest to the centre of each pixel: position and depth, object plus one, and how far from the centre it fell.
    places: Vec<[f32; 4]>,
    objects: Vec<u32>,
    nearest: f32,
    pub(super) error: Measured,
}

/// What the first so many samples were: the colours' sums at the last power of two.
#[derive(Default)]
struct Half {
    n: u32,
    sums: Vec<[f64; 3]>,
    excess: Vec<[f64; 3]>,
    excess_weight: f64,
}

/// What is known of a block's errors; sums over its pixels and channels, relative to their light.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Measured {
    /// Samples when it was measured; 0 for never.
    pub(super) n: u32,
    /// `Σ (A − B)²/4 / (L² + ε)` with A and B the means of the first and second half of the samples; and before it had the second half.
    pub(super) change: [f64; 2],
    /// `Σ s²/n / (L² + ε)`, the variance as if samples were independent.
    pub(super) independent: f64,
}

impl Block {
    pub(super) fn new(layout: &Layout, columns: Range<u32>, rows: Range<u32>) -> Self {
        let weighed = |n: usize| if layout.is_weighed { n } else { 0 };
        let placed = if layout.keeps_place { PIXELS } else { 0 };
        Self {
            columns,
            rows,
            n: 0,
            target: 1,
            begun: 0,
            n_rays: 0,
            sums: vec![0.0; layout.n * PIXELS],
            excess: vec![0.0; weighed(layout.n * PIXELS)],
            excess_weight: 0.0,
            squares: vec![[0.0; 3]; PIXELS],
            half: Half { n: 0, sums: vec![[0.0; 3]; PIXELS], excess: vec![[0.0; 3]; weighed(PIXELS)], excess_weight: 0.0 },
            places: vec![[0.0, 0.0, 0.0, f32::INFINITY]; placed],
            objects: vec![0; placed],
            nearest: f32::INFINITY,
            error: Measured::default(),
        }
    }

    pub(super) fn n_pixels(&self) -> u32 {
        (self.columns.len() * self.rows.len()) as u32
    }

    /// Where a pixel of the picture stands in it.
    pub(super) fn local([x, y]: [u32; 2]) -> usize {
        (y % SIDE * SIDE + x % SIDE) as usize
    }

    /// Its pixels.
    pub(super) fn pixels(&self) -> impl Iterator<Item = [u32; 2]> + use<> {
        let (columns, rows) = (self.columns.clone(), self.rows.clone());
        rows.flat_map(move |y| columns.clone().map(move |x| [x, y]))
    }

    /// Pixels of its that want their first sample when a sample is to stand for squares of `cell` pixels a side.
    pub(super) fn wanting(&self, cell: u32) -> impl Iterator<Item = [u32; 2]> + use<> {
        let begun = self.begun;
        self.pixels().filter(move |&[x, y]| x % cell == 0 && y % cell == 0 && begun >> Self::local([x, y]) & 1 == 0)
    }

    /// Takes first samples, so that one stands for every square of `cell` pixels a side.
    pub(super) fn begin(
        &mut self,
        layout: &Layout,
        cell: u32,
        at: FilterSample,
        draw: impl Fn([u32; 2], u32, &mut u64) -> Pixel,
    ) {
        for pixel in self.wanting(cell) {
            let sample = draw(pixel, 0, &mut self.n_rays);
            self.add(layout, Self::local(pixel), &sample, at, true);
            self.begun |= 1 << Self::local(pixel);
        }
        if cell == 1 {
            self.count(at);
        }
    }

    /// Takes the next sample of every pixel.
    pub(super) fn go_on(&mut self, layout: &Layout, at: FilterSample, draw: impl Fn([u32; 2], u32, &mut u64) -> Pixel) {
        if self.n.is_power_of_two() {
            for (k, half) in self.half.sums.iter_mut().enumerate() {
                half.copy_from_slice(&self.sums[k * layout.n..][..3]);
            }
            for (k, half) in self.half.excess.iter_mut().enumerate() {
                half.copy_from_slice(&self.excess[k * layout.n..][..3]);
            }
            (self.half.n, self.half.excess_weight) = (self.n, self.excess_weight);
        }
        let is_nearest = at.offset.length_squared() < self.nearest;
        for pixel in self.pixels() {
            let sample = draw(pixel, self.n, &mut self.n_rays);
            self.add(layout, Self::local(pixel), &sample, at, is_nearest);
        }
        self.count(at);
    }

    /// All pixels have one sample more.
    fn count(&mut self, at: FilterSample) {
        self.n += 1;
        self.excess_weight += f64::from(at.weight) - 1.0;
        self.nearest = self.nearest.min(at.offset.length_squared());
    }

    fn add(&mut self, layout: &Layout, k: usize, sample: &Pixel, at: FilterSample, is_nearest: bool) {
        let (sums, mut c) = (&mut self.sums[k * layout.n..][..layout.n], 0);
        let weight = f64::from(at.weight) - 1.0;
        for layer in &layout.layers {
            for value in sample.layer(*layer).into_iter().take(layer.channels().len()) {
                sums[c] += f64::from(value);
                if layout.is_weighed {
                    self.excess[k * layout.n + c] += weight * f64::from(value);
                }
                c += 1;
            }
        }
        for (square, v) in self.squares[k].iter_mut().zip(sample.color.to_array()) {
            *square += f64::from(v) * f64::from(v);
        }
        if layout.keeps_place && is_nearest {
            let [x, y, z] = sample.position.to_array();
            self.places[k] = [x, y, z, sample.depth];
            self.objects[k] = sample.object.map_or(0, |id| id.saturating_add(1));
        }
    }

    /// Samples of a pixel.
    fn n_of(&self, k: usize) -> u32 {
        if self.n == 0 { (self.begun >> k & 1) as u32 } else { self.n }
    }

    /// The mean of a number of a pixel: `m + Σ (w − 1)(L − m)/n`, see [`Accumulator`](crate::film::Accumulator).
    fn mean(&self, layout: &Layout, k: usize, c: usize) -> f64 {
        let (n, at) = (f64::from(self.n_of(k).max(1)), k * layout.n + c);
        let m = self.sums[at] / n;
        self.excess.get(at).map_or(m, |excess| m + (excess - m * self.excess_weight) / n)
    }

    /// The channels of a pixel's colour.
    pub(super) fn color(&self, layout: &Layout, k: usize) -> [f64; 3] {
        std::array::from_fn(|c| self.mean(layout, k, c))
    }

    /// `s²/n`: the variance of the mean as if samples were independent.
    fn independent_variance(&self, layout: &Layout, k: usize, c: usize) -> f64 {
        let n = f64::from(self.n);
        if self.n < 2 {
            return 0.0;
        }
        let sum = self.sums[k * layout.n + c];
        ((self.squares[k][c] - sum * sum / n) / (n * (n - 1.0))).max(0.0)
    }

    /// The means of the two halves of a pixel's samples.
    fn halves(&self, layout: &Layout, k: usize, c: usize) -> [f64; 2] {
        let at = k * layout.n + c;
        let mean = |sum: f64, excess: Option<f64>, weight: f64, n: u32| {
            let (n, m) = (f64::from(n), sum / f64::from(n));
            excess.map_or(m, |excess| m + (excess - m * weight) / n)
        };
        let first = self.half.excess.get(k).map(|e| e[c]);
        let second = self.excess.get(at).zip(first).map(|(all, first)| all - first);
        let (sum, weight, n) = (self.half.sums[k][c], self.half.excess_weight, self.half.n);
        [mean(sum, first, weight, n), mean(self.sums[at] - sum, second, self.excess_weight - weight, self.n - n)]
    }

    /// The mean of a channel over a pixel and those around it, as far as they are in the block.
    fn around(&self, layout: &Layout, [x, y]: [u32; 2], c: usize) -> f64 {
        let near = |v: u32, all: &Range<u32>| v.saturating_sub(1).max(all.start)..(v + 2).min(all.end);
        let columns = near(x, &self.columns);
        let pixels = near(y, &self.rows).flat_map(|y| columns.clone().map(move |x| [x, y]));
        let (sum, n) = pixels.fold((0.0, 0.0), |(sum, n), p| (sum + self.mean(layout, Self::local(p), c), n + 1.0));
        sum / n
    }

    /// Measures the errors where there are two halves alike and that has not been done; `beside` is light that is added to the means.
    pub(super) fn measure(&mut self, layout: &Layout, epsilon: f64, beside: impl Fn([u32; 2]) -> [f64; 3]) {
        if self.n < 2 || self.n != 2 * self.half.n || self.error.n == self.n {
            return;
        }
        let (mut change, mut independent) = (0.0, 0.0);
        for pixel in self.pixels() {
            let k = Self::local(pixel);
            for (c, beside) in beside(pixel).into_iter().enumerate() {
                let [a, b] = self.halves(layout, k, c);
                let variance = self.independent_variance(layout, k, c);
                let m = self.mean(layout, k, c);
                // m² less what it owes to its own error, which hides that of a rare bright sample in a dark place; but not in a bright one.
                let square = (m * m - variance).max((0.5 * self.around(layout, pixel, c)).min(m).powi(2));
                let square = (square.sqrt() + beside).powi(2);
                let weight = 1.0 / (square + epsilon).max(f64::MIN_POSITIVE);
                change += weight * (a - b).powi(2) / 4.0;
                independent += weight * variance;
            }
        }
        self.error = Measured { n: self.n, change: [change, self.error.change[0]], independent };
    }

    /// A channel of a layer as the film shows it; `factor` is what the variance is of that of independent samples.
    pub(super) fn value(&self, layout: &Layout, layer: Layer, c: usize, k: usize, factor: f64) -> f32 {
        match layer {
            Layer::Position => self.places[k][c],
            Layer::Depth => self.places[k][3],
            Layer::Samples => self.n_of(k) as f32,
            Layer::Variance => (self.independent_variance(layout, k, c) * factor) as f32,
            _ => self.mean(layout, k, layout.start[layer as usize] + c) as f32,
        }
    }

    pub(super) fn object(&self, k: usize) -> Option<u32> {
        self.objects.get(k).and_then(|id| id.checked_sub(1))
    }

    /// Writes it.
    pub(super) fn store(&self, out: &mut Out) -> io::Result<()> {
        let Half { n, sums, excess, excess_weight } = &self.half;
        for number in [u64::from(self.n), u64::from(self.target), self.begun, self.n_rays, u64::from(*n), u64::from(self.error.n)]
        {
            out.number(number)?;
        }
        let Measured { change: [change, before], independent, .. } = self.error;
        out.array(&[self.excess_weight, *excess_weight, f64::from(self.nearest), change, before, independent])?;
        out.array(&self.sums)?;
        out.array(&self.excess)?;
        out.array(&self.squares)?;
        out.array(sums)?;
        out.array(excess)?;
        out.array(&self.places)?;
        out.array(&self.objects)
    }

    /// Reads what [`Self::store`] wrote of the same block.
    pub(super) fn restore(&mut self, from: &mut In) -> io::Result<()> {
        let mut count = || from.number().and_then(|n| u32::try_from(n).map_err(|_| wrong("it has too many samples")));
        (self.n, self.target) = (count()?, count()?);
        (self.begun, self.n_rays) = (from.number()?, from.number()?);
        let mut count = || from.number().and_then(|n| u32::try_from(n).map_err(|_| wrong("it has too many samples")));
        (self.half.n, self.error.n) = (count()?, count()?);
        let is_possible = self.target <= 2 * super::MAX_SAMPLES && self.n <= self.target && self.half.n <= self.n;
        if !is_possible {
            return Err(wrong("its samples cannot be counted so"));
        }
        let numbers: Vec<f64> = from.array(6)?;
        (self.excess_weight, self.half.excess_weight, self.nearest) = (numbers[0], numbers[1], numbers[2] as f32);
        (self.error.change, self.error.independent) = ([numbers[3], numbers[4]], numbers[5]);
        self.sums = from.array(self.sums.len())?;
        self.excess = from.array(self.excess.len())?;
        self.squares = from.array(self.squares.len())?;
        self.half.sums = from.array(self.half.sums.len())?;
        self.half.excess = from.array(self.half.excess.len())?;
        self.places = from.array(self.places.len())?;
        self.objects = from.array(self.objects.len())?;
        Ok(())
    }
}

/// The blocks of a picture, row by row.
pub(super) fn blocks(film: &Film, layout: &Layout) -> Vec<Block> {
    let range = |i: u32, end: u32| i * SIDE..((i + 1) * SIDE).min(end);
    let (across, down) = (film.width().div_ceil(SIDE), film.height().div_ceil(SIDE));
    let at = |j: u32| (0..across).map(move |i| (i, j));
    (0..down).flat_map(at).map(|(i, j)| Block::new(layout, range(i, film.width()), range(j, film.height()))).collect()
}
