//! Output to the standard streams: all output of the program passes through this module. A closed or full
//! stream never makes the program panic. Unprintable characters in text from files and devices are escaped.

use std::fmt::Arguments;
use std::io::{ErrorKind, Write, stderr, stdout};
use std::sync::atomic::{AtomicBool, Ordering};

use photoncard_driver::printable::printable;
use serde_json::{Value, json};

use crate::failure::Failure;
use crate::flags::with_flags;

/// Form of messages on standard error: true for JSON objects, false for lines of text.
static IS_JSON: AtomicBool = AtomicBool::new(false);

/// Makes all later messages on standard error JSON objects, one a line (`docs/cli.md`).
pub(crate) fn speak_json() {
    IS_JSON.store(true, Ordering::Relaxed);
}

/// Returns whether messages are JSON objects.
pub(crate) fn is_json() -> bool {
    IS_JSON.load(Ordering::Relaxed)
}

/// Writes a line to standard error. Settings' names in errors of the library, such as `integrator.samples`,
/// are replaced by command-line flags. Errors of the stream are ignored. As JSON the line is an object of the
/// kind `message`.
pub(crate) fn say(line: Arguments) {
    let line = with_flags(&line.to_string());
    if is_json() {
        say_json(&json!({ "kind": "message", "message": without_program(&line) }));
    } else {
        let _ = writeln!(stderr(), "{}", printable(&line));
    }
}

/// Writes a JSON object to standard error, on a line of its own. Errors of the stream are ignored.
pub(crate) fn say_json(object: &Value) {
    let _ = writeln!(stderr(), "{}", printable_json(&object.to_string()));
}

/// Writes a failure to standard error: text on lines of its own, whose foreign parts are escaped, or an
/// object of the kind `failure`.
pub(crate) fn say_failure(failure: &Failure) {
    if is_json() {
        say_json(&failure.json());
    } else {
        let _ = writeln!(stderr(), "{failure}");
    }
}

/// Cuts off the program's name, with which a line of text begins.
fn without_program(line: &str) -> &str {
    line.strip_prefix("photoncard: ").unwrap_or(line)
}

/// Formats a number with its noun, in the plural unless it is 1.
pub(crate) fn counted(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

/// Writes lines to standard output, with unprintable characters escaped.
pub(crate) fn print(lines: &[String]) -> Result<(), Failure> {
    write_out(&lines.iter().map(|line| printable(line) + "\n").collect::<String>())
}

/// Writes JSON to standard output.
pub(crate) fn print_json(text: &str) -> Result<(), Failure> {
    write_out(&(printable_json(text) + "\n"))
}

/// Replaces each unprintable character of a JSON text, except line ends, by a `\u` escape. All these
/// characters must be in JSON strings, where the escape means the same character.
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

/// Writes text to standard output without escapes; the text must be the program's own. It is no error if the
/// reader closes the stream early.
pub(crate) fn write_out(text: &str) -> Result<(), Failure> {
    write_bytes(text.as_bytes())
}

/// Writes bytes to standard output. It is no error if the reader closes the stream early.
pub(crate) fn write_bytes(bytes: &[u8]) -> Result<(), Failure> {
    let mut out = stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(Failure::output(&error)),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn escaped_json_is_printable_and_parses_to_the_same_value() {
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
