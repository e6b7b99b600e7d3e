//! Photons in host memory, sixteen bytes each, before they are written to the card image.

use glam::Vec3;
use photoncard_firmware::sampler::hash;
use photoncard_shared::layout::{
    GRID_BITS, PHOTON_CONTENT_BYTES, Photon, PhotonGrid, Record, Rgbe, decode_normal, normal_class,
};

/// A photon: its grid point, and its other values in encoded form.
///
/// Photons have a total order, by grid point and then by content.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct StoredPhoton {
    /// Grid point: three coordinates of [`GRID_BITS`] bits each, x in the lowest bits.
    place: u64,
    /// Bytes that follow the position in a [`Photon`]'s record, in little-endian order.
    content: u64,
}

const COORDINATE_MASK: u64 = (1 << GRID_BITS) - 1;
/// Bit offset in [`StoredPhoton::content`] of the photon's light group or, in a kd-tree, of the splitting
/// axis.
const AXIS_SHIFT: u32 = 48;
const AXIS_MASK: u64 = 3 << AXIS_SHIFT;

impl StoredPhoton {
    /// Encodes a photon and moves it to the nearest grid point.
    pub(crate) fn new(grid: &PhotonGrid, photon: &Photon) -> Self {
        let content = Photon::content(&photon.to_bytes());
        Self::at(grid.nearest(photon.position), content)
    }

    /// Photon at a grid point, with its content.
    pub(crate) fn at(point: [u32; 3], content: [u8; PHOTON_CONTENT_BYTES]) -> Self {
        let [x, y, z] = point.map(u64::from);
        Self { place: x | y << GRID_BITS | z << (2 * GRID_BITS), content: u64::from_le_bytes(content) }
    }

    /// Coordinate of the grid point on an axis.
    #[inline(always)]
    pub(crate) fn coordinate(self, axis: usize) -> u32 {
        (self.place >> (GRID_BITS * axis as u32) & COORDINATE_MASK) as u32
    }

    /// Coordinates of the photon's grid point.
    #[inline(always)]
    pub(crate) fn point(self) -> [u32; 3] {
        [0, 1, 2].map(|axis| self.coordinate(axis))
    }

    /// Bytes that follow the position in the photon's record.
    pub(crate) fn content(self) -> [u8; PHOTON_CONTENT_BYTES] {
        self.content.to_le_bytes()
    }

    /// Sum of the power's channels, in the map's units.
    pub(crate) fn power(self) -> f64 {
        self.colour().into_iter().map(f64::from).sum()
    }

    /// Power per channel, in the map's units.
    pub(crate) fn colour(self) -> [f32; 3] {
        let [a, b, c, d, ..] = self.content();
        Rgbe([a, b, c, d]).decode()
    }

    /// Squared distance to another photon, square grid cells.
    pub(crate) fn distance_squared(self, other: Self) -> u64 {
        let differences = [0, 1, 2].map(|axis| self.coordinate(axis).abs_diff(other.coordinate(axis)));
        differences.into_iter().map(|difference| u64::from(difference) * u64::from(difference)).sum()
    }

    /// Returns true if the photon came straight from a light.
    pub(crate) fn is_direct(self) -> bool {
        Photon::direct_of_flags(self.flags())
    }

    /// Light group of the photon's light, unless the photons are in a kd-tree.
    pub(crate) fn light_group(self) -> u8 {
        Photon::light_group_of_flags(self.flags())
    }

    /// Unit normal of the photon's surface.
    pub(crate) fn normal(self) -> Vec3 {
        Vec3::from(decode_normal(Photon::normal_of_flags(self.flags()))).normalize()
    }

    /// Class of similar directions, 0 to 15, that contains the photon's surface normal ([`normal_class`]).
    pub(crate) fn normal_class(self) -> u32 {
        normal_class(Photon::normal_of_flags(self.flags()))
    }

    /// Code of the photon's disc fraction or, in the caustic map, of the radius of its kernel.
    pub(crate) fn disc(self) -> u8 {
        Photon::disc_of_flags(self.flags())
    }

    fn flags(self) -> u16 {
        let [.., low, high] = self.content();
        u16::from_le_bytes([low, high])
    }

    /// The photon with the power of another photon added.
    #[must_use]
    pub(crate) fn with_power_of(self, other: Self) -> Self {
        let sum = Vec3::from(self.colour()) + Vec3::from(other.colour());
        // The random bits do not depend on the powers.
        self.with_colour(sum, hash(self.place as u32 ^ hash(other.place as u32)))
    }

    /// The photon with another power per channel, in the map's units. `dither` holds random bits for
    /// rounding.
    #[must_use]
    pub(crate) fn with_colour(self, colour: Vec3, dither: u32) -> Self {
        let mut content = self.content();
        let [power @ .., _, _, _, _] = &mut content;
        *power = Rgbe::encode(colour.to_array(), dither).0;
        Self { content: u64::from_le_bytes(content), ..self }
    }

    /// The photon as a node of the kd-tree that splits along `axis`.
    #[must_use]
    pub(crate) fn split_on(self, axis: usize) -> Self {
        Self { content: self.content & !AXIS_MASK | (axis as u64) << AXIS_SHIFT, ..self }
    }

    /// Record of the photon in card memory.
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
    /// Creates photons at the nearest points of a grid. `power_unit` is the power, in watts, that the stored
    /// value 1 represents.
    pub fn new(grid: PhotonGrid, power_unit: f32, photons: impl IntoIterator<Item = Photon>) -> Self {
        let list = photons.into_iter().map(|photon| StoredPhoton::new(&grid, &photon)).collect();
        Self { list, grid, power_unit }
    }

    /// Returns these photons with the first of them replaced by the first photons of `others`. `share` is the
    /// fraction to replace. Paths are numbered and independent, so that the result is as if the first paths
    /// were traced anew.
    #[must_use]
    pub fn with_replaced(&self, others: &Self, share: f64) -> Self {
        let count = ((share * self.len() as f64) as usize).min(self.len()).min(others.len());
        let list = others.list.iter().take(count).chain(self.list.iter().skip(count)).copied().collect();
        Self { list, ..*self }
    }

    /// Number of photons.
    pub fn len(&self) -> usize {
        self.list.len()
    }

    /// Returns whether there are no photons.
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Grid of the photons' positions.
    pub fn grid(&self) -> PhotonGrid {
        self.grid
    }

    /// Power, in watts, that the stored value 1 represents.
    pub fn power_unit(&self) -> f32 {
        self.power_unit
    }

    /// Photons in host format.
    pub(crate) fn stored(&self) -> &[StoredPhoton] {
        &self.list
    }

    /// Photons in host format, to be reordered.
    pub(crate) fn stored_mut(&mut self) -> &mut [StoredPhoton] {
        &mut self.list
    }

    /// Photons as they are decoded from card memory.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = Photon> {
        self.list.iter().map(|photon| Photon::read(&photon.record(&self.grid)))
    }
}
