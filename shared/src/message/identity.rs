//! Coverage of a pixel by identity: by the objects and materials of the surfaces that its eye rays hit.
//!
//! An identity is a number that the card image gives to a pair of object and material
//! ([`SectionKind::Identities`](crate::image::SectionKind::Identities)).

use crate::hash::hash;

/// Maximum number of identities of a pixel.
pub const MAX_IDENTITIES: usize = 12;

/// Bytes of the identities of a pixel.
pub(super) const IDENTITIES_BYTES: usize = 8 * MAX_IDENTITIES;

/// Coverage of a pixel by identity. Of more than [`MAX_IDENTITIES`] identities, those with the least hashes
/// are kept, so that the result depends neither on the order of the samples nor on their division among
/// frames: an identity among the least of all samples is among the least of any part of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct IdentityCoverage {
    /// Identities with their coverage, in the order of [`rank`], followed by [`Covered::NONE`].
    entries: [Covered; MAX_IDENTITIES],
}

/// An identity, and the sum of the weights of its paths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Covered {
    identity: u32,
    /// Coverage in steps of 1 / [`COVERAGE_STEPS`](super::COVERAGE_STEPS); 0 in an unused entry.
    coverage: u32,
}

impl Covered {
    const NONE: Self = Self { identity: 0, coverage: 0 };
}

/// Rank of an identity, by which a full set keeps it or not. Different identities have different ranks.
fn rank(identity: u32) -> (u32, u32) {
    (hash(identity), identity)
}

impl IdentityCoverage {
    /// No coverage.
    pub const NONE: Self = Self { entries: [Covered::NONE; MAX_IDENTITIES] };

    /// Adds coverage, in steps of 1 / [`COVERAGE_STEPS`](super::COVERAGE_STEPS), to an identity.
    pub fn add(&mut self, identity: u32, coverage: u32) {
        if coverage == 0 {
            return;
        }
        let mut added = Covered { identity, coverage };
        for entry in &mut self.entries {
            if entry.coverage == 0 {
                *entry = added;
                return;
            }
            if entry.identity == added.identity {
                entry.coverage = entry.coverage.saturating_add(added.coverage);
                return;
            }
            if rank(added.identity) < rank(entry.identity) {
                // The entries behind move by one; the last one is dropped.
                core::mem::swap(entry, &mut added);
            }
        }
    }

    /// Returns the sums over the samples of both operands.
    #[must_use]
    pub fn plus(&self, more: &Self) -> Self {
        let mut sum = *self;
        more.iter().for_each(|(identity, coverage)| sum.add(identity, coverage));
        sum
    }

    /// Identities of the pixel, each with its coverage in steps of
    /// 1 / [`COVERAGE_STEPS`](super::COVERAGE_STEPS).
    pub fn iter(&self) -> impl Iterator<Item = (u32, u32)> {
        let used = self.entries.iter().take_while(|entry| entry.coverage > 0);
        used.map(|entry| (entry.identity, entry.coverage))
    }

    /// Sum of the coverage of all kept identities.
    pub fn total(&self) -> u32 {
        self.iter().fold(0, |sum: u32, (_, coverage)| sum.saturating_add(coverage))
    }

    /// Reads the numbers that [`Self::numbers`] writes; `None` if they are not in the right order.
    pub(super) fn of_numbers(mut next: impl FnMut() -> u32) -> Option<Self> {
        let mut coverage = Self::NONE;
        let mut last = None;
        let mut is_over = false;
        for entry in &mut coverage.entries {
            *entry = Covered { identity: next(), coverage: next() };
            if entry.coverage == 0 {
                is_over = true;
                if entry.identity != 0 {
                    return None;
                }
                continue;
            }
            let rank = Some(rank(entry.identity));
            if is_over || last >= rank {
                return None;
            }
            last = rank;
        }
        Some(coverage)
    }

    /// Passes identity and coverage of each entry to `append`.
    pub(super) fn numbers(&self, mut append: impl FnMut(u32)) {
        for Covered { identity, coverage } in &self.entries {
            append(*identity);
            append(*coverage);
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::collections::BTreeMap;
    use std::vec::Vec;

    use proptest::prelude::*;

    use super::*;

    fn sum_of(samples: &[(u32, u32)]) -> IdentityCoverage {
        let mut sum = IdentityCoverage::NONE;
        samples.iter().for_each(|&(identity, coverage)| sum.add(identity, coverage));
        sum
    }

    /// The rule, without its algorithm: the sums of all identities, of which those of least rank are kept.
    fn expected(samples: &[(u32, u32)]) -> Vec<(u32, u32)> {
        let mut sums = BTreeMap::new();
        for &(identity, coverage) in samples.iter().filter(|(_, coverage)| *coverage > 0) {
            *sums.entry(rank(identity)).or_insert(0) += coverage;
        }
        sums.into_iter().take(MAX_IDENTITIES).map(|((_, identity), sum)| (identity, sum)).collect()
    }

    fn samples() -> impl Strategy<Value = Vec<(u32, u32)>> {
        let identity = prop_oneof![0..40_u32, any::<u32>()];
        prop::collection::vec((identity, 0..1000_u32), 0..80)
    }

    proptest! {
        #[test]
        fn a_sum_has_the_identities_of_least_rank(samples in samples()) {
            prop_assert!(sum_of(&samples).iter().eq(expected(&samples)));
        }

        #[test]
        fn sums_of_parts_add_up_to_the_whole_in_any_order(
            samples in samples(), cuts in [0..81_usize, 0..81_usize], turn in 0..81_usize,
        ) {
            let [first, second] = cuts.map(|cut| cut.min(samples.len()));
            let [low, high] = [first.min(second), first.max(second)];
            let [a, b, c] = [&samples[..low], &samples[low..high], &samples[high..]].map(sum_of);
            let whole = sum_of(&samples);
            prop_assert_eq!(a.plus(&b).plus(&c), whole);
            prop_assert_eq!(c.plus(&a.plus(&b)), whole);
            prop_assert_eq!(b.plus(&c).plus(&a), whole);
            let mut turned = samples;
            let turn = turn % turned.len().max(1);
            turned.rotate_left(turn);
            prop_assert_eq!(sum_of(&turned), whole);
        }

        #[test]
        fn numbers_are_read_as_they_are_written_and_others_are_refused(
            samples in samples(), place in 0..2 * MAX_IDENTITIES, number: u32,
        ) {
            let sum = sum_of(&samples);
            let mut numbers = Vec::new();
            sum.numbers(|number| numbers.push(number));
            let read = |numbers: &[u32]| {
                let mut numbers = numbers.iter();
                IdentityCoverage::of_numbers(|| numbers.next().copied().unwrap_or(0))
            };
            prop_assert_eq!(read(&numbers), Some(sum));
            numbers[place] = number;
            // Entries that can be read are those of a sum.
            if let Some(other) = read(&numbers) {
                let samples: Vec<_> = other.iter().collect();
                prop_assert_eq!(sum_of(&samples), other);
            }
        }
    }
}
