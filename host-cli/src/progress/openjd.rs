//! Progress and failure as Open Job Description reads them from standard output: `openjd_progress: PERCENT`,
//! `openjd_fail: MESSAGE`.

use std::sync::Mutex;
use std::sync::PoisonError;

use photoncard_driver::render::Phase;

use crate::console::print;
use crate::failure::Failure;

/// Progress of one phase, which is most of a command's work.
pub(super) struct Percent {
    phase: Phase,
    told: Mutex<Option<u64>>,
}

impl Percent {
    /// Nothing told yet of a phase.
    pub(super) fn of(phase: Phase) -> Self {
        Self { phase, told: Mutex::default() }
    }

    /// Tells of progress, if it is of the phase and a percent more than was told.
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

/// Tells of a failure.
pub(crate) fn fail(failure: &Failure) {
    let _ = print(&[format!("openjd_fail: {}", failure.line())]);
}
