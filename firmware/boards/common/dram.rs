//! Card memory, which lies between two symbols of the linker script.

use core::sync::atomic::{AtomicBool, Ordering};

use photoncard_shared::address::{LINE_BYTES, Line};

unsafe extern "C" {
    /// Start of card memory, aligned to a line.
    static mut __card_dram: [Line; 0];
    /// End of card memory, exclusive.
    static mut __card_dram_end: [Line; 0];
}

/// Takes the whole card memory with its contents at power-on; `None` if it was taken before.
pub(super) fn take() -> Option<&'static mut [Line]> {
    static TAKEN: AtomicBool = AtomicBool::new(false);
    if TAKEN.swap(true, Ordering::Relaxed) {
        return None;
    }
    let (start, end) = (&raw mut __card_dram, &raw mut __card_dram_end);
    let lines = (end.addr() - start.addr()) / LINE_BYTES;
    // SAFETY: the linker script reserves the memory between the two symbols, which are aligned to a line; any
    // bytes are a valid line; it is taken once, so no other reference exists.
    Some(unsafe { core::slice::from_raw_parts_mut(start.cast(), lines) })
}
