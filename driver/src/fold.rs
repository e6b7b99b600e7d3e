//! Binary trees folded into wide nodes so that a descent costs the least, and numbered as in a card image (Ylitie, Karras,
//! Laine 2017, *Efficient incoherent ray traversal on GPUs through compressed wide BVHs*, section 3.1).

use std::collections::VecDeque;

use photoncard_shared::layout::{Links, NODE_CHILDREN};

/// A part of a binary tree, and what it costs to descend in it folded at the least cost.
pub(crate) struct Tree<L, B> {
    part: Part<L, B>,
    /// The expected cost of a descent in the part as at most `i + 1` children of one node.
    costs: [f32; NODE_CHILDREN],
}

/// A part of a binary tree without its costs, which only what is above it asks for: what it is as a leaf, if it can be one,
/// and its two parts, if it has them.
struct Part<L, B> {
    bounds: B,
    leaf: Option<L>,
    parts: Option<Box<[Self; 2]>>,
    /// If it is to be at most `i + 1` children of a node, those that its first part makes; none if it is one child.
    first: [u8; NODE_CHILDREN],
}

impl<L, B: Copy> Tree<L, B> {
    /// A leaf, which it costs so much to visit.
    pub(crate) fn leaf(leaf: L, bounds: B, cost: f32) -> Self {
        let part = Part { bounds, leaf: Some(leaf), parts: None, first: [0; NODE_CHILDREN] };
        Self { part, costs: [cost; NODE_CHILDREN] }
    }

    /// Of two parts, which cost `node` to visit as a node of their own; if they may as well be a leaf, that and what it costs.
    pub(crate) fn node(parts: [Self; 2], bounds: B, node: f32, leaf: Option<(L, f32)>) -> Self {
        let mut costs = [f32::INFINITY; NODE_CHILDREN];
        let mut first = [0; NODE_CHILDREN];
        let [below, above] = parts.each_ref().map(|tree| tree.costs);
        for both in 2..=NODE_CHILDREN {
            for below_children in 1..both {
                let cost = below[below_children - 1] + above[both - below_children - 1];
                if cost < costs[both - 1] {
                    (costs[both - 1], first[both - 1]) = (cost, below_children as u8);
                }
            }
        }
        // As a node of its own it may be split in another way than among the children of its parent.
        let opened = first[NODE_CHILDREN - 1];
        let as_one = leaf.as_ref().map_or(node + costs[NODE_CHILDREN - 1], |(_, cost)| *cost);
        for (cost, first) in costs.iter_mut().zip(&mut first).take(NODE_CHILDREN - 1) {
            if as_one <= *cost {
                (*cost, *first) = (as_one, 0);
            }
        }
        // The last is never asked for but for a node of its own.
        first[NODE_CHILDREN - 1] = opened;
        let leaf = leaf.map(|(leaf, _)| leaf);
        let parts = Some(Box::new(parts.map(|tree| tree.part)));
        Self { part: Part { bounds, leaf, parts, first }, costs }
    }

    /// What a leaf of both of two parts would be.
    pub(crate) fn as_leaf(&self) -> Option<&L> {
        self.part.leaf.as_ref()
    }
}

impl<L, B: Copy> Part<L, B> {
    /// Adds the part to a node, as at most so many children.
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

/// A node, where `B` tells where its children are.
pub(crate) struct WideNode<B> {
    pub(crate) children: Vec<B>,
    pub(crate) links: Links,
}

/// A folded tree.
pub(crate) struct Folded<L, B> {
    /// Nodes in the order of their parents, the root first.
    pub(crate) nodes: Vec<WideNode<B>>,
    /// Leaves, those of a node one after the other.
    pub(crate) leaves: Vec<L>,
    /// The entries of a stack that a descent may need.
    pub(crate) stack: usize,
}

impl<L, B: Copy> Folded<L, B> {
    /// Folds a tree. Its root is a node, if only of one leaf.
    pub(crate) fn new(tree: Tree<L, B>) -> Self {
        let mut folded = Self { nodes: Vec::new(), leaves: Vec::new(), stack: 1 };
        // Nodes to come, and the entries of a stack below them.
        let mut waiting = VecDeque::from([(tree.part, 0)]);
        while let Some((node, above)) = waiting.pop_front() {
            let mut children = Vec::with_capacity(NODE_CHILDREN);
            node.unfold(NODE_CHILDREN, &mut children);
            // Stable: what is near in space stays near.
            children.sort_by_key(|child| child.leaf.is_none());
            // The node is taken off before its children are put on.
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
