//! Process that starts readers and records how they end.

use std::fs;
use std::io::{self, BufRead, BufReader};
use std::os::unix::process::ExitStatusExt as _;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread;
use std::time::{Duration, Instant};

use super::inputs::as_file;
use super::{Inputs, Kind, Settings};

/// Interval of checks whether a command has ended.
const GLANCE: Duration = Duration::from_millis(2);

/// Input on which a reader or the command failed.
#[derive(Clone, Debug)]
pub struct Finding {
    /// Number of the input.
    pub number: u64,
    /// Description of the failure.
    pub what: String,
}

/// Result of the inputs so far.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// Number of inputs that were read.
    pub inputs: u64,
    /// Number of valid inputs; with kept files, of inputs whose picture was that of undamaged files.
    pub sound: u64,
    /// Number of exits of the command with status 0, 1 and 2.
    pub statuses: [u64; 3],
    /// Maximum time of an input, with the input's number.
    pub slowest: (Duration, u64),
    /// Inputs on which a process ended by a panic, an abort or a signal, or exceeded the time limit.
    pub findings: Vec<Finding>,
}

/// Reads inputs in processes of limited memory. `reader` is a program that calls
/// [`read_batch`](super::read_batch) when its arguments are `read KIND SEED FIRST INPUTS FOLDER`.
/// [Kept](super::supervise_kept) files are not among the inputs.
///
/// # Errors
/// If a process cannot be started or a file cannot be written.
pub fn supervise(reader: &Path, settings: &Settings, tell: &dyn Fn(&Report)) -> io::Result<Report> {
    fs::create_dir_all(&settings.folder)?;
    let mut report = Report::default();
    let inputs = Inputs::new(settings.kind);
    let end = settings.first + settings.inputs;
    let mut next = settings.first;
    while next < end {
        let count = settings.batch.min(end - next);
        let done = read_some(reader, settings, next, count, &mut report)?;
        for number in (next..next + done).filter(|number| number.is_multiple_of(settings.every)) {
            run_command(settings, &inputs, number, &mut report)?;
        }
        next += done;
        report.inputs = next - settings.first;
        tell(&report);
    }
    for finding in &report.findings {
        let (extension, bytes) = inputs.make(settings.seed, finding.number);
        let name = format!("{}-{}-{}.{extension}", settings.kind.name(), settings.seed, finding.number);
        fs::write(settings.folder.join(name), bytes)?;
    }
    Ok(report)
}

/// Command that starts a program with a limited address space.
pub(super) fn limited(settings: &Settings, program: &Path) -> Command {
    let mut command = Command::new("sh");
    let script = format!("ulimit -v {} && exec \"$0\" \"$@\"", settings.kilobytes);
    command.args(["-c", &script]).arg(program).stdin(Stdio::null()).stderr(Stdio::null());
    command
}

/// Starts a process that reads `count` inputs, and waits until it ends. Returns the number of inputs that are
/// done.
fn read_some(
    reader: &Path,
    settings: &Settings,
    first: u64,
    count: u64,
    report: &mut Report,
) -> io::Result<u64> {
    let mut command = limited(settings, reader);
    command.args(["read", settings.kind.name()]);
    command.args([settings.seed, first, count].map(|number| number.to_string()));
    let mut child = command.arg(&settings.folder).stdout(Stdio::piped()).spawn()?;
    let lines = lines(&mut child);
    let (mut at, mut begun) = (None, Instant::now());
    loop {
        match lines.recv_timeout(settings.patience) {
            Ok(line) => match line.split_once(' ') {
                Some(("at", number)) => (at, begun) = (number.parse().ok(), Instant::now()),
                Some((word, _)) => {
                    report.sound += u64::from(word == "sound");
                    report.slowest = report.slowest.max((begun.elapsed(), at.unwrap_or(first)));
                }
                None => {}
            },
            Err(RecvTimeoutError::Timeout) => {
                let number = at.unwrap_or(first);
                child.kill()?;
                child.wait()?;
                let what = format!("it takes more than {:?}", settings.patience);
                report.findings.push(Finding { number, what });
                return Ok(number + 1 - first);
            }
            Err(RecvTimeoutError::Disconnected) => break,
        }
    }
    let status = child.wait()?;
    if status.success() {
        return Ok(count);
    }
    let number = at.unwrap_or(first);
    report.findings.push(Finding { number, what: format!("it ends the reader: {status}") });
    Ok(number + 1 - first)
}

/// Lines of a process's standard output, received by a thread.
fn lines(child: &mut Child) -> Receiver<String> {
    let (sender, receiver) = channel();
    if let Some(output) = child.stdout.take() {
        thread::spawn(move || {
            let lines = BufReader::new(output).lines().map_while(Result::ok);
            lines.take_while(|line| sender.send(line.clone()).is_ok()).for_each(drop);
        });
    }
    receiver
}

/// Runs the command on an input, as a user would.
fn run_command(settings: &Settings, inputs: &Inputs, number: u64, report: &mut Report) -> io::Result<()> {
    let Some(program) = &settings.command else { return Ok(()) };
    let (extension, bytes) = inputs.make(settings.seed, number);
    let (kind, file) = as_file(extension, bytes);
    let path = settings.folder.join(format!("command.{kind}"));
    fs::write(&path, file)?;
    let mut command = limited(settings, program);
    command.stdout(Stdio::null());
    match (settings.kind, extension) {
        (_, "exr") => command.arg("diff").args([&path, &path]),
        (_, "hdr") => {
            let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/cornell.gltf");
            render(&mut command, &scene, &settings.folder).arg("--environment").arg(&path)
        }
        (Kind::Images, _) => command.args(["scene", "info"]).arg(&path),
        (Kind::Scenes | Kind::Kept(_), _) => render(&mut command, &path, &settings.folder),
    };
    let begun = Instant::now();
    let status = ended(&mut command.spawn()?, settings.patience)?;
    report.slowest = report.slowest.max((begun.elapsed(), number));
    match status.map(|status| (status.code(), status.signal())) {
        Some((Some(code @ 0..=2), _)) => report.statuses[code as usize] += 1,
        Some((code, signal)) => {
            let what = format!("it ends the command: status {code:?}, signal {signal:?}");
            report.findings.push(Finding { number, what });
        }
        None => {
            let what = format!("the command takes more than {:?}", settings.patience);
            report.findings.push(Finding { number, what });
        }
    }
    Ok(())
}

/// Adds the arguments of a minimal render.
fn render<'c>(command: &'c mut Command, scene: &Path, folder: &Path) -> &'c mut Command {
    let options = "--size 4x4 --photons 200 --neighbors 10 --caustic-photons 50 --gather-rays 8 --shadow-rays 1 --spp 1 --quiet";
    command.arg("render").arg(scene).arg("-o").arg(folder.join("out.exr")).args(options.split(' '))
}

/// Exit status of a process. `None` if the process exceeds `patience`; it is killed then.
pub(super) fn ended(child: &mut Child, patience: Duration) -> io::Result<Option<ExitStatus>> {
    let begun = Instant::now();
    while begun.elapsed() < patience {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status));
        }
        thread::sleep(GLANCE);
    }
    child.kill()?;
    child.wait()?;
    Ok(None)
}
