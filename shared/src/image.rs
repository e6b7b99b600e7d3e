//! The card image: one run of lines that holds all a chip needs of a scene.
//!
//! The first lines are the header: magic, layout version, number of lines, units, and a table of sections. A section is a run
//! of lines that holds records of one kind, packed as [`crate::layout`] says; the last line of each is padded with
//! zero bytes.
//!
//! The photon map has one of two layouts, and the sections of the other are empty: [`SectionKind::Photons`], or
//! [`SectionKind::PhotonNodes`] and [`SectionKind::PhotonLeaves`]. Irradiance points and the caustic map have sections of their own, or
//! none; so have textures, and what they lie on surfaces by.

use crate::address::{LINE_BYTES, Line, LineAddress, Structure};
use crate::layout::{Attributes, Emitter, Material, Photon, PhotonGrid, Record, Texture};

/// The first eight bytes of an image.
pub const MAGIC: [u8; 8] = *b"PHOTCARD";
/// The version of everything in this module and in [`crate::layout`].
pub const LAYOUT_VERSION: u16 = 8;
/// Lines of the header.
pub const HEADER_LINES: usize = 2;
/// Entries of [`SectionKind::LeafAttributes`] in one line.
pub const LEAF_ATTRIBUTES_PER_LINE: u32 = (LINE_BYTES / 4) as u32;
/// Emitter thresholds in one line.
pub const THRESHOLDS_PER_LINE: u32 = (LINE_BYTES / 4) as u32;

/// The sections of an image, in the order of the table and of the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum SectionKind {
    /// [`crate::layout::BvhNode`]s, the root first.
    Nodes = 0,
    /// [`crate::layout::BvhLeaf`]s, of triangles.
    Triangles = 1,
    /// One `u32` a leaf of triangles: where its [`Attributes`] are, see [`crate::layout::LeafAttributes`]. Empty if no triangle has any.
    LeafAttributes = 2,
    /// [`Attributes`] of triangles.
    Attributes = 3,
    /// [`Material`]s.
    Materials = 4,
    /// [`Texture`]s.
    Textures = 5,
    /// Lines of texels, see [`Texture`].
    Texels = 6,
    /// [`Emitter`]s.
    Emitters = 7,
    /// One `u32` an emitter: the upper end of its share of the probabilities, of 2^32; the last is 2^32 - 1.
    EmitterThresholds = 8,
    /// [`Photon`]s, a left-balanced kd-tree: the children of `i` are `2 i + 1` and `2 i + 2`.
    Photons = 9,
    /// [`crate::layout::PhotonNode`]s, the root first.
    PhotonNodes = 10,
    /// [`crate::layout::PhotonLeaf`]s.
    PhotonLeaves = 11,
    /// [`crate::layout::PhotonNode`]s above the photons of caustics, the root first.
    CausticNodes = 12,
    /// [`crate::layout::PhotonLeaf`]s of caustics: what has met perfectly specular surfaces alone, and one at least.
    CausticLeaves = 13,
    /// [`crate::layout::PhotonNode`]s above irradiance points, the root first.
    IrradianceNodes = 14,
    /// [`crate::layout::PhotonLeaf`]s that hold [`crate::layout::IrradiancePoint`]s in the place of photons' contents.
    IrradianceLeaves = 15,
}

/// Number of sections.
pub const SECTIONS: usize = 16;

impl SectionKind {
    /// All sections, in order.
    pub const ALL: [Self; SECTIONS] = [
        Self::Nodes,
        Self::Triangles,
        Self::LeafAttributes,
        Self::Attributes,
        Self::Materials,
        Self::Textures,
        Self::Texels,
        Self::Emitters,
        Self::EmitterThresholds,
        Self::Photons,
        Self::PhotonNodes,
        Self::PhotonLeaves,
        Self::CausticNodes,
        Self::CausticLeaves,
        Self::IrradianceNodes,
        Self::IrradianceLeaves,
    ];

    /// Records that one line holds.
    pub const fn records_per_line(self) -> u32 {
        match self {
            Self::LeafAttributes => LEAF_ATTRIBUTES_PER_LINE,
            Self::Attributes => Attributes::PER_LINE as u32,
            Self::Materials => Material::PER_LINE as u32,
            Self::Textures => Texture::PER_LINE as u32,
            Self::Emitters => Emitter::PER_LINE as u32,
            Self::EmitterThresholds => THRESHOLDS_PER_LINE,
            Self::Photons => Photon::PER_LINE as u32,
            Self::Nodes
            | Self::Triangles
            | Self::Texels
            | Self::PhotonNodes
            | Self::PhotonLeaves
            | Self::CausticNodes
            | Self::CausticLeaves
            | Self::IrradianceNodes
            | Self::IrradianceLeaves => 1,
        }
    }

    /// What its lines are counted and cached as.
    #[inline(always)]
    pub const fn structure(self) -> Structure {
        match self {
            Self::Nodes => Structure::Nodes,
            Self::Triangles => Structure::Triangles,
            Self::LeafAttributes | Self::Attributes => Structure::Attributes,
            Self::Materials => Structure::Materials,
            Self::Textures | Self::Texels => Structure::Textures,
            Self::Emitters | Self::EmitterThresholds => Structure::Emitters,
            Self::PhotonNodes => Structure::PhotonNodes,
            Self::Photons | Self::PhotonLeaves => Structure::Photons,
            Self::CausticNodes => Structure::CausticNodes,
            Self::CausticLeaves => Structure::CausticPhotons,
            Self::IrradianceNodes => Structure::IrradianceNodes,
            Self::IrradianceLeaves => Structure::IrradiancePoints,
        }
    }
}

/// A run of records.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Section {
    /// The line it starts at.
    pub first_line: u32,
    /// How many records it holds.
    pub records: u32,
}

impl Section {
    /// The line of record `index` and its slot in that line; `None` past the last record.
    #[inline(always)]
    pub fn locate<const PER_LINE: u32>(self, index: u32) -> Option<(LineAddress, usize)> {
        (index < self.records).then(|| {
            // No overflow: `Header::read` has checked the section's last line.
            let line = self.first_line.wrapping_add(index / PER_LINE);
            (LineAddress(line), (index % PER_LINE) as usize)
        })
    }
}

/// The first lines of an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Header {
    /// Lines of the whole image, the header's own among them.
    pub lines: u32,
    /// Watts that a photon power of 1 stands for.
    pub photon_power_unit: f32,
    /// Watts that a power of 1 of a photon of caustics stands for.
    pub caustic_power_unit: f32,
    /// Radiance that a fixed-point pixel sum of 1 stands for, W/(sr m^2): a power of two.
    pub radiance_unit: f32,
    /// Probability density, 1/m^2, of a shadow ray's end on one side of an emitter, for each unit of its mean radiance:
    /// pi over the power of all emitters. Zero without emitters.
    pub emitter_density: f32,
    /// The grid that photons' positions are on.
    pub photon_grid: PhotonGrid,
    /// Where the records lie, by [`SectionKind`].
    pub sections: [Section; SECTIONS],
}

/// What is wrong with a header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeaderError {
    /// It does not begin with [`MAGIC`].
    Magic,
    /// It was written for another layout version, the one given.
    Version(u16),
    /// A unit is not a positive finite number, or the emitters' density not a finite one.
    Unit,
    /// The section of this index reaches past the image's last line.
    Section(u8),
}

const PHOTON_GRID: usize = 32;
const SECTION_TABLE: usize = 64;
const HEADER_BYTES: usize = HEADER_LINES * LINE_BYTES;
const _: () = assert!(SECTION_TABLE + 8 * SECTIONS <= HEADER_BYTES);

impl Header {
    /// The section of this kind.
    #[expect(clippy::indexing_slicing, reason = "a kind is below SECTIONS")]
    pub fn section(&self, kind: SectionKind) -> Section {
        self.sections[kind as usize]
    }

    /// The header's lines.
    #[expect(clippy::indexing_slicing, reason = "constant places within the lines")]
    pub fn to_lines(&self) -> [Line; HEADER_LINES] {
        let mut bytes = [0; HEADER_BYTES];
        let mut put =
            |offset: usize, value: &[u8]| bytes[offset..offset + value.len()].copy_from_slice(value);
        put(0, &MAGIC);
        put(8, &LAYOUT_VERSION.to_le_bytes());
        put(12, &self.lines.to_le_bytes());
        put(16, &self.photon_power_unit.to_le_bytes());
        put(20, &self.radiance_unit.to_le_bytes());
        put(24, &self.emitter_density.to_le_bytes());
        put(28, &self.caustic_power_unit.to_le_bytes());
        for (axis, origin) in self.photon_grid.origin.iter().enumerate() {
            put(PHOTON_GRID + 4 * axis, &origin.to_le_bytes());
        }
        put(PHOTON_GRID + 12, &self.photon_grid.cell.to_le_bytes());
        for (index, section) in self.sections.iter().enumerate() {
            put(SECTION_TABLE + 8 * index, &section.first_line.to_le_bytes());
            put(SECTION_TABLE + 8 * index + 4, &section.records.to_le_bytes());
        }
        let mut lines = [Line::ZERO; HEADER_LINES];
        lines.iter_mut().zip(bytes.as_chunks().0).for_each(|(line, bytes)| line.0 = *bytes);
        lines
    }

    /// Reads and checks a header: whatever it returns, no section reaches past `lines`.
    pub fn read(lines: &[Line; HEADER_LINES]) -> Result<Self, HeaderError> {
        let word = |offset: usize| {
            let bytes = lines.get(offset / LINE_BYTES).map(|line| line.0.as_chunks().0);
            let word = bytes.and_then(|words| words.get(offset % LINE_BYTES / 4));
            word.map_or(0, |word| u32::from_le_bytes(*word))
        };
        let [first, ..] = lines;
        if !first.0.starts_with(&MAGIC) {
            return Err(HeaderError::Magic);
        }
        let version = word(8) as u16;
        if version != LAYOUT_VERSION {
            return Err(HeaderError::Version(version));
        }
        let header = Self {
            lines: word(12),
            photon_power_unit: f32::from_bits(word(16)),
            radiance_unit: f32::from_bits(word(20)),
            emitter_density: f32::from_bits(word(24)),
            caustic_power_unit: f32::from_bits(word(28)),
            photon_grid: PhotonGrid {
                origin: core::array::from_fn(|axis| word(PHOTON_GRID + 4 * axis) as i32),
                cell: f32::from_bits(word(PHOTON_GRID + 12)),
            },
            sections: core::array::from_fn(|index| Section {
                first_line: word(SECTION_TABLE + 8 * index),
                records: word(SECTION_TABLE + 8 * index + 4),
            }),
        };
        header.check()?;
        Ok(header)
    }

    fn check(&self) -> Result<(), HeaderError> {
        let is_unit = |x: f32| x.is_normal() && x > 0.0;
        let is_density = self.emitter_density.is_finite() && self.emitter_density >= 0.0;
        let units =
            [self.photon_power_unit, self.caustic_power_unit, self.radiance_unit, self.photon_grid.cell];
        if !units.into_iter().all(is_unit) || !is_density {
            return Err(HeaderError::Unit);
        }
        for kind in SectionKind::ALL {
            let section = self.section(kind);
            let lines = section.records.div_ceil(kind.records_per_line());
            match section.first_line.checked_add(lines) {
                Some(end) if end <= self.lines => {}
                _ => return Err(HeaderError::Section(kind as u8)),
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header() -> Header {
        let mut sections = [Section::default(); SECTIONS];
        sections[SectionKind::Photons as usize] = Section { first_line: 10, records: 60 };
        let photon_grid = PhotonGrid { origin: [-7, 0, 1 << 23], cell: 0.125 };
        Header {
            lines: 20,
            photon_power_unit: 0.5,
            caustic_power_unit: 0.25,
            radiance_unit: 2.0,
            emitter_density: 0.25,
            photon_grid,
            sections,
        }
    }

    #[test]
    fn a_header_survives_its_line() {
        assert_eq!(Header::read(&header().to_lines()), Ok(header()));
    }

    #[test]
    fn a_section_past_the_end_is_refused() {
        let mut long = header();
        long.sections[SectionKind::Photons as usize].records = 61;
        assert_eq!(Header::read(&long.to_lines()), Err(HeaderError::Section(SectionKind::Photons as u8)));
        long.sections[SectionKind::Photons as usize] = Section { first_line: u32::MAX, records: u32::MAX };
        assert_eq!(Header::read(&long.to_lines()), Err(HeaderError::Section(SectionKind::Photons as u8)));
    }

    #[test]
    fn what_is_not_an_image_is_refused() {
        assert_eq!(Header::read(&[Line::ZERO; HEADER_LINES]), Err(HeaderError::Magic));
        let mut other = header().to_lines();
        other[0].0[8] = 77;
        assert_eq!(Header::read(&other), Err(HeaderError::Version(77)));
        let unitless = Header { radiance_unit: f32::NAN, ..header() };
        assert_eq!(Header::read(&unitless.to_lines()), Err(HeaderError::Unit));
        let endless = Header { emitter_density: f32::INFINITY, ..header() };
        assert_eq!(Header::read(&endless.to_lines()), Err(HeaderError::Unit));
    }
}
