//! Random numbers from (seed, pixel, sample, dimension): never from a chip, a thread or what came before.
//!
//! Points in a pixel and on emitters are correlated multi-jittered (Kensler 2013, *Correlated multi-jittered sampling*):
//! `count` points of the square in as many cells of equal area, in about sqrt(count) rows, and stratified within rows
//! and columns. Kensler's grid is rectangular; here the rows of a count that is not a product hold one cell more or
//! less, which keeps every cell's area, and so the expectation, exact.
//!
//! Final gather rays take points along a line ([`Pattern::jitter`]), which their table divides
//! ([`crate::importance::DirectionTable`]), and across it a radical inverse: any run of neighbours, as fall in one cell
//! of the table, is stratified both ways.

/// What a random number is for. Each purpose has a pattern of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Dimension {
    /// The place in the pixel.
    Pixel = 1,
    /// The point on an emitter.
    Emitter = 2,
    /// The directions of final gather rays.
    Gather = 3,
    /// The directions of the gather rays of an irradiance record.
    Irradiance = 4,
    /// The directions of the rays that survey an irradiance record's surroundings.
    Survey = 5,
    /// Which way an eye ray goes on at perfectly specular surfaces.
    Specular = 6,
}

/// A pattern of points for one pixel, sample and dimension.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pattern(u32);

impl Pattern {
    /// The pattern of a purpose at a pixel, for one sample; patterns that spread over all samples take sample 0.
    #[inline(always)]
    pub fn new(seed: u32, x: u32, y: u32, sample: u32, dimension: Dimension) -> Self {
        let pixel = hash(hash(seed ^ 0x9e37_79b9).wrapping_add(x)).wrapping_add(y);
        Self(hash(hash(hash(pixel).wrapping_add(sample)).wrapping_add(dimension as u32)))
    }

    /// Random bits that belong to a point, independent of its place.
    #[inline(always)]
    pub fn dither(self, index: u32) -> u32 {
        self.bits(index, 0x2545_f491)
    }

    /// A random number in [0, 1) for a choice of the path that begins with point `index`.
    #[inline(always)]
    pub fn choice(self, index: u32, choice: u32) -> f32 {
        unit_interval(hash(self.bits(index, 0x1656_67b1).wrapping_add(choice)))
    }

    /// Random bits for the place of a point in its stratum of a line.
    #[inline(always)]
    pub fn jitter(self, index: u32) -> u32 {
        self.bits(index, 0x967a_889b)
    }

    /// The radical inverse of `index`, in [0, 1), its digits flipped at random: over the indices it is uniform, and any
    /// 2^m neighbouring ones from a multiple of 2^m on lie in different 2^m-ths.
    #[inline(always)]
    pub fn radical_inverse(self, index: u32) -> f32 {
        unit_interval(index.reverse_bits() ^ hash(self.0.wrapping_add(0x368c_c8b7)))
    }

    #[inline(always)]
    fn bits(self, index: u32, salt: u32) -> u32 {
        hash(self.0.wrapping_add(salt) ^ index.wrapping_mul(0x9e37_79b9))
    }

    /// Which of `count * samples` points is point `index` of a sample's `count`: each sample has one point of every run of
    /// `samples` neighbours, chosen anew from run to run, and all samples together have every point once. With one sample
    /// it is `index`.
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

/// The cell of one point: a row of the square as high as its share of the points, cut into equal columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Cell {
    /// Rows of the whole square.
    rows: u32,
    row: u32,
    /// Columns of this row.
    columns: u32,
    column: u32,
    /// Points in the rows before.
    first: u32,
}

impl Cell {
    /// The cell of point `index` of `count`.
    #[inline(always)]
    fn new(index: u32, count: u32) -> Self {
        let count = count.max(1);
        let rows = (libm::sqrtf(count as f32) as u32).max(1);
        // Row r holds the points from floor(r count / rows) on.
        let row = (index * rows + rows - 1) / count;
        let first = row * count / rows;
        let columns = ((row + 1) * count / rows - first).max(1);
        Self { rows, row, columns, column: index - first, first }
    }
}

/// The image of `index` under a permutation of `0..length` that `key` chooses.
///
/// A bijection of the next power of two, walked until it falls below `length`, then rotated.
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

/// A hash of 32 bits with good avalanche (Wellons, `lowbias32`).
#[inline(always)]
pub fn hash(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// The radical inverse of `index` in base two, in [0, 1) (van der Corput 1935).
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
