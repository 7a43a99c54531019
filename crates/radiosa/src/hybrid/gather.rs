//! The final gather: the irradiance of a place from what a radiosity solution says of the surfaces around it.
//!
//! ```text
//! E = π/(MN) Σ_jk L_jk      M × N cells of equal sin²θ and φ, a ray in each
//! ```
//!
//! Emission is left out wherever the ray comes straight from the place: that is direct light, which others sample. Behind mirrors it counts: light that a
//! mirror throws on a diffuse surface is found here or nowhere. Gradients by [Ward92] from the differences between neighbouring cells.

use std::cell::RefCell;
use std::f32::consts::{PI, TAU};

use super::near::{narrow, near, pools};
use super::slope::{Slope, centres, slopes};
use crate::accel::Hit;
use crate::math::{Frame, Ray, Vec2, Vec3, function};
use crate::radiosity::Solution;
use crate::radiosity::direct::DirectLight;
use crate::radiosity::gather::Arriving;
use crate::radiosity::mesh::ElementMesh;
use crate::radiosity::solve::pools::Pools;
use crate::sampling::{Stream, rng, sequence, warp};
use crate::scene::{AlphaMode, Light, Material, Model};
use crate::spectrum::Spectrum;
use crate::transport::media::Media;
use crate::transport::{Care, Emitters, FEW_LAMPS, LightSettings, Lights, Shading, Surface, World};

/// Mirrors in a row that a ray of a gather follows, and straight passages through what is transparent.
const MIRRORS: u32 = 4;
const LAYERS: u32 = 16;
/// Surfaces in a row that are looked at closely, and after how many a ray ends by chance.
const BOUNCES: u32 = 64;
const SURE: u32 = 2;
/// Of many lamps so many are drawn for the direct light of elements and sensors.
const LAMPS: u32 = 4;
/// Rays that tell how much is near a sensor.
const PROBES: u32 = 128;
/// Independent estimates at a sensor.
const SETS: u32 = 16;
/// Less than this of what a ray brings is not followed, and less than this by chance.
const NEGLIGIBLE: f32 = 0.01;
const FAINT: f32 = 0.25;

/// What a ray of a gather may bring of lamps in mirrors, for all that other rays bring.
const MOST_THROWN: f32 = 1.0 / 16.0;

/// A solution ready to be gathered from.
#[derive(Debug)]
pub struct FinalGather<'a> {
    pub(super) world: &'a World,
    pub(super) mesh: &'a ElementMesh,
    /// Which elements have their light in common: each stands for itself, unless their light is to be found here and triangles are many more than elements wanted.
    pub(super) pools: Pools,
    /// Mean irradiance over each pool, over π.
    pub(super) irradiance: Vec<Spectrum>,
    /// How it changes within.
    pub(super) slopes: Vec<Slope>,
    /// The mean reflectance of each element.
    pub(super) reflectance: Vec<Spectrum>,
    /// By pool: it is always looked at closely.
    pub(super) narrow: Vec<bool>,
    /// How near each pool may be taken as a whole, metres.
    pub(super) near: Vec<f32>,
    /// How much nearer elements have to be with every bounce, to be looked at closely: 1 is as near.
    pub(super) nearer: f32,
    /// Within how many times their own distance they are, before any bounce.
    pub(super) within: f32,
    sky: DirectLight<'a>,
    pub(super) lights: Lights,
    /// Where sensors have their direct light from instead, as [`Self::with_direct_light_of`] says.
    shown: Option<(&'a World, Lights)>,
    /// For what is looked at closely: by a point of all emissive surfaces together and one of all lamps, where more would cost more than the noise it saves.
    near_lights: Lights,
    /// By material: rays end there, and what they meet reflects diffusely alone.
    plain: Vec<bool>,
    pub(super) seed: u64,
}

/// What arrives at a place.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gathered {
    /// W/m² or lux.
    pub irradiance: Spectrum,
    /// Its change by place, of each channel, per metre.
    pub translation: [Vec3; 3],
    /// Its change as the normal turns, of each channel, per radian around an axis.
    pub rotation: [Vec3; 3],
    /// The harmonic mean of the distances to what is around, metres.
    pub distance: f32,
    /// Standard error of the irradiance's luminance, about, relative to it: from the differences between neighbouring cells.
    pub error: f32,
    /// How many it is of.
    pub rays: u32,
}

/// One over the power of their number by which errors of gathers fall.
const ORDER: f32 = 1.4;

impl Gathered {
    /// The error it would have with one ray: errors fall by about the 0.7th power of their number.
    pub(super) fn error_of_one(&self) -> f32 {
        self.error * function::pow(self.rays as f32, 1.0 / ORDER)
    }

    /// Rays that a gather needs for an error, where it would have `error_of_one` with one.
    pub(super) fn rays_for(error: f32, error_of_one: f32) -> f32 {
        function::pow(error_of_one / error, ORDER)
    }
}

/// The random numbers of a gather: where in its cell each ray goes, and where the first bounce of those that need one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Numbers {
    /// Names all others.
    pub(super) key: u64,
    /// Names what is the same in many gathers, but for a shift that is the same for all cells: where shifts of neighbouring gathers are spread evenly, so are their
    /// rays, and what is averaged over them has less noise than of independent ones.
    pub(super) pattern: u64,
    pub(super) shift: Shift,
}

/// By dimension, of the whole of numbers from 0 to 2³².
pub(super) type Shift = [u32; 4];

impl Numbers {
    fn of_cell(&self, cell: u32) -> [Vec2; 2] {
        let bits = rng::nth(self.pattern, u64::from(cell));
        let shifted = |x: u32, k: usize| rng::unit_f32(x.wrapping_add(self.shift[k]));
        let bounce = sequence::point_2d(cell, self.pattern);
        let back = |x: f32| (x * 4_294_967_296.0) as u32;
        [
            Vec2::new(shifted((bits >> 32) as u32, 0), shifted(bits as u32, 1)),
            Vec2::new(shifted(back(bounce.x), 2), shifted(back(bounce.y), 3)),
        ]
    }
}

/// A cell of the hemisphere.
#[derive(Clone, Copy)]
struct Cell {
    light: Spectrum,
    /// Emission that mirrors threw this way, not yet in `light`.
    thrown: Spectrum,
    distance: f32,
}

impl<'a> FinalGather<'a> {
    /// From a solution of the world with its own lights and `extra_lights`.
    pub fn new(world: &'a World, solution: &'a Solution, extra_lights: &[Light], seed: u64) -> Self {
        let rgb = |v: [f64; 3]| Spectrum::from(v.map(|x| x as f32));
        let over_pi = |h: &[f64; 3]| rgb(h.map(|h| h * std::f64::consts::FRAC_1_PI));
        let is_to_be_found = solution.irradiance.iter().all(|h| *h == [0.0; 3]);
        let pools = if is_to_be_found { pools(&solution.mesh) } else { Pools::with(&solution.mesh, usize::MAX, 1.0) };
        let irradiance: Vec<Spectrum> =
            if is_to_be_found { vec![Spectrum::BLACK; pools.n()] } else { solution.irradiance.iter().map(over_pi).collect() };
        let narrow = narrow(world, &solution.mesh, &pools, seed);
        let lights = closed_form(world, extra_lights);
        let near_lights = match lights.is_one_polygon() {
            true => closed_form(world, extra_lights),
            false => prepared(world, extra_lights).with_random_points(world),
        };
        Self {
            world,
            mesh: &solution.mesh,
            reflectance: solution.system.reflectance.iter().map(|rho| rgb(*rho)).collect(),
            near: near(&solution.mesh, &pools, &narrow, &irradiance),
            slopes: slopes(&solution.mesh, &pools, &irradiance, &centres(&solution.mesh, &pools)),
            narrow,
            pools,
            irradiance,
            nearer: 1.0,
            within: 1.0,
            sky: DirectLight::new(world, extra_lights, seed),
            shown: None,
            near_lights: near_lights.drawing(1, 2),
            lights: lights.drawing(LAMPS, FEW_LAMPS),
            plain: world.scene().materials.iter().map(is_plain).collect(),
            seed,
        }
    }

    /// Sensors have direct light of a world that has exact shapes where the one that was solved in has polyhedra; places are the same in both.
    pub fn with_direct_light_of(mut self, world: &'a World) -> Self {
        let lights = closed_form(world, &[]);
        self.shown = Some((world, lights.drawing(LAMPS, FEW_LAMPS)));
        self
    }

    /// The irradiance on the side of the unit normal `n`, without what comes straight from lamps and emissive surfaces; `key` names its random numbers.
    pub fn gather(&self, surface: &Surface, n: Vec3, rays: u32, key: u64, n_rays: &mut u64) -> Gathered {
        self.gather_shifted(surface, n, rays, Numbers { key, pattern: key, shift: Shift::default() }, n_rays)
    }

    /// The same with numbers that others share.
    pub(super) fn gather_shifted(&self, surface: &Surface, n: Vec3, rays: u32, numbers: Numbers, n_rays: &mut u64) -> Gathered {
        let m = ((rays as f32 / PI).sqrt().round() as u32).max(1);
        let turns = rays.div_ceil(m).max(3);
        let frame = Frame::from_normal(n);
        let side = if surface.ng.dot(n) >= 0.0 { surface.ng } else { -surface.ng };
        let count = (m * turns) as f32;
        let look = |cell: u32| {
            let [u, bounce] = numbers.of_cell(cell);
            let s = ((cell % m) as f32 + u.x) / m as f32;
            let phi = TAU * ((cell / m) as f32 + u.y) / turns as f32;
            let r = s.sqrt();
            let dir = frame.to_world(Vec3::new(r * function::cos(phi), r * function::sin(phi), (1.0 - s).max(0.0).sqrt()));
            // A bent normal's rays into the surface itself bring nothing.
            if dir.dot(side) <= 0.0 {
                return Cell { light: Spectrum::BLACK, thrown: Spectrum::BLACK, distance: f32::INFINITY };
            }
            let (key, thrown) = (rng::nth(numbers.key, u64::from(cell)), Thrown::default());
            let reach = Reach { thrown: Some(&thrown), ..Reach::first(key, bounce, self.within) };
            let (light, distance) = self.arriving(&surface.ray(dir), reach, n_rays);
            Cell { light, thrown: thrown.get(), distance }
        };
        let mut cells: Vec<Cell> = (0..m * turns).map(look).collect();
        add_thrown(&mut cells);
        let mut gathered = Gathered::default();
        let (mut nearness, mut differences) = (0.0, 0.0);
        for cell in &cells {
            gathered.irradiance += cell.light;
            nearness += 1.0 / cell.distance.max(f32::MIN_POSITIVE);
        }
        let column = |k: u32| &cells[((k % turns) * m) as usize..][..m as usize];
        for k in 0..turns {
            let (before, column) = (column(k + turns - 1), column(k));
            differences += before.iter().zip(column).map(|(a, b)| (a.light - b.light).luminance().powi(2)).sum::<f32>();
            change_across(before, column, (k, turns), &frame, &mut gathered.translation);
            change_along(column, (k, turns), &frame, &mut gathered);
        }
        // Half the square of a difference is the variance of independent cells; a slope from cell to cell leaves a sixth of that within each.
        let mean = gathered.irradiance.luminance();
        gathered.error = if mean > 0.0 { (differences / 4.0).sqrt() / mean } else { 0.0 };
        gathered.irradiance *= PI / count;
        gathered.rays = m * turns;
        gathered.rotation = gathered.rotation.map(|g| g * (PI / count));
        gathered.distance = if nearness > 0.0 { count / nearness } else { f32::INFINITY };
        gathered
    }

    /// All light at a sensor on the side of the unit normal `n`: direct light by about `points` points of emissive surfaces, the rest by about `rays` rays, both in
    /// 16 independent sets whose spread tells the standard error. `key` names the random numbers.
    pub fn sensor(&self, surface: &Surface, n: Vec3, [rays, points]: [u32; 2], key: u64) -> Arriving {
        let white = Shading::white(n);
        let (world, lights) = self.shown.as_ref().map_or((self.world, &self.lights), |(world, lights)| (*world, lights));
        let estimate = |set: u64| {
            let key = rng::key(&[key, set]);
            let random = (points.div_ceil(SETS), &mut Stream::new(key, 0, 0));
            let direct = lights.at_random(world, surface, &white, Some(&Media::VACUUM), random, &mut 0).diffuse;
            direct * PI + self.gather(surface, n, rays.div_ceil(SETS), key, &mut 0).irradiance
        };
        let sets: Vec<Spectrum> = (0..u64::from(SETS)).map(estimate).collect();
        let irradiance = sets.iter().copied().sum::<Spectrum>() * (1.0 / SETS as f32);
        let off = |e: &Spectrum| f64::from((*e - irradiance).luminance()).powi(2);
        let variance = sets.iter().map(off).sum::<f64>() / f64::from(SETS * (SETS - 1));
        Arriving { irradiance, standard_error: variance.sqrt() }
    }

    /// The part of the hemisphere, by cosine, in which what is met is nearer than its element may be taken as a whole: of a sensor for which this is much, elements
    /// know too little.
    pub fn nearness(&self, surface: &Surface, n: Vec3, key: u64) -> f32 {
        let frame = Frame::from_normal(n);
        let is_near = |k: &u32| {
            let dir = frame.to_world(warp::cosine_hemisphere(sequence::point_2d(*k, key)));
            let ray = surface.ray(dir);
            let hit = self.world.accel().closest(&ray);
            hit.is_some_and(|hit| {
                let element = self.mesh.element_at(&hit, ray.at(hit.t), dir);
                element.is_some_and(|element| hit.t < self.near_of(element))
            })
        };
        (0..PROBES).filter(is_near).count() as f32 / PROBES as f32
    }

    /// What a ray brings, and how far it went.
    pub(super) fn arriving(&self, ray: &Ray, reach: Reach<'_>, n_rays: &mut u64) -> (Spectrum, f32) {
        *n_rays += 1;
        let world = self.world;
        if !world.has_masks() {
            let Some(hit) = world.accel().closest(ray) else { return (self.beyond(ray.dir, reach), f32::INFINITY) };
            let material = world.scene().material_of(crate::scene::InstanceId(hit.instance), hit.primitive);
            if material.is_none_or(|id| self.plain[id.index()])
                && let Some(element) = self.mesh.element_at(&hit, ray.at(hit.t), ray.dir)
                && !(reach.sees_emission && world.material(material).is_emissive())
            {
                let is_near = hit.t < self.near_of(element) * reach.near;
                if !(is_near && reach.looks_closely()) {
                    let rho = self.reflectance[element as usize];
                    return (self.of_element(element, ray.at(hit.t), rho, &reach), hit.t);
                }
            }
            return self.followed(ray, Some(hit), reach, n_rays);
        }
        self.followed(ray, None, reach, n_rays)
    }

    /// What of an element's light a surface of some reflectance sends out from a place, by what the solution says; noted instead, where that is not known yet.
    fn of_element(&self, element: u32, p: Vec3, reflectance: Spectrum, reach: &Reach<'_>) -> Spectrum {
        let pool = self.pools.of_element(element as usize);
        let Some(sink) = reach.sink else {
            return reflectance * (self.irradiance[pool as usize] + self.slopes[pool as usize].at(p)).map(|e| e.max(0.0));
        };
        sink.borrow_mut().push((pool, reach.through * reflectance));
        Spectrum::BLACK
    }

    /// How near an element may be taken as a whole, metres.
    fn near_of(&self, element: u32) -> f32 {
        self.near[self.pools.of_element(element as usize) as usize]
    }

    /// The same with everything that can be there, from what the ray meets first, where that is known. Only the first surface that a gather meets is both seen and seen
    /// through; of others one is drawn.
    fn followed(&self, ray: &Ray, mut met_first: Option<Hit>, reach: Reach<'_>, n_rays: &mut u64) -> (Spectrum, f32) {
        let world = self.world;
        let (mut ray, mut open, mut light) = (*ray, Spectrum::WHITE, Spectrum::BLACK);
        let (mut first, mut travelled) = (None, 0.0);
        for layer in 0..LAYERS {
            let met = met_first.take().map(|hit| (hit, world.surface(&ray, &hit)));
            let Some((hit, surface)) = met.or_else(|| world.closest_visible(&ray)) else {
                light += open * self.beyond(ray.dir, Reach { through: reach.through * open, ..reach });
                break;
            };
            travelled += hit.t;
            first.get_or_insert(travelled);
            let shading = world.shading(&surface, -ray.dir);
            let key = rng::mix(reach.key ^ u64::from(layer + 1));
            let met = Met { surface: &surface, shading: &shading, hit: &hit, travelled, dir: ray.dir };
            let open_here = open * shading.coverage;
            let glass = shading.straight_transmission();
            let mut passes = open * (Spectrum::gray(1.0 - shading.coverage) + glass * shading.coverage);
            let mut stays = open_here;
            if layer > 0 || reach.has_met() {
                let [s, p] = [stays, passes].map(Spectrum::max_channel);
                let chance = s / (s + p);
                if rng::unit_f32((key >> 32) as u32) < chance {
                    (stays, passes) = (stays * (1.0 / chance), Spectrum::BLACK);
                } else {
                    (stays, passes) = (Spectrum::BLACK, passes * (1.0 / (1.0 - chance)));
                }
            }
            if !stays.is_black() {
                let reach = Reach { key, through: reach.through * stays, ..reach };
                light += stays * self.leaving(&met, reach, n_rays);
            }
            open = passes;
            if open.max_channel() < NEGLIGIBLE {
                break;
            }
            *n_rays += 1;
            ray = surface.ray(ray.dir);
        }
        (light, first.unwrap_or(f32::INFINITY))
    }

    /// What leaves a surface towards the ray that met it. Rays that have met something before do not divide any more: a diffuse bounce and a reflection share one.
    fn leaving(&self, met: &Met<'_>, reach: Reach<'_>, n_rays: &mut u64) -> Spectrum {
        let Met { surface, shading, .. } = met;
        let mut light = if reach.sees_emission { reach.emitted(shading.emission) } else { Spectrum::BLACK };
        let mut stream = Stream::new(reach.key, 1, 0);
        let reflected = self.reflected(met, &reach, stream.next_2d());
        let u = stream.next_f32();
        let brings = reflected.map_or(0.0, |(_, weight)| weight.max_channel());
        let mut chance = (brings / FAINT).min(1.0);
        let diffuse = shading.bsdf.diffuse_reflectance();
        if !diffuse.is_black() {
            let known = self.mesh.element_at(met.hit, surface.p, met.dir);
            let is_far = |element: &u32| met.travelled >= self.near_of(*element) * reach.near;
            match known.filter(|known| is_far(known) || !reach.looks_closely()) {
                Some(element) => light += self.of_element(element, surface.p, diffuse, &reach),
                None if reach.looks_closely() => {
                    let is_first = !reach.has_met();
                    if !is_first {
                        chance = brings / (brings + diffuse.max_channel());
                    }
                    let bounces = if is_first { (u, 1.0) } else { (1.0 - u, 1.0 - chance) };
                    light += self.looked_at(surface, shading, bounces, reach, n_rays);
                }
                None => {}
            }
        }
        if let Some((dir, weight)) = reflected.filter(|_| u < chance) {
            let weight = weight * (1.0 / chance);
            let through = reach.through * weight;
            let next = Reach { mirrors: reach.mirrors + 1, sees_emission: true, key: rng::mix(reach.key), through, ..reach };
            light += weight * self.arriving(&surface.ray(dir), next, n_rays).0;
        }
        light
    }

    /// A direction from which light is mirrored towards a ray, and how much of it, unless enough mirrors are behind that ray; by `u` where the mirror is rough.
    fn reflected(&self, met: &Met<'_>, reach: &Reach<'_>, u: Vec2) -> Option<(Vec3, Spectrum)> {
        let Met { surface, shading, .. } = met;
        let (wo, n) = (shading.wo, shading.n);
        let smooth = shading.bsdf.specular_rays(n, wo, surface.is_front(wo)).reflected;
        let rough = || if shading.bsdf.is_glossy() { shading.bsdf.sample_gloss(n, wo, u) } else { None };
        let leaves = |dir: Vec3| dir.dot(surface.ng) * wo.dot(surface.ng) > 0.0;
        smooth
            .or_else(rough)
            .filter(|(dir, weight)| reach.mirrors < MIRRORS && weight.max_channel() >= NEGLIGIBLE && leaves(*dir))
    }

    /// The diffuse light of a surface too near for its element's mean: direct light by one point of all emissive surfaces, and one more bounce, which may meet
    /// such a surface again; the bounce is made where a number between 0 and 1 is below a chance.
    fn looked_at(
        &self,
        surface: &Surface,
        shading: &Shading,
        (number, chance): (f32, f32),
        reach: Reach<'_>,
        n_rays: &mut u64,
    ) -> Spectrum {
        let mut stream = Stream::new(reach.key, 0, 0);
        // (As its facet lies: by the normals of what is shown as smooth, light from behind the facet would come through.)
        let n = if surface.is_front(shading.wo) { surface.ng } else { -surface.ng };
        let shading = &Shading { n, ..*shading };
        let direct =
            self.near_lights.at_random(self.world, surface, shading, Some(&Media::VACUUM), (1, &mut stream), n_rays).diffuse;
        let u = if reach.bounces == 0 { reach.bounce } else { stream.next_2d() };
        let dir = Frame::from_normal(n).to_world(warp::cosine_hemisphere(u));
        let rho = shading.bsdf.diffuse_reflectance();
        // In narrow places all that is met is near: what goes on there ends by chance, as much as is absorbed.
        let goes_on = chance * if reach.bounces < SURE { 1.0 } else { rho.max_channel().min(0.95) };
        if number >= goes_on {
            return direct;
        }
        let weight = rho * (1.0 / goes_on);
        let (bounces, through) = (reach.bounces + 1, reach.through * weight);
        let near = reach.near * self.nearer;
        let next = Reach { bounces, near, sees_emission: false, key: rng::mix(reach.key ^ 2), through, ..reach };
        direct + weight * self.arriving(&surface.ray(dir), next, n_rays).0
    }

    /// From where no surface is.
    fn beyond(&self, dir: Vec3, reach: Reach<'_>) -> Spectrum {
        if reach.sees_emission { reach.emitted(self.world.background(dir, false)) } else { self.sky.sky_radiance(dir) }
    }
}

/// Lamps and surfaces whose light is direct.
fn prepared(world: &World, extra_lights: &[Light]) -> Lights {
    let settings = LightSettings { emitters: Emitters::Points { n: 1, max: 2 }, ..LightSettings::default() };
    Lights::prepare_without_skies(world, &settings, extra_lights)
}

/// The same with polygons in closed form, where those are few.
fn closed_form(world: &World, extra_lights: &[Light]) -> Lights {
    prepared(world, extra_lights).in_closed_form(world, Care::OfGathers)
}

/// Adds what mirrors throw to the light of cells: of a cell no more than a sixteenth of what all others bring. (Where few of them meet a bright lamp in a mirror, one more
/// or less is a blotch; the more rays there are, the less is cut.)
fn add_thrown(cells: &mut [Cell]) {
    let of = |cell: &Cell| (cell.light + cell.thrown).luminance();
    let all: f32 = cells.iter().map(of).sum();
    for cell in cells.iter_mut().filter(|cell| !cell.thrown.is_black()) {
        let (most, thrown) = (MOST_THROWN * (all - of(cell)), cell.thrown.luminance());
        cell.light += cell.thrown * (if thrown > most { most / thrown } else { 1.0 });
    }
}

/// Between the columns `k − 1` and `k`: the part of the gradient along `v_k−`, the direction across the boundary between them.
fn change_across(before: &[Cell], column: &[Cell], (k, turns): (u32, u32), frame: &Frame, translation: &mut [Vec3; 3]) {
    let m = column.len() as f32;
    let phi = TAU * k as f32 / turns as f32;
    let across = frame.to_world(Vec3::new(-function::sin(phi), function::cos(phi), 0.0));
    let mut sum = Spectrum::BLACK;
    for (j, (a, b)) in before.iter().zip(column).enumerate() {
        let width = ((j + 1) as f32 / m).sqrt() - (j as f32 / m).sqrt();
        sum += (b.light - a.light) * (width / a.distance.min(b.distance));
    }
    add(translation, across, sum);
}

/// Along a column: the parts of both gradients in its own plane.
fn change_along(column: &[Cell], (k, turns): (u32, u32), frame: &Frame, gathered: &mut Gathered) {
    let m = column.len() as f32;
    let phi = TAU * (k as f32 + 0.5) / turns as f32;
    let (sin, cos) = (function::sin(phi), function::cos(phi));
    let (along, across) = (frame.to_world(Vec3::new(cos, sin, 0.0)), frame.to_world(Vec3::new(-sin, cos, 0.0)));
    let (mut steps, mut tilt) = (Spectrum::BLACK, Spectrum::BLACK);
    for (j, cell) in column.iter().enumerate() {
        let middle = (j as f32 + 0.5) / m;
        tilt += cell.light * (middle / (1.0 - middle)).sqrt();
        if j > 0 {
            let s = j as f32 / m;
            let nearer = cell.distance.min(column[j - 1].distance);
            steps += (cell.light - column[j - 1].light) * (s.sqrt() * (1.0 - s) / nearer);
        }
    }
    add(&mut gathered.translation, along, steps * (TAU / turns as f32));
    add(&mut gathered.rotation, across, tilt);
}

fn add(gradient: &mut [Vec3; 3], direction: Vec3, by: Spectrum) {
    gradient.iter_mut().zip(by.to_array()).for_each(|(g, c)| *g += direction * c);
}

/// How a ray of a gather came to be.
#[derive(Clone, Copy)]
pub(super) struct Reach<'s> {
    /// Mirrors behind it.
    mirrors: u32,
    /// No direct light has been counted for what it meets.
    sees_emission: bool,
    /// Surfaces looked at closely behind it.
    bounces: u32,
    /// Elements count as near within so many times their own distance.
    near: f32,
    key: u64,
    /// Where the first bounce goes.
    bounce: Vec2,
    /// What is left of the light that goes this way back.
    through: Spectrum,
    /// Where elements are noted, instead of having their light counted.
    sink: Option<&'s Sink>,
    /// Where emission seen in mirrors is summed up, instead of being returned.
    thrown: Option<&'s Thrown>,
}

/// What mirrors throw along a ray.
type Thrown = std::cell::Cell<Spectrum>;

/// Elements at which rays ended, with the part of their irradiance that arrives.
pub(super) type Sink = RefCell<Vec<(u32, Spectrum)>>;

impl<'s> Reach<'s> {
    /// As [`Self::first`], with elements noted in `sink`.
    pub(super) const fn noting(key: u64, bounce: Vec2, near: f32, sink: &'s Sink) -> Self {
        Self { sink: Some(sink), ..Self::first(key, bounce, near) }
    }

    /// What is left here of emission: none where it is summed up.
    fn emitted(&self, emission: Spectrum) -> Spectrum {
        let Some(thrown) = self.thrown else { return emission };
        thrown.set(thrown.get() + self.through * emission);
        Spectrum::BLACK
    }

    /// It is not the first of a gather.
    const fn has_met(&self) -> bool {
        self.bounces + self.mirrors > 0
    }

    /// What it meets nearby is found by one more bounce.
    const fn looks_closely(&self) -> bool {
        self.bounces < BOUNCES
    }

    pub(super) const fn first(key: u64, bounce: Vec2, near: f32) -> Self {
        Self {
            mirrors: 0,
            sees_emission: false,
            bounces: 0,
            near,
            key,
            bounce,
            through: Spectrum::WHITE,
            sink: None,
            thrown: None,
        }
    }
}

/// Where a ray of a gather met a surface.
struct Met<'a> {
    surface: &'a Surface,
    shading: &'a Shading,
    hit: &'a Hit,
    travelled: f32,
    dir: Vec3,
}

/// Opaque, and neither mirror nor glass nor rough metal: all of it is diffuse or a highlight.
fn is_plain(material: &Material) -> bool {
    let is_diffuse = match &material.model {
        Model::Phong(m) => m.mirror.is_black(),
        Model::CookTorrance(_) => false,
        Model::MetallicRoughness(_) => false,
    };
    is_diffuse && !material.transmits() && material.alpha.mode == AlphaMode::Opaque && !material.unlit
}
