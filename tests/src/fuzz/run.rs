//! Runs inputs on a thread of their own, and watches over it: panics, hangs and allocations.

use std::cell::RefCell;
use std::fmt::Write as _;
use std::fs::File;
use std::os::unix::fs::FileExt as _;
use std::panic::{AssertUnwindSafe, PanicHookInfo, catch_unwind, set_hook, take_hook};
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, Once};
use std::thread::Builder;
use std::time::{Duration, Instant};

use peak_alloc::PeakAlloc;

use super::random::Random;
use super::target::Target;

/// The worker's name: its panics are findings, and printed as such.
const WORKER: &str = "fuzz";
/// Room for a card's buffers, which are built on the stack.
const STACK: usize = 16 << 20;
/// How often the watch looks.
const GLANCE: Duration = Duration::from_millis(100);
/// Failures after which a run ends.
const MAX_FAILURES: usize = 20;

/// What to run.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The seed of all inputs.
    pub seed: u64,
    /// The number of the first input.
    pub first: u64,
    /// How many inputs.
    pub inputs: u64,
    /// Ends the run after this time, if it is reached before the last input.
    pub time: Option<Duration>,
    /// How long one input may take.
    pub patience: Duration,
    /// The folder that failing inputs are written to, and the number of the present one.
    pub folder: PathBuf,
}

/// An input that failed.
#[derive(Clone, Debug)]
pub struct Failure {
    /// Its number.
    pub number: u64,
    /// What happened.
    pub what: String,
}

/// What a run found.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// Inputs that were read.
    pub inputs: u64,
    /// Inputs that were sound.
    pub sound: u64,
    /// The most bytes that one input had allocated at once, and its number; 0 where [`PeakAlloc`] is not the allocator.
    pub peak: (usize, u64),
    /// The longest time that one input took, and its number.
    pub slowest: (Duration, u64),
    /// The time of all.
    pub elapsed: Duration,
    /// Inputs that failed.
    pub failures: Vec<Failure>,
}

thread_local! {
    static LAST_PANIC: RefCell<String> = const { RefCell::new(String::new()) };
}

/// Keeps the words of a worker's panic instead of printing them: some are caught by what is tested.
fn keep_panics() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let others = take_hook();
        set_hook(Box::new(move |info: &PanicHookInfo| {
            if std::thread::current().name() == Some(WORKER) {
                LAST_PANIC.with(|last| *last.borrow_mut() = info.to_string());
            } else {
                others(info);
            }
        }));
    });
}

/// Runs inputs of a target.
///
/// # Panics
/// If the system has no thread for it.
pub fn fuzz(target: &Arc<dyn Target>, settings: &Settings) -> Report {
    keep_panics();
    let begin = Instant::now();
    let at = Arc::new(AtomicU64::new(settings.first));
    let (done, reports) = channel();
    let worker = {
        let (target, settings, at) = (Arc::clone(target), settings.clone(), Arc::clone(&at));
        move || drop(done.send(run(&*target, &settings, &at)))
    };
    Builder::new().name(WORKER.into()).stack_size(STACK).spawn(worker).expect("the system has a thread");
    let mut report = watch(&reports, &at, settings.patience);
    report.elapsed = begin.elapsed();
    for failure in &mut report.failures {
        let input = target.input(&mut Random::new(target.name(), settings.seed, failure.number));
        let path =
            settings.folder.join(format!("{}-{}-{}.hex", target.name(), settings.seed, failure.number));
        let written =
            std::fs::create_dir_all(&settings.folder).and_then(|()| std::fs::write(&path, hex(&input)));
        let place = written.map_or_else(|error| error.to_string(), |()| path.display().to_string());
        let _ = write!(failure.what, " ({} bytes: {place})", input.len());
    }
    report
}

/// Waits for the worker's report, or for an input that takes too long. A thread cannot be ended: it is left to itself.
fn watch(reports: &Receiver<Report>, at: &AtomicU64, patience: Duration) -> Report {
    let (mut last, mut since) = (at.load(Ordering::Relaxed), Instant::now());
    loop {
        match reports.recv_timeout(GLANCE) {
            Ok(report) => return report,
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => {
                let failure =
                    Failure { number: at.load(Ordering::Relaxed), what: "the worker ended".to_owned() };
                return Report { failures: vec![failure], ..Report::default() };
            }
        }
        let number = at.load(Ordering::Relaxed);
        if number != last {
            (last, since) = (number, Instant::now());
        } else if since.elapsed() > patience {
            let failure = Failure { number, what: format!("it hangs: not done within {patience:?}") };
            return Report { failures: vec![failure], ..Report::default() };
        }
    }
}

fn run(target: &dyn Target, settings: &Settings, at: &AtomicU64) -> Report {
    let mut report = Report::default();
    let begin = Instant::now();
    // What ends the process, as a stack that overflows, leaves the number behind.
    let trace =
        settings.folder.join(format!("{}-{}-from-{}.at", target.name(), settings.seed, settings.first));
    let file = std::fs::create_dir_all(&settings.folder).and_then(|()| File::create(&trace)).ok();
    for number in settings.first..settings.first.saturating_add(settings.inputs) {
        if report.failures.len() >= MAX_FAILURES || settings.time.is_some_and(|time| begin.elapsed() > time) {
            break;
        }
        at.store(number, Ordering::Relaxed);
        if let Some(file) = &file {
            let _ = file.write_at(format!("{number:020}\n").as_bytes(), 0);
        }
        let input = target.input(&mut Random::new(target.name(), settings.seed, number));
        PeakAlloc.reset_peak_usage();
        let (held, start) = (PeakAlloc.current_usage(), Instant::now());
        let result = catch_unwind(AssertUnwindSafe(|| target.read(&input)));
        report.slowest = report.slowest.max((start.elapsed(), number));
        let peak = PeakAlloc.peak_usage().saturating_sub(held);
        report.peak = report.peak.max((peak, number));
        report.inputs += 1;
        let mut fail = |what| report.failures.push(Failure { number, what });
        let bound = target.allocation_bound(input.len());
        if peak > bound {
            fail(format!("{peak} bytes are allocated, more than {bound}"));
        }
        match result {
            Ok(is_sound) => report.sound += u64::from(is_sound),
            Err(_) => fail(LAST_PANIC.with(|last| last.borrow().clone())),
        }
    }
    let _ = std::fs::remove_file(trace);
    report
}

/// A dump that `xxd -r -p` turns back into bytes.
fn hex(bytes: &[u8]) -> String {
    let mut text = String::with_capacity(bytes.len() * 2 + bytes.len() / 32 + 1);
    for row in bytes.chunks(32) {
        for byte in row {
            let _ = write!(text, "{byte:02x}");
        }
        text.push('\n');
    }
    text
}
