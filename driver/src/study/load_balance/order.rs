//! The order in which tiles wait to be dealt.

use photoncard_firmware::sampler::hash;
use photoncard_shared::message::Tile;

/// The order in which tiles wait to be dealt.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TileOrder {
    /// As in the picture, row by row: what the driver does.
    #[default]
    Picture,
    /// Shuffled by a seed.
    Random(u32),
    /// The longest first (Graham 1969). It needs the costs before the tiles are rendered, so it is a bound and no policy.
    LongestFirst,
}

impl TileOrder {
    /// Tiles of these costs in this order; a tile's number is its place in the picture.
    pub(super) fn tiles(self, costs: &[u128]) -> Vec<Tile> {
        let mut tiles: Vec<Tile> = (0_u32..).zip(costs).map(|(id, _)| tile(id)).collect();
        match self {
            Self::Picture => {}
            // Numbers of the hash come once each: the number of the tile breaks no tie.
            Self::Random(seed) => tiles.sort_by_key(|tile| (hash(hash(seed) ^ tile.id), tile.id)),
            // The sort is stable: of equal ones the first in the picture is the first.
            Self::LongestFirst => tiles.sort_by_key(|tile| std::cmp::Reverse(costs[tile.id as usize])),
        }
        tiles
    }
}

/// The tile of a number: of its rectangle nothing is used.
pub(super) fn tile(id: u32) -> Tile {
    Tile { id, x: id, y: 0, width: 1, height: 1 }
}
