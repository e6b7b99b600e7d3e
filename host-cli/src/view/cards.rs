//! States of the cards, as pages show them.

use std::time::Duration;

use photoncard_driver::render::{CardAddress, CardSet};
use serde_json::{Value, json};

/// Pause before the first attempt to reconnect to a lost card. It doubles with each attempt.
const FIRST_PAUSE: Duration = Duration::from_millis(500);
/// Maximum pause between two attempts to reconnect.
const MAX_PAUSE: Duration = Duration::from_secs(10);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Standing {
    /// No answer or tile of the card has arrived yet.
    Absent,
    Ready,
    Lost,
}

struct Card {
    name: String,
    /// Address of a remote card, which can be reconnected; `None` for an emulated card.
    address: Option<CardAddress>,
    standing: Standing,
    tiles: u64,
    error: Option<String>,
    try_at: Duration,
    pause: Duration,
}

/// Cards of a view.
pub(super) struct CardBoard {
    cards: Vec<Card>,
}

impl CardBoard {
    pub(super) fn new(set: &CardSet) -> Self {
        let addresses = set.addresses.iter().flat_map(|address| match address {
            CardAddress::Emulated { chips, .. } => vec![None; (*chips).max(1)],
            CardAddress::Remote(_) => vec![Some(address.clone())],
        });
        let card = |(name, address): (String, Option<CardAddress>)| Card {
            name,
            // An emulated card is a thread of this process: it is always ready.
            standing: if address.is_some() { Standing::Absent } else { Standing::Ready },
            address,
            tiles: 0,
            error: None,
            try_at: Duration::ZERO,
            pause: FIRST_PAUSE,
        };
        Self { cards: set.names().into_iter().zip(addresses).map(card).collect() }
    }

    /// Takes another set of cards. Those that stay keep their states.
    pub(super) fn replace(&mut self, set: &CardSet) {
        let before = std::mem::replace(self, Self::new(set)).cards;
        for card in &mut self.cards {
            let is_same = |other: &Card| match &card.address {
                Some(address) => other.address.as_ref() == Some(address),
                None => other.name == card.name,
            };
            if let Some(other) = before.iter().find(|other| is_same(other)) {
                let Card { standing, tiles, try_at, pause, .. } = *other;
                let error = other.error.clone();
                (card.standing, card.tiles, card.error) = (standing, tiles, error);
                (card.try_at, card.pause) = (try_at, pause);
            }
        }
    }

    fn of_name(&mut self, name: &str) -> Option<(usize, &mut Card)> {
        self.cards.iter_mut().enumerate().find(|(_, card)| card.name == name)
    }

    /// Counts a tile that a card rendered. Returns the card's index, and whether this tile makes the card
    /// ready.
    pub(super) fn rendered(&mut self, name: &str) -> (u32, bool) {
        let Some((number, card)) = self.of_name(name) else { return (0, false) };
        card.tiles += 1;
        card.error = None;
        card.pause = FIRST_PAUSE;
        let is_new = std::mem::replace(&mut card.standing, Standing::Ready) != Standing::Ready;
        (number as u32, is_new)
    }

    pub(super) fn lose(&mut self, name: &str, error: String, now: Duration) {
        if let Some((_, card)) = self.of_name(name) {
            (card.standing, card.error) = (Standing::Lost, Some(error));
            card.try_at = now + card.pause;
        }
    }

    /// Returns a lost remote card, with its index, for which an attempt to reconnect is due. Doubles the
    /// card's pause.
    pub(super) fn next_to_try(&mut self, now: Duration) -> Option<(usize, CardAddress)> {
        let is_due =
            |card: &Card| card.standing == Standing::Lost && card.address.is_some() && card.try_at <= now;
        let (number, card) = self.cards.iter_mut().enumerate().find(|(_, card)| is_due(card))?;
        let address = card.address.clone()?;
        card.pause = MAX_PAUSE.min(2 * card.pause);
        card.try_at = now + card.pause;
        Some((number, address))
    }

    /// Records that a lost card has answered.
    pub(super) fn returns(&mut self, number: usize) {
        if let Some(card) = self.cards.get_mut(number) {
            (card.standing, card.error) = (Standing::Ready, None);
        }
    }

    /// States of the cards as a message to pages.
    pub(super) fn describe(&self) -> Value {
        let card = |card: &Card| {
            let state = match card.standing {
                Standing::Absent => "absent",
                Standing::Ready => "ready",
                Standing::Lost => "lost",
            };
            json!({"name": card.name, "state": state, "tiles": card.tiles, "error": card.error})
        };
        json!({"type": "cards", "cards": self.cards.iter().map(card).collect::<Vec<_>>()})
    }
}
