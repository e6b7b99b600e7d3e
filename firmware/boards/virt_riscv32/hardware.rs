//! Registers and traps of the machine (QEMU, `hw/riscv/virt.c`; "NS16550A"; RISC-V "ACLINT", "PLIC" and
//! privileged specifications).

use photoncard_shared::link::Port;
use riscv::interrupt::{Interrupt, machine};
use riscv::register::{mcause, mcycle, mepc, mie, mtval};
use riscv_rt::{TrapFrame, core_interrupt};

use crate::common::register::Register;
use crate::common::uart::{self, Uart, UartPort, receive_all};
use crate::common::{Board, semihosting};

/// Timer ticks per millisecond, at 10 MHz.
const TICKS: u64 = 10_000;

/// Interrupt number of the UART.
const UART_IRQ: u32 = 10;

// SAFETY: the registers of the UART, of hart 0's timer and of the interrupt controller, by the documents
// above.
const UART_DATA: Register<u8> = unsafe { Register::at(0x1000_0000) };
const UART_INTERRUPT: Register<u8> = unsafe { Register::at(0x1000_0001) };
const UART_FIFO: Register<u8> = unsafe { Register::at(0x1000_0002) };
const UART_LINE: Register<u8> = unsafe { Register::at(0x1000_0003) };
const UART_STATUS: Register<u8> = unsafe { Register::at(0x1000_0005) };
const TIMER_COMPARE: Register<u32> = unsafe { Register::at(0x0200_4000) };
const TIMER_COMPARE_HIGH: Register<u32> = unsafe { Register::at(0x0200_4004) };
const TIMER: Register<u32> = unsafe { Register::at(0x0200_BFF8) };
const TIMER_HIGH: Register<u32> = unsafe { Register::at(0x0200_BFFC) };
const PRIORITY: Register<u32> = unsafe { Register::at(0x0C00_0000 + 4 * UART_IRQ as usize) };
const ENABLE: Register<u32> = unsafe { Register::at(0x0C00_2000) };
const THRESHOLD: Register<u32> = unsafe { Register::at(0x0C20_0000) };
const CLAIM: Register<u32> = unsafe { Register::at(0x0C20_0004) };

const STATUS_RECEIVED: u8 = 1;
const STATUS_TRANSMIT_EMPTY: u8 = 1 << 5;
/// Line control: eight bits, no parity, one stop bit.
const LINE_8N1: u8 = 3;
/// FIFO control: FIFO enabled, receiver and transmitter cleared.
const FIFO_ON: u8 = 7;

/// QEMU's machine `virt`.
pub(crate) struct Virt;

pub(crate) type ThisBoard = Virt;

impl Virt {
    fn ticks() -> u64 {
        loop {
            let (high, low) = (TIMER_HIGH.read(), TIMER.read());
            if TIMER_HIGH.read() == high {
                return (u64::from(high) << 32) | u64::from(low);
            }
        }
    }

    fn wake_at(ticks: u64) {
        // The high word is the maximum while the low word changes: no intermediate compare value is in the
        // past.
        TIMER_COMPARE_HIGH.write(u32::MAX);
        TIMER_COMPARE.write(ticks as u32);
        TIMER_COMPARE_HIGH.write((ticks >> 32) as u32);
    }
}

impl Board for Virt {
    const NAME: &'static str = "virt-riscv32";
    const CYCLES: Option<fn() -> u32> = Some(|| mcycle::read() as u32);
    const LINK_BYTES: usize = uart::STATIC_BYTES;

    fn start() {
        Self::wake_at(u64::MAX);
        UART_LINE.write(LINE_8N1);
        UART_FIFO.write(FIFO_ON);
        Self::listen(true);
        PRIORITY.write(1);
        ENABLE.write(1 << UART_IRQ);
        THRESHOLD.write(0);
        // SAFETY: the handlers of both interrupts are defined below.
        unsafe {
            mie::set_mext();
            mie::set_mtimer();
            machine::enable();
        }
    }

    fn port() -> impl Port {
        UartPort::<Self>::new()
    }

    fn milliseconds() -> u32 {
        (Self::ticks() / TICKS) as u32
    }

    fn masked<R>(work: impl FnOnce() -> R) -> R {
        machine::free(work)
    }

    fn sleep() {
        Self::wake_at(Self::ticks() + TICKS);
        riscv::asm::wfi();
    }
}

impl Uart for Virt {
    fn receive() -> Option<u8> {
        (UART_STATUS.read() & STATUS_RECEIVED != 0).then(|| UART_DATA.read())
    }

    fn transmit(byte: u8) -> bool {
        let has_room = UART_STATUS.read() & STATUS_TRANSMIT_EMPTY != 0;
        if has_room {
            UART_DATA.write(byte);
        }
        has_room
    }

    fn listen(is_interrupt: bool) {
        UART_INTERRUPT.write(is_interrupt.into());
    }
}

#[core_interrupt(Interrupt::MachineTimer)]
fn timer() {
    Virt::wake_at(u64::MAX);
}

#[core_interrupt(Interrupt::MachineExternal)]
fn external() {
    let source = CLAIM.read();
    if source == UART_IRQ {
        receive_all::<Virt>();
    }
    CLAIM.write(source);
}

// SAFETY: the start-up crate calls the handler of all exceptions by this name.
#[unsafe(export_name = "ExceptionHandler")]
fn exception(_: &TrapFrame) -> ! {
    semihosting::fail(format_args!(
        "exception {} at {:#010x}, value {:#010x}\n",
        mcause::read().code(),
        mepc::read(),
        mtval::read()
    ));
}

// Before `main` there is no stack: a failure exits with a status and without a message.
core::arch::global_asm!(
    ".section .text.abort, \"ax\"",
    ".global _pre_init_trap",
    ".global abort",
    ".balign 16",
    "_pre_init_trap:",
    "abort:",
    "li a0, 0x20", // exit with a status: the two words below
    "la a1, 1f",
    ".balign 16",
    ".option push",
    ".option norvc",
    "slli x0, x0, 0x1f",
    "ebreak",
    "srai x0, x0, 7",
    ".option pop",
    "0: j 0b",
    ".balign 4",
    "1: .word 0x20026, 101",
);
