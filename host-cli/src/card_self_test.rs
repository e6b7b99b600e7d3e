//! Command `photoncard card selftest`.

use std::time::Duration;

use miette::MietteDiagnostic;
use photoncard_driver::render::{
    ArithmeticTest, CardAddress, PatternTest, RenderError, SelfTest, WrongResult, card_self_test,
};

use crate::console::print;
use crate::failure::Failure;
use crate::progress::Progress;

/// Tests a card and prints its results.
pub(crate) fn run(address: &CardAddress, quiet: bool) -> Result<(), Failure> {
    let progress = Progress::start(quiet, 1).map_err(|error| Failure::work_error(&error))?;
    let result = card_self_test(address, &progress);
    progress.finish();
    let test = result.map_err(|error| match error {
        RenderError::Stopped => {
            Failure::Stopped("stopped; the card holds patterns of the test, and no scene")
        }
        error => error.into(),
    })?;
    print(&lines(&test))?;
    if test.is_passed() { Ok(()) } else { Err(failure(&test)) }
}

fn lines(test: &SelfTest) -> Vec<String> {
    let mut lines = arithmetic_lines(&test.arithmetic);
    lines.push(format!("memory          {} bytes: {} lines", test.memory_bytes(), test.lines));
    for pattern in &test.patterns {
        lines.extend(pattern_lines(pattern, test.memory_bytes()));
    }
    lines
}

fn arithmetic_lines(arithmetic: &ArithmeticTest) -> Vec<String> {
    let ArithmeticTest { cases, results, wrong } = arithmetic;
    let count: usize = wrong.iter().map(|wrong| wrong.count).sum();
    let mut lines =
        vec![format!("arithmetic      {count} of {results} results wrong, of {cases} triples of operands")];
    for wrong in wrong {
        let WrongResult { operands: [a, b, c], expected, found } = wrong.first;
        lines.push(format!("  {}: {} wrong", wrong.expression, wrong.count));
        lines.push(format!(
            "    first       a = {a:e}, b = {b:e}, c = {c:e}: {found:#010x}, not {expected:#010x}"
        ));
        lines.extend(wrong.first.cause().map(|cause| format!("    as if         {cause}")));
    }
    lines
}

fn pattern_lines(test: &PatternTest, bytes: u64) -> Vec<String> {
    let mut lines = vec![format!(
        "  {:<13} written in {}, read in {}: {} wrong words",
        test.pattern.name(),
        time(test.write, bytes),
        time(test.check, bytes),
        test.wrong.count
    )];
    if let Some(first) = test.wrong.first {
        let address = u64::from(first.index) * 4;
        lines.push(format!(
            "    first       byte {address:#010x}: {:#010x}, not {:#010x}",
            first.found, first.expected
        ));
        lines.push(format!("    bits        {:#010x} differ in any", test.wrong.bits));
    }
    lines
}

/// Formats a duration with the rate in bytes per second.
fn time(time: Duration, bytes: u64) -> String {
    let seconds = time.as_secs_f64();
    let rate = if seconds > 0.0 { bytes as f64 / seconds / 1e6 } else { 0.0 };
    format!("{seconds:.3} s ({rate:.1} MB/s)")
}

/// Error of a card that failed the test, with a remedy.
fn failure(test: &SelfTest) -> Failure {
    let mut parts = Vec::new();
    if !test.arithmetic.wrong.is_empty() {
        parts.push("its arithmetic differs from the host's".to_owned());
    }
    if test.patterns.iter().any(|pattern| pattern.wrong.count > 0) {
        parts.push("its memory does not hold what is written".to_owned());
    }
    if test.lacks_memory() {
        parts.push(format!("its memory is smaller than the {} bytes of its budget", test.budget.dram_bytes));
    }
    let error = MietteDiagnostic::new(format!("the card fails its self-test: {}", parts.join("; ")));
    Failure::work(error.with_help(
        "docs/bring-up.md states what each pattern detects; pictures of this card are not to be trusted",
    ))
}
