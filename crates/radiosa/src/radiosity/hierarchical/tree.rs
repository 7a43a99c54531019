//! A binary tree over elements: within walls it is their blocks, above them it is clusters of surfaces.
//!
//! Elements are halved along the axis of place or normal in which they differ most, until each is alone; so blocks of one plane come out wherever there is
//! one, and what is small and far away becomes a cluster. Source: [Smits94].

use crate::math::DVec3;
use crate::radiosity::halve;
use crate::radiosity::mesh::Element;

/// How many metres a normal that points the other way counts for, in sizes of the group that is halved.
const TURN: f64 = 1.0;

/// Some elements: one, or what two other nodes have together.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    /// Where its elements are in [`Tree::members`].
    members: [u32; 2],
    /// None for a single element.
    pub(super) children: Option<[u32; 2]>,
    /// Of what light can reach, m².
    pub(super) area: f64,
    /// `Σ A n`, m²: as long as `area` where all face the same way.
    pub(super) vector_area: DVec3,
    /// By area, of what light can reach.
    pub(super) centre: DVec3,
    /// Around the centre.
    pub(super) radius: f64,
    /// How far back along their common normal the plane of an element lies, m; of no use where it is not flat.
    back: f64,
    /// The box around it.
    low: DVec3,
    high: DVec3,
}

/// The elements that light can reach, in groups of groups. A node comes before its children, the root first.
#[derive(Clone, Debug, Default)]
pub(super) struct Tree {
    members: Vec<u32>,
    pub(super) nodes: Vec<Node>,
    /// By node.
    cells: Vec<[u32; 4]>,
}

impl Tree {
    /// Over all elements with an area and a normal.
    pub(super) fn new(elements: &[Element]) -> Self {
        let is_there = |e: &Element| e.area > 0.0 && e.area.is_finite() && e.normal.is_finite();
        let mut members: Vec<u32> = (0..elements.len() as u32).filter(|&i| is_there(&elements[i as usize])).collect();
        let mut nodes = Vec::with_capacity(2 * members.len());
        if members.is_empty() {
            return Self::default();
        }
        nodes.push(node(elements, &members, 0));
        let mut waiting = vec![0];
        while let Some(k) = waiting.pop() {
            let Node { members: [start, end], .. } = nodes[k];
            if end - start < 2 {
                continue;
            }
            let of = &mut members[start as usize..end as usize];
            let turn = TURN * halve::extent(elements, of.iter().copied());
            halve::sort_for_halving(elements, of, turn);
            let (a, b) = of.split_at(of.len() / 2);
            let children = [(a, start), (b, start + a.len() as u32)].map(|(of, start)| {
                nodes.push(node(elements, of, start));
                nodes.len() - 1
            });
            nodes[k].children = Some(children.map(|c| c as u32));
            waiting.extend(children);
        }
        let cells = (0..nodes.len() as u32).map(|k| cells_of(&nodes, k)).collect();
        Self { members, nodes, cells }
    }

    /// The elements of a node.
    pub(super) fn members(&self, node: u32) -> &[u32] {
        let [start, end] = self.nodes[node as usize].members;
        &self.members[start as usize..end as usize]
    }

    /// The parts of a node among which its links share what they carry: the children of its children, a child that has none itself, or itself where it has none.
    /// The node again where there are fewer than four.
    pub(super) fn cells(&self, node: u32) -> [u32; 4] {
        self.cells[node as usize]
    }

    /// The nodes that have an element, the root first; none where it is in none.
    pub(super) fn path_to(&self, element: u32) -> Vec<u32> {
        let mut path = Vec::new();
        let Some(at) = self.members.iter().position(|&i| i == element) else { return path };
        let mut node = 0;
        loop {
            path.push(node);
            let Some([a, b]) = self.nodes[node as usize].children else { return path };
            let [_, end] = self.nodes[a as usize].members;
            node = if at < end as usize { a } else { b };
        }
    }

    /// Elements in all.
    pub(super) fn n_elements(&self) -> usize {
        self.members.len()
    }

    /// The element that a node without children is.
    pub(super) fn element(&self, node: &Node) -> usize {
        self.members[node.members[0] as usize] as usize
    }
}

/// As [`Tree::cells`].
fn cells_of(nodes: &[Node], node: u32) -> [u32; 4] {
    let mut cells = [node; 4];
    let mut n = 0;
    for child in nodes[node as usize].children.into_iter().flatten() {
        let parts = nodes[child as usize].children.map_or([Some(child), None], |parts| parts.map(Some));
        for part in parts.into_iter().flatten() {
            cells[n] = part;
            n += 1;
        }
    }
    cells
}

impl Node {
    /// Everything faces the same way.
    pub(super) fn is_flat(&self) -> bool {
        self.vector_area.length() >= self.area * (1.0 - 1e-9)
    }

    /// Nothing of `other` lies in front of any element of this node, where this one is flat.
    fn has_behind(&self, other: &Self) -> bool {
        let n = self.vector_area.normalize_or_zero();
        let (middle, half) = ((other.low + other.high) * 0.5, (other.high - other.low) * 0.5);
        let scale = (middle - self.centre).length() + self.radius + half.length();
        self.is_flat() && n.dot(middle) - self.back + n.abs().dot(half) <= 1e-9 * scale
    }

    /// No element of one can see one of the other, whatever lies between.
    pub(super) fn is_turned_away(&self, other: &Self) -> bool {
        let [m, n] = [self, other].map(|node| node.vector_area.normalize_or_zero());
        let same_way = self.is_flat() && other.is_flat() && (m - n).length_squared() < 1e-18;
        same_way || self.has_behind(other) || other.has_behind(self)
    }
}

/// A node of some elements without children.
fn node(elements: &[Element], members: &[u32], start: u32) -> Node {
    let of = || members.iter().map(|&i| &elements[i as usize]);
    let corners = || of().flat_map(Element::corners);
    let area: f64 = of().map(|e| e.area).sum();
    let vector_area: DVec3 = of().map(|e| e.normal * e.area).sum();
    let normal = vector_area.normalize_or_zero();
    let centre = of().map(|e| e.centre() * e.area).sum::<DVec3>() / area;
    Node {
        members: [start, start + members.len() as u32],
        children: None,
        area,
        vector_area,
        back: corners().map(|c| normal.dot(*c)).fold(f64::INFINITY, f64::min),
        centre,
        radius: corners().map(|c| (*c - centre).length()).fold(0.0, f64::max),
        low: corners().fold(DVec3::INFINITY, |low, c| low.min(*c)),
        high: corners().fold(DVec3::NEG_INFINITY, |high, c| high.max(*c)),
    }
}
