//! The stack of a board image, which lies between two symbols of the linker script.

use core::ops::Range;

use photoncard_firmware::stack;

unsafe extern "C" {
    /// Lowest word of the stack.
    static mut _stack_end: [u32; 0];
    /// End of the stack, exclusive.
    static mut _stack_start: [u32; 0];
}

fn words() -> Range<*mut u32> {
    (&raw mut _stack_end).cast()..(&raw mut _stack_start).cast()
}

pub(super) fn bytes() -> usize {
    let Range { start, end } = words();
    end.addr() - start.addr()
}

/// Fills the unused stack with a pattern. To be called first, before interrupts are enabled.
pub(super) fn paint() {
    // SAFETY: the program runs on this stack, and no interrupt is enabled yet.
    unsafe { stack::paint(words()) }
}

/// Returns whether one of the lowest words of the stack was used.
pub(super) fn is_used_up() -> bool {
    // SAFETY: the words are those of the stack.
    unsafe { stack::is_used_up(words()) }
}

/// Maximum use of the stack, bytes.
pub(super) fn high_water() -> usize {
    // SAFETY: as above.
    unsafe { stack::used(words()) }
}
