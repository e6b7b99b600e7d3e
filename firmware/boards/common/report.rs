//! What an image tells a debugger of its memory.

use core::time::Duration;

use photoncard_shared::link::{Port, PortError};

use super::{semihosting, stack};

#[expect(unsafe_code, reason = "addresses of the linker, of which nothing is read")]
unsafe extern "C" {
    static __stext: [u8; 0];
    static __etext: [u8; 0];
    static __srodata: [u8; 0];
    static __erodata: [u8; 0];
    static __sdata: [u8; 0];
    static __edata: [u8; 0];
    static __sbss: [u8; 0];
    static __ebss: [u8; 0];
}

/// Prints the sizes of the image's sections.
pub(super) fn memory(board: &str) {
    let bytes = |start: *const [u8; 0], end: *const [u8; 0]| end.addr() - start.addr();
    semihosting::print(format_args!(
        "photoncard on {board}: code {}, constants {}, data {}, zeroed data {}, stack {} bytes\n",
        bytes(&raw const __stext, &raw const __etext),
        bytes(&raw const __srodata, &raw const __erodata),
        bytes(&raw const __sdata, &raw const __edata),
        bytes(&raw const __sbss, &raw const __ebss),
        stack::bytes(),
    ));
}

/// A port that prints the stack's high water when it has risen and nothing else is to be done.
pub(super) struct Reporting<P> {
    port: P,
    printed: usize,
}

impl<P> Reporting<P> {
    /// Reports beside a port.
    pub(super) const fn new(port: P) -> Self {
        Self { port, printed: 0 }
    }
}

impl<P: Port> Port for Reporting<P> {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, PortError> {
        let count = self.port.read(buffer, wait)?;
        let is_idle = count == 0 && !wait.is_zero();
        if is_idle && stack::high_water() > self.printed {
            self.printed = stack::high_water();
            semihosting::print(format_args!("stack {} of {} bytes used\n", self.printed, stack::bytes()));
            if self.printed >= stack::bytes() {
                semihosting::fail(format_args!("the stack is too small\n"));
            }
        }
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8], wait: Duration) -> Result<usize, PortError> {
        self.port.write(bytes, wait)
    }
}
