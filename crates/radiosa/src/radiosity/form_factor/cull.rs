//! Which elements cannot see each other, decided for blocks of them.
//!
//! In a building of many rooms nearly all pairs of elements have walls between them; asking each costs more than everything else. So elements that are
//! close and face much the same way make blocks, and [`RAYS`] lines between two blocks, spread over both, decide: when all are blocked, no pair of their elements is asked. Blocks that are close to
//! each other are never left out.
//!
//! What is lost is what fewer than about one in [`RAYS`] of the lines between two blocks sees: a gap as wide as a hundredth of a block, not a door. In
//! a building of rooms with doors that is 1e-4 of a row (`tests/form_factor.rs`).

use rayon::prelude::*;

use super::visibility::{Scratch, Visibility};
use crate::math::DVec3;
use crate::radiosity::halve;
use crate::radiosity::mesh::Element;

/// With fewer elements every pair is asked.
const MANY: usize = 4096;

/// Elements of a block at most.
const BLOCK: usize = 32;

/// Lines between two blocks.
const RAYS: usize = 128;

/// How many metres a normal that points the other way counts for, in sizes of the scene.
const TURN: f64 = 0.25;

/// The blocks, and which of them see each other.
#[derive(Debug)]
pub(super) struct Blocks {
    /// By element.
    block: Vec<u32>,
    /// Words of a row.
    words: usize,
    /// Bits, row by row; symmetric.
    visible: Vec<u64>,
}

impl Blocks {
    /// `None` when there are few elements.
    pub(super) fn new(elements: &[Element], visibility: &Visibility) -> Option<Self> {
        if elements.len() < MANY {
            return None;
        }
        let blocks = blocks(elements);
        let n = blocks.len();
        let mut block = vec![0; elements.len()];
        for (k, members) in blocks.iter().enumerate() {
            members.iter().for_each(|&i| block[i as usize] = k as u32);
        }
        let bounds: Vec<(DVec3, f64)> = blocks.iter().map(|members| sphere_around(elements, members)).collect();
        let words = n.div_ceil(64);
        let sees = |a: usize, b: usize, scratch: &mut Scratch| {
            let ((ca, ra), (cb, rb)) = (bounds[a], bounds[b]);
            (ca - cb).length() < 2.0 * (ra + rb) || visibility.any_between(elements, [&blocks[a], &blocks[b]], RAYS, scratch)
        };
        let upper: Vec<Vec<u64>> = (0..n)
            .into_par_iter()
            .map_init(Scratch::default, |scratch, a| {
                let mut row = vec![0u64; words];
                for b in (a..n).filter(|&b| b == a || sees(a, b, scratch)).collect::<Vec<_>>() {
                    row[b / 64] |= 1 << (b % 64);
                }
                row
            })
            .collect();
        let mut visible = upper.concat();
        for a in 0..n {
            for b in a + 1..n {
                if visible[a * words + b / 64] >> (b % 64) & 1 == 1 {
                    visible[b * words + a / 64] |= 1 << (a % 64);
                }
            }
        }
        Some(Self { block, words, visible })
    }

    /// False when all lines between the blocks of two elements were blocked.
    pub(super) fn may_see(&self, i: u32, j: u32) -> bool {
        let (a, b) = (self.block[i as usize] as usize, self.block[j as usize] as usize);
        self.visible[a * self.words + b / 64] >> (b % 64) & 1 == 1
    }
}

/// Halves the elements along the axis of place or normal in which they differ most, until blocks are small.
fn blocks(elements: &[Element]) -> Vec<Vec<u32>> {
    let all = 0..elements.len() as u32;
    let turn = TURN * halve::extent(elements, all.clone());
    let mut waiting = vec![all.collect::<Vec<u32>>()];
    let mut done = Vec::new();
    while let Some(mut members) = waiting.pop() {
        if members.len() <= BLOCK {
            done.push(members);
            continue;
        }
        halve::sort_for_halving(elements, &mut members, turn);
        let rest = members.split_off(members.len() / 2);
        waiting.extend([rest, members]);
    }
    done
}

fn sphere_around(elements: &[Element], members: &[u32]) -> (DVec3, f64) {
    let corners = || members.iter().flat_map(|&i| elements[i as usize].corners());
    let centre = corners().sum::<DVec3>() / corners().count() as f64;
    (centre, corners().map(|c| (*c - centre).length()).fold(0.0, f64::max))
}
