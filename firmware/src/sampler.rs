//! Random numbers as functions of (seed, pixel, sample, dimension), independent of chip, thread and order of execution.
//!
//! Points in a pixel and on emitters are correlated multi-jittered (Kensler 2013, *Correlated multi-jittered
//! sampling*): `count` points of the unit square in as many cells of equal area, in about sqrt(count) rows, stratified
//! in both dimensions. Kensler's grid is rectangular; here, if `count` is no multiple of the number of rows, some rows
//! have one cell more, so that all cells have equal area and the expectation is exact.
//!
//! The two coordinates of a final gather ray are a jittered one ([`Pattern::jitter`]), which selects a cell of the
//! direction table ([`crate::importance::DirectionTable`]), and a radical inverse: any run of consecutive rays, such as
//! those of one cell of the table, is stratified in both.

/// Dimension of a random number: its purpose. Patterns of different dimensions are independent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Dimension {
    /// Position in the pixel.
    Pixel = 1,
    /// Light, and point on it, of a shadow ray.
    Emitter = 2,
    /// Directions of a sample's final gather rays.
    Gather = 3,
    /// Directions of an irradiance record's final gather rays.
    Irradiance = 4,
    /// Directions of an irradiance record's survey rays.
    Survey = 5,
    /// Choice between reflection, transmission and absorption at perfectly specular surfaces on an eye path.
    Specular = 6,
}

/// Random pattern of points of one pixel, sample and dimension.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pattern(u32);

impl Pattern {
    /// The pattern of a pixel, sample and dimension; a pattern shared by all samples of a pixel has sample 0.
    #[inline(always)]
    pub fn new(seed: u32, x: u32, y: u32, sample: u32, dimension: Dimension) -> Self {
        let pixel = hash(hash(seed ^ 0x9e37_79b9).wrapping_add(x)).wrapping_add(y);
        Self(hash(hash(hash(pixel).wrapping_add(sample)).wrapping_add(dimension as u32)))
    }

    /// Random bits of point `index`, independent of its coordinates.
    #[inline(always)]
    pub fn dither(self, index: u32) -> u32 {
        self.bits(index, 0x2545_f491)
    }

    /// Random number in [0, 1) for the choice of this number on the path that starts with point `index`.
    #[inline(always)]
    pub fn choice(self, index: u32, choice: u32) -> f32 {
        unit_interval(hash(self.bits(index, 0x1656_67b1).wrapping_add(choice)))
    }

    /// Random bits for the position of point `index` in its stratum of [0, 1).
    #[inline(always)]
    pub fn jitter(self, index: u32) -> u32 {
        self.bits(index, 0x967a_889b)
    }

    /// Base-2 radical inverse of `index`, in [0, 1), with randomly flipped digits (XOR scrambling). Each aligned run of
    /// 2^m indices has one point in every stratum of width 2^-m.
    #[inline(always)]
    pub fn radical_inverse(self, index: u32) -> f32 {
        unit_interval(index.reverse_bits() ^ hash(self.0.wrapping_add(0x368c_c8b7)))
    }

    #[inline(always)]
    fn bits(self, index: u32, salt: u32) -> u32 {
        hash(self.0.wrapping_add(salt) ^ index.wrapping_mul(0x9e37_79b9))
    }

    /// Index, among the `count * samples` points of a pixel, of point `index` of `count` of one sample. Each sample
    /// takes one point from every run of `samples` consecutive points, by a random permutation of each run, so that all
    /// samples together take every point once; `index` itself with one sample.
    #[inline(always)]
    pub fn index_in_all(self, index: u32, sample: u32, samples: u32) -> u32 {
        let samples = samples.max(1);
        index * samples + permute(sample, samples, self.bits(index, 0x7a3d_95e7))
    }

    /// Point `index` of `count`, in [0, 1) x [0, 1); `index` below `count`, `count` at most 2^20.
    #[inline(always)]
    pub fn point(self, index: u32, count: u32) -> [f32; 2] {
        let cell = Cell::new(index, count);
        let sub_column = permute(cell.row, cell.rows, self.0 ^ 0x5163_3e2d);
        let sub_row = permute(cell.column, cell.columns, self.0 ^ 0x68bc_21eb);
        let jitter = |salt: u32| unit_interval(self.bits(index, salt));
        let x_in_cell = (sub_column as f32 + jitter(0x967a_889b)) / cell.rows as f32;
        let x = (cell.column as f32 + x_in_cell) / cell.columns as f32;
        let y = ((cell.first + sub_row) as f32 + jitter(0x368c_c8b7)) / count as f32;
        [below_one(x), below_one(y)]
    }
}

/// Cell of one point: the square is divided into rows of a height in proportion to their points, each row into equal
/// columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Cell {
    /// Number of rows of the square.
    rows: u32,
    row: u32,
    /// Number of columns of this row.
    columns: u32,
    column: u32,
    /// Number of points in the rows before.
    first: u32,
}

impl Cell {
    /// The cell of point `index` of `count`.
    #[inline(always)]
    fn new(index: u32, count: u32) -> Self {
        let count = count.max(1);
        let rows = (libm::sqrtf(count as f32) as u32).max(1);
        // The first point of row r is floor(r count / rows).
        let row = (index * rows + rows - 1) / count;
        let first = row * count / rows;
        let columns = ((row + 1) * count / rows - first).max(1);
        Self { rows, row, columns, column: index - first, first }
    }
}

/// Image of `index` under the permutation of `0..length` with this key.
///
/// Cycle walking: a bijection on the next power of two is iterated until the image is below `length`; then it is
/// rotated.
#[inline(always)]
fn permute(index: u32, length: u32, key: u32) -> u32 {
    let mask = length.next_power_of_two() - 1;
    let shift = mask.count_ones() / 2 + 1;
    let [a, b] = [hash(key), hash(key ^ 0xa3d8_5c1f)];
    let mut image = index;
    loop {
        image = ((image ^ a) & mask).wrapping_mul(b | 1) & mask;
        image ^= image >> shift;
        image = image.wrapping_mul(a | 1) & mask;
        image ^= image >> shift;
        if image < length {
            return (image + key % length) % length;
        }
    }
}

/// 32-bit integer hash (Wellons, `lowbias32`).
#[inline(always)]
pub fn hash(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// Base-2 radical inverse of `index`, in [0, 1) (van der Corput 1935).
#[inline(always)]
pub fn radical_inverse(index: u32) -> f32 {
    unit_interval(index.reverse_bits())
}

/// The 24 upper bits as a number in [0, 1).
#[inline(always)]
pub(crate) fn unit_interval(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
}

#[inline(always)]
fn below_one(x: f32) -> f32 {
    crate::vector::min(x, 0.999_999_94)
}

#[cfg(test)]
mod tests {
    use std::vec;

    use super::*;

    const COUNTS: [u32; 9] = [1, 2, 3, 7, 8, 16, 100, 200, 211];

    #[test]
    fn points_are_stratified_in_columns_of_y_and_stay_in_the_square() {
        for count in COUNTS {
            for seed in 0..20 {
                let pattern = Pattern::new(seed, 3, 4, 5, Dimension::Gather);
                let mut rows = [false; 256];
                for index in 0..count {
                    let [x, y] = pattern.point(index, count);
                    assert!((0.0..1.0).contains(&x) && (0.0..1.0).contains(&y));
                    let row = &mut rows[(y * count as f32) as usize];
                    assert!(!*row, "{count} {index}");
                    *row = true;
                }
            }
        }
    }

    #[test]
    fn a_point_of_one_index_is_in_the_same_cell_for_every_pixel() {
        for count in COUNTS {
            for index in 0..count {
                let cell = Cell::new(index, count);
                for x in 0..10 {
                    let [u, v] = Pattern::new(0, x, 0, 0, Dimension::Gather).point(index, count);
                    assert_eq!((u * cell.columns as f32) as u32, cell.column);
                    let v = v * count as f32;
                    assert!(v >= cell.first as f32 && v < (cell.first + cell.columns) as f32);
                }
            }
        }
    }

    #[test]
    fn the_mean_over_pixels_of_any_point_set_is_uniform() {
        for count in COUNTS {
            let mut moments = [0.0_f64; 4];
            for x in 0..2000 {
                for index in 0..count {
                    let [u, v] = Pattern::new(9, x, 1, 0, Dimension::Gather).point(index, count);
                    let [u, v] = [u as f64 - 0.5, v as f64 - 0.5];
                    for (moment, value) in moments.iter_mut().zip([u, v, u * v, u * u]) {
                        *moment += value / (2000.0 * count as f64);
                    }
                }
            }
            let [u, v, uv, uu] = moments;
            let bound = 0.03;
            assert!(u.abs() < bound && v.abs() < bound && uv.abs() < bound, "{count} {moments:?}");
            assert!((uu - 1.0 / 12.0).abs() < 0.01, "{count} {moments:?}");
        }
    }

    #[test]
    fn the_samples_of_a_pixel_share_its_points() {
        for (count, samples) in [(1, 16), (3, 5), (8, 1), (64, 4)] {
            let pattern = Pattern::new(7, 1, 2, 0, Dimension::Emitter);
            let mut takers = vec![None; (count * samples) as usize];
            for sample in 0..samples {
                for index in 0..count {
                    let point = pattern.index_in_all(index, sample, samples);
                    assert_eq!(point / samples, index, "one of each run");
                    assert_eq!(takers[point as usize].replace(sample), None);
                }
            }
            assert!(takers.iter().all(Option::is_some));
        }
        let first = |index| Pattern::new(7, 1, 2, 0, Dimension::Emitter).index_in_all(index, 0, 16) % 16;
        assert!((1..64).any(|index| first(index) != first(0)), "the runs are not taken alike");
    }

    #[test]
    fn permutations_are_permutations() {
        for length in 1..70 {
            for key in 0..50 {
                let mut seen = [false; 70];
                (0..length).for_each(|i| seen[permute(i, length, key) as usize] = true);
                assert!(seen[..length as usize].iter().all(|&s| s));
            }
        }
    }
}
