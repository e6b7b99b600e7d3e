//! Moments of the civil calendar: dates and times of ISO 8601 with their offset from UTC.

/// First and last year whose sun is known: the almanac's formula for its position is good for these.
const YEARS: [i64; 2] = [1900, 2100];
/// Largest offset from UTC of a place, minutes.
const MAX_OFFSET: i64 = 14 * 60;
/// Days from 1970-01-01T00:00Z to 2000-01-01T12:00Z (J2000).
const EPOCH: f64 = 10_957.5;

/// Parses a date and time with its offset, such as `2026-06-21T14:30+02:00` or `2026-06-21T12:30:15.5Z`, as
/// days since 2000-01-01T12:00Z.
///
/// # Errors
/// A sentence that names the wrong part.
pub(super) fn parse(text: &str) -> Result<f64, String> {
    let form = || {
        format!(
            "'{text}' is no date and time with its offset from UTC, such as 2026-06-21T14:30+02:00 or 2026-06-21T12:30Z"
        )
    };
    let (date, rest) = text.split_once(['T', 't']).ok_or_else(form)?;
    let (time, offset) = split_offset(rest).ok_or_else(|| {
        format!("'{text}' states no offset from UTC: add Z for UTC, or the place's offset, such as +02:00")
    })?;
    let [year, month, day] = numbers(date, '-', [4, 2, 2]).ok_or_else(form)?;
    let (hour, minute, second) = time_of_day(time).ok_or_else(form)?;
    let offset = offset_minutes(offset).ok_or_else(form)?;
    let in_range = |name: &str, value: i64, [first, last]: [i64; 2]| {
        if (first..=last).contains(&value) {
            return Ok(());
        }
        Err(format!("there is no {name} {value} in '{text}': it is {first} to {last}"))
    };
    in_range("year", year, YEARS)?;
    in_range("month", month, [1, 12])?;
    in_range("day", day, [1, days_of_month(year, month)])?;
    in_range("hour", hour, [0, 23])?;
    in_range("minute", minute, [0, 59])?;
    if second >= 60.0 {
        return Err(format!("there is no second {second} in '{text}': it is 0 to 59"));
    }
    let minutes = hour * 60 + minute - offset;
    Ok(days_since_1970(year, month, day) as f64 - EPOCH + (minutes as f64 + second / 60.0) / 1440.0)
}

/// Splits a time at its offset: `Z`, or what begins with a sign.
fn split_offset(rest: &str) -> Option<(&str, &str)> {
    let place = rest.find(['Z', 'z', '+', '-'])?;
    rest.split_at_checked(place)
}

/// Parses three numbers of given widths, in digits, with a separator between them.
fn numbers(text: &str, separator: char, widths: [usize; 3]) -> Option<[i64; 3]> {
    let mut parts = text.split(separator);
    let mut found = [0; 3];
    for (number, width) in found.iter_mut().zip(widths) {
        *number = digits(parts.next()?, width)?;
    }
    parts.next().is_none().then_some(found)
}

fn digits(text: &str, width: usize) -> Option<i64> {
    let is_number = text.len() == width && text.bytes().all(|byte| byte.is_ascii_digit());
    text.parse().ok().filter(|_| is_number)
}

/// Hour, minute and second of `HH:MM` or `HH:MM:SS`, whose seconds may have a fraction.
fn time_of_day(text: &str) -> Option<(i64, i64, f64)> {
    let mut parts = text.splitn(3, ':');
    let [hour, minute] = [digits(parts.next()?, 2)?, digits(parts.next()?, 2)?];
    let Some(seconds) = parts.next() else { return Some((hour, minute, 0.0)) };
    let (whole, fraction) = seconds.split_once('.').unwrap_or((seconds, "0"));
    let is_number = !fraction.is_empty() && fraction.bytes().all(|byte| byte.is_ascii_digit());
    digits(whole, 2).filter(|_| is_number)?;
    Some((hour, minute, seconds.parse().ok()?))
}

/// Minutes of `Z`, `+HH`, `+HHMM` or `+HH:MM`.
fn offset_minutes(text: &str) -> Option<i64> {
    if text.eq_ignore_ascii_case("z") {
        return Some(0);
    }
    let (sign, rest) = match text.split_at_checked(1)? {
        ("+", rest) => (1, rest),
        (_, rest) => (-1, rest),
    };
    let (hours, minutes) = rest.split_at_checked(2)?;
    let minutes = minutes.strip_prefix(':').unwrap_or(minutes);
    let minutes = if rest.len() == 2 { 0 } else { digits(minutes, 2).filter(|minutes| *minutes < 60)? };
    let offset = digits(hours, 2)? * 60 + minutes;
    (offset <= MAX_OFFSET).then_some(sign * offset)
}

fn days_of_month(year: i64, month: i64) -> i64 {
    match month {
        2 if year % 4 == 0 && (year % 100 != 0 || year % 400 == 0) => 29,
        2 => 28,
        4 | 6 | 9 | 11 => 30,
        _ => 31,
    }
}

/// Days from 1970-01-01 to a date of the Gregorian calendar (Fliegel, van Flandern 1968: the year begins in
/// March, so that a leap day is its last).
fn days_since_1970(year: i64, month: i64, day: i64) -> i64 {
    let (year, month) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
    365 * year + year / 4 - year / 100 + year / 400 + (153 * month + 2) / 5 + day - 719_469
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn moments_are_days_since_noon_of_the_first_of_january_2000() {
        for (text, days) in [
            ("2000-01-01T12:00Z", 0.0),
            ("2000-01-01t12:00:00z", 0.0),
            ("2000-01-02T00:00+12:00", 0.0),
            ("2000-01-01T05:00-0700", 0.0),
            ("2000-01-01T17:00+05", 0.0),
            ("2000-01-01T17:30+05:30", 0.0),
            ("1999-12-31T12:00Z", -1.0),
            ("2000-03-01T12:00Z", 60.0),
            ("2001-03-01T12:00Z", 425.0),
            ("2003-10-17T12:30:30-07:00", 1385.0 + 7.0 / 24.0 + 0.5 / 24.0 + 30.0 / 86_400.0),
            ("1970-01-01T00:00:21.6Z", 0.000_25 - EPOCH),
        ] {
            let found = parse(text).unwrap_or_else(|error| panic!("{text}: {error}"));
            assert!((found - days).abs() < 1e-9, "{text}: {found} instead of {days}");
        }
    }

    #[test]
    fn what_is_no_moment_is_refused_with_its_part() {
        for (text, said) in [
            ("2026-13-01T12:00Z", "month 13"),
            ("2026-00-01T12:00Z", "month 0"),
            ("2026-02-29T12:00Z", "day 29"),
            ("1900-02-29T12:00Z", "day 29"),
            ("2026-06-31T12:00Z", "day 31"),
            ("2026-06-21T24:00Z", "hour 24"),
            ("2026-06-21T12:60Z", "minute 60"),
            ("2026-06-21T12:00:60Z", "second 60"),
            ("1492-10-12T12:00Z", "year 1492"),
            ("2026-06-21T12:00", "no offset"),
            ("2026-06-21T12:00+15:00", "no date"),
            ("2026-06-21T12:00+0", "no date"),
            ("2026-06-21T12:00+02:60", "no date"),
            ("2026-6-21T12:00Z", "no date"),
            ("2026-06-21 12:00Z", "no date"),
            ("2026-06-21T12Z", "no date"),
            ("2026-06-21T12:00:1e1Z", "no date"),
            ("2026-06-21T12:00:.5Z", "no date"),
            ("", "no date"),
        ] {
            let error = parse(text).expect_err(text);
            assert!(error.contains(said), "{text}: {error}");
        }
    }

    proptest! {
        #[test]
        fn no_text_is_a_panic(text in "\\PC{0,40}|[0-9TZ:+.-]{0,30}") {
            let _ = parse(&text);
        }

        #[test]
        fn a_day_later_is_one_more(year in 1900..2100_i64, month in 1..=12_i64, day in 1..=31_i64) {
            prop_assume!(day <= days_of_month(year, month));
            let next = match (day == days_of_month(year, month), month) {
                (false, _) => [year, month, day + 1],
                (true, 12) => [year + 1, 1, 1],
                (true, _) => [year, month + 1, 1],
            };
            let [one, other] = [[year, month, day], next].map(|[y, m, d]| days_since_1970(y, m, d));
            prop_assert_eq!(one + 1, other);
        }
    }
}
