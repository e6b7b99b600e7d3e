//! Fuzzing of a host's session by a hostile card: mutated replies in any order, replies to no command, and
//! resets.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use photoncard_driver::dispatcher::Dispatcher;
use photoncard_driver::film::{Film, PixelValue, SumFormat, Window};
use photoncard_driver::scheduler::Scheduler;
use photoncard_driver::session::{Job, PixelLimits, Restart, Session, SessionError, Upload};
use photoncard_firmware::kind::MICRO;
use photoncard_shared::address::Line;
use photoncard_shared::budget::Budget;
use photoncard_shared::counters::Counters;
use photoncard_shared::frame::{MAX_FRAME, MAX_PAYLOAD};
use photoncard_shared::image::{Header, LAYOUT_VERSION};
use photoncard_shared::layout::PhotonGrid;
use photoncard_shared::message::{
    self, FrameParameters, PIXELS_BYTES, PROTOCOL_VERSION, PixelForm, Reply, Tile,
};
use photoncard_shared::transport::Transport;

use super::random::Random;
use super::target::{Target, bound};
use super::{messages, mutation};

/// Number of lines of the card image: several chunks, of which the last is not full.
const LINES: u32 = 200;
/// Side of a tile, pixels. The picture has two tiles.
const SIDE: u32 = 6;
/// Simulated time per step.
const STEP: Duration = Duration::from_millis(50);
/// Maximum number of frames that the two ends exchange in a step.
const MAX_FRAMES: usize = 64;
/// Maximum number of steps until a session with a silent card has failed.
const MAX_STEPS: usize = 400;

/// First byte of a record in which the card is reset. With any other first byte except [`WAIT`], the card
/// sends the reply in the record. An input has one more byte before its records, which states whether pixels
/// have all optional contents.
const RESET: u8 = 0xff;
const WAIT: u8 = 0xfe;

/// Forms of pixels of the sessions.
const FORMS: [PixelForm; 2] = [PixelForm::PLAIN, PixelForm::FULL];

/// Target for sessions.
pub(super) struct Sessions {
    /// Replies of a valid session in order: without optional contents of pixels, and with all.
    replies: [Vec<Vec<u8>>; 2],
    others: Vec<Vec<u8>>,
    upload: Arc<Upload>,
    frames: [FrameParameters; 2],
}

/// Replies of a valid session, in order.
fn sound_replies(hello: Reply, form: PixelForm) -> Vec<Vec<u8>> {
    let record = form.record_bytes();
    let tile_pixels = vec![0; (SIDE * SIDE) as usize * record];
    let pixels_of_reply = PIXELS_BYTES / record;
    let mut replies = vec![
        hello,
        Reply::Checksums { first: 0, data: &[7; 24] },
        Reply::ImageAccepted,
        Reply::FrameAccepted,
    ];
    for tile in 0..2 {
        let parts = tile_pixels.chunks(pixels_of_reply * record);
        let firsts = (0..).step_by(pixels_of_reply);
        replies.extend(firsts.zip(parts).map(|(first, data)| Reply::Pixels { tile, first, data }));
        replies.push(Reply::TileDone { tile, counters: Counters::ZERO });
    }
    replies.iter().map(encoded).collect()
}

fn encoded(reply: &Reply) -> Vec<u8> {
    let mut bytes = vec![0; MAX_PAYLOAD];
    let length = message::encode(reply, &mut bytes).expect("there is room for the reply");
    bytes.truncate(length);
    bytes
}

impl Sessions {
    pub(super) fn new() -> Self {
        let budget = Budget { tiles: 2, ..MICRO };
        let hello = |written_lines| Reply::Hello {
            protocol: PROTOCOL_VERSION,
            layout: LAYOUT_VERSION,
            budget,
            written_lines,
            memory_use: None,
            build: "a card",
            board: None,
        };
        Self {
            replies: FORMS.map(|form| sound_replies(hello(LINES), form)),
            others: [messages::replies(), vec![encoded(&hello(0)), encoded(&hello(u32::MAX))]].concat(),
            upload: Arc::new(Upload::new(Arc::new(vec![Line::ZERO; LINES as usize]))),
            frames: FORMS.map(|PixelForm { layers, light_groups, position, coverage, identities }| {
                FrameParameters { layers, light_groups, position, coverage, identities, ..messages::frame() }
            }),
        }
    }

    /// Reply of a hostile card: in most cases the valid one, at times mutated or another.
    fn reply(&self, replies: &[Vec<u8>], sound: &[u8], random: &mut Random) -> Vec<u8> {
        let mut bytes = match random.below(16) {
            0 => random.pick(&self.others).clone(),
            1 => random.pick(replies).clone(),
            _ => sound.to_vec(),
        };
        if random.once_in(12) {
            mutation::edit(&mut bytes, &self.others, random);
        }
        bytes.truncate(MAX_PAYLOAD);
        bytes
    }
}

/// Appends a record to an input: action, length, reply.
fn put(input: &mut Vec<u8>, what: u8, reply: &[u8]) {
    input.push(what);
    input.extend((reply.len() as u16).to_le_bytes());
    input.extend(reply);
}

/// Takes the next record of an input: the card's action, and a reply.
fn next_record<'a>(input: &mut &'a [u8]) -> Option<(u8, &'a [u8])> {
    let (&[what, low, high], rest) = input.split_first_chunk()?;
    let length = usize::from(u16::from_le_bytes([low, high])).min(rest.len()).min(MAX_PAYLOAD);
    let (reply, rest) = rest.split_at(length);
    *input = rest;
    Some((what, reply))
}

/// Both ends of the link, with the dispatcher that deals tiles.
struct Ends<'a> {
    session: Session,
    card: Transport,
    dispatcher: Dispatcher<'a>,
    now: Duration,
}

impl Ends<'_> {
    /// Exchanges all pending frames, and advances the time by [`STEP`].
    fn step(&mut self, is_silent: bool) -> Result<(), SessionError> {
        for _ in 0..MAX_FRAMES {
            self.dispatcher.supply(0, &mut self.session, self.now);
            self.session.prepare();
            let wire = self.session.outgoing().to_vec();
            assert!(wire.len() <= MAX_FRAME, "more than a frame is sent at once");
            self.session.sent(wire.len(), self.now);
            let mut rest = &wire[..];
            while !rest.is_empty() && !is_silent {
                let (taken, _) = self.card.receive(rest);
                rest = &rest[taken..];
                while self.card.take().is_some() {}
                self.card.acknowledge();
            }
            let answer = if is_silent { Vec::new() } else { self.card.outgoing().to_vec() };
            self.card.sent(answer.len());
            self.session.receive(&answer, self.now)?;
            self.session.acknowledge();
            if wire.is_empty() && answer.is_empty() {
                break;
            }
        }
        self.now += STEP;
        self.session.tick(self.dispatcher.scheduler().slowest(0), self.now)
    }

    /// Handles the result of a step as a render does. Returns whether the session continues.
    fn goes_on(&mut self, result: &Result<(), SessionError>) -> bool {
        let may_pass = result.as_ref().err().is_some_and(SessionError::may_pass);
        if may_pass {
            self.session.restart(Restart::Lost, self.now);
        }
        let collected = self.dispatcher.collect(0, &mut self.session, self.now);
        collected.is_ok() && (may_pass || result.is_ok())
    }
}

impl Target for Sessions {
    fn name(&self) -> &'static str {
        "session"
    }

    fn allocation_bound(&self, input: usize) -> usize {
        bound(input, 16)
    }

    fn input(&self, random: &mut Random) -> Vec<u8> {
        let layers = random.below(2);
        let replies = &self.replies[layers];
        let mut input = vec![layers as u8];
        for _ in 0..1 + random.below(3) {
            let end = random.below(2 * replies.len()).min(replies.len());
            for sound in &replies[..end] {
                put(&mut input, random.below(4) as u8, &self.reply(replies, sound, random));
                if random.once_in(10) {
                    put(&mut input, if random.once_in(2) { RESET } else { WAIT }, &[]);
                }
            }
            put(&mut input, RESET, &[]);
        }
        input
    }

    fn read(&self, mut input: &[u8]) -> bool {
        let tiles = [0, 1].map(|id| Tile { id, x: SIDE * id, y: 0, width: SIDE, height: SIDE });
        let has_all = input.split_off_first().is_some_and(|first| first & 1 != 0);
        let format = SumFormat { form: FORMS[usize::from(has_all)], ..SumFormat::ONE };
        let film = Film::new(2 * SIDE, SIDE, Window::full(2 * SIDE, SIDE), format).expect("a small film");
        let film = Mutex::new(film);
        let mut ends = Ends {
            session: Session::new(1, Duration::ZERO),
            card: Transport::card(),
            dispatcher: Dispatcher::new(Scheduler::new(tiles.to_vec(), 1), vec![&film]),
            now: Duration::ZERO,
        };
        let frame = &self.frames[usize::from(has_all)];
        let photon_grid = PhotonGrid { origin: [0; 3], cell: 1e-6 };
        let limits = PixelLimits::new(&Header { reach: 1.0, photon_grid, ..Header::EMPTY }, frame);
        let job = Job { upload: self.upload.clone(), frame: *frame, limits };
        ends.session.start(job, ends.now);
        let mut was_loaded = false;
        while let Some((what, reply)) = next_record(&mut input) {
            match what {
                RESET => ends.card = Transport::card(),
                WAIT => ends.now += 40 * STEP,
                _ => {
                    // Before the reply, the host sends its command.
                    let result = ends.step(false);
                    if !ends.goes_on(&result) {
                        return was_loaded;
                    }
                    ends.card.send(|bytes| {
                        bytes.get_mut(..reply.len())?.copy_from_slice(reply);
                        Some(reply.len())
                    });
                }
            }
            let result = ends.step(false);
            if !ends.goes_on(&result) {
                return was_loaded;
            }
            was_loaded |= ends.session.is_loaded();
        }
        let is_complete = ends.dispatcher.scheduler().is_complete();
        let film = film.lock().expect("no thread has panicked");
        assert!(!is_complete || film.is_complete(), "a tile is done without its pixels");
        let is_finite =
            |pixel: PixelValue| pixel.radiance.iter().all(|value| value.is_finite() && *value >= 0.0);
        assert!(film.pixels().all(is_finite), "an impossible value has come into the film");
        drop(film);
        let ended = (0..MAX_STEPS).any(|_| ends.step(true).is_err());
        assert!(ended || is_complete, "a silent card is waited for without end");
        was_loaded
    }
}
