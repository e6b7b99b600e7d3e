//! Photons on the host: sixteen bytes each, from the moment they arrive until they are in card memory.

use photoncard_shared::layout::{GRID_BITS, PHOTON_CONTENT_BYTES, Photon, PhotonGrid, Record};

/// A photon: its grid point, and what else it carries.
///
/// Photons are ordered by place, then by what they carry: any two that differ have an order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct StoredPhoton {
    /// The three coordinates, [`GRID_BITS`] each, x the lowest.
    place: u64,
    /// The last bytes of a [`Photon`].
    content: u64,
}

const COORDINATE_MASK: u64 = (1 << GRID_BITS) - 1;
/// Place of the splitting axis in the content; zero outside a tree.
const AXIS_SHIFT: u32 = 48;
const AXIS_MASK: u64 = 3 << AXIS_SHIFT;

impl StoredPhoton {
    /// Puts a photon on the nearest point of a grid.
    pub(crate) fn new(grid: &PhotonGrid, photon: &Photon) -> Self {
        let content = Photon::content(&Photon { axis: 0, ..*photon }.to_bytes());
        Self::at(grid.nearest(photon.position), content)
    }

    /// A photon at a grid point, and what it carries.
    pub(crate) fn at(point: [u32; 3], content: [u8; PHOTON_CONTENT_BYTES]) -> Self {
        let [x, y, z] = point.map(u64::from);
        Self { place: x | y << GRID_BITS | z << (2 * GRID_BITS), content: u64::from_le_bytes(content) }
    }

    /// A coordinate of its grid point.
    #[inline(always)]
    pub(crate) fn coordinate(self, axis: usize) -> u32 {
        (self.place >> (GRID_BITS * axis as u32) & COORDINATE_MASK) as u32
    }

    /// Its grid point.
    #[inline(always)]
    pub(crate) fn point(self) -> [u32; 3] {
        [0, 1, 2].map(|axis| self.coordinate(axis))
    }

    /// The bytes besides its position.
    pub(crate) fn content(self) -> [u8; PHOTON_CONTENT_BYTES] {
        self.content.to_le_bytes()
    }

    /// The photon as a node of the kd-tree that is split on an axis.
    #[must_use]
    pub(crate) fn split_on(self, axis: usize) -> Self {
        Self { content: self.content & !AXIS_MASK | (axis as u64) << AXIS_SHIFT, ..self }
    }

    /// The record of card memory.
    pub(crate) fn record(self, grid: &PhotonGrid) -> [u8; Photon::BYTES] {
        let mut record = [0; Photon::BYTES];
        let (position, content) = record.split_at_mut(Photon::BYTES - PHOTON_CONTENT_BYTES);
        let coordinates = grid.position(self.point());
        for (bytes, coordinate) in position.as_chunks_mut().0.iter_mut().zip(coordinates) {
            *bytes = coordinate.to_le_bytes();
        }
        content.copy_from_slice(&self.content());
        record
    }
}

/// Photons of a map, in any order.
#[derive(Clone, Debug)]
pub struct Photons {
    pub(super) list: Vec<StoredPhoton>,
    pub(super) grid: PhotonGrid,
    pub(super) power_unit: f32,
}

impl Photons {
    /// Puts photons on a grid; `power_unit` are the watts that a power of 1 stands for.
    pub fn new(grid: PhotonGrid, power_unit: f32, photons: impl IntoIterator<Item = Photon>) -> Self {
        let list = photons.into_iter().map(|photon| StoredPhoton::new(&grid, &photon)).collect();
        Self { list, grid, power_unit }
    }

    /// Number of photons.
    pub fn len(&self) -> usize {
        self.list.len()
    }

    /// True without photons.
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// The grid that their positions lie on.
    pub fn grid(&self) -> PhotonGrid {
        self.grid
    }

    /// Watts that a photon power of 1 stands for.
    pub fn power_unit(&self) -> f32 {
        self.power_unit
    }

    /// The photons themselves.
    pub(crate) fn stored(&self) -> &[StoredPhoton] {
        &self.list
    }

    /// The photons themselves, to be put in another order.
    pub(crate) fn stored_mut(&mut self) -> &mut [StoredPhoton] {
        &mut self.list
    }

    /// Photons as they will be in card memory.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = Photon> {
        self.list.iter().map(|photon| Photon::read(&photon.record(&self.grid)))
    }
}
