//! Simulation: whatever faults cards and links have, a render ends in the same picture, or in a clear error.
//! Real sessions and cards run in one thread and in virtual time, over links whose every step and fault is
//! determined by a seed.
//!
//! `PHOTONCARD_SEEDS=SEED cargo test -p photoncard-driver --features study --test it simulation` repeats the
//! run of a failing seed alone, `PHOTONCARD_SEEDS=1..10000` runs many.

mod conditions;
mod kept;
mod liar;

mod lies;
mod line;
mod relay;
mod run;
mod station;
mod world;

use std::ops::Range;
use std::sync::Mutex;
use std::time::Duration;

use photoncard_driver::dispatcher::Dispatcher;
use photoncard_driver::film::PixelValue;
use photoncard_driver::scheduler::SchedulerError;
use photoncard_driver::session::{LinkBytes, Session};
use photoncard_firmware::sampler::hash;
use photoncard_shared::counters::Counters;

use self::conditions::Run;
use self::line::{Faults, Random};
use self::run::{End, MAX_STEPS};
use self::station::Station;
use self::world::Fixture;

/// Default seeds of each test.
const SEEDS: Range<u32> = 1..300;

/// Seeds to run: from the environment, or the default.
fn seeds(unasked: Range<u32>) -> Range<u32> {
    let Ok(asked) = std::env::var("PHOTONCARD_SEEDS") else { return unasked };
    let number = |text: &str| text.parse().expect("PHOTONCARD_SEEDS is a seed, or the first..past the last");
    match asked.split_once("..") {
        Some((first, end)) => number(first)..number(end),
        None => number(&asked)..number(&asked) + 1,
    }
}

/// Runs `work` on a thread whose stack has room for a card's buffers.
fn with_room_for_a_card(work: impl FnOnce() + Send) {
    std::thread::scope(|scope| {
        let thread = std::thread::Builder::new().stack_size(16 << 20).spawn_scoped(scope, work);
        thread.unwrap().join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
    });
}

#[test]
fn any_delays_end_in_the_same_picture_and_nothing_is_sent_twice() {
    with_room_for_a_card(|| {
        let fixture = Fixture::new();
        let alone = Run::new(&fixture, 1, 0).go();
        assert!(alone.pixels.as_ref().unwrap().iter().any(|pixel| pixel.radiance[0] > 0.0));
        let (mut shared, mut runs) = (0, 0);
        for seed in seeds(SEEDS) {
            let cards = 1 + seed as usize % 5;
            let delayed = Run::new(&fixture, cards, seed).go();
            assert!(delayed.pixels == alone.pixels, "seed {seed}: other pixels on {cards} cards");
            assert_eq!(delayed.counters, alone.counters, "seed {seed}: other work on {cards} cards");
            let line = delayed.bytes.line;
            assert_eq!((line.repeated, line.damaged, delayed.bytes.resets), (0, 0, 0), "seed {seed}");
            shared += u32::from(delayed.working > 1);
            runs += 1;
        }
        // Delays may leave all tiles to one card, but only rarely.
        assert!(shared >= runs / 3, "{shared} of {runs} runs have several cards at work");
    });
}

#[test]
fn a_card_that_never_answers_holds_up_no_other() {
    with_room_for_a_card(|| {
        let fixture = Fixture::new();
        let alone = Run::new(&fixture, 1, 0).go();
        for seed in 0..20 {
            let run = Run { stopped: 2, ..Run::new(&fixture, 4, seed) };
            assert!(run.go().pixels == alone.pixels, "seed {seed}");
        }
    });
}

#[test]
fn faults_end_in_the_same_picture_or_in_words() {
    with_room_for_a_card(|| {
        let fixture = Fixture::new();
        let alone = Run::new(&fixture, 1, 0).go();
        let mut repaired = LinkBytes::default();
        let [mut complete, mut unrendered, mut runs, mut given_up] = [0; 4];
        for seed in seeds(SEEDS) {
            let cards = 1 + seed as usize % 8;
            let faults = Faults::of(&mut Random(hash(!seed)));
            let outcome = Run { faults, ..Run::new(&fixture, cards, seed) }.go();
            if faults.stalls + faults.resets + faults.deaths == 0 {
                assert!(outcome.pixels.is_some(), "seed {seed}: bad lines end the render, {faults:?}");
                assert_eq!(outcome.given_up, 0, "seed {seed}: sound cards are given up, {faults:?}");
            }
            for (id, tile) in &outcome.tiles {
                assert!(*tile == alone.tiles[id], "seed {seed}: another tile {id}, {faults:?}");
            }
            match outcome.end {
                End::Complete => {
                    assert!(outcome.pixels == alone.pixels, "seed {seed}: other pixels, {faults:?}");
                    assert_eq!(outcome.counters, alone.counters, "seed {seed}: other work, {faults:?}");
                    complete += 1;
                }
                End::NoCard => assert!(
                    faults.deaths + faults.stalls > 0 || outcome.given_up > 0,
                    "seed {seed}: no card is left that never stopped, {faults:?}"
                ),
                End::Fault(fault) => {
                    let is_named =
                        matches!(&fault, SchedulerError::Unrendered { tiles } if !tiles.is_empty());
                    assert!(
                        is_named && faults.resets + faults.stalls > 0,
                        "seed {seed}: {fault}, {faults:?}"
                    );
                    unrendered += 1;
                }
            }
            repaired.add(&outcome.bytes);
            given_up += outcome.given_up;
            runs += 1;
        }
        println!(
            "{complete} of {runs} runs complete, {given_up} cards given up, {unrendered} runs with tiles at which cards crash; repaired: {repaired:?}"
        );
        assert!(4 * complete > 3 * runs, "only {complete} of {runs} runs ended in the picture");
        if runs > 50 {
            assert!(repaired.line.damaged > 0 && repaired.line.repeated > 0 && repaired.resets > 0);
        }
    });
}

/// Cards are lost with gathers of several tiles in their queues, before, amid and after drains.
#[test]
fn queues_that_fill_within_a_tile_end_in_the_same_picture() {
    with_room_for_a_card(|| {
        for (number, crowded) in Fixture::crowded().iter().enumerate() {
            let expected = Run::new(&crowded.in_sequence(), 1, 0).go();
            let (mut complete, mut lost, mut runs) = (0, 0, 0);
            for seed in seeds(1..40) {
                let faults = Faults::of(&mut Random(hash(seed ^ 0xc0de)));
                let outcome = Run { faults, ..Run::new(crowded, 1 + seed as usize % 4, seed) }.go();
                for (id, tile) in &outcome.tiles {
                    assert!(
                        tile.pixels().eq(expected.tiles[id].pixels()),
                        "frame {number}, seed {seed}: tile {id}"
                    );
                }
                let is_complete = outcome.end == End::Complete;
                assert!(
                    !is_complete || outcome.pixels == expected.pixels,
                    "frame {number}, seed {seed}: pixels"
                );
                complete += u32::from(is_complete);
                lost += u32::from(outcome.bytes.resets > 0);
                runs += 1;
            }
            assert!(
                2 * complete > runs && (lost > 0 || runs < 20),
                "{complete} of {runs} complete, {lost} lost"
            );
        }
    });
}

/// Steps a card on its own until the picture is complete. Returns the pixels, and the counters of the tiles.
fn complete_alone(run: &Run, station: &mut Station, random: &mut Random) -> (Vec<PixelValue>, Counters) {
    let film = Mutex::new(run.fixture.film());
    let dispatcher = Dispatcher::new(run.fixture.scheduler(1, None, 0), vec![&film]);
    let mut step = 0;
    while !dispatcher.scheduler().is_complete() {
        station.step(run, &dispatcher, step, random).unwrap();
        step += 1;
        assert!(
            step < MAX_STEPS && station.is_used(),
            "the card is not greeted again: {:?}",
            station.given_up
        );
    }
    let counters = dispatcher.scheduler().counters();
    drop(dispatcher);
    (film.into_inner().unwrap().pixels().collect(), counters)
}

/// The card is reset while the host is busy with something else, before there is a job.
#[test]
fn a_card_that_is_reset_before_the_start_is_greeted_again() {
    with_room_for_a_card(|| {
        let fixture = Fixture::new();
        let alone = Run::new(&fixture, 1, 0).go();
        let random = &mut Random(7);
        let run = Run::new(&fixture, 1, 7);
        let mut station = Station::new(0, &fixture, random);
        let dispatcher = Dispatcher::new(fixture.scheduler(1, None, 0), Vec::new());
        // Greets, without starting.
        station.started = true;
        let mut step = 0;
        while station.session.budget().is_none() {
            station.step(&run, &dispatcher, step, random).unwrap();
            step += 1;
        }
        station.card = fixture.card();
        station.started = false;
        assert!(Some(complete_alone(&run, &mut station, random).0) == alone.pixels);
        assert_eq!(station.session.link_bytes().resets, 1);
    });
}

#[test]
fn tiles_at_which_every_card_crashes_are_named_when_all_others_are_done() {
    with_room_for_a_card(|| {
        let [.., in_rounds, _] = Fixture::crowded();
        for fixture in [Fixture::new(), in_rounds] {
            are_named_when_all_others_are_done(&fixture);
        }
    });
}

fn are_named_when_all_others_are_done(fixture: &Fixture) {
    let alone = Run::new(fixture, 1, 0).go();
    for seed in 0..20 {
        let cards = 1 + seed as usize % 4;
        let poison: Vec<u32> = [[3, 4].as_slice(), &[0, 1, 9], &[15]][seed as usize % 3].to_vec();
        let outcome = Run { poison: poison.clone(), ..Run::new(fixture, cards, seed) }.go();
        let End::Fault(SchedulerError::Unrendered { tiles }) = outcome.end else {
            panic!("seed {seed}: {:?}", outcome.end);
        };
        let mut named: Vec<u32> = tiles.iter().map(|tile| tile.id).collect();
        named.sort_unstable();
        assert_eq!(named, poison, "seed {seed}");
        assert_eq!(outcome.tiles.len() + poison.len(), alone.tiles.len(), "seed {seed}: others are missing");
        assert!(outcome.tiles.iter().all(|(id, tile)| *tile == alone.tiles[id]), "seed {seed}");
        assert_eq!(outcome.given_up, 0, "seed {seed}: a card is given up for a tile's fault");
        assert!(outcome.bytes.resets <= 7 * poison.len() as u64, "seed {seed}: {:?}", outcome.bytes);
    }
}

/// The card holds a session of another host with the session number that this host draws.
#[test]
fn a_session_number_that_the_card_holds_is_another_after_a_while() {
    with_room_for_a_card(|| {
        let fixture = Fixture::new();
        let alone = Run::new(&fixture, 1, 0).go();
        let mut resets = 0;
        for (seed, moment) in [(1, 50), (2, 3000), (3, 40_000)] {
            let random = &mut Random(seed);
            let run = Run::new(&fixture, 1, seed);
            let mut station = Station::new(0, &fixture, random);
            station.session = Session::new(77, Duration::ZERO);
            let other = Dispatcher::new(fixture.scheduler(1, None, 0), Vec::new());
            for step in 0..moment {
                station.step(&run, &other, step, random).unwrap();
            }
            station.session = Session::new(77, Duration::ZERO);
            station.started = false;
            assert!(Some(complete_alone(&run, &mut station, random).0) == alone.pixels, "seed {seed}");
            assert!(station.session.link_bytes().resets <= 1, "seed {seed}");
            resets += station.session.link_bytes().resets;
        }
        assert!(resets >= 2, "the card has not held the session");
    });
}
