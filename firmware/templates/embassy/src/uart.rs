//! UART of QEMU's machine `virt` ("NS16550A"; RISC-V "PLIC"). On your board a hardware abstraction layer has
//! it, with the traits of `embedded-io-async` and a buffer of its own: then this file goes.

use core::convert::Infallible;
use core::future::poll_fn;
use core::task::Poll;

use embassy_sync::waitqueue::AtomicWaker;
use embedded_io_async::{ErrorType, Read, Write};
use photoncard_firmware::serve::Ring;
use riscv::interrupt::Interrupt;
use riscv::register::mie;
use riscv_rt::core_interrupt;

const DATA: *mut u8 = 0x1000_0000 as *mut u8;
const INTERRUPT: *mut u8 = 0x1000_0001 as *mut u8;
const FIFO: *mut u8 = 0x1000_0002 as *mut u8;
const LINE: *mut u8 = 0x1000_0003 as *mut u8;
const STATUS: *mut u8 = 0x1000_0005 as *mut u8;
const IRQ: u32 = 10;
const PRIORITY: *mut u32 = (0x0C00_0000 + 4 * IRQ as usize) as *mut u32;
const ENABLE: *mut u32 = 0x0C00_2000 as *mut u32;
const THRESHOLD: *mut u32 = 0x0C20_0000 as *mut u32;
const CLAIM: *mut u32 = 0x0C20_0004 as *mut u32;

/// Bytes that have arrived. A host that keeps to its credits does not fill it while a tile is rendered.
static RECEIVED: Ring<512> = Ring::new();
static READER: AtomicWaker = AtomicWaker::new();

pub struct Reader(());
pub struct Writer(());

/// Starts the UART. To be called once.
pub fn start() -> (Reader, Writer) {
    // SAFETY: the registers are those of the documents above, and the interrupt's handler is below.
    unsafe {
        LINE.write_volatile(3);
        FIFO.write_volatile(7);
        INTERRUPT.write_volatile(1);
        PRIORITY.write_volatile(1);
        ENABLE.write_volatile(1 << IRQ);
        THRESHOLD.write_volatile(0);
        mie::set_mext();
        riscv::interrupt::enable();
    }
    (Reader(()), Writer(()))
}

#[core_interrupt(Interrupt::MachineExternal)]
fn external() {
    // SAFETY: as above.
    unsafe {
        let source = CLAIM.read_volatile();
        while !RECEIVED.is_full() && STATUS.read_volatile() & 1 != 0 {
            RECEIVED.put(DATA.read_volatile());
        }
        // A full ring leaves bytes in the UART, whose interrupt stays off until some were read.
        INTERRUPT.write_volatile((!RECEIVED.is_full()).into());
        CLAIM.write_volatile(source);
    }
    READER.wake();
}

impl ErrorType for Reader {
    type Error = Infallible;
}

impl Read for Reader {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        poll_fn(|context| {
            READER.register(context.waker());
            let count = buffer
                .iter_mut()
                .map_while(|target| RECEIVED.take().map(|byte| *target = byte))
                .count();
            if count == 0 {
                return Poll::Pending;
            }
            // SAFETY: as above.
            unsafe { INTERRUPT.write_volatile(1) };
            Poll::Ready(Ok(count))
        })
        .await
    }
}

impl ErrorType for Writer {
    type Error = Infallible;
}

impl Write for Writer {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        let Some(&byte) = bytes.first() else {
            return Ok(0);
        };
        poll_fn(|context| {
            // SAFETY: as above.
            if unsafe { STATUS.read_volatile() } & 1 << 5 == 0 {
                context.waker().wake_by_ref();
                return Poll::Pending;
            }
            // SAFETY: as above.
            unsafe { DATA.write_volatile(byte) };
            Poll::Ready(Ok(1))
        })
        .await
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}
