//! Order in which tiles are assigned to chips.

use photoncard_firmware::sampler::hash;
use photoncard_shared::message::Tile;

/// Order in which tiles are assigned to chips.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TileOrder {
    /// Row by row, as the driver assigns them.
    #[default]
    Picture,
    /// Random permutation with this seed.
    Random(u32),
    /// Descending cost (Graham 1969). Costs are only known after the render, so that this is a bound and not
    /// a policy.
    LongestFirst,
}

impl TileOrder {
    /// Tiles with these costs, in this order. A tile's number is its index in `costs`.
    pub(super) fn tiles(self, costs: &[u128]) -> Vec<Tile> {
        let mut tiles: Vec<Tile> = (0_u32..).zip(costs).map(|(id, _)| tile(id)).collect();
        match self {
            Self::Picture => {}
            // The hash is a bijection, so that there are no ties.
            Self::Random(seed) => tiles.sort_by_key(|tile| (hash(hash(seed) ^ tile.id), tile.id)),
            // The sort is stable: tiles of equal cost stay in the picture's order.
            Self::LongestFirst => tiles.sort_by_key(|tile| std::cmp::Reverse(costs[tile.id as usize])),
        }
        tiles
    }
}

/// Tile number `id`. Its rectangle is not used.
pub(super) fn tile(id: u32) -> Tile {
    Tile { id, x: id, y: 0, width: 1, height: 1 }
}
