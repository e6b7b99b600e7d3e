//! The firmware's images on the machines that QEMU emulates render what the emulated card renders, bit for bit.
#![cfg(unix)]

use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use photoncard_driver::emitter::Emitters;
use photoncard_driver::film::Film;
use photoncard_driver::pack::PackedScene;
use photoncard_driver::photon::map_photons;
use photoncard_driver::render::RenderSettings;
use photoncard_driver::scene::{Scene, gltf};
use photoncard_driver::scheduler::{Scheduler, tiles};
use photoncard_driver::session::{Job, Picture, Session};
use photoncard_shared::budget::MICRO;
use photoncard_shared::frame::Checksum;
use photoncard_shared::link::{Port, PortError};
use photoncard_tests::render_or_panic;

/// How long a machine may take to be built and to start.
const START: Duration = Duration::from_secs(600);
/// How long a port waits for a byte.
const WAIT: Duration = Duration::from_millis(20);

/// Prints a line that is seen although the test passes.
fn say(line: &str) {
    // Where there is nobody to read it the test goes on.
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// A card's UART as a socket.
struct SocketPort(UnixStream);

impl Port for SocketPort {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, PortError> {
        // A socket takes no wait of zero.
        let wait = wait.max(Duration::from_micros(1));
        self.0.set_read_timeout(Some(wait)).map_err(|_| PortError::Device(0))?;
        match self.0.read(buffer) {
            Ok(0) => Err(PortError::Closed),
            Ok(count) => Ok(count),
            Err(error) => none_if_it_waited(&error),
        }
    }

    fn write(&mut self, bytes: &[u8], wait: Duration) -> Result<usize, PortError> {
        let wait = wait.max(Duration::from_micros(1));
        self.0.set_write_timeout(Some(wait)).map_err(|_| PortError::Device(0))?;
        self.0.write(bytes).or_else(|error| none_if_it_waited(&error))
    }
}

fn none_if_it_waited(error: &std::io::Error) -> Result<usize, PortError> {
    match error.kind() {
        ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted => Ok(0),
        _ => Err(PortError::Closed),
    }
}

/// A running machine, with its image.
struct Machine {
    process: Child,
    /// What the image prints.
    lines: Receiver<String>,
    directory: tempfile::TempDir,
}

impl Machine {
    fn start(name: &str) -> Self {
        let directory = tempfile::tempdir().expect("a directory for the socket");
        let socket = directory.path().join("uart");
        let mut process = Command::new(PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("qemu.sh"))
            .args([name, &format!("unix:{}", socket.display())])
            .stderr(Stdio::piped())
            .spawn()
            .expect("tests/qemu.sh starts");
        let output = process.stderr.take().expect("it is piped");
        let (sender, lines) = channel();
        std::thread::spawn(move || {
            for line in BufReader::new(output).lines().map_while(Result::ok) {
                if sender.send(line).is_err() {
                    break;
                }
            }
        });
        let mut machine = Self { process, lines, directory };
        machine.wait_for(name, "ready");
        machine
    }

    /// Prints what comes up to a line.
    fn wait_for(&mut self, name: &str, last: &str) {
        let start = Instant::now();
        loop {
            match self.lines.recv_timeout(START.saturating_sub(start.elapsed())) {
                Ok(line) => {
                    say(&format!("{name}: {line}"));
                    if line == last {
                        return;
                    }
                }
                Err(RecvTimeoutError::Timeout) => panic!("{name} did not say {last:?}"),
                Err(RecvTimeoutError::Disconnected) => panic!(
                    "{name} ended: {}; to leave these tests out, set PHOTONCARD_SKIP_QEMU to the reason",
                    self.process.wait().expect("it was started")
                ),
            }
        }
    }

    /// The most bytes of the stack that were in use, and its size, as the image says when it is idle.
    fn stack(&self, name: &str) -> Option<(usize, usize)> {
        let mut last = None;
        while let Ok(line) = self.lines.recv_timeout(Duration::from_millis(500)) {
            say(&format!("{name}: {line}"));
            let numbers: Vec<usize> = line.split(' ').filter_map(|word| word.parse().ok()).collect();
            if let (true, [used, size]) = (line.starts_with("stack "), &numbers[..]) {
                last = Some((*used, *size));
            }
        }
        last
    }

    fn port(&self) -> SocketPort {
        let socket = UnixStream::connect(self.directory.path().join("uart"));
        SocketPort(socket.expect("QEMU listens before its machine runs"))
    }
}

impl Drop for Machine {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// Renders on a card at a port, and tells how long it took.
fn render_on(name: &str, port: &mut impl Port, scene: &Scene, settings: &RenderSettings) -> Film {
    let packed = PackedScene::new(scene, &Emitters::new(scene)).expect("a shipped scene packs");
    let mapped = map_photons(packed, &settings.photon_settings(), &|_| true).expect("photons");
    let mut checksum = Checksum::default();
    mapped.image.lines().iter().for_each(|line| checksum.update(&line.0));
    let camera = scene.camera(None).expect("a shipped scene has a camera");
    let frame = settings.frame(camera, mapped.max_distance);
    let job = Job { image: mapped.image.lines(), checksum: checksum.value(), frame: &frame };
    let all = tiles(settings.window(), settings.tile, settings.order);
    let count = all.len();
    let film = Film::new(settings.width, settings.height, settings.window()).expect("a small film");
    let mut picture = Picture { scheduler: Scheduler::new(all), film };

    let start = Instant::now();
    let mut session = Session::new(start.elapsed());
    while session.budget().is_none() {
        exchange(&mut session, port, &mut picture, start);
    }
    assert_eq!(session.budget(), Some(&MICRO));
    session.start(job, start.elapsed());
    let mut loaded = Duration::ZERO;
    while !session.is_done() {
        exchange(&mut session, port, &mut picture, start);
        if !session.is_loaded() {
            loaded = start.elapsed();
        }
    }
    let rendering = start.elapsed() - loaded;
    let gathers = session.counters().gathers;
    say(&format!(
        "{name}: {} bytes loaded in {loaded:.1?}; {count} tiles, {gathers} gathers in {rendering:.1?}: {:.1?} a tile",
        mapped.image.bytes(),
        rendering / count as u32
    ));
    picture.film
}

/// Moves bytes once in each direction.
fn exchange(session: &mut Session, port: &mut impl Port, picture: &mut Picture, start: Instant) {
    session.prepare(picture);
    if !session.outgoing().is_empty() {
        let sent = port.write(session.outgoing(), WAIT).expect("the machine runs");
        session.sent(sent, start.elapsed());
    }
    let mut buffer = [0; 8192];
    let wait = if session.has_more_to_send() { Duration::ZERO } else { WAIT };
    let received = port.read(&mut buffer, wait).expect("the machine runs");
    session.receive(&buffer[..received], picture, start.elapsed()).expect("the card answers as it should");
    session.check_silence(start.elapsed()).expect("the card answers in time");
}

/// The Cornell box as a small frame, with as many gather rays as `PHOTONCARD_QEMU_GATHER_RAYS` says.
fn settings() -> RenderSettings {
    let gather_rays = std::env::var("PHOTONCARD_QEMU_GATHER_RAYS").map(|text| text.parse());
    RenderSettings {
        width: 64,
        height: 64,
        photons: 20_000,
        gather_rays: gather_rays.unwrap_or(Ok(4)).expect("a number of gather rays"),
        irradiance_error: None,
        cards: vec!["emulated-micro:1".parse().expect("a card")],
        ..RenderSettings::default()
    }
}

fn renders_as_the_emulated_card(name: &str) {
    if let Ok(reason) = std::env::var("PHOTONCARD_SKIP_QEMU") {
        say(&format!("SKIPPED: {name} is not tested, as PHOTONCARD_SKIP_QEMU is set: {reason}"));
        return;
    }
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../scenes/cornell.gltf");
    let scene = gltf::load(&path).expect("a shipped scene loads");
    let machine = Machine::start(name);
    let plain = settings();
    let cached = RenderSettings { irradiance_error: Some(0.1), ..settings() };
    for settings in [plain, cached] {
        let film = render_on(name, &mut machine.port(), &scene, &settings);
        let expected = render_or_panic(&scene, &settings).film;
        assert_eq!(film.pixels().len(), 64 * 64);
        for (index, (pixel, expected)) in film.pixels().iter().zip(expected.pixels()).enumerate() {
            assert_eq!(pixel.to_bytes(), expected.to_bytes(), "pixel {index}: {pixel:?}, not {expected:?}");
        }
    }
    let (used, size) = machine.stack(name).expect("the image tells how much of its stack is used");
    assert!(used < size && size <= MICRO.stack_bytes as usize);
}

#[test]
fn an_arm_board_renders_the_same_picture() {
    renders_as_the_emulated_card("mps2-an386");
}

#[test]
fn a_risc_v_board_renders_the_same_picture() {
    renders_as_the_emulated_card("virt");
}
