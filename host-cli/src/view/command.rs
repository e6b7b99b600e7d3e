//! The command `photoncard view`: a server of the page, and threads.

use std::fmt::Write;
use std::io::ErrorKind;
use std::net::{SocketAddr, TcpListener};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use miette::{MietteDiagnostic, Report};
use photoncard_driver::render::{Renderer, card_ping, completed};

use super::gate::Gate;
use super::hub::Hub;
use super::lending::Lending;
use super::opening::Opening;
use super::painter::Painter;
use super::server::Server;
use crate::arguments::ViewOptions;
use crate::console::{print, say};
use crate::failure::Failure;
use crate::progress::stop_on_signals;
use crate::render::on_threads;
use crate::web_module;

/// Interval of checks whether the view is over.
const ATTENTION: Duration = Duration::from_millis(50);
/// Interval of checks whether a lost card is due for an attempt to reconnect.
const LOOK: Duration = Duration::from_millis(200);
/// Time that a card takes to notice that its host has gone, and to accept another host.
const CHANGE_OF_HOSTS: Duration = Duration::from_millis(100);

/// Shows a scene until an interrupt.
pub(crate) fn run(options: &ViewOptions) -> Result<(), Failure> {
    let is_over = stop_on_signals().map_err(|error| Failure::work_error(&error))?;
    if options.attached {
        end_with_input(is_over.clone());
    }
    let listener = listen(options.listen)?;
    let address = listener.local_addr().map_err(|error| Failure::work_error(&error))?;
    let lending = options.browser_cards.then(|| lending(options)).transpose()?;
    let Opening { view, folder, denoiser, scene, dram_bytes } = Opening::new(options)?;
    let hub = Arc::new(Hub::new(view, folder, is_over));
    let gate = Gate::new(address, token()?, lending.is_some());
    announce(options, address, &gate)?;
    let server = Arc::new(Server::new(gate, hub.clone(), lending));
    // Threads of connections are not joined: they end with the process.
    std::thread::spawn(move || server.serve(&listener));
    std::thread::scope(|scope| {
        scope.spawn(|| look_for_cards(&hub));
        let painter = Painter::new(hub.clone(), (scene, dram_bytes), options, denoiser, Renderer::default());
        let painted = scope.spawn(|| on_threads(options.host.threads, || completed(painter.run())));
        while !hub.is_over() {
            std::thread::sleep(ATTENTION);
        }
        hub.end();
        painted.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    })?;
    hub.finish_saving();
    Err(Failure::Stopped("stopped; the view is over"))
}

/// Reads the module of lent cards, and gives them the chip of the first emulated card.
fn lending(options: &ViewOptions) -> Result<Lending, Failure> {
    let settings = options.settings();
    if settings.modelled_caches().is_some() {
        let text =
            "cards of browsers have no model of memory: leave out --cache and --counters, or --browser-cards";
        return Err(Failure::Input(Report::new(MietteDiagnostic::new(text))));
    }
    let module = web_module::read(options.module.as_deref())?;
    Lending::new(module, &settings.cards.emulated_chip()).map_err(|error| Failure::work_error(&error))
}

fn listen(address: SocketAddr) -> Result<TcpListener, Failure> {
    TcpListener::bind(address).map_err(|error| {
        let remedy = match error.kind() {
            ErrorKind::AddrInUse => "another program listens there, perhaps another view: use --listen 127.0.0.1:0 for any free port",
            ErrorKind::PermissionDenied => "use a port of 1024 or more",
            _ => "use an address of this machine, such as 127.0.0.1:8080",
        };
        let report = MietteDiagnostic::new(format!("cannot listen at {address}: {error}"));
        Failure::Work(Report::new(report.with_help(remedy)))
    })
}

/// Ends the view when standard input ends.
fn end_with_input(is_over: Arc<AtomicBool>) {
    // The thread is not joined: it ends with the process.
    std::thread::spawn(move || {
        let _ = std::io::copy(&mut std::io::stdin(), &mut std::io::sink());
        is_over.store(true, Ordering::Relaxed);
    });
}

/// Random token of 128 bits, as 32 hexadecimal digits.
fn token() -> Result<String, Failure> {
    let mut bytes = [0_u8; 16];
    getrandom::fill(&mut bytes).map_err(|error| Failure::work_error(&error))?;
    Ok(bytes.iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    }))
}

/// Prints the page's address, and opens it if requested.
fn announce(options: &ViewOptions, address: SocketAddr, gate: &Gate) -> Result<(), Failure> {
    if !address.ip().is_loopback() {
        say(format_args!(
            "photoncard: warning: other machines can reach {address}, and who has the address of the page can steer the view{}",
            if address.ip().is_unspecified() {
                ": there it begins with an address of this machine"
            } else {
                ""
            }
        ));
    }
    let urls: Vec<String> = [gate.url()].into_iter().chain(gate.lenders_url()).collect();
    print(&urls)?;
    if options.open
        && let Err(error) = open_in_browser(&gate.url())
    {
        say(format_args!("photoncard: no browser could be opened: {error}; open the address yourself"));
    }
    Ok(())
}

/// Opens an address in the browser of this machine.
///
/// # Errors
/// If the program that opens addresses cannot be started.
fn open_in_browser(url: &str) -> std::io::Result<()> {
    let [program, arguments @ ..] = match std::env::consts::OS {
        "macos" => ["open", "", "", ""],
        // `start` takes its first quoted argument for a window's title.
        "windows" => ["cmd", "/c", "start", "\"\""],
        _ => ["xdg-open", "", "", ""],
    };
    let mut command = Command::new(program);
    command.args(arguments.iter().filter(|argument| !argument.is_empty())).arg(url);
    let mut child = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn()?;
    // The program ends once the browser has the address; a thread waits for it so that no zombie stays.
    let _ = std::thread::Builder::new().name("browser".into()).spawn(move || child.wait());
    Ok(())
}

/// Tries to reconnect lost cards until the view is over, and reports to the hub each card that answers. The
/// pause between the attempts for a card doubles each time.
fn look_for_cards(hub: &Hub) {
    while !hub.is_over() {
        std::thread::sleep(LOOK);
        let Some(address) = hub.change(|view, now| view.cards.next_to_try(now)) else { continue };
        if card_ping(&address, 1).is_ok() {
            std::thread::sleep(CHANGE_OF_HOSTS);
            hub.card_returns(&address);
        }
    }
}
