//! The host's side of one card's link: a state machine without I/O, fed with bytes, tiles and a clock.
//!
//! It says hello, loads what the card does not have of the image, sets the frame, has tiles rendered, and checks their
//! pixels. What comes of that are [`Event`]s. A card that was reset is greeted and loaded again, and its tiles are lost
//! to it. Threads, ports, time, scheduler and sinks live outside: [`crate::render`] runs one session a thread, a simulator
//! many in one.

mod clock;
mod error;
mod failures;
mod job;
mod link_bytes;
mod load;
mod pixel_limits;
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
use photoncard_shared::message::{self, Command, MemoryUse, PROTOCOL_VERSION, Reply};
use photoncard_shared::transport::{Event as LineEvent, Transport};

use self::clock::Clock;
use self::error::{check_budget, check_versions};
use self::failures::Failures;
use self::load::Load;
use self::state::State;
use self::tiles::TilesInFlight;

/// Tiles that a card may hold at the most, whatever it says: those of a card that holds many come late if it is lost.
const MAX_CREDITS: u32 = 16;

/// The session with one card.
pub struct Session<'a> {
    state: State,
    budget: Option<Budget>,
    build: String,
    memory_use: Option<MemoryUse>,
    job: Option<Job<'a>>,
    load: Load,
    tiles: TilesInFlight,
    events: VecDeque<Event>,
    bytes: LinkBytes,
    transport: Transport,
    /// Encoded commands that wait for room on the line.
    commands: VecDeque<Vec<u8>>,
    /// The number of the link's present session.
    number: u32,
    clock: Clock,
    failures: Failures,
    /// Whether the card was at a suspect tile when it was greeted last.
    left_suspect: bool,
}

impl<'a> Session<'a> {
    /// A session that says hello first. `number` tells it from what a line may still hold of another: any will do.
    pub fn new(number: u32, now: Duration) -> Self {
        let mut session = Self {
            state: State::Greeting,
            budget: None,
            build: String::new(),
            memory_use: None,
            job: None,
            load: Load::default(),
            tiles: TilesInFlight::default(),
            events: VecDeque::new(),
            bytes: LinkBytes::default(),
            transport: Transport::host(),
            commands: VecDeque::new(),
            number,
            clock: Clock::new(now),
            failures: Failures::default(),
            left_suspect: false,
        };
        session.greet_card();
        session
    }

    /// What the card can hold, once it has said so.
    pub fn budget(&self) -> Option<&Budget> {
        self.budget.as_ref()
    }

    /// Name and version of the card's firmware, once it has said so.
    pub fn build(&self) -> &str {
        &self.build
    }

    /// What the card's firmware takes of on-chip memory, if the card measures it and has said so.
    pub fn memory_use(&self) -> Option<MemoryUse> {
        self.memory_use
    }

    /// Gives the card something to do, once it is known.
    pub fn start(&mut self, job: Job<'a>, now: Duration) {
        self.job = Some(job);
        self.clock.rest(now);
        if self.state == State::Ready {
            self.begin_load();
        }
    }

    /// What has come of the session since the last call, from the oldest.
    pub fn next_event(&mut self) -> Option<Event> {
        self.events.pop_front()
    }

    /// Whether the card has a free credit, and its line room for a command.
    pub fn wants_tile(&self) -> bool {
        let credits = self.budget.map_or(1, |budget| budget.tiles.min(MAX_CREDITS) as usize);
        self.is_loaded()
            && self.tiles.len() < credits
            && self.commands.is_empty()
            && self.transport.can_send()
    }

    /// Gives a card that wants one a tile.
    pub fn give(&mut self, assignment: Assignment) {
        self.tiles.push(assignment);
        self.send(&Command::RenderTile(assignment.tile));
    }

    /// Bytes over the link so far.
    pub fn link_bytes(&self) -> LinkBytes {
        LinkBytes { line: self.transport.statistics(), ..self.bytes }
    }

    /// Lines of the image that are on the card or on their way.
    pub fn loaded_lines(&self) -> usize {
        match self.state {
            State::Greeting | State::Ready | State::Comparing => 0,
            State::Loading => self.load.done(),
            _ => self.job.map_or(0, |job| job.image.len()),
        }
    }

    /// Whether the card has the image and the frame.
    pub fn is_loaded(&self) -> bool {
        self.state == State::Rendering
    }

    /// Whether the card has nothing to do, and there is no tile for it.
    pub fn is_idle(&mut self) -> bool {
        self.is_loaded() && !self.is_waiting() && self.transport.outgoing().is_empty()
    }

    /// Whether an answer of the card is due.
    fn is_waiting(&self) -> bool {
        match self.state {
            State::Ready => false,
            State::Rendering => !self.tiles.is_empty() || !self.transport.is_acknowledged(),
            _ => true,
        }
    }

    /// Makes what there is to send next.
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

    /// Sends the next lines of the image, or says that they were all. Returns whether there was anything to say.
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

    /// What is to be sent now.
    pub fn outgoing(&mut self) -> &[u8] {
        self.transport.outgoing()
    }

    /// Whether there is something to send without an answer from the card.
    pub fn has_more_to_send(&mut self) -> bool {
        !self.transport.outgoing().is_empty() || self.state == State::Loading && self.transport.can_send()
    }

    /// Tells that the first `bytes` of the outgoing ones are sent.
    pub fn sent(&mut self, bytes: usize, now: Duration) {
        self.transport.sent(bytes);
        self.bytes.wire += bytes as u64;
        if bytes > 0 {
            self.clock.sent(now);
        }
    }

    /// Takes what came from the card.
    ///
    /// # Errors
    /// If it is not what a card of this protocol answers, tells of a fault, or the card has failed too often.
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
                // Our hello was lost.
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

    /// Tells the card what has come: when the line is quiet.
    pub fn acknowledge(&mut self) {
        self.transport.acknowledge();
    }

    /// Asks a card that has been quiet for too long whether it is there. To be called often. `slowest` is the most seconds that
    /// a ray, or the gather at its end, may take the card, if tiles that were rendered tell.
    ///
    /// # Errors
    /// If the card has been silent, or has come no further, for longer than it may, or has failed too often.
    pub fn tick(&mut self, slowest: Option<f64>, now: Duration) -> Result<(), SessionError> {
        self.clock.look(now);
        if !self.is_waiting() {
            self.clock.rest(now);
            return Ok(());
        }
        // A card that holds a session of this very number, of another host, takes the hello for one that came before.
        if self.state == State::Greeting && self.clock.is_greeted_in_vain(now) {
            return self.reset(now);
        }
        if self.clock.must_ask(now) {
            self.transport.probe();
        }
        let rays = self.job.map_or(0, |job| self.tiles.most_rays(job.frame));
        let result = self.clock.check(rays, slowest, now);
        if matches!(result, Err(SessionError::Standstill(_))) {
            self.fail()?;
        }
        result
    }

    /// Takes the tiles that the card has not completed from it: it is lost, or was reset.
    pub fn give_back(&mut self) {
        self.tiles.give_back(&mut self.events);
    }

    /// Greets the card again and takes its tiles from it: its link was closed, or it is silent.
    pub fn greet_again(&mut self, now: Duration) {
        self.left_suspect = self.tiles.is_at_suspect();
        self.give_back();
        self.bytes.resets += 1;
        self.number = self.number.wrapping_add(1);
        self.clock = Clock::new(now);
        self.greet_card();
    }

    /// Greets a card again that does not know the session, or answers and leaves its greeting without a reply.
    fn reset(&mut self, now: Duration) -> Result<(), SessionError> {
        self.failures.forget_lines();
        self.fail()?;
        self.greet_again(now);
        Ok(())
    }

    /// The card was reset or came no further. That is its fault, unless cards have crashed before at what it was at.
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
        // Every command fits a frame: tests pin the longest.
        if let Some(length) = message::encode(command, &mut bytes) {
            bytes.truncate(length);
            self.commands.push_back(bytes);
        }
    }

    /// Asks for the next checksums of what the card has, or begins to send lines.
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
