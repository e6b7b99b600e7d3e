//! The card image: its header and its lines.

use std::ops::Range;

use glam::Vec3;
use photoncard_firmware::memory::Lines;
use photoncard_firmware::scene::SceneImage;
use photoncard_shared::address::{LINE_BYTES, Line};
use photoncard_shared::image::{HEADER_LINES, Header, HeaderError, Lights, Section, SectionKind};
use photoncard_shared::layout::{BvhNode, Material, NodeBox, Record, Sensor, WideNode};

use super::error::PackError;

const LIGHT_SECTIONS: [SectionKind; 4] = [
    SectionKind::Emitters,
    SectionKind::LightNodes,
    SectionKind::DistantLights,
    SectionKind::EnvironmentCells,
];

/// Number of spare lines to allocate for a photon map, in addition to the `lines` of an image. Without them
/// the allocator copies the image when it grows, which takes seconds for a large image. Allocated lines that
/// are not written take no memory.
pub(super) fn room_for_photons(lines: usize) -> usize {
    const PHOTON_LINES: usize = 1 << 20;
    (lines / 16).min(PHOTON_LINES)
}

/// A card image in host memory.
pub struct CardImage {
    /// Header, also encoded in the first lines.
    pub(super) header: Header,
    pub(super) lines: Vec<Line>,
}

impl Clone for CardImage {
    /// Copies the card image, and allocates lines for a photon map.
    fn clone(&self) -> Self {
        let mut lines = Vec::with_capacity(self.lines.len() + room_for_photons(self.lines.len()));
        lines.extend_from_slice(&self.lines);
        Self { header: self.header, lines }
    }
}

impl AsRef<[Line]> for CardImage {
    fn as_ref(&self) -> &[Line] {
        &self.lines
    }
}

impl CardImage {
    /// Creates a card image from lines that were read from a file.
    ///
    /// # Errors
    /// If the lines do not begin with a header that states their number.
    pub fn of_lines(lines: Vec<Line>) -> Result<Self, &'static str> {
        let header = lines.first_chunk().map(Header::read);
        let header = match header {
            Some(Ok(header)) => header,
            Some(Err(HeaderError::Version(_))) => return Err("its card image has another layout"),
            Some(Err(_)) | None => return Err("it holds no card image"),
        };
        if header.lines as usize != lines.len() {
            return Err("its card image has another length");
        }
        Ok(Self { header, lines })
    }

    /// All lines, starting with the header's.
    pub fn lines(&self) -> &[Line] {
        &self.lines
    }

    /// Size of the card image, bytes.
    pub fn bytes(&self) -> u64 {
        self.lines.len() as u64 * LINE_BYTES as u64
    }

    /// Returns the card image as a chip reads it: header and lines.
    pub fn view(&self) -> (SceneImage, Lines<'_>) {
        (SceneImage { header: self.header }, Lines(&self.lines))
    }

    /// Lines of a section.
    pub fn section(&self, kind: SectionKind) -> &[Line] {
        &self.lines[self.range(kind)]
    }

    /// Lines of a section, mutable.
    pub(crate) fn section_mut(&mut self, kind: SectionKind) -> &mut [Line] {
        let range = self.range(kind);
        &mut self.lines[range]
    }

    /// Range of a section's lines in the card image.
    fn range(&self, kind: SectionKind) -> Range<usize> {
        let Section { first_line, records } = self.header.section(kind);
        let first = first_line as usize;
        first..first + records.div_ceil(kind.records_per_line()) as usize
    }

    /// Copy of the card image in which no surface and no environment emits, and there are no lights to
    /// sample. Photons remain, so that a render shows only the light of the photon map.
    #[must_use]
    pub fn without_emission(&self) -> Self {
        let mut dark = self.clone();
        dark.header.lights = Lights::NONE;
        for kind in LIGHT_SECTIONS {
            dark.header.sections[kind as usize] = Section::default();
        }
        let header = dark.header.to_lines();
        dark.lines.iter_mut().zip(header).for_each(|(line, header)| *line = header);
        let materials = dark.header.section(SectionKind::Materials).records as usize;
        let lines = dark.section_mut(SectionKind::Materials);
        for index in 0..materials {
            let line = &mut lines[index / Material::PER_LINE];
            if let Some(record) = line.record_mut(index % Material::PER_LINE) {
                *record = Material { emission: [0.0; 3], ..Material::read(record) }.to_bytes();
            }
        }
        dark
    }

    /// Copy of the card image with sensors behind its sections
    /// ([`Projection::Sensors`](photoncard_shared::message::Projection::Sensors)) and the radiance unit
    /// `radiance_unit`, a power of two, and the line of the first sensor.
    ///
    /// # Errors
    /// [`PackError::TooLarge`] if there are more lines than 32 bits can count.
    pub fn with_sensors(&self, sensors: &[Sensor], radiance_unit: f32) -> Result<(Self, u32), PackError> {
        let more = sensors.len().div_ceil(Sensor::PER_LINE);
        let all = self.lines.len() + more;
        let too_large = |_| PackError::TooLarge { bytes: all as u64 * LINE_BYTES as u64 };
        let header = Header { lines: u32::try_from(all).map_err(too_large)?, radiance_unit, ..self.header };
        let mut lines = Vec::with_capacity(all);
        lines.extend_from_slice(&self.lines);
        lines.extend(pack_lines(sensors.iter().map(Sensor::to_bytes)));
        lines[..HEADER_LINES].copy_from_slice(&header.to_lines());
        Ok((Self { header, lines }, self.header.lines))
    }

    /// Bounding box of the scene, enlarged by the rounding of the root's 8-bit grid; `None` without
    /// triangles.
    pub(super) fn bounds(&self) -> Option<NodeBox> {
        let Line(root) = self.section(SectionKind::Nodes).first()?;
        let children = 0..WideNode(root).children() as usize;
        children.filter_map(|child| BvhNode(root).bounds(child)).reduce(NodeBox::union)
    }

    /// Diagonal of the scene's bounding box, metres; 1 without triangles.
    pub fn diagonal(&self) -> f32 {
        self.bounds().map_or(1.0, |NodeBox { lower, upper }| Vec3::from(upper).distance(Vec3::from(lower)))
    }
}

/// Packs records into lines; no record straddles two lines.
pub(super) fn pack_lines<const N: usize>(
    records: impl Iterator<Item = [u8; N]>,
) -> impl Iterator<Item = Line> {
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
