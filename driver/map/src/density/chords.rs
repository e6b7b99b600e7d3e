//! Parallel chords of a ball.
//!
//! The area of a surface is its projected area divided by the cosine between the normals, `A = A_p / cos`.
//! Evenly spread chords measure it. Each chord represents an equal part of the disc perpendicular to the
//! chords, and each crossing with a surface represents this part divided by the cosine.

use glam::Vec3;
use photoncard_firmware::simd::LANES;

use super::lanes::Lane;

/// Maximum number of batches of sixteen chords.
pub(super) const BATCHES: usize = 12;
/// Number of batches in a ball of many triangles, where each chord crosses many surfaces.
const FEW_BATCHES: usize = 4;

/// Sixteen neighbouring chords: their points in the disc perpendicular to them, and the bounds of these
/// points.
#[derive(Clone, Copy)]
pub(super) struct Batch {
    pub(super) x: Lane,
    pub(super) y: Lane,
    /// Squared distances from the centre of the disc.
    pub(super) squares: Lane,
    pub(super) lower: [f32; 2],
    pub(super) upper: [f32; 2],
}

impl Batch {
    fn new(points: &[[f32; 2]]) -> Self {
        let axis = |axis: usize| std::array::from_fn(|lane| points[lane][axis]);
        let bound = |choose: fn(f32, f32) -> f32| {
            [0, 1].map(|axis| points.iter().map(|point| point[axis]).reduce(choose).unwrap_or(0.0))
        };
        let (x, y) = (axis(0), axis(1));
        Self { x, y, squares: squares(&x, &y), lower: bound(f32::min), upper: bound(f32::max) }
    }

    /// Returns the batch with all coordinates multiplied by `factor`.
    fn scaled(&self, factor: f32) -> Self {
        let [x, y] = [self.x, self.y].map(|axis| axis.map(|coordinate| coordinate * factor));
        Self {
            x,
            y,
            squares: squares(&x, &y),
            lower: self.lower.map(|bound| bound * factor),
            upper: self.upper.map(|bound| bound * factor),
        }
    }
}

fn squares(x: &Lane, y: &Lane) -> Lane {
    std::array::from_fn(|lane| x[lane] * x[lane] + y[lane] * y[lane])
}

/// Chords that are spread evenly over a disc.
pub(super) struct Chords {
    pub(super) batches: heapless::Vec<Batch, BATCHES>,
}

impl Chords {
    /// Chords over a disc of radius 1.
    pub(super) fn many() -> Self {
        Self::new(BATCHES)
    }

    /// Chords over a disc of radius 1, for a ball of many triangles.
    pub(super) fn few() -> Self {
        Self::new(FEW_BATCHES)
    }

    /// Chords over a disc of radius 1, by the sunflower spiral (Vogel 1979). Each chord represents an equal
    /// part of the disc's area.
    fn new(batches: usize) -> Self {
        let chords = batches * LANES;
        let mut points: Vec<[f32; 2]> = (0..chords)
            .map(|index| {
                let distance = ((index as f32 + 0.5) / chords as f32).sqrt();
                let angle = index as f32 * 2.399_963_2;
                [distance * libm::cosf(angle), distance * libm::sinf(angle)]
            })
            .collect();
        gather_neighbors(&mut points, 0);
        let (batches, _) = points.as_chunks::<LANES>();
        Self { batches: batches.iter().map(|points| Batch::new(points)).collect() }
    }

    pub(super) fn number(&self) -> usize {
        self.batches.len() * LANES
    }

    /// Chords over a disc of radius `radius`.
    pub(super) fn scaled(&self, radius: f32) -> Self {
        Self { batches: self.batches.iter().map(|batch| batch.scaled(radius)).collect() }
    }

    /// Point of chord `index` in the disc.
    pub(super) fn point(&self, index: usize) -> [f32; 2] {
        let Batch { x, y, .. } = &self.batches[index / LANES];
        [x[index % LANES], y[index % LANES]]
    }
}

/// Coordinate frame of parallel chords, with a reference point outside all solids. Its coordinates are
/// relative to a ball's centre, in radii of the ball.
pub(super) struct ChordFrame {
    /// Orthonormal axes: two perpendicular to the chords, and the surface normal, to which the chords are
    /// parallel.
    pub(super) axes: [Vec3; 3],
    /// Reference point outside all solids, in coordinates along the axes.
    pub(super) open: Vec3,
}

impl ChordFrame {
    /// Returns the components of `place`, a vector from the ball's centre, along the axes.
    pub(super) fn along(&self, place: Vec3) -> Vec3 {
        let [x, y, z] = self.axes.map(|axis| axis.dot(place));
        Vec3::new(x, y, z)
    }
}

/// Sorts points such that every run of sixteen consists of neighbours.
fn gather_neighbors(points: &mut [[f32; 2]], axis: usize) {
    if points.len() > LANES {
        points.sort_by(|a, b| a[axis].total_cmp(&b[axis]));
        let (below, above) = points.split_at_mut(points.len() / 2);
        gather_neighbors(below, 1 - axis);
        gather_neighbors(above, 1 - axis);
    }
}
