//! Self-test of a card, for the bring-up of a board: its memory, and its arithmetic.

pub mod arithmetic;
mod memory;

pub use memory::{MemoryTester, expected};
