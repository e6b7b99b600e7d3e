//! Common format of [`super::BvhNode`] and [`super::PhotonNode`]: an inner node with up to sixteen children.
//! Children that are leaves come before children that are inner nodes. The leaves have consecutive indices,
//! and so have the inner nodes.

use super::{read_u32, write_u32};
use crate::address::LINE_BYTES;

/// Maximum number of children of an inner node.
pub const NODE_CHILDREN: usize = 16;
const FIRST_LEAF: usize = 12;
const FIRST_NODE: usize = 16;
const LEAVES: usize = 20;
const CHILDREN: usize = 21;
/// Offset of the children's boxes in the line, bytes. The boxes are six arrays of sixteen bytes: lower x, y,
/// z, upper x, y, z.
const SIDES: usize = 32;
const _: () = assert!(SIDES + 6 * NODE_CHILDREN == LINE_BYTES);

/// Child of an inner node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Child {
    /// The leaf with this index.
    Leaf(u32),
    /// The inner node with this index.
    Node(u32),
}

/// Common part of all inner nodes: indices and boxes of the children.
///
/// | bytes | contents |
/// |---|---|
/// | 12..16 | index of the first child that is a leaf |
/// | 16..20 | index of the first child that is a node |
/// | 20 | number of children that are leaves |
/// | 21 | number of children |
/// | 32..128 | bounds of the children's boxes, sixteen bytes each: lower x, y, z, upper x, y, z |
#[derive(Clone, Copy)]
pub struct WideNode<'a>(pub &'a [u8; LINE_BYTES]);

/// Indices of the children of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Links {
    /// Number of children that are leaves. These children come before the inner nodes.
    pub leaves: u32,
    /// Index of the first child that is a leaf.
    pub first_leaf: u32,
    /// Index of the first child that is an inner node.
    pub first_node: u32,
}

impl<'a> WideNode<'a> {
    /// Number of children, at most [`NODE_CHILDREN`].
    #[inline(always)]
    pub fn children(&self) -> u32 {
        u32::from(self.byte(CHILDREN)).min(NODE_CHILDREN as u32)
    }

    /// Indices of the children.
    #[inline(always)]
    pub fn links(&self) -> Links {
        Links {
            leaves: u32::from(self.byte(LEAVES)),
            first_leaf: read_u32(self.0, FIRST_LEAF),
            first_node: read_u32(self.0, FIRST_NODE),
        }
    }

    /// Returns the lower and upper bounds of all children's boxes on one axis, in units of the node's 8-bit
    /// grid.
    #[inline(always)]
    pub(super) fn sides(&self, axis: usize) -> [&'a [u8; NODE_CHILDREN]; 2] {
        const NONE: &[u8; NODE_CHILDREN] = &[0; NODE_CHILDREN];
        let side = |side: usize| {
            let bytes = self.0.get(SIDES + NODE_CHILDREN * side..).unwrap_or_default();
            bytes.first_chunk().unwrap_or(NONE)
        };
        [side(axis), side(3 + axis)]
    }

    #[inline(always)]
    pub(super) fn byte(&self, index: usize) -> u8 {
        self.0.get(index).copied().unwrap_or(0)
    }
}

impl Links {
    /// Returns the kind and the index of child number `index` of the node.
    #[inline(always)]
    pub fn child(&self, index: u32) -> Child {
        // The sum wraps in unsound card images only.
        if index < self.leaves {
            Child::Leaf(self.first_leaf.wrapping_add(index))
        } else {
            Child::Node(self.first_node.wrapping_add(index - self.leaves))
        }
    }
}

/// Writes the indices of the children into the line of a node. Returns `None` if there are no children, more
/// than [`NODE_CHILDREN`], or fewer than `links.leaves`.
pub(super) fn write_links(line: &mut [u8; LINE_BYTES], children: usize, links: Links) -> Option<()> {
    if children == 0 || children > NODE_CHILDREN || links.leaves as usize > children {
        return None;
    }
    write_u32(line, FIRST_LEAF, links.first_leaf);
    write_u32(line, FIRST_NODE, links.first_node);
    *line.get_mut(LEAVES)? = links.leaves as u8;
    *line.get_mut(CHILDREN)? = children as u8;
    Some(())
}

/// Writes the lower and upper bound of a child's box on one axis, in units of the node's 8-bit grid. Returns
/// `None` if a byte would lie outside the line.
pub(super) fn write_sides(
    line: &mut [u8; LINE_BYTES],
    axis: usize,
    child: usize,
    [lower, upper]: [u8; 2],
) -> Option<()> {
    let at = SIDES + NODE_CHILDREN * axis + child;
    *line.get_mut(at)? = lower;
    *line.get_mut(at + 3 * NODE_CHILDREN)? = upper;
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn leaves_come_before_nodes() {
        let mut line = [0; LINE_BYTES];
        let links = Links { leaves: 2, first_leaf: 100, first_node: 200 };
        assert!(write_links(&mut line, 5, links).is_some());
        let node = WideNode(&line);
        assert_eq!(node.children(), 5);
        use Child::{Leaf, Node};
        let children = [Leaf(100), Leaf(101), Node(200), Node(201), Node(202)];
        assert!((0..).zip(children).all(|(index, child)| node.links().child(index) == child));
        assert!(write_links(&mut line, 17, links).is_none());
        assert!(write_links(&mut line, 1, links).is_none());
        assert!(write_links(&mut line, 0, Links { leaves: 0, ..links }).is_none());
    }
}
