//! What a render took: the keys of `--stats`.

use photoncard_shared::message::FrameParameters;
use serde::Serialize;

use super::executor::Outcome;
use super::preparation::Prepared;
use super::times::Times;
use super::{MemoryStatistics, RenderSettings};
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

impl Statistics {
    /// Statistics of a finished render.
    pub(super) fn new(
        settings: &RenderSettings,
        frame: &FrameParameters,
        prepared: &Prepared,
        outcome: &Outcome,
        time_s: Times,
    ) -> Self {
        let counters = &outcome.counters;
        Self {
            width: frame.width,
            height: frame.height,
            samples: frame.samples,
            photons: settings.photons.count as u64,
            photon_paths: prepared.paths,
            max_distance: frame.max_distance,
            cards: outcome.cards,
            cards_given_up: outcome.cards_given_up,
            verified_tiles: outcome.tiles.verified,
            repeated_tiles: outcome.tiles.repeated,
            revoked_tiles: outcome.tiles.revoked,
            time_s,
            rays: Rays {
                eye: counters.eye_rays,
                shadow: counters.shadow_rays,
                gather: counters.gather_rays,
                survey: counters.survey_rays,
                specular: counters.specular_rays,
            },
            lost_paths: counters.lost_paths,
            caustic_gathers: counters.caustic_gathers,
            gathers: counters.gathers,
            tables: counters.tables,
            records: counters.records,
            interpolated_share: counters.interpolated_samples as f64
                / counters.lambertian_samples.max(1) as f64,
            photons_tested: counters.photons_tested,
            photons_taken: counters.photons_taken,
            photons_selected: counters.photons_selected,
            photons_found: counters.photons_found,
            lookups: counters.lookups,
            points_tested: counters.points_tested,
            drains: counters.drains,
            most_waiting: counters.most_waiting,
            flops: Flops::counted(counters, frame.gather_rays),
            image_bytes: prepared.image.bytes(),
            link: LinkStatistics {
                payload_bytes: outcome.bytes.payload,
                wire_bytes: outcome.bytes.wire,
                retransmitted_frames: outcome.bytes.line.repeated,
                damaged_frames: outcome.bytes.line.damaged,
                duplicate_frames: outcome.bytes.line.duplicates,
                probes: outcome.bytes.line.probes,
                resets: outcome.bytes.resets,
            },
            memory: settings.modelled_caches().zip(outcome.traffic.as_ref()).map(MemoryStatistics::new),
            peak_memory_bytes: peak_memory_bytes(),
        }
    }
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
fn peak_memory_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kilobytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kilobytes << 10)
}
