//! What sees what, and which of it light can reach.

/// Of every node: a source of light is in its group. A node comes with those it sees, which join its group, and whether it is or sees a source itself.
pub(super) fn lit(nodes: &[(Vec<u32>, bool)]) -> Vec<bool> {
    let mut groups = Groups((0..nodes.len() as u32).collect());
    for (node, (seen, _)) in nodes.iter().enumerate() {
        seen.iter().for_each(|&other| groups.join(node as u32, other));
    }
    let mut has_light = vec![false; nodes.len()];
    for (node, (_, is_lit)) in nodes.iter().enumerate() {
        has_light[groups.root(node as u32) as usize] |= is_lit;
    }
    (0..nodes.len() as u32).map(|node| has_light[groups.root(node) as usize]).collect()
}

/// Sets that can be joined.
struct Groups(Vec<u32>);

impl Groups {
    /// The lowest member of the set, its path halved on the way.
    fn root(&mut self, mut node: u32) -> u32 {
        while self.0[node as usize] != node {
            self.0[node as usize] = self.0[self.0[node as usize] as usize];
            node = self.0[node as usize];
        }
        node
    }

    /// Makes one set of two.
    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}
