//! Statistics of reads from card memory, which are a part of the statistics of a render.

use photoncard_firmware::memory::Stage;
use photoncard_shared::address::Structure;
use serde::Serialize;

use crate::emulator::memory_model::{CacheSettings, MemoryTraffic};

/// Reads of card memory by all tiles, summed over all chips. The sums do not depend on the number of chips.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct MemoryStatistics {
    /// Caches, in the text form of [`CacheSettings`].
    pub caches: String,
    /// Reads of the photon map.
    pub photon_map: ReadStatistics,
    /// Reads of the scene.
    pub scene: ReadStatistics,
    /// Reads of what waits in card memory: gathers, their results, and blocks.
    pub waiting: ReadStatistics,
    /// Reads by kind of data structure in card memory.
    pub structures: StructureReads,
    /// Reads by stage of the chip's work.
    pub stages: StageReads,
    /// Bytes written into card memory: card images, and those of `tile_written_bytes`.
    pub written_bytes: u64,
    /// Bytes written for tiles: kept irradiance records, and gathers, results and blocks that wait.
    pub tile_written_bytes: u64,
}

/// Reads of a part of card memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct ReadStatistics {
    /// Number of reads requested by chips, each within one line of card memory.
    pub requests: u64,
    /// Number of bytes that chips requested.
    pub raw_bytes: u64,
    /// Number of requests that hit a cache.
    pub line_hits: u64,
    /// Number of requests for which a cache line was fetched.
    pub line_misses: u64,
    /// Number of bytes fetched from DRAM.
    pub dram_bytes: u64,
}

/// Reads by kind of data structure in card memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct StructureReads {
    /// Reads of the bounding volume hierarchy.
    pub nodes: ReadStatistics,
    /// Reads of triangles.
    pub triangles: ReadStatistics,
    /// Reads of materials.
    pub materials: ReadStatistics,
    /// Reads of the light tree, lights, and the environment's cells.
    pub emitters: ReadStatistics,
    /// Reads of inner nodes of a photon map in the line layout.
    pub photon_nodes: ReadStatistics,
    /// Reads of photons.
    pub photons: ReadStatistics,
    /// Reads of inner nodes of the hierarchy over irradiance points.
    pub irradiance_nodes: ReadStatistics,
    /// Reads of irradiance points.
    pub irradiance_points: ReadStatistics,
    /// Reads of inner nodes of the caustic map.
    pub caustic_nodes: ReadStatistics,
    /// Reads of photons of the caustic map.
    pub caustic_photons: ReadStatistics,
    /// Reads of vertex attributes: normals, texture coordinates and colours.
    pub attributes: ReadStatistics,
    /// Reads of textures and their texels.
    pub textures: ReadStatistics,
    /// Reads of gathers, results and blocks that wait in card memory.
    pub waiting: ReadStatistics,
}

/// Reads by stage of the chip's work.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct StageReads {
    /// Reads by eye rays.
    pub eye: ReadStatistics,
    /// Reads by rays that survey the surroundings of irradiance records.
    pub survey: ReadStatistics,
    /// Reads by photon gathers for importance tables.
    pub table: ReadStatistics,
    /// Reads by shadow rays.
    pub shadow: ReadStatistics,
    /// Reads by final gather rays.
    pub gather_ray: ReadStatistics,
    /// Reads by photon gathers at the ends of final gather rays.
    pub gather: ReadStatistics,
    /// Reads by gathers in the caustic map.
    pub caustic: ReadStatistics,
}

impl MemoryStatistics {
    /// Statistics of the traffic through these caches.
    pub(super) fn new((caches, traffic): (CacheSettings, &MemoryTraffic)) -> Self {
        let of = |chosen: fn(Structure) -> bool| reads(traffic, |_, structure| chosen(structure));
        let structure = |chosen| reads(traffic, |_, structure| structure == chosen);
        let stage = |chosen| reads(traffic, |stage, _| stage == chosen);
        Self {
            caches: caches.to_string(),
            photon_map: of(Structure::is_photon_map),
            scene: of(Structure::is_scene),
            waiting: structure(Structure::Waiting),
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
                waiting: structure(Structure::Waiting),
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
            written_bytes: traffic.requested.written_bytes(|_| true),
            tile_written_bytes: traffic.requested.written_bytes(|structure| structure != Structure::Header),
        }
    }
}

/// Sum of the reads for tiles whose stage and structure `chosen` selects.
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
