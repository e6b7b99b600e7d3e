//! `photoncard study`.

use std::io::IsTerminal;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use photoncard_driver::study::report::Provenance;
use photoncard_driver::study::{Scale, StudyError, StudyObserver, StudyOptions, run as study};

use crate::arguments::StudyArguments;
use crate::console::say;
use crate::failure::Failure;
use crate::progress::stop_on_signals;

/// Message of an interrupted study.
const STOPPED: &str = "stopped; finished points are kept: run the command again to go on";

/// Makes the reports of some studies.
pub(crate) fn run(arguments: &StudyArguments) -> Result<(), Failure> {
    let options = StudyOptions {
        studies: arguments.name.studies(),
        scale: if arguments.quick { Scale::QUICK } else { Scale::FULL }.with_sample(arguments.sample),
        scenes: arguments.scenes.clone(),
        out: arguments.out.clone(),
        is_collection: arguments.name.is_collection(),
        threads: arguments.threads,
        provenance: Provenance::here(&command_line()),
    };
    let progress = StudyProgress::start(arguments.quiet).map_err(|error| Failure::work_error(&error))?;
    let result = study(&options, &progress);
    progress.finish();
    result.map_err(|error| match error {
        StudyError::Stopped => Failure::Stopped(STOPPED),
        error if error.is_input() => Failure::input(error),
        error => Failure::work(error),
    })
}

/// Command line as typed, with the program's name without its folder.
fn command_line() -> String {
    let arguments = std::env::args_os().skip(1).map(|argument| quoted(&argument.to_string_lossy()));
    std::iter::once("photoncard".to_owned()).chain(arguments).collect::<Vec<_>>().join(" ")
}

/// Quotes an argument for a shell.
fn quoted(argument: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./=,:".contains(c);
    if !argument.is_empty() && argument.chars().all(is_plain) {
        argument.to_owned()
    } else {
        format!("'{}'", argument.replace('\'', "'\\''"))
    }
}

/// Progress of a study: a bar on a terminal, otherwise a line for each tenth.
struct StudyProgress {
    stopped: Arc<AtomicBool>,
    display: Option<Mutex<Display>>,
}

struct Display {
    study: String,
    bar: ProgressBar,
    on_terminal: bool,
    /// Number of tenths of the study that were printed, without a terminal.
    told: usize,
}

impl StudyProgress {
    fn start(quiet: bool) -> std::io::Result<Self> {
        let display = Display {
            study: String::new(),
            bar: ProgressBar::hidden(),
            on_terminal: std::io::stderr().is_terminal(),
            told: 0,
        };
        Ok(Self { stopped: stop_on_signals()?, display: (!quiet).then_some(Mutex::new(display)) })
    }

    fn finish(&self) {
        if let Some(display) = &self.display {
            display.lock().unwrap_or_else(PoisonError::into_inner).bar.finish_and_clear();
        }
    }
}

impl StudyObserver for StudyProgress {
    fn progress(&self, study: &str, done: usize, total: usize, _: bool) {
        if let Some(display) = &self.display {
            display.lock().unwrap_or_else(PoisonError::into_inner).show(study, done, total);
        }
    }

    fn notice(&self, text: &str) {
        if let Some(display) = &self.display {
            let display = display.lock().unwrap_or_else(PoisonError::into_inner);
            display.bar.suspend(|| say(format_args!("photoncard: {text}")));
        }
    }

    fn is_stopped(&self) -> bool {
        self.stopped.load(Ordering::Relaxed)
    }
}

impl Display {
    fn show(&mut self, study: &str, done: usize, total: usize) {
        if self.study != study {
            self.begin(study, total);
        }
        self.bar.set_position(done as u64);
        let tenths = (10 * done).checked_div(total).unwrap_or(0);
        if !self.on_terminal && (tenths > self.told || done == 0) {
            self.told = tenths;
            let seconds = self.bar.elapsed().as_secs_f64();
            say(format_args!("photoncard: {study} {done} of {total} points, {seconds:.1} s"));
        }
    }

    fn begin(&mut self, study: &str, total: usize) {
        self.bar.finish_and_clear();
        study.clone_into(&mut self.study);
        self.told = 0;
        let target =
            if self.on_terminal { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        self.bar = ProgressBar::with_draw_target(Some(total as u64), target);
        let template = "{msg:11} {bar:40} {pos}/{len} points {elapsed} {eta} left";
        // The fallback is indicatif's own template.
        self.bar.set_style(
            ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()),
        );
        self.bar.set_message(study.to_owned());
        self.bar.enable_steady_tick(std::time::Duration::from_secs(1));
    }
}
