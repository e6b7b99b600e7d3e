//! Self-test of the arithmetic that pictures depend on. Its results must be equal, bit for bit, on every
//! processor.
//!
//! A host sends operands and computes the same expressions itself. If a chip's results differ, the chip
//! flushes denormal numbers to zero, uses another rounding mode, or runs code with fused multiply-adds.

use photoncard_shared::message::{OPERAND_BYTES, RESULT_BYTES, RESULTS};

use crate::vector::sqrt;

/// Expressions that the self-test computes, as text, with the operands `a`, `b` and `c`. `bits` gives the
/// bits of its arguments as one integer.
pub const EXPRESSIONS: [&str; RESULTS] = [
    "a + b",
    "a - b",
    "a * b",
    "a / b",
    "a * b + c",
    "c - a * b",
    "sqrt(a)",
    "floor(a)",
    "ceil(a)",
    "bits(c) as i32 as f32",
    "bits(a, b) as i64 as f32",
    "a * b - b * c in f64, as f32",
    "sin(a)",
    "cos(a)",
    "exp(a)",
    "pow(a, b)",
    "atan2(a, b)",
    "a as i32",
    "a as i64, lower half",
    "a as i64, upper half",
    "a < b, a = b, a > b",
];

/// Bits of a result. All NaNs are mapped to the same bits, because processors differ in the NaN that an
/// operation returns, and no pixel depends on these bits.
fn bits(value: f32) -> u32 {
    if value.is_nan() { f32::NAN.to_bits() } else { value.to_bits() }
}

/// Results of [`EXPRESSIONS`] for the operands `a`, `b` and `c`.
pub fn compute([a, b, c]: [f32; 3]) -> [u32; RESULTS] {
    let [of_a, of_b, of_c] = [a, b, c].map(f32::to_bits);
    let long = ((u64::from(of_b) << 32) | u64::from(of_a)) as i64;
    let double = f64::from(a) * f64::from(b) - f64::from(b) * f64::from(c);
    let whole = (a as i64) as u64;
    let comparison = u32::from(a < b) | u32::from(a == b) << 1 | u32::from(a > b) << 2;
    [
        bits(a + b),
        bits(a - b),
        bits(a * b),
        bits(a / b),
        bits(a * b + c),
        bits(c - a * b),
        bits(sqrt(a)),
        bits(libm::floorf(a)),
        bits(libm::ceilf(a)),
        bits(of_c as i32 as f32),
        bits(long as f32),
        bits(double as f32),
        bits(libm::sinf(a)),
        bits(libm::cosf(a)),
        bits(libm::expf(a)),
        bits(libm::powf(a, b)),
        bits(libm::atan2f(a, b)),
        a as i32 as u32,
        whole as u32,
        (whole >> 32) as u32,
        comparison,
    ]
}

/// Results for a triple of operands, in the wire format.
#[cold]
#[inline(never)]
pub fn compute_bytes(operands: &[u8; OPERAND_BYTES]) -> [u8; RESULT_BYTES] {
    let mut triple = [0.0; 3];
    for (operand, bytes) in triple.iter_mut().zip(operands.as_chunks().0) {
        *operand = f32::from_le_bytes(*bytes);
    }
    let mut bytes = [0; RESULT_BYTES];
    for (target, result) in bytes.as_chunks_mut().0.iter_mut().zip(compute(triple)) {
        *target = result.to_le_bytes();
    }
    bytes
}
