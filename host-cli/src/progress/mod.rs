//! Progress of a render or of a card's self-test: a bar on a terminal, elsewhere a line for each tenth of a
//! phase, or JSON objects.

pub(crate) mod remaining;

use std::error::Error;
use std::fmt::Arguments;
use std::io::IsTerminal;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use photoncard_driver::render::{CardError, Observer, Phase};
use serde_json::{Value, json};
use signal_hook::consts::{SIGINT, SIGTERM};

use self::remaining::Remaining;
use crate::arguments::{HostOptions, ProgressForm};
use crate::console::{is_json, print, say, say_json};
use crate::failure::Failure;
#[cfg(target_os = "linux")]
use crate::hang_up;

/// Display of the progress of a render or self-test. SIGINT, SIGTERM and SIGHUP stop the work.
pub(crate) struct Progress {
    stopped: Arc<AtomicBool>,
    kept: AtomicBool,
    /// Statistics of the last render that failed.
    failed: Mutex<Option<Value>>,
    display: Option<Mutex<Display>>,
    /// Progress reports for a farm's engine; `None` unless requested.
    percent: Option<Percent>,
}

/// Time from the start of a phase, seconds, in which only the phase's last line is printed. Used without a
/// terminal, for the phases before the tiles.
const SILENT_SECONDS: f64 = 1.0;

struct Display {
    phase: Option<Phase>,
    bar: ProgressBar,
    remaining: Remaining,
    /// Number of cards, which render tiles in parallel.
    cards: usize,
    /// Number of tiles that an earlier render has finished.
    resumed: u64,
    form: Form,
    /// Tenths of the phase that were finished at the last printed line; used without a terminal.
    told: u64,
    /// Time of the last object.
    told_at: Option<Instant>,
    /// True after the object that says that all is done.
    is_end_told: bool,
}

/// Form of the progress on standard error.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Form {
    Bar,
    Lines,
    Json,
}

impl Form {
    fn of_standard_error() -> Self {
        match (is_json(), std::io::stderr().is_terminal()) {
            (true, _) => Self::Json,
            (false, true) => Self::Bar,
            (false, false) => Self::Lines,
        }
    }
}

/// Least time between two objects of a phase. The first and the last one of a phase are always written.
const JSON_INTERVAL: Duration = Duration::from_millis(100);

impl Progress {
    /// Starts the display of work on `cards` cards. The first signal stops the work, the second one ends the
    /// process. In the form of Open Job Description, only the percentage of `phase` is printed.
    ///
    /// # Errors
    /// If signals cannot be handled.
    pub(crate) fn start(host: &HostOptions, cards: usize, phase: Phase) -> Result<Self, Failure> {
        Self::of_lines(host.quiet, cards).map(|progress| progress.in_form(host.progress, phase))
    }

    /// Starts the display for a sequence of frames, as [`Self::start`] does. Lines show nothing during a
    /// frame.
    ///
    /// # Errors
    /// As [`Self::start`].
    pub(crate) fn of_frames(host: &HostOptions, cards: usize, phase: Phase) -> Result<Self, Failure> {
        let is_quiet = host.quiet || Form::of_standard_error() == Form::Lines;
        Self::of_lines(is_quiet, cards).map(|progress| progress.in_form(host.progress, phase))
    }

    /// Starts a display of lines or a bar; nothing is shown if `quiet`.
    ///
    /// # Errors
    /// As [`Self::start`].
    pub(crate) fn of_lines(quiet: bool, cards: usize) -> Result<Self, Failure> {
        let display = Display {
            phase: None,
            bar: ProgressBar::hidden(),
            remaining: Remaining::new(1, 0),
            cards,
            resumed: 0,
            form: Form::of_standard_error(),
            told: 0,
            told_at: None,
            is_end_told: false,
        };
        let display = (!quiet).then_some(Mutex::new(display));
        let stopped = stop_on_signals().map_err(|error| Failure::work_error(&error))?;
        let kept = AtomicBool::new(false);
        Ok(Self { stopped, kept, failed: Mutex::default(), display, percent: None })
    }

    fn in_form(self, form: ProgressForm, phase: Phase) -> Self {
        match form {
            ProgressForm::Text | ProgressForm::Json => self,
            ProgressForm::Openjd => Self { display: None, percent: Some(Percent::of(phase)), ..self },
        }
    }

    /// Starts the display of the next frame.
    pub(crate) fn begin_frame(&self) {
        self.kept.store(false, Ordering::Relaxed);
        if let Some(mut display) = self.display() {
            (display.phase, display.resumed) = (None, 0);
        }
    }

    /// Returns whether the partial file contains finished tiles.
    pub(crate) fn has_kept(&self) -> bool {
        self.kept.load(Ordering::Relaxed)
    }

    /// Takes the statistics, as JSON, of the render that failed; `None` if it failed before its cards
    /// started.
    pub(crate) fn take_failed(&self) -> Option<Value> {
        self.failed.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    /// Removes the bar.
    pub(crate) fn finish(&self) {
        if let Some(display) = self.display() {
            display.bar.finish_and_clear();
        }
    }

    fn display(&self) -> Option<MutexGuard<'_, Display>> {
        self.display.as_ref().map(|display| display.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Prints a line above the bar.
    pub(crate) fn say(&self, line: Arguments) {
        match self.display() {
            Some(display) => display.bar.suspend(|| say(line)),
            None => say(line),
        }
    }
}

impl Observer for Progress {
    fn progress(&self, phase: Phase, done: u64, total: u64) {
        if let Some(mut display) = self.display() {
            display.show(phase, done, total);
        }
        if let Some(percent) = &self.percent {
            percent.tell(phase, done, total);
        }
    }

    fn is_stopped(&self) -> bool {
        self.stopped.load(Ordering::Relaxed)
    }

    fn resumed(&self, done: usize, total: usize) {
        if let Some(mut display) = self.display() {
            display.resumed = done as u64;
            say(format_args!("photoncard: {done} of {total} tiles were rendered before"));
        }
    }

    fn kept(&self) {
        self.kept.store(true, Ordering::Relaxed);
    }

    fn failed(&self, statistics: Value) {
        *self.failed.lock().unwrap_or_else(PoisonError::into_inner) = Some(statistics);
    }

    fn lost(&self, card: &str, error: &CardError) {
        let lot = if matches!(error, CardError::Budget { .. }) { "left out" } else { "lost" };
        self.say(format_args!("photoncard: {card} is {lot}: {error}; any others go on"));
    }

    fn waits_for(&self, card: &str, error: &CardError, longest: Duration) {
        let seconds = longest.as_secs();
        self.say(format_args!(
            "photoncard: {card} is gone: {error}; waiting up to {seconds} s for it to come back"
        ));
    }

    fn not_shown(&self, error: &dyn Error) {
        self.say(format_args!("photoncard: {error}"));
    }
}

impl Display {
    fn show(&mut self, phase: Phase, done: u64, total: u64) {
        // Each pass of a picture renders its tiles again. Lines show only the first pass.
        let is_of_pass = phase == Phase::Tiles && self.form != Form::Lines;
        let is_next_pass = is_of_pass && done == 0 && self.bar.position() > 0;
        if self.phase.is_none_or(|shown| (shown as u8) < phase as u8) || is_next_pass {
            self.begin(phase, total);
        }
        // A card that is still loading reports an earlier phase while another card renders.
        if self.phase != Some(phase) {
            return;
        }
        // Cards are loaded in parallel: the progress is that of the card with most bytes.
        let done = if phase == Phase::Load { done.max(self.bar.position()) } else { done };
        let seconds = self.bar.elapsed().as_secs_f64();
        self.remaining.report(done, total, seconds);
        self.bar.set_position(done);
        let left = self.remaining.seconds(seconds);
        if self.form == Form::Json {
            return self.tell_json((phase, done, total), seconds, left);
        }
        let left = left.map(duration).map_or(String::new(), |left| format!(", {left} left"));
        self.bar.set_prefix(left.clone());
        let tenths = (10 * done).checked_div(total).unwrap_or(0);
        // A short phase before the tiles prints only its last line.
        let is_brief = phase != Phase::Tiles && done < total && seconds < SILENT_SECONDS;
        if self.form == Form::Lines && tenths > self.told && !is_brief {
            self.told = tenths;
            say(format_args!("photoncard: {} {done} of {total}, {seconds:.1} s{left}", name(phase)));
        }
    }

    /// Writes an object of the kind `progress`, unless the last one is recent.
    fn tell_json(&mut self, (phase, done, total): (Phase, u64, u64), seconds: f64, left: Option<f64>) {
        let is_recent = self.told_at.is_some_and(|told| told.elapsed() < JSON_INTERVAL);
        let is_end = done >= total;
        if if is_end { self.is_end_told } else { is_recent } {
            return;
        }
        self.is_end_told = is_end;
        self.told_at = Some(Instant::now());
        say_json(&json!({
            "kind": "progress",
            "phase": name(phase),
            "done": done,
            "total": total,
            "seconds": seconds,
            "seconds_left": left,
        }));
    }

    fn begin(&mut self, phase: Phase, total: u64) {
        self.bar.finish_and_clear();
        self.phase = Some(phase);
        (self.told, self.told_at, self.is_end_told) = (0, None, false);
        self.remaining = match phase {
            Phase::Tiles => Remaining::new(self.cards, self.resumed),
            Phase::Pilot | Phase::Photons | Phase::Pack | Phase::Load | Phase::SelfTest => {
                Remaining::new(1, 0)
            }
        };
        let target = match self.form {
            Form::Bar => ProgressDrawTarget::stderr(),
            Form::Lines | Form::Json => ProgressDrawTarget::hidden(),
        };
        self.bar = ProgressBar::with_draw_target(Some(total), target);
        let template = match phase {
            Phase::Load | Phase::SelfTest => "{msg:8} {bar:40} {bytes}/{total_bytes}{prefix}",
            Phase::Pilot | Phase::Pack => "{msg:8} {elapsed}",
            Phase::Photons | Phase::Tiles => "{msg:8} {bar:40} {pos}/{len}{prefix}",
        };
        // An invalid template would be replaced by indicatif's default.
        self.bar.set_style(
            ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()),
        );
        self.bar.set_message(name(phase));
    }
}

/// Time after the first signal within which a further signal does not end the process: `timeout` sends each
/// signal both to the process and to its group.
const REPETITIONS: Duration = Duration::from_millis(300);

/// Returns a flag that becomes true at SIGINT, SIGTERM or, on Linux, SIGHUP. A further SIGINT or SIGTERM ends
/// the process if it comes more than [`REPETITIONS`] later.
pub(crate) fn stop_on_signals() -> std::io::Result<Arc<AtomicBool>> {
    let [stopped, ends] = [(); 2].map(|()| Arc::new(AtomicBool::new(false)));
    let flags = (stopped.clone(), ends.clone());
    std::thread::Builder::new().name("signals".into()).spawn(move || {
        let (stopped, ends) = flags;
        while !stopped.load(Ordering::Relaxed) {
            std::thread::sleep(REPETITIONS / 3);
        }
        std::thread::sleep(REPETITIONS);
        ends.store(true, Ordering::Relaxed);
    })?;
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register_conditional_shutdown(signal, 130, ends.clone())?;
        signal_hook::flag::register(signal, stopped.clone())?;
    }
    #[cfg(target_os = "linux")]
    // Unless SIGHUP is known not to be ignored, the action for it stays as it is.
    if hang_up::is_ignored() == Some(false) {
        // A closed terminal sends several hang-ups, which must not end the process.
        signal_hook::flag::register(signal_hook::consts::SIGHUP, stopped.clone())?;
    }
    Ok(stopped)
}

/// Formats seconds: `8 s`, `2 min 05 s`, `3 h 20 min`.
pub(crate) fn duration(seconds: f64) -> String {
    let whole = seconds.round() as u64;
    match (whole / 3600, whole / 60 % 60, whole % 60) {
        (0, 0, seconds) => format!("{seconds} s"),
        (0, minutes, seconds) => format!("{minutes} min {seconds:02} s"),
        (hours, minutes, _) => format!("{hours} h {minutes:02} min"),
    }
}

fn name(phase: Phase) -> &'static str {
    match phase {
        Phase::Pilot => "pilot",
        Phase::Photons => "photons",
        Phase::Pack => "pack",
        Phase::Load => "load",
        Phase::Tiles => "tiles",
        Phase::SelfTest => "memory",
    }
}

/// Progress of the phase that takes most of a command's time, in the syntax of Open Job Description:
/// `openjd_progress: PERCENT` on standard output.
struct Percent {
    phase: Phase,
    told: Mutex<Option<u64>>,
}

impl Percent {
    fn of(phase: Phase) -> Self {
        Self { phase, told: Mutex::default() }
    }

    /// Prints the percentage if `phase` is the reported phase and the percentage has increased.
    fn tell(&self, phase: Phase, done: u64, total: u64) {
        let percent = 100 * done.min(total) / total.max(1);
        let mut told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
        if phase == self.phase && told.is_none_or(|told| told < percent) {
            *told = Some(percent);
            // A closed standard output does not end the work.
            let _ = print(&[format!("openjd_progress: {percent}")]);
        }
    }
}

/// Prints a failure in the syntax of Open Job Description.
pub(crate) fn fail_openjd(failure: &Failure) {
    let _ = print(&[format!("openjd_fail: {}", failure.line())]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_rounded_to_two_units() {
        for (seconds, text) in [
            (0.4, "0 s"),
            (59.4, "59 s"),
            (59.6, "1 min 00 s"),
            (125.0, "2 min 05 s"),
            (3600.0, "1 h 00 min"),
            (100_000.0, "27 h 46 min"),
        ] {
            assert_eq!(duration(seconds), text);
        }
    }
}
