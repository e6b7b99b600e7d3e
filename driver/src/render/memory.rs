//! What card memory was read for: the key `memory` of `--stats`.

use photoncard_firmware::memory::Stage;
use photoncard_shared::address::Structure;
use serde::Serialize;

use crate::emulator::memory_model::{CacheSettings, MemoryTraffic};

/// Reads of card memory by all tiles, on all chips together. The sums do not depend on the number of chips.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct MemoryStatistics {
    /// The caches, as `--cache` takes them.
    pub caches: String,
    /// Of the photon map.
    pub photon_map: ReadStatistics,
    /// Of the scene.
    pub scene: ReadStatistics,
    /// By what was read.
    pub structures: StructureReads,
    /// By what it was read for.
    pub stages: StageReads,
    /// Bytes of the image, written into every card.
    pub written_bytes: u64,
}

/// Reads of some of card memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct ReadStatistics {
    /// Reads by chips, each within a line of card memory.
    pub requests: u64,
    /// Bytes that they asked for.
    pub raw_bytes: u64,
    /// Requests that a cache answered.
    pub line_hits: u64,
    /// Requests for which a line of a cache was fetched.
    pub line_misses: u64,
    /// Bytes fetched from DRAM.
    pub dram_bytes: u64,
}

/// Reads by structure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct StructureReads {
    /// Bounding volume hierarchy.
    pub nodes: ReadStatistics,
    /// Triangles.
    pub triangles: ReadStatistics,
    /// Materials.
    pub materials: ReadStatistics,
    /// Lights, and what chooses one: the light tree and the environment's cells.
    pub emitters: ReadStatistics,
    /// Inner nodes of a photon map that has its photons in leaves.
    pub photon_nodes: ReadStatistics,
    /// Photons.
    pub photons: ReadStatistics,
    /// Inner nodes above irradiance points.
    pub irradiance_nodes: ReadStatistics,
    /// Irradiance points.
    pub irradiance_points: ReadStatistics,
    /// Inner nodes above the photons of caustics.
    pub caustic_nodes: ReadStatistics,
    /// Photons of caustics.
    pub caustic_photons: ReadStatistics,
    /// Normals, texture coordinates and colours of triangles' corners.
    pub attributes: ReadStatistics,
    /// Textures and their texels.
    pub textures: ReadStatistics,
}

/// Reads by stage of the chip's work.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct StageReads {
    /// Rays from the eye.
    pub eye: ReadStatistics,
    /// Rays around irradiance records.
    pub survey: ReadStatistics,
    /// Gathers that tables of directions are made of.
    pub table: ReadStatistics,
    /// Shadow rays.
    pub shadow: ReadStatistics,
    /// Final gather rays.
    pub gather_ray: ReadStatistics,
    /// Photon gathers at the ends of final gather rays.
    pub gather: ReadStatistics,
    /// Gathers of photons of caustics.
    pub caustic: ReadStatistics,
}

impl MemoryStatistics {
    /// Of what was read through some caches.
    pub(super) fn new((caches, traffic): (CacheSettings, &MemoryTraffic)) -> Self {
        let of = |chosen: fn(Structure) -> bool| reads(traffic, |_, structure| chosen(structure));
        let structure = |chosen| reads(traffic, |_, structure| structure == chosen);
        let stage = |chosen| reads(traffic, |stage, _| stage == chosen);
        Self {
            caches: caches.to_string(),
            photon_map: of(Structure::is_photon_map),
            scene: of(|structure| !structure.is_photon_map()),
            structures: StructureReads {
                nodes: structure(Structure::Nodes),
                triangles: structure(Structure::Triangles),
                materials: structure(Structure::Materials),
                emitters: structure(Structure::Emitters),
                photon_nodes: structure(Structure::PhotonNodes),
                photons: structure(Structure::Photons),
                irradiance_nodes: structure(Structure::IrradianceNodes),
                irradiance_points: structure(Structure::IrradiancePoints),
                caustic_nodes: structure(Structure::CausticNodes),
                caustic_photons: structure(Structure::CausticPhotons),
                attributes: structure(Structure::Attributes),
                textures: structure(Structure::Textures),
            },
            stages: StageReads {
                eye: stage(Stage::Eye),
                survey: stage(Stage::Survey),
                table: stage(Stage::Table),
                shadow: stage(Stage::Shadow),
                gather_ray: stage(Stage::GatherRay),
                gather: stage(Stage::Gather),
                caustic: stage(Stage::Caustic),
            },
            written_bytes: traffic.requested.written_bytes,
        }
    }
}

/// The reads of tiles that are chosen by stage and structure.
fn reads(traffic: &MemoryTraffic, chosen: impl Fn(Stage, Structure) -> bool) -> ReadStatistics {
    let of_tiles = |stage: Stage, structure: Structure| stage != Stage::Begin && chosen(stage, structure);
    let requested = traffic.requested.sum(of_tiles);
    let fetched = traffic.fetched.sum(of_tiles);
    ReadStatistics {
        requests: requested.requests,
        raw_bytes: requested.bytes,
        line_hits: requested.requests - fetched.misses,
        line_misses: fetched.misses,
        dram_bytes: fetched.bytes,
    }
}
