//! Compares the times of a frame on two chips. One casts rays while its queue is drained; the other, the chip
//! as it is built, does not.

use photoncard_cards::scheduler::GatherOrder;
use photoncard_map::photon_map::PhotonLayout;
use photoncard_picture::choice::Choice;
use photoncard_render::cost_model::timing::FrameTimes;

use super::super::laboratory::Results;
use super::super::point::Point;
use super::super::report::{self, Block, Cell, Table, XScale, YScale};
use super::super::scale::Scale;
use super::present::{CORNELL, columns, panel, plot, series, table, text};
use super::times::{TimedFrame, table_shares};

/// Policies in the tables: how the queue is drained, and how arithmetic is shared.
const POLICIES: [&str; 3] =
    ["alternate, as built", "overlapped, units by their work", "overlapped, units by Table 7.1"];

/// A line of the tables: order of the gathers, and layout of the photon map.
type Line = (GatherOrder, PhotonLayout);

/// Line for which the size of the queue is varied.
const SORT_LINES: Line = (GatherOrder::Sort, PhotonLayout::Lines);

/// Sizes of the queue, in gathers, for which times are compared. Points are measured with each size and with
/// half of each.
fn queues(scale: &Scale) -> Vec<u32> {
    let mut queues = scale.pick(&[1024, 4096, 16_384], &[2048, 8192]);
    let most = scale.chip().budget().gather_queue;
    queues.retain(|&queue| queue <= most);
    queues
}

/// Point of a line with a queue of `queue` entries; `None` for the chip's own size.
fn point(scale: &Scale, (order, layout): Line, queue: Option<u32>) -> Point {
    let settings = scale.settings(order).with(|s| {
        s.photons.layout = layout;
        s.schedule.queue = queue;
    });
    scale.traffic(CORNELL, settings)
}

/// Point of a line with a queue of `queue / 2` entries. An order without a queue gets the chip's own size.
fn half(scale: &Scale, line: Line, queue: Option<u32>) -> Point {
    let half = queue.unwrap_or_else(|| scale.chip().budget().gather_queue) / 2;
    point(scale, line, line.0.has_queue().then_some(half))
}

/// Points of `lines` with half the chip's own queue, and points of [`SORT_LINES`] with each size of
/// [`queues`] and with half of each.
pub(super) fn points(scale: &Scale, lines: &[Line]) -> Vec<Point> {
    let halves = lines.iter().map(|&line| half(scale, line, None));
    let by_queue = queues(scale)
        .into_iter()
        .flat_map(|queue| [point(scale, SORT_LINES, Some(queue)), half(scale, SORT_LINES, Some(queue))]);
    halves.chain(by_queue).collect()
}

/// Times of a frame with the gather order and photon map layout of `line`, one for each of [`POLICIES`]. The
/// queue has `queue` entries; `None` stands for the chip's own number.
fn times(scale: &Scale, results: &Results, line: Line, queue: Option<u32>) -> [FrameTimes; 3] {
    let frame = |point: &Point| TimedFrame::new(point, results.traffic(point), &scale.machine);
    let (whole, halves) = (frame(&point(scale, line, queue)), frame(&half(scale, line, queue)));
    [whole.as_built(), halves.overlapped(halves.shares()), halves.overlapped(table_shares())]
}

/// Blocks of the report on the frames of `lines`.
pub(super) fn blocks(scale: &Scale, results: &Results, lines: &[Line]) -> Vec<Block> {
    let all: Vec<_> = lines.iter().map(|&line| (line, times(scale, results, line, None))).collect();
    let queues: Vec<_> = queues(scale)
        .into_iter()
        .map(|queue| (queue, times(scale, results, SORT_LINES, Some(queue))))
        .collect();
    vec![
        text(assumptions(scale)),
        plot_of_orders(&all),
        table("overlap", shares(&all)),
        plot_of_queues(&queues),
        table("overlap-by-queue", by_queue(&queues)),
    ]
}

fn assumptions(scale: &Scale) -> String {
    let machine = &scale.machine;
    format!(
        "One chip of {machine}, reads of {} ns, {} tasks in flight of each unit: ray caster, controller and gather unit, one DRAM, and a queue of \
         gathers. As built, nothing is cast while the queue drains, and the unit that works has all of the arithmetic. Overlapped, the ray \
         caster fills one half of the queue while the gather unit drains the other; each unit has arithmetic of its own, in proportion to the \
         frame's counted work, or to that of Table 7.1's frame with all techniques. Half a queue reorders less: its bytes are measured with \
         half the queue. A unit is busy while it computes; it waits for memory while all of its tasks read, for the queue while it has none.",
        machine.latency_ns(),
        machine.tasks,
    )
}

fn plot_of_orders(all: &[(Line, [FrameTimes; 3])]) -> Block {
    let mut layouts: Vec<PhotonLayout> = Vec::new();
    for ((_, layout), _) in all {
        if !layouts.contains(layout) {
            layouts.push(*layout);
        }
    }
    let panels = layouts.into_iter().map(|layout| {
        let of_layout: Vec<_> = all.iter().filter(|((_, other), _)| *other == layout).collect();
        let names = of_layout.iter().map(|((order, _), _)| order.name().to_owned()).collect();
        let lines = POLICIES.iter().enumerate().map(|(policy, name)| {
            let point = |(index, (_, times)): (usize, &&(Line, [FrameTimes; 3]))| {
                report::Point::new(index as f64, 1e3 * times[policy].seconds)
            };
            series(*name, of_layout.iter().enumerate().map(point).collect())
        });
        let x = ("order", "", XScale::Categories(names));
        panel(layout.name(), x, ("frame of one chip", "ms", YScale::Log10), lines.collect())
    });
    let caption = "The queue drained in turn with the rays, or in halves while rays are cast.";
    plot("overlap", "Time of a frame by order and by drains", caption, panels.collect())
}

fn shares(all: &[(Line, [FrameTimes; 3])]) -> Table {
    let heads = [
        ("order", ""),
        ("photon map", ""),
        ("drains", ""),
        ("frame", "ms"),
        ("ray caster busy", "%"),
        ("controller busy", "%"),
        ("gather unit busy", "%"),
        ("DRAM busy", "%"),
        ("ray caster waits for memory", "%"),
        ("gather unit waits for memory", "%"),
        ("ray caster waits for places in the queue", "%"),
        ("gather unit waits for gathers", "%"),
    ];
    let mut table = Table::new("Time of a frame, and shares of it", columns(&heads));
    for ((order, layout), by_policy) in all {
        for (policy, times) in POLICIES.into_iter().zip(by_policy) {
            let FrameTimes { seconds, ray_caster, controller, gather_unit, dram, .. } = times;
            let parts = [
                ray_caster.busy,
                *controller,
                gather_unit.busy,
                *dram,
                ray_caster.memory,
                gather_unit.memory,
                ray_caster.queue,
                gather_unit.queue,
            ];
            let mut row: Vec<Cell> = vec![order.name().into(), layout.name().into(), policy.into()];
            row.push((1e3 * seconds).into());
            row.extend(
                parts.map(|part| Cell::from(if *seconds > 0.0 { 100.0 * part / seconds } else { 0.0 })),
            );
            table.push(row);
        }
    }
    table
}

fn plot_of_queues(by_queue: &[(u32, [FrameTimes; 3])]) -> Block {
    let lines = POLICIES.iter().enumerate().map(|(policy, name)| {
        let point = |(queue, times): &(u32, [FrameTimes; 3])| {
            report::Point::new(f64::from(*queue), 1e3 * times[policy].seconds)
        };
        series(*name, by_queue.iter().map(point).collect())
    });
    let y = ("frame of one chip", "ms", YScale::LinearFromZero);
    let axes = panel("", ("gathers that may wait, both halves", "", XScale::Log2), y, lines.collect());
    let caption = "Order sort, photons in leaves that fill a line.";
    plot("overlap-by-queue", "Time of a frame by the size of the queue", caption, vec![axes])
}

fn by_queue(by_queue: &[(u32, [FrameTimes; 3])]) -> Table {
    let heads: Vec<_> = [("gathers that may wait, both halves", "")]
        .into_iter()
        .chain(POLICIES.map(|policy| (policy, "ms")))
        .collect();
    let title = "Time of a frame by the size of the queue: sort, photons in leaves that fill a line";
    let mut table = Table::new(title, columns(&heads));
    for (queue, by_policy) in by_queue {
        let mut row = vec![(*queue).into()];
        row.extend(by_policy.iter().map(|times| Cell::from(1e3 * times.seconds)));
        table.push(row);
    }
    table
}
