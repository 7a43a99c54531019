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
use super::mesh::{self, ElementMesh};
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
    let points = Points::new(world, mesh);
    let mut groups = Groups::new(n);
    let large = SMALL * elements.iter().map(|e| e.whole_area).sum::<f64>() / elements.len() as f64;
    for (e, element) in elements.iter().enumerate() {
        let is_small = elements.len() > MANY && element.whole_area <= large;
        if is_small || mesh.patches()[element.patch as usize].emits(world, element.side) {
            (e * POINTS..(e + 1) * POINTS).for_each(|node| groups.light(node));
        }
    }
    for (hit, surface, dir) in direct.landings() {
        if let Some(node) = points.node_at(mesh, &hit, surface.p, dir) {
            groups.light(node);
        }
    }
    for rays in RAYS {
        groups.look(|node| {
            let (e, k) = (node / POINTS, node % POINTS);
            let (element, from) = (&elements[e], points.starts[node]);
            if mesh.is_replaced(element, element.at(mesh::point(e as u32, k as u32))) {
                return (Vec::new(), false);
            }
            let normal = element.normal.as_vec3();
            let (mut met, mut is_lit) = (Vec::with_capacity(rays.len()), false);
            for dir in directions(normal, rays.clone(), rng::key(&[node as u64, 0x6578_706F])) {
                is_lit |= points.seen(world, mesh, from, dir, |other| {
                    let to = points.starts[other];
                    let faces = elements[other / POINTS].normal.as_vec3().dot(from - to) > 0.0 && normal.dot(to - from) > 0.0;
                    if faces && is_free(world, from, to) {
                        met.push(other as u32);
                    }
                });
            }
            (met, is_lit || direct.reaches(&point_of(world, mesh, e, k).0, normal))
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
        // A contact line crosses it: the other points, exposed when they see one that is.
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
        sees |=
            points.seen(world, mesh, from, dir, |other| sees |= is_exposed[other] && is_free(world, from, points.starts[other]));
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

/// The points of all elements.
struct Points {
    /// Where rays leave them.
    starts: Vec<Vec3>,
    /// By element and stratum: its point there.
    of_strata: Vec<[u8; POINTS]>,
}

impl Points {
    fn new(world: &World, mesh: &ElementMesh) -> Self {
        let n = mesh.elements().len();
        let start = |node: usize| point_of(world, mesh, node / POINTS, node % POINTS).1;
        let of_strata = |e: usize| {
            let mut points = [0; POINTS];
            (0..POINTS).for_each(|k| points[stratum(mesh::point(e as u32, k as u32))] = k as u8);
            points
        };
        Self {
            starts: (0..n * POINTS).into_par_iter().map(start).collect(),
            of_strata: (0..n).into_par_iter().map(of_strata).collect(),
        }
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
        Some(element as usize * POINTS + usize::from(self.of_strata[element as usize][here]))
    }
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
