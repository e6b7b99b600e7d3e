//! The UART of the board (Arm, "AN386", DAI 0386; "Cortex-M System Design Kit", DDI 0479).

use cortex_m_rt::exception;
use photoncard_shared::link::Port;

use crate::common::register::Register;
use crate::common::uart::{self, Uart, UartPort, receive_all};
use crate::common::{Board, semihosting};
use crate::processor;

/// Number of the UART's receive interrupt.
const UART_RECEIVED: i16 = 0;

// SAFETY: the registers of UART 0, by the documents above.
const UART_DATA: Register<u32> = unsafe { Register::at(0x4000_4000) };
const UART_STATE: Register<u32> = unsafe { Register::at(0x4000_4004) };
const UART_CONTROL: Register<u32> = unsafe { Register::at(0x4000_4008) };
const UART_INTERRUPT: Register<u32> = unsafe { Register::at(0x4000_400C) };
const UART_DIVISOR: Register<u32> = unsafe { Register::at(0x4000_4010) };

const STATE_TRANSMIT_FULL: u32 = 1;
const STATE_RECEIVED: u32 = 2;
const CONTROL_ENABLE: u32 = 3;
const CONTROL_RECEIVE_INTERRUPT: u32 = 8;
const INTERRUPT_RECEIVED: u32 = 2;
/// Minimum divisor of the UART's clock, for maximum speed.
const MIN_DIVISOR: u32 = 16;

/// Arm's MPS2 board with the FPGA image AN386.
pub(crate) struct Mps2An386;

pub(crate) type ThisBoard = Mps2An386;

impl Board for Mps2An386 {
    const NAME: &'static str = "mps2-an386";
    const LINK_BYTES: usize = uart::STATIC_BYTES;

    fn start() {
        processor::start_clock();
        UART_DIVISOR.write(MIN_DIVISOR);
        Self::listen(true);
        processor::enable_interrupt(UART_RECEIVED);
    }

    fn port() -> impl Port {
        UartPort::<Self>::new()
    }

    fn milliseconds() -> u32 {
        processor::milliseconds()
    }

    fn masked<R>(work: impl FnOnce() -> R) -> R {
        processor::masked(work)
    }

    fn sleep() {
        processor::sleep();
    }
}

impl Uart for Mps2An386 {
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
}

#[exception]
unsafe fn DefaultHandler(number: i16) {
    match number {
        UART_RECEIVED => receive_all::<Mps2An386>(),
        _ => semihosting::fail(format_args!("interrupt {number}, which nobody asked for\n")),
    }
}
