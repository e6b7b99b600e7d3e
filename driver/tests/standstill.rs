//! Cards that answer all that the transport asks, and come no further, or whose answers are wrong: the session ends in words.

mod scripted_card;

use std::time::Duration;

use photoncard_driver::film::{Film, Window};
use photoncard_driver::render::RenderSettings;
use photoncard_driver::scene::Camera;
use photoncard_driver::scheduler::Scheduler;
use photoncard_driver::session::{Job, Picture, Session, SessionError};
use photoncard_shared::address::Line;
use photoncard_shared::counters::Counters;
use photoncard_shared::message::{Command, FrameParameters, Reply, Tile};
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
        .frame(&camera, 1.0)
}

/// Runs a session with a card until it fails. Returns why, when, and how many tiles wait then.
fn fail(answer: Answer) -> (SessionError, Duration, Picture) {
    let picture =
        Picture::new(Scheduler::new(vec![TILE]), Film::new(4, 4, Window::full(4, 4)).unwrap(), None);
    let (image, frame) = ([Line::ZERO; 100], frame());
    let job = Job { image: &image, checksum: 0, frame: &frame };
    let mut card = Card::new(answer);
    let mut now = Duration::ZERO;
    let mut session = Session::new(1, now);
    session.start(job, now);
    loop {
        session.prepare(&picture);
        let bytes = session.outgoing().to_vec();
        session.sent(bytes.len(), now);
        let answered = card.step(&bytes);
        now += Duration::from_millis(100);
        let result = session.receive(&answered, &picture, now).and_then(|()| {
            session.acknowledge();
            session.tick(&picture, now)
        });
        if let Err(error) = result {
            session.give_back(&picture);
            return (error, now, picture);
        }
        assert!(now < Duration::from_secs(100_000), "the session waits for ever");
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
    assert!(matches!(error, SessionError::Resets(_)), "{error}");
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
