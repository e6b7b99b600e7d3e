//! Errors of the scheduler.

use std::fmt;

use photoncard_shared::message::Tile;

use super::card::CardNumber;

/// Source of a rendered tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// Card of this render.
    Card(CardNumber),
    /// Partial file of an earlier render.
    Kept,
}

impl Source {
    /// The card; `None` for a partial file.
    pub(crate) fn card(self) -> Option<CardNumber> {
        match self {
            Self::Card(card) => Some(card),
            Self::Kept => None,
        }
    }
}

/// Error that ends a render although cards are left.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SchedulerError {
    /// Error of a tile that cards render differently, with no card left to decide.
    #[error("the tile {} is rendered differently by {sources:?}", Rectangle(tile))]
    Disagreement {
        /// The disputed tile.
        tile: Tile,
        /// Cards or partial file that rendered the disputed tile.
        sources: Vec<Source>,
    },
    /// Error of a tile in a partial file that differs from the one on which two cards agree.
    #[error("the tile {} in the file of finished tiles differs from what cards render", Rectangle(tile))]
    KeptDiffers {
        /// The disputed tile.
        tile: Tile,
    },
    /// Error of a tile that requires verification when there is no second card.
    #[error("no second card is left to verify the tile {}", Rectangle(tile))]
    Unverified {
        /// The unverified tile.
        tile: Tile,
    },
    /// Error of tiles at which cards have crashed. All other tiles are done.
    #[error("cards crash at the tiles {}", rectangles(tiles))]
    Unrendered {
        /// The tiles that are left.
        tiles: Vec<Tile>,
    },
}

/// Formats a tile as an argument of `--crop`: first column, end column, first row, end row; ends are
/// exclusive.
pub(crate) struct Rectangle<'a>(pub(crate) &'a Tile);

impl fmt::Display for Rectangle<'_> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Tile { x, y, width, height, .. } = self.0;
        write!(f, "{x},{},{y},{}", x + width, y + height)
    }
}

/// Formats tiles as arguments of `--crop`.
pub fn rectangles(tiles: &[Tile]) -> String {
    let texts: Vec<String> = tiles.iter().map(|tile| Rectangle(tile).to_string()).collect();
    texts.join(" and ")
}
