//! Code that all board images share, including `main`. A board adds registers, time and interrupts.

pub(crate) mod board;
#[expect(unsafe_code, reason = "the linker script defines the address of card memory")]
mod dram;
mod measure;
#[expect(unsafe_code, reason = "a static is handed out once")]
pub(crate) mod once;
#[allow(dead_code, reason = "a board may have a crate that knows its registers")]
#[expect(unsafe_code, reason = "registers are memory that changes by itself")]
pub(crate) mod register;
mod report;
#[expect(unsafe_code, reason = "a debugger is called by an instruction of its own")]
pub(crate) mod semihosting;
#[expect(unsafe_code, reason = "what the stack leaves behind is read as memory")]
mod stack;
#[allow(dead_code, reason = "a board's link may be another than a UART")]
pub(crate) mod uart;

use core::panic::PanicInfo;

#[cfg(target_arch = "arm")]
use cortex_m_rt::entry;
use photoncard_firmware::card::{MicroCard, sram_bytes};
use photoncard_firmware::chip::MicroChip;
use photoncard_firmware::kind::{MICRO, Micro};
use photoncard_firmware::memory::Dram;
use photoncard_firmware::serve::serve;
use photoncard_shared::address::{LINE_BYTES, Line};
use photoncard_shared::counters::Counters;
use photoncard_shared::message;
#[cfg(target_arch = "riscv32")]
use riscv_rt::entry;

pub(crate) use self::board::Board;
use self::once::Once;
use self::report::StackCheck;
use crate::hardware::ThisBoard;

/// The card, initialised at compile time so that its buffers are never on the stack. All of its bytes are
/// zero: it takes no place in flash.
static CARD: Once<MicroCard<Dram<'static>>> = Once::new(MicroCard::new(Dram::EMPTY));

// The card with the budget's caches and stack, and the link's buffers, fit the budget's SRAM.
const _: () = assert!(sram_bytes::<Micro>() + ThisBoard::LINK_BYTES <= MICRO.sram_bytes as usize);

#[entry]
fn main() -> ! {
    run::<ThisBoard>();
}

/// Serves the card on the board's link; never returns.
fn run<B: Board>() -> ! {
    B::prepare();
    stack::paint();
    report::sections(B::NAME);
    if stack::bytes() > MICRO.stack_bytes as usize {
        semihosting::fail(format_args!("the stack is larger than the budget's: {} bytes\n", stack::bytes()));
    }
    let (Some(card), Some(lines)) = (CARD.take(), dram::take()) else {
        semihosting::fail(format_args!("the card is already in use\n"));
    };
    if lines.len() * LINE_BYTES < MICRO.dram_bytes as usize {
        semihosting::fail(format_args!("card memory is smaller than the budget's: {} lines\n", lines.len()));
    }
    if cfg!(feature = "measure") {
        measure_and_exit::<B>(lines);
    }
    *card.memory() = Dram::new(lines);
    card.measure_memory_by(report::memory_use);
    card.run_on(message::Board { name: B::NAME, serial_number: "", clock_hz: B::CLOCK_HZ });
    B::start();
    if let Some(cycles) = B::CYCLES {
        card.count_cycles_by(cycles);
    }
    let port = B::port();
    semihosting::print(format_args!("ready\n"));
    let error = serve(card, &mut StackCheck(port));
    semihosting::fail(format_args!("the port failed: {error:?}\n"));
}

/// Prints the counters and the time, in milliseconds, of each [`measure::Work`]. With QEMU's
/// `-icount shift=0` the clock advances 1 ns per instruction, so that a millisecond is a million
/// instructions.
fn measure_and_exit<B: Board>(lines: &[Line]) -> ! {
    static CHIP: Once<MicroChip> = Once::new(MicroChip::new());
    let Some(chip) = CHIP.take() else { semihosting::fail(format_args!("the chip is in use\n")) };
    B::start();
    for work in measure::Work::ALL {
        let start = B::milliseconds();
        let Some(counters) = measure::render(chip, lines, work) else {
            semihosting::fail(format_args!("card memory holds no image and frame\n"));
        };
        let Counters { eye_rays, gather_rays, gathers, .. } = counters;
        let time = B::milliseconds().wrapping_sub(start);
        semihosting::print(format_args!("{work:?} {eye_rays} {gather_rays} {gathers} {time}\n"));
    }
    semihosting::exit(0);
}

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    semihosting::fail(format_args!("{info}\n"));
}
