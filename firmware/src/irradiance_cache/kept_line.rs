//! Format of kept irradiance records: lines of little-endian 32-bit words. Floats are stored as their bits.

use glam::Vec3;
use photoncard_shared::address::Line;

use super::packed_normal::PackedNormal;
use super::record::{Content, Irradiance, Record};
use super::{LatticePoint, MAX_ROOTS, Window};
use crate::memory::{WORDS, line_of, words_of};

/// Builds a line from its first words. The others are 0.
fn line_of_first(first: impl IntoIterator<Item = u32>) -> Line {
    let mut words = [0; WORDS];
    words.iter_mut().zip(first).for_each(|(word, value)| *word = value);
    line_of(words)
}

/// Head of a kept block: the line before its records.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct BlockHead {
    pub(super) window: Window,
    /// Line address of the [`BlockHead`] of the next older block with the same hash; 0 if there is none.
    pub(super) older: u32,
    /// Number of records in the following lines; `None` if the records of the window do not fit into the
    /// cache.
    pub(super) records: Option<u32>,
    /// Bit mask of the divided cells in the quadtree of each coarsest cell.
    pub(super) divided: [u32; MAX_ROOTS],
}

/// Stored value of [`BlockHead::records`] for a block whose records do not fit into the cache.
const FULL: u32 = u32::MAX;

impl BlockHead {
    pub(super) fn line(&self) -> Line {
        let Window { x0, x1, y0, y1 } = self.window;
        let single = [x0, x1, y0, y1, self.older, self.records.unwrap_or(FULL)];
        line_of_first(single.into_iter().chain(self.divided))
    }

    pub(super) fn read(line: &Line) -> Self {
        let [x0, x1, y0, y1, older, records, rest @ ..] = words_of(line);
        Self {
            window: Window { x0, x1, y0, y1 },
            older,
            records: Some(records).filter(|&records| records != FULL),
            divided: rest.first_chunk().copied().unwrap_or_default(),
        }
    }
}

/// A gathered record and its lattice point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct KeptRecord {
    pub(super) point: LatticePoint,
    pub(super) record: Record,
}

impl KeptRecord {
    /// Encodes the record; `None` if it is not gathered.
    pub(super) fn line(&self) -> Option<Line> {
        let Self { point: LatticePoint { x, y }, record } = *self;
        let Content::Gathered(Irradiance { mean, translation, rotation }) = record.content else {
            return None;
        };
        let lengths = [record.magnitude, record.distance, record.radius];
        let vectors = [record.position, record.normal, mean].into_iter().chain(translation).chain(rotation);
        let values = lengths.into_iter().chain(vectors.flat_map(|vector| vector.to_array()));
        let PackedNormal(geometric_normal) = record.geometric_normal;
        Some(line_of_first([x, y, geometric_normal].into_iter().chain(values.map(f32::to_bits))))
    }

    /// Decodes a record from a line, without a check of the content.
    pub(super) fn read(line: &Line) -> Option<Self> {
        let [x, y, geometric_normal, magnitude, distance, radius, rest @ ..] = words_of(line);
        let vectors = rest.as_chunks::<3>().0.first_chunk()?;
        let vectors = vectors.map(|vector| Vec3::from_array(vector.map(f32::from_bits)));
        let [position, normal, mean, along, across, about, about_other] = vectors;
        let content = Content::Gathered(Irradiance {
            mean,
            translation: [along, across],
            rotation: [about, about_other],
        });
        let [magnitude, distance, radius] = [magnitude, distance, radius].map(f32::from_bits);
        let geometric_normal = PackedNormal(geometric_normal);
        let record = Record { position, normal, geometric_normal, magnitude, distance, radius, content };
        Some(Self { point: LatticePoint { x, y }, record })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kept_lines_are_read_as_written() {
        let vector = |from: f32| Vec3::new(from, -from, from + 0.25);
        let irradiance = Irradiance {
            mean: vector(1.0),
            translation: [2.0, 3.0].map(vector),
            rotation: [4.0, 5.0].map(vector),
        };
        let record = Record {
            position: vector(6.0),
            normal: vector(7.0),
            geometric_normal: PackedNormal(0x1234_5678),
            magnitude: 8.0,
            distance: 9.0,
            radius: 10.0,
            content: Content::Gathered(irradiance),
        };
        let kept = KeptRecord { point: LatticePoint { x: 65_536, y: 11 }, record };
        assert_eq!(kept.line().and_then(|line| KeptRecord::read(&line)), Some(kept));
        for records in [None, Some(0), Some(512)] {
            let window = Window { x0: 1, x1: 2, y0: 3, y1: 4 };
            let divided = core::array::from_fn(|root| root as u32 * 0x11_1111);
            let head = BlockHead { window, older: 5, records, divided };
            assert_eq!(BlockHead::read(&head.line()), head);
        }
    }

    #[test]
    fn a_record_that_is_not_gathered_has_no_line() {
        let surface = crate::scene::Surface::white(Vec3::ONE, Vec3::Z, 1.0);
        let kept = KeptRecord { point: LatticePoint { x: 0, y: 0 }, record: Record::new(&surface, 0.5) };
        assert_eq!(kept.line(), None);
    }
}
