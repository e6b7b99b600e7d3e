//! Executor of the order `hilbert`: emulated chips pass all gathers of the frame to the host.

use std::time::Instant;

use photoncard_firmware::kind::REFERENCE;
use photoncard_shared::budget::Budget;

use super::address::CardAddress;
use super::executor::{BudgetCheck, Executor, Outcome, Work};
use super::{Observer, Phase, RenderError, RenderSettings};
use crate::emulator::EmulatedKind;
use crate::emulator::memory_model::CacheSettings;
use crate::emulator::whole_frame::{CurveJob, CurveOutcome, render_along_curve};

/// Emulated reference chips without cards.
pub(super) struct WholeFrame {
    chips: usize,
    caches: Option<CacheSettings>,
}

impl WholeFrame {
    /// Creates an executor with the chips of the settings.
    ///
    /// # Errors
    /// If there is a card of another kind.
    pub(super) fn new(settings: &RenderSettings) -> Result<Self, RenderError> {
        let chips = reference_chips(&settings.cards.addresses)?;
        Ok(Self { chips, caches: settings.modelled_caches() })
    }
}

impl Executor for WholeFrame {
    fn budgets(&self) -> Vec<Budget> {
        vec![REFERENCE]
    }

    fn leave_out(&mut self, check: BudgetCheck, _: usize, _: &dyn Observer) -> Result<(), RenderError> {
        check(&REFERENCE)
    }

    fn finishes_tiles_early(&self) -> bool {
        false
    }

    fn run(&mut self, work: Work) -> Result<Outcome, RenderError> {
        let begun = Instant::now();
        let &mut Self { chips, caches } = self;
        let Work { image, frame, tiles, sinks, outputs, .. } = work;
        let progress = |done: u64, total: u64| {
            outputs.observer.progress(Phase::Tiles, done, total);
            outputs.report_failed_viewers();
            !outputs.observer.is_stopped()
        };
        let job = CurveJob { image, frame, tiles: &tiles, chips };
        let CurveOutcome { counters, traffic } = render_along_curve(job, caches.as_ref(), &sinks, &progress)?;
        Ok(Outcome {
            counters,
            traffic: caches.map(|_| traffic),
            cards: chips,
            render_seconds: begun.elapsed().as_secs_f64(),
            ..Outcome::default()
        })
    }
}

/// Number of emulated reference chips at the addresses.
///
/// # Errors
/// If there is any other card among them.
fn reference_chips(addresses: &[CardAddress]) -> Result<usize, RenderError> {
    let counts = addresses.iter().map(|address| match *address {
        CardAddress::Emulated { kind: EmulatedKind::Reference, chips } => Some(chips),
        _ => None,
    });
    counts.sum::<Option<usize>>().ok_or_else(|| RenderError::Setting {
        field: "schedule.order",
        value: "hilbert".into(),
        reason: "it leaves all gathers of the frame to the host, as no chip has room for them".into(),
        remedy: "use `cards.addresses` emulated:CHIPS, or `schedule.order` sort".into(),
    })
}
