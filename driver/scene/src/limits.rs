//! Limits of emission.

/// Maximum emission in each channel: of surfaces and the environment in W/(sr m^2), of lights without extent
/// in their unit of intensity. Its products and squares are finite in single precision.
pub const BRIGHTEST: f32 = 1e20;

/// Range of non-zero emission, whose products and squares neither overflow nor underflow in single precision.
pub(super) const EMISSION: std::ops::RangeInclusive<f32> = 1e-20..=BRIGHTEST;
