//! What sees what, and which of it light can reach.

use rayon::prelude::*;

/// Nodes joined to groups where they see each other. Light reaches a node when a source of light is in its group.
pub(super) struct Groups {
    parent: Vec<u32>,
    /// By root: a source is in the group.
    has_light: Vec<bool>,
}

impl Groups {
    /// Of `n` nodes that see nothing yet.
    pub(super) fn new(n: usize) -> Self {
        Self { parent: (0..n as u32).collect(), has_light: vec![false; n] }
    }

    /// The lowest member of the group.
    fn root(&self, mut node: u32) -> u32 {
        while self.parent[node as usize] != node {
            node = self.parent[node as usize];
        }
        node
    }

    /// The same, its path halved on the way.
    fn root_halving(&mut self, mut node: u32) -> u32 {
        while self.parent[node as usize] != node {
            self.parent[node as usize] = self.parent[self.parent[node as usize] as usize];
            node = self.parent[node as usize];
        }
        node
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root_halving(a), self.root_halving(b));
        let has_light = self.has_light[a as usize] || self.has_light[b as usize];
        self.parent[a.max(b) as usize] = a.min(b);
        self.has_light[a.min(b) as usize] = has_light;
    }

    /// The node is or sees a source.
    pub(super) fn light(&mut self, node: usize) {
        let root = self.root_halving(node as u32);
        self.has_light[root as usize] = true;
    }

    /// Light reaches the node, as far as is known.
    pub(super) fn is_lit(&self, node: usize) -> bool {
        self.has_light[self.root(node as u32) as usize]
    }

    /// Lets every node that light does not reach so far look around: it says which others it sees, and whether it sees a source itself.
    pub(super) fn look(&mut self, look: impl Fn(usize) -> (Vec<u32>, bool) + Sync) {
        let dark: Vec<usize> = (0..self.parent.len()).into_par_iter().filter(|&node| !self.is_lit(node)).collect();
        let found: Vec<(Vec<u32>, bool)> = dark.par_iter().map(|&node| look(node)).collect();
        for (node, (seen, is_lit)) in dark.into_iter().zip(found) {
            seen.into_iter().for_each(|other| self.join(node as u32, other));
            if is_lit {
                self.light(node);
            }
        }
    }
}
