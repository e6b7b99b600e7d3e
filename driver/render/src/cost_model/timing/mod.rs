//! Timing model of a chip whose reads have latency: three units, the queue of gathers between two of them,
//! and the DRAM that they share.
//!
//! A task (a ray or a gather) is a chain of steps; a step is a read of a line and the arithmetic on it. Each
//! unit has as many tasks in flight as the [`Machine`] states, each at one step. A read that misses the cache
//! waits for the DRAM's bus, then for its latency; arithmetic waits for the unit. Both are served in the
//! order of arrival. A ray passes from the ray caster to the controller. If it hits, its gather enters the
//! queue, where a place was reserved when the ray began. A [`Policy`] determines when the queue is drained.
//! Rows and banks of a DRAM are left to DRAM simulators (`tests/peers/dram.sh`).

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
    /// No rays are cast while the queue is drained. Each unit has all of the chip's arithmetic while it
    /// works.
    Alternate,
    /// The ray caster fills one half of the queue while the gather unit drains the other, each with its share
    /// of the arithmetic. A queue of one entry has no halves: it is filled and drained in turn.
    Overlapped(Shares),
}

/// Fractions of the chip's arithmetic that its units have.
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
    /// Shares in proportion to a cost's arithmetic; equal shares if the cost has no arithmetic.
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
    /// Number of entries of the queue of gathers, at least 1, in both halves together.
    pub queue: u64,
    /// Policy by which the queue is drained.
    pub policy: Policy,
}

/// Work of a frame by unit, which determines the frame's time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameLoad {
    /// Rays in the ray caster, and their reads of the scene.
    pub rays: Load,
    /// Floating-point operations of the controller, distributed evenly over all rays.
    pub controller_flops: f64,
    /// Gathers and their reads of the photon map, distributed evenly over all rays.
    pub gathers: Load,
}

/// Minimum number of drains that are simulated. A frame's time is linear in its number of drains from the
/// first drain on.
const MIN_DRAINS: f64 = 4.0;
/// Approximate number of steps that are simulated. The number of simulated drains follows from it, but is at
/// least [`MIN_DRAINS`].
const STEPS: f64 = 65_536.0;
/// Maximum number of entries of a simulated queue. The fraction of time that a longer queue would save is
/// below the number of tasks in flight divided by the number of entries.
const MAX_QUEUE: u64 = 32_768;

impl FrameLoad {
    /// Lower bound of the frame's time, seconds: its arithmetic time or its DRAM time, whichever is longer.
    pub fn bound(&self, machine: &Machine) -> f64 {
        let bytes = self.rays.dram_bytes + self.gathers.dram_bytes;
        let flops = self.rays.flops + self.controller_flops + self.gathers.flops;
        (bytes / machine.bandwidth).max(flops / machine.flops)
    }

    /// Times of the frame on a chip that fetches lines of `line_bytes` bytes from DRAM. A sample of the
    /// drains is simulated. Each remaining drain takes the mean time of the sample's second half.
    pub fn times(&self, chip: &TimedChip, line_bytes: f64) -> FrameTimes {
        // Pieces of the rays' work, each of which leads to at most one gather.
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
