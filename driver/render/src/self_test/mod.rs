//! Self-test of a card's arithmetic and memory, for the bring-up of a board.

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
use super::greeting::{GreetedCard, GreetingError, greet_alone, greet_port, open};
use super::hands::{Hands, completed};
use super::{CardAddress, Observer, RenderError};

/// Result of a card's self-test.
#[derive(Clone, Debug)]
pub struct SelfTest {
    /// Capacities and limits of the chip.
    pub budget: Budget,
    /// Result of the arithmetic test.
    pub arithmetic: ArithmeticTest,
    /// Number of lines of card memory. All were tested.
    pub lines: u32,
    /// Results of the memory test by pattern, in the order of the test.
    pub patterns: Vec<PatternTest>,
}

impl SelfTest {
    /// Size of card memory, bytes.
    pub fn memory_bytes(&self) -> u64 {
        u64::from(self.lines) * LINE_BYTES as u64
    }

    /// Returns whether the card has less memory than its budget states.
    pub fn lacks_memory(&self) -> bool {
        self.memory_bytes() < self.budget.dram_bytes
    }

    /// Returns whether all results and memory words are right, and the memory is as large as the budget
    /// states.
    pub fn is_passed(&self) -> bool {
        self.arithmetic.wrong.is_empty()
            && self.patterns.iter().all(|pattern| pattern.wrong.count == 0)
            && !self.lacks_memory()
    }
}

/// Tests the first card at an address. The card loses the scene in its memory. The observer is notified of
/// the number of memory bytes written or read.
///
/// # Errors
/// If the card cannot be started or reached, its reply is invalid, it is reset, or the observer stops the
/// test.
pub fn card_self_test(address: &CardAddress, observer: &dyn Observer) -> Result<SelfTest, RenderError> {
    let GreetedCard { mut card, .. } = greet_alone(address, open(address)?, Instant::now())?;
    self_test_on(&mut card, &address.name_of(0), observer)
}

/// Tests the card at the other end of a port, like [`card_self_test`]. `card` is the card's name in errors.
///
/// # Errors
/// As [`card_self_test`].
pub fn self_test_on(
    port: &mut impl Port,
    card: &str,
    observer: &dyn Observer,
) -> Result<SelfTest, RenderError> {
    test(port, observer).map_err(|error| error.of_card(card.into()))
}

fn test(port: &mut impl Port, observer: &dyn Observer) -> Result<SelfTest, GreetingError> {
    let start = Instant::now();
    let (session, budget) = completed(greet_port(port, &Hands::Threads, start, observer))?;
    let mut bench = Bench::new(session, port, start, observer);
    let arithmetic = arithmetic::test(&mut bench)?;
    let (lines, patterns) = memory::test(&mut bench)?;
    Ok(SelfTest { budget, arithmetic, lines, patterns })
}
