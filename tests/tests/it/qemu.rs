//! Board images on machines of QEMU render the same bits as the emulated card.
#![cfg(unix)]

use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::net::{Ipv4Addr, Shutdown, SocketAddr, TcpListener, TcpStream};
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

use photoncard_driver::link::LineFaults;
use photoncard_driver::render::{
    CardAddress, CardSet, Integrator, MemoryUse, PatternTest, PhotonMaps, Picture, RenderSettings, Renderer,
    Unobserved, card_info, card_self_test,
};
use photoncard_driver::scene::{Scene, gltf};
use photoncard_firmware::card::MicroCard;
use photoncard_firmware::kind::MICRO;
use photoncard_firmware::memory::Dram;
use photoncard_tests::everything::everything;
use photoncard_tests::{render_or_panic, skip};

/// Time limit for building a board image and starting the machine.
const START: Duration = Duration::from_secs(600);
/// Time limit for a card to close a connection. Its clock is late on a busy host.
const PATIENCE: Duration = Duration::from_secs(120);

/// Prints a line even if the test passes.
fn say(line: &str) {
    // A closed standard error does not end the test.
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// Process of QEMU that runs a board image.
struct Machine {
    process: Child,
    /// Lines that QEMU and `tests/qemu.sh` print.
    lines: Receiver<String>,
}

/// Sends the lines of a stream to a channel.
fn forward(stream: impl Read + Send + 'static, sender: Sender<String>) {
    std::thread::spawn(move || {
        for line in BufReader::new(stream).lines().map_while(Result::ok) {
            if sender.send(line).is_err() {
                break;
            }
        }
    });
}

impl Machine {
    /// Starts a machine with a UART, and waits until its card is ready. Also returns the card's address.
    fn start(name: &str) -> (Self, CardAddress) {
        Self::on_pty(name, "qemu.sh", "pty", false)
    }

    /// Starts a machine with a card made from a template, which says nothing, and waits for its pty.
    fn start_template(name: &str) -> (Self, CardAddress) {
        Self::on_pty(name, "template.sh", "run", true)
    }

    fn on_pty(name: &str, script: &str, argument: &str, is_mute: bool) -> (Self, CardAddress) {
        let (mut machine, start) = Self::build(script, name, argument);
        let (mut address, mut is_ready) = (None, is_mute);
        while address.is_none() || !is_ready {
            let line = machine.next_line(name, START.saturating_sub(start.elapsed()));
            is_ready |= line == "ready";
            if let Some(path) = line.split(' ').find(|word| word.starts_with("/dev/")) {
                address = Some(format!("serial:{path}").parse().expect("an address"));
            }
        }
        (machine, address.expect("the loop ends with one"))
    }

    /// Starts a machine on a network, and waits until its card is ready. Also returns where it is reached.
    fn start_on_network(name: &str) -> (Self, SocketAddr) {
        // A port that is free now.
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).expect("a free port");
        let address = listener.local_addr().expect("it is bound");
        drop(listener);
        let (mut machine, start) = Self::build("qemu.sh", name, &address.port().to_string());
        while machine.next_line(name, START.saturating_sub(start.elapsed())) != "ready" {}
        (machine, address)
    }

    /// Starts a script that builds an image and runs its machine.
    fn build(script: &str, name: &str, argument: &str) -> (Self, Instant) {
        let mut process = Command::new(PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(script))
            .args([name, argument])
            .process_group(0)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the script starts");
        let (sender, lines) = channel();
        forward(process.stdout.take().expect("it is piped"), sender.clone());
        forward(process.stderr.take().expect("it is piped"), sender);
        (Self { process, lines }, Instant::now())
    }

    fn next_line(&mut self, name: &str, wait: Duration) -> String {
        match self.lines.recv_timeout(wait) {
            Ok(line) => {
                say(&format!("{name}: {line}"));
                line
            }
            Err(RecvTimeoutError::Timeout) => panic!("{name} is not ready"),
            Err(RecvTimeoutError::Disconnected) => panic!(
                "{name} ended: {}; to leave these tests out, set PHOTONCARD_SKIP_QEMU to the reason",
                self.process.wait().expect("it was started")
            ),
        }
    }
}

impl Drop for Machine {
    fn drop(&mut self) {
        // The process may have ended already. A script that waits for QEMU ends with it.
        let group = rustix::process::Pid::from_child(&self.process);
        let _ = rustix::process::kill_process_group(group, rustix::process::Signal::TERM);
        let _ = self.process.wait();
    }
}

/// Returns whether to render the frame whose times are in docs/bring-up.md, which takes minutes.
fn is_full() -> bool {
    std::env::var_os("PHOTONCARD_QEMU_FULL").is_some()
}

/// Side of the picture of the Cornell box, pixels, and number of photons.
fn scale() -> (u32, usize) {
    if is_full() { (64, 20_000) } else { (24, 4000) }
}

/// Settings of a small picture, with `PHOTONCARD_QEMU_GATHER_RAYS` gather rays a sample, by default 8.
fn settings() -> RenderSettings {
    let (side, photons) = scale();
    let gather_rays = std::env::var("PHOTONCARD_QEMU_GATHER_RAYS").map(|text| text.parse());
    RenderSettings {
        picture: Picture { width: side, height: side, ..Picture::default() },
        photons: PhotonMaps { count: photons, ..PhotonMaps::default() },
        integrator: Integrator {
            gather_rays: gather_rays.unwrap_or(Ok(8)).expect("a number of gather rays"),
            irradiance_error: None,
            ..Integrator::default()
        },
        cards: CardSet { addresses: vec!["emulated-micro:1".parse().expect("a card")], ..CardSet::default() },
        ..RenderSettings::default()
    }
}

/// Faults of links to render with, from `PHOTONCARD_QEMU_FAULTS`, separated by blanks.
fn faults() -> Vec<LineFaults> {
    let asked = std::env::var("PHOTONCARD_QEMU_FAULTS");
    let asked = asked.as_deref().unwrap_or("flips=3e-4,drops=5e-5,repeats=5e-5,delays=3e-4,seed=1");
    asked.split_whitespace().map(|faults| faults.parse().expect("faults of a line")).collect()
}

/// Returns whether machines cannot be tested, and says so.
fn is_left_out(name: &str) -> bool {
    let reason = std::env::var("PHOTONCARD_SKIP_QEMU");
    if let Ok(reason) = &reason {
        skip(&format!("{name} is not tested, as PHOTONCARD_SKIP_QEMU is set: {reason}"));
    }
    reason.is_ok()
}

fn cornell_box() -> Scene {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../scenes/cornell.gltf");
    gltf::load(&path).expect("a shipped scene loads")
}

fn renders_over_a_uart(name: &str) {
    if !is_left_out(name) {
        let (machine, address) = Machine::start(name);
        renders_as_the_emulated_card(name, &address);
        drop(machine);
    }
}

fn renders_as_the_emulated_card(name: &str, address: &CardAddress) {
    let scene = cornell_box();
    let cached = settings().with(|s| s.integrator.irradiance_error = Some(0.1));
    // Renders with faults have other photons: most lines of their card image have to be sent.
    let mut renders = vec![(settings(), None), (cached, None)];
    for (seed, faults) in (1..).zip(faults()) {
        renders.push((
            settings().with(|s| {
                s.photons.count = scale().1 / 2;
                s.integrator.seed = seed;
            }),
            Some(faults),
        ));
    }
    for (number, (settings, faults)) in renders.into_iter().enumerate() {
        let expected = render_or_panic(&scene, &settings).film;
        let remote = settings.with(|s| {
            s.cards.addresses = vec![address.clone()];
            s.cards.faults = faults;
        });
        let rendering = render_or_panic(&scene, &remote);
        let (statistics, sums) = (&rendering.statistics, rendering.film.sums());
        say(&format!(
            "{name}: {}load {:.1} s, render {:.1} s, {} gathers, {:?}",
            faults.map_or(String::new(), |faults| format!("{faults}: ")),
            statistics.time_s.load,
            statistics.time_s.render,
            statistics.gathers,
            statistics.link
        ));
        for (index, (sums, expected)) in sums.zip(expected.sums()).enumerate() {
            assert_eq!(sums, expected, "pixel {index}");
        }
        if number == 0 && !is_full() {
            check_page("card image, 4,000 photons, bytes", name, statistics.image_bytes as u32);
        }
        // Only the second render has the card image of the previous render, of which no line is sent again.
        assert_eq!(statistics.link.payload_bytes < statistics.image_bytes, number == 1);
    }
    passes_the_self_test(name, address);
    renders_everything(name, address);
    keeps_irradiance_records(name, address);
    stays_within_the_budget(name, address);
}

/// Runs the self-test: arithmetic equals the host's, and the memory has its full size. Afterwards, the next
/// scene is loaded completely.
fn passes_the_self_test(name: &str, address: &CardAddress) {
    let test = card_self_test(address, &Unobserved).expect("the card answers");
    for PatternTest { pattern, write, check, .. } in &test.patterns {
        say(&format!("{name}: {} of {} lines: {write:?}, {check:?}", pattern.name(), test.lines));
    }
    assert!(test.is_passed(), "{test:?}");
}

/// Renders the scene with every feature.
fn renders_everything(name: &str, address: &CardAddress) {
    let scene = everything();
    let settings = settings().with(|s| {
        s.picture.width = 18;
        s.picture.height = 17;
        s.photons.count = 1000;
        s.photons.caustic_photons = Some(400);
        s.integrator.gather_rays = 4;
        s.integrator.shadow_rays = 3;
        s.integrator.samples = 2;
    });
    let expected = render_or_panic(&scene, &settings).film;
    let film = render_or_panic(&scene, &settings.with(|s| s.cards.addresses = vec![address.clone()])).film;
    for (index, (sums, expected)) in film.sums().zip(expected.sums()).enumerate() {
        assert_eq!(sums, expected, "{name}, pixel {index}");
    }
}

/// Renders two passes, the second with the irradiance records that the first has gathered.
fn keeps_irradiance_records(name: &str, address: &CardAddress) {
    let scene = everything();
    let settings = settings().with(|s| {
        (s.picture.width, s.picture.height) = (18, 17);
        (s.photons.count, s.photons.caustic_photons) = (1000, Some(400));
        (s.integrator.gather_rays, s.integrator.shadow_rays, s.integrator.samples) = (8, 1, 2);
        (s.integrator.irradiance_error, s.integrator.planned_samples) = (Some(0.1), Some(2));
    });
    let expected = render_or_panic(&scene, &settings);
    let remote = settings.with(|s| {
        s.cards.addresses = vec![address.clone()];
        s.schedule.keep_records = true;
    });
    let mut renderer = Renderer::default();
    let first = remote.clone().with(|s| s.integrator.samples = 1);
    let first = renderer.render(&scene, &first, &Unobserved).unwrap_or_else(|error| panic!("{error}"));
    let all = renderer.refine(&scene, &remote, Arc::new(first.film), &Unobserved);
    let all = all.unwrap_or_else(|error| panic!("{error}"));
    assert!(all.film.sums().eq(expected.film.sums()), "{name}");
    let records = expected.statistics.records;
    assert_eq!((first.statistics.records, first.statistics.kept_records), (records, 0), "{name}");
    assert_eq!((all.statistics.records, all.statistics.kept_records), (0, records), "{name}");
}

/// Checks the use of on-chip memory that the firmware reports, after all renders.
fn stays_within_the_budget(name: &str, address: &CardAddress) {
    let MemoryUse { static_bytes, stack_bytes, stack_used } =
        card_info(address).expect("the card answers").memory_use.expect("a board measures its memory");
    say(&format!("{name}: {static_bytes} bytes of static data, {stack_used} of {stack_bytes} of stack used"));
    assert!(0 < stack_used && stack_used < stack_bytes && stack_bytes <= MICRO.stack_bytes);
    check_page("stack used, bytes", name, stack_used);
    assert!(static_bytes as usize >= size_of::<MicroCard<Dram<'static>>>() / 2, "32-bit pointers take half");
    // Board images have no caches: the caches' share of the budget must stay free.
    let caches = MICRO.photon_cache_bytes + MICRO.scene_cache_bytes;
    assert!(static_bytes + stack_bytes + caches <= MICRO.sram_bytes);
}

/// Checks a figure in the table of machines in `docs/bring-up.md`; other compilers may give up to a tenth
/// more or less.
fn check_page(row: &str, name: &str, measured: u32) {
    let page = include_str!("../../../docs/bring-up.md");
    let cells = |start: &str| {
        let line = page.lines().find(|line| line.starts_with(start)).expect("the page has the row");
        line.split('|').map(|cell| cell.trim().to_owned()).collect::<Vec<_>>()
    };
    let column = cells("| under QEMU |").iter().position(|cell| *cell == format!("`{name}`"));
    let stated = cells(&format!("| {row} |"))[column.expect("the page has the machine")].replace(',', "");
    let stated: u32 = stated.parse().expect("a number");
    assert!(
        stated.abs_diff(measured) <= measured / 10,
        "docs/bring-up.md states {stated} for {row} of {name}; write {measured}"
    );
}

/// Renders with a card in a crate of its own, made from a template by the commands of its README.md, without
/// and with a link that fails.
fn renders_from_a_template(name: &str) {
    if let Ok(reason) = std::env::var("PHOTONCARD_SKIP_QEMU") {
        return skip(&format!("{name} is not tested, as PHOTONCARD_SKIP_QEMU is set: {reason}"));
    }
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../scenes/cornell.gltf");
    let scene = gltf::load(&path).expect("a shipped scene loads");
    let (machine, address) = Machine::start_template(name);
    let info = card_info(&address).expect("the card answers");
    assert!(info.board.is_some_and(|board| !board.name.is_empty()));
    for faults in [None, faults().first().copied()] {
        let remote = settings().with(|s| {
            s.cards.addresses = vec![address.clone()];
            s.cards.faults = faults;
        });
        let expected = render_or_panic(&scene, &settings()).film;
        let film = render_or_panic(&scene, &remote).film;
        for (index, (sums, expected)) in film.sums().zip(expected.sums()).enumerate() {
            assert_eq!(sums, expected, "{name}, pixel {index}");
        }
    }
    let memory = card_info(&address).expect("the card answers").memory_use.expect("it measures its memory");
    say(&format!("{name}: {memory:?}"));
    assert!(0 < memory.stack_used && memory.stack_used < memory.stack_bytes);
    drop(machine);
}

#[test]
fn a_card_from_the_polled_template_renders_the_picture_of_the_emulated_card() {
    renders_from_a_template("polled");
}

#[test]
fn a_card_from_the_embassy_template_renders_the_picture_of_the_emulated_card() {
    renders_from_a_template("embassy");
}

#[test]
fn an_arm_board_renders_the_picture_of_the_emulated_card() {
    renders_over_a_uart("mps2-an386");
}

#[test]
fn a_risc_v_board_renders_the_picture_of_the_emulated_card() {
    renders_over_a_uart("virt");
}

#[test]
fn a_board_on_a_network_renders_the_picture_of_the_emulated_card() {
    let name = "mps2-an386-tcp";
    if !is_left_out(name) {
        let (machine, address) = Machine::start_on_network(name);
        renders_as_the_emulated_card(name, &card_at(address));
        drop(machine);
    }
}

#[test]
fn a_board_on_a_network_serves_the_next_host_whatever_the_last_did() {
    let name = "mps2-an386-tcp";
    if is_left_out(name) {
        return;
    }
    let (scene, settings) = (cornell_box(), settings());
    let expected = render_or_panic(&scene, &settings).film;
    let (machine, card) = Machine::start_on_network(name);
    let at = |address| settings.clone().with(|s| s.cards.addresses = vec![card_at(address)]);
    // The hosts break off while they open the session, load the scene, and render.
    for bytes in [10, 1000, 8000] {
        let result = Renderer::default().render(&scene, &at(breaking_off(card, bytes)), &Unobserved);
        let error = result.err().expect("the link breaks off");
        say(&format!("{name}: after {bytes} bytes of the card: {error}"));
        await_next_turn(card);
        let film = render_or_panic(&scene, &at(card)).film;
        assert!(film.sums().eq(expected.sums()), "after {bytes} bytes of the card");
    }
    refuses_what_is_no_host(card);
    await_next_turn(card);
    let film = render_or_panic(&scene, &at(card)).film;
    assert!(film.sums().eq(expected.sums()), "after connections of no host");
    drop(machine);
}

fn card_at(address: SocketAddr) -> CardAddress {
    format!("tcp:{address}").parse().expect("an address")
}

/// Returns an address by which one host reaches a card, until the card has sent a number of bytes.
fn breaking_off(card: SocketAddr, bytes: u64) -> SocketAddr {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).expect("a free port");
    let address = listener.local_addr().expect("it is bound");
    std::thread::spawn(move || {
        let (mut host, _) = listener.accept().expect("a host connects");
        drop(listener);
        let mut card = TcpStream::connect(card).expect("the card listens");
        let ends = [&host, &card].map(|end| end.try_clone().expect("a descriptor"));
        let (mut from_host, mut to_card) = ends.into();
        std::thread::spawn(move || std::io::copy(&mut from_host, &mut to_card));
        // The end that fails first ends both.
        let _ = std::io::copy(&mut Read::by_ref(&mut card).take(bytes), &mut host);
        for end in [&host, &card] {
            let _ = end.shutdown(Shutdown::Both);
        }
    });
    address
}

/// Waits until a card has read the last bytes of a host that is gone, and serves another.
fn await_next_turn(card: SocketAddr) {
    let start = Instant::now();
    while let Err(error) = card_info(&card_at(card)) {
        assert!(start.elapsed() < PATIENCE, "{error}");
        std::thread::sleep(Duration::from_millis(100));
    }
}

/// Connects to a card without being a host: sends other bytes, is second, is silent.
fn refuses_what_is_no_host(card: SocketAddr) {
    let connect = || {
        let stream = TcpStream::connect(card).expect("the machine listens");
        stream.set_read_timeout(Some(PATIENCE)).expect("a limit");
        stream
    };
    for bytes in [0, 1, 5000, 50_000] {
        // The card may close the connection before it has read all.
        let _ = connect().write_all(&vec![0x5A; bytes]);
    }
    let (mut first, mut second) = (connect(), connect());
    for (stream, which) in [(&mut second, "second"), (&mut first, "silent")] {
        match stream.read(&mut [0]) {
            Ok(count) => assert_eq!(count, 0, "{which}"),
            Err(error) => assert_eq!(error.kind(), ErrorKind::ConnectionReset, "{which}"),
        }
    }
}
