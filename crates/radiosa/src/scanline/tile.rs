//! One tile: what is seen at each sample, its light, and the pixels it makes.

use super::facet::Facet;
use super::surfaces::Kind;
use super::{Interpolation, MAX_LAYERS, MAX_SAMPLES, ScanLine};
use crate::film::{Accumulator, Film, FilterSample, Pixel};
use crate::math::Vec3;
use crate::raster::depth::NOTHING;
use crate::raster::{Bins, Grid, ItemBuffer, Sample, TILE, Tile, Triangle};
use crate::spectrum::Spectrum;
use crate::transport::{LocalLight, World, default_light};

/// What a thread keeps from tile to tile.
#[derive(Default)]
pub(super) struct Scratch {
    buffers: Vec<ItemBuffer>,
    facets: Vec<Option<Box<Facet>>>,
    covered: Vec<Sample>,
    fragments: Vec<Fragment>,
}

/// A transparent face at a sample.
#[derive(Clone, Copy, Debug)]
struct Fragment {
    pixel: u16,
    sample: u16,
    depth: f32,
    item: u32,
}

/// A face at a pixel, lit.
#[derive(Clone, Copy)]
struct Seen {
    item: u32,
    light: LocalLight,
    emission: Spectrum,
    coverage: f32,
    glass: Spectrum,
    albedo: Spectrum,
    normal: Vec3,
    position: Vec3,
    depth: f32,
    object: u32,
}

/// A tile being drawn.
struct Drawing<'a> {
    method: &'a ScanLine<'a>,
    world: &'a World,
    triangles: Vec<&'a Triangle>,
    /// The first pixel.
    corner: (u32, u32),
}

/// Draws tile `index` of a band.
pub(super) fn draw(method: &ScanLine<'_>, world: &World, grid: &Grid, bins: &Bins, index: usize, scratch: &mut Scratch) -> Film {
    let corner = grid.corner(index);
    let size = ((grid.width - corner.0).min(TILE), (grid.height - corner.1).min(TILE));
    let mut film =
        Film::new(size.0, size.1, &method.sampling.layers).expect("a tile is smaller than the picture, which could be had");
    let drawing = Drawing { method, world, triangles: bins.of_tile(grid, index).collect(), corner };
    scratch.facets.clear();
    scratch.facets.resize(drawing.triangles.len(), None);
    let n_pixels = (size.0 * size.1) as usize;
    let mut pixels = vec![Accumulator::new(); if method.samples.len() > 1 { n_pixels } else { 0 }];
    for samples in method.samples.chunks(MAX_SAMPLES as usize) {
        drawing.find_visible(samples, scratch);
        let mut fragments = scratch.fragments.iter().peekable();
        for i in 0..TILE * TILE {
            let (x, y) = (i % TILE, i / TILE);
            if x >= size.0 || y >= size.1 {
                while fragments.next_if(|f| u32::from(f.pixel) == i).is_some() {}
                continue;
            }
            let mut here = Vec::new();
            while let Some(f) = fragments.next_if(|f| u32::from(f.pixel) == i) {
                here.push(*f);
            }
            drawing.pixel(samples, i as usize, &here, &scratch.buffers, &mut scratch.facets, &mut |pixel, at| {
                if pixels.is_empty() {
                    film.set_pixel(x, y, pixel);
                } else {
                    pixels[(y * size.0 + x) as usize].add(pixel, at);
                }
            });
        }
    }
    for (i, mean) in pixels.iter().enumerate() {
        film.set_pixel(i as u32 % size.0, i as u32 / size.0, &mean.finish());
    }
    film
}

impl Drawing<'_> {
    /// Fills one buffer for each sample, and the list of transparent fragments in front, by pixel, sample and depth.
    fn find_visible(&self, samples: &[FilterSample], scratch: &mut Scratch) {
        let Scratch { buffers, facets, covered, fragments } = scratch;
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
            if fragments.len() > 8 * MAX_LAYERS * (TILE * TILE) as usize {
                keep_nearest(fragments);
            }
        }
        keep_nearest(fragments);
    }

    /// Drops the samples that a mask cuts out of a face.
    fn keep_what_is_there(&self, item: u32, at: &FilterSample, facets: &mut [Option<Box<Facet>>], covered: &mut Vec<Sample>) {
        if covered.is_empty() {
            return;
        }
        let facet = self.facet(facets, item);
        covered.retain(|s| {
            let (x, y) = place(u32::from(s.index), at);
            self.world.is_there(&facet.surface(self.world, facet.at(x, y), false))
        });
    }

    fn facet<'f>(&self, facets: &'f mut [Option<Box<Facet>>], item: u32) -> &'f Facet {
        facets[item as usize].get_or_insert_with(|| {
            let s = &self.method.sampling;
            let corner =
                [f64::from(self.corner.0) - 0.5 * f64::from(s.width), f64::from(self.corner.1) - 0.5 * f64::from(s.height)];
            let face = self.triangles[item as usize].face;
            Box::new(Facet::new(self.world, &self.method.surfaces, &self.method.projection, face, corner))
        })
    }

    /// Hands over what each sample of a pixel sees.
    fn pixel(
        &self,
        samples: &[FilterSample],
        index: usize,
        fragments: &[Fragment],
        buffers: &[ItemBuffer],
        facets: &mut [Option<Box<Facet>>],
        out: &mut dyn FnMut(&Pixel, FilterSample),
    ) {
        let mut lit: Vec<Seen> = Vec::new();
        let mut of = |item: u32, sample: usize, lit: &mut Vec<Seen>| -> Seen {
            let together = self.method.is_multisampled();
            if together && let Some(seen) = lit.iter().find(|s| s.item == item) {
                return *seen;
            }
            // Lit once for the pixel, in the middle of its samples that show the face, so never outside of it.
            let (mut x, mut y, mut n) = (0.0, 0.0, 0.0);
            for (i, at) in samples.iter().enumerate() {
                let shows = || {
                    buffers[i].items()[index] == item || fragments.iter().any(|f| usize::from(f.sample) == i && f.item == item)
                };
                if if together { shows() } else { i == sample } {
                    let p = place(index as u32, at);
                    (x, y, n) = (x + p.0, y + p.1, n + 1.0);
                }
            }
            let seen = self.light(self.facet(facets, item), item, x / n, y / n);
            lit.push(seen);
            seen
        };
        for (i, at) in samples.iter().enumerate() {
            let mut composite = Composite::default();
            for f in fragments.iter().filter(|f| usize::from(f.sample) == i) {
                composite.add(&of(f.item, i, &mut lit));
            }
            match buffers[i].items()[index] {
                NOTHING => {
                    let (x, y) = place(index as u32, at);
                    let (x, y) = (f64::from(self.corner.0) + f64::from(x), f64::from(self.corner.1) + f64::from(y));
                    let dir = self.method.view.ray(x, y).dir;
                    composite.background(if self.method.has_backdrop {
                        default_light::backdrop(dir)
                    } else {
                        self.world.background(dir, fragments.is_empty())
                    });
                }
                item => composite.add(&of(item, i, &mut lit)),
            }
            out(&composite.finish(), *at);
        }
    }

    /// The light of a face at a place of the tile.
    fn light(&self, facet: &Facet, item: u32, x: f32, y: f32) -> Seen {
        let world = self.world;
        let surface = facet.surface(world, facet.at(x, y), self.method.interpolation == Interpolation::Flat);
        let projection = &self.method.projection;
        let from_eye = surface.p.as_dvec3() - projection.eye();
        let wo = if projection.is_perspective() { -from_eye.normalize_or_zero() } else { -projection.forward() }.as_vec3();
        let mut shading = world.shading(&surface, wo);
        let glass = shading.straight_transmission();
        if self.method.viewer == crate::transport::Viewer::Infinite {
            shading.wo = self.method.to_viewer();
        }
        let light = self.method.lights.at(world, &surface, &shading, false, &mut 0);
        let (position, normal, metres) = world.to_file(surface.p, shading.n);
        let travelled = if projection.is_perspective() { from_eye.length() } else { from_eye.dot(projection.forward()) };
        Seen {
            item,
            light,
            emission: shading.emission + shading.bsdf.unlit().unwrap_or(Spectrum::BLACK),
            coverage: shading.coverage,
            glass,
            albedo: shading.bsdf.albedo(),
            normal,
            position,
            depth: travelled as f32 / metres,
            object: surface.instance.0,
        }
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
    fn add(&mut self, seen: &Seen) {
        let pixel = &mut self.pixel;
        if pixel.object.is_none() && seen.coverage > 0.0 {
            (pixel.albedo, pixel.normal, pixel.position) = (seen.albedo, seen.normal, seen.position);
            (pixel.depth, pixel.object) = (seen.depth, Some(seen.object));
        }
        let weight = self.open * seen.coverage;
        let (ambient, diffuse, specular) =
            (weight * seen.light.ambient, weight * seen.light.diffuse, weight * seen.light.specular);
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
