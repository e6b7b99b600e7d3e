//! Session of a relay with one of its cards: the commands come from the relay's own host, and the answers are
//! events. Tiles are given as in other sessions.

use std::sync::Arc;
use std::time::Duration;

use photoncard_shared::address::Line;
use photoncard_shared::message::{Command, FrameParameters, OPERAND_BYTES, Reply};

use super::clock::Failures;
use super::job::State;
use super::self_test::Request;
use super::{Event, Job, PixelLimits, Session, SessionError, Upload};

impl Session {
    /// Creates a session with a card of a relay, which starts with a greeting. The first reset of the card,
    /// and the first time limit that it exceeds, are errors: the relay has no card image to load again.
    pub fn relayed(number: u32, now: Duration) -> Self {
        Self { is_relayed: true, failures: Failures::none_allowed(), ..Self::new(number, now) }
    }

    /// Returns whether the card has answered the greeting.
    pub fn is_greeted(&self) -> bool {
        self.state != State::Greeting
    }

    /// Number of lines that the card had written when it was greeted.
    pub fn written_lines(&self) -> u32 {
        self.comparison.written()
    }

    /// Number of tiles that the card has not answered.
    pub fn tiles(&self) -> usize {
        self.tiles.len()
    }

    /// Number of commands that wait for room in the send window.
    pub fn waiting_commands(&self) -> usize {
        self.channel.waiting()
    }

    /// Number of messages delivered in both directions, modulo 2^16.
    pub fn passed(&self) -> u16 {
        self.channel.transport.passed()
    }

    /// Forwards a command to a relayed card. The card must have answered all commands before that have an
    /// answer, except tiles. Commands that drop tiles drop those of this session. `Hello` and `RenderTile`
    /// are not forwarded.
    pub fn forward(&mut self, command: &Command, now: Duration) {
        if !self.is_waiting() {
            self.clock.rest(now);
        }
        match *command {
            Command::Hello { .. } | Command::RenderTile(_) => return,
            Command::ReadChecksums { first, count } => {
                self.request = Request::Checksums { first, count };
                self.state = State::Comparing;
            }
            Command::BeginImage { .. } => self.drop_tiles(State::Loading),
            Command::EndImage => self.state = State::Accepting,
            Command::BeginFrame(frame) => {
                self.drop_tiles(State::Framing);
                self.job = Some(job_of(frame));
            }
            Command::Compute { operands } => {
                self.request = Request::Compute(operands.len() / OPERAND_BYTES);
                self.state = State::Testing;
            }
            Command::TestMemory => {
                self.drop_tiles(State::Testing);
                self.request = Request::Memory(None);
            }
            Command::WriteLines { .. } | Command::Flush => {}
        }
        self.send(command);
    }

    fn drop_tiles(&mut self, state: State) {
        self.channel.drop_commands();
        self.stale_replies += std::mem::take(&mut self.tiles).most_replies();
        self.is_flushed = false;
        self.job = None;
        self.state = state;
    }

    /// Processes a reply that only a relayed card gives. Returns false if it is another one.
    pub(super) fn take_relayed(&mut self, reply: &Reply) -> Result<bool, SessionError> {
        if !self.is_relayed {
            return Ok(false);
        }
        let event = match (self.state, *reply) {
            (state, Reply::Pixels { .. } | Reply::TileDone { .. })
                if state != State::Rendering && self.stale_replies > 0 =>
            {
                self.stale_replies -= 1;
                return Ok(true);
            }
            (State::Comparing, Reply::Checksums { first, data }) => match self.request {
                Request::Checksums { first: asked, count }
                    if first == asked && data.len() == 8 * count as usize =>
                {
                    Event::Checksums(data.to_vec())
                }
                _ => return Err(SessionError::Unexpected("checksums that were not asked for")),
            },
            (State::Accepting, Reply::ImageAccepted) => Event::ImageAccepted,
            (State::Accepting | State::Framing, Reply::Fault(fault)) => Event::Refused(fault),
            _ => return Ok(false),
        };
        self.events.push_back(event);
        self.state = State::Ready;
        Ok(true)
    }
}

/// Job of a card that has its card image already. The relay's host checks the pixels.
fn job_of(frame: FrameParameters) -> Job {
    let upload = Arc::new(Upload::new(Arc::new(Vec::<Line>::new())));
    Job { upload, frame, limits: PixelLimits::unchecked(&frame) }
}
