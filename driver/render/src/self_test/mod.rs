//! Self-test of a card, for the bring-up of a board: its arithmetic, and its memory.

mod arithmetic;
mod bench;
mod memory;

use std::time::Instant;

use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::budget::Budget;
use photoncard_shared::link::Port;

pub use self::arithmetic::{ArithmeticTest, WrongResult, WrongResults};
use self::bench::Bench;
pub use self::memory::PatternTest;
use super::greeting::{GreetingError, greet_port, open};
use super::{CardAddress, Observer, RenderError};

/// Outcome of a card's self-test.
#[derive(Clone, Debug)]
pub struct SelfTest {
    /// Capacities and limits of the chip.
    pub budget: Budget,
    /// Arithmetic of the chip, compared with the host's.
    pub arithmetic: ArithmeticTest,
    /// Lines of card memory, all of which were tested.
    pub lines: u32,
    /// Patterns of card memory, in the order of the test.
    pub patterns: Vec<PatternTest>,
}

impl SelfTest {
    /// Bytes of card memory.
    pub fn memory_bytes(&self) -> u64 {
        u64::from(self.lines) * LINE_BYTES as u64
    }

    /// Returns whether the card has less memory than its budget states.
    pub fn lacks_memory(&self) -> bool {
        self.memory_bytes() < u64::from(self.budget.dram_bytes)
    }

    /// Returns whether all results are equal, all words right, and the memory is as large as the budget
    /// states.
    pub fn is_passed(&self) -> bool {
        self.arithmetic.wrong.is_empty()
            && self.patterns.iter().all(|pattern| pattern.wrong.count == 0)
            && !self.lacks_memory()
    }
}

/// Tests the first card at an address. The card forgets its scene. The observer receives the bytes of memory
/// that were written or read.
///
/// # Errors
/// If the card cannot be started or reached, its reply is invalid, it is reset, or the observer stops the
/// test.
pub fn card_self_test(address: &CardAddress, observer: &dyn Observer) -> Result<SelfTest, RenderError> {
    self_test_on(&mut open(address)?, &address.name_of(0), observer)
}

/// Tests the card at the other end of a port, like [`card_self_test`]; `card` is its name in errors.
///
/// # Errors
/// As of [`card_self_test`].
pub fn self_test_on(
    port: &mut impl Port,
    card: &str,
    observer: &dyn Observer,
) -> Result<SelfTest, RenderError> {
    test(port, observer).map_err(|error| error.of_card(card.into()))
}

fn test(port: &mut impl Port, observer: &dyn Observer) -> Result<SelfTest, GreetingError> {
    let start = Instant::now();
    let (session, budget) = greet_port(port, start, observer)?;
    let mut bench = Bench::new(session, port, start, observer);
    let arithmetic = arithmetic::test(&mut bench)?;
    let (lines, patterns) = memory::test(&mut bench)?;
    Ok(SelfTest { budget, arithmetic, lines, patterns })
}
