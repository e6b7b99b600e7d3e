//! A card that stays open between frames: it renders what a new card does, and receives what it lacks.

use std::sync::Mutex;

use photoncard_driver::dispatcher::Dispatcher;
use photoncard_firmware::sampler::hash;
use photoncard_shared::address::LINE_BYTES;

use super::conditions::Run;
use super::line::{Faults, Random};
use super::station::Station;
use super::world::Fixture;
use super::{complete_alone, seeds, with_room_for_a_card};

/// Seeds of the runs, each of which renders several frames on one card.
const SEEDS: u32 = 24;
const FRAMES: usize = 5;

/// Event between two frames.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Between {
    Nothing,
    /// The next frame begins in the middle of the last one.
    Interruption,
    /// The card is switched off and on.
    Reset,
    /// A line that both images have is damaged in the card's memory.
    Damage,
    /// The line damages, loses and repeats bytes.
    BadLine,
}

const ALL: [Between; 5] =
    [Between::Nothing, Between::Interruption, Between::Reset, Between::Damage, Between::BadLine];

/// Indices of the lines of the second image that the first has too, and of those that differ.
fn lines(before: &Fixture, after: &Fixture) -> [Vec<usize>; 2] {
    let [before, after] = [before, after].map(|fixture| fixture.upload.lines());
    (0..after.len()).partition::<Vec<_>, _>(|&line| before.get(line) == after.get(line)).into()
}

/// Begins a frame: steps the card a random number of times.
fn begin(station: &mut Station, run: &Run, random: &mut Random) {
    station.started = false;
    let film = Mutex::new(run.fixture.film());
    let dispatcher = Dispatcher::new(run.fixture.scheduler(1, None, 0), vec![&film]);
    for step in 0..random.below(4000) as u64 {
        station.step(run, &dispatcher, step, random).unwrap();
    }
}

#[test]
fn a_kept_card_renders_what_a_new_one_does_and_receives_the_changed_lines() {
    with_room_for_a_card(|| {
        let [mut unchanged, mut changed, mut damaged] = [0; 3];
        for seed in seeds(0..SEEDS) {
            let random = &mut Random(hash(seed));
            let mut fixture = Fixture::new();
            let mut station = Station::new(0, &fixture, random);
            complete_alone(&Run::new(&fixture, 1, seed), &mut station, random);
            for _ in 0..FRAMES {
                let between = ALL[random.below(ALL.len())];
                if between == Between::Interruption {
                    let interrupted = fixture.changed(random);
                    begin(&mut station, &Run::new(&interrupted, 1, seed), random);
                    fixture = interrupted;
                }
                let next = fixture.changed(random);
                let mut run = Run::new(&next, 1, seed);
                let [same, others] = lines(&fixture, &next);
                match between {
                    Between::Reset => station.reset_card(&run),
                    Between::Damage if !others.is_empty() => {
                        station.card.memory().damage(same[random.below(same.len())]);
                    }
                    Between::BadLine => {
                        run.faults = Faults { stalls: 0, resets: 0, deaths: 0, ..Faults::of(random) }
                    }
                    _ => {}
                }
                let before = station.session.link_bytes().image;
                station.started = false;
                let (pixels, _) = complete_alone(&run, &mut station, random);
                let alone = Run::new(&next, 1, 0).go();
                assert!(alone.pixels == Some(pixels), "seed {seed}: other pixels after {between:?}");
                let sent = station.session.link_bytes().image - before;
                let lacking = (others.len() * LINE_BYTES) as u64;
                match between {
                    Between::Nothing | Between::BadLine => {
                        assert_eq!(sent, lacking, "seed {seed}: {between:?}");
                        unchanged += u32::from(sent == 0);
                        changed += u32::from(sent > 0);
                    }
                    Between::Damage if lacking > 0 => {
                        assert!(sent > lacking, "seed {seed}: damage was not noticed");
                        damaged += 1;
                    }
                    _ => {}
                }
                fixture = next;
            }
        }
        assert!(unchanged > 2 && changed > 2 && damaged > 2, "{unchanged} {changed} {damaged}");
    });
}

/// Passes on one card whose memory has no room for all irradiance records, now and then with another camera.
#[test]
fn passes_on_a_kept_card_are_those_on_a_new_one() {
    with_room_for_a_card(|| {
        let [mut gathered, mut kept] = [0; 2];
        for seed in seeds(0..SEEDS) {
            let random = &mut Random(hash(!seed));
            let mut fixture = Fixture::new().of_passes();
            let mut station = Station::new(0, &fixture, random);
            for _ in 0..FRAMES {
                let mut run = Run::new(&fixture, 1, seed);
                let between = ALL[random.below(ALL.len())];
                match between {
                    Between::Interruption => begin(&mut station, &run, random),
                    Between::Reset => station.reset_card(&run),
                    Between::BadLine => {
                        run.faults = Faults { stalls: 0, resets: 0, deaths: 0, ..Faults::of(random) }
                    }
                    Between::Nothing | Between::Damage => {}
                }
                station.started = false;
                let (pixels, work) = complete_alone(&run, &mut station, random);
                let alone = Run::new(&fixture, 1, 0).go();
                assert!(alone.pixels == Some(pixels), "seed {seed}: other pixels after {between:?}");
                assert_eq!(work.records + work.kept_records, alone.counters.records, "seed {seed}");
                gathered += work.records;
                kept += work.kept_records;
                let samples = 1 + random.below(2) as u32;
                let is_other = random.below(4) == 0;
                fixture = if is_other { fixture.changed(random) } else { fixture.next_pass(samples) };
            }
        }
        assert!(gathered > 100 && kept > 100, "{gathered} {kept}");
    });
}
