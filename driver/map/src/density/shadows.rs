//! Intersection of chords and triangles. Sixteen triangles at a time are projected along the chords; then
//! sixteen chords at a time are tested against one triangle.

use glam::Vec3;
use photoncard_firmware::simd::{Isa, Kernel, LANES};

use super::block::Block;
use super::chords::{BATCHES, Batch, ChordFrame, Chords};
use super::crossings::{Crossings, Layer};
use super::lanes::{Lane, LaneVector, at, greatest, least};

/// Kernel that adds the crossings of the chords with the triangles of `blocks`, and the changes of the
/// chords' depths, to `crossings`.
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
            for (batch, layers) in chords.batches.iter().zip(&mut crossings.layers) {
                let mut near = shadows.near(isa, batch);
                while near != 0 {
                    let triangle = near.trailing_zeros() as usize % LANES;
                    near &= near - 1;
                    let (heights, misses) = shadows.cross(triangle, batch);
                    if isa.below(&misses, 1) != 0 {
                        let is_front = shadows.is_front[triangle] != 0.0;
                        let Some(id) = block.triangles[triangle] else { continue };
                        let face = (id, block.sides_of(triangle, id), is_front);
                        layers.push(Layer::new((&heights, &misses), face, shadows.slopes[triangle]));
                    }
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
    /// Coefficients `[a, b, c]` of the line of each edge: `a x + b y + c` is positive inside.
    edges: [LaneVector; 3],
    /// Value that the line equation of each edge exceeds for points inside. It assigns points exactly on a
    /// shared edge to one of its two triangles.
    bounds: [Lane; 3],
    /// Coefficients `[a, b, c]` of each plane: its height at `(x, y)` is `a x + b y + c`.
    heights: LaneVector,
    slopes: Lane,
    /// 1 if the front faces up, else 0.
    is_front: Lane,
    /// Infinite for triangles that are too steep for chords (`MIN_COSINE`), else 0.
    steep: Lane,
    lower: [Lane; 2],
    upper: [Lane; 2],
}

/// Minimum cosine between chord and normal. Chords miss steeper triangles.
const MIN_COSINE: f32 = 1e-4;

impl Shadows {
    const NONE: Self = Self {
        corners: [[[0.0; LANES]; 3]; 3],
        edges: [[[0.0; LANES]; 3]; 3],
        bounds: [[0.0; LANES]; 3],
        heights: [[0.0; LANES]; 3],
        slopes: [0.0; LANES],
        is_front: [0.0; LANES],
        steep: [0.0; LANES],
        lower: [[0.0; LANES]; 2],
        upper: [[0.0; LANES]; 2],
    };

    /// Projects the triangles of a block. Short loops over lanes compile to few vector instructions.
    #[inline(always)]
    fn cast(&mut self, block: &Block, frame: &ChordFrame) {
        for corner in 0..3 {
            for axis in 0..3 {
                self.corners[corner][axis] = along(frame.axes[axis].to_array(), &block.corners[corner]);
            }
        }
        self.cast_planes();
        for edge in 0..3 {
            let ([x, y, _], [p, q, _]) = (&self.corners[edge], &self.corners[(edge + 1) % 3]);
            let [a, b, c] = &mut self.edges[edge];
            for lane in 0..LANES {
                // For the two triangles of a shared edge, these coefficients are exactly equal except for the
                // sign. Both triangles therefore test the same line.
                let sign = if self.is_front[lane] != 0.0 { 1.0 } else { -1.0 };
                a[lane] = (y[lane] - q[lane]) * sign;
                b[lane] = (p[lane] - x[lane]) * sign;
                c[lane] = (x[lane] * q[lane] - y[lane] * p[lane]) * sign;
            }
            let bounds = &mut self.bounds[edge];
            for lane in 0..LANES {
                let has_points = (a[lane] > 0.0) | ((a[lane] == 0.0) & (b[lane] > 0.0));
                bounds[lane] = if has_points { -f32::MIN_POSITIVE } else { 0.0 };
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

    #[inline(always)]
    fn cast_planes(&mut self) {
        let [a, b, c] = &self.corners;
        let mut normals = [[0.0; LANES]; 3];
        for (axis, normal) in normals.iter_mut().enumerate() {
            let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
            for (lane, normal) in normal.iter_mut().enumerate() {
                let (p, q) = (b[i][lane] - a[i][lane], b[j][lane] - a[j][lane]);
                let (r, s) = (c[i][lane] - a[i][lane], c[j][lane] - a[j][lane]);
                *normal = p * s - q * r;
            }
        }
        let [x, y, z] = &mut self.heights;
        for lane in 0..LANES {
            let (p, q, r) = (normals[0][lane], normals[1][lane], normals[2][lane]);
            let size = p * p + q * q + r * r;
            (x[lane], y[lane]) = (-p / r, -q / r);
            z[lane] = a[2][lane] + (a[0][lane] * p + a[1][lane] * q) / r;
            self.slopes[lane] = size.sqrt() / r.abs();
            self.is_front[lane] = if r > 0.0 { 1.0 } else { 0.0 };
            let is_steep = r * r <= MIN_COSINE * MIN_COSINE * size;
            self.steep[lane] = if is_steep { f32::INFINITY } else { 0.0 };
        }
    }

    /// Bit mask of the triangles that chords of a batch may hit.
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

    /// Bit mask of the triangles that the horizontal plane at `height` cuts.
    #[inline(always)]
    fn cut(&self, isa: impl Isa, height: f32) -> u32 {
        let mut apart = [0; LANES];
        for (lane, apart) in apart.iter_mut().enumerate() {
            let [a, b, c] = [0, 1, 2].map(|corner: usize| self.corners[corner][2][lane] < height);
            *apart = if (a == b) & (b == c) { 1 } else { 0 };
        }
        isa.below(&apart, 1)
    }

    /// Returns two values for each chord of a batch: the height at which it hits the plane of a triangle, and
    /// 0 if it hits the triangle within the ball, else 1.
    #[inline(always)]
    fn cross(&self, triangle: usize, batch: &Batch) -> (Lane, [u32; LANES]) {
        let edges = [0, 1, 2].map(|edge: usize| at(&self.edges[edge], triangle));
        let bounds = at(&self.bounds, triangle);
        let [a, b, c] = at(&self.heights, triangle);
        let mut heights = [0.0; LANES];
        let mut misses = [0; LANES];
        for lane in 0..LANES {
            let (x, y) = (batch.x[lane], batch.y[lane]);
            let beyond =
                |edge: usize| x * edges[edge][0] + y * edges[edge][1] + edges[edge][2] > bounds[edge];
            let height = x * a + y * b + c;
            heights[lane] = height;
            let is_near = batch.squares[lane] + height * height <= 1.0;
            misses[lane] = if beyond(0) & beyond(1) & beyond(2) & is_near { 0 } else { 1 };
        }
        (heights, misses)
    }
}

/// Components of sixteen vectors along a direction. Each product has a loop of its own, because compilers
/// vectorise such loops.
#[inline(always)]
fn along([a, b, c]: [f32; 3], [x, y, z]: &LaneVector) -> Lane {
    let mut sum = [0.0; LANES];
    for lane in 0..LANES {
        sum[lane] = a * x[lane];
    }
    for lane in 0..LANES {
        sum[lane] += b * y[lane];
    }
    for lane in 0..LANES {
        sum[lane] += c * z[lane];
    }
    sum
}

/// Segment from `start` to `end` in which the horizontal plane through the reference point cuts a triangle.
/// Coordinates are relative to this point. The front of the triangle is on the segment's left.
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

    /// Changes the depth of each chord whose path from the reference point crosses the segment: by +1 if it
    /// crosses from the front, else by -1.
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
