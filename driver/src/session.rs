//! The host's end of a card's link: a state machine without I/O, whose inputs are bytes, tiles and a clock.
//!
//! A session greets the card, sends the parts of the image that the card lacks, sets the frame, requests tiles and checks
//! their pixels. Its results are [`Event`]s. A card that was reset is greeted and loaded again, and its tiles are returned.
//! Threads, ports, time, scheduler and sinks are outside: [`crate::render`] runs one session per thread, a simulator many
//! in one.

mod clock;
mod error;
mod failures;
mod job;
mod link_bytes;
mod load;
mod pixel_limits;
mod self_test;
mod state;
mod tiles;

pub use error::SessionError;
pub use job::{Assignment, Event, Job};
pub use link_bytes::LinkBytes;
pub use pixel_limits::PixelLimits;

use std::collections::VecDeque;
use std::time::Duration;

use photoncard_shared::budget::Budget;
use photoncard_shared::frame::MAX_PAYLOAD;
use photoncard_shared::image::LAYOUT_VERSION;
use photoncard_shared::message::{self, Command, MemoryUse, OPERAND_BYTES, PROTOCOL_VERSION, Reply};
use photoncard_shared::transport::{Event as LineEvent, Transport};

use self::clock::Clock;
use self::error::{check_budget, check_versions};
use self::failures::Failures;
use self::load::Load;
use self::self_test::Request;
use self::state::State;
use self::tiles::TilesInFlight;

/// Maximum number of tiles on a card, whatever its budget: the tiles of a lost card are delayed.
const MAX_CREDITS: u32 = 16;

/// Session with one card.
pub struct Session<'a> {
    state: State,
    budget: Option<Budget>,
    build: String,
    memory_use: Option<MemoryUse>,
    job: Option<Job<'a>>,
    load: Load,
    /// Requested part of the self-test.
    request: Request,
    tiles: TilesInFlight,
    events: VecDeque<Event>,
    bytes: LinkBytes,
    transport: Transport,
    /// Encoded commands that wait for room in the send window.
    commands: VecDeque<Vec<u8>>,
    /// Number of the link's current session.
    number: u32,
    clock: Clock,
    failures: Failures,
    /// True if the card was working on a suspect tile when it was last greeted.
    left_suspect: bool,
    /// True after a [`Command::Flush`], until the next tile.
    is_flushed: bool,
}

impl<'a> Session<'a> {
    /// Session that starts with a greeting. `number` distinguishes it from frames of other sessions on the line; any value
    /// is valid.
    pub fn new(number: u32, now: Duration) -> Self {
        let mut session = Self {
            state: State::Greeting,
            budget: None,
            build: String::new(),
            memory_use: None,
            job: None,
            load: Load::default(),
            request: Request::Nothing,
            tiles: TilesInFlight::default(),
            events: VecDeque::new(),
            bytes: LinkBytes::default(),
            transport: Transport::host(),
            commands: VecDeque::new(),
            number,
            clock: Clock::new(now),
            failures: Failures::default(),
            left_suspect: false,
            is_flushed: false,
        };
        session.greet_card();
        session
    }

    /// Budget of the card; `None` before its hello.
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

    /// Sets the job of the card, which starts as soon as the card has answered the greeting.
    pub fn start(&mut self, job: Job<'a>, now: Duration) {
        self.job = Some(job);
        self.clock.rest(now);
        if self.state == State::Ready {
            self.begin_load();
        }
    }

    /// Requests the results of operand triples, at most [`message::CASES_PER_COMMAND`], from a card that has said hello and has no job:
    /// [`Event::Computed`].
    pub fn compute(&mut self, operands: &[[u8; OPERAND_BYTES]], now: Duration) {
        self.ask(
            Request::Compute(operands.len()),
            &Command::Compute { operands: operands.as_flattened() },
            now,
        );
    }

    /// Requests the test of its memory from a card that has said hello and has no job: [`Event::MemoryTested`], until the test
    /// is over.
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

    /// Returns whether the card has a free credit, and the send window room for a command.
    pub fn wants_tile(&self) -> bool {
        let credits = self.budget.map_or(1, |budget| budget.tiles.min(MAX_CREDITS) as usize);
        self.is_loaded()
            && self.tiles.len() < credits
            && self.commands.is_empty()
            && self.transport.can_send()
    }

    /// Assigns a tile to a card for which [`Self::wants_tile`] is true.
    pub fn give(&mut self, assignment: Assignment) {
        self.tiles.push(assignment);
        self.is_flushed = false;
        self.send(&Command::RenderTile(assignment.tile));
    }

    /// Sends [`Command::Flush`] to a card for which [`Self::wants_tile`] is true and there is no tile: it does the gathers of its
    /// tiles in flight instead of waiting for another.
    pub fn flush(&mut self) {
        if !self.tiles.is_empty() && !std::mem::replace(&mut self.is_flushed, true) {
            self.send(&Command::Flush);
        }
    }

    /// Maximum number of tiles that the card works on at once.
    fn at_work(&self) -> usize {
        let of_card = self.budget.map_or(1, |budget| budget.in_flight);
        self.job.map_or(of_card, |job| of_card.min(job.frame.in_flight)) as usize
    }

    /// Statistics of the link so far.
    pub fn link_bytes(&self) -> LinkBytes {
        LinkBytes { line: self.transport.statistics(), ..self.bytes }
    }

    /// Number of lines of the image that the card has or that were sent.
    pub fn loaded_lines(&self) -> usize {
        match self.state {
            State::Greeting | State::Ready | State::Comparing | State::Testing => 0,
            State::Loading => self.load.done(),
            _ => self.job.map_or(0, |job| job.image.len()),
        }
    }

    /// Returns whether the card has the image and the frame.
    pub fn is_loaded(&self) -> bool {
        self.state == State::Rendering
    }

    /// Returns whether the card is loaded, has no tile, and no bytes are to be sent.
    pub fn is_idle(&mut self) -> bool {
        self.is_loaded() && !self.is_waiting() && self.transport.outgoing().is_empty()
    }

    /// Returns whether an answer of the card is due.
    fn is_waiting(&self) -> bool {
        match self.state {
            State::Ready => false,
            State::Rendering => !self.tiles.is_empty() || !self.transport.is_acknowledged(),
            _ => true,
        }
    }

    /// Fills the send window with commands and lines of the image.
    pub fn prepare(&mut self) {
        while self.transport.can_send() {
            if let Some(command) = self.commands.pop_front() {
                self.transport.send(|bytes| {
                    bytes.get_mut(..command.len())?.copy_from_slice(&command);
                    Some(command.len())
                });
            } else if !self.load_more() {
                break;
            }
        }
    }

    /// Sends the next lines of the image, or the command that ends it. Returns false if the session is not loading.
    fn load_more(&mut self) -> bool {
        let (State::Loading, Some(job)) = (self.state, self.job) else { return false };
        let sent = self.load.next_lines(job.image, &mut self.transport);
        self.bytes.payload += sent as u64;
        if sent == 0 {
            self.send(&Command::EndImage);
            self.state = State::Accepting;
        }
        true
    }

    /// Bytes to send now.
    pub fn outgoing(&mut self) -> &[u8] {
        self.transport.outgoing()
    }

    /// Returns whether there are bytes to send before the card answers.
    pub fn has_more_to_send(&mut self) -> bool {
        !self.transport.outgoing().is_empty() || self.state == State::Loading && self.transport.can_send()
    }

    /// Removes the first `bytes` bytes of [`Self::outgoing`], which were sent.
    pub fn sent(&mut self, bytes: usize, now: Duration) {
        self.transport.sent(bytes);
        self.bytes.wire += bytes as u64;
        if bytes > 0 {
            self.clock.sent(now);
        }
    }

    /// Processes bytes from the card.
    ///
    /// # Errors
    /// If they violate the protocol, report a fault of the card, or show that it has failed too often.
    pub fn receive(&mut self, mut bytes: &[u8], now: Duration) -> Result<(), SessionError> {
        self.bytes.wire += bytes.len() as u64;
        while !bytes.is_empty() {
            let passed = self.transport.passed();
            let (taken, event) = self.transport.receive(bytes);
            bytes = &bytes[taken..];
            match event {
                None => {}
                Some(LineEvent::Heard) => self.clock.heard(now),
                Some(LineEvent::Unknown) if self.clock.has_heard() => self.reset(now)?,
                // The greeting was lost.
                Some(LineEvent::Unknown) => self.transport.send_again(),
            }
            let mut payload = [0; MAX_PAYLOAD];
            while let Some(message) = self.transport.take() {
                let payload = &mut payload[..message.len()];
                payload.copy_from_slice(message);
                if let (State::Greeting, Some(versions)) = (self.state, message::hello_versions(payload)) {
                    check_versions(versions)?;
                }
                let reply = message::decode(payload).ok_or(SessionError::Unexpected("not a reply"))?;
                self.take(&reply)?;
            }
            if self.transport.passed() != passed {
                self.clock.passed(now);
            }
        }
        Ok(())
    }

    /// Acknowledges received frames; to be called when the line is quiet.
    pub fn acknowledge(&mut self) {
        self.transport.acknowledge();
    }

    /// Advances the clock; to be called often. Probes a card that has been quiet for too long. `slowest` is the maximum
    /// time of a ray or its gather, seconds, if known ([`Scheduler::slowest`](crate::scheduler::Scheduler::slowest)).
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
            return self.reset(now);
        }
        if self.clock.must_ask(now) {
            self.transport.probe();
        }
        let rays = self.job.map_or(0, |job| self.tiles.most_rays(self.at_work(), job.frame));
        let result = self.clock.check(rays, slowest, now);
        if matches!(result, Err(SessionError::Standstill(_))) {
            self.fail()?;
        }
        result
    }

    /// Returns the unfinished tiles of a card that is lost or was reset, as events.
    pub fn give_back(&mut self) {
        let at_work = self.at_work();
        self.tiles.give_back(at_work, &mut self.events);
    }

    /// Greets the card again, with a new session number, after its link was closed or it was silent. Its tiles are
    /// returned.
    pub fn greet_again(&mut self, now: Duration) {
        self.left_suspect = self.tiles.is_at_suspect();
        self.give_back();
        self.bytes.resets += 1;
        self.number = self.number.wrapping_add(1);
        self.clock = Clock::new(now);
        self.greet_card();
    }

    /// Greets a card again that does not know the session, or that answers without a reply to the hello.
    fn reset(&mut self, now: Duration) -> Result<(), SessionError> {
        self.failures.forget_lines();
        self.fail()?;
        self.greet_again(now);
        Ok(())
    }

    /// Counts a failure of the card, unless it was working on a tile at which cards have crashed before.
    fn fail(&mut self) -> Result<(), SessionError> {
        if self.tiles.is_at_suspect() { Ok(()) } else { self.failures.count() }
    }

    fn greet_card(&mut self) {
        self.state = State::Greeting;
        self.commands.clear();
        self.transport.open(self.number);
        self.send(&Command::Hello { protocol: PROTOCOL_VERSION, layout: LAYOUT_VERSION });
    }

    fn send(&mut self, command: &Command) {
        let mut bytes = vec![0; MAX_PAYLOAD];
        // Every command fits a frame: tests cover the longest.
        if let Some(length) = message::encode(command, &mut bytes) {
            bytes.truncate(length);
            self.commands.push_back(bytes);
        }
    }

    /// Requests the next checksums of the card's chunks; after the last ones starts to send lines.
    fn begin_load(&mut self) {
        let Some(job) = self.job else { return };
        if let Some(question) = self.load.next_question(job.image) {
            self.send(&question);
            self.state = State::Comparing;
            return;
        }
        let lines = job.image.len() as u32;
        self.send(&Command::BeginImage { lines, checksum: job.checksum });
        self.state = State::Loading;
    }

    fn take(&mut self, reply: &Reply) -> Result<(), SessionError> {
        match (self.state, *reply) {
            (State::Greeting, Reply::Hello { budget, written_lines, memory_use, build, .. }) => {
                build.clone_into(&mut self.build);
                self.memory_use = memory_use;
                self.greet(budget, written_lines)?;
                self.load = Load::new(written_lines);
                if self.job.is_some() {
                    self.begin_load();
                }
                Ok(())
            }
            (_, Reply::Fault(fault)) => Err(SessionError::Fault(fault)),
            (State::Comparing, Reply::Checksums { first, data }) => {
                let Some(job) = self.job else { return Ok(()) };
                self.load.compare(job.image, first, data)?;
                self.begin_load();
                Ok(())
            }
            (State::Accepting, Reply::ImageAccepted) => {
                let Some(job) = self.job else { return Ok(()) };
                self.failures.is_loaded(job.image.len() as u32);
                self.send(&Command::BeginFrame(*job.frame));
                self.state = State::Framing;
                Ok(())
            }
            (State::Framing, Reply::FrameAccepted) => {
                self.state = State::Rendering;
                self.events.push_back(Event::Ready);
                Ok(())
            }
            (State::Rendering, Reply::Pixels { tile, first, data }) => {
                let Some(job) = &self.job else { return Ok(()) };
                self.tiles.take_pixels(tile, first, data, &job.limits)?;
                self.bytes.payload += data.len() as u64;
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
