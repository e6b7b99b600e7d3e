//! Conditions of a run: its cards, and the faults of cards and lines.

use std::collections::HashMap;

use photoncard_driver::scheduler::CardNumber;

use super::liar::Lie;
use super::line::Faults;
use super::world::Fixture;

/// Conditions of a run.
#[derive(Clone)]
pub(crate) struct Run<'a> {
    pub(crate) fixture: &'a Fixture,
    pub(crate) faults: Faults,
    pub(crate) cards: usize,
    /// Number of cards, the first ones, that never act.
    pub(crate) stopped: usize,
    /// Tiles at which every card crashes.
    pub(crate) poison: Vec<u32>,
    /// Lies of cards. The number is `n` if a card falsifies one of `n` tiles.
    pub(crate) liars: HashMap<CardNumber, (Lie, u32)>,
    /// Slowdown of cards: `n` if a card does one of `n` steps of its work on tiles; `None` if it does none.
    pub(crate) lazy: HashMap<CardNumber, Option<usize>>,
    /// Share of the tiles that is verified.
    pub(crate) verify: Option<f64>,
    pub(crate) seed: u32,
}

impl<'a> Run<'a> {
    pub(crate) fn new(fixture: &'a Fixture, cards: usize, seed: u32) -> Self {
        Self {
            fixture,
            faults: Faults::default(),
            cards,
            stopped: 0,
            poison: Vec::new(),
            liars: HashMap::new(),
            lazy: HashMap::new(),
            verify: None,
            seed,
        }
    }
}
