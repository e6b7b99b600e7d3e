//! Finished tiles, and the trait of their destinations: film, partial file, display server.

use photoncard_shared::counters::Counters;
use photoncard_shared::message::{PixelSums, Tile};

use crate::sums::{FilmPixel, SumFormat};

/// A tile with all its pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct FinishedTile {
    tile: Tile,
    /// Encoded [`PixelSums`] in the wire format, row by row. Pixels with equal bytes are equal bit for bit.
    records: Vec<u8>,
    format: SumFormat,
    /// Work counters of the chip.
    pub counters: Counters,
}

impl FinishedTile {
    /// Creates a tile from encoded sums; `None` unless there is one valid record for each pixel.
    pub fn new(tile: Tile, records: Vec<u8>, format: SumFormat, counters: Counters) -> Option<Self> {
        let bytes = tile.pixels().checked_mul(format.record_bytes() as u64)?;
        let mut all = records.chunks_exact(format.record_bytes());
        let are_valid =
            records.len() as u64 == bytes && all.all(|record| PixelSums::read(format.form, record).is_some());
        are_valid.then_some(Self { tile, records, format, counters })
    }

    /// Creates a tile from the sums of its pixels, row by row, with zero counters; `None` unless each pixel
    /// has sums.
    pub fn of_pixels(
        tile: Tile,
        pixels: impl IntoIterator<Item = PixelSums>,
        format: SumFormat,
    ) -> Option<Self> {
        let mut records = Vec::new();
        pixels.into_iter().for_each(|sums| sums.write(&mut |bytes| records.extend(bytes)));
        Self::new(tile, records, format, Counters::ZERO)
    }

    /// Rectangle of the tile in the picture.
    pub fn tile(&self) -> &Tile {
        &self.tile
    }

    /// Encoded sums of the pixels, row by row.
    pub fn records(&self) -> &[u8] {
        &self.records
    }

    /// Format of the sums.
    pub fn format(&self) -> &SumFormat {
        &self.format
    }

    /// Column, row and sums of each pixel.
    pub fn sums(&self) -> impl Iterator<Item = ((u32, u32), PixelSums)> {
        let records = self.records.chunks_exact(self.format.record_bytes());
        pixel_positions(&self.tile)
            .zip(records.map(|record| PixelSums::read(self.format.form, record).unwrap_or_default()))
    }

    /// Returns whether any pixel is dazzling ([`SumFormat::is_dazzling`]).
    pub fn is_dazzling(&self) -> bool {
        self.sums().any(|(_, sums)| self.format.is_dazzling(&sums))
    }

    /// Column, row and values of each pixel. Positions are relative to the scene's origin.
    pub fn pixels(&self) -> impl Iterator<Item = ((u32, u32), FilmPixel)> {
        self.sums().map(|(place, sums)| (place, self.format.values(&sums, [0.0; 3])))
    }
}

/// Column and row of each pixel of a tile, row by row.
pub fn pixel_positions(tile: &Tile) -> impl Iterator<Item = (u32, u32)> + use<> {
    let Tile { x, y, width, height, .. } = *tile;
    (y..y + height).flat_map(move |row| (x..x + width).map(move |column| (column, row)))
}

/// Destination of finished tiles, called from any thread. A sink reports errors to its owner, not to the
/// card's thread.
pub trait TileSink: Sync {
    /// Stores a finished tile.
    fn put(&self, tile: &FinishedTile);

    /// Revokes a stored tile whose card sent wrong pixels. The tile is stored again after another card has
    /// rendered it, unless the render ends before.
    fn revoke(&self, tile: &Tile);
}
