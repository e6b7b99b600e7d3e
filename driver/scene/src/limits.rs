//! Limits of emission.

/// Maximum emission in each channel: W/(sr m^2) of surfaces and the environment, the unit of intensity of
/// punctual lights. Products and squares of it are finite in single precision.
pub const BRIGHTEST: f32 = 1e20;

/// Range of non-zero emission. Its products and squares neither overflow nor underflow in single precision.
pub(super) const EMISSION: std::ops::RangeInclusive<f32> = 1e-20..=BRIGHTEST;
