//! A complete card image, and what may be added to it.

use glam::Vec3;
use photoncard_firmware::memory::Lines;
use photoncard_firmware::scene::SceneImage;
use photoncard_shared::address::{LINE_BYTES, Line};
use photoncard_shared::image::{HEADER_LINES, Header, Section, SectionKind};
use photoncard_shared::layout::{NodeBox, Photon, PhotonLeaf, Record};

use super::lines::append;
use super::{PackError, root_box};
use crate::photon::leaves::PhotonTree;
use crate::photon::map::{balance, for_each_in_heap};
use crate::photon::stored::StoredPhoton;
use crate::photon::{Photons, search_radius};

/// The sections of the photon map, irradiance points among them.
pub(super) const PHOTON_SECTIONS: [SectionKind; 7] = [
    SectionKind::Photons,
    SectionKind::PhotonNodes,
    SectionKind::PhotonLeaves,
    SectionKind::CausticNodes,
    SectionKind::CausticLeaves,
    SectionKind::IrradianceNodes,
    SectionKind::IrradianceLeaves,
];

pub(super) const CAUSTIC_SECTIONS: [SectionKind; 2] = [SectionKind::CausticNodes, SectionKind::CausticLeaves];
const IRRADIANCE_SECTIONS: [SectionKind; 2] = [SectionKind::IrradianceNodes, SectionKind::IrradianceLeaves];

/// A complete card image.
pub struct CardImage {
    pub(super) lines: Vec<Line>,
}

impl CardImage {
    /// All lines, the header first.
    pub fn lines(&self) -> &[Line] {
        &self.lines
    }

    /// The image as a chip sees it.
    pub fn view(&self) -> (SceneImage, Lines<'_>) {
        // `with_photons` wrote this header.
        let head = self.lines.first_chunk().unwrap_or_else(|| unreachable!("it begins with a header"));
        let header = Header::read(head).unwrap_or_else(|error| unreachable!("own header: {error:?}"));
        (SceneImage { header }, Lines(&self.lines))
    }

    /// The diagonal of the box around the scene, metres.
    pub fn diagonal(&self) -> f32 {
        let (scene, mut memory) = self.view();
        root_box(&scene, &mut memory)
            .map_or(1.0, |NodeBox { lower, upper }| Vec3::from(upper).distance(Vec3::from(lower)))
    }

    /// The same image with its photons in a left-balanced tree instead of leaves, and without irradiance points. It finds the
    /// same photons.
    ///
    /// # Errors
    /// If there are more lines than an address can tell.
    pub fn with_photon_tree(self) -> Result<Self, PackError> {
        let (SceneImage { mut header }, _) = self.view();
        let mut photons = self.stored_photons();
        if photons.is_empty() {
            return Ok(self);
        }
        let mut lines = self.lines;
        // The last sections, the last first.
        for kind in PHOTON_SECTIONS.into_iter().rev() {
            let section = std::mem::take(&mut header.sections[kind as usize]);
            if section.records > 0 {
                lines.truncate(section.first_line as usize);
            }
        }
        let first_line = lines.len();
        let all_lines = first_line + photons.len().div_ceil(Photon::PER_LINE);
        let too_large = |_| PackError::TooLarge { bytes: all_lines as u64 * LINE_BYTES as u64 };
        header.lines = u32::try_from(all_lines).map_err(too_large)?;
        // No more photons than lines of leaves could hold.
        let records = photons.len() as u32;
        header.sections[SectionKind::Photons as usize] = Section { first_line: first_line as u32, records };
        balance(&mut photons);
        lines.reserve_exact(all_lines - first_line);
        lines.resize(all_lines, Line::ZERO);
        for_each_in_heap(&photons, &mut |place, photon| {
            let line = &mut lines[first_line + place / Photon::PER_LINE];
            if let Some(record) = line.record_mut(place % Photon::PER_LINE) {
                *record = photon.record(&header.photon_grid);
            }
        });
        lines[..HEADER_LINES].copy_from_slice(&header.to_lines());
        Ok(Self { lines })
    }

    /// The photons of the leaves.
    fn stored_photons(&self) -> Vec<StoredPhoton> {
        let leaves =
            || self.leaf_lines(SectionKind::PhotonLeaves).iter().map(|line| PhotonLeaf::read(&line.0));
        let mut photons = Vec::with_capacity(leaves().map(|leaf| leaf.photons() as usize).sum());
        for leaf in leaves() {
            photons.extend((0..leaf.photons()).map(|i| StoredPhoton::at(leaf.point(i), leaf.content(i))));
        }
        photons
    }

    /// The lines of a section of leaves.
    pub(crate) fn leaf_lines(&self, kind: SectionKind) -> &[Line] {
        let (SceneImage { header }, _) = self.view();
        let section = header.section(kind);
        &self.lines[section.first_line as usize..][..section.records as usize]
    }

    /// The same, to be changed in place.
    pub(crate) fn leaf_lines_mut(&mut self) -> &mut [Line] {
        let (SceneImage { header }, _) = self.view();
        let section = header.section(SectionKind::PhotonLeaves);
        &mut self.lines[section.first_line as usize..][..section.records as usize]
    }

    /// The same image with a caustic map, for searches of about so many neighbours.
    ///
    /// # Errors
    /// If there are more lines than an address can tell.
    pub(crate) fn with_caustics(self, photons: Photons, neighbors: u32) -> Result<Self, PackError> {
        let (SceneImage { mut header }, _) = self.view();
        header.caustic_power_unit = photons.power_unit();
        let radius = search_radius(&photons, neighbors);
        let Photons { mut list, .. } = photons;
        self.with_trees(header, PhotonTree::new(&mut list, radius).as_ref(), CAUSTIC_SECTIONS)
    }

    /// The same image with irradiance points.
    ///
    /// # Errors
    /// If there are more lines than an address can tell.
    pub(crate) fn with_irradiance(self, points: &PhotonTree) -> Result<Self, PackError> {
        let (SceneImage { header }, _) = self.view();
        self.with_trees(header, Some(points), IRRADIANCE_SECTIONS)
    }

    /// The same image with another tree, or with none.
    fn with_trees(
        self,
        mut header: Header,
        tree: Option<&PhotonTree>,
        [nodes, leaves]: [SectionKind; 2],
    ) -> Result<Self, PackError> {
        let mut lines = self.lines;
        if let Some(tree) = tree {
            append(&mut lines, &mut header.sections, nodes, tree.nodes())?;
            append(&mut lines, &mut header.sections, leaves, tree.leaves())?;
        }
        // `append` has checked that the number of lines fits.
        header.lines = lines.len() as u32;
        lines[..HEADER_LINES].copy_from_slice(&header.to_lines());
        Ok(Self { lines })
    }

    /// Bytes of the image.
    pub fn bytes(&self) -> u64 {
        self.lines.len() as u64 * LINE_BYTES as u64
    }
}
