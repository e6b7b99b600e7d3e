//! Work of a unit, and times of units and of a frame.

/// Work of a frame in one unit, divided equally among its tasks.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Load {
    /// Number of tasks (rays or gathers).
    pub tasks: f64,
    /// Number of reads of lines, both cache hits and misses.
    pub requests: f64,
    /// Bytes fetched from DRAM.
    pub dram_bytes: f64,
    /// Floating-point operations.
    pub flops: f64,
}

/// Times of a unit, seconds. In the rest of the frame the unit waits for other units, or has finished.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct UnitTimes {
    /// Time of arithmetic.
    pub busy: f64,
    /// Time in which all tasks in flight wait for reads.
    pub memory: f64,
    /// Time in which the ray caster waits for free queue entries, or the gather unit for gathers.
    pub queue: f64,
}

/// Times of a frame on a chip, seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameTimes {
    /// Time of the whole frame.
    pub seconds: f64,
    /// Time in which the queue is drained.
    pub draining: f64,
    /// Times of the ray caster.
    pub ray_caster: UnitTimes,
    /// Time of the controller's arithmetic.
    pub controller: f64,
    /// Times of the gather unit.
    pub gather_unit: UnitTimes,
    /// Time of transfers on the DRAM's bus.
    pub dram: f64,
}

impl FrameTimes {
    /// Extrapolates linearly: returns `self + factor * (later - self)`.
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
