//! The node hierarchy: transforms composed in f64, and which node is placed where.

use super::super::{ImportError, Warnings};
use super::budget::Budget;
use super::json::{Item, Table};
use super::tally::Tally;
use crate::math::{DAffine3, DMat3, DQuat, DVec3};

/// How often nodes may be placed all together, for each node and as a start: a node with several parents is placed under each, and
/// a few dozen such nodes on top of each other would place the lowest more often than there are atoms.
const PLACEMENTS_PER_NODE: usize = 16;
const FREE_PLACEMENTS: usize = 1 << 18;

/// The hierarchy of a document, checked to have no cycle.
#[derive(Debug)]
pub(super) struct Hierarchy<'a> {
    /// The document's nodes.
    pub table: Table<'a>,
    /// Parent of each; the first one where a file names several.
    pub parents: Vec<Option<u32>>,
    children: Vec<Vec<u32>>,
    local: Vec<DAffine3>,
}

impl<'a> Hierarchy<'a> {
    /// Reads every node's transform and children.
    pub(super) fn read(root: &Item<'a>, budget: &mut Budget, tally: &mut Tally) -> Result<Self, ImportError> {
        let table = Table::new(root, "nodes", "node")?;
        let n = table.len();
        // Node names, matrices and links: some hundred bytes each.
        budget.reserve(&|| "the nodes".into(), n as u64 * 512)?;
        let mut parents: Vec<Option<u32>> = vec![None; n];
        let mut children = Vec::with_capacity(n);
        let mut local = Vec::with_capacity(n);
        for (i, node) in table.iter().enumerate() {
            local.push(transform(&node, tally)?);
            let mut own = Vec::new();
            for reference in node.array("children")?.iter() {
                let child = table.index(&reference)?;
                match parents[child] {
                    None => parents[child] = Some(i as u32),
                    Some(_) => {
                        tally.note("shared-node", "a node with several parents is placed under each", 1, reference.pointer())
                    }
                }
                own.push(child as u32);
            }
            children.push(own);
        }
        let this = Self { table, parents, children, local };
        this.refuse_cycles()?;
        Ok(this)
    }

    /// Depth-first over all nodes without recursion: a chain may be as long as the file.
    fn refuse_cycles(&self) -> Result<(), ImportError> {
        #[derive(Clone, Copy, PartialEq)]
        enum State {
            New,
            Open,
            Done,
        }
        let mut state = vec![State::New; self.children.len()];
        let mut stack: Vec<(u32, usize)> = Vec::new();
        for start in 0..self.children.len() {
            if state[start] != State::New {
                continue;
            }
            state[start] = State::Open;
            stack.push((start as u32, 0));
            while let Some((node, next)) = stack.last_mut() {
                let at = *node as usize;
                match self.children[at].get(*next) {
                    None => {
                        state[at] = State::Done;
                        stack.pop();
                    }
                    Some(&child) => {
                        *next += 1;
                        match state[child as usize] {
                            State::Done => {}
                            State::New => {
                                state[child as usize] = State::Open;
                                stack.push((child, 0));
                            }
                            State::Open => {
                                let message = format!("node {child} is a child of node {at}, which hangs below it: a cycle");
                                let item = self.table.get(at).and_then(|n| n.get("children").ok().flatten());
                                let error = |item: &Item<'_>| {
                                    item.error_with_help(&message, "nodes must form a tree; remove the link that leads back up")
                                };
                                return Err(item
                                    .as_ref()
                                    .map_or_else(|| ImportError::invalid(Default::default(), &message), error));
                            }
                        }
                    }
                }
            }
        }
        Ok(())
    }

    /// Every node's transform to the world, along its (first) parents.
    pub(super) fn globals(&self) -> Vec<DAffine3> {
        let mut globals = self.local.clone();
        let mut stack: Vec<u32> = (0..globals.len() as u32).filter(|&i| self.parents[i as usize].is_none()).collect();
        while let Some(node) = stack.pop() {
            for &child in &self.children[node as usize] {
                if self.parents[child as usize] == Some(node) {
                    globals[child as usize] = globals[node as usize] * self.local[child as usize];
                    stack.push(child);
                }
            }
        }
        globals
    }

    /// The nodes of the default scene with their transforms, parents first, in the order of the document.
    pub(super) fn placements(&self, root: &Item<'a>, warnings: &mut Warnings) -> Result<Vec<(u32, DAffine3)>, ImportError> {
        let scenes = Table::new(root, "scenes", "scene")?;
        let scene = match scenes.resolve_in(root, "scene")? {
            Some((_, scene)) => Some(scene),
            None => scenes.get(0),
        };
        if scenes.len() > 1 {
            let what = format!("the file has {} scenes; only its default one is read", scenes.len());
            warnings.add("other-scenes", root.file(), what);
        }
        let mut roots = Vec::new();
        match &scene {
            Some(scene) => {
                for reference in scene.array("nodes")?.iter() {
                    roots.push(self.table.index(&reference)? as u32);
                }
            }
            None => roots.extend((0..self.parents.len() as u32).filter(|&i| self.parents[i as usize].is_none())),
        }
        let limit = FREE_PLACEMENTS + PLACEMENTS_PER_NODE * self.local.len();
        let mut placed = Vec::new();
        let mut stack: Vec<(u32, DAffine3)> = roots.iter().rev().map(|&node| (node, DAffine3::IDENTITY)).collect();
        while let Some((node, above)) = stack.pop() {
            let item = self.table.get(node as usize);
            if let Some(item) = &item
                && let Some(visibility) = item.extension("KHR_node_visibility")?
                && visibility.flag("visible")? == Some(false)
            {
                continue;
            }
            let transform = above * self.local[node as usize];
            placed.push((node, transform));
            if placed.len() + stack.len() > limit {
                let message = format!("nodes with several parents are placed more than {limit} times");
                let help = "give every node one parent";
                return Err(item.map_or_else(
                    || ImportError::invalid(root.location(), &message),
                    |item| item.error_with_help(&message, help),
                ));
            }
            stack.extend(self.children[node as usize].iter().rev().map(|&child| (child, transform)));
        }
        Ok(placed)
    }
}

/// A node's own transform.
fn transform(node: &Item<'_>, tally: &mut Tally) -> Result<DAffine3, ImportError> {
    if let Some(m) = node.numbers::<16>("matrix")? {
        if [m[3], m[7], m[11], m[15]] != [0.0, 0.0, 0.0, 1.0] {
            tally.note("matrix-not-affine", "the last row of a node's matrix is not 0 0 0 1 and is ignored", 1, node.pointer());
        }
        let column = |i: usize| DVec3::new(m[i], m[i + 1], m[i + 2]);
        return Ok(DAffine3 { matrix3: DMat3::from_cols(column(0), column(4), column(8)), translation: column(12) });
    }
    let translation = DVec3::from(node.numbers::<3>("translation")?.unwrap_or([0.0; 3]));
    let [x, y, z, w] = node.numbers::<4>("rotation")?.unwrap_or([0.0, 0.0, 0.0, 1.0]);
    let scale = DVec3::from(node.numbers::<3>("scale")?.unwrap_or([1.0; 3]));
    Ok(DAffine3::from_scale_rotation_translation(scale, rotation(x, y, z, w), translation))
}

/// A quaternion of unit length; the identity where the source gives zero.
pub(super) fn rotation(x: f64, y: f64, z: f64, w: f64) -> DQuat {
    let largest = x.abs().max(y.abs()).max(z.abs()).max(w.abs());
    if largest.is_finite() && largest > 0.0 {
        // Scaled first, so that squares neither overflow nor vanish.
        DQuat::from_xyzw(x / largest, y / largest, z / largest, w / largest).normalize()
    } else {
        DQuat::IDENTITY
    }
}
