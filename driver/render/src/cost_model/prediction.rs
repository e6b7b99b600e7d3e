//! Predicts the speed of a machine from the cost of a frame: tiles and frames per second, and the number of
//! chips needed for a frame rate.

use std::fmt;

use super::{Cost, Workload};

/// Capacity of one chip, and of the host's link, which all chips share.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Machine {
    /// Usable DRAM bandwidth of a chip, bytes/s.
    pub bandwidth: f64,
    /// Arithmetic rate of a chip, floating-point operations/s.
    pub flops: f64,
    /// Bandwidth of the host's link in each direction, bytes/s.
    pub link: f64,
    /// Latency of a DRAM read, seconds, without the transfer time on the bus.
    pub latency: f64,
    /// Maximum number of tasks (rays or gathers) in flight per unit of a chip.
    pub tasks: u32,
}

impl Machine {
    /// Chip that section 7.1 of the dissertation expects for 2010: 90 GB/s and 500 GFLOPS. The other values
    /// are choices of this project: a link of 4 GB/s in each direction, the sixteen lanes of PCI Express 1.x
    /// in a workstation of 2007; a latency of 100 ns, typical of DRAM of any year; and 128 tasks.
    pub const NOMINAL: Self = Self { bandwidth: 90e9, flops: 500e9, link: 4e9, latency: 100e-9, tasks: 128 };

    /// Latency of a read in nanoseconds, rounded to a multiple of 0.001.
    pub fn latency_ns(&self) -> f64 {
        (self.latency * 1e12).round() / 1e3
    }
}

/// Bandwidth and arithmetic rate of a chip as text.
impl fmt::Display for Machine {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{} GB/s and {} GFLOPS", self.bandwidth / 1e9, self.flops / 1e9)
    }
}

/// Resource that limits a machine's frame rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Resource {
    /// Bandwidth of the chips' DRAM.
    Bandwidth,
    /// Arithmetic of the chips.
    Computation,
    /// Bandwidth of the host's link. More chips do not increase it.
    HostLink,
}

/// Numbers of chips needed for a frame rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChipsNeeded {
    /// Chips needed if only memory bandwidth mattered.
    pub bandwidth: u64,
    /// Chips needed if only arithmetic mattered.
    pub computation: u64,
    /// Chips needed for both memory bandwidth and arithmetic; `None` if the host's link cannot carry the
    /// frame rate with any number of chips.
    pub overall: Option<u64>,
}

/// Upper bound of the speed at which a machine renders frames of a given cost.
///
/// Memory, arithmetic and link are assumed to work simultaneously, as in a pipeline without stalls, and tiles
/// to be distributed over the chips without loss. The rate of a resource that a frame does not use is
/// infinite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    /// Tiles per second that one chip's memory bandwidth allows.
    pub bandwidth_tiles_per_second: f64,
    /// Tiles per second that one chip's arithmetic allows.
    pub computation_tiles_per_second: f64,
    /// Frames per second that the host's link allows with any number of chips.
    pub link_frames_per_second: f64,
    /// Number of tiles per frame.
    pub tiles: f64,
}

/// Maximum relative difference between two rates that counts as a rounding error.
const ROUNDING: f64 = 1e-9;

impl Prediction {
    /// Prediction for a frame with the workload `workload` and the cost `cost`.
    pub fn new(workload: &Workload, cost: &Cost, machine: &Machine) -> Self {
        let total = cost.total();
        // The two directions of the link are independent, so that the busier one is the limit.
        let link_bytes = workload.bytes_to_host.max(workload.bytes_from_host);
        let rate = |capacity: f64, of_frame: f64| {
            if of_frame > 0.0 { capacity / of_frame } else { f64::INFINITY }
        };
        Self {
            bandwidth_tiles_per_second: workload.tiles * rate(machine.bandwidth, total.dram_bytes),
            computation_tiles_per_second: workload.tiles * rate(machine.flops, total.flops),
            link_frames_per_second: rate(machine.link, link_bytes),
            tiles: workload.tiles,
        }
    }

    /// Tiles per second of one chip: the lower of its two rates.
    pub(crate) fn tiles_per_second(&self) -> f64 {
        self.bandwidth_tiles_per_second.min(self.computation_tiles_per_second)
    }

    /// Frames per second of `chips` chips, limited by the host's link.
    pub fn frames_per_second(&self, chips: u64) -> f64 {
        self.chips_frames_per_second(chips).min(self.link_frames_per_second)
    }

    /// Resource that limits the frame rate of `chips` chips. If several resources allow the same rate, the
    /// DRAM is named before the arithmetic, and the arithmetic before the link.
    pub fn binding(&self, chips: u64) -> Resource {
        if self.link_frames_per_second < self.chips_frames_per_second(chips) {
            Resource::HostLink
        } else if self.computation_tiles_per_second < self.bandwidth_tiles_per_second {
            Resource::Computation
        } else {
            Resource::Bandwidth
        }
    }

    /// Minimum numbers of chips for a frame rate; at least one. A rate that is lower by a relative difference
    /// of at most 1e-9 counts as reached, because this is a rounding error.
    pub fn chips_needed(&self, frames_per_second: f64) -> ChipsNeeded {
        let chips = |tiles_per_second: f64| {
            let ratio = frames_per_second * self.tiles / tiles_per_second;
            ((ratio * (1.0 - ROUNDING)).ceil() as u64).max(1)
        };
        let bandwidth = chips(self.bandwidth_tiles_per_second);
        let computation = chips(self.computation_tiles_per_second);
        let is_carried = self.link_load(frames_per_second) <= 1.0 + ROUNDING;
        ChipsNeeded { bandwidth, computation, overall: is_carried.then(|| bandwidth.max(computation)) }
    }

    /// Bandwidth of the host's link that a frame rate needs, as a fraction of the available bandwidth.
    pub fn link_load(&self, frames_per_second: f64) -> f64 {
        frames_per_second / self.link_frames_per_second
    }

    fn chips_frames_per_second(&self, chips: u64) -> f64 {
        chips as f64 * self.tiles_per_second() / self.tiles
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::{Symbols, UnitCost};
    use super::*;

    fn nominal() -> Prediction {
        let symbols = Symbols::NOMINAL;
        let workload = Workload::nominal(&symbols);
        Prediction::new(&workload, &Cost::new(&workload, &symbols), &Machine::NOMINAL)
    }

    fn naive() -> Prediction {
        let symbols = Symbols::NOMINAL;
        let workload = Workload::naive(&symbols);
        Prediction::new(&workload, &Cost::naive(&workload, &symbols), &Machine::NOMINAL)
    }

    #[test]
    fn the_naive_frame_takes_under_sixteen_chips_of_arithmetic_and_over_a_hundred_of_memory() {
        let chips = naive().chips_needed(30.0);
        // (11 TB/s + 8.57 GB/s of the scene) / 90 GB/s.
        assert_eq!(chips, ChipsNeeded { bandwidth: 123, computation: 15, overall: Some(123) });
        assert_eq!(naive().binding(123), Resource::Bandwidth);
    }

    #[test]
    fn the_techniques_bring_the_nominal_frame_to_a_few_chips() {
        let chips = nominal().chips_needed(30.0);
        assert!(chips.overall.unwrap() < 16, "{chips:?}");
        assert!(nominal().link_load(30.0) < 0.15);
    }

    #[test]
    fn the_binding_resource_is_the_scarcest() {
        let workload = Workload { tiles: 10.0, bytes_to_host: 100.0, ..Workload::default() };
        let cost = Cost { gather_unit: UnitCost { flops: 1000.0, dram_bytes: 50.0 }, ..Cost::default() };
        let on = |bandwidth, flops, link| {
            Prediction::new(&workload, &cost, &Machine { bandwidth, flops, link, ..Machine::NOMINAL })
        };
        let prediction = on(50.0, 2000.0, 450.0);
        assert_eq!(
            [prediction.bandwidth_tiles_per_second, prediction.computation_tiles_per_second],
            [10.0, 20.0]
        );
        assert_eq!(prediction.binding(1), Resource::Bandwidth);
        assert_eq!(on(100.1, 2000.0, 450.0).binding(1), Resource::Computation);
        // The link carries 4.5 frames a second.
        assert_eq!([prediction.binding(4), prediction.binding(5)], [Resource::Bandwidth, Resource::HostLink]);
        assert_eq!([prediction.frames_per_second(4), prediction.frames_per_second(1000)], [4.0, 4.5]);
        assert_eq!(prediction.chips_needed(4.5).overall, Some(5));
        assert_eq!(prediction.chips_needed(4.6).overall, None);
        assert_eq!(prediction.link_load(9.0), 2.0);
    }

    #[test]
    fn a_frame_that_costs_nothing_takes_one_chip() {
        let workload = Workload { tiles: 4.0, ..Workload::default() };
        let prediction = Prediction::new(&workload, &Cost::default(), &Machine::NOMINAL);
        assert_eq!(prediction.chips_needed(30.0).overall, Some(1));
        assert_eq!(prediction.frames_per_second(1), f64::INFINITY);
    }

    proptest! {
        #[test]
        fn the_chips_needed_are_the_minimum(
            bytes in 1.0..1e13_f64, flops in 1.0..1e13_f64, target in 0.1..1000.0_f64,
        ) {
            let workload = Workload { tiles: 1024.0, ..Workload::default() };
            let cost =
                Cost { gather_unit: UnitCost { flops, dram_bytes: bytes }, ..Cost::default() };
            let prediction = Prediction::new(&workload, &cost, &Machine::NOMINAL);
            let chips = prediction.chips_needed(target).overall.unwrap();
            prop_assert!(prediction.frames_per_second(chips) >= target * (1.0 - 2.0 * ROUNDING));
            prop_assert!(chips == 1 || prediction.frames_per_second(chips - 1) < target);
        }

        #[test]
        fn an_exact_multiple_is_not_rounded_up(flops in 1.0..1e13_f64, chips in 1..2000_u64) {
            let workload = Workload { tiles: 1024.0, ..Workload::default() };
            let cost = Cost { ray_caster: UnitCost { flops, dram_bytes: 0.0 }, ..Cost::default() };
            let prediction = Prediction::new(&workload, &cost, &Machine::NOMINAL);
            let needed = prediction.chips_needed(prediction.frames_per_second(chips));
            prop_assert_eq!(needed.computation, chips);
        }

        #[test]
        fn more_of_any_resource_is_never_slower(chips in 1..200_u64, factor in 1.0..4.0_f64) {
            let symbols = Symbols::NOMINAL;
            let workload = Workload::nominal(&symbols);
            let rate = |machine: &Machine, chips| {
                Prediction::new(&workload, &Cost::new(&workload, &symbols), machine).frames_per_second(chips)
            };
            let before = rate(&Machine::NOMINAL, chips);
            let mut machines = [Machine::NOMINAL; 3];
            machines[0].bandwidth *= factor;
            machines[1].flops *= factor;
            machines[2].link *= factor;
            prop_assert!(rate(&Machine::NOMINAL, chips + 1) >= before);
            prop_assert!(machines.iter().all(|machine| rate(machine, chips) >= before));
        }
    }
}
