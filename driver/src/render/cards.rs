//! The cards of a render: each has a thread of the host that moves bytes between its port and its session.

use std::sync::atomic::{AtomicBool, AtomicU16, AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime};

use photoncard_firmware::sampler::hash;
use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::budget::Budget;
use photoncard_shared::counters::Counters;
use photoncard_shared::link::{Port, PortError};
use photoncard_shared::message::MemoryUse;

use super::address::{CardAddress, MAX_CHIPS};
use super::open_card::OpenCard;
use super::{Observer, Phase, RenderError, RenderSettings, Unobserved};
use crate::emulator::memory_model::MemoryTraffic;
use crate::emulator::trace::TraceFile;
use crate::emulator::{ChipKind, MemoryModel};
use crate::session::{Job, LinkBytes, Picture, Session, SessionError};

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

/// Whether there is one chip at some addresses, and it is emulated.
pub(super) fn is_one_emulated_chip(addresses: &[CardAddress]) -> bool {
    matches!(addresses, [CardAddress::Emulated { chips: 1, .. }])
}

/// The first card among some addresses that is not emulated in this process.
pub(super) fn first_remote(addresses: &[CardAddress]) -> Option<&CardAddress> {
    addresses.iter().find(|address| !matches!(address, CardAddress::Emulated { .. }))
}

/// Cards that have said hello.
pub(super) struct Cards {
    cards: Vec<Connected>,
    start: Instant,
}

struct Connected {
    card: OpenCard,
    session: Session<'static>,
    budget: Budget,
}

/// What a card says of itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CardInfo {
    /// Name and version of its firmware.
    pub build: String,
    /// What it can hold.
    pub budget: Budget,
    /// What its firmware takes of on-chip memory; `None` of a card that does not measure it.
    pub memory_use: Option<MemoryUse>,
}

/// Says hello to the first card at an address.
///
/// # Errors
/// If it cannot be started or reached, or does not answer as it should.
pub fn card_info(address: &CardAddress) -> Result<CardInfo, RenderError> {
    let nothing = Mutex::new(Picture::empty()?);
    let card = OpenCard::open(0, address, None, None)?;
    let connected = greet(card, &nothing, Instant::now(), &Unobserved)?;
    let Connected { session, budget, .. } = connected;
    Ok(CardInfo { build: session.build().to_owned(), budget, memory_use: session.memory_use() })
}

/// Says hello to the first card at an address some times. Returns how long each answer took.
///
/// # Errors
/// If it cannot be started or reached, or does not answer as it should.
pub fn card_ping(address: &CardAddress, count: usize) -> Result<Vec<Duration>, RenderError> {
    let nothing = Mutex::new(Picture::empty()?);
    let mut card = OpenCard::open(0, address, None, None)?;
    let mut answers = Vec::with_capacity(count);
    for _ in 0..count {
        let start = Instant::now();
        card = greet(card, &nothing, start, &Unobserved)?.card;
        answers.push(start.elapsed());
    }
    Ok(answers)
}

/// What came of a run.
#[derive(Default)]
pub(super) struct Outcome {
    pub(super) counters: Counters,
    pub(super) bytes: LinkBytes,
    /// What was read, where memory is modelled.
    pub(super) traffic: Option<MemoryTraffic>,
    pub(super) cards: usize,
    pub(super) load_seconds: f64,
    pub(super) render_seconds: f64,
}

/// What the threads of all cards share.
struct Shared<'a> {
    picture: &'a Mutex<Picture>,
    failed: AtomicBool,
    /// Cards that are not lost.
    alive: AtomicUsize,
    observer: &'a dyn Observer,
    start: Instant,
    image_bytes: u64,
}

/// What came of one card.
#[derive(Default)]
struct CardOutcome {
    counters: Counters,
    bytes: LinkBytes,
    traffic: Option<MemoryTraffic>,
    loaded: Duration,
}

/// How long a port may wait for a byte.
const WAIT: Duration = Duration::from_millis(20);

impl Cards {
    /// Starts all cards and says hello to each. Their memory is modelled if the settings say so, that of the
    /// first with `trace`.
    pub(super) fn connect(
        settings: &RenderSettings,
        mut trace: Option<TraceFile>,
        picture: &Mutex<Picture>,
        observer: &dyn Observer,
    ) -> Result<Self, RenderError> {
        let start = Instant::now();
        let RenderSettings { cards: addresses, faults, .. } = settings;
        let caches = settings.modelled_caches();
        check_chips(addresses.iter().map(CardAddress::emulated_chips).sum())?;
        let each_card = addresses
            .iter()
            .flat_map(|address| std::iter::repeat_n(address, address.emulated_chips().max(1)));
        let cards: Result<Vec<Connected>, RenderError> = each_card
            .enumerate()
            .map(|(index, address)| {
                let model = caches.map(|caches| MemoryModel { caches, trace: trace.take() });
                greet(OpenCard::open(index, address, model, *faults)?, picture, start, observer)
            })
            .collect();
        Ok(Self { cards: cards?, start })
    }

    /// What each card can hold.
    pub(super) fn budgets(&self) -> impl Iterator<Item = Budget> {
        self.cards.iter().map(|card| card.budget)
    }

    /// Renders a picture on all cards.
    pub(super) fn run(
        self,
        job: Job,
        picture: &Mutex<Picture>,
        observer: &dyn Observer,
    ) -> Result<Outcome, RenderError> {
        let begun = self.start.elapsed();
        let shared = Shared {
            picture,
            failed: AtomicBool::new(false),
            alive: AtomicUsize::new(self.cards.len()),
            observer,
            start: self.start,
            image_bytes: (job.image.len() * LINE_BYTES) as u64,
        };
        let cards = self.cards.len();
        let results: Vec<Result<CardOutcome, RenderError>> = std::thread::scope(|scope| {
            let shared = &shared;
            let threads: Vec<_> = (self.cards.into_iter())
                .map(|card| scope.spawn(move || render_on(card, job, shared)))
                .collect();
            // A panic of a host thread is a panic of the host.
            threads
                .into_iter()
                .map(|thread| thread.join().unwrap_or_else(|p| std::panic::resume_unwind(p)))
                .collect()
        });
        let ended = self.start.elapsed();
        let mut sum = CardOutcome::default();
        let mut stopped = false;
        for result in results {
            match result {
                Ok(outcome) => sum.add(&outcome),
                // The card that failed first made the others stop: its error is the one to tell.
                Err(RenderError::Stopped) => stopped = true,
                Err(error) => return Err(error),
            }
        }
        if stopped {
            return Err(RenderError::Stopped);
        }
        let loaded = sum.loaded.max(begun);
        Ok(Outcome {
            counters: sum.counters,
            bytes: sum.bytes,
            traffic: sum.traffic,
            cards,
            load_seconds: (loaded - begun).as_secs_f64(),
            render_seconds: (ended - loaded).as_secs_f64(),
        })
    }
}

impl CardOutcome {
    fn add(&mut self, other: &Self) {
        self.counters.add(&other.counters);
        self.bytes.add(&other.bytes);
        if let Some(traffic) = &other.traffic {
            self.traffic.get_or_insert(MemoryTraffic::ZERO).add(traffic);
        }
        self.loaded = self.loaded.max(other.loaded);
    }
}

/// The picture; a thread that panicked holding it has left whole pixels.
pub(super) fn lock(picture: &Mutex<Picture>) -> MutexGuard<'_, Picture> {
    picture.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Moves bytes once in each direction, and waits a little if there are none.
fn exchange(
    session: &mut Session,
    port: &mut OpenCard,
    picture: &Mutex<Picture>,
    start: Instant,
) -> Result<(), SessionError> {
    session.prepare(&mut lock(picture));
    let sent = match session.outgoing() {
        [] => 0,
        outgoing => port.write(outgoing, WAIT).map_err(SessionError::Port)?,
    };
    session.sent(sent, start.elapsed());
    let mut buffer = [0; 8192];
    let wait = if session.has_more_to_send() { Duration::ZERO } else { WAIT };
    match port.read(&mut buffer, wait).map_err(SessionError::Port)? {
        0 => session.acknowledge(),
        received => session.receive(&buffer[..received], &mut lock(picture), start.elapsed())?,
    }
    session.tick(start.elapsed())
}

/// Says hello and waits for the answer.
fn greet(
    mut card: OpenCard,
    picture: &Mutex<Picture>,
    start: Instant,
    observer: &dyn Observer,
) -> Result<Connected, RenderError> {
    let mut session = Session::new(session_number(), start.elapsed());
    loop {
        if let Some(&budget) = session.budget() {
            return Ok(Connected { card, session, budget });
        }
        if observer.is_stopped() {
            return Err(RenderError::Stopped);
        }
        exchange(&mut session, &mut card, picture, start).map_err(|source| match source {
            SessionError::Port(PortError::Closed) => RenderError::Refused { card: card.name() },
            source => RenderError::Card { card: card.name(), source },
        })?;
    }
}

/// A number that another process, or an earlier session of this one, has hardly used on the same line.
fn session_number() -> u16 {
    static COUNT: AtomicU16 = AtomicU16::new(0);
    let time = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).map_or(0, |time| time.subsec_nanos());
    hash(time ^ std::process::id()) as u16 ^ COUNT.fetch_add(1, Ordering::Relaxed)
}

impl Shared<'_> {
    /// Whether there is nothing left to do.
    ///
    /// # Errors
    /// If the observer or the failure of a card has stopped the render.
    fn is_complete(&self) -> Result<bool, RenderError> {
        if self.failed.load(Ordering::Relaxed) || self.observer.is_stopped() {
            return Err(RenderError::Stopped);
        }
        let mut picture = lock(self.picture);
        if let Some(partial) = &mut picture.partial {
            partial.check().inspect_err(|_| self.failed.store(true, Ordering::Relaxed))?;
        }
        Ok(picture.scheduler.is_complete())
    }

    /// A card is lost; the others go on with its tiles.
    ///
    /// # Errors
    /// If it was the last, or what it answers is wrong.
    fn lose(&self, card: &OpenCard, error: SessionError) -> Result<(), RenderError> {
        let may_go_on = matches!(error, SessionError::Silent(_) | SessionError::Port(_));
        let was_last = self.alive.fetch_sub(1, Ordering::Relaxed) <= 1;
        if was_last || !may_go_on {
            self.failed.store(true, Ordering::Relaxed);
            return Err(RenderError::Card { card: card.name(), source: error });
        }
        self.observer.lost(&card.name(), &error);
        Ok(())
    }
}

/// Loads the image into a card and renders tiles on it until none is left. A card that is lost is tried again as long as
/// there are others.
fn render_on(connected: Connected, job: Job, shared: &Shared) -> Result<CardOutcome, RenderError> {
    let Connected { mut card, mut session, .. } = connected;
    session.start(job, shared.start.elapsed());
    let mut outcome = CardOutcome::default();
    let mut is_lost = false;
    while !shared.is_complete()? && !card.trace_has_failed() {
        let result = exchange(&mut session, &mut card, shared.picture, shared.start);
        match result {
            Ok(()) if is_lost && session.is_loaded() => {
                is_lost = false;
                shared.alive.fetch_add(1, Ordering::Relaxed);
            }
            Ok(()) => {}
            Err(error) => {
                session.reset(&mut lock(shared.picture), shared.start.elapsed());
                let is_closed = matches!(error, SessionError::Port(_));
                if !is_lost {
                    shared.lose(&card, error)?;
                    is_lost = true;
                }
                if is_closed && !reopen(&mut card, shared)? {
                    break;
                }
            }
        }
        tell_progress(&session, &mut outcome, shared);
    }
    outcome.counters = *session.counters();
    outcome.bytes = session.link_bytes();
    if let Some(record) = card.finish() {
        outcome.traffic = Some(record.traffic);
        record.trace.map_or(Ok(()), TraceFile::finish)?;
    }
    Ok(outcome)
}

/// How long a lost card is left alone.
const RETRY: Duration = Duration::from_millis(500);

/// Tries to reach a card again until it is there. Returns whether there is any sense in that.
fn reopen(card: &mut OpenCard, shared: &Shared) -> Result<bool, RenderError> {
    loop {
        if shared.is_complete()? {
            return Ok(true);
        }
        // Before the first try as well: what closes each link at once is not to be asked without a pause.
        std::thread::sleep(RETRY);
        match card.reopen() {
            None => return Ok(false),
            Some(true) => return Ok(true),
            Some(false) => {}
        }
    }
}

fn tell_progress(session: &Session, outcome: &mut CardOutcome, shared: &Shared) {
    if session.is_loaded() {
        if outcome.loaded.is_zero() {
            outcome.loaded = shared.start.elapsed();
        }
        let (done, total) = lock(shared.picture).scheduler.progress();
        shared.observer.progress(Phase::Tiles, done as u64, total as u64);
    } else if outcome.loaded.is_zero() {
        let loaded = session.loaded_lines() as u64 * LINE_BYTES as u64;
        shared.observer.progress(Phase::Load, loaded, shared.image_bytes);
    }
}
