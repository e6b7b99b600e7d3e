//! A host's session with a hostile card: replies that it did not ask for, mutated, in any order, and cards that are reset.

use std::time::Duration;

use photoncard_driver::film::{Film, Window};
use photoncard_driver::scheduler::Scheduler;
use photoncard_driver::session::{Job, Picture, Session, SessionError};
use photoncard_shared::address::Line;
use photoncard_shared::budget::{Budget, MICRO};
use photoncard_shared::counters::Counters;
use photoncard_shared::frame::{MAX_FRAME, MAX_PAYLOAD};
use photoncard_shared::image::LAYOUT_VERSION;
use photoncard_shared::message::{self, FrameParameters, PROTOCOL_VERSION, Reply, Tile};
use photoncard_shared::transport::Transport;

use super::{Random, Target, bound, messages, mutation};

/// Lines of the image: some chunks and a part of one.
const LINES: u32 = 200;
/// Sides of a tile, of which the picture is two.
const SIDE: u32 = 6;
/// Time of a step.
const STEP: Duration = Duration::from_millis(50);
/// Frames that the ends send each other in a step at the most.
const MOST_FRAMES: usize = 64;
/// Steps in which a session fails of which the card is silent.
const MOST_STEPS: usize = 400;

/// What the card does in a step: the first byte of each record of an input. Any other sends the reply that follows.
const RESET: u8 = 0xff;
const WAIT: u8 = 0xfe;

/// The target.
pub(super) struct Sessions {
    /// The replies of a sound session, in order.
    replies: Vec<Vec<u8>>,
    others: Vec<Vec<u8>>,
    image: Vec<Line>,
    frame: FrameParameters,
}

impl Sessions {
    pub(super) fn new() -> Self {
        let tile_pixels = [0; (SIDE * SIDE * 40) as usize];
        let (first, rest) = tile_pixels.split_at(25 * 40);
        let budget = Budget { tiles: 2, ..MICRO };
        let hello = |written_lines| Reply::Hello {
            protocol: PROTOCOL_VERSION,
            layout: LAYOUT_VERSION,
            budget,
            written_lines,
            memory_use: None,
            build: "a card",
        };
        let mut replies =
            vec![hello(LINES), Reply::Checksums { first: 0, data: &[7; 24] }, Reply::ImageAccepted];
        replies.push(Reply::FrameAccepted);
        for tile in 0..2 {
            replies.push(Reply::Pixels { tile, first: 0, data: first });
            replies.push(Reply::Pixels { tile, first: 25, data: rest });
            replies.push(Reply::TileDone { tile, counters: Counters::ZERO });
        }
        let encoded = |reply: &Reply| {
            let mut bytes = vec![0; MAX_PAYLOAD];
            let length = message::encode(reply, &mut bytes).expect("there is room for the reply");
            bytes.truncate(length);
            bytes
        };
        Self {
            replies: replies.iter().map(encoded).collect(),
            others: [messages::replies(), vec![encoded(&hello(0)), encoded(&hello(u32::MAX))]].concat(),
            image: vec![Line::ZERO; LINES as usize],
            frame: messages::frame(),
        }
    }

    /// A reply of a card that may be hostile.
    fn reply(&self, sound: &[u8], random: &mut Random) -> Vec<u8> {
        let mut bytes = match random.below(16) {
            0 => random.pick(&self.others).clone(),
            1 => random.pick(&self.replies).clone(),
            _ => sound.to_vec(),
        };
        if random.once_in(12) {
            mutation::edit(&mut bytes, &self.others, random);
        }
        bytes.truncate(MAX_PAYLOAD);
        bytes
    }
}

/// Appends a record of an input.
fn put(input: &mut Vec<u8>, what: u8, reply: &[u8]) {
    input.push(what);
    input.extend((reply.len() as u16).to_le_bytes());
    input.extend(reply);
}

/// The next record of an input: what the card does, and its reply.
fn next_record<'a>(input: &mut &'a [u8]) -> Option<(u8, &'a [u8])> {
    let (&[what, low, high], rest) = input.split_first_chunk()?;
    let length = usize::from(u16::from_le_bytes([low, high])).min(rest.len()).min(MAX_PAYLOAD);
    let (reply, rest) = rest.split_at(length);
    *input = rest;
    Some((what, reply))
}

/// Both ends of the link.
struct Ends<'a> {
    session: Session<'a>,
    card: Transport,
    picture: Picture,
    now: Duration,
}

impl Ends<'_> {
    /// Lets all pass that either end has to say, and some time.
    fn step(&mut self, is_silent: bool) -> Result<(), SessionError> {
        for _ in 0..MOST_FRAMES {
            self.session.prepare(&self.picture);
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
            self.session.receive(&answer, &self.picture, self.now)?;
            self.session.acknowledge();
            if wire.is_empty() && answer.is_empty() {
                break;
            }
        }
        self.now += STEP;
        self.session.tick(&self.picture, self.now)
    }

    /// What a render does with an error. Returns whether it goes on.
    fn goes_on(&mut self, result: &Result<(), SessionError>) -> bool {
        let may_pass = result.as_ref().err().is_some_and(SessionError::may_pass);
        if may_pass {
            self.session.greet_again(&self.picture, self.now);
        }
        may_pass || result.is_ok()
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
        let mut input = Vec::new();
        for _ in 0..1 + random.below(3) {
            let end = random.below(2 * self.replies.len()).min(self.replies.len());
            for sound in &self.replies[..end] {
                put(&mut input, random.below(4) as u8, &self.reply(sound, random));
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
        let film = Film::new(2 * SIDE, SIDE, Window::full(2 * SIDE, SIDE)).expect("a small film");
        let mut ends = Ends {
            session: Session::new(1, Duration::ZERO),
            card: Transport::card(),
            picture: Picture::new(Scheduler::new(tiles.to_vec()), film, None),
            now: Duration::ZERO,
        };
        let job = Job { image: &self.image, checksum: 0, frame: &self.frame };
        ends.session.start(job, ends.now);
        let mut was_loaded = false;
        while let Some((what, reply)) = next_record(&mut input) {
            match what {
                RESET => ends.card = Transport::card(),
                WAIT => ends.now += 40 * STEP,
                _ => {
                    // The host's command comes first.
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
        let is_complete = ends.picture.scheduler().is_complete();
        assert!(!is_complete || ends.picture.film().is_complete(), "a tile is done without its pixels");
        let ended = (0..MOST_STEPS).any(|_| ends.step(true).is_err());
        assert!(ended || is_complete, "a silent card is waited for without end");
        was_loaded
    }
}
