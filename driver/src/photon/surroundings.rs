//! The triangles around a place: what short rays there may meet, found once for all of them.
//!
//! A descent in the hierarchy for every ray would visit the same few leaves again and again. Here one descent finds all
//! triangles in a ball; then sixteen of them are tested for one ray, or sixteen rays that start at one point for one of them.
//! Coordinates are relative to the ball's centre and in units of its radius.

use glam::Vec3;
use photoncard_firmware::memory::Lines;
use photoncard_firmware::scene::SceneImage;
use photoncard_firmware::simd::{Isa, Kernel, LANES, run};
use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{BvhAxis, BvhLeaf, BvhNode, Child, LEAF_TRIANGLES, WideNode};
use photoncard_shared::message::{Fault, FaultCode};

/// Triangles that are tested one by one for every ray; of more, a descent for each ray finds the few that matter.
const MOST_TRIANGLES: usize = 1024;
/// Coordinates of corners beyond this, in radii, would round away what is near.
const MOST_EXTENT: f32 = 1e4;

type Lane = [f32; LANES];
type LaneVector = [Lane; 3];

/// Sixteen triangles. Of what is no triangle the corners coincide: nothing meets it.
struct Block {
    corners: [LaneVector; 3],
    /// Unit normals of the fronts.
    normals: LaneVector,
}

/// The triangles in a ball.
#[derive(Default)]
pub(super) struct Surroundings {
    blocks: Vec<Block>,
    triangles: usize,
    centre: Vec3,
    radius: f32,
    stack: Vec<Child>,
}

impl Surroundings {
    /// Finds the triangles in a ball. Returns whether all of them could be taken: if not, nothing may be asked.
    ///
    /// # Errors
    /// If the image is not sound.
    pub(super) fn find(
        &mut self,
        scene: &SceneImage,
        memory: Lines,
        centre: Vec3,
        radius: f32,
    ) -> Result<bool, Fault> {
        self.blocks.clear();
        self.triangles = 0;
        (self.centre, self.radius) = (centre, radius);
        self.stack.clear();
        self.stack.push(Child::Node(0));
        // A part of a sound tree is visited once.
        let parts =
            [SectionKind::Nodes, SectionKind::Triangles].map(|kind| scene.header.section(kind).records);
        let mut visits_left = u64::from(parts[0]) + u64::from(parts[1]);
        while let Some(part) = self.stack.pop() {
            let cycle = Fault { code: FaultCode::Depth, detail: 0 };
            visits_left = visits_left.checked_sub(1).ok_or(cycle)?;
            match part {
                Child::Node(node) => {
                    let line = line(scene, memory, SectionKind::Nodes, node)?;
                    let mut near = run(NearChildren { node: BvhNode(line), centre, radius });
                    let links = WideNode(line).links();
                    while near != 0 {
                        self.stack.push(links.child(near.trailing_zeros()));
                        near &= near - 1;
                    }
                }
                Child::Leaf(leaf) => {
                    let line = line(scene, memory, SectionKind::Triangles, leaf)?;
                    if !self.add_leaf(BvhLeaf(line)) {
                        return Ok(false);
                    }
                }
            }
        }
        Ok(true)
    }

    /// Adds the triangles of a leaf that are near. Returns whether there is room, and they are not too large.
    fn add_leaf(&mut self, leaf: BvhLeaf) -> bool {
        let first = leaf.triangle(0);
        for slot in 0..LEAF_TRIANGLES {
            let triangle = leaf.triangle(slot);
            // A leaf that is not full repeats its first.
            if slot > 0 && triangle == first {
                continue;
            }
            let corners = triangle.vertices.map(|corner| (Vec3::from(corner) - self.centre) / self.radius);
            let [a, b, c] = corners;
            let normal = (b - a).cross(c - a).normalize_or_zero();
            let (lower, upper) = (a.min(b).min(c), a.max(b).max(c));
            let outside = lower.max(-upper).max(Vec3::ZERO);
            if normal == Vec3::ZERO || outside.length_squared() > 1.0 || normal.dot(a).abs() > 1.0 {
                continue;
            }
            if self.triangles == MOST_TRIANGLES || lower.abs().max(upper.abs()).max_element() > MOST_EXTENT {
                return false;
            }
            let lane = self.triangles % LANES;
            if lane == 0 {
                self.blocks.push(Block { corners: Default::default(), normals: Default::default() });
            }
            self.triangles += 1;
            if let Some(block) = self.blocks.last_mut() {
                for (lanes, corner) in block.corners.iter_mut().zip(corners) {
                    set(lanes, lane, corner);
                }
                set(&mut block.normals, lane, normal);
            }
        }
        true
    }

    /// The first triangle on the way from a place along a unit vector: its distance, if it is not beyond `max_distance`, and
    /// its unit normal on the side that the ray comes from; metres.
    pub(super) fn first_on_way(
        &self,
        origin: Vec3,
        direction: Vec3,
        max_distance: f32,
    ) -> Option<(f32, Vec3)> {
        let origin = (origin - self.centre) / self.radius;
        let (distance, normal) = run(FirstOnWay { blocks: &self.blocks, origin, direction })?;
        let distance = distance * self.radius;
        (distance <= max_distance)
            .then_some((distance, if normal.dot(direction) > 0.0 { -normal } else { normal }))
    }

    /// Of points on a disc, those that are surface, seen from a place above.
    pub(super) fn visible_points<const N: usize>(&self, disc: &DiscView, points: &[PointLanes; N]) -> u32 {
        let relative = |place: Vec3| (place - self.centre) / self.radius;
        let disc = DiscView {
            centre: relative(disc.centre),
            above: relative(disc.above),
            radius: disc.radius / self.radius,
            reach: disc.reach / self.radius,
            ..*disc
        };
        run(VisiblePoints { blocks: &self.blocks, disc: &disc, points })
    }
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

fn set(lanes: &mut LaneVector, lane: usize, vector: Vec3) {
    for (lanes, component) in lanes.iter_mut().zip(vector.to_array()) {
        lanes[lane] = component;
    }
}

/// A disc, and from where it is looked at.
#[derive(Clone, Copy)]
pub(super) struct DiscView {
    /// Its centre.
    pub(super) centre: Vec3,
    /// Its unit normal.
    pub(super) normal: Vec3,
    /// Its radius.
    pub(super) radius: f32,
    /// From where it is looked at.
    pub(super) above: Vec3,
    /// The distance from the centre up to which a point is still of the disc.
    pub(super) reach: f32,
    /// The least cosine of a point's normal to the disc's.
    pub(super) least_cosine: f32,
}

/// Sixteen points of a disc of radius 1.
pub(super) type PointLanes = [Lane; 2];

/// A bit for every child of a node that may be in a ball.
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
        // Boxes are larger than what they hold by more than this rounds.
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

#[inline(always)]
fn at(vector: &LaneVector, lane: usize) -> [f32; 3] {
    [vector[0][lane], vector[1][lane], vector[2][lane]]
}

#[inline(always)]
fn minus([a, b, c]: [f32; 3], [x, y, z]: [f32; 3]) -> [f32; 3] {
    [a - x, b - y, c - z]
}

#[inline(always)]
fn dot([a, b, c]: [f32; 3], [x, y, z]: [f32; 3]) -> f32 {
    a * x + b * y + c * z
}

#[inline(always)]
fn cross([a, b, c]: [f32; 3], [x, y, z]: [f32; 3]) -> [f32; 3] {
    [b * z - c * y, c * x - a * z, a * y - b * x]
}

#[inline(always)]
fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn greatest(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// A triangle as seen from a point: the planes through the point and its edges, and six times the volume of both.
///
/// Of two triangles that share an edge the planes are opposite to the last bit: no ray passes between them.
#[inline(always)]
fn seen_from(point: [f32; 3], block: &Block, lane: usize) -> ([[f32; 3]; 3], f32) {
    let corner = |corner: usize| minus(at(&block.corners[corner], lane), point);
    let [a, b, c] = [corner(0), corner(1), corner(2)];
    let planes = [cross(b, c), cross(c, a), cross(a, b)];
    (planes, dot(a, planes[0]))
}

struct FirstOnWay<'a> {
    blocks: &'a [Block],
    origin: Vec3,
    direction: Vec3,
}

impl Kernel for FirstOnWay<'_> {
    type Output = Option<(f32, Vec3)>;

    #[inline(always)]
    fn run(self, _: impl Isa) -> Self::Output {
        let (origin, direction) = (self.origin.to_array(), self.direction.to_array());
        let mut first = (f32::INFINITY, Vec3::ZERO);
        for block in self.blocks {
            let mut distances = [0.0; LANES];
            for (lane, target) in distances.iter_mut().enumerate() {
                let ([u, v, w], volume) = seen_from(origin, block, lane);
                let [u, v, w] = [dot(u, direction), dot(v, direction), dot(w, direction)];
                let determinant = u + v + w;
                let is_met = (least(least(u, v), w) >= 0.0) | (greatest(greatest(u, v), w) <= 0.0);
                let distance = volume / determinant;
                *target =
                    if is_met & (determinant != 0.0) & (distance > 0.0) { distance } else { f32::INFINITY };
            }
            for (lane, &distance) in distances.iter().enumerate() {
                if distance < first.0 {
                    first = (distance, Vec3::from(at(&block.normals, lane)));
                }
            }
        }
        first.0.is_finite().then_some(first)
    }
}

struct VisiblePoints<'a, const N: usize> {
    blocks: &'a [Block],
    disc: &'a DiscView,
    points: &'a [PointLanes; N],
}

/// Sixteen triangles as seen from a point.
struct SeenBlock {
    planes: [LaneVector; 3],
    volumes: Lane,
    /// 1 where a point on the triangle is of the disc's surface, else 0.
    is_surface: Lane,
}

/// Sixteen rays that start at one point.
struct Rays {
    ways: LaneVector,
    /// The nearest triangle so far, in parts of the way: a quotient.
    nearest: [Lane; 2],
    is_surface: Lane,
}

impl<const N: usize> Kernel for VisiblePoints<'_, N> {
    type Output = u32;

    #[inline(always)]
    fn run(self, isa: impl Isa) -> u32 {
        let Self { blocks, disc, points } = self;
        let mut rays: [Rays; N] = std::array::from_fn(|batch| Rays::new(disc, &points[batch]));
        let mut seen = SeenBlock::NONE;
        for block in blocks {
            let mut near = seen.look(isa, block, disc);
            while near != 0 {
                let triangle = near.trailing_zeros() as usize;
                near &= near - 1;
                for rays in &mut rays {
                    rays.test(&seen, triangle);
                }
            }
        }
        rays.iter().map(|rays| rays.count(isa, disc)).sum()
    }
}

impl SeenBlock {
    const NONE: Self =
        Self { planes: [[[0.0; LANES]; 3]; 3], volumes: [0.0; LANES], is_surface: [0.0; LANES] };

    /// Looks at some triangles. Returns a bit for each that may hide a point of the disc or be there.
    #[inline(always)]
    fn look(&mut self, isa: impl Isa, block: &Block, disc: &DiscView) -> u32 {
        let (above, normal, centre) = (disc.above.to_array(), disc.normal.to_array(), disc.centre.to_array());
        let mut distances = [0; LANES];
        for lane in 0..LANES {
            let (planes, volume) = seen_from(above, block, lane);
            for (all, plane) in self.planes.iter_mut().zip(planes) {
                for (all, component) in all.iter_mut().zip(plane) {
                    all[lane] = component;
                }
            }
            self.volumes[lane] = volume;
            // A ray that meets the front goes against the normal.
            let cosine = dot(at(&block.normals, lane), normal);
            let cosine = if volume < 0.0 { cosine } else { -cosine };
            self.is_surface[lane] = if cosine >= disc.least_cosine { 1.0 } else { 0.0 };
            // What is before a point that counts is as near to the centre.
            let outside = |axis: usize| {
                let [a, b, c] =
                    [0, 1, 2].map(|corner: usize| block.corners[corner][axis][lane] - centre[axis]);
                greatest(greatest(least(least(a, b), c), -greatest(greatest(a, b), c)), 0.0)
            };
            let [x, y, z] = [outside(0), outside(1), outside(2)];
            // What is no triangle has no volume with anything.
            let distance = (x * x + y * y + z * z).to_bits();
            distances[lane] = if volume == 0.0 { u32::MAX } else { distance };
        }
        isa.below(&distances, (disc.reach * disc.reach).to_bits().saturating_add(1))
    }
}

impl Rays {
    /// Through points of a disc, as far again below it as from above: a curved surface falls away from it.
    #[inline(always)]
    fn new(disc: &DiscView, points: &PointLanes) -> Self {
        let (tangent, bitangent) = disc.normal.any_orthonormal_pair();
        let [tangent, bitangent] = [tangent, bitangent].map(|way| (way * disc.radius).to_array());
        let start = (disc.centre - disc.above).to_array();
        let mut ways = [[0.0; LANES]; 3];
        for (axis, ways) in ways.iter_mut().enumerate() {
            for (lane, way) in ways.iter_mut().enumerate() {
                *way = start[axis] + tangent[axis] * points[0][lane] + bitangent[axis] * points[1][lane];
            }
        }
        Self { ways, nearest: [[2.0; LANES], [1.0; LANES]], is_surface: [0.0; LANES] }
    }

    /// Tests one triangle for all rays.
    #[inline(always)]
    fn test(&mut self, seen: &SeenBlock, triangle: usize) {
        let [a, b, c] =
            [at(&seen.planes[0], triangle), at(&seen.planes[1], triangle), at(&seen.planes[2], triangle)];
        let (volume, is_surface) = (seen.volumes[triangle], seen.is_surface[triangle]);
        let size = volume.abs();
        for lane in 0..LANES {
            let way = at(&self.ways, lane);
            let [u, v, w] = [dot(a, way), dot(b, way), dot(c, way)];
            let determinant = u + v + w;
            let divisor = determinant.abs();
            let is_met = (least(least(u, v), w) >= 0.0) | (greatest(greatest(u, v), w) <= 0.0);
            let is_nearer = size * self.nearest[1][lane] < self.nearest[0][lane] * divisor;
            let is_first = is_met & is_nearer & (volume * determinant > 0.0);
            self.nearest[0][lane] = if is_first { size } else { self.nearest[0][lane] };
            self.nearest[1][lane] = if is_first { divisor } else { self.nearest[1][lane] };
            self.is_surface[lane] = if is_first { is_surface } else { self.is_surface[lane] };
        }
    }

    /// The rays that end on the disc's surface.
    #[inline(always)]
    fn count(&self, isa: impl Isa, disc: &DiscView) -> u32 {
        let above = (disc.above - disc.centre).to_array();
        let reach = disc.reach * disc.reach;
        let mut misses = [0; LANES];
        for (lane, misses) in misses.iter_mut().enumerate() {
            let part = self.nearest[0][lane] / self.nearest[1][lane];
            let [x, y, z] = at(&self.ways, lane);
            let [a, b, c] = above;
            let end = [a + x * part, b + y * part, c + z * part];
            let is_surface = (self.is_surface[lane] != 0.0) & (dot(end, end) <= reach);
            *misses = if is_surface { 0 } else { 1 };
        }
        isa.below(&misses, 1).count_ones()
    }
}
