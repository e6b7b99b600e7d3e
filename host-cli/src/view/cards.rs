//! States of the cards, as pages show them.

use std::time::Duration;

use photoncard_driver::link::{LentCard, RemoteAddress};
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
    /// A lent card has gone; its place is free.
    Gone,
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

impl Card {
    fn is_lent(&self) -> bool {
        matches!(self.address, Some(CardAddress::Remote(RemoteAddress::Lent(_))))
    }
}

/// Address of a lent card.
pub(super) fn of_lent(card: &LentCard) -> CardAddress {
    CardAddress::Remote(RemoteAddress::Lent(card.clone()))
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

    fn of_address(&mut self, address: &CardAddress) -> Option<&mut Card> {
        self.cards.iter_mut().find(|card| card.address.as_ref() == Some(address))
    }

    /// Adds a lent card that has answered, or takes it back after a loss. It has the place of one that has
    /// gone, if any: the numbers of the others stay.
    pub(super) fn borrow(&mut self, lent: &LentCard) {
        let address = of_lent(lent);
        let card = Card {
            name: lent.to_string(),
            address: Some(address.clone()),
            standing: Standing::Ready,
            tiles: 0,
            error: None,
            try_at: Duration::ZERO,
            pause: FIRST_PAUSE,
        };
        if let Some(known) = self.of_address(&address) {
            (known.standing, known.error) = (Standing::Ready, None);
        } else if let Some(gone) = self.cards.iter_mut().find(|card| card.standing == Standing::Gone) {
            *gone = card;
        } else {
            self.cards.push(card);
        }
    }

    /// Records that a lent card has gone for good.
    pub(super) fn leave(&mut self, lent: &LentCard) {
        if let Some(card) = self.of_address(&of_lent(lent)) {
            card.standing = Standing::Gone;
        }
    }

    /// Addresses of the lent cards that are ready.
    pub(super) fn lent(&self) -> impl Iterator<Item = CardAddress> {
        let is_ready = |card: &&Card| card.standing == Standing::Ready && card.is_lent();
        self.cards.iter().filter(is_ready).filter_map(|card| card.address.clone())
    }

    /// Tiles that a lent card has rendered; `None` unless it is ready.
    pub(super) fn tiles_of(&self, lent: &LentCard) -> Option<u64> {
        let address = of_lent(lent);
        let card = self.cards.iter().find(|card| card.address.as_ref() == Some(&address))?;
        (card.standing == Standing::Ready).then_some(card.tiles)
    }

    fn of_name(&mut self, name: &str) -> Option<(usize, &mut Card)> {
        self.cards.iter_mut().enumerate().find(|(_, card)| card.name == name)
    }

    /// Counts a tile that a card rendered. Returns the card's index, and whether this tile makes the card
    /// ready. A lent card that has gone stays gone.
    pub(super) fn rendered(&mut self, name: &str) -> (u32, bool) {
        let Some((number, card)) = self.of_name(name) else { return (0, false) };
        card.tiles += 1;
        if card.standing == Standing::Gone {
            return (number as u32, false);
        }
        card.error = None;
        card.pause = FIRST_PAUSE;
        let is_new = std::mem::replace(&mut card.standing, Standing::Ready) != Standing::Ready;
        (number as u32, is_new)
    }

    pub(super) fn lose(&mut self, name: &str, error: String, now: Duration) {
        if let Some((_, card)) = self.of_name(name).filter(|(_, card)| card.standing != Standing::Gone) {
            (card.standing, card.error) = (Standing::Lost, Some(error));
            card.try_at = now + card.pause;
        }
    }

    /// Returns a lost remote card of the command for which an attempt to reconnect is due. Doubles the card's
    /// pause.
    pub(super) fn next_to_try(&mut self, now: Duration) -> Option<CardAddress> {
        let is_due = |card: &Card| {
            card.standing == Standing::Lost && card.address.is_some() && !card.is_lent() && card.try_at <= now
        };
        let card = self.cards.iter_mut().find(|card| is_due(card))?;
        let address = card.address.clone()?;
        card.pause = MAX_PAUSE.min(2 * card.pause);
        card.try_at = now + card.pause;
        Some(address)
    }

    /// Records that a lost card has answered.
    pub(super) fn returns(&mut self, address: &CardAddress) {
        if let Some(card) = self.of_address(address) {
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
                Standing::Gone => "gone",
            };
            json!({"name": card.name, "state": state, "tiles": card.tiles, "error": card.error})
        };
        json!({"type": "cards", "cards": self.cards.iter().map(card).collect::<Vec<_>>()})
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_cards_stay_when_lent_cards_come_and_go() {
        let set = CardSet { addresses: vec!["emulated:2".parse().unwrap()], ..CardSet::default() };
        let mut board = CardBoard::new(&set);
        let [(a, _a), (b, _b), (c, _c)] = ["a", "b", "c"].map(LentCard::lend);
        board.borrow(&a);
        board.borrow(&b);
        assert_eq!((board.rendered("a"), board.rendered("b")), ((2, false), (3, false)));
        board.leave(&a);
        // Late events of the last pass do not bring it back.
        board.lose("a", "the link has ended".into(), Duration::ZERO);
        assert_eq!(
            (board.rendered("a"), board.describe()["cards"][2]["state"].as_str()),
            ((2, false), Some("gone"))
        );
        assert_eq!((board.rendered("b").0, board.tiles_of(&b), board.tiles_of(&a)), (3, Some(2), None));
        board.borrow(&c);
        assert_eq!(board.rendered("c").0, 2);
        assert!(board.lent().eq([of_lent(&c), of_lent(&b)]));

        // A lost card is left out until it has answered. Its own connection looks for it.
        board.lose("b", "it is silent".into(), Duration::ZERO);
        assert!(board.lent().eq([of_lent(&c)]));
        assert_eq!(board.next_to_try(Duration::from_secs(100)), None);
        board.borrow(&b);
        assert_eq!((board.lent().count(), board.tiles_of(&b)), (2, Some(2)));
    }
}
