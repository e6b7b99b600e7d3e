//! Finished tiles, and where they go: the film, the file of finished tiles, the display server.

use photoncard_shared::counters::Counters;
use photoncard_shared::message::{PixelRecord, Tile, record_bytes};

/// A tile with all its pixels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FinishedTile {
    tile: Tile,
    /// [`PixelRecord`]s as the wire carries them, row by row: equal bytes are equal pixels, bit for bit.
    records: Vec<u8>,
    has_layers: bool,
    /// Work that the chip counted.
    pub counters: Counters,
}

impl FinishedTile {
    /// A tile of these records; `None` unless there is one for each pixel.
    pub fn new(tile: Tile, records: Vec<u8>, has_layers: bool, counters: Counters) -> Option<Self> {
        let bytes = tile.pixels().checked_mul(record_bytes(has_layers) as u64)?;
        (records.len() as u64 == bytes).then_some(Self { tile, records, has_layers, counters })
    }

    /// A tile of these pixels, row by row, whose work is counted elsewhere; `None` unless there is one for each pixel.
    /// Layers that a pixel lacks are zero.
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

    /// Its rectangle of the picture.
    pub fn tile(&self) -> &Tile {
        &self.tile
    }

    /// The pixels' records, row by row.
    pub fn records(&self) -> &[u8] {
        &self.records
    }

    /// Column and row of each pixel, and its record.
    pub fn pixels(&self) -> impl Iterator<Item = ((u32, u32), PixelRecord)> {
        let records = self.records.chunks_exact(record_bytes(self.has_layers));
        pixel_positions(&self.tile).zip(records.map(|record| PixelRecord::read(record).unwrap_or_default()))
    }
}

/// Columns and rows of a tile's pixels, row by row.
pub fn pixel_positions(tile: &Tile) -> impl Iterator<Item = (u32, u32)> + use<> {
    let Tile { x, y, width, height, .. } = *tile;
    (y..y + height).flat_map(move |row| (x..x + width).map(move |column| (column, row)))
}

/// Takes finished tiles, from any thread. What goes wrong a sink tells its owner: a card has no part in it.
pub trait TileSink: Sync {
    /// Takes a finished tile.
    fn put(&self, tile: &FinishedTile);

    /// Forgets a tile that was put: the card that rendered it has lied. The tile is put again once another card has
    /// rendered it, unless the render ends before.
    fn revoke(&self, tile: &Tile);
}
