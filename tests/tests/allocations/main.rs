//! Limits of what is allocated.

use std::sync::Mutex;

use peak_alloc::PeakAlloc;

mod fuzz;
mod host_memory;
mod tangent_memory;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Lock that runs one test at a time, so that no allocations of another are counted.
static ALONE: Mutex<()> = Mutex::new(());
