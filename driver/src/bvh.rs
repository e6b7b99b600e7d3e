//! The bounding volume hierarchy: built by obvhs as a binary tree, made four-wide for the chip.

use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use photoncard_shared::budget::BVH_STACK;
use photoncard_shared::layout::{BvhNode, ChildReference, Record, Triangle as TriangleRecord};

use crate::scene::Triangle;

/// Triangles in a leaf: one line of them.
const LEAF_TRIANGLES: u32 = TriangleRecord::PER_LINE as u32;

/// A hierarchy in the chip's records.
#[derive(Debug)]
pub struct Hierarchy {
    /// Nodes, the root first.
    pub nodes: Vec<BvhNode>,
    /// The triangles' indices in the order of the leaves.
    pub order: Vec<u32>,
}

/// Why there is no hierarchy of these triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum HierarchyError {
    /// A descent could need more than the chip's stack.
    #[error("the bounding volume hierarchy is {levels} levels deep; the chip's stack holds {most}")]
    TooDeep {
        /// Levels of the hierarchy.
        levels: usize,
        /// Levels that the stack is enough for.
        most: usize,
    },
    /// More triangles or nodes than a reference can tell apart.
    #[error("the scene has {triangles} triangles; a card can tell {} apart", ChildReference::LIMIT)]
    TooMany {
        /// Triangles of the scene.
        triangles: usize,
    },
}

/// Every level may leave three of four children on the stack.
const MOST_LEVELS: usize = BVH_STACK / 3;

/// Builds the hierarchy of some triangles, at least one. The same on every machine: obvhs runs on one thread.
///
/// # Errors
/// If the chip could not descend in it.
pub fn build(triangles: &[Triangle]) -> Result<Hierarchy, HierarchyError> {
    let too_many = HierarchyError::TooMany { triangles: triangles.len() };
    if u32::try_from(triangles.len()).map_or(true, |count| count >= ChildReference::LIMIT) {
        return Err(too_many);
    }
    let boxes: Vec<Aabb> = triangles.iter().map(bounding_box).collect();
    let parameters = BvhBuildParams { max_prims_per_leaf: LEAF_TRIANGLES, ..BvhBuildParams::medium_build() };
    let binary = build_bvh2(&boxes, parameters, &mut std::time::Duration::default());
    let hierarchy = Widening::new(&binary).run().ok_or(too_many)?;
    let levels = depth(&hierarchy.nodes);
    if levels > MOST_LEVELS {
        return Err(HierarchyError::TooDeep { levels, most: MOST_LEVELS });
    }
    Ok(hierarchy)
}

fn bounding_box(triangle: &Triangle) -> Aabb {
    let [a, b, c] = triangle.vertices;
    Aabb { min: a.min(b).min(c).into(), max: a.max(b).max(c).into() }
}

/// Turns a binary tree into four-wide nodes.
struct Widening<'a> {
    binary: &'a Bvh2,
    nodes: Vec<BvhNode>,
    order: Vec<u32>,
}

impl<'a> Widening<'a> {
    fn new(binary: &'a Bvh2) -> Self {
        Self { binary, nodes: Vec::new(), order: Vec::new() }
    }

    /// `None` if there is more than a reference can tell.
    fn run(mut self) -> Option<Hierarchy> {
        self.nodes.push(BvhNode::EMPTY);
        let root = &self.binary.nodes[0];
        let children = if root.is_leaf() { vec![0] } else { self.four_children(0) };
        let mut waiting = vec![(0, children)];
        while let Some((target, children)) = waiting.pop() {
            for (slot, child) in children.into_iter().enumerate() {
                let node = &self.binary.nodes[child];
                let reference = if node.is_leaf() {
                    self.leaf(node.first_index as usize, node.prim_count as usize)?
                } else {
                    let index = self.nodes.len();
                    self.nodes.push(BvhNode::EMPTY);
                    waiting.push((index, self.four_children(child)));
                    ChildReference::node(u32::try_from(index).ok()?)?
                };
                self.place(target, slot, child, reference);
            }
        }
        Some(Hierarchy { nodes: self.nodes, order: self.order })
    }

    /// Up to four descendants of an inner node: its children, the largest of them opened until there are four.
    fn four_children(&self, node: usize) -> Vec<usize> {
        let children_of = |node: usize| {
            let first = self.binary.nodes[node].first_index as usize;
            [first, first + 1]
        };
        let mut children = children_of(node).to_vec();
        while children.len() < 4 {
            let area = |child: usize| self.binary.nodes[child].aabb().half_area();
            let inner = (0..children.len()).filter(|&slot| !self.binary.nodes[children[slot]].is_leaf());
            let Some(slot) = inner.max_by(|&a, &b| area(children[a]).total_cmp(&area(children[b]))) else {
                break;
            };
            let [left, right] = children_of(children[slot]);
            children[slot] = left;
            children.push(right);
        }
        children
    }

    fn leaf(&mut self, first: usize, count: usize) -> Option<ChildReference> {
        let start = u32::try_from(self.order.len()).ok()?;
        self.order.extend_from_slice(&self.binary.primitive_indices[first..first + count]);
        ChildReference::leaf(start, u32::try_from(count).ok()?)
    }

    fn place(&mut self, target: usize, slot: usize, child: usize, reference: ChildReference) {
        let bounds = self.binary.nodes[child].aabb();
        let (lower, upper) = (bounds.min.to_array(), bounds.max.to_array());
        let node = &mut self.nodes[target];
        for axis in 0..3 {
            node.lower[axis][slot] = lower[axis];
            node.upper[axis][slot] = upper[axis];
        }
        node.children[slot] = reference;
    }
}

/// Levels of nodes.
fn depth(nodes: &[BvhNode]) -> usize {
    let mut deepest = 0;
    let mut waiting = vec![(0, 1)];
    while let Some((index, level)) = waiting.pop() {
        deepest = deepest.max(level);
        let children = nodes[index as usize].children.into_iter();
        let inner = children.filter(|&child| child != ChildReference::EMPTY && child.triangles().is_none());
        waiting.extend(inner.map(|child| (child.0, level + 1)));
    }
    deepest
}
