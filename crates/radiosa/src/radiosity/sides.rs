//! Which sides of surfaces light can reach.
//!
//! A wall has two sides, and one of them usually faces nothing that matters: the outside of a room, the inside of a solid. Rays from random points of
//! every side tell which sides see each other, also through what is transparent; sides are joined to groups by that, and a group without any source of light is dropped. A group is
//! kept whole, so a gap that few rays find still joins what lies on both sides of it when one ray does. Rays from lamps tell what they light, however little
//! that is; for skies that are seen through little, large dark sides look again.

use super::direct::DirectLight;
use super::groups::Groups;
use super::mesh::surface_of;
use super::patch::{Patch, Patches};
use crate::accel::Hit;
use crate::math::polygon::area_vector;
use crate::math::{DVec3, Frame, Vec2};
use crate::sampling::{rng, sequence, warp};
use crate::scene::{AlphaMode, Model};
use crate::transport::{Surface, World};

/// Rays of one side, at least and at most.
const RAYS: [u32; 2] = [8, 256];

/// Rays by which most sides are joined to what is lit.
const FIRST: u32 = 2;
/// Rays of all sides, about.
const BUDGET: u32 = 1 << 21;

/// A side of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Side {
    /// From where corners run counter-clockwise.
    Front = 0,
    /// The other.
    Back = 1,
}

impl Side {
    /// Behind it.
    pub(super) fn other(self) -> Self {
        match self {
            Self::Front => Self::Back,
            Self::Back => Self::Front,
        }
    }
}

/// The same reflectance, emission and presence everywhere on a patch.
pub(super) fn is_constant(world: &World, patch: &Patch) -> bool {
    let material = world.material(patch.material);
    let scene = world.scene();
    let has_colors = match scene.instances[patch.instance.index()].geometry {
        crate::scene::Geometry::Mesh(id) => scene.meshes[id.index()].colors.is_some(),
        _ => false,
    };
    let base = match &material.model {
        Model::Phong(m) => m.diffuse.texture.is_none(),
        Model::CookTorrance(m) => m.diffuse.texture.is_none(),
        Model::MetallicRoughness(m) => m.base_color.texture.is_none() && m.metallic.texture.is_none(),
    };
    base && !has_colors && material.emission.texture.is_none() && material.alpha.mode == AlphaMode::Opaque
}

/// By patch and side: light may reach it.
pub(super) fn lit(world: &World, patches: &Patches, direct: &DirectLight) -> Vec<[bool; 2]> {
    let n = patches.patches.len();
    let rays = (BUDGET / (2 * n as u32).max(1)).clamp(RAYS[0], RAYS[1]);
    let mut groups = Groups::new(2 * n);
    for (hit, _, dir) in direct.landings() {
        if let Some((patch, side)) = patches.side_at(&hit, dir) {
            groups.light(2 * patch as usize + side as usize);
        }
    }
    for rays in [0..FIRST, FIRST..RAYS[0], RAYS[0]..rays] {
        groups.look(|node| {
            let patch = &patches.patches[node / 2];
            let side = if node.is_multiple_of(2) { Side::Front } else { Side::Back };
            let normal = normal_of(patches, node).normalize_or_zero();
            if normal == DVec3::ZERO {
                return (Vec::new(), false);
            }
            let mut is_lit = patch.emits(world, side);
            let frame = Frame::from_normal(normal.as_vec3());
            let (mut met, key) = (Vec::new(), rng::key(&[node as u64, 0x7369_6465]));
            for i in rays.clone() {
                let surface = surface_of(world, patch, inside(patch, sequence::point_2d(i, key)), normal);
                let dir = frame.to_world(warp::cosine_hemisphere(sequence::point_2d(i, key ^ 1)));
                let meets =
                    |hit: &Hit, _: &Surface| met.extend(patches.side_at(hit, dir).map(|(other, side)| 2 * other + side as u32));
                is_lit |= world.each_met(&surface.ray(dir), meets) && direct.has_sky();
                if !is_lit && (FIRST..32).contains(&i) {
                    is_lit = direct.reaches(&surface, normal.as_vec3());
                }
            }
            met.sort_unstable();
            met.dedup();
            (met, is_lit)
        });
    }
    if direct.has_sky() {
        look_for_sky(world, patches, &mut groups);
    }
    (0..n).map(|patch| [groups.is_lit(2 * patch), groups.is_lit(2 * patch + 1)]).collect()
}

/// Twice the area vector of a side.
fn normal_of(patches: &Patches, node: usize) -> DVec3 {
    area_vector(patches.patches[node / 2].corners()) * if node.is_multiple_of(2) { 1.0 } else { -1.0 }
}

/// Sides that are dark so far send out more rays for a sky, the larger the more.
fn look_for_sky(world: &World, patches: &Patches, groups: &mut Groups) {
    let is_dark = |node: &usize| !groups.is_lit(*node) && normal_of(patches, *node) != DVec3::ZERO;
    let area: f64 = (0..2 * patches.patches.len()).filter(is_dark).map(|node| normal_of(patches, node).length()).sum();
    groups.look(|node| {
        let (patch, normal) = (&patches.patches[node / 2], normal_of(patches, node));
        let rays = (f64::from(BUDGET / 4) * normal.length() / area) as u32;
        let (unit, key) = (normal.normalize_or_zero(), rng::key(&[node as u64, 0x736B_7961]));
        let frame = Frame::from_normal(unit.as_vec3());
        let sees_out = (0..rays).any(|i| {
            let [at, u] = sequence::point_4d(i, key);
            let surface = surface_of(world, patch, inside(patch, at), unit);
            world.each_met(&surface.ray(frame.to_world(warp::cosine_hemisphere(u))), |_, _| {})
        });
        (Vec::new(), sees_out)
    });
}

/// A point of a patch, uniform for triangles and parallelograms.
fn inside(patch: &Patch, u: Vec2) -> DVec3 {
    let (s, t) = (f64::from(u.x), f64::from(u.y));
    patch.at(if patch.is_quad() || s + t <= 1.0 { [s, t] } else { [1.0 - s, 1.0 - t] })
}
