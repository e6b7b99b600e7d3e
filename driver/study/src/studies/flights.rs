//! Study of tiles in flight: memory traffic of frames in which the gathers of one or of several tiles wait in
//! a chip's queue at once.

use photoncard_cards::scheduler::GatherOrder;
use photoncard_firmware::kind::{LARGE, REFERENCE};
use photoncard_picture::choice::Choice;
use photoncard_render::RenderSettings;
use photoncard_render::emulator::EmulatedKind;
use photoncard_render::emulator::memory_model::{CacheSettings, CacheSpec};

use super::super::laboratory::Results;
use super::super::point::Point;
use super::super::report::{Block, Table};
use super::super::scale::Scale;
use super::present::{ATRIUM, CORNELL, GIGA, columns, gigabytes, table, text};

/// A kind of chip, its order and number of tiles in flight, and its caches.
#[derive(Clone, Copy)]
pub(super) struct Setup {
    chip: EmulatedKind,
    order: GatherOrder,
    in_flight: u32,
    /// `None` for the caches of the kind.
    caches: Option<CacheSettings>,
}

/// The reference chip with one tile in flight: it empties its gather queue at the end of each tile.
const ON_REFERENCE: Setup = Setup {
    chip: EmulatedKind::Reference,
    order: GatherOrder::Sort,
    in_flight: 1,
    caches: Some(with_scene_cache(REFERENCE.scene_cache_bytes)),
};
/// A simple and a large scene: file and name in the report.
pub(super) const SCENES: [(&str, &str); 2] = [(CORNELL, "Cornell box"), (ATRIUM, "atrium")];
/// The reference chip, whose gathers wait in card memory. Its caches take the memory that each kind of work
/// leaves free.
pub(super) const IN_CARD_MEMORY: Setup = Setup { order: GatherOrder::Buckets, caches: None, ..ON_REFERENCE };
/// The large chip with the maximum number of tiles in flight.
pub(super) const LARGE_IN_FLIGHT: Setup = Setup {
    chip: EmulatedKind::Large,
    order: GatherOrder::Sort,
    in_flight: LARGE.in_flight,
    caches: Some(with_scene_cache(LARGE.scene_cache_bytes)),
};
/// The large chip with one tile in flight.
const ON_LARGE: Setup = Setup { in_flight: 1, ..LARGE_IN_FLIGHT };

/// The nominal cache of the photon map, and a cache of the scene with a size in bytes.
const fn with_scene_cache(bytes: u32) -> CacheSettings {
    CacheSettings::Split {
        photon: CacheSpec::PHOTON,
        scene: CacheSpec { bytes, ..CacheSpec::SCENE },
        by_work: None,
    }
}

/// Setups of the published chips, or those of the scale's chip: one tile in flight, as many as it can have,
/// and gathers in card memory if it has room for their tables.
fn setups(scale: &Scale) -> Vec<Setup> {
    if scale.model.is_none() {
        return vec![ON_REFERENCE, ON_LARGE, LARGE_IN_FLIGHT, IN_CARD_MEMORY];
    }
    let budget = scale.chip().budget();
    let order = GatherOrder::Sort;
    let alone = Setup { chip: scale.chip(), order, in_flight: 1, caches: Some(scale.caches()) };
    let several = (budget.in_flight > 1).then_some(Setup { in_flight: budget.in_flight, ..alone });
    let waiting = Setup { order: GatherOrder::Buckets, ..alone };
    let waiting = (budget.waiting_blocks > 0).then_some(waiting);
    std::iter::once(alone).chain(several).chain(waiting).collect()
}

impl Setup {
    /// Point that renders the frame with this setup: a sample of the tiles if none waits for another.
    pub(super) fn point(self, scale: &Scale, scene: &str, settings: RenderSettings) -> Point {
        let settings =
            settings.with(|s| (s.schedule.in_flight, s.schedule.order) = (Some(self.in_flight), self.order));
        scale.on_chip(scene, settings, self.chip, self.caches.unwrap_or_else(|| self.chip.caches()))
    }
}

fn naive(scale: &Scale, scene: &str) -> Point {
    scale.traffic(scene, scale.settings(GatherOrder::Naive))
}

pub(super) fn points(scale: &Scale) -> Vec<Point> {
    let of_scene = |(scene, _): (&str, _)| {
        let setups = setups(scale).into_iter().map(|setup| setup.point(scale, scene, scale.all_on()));
        std::iter::once(naive(scale, scene)).chain(setups).collect::<Vec<_>>()
    };
    SCENES.into_iter().flat_map(of_scene).collect()
}

pub(super) fn blocks(scale: &Scale, results: &Results) -> Vec<Block> {
    let heads = [
        ("scene", ""),
        ("chip", ""),
        ("order", ""),
        ("on-chip memory", "KB"),
        ("tiles in flight", ""),
        ("gather queue", ""),
        ("drains", ""),
        ("photon map from DRAM", "GB"),
        ("scene from DRAM", "GB"),
        ("waiting, read and written", "GB"),
        ("photon map: less than naive", "times"),
        ("all: less than naive", "times"),
    ];
    let title = format!("All techniques at {} gather rays", scale.gather_rays);
    let mut rows = Table::new(title, columns(&heads));
    for (scene, name) in SCENES {
        let naive = results.traffic(&naive(scale, scene));
        for setup in setups(scale) {
            let measured = results.traffic(&setup.point(scale, scene, scale.all_on()));
            let bytes = [measured.photon_map_bytes(), measured.scene_bytes(), measured.dram_bytes()];
            let [map, of_scene, all] = bytes.map(|estimate| estimate.value);
            let budget = setup.chip.budget();
            rows.push(vec![
                name.into(),
                setup.chip.name().into(),
                setup.order.name().into(),
                (budget.sram_bytes >> 10).into(),
                setup.in_flight.into(),
                budget.gather_queue.into(),
                measured.total(|tile| tile.counters.drains as f64).value.into(),
                gigabytes(bytes[0]),
                gigabytes(bytes[1]),
                ((all - map - of_scene) / GIGA).into(),
                (naive.photon_map_bytes().value / map).into(),
                (naive.dram_bytes().value / all).into(),
            ]);
        }
    }
    vec![
        text(
            "With one tile in flight a chip drains its queue at the end of every tile, however few gathers wait; with several, when \
             the queue is full. With the order buckets gathers wait in card memory, and caches take the memory that casting rays and \
             doing gathers leave free. A frame with several tiles that wait is rendered as a whole, on one chip; the others are sampled.",
        ),
        table("tiles-in-flight", rows),
    ]
}
