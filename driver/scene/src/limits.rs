//! Limits of emission.

/// Maximum emission in each channel: W/(sr m^2) of surfaces and the environment, W/sr or W/m^2 of punctual
/// lights. It leaves single precision, up to 3e38, room for products.
pub const BRIGHTEST: f32 = 1e20;

/// Range of non-zero emission, which leaves single precision, 1e-38 to 3e38, room for products.
pub(super) const EMISSION: std::ops::RangeInclusive<f32> = 1e-20..=BRIGHTEST;
