//! Runs inputs of a target on a thread of their own, and detects panics, hangs and excessive allocations.

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

/// Name of the thread whose panics are findings.
const WORKER: &str = "fuzz";
/// Stack of the thread, bytes: a card's buffers are built on it.
const STACK: usize = 16 << 20;
/// Interval at which the time of the present input is checked.
const GLANCE: Duration = Duration::from_millis(100);
/// Number of failures after which a run ends.
const MAX_FAILURES: usize = 20;

/// Settings of a run.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Seed of all inputs.
    pub seed: u64,
    /// Number of the first input.
    pub first: u64,
    /// Number of inputs.
    pub inputs: u64,
    /// Time after which the run ends, with inputs left; `None` for no limit.
    pub time: Option<Duration>,
    /// Time limit of one input.
    pub patience: Duration,
    /// Folder for the bytes of failing inputs, and for a file with the number of the present input.
    pub folder: PathBuf,
}

/// Failed input.
#[derive(Clone, Debug)]
pub struct Failure {
    /// Number of the input.
    pub number: u64,
    /// Description of the failure.
    pub what: String,
}

/// Result of a run.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// Number of inputs that were read.
    pub inputs: u64,
    /// Number of valid inputs.
    pub sound: u64,
    /// Maximum number of bytes in use at once for one input, with the input's number; 0 if [`PeakAlloc`] is
    /// not the allocator.
    pub peak: (usize, u64),
    /// Maximum time of an input, with the input's number.
    pub slowest: (Duration, u64),
    /// Total time.
    pub elapsed: Duration,
    /// Failed inputs.
    pub failures: Vec<Failure>,
}

thread_local! {
    static LAST_PANIC: RefCell<String> = const { RefCell::new(String::new()) };
}

/// Installs a panic hook that stores the message of a panic on the worker thread. Code under test catches
/// some panics, which must not be printed.
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

/// Runs inputs of a target, and returns the failures among them.
///
/// # Panics
/// If the system cannot start a thread.
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
            settings.folder.join(format!("{}-{}-{}.input", target.name(), settings.seed, failure.number));
        let written = std::fs::create_dir_all(&settings.folder).and_then(|()| std::fs::write(&path, &input));
        let place = written.map_or_else(|error| error.to_string(), |()| path.display().to_string());
        let _ = write!(failure.what, " ({} bytes: {place})", input.len());
    }
    report
}

/// Waits for the worker's report, or until an input exceeds `patience`. A thread cannot be killed, so that
/// the thread with such an input continues to run.
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
    // If a failure ends the process, such as a stack overflow, the file still has the input's number.
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
