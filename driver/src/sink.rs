//! Finished tiles, and the trait of their destinations: film, partial file, display server.

use photoncard_shared::counters::Counters;
use photoncard_shared::message::{PixelRecord, Tile, record_bytes};

/// Tile with all its pixels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FinishedTile {
    tile: Tile,
    /// [`PixelRecord`]s in the format of the wire, row by row: equal bytes are equal pixels, bit for bit.
    records: Vec<u8>,
    has_layers: bool,
    /// Work counters of the chip.
    pub counters: Counters,
}

impl FinishedTile {
    /// Tile from encoded records; `None` unless there is one for each pixel.
    pub fn new(tile: Tile, records: Vec<u8>, has_layers: bool, counters: Counters) -> Option<Self> {
        let bytes = tile.pixels().checked_mul(record_bytes(has_layers) as u64)?;
        (records.len() as u64 == bytes).then_some(Self { tile, records, has_layers, counters })
    }

    /// Tile from pixels, row by row, with zero counters; `None` unless there is one for each pixel. Missing layers of a
    /// pixel are zero.
    pub fn of_pixels(
        tile: Tile,
        pixels: impl IntoIterator<Item = PixelRecord>,
        has_layers: bool,
    ) -> Option<Self> {
        let mut records = Vec::new();
        for PixelRecord { pixel, layers } in pixels {
            records.extend(pixel.to_bytes());
            if has_layers {
                records.extend(layers.unwrap_or_default().to_bytes());
            }
        }
        Self::new(tile, records, has_layers, Counters::ZERO)
    }

    /// Rectangle of the tile in the picture.
    pub fn tile(&self) -> &Tile {
        &self.tile
    }

    /// Encoded records of the pixels, row by row.
    pub fn records(&self) -> &[u8] {
        &self.records
    }

    /// Column, row and record of each pixel.
    pub fn pixels(&self) -> impl Iterator<Item = ((u32, u32), PixelRecord)> {
        let records = self.records.chunks_exact(record_bytes(self.has_layers));
        pixel_positions(&self.tile).zip(records.map(|record| PixelRecord::read(record).unwrap_or_default()))
    }
}

/// Column and row of each pixel of a tile, row by row.
pub fn pixel_positions(tile: &Tile) -> impl Iterator<Item = (u32, u32)> + use<> {
    let Tile { x, y, width, height, .. } = *tile;
    (y..y + height).flat_map(move |row| (x..x + width).map(move |column| (column, row)))
}

/// Destination of finished tiles, called from any thread. A sink reports errors to its owner, not to the card's thread.
pub trait TileSink: Sync {
    /// Stores a finished tile.
    fn put(&self, tile: &FinishedTile);

    /// Revokes a stored tile, whose card sent wrong pixels. The tile is stored again once another card has rendered it,
    /// unless the render ends before.
    fn revoke(&self, tile: &Tile);
}
