//! Test of a chip's arithmetic. Its results are compared, bit for bit, with the host's.

use std::f32::consts::PI;

use photoncard_cards::session::Event;
use photoncard_firmware::sampler::hash;
use photoncard_firmware::self_test::arithmetic::{EXPRESSIONS, compute};
use photoncard_shared::link::Port;
use photoncard_shared::message::{CASES_PER_COMMAND, RESULTS};

use super::bench::Bench;
use crate::greeting::GreetingError;

/// Result of the test of a chip's arithmetic.
#[derive(Clone, Debug)]
pub struct ArithmeticTest {
    /// Number of operand triples (a, b, c).
    pub cases: usize,
    /// Number of results that were compared.
    pub results: usize,
    /// Expressions with wrong results.
    pub wrong: Vec<WrongResults>,
}

/// Wrong results of an expression.
#[derive(Clone, Copy, Debug)]
pub struct WrongResults {
    /// Expression in the operands `a`, `b` and `c`.
    pub expression: &'static str,
    /// Number of wrong results.
    pub count: usize,
    /// The first wrong result.
    pub first: WrongResult,
}

/// A result of the chip that differs from the host's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WrongResult {
    /// The operands `a`, `b` and `c`.
    pub operands: [f32; 3],
    /// Bits of the host's result.
    pub expected: u32,
    /// Bits of the chip's result.
    pub found: u32,
}

impl WrongResult {
    /// Likely cause of the difference; `None` if it is not typical of compilers or processors.
    pub fn cause(&self) -> Option<&'static str> {
        let [a, b, c] = self.operands;
        let [expected, found] = [self.expected, self.found].map(f32::from_bits);
        let is_fused = |apart: f32, fused: f32| apart == expected && fused == found;
        if is_fused(a * b + c, a.mul_add(b, c)) || is_fused(c - a * b, (-a).mul_add(b, c)) {
            Some("a multiplication and an addition are fused")
        } else if found == 0.0 && expected.is_subnormal() || self.operands.into_iter().any(f32::is_subnormal)
        {
            Some("denormal numbers are flushed to zero")
        } else if self.found.abs_diff(self.expected) == 1 {
            Some("results are rounded in another direction")
        } else {
            None
        }
    }
}

pub(super) fn test<P: Port>(bench: &mut Bench<P>) -> Result<ArithmeticTest, GreetingError> {
    let cases = cases();
    let mut wrong: [Option<WrongResults>; RESULTS] = [None; RESULTS];
    for cases in cases.chunks(CASES_PER_COMMAND) {
        let operands: Vec<_> = cases.iter().map(operand_bytes).collect();
        bench.session.compute(&operands, bench.now());
        let results = loop {
            if let Event::Computed(results) = bench.next_event()? {
                break results;
            }
        };
        // The session has checked the number of results.
        let found = results.as_chunks().0.iter().map(|&word| u32::from_le_bytes(word));
        let expected = cases.iter().flat_map(|&operands| {
            let named = EXPRESSIONS.into_iter().zip(compute(operands));
            named
                .enumerate()
                .map(move |(place, (expression, expected))| (place, expression, operands, expected))
        });
        for ((place, expression, operands, expected), found) in expected.zip(found) {
            if expected != found {
                let first = WrongResult { operands, expected, found };
                let entry = wrong[place].get_or_insert(WrongResults { expression, count: 0, first });
                entry.count += 1;
            }
        }
    }
    let wrong = wrong.into_iter().flatten().collect();
    Ok(ArithmeticTest { cases: cases.len(), results: cases.len() * RESULTS, wrong })
}

fn operand_bytes(operands: &[f32; 3]) -> [u8; 12] {
    let mut bytes = [0; 12];
    for (target, operand) in bytes.as_chunks_mut().0.iter_mut().zip(operands) {
        *target = operand.to_le_bytes();
    }
    bytes
}

/// Number of cases with random operands.
const RANDOM_CASES: u32 = 240;

/// Operands of the test: some chosen to reveal fused multiply-adds, flushed denormal numbers or another
/// rounding mode, and random ones.
fn cases() -> Vec<[f32; 3]> {
    let ulp = f32::EPSILON;
    let denormal = f32::MIN_POSITIVE / 2.0;
    let half = 1.0 + 2.0_f32.powi(-12);
    let special = [
        // a * b lies halfway between two numbers: the exact product less c is not zero.
        [half, half, -(1.0 + 2.0_f32.powi(-11))],
        [1.0 + ulp, 1.0 - ulp, -1.0],
        [0.1, 10.0, -1.0],
        // Sums halfway between two numbers, and just above and below.
        [1.0, ulp / 2.0, 1.0],
        [1.0 + ulp, ulp / 2.0, -1.0],
        [1.0, 0.75 * ulp, -1.0],
        [-1.0, ulp / 4.0, 1.0],
        [1.0, 3.0, -1.0 / 3.0],
        // Denormal operands, and results of normal ones.
        [denormal, denormal, denormal],
        [f32::MIN_POSITIVE, 0.5, -denormal],
        [1.5 * f32::MIN_POSITIVE, f32::MIN_POSITIVE, 1.0],
        [f32::from_bits(1), 2.0, -0.0],
        [f32::MIN_POSITIVE, f32::MAX, 1.0],
        // Ends of the ranges of integers and of numbers.
        [16_777_217.0, 2_147_483_648.0, -2_147_483_648.0],
        [9.223_372e18, f32::INFINITY, -0.0],
        [f32::NAN, -1.5, f32::NEG_INFINITY],
        [f32::INFINITY, 1.0, 1.0],
        [-0.0, 1.0, 1.0],
    ];
    let random = (0..RANDOM_CASES).map(|case| {
        [0, 1, 2].map(|operand| {
            let bits = hash(3 * case + operand);
            match case % 3 {
                // Any number at all, a number of a render's magnitudes, or an angle.
                0 => f32::from_bits(bits),
                1 => f32::from_bits(bits & 0x807f_ffff | (107 + hash(bits) % 40) << 23),
                _ => (bits as f32 / u32::MAX as f32 - 0.5) * 4.0 * PI,
            }
        })
    });
    special.into_iter().chain(random).collect()
}
