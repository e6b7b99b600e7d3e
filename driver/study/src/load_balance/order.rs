//! Order in which tiles are dealt.

use photoncard_firmware::sampler::hash;
use photoncard_shared::message::Tile;

/// Order in which tiles are dealt.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TileOrder {
    /// Row by row, as the driver deals.
    #[default]
    Picture,
    /// Random permutation by a seed.
    Random(u32),
    /// Descending cost (Graham 1969). Costs are known only after the render, so this is a bound and no
    /// policy.
    LongestFirst,
}

impl TileOrder {
    /// Tiles of these costs in this order; a tile's number is its index in `costs`.
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

/// Tile number `id`; its rectangle is not used.
pub(super) fn tile(id: u32) -> Tile {
    Tile { id, x: id, y: 0, width: 1, height: 1 }
}
