//! Writes a card image section by section.

use photoncard_shared::address::{LINE_BYTES, Line};
use photoncard_shared::image::{HEADER_LINES, Header, Section, SectionKind};
use photoncard_shared::layout::PhotonGrid;

use super::card_image::{CardImage, pack_lines, room_for_photons};
use super::error::PackError;

/// Writer of a card image. It appends sections after the last line.
pub(crate) struct ImageWriter {
    header: Header,
    lines: Vec<Line>,
}

impl ImageWriter {
    /// Creates a writer of a card image without sections, and allocates `lines` lines and the lines of a
    /// photon map. `header` has the units and lights; the writer sets the numbers of lines and the sections.
    pub(super) fn new(header: Header, lines: usize) -> Self {
        let mut all = Vec::with_capacity(HEADER_LINES + lines + room_for_photons(lines));
        all.resize(HEADER_LINES, Line::ZERO);
        Self { header, lines: all }
    }

    /// Creates a writer that appends to a finished image.
    pub(crate) fn resume(CardImage { header, lines }: CardImage) -> Self {
        Self { header, lines }
    }

    /// Sets the grid of photon positions and the photon power unit, watts.
    pub(crate) fn set_photons(&mut self, grid: PhotonGrid, power_unit: f32) {
        self.header.photon_grid = grid;
        self.header.photon_power_unit = power_unit;
    }

    /// Sets the caustic photons' power unit, watts.
    pub(crate) fn set_caustic_power_unit(&mut self, power_unit: f32) {
        self.header.caustic_power_unit = power_unit;
    }

    /// Appends a section of records. No record straddles two lines.
    ///
    /// # Errors
    /// [`PackError::TooLarge`] if there are more lines or records than 32 bits can count.
    pub(crate) fn append<const N: usize>(
        &mut self,
        kind: SectionKind,
        records: impl ExactSizeIterator<Item = [u8; N]>,
    ) -> Result<(), PackError> {
        let lines = records.len().div_ceil(LINE_BYTES / N);
        self.header.sections[kind as usize] = section(self.lines.len(), records.len(), lines)?;
        self.lines.reserve_exact(lines);
        self.lines.extend(pack_lines(records));
        Ok(())
    }

    /// Appends a section of zeroed records and returns its lines, so that the records can be written in any
    /// order.
    ///
    /// # Errors
    /// As [`Self::append`].
    pub(crate) fn append_zeroed(
        &mut self,
        kind: SectionKind,
        records: usize,
    ) -> Result<&mut [Line], PackError> {
        let (first, lines) = (self.lines.len(), records.div_ceil(kind.records_per_line() as usize));
        self.header.sections[kind as usize] = section(first, records, lines)?;
        self.lines.reserve_exact(lines);
        self.lines.resize(first + lines, Line::ZERO);
        Ok(&mut self.lines[first..])
    }

    /// Removes sections, which must be the last of the card image.
    pub(crate) fn remove_last(&mut self, kinds: &[SectionKind]) {
        for &kind in kinds {
            let Section { first_line, records } = std::mem::take(&mut self.header.sections[kind as usize]);
            if records > 0 {
                self.lines.truncate(first_line as usize);
            }
        }
    }

    /// Writes the header into the first lines.
    pub(crate) fn finish(self) -> CardImage {
        let Self { mut header, mut lines } = self;
        // `section` has checked that the number of lines fits.
        header.lines = lines.len() as u32;
        lines[..HEADER_LINES].copy_from_slice(&header.to_lines());
        CardImage { header, lines }
    }
}

/// Section of `records` records that takes `lines` lines from line `first` on.
fn section(first: usize, records: usize, lines: usize) -> Result<Section, PackError> {
    let end = first + lines;
    let too_large = |_| PackError::TooLarge { bytes: end as u64 * LINE_BYTES as u64 };
    let [first_line, records, end] =
        [first, records, end].map(|count| u32::try_from(count).map_err(too_large));
    end.and(Ok(Section { first_line: first_line?, records: records? }))
}
