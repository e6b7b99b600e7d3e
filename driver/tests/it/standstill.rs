//! Standstill: cards that answer everything that the transport requests, without progress, or with wrong
//! answers. The session ends in a clear error.

use std::sync::Arc;
use std::time::Duration;

use photoncard_driver::photon_map::GatherParameters;
use photoncard_driver::render::{Integrator, Picture, RenderSettings};
use photoncard_driver::scene::Camera;
use photoncard_driver::session::{
    Assignment, Event, Job, LineFault, PixelLimits, Restart, Session, SessionError, Upload,
};
use photoncard_shared::address::Line;
use photoncard_shared::budget::Budget;
use photoncard_shared::counters::Counters;
use photoncard_shared::image::Header;
use photoncard_shared::layout::PhotonGrid;
use photoncard_shared::message::{Command, Drain, FrameParameters, PIXEL_BYTES, Reply, Tile};
use photoncard_shared::transport::Transport;

use crate::scripted_card::{Answer, Card, sound};

const TILE: Tile = Tile { id: 3, x: 0, y: 0, width: 4, height: 4 };

fn frame() -> FrameParameters {
    let camera = Camera::perspective(
        "camera",
        glam::Vec3::ZERO,
        [glam::Vec3::X, glam::Vec3::Y, glam::Vec3::NEG_Z],
        1.0,
        None,
    );
    RenderSettings {
        picture: Picture { width: 4, height: 4, ..Picture::default() },
        integrator: Integrator { gather_rays: 100, samples: 10, ..Integrator::default() },
        ..RenderSettings::default()
    }
    .frame(&camera, &GatherParameters::within(1.0))
}

const IMAGE_LINES: usize = 100;
const STEP: Duration = Duration::from_millis(100);

/// Limits of the pixels of an image in units of 1, with the grid of a small scene.
fn limits(frame: &FrameParameters) -> PixelLimits {
    let photon_grid = PhotonGrid { origin: [0; 3], cell: 1e-6 };
    PixelLimits::new(&Header { reach: 1.0, photon_grid, ..Header::EMPTY }, frame)
}

/// Session in virtual time.
struct Bench {
    session: Session,
    /// Tiles that wait for the card.
    waiting: Vec<Tile>,
    /// Maximum time of a ray, seconds, if known.
    slowest: Option<f64>,
    events: Vec<Event>,
    now: Duration,
}

impl Bench {
    fn new(frame: &FrameParameters) -> Self {
        let mut session = Session::new(1, Duration::ZERO);
        let upload = Arc::new(Upload::new(Arc::new(vec![Line::ZERO; IMAGE_LINES])));
        session.start(Job { upload, frame: *frame, limits: limits(frame) }, Duration::ZERO);
        Self { session, waiting: vec![TILE], slowest: None, events: Vec::new(), now: Duration::ZERO }
    }

    /// Bytes that the host sends now.
    fn outgoing(&mut self) -> Vec<u8> {
        if self.session.wants_tile()
            && let Some(tile) = self.waiting.pop()
        {
            self.session.give(Assignment { tile, is_suspect: false });
        }
        self.session.prepare();
        let bytes = self.session.outgoing().to_vec();
        self.session.sent(bytes.len(), self.now);
        bytes
    }

    /// Receives bytes of the card a moment later.
    fn take(&mut self, bytes: &[u8]) -> Result<(), SessionError> {
        self.now += STEP;
        let result = self.session.receive(bytes, self.now).and_then(|()| {
            self.session.acknowledge();
            self.session.tick(self.slowest, self.now)
        });
        self.collect();
        result
    }

    /// Handles events: lost tiles wait again.
    fn collect(&mut self) {
        while let Some(event) = self.session.next_event() {
            if let Event::TileLost { tile, .. } = event {
                self.waiting.push(tile);
            }
            self.events.push(event);
        }
    }

    fn greet_again(&mut self) {
        self.session.restart(Restart::Lost, self.now);
        self.collect();
    }

    /// Exchanges bytes for some time.
    fn go(&mut self, card: &mut Card, time: Duration) -> Result<(), SessionError> {
        let end = self.now + time;
        while self.now < end {
            let answered = card.step(&self.outgoing());
            self.take(&answered)?;
        }
        Ok(())
    }
}

/// Runs a session with a card until it fails. Returns the error, its time, and the events.
fn fail(answer: Answer) -> (SessionError, Duration, Vec<Event>) {
    fail_of_pace(answer, None)
}

/// Runs a session with a card until it fails, with a known maximum time of a ray.
fn fail_of_pace(answer: Answer, slowest: Option<f64>) -> (SessionError, Duration, Vec<Event>) {
    let frame = frame();
    let mut bench = Bench { slowest, ..Bench::new(&frame) };
    let result = bench.go(&mut Card::new(answer), Duration::from_secs(100_000));
    let error = result.expect_err("the session waits for ever");
    bench.session.give_back();
    bench.collect();
    (error, bench.now, bench.events)
}

/// Answers of a card that keeps its image.
fn keeping(command: &Command) -> Option<Reply<'static>> {
    match command {
        Command::ReadChecksums { first, .. } => Some(Reply::Checksums { first: *first, data: &[0; 8] }),
        command => sound(command).map(|reply| match reply {
            Reply::Hello { protocol, layout, budget, memory_use, build, board, .. } => {
                let written_lines = IMAGE_LINES as u32;
                Reply::Hello { protocol, layout, budget, written_lines, memory_use, build, board }
            }
            reply => reply,
        }),
    }
}

#[test]
fn of_several_tiles_whose_gathers_wait_in_card_memory_none_is_blamed_for_a_loss() {
    for (drain, tiles, blamed) in [(Drain::Sort, 2, 1), (Drain::Buckets, 3, 0), (Drain::Buckets, 1, 1)] {
        let frame = FrameParameters { drain, ..frame() };
        let mut bench = Bench::new(&frame);
        bench.waiting = (0..tiles).map(|id| Tile { id, ..TILE }).collect();
        bench.go(&mut Card::new(sound), Duration::from_secs(5)).unwrap();
        bench.greet_again();
        let lost = bench.events.iter().filter_map(|event| match event {
            Event::TileLost { was_at_work, .. } => Some(*was_at_work),
            _ => None,
        });
        let lost: Vec<bool> = lost.collect();
        let at_work = lost.iter().filter(|&&was_at_work| was_at_work).count();
        assert_eq!((lost.len(), at_work), (tiles as usize, blamed), "{drain:?}");
    }
}

#[test]
fn a_card_that_comes_no_further_is_not_waited_for_without_end() {
    let (error, after, _) = fail(|command| match command {
        Command::EndImage => None,
        command => sound(command),
    });
    assert!(matches!(error, SessionError::Standstill(_)), "{error}");
    assert!((120..125).contains(&after.as_secs()), "{after:?}");
}

#[test]
fn a_tile_has_time_for_all_its_rays() {
    let (error, after, events) = fail(sound);
    assert!(matches!(error, SessionError::Standstill(_)), "{error}");
    // 16 pixels of 10 samples, each with a hundred gather rays and some others.
    assert!((120 + 320..120 + 500).contains(&after.as_secs()), "{after:?}");
    assert_eq!(events, [Event::Ready, Event::TileLost { tile: TILE, was_at_work: true }]);
}

#[test]
fn a_tile_has_no_more_time_than_others_tell() {
    // 16 pixels of 10 samples of 110 rays with gathers.
    for (slowest, seconds) in [(1e-6, 30), (0.01, 352)] {
        let (error, after, _) = fail_of_pace(sound, Some(slowest));
        assert!(matches!(error, SessionError::Standstill(_)), "{error}");
        assert!((seconds..seconds + 5).contains(&after.as_secs()), "{after:?}");
    }
}

#[test]
fn a_card_that_never_says_hello_is_given_up() {
    let (error, after, _) = fail(|_| None);
    assert!(matches!(error, SessionError::Failures(_)), "{error}");
    assert!((20..40).contains(&after.as_secs()), "{after:?}");
}

#[test]
fn a_tile_whose_pixels_have_not_come_is_not_done_and_waits_again() {
    let (error, _, events) = fail(|command| match command {
        Command::RenderTile(tile) => Some(Reply::TileDone { tile: tile.id, counters: Counters::ZERO }),
        command => sound(command),
    });
    assert!(matches!(error, SessionError::Unexpected(_)), "{error}");
    assert_eq!(events, [Event::Ready, Event::TileLost { tile: TILE, was_at_work: true }]);
}

#[test]
fn the_hosts_own_absence_is_not_the_cards_silence() {
    let frame = frame();
    for absence in [11, 600].map(Duration::from_secs) {
        let (mut bench, mut card) = (Bench::new(&frame), Card::new(sound));
        let short = Duration::from_secs(5);
        bench.go(&mut card, short).unwrap();
        bench.now += absence;
        bench.go(&mut card, short).unwrap();
        // A silent card is lost nevertheless.
        let begin = bench.now;
        let error = loop {
            bench.outgoing();
            if let Err(error) = bench.take(&[]) {
                break error;
            }
        };
        let after = bench.now - begin;
        assert!(matches!(error, SessionError::Silent(_)) && after < Duration::from_secs(11), "{after:?}");
    }
}

/// A wrong bit rate, or log text in place of messages, from the start or after the card has answered.
#[test]
fn a_line_of_bytes_without_messages_is_no_silence() {
    let frame = frame();
    for noise in [&b"I (312) boot: ready\r\n"[..], &[0x80; 40], &[0; 7]] {
        for answers_first in [false, true] {
            let (mut bench, mut card) = (Bench::new(&frame), Card::new(sound));
            if answers_first {
                bench.go(&mut card, Duration::from_secs(5)).unwrap();
            }
            let begin = bench.now;
            let error = loop {
                bench.outgoing();
                if let Err(error) = bench.take(noise) {
                    break error;
                }
            };
            assert!(bench.now - begin < Duration::from_secs(11));
            // A frame that was cut off is no noise, if it is the last that comes.
            let is_noise = !answers_first || noise.len() > 7;
            assert_eq!(matches!(error, SessionError::Garbled { .. }), is_noise, "{error}");
            assert!(error.may_pass());
            assert!(!is_noise || error.to_string().contains("bytes have come"), "{error}");
        }
    }
}

/// Runs a session with a sound card whose bytes a line changes, until the session fails.
fn fail_on_line(mut change: impl FnMut(Vec<u8>) -> Vec<u8>) -> SessionError {
    let frame = frame();
    let (mut bench, mut card) = (Bench::new(&frame), Card::new(sound));
    loop {
        let answered = card.step(&bench.outgoing());
        if let Err(error) = bench.take(&change(answered)) {
            return error;
        }
    }
}

#[test]
fn a_line_that_damages_all_is_named_with_its_fault() {
    let error = fail_on_line(|bytes| bytes.iter().map(|byte| byte & 0x7f).collect());
    assert!(matches!(error, SessionError::Garbled { fault: LineFault::SevenBits, .. }), "{error}");
    // Every long frame loses a byte: probes are answered, and no hello comes.
    let error = fail_on_line(|mut bytes| {
        if bytes.len() > 60 {
            bytes.remove(40);
        }
        bytes
    });
    assert!(matches!(error, SessionError::BadLine(LineFault::Damage(4..))), "{error}");
    assert!(error.may_pass());
}

#[test]
fn an_echo_is_no_card() {
    let frame = frame();
    let mut bench = Bench::new(&frame);
    let sent = bench.outgoing();
    let error = bench.take(&sent).unwrap_err();
    assert!(matches!(error, SessionError::Echo) && !error.is_wrong() && !error.may_pass(), "{error}");
}

#[test]
fn a_flapping_link_is_not_the_cards_fault() {
    let frame = frame();
    let (mut bench, mut card) = (Bench::new(&frame), Card::new(keeping));
    for _ in 0..20 {
        bench.go(&mut card, Duration::from_secs(5)).unwrap();
        assert!(bench.session.is_loaded());
        bench.greet_again();
    }
}

/// The link closes at each crash: only the lost image reveals it.
#[test]
fn a_card_that_crashes_at_a_tile_is_given_up_whatever_its_link_does() {
    let frame = frame();
    let mut bench = Bench::new(&frame);
    let ended = (0..20).position(|_| {
        let result = bench.go(&mut Card::new(sound), Duration::from_secs(5));
        bench.greet_again();
        matches!(result, Err(SessionError::Failures(_)))
    });
    assert_eq!(ended, Some(5));
}

#[test]
fn a_card_that_comes_no_further_again_and_again_is_given_up() {
    let frame = frame();
    let (mut bench, mut card) = (Bench::new(&frame), Card::new(keeping));
    for _ in 0..4 {
        let error = bench.go(&mut card, Duration::from_secs(1000)).unwrap_err();
        assert!(matches!(error, SessionError::Standstill(_)), "{error}");
        bench.greet_again();
    }
    let error = bench.go(&mut card, Duration::from_secs(1000)).unwrap_err();
    assert!(matches!(error, SessionError::Failures(5)), "{error}");
}

#[test]
fn a_card_that_comes_back_with_another_budget_is_told_of() {
    let frame = frame();
    let mut bench = Bench::new(&frame);
    bench.go(&mut Card::new(sound), Duration::from_secs(5)).unwrap();
    let mut smaller = Card::new(|command| match sound(command)? {
        Reply::Hello { protocol, layout, budget, written_lines, memory_use, build, board } => {
            let budget = Budget { tile_pixels: 4, ..budget };
            Some(Reply::Hello { protocol, layout, budget, written_lines, memory_use, build, board })
        }
        reply => Some(reply),
    });
    let error = bench.go(&mut smaller, Duration::from_secs(5)).unwrap_err();
    assert!(matches!(error, SessionError::OtherBudget), "{error}");
}

/// The card is switched on late, and starts slowly.
#[test]
fn a_greeting_has_its_time_from_the_first_answer_on() {
    let frame = frame();
    let (mut bench, mut card) = (Bench::new(&frame), Transport::card());
    let mut sent = Vec::new();
    while bench.now < Duration::from_secs(8) {
        sent.extend(bench.outgoing());
        bench.take(&[]).unwrap();
    }
    while bench.now < Duration::from_secs(11) {
        let mut rest = &std::mem::take(&mut sent)[..];
        while !rest.is_empty() {
            rest = &rest[card.receive(rest).0..];
            let _ = card.take();
        }
        card.acknowledge();
        let answered = card.outgoing().to_vec();
        card.sent(answered.len());
        bench.take(&answered).unwrap();
        sent = bench.outgoing();
    }
    assert_eq!(bench.session.link_bytes().resets, 0);
}

/// Offset of the sum of red in the record of a pixel, bytes.
const RED: usize = 36;

/// Runs a session until it fails, with a card that sends a tile whose first pixel has the sum of red `$red`.
macro_rules! pixels_of_red {
    ($red:expr) => {{
        const PIXELS: [u8; PIXEL_BYTES * 16] = {
            let mut pixels = [0; PIXEL_BYTES * 16];
            let red = i64::to_le_bytes($red);
            let mut byte = 0;
            while byte < 8 {
                pixels[RED + byte] = red[byte];
                byte += 1;
            }
            pixels
        };
        fail(|command| match command {
            Command::RenderTile(tile) => Some(Reply::Pixels { tile: tile.id, first: 0, data: &PIXELS }),
            command => sound(command),
        })
    }};
}

#[test]
fn a_value_that_no_chip_can_render_is_named_with_its_pixel_and_tile() {
    for (error, _, events) in [pixels_of_red!(-1), pixels_of_red!(i64::MIN)] {
        let is_of_pixel = matches!(error, SessionError::Value { tile: TILE, x: 0, y: 0, .. });
        assert!(is_of_pixel && error.lie() == Some(TILE) && !error.may_pass(), "{error}");
        let said = error.to_string();
        assert!(said.contains("pixel (0, 0) of the tile 0,4,0,4 has radiance"), "{said}");
        assert!(!events.iter().any(|event| matches!(event, Event::TileDone(_))));
    }
    // The maximum of a chip's sum is valid.
    let (error, ..) = pixels_of_red!(i64::MAX);
    assert!(matches!(error, SessionError::Standstill(_)), "{error}");
}
