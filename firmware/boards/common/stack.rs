//! How much of the stack is used: it is painted at the start, and what is no longer paint was used.

/// What the unused stack holds.
const PAINT: u32 = 0x5AFE_57AC;

/// Words at the end of the stack that nothing may use: a frame may leave some of its own as they were.
const GUARD: usize = 16;

/// Bytes below the caller's frame that the painting itself may use.
const MARGIN: usize = 512;

unsafe extern "C" {
    /// The lowest word of the stack.
    static mut _stack_end: [u32; 0];
    /// Past its highest.
    static mut _stack_start: [u32; 0];
}

fn lowest() -> *mut u32 {
    (&raw mut _stack_end).cast()
}

/// Size of the stack.
pub(super) fn bytes() -> usize {
    (&raw mut _stack_start).addr() - lowest().addr()
}

/// Paints what is not yet used. To be called first, before interrupts come.
#[inline(never)]
pub(super) fn paint() {
    let here = 0_u32;
    let end = (&raw const here).addr().saturating_sub(MARGIN);
    let mut word = lowest();
    while word.addr() < end {
        // SAFETY: the word belongs to the stack, and lies so far below this frame that nothing uses it.
        unsafe {
            word.write_volatile(PAINT);
            word = word.add(1);
        }
    }
}

/// Whether the stack has been used to its last words.
pub(super) fn is_used_up() -> bool {
    // SAFETY: as below.
    (0..GUARD).any(|word| (unsafe { lowest().add(word).read_volatile() }) != PAINT)
}

/// The most bytes of the stack that have been in use at once.
pub(super) fn high_water() -> usize {
    let words = bytes() / size_of::<u32>();
    let mut unused = 0;
    // SAFETY: the words belong to the stack; they are read as memory, whatever they hold.
    while unused < words && unsafe { lowest().add(unused).read_volatile() } == PAINT {
        unused += 1;
    }
    (words - unused) * size_of::<u32>()
}
