//! The first k of candidates in their order, selected in place and without an index that could fail.
//!
//! Photons on a surface lie so that the squared distance of the k-th grows in proportion to k. So two distances between
//! which the k-th lies, and few others, are mostly guessed at once; counting tells, and corrects a guess. One pass then
//! keeps what is nearer than both, and sets aside what lies between, of which the first are added. Where no guess
//! narrows, as with many candidates at one distance, they are parted by pivots (Hoare 1961), and after
//! a bounded number of those by one bit after another of what orders them. Nothing of the result depends on the way.

use core::cell::Cell;

use super::Candidate;

/// Guesses of the two distances.
const GUESSES: u32 = 4;
/// Candidates between the two distances.
const BETWEEN: usize = 32;
/// Pivots, before bits are taken.
const PIVOTS: u32 = 16;
/// So few are sorted by insertion.
const FEW: usize = 16;

/// Moves the first `count` candidates, in their order, to the front, and returns the last of these. What lies behind
/// is no longer of use. `None`, and no change, if there are none or fewer than `count`.
pub fn select(candidates: &mut [Candidate], count: usize) -> Option<Candidate> {
    if count == 0 || candidates.len() < count {
        return None;
    }
    match guess(candidates, count) {
        Some([low, high]) => keep(candidates, count, low, high),
        None => part(Cell::from_mut(candidates).as_slice_of_cells(), count - 1),
    }
}

/// The bits of two distances: the `count`-th is at the first or beyond it, and nearer than the second, as few others are.
fn guess(candidates: &[Candidate], count: usize) -> Option<[u32; 2]> {
    let farthest = candidates.iter().map(|candidate| candidate.distance).max()?;
    let (wanted, slack) = (count as f32, candidates.len() as f32 / 40.0);
    let step = f32::from_bits(farthest) / candidates.len() as f32;
    let [mut low, mut high] = [(wanted - slack).max(0.0) * step, (wanted + slack) * step];
    for _ in 0..GUESSES {
        let [nearer_than_low, nearer_than_high] = count_nearer(candidates, low.to_bits(), high.to_bits());
        if count <= nearer_than_low {
            high = low;
            low *= ((wanted - slack) / nearer_than_low as f32).max(0.0);
        } else if count > nearer_than_high {
            low = high;
            high *= (wanted + slack) / nearer_than_high as f32;
        } else if nearer_than_high - nearer_than_low <= BETWEEN {
            return Some([low.to_bits(), high.to_bits()]);
        } else {
            let step = (high - low) / (nearer_than_high - nearer_than_low) as f32;
            let place = (count - nearer_than_low) as f32;
            high = high.min(low + (place + slack) * step);
            low += (place - slack).max(0.0) * step;
        }
    }
    None
}

fn count_nearer(candidates: &[Candidate], low: u32, high: u32) -> [usize; 2] {
    let mut nearer = [0_u32; 2];
    for candidate in candidates {
        let [than_low, than_high] = &mut nearer;
        *than_low += u32::from(candidate.distance < low);
        *than_high += u32::from(candidate.distance < high);
    }
    nearer.map(|count| count as usize)
}

/// Selects by two distances that [`guess`] returned.
fn keep(candidates: &mut [Candidate], count: usize, low: u32, high: u32) -> Option<Candidate> {
    let cells = Cell::from_mut(candidates).as_slice_of_cells();
    let mut between = [Candidate { distance: 0, power: 0, rest: 0 }; BETWEEN];
    let between = Cell::from_mut(&mut between[..]).as_slice_of_cells();
    let (mut kept, mut aside) = (0, 0);
    for cell in cells {
        // Written in any case, and counted if it is to stay: no branch on what cannot be foreseen.
        let candidate = cell.get();
        if let Some(target) = cells.get(kept) {
            target.set(candidate);
        }
        kept += usize::from(candidate.distance < low);
        if let Some(target) = between.get(aside) {
            target.set(candidate);
        }
        aside += usize::from((low..high).contains(&candidate.distance));
    }
    let added = between.get(..aside)?;
    let last = part(added, count - kept - 1)?;
    for (target, candidate) in cells.get(kept..count)?.iter().zip(added) {
        target.set(candidate.get());
    }
    Some(last)
}

/// Moves the first `place` + 1 candidates to the front, and returns the last of these.
fn part(mut cells: &[Cell<Candidate>], mut place: usize) -> Option<Candidate> {
    for _ in 0..PIVOTS {
        if cells.len() <= FEW {
            return sort(cells, place);
        }
        let pivot = pivot(cells)?;
        let mut less = divide(cells, |candidate| candidate.key() < pivot.key());
        if less == 0 {
            // Nothing comes before the pivot: what is equal to it is in its place.
            less = divide(cells, |candidate| candidate.key() <= pivot.key());
            if place < less {
                return Some(pivot);
            }
        }
        (cells, place) = follow(cells, place, less)?;
    }
    for bit in (0..Candidate::KEY_BITS).rev() {
        let less = divide(cells, |candidate| candidate.key() >> bit & 1 == 0);
        (cells, place) = follow(cells, place, less)?;
    }
    cells.get(place).map(Cell::get)
}

/// The part of `cells`, of which the first `less` come before the others, where `place` lies; and the place there.
fn follow(cells: &[Cell<Candidate>], place: usize, less: usize) -> Option<(&[Cell<Candidate>], usize)> {
    let (front, back) = cells.split_at_checked(less)?;
    Some(if place < less { (front, place) } else { (back, place - less) })
}

/// Moves the candidates that are told to come first to the front, and returns how many they are.
#[inline(always)]
fn divide(cells: &[Cell<Candidate>], is_first: impl Fn(&Candidate) -> bool) -> usize {
    let mut count = 0;
    for cell in cells {
        let candidate = cell.get();
        // It is there: no more are counted than were looked at.
        if let Some(target) = cells.get(count) {
            cell.set(target.get());
            target.set(candidate);
        }
        count += usize::from(is_first(&candidate));
    }
    count
}

/// The median of three medians of three.
fn pivot(cells: &[Cell<Candidate>]) -> Option<Candidate> {
    let at = |ninth: usize| cells.get(cells.len() * ninth / 9).map(Cell::get);
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

/// Sorts, and returns the one at a place.
fn sort(cells: &[Cell<Candidate>], place: usize) -> Option<Candidate> {
    for (sorted, cell) in cells.iter().enumerate() {
        let (candidate, mut hole) = (cell.get(), cell);
        for before in cells.get(..sorted)?.iter().rev() {
            if before.get().key() <= candidate.key() {
                break;
            }
            hole.set(before.get());
            hole = before;
        }
        hole.set(candidate);
    }
    cells.get(place).map(Cell::get)
}
