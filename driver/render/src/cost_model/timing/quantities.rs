//! Work of a unit, and times of units and of a frame.

/// Equal tasks of a frame in one unit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Load {
    /// Number of tasks: rays, or gathers.
    pub tasks: f64,
    /// Reads of lines, hits and misses.
    pub requests: f64,
    /// Bytes fetched from DRAM.
    pub dram_bytes: f64,
    /// Floating-point operations.
    pub flops: f64,
}

/// Seconds of a unit. The rest of the frame it waits for other units, or has ended.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct UnitTimes {
    /// Arithmetic.
    pub busy: f64,
    /// All of its tasks in flight wait for reads.
    pub memory: f64,
    /// The ray caster waits for places in the queue, the gather unit for gathers to drain.
    pub queue: f64,
}

/// Seconds of a frame on a chip.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameTimes {
    /// The whole frame.
    pub seconds: f64,
    /// Part of it in which the queue is drained.
    pub draining: f64,
    /// The ray caster.
    pub ray_caster: UnitTimes,
    /// Arithmetic of the controller.
    pub controller: f64,
    /// The gather unit.
    pub gather_unit: UnitTimes,
    /// Transfers on the DRAM's bus.
    pub dram: f64,
}

impl FrameTimes {
    /// Times that grow linearly: `factor` times the way from these to `later`.
    pub(super) fn extrapolated(&self, later: &Self, factor: f64) -> Self {
        let time = |of: fn(&Self) -> f64| of(self) + (of(later) - of(self)) * factor;
        let unit = |of: fn(&Self) -> &UnitTimes| {
            let time = |time: fn(&UnitTimes) -> f64| {
                let [now, later] = [of(self), of(later)].map(time);
                now + (later - now) * factor
            };
            UnitTimes { busy: time(|t| t.busy), memory: time(|t| t.memory), queue: time(|t| t.queue) }
        };
        Self {
            seconds: time(|t| t.seconds),
            draining: time(|t| t.draining),
            ray_caster: unit(|t| &t.ray_caster),
            controller: time(|t| t.controller),
            gather_unit: unit(|t| &t.gather_unit),
            dram: time(|t| t.dram),
        }
    }
}
