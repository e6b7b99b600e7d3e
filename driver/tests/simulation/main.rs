//! Whatever befalls cards and links, a render ends in the same picture, or in a clear error when no card is left: real
//! sessions, real cards, and links whose every step and fault a seed decides, in one thread and in virtual time.
//!
//! A seed that fails is run again alone by `PHOTONCARD_SEEDS=SEED cargo test -p photoncard-driver --test simulation`, many
//! by `PHOTONCARD_SEEDS=1..10000`.

mod conditions;
mod line;
mod run;
mod station;
mod world;

use std::ops::Range;
use std::time::Duration;

use photoncard_driver::session::{LinkBytes, Session};
use photoncard_firmware::sampler::hash;

use self::conditions::Run;
use self::line::{Faults, Random};
use self::run::MOST_STEPS;
use self::station::Station;
use self::world::Fixture;

/// Runs of each test, if nothing else is asked for.
const SEEDS: Range<u32> = 1..300;
/// The seeds to run: those that are asked for.
fn seeds() -> Range<u32> {
    let Ok(asked) = std::env::var("PHOTONCARD_SEEDS") else { return SEEDS };
    let number = |text: &str| text.parse().expect("PHOTONCARD_SEEDS is a seed, or the first..past the last");
    match asked.split_once("..") {
        Some((first, end)) => number(first)..number(end),
        None => number(&asked)..number(&asked) + 1,
    }
}

/// Does some work on a thread with room on its stack for a card's buffers, which are built there.
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
        for seed in seeds() {
            let cards = 1 + seed as usize % 5;
            let delayed = Run::new(&fixture, cards, seed).go();
            assert!(delayed.pixels == alone.pixels, "seed {seed}: other pixels on {cards} cards");
            assert_eq!(delayed.counters, alone.counters, "seed {seed}: other work on {cards} cards");
            let line = delayed.bytes.line;
            assert_eq!((line.repeated, line.damaged, delayed.bytes.resets), (0, 0, 0), "seed {seed}");
            shared += u32::from(delayed.working > 1);
            runs += 1;
        }
        // Delays may leave all to one card, but not as a rule.
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
fn faults_end_in_the_same_picture_or_with_no_card_left() {
    with_room_for_a_card(|| {
        let fixture = Fixture::new();
        let alone = Run::new(&fixture, 1, 0).go();
        let mut repaired = LinkBytes::default();
        let (mut complete, mut runs, mut given_up) = (0, 0, 0);
        for seed in seeds() {
            let cards = 1 + seed as usize % 8;
            let faults = Faults::of(&mut Random(hash(!seed)));
            let outcome = Run { faults, ..Run::new(&fixture, cards, seed) }.go();
            if faults.stalls + faults.resets + faults.deaths == 0 {
                assert!(outcome.pixels.is_some(), "seed {seed}: bad lines end the render, {faults:?}");
                assert_eq!(outcome.given_up, 0, "seed {seed}: sound cards are given up, {faults:?}");
            }
            match outcome.pixels {
                Some(pixels) => {
                    assert!(Some(pixels) == alone.pixels, "seed {seed}: other pixels, {faults:?}");
                    complete += 1;
                }
                None => assert!(
                    faults.deaths + faults.stalls > 0 || outcome.given_up > 0,
                    "seed {seed}: no card is left that never stopped, {faults:?}"
                ),
            }
            repaired.add(&outcome.bytes);
            given_up += outcome.given_up;
            runs += 1;
        }
        println!("{complete} of {runs} runs complete, {given_up} cards given up; repaired: {repaired:?}");
        assert!(4 * complete > 3 * runs, "only {complete} of {runs} runs ended in the picture");
        if runs > 50 {
            assert!(repaired.line.damaged > 0 && repaired.line.repeated > 0 && repaired.resets > 0);
        }
    });
}

/// The card is reset while the host is busy with something else, before there is a job.
#[test]
fn a_card_that_is_reset_before_the_start_is_greeted_again() {
    with_room_for_a_card(|| {
        let fixture = Fixture::new();
        let alone = Run::new(&fixture, 1, 0).go();
        let random = &mut Random(7);
        let run = Run::new(&fixture, 1, 7);
        let mut station = Station::new(&fixture, random);
        let picture = fixture.picture();
        // Greets, without starting.
        station.started = true;
        let mut step = 0;
        while station.session.budget().is_none() {
            station.step(&run, &picture, step, random);
            step += 1;
        }
        station.card = fixture.card();
        station.started = false;
        while !picture.scheduler().is_complete() {
            station.step(&run, &picture, step, random);
            step += 1;
            assert!(step < MOST_STEPS && !station.is_lost, "the card is not greeted again");
        }
        assert!(Some(picture.film().pixels().to_vec()) == alone.pixels);
        assert_eq!(station.session.link_bytes().resets, 1);
    });
}

#[test]
fn a_tile_that_crashes_every_card_ends_the_render() {
    with_room_for_a_card(|| {
        let fixture = Fixture::new();
        for seed in 0..20 {
            let cards = 1 + seed as usize % 4;
            let outcome = Run { crashes: 8, ..Run::new(&fixture, cards, seed) }.go();
            assert!(outcome.pixels.is_none(), "seed {seed}: the last tiles were rendered");
            assert_eq!(outcome.given_up, cards, "seed {seed}");
            assert!(outcome.bytes.resets < 10 * cards as u64, "seed {seed}: {:?}", outcome.bytes);
        }
    });
}

/// The card holds a session of another host, of the number that this one draws.
#[test]
fn a_session_number_that_the_card_holds_is_another_after_a_while() {
    with_room_for_a_card(|| {
        let fixture = Fixture::new();
        let alone = Run::new(&fixture, 1, 0).go();
        let mut resets = 0;
        for (seed, moment) in [(1, 50), (2, 3000), (3, 40_000)] {
            let random = &mut Random(seed);
            let run = Run::new(&fixture, 1, seed);
            let mut station = Station::new(&fixture, random);
            station.session = Session::new(77, Duration::ZERO);
            let other = fixture.picture();
            for step in 0..moment {
                station.step(&run, &other, step, random);
            }
            station.session = Session::new(77, Duration::ZERO);
            station.started = false;
            let picture = fixture.picture();
            let mut step = 0;
            while !picture.scheduler().is_complete() {
                station.step(&run, &picture, step, random);
                step += 1;
                let is_used = !station.is_lost && station.given_up.is_none();
                assert!(step < MOST_STEPS && is_used, "seed {seed}: {:?}", station.given_up);
            }
            assert!(Some(picture.film().pixels().to_vec()) == alone.pixels, "seed {seed}");
            assert!(station.session.link_bytes().resets <= 1, "seed {seed}");
            resets += station.session.link_bytes().resets;
        }
        assert!(resets >= 2, "the card has not held the session");
    });
}
