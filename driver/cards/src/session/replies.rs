//! Processes the card's replies: checks that each is valid in the session's state, and changes the state.

use photoncard_shared::budget::Budget;
use photoncard_shared::message::{Fault, FaultCode, Reply};

use super::error::check_budget;
use super::job::{BoardInfo, State};
use super::upload::Comparison;
use super::{Event, Session, SessionError};

impl Session {
    /// Processes a reply.
    ///
    /// # Errors
    /// If it reports a fault, or does not answer a request.
    pub(super) fn take(&mut self, reply: &Reply) -> Result<(), SessionError> {
        if self.take_relayed(reply)? {
            return Ok(());
        }
        match (self.state, *reply) {
            (State::Greeting, Reply::Hello { budget, written_lines, memory_use, build, board, .. }) => {
                build.clone_into(&mut self.build);
                self.memory_use = memory_use;
                self.board = board.map(BoardInfo::from);
                self.greet(budget, written_lines)?;
                self.comparison = Comparison::new(written_lines);
                if self.job.is_some() {
                    self.begin_load();
                }
                Ok(())
            }
            (State::Accepting, Reply::Fault(Fault { code: FaultCode::ImageChecksum, .. }))
                if self.load.is_change =>
            {
                // The card has written as many lines as the card image has.
                self.comparison = Comparison::new(self.upload_lines() as u32);
                self.begin_load();
                Ok(())
            }
            (_, Reply::Fault(fault @ Fault { code: FaultCode::Memory, .. })) => {
                Err(SessionError::Memory(fault))
            }
            (_, Reply::Fault(fault)) => Err(SessionError::Fault(fault)),
            (
                State::Loading | State::Accepting | State::Framing,
                Reply::Pixels { .. } | Reply::TileDone { .. },
            ) if self.stale_replies > 0 => {
                self.stale_replies -= 1;
                Ok(())
            }
            (State::Comparing, Reply::Checksums { first, data }) => {
                let Some(job) = &self.job else { return Ok(()) };
                self.comparison.compare(&job.upload, first, data)?;
                self.begin_load();
                Ok(())
            }
            (State::Accepting, Reply::ImageAccepted) => {
                self.failures.is_loaded(self.upload_lines() as u32);
                self.begin_frame();
                Ok(())
            }
            (State::Framing, Reply::FrameAccepted) => {
                self.state = State::Rendering;
                self.stale_replies = 0;
                self.events.push_back(Event::Ready);
                Ok(())
            }
            (State::Rendering, Reply::Pixels { tile, first, data }) => {
                let Some(job) = &self.job else { return Ok(()) };
                self.tiles.take_pixels(tile, first, data, &job.limits)?;
                self.channel.bytes.payload += data.len() as u64;
                Ok(())
            }
            (State::Rendering, Reply::TileDone { tile, counters }) => {
                let Some(job) = &self.job else { return Ok(()) };
                let finished = self.tiles.complete(tile, counters, &job.limits)?;
                self.events.push_back(Event::TileDone(finished));
                self.failures.completes_tile();
                Ok(())
            }
            (State::Testing, ref reply) => {
                let (event, is_last) = self.request.take(reply)?;
                self.events.push_back(event);
                if is_last {
                    self.state = State::Ready;
                }
                Ok(())
            }
            _ => Err(SessionError::Unexpected("not an answer to what was asked")),
        }
    }

    /// Accepts the card's hello if its budget is valid. Counts a failure if the hello reveals a reset.
    fn greet(&mut self, budget: Budget, written_lines: u32) -> Result<(), SessionError> {
        check_budget(&budget, self.budget.as_ref())?;
        if self.failures.says_hello(written_lines) && !self.left_suspect {
            self.failures.count()?;
        }
        self.budget = Some(budget);
        self.state = State::Ready;
        Ok(())
    }
}
