//! Bounds of emission.

/// The brightest that anything may shine, in each channel: surfaces and the environment in W/(sr m^2), lights without
/// extent in their unit of intensity. Products and squares of it stay within single precision.
pub const BRIGHTEST: f32 = 1e20;

/// The range of what emits at all: products and squares of it stay within single precision, too.
pub(super) const EMISSION: std::ops::RangeInclusive<f32> = 1e-20..=BRIGHTEST;
