//! Fixed-point sums: their results do not depend on the order of the terms, bit for bit.
//!
//! A term is rounded to a multiple of 2^-40 units and added as an integer. Integer addition is associative,
//! unlike floating-point addition. The unit is a power of two near the largest term; the host chooses it for
//! each scene.

use fixed::types::I24F40;
use glam::Vec3;
use photoncard_shared::layout::Rgbe;

/// Number of steps of a sum per unit, 2^40. A power of two, so that products with it are exact in `f32`.
const SCALE: f32 = (1_u64 << 40) as f32;

/// Fixed-point sum of numbers, exact except for the rounding of each term.
///
/// The range is -2^23 to 2^23 units; [`Self::add`] wraps around beyond it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sum(I24F40);

impl Sum {
    /// Sum without terms.
    pub const ZERO: Self = Self(I24F40::ZERO);

    /// Adds a term, in units, after rounding it towards zero to a multiple of 2^-40. NaN counts as 0; a term
    /// out of range is clamped.
    #[inline(always)]
    pub fn add(&mut self, term: f32) {
        self.add_bits((term * SCALE) as i64);
    }

    /// Adds a non-negative term, in units; the sum saturates. The result does not depend on the order of the
    /// terms, because a sum that only grows saturates in every order or in none.
    #[inline(always)]
    fn add_up_to_greatest(&mut self, term: f32) {
        let bits = ((term * SCALE) as i64).max(0);
        self.0 = self.0.saturating_add(I24F40::from_bits(bits));
    }

    #[inline(always)]
    fn add_bits(&mut self, bits: i64) {
        self.0 = self.0.wrapping_add(I24F40::from_bits(bits));
    }

    /// Value of the sum, in units.
    #[inline(always)]
    pub fn value(self) -> f32 {
        self.0.to_bits() as f32 * (1.0 / SCALE)
    }
}

/// Fixed-point sum of colours, exact except for the rounding of each term.
///
/// Each component is a [`Sum`]. The reflected power of k photons of one unit each is far below the limit of
/// 2^23 units, since the factors of a reflection are at most a few thousand.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ColourSum([Sum; 3]);

impl ColourSum {
    /// Sum without terms.
    pub const ZERO: Self = Self([Sum::ZERO; 3]);

    /// Adds a colour, in units, by [`Sum::add`].
    #[inline(always)]
    pub fn add(&mut self, term: Vec3) {
        for (sum, component) in self.0.iter_mut().zip(term.to_array()) {
            sum.add(component);
        }
    }

    /// Adds a colour with non-negative components, in units. Each component saturates at 2^23 units.
    #[inline(always)]
    pub fn add_light(&mut self, light: Vec3) {
        for (sum, component) in self.0.iter_mut().zip(light.to_array()) {
            sum.add_up_to_greatest(component);
        }
    }

    /// Adds a sum of non-negative terms; saturates. The result equals a single sum of all terms.
    #[inline(always)]
    pub fn add_sum(&mut self, light: &Self) {
        for (sum, more) in self.0.iter_mut().zip(light.0) {
            sum.0 = sum.0.saturating_add(more.0);
        }
    }

    /// Adds an [`Rgbe`] colour in integer arithmetic. The result is the same, bit for bit, as with
    /// [`Self::add`] and the decoded colour.
    #[inline(always)]
    pub fn add_rgbe(&mut self, power: Rgbe) {
        self.add_powers(&[u32::from_le_bytes(power.0).into()]);
    }

    /// Adds the powers of photons. Each photon is given by its content, which has an [`Rgbe`] colour in its
    /// low four bytes.
    #[inline(always)]
    pub(crate) fn add_powers(&mut self, photons: &[u64]) {
        let mut sums = [0_u64; 3];
        for &photon in photons {
            let [r, g, b] = &mut sums;
            let [more_r, more_g, more_b] = bits_of_power(photon);
            *r = r.wrapping_add(more_r);
            *g = g.wrapping_add(more_g);
            *b = b.wrapping_add(more_b);
        }
        for (sum, bits) in self.0.iter_mut().zip(sums) {
            sum.add_bits(bits.cast_signed());
        }
    }

    /// Subtracts the power of a photon that [`Self::add_powers`] has added, given by its content.
    #[inline(always)]
    pub(crate) fn subtract_power(&mut self, photon: u64) {
        for (sum, bits) in self.0.iter_mut().zip(bits_of_power(photon)) {
            sum.add_bits(bits.wrapping_neg().cast_signed());
        }
    }

    /// Words of the sum, the low one of each channel first.
    pub(crate) fn words(&self) -> [u32; 6] {
        let [[a, b], [c, d], [e, f]] = self.bits().map(|bits| [bits as u32, (bits >> 32) as u32]);
        [a, b, c, d, e, f]
    }

    /// Sum of these words.
    pub(crate) fn of_words([a, b, c, d, e, f]: [u32; 6]) -> Self {
        let bits = |[low, high]: [u32; 2]| (u64::from(high) << 32 | u64::from(low)).cast_signed();
        Self([[a, b], [c, d], [e, f]].map(|words| Sum(I24F40::from_bits(bits(words)))))
    }

    /// Value of each channel, in steps of 2^-40 units.
    #[inline(always)]
    pub fn bits(&self) -> [i64; 3] {
        self.0.map(|Sum(sum)| sum.to_bits())
    }

    /// Value of the sum, in units.
    #[inline(always)]
    pub fn value(&self) -> Vec3 {
        Vec3::from_array(self.0.map(Sum::value))
    }
}

/// Power of a photon by channel, in steps of 2^-40 units: the [`Rgbe`] colour in the content's low four
/// bytes.
#[inline(always)]
fn bits_of_power(photon: u64) -> [u64; 3] {
    // Exponent byte with which a mantissa counts steps of 2^-40 units.
    const UNIT: u32 = Rgbe::EXPONENT_BIAS as u32 - I24F40::FRAC_NBITS;
    let exponent = (photon >> 24) as u32 & 0xff;
    // One of the two shifts is 0. A byte shifted by 63 is 0 on the right, and 0 or 2^63 on the left.
    let [up, down] = [exponent.saturating_sub(UNIT).min(63), UNIT.saturating_sub(exponent).min(63)];
    [photon, photon >> 8, photon >> 16].map(|mantissa| (mantissa & 0xff) << up >> down)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_sums_saturate_in_any_order() {
        let terms = [8e6, 3.0, 7e6, f32::INFINITY, 1e30, 0.5].map(Vec3::splat);
        let sum = |order: [usize; 6]| {
            let mut sum = ColourSum::ZERO;
            order.into_iter().for_each(|index| sum.add_light(terms[index]));
            sum
        };
        let greatest = sum([0, 1, 2, 3, 4, 5]);
        assert_eq!(greatest.value(), Vec3::splat((1 << 23) as f32));
        for order in [[5, 4, 3, 2, 1, 0], [3, 0, 1, 2, 5, 4], [1, 5, 0, 2, 4, 3]] {
            assert_eq!(sum(order), greatest);
            // The result is the same if some terms are added up beforehand.
            let [mut first, mut second] = [ColourSum::ZERO; 2];
            order[..2].iter().for_each(|&index| first.add_light(terms[index]));
            order[2..].iter().for_each(|&index| second.add_light(terms[index]));
            first.add_sum(&second);
            assert_eq!(first, greatest);
        }
        let mut nothing = ColourSum::ZERO;
        nothing.add_light(Vec3::new(f32::NAN, -1.0, -0.0));
        assert_eq!(nothing, ColourSum::ZERO);
    }

    #[test]
    fn a_sum_is_the_same_in_any_order() {
        let terms: [Vec3; 100] = core::array::from_fn(|i| {
            Vec3::new(1.0 / (i + 1) as f32, 1e-4 * (i as f32), if i == 50 { 7e4 } else { 1e-7 })
        });
        let mut forwards = ColourSum::ZERO;
        terms.iter().for_each(|&term| forwards.add(term));
        let mut backwards = ColourSum::ZERO;
        terms.iter().rev().for_each(|&term| backwards.add(term));
        assert_eq!(forwards, backwards);
        assert!((forwards.value().x - 5.187_377_5).abs() < 1e-5);
    }

    #[test]
    fn a_shared_exponent_colour_adds_what_its_decoded_form_adds() {
        for exponent in 0..=144 {
            for mantissas in [[255, 128, 1], [0, 77, 200]] {
                let [r, g, b] = mantissas;
                let colour = Rgbe([r, g, b, exponent]);
                let mut direct = ColourSum::ZERO;
                direct.add_rgbe(colour);
                let mut decoded = ColourSum::ZERO;
                decoded.add(Vec3::from_array(colour.decode()));
                assert_eq!(direct, decoded, "{colour:?}");
            }
        }
    }

    #[test]
    fn nan_adds_nothing_to_a_sum() {
        let mut sum = ColourSum::ZERO;
        sum.add(Vec3::new(f32::NAN, 0.5, 0.0));
        assert_eq!(sum.value(), Vec3::new(0.0, 0.5, 0.0));
    }
}
