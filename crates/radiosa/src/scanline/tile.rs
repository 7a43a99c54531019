//! One tile: what is seen at each sample, its light, and the pixels it makes.

use super::facet::Facet;
use super::surfaces::Kind;
use super::{Interpolation, MAX_LAYERS, MAX_SAMPLES, ScanLine};
use crate::film::{Accumulator, Film, FilterSample, Pixel};
use crate::math::Vec3;
use crate::raster::depth::NOTHING;
use crate::raster::{Bins, Grid, ItemBuffer, Sample, TILE, Tile, Triangle};
use crate::spectrum::Spectrum;
use crate::transport::{LocalLight, Shading, Surface, Textures, Unshadowed, Viewer, World, default_light};

/// What a thread keeps from tile to tile.
pub(super) struct Scratch<'a> {
    buffers: Vec<ItemBuffer>,
    facets: Vec<Option<Box<Facet>>>,
    covered: Vec<Sample>,
    fragments: Vec<Fragment>,
    /// What is to be lit, and what comes of it.
    asked: Vec<Asked>,
    shown: Vec<Shown>,
    data: Vec<Data>,
    lit: Unshadowed<'a>,
    /// Light interpolated over faces.
    mixed: Vec<LocalLight>,
    /// For each sample of each pixel, from front to back: indices into `asked`, [`BEHIND`] added where something lies behind; the last may be [`BACKGROUND`].
    chains: Vec<u32>,
}

impl<'a> Scratch<'a> {
    pub(super) fn new(method: &'a ScanLine<'_>, world: &'a World) -> Self {
        Self {
            buffers: Vec::new(),
            facets: Vec::new(),
            covered: Vec::new(),
            fragments: Vec::new(),
            asked: Vec::new(),
            shown: Vec::new(),
            data: Vec::new(),
            lit: Unshadowed::new(world, &method.lights),
            mixed: Vec::new(),
            chains: Vec::new(),
        }
    }
}

/// Something lies behind this link of a chain.
const BEHIND: u32 = 1 << 31;
/// The last link of a chain that leaves the scene.
const BACKGROUND: u32 = BEHIND - 1;

/// A face to be lit at a place, pixels from the corner of the tile.
#[derive(Clone, Copy, Debug)]
struct Asked {
    item: u32,
    x: f32,
    y: f32,
}

/// What a lit face shows beside its light.
#[derive(Clone, Copy, Debug)]
struct Shown {
    emission: Spectrum,
    coverage: f32,
    glass: Spectrum,
}

/// What the layers that are not light want of it.
#[derive(Clone, Copy, Debug)]
struct Data {
    albedo: Spectrum,
    normal: Vec3,
    position: Vec3,
    depth: f32,
    object: u32,
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
struct Drawing<'a> {
    method: &'a ScanLine<'a>,
    world: &'a World,
    triangles: Vec<&'a Triangle>,
    /// The first pixel.
    corner: (u32, u32),
    /// Pixels across and down that are in the picture.
    size: (u32, u32),
}

/// Draws tile `index` of a band.
pub(super) fn draw(
    method: &ScanLine<'_>,
    world: &World,
    grid: &Grid,
    bins: &Bins,
    index: usize,
    scratch: &mut Scratch<'_>,
) -> Film {
    let corner = grid.corner(index);
    let size = ((grid.width - corner.0).min(TILE), (grid.height - corner.1).min(TILE));
    let mut film =
        Film::new(size.0, size.1, &method.sampling.layers).expect("a tile is smaller than the picture, which could be had");
    let drawing = Drawing { method, world, triangles: bins.of_tile(grid, index).collect(), corner, size };
    scratch.facets.clear();
    scratch.facets.resize(drawing.triangles.len(), None);
    let n_pixels = (size.0 * size.1) as usize;
    let mut pixels = vec![Accumulator::new(); if method.samples.len() > 1 { n_pixels } else { 0 }];
    for samples in method.samples.chunks(MAX_SAMPLES as usize) {
        drawing.find_visible(samples, scratch);
        drawing.ask(samples, scratch);
        drawing.light(scratch);
        if method.is_plain() && scratch.fragments.is_empty() {
            drawing.show(scratch, &mut film);
            return film;
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
    film
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

    fn facet<'f>(&self, facets: &'f mut [Option<Box<Facet>>], item: u32) -> &'f mut Facet {
        facets[item as usize].get_or_insert_with(|| {
            let s = &self.method.sampling;
            let corner =
                [f64::from(self.corner.0) - 0.5 * f64::from(s.width), f64::from(self.corner.1) - 0.5 * f64::from(s.height)];
            let face = self.triangles[item as usize].face;
            Box::new(Facet::new(self.world, &self.method.surfaces, &self.method.projection, face, corner))
        })
    }

    /// Lists what must be lit: each face once for each pixel it is seen in, or for each sample where samples do not belong to one pixel.
    fn ask(&self, samples: &[FilterSample], scratch: &mut Scratch<'_>) {
        let Scratch { buffers, fragments, asked, chains, .. } = scratch;
        asked.clear();
        chains.clear();
        let together = self.method.is_multisampled() && samples.len() > 1;
        let mut rest = fragments.as_slice();
        for i in 0..TILE * TILE {
            let n = rest.iter().take_while(|f| u32::from(f.pixel) == i).count();
            let (here, behind) = rest.split_at(n);
            rest = behind;
            if i % TILE >= self.size.0 || i / TILE >= self.size.1 {
                continue;
            }
            let first = asked.len();
            let shows = |sample: usize, item: u32| {
                buffers[sample].items()[i as usize] == item
                    || here.iter().any(|f| usize::from(f.sample) == sample && f.item == item)
            };
            let mut link = |item: u32, sample: usize| -> u32 {
                if together && let Some(k) = asked[first..].iter().position(|a| a.item == item) {
                    return (first + k) as u32;
                }
                let (mut x, mut y) = place(i, &samples[sample]);
                if together {
                    // In the middle of its samples that show the face, so never outside of it.
                    let all = || (0..samples.len()).filter(|&s| shows(s, item)).map(|s| place(i, &samples[s]));
                    let n = all().count() as f32;
                    (x, y) = all().fold((0.0, 0.0), |sum, p| (sum.0 + p.0 / n, sum.1 + p.1 / n));
                }
                asked.push(Asked { item, x, y });
                asked.len() as u32 - 1
            };
            for (s, buffer) in buffers[..samples.len()].iter().enumerate() {
                for f in here.iter().filter(|f| usize::from(f.sample) == s) {
                    chains.push(link(f.item, s) | BEHIND);
                }
                chains.push(match buffer.items()[i as usize] {
                    NOTHING => BACKGROUND,
                    item => link(item, s),
                });
            }
        }
    }

    /// The light of everything on the list.
    fn light(&self, scratch: &mut Scratch<'_>) {
        scratch.lit.clear();
        scratch.shown.clear();
        scratch.data.clear();
        scratch.mixed.clear();
        let wants_data = self.method.wants_data();
        let (interpolation, world) = (self.method.interpolation, self.world);
        let Scratch { facets, asked, shown, data, lit, mixed, .. } = scratch;
        if interpolation != Interpolation::Phong {
            for a in asked.iter() {
                let facet = self.facet(facets, a.item);
                if facet.lit_as.is_none() {
                    facet.lit_as = Some(lit.n_points());
                    if interpolation == Interpolation::Flat {
                        self.push(lit, &facet.middle(world));
                    } else {
                        for corner in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] {
                            self.push(lit, &facet.surface(world, corner, false));
                        }
                    }
                }
            }
        }
        let corners = if interpolation == Interpolation::Phong { &[] } else { lit.finish() };
        let mut points = Vec::with_capacity(asked.len());
        for a in asked.iter() {
            let facet = self.facet(facets, a.item);
            let weights = facet.at(a.x, a.y);
            let mut surface = facet.surface(world, weights, interpolation == Interpolation::Flat);
            surface.width = self.width(&surface);
            if let Some(first) = facet.lit_as {
                let first = first as usize;
                let light =
                    if interpolation == Interpolation::Flat { corners[first] } else { mix(&corners[first..first + 3], weights) };
                let (diffuse, specular) = world.texture_of_light(&surface);
                mixed.push(LocalLight {
                    ambient: light.ambient * diffuse,
                    diffuse: light.diffuse * diffuse,
                    specular: light.specular * specular,
                });
            }
            points.push(surface);
        }
        for (surface, a) in points.iter().zip(asked.iter()) {
            let material = world.material_at(surface);
            let is_opaque = self.triangles[a.item as usize].kind != Kind::Transparent as u8;
            if interpolation != Interpolation::Phong && is_opaque && !wants_data && !material.unlit && !material.is_emissive() {
                shown.push(Shown { emission: Spectrum::BLACK, coverage: 1.0, glass: Spectrum::BLACK });
                continue;
            }
            let mut shading = self.shading(surface, Textures::Sampled);
            let glass = if is_opaque { Spectrum::BLACK } else { shading.straight_transmission() };
            if self.method.viewer == Viewer::Infinite {
                shading.wo = -self.method.projection.forward().as_vec3();
            }
            if interpolation == Interpolation::Phong {
                lit.push(surface, &shading);
            }
            shown.push(Shown {
                emission: shading.emission + shading.bsdf.unlit().unwrap_or(Spectrum::BLACK),
                coverage: shading.coverage,
                glass,
            });
            if wants_data {
                data.push(self.data(surface, &shading));
            }
        }
    }

    /// How wide a pixel is at a surface.
    fn width(&self, surface: &Surface) -> f32 {
        let projection = &self.method.projection;
        let from_eye = surface.p - projection.eye().as_vec3();
        let (distance, cos) = if projection.is_perspective() {
            let distance = from_eye.length();
            (distance, surface.ng.dot(from_eye) / distance)
        } else {
            (0.0, surface.ng.dot(projection.forward().as_vec3()))
        };
        self.method.footprint.width(distance, cos)
    }

    /// A surface as the eye sees it.
    fn shading(&self, surface: &Surface, textures: Textures) -> Shading {
        let projection = &self.method.projection;
        let forward = projection.forward().as_vec3();
        let to_eye = projection.eye().as_vec3() - surface.p;
        let wo = if projection.is_perspective() { to_eye.try_normalize().unwrap_or(-forward) } else { -forward };
        self.world.shading_with(surface, wo, textures)
    }

    /// Asks for the light at a vertex, before textures.
    fn push(&self, lit: &mut Unshadowed<'_>, surface: &Surface) {
        let mut shading = self.shading(surface, Textures::Ignored);
        if self.method.viewer == Viewer::Infinite {
            shading.wo = -self.method.projection.forward().as_vec3();
        }
        lit.push(surface, &shading);
    }

    fn data(&self, surface: &Surface, shading: &Shading) -> Data {
        let projection = &self.method.projection;
        let (position, normal, metres) = self.world.to_file(surface.p, shading.n);
        let from_eye = surface.p - projection.eye().as_vec3();
        let along = projection.forward().as_vec3();
        let travelled = if projection.is_perspective() { from_eye.length() } else { from_eye.dot(along) };
        Data { albedo: shading.bsdf.albedo(), normal, position, depth: travelled / metres, object: surface.instance.0 }
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
                        } else {
                            let i = (link & !BEHIND) as usize;
                            composite.add(&light[i], &shown[i], data.get(i));
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
        let Scratch { shown, lit, mixed, chains, .. } = scratch;
        let light = if self.method.interpolation == Interpolation::Phong { lit.finish() } else { mixed };
        let at = self.method.samples[0];
        for (i, &link) in chains.iter().enumerate() {
            let (x, y) = (i as u32 % self.size.0, i as u32 / self.size.0);
            let (color, alpha) = if link == BACKGROUND {
                (self.background(x, y, &at, true), 0.0)
            } else {
                let (light, shown) = (&light[link as usize], &shown[link as usize]);
                (light.ambient + light.diffuse + light.specular + shown.emission, 1.0)
            };
            film.set_color(i, color, alpha);
        }
    }

    fn background(&self, x: u32, y: u32, at: &FilterSample, is_first: bool) -> Spectrum {
        let (dx, dy) = (0.5 + f64::from(at.offset.x), 0.5 + f64::from(at.offset.y));
        let dir = self.method.view.ray(f64::from(self.corner.0 + x) + dx, f64::from(self.corner.1 + y) + dy).dir;
        if self.method.has_backdrop { default_light::backdrop(dir) } else { self.world.background(dir, is_first) }
    }
}

/// The light at three vertices, interpolated.
fn mix(corners: &[LocalLight], weights: [f32; 3]) -> LocalLight {
    let sum = |f: fn(&LocalLight) -> Spectrum| corners.iter().zip(weights).map(|(light, w)| f(light) * w).sum();
    LocalLight { ambient: sum(|l| l.ambient), diffuse: sum(|l| l.diffuse), specular: sum(|l| l.specular) }
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
