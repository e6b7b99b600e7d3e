//! Study of interactive frames: time and bytes that each part of the system needs while the camera or lights
//! move.

use photoncard_render::RenderSettings;
use photoncard_render::cost_model::{Cost, Distribution, Machine, Prediction, Symbols};

use super::super::error::StudyError;
use super::super::host::{Change, HostBench, HostFrame, LIGHT_STEP};
use super::super::laboratory::Results;
use super::super::point::Point;
use super::super::report::{self, Block, Report, Table, XScale, YScale};
use super::super::sample::SampleRate;
use super::super::scale::Scale;
use super::balance::chip_counts;
use super::present::{SCENES, columns, how_it_counts, page, panel, plot, say, section, series, table, text};
use super::workload::{self, of_frame};
use super::{arithmetic, times};

/// Frame rate that the study aims at, frames per second.
const RATE: f64 = 30.0;
/// Maximum number of chips in the plots.
const MAX_CHIPS: usize = 64;
/// Numbers of chips in the table of uploads.
const CHIPS: [u64; 3] = [3, 16, 64];
/// Numbers of photons of the frames, as multiples of the scale's number.
const PHOTONS: [usize; 3] = [1, 4, 12];
/// Fractions of the photons that are traced anew.
const SHARES: [f64; 4] = [0.001, 0.01, 0.1, 1.0];
/// Fraction of the tiles that is measured for a chip's time.
const SAMPLE: SampleRate = match SampleRate::new(1, 16) {
    Some(sample) => sample,
    None => SampleRate::ALL,
};
/// Minimum number of tiles that are measured for a chip's time.
const MIN_TILES: usize = 4;

/// A frame with one scene and one number of photons: its scale and its names.
struct Frame {
    scale: Scale,
    file: &'static str,
    scene: &'static str,
    /// True if the frame has the first number of photons, at which changes are measured.
    is_first: bool,
}

impl Frame {
    fn all(scale: &Scale) -> Vec<Self> {
        let counts = scale.pick(&PHOTONS, &PHOTONS[..2]);
        let of_scene = |(file, scene): (&'static str, &'static str)| {
            let frame = move |factor: usize| {
                let scale = Scale {
                    photons: factor * scale.photons,
                    sample: SAMPLE,
                    least_tiles: MIN_TILES,
                    ..scale.clone()
                };
                Self { scale, file, scene, is_first: factor == PHOTONS[0] }
            };
            counts.clone().into_iter().map(frame).collect::<Vec<_>>()
        };
        SCENES.into_iter().flat_map(of_scene).collect()
    }

    fn settings(&self) -> RenderSettings {
        self.scale.all_on()
    }

    fn point(&self) -> Point {
        self.scale.traffic(self.file, self.settings())
    }

    fn name(&self) -> String {
        format!("{}, {} million photons", self.scene, say(self.scale.photons as f64 / 1e6))
    }

    /// Changes that are measured for the frame.
    fn changes(&self) -> Vec<Change> {
        if !self.is_first {
            return Vec::new();
        }
        [Change::Dimmed, Change::Moved].into_iter().chain(SHARES.map(Change::Replaced)).collect()
    }

    fn picture_bytes(&self) -> f64 {
        f64::from(self.scale.side) * f64::from(self.scale.side) * Symbols::NOMINAL.pixel_bytes
    }
}

pub(super) fn points(scale: &Scale) -> Vec<Point> {
    Frame::all(scale).iter().map(Frame::point).collect()
}

pub(super) fn host_frames(scale: &Scale, bench: &mut HostBench) -> Result<Vec<HostFrame>, StudyError> {
    let measure = |frame: &Frame| bench.measure(frame.file, &frame.settings(), &frame.changes());
    Frame::all(scale).iter().map(measure).collect()
}

/// Time and chips that a frame needs.
struct Demand {
    /// Time of one chip for the frame, with read latency, seconds.
    chip_seconds: f64,
    /// Number of chips needed for [`RATE`], by bandwidth and counted arithmetic.
    chips: u64,
    /// Time to read the pixels back, seconds.
    back: f64,
}

impl Demand {
    fn new(frame: &Frame, results: &Results) -> Self {
        let measured = results.traffic(&frame.point());
        let symbols = workload::symbols_of(&frame.settings(), measured);
        let workload = of_frame(measured, symbols.pixels(), &symbols);
        let cost = Cost::counted(&workload, &arithmetic::of_frame(measured, &symbols));
        let machine = &frame.scale.machine;
        let needed = Prediction::new(&workload, &cost, machine).chips_needed(RATE);
        Self {
            chip_seconds: times::frame_seconds(&frame.point(), measured, machine),
            chips: needed.bandwidth.max(needed.computation),
            back: frame.picture_bytes() / machine.link,
        }
    }
}

/// Time to send `bytes` bytes to all chips with the distribution `way`, seconds.
fn upload(way: Distribution, bytes: u64, chips: u64, machine: &Machine) -> f64 {
    way.seconds(bytes as f64, chips, &Symbols::NOMINAL, machine)
}

pub(super) fn report(scale: &Scale, results: &Results, host: &[HostFrame]) -> Report {
    let frames = Frame::all(scale);
    let machine = scale.machine;
    let measured: Vec<(&Frame, &HostFrame)> = frames.iter().zip(host).collect();
    let introduction = vec![
        "What a frame takes of host, host link and chips while the camera moves, while all photons are traced anew, and while a \
         share of them is. All techniques on."
            .to_owned(),
        how_it_counts(),
        format!(
            "Sources of the times. Measured on this host: tracing photons, building the map (with hierarchy and image) and measuring \
             (maximum distance of gathers, disc fractions), on the threads stated. By the cost model: uploads over a host link of {} \
             GB/s each way, a copy to each chip or once through a tree of switches that broadcast; pixels back to the host; chips of \
             {machine} by counted arithmetic, and one chip's time with reads of {} ns, {} in flight, nothing cast while the queue of \
             gathers drains. Parts overlap from frame to frame: the slowest one sets the rate, their sum the latency.",
            machine.link / 1e9,
            machine.latency_ns(),
            machine.tasks,
        ),
    ];
    let sections = vec![
        section(
            "A moving camera",
            vec![
                text("Nothing but tile commands is sent: the cards keep the image, the host the photons."),
                table("camera", camera(&frames, results)),
            ],
        ),
        section(
            "All photons traced anew",
            vec![table("host", host_work(&measured)), table("upload", uploads(&measured))],
        ),
        section("Lines that change", changed_lines(&measured)),
        section("Photons that fit in a frame", fitting(&measured, &machine)),
        section("What 30 frames/s take with both moving", vec![table("demand", demands(&measured, results))]),
    ];
    page("Interactive frames", introduction, sections)
}

fn camera(frames: &[Frame], results: &Results) -> Table {
    let heads = [
        ("frame", ""),
        ("one chip", "ms"),
        ("chips for 30 frames/s", ""),
        ("pixels to the host", "MB"),
        ("pixels to the host", "ms"),
        ("image to the chips", "MB"),
    ];
    let mut table = Table::new("A frame of another camera", columns(&heads));
    for frame in frames {
        let demand = Demand::new(frame, results);
        table.push(vec![
            frame.name().into(),
            (1e3 * demand.chip_seconds).into(),
            demand.chips.into(),
            (frame.picture_bytes() / 1e6).into(),
            (1e3 * demand.back).into(),
            0_u64.into(),
        ]);
    }
    table
}

fn host_work(measured: &[(&Frame, &HostFrame)]) -> Table {
    let heads = [
        ("frame", ""),
        ("threads", ""),
        ("tracing", "ms"),
        ("building", "ms"),
        ("measuring", "ms"),
        ("photons traced, a thread", "million/s"),
        ("threads for 30 frames/s", ""),
    ];
    let mut table = Table::new("The host's work, measured on this host", columns(&heads));
    for (frame, host) in measured {
        let photons = host.map.photons as f64 / 1e6;
        table.push(vec![
            frame.name().into(),
            host.threads.into(),
            (1e3 * host.tracing).into(),
            (1e3 * host.building).into(),
            (1e3 * host.measuring).into(),
            (photons / host.tracing / host.threads as f64).into(),
            threads_needed(host).into(),
        ]);
    }
    table
}

/// Number of threads of this host needed for [`RATE`] frames per second, if the host's work is distributed
/// over them without loss.
fn threads_needed(host: &HostFrame) -> u64 {
    (RATE * host.threads as f64 * host.seconds()).ceil() as u64
}

fn uploads(measured: &[(&Frame, &HostFrame)]) -> Table {
    let mut heads = vec![("frame", ""), ("image", "MB"), ("photon map", "MB"), ("chips", "")];
    heads.extend([("to all chips", "MB"), ("separately", "ms"), ("by the tree", "ms")]);
    heads.extend([("separately, at 30 frames/s", "GB/s"), ("by the tree, at 30 frames/s", "GB/s")]);
    let mut table = Table::new("Upload of the photon map to all chips, by the cost model", columns(&heads));
    for (frame, host) in measured {
        for chips in CHIPS {
            let bytes = host.map.bytes;
            table.push(vec![
                frame.name().into(),
                (host.image_bytes as f64 / 1e6).into(),
                (bytes as f64 / 1e6).into(),
                chips.into(),
                (chips as f64 * bytes as f64 / 1e6).into(),
                (1e3 * upload(Distribution::Separate, bytes, chips, &frame.scale.machine)).into(),
                (1e3 * upload(Distribution::Tree, bytes, chips, &frame.scale.machine)).into(),
                (RATE * chips as f64 * bytes as f64 / 1e9).into(),
                (RATE * bytes as f64 / 1e9).into(),
            ]);
        }
    }
    table
}

fn name_of(change: Change) -> String {
    match change {
        Change::Dimmed => "all lights dimmed to a half".to_owned(),
        Change::Moved => format!("all lights moved by {} % of the diagonal", 100.0 * LIGHT_STEP),
        Change::Replaced(share) => format!("{} % of the photons traced anew", 100.0 * share),
    }
}

fn changed_lines(measured: &[(&Frame, &HostFrame)]) -> Vec<Block> {
    let heads = [("frame", ""), ("change", ""), ("changed lines", "MB"), ("image", "MB"), ("changed", "%")];
    let mut rows = Table::new("Lines of the card image that differ after a change, counted", columns(&heads));
    let mut lines = Vec::new();
    for (frame, host) in measured.iter().filter(|(frame, _)| frame.is_first) {
        let mut points = Vec::new();
        for changed in &host.changes {
            let share = changed.bytes as f64 / changed.of as f64;
            rows.push(vec![
                frame.name().into(),
                name_of(changed.change).into(),
                (changed.bytes as f64 / 1e6).into(),
                (changed.of as f64 / 1e6).into(),
                (100.0 * share).into(),
            ]);
            if let Change::Replaced(replaced) = changed.change {
                points.push(report::Point::new(100.0 * replaced, 100.0 * share));
            }
        }
        lines.push(series(frame.scene, points));
    }
    let axes = panel(
        "",
        ("photons traced anew", "%", XScale::Log10),
        ("lines that change", "% of the image", YScale::LinearFromZero),
        lines,
    );
    vec![
        text(
            "Sections of the scene lie before those of the photons, so that other photons move none of their lines. Lines of the map \
             are those of a tree that is built anew: a photon more or less on one side of a plane moves the planes below it, and one \
             leaf more or less moves the lines of all leaves behind it.",
        ),
        plot("changed-lines", "Changed lines by the share of photons traced anew", "Counted.", vec![axes]),
        table("changed-lines", rows),
    ]
}

/// Maximum fraction of the photons that can be replaced so that all chips receive the changed lines within
/// the time of a frame. It is assumed that the same fraction of the map's lines changes.
fn fitting_share(way: Distribution, host: &HostFrame, chips: u64, machine: &Machine) -> f64 {
    let bytes = way.bytes_within(1.0 / RATE, chips, &Symbols::NOMINAL, machine);
    (bytes / host.map.bytes.max(1) as f64).min(1.0)
}

/// Maximum of the measured fractions of replaced photons for which all chips can receive the changed lines
/// within the time of a frame; 0 if there is none.
fn fitting_measured(way: Distribution, host: &HostFrame, chips: u64, machine: &Machine) -> f64 {
    let fits = |bytes| upload(way, bytes, chips, machine) <= 1.0 / RATE;
    let shares = host.changes.iter().filter_map(|changed| match changed.change {
        Change::Replaced(share) if fits(changed.bytes) => Some(share),
        _ => None,
    });
    shares.fold(0.0, f64::max)
}

fn fitting(measured: &[(&Frame, &HostFrame)], machine: &Machine) -> Vec<Block> {
    let over = format!("at 30 frames/s over {} GB/s", machine.link / 1e9);
    let heads = [
        ("frame", ""),
        ("chips", ""),
        ("separately, in proportion", "%"),
        ("by the tree, in proportion", "%"),
        ("separately, by counted lines", "%"),
        ("by the tree, by counted lines", "%"),
    ];
    let title = format!("Photons that can be replaced in a frame {over}");
    let mut rows = Table::new(title, columns(&heads));
    let mut panels = Vec::new();
    for (frame, host) in measured {
        for chips in CHIPS {
            let mut row = vec![frame.name().into(), chips.into()];
            let ways = [Distribution::Separate, Distribution::Tree];
            row.extend(ways.map(|way| (100.0 * fitting_share(way, host, chips, machine)).into()));
            let counted =
                ways.map(|way| frame.is_first.then(|| 100.0 * fitting_measured(way, host, chips, machine)));
            row.extend(counted.map(report::Cell::from));
            rows.push(row);
        }
        let line = |(name, way)| {
            let points = chip_counts(MAX_CHIPS).into_iter().map(|chips| {
                report::Point::new(chips as f64, 100.0 * fitting_share(way, host, chips as u64, machine))
            });
            series(name, points.collect())
        };
        let lines =
            [("a copy to each chip", Distribution::Separate), ("a tree", Distribution::Tree)].map(line);
        let axes = [("chips", "", XScale::Log2)];
        let y = ("replaced photons", "%", YScale::LinearFromZero);
        panels.extend(axes.map(|x| panel(&frame.name(), x, y, lines.to_vec())));
    }
    vec![
        text(
            "In proportion: a bound, as if a share of the photons were the same share of the map's lines. By counted lines: the \
             largest share of those measured whose changed lines fit; 100 % means that the whole image does.",
        ),
        plot(
            "replaced-photons",
            "Photons that can be replaced in a frame",
            &format!("Lines in proportion, {over}."),
            panels,
        ),
        table("replaced-photons", rows),
    ]
}

fn demands(measured: &[(&Frame, &HostFrame)], results: &Results) -> Table {
    let heads = [
        ("frame", ""),
        ("chips", ""),
        ("host threads", ""),
        ("link to the chips, separately", "GB/s"),
        ("link to the chips, tree", "GB/s"),
        ("link from the chips", "GB/s"),
        ("latency, tree", "ms"),
    ];
    let title = "Chips by counted arithmetic, threads of this host, bandwidth of the host's link; latency of a frame on them";
    let mut table = Table::new(title, columns(&heads));
    for (frame, host) in measured {
        let demand = Demand::new(frame, results);
        let rate = |copies: u64| RATE * copies as f64 * host.map.bytes as f64 / 1e9;
        let threads = threads_needed(host);
        let host_seconds = host.threads as f64 * host.seconds() / threads.max(1) as f64;
        let sent = upload(Distribution::Tree, host.map.bytes, demand.chips, &frame.scale.machine);
        let latency = host_seconds + sent + demand.chip_seconds / demand.chips as f64 + demand.back;
        table.push(vec![
            frame.name().into(),
            demand.chips.into(),
            threads.into(),
            rate(demand.chips).into(),
            rate(1).into(),
            (RATE * frame.picture_bytes() / 1e9).into(),
            (1e3 * latency).into(),
        ]);
    }
    table
}
