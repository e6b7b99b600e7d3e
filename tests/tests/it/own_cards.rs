//! Cards as other crates build them: on devices with the traits of `embedded-io`, with memory that the
//! processor does not address, and with a scene in flash. They render the pixels of the emulated card.
#![cfg(unix)]

use std::future::Future;
use std::io::{self, ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::panic::{self, AssertUnwindSafe};
use std::pin::pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::task::{Context, Poll, Wake, Waker};
use std::thread;

use photoncard_driver::render::{
    CardAddress, CardSet, Integrator, PhotonMaps, Picture, RenderSettings, Rendering, Unobserved, card_info,
    render,
};
use photoncard_driver::scene::{Scene, gltf};
use photoncard_firmware::card::Card;
use photoncard_firmware::kind::{FixedKind, Micro, Nano};
use photoncard_firmware::memory::{CardMemory, Dram, LineDevice, Resident, Unmapped};
use photoncard_firmware::serve::{ServeError, serve, serve_async};
use photoncard_shared::address::{LINE_BYTES, Line};
use photoncard_shared::image::{HEADER_LINES, Header};
use photoncard_shared::link::{IoPort, PortError};
use photoncard_shared::message::{Board, CHUNK_LINES};
use photoncard_tests::render_or_panic;

/// Device of a link: a socket that never blocks.
struct Device(TcpStream);

impl Device {
    fn accept(listener: &TcpListener) -> Self {
        let (socket, _) = listener.accept().unwrap();
        socket.set_nodelay(true).unwrap();
        socket.set_nonblocking(true).unwrap();
        Self(socket)
    }
}

/// A host that leaves in the middle of a message resets the connection: that is the end of the link as well.
fn moved(result: io::Result<usize>) -> Poll<usize> {
    match result {
        Ok(count) => Poll::Ready(count),
        Err(error) if error.kind() == ErrorKind::WouldBlock => Poll::Pending,
        Err(_) => Poll::Ready(0),
    }
}

impl embedded_io::ErrorType for Device {
    type Error = embedded_io::ErrorKind;
}

impl embedded_io::ReadReady for Device {
    fn read_ready(&mut self) -> Result<bool, Self::Error> {
        Ok(moved(self.0.peek(&mut [0])).is_ready())
    }
}

impl embedded_io::WriteReady for Device {
    fn write_ready(&mut self) -> Result<bool, Self::Error> {
        Ok(true)
    }
}

impl embedded_io::Read for Device {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Self::Error> {
        match moved(self.0.read(buffer)) {
            Poll::Ready(count) => Ok(count),
            Poll::Pending => panic!("a read waits"),
        }
    }
}

impl embedded_io::Write for Device {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Self::Error> {
        loop {
            if let Poll::Ready(count) = moved(self.0.write(bytes)) {
                return Ok(count);
            }
            thread::yield_now();
        }
    }

    fn flush(&mut self) -> Result<(), Self::Error> {
        Ok(())
    }
}

/// Half of a device in an executor. It wakes its task until bytes can be moved.
struct Half(TcpStream);

impl embedded_io::ErrorType for Half {
    type Error = embedded_io::ErrorKind;
}

impl embedded_io_async::Read for Half {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Self::Error> {
        std::future::poll_fn(|context| {
            let result = moved(self.0.read(buffer));
            context.waker().wake_by_ref();
            result.map(Ok)
        })
        .await
    }
}

impl embedded_io_async::Write for Half {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Self::Error> {
        std::future::poll_fn(|context| {
            // A UART takes few bytes at a time.
            let result = moved(self.0.write(&bytes[..bytes.len().min(16)]));
            context.waker().wake_by_ref();
            result.map(Ok)
        })
        .await
    }

    async fn flush(&mut self) -> Result<(), Self::Error> {
        Ok(())
    }
}

struct Nobody;

impl Wake for Nobody {
    fn wake(self: Arc<Self>) {}
}

fn block_on<T>(future: impl Future<Output = T>) -> T {
    let mut future = pin!(future);
    let waker = Waker::from(Arc::new(Nobody));
    loop {
        if let Poll::Ready(result) = future.as_mut().poll(&mut Context::from_waker(&waker)) {
            return result;
        }
        thread::yield_now();
    }
}

/// Memory on a device that reads single lines, and fails from line `broken` on.
struct Chip {
    lines: Vec<Line>,
    broken: u32,
}

impl LineDevice for Chip {
    type Error = ();

    fn lines(&self) -> u32 {
        self.lines.len() as u32
    }

    fn read(&mut self, first: u32, lines: &mut [Line]) -> Result<(), ()> {
        assert!(!lines.is_empty());
        let end = first as usize + lines.len();
        lines.copy_from_slice(&self.lines[first as usize..end]);
        if end as u32 > self.broken { Err(()) } else { Ok(()) }
    }

    fn write(&mut self, first: u32, lines: &[[u8; LINE_BYTES]]) -> Result<(), ()> {
        for (target, line) in self.lines[first as usize..].iter_mut().zip(lines) {
            target.0 = *line;
        }
        Ok(())
    }
}

fn cornell() -> Scene {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/cornell.gltf");
    gltf::load(path.as_ref()).expect("a shipped scene loads")
}

fn settings(card: &str) -> RenderSettings {
    RenderSettings {
        picture: Picture { width: 24, height: 20, ..Picture::default() },
        photons: PhotonMaps { count: 3000, neighbors: 60, ..PhotonMaps::default() },
        integrator: Integrator { gather_rays: 6, irradiance_error: Some(0.2), ..Integrator::default() },
        cards: CardSet { addresses: vec![card.parse().expect("a card")], ..CardSet::default() },
        ..RenderSettings::default()
    }
}

/// Serves hosts one after another, by `serve`, while `visit` runs with the card's address.
fn served(mut serve: impl FnMut(&TcpListener) + Send, visit: impl FnOnce(&str)) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let is_over = AtomicBool::new(false);
    thread::scope(|scope| {
        let card = thread::Builder::new().stack_size(16 << 20);
        let is_over = &is_over;
        let serve = move || {
            while !is_over.load(Ordering::Acquire) {
                serve(&listener);
            }
        };
        card.spawn_scoped(scope, serve).unwrap();
        let result = panic::catch_unwind(AssertUnwindSafe(|| visit(&format!("tcp:{address}"))));
        is_over.store(true, Ordering::Release);
        // A host that leaves at once ends the card's thread, even if the test fails.
        drop(TcpStream::connect(address));
        result.unwrap_or_else(|panic| panic::resume_unwind(panic));
    });
}

fn serve_polled<K: FixedKind>(card: &mut Card<K, impl CardMemory>, listener: &TcpListener) {
    let mut port = IoPort::new(Device::accept(listener));
    assert_eq!(serve(card, &mut port), Err(PortError::Closed));
}

/// Error of a render with its causes.
fn failure(scene: &Scene, settings: &RenderSettings) -> String {
    let Err(error) = render(scene, settings, &Unobserved) else { panic!("the render succeeds") };
    let causes = std::iter::successors(Some(&error as &dyn std::error::Error), |error| error.source());
    causes.map(ToString::to_string).collect::<Vec<_>>().join(": ")
}

fn assert_equal(found: &Rendering, expected: &Rendering) {
    for (index, (sums, expected)) in found.film.sums().zip(expected.film.sums()).enumerate() {
        assert_eq!(sums, expected, "pixel {index}");
    }
}

#[test]
fn a_card_on_polled_devices_and_unmapped_memory_renders_the_emulated_card_s_pixels() {
    let scene = cornell();
    let chip = Chip { lines: vec![Line::ZERO; (16 << 20) / LINE_BYTES], broken: u32::MAX };
    let mut card = Box::new(Card::<Micro, _>::new(Unmapped::<_, 4>::new(chip)));
    let expected = render_or_panic(&scene, &settings("emulated-micro:1"));
    served(
        |listener| serve_polled(&mut card, listener),
        |address| {
            for number in 0..2 {
                let found = render_or_panic(&scene, &settings(address));
                assert_equal(&found, &expected);
                assert_eq!(found.statistics.link.payload_bytes < found.statistics.image_bytes, number == 1);
            }
        },
    );
}

#[test]
fn a_card_in_an_executor_renders_the_emulated_card_s_pixels() {
    let scene = cornell();
    let mut memory = vec![Line::ZERO; (1 << 20) / LINE_BYTES];
    let mut card = Box::new(Card::<Nano, _>::new(Dram::new(&mut memory)));
    let expected = render_or_panic(&scene, &settings("emulated-nano:1"));
    let serve = |listener: &TcpListener| {
        let Device(socket) = Device::accept(listener);
        let (mut reader, mut writer) = (Half(socket.try_clone().unwrap()), Half(socket));
        let end = block_on(serve_async(&mut card, &mut reader, &mut writer));
        assert_eq!(end, ServeError::Closed);
    };
    served(serve, |address| assert_equal(&render_or_panic(&scene, &settings(address)), &expected));
    assert_equal(&render_or_panic(&scene, &settings("emulated-micro:1")), &expected);
}

#[test]
fn a_scene_in_flash_is_not_sent_and_another_is_refused() {
    let scene = cornell();
    let mut memory = vec![Line::ZERO; (1 << 20) / LINE_BYTES];
    let mut first = Box::new(Card::<Nano, _>::new(Dram::new(&mut memory)));
    let mut expected = None;
    served(
        |listener| serve_polled(&mut first, listener),
        |address| expected = Some(render_or_panic(&scene, &settings(address))),
    );
    let expected = expected.unwrap();
    let head: &[Line; HEADER_LINES] = memory.first_chunk().unwrap();
    let image = memory[..Header::read(head).unwrap().lines as usize].to_vec();

    let mut rest = vec![Line::ZERO; 500];
    let mut card = Box::new(Card::<Nano, _>::new(Resident::new(&image, Dram::new(&mut rest))));
    served(
        |listener| serve_polled(&mut card, listener),
        |address| {
            let found = render_or_panic(&scene, &settings(address));
            assert_equal(&found, &expected);
            // An incomplete chunk at the end of the image has no checksum of its own.
            let sent: u64 = found.statistics.link.image_bytes.iter().sum();
            assert_eq!(sent, (image.len() % CHUNK_LINES as usize * LINE_BYTES) as u64);
            let mut other = settings(address);
            other.integrator.seed = 7;
            let text = failure(&scene, &other);
            assert!(text.contains("read-only"), "{text}");
        },
    );
}

#[test]
fn a_failure_of_the_memory_s_device_is_a_fault_that_names_the_line() {
    let scene = cornell();
    let chip = Chip { lines: vec![Line::ZERO; 8192], broken: 100 };
    let mut card = Box::new(Card::<Nano, _>::new(Unmapped::<_, 1>::new(chip)));
    served(
        |listener| serve_polled(&mut card, listener),
        |address| {
            let text = failure(&scene, &settings(address));
            assert!(text.contains("line 100 of the card's memory"), "{text}");
        },
    );
}

/// Counter that advances by a thousand cycles at each reading, and wraps within the test.
fn cycles() -> u32 {
    static CYCLES: AtomicU32 = AtomicU32::new(u32::MAX - 5000);
    CYCLES.fetch_add(1000, Ordering::Relaxed)
}

#[test]
fn a_board_states_its_name_and_its_cycles() {
    let scene = cornell();
    let mut memory = vec![Line::ZERO; (1 << 20) / LINE_BYTES];
    let mut card = Box::new(Card::<Nano, _>::new(Dram::new(&mut memory)));
    let long = "é".repeat(40).leak();
    card.run_on(Board { name: "a board", serial_number: long, clock_hz: 150_000_000 });
    card.count_cycles_by(cycles);
    served(
        |listener| serve_polled(&mut card, listener),
        |address| {
            let address: CardAddress = address.parse().unwrap();
            let board = card_info(&address).unwrap().board.expect("it is a board");
            assert_eq!((&*board.name, board.clock_hz), ("a board", 150_000_000));
            assert_eq!(board.serial_number, "é".repeat(32), "it is cut between characters");
            let settings = RenderSettings {
                cards: CardSet { addresses: vec![address], ..CardSet::default() },
                ..settings("emulated:1")
            };
            let statistics = render_or_panic(&scene, &settings).statistics;
            let cycles = statistics.cycles.expect("the board counts them");
            assert!(cycles.is_multiple_of(1000) && (10_000..1_000_000_000).contains(&cycles), "{cycles}");
        },
    );
    let emulated = render_or_panic(&scene, &settings("emulated-nano:1")).statistics;
    assert_eq!(emulated.cycles, None);
}
