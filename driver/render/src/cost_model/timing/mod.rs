//! Timing model of a chip in which reads have latency. It has three units, the queue of gathers between two
//! of them, and the DRAM that they share.
//!
//! A task is a ray or a gather. It is a chain of steps: each reads a line and does the arithmetic on it. A
//! unit has up to as many tasks in flight as the [`Machine`] states. A read that misses the cache waits for
//! the bus of the DRAM, then for the latency; arithmetic waits for the unit. Bus and unit serve requests in
//! the order of arrival. A ray passes from the ray caster to the controller. If it hits, its gather enters
//! the queue, in which an entry was reserved when the ray began. A [`Policy`] determines when the queue is
//! drained. Rows and banks of the DRAM are not modelled; DRAM simulators do that (`tests/peers/dram.sh`).

mod quantities;
mod simulation;
#[cfg(test)]
mod tests;

pub use self::quantities::{FrameTimes, Load, UnitTimes};
use self::simulation::{Plan, Task, run};
use super::{Cost, Machine};

/// Policy that determines whether a chip casts rays while its queue is drained.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Policy {
    /// No rays are cast while the queue is drained. The unit that works has all of the arithmetic of the
    /// chip.
    Alternate,
    /// The ray caster fills one half of the queue while the gather unit drains the other half. Each unit has
    /// its share of the arithmetic. A queue of one entry has no halves: it is filled and drained in turn.
    Overlapped(Shares),
}

/// Fraction of the arithmetic rate of the chip that each unit has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shares {
    /// Fraction of the chip's arithmetic that the ray caster has, 0 to 1.
    pub ray_caster: f64,
    /// Fraction of the chip's arithmetic that the controller has, 0 to 1.
    pub controller: f64,
    /// Fraction of the chip's arithmetic that the gather unit has, 0 to 1.
    pub gather_unit: f64,
}

impl Shares {
    /// Shares in proportion to each unit's arithmetic in a cost; equal shares if the cost has none.
    pub fn of(cost: &Cost) -> Self {
        let total = cost.total().flops;
        let share = |flops: f64| if total > 0.0 { flops / total } else { 1.0 / 3.0 };
        Self {
            ray_caster: share(cost.ray_caster.flops),
            controller: share(cost.controller.flops),
            gather_unit: share(cost.gather_unit.flops),
        }
    }
}

/// Parameters of a chip that determine the time of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimedChip {
    /// DRAM, arithmetic and tasks in flight.
    pub machine: Machine,
    /// Number of entries of the queue of gathers, at least 1. A queue of two halves has half of the entries
    /// in each.
    pub queue: u64,
    /// Policy by which the queue is drained.
    pub policy: Policy,
}

/// Work of a frame in each unit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameLoad {
    /// Rays in the ray caster, and their reads of the scene.
    pub rays: Load,
    /// Floating-point operations of the controller, distributed evenly over all rays.
    pub controller_flops: f64,
    /// Gathers and their reads of the photon map, distributed evenly over all rays.
    pub gathers: Load,
}

/// Minimum number of simulated drains of the queue. From the first drain on, the time of a frame is linear in
/// its number of drains.
const MIN_DRAINS: f64 = 4.0;
/// Approximate number of simulated steps. It determines the number of simulated drains, which is at least
/// [`MIN_DRAINS`].
const STEPS: f64 = 65_536.0;
/// Maximum number of entries of the simulated queue. A longer queue would save less than the fraction
/// `tasks in flight / entries` of the time.
const MAX_QUEUE: u64 = 32_768;

impl FrameLoad {
    /// Lower bound of the frame's time, seconds: its arithmetic time or its DRAM time, whichever is longer.
    pub fn bound(&self, machine: &Machine) -> f64 {
        let bytes = self.rays.dram_bytes + self.gathers.dram_bytes;
        let flops = self.rays.flops + self.controller_flops + self.gathers.flops;
        (bytes / machine.bandwidth).max(flops / machine.flops)
    }

    /// Times of the frame on a chip that fetches lines of `line_bytes` bytes from DRAM. Only some drains are
    /// simulated. Each further drain takes the mean time of the second half of the simulated drains.
    pub fn times(&self, chip: &TimedChip, line_bytes: f64) -> FrameTimes {
        // Number of pieces into which the work of the rays is divided. Each leads to at most one gather.
        let pieces = self.rays.tasks.max(self.gathers.tasks);
        if pieces < 1.0 {
            return FrameTimes::default();
        }
        let plan = self.plan(chip, pieces, line_bytes);
        let of_drain = plan.entries() as f64 * (pieces / self.gathers.tasks.max(1.0)).max(1.0);
        let steps = of_drain * plan.rays.steps.mean() + plan.entries() as f64 * plan.gathers.steps.mean();
        let drains = 2.0 * (STEPS / steps).max(MIN_DRAINS).div_euclid(2.0);
        let [half, all] = [0.5, 1.0].map(|share| (share * drains * of_drain).ceil());
        if pieces <= all {
            return run(&plan, pieces.round() as u64);
        }
        let [half_times, all_times] = [half, all].map(|pieces| run(&plan, pieces as u64));
        half_times.extrapolated(&all_times, (pieces - half) / (all - half))
    }

    fn plan(&self, chip: &TimedChip, pieces: f64, line_bytes: f64) -> Plan {
        let TimedChip { machine, queue, policy } = chip;
        let shares = match policy {
            Policy::Alternate => Shares { ray_caster: 1.0, controller: 1.0, gather_unit: 1.0 },
            Policy::Overlapped(shares) => *shares,
        };
        let task = |load: &Load, share| Task::new(load, machine, share, line_bytes);
        let controller = Load { tasks: pieces, flops: self.controller_flops, ..Load::default() };
        Plan {
            rays: task(&Load { tasks: pieces, ..self.rays }, shares.ray_caster),
            controller: task(&controller, shares.controller).arithmetic,
            gathers: task(&self.gathers, shares.gather_unit),
            hits: self.gathers.tasks / pieces,
            in_flight: u64::from(machine.tasks.max(1)),
            queue: (*queue).clamp(1, MAX_QUEUE),
            is_shared: *policy == Policy::Alternate,
        }
    }
}
