//! Query of the hierarchy for the triangles that may intersect a ball.

use glam::Vec3;
use photoncard_firmware::memory::Lines;
use photoncard_firmware::scene::SceneImage;
use photoncard_firmware::simd::{Isa, Kernel, LANES, run};
use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{BvhAxis, BvhLeaf, BvhNode, Child, LEAF_TRIANGLES, VERTEX_LANES, WideNode};
use photoncard_shared::message::{Fault, FaultCode};

/// Ball around photons, metres.
#[derive(Clone, Copy)]
pub(super) struct Ball {
    pub(super) centre: Vec3,
    pub(super) radius: f32,
}

impl Ball {
    /// Vertices of a leaf in the ball's coordinates: relative to its centre, in units of its radius.
    #[inline(always)]
    fn vertices(&self, leaf: &BvhLeaf) -> [Vec3; VERTEX_LANES] {
        let scale = self.radius.recip();
        let centre = self.centre.to_array();
        let [x, y, z] = [0, 1, 2].map(|axis: usize| {
            let mut coordinates = leaf.coordinates(axis);
            for coordinate in &mut coordinates {
                *coordinate = (*coordinate - centre[axis]) * scale;
            }
            coordinates
        });
        std::array::from_fn(|vertex| Vec3::new(x[vertex], y[vertex], z[vertex]))
    }
}

/// True if the triangle has an area, and its bounding box and its plane are within distance 1 of the origin.
#[inline(always)]
fn is_near(corners: &[Vec3; 3]) -> bool {
    let [a, b, c] = *corners;
    let (lower, upper) = (a.min(b).min(c), a.max(b).max(c));
    let outside = lower.max(-upper).max(Vec3::ZERO);
    let normal = (b - a).cross(c - a);
    let (size, distance) = (normal.length_squared(), normal.dot(a));
    outside.length_squared() <= 1.0 && size > 0.0 && distance * distance <= size
}

/// Calls `visit(index, corners)` for all triangles that may intersect a ball, until one call returns false. `index` is the
/// triangle's index in the image; corners are in the ball's coordinates. Returns whether all calls returned true.
#[inline(always)]
pub(super) fn for_each_near(
    scene: &SceneImage,
    memory: Lines,
    ball: Ball,
    stack: &mut Vec<Child>,
    visit: &mut impl FnMut(u32, &[Vec3; 3]) -> bool,
) -> Result<bool, Fault> {
    let Ball { centre, radius } = ball;
    stack.clear();
    stack.push(Child::Node(0));
    // In a sound tree each part is visited at most once; more visits mean a cycle.
    let parts = [SectionKind::Nodes, SectionKind::Triangles].map(|kind| scene.header.section(kind).records);
    let mut visits_left = u64::from(parts[0]) + u64::from(parts[1]);
    while let Some(part) = stack.pop() {
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
                let line = BvhLeaf(line(scene, memory, SectionKind::Triangles, leaf)?);
                let vertices = ball.vertices(&line);
                for slot in 0..line.triangles() {
                    let corners = line.vertices_of(slot as usize).map(|vertex| vertices[vertex]);
                    let index = leaf.saturating_mul(LEAF_TRIANGLES as u32) + slot;
                    if is_near(&corners) && !visit(index, &corners) {
                        return Ok(false);
                    }
                }
            }
        }
    }
    Ok(true)
}

fn line<'a>(
    scene: &SceneImage,
    memory: Lines<'a>,
    kind: SectionKind,
    index: u32,
) -> Result<&'a [u8; LINE_BYTES], Fault> {
    let fault = Fault { code: FaultCode::Record, detail: index };
    let (address, _) = scene.header.section(kind).locate::<1>(index).ok_or(fault)?;
    memory.0.get(address.0 as usize).map(|line| &line.0).ok_or(fault)
}

/// Bit mask of the children of a node whose boxes may intersect a ball.
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
