//! `photoncard view`: a page in the browser that shows a scene while it is rendered.
//!
//! - `wish`, `command_line`: the wish, which is the picture that pages request (settings, camera, changes of
//!   the scene), and the command that renders it.
//! - `refinement`: the order of the passes that render a wish, as a state machine.
//! - `canvas`, `pages`, `cards`: tiles of the newest wish; the next message to each page; states of the
//!   cards.
//! - `request`, `describe`: messages from a page, and messages to it.
//! - `state`, `painting`: all of these as one state, without threads, clock, input or output.
//! - `hub`, `painter`, `fitting`: the state under a lock; the thread that renders, and that of pilot renders.
//! - `http`, `gate`, `page_files`, `socket`, `server`: requests, access control, the page's files,
//!   web sockets.
//! - `saving`: pictures that a page saves.

mod canvas;
mod cards;
mod command_line;
mod describe;
mod fitting;
mod gate;
mod http;
mod hub;
mod page_files;
mod pages;
mod painter;
mod painting;
mod refinement;
mod request;
mod saving;
mod server;
mod socket;
mod state;
#[cfg(test)]
mod tests;
mod wish;

use std::fmt::Write;
use std::io::ErrorKind;
use std::net::{SocketAddr, TcpListener};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use miette::{MietteDiagnostic, Report};
use photoncard_driver::render::{CardAddress, Picture, RenderSettings, card_ping};
use photoncard_driver::scene::Scene;

use self::describe::SceneFacts;
use self::gate::Gate;
use self::hub::Hub;
use self::painter::Painter;
use self::request::{MAX_PIXELS, MAX_SIDE, is_size_of_view};
use self::saving::Folder;
use self::state::{Start, View};
use self::wish::{Sketch, Wish};
use crate::arguments::ViewOptions;
use crate::console::{print, say};
use crate::failure::Failure;
use crate::input;
use crate::notices::{self, Uses};
use crate::progress::stop_on_signals;
use crate::render::files::denoiser;
use crate::render::on_threads;

/// Interval of checks whether the view is over.
const ATTENTION: Duration = Duration::from_millis(50);
/// Interval of checks whether a lost card is due for an attempt to reconnect.
const LOOK: Duration = Duration::from_millis(200);
/// Time that a card takes to notice that its host has gone, and to accept another host.
const CHANGE_OF_HOSTS: Duration = Duration::from_millis(100);

/// Shows a scene until an interrupt.
pub(crate) fn run(options: &ViewOptions) -> Result<(), Failure> {
    let mut settings = options.settings();
    check(&settings)?;
    let folder = options
        .out
        .as_deref()
        .map(|path| Folder::new(path).map_err(|error| Failure::no_folder(path, &error)));
    let folder = folder.transpose()?;
    let denoiser = denoiser(options.denoise)?;
    let is_over = stop_on_signals().map_err(|error| Failure::work_error(&error))?;
    if options.attached {
        end_with_input(is_over.clone());
    }
    let listener = listen(options.listen)?;
    let address = listener.local_addr().map_err(|error| Failure::work_error(&error))?;
    let dram_bytes = settings.cards.addresses.iter().map(CardAddress::dram_bytes).max().unwrap_or(u64::MAX);
    let scene = load(options, dram_bytes, &mut settings)?;
    let start = Start {
        options: options.scene.clone(),
        quality: options.quality,
        finish: options.finish(),
        wish: Wish::new(settings, options.stated(), options.scene.assignments.clone()),
        sketch: Sketch::new(&scene),
        facts: SceneFacts::new(input::name(&options.scene), &scene),
        is_size_stated: options.picture.states_size(),
        out: folder.as_ref().map(|folder| folder.path().display().to_string()),
    };
    let hub = Arc::new(Hub::new(View::new(start)?, folder, is_over));
    let gate = Arc::new(Gate::new(address, token()?));
    announce(options, address, &gate)?;
    let (served, gate) = (hub.clone(), gate.clone());
    // Threads of connections are not joined: they end with the process.
    std::thread::spawn(move || server::serve(&listener, &gate, &served));
    std::thread::scope(|scope| {
        scope.spawn(|| look_for_cards(&hub));
        let painter = Painter::new(&hub, (scene, dram_bytes), options, denoiser);
        let painted = scope.spawn(|| on_threads(options.threads, || painter.run()));
        while !hub.is_over() {
            std::thread::sleep(ATTENTION);
        }
        hub.end();
        painted.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    })?;
    hub.finish_saving();
    Err(Failure::Stopped("stopped; the view is over"))
}

/// Checks the settings of a view. A crop window or a trace is an error.
fn check(settings: &RenderSettings) -> Result<(), Failure> {
    let [option, reason] = if settings.picture.crop.is_some() {
        ["--crop", "a view shows the whole picture"]
    } else if settings.cards.trace.is_some() {
        ["--trace", "it is of one render, and a view has many"]
    } else {
        settings.check()?;
        return check_size(&settings.picture);
    };
    let report = MietteDiagnostic::new(format!("photoncard view has no {option}: {reason}"));
    Err(Failure::Input(Report::new(report.with_help("leave it out, or use photoncard render"))))
}

/// Checks that a view supports pictures of this size.
fn check_size(&Picture { width, height, .. }: &Picture) -> Result<(), Failure> {
    if is_size_of_view(width.into(), height.into()) {
        return Ok(());
    }
    let report = MietteDiagnostic::new(format!(
        "photoncard view has no --size {width}x{height}: a view shows up to {MAX_SIDE} pixels a side and {MAX_PIXELS} in all"
    ));
    Err(Failure::Input(Report::new(
        report.with_help("give less, such as --size 1024x768, or use photoncard render"),
    )))
}

/// Loads the scene, and gives the picture the camera's aspect ratio. Assignments (`--set`) are not applied.
fn load(options: &ViewOptions, dram_bytes: u64, settings: &mut RenderSettings) -> Result<Scene, Failure> {
    let scene = input::load_with_groups(&options.scene, dram_bytes)?;
    settings.picture.light_groups = scene.light_groups.names().to_vec();
    let camera = settings.camera(&scene)?;
    notices::say_ignored(&options.scene, &scene, &Uses::of(&options.scene, &settings.picture, None))?;
    let misfit = options.picture.fit(&camera, &mut settings.picture);
    if let Some(notice) = misfit.filter(|_| !options.quiet) {
        say(format_args!("photoncard: {notice}"));
    }
    Ok(scene)
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
    print(&[gate.url()])?;
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
        let Some((number, address)) = hub.change(|view, now| view.cards.next_to_try(now)) else { continue };
        if card_ping(&address, 1).is_ok() {
            std::thread::sleep(CHANGE_OF_HOSTS);
            hub.card_returns(number);
        }
    }
}
