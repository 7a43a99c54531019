//! Flat emissive surfaces in closed form, with what triangles hide of them cut out: their light without noise.
//!
//! ```text
//! E = L_e/2 Σ_edges n·Γ      Γ: unit normal of the wedge (point, edge), times its angle [Baum89]
//! ```
//!
//! What a point sees of a convex polygon past a triangle is the polygon less the cone over the triangle: at most as many convex pieces as the cone has sides.
//! All triangles that can matter reach into the pyramid between point and polygon; where they are many nothing is said, and others have to draw points.

use super::area::{EmissiveShape, EmissiveSurface};
use crate::accel::{HalfSpace, Triangle};
use crate::math::rounding::gamma;
use crate::math::{DVec3, Vec3, function};
use crate::spectrum::Spectrum;

/// Corners of a piece at most.
const CORNERS: usize = 10;
/// Pieces at most.
const PIECES: usize = 48;
/// Triangles that are cut out at most.
pub(crate) const BLOCKERS: usize = 96;
/// What lies nearer than this to a plane lies in it, in parts of the largest coordinate.
const NEAR: f32 = gamma(64);
/// Smaller than this in units of the lengths that make it, a side of a cone is none.
const TINY: f64 = 1e-9;
/// The cosine between both normals of what counts as flat.
const FLAT: f32 = 1.0 - 1e-6;

/// A flat convex emissive surface.
#[derive(Clone, Debug)]
pub(crate) struct Polygon {
    /// Counter-clockwise seen from the front, three or four.
    corners: Vec<DVec3>,
    /// Unit, the front's.
    normal: DVec3,
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

/// What of a polygon a receiver might see.
#[derive(Clone, Debug)]
pub(crate) struct Seen {
    /// Above the horizon, relative to the receiver, counter-clockwise about the direction to it.
    whole: Piece,
    is_cut: bool,
    n: DVec3,
    /// The polygon's plane: `normal·x = height`, the normal away from the receiver.
    normal: DVec3,
    height: f64,
    /// What lies nearer than this to the plane lies in it, metres.
    near: f64,
    /// Smaller than this, a distance from a plane through the receiver is none, metres.
    tiny: f64,
    /// The pyramid between receiver and polygon.
    region: [HalfSpace; CORNERS + 2],
}

/// A convex polygon, relative to a point.
#[derive(Clone, Copy, Debug)]
struct Piece {
    corners: [DVec3; CORNERS],
    n: usize,
}

/// The flat ones of emissive surfaces. Triangles next to each other in the scene that share an edge and a plane, and together are convex, are one.
pub(crate) fn polygons(surfaces: &[EmissiveSurface]) -> Vec<Polygon> {
    let mut polygons: Vec<Polygon> = Vec::new();
    for surface in surfaces {
        let EmissiveShape::Triangle(corners) = surface.shape else { continue };
        let corners: Vec<DVec3> = corners.iter().map(|p| p.as_dvec3()).collect();
        let Some(normal) = (corners[1] - corners[0]).cross(corners[2] - corners[0]).try_normalize() else { continue };
        if let Some(last) = polygons.last_mut()
            && let Some(joined) = last.joined(surface, &corners, normal)
        {
            last.corners = joined;
            last.surfaces.push(*surface);
            continue;
        }
        let (radiance, two_sided) = (surface.radiance, surface.two_sided);
        polygons.push(Polygon { corners, normal, radiance, two_sided, surfaces: vec![*surface] });
    }
    polygons
}

impl Polygon {
    /// Its corners with those of another triangle, where both together are one quadrilateral.
    fn joined(&self, surface: &EmissiveSurface, triangle: &[DVec3], normal: DVec3) -> Option<Vec<DVec3>> {
        let first = self.surfaces.first()?;
        let is_like =
            first.instance == surface.instance && first.radiance == surface.radiance && first.two_sided == surface.two_sided;
        let is_flat =
            || triangle.iter().all(|p| (*p - self.corners[0]).dot(self.normal).abs() <= f64::from(NEAR) * p.abs().max_element());
        if !is_like || self.corners.len() != 3 || normal.dot(self.normal) < 0.999 || !is_flat() {
            return None;
        }
        let i = (0..3).find(|&i| {
            let [a, b] = [self.corners[i], self.corners[(i + 1) % 3]];
            (0..3).any(|j| triangle[j] == b && triangle[(j + 1) % 3] == a)
        })?;
        let [a, b, c] = [0, 1, 2].map(|k| self.corners[(i + k) % 3]);
        let d = *triangle.iter().find(|p| **p != a && **p != b)?;
        let ring = [a, d, b, c];
        let is_convex = (0..4).all(|k| {
            let [p, q, r] = [0, 1, 2].map(|m| ring[(k + m) % 4]);
            (q - p).cross(r - q).dot(self.normal) > 1e-6 * (q - p).length() * (r - q).length()
        });
        is_convex.then(|| ring.to_vec())
    }

    /// As that of surfaces ([`EmissiveSurface::power`]).
    pub(crate) fn power(&self) -> f32 {
        self.surfaces.iter().map(EmissiveSurface::power).sum()
    }

    /// As a receiver sees it; `Ok(None)` where nothing of it is seen. An error where the horizons of both normals disagree about it: nothing is said then.
    pub(crate) fn seen_from(&self, receiver: &Receiver) -> Result<Option<Seen>, Unclear> {
        let p = receiver.p.as_dvec3();
        let mut whole = Piece::EMPTY;
        for corner in &self.corners {
            whole.push(*corner - p)?;
        }
        let height = self.normal.dot(whole.corners[0]);
        let is_front = height < 0.0;
        if height == 0.0 || !(is_front || self.two_sided) {
            return Ok(None);
        }
        if is_front {
            whole.corners[..whole.n].reverse();
        }
        let normal = if is_front { -self.normal } else { self.normal };
        let n = receiver.n.as_dvec3();
        let above = |n: DVec3| whole.corners().iter().filter(|c| c.dot(n) > 0.0).count();
        let n_above = above(n);
        if n_above == 0 {
            return Ok(None);
        }
        if receiver.side.dot(receiver.n) < FLAT && above(receiver.side.as_dvec3()) < whole.n {
            return Err(Unclear);
        }
        if n_above < whole.n {
            whole = whole.cut(n)?.0;
            if whole.n < 3 {
                return Ok(None);
            }
        }
        let largest = self.corners.iter().fold(receiver.p.abs().max_element(), |m, c| m.max(c.abs().max_element() as f32));
        let near = f64::from(NEAR * largest);
        let height = height.abs();
        let tiny = TINY * whole.corners().iter().fold(0.0, |m: f64, c| m.max(c.length_squared())).sqrt();
        let is_cut = n_above < self.corners.len();
        let mut seen = Seen { whole, is_cut, n, normal, height, near, tiny, region: [HalfSpace::default(); CORNERS + 2] };
        seen.bound(receiver, near as f32);
        Ok(Some(seen))
    }
}

/// It cannot be said, or only at too high a cost.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Unclear;

impl Seen {
    /// Sets up the pyramid.
    fn bound(&mut self, receiver: &Receiver, near: f32) {
        let p = receiver.p;
        let k = self.whole.n;
        for i in 0..k {
            let (a, b) = (self.whole.corners[i], self.whole.corners[(i + 1) % k]);
            let normal = a.cross(b).as_vec3();
            self.region[i] = HalfSpace { normal, offset: normal.dot(p) };
        }
        let before = -self.normal.as_vec3();
        self.region[k] = HalfSpace { normal: before, offset: before.dot(p) - self.height as f32 + near };
        self.region[k + 1] = HalfSpace { normal: receiver.side, offset: receiver.side.dot(p) + near };
    }

    /// Triangles outside of this hide nothing of it.
    pub(crate) fn region(&self) -> &[HalfSpace] {
        &self.region[..self.whole.n + 2]
    }

    /// `E/L_e` with nothing between.
    pub(crate) fn unshadowed(&self) -> f32 {
        self.whole.projected(self.n) as f32
    }

    /// The horizon cuts the polygon.
    pub(crate) fn is_cut(&self) -> bool {
        self.is_cut
    }

    /// `E/L_e` past some triangles.
    pub(crate) fn past(&self, p: Vec3, blockers: &[Triangle]) -> Result<f32, Unclear> {
        let p = p.as_dvec3();
        let mut pieces = vec![self.whole];
        let mut k = 0;
        while let Some(blocker) = blockers.get(k) {
            let whole = blockers.get(k + 1).and_then(|next| quadrilateral(blocker, next));
            k += 1 + usize::from(whole.is_some());
            let cone = match whole {
                Some(corners) => self.cone(&corners.map(|c| c - p))?,
                None => self.cone(&blocker.corners.map(|c| c.as_dvec3() - p))?,
            };
            let Some((sides, n_sides)) = cone else { continue };
            // From the end: what is left of a piece goes behind all that are still to be asked.
            for i in (0..pieces.len()).rev() {
                if !pieces[i].is_outside(&sides[..n_sides], self.tiny) {
                    pieces.swap_remove(i).less(&sides[..n_sides], &mut pieces)?;
                }
            }
            if pieces.is_empty() {
                return Ok(0.0);
            }
            if pieces.len() > PIECES {
                return Err(Unclear);
            }
        }
        Ok(pieces.iter().map(|piece| piece.projected(self.n)).sum::<f64>() as f32)
    }

    /// The planes through the point and the edges of what of a convex polygon lies before this one, their normals inwards.
    fn cone(&self, corners: &[DVec3]) -> Result<Option<([DVec3; 5], usize)>, Unclear> {
        let mut blocker = Piece::EMPTY;
        for corner in corners {
            blocker.push(*corner)?;
        }
        let before = |c: &DVec3| self.height - c.dot(self.normal) > self.near;
        if !corners.iter().all(before) {
            blocker = blocker.cut_at(-self.normal, self.near - self.height)?;
        }
        let facing = blocker.corners[0].dot(area_vector(blocker.corners()));
        if blocker.n < 3 || facing == 0.0 {
            return Ok(None);
        }
        let sign = facing.signum();
        let (mut sides, mut n) = ([DVec3::ZERO; 5], 0);
        for i in 0..blocker.n {
            let (u, v) = (blocker.corners[i], blocker.corners[(i + 1) % blocker.n]);
            let side = u.cross(v) * sign;
            let length = side.length();
            if length > TINY * u.length() * v.length() {
                *sides.get_mut(n).ok_or(Unclear)? = side / length;
                n += 1;
            }
        }
        Ok((n >= 3).then_some((sides, n)))
    }
}

/// Two triangles of one mesh that are a flat convex quadrilateral together: it has two sides less than they have.
fn quadrilateral(first: &Triangle, second: &Triangle) -> Option<[DVec3; 4]> {
    let i = (0..3).find(|&i| {
        let [a, b] = [first.corners[i], first.corners[(i + 1) % 3]];
        (0..3).any(|j| second.corners[j] == b && second.corners[(j + 1) % 3] == a)
    })?;
    let [a, b, c] = [0, 1, 2].map(|k| first.corners[(i + k) % 3]);
    let d = *second.corners.iter().find(|p| **p != a && **p != b)?;
    let largest = [a, b, c, d].iter().fold(0.0, |m: f32, p| m.max(p.abs().max_element()));
    let ring = [a, d, b, c].map(|p| p.as_dvec3());
    let normal = (ring[2] - ring[0]).cross(ring[3] - ring[0]).try_normalize()?;
    let is_flat = (ring[1] - ring[0]).dot(normal).abs() <= f64::from(gamma(4) * largest);
    let turns = |k: usize| {
        let [p, q, r] = [0, 1, 2].map(|m| ring[(k + m) % 4]);
        (q - p).cross(r - q).dot(normal)
    };
    (is_flat && (0..4).all(|k| turns(k) > 0.0)).then_some(ring)
}

fn area_vector(corners: &[DVec3]) -> DVec3 {
    crate::math::polygon::area_vector(corners)
}

impl Piece {
    const EMPTY: Self = Self { corners: [DVec3::ZERO; CORNERS], n: 0 };

    fn corners(&self) -> &[DVec3] {
        &self.corners[..self.n]
    }

    fn push(&mut self, corner: DVec3) -> Result<(), Unclear> {
        *self.corners.get_mut(self.n).ok_or(Unclear)? = corner;
        self.n += 1;
        Ok(())
    }

    /// The parts on both sides of the plane through the point: where `normal` points to, and the rest.
    fn cut(&self, normal: DVec3) -> Result<(Self, Self), Unclear> {
        let (mut inside, mut outside) = (Self::EMPTY, Self::EMPTY);
        let mut a = self.corners[self.n - 1];
        let mut ha = a.dot(normal);
        for &b in self.corners() {
            let hb = b.dot(normal);
            if (ha < 0.0 && hb > 0.0) || (ha > 0.0 && hb < 0.0) {
                let between = a + (b - a) * (ha / (ha - hb));
                inside.push(between)?;
                outside.push(between)?;
            }
            if hb >= 0.0 {
                inside.push(b)?;
            }
            if hb <= 0.0 {
                outside.push(b)?;
            }
            (a, ha) = (b, hb);
        }
        Ok((inside, outside))
    }

    /// The part where `normal·x ≥ offset`.
    fn cut_at(&self, normal: DVec3, offset: f64) -> Result<Self, Unclear> {
        let mut inside = Self::EMPTY;
        let mut a = self.corners[self.n - 1];
        let mut ha = a.dot(normal) - offset;
        for &b in self.corners() {
            let hb = b.dot(normal) - offset;
            if (ha < 0.0 && hb > 0.0) || (ha > 0.0 && hb < 0.0) {
                inside.push(a + (b - a) * (ha / (ha - hb)))?;
            }
            if hb >= 0.0 {
                inside.push(b)?;
            }
            (a, ha) = (b, hb);
        }
        Ok(inside)
    }

    /// It lies outside of one of a cone's sides.
    fn is_outside(&self, sides: &[DVec3], tiny: f64) -> bool {
        sides.iter().any(|side| self.corners().iter().all(|c| c.dot(*side) <= tiny))
    }

    /// What is left of it without a cone, appended to `left`.
    fn less(&self, sides: &[DVec3], left: &mut Vec<Self>) -> Result<(), Unclear> {
        let mut rest = *self;
        for side in sides {
            let (inside, away) = rest.cut(*side)?;
            if away.n >= 3 {
                left.push(away);
            }
            rest = inside;
            if rest.n < 3 {
                break;
            }
        }
        Ok(())
    }

    /// Its projected solid angle, `∫ n·ω dω`.
    fn projected(&self, n: DVec3) -> f64 {
        let mut sum = 0.0;
        let Some(&last) = self.corners().last() else { return 0.0 };
        let mut a = last;
        for &b in self.corners() {
            let wedge = a.cross(b);
            let sine = wedge.length();
            if sine > 0.0 {
                sum += n.dot(wedge) * (function::atan2_f64(sine, a.dot(b)) / sine);
            }
            a = b;
        }
        (0.5 * sum).max(0.0)
    }
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
        assert!(made.len() == 1 && made[0].corners.len() == 4 && made[0].surfaces.len() == 2);
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
        let corners: Vec<Vec3> = polygon.corners.iter().map(|c| c.as_vec3() - receiver.p).collect();
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
