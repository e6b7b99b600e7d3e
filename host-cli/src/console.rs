//! Standard streams: a closed or full one never makes the program panic. All output passes through this
//! module, and foreign text is escaped.

use std::fmt::Arguments;
use std::io::{ErrorKind, Write, stderr, stdout};

use photoncard_driver::printable::printable;

use crate::failure::Failure;

/// Writes a line to standard error. If that fails, the work goes on.
pub(crate) fn say(line: Arguments) {
    let _ = writeln!(stderr(), "{}", printable(&line.to_string()));
}

/// Writes a failure to standard error, on lines of its own; its report escapes foreign text.
pub(crate) fn say_failure(failure: &Failure) {
    let _ = writeln!(stderr(), "{failure}");
}

/// A number with its noun.
pub(crate) fn counted(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

/// Writes lines to standard output.
pub(crate) fn print(lines: &[String]) -> Result<(), Failure> {
    write_out(&lines.iter().map(|line| printable(line) + "\n").collect::<String>())
}

/// Writes JSON to standard output.
pub(crate) fn print_json(text: &str) -> Result<(), Failure> {
    write_out(&(printable_json(text) + "\n"))
}

/// Escapes all characters of JSON that do not print as themselves. Except for line ends, they occur in
/// strings alone.
pub(crate) fn printable_json(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        let mut bytes = [0; 4];
        let one = &*character.encode_utf8(&mut bytes);
        let is_kept = character == '\n' || printable(one) == one;
        if is_kept {
            escaped.push(character);
        } else {
            let mut units = [0; 2];
            escaped.extend(character.encode_utf16(&mut units).iter().map(|unit| format!("\\u{unit:04x}")));
        }
    }
    escaped
}

/// Writes text of the program's own to standard output as it is. A reader that closes it early is no error.
pub(crate) fn write_out(text: &str) -> Result<(), Failure> {
    write_bytes(text.as_bytes())
}

/// [`write_out`] of any bytes.
pub(crate) fn write_bytes(bytes: &[u8]) -> Result<(), Failure> {
    let mut out = stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(Failure::output(&error)),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;

    #[test]
    fn json_is_the_same_and_prints() {
        let value = json!({ "a\"b\\\u{9b}": ["\u{202e}\u{e0041}\u{7f}\n", "Größe", 1.5, null] });
        for text in [value.to_string(), serde_json::to_string_pretty(&value).unwrap()] {
            let escaped = printable_json(&text);
            assert_eq!(serde_json::from_str::<Value>(&escaped).unwrap(), value);
            assert!(escaped.lines().all(|line| printable(line) == line), "{escaped}");
            assert!(
                escaped.contains("\\u202e\\udb40\\udc41\\u007f\\n") && escaped.contains("Größe"),
                "{escaped}"
            );
        }
    }
}
