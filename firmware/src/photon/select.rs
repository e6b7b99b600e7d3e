//! Selection of the k nearest candidates, in place.
//!
//! On a surface, the squared distance of the k-th photon is proportional to k. Interpolation therefore
//! guesses an interval of squared distances that contains the k-th and few others. Counting the candidates
//! below its ends verifies and corrects the guess. One pass then keeps the candidates below the interval and
//! sets aside those within it. The nearest of the latter complete the set of k candidates. If no guess
//! succeeds, for example with many equal distances, quickselect (Hoare 1961) is used. After a bounded number
//! of pivots it gives way to a radix selection by bits of the sort key. All methods select the same set.

use super::candidates::{Candidate, CandidateCells, Candidates};
use crate::simd::{Isa, LANES};

/// Maximum number of guesses of an interval.
const GUESSES: u32 = 4;
/// Maximum number of candidates in the interval of a successful guess.
const BETWEEN: usize = 32;
/// Maximum number of pivots in quickselect before the radix selection starts.
const PIVOTS: u32 = 16;
/// Maximum number of candidates sorted by insertion.
const FEW: usize = 16;

/// Result of a selection.
pub(super) struct Chosen {
    /// The farthest candidate that was selected.
    pub(super) last: Candidate,
    /// Number of comparisons of distances; those of quickselect and between equal distances do not count.
    pub(super) compared: u32,
}

/// Moves the `count` nearest of the first `length` candidates to the front, unordered, and returns the
/// farthest of these. All other elements, including those past `length`, become meaningless. Returns `None`
/// and changes nothing if `count` is 0 or above `length`.
#[inline(always)]
pub(super) fn select(
    isa: impl Isa,
    mut candidates: Candidates,
    length: usize,
    count: usize,
) -> Option<Chosen> {
    if count == 0 || length < count {
        return None;
    }
    let (interval, guesses) = guess(candidates.distances.get(..length)?, count)?;
    let Some(interval) = interval else {
        let last = part(candidates.first(length)?.cells(), count - 1)?;
        return Some(Chosen { last, compared: comparisons(length, guesses, 0) });
    };
    let (last, between) = keep(isa, candidates, length, count, interval)?;
    Some(Chosen { last, compared: comparisons(length, guesses + 1, between) })
}

/// Number of comparisons of a selection. Each of the `length` distances is compared once to find the
/// greatest, and with both ends of an interval in each of `passes` passes. Each of the `between` candidates
/// in the interval is compared with [`BETWEEN`] others and with the k-th.
#[inline(always)]
fn comparisons(length: usize, passes: u32, between: usize) -> u32 {
    length as u32 * (1 + 2 * passes) + (between * (BETWEEN + 1)) as u32
}

/// Finds an interval `low <= d < high` of squared distances, as bits, that contains the `count`-th distance
/// and at most [`BETWEEN`] distances in all. Returns the interval (`None` if [`GUESSES`] guesses fail) and
/// the number of guesses. Returns `None` as a whole if there are no distances.
#[inline(always)]
fn guess(distances: &[u32], count: usize) -> Option<(Option<[u32; 2]>, u32)> {
    let farthest = distances.iter().copied().max()?;
    let (wanted, slack) = (count as f32, distances.len() as f32 / 40.0);
    let step = f32::from_bits(farthest) / distances.len() as f32;
    let [mut low, mut high] = [(wanted - slack).max(0.0) * step, (wanted + slack) * step];
    for guesses in 1..=GUESSES {
        let [nearer_than_low, nearer_than_high] = count_nearer(distances, low.to_bits(), high.to_bits());
        if count <= nearer_than_low {
            high = low;
            low *= ((wanted - slack) / nearer_than_low as f32).max(0.0);
        } else if count > nearer_than_high {
            low = high;
            high *= (wanted + slack) / nearer_than_high as f32;
        } else if nearer_than_high - nearer_than_low <= BETWEEN {
            return Some((Some([low.to_bits(), high.to_bits()]), guesses));
        } else {
            let step = (high - low) / (nearer_than_high - nearer_than_low) as f32;
            let rank = (count - nearer_than_low) as f32;
            high = high.min(low + (rank + slack) * step);
            low += (rank - slack).max(0.0) * step;
        }
    }
    Some((None, GUESSES))
}

#[inline(always)]
fn count_nearer(distances: &[u32], low: u32, high: u32) -> [usize; 2] {
    let mut nearer = [0_u32; 2];
    for &distance in distances {
        let [than_low, than_high] = &mut nearer;
        *than_low += u32::from(distance < low);
        *than_high += u32::from(distance < high);
    }
    nearer.map(|count| count as usize)
}

/// Does [`select`] by means of an interval that [`guess`] has found. Returns the farthest selected candidate,
/// and the number of candidates in the interval.
#[inline(always)]
fn keep(
    isa: impl Isa,
    candidates: Candidates,
    length: usize,
    count: usize,
    [low, high]: [u32; 2],
) -> Option<(Candidate, usize)> {
    let Candidates { distances, contents } = candidates;
    let mut aside = Aside { distances: [0; BETWEEN + LANES], contents: [0; BETWEEN + LANES], count: 0 };
    let (mut kept, mut first) = (0, 0);
    // In place: the write position never passes the read position.
    while let Some(&lanes) = distances.get(first..).and_then(<[u32]>::first_chunk).filter(|_| first < length)
    {
        let &carried = contents.get(first..)?.first_chunk()?;
        let there = first_lanes(length - first);
        let nearer = isa.below(&lanes, low) & there;
        isa.pack(nearer, &lanes, distances.get_mut(kept..)?.first_chunk_mut()?);
        isa.pack_long(nearer, &carried, contents.get_mut(kept..)?.first_chunk_mut()?);
        kept += nearer.count_ones() as usize;
        aside.pack(isa, isa.below(&lanes, high) & there & !nearer, &lanes, &carried)?;
        first += LANES;
    }
    let all = Candidates { distances, contents }.cells();
    for index in first..length {
        let candidate = all.get(index)?;
        if candidate.distance < low {
            all.set(kept, candidate);
            kept += 1;
        } else if candidate.distance < high {
            aside.push(candidate)?;
        }
    }
    let between = aside.count;
    let last = aside.select(isa, count - kept - 1)?;
    let chosen = aside.distances.iter().zip(&aside.contents);
    for (index, (&distance, &content)) in (kept..count).zip(chosen) {
        all.set(index, Candidate { distance, content });
    }
    Some((last, between))
}

/// Bit mask of the first `count` lanes; of all lanes if `count` is above [`LANES`]. `count` must not be 0.
#[inline(always)]
fn first_lanes(count: usize) -> u32 {
    u32::MAX >> (u32::BITS - count.min(LANES) as u32)
}

/// Buffer of the candidates in the interval. It has [`LANES`] spare elements for writes of whole vectors.
struct Aside {
    distances: [u32; BETWEEN + LANES],
    contents: [u64; BETWEEN + LANES],
    count: usize,
}

impl Aside {
    #[inline(always)]
    fn pack(
        &mut self,
        isa: impl Isa,
        mask: u32,
        distances: &[u32; LANES],
        contents: &[u64; LANES],
    ) -> Option<()> {
        isa.pack(mask, distances, self.distances.get_mut(self.count..)?.first_chunk_mut()?);
        isa.pack_long(mask, contents, self.contents.get_mut(self.count..)?.first_chunk_mut()?);
        self.count += mask.count_ones() as usize;
        Some(())
    }

    #[inline(always)]
    fn push(&mut self, candidate: Candidate) -> Option<()> {
        *self.distances.get_mut(self.count)? = candidate.distance;
        *self.contents.get_mut(self.count)? = candidate.content;
        self.count += 1;
        Some(())
    }

    /// Moves the `rank + 1` nearest candidates to the front, unordered, and returns the farthest of them.
    #[inline(always)]
    fn select(&mut self, isa: impl Isa, rank: usize) -> Option<Candidate> {
        let Some(index) = self.only_one_at(rank) else {
            let Self { distances, contents, count } = self;
            return part(Candidates { distances, contents }.first(*count)?.cells(), rank);
        };
        let last = Candidate { distance: *self.distances.get(index)?, content: *self.contents.get(index)? };
        let all = core::mem::take(&mut self.count);
        for first in (0..all).step_by(LANES) {
            let &distances = self.distances.get(first..)?.first_chunk()?;
            let &contents = self.contents.get(first..)?.first_chunk()?;
            // No overflow: distances in the interval are below its upper end.
            let nearer = isa.below(&distances, last.distance + 1);
            self.pack(isa, nearer & first_lanes(all - first), &distances, &contents)?;
        }
        Some(last)
    }

    /// Index of the candidate with exactly `rank` nearer candidates; `None` if another candidate has the same
    /// distance.
    #[inline(always)]
    fn only_one_at(&self, rank: usize) -> Option<usize> {
        let all: &[u32; BETWEEN] = self.distances.first_chunk()?;
        let mut nearer = [0_u32; BETWEEN];
        for other in self.distances.get(..self.count)? {
            for (nearer, distance) in nearer.iter_mut().zip(all) {
                *nearer += u32::from(other < distance);
            }
        }
        let mut there = nearer.iter().take(self.count).enumerate();
        let index = there.find(|&(_, &nearer)| nearer as usize == rank).map(|(index, _)| index)?;
        let is_another = there.any(|(_, &nearer)| nearer as usize == rank);
        (!is_another).then_some(index)
    }
}

/// Moves the `rank + 1` nearest candidates to the front, unordered, and returns the farthest of them.
fn part(mut cells: CandidateCells, mut rank: usize) -> Option<Candidate> {
    for _ in 0..PIVOTS {
        if cells.len() <= FEW {
            return sort(cells, rank);
        }
        let pivot = pivot(cells)?;
        let mut less = divide(cells, |candidate| candidate.key() < pivot.key());
        if less == 0 {
            // The pivot is the minimum: the candidates equal to it come first.
            less = divide(cells, |candidate| candidate.key() <= pivot.key());
            if rank < less {
                return Some(pivot);
            }
        }
        (cells, rank) = follow(cells, rank, less)?;
    }
    for bit in (0..Candidate::KEY_BITS).rev() {
        let less = divide(cells, |candidate| candidate.key() >> bit & 1 == 0);
        (cells, rank) = follow(cells, rank, less)?;
    }
    cells.get(rank)
}

/// Splits partitioned candidates after the first `less`. Returns the half that contains the candidate of rank
/// `rank`, and its rank within the half.
fn follow(cells: CandidateCells, rank: usize, less: usize) -> Option<(CandidateCells, usize)> {
    let (front, back) = cells.split_at(less)?;
    Some(if rank < less { (front, rank) } else { (back, rank - less) })
}

/// Moves the candidates for which `is_first` is true to the front. Returns their number.
#[inline(always)]
fn divide(cells: CandidateCells, is_first: impl Fn(&Candidate) -> bool) -> usize {
    let mut count = 0;
    for index in 0..cells.len() {
        // Never out of range: `count <= index`.
        if let (Some(candidate), Some(other)) = (cells.get(index), cells.get(count)) {
            cells.set(index, other);
            cells.set(count, candidate);
            count += usize::from(is_first(&candidate));
        }
    }
    count
}

/// Pivot for quickselect: the median of three medians of three candidates.
fn pivot(cells: CandidateCells) -> Option<Candidate> {
    let at = |ninth: usize| cells.get(cells.len() * ninth / 9);
    let of_three = |ninth| Some(median(at(ninth)?, at(ninth + 1)?, at(ninth + 2)?));
    Some(median(of_three(0)?, of_three(3)?, of_three(6)?))
}

fn median(a: Candidate, b: Candidate, c: Candidate) -> Candidate {
    match [a.key() < b.key(), a.key() < c.key(), b.key() < c.key()] {
        [true, false, _] | [false, true, _] => a,
        [true, true, true] | [false, false, false] => b,
        _ => c,
    }
}

/// Sorts the candidates by insertion. Returns the one of rank `rank`, counted from 0.
fn sort(cells: CandidateCells, rank: usize) -> Option<Candidate> {
    for sorted in 1..cells.len() {
        let candidate = cells.get(sorted)?;
        let mut hole = sorted;
        while let Some(before) = hole.checked_sub(1).and_then(|before| cells.get(before)) {
            if before.key() <= candidate.key() {
                break;
            }
            cells.set(hole, before);
            hole -= 1;
        }
        cells.set(hole, candidate);
    }
    cells.get(rank)
}
