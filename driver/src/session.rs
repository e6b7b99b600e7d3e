//! The host's side of one card's link: a state machine without I/O, fed with bytes and a clock.
//!
//! It says hello, loads the image, sets the frame, keeps the card's credits in use and collects pixels and counters.
//! Threads, ports and time live outside: [`crate::render`] runs one session a thread, a simulator could run many in one.

mod error;

pub use error::SessionError;

use std::collections::HashMap;
use std::time::Duration;

use photoncard_shared::address::{LINE_BYTES, Line};
use photoncard_shared::budget::Budget;
use photoncard_shared::counters::Counters;
use photoncard_shared::frame::{FrameReader, FrameWriter, MAX_FRAME};
use photoncard_shared::image::LAYOUT_VERSION;
use photoncard_shared::message::{
    self, Command, FrameParameters, LINES_PER_WRITE, PIXEL_BYTES, PROTOCOL_VERSION, Pixel, Reply, Tile,
};

use crate::film::{Film, FilmError, Window};
use crate::scheduler::Scheduler;

/// What sessions work on together.
pub struct Picture {
    /// Which tiles are left.
    pub scheduler: Scheduler,
    /// Where pixels go.
    pub film: Film,
}

impl Picture {
    /// A picture of one pixel and no tile, for a session that has nothing to render yet.
    ///
    /// # Errors
    /// If there is no memory for a pixel.
    pub fn empty() -> Result<Self, FilmError> {
        let film = Film::new(1, 1, Window::full(1, 1))?;
        Ok(Self { scheduler: Scheduler::new(Vec::new()), film })
    }
}

/// What a card is to do, the same for every card.
#[derive(Clone, Copy)]
pub struct Job<'a> {
    /// The card image.
    pub image: &'a [Line],
    /// CRC-32C of the image's bytes.
    pub checksum: u32,
    /// The frame's parameters.
    pub frame: &'a FrameParameters,
}

/// Bytes that went over a link.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LinkBytes {
    /// Image lines and pixels.
    pub payload: u64,
    /// All bytes in both directions.
    pub wire: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// Hello is sent.
    Greeting,
    /// The card is known and has nothing to do.
    Ready,
    /// Lines from this one on are still to be sent.
    Loading {
        next: usize,
    },
    /// All lines are sent.
    Accepting,
    /// The frame's parameters are sent.
    Framing,
    Rendering,
    /// The counters are asked for.
    Counting,
    Done,
}

/// A tile at a card.
struct TileInFlight {
    tile: Tile,
    pixels: u64,
}

/// The session with one card.
pub struct Session<'a> {
    state: State,
    budget: Option<Budget>,
    build: String,
    job: Option<Job<'a>>,
    tiles: HashMap<u32, TileInFlight>,
    counters: Counters,
    bytes: LinkBytes,
    reader: FrameReader,
    writer: FrameWriter,
    expected_sequence: Option<u16>,
    outgoing: Vec<u8>,
    sent: usize,
    heard: Duration,
}

/// How long a card may be silent while an answer is due.
const SILENCE: Duration = Duration::from_secs(10);
/// How long a card may be silent while it renders, besides the time of its tiles.
const RENDERING_SILENCE: Duration = Duration::from_secs(600);
/// Irradiance records that a card surveys for one pixel at the most, and more than it gathers.
const MOST_RECORDS_OF_A_PIXEL: u64 = 19;
/// Time that a slow card may take for one ray and its gather.
const SLOW_RAY: Duration = Duration::from_millis(1);

impl<'a> Session<'a> {
    /// A session that says hello first.
    pub fn new(now: Duration) -> Self {
        let mut session = Self {
            state: State::Greeting,
            budget: None,
            build: String::new(),
            job: None,
            tiles: HashMap::new(),
            counters: Counters::ZERO,
            bytes: LinkBytes::default(),
            reader: FrameReader::new(),
            writer: FrameWriter::new(),
            expected_sequence: None,
            outgoing: Vec::with_capacity(MAX_FRAME),
            sent: 0,
            heard: now,
        };
        session.send(&Command::Hello { protocol: PROTOCOL_VERSION, layout: LAYOUT_VERSION });
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

    /// Gives the card something to do, once it is known.
    pub fn start(&mut self, job: Job<'a>, now: Duration) {
        self.job = Some(job);
        self.heard = now;
        self.state = State::Loading { next: 0 };
        let lines = job.image.len() as u32;
        self.send(&Command::BeginImage { lines, checksum: job.checksum });
    }

    /// Whether the card has nothing left to do: its tiles and counters are here.
    pub fn is_done(&self) -> bool {
        self.state == State::Done
    }

    /// What the card counted; complete when the session is done.
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Bytes over the link so far.
    pub fn link_bytes(&self) -> LinkBytes {
        self.bytes
    }

    /// Lines of the image that are on their way.
    pub fn loaded_lines(&self) -> usize {
        match self.state {
            State::Greeting | State::Ready => 0,
            State::Loading { next } => next,
            _ => self.job.map_or(0, |job| job.image.len()),
        }
    }

    /// Makes what there is to send next, if all before is sent.
    pub fn prepare(&mut self, picture: &mut Picture) {
        if self.sent == self.outgoing.len() {
            self.outgoing.clear();
            self.sent = 0;
            match self.state {
                State::Loading { next } => self.send_lines(next),
                State::Rendering => self.send_tiles(picture),
                _ => {}
            }
        }
    }

    /// What is to be sent now.
    pub fn outgoing(&self) -> &[u8] {
        &self.outgoing[self.sent..]
    }

    /// Whether there is something to send without an answer from the card.
    pub fn has_more_to_send(&self) -> bool {
        !self.outgoing().is_empty() || matches!(self.state, State::Loading { .. })
    }

    /// Whether the card has the image and the frame.
    pub fn is_loaded(&self) -> bool {
        matches!(self.state, State::Rendering | State::Counting | State::Done)
    }

    /// Tells that the first `bytes` of the outgoing ones are sent.
    pub fn sent(&mut self, bytes: usize, now: Duration) {
        self.sent = (self.sent + bytes).min(self.outgoing.len());
        self.bytes.wire += bytes as u64;
        if bytes > 0 {
            self.heard = now;
        }
    }

    /// Takes what came from the card.
    ///
    /// # Errors
    /// If it is not what a card of this protocol answers, or tells of a fault.
    pub fn receive(
        &mut self,
        mut bytes: &[u8],
        picture: &mut Picture,
        now: Duration,
    ) -> Result<(), SessionError> {
        self.bytes.wire += bytes.len() as u64;
        while !bytes.is_empty() {
            self.heard = now;
            let (taken, frame) = self.reader.read(bytes);
            bytes = &bytes[taken..];
            if let Some(frame) = frame {
                let frame = frame.map_err(SessionError::Frame)?;
                let (sequence, payload) = (frame.sequence, frame.payload.to_vec());
                let reply = message::decode(&payload).ok_or(SessionError::Unexpected("not a reply"))?;
                self.check_sequence(sequence)?;
                self.take(&reply, picture)?;
            }
        }
        Ok(())
    }

    /// Checks that the card has not been silent for too long.
    ///
    /// # Errors
    /// If it has.
    pub fn check_silence(&self, now: Duration) -> Result<(), SessionError> {
        let limit = match self.state {
            State::Ready | State::Done => return Ok(()),
            State::Rendering if self.tiles.is_empty() => return Ok(()),
            State::Rendering => self.rendering_silence(),
            _ => SILENCE,
        };
        if now.saturating_sub(self.heard) > limit { Err(SessionError::Silent(limit)) } else { Ok(()) }
    }

    /// A tile tells nothing of itself until it is complete: a card may be silent for as long as a slow one would be.
    fn rendering_silence(&self) -> Duration {
        let pixels: u64 = self.tiles.values().map(|in_flight| in_flight.tile.pixels()).sum();
        let rays = self.job.map_or(1, |Job { frame, .. }| {
            let samples =
                frame.samples as u64 + frame.irradiance_error.map_or(0, |_| MOST_RECORDS_OF_A_PIXEL);
            samples * (frame.gather_rays as u64 + 1)
        });
        RENDERING_SILENCE + SLOW_RAY.saturating_mul(u32::try_from(pixels * rays).unwrap_or(u32::MAX))
    }

    fn check_sequence(&mut self, sequence: u16) -> Result<(), SessionError> {
        // The card may have spoken to another host before: its first number is any.
        if self.expected_sequence.is_some_and(|expected| expected != sequence) {
            return Err(SessionError::Unexpected("a frame is missing"));
        }
        self.expected_sequence = Some(sequence.wrapping_add(1));
        Ok(())
    }

    fn send(&mut self, command: &Command) {
        // Every command fits a frame: tests pin the longest.
        if let Some(frame) = self.writer.write(|bytes| message::encode(command, bytes)) {
            self.outgoing.extend_from_slice(frame);
        }
    }

    fn send_lines(&mut self, next: usize) {
        let Some(job) = self.job else { return };
        let end = (next + LINES_PER_WRITE).min(job.image.len());
        let mut data = [0; LINE_BYTES * LINES_PER_WRITE];
        for (target, line) in data.as_chunks_mut().0.iter_mut().zip(&job.image[next..end]) {
            *target = line.0;
        }
        let data = &data[..(end - next) * LINE_BYTES];
        self.bytes.payload += data.len() as u64;
        self.send(&Command::WriteLines { first: next as u32, data });
        self.state = State::Loading { next: end };
        if end == job.image.len() {
            self.send(&Command::EndImage);
            self.state = State::Accepting;
        }
    }

    fn send_tiles(&mut self, picture: &mut Picture) {
        let credits = self.budget.map_or(1, |budget| budget.tiles as usize);
        while self.tiles.len() < credits {
            let Some(tile) = picture.scheduler.take() else { break };
            self.tiles.insert(tile.id, TileInFlight { tile, pixels: 0 });
            self.send(&Command::RenderTile(tile));
        }
        if self.tiles.is_empty() && picture.scheduler.is_drained() {
            self.send(&Command::ReadCounters);
            self.state = State::Counting;
        }
    }

    fn take(&mut self, reply: &Reply, picture: &mut Picture) -> Result<(), SessionError> {
        match (self.state, *reply) {
            (State::Greeting, Reply::Hello { protocol, layout, budget, build }) => {
                build.clone_into(&mut self.build);
                self.greet(protocol, layout, budget)
            }
            (State::Greeting, _) => {
                // What another session left on the link.
                self.expected_sequence = None;
                Ok(())
            }
            (_, Reply::Fault(fault)) => Err(SessionError::Fault(fault)),
            (State::Accepting, Reply::ImageAccepted) => {
                let Some(job) = self.job else { return Ok(()) };
                self.send(&Command::BeginFrame(*job.frame));
                self.state = State::Framing;
                Ok(())
            }
            (State::Framing, Reply::FrameAccepted) => {
                self.state = State::Rendering;
                Ok(())
            }
            (State::Rendering, Reply::Pixels { tile, first, data }) => {
                self.take_pixels(tile, first, data, picture)
            }
            (State::Rendering, Reply::TileDone { tile }) => self.complete(tile, picture),
            (State::Counting, Reply::Counters(counters)) => {
                self.counters = counters;
                self.state = State::Done;
                Ok(())
            }
            _ => Err(SessionError::Unexpected("not an answer to what was asked")),
        }
    }

    fn greet(&mut self, protocol: u16, layout: u16, budget: Budget) -> Result<(), SessionError> {
        if protocol != PROTOCOL_VERSION {
            return Err(SessionError::Protocol { card: protocol, host: PROTOCOL_VERSION });
        }
        if layout != LAYOUT_VERSION {
            return Err(SessionError::Layout { card: layout, host: LAYOUT_VERSION });
        }
        if budget.tiles == 0 {
            return Err(SessionError::NoTiles);
        }
        self.budget = Some(budget);
        self.state = State::Ready;
        Ok(())
    }

    fn take_pixels(
        &mut self,
        tile: u32,
        first: u32,
        data: &[u8],
        picture: &mut Picture,
    ) -> Result<(), SessionError> {
        let in_flight =
            self.tiles.get_mut(&tile).ok_or(SessionError::Unexpected("pixels of another tile"))?;
        let (pixels, rest) = data.as_chunks::<PIXEL_BYTES>();
        let end = first as u64 + pixels.len() as u64;
        if first as u64 != in_flight.pixels || !rest.is_empty() || end > in_flight.tile.pixels() {
            return Err(SessionError::Unexpected("pixels that are not the next"));
        }
        in_flight.pixels = end;
        let Tile { x, y, width, .. } = in_flight.tile;
        self.bytes.payload += data.len() as u64;
        for (index, pixel) in (first..).zip(pixels) {
            picture.film.write(x + index % width, y + index / width, Pixel::read(pixel))?;
        }
        Ok(())
    }

    fn complete(&mut self, tile: u32, picture: &mut Picture) -> Result<(), SessionError> {
        match self.tiles.remove(&tile) {
            Some(in_flight) if in_flight.pixels == in_flight.tile.pixels() => {
                picture.scheduler.complete();
                Ok(())
            }
            _ => Err(SessionError::Unexpected("a tile that is not complete")),
        }
    }
}
