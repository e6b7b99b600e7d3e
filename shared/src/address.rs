//! Addresses in a card's memory. The unit is the 128-byte line, the cache line of Steinhurst's dissertation
//! (2007, chapter 7).

/// Bytes of one line.
pub const LINE_BYTES: usize = 128;

/// One line of card memory, aligned to its size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C, align(128))]
pub struct Line(pub [u8; LINE_BYTES]);

impl Line {
    /// A line of zero bytes.
    pub const ZERO: Self = Self([0; LINE_BYTES]);

    /// Returns record `slot` of a line that holds records of `N` bytes, packed from its start. `None` past
    /// the last whole record.
    #[inline(always)]
    pub fn record<const N: usize>(&self, slot: usize) -> Option<&[u8; N]> {
        self.0.as_chunks::<N>().0.get(slot)
    }

    /// Returns record `slot`, mutable, of a line that holds records of `N` bytes, packed from its start.
    /// `None` past the last whole record.
    pub fn record_mut<const N: usize>(&mut self, slot: usize) -> Option<&mut [u8; N]> {
        self.0.as_chunks_mut::<N>().0.get_mut(slot)
    }
}

/// Index of a line, counted from the start of card memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct LineAddress(pub u32);

/// Data structure that a line belongs to. Memory traffic is counted per structure. Lines of photon structures
/// go through the photon cache, other lines through the scene cache.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Structure {
    /// Header of the card image.
    Header = 0,
    /// Inner nodes of the bounding volume hierarchy.
    Nodes = 1,
    /// Leaves of the bounding volume hierarchy, which hold the triangles.
    Triangles = 2,
    /// Materials and their layers.
    Materials = 3,
    /// Lights and the distributions from which they are sampled: emitters, the light tree, distant lights,
    /// and the environment's distribution.
    Emitters = 4,
    /// Inner nodes ([`crate::layout::PhotonNode`]) of a photon map that is a wide tree.
    PhotonNodes = 5,
    /// Photons of the photon map: leaves of the wide tree, or nodes of a kd-tree.
    Photons = 6,
    /// Inner nodes of the tree in which irradiance points are searched.
    IrradianceNodes = 7,
    /// Points with precomputed irradiance (Christensen 1999).
    IrradiancePoints = 8,
    /// Inner nodes of the caustic map.
    CausticNodes = 9,
    /// Photons of the caustic map.
    CausticPhotons = 10,
    /// Vertex attributes of triangles: normals, texture coordinates and colours.
    Attributes = 11,
    /// Texture records and texels.
    Textures = 12,
    /// Records of the irradiance cache that a chip keeps from one frame to the next, in the lines after the
    /// card image.
    IrradianceRecords = 13,
    /// Gathers that wait in the lines after the card image, their results, and the blocks that wait for them.
    Waiting = 14,
}

/// Number of structures.
pub const STRUCTURES: usize = 15;

impl Structure {
    /// All structures, in order.
    pub const ALL: [Self; STRUCTURES] = [
        Self::Header,
        Self::Nodes,
        Self::Triangles,
        Self::Materials,
        Self::Emitters,
        Self::PhotonNodes,
        Self::Photons,
        Self::IrradianceNodes,
        Self::IrradiancePoints,
        Self::CausticNodes,
        Self::CausticPhotons,
        Self::Attributes,
        Self::Textures,
        Self::IrradianceRecords,
        Self::Waiting,
    ];

    /// Returns true for structures of the scene, and for kept irradiance records.
    pub const fn is_scene(self) -> bool {
        !self.is_photon_map() && !matches!(self, Self::Waiting)
    }

    /// Returns true for the photon map, the caustic map and the irradiance points.
    #[inline(always)]
    pub const fn is_photon_map(self) -> bool {
        matches!(
            self,
            Self::PhotonNodes
                | Self::Photons
                | Self::IrradianceNodes
                | Self::IrradiancePoints
                | Self::CausticNodes
                | Self::CausticPhotons
        )
    }
}

/// Stage of rendering during which memory is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Stage {
    /// Work before the first tile of a frame: reads the header of the card image.
    Begin = 0,
    /// Eye rays.
    Eye = 1,
    /// Rays that survey the surroundings of irradiance cache records.
    Survey = 2,
    /// Photon gathers for the tables from which directions of gather rays are importance-sampled.
    Table = 3,
    /// Shadow rays.
    Shadow = 4,
    /// Final gather rays.
    GatherRay = 5,
    /// Photon gathers at the ends of final gather rays.
    Gather = 6,
    /// Photon gathers in the caustic map, at visible surfaces.
    Caustic = 7,
}

/// Number of stages.
pub const STAGES: usize = 8;

impl Stage {
    /// All stages, in order.
    pub const ALL: [Self; STAGES] = [
        Self::Begin,
        Self::Eye,
        Self::Survey,
        Self::Table,
        Self::Shadow,
        Self::GatherRay,
        Self::Gather,
        Self::Caustic,
    ];
}
