//! Convex pieces of a plane as a point sees them, and the cones over what stands between, which are cut out of them.
//!
//! The point is the origin, the plane z = `height`: a plane through the point is a line in it, and all cuts are made in two dimensions.

use crate::math::polygon::area_vector;
use crate::math::{DVec2, DVec3, function};

/// Corners of a piece at most.
pub(super) const CORNERS: usize = 10;
/// Smaller than this in units of the lengths that make it, a side of a cone is none.
pub(super) const TINY: f64 = 1e-9;
/// Corners of what stands between at most, with one that the plane makes.
const SIDES: usize = 5;

/// It cannot be said, or only at too high a cost.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Unclear;

/// A convex piece of the plane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    corners: [DVec2; CORNERS],
    n: usize,
    /// What it lies within.
    bounds: Rectangle,
}

/// Parallel to the axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rectangle {
    low: DVec2,
    high: DVec2,
}

/// What a convex polygon hides.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cone {
    sides: [Line; SIDES],
    n: usize,
    bounds: Rectangle,
}

/// A plane through the point: the distance of (x, y) in the plane from it is `a x + b y + c`, metres.
#[derive(Clone, Copy, Debug, Default)]
struct Line {
    ab: DVec2,
    c: f64,
}

impl Rectangle {
    /// Of nothing.
    pub(super) const EMPTY: Self = Self { low: DVec2::INFINITY, high: DVec2::NEG_INFINITY };
    const ALL: Self = Self { low: DVec2::NEG_INFINITY, high: DVec2::INFINITY };

    /// Grows around a point.
    #[inline(always)]
    pub(super) fn take(&mut self, p: DVec2) {
        *self = Self { low: self.low.min(p), high: self.high.max(p) };
    }

    /// Counter-clockwise.
    pub(super) fn corners(&self) -> [DVec2; 4] {
        let Self { low, high } = *self;
        [low, DVec2::new(high.x, low.y), high, DVec2::new(low.x, high.y)]
    }

    /// m²
    pub(super) fn area(&self) -> f64 {
        (self.high - self.low).element_product()
    }

    #[inline(always)]
    fn meets(&self, other: &Self) -> bool {
        self.low.cmplt(other.high).all() && other.low.cmplt(self.high).all()
    }
}

impl Line {
    #[inline(always)]
    fn height(&self, p: DVec2) -> f64 {
        self.ab.dot(p) + self.c
    }

    /// Of the plane of unit normal `n`.
    fn new(n: DVec3, height: f64) -> Self {
        Self { ab: n.truncate(), c: n.z * height }
    }
}

impl Piece {
    const EMPTY: Self = Self { corners: [DVec2::ZERO; CORNERS], n: 0, bounds: Rectangle::EMPTY };

    /// Of these corners.
    pub(super) fn new(corners: impl Iterator<Item = DVec2>) -> Result<Self, Unclear> {
        let mut piece = Self::EMPTY;
        for corner in corners {
            piece.push(corner)?;
        }
        Ok(piece)
    }

    pub(super) fn corners(&self) -> &[DVec2] {
        &self.corners[..self.n]
    }

    /// Its corners the other way round.
    pub(super) fn reverse(&mut self) {
        self.corners[..self.n].reverse();
    }

    #[inline(always)]
    fn push(&mut self, corner: DVec2) -> Result<(), Unclear> {
        *self.corners.get_mut(self.n).ok_or(Unclear)? = corner;
        self.n += 1;
        self.bounds.take(corner);
        Ok(())
    }

    /// Corners above the horizon of a unit normal.
    pub(super) fn n_above(&self, n: DVec3, height: f64) -> usize {
        let horizon = Line::new(n, height);
        self.corners().iter().filter(|c| horizon.height(**c) > 0.0).count()
    }

    /// The part above the horizon of a unit normal.
    pub(super) fn above(&self, n: DVec3, height: f64) -> Result<Self, Unclear> {
        let (mut inside, mut outside) = (Self::EMPTY, Self::EMPTY);
        self.cut(&Line::new(n, height), &mut inside, &mut outside)?;
        Ok(inside)
    }

    /// The parts on both sides of a line, appended to two empty pieces.
    #[inline(always)]
    fn cut(&self, line: &Line, inside: &mut Self, outside: &mut Self) -> Result<(), Unclear> {
        let mut a = self.corners[self.n - 1];
        let mut ha = line.height(a);
        for &b in self.corners() {
            let hb = line.height(b);
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
        Ok(())
    }

    /// Its projected solid angle, `∫ n·ω dω`.
    pub(super) fn projected(&self, n: DVec3, height: f64) -> f64 {
        let mut sum = 0.0;
        let Some(last) = self.corners().last() else { return 0.0 };
        let mut a = last.extend(height);
        for b in self.corners() {
            let b = b.extend(height);
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

impl Cone {
    /// Over what of a convex polygon lies before the plane by more than `near`; none where it is seen edge on, or beside `whole`.
    pub(super) fn over(corners: &[DVec3], height: f64, near: f64, whole: &Rectangle) -> Result<Option<Self>, Unclear> {
        let (mut before, mut n) = ([DVec3::ZERO; SIDES], 0);
        let mut push = |corner: DVec3| {
            *before.get_mut(n).ok_or(Unclear)? = corner;
            n += 1;
            Ok::<(), Unclear>(())
        };
        let end = height - near;
        let Some(mut a) = corners.last() else { return Ok(None) };
        for b in corners {
            if (a.z < end) != (b.z < end) {
                push(*a + (*b - *a) * ((end - a.z) / (b.z - a.z)))?;
            }
            if b.z < end {
                push(*b)?;
            }
            a = b;
        }
        if n < 3 {
            return Ok(None);
        }
        let before = &before[..n];
        // What reaches behind the point has no bounds in the plane.
        let mut bounds = Rectangle::ALL;
        if before.iter().all(|c| c.z > TINY * height) {
            bounds = Rectangle::EMPTY;
            before.iter().for_each(|c| bounds.take(c.truncate() * (height / c.z)));
            if !bounds.meets(whole) {
                return Ok(None);
            }
        }
        let facing = before[0].dot(area_vector(before));
        if facing == 0.0 {
            return Ok(None);
        }
        let mut cone = Self { sides: [Line::default(); SIDES], n: 0, bounds };
        let mut u = before[n - 1];
        for &v in before {
            let side = u.cross(v) * facing.signum();
            let length = side.length();
            if length > TINY * u.length() * v.length() {
                cone.sides[cone.n] = Line::new(side / length, height);
                cone.n += 1;
            }
            u = v;
        }
        Ok((cone.n >= 3).then_some(cone))
    }

    /// Leaves of piece `i` what it does not hide, as new pieces behind all others; distances below `tiny` are none.
    pub(super) fn cut_out(&self, i: usize, pieces: &mut Vec<Piece>, tiny: f64) -> Result<(), Unclear> {
        let piece = &pieces[i];
        if !piece.bounds.meets(&self.bounds) {
            return Ok(());
        }
        // Sides that it lies on both sides of.
        let mut crossing = [false; SIDES];
        for (side, crosses) in self.sides[..self.n].iter().zip(&mut crossing) {
            let [low, high] = piece.corners().iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], c| {
                let h = side.height(*c);
                [low.min(h), high.max(h)]
            });
            if high <= tiny {
                return Ok(());
            }
            *crosses = low < 0.0;
        }
        let mut rest = pieces.swap_remove(i);
        for (side, _) in self.sides[..self.n].iter().zip(crossing).filter(|(_, crosses)| *crosses) {
            let (mut inside, mut outside) = (Piece::EMPTY, Piece::EMPTY);
            rest.cut(side, &mut inside, &mut outside)?;
            if outside.n >= 3 {
                pieces.push(outside);
            }
            rest = inside;
            if rest.n < 3 {
                break;
            }
        }
        Ok(())
    }
}
