//! State of a tile: its copies on cards, and their answers.

use std::time::Duration;

use photoncard_picture::sink::FinishedTile;
use photoncard_shared::counters::Counters;
use photoncard_shared::message::Tile;

use super::card::CardNumber;
use super::error::Source;

/// Progress of a tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Progress {
    /// Not rendered, or not verified yet.
    Open,
    /// The tile is rendered and in transit to the sinks. The value is the card whose answer was accepted;
    /// `None` if two cards agree on the tile.
    Found(Option<CardNumber>),
    /// All sinks have the tile. The value is the card whose answer was accepted; `None` if two cards agree on
    /// the tile, or an earlier render completed it.
    Done(Option<CardNumber>),
    /// Given up after five crashes.
    Abandoned,
}

/// Assignment of a tile to a card that has not answered yet.
#[derive(Debug)]
pub(super) struct Copy {
    pub(super) card: CardNumber,
    /// Earliest time at which the card can have started the tile.
    pub(super) since: Duration,
}

/// Rendered tile, of a card or a partial file, that awaits comparison with another answer.
#[derive(Debug)]
pub(super) struct Answer {
    pub(super) source: Source,
    pub(super) tile: FinishedTile,
}

impl Answer {
    /// Returns whether two answers have equal pixels and, if both are of cards that did all of the work,
    /// equal counters. A card that reads irradiance records back, which it has kept, works less than another.
    fn agrees_with(&self, other: &Self) -> bool {
        let is_kept = [self, other]
            .iter()
            .any(|answer| answer.source == Source::Kept || answer.tile.counters.kept_records > 0);
        let work = |answer: &Self| {
            // These counters depend on the chip: the capacity of its queue, and its processor.
            Counters { drains: 0, most_waiting: 0, cycles: 0, ..answer.tile.counters }
        };
        self.tile.records() == other.tile.records() && (is_kept || work(self) == work(other))
    }
}

#[derive(Debug)]
pub(super) struct Entry {
    pub(super) tile: Tile,
    pub(super) progress: Progress,
    /// True if two cards must agree on the tile.
    pub(super) is_verified: bool,
    /// True if the first answer is dazzling (implausibly bright), so that another card renders the tile as
    /// well.
    pub(super) is_doubted: bool,
    /// True if the accepted tile is dazzling, and no other card was available to confirm it.
    pub(super) is_dazzling: bool,
    pub(super) copies: Vec<Copy>,
    pub(super) answers: Vec<Answer>,
    /// Cards that were reset or lost while they rendered the tile, once per crash.
    pub(super) crashes: Vec<CardNumber>,
}

impl Entry {
    pub(super) fn new(tile: Tile) -> Self {
        let (copies, answers, crashes) = (Vec::new(), Vec::new(), Vec::new());
        let progress = Progress::Open;
        let (is_verified, is_doubted, is_dazzling) = (false, false, false);
        Self { tile, progress, is_verified, is_doubted, is_dazzling, copies, answers, crashes }
    }

    pub(super) fn is_open(&self) -> bool {
        self.progress == Progress::Open
    }

    /// Returns whether `card` has a copy of the tile or has answered.
    pub(super) fn concerns(&self, card: CardNumber) -> bool {
        self.copies.iter().any(|copy| copy.card == card) || self.has_answer_of(card)
    }

    /// Returns whether the tile is dazzling and accepted from this card without confirmation.
    pub(super) fn is_dazzling_of(&self, card: CardNumber) -> bool {
        let is_its = [Progress::Found(Some(card)), Progress::Done(Some(card))].contains(&self.progress);
        is_its && self.is_dazzling
    }

    pub(super) fn has_answer_of(&self, card: CardNumber) -> bool {
        self.answers.iter().any(|answer| answer.source == Source::Card(card))
    }

    /// Returns the earliest time at which `card` can have started its copy; `None` if it has no copy.
    pub(super) fn since(&self, card: CardNumber) -> Option<Duration> {
        self.copies.iter().find(|copy| copy.card == card).map(|copy| copy.since)
    }

    pub(super) fn crashes_of(&self, card: CardNumber) -> usize {
        self.crashes.iter().filter(|&&crashed| crashed == card).count()
    }

    /// Indices of two answers that agree.
    pub(super) fn agreeing(&self) -> Option<[usize; 2]> {
        let pairs = (1..self.answers.len()).flat_map(|second| (0..second).map(move |first| [first, second]));
        pairs.into_iter().find(|&[first, second]| self.answers[first].agrees_with(&self.answers[second]))
    }

    /// Returns whether the tile is open and has several answers. They differ pairwise: once two agree, the
    /// tile is accepted.
    pub(super) fn is_disputed(&self) -> bool {
        self.is_open() && self.answers.len() > 1
    }

    /// Accepts one of the answers if two agree, or if exactly one of two is dazzling, and removes all
    /// answers. Otherwise returns `None`.
    pub(super) fn judge(&mut self) -> Option<Judgement> {
        let Some([first, second]) = self.agreeing() else { return self.judge_by_light() };
        let answers = std::mem::take(&mut self.answers);
        let is_other = |answer: &&Answer| !answer.agrees_with(&answers[first]);
        let liars = answers.iter().filter(is_other).map(|answer| answer.source).collect();
        let was_kept = [first, second].iter().any(|&index| answers[index].source == Source::Kept);
        let tile = answers.into_iter().nth(first)?.tile;
        let agreed = if was_kept { Agreement::WithKept } else { Agreement::OfCards };
        Some(Judgement { tile, agreed, liars })
    }

    /// Decides between the answers of two cards if exactly one of them is dazzling, in favour of the other.
    fn judge_by_light(&mut self) -> Option<Judgement> {
        let [a, b] = &self.answers[..] else { return None };
        let (believed, liar) = match [a, b].map(|answer| answer.tile.is_dazzling()) {
            [false, true] => (0, b.source),
            [true, false] => (1, a.source),
            _ => return None,
        };
        let agreed = Agreement::ByLight(self.answers[believed].source.card()?);
        let tile = std::mem::take(&mut self.answers).swap_remove(believed).tile;
        Some(Judgement { tile, agreed, liars: vec![liar] })
    }
}

/// Decision on a tile with several answers: the accepted tile, the reason, and the sources of the answers
/// that differ from it.
pub(super) struct Judgement {
    pub(super) tile: FinishedTile,
    pub(super) agreed: Agreement,
    pub(super) liars: Vec<Source>,
}

/// Reason why a tile is accepted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Agreement {
    /// Two cards agree.
    OfCards,
    /// A card agrees with the partial file, which contains the tile already.
    WithKept,
    /// The answer of this card is not dazzling, and the only other answer is.
    ByLight(CardNumber),
}
