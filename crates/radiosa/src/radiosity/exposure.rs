//! How much of an element light can reach.
//!
//! A box on a floor covers a part of it. What is covered is dark, sends nothing and must not count: the radiosity of an element that a contact line crosses is that
//! of the part in the open, or the floor would darken around everything that stands on it. Exchange areas need no care (rays from covered points are
//! blocked); what has to be known is the exposed area they are divided by.
//!
//! Points of all elements are joined to groups when a ray between them is free. A point is exposed when a source of light is in its group, or when it
//! sees out of the scene: what is covered is shut in. The points are those visibility is decided by ([`mesh::Element::exposes`]), so that exchange areas and
//! exposed areas err together.

use std::ops::Range;

use rayon::prelude::*;

use super::direct::DirectLight;
use super::groups::Groups;
use super::mesh::{self, Element, ElementMesh};
use crate::accel::Hit;
use crate::math::{Frame, Ray, Vec3};
use crate::sampling::{rng, sequence, warp};
use crate::transport::{Passage, Surface, World};

/// Strata along each side of an element's unit square: the first points of an element lie one in each.
const SIDE: usize = 4;
/// Points of every element.
const POINTS: usize = SIDE * SIDE;
/// Larger meshes have small elements, and this would take long: everything counts as exposed there.
const MOST: usize = 1 << 18;
/// Rays from each point that look for others: of all, and of those that light is not known to reach after these.
const RAYS: [Range<u32>; 2] = [0..2, 2..6];
/// In meshes of more elements those that are no more than this part of the mean count as exposed: it would take long, and what is hidden of one triangle of a hundred
/// thousand matters little.
const MANY: usize = 1 << 15;
const SMALL: f64 = 0.1;

/// The points of every element that light may reach, as bits.
pub(super) fn exposed(world: &World, mesh: &ElementMesh, direct: &DirectLight) -> Vec<u64> {
    let elements = mesh.elements();
    let n = elements.len() * POINTS;
    if elements.len() > MOST {
        return vec![!0; elements.len()];
    }
    let large = SMALL * elements.iter().map(|e| e.whole_area).sum::<f64>() / elements.len() as f64;
    let is_small = |element: &Element| elements.len() > MANY && element.whole_area <= large;
    let points = Points::new(world, mesh, |element| !is_small(element));
    let mut groups = Groups::new(n);
    for (e, element) in elements.iter().enumerate() {
        if is_small(element) || mesh.patches()[element.patch as usize].emits(world, element.side) {
            (e * POINTS..(e + 1) * POINTS).for_each(|node| groups.light(node));
        }
    }
    for (hit, surface, dir) in direct.landings() {
        if let Some(node) = points.node_at(mesh, &hit, surface.p, dir) {
            groups.light(node);
        }
    }
    for (round, rays) in RAYS.into_iter().enumerate() {
        groups.look(|node| {
            let (e, k) = (node / POINTS, node % POINTS);
            let (element, from) = (&elements[e], points.start(world, mesh, node));
            if mesh.is_replaced(element, element.at(mesh::point(e as u32, k as u32))) {
                return (Vec::new(), false);
            }
            let normal = element.normal.as_vec3();
            let (mut met, mut is_lit) = (Vec::with_capacity(rays.len()), false);
            for dir in directions(normal, rays.clone(), rng::key(&[node as u64, 0x6578_706F])) {
                is_lit |= points.seen(world, mesh, from, dir, |other| {
                    let to = points.start(world, mesh, other);
                    let faces = elements[other / POINTS].normal.as_vec3().dot(from - to) > 0.0 && normal.dot(to - from) > 0.0;
                    if faces && is_free(world, from, to) {
                        met.push(other as u32);
                    }
                });
            }
            // (Most are known to be lit by what they see.)
            is_lit |= round > 0 && direct.reaches(&point_of(world, mesh, e, k).0, normal);
            (met, is_lit)
        });
    }
    let is_exposed: Vec<bool> = (0..n).map(|node| groups.is_lit(node)).collect();
    let of_element = |e: usize| {
        let first: u64 = (0..POINTS).filter(|k| is_exposed[e * POINTS + k]).map(|k| 1 << k).sum();
        if first == 0 {
            return 0;
        }
        if first.count_ones() == POINTS as u32 {
            return !0;
        }
        // A contact line crosses it: the other points, exposed when they see one that is; among many elements, when that of their stratum is.
        if elements.len() > MANY {
            let strata = of_strata(e);
            let is_so = |k: &usize| {
                let at = mesh::point(e as u32, *k as u32);
                first >> strata[stratum(at)] & 1 == 1 && !mesh.is_replaced(&elements[e], elements[e].at(at))
            };
            return (POINTS..mesh::POINTS).filter(is_so).map(|k| 1u64 << k).fold(first, |bits, bit| bits | bit);
        }
        let sees = |k: &usize| sees_exposed(world, mesh, (e, *k), (&points, &is_exposed), direct);
        (POINTS..mesh::POINTS).filter(sees).map(|k| 1u64 << k).fold(first, |bits, bit| bits | bit)
    };
    (0..elements.len()).into_par_iter().map(of_element).collect()
}

/// An additional point of an element sees out of the scene, a light, or a point that is exposed.
fn sees_exposed(
    world: &World,
    mesh: &ElementMesh,
    (e, k): (usize, usize),
    (points, is_exposed): (&Points, &[bool]),
    direct: &DirectLight,
) -> bool {
    let normal = mesh.elements()[e].normal.as_vec3();
    if mesh.is_replaced(&mesh.elements()[e], mesh.elements()[e].at(mesh::point(e as u32, k as u32))) {
        return false;
    }
    let (surface, from) = point_of(world, mesh, e, k);
    let mut directions = directions(normal, 0..2 * RAYS[1].end, rng::key(&[e as u64, k as u64, 0x6D6F_7265]));
    let sees = directions.any(|dir| {
        let mut sees = false;
        sees |= points.seen(world, mesh, from, dir, |other| {
            sees |= is_exposed[other] && is_free(world, from, points.start(world, mesh, other))
        });
        sees
    });
    sees || direct.reaches(&surface, normal)
}

/// Point `k` of an element: the surface there and where rays leave it.
fn point_of(world: &World, mesh: &ElementMesh, e: usize, k: usize) -> (Surface, Vec3) {
    let element = &mesh.elements()[e];
    let surface = mesh.surface(world, element, mesh::point(e as u32, k as u32));
    let from = surface.ray(element.normal.as_vec3()).origin;
    (surface, from)
}

/// Some directions by the cosine.
fn directions(normal: Vec3, rays: Range<u32>, key: u64) -> impl Iterator<Item = Vec3> {
    let frame = Frame::from_normal(normal);
    rays.map(move |i| frame.to_world(warp::cosine_hemisphere(sequence::point_2d(i, key))))
}

/// The points of all elements; those of some, for which few ask, are found each time.
struct Points {
    /// By element: which of those below are its own; `u32::MAX` of none.
    places: Vec<u32>,
    /// Where rays leave them.
    starts: Vec<[Vec3; POINTS]>,
    /// By stratum: the point there.
    of_strata: Vec<[u8; POINTS]>,
}

impl Points {
    fn new(world: &World, mesh: &ElementMesh, is_asked: impl Fn(&Element) -> bool) -> Self {
        let asked: Vec<usize> = (0..mesh.elements().len()).filter(|&e| is_asked(&mesh.elements()[e])).collect();
        let mut places = vec![u32::MAX; mesh.elements().len()];
        asked.iter().zip(0..).for_each(|(&e, place)| places[e] = place);
        let starts = |&e: &usize| std::array::from_fn(|k| point_of(world, mesh, e, k).1);
        Self {
            places,
            starts: asked.par_iter().map(starts).collect(),
            of_strata: asked.par_iter().map(|&e| of_strata(e)).collect(),
        }
    }

    /// Where rays leave a point.
    fn start(&self, world: &World, mesh: &ElementMesh, node: usize) -> Vec3 {
        let (e, k) = (node / POINTS, node % POINTS);
        self.starts.get(self.places[e] as usize).map_or_else(|| point_of(world, mesh, e, k).1, |starts| starts[k])
    }

    /// What a ray meets, also behind what is transparent: the nearest points of elements; and whether it leaves the scene.
    fn seen(&self, world: &World, mesh: &ElementMesh, from: Vec3, dir: Vec3, mut point: impl FnMut(usize)) -> bool {
        world.each_met(&Ray::new(from, dir), |hit, surface| {
            if let Some(node) = self.node_at(mesh, hit, surface.p, dir) {
                point(node);
            }
        })
    }

    /// The point whose stratum a hit falls into.
    fn node_at(&self, mesh: &ElementMesh, hit: &Hit, p: Vec3, dir: Vec3) -> Option<usize> {
        let (element, w) = mesh.weights_at(hit, p, dir)?;
        let here = stratum(mesh.elements()[element as usize].square_of(w).map(f64::from));
        let place = self.places[element as usize] as usize;
        let k = self.of_strata.get(place).map_or_else(|| of_strata(element as usize)[here], |points| points[here]);
        Some(element as usize * POINTS + usize::from(k))
    }
}

/// By stratum: the point of an element that lies there.
fn of_strata(element: usize) -> [u8; POINTS] {
    let mut points = [0; POINTS];
    (0..POINTS).for_each(|k| points[stratum(mesh::point(element as u32, k as u32))] = k as u8);
    points
}

/// Which of the strata of the unit square a point lies in.
fn stratum(at: [f64; 2]) -> usize {
    let [i, j] = at.map(|x| ((x * SIDE as f64) as usize).min(SIDE - 1));
    j * SIDE + i
}

/// Nothing opaque lies between.
fn is_free(world: &World, from: Vec3, to: Vec3) -> bool {
    let ray = Ray { origin: from, dir: to - from, t_max: 1.0 };
    !world.transmittances(&[ray; 8], 1, Passage::STRAIGHT, &mut 0)[0].is_black()
}
