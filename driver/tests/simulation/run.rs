//! A run, from cards that were just switched on to the picture, or to no card that is left.

use photoncard_driver::film::PixelValue;
use photoncard_driver::session::LinkBytes;
use photoncard_firmware::sampler::hash;
use photoncard_shared::counters::Counters;

use crate::conditions::Run;
use crate::line::Random;
use crate::station::{Health, Station};

/// Steps of a run after which it is taken for stuck.
pub(crate) const MOST_STEPS: u64 = 20_000_000;

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

impl Run<'_> {
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
