//! Self-test of a card's memory and arithmetic, for the bring-up of a board.

pub mod arithmetic;
mod memory;

pub use memory::{MemoryTester, expected};
