//! Polygons into triangles, whatever their shape: convex, concave, with holes cut open by keyholes.

use earcut::Earcut;

use crate::math::{DVec2, DVec3};

/// A corner product below this share of the squared size of its polygon is rounding, not area.
const FLAT: f64 = 1e-14;

/// Ear cutting takes time proportional to the square of the number of corners for polygons that cross or retrace themselves (15 ns
/// and more for each square), far less for sound ones. What a file may spend on it; beyond, fans have to do.
const BUDGET: u64 = 1 << 25;

/// The most corners of a polygon that is cut by ears: sound outlines of more are not worth what unsound ones cost (the third power).
const MOST_CORNERS: u64 = 4096;

/// Cuts polygons, keeping memory from one to the next.
pub(super) struct Cutter {
    earcut: Earcut<f64>,
    budget: u64,
    points: Vec<DVec3>,
    flat: Vec<DVec2>,
    cut: Vec<u32>,
    /// Polygons cut as fans although they are not convex.
    pub fans: u64,
}

impl Cutter {
    pub(super) fn new() -> Self {
        Self { earcut: Earcut::new(), budget: BUDGET, points: Vec::new(), flat: Vec::new(), cut: Vec::new(), fans: 0 }
    }

    /// Triangles of a polygon as indices of its corners, wound as it is, without those that have no area; replaces what
    /// `triangles` held. Returns the unit normal of the polygon, `None` when it has no area.
    pub(super) fn cut(&mut self, corners: impl Iterator<Item = DVec3>, triangles: &mut Vec<[u32; 3]>) -> Option<DVec3> {
        triangles.clear();
        self.points.clear();
        self.points.extend(corners);
        let origin = *self.points.first()?;
        let size = self.points.iter().map(|p| (*p - origin).abs().max_element()).fold(0.0, f64::max);
        if size == 0.0 {
            return None;
        }
        // Relative to a corner and to the size: neither tiny nor huge polygons lose digits or range.
        for p in &mut self.points {
            *p = (*p - origin) / size;
        }
        let p = &self.points;
        let n = p.len();
        if n == 3 {
            let normal = p[1].cross(p[2]);
            if normal.length() <= FLAT {
                return None;
            }
            triangles.push([0, 1, 2]);
            return Some(normal.normalize());
        }
        // Newell: the sum of the corner products, the normal of the plane that fits best, long as twice the area.
        let normal: DVec3 = (0..n).map(|i| p[i].cross(p[(i + 1) % n])).sum();
        let has_plane = normal.length() > FLAT;
        if has_plane {
            // Onto the coordinate plane that shows most of it, mirrored where needed so that it stays counter-clockwise.
            let a = normal.abs();
            let project: fn(DVec3) -> DVec2 = match (a.x >= a.y && a.x >= a.z, a.y >= a.z) {
                (true, _) => |q| DVec2::new(q.y, q.z),
                (_, true) => |q| DVec2::new(q.z, q.x),
                _ => |q| DVec2::new(q.x, q.y),
            };
            let dominant = if a.x >= a.y && a.x >= a.z {
                normal.x
            } else if a.y >= a.z {
                normal.y
            } else {
                normal.z
            };
            let mirror = DVec2::new(dominant.signum(), 1.0);
            self.flat.clear();
            self.flat.extend(p.iter().map(|q| project(*q) * mirror));
            match self.convex_apex() {
                Some(apex) => fan(n as u32, apex, triangles),
                None => self.ears(triangles),
            }
        } else {
            // It crosses itself so that its area cancels: a fan keeps what there is to see.
            fan(n as u32, 0, triangles);
        }
        let p = &self.points;
        let cross = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| p[i as usize]);
            (b - a).cross(c - a)
        };
        triangles.retain(|t| cross(t).length() > FLAT);
        let first = triangles.first()?;
        Some(if has_plane { normal } else { cross(first) }.normalize())
    }

    /// If the polygon in `flat` is convex: a corner from which a fan has no triangle without area.
    fn convex_apex(&self) -> Option<u32> {
        /// How many apexes to try: corners on straight edges spoil some.
        const TRIES: usize = 8;
        let p = &self.flat;
        let n = p.len();
        let (mut straight, mut x_turns, mut y_turns) = (false, 0, 0);
        let mut before = p[0] - p[n - 1];
        for i in 0..n {
            let after = p[(i + 1) % n] - p[i];
            let turn = before.perp_dot(after);
            if turn < -FLAT || after == DVec2::ZERO {
                return None;
            }
            straight |= turn <= FLAT;
            // A star turns left at each corner as well, but more than once around.
            x_turns += u32::from((before.x < 0.0) != (after.x < 0.0));
            y_turns += u32::from((before.y < 0.0) != (after.y < 0.0));
            before = after;
        }
        if x_turns > 2 || y_turns > 2 {
            return None;
        }
        if !straight {
            return Some(0);
        }
        let area = |a: usize, b: usize, c: usize| (p[b] - p[a]).perp_dot(p[c] - p[a]);
        (0..n.min(TRIES))
            .find(|&apex| (1..n - 1).all(|i| area(apex, (apex + i) % n, (apex + i + 1) % n) > FLAT))
            .map(|a| a as u32)
    }

    /// Cuts the polygon in `flat` ear by ear.
    fn ears(&mut self, triangles: &mut Vec<[u32; 3]>) {
        let n = self.flat.len() as u64;
        self.cut.clear();
        if n <= MOST_CORNERS && self.budget > 0 {
            self.earcut.earcut(self.flat.iter().map(|p| p.to_array()), &[], &mut self.cut);
        }
        let p = &self.flat;
        let mut area = 0.0;
        triangles.extend(self.cut.chunks_exact(3).map(|t| {
            let [a, b, c] = [t[0], t[1], t[2]];
            let [pa, pb, pc] = [a, b, c].map(|i| p[i as usize]);
            let twice = (pb - pa).perp_dot(pc - pa);
            area += twice.abs();
            if twice < 0.0 { [a, c, b] } else { [a, b, c] }
        }));
        let expected: f64 = (0..p.len()).map(|i| p[i].perp_dot(p[(i + 1) % p.len()])).sum();
        let is_sound = (area - expected).abs() <= 1e-6 * expected;
        self.budget = self.budget.saturating_sub(if is_sound { n * n / 16 } else { n * n * (1 + n / 1024) });
        if triangles.is_empty() {
            self.fans += 1;
            fan(n as u32, 0, triangles);
        }
    }
}

fn fan(n: u32, apex: u32, triangles: &mut Vec<[u32; 3]>) {
    triangles.extend((1..n - 1).map(|i| [apex, (apex + i) % n, (apex + i + 1) % n]));
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cuts a polygon in the plane z = 2x and returns (number of triangles, their area seen from above, normal).
    fn check(points: &[[f64; 2]]) -> (usize, f64, DVec3) {
        let lifted: Vec<_> = points.iter().map(|&[x, y]| DVec3::new(x, y, 2.0 * x)).collect();
        let mut triangles = Vec::new();
        let normal = Cutter::new().cut(lifted.iter().copied(), &mut triangles).expect("it has area");
        let area = triangles.iter().map(|t| {
            let [a, b, c] = t.map(|i| lifted[i as usize].truncate());
            0.5 * (b - a).perp_dot(c - a)
        });
        (triangles.len(), area.inspect(|a| assert!(*a > 0.0, "a triangle is turned over")).sum(), normal)
    }

    #[test]
    fn convex_polygons_become_fans() {
        let (n, area, normal) = check(&[[0., 0.], [2., 0.], [2., 1.], [0., 1.]]);
        assert_eq!((n, area), (2, 2.0));
        assert!((normal - DVec3::new(-2.0, 0.0, 1.0).normalize()).length() < 1e-15);
    }

    #[test]
    fn corners_on_straight_edges_stay_corners() {
        let (n, area, _) = check(&[[0., 0.], [1., 0.], [2., 0.], [2., 1.], [0., 1.]]);
        assert_eq!((n, area), (3, 2.0));
    }

    #[test]
    fn concave_polygons_keep_their_area() {
        let l_shape = [[0., 0.], [3., 0.], [3., 1.], [1., 1.], [1., 2.], [0., 2.]];
        for shift in 0..l_shape.len() {
            let mut points = l_shape;
            points.rotate_left(shift);
            let (n, area, _) = check(&points);
            assert_eq!(n, 4);
            assert!((area - 4.0).abs() < 1e-12);
        }
        let (_, dart, _) = check(&[[0., 0.], [2., 1.], [0., 2.], [0.5, 1.]]);
        assert!((dart - 1.5).abs() < 1e-12);
    }

    #[test]
    fn keyholed_polygons_keep_their_holes_open() {
        let square_with_hole = [
            [0., 0.],
            [4., 0.],
            [4., 4.],
            [0., 4.],
            [0., 0.], // around the outside and back
            [1., 1.],
            [1., 3.],
            [3., 3.],
            [3., 1.],
            [1., 1.], // around the hole the other way and back
        ];
        let (_, area, _) = check(&square_with_hole);
        assert!((area - 12.0).abs() < 1e-12, "{area}");
    }

    #[test]
    fn polygons_without_area_say_so() {
        let mut triangles = Vec::new();
        for points in [[[0.0; 3]; 4], [[0., 0., 0.], [1., 2., 3.], [2., 4., 6.], [-1., -2., -3.]]] {
            assert_eq!(Cutter::new().cut(points.into_iter().map(DVec3::from), &mut triangles), None);
            assert!(triangles.is_empty());
        }
    }

    #[test]
    fn scale_and_place_do_not_matter() {
        for scale in [1e-150, 1e-6, 1.0, 1e6, 1e17] {
            let mut triangles = Vec::new();
            let l = [[0., 0.], [3., 0.], [3., 1.], [1., 1.], [1., 2.], [0., 2.]];
            Cutter::new().cut(l.iter().map(|&[x, y]| DVec3::new(x, 5.0, y) * scale), &mut triangles).expect("it has area");
            assert_eq!(triangles.len(), 4, "at scale {scale}");
        }
    }
}
