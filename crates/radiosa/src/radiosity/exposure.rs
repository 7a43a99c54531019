//! How much of an element light can reach.
//!
//! A box on a floor covers a part of it. What is covered is dark, sends nothing and must not count: the radiosity of an element that a contact line crosses is that
//! of the part in the open, or the floor would darken around everything that stands on it. Exchange areas need no care (rays from covered points are
//! blocked); what has to be known is the exposed area they are divided by.
//!
//! Points of all elements are joined to groups when a ray between them is free. A point is exposed when a source of light is in its group, or when it
//! sees out of the scene: what is covered is shut in.

use rayon::prelude::*;

use super::direct::DirectLight;
use super::mesh::{Element, ElementMesh};
use crate::accel::Hit;
use crate::math::{Frame, Ray, Vec3};
use crate::sampling::{rng, sequence, warp};
use crate::transport::World;

/// Points of an element along each side of its unit square.
const SIDE: usize = 4;
/// Points of an element.
const POINTS: usize = SIDE * SIDE;
/// Additional points of an element that is exposed in part.
const MORE: u32 = 112;
/// Rays from each point that look for others.
const RAYS: u32 = 6;

/// The fraction of every element that light may reach, in `[0, 1]`.
pub(super) fn exposed(world: &World, mesh: &ElementMesh, direct: &DirectLight, seed: u64) -> Vec<f32> {
    let elements = mesh.elements();
    let n = elements.len() * POINTS;
    if u32::try_from(n).is_err() {
        return vec![1.0; elements.len()];
    }
    let start = |e: usize, k: usize| start_of(world, mesh, &elements[e], e, k, seed);
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
                let key = rng::key(&[seed, (e * POINTS + k) as u64, 0x6578_706F]);
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
        let exposed = (0..POINTS).filter(|k| is_exposed[e * POINTS + k]).count();
        if exposed == 0 || exposed == POINTS {
            return exposed as f32 / POINTS as f32;
        }
        // A contact line crosses it: more points, exposed when they see one that is.
        let more = (0..MORE).filter(|&k| sees_exposed(world, mesh, (e, k), &is_exposed, direct, seed)).count();
        (exposed + more) as f32 / (POINTS as u32 + MORE) as f32
    };
    (0..elements.len()).into_par_iter().map(of_element).collect()
}

/// An additional point of an element sees out of the scene, a light, or a point that is exposed.
fn sees_exposed(
    world: &World,
    mesh: &ElementMesh,
    (e, k): (usize, u32),
    is_exposed: &[bool],
    direct: &DirectLight,
    seed: u64,
) -> bool {
    let element = &mesh.elements()[e];
    let normal = element.normal.as_vec3();
    let key = rng::key(&[seed, e as u64, 0x6D6F_7265]);
    let u = sequence::point_2d(k, key);
    let surface = mesh.surface(world, element, [f64::from(u.x), f64::from(u.y)]);
    let from = surface.ray(normal).origin;
    let frame = Frame::from_normal(normal);
    let directions = rng::mix(key ^ u64::from(k));
    let sees = (0..2 * RAYS).any(|i| {
        let dir = frame.to_world(warp::cosine_hemisphere(sequence::point_2d(i, directions)));
        let Some((hit, at)) = world.closest_visible(&Ray::new(from, dir)) else { return true };
        node_at(mesh, &hit, at.p, dir).is_some_and(|node| {
            let (_, to) = start_of(world, mesh, &mesh.elements()[node / POINTS], node / POINTS, node % POINTS, seed);
            is_exposed[node] && is_free(world, from, to)
        })
    });
    sees || direct.reaches(&surface, normal)
}

/// Point `k` of an element: the surface there and where rays leave it.
fn start_of(
    world: &World,
    mesh: &ElementMesh,
    element: &Element,
    e: usize,
    k: usize,
    seed: u64,
) -> (crate::transport::Surface, Vec3) {
    // Jittered within its stratum.
    let key = rng::mix(rng::key(&[seed, (e * POINTS + k) as u64]));
    let u = sequence::point_2d(0, key);
    let at = [(k % SIDE) as f64 + f64::from(u.x), (k / SIDE) as f64 + f64::from(u.y)].map(|x| x / SIDE as f64);
    let surface = mesh.surface(world, element, at);
    let from = surface.ray(element.normal.as_vec3()).origin;
    (surface, from)
}

/// The point whose stratum a hit falls into.
fn node_at(mesh: &ElementMesh, hit: &Hit, p: Vec3, dir: Vec3) -> Option<usize> {
    let (element, w) = mesh.weights_at(hit, p, dir)?;
    let e = &mesh.elements()[element as usize];
    let [s, t] = e.square_of(w);
    let cell = |x: f32| ((x * SIDE as f32) as usize).min(SIDE - 1);
    Some(element as usize * POINTS + cell(t) * SIDE + cell(s))
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
