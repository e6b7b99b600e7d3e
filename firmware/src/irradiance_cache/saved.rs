//! Irradiance records of a block in card memory while the block waits for gathers: a stream of words.

use glam::Vec3;
use photoncard_shared::layout::Rgbe;
use photoncard_shared::message::{Fault, Invariant};

use super::packed_normal::PackedNormal;
use super::record::{Content, GatherSums, Irradiance, Record, Strongest};
use super::{IrradianceCache, LatticePoint, MAX_ROOTS, Window};
use crate::fixed_point::ColourSum;
use crate::importance::CELLS;
use crate::kind::{Capacity, Map};
use crate::memory::{MemoryPort, WordReader, WordWriter};

/// Words of a lattice point: its coordinates, and one of the codes below.
const POINT_WORDS: usize = 3;
/// Words of a record without its content.
const RECORD_WORDS: usize = 10;
/// Words of [`Content::Gathering`]: coefficients, sums, and the strongest term.
const GATHERING_WORDS: usize = CELLS + 5 * 6 + 2;

const NO_RECORD: u32 = 0;
const GATHERING: u32 = 1;
const GATHERED: u32 = 2;

/// Maximum number of words of a saved cache with `records` lattice points.
pub const fn most_cache_words(records: usize) -> usize {
    1 + MAX_ROOTS + records * (POINT_WORDS + RECORD_WORDS + GATHERING_WORDS)
}

impl<R: Capacity> IrradianceCache<R> {
    /// Writes cells and records, which are being gathered or are gathered.
    ///
    /// # Errors
    /// [`Invariant::Record`] if a record is being surveyed, [`Invariant::Room`] if there is no room.
    pub fn save<M: MemoryPort>(&self, words: &mut WordWriter<M>) -> Result<(), Fault> {
        let entries = self.records.entries();
        words.word(entries as u32)?;
        if entries == 0 {
            return Ok(());
        }
        words.all(self.roots.iter().map(|(_, divided)| *divided))?;
        for index in 0..entries {
            let Some((&LatticePoint { x, y }, record)) = self.records.entry(index) else { continue };
            words.all([x, y])?;
            match record {
                Some(record) => record.save(words)?,
                None => words.word(NO_RECORD)?,
            }
        }
        Ok(())
    }

    /// Reads the cells and records of `window` that [`Self::save`] has written.
    ///
    /// # Errors
    /// [`Invariant::Record`] if the memory holds no saved cache of this window.
    pub fn restore<M: MemoryPort>(
        &mut self,
        window: &Window,
        words: &mut WordReader<M>,
    ) -> Result<(), Fault> {
        let broken = Invariant::Record.fault();
        let entries = words.word()?;
        self.forget();
        if entries == 0 {
            return Ok(());
        }
        self.begin(window).map_err(|_| broken)?;
        for (_, divided) in &mut self.roots {
            *divided = words.word()?;
        }
        for _ in 0..entries {
            let [x, y, code] = words.array()?;
            let record = Record::restore(code, words)?;
            if !self.records.insert(LatticePoint { x, y }, record) {
                return Err(broken);
            }
        }
        Ok(())
    }
}

fn bits_of(vectors: impl IntoIterator<Item = Vec3>) -> impl Iterator<Item = u32> {
    vectors.into_iter().flat_map(|vector| vector.to_array()).map(f32::to_bits)
}

fn vectors<const N: usize, M: MemoryPort>(words: &mut WordReader<M>) -> Result<[Vec3; N], Fault> {
    let mut vectors = [Vec3::ZERO; N];
    for vector in &mut vectors {
        *vector = Vec3::from_array(words.array()?.map(f32::from_bits));
    }
    Ok(vectors)
}

impl Record {
    fn save<M: MemoryPort>(&self, words: &mut WordWriter<M>) -> Result<(), Fault> {
        let code = match self.content {
            Content::Gathering(..) => GATHERING,
            Content::Gathered(_) => GATHERED,
            Content::Surveying(_) | Content::Surveyed(_) => return Err(Invariant::Record.fault()),
        };
        let PackedNormal(geometric_normal) = self.geometric_normal;
        words.all([code, geometric_normal])?;
        words.all([self.magnitude, self.distance, self.radius].map(f32::to_bits))?;
        words.all(bits_of([self.position, self.normal]))?;
        match &self.content {
            Content::Gathering(strongest, sums) => {
                let Rgbe(light) = strongest.light;
                let [low, high] = strongest.second;
                words.all([u32::from_le_bytes(light), u32::from_le_bytes([strongest.cell, low, high, 0])])?;
                sums.save(words)
            }
            Content::Gathered(Irradiance { mean, translation, rotation }) => {
                words.all(bits_of([*mean].into_iter().chain(*translation).chain(*rotation)))
            }
            Content::Surveying(_) | Content::Surveyed(_) => Ok(()),
        }
    }

    fn restore<M: MemoryPort>(code: u32, words: &mut WordReader<M>) -> Result<Option<Self>, Fault> {
        if code == NO_RECORD {
            return Ok(None);
        }
        let [geometric_normal, magnitude, distance, radius] = words.array()?;
        let [magnitude, distance, radius] = [magnitude, distance, radius].map(f32::from_bits);
        let [position, normal] = vectors(words)?;
        let content = match code {
            GATHERING => {
                let [light, rest] = words.array()?;
                let [cell, low, high, _] = rest.to_le_bytes();
                let strongest = Strongest { light: Rgbe(light.to_le_bytes()), cell, second: [low, high] };
                Content::Gathering(strongest, GatherSums::restore(words)?)
            }
            GATHERED => {
                let [mean, along, across, about, about_other] = vectors(words)?;
                let (translation, rotation) = ([along, across], [about, about_other]);
                Content::Gathered(Irradiance { mean, translation, rotation })
            }
            _ => return Err(Invariant::Record.fault()),
        };
        let geometric_normal = PackedNormal(geometric_normal);
        Ok(Some(Self { position, normal, geometric_normal, magnitude, distance, radius, content }))
    }
}

impl GatherSums {
    fn save<M: MemoryPort>(&self, words: &mut WordWriter<M>) -> Result<(), Fault> {
        words.all(
            self.coefficients.iter().map(|&[along, across]| u32::from(across) << 16 | u32::from(along)),
        )?;
        for sum in [self.mean].into_iter().chain(self.translation).chain(self.rotation) {
            words.all(sum.words())?;
        }
        Ok(())
    }

    fn restore<M: MemoryPort>(words: &mut WordReader<M>) -> Result<Self, Fault> {
        let coefficients = words.array::<CELLS>()?.map(|word| [word as u16, (word >> 16) as u16]);
        let mut sums = [ColourSum::ZERO; 5];
        for sum in &mut sums {
            *sum = ColourSum::of_words(words.array()?);
        }
        let [mean, along, across, about, about_other] = sums;
        Ok(Self { coefficients, mean, translation: [along, across], rotation: [about, about_other] })
    }
}
