//! A run, from cards that were just switched on to the picture, or to the render's error.

use std::collections::HashMap;
use std::sync::Mutex;

use photoncard_driver::dispatcher::Dispatcher;
use photoncard_driver::film::PixelValue;
use photoncard_driver::scheduler::{CardNumber, SchedulerError, TileCounts};
use photoncard_driver::session::LinkBytes;
use photoncard_driver::sink::{FinishedTile, TileSink};
use photoncard_firmware::sampler::hash;
use photoncard_shared::counters::Counters;
use photoncard_shared::message::Tile;

use super::conditions::Run;
use super::line::Random;
use super::station::{Health, Station};

/// Number of steps after which a run counts as stuck.
pub(crate) const MAX_STEPS: u64 = 20_000_000;

/// End of a run.
#[derive(Debug, PartialEq)]
pub(crate) enum End {
    Complete,
    /// No card is left.
    NoCard,
    Fault(SchedulerError),
}

/// Outcome of a run.
pub(crate) struct Outcome {
    pub(crate) end: End,
    /// Pixels of the film, if it is complete.
    pub(crate) pixels: Option<Vec<PixelValue>>,
    /// Tiles in the sinks.
    pub(crate) tiles: HashMap<u32, FinishedTile>,
    /// Counters of the picture's tiles that do not depend on tiles in flight: [`work`].
    pub(crate) counters: Counters,
    pub(crate) counts: TileCounts,
    pub(crate) bytes: LinkBytes,
    /// Number of cards that rendered tiles of the picture.
    pub(crate) working: usize,
    /// Number of cards that have failed too often, or were outvoted.
    pub(crate) given_up: usize,
    /// Cards that were outvoted.
    pub(crate) caught: Vec<CardNumber>,
    /// Virtual time, in steps.
    pub(crate) steps: u64,
}

/// Counters without those that depend on the tiles that a chip has in flight together.
pub(crate) fn work(counters: Counters) -> Counters {
    Counters { drains: 0, most_waiting: 0, cycles: 0, ..counters }
}

/// Sink that records its tiles.
#[derive(Default)]
pub(crate) struct Ledger(Mutex<HashMap<u32, FinishedTile>>);

impl TileSink for Ledger {
    fn put(&self, tile: &FinishedTile) {
        let mut tile = tile.clone();
        tile.counters = work(tile.counters);
        let before = self.0.lock().unwrap().insert(tile.tile().id, tile);
        assert_eq!(before, None, "a tile is put twice");
    }

    fn revoke(&self, tile: &Tile) {
        assert!(self.0.lock().unwrap().remove(&tile.id).is_some(), "a tile is revoked that was not put");
    }
}

impl Run<'_> {
    /// Cards of the run, just switched on.
    fn stations(&self, random: &mut Random) -> Vec<Station> {
        let station = |number| {
            let mut station = Station::new(number, self.fixture, random);
            station.voice.lie = self.liars.get(&number).copied();
            station.diligence = self.lazy.get(&number).copied().unwrap_or(Some(1));
            station.health = if number < self.stopped { Health::Dead } else { Health::Well };
            station
        };
        (0..self.cards).map(station).collect()
    }

    pub(crate) fn go(&self) -> Outcome {
        let Self { fixture, cards, seed, .. } = *self;
        let random = &mut Random(hash(seed));
        let mut stations = self.stations(random);
        let (film, ledger) = (Mutex::new(fixture.film()), Ledger::default());
        let dispatcher = Dispatcher::new(fixture.scheduler(cards, self.verify, seed), vec![&film, &ledger]);
        let mut steps = 0;
        let end = loop {
            if dispatcher.scheduler().is_complete() {
                break End::Complete;
            }
            if !stations.iter().any(Station::is_used) {
                break End::NoCard;
            }
            let station = &mut stations[random.below(cards)];
            let result = (0..station.speed).try_for_each(|_| station.step(self, &dispatcher, steps, random));
            if let Err(fault) = result {
                break End::Fault(fault);
            }
            steps += 1;
            assert!(steps < MAX_STEPS, "seed {seed}: {cards} cards have not ended, {:?}", self.faults);
        };
        let scheduler = dispatcher.scheduler();
        let film = film.lock().unwrap();
        assert!(end != End::Complete || film.is_complete(), "seed {seed}: pixels are missing");
        let mut bytes = LinkBytes::default();
        stations.iter().for_each(|station| bytes.add(&station.session.link_bytes()));
        Outcome {
            pixels: (end == End::Complete).then(|| film.pixels().collect()),
            end,
            tiles: ledger.0.lock().unwrap().clone(),
            counters: work(scheduler.counters()),
            counts: scheduler.counts(),
            bytes,
            working: (0..cards).filter(|&card| scheduler.counters_of(card).eye_rays > 0).count(),
            given_up: stations.iter().filter(|station| station.given_up.is_some()).count(),
            caught: (0..cards).filter(|&card| scheduler.lie_of(card).is_some()).collect(),
            steps,
        }
    }
}
