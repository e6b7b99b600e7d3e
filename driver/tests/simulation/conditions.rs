//! The conditions of a run: its cards, and what befalls them and their lines.

use std::collections::HashMap;

use photoncard_driver::scheduler::CardNumber;

use crate::liar::Lie;
use crate::line::Faults;
use crate::world::Fixture;

/// A run.
#[derive(Clone)]
pub(crate) struct Run<'a> {
    pub(crate) fixture: &'a Fixture,
    pub(crate) faults: Faults,
    pub(crate) cards: usize,
    /// Cards, the first ones, that never do anything.
    pub(crate) stopped: usize,
    /// The tiles at which every card crashes.
    pub(crate) poison: Vec<u32>,
    /// What cards lie, and about one of how many tiles.
    pub(crate) liars: HashMap<CardNumber, (Lie, u32)>,
    /// Of how many steps of its work at tiles a card does one; `None` if it does none.
    pub(crate) lazy: HashMap<CardNumber, Option<usize>>,
    /// The share of the tiles that is verified.
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
