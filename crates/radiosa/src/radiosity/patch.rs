//! Patches: the planar surfaces of a scene, quadrilaterals where they can be had.
//!
//! Quadrilaterals come from source n-gons first, then from coplanar pairs of triangles that share their longest edge; what is left stays a
//! triangle. A quadrilateral is divided into a regular grid of elements, which a triangle's are not.

use std::collections::HashMap;

use super::sides::Side;
use crate::accel::Hit;
use crate::math::polygon::{area_vector, bilinear};
use crate::math::{DVec3, Vec3};
use crate::scene::{Geometry, InstanceId, MaterialId, Mesh};
use crate::transport::World;

/// Corners may leave a quadrilateral's plane by this fraction of its size, and pairs of triangles count as coplanar when they do not more.
const FLAT: f64 = 1e-5;

/// A planar convex surface of one material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Patch {
    /// Which instance it is part of.
    pub instance: InstanceId,
    /// The triangles it consists of; twice the same where it is one.
    pub triangles: [u32; 2],
    /// What it is made of.
    pub material: Option<MaterialId>,
    /// Counter-clockwise seen from the front, world coordinates; the last repeats the third in a triangle.
    corners: [DVec3; 4],
    is_quad: bool,
    /// Twice the area vector.
    front: DVec3,
    /// The gradients of the parameters; none where they do not grow linearly over the patch.
    gradients: Option<[DVec3; 2]>,
}

/// The patches of a world, and which of them each triangle belongs to.
#[derive(Clone, Debug, Default)]
pub struct Patches {
    /// In the order of the scene.
    pub patches: Vec<Patch>,
    /// First entry of each instance in `of_triangle`.
    first: Vec<u32>,
    /// Patch of each triangle; [`NONE`] for those without area.
    of_triangle: Vec<u32>,
}

/// No patch.
const NONE: u32 = u32::MAX;

impl Patch {
    /// Of three or four corners, the last of four the third of three.
    fn new(instance: InstanceId, triangles: [u32; 2], material: Option<MaterialId>, corners: [DVec3; 4], is_quad: bool) -> Self {
        let [a, b, c, d] = corners;
        let [e, f] = [b - a, if is_quad { d - a } else { c - a }];
        let n = e.cross(f);
        let is_linear = !is_quad || (a - b + c - d).length() <= LINEAR * e.length().min(f.length());
        let gradients = [f.cross(n), n.cross(e)].map(|g| g / n.length_squared());
        let is_known = is_linear && gradients.iter().all(|g| g.is_finite());
        let gradients = is_known.then_some(gradients);
        Self { instance, triangles, material, corners, is_quad, front: front(corners, is_quad), gradients }
    }

    /// Three or four, counter-clockwise seen from the front, world coordinates.
    pub fn corners(&self) -> &[DVec3] {
        &self.corners[..if self.is_quad { 4 } else { 3 }]
    }

    /// It has four corners.
    pub fn is_quad(&self) -> bool {
        self.is_quad
    }

    /// m²
    pub fn area(&self) -> f64 {
        area_vector(self.corners()).length()
    }

    /// Its material emits on that side.
    pub(super) fn emits(&self, world: &World, side: Side) -> bool {
        let material = world.material(self.material);
        material.is_emissive() && (side == Side::Front || material.two_sided)
    }

    /// The point of parameters `(s, t)`: bilinear in a quadrilateral; in a triangle they are the weights of its second and third corner.
    pub fn at(&self, [s, t]: [f64; 2]) -> DVec3 {
        if self.is_quad {
            return bilinear(self.corners, [s, t]);
        }
        let [a, b, c, _] = self.corners;
        a + (b - a) * s + (c - a) * t
    }

    /// The parameters of a point of the patch, up to rounding; within their range wherever the point is.
    pub fn parameters(&self, p: DVec3) -> [f64; 2] {
        let Some(gradients) = self.gradients else { return parameters(self.corners, self.is_quad, p) };
        let [s, t] = gradients.map(|g| g.dot(p - self.corners[0]).clamp(0.0, 1.0));
        let over = if self.is_quad { 1.0 } else { (s + t).max(1.0) };
        [s / over, t / over]
    }
}

/// A quadrilateral is a parallelogram when it closes to this part of its shorter edge.
const LINEAR: f64 = 1e-9;

/// Twice the area vector.
fn front([a, b, c, d]: [DVec3; 4], is_quad: bool) -> DVec3 {
    if is_quad { (c - a).cross(d - b) } else { (b - a).cross(c - a) }
}

/// The parameters of a point of a quadrilateral or triangle as [`Patch::at`] takes them.
pub(super) fn parameters([a, b, c, d]: [DVec3; 4], is_quad: bool, p: DVec3) -> [f64; 2] {
    // Signed areas in the plane of two axes that the patch covers best, from which nothing but ratios are used.
    let n = front([a, b, c, d], is_quad).abs();
    let [i, j] = if n.x >= n.y.max(n.z) {
        [1, 2]
    } else if n.y >= n.z {
        [2, 0]
    } else {
        [0, 1]
    };
    let cross = |u: DVec3, v: DVec3| u[i] * v[j] - u[j] * v[i];
    let (x, e) = (p - a, b - a);
    if !is_quad {
        let whole = cross(e, c - a);
        let (s, t) = ((cross(x, c - a) / whole).clamp(0.0, 1.0), (cross(e, x) / whole).clamp(0.0, 1.0));
        let over = (s + t).max(1.0);
        return [s / over, t / over];
    }
    // p = a + s e + t f + s t g: eliminating s leaves a quadratic equation for t.
    let (f, g) = (d - a, a - b + c - d);
    let (k2, k1, k0) = (cross(g, f), cross(e, f) + cross(x, g), cross(x, e));
    // (k2 t² + k1 t + k0 = 0, from (x − t f) × (e + t g) = 0)
    let discriminant = (k1 * k1 - 4.0 * k2 * k0).max(0.0).sqrt();
    let q = -0.5 * (k1 + if k1 < 0.0 { -discriminant } else { discriminant });
    let roots = [k0 / q, q / k2];
    let outside = |t: f64| if t.is_finite() { (t - 0.5).abs() } else { f64::INFINITY };
    let t = if outside(roots[0]) <= outside(roots[1]) { roots[0] } else { roots[1] };
    let t = if t.is_finite() { t.clamp(0.0, 1.0) } else { 0.5 };
    let along = e + g * t;
    let s = (x - f * t).dot(along) / along.length_squared();
    [if s.is_finite() { s.clamp(0.0, 1.0) } else { 0.5 }, t]
}

impl Patches {
    /// The patches of every mesh of a world. Exact spheres and discs have none: [`super::tessellate`] makes them meshes.
    pub fn new(world: &World) -> Self {
        let mut all = Self::default();
        let scene = world.scene();
        for (i, instance) in scene.instances.iter().enumerate() {
            all.first.push(all.of_triangle.len() as u32);
            let Geometry::Mesh(id) = instance.geometry else { continue };
            let mesh = &scene.meshes[id.index()];
            let id = InstanceId(i as u32);
            let position = |v: u32| instance.transform.transform_point3(mesh.positions[v as usize]) - world.origin();
            let mirrored = world.is_mirrored(id);
            let first = all.of_triangle.len();
            all.of_triangle.resize(first + mesh.triangles.len(), NONE);
            let materials: Vec<_> = (0..mesh.triangles.len() as u32).map(|t| scene.material_of(id, t)).collect();
            let mut taken = vec![false; mesh.triangles.len()];
            let mut add = |triangles: [u32; 2], corners: &[DVec3]| {
                let mut c = [corners[0], corners[1], corners[2], corners[corners.len() - 1]];
                if mirrored {
                    c[..corners.len()].reverse();
                    c[3] = c[corners.len() - 1];
                }
                let patch = Patch::new(id, triangles, materials[triangles[0] as usize], c, corners.len() == 4);
                for t in triangles {
                    all.of_triangle[first + t as usize] = all.patches.len() as u32;
                }
                all.patches.push(patch);
            };
            // In the order of their first triangles, as the file has them.
            let mut pairs = pairs(mesh, &materials, &position).into_iter().peekable();
            for (t, triangle) in mesh.triangles.iter().enumerate() {
                if let Some((triangles, corners)) = pairs.next_if(|(of, _)| of[0].min(of[1]) as usize == t) {
                    triangles.iter().for_each(|&t| taken[t as usize] = true);
                    add(triangles, &corners);
                } else if !taken[t] {
                    let corners = triangle.map(position);
                    if area_vector(&corners).length() > 0.0 {
                        add([t as u32; 2], &corners);
                    }
                }
            }
        }
        all
    }

    /// The patch a triangle belongs to; `None` for one without area and for exact shapes.
    pub fn of_triangle(&self, instance: InstanceId, triangle: u32) -> Option<u32> {
        let at = self.first[instance.index()] as usize + triangle as usize;
        self.of_triangle.get(at).copied().filter(|&p| p != NONE)
    }

    /// The patch a ray of direction `dir` met, and from which side; `None` for what has no patches.
    pub(super) fn side_at(&self, hit: &Hit, dir: Vec3) -> Option<(u32, Side)> {
        let index = self.of_triangle(InstanceId(hit.instance), hit.primitive)?;
        Some((index, if self.patches[index as usize].front.dot(dir.as_dvec3()) <= 0.0 { Side::Front } else { Side::Back }))
    }
}

/// A quadrilateral and the two triangles that make it.
type Pair = ([u32; 2], [DVec3; 4]);

/// The pairs of triangles that make quadrilaterals, in the order of their first triangles.
fn pairs(mesh: &Mesh, materials: &[Option<MaterialId>], position: &impl Fn(u32) -> DVec3) -> Vec<Pair> {
    // By edge in either direction: the triangles whose longest edge it is, and the position of the corner opposite.
    let mut by_diagonal: HashMap<[[u64; 3]; 2], u32> = HashMap::new();
    let key = |p: DVec3| (p + DVec3::ZERO).to_array().map(f64::to_bits);
    let mut found: Vec<Pair> = Vec::new();
    let mut taken = vec![false; mesh.triangles.len()];
    let of_polygon = |t: usize| mesh.polygons.as_ref().map(|_| mesh.polygon_of(t as u32));
    // Source quadrilaterals, whatever their diagonal.
    if let Some(polygons) = &mesh.polygons {
        let mut members: HashMap<u32, Vec<u32>> = HashMap::new();
        for (t, &p) in polygons.of_triangle.iter().enumerate() {
            members.entry(p).or_default().push(t as u32);
        }
        for (t, &p) in polygons.of_triangle.iter().enumerate() {
            let range = polygons.offsets[p as usize] as usize..polygons.offsets[p as usize + 1] as usize;
            let [first, second] = members[&p][..] else { continue };
            if range.len() != 4 || first as usize != t {
                continue;
            }
            let corners: [DVec3; 4] = std::array::from_fn(|i| position(polygons.vertices[range.start + i]));
            if is_flat_and_convex(&corners) {
                taken[first as usize] = true;
                taken[second as usize] = true;
                found.push(([first, second], corners));
            }
        }
    }
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        let c = triangle.map(position);
        if taken[t] || area_vector(&c).length() <= 0.0 {
            continue;
        }
        let longest = (0..3).max_by(|&i, &j| edge(&c, i).total_cmp(&edge(&c, j)).then(j.cmp(&i))).unwrap_or(0);
        let [a, b, opposite] = std::array::from_fn(|i| c[(longest + i) % 3]);
        let (ka, kb) = (key(a), key(b));
        // The neighbour runs along the edge the other way.
        if let Some(&other) = by_diagonal.get(&[kb, ka]).filter(|&&other| !taken[other as usize]) {
            let across = mesh.triangles[other as usize].map(position);
            let Some(&far) = across.iter().find(|&&p| key(p) != ka && key(p) != kb) else { continue };
            let corners = [opposite, a, far, b];
            let same = materials[t] == materials[other as usize]
                && of_polygon(t).is_none_or(|p| Some(p) == of_polygon(other as usize) || is_flat_and_convex(&corners));
            if same && is_flat_and_convex(&corners) {
                taken[t] = true;
                taken[other as usize] = true;
                found.push(([other, t as u32], corners));
                continue;
            }
        }
        by_diagonal.insert([ka, kb], t as u32);
    }
    found.sort_by_key(|(triangles, _)| triangles[0].min(triangles[1]));
    found
}

fn edge(c: &[DVec3; 3], i: usize) -> f64 {
    (c[(i + 1) % 3] - c[i]).length_squared()
}

/// All corners in one plane and turning the same way, none of them straight.
fn is_flat_and_convex(c: &[DVec3; 4]) -> bool {
    let n = area_vector(c);
    let area = n.length();
    let size = (c[2] - c[0]).length().max((c[3] - c[1]).length());
    if area <= 1e-9 * size * size {
        return false;
    }
    let n = n / area;
    let middle = (c[0] + c[1] + c[2] + c[3]) * 0.25;
    (0..4).all(|i| {
        let (before, here, after) = (c[(i + 3) % 4], c[i], c[(i + 1) % 4]);
        let turn = (here - before).cross(after - here).dot(n);
        turn > 1e-3 * (here - before).length() * (after - here).length() && (here - middle).dot(n).abs() <= FLAT * size
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_are_the_inverse_of_points() {
        let patch =
            |corners: [[f64; 3]; 4], is_quad| Patch::new(InstanceId(0), [0, 1], None, corners.map(DVec3::from_array), is_quad);
        let quad = |corners| patch(corners, true);
        let shapes = [
            quad([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]),
            quad([[0.0, 0.0, 2.0], [2.0, 0.0, 2.0], [1.5, 1.0, 2.0], [0.25, 0.5, 2.0]]),
            quad([[1.0, 0.0, 0.0], [1.0, 2.0, 0.0], [1.0, 2.0, 1.0], [1.0, 0.0, 3.0]]),
            patch([[0.0, 0.0, 0.0], [1.0, 0.0, 1.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0]], false),
        ];
        for patch in shapes {
            for i in 0..=8 {
                for j in 0..=8 {
                    let (s, t) = (f64::from(i) / 8.0, f64::from(j) / 8.0);
                    if !patch.is_quad() && s + t > 1.0 {
                        continue;
                    }
                    let [u, v] = patch.parameters(patch.at([s, t]));
                    assert!((u - s).abs() < 1e-12 && (v - t).abs() < 1e-12, "({s}, {t}) came back as ({u}, {v})");
                }
            }
        }
    }
}
