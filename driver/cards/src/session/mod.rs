//! Host's end of a card's link: a state machine without I/O, whose inputs are bytes, tiles and a clock.
//!
//! A session greets the card, sends the parts of the card image that the card lacks, sets the frame, requests
//! tiles and checks their pixels. It reports [`Event`]s. A card that was reset is greeted and loaded again,
//! and its tiles are returned. Threads, ports, time, scheduler and sinks are outside: `photoncard_render`
//! runs one session per thread, and a simulator runs many sessions in one thread.

mod channel;
mod clock;
mod error;
mod job;
mod line_fault;
mod pixel_limits;
mod relayed;
mod replies;
mod self_test;
mod tiles;
mod upload;

pub use channel::LinkBytes;
pub use error::SessionError;
pub use job::{Assignment, BoardInfo, Event, Job, Restart};
pub use line_fault::LineFault;
pub use pixel_limits::PixelLimits;
pub use upload::Upload;
pub use upload::changed_runs;

use std::collections::VecDeque;
use std::time::Duration;

use photoncard_shared::budget::Budget;
use photoncard_shared::frame::{MAX_FRAME, MAX_PAYLOAD};
use photoncard_shared::message::{self, Command, Drain, MemoryUse, OPERAND_BYTES};
use photoncard_shared::transport::Event as LineEvent;

use self::channel::{Channel, HELLO};
use self::clock::{Clock, Failures};
use self::error::check_versions;
use self::job::State;
use self::line_fault::Evidence;
use self::self_test::Request;
use self::tiles::TilesInFlight;
use self::upload::{Comparison, Load};

/// Maximum number of unanswered tiles of a card, whatever its budget. If the card is lost, all of them are
/// delayed. Only a relay, which deals its tiles on to cards of its own, has room for more than some tens.
pub const MAX_CREDITS: u32 = 1024;

/// Session with one card.
pub struct Session {
    state: State,
    budget: Option<Budget>,
    build: String,
    memory_use: Option<MemoryUse>,
    board: Option<BoardInfo>,
    job: Option<Job>,
    comparison: Comparison,
    /// Checksum of the card image that the card is assumed to hold.
    assumed: Option<u64>,
    load: Load,
    /// True if the card's commands come from the host of a relay ([`Self::relayed`]).
    is_relayed: bool,
    /// Requested part of the self-test.
    request: Request,
    tiles: TilesInFlight,
    /// Maximum number of outstanding replies about tiles of an earlier frame.
    stale_replies: u64,
    events: VecDeque<Event>,
    channel: Channel,
    clock: Clock,
    failures: Failures,
    /// True if, when the card was last lost, it was working on a tile at which cards had crashed before.
    left_suspect: bool,
    /// True after [`Command::Flush`], until the next tile.
    is_flushed: bool,
    /// Number of bytes received since the session's last valid frame.
    unheard_bytes: u64,
    /// Bytes and frames received since the last message.
    evidence: Evidence,
}

impl Session {
    /// Creates a session, which starts with a greeting. `number` distinguishes its frames from those of other
    /// sessions on the line. Any value is valid.
    pub fn new(number: u32, now: Duration) -> Self {
        let mut session = Self {
            state: State::Greeting,
            budget: None,
            build: String::new(),
            memory_use: None,
            board: None,
            job: None,
            comparison: Comparison::default(),
            assumed: None,
            load: Load::default(),
            is_relayed: false,
            request: Request::Nothing,
            tiles: TilesInFlight::default(),
            stale_replies: 0,
            events: VecDeque::new(),
            channel: Channel::before(number),
            clock: Clock::new(now),
            failures: Failures::default(),
            left_suspect: false,
            is_flushed: false,
            unheard_bytes: 0,
            evidence: Evidence::default(),
        };
        session.restart(Restart::NewWork, now);
        session
    }

    /// Capacities of the card, as its hello states them; `None` before the hello.
    pub fn budget(&self) -> Option<&Budget> {
        self.budget.as_ref()
    }

    /// Name and version of the card's firmware; empty before its hello.
    pub fn build(&self) -> &str {
        &self.build
    }

    /// On-chip memory of the card's firmware; `None` before its hello, or if the card does not measure it.
    pub fn memory_use(&self) -> Option<MemoryUse> {
        self.memory_use
    }

    /// Board of the card; `None` before its hello, or if the card is no board.
    pub fn board(&self) -> Option<&BoardInfo> {
        self.board.as_ref()
    }

    /// Declares that the card's memory holds the card image with this checksum. The next load omits the lines
    /// that the card holds already, and the card checks the image like a received one.
    pub fn assume(&mut self, checksum: u64) {
        self.assumed = Some(checksum);
    }

    /// Sets the job of the card, which starts as soon as the card has answered the greeting. A card with an
    /// earlier job receives only the lines that it lacks, and unfinished work on that job is dropped.
    pub fn start(&mut self, job: Job, now: Duration) {
        self.clock.rest(now);
        self.events.clear();
        let before = self.job.replace(job);
        match (self.state, before) {
            (State::Greeting, _) => {}
            (State::Ready, _) => self.begin_load(),
            (State::Rendering, Some(before)) => self.go_on_from(&before.upload, now),
            _ => self.restart(Restart::NewWork, now),
        }
    }

    /// Continues with the job on a card that holds image `held` and may be working on tiles of an earlier
    /// frame.
    fn go_on_from(&mut self, held: &Upload, now: Duration) {
        let Some(job) = &self.job else { return };
        let Some(runs) = job.upload.missing_from(held.checksum()) else {
            return self.restart(Restart::NewWork, now);
        };
        let is_held = job.upload.checksum() == held.checksum();
        self.channel.drop_commands();
        self.stale_replies = std::mem::take(&mut self.tiles).most_replies();
        if is_held {
            self.begin_frame();
        } else {
            self.load = Load::new(runs, true);
            self.begin_image();
        }
    }

    /// Requests the self-test's arithmetic on triples of operands, at most [`message::CASES_PER_COMMAND`],
    /// from a card that has said hello and has no job. The answer is [`Event::Computed`].
    pub fn compute(&mut self, operands: &[[u8; OPERAND_BYTES]], now: Duration) {
        self.ask(
            Request::Compute(operands.len()),
            &Command::Compute { operands: operands.as_flattened() },
            now,
        );
    }

    /// Requests a test of the memory of a card that has said hello and has no job. The answers are
    /// [`Event::MemoryTested`], until the test is over.
    pub fn test_memory(&mut self, now: Duration) {
        self.ask(Request::Memory(None), &Command::TestMemory, now);
    }

    fn ask(&mut self, request: Request, command: &Command, now: Duration) {
        self.clock.rest(now);
        self.request = request;
        self.send(command);
        self.state = State::Testing;
    }

    /// Removes and returns the oldest event.
    pub fn next_event(&mut self) -> Option<Event> {
        self.events.pop_front()
    }

    /// Returns whether the card accepts another tile and the send window has room for a command.
    pub fn wants_tile(&self) -> bool {
        self.is_loaded() && self.tiles.len() < self.credits() && self.channel.is_free()
    }

    /// Maximum number of unanswered tiles.
    fn credits(&self) -> usize {
        let Some(budget) = &self.budget else { return 1 };
        let of_card = self.job.as_ref().map_or(budget.tiles, |job| job.frame.tiles_of(budget));
        of_card.min(MAX_CREDITS) as usize
    }

    /// Assigns a tile to the card. [`Self::wants_tile`] must be true.
    pub fn give(&mut self, assignment: Assignment) {
        self.tiles.push(assignment);
        self.is_flushed = false;
        self.send(&Command::RenderTile(assignment.tile));
    }

    /// Makes the card do the gathers of its tiles in flight ([`Command::Flush`]). The command is sent at most
    /// once between two tiles. [`Self::wants_tile`] must be true.
    pub fn flush(&mut self) {
        if !self.tiles.is_empty() && !std::mem::replace(&mut self.is_flushed, true) {
            self.send(&Command::Flush);
        }
    }

    /// Maximum number of tiles that the card works on at once.
    fn at_work(&self) -> usize {
        let of_card = self.budget.map_or(1, |budget| budget.in_flight);
        match &self.job {
            Some(_) if self.is_in_rounds() => self.credits(),
            Some(job) => of_card.min(job.frame.in_flight) as usize,
            None => of_card as usize,
        }
    }

    /// Returns whether gathers wait in card memory, so that the card works on all its tiles at once.
    fn is_in_rounds(&self) -> bool {
        self.job.as_ref().is_some_and(|job| job.frame.drain == Drain::Buckets)
    }

    /// Statistics of the link so far.
    pub fn link_bytes(&self) -> LinkBytes {
        self.channel.statistics()
    }

    /// Number of lines of the card image, from the first, that the card has or was sent.
    pub fn loaded_lines(&self) -> usize {
        match self.state {
            State::Greeting | State::Ready | State::Comparing | State::Testing => 0,
            State::Loading => self.load.done(),
            _ => self.upload_lines(),
        }
    }

    fn upload_lines(&self) -> usize {
        self.job.as_ref().map_or(0, |job| job.upload.lines().len())
    }

    /// Returns whether the card has the card image and the frame.
    pub fn is_loaded(&self) -> bool {
        self.state == State::Rendering
    }

    /// Returns whether the card is loaded and has no tile, and there are no bytes to send.
    pub fn is_idle(&mut self) -> bool {
        self.is_loaded() && !self.is_waiting() && self.channel.transport.outgoing().is_empty()
    }

    /// Returns whether an answer of the card is due.
    fn is_waiting(&self) -> bool {
        match self.state {
            State::Ready => false,
            // The next lines may be late, and it is not the card that they wait for.
            State::Loading if self.is_relayed => !self.channel.is_quiet(),
            State::Rendering => !self.tiles.is_empty() || !self.channel.transport.is_acknowledged(),
            _ => true,
        }
    }

    /// Fills the send window with commands and lines of the card image.
    pub fn prepare(&mut self) {
        self.channel.forward();
        while self.channel.is_free() && self.load_more() {}
    }

    /// Sends the next lines of the card image, or the command that ends it. Returns false if the session is
    /// not loading.
    fn load_more(&mut self) -> bool {
        let (State::Loading, Some(job)) = (self.state, &self.job) else { return false };
        let sent = self.load.next_lines(&job.upload, &mut self.channel.transport);
        self.channel.bytes.image += sent as u64;
        self.channel.bytes.payload += sent as u64;
        if sent == 0 {
            self.send(&Command::EndImage);
            self.channel.forward();
            self.state = State::Accepting;
        }
        true
    }

    /// Bytes that can be sent now.
    pub fn outgoing(&mut self) -> &[u8] {
        self.channel.transport.outgoing()
    }

    /// Returns whether the host can send more before the card answers.
    pub fn has_more_to_send(&mut self) -> bool {
        !self.channel.transport.outgoing().is_empty()
            || self.state == State::Loading && self.channel.transport.can_send()
    }

    /// Removes the first `bytes` bytes of [`Self::outgoing`] after they were sent.
    pub fn sent(&mut self, bytes: usize, now: Duration) {
        self.channel.transport.sent(bytes);
        self.channel.bytes.wire += bytes as u64;
        if bytes > 0 {
            self.clock.sent(now);
        }
    }

    /// Processes bytes from the card.
    ///
    /// # Errors
    /// If the bytes violate the protocol, report a fault of the card, or show that it has failed too often.
    pub fn receive(&mut self, mut bytes: &[u8], now: Duration) -> Result<(), SessionError> {
        self.channel.bytes.wire += bytes.len() as u64;
        self.unheard_bytes += bytes.len() as u64;
        while !bytes.is_empty() {
            let passed = self.channel.transport.passed();
            let damaged = self.channel.transport.statistics().damaged;
            let (taken, event) = self.channel.transport.receive(bytes);
            let (taken, rest) = bytes.split_at(taken);
            bytes = rest;
            self.evidence.add(taken);
            self.evidence.add_damaged(self.channel.transport.statistics().damaged - damaged);
            match event {
                None => {}
                Some(LineEvent::Heard) => {
                    self.evidence.add_whole();
                    self.clock.heard(now);
                    self.unheard_bytes = bytes.len() as u64;
                }
                Some(LineEvent::Unknown) if self.clock.has_heard() => {
                    self.count_reset()?;
                    self.restart(Restart::Lost, now);
                }
                // The greeting was lost.
                Some(LineEvent::Unknown) => self.channel.transport.send_again(),
            }
            let mut payload = [0; MAX_PAYLOAD];
            while let Some(message) = self.channel.transport.take() {
                let payload = &mut payload[..message.len()];
                payload.copy_from_slice(message);
                if self.state == State::Greeting && message::decode(payload) == Some(HELLO) {
                    return Err(SessionError::Echo);
                }
                if let (State::Greeting, Some(versions)) = (self.state, message::hello_versions(payload)) {
                    check_versions(versions)?;
                }
                let reply = message::decode(payload).ok_or(SessionError::Unexpected("not a reply"))?;
                self.take(&reply)?;
            }
            if self.channel.transport.passed() != passed {
                self.clock.passed(now);
                self.evidence = Evidence::default();
            }
        }
        Ok(())
    }

    /// Acknowledges received frames. Call it when the line is quiet.
    pub fn acknowledge(&mut self) {
        self.channel.transport.acknowledge();
    }

    /// Advances the clock; call it often. Probes a card that has been quiet for too long. `slowest` is the
    /// time limit per ray or gather, seconds, if known
    /// ([`Scheduler::slowest`](crate::scheduler::Scheduler::slowest)).
    ///
    /// # Errors
    /// If the card has been silent or without progress for too long, or has failed too often.
    pub fn tick(&mut self, slowest: Option<f64>, now: Duration) -> Result<(), SessionError> {
        self.clock.look(now);
        if !self.is_waiting() {
            self.clock.rest(now);
            return Ok(());
        }
        // A card that holds another host's session of equal number treats the hello as a repeated frame.
        if self.state == State::Greeting && self.clock.is_greeted_in_vain(now) {
            self.count_reset().map_err(|error| self.of_line(error))?;
            self.restart(Restart::Lost, now);
            return Ok(());
        }
        if self.clock.must_ask(now) {
            self.channel.transport.probe();
        }
        let rays = self.job.as_ref().map_or(0, |job| self.tiles.most_rays(self.at_work(), &job.frame));
        let result = self.clock.check(rays, slowest, now);
        match result {
            Err(SessionError::Standstill(_)) if !self.is_relayed => self.fail()?,
            Err(SessionError::Silent(time)) if self.is_garbled() => {
                let fault = self.evidence.fault();
                return Err(SessionError::Garbled { time, bytes: self.unheard_bytes, fault });
            }
            _ => {}
        }
        result.map_err(|error| self.of_line(error))
    }

    /// Returns the error of the line in place of a card's standstill, if the line damages what the card says.
    fn of_line(&self, error: SessionError) -> SessionError {
        match error {
            SessionError::Standstill(_) | SessionError::Failures(_) if self.evidence.is_of_bad_line() => {
                SessionError::BadLine(self.evidence.fault())
            }
            error => error,
        }
    }

    /// Returns whether too many bytes have arrived since the last valid frame: at least `MAX_FRAME`, because
    /// one frame may be truncated. Before the session's first valid frame one byte is too many.
    fn is_garbled(&self) -> bool {
        let least = if self.clock.has_heard() { MAX_FRAME as u64 } else { 1 };
        self.unheard_bytes >= least
    }

    /// Reports the unfinished tiles of a lost or reset card as events. If gathers wait in card memory and the
    /// card has several tiles, any of them may have caused the loss: none is reported as being at work.
    pub fn give_back(&mut self) {
        let is_any = self.is_in_rounds() && self.tiles.len() > 1;
        let at_work = if is_any { 0 } else { self.at_work() };
        self.tiles.give_back(at_work, &mut self.events);
    }

    /// Greets the card with a new session number, upon which the card drops its work.
    pub fn restart(&mut self, reason: Restart, now: Duration) {
        if reason == Restart::Lost {
            self.left_suspect = self.tiles.is_at_suspect();
            self.give_back();
            self.channel.bytes.resets += 1;
        }
        self.tiles = TilesInFlight::default();
        self.clock = Clock::new(now);
        self.unheard_bytes = 0;
        self.evidence = Evidence::default();
        self.state = State::Greeting;
        self.stale_replies = 0;
        self.channel.greet();
    }

    /// Counts the reset of a card that does not know the session, or that answers the greeting without a
    /// hello.
    fn count_reset(&mut self) -> Result<(), SessionError> {
        self.failures.forget_lines();
        self.fail()
    }

    /// Counts a failure of the card, unless it was working on a tile at which cards have crashed before.
    fn fail(&mut self) -> Result<(), SessionError> {
        if self.tiles.is_at_suspect() { Ok(()) } else { self.failures.count() }
    }

    fn send(&mut self, command: &Command) {
        self.channel.send(command);
    }

    /// Requests the next checksums of the card's chunks. After the last ones, starts to send lines.
    fn begin_load(&mut self) {
        let Some(job) = &self.job else { return };
        if let Some(runs) = self.assumed.take().and_then(|held| job.upload.missing_from(held)) {
            self.load = Load::new(runs, false);
            return self.begin_image();
        }
        if let Some(question) = self.comparison.next_question(&job.upload) {
            self.send(&question);
            self.state = State::Comparing;
            return;
        }
        self.load = Load::new(self.comparison.finish(&job.upload), false);
        self.begin_image();
    }

    fn begin_image(&mut self) {
        let Some(Job { upload, .. }) = &self.job else { return };
        let command = Command::BeginImage { lines: upload.lines().len() as u32, checksum: upload.checksum() };
        self.send(&command);
        self.state = State::Loading;
    }

    fn begin_frame(&mut self) {
        let Some(job) = &self.job else { return };
        let command = Command::BeginFrame(job.frame);
        self.send(&command);
        self.state = State::Framing;
    }
}
