//! Reports of a board image's memory: to a debugger at the start, and to hosts on request.

use core::time::Duration;

use photoncard_shared::link::{Port, PortError};
use photoncard_shared::message::MemoryUse;

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

fn bytes(start: *const [u8; 0], end: *const [u8; 0]) -> usize {
    end.addr() - start.addr()
}

fn data_bytes() -> usize {
    bytes(&raw const __sdata, &raw const __edata)
}

fn zeroed_bytes() -> usize {
    bytes(&raw const __sbss, &raw const __ebss)
}

/// Prints the sizes of the board image's sections.
pub(super) fn sections(board: &str) {
    semihosting::print(format_args!(
        "photoncard on {board}: code {}, constants {}, data {}, zeroed data {}, stack {} bytes\n",
        bytes(&raw const __stext, &raw const __etext),
        bytes(&raw const __srodata, &raw const __erodata),
        data_bytes(),
        zeroed_bytes(),
        stack::bytes(),
    ));
}

/// Sizes of the board image's static data and stack, and the maximum use of the stack.
pub(super) fn memory_use() -> MemoryUse {
    MemoryUse {
        static_bytes: (data_bytes() + zeroed_bytes()) as u32,
        stack_bytes: stack::bytes() as u32,
        stack_used: stack::high_water() as u32,
    }
}

/// Port wrapper that ends the program after a stack overflow, because data below the stack may be corrupt.
pub(super) struct StackCheck<P>(pub(super) P);

impl<P: Port> Port for StackCheck<P> {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, PortError> {
        if stack::is_used_up() {
            semihosting::fail(format_args!("the stack of {} bytes is too small\n", stack::bytes()));
        }
        self.0.read(buffer, wait)
    }

    fn write(&mut self, bytes: &[u8], wait: Duration) -> Result<usize, PortError> {
        self.0.write(bytes, wait)
    }
}
