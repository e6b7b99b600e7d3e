//! Lost cards: the render continues on the others.
use std::io::{Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::Path;
use std::sync::Mutex;

use photoncard_driver::render::{
    CardError, CardSet, Integrator, Observer, Phase, PhotonMaps, Picture, RenderError, RenderSettings,
    Rendering, render,
};
use photoncard_driver::scene::gltf;
use photoncard_shared::budget::Budget;
use photoncard_shared::message::{Command, PROTOCOL_VERSION, Reply};
use rustix::net::{AddressFamily, SocketAddrUnix, SocketType, bind, listen, socket};

use crate::scripted_card::{Answer, Card, sound};

/// Observer that records lost cards, and stops the render after a number of them. A render that waits for a
/// lost card hangs, and the limit of the test ends it.
struct Losses {
    told: Mutex<Vec<String>>,
    most: usize,
}

impl Losses {
    fn new(most: usize) -> Self {
        Self { told: Mutex::default(), most }
    }
}

impl Observer for Losses {
    fn progress(&self, _: Phase, _: u64, _: u64) {}

    fn is_stopped(&self) -> bool {
        self.told.lock().unwrap().len() >= self.most
    }

    fn lost(&self, _: &str, error: &CardError) {
        self.told.lock().unwrap().push(error.to_string());
    }
}

/// Renders on an emulated card and on one at a Unix socket.
fn render_with(path: &Path, side: u32, losses: &Losses) -> Result<Rendering, RenderError> {
    let scene = format!("{}/../scenes/cornell.gltf", env!("CARGO_MANIFEST_DIR"));
    let cards = [format!("unix:{}", path.display()), "emulated:1".into()];
    let settings = RenderSettings {
        picture: Picture { width: side, height: side, ..Picture::default() },
        photons: PhotonMaps { count: 1000, ..PhotonMaps::default() },
        integrator: Integrator { gather_rays: 10, ..Integrator::default() },
        cards: CardSet {
            addresses: cards.iter().map(|card| card.parse().unwrap()).collect(),
            ..CardSet::default()
        },
        ..RenderSettings::default()
    };
    render(&gltf::load(scene.as_ref()).unwrap(), &settings, losses)
}

/// Answers a host until it sends a frame, or leaves.
fn serve(mut stream: UnixStream, answer: Answer) {
    let mut card = Card::new(answer);
    let mut buffer = [0; 4096];
    while !card.has_frame {
        match stream.read(&mut buffer) {
            Ok(count) if count > 0 => drop(stream.write_all(&card.step(&buffer[..count]))),
            _ => return,
        }
    }
}

#[test]
fn a_card_that_comes_back_as_another_is_told_of_and_given_up() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("card");
    let listener = UnixListener::bind(&path).unwrap();
    std::thread::spawn(move || {
        serve(listener.accept().unwrap().0, sound);
        let other = |command: &Command| match sound(command) {
            Some(Reply::Hello { layout, budget, written_lines, memory_use, build, board, .. }) => {
                let protocol = PROTOCOL_VERSION + 1;
                Some(Reply::Hello { protocol, layout, budget, written_lines, memory_use, build, board })
            }
            reply => reply,
        };
        serve(listener.accept().unwrap().0, other);
    });
    let losses = Losses::new(2);
    // The whole render would take hours.
    assert!(matches!(render_with(&path, 4096, &losses), Err(RenderError::Stopped)));
    let told = losses.told.into_inner().unwrap();
    assert!(told.len() == 2 && told[0].contains("closed") && told[1].contains("speaks protocol"), "{told:?}");
}

#[test]
fn a_render_ends_while_a_lost_card_is_tried() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("card");
    let listener = socket(AddressFamily::UNIX, SocketType::STREAM, None).unwrap();
    bind(&listener, &SocketAddrUnix::new(&path).unwrap()).unwrap();
    listen(&listener, 1).unwrap();
    std::thread::scope(|scope| {
        let first = scope.spawn(|| {
            let stream = UnixStream::from(rustix::net::accept(&listener).unwrap());
            // From now on the listener's queue is full: further connections wait.
            for _ in 0..3 {
                let path = path.clone();
                std::thread::spawn(move || drop(UnixStream::connect(path)));
            }
            serve(stream, sound);
        });
        let losses = Losses::new(usize::MAX);
        assert!(render_with(&path, 256, &losses).is_ok());
        assert_eq!(losses.told.lock().unwrap().len(), 1);
        first.join().unwrap();
    });
}

/// Answers of a card of another version.
fn other_version(command: &Command) -> Option<Reply<'static>> {
    match sound(command)? {
        Reply::Hello { layout, budget, written_lines, memory_use, build, board, .. } => {
            let protocol = PROTOCOL_VERSION + 1;
            Some(Reply::Hello { protocol, layout, budget, written_lines, memory_use, build, board })
        }
        reply => Some(reply),
    }
}

#[test]
fn a_card_that_fails_its_first_hello_is_lost_beside_another_and_told_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("card");
    let listener = UnixListener::bind(&path).unwrap();
    std::thread::spawn(move || serve(listener.accept().unwrap().0, other_version));
    for (path, said) in [(path, "speaks protocol"), (folder.path().join("absent"), "absent")] {
        let losses = Losses::new(usize::MAX);
        let rendering = render_with(&path, 32, &losses).unwrap();
        assert!(rendering.film.is_complete());
        assert_eq!((rendering.statistics.cards, rendering.statistics.cards_given_up), (2, 1));
        let told = losses.told.into_inner().unwrap();
        assert!(told.len() == 1 && told[0].contains(said), "{told:?}");
    }
}

/// Answers of a card of a budget that the settings or the scene exceed.
macro_rules! small {
    ($($field:ident: $value:expr),+) => {
        |command: &Command| match sound(command)? {
            Reply::Hello { protocol, layout, budget, written_lines, memory_use, build, board } => {
                let budget = Budget { $($field: $value),+, ..budget };
                Some(Reply::Hello { protocol, layout, budget, written_lines, memory_use, build, board })
            }
            reply => Some(reply),
        }
    };
}

#[test]
fn a_card_of_a_small_budget_is_left_out_beside_another_and_named() {
    let cases: [(Answer, &str); 4] = [
        (small!(neighbors: 7), "`photons.neighbors` 100 is not possible"),
        (small!(gather_rays: 3, samples: 2), "`integrator.gather_rays` 10 is not possible"),
        (small!(tile_pixels: 0), "`schedule.tile` 1 is not possible"),
        (small!(dram_bytes: 20_000), "bytes"),
    ];
    for (answer, said) in cases {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("card");
        let listener = UnixListener::bind(&path).unwrap();
        std::thread::spawn(move || serve(listener.accept().unwrap().0, answer));
        let losses = Losses::new(usize::MAX);
        let rendering = render_with(&path, 32, &losses).unwrap();
        assert!(rendering.film.is_complete());
        assert_eq!((rendering.statistics.cards, rendering.statistics.cards_given_up), (2, 1));
        let told = losses.told.into_inner().unwrap();
        assert!(told.len() == 1 && told[0].contains(said), "{told:?}");
    }
}

/// The card answers everything that the transport requests, but never renders a tile.
#[test]
fn a_card_that_never_renders_holds_up_no_other() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("card");
    let listener = UnixListener::bind(&path).unwrap();
    std::thread::spawn(move || {
        let mut stream = listener.accept().unwrap().0;
        let (mut card, mut buffer) = (Card::new(sound), [0; 4096]);
        while let Ok(count @ 1..) = stream.read(&mut buffer) {
            let _ = stream.write_all(&card.step(&buffer[..count]));
        }
    });
    let losses = Losses::new(usize::MAX);
    let rendering = render_with(&path, 64, &losses).unwrap();
    assert!(rendering.film.is_complete());
    assert!(losses.told.into_inner().unwrap().is_empty());
}
