//! System calls of Linux that the program needs.

use core::arch::{asm, global_asm};

use photoncard_shared::address::{LINE_BYTES, Line};

global_asm!(".globl _start", "_start:", "and rsp, -16", "call program", "ud2");

unsafe extern "C" {
    /// First byte of the program in memory.
    static __executable_start: u8;
}

/// Address of a position that is relative to the start of the program.
pub(crate) fn address(place: usize) -> u64 {
    ((&raw const __executable_start).addr() + place) as u64
}

/// Makes a system call with up to six arguments.
///
/// # Safety
/// The requirements of the system call apply.
unsafe fn call(number: usize, arguments: [usize; 6]) -> isize {
    let [a, b, c, d, e, f] = arguments;
    let result;
    // SAFETY: the caller meets the call's requirements; the kernel changes the registers rcx and r11 alone.
    unsafe {
        asm!("syscall", inlateout("rax") number => result, in("rdi") a, in("rsi") b, in("rdx") c, in("r10") d, in("r8") e,
            in("r9") f, lateout("rcx") _, lateout("r11") _);
    }
    result
}

/// Maps the file of standard input into memory; `None` unless it is a file of whole lines.
pub(crate) fn standard_input() -> Option<&'static [Line]> {
    const SEEK_END: usize = 2;
    const PROT_READ: usize = 1;
    const MAP_PRIVATE: usize = 2;
    // SAFETY: the length of a file, and a new mapping of it, which is never removed.
    let (length, mapped) = unsafe {
        let length = usize::try_from(call(8, [0, 0, SEEK_END, 0, 0, 0])).ok()?;
        (length, call(9, [0, length, PROT_READ, MAP_PRIVATE, 0, 0]))
    };
    let first = usize::try_from(mapped).ok()?;
    if !length.is_multiple_of(LINE_BYTES) {
        return None;
    }
    // SAFETY: the mapping is as long; it begins at a page, and any bytes are a line.
    Some(unsafe { core::slice::from_raw_parts(first as *const Line, length / LINE_BYTES) })
}

/// Writes all bytes to standard output.
pub(crate) fn write(mut bytes: &[u8]) -> Option<()> {
    while !bytes.is_empty() {
        // SAFETY: the kernel only reads the bytes, which are borrowed during the call.
        let written = unsafe { call(1, [1, bytes.as_ptr().addr(), bytes.len(), 0, 0, 0]) };
        bytes = bytes.get(usize::try_from(written).ok().filter(|&written| written > 0)?..)?;
    }
    Some(())
}

/// Ends the program.
pub(crate) fn exit(status: usize) -> ! {
    // SAFETY: nothing is left to be done.
    unsafe { call(231, [status, 0, 0, 0, 0, 0]) };
    loop {}
}
