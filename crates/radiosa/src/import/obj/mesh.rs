//! From the columns of a document to meshes: one for each object or group, corners that agree in everything shared.

use std::collections::HashMap;
use std::path::Path;

use super::document::{Document, Face, Group, NONE};
use super::polygon::Cutter;
use super::text::Tally;
use crate::import::Warnings;
use crate::math::{DVec3, Vec2, Vec3, Vec4, function};
use crate::scene::{MaterialId, Mesh, MeshSource, Polygons};

/// Where the normal of a corner comes from. Also tells corners apart that share everything else.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
enum Normal {
    /// The mesh is flat throughout and stores none.
    Absent,
    /// A `vn` of the file.
    Given(u32),
    /// The mean around a vertex in a smoothing group.
    Smooth(u32),
    /// That of the face.
    Flat(u32),
}

/// One face ready for a mesh.
struct Surface {
    /// Into [`Document::faces`].
    face: u32,
    /// Unit length.
    normal: DVec3,
    /// Into [`Cut::corners`].
    corners: std::ops::Range<u32>,
    /// Into [`Cut::triangles`].
    triangles: std::ops::Range<u32>,
}

/// All faces that have area, cut into triangles.
#[derive(Default)]
struct Cut {
    surfaces: Vec<Surface>,
    /// Indices into [`Document::corners`], without a vertex directly repeated.
    corners: Vec<u32>,
    /// Corners of their face, from 0.
    triangles: Vec<[u32; 3]>,
}

/// One mesh for each group that has a face with area: (index into [`Document::groups`], mesh), in order of first use.
///
/// `materials` gives the scene's id for each name in the document.
pub(super) fn meshes(
    document: &Document,
    materials: &[MaterialId],
    text: &[u8],
    path: &Path,
    warnings: &mut Warnings,
) -> Vec<(u32, Mesh)> {
    let cut = cut(document, text, path, warnings);
    let smooth = SmoothNormals::new(document, &cut);

    // The faces of each group in order, without sorting: how many there are, where each group starts, then fill.
    let mut starts = vec![0u32; document.groups.len() + 1];
    let group_of = |s: &Surface| document.faces[s.face as usize].group as usize;
    for surface in &cut.surfaces {
        starts[group_of(surface) + 1] += 1;
    }
    for g in 1..starts.len() {
        starts[g] += starts[g - 1];
    }
    let mut order = vec![0u32; cut.surfaces.len()];
    let mut next = starts.clone();
    for (s, surface) in cut.surfaces.iter().enumerate() {
        let slot = &mut next[group_of(surface)];
        order[*slot as usize] = s as u32;
        *slot += 1;
    }

    let mut builder =
        Builder { document, names: names(&document.groups), materials, cut: &cut, smooth: &smooth, vertices: HashMap::new() };
    let mut meshes = Vec::new();
    for group in 0..document.groups.len() {
        let surfaces = &order[starts[group] as usize..starts[group + 1] as usize];
        if !surfaces.is_empty() {
            meshes.push((group as u32, builder.mesh(group as u32, surfaces)));
        }
    }
    meshes
}

fn cut(document: &Document, text: &[u8], path: &Path, warnings: &mut Warnings) -> Cut {
    let mut cut = Cut::default();
    let mut cutter = Cutter::new();
    let mut triangles = Vec::new();
    let (mut not_finite, mut degenerate, mut inside_out) = (Tally::default(), Tally::default(), Tally::default());
    for (f, face) in document.faces.iter().enumerate() {
        let at = face.at as usize;
        let start = cut.corners.len();
        let v = |c: u32| document.corners[c as usize].v;
        for c in face.first..face.end {
            let before = if c == face.first { face.end - 1 } else { c - 1 };
            if v(c) != v(before) {
                cut.corners.push(c);
            }
        }
        let corners = &cut.corners[start..];
        let positions = corners.iter().map(|&c| document.positions[v(c) as usize]);
        if !positions.clone().all(DVec3::is_finite) {
            not_finite.add(at);
            cut.corners.truncate(start);
            continue;
        }
        let normal = if corners.len() < 3 { None } else { cutter.cut(positions, &mut triangles) };
        let Some(normal) = normal else {
            degenerate.add(at);
            cut.corners.truncate(start);
            continue;
        };
        let given: Vec3 = corners.iter().filter_map(|&c| document.normals.get(document.corners[c as usize].vn as usize)).sum();
        if given.as_dvec3().dot(normal) < 0.0 {
            inside_out.add(at);
        }
        let first = cut.triangles.len() as u32;
        cut.triangles.extend_from_slice(&triangles);
        cut.surfaces.push(Surface {
            face: f as u32,
            normal,
            corners: start as u32..cut.corners.len() as u32,
            triangles: first..cut.triangles.len() as u32,
        });
    }
    for (name, tally, what) in [
        ("non-finite-vertex", not_finite, "a face with a vertex that is no number, or beyond 1e18, is left out"),
        ("degenerate-face", degenerate, "a face without area is left out"),
        (
            "winding-against-normals",
            inside_out,
            "a face is wound against its normals: its front is where its corners run counter-clockwise",
        ),
    ] {
        tally.report(warnings, name, path, text, what);
    }
    if cutter.fans > 0 {
        let message = format!("polygons too intricate to be cut exactly were cut as fans: {}", cutter.fans);
        warnings.add("polygon-cut-as-fan", path, message);
    }
    cut
}

/// Normals around the vertices of smoothing groups: the mean of the faces' normals, weighted by their angles there.
///
/// A smoothing group reaches across objects and groups, as the format has it: what counts is that a vertex is shared.
struct SmoothNormals {
    index: HashMap<(u32, u32), u32>,
    sums: Vec<DVec3>,
}

impl SmoothNormals {
    fn new(document: &Document, cut: &Cut) -> Self {
        let mut all = Self { index: HashMap::new(), sums: Vec::new() };
        let face_of = |s: &Surface| &document.faces[s.face as usize];
        let lacks = |c: &u32| !document.has_normal(*c);
        let needed = |s: &Surface| face_of(s).smooth != 0 && cut.corners_of(s).iter().any(lacks);
        if !cut.surfaces.iter().any(needed) {
            return all;
        }
        for surface in cut.surfaces.iter().filter(|s| face_of(s).smooth != 0) {
            let corners = cut.corners_of(surface);
            let n = corners.len();
            let v = |i: usize| document.corners[corners[i % n] as usize].v;
            let p = |i: usize| document.positions[v(i) as usize];
            for i in 0..n {
                let (to_last, to_next) = (p(i + n - 1) - p(i), p(i + 1) - p(i));
                let cos = to_last.normalize_or_zero().dot(to_next.normalize_or_zero()).clamp(-1.0, 1.0);
                let mut angle = function::acos_f64(cos);
                if to_next.cross(to_last).dot(surface.normal) < 0.0 {
                    angle = std::f64::consts::TAU - angle; // a concave corner
                }
                let next = all.sums.len() as u32;
                let slot = *all.index.entry((v(i), face_of(surface).smooth)).or_insert(next);
                if slot == next {
                    all.sums.push(DVec3::ZERO);
                }
                all.sums[slot as usize] += surface.normal * angle;
            }
        }
        all
    }

    /// The normal around a vertex, if its faces do not cancel.
    fn get(&self, v: u32, smooth: u32) -> Option<u32> {
        let slot = *self.index.get(&(v, smooth))?;
        (self.sums[slot as usize].length() > 1e-6).then_some(slot)
    }
}

impl Cut {
    fn corners_of(&self, surface: &Surface) -> &[u32] {
        &self.corners[surface.corners.start as usize..surface.corners.end as usize]
    }

    fn triangles_of(&self, surface: &Surface) -> &[[u32; 3]] {
        &self.triangles[surface.triangles.start as usize..surface.triangles.end as usize]
    }
}

impl Document {
    /// True when the file gives a corner a normal that can be used.
    fn has_normal(&self, corner: u32) -> bool {
        self.normals.get(self.corners[corner as usize].vn as usize).is_some_and(|n| *n != Vec3::ZERO)
    }
}

struct Builder<'a> {
    document: &'a Document,
    names: Vec<String>,
    materials: &'a [MaterialId],
    cut: &'a Cut,
    smooth: &'a SmoothNormals,
    /// Vertices of the current mesh by what makes them one: position, texture coordinate, normal. Never iterated.
    vertices: HashMap<(u32, u32, Normal), u32>,
}

impl Builder<'_> {
    fn mesh(&mut self, group: u32, surfaces: &[u32]) -> Mesh {
        let (d, cut) = (self.document, self.cut);
        let all = || surfaces.iter().map(|&s| &cut.surfaces[s as usize]);
        let face_of = |s: &Surface| d.faces[s.face as usize];
        let corners = || all().flat_map(|s| cut.corners_of(s)).copied();
        let has_normals = all().any(|s| face_of(s).smooth != 0) || corners().any(|c| d.has_normal(c));
        let has_uvs = corners().any(|c| d.corners[c as usize].vt != NONE);
        let has_colors = !d.colors.is_empty();
        let has_polygons = all().any(|s| s.corners.len() > 3);

        let mut mesh = Mesh {
            name: self.names[group as usize].clone(),
            source: Some(MeshSource { file: 0, mesh: group, primitive: 0 }),
            triangles: Vec::with_capacity(all().map(|s| s.triangles.len()).sum()),
            ..Mesh::default()
        };
        let (mut normals, mut uvs, mut colors) = (Vec::new(), Vec::new(), Vec::new());
        let mut polygons = Polygons { offsets: vec![0], ..Polygons::default() };
        self.vertices.clear();
        let mut loop_vertices = Vec::new();
        for (s, surface) in all().enumerate() {
            let face = face_of(surface);
            loop_vertices.clear();
            for &c in cut.corners_of(surface) {
                let corner = d.corners[c as usize];
                let normal = if has_normals { self.normal(c, &face, surface.face) } else { Normal::Absent };
                let next = mesh.positions.len() as u32;
                let vertex = *self.vertices.entry((corner.v, corner.vt, normal)).or_insert(next);
                if vertex == next {
                    mesh.positions.push(d.positions[corner.v as usize]);
                    match normal {
                        Normal::Absent => {}
                        Normal::Given(vn) => normals.push(d.normals[vn as usize]),
                        Normal::Smooth(slot) => normals.push(self.smooth.sums[slot as usize].normalize().as_vec3()),
                        Normal::Flat(_) => normals.push(surface.normal.as_vec3()),
                    }
                    if has_uvs {
                        // The file's v runs upwards, the scene's down from the top of the picture.
                        let uv = d.uvs.get(corner.vt as usize).filter(|uv| uv.is_finite()).copied().unwrap_or(Vec2::ZERO);
                        uvs.push(Vec2::new(uv.x, 1.0 - uv.y));
                    }
                    if has_colors {
                        colors.push(d.colors.get(corner.v as usize).copied().unwrap_or(Vec4::ONE));
                    }
                }
                loop_vertices.push(vertex);
            }
            let material = self.materials.get(face.material as usize).copied();
            for triangle in cut.triangles_of(surface) {
                mesh.triangles.push(triangle.map(|i| loop_vertices[i as usize]));
                mesh.materials.push(material);
                if has_polygons {
                    polygons.of_triangle.push(s as u32);
                }
            }
            if has_polygons {
                polygons.vertices.extend_from_slice(&loop_vertices);
                polygons.offsets.push(polygons.vertices.len() as u32);
            }
        }
        match mesh.materials.first() {
            Some(None) if mesh.materials.iter().all(Option::is_none) => mesh.materials.clear(),
            Some(&first) if mesh.materials.iter().all(|m| *m == first) => mesh.materials.truncate(1),
            _ => {}
        }
        mesh.normals = has_normals.then_some(normals);
        mesh.uvs = if has_uvs { vec![uvs] } else { Vec::new() };
        mesh.colors = has_colors.then_some(colors);
        mesh.polygons = has_polygons.then_some(polygons);
        mesh
    }

    /// The file's normal; else that of the smoothing group; else the face's own.
    fn normal(&self, corner: u32, face: &Face, index: u32) -> Normal {
        let c = self.document.corners[corner as usize];
        if self.document.has_normal(corner) {
            return Normal::Given(c.vn);
        }
        let smooth = (face.smooth != 0).then(|| self.smooth.get(c.v, face.smooth)).flatten();
        smooth.map_or(Normal::Flat(index), Normal::Smooth)
    }
}

/// What the groups are called: an object's name if the object has only one group with faces, `object/group` if it has
/// several, the group's name where no object is named, and `default` (the format's own word) where nothing is.
fn names(groups: &[Group]) -> Vec<String> {
    let mut groups_of: HashMap<&str, u32> = HashMap::new();
    for object in groups.iter().filter_map(|g| g.object.as_deref()) {
        *groups_of.entry(object).or_default() += 1;
    }
    let name = |this: &Group| match (&this.object, &this.group) {
        (None, None) => "default".into(),
        (None, Some(group)) => group.clone(),
        (Some(object), Some(group)) if groups_of[object.as_str()] > 1 => format!("{object}/{group}"),
        (Some(object), _) => object.clone(),
    };
    groups.iter().map(name).collect()
}
