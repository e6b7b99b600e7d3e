//! An emulated card without a thread, for programs that may not wait.

use std::time::{Duration, Instant};

use photoncard_firmware::card::Card;

use super::dram::EmulatedDram;
use super::{Emulated, SharedImage};

/// Steps of work between two readings of the clock. A reading takes as long as a short step in a browser.
const STEPS: usize = 16;

/// An emulated card that is called with the bytes of its host, such as in a worker of a browser. Its memory
/// grows as it is written.
pub struct PolledCard {
    card: Card<Emulated, EmulatedDram<'static>>,
}

impl PolledCard {
    /// Creates a card with a chip.
    pub fn new(chip: Emulated) -> Self {
        let dram = EmulatedDram::new(chip.budget.dram_bytes, SharedImage::default(), SharedImage::default());
        Self { card: Card::with_chip(chip.chip(), dram) }
    }

    /// Takes bytes from the host, and works for about `longest`, or until the host has to say more. Appends
    /// bytes for the host to `sent`. Returns whether there is work left.
    pub fn go_on(&mut self, received: &[u8], longest: Duration, sent: &mut Vec<u8>) -> bool {
        let start = Instant::now();
        self.card.feed(received);
        for step in 0_usize.. {
            self.send(sent);
            if !self.card.is_busy() {
                break;
            }
            if step.is_multiple_of(STEPS) && start.elapsed() >= longest {
                return true;
            }
            self.card.work();
        }
        self.card.acknowledge();
        self.send(sent);
        self.card.is_busy()
    }

    fn send(&mut self, sent: &mut Vec<u8>) {
        loop {
            let outgoing = self.card.outgoing();
            if outgoing.is_empty() {
                return;
            }
            sent.extend(outgoing);
            let bytes = outgoing.len();
            self.card.sent(bytes);
        }
    }
}
