//! The cards of a render: reached, greeted, and put to work together.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use photoncard_shared::budget::Budget;
use photoncard_shared::counters::Counters;

use super::address::{CardAddress, MAX_CHIPS};
use super::card_thread::{CardOutcome, render_on};
use super::crew::Crew;
use super::greeting::{GreetedCard, GreetingError, card_name, greet};
use super::open_card::OpenCard;
use super::{CardError, CardSet, Observer, RenderError, RenderSettings};
use crate::dispatcher::Dispatcher;
use crate::display::Display;
use crate::emulator::memory_model::MemoryTraffic;
use crate::emulator::trace::TraceFile;
use crate::emulator::{ChipKind, MemoryModel, SharedImage};
use crate::pack::CardImage;
use crate::partial::PartialRender;
use crate::scheduler::{Scheduler, Standing, TileCounts};
use crate::session::{Job, LinkBytes};
use crate::sink::TileSink;

/// The number of emulated reference chips at some addresses.
///
/// # Errors
/// If there is any other card among them.
pub(super) fn reference_chips(addresses: &[CardAddress]) -> Result<usize, RenderError> {
    let counts = addresses.iter().map(|address| match *address {
        CardAddress::Emulated { kind: ChipKind::Reference, chips } => Some(chips),
        _ => None,
    });
    let chips = counts.sum::<Option<usize>>().ok_or_else(|| RenderError::Setting {
        option: "--order",
        value: "hilbert".into(),
        reason: "it leaves all gathers of the frame to the host, as no chip has room for them".into(),
        remedy: "use --card emulated:CHIPS, or --order sort".into(),
    })?;
    check_chips(chips)?;
    Ok(chips)
}

/// Checks the number of chips of one process.
fn check_chips(chips: usize) -> Result<(), RenderError> {
    if chips <= MAX_CHIPS {
        return Ok(());
    }
    Err(RenderError::Setting {
        option: "--card",
        value: format!("with {chips} chips in all"),
        reason: format!("one process emulates at most {MAX_CHIPS}"),
        remedy: "use fewer chips".into(),
    })
}

/// Cards that have said hello.
pub(super) struct Cards {
    cards: Vec<(String, GreetedCard)>,
    start: Instant,
    shared: SharedImage,
    /// Cards that have not said hello.
    lost: usize,
}

/// What looks on while tiles are finished.
#[derive(Clone, Copy)]
pub(super) struct Onlookers<'a> {
    pub(super) partial: Option<&'a PartialRender>,
    pub(super) display: Option<&'a Display>,
    pub(super) observer: &'a dyn Observer,
}

/// What came of a run.
#[derive(Default)]
pub(super) struct Outcome {
    pub(super) counters: Counters,
    pub(super) bytes: LinkBytes,
    /// What was read, where memory is modelled.
    pub(super) traffic: Option<MemoryTraffic>,
    pub(super) cards: usize,
    /// Cards that were given up, or have never said hello.
    pub(super) cards_given_up: usize,
    pub(super) tiles: TileCounts,
    pub(super) load_seconds: f64,
    pub(super) render_seconds: f64,
}

impl Cards {
    /// Starts all cards and says hello to each, at the same time. Their memory is modelled if the settings say so, that of the
    /// first with `trace`. A card that does not say hello is lost.
    ///
    /// # Errors
    /// If fewer are left than are needed.
    pub(super) fn connect(
        settings: &RenderSettings,
        mut trace: Option<TraceFile>,
        observer: &dyn Observer,
    ) -> Result<Self, RenderError> {
        let start = Instant::now();
        let shared = SharedImage::default();
        let CardSet { addresses, faults, .. } = &settings.cards;
        let caches = settings.modelled_caches();
        check_chips(addresses.iter().map(CardAddress::emulated_chips).sum())?;
        let each_card = (addresses.iter())
            .flat_map(|address| std::iter::repeat_n(address, address.emulated_chips().max(1)))
            .enumerate();
        let results: Vec<(String, Result<GreetedCard, GreetingError>)> = std::thread::scope(|scope| {
            let shared = &shared;
            let threads: Vec<_> = each_card
                .map(|(index, address)| {
                    let model = caches.map(|caches| MemoryModel { caches, trace: trace.take() });
                    let work = move || {
                        let card = OpenCard::open(index, address, model, shared, *faults)?;
                        greet(card, start, observer)
                    };
                    (card_name(index, address), scope.spawn(work))
                })
                .collect();
            let join = |thread: std::thread::ScopedJoinHandle<_>| {
                thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
            };
            threads.into_iter().map(|(name, thread)| (name, join(thread))).collect()
        });
        let mut this = Self { cards: Vec::new(), start, shared, lost: 0 };
        let mut errors = Vec::new();
        for (name, result) in results {
            match result {
                Ok(card) => this.cards.push((name, card)),
                Err(GreetingError::Card(error)) => errors.push((name, error)),
                Err(GreetingError::Stopped) => return Err(RenderError::Stopped),
            }
        }
        this.lost = errors.len();
        this.lose(errors, settings.needed_cards(), observer)?;
        Ok(this)
    }

    /// Reports cards that have not said hello to the observer.
    ///
    /// # Errors
    /// If too few are left: the last card's.
    fn lose(
        &self,
        mut errors: Vec<(String, CardError)>,
        needed: usize,
        observer: &dyn Observer,
    ) -> Result<(), RenderError> {
        let last = errors.pop_if(|_| self.cards.len() < needed);
        errors.iter().for_each(|(card, error)| observer.lost(card, error));
        last.map_or(Ok(()), |(card, source)| Err(RenderError::Card { card, source }))
    }

    /// Tells emulated cards of the image that they will be loaded with, so that they need not copy it.
    pub(super) fn share(&self, image: Arc<CardImage>) {
        self.shared.give(image);
    }

    /// What each card can hold.
    pub(super) fn budgets(&self) -> impl Iterator<Item = Budget> {
        self.cards.iter().map(|(_, card)| card.budget)
    }

    /// How many there are.
    pub(super) fn count(&self) -> usize {
        self.cards.len()
    }

    /// Renders a scheduler's tiles on all cards, into sinks.
    pub(super) fn run(
        self,
        job: Job,
        scheduler: Scheduler,
        sinks: Vec<&dyn TileSink>,
        onlookers: Onlookers,
    ) -> Result<Outcome, RenderError> {
        let begun = self.start.elapsed();
        let (names, cards): (Vec<String>, Vec<GreetedCard>) = self.cards.into_iter().unzip();
        let count = cards.len();
        let Onlookers { partial, display, observer } = onlookers;
        let crew = Crew {
            dispatcher: Dispatcher::new(scheduler, sinks),
            observer,
            start: self.start,
            names,
            partial,
            display,
            failed: AtomicBool::new(false),
        };
        let results: Vec<Result<CardOutcome, RenderError>> = std::thread::scope(|scope| {
            let crew = &crew;
            let threads: Vec<_> = (cards.into_iter().enumerate())
                .map(|(number, card)| scope.spawn(move || render_on(number, card, job, crew)))
                .collect();
            // A panic of a host thread is a panic of the host.
            threads
                .into_iter()
                .map(|thread| thread.join().unwrap_or_else(|p| std::panic::resume_unwind(p)))
                .collect()
        });
        let ended = self.start.elapsed();
        let sum = sum_up(results)?;
        let loaded = sum.loaded.max(begun);
        let scheduler = crew.dispatcher.scheduler();
        let is_given_up = |&card: &usize| scheduler.standing(card) == Standing::GivenUp;
        Ok(Outcome {
            counters: scheduler.counters(),
            bytes: sum.bytes,
            traffic: sum.traffic,
            cards: count + self.lost,
            cards_given_up: (0..count).filter(is_given_up).count() + self.lost,
            tiles: scheduler.counts(),
            load_seconds: (loaded - begun).as_secs_f64(),
            render_seconds: (ended - loaded).as_secs_f64(),
        })
    }
}

/// What came of all cards together.
///
/// # Errors
/// That of the card which failed first: it made the others stop.
fn sum_up(results: Vec<Result<CardOutcome, RenderError>>) -> Result<CardOutcome, RenderError> {
    let mut sum = CardOutcome::default();
    let mut is_stopped = false;
    for result in results {
        match result {
            Ok(outcome) => sum.add(&outcome),
            Err(RenderError::Stopped) => is_stopped = true,
            Err(error) => return Err(error),
        }
    }
    if is_stopped { Err(RenderError::Stopped) } else { Ok(sum) }
}
