//! The light of what is seen in a tile, face by face, each at all its places.
//!
//! Where nothing but the base colour varies over a face ([`Look`](super::look::Look)), its points, textures and light are computed in lanes; all else point by point.

use std::iter::repeat_n;

use super::Interpolation;
use super::facet::{Eye, Facet};
use super::look::Look;
use super::tile::{Asked, Data, Drawing, Facets, Scratch, Shown, Varying};
use crate::bsdf::texture::Bilinear;
use crate::math::lanes::{Columns, Cpu, LANES, Lanes, eight, eight_mut, for_each_cpu, load3};
use crate::math::{CpuPath, Vec3};
use crate::scene::TextureRef;
use crate::spectrum::Spectrum;
use crate::transport::footprint;
use crate::transport::{LightColumns, LocalLight, Shading, Surface, Textures, Tinted, Unshadowed, Viewer};

impl Drawing<'_> {
    /// The light of everything on the list.
    pub(super) fn light(&self, scratch: &mut Scratch<'_>) {
        let Scratch { facets, asked, shown, data, lit, mixed, varying, .. } = scratch;
        lit.clear();
        shown.clear();
        data.clear();
        let n = asked.items.len();
        varying.resize(n);
        if self.method.interpolation == Interpolation::Phong {
            self.light_pixels(facets, asked, varying, (shown, data), lit);
        } else {
            mixed.reserve(n);
            self.light_vertices(facets, asked, lit);
            self.interpolate(facets, asked, varying, (shown, data), (lit.finish(), mixed));
        }
    }

    /// Phong: every place by itself.
    fn light_pixels(
        &self,
        facets: &mut Facets,
        asked: &Asked,
        varying: &mut Varying,
        (shown, data): (&mut Vec<Shown>, &mut Vec<Data>),
        lit: &mut Unshadowed<'_>,
    ) {
        let (path, wants_data) = (self.world.cpu_path(), self.method.wants_data());
        let mut alike = Alike::default();
        for (item, range) in asked.faces() {
            let facet = self.facet(facets, item);
            facet.weights(path, &asked.x, &asked.y, range, &mut varying.weights);
            let look = self.method.look(facet.material);
            match &look.tinted {
                Some(tinted) if !look.is_odd && !wants_data => {
                    let is_tinted = self.tint(facet, look.base.as_ref(), true, range, varying);
                    let weights = (&varying.weights, range);
                    alike.add(facet, (path, &self.method.eye), weights, (tinted, is_tinted), (lit, &varying.tint));
                    shown.extend(repeat_n(Shown::LIGHT, range[1] - range[0]));
                }
                _ => {
                    alike.push(lit, &varying.tint);
                    for i in range[0]..range[1] {
                        let surface = self.surface(facet, at(&varying.weights, i));
                        let shading = self.note(&surface, item, shown, data);
                        lit.push(&surface, &shading);
                    }
                }
            }
        }
        alike.push(lit, &varying.tint);
    }

    /// Flat and Gouraud: the middle or the vertices of every face, before textures.
    fn light_vertices(&self, facets: &mut Facets, asked: &Asked, lit: &mut Unshadowed<'_>) {
        const CORNERS: [[f32; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let corners = CORNERS.map(|weights| [&weights[..], &[0.0; LANES]].concat());
        let (no_tint, mut alike) = (Columns::default(), Alike::default());
        for (item, _) in asked.faces() {
            let facet = self.facet(facets, item);
            let look = self.method.look(facet.material);
            let constant = (facet.colors(self.world).is_none() && look.is_even_at_vertices).then_some(look);
            if self.method.interpolation == Interpolation::Flat {
                self.light_vertex(&facet.middle(self.world), constant, lit);
            } else if let Some(Look { tinted: Some(tinted), .. }) = constant {
                let eye = (self.world.cpu_path(), &self.method.eye);
                alike.add(facet, eye, (&corners, [0, 3]), (tinted, false), (lit, &no_tint));
            } else {
                alike.push(lit, &no_tint);
                for corner in CORNERS {
                    self.light_vertex(&facet.surface(self.world, corner, false), constant, lit);
                }
            }
        }
        alike.push(lit, &no_tint);
    }

    fn light_vertex(&self, surface: &Surface, look: Option<&Look>, lit: &mut Unshadowed<'_>) {
        let wo = self.to_viewer(surface);
        let mut shading = match look {
            Some(look) => {
                let n = if surface.is_front(wo) { surface.n } else { -surface.n };
                Shading { n, wo, bsdf: look.bsdf, emission: Spectrum::BLACK, coverage: 1.0 }
            }
            None => self.world.shading_with(surface, wo, Textures::LaidOver),
        };
        self.look_from_afar(&mut shading);
        lit.push(surface, &shading);
    }

    /// Lays textures over the light of [`Self::light_vertices`], interpolated.
    fn interpolate(
        &self,
        facets: &mut Facets,
        asked: &Asked,
        varying: &mut Varying,
        (shown, data): (&mut Vec<Shown>, &mut Vec<Data>),
        (corners, mixed): (&LightColumns, &mut LightColumns),
    ) {
        let path = self.world.cpu_path();
        let is_flat = self.method.interpolation == Interpolation::Flat;
        for (number, (item, range)) in asked.faces().enumerate() {
            let facet = self.facet(facets, item);
            facet.weights(path, &asked.x, &asked.y, range, &mut varying.weights);
            let look = self.method.look(facet.material);
            let corners = if is_flat { [corners.at(number); 3] } else { [0, 1, 2].map(|i| corners.at(3 * number + i)) };
            // Vertex colours change how much of a highlight is a metal's.
            let share = look.tints_highlights.filter(|share| share.is_black() || facet.colors(self.world).is_none());
            let base = look.base.as_ref().filter(|_| share.is_some());
            let is_tinted = self.tint(facet, base, false, range, varying);
            let laid = share.filter(|_| is_tinted).map(|share| (&varying.tint, share));
            lay(path, &corners, is_flat, &varying.weights, laid, range, mixed);
            if share.is_none() {
                for i in range[0]..range[1] {
                    let [a, d, s] = self.world.textures_of_light(&self.surface(facet, at(&varying.weights, i)));
                    let LocalLight { ambient, diffuse, specular } = mixed.at(i);
                    mixed.set(i, &LocalLight { ambient: ambient * a, diffuse: diffuse * d, specular: specular * s });
                }
            }
            if look.only_reflects && !self.method.wants_data() {
                shown.extend(repeat_n(Shown::LIGHT, range[1] - range[0]));
            } else {
                for i in range[0]..range[1] {
                    self.note(&self.surface(facet, at(&varying.weights, i)), item, shown, data);
                }
            }
        }
    }

    /// What the base colour is multiplied by at some places of a face: a texture, and the vertex colours if they are wanted. False where that is nothing.
    fn tint(&self, facet: &Facet, map: Option<&TextureRef>, with_colors: bool, range: [usize; 2], varying: &mut Varying) -> bool {
        let (world, path, [first, end]) = (self.world, self.world.cpu_path(), range);
        let Varying { weights, tint, copy, level } = varying;
        let colors = if with_colors { facet.colors(world) } else { None };
        if let Some(map) = map {
            let texture = &world.scene().textures[map.texture.index()];
            let picture = Bilinear::new(world.scene(), texture).zip(facet.uv(world, map));
            match (picture, world.pyramid(map.texture)) {
                (Some((picture, uv)), None) => picture.sample(path, &uv, weights, range, tint),
                (Some((picture, uv)), Some(pyramid)) => {
                    let density = world.texels_per_metre(&self.surface(facet, at(weights, first)), map);
                    for (i, level) in (first..end).zip(&mut level[first..end]) {
                        *level = footprint::level(self.surface(facet, at(weights, i)).width, density);
                    }
                    picture.sample_levels(path, (texture, pyramid), (&uv, weights), (level, range), (copy, tint));
                }
                _ => {
                    for i in first..end {
                        let color = world.texture_color(&self.surface(facet, at(weights, i)), map).to_array();
                        tint.iter_mut().zip(color).for_each(|(column, c)| column[i] = c);
                    }
                }
            }
        } else if colors.is_some() {
            tint.iter_mut().for_each(|column| column[first..end].fill(1.0));
        }
        if let Some([a, b, c]) = colors {
            for i in first..end {
                let [u, v, w] = at(weights, i);
                let color = (a * u + b * v + c * w).to_array();
                tint.iter_mut().zip(color).for_each(|(column, c)| column[i] *= c);
            }
        }
        map.is_some() || colors.is_some()
    }

    /// Notes what a point shows beside its light.
    fn note(&self, surface: &Surface, item: u32, shown: &mut Vec<Shown>, data: &mut Vec<Data>) -> Shading {
        let mut shading = self.world.shading(surface, self.to_viewer(surface));
        let glass = if self.is_transparent(item) { shading.straight_transmission() } else { Spectrum::BLACK };
        self.look_from_afar(&mut shading);
        let emission = shading.shown();
        shown.push(Shown { emission, coverage: shading.coverage, glass });
        if self.method.wants_data() {
            data.push(self.data(surface, &shading));
        }
        shading
    }

    /// The point of a face with those weights, and how wide a pixel is there.
    fn surface(&self, facet: &Facet, weights: [f32; 3]) -> Surface {
        let mut surface = facet.surface(self.world, weights, self.method.interpolation == Interpolation::Flat);
        let projection = &self.method.projection;
        let from_eye = surface.p - projection.eye().as_vec3();
        let (distance, cos) = if projection.is_perspective() {
            let distance = from_eye.length();
            (distance, surface.ng.dot(from_eye) / distance)
        } else {
            (0.0, surface.ng.dot(projection.forward().as_vec3()))
        };
        surface.width = self.method.footprint.width(distance, cos);
        surface
    }

    /// Unit, from a point to the eye.
    fn to_viewer(&self, surface: &Surface) -> Vec3 {
        let projection = &self.method.projection;
        let forward = projection.forward().as_vec3();
        let to_eye = projection.eye().as_vec3() - surface.p;
        if projection.is_perspective() { to_eye.try_normalize().unwrap_or(-forward) } else { -forward }
    }

    /// Has highlights seen from infinitely far away where they should be.
    fn look_from_afar(&self, shading: &mut Shading) {
        if self.method.viewer == Viewer::Infinite {
            shading.wo = -self.method.projection.forward().as_vec3();
        }
    }

    fn data(&self, surface: &Surface, shading: &Shading) -> Data {
        let projection = &self.method.projection;
        let (position, normal, metres) = self.world.to_file(surface.p, shading.n);
        let from_eye = surface.p - projection.eye().as_vec3();
        let along = projection.forward().as_vec3();
        let travelled = if projection.is_perspective() { from_eye.length() } else { from_eye.dot(along) };
        Data { albedo: shading.bsdf.albedo(), normal, position, depth: travelled / metres, object: surface.instance.0 }
    }
}

/// Points of neighbouring faces that reflect alike, but for a tint, before they are added to those that wait for light.
#[derive(Default)]
struct Alike<'a> {
    reflection: Option<(&'a Tinted, bool)>,
    n: usize,
}

impl<'a> Alike<'a> {
    /// Adds points of a face, given by their weights.
    fn add(
        &mut self,
        facet: &Facet,
        (path, eye): (CpuPath, &Eye),
        (weights, range): (&Columns, [usize; 2]),
        reflection: (&'a Tinted, bool),
        (lit, tint): (&mut Unshadowed<'_>, &Columns),
    ) {
        if !self.reflection.is_some_and(|own| std::ptr::eq(own.0, reflection.0) && own.1 == reflection.1) {
            self.push(lit, tint);
            self.reflection = Some(reflection);
        }
        let first = lit.n_points() + self.n;
        self.n += range[1] - range[0];
        facet.points(path, eye, weights, range, first, lit.room(self.n));
    }

    fn push(&mut self, lit: &mut Unshadowed<'_>, tint: &Columns) {
        if let Some((tinted, is_tinted)) = self.reflection.take() {
            lit.push_tinted(std::mem::take(&mut self.n), tinted, is_tinted.then_some(tint));
        }
    }
}

/// Row `i`.
fn at(columns: &Columns, i: usize) -> [f32; 3] {
    [columns[0][i], columns[1][i], columns[2][i]]
}

for_each_cpu! {
    /// The light at three vertices interpolated, or that of the first everywhere; the texture of the base colour laid over it, and over highlights as far as said.
    fn lay(
        corners: &[LocalLight; 3],
        is_flat: bool,
        weights: &Columns,
        tint: Option<(&Columns, Spectrum)>,
        range: [usize; 2],
        out: &mut LightColumns,
    ) = lay_on;
}

#[inline(always)]
fn lay_on<C: Cpu>(
    corners: &[LocalLight; 3],
    is_flat: bool,
    weights: &Columns,
    tint: Option<(&Columns, Spectrum)>,
    [mut i, end]: [usize; 2],
    out: &mut LightColumns,
) {
    type L<C> = <C as Cpu>::Wide;
    let lobes = corners.map(|l| [l.ambient.to_array(), l.diffuse.to_array(), l.specular.to_array()]);
    let one = L::<C>::splat(1.0);
    while i < end {
        let w = load3::<L<C>>(weights, i);
        let mut k = 0;
        while k < 3 {
            let mut light = [one; 3];
            let mut lobe = 0;
            while lobe < 3 {
                let [a, b, c] = [lobes[0][lobe][k], lobes[1][lobe][k], lobes[2][lobe][k]];
                let [a, b, c] = [L::<C>::splat(a), L::<C>::splat(b), L::<C>::splat(c)];
                light[lobe] = if is_flat { a } else { a.mul(w[0]).add(b.mul(w[1])).add(c.mul(w[2])) };
                lobe += 1;
            }
            if let Some((tint, share)) = tint {
                let (tint, share) = (L::<C>::load(eight(&tint[k], i)), L::<C>::splat(share.to_array()[k]));
                light[0] = light[0].mul(tint);
                light[1] = light[1].mul(tint);
                light[2] = light[2].mul(one.sub(share).add(tint.mul(share)));
            }
            *eight_mut(&mut out.ambient[k], i) = light[0].store();
            *eight_mut(&mut out.diffuse[k], i) = light[1].store();
            *eight_mut(&mut out.specular[k], i) = light[2].store();
            k += 1;
        }
        i += LANES;
    }
}
