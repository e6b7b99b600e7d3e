//! A run, from cards that were just switched on to the picture, or to no card that is left.

use photoncard_driver::film::PixelValue;
use photoncard_driver::session::{LinkBytes, Picture};
use photoncard_firmware::sampler::hash;
use photoncard_shared::counters::Counters;

use crate::line::{Faults, Random};
use crate::station::{Health, Station};
use crate::world::Fixture;

/// Steps of a run after which it is taken for stuck.
pub(crate) const MOST_STEPS: u64 = 20_000_000;

/// A run.
pub(crate) struct Run<'a> {
    pub(crate) fixture: &'a Fixture,
    pub(crate) faults: Faults,
    pub(crate) cards: usize,
    /// Cards, the first ones, that never do anything.
    pub(crate) stopped: usize,
    /// The tiles, the last ones to be rendered, at which every card crashes.
    pub(crate) crashes: usize,
    pub(crate) seed: u32,
}

/// What came of a run.
pub(crate) struct Outcome {
    /// `None` if no card was left.
    pub(crate) pixels: Option<Vec<PixelValue>>,
    /// Of all cards.
    pub(crate) counters: Counters,
    pub(crate) bytes: LinkBytes,
    /// Cards that rendered a tile.
    pub(crate) working: usize,
    /// Cards that have failed too often.
    pub(crate) given_up: usize,
}

impl<'a> Run<'a> {
    pub(crate) fn new(fixture: &'a Fixture, cards: usize, seed: u32) -> Self {
        Self { fixture, faults: Faults::default(), cards, stopped: 0, crashes: 0, seed }
    }

    /// Whether cards crash at the tiles that are left of a picture.
    pub(crate) fn is_crash(&self, picture: &Picture) -> bool {
        let (done, all) = picture.scheduler().progress();
        all - done <= self.crashes
    }

    pub(crate) fn go(&self) -> Outcome {
        let Self { fixture, cards, stopped, seed, .. } = *self;
        let random = &mut Random(hash(seed));
        let mut stations: Vec<_> = (0..cards).map(|_| Station::new(fixture, random)).collect();
        stations[..stopped].iter_mut().for_each(|station| station.health = Health::Dead);
        let picture = fixture.picture();
        let mut step = 0;
        while !picture.scheduler().is_complete() && stations.iter().any(|station| !station.is_lost) {
            let station = &mut stations[random.below(cards)];
            for _ in 0..station.speed {
                station.step(self, &picture, step, random);
            }
            step += 1;
            assert!(step < MOST_STEPS, "seed {seed}: {cards} cards have not ended, {:?}", self.faults);
        }
        let is_complete = picture.scheduler().is_complete();
        assert!(!is_complete || picture.film().is_complete(), "seed {seed}: pixels are missing");
        let mut outcome = Outcome {
            pixels: is_complete.then(|| picture.film().pixels().to_vec()),
            counters: Counters::ZERO,
            bytes: LinkBytes::default(),
            working: 0,
            given_up: 0,
        };
        for station in &stations {
            outcome.counters.add(station.session.counters());
            outcome.bytes.add(&station.session.link_bytes());
            outcome.working += usize::from(station.session.counters().eye_rays > 0);
            outcome.given_up += usize::from(station.given_up.is_some());
        }
        outcome
    }
}
