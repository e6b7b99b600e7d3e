//! Limits of memory allocations.

use std::sync::Mutex;

use peak_alloc::PeakAlloc;

mod fuzz;
mod host_memory;
mod tangent_memory;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Lock that runs one test at a time, so that only its own allocations are counted.
static ALONE: Mutex<()> = Mutex::new(());
