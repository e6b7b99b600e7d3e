//! Bounding volume hierarchy. The crate obvhs builds a binary tree, which is folded into the chip's wide
//! nodes by the surface area heuristic.

use obvhs::aabb::Aabb;
use obvhs::bvh2::{Bvh2, node::Bvh2Node};
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};
use photoncard_scene::{Instance, Triangle};
use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::budget::BVH_STACK;
use photoncard_shared::layout::{self, BvhLeaf, BvhNode, LEAF_TRIANGLES, Links, MAX_MATERIALS, NodeBox};
use rayon::prelude::*;

use crate::fold::{Folded, Tree};

mod reinsertion;

/// A bounding volume hierarchy, encoded as the chip's records.
#[derive(Debug)]
pub struct Hierarchy {
    /// [`BvhNode`] records; the root is the first.
    pub nodes: Vec<[u8; LINE_BYTES]>,
    /// [`BvhLeaf`] records, of up to [`LEAF_TRIANGLES`] triangles each, and [`layout::Instance`] records.
    pub leaves: Vec<[u8; LINE_BYTES]>,
    /// For each leaf, the indices of its triangles, by slot. They count the triangles in world space, then
    /// those of each group in turn ([`Content`]). Empty for an instance.
    pub leaf_triangles: Vec<LeafTriangles>,
    /// Leaves that hold an instance, each with the instance's index.
    pub instances: Vec<(usize, u32)>,
}

/// Indices of a leaf's triangles, by slot.
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

/// Triangles in world space, and instances of groups of triangles.
#[derive(Clone, Copy, Debug, Default)]
pub struct Content<'a> {
    /// Triangles in world space.
    pub triangles: &'a [Triangle],
    /// Groups of triangles, each in a space of its own.
    pub groups: &'a [Vec<Triangle>],
    /// Instances of the groups.
    pub instances: &'a [Instance],
}

impl<'a> Content<'a> {
    /// Triangles in the order in which [`Hierarchy::leaf_triangles`] counts them: those in world space, then
    /// those of the groups.
    fn stored(&self) -> impl Iterator<Item = &'a Triangle> {
        self.triangles.iter().chain(self.groups.iter().flatten())
    }
}

/// Triangles and the flags of their materials, from which leaves are encoded. Index `triangles.len() + i`
/// stands for instance `i`, which has a leaf of its own.
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

/// Builds the hierarchy of at least one triangle or instance. The result depends neither on the machine nor
/// on threads.
///
/// # Errors
/// If there are too many triangles or materials, a corner is not finite or too far away, or a traversal could
/// overflow the chip's stack.
pub fn build(content: Content, finishes: Finishes) -> Result<Hierarchy, HierarchyError> {
    check(content)?;
    let of = |triangles: &[Triangle]| -> Vec<Aabb> { triangles.iter().map(bounding_box).collect() };
    let groups: Vec<Vec<Aabb>> = content.groups.iter().map(|group| of(group)).collect();
    let mut boxes = of(content.triangles);
    let around_groups: Vec<Aabb> = groups.iter().map(|boxes| around_all(boxes)).collect();
    boxes.extend(content.instances.iter().map(|instance| around_instance(instance, &around_groups)));
    if !boxes.iter().fold(Aabb::empty(), |all, bounds| all.union(bounds)).half_area().is_finite() {
        return Err(HierarchyError::NotFinite);
    }
    let mesh = |triangles| Mesh { triangles, finishes };
    let parts = content.groups.iter().zip(&groups).map(|(group, boxes)| (mesh(group.as_slice()), boxes));
    let parts: Vec<_> = std::iter::once((mesh(content.triangles), &boxes)).chain(parts).collect();
    let mut folded: Vec<_> = parts.iter().map(|(mesh, boxes)| FoldedTree::new(mesh, binary(boxes))).collect();
    if entries(&folded) > BVH_STACK {
        // A tree of median splits is slower to traverse, but has minimum depth.
        for (tree, (mesh, boxes)) in folded.iter_mut().zip(&parts) {
            let halved = FoldedTree::new(mesh, halved(boxes));
            if halved.folded.stack < tree.folded.stack {
                *tree = halved;
            }
        }
    }
    let entries = entries(&folded);
    if entries > BVH_STACK {
        return Err(HierarchyError::TooDeep { entries });
    }
    let [(_, boxes), ..] = parts.as_slice() else { return Err(HierarchyError::NotFinite) };
    joined(folded, content, &boxes[content.triangles.len()..], finishes)
}

/// Checks that a card can index this many triangles.
///
/// # Errors
/// [`HierarchyError::TooMany`].
pub(crate) fn check_number(triangles: usize) -> Result<(), HierarchyError> {
    if triangles > MAX_TRIANGLES { Err(HierarchyError::TooMany { triangles }) } else { Ok(()) }
}

/// Checks that a card can index all triangles and their materials, and that all corners are finite.
fn check(content: Content) -> Result<(), HierarchyError> {
    check_number(content.stored().count() + content.instances.len())?;
    if let Some(triangle) = content.stored().find(|triangle| triangle.material >= MAX_MATERIALS) {
        return Err(HierarchyError::TooManyMaterials { material: triangle.material });
    }
    // `min` and `max` of boxes skip NaN, so the corners themselves are checked.
    let is_finite = content.stored().flat_map(|triangle| triangle.vertices).all(glam::Vec3::is_finite);
    if is_finite { Ok(()) } else { Err(HierarchyError::NotFinite) }
}

/// Margin of an instance's box for the rounding of its vertices, relative to the greatest coordinate.
const ROUNDING: f32 = 32.0 * f32::EPSILON;

fn around_all(boxes: &[Aabb]) -> Aabb {
    boxes.iter().fold(Aabb::empty(), |all, bounds| all.union(bounds))
}

/// Box around an instance, with a margin for the rounding of its vertices. `groups` are the boxes around
/// the groups.
fn around_instance(instance: &Instance, groups: &[Aabb]) -> Aabb {
    let Aabb { min, max } = groups[instance.group as usize];
    let [min, max] = instance.bounds([min.into(), max.into()]);
    let margin = ROUNDING * min.abs().max(max.abs()).max_element();
    Aabb { min: (min - margin).into(), max: (max + margin).into() }
}

/// A folded tree. Its leaves, and the bounds of children, are indices of nodes of the binary tree.
struct FoldedTree {
    folded: Folded<u32, u32>,
    binary: Vec<Bvh2Node>,
}

impl FoldedTree {
    fn new(mesh: &Mesh, binary: Vec<Bvh2Node>) -> Self {
        Self { folded: Folded::new(tree(&binary, mesh)), binary }
    }
}

/// Returns the maximum number of stack entries of a traversal. The first tree is the scene's. The others are
/// those of the groups, which a traversal enters at their instances.
fn entries(folded: &[FoldedTree]) -> usize {
    let [scene, groups @ ..] = folded else { return 0 };
    // A mark is pushed below the root of a group.
    let of_groups = groups.iter().map(|group| group.folded.stack + 1).max();
    scene.folded.stack + of_groups.unwrap_or(0)
}

/// Encodes the hierarchy of a scene and, behind it, those of its groups. `around_instances` are the boxes
/// around the instances.
fn joined(
    folded: Vec<FoldedTree>,
    content: Content,
    around_instances: &[Aabb],
    finishes: Finishes,
) -> Result<Hierarchy, HierarchyError> {
    let mut hierarchy = Hierarchy {
        nodes: Vec::new(),
        leaves: Vec::new(),
        leaf_triangles: Vec::new(),
        instances: Vec::new(),
    };
    let (mut roots, mut first_triangle) = (Vec::new(), 0);
    let meshes = std::iter::once(content.triangles).chain(content.groups.iter().map(Vec::as_slice));
    for (FoldedTree { folded: Folded { nodes, leaves, .. }, binary }, triangles) in
        folded.into_iter().zip(meshes)
    {
        let (first_node, first_leaf) = (hierarchy.nodes.len() as u32, hierarchy.leaves.len() as u32);
        roots.push(first_node);
        let mesh = &Mesh { triangles, finishes };
        let encoded = nodes.par_iter().map(|node| {
            let Links { leaves: count, first_leaf: leaf, first_node: child } = node.links;
            let links =
                Links { leaves: count, first_leaf: first_leaf + leaf, first_node: first_node + child };
            let children: Vec<_> =
                node.children.iter().map(|&child| node_box(&binary[child as usize])).collect();
            BvhNode::encode(&children, links)
        });
        hierarchy.nodes.extend(encoded.collect::<Option<Vec<_>>>().ok_or(HierarchyError::NotFinite)?);
        let too_many = || unreachable!("the triangles below a leaf were counted");
        let leaves: Vec<LeafTriangles> =
            leaves.par_iter().map(|&leaf| below(&binary, leaf).unwrap_or_else(too_many)).collect();
        drop(binary);
        let lines = leaves.par_iter().map(|indices| match mesh.is_instance(indices) {
            true => [0; LINE_BYTES],
            false => {
                mesh.encode(indices).unwrap_or_else(|| unreachable!("a leaf of {} triangles", indices.len()))
            }
        });
        hierarchy.leaves.par_extend(lines);
        let of_stored = |indices: LeafTriangles| -> LeafTriangles {
            let triangles = indices.into_iter().filter(|&index| (index as usize) < triangles.len());
            triangles.map(|index| first_triangle + index).collect()
        };
        if roots.len() == 1 {
            let instance = |indices: &LeafTriangles| indices.first()?.checked_sub(triangles.len() as u32);
            let found = (0..).zip(&leaves).filter_map(|(leaf, indices)| Some((leaf, instance(indices)?)));
            hierarchy.instances.extend(found);
        }
        hierarchy.leaf_triangles.extend(leaves.into_iter().map(of_stored));
        first_triangle += triangles.len() as u32;
    }
    for &(leaf, instance) in &hierarchy.instances {
        let Instance { group, to_world, to_group, .. } = content.instances[instance as usize];
        let root = roots[1 + group as usize];
        let Aabb { min, max } = around_instances[instance as usize];
        let reach = min.abs().max(max.abs()).max_element();
        hierarchy.leaves[leaf] = layout::Instance { to_world, to_group, root, reach }.to_bytes();
    }
    Ok(hierarchy)
}

/// Builds a binary tree with one leaf per box. A leaf's `first_index` is the index of its box. Leaves of
/// several triangles are made when the tree is folded. Median splits divide the triangles that the builder
/// received as one box.
fn binary(boxes: &[Aabb]) -> Vec<Bvh2Node> {
    let parts = Parts::new(boxes);
    let around_parts: Vec<Aabb> = parts.iter().map(|part| around(part, boxes)).collect();
    let (distance, precision) = (PlocSearchDistance::High, SortPrecision::U128);
    let indices = (0..around_parts.len() as u32).collect();
    let mut tree = PlocBuilder::with_capacity(around_parts.len()).build(
        distance,
        &around_parts,
        indices,
        precision,
        SEARCH_DEPTH,
    );
    drop(around_parts);
    REINSERTED.iter().for_each(|&share| reinsertion::optimize(&mut tree, share));
    let Bvh2 { mut nodes, primitive_indices, .. } = tree;
    for node in 0..nodes.len() {
        if nodes[node].is_leaf() {
            let part = primitive_indices[nodes[node].first_index as usize];
            match parts.triangles(part) {
                &[triangle] => nodes[node].first_index = triangle,
                crowd => halve(&mut nodes, node, &mut crowd.to_vec(), boxes),
            }
        }
    }
    nodes
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

    /// Returns whether the triangles or instances `indices` fit in one leaf.
    fn fits(&self, indices: &LeafTriangles) -> bool {
        if self.is_instance(indices) { indices.len() == 1 } else { self.encode(indices).is_some() }
    }

    /// Returns whether the leaf holds an instance.
    fn is_instance(&self, indices: &[u32]) -> bool {
        indices.iter().any(|&index| index as usize >= self.triangles.len())
    }

    /// Encodes a leaf with the triangles `indices`; `None` if they exceed one line.
    fn encode(&self, indices: &[u32]) -> Option<[u8; LINE_BYTES]> {
        let records: heapless::Vec<_, LEAF_TRIANGLES> = indices
            .iter()
            .filter_map(|&index| Some(self.record(self.triangles.get(index as usize)?)))
            .collect();
        BvhLeaf::encode(&records)
    }
}

/// Converts a binary tree for folding. Every subtree whose triangles fit in one leaf can become a leaf.
fn tree(binary: &[Bvh2Node], mesh: &Mesh) -> Tree<u32, u32> {
    let missing = || unreachable!("a part is made before its parent");
    let mut pairs: Vec<[Tree<u32, u32>; 2]> = Vec::new();
    for nodes in depths(binary).into_iter().rev() {
        let inner: Vec<u32> =
            nodes.iter().copied().filter(|&node| !binary[node as usize].is_leaf()).collect();
        let inner = inner.into_par_iter().zip(pairs).with_min_len(SEQUENTIAL).map(|(node, parts)| {
            let area = binary[node as usize].aabb().half_area();
            let leaf = parts.iter().all(|part| part.as_leaf().is_some()) && fits(binary, node, mesh);
            Tree::node(parts, node, area, leaf.then_some((node, LEAF_COST * area)))
        });
        let mut inner = inner.collect::<Vec<_>>().into_iter();
        let mut trees = nodes.into_iter().map(|node| match binary[node as usize].is_leaf() {
            true => Tree::leaf(node, node, LEAF_COST * binary[node as usize].aabb().half_area()),
            false => inner.next().unwrap_or_else(missing),
        });
        if trees.len() == 1 {
            return trees.next().unwrap_or_else(missing);
        }
        pairs = std::iter::from_fn(|| Some([trees.next()?, trees.next()?])).collect();
    }
    missing()
}

/// Returns the nodes of each depth, from the root downwards. Nodes with one parent are adjacent.
fn depths(binary: &[Bvh2Node]) -> Vec<Vec<u32>> {
    let mut depths = Vec::new();
    let mut nodes = vec![0];
    while !nodes.is_empty() {
        let inner = nodes.iter().map(|&node| &binary[node as usize]).filter(|node| !node.is_leaf());
        let below = inner.flat_map(|node| [node.first_index, node.first_index + 1]).collect();
        depths.push(std::mem::replace(&mut nodes, below));
    }
    depths
}

/// Builds a binary tree of minimum depth over at least one box, by median splits.
fn halved(boxes: &[Aabb]) -> Vec<Bvh2Node> {
    let mut indices: Vec<u32> = (0..boxes.len() as u32).collect();
    let mut nodes = vec![Bvh2Node::default()];
    halve(&mut nodes, 0, &mut indices, boxes);
    nodes
}

/// Makes the node `node` the root of a tree of the boxes `indices`, by median splits along the longest axis.
fn halve(nodes: &mut Vec<Bvh2Node>, node: usize, indices: &mut [u32], boxes: &[Aabb]) {
    let bounds = around(indices, boxes);
    if let &mut [index] = indices {
        nodes[node] = Bvh2Node::new(bounds, 1, index);
        return;
    }
    let axis = bounds.diagonal().max_position();
    let (middle, center) = (indices.len() / 2, |index: u32| boxes[index as usize].center()[axis]);
    indices.select_nth_unstable_by(middle, |&a, &b| center(a).total_cmp(&center(b)).then(a.cmp(&b)));
    let first = nodes.len();
    nodes[node] = Bvh2Node::new(bounds, 0, first as u32);
    nodes.resize(first + 2, Bvh2Node::default());
    let (below, above) = indices.split_at_mut(middle);
    halve(nodes, first, below, boxes);
    halve(nodes, first + 1, above, boxes);
}

/// Returns whether the triangles below a node fit in one leaf.
fn fits(binary: &[Bvh2Node], node: u32, mesh: &Mesh) -> bool {
    below(binary, node).is_some_and(|indices| mesh.fits(&indices))
}

/// Returns the indices of the triangles or instances below a node, in order; `None` if they are more than a
/// leaf can have.
fn below(binary: &[Bvh2Node], node: u32) -> Option<LeafTriangles> {
    fn add(binary: &[Bvh2Node], node: u32, indices: &mut LeafTriangles) -> Option<()> {
        let Bvh2Node { first_index, .. } = binary[node as usize];
        if binary[node as usize].is_leaf() {
            return indices.push(first_index).ok();
        }
        add(binary, first_index, indices)?;
        add(binary, first_index + 1, indices)
    }
    let mut indices = LeafTriangles::new();
    add(binary, node, &mut indices)?;
    indices.sort_unstable();
    Some(indices)
}

fn node_box(node: &Bvh2Node) -> NodeBox {
    let Aabb { min, max } = node.aabb();
    NodeBox { lower: min.to_array(), upper: max.to_array() }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use photoncard_firmware::sampler::hash;
    use photoncard_shared::layout::{Child, WideNode};

    use super::*;

    fn built(triangles: &[Triangle]) -> Result<Hierarchy, HierarchyError> {
        build(Content { triangles, ..Content::default() }, Finishes::default())
    }

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
            let hierarchy = built(&triangles(count)).expect("builds");
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
            let hierarchy = built(&mesh).expect("builds");
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
            assert!(matches!(built(&triangles), Err(HierarchyError::NotFinite)), "{coordinate}");
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
            let hierarchy = built(&squares).expect("builds");
            let mut found: Vec<u32> = hierarchy.leaf_triangles.iter().flatten().copied().collect();
            found.sort_unstable();
            assert!(found.into_iter().eq(0..50_000));
        }
    }

    #[test]
    fn coincident_triangles_are_built() {
        let [triangle] = triangles(1)[..] else { unreachable!() };
        let hierarchy = built(&vec![triangle; 5000]).expect("builds");
        assert!((5000 / LEAF_TRIANGLES..5000 / 3).contains(&hierarchy.leaves.len()));
    }
}
