//! The card image: the scene data that a chip reads, in lines of card memory.
//!
//! The first lines are the header: magic, layout version, number of lines, units, lights, and a table of
//! sections. A section is a sequence of lines with records of one kind ([`crate::layout`]). Each line holds
//! as many whole records as fit; unused bytes are zero.
//!
//! The photon map is either a kd-tree ([`SectionKind::Photons`]) or a wide tree ([`SectionKind::PhotonNodes`]
//! and [`SectionKind::PhotonLeaves`]). The sections of the layout that is not used are empty. Sections of
//! irradiance points, the caustic map, textures and vertex attributes are empty if the scene has none.

use core::fmt;

use crate::address::{LINE_BYTES, Line, LineAddress, Structure};
use crate::layout::{
    Attributes, DistantLight, Emitter, Layers, Material, Photon, PhotonGrid, Record, Texture,
};
use crate::message::SumScale;

/// The first eight bytes of a card image.
pub const MAGIC: [u8; 8] = *b"PHOTCARD";
/// Version of the formats in this module and in [`crate::layout`].
pub const LAYOUT_VERSION: u16 = 16;
/// Lines of the header.
pub const HEADER_LINES: usize = 2;
/// Number of entries of [`SectionKind::LeafAttributes`] per line.
pub const LEAF_ATTRIBUTES_PER_LINE: u32 = (LINE_BYTES / 4) as u32;
/// Number of cumulative probabilities of [`SectionKind::EnvironmentCells`] per line.
pub const THRESHOLDS_PER_LINE: u32 = (LINE_BYTES / 4) as u32;
/// Number of identities of [`SectionKind::Identities`] per line.
pub const IDENTITIES_PER_LINE: u32 = (LINE_BYTES / 4) as u32;

/// Sections of a card image, in the order of their lines and of their entries in the section table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum SectionKind {
    /// [`crate::layout::BvhNode`]s, the root first.
    Nodes = 0,
    /// [`crate::layout::BvhLeaf`]s, which hold the triangles.
    Triangles = 1,
    /// [`crate::layout::LeafAttributes`], one `u32` for each [`crate::layout::BvhLeaf`]. Empty if no triangle
    /// has attributes.
    LeafAttributes = 2,
    /// [`Attributes`] of triangles. The [`crate::layout::Tangents`] of a leaf, if it has any, precede its
    /// attributes.
    Attributes = 3,
    /// [`Material`]s.
    Materials = 4,
    /// [`Layers`] of the materials that have layers.
    Layers = 5,
    /// [`Texture`]s.
    Textures = 6,
    /// Lines of texels; [`Texture`] describes their order.
    Texels = 7,
    /// [`Emitter`]s.
    Emitters = 8,
    /// [`crate::layout::LightNode`]s of the light tree, the root first.
    LightNodes = 9,
    /// [`DistantLight`]s.
    DistantLights = 10,
    /// Distribution for importance sampling of directions to the environment, over a grid of cells. It
    /// consists of cumulative distribution functions, as `u32` values in units of 2^-32. The marginal
    /// function of the rows comes first, then for each row the conditional function of its cells. Each
    /// function ends with 2^32 - 1.
    ///
    /// If m cells are subdivided into n x n subcells each, these values follow: m; n; the row-major numbers
    /// of the m cells, in increasing order; and, for each of these cells, the distributions of its n rows and
    /// n x n subcells, in the form above.
    EnvironmentCells = 11,
    /// [`Photon`]s as a left-balanced kd-tree: the children of photon `i` are photons `2 i + 1` and
    /// `2 i + 2`.
    Photons = 12,
    /// [`crate::layout::PhotonNode`]s, the root first.
    PhotonNodes = 13,
    /// [`crate::layout::PhotonLeaf`]s.
    PhotonLeaves = 14,
    /// [`crate::layout::PhotonNode`]s of the caustic map, the root first.
    CausticNodes = 15,
    /// [`crate::layout::PhotonLeaf`]s of the caustic map. Its photons have followed paths `L S+ D`: one or
    /// more specular bounces, then a diffuse surface.
    CausticLeaves = 16,
    /// [`crate::layout::PhotonNode`]s of the tree of irradiance points, the root first.
    IrradianceNodes = 17,
    /// [`crate::layout::PhotonLeaf`]s that hold [`crate::layout::IrradiancePoint`]s in place of photons.
    IrradianceLeaves = 18,
    /// Identities of the triangles, `u32` values: [`LEAF_TRIANGLES`](crate::layout::LEAF_TRIANGLES) for each
    /// [`crate::layout::BvhLeaf`], one for each triangle by slot. Those of triangles in a group are relative
    /// to the first value of the [`crate::layout::Instance`]. Empty unless a frame asks for identities.
    Identities = 19,
}

/// Number of sections.
pub const SECTIONS: usize = 20;

impl SectionKind {
    /// All sections, in order.
    pub const ALL: [Self; SECTIONS] = [
        Self::Nodes,
        Self::Triangles,
        Self::LeafAttributes,
        Self::Attributes,
        Self::Materials,
        Self::Layers,
        Self::Textures,
        Self::Texels,
        Self::Emitters,
        Self::LightNodes,
        Self::DistantLights,
        Self::EnvironmentCells,
        Self::Photons,
        Self::PhotonNodes,
        Self::PhotonLeaves,
        Self::CausticNodes,
        Self::CausticLeaves,
        Self::IrradianceNodes,
        Self::IrradianceLeaves,
        Self::Identities,
    ];

    /// Number of records per line.
    pub const fn records_per_line(self) -> u32 {
        match self {
            Self::LeafAttributes => LEAF_ATTRIBUTES_PER_LINE,
            Self::Attributes => Attributes::PER_LINE as u32,
            Self::Materials => Material::PER_LINE as u32,
            Self::Layers => Layers::PER_LINE as u32,
            Self::Textures => Texture::PER_LINE as u32,
            Self::Emitters => Emitter::PER_LINE as u32,
            Self::DistantLights => DistantLight::PER_LINE as u32,
            Self::EnvironmentCells => THRESHOLDS_PER_LINE,
            Self::Identities => IDENTITIES_PER_LINE,
            Self::Photons => Photon::PER_LINE as u32,
            Self::Nodes
            | Self::Triangles
            | Self::Texels
            | Self::LightNodes
            | Self::PhotonNodes
            | Self::PhotonLeaves
            | Self::CausticNodes
            | Self::CausticLeaves
            | Self::IrradianceNodes
            | Self::IrradianceLeaves => 1,
        }
    }

    /// Returns the structure to which the section's lines belong, for counters and caches.
    #[inline(always)]
    pub const fn structure(self) -> Structure {
        match self {
            Self::Nodes => Structure::Nodes,
            Self::Triangles => Structure::Triangles,
            Self::LeafAttributes | Self::Attributes | Self::Identities => Structure::Attributes,
            Self::Materials | Self::Layers => Structure::Materials,
            Self::Textures | Self::Texels => Structure::Textures,
            Self::Emitters | Self::LightNodes | Self::DistantLights | Self::EnvironmentCells => {
                Structure::Emitters
            }
            Self::PhotonNodes => Structure::PhotonNodes,
            Self::Photons | Self::PhotonLeaves => Structure::Photons,
            Self::CausticNodes => Structure::CausticNodes,
            Self::CausticLeaves => Structure::CausticPhotons,
            Self::IrradianceNodes => Structure::IrradianceNodes,
            Self::IrradianceLeaves => Structure::IrradiancePoints,
        }
    }
}

/// Position and size of a section, which consists of consecutive records of one kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Section {
    /// Index of the section's first line.
    pub first_line: u32,
    /// Number of the section's records.
    pub records: u32,
}

impl Section {
    /// Returns the line that holds record `index`, and the record's slot in that line; `None` past the last
    /// record.
    #[inline(always)]
    pub fn locate<const PER_LINE: u32>(self, index: u32) -> Option<(LineAddress, usize)> {
        (index < self.records).then(|| {
            // No overflow: `Header::read` has checked the section's last line.
            let line = self.first_line.wrapping_add(index / PER_LINE);
            (LineAddress(line), (index % PER_LINE) as usize)
        })
    }
}

/// Header of a card image, in the first [`HEADER_LINES`] lines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Header {
    /// Number of lines of the card image, the header included.
    pub lines: u32,
    /// Unit of photon powers in the photon map, W.
    pub photon_power_unit: f32,
    /// Unit of photon powers in the caustic map, W.
    pub caustic_power_unit: f32,
    /// Radiance unit, W/(sr m^2): a power of two. A pixel's sums of light are in steps of 2^-40 of this unit.
    pub radiance_unit: f32,
    /// Maximum magnitude of a coordinate of the scene, metres.
    pub reach: f32,
    /// Grid on which the photons' positions lie. It need not cover the whole scene.
    pub photon_grid: PhotonGrid,
    /// Probabilities of the kinds of lights, and parameters of the environment light.
    pub lights: Lights,
    /// Sections, indexed by [`SectionKind`].
    pub sections: [Section; SECTIONS],
}

/// Probabilities of the three kinds of lights in light sampling, and the parameters of the environment light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lights {
    /// Probability that a light sample chooses an emitter through the light tree.
    pub emitters: f32,
    /// Probability that a light sample chooses the environment.
    pub environment: f32,
    /// Probability that a light sample chooses a distant light.
    pub distant: f32,
    /// Scale of the environment's texels, W/(sr m^2) per channel.
    pub radiance: [f32; 3],
    /// Index of the environment's texture; `None` without an environment.
    pub texture: Option<u32>,
    /// Number of columns and rows, 1 to 65535, of the grid of cells from which the environment is sampled.
    /// Columns are equal steps of azimuth, rows of polar angle.
    pub cells: [u16; 2],
    /// Light group of the environment, below [`MAX_LIGHT_GROUPS`](crate::budget::MAX_LIGHT_GROUPS).
    pub light_group: u8,
}

impl Lights {
    /// Value for a scene without lights.
    pub const NONE: Self = Self {
        emitters: 0.0,
        environment: 0.0,
        distant: 0.0,
        radiance: [0.0; 3],
        texture: None,
        cells: [1; 2],
        light_group: 0,
    };

    fn is_sound(&self) -> bool {
        let shares = [self.emitters, self.environment, self.distant];
        shares.into_iter().all(|share| (0.0..=1.0).contains(&share))
            && self.radiance.into_iter().all(|radiance| radiance >= 0.0 && radiance.is_finite())
    }
}

/// Reason why a header is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum HeaderError {
    /// The card image does not begin with [`MAGIC`].
    Magic,
    /// The card image has this layout version, which is not [`LAYOUT_VERSION`].
    Version(u16),
    /// A number is out of range: a unit or the cell size of the photon grid is not a positive normal number,
    /// a probability is not in [0, 1], or the environment's radiance or [`Header::reach`] is negative or not
    /// finite.
    Unit,
    /// The section with this index extends past the card image's last line.
    Section(u8),
}

impl fmt::Display for HeaderError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Magic => f.write_str("the lines are no card image"),
            Self::Version(version) => write!(f, "the card image has layout version {version}"),
            Self::Unit => f.write_str("a number in the card image's header is out of range"),
            Self::Section(index) => write!(f, "section {index} extends past the card image's last line"),
        }
    }
}

impl core::error::Error for HeaderError {}

/// Offset of [`Lights::light_group`] in the header, bytes.
const GROUP: usize = 10;
const PHOTON_GRID: usize = 32;
const SECTION_TABLE: usize = 64;
const HEADER_BYTES: usize = HEADER_LINES * LINE_BYTES;
/// Offset of [`Lights`] in the header, bytes. The lights are at the header's end, so that the section table
/// can grow towards them.
const LIGHTS: usize = HEADER_BYTES - 32;
const _: () = assert!(SECTION_TABLE + 8 * SECTIONS <= LIGHTS);
/// Encoding of [`Lights::texture`] that stands for `None`.
const NO_ENVIRONMENT: u32 = u32::MAX;

impl Header {
    /// Header of an empty card image: no lines, sections or lights; all units are 1.
    pub const EMPTY: Self = Self {
        lines: 0,
        photon_power_unit: 1.0,
        caustic_power_unit: 1.0,
        radiance_unit: 1.0,
        reach: 0.0,
        photon_grid: PhotonGrid::UNIT,
        lights: Lights::NONE,
        sections: [Section { first_line: 0, records: 0 }; SECTIONS],
    };

    /// Returns the position and size of section `kind`.
    #[expect(clippy::indexing_slicing, reason = "a kind is below SECTIONS")]
    pub fn section(&self, kind: SectionKind) -> Section {
        self.sections[kind as usize]
    }

    /// Encodes the header.
    #[expect(clippy::indexing_slicing, reason = "constant places within the lines")]
    pub fn to_lines(&self) -> [Line; HEADER_LINES] {
        let mut bytes = [0; HEADER_BYTES];
        let mut put =
            |offset: usize, value: &[u8]| bytes[offset..offset + value.len()].copy_from_slice(value);
        put(0, &MAGIC);
        put(8, &LAYOUT_VERSION.to_le_bytes());
        put(GROUP, &[self.lights.light_group]);
        put(12, &self.lines.to_le_bytes());
        put(16, &self.photon_power_unit.to_le_bytes());
        put(20, &self.radiance_unit.to_le_bytes());
        put(24, &self.reach.to_le_bytes());
        put(28, &self.caustic_power_unit.to_le_bytes());
        for (axis, origin) in self.photon_grid.origin.iter().enumerate() {
            put(PHOTON_GRID + 4 * axis, &origin.to_le_bytes());
        }
        put(PHOTON_GRID + 12, &self.photon_grid.cell.to_le_bytes());
        let Lights { emitters, environment, distant, radiance: [red, green, blue], texture, cells, .. } =
            self.lights;
        for (index, number) in [emitters, environment, distant, red, green, blue].into_iter().enumerate() {
            put(LIGHTS + 4 * index, &number.to_le_bytes());
        }
        put(LIGHTS + 24, &texture.unwrap_or(NO_ENVIRONMENT).to_le_bytes());
        put(LIGHTS + 28, &cells[0].to_le_bytes());
        put(LIGHTS + 30, &cells[1].to_le_bytes());
        for (index, section) in self.sections.iter().enumerate() {
            put(SECTION_TABLE + 8 * index, &section.first_line.to_le_bytes());
            put(SECTION_TABLE + 8 * index + 4, &section.records.to_le_bytes());
        }
        let mut lines = [Line::ZERO; HEADER_LINES];
        lines.iter_mut().zip(bytes.as_chunks().0).for_each(|(line, bytes)| line.0 = *bytes);
        lines
    }

    /// Reads and checks a header. No section of the result extends past [`Self::lines`].
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
            reach: f32::from_bits(word(24)),
            caustic_power_unit: f32::from_bits(word(28)),
            photon_grid: PhotonGrid {
                origin: core::array::from_fn(|axis| word(PHOTON_GRID + 4 * axis) as i32),
                cell: f32::from_bits(word(PHOTON_GRID + 12)),
            },
            lights: Lights {
                light_group: (word(8) >> 16) as u8,
                ..Self::read_lights(|index| word(LIGHTS + 4 * index))
            },
            sections: core::array::from_fn(|index| Section {
                first_line: word(SECTION_TABLE + 8 * index),
                records: word(SECTION_TABLE + 8 * index + 4),
            }),
        };
        header.check()?;
        Ok(header)
    }

    fn read_lights(word: impl Fn(usize) -> u32) -> Lights {
        let number = |index: usize| f32::from_bits(word(index));
        let (texture, cells) = (word(6), word(7));
        Lights {
            emitters: number(0),
            environment: number(1),
            distant: number(2),
            radiance: [number(3), number(4), number(5)],
            texture: (texture != NO_ENVIRONMENT).then_some(texture),
            cells: [cells as u16, (cells >> 16) as u16].map(|cells| cells.max(1)),
            light_group: 0,
        }
    }

    /// Returns the units in which a pixel's sums are stored. The unit of light is the radiance unit, the unit
    /// of depth is the side of a photon grid cell.
    pub fn sum_scale(&self) -> SumScale {
        SumScale { radiance: self.radiance_unit, depth: self.photon_grid.cell }
    }

    fn check(&self) -> Result<(), HeaderError> {
        let is_unit = |x: f32| x.is_normal() && x > 0.0;
        let units =
            [self.photon_power_unit, self.caustic_power_unit, self.radiance_unit, self.photon_grid.cell];
        let is_reach = (0.0..=f32::MAX).contains(&self.reach);
        if !units.into_iter().all(is_unit) || !is_reach || !self.lights.is_sound() {
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
            reach: 1.5,
            photon_grid,
            lights: Lights {
                emitters: 0.5,
                environment: 0.125,
                distant: 0.375,
                radiance: [1.0, 2.0, 3.0],
                texture: Some(7),
                cells: [128, 64],
                light_group: 3,
            },
            sections,
        }
    }

    #[test]
    fn a_header_survives_its_line() {
        assert_eq!(Header::read(&header().to_lines()), Ok(header()));
        let dark = Header { lights: Lights::NONE, ..header() };
        assert_eq!(Header::read(&dark.to_lines()), Ok(dark));
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
    fn bytes_that_are_not_an_image_are_refused() {
        assert_eq!(Header::read(&[Line::ZERO; HEADER_LINES]), Err(HeaderError::Magic));
        let mut other = header().to_lines();
        other[0].0[8] = 77;
        assert_eq!(Header::read(&other), Err(HeaderError::Version(77)));
        let unitless = Header { radiance_unit: f32::NAN, ..header() };
        assert_eq!(Header::read(&unitless.to_lines()), Err(HeaderError::Unit));
        let unlikely = Header { lights: Lights { distant: f32::INFINITY, ..Lights::NONE }, ..header() };
        assert_eq!(Header::read(&unlikely.to_lines()), Err(HeaderError::Unit));
    }
}
