//! Executor of tiles on cards: connects to all cards, greets them, and renders on them in parallel.

use std::panic::resume_unwind;
use std::sync::PoisonError;
use std::sync::atomic::AtomicBool;
use std::thread::ScopedJoinHandle;
use std::time::Instant;

use photoncard_shared::budget::Budget;
use photoncard_shared::checksum::image_checksum;

use super::card_thread::{CardOutcome, render_on};
use super::crew::Crew;
use super::executor::{Executor, Outcome, Work};
use super::greeting::{GreetedCard, GreetingError, card_name, greet};
use super::open_card::OpenCard;
use super::outputs::Outputs;
use super::{CardError, CardSet, Observer, RenderError, RenderSettings};
use crate::dispatcher::Dispatcher;
use crate::emulator::trace::TraceFile;
use crate::emulator::{MemoryModel, SharedImage};
use crate::scheduler::{Scheduler, Standing};
use crate::session::{Job, PixelLimits};
use crate::sink::TileSink;

/// Cards that have answered the greeting.
pub(super) struct Cards<'a> {
    settings: &'a RenderSettings,
    cards: Vec<(String, GreetedCard)>,
    start: Instant,
    shared: SharedImage,
    /// Number of cards that have not answered the greeting.
    lost: usize,
}

impl<'a> Cards<'a> {
    /// Starts and greets all cards in parallel. Their memory is modelled if the settings ask for it, the first card's with
    /// the trace. A card that does not answer counts as lost.
    ///
    /// # Errors
    /// If the trace cannot be written, or fewer cards are left than needed.
    pub(super) fn connect(
        settings: &'a RenderSettings,
        observer: &dyn Observer,
    ) -> Result<Self, RenderError> {
        let mut trace = settings.cards.trace.as_ref().map(TraceFile::create).transpose()?;
        let start = Instant::now();
        let shared = SharedImage::default();
        let CardSet { addresses, faults, .. } = &settings.cards;
        let caches = settings.modelled_caches();
        let each_card = (addresses.iter())
            .flat_map(|address| std::iter::repeat_n(address, address.emulated_chips().max(1)))
            .enumerate();
        let shared_image = &shared;
        let greetings = each_card.map(|(index, address)| {
            let model = caches.map(|caches| MemoryModel { caches, trace: trace.take() });
            move || {
                let card = OpenCard::open(index, address, model, shared_image, *faults);
                let greeted = card.map_err(GreetingError::from).and_then(|card| greet(card, start, observer));
                (card_name(index, address), greeted)
            }
        });
        let results = on_threads(greetings);
        let mut this = Self { settings, cards: Vec::new(), start, shared, lost: 0 };
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

    /// Reports cards that have not answered the greeting to the observer.
    ///
    /// # Errors
    /// If too few are left: the error of the last lost card.
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

    /// Renders a scheduler's tiles on all cards, into sinks.
    fn render(
        self,
        job: Job,
        scheduler: Scheduler,
        sinks: Vec<&dyn TileSink>,
        outputs: &Outputs,
    ) -> Result<Outcome, RenderError> {
        let begun = self.start.elapsed();
        let (names, cards): (Vec<String>, Vec<GreetedCard>) = self.cards.into_iter().unzip();
        let count = cards.len();
        let crew = Crew {
            dispatcher: Dispatcher::new(scheduler, sinks),
            outputs,
            start: self.start,
            names,
            failed: AtomicBool::new(false),
        };
        let crew_of_all = &crew;
        let results = on_threads(
            (cards.into_iter().enumerate())
                .map(|(number, card)| move || render_on(number, card, job, crew_of_all)),
        );
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

impl Executor for Cards<'_> {
    fn budgets(&self) -> Vec<Budget> {
        self.cards.iter().map(|(_, card)| card.budget).collect()
    }

    fn finishes_tiles_early(&self) -> bool {
        true
    }

    fn run(self: Box<Self>, work: Work) -> Result<Outcome, RenderError> {
        let Work { image, frame, tiles, film, sinks, outputs } = work;
        // Emulated cards that receive the shared image store no copy of it.
        self.shared.give(image.clone());
        let (scene_image, _) = image.view();
        let job = Job {
            image: image.lines(),
            checksum: image_checksum(image.lines()),
            frame,
            limits: PixelLimits::new(&scene_image.header, frame),
        };
        let scheduler = self.settings.scheduler(tiles, self.cards.len());
        let scheduler = scheduler.with_kept(&film.lock().unwrap_or_else(PoisonError::into_inner));
        self.render(job, scheduler, sinks, outputs)
    }
}

/// Does each piece of work on a thread of its own. Returns the results in the order of the work. A panic of one is the
/// caller's.
fn on_threads<W: FnOnce() -> T + Send, T: Send>(works: impl Iterator<Item = W>) -> Vec<T> {
    std::thread::scope(|scope| {
        let threads: Vec<_> = works.map(|work| scope.spawn(work)).collect();
        let join = |thread: ScopedJoinHandle<T>| thread.join().unwrap_or_else(|panic| resume_unwind(panic));
        threads.into_iter().map(join).collect()
    })
}

/// Sum of the outcomes of all cards.
///
/// # Errors
/// The first failure: it has stopped the other cards.
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
