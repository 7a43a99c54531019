//! Elements: the cells of patches that carry a value, one for each side.
//!
//! Every quadrilateral is a regular grid of `n_s × n_t` cells, every triangle is cut into `n²` similar ones, all about as large as asked
//! for. Cells that another surface stands on or goes through are cut along the line of contact (`contacts`), and along the borders of shadows where that is asked for
//! (`discontinuity`). An element is a convex polygon
//! that emits and receives from the side its corners run counter-clockwise on; the back of a cell is an element of its own, with the corners reversed.

mod blocks;
mod cells;

use std::collections::BTreeMap;

use self::cells::{Cut, cell_corners, cells, reversed, size_for};
use super::contacts;
use super::direct::DirectLight;
use super::discontinuity::{self, Lines};
use super::exposure;
use super::patch::{self, Patch, Patches};
use super::sides::{self, Side};
use crate::accel::Hit;
use crate::math::polygon::{area_vector, bilinear};
use crate::math::rounding::{gamma, offset_origin};
use crate::math::{DVec3, Ray, Vec3};
use crate::sampling::{rng, sequence};
use crate::spectrum::Spectrum;
use crate::transport::{Surface, World};

pub use blocks::Blocks;
pub use cells::MAX_CELLS;
pub(super) use cells::{Piece, cell_at, corners_of_cell, triangle_cell};

/// Parts along one edge of a cell at most.
const MAX_PARTS: u32 = 64;

/// How surfaces are divided.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// About how many elements there should be beyond one for each side of a patch; the largest cells are as large as that allows.
    pub elements: u32,
    /// The longest edge of an element, metres; overrides `elements`.
    pub size: Option<f64>,
    /// Sides to leave out.
    pub sides: Sides,
    /// Cells are cut along the lines where other surfaces touch or pierce theirs; by at most half as many pieces as there are cells.
    pub cuts_contacts: bool,
    /// Cells are cut along the borders of shadows of so many lamps, and of so many sides of emitting patches, the most powerful first; by at most about as many
    /// pieces as there are cells.
    pub discontinuities: u32,
}

/// Which sides of surfaces take part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sides {
    /// Both, but for those that no light can reach.
    Lit,
    /// Both.
    Both,
    /// Those the corners run counter-clockwise on.
    Front,
}

impl Default for Settings {
    fn default() -> Self {
        Self { elements: 4000, size: None, sides: Sides::Lit, cuts_contacts: true, discontinuities: 0 }
    }
}

/// One cell's one side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Element {
    /// Index into [`Patches::patches`].
    pub patch: u32,
    /// Which side of it.
    pub side: Side,
    /// Cell within the patch's grid.
    pub cell: u32,
    /// Part of the cell, which contact lines and shadows cut into pieces and refinement divides like patches of their own; 0 when it is whole.
    pub part: u32,
    /// Unit, on the side that emits and receives.
    pub normal: DVec3,
    /// The area that light can reach (`exposure`), m².
    pub area: f64,
    /// The whole area, m².
    pub whole_area: f64,
    corners: [DVec3; 4],
    n_corners: u8,
    /// Which of its points light can reach.
    exposed: u64,
}

/// Points of an element by which it is decided what it sees and what reaches it.
pub const POINTS: usize = 64;

/// Point `k` of an element, in its unit square: the first four, sixteen and all are well spread.
pub fn point(element: u32, k: u32) -> [f64; 2] {
    sequence::point_2d(k, rng::key(&[u64::from(element), 0x706F_696E_7473])).to_array().map(f64::from)
}

impl Element {
    /// Counter-clockwise seen from the side that emits and receives, world coordinates.
    pub fn corners(&self) -> &[DVec3] {
        &self.corners[..usize::from(self.n_corners)]
    }

    /// Light can reach its point `k` ([`point`]).
    pub fn exposes(&self, k: usize) -> bool {
        self.exposed >> k & 1 == 1
    }

    /// The fraction of it that light can reach.
    pub fn exposed(&self) -> f64 {
        if self.whole_area > 0.0 { self.area / self.whole_area } else { 0.0 }
    }

    /// Mean of the corners.
    pub fn centre(&self) -> DVec3 {
        self.corners().iter().sum::<DVec3>() / f64::from(self.n_corners)
    }

    /// How much area there is around the image of a point of the unit square, relative to the mean of all: `|∂p/∂s × ∂p/∂t|/A`, 1 in parallelograms and triangles.
    pub fn density(&self, [s, t]: [f64; 2]) -> f64 {
        if self.n_corners != 4 || self.whole_area <= 0.0 {
            return 1.0;
        }
        let [a, b, c, d] = self.corners;
        let along_s = (b - a) * (1.0 - t) + (c - d) * t;
        let along_t = (d - a) * (1.0 - s) + (c - b) * s;
        along_s.cross(along_t).length() / self.whole_area
    }

    /// Moves points of it off the surface, to where rays may start and end.
    pub(super) fn lift(&self) -> Lift {
        let largest = self.corners().iter().map(|c| c.abs().max_element()).fold(0.0, f64::max) as f32;
        Lift { normal: self.normal.as_vec3(), error: Vec3::splat(largest * gamma(16)) }
    }

    /// The point of the unit square that has these weights of corners: the inverse of [`Self::at`] in a parallelogram or triangle.
    pub(super) fn square_of(&self, w: [f32; 4]) -> [f32; 2] {
        if self.n_corners == 4 {
            return [w[1] + w[2], w[2] + w[3]];
        }
        let (u, v) = (w[1], w[2]);
        if v > u { [2.0 * u, v + u] } else { [u + v, 2.0 * v] }
    }

    /// The weights of its corners at a point of it ([`ElementMesh::weights_at`]); at the nearest in parameters for one outside.
    pub(super) fn weights(&self, p: DVec3) -> [f32; 4] {
        self.weights_of(patch::parameters(self.corners, self.n_corners == 4, p))
    }

    /// The same at parameters along its own corners: those of [`Patch::at`].
    fn weights_of(&self, [s, t]: [f64; 2]) -> [f32; 4] {
        let (s, t) = (s.clamp(0.0, 1.0), t.clamp(0.0, 1.0));
        let weights = if self.n_corners == 4 {
            [(1.0 - s) * (1.0 - t), s * (1.0 - t), s * t, (1.0 - s) * t]
        } else {
            [(1.0 - s - t).max(0.0), s, t, 0.0]
        };
        weights.map(|w| w as f32)
    }

    /// The image of a point of the unit square: bilinear, or folded into a triangle so that areas keep their proportion.
    pub fn at(&self, [s, t]: [f64; 2]) -> DVec3 {
        if self.n_corners == 4 {
            return bilinear(self.corners, [s, t]);
        }
        let [a, b, c, _] = self.corners;
        // [Heitz19], the square's diagonal becomes the triangle's median.
        let (s, t) = if t > s { (0.5 * s, t - 0.5 * s) } else { (s - 0.5 * t, 0.5 * t) };
        a + (b - a) * s + (c - a) * t
    }
}

/// How points of an element are moved off it: beyond the bound of their rounding error, which is that of a hit (`transport::Surface`).
#[derive(Clone, Copy, Debug)]
pub(super) struct Lift {
    normal: Vec3,
    error: Vec3,
}

impl Lift {
    /// The point just in front of the element.
    pub(super) fn in_front(&self, p: DVec3) -> Vec3 {
        offset_origin(p.as_vec3(), self.error, self.normal, self.normal)
    }
}

/// The cells of one patch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Cells along the first and the second edge of a quadrilateral, along every edge of a triangle (twice the same): their product is how many
    /// there are.
    pub n: [u32; 2],
    /// First element of the front and of the back; `None` for a side that takes no part.
    pub first: [Option<u32>; 2],
}

/// Cells of a grid cut into pieces and divided again, each piece into `k × k` parts.
#[derive(Clone, Debug, PartialEq)]
struct Splits {
    /// By cell: its pieces, where contact lines touch it or shadows cut it; none where it is whole.
    cuts: Vec<Vec<Cut>>,
    /// Parts along an edge, by cell.
    k: Vec<u32>,
    /// Parts of the cells before, by cell; at the end the number of all.
    starts: Vec<u32>,
}

impl Splits {
    fn new(cuts: Vec<Vec<Cut>>, k: Vec<u32>) -> Self {
        let mut starts = vec![0];
        starts.extend(k.iter().zip(&cuts).scan(0, |sum, (k, cuts)| {
            *sum += k * k * (cuts.len() as u32).max(1);
            Some(*sum)
        }));
        Self { cuts, k, starts }
    }
}

/// All surfaces of a world, divided.
#[derive(Clone, Debug)]
pub struct ElementMesh {
    patches: Patches,
    grids: Vec<Grid>,
    /// By patch; none where every cell is whole.
    splits: Vec<Option<Splits>>,
    elements: Vec<Element>,
    /// By patch: those that are there in its place where they share a part of its plane.
    before: BTreeMap<u32, Vec<u32>>,
    record: Record,
}

/// How a mesh came to be: with the same surfaces it can be made again without a ray ([`ElementMesh::again`]).
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// How surfaces were divided.
    pub settings: Settings,
    /// By patch: its sides that take part.
    pub kept: Vec<[bool; 2]>,
    /// Elements divided again, by refinement and by element of the mesh before it.
    pub refined: Vec<Vec<bool>>,
    /// By element: its points that light can reach; empty when that is not known.
    pub exposed: Vec<u64>,
    /// The borders of shadows that cells were cut along.
    pub shadows: Lines,
}

/// A piece of a cell with a point in it.
struct Spot<'a> {
    /// The first of its elements, and how many of them lie along an edge.
    first: u32,
    k: u32,
    /// Where it is not the whole cell.
    piece: Option<&'a Piece>,
    /// Of the cell, as the point's parameters in it.
    is_quad: bool,
    within: [f64; 2],
    side: Side,
}

impl Spot<'_> {
    /// The element, and the point's parameters within it.
    fn part(&self, p: DVec3) -> (u32, [f64; 2]) {
        let (is_quad, within) = match self.piece {
            Some((corners, n)) => (*n == 4, patch::parameters(*corners, *n == 4, p)),
            None => (self.is_quad, self.within),
        };
        // (The back's corners run the other way.)
        let within = if self.side == Side::Back { reversed(is_quad, within) } else { within };
        if self.k == 1 {
            return (self.first, within);
        }
        let (part, within) = cell_at(is_quad, [self.k; 2], within);
        (self.first + part, within)
    }
}

/// The borders of shadows that a mesh has: those of a world's lights, or those it had before.
enum Shadows<'a> {
    Of(&'a DirectLight<'a>),
    Known(&'a Lines),
}

impl ElementMesh {
    /// Divides the surfaces of a world.
    pub fn new(world: &World, settings: &Settings, direct: &DirectLight) -> Self {
        let patches = Patches::new(world);
        let mut kept = match settings.sides {
            Sides::Lit => sides::lit(world, &patches, direct),
            Sides::Both => vec![[true; 2]; patches.patches.len()],
            Sides::Front => vec![[true, false]; patches.patches.len()],
        };
        let before = Self::before(world, &patches.patches, settings);
        if settings.sides == Sides::Lit {
            pass_on(&patches.patches, &before, &mut kept);
        }
        let mut mesh = Self::whole(world, patches, settings, (before, kept), Shadows::Of(direct));
        if settings.sides == Sides::Lit {
            mesh.set_exposed(exposure::exposed(world, &mesh, direct));
        }
        mesh
    }

    /// The patches in whose plane others lie, with those.
    fn before(world: &World, patches: &[Patch], settings: &Settings) -> BTreeMap<u32, Vec<u32>> {
        let is_opaque = |patch: &Patch| !world.may_be_transparent(patch.material);
        let about = settings.size.unwrap_or_else(|| size_for(patches, &vec![[true; 2]; patches.len()], settings.elements));
        contacts::coincident(patches, is_opaque, about)
    }

    /// The cells of the kept sides of patches, none divided again.
    fn whole(
        world: &World,
        patches: Patches,
        settings: &Settings,
        (before, kept): (BTreeMap<u32, Vec<u32>>, Vec<[bool; 2]>),
        shadows: Shadows,
    ) -> Self {
        let size = settings.size.unwrap_or_else(|| size_for(&patches.patches, &kept, settings.elements));
        let grids: Vec<[u32; 2]> = patches.patches.iter().map(|patch| cells(patch, size)).collect();
        let n_cells = |n: &[u32; 2]| (n[0] * n[1]) as usize;
        let mut pieces = vec![BTreeMap::new(); grids.len()];
        let n = grids.iter().map(n_cells).sum::<usize>();
        let shadows = match shadows {
            Shadows::Known(lines) => lines.clone(),
            Shadows::Of(direct) if settings.discontinuities > 0 && size.is_finite() => {
                let limits = discontinuity::Limits { emitters: settings.discontinuities, size, pieces: n };
                discontinuity::lines(world, &patches, &kept, direct, limits)
            }
            Shadows::Of(_) => Lines::default(),
        };
        if size.is_finite() && (settings.cuts_contacts || !shadows.lines.is_empty()) {
            let most = if settings.cuts_contacts { n / 2 } else { 0 };
            pieces = contacts::pieces(&patches.patches, &kept, &grids, size, most, &shadows.lines);
        }
        let splits = |n, pieces: BTreeMap<u32, Vec<Piece>>| {
            let mut cuts = vec![Vec::new(); n_cells(n)];
            let is_split = !pieces.is_empty();
            pieces.into_iter().for_each(|(cell, pieces)| cuts[cell as usize] = pieces.into_iter().map(Cut::new).collect());
            is_split.then(|| Splits::new(cuts, vec![1; n_cells(n)]))
        };
        let grids = grids.iter().zip(pieces).map(|(n, pieces)| (*n, splits(n, pieces))).collect();
        let record = Record { settings: settings.clone(), kept, refined: Vec::new(), exposed: Vec::new(), shadows };
        Self::build(patches, grids, before, record)
    }

    /// The patches in whose plane others lie, each with the first that is there in its place.
    pub fn coincident(&self) -> impl ExactSizeIterator<Item = (&Patch, &Patch)> {
        let patch = |index: u32| &self.patches.patches[index as usize];
        self.before.iter().map(move |(&of, before)| (patch(of), patch(before[0])))
    }

    /// Surfaces whose elements are longer than was asked for, since no edge has more than [`MAX_CELLS`].
    pub fn n_coarser(&self) -> usize {
        let Some(size) = self.record.settings.size else { return 0 };
        self.patches.patches.iter().filter(|patch| cells::wanted(patch, size).iter().any(|&n| n > MAX_CELLS)).count()
    }

    /// The patch and side that are there at a point of a patch's side: of several in one plane the first.
    fn there(&self, index: u32, side: Side, p: DVec3) -> (u32, Side) {
        let corners = |index: u32| self.patches.patches[index as usize].corners();
        let Some(&first) = self.before.get(&index).and_then(|all| all.iter().find(|&&q| contacts::holds(corners(q), p))) else {
            return (index, side);
        };
        let agree = area_vector(corners(index)).dot(area_vector(corners(first))) >= 0.0;
        (first, if agree { side } else { side.other() })
    }

    /// Another surface is there in the place of an element's at a point of it.
    pub(super) fn is_replaced(&self, element: &Element, p: DVec3) -> bool {
        self.there(element.patch, element.side, p).0 != element.patch
    }

    /// How it came to be.
    pub fn record(&self) -> &Record {
        &self.record
    }

    /// A mesh made as `record` says; `None` when that was of other surfaces, or by another way of dividing them.
    pub fn again(world: &World, record: &Record) -> Option<Self> {
        let patches = Patches::new(world);
        if record.kept.len() != patches.patches.len() {
            return None;
        }
        let is_there = |line: &discontinuity::Line| (line.patch as usize) < record.kept.len();
        if !record.shadows.lines.iter().all(is_there) {
            return None;
        }
        let before = Self::before(world, &patches.patches, &record.settings);
        let cells = (before, record.kept.clone());
        let mut mesh = Self::whole(world, patches, &record.settings, cells, Shadows::Known(&record.shadows));
        for marked in &record.refined {
            if marked.len() != mesh.elements.len() {
                return None;
            }
            mesh = mesh.divided(marked);
        }
        if !record.exposed.is_empty() {
            if record.exposed.len() != mesh.elements.len() {
                return None;
            }
            mesh.set_exposed(record.exposed.clone());
        }
        Some(mesh)
    }

    /// About how many elements there will be at most, both sides of everything counted.
    pub fn estimate(world: &World, settings: &Settings) -> u64 {
        let patches = Patches::new(world).patches;
        let n = 2 * patches.len() as u64;
        let Some(size) = settings.size else {
            return n + u64::from(settings.elements) * if settings.discontinuities > 0 { 2 } else { 1 };
        };
        let sides = if settings.discontinuities > 0 { 4 } else { 2 };
        patches.iter().map(|patch| cells(patch, size).iter().map(|&n| u64::from(n)).product::<u64>() * sides).sum::<u64>()
    }

    /// Elements over given grids.
    fn build(patches: Patches, grids: Vec<([u32; 2], Option<Splits>)>, before: BTreeMap<u32, Vec<u32>>, record: Record) -> Self {
        let kept = record.kept.clone();
        let mut mesh = Self { grids: Vec::new(), splits: Vec::new(), patches, elements: Vec::new(), before, record };
        for (p, (n, splits)) in grids.into_iter().enumerate() {
            let patch = mesh.patches.patches[p];
            let mut grid = Grid { n, first: [None; 2] };
            for side in [Side::Front, Side::Back].into_iter().filter(|&side| kept[p][side as usize]) {
                grid.first[side as usize] = Some(mesh.elements.len() as u32);
                for cell in 0..n[0] * n[1] {
                    let whole = element(&patch, n, 1, cell, p as u32, side);
                    let Some(splits) = &splits else {
                        mesh.elements.push(whole);
                        continue;
                    };
                    let k = splits.k[cell as usize];
                    let mut part = 0;
                    let mut divide = |piece: &Element| {
                        mesh.elements.extend((0..k * k).map(|i| Element { part: part + i, ..part_of(piece, k, i) }));
                        part += k * k;
                    };
                    match &splits.cuts[cell as usize][..] {
                        [] => divide(&whole),
                        cuts => cuts.iter().for_each(|cut| divide(&with_corners(&whole, cut.piece))),
                    }
                }
            }
            mesh.grids.push(grid);
            mesh.splits.push(splits);
        }
        mesh
    }

    /// Which points of elements light can reach.
    fn set_exposed(&mut self, exposed: Vec<u64>) {
        for (element, bits) in self.elements.iter_mut().zip(&exposed) {
            element.exposed = *bits;
            element.area = element.whole_area * f64::from(bits.count_ones()) / POINTS as f64;
        }
        self.record.exposed = exposed;
    }

    /// The same mesh with the cells of some elements, marked by index, divided twice as finely along each edge.
    pub fn refined(&self, world: &World, direct: &DirectLight, marked: &[bool]) -> Self {
        let mut mesh = self.divided(marked);
        if !self.record.exposed.is_empty() {
            mesh.set_exposed(exposure::exposed(world, &mesh, direct));
        }
        mesh
    }

    /// The same without knowing what light can reach.
    fn divided(&self, marked: &[bool]) -> Self {
        let mut splits = self.splits.clone();
        let mut is_new: Vec<Vec<bool>> = vec![Vec::new(); self.grids.len()];
        for element in self.elements.iter().zip(marked).filter(|(_, marked)| **marked).map(|(e, _)| e) {
            let p = element.patch as usize;
            let n = (self.grids[p].n[0] * self.grids[p].n[1]) as usize;
            is_new[p].resize(n, false);
            // Several parts and both sides may ask for it.
            if !std::mem::replace(&mut is_new[p][element.cell as usize], true) {
                let splits = splits[p].get_or_insert_with(|| Splits::new(vec![Vec::new(); n], vec![1; n]));
                let k = &mut splits.k[element.cell as usize];
                *k = (2 * *k).min(MAX_PARTS);
            }
        }
        let grids = self.grids.iter().zip(splits).map(|(g, s)| (g.n, s.map(|s| Splits::new(s.cuts, s.k)))).collect();
        let Record { settings, kept, mut refined, shadows, .. } = self.record.clone();
        refined.push(marked.to_vec());
        Self::build(
            self.patches.clone(),
            grids,
            self.before.clone(),
            Record { settings, kept, refined, exposed: Vec::new(), shadows },
        )
    }

    /// In the order of patches; of one patch the front before the back.
    pub fn elements(&self) -> &[Element] {
        &self.elements
    }

    /// What the elements are cells of.
    pub fn patches(&self) -> &[Patch] {
        &self.patches.patches
    }

    /// By patch.
    pub fn grids(&self) -> &[Grid] {
        &self.grids
    }

    /// The element a ray of direction `dir` met at `p`; `None` on a side that takes no part, and on what has no patches.
    pub fn element_at(&self, hit: &Hit, p: Vec3, dir: Vec3) -> Option<u32> {
        let (index, side) = self.patches.side_at(hit, dir)?;
        self.element_on(index, side, p.as_dvec3())
    }

    /// The element of a patch's side at a point of it; the nearest in parameters where the point lies outside.
    pub fn element_on(&self, index: u32, side: Side, p: DVec3) -> Option<u32> {
        let spot = self.spot(index, side, p)?;
        // (One part: nobody has to know where in it.)
        Some(if spot.k == 1 { spot.first } else { spot.part(p).0 })
    }

    /// The same with the point's parameters within the element, along its own corners: those of [`Patch::at`].
    fn locate(&self, index: u32, side: Side, p: DVec3) -> Option<(u32, [f64; 2])> {
        Some(self.spot(index, side, p)?.part(p))
    }

    /// The piece of a cell in which a point lies.
    fn spot(&self, index: u32, side: Side, p: DVec3) -> Option<Spot<'_>> {
        let (index, side) = self.there(index, side, p);
        let patch = &self.patches.patches[index as usize];
        let grid = &self.grids[index as usize];
        let first = grid.first[side as usize]?;
        let (cell, within) = cell_at(patch.is_quad(), grid.n, patch.parameters(p));
        let mut spot = Spot { first: first + cell, k: 1, piece: None, is_quad: patch.is_quad(), within, side };
        if let Some(splits) = &self.splits[index as usize] {
            spot.k = splits.k[cell as usize];
            spot.first = first + splits.starts[cell as usize];
            let cuts = &splits.cuts[cell as usize];
            if !cuts.is_empty() {
                let piece = cells::piece_at(cuts, p);
                spot.first += piece as u32 * spot.k * spot.k;
                spot.piece = Some(&cuts[piece].piece);
            }
        }
        Some(spot)
    }

    /// The element a ray of direction `dir` met at `p`, and the weights of its corners there, which sum to one: bilinear in a quadrilateral,
    /// barycentric in a triangle (the fourth is zero).
    pub fn weights_at(&self, hit: &Hit, p: Vec3, dir: Vec3) -> Option<(u32, [f32; 4])> {
        let (index, side) = self.patches.side_at(hit, dir)?;
        let (element, [s, t]) = self.locate(index, side, p.as_dvec3())?;
        Some((element, self.elements[element as usize].weights_of([s, t])))
    }

    /// Some cells of the patch are cut, or divided again.
    pub(super) fn is_split(&self, patch: usize) -> bool {
        self.splits[patch].is_some()
    }

    /// By patch: borders of shadows are cut into it.
    pub(super) fn has_shadows(&self) -> Vec<bool> {
        let mut has_shadows = vec![false; self.grids.len()];
        self.record.shadows.lines.iter().for_each(|line| has_shadows[line.patch as usize] = true);
        has_shadows
    }

    /// A contact line touches the cell of an element, or the border of a shadow cuts it.
    pub(super) fn is_at_contact(&self, element: &Element) -> bool {
        self.splits[element.patch as usize].as_ref().is_some_and(|s| !s.cuts[element.cell as usize].is_empty())
    }

    /// The elements just across the middle of every edge, in the order of edges; the element itself where there are none.
    pub(crate) fn neighbours(&self, element: &Element) -> impl Iterator<Item = usize> {
        let c = element.corners();
        let across = move |k: usize| {
            let (a, b) = (c[k], c[(k + 1) % c.len()]);
            let outwards: DVec3 = (b - a).cross(element.normal);
            (a + b) * 0.5 + outwards.normalize_or_zero() * (1e-3 * element.whole_area.sqrt())
        };
        (0..c.len()).filter_map(move |k| self.element_on(element.patch, element.side, across(k))).map(|j| j as usize)
    }

    /// How many elements a side of a patch has.
    pub(super) fn n_on_side(&self, patch: usize) -> usize {
        let grid = &self.grids[patch];
        self.splits[patch].as_ref().map_or(grid.n[0] * grid.n[1], |s| s.starts.last().copied().unwrap_or(0)) as usize
    }

    /// No corner of the element lies on the border of its patch.
    pub(super) fn is_inner(&self, element: &Element) -> bool {
        let n = self.grids[element.patch as usize].n;
        if self.is_split(element.patch as usize) {
            return false;
        }
        if self.patches.patches[element.patch as usize].is_quad() {
            let (i, j) = (element.cell % n[0], element.cell / n[0]);
            i > 0 && j > 0 && i + 1 < n[0] && j + 1 < n[1]
        } else {
            let (i, j, upper) = triangle_cell(n[0], element.cell);
            i > 0 && j > 0 && i + j + 2 + u32::from(upper) < n[0]
        }
    }

    /// The surface at a point of an element's unit square ([`Element::at`]).
    pub fn surface(&self, world: &World, element: &Element, at: [f64; 2]) -> Surface {
        surface_of(world, &self.patches.patches[element.patch as usize], element.at(at), element.normal)
    }
}

/// What light reaches in the place of patches reaches those that are there.
fn pass_on(patches: &[Patch], before: &BTreeMap<u32, Vec<u32>>, kept: &mut [[bool; 2]]) {
    let normal = |p: u32| area_vector(patches[p as usize].corners());
    for (&p, &first) in before.iter().flat_map(|(p, all)| all.iter().map(move |first| (p, first))) {
        let [front, back] = kept[p as usize];
        let sides = if normal(p).dot(normal(first)) >= 0.0 { [front, back] } else { [back, front] };
        kept[first as usize].iter_mut().zip(sides).for_each(|(kept, side)| *kept |= side);
    }
}

/// The surface at a point of a patch, as a ray against `normal` would meet it.
pub(super) fn surface_of(world: &World, patch: &Patch, p: DVec3, normal: DVec3) -> Surface {
    let scene = world.scene();
    let instance = &scene.instances[patch.instance.index()];
    let crate::scene::Geometry::Mesh(id) = instance.geometry else { unreachable!("patches are parts of meshes") };
    let mesh = &scene.meshes[id.index()];
    let weights = |triangle: u32| {
        let [a, b, c] = mesh.triangles[triangle as usize]
            .map(|v| instance.transform.transform_point3(mesh.positions[v as usize]) - world.origin());
        let n = (b - a).cross(c - a);
        let whole = n.length_squared();
        let (u, v) = ((p - a).cross(c - a).dot(n) / whole, (b - a).cross(p - a).dot(n) / whole);
        [1.0 - u - v, u, v]
    };
    let least = |w: [f64; 3]| w.into_iter().fold(f64::INFINITY, f64::min);
    let [first, second] = patch.triangles;
    let mut triangle = first;
    let mut w = weights(first);
    if second != first {
        let other = weights(second);
        if least(other) > least(w) {
            (triangle, w) = (second, other);
        }
    }
    let w = w.map(|w| if w.is_finite() { w.max(0.0) } else { 1.0 });
    let sum = w[0] + w[1] + w[2];
    let hit = Hit { t: 0.0, instance: patch.instance.0, primitive: triangle, u: (w[1] / sum) as f32, v: (w[2] / sum) as f32 };
    world.surface(&Ray::new(p.as_vec3(), -normal.as_vec3()), &hit)
}

/// A cell of the grid, or of the one of every `step`-th line.
fn element(patch: &Patch, n: [u32; 2], step: u32, cell: u32, index: u32, side: Side) -> Element {
    let whole = Element {
        patch: index,
        side,
        cell,
        part: 0,
        normal: DVec3::ZERO,
        area: 0.0,
        whole_area: 0.0,
        corners: [DVec3::ZERO; 4],
        n_corners: 0,
        exposed: !0,
    };
    with_corners(&whole, corners_of_cell(patch, n, step, cell))
}

/// An element like another, with corners as seen from the front.
fn with_corners(like: &Element, (mut corners, n_corners): Piece) -> Element {
    if like.side == Side::Back {
        corners[..n_corners].reverse();
        corners[3] = corners[n_corners - 1];
    }
    with_area(like, corners, n_corners)
}

/// An element like another, with other corners.
fn with_area(like: &Element, corners: [DVec3; 4], n_corners: usize) -> Element {
    let area = area_vector(&corners[..n_corners]);
    let length = area.length();
    Element { corners, n_corners: n_corners as u8, normal: area / length, area: length, whole_area: length, ..*like }
}

/// Part `part` of `k × k` of a cell or a piece of it.
fn part_of(whole: &Element, k: u32, part: u32) -> Element {
    if k == 1 {
        return *whole;
    }
    let c = whole.corners;
    let patch = |[s, t]: [f64; 2]| {
        if whole.n_corners == 4 { bilinear(c, [s, t]) } else { c[0] + (c[1] - c[0]) * s + (c[2] - c[0]) * t }
    };
    let (corners, n_corners) =
        cell_corners(whole.n_corners == 4, [k; 2], part, |i, j| patch([i, j].map(|i| f64::from(i) / f64::from(k))));
    with_area(whole, corners, n_corners)
}

/// What passes straight through a surface at a point, averaged over directions by the cosine: `∫ T cos θ dω/π = ∫₀¹ T d(cos² θ)`.
fn passes(world: &World, surface: &Surface, n: Vec3) -> Spectrum {
    const ANGLES: u32 = 16;
    let along = crate::math::Frame::from_normal(n);
    let at = |cos2: f32| {
        let shading = world.shading(surface, along.to_world(Vec3::new((1.0 - cos2).sqrt(), 0.0, cos2.sqrt())));
        Spectrum::WHITE * (1.0 - shading.coverage) + shading.straight_transmission() * shading.coverage
    };
    // What lets nothing through head-on never does.
    if at(1.0).is_black() {
        return Spectrum::BLACK;
    }
    (0..ANGLES).map(|k| at((k as f32 + 0.5) / ANGLES as f32)).sum::<Spectrum>() * (1.0 / ANGLES as f32)
}

/// What a surface is made of, averaged over one element.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Matter {
    /// ρ: the reflectance of its diffuse part.
    pub reflectance: Spectrum,
    /// E = π L_e, W/m² or lm/m².
    pub emission: Spectrum,
    /// τ: what passes straight through, of light that arrives from everywhere alike.
    pub transmittance: Spectrum,
}

impl ElementMesh {
    /// Reflectance and emission of an element: at its centre where the material is constant, over a fixed pattern where it has textures or alpha.
    pub fn matter(&self, world: &World, element: &Element) -> Matter {
        const SIDE: u32 = 4;
        let patch = &self.patches.patches[element.patch as usize];
        let side = if sides::is_constant(world, patch) { 1 } else { SIDE };
        let mut sum = Matter::default();
        let places = |i: u32| [i % side, i / side].map(|k| (f64::from(k) + 0.5) / f64::from(side));
        let all: f64 = (0..side * side).map(|i| element.density(places(i))).sum();
        for i in 0..side * side {
            let at = places(i);
            let weight = if all > 0.0 { (element.density(at) / all) as f32 } else { 1.0 / (side * side) as f32 };
            let surface = self.surface(world, element, at);
            let coverage = weight * world.opacity(&surface);
            let shading = world.shading(&surface, element.normal.as_vec3());
            sum.reflectance += shading.bsdf.diffuse_reflectance() * coverage;
            sum.emission += shading.emission * (coverage * std::f32::consts::PI);
            if world.has_transparency() {
                sum.transmittance += passes(world, &surface, element.normal.as_vec3()) * weight;
            }
        }
        sum
    }
}
