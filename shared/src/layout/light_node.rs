//! Nodes of the light tree, one line each. A node stores the bounds and power of up to four children.

use super::attributes::{decode_octahedral, encode_octahedral};
use super::{read_f32, read_u32, read_vector, write_f32, write_u32, write_vector};
use crate::address::LINE_BYTES;

/// Maximum number of children of a light tree node.
pub const LIGHT_CHILDREN: usize = 4;
/// Maximum depth of a light tree, in levels: the capacity of
/// [`super::Emitter::trail`](super::Emitter#structfield.trail).
pub const LIGHT_TREE_LEVELS: usize = 16;

/// Child of a [`LightNode`]: bounds and power of the emitters below it.
///
/// | bytes | contents |
/// |---|---|
/// | 0..12 | centre of the bounding sphere, metres |
/// | 12..16 | radius of the bounding sphere, metres |
/// | 16..20 | emitted power as a fraction of the node's power |
/// | 20..24 | axis of the bounding cone of the emission normals: octahedral, 16 bits per axis |
/// | 24..28 | cosine of the cone's half angle |
/// | 28..32 | index of an emitter, with the highest bit set, or of a node; 2^32 - 1 for an absent child |
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightChild {
    /// Centre of the emitters' bounding sphere, metres.
    pub centre: [f32; 3],
    /// Radius of the emitters' bounding sphere, metres.
    pub radius: f32,
    /// Power of the emitters below the child as a fraction of the node's power.
    pub share: f32,
    /// Axis of the cone that bounds the emission normals, a vector of length 0.57 to 1.
    pub axis: [f32; 3],
    /// Cosine of the half angle of this cone. It is -1 (all directions) if a point light or a double-sided
    /// triangle is below the child.
    pub cosine: f32,
    /// Index of the child: a node or an emitter.
    pub link: LightLink,
}

/// Kind and index of a light tree node's child.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LightLink {
    /// The child is the node with this index.
    Node(u32),
    /// The child is the emitter with this index.
    Emitter(u32),
}

/// A node of the light tree, one line.
#[derive(Clone, Copy)]
pub struct LightNode<'a>(pub &'a [u8; LINE_BYTES]);

const CHILD_BYTES: usize = LINE_BYTES / LIGHT_CHILDREN;
const NO_CHILD: u32 = u32::MAX;
const LEAF: u32 = 1 << 31;

impl LightNode<'_> {
    /// Reads child `index`; `None` if absent.
    #[inline(always)]
    pub fn child(&self, index: usize) -> Option<LightChild> {
        let bytes: &[u8; CHILD_BYTES] = self.0.as_chunks().0.get(index)?;
        let link = match read_u32(bytes, 28) {
            NO_CHILD => return None,
            leaf if leaf & LEAF != 0 => LightLink::Emitter(leaf & !LEAF),
            node => LightLink::Node(node),
        };
        Some(LightChild {
            centre: read_vector(bytes, 0),
            radius: read_f32(bytes, 12),
            share: read_f32(bytes, 16),
            axis: decode_octahedral(read_u32(bytes, 20)),
            cosine: read_f32(bytes, 24),
            link,
        })
    }

    /// Encodes a node with these children.
    pub fn encode(children: [Option<LightChild>; LIGHT_CHILDREN]) -> [u8; LINE_BYTES] {
        let mut line = [0; LINE_BYTES];
        for (index, child) in children.into_iter().enumerate() {
            let at = CHILD_BYTES * index;
            let Some(child) = child else {
                write_u32(&mut line, at + 28, NO_CHILD);
                continue;
            };
            write_vector(&mut line, at, child.centre);
            write_f32(&mut line, at + 12, child.radius);
            write_f32(&mut line, at + 16, child.share);
            write_u32(&mut line, at + 20, encode_octahedral(child.axis));
            write_f32(&mut line, at + 24, child.cosine);
            write_u32(
                &mut line,
                at + 28,
                match child.link {
                    LightLink::Node(node) => node & !LEAF,
                    LightLink::Emitter(emitter) => emitter | LEAF,
                },
            );
        }
        line
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn children_survive_their_line() {
        let child = |link: LightLink, axis: [f32; 3]| LightChild {
            centre: [1.0, -2.0, 0.5],
            radius: 0.75,
            share: 0.25,
            axis,
            cosine: -1.0,
            link,
        };
        let children = [
            Some(child(LightLink::Node(77), [0.0, -1.0, 0.0])),
            None,
            Some(child(LightLink::Emitter(123_456), [1.0, 0.0, 0.0])),
            None,
        ];
        let line = LightNode::encode(children);
        for (index, child) in children.into_iter().enumerate() {
            assert_eq!(LightNode(&line).child(index), child);
        }
        assert_eq!(LightNode(&line).child(LIGHT_CHILDREN), None);
    }
}
