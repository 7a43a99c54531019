//! Meshes: one of ours for each primitive of theirs, vertices and triangles in the order of the source.

use super::super::ImportError;
use super::accessor::Accessors;
use super::budget::Budget;
use super::deform::{self, Columns, Deform, Skinned};
use super::json::Item;
use super::ngon;
use super::tally::Tally;
use crate::math::{DVec3, Frame, Vec2, Vec3, Vec4};
use crate::scene::{MaterialId, Mesh, MeshSource};

/// Sets of texture coordinates that are read; the specification asks for two.
const MAX_UV_SETS: usize = 8;

const DRACO: &str = "KHR_draco_mesh_compression";

/// What reading a primitive needs beyond its JSON.
pub(super) struct Context<'c, 'a> {
    pub accessors: &'c Accessors<'a>,
    pub budget: &'c mut Budget,
    pub tally: &'c mut Tally,
}

/// A primitive read.
pub(super) struct Primitive {
    /// The geometry.
    pub mesh: Mesh,
    /// Its vertices are already in world coordinates: the node's transform must not move them again.
    pub is_posed: bool,
}

/// Reads one primitive; `None`, noted in the tally, when it holds no triangles.
pub(super) fn read<'a>(
    primitive: &Item<'a>,
    name: &str,
    material: Option<MaterialId>,
    source: MeshSource,
    deform: &Deform,
    context: &mut Context<'_, 'a>,
) -> Result<Option<Primitive>, ImportError> {
    let Context { accessors, budget, tally } = context;
    let mode = primitive.count("mode")?.unwrap_or(4);
    let topology = match mode {
        0..=3 => {
            tally.note("ignored-points-and-lines", "a primitive made of points or lines is left out", 1, primitive.pointer());
            return Ok(None);
        }
        4 => Topology::List,
        5 => Topology::Strip,
        6 => Topology::Fan,
        other => return Err(primitive.error(format!("{other} is no primitive mode; they are 0 to 6"))),
    };
    let attributes = primitive.require("attributes")?;
    let Some(reference) = attributes.get("POSITION")? else {
        tally.note("ignored-primitive", "a primitive without positions is left out", 1, primitive.pointer());
        return Ok(None);
    };
    if primitive.extension(DRACO)?.is_some() {
        let indices = primitive.get("indices")?;
        for reference in [Some(&reference), indices.as_ref()].into_iter().flatten() {
            if !accessors.has_bytes(reference)? {
                return Err(super::extension::unsupported(primitive.file(), DRACO));
            }
        }
    }
    let mut positions = accessors.get(&reference)?.read_numbers::<3, _>(budget, DVec3::from)?;
    let n = positions.len();
    let indices = match primitive.get("indices")? {
        Some(reference) => {
            let indices = accessors.get(&reference)?.read_unsigned::<1>(budget)?;
            if let Some((i, [bad])) = indices.iter().enumerate().find(|(_, [index])| *index as usize >= n) {
                return Err(reference.error(format!("index {bad} (number {i}) points beyond the {n} vertices")));
            }
            Some(indices)
        }
        None => None,
    };
    let n_corners = indices.as_ref().map_or(n, Vec::len);
    if u32::try_from(n_corners).is_err() {
        return Err(primitive.error(format!("{n_corners} corners are more than triangles can number")));
    }
    let n_triangles = topology.n_triangles(n_corners);
    budget.reserve(&|| format!("the triangles of {}", primitive.pointer()), n_triangles as u64 * 12)?;
    let corner = |i: usize| indices.as_ref().map_or(i as u32, |list| list[i][0]);
    let mut triangles: Vec<[u32; 3]> = (0..n_triangles).map(|t| topology.corners(t).map(corner)).collect();
    drop(indices);
    if topology == Topology::List && !n_corners.is_multiple_of(3) {
        tally.note(
            "incomplete-triangle",
            "one or two vertices at the end of a triangle list are left out",
            1,
            primitive.pointer(),
        );
    }

    // Columns, still as the source has them.
    let mut columns = Reader { attributes: &attributes, accessors, n };
    let mut normals = columns.read("NORMAL", budget, |v: [f64; 3]| DVec3::from(v).as_vec3())?;
    let mut tangents = match normals {
        Some(_) => columns.read("TANGENT", budget, |[x, y, z, w]: [f64; 4]| DVec3::new(x, y, z).as_vec3().extend(w as f32))?,
        None => None,
    };
    let uvs = columns.texture_coordinates(budget, tally)?;
    let colors = columns.colors(budget)?;

    let mut is_posed = false;
    if deform.weights.iter().any(|&w| w != 0.0) {
        let columns = Columns { positions: &mut positions, normals: normals.as_deref_mut(), tangents: tangents.as_deref_mut() };
        deform::morph(primitive, &deform.weights, columns, accessors, budget)?;
    }
    if let Some(joints) = &deform.joints {
        let columns = Columns { positions: &mut positions, normals: normals.as_deref_mut(), tangents: tangents.as_deref_mut() };
        match deform::skin(&attributes, joints, columns, accessors, budget)? {
            Skinned::Rigid => {
                tally.note(
                    "skin-without-joints",
                    "a primitive of a skinned node names no joints and stays rigid",
                    1,
                    primitive.pointer(),
                );
            }
            Skinned::Posed(mirrored) => {
                is_posed = true;
                if mirrored {
                    triangles.iter_mut().for_each(|[_, b, c]| std::mem::swap(b, c));
                }
            }
        }
    }

    if positions.iter().any(|p| !p.is_finite()) {
        let before = triangles.len();
        triangles.retain(|t| t.iter().all(|&i| positions[i as usize].is_finite()));
        let dropped = (before - triangles.len()) as u64;
        if dropped > 0 {
            let what = "a triangle with a vertex that is not a finite number is left out";
            tally.note("broken-vertex", what, dropped, primitive.pointer());
        }
    }
    if let Some(normals) = &mut normals {
        normals.iter_mut().for_each(|n| *n = unit(*n).unwrap_or(Vec3::ZERO));
    }
    if let (Some(tangents), Some(normals)) = (&mut tangents, &normals) {
        tangents.iter_mut().zip(normals).for_each(|(t, n)| *t = tangent(*t, *n));
    }
    let polygons =
        primitive.extension("FB_ngon_encoding")?.filter(|_| topology == Topology::List).map(|_| ngon::polygons(&triangles));
    let mesh = Mesh {
        name: name.to_owned(),
        positions,
        normals,
        tangents,
        uvs,
        colors,
        triangles,
        materials: material.map(Some).into_iter().collect(),
        polygons,
        source: Some(source),
    };
    Ok(Some(Primitive { mesh, is_posed }))
}

/// How corners form triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Topology {
    List,
    Strip,
    Fan,
}

impl Topology {
    fn n_triangles(self, n_corners: usize) -> usize {
        match self {
            Self::List => n_corners / 3,
            Self::Strip | Self::Fan => n_corners.saturating_sub(2),
        }
    }

    /// The corners of a triangle, in the order the specification gives, which keeps the winding along strips.
    fn corners(self, t: usize) -> [usize; 3] {
        match self {
            Self::List => [3 * t, 3 * t + 1, 3 * t + 2],
            Self::Strip => [t, t + 1 + t % 2, t + 2 - t % 2],
            Self::Fan => [t + 1, t + 2, 0],
        }
    }
}

/// Reads vertex columns, all of one length.
struct Reader<'c, 'a> {
    attributes: &'c Item<'a>,
    accessors: &'c Accessors<'a>,
    n: usize,
}

impl<'a> Reader<'_, 'a> {
    fn accessor(&self, key: &str) -> Result<Option<super::accessor::Accessor<'_, 'a>>, ImportError> {
        let Some(reference) = self.attributes.get(key)? else { return Ok(None) };
        let accessor = self.accessors.get(&reference)?;
        if accessor.count != self.n {
            return Err(reference.error(format!("{} entries for {} vertices", accessor.count, self.n)));
        }
        Ok(Some(accessor))
    }

    fn read<const N: usize, T: Copy>(
        &mut self,
        key: &str,
        budget: &mut Budget,
        convert: impl Fn([f64; N]) -> T,
    ) -> Result<Option<Vec<T>>, ImportError> {
        self.accessor(key)?.map(|accessor| accessor.read_numbers(budget, convert)).transpose()
    }

    fn texture_coordinates(&mut self, budget: &mut Budget, tally: &mut Tally) -> Result<Vec<Vec<Vec2>>, ImportError> {
        let mut sets: Vec<Option<Vec<Vec2>>> = Vec::new();
        for (key, item) in self.attributes.members()? {
            let Some(number) = key.strip_prefix("TEXCOORD_") else { continue };
            let Some(set) = number.parse::<usize>().ok().filter(|&set| set < MAX_UV_SETS) else {
                tally.note(
                    "ignored-texture-coordinates",
                    "a set of texture coordinates beyond the eighth is left out",
                    1,
                    item.pointer(),
                );
                continue;
            };
            // Texture lookups must be able to rely on finite coordinates.
            let finite = |v: f64| if (v as f32).is_finite() { v as f32 } else { 0.0 };
            let column = self.read(key, budget, |[u, v]: [f64; 2]| Vec2::new(finite(u), finite(v)))?;
            sets.resize_with(sets.len().max(set + 1), || None);
            sets[set] = column;
        }
        // A set that is skipped must still have its number; nothing that is right refers to it.
        let n = self.n;
        Ok(sets.into_iter().map(|set| set.unwrap_or_else(|| vec![Vec2::ZERO; n])).collect())
    }

    fn colors(&mut self, budget: &mut Budget) -> Result<Option<Vec<Vec4>>, ImportError> {
        let Some(accessor) = self.accessor("COLOR_0")? else { return Ok(None) };
        // The specification clamps them; what is not a number becomes 0.
        let unit = |v: f64| if v.is_nan() { 0.0 } else { v.clamp(0.0, 1.0) as f32 };
        Ok(Some(match accessor.width() {
            3 => accessor.read_numbers(budget, |[r, g, b]: [f64; 3]| Vec4::new(unit(r), unit(g), unit(b), 1.0))?,
            4 => accessor.read_numbers(budget, |c: [f64; 4]| Vec4::from(c.map(unit)))?,
            other => return Err(accessor.error(format!("vertex colours have 3 or 4 components, not {other}"))),
        }))
    }
}

/// A direction of unit length, when it has one. In f64, where no finite f32 overflows.
fn unit(v: Vec3) -> Option<Vec3> {
    let length = v.as_dvec3().length();
    (length.is_finite() && length > 0.0).then(|| (v.as_dvec3() / length).as_vec3())
}

/// A usable tangent: where the source's is not, any direction across the normal.
fn tangent(t: Vec4, normal: Vec3) -> Vec4 {
    let direction =
        unit(t.truncate()).unwrap_or_else(|| if normal == Vec3::ZERO { Vec3::X } else { Frame::from_normal(normal).s });
    direction.extend(if t.w < 0.0 { -1.0 } else { 1.0 })
}
