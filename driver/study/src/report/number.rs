//! Numbers as text: rounded for people, in full precision for programs.

/// Superscript digits.
const RAISED: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];

/// Formats `value` with at most `digits` significant digits, thousands separators and a true minus sign.
/// Magnitudes other than 0 that are below 10^-4 or of at least 10^15 are written with a power of ten.
pub fn human(value: f64, digits: usize) -> String {
    if value.is_nan() {
        return "n/a".to_owned();
    }
    if value.is_infinite() {
        return if value > 0.0 { "∞" } else { "−∞" }.to_owned();
    }
    let scientific = format!("{value:.*e}", digits.max(1) - 1);
    let (mantissa, exponent) = scientific.split_once('e').unwrap_or((&scientific, "0"));
    let exponent: i32 = exponent.parse().unwrap_or(0);
    if value != 0.0 && !(-4..15).contains(&exponent) {
        return format!("{}×{}", minus(trim_zeros(mantissa)), power(10, exponent));
    }
    let decimals = (digits as i32 - 1 - exponent).max(0) as usize;
    let rounded: f64 = scientific.parse().unwrap_or(value);
    grouped(trim_zeros(&format!("{rounded:.decimals$}")))
}

/// Formats `value` with `decimals` decimals, thousands separators and a true minus sign.
pub(super) fn fixed(value: f64, decimals: usize) -> String {
    grouped(&format!("{value:.decimals$}"))
}

/// Adds thousands separators and a true minus sign to a decimal number in plain digits.
pub(super) fn grouped(decimal: &str) -> String {
    let (sign, digits) = match decimal.strip_prefix('-') {
        // A number that is rounded to zero has no sign.
        Some(digits) if digits.bytes().any(|digit| (b'1'..=b'9').contains(&digit)) => ("−", digits),
        Some(digits) => ("", digits),
        None => ("", decimal),
    };
    let whole = digits.find('.').unwrap_or(digits.len());
    let mut text = sign.to_owned();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && index < whole && (whole - index) % 3 == 0 {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// Formats `base` with `exponent` in superscript digits.
pub(super) fn power(base: u32, exponent: i32) -> String {
    let mut text = base.to_string();
    if exponent < 0 {
        text.push('⁻');
    }
    let digits = exponent.unsigned_abs().to_string();
    text.extend(digits.bytes().map(|digit| RAISED[usize::from(digit - b'0')]));
    text
}

/// Shortest decimal number that reads back as `value`, without superfluous zeros.
pub(super) fn full(value: f64) -> String {
    let plain = value == 0.0 || !value.is_finite() || (1e-5..1e16).contains(&value.abs());
    if plain { format!("{value}") } else { format!("{value:e}") }
}

fn trim_zeros(decimal: &str) -> &str {
    if decimal.contains('.') { decimal.trim_end_matches('0').trim_end_matches('.') } else { decimal }
}

fn minus(decimal: &str) -> String {
    decimal.replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_for_people_are_rounded_to_four_digits() {
        let cases = [
            (0.0, "0"),
            (-0.0, "0"),
            (1.0, "1"),
            (-2.5, "−2.5"),
            (0.123456, "0.1235"),
            (999.96, "1,000"),
            (1234.5678, "1,235"),
            (1_234_567.0, "1,235,000"),
            (0.000_123_456, "0.0001235"),
            (0.000_012_345, "1.234×10⁻⁵"),
            (-2e20, "−2×10²⁰"),
            (f64::NAN, "n/a"),
            (f64::NEG_INFINITY, "−∞"),
        ];
        for (value, text) in cases {
            assert_eq!(human(value, 4), text);
        }
        assert_eq!(fixed(-0.04, 1), "0.0");
        assert_eq!(fixed(-1234.56, 1), "−1,234.6");
    }

    #[test]
    fn numbers_for_programs_have_full_precision() {
        for value in [0.1, 1.0 / 3.0, 1e300, -2.5e-300, 123_456_789.125, f64::MAX, f64::INFINITY] {
            assert_eq!(full(value).parse::<f64>().unwrap(), value);
        }
        assert_eq!(full(2.0), "2");
        assert_eq!(full(1e300), "1e300");
    }
}
