//! Study of tiles in flight: memory traffic of whole frames, in which the gathers of one or of several tiles
//! wait in a chip's queue at once.

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
use super::present::{GIGA, SCENES, columns, table, text};

/// A kind of chip, its number of tiles in flight, and its caches.
#[derive(Clone, Copy)]
pub(super) struct Setup {
    chip: EmulatedKind,
    in_flight: u32,
    caches: CacheSettings,
}

/// The reference chip with one tile in flight: it empties its gather queue at the end of each tile.
const ON_REFERENCE: Setup = Setup {
    chip: EmulatedKind::Reference,
    in_flight: 1,
    caches: with_scene_cache(REFERENCE.scene_cache_bytes),
};
/// The large chip with the maximum number of tiles in flight.
pub(super) const LARGE_IN_FLIGHT: Setup = Setup {
    chip: EmulatedKind::Large,
    in_flight: LARGE.in_flight,
    caches: with_scene_cache(LARGE.scene_cache_bytes),
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

/// Setups of the published chips, or those of the scale's chip: one tile in flight, and as many as it can
/// have.
fn setups(scale: &Scale) -> Vec<Setup> {
    if scale.model.is_none() {
        return vec![ON_REFERENCE, ON_LARGE, LARGE_IN_FLIGHT];
    }
    let alone = Setup { chip: scale.chip(), in_flight: 1, caches: scale.caches() };
    let most = scale.chip().budget().in_flight;
    let several = (most > 1).then_some(Setup { in_flight: most, ..alone });
    std::iter::once(alone).chain(several).collect()
}

impl Setup {
    /// Point that renders all tiles of the frame with this setup.
    pub(super) fn point(self, scale: &Scale, scene: &str, settings: RenderSettings) -> Point {
        let settings = settings.with(|s| s.schedule.in_flight = Some(self.in_flight));
        scale.on_one_chip(scene, settings, self.chip, self.caches)
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
        ("on-chip memory", "KB"),
        ("tiles in flight", ""),
        ("gather queue", ""),
        ("drains", ""),
        ("photon map from DRAM", "GB"),
        ("scene from DRAM", "GB"),
        ("photon map: less than naive", "times"),
        ("both: less than naive", "times"),
    ];
    let title = format!("All techniques at {} gather rays, whole frames", scale.gather_rays);
    let mut rows = Table::new(title, columns(&heads));
    for (scene, name) in SCENES {
        let naive = results.traffic(&naive(scale, scene));
        for setup in setups(scale) {
            let measured = results.traffic(&setup.point(scale, scene, scale.all_on()));
            let [map, of_scene, both] =
                [measured.photon_map_bytes(), measured.scene_bytes(), measured.dram_bytes()]
                    .map(|estimate| estimate.value);
            let budget = setup.chip.budget();
            rows.push(vec![
                name.into(),
                setup.chip.name().into(),
                (budget.sram_bytes >> 10).into(),
                setup.in_flight.into(),
                budget.gather_queue.into(),
                measured.total(|tile| tile.counters.drains as f64).value.into(),
                (map / GIGA).into(),
                (of_scene / GIGA).into(),
                (naive.photon_map_bytes().value / map).into(),
                (naive.dram_bytes().value / both).into(),
            ]);
        }
    }
    vec![
        text(
            "With one tile in flight a chip drains its queue at the end of every tile, however few gathers wait; with several, when \
             the queue is full. A frame with several tiles in flight is rendered as a whole, on one chip.",
        ),
        table("tiles-in-flight", rows),
    ]
}
