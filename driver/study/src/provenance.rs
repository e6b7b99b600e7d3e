//! Provenance of a study: program, date and host.

use std::time::{SystemTime, UNIX_EPOCH};

use photoncard_picture::printable::printable;
use photoncard_render::PROGRAM;

use super::report::Provenance;

impl Provenance {
    /// Provenance with this program, machine and date, and the command line `command_line`. It has no
    /// settings yet; the study adds them.
    pub fn here(command_line: &str) -> Self {
        let days = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.as_secs() / 86_400);
        Self {
            version: PROGRAM.to_owned(),
            date: date(days),
            host: printable(&host()).into_owned(),
            command_line: printable(command_line).into_owned(),
            settings: Vec::new(),
        }
    }
}

/// Text with the processor's model, its number of hardware threads, and the operating system.
fn host() -> String {
    let information = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = information.lines().find(|line| line.starts_with("model name"));
    let processor =
        model.and_then(|line| line.split_once(": ")).map_or(std::env::consts::ARCH, |pair| pair.1);
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    format!("{processor}, {threads} threads, {}", std::env::consts::OS)
}

/// Gregorian date, such as `2007-05-01`, that is `days` days after 1970-01-01.
fn date(days: u64) -> String {
    // Years are counted from March, so that a leap day is the last of its year; 1970-01-01 is day 719,468
    // from 0000-03-01.
    let days = days + 719_468;
    let (era, day) = (days / 146_097, days % 146_097);
    let year = (day - day / 1460 + day / 36_524 - day / 146_096) / 365;
    let day = day - (365 * year + year / 4 - year / 100);
    // Months from March have 31, 30, 31, 30, 31 days over and over.
    let month = (5 * day + 2) / 153;
    let day = day - (153 * month + 2) / 5 + 1;
    let (month, next_year) = if month < 10 { (month + 3, 0) } else { (month - 9, 1) };
    format!("{:04}-{month:02}-{day:02}", 400 * era + year + next_year)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_convert_to_gregorian_dates() {
        for (days, text) in [
            (0, "1970-01-01"),
            (59, "1970-03-01"),
            (11_016, "2000-02-29"),
            (11_017, "2000-03-01"),
            (13_634, "2007-05-01"),
            (47_540, "2100-02-28"),
            (47_541, "2100-03-01"),
        ] {
            assert_eq!(date(days), text);
        }
    }
}
