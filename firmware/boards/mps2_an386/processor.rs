//! Clock, interrupts and faults of the processor, whatever the link of the image is ("Armv7-M", DDI 0403).

use core::arch::asm;
use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m_rt::{ExceptionFrame, exception};

use crate::common::register::Register;
use crate::common::semihosting;

/// Processor cycles per millisecond, at 25 MHz.
const CYCLES: u32 = 25_000;

// SAFETY: the registers of the system's timer and of the interrupt controller, by the document above.
const TIMER_CONTROL: Register<u32> = unsafe { Register::at(0xE000_E010) };
const TIMER_RELOAD: Register<u32> = unsafe { Register::at(0xE000_E014) };
const TIMER_VALUE: Register<u32> = unsafe { Register::at(0xE000_E018) };
const INTERRUPT_ENABLE: Register<u32> = unsafe { Register::at(0xE000_E100) };

static MILLISECONDS: AtomicU32 = AtomicU32::new(0);

/// Starts the timer, which interrupts every millisecond.
pub(crate) fn start_clock() {
    TIMER_RELOAD.write(CYCLES - 1);
    TIMER_VALUE.write(0);
    // Enables the timer and its interrupt; the timer counts cycles of the processor.
    TIMER_CONTROL.write(7);
}

/// Enables one of the interrupts 0 to 31; the image's `DefaultHandler` takes it.
pub(crate) fn enable_interrupt(number: i16) {
    INTERRUPT_ENABLE.write(1 << number);
}

/// Time since the start, milliseconds, modulo 2^32.
pub(crate) fn milliseconds() -> u32 {
    MILLISECONDS.load(Ordering::Relaxed)
}

/// Runs `work` with interrupts masked.
pub(crate) fn masked<R>(work: impl FnOnce() -> R) -> R {
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

/// Sleeps until an interrupt is pending.
pub(crate) fn sleep() {
    // SAFETY: waits for an interrupt without changing any state.
    unsafe { asm!("wfi", options(nostack, preserves_flags)) };
}

#[exception]
fn SysTick() {
    MILLISECONDS.fetch_add(1, Ordering::Relaxed);
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    semihosting::fail(format_args!("a fault at {:#010x}\n", frame.pc()));
}
