//! A card executes commands and sends replies. It is a state machine without I/O that consumes and produces
//! bytes.
//!
//! Its caller ([`crate::serve`] or a simulator) passes received bytes to [`Card::feed`] and sends the bytes
//! of [`Card::outgoing`]. It calls [`Card::work`] at least while [`Card::is_busy`] returns true, and
//! [`Card::acknowledge`] when no bytes arrive. A call takes at most the time of some rays or gathers, or of
//! the checksum of a few lines. No call blocks or panics, whatever the input.

mod engine;
mod frame;
mod load;

use photoncard_shared::budget::MAX_GATHER_RAYS;
use photoncard_shared::message::{self, Board, Command, Fault, FaultCode, MemoryUse, Reply};
use photoncard_shared::transport::Transport;

pub use self::engine::MAX_TILES;
use self::engine::{Engine, send};
pub use self::frame::{MAX_PICTURE_SIDE, MIN_IRRADIANCE_ERROR};
use crate::chip::Chip;
use crate::kind::{ChipKind, FixedKind, Micro, Reference, cache_bytes};
use crate::memory::{CardMemory, Dram};

/// A card: its memory, its chip, and both directions of its link to the host.
pub struct Card<K: ChipKind, M> {
    memory: M,
    transport: Transport,
    engine: Engine<K>,
}

impl<K: FixedKind, M: CardMemory> Card<K, M> {
    /// Creates a card, before its first session. It has the size of its kind's buffers, 100 KB of a
    /// [`MicroCard`]: on a chip it is the initial value of a static, with a memory such as [`Dram::EMPTY`],
    /// and never on the stack.
    pub const fn new(memory: M) -> Self {
        const { check::<K>() };
        Self::with_chip(Chip::new(), memory)
    }
}

impl<K: ChipKind, M: CardMemory> Card<K, M> {
    /// Creates a card with the given chip, before its first session.
    pub const fn with_chip(chip: Chip<K>, memory: M) -> Self {
        Self { memory, transport: Transport::card(), engine: Engine::new(chip) }
    }

    /// Card memory, with its counters of memory traffic if it has any.
    pub fn memory(&mut self) -> &mut M {
        &mut self.memory
    }

    /// Sets the function that measures on-chip memory. [`Reply::Hello`] reports the result; without a
    /// function it reports `None`.
    pub fn measure_memory_by(&mut self, measure: fn() -> MemoryUse) {
        self.engine.measure = Some(measure);
    }

    /// Sets the board, which [`Reply::Hello`] reports; without one it reports `None`.
    pub fn run_on(&mut self, board: Board<'static>) {
        self.engine.board = Some(board.cut());
    }

    /// Sets the function that reads a counter of processor cycles, such as `DWT->CYCCNT` or `mcycle`. It may
    /// wrap, but not within one [`Self::work`]. [`Counters::cycles`](photoncard_shared::counters::Counters)
    /// reports the cycles of the work on a tile.
    pub fn count_cycles_by(&mut self, cycles: fn() -> u32) {
        self.engine.cycles = Some(cycles);
    }

    /// Returns true while [`Self::work`] can proceed without further bytes from the host.
    pub fn is_busy(&self) -> bool {
        self.engine.has_work() && self.transport.can_send()
    }

    /// Bytes to be sent to the host now.
    pub fn outgoing(&mut self) -> &[u8] {
        self.transport.outgoing()
    }

    /// Removes the first `bytes` bytes of [`Self::outgoing`] after they were sent.
    pub fn sent(&mut self, bytes: usize) {
        self.transport.sent(bytes);
    }

    /// Consumes bytes from the host and executes complete commands. Long work is left to [`Self::work`].
    pub fn feed(&mut self, bytes: &[u8]) {
        let mut rest = bytes;
        while !rest.is_empty() {
            let (taken, _) = self.transport.receive(rest);
            rest = rest.get(taken..).unwrap_or(&[]);
            self.execute();
        }
    }

    /// Executes the received commands as long as there is room for a reply to each.
    fn execute(&mut self) {
        let Self { memory, transport, engine } = self;
        while transport.can_send() {
            let Some(payload) = transport.take() else { break };
            let result = match message::decode::<Command>(payload) {
                None => Err(Fault { code: FaultCode::Message, detail: payload.len() as u32 }),
                Some(command) => engine.execute(memory, &command),
            };
            match result {
                Ok(Some(reply)) => send(transport, &reply),
                Ok(None) => {}
                Err(fault) => send(transport, &Reply::Fault(fault)),
            }
        }
    }

    /// Acknowledges received frames. To be called when no more bytes arrive, before the caller waits.
    pub fn acknowledge(&mut self) {
        self.transport.acknowledge();
    }

    /// Does the next piece of work, if there is room for a reply.
    pub fn work(&mut self) {
        if !self.transport.can_send() {
            return;
        }
        if let Err(fault) = self.engine.work(&mut self.memory, &mut self.transport) {
            send(&mut self.transport, &Reply::Fault(fault));
        }
    }
}

/// Card with a reference chip.
pub type ReferenceCard<M> = Card<Reference, M>;
/// Card with a micro chip.
pub type MicroCard<M> = Card<Micro, M>;

/// On-chip memory of a card of kind `K`, bytes: its buffers, plus the caches and the stack of the budget.
pub const fn sram_bytes<K: FixedKind>() -> usize {
    size_of::<Card<K, Dram<'static>>>() + cache_bytes(&K::BUDGET) + K::BUDGET.stack_bytes as usize
}

/// Checks at compile time that a card of a kind fits its budget.
const fn check<K: FixedKind>() {
    assert!(
        sram_bytes::<K>() <= K::BUDGET.sram_bytes as usize,
        "the card's buffers exceed the budget's SRAM"
    );
    assert!(Chip::<K>::TECHNIQUES.is_within(&K::TECHNIQUE_LIMITS), "a technique exceeds its limit");
    assert!(K::BUDGET.gather_rays <= MAX_GATHER_RAYS, "too many gather rays");
    assert!(K::BUDGET.tiles as usize <= MAX_TILES, "too many tiles wait");
}
