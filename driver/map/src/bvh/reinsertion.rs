//! Optimization of a binary tree by reinsertion: subtrees are removed and inserted where the tree's surface
//! area becomes least (Meister, Bittner 2017, *Parallel reinsertion for bounding volume hierarchy
//! optimization*).
//!
//! The rounds, the order of insertion and the results are those of the crate obvhs. Here, the search of obvhs
//! for the best position runs for many subtrees in parallel. The tree does not depend on the number of
//! threads.

use obvhs::bvh2::reinsertion::{Reinsertion, find_reinsertion, reinsert_node};
use obvhs::bvh2::{Bvh2, node::Bvh2Node};
use rayon::prelude::*;
use rdst::{RadixKey, RadixSort};

/// Number of rounds. Round n, counted from 0, tries `1 / (2 n + 1)` of the number of subtrees that round 0
/// tries.
const ROUNDS: usize = 16;

/// Maximum number of subtrees that a round tries. The nodes with the largest areas cause most of a tree's
/// cost. For a million triangles, a round that tried all subtrees would take twice the time, and rays would
/// read only 2 % less memory.
const MAX_TRIED: usize = 100_000;

/// Subtree that can be reinserted.
#[derive(Clone, Copy)]
struct Candidate {
    area: f32,
    node: u32,
}

/// Sorts by descending area.
impl RadixKey for Candidate {
    const LEVELS: usize = 4;

    #[inline]
    fn get_level(&self, level: usize) -> u8 {
        (-self.area).get_level(level)
    }
}

/// Optimizes a tree in rounds. The first round tries to reinsert the fraction `share` of the nodes, chosen by
/// large area.
pub(super) fn optimize(tree: &mut Bvh2, share: f32) {
    if tree.nodes.first().is_none_or(Bvh2Node::is_leaf) {
        return;
    }
    tree.init_parents_if_uninit();
    tree.children_are_ordered_after_parents = false;
    let mut touched = vec![false; tree.nodes.len()];
    for round in 0..ROUNDS {
        let part = 1.0 / (2 * round + 1) as f32;
        let count = ((tree.nodes.len() as f32 * share * part) as usize).max(1);
        let found = reinsertions(tree, count.min(MAX_TRIED).min(tree.nodes.len() - 1));
        touched.fill(false);
        for Reinsertion { from, to, .. } in found {
            let [from, to] = [from, to].map(|node| node as usize);
            let parents = [to, from].map(|node| tree.parents[node] as usize);
            let moved = [to, from, Bvh2Node::get_sibling_id(from), parents[0], parents[1]];
            // A subtree beside one that has moved in this round may now have another best position.
            if moved.iter().all(|&node| !touched[node]) {
                moved.iter().for_each(|&node| touched[node] = true);
                reinsert_node(tree, from, to);
            }
        }
    }
}

/// Finds the best positions for `count` nodes with large areas. Returns the reinsertions that decrease the
/// tree's area, sorted by descending decrease.
fn reinsertions(tree: &Bvh2, count: usize) -> Vec<Reinsertion> {
    let first = tree.nodes.iter().zip(0..).take(2 * (count + 1)).skip(1);
    let mut candidates: Vec<Candidate> =
        first.map(|(node, index)| Candidate { area: node.aabb().half_area(), node: index }).collect();
    candidates.radix_sort_unstable();
    candidates.truncate(count);
    let places = candidates.par_iter().map(|candidate| find_reinsertion(tree, candidate.node as usize));
    let mut found: Vec<Reinsertion> = places.filter(|place| place.area_diff > 0.0).collect();
    found.sort_unstable_by(|a, b| b.area_diff.total_cmp(&a.area_diff));
    found
}
