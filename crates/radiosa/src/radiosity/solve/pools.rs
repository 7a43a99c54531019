//! Elements that share one irradiance: where a scene has far more triangles than its light has detail, small neighbours are one receiver and one sender.
//!
//! An element of its own for each of a million triangles would get its light from a ray now and then. Those smaller than a cell of space, whole patches each,
//! are pooled with others of the same instance and material that lie in that cell and face about the same way.

use std::collections::HashMap;

use super::super::mesh::{Element, ElementMesh};

/// Elements up to which each stands for itself.
const SINGLE: usize = 100_000;
/// Cells over the area of all elements, about: what decides about the size of cells.
const CELLS: f64 = 40_000.0;

/// Which elements belong together.
#[derive(Clone, Debug)]
pub struct Pools {
    /// By element.
    of: Vec<u32>,
    /// Pool `p` has the elements `members[starts[p]..starts[p + 1]]`.
    starts: Vec<u32>,
    members: Vec<u32>,
    /// By place in `members`: the area of all of the pool up to there.
    up_to: Vec<f64>,
    /// Of a cell of space, metres; zero where each element stands for itself.
    size: f64,
}

impl Pools {
    /// Of the elements of a mesh: the same for the same mesh.
    pub fn new(mesh: &ElementMesh) -> Self {
        Self::with(mesh, SINGLE, CELLS)
    }

    /// The same where there are more than `single` elements, with about `cells` of equal area.
    pub(crate) fn with(mesh: &ElementMesh, single: usize, cells: f64) -> Self {
        let elements = mesh.elements();
        if elements.len() <= single {
            return Self::of((0..elements.len() as u32).collect(), elements);
        }
        let size = (elements.iter().map(|e| e.area).sum::<f64>() / cells).sqrt();
        let (mut known, mut n) = (HashMap::new(), 0);
        let mut next = || {
            n += 1;
            n - 1
        };
        let pool = |element: &Element| {
            let is_small = element.area < size * size && mesh.n_on_side(element.patch as usize) == 1;
            if !is_small || !element.normal.is_finite() {
                return next();
            }
            let patch = &mesh.patches()[element.patch as usize];
            let place = (element.centre() / size).floor().as_i64vec3();
            // Each axis towards it, across it or away from it.
            let facing = (element.normal * 1.2).round().as_i64vec3();
            *known.entry((patch.instance, patch.material, place, facing)).or_insert_with(&mut next)
        };
        Self { size, ..Self::of(elements.iter().map(pool).collect(), elements) }
    }

    /// From the pool of each element.
    fn of(of: Vec<u32>, elements: &[Element]) -> Self {
        let n = of.iter().max().map_or(0, |&p| p as usize + 1);
        let mut starts = vec![0; n + 1];
        of.iter().for_each(|&p| starts[p as usize + 1] += 1);
        (0..n).for_each(|p| starts[p + 1] += starts[p]);
        let (mut next, mut members) = (starts.clone(), vec![0; of.len()]);
        for (i, &p) in of.iter().enumerate() {
            members[next[p as usize] as usize] = i as u32;
            next[p as usize] += 1;
        }
        let mut up_to: Vec<f64> = members.iter().map(|&i| elements[i as usize].area).collect();
        for pool in starts.windows(2) {
            (pool[0] as usize + 1..pool[1] as usize).for_each(|k| up_to[k] += up_to[k - 1]);
        }
        Self { of, starts, members, up_to, size: 0.0 }
    }

    /// How many there are.
    pub fn n(&self) -> usize {
        self.starts.len() - 1
    }

    /// The side of the cells of space that those of several elements lie in, metres.
    pub fn size(&self) -> f64 {
        self.size
    }

    /// Of all elements of a pool, m².
    pub fn area(&self, p: usize) -> f64 {
        self.up_to[self.starts[p + 1] as usize - 1]
    }

    /// Of how many elements.
    pub fn n_elements(&self) -> usize {
        self.of.len()
    }

    /// The pool of an element.
    pub fn of_element(&self, i: usize) -> u32 {
        self.of[i]
    }

    /// The element at a fraction of a pool's area, and the fraction of its own area that is left.
    pub fn at(&self, p: usize, fraction: f64) -> (u32, f64) {
        let range = self.starts[p] as usize..self.starts[p + 1] as usize;
        let up_to = &self.up_to[range.clone()];
        let [first, .., all] = up_to else { return (self.members[range.start], fraction) };
        let place = fraction * all;
        if place < *first {
            return (self.members[range.start], place / first);
        }
        let k = up_to.partition_point(|a| *a <= place).min(up_to.len() - 1);
        let width = up_to[k] - up_to[k - 1];
        let left = if width > 0.0 { ((place - up_to[k - 1]) / width).clamp(0.0, 1.0 - f64::EPSILON) } else { 0.5 };
        (self.members[range.start + k], left)
    }

    /// The elements of a pool, rising.
    pub fn members(&self, p: usize) -> &[u32] {
        &self.members[self.starts[p] as usize..self.starts[p + 1] as usize]
    }

    /// Means over the elements of every pool, by area.
    pub fn means(&self, area: &[f64], value: impl Fn(usize) -> [f64; 3]) -> Vec<[f64; 3]> {
        let mean = |p: usize| {
            let members = self.members(p);
            if let [only] = members {
                return value(*only as usize);
            }
            let (mut sum, mut all) = ([0.0; 3], 0.0);
            for (i, value) in members.iter().map(|&i| (i as usize, value(i as usize))) {
                (0..3).for_each(|c| sum[c] += area[i] * value[c]);
                all += area[i];
            }
            if all > 0.0 { sum.map(|s| s / all) } else { [0.0; 3] }
        };
        (0..self.n()).map(mean).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::CpuPath;
    use crate::radiosity::direct::DirectLight;
    use crate::radiosity::mesh::{Settings, Sides};
    use crate::transport::World;

    #[test]
    fn pools_hold_every_element_once_and_only_neighbours_that_face_the_same_way() {
        let mut scene = crate::import::sample::load("cornell-box").expect("it is built in");
        // A rug of many small squares.
        let mut rug = crate::scene::Mesh::default();
        for k in 0..400u32 {
            let corner = |i: u32| crate::math::DVec3::new(f64::from(k % 20 + i % 2), 0.1, f64::from(k / 20 + i / 2)) * 0.01;
            let first = rug.positions.len() as u32;
            rug.positions.extend((0..4).map(corner));
            rug.triangles.extend([[first, first + 2, first + 1], [first + 1, first + 2, first + 3]]);
        }
        scene.meshes.push(rug);
        let mut instance = scene.instances[0].clone();
        instance.geometry = crate::scene::Geometry::Mesh(crate::scene::MeshId(scene.meshes.len() as u32 - 1));
        instance.material = Some(crate::scene::MaterialId(0));
        scene.instances.push(instance);
        let world = World::prepare(scene, CpuPath::detect()).expect("it is valid");
        let settings = Settings { elements: 100, sides: Sides::Both, ..Settings::default() };
        let mesh = ElementMesh::new(&world, &settings, &DirectLight::new(&world, &[], 0));
        let (elements, n) = (mesh.elements(), mesh.elements().len());
        let single = Pools::with(&mesh, n, 100.0);
        assert_eq!((single.n(), single.members(7)), (n, &[7][..]));
        let pools = Pools::with(&mesh, 0, 2000.0);
        assert!(pools.n() < n - 300, "{} pools of {n} elements", pools.n());
        let mut all: Vec<u32> = (0..pools.n()).flat_map(|p| pools.members(p).to_vec()).collect();
        all.sort_unstable();
        assert!(all.iter().enumerate().all(|(i, &e)| i as u32 == e) && all.len() == n);
        let size = (elements.iter().map(|e| e.area).sum::<f64>() / 2000.0).sqrt();
        for p in 0..pools.n() {
            let first = &elements[pools.members(p)[0] as usize];
            for other in pools.members(p).iter().map(|&i| &elements[i as usize]) {
                assert!(other.normal.dot(first.normal) > 0.0 && (other.centre() - first.centre()).abs().max_element() < size);
                assert_eq!(pools.of_element(pools.members(p)[0] as usize), p as u32);
            }
        }
        // Every element has its part of its pool.
        for p in 0..pools.n() {
            let all: f64 = pools.members(p).iter().map(|&i| elements[i as usize].area).sum();
            let mut sum = 0.0;
            for &i in pools.members(p) {
                let (at, left) = pools.at(p, (sum + 0.25 * elements[i as usize].area) / all);
                assert!(at == i && (left - 0.25).abs() < 1e-6, "{at} at {left}, not {i}");
                sum += elements[i as usize].area;
            }
        }
        // Power is kept.
        let area: Vec<f64> = elements.iter().map(|e| e.area).collect();
        let value = |i: usize| [i as f64, 1.0, 0.0];
        let means = pools.means(&area, value);
        let of_pools: f64 = (0..n).map(|i| area[i] * means[pools.of_element(i) as usize][0]).sum();
        let of_elements: f64 = (0..n).map(|i| area[i] * value(i)[0]).sum();
        assert!((of_pools / of_elements - 1.0).abs() < 1e-12);
    }
}
