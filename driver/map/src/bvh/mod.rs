//! Bounding volume hierarchy. The crate obvhs builds a binary tree, which is folded into the chip's wide
//! nodes by the surface area heuristic.

use obvhs::aabb::Aabb;
use obvhs::bvh2::{Bvh2, node::Bvh2Node};
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};
use photoncard_scene::Triangle;
use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::budget::BVH_STACK;
use photoncard_shared::layout::{self, BvhLeaf, BvhNode, LEAF_TRIANGLES, MAX_MATERIALS, NodeBox};
use rayon::prelude::*;

use crate::fold::{Folded, Tree};

mod reinsertion;

/// A bounding volume hierarchy, encoded as the chip's records.
#[derive(Debug)]
pub struct Hierarchy {
    /// [`BvhNode`] records; the root is the first.
    pub nodes: Vec<[u8; LINE_BYTES]>,
    /// [`BvhLeaf`] records, of up to [`LEAF_TRIANGLES`] triangles each.
    pub leaves: Vec<[u8; LINE_BYTES]>,
    /// For each leaf, the indices of its triangles in the list given to [`build`], by slot.
    pub leaf_triangles: Vec<LeafTriangles>,
}

/// Indices of a leaf's triangles in the list given to [`build`], by slot.
pub type LeafTriangles = heapless::Vec<u32, LEAF_TRIANGLES>;

/// Material flags that leaves store for their triangles. The lists are indexed by material; a missing entry
/// counts as false.
#[derive(Clone, Copy, Debug, Default)]
pub struct Finishes<'a> {
    /// True for materials whose triangles may have cut-outs.
    pub cut_out: &'a [bool],
    /// True for flat glass, which light passes without a change of direction.
    pub flat_glass: &'a [bool],
}

/// Triangles with the flags of their materials, from which leaves are encoded.
struct Mesh<'a> {
    triangles: &'a [Triangle],
    finishes: Finishes<'a>,
}

/// Error of [`build`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum HierarchyError {
    /// A traversal could overflow the chip's stack.
    #[error(
        "a descent in the bounding volume hierarchy may put off {entries} parts; the chip's stack holds {BVH_STACK}"
    )]
    TooDeep {
        /// Maximum number of stack entries that a traversal needs.
        entries: usize,
    },
    /// There are more triangles than a card can index.
    #[error("the scene has {triangles} triangles; a card image can index at most {MAX_TRIANGLES}")]
    TooMany {
        /// Number of triangles of the scene.
        triangles: usize,
    },
    /// A material index exceeds the maximum that a card can index.
    #[error(
        "a triangle has the material of index {material}; a card image can index at most {MAX_MATERIALS} materials"
    )]
    TooManyMaterials {
        /// Index of the material.
        material: u32,
    },
    /// A corner is not finite, or so far away that the area of the scene's bounding box is not finite.
    #[error("a triangle has a corner whose position is not finite, or too far from the origin")]
    NotFinite,
}

/// Maximum number of triangles. Each triangle can have a leaf of its own, and its index in the card image is
/// `leaf * LEAF_TRIANGLES + slot`.
const MAX_TRIANGLES: usize = (u32::MAX / LEAF_TRIANGLES as u32 / 2) as usize;

/// Cost of a visit of a leaf relative to a visit of a node.
const LEAF_COST: f32 = 1.0;

/// Minimum number of nodes of one depth that a thread converts at a time.
const SEQUENTIAL: usize = 256;

/// Maximum number of concentric boxes that the builder receives individually.
const MAX_CONCENTRIC: usize = 64;

/// Fractions of the nodes that the two calls of [`reinsertion::optimize`] try to reinsert in their first
/// rounds.
const REINSERTED: [f32; 2] = [0.2, 0.4];
/// Number of first passes in which the builder joins only boxes that are adjacent in its sort order. The
/// first passes make the nodes nearest to the leaves.
const SEARCH_DEPTH: usize = 2;

/// Builds the hierarchy of `triangles`, of which there must be at least one. The result depends neither on
/// the machine nor on the number of threads.
///
/// # Errors
/// If there are too many triangles or materials, a corner is not finite or too far away, or a traversal could
/// overflow the chip's stack.
pub fn build(triangles: &[Triangle], finishes: Finishes) -> Result<Hierarchy, HierarchyError> {
    if triangles.len() > MAX_TRIANGLES {
        return Err(HierarchyError::TooMany { triangles: triangles.len() });
    }
    if let Some(triangle) = triangles.iter().find(|triangle| triangle.material >= MAX_MATERIALS) {
        return Err(HierarchyError::TooManyMaterials { material: triangle.material });
    }
    let boxes: Vec<Aabb> = triangles.iter().map(bounding_box).collect();
    // `min` and `max` skip NaN, so the corners themselves are checked.
    let is_finite = triangles.iter().flat_map(|triangle| triangle.vertices).all(glam::Vec3::is_finite);
    let all = boxes.iter().fold(Aabb::empty(), |all, bounds| all.union(bounds));
    if !is_finite || !all.half_area().is_finite() {
        return Err(HierarchyError::NotFinite);
    }
    let parts = Parts::new(&boxes);
    let around_parts: Vec<Aabb> = parts.iter().map(|part| around(part, &boxes)).collect();
    let binary = binary(&around_parts);
    let mesh = &Mesh { triangles, finishes };
    let mut folded = Folded::new(tree(&binary, &parts, &boxes, mesh));
    if folded.stack > BVH_STACK {
        // A tree of median splits is slower to traverse, but has minimum depth.
        let mut indices: Vec<u32> = (0..triangles.len() as u32).collect();
        folded = Folded::new(halves(&mut indices, &boxes, mesh));
    }
    let Folded { nodes, leaves, stack } = folded;
    if stack > BVH_STACK {
        return Err(HierarchyError::TooDeep { entries: stack });
    }
    let nodes = nodes.par_iter().map(|node| BvhNode::encode(&node.children, node.links));
    let nodes = nodes.collect::<Option<_>>().ok_or(HierarchyError::NotFinite)?;
    let lines = leaves.par_iter().map(|indices| {
        mesh.encode(indices).unwrap_or_else(|| unreachable!("a leaf of {} triangles", indices.len()))
    });
    Ok(Hierarchy { nodes, leaves: lines.collect(), leaf_triangles: leaves })
}

/// Builds a binary tree with one leaf per box. Leaves of several triangles are made when the tree is folded.
fn binary(boxes: &[Aabb]) -> Bvh2 {
    let (distance, precision) = (PlocSearchDistance::High, SortPrecision::U128);
    let indices = (0..boxes.len() as u32).collect();
    let mut tree =
        PlocBuilder::with_capacity(boxes.len()).build(distance, boxes, indices, precision, SEARCH_DEPTH);
    REINSERTED.iter().for_each(|&share| reinsertion::optimize(&mut tree, share));
    tree
}

/// Input of the builder: one box for many triangles whose boxes have a common centre, and one box for each
/// other triangle.
///
/// The builder joins a box with the one for which the area of the union is least. The union of a box with any
/// box inside it has the same area. Of many nested boxes, hardly any two are therefore each other's nearest,
/// and the builder would search all of them for each pair that it joins.
struct Parts {
    crowds: Vec<Vec<u32>>,
    singles: Vec<u32>,
}

impl Parts {
    fn new(boxes: &[Aabb]) -> Self {
        let centre = |bounds: &Aabb| bounds.center().to_array().map(|value| (value + 0.0).to_bits());
        let mut keyed: Vec<_> = boxes.iter().map(centre).zip(0_u32..).collect();
        keyed.sort_unstable();
        let same = keyed.chunk_by(|(a, _), (b, _)| a == b).filter(|same| same.len() > MAX_CONCENTRIC);
        let crowds: Vec<Vec<u32>> = same.map(|same| same.iter().map(|(_, index)| *index).collect()).collect();
        let mut is_single = vec![true; boxes.len()];
        crowds.iter().flatten().for_each(|&index| is_single[index as usize] = false);
        Self { crowds, singles: (0..).zip(is_single).filter_map(|(index, is)| is.then_some(index)).collect() }
    }

    /// Returns the triangle indices of each box that the builder receives.
    fn iter(&self) -> impl Iterator<Item = &[u32]> {
        self.crowds.iter().map(Vec::as_slice).chain(self.singles.chunks(1))
    }

    fn triangles(&self, part: u32) -> &[u32] {
        let part = part as usize;
        match part.checked_sub(self.crowds.len()) {
            None => &self.crowds[part],
            Some(single) => &self.singles[single..=single],
        }
    }
}

fn around(indices: &[u32], boxes: &[Aabb]) -> Aabb {
    indices.iter().fold(Aabb::empty(), |bounds, &index| bounds.union(&boxes[index as usize]))
}

fn bounding_box(triangle: &Triangle) -> Aabb {
    let [a, b, c] = triangle.vertices;
    Aabb { min: a.min(b).min(c).into(), max: a.max(b).max(c).into() }
}

impl Mesh<'_> {
    fn record(&self, triangle: &Triangle) -> layout::Triangle {
        let vertices = triangle.vertices.map(|vertex| vertex.to_array());
        let material = triangle.material;
        let is = |list: &[bool]| list.get(material as usize).copied().unwrap_or(false);
        let [cut_out, flat_glass] = [self.finishes.cut_out, self.finishes.flat_glass].map(is);
        layout::Triangle { vertices, material, cut_out, flat_glass }
    }

    /// Encodes a leaf with the triangles `indices`; `None` if they exceed one line.
    fn encode(&self, indices: &[u32]) -> Option<[u8; LINE_BYTES]> {
        let records: heapless::Vec<_, LEAF_TRIANGLES> =
            indices.iter().map(|&index| self.record(&self.triangles[index as usize])).collect();
        BvhLeaf::encode(&records)
    }
}

/// Converts the builder's tree for folding. Every subtree whose triangles fit in one leaf can become a leaf.
fn tree(binary: &Bvh2, parts: &Parts, boxes: &[Aabb], mesh: &Mesh) -> Tree<LeafTriangles, NodeBox> {
    let missing = || unreachable!("a part is made before its parent");
    let mut below = Vec::new();
    for nodes in depths(binary).iter().rev() {
        let mut below_nodes = below.into_iter();
        let mut part = || below_nodes.next().unwrap_or_else(missing);
        let with_parts = nodes.iter().map(|&node| (node, (!node.is_leaf()).then(|| [part(), part()])));
        let with_parts: Vec<_> = with_parts.collect();
        let trees = with_parts.into_par_iter().with_min_len(SEQUENTIAL).map(|(node, parts_below)| {
            let Some(parts_below) = parts_below else {
                // A leaf of the builder's tree holds one of its input boxes.
                let part = binary.primitive_indices[node.first_index as usize];
                return halves(&mut parts.triangles(part).to_vec(), boxes, mesh);
            };
            let bounds = node.aabb();
            let (lower, upper) = (bounds.min.to_array(), bounds.max.to_array());
            let leaf = both(&parts_below, mesh).map(|leaf| (leaf, LEAF_COST * bounds.half_area()));
            Tree::node(parts_below, NodeBox { lower, upper }, bounds.half_area(), leaf)
        });
        below = trees.collect();
    }
    below.pop().unwrap_or_else(missing)
}

/// Returns the nodes of each depth, from the root downwards. Nodes with one parent are adjacent.
fn depths(binary: &Bvh2) -> Vec<Vec<&Bvh2Node>> {
    let mut depths = Vec::new();
    let mut nodes = vec![&binary.nodes[0]];
    while !nodes.is_empty() {
        let inner = nodes.iter().filter(|node| !node.is_leaf()).map(|node| node.first_index as usize);
        let below = inner.flat_map(|first| [first, first + 1].map(|child| &binary.nodes[child])).collect();
        depths.push(std::mem::replace(&mut nodes, below));
    }
    depths
}

/// Builds a tree by median splits along the longest axis.
fn halves(indices: &mut [u32], boxes: &[Aabb], mesh: &Mesh) -> Tree<LeafTriangles, NodeBox> {
    let bounds = around(indices, boxes);
    let area = bounds.half_area();
    let node_box = NodeBox { lower: bounds.min.to_array(), upper: bounds.max.to_array() };
    if let Ok(leaf) = LeafTriangles::from_slice(indices)
        && mesh.encode(&leaf).is_some()
    {
        return Tree::leaf(leaf, node_box, LEAF_COST * area);
    }
    let axis = bounds.diagonal().max_position();
    let (middle, center) = (indices.len() / 2, |index: u32| boxes[index as usize].center()[axis]);
    indices.select_nth_unstable_by(middle, |&a, &b| center(a).total_cmp(&center(b)).then(a.cmp(&b)));
    let (below, above) = indices.split_at_mut(middle);
    let parts = [below, above].map(|part| halves(part, boxes, mesh));
    Tree::node(parts, node_box, area, None)
}

/// Returns the triangles of two leaves together, or `None` if they do not fit in one leaf.
fn both(parts: &[Tree<LeafTriangles, NodeBox>; 2], mesh: &Mesh) -> Option<LeafTriangles> {
    let mut indices = LeafTriangles::new();
    for part in parts {
        indices.extend_from_slice(part.as_leaf()?).ok()?;
    }
    indices.sort_unstable();
    mesh.encode(&indices).is_some().then_some(indices)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use photoncard_firmware::sampler::hash;
    use photoncard_shared::layout::{Child, WideNode};

    use super::*;

    fn triangles(count: u32) -> Vec<Triangle> {
        let random = |i: u32, k: u32| (hash(hash(i).wrapping_add(k)) >> 8) as f32 / 16_777_216.0;
        let point = |i: u32, k: u32| Vec3::new(random(i, k), random(i, k + 1), random(i, k + 2));
        let corners = |i: u32| [0, 3, 6].map(|k| point(i, 9) + 0.1 * point(i, k));
        (0..count).map(|i| Triangle::new(corners(i), i)).collect()
    }

    /// Collects the triangles below a child. Asserts that each lies within the boxes of all nodes above it.
    fn walk(hierarchy: &Hierarchy, child: Child, room: NodeBox, found: &mut Vec<u32>) {
        let node = match child {
            Child::Leaf(leaf) => {
                let leaf = BvhLeaf(&hierarchy.leaves[leaf as usize]);
                let mut indices: Vec<u32> = (0..leaf.triangles() as usize)
                    .map(|slot| {
                        let triangle = leaf.triangle(slot);
                        let corners = triangle.vertices.map(|v| NodeBox { lower: v, upper: v });
                        assert!(corners.into_iter().all(|corner| room.union(corner) == room));
                        triangle.material
                    })
                    .collect();
                found.append(&mut indices);
                return;
            }
            Child::Node(node) => &hierarchy.nodes[node as usize],
        };
        for index in 0..WideNode(node).children() {
            let child = BvhNode(node).bounds(index as usize).expect("a child");
            let room = NodeBox {
                lower: [0, 1, 2].map(|axis| child.lower[axis].max(room.lower[axis])),
                upper: [0, 1, 2].map(|axis| child.upper[axis].min(room.upper[axis])),
            };
            walk(hierarchy, WideNode(node).links().child(index), room, found);
        }
    }

    #[test]
    fn every_triangle_is_in_one_leaf_and_within_the_boxes_above_it() {
        for count in [1, 2, 3, 4, 17, 1000, 20_000] {
            let hierarchy = build(&triangles(count), Finishes::default()).expect("builds");
            let everywhere = NodeBox { lower: [-9.0; 3], upper: [9.0; 3] };
            let mut found = Vec::new();
            walk(&hierarchy, Child::Node(0), everywhere, &mut found);
            found.sort_unstable();
            assert!(found.into_iter().eq(0..count), "{count} triangles");
        }
    }

    #[test]
    fn every_triangle_of_a_mesh_is_in_one_leaf_whatever_its_material() {
        let vertex = |x: u32, y: u32| Vec3::new(x as f32, (x * 7 % 5 + y * 3 % 4) as f32 * 0.1, y as f32);
        let squares = (0..40_u32).flat_map(|x| (0..40_u32).map(move |y| (x, y)));
        for materials in 1..=4 {
            let mesh: Vec<Triangle> = squares
                .clone()
                .flat_map(|(x, y)| {
                    let [a, b] = [vertex(x, y), vertex(x + 1, y)];
                    let [c, d] = [vertex(x + 1, y + 1), vertex(x, y + 1)];
                    [[a, b, c], [a, c, d]].map(|vertices| Triangle::new(vertices, hash(x + y) % materials))
                })
                .collect();
            let hierarchy = build(&mesh, Finishes::default()).expect("builds");
            let bits = |triangle: layout::Triangle| {
                (triangle.vertices.map(|vertex| vertex.map(f32::to_bits)), triangle.material)
            };
            let leaves = hierarchy.leaves.iter().map(BvhLeaf);
            let mut found: Vec<_> = leaves
                .flat_map(|leaf| (0..leaf.triangles() as usize).map(move |slot| bits(leaf.triangle(slot))))
                .collect();
            let mut expected: Vec<_> = mesh
                .iter()
                .map(|triangle| {
                    bits(Mesh { triangles: &mesh, finishes: Finishes::default() }.record(triangle))
                })
                .collect();
            found.sort_unstable();
            expected.sort_unstable();
            assert!(found == expected, "{materials} materials");
            assert!(
                materials > 1 || hierarchy.leaves.len() < mesh.len() * 2 / 5,
                "{}",
                hierarchy.leaves.len()
            );
        }
    }

    #[test]
    fn corners_that_are_not_finite_are_refused() {
        for coordinate in [f32::NAN, f32::INFINITY, 1e30] {
            let mut triangles = triangles(20);
            triangles[7].vertices[1] = Vec3::splat(coordinate);
            assert!(
                matches!(build(&triangles, Finishes::default()), Err(HierarchyError::NotFinite)),
                "{coordinate}"
            );
        }
    }

    /// If the builder received nested boxes singly, it would search all of them for each pair that it joins.
    #[test]
    fn concentric_triangles_reach_the_builder_as_one_part() {
        for step in [0.0, 1e-5] {
            let squares = (0..50_000).map(|i| {
                let side = 1.0 + step * i as f32;
                let [a, b, c] =
                    [(-side, -side), (side, -side), (side, side)].map(|(x, z)| Vec3::new(x, 0.0, z));
                Triangle::new([a, b, c], i % 3)
            });
            let squares: Vec<Triangle> = squares.collect();
            let boxes: Vec<Aabb> = squares.iter().map(bounding_box).collect();
            assert_eq!(Parts::new(&boxes).iter().count(), 1);
            let hierarchy = build(&squares, Finishes::default()).expect("builds");
            let mut found: Vec<u32> = hierarchy.leaf_triangles.iter().flatten().copied().collect();
            found.sort_unstable();
            assert!(found.into_iter().eq(0..50_000));
        }
    }

    #[test]
    fn coincident_triangles_are_built() {
        let [triangle] = triangles(1)[..] else { unreachable!() };
        let hierarchy = build(&vec![triangle; 5000], Finishes::default()).expect("builds");
        assert!((5000 / LEAF_TRIANGLES..5000 / 3).contains(&hierarchy.leaves.len()));
    }
}
