//! Limits of emission.

/// Maximum emission in each channel: W/(sr m^2) of surfaces and the environment, W/sr or W/m^2 of punctual
/// lights. Its product with a factor up to 1e18 fits in single precision.
pub const BRIGHTEST: f32 = 1e20;

/// Range of non-zero emission. Products with factors of 1e-18 to 1e18 fit in single precision.
pub(super) const EMISSION: std::ops::RangeInclusive<f32> = 1e-20..=BRIGHTEST;
