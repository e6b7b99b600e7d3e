//! Cards that answer all that the transport asks, and come no further, or whose answers are wrong: the session ends in words.

mod scripted_card;

use std::time::Duration;

use photoncard_driver::film::{Film, Window};
use photoncard_driver::render::RenderSettings;
use photoncard_driver::scene::Camera;
use photoncard_driver::scheduler::Scheduler;
use photoncard_driver::session::{Job, Picture, Session, SessionError};
use photoncard_shared::address::Line;
use photoncard_shared::budget::Budget;
use photoncard_shared::counters::Counters;
use photoncard_shared::message::{Command, FrameParameters, Reply, Tile};
use photoncard_shared::transport::Transport;
use scripted_card::{Answer, Card, sound};

const TILE: Tile = Tile { id: 3, x: 0, y: 0, width: 4, height: 4 };

fn frame() -> FrameParameters {
    let camera = Camera {
        name: "camera".into(),
        origin: glam::Vec3::ZERO,
        right: glam::Vec3::X,
        up: glam::Vec3::Y,
        forward: glam::Vec3::NEG_Z,
        vertical_fov: 1.0,
        aspect: None,
    };
    RenderSettings { width: 4, height: 4, gather_rays: 100, samples: 10, ..RenderSettings::default() }
        .frame(&camera, 1.0, None)
}

const IMAGE: [Line; 100] = [Line::ZERO; 100];
const STEP: Duration = Duration::from_millis(100);

/// A session in virtual time.
struct Bench<'a> {
    session: Session<'a>,
    picture: Picture,
    now: Duration,
}

impl<'a> Bench<'a> {
    fn new(frame: &'a FrameParameters) -> Self {
        let film = Film::new(4, 4, Window::full(4, 4)).unwrap();
        let mut session = Session::new(1, Duration::ZERO);
        session.start(Job { image: &IMAGE, checksum: 0, frame }, Duration::ZERO);
        Self { session, picture: Picture::new(Scheduler::new(vec![TILE]), film, None), now: Duration::ZERO }
    }

    /// What the host has to say now.
    fn outgoing(&mut self) -> Vec<u8> {
        self.session.prepare(&self.picture);
        let bytes = self.session.outgoing().to_vec();
        self.session.sent(bytes.len(), self.now);
        bytes
    }

    /// Takes what the card says a moment later.
    fn take(&mut self, bytes: &[u8]) -> Result<(), SessionError> {
        self.now += STEP;
        self.session.receive(bytes, &self.picture, self.now)?;
        self.session.acknowledge();
        self.session.tick(&self.picture, self.now)
    }

    /// Lets both ends speak for some time.
    fn go(&mut self, card: &mut Card, time: Duration) -> Result<(), SessionError> {
        let end = self.now + time;
        while self.now < end {
            let answered = card.step(&self.outgoing());
            self.take(&answered)?;
        }
        Ok(())
    }
}

/// Runs a session with a card until it fails. Returns why, when, and what is left of the picture then.
fn fail(answer: Answer) -> (SessionError, Duration, Picture) {
    let frame = frame();
    let mut bench = Bench::new(&frame);
    let result = bench.go(&mut Card::new(answer), Duration::from_secs(100_000));
    let error = result.expect_err("the session waits for ever");
    bench.session.give_back(&bench.picture);
    (error, bench.now, bench.picture)
}

/// The answers of a card that keeps what it was loaded with.
fn keeping(command: &Command) -> Option<Reply<'static>> {
    match command {
        Command::ReadChecksums { first, .. } => Some(Reply::Checksums { first: *first, data: &[0; 8] }),
        command => sound(command).map(|reply| match reply {
            Reply::Hello { protocol, layout, budget, memory_use, build, .. } => {
                let written_lines = IMAGE.len() as u32;
                Reply::Hello { protocol, layout, budget, written_lines, memory_use, build }
            }
            reply => reply,
        }),
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
    let (error, after, picture) = fail(sound);
    assert!(matches!(error, SessionError::Standstill(_)), "{error}");
    // 16 pixels of 10 samples of a hundred rays and some.
    assert!((120 + 320..120 + 500).contains(&after.as_secs()), "{after:?}");
    assert_eq!(picture.scheduler().take(), Some(TILE));
}

#[test]
fn a_card_that_never_says_hello_is_given_up() {
    let (error, after, _) = fail(|_| None);
    assert!(matches!(error, SessionError::Failures(_)), "{error}");
    assert!((20..40).contains(&after.as_secs()), "{after:?}");
}

#[test]
fn a_tile_whose_pixels_have_not_come_is_not_done_and_waits_again() {
    let (error, _, picture) = fail(|command| match command {
        Command::RenderTile(tile) => Some(Reply::TileDone { tile: tile.id, counters: Counters::ZERO }),
        command => sound(command),
    });
    assert!(matches!(error, SessionError::Unexpected(_)), "{error}");
    assert_eq!(picture.scheduler().take(), Some(TILE));
    assert!(!picture.scheduler().is_complete());
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
        // A card that is silent is lost all the same.
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

#[test]
fn a_flapping_link_is_not_the_cards_fault() {
    let frame = frame();
    let (mut bench, mut card) = (Bench::new(&frame), Card::new(keeping));
    for _ in 0..20 {
        bench.go(&mut card, Duration::from_secs(5)).unwrap();
        assert!(bench.session.is_loaded());
        bench.session.greet_again(&bench.picture, bench.now);
    }
}

/// Its link closes at each crash: that it has lost what it was loaded with is all that tells of it.
#[test]
fn a_card_that_crashes_at_a_tile_is_given_up_whatever_its_link_does() {
    let frame = frame();
    let mut bench = Bench::new(&frame);
    let ended = (0..20).position(|_| {
        let result = bench.go(&mut Card::new(sound), Duration::from_secs(5));
        bench.session.greet_again(&bench.picture, bench.now);
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
        bench.session.greet_again(&bench.picture, bench.now);
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
        Reply::Hello { protocol, layout, budget, written_lines, memory_use, build } => {
            let budget = Budget { tile_pixels: 4, ..budget };
            Some(Reply::Hello { protocol, layout, budget, written_lines, memory_use, build })
        }
        reply => Some(reply),
    });
    let error = bench.go(&mut smaller, Duration::from_secs(5)).unwrap_err();
    assert!(matches!(error, SessionError::OtherBudget), "{error}");
}

/// The card is switched on late, and takes its time.
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
