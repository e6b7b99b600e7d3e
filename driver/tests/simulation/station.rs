//! A card, its link and its session, and what befalls them.

use std::time::Duration;

use photoncard_driver::session::{Picture, Session, SessionError};
use photoncard_firmware::card::MicroCard;

use crate::line::{Queue, Random};
use crate::run::Run;
use crate::world::{Fixture, Memory};

/// Virtual time of a step.
const STEP: Duration = Duration::from_micros(100);
/// Turns of a chip for one step of its work: bytes go over a line in the meantime.
const TURNS_OF_CHIP: usize = 8;

/// How a card is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Health {
    Well,
    /// It does nothing before this step.
    Stalled(u64),
    /// It does nothing any more.
    Dead,
}

/// A card, its link and its session.
pub(crate) struct Station<'a> {
    pub(crate) card: Box<MicroCard<Memory>>,
    pub(crate) session: Session<'a>,
    /// Whether it has been silent for too long, and has not been loaded since.
    pub(crate) is_lost: bool,
    /// Why it is used no more.
    pub(crate) given_up: Option<SessionError>,
    pub(crate) health: Health,
    pub(crate) started: bool,
    to_card: Queue,
    to_host: Queue,
    /// Bytes that move in one step at most.
    burst: usize,
    /// How often this card gets a step.
    pub(crate) speed: usize,
}

impl<'a> Station<'a> {
    pub(crate) fn new(fixture: &Fixture, random: &mut Random) -> Self {
        Self {
            card: fixture.card(),
            session: Session::new(random.below(1 << 16) as u32, Duration::ZERO),
            is_lost: false,
            given_up: None,
            health: Health::Well,
            started: false,
            to_card: Queue::new(random),
            to_host: Queue::new(random),
            burst: 1 << random.below(12),
            speed: 1 << random.below(6),
        }
    }

    /// One step of the host, of the card or of its chip: whichever the seed says.
    pub(crate) fn step(&mut self, run: &Run<'a>, picture: &Picture, step: u64, random: &mut Random) {
        let bytes = 1 + random.below(self.burst);
        let now = STEP * u32::try_from(step).unwrap_or(u32::MAX);
        let what = random.below(5);
        if what < 2 {
            if self.given_up.is_none() {
                self.step_of_host(run, picture, (now, bytes, what), random);
            }
            return;
        }
        self.befall(run, step, random);
        if run.is_crash(picture) && self.session.is_loaded() && self.card.is_busy() {
            self.reset_card(run);
        }
        if self.health != Health::Well {
            return;
        }
        match what {
            2 => {
                let received = self.to_card.pop(bytes);
                if received.is_empty() {
                    self.card.acknowledge();
                }
                self.card.feed(&received);
            }
            3 => {
                let sent = self.to_host.push(self.card.outgoing(), bytes, &run.faults, random);
                self.card.sent(sent);
            }
            _ if random.below(TURNS_OF_CHIP) == 0 => self.card.work(),
            _ => {}
        }
    }

    fn step_of_host(
        &mut self,
        run: &Run<'a>,
        picture: &Picture,
        (now, bytes, what): (Duration, usize, usize),
        random: &mut Random,
    ) {
        let session = &mut self.session;
        if session.budget().is_some() && !self.started {
            session.start(run.fixture.job(), now);
            self.started = true;
        }
        let result = if what == 0 {
            session.prepare(picture);
            let sent = self.to_card.push(session.outgoing(), bytes, &run.faults, random);
            session.sent(sent, now);
            Ok(())
        } else {
            let received = self.to_host.pop(bytes);
            if received.is_empty() {
                session.acknowledge();
            }
            session.receive(&received, picture, now).and_then(|()| session.tick(picture, now))
        };
        let result = result.or_else(|error| {
            self.is_lost = true;
            if !error.may_pass() {
                return Err(error);
            }
            session.greet_again(picture, now);
            Ok(())
        });
        if let Err(error) = result {
            assert!(matches!(error, SessionError::Failures(_)), "seed {}: {error}", run.seed);
            session.give_back(picture);
            self.given_up = Some(error);
        } else if session.is_loaded() {
            self.is_lost = false;
        }
    }

    /// What happens to the card in a step of its own.
    fn befall(&mut self, run: &Run, step: u64, random: &mut Random) {
        if self.health == Health::Dead {
            return;
        }
        if random.happens(run.faults.deaths) {
            self.health = Health::Dead;
        } else if random.happens(run.faults.resets) {
            self.reset_card(run);
        } else if random.happens(run.faults.stalls) {
            // Half of them for longer than the host waits.
            self.health = Health::Stalled(step + random.below(200_000) as u64);
        } else if matches!(self.health, Health::Stalled(until) if until <= step) {
            self.health = Health::Well;
        }
    }

    /// The card forgets all, what its end of the line holds too.
    pub(crate) fn reset_card(&mut self, run: &Run) {
        self.card = run.fixture.card();
        self.to_card.bytes.clear();
    }
}
