//! Sections of records as lines.

use photoncard_shared::address::{LINE_BYTES, Line};
use photoncard_shared::image::{SECTIONS, Section, SectionKind};

use super::PackError;

/// Appends a section to the lines of an image.
pub(super) fn append<const N: usize>(
    lines: &mut Vec<Line>,
    sections: &mut [Section; SECTIONS],
    kind: SectionKind,
    records: impl ExactSizeIterator<Item = [u8; N]>,
) -> Result<(), PackError> {
    let bytes = (lines.len() + records.len()) as u64 * LINE_BYTES as u64;
    let count = |n: usize| u32::try_from(n).map_err(|_| PackError::TooLarge { bytes });
    sections[kind as usize] = Section { first_line: count(lines.len())?, records: count(records.len())? };
    // Exactly: an image is most of what the host holds.
    lines.reserve_exact(records.len().div_ceil(LINE_BYTES / N));
    lines.extend(pack_lines(records));
    count(lines.len()).map(drop)
}

/// Packs records into lines, none of them across a border.
fn pack_lines<const N: usize>(records: impl Iterator<Item = [u8; N]>) -> impl Iterator<Item = Line> {
    let per_line = LINE_BYTES / N;
    let mut records = records.peekable();
    std::iter::from_fn(move || {
        records.peek()?;
        let mut line = Line::ZERO;
        for (slot, record) in line.0.as_chunks_mut::<N>().0.iter_mut().zip(records.by_ref().take(per_line)) {
            *slot = record;
        }
        Some(line)
    })
}
