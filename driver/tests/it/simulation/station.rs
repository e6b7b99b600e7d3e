//! A card with its link, its session and its faults.

use std::time::Duration;

use photoncard_driver::dispatcher::Dispatcher;
use photoncard_driver::emulator::Emulated;
use photoncard_driver::scheduler::{CardNumber, SchedulerError, Standing};
use photoncard_driver::session::{Restart, Session, SessionError};
use photoncard_firmware::card::Card;
use photoncard_shared::frame::{Frame, FrameReader};
use photoncard_shared::message::{self, Command};

use super::conditions::Run;
use super::liar::Voice;
use super::line::{Queue, Random};
use super::world::{Fixture, IN_FLIGHT, Memory};

/// Virtual time of a step.
const STEP: Duration = Duration::from_micros(100);
/// Mean number of times that a chip is selected per step of its work. Bytes move over the line in the
/// meantime.
const TURNS_OF_CHIP: usize = 8;

/// Condition of a card.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Health {
    Well,
    /// Inactive until this step.
    Stalled(u64),
    /// Inactive for ever.
    Dead,
}

/// Card with its link and its session.
pub(crate) struct Station {
    pub(crate) number: CardNumber,
    pub(crate) card: Box<Card<Emulated, Memory>>,
    pub(crate) session: Session,
    /// True from the loss of the card until it is loaded again.
    pub(crate) is_lost: bool,
    /// Error for which the card was given up.
    pub(crate) given_up: Option<SessionError>,
    pub(crate) health: Health,
    pub(crate) started: bool,
    /// `n` if the card does one of `n` steps of its work on tiles; `None` if it does none.
    pub(crate) diligence: Option<usize>,
    pub(crate) voice: Voice,
    /// Parser of commands that reach the card.
    commands: FrameReader,
    /// Tiles that the card has received and not completed, the oldest first.
    tiles: Vec<u32>,
    to_card: Queue,
    to_host: Queue,
    /// Maximum number of bytes that move in one step.
    burst: usize,
    /// Relative frequency of this card's steps.
    pub(crate) speed: usize,
}

impl Station {
    pub(crate) fn new(number: CardNumber, fixture: &Fixture, random: &mut Random) -> Self {
        Self {
            number,
            card: fixture.card(),
            session: Session::new(random.below(1 << 16) as u32, Duration::ZERO),
            is_lost: false,
            given_up: None,
            health: Health::Well,
            started: false,
            diligence: Some(1),
            voice: Voice::new(),
            commands: FrameReader::new(),
            tiles: Vec::new(),
            to_card: Queue::new(random),
            to_host: Queue::new(random),
            burst: 1 << random.below(12),
            speed: 1 << random.below(6),
        }
    }

    /// Returns whether the card may still render a tile.
    pub(crate) fn is_used(&self) -> bool {
        !self.is_lost && self.given_up.is_none()
    }

    /// One step of the host, of the card or of its chip, as the seed selects.
    pub(crate) fn step(
        &mut self,
        run: &Run,
        dispatcher: &Dispatcher,
        step: u64,
        random: &mut Random,
    ) -> Result<(), SchedulerError> {
        let bytes = 1 + random.below(self.burst);
        let now = STEP * u32::try_from(step).unwrap_or(u32::MAX);
        let what = random.below(5);
        if what < 2 {
            let is_used = self.given_up.is_none();
            return if is_used {
                self.step_of_host(run, dispatcher, (now, bytes, what), random)
            } else {
                Ok(())
            };
        }
        self.befall(run, step, random);
        let is_at_work = self.session.is_loaded() && self.card.is_busy();
        let mut in_flight = self.tiles.iter().take(IN_FLIGHT as usize);
        if is_at_work && in_flight.any(|tile| run.poison.contains(tile)) {
            self.reset_card(run);
        }
        if self.health == Health::Well {
            self.step_of_card(run, (bytes, what), random);
        }
        Ok(())
    }

    fn step_of_card(&mut self, run: &Run, (bytes, what): (usize, usize), random: &mut Random) {
        match what {
            2 => {
                let received = self.to_card.pop(bytes);
                if received.is_empty() {
                    self.card.acknowledge();
                }
                self.note_tiles(&received);
                self.card.feed(&received);
            }
            3 => {
                let outgoing = self.card.outgoing();
                self.voice.hear(outgoing);
                let count = outgoing.len();
                self.card.sent(count);
                let done = std::mem::take(&mut self.voice.done);
                self.tiles.retain(|tile| !done.contains(tile));
                let sent = self.to_host.push(&self.voice.said, bytes, &run.faults, random);
                self.voice.said.drain(..sent);
            }
            _ if random.below(TURNS_OF_CHIP) != 0 => {}
            _ => {
                let is_rendering = !self.tiles.is_empty();
                let works = self.diligence.is_some_and(|one_of| random.below(one_of) == 0);
                if works || !is_rendering {
                    self.card.work();
                }
            }
        }
    }

    /// Records the tiles that reach the card.
    fn note_tiles(&mut self, mut bytes: &[u8]) {
        while !bytes.is_empty() {
            let (taken, frame) = self.commands.read(bytes);
            bytes = &bytes[taken..];
            let Some(Ok(Frame { payload, .. })) = frame else { continue };
            match message::decode::<Command>(payload) {
                Some(Command::RenderTile(tile)) if !self.tiles.contains(&tile.id) => self.tiles.push(tile.id),
                Some(Command::Hello { .. } | Command::BeginImage { .. } | Command::BeginFrame(_)) => {
                    self.tiles.clear();
                }
                _ => {}
            }
        }
    }

    fn step_of_host(
        &mut self,
        run: &Run,
        dispatcher: &Dispatcher,
        (now, bytes, what): (Duration, usize, usize),
        random: &mut Random,
    ) -> Result<(), SchedulerError> {
        let Self { number, session, .. } = self;
        if session.budget().is_some() && !self.started {
            session.start(run.fixture.job(), now);
            self.started = true;
        }
        let result = dispatcher.check_card(*number).and_then(|()| {
            if what == 0 {
                dispatcher.supply(*number, session, now);
                session.prepare();
                let sent = self.to_card.push(session.outgoing(), bytes, &run.faults, random);
                session.sent(sent, now);
                return Ok(());
            }
            let received = self.to_host.pop(bytes);
            if received.is_empty() {
                session.acknowledge();
            }
            let slowest = dispatcher.scheduler().slowest(*number);
            session.receive(&received, now).and_then(|()| session.tick(slowest, now))
        });
        dispatcher.collect(*number, session, now)?;
        self.is_lost &= !session.is_loaded();
        let Err(error) = result else { return Ok(()) };
        self.recover(error, run, dispatcher, now)
    }

    /// Handles an error like a render.
    fn recover(
        &mut self,
        error: SessionError,
        run: &Run,
        dispatcher: &Dispatcher,
        now: Duration,
    ) -> Result<(), SchedulerError> {
        if error.is_wrong() {
            assert!(self.voice.lie.is_some(), "seed {}: an honest card lies: {error}", run.seed);
            dispatcher.distrust(self.number, error.lie());
        }
        if error.may_pass() {
            self.is_lost = true;
            self.session.restart(Restart::Lost, now);
        } else {
            self.session.give_back();
        }
        dispatcher.collect(self.number, &mut self.session, now)?;
        let standing = if error.may_pass() { Standing::Lost } else { Standing::GivenUp };
        dispatcher.scheduler().set_standing(self.number, standing);
        if !error.may_pass() {
            let is_expected = error.is_wrong() || matches!(error, SessionError::Failures(_));
            assert!(is_expected, "seed {}: {error}", run.seed);
            self.given_up = Some(error);
        }
        Ok(())
    }

    /// Faults of the card in a step of its own.
    fn befall(&mut self, run: &Run, step: u64, random: &mut Random) {
        if self.health == Health::Dead {
            return;
        }
        if random.happens(run.faults.deaths) {
            self.health = Health::Dead;
        } else if random.happens(run.faults.resets) {
            self.reset_card(run);
        } else if random.happens(run.faults.stalls) {
            // Half of them last longer than the host waits.
            self.health = Health::Stalled(step + random.below(200_000) as u64);
        } else if matches!(self.health, Health::Stalled(until) if until <= step) {
            self.health = Health::Well;
        }
    }

    /// Resets the card, which forgets everything, including its end of the line.
    pub(crate) fn reset_card(&mut self, run: &Run) {
        self.card = run.fixture.card();
        self.to_card.bytes.clear();
        self.tiles.clear();
        self.voice.said.clear();
    }
}
