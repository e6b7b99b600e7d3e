//! Writes photons and irradiance points as sections of a card image: leaves, and the nodes above them.

use photoncard_shared::image::SectionKind;

use super::kernels::reach;
use super::leaves::PhotonTree;
use super::radius::typical_radius;
use crate::pack::{CardImage, ImageWriter, PackError, PackedScene};
use crate::photon::Photons;

/// Sections of the photon map, including irradiance points. They are the last sections of a card image.
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

/// Adds photons to the card image of a scene, in leaves, for searches of about `neighbors` photons.
///
/// # Errors
/// [`PackError::TooLarge`] if there are more lines than an address can number.
pub fn store_photons(
    packed: PackedScene,
    mut photons: Photons,
    neighbors: u32,
) -> Result<CardImage, PackError> {
    let mut image = ImageWriter::resume(packed.into_image());
    image.set_photons(photons.grid(), photons.power_unit());
    let radius = typical_radius(&photons, neighbors);
    if let Some(tree) = PhotonTree::new(photons.stored_mut(), radius) {
        append_tree(&mut image, [SectionKind::PhotonNodes, SectionKind::PhotonLeaves], &tree)?;
    }
    Ok(image.finish())
}

/// Adds a caustic map to a card image. The radius codes of `photons` must be set already. The greatest
/// possible code stands for the radius `greatest`, metres.
///
/// # Errors
/// As [`store_photons`].
pub(super) fn store_caustics(
    image: CardImage,
    mut photons: Photons,
    greatest: f32,
) -> Result<CardImage, PackError> {
    let mut image = ImageWriter::resume(image);
    image.set_caustic_power_unit(photons.power_unit());
    let greatest = greatest / photons.grid().cell;
    if let Some(tree) = PhotonTree::of_discs(photons.stored_mut(), &|photon| reach(photon, greatest)) {
        append_tree(&mut image, CAUSTIC_SECTIONS, &tree)?;
    }
    Ok(image.finish())
}

/// Adds irradiance points to a card image.
///
/// # Errors
/// As [`store_photons`].
pub(super) fn store_irradiance(image: CardImage, points: &PhotonTree) -> Result<CardImage, PackError> {
    let mut image = ImageWriter::resume(image);
    append_tree(&mut image, [SectionKind::IrradianceNodes, SectionKind::IrradianceLeaves], points)?;
    Ok(image.finish())
}

fn append_tree(
    image: &mut ImageWriter,
    [nodes, leaves]: [SectionKind; 2],
    tree: &PhotonTree,
) -> Result<(), PackError> {
    image.append(nodes, tree.nodes())?;
    image.append(leaves, tree.leaves())
}
