//! Hang-ups (SIGHUP) of the terminal that started the process.

/// Returns whether the process ignores SIGHUP, as under `nohup`, by the mask of ignored signals in `/proc`.
/// `None` if the mask is not available.
pub(crate) fn is_ignored() -> Option<bool> {
    /// Bit of SIGHUP, signal 1, in the mask.
    const HANG_UP: u64 = 1;
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"))?;
    Some(u64::from_str_radix(mask.trim(), 16).ok()? & HANG_UP != 0)
}
