//! Random numbers as functions of (seed, pixel, sample, dimension). They do not depend on chip, thread or
//! order of execution.
//!
//! Positions in a pixel, on a lens and on emitters, and the first choices of an eye path are points of a
//! sequence: the first two dimensions of Sobol' (1967) with Owen's (1995) nested uniform scrambling. Any
//! number of its first points is stratified, so that samples can be added to a picture. The order of the
//! points is scrambled in the same way, so that patterns of different dimensions are independent (Burley
//! 2020, *Practical hash-based Owen scrambling*). It is a (0, 2)-sequence: each aligned run of 2^m points has
//! one point in every elementary interval of area 2^-m.
//!
//! The direction of a final gather ray is chosen by two coordinates. The first is jittered
//! ([`Pattern::jitter`]) and selects a cell of the direction table ([`crate::importance::DirectionTable`]);
//! the second is a radical inverse. Any run of consecutive rays, such as those of one cell, is stratified in
//! both.

pub use photoncard_shared::hash::hash;

/// Purpose of a random number: the dimension of a [`Pattern`]. Patterns of different dimensions are
/// independent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Dimension {
    /// Position in the pixel.
    Pixel = 1,
    /// Choice of the light of a shadow ray, and of a point on the light.
    Emitter = 2,
    /// Directions of a sample's final gather rays.
    Gather = 3,
    /// Directions of an irradiance record's final gather rays.
    Irradiance = 4,
    /// Directions of the rays that measure the distances to the surroundings of an irradiance record.
    Survey = 5,
    /// Random choices on an eye path: of a material layer, and at perfectly specular surfaces between
    /// reflection, transmission and the end of the path.
    Specular = 6,
    /// Direction of the ray that finds albedo and normal of a surface reflected in a sharp lobe.
    Features = 7,
    /// Position on a thin lens.
    Lens = 8,
}

/// Source of random points and numbers for one pixel, sample and dimension.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pattern(u32);

impl Pattern {
    /// Creates the pattern of a pixel, sample and dimension. `sample` is 0 if all samples of a pixel share
    /// the pattern.
    #[inline(always)]
    pub fn new(seed: u32, x: u32, y: u32, sample: u32, dimension: Dimension) -> Self {
        let pixel = hash(hash(seed ^ 0x9e37_79b9).wrapping_add(x)).wrapping_add(y);
        Self(hash(hash(hash(pixel).wrapping_add(sample)).wrapping_add(dimension as u32)))
    }

    /// Random bits for dithering at point `index`. They are independent of the point's coordinates.
    #[inline(always)]
    pub fn dither(self, index: u32) -> u32 {
        self.bits(index, 0x2545_f491)
    }

    /// Random number in [0, 1) for choice number `choice` on the path that starts at point `index`.
    #[inline(always)]
    pub fn choice(self, index: u32, choice: u32) -> f32 {
        unit_interval(hash(self.bits(index, 0x1656_67b1).wrapping_add(choice)))
    }

    /// Pattern of the path that goes on from the end of point `index`.
    #[inline(always)]
    pub fn of_continuations(self, index: u32) -> Self {
        Self(hash(self.bits(index, 0x3c6e_f372)))
    }

    /// Random bits that determine the position of point `index` within its stratum of [0, 1).
    #[inline(always)]
    pub fn jitter(self, index: u32) -> u32 {
        self.bits(index, 0x967a_889b)
    }

    /// Base-2 radical inverse of `index`, in [0, 1), with XOR scrambling. Each aligned run of 2^m indices has
    /// one point in every stratum of width 2^-m.
    #[inline(always)]
    pub fn radical_inverse(self, index: u32) -> f32 {
        unit_interval(index.reverse_bits() ^ hash(self.0.wrapping_add(0x368c_c8b7)))
    }

    #[inline(always)]
    fn bits(self, index: u32, salt: u32) -> u32 {
        hash(self.0.wrapping_add(salt) ^ index.wrapping_mul(0x9e37_79b9))
    }

    /// Point `index` of the scrambled Sobol' sequence, in [0, 1) x [0, 1).
    #[inline(always)]
    pub fn point(self, index: u32) -> [f32; 2] {
        let seed = |salt: u32| hash(self.0.wrapping_add(salt));
        let index = scramble(index.reverse_bits(), seed(0x7a3d_95e7)).reverse_bits();
        let x = scramble(index, seed(0x5163_3e2d)).reverse_bits();
        let y = scramble(second_dimension(index), seed(0x68bc_21eb)).reverse_bits();
        [unit_interval(x), unit_interval(y)]
    }
}

/// Binary digits of Sobol's second dimension at `index`, least significant bit first. Bit `i` is the sum
/// modulo 2 of those bits `j` of `index` for which the binomial coefficient `C(j, i)` is odd. By Lucas's
/// theorem this holds if `j & i == i`.
#[inline(always)]
fn second_dimension(index: u32) -> u32 {
    let steps = [(1, 0x5555_5555), (2, 0x3333_3333), (4, 0x0f0f_0f0f), (8, 0x00ff_00ff), (16, 0x0000_ffff)];
    steps.into_iter().fold(index, |digits, (distance, mask)| digits ^ (digits >> distance & mask))
}

/// Owen scrambling of binary digits, least significant bit first: a bijection in which each bit of the result
/// depends only on the same and lower bits (Laine, Karras 2011, with Vegdahl's constants of 2021).
#[inline(always)]
fn scramble(mut digits: u32, seed: u32) -> u32 {
    digits ^= digits.wrapping_mul(0x3d20_adea);
    digits = digits.wrapping_add(seed);
    digits = digits.wrapping_mul(seed >> 16 | 1);
    digits ^= digits.wrapping_mul(0x0552_6c56);
    digits ^ digits.wrapping_mul(0x53a2_2864)
}

/// Base-2 radical inverse of `index`, in [0, 1) (van der Corput 1935).
#[inline(always)]
pub fn radical_inverse(index: u32) -> f32 {
    unit_interval(index.reverse_bits())
}

/// Converts the 24 upper bits to a number in [0, 1), in steps of 2^-24.
#[inline(always)]
pub(crate) fn unit_interval(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
}

#[cfg(test)]
mod tests {
    use std::vec;

    use super::*;

    #[test]
    fn every_aligned_run_has_a_point_in_each_box_of_its_area() {
        for seed in 0..20 {
            let pattern = Pattern::new(seed, 3, 4, 5, Dimension::Emitter);
            for size in 0..8 {
                for run in 0..5_u32 {
                    for columns in 0..=size {
                        let mut boxes = vec![false; 1 << size];
                        for index in run << size..(run + 1) << size {
                            let [x, y] = pattern.point(index);
                            assert!((0.0..1.0).contains(&x) && (0.0..1.0).contains(&y));
                            let column = (x * (1 << columns) as f32) as usize;
                            let row = (y * (1 << (size - columns)) as f32) as usize;
                            let met = &mut boxes[row << columns | column];
                            assert!(!*met, "{seed} {size} {run} {columns}");
                            *met = true;
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn the_mean_over_pixels_of_any_points_is_uniform() {
        for count in [1, 2, 3, 7, 16, 100] {
            let mut moments = [0.0_f64; 4];
            for x in 0..2000 {
                for index in 0..count {
                    let [u, v] = Pattern::new(9, x, 1, 0, Dimension::Pixel).point(index);
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

    /// Tests points of equal index in two dimensions. Their halves of [0, 1) must be paired at random: each
    /// of the four pairs must occur in a fourth of the pixels.
    #[test]
    fn patterns_of_two_dimensions_are_independent() {
        let half = |x, index, dimension| {
            let [u, v] = Pattern::new(5, x, 7, 0, dimension).point(index);
            [u >= 0.5, v >= 0.5]
        };
        for (index, first, second) in [(0, 0, 0), (1, 0, 1), (5, 1, 1)] {
            let mut pairs = [0; 4];
            for x in 0..4000 {
                let one = half(x, index, Dimension::Pixel)[first];
                let other = half(x, index, Dimension::Emitter)[second];
                pairs[2 * usize::from(one) + usize::from(other)] += 1;
            }
            assert!(pairs.iter().all(|pairs| (850..1150).contains(pairs)), "{pairs:?}");
        }
    }
}
