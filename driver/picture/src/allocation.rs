//! Checks that memory can be allocated, before work that needs a known amount of it. A refusal is then an
//! error, whereas a failed allocation during the work aborts the process.

use std::hint::black_box;

/// Error: the process cannot allocate memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{bytes} bytes of memory are needed, which the system does not give")]
pub struct OutOfMemory {
    /// Size of the requested memory, bytes.
    pub bytes: u64,
}

impl OutOfMemory {
    /// Creates the error of a list with `elements` elements that cannot grow to twice that number.
    pub fn doubling<T>(elements: usize) -> Self {
        Self { bytes: 2 * (elements * size_of::<T>()) as u64 }
    }
}

/// Appends an element to a list.
///
/// # Errors
/// If the list cannot grow.
pub fn push<T>(list: &mut Vec<T>, element: T) -> Result<(), OutOfMemory> {
    list.try_reserve(1).map_err(|_| OutOfMemory::doubling::<T>(list.len()))?;
    list.push(element);
    Ok(())
}

/// Remedy to suggest when the system refuses memory.
pub const REMEDY: &str = if cfg!(target_family = "wasm") {
    "a page has at most 4 GiB: open the scene with the program `photoncard`"
} else {
    "close other programs, raise the process's limit (`ulimit -v`), or use a machine with more memory"
};

/// Checks that the process can allocate `bytes` at once. The allocation is freed again.
///
/// # Errors
/// If the allocation fails.
pub fn check(bytes: u64) -> Result<(), OutOfMemory> {
    let mut probe = Vec::<u8>::new();
    let all = usize::try_from(bytes).map_err(|_| OutOfMemory { bytes })?;
    probe.try_reserve_exact(all).map_err(|_| OutOfMemory { bytes })?;
    // An allocation that is never used may be removed by the compiler.
    black_box(probe.as_mut_ptr());
    Ok(())
}

/// Allocates zeroed bytes. The system provides a page when it is first written: a film of which only a part
/// is rendered takes only that part's memory.
///
/// # Errors
/// If the allocation fails.
pub(crate) fn zeros(bytes: usize) -> Result<Vec<u8>, OutOfMemory> {
    check(bytes as u64)?;
    Ok(vec![0; bytes])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_impossible_allocation_is_refused() {
        assert_eq!(check(1 << 20), Ok(()));
        for bytes in [1 << 60, u64::MAX] {
            assert_eq!(check(bytes), Err(OutOfMemory { bytes }));
        }
    }
}
