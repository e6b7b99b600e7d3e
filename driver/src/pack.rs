//! The card image: everything a chip needs of a scene, in lines.
//!
//! It grows in two steps. A [`PackedScene`] holds hierarchy, triangles, materials and emitters; the photon pass traces
//! in it with the chip's own ray caster, so that photons land on exactly the surfaces that gather rays meet. With a
//! photon map it becomes a [`CardImage`].

use photoncard_firmware::memory::Lines;
use photoncard_firmware::scene::SceneImage;
use photoncard_shared::address::{LINE_BYTES, Line};
use photoncard_shared::image::{self, HEADER_LINES, Header, SECTIONS, Section, SectionKind};
use photoncard_shared::layout::{
    self, BvhNode, DistantLight, LEAF_TRIANGLES, NodeBox, PhotonGrid, WideNode, power_of_two_above,
};

use crate::allocation::{self, OutOfMemory};
use crate::bvh::{self, HierarchyError, LeafTriangles};
use crate::light::{Lights, Sources};
use crate::photon::leaves::PhotonTree;
use crate::photon::{Photons, search_radius};
use crate::scene::Scene;

mod budget;
mod card_image;
mod corners;
mod lines;
mod materials;
mod textures;

pub use self::card_image::CardImage;
use self::corners::PackedCorners;
use self::lines::append;

/// Bytes of memory that packing takes for a triangle beside the scene: binary trees, most of all.
const BYTES_OF_A_TRIANGLE: u64 = 700;

/// Textures that materials can tell apart.
const MOST_TEXTURES: usize = layout::NO_TEXTURE as usize;

/// Why a scene does not fit a card.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum PackError {
    /// The hierarchy is not one for a chip.
    #[error(transparent)]
    #[diagnostic(help("simplify the scene's geometry"))]
    Hierarchy(#[from] HierarchyError),
    /// The process cannot have the memory for packing.
    #[error("packing {triangles} triangles takes {bytes} bytes of memory, which the system does not give")]
    #[diagnostic(help("simplify the scene's geometry, or {}", allocation::REMEDY))]
    Memory {
        /// Triangles of the scene.
        triangles: usize,
        /// Bytes of memory.
        bytes: u64,
    },
    /// The image has more lines than an address can tell.
    #[error("the card image takes {bytes} bytes, more than a card's addresses reach")]
    #[diagnostic(help("lower --photons, use smaller textures, or simplify the scene"))]
    TooLarge {
        /// Bytes of the image.
        bytes: u64,
    },
    /// More textures than a material can tell.
    #[error("the scene has {textures} textures; a card tells {MOST_TEXTURES} apart")]
    #[diagnostic(help("join textures of the same image and sampler, or split the scene"))]
    TooManyTextures {
        /// Textures of the scene.
        textures: usize,
    },
    /// The image is larger than the card's memory.
    #[error(
        "the card image takes {needed} bytes ({photons} of them photons), the card's DRAM budget is {available} bytes"
    )]
    #[diagnostic(help("{remedy}"))]
    Dram {
        /// Bytes of the image.
        needed: u64,
        /// Bytes of the photon map alone.
        photons: u64,
        /// Bytes of the card's DRAM.
        available: u64,
        /// What to lower, and how far.
        remedy: String,
    },
}

/// The scene in lines, without photons.
pub struct PackedScene {
    lines: Vec<Line>,
    sections: [Section; SECTIONS],
    radiance_unit: f32,
    lights: image::Lights,
    sources: Sources,
    aimed_sources: Option<Sources>,
    keeps_photons: bool,
}

impl PackedScene {
    /// Packs geometry, materials, textures and lights.
    ///
    /// # Errors
    /// If the geometry is too much for a chip or for this process, or there are more textures or lights than a chip can tell apart.
    pub fn new(scene: &Scene) -> Result<Self, PackError> {
        allocation::check(BYTES_OF_A_TRIANGLE * scene.triangles.len() as u64)
            .map_err(|OutOfMemory { bytes }| PackError::Memory { triangles: scene.triangles.len(), bytes })?;
        let lights = Lights::new(scene);
        let cut_out: Vec<bool> =
            scene.materials.iter().map(|material| material.alpha_cutoff.is_some()).collect();
        let hierarchy = bvh::build(&scene.triangles, &cut_out)?;
        let corners = PackedCorners::new(scene, &lights, &hierarchy.leaf_triangles);
        let textures = textures::records(scene, lights.environment())?;
        let places = places_in_image(scene, &hierarchy.leaf_triangles);
        let mut packed = Self {
            // The first are the header's.
            lines: vec![Line::ZERO; HEADER_LINES],
            sections: [Section::default(); SECTIONS],
            radiance_unit: radiance_unit(scene, &lights),
            lights: lights.header(scene.textures.len() as u32),
            sources: Sources::new(scene, &lights),
            aimed_sources: Sources::aimed(scene, &lights),
            keeps_photons: scene.keeps_photons(),
        };
        packed.append(SectionKind::Nodes, hierarchy.nodes.into_iter())?;
        packed.append(SectionKind::Triangles, hierarchy.leaves.into_iter())?;
        packed.append(SectionKind::LeafAttributes, corners.leaves.iter().map(|entry| entry.to_le_bytes()))?;
        packed.append(SectionKind::Attributes, corners.records.iter().map(layout::Attributes::to_bytes))?;
        packed.append(SectionKind::Materials, materials::records(scene, &lights))?;
        packed.append(SectionKind::Textures, textures.iter().map(layout::Texture::to_bytes))?;
        packed.append_lines(SectionKind::Texels, textures::lines(scene, lights.environment()))?;
        let place = |triangle: usize| places.get(triangle).copied().unwrap_or(0);
        packed.append(SectionKind::Emitters, lights.emitters(place).map(|emitter| emitter.to_bytes()))?;
        packed.append(SectionKind::LightNodes, lights.nodes())?;
        packed.append(SectionKind::DistantLights, lights.distant().iter().map(DistantLight::to_bytes))?;
        let cells = lights.cell_thresholds();
        packed
            .append(SectionKind::EnvironmentCells, cells.iter().map(|threshold| threshold.to_le_bytes()))?;
        Ok(packed)
    }

    fn append<const N: usize>(
        &mut self,
        kind: SectionKind,
        records: impl ExactSizeIterator<Item = [u8; N]>,
    ) -> Result<(), PackError> {
        append(&mut self.lines, &mut self.sections, kind, records)
    }

    /// Appends whole lines, as they are made.
    fn append_lines(
        &mut self,
        kind: SectionKind,
        lines: impl Iterator<Item = Line>,
    ) -> Result<(), PackError> {
        let first = self.lines.len();
        self.lines.extend(lines);
        let too_large = |_| PackError::TooLarge { bytes: self.lines.len() as u64 * LINE_BYTES as u64 };
        let [first_line, end] = [first, self.lines.len()].map(u32::try_from);
        let first_line = first_line.map_err(too_large)?;
        self.sections[kind as usize] = Section { first_line, records: end.map_err(too_large)? - first_line };
        Ok(())
    }

    fn header(&self, photon_power_unit: f32, photon_grid: PhotonGrid) -> Header {
        Header {
            // `append` has checked that the number of lines fits.
            lines: self.lines.len() as u32,
            photon_power_unit,
            caustic_power_unit: 1.0,
            radiance_unit: self.radiance_unit,
            photon_grid,
            lights: self.lights,
            sections: self.sections,
        }
    }

    /// The scene as a chip sees it, without photons.
    pub fn view(&self) -> (SceneImage, Lines<'_>) {
        (SceneImage { header: self.header(1.0, PhotonGrid::UNIT) }, Lines(&self.lines))
    }

    /// The grid for photons' positions: the finest that holds the scene.
    pub fn photon_grid(&self) -> PhotonGrid {
        let (scene, mut memory) = self.view();
        root_box(&scene, &mut memory)
            .map_or(PhotonGrid::UNIT, |NodeBox { lower, upper }| PhotonGrid::around(lower, upper))
    }

    /// Where photons come from.
    pub(crate) fn sources(&self) -> &Sources {
        &self.sources
    }

    /// Where photons of caustics come from, aimed at what is perfectly specular; `None` if nothing is.
    pub(crate) fn aimed_sources(&self) -> Option<&Sources> {
        self.aimed_sources.as_ref()
    }

    /// Whether there is any surface that photons are stored at.
    pub(crate) fn keeps_photons(&self) -> bool {
        self.keeps_photons
    }

    /// Bytes of the scene's lines.
    pub fn bytes(&self) -> u64 {
        self.lines.len() as u64 * LINE_BYTES as u64
    }

    /// Adds the photon map, in leaves, for searches of about so many neighbours.
    ///
    /// # Errors
    /// If there are more lines than an address can tell.
    pub fn with_photons(mut self, photons: Photons, neighbors: u32) -> Result<CardImage, PackError> {
        let radius = search_radius(&photons, neighbors);
        let Photons { mut list, grid, power_unit } = photons;
        if let Some(tree) = PhotonTree::new(&mut list, radius) {
            self.append(SectionKind::PhotonNodes, tree.nodes())?;
            self.append(SectionKind::PhotonLeaves, tree.leaves())?;
        }
        let header = self.header(power_unit, grid).to_lines();
        self.lines[..HEADER_LINES].copy_from_slice(&header);
        Ok(CardImage { lines: self.lines })
    }
}

/// Where each triangle of a scene is in the card image whose leaves hold these.
fn places_in_image(scene: &Scene, leaves: &[LeafTriangles]) -> Vec<u32> {
    let mut places = vec![0; scene.triangles.len()];
    for (leaf, triangles) in leaves.iter().enumerate() {
        for (slot, &triangle) in triangles.iter().enumerate() {
            // The hierarchy has few enough.
            places[triangle as usize] = (leaf * LEAF_TRIANGLES + slot) as u32;
        }
    }
    places
}

/// The box around a scene, and little more.
fn root_box(scene: &SceneImage, memory: &mut Lines) -> Option<NodeBox> {
    let line = scene.line(memory, SectionKind::Nodes, 0, 0..LINE_BYTES as u32).ok()?;
    let children = 0..WideNode(line).children() as usize;
    children.filter_map(|child| BvhNode(line).bounds(child)).reduce(NodeBox::union)
}

/// Fixed-point sums of radiance hold 23 bits above the unit and 40 below.
///
/// The unit is the radiance that all surfaces would have if the emitted power were spread over them, once reflected by
/// white: a typical one. A much brighter emitter or texel of the environment raises it, so that its own radiance is within
/// 2^12 units: shadow rays next to an emitter may bring a thousand times as much.
fn radiance_unit(scene: &Scene, lights: &Lights) -> f32 {
    let area: f64 = scene.triangles.iter().map(|triangle| triangle.area() as f64).sum();
    let typical = lights.power() / (std::f64::consts::PI * area.max(f64::MIN_POSITIVE));
    let environment = lights.environment().map_or(0.0, |environment| environment.brightest);
    let brightest = scene.materials.iter().map(|m| m.emission.max_element()).fold(environment, f32::max);
    power_of_two_above(typical.max(f64::from(brightest) / f64::from(1 << 12)))
}
