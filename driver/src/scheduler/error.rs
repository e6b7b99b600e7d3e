//! Why tiles cannot be had, though cards are left.

use std::fmt;

use photoncard_shared::message::Tile;

use super::card::CardNumber;

/// Who has rendered a tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// A card of this render.
    Card(CardNumber),
    /// An earlier render, which has left the tile in its file.
    Kept,
}

impl Source {
    /// The card, if it is one.
    pub(crate) fn card(self) -> Option<CardNumber> {
        match self {
            Self::Card(card) => Some(card),
            Self::Kept => None,
        }
    }
}

/// Why tiles cannot be had, though cards are left.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SchedulerError {
    /// Cards render a tile differently, and none is left to decide.
    #[error("the tile {} is rendered differently by {sources:?}", Rectangle(tile))]
    Disagreement {
        /// The tile.
        tile: Tile,
        /// Who has rendered it.
        sources: Vec<Source>,
    },
    /// Two cards agree on a tile, and the file of an earlier render has another.
    #[error("the tile {} in the file of finished tiles differs from what cards render", Rectangle(tile))]
    KeptDiffers {
        /// The tile.
        tile: Tile,
    },
    /// No second card is left that could render a tile which is to be verified.
    #[error("no second card is left to verify the tile {}", Rectangle(tile))]
    Unverified {
        /// The tile.
        tile: Tile,
    },
    /// All other tiles are done; cards have crashed at these.
    #[error("cards crash at the tiles {}", rectangles(tiles))]
    Unrendered {
        /// The tiles.
        tiles: Vec<Tile>,
    },
}

/// A tile as `--crop` takes it: first column and one past the last, first row and one past the last.
pub(crate) struct Rectangle<'a>(pub(crate) &'a Tile);

impl fmt::Display for Rectangle<'_> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Tile { x, y, width, height, .. } = self.0;
        write!(f, "{x},{},{y},{}", x + width, y + height)
    }
}

/// Some tiles as `--crop` takes them.
pub(crate) fn rectangles(tiles: &[Tile]) -> String {
    let texts: Vec<String> = tiles.iter().map(|tile| Rectangle(tile).to_string()).collect();
    texts.join(" and ")
}
