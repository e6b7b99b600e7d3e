//! Card memory and the stack, in the regions of `memory.x`.

use core::mem::MaybeUninit;
use core::ops::Range;
use core::sync::atomic::{AtomicBool, Ordering};

use photoncard_firmware::kind::FixedKind;
use photoncard_firmware::stack;
use photoncard_shared::address::{LINE_BYTES, Line};
use photoncard_shared::message::MemoryUse;

use crate::Kind;

/// Lines of the kind's card memory.
const LINES: usize = Kind::BUDGET.dram_bytes as usize / LINE_BYTES;

/// Card memory. The linker refuses a kind with more than the region DRAM of `memory.x` has.
#[unsafe(link_section = ".dram")]
static mut DRAM: MaybeUninit<[Line; LINES]> = MaybeUninit::uninit();

unsafe extern "C" {
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
    if TAKEN.swap(true, Ordering::Relaxed) {
        return &mut [];
    }
    // SAFETY: any bytes are lines, and they are taken once.
    unsafe { core::slice::from_raw_parts_mut((&raw mut DRAM).cast(), LINES) }
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
