//! Self-test of a card over its link: sound cards pass, on links with faults too, and defects are named.

use std::cell::Cell;
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use photoncard_driver::link::{FaultInjector, LineFaults, LoopbackPort, loopback};
use photoncard_driver::render::{
    CardError, MemoryPattern, Observer, Phase, RenderError, SelfTest, Unobserved, self_test_on,
};
use photoncard_driver::session::SessionError;
use photoncard_firmware::card::MicroCard;
use photoncard_firmware::kind::MICRO;
use photoncard_firmware::memory::Dram;
use photoncard_firmware::self_test::arithmetic::{EXPRESSIONS, compute};
use photoncard_firmware::serve::serve;
use photoncard_shared::address::{LINE_BYTES, Line};
use photoncard_shared::image::LAYOUT_VERSION;
use photoncard_shared::link::{Port, PortError};
use photoncard_shared::message::{
    self, Command, Fault, FaultCode, MemoryTest, PROTOCOL_VERSION, RESULTS, Reply, WrongWord, WrongWords,
};
use photoncard_shared::transport::Transport;
use photoncard_tests::with_room_for_a_card;
use proptest::prelude::*;

/// Port of a link with faults.
struct BadLine(LoopbackPort, FaultInjector);

impl Port for BadLine {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, PortError> {
        self.1.read(&mut self.0, buffer, wait)
    }

    fn write(&mut self, bytes: &[u8], wait: Duration) -> Result<usize, PortError> {
        self.1.write(&mut self.0, bytes, wait)
    }
}

/// Self-test of an emulated micro chip with `lines` lines of memory, over a link with `faults`.
fn tested(lines: usize, faults: &str) -> SelfTest {
    let mut result = None;
    let faults: LineFaults = faults.parse().unwrap();
    with_room_for_a_card(|| {
        let (host, mut port) = loopback(1 << 12);
        std::thread::scope(|scope| {
            let card = std::thread::Builder::new().stack_size(16 << 20);
            let card = card.spawn_scoped(scope, move || {
                let mut memory = vec![Line([0xa5; LINE_BYTES]); lines];
                serve(&mut *Box::new(MicroCard::new(Dram::new(&mut memory))), &mut port)
            });
            let mut line = BadLine(host, FaultInjector::new(faults, 0));
            result = Some(self_test_on(&mut line, "card 0", &Unobserved).unwrap());
            drop(line);
            assert_eq!(card.unwrap().join().unwrap(), Err(PortError::Closed));
        });
    });
    result.unwrap()
}

#[test]
fn a_sound_card_passes_on_any_line() {
    let lines = MICRO.dram_bytes as usize / LINE_BYTES;
    for faults in ["seed=1", "flips=1e-4,drops=1e-4,repeats=1e-4,delays=1e-3,seed=2"] {
        let test = tested(lines, faults);
        assert!(test.is_passed(), "{faults}: {test:?}");
        assert_eq!(test.memory_bytes(), MICRO.dram_bytes);
        let patterns: Vec<_> = test.patterns.iter().map(|test| test.pattern).collect();
        assert_eq!(patterns, MemoryPattern::ALL);
        assert!(test.arithmetic.cases > 200);
        assert_eq!(test.arithmetic.results, test.arithmetic.cases * RESULTS);
    }
}

#[test]
fn a_memory_smaller_than_that_of_the_budget_fails() {
    let test = tested(100, "seed=1");
    assert!(test.lacks_memory() && !test.is_passed());
    assert!(test.patterns.iter().all(|pattern| pattern.wrong.count == 0));
}

/// Arithmetic of a chip: results of all expressions for three operands.
type Arithmetic = fn([f32; 3]) -> [u32; RESULTS];

/// Model of a card, without a thread: it computes by `arithmetic`, and answers the memory test by prepared
/// replies.
struct Chip {
    transport: Transport,
    arithmetic: Arithmetic,
    /// Replies to the memory test.
    memory: VecDeque<Reply<'static>>,
    is_testing: bool,
    /// Number of commands after which the card is reset; `None` for never.
    reset_after: Option<u32>,
}

/// Report at the end of a pattern without errors, for a memory of the budget's size.
fn end(pattern: MemoryPattern) -> MemoryTest {
    let lines = (MICRO.dram_bytes / LINE_BYTES as u64) as u32;
    MemoryTest { lines, pattern, written: lines, checked: lines, wrong: WrongWords::default() }
}

impl Chip {
    fn new(arithmetic: Arithmetic) -> Self {
        let memory = MemoryPattern::ALL.map(|pattern| Reply::MemoryTested(end(pattern))).into();
        Self { transport: Transport::card(), arithmetic, memory, is_testing: false, reset_after: None }
    }

    fn with_memory(memory: impl IntoIterator<Item = Reply<'static>>) -> Self {
        Self { memory: memory.into_iter().collect(), ..Self::new(compute) }
    }

    fn send(&mut self, reply: &Reply) {
        assert!(self.transport.send(|bytes| message::encode(reply, bytes)));
    }

    fn answer(&mut self, command: &Command) {
        match command {
            Command::Hello { .. } => self.send(&Reply::Hello {
                protocol: PROTOCOL_VERSION,
                layout: LAYOUT_VERSION,
                budget: MICRO,
                written_lines: 0,
                memory_use: None,
                build: "a chip",
                board: None,
            }),
            Command::Compute { operands } => {
                let numbers: Vec<f32> =
                    operands.as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
                let results = numbers.as_chunks().0.iter().flat_map(|case| (self.arithmetic)(*case));
                let results: Vec<u8> = results.flat_map(u32::to_le_bytes).collect();
                self.send(&Reply::Computed { results: &results });
            }
            Command::TestMemory => self.is_testing = true,
            other => panic!("{other:?}"),
        }
    }
}

impl Port for Chip {
    fn read(&mut self, buffer: &mut [u8], _: Duration) -> Result<usize, PortError> {
        while self.is_testing && self.transport.can_send() {
            let Some(reply) = self.memory.pop_front() else { break };
            self.send(&reply);
        }
        let outgoing = self.transport.outgoing();
        let count = outgoing.len().min(buffer.len());
        buffer[..count].copy_from_slice(&outgoing[..count]);
        self.transport.sent(count);
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8], _: Duration) -> Result<usize, PortError> {
        let (taken, _) = self.transport.receive(bytes);
        while let Some(payload) = self.transport.take() {
            let payload = payload.to_vec();
            self.answer(&message::decode(&payload).expect("a host sends commands"));
            self.reset_after = self.reset_after.map(|left| left.saturating_sub(1));
        }
        self.transport.acknowledge();
        if self.reset_after == Some(0) {
            *self = Self::new(self.arithmetic);
        }
        Ok(taken)
    }
}

fn test_of(mut chip: Chip) -> Result<SelfTest, RenderError> {
    self_test_on(&mut chip, "card 0", &Unobserved)
}

/// Expressions with wrong results, each with the likely cause of its first error.
fn wrong_results(arithmetic: Arithmetic) -> Vec<(&'static str, Option<&'static str>)> {
    let test = test_of(Chip::new(arithmetic)).unwrap();
    assert_eq!(test.is_passed(), test.arithmetic.wrong.is_empty());
    test.arithmetic.wrong.iter().map(|wrong| (wrong.expression, wrong.first.cause())).collect()
}

#[test]
fn equal_arithmetic_passes() {
    assert_eq!(wrong_results(compute), []);
}

#[test]
fn fused_operations_are_named() {
    let found = wrong_results(|operands| {
        let [a, b, c] = operands;
        let mut results = compute(operands);
        for (place, fused) in [(4, a.mul_add(b, c)), (5, (-a).mul_add(b, c))] {
            results[place] = if fused.is_nan() { f32::NAN.to_bits() } else { fused.to_bits() };
        }
        results
    });
    let cause = Some("a multiplication and an addition are fused");
    assert_eq!(found, [("a * b + c", cause), ("c - a * b", cause)]);
}

#[test]
fn flushed_denormal_numbers_are_named() {
    fn flushed(bits: u32) -> u32 {
        if f32::from_bits(bits).is_subnormal() { bits & 1 << 31 } else { bits }
    }
    let found = wrong_results(|operands| {
        let mut results = compute(operands.map(|operand| f32::from_bits(flushed(operand.to_bits()))));
        results[..9].iter_mut().for_each(|result| *result = flushed(*result));
        results
    });
    let cause = Some("denormal numbers are flushed to zero");
    for expression in ["a + b", "a - b", "a * b", "a / b", "a * b + c"] {
        assert!(found.contains(&(expression, cause)), "{expression}: {found:?}");
    }
    // Only results that are denormal numbers are flushed, operands are not.
    let found = wrong_results(|operands| compute(operands).map(flushed));
    assert!(found.contains(&("a * b", cause)), "{found:?}");
}

#[test]
fn a_wrong_rounding_mode_is_named() {
    let found = wrong_results(|operands| {
        let mut results = compute(operands);
        // Rounds towards zero: an `f32` sum whose absolute value exceeds the `f64` sum's was rounded up.
        let exact = f64::from(operands[0]) + f64::from(operands[1]);
        if exact.is_finite() && f64::from(f32::from_bits(results[0])).abs() > exact.abs() {
            results[0] -= 1;
        }
        results
    });
    assert_eq!(found, [("a + b", Some("results are rounded in another direction"))]);
}

/// One bit of one result is wrong, for each expression in turn; the test must find it.
#[test]
fn a_wrong_bit_is_found_in_any_result() {
    for (place, expression) in EXPRESSIONS.into_iter().enumerate() {
        PLACE.with(|cell| cell.set(place));
        let wrong = test_of(Chip::new(flip)).unwrap().arithmetic.wrong;
        let found: Vec<_> = wrong.iter().map(|wrong| (wrong.expression, wrong.count)).collect();
        assert_eq!(found, [(expression, 1)]);
        let first = wrong[0].first;
        assert_eq!((first.expected ^ first.found, first.operands), (1 << 30, [1.0, 3.0, -1.0 / 3.0]));
    }
}

thread_local! {
    /// Index of the result in which [`flip`] inverts a bit.
    static PLACE: Cell<usize> = const { Cell::new(0) };
}

/// Arithmetic with one wrong bit, for one triple of operands.
fn flip(operands: [f32; 3]) -> [u32; RESULTS] {
    let mut results = compute(operands);
    if operands == [1.0, 3.0, -1.0 / 3.0] {
        results[PLACE.with(Cell::get)] ^= 1 << 30;
    }
    results
}

fn card_error(chip: Chip) -> CardError {
    match test_of(chip) {
        Err(RenderError::Card { source, .. }) => source,
        other => panic!("{other:?}"),
    }
}

/// Resets the card at the first results, during the arithmetic, and at the memory test, which is its 34th
/// command.
#[test]
fn a_card_that_is_reset_fails() {
    for after in [2, 20, 34] {
        let error = card_error(Chip { reset_after: Some(after), ..Chip::new(compute) });
        assert!(matches!(error, CardError::Reset), "{after}: {error}");
    }
}

#[test]
fn a_fault_ends_the_test() {
    let fault = Fault { code: FaultCode::LineRange, detail: 9 };
    let error = card_error(Chip::with_memory([Reply::Fault(fault)]));
    assert!(matches!(error, CardError::Session(SessionError::Fault(found)) if found == fault), "{error}");
}

/// Reports contradict themselves, the report before, or the pattern.
#[test]
fn impossible_reports_are_refused() {
    let [ones, zeros, ..] = MemoryPattern::ALL;
    let sound = end(ones);
    let begun = MemoryTest { written: 64, checked: 0, ..sound };
    let word = WrongWord { index: 3, expected: 8, found: 9 };
    let wrong = |wrong| MemoryTest { wrong, ..sound };
    let one = WrongWords { count: 1, bits: 1, first: Some(word) };
    for reports in [
        vec![end(zeros)],
        vec![sound, sound],
        vec![begun, begun],
        vec![begun, MemoryTest { written: 32, ..begun }],
        vec![sound, MemoryTest { lines: 2, written: 2, checked: 2, ..end(zeros) }],
        vec![MemoryTest { written: sound.lines + 1, ..sound }],
        vec![MemoryTest { checked: 1, ..begun }],
        vec![MemoryTest { checked: sound.lines + 1, ..sound }],
        vec![wrong(WrongWords { first: None, ..one })],
        vec![wrong(WrongWords { count: 0, ..one })],
        vec![wrong(WrongWords { bits: 0, ..one })],
        vec![wrong(WrongWords { bits: 2, ..one })],
        vec![wrong(WrongWords { count: u32::MAX, ..one })],
        vec![wrong(WrongWords { first: Some(WrongWord { found: 8, ..word }), ..one })],
        vec![wrong(WrongWords { first: Some(WrongWord { index: u32::MAX, ..word }), ..one })],
        vec![MemoryTest { checked: 64, wrong: one, ..sound }, sound],
    ] {
        let error = card_error(Chip::with_memory(reports.iter().copied().map(Reply::MemoryTested)));
        assert!(matches!(error, CardError::Session(SessionError::Unexpected(_))), "{reports:?}: {error}");
    }
    let results = Reply::Computed { results: &[0; 84] };
    let error = card_error(Chip::with_memory([results]));
    assert!(matches!(error, CardError::Session(SessionError::Unexpected(_))), "{error}");
}

#[test]
fn wrong_words_in_any_pattern_fail_the_card() {
    let wrong = WrongWords { count: 1, bits: 1, first: Some(WrongWord { index: 3, expected: 8, found: 9 }) };
    for place in 0..MemoryPattern::ALL.len() {
        let mut reports = MemoryPattern::ALL.map(end);
        reports[place].wrong = wrong;
        let test = test_of(Chip::with_memory(reports.map(Reply::MemoryTested))).unwrap();
        assert!(!test.is_passed());
        let counts: Vec<u32> = test.patterns.iter().map(|test| test.wrong.count).collect();
        assert_eq!(counts.iter().position(|&count| count == 1), Some(place), "{counts:?}");
    }
}

/// Observer that stops the self-test once this number of bytes is tested.
struct Stop(u64, AtomicBool);

impl Observer for Stop {
    fn progress(&self, phase: Phase, done: u64, total: u64) {
        assert!(phase == Phase::SelfTest && done <= total);
        self.1.fetch_or(done >= self.0, Ordering::Relaxed);
    }

    fn is_stopped(&self) -> bool {
        self.1.load(Ordering::Relaxed)
    }
}

#[test]
fn an_observer_stops_the_test() {
    let mut chip = Chip::new(compute);
    // After two reports, the card only says that it is still at work.
    chip.memory.truncate(2);
    let stop = Stop(4 * MICRO.dram_bytes, AtomicBool::new(false));
    let result = self_test_on(&mut chip, "card 0", &stop);
    assert!(matches!(result, Err(RenderError::Stopped)), "{result:?}");
}

proptest! {
    /// The expected results are those of IEEE 754. A sum, product, quotient or root in double precision has
    /// so many digits that rounding it once more to `f32` gives the correctly rounded result (Figueroa 1995).
    #[test]
    fn the_hosts_results_are_correctly_rounded(bits in any::<[u32; 3]>()) {
        let operands = bits.map(f32::from_bits);
        let [a, b, c] = operands.map(f64::from);
        let product = f64::from((a * b) as f32);
        let expected = [a + b, a - b, a * b, a / b, product + c, c - product, a.sqrt(), a.floor(), a.ceil()];
        for (found, expected) in compute(operands).into_iter().zip(expected) {
            let (found, expected) = (f32::from_bits(found), expected as f32);
            prop_assert!(found.to_bits() == expected.to_bits() || found.is_nan() && expected.is_nan());
        }
    }
}

/// Compares results with recorded bits, which every processor must compute.
#[test]
fn results_equal_the_recorded_bits() {
    let tiny = f32::MIN_POSITIVE;
    let half = 1.0 + 2.0_f32.powi(-12);
    let fused = compute([half, half, -(1.0 + 2.0_f32.powi(-11))]);
    assert_eq!((fused[4], fused[5]), (0, (-(2.0 + 2.0_f32.powi(-10))).to_bits()));
    let denormal = compute([tiny, 0.5, 0.0]);
    assert_eq!(denormal[2], 0x0040_0000);
    let ends = compute([f32::NAN, -1.5, f32::NEG_INFINITY]);
    assert_eq!((ends[0], ends[17], ends[18], ends[19], ends[20]), (0x7fc0_0000, 0, 0, 0, 0));
    let large = compute([-9.3e18, 1.0, 0.0]);
    assert_eq!((large[17], large[18], large[19], large[20]), (0x8000_0000, 0, 0x8000_0000, 1));
    // sin, cos and exp of 1, and pow and atan2 of 1 and 2.
    let functions = compute([1.0, 2.0, 0.0]);
    assert_eq!(functions[12..17], [0x3f57_6aa4, 0x3f0a_5140, 0x402d_f854, 0x3f80_0000, 0x3eed_6338]);
}
