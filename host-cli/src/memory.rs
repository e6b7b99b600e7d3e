//! Memory of the machine that the command runs on.

use std::fs::read_to_string;
use std::path::Path;
use std::sync::OnceLock;

/// Returns the free memory, bytes, measured at the first call; `None` on systems other than Linux. It is the
/// minimum of Linux's estimate for the machine, the limit of this process's address space, and the memory
/// that the process's control groups leave.
pub(crate) fn free_memory() -> Option<u64> {
    static FREE: OnceLock<Option<u64>> = OnceLock::new();
    *FREE.get_or_init(|| {
        let of_machine = available(&read_to_string("/proc/meminfo").ok()?)?;
        let of_process = read_to_string("/proc/self/limits").ok().and_then(|text| address_space(&text));
        Some([of_process, of_groups()].into_iter().flatten().fold(of_machine, u64::min))
    })
}

/// Parses the available memory, bytes, in the text of `/proc/meminfo`.
fn available(text: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1 << 10)
}

/// Parses the soft limit of the address space, bytes, in the text of `/proc/self/limits`; `None` without a
/// limit.
fn address_space(text: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix("Max address space"))?;
    line.split_whitespace().next()?.parse().ok()
}

/// Returns the memory that the control groups (cgroup v2) of this process leave, bytes: the minimum over its
/// group and all groups that contain it. `None` if none of these groups has a limit.
fn of_groups() -> Option<u64> {
    let groups = read_to_string("/proc/self/cgroup").ok()?;
    let own = groups.lines().find_map(|line| line.strip_prefix("0::/"))?;
    let free = Path::new(own).ancestors().filter_map(|group| {
        let read = |name| read_to_string(Path::new("/sys/fs/cgroup").join(group).join(name)).ok();
        free_of_group([&read("memory.max")?, &read("memory.current")?, &read("memory.stat")?])
    });
    free.min()
}

/// Returns the memory that a control group leaves, bytes: its limit less its use; `None` without a limit. The
/// texts are those of its files `memory.max`, `memory.current` and `memory.stat`. Cached pages of files that
/// are not in active use (`inactive_file`) count as free.
fn free_of_group([most, taken, parts]: [&str; 3]) -> Option<u64> {
    let [most, taken]: [u64; 2] = [most.trim().parse().ok()?, taken.trim().parse().ok()?];
    let unused = parts.lines().find_map(|line| line.strip_prefix("inactive_file "));
    let unused = unused.and_then(|bytes| bytes.parse().ok()).unwrap_or(0);
    Some(most.saturating_sub(taken.saturating_sub(unused)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn available_memory_is_read_from_the_line_that_states_it() {
        let text = "MemTotal:       24000000 kB\nMemAvailable:   12345678 kB\nBuffers: 1 kB\n";
        assert_eq!(available(text), Some(12_345_678 << 10));
        for wrong in ["", "MemAvailable: 5", "MemAvailable: many kB", "MemAvailable: 99999999999999999999 kB"]
        {
            assert_eq!(available(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn the_limit_of_the_address_space_is_read_if_there_is_one() {
        let text =
            |limit: &str| format!("Max locked memory  1 9 bytes\nMax address space   {limit} 9 bytes\n");
        assert_eq!(address_space(&text("4096000000")), Some(4_096_000_000));
        assert_eq!(address_space(&text("unlimited")), None);
        assert_eq!(address_space(""), None);
    }

    #[test]
    fn a_group_leaves_its_limit_less_what_is_in_use() {
        let stat = "anon 500\ninactive_file 300\nactive_file 7\n";
        assert_eq!(free_of_group(["1000\n", "900\n", stat]), Some(400));
        assert_eq!(free_of_group(["1000\n", "200\n", stat]), Some(1000));
        assert_eq!(free_of_group(["1000", "2000", ""]), Some(0));
        assert_eq!(free_of_group(["max\n", "900\n", stat]), None);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn linux_states_free_memory() {
        assert!(free_memory().is_some());
    }
}
