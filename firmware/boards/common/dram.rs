//! Card memory: where the linker script says.

use core::sync::atomic::{AtomicBool, Ordering};

use photoncard_shared::address::{LINE_BYTES, Line};

unsafe extern "C" {
    /// First byte of card memory, at a multiple of a line.
    static mut __card_dram: [Line; 0];
    /// Past the last.
    static mut __card_dram_end: [Line; 0];
}

/// All of card memory, holding whatever it held at power-on; `None` if it has been taken.
pub(super) fn take() -> Option<&'static mut [Line]> {
    static TAKEN: AtomicBool = AtomicBool::new(false);
    if TAKEN.swap(true, Ordering::Relaxed) {
        return None;
    }
    let (start, end) = (&raw mut __card_dram, &raw mut __card_dram_end);
    let lines = (end.addr() - start.addr()) / LINE_BYTES;
    // SAFETY: the linker script places nothing else between the two symbols, which are aligned to a line; a line is
    // bytes, of which any value is one; it is taken once, so no other reference exists.
    Some(unsafe { core::slice::from_raw_parts_mut(start.cast(), lines) })
}
