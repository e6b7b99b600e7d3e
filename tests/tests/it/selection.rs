//! The k nearest candidates that are selected equal those of sorting, for several distributions of distances.

use photoncard_firmware::photon::{Candidate, CandidateBuffer, Selection};
use photoncard_firmware::simd::Level;
use proptest::collection::vec;
use proptest::prelude::*;

fn candidate(distance: f32, content: u8) -> Candidate {
    Candidate::new(distance, [content, 0, 0, 0, content / 2, 0, content / 4, 0])
}

/// Candidates with distances as on a surface, and with distances that no guess or pivot divides well.
fn candidates() -> impl Strategy<Value = Vec<Candidate>> {
    let distance = prop_oneof![
        4 => 0.0_f32..1.0,
        1 => (0_i32..40).prop_map(|exponent| 2.0_f32.powi(-exponent)),
        1 => Just(0.25),
    ];
    let any_distance = (0_u32..=f32::INFINITY.to_bits()).prop_map(f32::from_bits);
    let few = || 0_u8..8;
    let pairs = prop_oneof![
        vec((0.0_f32..1.0, few()), 0..600),
        vec((Just(0.5_f32), few()), 0..600),
        vec((0.5_f32..0.500_001, few()), 0..600),
        vec((distance, any::<u8>()), 0..600),
        vec((any_distance, any::<u8>()), 0..600),
    ];
    let pairs = (pairs, 0_usize..3).prop_map(|(mut pairs, order)| {
        match order {
            0 => pairs.sort_by(|a, b| a.0.total_cmp(&b.0)),
            1 => pairs.sort_by(|a, b| b.0.total_cmp(&a.0)),
            _ => {}
        }
        pairs
    });
    pairs
        .prop_map(|pairs| pairs.into_iter().map(|(distance, content)| candidate(distance, content)).collect())
}

/// The `count`-th nearest candidate, and the nearest `count`; `None` and all candidates if `count` is 0 or
/// greater than their number. All instruction sets must agree.
fn select(candidates: &[Candidate], count: usize) -> (Option<Candidate>, Vec<Candidate>) {
    let mut results = Level::ALL.iter().filter_map(|level| {
        let mut buffer = CandidateBuffer::<600>::new();
        let mut all = buffer.fill(candidates);
        let last = level.run(Selection { candidates: all.reborrow(), count })?;
        let length = if last.is_some() { count } else { candidates.len() };
        Some((last, sorted(&all.iter().take(length).collect::<Vec<_>>())))
    });
    let first = results.next().expect("what every processor has");
    assert!(results.all(|result| result == first));
    first
}

fn sorted(candidates: &[Candidate]) -> Vec<Candidate> {
    let mut sorted = candidates.to_vec();
    sorted.sort_unstable_by_key(Candidate::order);
    sorted
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, ..ProptestConfig::default() })]
    #[test]
    fn the_nearest_candidates_are_selected(candidates in candidates(), share in 0.0_f32..=1.0) {
        let count = (candidates.len() as f32 * share) as usize;
        let (last, selected) = select(&candidates, count);
        let all = sorted(&candidates);
        prop_assert_eq!(last, all[..count].last().copied());
        prop_assert_eq!(&selected[..], if count > 0 { &all[..count] } else { &all });
    }
}

#[test]
fn more_candidates_than_there_are_cannot_be_selected() {
    let candidates = [candidate(1.0, 1), candidate(0.5, 2)];
    for count in [0, 3] {
        assert_eq!(select(&candidates, count), (None, sorted(&candidates)));
    }
}

/// In this order the median of three medians, the pivot, is nearly the least at first: many pivots are
/// needed.
#[test]
fn candidates_in_the_worst_order_are_selected() {
    for length in [300, 512] {
        let mut candidates: Vec<Candidate> = (0..length).map(|i| candidate(f32::from_bits(i), 0)).collect();
        for round in 0..length as usize / 9 {
            for ninth in 0..9 {
                candidates.swap(round + ninth, length as usize * ninth / 9);
            }
        }
        for count in [1, 100, length as usize - 1] {
            assert_eq!(select(&candidates, count).0, sorted(&candidates).get(count - 1).copied());
        }
    }
}
