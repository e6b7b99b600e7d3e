//! Hang-ups of the terminal that started the process.

/// Returns whether the process was started to go on without its terminal, as by `nohup`: it ignores SIGHUP,
/// by the mask in `/proc`. `None` if that is not known.
pub(crate) fn is_ignored() -> Option<bool> {
    /// Bit of SIGHUP, the signal 1.
    const HANG_UP: u64 = 1;
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"))?;
    Some(u64::from_str_radix(mask.trim(), 16).ok()? & HANG_UP != 0)
}
