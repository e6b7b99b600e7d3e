//! The cards of a render: each has a thread of the host that moves bytes between its port and its session.

use std::str::FromStr;
use std::sync::atomic::{AtomicBool, AtomicU16, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime};

use photoncard_firmware::sampler::hash;
use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::budget::Budget;
use photoncard_shared::counters::Counters;
use photoncard_shared::link::Port;

use super::{Observer, Phase, RenderError};
use crate::emulator::memory_model::{CacheSettings, MemoryTraffic};
use crate::emulator::trace::TraceFile;
use crate::emulator::{ChipKind, EmulatedCard, MemoryModel};
use crate::session::{Job, LinkBytes, Picture, Session, SessionError};

/// Where cards are: an argument of `--card`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CardAddress {
    /// Chips in this process.
    Emulated {
        /// Their kind.
        kind: ChipKind,
        /// How many.
        chips: usize,
    },
}

impl Default for CardAddress {
    /// One emulated reference chip.
    fn default() -> Self {
        Self::Emulated { kind: ChipKind::Reference, chips: 1 }
    }
}

/// Chips that one process emulates.
const MAX_CHIPS: usize = 1024;

impl FromStr for CardAddress {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (kind, chips) = text.split_once(':').map_or((text, None), |(kind, chips)| (kind, Some(chips)));
        let kind = match kind {
            "emulated" => ChipKind::Reference,
            "emulated-micro" => ChipKind::Micro,
            "serial" | "tcp" | "unix" => {
                return Err(format!("cards on {kind} links cannot be used yet; use emulated[:CHIPS]"));
            }
            _ => {
                return Err(format!(
                    "{kind:?} is no kind of card; use emulated[:CHIPS] or emulated-micro[:CHIPS]"
                ));
            }
        };
        let chips = match chips {
            None => std::thread::available_parallelism().map_or(1, usize::from),
            Some(chips) => chips
                .parse()
                .ok()
                .filter(|count| (1..=MAX_CHIPS).contains(count))
                .ok_or_else(|| format!("{chips:?} is no number of chips; use 1 to {MAX_CHIPS}"))?,
        };
        Ok(Self::Emulated { kind, chips })
    }
}

/// The number of emulated reference chips at some addresses.
///
/// # Errors
/// If there is any other card among them.
pub(super) fn reference_chips(addresses: &[CardAddress]) -> Result<usize, RenderError> {
    let counts = addresses.iter().map(|address| match *address {
        CardAddress::Emulated { kind: ChipKind::Reference, chips } => Some(chips),
        CardAddress::Emulated { kind: ChipKind::Micro, .. } => None,
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

/// Cards that have said hello.
pub(super) struct Cards {
    cards: Vec<Connected>,
    start: Instant,
}

struct Connected {
    card: EmulatedCard,
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
}

/// Says hello to the first card at an address.
///
/// # Errors
/// If it cannot be started, or does not answer as it should.
pub fn card_info(address: CardAddress) -> Result<CardInfo, RenderError> {
    let CardAddress::Emulated { kind, .. } = address;
    let nothing = Mutex::new(Picture::empty()?);
    let cards = Cards::connect(&[CardAddress::Emulated { kind, chips: 1 }], None, None, &nothing)?;
    let connected = &cards.cards[0];
    Ok(CardInfo { build: connected.session.build().to_owned(), budget: connected.budget })
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
    /// Starts all cards and says hello to each. With `caches` their memory is modelled, that of the first with `trace`.
    pub(super) fn connect(
        addresses: &[CardAddress],
        caches: Option<CacheSettings>,
        mut trace: Option<TraceFile>,
        picture: &Mutex<Picture>,
    ) -> Result<Self, RenderError> {
        let start = Instant::now();
        let kinds =
            addresses.iter().flat_map(|&CardAddress::Emulated { kind, chips }| (0..chips).map(move |_| kind));
        check_chips(kinds.clone().count())?;
        let cards: Result<Vec<Connected>, RenderError> = kinds
            .enumerate()
            .map(|(index, kind)| {
                let model = caches.map(|caches| MemoryModel { caches, trace: trace.take() });
                let card = EmulatedCard::start(kind, model)
                    .map_err(|source| RenderError::Start { card: index, source })?;
                greet(card, picture, start).map_err(|source| RenderError::Card { card: index, source })
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
            observer,
            start: self.start,
            image_bytes: (job.image.len() * LINE_BYTES) as u64,
        };
        let cards = self.cards.len();
        let results: Vec<Result<CardOutcome, RenderError>> = std::thread::scope(|scope| {
            let shared = &shared;
            let threads: Vec<_> = (self.cards.into_iter().enumerate())
                .map(|(index, card)| scope.spawn(move || render_on(index, card, job, shared)))
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
    port: &mut impl Port,
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
        0 => session.tick(start.elapsed()),
        received => session.receive(&buffer[..received], &mut lock(picture), start.elapsed()),
    }
}

/// Says hello and waits for the answer.
fn greet(
    mut card: EmulatedCard,
    picture: &Mutex<Picture>,
    start: Instant,
) -> Result<Connected, SessionError> {
    let mut session = Session::new(session_number(), start.elapsed());
    loop {
        if let Some(&budget) = session.budget() {
            return Ok(Connected { card, session, budget });
        }
        exchange(&mut session, card.port(), picture, start)?;
    }
}

/// A number that another process, or an earlier session of this one, has hardly used on the same line.
fn session_number() -> u16 {
    static COUNT: AtomicU16 = AtomicU16::new(0);
    let time = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).map_or(0, |time| time.subsec_nanos());
    hash(time ^ std::process::id()) as u16 ^ COUNT.fetch_add(1, Ordering::Relaxed)
}

/// Loads the image into a card and renders tiles on it until none is left.
fn render_on(
    index: usize,
    connected: Connected,
    job: Job,
    shared: &Shared,
) -> Result<CardOutcome, RenderError> {
    let Connected { mut card, mut session, .. } = connected;
    session.start(job, shared.start.elapsed());
    let mut outcome = CardOutcome::default();
    while !lock(shared.picture).scheduler.is_complete() && !card.trace_has_failed() {
        if shared.failed.load(Ordering::Relaxed) || shared.observer.is_stopped() {
            return Err(RenderError::Stopped);
        }
        exchange(&mut session, card.port(), shared.picture, shared.start).map_err(|source| {
            shared.failed.store(true, Ordering::Relaxed);
            RenderError::Card { card: index, source }
        })?;
        if session.is_loaded() {
            if outcome.loaded.is_zero() {
                outcome.loaded = shared.start.elapsed();
            }
            let (done, total) = lock(shared.picture).scheduler.progress();
            shared.observer.progress(Phase::Tiles, done as u64, total as u64);
        } else {
            let loaded = session.loaded_lines() as u64 * LINE_BYTES as u64;
            shared.observer.progress(Phase::Load, loaded, shared.image_bytes);
        }
    }
    outcome.counters = *session.counters();
    outcome.bytes = session.link_bytes();
    if let Some(record) = card.finish() {
        outcome.traffic = Some(record.traffic);
        record.trace.map_or(Ok(()), TraceFile::finish)?;
    }
    Ok(outcome)
}
