//! The light of flat emissive surfaces in closed form (`emitter::polygon`): those that matter most, where nothing but opaque triangles can stand between.

use super::World;
use crate::accel::Triangle;
use crate::emitter::area::EmissiveSurface;
use crate::emitter::polygon::{self, BLOCKERS, Polygon, Receiver, Seen, Unclear};
use crate::emitter::random::PointSampler;
use crate::scene::InstanceId;
use crate::spectrum::Spectrum;

/// Polygons that are asked at every place, at most.
const MOST: usize = 32;
/// Where there would be more, those with less than this part of all power are not asked.
const LARGE: f32 = 0.05;
/// Of those that would give less than this part of the light of all at a place, a point tells what part arrives.
const MINOR: f32 = 0.02;

/// How much work light in closed form is worth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Care {
    /// Every pixel shows it.
    OfPictures,
    /// Many gathers share it.
    OfGathers,
}

impl Care {
    /// The part of all power below which a polygon is not asked.
    fn least(self) -> f32 {
        match self {
            Self::OfPictures => 0.002,
            Self::OfGathers => 0.03,
        }
    }

    /// Triangles that are sooner cut out than `n` points are drawn, where a polygon would give `share` of its `L_e`: of small ones points are noisy in narrow penumbras only.
    fn blockers(self, n: u32, share: f32) -> usize {
        match self {
            Self::OfPictures => 48 + (600.0 * share) as usize,
            Self::OfGathers => 8 * (n as usize + 1),
        }
    }
}

/// Flat emissive surfaces that are asked at every place.
#[derive(Debug)]
pub(super) struct PolygonLights {
    all: Vec<PolygonLight>,
    /// What draws points on all other emissive surfaces, where there are some.
    rest: Option<PointSampler>,
    care: Care,
}

/// One of them.
#[derive(Debug)]
pub(super) struct PolygonLight {
    polygon: Polygon,
    /// Draws points on it.
    pub(super) sampler: PointSampler,
}

/// What one of them would give a receiver.
enum Given {
    /// This irradiance if nothing were between, over `L_e`.
    Free { share: f32, seen: Seen },
    /// Nobody knows.
    Unclear,
}

/// What one polygon brings.
pub(super) enum Brought {
    /// This irradiance.
    Exactly(Spectrum),
    /// Nobody knows what part of `free`, where that is known; so many points will tell.
    Partly { free: Option<Spectrum>, points: u32 },
}

impl PolygonLights {
    /// Of the surfaces of a world; `None` where none of them is large and flat.
    pub(super) fn new(surfaces: &[EmissiveSurface], care: Care) -> Option<Self> {
        let mut polygons = polygon::polygons(surfaces);
        let total: f32 = surfaces.iter().map(EmissiveSurface::power).sum();
        polygons.retain(|polygon| polygon.power() > care.least() * total);
        // (Stable: the order of the scene among equals.)
        polygons.sort_by(|a, b| b.power().total_cmp(&a.power()));
        if polygons.len() > MOST {
            // A finely divided lamp: points are as good.
            polygons.retain(|polygon| polygon.power() > LARGE * total);
            polygons.truncate(MOST);
        }
        if polygons.is_empty() {
            return None;
        }
        let is_taken = |surface: &&EmissiveSurface| polygons.iter().any(|polygon| polygon.surfaces.contains(surface));
        let rest: Vec<EmissiveSurface> = surfaces.iter().filter(|surface| !is_taken(surface)).copied().collect();
        let rest = Some(PointSampler::new(&rest)).filter(|rest| !rest.is_empty());
        let with_sampler = |polygon: Polygon| PolygonLight { sampler: PointSampler::new(&polygon.surfaces), polygon };
        Some(Self { all: polygons.into_iter().map(with_sampler).collect(), rest, care })
    }

    pub(super) fn all(&self) -> &[PolygonLight] {
        &self.all
    }

    pub(super) fn rest(&self) -> Option<&PointSampler> {
        self.rest.as_ref()
    }

    /// Those that a receiver sees, with what they bring, where `n` points could be taken instead.
    pub(super) fn each(
        &self,
        world: &World,
        receiver: &Receiver,
        n: u32,
        n_rays: &mut u64,
        mut take: impl FnMut(&PolygonLight, Brought, &mut u64),
    ) {
        let mut given = [const { None }; MOST];
        let mut all = 0.0;
        for (given, light) in given.iter_mut().zip(&self.all) {
            *given = light.given(receiver);
            if let Some(Given::Free { share, .. }) = given {
                all += *share * light.polygon.radiance.luminance();
            }
        }
        for (light, given) in self.all.iter().zip(&mut given) {
            let Some(given) = given.take() else { continue };
            let brought = light.bring(world, receiver, given, (MINOR * all, self.care, n), n_rays);
            take(light, brought, n_rays);
        }
    }
}

impl PolygonLight {
    fn given(&self, receiver: &Receiver) -> Option<Given> {
        match self.polygon.seen_from(receiver).transpose()? {
            Ok(seen) => Some(Given::Free { share: seen.unshadowed(), seen }),
            Err(Unclear) => Some(Given::Unclear),
        }
    }

    /// What it brings: in closed form where that is at least `minor` and not too many triangles stand between.
    fn bring(
        &self,
        world: &World,
        receiver: &Receiver,
        given: Given,
        (minor, care, n): (f32, Care, u32),
        n_rays: &mut u64,
    ) -> Brought {
        let Given::Free { share, seen } = given else { return Brought::Partly { free: None, points: n } };
        let is_cut = seen.is_cut();
        let radiance = self.polygon.radiance;
        // Of one that the horizon cuts some points bring nothing anyway: shares of a few would be wrong.
        let free = (!is_cut).then_some(radiance * share);
        if share * radiance.luminance() < minor {
            return Brought::Partly { free, points: if is_cut { n } else { 1 } };
        }
        *n_rays += 1;
        match left(world, receiver, &seen, care.blockers(n, share)) {
            Some(share) => Brought::Exactly(radiance * share),
            None => Brought::Partly { free, points: n },
        }
    }
}

/// `E/L_e` of what a receiver sees of a polygon; `None` where too much stands between, or something that is no opaque triangle.
fn left(world: &World, receiver: &Receiver, seen: &Seen, most: usize) -> Option<f32> {
    let mut blockers = [Triangle::default(); BLOCKERS];
    let n = world.accel().triangles_in(&seen.region(receiver), &mut blockers[..most.min(BLOCKERS)])?;
    if n == 0 {
        return Some(seen.unshadowed());
    }
    let is_clear = |t: &Triangle| world.may_be_transparent(world.scene().material_of(InstanceId(t.instance), t.primitive));
    if world.has_transparency() && blockers[..n].iter().any(is_clear) {
        return None;
    }
    // (Halves of a quadrilateral become neighbours, and one.)
    blockers[..n].sort_unstable_by_key(|t| (t.instance, t.primitive));
    seen.past(receiver.p, &blockers[..n]).ok()
}
