//! A card of photoncard on a board of one's own, whose UART interrupts and is polled.
#![no_std]
#![no_main]

mod memory;
mod uart;

use cortex_m_rt::entry;
use photoncard_firmware::card::Card;
use photoncard_firmware::kind::Micro;
use photoncard_firmware::memory::Dram;
use photoncard_firmware::serve::serve;
use photoncard_shared::link::IoPort;
use photoncard_shared::message::Board;
use static_cell::ConstStaticCell;

/// The kind of chip. `Micro<8>` has 8 MB of card memory, `Nano` lives in 64 KB. The kind of one's own in
/// docs/bring-up.md takes some 30 lines.
pub type Kind = Micro<16>;

/// The card, a static: 100 KB do not fit a stack. All of its bytes are zero, so that it takes no flash.
static CARD: ConstStaticCell<Card<Kind, Dram<'static>>> =
    ConstStaticCell::new(Card::new(Dram::EMPTY));

#[entry]
fn main() -> ! {
    memory::paint_stack();
    let card = CARD.take();
    *card.memory() = Dram::new(memory::take_dram());
    card.measure_memory_by(memory::memory_use);
    // `card.count_cycles_by` takes a function that reads DWT->CYCCNT, on a processor that has it.
    card.run_on(Board {
        name: "mps2-an505",
        serial_number: "",
        clock_hz: 0,
    });
    let mut port = IoPort::new(uart::start());
    loop {
        // A UART has no end: what it returns is a failure of its device, and the host begins anew.
        let _ = serve(card, &mut port);
    }
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    loop {
        core::hint::spin_loop();
    }
}
