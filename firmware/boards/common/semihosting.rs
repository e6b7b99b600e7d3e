//! Semihosting: text output and exit through a debugger or QEMU (Arm's specification "Semihosting"). On
//! RISC-V only the trap instructions differ.

use core::arch::asm;
use core::fmt::{self, Write};
use core::sync::atomic::{AtomicBool, Ordering};

const WRITE0: usize = 0x04;
const EXIT_EXTENDED: usize = 0x20;
/// Semihosting's reason code of an exit by the program itself, with an exit status.
const APPLICATION_EXIT: usize = 0x20026;
/// Exit status of a Rust program that panicked.
const FAILED: usize = 101;

/// True if there is no debugger that receives messages.
static IS_ALONE: AtomicBool = AtomicBool::new(false);

/// Declares that there is no debugger. Messages are dropped. A failure still calls the debugger; the call is
/// then a fault of the processor, and the board's fault handler ends the program.
#[allow(dead_code, reason = "a board in QEMU has a debugger")]
pub(crate) fn leave_alone() {
    IS_ALONE.store(true, Ordering::Relaxed);
}

/// Calls the debugger.
///
/// # Safety
/// `argument` must be valid for the operation `operation`.
unsafe fn call(operation: usize, argument: *const ()) {
    #[cfg(target_arch = "arm")]
    // SAFETY: the debugger reads what the argument points to, and answers in r0.
    unsafe {
        asm!("bkpt 0xab", inout("r0") operation => _, in("r1") argument, options(nostack));
    }
    #[cfg(target_arch = "riscv32")]
    // SAFETY: as above, in a0. A debugger recognizes the three instructions if they are uncompressed and in
    // one page.
    unsafe {
        asm!(
            ".balign 16",
            ".option push",
            ".option norvc",
            "slli x0, x0, 0x1f",
            "ebreak",
            "srai x0, x0, 7",
            ".option pop",
            inout("a0") operation => _, in("a1") argument, options(nostack)
        );
    }
}

/// Buffer that passes text to the debugger in zero-terminated pieces.
struct Console {
    bytes: [u8; 128],
    length: usize,
}

impl Console {
    fn flush(&mut self) {
        if let Some(end) = self.bytes.get_mut(self.length) {
            *end = 0;
            // SAFETY: the text ends with a zero.
            unsafe { call(WRITE0, self.bytes.as_ptr().cast()) };
        }
        self.length = 0;
    }
}

impl Write for Console {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for &byte in text.as_bytes() {
            if self.length + 1 >= self.bytes.len() {
                self.flush();
            }
            if let Some(target) = self.bytes.get_mut(self.length) {
                *target = byte;
                self.length += 1;
            }
        }
        Ok(())
    }
}

pub(crate) fn print(message: fmt::Arguments) {
    if IS_ALONE.load(Ordering::Relaxed) {
        return;
    }
    let mut console = Console { bytes: [0; 128], length: 0 };
    // Writing to a console does not fail.
    let _ = console.write_fmt(message);
    console.flush();
}

/// Prints a message and ends the program with the exit status [`FAILED`].
pub(crate) fn fail(message: fmt::Arguments) -> ! {
    print(message);
    exit(FAILED);
}

pub(crate) fn exit(status: usize) -> ! {
    let exit = [APPLICATION_EXIT, status];
    // SAFETY: the two words that this operation takes.
    unsafe { call(EXIT_EXTENDED, exit.as_ptr().cast()) };
    loop {
        core::hint::spin_loop();
    }
}
