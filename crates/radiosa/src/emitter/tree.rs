//! A tree over emissive surfaces that chooses one for a place in proportion to about what it gives there. Source: [ContyEstevez18].
//!
//! A node knows the box around its surfaces, the cone around their normals and their power. Seen from a place its importance is
//!
//! ```text
//! I = Φ cosθ′ cosθ / d²
//! ```
//!
//! with the largest cosines that box and cone allow, so that what can give light is never left out, and `d` not below the box's radius. A leaf
//! weighs its few surfaces by `L_e Ω` and the cosines towards them. Both children are weighed on the way down, with one random number for the
//! whole way: stratified numbers stay stratified over the surfaces.

use super::area::EmissiveSurface;
use super::seen::{EVERYWHERE, Seen};
use crate::math::{Bounds, Vec3};

/// Surfaces a leaf holds at most: their own importance is better than a box's, and costs a few times as much.
const LEAF: usize = 6;
/// Cosines within rounding of nothing still count.
const ROUNDING: f32 = 1e-4;
/// Positions along each axis where a node can be divided.
const SPLITS: usize = 3;

/// Emissive surfaces in a tree.
#[derive(Clone, Debug)]
pub(super) struct Tree {
    nodes: Vec<Node<Reach>>,
    /// In the order of the leaves.
    surfaces: Vec<EmissiveSurface>,
    /// Of each surface its leaf.
    leaves: Vec<u32>,
    /// Of each node the one above; the root's own is 0.
    parents: Vec<u32>,
}

/// A node of a tree that chooses light sources.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node<R> {
    /// Where its sources are and where they shine.
    pub(super) reach: R,
    /// Of a leaf the first of its sources; else the second child, the first being the next node.
    pub(super) at: u32,
    /// Sources of a leaf; 0 of an inner node.
    pub(super) count: u32,
}

/// The probability that the way down from an inner node takes its first child; not a number where neither gives light.
#[inline]
fn share_of_first<R>(nodes: &[Node<R>], node: usize, importance: impl Fn(&R) -> f32) -> f64 {
    let (first, second) = (node + 1, nodes[node].at as usize);
    let (a, b) = (importance(&nodes[first].reach), importance(&nodes[second].reach));
    f64::from(a) / (f64::from(a) + f64::from(b))
}

/// The leaf to which `u` in `[0, 1)` leads by importances, what is left of `u` for a choice there, and the probability; `None` where nothing gives light.
#[inline]
pub(super) fn descend<R>(nodes: &[Node<R>], u: f64, importance: impl Fn(&R) -> f32) -> Option<(&Node<R>, f64, f64)> {
    let mut u = u;
    let mut probability = 1.0;
    let mut at = 0;
    let mut node = nodes.first()?;
    while node.count == 0 {
        let (first, second) = (at + 1, node.at as usize);
        let share = share_of_first(nodes, at, &importance);
        if share.is_nan() {
            return None;
        }
        let is_first = u < share;
        (at, u) = if is_first { (first, u / share) } else { (second, (u - share) / (1.0 - share)) };
        probability *= if is_first { share } else { 1.0 - share };
        node = &nodes[at];
    }
    Some((node, u, probability))
}

/// Where a set of surfaces is and where it shines.
#[derive(Clone, Copy, Debug)]
struct Reach {
    centre: Vec3,
    /// Of the sphere around the box, squared, m².
    radius2: f32,
    /// The middle of the cone that holds all normals, and the cosine of its half angle.
    axis: Vec3,
    cos_cone: f32,
    two_sided: bool,
    /// `Σ L_e A`, twice that of two-sided ones.
    power: f32,
}

/// A surface while the tree grows.
#[derive(Clone, Copy)]
struct Leaf {
    index: usize,
    bounds: Bounds,
    /// The front, its length the area; zero when it shines everywhere.
    normal: Vec3,
    two_sided: bool,
    power: f32,
}

impl Tree {
    /// Of all surfaces that give light.
    pub(super) fn new(surfaces: &[EmissiveSurface]) -> Self {
        let mut leaves: Vec<Leaf> =
            surfaces.iter().enumerate().filter_map(|(index, surface)| Leaf::new(index, surface)).collect();
        let mut nodes = Vec::new();
        if !leaves.is_empty() {
            grow(&mut leaves, 0, &mut nodes);
        }
        let surfaces: Vec<_> = leaves.iter().map(|leaf| surfaces[leaf.index]).collect();
        let (mut leaf_of, mut parents) = (vec![0; surfaces.len()], vec![0; nodes.len()]);
        for (i, node) in nodes.iter().enumerate() {
            if node.count > 0 {
                leaf_of[node.at as usize..][..node.count as usize].fill(i as u32);
            } else {
                (parents[i + 1], parents[node.at as usize]) = (i as u32, i as u32);
            }
        }
        Self { nodes, surfaces, leaves: leaf_of, parents }
    }

    /// In the order of the leaves.
    pub(super) fn surfaces(&self) -> &[EmissiveSurface] {
        &self.surfaces
    }

    /// As [`Place::choose`], for one choice.
    pub(super) fn choose(&self, p: Vec3, n: Vec3, u: f64) -> Option<(Seen<'_>, f32)> {
        let (leaf, u, probability) = descend(&self.nodes, u, |reach| reach.importance(p, n))?;
        self.weigh(leaf, p, n).choose(u, probability)
    }

    /// Surface `k` of [`Self::surfaces`] as a place with normal `n` sees it, and the probability with which [`Place::choose`] chooses it; `None` where it gives
    /// nothing.
    pub(super) fn probability(&self, k: usize, p: Vec3, n: Vec3) -> Option<(Seen<'_>, f32)> {
        let mut at = self.leaves[k] as usize;
        let leaf = &self.nodes[at];
        let weighed = self.weigh(leaf, p, n);
        let seen = weighed.seen[k - leaf.at as usize]?;
        let mut probability = f64::from(seen.importance) / weighed.sum;
        while at != 0 {
            let parent = self.parents[at] as usize;
            let is_first = at == parent + 1;
            let share = share_of_first(&self.nodes, parent, |reach| reach.importance(p, n));
            probability *= if is_first { share } else { 1.0 - share };
            at = parent;
        }
        (probability > 0.0).then_some((seen, probability as f32))
    }

    /// As a place with normal `n` sees it.
    pub(super) fn seen_from(&self, p: Vec3, n: Vec3) -> Place<'_> {
        let only = self.nodes.first().filter(|root| root.count > 0).map(|root| self.weigh(root, p, n));
        Place { tree: self, p, n, only }
    }

    fn weigh(&self, leaf: &Node<Reach>, p: Vec3, n: Vec3) -> Weighed<'_> {
        let mut weighed = Weighed { seen: [const { None }; LEAF], sum: 0.0 };
        for (seen, surface) in weighed.seen.iter_mut().zip(&self.surfaces[leaf.at as usize..][..leaf.count as usize]) {
            *seen = Seen::new(surface, p, n);
            weighed.sum += seen.as_ref().map_or(0.0, |seen| f64::from(seen.importance));
        }
        weighed
    }
}

/// A tree as a place sees it.
pub(super) struct Place<'a> {
    tree: &'a Tree,
    p: Vec3,
    n: Vec3,
    /// Of a tree that is one leaf, its surfaces.
    only: Option<Weighed<'a>>,
}

impl<'a> Place<'a> {
    /// The surface that `u` in `[0, 1)` chooses, and with what probability; `None` where nothing can give light.
    pub(super) fn choose(&self, u: f64) -> Option<(Seen<'a>, f32)> {
        if let Some(only) = &self.only {
            return only.choose(u, 1.0);
        }
        self.tree.choose(self.p, self.n, u)
    }
}

/// The surfaces of a leaf as a place sees them.
struct Weighed<'a> {
    seen: [Option<Seen<'a>>; LEAF],
    /// Of their importances.
    sum: f64,
}

impl<'a> Weighed<'a> {
    fn choose(&self, u: f64, probability: f64) -> Option<(Seen<'a>, f32)> {
        if !(self.sum > 0.0 && self.sum.is_finite()) {
            return None;
        }
        let mut left = u * self.sum;
        let mut chosen = None;
        for candidate in self.seen.iter().flatten() {
            left -= f64::from(candidate.importance);
            chosen = Some(candidate);
            if left < 0.0 {
                break;
            }
        }
        chosen.map(|seen| (*seen, (probability * f64::from(seen.importance) / self.sum) as f32))
    }
}

impl Leaf {
    fn new(index: usize, surface: &EmissiveSurface) -> Option<Self> {
        let (power, bounds) = (surface.power(), surface.shape.bounds());
        (power > 0.0 && power.is_finite() && !bounds.is_empty()).then(|| Self {
            index,
            bounds,
            normal: surface.shape.area_vector(),
            two_sided: surface.two_sided,
            power,
        })
    }

    fn place(&self, axis: usize) -> f32 {
        self.bounds.centre()[axis]
    }
}

/// Makes the nodes over some leaves, which it sorts; `first` is where they stand.
fn grow(leaves: &mut [Leaf], first: usize, nodes: &mut Vec<Node<Reach>>) {
    let at = nodes.len();
    nodes.push(Node { reach: Reach::of(leaves), at: first as u32, count: leaves.len() as u32 });
    if leaves.len() <= LEAF {
        return;
    }
    let middle = divide(leaves);
    nodes[at].count = 0;
    let (a, b) = leaves.split_at_mut(middle);
    grow(a, first, nodes);
    nodes[at].at = nodes.len() as u32;
    grow(b, first + middle, nodes);
}

/// Sorts leaves into two halves, neither of them empty, of least cost `Σ Φ M`, `M` the surface of the box times the measure of the cone and what it
/// shines on (a simplification of the paper's). Returns where the second begins.
fn divide(leaves: &mut [Leaf]) -> usize {
    let places = leaves.iter().fold(Bounds::EMPTY, |b, leaf| b.with(leaf.bounds.centre()));
    let extent = places.extent();
    let mut best: Option<(f32, usize, f32)> = None;
    for axis in 0..3 {
        for k in 1..=SPLITS {
            let at = places.min[axis] + extent[axis] * k as f32 / (SPLITS + 1) as f32;
            let side = |is_first: bool| Reach::of_those(leaves.iter().filter(|leaf| (leaf.place(axis) < at) == is_first));
            let (Some(a), Some(b)) = (side(true), side(false)) else { continue };
            let cost = a.cost() + b.cost();
            if cost.is_finite() && best.is_none_or(|(least, ..)| cost < least) {
                best = Some((cost, axis, at));
            }
        }
    }
    match best {
        // Halves of very different size would make the tree deep.
        Some((_, axis, at)) => {
            leaves.sort_by(|a, b| a.place(axis).total_cmp(&b.place(axis)));
            let middle = leaves.partition_point(|leaf| leaf.place(axis) < at);
            let least = leaves.len().div_ceil(16);
            middle.clamp(least, leaves.len() - least)
        }
        None => leaves.len() / 2,
    }
}

impl Reach {
    fn of(leaves: &[Leaf]) -> Self {
        Self::of_those(leaves.iter()).expect("a node holds something")
    }

    fn of_those<'a>(leaves: impl Iterator<Item = &'a Leaf> + Clone) -> Option<Self> {
        let bounds = leaves.clone().fold(Bounds::EMPTY, |bounds, leaf| bounds.union(leaf.bounds));
        if bounds.is_empty() {
            return None;
        }
        let mut sum = Vec3::ZERO;
        let (mut power, mut two_sided) = (0.0, false);
        for leaf in leaves.clone() {
            // Fronts and backs of two-sided ones are alike: those that agree with the others count.
            sum += if leaf.two_sided && leaf.normal.dot(sum) < 0.0 { -leaf.normal } else { leaf.normal };
            power += leaf.power;
            two_sided |= leaf.two_sided;
        }
        let axis = sum.normalize_or_zero();
        let cos_cone = leaves
            .map(|leaf| {
                let cos = leaf.normal.normalize_or_zero().dot(axis);
                if leaf.normal == Vec3::ZERO || axis == Vec3::ZERO {
                    -1.0
                } else if leaf.two_sided {
                    cos.abs()
                } else {
                    cos
                }
            })
            .fold(1.0, f32::min);
        let radius2 = 0.25 * bounds.extent().length_squared();
        Some(Self { centre: bounds.centre(), radius2, axis, cos_cone, two_sided, power })
    }

    /// Expected cost of a wrong choice within.
    fn cost(&self) -> f32 {
        // 2π (1 − cos) of the cone, opened by the quarter turn that every piece shines on.
        let spread = 2.0 - cos_of_difference(self.cos_cone, 0.0).min(1.0) - self.cos_cone;
        self.power * self.radius2 * (0.1 + spread)
    }

    /// At least a constant part of what arrives at `p` with normal `n`; 0 only where nothing can.
    fn importance(&self, p: Vec3, n: Vec3) -> f32 {
        let to_light = self.centre - p;
        let d2 = to_light.length_squared();
        // The cosine of the half angle the sphere around the box is seen under.
        let cos_box = if d2 > self.radius2 { (1.0 - self.radius2 / d2).sqrt() } else { -1.0 };
        let wi = to_light / d2.sqrt().max(f32::MIN_POSITIVE);
        let mut cos_out = -self.axis.dot(wi);
        if self.two_sided {
            cos_out = cos_out.abs();
        }
        let cos_out = cos_of_difference(cos_of_difference(cos_out, self.cos_cone), cos_box);
        let cos_in = if n == EVERYWHERE { 1.0 } else { cos_of_difference(n.dot(wi), cos_box) };
        if cos_out <= -ROUNDING || cos_in <= -ROUNDING {
            return 0.0;
        }
        // Not a number or infinite at worst, which whoever compares takes for nothing.
        self.power * cos_out.max(ROUNDING) * cos_in.max(ROUNDING) / d2.max(self.radius2).max(f32::MIN_POSITIVE)
    }
}

/// `cos max(0, a − b)` of angles up to π, from their cosines.
pub(super) fn cos_of_difference(a: f32, b: f32) -> f32 {
    if a >= b {
        return 1.0;
    }
    let sin = |cos: f32| (1.0 - cos * cos).max(0.0).sqrt();
    a * b + sin(a) * sin(b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::emitter::area::EmissiveShape;
    use crate::sampling::Stream;
    use crate::scene::InstanceId;
    use crate::spectrum::Spectrum;

    fn random(stream: &mut Stream, n: usize) -> Vec<EmissiveSurface> {
        let mut point = |size: f32| (Vec3::new(stream.next_f32(), stream.next_f32(), stream.next_f32()) * 2.0 - 1.0) * size;
        (0..n)
            .map(|i| {
                let at = point(5.0);
                let shape = EmissiveShape::Triangle([at, at + point(0.5), at + point(0.5)]);
                let radiance = Spectrum::gray(1.0 + (i % 7) as f32);
                EmissiveSurface { shape, radiance, two_sided: i % 3 == 0, instance: InstanceId(0), primitive: i as u32 }
            })
            .collect()
    }

    /// A point and a normal there.
    fn place(stream: &mut Stream) -> (Vec3, Vec3) {
        let p = Vec3::new(stream.next_f32(), stream.next_f32(), stream.next_f32());
        (p, Vec3::new(stream.next_f32() - 0.5, stream.next_f32() - 0.5, 0.3).normalize())
    }

    /// Probabilities, by surface, of all that `steps` numbers choose.
    fn chosen(tree: &Tree, p: Vec3, n: Vec3, steps: u32) -> std::collections::BTreeMap<u32, (f64, f64)> {
        let mut found = std::collections::BTreeMap::new();
        let place = tree.seen_from(p, n);
        for i in 0..steps {
            let Some((seen, probability)) = place.choose((f64::from(i) + 0.5) / f64::from(steps)) else { continue };
            let entry = found.entry(seen.surface.primitive).or_insert((0.0, f64::from(probability)));
            entry.0 += 1.0 / f64::from(steps);
            assert!((entry.1 - f64::from(probability)).abs() <= 1e-6 * entry.1);
        }
        found
    }

    #[test]
    fn surfaces_are_chosen_as_often_as_is_said() {
        let mut stream = Stream::new(3, 0, 0);
        for size in [1, 6, 7, 60, 500] {
            let tree = Tree::new(&random(&mut stream, size));
            for _ in 0..5 {
                let (p, n) = place(&mut stream);
                let found = chosen(&tree, p, n, 200_000);
                for (primitive, (share, probability)) in &found {
                    assert!(
                        (share - probability).abs() < 1e-5 + 1e-3 * probability,
                        "{size}, {primitive}: {share} {probability}"
                    );
                }
                let dead: f64 = 1.0 - found.values().map(|f| f.0).sum::<f64>();
                assert!(size < 60 || dead < 0.5, "{size}: {dead} chooses nothing");
            }
        }
    }

    #[test]
    fn the_probability_of_a_surface_is_that_with_which_it_is_chosen() {
        let mut stream = Stream::new(5, 0, 0);
        for size in [1, 5, 7, 60, 500] {
            let tree = Tree::new(&random(&mut stream, size));
            for _ in 0..5 {
                let (p, n) = place(&mut stream);
                let found = chosen(&tree, p, n, 20_000);
                for (k, surface) in tree.surfaces().iter().enumerate() {
                    let asked = tree.probability(k, p, n).map_or(0.0, |(_, probability)| f64::from(probability));
                    match found.get(&surface.primitive) {
                        Some((_, probability)) => assert!((asked - probability).abs() <= 1e-5 * probability),
                        None => assert!(asked < 1e-3, "{size}: {asked} though it is never chosen"),
                    }
                }
            }
        }
    }

    #[test]
    fn what_gives_light_is_never_left_out() {
        // Every surface that reaches a place has a probability, and a fair one: what it gives over its probability stays bounded.
        let mut stream = Stream::new(4, 0, 0);
        let surfaces = random(&mut stream, 300);
        let tree = Tree::new(&surfaces);
        for _ in 0..20 {
            let p = (Vec3::new(stream.next_f32(), stream.next_f32(), stream.next_f32()) * 2.0 - 1.0) * 6.0;
            let n = Vec3::new(stream.next_f32() - 0.5, stream.next_f32() - 0.5, stream.next_f32() - 0.5).normalize();
            let all = |surface: &EmissiveSurface| Seen::new(surface, p, n).map_or(0.0, |seen| f64::from(seen.importance));
            let total: f64 = surfaces.iter().map(all).sum();
            let found = chosen(&tree, p, n, 1 << 20);
            for surface in &surfaces {
                let gives = all(surface) / total;
                let probability = found.get(&surface.primitive).map_or(0.0, |f| f.1);
                assert!(gives < 1e-6 || probability > 0.0, "{} gives {gives}", surface.primitive);
                assert!(gives < 1e-3 || gives / probability < 50.0, "{gives} by {probability}");
            }
        }
    }

    #[test]
    fn differences_of_angles() {
        for (a, b) in [(1.0f32, 0.3), (2.5, 1.0), (0.2, 0.9), (3.1, 3.0)] {
            let expected = (a - b).max(0.0).cos();
            assert!((cos_of_difference(a.cos(), b.cos()) - expected).abs() < 1e-5);
        }
    }
}
