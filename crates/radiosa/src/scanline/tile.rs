//! One tile: what is seen at each sample, its light, and the pixels it makes.

use super::facet::Facet;
use super::surfaces::Kind;
use super::{Interpolation, MAX_LAYERS, MAX_SAMPLES, ScanLine};
use crate::film::{Accumulator, Film, FilterSample, Pixel};
use crate::math::Vec3;
use crate::math::lanes::{Columns, LANES};
use crate::raster::depth::NOTHING;
use crate::raster::{Bins, Grid, ItemBuffer, Sample, TILE, Tile, Triangle};
use crate::spectrum::Spectrum;
use crate::transport::{LightColumns, LocalLight, Unshadowed, World, default_light};

/// What a thread keeps from tile to tile.
pub(super) struct Scratch<'a> {
    buffers: Vec<ItemBuffer>,
    pub(super) facets: Facets,
    covered: Vec<Sample>,
    fragments: Vec<Fragment>,
    /// What is to be lit, and what comes of it.
    pub(super) asked: Asked,
    pub(super) shown: Vec<Shown>,
    pub(super) data: Vec<Data>,
    pub(super) lit: Unshadowed<'a>,
    /// Light interpolated over faces.
    pub(super) mixed: LightColumns,
    pub(super) varying: Varying,
    /// For each sample of each pixel, from front to back: numbers of places, [`BEHIND`] added where something lies behind; the last may be [`BACKGROUND`]
    /// or [`HIDDEN`].
    chains: Vec<u32>,
    /// Places before they are sorted, and their numbers then.
    unsorted: Vec<Place>,
    moved: Vec<u32>,
}

impl<'a> Scratch<'a> {
    pub(super) fn new(method: &'a ScanLine<'_>, world: &'a World) -> Self {
        Self {
            buffers: Vec::new(),
            facets: Facets::default(),
            covered: Vec::new(),
            fragments: Vec::new(),
            asked: Asked::default(),
            shown: Vec::new(),
            data: Vec::new(),
            lit: Unshadowed::new(world, &method.lights),
            mixed: LightColumns::default(),
            varying: Varying::default(),
            chains: Vec::new(),
            unsorted: Vec::new(),
            moved: Vec::new(),
        }
    }
}

/// The faces of a tile that were needed.
#[derive(Debug, Default)]
pub(super) struct Facets {
    all: Vec<Facet>,
    /// By item: the number of its face among them; [`NOTHING`] until it is needed.
    of_item: Vec<u32>,
}

/// What varies over faces, by place.
#[derive(Debug, Default)]
pub(super) struct Varying {
    /// Barycentric.
    pub(super) weights: Columns,
    /// What the base colour is multiplied by; in the end, the colour of the place.
    pub(super) tint: Columns,
    /// One of the texture's copies, and which of them are wanted.
    pub(super) copy: Columns,
    pub(super) level: Vec<f32>,
}

impl Varying {
    pub(super) fn resize(&mut self, n: usize) {
        let columns = self.weights.iter_mut().chain(&mut self.tint).chain(&mut self.copy).chain([&mut self.level]);
        columns.for_each(|column| column.resize(n + LANES, 0.0));
    }
}

/// Something lies behind this link of a chain.
const BEHIND: u32 = 1 << 31;
/// The last link of a chain that leaves the scene.
const BACKGROUND: u32 = BEHIND - 1;
/// The last link of a chain so long that it hides what is behind.
const HIDDEN: u32 = BEHIND - 2;

/// Places to be lit, those of one face after those of another.
#[derive(Debug, Default)]
pub(super) struct Asked {
    pub(super) items: Vec<u32>,
    /// Pixels from the corner of the tile, with room for the lanes behind the last.
    pub(super) x: Vec<f32>,
    pub(super) y: Vec<f32>,
    /// By item: where its places begin.
    starts: Vec<u32>,
}

/// A face to be lit at a place.
#[derive(Clone, Copy, Debug)]
struct Place {
    item: u32,
    x: f32,
    y: f32,
}

/// A counting sort: every place is [counted](Self::count), then every one [put](Self::put) where it belongs.
impl Asked {
    fn clear(&mut self, n_items: usize) {
        self.starts.clear();
        self.starts.resize(n_items + 1, 0);
    }

    fn count(&mut self, item: u32) {
        self.starts[item as usize + 1] += 1;
    }

    /// All have been counted.
    fn make_room(&mut self) {
        let mut n = 0;
        for start in &mut self.starts {
            n += *start;
            *start = n;
        }
        self.items.resize(n as usize, 0);
        self.x.resize(n as usize + LANES, 0.0);
        self.y.resize(n as usize + LANES, 0.0);
    }

    /// Its number among all; the faces are in the order of the scene, and the places of each in the order they come in.
    fn put(&mut self, place: Place) -> u32 {
        let next = &mut self.starts[place.item as usize];
        let i = *next as usize;
        *next += 1;
        (self.items[i], self.x[i], self.y[i]) = (place.item, place.x, place.y);
        i as u32
    }

    /// Each face with its places, as the first and the one behind the last.
    pub(super) fn faces(&self) -> impl Iterator<Item = (u32, [usize; 2])> {
        let mut first = 0;
        self.items.chunk_by(|a, b| a == b).map(move |same| {
            first += same.len();
            (same[0], [first - same.len(), first])
        })
    }
}

/// What a lit face shows beside its light.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shown {
    pub(super) emission: Spectrum,
    pub(super) coverage: f32,
    pub(super) glass: Spectrum,
}

impl Shown {
    /// Nothing beside its light.
    pub(super) const LIGHT: Self = Self { emission: Spectrum::BLACK, coverage: 1.0, glass: Spectrum::BLACK };
}

/// What the layers that are not light want of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Data {
    pub(super) albedo: Spectrum,
    pub(super) normal: Vec3,
    pub(super) position: Vec3,
    pub(super) depth: f32,
    pub(super) object: u32,
}

/// A transparent face at a sample.
#[derive(Clone, Copy, Debug)]
struct Fragment {
    pixel: u16,
    sample: u16,
    depth: f32,
    item: u32,
}

/// A tile being drawn.
pub(super) struct Drawing<'a> {
    pub(super) method: &'a ScanLine<'a>,
    pub(super) world: &'a World,
    triangles: Vec<&'a Triangle>,
    /// The first pixel.
    corner: (u32, u32),
    /// Pixels across and down that are in the picture.
    size: (u32, u32),
}

/// Draws tile `index` of a band into a film that may have been used for another.
pub(super) fn draw(
    method: &ScanLine<'_>,
    world: &World,
    grid: &Grid,
    bins: &Bins,
    index: usize,
    scratch: &mut Scratch<'_>,
    film: &mut Film,
) {
    let corner = grid.corner(index);
    let size = ((grid.width - corner.0).min(TILE), (grid.height - corner.1).min(TILE));
    if (film.width(), film.height()) != size {
        *film =
            Film::new(size.0, size.1, &method.sampling.layers).expect("a tile is smaller than the picture, which could be had");
    }
    let drawing = Drawing { method, world, triangles: bins.of_tile(grid, index), corner, size };
    scratch.facets.all.clear();
    scratch.facets.of_item.clear();
    scratch.facets.of_item.resize(drawing.triangles.len(), NOTHING);
    let n_pixels = (size.0 * size.1) as usize;
    let mut pixels = vec![Accumulator::new(); if method.samples.len() > 1 { n_pixels } else { 0 }];
    for samples in method.samples.chunks(MAX_SAMPLES as usize) {
        drawing.find_visible(samples, scratch);
        drawing.ask(samples, scratch);
        drawing.light(scratch);
        if method.is_plain() && scratch.fragments.is_empty() {
            return drawing.show(scratch, film);
        }
        drawing.composite(samples, scratch, &mut |x, y, pixel, at| {
            if pixels.is_empty() {
                film.set_pixel(x, y, pixel);
            } else {
                pixels[(y * size.0 + x) as usize].add(pixel, at);
            }
        });
    }
    for (i, mean) in pixels.iter().enumerate() {
        film.set_pixel(i as u32 % size.0, i as u32 / size.0, &mean.finish());
    }
}

impl Drawing<'_> {
    /// Fills one buffer for each sample, and the list of transparent fragments in front, by pixel, sample and depth.
    fn find_visible(&self, samples: &[FilterSample], scratch: &mut Scratch<'_>) {
        let Scratch { buffers, facets, covered, fragments, .. } = scratch;
        let path = self.world.cpu_path();
        if buffers.len() < samples.len() {
            buffers.resize_with(samples.len(), ItemBuffer::default);
        }
        let sampling = &self.method.sampling;
        let tile = |s: &FilterSample| {
            Tile::of_picture(self.corner.0, self.corner.1, sampling.width, sampling.height, s.offset.to_array())
        };
        let tiles: Vec<Tile> = samples.iter().map(tile).collect();
        buffers[..samples.len()].iter_mut().for_each(ItemBuffer::clear);
        fragments.clear();
        let mut any_transparent = false;
        for (item, triangle) in self.triangles.iter().enumerate() {
            if triangle.kind == Kind::Opaque as u8 {
                for (buffer, tile) in buffers.iter_mut().zip(&tiles) {
                    buffer.draw(path, triangle, tile, item as u32);
                }
            } else if triangle.kind == Kind::Masked as u8 {
                for ((buffer, tile), at) in buffers.iter_mut().zip(&tiles).zip(samples) {
                    covered.clear();
                    triangle.samples(path, tile, covered);
                    covered.retain(|s| s.depth > buffer.depth()[usize::from(s.index)]);
                    self.keep_what_is_there(item as u32, at, facets, covered);
                    covered.iter().for_each(|s| buffer.set(s.index, s.depth, item as u32));
                }
            } else {
                any_transparent = true;
            }
        }
        if !any_transparent {
            return;
        }
        let transparent = |t: &Triangle| t.kind == Kind::Transparent as u8;
        let mut room = MAX_LAYERS * (TILE * TILE) as usize;
        for (item, triangle) in self.triangles.iter().enumerate().filter(|(_, t)| transparent(t)) {
            for (n, (buffer, tile)) in buffers.iter().zip(&tiles).enumerate() {
                covered.clear();
                triangle.samples(path, tile, covered);
                covered.retain(|s| s.depth > buffer.depth()[usize::from(s.index)]);
                self.keep_what_is_there(item as u32, &samples[n], facets, covered);
                let in_front = covered.iter();
                fragments.extend(in_front.map(|s| Fragment {
                    pixel: s.index,
                    sample: n as u16,
                    depth: s.depth,
                    item: item as u32,
                }));
            }
            // A pile of transparent faces must not fill the memory: what is too far back is dropped now and then.
            if fragments.len() > room {
                keep_nearest(fragments);
                room = room.max(2 * fragments.len());
            }
        }
        keep_nearest(fragments);
    }

    /// Drops the samples that a mask cuts out of a face.
    fn keep_what_is_there(&self, item: u32, at: &FilterSample, facets: &mut Facets, covered: &mut Vec<Sample>) {
        if covered.is_empty() {
            return;
        }
        let facet = self.facet(facets, item);
        covered.retain(|s| {
            let (x, y) = place(u32::from(s.index), at);
            self.world.is_there(&facet.surface(self.world, facet.at(x, y), false))
        });
    }

    /// The face of an item, made when it is first needed.
    pub(super) fn facet<'f>(&self, facets: &'f mut Facets, item: u32) -> &'f Facet {
        let Facets { all, of_item } = facets;
        let number = &mut of_item[item as usize];
        if *number == NOTHING {
            *number = all.len() as u32;
            let s = &self.method.sampling;
            let middle = [0.5 * f64::from(s.width), 0.5 * f64::from(s.height)];
            let corner = [f64::from(self.corner.0) - middle[0], f64::from(self.corner.1) - middle[1]];
            let face = self.triangles[item as usize].face;
            all.push(Facet::new(self.world, &self.method.surfaces, &self.method.projection, face, corner));
        }
        &all[*number as usize]
    }

    /// Something shows through a face.
    pub(super) fn is_transparent(&self, item: u32) -> bool {
        self.triangles[item as usize].kind == Kind::Transparent as u8
    }

    /// Lists what must be lit: each face once for each pixel it is seen in, or for each sample where samples do not belong to one pixel.
    fn ask(&self, samples: &[FilterSample], scratch: &mut Scratch<'_>) {
        let Scratch { buffers, fragments, asked, chains, unsorted, moved, .. } = scratch;
        asked.clear(self.triangles.len());
        chains.clear();
        if let ([at], true) = (samples, fragments.is_empty()) {
            // The usual case, without a search: every pixel has one link.
            let rows = || (0..self.size.1).zip(buffers[0].items().chunks_exact(TILE as usize));
            for (_, row) in rows() {
                row[..self.size.0 as usize].iter().filter(|item| **item != NOTHING).for_each(|item| asked.count(*item));
            }
            asked.make_room();
            for (y, row) in rows() {
                chains.extend((0..self.size.0).zip(row).map(|(x, &item)| {
                    if item == NOTHING {
                        return BACKGROUND;
                    }
                    let (x, y) = place(y * TILE + x, at);
                    asked.put(Place { item, x, y })
                }));
            }
            return;
        }
        unsorted.clear();
        let together = self.method.is_multisampled() && samples.len() > 1;
        let mut rest = fragments.as_slice();
        for i in 0..TILE * TILE {
            let n = rest.iter().take_while(|f| u32::from(f.pixel) == i).count();
            let (here, behind) = rest.split_at(n);
            rest = behind;
            if i % TILE >= self.size.0 || i / TILE >= self.size.1 {
                continue;
            }
            let first = unsorted.len();
            let shows = |sample: usize, item: u32| {
                buffers[sample].items()[i as usize] == item
                    || here.iter().any(|f| usize::from(f.sample) == sample && f.item == item)
            };
            let mut link = |item: u32, sample: usize| -> u32 {
                if together && let Some(k) = unsorted[first..].iter().position(|a| a.item == item) {
                    return (first + k) as u32;
                }
                let (mut x, mut y) = place(i, &samples[sample]);
                if together {
                    // In the middle of its samples that show the face, so never outside of it.
                    let all = || (0..samples.len()).filter(|&s| shows(s, item)).map(|s| place(i, &samples[s]));
                    let n = all().count() as f32;
                    (x, y) = all().fold((0.0, 0.0), |sum, p| (sum.0 + p.0 / n, sum.1 + p.1 / n));
                }
                unsorted.push(Place { item, x, y });
                unsorted.len() as u32 - 1
            };
            for (s, buffer) in buffers[..samples.len()].iter().enumerate() {
                let mut n_layers = 0;
                for f in here.iter().filter(|f| usize::from(f.sample) == s) {
                    chains.push(link(f.item, s) | BEHIND);
                    n_layers += 1;
                }
                chains.push(match buffer.items()[i as usize] {
                    _ if n_layers == MAX_LAYERS => HIDDEN,
                    NOTHING => BACKGROUND,
                    item => link(item, s),
                });
            }
        }
        unsorted.iter().for_each(|place| asked.count(place.item));
        asked.make_room();
        moved.clear();
        moved.extend(unsorted.iter().map(|place| asked.put(*place)));
        for link in chains.iter_mut().filter(|link| **link < HIDDEN || **link >= BEHIND) {
            *link = moved[(*link & !BEHIND) as usize] | (*link & BEHIND);
        }
    }

    /// Hands over what each sample of each pixel sees.
    fn composite(
        &self,
        samples: &[FilterSample],
        scratch: &mut Scratch<'_>,
        out: &mut dyn FnMut(u32, u32, &Pixel, FilterSample),
    ) {
        let Scratch { shown, data, lit, mixed, chains, .. } = scratch;
        let light = if self.method.interpolation == Interpolation::Phong { lit.finish() } else { mixed };
        let mut links = chains.iter().copied();
        for y in 0..self.size.1 {
            for x in 0..self.size.0 {
                for at in samples {
                    let mut composite = Composite::default();
                    let mut is_first = true;
                    for link in links.by_ref() {
                        if link == BACKGROUND {
                            composite.background(self.background(x, y, at, is_first));
                        } else if link == HIDDEN {
                            composite.open = Spectrum::BLACK;
                        } else {
                            let i = (link & !BEHIND) as usize;
                            composite.add(&light.at(i), &shown[i], data.get(i));
                        }
                        is_first = false;
                        if link & BEHIND == 0 {
                            break;
                        }
                    }
                    out(x, y, &composite.finish(), *at);
                }
            }
        }
    }

    /// The picture alone, of one sample a pixel and nothing transparent: what [`Self::composite`] would make of it.
    fn show(&self, scratch: &mut Scratch<'_>, film: &mut Film) {
        let Scratch { shown, lit, mixed, chains, varying: Varying { tint: color, .. }, .. } = scratch;
        let light = if self.method.interpolation == Interpolation::Phong { lit.finish() } else { mixed };
        light.sum(color);
        for (i, shown) in shown.iter().enumerate().filter(|(_, shown)| !shown.emission.is_black()) {
            color.iter_mut().zip(shown.emission.to_array()).for_each(|(column, emission)| column[i] += emission);
        }
        film.fill(|k, values| {
            let seen = values.iter_mut().zip(chains.iter()).filter(|(_, link)| **link != BACKGROUND);
            match color.get(k) {
                Some(column) => seen.for_each(|(value, link)| *value = column[*link as usize]),
                None => seen.for_each(|(value, _)| *value = 1.0),
            }
        });
        let at = self.method.samples[0];
        for (i, _) in chains.iter().enumerate().filter(|(_, link)| **link == BACKGROUND) {
            let color = self.background(i as u32 % self.size.0, i as u32 / self.size.0, &at, true);
            film.fill(|k, values| values[i] = color.to_array().get(k).copied().unwrap_or(0.0));
        }
    }

    fn background(&self, x: u32, y: u32, at: &FilterSample, is_first: bool) -> Spectrum {
        let (dx, dy) = (0.5 + f64::from(at.offset.x), 0.5 + f64::from(at.offset.y));
        let dir = self.method.view.ray(f64::from(self.corner.0 + x) + dx, f64::from(self.corner.1 + y) + dy).dir;
        if self.method.has_backdrop { default_light::backdrop(dir) } else { self.world.background(dir, is_first) }
    }
}

/// Where a sample of a pixel lies, pixels from the corner of the tile.
fn place(index: u32, at: &FilterSample) -> (f32, f32) {
    ((index % TILE) as f32 + 0.5 + at.offset.x, (index / TILE) as f32 + 0.5 + at.offset.y)
}

/// Sorts by pixel, sample and depth, nearest first, and keeps [`MAX_LAYERS`] of each sample.
fn keep_nearest(fragments: &mut Vec<Fragment>) {
    let order = |f: &Fragment| (f.pixel, f.sample);
    fragments.sort_unstable_by(|a, b| order(a).cmp(&order(b)).then(b.depth.total_cmp(&a.depth)).then(a.item.cmp(&b.item)));
    let (mut last, mut n) = (None, 0);
    fragments.retain(|f| {
        n = if last == Some(order(f)) { n + 1 } else { 1 };
        last = Some(order(f));
        n <= MAX_LAYERS
    });
}

/// What lies along a sample's line of sight, from front to back: the sums of ray casting (`raytrace::ray_cast`).
struct Composite {
    pixel: Pixel,
    open: Spectrum,
    through_glass: bool,
}

impl Default for Composite {
    fn default() -> Self {
        Self { pixel: Pixel::default(), open: Spectrum::WHITE, through_glass: false }
    }
}

impl Composite {
    fn add(&mut self, light: &LocalLight, seen: &Shown, data: Option<&Data>) {
        let pixel = &mut self.pixel;
        if let (Some(data), None, true) = (data, pixel.object, seen.coverage > 0.0) {
            (pixel.albedo, pixel.normal, pixel.position) = (data.albedo, data.normal, data.position);
            (pixel.depth, pixel.object) = (data.depth, Some(data.object));
        }
        let weight = self.open * seen.coverage;
        let (ambient, diffuse, specular) = (weight * light.ambient, weight * light.diffuse, weight * light.specular);
        let emission = weight * seen.emission;
        if self.through_glass {
            pixel.refraction += ambient + diffuse + specular + emission;
            pixel.direct += diffuse + specular + emission;
        } else {
            pixel.ambient += ambient;
            pixel.diffuse += diffuse;
            pixel.specular += specular;
            pixel.emission += emission;
            pixel.direct += diffuse + specular;
        }
        pixel.indirect += ambient;
        pixel.color += ambient + diffuse + specular + emission;
        self.through_glass |= !seen.glass.is_black();
        self.open = self.open * (Spectrum::gray(1.0 - seen.coverage) + seen.glass * seen.coverage);
    }

    fn background(&mut self, behind: Spectrum) {
        let seen = self.open * behind;
        if self.through_glass {
            self.pixel.refraction += seen;
            self.pixel.direct += seen;
        } else {
            self.pixel.background += seen;
        }
        self.pixel.color += seen;
    }

    fn finish(mut self) -> Pixel {
        self.pixel.alpha = 1.0 - self.open.luminance().clamp(0.0, 1.0);
        self.pixel
    }
}
