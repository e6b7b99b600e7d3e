//! Packing: converts a scene to the sections of a card image.
//!
//! A [`PackedScene`] holds the hierarchy, triangles, materials and lights. The photon pass
//! ([`crate::photon`]) traces in it with the chip's ray caster, so that photons lie on exactly the surfaces
//! that gather rays hit. [`crate::photon_map`] adds the sections of the photon map.

use std::sync::Arc;

use glam::Vec3;
use photoncard_firmware::memory::Lines;
use photoncard_firmware::scene::SceneImage;
use photoncard_picture::allocation::{self, OutOfMemory};
use photoncard_picture::cryptomatte::Identities;
use photoncard_scene::Scene;
use photoncard_shared::image::{Header, SectionKind};
use photoncard_shared::layout::{
    self, DistantLight, LEAF_TRIANGLES, NodeBox, PhotonGrid, Record, power_of_two_above,
};
use photoncard_shared::message::SumScale;

use crate::bvh::{self, Content, Finishes, LeafTriangles};
use crate::detail;
use crate::light::{Lights, Sources};

mod card_image;
mod corners;
mod error;
mod flat_glass;
mod identities;
mod materials;
mod textures;
mod writer;

pub use self::card_image::CardImage;
use self::corners::PackedCorners;
pub use self::error::PackError;
use self::flat_glass::Glazing;
use self::identities::Identified;
pub(crate) use self::writer::ImageWriter;
pub use crate::light::SourceRadiance;

/// Memory that packing takes per triangle, bytes: mainly binary trees, without the scene itself.
const BYTES_OF_A_TRIANGLE: u64 = 400;

/// Card image of a scene before photons are added, and the sources of photons.
#[derive(Clone)]
pub struct PackedScene {
    image: CardImage,
    /// Names of the image's identities; `None` for an image without identities.
    identities: Option<Arc<Identities>>,
    /// Part of the scene in which photons are stored; `None` if it is the whole scene.
    detailed_part: Option<[Vec3; 2]>,
    sources: Sources,
    aimed_sources: Option<Sources>,
    caustic_sources: Option<Sources>,
    keeps_photons: bool,
    has_lobes_under_punctual_lights: bool,
}

impl PackedScene {
    /// Packs geometry, materials, textures and lights.
    ///
    /// # Errors
    /// If the geometry exceeds a chip's limits or this process's memory, or there are more textures or lights
    /// than a chip can index.
    pub fn new(scene: &Scene) -> Result<Self, PackError> {
        Self::of_content(scene, false)
    }

    /// Packs the scene as [`Self::new`] does, with the identities of its triangles: numbers of pairs of
    /// object and material.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn with_identities(scene: &Scene) -> Result<Self, PackError> {
        Self::of_content(scene, true)
    }

    fn of_content(scene: &Scene, has_identities: bool) -> Result<Self, PackError> {
        let groups = scene.expanded_groups();
        let expands = groups.contains(&true);
        let triangles = scene.stored_if_expanded(&groups);
        bvh::check_number(triangles)?;
        allocation::check(BYTES_OF_A_TRIANGLE * triangles as u64)
            .map_err(|OutOfMemory { bytes }| PackError::Memory { triangles, bytes })?;
        let expanded = expands.then(|| scene.expanded(&groups));
        let scene = expanded.as_ref().unwrap_or(scene);
        let part = detail::detailed_part(scene);
        let split = part.map(|part| detail::split_around(scene, part));
        let scene = split.as_ref().unwrap_or(scene);
        let lights = Lights::new(scene);
        let identified = has_identities.then(|| Identified::new(scene));
        let image = write(scene, &lights, identified.as_ref())?;
        let keeps_photons = materials::keep_photons(scene, image.view());
        Ok(Self {
            image,
            identities: identified.map(|identified| Arc::new(identified.names)),
            detailed_part: part,
            sources: Sources::new(scene, &lights, part),
            aimed_sources: Sources::aimed(scene, &lights, part),
            caustic_sources: Sources::of_caustics(scene, &lights, part),
            keeps_photons,
            has_lobes_under_punctual_lights: !scene.lights.is_empty()
                && scene.materials.iter().any(|material| scene.has_narrow_lobe(material)),
        })
    }

    /// Returns the scene, without photons, as a chip reads it: header and lines.
    pub fn view(&self) -> (SceneImage, Lines<'_>) {
        self.image.view()
    }

    /// Names of the image's identities; `None` for an image without identities.
    pub fn identities(&self) -> Option<Arc<Identities>> {
        self.identities.clone()
    }

    /// Card image without photons.
    pub(crate) fn image(&self) -> &CardImage {
        &self.image
    }

    /// Converts to the card image, to which the photon map's sections can be added.
    pub(crate) fn into_image(self) -> CardImage {
        self.image
    }

    /// Grid of photon positions. It is the finest grid that covers the scene or, if all detail is in a small
    /// part of the scene, this part and its surroundings.
    pub fn photon_grid(&self) -> PhotonGrid {
        let part = self.detailed_part.map(|corners| corners.map(|corner| corner.to_array()));
        let whole = || self.image.bounds().map(|NodeBox { lower, upper }| [lower, upper]);
        part.or_else(whole).map_or(PhotonGrid::UNIT, |[lower, upper]| PhotonGrid::around(lower, upper))
    }

    /// Returns whether photons are stored at a position, metres.
    pub(crate) fn stores_photons_at(&self, position: Vec3) -> bool {
        self.detailed_part.is_none_or(|[lower, upper]| position.clamp(lower, upper) == position)
    }

    /// Units of radiance and depth in the sums of pixels.
    pub fn sum_scale(&self) -> SumScale {
        SumScale { depth: self.photon_grid().cell, ..self.view().0.header.sum_scale() }
    }

    /// Sources of photons that are not aimed.
    pub(crate) fn sources(&self) -> &Sources {
        &self.sources
    }

    /// Sources of photons that are aimed at surfaces other than lamps; `None` if there are no such surfaces.
    pub(crate) fn aimed_sources(&self) -> Option<&Sources> {
        self.aimed_sources.as_ref()
    }

    /// Sources of caustic photons, which are aimed at specular surfaces; `None` if there are no such
    /// surfaces.
    pub(crate) fn caustic_sources(&self) -> Option<&Sources> {
        self.caustic_sources.as_ref()
    }

    /// Radiance of the lights whose caustics the scene can show, weighted by their power towards its specular
    /// surfaces. Infinite with point, spot and distant lights, which no gather ray can hit; `None` without
    /// caustics.
    pub fn radiance_of_caustics(&self) -> Option<SourceRadiance> {
        if self.has_lobes_under_punctual_lights {
            return Some(SourceRadiance { mean: f64::INFINITY, greatest: f64::INFINITY });
        }
        self.caustic_sources.as_ref().map(|sources| sources.radiance)
    }

    /// Returns whether any surface stores photons.
    pub(crate) fn keeps_photons(&self) -> bool {
        self.keeps_photons
    }

    /// Returns whether the scene has both materials with narrow lobes and punctual lights. Only the caustic
    /// map shows reflections of these lights by narrow lobes.
    pub(crate) fn has_lobes_under_punctual_lights(&self) -> bool {
        self.has_lobes_under_punctual_lights
    }
}

/// Writes a card image with the sections of a scene, and with identities if they are given.
fn write(scene: &Scene, lights: &Lights, identified: Option<&Identified>) -> Result<CardImage, PackError> {
    let uncovered = scene.uncovered_materials();
    let glazing = Glazing::new(scene);
    let flat_glass = glazing.is_flat(scene);
    let passed = scene.materials.iter().map(|material| !material.visibility.is_whole());
    let passed: Vec<bool> =
        uncovered.iter().zip(passed).map(|(uncovered, passed)| uncovered | passed).collect();
    let cut_out = glazing.of_materials(&passed);
    let content =
        Content { triangles: &glazing.triangles, groups: &scene.groups, instances: &scene.instances };
    let hierarchy = bvh::build(content, Finishes { cut_out: &cut_out, flat_glass: &flat_glass })?;
    let corners = PackedCorners::new(scene, lights, (&hierarchy.leaf_triangles, &uncovered));
    let textures = textures::records(scene, lights.environment())?;
    let indices = indices_in_image(scene, &hierarchy.leaf_triangles);
    let identities = identified.map_or(Vec::new(), |identified| identified.values(scene, &hierarchy));
    let texel_lines = textures::lines(scene, lights.environment());
    let attribute_lines = corners.records.len().div_ceil(layout::Attributes::PER_LINE);
    // The other sections fit in the lines that are allocated for photons.
    let large = [hierarchy.nodes.len(), hierarchy.leaves.len(), attribute_lines, texel_lines];
    let mut image = ImageWriter::new(header(scene, lights), large.into_iter().sum());
    image.append(SectionKind::Nodes, hierarchy.nodes.into_iter())?;
    image.append(SectionKind::Triangles, hierarchy.leaves.into_iter())?;
    image.append(SectionKind::LeafAttributes, corners.leaves.iter().map(|entry| entry.to_le_bytes()))?;
    image.append(SectionKind::Attributes, corners.records.into_iter())?;
    let materials = glazing.records(materials::records(scene, lights, &uncovered));
    image.append(SectionKind::Materials, materials.iter().map(layout::Material::to_bytes))?;
    image.append(SectionKind::Layers, materials::layers(scene).into_iter())?;
    image.append(SectionKind::Textures, textures.iter().map(layout::Texture::to_bytes))?;
    textures::write(scene, lights.environment(), image.append_zeroed(SectionKind::Texels, texel_lines)?);
    let index_in_image = |triangle: usize| indices.get(triangle).copied().unwrap_or(0);
    image.append(SectionKind::Emitters, lights.emitters(index_in_image).map(|emitter| emitter.to_bytes()))?;
    image.append(SectionKind::LightNodes, lights.nodes())?;
    image.append(SectionKind::DistantLights, lights.distant().iter().map(DistantLight::to_bytes))?;
    let cells = lights.cell_thresholds();
    image.append(SectionKind::EnvironmentCells, cells.iter().map(|threshold| threshold.to_le_bytes()))?;
    image.append(SectionKind::Identities, identities.iter().map(|value| value.to_le_bytes()))?;
    Ok(image.finish())
}

/// Creates the header of a scene without photons, with the fields `radiance_unit`, `reach` (the maximum
/// magnitude of a coordinate, metres) and `lights`. [`ImageWriter`] sets `lines` and `sections`.
fn header(scene: &Scene, lights: &Lights) -> Header {
    let (lower, upper) = scene.bounds();
    Header {
        radiance_unit: radiance_unit(scene, lights),
        reach: lower.abs().max(upper.abs()).max_element(),
        lights: lights.header(scene.textures.len() as u32),
        ..Header::EMPTY
    }
}

/// Index in the card image of each triangle of the scene, from the triangles of the image's leaves.
fn indices_in_image(scene: &Scene, leaves: &[LeafTriangles]) -> Vec<u32> {
    let mut indices = vec![0; scene.triangles.len()];
    for (leaf, triangles) in leaves.iter().enumerate() {
        for (slot, &triangle) in triangles.iter().enumerate() {
            // Triangles of groups follow those of the scene. `bvh` has checked that indices fit.
            if let Some(index) = indices.get_mut(triangle as usize) {
                *index = (leaf * LEAF_TRIANGLES + slot) as u32;
            }
        }
    }
    indices
}

/// Unit of the chips' fixed-point sums of radiance, which have 23 bits above the unit and 40 below.
///
/// The unit is 2^4 times a typical radiance: the radiance of all surfaces if the emitted power were spread
/// over them and reflected once by white. A much brighter emitter or environment texel raises the unit, such
/// that its own radiance is within 2^7 units. A pixel has at most 2^12 samples, so that their mean can be up
/// to 2^11 units: 2^15 times the typical radiance, or 2^4 times the brightest. The margin above the brightest
/// radiance is for shadow rays next to an emitter, which can contribute a thousand times as much.
fn radiance_unit(scene: &Scene, lights: &Lights) -> f32 {
    let typical = lights.power() / (std::f64::consts::PI * scene.area().max(f64::MIN_POSITIVE));
    let environment = lights.environment().map_or(0.0, |environment| environment.brightest);
    let brightest = scene.materials.iter().map(|m| m.emission.max_element()).fold(environment, f32::max);
    power_of_two_above((16.0 * typical).max(f64::from(brightest) / 128.0))
}
