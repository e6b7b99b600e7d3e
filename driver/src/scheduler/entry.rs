//! A tile, who is at work on it, and what has come of it.

use std::time::Duration;

use photoncard_shared::counters::Counters;
use photoncard_shared::message::Tile;

use super::card::CardNumber;
use super::error::Source;
use crate::sink::FinishedTile;

/// How far a tile is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Progress {
    /// It is still to be rendered, or to be verified.
    Open,
    /// It is found, and on its way to the sinks; its only source, unless two cards agree on it.
    Found(Option<CardNumber>),
    /// The sinks have it.
    Done(Option<CardNumber>),
    /// Cards have crashed at it too often.
    Abandoned,
}

/// A tile at a card.
#[derive(Debug)]
pub(super) struct Copy {
    pub(super) card: CardNumber,
    /// When the card can have begun with it.
    pub(super) since: Duration,
}

/// A tile that waits to be compared.
#[derive(Debug)]
pub(super) struct Answer {
    pub(super) source: Source,
    pub(super) tile: FinishedTile,
}

impl Answer {
    /// Whether two cards have rendered the same, bit for bit.
    fn agrees_with(&self, other: &Self) -> bool {
        let is_kept = [self, other].iter().any(|answer| answer.source == Source::Kept);
        let work = |answer: &Self| {
            // How gathers wait is up to the room that a chip has.
            Counters { drains: 0, most_waiting: 0, ..answer.tile.counters }
        };
        self.tile.records() == other.tile.records() && (is_kept || work(self) == work(other))
    }
}

/// A tile, who is at work on it, and what has come of it.
#[derive(Debug)]
pub(super) struct Entry {
    pub(super) tile: Tile,
    pub(super) progress: Progress,
    /// Whether two cards must agree on it.
    pub(super) is_verified: bool,
    pub(super) copies: Vec<Copy>,
    pub(super) answers: Vec<Answer>,
    /// The cards that were reset or lost at work on it, one as often as it was.
    pub(super) crashes: Vec<CardNumber>,
}

impl Entry {
    pub(super) fn new(tile: Tile) -> Self {
        let (copies, answers, crashes) = (Vec::new(), Vec::new(), Vec::new());
        Self { tile, progress: Progress::Open, is_verified: false, copies, answers, crashes }
    }

    pub(super) fn is_open(&self) -> bool {
        self.progress == Progress::Open
    }

    /// Whether a card has a part in it already.
    pub(super) fn concerns(&self, card: CardNumber) -> bool {
        self.copies.iter().any(|copy| copy.card == card) || self.has_answer_of(card)
    }

    pub(super) fn has_answer_of(&self, card: CardNumber) -> bool {
        self.answers.iter().any(|answer| answer.source == Source::Card(card))
    }

    pub(super) fn crashes_of(&self, card: CardNumber) -> usize {
        self.crashes.iter().filter(|&&crashed| crashed == card).count()
    }

    /// Indices of two answers that agree.
    pub(super) fn agreeing(&self) -> Option<[usize; 2]> {
        let pairs = (1..self.answers.len()).flat_map(|second| (0..second).map(move |first| [first, second]));
        pairs.into_iter().find(|&[first, second]| self.answers[first].agrees_with(&self.answers[second]))
    }

    /// Whether answers differ, and no two agree.
    pub(super) fn is_disputed(&self) -> bool {
        self.is_open() && self.answers.len() > 1
    }

    /// Takes all answers. Returns what two agree on, whether an earlier render has left that, and the sources of others.
    pub(super) fn judge(&mut self) -> Option<Judgement> {
        let [first, second] = self.agreeing()?;
        let answers = std::mem::take(&mut self.answers);
        let is_other = |answer: &&Answer| !answer.agrees_with(&answers[first]);
        let liars = answers.iter().filter(is_other).map(|answer| answer.source).collect();
        let was_kept = [first, second].iter().any(|&index| answers[index].source == Source::Kept);
        let tile = answers.into_iter().nth(first)?.tile;
        Some(Judgement { tile, was_kept, liars })
    }
}

/// What is found of a tile that is verified.
pub(super) struct Judgement {
    pub(super) tile: FinishedTile,
    pub(super) was_kept: bool,
    pub(super) liars: Vec<Source>,
}
