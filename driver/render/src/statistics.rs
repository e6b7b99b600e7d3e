//! Statistics of a render. The names of the fields are the keys of the JSON file.

use photoncard_cards::session::LinkBytes;
use photoncard_map::photon_map::Guiding;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{LEAF_PHOTONS, Photon, PhotonLeaf, Record};
use photoncard_shared::message::FrameParameters;
use serde::Serialize;

use super::work::{Outcome, Prepared, Times};
use super::{MemoryStatistics, Provenance, RenderSettings};
use crate::cost_model::Flops;

/// Name that stands for an earlier render in a list of cards, if tiles were taken over from its file.
pub const EARLIER_RENDER: &str = "an earlier render";

/// Contents of the statistics file. The keys are stable.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Statistics {
    /// Everything that the render depended on.
    pub provenance: Provenance,
    /// Width of the whole picture, pixels.
    pub width: u32,
    /// Height of the whole picture, pixels.
    pub height: u32,
    /// Number of samples per pixel.
    pub samples: u32,
    /// Number of photons in the map.
    pub photons: u64,
    /// Number of light paths traced for the photons.
    pub photon_paths: u64,
    /// Guiding of the photon paths to the camera; absent if photons are for any camera.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub photon_guiding: Option<Guiding>,
    /// Maximum distance of a gather, metres.
    pub max_distance: f32,
    /// Number of cards, one chip each.
    pub cards: usize,
    /// Number of cards that were given up, left out because of their budget, or never answered the greeting.
    pub cards_given_up: usize,
    /// Number of tiles that two cards rendered with equal pixels.
    pub verified_tiles: usize,
    /// Number of tiles that were rendered again, for verification or because another card took too long. The
    /// other counts include such a tile once.
    pub repeated_tiles: usize,
    /// Number of dazzling tiles that no second card verified, including tiles kept from an earlier render.
    /// Their light is far above that of the scene's surfaces.
    pub dazzling_tiles: usize,
    /// Names of the cards that rendered the [`dazzling_tiles`](Self::dazzling_tiles). [`EARLIER_RENDER`]
    /// stands for an earlier render.
    #[serde(skip)]
    pub dazzling_cards: Vec<String>,
    /// Number of tiles rendered again because their card was outvoted or sent wrong messages. The other
    /// counts include such a tile once.
    pub revoked_tiles: usize,
    /// Time of each phase, seconds, over all passes. The counts are of the last pass.
    pub time_s: Times,
    /// Number of rays cast on the chips.
    pub rays: Rays,
    /// Number of paths that contribute nothing, because they exceeded the limit of specular bounces or hit a
    /// surface that absorbs all light.
    pub lost_paths: u64,
    /// Number of searches of the caustic map.
    pub caustic_gathers: u64,
    /// Number of searches of the photon map.
    pub gathers: u64,
    /// Number of photon searches for importance tables, included in `gathers`.
    pub tables: u64,
    /// Number of irradiance records gathered. A record that two tiles use counts twice.
    pub records: u64,
    /// Number of irradiance records reused from an earlier pass.
    pub kept_records: u64,
    /// Number of samples with interpolated irradiance, divided by the number of samples that see a surface
    /// with a Lambertian part.
    pub interpolated_share: f64,
    /// Number of photons whose distance was computed.
    pub photons_tested: u64,
    /// Number of photons that became candidates of a search.
    pub photons_taken: u64,
    /// Number of candidates read while the k nearest were selected.
    pub photons_selected: u64,
    /// Number of photons that searches returned.
    pub photons_found: u64,
    /// Number of searches for the nearest irradiance point.
    pub lookups: u64,
    /// Number of irradiance points whose distance was computed.
    pub points_tested: u64,
    /// Number of times that a chip's queue of gathers was drained.
    pub drains: u64,
    /// Maximum number of gathers that waited at the same time on any chip.
    pub most_waiting: u64,
    /// Processor cycles of the boards' work on tiles, over all cards; absent without a board that counts
    /// them. The clock rate is in the card's hello (`photoncard card info`).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cycles: Option<u64>,
    /// Floating-point operations of the counted work, by the constants of the dissertation's Table 7.1
    /// (`docs/scaling.md`). Searches for irradiance points are not included.
    pub flops: Flops,
    /// Size of the card image, bytes.
    pub image_bytes: u64,
    /// Bytes transferred over all links.
    pub link: LinkStatistics,
    /// Reads of card memory; absent if memory is not modelled.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub memory: Option<MemoryStatistics>,
    /// Maximum resident memory of the process, bytes; absent if the system does not report it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub peak_memory_bytes: Option<u64>,
}

impl Statistics {
    /// Statistics of a render that has finished or failed.
    pub(super) fn new(
        settings: &RenderSettings,
        frame: &FrameParameters,
        prepared: &Prepared,
        outcome: &Outcome,
        time_s: Times,
        provenance: Provenance,
    ) -> Self {
        let counters = &outcome.counters;
        Self {
            provenance,
            width: frame.width,
            height: frame.height,
            samples: settings.integrator.samples,
            photons: photons(settings.photons.count as u64, prepared),
            photon_paths: prepared.paths,
            photon_guiding: prepared.guiding,
            max_distance: frame.max_distance,
            cards: outcome.cards,
            cards_given_up: outcome.cards_given_up,
            verified_tiles: outcome.tiles.verified,
            repeated_tiles: outcome.tiles.repeated,
            dazzling_tiles: outcome.dazzling.iter().map(|(_, tiles)| tiles).sum(),
            dazzling_cards: outcome.dazzling.iter().map(|(card, _)| card.clone()).collect(),
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
            kept_records: counters.kept_records,
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
            cycles: (counters.cycles > 0).then_some(counters.cycles),
            flops: Flops::by_table(counters, frame.gather_rays),
            image_bytes: prepared.image.bytes(),
            link: LinkStatistics::new(&outcome.links),
            memory: settings.modelled_caches().zip(outcome.traffic.as_ref()).map(MemoryStatistics::new),
            peak_memory_bytes: peak_memory_bytes(),
        }
    }
}

/// Number of photons in the map of a card image. If the leaves and nodes have room for the requested number
/// `count`, it is `count`. Otherwise the photons in them are counted.
fn photons(count: u64, prepared: &Prepared) -> u64 {
    let leaves = prepared.image.section(SectionKind::PhotonLeaves);
    let nodes = prepared.image.section(SectionKind::Photons).len() * Photon::PER_LINE;
    let room = leaves.len() * LEAF_PHOTONS + nodes;
    if room as u64 >= count {
        return count;
    }
    let in_leaves: u64 = leaves.iter().map(|line| u64::from(PhotonLeaf::read(&line.0).photons())).sum();
    in_leaves + nodes as u64
}

/// Numbers of rays by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Rays {
    /// Number of eye rays: two per path in pixels with gather rays, one per path in other pixels, further
    /// ones for surfaces seen by specular reflection or refraction, and one per visited lattice point of the
    /// irradiance cache.
    pub eye: u64,
    /// Number of shadow rays.
    pub shadow: u64,
    /// Number of final gather rays.
    pub gather: u64,
    /// Number of rays that survey the surroundings of irradiance records.
    pub survey: u64,
    /// Number of rays that continue eye, gather or survey rays after specular reflection or refraction.
    pub specular: u64,
}

/// Statistics of the links to all cards.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LinkStatistics {
    /// Bytes of card image lines sent to each card. Only lines that the card lacked are sent.
    pub image_bytes: Vec<u64>,
    /// Bytes of card image lines sent to cards and of pixels received from them, over all links.
    pub payload_bytes: u64,
    /// Total number of bytes in both directions.
    pub wire_bytes: u64,
    /// Number of frames sent more than once.
    pub retransmitted_frames: u64,
    /// Number of damaged frames received from cards.
    pub damaged_frames: u64,
    /// Number of duplicate frames received from cards.
    pub duplicate_frames: u64,
    /// Number of probes sent to silent cards.
    pub probes: u64,
    /// Number of times that a card was greeted again.
    pub resets: u64,
}

impl LinkStatistics {
    fn new(links: &[LinkBytes]) -> Self {
        let mut sum = LinkBytes::default();
        links.iter().for_each(|link| sum.add(link));
        Self {
            image_bytes: links.iter().map(|link| link.image).collect(),
            payload_bytes: sum.payload,
            wire_bytes: sum.wire,
            retransmitted_frames: sum.line.repeated,
            damaged_frames: sum.line.damaged,
            duplicate_frames: sum.line.duplicates,
            probes: sum.line.probes,
            resets: sum.resets,
        }
    }
}

/// Peak resident memory of the process, bytes, from `/proc`.
fn peak_memory_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kilobytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kilobytes << 10)
}
