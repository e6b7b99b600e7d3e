//! Query of the hierarchy for triangles that may intersect a ball.

use glam::Vec3;
use photoncard_firmware::memory::Lines;
use photoncard_firmware::scene::SceneImage;
use photoncard_firmware::simd::{Isa, Kernel, LANES, run};
use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{
    BvhAxis, BvhLeaf, BvhNode, Child, Instance, LEAF_TRIANGLES, NO_INSTANCE, TriangleId, WideNode,
    placed_point,
};
use photoncard_shared::message::{Fault, FaultCode};

use super::lanes::{cross, dot, greatest, least, minus};

/// Ball around photons. The coordinates and the radius are in metres.
#[derive(Clone, Copy)]
pub(super) struct Ball {
    pub(super) centre: Vec3,
    pub(super) radius: f32,
}

/// Triangles of a leaf in the coordinates of a ball: relative to its centre, in units of its radius.
pub(super) struct LeafNearBall {
    /// Corners, indexed by corner, axis and slot.
    corners: [[[f32; LEAF_TRIANGLES]; 3]; 3],
    /// Bit mask of the triangles that have an area and whose bounding box and plane touch the unit ball.
    near: u32,
    /// Bit mask of the triangles with a coordinate above [`MAX_EXTENT`].
    large: u32,
}

/// Maximum coordinate of a corner, in radii of the ball. Above it, rounding is too coarse near the ball.
const MAX_EXTENT: f32 = 1e4;

/// A triangle that may intersect a ball, in the ball's coordinates.
pub(super) struct NearTriangle {
    pub(super) id: TriangleId,
    pub(super) corners: [Vec3; 3],
    /// True if a coordinate exceeds [`MAX_EXTENT`].
    pub(super) is_large: bool,
}

impl Ball {
    /// Returns a ball in the space of an instance's group that contains this ball, with a margin for
    /// rounding.
    fn in_group(self, instance: &Instance) -> Self {
        let rows = instance.to_group.map(|[a, b, c, _]| Vec3::new(a, b, c));
        // The Frobenius norm is at least the factor by which the transform stretches any vector.
        let stretch = rows.map(Vec3::length_squared).iter().sum::<f32>().sqrt();
        let centre = placed_point(&instance.to_group, self.centre.to_array()).into();
        let shift = instance.to_group.iter().map(|row| row[3].abs()).sum::<f32>();
        let reach = instance.reach + self.centre.abs().max_element();
        let error = 16.0 * f32::EPSILON * (2.0 * stretch * reach + shift);
        Self { centre, radius: self.radius * stretch + error }
    }
}

impl LeafNearBall {
    #[inline(always)]
    fn triangle(&self, [leaf, instance]: [u32; 2], slot: usize) -> NearTriangle {
        let [a, b, c] = &self.corners;
        let corner = |[x, y, z]: &[[f32; LEAF_TRIANGLES]; 3]| Vec3::new(x[slot], y[slot], z[slot]);
        NearTriangle {
            id: TriangleId { index: leaf.saturating_mul(LEAF_TRIANGLES as u32) + slot as u32, instance },
            corners: [corner(a), corner(b), corner(c)],
            is_large: self.large >> slot & 1 != 0,
        }
    }
}

/// Kernel that finds the triangles of a leaf that may intersect a ball.
struct NearTriangles<'a> {
    leaf: BvhLeaf<'a>,
    ball: Ball,
}

impl Kernel for NearTriangles<'_> {
    type Output = LeafNearBall;

    #[inline(always)]
    fn run(self, isa: impl Isa) -> LeafNearBall {
        let Self { leaf, ball } = self;
        let (scale, centre) = (ball.radius.recip(), ball.centre.to_array());
        let slots = leaf.all_corners();
        let mut corners = [[[0.0; LEAF_TRIANGLES]; 3]; 3];
        for axis in 0..3 {
            let mut vertices = [0.0; LANES];
            for (target, coordinate) in vertices.iter_mut().zip(leaf.coordinates(axis)) {
                *target = (coordinate - centre[axis]) * scale;
            }
            for corner in 0..3 {
                corners[corner][axis] = isa.permute(&vertices, &slots[corner]);
            }
        }
        let (mut apart, mut small) = ([1; LANES], [1; LANES]);
        for slot in 0..LEAF_TRIANGLES {
            let (is_near, is_large) = place(&corners, slot);
            apart[slot] = if is_near { 0 } else { 1 };
            small[slot] = if is_large { 0 } else { 1 };
        }
        let near = isa.below(&apart, 1) & !(u32::MAX << leaf.triangles());
        LeafNearBall { corners, near, large: isa.below(&small, 1) }
    }
}

/// Returns two flags for triangle `slot`: whether it has an area and its box and plane touch the unit ball,
/// and whether a coordinate exceeds [`MAX_EXTENT`].
#[inline(always)]
fn place([a, b, c]: &[[[f32; LEAF_TRIANGLES]; 3]; 3], slot: usize) -> (bool, bool) {
    let (mut outside, mut extent) = ([0.0; 3], 0.0);
    for axis in 0..3 {
        let [p, q, r] = [a[axis][slot], b[axis][slot], c[axis][slot]];
        let (lower, upper) = (least(least(p, q), r), greatest(greatest(p, q), r));
        outside[axis] = greatest(greatest(lower, -upper), 0.0);
        extent = greatest(extent, greatest(upper, -lower));
    }
    let corner = |corner: &[[f32; LEAF_TRIANGLES]; 3]| [corner[0][slot], corner[1][slot], corner[2][slot]];
    let a = corner(a);
    let normal = cross(minus(corner(b), a), minus(corner(c), a));
    let (size, distance) = (dot(normal, normal), dot(normal, a));
    ((dot(outside, outside) <= 1.0) & (size > 0.0) & (distance * distance <= size), extent > MAX_EXTENT)
}

/// Calls `visit` for all triangles that may intersect a ball, until a call returns false. Returns whether all
/// calls returned true.
#[inline(always)]
pub(super) fn for_each_near(
    scene: &SceneImage,
    memory: Lines,
    ball: Ball,
    stack: &mut Vec<Child>,
    visit: &mut impl FnMut(&NearTriangle) -> bool,
) -> Result<bool, Fault> {
    stack.clear();
    for_each_below((scene, memory), (0, None), ball, stack, visit)
}

/// Calls `visit` as [`for_each_near`] does, for the tree with the node `root`: the scene's tree, or with an
/// `instance` that of its group. Entries that are on `stack` already stay there.
#[inline(always)]
fn for_each_below(
    (scene, memory): (&SceneImage, Lines),
    (root, instance): (u32, Option<(u32, &Instance)>),
    ball: Ball,
    stack: &mut Vec<Child>,
    visit: &mut impl FnMut(&NearTriangle) -> bool,
) -> Result<bool, Fault> {
    let Ball { centre, radius } = instance.map_or(ball, |(_, instance)| ball.in_group(instance));
    let bottom = stack.len();
    stack.push(Child::Node(root));
    // In a sound tree each node and leaf is visited at most once; more visits mean a cycle.
    let parts = [SectionKind::Nodes, SectionKind::Triangles].map(|kind| scene.header.section(kind).records);
    let mut visits_left = u64::from(parts[0]) + u64::from(parts[1]);
    while stack.len() > bottom
        && let Some(part) = stack.pop()
    {
        let cycle = Fault { code: FaultCode::Depth, detail: 0 };
        visits_left = visits_left.checked_sub(1).ok_or(cycle)?;
        match part {
            Child::Node(node) => {
                let line = line(scene, memory, SectionKind::Nodes, node)?;
                let mut near = run(NearChildren { node: BvhNode(line), centre, radius });
                let links = WideNode(line).links();
                while near != 0 {
                    stack.push(links.child(near.trailing_zeros()));
                    near &= near - 1;
                }
            }
            Child::Leaf(leaf) => {
                let line = line(scene, memory, SectionKind::Triangles, leaf)?;
                let placed;
                let (line, index) = match (Instance::read(line), instance) {
                    (None, None) => (line, NO_INSTANCE),
                    (None, Some((index, instance))) => {
                        placed = BvhLeaf(line).placed(&instance.to_world);
                        (&placed, index)
                    }
                    (Some(_), Some(_)) => return Err(Fault { code: FaultCode::Record, detail: leaf }),
                    (Some(instance), None) => {
                        if !for_each_in_group((scene, memory), (leaf, &instance), ball, stack, visit)? {
                            return Ok(false);
                        }
                        continue;
                    }
                };
                let triangles = run(NearTriangles { leaf: BvhLeaf(line), ball });
                let mut near = triangles.near;
                while near != 0 {
                    let slot = near.trailing_zeros() as usize % LEAF_TRIANGLES;
                    near &= near - 1;
                    if !visit(&triangles.triangle([leaf, index], slot)) {
                        return Ok(false);
                    }
                }
            }
        }
    }
    Ok(true)
}

/// Calls `visit` as [`for_each_near`] does, for the triangles of one instance. `index` is that of its leaf.
#[inline(never)]
fn for_each_in_group(
    image: (&SceneImage, Lines),
    (index, instance): (u32, &Instance),
    ball: Ball,
    stack: &mut Vec<Child>,
    visit: &mut dyn FnMut(&NearTriangle) -> bool,
) -> Result<bool, Fault> {
    let group = (instance.root, Some((index, instance)));
    for_each_below(image, group, ball, stack, &mut |triangle| visit(triangle))
}

/// Reads line `index` of a section.
pub(super) fn line<'a>(
    scene: &SceneImage,
    memory: Lines<'a>,
    kind: SectionKind,
    index: u32,
) -> Result<&'a [u8; LINE_BYTES], Fault> {
    let fault = Fault { code: FaultCode::Record, detail: index };
    let (address, _) = scene.header.section(kind).locate::<1>(index).ok_or(fault)?;
    memory.0.get(address.0 as usize).map(|line| &line.0).ok_or(fault)
}

/// Kernel that finds the children of a node whose boxes may intersect a ball, as a bit mask.
struct NearChildren<'a> {
    node: BvhNode<'a>,
    centre: Vec3,
    radius: f32,
}

impl Kernel for NearChildren<'_> {
    type Output = u32;

    #[inline(always)]
    fn run(self, isa: impl Isa) -> u32 {
        let Self { node, centre, radius } = self;
        let [x, y, z] = node.axes();
        let [p, q, r] = centre.to_array();
        // Stored boxes are enlarged by more than the rounding error of this test.
        let limit = (radius * radius).to_bits();
        let mut distances = [0; LANES];
        for (lane, distance) in distances.iter_mut().enumerate() {
            let outside = |axis: &BvhAxis, place: f32| {
                let below = axis.corner + axis.unit * f32::from(axis.lower[lane]) - place;
                let above = place - (axis.corner + axis.unit * f32::from(axis.upper[lane]));
                let outside = if below > above { below } else { above };
                if outside > 0.0 { outside } else { 0.0 }
            };
            let [x, y, z] = [outside(&x, p), outside(&y, q), outside(&z, r)];
            *distance = (x * x + y * y + z * z).to_bits();
        }
        isa.below(&distances, limit.saturating_add(1)) & !(u32::MAX << WideNode(node.0).children())
    }
}
