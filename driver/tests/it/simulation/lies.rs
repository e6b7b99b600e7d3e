//! Cards with falsified pixels, and slow cards, among others: the picture is right, or an error names the
//! card.

use std::collections::HashMap;
use std::ops::Range;

use photoncard_driver::scheduler::{CardNumber, SchedulerError, Source};
use photoncard_firmware::sampler::hash;

use super::conditions::Run;
use super::liar::Lie;
use super::line::{Faults, Random};
use super::run::{End, Outcome};
use super::world::Fixture;
use super::{seeds, with_room_for_a_card};

/// Default seeds of each test.
const SEEDS: Range<u32> = 1..100;

/// Checks that all tiles in the sinks are right.
fn check_tiles(outcome: &Outcome, alone: &Outcome, seed: u32) {
    for (id, tile) in &outcome.tiles {
        // Some counters depend on the capacity of the queue, not on the picture.
        assert!(tile.records() == alone.tiles[id].records(), "seed {seed}: a lie about tile {id} is kept");
    }
}

/// Checks the runs of all seeds against the run of one card without faults; each has random numbers of its
/// own.
fn check_seeds(salt: u32, mut check: impl FnMut(&Fixture, &Outcome, u32, &mut Random)) {
    let fixture = Fixture::new();
    let alone = Run::new(&fixture, 1, 0).go();
    for seed in seeds(SEEDS) {
        check(&fixture, &alone, seed, &mut Random(hash(seed ^ salt)));
    }
}

/// Cards of a seed: some of the first ones falsify pixels, some are slow.
fn troubled<'a>(fixture: &'a Fixture, seed: u32, random: &mut Random) -> Run<'a> {
    let cards = 2 + random.below(5);
    let troubled = 1 + random.below(cards - 1);
    let mut run = Run::new(fixture, cards, seed);
    for card in 0..troubled {
        match random.below(4) {
            0 => drop(run.lazy.insert(card, None)),
            1 => drop(run.lazy.insert(card, Some(100))),
            _ => drop(run.liars.insert(card, (Lie::impossible(random), 1 << random.below(5)))),
        }
    }
    run
}

#[test]
fn impossible_values_and_laziness_never_reach_the_picture_nor_stop_it() {
    with_room_for_a_card(|| {
        let [mut runs, mut caught, mut helped, mut revoked] = [0; 4];
        check_seeds(0x11a5, |fixture, alone, seed, random| {
            let outcome = troubled(fixture, seed, random).go();
            assert_eq!(outcome.end, End::Complete, "seed {seed}: honest cards are left");
            check_tiles(&outcome, alone, seed);
            assert!(outcome.pixels == alone.pixels, "seed {seed}");
            assert_eq!(outcome.counters, alone.counters, "seed {seed}: work is counted twice");
            caught += outcome.caught.len();
            helped += outcome.counts.repeated;
            revoked += outcome.counts.revoked;
            runs += 1;
        });
        println!(
            "{runs} runs: {caught} liars caught, {revoked} of their tiles revoked, {helped} tiles rendered twice"
        );
        assert!(runs < 50 || caught > 0 && revoked > 0 && helped > 0);
    });
}

/// Falsified pixels and slow cards among resets, stalls and bad lines.
#[test]
fn liars_and_lazy_cards_among_faults_end_in_the_picture_or_in_words() {
    with_room_for_a_card(|| {
        let [mut complete, mut runs] = [0; 2];
        check_seeds(0xfa17, |fixture, alone, seed, random| {
            let faults = Faults::of(random);
            let outcome = Run { faults, ..troubled(fixture, seed, random) }.go();
            check_tiles(&outcome, alone, seed);
            match outcome.end {
                End::Complete => {
                    assert!(outcome.pixels == alone.pixels, "seed {seed}");
                    complete += 1;
                }
                End::NoCard => {}
                End::Fault(fault) => {
                    assert!(matches!(fault, SchedulerError::Unrendered { .. }), "seed {seed}: {fault}");
                }
            }
            runs += 1;
        });
        println!("{complete} of {runs} runs complete");
        assert!(2 * complete > runs, "only {complete} of {runs} runs ended in the picture");
    });
}

/// Falsifications within the range of valid pixels, a different one for each card.
fn plausible(cards: usize, liars: usize, random: &mut Random) -> HashMap<CardNumber, (Lie, u32)> {
    let lie = |card: usize| (card, (Lie::Brighter(1.5 + card as f32), 1 << random.below(4)));
    (0..liars.min(cards)).map(lie).collect()
}

#[test]
fn verified_lies_are_outvoted_or_named() {
    with_room_for_a_card(|| {
        let [mut complete, mut named, mut runs] = [0; 3];
        check_seeds(0x7e57, |fixture, alone, seed, random| {
            let cards = 2 + random.below(4);
            let liars = plausible(cards, 1 + random.below(cards - 1), random);
            let honest = cards - liars.len();
            let run = Run { liars: liars.clone(), verify: Some(1.0), ..Run::new(fixture, cards, seed) };
            let outcome = run.go();
            assert!(
                outcome.caught.iter().all(|card| liars.contains_key(card)) || outcome.end != End::Complete
            );
            match &outcome.end {
                End::Complete => {
                    check_tiles(&outcome, alone, seed);
                    assert!(outcome.pixels == alone.pixels, "seed {seed}");
                    assert_eq!(outcome.counts.verified, alone.tiles.len(), "seed {seed}");
                    assert_eq!(outcome.counters, alone.counters, "seed {seed}: work is counted twice");
                    complete += 1;
                }
                End::Fault(SchedulerError::Disagreement { sources, .. }) => {
                    let is_liar =
                        |source: &Source| matches!(source, Source::Card(card) if liars.contains_key(card));
                    assert!(sources.iter().any(is_liar), "seed {seed}: honest cards are named");
                    assert!(honest < 2, "seed {seed}: two honest cards are a majority of two");
                    check_tiles(&outcome, alone, seed);
                    named += 1;
                }
                end => {
                    let may_be = honest < 2 && matches!(end, End::Fault(SchedulerError::Unverified { .. }));
                    assert!(may_be, "seed {seed}: {end:?} of {honest} honest cards");
                }
            }
            runs += 1;
        });
        println!("{complete} of {runs} runs complete, {named} name the cards that differ");
        assert!(runs < 50 || complete > runs / 4 && named > 0);
    });
}

/// Light that a chip's sums can hold, but that no scene is likely to have. Without verification, the answer
/// of the card without such light is accepted.
#[test]
fn dazzling_lies_never_reach_the_picture() {
    with_room_for_a_card(|| {
        let mut caught = 0;
        check_seeds(0xda22, |fixture, alone, seed, random| {
            let light = [i64::MAX, 1 << 62, 1 << 58][random.below(3)];
            let lies = [(0, (Lie::Dazzling(light), 1 << random.below(4)))];
            let run = Run { liars: lies.into(), ..Run::new(fixture, 2 + random.below(3), seed) };
            let outcome = run.go();
            assert_eq!(outcome.end, End::Complete, "seed {seed}: honest cards are left");
            check_tiles(&outcome, alone, seed);
            assert!(outcome.pixels == alone.pixels, "seed {seed}");
            assert_eq!(outcome.counters, alone.counters, "seed {seed}: work is counted twice");
            assert!(outcome.caught.is_empty() || outcome.caught == [0], "seed {seed}");
            caught += outcome.caught.len();
        });
        assert!(caught > 0);
    });
}

/// No pixel of a detected card stays in the picture, whatever share of its tiles was verified.
#[test]
fn what_a_caught_liar_has_rendered_is_rendered_again() {
    with_room_for_a_card(|| {
        let [mut caught, mut revoked] = [0; 2];
        check_seeds(0xca7c, |fixture, alone, seed, random| {
            let faults =
                if seed % 2 == 0 { Faults { deaths: 0, ..Faults::of(random) } } else { Faults::default() };
            let liars: HashMap<_, _> = [(0, (Lie::Brighter(1.5), 1))].into();
            let run =
                Run { faults, liars, verify: Some(0.2), ..Run::new(fixture, 3 + random.below(3), seed) };
            let outcome = run.go();
            assert!(
                outcome.caught.is_empty() || outcome.caught == [0] || outcome.end != End::Complete,
                "seed {seed}"
            );
            if outcome.caught == [0] {
                check_tiles(&outcome, alone, seed);
                caught += 1;
                revoked += outcome.counts.revoked;
            }
            if outcome.end == End::Complete {
                assert!(outcome.counts.verified > 0, "seed {seed}: nothing is verified");
            }
        });
        println!("{caught} liars caught, {revoked} of their tiles rendered again");
        assert!(caught > 0 && (revoked > 0 || seeds(SEEDS).len() < 50));
    });
}

/// A card that answers but never renders delays a render by the time of some tiles only.
#[test]
fn a_lazy_card_holds_up_a_render_for_some_tiles_time() {
    with_room_for_a_card(|| {
        let fixture = Fixture::new();
        for seed in 0..20 {
            let busy = Run { stopped: 1, ..Run::new(&fixture, 3, seed) }.go();
            let lazy = Run { lazy: [(0, None)].into(), ..Run::new(&fixture, 3, seed) }.go();
            assert_eq!(lazy.end, End::Complete);
            assert!(lazy.pixels == busy.pixels, "seed {seed}");
            assert!(
                lazy.steps < 10 * busy.steps + 20_000,
                "seed {seed}: {} and {} steps",
                lazy.steps,
                busy.steps
            );
        }
    });
}
