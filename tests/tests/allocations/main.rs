//! Limits of the memory that the host allocates.

use std::sync::Mutex;

use peak_alloc::PeakAlloc;

mod fuzz;
mod host_memory;
mod tangent_memory;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Lock by which tests run one at a time, so that no other test's allocations are counted.
static ALONE: Mutex<()> = Mutex::new(());
