//! Registers and exceptions of the board (Arm, "AN386", DAI 0386; "Cortex-M System Design Kit", DDI 0479;
//! "Armv7-M", DDI 0403).

use core::arch::asm;
use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m_rt::{ExceptionFrame, exception};

use crate::common::register::Register;
use crate::common::{Board, receive_all, semihosting};

/// Processor cycles per millisecond, at 25 MHz.
const CYCLES: u32 = 25_000;

/// Number of the UART's receive interrupt.
const UART_RECEIVED: i16 = 0;

// SAFETY: the registers of UART 0, of the system's timer and of the interrupt controller, by the documents
// above.
const UART_DATA: Register<u32> = unsafe { Register::at(0x4000_4000) };
const UART_STATE: Register<u32> = unsafe { Register::at(0x4000_4004) };
const UART_CONTROL: Register<u32> = unsafe { Register::at(0x4000_4008) };
const UART_INTERRUPT: Register<u32> = unsafe { Register::at(0x4000_400C) };
const UART_DIVISOR: Register<u32> = unsafe { Register::at(0x4000_4010) };
const TIMER_CONTROL: Register<u32> = unsafe { Register::at(0xE000_E010) };
const TIMER_RELOAD: Register<u32> = unsafe { Register::at(0xE000_E014) };
const TIMER_VALUE: Register<u32> = unsafe { Register::at(0xE000_E018) };
const INTERRUPT_ENABLE: Register<u32> = unsafe { Register::at(0xE000_E100) };

const STATE_TRANSMIT_FULL: u32 = 1;
const STATE_RECEIVED: u32 = 2;
const CONTROL_ENABLE: u32 = 3;
const CONTROL_RECEIVE_INTERRUPT: u32 = 8;
const INTERRUPT_RECEIVED: u32 = 2;
/// Minimum divisor of the UART's clock, for maximum speed.
const MIN_DIVISOR: u32 = 16;

static MILLISECONDS: AtomicU32 = AtomicU32::new(0);

/// Arm's MPS2 board with the FPGA image AN386.
pub(crate) struct Mps2An386;

pub(crate) type ThisBoard = Mps2An386;

impl Board for Mps2An386 {
    const NAME: &'static str = "mps2-an386";

    fn start() {
        TIMER_RELOAD.write(CYCLES - 1);
        TIMER_VALUE.write(0);
        // Enables the timer and its interrupt; the timer counts cycles of the processor.
        TIMER_CONTROL.write(7);
        UART_DIVISOR.write(MIN_DIVISOR);
        Self::listen(true);
        INTERRUPT_ENABLE.write(1 << UART_RECEIVED);
    }

    fn receive() -> Option<u8> {
        // The interrupt is cleared before the byte is read, so that the next byte interrupts again.
        UART_INTERRUPT.write(INTERRUPT_RECEIVED);
        (UART_STATE.read() & STATE_RECEIVED != 0).then(|| UART_DATA.read() as u8)
    }

    fn transmit(byte: u8) -> bool {
        let has_room = UART_STATE.read() & STATE_TRANSMIT_FULL == 0;
        if has_room {
            UART_DATA.write(byte.into());
        }
        has_room
    }

    fn listen(is_interrupt: bool) {
        let interrupt = if is_interrupt { CONTROL_RECEIVE_INTERRUPT } else { 0 };
        UART_CONTROL.write(CONTROL_ENABLE | interrupt);
    }

    fn milliseconds() -> u32 {
        MILLISECONDS.load(Ordering::Relaxed)
    }

    fn masked<R>(work: impl FnOnce() -> R) -> R {
        let was_masked: u32;
        // SAFETY: interrupts are masked during the work, and afterwards restored to their previous state.
        unsafe { asm!("mrs {}, PRIMASK", "cpsid i", out(reg) was_masked, options(nostack, preserves_flags)) };
        let result = work();
        if was_masked & 1 == 0 {
            // SAFETY: as above.
            unsafe { asm!("cpsie i", options(nostack, preserves_flags)) };
        }
        result
    }

    fn sleep() {
        // SAFETY: waits for an interrupt without changing any state.
        unsafe { asm!("wfi", options(nostack, preserves_flags)) };
    }
}

#[exception]
fn SysTick() {
    MILLISECONDS.fetch_add(1, Ordering::Relaxed);
}

#[exception]
unsafe fn DefaultHandler(number: i16) {
    match number {
        UART_RECEIVED => receive_all::<Mps2An386>(),
        _ => semihosting::fail(format_args!("interrupt {number}, which nobody asked for\n")),
    }
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    semihosting::fail(format_args!("a fault at {:#010x}\n", frame.pc()));
}
