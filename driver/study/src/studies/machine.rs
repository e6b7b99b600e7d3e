//! Study of Table 7.1 of Steinhurst's dissertation (2007): number of chips that a frame rate needs, by the
//! table's symbols and by measured counts.

use photoncard_cards::scheduler::GatherOrder;
use photoncard_map::photon_map::PhotonMapSize;
use photoncard_render::cost_model::arithmetic::Arithmetic;
use photoncard_render::cost_model::{Cost, Machine, Origin, Prediction, Resource, Symbols, Workload};

use super::super::laboratory::Results;
use super::super::load_balance::Balance;
use super::super::measure::{Measurement, TileMeasurement};
use super::super::point::Point;
use super::super::report::{self, Block, Cell, Column, Figure, Report, Table, XScale, YScale};
use super::super::scale::Scale;
use super::super::symbol_axes::SymbolAxes;
use super::arithmetic::{self, CountedFrame};
use super::balance::{CREDITS, ORDERS, chip_counts, curves, deal};
use super::present::{
    SCENES, columns, how_it_counts, key, page, panel, plot, say, section, series, table, text,
};
use super::workload::{self, cost, of_frame, tile_seconds};

/// Maximum number of chips in the plots.
const MAX_CHIPS: usize = 1024;

/// A frame of the cost model.
struct Frame {
    name: String,
    workload: Workload,
    /// Cost by Table 7.1's constants.
    cost: Cost,
    /// Counted arithmetic, and the cost computed from it; `None` for a frame of Table 7.1.
    counted: Option<(Arithmetic, Cost)>,
    /// Errors of the counts. They are zero for frames of Table 7.1, and for frames all of whose tiles were
    /// rendered.
    errors: Errors,
    map: PhotonMapSize,
    machine: Machine,
}

/// Half-widths of confidence intervals.
#[derive(Clone, Copy, Default)]
struct Errors {
    rays: f64,
    gathers: f64,
    /// Half-width of the confidence interval of the scene bytes read from DRAM.
    scene: f64,
    /// Half-width of the confidence interval of the photon map's bytes read from DRAM.
    photon_map: f64,
}

impl Errors {
    fn of(measured: &Measurement) -> Self {
        let rays = measured.total(|TileMeasurement { counters, .. }| {
            (counters.eye_rays + counters.shadow_rays + counters.gather_rays + counters.survey_rays) as f64
        });
        let estimates = [rays, measured.gathers(), measured.scene_bytes(), measured.photon_map_bytes()];
        let [rays, gathers, scene, photon_map] = estimates.map(|estimate| estimate.half_width);
        Self { rays, gathers, scene, photon_map }
    }
}

impl Frame {
    /// Prediction by Table 7.1's constants.
    fn nominal_prediction(&self) -> Prediction {
        Prediction::new(&self.workload, &self.cost, &self.machine)
    }

    /// Prediction by counted arithmetic. Frames of Table 7.1 have no counts; they are predicted by the
    /// table's constants.
    fn prediction(&self) -> Prediction {
        let cost = self.counted.as_ref().map_or(&self.cost, |(_, cost)| cost);
        Prediction::new(&self.workload, cost, &self.machine)
    }

    fn counted(&self) -> Option<CountedFrame<'_>> {
        let (arithmetic, _) = self.counted.as_ref()?;
        Some(CountedFrame { name: &self.name, workload: &self.workload, nominal: &self.cost, arithmetic })
    }
}

fn naive(scale: &Scale, scene: &'static str) -> Point {
    scale.traffic(scene, scale.settings(GatherOrder::Naive))
}

/// Point with all techniques and the largest tiles. Every tile is rendered.
fn all_on(scale: &Scale, scene: &'static str) -> Point {
    scale.whole(scene, scale.all_on())
}

/// Point with all techniques and tiles of 16x16 pixels, enough for many chips. Every tile is rendered.
fn dealt(scale: &Scale, scene: &'static str) -> Point {
    scale.whole(scene, scale.all_on_in_small_tiles())
}

pub(super) fn points(scale: &Scale) -> Vec<Point> {
    let of_scene =
        |&(scene, _): &(&'static str, _)| [naive(scale, scene), all_on(scale, scene), dealt(scale, scene)];
    SCENES.iter().flat_map(of_scene).collect()
}

/// Symbols of Table 7.1 with the scale's numbers of tiles, rays, neighbours and photons.
pub(super) fn symbols(scale: &Scale) -> Symbols {
    workload::symbols(&scale.settings(GatherOrder::Sort))
}

/// Frames with the counts of Table 7.1: one naive, one with all techniques.
fn table_frames(nominal: Symbols, machine: Machine) -> [Frame; 2] {
    let (naive_workload, all_workload) = (Workload::naive(&nominal), Workload::nominal(&nominal));
    let map = PhotonMapSize { photons: nominal.photons as u64, bytes: nominal.photon_map_bytes() as u64 };
    [
        Frame {
            name: "table, naive".to_owned(),
            cost: Cost::naive(&naive_workload, &nominal),
            workload: naive_workload,
            counted: None,
            errors: Errors::default(),
            map,
            machine,
        },
        Frame {
            name: "table, all techniques".to_owned(),
            cost: Cost::new(&all_workload, &nominal),
            workload: all_workload,
            counted: None,
            errors: Errors::default(),
            map,
            machine,
        },
    ]
}

/// Frames with measured counts. At the nominal scale, the frames of Table 7.1 precede them.
fn frames(scale: &Scale, results: &Results) -> Vec<Frame> {
    let mut frames = Vec::new();
    if scale.is_nominal() {
        frames.extend(table_frames(Symbols::NOMINAL, scale.machine));
    }
    for (scene, name) in SCENES {
        let kinds = [("naive", naive(scale, scene)), ("all techniques", all_on(scale, scene))];
        frames.extend(kinds.map(|(kind, point)| {
            let measured = results.traffic(&point);
            let symbols = workload::symbols_of(&point.settings, measured);
            let workload = of_frame(measured, symbols.pixels(), &symbols);
            let cost = cost(&workload, &symbols, point.settings.schedule.order);
            let arithmetic = arithmetic::of_frame(measured, &symbols);
            let counted = Some((arithmetic, Cost::counted(&workload, &arithmetic)));
            Frame {
                name: format!("{name}, {kind}"),
                workload,
                cost,
                counted,
                errors: Errors::of(measured),
                map: measured.map,
                machine: scale.machine,
            }
        }));
    }
    frames
}

pub(super) fn report(scale: &Scale, results: &Results) -> Report {
    let nominal = if scale.is_nominal() { "with the nominal values of table 7.1, and " } else { "" };
    let introduction = vec![
        format!(
            "How many rendering chips a frame rate takes: the cost model of chapter 7 {nominal}with what was counted in three \
             scenes, naive and with all techniques (sorted gathers, combined sampling, irradiance cache, photons in leaves that \
             fill a line)."
        ),
        how_it_counts(),
        format!(
            "A chip has {}; memory, arithmetic and the host's link ({} GB/s each way) work at the same time. FLOPs stand in two \
             columns: by the table's constants times measured counts (C_G, the FLOPs of a gather, is for 100 neighbours); and \
             counted, every addition, multiplication, division, square root and comparison that the firmware does in one lane of \
             its vectors, lanes without work left out. Additions of photons' power in fixed point and arithmetic of addresses \
             are not floating point, and not counted.",
            scale.machine,
            scale.machine.link / 1e9,
        ),
    ];
    let frames = frames(scale, results);
    let counted: Vec<_> = frames.iter().filter_map(Frame::counted).collect();
    let mut on_chips =
        vec![table("rates", rates(&frames)), table("chips", chips(&frames)), frame_rates(&frames)];
    if scale.is_nominal() {
        on_chips.push(text(discussion(&frames)));
    }
    let varied = scale.symbols.as_ref().map(|symbols| table("varied", varied(symbols, scale.machine)));
    let symbols = std::iter::once(table("symbols", symbol_table())).chain(varied).collect();
    let sections = vec![
        section("Symbols", symbols),
        section(
            "What a frame takes",
            vec![table("workloads", workloads(&frames)), table("units", units(&frames))],
        ),
        section(
            "Counted arithmetic",
            vec![
                table("arithmetic", arithmetic::comparison(&counted)),
                table("operations", arithmetic::operations(&counted)),
            ],
        ),
        section("Chips", on_chips),
        section("Load balance", load_balance(scale, results)),
    ];
    let figures = figures(&frames);
    Report { figures, ..page("Table 7.1: chips for a frame rate", introduction, sections) }
}

/// Key figures: number of chips needed for 30 frames/s by the frames with measured counts, naive and with all
/// techniques, for each scene.
fn figures(frames: &[Frame]) -> Vec<Figure> {
    let kinds = SCENES.iter().flat_map(|(scene, _)| ["naive", "all-techniques"].map(|kind| (*scene, kind)));
    let measured = frames.iter().filter(|frame| frame.counted.is_some());
    let of = |((scene, kind), frame): ((&str, &str), &Frame)| {
        let [nominal, counted] =
            [frame.nominal_prediction(), frame.prediction()].map(|p| p.chips_needed(30.0));
        [
            ("by-bandwidth", Cell::from(counted.bandwidth)),
            ("by-table", nominal.overall.into()),
            ("by-count", counted.overall.into()),
        ]
        .map(|(by, chips)| Figure::new(format!("table-7.1.chips-{by}.{kind}"), key(scene), chips, "chips"))
    };
    kinds.zip(measured).flat_map(of).collect()
}

fn symbol_table() -> Table {
    let heads =
        [("symbol", ""), ("value", ""), ("unit", ""), ("meaning", ""), ("from", ""), ("reference", "")];
    let mut table =
        Table::new("Symbols of table 7.1, with its values for a frame of 512x512 pixels", columns(&heads));
    for (symbol, value) in Symbols::NOMINAL.rows() {
        let origin = match symbol.origin {
            Origin::Table => "table 7.1",
            Origin::Published => "other publications",
            Origin::Ours => "chosen here",
        };
        table.push(vec![
            symbol.notation.into(),
            value.into(),
            symbol.unit.into(),
            symbol.description.into(),
            origin.into(),
            symbol.reference.into(),
        ]);
    }
    table
}

/// Table of the demand by the table's formulas, with a row for each combination of values and each frame.
fn varied(symbols: &SymbolAxes, machine: Machine) -> Table {
    let mut heads: Vec<_> = symbols.names().map(|name| Column::new(name, "")).collect();
    heads.extend(columns(&[
        ("frame", ""),
        ("at 30 frames/s", "TFLOPS"),
        ("at 30 frames/s", "TB/s"),
        ("by bandwidth", "chips"),
        ("by arithmetic", "chips"),
        ("overall", "chips"),
    ]));
    let mut table = Table::new("Chips for 30 frames/s by the table's formulas, with other values", heads);
    for (values, symbols) in symbols.combinations() {
        for frame in table_frames(symbols, machine) {
            let total = frame.cost.total();
            let needed = frame.nominal_prediction().chips_needed(30.0);
            let mut row: Vec<Cell> = values.iter().map(|&value| value.into()).collect();
            row.extend([
                frame.name.as_str().into(),
                (30.0 * total.flops / 1e12).into(),
                (30.0 * total.dram_bytes / 1e12).into(),
                needed.bandwidth.into(),
                needed.computation.into(),
                needed.overall.into(),
            ]);
            table.push(row);
        }
    }
    table
}

fn workloads(frames: &[Frame]) -> Table {
    let heads = [
        ("frame", ""),
        ("rays", ""),
        ("gathers", ""),
        ("tables", ""),
        ("records", ""),
        ("photons a gather", ""),
        ("interpolated", ""),
        ("N_PM", ""),
        ("photon map", "MB"),
    ];
    let mut table = Table::new("Counts of a frame, in millions but for photons a gather", columns(&heads));
    for Frame { name, workload, map, errors, .. } in frames {
        table.push(vec![
            name.as_str().into(),
            within(workload.rays(), errors.rays, 1e6),
            within(workload.gathers(), errors.gathers, 1e6),
            (workload.table_gathers / 1e6).into(),
            (workload.records / 1e6).into(),
            workload.photons_per_gather.into(),
            (workload.interpolated_samples / 1e6).into(),
            (map.photons as f64 / 1e6).into(),
            (map.bytes as f64 / 1e6).into(),
        ]);
    }
    table
}

/// Cell with a count and its error, both divided by `unit`.
fn within(value: f64, error: f64, unit: f64) -> Cell {
    if error > 0.0 { Cell::interval(value / unit, error / unit) } else { (value / unit).into() }
}

fn units(frames: &[Frame]) -> Table {
    let heads = [
        ("frame", ""),
        ("FLOPs by", ""),
        ("ray caster", "GFLOP"),
        ("controller", "GFLOP"),
        ("gather unit", "GFLOP"),
        ("scene", "GB"),
        ("photon map", "GB"),
    ];
    let mut table = Table::new(
        "FLOPs of each unit and bytes from DRAM of a frame, on all chips together",
        columns(&heads),
    );
    for Frame { name, cost, counted, errors, .. } in frames {
        let by_table = [("Table 7.1", cost)].into_iter();
        for (source, cost) in by_table.chain(counted.iter().map(|(_, cost)| ("counted", cost))) {
            table.push(vec![
                name.as_str().into(),
                source.into(),
                (cost.ray_caster.flops / 1e9).into(),
                (cost.controller.flops / 1e9).into(),
                (cost.gather_unit.flops / 1e9).into(),
                within(cost.ray_caster.dram_bytes, errors.scene, 1e9),
                within(cost.gather_unit.dram_bytes, errors.photon_map, 1e9),
            ]);
        }
    }
    table
}

fn resource(resource: Resource) -> &'static str {
    match resource {
        Resource::Bandwidth => "memory bandwidth",
        Resource::Computation => "arithmetic",
        Resource::HostLink => "host link",
    }
}

fn rates(frames: &[Frame]) -> Table {
    let heads = [
        ("frame", ""),
        ("at 30 frames/s", "TFLOPS"),
        ("at 30 frames/s", "TB/s"),
        ("counted, at 30 frames/s", "TFLOPS"),
        ("by bandwidth", "tiles/s"),
        ("by counted arithmetic", "tiles/s"),
        ("binds", ""),
    ];
    let mut table = Table::new("Demand of 30 frames/s, and tiles that one chip renders", columns(&heads));
    for frame in frames {
        let total = frame.cost.total();
        let prediction = frame.prediction();
        table.push(vec![
            frame.name.as_str().into(),
            (30.0 * total.flops / 1e12).into(),
            (30.0 * total.dram_bytes / 1e12).into(),
            frame.counted.as_ref().map(|(_, cost)| 30.0 * cost.total().flops / 1e12).into(),
            prediction.bandwidth_tiles_per_second.into(),
            prediction.computation_tiles_per_second.into(),
            resource(prediction.binding(1)).into(),
        ]);
    }
    table
}

fn chips(frames: &[Frame]) -> Table {
    let heads = [
        ("frame", ""),
        ("by bandwidth", "chips"),
        ("by arithmetic, Table 7.1", "chips"),
        ("overall, Table 7.1", "chips"),
        ("by counted arithmetic", "chips"),
        ("overall, counted", "chips"),
        ("host link's load", "%"),
    ];
    let mut table = Table::new("Chips for 30 frames/s", columns(&heads));
    for frame in frames {
        let needed = frame.nominal_prediction().chips_needed(30.0);
        let prediction = frame.prediction();
        let by_count = frame.counted.as_ref().map(|_| prediction.chips_needed(30.0));
        table.push(vec![
            frame.name.as_str().into(),
            needed.bandwidth.into(),
            needed.computation.into(),
            needed.overall.into(),
            by_count.map(|needed| needed.computation).into(),
            by_count.and_then(|needed| needed.overall).into(),
            (100.0 * prediction.link_load(30.0)).into(),
        ]);
    }
    table
}

fn frame_rates(frames: &[Frame]) -> Block {
    let line = |frame: &Frame| {
        let prediction = frame.prediction();
        let points = chip_counts(MAX_CHIPS)
            .into_iter()
            .map(|chips| report::Point::new(chips as f64, prediction.frames_per_second(chips as u64)));
        series(frame.name.as_str(), points.collect())
    };
    let axes = panel(
        "",
        ("chips", "", XScale::Log2),
        ("frames/s", "", YScale::Log10),
        frames.iter().map(line).collect(),
    );
    let caption = "As far as bandwidth, arithmetic and the host's link allow, tiles dealt without loss.";
    plot("frame-rates", "Frame rate by the number of chips", caption, vec![axes])
}

/// Paragraph that compares the dissertation's demand of naive photon mapping with measured counts.
fn discussion(frames: &[Frame]) -> String {
    let demand = |frame: &Frame| {
        let total = frame.cost.total();
        let [flops, bytes] = [total.flops, total.dram_bytes].map(|amount| say(30.0 * amount / 1e12));
        format!("{} TFLOPS and {} TB/s ({})", flops, bytes, frame.name)
    };
    let all: Vec<_> = frames.iter().filter(|frame| frame.counted.is_some()).map(demand).collect();
    format!(
        "The dissertation gives 7.4 TFLOPS and 11 TB/s for naive photon mapping at 30 frames/s, and almost two orders of \
         magnitude less bandwidth with its techniques. The table's own row meets the figures because a formula was chosen \
         that does (7.408 TFLOPS) and because B_N is derived from the 11 TB/s: it is no check. With measured counts, at \
         this study's picture size and rays: {}. A measured frame differs from the nominal one in both directions: rays \
         that leave the scene gather nothing, which lowers it; and caches here have 4 ways, an indexing and a layout that \
         the dissertation's may not have had. A frame with the irradiance cache also casts survey rays, which the table \
         does not know of.",
        all.join("; ")
    )
}

fn load_balance(scale: &Scale, results: &Results) -> Vec<Block> {
    let Machine { bandwidth, flops, .. } = scale.machine;
    let mut blocks = vec![text(format!(
        "Each tile of 16x16 pixels of a whole frame with all techniques takes max(bytes from DRAM / {} GB/s, counted FLOPs / {} GFLOPS). The \
         scheduler deals these tiles to chips whose links take no time. Speed-up is over one chip; the idle share is the \
         chips' time without work until the last is done. Longest first needs the times in advance: a bound.",
        bandwidth / 1e9,
        flops / 1e9,
    ))];
    let scenes = SCENES.map(|(scene, name)| {
        let measured = results.traffic(&dealt(scale, scene));
        (name, tile_seconds(measured, &symbols(scale), &scale.machine))
    });
    let mut add = |file: &str, title: &str, dealings: &[_], value: (&str, YScale, fn(&Balance) -> f64)| {
        let panels = scenes.iter().map(|(name, seconds)| curves(name, seconds, MAX_CHIPS, dealings, value));
        blocks.push(plot(file, title, "All techniques on; every tile measured.", panels.collect()));
    };
    let speedup: (&str, YScale, fn(&Balance) -> f64) = ("speed-up", YScale::Log10, Balance::speedup);
    let idle: (&str, YScale, fn(&Balance) -> f64) =
        ("idle share", YScale::LinearFromZero, Balance::idle_share);
    add("speed-up-credits", "Speed-up by chips and credits", &CREDITS, speedup);
    add("idle-credits", "Idle share by chips and credits", &CREDITS, idle);
    add("speed-up-orders", "Speed-up by chips and order of the tiles", &ORDERS, speedup);
    add("idle-orders", "Idle share by chips and order of the tiles", &ORDERS, idle);
    blocks.push(table("load-balance", balance_table(&scenes)));
    blocks
}

fn balance_table(scenes: &[(&str, Vec<f64>)]) -> Table {
    let heads = [
        ("scene", ""),
        ("dealing", ""),
        ("chips", ""),
        ("speed-up", ""),
        ("idle share", ""),
        ("frames/s", ""),
    ];
    let mut table = Table::new("Speed-up and idle share", columns(&heads));
    for (name, seconds) in scenes {
        for dealing in CREDITS.into_iter().chain(ORDERS.into_iter().skip(1)) {
            for chips in chip_counts(MAX_CHIPS).into_iter().step_by(2) {
                let Some(balance) = deal(seconds, chips, dealing) else { continue };
                table.push(vec![
                    (*name).into(),
                    dealing.0.into(),
                    chips.into(),
                    balance.speedup().into(),
                    balance.idle_share().into(),
                    (1.0 / balance.makespan_seconds).into(),
                ]);
            }
        }
    }
    table
}
