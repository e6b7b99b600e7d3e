//! Command `photoncard study`.

mod command;
mod sweep;

use std::ffi::OsString;
use std::fmt::Write;
use std::io::IsTerminal;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use miette::MietteDiagnostic;
use photoncard_driver::study::{
    Extent, Provenance, StudyError, StudyObserver, StudyOptions, SweepOptions, UnitedPoints, run as study,
    run_sweep, unite,
};

use crate::arguments::{StudyArguments, StudyCommand, StudyMergeArguments};
use crate::console::say;
use crate::failure::Failure;
use crate::progress::remaining::Remaining;
use crate::progress::{duration, stop_on_signals};

/// Message of an interrupted study.
const STOPPED: &str = "stopped; finished points are kept: run the command again to go on";

/// Runs built-in studies or a sweep, or a part of them, or writes the report of their parts.
pub(crate) fn run(arguments: &StudyArguments) -> Result<(), Failure> {
    if let Some(StudyCommand::Merge(merge)) = &arguments.own {
        return run_merge(merge);
    }
    let stated = command::stated();
    let provenance = Provenance::here(&command::line(&stated));
    let part = match arguments {
        StudyArguments { own: Some(StudyCommand::Sweep(sweep)), .. } => sweep.output.part,
        StudyArguments { output, .. } => output.as_ref().and_then(|output| output.part),
    };
    let extent = part.map_or(Extent::Whole, |part| Extent::Part { part, command: stated });
    run_stated(arguments, &std::env::args_os().collect::<Vec<_>>(), provenance, extent)
}

/// Unites parts, and writes the report of their study.
fn run_merge(merge: &StudyMergeArguments) -> Result<(), Failure> {
    let union = unite(&merge.parts).map_err(|error| failure(error.into()))?;
    let (words, mut arguments) = command::parse(&union.command, &merge.out)?;
    let output = match &mut arguments {
        StudyArguments { own: Some(StudyCommand::Sweep(sweep)), .. } => Some(&mut sweep.output),
        StudyArguments { output, .. } => output.as_mut(),
    };
    if let Some(output) = output {
        (output.threads, output.quiet) = (Some(union.threads), merge.quiet);
    }
    let here = Provenance::here(&command::line(&union.command));
    let provenance = Provenance { date: union.date.clone(), host: union.host.clone(), ..here };
    let points = UnitedPoints::copy(&merge.parts, &merge.out).map_err(|error| failure(error.into()))?;
    run_stated(&arguments, &words, provenance, Extent::Merged(union))?;
    points.keep();
    Ok(())
}

/// Runs the studies of arguments, which are parsed from `words`.
fn run_stated(
    arguments: &StudyArguments,
    words: &[OsString],
    provenance: Provenance,
    extent: Extent,
) -> Result<(), Failure> {
    match arguments {
        StudyArguments { own: Some(StudyCommand::Sweep(sweep)), .. } => {
            let options = SweepOptions { extent, ..sweep::options(sweep, words, provenance)? };
            observed(sweep.output.quiet, |progress| run_sweep(options, progress).map_err(failure))
        }
        StudyArguments { own: None, name: Some(name), output: Some(output), scenes, .. } => {
            let scale = arguments.scale(*name, output.sample).map_err(|reason| refused(&reason))?;
            let options = StudyOptions {
                studies: name.studies(),
                scale,
                scenes: scenes.to_owned(),
                out: output.out.clone(),
                is_collection: name.is_collection(),
                threads: output.threads,
                provenance,
                extent,
            };
            run_shipped(&options, output.quiet)
        }
        _ => unreachable!("name and output are required without a command"),
    }
}

/// Failure of arguments that are not possible together.
fn refused(reason: &str) -> Failure {
    let help = "photoncard study --help names the options of each study";
    Failure::input(MietteDiagnostic::new(reason).with_help(help))
}

fn run_shipped(options: &StudyOptions, quiet: bool) -> Result<(), Failure> {
    if let Some(banner) = options.scale.banner() {
        say(format_args!("photoncard: {banner}"));
    }
    observed(quiet, |progress| study(options, progress).map_err(failure))
}

/// Runs `work`. Its progress is shown unless `quiet`.
fn observed(quiet: bool, work: impl FnOnce(&StudyProgress) -> Result<(), Failure>) -> Result<(), Failure> {
    let progress = StudyProgress::start(quiet).map_err(|error| Failure::work_error(&error))?;
    let result = work(&progress);
    progress.finish();
    result
}

fn failure(error: StudyError) -> Failure {
    match error {
        StudyError::Stopped => Failure::Stopped(STOPPED),
        error if error.is_input() => Failure::input(error),
        error => Failure::work(error),
    }
}

/// Progress of a study: a bar on a terminal, elsewhere a line for each tenth.
struct StudyProgress {
    stopped: Arc<AtomicBool>,
    display: Option<Mutex<Display>>,
}

struct Display {
    study: String,
    bar: ProgressBar,
    /// Estimate of the remaining time, which the bar reads each time it is drawn.
    remaining: Arc<Mutex<Remaining>>,
    on_terminal: bool,
    /// Tenths of the points that were measured at the last printed line; used without a terminal.
    told: usize,
}

impl StudyProgress {
    fn start(quiet: bool) -> std::io::Result<Self> {
        let display = Display {
            study: String::new(),
            bar: ProgressBar::hidden(),
            remaining: Arc::new(Mutex::new(Remaining::new(1, 0))),
            on_terminal: std::io::stderr().is_terminal(),
            told: 0,
        };
        Ok(Self { stopped: stop_on_signals()?, display: (!quiet).then_some(Mutex::new(display)) })
    }

    fn finish(&self) {
        if let Some(display) = &self.display {
            lock(display).bar.finish_and_clear();
        }
    }
}

impl StudyObserver for StudyProgress {
    fn progress(&self, study: &str, done: usize, total: usize, _: bool) {
        if let Some(display) = &self.display {
            lock(display).show(study, done, total);
        }
    }

    fn notice(&self, text: &str) {
        if let Some(display) = &self.display {
            let display = lock(display);
            display.bar.suspend(|| say(format_args!("photoncard: {text}")));
        }
    }

    fn is_stopped(&self) -> bool {
        self.stopped.load(Ordering::Relaxed)
    }
}

fn lock<T>(value: &Mutex<T>) -> MutexGuard<'_, T> {
    value.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Text of the remaining time, `now` seconds after the start; empty before the first point is measured.
fn left(remaining: &Mutex<Remaining>, now: f64) -> String {
    let seconds = lock(remaining).seconds(now);
    seconds.map_or(String::new(), |seconds| format!(", {} left", duration(seconds)))
}

impl Display {
    fn show(&mut self, study: &str, done: usize, total: usize) {
        let is_first = self.study != study;
        if is_first {
            self.begin(study, done, total);
        }
        let seconds = self.bar.elapsed().as_secs_f64();
        lock(&self.remaining).report(done as u64, total as u64, seconds);
        self.bar.set_position(done as u64);
        let tenths = (10 * done).checked_div(total).unwrap_or(0);
        if !self.on_terminal && (tenths > self.told || is_first) {
            self.told = tenths;
            let left = left(&self.remaining, seconds);
            say(format_args!("photoncard: {study} {done} of {total} points, {seconds:.1} s{left}"));
        }
    }

    /// Starts the progress bar of a study. An earlier run has stored `done` of its `total` points.
    fn begin(&mut self, study: &str, done: usize, total: usize) {
        self.bar.finish_and_clear();
        study.clone_into(&mut self.study);
        self.told = 0;
        let target =
            if self.on_terminal { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        self.bar = ProgressBar::with_draw_target(Some(total as u64), target);
        // One worker: points are measured one after another, each on all threads.
        self.remaining = Arc::new(Mutex::new(Remaining::new(1, done as u64)));
        let template = "{msg:11} {bar:40} {pos}/{len} points {elapsed}{left}";
        // An invalid template would be replaced by indicatif's default.
        let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
        let remaining = self.remaining.clone();
        self.bar.set_style(style.with_key("left", move |state: &ProgressState, out: &mut dyn Write| {
            let _ = out.write_str(&left(&remaining, state.elapsed().as_secs_f64()));
        }));
        self.bar.set_message(study.to_owned());
        self.bar.enable_steady_tick(std::time::Duration::from_secs(1));
    }
}
