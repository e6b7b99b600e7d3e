//! State of a block in flight, saved in card memory while it waits for gathers: a stream of words.

use photoncard_shared::budget::Budget;
use photoncard_shared::message::{Fault, FrameParameters, Invariant};

use super::super::flight::Flight;
use super::super::pixel_sums::PixelSums;
use super::super::position::{Block, Pass, Position};
use crate::fixed_point::ColourSum;
use crate::irradiance_cache::most_cache_words;
use crate::kind::ChipKind;
use crate::light_groups::LightGroups;
use crate::memory::{MemoryPort, WordReader, WordWriter};

/// Words of a block besides those of records and pixels.
const HEAD_WORDS: usize = 8;
/// Words of a pixel's sum. A tile with several sums for each pixel has fewer pixels.
const SUM_WORDS: usize = 6;

/// Maximum number of words of a saved block. `has_records` is true in a frame with irradiance records.
pub(super) const fn most_words(budget: &Budget, has_records: bool) -> usize {
    // A pixel has two bytes for the number of its sum, and one for its number of paths.
    let pixels = budget.tile_pixels as usize;
    let records = if has_records { budget.irradiance_records as usize } else { 0 };
    HEAD_WORDS + most_cache_words(records) + pixels * (1 + SUM_WORDS)
}

impl<K: ChipKind> Flight<K> {
    /// Writes the state of the block, which waits for gathers.
    pub(super) fn save<M: MemoryPort>(
        &self,
        frame: &FrameParameters,
        sums: &PixelSums<K::TilePixels>,
        flight: usize,
        words: &mut WordWriter<M>,
    ) -> Result<(), Fault> {
        let Block { x, y, width, height } = self.block;
        let of_pixels = self.pass() == Pass::Wait;
        words.all([x, y, width, height, u32::from(of_pixels)])?;
        self.cache.save(words)?;
        if of_pixels {
            self.save_pixels(words)?;
            let count = sums.len(flight);
            words.word(count)?;
            for number in 0..count as u16 {
                let light = sums.light(frame, (flight, number))?;
                for sum in light.sums(frame) {
                    words.all(sum.words())?;
                }
            }
        }
        words.end()
    }

    /// Reads the state of a block that [`Self::save`] has written. The tile and its counters are already
    /// those of the block.
    pub(super) fn restore<M: MemoryPort>(
        &mut self,
        frame: &FrameParameters,
        sums: &mut PixelSums<K::TilePixels>,
        flight: usize,
        words: &mut WordReader<M>,
    ) -> Result<(), Fault> {
        let [x, y, width, height, of_pixels] = words.array()?;
        let fits =
            |first: u32, count: u32, size: u32| first.checked_add(count).is_some_and(|end| end <= size);
        if !fits(x, width, self.tile.width) || !fits(y, height, self.tile.height) {
            return Err(Invariant::Pixels.fault());
        }
        self.set_block(Block { x, y, width, height })?;
        let window = self.window();
        self.cache.restore(&window, LightGroups::of(frame), words)?;
        if of_pixels == 0 {
            self.position = Position::at(Pass::WaitForRecords);
            return Ok(());
        }
        self.position = Position::at(Pass::Wait);
        self.restore_pixels(words)?;
        sums.begin(flight);
        for _ in 0..words.word()? {
            if !sums.has_room(frame) {
                return Err(Invariant::Sums.fault());
            }
            let number = sums.push(frame, flight)?;
            for sum in sums.of_pixel(frame, (flight, number))? {
                *sum = ColourSum::of_words(words.array()?);
            }
        }
        Ok(())
    }
}
