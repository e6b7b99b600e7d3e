//! Measures stack use. The stack is filled with a pattern at the start; words that no longer hold the pattern
//! were used.

/// Pattern of unused words.
const PAINT: u32 = 0x5AFE_57AC;

/// Number of words at the low end of the stack that must stay unused. There are several because a stack frame
/// may leave some of its words unwritten.
const GUARD: usize = 16;

/// Number of bytes below the stack frame of [`paint`] that are not painted, because calls may use them.
const MARGIN: usize = 512;

unsafe extern "C" {
    /// Lowest word of the stack.
    static mut _stack_end: [u32; 0];
    /// End of the stack, exclusive.
    static mut _stack_start: [u32; 0];
}

fn lowest() -> *mut u32 {
    (&raw mut _stack_end).cast()
}

pub(super) fn bytes() -> usize {
    (&raw mut _stack_start).addr() - lowest().addr()
}

/// Fills the unused stack with the pattern. To be called first, before interrupts are enabled.
#[inline(never)]
pub(super) fn paint() {
    let here = 0_u32;
    let end = (&raw const here).addr().saturating_sub(MARGIN);
    let mut word = lowest();
    while word.addr() < end {
        // SAFETY: the word belongs to the stack, and is so far below this frame that nothing uses it.
        unsafe {
            word.write_volatile(PAINT);
            word = word.add(1);
        }
    }
}

/// Returns whether one of the [`GUARD`] lowest words of the stack was used.
pub(super) fn is_used_up() -> bool {
    // SAFETY: as below.
    (0..GUARD).any(|word| (unsafe { lowest().add(word).read_volatile() }) != PAINT)
}

/// Maximum use of the stack, bytes.
pub(super) fn high_water() -> usize {
    let words = bytes() / size_of::<u32>();
    let mut unused = 0;
    // SAFETY: the words belong to the stack; they are read as memory, whatever they hold.
    while unused < words && unsafe { lowest().add(unused).read_volatile() } == PAINT {
        unused += 1;
    }
    (words - unused) * size_of::<u32>()
}
