//! Commands `photoncard card` and `photoncard emulate`.

use std::time::Duration;

use miette::MietteDiagnostic;
use photoncard_driver::emulator::{EmulatedKind, serve_card};
use photoncard_driver::link::{HostPort, ListedPort, Listener, list_serial_ports};
use photoncard_driver::printable::printable;
use photoncard_driver::render::relay::RelayCards;
use photoncard_driver::render::{
    ArithmeticTest, BoardInfo, CardAddress, MAX_BINS, MemoryUse, PatternTest, RenderError, SelfTest,
    WrongResult, card_info, card_ping, card_self_test,
};

use crate::arguments::EmulateOptions;
use crate::console::{print, say};
use crate::failure::Failure;
use crate::progress::{Progress, stop_on_signals};

/// Prints the capacities that a card reports. Adds the measured memory use of a board, and the sizes of an
/// emulated card's buffers.
pub(crate) fn info(address: &CardAddress) -> Result<(), Failure> {
    let info = card_info(address)?;
    let budget = info.budget;
    let kind = match address {
        CardAddress::Emulated { model, .. } => Some(model.kind()),
        CardAddress::Remote(_) => None,
    };
    let mut lines: Vec<String> = info.board.iter().flat_map(board_rows).collect();
    lines.extend([
        format!("build           {}", info.build),
        format!("sram            {} bytes", budget.sram_bytes),
        format!("  photon cache  {} bytes", budget.photon_cache_bytes),
        format!("  scene cache   {} bytes", budget.scene_cache_bytes),
    ]);
    lines.extend(kind.map(|kind| format!("  cache tags    {} bytes", kind.tag_bytes())));
    lines.push(format!("  stack         {} bytes", budget.stack_bytes));
    lines.extend(info.memory_use.iter().flat_map(measured_rows));
    lines.extend(kind.into_iter().flat_map(|kind| sram_rows(kind, budget.sram_bytes as usize)));
    lines.extend([
        format!("dram            {} bytes", budget.dram_bytes),
        format!(
            "tile            {} pixels, {} tiles in flight, {} at once",
            budget.tile_pixels, budget.in_flight, budget.tiles
        ),
        format!("neighbors       {}", budget.neighbors),
        format!("gather rays     {} a sample", budget.gather_rays),
        format!("bins            {MAX_BINS} of directions"),
        format!("gather queue    {} gathers", budget.gather_queue),
        format!("waiting         {} blocks of tiles in card memory", budget.waiting_blocks),
        format!("records         {} of irradiance a tile in flight", budget.irradiance_records),
        format!("shadow rays     {} a sample", budget.shadow_rays),
        format!("samples         {} a pixel", budget.samples),
    ]);
    print(&lines)
}

/// Returns the table rows of what a board's firmware says of the board.
fn board_rows(board: &BoardInfo) -> Vec<String> {
    let BoardInfo { name, serial_number, clock_hz } = board;
    let named = |row: &str, text: &str| (!text.is_empty()).then(|| format!("{row:<15} {text}"));
    let clock = (*clock_hz > 0).then(|| format!("clock           {clock_hz} Hz"));
    [named("board", name), named("serial number", serial_number), clock].into_iter().flatten().collect()
}

/// Returns the table rows of the stack use and the static data that a board's firmware measures.
fn measured_rows(memory_use: &MemoryUse) -> [String; 2] {
    let MemoryUse { static_bytes, stack_bytes, stack_used } = memory_use;
    [
        format!("    used        {stack_used} bytes at most of {stack_bytes}"),
        format!("  static data   {static_bytes} bytes"),
    ]
}

/// Returns table rows about an emulated chip's on-chip memory, bytes: all buffers, the buffers of each of
/// three techniques, and the free rest.
fn sram_rows(kind: EmulatedKind, sram_bytes: usize) -> [String; 5] {
    let techniques = kind.techniques();
    [
        format!("  buffers       {} bytes", kind.buffer_bytes()),
        format!("    reordering  {} bytes: gathers that wait", techniques.reordering),
        format!("    cache       {} bytes: irradiance records", techniques.irradiance_cache),
        format!("    sampling    {} bytes: tables of directions", techniques.importance_sampling),
        format!("  free          {} bytes", sram_bytes - kind.sram_bytes()),
    ]
}

/// Sends `count` hello messages to a card. Prints the time until each answer, and the minimum, mean and
/// maximum.
pub(crate) fn ping(address: &CardAddress, count: u16) -> Result<(), Failure> {
    let answers = card_ping(address, count.into())?;
    let mut lines = Vec::new();
    for (number, answer) in (1..).zip(&answers) {
        lines.push(format!("hello {number:<9} {}", milliseconds(*answer)));
    }
    let mean = answers.iter().sum::<Duration>() / u32::from(count.max(1));
    for (name, time) in
        [("least", answers.iter().min()), ("mean", Some(&mean)), ("most", answers.iter().max())]
    {
        lines.extend(time.map(|time| format!("{name:<15} {}", milliseconds(*time))));
    }
    print(&lines)
}

fn milliseconds(time: Duration) -> String {
    format!("{:.3} ms", time.as_secs_f64() * 1e3)
}

const COLUMNS: [&str; 4] = ["path", "USB name", "serial number", "--card"];

/// Prints a table of this machine's serial ports, one per line. If there are none, only a message is written
/// to standard error.
pub(crate) fn list() -> Result<(), Failure> {
    let ports = list_serial_ports().map_err(Failure::work)?;
    if ports.is_empty() {
        say(format_args!(
            "photoncard: this machine has no serial port; connect a card, or give its address by --card"
        ));
        return Ok(());
    }
    print(&port_table(&ports))
}

/// Lines of a table of serial ports. Its columns are as wide as their longest entry and two blanks apart. A
/// missing value is shown as a dash.
fn port_table(ports: &[ListedPort]) -> Vec<String> {
    let rows: Vec<[String; 4]> =
        [COLUMNS.map(str::to_owned)].into_iter().chain(ports.iter().map(port_row)).collect();
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let [path, name, number] = [0, 1, 2].map(width);
    rows.iter().map(|[a, b, c, d]| format!("{a:path$}  {b:name$}  {c:number$}  {d}")).collect()
}

fn port_row(port: &ListedPort) -> [String; 4] {
    let address = CardAddress::serial(&port.path).to_string();
    [&port.path, &port.usb_name, &port.serial_number, &address].map(|text| match text.as_str() {
        "" => "-".into(),
        text => printable(text).into_owned(),
    })
}

/// Runs the self-test of a card and prints the results.
pub(crate) fn self_test(address: &CardAddress, quiet: bool) -> Result<(), Failure> {
    let progress = Progress::of_lines(quiet, 1)?;
    let result = card_self_test(address, &progress);
    progress.finish();
    let test = result.map_err(|error| match error {
        RenderError::Stopped => {
            Failure::Stopped("stopped; the card holds patterns of the test, and no scene")
        }
        error => error.into(),
    })?;
    print(&test_lines(&test))?;
    if test.is_passed() { Ok(()) } else { Err(test_failure(&test)) }
}

fn test_lines(test: &SelfTest) -> Vec<String> {
    let mut lines = arithmetic_lines(&test.arithmetic);
    lines.push(format!("memory          {} bytes: {} lines", test.memory_bytes(), test.lines));
    for pattern in &test.patterns {
        lines.extend(pattern_lines(pattern, test.memory_bytes()));
    }
    lines
}

fn arithmetic_lines(arithmetic: &ArithmeticTest) -> Vec<String> {
    let ArithmeticTest { cases, results, wrong } = arithmetic;
    let count: usize = wrong.iter().map(|wrong| wrong.count).sum();
    let mut lines =
        vec![format!("arithmetic      {count} of {results} results wrong, of {cases} triples of operands")];
    for wrong in wrong {
        let WrongResult { operands: [a, b, c], expected, found } = wrong.first;
        lines.push(format!("  {}: {} wrong", wrong.expression, wrong.count));
        lines.push(format!(
            "    first       a = {a:e}, b = {b:e}, c = {c:e}: {found:#010x}, not {expected:#010x}"
        ));
        lines.extend(wrong.first.cause().map(|cause| format!("    as if         {cause}")));
    }
    lines
}

fn pattern_lines(test: &PatternTest, bytes: u64) -> Vec<String> {
    let mut lines = vec![format!(
        "  {:<13} written in {}, read in {}: {} wrong words",
        test.pattern.name(),
        time(test.write, bytes),
        time(test.check, bytes),
        test.wrong.count
    )];
    if let Some(first) = test.wrong.first {
        let address = u64::from(first.index) * 4;
        lines.push(format!(
            "    first       byte {address:#010x}: {:#010x}, not {:#010x}",
            first.found, first.expected
        ));
        lines.push(format!("    bits        {:#010x} differ in any", test.wrong.bits));
    }
    lines
}

/// Formats the time of a transfer of `bytes` bytes, with its rate in MB/s.
fn time(time: Duration, bytes: u64) -> String {
    let seconds = time.as_secs_f64();
    let rate = if seconds > 0.0 { bytes as f64 / seconds / 1e6 } else { 0.0 };
    format!("{seconds:.3} s ({rate:.1} MB/s)")
}

/// Failure that states the defects of a card that fails its self-test, with a remedy.
fn test_failure(test: &SelfTest) -> Failure {
    let mut parts = Vec::new();
    if !test.arithmetic.wrong.is_empty() {
        parts.push("its arithmetic differs from the host's".to_owned());
    }
    if test.patterns.iter().any(|pattern| pattern.wrong.count > 0) {
        parts.push("its memory does not hold what is written".to_owned());
    }
    if test.lacks_memory() {
        parts.push(format!("its memory is smaller than the {} bytes of its budget", test.budget.dram_bytes));
    }
    let error = MietteDiagnostic::new(format!("the card fails its self-test: {}", parts.join("; ")));
    Failure::work(error.with_help(
        "docs/bring-up.md states what each pattern detects; pictures of this card are not to be trusted",
    ))
}

/// Serves an emulated card, or a relay, to one host after another until an interrupt.
pub(crate) fn emulate(options: &EmulateOptions) -> Result<(), Failure> {
    let stop = stop_on_signals().map_err(|error| Failure::work_error(&error))?;
    let cards = relayed_cards(options)?;
    let listener = Listener::new(&options.listen).map_err(Failure::work)?;
    if listener.is_public() {
        let address = listener.card_address();
        say(format_args!(
            "photoncard: warning: other machines can reach {address}, and the protocol has no authentication"
        ));
    }
    print(&[listener.card_address().to_owned()])?;
    let mut port = HostPort::new(listener, stop, say);
    if let Some(cards) = cards {
        cards.serve(&mut port, &say);
    } else {
        let kind = options.card.model.kind().emulated();
        let chip = options.card_memory.map_or(kind, |bytes| kind.with_memory(bytes));
        serve_card(chip, &mut port).map_err(|error| Failure::work_error(&error))?;
    }
    Err(Failure::Stopped("stopped; the card is gone"))
}

/// Opens the cards of a relay; `None` without `--relay`.
fn relayed_cards(options: &EmulateOptions) -> Result<Option<RelayCards>, Failure> {
    if options.relay.is_empty() {
        return Ok(None);
    }
    let of_memory = |address: &CardAddress| match options.card_memory {
        Some(bytes) => address.clone().with_memory(bytes),
        None => address.clone(),
    };
    let addresses: Vec<CardAddress> = options.relay.iter().map(of_memory).collect();
    Ok(Some(RelayCards::open(&addresses)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_of_ports_survives_foreign_text() {
        let port = |path: &str, usb_name: &str, serial_number: &str| ListedPort {
            path: path.into(),
            usb_name: usb_name.into(),
            serial_number: serial_number.into(),
        };
        let ports = [
            port("/dev/ttyACM0", "Müller's 3\" card", "066BFF"),
            port("/dev/ttyS0", "", ""),
            port("/dev/ttyUSB0", "a\u{1b}[2J\nb\u{202e}", "1\t2\\"),
        ];
        let expected = r#"
path          USB name               serial number  --card
/dev/ttyACM0  Müller's 3" card       066BFF         serial:/dev/ttyACM0@115200
/dev/ttyS0    -                      -              serial:/dev/ttyS0@115200
/dev/ttyUSB0  a\u{1b}[2J\nb\u{202e}  1\t2\          serial:/dev/ttyUSB0@115200
"#;
        assert_eq!(port_table(&ports), expected.trim().lines().collect::<Vec<_>>());
        let addresses = ports.iter().map(|port| port_row(port)[3].parse());
        assert!(addresses.eq(ports.iter().map(|port| Ok(CardAddress::serial(&port.path)))));
    }
}
