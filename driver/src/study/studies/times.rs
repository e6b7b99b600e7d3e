//! Time of one chip for a frame, by parts, with reads that take their time.

use photoncard_shared::address::LINE_BYTES;

use super::super::measure::{Measurement, TileMeasurement};
use super::super::report::Cell;
use super::arithmetic;
use crate::cost_model::arithmetic::{ChipPart, Unit};
use crate::cost_model::timing::{Part, TimedChip};
use crate::cost_model::{Machine, Symbols};

/// Latency of a read from DRAM, seconds.
const LATENCY: f64 = 100e-9;
/// Tasks in flight that are compared.
const TASKS: [u32; 3] = [1, 16, 128];

/// Columns of [`cells`]: parts at the most tasks in flight, then the frame by tasks, then its bound.
pub(super) const HEADS: [(&str, &str); 6] = [
    ("rays, 128 in flight", "ms"),
    ("gathers, 128 in flight", "ms"),
    ("frame, 1 in flight", "ms"),
    ("frame, 16 in flight", "ms"),
    ("frame, 128 in flight", "ms"),
    ("frame, everything at once", "ms"),
];

/// Description of what the times assume.
pub(super) const ASSUMPTIONS: &str = "Milliseconds of one chip of 90 GB/s and 500 GFLOPS, whose reads from DRAM take 100 ns. A ray or a \
    gather reads one line at a time, computes on it, and reads the next; as many as stated are in flight. Rays are cast while no gather is \
    done, and the other way round, as one unit has the chip at a time: the frame is the sum of both. The last column is the longer of \
    all reads and all arithmetic, if nothing ever waited.";

fn chip(tasks: u32) -> TimedChip {
    let Machine { bandwidth, flops, .. } = Machine::NOMINAL;
    TimedChip { tasks, latency: LATENCY, bandwidth, flops }
}

/// Rays and gathers of a frame: reads of the scene and of the photon map, and the arithmetic on them.
fn parts(measured: &Measurement, symbols: &Symbols) -> [Part; 2] {
    let arithmetic = arithmetic::of_frame(measured, symbols);
    let is_of_gathers = |unit: Unit| unit.part() == ChipPart::GatherUnit;
    let total = |count: &dyn Fn(&TileMeasurement) -> u64| measured.total(|tile| count(tile) as f64).value;
    [
        Part {
            steps: total(&|tile| tile.scene().requests),
            dram_bytes: total(&|tile| tile.scene().dram_bytes),
            flops: arithmetic.sum(|unit| !is_of_gathers(unit)).flops(),
        },
        Part {
            steps: total(&|tile| tile.photon_map().requests),
            dram_bytes: total(&|tile| tile.photon_map().dram_bytes),
            flops: arithmetic.sum(is_of_gathers).flops(),
        },
    ]
}

/// Seconds of one chip for a frame, with as many tasks in flight as [`HEADS`] has.
pub(super) fn frame_seconds(measured: &Measurement, symbols: &Symbols) -> f64 {
    let chip = chip(TASKS[TASKS.len() - 1]);
    parts(measured, symbols).iter().map(|part| part.seconds(&chip, LINE_BYTES as f64)).sum()
}

/// Times of a frame, milliseconds.
pub(super) fn cells(measured: &Measurement, symbols: &Symbols) -> Vec<Cell> {
    let parts = parts(measured, symbols);
    let milliseconds = |part: &Part, tasks| 1e3 * part.seconds(&chip(tasks), LINE_BYTES as f64);
    let most = TASKS[TASKS.len() - 1];
    let by_part = parts.iter().map(|part| milliseconds(part, most));
    let by_tasks = TASKS.iter().map(|&tasks| parts.iter().map(|part| milliseconds(part, tasks)).sum::<f64>());
    let [rays, gathers] = &parts;
    let all = Part {
        steps: rays.steps + gathers.steps,
        dram_bytes: rays.dram_bytes + gathers.dram_bytes,
        flops: rays.flops + gathers.flops,
    };
    by_part.chain(by_tasks).chain([1e3 * all.bound(&chip(most))]).map(Cell::from).collect()
}
