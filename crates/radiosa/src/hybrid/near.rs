//! How near elements, and pools of small ones, may be taken as a whole.

use rayon::prelude::*;

use super::gather::FinalGather;
use super::settle::MOST;
use crate::math::{Frame, Ray};
use crate::radiosity::mesh::{self, ElementMesh, POINTS};
use crate::radiosity::solve::pools::Pools;
use crate::sampling::{rng, sequence, warp};
use crate::spectrum::Spectrum;
use crate::transport::World;

/// A hit nearer than this many times the side of its element is looked at closely; where light varies among its neighbours, up to the second.
const NEAR: [f32; 2] = [1.0, 4.0];
/// Elements of which less than this is free of others are always looked at closely: the few points that stand for them say little.
const KNOWN: f64 = 0.25;
/// So are those of whose rays, of so many, more than half meet something nearer than their side: light enters narrow places at their ends, and whoever looks in sees
/// one end better than the other.
const PROBES: u32 = 16;
/// Small elements share their light where elements are many more than wanted ([`FinalGather::POOLED`]), or than so many,
const WANTED: u32 = 1000;
/// in cells no larger than for so many elements;
const CELLS: u32 = 4000;
/// and the distance from which such a pool is taken as a whole: in roots of its area, but no more than a cell.
const NEAR_POOL: f32 = 2.0;

impl FinalGather<'_> {
    /// Elements for each that was wanted, from which on small ones have their light in common.
    pub const POOLED: u32 = 4;
}

/// Pools for a solution that is to be found.
pub(super) fn pools(mesh: &ElementMesh) -> Pools {
    let wanted = mesh.record().settings.elements;
    Pools::with(mesh, FinalGather::POOLED as usize * wanted.max(WANTED) as usize, f64::from(wanted.max(CELLS)))
}

/// Which pools are always looked at closely: single elements that little is known of. (Of more than 2¹⁸ only those that others cover: elements are small there.)
pub(super) fn narrow(world: &World, mesh: &ElementMesh, pools: &Pools, seed: u64) -> Vec<bool> {
    let key = |i: u32| rng::key(&[seed, u64::from(i), 0x6E61_7272_6F77]);
    let is_narrow = |p: usize| {
        let [i] = *pools.members(p) else { return false };
        mesh.elements()[i as usize].exposed() < KNOWN || pools.n() <= MOST && is_between_others(world, mesh, i, key(i))
    };
    (0..pools.n()).into_par_iter().map(is_narrow).collect()
}

fn is_between_others(world: &World, mesh: &ElementMesh, i: u32, key: u64) -> bool {
    let element = &mesh.elements()[i as usize];
    if !(element.normal.is_finite() && element.area > 0.0) {
        return false;
    }
    let (frame, side) = (Frame::from_normal(element.normal.as_vec3()), element.area.sqrt() as f32);
    let exposed: Vec<u32> = (0..POINTS as u32).filter(|&k| element.exposes(k as usize)).collect();
    let meets = |ray: &u32| {
        let k = exposed[*ray as usize * exposed.len() / PROBES as usize];
        let dir = frame.to_world(warp::cosine_hemisphere(sequence::point_2d(*ray, key)));
        let ray = mesh.surface(world, element, mesh::point(i, k)).ray(dir);
        world.accel().occluded(&Ray { t_max: side, ..ray })
    };
    !exposed.is_empty() && 2 * (0..PROBES).filter(meets).count() > PROBES as usize
}

/// How near each pool may be taken as a whole: nearer where the light of its neighbours is like its own, never where it is `narrow`.
pub(super) fn near(mesh: &ElementMesh, pools: &Pools, narrow: &[bool], irradiance: &[Spectrum]) -> Vec<f32> {
    let of = |i: u32| irradiance[pools.of_element(i as usize) as usize].luminance();
    let single = |i: u32| {
        let element = &mesh.elements()[i as usize];
        let own = of(i);
        let step = mesh
            .neighbours(element)
            .map(|j| (of(j as u32) - own).abs() / of(j as u32).max(own).max(f32::MIN_POSITIVE))
            .fold(0.0, f32::max);
        let times = NEAR[0] + (NEAR[1] - NEAR[0]) * (2.0 * step).min(1.0);
        element.area.sqrt() as f32 * times
    };
    let pool = |p: usize| match pools.members(p) {
        _ if narrow[p] => f32::INFINITY,
        [only] => single(*only),
        _ => (NEAR_POOL * pools.area(p).sqrt() as f32).min(pools.size() as f32),
    };
    (0..pools.n()).map(pool).collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::import::load_bytes;
    use crate::math::CpuPath;
    use crate::math::Vec3;
    use crate::radiosity::{Division, Settings, Solution};

    /// Two rooms with a wall of 4 cm between them, in which a slit of 2 cm is open from floor to ceiling; a lamp in one.
    const ROOMS: &str = r#"
[material.walls]
lambert = 0.7
[material.lamp]
lambert = 0
emission = 10
[[shape]]
material = "walls"
box = { min = [0, 0, 0], max = [4, 2.5, 3], inward = true }
[[shape]]
material = "walls"
box = { min = [2, 0, 0], max = [2.04, 2.5, 1.49] }
[[shape]]
material = "walls"
box = { min = [2, 0, 1.51], max = [2.04, 2.5, 3] }
[[shape]]
material = "lamp"
quad = [[0.7, 2.48, 1.2], [1.3, 2.48, 1.2], [1.3, 2.48, 1.8], [0.7, 2.48, 1.8]]
"#;
    /// Places in the other room that see neither the lamp nor its wall, and normals; and the sum of their irradiances by 8 million paths from each, whose standard error
    /// is 0.17 %.
    const DARK: [[Vec3; 2]; 5] = [
        [Vec3::new(3.5, 0.0, 0.5), Vec3::Y],
        [Vec3::new(3.0, 2.5, 1.0), Vec3::NEG_Y],
        [Vec3::new(4.0, 1.2, 0.5), Vec3::NEG_X],
        [Vec3::new(4.0, 0.5, 2.8), Vec3::NEG_X],
        [Vec3::new(2.5, 1.0, 0.0), Vec3::Z],
    ];
    const SUM: f32 = 0.012_784;

    #[test]
    fn light_through_a_slit_is_not_its_sides_mean() {
        let scene = load_bytes(ROOMS.as_bytes(), Path::new("rooms.toml"), &Default::default()).expect("a scene").0;
        let world = World::prepare(scene, CpuPath::detect()).expect("it is valid");
        let settings = Settings::default();
        let solution = Solution::to_be_found(&world, Division::new(&world, &settings), &settings);
        let off = |is_twin: bool, seed: u64| -> f32 {
            let mut gather = FinalGather::new(&world, &solution, &[], seed);
            let n_narrow = gather.narrow.iter().filter(|is| **is).count();
            assert!((1..solution.mesh.elements().len() / 4).contains(&n_narrow), "{n_narrow}");
            if is_twin {
                gather.narrow.fill(false);
            }
            let gather = gather.settled(256, &|| false);
            let at = |(k, [p, n]): (usize, &[Vec3; 2])| {
                let ray = Ray::new(*p + *n * 0.01 - world.origin().as_vec3(), -*n);
                let surface = world.closest_visible(&ray).expect("a wall").1;
                gather.sensor(&surface, *n, [1 << 16, 1 << 14], k as u64).irradiance.g
            };
            DARK.par_iter().enumerate().map(at).sum::<f32>() / SUM - 1.0
        };
        // (Of one seed up to 3 %: few rays find the slit.)
        let [of, twin] = [false, true].map(|is_twin| (0..4).map(|seed| off(is_twin, seed)).sum::<f32>() / 4.0);
        assert!(of.abs() < 0.02, "{of}, where sides are taken as a whole {twin}");
        assert!(twin > 0.03, "{twin}");
    }
}
