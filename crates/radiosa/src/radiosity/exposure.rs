//! How much of an element light can reach.
//!
//! A box on a floor covers a part of it. What is covered is dark, sends nothing and must not count: the radiosity of an element that a contact line crosses is that
//! of the part in the open, or the floor would darken around everything that stands on it. Exchange areas need no care (rays from covered points are
//! blocked); what has to be known is the exposed area they are divided by.
//!
//! Points of all elements are joined to groups when a ray between them is free. A point is exposed when a source of light is in its group, or when it
//! sees out of the scene: what is covered is shut in. The points are those visibility is decided by ([`Element::exposes`]), so that exchange areas and
//! exposed areas err together.

use rayon::prelude::*;

use super::direct::DirectLight;
use super::mesh::{self, Element, ElementMesh};
use crate::accel::Hit;
use crate::math::{Frame, Ray, Vec3};
use crate::sampling::{rng, sequence, warp};
use crate::transport::{Surface, World};

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
    let start = |e: usize, k: usize| start_of(world, mesh, &elements[e], e, k);
    let found: Vec<(Vec<u32>, bool)> = (0..elements.len())
        .into_par_iter()
        .flat_map_iter(|e| {
            let element = &elements[e];
            let normal = element.normal.as_vec3();
            let frame = Frame::from_normal(normal);
            let emits = mesh.emits(world, element);
            (0..POINTS).map(move |k| {
                let (surface, from) = start(e, k);
                let mut met = Vec::with_capacity(RAYS as usize);
                let key = rng::key(&[(e * POINTS + k) as u64, 0x6578_706F]);
                let mut is_lit = emits;
                for i in 0..RAYS {
                    let dir = frame.to_world(warp::cosine_hemisphere(sequence::point_2d(i, key)));
                    match world.closest_visible(&Ray::new(from, dir)) {
                        None => is_lit = true,
                        Some((hit, at)) => {
                            if let Some(node) = node_at(mesh, &hit, at.p, dir) {
                                let (other, point) = (node / POINTS, node % POINTS);
                                let (_, to) = start(other, point);
                                let faces = elements[other].normal.as_vec3().dot(from - to) > 0.0 && normal.dot(to - from) > 0.0;
                                if faces && is_free(world, from, to) {
                                    met.push(node as u32);
                                }
                            }
                        }
                    }
                }
                if !is_lit {
                    is_lit = direct.reaches(&surface, normal);
                }
                (met, is_lit)
            })
        })
        .collect();
    let mut groups = Groups::new(n);
    for (node, (met, _)) in found.iter().enumerate() {
        met.iter().for_each(|&other| groups.join(node as u32, other));
    }
    let mut has_light = vec![false; n];
    for (node, (_, is_lit)) in found.iter().enumerate() {
        has_light[groups.root(node as u32) as usize] |= is_lit;
    }
    let is_exposed: Vec<bool> = (0..n).map(|node| has_light[groups.root_of(node as u32) as usize]).collect();
    let of_element = |e: usize| {
        let first: u64 = (0..POINTS).filter(|k| is_exposed[e * POINTS + k]).map(|k| 1 << k).sum();
        if first == 0 {
            return 0;
        }
        if first.count_ones() == POINTS as u32 {
            return !0;
        }
        // A contact line crosses it: the other points, exposed when they see one that is.
        let sees = |k: &usize| sees_exposed(world, mesh, (e, *k), &is_exposed, direct);
        (POINTS..mesh::POINTS).filter(sees).map(|k| 1u64 << k).fold(first, |bits, bit| bits | bit)
    };
    (0..elements.len()).into_par_iter().map(of_element).collect()
}

/// An additional point of an element sees out of the scene, a light, or a point that is exposed.
fn sees_exposed(world: &World, mesh: &ElementMesh, (e, k): (usize, usize), is_exposed: &[bool], direct: &DirectLight) -> bool {
    let element = &mesh.elements()[e];
    let normal = element.normal.as_vec3();
    let (surface, from) = start_of(world, mesh, element, e, k);
    let frame = Frame::from_normal(normal);
    let directions = rng::key(&[e as u64, k as u64, 0x6D6F_7265]);
    let sees = (0..2 * RAYS).any(|i| {
        let dir = frame.to_world(warp::cosine_hemisphere(sequence::point_2d(i, directions)));
        let Some((hit, at)) = world.closest_visible(&Ray::new(from, dir)) else { return true };
        node_at(mesh, &hit, at.p, dir).is_some_and(|node| {
            let (_, to) = start_of(world, mesh, &mesh.elements()[node / POINTS], node / POINTS, node % POINTS);
            is_exposed[node] && is_free(world, from, to)
        })
    });
    sees || direct.reaches(&surface, normal)
}

/// Point `k` of an element: the surface there and where rays leave it.
fn start_of(world: &World, mesh: &ElementMesh, element: &Element, e: usize, k: usize) -> (Surface, Vec3) {
    let surface = mesh.surface(world, element, mesh::point(e as u32, k as u32));
    let from = surface.ray(element.normal.as_vec3()).origin;
    (surface, from)
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
    !world.transmittances(&[ray; 8], 1, true, &mut 0)[0].is_black()
}

/// Sets that can be joined.
pub(super) struct Groups(Vec<u32>);

impl Groups {
    /// `n` sets of one member each.
    pub(super) fn new(n: usize) -> Self {
        Self((0..n as u32).collect())
    }

    /// The lowest member of the set, its path halved on the way.
    pub(super) fn root(&mut self, mut node: u32) -> u32 {
        while self.0[node as usize] != node {
            self.0[node as usize] = self.0[self.0[node as usize] as usize];
            node = self.0[node as usize];
        }
        node
    }

    /// The same without halving.
    pub(super) fn root_of(&self, mut node: u32) -> u32 {
        while self.0[node as usize] != node {
            node = self.0[node as usize];
        }
        node
    }

    /// Makes one set of two.
    pub(super) fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}
