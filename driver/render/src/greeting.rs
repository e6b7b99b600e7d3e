//! Greeting of a card: the first message of a session, and the reply of the card.

use std::hash::{BuildHasher, RandomState};
use std::time::{Duration, Instant};

use photoncard_cards::session::{BoardInfo, LinkBytes, Session, SessionError};
use photoncard_shared::budget::Budget;
use photoncard_shared::link::{Port, PortError};
use photoncard_shared::message::{MemoryUse, Tile};

use super::hands::{Hands, completed};
use super::open_card::{OpenCard, exchange};
use super::{CardAddress, CardError, Observer, RenderError, Unobserved};
use crate::emulator::SharedImage;

/// A card that answered the greeting.
pub(super) struct GreetedCard {
    pub(super) card: OpenCard,
    pub(super) session: Session,
    pub(super) budget: Budget,
    /// Bytes transferred over the link that the statistics of earlier renders include.
    pub(super) counted: LinkBytes,
    /// Tiles of the last picture that this card, and no other, rendered.
    pub(super) tiles: Vec<Tile>,
}

impl GreetedCard {
    /// Bytes transferred over the link since the last call.
    pub(super) fn count_bytes(&mut self) -> LinkBytes {
        let all = self.session.link_bytes();
        let earlier = std::mem::replace(&mut self.counted, all);
        all.since(&earlier)
    }
}

/// Error of a greeting, or of the self-test after it.
pub(super) enum GreetingError {
    /// Error of the card.
    Card(CardError),
    /// The observer stopped the work.
    Stopped,
}

impl GreetingError {
    /// Converts to an error of a render, which names the card `card`.
    pub(super) fn of_card(self, card: String) -> RenderError {
        match self {
            Self::Card(source) => RenderError::Card { card, source },
            Self::Stopped => RenderError::Stopped,
        }
    }
}

impl From<CardError> for GreetingError {
    fn from(error: CardError) -> Self {
        Self::Card(error)
    }
}

/// Information that a card reports about itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CardInfo {
    /// Name and version of the firmware.
    pub build: String,
    /// Capacities and limits of the chip.
    pub budget: Budget,
    /// On-chip memory that the firmware uses; `None` if the card does not measure it.
    pub memory_use: Option<MemoryUse>,
    /// Board that the firmware runs on; `None` if the card is no board.
    pub board: Option<BoardInfo>,
}

/// Greets the first card at an address.
///
/// # Errors
/// If the card cannot be started or reached, or its reply is invalid.
pub fn card_info(address: &CardAddress) -> Result<CardInfo, RenderError> {
    let GreetedCard { session, budget, .. } = greet_alone(address, open(address)?, Instant::now())?;
    Ok(CardInfo {
        build: session.build().to_owned(),
        budget,
        memory_use: session.memory_use(),
        board: session.board().cloned(),
    })
}

/// Greets the first card at an address `count` times. Returns the time until each reply.
///
/// # Errors
/// If the card cannot be started or reached, or its reply is invalid.
pub fn card_ping(address: &CardAddress, count: usize) -> Result<Vec<Duration>, RenderError> {
    let mut card = open(address)?;
    let mut answers = Vec::with_capacity(count);
    for _ in 0..count {
        let start = Instant::now();
        card = greet_alone(address, card, start)?.card;
        answers.push(start.elapsed());
    }
    Ok(answers)
}

/// Starts the first emulated card at an address, or connects to the remote card there.
pub(super) fn open(address: &CardAddress) -> Result<OpenCard, RenderError> {
    let card = OpenCard::open(0, address, &Hands::Threads, None, &SharedImage::default(), None);
    card.map_err(|source| RenderError::Card { card: address.name_of(0), source })
}

pub(super) fn greet_alone(
    address: &CardAddress,
    card: OpenCard,
    start: Instant,
) -> Result<GreetedCard, RenderError> {
    let greeted = completed(greet(card, &Hands::Threads, start, &Unobserved));
    greeted.map_err(|error| error.of_card(address.name_of(0)))
}

/// Time for which a card that closes its link before the reply is greeted again. A board that serves one host
/// refuses the next until it has noticed that the last one is gone.
const TURN: Duration = Duration::from_secs(2);

/// Pause before such a card is reached again.
const PAUSE: Duration = Duration::from_millis(100);

/// Sends the greeting and waits for the reply. A remote card that closes the link is reached again for
/// [`TURN`].
pub(super) async fn greet(
    mut card: OpenCard,
    hands: &Hands,
    start: Instant,
    observer: &dyn Observer,
) -> Result<GreetedCard, GreetingError> {
    let end = Instant::now() + TURN;
    let (session, budget) = loop {
        match greet_port(&mut card, hands, start, observer).await {
            // The link of a card in this process is closed for good.
            Err(GreetingError::Card(CardError::Refused)) if !card.is_emulated() && Instant::now() < end => {
                std::thread::sleep(PAUSE);
                if !card.reach_again() {
                    return Err(CardError::Refused.into());
                }
            }
            greeted => break greeted?,
        }
    };
    Ok(GreetedCard { card, session, budget, counted: LinkBytes::default(), tiles: Vec::new() })
}

/// Greets the card at the other end of a port, as [`greet`] does.
pub(super) async fn greet_port(
    port: &mut impl Port,
    hands: &Hands,
    start: Instant,
    observer: &dyn Observer,
) -> Result<(Session, Budget), GreetingError> {
    let mut session = Session::new(session_number(), start.elapsed());
    loop {
        if let Some(&budget) = session.budget() {
            return Ok((session, budget));
        }
        if observer.is_stopped() {
            return Err(GreetingError::Stopped);
        }
        exchange(&mut session, port, None, start).map_err(|error| match error {
            SessionError::Port(PortError::Closed) => CardError::Refused,
            error => CardError::Session(error),
        })?;
        hands.pass().await;
    }
}

/// Random number that identifies a session, because frames of earlier sessions may still arrive. Two numbers
/// are equal with probability 2^-32.
pub(super) fn session_number() -> u32 {
    // The standard library's hashers have random keys.
    RandomState::new().hash_one(()) as u32
}
