//! Measure of a chip's use of its stack. The stack is filled with a pattern at the start; words that no
//! longer hold the pattern were used.
//!
//! A board calls [`paint`] first, before interrupts are enabled, and passes [`used`] to its host in
//! [`MemoryUse`](photoncard_shared::message::MemoryUse).

use core::ops::Range;

/// Pattern of unused words.
const PAINT: u32 = 0x5AFE_57AC;

/// Number of words at the low end of the stack that must stay unused. There are several because a stack frame
/// may leave some of its words unwritten.
const GUARD: usize = 16;

/// Number of bytes below the stack frame of [`paint`] that are not painted, because calls may use them.
const MARGIN: usize = 512;

/// Fills the unused part of the stack with the pattern.
///
/// # Safety
/// `stack` must be the stack that the caller runs on, from its lowest word to its end, and no interrupt may
/// use it during the call.
#[inline(never)]
pub unsafe fn paint(stack: Range<*mut u32>) {
    let here = 0_u32;
    let end = (&raw const here).addr().saturating_sub(MARGIN);
    let mut word = stack.start;
    while word.addr() < end {
        // SAFETY: the word belongs to the stack, and is so far below this frame that nothing uses it.
        unsafe {
            word.write_volatile(PAINT);
            word = word.add(1);
        }
    }
}

/// Maximum use of the stack since [`paint`], bytes.
///
/// # Safety
/// `stack` must be a stack, whatever its words hold, from its lowest word to its end.
pub unsafe fn used(stack: Range<*mut u32>) -> usize {
    let mut word = stack.start;
    // SAFETY: the words belong to the stack, and are read as memory.
    while word < stack.end && unsafe { word.read_volatile() } == PAINT {
        // SAFETY: the word is not the last, or this is the stack's end.
        word = unsafe { word.add(1) };
    }
    stack.end.addr() - word.addr()
}

/// Returns whether one of the lowest words of the stack was used since [`paint`]: it may have overflowed.
///
/// # Safety
/// As for [`used`].
pub unsafe fn is_used_up(stack: Range<*mut u32>) -> bool {
    let guard = (stack.end.addr() - stack.start.addr()) / size_of::<u32>();
    // SAFETY: the words belong to the stack, and are read as memory.
    (0..guard.min(GUARD)).any(|word| unsafe { stack.start.add(word).read_volatile() } != PAINT)
}
