//! The conditions of a run: cards, faults, and the seed of everything else.

use photoncard_driver::session::Picture;

use crate::line::Faults;
use crate::world::Fixture;

/// A run.
pub(crate) struct Run<'a> {
    pub(crate) fixture: &'a Fixture,
    pub(crate) faults: Faults,
    pub(crate) cards: usize,
    /// Cards, the first ones, that never do anything.
    pub(crate) stopped: usize,
    /// The tiles, the last ones to be rendered, at which every card crashes.
    pub(crate) crashes: usize,
    pub(crate) seed: u32,
}

impl<'a> Run<'a> {
    pub(crate) fn new(fixture: &'a Fixture, cards: usize, seed: u32) -> Self {
        Self { fixture, faults: Faults::default(), cards, stopped: 0, crashes: 0, seed }
    }

    /// Whether cards crash at the tiles that are left of a picture.
    pub(crate) fn is_crash(&self, picture: &Picture) -> bool {
        let (done, all) = picture.scheduler().progress();
        all - done <= self.crashes
    }
}
