//! Shapes: exact ones stay exact, round ones are cut finely, and faces keep all their corners.

use schemars::JsonSchema;
use serde::Deserialize;

use super::error::Text;
use super::polygon::Builder;
use super::transform::TransformTable;
use super::value::{At, Direction, NonNegative, OneOrMany, Pair, Point, Positive, Segments, VertexIndex};
use crate::import::ImportError;
use crate::math::{DAffine3, DMat3, DVec3, Vec2, Vec3, function};
use crate::scene::{Geometry, Mesh};

/// One shape: exactly one of the keys `quad`, `polygons`, `box`, `disc`, `sphere`, `cylinder`, `cone`, `mesh`, and what it is made of.
/// Corners in counter-clockwise order show the front.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct ShapeTable {
    /// Name in reports and form factors; the kind and its place in the file when not given.
    pub(super) name: Option<String>,
    /// Name of a material of this file; matt grey of reflectance 0.8 when not given.
    pub(super) material: Option<At<String>>,
    /// Moves it into place.
    pub(super) transform: OneOrMany<TransformTable>,
    /// Places it once for each of these transforms, which come after `transform`; the copies share their geometry and are numbered from 1.
    pub(super) copies: Vec<OneOrMany<TransformTable>>,
    /// Four corners `[[x, y, z], …]`. Its texture stands upright with the first corner at the lower left.
    pub(super) quad: Option<At<[Point; 4]>>,
    /// Flat polygons, each a list of three or more corners; they may be concave.
    pub(super) polygons: Option<Vec<At<Vec<Point>>>>,
    /// A box with faces along the axes, or an array of them that become one object.
    #[serde(rename = "box")]
    pub(super) cuboid: Option<OneOrMany<BoxTable>>,
    /// A flat round surface, exact.
    pub(super) disc: Option<DiscTable>,
    /// A sphere, exact.
    pub(super) sphere: Option<SphereTable>,
    /// A cylinder, cut into flat faces with smooth normals.
    pub(super) cylinder: Option<At<CylinderTable>>,
    /// A cone or a frustum, cut into flat faces with smooth normals.
    pub(super) cone: Option<At<ConeTable>>,
    /// Vertices and faces.
    pub(super) mesh: Option<At<MeshTable>>,
}

/// A box with faces along the axes.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct BoxTable {
    /// Smallest corner.
    min: Point,
    /// Largest corner.
    max: Point,
    /// The fronts look inward, as the walls of a room do.
    #[serde(default)]
    inward: bool,
}

/// A flat round surface.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct DiscTable {
    /// Its centre; the origin when not given.
    center: Option<Point>,
    /// Where its front looks; the file's up axis when not given.
    normal: Option<Direction>,
    /// Radius.
    radius: Positive,
}

/// A sphere; its front is the outside.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct SphereTable {
    /// Its centre; the origin when not given.
    center: Option<Point>,
    /// Radius.
    radius: Positive,
}

/// A cylinder; its front is the outside.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct CylinderTable {
    /// Centre of one end.
    from: Point,
    /// Centre of the other end.
    to: Point,
    /// Radius.
    radius: Positive,
    /// Flat faces around; 48 when not given.
    segments: Option<Segments>,
    /// Closed by discs at both ends; true when not given.
    caps: Option<bool>,
}

/// A cone from a base to a tip, or a frustum when `top_radius` is above zero; its front is the outside.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct ConeTable {
    /// Centre of the base.
    from: Point,
    /// The tip, or the centre of the top.
    to: Point,
    /// Radius of the base.
    radius: NonNegative,
    /// Radius of the top; 0 when not given.
    top_radius: Option<NonNegative>,
    /// Flat faces around; 48 when not given.
    segments: Option<Segments>,
    /// Closed by discs at its ends; true when not given.
    caps: Option<bool>,
}

/// Vertices and faces.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct MeshTable {
    /// `[[x, y, z], …]`.
    positions: Vec<Point>,
    /// Each a list of three or more vertex numbers, from 0; polygons are kept as such.
    faces: Vec<At<Vec<VertexIndex>>>,
    /// One for each vertex; faces are flat when not given.
    normals: Option<At<Vec<Point>>>,
    /// Texture coordinates, one pair for each vertex; (0, 0) is the top left of the picture.
    uvs: Option<At<Vec<Pair>>>,
}

/// A shape ready to be placed.
pub(super) struct Built {
    /// Its kind, as the file calls it.
    pub(super) kind: &'static str,
    /// What it is.
    pub(super) geometry: BuiltGeometry,
}

/// What a shape becomes.
pub(super) enum BuiltGeometry {
    /// Triangles.
    Mesh(Mesh),
    /// An exact shape, and where its unit form goes.
    Exact(Geometry, DAffine3),
}

const SEGMENTS: u32 = 48;

/// What a shape of the file is, in the file's coordinates before its own `transform`.
pub(super) fn build(shape: &At<ShapeTable>, text: &Text, up: DVec3) -> Result<Built, ImportError> {
    let s = &shape.value;
    let present = [
        ("quad", s.quad.is_some()),
        ("polygons", s.polygons.is_some()),
        ("box", s.cuboid.is_some()),
        ("disc", s.disc.is_some()),
        ("sphere", s.sphere.is_some()),
        ("cylinder", s.cylinder.is_some()),
        ("cone", s.cone.is_some()),
        ("mesh", s.mesh.is_some()),
    ];
    let kind = super::exactly_one(text, &shape.span, "a shape", &present)?;
    let mesh = |builder: Builder| BuiltGeometry::Mesh(builder.finish());
    let geometry = if let Some(quad) = &s.quad {
        mesh(polygons(text, &[At { value: quad.value.to_vec(), span: quad.span.clone() }])?)
    } else if let Some(all) = &s.polygons {
        if all.is_empty() {
            return Err(text.error(&shape.span, "`polygons` is empty", ""));
        }
        mesh(polygons(text, all)?)
    } else if let Some(b) = &s.cuboid {
        if b.0.is_empty() {
            return Err(text.error(&shape.span, "`box` is empty", ""));
        }
        let mut builder = Builder::default();
        b.0.iter().try_for_each(|b| cuboid(text, b, &mut builder))?;
        mesh(builder)
    } else if let Some(d) = &s.disc {
        let basis = basis_around(d.normal.map_or(up, |n| n.0));
        BuiltGeometry::Exact(Geometry::Disc, place(basis * d.radius.0, d.center))
    } else if let Some(b) = &s.sphere {
        // The poles of its longitudes stand upright.
        BuiltGeometry::Exact(Geometry::Sphere, place(basis_around(up) * b.radius.0, b.center))
    } else if let Some(At { value: c, span }) = &s.cylinder {
        let r = c.radius.0;
        mesh(frustum(text, span, [c.from.0, c.to.0], [r, r], c.segments, c.caps)?)
    } else if let Some(At { value: c, span }) = &s.cone {
        let radii = [c.radius.0, c.top_radius.map_or(0.0, |r| r.0)];
        mesh(frustum(text, span, [c.from.0, c.to.0], radii, c.segments, c.caps)?)
    } else if let Some(m) = &s.mesh {
        mesh(inline(text, m)?)
    } else {
        unreachable!("exactly one of the kinds is present")
    };
    Ok(Built { kind, geometry })
}

fn place(matrix: DMat3, center: Option<Point>) -> DAffine3 {
    DAffine3::from_mat3_translation(matrix, center.map_or(DVec3::ZERO, |c| c.0))
}

/// A right-handed frame whose second axis is `y`; the plain axes when `y` is +y.
fn basis_around(y: DVec3) -> DMat3 {
    if y == DVec3::Y {
        return DMat3::IDENTITY;
    }
    // The axis that is least along y keeps the frame well defined.
    let other = if y.x.abs() <= y.y.abs() && y.x.abs() <= y.z.abs() { DVec3::X } else { DVec3::Z };
    let x = (other - y * other.dot(y)).normalize();
    DMat3::from_cols(x, y, x.cross(y))
}

fn polygons(text: &Text, all: &[At<Vec<Point>>]) -> Result<Builder, ImportError> {
    let mut builder = Builder::default();
    for polygon in all {
        let corners: Vec<DVec3> = polygon.value.iter().map(|p| p.0).collect();
        let quad_uvs = [Vec2::new(0.0, 1.0), Vec2::ONE, Vec2::new(1.0, 0.0), Vec2::ZERO];
        let first = builder.positions.len() as u32;
        builder.positions.extend(&corners);
        if corners.len() == 4 {
            builder.uvs.extend(quad_uvs);
        } else {
            builder.uvs.extend(planar_uvs(&corners));
        }
        let indices: Vec<u32> = (first..first + corners.len() as u32).collect();
        builder.face(&indices).map_err(|why| text.error(&polygon.span, why.to_string(), ""))?;
    }
    Ok(builder)
}

/// The corners seen from the front, first edge to the right, fitted into the unit square.
fn planar_uvs(corners: &[DVec3]) -> Vec<Vec2> {
    let normal = super::polygon::area_vector(corners).normalize_or(DVec3::Y);
    let right = corners.windows(2).find_map(|e| (e[1] - e[0]).try_normalize()).unwrap_or(DVec3::X);
    let above = normal.cross(right);
    let flat: Vec<[f64; 2]> = corners.iter().map(|&c| [c.dot(right), c.dot(above)]).collect();
    let range = |i: usize| flat.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), p| (p[i].min(lo), p[i].max(hi)));
    let ((u0, u1), (v0, v1)) = (range(0), range(1));
    let size = (u1 - u0).max(v1 - v0).max(f64::MIN_POSITIVE);
    flat.iter().map(|p| Vec2::new(((p[0] - u0) / size) as f32, 1.0 - ((p[1] - v0) / size) as f32)).collect()
}

fn cuboid(text: &Text, table: &At<BoxTable>, builder: &mut Builder) -> Result<(), ImportError> {
    let (lo, hi) = (table.value.min.0, table.value.max.0);
    if !lo.cmplt(hi).all() {
        let help = "give the smallest corner as `min` and the largest as `max`; for a flat surface use `quad`";
        return Err(text.error(&table.span, "this box has no inside", help));
    }
    // Each face by its outward axis; right and above as seen from outside, so that textures stand upright.
    let faces: [([usize; 3], bool); 6] =
        [([0, 2, 1], true), ([0, 2, 1], false), ([1, 0, 2], true), ([1, 0, 2], false), ([2, 0, 1], true), ([2, 0, 1], false)];
    for ([axis, u, v], high) in faces {
        let corner = |a: bool, b: bool| {
            let mut p = DVec3::ZERO;
            p[axis] = if high { hi[axis] } else { lo[axis] };
            p[u] = if a { hi[u] } else { lo[u] };
            p[v] = if b { hi[v] } else { lo[v] };
            p
        };
        let mut corners = vec![corner(false, false), corner(true, false), corner(true, true), corner(false, true)];
        let mut outward = DVec3::ZERO;
        outward[axis] = if high { 1.0 } else { -1.0 };
        let wanted = if table.value.inward { -outward } else { outward };
        if super::polygon::area_vector(&corners).dot(wanted) < 0.0 {
            // Mirrored left to right: still from the lower left, now counter-clockwise.
            corners = vec![corners[1], corners[0], corners[3], corners[2]];
        }
        let first = builder.positions.len() as u32;
        builder.positions.extend(corners);
        builder.uvs.extend([Vec2::new(0.0, 1.0), Vec2::ONE, Vec2::new(1.0, 0.0), Vec2::ZERO]);
        builder.face(&[first, first + 1, first + 2, first + 3]).map_err(|why| text.error(&table.span, why.to_string(), ""))?;
    }
    Ok(())
}

fn frustum(
    text: &Text,
    span: &std::ops::Range<usize>,
    [from, to]: [DVec3; 2],
    [r0, r1]: [f64; 2],
    segments: Option<Segments>,
    caps: Option<bool>,
) -> Result<Builder, ImportError> {
    let height = (to - from).length();
    let Some(axis) = (to - from).try_normalize() else {
        return Err(text.error(span, "`from` and `to` are the same place", "for a flat round surface use `disc`"));
    };
    if r0.max(r1) <= 0.0 {
        return Err(text.error(span, "its radius is zero at both ends", ""));
    }
    let n = segments.map_or(SEGMENTS, Segments::get);
    let frame = basis_around(axis);
    // The direction at a part of a turn; exact at the seam, so that it closes.
    let around = |turn: f64| {
        let angle = std::f64::consts::TAU * turn.rem_euclid(1.0);
        frame.x_axis * function::cos_f64(angle) + frame.z_axis * function::sin_f64(angle)
    };
    let normal = |direction: DVec3| (direction * height + axis * (r0 - r1)).normalize().as_vec3();
    let mut b = Builder { normals: Some(Vec::new()), ..Builder::default() };
    let vertex = |b: &mut Builder, position: DVec3, normal: Vec3, uv: Vec2| {
        b.positions.push(position);
        b.normals.get_or_insert_default().push(normal);
        b.uvs.push(uv);
        b.positions.len() as u32 - 1
    };
    let fail = |why: super::polygon::Unusable| text.error(span, why.to_string(), "");
    for i in 0..n {
        let (t0, t1) = (f64::from(i) / f64::from(n), f64::from(i + 1) / f64::from(n));
        let (d0, d1) = (around(t0), around(t1));
        // Growing angles run to the left seen from outside, pictures run to the right.
        let (u0, u1) = (1.0 - t0 as f32, 1.0 - t1 as f32);
        // At a tip the normal is that of the middle of the face.
        let tip = around((f64::from(i) + 0.5) / f64::from(n));
        let mut face = Vec::with_capacity(4);
        if r0 > 0.0 {
            face.push(vertex(&mut b, from + d1 * r0, normal(d1), Vec2::new(u1, 1.0)));
            face.push(vertex(&mut b, from + d0 * r0, normal(d0), Vec2::new(u0, 1.0)));
        } else {
            face.push(vertex(&mut b, from, normal(tip), Vec2::new((u0 + u1) / 2.0, 1.0)));
        }
        if r1 > 0.0 {
            face.push(vertex(&mut b, to + d0 * r1, normal(d0), Vec2::new(u0, 0.0)));
            face.push(vertex(&mut b, to + d1 * r1, normal(d1), Vec2::new(u1, 0.0)));
        } else {
            face.push(vertex(&mut b, to, normal(tip), Vec2::new((u0 + u1) / 2.0, 0.0)));
        }
        b.face(&face).map_err(fail)?;
    }
    if caps.unwrap_or(true) {
        for (center, radius, outward) in [(from, r0, -axis), (to, r1, axis)] {
            if radius > 0.0 {
                let first = b.positions.len() as u32;
                for i in 0..n {
                    // Growing angles run clockwise seen from the tip of the axis.
                    let i = if outward == axis { n - 1 - i } else { i };
                    let d = around(f64::from(i) / f64::from(n));
                    let uv = Vec2::new(0.5 + 0.5 * d.dot(frame.x_axis) as f32, 0.5 + 0.5 * d.dot(frame.z_axis) as f32);
                    vertex(&mut b, center + d * radius, outward.as_vec3(), uv);
                }
                b.face(&(first..first + n).collect::<Vec<_>>()).map_err(fail)?;
            }
        }
    }
    Ok(b)
}

fn inline(text: &Text, table: &At<MeshTable>) -> Result<Builder, ImportError> {
    let m = &table.value;
    let n = m.positions.len();
    let column = |name: &str, len: usize, span: &std::ops::Range<usize>| {
        if len == n { Ok(()) } else { Err(text.error(span, format!("{len} {name} for {n} positions"), "each vertex needs one")) }
    };
    let mut b = Builder { positions: m.positions.iter().map(|p| p.0).collect(), ..Builder::default() };
    if let Some(normals) = &m.normals {
        column("normals", normals.value.len(), &normals.span)?;
        b.normals = Some(normals.value.iter().map(|p| p.0.normalize_or_zero().as_vec3()).collect());
    }
    if let Some(uvs) = &m.uvs {
        column("texture coordinates", uvs.value.len(), &uvs.span)?;
        b.uvs = uvs.value.iter().map(|p| p.0).collect();
    }
    if m.faces.is_empty() {
        return Err(text.error(&table.span, "this mesh has no faces", ""));
    }
    for face in &m.faces {
        let indices: Vec<u32> = face.value.iter().map(|i| i.get()).collect();
        if let Some(beyond) = indices.iter().find(|&&i| i as usize >= n) {
            let message = format!("this face names vertex {beyond}, but there are {n} positions, numbered from 0");
            return Err(text.error(&face.span, message, ""));
        }
        b.face(&indices).map_err(|why| text.error(&face.span, why.to_string(), ""))?;
    }
    Ok(b)
}
