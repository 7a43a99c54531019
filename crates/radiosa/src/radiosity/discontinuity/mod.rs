//! Discontinuity lines: where on a surface the light of a lamp or of an emitting surface begins or ends to be hidden.
//!
//! ```text
//! lamp × edge                  the border of its shadow: light steps (D0)
//! emitter vertex × edge  (VE)  where an emitter's corner comes out from behind a silhouette edge
//! vertex × emitter edge  (EV)  where a silhouette's corner comes in front of an emitter's edge
//! ```
//!
//! The last two bound umbra and penumbra: irradiance goes on there, its slope or its curvature does not (D1, D2). Both are wedges: what lies behind a point as seen along
//! an edge. Where rays along a wedge, just outside of what casts the shadow, land on a patch, the plane of the wedge meets that patch in a line, which becomes a border of elements
//! (`contacts`). So what lies in the way, in front of the silhouette or behind it, is found by rays and not by clipping wedges. Source: [Lischinski92].
//!
//! Not here: events of three edges (quadrics, which bound umbras behind edges askew to each other), and the line in which an emitter's own plane meets a surface.

mod silhouette;

use rayon::prelude::*;

use self::silhouette::Silhouettes;
use super::direct::DirectLight;
use super::form_factor::analytic::point_to_polygon;
use super::mesh::surface_of;
use super::patch::Patches;
use super::sides::Side;
use crate::math::polygon::area_vector;
use crate::math::rounding::{gamma, offset_origin};
use crate::math::{DVec3, Ray, Vec3};
use crate::spectrum::luminance;
use crate::transport::World;

/// Silhouette edges, and vertices, looked at from each vertex and edge of an emitter: those that look longest from there.
const EDGES: usize = 512;
/// Rays along a wedge, and halvings of the way between two that land on different patches.
const RAYS: u32 = 24;
const HALVINGS: u32 = 8;
/// Rays pass an edge at this distance, in lengths of an element's edge; what they meet at once behind it is in contact with it.
const ASIDE: f64 = 1e-3;
const CONTACT: f64 = 4.0;
/// Rays start so far within an emitter, as a part of the way to its middle.
const WITHIN: f64 = 1e-3;
/// Lines at least so long count, in lengths of an element's edge, and light at least so strong, as a part of the mean over all surfaces.
const SHORT: f64 = 0.25;
const WEAK: f64 = 0.01;
/// Elements that a line adds for each element it goes through, about.
const PIECES: f64 = 1.5;

/// A line on a patch along which elements are cut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Index of the patch.
    pub patch: u32,
    /// Ends, in the patch's plane, world coordinates.
    pub ends: [DVec3; 2],
    /// What an element across it may have wrong, W/m or lm/m: irradiance times length; less where a penumbra is wider than elements are.
    pub strength: f64,
}

/// Lines, the strongest first, and how many were not taken.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lines {
    /// Cut into elements.
    pub lines: Vec<Line>,
    /// Silhouettes that were not looked at, and lines weaker than those that were taken.
    pub n_left_out: u64,
}

/// Where wedges begin.
#[derive(Clone, Copy, Debug)]
enum Source {
    /// A lamp at a place, or in a direction.
    Lamp,
    /// A side of a patch: the index in [`Emitter`]s.
    Surface(usize),
}

/// A side of a patch that emits.
#[derive(Clone, Debug)]
struct Emitter {
    patch: u32,
    corners: Vec<DVec3>,
    /// Unit, where it emits to.
    normal: DVec3,
    middle: DVec3,
    /// π L_e, W/m² or lm/m², its luminance.
    radiosity: f64,
    area: f64,
}

/// A place (`w = 1`) or a direction (`w = 0`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Apex {
    pub(super) p: DVec3,
    pub(super) w: f64,
}

impl Apex {
    /// The way of light from here to a point.
    pub(super) fn to(&self, p: DVec3) -> DVec3 {
        p * self.w - self.p
    }
}

/// What lies behind a silhouette as seen from an emitter: light goes from `from` past `past`, both as they move along an edge or stay at a vertex.
#[derive(Clone, Copy, Debug)]
struct Wedge {
    from: [Apex; 2],
    past: [DVec3; 2],
    /// Unit, off the wedge's plane to where nothing is in the way.
    outwards: DVec3,
    source: Source,
}

impl Wedge {
    /// The light that passes at `t` of the way along the edge.
    fn at(&self, t: f64) -> (Apex, DVec3) {
        let [a, b] = self.from;
        (Apex { p: a.p.lerp(b.p, t), w: a.w }, self.past[0].lerp(self.past[1], t))
    }
}

/// The most lines, and the elements they are for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// Lamps, and emitting sides of patches, the most powerful first.
    pub(super) emitters: u32,
    /// The length of an element's edge, m.
    pub(super) size: f64,
    /// Elements that lines may add, about.
    pub(super) pieces: usize,
}

/// The lines of a world.
pub(super) fn lines(world: &World, patches: &Patches, kept: &[[bool; 2]], direct: &DirectLight, limits: Limits) -> Lines {
    let emitters = emitters(world, patches, limits.emitters as usize);
    let silhouettes = Silhouettes::new(world, &patches.patches, limits.size);
    let search = Search { world, patches, kept, direct, emitters: &emitters, size: limits.size };
    let mut n_left_out = 0;
    let mut wedges = Vec::new();
    for lamp in direct.apexes().iter().take(limits.emitters as usize) {
        n_left_out += of_edges(&silhouettes, *lamp, Source::Lamp, &mut wedges);
    }
    for (k, emitter) in emitters.iter().enumerate() {
        let is_above = |p: DVec3| (p - emitter.middle).dot(emitter.normal) > ASIDE * limits.size;
        let n = emitter.corners.len();
        for (i, &p) in emitter.corners.iter().enumerate() {
            let next = emitter.corners[(i + 1) % n];
            let is_inner = |a: DVec3, b: DVec3| silhouettes.is_inner([a, b], emitter.patch);
            let of_surface = Source::Surface(k);
            // (What several patches make up together has its corners where it ends.)
            if !is_inner(emitter.corners[(i + n - 1) % n], p) || !is_inner(p, next) {
                n_left_out += of_edges(&silhouettes, Apex { p, w: 1.0 }, of_surface, &mut wedges);
            }
            if !is_inner(p, next) {
                let (found, left) = silhouettes.vertices([p, next], &is_above, EDGES);
                n_left_out += left;
                let from = [p, next].map(|p| Apex { p, w: 1.0 });
                let wedge = |(p, outwards)| Wedge { from, past: [p; 2], outwards, source: of_surface };
                wedges.extend(found.into_iter().map(wedge));
            }
        }
    }
    let mut found: Vec<Line> = wedges.par_iter().flat_map_iter(|wedge| search.lines_of(wedge)).collect();
    // (Power over all surfaces: light that is weaker than a part of this is not worth an element.)
    let area: f64 = patches.patches.iter().map(super::patch::Patch::area).sum();
    let power: f64 = emitters.iter().map(|e| e.radiosity * e.area).sum();
    let weak = if direct.apexes().is_empty() && area > 0.0 { WEAK * power / area } else { 0.0 };
    found.retain(|line| line.strength > weak * length(line));
    found.sort_by(|a, b| b.strength.total_cmp(&a.strength).then_with(|| key(a).cmp(&key(b))));
    let mut left = limits.pieces as f64;
    let taken = found.iter().take_while(|line| {
        left -= PIECES * length(line) / limits.size + 1.0;
        left >= 0.0
    });
    let n = taken.count();
    n_left_out += (found.len() - n) as u64;
    found.truncate(n);
    Lines { lines: found, n_left_out }
}

fn length(line: &Line) -> f64 {
    (line.ends[1] - line.ends[0]).length()
}

/// An order of lines that depends on nothing but them.
fn key(line: &Line) -> (u32, [[u64; 3]; 2]) {
    (line.patch, line.ends.map(|p| p.to_array().map(f64::to_bits)))
}

/// The sides of patches that emit most.
fn emitters(world: &World, patches: &Patches, most: usize) -> Vec<Emitter> {
    let mut all = Vec::new();
    for (index, patch) in patches.patches.iter().enumerate() {
        for side in [Side::Front, Side::Back].into_iter().filter(|&side| patch.emits(world, side)) {
            let mut corners = patch.corners().to_vec();
            if side == Side::Back {
                corners.reverse();
            }
            let normal = area_vector(&corners).normalize_or_zero();
            let middle = corners.iter().sum::<DVec3>() / corners.len() as f64;
            let surface = surface_of(world, patch, middle, normal);
            let emission = world.shading(&surface, normal.as_vec3()).emission;
            let radiosity = std::f64::consts::PI * f64::from(emission.luminance());
            if radiosity > 0.0 && radiosity.is_finite() && normal != DVec3::ZERO {
                all.push(Emitter { patch: index as u32, corners, normal, middle, radiosity, area: patch.area() });
            }
        }
    }
    all.sort_by(|a, b| (b.radiosity * b.area).total_cmp(&(a.radiosity * a.area)).then(a.patch.cmp(&b.patch)));
    all.truncate(most);
    all
}

/// The wedges of all edges that are silhouettes from a place; returns how many were left out.
fn of_edges(silhouettes: &Silhouettes, apex: Apex, source: Source, wedges: &mut Vec<Wedge>) -> u64 {
    let (found, left) = silhouettes.edges(apex, EDGES);
    wedges.extend(found.into_iter().map(|(past, outwards)| Wedge { from: [apex; 2], past, outwards, source }));
    left
}

/// Where wedges land.
struct Search<'a> {
    world: &'a World,
    patches: &'a Patches,
    kept: &'a [[bool; 2]],
    direct: &'a DirectLight<'a>,
    emitters: &'a [Emitter],
    size: f64,
}

impl Search<'_> {
    /// The side of a patch that light lands on just outside of a wedge.
    fn landing(&self, wedge: &Wedge, t: f64) -> Option<(u32, Side)> {
        let (from, past) = wedge.at(t);
        let dir = from.to(past);
        let coordinates = past.abs().max_element().max(from.p.abs().max_element() * from.w);
        let aside = ASIDE * self.size + 64.0 * f64::from(f32::EPSILON) * coordinates;
        let start = match wedge.source {
            Source::Surface(k) => {
                let emitter = &self.emitters[k];
                if dir.dot(emitter.normal) <= 1e-6 * dir.length() {
                    return None;
                }
                let p = from.p.lerp(emitter.middle, WITHIN).as_vec3();
                let error = Vec3::splat(p.abs().max_element() * gamma(16));
                offset_origin(p, error, emitter.normal.as_vec3(), emitter.normal.as_vec3())
            }
            Source::Lamp if from.w > 0.0 => from.p.as_vec3(),
            // (From beyond everything.)
            Source::Lamp => {
                let bounds = self.world.accel().bounds();
                (past - dir * (2.0 * f64::from(bounds.extent().length()))).as_vec3()
            }
        };
        let meets = |aside: f64| {
            let way = past + wedge.outwards * aside - start.as_dvec3();
            let far = way.length();
            let ray = Ray::new(start, (way / far).as_vec3());
            let found = if far > 0.0 { self.world.closest_visible(&ray) } else { None };
            (found.map(|(hit, _)| hit), ray.dir, far)
        };
        let (outside, dir, far) = meets(aside);
        let hit = outside.filter(|hit| f64::from(hit.t) > far + CONTACT * aside)?;
        // Just inside something is in the way.
        let (inside, ..) = meets(-aside);
        inside.filter(|inside| f64::from(inside.t) < f64::from(hit.t) - CONTACT * aside)?;
        let (patch, side) = self.patches.side_at(&hit, dir)?;
        self.kept[patch as usize][side as usize].then_some((patch, side))
    }

    /// Where light that passes at `t` meets the plane of a patch.
    fn meets(&self, wedge: &Wedge, t: f64, patch: u32) -> Option<DVec3> {
        let corners = self.patches.patches[patch as usize].corners();
        let (from, past) = wedge.at(t);
        let (dir, normal) = (from.to(past), area_vector(corners));
        let p = past + dir * ((corners[0] - past).dot(normal) / dir.dot(normal));
        p.is_finite().then_some(p)
    }

    /// The lines of one wedge.
    fn lines_of(&self, wedge: &Wedge) -> Vec<Line> {
        let at = |k: u32| (1e-3 + f64::from(k) / f64::from(RAYS - 1)) / 1.002;
        let landed: Vec<Option<(u32, Side)>> = (0..RAYS).map(|k| self.landing(wedge, at(k))).collect();
        // Between two rays: how far what the first landed on goes.
        let border = |mut inside: f64, mut outside: f64, on: (u32, Side)| {
            for _ in 0..HALVINGS {
                let middle = 0.5 * (inside + outside);
                if self.landing(wedge, middle) == Some(on) { inside = middle } else { outside = middle }
            }
            inside
        };
        let (mut lines, mut first) = (Vec::new(), 0);
        for run in landed.chunk_by(|a, b| a == b) {
            let (start, end) = (first, first + run.len() as u32 - 1);
            first = end + 1;
            let Some(on) = run[0] else { continue };
            let t0 = if start == 0 { 0.0 } else { border(at(start), at(start - 1), on) };
            let t1 = if end == RAYS - 1 { 1.0 } else { border(at(end), at(end + 1), on) };
            lines.extend(self.line(wedge, [t0, t1], on));
        }
        lines
    }

    /// A line with its strength, if it counts.
    fn line(&self, wedge: &Wedge, [t0, t1]: [f64; 2], (patch, side): (u32, Side)) -> Option<Line> {
        let ends = [self.meets(wedge, t0, patch)?, self.meets(wedge, t1, patch)?];
        let length = (ends[1] - ends[0]).length();
        let of = &self.patches.patches[patch as usize];
        let normal = area_vector(of.corners()).normalize_or_zero() * if side == Side::Front { 1.0 } else { -1.0 };
        let middle = (ends[0] + ends[1]) * 0.5;
        let irradiance = match wedge.source {
            Source::Surface(k) => {
                let emitter = &self.emitters[k];
                let (from, past) = wedge.at(0.5 * (t0 + t1));
                let factor = point_to_polygon(middle, normal, &emitter.corners, &mut Vec::new());
                let penumbra = emitter.area.sqrt() * (middle - past).length() / from.to(past).length();
                emitter.radiosity * factor * (self.size / penumbra).min(1.0)
            }
            // (What arrives a little outside, where it is light.)
            Source::Lamp => {
                let surface = surface_of(self.world, of, middle + wedge.outwards * (2.0 * ASIDE * self.size), normal);
                luminance(self.direct.of_lamps(&surface, normal.as_vec3()).to_array().map(f64::from))
            }
        };
        let strength = irradiance * length;
        (length >= SHORT * self.size && strength > 0.0 && strength.is_finite()).then_some(Line { patch, ends, strength })
    }
}
