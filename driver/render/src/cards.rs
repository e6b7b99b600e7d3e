//! Renders tiles on cards: connects to all cards, greets them, and renders on them in parallel. The
//! connections stay open for the next picture.

use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use photoncard_cards::dispatcher::Dispatcher;
use photoncard_cards::scheduler::{CardNumber, GatherOrder, Scheduler, Standing, near, spread};
use photoncard_cards::session::{Job, PixelLimits, Upload};
use photoncard_map::pack::CardImage;
use photoncard_picture::sink::TileSink;
use photoncard_shared::budget::Budget;
use photoncard_shared::message::Tile;

use super::card_thread::render_on;
use super::crew::Crew;
use super::greeting::{GreetedCard, GreetingError, greet};
use super::hands::Hands;
use super::open_card::OpenCard;
use super::outputs::Outputs;
use super::statistics::EARLIER_RENDER;
use super::work::{BudgetCheck, Outcome, Work};
use super::{CardAddress, CardError, CardSet, Observer, RenderError, RenderSettings};
use crate::emulator::memory_model::MemoryTraffic;
use crate::emulator::trace::TraceFile;
use crate::emulator::{MemoryModel, SharedImage, TileLines};

/// Maximum pause between renders without a new greeting. After a longer pause, remote cards are greeted
/// again, because a card may close a silent link.
const MAX_REST: Duration = Duration::from_secs(5);

/// Cards that answered the greeting.
pub(super) struct Cards {
    set: CardSet,
    hands: Hands,
    cards: Vec<(String, GreetedCard)>,
    /// Emulated cards that were left out of the last picture because of their budget. They are checked again
    /// for the next picture.
    left_out: Vec<(String, GreetedCard)>,
    /// Names of the cards that the observer already knows to be left out.
    known: Vec<String>,
    start: Instant,
    shared: SharedImage,
    /// Card image that was last loaded into the cards, and its upload.
    upload: Option<(Arc<CardImage>, Arc<Upload>)>,
    /// Number of cards that did not answer the greeting, were left out because of their budget, or were given
    /// up in an earlier render.
    lost: usize,
    /// Time at which the last render ended, or the greetings if there was no render.
    used: Instant,
}

impl Cards {
    /// Starts and greets all cards in parallel. Their memory is modelled if the settings ask for it; the
    /// model of the first card writes the trace. A card that does not answer counts as lost.
    ///
    /// # Errors
    /// If the trace cannot be written, or fewer cards are left than needed.
    pub(super) async fn connect(
        settings: &RenderSettings,
        hands: &Hands,
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
            async move {
                let card = OpenCard::open(index, address, hands, model, shared_image, *faults);
                let greeted = match card {
                    Ok(card) => greet(card, hands, start, observer).await,
                    Err(error) => Err(error.into()),
                };
                (address.name_of(index), greeted)
            }
        });
        let results = hands.all(greetings).await;
        let (set, hands) = (settings.cards.clone(), hands.clone());
        let (cards, left_out, known, upload) = (Vec::new(), Vec::new(), Vec::new(), None);
        let mut this =
            Self { set, hands, cards, left_out, known, start, shared, upload, lost: 0, used: start };
        let mut errors = Vec::new();
        for (name, result) in results {
            match result {
                Ok(card) => this.cards.push((name, card)),
                Err(GreetingError::Card(error)) => errors.push((name, error)),
                Err(GreetingError::Stopped) => return Err(RenderError::Stopped),
            }
        }
        this.lost = errors.len();
        this.used = Instant::now();
        this.lose(errors, settings.needed_cards(), observer)?;
        Ok(this)
    }

    /// Returns whether these are the cards of the settings, enough of them are left, and they can be used
    /// without a new greeting.
    pub(super) fn serve(&self, settings: &RenderSettings) -> bool {
        let is_remote = |address: &CardAddress| matches!(address, CardAddress::Remote(_));
        let is_fresh = !self.set.addresses.iter().any(is_remote) || self.used.elapsed() <= MAX_REST;
        // A modelled memory counts the traffic of one render, so that its card cannot be used for another.
        let is_modelled = settings.modelled_caches().is_some();
        self.set == settings.cards && !is_modelled && is_fresh && self.cards.len() >= settings.needed_cards()
    }

    /// Takes back the cards that were left out of the last picture, to check them for the next picture.
    pub(super) fn take_back(&mut self) {
        self.lost -= self.left_out.len();
        self.known = self.left_out.iter().map(|(name, _)| name.clone()).collect();
        self.cards.append(&mut self.left_out);
    }

    /// Reports cards that did not answer the greeting, or have too small a budget, to the observer.
    ///
    /// # Errors
    /// The error of the last lost card, if fewer than `needed` cards are left.
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

    /// Gives the card image by reference to emulated cards with empty memory, instead of sending it over
    /// their links. Cards with a modelled memory, and all cards on links with injected faults, are loaded
    /// over their links.
    fn share(&mut self, image: &Arc<CardImage>, checksum: u64) {
        let is_faulty = self.set.faults.is_some();
        for (_, GreetedCard { card, session, .. }) in &mut self.cards {
            if let Some(memory) = card.take_empty_memory()
                && !is_faulty
            {
                memory.give(image.clone(), Some(checksum));
                session.assume(checksum);
            }
        }
    }

    /// Returns the upload of a card image. Cards that have the previous image receive only the lines that
    /// differ.
    fn upload(&mut self, image: &Arc<CardImage>) -> Arc<Upload> {
        let upload = match self.upload.take() {
            Some((last, upload)) if Arc::ptr_eq(&last, image) => upload,
            Some((_, last)) => Arc::new(Upload::new(image.clone()).after(&last)),
            None => Arc::new(Upload::new(image.clone())),
        };
        self.upload = Some((image.clone(), upload.clone()));
        upload
    }

    /// Tiles of the last picture, each with the number of the card that rendered it.
    fn homes(&self) -> impl Iterator<Item = (CardNumber, &Tile)> {
        let cards = self.cards.iter().enumerate();
        cards.flat_map(|(number, (_, card))| card.tiles.iter().map(move |tile| (number, tile)))
    }

    /// Renders the tiles of a scheduler on all cards and passes them to the sinks.
    async fn render(
        &mut self,
        job: &Job,
        scheduler: Scheduler,
        sinks: Vec<&dyn TileSink>,
        outputs: &Outputs<'_>,
    ) -> Outcome {
        let begun = self.start.elapsed();
        let count = self.cards.len();
        let names: Vec<String> = self.cards.iter().map(|(name, _)| name.clone()).collect();
        let lines: Vec<TileLines> = self.cards.iter().map(|(_, card)| card.card.tile_lines()).collect();
        let rendered = |card: usize, tile: &Tile| {
            outputs.observer.rendered(&names[card], tile, lines[card].take(tile.id));
        };
        let crew = Crew {
            dispatcher: Dispatcher::new(scheduler, sinks).telling(&rendered),
            outputs,
            hands: &self.hands,
            start: self.start,
            names: &names,
            waits: self.cards.iter().map(|(_, card)| card.card.wait_for_return()).collect(),
            alone: Mutex::default(),
            failed: AtomicBool::new(false),
        };
        let crew_of_all = &crew;
        let cards = self.cards.iter_mut().enumerate();
        let works = cards.map(|(number, (_, card))| render_on(number, card, job, crew_of_all));
        let results = self.hands.all(works).await;
        let ended = self.start.elapsed();
        let links = self.cards.iter_mut().map(|(_, card)| card.count_bytes()).collect();
        let scheduler = crew.dispatcher.scheduler();
        let (loaded, failure) = match latest(results) {
            Ok(loaded) => (loaded.max(begun), None),
            Err(error) => (ended, Some(error)),
        };
        let dazzling = names.iter().cloned().enumerate();
        let dazzling = dazzling.map(|(card, name)| (name, scheduler.dazzling_of(card)));
        let kept = (EARLIER_RENDER.to_owned(), scheduler.counts().kept_dazzling + outputs.kept_dazzling);
        let outcome = Outcome {
            counters: scheduler.counters(),
            dazzling: dazzling.chain([kept]).filter(|(_, tiles)| *tiles > 0).collect(),
            links,
            traffic: None,
            cards: count + self.lost,
            cards_given_up: self.lost,
            tiles: scheduler.counts(),
            failure,
            load_seconds: (loaded - begun).as_secs_f64(),
            render_seconds: (ended - loaded).as_secs_f64(),
        };
        if outcome.failure.is_some() {
            let given_up = (0..count).filter(|&card| scheduler.standing(card) == Standing::GivenUp).count();
            return Outcome { cards_given_up: self.lost + given_up, ..outcome };
        }
        for (number, (_, card)) in self.cards.iter_mut().enumerate() {
            card.tiles = scheduler.rendered_by(number).copied().collect();
        }
        let is_given_up = |card: usize| scheduler.standing(card) == Standing::GivenUp;
        let given_up: Vec<bool> = (0..count).map(is_given_up).collect();
        self.lost += given_up.iter().filter(|&&given_up| given_up).count();
        let mut is_kept = given_up.iter().map(|given_up| !given_up);
        self.cards.retain(|_| is_kept.next().unwrap_or(true));
        Outcome { cards_given_up: self.lost, ..outcome }
    }

    /// Ends cards whose memory is modelled. Returns the sum of their traffic.
    ///
    /// # Errors
    /// If the trace cannot be written.
    fn finish_models(&mut self) -> Result<MemoryTraffic, RenderError> {
        let mut sum = MemoryTraffic::ZERO;
        for (_, card) in self.cards.drain(..) {
            if let Some(record) = card.card.finish() {
                sum.add(&record.traffic);
                record.trace.map_or(Ok(()), TraceFile::finish)?;
            }
        }
        Ok(sum)
    }

    pub(super) fn budgets(&self) -> Vec<Budget> {
        self.cards.iter().map(|(_, card)| card.budget).collect()
    }

    /// Leaves out all cards whose budgets fail the check, and reports their names to the observer.
    ///
    /// # Errors
    /// The failure of a card, if fewer than `needed` cards are left.
    pub(super) fn leave_out(
        &mut self,
        check: BudgetCheck,
        needed: usize,
        observer: &dyn Observer,
    ) -> Result<(), RenderError> {
        let mut misfits = Vec::new();
        for (name, mut card) in std::mem::take(&mut self.cards) {
            match check(&card.budget) {
                Ok(()) => self.cards.push((name, card)),
                Err(error) => {
                    misfits.push((name.clone(), error));
                    card.tiles.clear();
                    self.left_out.extend(card.card.is_emulated().then_some((name, card)));
                }
            }
        }
        self.lost += misfits.len();
        let is_alike = |(_, error): &(String, RenderError)| error.to_string() == misfits[0].1.to_string();
        if self.cards.is_empty() && misfits.iter().all(is_alike) {
            // All cards fail alike: the setting is at fault.
            return misfits.pop().map_or(Ok(()), |(_, error)| Err(error));
        }
        // If too few cards are left, the picture fails with the error of the last card that was left out,
        // even if it was reported before.
        let has_enough = self.cards.len() >= needed;
        let misfits = misfits.into_iter().filter(|(name, _)| !has_enough || !self.known.contains(name));
        let misfits = misfits.map(|(name, error)| (name, CardError::of_budget(&error)));
        self.lose(misfits.collect(), needed, observer)
    }

    /// Renders the tiles of the work and passes them to the sinks.
    ///
    /// # Errors
    /// If the trace cannot be written. All other errors are in [`Outcome::failure`], with an outcome that
    /// describes the work until then.
    pub(super) async fn run(&mut self, work: Work<'_>) -> Result<Outcome, RenderError> {
        let Work { settings, image, frame, tiles, film, sinks, outputs } = work;
        // Emulated cards that receive the shared card image over their links store no copy of it.
        self.shared.give(image.clone(), None);
        let (scene_image, _) = image.view();
        let limits = PixelLimits::new(&scene_image.header, frame);
        let job = Job { upload: self.upload(image), frame: *frame, limits };
        self.share(image, job.upload.checksum());
        let scheduler = settings.scheduler(tiles, self.cards.len());
        let mut scheduler = scheduler.with_kept(&film.lock().unwrap_or_else(PoisonError::into_inner));
        if frame.keep_records && frame.first_sample > 0 {
            scheduler = scheduler.with_homes(self.homes());
        }
        let outcome = self.render(&job, scheduler, sinks, outputs).await;
        self.used = Instant::now();
        if settings.modelled_caches().is_none() {
            return Ok(outcome);
        }
        let traffic = Some(self.finish_models()?);
        Ok(Outcome { traffic, ..outcome })
    }
}

/// Returns the latest of the times at which the cards were loaded.
///
/// # Errors
/// The first failure other than [`RenderError::Stopped`]. If there is none, [`RenderError::Stopped`], which
/// all threads return when the render is stopped.
fn latest(results: Vec<Result<Duration, RenderError>>) -> Result<Duration, RenderError> {
    let mut latest = Duration::ZERO;
    let mut is_stopped = false;
    for result in results {
        match result {
            Ok(loaded) => latest = latest.max(loaded),
            Err(RenderError::Stopped) => is_stopped = true,
            Err(error) => return Err(error),
        }
    }
    if is_stopped { Err(RenderError::Stopped) } else { Ok(latest) }
}

impl RenderSettings {
    /// Checks that tiles can be verified by a second card, if the settings ask for it.
    ///
    /// # Errors
    /// If there are fewer than two cards, the fraction of verified tiles is invalid, or memory is modelled.
    /// The model would count the reads of both cards.
    pub(super) fn check_verification(&self) -> Result<(), RenderError> {
        let Some(share) = self.cards.verify else { return Ok(()) };
        let [reason, remedy] = if !(share > 0.0 && share <= 1.0) {
            ["a share of the tiles is above 0 and at most 1", "give a number such as 0.02"]
        } else if self.cards.count() < 2 {
            [
                "a tile is verified by a second card",
                "give two `cards.addresses` or more, or `cards.addresses` emulated:2",
            ]
        } else if self.modelled_caches().is_some() {
            ["reads of memory are counted once for each tile", "leave out `cards.caches`, and `cards.trace`"]
        } else {
            return Ok(());
        };
        let (value, reason, remedy) = (share.to_string(), reason.into(), remedy.into());
        Err(RenderError::Setting { field: "cards.verify", value, reason, remedy })
    }

    /// Minimum number of cards that a render needs.
    pub(super) fn needed_cards(&self) -> usize {
        if self.cards.verify.is_some() { 2 } else { 1 }
    }

    /// Creates the scheduler of the tiles for `cards` cards. If memory is modelled, no tile is rendered
    /// twice, because all reads count.
    pub(super) fn scheduler(&self, tiles: Vec<Tile>, cards: usize) -> Scheduler {
        let deals_shares = self.schedule.order == GatherOrder::Buckets;
        // The counts of modelled caches depend on the order of the tiles, so the order of the picture is
        // kept.
        if self.modelled_caches().is_some() {
            return Scheduler::new(tiles, cards).in_shares(deals_shares);
        }
        let ordered = match self.schedule.focus {
            Some(focus) => near(tiles, focus),
            None => spread(tiles),
        };
        let scheduler = Scheduler::new(ordered, cards).with_helpers().in_shares(deals_shares);
        match self.cards.verify {
            Some(share) => scheduler.verifying(share, self.integrator.seed),
            None => scheduler,
        }
    }
}
