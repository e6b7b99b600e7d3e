//! Verification of cards: some tiles are rendered by two cards and compared.

use photoncard_cards::scheduler::{Scheduler, near, spread};
use photoncard_shared::message::Tile;

use super::{RenderError, RenderSettings};

impl RenderSettings {
    /// Checks that tiles can be verified, if requested.
    ///
    /// # Errors
    /// If there are fewer than two cards, the share is not valid, or reads are counted, which would be those
    /// of both cards.
    pub(super) fn check_verification(&self) -> Result<(), RenderError> {
        let Some(share) = self.cards.verify else { return Ok(()) };
        let [reason, remedy] = if !(share > 0.0 && share <= 1.0) {
            ["a share of the tiles is above 0 and at most 1", "give a number such as 0.02"]
        } else if self.schedule.order.is_of_whole_frame() {
            [
                "with `schedule.order` hilbert the host does the gathers, and no card a whole tile",
                "use `schedule.order` sort",
            ]
        } else if self.cards.count() < 2 {
            [
                "a tile is verified by a second card",
                "give two `cards.addresses` or more, or `cards.addresses` emulated:2",
            ]
        } else if self.modelled_caches().is_some() {
            ["reads of memory are counted once for each tile", "leave out `cards.caches`, and `cards.trace`"]
        } else {
            return Ok(());
        };
        let (value, reason, remedy) = (share.to_string(), reason.into(), remedy.into());
        Err(RenderError::Setting { field: "cards.verify", value, reason, remedy })
    }

    /// Minimum number of cards that a render needs.
    pub(super) fn needed_cards(&self) -> usize {
        if self.cards.verify.is_some() { 2 } else { 1 }
    }

    /// Creates the scheduler of the tiles for `cards` cards. With modelled memory no tile is rendered twice,
    /// because all reads count.
    pub(super) fn scheduler(&self, tiles: Vec<Tile>, cards: usize) -> Scheduler {
        // Modelled caches are read in the order of the picture.
        if self.modelled_caches().is_some() {
            return Scheduler::new(tiles, cards);
        }
        let ordered = match self.schedule.focus {
            Some(focus) => near(tiles, focus),
            None => spread(tiles),
        };
        let scheduler = Scheduler::new(ordered, cards).with_helpers();
        match self.cards.verify {
            Some(share) => scheduler.verifying(share, self.integrator.seed),
            None => scheduler,
        }
    }
}
