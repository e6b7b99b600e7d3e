//! Intersection of chords and triangles: sixteen triangles are projected along the chords, then sixteen chords are tested
//! against one triangle.

use glam::Vec3;
use photoncard_firmware::simd::{Isa, Kernel, LANES};

use super::block::Block;
use super::chords::{BATCHES, Batch, ChordFrame, Chords, Crossing, Crossings};
use super::lanes::{Lane, LaneVector, at, cross, greatest, least, minus};

/// Kernel that adds the crossings of chords with the triangles of some blocks.
pub(super) struct CrossAll<'a> {
    pub(super) blocks: &'a [Block],
    pub(super) frame: &'a ChordFrame,
    pub(super) chords: &'a Chords,
    pub(super) crossings: &'a mut Crossings,
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

/// Sixteen triangles in the coordinates of a frame, and their projections along the chords.
struct Shadows {
    corners: [LaneVector; 3],
    /// Line of each edge, `x a + y b + c`, positive inside.
    edges: [LaneVector; 3],
    /// Height of the plane, `x a + y b + c`.
    heights: LaneVector,
    slopes: Lane,
    /// 1 where the front is up, else 0.
    is_front: Lane,
    /// Infinite for triangles that no chord meets, else 0.
    steep: Lane,
    lower: [Lane; 2],
    upper: [Lane; 2],
}

/// Minimum cosine between chord and normal: chords miss steeper triangles.
const MIN_COSINE: f32 = 1e-4;

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

    /// Projects the triangles of a block. Short loops over lanes compile to few vector instructions each.
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
                // The lines of a shared edge are opposite to the last bit in its two triangles. So is the sign: both test
                // one line.
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

    /// Computes the triangles' planes.
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
            let is_steep = r * r <= MIN_COSINE * MIN_COSINE * size;
            self.steep[lane] = if is_steep { f32::INFINITY } else { 0.0 };
        }
    }

    /// Bit mask of the triangles that chords of a batch may meet.
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

    /// Bit mask of the triangles that the plane at a height cuts.
    #[inline(always)]
    fn cut(&self, isa: impl Isa, height: f32) -> u32 {
        let mut apart = [0; LANES];
        for (lane, apart) in apart.iter_mut().enumerate() {
            let [a, b, c] = [0, 1, 2].map(|corner: usize| self.corners[corner][2][lane] < height);
            *apart = if (a == b) & (b == c) { 1 } else { 0 };
        }
        isa.below(&apart, 1)
    }

    /// Adds the crossings of a batch of chords with a triangle within the ball.
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
        // Points exactly on a shared edge belong to one of its two triangles.
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

/// Cut of a triangle by the horizontal plane through the reference point: a segment from `start` to `end`, relative to that
/// point, with the front on its left.
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

    /// Changes the depth of each chord whose path from the reference point crosses the cut: +1 where it enters by the
    /// front, else -1.
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
