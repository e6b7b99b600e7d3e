//! Counts the arithmetic of a frame: the number of executions of each step, times the floating-point
//! operations per execution.
//!
//! The number of executions of each [`Step`] follows from the counters of a chip and the contents of the
//! lines that it reads. The operations per execution are constants of the firmware ([`OPERATIONS`]). They
//! were counted on a target without floating-point instructions, where each operation is a function call
//! (`tests/operations.sh`); `tests/tests/it/operations.rs` counts them again. A vector lane counts only if
//! its result is used.

mod step;
mod table;

pub use step::{ChipPart, Operations, Step, Unit, Work};
pub use table::OPERATIONS;

use photoncard_picture::choice::Choice;

/// Number of units.
pub const UNITS: usize = Unit::ALL.len();

/// Floating-point operations of each unit of the chip, in the order of [`Unit::ALL`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Arithmetic(pub [Operations; UNITS]);

impl Arithmetic {
    /// Operations of `work`: for each step, the number of executions times the operations per execution.
    pub fn of(work: &Work) -> Self {
        let mut arithmetic = Self::default();
        for (step, operations) in Step::ALL.iter().zip(OPERATIONS) {
            arithmetic.0[step.unit() as usize].add(&operations.times(step.count(work)));
        }
        arithmetic
    }

    /// Adds the operations of `other`.
    pub fn add(&mut self, other: &Self) {
        self.0.iter_mut().zip(&other.0).for_each(|(operations, other)| operations.add(other));
    }

    /// Multiplies all numbers of operations by `count`.
    #[must_use]
    pub fn times(&self, count: f64) -> Self {
        Self(self.0.map(|operations| operations.times(count)))
    }

    /// Operations of one unit.
    pub fn unit(&self, unit: Unit) -> &Operations {
        &self.0[unit as usize]
    }

    /// Sum of the operations of the units that `chosen` selects.
    pub fn sum(&self, chosen: impl Fn(Unit) -> bool) -> Operations {
        let mut sum = Operations::default();
        for unit in Unit::ALL.iter().copied().filter(|&unit| chosen(unit)) {
            sum.add(self.unit(unit));
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::emulator::contents::Contents;
    use photoncard_shared::counters::Counters;

    #[test]
    fn a_box_costs_the_operations_of_its_slab_test() {
        // Slab test: a product and a sum for each of six planes, and seven comparisons. `near` is the maximum
        // of three planes and 0, `far` the minimum of three planes and the limit, and `near` is compared with
        // `far`.
        let boxes = Contents { boxes: 1, ..Contents::ZERO };
        let work = Work::new(&Counters::ZERO, &boxes, 100.0);
        let traversal = *Arithmetic::of(&work).unit(Unit::Traversal);
        assert_eq!([traversal.add, traversal.multiply, traversal.compare], [6.0, 6.0, 7.0]);
        assert_eq!([traversal.divide, traversal.square_root], [0.0, 0.0]);
    }

    #[test]
    fn arithmetic_is_the_sum_of_its_steps() {
        let contents = Contents { photons: 3, photon_boxes: 5, ..Contents::ZERO };
        let counters = Counters { gathers: 2, gather_rays: 7, ..Counters::ZERO };
        let both = Arithmetic::of(&Work::new(&counters, &contents, 10.0)).sum(|_| true).flops();
        let parts = [(Counters::ZERO, contents), (counters, Contents::ZERO)];
        let sum: f64 = parts
            .map(|(counters, contents)| {
                Arithmetic::of(&Work::new(&counters, &contents, 10.0)).sum(|_| true).flops()
            })
            .iter()
            .sum();
        assert!(both > 0.0 && (both / sum - 1.0).abs() < 1e-12, "{both} {sum}");
    }
}
