//! The light of flat emissive surfaces in closed form (`emitter::polygon`): those that matter most, where nothing but opaque triangles can stand between.

use super::World;
use crate::accel::Triangle;
use crate::emitter::area::EmissiveSurface;
use crate::emitter::polygon::{self, BLOCKERS, Polygon, Receiver, Seen};
use crate::emitter::random::PointSampler;
use crate::scene::InstanceId;
use crate::spectrum::Spectrum;

/// Polygons that are asked at every place, at most.
const MOST: usize = 8;

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
            Self::OfPictures => 0.01,
            Self::OfGathers => 0.03,
        }
    }

    /// Triangles that are sooner cut out than `n` points are drawn.
    fn blockers(self, n: u32) -> usize {
        match self {
            Self::OfPictures => BLOCKERS,
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

/// What one polygon brings.
pub(super) enum Brought {
    /// This irradiance.
    Exactly(Spectrum),
    /// Nobody knows what part of this irradiance, where that is known; points will tell.
    Partly(Option<Spectrum>),
}

impl PolygonLights {
    /// Of the surfaces of a world; `None` where none of them is large and flat.
    pub(super) fn new(surfaces: &[EmissiveSurface], care: Care) -> Option<Self> {
        let mut polygons = polygon::polygons(surfaces);
        let total: f32 = surfaces.iter().map(EmissiveSurface::power).sum();
        polygons.retain(|polygon| polygon.power() > care.least() * total);
        // (Stable: the order of the scene among equals.)
        polygons.sort_by(|a, b| b.power().total_cmp(&a.power()));
        polygons.truncate(MOST);
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

    pub(super) fn care(&self) -> Care {
        self.care
    }

    pub(super) fn rest(&self) -> Option<&PointSampler> {
        self.rest.as_ref()
    }
}

impl PolygonLight {
    /// What it brings to a receiver, who could take `n` points instead.
    pub(super) fn bring(&self, world: &World, receiver: &Receiver, (care, n): (Care, u32), n_rays: &mut u64) -> Brought {
        match self.polygon.seen_from(receiver) {
            Ok(None) => Brought::Exactly(Spectrum::BLACK),
            Err(_) => Brought::Partly(None),
            Ok(Some(seen)) => {
                *n_rays += 1;
                match share(world, receiver, &seen, care.blockers(n)) {
                    Some(share) => Brought::Exactly(self.polygon.radiance * share),
                    // Of one that the horizon cuts some points bring nothing anyway: shares of a few would be wrong.
                    None => Brought::Partly((!seen.is_cut()).then(|| self.polygon.radiance * seen.unshadowed())),
                }
            }
        }
    }
}

/// `E/L_e` of what a receiver sees of a polygon; `None` where too much stands between, or something that is no opaque triangle.
fn share(world: &World, receiver: &Receiver, seen: &Seen, most: usize) -> Option<f32> {
    let mut blockers = [Triangle::default(); BLOCKERS];
    let n = world.accel().triangles_in(seen.region(), &mut blockers[..most.min(BLOCKERS)])?;
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
