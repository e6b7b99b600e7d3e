//! The triangles around a place: what chords and short rays there may meet, found once for all of them.
//!
//! A descent in the hierarchy for every ray would visit the same few leaves again and again. Here one descent finds all
//! triangles in a ball; then sixteen of them are tested for one ray, or sixteen chords for one of them. Coordinates are
//! relative to the ball's centre and in units of its radius.

use glam::Vec3;
use photoncard_firmware::memory::Lines;
use photoncard_firmware::scene::SceneImage;
use photoncard_firmware::simd::{Isa, Kernel, LANES, run};
use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{BvhAxis, BvhLeaf, BvhNode, Child, LEAF_TRIANGLES, VERTEX_LANES, WideNode};
use photoncard_shared::message::{Fault, FaultCode};

use super::chords::{BATCHES, Batch, Chords, Crossing, Crossings, Lane};
use super::sides::SideTable;

/// Triangles that are tested one by one; of more, a descent for each ray finds the few that matter.
const MOST_TRIANGLES: usize = 4096;
/// Coordinates of corners beyond this, in radii, would round away what is near.
const MOST_EXTENT: f32 = 1e4;
/// Triangles of a plain wall within a ball, at the most.
const MOST_PLAIN: usize = 24;
/// Triangles of a plane have normals that differ by less: to a thousandth of the radius at its end.
const LEAST_PLAIN_COSINE: f32 = 1.0 - 5e-7;

type LaneVector = [Lane; 3];

/// Sixteen triangles. Of what is no triangle the corners coincide: nothing meets it.
struct Block {
    corners: [LaneVector; 3],
    /// Indices in the image.
    indices: [u32; LANES],
    /// A bit for each whose back is the inside of something.
    are_solid: u32,
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

/// A ball to look into, metres.
#[derive(Clone, Copy)]
pub(super) struct Ball {
    pub(super) centre: Vec3,
    pub(super) radius: f32,
}

impl Ball {
    /// The vertices of a leaf in its coordinates.
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

/// Whether a triangle may be within 1 of the origin, and has an area.
#[inline(always)]
fn is_near(corners: &[Vec3; 3]) -> bool {
    let [a, b, c] = *corners;
    let (lower, upper) = (a.min(b).min(c), a.max(b).max(c));
    let outside = lower.max(-upper).max(Vec3::ZERO);
    let normal = (b - a).cross(c - a);
    let (size, distance) = (normal.length_squared(), normal.dot(a));
    outside.length_squared() <= 1.0 && size > 0.0 && distance * distance <= size
}

/// A frame along a normal, and a point that is inside of nothing; coordinates are those of a ball.
pub(super) struct ChordFrame {
    /// Two axes across the chords, and the normal along them.
    pub(super) axes: [Vec3; 3],
    /// The open point, along these axes.
    pub(super) open: Vec3,
}

impl ChordFrame {
    /// What is at a place relative to the ball's centre, along the axes.
    pub(super) fn along(&self, place: Vec3) -> Vec3 {
        let [x, y, z] = self.axes.map(|axis| axis.dot(place));
        Vec3::new(x, y, z)
    }
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
        sides: &SideTable,
        ball: Ball,
    ) -> Result<bool, Fault> {
        self.blocks.clear();
        self.triangles = 0;
        (self.centre, self.radius) = (ball.centre, ball.radius);
        let mut stack = std::mem::take(&mut self.stack);
        let all = for_each_near(scene, memory, ball, &mut stack, &mut |index, corners| {
            self.add(index, corners, sides)
        });
        self.stack = stack;
        all
    }

    /// Whether all triangles in a ball are one plain wall around its centre, on the side of a normal's code. Asks for nothing
    /// but the place for a stack: what is here stays.
    ///
    /// # Errors
    /// If the image is not sound.
    pub(super) fn is_plain(
        &mut self,
        scene: &SceneImage,
        memory: Lines,
        sides: &SideTable,
        ball: Ball,
        wall: PlainWall,
    ) -> Result<bool, Fault> {
        let lift = wall.lift / ball.radius;
        let mut triangles = heapless::Vec::<[Vec3; 3], MOST_PLAIN>::new();
        let mut plane: Option<Vec3> = None;
        let mut stack = std::mem::take(&mut self.stack);
        let is_plane = for_each_near(scene, memory, ball, &mut stack, &mut |index, corners| {
            let [a, b, c] = *corners;
            let normal = (b - a).cross(c - a).normalize_or_zero();
            let is_along = normal.dot(*plane.get_or_insert(normal)) >= LEAST_PLAIN_COSINE;
            let is_at = normal.dot(a).abs() <= lift;
            let is_side = sides.of(index).normal(true) == Some(wall.normal);
            is_along && is_at && is_side && triangles.push(*corners).is_ok()
        });
        self.stack = stack;
        let Some(normal) = plane.filter(|_| is_plane == Ok(true)) else { return is_plane.map(|_| false) };
        Ok(wall.holds(ball, normal) && covers(&triangles, normal))
    }

    /// Adds a triangle. Returns whether there is room, and it is not too large.
    #[inline(always)]
    fn add(&mut self, index: u32, corners: &[Vec3; 3], sides: &SideTable) -> bool {
        let extent = corners.iter().map(|corner| corner.abs().max_element()).fold(0.0, f32::max);
        if self.triangles == MOST_TRIANGLES || extent > MOST_EXTENT {
            return false;
        }
        let lane = self.triangles % LANES;
        if lane == 0 {
            self.blocks.push(Block { corners: Default::default(), indices: [0; LANES], are_solid: 0 });
        }
        self.triangles += 1;
        if let Some(block) = self.blocks.last_mut() {
            for (lanes, corner) in block.corners.iter_mut().zip(corners) {
                set(lanes, lane, *corner);
            }
            block.indices[lane] = index;
            block.are_solid |= u32::from(sides.of(index).is_solid) << lane;
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
        let (distance, [a, b, c]) = run(FirstOnWay { blocks: &self.blocks, origin, direction })?;
        let distance = distance * self.radius;
        let normal = (b - a).cross(c - a).normalize_or_zero();
        (distance <= max_distance)
            .then_some((distance, if normal.dot(direction) > 0.0 { -normal } else { normal }))
    }

    /// What chords pass through within the ball.
    pub(super) fn cross(&self, frame: &ChordFrame, chords: &Chords, crossings: &mut Crossings) {
        crossings.clear(frame.open.z);
        run(CrossAll { blocks: &self.blocks, frame, chords, crossings });
    }
}

/// A place on a wall that may be plain.
#[derive(Clone, Copy)]
pub(super) struct PlainWall<'a> {
    /// The code of its normal.
    pub(super) normal: u8,
    /// What photons may be off the wall by, metres.
    pub(super) lift: f32,
    /// Other places on it.
    pub(super) places: &'a [Vec3],
}

impl PlainWall<'_> {
    /// Whether all places are in the plane.
    fn holds(&self, ball: Ball, normal: Vec3) -> bool {
        self.places.iter().all(|place| (*place - ball.centre).dot(normal).abs() <= self.lift)
    }
}

/// Whether triangles of one plane cover the disc of radius 1 around the origin once: one of them covers the origin, and no
/// edge in the disc is without another triangle beyond it.
fn covers(triangles: &[[Vec3; 3]], normal: Vec3) -> bool {
    let edges = |[a, b, c]: [Vec3; 3]| [(a, b), (b, c), (c, a)];
    let is_left = |(a, b): (Vec3, Vec3)| (b - a).cross(-a).dot(normal) >= 0.0;
    let at_origin = triangles.iter().filter(|triangle| edges(**triangle).into_iter().all(is_left));
    let all_edges = || triangles.iter().flat_map(|triangle| edges(*triangle));
    let is_far = |(a, b): (Vec3, Vec3)| {
        let way = b - a;
        let part = (-a.dot(way) / way.length_squared()).clamp(0.0, 1.0);
        (a + way * part).length_squared() > 1.0
    };
    at_origin.count() == 1
        && all_edges().all(|(a, b)| is_far((a, b)) || all_edges().filter(|edge| *edge == (b, a)).count() == 1)
}

/// Visits all triangles that may be in a ball, with their index in the image and their corners in its coordinates, until one
/// is not wanted. Returns whether all were.
#[inline(always)]
fn for_each_near(
    scene: &SceneImage,
    memory: Lines,
    ball: Ball,
    stack: &mut Vec<Child>,
    visit: &mut impl FnMut(u32, &[Vec3; 3]) -> bool,
) -> Result<bool, Fault> {
    let Ball { centre, radius } = ball;
    stack.clear();
    stack.push(Child::Node(0));
    // A part of a sound tree is visited once.
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

fn set(lanes: &mut LaneVector, lane: usize, vector: Vec3) {
    for (lanes, component) in lanes.iter_mut().zip(vector.to_array()) {
        lanes[lane] = component;
    }
}

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
    /// The distance, and the triangle's corners.
    type Output = Option<(f32, [Vec3; 3])>;

    #[inline(always)]
    fn run(self, _: impl Isa) -> Self::Output {
        let (origin, direction) = (self.origin.to_array(), self.direction.to_array());
        let mut first = (f32::INFINITY, [Vec3::ZERO; 3]);
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
                    first = (distance, block.corners.each_ref().map(|corner| Vec3::from(at(corner, lane))));
                }
            }
        }
        first.0.is_finite().then_some(first)
    }
}

struct CrossAll<'a> {
    blocks: &'a [Block],
    frame: &'a ChordFrame,
    chords: &'a Chords,
    crossings: &'a mut Crossings,
}

impl Kernel for CrossAll<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self, isa: impl Isa) {
        let Self { blocks, frame, chords, crossings } = self;
        let mut shadows = Shadows::NONE;
        for block in blocks {
            shadows.cast(block, frame);
            for (number, batch) in chords.batches.iter().enumerate() {
                let mut near = shadows.near(isa, batch);
                while near != 0 {
                    let triangle = near.trailing_zeros() as usize;
                    near &= near - 1;
                    shadows.cross(isa, triangle, block.indices[triangle], (number, batch), crossings);
                }
            }
            let mut cut = shadows.cut(isa, frame.open.z) & block.are_solid;
            while cut != 0 {
                let triangle = cut.trailing_zeros() as usize;
                cut &= cut - 1;
                let corners = shadows.corners.each_ref().map(|corner| Vec3::from(at(corner, triangle)));
                if let Some(cut) = Cut::new(corners, frame.open) {
                    cut.count(chords, frame.open, &mut crossings.depths);
                }
            }
        }
    }
}

/// Sixteen triangles along the axes of a frame, and their shadows across the chords.
struct Shadows {
    corners: [LaneVector; 3],
    /// Of each edge the line `x a + y b + c`, positive inside.
    edges: [LaneVector; 3],
    /// The height `x a + y b + c`.
    heights: LaneVector,
    slopes: Lane,
    /// 1 where the front is up, else 0.
    is_front: Lane,
    /// Infinite for what is met by no chord, else 0.
    steep: Lane,
    lower: [Lane; 2],
    upper: [Lane; 2],
}

/// Triangles that chords pass at a cosine below this are met by none.
const LEAST_COSINE: f32 = 1e-4;

impl Shadows {
    const NONE: Self = Self {
        corners: [[[0.0; LANES]; 3]; 3],
        edges: [[[0.0; LANES]; 3]; 3],
        heights: [[0.0; LANES]; 3],
        slopes: [0.0; LANES],
        is_front: [0.0; LANES],
        steep: [0.0; LANES],
        lower: [[0.0; LANES]; 2],
        upper: [[0.0; LANES]; 2],
    };

    /// Short loops over lanes, each of which becomes a few vector instructions.
    #[inline(always)]
    fn cast(&mut self, block: &Block, frame: &ChordFrame) {
        for corner in 0..3 {
            let [x, y, z] = &block.corners[corner];
            for (axis, direction) in frame.axes.iter().enumerate() {
                let [a, b, c] = direction.to_array();
                let target = &mut self.corners[corner][axis];
                for lane in 0..LANES {
                    target[lane] = a * x[lane] + b * y[lane] + c * z[lane];
                }
            }
        }
        self.cast_planes();
        for edge in 0..3 {
            let ([x, y, _], [p, q, _]) = (&self.corners[edge], &self.corners[(edge + 1) % 3]);
            let [a, b, c] = &mut self.edges[edge];
            for lane in 0..LANES {
                // Opposite to the last bit for the two triangles of an edge, and so is the sign: the same lines.
                let sign = if self.is_front[lane] != 0.0 { 1.0 } else { -1.0 };
                a[lane] = (y[lane] - q[lane]) * sign;
                b[lane] = (p[lane] - x[lane]) * sign;
                c[lane] = (x[lane] * q[lane] - y[lane] * p[lane]) * sign;
            }
        }
        for axis in 0..2 {
            let [a, b, c] = [0, 1, 2].map(|corner: usize| &self.corners[corner][axis]);
            let (lower, upper) = (&mut self.lower[axis], &mut self.upper[axis]);
            for lane in 0..LANES {
                lower[lane] = least(least(a[lane], b[lane]), c[lane]) + self.steep[lane];
                upper[lane] = greatest(greatest(a[lane], b[lane]), c[lane]);
            }
        }
    }

    /// The triangles' planes.
    #[inline(always)]
    fn cast_planes(&mut self) {
        let [a, b, c] = &self.corners;
        let [x, y, z] = &mut self.heights;
        for lane in 0..LANES {
            let a = at(a, lane);
            let (u, v) = (minus(at(b, lane), a), minus(at(c, lane), a));
            let [p, q, r] = cross(u, v);
            let size = p * p + q * q + r * r;
            (x[lane], y[lane]) = (-p / r, -q / r);
            z[lane] = a[2] + (a[0] * p + a[1] * q) / r;
            self.slopes[lane] = size.sqrt() / r.abs();
            self.is_front[lane] = if r > 0.0 { 1.0 } else { 0.0 };
            let is_steep = r * r <= LEAST_COSINE * LEAST_COSINE * size;
            self.steep[lane] = if is_steep { f32::INFINITY } else { 0.0 };
        }
    }

    /// A bit for each triangle that chords of a batch may meet.
    #[inline(always)]
    fn near(&self, isa: impl Isa, batch: &Batch) -> u32 {
        let mut apart = [0; LANES];
        for (lane, apart) in apart.iter_mut().enumerate() {
            let is_apart = |axis: usize| {
                (self.lower[axis][lane] > batch.upper[axis]) | (self.upper[axis][lane] < batch.lower[axis])
            };
            *apart = if is_apart(0) | is_apart(1) { 1 } else { 0 };
        }
        isa.below(&apart, 1)
    }

    /// A bit for each triangle that the plane at a height cuts.
    #[inline(always)]
    fn cut(&self, isa: impl Isa, height: f32) -> u32 {
        let mut apart = [0; LANES];
        for (lane, apart) in apart.iter_mut().enumerate() {
            let [a, b, c] = [0, 1, 2].map(|corner: usize| self.corners[corner][2][lane] < height);
            *apart = if (a == b) & (b == c) { 1 } else { 0 };
        }
        isa.below(&apart, 1)
    }

    /// Where the chords of a batch pass through a triangle within the ball.
    #[inline(always)]
    fn cross(
        &self,
        isa: impl Isa,
        triangle: usize,
        index: u32,
        (number, batch): (usize, &Batch),
        crossings: &mut Crossings,
    ) {
        let edges = [0, 1, 2].map(|edge: usize| at(&self.edges[edge], triangle));
        // Of two triangles that share an edge, one has the points on it.
        let bounds = edges.map(|[a, b, _]| {
            let has_points = (a > 0.0) | ((a == 0.0) & (b > 0.0));
            if has_points { -f32::MIN_POSITIVE } else { 0.0 }
        });
        let [a, b, c] = at(&self.heights, triangle);
        let mut heights = [0.0; LANES];
        let mut misses = [0; LANES];
        for lane in 0..LANES {
            let (x, y) = (batch.x[lane], batch.y[lane]);
            let beyond =
                |edge: usize| x * edges[edge][0] + y * edges[edge][1] + edges[edge][2] > bounds[edge];
            let height = x * a + y * b + c;
            heights[lane] = height;
            let is_near = x * x + y * y + height * height <= 1.0;
            misses[lane] = if beyond(0) & beyond(1) & beyond(2) & is_near { 0 } else { 1 };
        }
        let mut met = isa.below(&misses, 1);
        while met != 0 {
            let lane = met.trailing_zeros() as usize;
            met &= met - 1;
            let (is_front, slope) = (self.is_front[triangle] != 0.0, self.slopes[triangle]);
            crossings.list.push(Crossing::new(number * LANES + lane, heights[lane], is_front, index, slope));
        }
    }
}

/// Where the plane at the height of an open point cuts a triangle: a line from `start` to `end`, relative to that point, with
/// the front on its left.
struct Cut {
    start: [f32; 2],
    end: [f32; 2],
}

impl Cut {
    #[inline(always)]
    fn new(corners: [Vec3; 3], open: Vec3) -> Option<Self> {
        let [a, b, c] = corners.map(|corner| corner - open);
        let (mut start, mut end) = (None, None);
        for (from, to) in [(a, b), (b, c), (c, a)] {
            if (from.z < 0.0) == (to.z < 0.0) {
                continue;
            }
            let part = from.z / (from.z - to.z);
            let place = [from.x + (to.x - from.x) * part, from.y + (to.y - from.y) * part];
            *if from.z < 0.0 { &mut start } else { &mut end } = Some(place);
        }
        Some(Self { start: start?, end: end? })
    }

    /// Counts it for each chord whose way from the open point crosses it: one more where it enters by the front.
    #[inline(always)]
    fn count(&self, chords: &Chords, open: Vec3, depths: &mut [[i32; LANES]; BATCHES]) {
        let ([a, b], [c, d]) = (self.start, self.end);
        let at_open = a * d - b * c;
        let change = if at_open > 0.0 { 1 } else { -1 };
        for (batch, depths) in chords.batches.iter().zip(depths) {
            for (lane, depth) in depths.iter_mut().enumerate() {
                let (x, y) = (batch.x[lane] - open.x, batch.y[lane] - open.y);
                let (start, end) = (x * b - y * a, x * d - y * c);
                let at_chord = start - end + at_open;
                let is_between = (start >= 0.0) != (end >= 0.0);
                let is_beyond = (at_chord > 0.0) != (at_open > 0.0);
                *depth += if is_between & is_beyond { change } else { 0 };
            }
        }
    }
}
