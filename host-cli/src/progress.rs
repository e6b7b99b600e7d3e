//! Progress of a render: a bar on a terminal, otherwise a line for each tenth of a phase.

use std::error::Error;
use std::io::IsTerminal;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use photoncard_driver::render::{CardError, Observer, Phase};
use signal_hook::consts::{SIGINT, SIGTERM};

use crate::console::say;

/// Display of a render's progress; SIGINT and SIGTERM stop the render.
pub(crate) struct Progress {
    stopped: Arc<AtomicBool>,
    kept: AtomicBool,
    display: Option<Mutex<Display>>,
}

struct Display {
    phase: Option<Phase>,
    bar: ProgressBar,
    on_terminal: bool,
    /// Number of tenths of the phase that were printed, without a terminal.
    told: u64,
}

impl Progress {
    /// Starts the display, which is empty if `quiet`. The first signal stops the render, a second one ends the process.
    pub(crate) fn start(quiet: bool) -> std::io::Result<Self> {
        let display = Display {
            phase: None,
            bar: ProgressBar::hidden(),
            on_terminal: std::io::stderr().is_terminal(),
            told: 0,
        };
        let display = (!quiet).then_some(Mutex::new(display));
        Ok(Self { stopped: stop_on_signals()?, kept: AtomicBool::new(false), display })
    }

    /// Returns whether finished tiles are in the partial file.
    pub(crate) fn has_kept(&self) -> bool {
        self.kept.load(Ordering::Relaxed)
    }

    /// Removes the bar.
    pub(crate) fn finish(&self) {
        if let Some(display) = &self.display {
            display.lock().unwrap_or_else(PoisonError::into_inner).bar.finish_and_clear();
        }
    }
}

impl Observer for Progress {
    fn progress(&self, phase: Phase, done: u64, total: u64) {
        if let Some(display) = &self.display {
            display.lock().unwrap_or_else(PoisonError::into_inner).show(phase, done, total);
        }
    }

    fn is_stopped(&self) -> bool {
        self.stopped.load(Ordering::Relaxed)
    }

    fn resumed(&self, done: usize, total: usize) {
        if self.display.is_some() {
            say(format_args!("photoncard: {done} of {total} tiles were rendered before"));
        }
    }

    fn kept(&self) {
        self.kept.store(true, Ordering::Relaxed);
    }

    fn lost(&self, card: &str, error: &CardError) {
        say(format_args!("photoncard: {card} is lost: {error}; any others go on"));
    }

    fn not_shown(&self, error: &dyn Error) {
        say(format_args!("photoncard: {error}"));
    }
}

impl Display {
    fn show(&mut self, phase: Phase, done: u64, total: u64) {
        if self.phase.is_none_or(|shown| (shown as u8) < phase as u8) {
            self.begin(phase, total);
        }
        // A card that is still loading reports it while another one renders already.
        if self.phase != Some(phase) {
            return;
        }
        self.bar.set_position(done);
        let tenths = (10 * done).checked_div(total).unwrap_or(0);
        if !self.on_terminal && tenths > self.told {
            self.told = tenths;
            let seconds = self.bar.elapsed().as_secs_f64();
            say(format_args!("photoncard: {} {done} of {total}, {seconds:.1} s", name(phase)));
        }
    }

    fn begin(&mut self, phase: Phase, total: u64) {
        self.bar.finish_and_clear();
        self.phase = Some(phase);
        self.told = 0;
        let target =
            if self.on_terminal { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        self.bar = ProgressBar::with_draw_target(Some(total), target);
        let template = match phase {
            Phase::Load => "{msg:8} {bar:40} {bytes}/{total_bytes} {bytes_per_sec} {eta} left",
            Phase::Pack => "{msg:8} {elapsed}",
            Phase::Photons | Phase::Tiles => "{msg:8} {bar:40} {pos}/{len} {per_sec} {eta} left",
        };
        // The fallback is indicatif's own template.
        self.bar.set_style(
            ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()),
        );
        self.bar.set_message(name(phase));
    }
}

/// Flag that SIGINT and SIGTERM set; a second signal ends the process.
pub(crate) fn stop_on_signals() -> std::io::Result<Arc<AtomicBool>> {
    let stopped = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register_conditional_shutdown(signal, 130, stopped.clone())?;
        signal_hook::flag::register(signal, stopped.clone())?;
    }
    Ok(stopped)
}

fn name(phase: Phase) -> &'static str {
    match phase {
        Phase::Photons => "photons",
        Phase::Pack => "pack",
        Phase::Load => "load",
        Phase::Tiles => "tiles",
    }
}
