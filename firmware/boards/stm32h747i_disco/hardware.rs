//! Clocks, registers and exceptions of the board (ST, "RM0399", "UM2411"; "Armv7-M", DDI 0403). The code
//! compiles, but was not run on the board.

use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::peripheral::{DCB, DWT, MPU, NVIC, SCB};
use cortex_m_rt::{ExceptionFrame, exception};
use photoncard_shared::link::Port;
use stm32h7xx_hal::pac::{self, Interrupt, USART1, interrupt};
use stm32h7xx_hal::prelude::*;
use stm32h7xx_hal::serial::Event;

use super::sdram::{self, Ports};
use crate::common::uart::{self, Uart, UartPort, receive_all};
use crate::common::{Board, semihosting};

const HERTZ: u32 = 400_000_000;
/// Baud rate. Both the debugger's serial port and the board can produce it from their clocks.
const BAUD: u32 = 921_600;

/// Base address of card memory, as in `memory.x`.
const SDRAM: u32 = 0xD000_0000;
/// Size field of the memory protection unit's region: `log2(32 MB) - 1`.
const SDRAM_SIZE: u32 = 25 - 1;

static MILLISECONDS: AtomicU32 = AtomicU32::new(0);

/// ST's board STM32H747I-DISCO.
pub(crate) struct Disco;

pub(crate) type ThisBoard = Disco;

impl Disco {
    /// UART that is wired to the debugger's serial port.
    fn uart() -> &'static pac::usart1::RegisterBlock {
        // SAFETY: every register that is written here is written by single stores, with interrupts masked
        // where the interrupt writes it too.
        unsafe { &*USART1::ptr() }
    }

    /// Maps card memory as normal, cacheable memory. By default its addresses are device memory, which is
    /// slow and faults at unaligned accesses.
    fn make_cacheable(mpu: &MPU, scb: &mut SCB) {
        // SAFETY: the region is not in use yet. Full access, normal memory, write-through, execute never.
        unsafe {
            mpu.rnr.write(0);
            mpu.rbar.write(SDRAM);
            mpu.rasr.write(1 << 28 | 3 << 24 | 1 << 17 | SDRAM_SIZE << 1 | 1);
            // MPU enabled, with the default map as background.
            mpu.ctrl.write(1 << 2 | 1);
        }
        cortex_m::asm::dsb();
        cortex_m::asm::isb();
        scb.enable_icache();
    }
}

impl Board for Disco {
    const NAME: &'static str = "stm32h747i-disco";
    const CLOCK_HZ: u32 = HERTZ;
    const CYCLES: Option<fn() -> u32> = Some(DWT::cycle_count);
    const LINK_BYTES: usize = uart::STATIC_BYTES;

    /// Prepares for a start without a debugger: text output is dropped, and a failure is a fault whose
    /// handler resets the chip.
    fn prepare() {
        if !DCB::is_debugger_attached() {
            semihosting::leave_alone();
        }
    }

    fn start() {
        let (Some(mut core), Some(chip)) = (cortex_m::Peripherals::take(), pac::Peripherals::take()) else {
            semihosting::fail(format_args!("the chip's devices are already in use\n"));
        };
        // The board supplies the core through the switching regulator.
        let power = chip.PWR.constrain().smps().freeze();
        let clocks = chip.RCC.constrain().sys_ck(HERTZ.Hz()).hclk(200.MHz()).freeze(power, &chip.SYSCFG);
        let ports = Ports {
            d: chip.GPIOD.split(clocks.peripheral.GPIOD),
            e: chip.GPIOE.split(clocks.peripheral.GPIOE),
            f: chip.GPIOF.split(clocks.peripheral.GPIOF),
            g: chip.GPIOG.split(clocks.peripheral.GPIOG),
            h: chip.GPIOH.split(clocks.peripheral.GPIOH),
            i: chip.GPIOI.split(clocks.peripheral.GPIOI),
        };
        let mut memory = sdram::controller(chip.FMC, ports, clocks.peripheral.FMC, &clocks.clocks);
        let mut delay = core.SYST.delay(clocks.clocks);
        let _: *mut u32 = memory.init(&mut delay);
        // Card memory is made cacheable after `init`, because the processor may prefetch normal memory, and
        // SDRAM does not answer before `init`.
        Self::make_cacheable(&core.MPU, &mut core.SCB);
        let gpioa = chip.GPIOA.split(clocks.peripheral.GPIOA);
        let pins = (gpioa.pa9.into_alternate(), gpioa.pa10.into_alternate());
        let Ok(mut serial) = chip.USART1.serial(pins, BAUD.bps(), clocks.peripheral.USART1, &clocks.clocks)
        else {
            semihosting::fail(format_args!("the UART has no such rate\n"));
        };
        serial.listen(Event::Rxne);
        let mut timer = delay.free();
        timer.set_clock_source(SystClkSource::Core);
        timer.set_reload(HERTZ / 1000 - 1);
        timer.clear_current();
        timer.enable_interrupt();
        timer.enable_counter();
        core.DCB.enable_trace();
        DWT::unlock();
        core.DWT.enable_cycle_counter();
        // SAFETY: the handler is defined below, and no critical section is active.
        unsafe { NVIC::unmask(Interrupt::USART1) };
    }

    fn port() -> impl Port {
        UartPort::<Self>::new()
    }

    fn milliseconds() -> u32 {
        MILLISECONDS.load(Ordering::Relaxed)
    }

    fn masked<R>(work: impl FnOnce() -> R) -> R {
        cortex_m::interrupt::free(|_| work())
    }

    fn sleep() {
        cortex_m::asm::wfi();
    }
}

impl Uart for Disco {
    fn receive() -> Option<u8> {
        let uart = Self::uart();
        // An overrun interrupts until it is cleared; the damaged frame is sent again.
        uart.icr.write(|clear| clear.orecf().set_bit());
        uart.isr.read().rxne().bit_is_set().then(|| uart.rdr.read().rdr().bits() as u8)
    }

    fn transmit(byte: u8) -> bool {
        let has_room = Self::uart().isr.read().txe().bit_is_set();
        if has_room {
            Self::uart().tdr.write(|data| data.tdr().bits(byte.into()));
        }
        has_room
    }

    fn listen(is_interrupt: bool) {
        Self::uart().cr1.modify(|_, control| control.rxneie().bit(is_interrupt));
    }
}

#[exception]
fn SysTick() {
    MILLISECONDS.fetch_add(1, Ordering::Relaxed);
}

#[interrupt]
fn USART1() {
    receive_all::<Disco>();
}

#[exception]
unsafe fn DefaultHandler(number: i16) {
    semihosting::fail(format_args!("interrupt {number}, which nobody asked for\n"));
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    if !DCB::is_debugger_attached() {
        SCB::sys_reset();
    }
    semihosting::fail(format_args!("a fault at {:#010x}\n", frame.pc()));
}
