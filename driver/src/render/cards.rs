//! The cards of a render: reached, greeted, and put to work together.

use std::hash::{BuildHasher, RandomState};
use std::sync::Arc;
use std::time::{Duration, Instant};

use photoncard_shared::budget::Budget;
use photoncard_shared::counters::Counters;
use photoncard_shared::link::{Port, PortError};
use photoncard_shared::message::MemoryUse;

use super::address::{CardAddress, MAX_CHIPS};
use super::card_thread::{self, CardOutcome, Shared};
use super::open_card::OpenCard;
use super::{Observer, RenderError, RenderSettings, Unobserved};
use crate::emulator::memory_model::MemoryTraffic;
use crate::emulator::trace::TraceFile;
use crate::emulator::{ChipKind, MemoryModel, SharedImage};
use crate::pack::CardImage;
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
    shared: SharedImage,
}

pub(super) struct Connected {
    pub(super) card: OpenCard,
    pub(super) session: Session<'static>,
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
    let nothing = Picture::empty()?;
    let card = OpenCard::open(0, address, None, &SharedImage::default(), None)?;
    let connected = greet(card, &nothing, Instant::now(), &Unobserved)?;
    let Connected { session, budget, .. } = connected;
    Ok(CardInfo { build: session.build().to_owned(), budget, memory_use: session.memory_use() })
}

/// Says hello to the first card at an address some times. Returns how long each answer took.
///
/// # Errors
/// If it cannot be started or reached, or does not answer as it should.
pub fn card_ping(address: &CardAddress, count: usize) -> Result<Vec<Duration>, RenderError> {
    let nothing = Picture::empty()?;
    let mut card = OpenCard::open(0, address, None, &SharedImage::default(), None)?;
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

/// How long a port may wait for a byte.
pub(super) const WAIT: Duration = Duration::from_millis(20);

impl Cards {
    /// Starts all cards and says hello to each. Their memory is modelled if the settings say so, that of the
    /// first with `trace`.
    pub(super) fn connect(
        settings: &RenderSettings,
        mut trace: Option<TraceFile>,
        observer: &dyn Observer,
    ) -> Result<Self, RenderError> {
        let start = Instant::now();
        let shared = SharedImage::default();
        let nothing = Picture::empty()?;
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
                greet(OpenCard::open(index, address, model, &shared, *faults)?, &nothing, start, observer)
            })
            .collect();
        Ok(Self { cards: cards?, start, shared })
    }

    /// Tells emulated cards of the image that they will be loaded with, so that they need not copy it.
    pub(super) fn share(&self, image: Arc<CardImage>) {
        self.shared.give(image);
    }

    /// What each card can hold.
    pub(super) fn budgets(&self) -> impl Iterator<Item = Budget> {
        self.cards.iter().map(|card| card.budget)
    }

    /// Renders a picture on all cards.
    pub(super) fn run(
        self,
        job: Job,
        picture: &Picture,
        observer: &dyn Observer,
    ) -> Result<Outcome, RenderError> {
        let begun = self.start.elapsed();
        let cards = self.cards.len();
        let shared = Shared::new(picture, observer, self.start, cards);
        let results: Vec<Result<CardOutcome, RenderError>> = std::thread::scope(|scope| {
            let shared = &shared;
            let threads: Vec<_> = (self.cards.into_iter())
                .map(|card| scope.spawn(move || card_thread::render_on(card, job, shared)))
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

/// Moves bytes once in each direction, and waits a little if there are none.
pub(super) fn exchange(
    session: &mut Session,
    port: &mut OpenCard,
    picture: &Picture,
    start: Instant,
) -> Result<(), SessionError> {
    session.prepare(picture);
    let sent = match session.outgoing() {
        [] => 0,
        outgoing => port.write(outgoing, WAIT).map_err(SessionError::Port)?,
    };
    session.sent(sent, start.elapsed());
    let mut buffer = [0; 8192];
    let wait = if session.has_more_to_send() || session.is_idle() { Duration::ZERO } else { WAIT };
    match port.read(&mut buffer, wait).map_err(SessionError::Port)? {
        0 => session.acknowledge(),
        received => session.receive(&buffer[..received], picture, start.elapsed())?,
    }
    session.tick(picture, start.elapsed())
}

/// Says hello and waits for the answer.
fn greet(
    mut card: OpenCard,
    picture: &Picture,
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

/// A random number: no card or line holds anything of another session of that number, but by a chance of one in 2^32.
fn session_number() -> u32 {
    // The standard library's hashers have random keys.
    RandomState::new().hash_one(std::process::id()) as u32
}
