//! A face that is seen in a tile, ready to be interpolated.
//!
//! Perspective-correct interpolation [Olano97]: with the vertices in homogeneous picture coordinates `V_i = (x_i, y_i, w_i)`, the functions
//! `e_i(x, y) = (V_j × V_k)·(x, y, 1)/det(V)` are linear over the picture, and the barycentric weights are `b_i = e_i/Σ e`. It works for vertices
//! behind the eye as well, so clipped faces need no new attributes.

use super::surfaces::{Faces, Surfaces};
use crate::math::lanes::{Columns, Cpu, LANES, Lanes, V3, dot, eight, eight_mut, for_each_cpu, load3, splat3, xyz};
use crate::math::{CpuPath, DVec3, Vec2, Vec3, Vec4};
use crate::raster::Projection;
use crate::scene::{Geometry, InstanceId, MaterialId, Mesh, TextureRef};
use crate::transport::{Points, Surface, World};

/// One face.
#[derive(Clone, Debug)]
pub(super) struct Facet {
    /// By vertex: `e = a x + b y + c`, x and y in pixels from the corner of the tile.
    weights: [[f32; 3]; 3],
    positions: [Vec3; 3],
    /// At the vertices, on the front side, of any common length; `None` where the face is flat.
    normals: Option<[Vec3; 3]>,
    /// Unit, front.
    ng: Vec3,
    instance: InstanceId,
    primitive: u32,
    is_exact_shape: bool,
    /// Of the face of a tessellation it is a part of.
    middle: Option<Vec3>,
    pub(super) material: Option<MaterialId>,
}

/// Where points are seen from.
#[derive(Clone, Copy, Debug)]
pub(super) struct Eye {
    at: Vec3,
    /// Unit.
    forward: Vec3,
    is_perspective: bool,
    /// Highlights are seen from infinitely far away.
    is_far: bool,
}

impl Eye {
    pub(super) fn new(projection: &Projection, is_far: bool) -> Self {
        let (at, forward) = (projection.eye().as_vec3(), projection.forward().as_vec3());
        Self { at, forward, is_perspective: projection.is_perspective(), is_far }
    }
}

/// Vertices of a source face whose mean is its middle: enough for every ordinary face, and few enough for odd ones of thousands.
const MEAN_OF: usize = 16;

impl Facet {
    /// Face number `face` of all; `corner` is the first pixel of the tile, from the middle of the picture.
    pub(super) fn new(world: &World, surfaces: &Surfaces, projection: &Projection, face: u32, corner: [f64; 2]) -> Self {
        let faces = surfaces.part_of(world, face);
        let own = face - faces.first;
        let tri = faces.triangles[own as usize];
        let primitive = if faces.is_exact_shape { 0 } else { own };
        let positions = tri.map(|i| faces.vertex(i));
        let instance = faces.instance;
        let wide = positions.map(|p| p.as_dvec3());
        let cross = (wide[1] - wide[0]).cross(wide[2] - wide[0]);
        let ng = if world.is_mirrored(instance) { -cross } else { cross };
        let ng = ng.try_normalize().unwrap_or(-projection.forward()).as_vec3();
        Self {
            weights: weights(projection, &positions, corner),
            positions,
            normals: vertex_normals(world, &faces, tri),
            ng,
            instance,
            primitive,
            is_exact_shape: faces.is_exact_shape,
            middle: surfaces.middle(&faces, own),
            material: world.scene().material_of(instance, primitive),
        }
    }

    /// The barycentric weights of the point seen at `(x, y)`, pixels from the corner of the tile; of its rim, where rounding put it just outside.
    pub(super) fn at(&self, x: f32, y: f32) -> [f32; 3] {
        let e = self.weights.map(|[a, b, c]| (a * x + b * y + c).max(0.0));
        let sum = e[0] + e[1] + e[2];
        if sum > 0.0 && sum.is_finite() { e.map(|e| e / sum) } else { [1.0 / 3.0; 3] }
    }

    /// The same for many places, into `range` of the columns.
    pub(super) fn weights(&self, path: CpuPath, x: &[f32], y: &[f32], range: [usize; 2], out: &mut Columns) {
        weigh(path, &self.weights, x, y, range, out);
    }

    /// The points of weights `range`, as [`Self::surface`] and `World::shading` without normal maps have them, from point `first` on.
    pub(super) fn points(&self, path: CpuPath, eye: &Eye, weights: &Columns, range: [usize; 2], first: usize, out: &mut Points) {
        interpolate(path, self, eye, weights, range, first, out);
    }

    /// The mesh it is a face of, and its vertices there; `None` for exact shapes.
    fn vertices<'w>(&self, world: &'w World) -> Option<(&'w Mesh, [u32; 3])> {
        let Geometry::Mesh(mesh) = world.scene().instances[self.instance.index()].geometry else { return None };
        let mesh = &world.scene().meshes[mesh.index()];
        Some((mesh, mesh.triangles[self.primitive as usize]))
    }

    /// The texture coordinates at its vertices, after the reference's transform; `None` for exact shapes, where they are no linear function.
    pub(super) fn uv(&self, world: &World, map: &TextureRef) -> Option<[Vec2; 3]> {
        let (mesh, vertices) = self.vertices(world)?;
        let uv = mesh.uvs.get(map.uv_set as usize).map_or([Vec2::ZERO; 3], |uvs| vertices.map(|i| uvs[i as usize]));
        Some(map.transform.map_or(uv, |t| uv.map(|uv| t.apply(uv))))
    }

    /// The vertex colours; `None` where it has none.
    pub(super) fn colors(&self, world: &World) -> Option<[Vec4; 3]> {
        let (mesh, vertices) = self.vertices(world)?;
        mesh.colors.as_ref().map(|colors| vertices.map(|i| colors[i as usize]))
    }

    /// The point of those weights, with the normal interpolated from the vertices, or the face's own when `is_flat`.
    pub(super) fn surface(&self, world: &World, weights: [f32; 3], is_flat: bool) -> Surface {
        let mix = |v: &[Vec3; 3]| v[0] * weights[0] + v[1] * weights[1] + v[2] * weights[2];
        let p = mix(&self.positions);
        let n = match &self.normals {
            Some(normals) if !is_flat => {
                mix(normals).try_normalize().map_or(self.ng, |n| if n.dot(self.ng) < 0.0 { -n } else { n })
            }
            _ => self.ng,
        };
        let local = if self.is_exact_shape { self.exact_local(world, p) } else { Vec3::ZERO };
        let barycentric = if self.is_exact_shape { [0.0; 3] } else { weights };
        Surface {
            p,
            // Nothing starts from a point that was scan converted.
            p_error: Vec3::ZERO,
            ng: self.ng,
            n,
            instance: self.instance,
            primitive: self.primitive,
            weights: barycentric,
            local,
            material: self.material,
            width: 0.0,
        }
    }

    /// Where the one light of a face that is shaded flat is computed: the middle of the face it had in its source.
    pub(super) fn middle(&self, world: &World) -> Surface {
        let surface = self.surface(world, [1.0 / 3.0; 3], true);
        if let Some(p) = self.middle {
            return Surface { p, ..surface };
        }
        let Geometry::Mesh(mesh) = world.scene().instances[self.instance.index()].geometry else { return surface };
        let mesh = &world.scene().meshes[mesh.index()];
        let Some(polygons) = &mesh.polygons else { return surface };
        let face = polygons.of_triangle[self.primitive as usize] as usize;
        let vertices = &polygons.vertices[polygons.offsets[face] as usize..polygons.offsets[face + 1] as usize];
        let (placed, transform) = (vertices.iter().take(MEAN_OF), world.scene().instances[self.instance.index()].transform);
        let sum: DVec3 = placed.map(|&v| transform.transform_point3(mesh.positions[v as usize]) - world.origin()).sum();
        Surface { p: (sum / vertices.len().clamp(1, MEAN_OF) as f64).as_vec3(), ..surface }
    }

    /// The point of the exact shape that a point of its tessellation stands for, in its own coordinates: textures are mapped by it.
    fn exact_local(&self, world: &World, p: Vec3) -> Vec3 {
        let local = world.to_local(self.instance).transform_point3(p.as_dvec3());
        let is_sphere = world.scene().instances[self.instance.index()].geometry == Geometry::Sphere;
        let local = if is_sphere { local.try_normalize().unwrap_or(DVec3::Y) } else { DVec3::new(local.x, 0.0, local.z) };
        local.as_vec3()
    }
}

fn weights(projection: &Projection, positions: &[Vec3; 3], corner: [f64; 2]) -> [[f32; 3]; 3] {
    let v = positions.map(|p| projection.project(p).xyw());
    let cross = [v[1].cross(v[2]), v[2].cross(v[0]), v[0].cross(v[1])];
    let determinant = v[0].dot(cross[0]);
    cross.map(|c| {
        // Of any common length: only ratios count, so the sign is all that must be right.
        let c = if determinant == 0.0 { c } else { c / determinant };
        [c.x as f32, c.y as f32, (c.x * corner[0] + c.y * corner[1] + c.z) as f32]
    })
}

for_each_cpu! {
    fn weigh(facet: &[[f32; 3]; 3], x: &[f32], y: &[f32], range: [usize; 2], out: &mut Columns) = weigh_on;
    fn interpolate(facet: &Facet, eye: &Eye, weights: &Columns, range: [usize; 2], first: usize, out: &mut Points) = interpolate_on;
}

/// As [`Facet::at`].
#[inline(always)]
fn weigh_on<C: Cpu>(facet: &[[f32; 3]; 3], x: &[f32], y: &[f32], [mut i, end]: [usize; 2], out: &mut Columns) {
    type L<C> = <C as Cpu>::Wide;
    let (zero, third) = (L::<C>::splat(0.0), L::<C>::splat(1.0 / 3.0));
    while i < end {
        let (x, y) = (L::<C>::load(eight(x, i)), L::<C>::load(eight(y, i)));
        let e = xyz!(k => {
            let [a, b, c] = facet[k];
            L::<C>::splat(a).mul(x).add(L::<C>::splat(b).mul(y)).add(L::<C>::splat(c)).max(zero)
        });
        let sum = e[0].add(e[1]).add(e[2]);
        let is_sound = L::<C>::both(zero.lt(sum), sum.le(L::<C>::splat(f32::MAX)));
        let mut k = 0;
        while k < 3 {
            *eight_mut(&mut out[k], i) = L::<C>::select(is_sound, e[k].div(sum), third).store();
            k += 1;
        }
        i += LANES;
    }
}

#[inline(always)]
fn mix<L: Lanes>(v: &[Vec3; 3], w: V3<L>) -> V3<L> {
    let (a, b, c) = (splat3::<L>(v[0]), splat3::<L>(v[1]), splat3::<L>(v[2]));
    xyz!(k => a[k].mul(w[0]).add(b[k].mul(w[1])).add(c[k].mul(w[2])))
}

/// Of unit length, or `other` where it has no direction.
#[inline(always)]
fn normalize_or<L: Lanes>(v: V3<L>, other: V3<L>) -> V3<L> {
    let inverse = L::splat(1.0).div(dot(v, v).sqrt());
    let is_sound = L::both(L::splat(0.0).lt(inverse), inverse.le(L::splat(f32::MAX)));
    xyz!(k => L::select(is_sound, v[k].mul(inverse), other[k]))
}

/// `v` where `is_kept`, else `−v`.
#[inline(always)]
fn turn<L: Lanes>(is_kept: L::Mask, v: V3<L>) -> V3<L> {
    xyz!(k => L::select(is_kept, v[k], v[k].neg()))
}

/// As [`Facet::surface`], and the front turned to the viewer.
#[inline(always)]
fn interpolate_on<C: Cpu>(facet: &Facet, eye: &Eye, weights: &Columns, [mut i, end]: [usize; 2], first: usize, out: &mut Points) {
    type L<C> = <C as Cpu>::Wide;
    let zero = L::<C>::splat(0.0);
    let (ng, back, at) = (splat3::<L<C>>(facet.ng), splat3::<L<C>>(-eye.forward), splat3::<L<C>>(eye.at));
    let mut row = first;
    while i < end {
        let w = load3::<L<C>>(weights, i);
        let p = mix(&facet.positions, w);
        let n = match &facet.normals {
            Some(normals) => {
                let n = normalize_or(mix(normals, w), ng);
                turn::<L<C>>(zero.le(dot(n, ng)), n)
            }
            None => ng,
        };
        let wo = if eye.is_perspective { normalize_or(xyz!(k => at[k].sub(p[k])), back) } else { back };
        let n = turn::<L<C>>(zero.le(dot(ng, wo)), n);
        let wo = if eye.is_far { back } else { wo };
        let mut k = 0;
        while k < 3 {
            *eight_mut(&mut out.p[k], row) = p[k].store();
            *eight_mut(&mut out.n[k], row) = n[k].store();
            *eight_mut(&mut out.wo[k], row) = wo[k].store();
            k += 1;
        }
        (i, row) = (i + LANES, row + LANES);
    }
}

/// The vertex normals in world coordinates; `None` where there are none that are usable.
fn vertex_normals(world: &World, faces: &Faces<'_>, tri: [u32; 3]) -> Option<[Vec3; 3]> {
    let own: [Vec3; 3] = if faces.is_exact_shape {
        tri.map(|i| faces.exact_normal(i))
    } else {
        let Geometry::Mesh(mesh) = world.scene().instances[faces.instance.index()].geometry else { return None };
        let normals = world.scene().meshes[mesh.index()].normals.as_ref()?;
        tri.map(|i| normals[i as usize])
    };
    let moved = own.map(|n| world.normal_to_world(faces.instance, n.as_dvec3()));
    // One length for all three: the transform's own ratios between them are what interpolates as the surface does.
    let length = moved.iter().map(|n| n.length()).fold(0.0, f64::max);
    (length > 0.0 && length.is_finite()).then(|| moved.map(|n| (n / length).as_vec3()))
}
