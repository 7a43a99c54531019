//! Flat emissive surfaces in closed form, with what triangles hide of them cut out: their light without noise.
//!
//! ```text
//! E = L_e/2 Σ_edges n·Γ      Γ: unit normal of the wedge (point, edge), times its angle [Baum89]
//! ```
//!
//! What a point sees of a convex polygon past a triangle is the polygon less the cone over the triangle: at most as many convex pieces as the cone has sides.
//! All triangles that can matter reach into the pyramid between point and polygon; where they are many nothing is said, and others have to draw points.

use super::area::{EmissiveShape, EmissiveSurface};
pub(crate) use super::piece::Unclear;
use super::piece::{CORNERS, Cone, Piece, Rectangle, TINY};
use crate::accel::{HalfSpace, Triangle};
use crate::math::polygon::area_vector;
use crate::math::rounding::gamma;
use crate::math::{DVec2, DVec3, Vec3};
use crate::spectrum::Spectrum;

/// Pieces at most.
const PIECES: usize = 48;
/// Corners of a part of a polygon, and its parts, at most.
const PART: usize = 6;
const PARTS: usize = 8;
/// The rectangle around them to their area, at most.
const SPREAD: f64 = 2.0;
/// Triangles that are cut out at most.
pub(crate) const BLOCKERS: usize = 96;
/// What lies nearer than this to a plane lies in it, in parts of the largest coordinate.
const NEAR: f32 = gamma(64);
/// The cosine between both normals of what counts as flat.
const FLAT: f32 = 1.0 - 1e-6;

/// Flat emissive surfaces in one plane, close together.
#[derive(Clone, Debug)]
pub(crate) struct Polygon {
    /// Convex, their corners counter-clockwise seen from the front.
    parts: Vec<Vec<DVec3>>,
    /// Unit, the front's.
    normal: DVec3,
    /// Unit, along an edge.
    axis: DVec3,
    /// `L_e`.
    pub(crate) radiance: Spectrum,
    two_sided: bool,
    /// The triangles it was made of.
    pub(crate) surfaces: Vec<EmissiveSurface>,
}

/// Where light is asked for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Receiver {
    /// Where shadow rays start: just off the surface.
    pub(crate) p: Vec3,
    /// Unit shading normal.
    pub(crate) n: Vec3,
    /// Unit geometric normal on its side.
    pub(crate) side: Vec3,
}

/// What of a polygon a receiver might see: in coordinates along its plane (x, y) and away from the receiver (z), who is the origin.
#[derive(Clone, Debug)]
pub(crate) struct Seen {
    /// Above the horizon, counter-clockwise about the direction to it.
    parts: Vec<Piece>,
    /// What they lie within.
    bounds: Rectangle,
    is_cut: bool,
    axes: [DVec3; 3],
    /// The receiver's unit normal.
    n: DVec3,
    /// z of the polygon, metres.
    height: f64,
    /// What lies nearer than this to the plane lies in it, metres.
    near: f64,
    /// Smaller than this, a distance from a plane through the receiver is none, metres.
    tiny: f64,
}

/// The flat ones of emissive surfaces. Triangles next to each other in the scene that share a plane are one, where not much lies between them; those that share an edge and are
/// convex together are one part of it.
pub(crate) fn polygons(surfaces: &[EmissiveSurface]) -> Vec<Polygon> {
    let mut polygons: Vec<Polygon> = Vec::new();
    for surface in surfaces {
        let EmissiveShape::Triangle(corners) = surface.shape else { continue };
        let corners: Vec<DVec3> = corners.iter().map(|p| p.as_dvec3()).collect();
        let edge = corners[1] - corners[0];
        let Some((normal, axis)) = edge.cross(corners[2] - corners[0]).try_normalize().zip(edge.try_normalize()) else {
            continue;
        };
        if let Some(last) = polygons.last_mut()
            && last.is_like(surface, &corners, normal)
            && last.takes(&corners)
        {
            last.surfaces.push(*surface);
            continue;
        }
        let (radiance, two_sided) = (surface.radiance, surface.two_sided);
        polygons.push(Polygon { parts: vec![corners], normal, axis, radiance, two_sided, surfaces: vec![*surface] });
    }
    polygons
}

/// A convex polygon with a triangle that shares an edge, where both together are convex and have few corners.
fn joined(ring: &[DVec3], triangle: &[DVec3], normal: DVec3) -> Option<Vec<DVec3>> {
    let n = ring.len();
    if n >= PART {
        return None;
    }
    let i = (0..n).find(|&i| {
        let [a, b] = [ring[i], ring[(i + 1) % n]];
        (0..3).any(|j| triangle[j] == b && triangle[(j + 1) % 3] == a)
    })?;
    let [a, b] = [ring[i], ring[(i + 1) % n]];
    let d = *triangle.iter().find(|p| **p != a && **p != b)?;
    let mut ring = ring.to_vec();
    ring.insert(i + 1, d);
    let is_convex = (0..=n).all(|k| {
        let [p, q, r] = [0, 1, 2].map(|m| ring[(k + m) % (n + 1)]);
        (q - p).cross(r - q).dot(normal) > 1e-6 * (q - p).length() * (r - q).length()
    });
    is_convex.then_some(ring)
}

impl Polygon {
    fn corners(&self) -> impl Iterator<Item = &DVec3> {
        self.parts.iter().flatten()
    }

    /// A triangle is like those that it has, and in their plane.
    fn is_like(&self, surface: &EmissiveSurface, triangle: &[DVec3], normal: DVec3) -> bool {
        let Some(first) = self.surfaces.first() else { return false };
        let is_like =
            first.instance == surface.instance && first.radiance == surface.radiance && first.two_sided == surface.two_sided;
        let origin = self.parts[0][0];
        let is_flat = || triangle.iter().all(|p| (*p - origin).dot(self.normal).abs() <= f64::from(NEAR) * p.abs().max_element());
        is_like && normal.dot(self.normal) > 0.999 && is_flat()
    }

    /// Adds a triangle of its plane, to a part or as one, unless it lies too far from the others.
    fn takes(&mut self, triangle: &[DVec3]) -> bool {
        for part in &mut self.parts {
            if let Some(joined) = joined(part, triangle, self.normal) {
                *part = joined;
                return true;
            }
        }
        let [x, y] = [self.axis, self.normal.cross(self.axis)];
        let origin = self.parts[0][0];
        let mut bounds = Rectangle::EMPTY;
        self.corners().chain(triangle).for_each(|p| bounds.take(DVec2::new((*p - origin).dot(x), (*p - origin).dot(y))));
        let area = |corners: &[DVec3]| area_vector(corners).length();
        let covered: f64 = self.parts.iter().map(|part| area(part)).sum::<f64>() + area(triangle);
        let is_near = self.parts.len() < PARTS && bounds.area() <= SPREAD * covered;
        if is_near {
            self.parts.push(triangle.to_vec());
        }
        is_near
    }

    /// As that of surfaces ([`EmissiveSurface::power`]).
    pub(crate) fn power(&self) -> f32 {
        self.surfaces.iter().map(EmissiveSurface::power).sum()
    }

    /// As a receiver sees it; `Ok(None)` where nothing of it is seen. An error where the horizons of both normals disagree about it: nothing is said then.
    pub(crate) fn seen_from(&self, receiver: &Receiver) -> Result<Option<Seen>, Unclear> {
        let p = receiver.p.as_dvec3();
        let height = self.normal.dot(self.parts[0][0] - p);
        let is_front = height < 0.0;
        if height == 0.0 || !(is_front || self.two_sided) {
            return Ok(None);
        }
        let z = if is_front { -self.normal } else { self.normal };
        let axes = [self.axis, z.cross(self.axis), z];
        let along = |v: DVec3| DVec3::from(axes.map(|axis| axis.dot(v)));
        let (n, side, height) = (along(receiver.n.as_dvec3()), along(receiver.side.as_dvec3()), height.abs());
        let is_bent = receiver.side.dot(receiver.n) < FLAT;
        let mut seen = Seen {
            parts: Vec::with_capacity(self.parts.len()),
            bounds: Rectangle::EMPTY,
            is_cut: false,
            axes,
            n,
            height,
            near: 0.0,
            tiny: 0.0,
        };
        for part in &self.parts {
            let mut piece = Piece::new(part.iter().map(|corner| along(*corner - p).truncate()))?;
            if is_front {
                piece.reverse();
            }
            let n_above = piece.n_above(n, height);
            seen.is_cut |= n_above < part.len();
            if n_above == 0 {
                continue;
            }
            if is_bent && piece.n_above(side, height) < part.len() {
                return Err(Unclear);
            }
            if n_above < part.len() {
                piece = piece.above(n, height)?;
            }
            if piece.corners().len() >= 3 {
                piece.corners().iter().for_each(|c| seen.bounds.take(*c));
                seen.parts.push(piece);
            }
        }
        if seen.parts.is_empty() {
            return Ok(None);
        }
        let largest = self.corners().fold(receiver.p.abs().max_element(), |m, c| m.max(c.abs().max_element() as f32));
        seen.near = f64::from(NEAR * largest);
        seen.tiny = TINY * seen.bounds.corners().map(|c| c.extend(height).length()).into_iter().fold(0.0, f64::max);
        Ok(Some(seen))
    }
}

impl Seen {
    /// Half spaces that hold the pyramid between the receiver and it: triangles outside of one hide nothing.
    pub(crate) fn region(&self, receiver: &Receiver) -> [HalfSpace; 6] {
        let (p, near) = (receiver.p, self.near as f32);
        let [x, y, z] = self.axes;
        let corners = self.bounds.corners().map(|c| c.extend(self.height));
        let edge = |i: usize| {
            let wedge = corners[i].cross(corners[(i + 1) % 4]);
            let normal = (x * wedge.x + y * wedge.y + z * wedge.z).as_vec3();
            HalfSpace { normal, offset: normal.dot(p) }
        };
        let before = -z.as_vec3();
        let before = HalfSpace { normal: before, offset: before.dot(p) - self.height as f32 + near };
        let above = HalfSpace { normal: receiver.side, offset: receiver.side.dot(p) + near };
        [edge(0), edge(1), edge(2), edge(3), before, above]
    }

    /// `E/L_e` with nothing between.
    pub(crate) fn unshadowed(&self) -> f32 {
        self.parts.iter().map(|part| part.projected(self.n, self.height)).sum::<f64>() as f32
    }

    /// The horizon cuts the polygon.
    pub(crate) fn is_cut(&self) -> bool {
        self.is_cut
    }

    /// `E/L_e` past some triangles.
    pub(crate) fn past(&self, p: Vec3, blockers: &[Triangle]) -> Result<f32, Unclear> {
        let along = |corner: Vec3| {
            let from = corner.as_dvec3() - p.as_dvec3();
            DVec3::from(self.axes.map(|axis| axis.dot(from)))
        };
        let mut pieces = Vec::with_capacity(PIECES + CORNERS);
        pieces.extend_from_slice(&self.parts);
        let mut k = 0;
        while let Some(blocker) = blockers.get(k) {
            let whole = blockers.get(k + 1).and_then(|next| quadrilateral(blocker, next));
            k += 1 + usize::from(whole.is_some());
            let [a, b, c] = blocker.corners;
            let cone = match whole {
                Some(corners) => Cone::over(&corners.map(along), self.height, self.near, &self.bounds)?,
                None => Cone::over(&[a, b, c].map(along), self.height, self.near, &self.bounds)?,
            };
            let Some(cone) = cone else { continue };
            // From the end: what is left of a piece goes behind all that are still to be asked.
            for i in (0..pieces.len()).rev() {
                cone.cut_out(i, &mut pieces, self.tiny)?;
            }
            if pieces.is_empty() {
                return Ok(0.0);
            }
            if pieces.len() > PIECES {
                return Err(Unclear);
            }
        }
        Ok(pieces.iter().map(|piece| piece.projected(self.n, self.height)).sum::<f64>() as f32)
    }
}

/// Two triangles of one mesh that are a flat convex quadrilateral together: it has two sides less than they have.
fn quadrilateral(first: &Triangle, second: &Triangle) -> Option<[Vec3; 4]> {
    let i = (0..3).find(|&i| {
        let [a, b] = [first.corners[i], first.corners[(i + 1) % 3]];
        (0..3).any(|j| second.corners[j] == b && second.corners[(j + 1) % 3] == a)
    })?;
    let [a, b, c] = [0, 1, 2].map(|k| first.corners[(i + k) % 3]);
    let d = *second.corners.iter().find(|p| **p != a && **p != b)?;
    let largest = [a, b, c, d].iter().fold(0.0, |m: f32, p| m.max(p.abs().max_element()));
    let corners = [a, d, b, c];
    let ring = corners.map(|p| p.as_dvec3());
    let normal = (ring[2] - ring[0]).cross(ring[3] - ring[0]).try_normalize()?;
    let is_flat = (ring[1] - ring[0]).dot(normal).abs() <= f64::from(gamma(4) * largest);
    let turns = |k: usize| {
        let [p, q, r] = [0, 1, 2].map(|m| ring[(k + m) % 4]);
        (q - p).cross(r - q).dot(normal)
    };
    (is_flat && (0..4).all(|k| turns(k) > 0.0)).then_some(corners)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::{Stream, sequence, warp};
    use crate::scene::InstanceId;

    const CORNERS: [[f32; 3]; 4] = [[-1.0, -0.8, 2.0], [-1.0, 0.9, 2.1], [1.2, 0.9, 2.1], [1.2, -0.8, 2.0]];

    fn quadrilateral(two_sided: bool) -> Polygon {
        let [a, b, c, d] = CORNERS.map(Vec3::from_array);
        let surface = |corners, primitive| EmissiveSurface {
            shape: EmissiveShape::Triangle(corners),
            radiance: Spectrum::WHITE,
            two_sided,
            instance: InstanceId(0),
            primitive,
        };
        let made = polygons(&[surface([a, b, c], 0), surface([a, c, d], 1)]);
        assert!(made.len() == 1 && made[0].parts.len() == 1 && made[0].parts[0].len() == 4 && made[0].surfaces.len() == 2);
        made.into_iter().next().expect("one")
    }

    fn receiver(n: Vec3) -> Receiver {
        Receiver { p: Vec3::new(0.1, -0.2, 0.3), n: n.normalize(), side: n.normalize() }
    }

    /// True when a segment from the receiver along a direction meets a triangle before the quadrilateral's plane.
    fn is_blocked(p: Vec3, dir: Vec3, end: f32, t: &Triangle) -> bool {
        let [a, b, c] = t.corners.map(|v| v - p);
        let normal = (b - a).cross(c - a);
        let at = a.dot(normal) / dir.dot(normal);
        let sides = [(a, b), (b, c), (c, a)].map(|(u, v)| u.cross(v).dot(dir) > 0.0);
        at > 0.0 && at < end && (sides == [true; 3] || sides == [false; 3])
    }

    /// `E/L_e` by cosine-weighted directions.
    fn by_directions(polygon: &Polygon, receiver: &Receiver, blockers: &[Triangle]) -> f32 {
        const N: u32 = 1 << 18;
        let frame = crate::math::Frame::from_normal(receiver.n);
        let corners: Vec<Vec3> = polygon.parts[0].iter().map(|c| c.as_vec3() - receiver.p).collect();
        let normal = polygon.normal.as_vec3();
        let seen = (0..N).filter(|&i| {
            let dir = frame.to_world(warp::cosine_hemisphere(sequence::point_2d(i, 7)));
            let end = corners[0].dot(normal) / dir.dot(normal);
            let inside = (0..corners.len()).map(|k| corners[k].cross(corners[(k + 1) % corners.len()]).dot(dir) > 0.0);
            let (all, none) = inside.fold((true, true), |(all, none), side| (all && side, none && !side));
            end > 0.0 && (all || none) && !blockers.iter().any(|t| is_blocked(receiver.p, dir, end, t))
        });
        std::f32::consts::PI * seen.count() as f32 / N as f32
    }

    #[test]
    fn what_triangles_leave_of_a_quadrilateral_is_what_rays_see_of_it() {
        let mut stream = Stream::new(5, 0, 0);
        let (polygon, mut cut, mut caught) = (quadrilateral(false), 0, 0);
        for n in [Vec3::Z, Vec3::new(0.9, 0.1, 0.3), Vec3::new(-0.2, 1.0, -0.1)] {
            for _ in 0..12 {
                let receiver = receiver(n);
                let seen = polygon.seen_from(&receiver).expect("one normal").expect("it is seen");
                let mut blockers: Vec<Triangle> = Vec::new();
                for primitive in 0..3 {
                    let mut corner =
                        || Vec3::new(stream.next_f32() * 3.0 - 1.5, stream.next_f32() * 3.0 - 1.5, 0.5 + 2.0 * stream.next_f32());
                    blockers.push(Triangle { instance: 1, primitive, corners: [corner(), corner(), corner()] });
                }
                let (past, truth) =
                    (seen.past(receiver.p, &blockers).expect("few pieces"), by_directions(&polygon, &receiver, &blockers));
                assert!((past - truth).abs() < 2e-3, "{past} instead of {truth}");
                cut += u32::from(past < 0.99 * seen.unshadowed());
                // The twin forgets one of the triangles.
                caught += u32::from((seen.past(receiver.p, &blockers[1..]).expect("few pieces") - truth).abs() > 4e-3);
            }
        }
        assert!(cut > 15 && caught > 8, "{cut} are in shadow, {caught} twins caught");
    }

    #[test]
    fn fronts_backs_and_horizons() {
        let behind = Receiver { p: Vec3::new(0.0, 0.0, 4.0), n: Vec3::NEG_Z, side: Vec3::NEG_Z };
        assert!(quadrilateral(false).seen_from(&behind).expect("one normal").is_none());
        let both = quadrilateral(true);
        let seen = both.seen_from(&behind).expect("one normal").expect("its back emits");
        assert!((seen.unshadowed() - by_directions(&both, &behind, &[])).abs() < 2e-3);
        assert!(both.seen_from(&receiver(Vec3::NEG_Z)).expect("one normal").is_none());
        // Two horizons, the polygon across one of them.
        let bent = Receiver { n: Vec3::Z, side: Vec3::new(1.0, 0.0, 0.2).normalize(), ..receiver(Vec3::Z) };
        assert!(both.seen_from(&bent).is_err());
    }
}
