//! Card memory and the stack, which lie between symbols of `memory.x`.

use core::ops::Range;
use core::sync::atomic::{AtomicBool, Ordering};

use photoncard_firmware::stack;
use photoncard_shared::address::{LINE_BYTES, Line};
use photoncard_shared::message::MemoryUse;

unsafe extern "C" {
    static mut __card_dram: [Line; 0];
    static mut __card_dram_end: [Line; 0];
    static mut _stack_end: [u32; 0];
    static mut _stack_start: [u32; 0];
    static __sdata: [u8; 0];
    static __edata: [u8; 0];
    static __sbss: [u8; 0];
    static __ebss: [u8; 0];
}

/// Takes the whole card memory, once. External memory must be set up before.
pub fn take_dram() -> &'static mut [Line] {
    static TAKEN: AtomicBool = AtomicBool::new(false);
    let (start, end) = (&raw mut __card_dram, &raw mut __card_dram_end);
    if TAKEN.swap(true, Ordering::Relaxed) {
        return &mut [];
    }
    let lines = (end.addr() - start.addr()) / LINE_BYTES;
    // SAFETY: `memory.x` reserves this memory, which is aligned to a line, and any bytes are a line; it is
    // taken once.
    unsafe { core::slice::from_raw_parts_mut(start.cast(), lines) }
}

fn stack_words() -> Range<*mut u32> {
    (&raw mut _stack_end).cast()..(&raw mut _stack_start).cast()
}

/// Fills the unused stack with a pattern.
pub fn paint_stack() {
    // SAFETY: the program runs on this stack, and no interrupt is enabled yet.
    unsafe { stack::paint(stack_words()) }
}

/// Static data and stack, for `photoncard card info`.
pub fn memory_use() -> MemoryUse {
    let words = stack_words();
    let bytes = |start: *const [u8; 0], end: *const [u8; 0]| (end.addr() - start.addr()) as u32;
    MemoryUse {
        static_bytes: bytes(&raw const __sdata, &raw const __edata)
            + bytes(&raw const __sbss, &raw const __ebss),
        stack_bytes: (words.end.addr() - words.start.addr()) as u32,
        // SAFETY: the words are those of the stack.
        stack_used: unsafe { stack::used(words) } as u32,
    }
}
