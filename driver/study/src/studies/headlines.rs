//! Headline figures: bytes from DRAM by the number of photons, in the naive order, with exact reordering, and
//! with all techniques.

use photoncard_cards::scheduler::GatherOrder;
use photoncard_map::photon_map::PhotonLayout;

use super::super::laboratory::Results;
use super::super::measure::TileMeasurement;
use super::super::point::Point;
use super::super::report::{Block, Figure, Table, slug};
use super::super::sample::{Estimate, Ratio};
use super::super::scale::Scale;
use super::flights::{IN_CARD_MEMORY, LARGE_IN_FLIGHT, SCENES};
use super::present::{GIGA, columns, gigabytes, key, say, table, text};

/// Bytes per gather in the dissertation's naive order.
const PUBLISHED_GATHER_BYTES: f64 = 14_000.0;

/// A kind of render: its name, and its point for a scene and a number of photons.
type Line = (&'static str, fn(&Scale, &str, usize) -> Point);

const NAIVE: Line = ("naive", |scale, scene, photons| {
    scale.traffic(scene, scale.settings(GatherOrder::Naive).with(|s| s.photons.count = photons))
});
const LINES: [Line; 5] = [
    NAIVE,
    ("sort, lines, largest tiles", |scale, scene, photons| {
        let settings = scale.settings(GatherOrder::Sort).with(|s| {
            s.photons.count = photons;
            s.photons.layout = PhotonLayout::Lines;
            s.schedule.tile = Some(scale.widest_tile());
        });
        scale.traffic(scene, settings)
    }),
    ("all techniques", |scale, scene, photons| {
        scale.traffic(scene, scale.all_on().with(|s| s.photons.count = photons))
    }),
    ("all techniques, tiles in flight, large chip", |scale, scene, photons| {
        LARGE_IN_FLIGHT.point(scale, scene, scale.all_on().with(|s| s.photons.count = photons))
    }),
    ("all techniques, gathers in card memory", |scale, scene, photons| {
        IN_CARD_MEMORY.point(scale, scene, scale.all_on().with(|s| s.photons.count = photons))
    }),
];

/// Numbers of photons in the map. At the nominal scale they are the ends of the dissertation's range of 0.5
/// to 6 million.
fn photons(scale: &Scale) -> Vec<usize> {
    scale.pick(&[1, 12], &[1, 4]).iter().map(|times| times * scale.photons).collect()
}

/// A kind of render with one scene and one number of photons. They determine a point.
struct Headline {
    scene: &'static str,
    scene_name: &'static str,
    photons: usize,
    line: Line,
}

impl Headline {
    fn all(scale: &Scale) -> Vec<Self> {
        let mut all = Vec::new();
        for (scene, scene_name) in SCENES {
            for photons in photons(scale) {
                all.extend(LINES.map(|line| Self { scene, scene_name, photons, line }));
            }
        }
        all
    }

    fn point(&self, scale: &Scale) -> Point {
        let (_, point) = self.line;
        point(scale, self.scene, self.photons)
    }

    fn bytes(&self, scale: &Scale, results: &Results) -> Estimate {
        results.traffic(&self.point(scale)).dram_bytes()
    }

    /// Kilobytes of the photon map fetched per gather.
    fn gather_kilobytes(&self, scale: &Scale, results: &Results) -> Ratio {
        let measured = results.traffic(&self.point(scale));
        let kilobytes = |tile: &TileMeasurement| tile.photon_map().dram_bytes as f64 / 1e3;
        measured.ratio(kilobytes, |tile| tile.counters.gathers as f64)
    }

    /// Ratio of the bytes of the naive order to those of this render, with the same scene and number of
    /// photons.
    fn factor(&self, scale: &Scale, results: &Results) -> Ratio {
        let naive = Self { line: NAIVE, ..*self };
        if self.line.0 == NAIVE.0 {
            return Ratio::ONE;
        }
        Ratio::new(naive.bytes(scale, results), self.bytes(scale, results), 0.0)
    }
}

pub(super) fn points(scale: &Scale) -> Vec<Point> {
    Headline::all(scale).iter().map(|headline| headline.point(scale)).collect()
}

pub(super) fn blocks(scale: &Scale, results: &Results) -> Vec<Block> {
    let heads = [
        ("scene", ""),
        ("photons", ""),
        ("render", ""),
        ("from DRAM", "GB"),
        ("photon map, of a gather", "KB"),
        ("less than naive", "times"),
        ("from", "times"),
        ("to", "times"),
    ];
    let title = format!("Bytes from DRAM at {} gather rays", scale.gather_rays);
    let mut rows = Table::new(title, columns(&heads));
    for headline in Headline::all(scale) {
        let factor = headline.factor(scale, results);
        let mut row = vec![
            headline.scene_name.into(),
            headline.photons.into(),
            headline.line.0.into(),
            gigabytes(headline.bytes(scale, results)),
            headline.gather_kilobytes(scale, results).value.into(),
        ];
        row.extend([factor.value, factor.lower, factor.upper].map(Into::into));
        rows.push(row);
    }
    let published = if scale.is_nominal() {
        format!(
            " The dissertation's 11 TB/s at 30 frames/s are {} KB a gather, of maps in that range.",
            say(PUBLISHED_GATHER_BYTES / 1e3)
        )
    } else {
        String::new()
    };
    vec![
        text(format!(
            "All techniques: sort, combined sampling, irradiance cache, photons in leaves that fill a line. Renders with tiles in \
             flight are whole frames on one large chip, with a scene cache of 128 KB; those with gathers in card memory are on one \
             reference chip, and count what waits.{published}"
        )),
        table("headlines", rows),
    ]
}

pub(super) fn figures(scale: &Scale, results: &Results) -> Vec<Figure> {
    let of = |headline: &Headline| {
        let bytes = headline.bytes(scale, results).scaled(1.0 / GIGA);
        let factor = headline.factor(scale, results);
        let of_gather = headline.gather_kilobytes(scale, results);
        let figure = |quantity: &str, value: f64, unit| {
            let name = format!("scaling.{quantity}.{}.{}", slug(headline.line.0), headline.photons);
            Figure::new(name, key(headline.scene), value, unit)
        };
        [
            figure("gigabytes", bytes.value, "GB")
                .within(bytes.value - bytes.half_width, bytes.value + bytes.half_width),
            figure("factor", factor.value, "times").within(factor.lower, factor.upper),
            figure("kilobytes-a-gather", of_gather.value, "KB").within(of_gather.lower, of_gather.upper),
        ]
    };
    Headline::all(scale).iter().flat_map(of).collect()
}
