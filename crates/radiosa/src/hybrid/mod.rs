//! The hybrid of radiosity and ray tracing: what the eye sees is traced, and diffuse light is gathered once more from a radiosity solution.
//!
//! ```text
//! L = L_e + direct + ρ/π E_indirect + k_r L_r + k_t L_t + gloss
//! ```
//!
//! Direct light comes from lamps and from random points on emissive surfaces, with shadow rays at every camera sample ([`Whitted`]). Indirect diffuse light
//! is a final gather ([`FinalGather`]): rays over the hemisphere, each bringing what the solution says of the surface it meets; the meshes that made the
//! solution are never seen themselves. Gathers are kept in an irradiance cache and interpolated with their gradients ([`Cache`], [Ward92]), or made
//! at every sample. Mirrors, glass and rough metals are followed as by recursive ray tracing.
//!
//! Where a gather's ray meets a surface nearer than its elements are large, the light there is found by one more bounce.

mod cache;
mod fill;
mod gather;
mod kept;
mod near;
mod settle;
mod slope;

use cache::Known;

pub use cache::Cache;
pub use fill::Filling;
pub use gather::FinalGather;
pub use kept::Kept;

use crate::film::Pixel;
use crate::math::{Ray, Vec3};
use crate::radiosity::Solution;
use crate::raytrace::whitted::{self, Asked, Indirect, Whitted};
use crate::sampling::Stream;
use crate::spectrum::Spectrum;
use crate::transport::{Integrator, World};

/// What the hybrid can be asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// How rays from the eye are followed, and the light at what they meet.
    pub whitted: whitted::Settings,
    /// Rays of a final gather.
    pub rays: u32,
    /// How far gathers are interpolated: the error allowed to the irradiance cache, about; 0 gathers anew at every camera sample.
    pub cache: f32,
    /// Of random numbers.
    pub seed: u64,
}

/// The hybrid, ready to be asked.
#[derive(Debug)]
pub struct Hybrid<'a> {
    whitted: Whitted,
    gather: FinalGather<'a>,
    cache: Cache,
    /// What earlier views gathered, until it is known how far that reaches in this one.
    known: Vec<Known>,
    settings: Settings,
}

impl<'a> Hybrid<'a> {
    /// Of what is seen in `world`, from a solution of the same lights in `solved`: the same world, or itself without exact shapes
    /// ([`tessellated`](crate::radiosity::tessellated)). `forward` is the direction the camera looks in. It ends at once, to show
    /// nothing, where `is_over` says so.
    pub fn new(
        world: &World,
        solved: &'a World,
        solution: &'a Solution,
        settings: &Settings,
        forward: Vec3,
        is_over: &(dyn Fn() -> bool + Sync),
    ) -> Self {
        let gather = Self::gather(solved, solution, settings).settled(SETTLING * settings.rays, is_over);
        Self::with(world, gather, Vec::new(), settings, forward)
    }

    /// For a further view, from what [`Self::kept`] said after one of the same light by the same settings. `None` where that is of another mesh.
    pub fn again(
        world: &World,
        solved: &'a World,
        solution: &'a Solution,
        settings: &Settings,
        forward: Vec3,
        kept: Kept,
    ) -> Option<Self> {
        let gather = Self::gather(solved, solution, settings).knowing(kept.irradiance, &kept.centres)?;
        Some(Self::with(world, gather, kept.known, settings, forward))
    }

    /// What settings ask for: where gathers serve far, elements may be taken as a whole from nearer.
    fn gather(solved: &'a World, solution: &'a Solution, settings: &Settings) -> FinalGather<'a> {
        let mut gather = FinalGather::new(solved, solution, &settings.whitted.extra_lights, settings.seed);
        if settings.cache > CAREFUL {
            gather.within = (CAREFUL / settings.cache).sqrt();
        }
        gather
    }

    fn with(world: &World, mut gather: FinalGather<'a>, known: Vec<Known>, settings: &Settings, forward: Vec3) -> Self {
        let whitted = Whitted::with_indirect(world, &settings.whitted, forward);
        gather.nearer = NEARER;
        let cache = Cache::new(world.accel().bounds(), settings.cache);
        Self { whitted, gather, cache, known, settings: settings.clone() }
    }

    /// What further views can begin with.
    pub fn kept(&self) -> Kept {
        let centres = self.gather.slopes.iter().map(|slope| slope.centre).collect();
        Kept { irradiance: self.gather.irradiance.clone(), centres, known: self.cache.known() }
    }

    /// Gathers kept.
    pub fn n_records(&self) -> usize {
        self.cache.len()
    }
}

/// With every bounce elements have to be so many times as near to be looked at closely, in pictures: one sees no more of them then.
const NEARER: f32 = 0.5;
/// The error allowed to the cache up to which they are looked at closely from as far as for sensors.
const CAREFUL: f32 = 0.2;
/// Rays by which the light of an element is found, for each of a final gather.
const SETTLING: u32 = 2;
/// Gathers where the cache knows nothing: of those made anew for one place, at most this many rays.
const UNCACHED_RAYS: u32 = 64;
/// The same behind reflections, where many rays ask.
const UNCACHED_RAYS_BEHIND: u32 = 16;
/// Records are used this many times as far as they keep others away, so that several are averaged everywhere.
const STRETCHED: f32 = 2.0;

impl Indirect for Hybrid<'_> {
    fn irradiance(&self, at: &Asked<'_>, stream: &mut Stream, n_rays: &mut u64) -> Spectrum {
        let (p, n) = (at.surface.p, at.n);
        if self.settings.cache > 0.0
            && let Some(e) = self.cache.irradiance(p, n, STRETCHED)
        {
            return e;
        }
        let most = match (self.settings.cache > 0.0, at.depth) {
            (false, 0) => u32::MAX,
            (true, 0) => UNCACHED_RAYS,
            _ => UNCACHED_RAYS_BEHIND,
        };
        let (key, sample) = stream.next_set(1);
        let key = crate::sampling::rng::mix(key ^ u64::from(sample));
        self.gather.gather(at.surface, n, self.settings.rays.min(most), key, n_rays).irradiance
    }
}

impl Integrator for Hybrid<'_> {
    fn sample(&self, world: &World, ray: &Ray, stream: &mut Stream, n_rays: &mut u64) -> Pixel {
        self.whitted.trace(world, ray, stream, n_rays, Some(self))
    }

    fn branching(&self) -> u32 {
        self.whitted.branching()
    }
}
