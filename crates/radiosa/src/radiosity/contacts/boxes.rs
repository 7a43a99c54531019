//! Which of many boxes touch one: a tree of halves, since pairs of patches are too many to try.

use crate::math::DVec3;

/// Boxes of a leaf at most.
const LEAF: usize = 4;

/// An axis-aligned box.
#[derive(Clone, Copy, Debug)]
pub(super) struct Box3 {
    low: DVec3,
    high: DVec3,
}

impl Box3 {
    /// Around some points.
    pub(super) fn of(points: &[DVec3]) -> Self {
        let empty = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (low, high) = points.iter().fold(empty, |(l, h), p| (l.min(*p), h.max(*p)));
        Self { low, high }
    }

    fn union(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// Wider by `by` on every side.
    pub(super) fn grown(&self, by: f64) -> Self {
        Self { low: self.low - by, high: self.high + by }
    }

    pub(super) fn diagonal(&self) -> f64 {
        (self.high - self.low).length()
    }

    pub(super) fn is_finite(&self) -> bool {
        self.low.is_finite() && self.high.is_finite()
    }

    fn touches(&self, other: &Self) -> bool {
        self.low.cmple(other.high).all() && other.low.cmple(self.high).all()
    }
}

/// A tree over boxes.
#[derive(Debug)]
pub(super) struct Boxes<'a> {
    bounds: &'a [Box3],
    /// Halved again and again: the upper half starts at `len / 2`.
    order: Vec<u32>,
    /// That of a range, then those of its lower and, from the index given, of its upper half.
    nodes: Vec<(Box3, usize)>,
}

impl<'a> Boxes<'a> {
    /// Over some of the boxes.
    pub(super) fn new(bounds: &'a [Box3], mut which: Vec<u32>) -> Self {
        let mut nodes = Vec::new();
        build(bounds, &mut which, &mut nodes);
        Self { bounds, order: which, nodes }
    }

    /// Calls `found` for every box that touches `of`, but for no more than about `most`.
    pub(super) fn touching(&self, of: &Box3, most: usize, mut found: impl FnMut(u32)) {
        let mut n = 0;
        let mut waiting = vec![(0, 0..self.order.len())];
        while let Some((node, range)) = waiting.pop() {
            let (around, upper) = self.nodes[node];
            if range.is_empty() || !around.touches(of) {
                continue;
            }
            if range.len() <= LEAF {
                for &i in self.order[range].iter().filter(|&&i| self.bounds[i as usize].touches(of)) {
                    n += 1;
                    found(i);
                }
                if n >= most {
                    return;
                }
                continue;
            }
            let middle = range.start + range.len() / 2;
            waiting.push((upper, middle..range.end));
            waiting.push((node + 1, range.start..middle));
        }
    }
}

fn build(bounds: &[Box3], which: &mut [u32], nodes: &mut Vec<(Box3, usize)>) {
    let of = |i: u32| bounds[i as usize];
    let all = which.iter().map(|&i| of(i)).reduce(Box3::union).unwrap_or(Box3 { low: DVec3::ZERO, high: DVec3::ZERO });
    let node = nodes.len();
    nodes.push((all, 0));
    if which.len() <= LEAF {
        return;
    }
    let centre = |i: u32| of(i).low + of(i).high;
    let (low, high) =
        which.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), &i| (l.min(centre(i)), h.max(centre(i))));
    let axis = (high - low).max_position();
    let middle = which.len() / 2;
    which.select_nth_unstable_by(middle, |&i, &j| centre(i)[axis].total_cmp(&centre(j)[axis]).then(i.cmp(&j)));
    let (lower, upper) = which.split_at_mut(middle);
    build(bounds, lower, nodes);
    nodes[node].1 = nodes.len();
    build(bounds, upper, nodes);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::rng;

    #[test]
    fn the_tree_finds_what_trying_each_finds() {
        let number = |k: u64| f64::from(rng::unit_f32((rng::mix(k) >> 32) as u32));
        let bounds: Vec<Box3> = (0..300u64)
            .map(|k| {
                let p = DVec3::new(number(6 * k), number(6 * k + 1), number(6 * k + 2));
                Box3::of(&[p, p + DVec3::new(number(6 * k + 3), number(6 * k + 4), number(6 * k + 5)) * 0.2])
            })
            .collect();
        for n in [0, 1, 4, 5, 9, 300usize] {
            let boxes = Boxes::new(&bounds[..n], (0..n as u32).collect());
            for of in &bounds {
                let mut found = Vec::new();
                boxes.touching(of, usize::MAX, |i| found.push(i));
                found.sort_unstable();
                let truth: Vec<u32> = (0..n as u32).filter(|&i| bounds[i as usize].touches(of)).collect();
                assert_eq!(found, truth, "of {n}");
            }
        }
    }
}
