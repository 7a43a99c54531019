//! A surface seen from somewhere: normals on the viewer's side, textures looked up, the reflection function resolved.

use super::media::{self, Loss, Media, Medium};
use super::{Surface, World};
use crate::accel::Hit;
use crate::bsdf::fresnel::Weighing;
use crate::bsdf::texture;
use crate::bsdf::{Bsdf, Lookup};
use crate::math::{Frame, Ray, Vec2, Vec3, Vec4};
use crate::scene::{
    AlphaMode, ColorMap, CookTorrance, Geometry, InstanceId, Model, NormalMap, Phong, ScalarMap, TextureId, TextureRef,
    TextureSource,
};
use crate::spectrum::Spectrum;

/// Height of white over black in a height map, in sides of the picture, at scale 1.
const BUMP_HEIGHT: f32 = 0.02;

/// Transparent surfaces that are collected by one query and put in order.
const COLLECTED: usize = 8;

/// Faces of one object this near to each other on a ray, in parts of the distance, meet in an edge.
const SAME_SURFACE: f32 = 1e-5;

/// Transparent surfaces a segment passes at most; a pile of this many counts as opaque, as it does to the eye.
const MAX_LAYERS: u32 = super::eye::BEHIND_MAX;

/// What a method needs to know of a hit to light it.
#[derive(Clone, Debug)]
pub struct Shading {
    /// Unit shading normal on the viewer's side, after normal maps.
    pub n: Vec3,
    /// Unit, to the viewer.
    pub wo: Vec3,
    /// How it reflects.
    pub bsdf: Bsdf,
    /// Radiance emitted towards the viewer.
    pub emission: Spectrum,
    /// Fraction of the surface that is there (blended alpha).
    pub coverage: f32,
}

impl Shading {
    /// A white diffuse surface seen head-on: its radiance times π is the irradiance.
    pub fn white(n: Vec3) -> Self {
        Self { n, wo: n, bsdf: Bsdf::lambert(Spectrum::WHITE), emission: Spectrum::BLACK, coverage: 1.0 }
    }

    /// What it shows whatever lights it: emission, and the colour of what is unlit.
    pub(crate) fn shown(&self) -> Spectrum {
        self.emission + self.bsdf.unlit().unwrap_or(Spectrum::BLACK)
    }

    /// What passes straight through, seen from `wo` in vacuum ([`Bsdf::straight_transmission`]).
    pub fn straight_transmission(&self) -> Spectrum {
        self.bsdf.straight_transmission(self.n, self.wo, 1.0)
    }
}

/// What shadow rays do at transparent things.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Glass {
    /// Transparent things cast shadows like opaque ones; holes of masks and of coverage stay holes.
    Opaque,
    /// Light passes clear sheets, which do not bend it, as the materials say; bodies and rough sheets cast full shadows.
    Sheets,
    /// Light passes straight, filtered by the surfaces, whose constants are weighed so, and by the bodies.
    Clear(Weighing),
}

/// How a shadow ray passes what is transparent.
#[derive(Clone, Copy, Debug)]
pub struct Passage<'a> {
    pub(crate) glass: Glass,
    /// The bodies it starts in.
    pub(crate) media: &'a Media,
    /// What takes light away between surfaces.
    pub(crate) loss: Loss,
}

impl Passage<'static> {
    /// Straight, from vacuum, as the materials say.
    pub const STRAIGHT: Self = Self { glass: Glass::Clear(Weighing::Material), media: &Media::VACUUM, loss: Loss::Absorption };
}

impl Passage<'_> {
    /// What is left of the light on a segment that meets nothing.
    fn left(&self, world: &World, segment: &Ray) -> Spectrum {
        let body = self.media.current();
        if body.is_none() && (self.loss == Loss::Absorption || world.scene().medium.is_none()) {
            return Spectrum::WHITE;
        }
        media::left(world, body, self.loss, segment.dir.length() * segment.t_max)
    }
}

/// Light on its way along a segment, straight through what is transparent.
struct Filtered<'a> {
    passage: Passage<'a>,
    /// Unit, back along the segment.
    wo: Vec3,
    /// The bodies it is in.
    media: Media,
    passed: Spectrum,
}

impl<'a> Filtered<'a> {
    fn new(segment: &Ray, passage: Passage<'a>) -> Self {
        Self { passage, wo: -segment.dir.normalize(), media: *passage.media, passed: Spectrum::WHITE }
    }

    /// Passes a surface, `distance` metres from the last one.
    fn meet(&mut self, world: &World, surface: &Surface, distance: f32) {
        let shading = world.shading(surface, self.wo);
        let entering = surface.is_front(self.wo);
        let (mut through, mut surroundings) = (self.media.current().copied(), Some(self.media.ior()));
        let body = shading.bsdf.transmission().filter(|t| !t.thin);
        if self.passage.glass != Glass::Opaque
            && let Some(t) = body
        {
            let boundary = self.media.pass(Medium::of(surface, &t), entering);
            (through, surroundings) = (boundary.began_in.or(through), boundary.surroundings);
        }
        let glass = match (self.passage.glass, surroundings) {
            (Glass::Opaque, _) => Spectrum::BLACK,
            // Hidden in a body of higher priority: there is no surface here.
            (_, None) => Spectrum::WHITE,
            (Glass::Sheets, Some(ior)) if body.is_some() || shading.bsdf.boundary().is_some() => {
                shading.bsdf.within(ior).unbent().unwrap_or(Spectrum::BLACK)
            }
            (Glass::Sheets, Some(ior)) => shading.bsdf.straight_transmission(shading.n, self.wo, ior),
            (Glass::Clear(by), Some(ior)) => shading.bsdf.weighed(by).straight_transmission(shading.n, self.wo, ior),
        };
        let open = Spectrum::gray(1.0 - shading.coverage) + glass * shading.coverage;
        self.passed = self.passed * media::left(world, through.as_ref(), self.passage.loss, distance) * open;
    }

    /// What is left after the last `distance` metres.
    fn end(self, world: &World, distance: f32) -> Spectrum {
        self.passed * media::left(world, self.media.current(), self.passage.loss, distance)
    }
}

/// The maps of a material, read at one point.
struct At<'a> {
    world: &'a World,
    surface: &'a Surface,
    vertex_color: Vec4,
    textures: Textures,
}

/// Whether textures are looked up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Textures {
    /// As the material has them.
    Sampled,
    /// But those of the colours that [`World::textures_of_light`] gives, and normal maps: light at vertices, before textures are laid over it.
    LaidOver,
}

impl At<'_> {
    fn texel(&self, map: &TextureRef) -> [f32; 4] {
        self.world.texel(self.surface, map)
    }
}

impl Lookup for At<'_> {
    fn color(&self, map: &ColorMap) -> Spectrum {
        let is_read =
            |_: &&TextureRef| self.textures == Textures::Sampled || !self.world.material_at(self.surface).model.is_laid_over(map);
        map.texture.as_ref().filter(is_read).map_or(map.factor, |t| {
            let [r, g, b, _] = self.texel(t);
            map.factor * Spectrum::new(r, g, b)
        })
    }

    fn scalar(&self, map: &ScalarMap) -> f32 {
        map.texture.as_ref().map_or(map.factor, |t| map.factor * self.texel(t)[usize::from(map.channel & 3)])
    }

    fn vertex_color(&self) -> Spectrum {
        Spectrum::new(self.vertex_color.x, self.vertex_color.y, self.vertex_color.z)
    }
}

impl World {
    /// Everything about a surface seen along `wo` (unit, to the viewer).
    pub fn shading(&self, surface: &Surface, wo: Vec3) -> Shading {
        self.shading_with(surface, wo, Textures::Sampled)
    }

    /// The same, with textures or without.
    pub fn shading_with(&self, surface: &Surface, wo: Vec3, textures: Textures) -> Shading {
        let material = self.material_at(surface);
        let at = At { world: self, surface, vertex_color: surface.vertex_color(self), textures };
        let front = surface.is_front(wo);
        let mut n = surface.n;
        if let Some(map) = material.normal_map.as_ref().filter(|_| textures == Textures::Sampled) {
            n = self.mapped_normal(surface, map, n);
        }
        if !front {
            n = -n;
        }
        let emission = if front || material.two_sided { at.color(&material.emission) } else { Spectrum::BLACK };
        // What a mask cuts away was never hit.
        let coverage = if material.alpha.mode == AlphaMode::Blend { self.opacity(surface) } else { 1.0 };
        Shading { n, wo, bsdf: Bsdf::resolve(material, &at), emission, coverage }
    }

    /// The textures that are laid over the ambient, diffuse and specular part of light that was computed with [`Textures::LaidOver`].
    pub fn textures_of_light(&self, surface: &Surface) -> [Spectrum; 3] {
        let of = |map: &ColorMap| map.texture.as_ref().map_or(Spectrum::WHITE, |t| self.texture_color(surface, t));
        let model = &self.material_at(surface).model;
        let base = of(model.base_color());
        match model {
            Model::Phong(Phong { ambient, specular, .. }) | Model::CookTorrance(CookTorrance { ambient, specular, .. }) => {
                [ambient.as_ref().map_or(base, of), base, of(specular)]
            }
            Model::MetallicRoughness(_) => {
                let vertex_color = surface.vertex_color(self);
                let at = At { world: self, surface, vertex_color, textures: Textures::LaidOver };
                let share = Bsdf::resolve(self.material_at(surface), &at).share_of_metal();
                [base, base, Spectrum::WHITE + share * (base - Spectrum::WHITE)]
            }
        }
    }

    /// The colour of a texture at a surface.
    pub(crate) fn texture_color(&self, surface: &Surface, map: &TextureRef) -> Spectrum {
        let [r, g, b, _] = self.texel(surface, map);
        Spectrum::new(r, g, b)
    }

    /// The nearest surface on a ray that a mask does not cut away.
    pub fn closest_visible(&self, ray: &Ray) -> Option<(Hit, Surface)> {
        let hit = if self.has_masks() {
            self.accel().closest_where(ray, &mut |hit| self.is_there(&self.surface(ray, hit)))?
        } else {
            self.accel().closest(ray)?
        };
        Some((hit, self.surface(ray, &hit)))
    }

    /// What a ray meets one after the other, as far as it goes straight on through what is transparent; the last is opaque, unless the ray leaves the scene.
    pub(crate) fn each_met(&self, ray: &Ray, mut meet: impl FnMut(&Hit, &Surface)) -> bool {
        const MAX_LAYERS: usize = 64;
        let mut ray = *ray;
        for _ in 0..MAX_LAYERS {
            let Some((hit, surface)) = self.closest_visible(&ray) else { return true };
            meet(&hit, &surface);
            if !self.may_be_transparent(surface.material) {
                return false;
            }
            ray = surface.ray(ray.dir);
        }
        false
    }

    /// The fractions of light that pass along the first `n` segments, straight through holes and what is transparent. White for the rest.
    pub fn transmittances(&self, segments: &[Ray; 8], n: usize, passage: Passage<'_>, n_rays: &mut u64) -> [Spectrum; 8] {
        if n <= Self::FEW_SEGMENTS {
            let mut one = |segment| self.transmittance(segment, passage, n_rays);
            return std::array::from_fn(|i| if i < n { one(&segments[i]) } else { Spectrum::WHITE });
        }
        *n_rays += n as u64;
        let blocked = self.accel().occluded8(segments, ((1u32 << n) - 1) as u8);
        std::array::from_fn(|i| match blocked >> i & 1 == 1 {
            true if self.has_transparency() => self.transmittance(&segments[i], passage, n_rays),
            true => Spectrum::BLACK,
            false => passage.left(self, &segments[i]),
        })
    }

    /// Fewer shadow rays than this and one are sooner traced one by one: no packet is made of them.
    pub(super) const FEW_SEGMENTS: usize = 3;

    /// The fraction of light that passes along a segment, as in [`Self::transmittances`].
    pub(crate) fn transmittance(&self, segment: &Ray, passage: Passage<'_>, n_rays: &mut u64) -> Spectrum {
        *n_rays += 1;
        if !self.has_transparency() {
            return if self.accel().occluded(segment) { Spectrum::BLACK } else { passage.left(self, segment) };
        }
        // What is opaque decides without order; only when nothing is, the rest is put in order.
        let mut hits = [Hit { t: f32::INFINITY, instance: 0, primitive: 0, u: 0.0, v: 0.0 }; COLLECTED];
        let mut n = 0;
        let is_opaque = &mut |hit: &Hit| {
            if !self.may_be_transparent(self.scene().material_of(InstanceId(hit.instance), hit.primitive)) {
                return true;
            }
            if let Some(slot) = hits.get_mut(n) {
                *slot = *hit;
            }
            n += 1;
            false
        };
        if self.accel().occluded_where(segment, is_opaque) {
            Spectrum::BLACK
        } else if n == 0 {
            passage.left(self, segment)
        } else if let Some(hits) = hits.get_mut(..n) {
            hits.sort_unstable_by(|a, b| {
                a.t.total_cmp(&b.t).then(a.instance.cmp(&b.instance)).then(a.primitive.cmp(&b.primitive))
            });
            self.transmittance_of(segment, hits, passage)
        } else {
            self.transmittance_step_by_step(segment, passage, n_rays)
        }
    }

    /// The fraction for a segment that meets these transparent surfaces only, in order.
    fn transmittance_of(&self, segment: &Ray, hits: &[Hit], passage: Passage<'_>) -> Spectrum {
        let mut light = Filtered::new(segment, passage);
        let unit = segment.dir.length();
        let mut begin = 0.0;
        let mut last: Option<(u32, bool)> = None;
        for hit in hits {
            let surface = self.surface(segment, hit);
            if self.has_masks() && !self.is_there(&surface) {
                continue;
            }
            // Two faces that meet in an edge on the segment are one surface.
            let side = (hit.instance, surface.is_front(light.wo));
            if last == Some(side) && hit.t - begin <= SAME_SURFACE * hit.t {
                continue;
            }
            light.meet(self, &surface, unit * (hit.t - begin));
            if light.passed.is_black() {
                return light.passed;
            }
            (last, begin) = (Some(side), hit.t);
        }
        light.end(self, unit * (segment.t_max - begin))
    }

    /// The same from one surface to the next, however many they are.
    fn transmittance_step_by_step(&self, segment: &Ray, passage: Passage<'_>, n_rays: &mut u64) -> Spectrum {
        let mut light = Filtered::new(segment, passage);
        let end = segment.at(segment.t_max);
        let mut ray = *segment;
        for _ in 0..MAX_LAYERS {
            *n_rays += 1;
            let unit = ray.dir.length();
            let Some((hit, surface)) = self.closest_visible(&ray) else { return light.end(self, unit * ray.t_max) };
            light.meet(self, &surface, unit * hit.t);
            if light.passed.is_black() {
                return light.passed;
            }
            // The segment's end stays where it was, though the start moves.
            ray = if segment.t_max.is_finite() {
                let onward = surface.segment_to(end);
                if onward.dir.dot(segment.dir) <= 0.0 {
                    return light.passed;
                }
                onward
            } else {
                surface.ray(segment.dir)
            };
        }
        Spectrum::BLACK
    }

    /// What a ray that leaves the scene meets: the environment if it may be seen, else the background.
    pub fn background(&self, dir: Vec3, from_camera: bool) -> Spectrum {
        match self.sky() {
            Some(sky) if !from_camera || self.scene().environment.as_ref().is_some_and(|e| e.visible) => sky.radiance(dir),
            _ => self.scene().background,
        }
    }

    /// False where a mask cuts a surface away.
    pub(crate) fn is_there(&self, surface: &Surface) -> bool {
        !matches!(self.material_at(surface).alpha.mode, AlphaMode::Mask { .. }) || self.opacity(surface) > 0.0
    }

    /// How much of the surface is there: a mask gives 0 or 1.
    pub(crate) fn opacity(&self, surface: &Surface) -> f32 {
        let alpha = &self.material_at(surface).alpha;
        let value = || {
            let at = At { world: self, surface, vertex_color: surface.vertex_color(self), textures: Textures::Sampled };
            at.scalar(&alpha.value) * at.vertex_color.w
        };
        match alpha.mode {
            AlphaMode::Opaque => 1.0,
            AlphaMode::Mask { cutoff } => f32::from(u8::from(value() >= cutoff)),
            AlphaMode::Blend => value().clamp(0.0, 1.0),
        }
    }

    /// The emitted radiance at a point of the surface, on the side that emits.
    pub(crate) fn emission_at(&self, surface: &Surface) -> Spectrum {
        let at = At { world: self, surface, vertex_color: Vec4::ONE, textures: Textures::Sampled };
        at.color(&self.material_at(surface).emission)
    }

    /// Pixels across and down; a procedure counts as a fine picture.
    fn texture_size(&self, id: TextureId) -> (u32, u32) {
        match self.scene().textures[id.index()].source {
            TextureSource::Image(id) => {
                let image = &self.scene().images[id.index()];
                (image.width, image.height)
            }
            TextureSource::Checker { .. } => (1024, 1024),
        }
    }

    /// The shading normal a map gives, on the front side; the unmapped one where there are no tangents to be had.
    fn mapped_normal(&self, surface: &Surface, map: &NormalMap, n: Vec3) -> Vec3 {
        let Some((t, b)) = self.tangents(surface, &map.texture, n) else { return n };
        let uv = surface.uv(self, map.texture.uv_set);
        let read = |uv: Vec2| texture::sample(self.scene(), &map.texture, uv);
        let local = if map.is_height {
            // Central differences one texel wide, divided by that width: the slope does not depend on how fine the picture is. MTL does not say
            // how high white stands over black; here it is a fiftieth of the picture's side.
            let (w, h) = self.texture_size(map.texture.texture);
            let (du, dv) = (1.0 / w as f32, 1.0 / h as f32);
            let height = |u: f32, v: f32| read(uv + Vec2::new(u, v))[0];
            let slope_u = (height(du, 0.0) - height(-du, 0.0)) / (2.0 * du) * BUMP_HEIGHT;
            let slope_v = (height(0.0, dv) - height(0.0, -dv)) / (2.0 * dv) * BUMP_HEIGHT;
            // v runs down the picture, the bitangent up.
            Vec3::new(-slope_u * map.scale, slope_v * map.scale, 1.0)
        } else {
            let [x, y, z, _] = self.texel(surface, &map.texture);
            Vec3::new((2.0 * x - 1.0) * map.scale, (2.0 * y - 1.0) * map.scale, 2.0 * z - 1.0)
        };
        (t * local.x + b * local.y + n * local.z).try_normalize().unwrap_or(n)
    }

    /// Unit tangent (towards +u) and bitangent (up the picture) at a point.
    fn tangents(&self, surface: &Surface, map: &TextureRef, n: Vec3) -> Option<(Vec3, Vec3)> {
        let Geometry::Mesh(id) = self.scene().instances[surface.instance.index()].geometry else {
            let frame = Frame::from_normal(n);
            return Some((frame.s, frame.t));
        };
        let mesh = &self.scene().meshes[id.index()];
        let tri = mesh.triangles[surface.primitive as usize];
        let linear = self.scene().instances[surface.instance.index()].transform.matrix3;
        if map.uv_set == 0
            && let Some(tangents) = &mesh.tangents
        {
            let w = surface.weights;
            let t = tangents[tri[0] as usize] * w[0] + tangents[tri[1] as usize] * w[1] + tangents[tri[2] as usize] * w[2];
            let along = (linear * t.truncate().as_dvec3()).as_vec3();
            let along = (along - n * n.dot(along)).try_normalize()?;
            let mirrored = if self.is_mirrored(surface.instance) { -1.0 } else { 1.0 };
            return Some((along, n.cross(along) * t.w.signum() * mirrored));
        }
        // From the texture coordinates: solve for the directions in which u and v grow.
        let uvs = mesh.uvs.get(map.uv_set as usize)?;
        let uv = tri.map(|i| {
            let uv = uvs[i as usize];
            map.transform.map_or(uv, |t| t.apply(uv)).as_dvec2()
        });
        let p = tri.map(|i| linear * mesh.positions[i as usize]);
        let (e1, e2, d1, d2) = (p[1] - p[0], p[2] - p[0], uv[1] - uv[0], uv[2] - uv[0]);
        let det = d1.x * d2.y - d1.y * d2.x;
        let along_u = ((e1 * d2.y - e2 * d1.y) * det.signum()).as_vec3();
        let along_v = ((e2 * d1.x - e1 * d2.x) * det.signum()).as_vec3();
        let t = (along_u - n * n.dot(along_u)).try_normalize()?;
        let b = n.cross(t);
        // v runs down the picture, so the bitangent is against it.
        Some((t, if b.dot(along_v) > 0.0 { -b } else { b }))
    }
}
