//! Isolates decoders of untrusted bytes. A decoder that panics returns an error; it neither prints a message
//! nor ends the process.
//!
//! Decoders are written not to panic, but some do on malformed input. A build with `panic = "abort"` has no
//! isolation.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::Once;

thread_local! {
    /// Number of nested [`decode`] calls on this thread.
    static WALLS: Cell<u32> = const { Cell::new(0) };
}

/// Runs a decoder. `panicked` creates the error if the decoder panics. State that the decoder shares with the
/// caller must not be used after an error.
pub fn decode<T, E>(decoder: impl FnOnce() -> Result<T, E>, panicked: impl FnOnce() -> E) -> Result<T, E> {
    silence_walled_panics();
    WALLS.set(WALLS.get() + 1);
    let result = catch_unwind(AssertUnwindSafe(decoder));
    WALLS.set(WALLS.get() - 1);
    result.unwrap_or_else(|_| Err(panicked()))
}

/// Installs a panic hook that suppresses the messages of isolated decoders and passes on other panics.
fn silence_walled_panics() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let outside = take_hook();
        set_hook(Box::new(move |panic| {
            if WALLS.get() == 0 {
                outside(panic);
            }
        }));
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_decoder_that_panics_ends_in_an_error() {
        assert_eq!(decode(|| Ok::<_, &str>(1), || "panicked"), Ok(1));
        assert_eq!(decode(|| Err::<i32, _>("refused"), || "panicked"), Err("refused"));
        let nested = || decode(|| decode(|| panic!("inside"), || "inner"), || "outer");
        assert_eq!(nested(), Err::<i32, _>("inner"));
        assert_eq!(WALLS.get(), 0);
    }

    /// Runs the other test in a separate process, whose output is not captured.
    #[test]
    fn a_panic_of_an_isolated_decoder_prints_nothing() {
        let test = "foreign::tests::a_decoder_that_panics_ends_in_an_error";
        let program = std::env::current_exe().expect("a program runs");
        let output = std::process::Command::new(program).args([test, "--exact", "--nocapture"]).output();
        let output = output.expect("it starts");
        let [said, errors] = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes));
        assert!(output.status.success() && said.contains("1 passed"), "{said}{errors}");
        assert!(!errors.contains("panicked"), "{errors}");
    }
}
