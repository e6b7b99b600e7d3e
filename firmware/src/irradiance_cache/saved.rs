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
use crate::light_groups::LightGroups;
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
        groups: LightGroups,
        words: &mut WordReader<M>,
    ) -> Result<(), Fault> {
        let broken = Invariant::Record.fault();
        let entries = words.word()?;
        self.forget();
        if entries == 0 {
            return Ok(());
        }
        self.begin(window, groups).map_err(|_| broken)?;
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
        self.points = self.records.entries() / groups.count();
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

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use photoncard_shared::address::{Line, Structure};
    use proptest::prelude::*;

    use super::*;
    use crate::kind::Entries;
    use crate::memory::{Dram, Room, WORDS};
    use crate::scene::Surface;

    const POINTS: usize = 64;
    const LINES: usize = most_cache_words(POINTS).div_ceil(WORDS);
    const WINDOW: Window = Window { x0: 16, x1: 40, y0: 32, y1: 48 };

    type Cache = IrradianceCache<Entries<POINTS>>;

    fn vector() -> impl Strategy<Value = Vec3> {
        any::<[f32; 3]>().prop_map(Vec3::from_array)
    }

    fn sum() -> impl Strategy<Value = ColourSum> {
        any::<[u32; 6]>().prop_map(ColourSum::of_words)
    }

    fn content() -> impl Strategy<Value = Content> {
        let strongest = any::<([u8; 4], u8, [u8; 2])>().prop_map(|(light, cell, second)| Strongest {
            light: Rgbe(light),
            cell,
            second,
        });
        let coefficients = prop::array::uniform32(any::<[u16; 2]>());
        let pair = || [sum(), sum()];
        let gathering = (strongest, coefficients, sum(), pair(), pair()).prop_map(
            |(strongest, coefficients, mean, translation, rotation)| {
                Content::Gathering(strongest, GatherSums { coefficients, mean, translation, rotation })
            },
        );
        let pair = || [vector(), vector()];
        let gathered = (vector(), pair(), pair()).prop_map(|(mean, translation, rotation)| {
            Content::Gathered(Irradiance { mean, translation, rotation })
        });
        prop_oneof![gathering, gathered]
    }

    fn record() -> impl Strategy<Value = Record> {
        (vector(), vector(), any::<u32>(), any::<[f32; 3]>(), content()).prop_map(
            |(position, normal, packed, [magnitude, distance, radius], content)| {
                let geometric_normal = PackedNormal(packed);
                Record { position, normal, geometric_normal, magnitude, distance, radius, content }
            },
        )
    }

    /// Cache of [`WINDOW`] with these records at points of the lattice.
    fn cache(divided: [u32; 2], records: &[Option<Record>]) -> Cache {
        let mut cache = Cache::new();
        cache.begin(&WINDOW, LightGroups::ONE).unwrap();
        cache.roots.iter_mut().zip(divided).for_each(|(root, divided)| root.1 = divided);
        for (number, record) in (0..).zip(records) {
            let point = LatticePoint { x: 16 + 2 * number, y: 32 + number };
            cache.records.insert(point, *record).unwrap();
        }
        cache
    }

    /// Saves a cache in lines of memory. Returns them with the number of words, rounded up to lines.
    fn saved(cache: &Cache) -> Result<(Vec<Line>, usize), Fault> {
        let mut lines = std::vec![Line::ZERO; LINES + 1];
        let (mut memory, mut room) = (Dram::new(&mut lines), Room::new(1, LINES as u32));
        let words = &mut WordWriter::new(&mut memory, &mut room);
        cache.save(words)?;
        words.end()?;
        let used = (room.next() - 1) as usize;
        Ok((lines, used))
    }

    fn restored(lines: &mut [Line], window: &Window) -> Result<Cache, Fault> {
        // Earlier contents of the cache have no effect.
        let mut cache = cache([7; 2], &[None; 3]);
        let mut memory = Dram::new(lines);
        cache.restore(window, LightGroups::ONE, &mut WordReader::new(&mut memory, Structure::Waiting, 1))?;
        Ok(cache)
    }

    fn entries(cache: &Cache) -> Vec<(LatticePoint, Option<Record>)> {
        let entry = |index| cache.records.entry(index).map(|(point, record)| (*point, *record));
        (0..cache.records.entries()).filter_map(entry).collect()
    }

    proptest! {
        #[test]
        fn a_cache_is_restored_as_it_was_saved(
            divided: [u32; 2],
            records in prop::collection::vec(prop::option::weighted(0.8, record()), 0..POINTS),
        ) {
            let cache = cache(divided, &records);
            let (mut lines, _) = saved(&cache).unwrap();
            let restored = restored(&mut lines, &WINDOW).unwrap();
            prop_assert_eq!(entries(&restored), entries(&cache));
            // Without records nothing is interpolated, so that the cells are dropped.
            prop_assert_eq!(restored.roots, if records.is_empty() { heapless::Vec::new() } else { cache.roots });
        }

        #[test]
        fn a_full_cache_takes_no_more_words_than_the_bound(record in record()) {
            let (_, used) = saved(&cache([0; 2], &[Some(record); POINTS])).unwrap();
            let is_gathering = matches!(record.content, Content::Gathering(..));
            prop_assert!(used <= LINES && (!is_gathering || used + 1 >= LINES), "{used} of {LINES}");
        }
    }

    #[test]
    fn a_record_that_is_surveyed_is_not_saved() {
        let record = Record::new(&Surface::white(Vec3::ONE, Vec3::Z, 1.0), 0.5);
        assert_eq!(saved(&cache([0; 2], &[None, Some(record)])).err(), Some(Invariant::Record.fault()));
    }

    #[test]
    fn lines_that_hold_no_saved_cache_of_the_window_are_a_fault() {
        let (lines, _) = saved(&cache([1, 2], &[None; 3])).unwrap();
        let words = |entries: u32, code: u32| {
            let mut lines = lines.clone();
            // The first record's code follows the number of records, the cells and the point's coordinates.
            for (word, value) in [(0, entries), (5, code)] {
                lines[1].0[4 * word..][..4].copy_from_slice(&value.to_le_bytes());
            }
            lines
        };
        assert!(restored(&mut words(3, NO_RECORD), &WINDOW).is_ok());
        assert!(restored(&mut words(3, GATHERED + 1), &WINDOW).is_err());
        assert!(restored(&mut words(u32::MAX, NO_RECORD), &WINDOW).is_err());
        let many_cells = Window { x0: 0, x1: 400, y0: 0, y1: 400 };
        assert_eq!(restored(&mut words(3, NO_RECORD), &many_cells).err(), Some(Invariant::Record.fault()));
    }
}
