//! Progress and failure in the syntax of Open Job Description, on standard output: `openjd_progress:
//! PERCENT`, `openjd_fail: MESSAGE`.

use std::sync::Mutex;
use std::sync::PoisonError;

use photoncard_driver::render::Phase;

use crate::console::print;
use crate::failure::Failure;

/// Progress of the phase that takes most of a command's time.
pub(super) struct Percent {
    phase: Phase,
    told: Mutex<Option<u64>>,
}

impl Percent {
    /// Creates a progress of zero percent.
    pub(super) fn of(phase: Phase) -> Self {
        Self { phase, told: Mutex::default() }
    }

    /// Prints progress of `phase`, if that is the reported phase and the percentage has increased.
    pub(super) fn tell(&self, phase: Phase, done: u64, total: u64) {
        let percent = 100 * done.min(total) / total.max(1);
        let mut told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
        if phase == self.phase && told.is_none_or(|told| told < percent) {
            *told = Some(percent);
            // A reader that is gone does not end the work.
            let _ = print(&[format!("openjd_progress: {percent}")]);
        }
    }
}

/// Prints a failure.
pub(crate) fn fail(failure: &Failure) {
    let _ = print(&[format!("openjd_fail: {}", failure.line())]);
}
