//! What a render took: the keys of `--stats`.

use serde::Serialize;

use super::MemoryStatistics;
use crate::cost_model::Flops;

/// The contents of the statistics file. Keys are stable.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Statistics {
    /// Pixels in a row of the whole picture.
    pub width: u32,
    /// Rows of the whole picture.
    pub height: u32,
    /// Samples a pixel.
    pub samples: u32,
    /// Photons in the map.
    pub photons: u64,
    /// Paths traced from the lights for them.
    pub photon_paths: u64,
    /// Greatest distance of a gather, metres.
    pub max_distance: f32,
    /// Cards, one chip each.
    pub cards: usize,
    /// Cards that were given up, or have never said hello.
    pub cards_given_up: usize,
    /// Tiles that two cards have rendered alike.
    pub verified_tiles: usize,
    /// Tiles that were rendered once more, to verify them or as another card took too long: no other number counts them.
    pub repeated_tiles: usize,
    /// Tiles that were rendered again, as their card has lied: counted once.
    pub revoked_tiles: usize,
    /// Seconds of each phase.
    pub time_s: Times,
    /// Rays cast on the chips.
    pub rays: Rays,
    /// Paths that met more perfectly specular surfaces than are followed, or one that takes everything: they bring nothing.
    pub lost_paths: u64,
    /// Searches of the caustic map.
    pub caustic_gathers: u64,
    /// Searches of the photon map.
    pub gathers: u64,
    /// Those of them that made a table of directions.
    pub tables: u64,
    /// Irradiance records gathered; one that two tiles use counts twice.
    pub records: u64,
    /// Of the samples that see a surface with a Lambertian part, the share whose irradiance was interpolated.
    pub interpolated_share: f64,
    /// Photons whose distance was computed.
    pub photons_tested: u64,
    /// Photons that were near enough to become candidates of a search.
    pub photons_taken: u64,
    /// Candidates that selections of the nearest went through.
    pub photons_selected: u64,
    /// Photons that the searches returned.
    pub photons_found: u64,
    /// Searches for the nearest irradiance point.
    pub lookups: u64,
    /// Irradiance points whose distance was computed.
    pub points_tested: u64,
    /// Times that waiting gathers were taken out of a chip's queue.
    pub drains: u64,
    /// The most gathers that waited at once, on any chip.
    pub most_waiting: u64,
    /// Floating-point operations that the cost model of `docs/scaling.md` counts for the work; it has no lookups of
    /// irradiance, and counts none.
    pub flops: Flops,
    /// Bytes of the card image.
    pub image_bytes: u64,
    /// Bytes over all links.
    pub link: LinkStatistics,
    /// Reads of card memory; absent where none is modelled.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub memory: Option<MemoryStatistics>,
    /// The most memory the process has held, bytes; absent where the system does not tell.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub peak_memory_bytes: Option<u64>,
}

/// Seconds of each phase.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Times {
    /// Reading the scene file.
    pub scene: f64,
    /// Tracing photons.
    pub photons: f64,
    /// Building hierarchy, photon map and card image.
    pub pack: f64,
    /// Of these, the hierarchy and the other parts of the scene.
    pub hierarchy: f64,
    /// Of these, the photon map.
    pub photon_map: f64,
    /// Of these, how far gathers look, and how much of the discs around photons is surface.
    pub discs: f64,
    /// Of these, irradiance at photons, if it is precomputed.
    pub irradiance: f64,
    /// Loading the slowest card.
    pub load: f64,
    /// Rendering, after the last card was loaded.
    pub render: f64,
    /// All of it.
    pub total: f64,
}

/// Rays by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Rays {
    /// From the eye: twice to each sample, with the irradiance cache thrice, and to points of its lattice.
    pub eye: u64,
    /// Towards emitters.
    pub shadow: u64,
    /// Final gather rays.
    pub gather: u64,
    /// Around irradiance records.
    pub survey: u64,
    /// From perfectly specular surfaces, on the way of any of these but shadow rays.
    pub specular: u64,
}

/// Bytes over all links.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct LinkStatistics {
    /// Image lines and pixels.
    pub payload_bytes: u64,
    /// All bytes in both directions.
    pub wire_bytes: u64,
    /// Frames sent more than once.
    pub retransmitted_frames: u64,
    /// Frames of cards that came damaged.
    pub damaged_frames: u64,
    /// Frames of cards that came again.
    pub duplicate_frames: u64,
    /// Times that a silent card was asked what has come.
    pub probes: u64,
    /// Times that a card was greeted again.
    pub resets: u64,
}

/// The process's peak resident memory, where `/proc` tells.
pub(super) fn peak_memory_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kilobytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kilobytes << 10)
}
