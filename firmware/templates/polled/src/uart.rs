//! UART 0 of QEMU's mps2-an505 (Arm, "Cortex-M System Design Kit", DDI 0479; "AN505", DAI 0505). On your
//! board a hardware abstraction layer has it, with the traits of `embedded-io` and a buffer of its own: then
//! this file goes.

use core::convert::Infallible;

use cortex_m_rt::exception;
use embedded_io::{ErrorType, Read, ReadReady, Write, WriteReady};
use photoncard_firmware::serve::Ring;

const DATA: *mut u32 = 0x5020_0000 as *mut u32;
const STATE: *mut u32 = 0x5020_0004 as *mut u32;
const CONTROL: *mut u32 = 0x5020_0008 as *mut u32;
const INTERRUPT: *mut u32 = 0x5020_000C as *mut u32;
const DIVISOR: *mut u32 = 0x5020_0010 as *mut u32;
/// Interrupt controller: enables and raises interrupts 32 to 63. The UART's receive interrupt is 32.
const ENABLE: *mut u32 = 0xE000_E104 as *mut u32;
const RAISE: *mut u32 = 0xE000_E204 as *mut u32;
const RECEIVED_INTERRUPT: i16 = 32;

/// Bytes that have arrived. A host that keeps to its credits does not fill it while a tile is rendered.
static RECEIVED: Ring<512> = Ring::new();

pub struct Uart(());

/// Starts the UART. To be called once.
pub fn start() -> Uart {
    // SAFETY: the registers are those of the documents above.
    unsafe {
        DIVISOR.write_volatile(16);
        // Transmitter, receiver, and the receiver's interrupt.
        CONTROL.write_volatile(1 | 2 | 8);
        ENABLE.write_volatile(1);
    }
    Uart(())
}

#[exception]
unsafe fn DefaultHandler(number: i16) {
    if number != RECEIVED_INTERRUPT {
        return;
    }
    // SAFETY: as above. The interrupt is cleared before the byte is read, so that the next one interrupts.
    unsafe { INTERRUPT.write_volatile(2) };
    while !RECEIVED.is_full() && unsafe { STATE.read_volatile() } & 2 != 0 {
        RECEIVED.put(unsafe { DATA.read_volatile() } as u8);
    }
}

impl ErrorType for Uart {
    type Error = Infallible;
}

impl ReadReady for Uart {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        Ok(!RECEIVED.is_empty())
    }
}

impl Read for Uart {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        let bytes = buffer
            .iter_mut()
            .map_while(|target| RECEIVED.take().map(|byte| *target = byte));
        let count = bytes.count();
        // A byte may have found the ring full: the interrupt takes it now.
        // SAFETY: as above.
        unsafe { RAISE.write_volatile(1) };
        Ok(count)
    }
}

impl WriteReady for Uart {
    fn write_ready(&mut self) -> Result<bool, Infallible> {
        // SAFETY: as above.
        Ok(unsafe { STATE.read_volatile() } & 1 == 0)
    }
}

impl Write for Uart {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        let Some(&byte) = bytes.first() else {
            return Ok(0);
        };
        while !self.write_ready()? {}
        // SAFETY: as above.
        unsafe { DATA.write_volatile(byte.into()) };
        Ok(1)
    }

    fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}
