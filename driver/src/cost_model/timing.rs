//! Time of a chip whose reads take their time: tasks in flight, and units that one of them has at a time.
//!
//! A task, a ray or a gather, is a chain of steps: a read of a line and the arithmetic on it. Several tasks are in flight, each at one
//! step. A read that misses the cache waits for the DRAM's bus, then for its latency; the arithmetic waits for the unit. Both serve in
//! the order of arrival. What a DRAM does with rows and banks is left to its simulators (`tests/peers/dram.sh`).

use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// A chip, as its time depends on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimedChip {
    /// Tasks in flight: rays or gathers, each with at most one read.
    pub tasks: u32,
    /// Latency of a read from DRAM, seconds, without the line's time on the bus.
    pub latency: f64,
    /// Bandwidth of the DRAM, bytes/s.
    pub bandwidth: f64,
    /// Arithmetic of the chip, floating-point operations a second.
    pub flops: f64,
}

/// Part of a frame's work: equal steps of many tasks.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Part {
    /// Steps: reads of lines, hits and misses.
    pub steps: f64,
    /// Bytes fetched from DRAM.
    pub dram_bytes: f64,
    /// Floating-point operations.
    pub flops: f64,
}

/// Maximum number of steps that are simulated; the rest takes as long as these, step by step.
const SIMULATED: u64 = 1 << 16;
/// Ticks of the simulation in a second.
const TICKS: f64 = 1e15;

/// Times of one step, ticks.
#[derive(Clone, Copy)]
struct StepTimes {
    /// Arithmetic.
    arithmetic: u64,
    /// The DRAM's bus, for a miss.
    bus: u64,
    latency: u64,
    /// Misses of a million steps.
    misses: u64,
}

const MILLION: u64 = 1_000_000;

impl Part {
    /// Share of the steps that miss the cache, lines of `line_bytes` each.
    fn miss_share(&self, line_bytes: f64) -> f64 {
        (self.dram_bytes / line_bytes / self.steps).min(1.0)
    }

    /// Seconds of the part if nothing waits for anything else: the longer of arithmetic and DRAM.
    pub fn bound(&self, chip: &TimedChip) -> f64 {
        (self.dram_bytes / chip.bandwidth).max(self.flops / chip.flops)
    }

    /// Seconds of the part on a chip, in reads of `line_bytes`.
    pub fn seconds(&self, chip: &TimedChip, line_bytes: f64) -> f64 {
        if self.steps < 1.0 {
            return self.bound(chip);
        }
        let misses = self.miss_share(line_bytes);
        let bus = if misses > 0.0 { self.dram_bytes / (misses * self.steps) / chip.bandwidth } else { 0.0 };
        let ticks = |seconds: f64| (seconds * TICKS) as u64;
        let times = StepTimes {
            arithmetic: ticks(self.flops / self.steps / chip.flops),
            bus: ticks(bus),
            latency: ticks(chip.latency),
            misses: (misses * MILLION as f64) as u64,
        };
        let simulated = (self.steps as u64).clamp(1, SIMULATED);
        simulate(&times, chip.tasks.max(1), simulated) as f64 / TICKS * (self.steps / simulated as f64)
    }
}

/// Next step of a task.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Next {
    Compute,
    Read,
}

/// Ticks until a number of steps is done.
fn simulate(times: &StepTimes, tasks: u32, steps: u64) -> u64 {
    let mut events: BinaryHeap<_> = (0..tasks).map(|task| Reverse((0, Next::Read, task))).collect();
    let [mut bus_is_free, mut unit_is_free] = [0, 0];
    let [mut begun, mut owed] = [0, 0];
    let mut end = 0;
    while let Some(Reverse((now, next, task))) = events.pop() {
        match next {
            Next::Read if begun == steps => {}
            Next::Read => {
                begun += 1;
                owed += times.misses;
                let mut arrival = now;
                if owed >= MILLION {
                    owed -= MILLION;
                    bus_is_free = now.max(bus_is_free) + times.bus;
                    arrival = bus_is_free + times.latency;
                }
                events.push(Reverse((arrival, Next::Compute, task)));
            }
            Next::Compute => {
                unit_is_free = now.max(unit_is_free) + times.arithmetic;
                end = unit_is_free;
                events.push(Reverse((end, Next::Read, task)));
            }
        }
    }
    end
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const LINE: f64 = 128.0;

    fn chip(tasks: u32) -> TimedChip {
        TimedChip { tasks, latency: 100e-9, bandwidth: 64e9, flops: 100e9 }
    }

    /// A part of a million steps, of which a share misses.
    fn part(misses: f64, flops: f64) -> Part {
        Part { steps: 1e6, dram_bytes: 1e6 * misses * LINE, flops: 1e6 * flops }
    }

    fn nanoseconds(part: &Part, chip: &TimedChip) -> f64 {
        part.seconds(chip, LINE) / part.steps * 1e9
    }

    #[test]
    fn one_task_waits_for_everything_in_turn() {
        // 2 ns on the bus, 100 ns of latency, 5 ns of arithmetic.
        for (misses, expected) in [(0.0, 5.0), (0.25, 30.5), (1.0, 107.0)] {
            let found = nanoseconds(&part(misses, 500.0), &chip(1));
            assert!((found / expected - 1.0).abs() < 1e-3, "{misses}: {found} instead of {expected}");
        }
    }

    #[test]
    fn tasks_share_what_one_waits_until_a_resource_is_busy() {
        // Where every step misses the queues are deterministic: max(arithmetic, bus, (arithmetic + bus + latency) / tasks).
        for (tasks, flops, expected) in
            [(4, 500.0, 26.75), (16, 500.0, 6.6875), (64, 500.0, 5.0), (500, 100.0, 2.0)]
        {
            let found = nanoseconds(&part(1.0, flops), &chip(tasks));
            assert!((found / expected - 1.0).abs() < 0.01, "{tasks}: {found} instead of {expected}");
        }
    }

    #[test]
    fn nothing_takes_no_time() {
        assert_eq!(Part::default().seconds(&chip(8), LINE), 0.0);
        assert_eq!(part(0.0, 0.0).seconds(&chip(8), LINE), 0.0);
    }

    proptest! {
        #[test]
        fn time_lies_between_that_of_the_busiest_resource_and_that_of_one_task(
            misses in 0.0..1.0_f64, flops in 1.0..5000.0_f64, tasks in 1..200_u32,
        ) {
            let part = part(misses, flops);
            let found = part.seconds(&chip(tasks), LINE);
            prop_assert!(found >= part.bound(&chip(tasks)) * 0.999, "{found} {}", part.bound(&chip(tasks)));
            prop_assert!(found <= part.seconds(&chip(1), LINE) * 1.001);
        }
    }
}
