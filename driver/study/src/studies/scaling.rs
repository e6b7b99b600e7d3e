//! Study of traffic as a function of the number of photons, the side of tiles, the size of the queue and the
//! number of tiles in flight; and of time as a function of the number of chips.

use photoncard_cards::scheduler::GatherOrder;
use photoncard_map::photon_map::PhotonLayout;
use photoncard_render::RenderSettings;

use super::super::laboratory::Results;
use super::super::load_balance::Balance;
use super::super::point::Point;
use super::super::report::{Block, Column, Report, Table, XScale, YScale};
use super::super::scale::Scale;
use super::balance::{CREDITS, chip_counts, curves, deal};
use super::machine::symbols;
use super::present::{
    CORNELL, columns, gigabyte_point, gigabytes, how_it_counts, page, panel, plot, section, series, table,
    text,
};
use super::workload::tile_seconds;
use super::{flights, headlines};

/// A line of a plot: its name and its settings. A sweep varies one of the settings.
type Line = (&'static str, fn(&Scale) -> RenderSettings);

const NAIVE: Line = ("naive", |scale| scale.settings(GatherOrder::Naive));
const HASH: Line = ("hash", |scale| scale.settings(GatherOrder::Hash));
const SORT: Line = ("sort", |scale| scale.settings(GatherOrder::Sort));
const SORT_LINES: Line = ("sort, lines", |scale| {
    scale.settings(GatherOrder::Sort).with(|s| s.photons.layout = PhotonLayout::Lines)
});
const ALL_ON: Line = ("all techniques", Scale::all_on);

/// A setting that is varied, and the lines measured over its values.
struct Sweep {
    /// Name of the sweep's files, without extension.
    name: &'static str,
    heading: &'static str,
    axis: &'static str,
    lines: &'static [Line],
    values: fn(&Scale) -> Vec<u32>,
    set: fn(&mut RenderSettings, u32),
}

const SWEEPS: [Sweep; 3] = [
    Sweep {
        name: "photons",
        heading: "Photons",
        axis: "photons in the map",
        lines: &[NAIVE, SORT, ALL_ON],
        values: |scale| scale.pick(&[1, 4, 12], &[1, 4]).iter().map(|n| n * scale.photons as u32).collect(),
        set: |settings, photons| settings.photons.count = photons as usize,
    },
    Sweep {
        name: "tile-side",
        heading: "Side of a tile",
        axis: "side of a tile (pixels)",
        lines: &[SORT, SORT_LINES, ALL_ON],
        values: |scale| powers(8, scale.widest_tile()),
        set: |settings, side| settings.schedule.tile = Some(side),
    },
    Sweep {
        name: "queue",
        heading: "Size of the queue",
        axis: "gathers that may wait on a chip",
        lines: &[HASH, SORT, SORT_LINES],
        values: |scale| powers(256, scale.chip().budget().gather_queue).into_iter().step_by(2).collect(),
        set: |settings, queue| settings.schedule.queue = Some(queue),
    },
];

/// Products of `least` and powers of two, up to `most`.
fn powers(least: u32, most: u32) -> Vec<u32> {
    std::iter::successors(Some(least), |value| value.checked_mul(2))
        .take_while(|&value| value <= most)
        .collect()
}

impl Sweep {
    fn point(&self, scale: &Scale, (_, line): Line, value: u32) -> Point {
        let mut settings = line(scale);
        (self.set)(&mut settings, value);
        scale.traffic(CORNELL, settings)
    }

    fn blocks(&self, scale: &Scale, results: &Results) -> Vec<Block> {
        let title = format!("Photon map from DRAM by {}", self.axis);
        let values = (self.values)(scale);
        let bytes = |line, value| results.traffic(&self.point(scale, line, value)).photon_map_bytes();
        let mut heads = vec![Column::new(self.axis, "")];
        heads.extend(self.lines.iter().map(|(name, _)| Column::new(*name, "GB")));
        let mut rows = Table::new(title.as_str(), heads);
        for &value in &values {
            let mut row = vec![value.into()];
            row.extend(self.lines.iter().map(|&line| gigabytes(bytes(line, value))));
            rows.push(row);
        }
        let lines = self.lines.iter().map(|&line| {
            let points = values.iter().map(|&value| gigabyte_point(f64::from(value), bytes(line, value)));
            series(line.0, points.collect())
        });
        let x = (self.axis, "", XScale::Log2);
        let axes = panel("", x, ("photon map from DRAM", "GB a frame", YScale::Log10), lines.collect());
        let caption = format!(
            "Cornell box, caches {}. All techniques: sort, combined sampling, irradiance cache, photons in leaves that fill a line.",
            scale.caches()
        );
        vec![plot(self.name, &title, &caption, vec![axes]), table(self.name, rows)]
    }
}

fn chips_point(scale: &Scale) -> Point {
    scale.whole(CORNELL, scale.all_on_in_small_tiles())
}

pub(super) fn points(scale: &Scale) -> Vec<Point> {
    let mut points = Vec::new();
    for sweep in &SWEEPS {
        for value in (sweep.values)(scale) {
            points.extend(sweep.lines.iter().map(|&line| sweep.point(scale, line, value)));
        }
    }
    points.push(chips_point(scale));
    points.extend(flights::points(scale));
    points.extend(headlines::points(scale));
    points
}

pub(super) fn report(scale: &Scale, results: &Results) -> Report {
    let introduction = vec![
        "How the memory traffic of the photon map in the Cornell box follows the number of photons, the side of tiles and the \
         size of the queue that reorders gathers, and how time follows the number of chips."
            .to_owned(),
        how_it_counts(),
    ];
    let mut sections: Vec<_> =
        SWEEPS.iter().map(|sweep| section(sweep.heading, sweep.blocks(scale, results))).collect();
    sections.push(section("Headlines by photons", headlines::blocks(scale, results)));
    sections.push(section("Tiles in flight", flights::blocks(scale, results)));
    sections.push(section("Chips", chips(scale, results)));
    Report { figures: headlines::figures(scale, results), ..page("Scaling", introduction, sections) }
}

/// Maximum number of chips in the plot.
const MAX_CHIPS: usize = 64;

fn chips(scale: &Scale, results: &Results) -> Vec<Block> {
    let measured = results.traffic(&chips_point(scale));
    let seconds = tile_seconds(measured, &symbols(scale), &scale.machine);
    let speedup = ("speed-up", YScale::Log10, Balance::speedup as fn(&Balance) -> f64);
    let axes = curves("", &seconds, MAX_CHIPS, &CREDITS, speedup);
    let heads =
        [("chips", ""), ("speed-up", ""), ("idle share", ""), ("photon map from DRAM, all chips", "GB")];
    let mut rows = Table::new("Chips, one credit each, tiles in the picture's order", columns(&heads));
    for count in chip_counts(MAX_CHIPS) {
        let Some(balance) = deal(&seconds, count, CREDITS[0]) else { continue };
        rows.push(vec![
            count.into(),
            balance.speedup().into(),
            balance.idle_share().into(),
            gigabytes(measured.photon_map_bytes()),
        ]);
    }
    vec![
        text(format!(
            "What a tile takes does not depend on the chip that renders it: a tile begins with empty caches, and no chip needs \
             another. So the traffic of all chips together is the same, to the byte, for any number of them, and only the time \
             changes. Every tile of a frame with all techniques was measured and takes as long as its bytes or its arithmetic \
             take a chip of {}.",
            scale.machine,
        )),
        plot(
            "chips",
            "Speed-up by the number of chips",
            "Cornell box, all techniques on, links take no time.",
            vec![axes],
        ),
        table("chips", rows),
    ]
}
