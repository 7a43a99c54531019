//! Blocks of elements that shoot together while every element receives: substructuring. Source: [Cohen86].

use super::{ElementMesh, cell_at, element};
use crate::radiosity::sides::Side;

/// Who sends light out: every element for itself, or blocks of neighbours together.
#[derive(Clone, Debug, PartialEq)]
pub struct Blocks {
    /// Where a mesh with blocks has the first of them.
    first: u32,
    /// Block `s` has the elements `members[starts[s]..starts[s + 1]]`.
    starts: Vec<u32>,
    members: Vec<u32>,
}

impl Blocks {
    /// Every one of `n` elements for itself.
    pub fn single(n: usize) -> Self {
        Self { first: 0, starts: (0..=n as u32).collect(), members: (0..n as u32).collect() }
    }

    /// How many there are.
    pub fn n(&self) -> usize {
        self.starts.len() - 1
    }

    /// The elements of block `s`.
    pub fn members(&self, s: usize) -> impl Iterator<Item = usize> {
        self.members[self.starts[s] as usize..self.starts[s + 1] as usize].iter().map(|&i| i as usize)
    }

    /// The index of block `s` as an element.
    pub fn element(&self, s: u32) -> u32 {
        self.first + s
    }
}

impl ElementMesh {
    /// The same mesh with blocks of `k × k` cells as elements of their own behind the others (in triangles of as many as divide their grid). Rays meet
    /// the others alone. Where a contact line goes through a block every element stands for itself.
    pub fn with_blocks(&self, k: u32) -> (Self, Blocks) {
        let mut mesh = self.clone();
        let mut blocks = Blocks { first: self.elements.len() as u32, starts: vec![0], members: Vec::new() };
        for (p, grid) in self.grids.iter().enumerate() {
            let (patch, n) = (&self.patches.patches[p], grid.n);
            let step = if patch.is_quad() { k.max(1) } else { (1..=k.max(1)).rev().find(|d| n[0] % d == 0).unwrap_or(1) };
            let m = n.map(|n| n.div_ceil(step));
            for (first, side) in grid.first.into_iter().zip([Side::Front, Side::Back]) {
                let Some(first) = first else { continue };
                let mut of_block = vec![Vec::new(); (m[0] * m[1]) as usize];
                for i in first..first + self.n_on_side(p) as u32 {
                    let element = &self.elements[i as usize];
                    let block = if patch.is_quad() {
                        element.cell / n[0] / step * m[0] + element.cell % n[0] / step
                    } else {
                        cell_at(false, m, patch.parameters(element.centre())).0
                    };
                    of_block[block as usize].push(i);
                }
                for (cell, members) in of_block.into_iter().enumerate() {
                    let is_cut = members.iter().any(|&i| self.is_at_contact(&self.elements[i as usize]));
                    if is_cut {
                        mesh.elements.extend(members.iter().map(|&i| self.elements[i as usize]));
                        blocks.starts.extend((1..=members.len()).map(|k| (blocks.members.len() + k) as u32));
                    } else {
                        mesh.elements.push(element(patch, n, step, cell as u32, p as u32, side));
                        blocks.starts.push((blocks.members.len() + members.len()) as u32);
                    }
                    blocks.members.extend(members);
                }
            }
        }
        (mesh, blocks)
    }
}
