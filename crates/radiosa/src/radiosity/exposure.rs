//! How much of an element light can reach.
//!
//! A box on a floor covers a part of it. What is covered is dark, sends nothing and must not count: the radiosity of an element that a contact line crosses is that
//! of the part in the open, or the floor would darken around everything that stands on it. Exchange areas need no care (rays from covered points are
//! blocked); what has to be known is the exposed area they are divided by.
//!
//! Points of all elements are joined to groups when a ray between them is free. A point is exposed when a source of light is in its group, or when it
//! sees out of the scene: what is covered is shut in. The points are those visibility is decided by ([`mesh::Element::exposes`]), so that exchange areas and
//! exposed areas err together.

use rayon::prelude::*;

use super::direct::DirectLight;
use super::groups;
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
/// Rays from each point that look for others.
const RAYS: u32 = 6;

/// The points of every element that light may reach, as bits.
pub(super) fn exposed(world: &World, mesh: &ElementMesh, direct: &DirectLight) -> Vec<u64> {
    let elements = mesh.elements();
    let n = elements.len() * POINTS;
    if elements.len() > MOST {
        return vec![!0; elements.len()];
    }
    let starts: Vec<Vec3> = (0..n).into_par_iter().map(|node| point_of(world, mesh, node / POINTS, node % POINTS).1).collect();
    let found: Vec<(Vec<u32>, bool)> = (0..n)
        .into_par_iter()
        .map(|node| {
            let (e, k) = (node / POINTS, node % POINTS);
            let (element, from) = (&elements[e], starts[node]);
            if mesh.is_replaced(element, element.at(mesh::point(e as u32, k as u32))) {
                return (Vec::new(), false);
            }
            let normal = element.normal.as_vec3();
            let mut met = Vec::with_capacity(RAYS as usize);
            let mut is_lit = mesh.patches()[element.patch as usize].emits(world, element.side);
            for dir in directions(normal, RAYS, rng::key(&[node as u64, 0x6578_706F])) {
                is_lit |= seen(world, mesh, from, dir, |other| {
                    let to = starts[other];
                    let faces = elements[other / POINTS].normal.as_vec3().dot(from - to) > 0.0 && normal.dot(to - from) > 0.0;
                    if faces && is_free(world, from, to) {
                        met.push(other as u32);
                    }
                });
            }
            (met, is_lit || direct.reaches(&point_of(world, mesh, e, k).0, normal))
        })
        .collect();
    let mut found = found;
    for (hit, surface, dir) in direct.landings() {
        if let Some(node) = node_at(mesh, &hit, surface.p, dir) {
            found[node].1 = true;
        }
    }
    let is_exposed = groups::lit(&found);
    let of_element = |e: usize| {
        let first: u64 = (0..POINTS).filter(|k| is_exposed[e * POINTS + k]).map(|k| 1 << k).sum();
        if first == 0 {
            return 0;
        }
        if first.count_ones() == POINTS as u32 {
            return !0;
        }
        // A contact line crosses it: the other points, exposed when they see one that is.
        let sees = |k: &usize| sees_exposed(world, mesh, (e, *k), (&starts, &is_exposed), direct);
        (POINTS..mesh::POINTS).filter(sees).map(|k| 1u64 << k).fold(first, |bits, bit| bits | bit)
    };
    (0..elements.len()).into_par_iter().map(of_element).collect()
}

/// An additional point of an element sees out of the scene, a light, or a point that is exposed.
fn sees_exposed(
    world: &World,
    mesh: &ElementMesh,
    (e, k): (usize, usize),
    (starts, is_exposed): (&[Vec3], &[bool]),
    direct: &DirectLight,
) -> bool {
    let normal = mesh.elements()[e].normal.as_vec3();
    if mesh.is_replaced(&mesh.elements()[e], mesh.elements()[e].at(mesh::point(e as u32, k as u32))) {
        return false;
    }
    let (surface, from) = point_of(world, mesh, e, k);
    let mut directions = directions(normal, 2 * RAYS, rng::key(&[e as u64, k as u64, 0x6D6F_7265]));
    let sees = directions.any(|dir| {
        let mut sees = false;
        sees |= seen(world, mesh, from, dir, |other| sees |= is_exposed[other] && is_free(world, from, starts[other]));
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
fn directions(normal: Vec3, n: u32, key: u64) -> impl Iterator<Item = Vec3> {
    let frame = Frame::from_normal(normal);
    (0..n).map(move |i| frame.to_world(warp::cosine_hemisphere(sequence::point_2d(i, key))))
}

/// What a ray meets, also behind what is transparent: the nearest points of elements; and whether it leaves the scene.
fn seen(world: &World, mesh: &ElementMesh, from: Vec3, dir: Vec3, mut point: impl FnMut(usize)) -> bool {
    world.each_met(&Ray::new(from, dir), |hit, surface| {
        if let Some(node) = node_at(mesh, hit, surface.p, dir) {
            point(node);
        }
    })
}

/// The point whose stratum a hit falls into.
fn node_at(mesh: &ElementMesh, hit: &Hit, p: Vec3, dir: Vec3) -> Option<usize> {
    let (element, w) = mesh.weights_at(hit, p, dir)?;
    let stratum = |at: [f64; 2]| at.map(|x| ((x * SIDE as f64) as usize).min(SIDE - 1));
    let here = stratum(mesh.elements()[element as usize].square_of(w).map(f64::from));
    let k = (0..POINTS).find(|&k| stratum(mesh::point(element, k as u32)) == here)?;
    Some(element as usize * POINTS + k)
}

/// Nothing opaque lies between.
fn is_free(world: &World, from: Vec3, to: Vec3) -> bool {
    let ray = Ray { origin: from, dir: to - from, t_max: 1.0 };
    !world.transmittances(&[ray; 8], 1, Passage::STRAIGHT, &mut 0)[0].is_black()
}
