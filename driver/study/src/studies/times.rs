//! Time that one chip takes for a frame, with the latency of its memory reads.

use photoncard_render::cost_model::arithmetic::ChipPart;
use photoncard_render::cost_model::timing::{FrameLoad, FrameTimes, Load, Policy, Shares, TimedChip};
use photoncard_render::cost_model::{Cost, Machine, Symbols, Workload};
use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::counters::Counters;

use super::super::measure::{Measurement, TileMeasurement};
use super::super::point::Point;
use super::super::report::Cell;
use super::{arithmetic, workload};

/// Numbers of tasks (rays or gathers) in flight, for which times are computed in addition to the machine's
/// own number.
const FEWER_TASKS: [u32; 2] = [1, 16];

/// Work of a measured frame, and the machine for which times are computed.
pub(super) struct TimedFrame {
    load: FrameLoad,
    machine: Machine,
    /// Mean number of gathers in the queue when the chip begins to empty it. For an order of gathers without
    /// a queue, it is the capacity of the chip's queue: gathers are assumed to wait there, in the order of
    /// arrival.
    drained: u64,
    has_queue: bool,
}

impl TimedFrame {
    /// Sums up the work of the frame that was measured at `point`: its rays with the reads of the scene, and
    /// its gathers with the reads of the photon map.
    pub(super) fn new(point: &Point, measured: &Measurement, machine: &Machine) -> Self {
        let arithmetic = arithmetic::of_frame(measured, &workload::symbols(&point.settings));
        let flops = |part: ChipPart| arithmetic.sum(|unit| unit.part() == part).flops();
        let total = |count: &dyn Fn(&TileMeasurement) -> u64| measured.total(|tile| count(tile) as f64).value;
        let rays = Load {
            tasks: total(&|tile| rays(&tile.counters)),
            requests: total(&|tile| tile.scene().requests),
            dram_bytes: total(&|tile| tile.scene().dram_bytes),
            flops: flops(ChipPart::RayCaster),
        };
        let gathers = Load {
            tasks: total(&|tile| {
                tile.counters.gathers + tile.counters.caustic_gathers + tile.counters.lookups
            }),
            requests: total(&|tile| tile.photon_map().requests),
            dram_bytes: total(&|tile| tile.photon_map().dram_bytes),
            flops: flops(ChipPart::GatherUnit),
        };
        let has_queue = point.has_queue();
        let drains = total(&|tile| tile.counters.drains);
        let drained = if has_queue && drains > 0.0 {
            (gathers.tasks / drains).round() as u64
        } else {
            u64::from(point.chip().budget().gather_queue)
        };
        let load = FrameLoad { rays, controller_flops: flops(ChipPart::Controller), gathers };
        Self { load, machine: *machine, drained, has_queue }
    }

    /// Times of the chip as it is built, which casts no rays while the queue is drained.
    pub(super) fn as_built(&self) -> FrameTimes {
        self.alternating(self.machine.tasks)
    }

    fn alternating(&self, tasks: u32) -> FrameTimes {
        self.times(tasks, self.drained, Policy::Alternate)
    }

    /// Times of a chip whose units have separate arithmetic, in the proportions `shares`, and whose queue has
    /// two halves: one is filled while the other is drained. If the order has a queue, the frame must be
    /// measured with a queue of the size of one half.
    pub(super) fn overlapped(&self, shares: Shares) -> FrameTimes {
        let queue = if self.has_queue { 2 * self.drained } else { self.drained };
        self.times(self.machine.tasks, queue, Policy::Overlapped(shares))
    }

    fn times(&self, tasks: u32, queue: u64, policy: Policy) -> FrameTimes {
        let machine = Machine { tasks, ..self.machine };
        self.load.times(&TimedChip { machine, queue, policy }, LINE_BYTES as f64)
    }

    /// Shares of the units in a chip's arithmetic, in proportion to their FLOPs in the frame.
    pub(super) fn shares(&self) -> Shares {
        let FrameLoad { rays, controller_flops, gathers } = self.load;
        let mut cost = Cost::default();
        cost.ray_caster.flops = rays.flops;
        cost.controller.flops = controller_flops;
        cost.gather_unit.flops = gathers.flops;
        Shares::of(&cost)
    }
}

/// Number of rays of all kinds.
fn rays(counters: &Counters) -> u64 {
    let Counters { eye_rays, shadow_rays, gather_rays, survey_rays, specular_rays, .. } = *counters;
    eye_rays + shadow_rays + gather_rays + survey_rays + specular_rays
}

/// Shares of the units in a chip's arithmetic, in proportion to their FLOPs in Table 7.1's frame with all
/// techniques.
pub(super) fn table_shares() -> Shares {
    Shares::of(&Cost::new(&Workload::nominal(&Symbols::NOMINAL), &Symbols::NOMINAL))
}

/// Time of one chip, as it is built, for a frame, seconds.
pub(super) fn frame_seconds(point: &Point, measured: &Measurement, machine: &Machine) -> f64 {
    TimedFrame::new(point, measured, machine).as_built().seconds
}

/// Numbers of tasks in flight in the table. The last is the machine's own.
fn tasks(machine: &Machine) -> Vec<u32> {
    FEWER_TASKS.into_iter().filter(|&fewer| fewer < machine.tasks).chain([machine.tasks]).collect()
}

/// Names and units of the columns of [`cells`]: times of rays and of gathers with the machine's number of
/// tasks in flight, time of the frame for each number of tasks, and lower bound of the frame's time.
pub(super) fn heads(machine: &Machine) -> Vec<(String, &'static str)> {
    let parts = ["rays", "gathers"].map(|part| format!("{part}, {} in flight", machine.tasks));
    let frames = tasks(machine).into_iter().map(|tasks| format!("frame, {tasks} in flight"));
    let names = parts.into_iter().chain(frames).chain(["frame, everything at once".to_owned()]);
    names.map(|name| (name, "ms")).collect()
}

/// Text that states what the times assume.
pub(super) fn assumptions(machine: &Machine) -> String {
    format!(
        "Milliseconds of one chip of {machine}, whose reads from DRAM take {} ns. A ray or a gather reads one line at a time, computes on \
         it, and reads the next; as many as stated are in flight. Nothing is cast while the queue drains, as one unit has the chip at a \
         time: the frame is the sum of both. Of orders without a queue of their own as many gathers wait as the chip has places for, and are \
         done in the order of arrival. The last column is the longer of all reads and all arithmetic, if nothing ever waited.",
        machine.latency_ns(),
    )
}

/// Cells with the times of a frame, milliseconds.
pub(super) fn cells(frame: &TimedFrame) -> Vec<Cell> {
    let as_built = frame.as_built();
    let parts = [as_built.seconds - as_built.draining, as_built.draining];
    let by_tasks = tasks(&frame.machine).into_iter().map(|tasks| frame.alternating(tasks).seconds);
    let all = parts.into_iter().chain(by_tasks).chain([frame.load.bound(&frame.machine)]);
    all.map(|seconds| Cell::from(1e3 * seconds)).collect()
}
