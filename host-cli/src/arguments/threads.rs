//! Parser of thread counts.

/// Maximum number of threads. Without a limit, a number that the system cannot start would end the process.
const MAX_THREADS: usize = 1024;

pub(super) fn threads(text: &str) -> Result<usize, String> {
    let count = text.parse().ok().filter(|count| (1..=MAX_THREADS).contains(count));
    count
        .ok_or_else(|| format!("use 1 to {MAX_THREADS} threads, or leave the option out for a thread a core"))
}
