//! Folds a binary tree into wide nodes with minimum expected traversal cost (Ylitie, Karras, Laine 2017,
//! *Efficient incoherent ray traversal on GPUs through compressed wide BVHs*, section 3.1). Nodes and leaves
//! are numbered as in a card image.

use std::collections::VecDeque;

use photoncard_shared::layout::{Links, NODE_CHILDREN};

/// Binary tree, with the expected costs of its cheapest conversion to wide nodes.
pub(crate) struct Tree<L, B> {
    part: Part<L, B>,
    /// `costs[i]` is the expected traversal cost if the tree is represented by at most `i + 1` children of
    /// one wide node.
    costs: [f32; NODE_CHILDREN],
}

/// Node of a binary tree, without its costs. They are in [`Tree`], because they are needed only until the
/// parent node is built.
struct Part<L, B> {
    bounds: B,
    leaf: Option<L>,
    parts: Option<Box<[Self; 2]>>,
    /// `first[i]` is the number of children that come from the first of [`Self::parts`] if this subtree is
    /// represented by at most `i + 1` children of a wide node. It is 0 if the whole subtree becomes one
    /// child.
    first: [u8; NODE_CHILDREN],
}

impl<L, B: Copy> Tree<L, B> {
    /// Creates a tree of one leaf. `cost` is the cost of a visit of the leaf.
    pub(crate) fn leaf(leaf: L, bounds: B, cost: f32) -> Self {
        let part = Part { bounds, leaf: Some(leaf), parts: None, first: [0; NODE_CHILDREN] };
        Self { part, costs: [cost; NODE_CHILDREN] }
    }

    /// Creates a tree whose root has two children. `node` is the cost to visit the root if it becomes a wide
    /// node. `leaf` is the leaf that can replace the whole tree, with its cost.
    pub(crate) fn node(parts: [Self; 2], bounds: B, node: f32, leaf: Option<(L, f32)>) -> Self {
        let (mut costs, mut first) = cheapest_pairs(parts.each_ref().map(|tree| &tree.costs));
        // As a wide node of its own it may be split differently than among the children of its parent.
        let opened = first[NODE_CHILDREN - 1];
        let as_one = leaf.as_ref().map_or(node + costs[NODE_CHILDREN - 1], |(_, cost)| *cost);
        for (cost, first) in costs.iter_mut().zip(&mut first).take(NODE_CHILDREN - 1) {
            if as_one <= *cost {
                (*cost, *first) = (as_one, 0);
            }
        }
        // The last entry is read only when the node becomes a wide node of its own.
        first[NODE_CHILDREN - 1] = opened;
        let leaf = leaf.map(|(leaf, _)| leaf);
        // A node that always becomes a leaf drops its subtrees, to free their memory. If the root is such a
        // node, the folded tree has one leaf.
        let is_opened = leaf.is_none() || first[..NODE_CHILDREN - 1].iter().any(|&first| first > 0);
        let parts = is_opened.then(|| Box::new(parts.map(|tree| tree.part)));
        Self { part: Part { bounds, leaf, parts, first }, costs }
    }

    pub(crate) fn bounds(&self) -> B {
        self.part.bounds
    }

    /// Leaf that can replace the whole tree, if any.
    pub(crate) fn as_leaf(&self) -> Option<&L> {
        self.part.leaf.as_ref()
    }
}

/// Returns two arrays. Entry `i` of the first is the least cost of two trees that are represented by at most
/// `i + 1` children in all (infinite for `i = 0`). Entry `i` of the second is the number of these children
/// that belong to the first tree. If several numbers are equally cheap, it is the smallest.
fn cheapest_pairs([below, above]: [&[f32; NODE_CHILDREN]; 2]) -> ([f32; NODE_CHILDREN], [u8; NODE_CHILDREN]) {
    // The arrays are longer than the result, so that the inner loop always has [`NODE_CHILDREN`] iterations.
    let (mut costs, mut first) = ([f32::INFINITY; 2 * NODE_CHILDREN], [0_u32; 2 * NODE_CHILDREN]);
    for (children, below) in (1..NODE_CHILDREN).zip(below) {
        for (index, above) in (children..).zip(above) {
            let cost = below + above;
            let is_less = cost < costs[index];
            costs[index] = if is_less { cost } else { costs[index] };
            first[index] = if is_less { children as u32 } else { first[index] };
        }
    }
    (std::array::from_fn(|i| costs[i]), std::array::from_fn(|i| first[i] as u8))
}

impl<L, B: Copy> Part<L, B> {
    /// Appends at most `most` nodes, which together represent this subtree, to the children of a wide node.
    fn unfold(self, most: usize, children: &mut Vec<Self>) {
        let first = self.first[most - 1] as usize;
        match self.parts {
            Some(parts) if first > 0 => {
                for (part, most) in parts.into_iter().zip([first, most - first]) {
                    part.unfold(most, children);
                }
            }
            parts => children.push(Self { parts, ..self }),
        }
    }
}

/// A wide node. `B` is the type of a child's bounds.
pub(crate) struct WideNode<B> {
    pub(crate) children: Vec<B>,
    pub(crate) links: Links,
}

/// Tree of wide nodes and leaves, both in the order of a card image.
pub(crate) struct Folded<L, B> {
    /// Nodes in breadth-first order, from the root.
    pub(crate) nodes: Vec<WideNode<B>>,
    /// Leaves. The leaves of a node are adjacent.
    pub(crate) leaves: Vec<L>,
    /// Maximum number of stack entries that a traversal needs.
    pub(crate) stack: usize,
}

impl<L, B: Copy> Folded<L, B> {
    /// Folds a tree. The root is always a node, even if it has only one leaf.
    pub(crate) fn new(tree: Tree<L, B>) -> Self {
        let mut folded = Self { nodes: Vec::new(), leaves: Vec::new(), stack: 1 };
        // Queue of nodes, each with the number of stack entries that its ancestors leave.
        let mut waiting = VecDeque::from([(tree.part, 0)]);
        while let Some((node, above)) = waiting.pop_front() {
            let mut children = Vec::with_capacity(NODE_CHILDREN);
            node.unfold(NODE_CHILDREN, &mut children);
            // The sort is stable: children that are near in space stay near.
            children.sort_by_key(|child| child.leaf.is_none());
            // A descent pops the node before it pushes the children.
            let below = above + children.len() - 1;
            folded.stack = folded.stack.max(below + 1);
            let first_leaf = folded.leaves.len();
            let first_node = (folded.nodes.len() + 1 + waiting.len()) as u32;
            let bounds = children.iter().map(|child| child.bounds).collect();
            for child in children {
                match child {
                    Part { leaf: Some(leaf), .. } => folded.leaves.push(leaf),
                    node => waiting.push_back((node, below)),
                }
            }
            let leaves = (folded.leaves.len() - first_leaf) as u32;
            let links = Links { leaves, first_leaf: first_leaf as u32, first_node };
            folded.nodes.push(WideNode { children: bounds, links });
        }
        folded
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pseudo-random costs that do not rise with the number of children. Equal costs are frequent.
    fn costs(seed: u32) -> [f32; NODE_CHILDREN] {
        let mut cost = 100.0;
        std::array::from_fn(|i| {
            cost -= ((seed.wrapping_mul(i as u32 + 7) >> 5) % 4) as f32;
            cost
        })
    }

    #[test]
    fn pairs_are_the_cheapest_and_of_equal_ones_have_the_fewest_children_of_the_first() {
        for seed in 0..200 {
            let (below, above) = (costs(seed), costs(seed * 31 + 5));
            let (found, first) = cheapest_pairs([&below, &above]);
            assert_eq!((found[0], first[0]), (f32::INFINITY, 0));
            for both in 2..=NODE_CHILDREN {
                let cost = |children: usize| below[children - 1] + above[both - children - 1];
                let least = (1..both).min_by(|&a, &b| cost(a).total_cmp(&cost(b))).unwrap();
                assert_eq!((found[both - 1], usize::from(first[both - 1])), (cost(least), least), "{both}");
            }
        }
    }

    #[test]
    fn trees_below_what_is_always_a_leaf_are_dropped() {
        let leaf = |index: u32, cost| Tree::leaf(index, (), cost);
        let pair = |leaf_cost| Tree::node([leaf(1, 1.0), leaf(2, 1.0)], (), 1.0, Some((0, leaf_cost)));
        assert!(pair(1.5).part.parts.is_none());
        assert!(pair(2.5).part.parts.is_some());
        assert_eq!(Folded::new(pair(1.5)).leaves, [0]);
        let folded = Folded::new(Tree::node([pair(1.5), pair(2.5)], (), 1.0, None));
        assert_eq!(folded.leaves, [0, 1, 2]);
    }
}
